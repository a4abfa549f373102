//! A mesh of fewer vertices over the same surface, and functions carried from it to the finer one.
//!
//! Enters: a mesh and the length that its edges may have. Leaves: the mesh of some of its vertices, the others
//! drawn into a neighbour one by one (half-edge collapse, Hoppe 1996). Each remembers the ring that it stood in,
//! so that a function of the coarse mesh has a value there (mean value coordinates, Floater 2003).

use super::{FieldMesh, MeshFieldError};
use geometry::{Point3, Vector3, angle_between};

/// A vertex is not drawn into another where that turns a triangle by more than this, as a cosine (30°).
const TURNED: f64 = 0.866;

/// Nor where a triangle would have less area than this share of the square of its longest side.
const SLENDER: f64 = 0.05;

/// Nor along a border that turns by more than this there, as a cosine (30°).
const STRAIGHT: f64 = 0.866;

/// Rounds at most. In each, a vertex of which a neighbour went stays, so that vertices thin out evenly.
const MOST_ROUNDS: usize = 16;

/// A mesh of some of the vertices of a finer one.
#[derive(Debug, Clone)]
pub struct Coarser {
    /// The mesh.
    pub mesh: FieldMesh,
    /// The vertex of the finer mesh that each vertex is, ascending.
    pub kept: Vec<u32>,
    /// The other vertices of the finer mesh in the order in which they went, with the share of each neighbour
    /// in a value there.
    gone: Vec<(u32, Vec<(u32, f64)>)>,
}

impl Coarser {
    /// With edges of up to `length` (mm) wherever the surface lets them be so long.
    ///
    /// # Errors
    /// [`MeshFieldError::Mesh`] when what is left does not make a surface.
    pub fn new(mesh: &FieldMesh, length: f64) -> Result<Self, MeshFieldError> {
        let count = mesh.points().len();
        let at = (0..count).map(|v| mesh.triangles_at(v).to_vec()).collect();
        let mut thinned = Thinned { points: mesh.points(), triangles: mesh.triangles().to_vec(), at };
        let mut gone = Vec::new();
        for _ in 0..MOST_ROUNDS {
            let (mut stays, before) = (vec![false; count], gone.len());
            for v in 0..count as u32 {
                if stays[v as usize] || thinned.at[v as usize].is_empty() {
                    continue;
                }
                let ring = thinned.ring(v);
                if let Some(into) = thinned.neighbour_to_draw_into(v, &ring, length) {
                    gone.push((v, thinned.shares(v, &ring)));
                    ring.iter().for_each(|side| stays[side.vertex as usize] = true);
                    thinned.draw(v, into);
                }
            }
            if gone.len() == before {
                break;
            }
        }
        let kept: Vec<u32> = (0..count as u32).filter(|&v| !thinned.at[v as usize].is_empty()).collect();
        let mut number = vec![0; count];
        kept.iter().enumerate().for_each(|(k, &v)| number[v as usize] = k as u32);
        let alive = |t: &usize| thinned.at[thinned.triangles[*t][0] as usize].contains(&(*t as u32));
        let triangles = (0..thinned.triangles.len()).filter(alive);
        let triangles = triangles.map(|t| thinned.triangles[t].map(|v| number[v as usize])).collect();
        let points = kept.iter().map(|&v| mesh.points()[v as usize]).collect();
        let normals = kept.iter().map(|&v| mesh.normals()[v as usize]).collect();
        Ok(Self { mesh: FieldMesh::new(points, triangles, Some(normals))?, kept, gone })
    }

    /// What the finer mesh has at the vertices that are kept.
    pub fn of_finer<T: Clone>(&self, values: &[T]) -> Vec<T> {
        self.kept.iter().map(|&v| values[v as usize].clone()).collect()
    }

    /// A function of this mesh at the vertices of the finer one; a linear one of a plane stays linear.
    pub fn on_finer(&self, values: &[f64]) -> Vec<f64> {
        let mut finer = vec![0.0; self.kept.len() + self.gone.len()];
        self.kept.iter().zip(values).for_each(|(&v, &value)| finer[v as usize] = value);
        for (v, shares) in self.gone.iter().rev() {
            finer[*v as usize] = shares.iter().map(|&(w, share)| share * finer[w as usize]).sum();
        }
        finer
    }
}

/// A neighbour of a vertex.
struct Side {
    vertex: u32,
    /// Triangles at the edge to it.
    triangles: usize,
}

/// A mesh while vertices go.
struct Thinned<'a> {
    points: &'a [Point3],
    /// Also those that went.
    triangles: Vec<[u32; 3]>,
    /// The triangles at each vertex; none at one that went.
    at: Vec<Vec<u32>>,
}

impl Thinned<'_> {
    fn ring(&self, v: u32) -> Vec<Side> {
        let mut ring: Vec<Side> = Vec::with_capacity(8);
        for vertex in self.at[v as usize].iter().flat_map(|&t| self.triangles[t as usize]).filter(|&w| w != v)
        {
            match ring.iter_mut().find(|side| side.vertex == vertex) {
                Some(side) => side.triangles += 1,
                None => ring.push(Side { vertex, triangles: 1 }),
            }
        }
        ring
    }

    fn to(&self, v: u32, w: u32) -> Vector3 {
        self.points[w as usize] - self.points[v as usize]
    }

    /// The nearest neighbour into which a vertex can go; a vertex of a border goes along it.
    fn neighbour_to_draw_into(&self, v: u32, ring: &[Side], length: f64) -> Option<u32> {
        let border: Vec<u32> =
            ring.iter().filter(|side| side.triangles == 1).map(|side| side.vertex).collect();
        // Where fans meet in one point only, it has to stay.
        let mut into: Vec<u32> = match border[..] {
            [] => ring.iter().map(|side| side.vertex).collect(),
            [a, b] if self.to(a, v).normalize().dot(&self.to(v, b).normalize()) >= STRAIGHT => border,
            _ => return None,
        };
        into.sort_by(|&a, &b| self.to(v, a).norm_squared().total_cmp(&self.to(v, b).norm_squared()));
        into.into_iter().find(|&w| self.can_go(v, w, ring, length))
    }

    fn can_go(&self, v: u32, into: u32, ring: &[Side], length: f64) -> bool {
        // Neighbours of both that are not across a triangle of theirs would be joined twice.
        let others = self.ring(into);
        let common = ring.iter().filter(|a| others.iter().any(|b| a.vertex == b.vertex)).count();
        let shared = ring.iter().find(|side| side.vertex == into).map(|side| side.triangles);
        if shared != Some(common) {
            return false;
        }
        self.at[v as usize].iter().map(|&t| self.triangles[t as usize]).filter(|t| !t.contains(&into)).all(
            |t| {
                let area = |t: [u32; 3]| self.to(t[0], t[1]).cross(&self.to(t[0], t[2]));
                let moved = t.map(|w| if w == v { into } else { w });
                let longest =
                    (0..3).map(|k| self.to(moved[k], moved[(k + 1) % 3]).norm()).fold(0.0, f64::max);
                let (before, after) = (area(t), area(moved));
                longest <= length
                    && after.norm() >= 2.0 * SLENDER * longest * longest
                    && before.dot(&after) >= TURNED * before.norm() * after.norm()
            },
        )
    }

    /// How much each neighbour counts in a value at a vertex.
    fn shares(&self, v: u32, ring: &[Side]) -> Vec<(u32, f64)> {
        let mut border = ring.iter().filter(|side| side.triangles == 1).map(|side| side.vertex);
        if let (Some(a), Some(b)) = (border.next(), border.next()) {
            let (whole, part) = (self.to(a, b), self.to(a, v));
            let share = (part.dot(&whole) / whole.norm_squared()).clamp(0.0, 1.0);
            return vec![(a, 1.0 - share), (b, share)];
        }
        let mut shares: Vec<(u32, f64)> = ring.iter().map(|side| (side.vertex, 0.0)).collect();
        for &t in &self.at[v as usize] {
            let corners = self.triangles[t as usize];
            let k = corners.iter().position(|&w| w == v).unwrap_or(0);
            let [a, b] = [corners[(k + 1) % 3], corners[(k + 2) % 3]];
            let half = (0.5 * angle_between(&self.to(v, a), &self.to(v, b))).tan();
            for w in [a, b] {
                let distance = self.to(v, w).norm();
                shares.iter_mut().filter(|share| share.0 == w).for_each(|share| share.1 += half / distance);
            }
        }
        let sum: f64 = shares.iter().map(|share| share.1).sum();
        shares.iter_mut().for_each(|share| share.1 /= sum);
        shares
    }

    fn draw(&mut self, v: u32, into: u32) {
        for t in std::mem::take(&mut self.at[v as usize]) {
            if self.triangles[t as usize].contains(&into) {
                for w in self.triangles[t as usize] {
                    self.at[w as usize].retain(|&other| other != t);
                }
            } else {
                self.triangles[t as usize].iter_mut().filter(|w| **w == v).for_each(|w| *w = into);
                self.at[into as usize].push(t);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plate of 40 x 30 mm with a round hole, its vertices out of line, bent up by `height`.
    fn plate(height: f64, radius: f64) -> FieldMesh {
        let (nx, ny) = (81, 61);
        let place = |k: usize| {
            let (i, j) = (k % nx, k / nx);
            let inside = i > 0 && i + 1 < nx && j > 0 && j + 1 < ny;
            let shift = |pitch: f64| if inside { 0.15 * (k as f64 * pitch).sin() } else { 0.0 };
            [0.5 * i as f64 + shift(1.7), 0.5 * j as f64 + shift(2.9)]
        };
        let bent = |[x, y]: [f64; 2]| Point3::new(x, y, height * (0.2 * x).sin() * (0.25 * y).cos());
        let hole = |k: u32| {
            let [x, y] = place(k as usize);
            (x - 15.0).hypot(y - 14.0) < radius
        };
        let mut triangles = Vec::new();
        for k in (0..nx * (ny - 1)).filter(|k| k % nx + 1 < nx) {
            let [a, b, c, d] = [k, k + 1, k + nx + 1, k + nx].map(|k| k as u32);
            triangles.extend([[a, b, c], [a, c, d]].into_iter().filter(|t| !t.iter().any(|&k| hole(k))));
        }
        let mut used: Vec<u32> = triangles.iter().flatten().copied().collect();
        used.sort_unstable();
        used.dedup();
        let number = |k: u32| used.binary_search(&k).unwrap() as u32;
        let triangles = triangles.iter().map(|t| t.map(number)).collect();
        FieldMesh::new(used.iter().map(|&k| bent(place(k as usize))).collect(), triangles, None).unwrap()
    }

    #[test]
    fn a_coarser_mesh_is_the_same_surface() {
        for height in [0.0, 2.0] {
            let fine = plate(height, 5.0);
            let coarse = Coarser::new(&fine, 2.0).unwrap();
            let area = |mesh: &FieldMesh| (0..mesh.triangles().len()).map(|t| mesh.area(t)).sum::<f64>();
            assert!(
                (area(&coarse.mesh) / area(&fine) - 1.0).abs() < 0.02,
                "{} {}",
                area(&coarse.mesh),
                area(&fine)
            );
            assert_eq!(coarse.mesh.loops().len(), 2);
            assert!(coarse.kept.len() * 5 < fine.points().len(), "{}", coarse.kept.len());
            let length = |&[v, w]: &[u32; 2]| {
                (coarse.mesh.points()[w as usize] - coarse.mesh.points()[v as usize]).norm()
            };
            assert!(coarse.mesh.edges().iter().map(length).fold(0.0, f64::max) <= 2.0);
            for (k, &v) in coarse.kept.iter().enumerate() {
                assert_eq!(coarse.mesh.points()[k], fine.points()[v as usize]);
                assert!(coarse.mesh.area_vector(coarse.mesh.triangles_at(k)[0] as usize).z > 0.0);
            }
        }
    }

    #[test]
    fn functions_are_carried_over() {
        let linear = |p: &Point3| 3.0 + 0.7 * p.x - 1.3 * p.y;
        for (height, apart) in [(0.0, 1e-9), (2.0, 0.25)] {
            let fine = plate(height, 0.0);
            let coarse = Coarser::new(&fine, 2.0).unwrap();
            let on_all: Vec<f64> = fine.points().iter().map(linear).collect();
            let there = coarse.on_finer(&coarse.of_finer(&on_all));
            for v in 0..there.len() {
                assert!((there[v] - on_all[v]).abs() < apart, "{v}: {} {}", there[v], on_all[v]);
            }
        }
    }

    /// Two triangles that meet in one point, and a strip of one row, have nothing to give.
    #[test]
    fn what_cannot_be_coarser_stays() {
        let points = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]];
        let bow = FieldMesh::planar(&points, vec![[0, 1, 2], [0, 3, 4]]).unwrap();
        assert_eq!(Coarser::new(&bow, 9.0).unwrap().kept, [0, 1, 2, 3, 4]);
    }
}
