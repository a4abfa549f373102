//! Whether a cutter fits a place of the part. Where it does not, no pass comes down to the design: what
//! stands there answers to the uncut tolerance, wherever passes run.

use std::f64::consts::TAU;

use cutter::Cutter;
use geometry::{Point3, Vector2, Vector3};
use part::Part;

/// Rings around the axis on which another cutter than a ball is held against the part, as shares of its
/// radius, and places on each.
const RINGS: [f64; 4] = [0.25, 0.5, 0.75, 0.97];
const AROUND: u32 = 12;

/// Whether a cutter that leaves no more than `most`, mm, above a place of the design along its unit normal
/// keeps out of the part elsewhere. Of a ball that is exact, and whether it leans does not matter; other
/// cutters are held against the part at some places around their axis, which stands upright.
pub(crate) fn fits(part: &Part, cutter: &Cutter, place: &Point3, normal: &Vector3, most: f64) -> bool {
    let lowest = place + normal * most;
    if cutter.is_ball() {
        return part.closest_point(&(lowest + normal * cutter.radius())).1 >= cutter.radius();
    }
    let tip = lowest + cutter.contact_to_tip(normal);
    let clear = |radius: f64, angle: f64| {
        let q = tip.xy() + Vector2::new(angle.cos(), angle.sin()) * radius;
        let least = tip.z + cutter.profile().height(radius);
        part.highest_at(q.x, q.y).is_none_or(|design| design.point.z <= least)
    };
    let turn = TAU / f64::from(AROUND);
    RINGS.iter().all(|share| (0..AROUND).all(|k| clear(share * cutter.radius(), turn * f64::from(k))))
}
