//! Normals and curvature of a mesh as a machinist sees it: smooth sheets that meet at creases.
//!
//! Enters: points and triangles; a facet of an STL file is a chord of a smooth surface unless the
//! triangles meet at more than the crease angle. Leaves: for every corner of a triangle the normal and
//! the second fundamental form of its own sheet, by quadratics fitted to the vertices around. One
//! sheet's corner of a vertex is a *wedge*; where no crease runs through a vertex it has one wedge.
//!
//! Refining a mesh interpolates what stands in its wedges, so that curvature is that of the vertices
//! that the file gave and not that of their flat facets.

use geometry::{Point3, Vector3, angle_between};
use work::parallel;

use super::FieldMesh;
use super::recover::Samples;

/// Triangles that meet at a greater angle than this are two sheets, as its cosine (30°). STL files of
/// smooth parts stay below 15° at usual tolerances; a greater angle smooths real edges, a lesser one
/// breaks coarse facets apart.
const CREASE_COSINE: f64 = 0.866;

/// Most vertices that one fit looks at. More cost time and average over more than the neighbourhood
/// asks for only on very fine meshes.
const MOST_SAMPLES: usize = 60;

/// Vertices that one worker handles at a time.
const CHUNK: usize = 256;

/// A symmetric 3 × 3 matrix `xx, xy, xz, yy, yz, zz`: the second fundamental form as a tensor in
/// space, 1/mm, positive where the surface is concave toward its outward normal.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Bend(pub [f64; 6]);

impl Bend {
    /// From the form in two tangents square to each other.
    pub fn new(e1: &Vector3, e2: &Vector3, [k11, k12, k22]: [f64; 3]) -> Self {
        let entry = |a: usize, b: usize| {
            k11 * e1[a] * e1[b] + k12 * (e1[a] * e2[b] + e2[a] * e1[b]) + k22 * e2[a] * e2[b]
        };
        Self([entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)])
    }

    /// Normal curvature along the unit tangent `d`, 1/mm.
    pub fn along(&self, d: &Vector3) -> f64 {
        self.between(d, d)
    }

    fn between(&self, a: &Vector3, b: &Vector3) -> f64 {
        let [xx, xy, xz, yy, yz, zz] = self.0;
        a.x * (xx * b.x + xy * b.y + xz * b.z)
            + a.y * (xy * b.x + yy * b.y + yz * b.z)
            + a.z * (xz * b.x + yz * b.y + zz * b.z)
    }

    /// Least and greatest curvature in the plane of two tangents square to each other, and the unit
    /// tangent of the least one.
    pub fn principal(&self, [e1, e2]: [Vector3; 2]) -> (f64, f64, Vector3) {
        let (a, b, c) = (self.between(&e1, &e1), self.between(&e1, &e2), self.between(&e2, &e2));
        let (mean, half) = (0.5 * (a + c), 0.5 * (a - c));
        let radius = half.hypot(b);
        // The greatest one stands at this angle, the least one square to it.
        let angle = 0.5 * b.atan2(half);
        (mean - radius, mean + radius, e2 * angle.cos() - e1 * angle.sin())
    }

    /// Weighted sum.
    pub fn add(&mut self, other: &Self, weight: f64) {
        for (a, b) in self.0.iter_mut().zip(other.0) {
            *a += weight * b;
        }
    }
}

/// The sheets of a mesh.
#[derive(Debug, Clone)]
pub struct Sheets {
    /// For every triangle its three wedges.
    pub corners: Vec<[u32; 3]>,
    /// Unit normal of each wedge.
    pub normals: Vec<Vector3>,
    /// Curvature of each wedge.
    pub bends: Vec<Bend>,
}

impl Sheets {
    /// Fits quadratics to the vertices of the same sheet within `radius` (mm), at least two rings of
    /// them; half a cutter's radius is what a cutter feels.
    ///
    /// # Tolerance
    /// Curvature is of first order in the length of the edges on scattered vertices, better on regular
    /// ones. Where a sheet has too few vertices to tell (a flat face of two triangles) it counts as flat.
    pub fn of(mesh: &FieldMesh, radius: f64) -> Self {
        let face: Vec<Vector3> = parallel::map(mesh.triangles().len(), |t| mesh.area_vector(t).normalize());
        let smooth =
            |t: usize, k: usize| mesh.neighbour(t, k).filter(|&n| face[t].dot(&face[n]) >= CREASE_COSINE);
        let (corners, vertex_of) = wedges(mesh, &smooth);
        let mut normals = vec![Vector3::zeros(); vertex_of.len()];
        let mut at_wedge: Vec<u32> = vec![0; vertex_of.len()];
        for (t, wedge) in corners.iter().enumerate() {
            let p = mesh.corners(t);
            for k in 0..3 {
                let (a, b) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
                normals[wedge[k] as usize] += face[t] * angle_between(&a, &b);
                at_wedge[wedge[k] as usize] = t as u32;
            }
        }
        for (normal, &t) in normals.iter_mut().zip(&at_wedge) {
            *normal = normal.try_normalize(1e-9).unwrap_or(face[t as usize]);
        }
        let fitted = |wedge: usize, walk: &mut Walk| -> (Vector3, Bend) {
            let (v, normal) = (vertex_of[wedge] as usize, normals[wedge]);
            let here = mesh.points()[v];
            walk.around(mesh, &smooth, at_wedge[wedge] as usize, &here, radius);
            let helper = if normal.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
            let e1 = normal.cross(&helper).normalize();
            let e2 = normal.cross(&e1);
            walk.samples.list.clear();
            for &w in walk.vertices.iter().filter(|&&w| w as usize != v) {
                let d = mesh.points()[w as usize] - here;
                walk.samples.list.push(([d.dot(&e1), d.dot(&e2)], d.dot(&normal), 1.0));
            }
            let Some([p, q, xx, xy, yy]) = walk.samples.fit() else { return (normal, Bend::default()) };
            // A slope that no smooth sheet has beside its mean normal: the vertices are a jumble.
            if xx == 0.0 && xy == 0.0 && yy == 0.0 || p.hypot(q) > 1.0 {
                return (normal, Bend::default());
            }
            // The graph z = px + qy + ½(…) over the plane of the mean normal, seen in its own frame.
            let tilt = (normal - e1 * p - e2 * q).normalize();
            let up = tilt.dot(&normal);
            let t1 = (e1 + normal * p).normalize();
            let t2 = tilt.cross(&t1);
            let form = |a: &Vector3, b: &Vector3| {
                let (ax, ay, bx, by) = (a.dot(&e1), a.dot(&e2), b.dot(&e1), b.dot(&e2));
                up * (2.0 * xx * ax * bx + xy * (ax * by + ay * bx) + 2.0 * yy * ay * by)
            };
            (tilt, Bend::new(&t1, &t2, [form(&t1, &t1), form(&t1, &t2), form(&t2, &t2)]))
        };
        let mut found = vec![(Vector3::zeros(), Bend::default()); vertex_of.len()];
        parallel::for_each_chunk(&mut found, CHUNK, |chunk, out| {
            let mut walk = Walk::default();
            for (k, found) in out.iter_mut().enumerate() {
                *found = fitted(chunk * CHUNK + k, &mut walk);
            }
        });
        let (normals, bends) = found.into_iter().unzip();
        Self { corners, normals, bends }
    }
}

/// Numbers the wedges: for every triangle its three, and the vertex of each.
fn wedges(mesh: &FieldMesh, smooth: &dyn Fn(usize, usize) -> Option<usize>) -> (Vec<[u32; 3]>, Vec<u32>) {
    let mut corners = vec![[u32::MAX; 3]; mesh.triangles().len()];
    let mut vertex_of = Vec::new();
    for t in 0..corners.len() {
        for k in 0..3 {
            if corners[t][k] != u32::MAX {
                continue;
            }
            let (v, wedge) = (mesh.triangles()[t][k], vertex_of.len() as u32);
            vertex_of.push(v);
            let mut open = vec![(t, k)];
            while let Some((t, k)) = open.pop() {
                if corners[t][k] != u32::MAX {
                    continue;
                }
                corners[t][k] = wedge;
                // The two sides at the corner.
                for side in [k, (k + 2) % 3] {
                    if let Some(n) = smooth(t, side)
                        && let Some(l) = mesh.triangles()[n].iter().position(|&i| i == v)
                    {
                        open.push((n, l));
                    }
                }
            }
        }
    }
    (corners, vertex_of)
}

/// Collects the vertices of a sheet around a place, ring by ring.
#[derive(Default)]
struct Walk {
    vertices: Vec<u32>,
    seen: std::collections::HashSet<u32>,
    samples: Samples,
}

impl Walk {
    /// All vertices of two rings of triangles, and of further ones within `radius` of `here`.
    fn around(
        &mut self,
        mesh: &FieldMesh,
        smooth: &dyn Fn(usize, usize) -> Option<usize>,
        start: usize,
        here: &Point3,
        radius: f64,
    ) {
        /// Triangles that are within two rings of a vertex lie within this many steps across sides.
        const SURELY: usize = 6;
        self.vertices.clear();
        self.seen.clear();
        self.seen.insert(start as u32);
        let mut ring = vec![start];
        let mut depth = 0;
        while !ring.is_empty() && self.vertices.len() < MOST_SAMPLES {
            let mut next = Vec::new();
            for &t in &ring {
                for v in mesh.triangles()[t] {
                    if !self.vertices.contains(&v) {
                        self.vertices.push(v);
                    }
                }
                for k in 0..3 {
                    let Some(n) = smooth(t, k).filter(|&n| self.seen.insert(n as u32)) else { continue };
                    let near = || mesh.corners(n).iter().any(|p| (p - here).norm() <= radius);
                    if depth < SURELY && self.vertices.len() < MOST_SAMPLES / 3 || near() {
                        next.push(n);
                    }
                }
            }
            ring = next;
            depth += 1;
        }
    }
}
