//! Level curves of a function given at the vertices of a mesh.
//!
//! A level crosses a triangle through two of its sides, or not at all: values equal to the level count
//! as above it. Crossings are chained from triangle to triangle, so that every piece of a level is
//! found once, open (border to border) or closed. Where a side is crossed follows from the values and
//! the recovered gradients at its two ends, by a cubic: linear interpolation would put the crossings
//! of neighbouring sides off by different amounts, and the curve would wiggle by ⅛ ℓ²|ψ''|/|ψ'| over
//! edges of length ℓ.

use super::{FieldMesh, vertex_gradients};
use geometry::{Point3, Vector3};

/// Parts of the range of values that keep lists of their triangles. More find a level's triangles
/// with fewer looks and take memory.
const BINS: usize = 2048;

/// Steps of the search for a crossing; each at least halves its bracket.
const CROSSING_STEPS: usize = 40;

/// How closely a crossing is placed, as a share of its edge.
const CROSSING_PRECISION: f64 = 1e-12;

/// A point of a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshPoint {
    /// Which triangle.
    pub triangle: u32,
    /// Barycentric coordinates, in the order of its corners.
    pub weights: [f64; 3],
    /// Position, mm.
    pub position: Point3,
}

/// A piece of a level curve: where it crosses one edge after the other, so that two neighbouring
/// points lie in one triangle, which the first of them names.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshCurve {
    /// Points, in order. Higher values lie to the left, seen from outside.
    pub points: Vec<MeshPoint>,
    /// The last point is joined to the first one.
    pub closed: bool,
}

impl MeshCurve {
    /// Length, mm.
    pub fn length(&self) -> f64 {
        let n = self.points.len();
        let joints = if self.closed { n } else { n.saturating_sub(1) };
        (0..joints).map(|k| (self.points[(k + 1) % n].position - self.points[k].position).norm()).sum()
    }
}

/// Finds level curves of one function.
#[derive(Debug, Clone)]
pub struct MeshLevels<'a> {
    mesh: &'a FieldMesh,
    values: &'a [f64],
    gradients: Vec<Vector3>,
    range: [f64; 2],
    /// Where each bin's triangles begin in `triangles`, and the end.
    starts: Vec<u32>,
    triangles: Vec<u32>,
}

impl<'a> MeshLevels<'a> {
    /// Prepares for a function with `values` at the vertices.
    ///
    /// # Errors
    /// [`super::MeshFieldError::Invalid`] when there is not one finite value for each vertex.
    pub fn new(mesh: &'a FieldMesh, values: &'a [f64]) -> Result<Self, super::MeshFieldError> {
        if values.len() != mesh.points().len() || values.iter().any(|v| !v.is_finite()) {
            return Err(super::MeshFieldError::Invalid(format!(
                "{} vertices need as many finite values, and {} came",
                mesh.points().len(),
                values.iter().filter(|v| v.is_finite()).count()
            )));
        }
        let gradients = vertex_gradients(mesh, values);
        let range =
            values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], &v| [lo.min(v), hi.max(v)]);
        let mut levels = Self { mesh, values, gradients, range, starts: Vec::new(), triangles: Vec::new() };
        let bins: Vec<[usize; 2]> = mesh
            .triangles()
            .iter()
            .map(|corners| {
                let v = corners.map(|i| values[i as usize]);
                let (lo, hi) = (v[0].min(v[1]).min(v[2]), v[0].max(v[1]).max(v[2]));
                [levels.bin(lo), levels.bin(hi)]
            })
            .collect();
        let mut starts = vec![0u32; BINS + 1];
        for &[first, last] in &bins {
            (first..=last).for_each(|b| starts[b + 1] += 1);
        }
        for b in 0..BINS {
            starts[b + 1] += starts[b];
        }
        let mut next = starts.clone();
        let mut triangles = vec![0; starts[BINS] as usize];
        for (t, &[first, last]) in bins.iter().enumerate() {
            for b in first..=last {
                triangles[next[b] as usize] = t as u32;
                next[b] += 1;
            }
        }
        (levels.starts, levels.triangles) = (starts, triangles);
        Ok(levels)
    }

    /// The recovered gradient at a point of a triangle, by those of its corners.
    pub fn gradient_at(&self, p: &MeshPoint) -> Vector3 {
        let corners = self.mesh.triangles()[p.triangle as usize];
        (0..3).map(|k| self.gradients[corners[k] as usize] * p.weights[k]).sum()
    }

    /// Least and greatest value.
    pub fn range(&self) -> [f64; 2] {
        self.range
    }

    /// Recovered gradients at the vertices.
    pub fn gradients(&self) -> &[Vector3] {
        &self.gradients
    }

    fn bin(&self, value: f64) -> usize {
        let [lo, hi] = self.range;
        // A range of nothing makes 0/0, which becomes bin 0.
        ((value - lo) / (hi - lo) * BINS as f64).clamp(0.0, BINS as f64 - 1.0) as usize
    }

    /// Every piece of the level, open ones first, in the order of their first triangles.
    pub fn curves(&self, level: f64) -> Vec<MeshCurve> {
        if !(level >= self.range[0] && level <= self.range[1]) {
            return Vec::new();
        }
        let bin = self.bin(level);
        let all = &self.triangles[self.starts[bin] as usize..self.starts[bin + 1] as usize];
        let crossed: Vec<(u32, [usize; 2])> =
            all.iter().filter_map(|&t| Some((t, self.sides(t, level)?))).collect();
        let mut seen = vec![false; crossed.len()];
        let mut curves = Vec::new();
        for open in [true, false] {
            for start in 0..crossed.len() {
                let (t, [enter, _]) = crossed[start];
                if seen[start] || (open && self.mesh.neighbour(t as usize, enter).is_some()) {
                    continue;
                }
                let mut points = Vec::new();
                let mut at = start;
                loop {
                    seen[at] = true;
                    let (t, [enter, leave]) = crossed[at];
                    points.push(self.crossing(t, enter, level));
                    let next = self.mesh.neighbour(t as usize, leave);
                    match next.and_then(|n| crossed.binary_search_by_key(&(n as u32), |c| c.0).ok()) {
                        Some(next) if !seen[next] => at = next,
                        _ => {
                            if open {
                                points.push(self.crossing(t, leave, level));
                            }
                            break;
                        }
                    }
                }
                curves.push(MeshCurve { points, closed: !open });
            }
        }
        curves
    }

    /// The sides by which the level enters and leaves a triangle, with higher values on the left.
    fn sides(&self, t: u32, level: f64) -> Option<[usize; 2]> {
        let above = self.mesh.triangles()[t as usize].map(|i| self.values[i as usize] >= level);
        // With the higher part on its left, the curve comes in by the side that falls below the level,
        // seen counter-clockwise, and goes out by the one that rises above it.
        let falls = (0..3).find(|&k| above[k] && !above[(k + 1) % 3])?;
        let rises = (0..3).find(|&k| !above[k] && above[(k + 1) % 3])?;
        Some([falls, rises])
    }

    /// Where the level crosses side `k` of triangle `t`.
    fn crossing(&self, t: u32, k: usize, level: f64) -> MeshPoint {
        let corners = self.mesh.triangles()[t as usize];
        let (a, b) = (corners[k] as usize, corners[(k + 1) % 3] as usize);
        // Always from the lesser number to the greater one, so that both triangles get the same bits.
        let (lo, hi) = (a.min(b), a.max(b));
        let (p, q) = (self.mesh.points()[lo], self.mesh.points()[hi]);
        let edge = q - p;
        let slopes = [self.gradients[lo].dot(&edge), self.gradients[hi].dot(&edge)];
        let s = hermite_root([self.values[lo], self.values[hi]], slopes, level);
        let mut weights = [0.0; 3];
        let share_of_b = if lo == a { s } else { 1.0 - s };
        weights[k] = 1.0 - share_of_b;
        weights[(k + 1) % 3] = share_of_b;
        MeshPoint { triangle: t, weights, position: p + edge * s }
    }
}

/// Where the cubic with these values and slopes at 0 and 1 takes the value `level`, which lies between
/// the two: by Newton's method within a bracket. Along an edge that the level nearly follows the cubic
/// may turn back; any of its crossings will do.
fn hermite_root([from, to]: [f64; 2], slopes: [f64; 2], level: f64) -> f64 {
    let rise = to - from;
    let wanted = ((level - from) / rise).clamp(0.0, 1.0);
    let [d0, d1] = slopes.map(|d| d / rise);
    if !(wanted.is_finite() && d0.is_finite() && d1.is_finite()) {
        return 0.5;
    }
    // s (d0 + s (c2 + s c3)) rises from 0 to 1.
    let (c2, c3) = (3.0 - 2.0 * d0 - d1, d0 + d1 - 2.0);
    let (mut lo, mut hi, mut s) = (0.0, 1.0, wanted);
    for _ in 0..CROSSING_STEPS {
        let value = s * (d0 + s * (c2 + s * c3)) - wanted;
        if value < 0.0 {
            lo = s
        } else {
            hi = s
        }
        let slope = d0 + s * (2.0 * c2 + 3.0 * s * c3);
        let newton = s - value / slope;
        let next = if newton > lo && newton < hi { newton } else { 0.5 * (lo + hi) };
        let step = (next - s).abs();
        s = next;
        if step < CROSSING_PRECISION {
            break;
        }
    }
    s
}
