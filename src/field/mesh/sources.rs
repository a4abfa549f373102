//! Where feed directions on a mesh come from. Each source gives what is wanted at every vertex, to be
//! smoothed ([`super::smooth_lines`]) or blended with others ([`super::blend`]).

use super::{FieldMesh, Wanted};
use geometry::{Point2, Vector3, angle_between, distance_to_segment};
use work::parallel;

/// A border that turns by more than this at a vertex, nearly back, has no direction there, rad.
const CUSP: f64 = 2.6;

/// Tangents shorter than this, of unit vectors, have no direction.
const NO_DIRECTION: f64 = 1e-9;

/// Ground that rises by less than this has no slope, rad: what rounding and fits leave of level ground would
/// have one.
const LEVEL: f64 = 1e-4;

/// Along a curve or square to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sense {
    /// Passes run along it.
    Along,
    /// Passes run across it.
    Across,
}

impl Sense {
    /// The feed for a curve with this tangent on a surface with this unit normal.
    pub fn feed(self, tangent: Vector3, normal: &Vector3) -> Vector3 {
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

/// The direction up the slope, or level along it, for a surface with this unit normal, and how much it
/// matters: the sine of the slope. `None` on level ground.
pub fn slope_at(normal: &Vector3, up: bool) -> Option<(Vector3, f64)> {
    let level = Vector3::z().cross(normal);
    let steepness = level.norm();
    let direction = if up { normal.cross(&level) } else { level };
    (steepness > LEVEL).then(|| (direction / steepness, steepness))
}

/// [`slope_at`] every vertex.
pub fn slope(mesh: &FieldMesh, up: bool) -> Vec<Wanted> {
    mesh.normals().iter().map(|n| slope_at(n, up)).collect()
}

/// Along or across the borders, at corners along their bisector, which tells in which sense passes turn
/// there. Where passes reach the border they follow it; inside, the field is as smooth as the borders allow.
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
            if angle_between(&before, &after) > CUSP {
                continue;
            }
            let unit = |d: Vector3| d.try_normalize(NO_DIRECTION * d.norm()).unwrap_or_else(Vector3::zeros);
            let tangent = (unit(before) + unit(after)).try_normalize(NO_DIRECTION);
            wanted[v] = tangent.map(|t| (sense.feed(t, normal), 1.0));
        }
    }
    wanted
}

/// Along or across guide curves, each a polyline of the plan view, at the vertices within `reach` (mm, in the
/// plan view) of it, or of the vertex nearest to it; the nearest stretch counts.
pub fn guides(mesh: &FieldMesh, curves: &[Vec<Point2>], reach: f64, sense: Sense) -> Vec<Wanted> {
    let segments: Vec<[Point2; 2]> =
        curves.iter().flat_map(|c| c.windows(2).map(|w| [w[0], w[1]])).filter(|[a, b]| a != b).collect();
    let nearest = parallel::map(mesh.points().len(), |v| {
        let p = mesh.points()[v].xy();
        segments.iter().map(|s| (distance_to_segment(&p, &s[0], &s[1]), s)).min_by(|a, b| a.0.total_cmp(&b.0))
    });
    let least = nearest.iter().flatten().map(|n| n.0).fold(f64::INFINITY, f64::min);
    let wanted = |(nearest, normal): (&Option<(f64, &[Point2; 2])>, &Vector3)| {
        let (_, [a, b]) = nearest.filter(|n| n.0 <= least + reach)?;
        let d = (b - a).normalize();
        let tangent = Vector3::new(-d.y, d.x, 0.0).cross(normal).try_normalize(NO_DIRECTION)?;
        Some((sense.feed(tangent, normal), 1.0))
    };
    nearest.iter().zip(mesh.normals()).map(wanted).collect()
}
