//! Strip width: how far apart neighbouring passes may lie at a point of the surface so that the
//! ridge between them stays below a scallop height.
//!
//! Cutter and surface are compared in the normal section across the feed. To second order the gap
//! between them grows as `(κ_cutter − κ_surface) x²/2`, so a ridge of height `h` stands between
//! passes `w = √(8h / (κ_cutter − κ_surface))` apart. Good for planning only (0.06 % at h = r/500);
//! what really stands is measured on the cut surface.

use crate::cutter::Cutter;
use crate::geometry::{Vector2, Vector3};

/// The strip is never planned wider than this multiple of the strip on a plane. Where the surface
/// is nearly as concave as the cutter the formula grows without bound while its error grows too;
/// a greater value trusts it further than second order carries.
const WIDEST_OVER_PLANE: f64 = 2.5;

/// Widest share of the cutter's diameter that a strip may take (flat ends on flat ground).
const WIDEST_OVER_DIAMETER: f64 = 0.8;

/// A surface counts as nearly as concave as the cutter where this share of the cutter's curvature, or
/// less, is left between them.
const NEARLY_AS_CONCAVE: f64 = 0.25;

/// Slope (sine) below which ground counts as nearly level for a cutter with a flat. Less lets the path
/// swerve by the flat's radius at every change of a gentle slope; more leaves its contact inside the
/// flat on slopes where only the rim can touch.
const NEARLY_LEVEL: f64 = 0.05;

/// Normal curvature of the cutter's surface, 1/mm, at the contact with outward surface normal `n`
/// (unit) in the tangent direction `b` (unit, `b ⟂ n`), for a vertical tool axis.
///
/// A torus of corner radius `rc` around a flat disc `e` has the curvature `1/rc` in the meridian
/// and `sin λ/(e + rc sin λ)` along the parallel, λ the slope of the surface; on a conical side
/// the meridian is straight, and a sharp corner has none.
pub fn cutter_curvature(cutter: &Cutter, n: &Vector3, b: &Vector3) -> f64 {
    let slope = n.xy().norm();
    let (e, rc) = (cutter.flat_radius(), cutter.corner_radius());
    if slope < 1e-9 {
        return if e > 0.0 { 0.0 } else { 1.0 / rc };
    }
    let parallel_direction = Vector3::new(-n.y, n.x, 0.0) / slope;
    let along_parallel = b.dot(&parallel_direction).powi(2);
    let on_arc = slope <= cutter.half_angle().cos();
    let radius_of_parallel = if on_arc { e + rc * slope } else { cutter.radius() };
    let meridian = if on_arc && rc > 0.0 { 1.0 / rc } else { 0.0 };
    slope / radius_of_parallel * along_parallel + meridian * (1.0 - along_parallel)
}

/// Width of the strip, mm, that a cutter leaves below the scallop height `h` around a contact with
/// outward surface normal `n`, across the feed in the tangent direction `b` (both unit), where the
/// surface has the normal curvature `surface` along `b`; and whether the surface is so concave that
/// the width had to be limited.
///
/// A sharp corner (no corner radius) leaves stairs on a slope: between passes `w` apart up the slope λ
/// they stand `w sin λ cos λ` high.
pub fn strip_width_at(cutter: &Cutter, n: &Vector3, b: &Vector3, surface: f64, h: f64) -> (f64, bool) {
    let (width, limited) = strip_width(cutter_curvature(cutter, n, b), surface, h, cutter.radius());
    if cutter.corner_radius() > 0.0 {
        return (width, limited);
    }
    let up_the_slope = b.z.abs();
    let stairs = if up_the_slope > 0.0 { h / (up_the_slope * n.z.abs().max(1e-3)) } else { f64::INFINITY };
    (width.min(stairs), limited)
}

/// Plan-view offset from a contact with outward surface normal `n` to the cutter's axis, mm: the
/// corner radius and, on a slope, the flat radius up to its rim. On ground that is nearly level any
/// place of the flat touches; the offset then grows with the slope, so that it never jumps.
pub fn axis_offset(cutter: &Cutter, n: &Vector3) -> Vector2 {
    let plan = n.xy();
    plan * (cutter.corner_radius() + cutter.flat_radius() / plan.norm().max(NEARLY_LEVEL))
}

/// Width of the strip, mm, for scallop height `h` where the cutter has curvature `cutter` and the
/// surface `surface` across the feed (1/mm, positive concave), limited for a cutter of radius
/// `radius`. The second value is true where the limit acted: the surface is as concave as the
/// cutter, or more.
pub fn strip_width(cutter: f64, surface: f64, h: f64, radius: f64) -> (f64, bool) {
    let plane = (8.0 * h * radius).sqrt();
    let widest = (WIDEST_OVER_PLANE * plane).min(WIDEST_OVER_DIAMETER * 2.0 * radius);
    let gap = cutter - surface;
    let too_concave = surface > 0.0 && gap < NEARLY_AS_CONCAVE * cutter;
    let width = if gap > 0.0 { (8.0 * h / gap).sqrt() } else { f64::INFINITY };
    if width > widest { (widest, too_concave) } else { (width, false) }
}

/// Exact scallop height, mm, of a ball of radius `r` between two passes an arc length `s` apart on
/// a circular section of curvature `kappa` (1/mm, positive concave):
/// `h = σ((ρ + σr) cos(s/2ρ) − ρ) − √(r² − (ρ + σr)² sin²(s/2ρ))`, σ = 1 convex, −1 concave.
/// `None` when the ball does not reach across or does not fit.
pub fn ball_scallop_height(r: f64, kappa: f64, s: f64) -> Option<f64> {
    // Flatter than this, ρ cancels more digits than the section's bend is worth.
    if kappa.abs() * r < 1e-9 {
        let inside = r * r - 0.25 * s * s;
        return (inside >= 0.0).then(|| r - inside.sqrt());
    }
    let (rho, sigma) = (1.0 / kappa.abs(), -kappa.signum());
    let centre_radius = rho + sigma * r;
    let half_angle = 0.5 * s / rho;
    let inside = r * r - (centre_radius * half_angle.sin()).powi(2);
    (centre_radius > 0.0 && inside >= 0.0)
        .then(|| sigma * (centre_radius * half_angle.cos() - rho) - inside.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scallop_heights_on_planes_and_circles() {
        let h = |r, k, s| ball_scallop_height(r, k, s).unwrap();
        assert!((h(5.0, 0.0, 1.0) - 0.0250628).abs() < 5e-8);
        assert!((h(3.0, 0.0, 0.5) - 0.0104348).abs() < 5e-8);
        assert!((h(5.0, -1.0 / 50.0, 0.6026618) - 0.01).abs() < 1e-8);
        assert!((h(5.0, 1.0 / 50.0, 0.6664011) - 0.01).abs() < 1e-8);
        assert!((h(5.0, 1e-8, 1.0) - h(5.0, 0.0, 1.0)).abs() < 1e-7, "the plane is the limit");
        assert_eq!(ball_scallop_height(5.0, 0.25, 1.0), None, "a ball of 5 does not fit a radius of 4");
        assert_eq!(ball_scallop_height(5.0, 0.0, 11.0), None, "the ball does not reach across");
    }

    #[test]
    fn strip_width_inverts_the_scallop_height_to_second_order() {
        for kappa in [-0.1, -0.02, 0.0, 0.02, 0.1] {
            let (width, limited) = strip_width(1.0 / 5.0, kappa, 0.01, 5.0);
            assert!(!limited);
            let h = ball_scallop_height(5.0, kappa, width).unwrap();
            assert!((h / 0.01 - 1.0).abs() < 5e-3, "kappa {kappa}: {h}");
        }
        assert!(strip_width(0.2, 0.25, 0.01, 5.0).1, "concave beyond the ball: limited, and said so");
        assert!(!strip_width(0.0, 0.0, 0.01, 5.0).1, "a flat end on a plane is limited, but not by the part");
    }

    #[test]
    fn cutter_curvature_is_that_of_a_torus() {
        let tilted = Vector3::new(0.5, 0.0, 0.75f64.sqrt());
        let (along, down) = (Vector3::y(), Vector3::new(0.75f64.sqrt(), 0.0, -0.5));
        let ball = Cutter::ball(6.0).unwrap();
        assert!((cutter_curvature(&ball, &tilted, &along) - 1.0 / 3.0).abs() < 1e-12);
        assert!((cutter_curvature(&ball, &tilted, &down) - 1.0 / 3.0).abs() < 1e-12);
        let bull = Cutter::bull(6.0, 1.0).unwrap();
        assert!((cutter_curvature(&bull, &tilted, &along) - 0.5 / 2.5).abs() < 1e-12);
        assert!((cutter_curvature(&bull, &tilted, &down) - 1.0).abs() < 1e-12);
        assert_eq!(cutter_curvature(&bull, &Vector3::z(), &along), 0.0);
        let flat = Cutter::flat(6.0).unwrap();
        assert!((cutter_curvature(&flat, &tilted, &along) - 0.5 / 3.0).abs() < 1e-12, "sin λ / R");
        assert_eq!(cutter_curvature(&flat, &tilted, &down), 0.0);
    }

    #[test]
    fn a_sharp_corner_leaves_stairs() {
        let flat = Cutter::flat(6.0).unwrap();
        let slope = 30f64.to_radians();
        let (n, up) =
            (Vector3::new(-slope.sin(), 0.0, slope.cos()), Vector3::new(slope.cos(), 0.0, slope.sin()));
        let (width, _) = strip_width_at(&flat, &n, &up, 0.0, 0.01);
        assert!((width * slope.sin() * slope.cos() - 0.01).abs() < 1e-12);
        let (along, _) = strip_width_at(&flat, &n, &Vector3::y(), 0.0, 0.01);
        assert!((along - (8.0 * 0.01 * 3.0 / slope.sin()).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn the_axis_stands_off_by_corner_and_flat() {
        let n = Vector3::new(0.6, 0.0, 0.8);
        assert!((axis_offset(&Cutter::ball(6.0).unwrap(), &n).x - 1.8).abs() < 1e-12);
        assert!((axis_offset(&Cutter::bull(6.0, 1.0).unwrap(), &n).x - 2.6).abs() < 1e-12);
        assert_eq!(axis_offset(&Cutter::flat(6.0).unwrap(), &Vector3::z()), Vector2::zeros());
    }
}
