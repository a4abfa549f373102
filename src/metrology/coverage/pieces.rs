//! The surface of a part in small triangles, each with its area and the place in its middle.
//!
//! Enters: the part and a distance. Leaves: triangles no side of which is longer than about that, on facets
//! exactly and on patches in their parameters, that together are the whole surface. mm, mm².

use std::collections::HashMap;
use std::ops::Range;

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

/// Facets of a mesh that are held at a time.
const BLOCK: usize = 1 << 14;

impl Pieces {
    /// Of a part, about `spacing` mm across: a block of facets at a time, patches all at once.
    pub fn of(part: &Part, spacing: f64) -> impl Iterator<Item = Self> {
        let facets_of = part.mesh().triangles().len();
        let blocks = if part.patches().is_empty() { facets_of.div_ceil(BLOCK) } else { 1 };
        (0..blocks).map(move |block| {
            let net = if part.patches().is_empty() {
                facets(part, block * BLOCK..((block + 1) * BLOCK).min(facets_of))
            } else {
                Net::over(part, spacing)
            };
            Self::new(part, divided(part, net, spacing))
        })
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

    /// The chosen triangles alone.
    pub fn chosen(self, chosen: impl Fn(usize) -> bool) -> Net {
        let Net { places, triangles, .. } = self.net;
        let triangles = triangles.into_iter().enumerate().filter(|(t, _)| chosen(*t)).map(|(_, t)| t);
        Net::of_triangles(&places, triangles)
    }
}

/// Adds the triangles of another net.
pub(super) fn join(net: &mut Net, other: Net) {
    let first = net.places.len() as u32;
    net.places.extend(other.places);
    net.triangles.extend(other.triangles.into_iter().map(|t| t.map(|k| first + k)));
}

/// Some facets of a mesh as they are.
fn facets(part: &Part, range: Range<usize>) -> Net {
    let mut net = Net::default();
    for t in range {
        let first = net.places.len() as u32;
        let normal = part.mesh().normal(t);
        let place = |point| NetPlace { site: Site::Facet { triangle: t as u32, point }, point, normal };
        net.places.extend(part.mesh().corners(t).map(place));
        net.triangles.push([first, first + 1, first + 2]);
    }
    net
}

/// The triangles of a net; the longest side is halved while it is longer than `spacing` mm.
pub(super) fn divided(part: &Part, mut net: Net, spacing: f64) -> Net {
    let mut open = std::mem::take(&mut net.triangles);
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
        let pieces = Pieces::of(&part, 0.5).next().unwrap();
        assert!((pieces.areas.iter().sum::<f64>() - exact).abs() < 1e-12 && pieces.area_error < 1e-12);
        assert!(pieces.areas.len() < 6000, "{}", pieces.areas.len());
        let exact = pieces.areas[7];
        let one = divided(&part, pieces.chosen(|t| t == 7), 0.2);
        let area: f64 = one.triangles.iter().map(|t| flat(&t.map(|k| one.places[k as usize]))).sum();
        assert!((area - exact).abs() < 1e-12 && one.places.len() < 3 * one.triangles.len());
    }

    #[test]
    fn the_area_of_a_patch_is_right_within_its_bound() {
        let dome = samples::hemisphere(Point3::origin(), 10.0);
        let part = Part::from_patches(vec![Patch::Nurbs(dome)], 0.05).unwrap();
        let exact = 200.0 * std::f64::consts::PI;
        let off = [1.0, 0.5].map(|spacing| {
            let pieces = Pieces::of(&part, spacing).next().unwrap();
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
