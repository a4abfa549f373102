//! The surface of a part in small triangles, each with its area and the place in its middle.
//!
//! Enters: the part and a distance. Leaves: triangles no side of which is longer than about that, on facets exactly and on
//! patches in their parameters, that together are the whole surface. mm, mm².

use std::collections::HashMap;

use part::{Part, PatchPoint};

use crate::along_normals::{Net, NetPlace, Site};

/// The surface in triangles.
pub(super) struct Pieces {
    /// Corners and triangles.
    pub net: Net,
    /// The place in the middle of each triangle.
    pub middles: Vec<NetPlace>,
    /// Area of each, mm².
    pub areas: Vec<f64>,
    /// Bound of the error of the sum of all areas, mm².
    pub area_error: f64,
}

impl Pieces {
    /// Of a part, about `spacing` mm across.
    pub fn of(part: &Part, spacing: f64) -> Self {
        let net = if part.patches().is_empty() { facets(part) } else { Net::over(part, spacing) };
        Self::new(part, divided(part, net, |_| true, spacing))
    }

    fn new(part: &Part, net: Net) -> Self {
        let found = work::parallel::map(net.triangles.len(), |t| {
            let corners = net.triangles[t].map(|k| net.places[k as usize]);
            (corners[0].towards(&corners[1], 0.5, part).towards(&corners[2], 1.0 / 3.0, part), flat(&corners))
        });
        let (middles, flat): (Vec<NetPlace>, Vec<f64>) = found.into_iter().unzip();
        let areas: Vec<f64> =
            (0..middles.len()).map(|t| on_patch(part, &net, t, &middles[t]).unwrap_or(flat[t])).collect();
        // Chords are too short by about as much as the middle is off the mean.
        let area_error = areas.iter().zip(&flat).map(|(a, b)| (a - b).abs()).sum();
        Self { net, middles, areas, area_error }
    }

    /// The chosen triangles, divided until no side is longer than `spacing` mm.
    pub fn chosen(&self, part: &Part, chosen: impl Fn(usize) -> bool, spacing: f64) -> Net {
        let net =
            Net { places: self.net.places.clone(), triangles: self.net.triangles.clone(), grids: Vec::new() };
        compact(divided(part, net, chosen, spacing))
    }
}

/// The facets of a mesh as they are.
fn facets(part: &Part) -> Net {
    let mut net = Net { places: Vec::new(), triangles: Vec::new(), grids: Vec::new() };
    for t in 0..part.mesh().triangles().len() {
        let first = net.places.len() as u32;
        let normal = part.mesh().normal(t);
        let place = |point| NetPlace { site: Site::Facet { triangle: t as u32, point }, point, normal };
        net.places.extend(part.mesh().corners(t).map(place));
        net.triangles.push([first, first + 1, first + 2]);
    }
    net
}

/// The chosen triangles of a net; the longest side is halved while it is longer than `spacing` mm.
fn divided(part: &Part, mut net: Net, chosen: impl Fn(usize) -> bool, spacing: f64) -> Net {
    let mut open: Vec<[u32; 3]> = std::mem::take(&mut net.triangles)
        .into_iter()
        .enumerate()
        .filter(|(t, _)| chosen(*t))
        .map(|(_, t)| t)
        .collect();
    let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
    while let Some(t) = open.pop() {
        let side = |k: usize| {
            let [a, b] = [t[k], t[(k + 1) % 3]].map(|k| net.places[k as usize].point);
            (b - a).norm()
        };
        let longest = (0..3).max_by(|a, b| side(*a).total_cmp(&side(*b))).unwrap_or(0);
        if side(longest) <= spacing * (1.0 + 1e-9) {
            net.triangles.push(t);
            continue;
        }
        let [a, b, c] = [0, 1, 2].map(|k| t[(longest + k) % 3]);
        let places = &mut net.places;
        let middle = *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
            let place = places[a as usize].towards(&places[b as usize], 0.5, part);
            places.push(place);
            places.len() as u32 - 1
        });
        // The lesser corners first: triangles leave in the order of the surface.
        open.extend([[middle, b, c], [a, middle, c]]);
    }
    net
}

/// A net without the places that none of its triangles has.
fn compact(net: Net) -> Net {
    let mut index = vec![u32::MAX; net.places.len()];
    let mut places = Vec::new();
    let mut number = |k: u32| {
        let at = &mut index[k as usize];
        if *at == u32::MAX {
            *at = places.len() as u32;
            places.push(net.places[k as usize]);
        }
        *at
    };
    let triangles = net.triangles.iter().map(|t| t.map(&mut number)).collect();
    Net { places, triangles, grids: Vec::new() }
}

/// Area of a triangle between its corners, mm².
fn flat(corners: &[NetPlace; 3]) -> f64 {
    let [a, b, c] = corners.map(|place| place.point);
    0.5 * (b - a).cross(&(c - a)).norm()
}

/// Area of a triangle of a patch by the metric in its middle, mm²; `None` on a mesh.
fn on_patch(part: &Part, net: &Net, t: usize, middle: &NetPlace) -> Option<f64> {
    let Site::Patch(PatchPoint { patch, u, v }) = middle.site else { return None };
    let [a, b, c] = net.triangles[t].map(|k| match net.places[k as usize].site {
        Site::Patch(at) => [at.u, at.v],
        Site::Facet { .. } => [0.0; 2],
    });
    let parameters = 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])).abs();
    let jet = part.patches()[patch as usize].jet(u, v);
    Some(jet.du.cross(&jet.dv).norm() * parameters)
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{Point3, TriangleMesh, samples};
    use part::Patch;

    #[test]
    fn facets_are_divided_along_their_longest_sides_and_lose_no_area() {
        let corners = [[0.0, 0.0, 0.0], [50.0, 0.0, 3.0], [0.0, 0.1, 0.0], [50.0, 0.1, 3.0]];
        let mesh =
            TriangleMesh::new(corners.map(Point3::from).to_vec(), vec![[0, 1, 2], [1, 3, 2]]).unwrap().0;
        let exact = 0.1 * 2509f64.sqrt();
        let part = Part::from_mesh(mesh);
        let pieces = Pieces::of(&part, 0.5);
        assert!((pieces.areas.iter().sum::<f64>() - exact).abs() < 1e-12 && pieces.area_error < 1e-12);
        assert!(pieces.areas.len() < 6000, "{}", pieces.areas.len());
        let one = pieces.chosen(&part, |t| t == 7, 0.2);
        let area: f64 = one.triangles.iter().map(|t| flat(&t.map(|k| one.places[k as usize]))).sum();
        assert!((area - pieces.areas[7]).abs() < 1e-12 && one.places.len() < 3 * one.triangles.len());
    }

    #[test]
    fn the_area_of_a_patch_is_right_within_its_bound() {
        let dome = samples::hemisphere(Point3::origin(), 10.0);
        let part = Part::from_patches(vec![Patch::Nurbs(dome)], 0.05).unwrap();
        let exact = 200.0 * std::f64::consts::PI;
        let off = [1.0, 0.5].map(|spacing| {
            let pieces = Pieces::of(&part, spacing);
            let off = (pieces.areas.iter().sum::<f64>() - exact).abs();
            assert!(
                off <= pieces.area_error && pieces.area_error < 0.02 * exact,
                "{off} {}",
                pieces.area_error
            );
            off
        });
        assert!(off[1] < 0.6 * off[0], "the pole is of first order: {off:?}");
    }
}
