//! The highest meeting of a vertical line with a mesh.
//!
//! The plan view of neighbouring triangles shares its edges, and on which side of an edge the line
//! passes is decided exactly, so no line slips through between two triangles.

use super::orient::left_of;
use super::{Bvh, VerticalHit};
use crate::{Point3, TriangleMesh};

impl Bvh {
    /// The highest meeting of the vertical line at `(x, y)` with the mesh; `None` where it passes
    /// by. A line through an edge or a vertex meets it. Ties go to the triangle with the least
    /// index.
    pub fn highest_at(&self, mesh: &TriangleMesh, x: f64, y: f64) -> Option<VerticalHit> {
        let mut best: Option<VerticalHit> = None;
        self.tree.search(
            f64::NEG_INFINITY,
            |_, node, _| if node.plan_distance_squared(x, y) == 0.0 { node.top() } else { f64::NEG_INFINITY },
            |slot, floor| {
                let triangle = self.triangle_in(slot);
                let Some((z, barycentric)) = height_on_triangle(&mesh.corners(triangle), x, y) else {
                    return floor;
                };
                let hit = VerticalHit { z, triangle: triangle as u32, barycentric };
                if best.is_none_or(|b| (hit.z, b.triangle) > (b.z, hit.triangle)) {
                    best = Some(hit);
                }
                best.map_or(floor, |b| b.z)
            },
        );
        best
    }
}

/// Height of a triangle at `(x, y)` with its barycentric coordinates there: the greatest height
/// where the triangle is vertical.
pub(super) fn height_on_triangle(corners: &[Point3; 3], x: f64, y: f64) -> Option<(f64, [f64; 3])> {
    let plan = corners.map(|p| [p.x, p.y]);
    let side = |k: usize| left_of(plan[k], plan[(k + 1) % 3], [x, y]);
    // Weight of corner k: the area opposite of it.
    let weights = [side(1), side(2), side(0)];
    let (left, right) = (weights.iter().any(|&w| w > 0.0), weights.iter().any(|&w| w < 0.0));
    match (left, right) {
        (true, true) => None,
        (false, false) => {
            (0..3).filter_map(|k| height_on_side(corners, k, x, y)).max_by(|a, b| a.0.total_cmp(&b.0))
        }
        _ => {
            let sum: f64 = weights.iter().sum();
            let barycentric = weights.map(|w| w / sum);
            let z = (0..3).map(|k| barycentric[k] * corners[k].z).sum();
            Some((z, barycentric))
        }
    }
}

/// Greatest height of side `k` at `(x, y)`, a point known to lie on the side's line in the plan.
fn height_on_side(corners: &[Point3; 3], k: usize, x: f64, y: f64) -> Option<(f64, [f64; 3])> {
    let end = (k + 1) % 3;
    let (a, b) = (&corners[k], &corners[end]);
    let within = |p: f64, q: f64, at: f64| p.min(q) <= at && at <= p.max(q);
    if !(within(a.x, b.x, x) && within(a.y, b.y, y)) {
        return None;
    }
    let (dx, dy) = (b.x - a.x, b.y - a.y);
    let s = if dx == 0.0 && dy == 0.0 {
        if b.z > a.z { 1.0 } else { 0.0 }
    } else if dx.abs() >= dy.abs() {
        (x - a.x) / dx
    } else {
        (y - a.y) / dy
    };
    let mut barycentric = [0.0; 3];
    (barycentric[k], barycentric[end]) = (1.0 - s, s);
    Some(((1.0 - s) * a.z + s * b.z, barycentric))
}
