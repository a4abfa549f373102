//! Where feed directions on a mesh come from. Each source gives what is wanted at every vertex, to be
//! smoothed ([`super::smooth_lines`]) or blended with others ([`super::blend`]).

use super::{FieldMesh, Wanted};
use crate::geometry::{Aabb, Point3, Vector3};
use crate::parallel;

/// A border that turns by more than this at a vertex has no direction there, rad.
const CORNER: f64 = 0.6;

/// Tangents shorter than this, of unit vectors, have no direction.
const NO_DIRECTION: f64 = 1e-9;

/// Along a curve or square to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sense {
    /// Passes run along it.
    Along,
    /// Passes run across it.
    Across,
}

impl Sense {
    /// The feed for a curve with this tangent on a surface with this normal.
    fn feed(self, tangent: Vector3, normal: &Vector3) -> Vector3 {
        match self {
            Self::Along => tangent,
            Self::Across => normal.cross(&tangent),
        }
    }
}

/// The tangents whose plan view runs at a fixed angle from the x axis, rad.
pub fn fixed_angle(mesh: &FieldMesh, angle: f64) -> Vec<Wanted> {
    let across = Vector3::new(-angle.sin(), angle.cos(), 0.0);
    mesh.normals().iter().map(|n| across.cross(n).try_normalize(NO_DIRECTION).map(|t| (t, 1.0))).collect()
}

/// Up the slope, or level along it; the steeper the place the more it matters (as the sine of its
/// slope).
pub fn slope(mesh: &FieldMesh, up: bool) -> Vec<Wanted> {
    let at = |n: &Vector3| {
        let level = Vector3::z().cross(n);
        let steepness = level.norm();
        let direction = if up { n.cross(&level) } else { level };
        direction.try_normalize(NO_DIRECTION).map(|t| (t, steepness))
    };
    mesh.normals().iter().map(at).collect()
}

/// Along or across the borders, at their vertices except corners. Where passes reach the border they
/// follow it; inside, the field is as smooth as the borders allow.
pub fn borders(mesh: &FieldMesh, sense: Sense) -> Vec<Wanted> {
    let mut wanted = vec![None; mesh.points().len()];
    for ring in mesh.loops() {
        let n = ring.len();
        let at = |k: usize| mesh.points()[ring[k % n] as usize];
        for k in 0..n {
            let v = ring[k] as usize;
            let (before, after) = (at(k) - at(k + n - 1), at(k + 1) - at(k));
            let normal = &mesh.normals()[v];
            let flat = |d: Vector3| d - normal * normal.dot(&d);
            let (before, after) = (flat(before), flat(after));
            if before.cross(&after).norm().atan2(before.dot(&after)) > CORNER {
                continue;
            }
            wanted[v] = (before + after).try_normalize(NO_DIRECTION).map(|t| (sense.feed(t, normal), 1.0));
        }
    }
    wanted
}

/// Along or across guide curves, each a polyline, at the vertices within `reach` (mm) of it; the
/// nearest stretch counts.
pub fn guides(mesh: &FieldMesh, curves: &[Vec<Point3>], reach: f64, sense: Sense) -> Vec<Wanted> {
    let segments: Vec<[Point3; 2]> =
        curves.iter().flat_map(|c| c.windows(2).map(|w| [w[0], w[1]])).filter(|[a, b]| a != b).collect();
    let mut around = Aabb::EMPTY;
    segments.iter().flatten().for_each(|p| around.grow(p));
    let near = |p: &Point3| (0..3).all(|c| p[c] >= around.min[c] - reach && p[c] <= around.max[c] + reach);
    parallel::map(mesh.points().len(), |v| {
        let p = mesh.points()[v];
        if !near(&p) {
            return None;
        }
        let distance = |[a, b]: &[Point3; 2]| {
            let d = b - a;
            let s = ((p - a).dot(&d) / d.norm_squared()).clamp(0.0, 1.0);
            (p - (a + d * s)).norm()
        };
        let nearest = segments.iter().map(|s| (distance(s), s)).min_by(|a, b| a.0.total_cmp(&b.0));
        let (_, [a, b]) = nearest.filter(|n| n.0 <= reach)?;
        let normal = &mesh.normals()[v];
        let d = b - a;
        let tangent = (d - normal * normal.dot(&d)).try_normalize(NO_DIRECTION * d.norm())?;
        Some((sense.feed(tangent, normal), 1.0))
    })
}
