//! Strip width: how far apart neighbouring passes may lie at a point of the surface so that the
//! ridge between them stays below a scallop height.
//!
//! Cutter and surface are compared in the normal section across the feed. To second order the gap
//! between them grows as `(κ_cutter − κ_surface) x²/2`, so a ridge of height `h` stands between
//! passes `w = √(8h / (κ_cutter − κ_surface))` apart. Good for planning only (0.06 % at h = r/500);
//! what really stands is measured on the cut surface.

use cutter::Cutter;
use geometry::Vector3;

/// The strip is never planned wider than this multiple of the strip on a plane. Where the surface
/// is nearly as concave as the cutter the formula grows without bound while its error grows too;
/// a greater value trusts it further than second order carries.
const WIDEST_OVER_PLANE: f64 = 2.5;

/// Widest share of the cutter's diameter that a strip may take (flat ends on flat ground).
const WIDEST_OVER_DIAMETER: f64 = 0.8;

/// A surface counts as nearly as concave as the cutter where this share of the cutter's curvature, or
/// less, is left between them.
const NEARLY_AS_CONCAVE: f64 = 0.25;

/// Width of the strip, mm, that a cutter leaves below the scallop height `h` around a contact with
/// outward surface normal `n`, across the feed in the tangent direction `b` (both unit), where the
/// surface has the normal curvature `surface` along `b`; and whether the surface is so concave that
/// the width had to be limited.
///
/// A sharp edge leaves stairs on a slope: between passes `w` apart up the slope λ they stand
/// `w sin λ cos λ` high. A point leaves grooves.
pub fn strip_width_at(cutter: &Cutter, n: &Vector3, b: &Vector3, surface: f64, h: f64) -> (f64, bool) {
    let curvature = cutter.normal_curvature(n, b);
    if curvature.is_infinite() {
        return (strip_of_point(cutter, b.z.abs(), h), false);
    }
    let (width, limited) = strip_width(curvature, surface, h, cutter.radius());
    if !cutter.touches_with_edge(n) {
        return (width, limited);
    }
    let up_the_slope = b.z.abs();
    let stairs = if up_the_slope > 0.0 { h / (up_the_slope * n.z.abs().max(1e-3)) } else { f64::INFINITY };
    (width.min(stairs), limited)
}

/// Width of the strip, mm, below the ridges of height `h` that a pointed tip leaves: V-shaped grooves,
/// seen across the feed on a section that rises by an angle of sine `rise`.
fn strip_of_point(cutter: &Cutter, rise: f64, h: f64) -> f64 {
    let (flank, rise) = (cutter.profile().point().sin.asin(), rise.min(1.0).asin());
    let cotangent = |angle: f64| 1.0 / angle.max(1e-9).tan();
    let width = h * (cotangent(flank + rise) + cotangent(flank - rise));
    width
        .min(WIDEST_OVER_PLANE * (8.0 * h * cutter.radius()).sqrt())
        .min(WIDEST_OVER_DIAMETER * 2.0 * cutter.radius())
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::section::ball_scallop_height;

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
}
