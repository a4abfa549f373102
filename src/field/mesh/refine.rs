//! Makes a mesh fit to carry fields: no edge longer than asked, flat pieces cut into well-shaped
//! triangles.
//!
//! Enters: points, triangles, and for every corner its wedge ([`super::Sheets`]). Leaves: the same
//! with more points, all on the facets given, and what stood at the wedges interpolated.

use std::collections::{HashMap, HashSet};

use super::{Bend, MeshFieldError, Sheets};
use foldhash::fast::FixedState;
use geometry::{Point3, Vector3, angle_between};

/// Greatest number of triangles of a refined mesh: what a machine of 8 GB factorises in seconds.
const MAX_TRIANGLES: usize = 2_000_000;

/// The diagonal of two triangles is exchanged where they lie in one plane within this angle, as its
/// cosine (2°): on facets, and not where it would cut off what the part's facets follow.
const FLAT_COSINE: f64 = 0.9994;

/// Rounds of exchanging diagonals after each round of splitting.
const FLIP_ROUNDS: usize = 4;

/// Opposite angles must pass half a turn by this much, as a sine, before a diagonal is exchanged: else
/// rounding would exchange those of a square back and forth.
const FLIP_GAIN: f64 = 1e-6;

/// What is known of edges, by their ends.
type Edges<T> = HashMap<(u32, u32), T, FixedState>;

/// A mesh in the making.
#[derive(Debug, Clone)]
pub struct Refined {
    /// Points, mm.
    pub points: Vec<Point3>,
    /// Corners as points.
    pub triangles: Vec<[u32; 3]>,
    /// Corners as wedges, with their normals and curvatures.
    pub sheets: Sheets,
}

impl Refined {
    /// Splits edges at their middles until none is longer than `length` (mm).
    ///
    /// # Errors
    /// [`MeshFieldError::Invalid`] when that would take too many triangles.
    pub fn refine(&mut self, length: f64) -> Result<(), MeshFieldError> {
        for _ in 0..64 {
            self.flip();
            if !self.split(length)? {
                return Ok(());
            }
        }
        Ok(())
    }

    /// Normals and curvature at the points: the means over their wedges, weighted by angles. At a
    /// crease the normal stands between those of the sheets.
    pub fn at_points(&self) -> (Vec<Vector3>, Vec<Bend>) {
        let count = self.points.len();
        let (mut normals, mut bends) = (vec![Vector3::zeros(); count], vec![Bend::default(); count]);
        let mut sums = vec![0.0; count];
        for (corners, wedges) in self.triangles.iter().zip(&self.sheets.corners) {
            let p = corners.map(|i| self.points[i as usize]);
            for k in 0..3 {
                let (a, b) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
                let angle = angle_between(&a, &b);
                let (v, wedge) = (corners[k] as usize, wedges[k] as usize);
                normals[v] += self.sheets.normals[wedge] * angle;
                bends[v].add(&self.sheets.bends[wedge], angle);
                sums[v] += angle;
            }
        }
        for v in 0..count {
            let weight = if sums[v] > 0.0 { 1.0 / sums[v] } else { 0.0 };
            normals[v] = normals[v].try_normalize(1e-9).unwrap_or_else(Vector3::z);
            bends[v].0.iter_mut().for_each(|b| *b *= weight);
        }
        (normals, bends)
    }

    /// The edges between two sheets, from their lesser to their greater point, ascending, and whether they
    /// stand out.
    /// Triangles lower than `least_height` (mm) have no direction to be told by.
    pub fn creases(&self, least_height: f64) -> Vec<([u32; 2], bool)> {
        let mut sides: Vec<([u32; 2], usize, usize)> = Vec::with_capacity(3 * self.triangles.len());
        for (t, corners) in self.triangles.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                sides.push(([a.min(b), a.max(b)], t, k));
            }
        }
        sides.sort_unstable();
        let crease = |pair: &[([u32; 2], usize, usize)]| {
            let [(edge, t, k), (other, n, l)] = *pair else { return None };
            let (wt, wn) = (&self.sheets.corners[t], &self.sheets.corners[n]);
            if edge != other || (wt[k] == wn[(l + 1) % 3] && wt[(k + 1) % 3] == wn[l]) {
                return None;
            }
            let [a, b, c] = self.triangles[t].map(|i| self.points[i as usize]);
            let across = self.points[self.triangles[n][(l + 2) % 3] as usize];
            let [p, q] = edge.map(|i| self.points[i as usize]);
            let opposite = self.points[self.triangles[t][(k + 2) % 3] as usize];
            let height = |tip: Point3| (tip - p).cross(&(q - p)).norm() / (q - p).norm();
            if height(opposite) < least_height || height(across) < least_height {
                return None;
            }
            Some((edge, (b - a).cross(&(c - a)).dot(&(across - a)) < 0.0))
        };
        sides.windows(2).filter_map(crease).collect()
    }

    /// The normals of the corners of every triangle, on `creases` each of its own sheet, elsewhere those of
    /// `normals`.
    pub fn corner_normals(&self, normals: &[Vector3], creases: &[([u32; 2], bool)]) -> Vec<[Vector3; 3]> {
        let mut several = vec![false; self.points.len()];
        creases.iter().flat_map(|c| c.0).for_each(|v| several[v as usize] = true);
        let at = |(corners, wedges): (&[u32; 3], &[u32; 3])| {
            [0, 1, 2].map(|k| match corners[k] as usize {
                v if several[v] => self.sheets.normals[wedges[k] as usize],
                v => normals[v],
            })
        };
        self.triangles.iter().zip(&self.sheets.corners).map(at).collect()
    }

    /// One round: every edge that is too long is split. False when there was none.
    fn split(&mut self, length: f64) -> Result<bool, MeshFieldError> {
        let (mut middles, mut wedge_middles) = (Edges::<u32>::default(), Edges::<u32>::default());
        let limit = length * length * (1.0 + 1e-9);
        let (triangles, wedges) =
            (std::mem::take(&mut self.triangles), std::mem::take(&mut self.sheets.corners));
        for (corners, wedge) in triangles.into_iter().zip(wedges) {
            let long = [0, 1, 2].map(|k| {
                let (a, b) = (corners[k] as usize, corners[(k + 1) % 3] as usize);
                (self.points[a] - self.points[b]).norm_squared() > limit
            });
            let count = long.iter().filter(|l| **l).count();
            if count == 0 {
                self.triangles.push(corners);
                self.sheets.corners.push(wedge);
                continue;
            }
            let mut m = [(0, 0); 3];
            for k in (0..3).filter(|&k| long[k]) {
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                let (wa, wb) = (wedge[k], wedge[(k + 1) % 3]);
                let points = &mut self.points;
                let middle = *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    let (p, q) = (points[a.min(b) as usize], points[a.max(b) as usize]);
                    points.push(Point3::from(0.5 * (p.coords + q.coords)));
                    points.len() as u32 - 1
                });
                let sheets = &mut self.sheets;
                let own = *wedge_middles.entry((wa.min(wb), wa.max(wb))).or_insert_with(|| {
                    let (a, b) = (wa.min(wb) as usize, wa.max(wb) as usize);
                    let normal = sheets.normals[a] + sheets.normals[b];
                    sheets.normals.push(normal.try_normalize(1e-9).unwrap_or(sheets.normals[a]));
                    let mut bend = Bend::default();
                    bend.add(&sheets.bends[a], 0.5);
                    bend.add(&sheets.bends[b], 0.5);
                    sheets.bends.push(bend);
                    sheets.normals.len() as u32 - 1
                });
                m[k] = (middle, own);
            }
            let c = [0, 1, 2].map(|k| (corners[k], wedge[k]));
            let mut add = |t: [(u32, u32); 3]| {
                self.triangles.push(t.map(|x| x.0));
                self.sheets.corners.push(t.map(|x| x.1));
            };
            match count {
                1 => {
                    let k = long.iter().position(|l| *l).unwrap_or(0);
                    let [a, b, d] = [c[k], c[(k + 1) % 3], c[(k + 2) % 3]];
                    add([a, m[k], d]);
                    add([m[k], b, d]);
                }
                2 => {
                    // Side k stays; between the other two stands corner k + 2.
                    let k = long.iter().position(|l| !*l).unwrap_or(0);
                    let [a, b, d] = [c[k], c[(k + 1) % 3], c[(k + 2) % 3]];
                    let (mb, md) = (m[(k + 1) % 3], m[(k + 2) % 3]);
                    add([mb, d, md]);
                    let p = |x: (u32, u32)| self.points[x.0 as usize];
                    if (p(a) - p(mb)).norm_squared() <= (p(b) - p(md)).norm_squared() {
                        add([a, b, mb]);
                        add([a, mb, md]);
                    } else {
                        add([a, b, md]);
                        add([b, mb, md]);
                    }
                }
                _ => {
                    add([c[0], m[0], m[2]]);
                    add([m[0], c[1], m[1]]);
                    add([m[2], m[1], c[2]]);
                    add(m);
                }
            }
            if self.triangles.len() > MAX_TRIANGLES {
                return Err(MeshFieldError::Invalid(format!(
                    "edges of at most {length} mm would take more than {MAX_TRIANGLES} triangles"
                )));
            }
        }
        Ok(!middles.is_empty())
    }

    /// Exchanges diagonals of flat pairs of triangles that a Delaunay triangulation would not have.
    fn flip(&mut self) {
        for _ in 0..FLIP_ROUNDS {
            let sides = Sides::of(&self.triangles, self.points.len());
            let mut exchanged: HashSet<(u32, u32), FixedState> = HashSet::default();
            let mut touched = vec![false; self.triangles.len()];
            for t in 0..self.triangles.len() {
                for k in 0..3 {
                    let corners = self.triangles[t];
                    let (a, b, c) = (corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]);
                    let Some((n, l)) = sides.find(b, a).filter(|&(n, _)| !touched[t] && !touched[n]) else {
                        continue;
                    };
                    let d = self.triangles[n][(l + 2) % 3];
                    let (wt, wn) = (self.sheets.corners[t], self.sheets.corners[n]);
                    let one_sheet = wt[k] == wn[(l + 1) % 3] && wt[(k + 1) % 3] == wn[l];
                    let is_side =
                        |from, to| sides.find(from, to).is_some() || exchanged.contains(&(from, to));
                    if !one_sheet || !self.gains([a, b, c, d]) || is_side(c, d) || is_side(d, c) {
                        continue;
                    }
                    let (wa, wb, wc, wd) = (wt[k], wt[(k + 1) % 3], wt[(k + 2) % 3], wn[(l + 2) % 3]);
                    self.triangles[t] = [c, a, d];
                    self.sheets.corners[t] = [wc, wa, wd];
                    self.triangles[n] = [d, b, c];
                    self.sheets.corners[n] = [wd, wb, wc];
                    (touched[t], touched[n]) = (true, true);
                    exchanged.insert((c, d));
                }
            }
            if exchanged.is_empty() {
                break;
            }
        }
    }

    /// True where the diagonal `ab` of the flat convex quadrilateral `adbc` should be `cd`.
    fn gains(&self, corners: [u32; 4]) -> bool {
        let [a, b, c, d] = corners.map(|i| self.points[i as usize]);
        let (n, m) = ((b - a).cross(&(c - a)), (a - b).cross(&(d - b)));
        let (x, y) = ((c - d).cross(&(a - d)), (d - c).cross(&(b - c)));
        let flat = n.dot(&m) > FLAT_COSINE * n.norm() * m.norm();
        let convex = x.dot(&n) > 0.0 && y.dot(&n) > 0.0;
        let angle = |tip: Point3| {
            let (p, q) = (a - tip, b - tip);
            (p.dot(&q), p.cross(&q).norm())
        };
        // sin of the sum of the angles at c and d, below zero past half a turn.
        let ((cc, cs), (dc, ds)) = (angle(c), angle(d));
        let sine = cs * dc + cc * ds;
        flat && convex && sine < -FLIP_GAIN * cc.hypot(cs) * dc.hypot(ds)
    }
}

/// The sides of triangles by the points that they begin at.
struct Sides {
    /// Where the sides of each point begin.
    starts: Vec<usize>,
    /// The point that a side ends at, its triangle, and its place there.
    sides: Vec<(u32, u32, u8)>,
}

impl Sides {
    /// Of triangles of so many points.
    fn of(triangles: &[[u32; 3]], points: usize) -> Self {
        let mut starts = vec![0; points + 1];
        triangles.iter().flatten().for_each(|&from| starts[from as usize + 1] += 1);
        (0..points).for_each(|p| starts[p + 1] += starts[p]);
        let mut sides = vec![(0, 0, 0); 3 * triangles.len()];
        let mut next = starts.clone();
        for (t, corners) in (0u32..).zip(triangles) {
            for k in 0..3 {
                let slot = &mut next[corners[k] as usize];
                sides[*slot] = (corners[(k + 1) % 3], t, k as u8);
                *slot += 1;
            }
        }
        Self { starts, sides }
    }

    /// The triangle that has a side from one point to another, and the place of that; the last of several.
    fn find(&self, from: u32, to: u32) -> Option<(usize, usize)> {
        let own = &self.sides[self.starts[from as usize]..self.starts[from as usize + 1]];
        own.iter().rfind(|side| side.0 == to).map(|&(_, t, k)| (t as usize, k.into()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_are_found_by_their_ends() {
        // Two triangles on one edge, and a third one that repeats a side of the first.
        let triangles = [[0, 1, 2], [2, 1, 3], [0, 1, 4]];
        let sides = Sides::of(&triangles, 5);
        let brute = |from: u32, to: u32| {
            let mut all = (0..triangles.len()).flat_map(|t| [0, 1, 2].map(|k| (t, k)));
            all.rfind(|&(t, k)| [triangles[t][k], triangles[t][(k + 1) % 3]] == [from, to])
        };
        for from in 0..5 {
            for to in 0..5 {
                assert_eq!(sides.find(from, to), brute(from, to), "{from} {to}");
            }
        }
        assert_eq!(
            (sides.find(0, 1), sides.find(1, 2), sides.find(2, 1)),
            (Some((2, 0)), Some((0, 1)), Some((1, 0)))
        );
    }
}
