//! A tilted bound above the triangles in one box of the search tree.
//!
//! On a slope a level box ends far above the surface, and most of what a drop tests it tests in vain. A plane
//! tilted like the surface lies closely above it; how high the cutter can come to rest on what is below that
//! plane and inside the box has a closed form again.
//!
//! The bounds are over the tessellation itself and not over the domains of its triangles. Every triangle that
//! the cutter may touch has to be refined on the exact surface, not only the highest one.

use super::touch::{Profile, Rest, gap};
use geometry::{Node, Point3, Vector3, round_down, round_up};

/// Boxes with more triangles than this get no roof. More takes longer to prepare, and no plane fits
/// a large piece of surface closely.
pub(super) const MOST_BELOW: usize = 256;

/// Roofs of surfaces whose mean normal is flatter than this (its z) would be steep and far above
/// most of what is below them; the level box serves better.
const STEEPEST: f64 = 0.1;

/// Share of the cutter's radius by which numbers stored in f32 may be off, with room to spare.
const SLACK: f64 = 4.0 * f32::EPSILON as f64;

/// The cutter resting on a plane above all triangles in a box, in f32, rounded to the safe side.
#[derive(Debug, Clone, Copy)]
pub(super) struct Roof {
    gradient: [f32; 2],
    shift: [f32; 2],
    /// Tip height with the axis at the box's middle; infinite without a roof.
    rest: f32,
    bend: f32,
    bend_within: f32,
}

impl Roof {
    /// No bound.
    pub(super) const NONE: Self =
        Self { gradient: [0.0; 2], shift: [0.0; 2], rest: f32::INFINITY, bend: 0.0, bend_within: 0.0 };

    /// The roof over triangles, each given by its corners.
    pub(super) fn over(node: &Node, triangles: &[[Point3; 3]], profile: &Profile) -> Self {
        let normal: Vector3 = triangles.iter().map(|[a, b, c]| (b - a).cross(&(c - a))).sum();
        let up = normal.z.abs();
        if up <= STEEPEST * normal.norm() {
            return Self::NONE;
        }
        let gradient = [-normal.x / normal.z, -normal.y / normal.z].map(|g| g as f32);
        let exact = gradient.map(f64::from);
        let [ox, oy] = node.plan_centre();
        let above = |p: &Point3| p.z - exact[0] * (p.x - ox) - exact[1] * (p.y - oy);
        let height = triangles.iter().flatten().map(above).fold(f64::NEG_INFINITY, f64::max);
        let rest = Rest::on_plane(exact, profile);
        Self {
            gradient,
            shift: rest.shift().map(|s| s as f32),
            rest: round_up(height + rest.lift + SLACK * profile.radius),
            bend: round_down(rest.bend),
            bend_within: round_down(rest.bend_within),
        }
    }

    /// No triangle below the roof and in its box lifts the tip of a cutter at `(x, y)` higher.
    pub(super) fn bound(&self, node: &Node, profile: &Profile, x: f64, y: f64) -> f64 {
        if self.rest == f32::INFINITY {
            return f64::INFINITY;
        }
        let [ox, oy] = node.plan_centre();
        let climb = f64::from(self.gradient[0]) * (x - ox) + f64::from(self.gradient[1]) * (y - oy);
        let at = [x + f64::from(self.shift[0]), y + f64::from(self.shift[1])];
        let away = node.plan_distance_squared(at[0], at[1]).sqrt() - SLACK * profile.radius;
        climb + f64::from(self.rest) - gap(f64::from(self.bend), f64::from(self.bend_within), away.max(0.0))
    }
}
