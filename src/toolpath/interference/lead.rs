//! The lead at which a cutter fits a surface by curvature.

use crate::cutter::Cutter;
use crate::geometry::{PrincipalCurvatures, Vector3};

/// The least angle, rad, by which the axis must lean forward from the normal so that the cutter's rear does not cut into
/// the surface around the contact: its curvature is then not less than that of the surface in any direction. `None` where
/// no lead helps. Curvatures are positive where the surface is concave; `feed` is along it.
///
/// At the lead λ the arc of radius r around a circle of radius e bends by 1/r along the feed and by `sin λ/(e + r sin λ)`
/// across (Euler). It takes `k = κ_bb + κ_fb²/(1/r − κ_ff)` across to hold the surface in every direction, b across and f
/// along the feed, hence `sin λ = k e/(1 − k r)`. To second order at the contact: farther away the distance decides.
pub fn local_gouge_free_lead(
    curvatures: &PrincipalCurvatures,
    feed: &Vector3,
    cutter: &Cutter,
) -> Option<f64> {
    let (e, r) = (cutter.flat_radius().max(0.0), cutter.corner_radius());
    let (min, max) = (&curvatures.min_direction, &curvatures.max_direction);
    let (cos, sin) = (feed.dot(max), feed.dot(min));
    let size = cos.hypot(sin);
    // A feed along the normal is none: then the most concave direction counts.
    let (cos, sin) = if size > 0.0 { (cos / size, sin / size) } else { (0.0, 1.0) };
    let along = curvatures.max * cos * cos + curvatures.min * sin * sin;
    let across = curvatures.max * sin * sin + curvatures.min * cos * cos;
    let mixed = (curvatures.max - curvatures.min) * cos * sin;
    let left = 1.0 - r * along;
    if left < 0.0 || (left == 0.0 && mixed != 0.0) {
        return None;
    }
    let needed = if mixed == 0.0 { across } else { across + mixed * mixed * r / left };
    if needed * r > 1.0 {
        return None;
    }
    if needed <= 0.0 || e == 0.0 {
        return Some(0.0);
    }
    let sine = needed * e / (1.0 - needed * r);
    (sine <= 1.0).then(|| sine.asin())
}
