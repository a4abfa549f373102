//! Places of the design surface to be measured at, joined to triangles.
//!
//! Enters: the part and a distance. Leaves: points and outward unit normals no farther apart than that, on
//! patches exact and in even steps of the parameters, on meshes on the facets; and a way to ask for places in
//! between. mm.

use geometry::{Point3, Vector3};
use part::{Part, PatchPoint, SurfacePoint};

/// Where a place is on the part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Site {
    /// On a patch, by its parameters.
    Patch(PatchPoint),
    /// On a facet of a mesh.
    Facet { triangle: u32, point: Point3 },
}

/// A place of the design surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct NetPlace {
    pub site: Site,
    pub point: Point3,
    /// Outward unit normal.
    pub normal: Vector3,
}

/// An even grid of places on a patch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PatchGrid {
    /// Its first place; the others follow row by row, u running fastest.
    pub first: usize,
    /// Places along u and v.
    pub counts: [usize; 2],
    /// Mean distance of places along u and v, mm.
    pub pitch: [f64; 2],
    /// Range of the parameters.
    pub domain: [[f64; 2]; 2],
}

/// Places and the triangles between them.
#[derive(Clone, Default)]
pub(crate) struct Net {
    pub places: Vec<NetPlace>,
    pub triangles: Vec<[u32; 3]>,
    /// One grid a patch; none on meshes.
    pub grids: Vec<PatchGrid>,
}

/// Places along the sides of a patch by which its steps are chosen.
const SIDE_SAMPLES: usize = 32;

impl NetPlace {
    fn on(part: &Part, site: Site) -> Self {
        let (point, normal) = match site {
            Site::Patch(at) => part.point_and_normal(at),
            Site::Facet { triangle, point } => (point, part.mesh().normal(triangle as usize)),
        };
        Self { site, point, normal }
    }

    /// The foot of a place on the part.
    pub fn at_foot(foot: &SurfacePoint) -> Self {
        let facet = Site::Facet { triangle: foot.triangle, point: foot.point };
        Self { site: foot.at.map_or(facet, Site::Patch), point: foot.point, normal: foot.normal }
    }

    /// The place at the share `t` of the way to another of the same triangle.
    pub fn towards(&self, other: &Self, t: f64, part: &Part) -> Self {
        let site = match (self.site, other.site) {
            (Site::Patch(a), Site::Patch(b)) => Site::Patch(a.toward(&b, t)),
            (Site::Facet { triangle, point }, _) => {
                Site::Facet { triangle, point: point + (other.point - point) * t }
            }
            (site, _) => site,
        };
        Self::on(part, site)
    }
}

/// How many places a side would take, before any is laid out: for the memory.
pub fn net_places(part: &Part, spacing: f64) -> f64 {
    if part.patches().is_empty() {
        let mesh = part.mesh();
        let of = |t: usize| {
            let n = divisions(&mesh.corners(t), spacing) as f64;
            0.5 * (n + 1.0) * (n + 2.0)
        };
        return (0..mesh.triangles().len()).map(of).sum();
    }
    (0..part.patches().len())
        .map(|k| steps(part, k, spacing).0.iter().map(|n| *n as f64 + 1.0).product::<f64>())
        .sum()
}

/// Steps along u and v of a patch, and their mean lengths, mm.
fn steps(part: &Part, k: usize, spacing: f64) -> ([usize; 2], [f64; 2]) {
    let domain = part.patches()[k].domain();
    let at = |c: usize, t: f64| domain[c][0] + (domain[c][1] - domain[c][0]) * t;
    let share = |n: usize| n as f64 / SIDE_SAMPLES as f64;
    let point = |s: f64, t: f64| part.patches()[k].jet(at(0, s), at(1, t)).p;
    let (mut counts, mut pitch) = ([1; 2], [0.0; 2]);
    for c in 0..2 {
        let lines = (0..=SIDE_SAMPLES).map(|line| {
            let on =
                |n: usize| if c == 0 { point(share(n), share(line)) } else { point(share(line), share(n)) };
            // The longest step anywhere decides, not the mean along a line.
            let each = (0..SIDE_SAMPLES).map(|n| (on(n + 1) - on(n)).norm());
            each.fold((0.0f64, 0.0), |(most, sum), length| (most.max(length), sum + length))
        });
        let (most, sum) = lines.fold((0.0f64, 0.0f64), |(m, s), (most, sum)| (m.max(most), s.max(sum)));
        counts[c] = ((most * SIDE_SAMPLES as f64 / spacing).ceil() as usize).max(1);
        pitch[c] = sum / counts[c] as f64;
    }
    (counts, pitch)
}

/// Into how many parts each side of a facet is divided.
fn divisions(corners: &[Point3; 3], spacing: f64) -> usize {
    let side = |k: usize| (corners[(k + 1) % 3] - corners[k]).norm();
    ((0..3).map(side).fold(0.0, f64::max) / spacing).ceil().max(1.0) as usize
}

impl Net {
    /// Over a part, no step longer than about `spacing`, mm.
    pub fn over(part: &Part, spacing: f64) -> Self {
        let mut net = Self { places: Vec::new(), triangles: Vec::new(), grids: Vec::new() };
        if part.patches().is_empty() {
            (0..part.mesh().triangles().len()).for_each(|t| net.add_facet(part, t, spacing));
        }
        (0..part.patches().len()).for_each(|k| net.add_patch(part, k, spacing));
        net
    }

    /// Some triangles of places, without the places that none of them has.
    pub fn of_triangles(all: &[NetPlace], triangles: impl Iterator<Item = [u32; 3]>) -> Self {
        let mut index = vec![u32::MAX; all.len()];
        let mut places = Vec::new();
        let mut number = |k: u32| {
            let at = &mut index[k as usize];
            if *at == u32::MAX {
                *at = places.len() as u32;
                places.push(all[k as usize]);
            }
            *at
        };
        let triangles = triangles.map(|t| t.map(&mut number)).collect();
        Self { places, triangles, grids: Vec::new() }
    }

    fn add_patch(&mut self, part: &Part, k: usize, spacing: f64) {
        let (steps, pitch) = steps(part, k, spacing);
        let domain = part.patches()[k].domain();
        let (first, counts) = (self.places.len(), steps.map(|n| n + 1));
        let at =
            |c: usize, n: usize| domain[c][0] + (domain[c][1] - domain[c][0]) * n as f64 / steps[c] as f64;
        let rows = work::parallel::map(counts[1], |j| {
            let site = |i: usize| Site::Patch(PatchPoint { patch: k as u32, u: at(0, i), v: at(1, j) });
            (0..counts[0]).map(|i| NetPlace::on(part, site(i))).collect::<Vec<_>>()
        });
        self.places.reserve_exact(counts[0] * counts[1]);
        rows.into_iter().for_each(|row| self.places.extend(row));
        let index = |i: usize, j: usize| (first + j * counts[0] + i) as u32;
        self.triangles.reserve_exact(2 * steps[0] * steps[1]);
        for (i, j) in (0..steps[1]).flat_map(|j| (0..steps[0]).map(move |i| (i, j))) {
            let [a, b, c, d] = [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)];
            self.triangles.extend([[a, b, c], [a, c, d]]);
        }
        self.grids.push(PatchGrid { first, counts, pitch, domain });
    }

    fn add_facet(&mut self, part: &Part, t: usize, spacing: f64) {
        let corners = part.mesh().corners(t);
        let (n, first) = (divisions(&corners, spacing), self.places.len() as u32);
        let (e, f) = (corners[1] - corners[0], corners[2] - corners[0]);
        for (i, j) in (0..=n).flat_map(|j| (0..=n - j).map(move |i| (i, j))) {
            let point = corners[0] + (e * i as f64 + f * j as f64) / n as f64;
            self.places.push(NetPlace::on(part, Site::Facet { triangle: t as u32, point }));
        }
        // Rows get shorter by one place each.
        let index = |i: usize, j: usize| first + (j * (n + 1) - j * (j.max(1) - 1) / 2 + i) as u32;
        for (i, j) in (0..n).flat_map(|j| (0..n - j).map(move |i| (i, j))) {
            self.triangles.push([index(i, j), index(i + 1, j), index(i, j + 1)]);
            if i + j + 1 < n {
                self.triangles.push([index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{TriangleMesh, samples};
    use part::Patch;

    fn area(net: &Net) -> f64 {
        let of = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|k| net.places[k as usize].point);
            0.5 * (b - a).cross(&(c - a)).norm()
        };
        net.triangles.iter().map(of).sum()
    }

    fn longest(net: &Net) -> f64 {
        let sides = |t: &[u32; 3]| {
            let p = t.map(|k| net.places[k as usize].point);
            (0..3).map(|k| (p[(k + 1) % 3] - p[k]).norm()).fold(0.0, f64::max)
        };
        net.triangles.iter().map(sides).fold(0.0, f64::max)
    }

    #[test]
    fn a_facet_is_divided_evenly() {
        let corners = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 3.0, 0.0], [4.0, 3.0, 1.0]];
        let (mesh, _) =
            TriangleMesh::new(corners.map(Point3::from).to_vec(), vec![[0, 1, 2], [1, 3, 2]]).unwrap();
        let part = Part::from_mesh(mesh);
        let net = Net::over(&part, 0.7);
        assert_eq!(net.places.len() as f64, net_places(&part, 0.7));
        let exact = 6.0 + 0.5 * Vector3::new(0.0, 3.0, 1.0).cross(&Vector3::new(-4.0, 3.0, 0.0)).norm();
        assert!((area(&net) - exact).abs() < 1e-9, "{} {exact}", area(&net));
        assert!(longest(&net) <= 0.7, "{}", longest(&net));
    }

    #[test]
    fn a_patch_is_a_grid_on_the_surface() {
        let dome = samples::hemisphere(Point3::new(1.0, 2.0, 3.0), 10.0);
        let part = Part::from_patches(vec![Patch::Nurbs(dome)], 0.05).unwrap();
        let net = Net::over(&part, 0.5);
        assert_eq!(net.places.len() as f64, net_places(&part, 0.5));
        assert_eq!(net.places.len(), net.grids[0].counts.iter().product::<usize>());
        for place in &net.places {
            assert!(((place.point - Point3::new(1.0, 2.0, 3.0)) - place.normal * 10.0).norm() < 1e-5);
        }
        assert!((area(&net) / (200.0 * std::f64::consts::PI) - 1.0).abs() < 1e-3, "{}", area(&net));
        assert!(longest(&net) < 0.75, "{}: a diagonal", longest(&net));
        let t = net.triangles[net.triangles.len() / 2];
        let between = net.places[t[0] as usize].towards(&net.places[t[1] as usize], 0.3, &part);
        assert!(((between.point - Point3::new(1.0, 2.0, 3.0)).norm() - 10.0).abs() < 1e-12);
    }
}
