//! The distance from a convex tool that slides along a line without turning.
//!
//! It is a convex function of place and time together. Two planes below it that fall to opposite sides in
//! time have a mean that does not depend on time: a plane below the distance from all that is swept.

use super::moves::Tangent;
use cutter::Solid;
use geometry::{Point3, Vector3};

/// Looks at one move at most; convergence takes a few.
const MOST_LOOKS: usize = 60;

/// A tool that keeps its axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct StandIn {
    /// The middle of its ball or corner at the begin, and its way.
    pub(super) start: Point3,
    pub(super) way: Vector3,
    pub(super) axis: Vector3,
    /// Height of that middle above the tip.
    pub(super) pivot: f64,
    /// How far the way rises along the axis, and the rest of it.
    pub(super) rise: f64,
    pub(super) across: Vector3,
    /// One over the squares of the way and of the rest; 0 without one.
    pub(super) per_way: f64,
    pub(super) per_across: f64,
}

/// The tool seen at one time: a plane below the distance in place and time.
#[derive(Debug, Clone, Copy)]
struct Look {
    t: f64,
    value: f64,
    slope: f64,
    gradient: Vector3,
}

impl StandIn {
    pub(super) fn new(start: Point3, way: Vector3, axis: Vector3, pivot: f64) -> Self {
        let rise = way.dot(&axis);
        let across = way - axis * rise;
        let per = |square: f64| if square > 0.0 { 1.0 / square } else { 0.0 };
        let (per_way, per_across) = (per(way.norm_squared()), per(across.norm_squared()));
        Self { start, way, axis, pivot, rise, across, per_way, per_across }
    }

    #[inline]
    fn look(&self, solid: &Solid, q: &Point3, t: f64) -> Look {
        let away = q - self.start - self.way * t;
        let height = away.dot(&self.axis);
        let outward = away - self.axis * height;
        let z = height + self.pivot;
        let rho = outward.norm();
        let foot = solid.outline_foot(rho, z);
        // On the axis the mean of both gradients supports the distance as well as either.
        let radial = if rho > 0.0 { foot.gradient[0] / rho } else { 0.0 };
        let gradient = outward * radial + self.axis * foot.gradient[1];
        Look { t, value: foot.distance, slope: -gradient.dot(&self.way), gradient }
    }
}

impl Look {
    /// Where the value lies that the plane has at the begin.
    fn at_begin(&self) -> f64 {
        self.value - self.slope * self.t
    }

    fn tangent(&self) -> Tangent {
        Tangent { distance: self.value, slack: 0.0, lower: self.value, gradient: self.gradient }
    }
}

/// The distance of `q` from all that the tool sweeps, up to `tolerance` mm too great, with a plane below it
/// that is at most as much too low; `None` if it is not below `limit`.
pub(super) fn slide(
    solid: &Solid,
    tool: &StandIn,
    q: &Point3,
    limit: f64,
    tolerance: f64,
) -> Option<Tangent> {
    let below = |tangent: Tangent| (tangent.distance < limit).then_some(tangent);
    if tool.per_way == 0.0 {
        return below(tool.look(solid, q, 0.0).tangent());
    }
    let mut t = ((q - tool.start).dot(&tool.way) * tool.per_way).clamp(0.0, 1.0);
    let (mut falling, mut rising): (Option<Look>, Option<Look>) = (None, None);
    let mut best = f64::INFINITY;
    let mut last_width = 1.0;
    for _ in 0..MOST_LOOKS {
        let look = tool.look(solid, q, t);
        best = if look.value < best { look.value } else { best };
        let at_end = if look.slope > 0.0 { t <= 0.0 } else { t >= 1.0 };
        if look.slope == 0.0 || at_end {
            return below(look.tangent());
        }
        if look.slope > 0.0 {
            rising = Some(look);
        } else {
            falling = Some(look);
        }
        let (Some(a), Some(b)) = (falling, rising) else {
            let to_end = if look.slope > 0.0 { -t } else { 1.0 - t };
            if look.value + look.slope * to_end >= limit {
                return None;
            }
            t = if look.slope > 0.0 { 0.0 } else { 1.0 };
            continue;
        };
        let share = b.slope / (b.slope - a.slope);
        let lower = share * a.at_begin() + (1.0 - share) * b.at_begin();
        if lower >= limit {
            return None;
        }
        let width = b.t - a.t;
        if best - lower <= tolerance || width < 1e-15 {
            let gradient = a.gradient * share + b.gradient * (1.0 - share);
            return below(Tangent { distance: best, slack: 0.0, lower, gradient });
        }
        // The lowest place of a cubic where that helps, else where the planes cross.
        let c = a.slope + b.slope - 3.0 * (b.value - a.value) / width;
        let d = (c * c - a.slope * b.slope).sqrt();
        let cubic = b.t - width * (b.slope + d - c) / (b.slope - a.slope + 2.0 * d);
        let crossing = (b.at_begin() - a.at_begin()) / (a.slope - b.slope);
        let quick = width < 0.5 * last_width || last_width == 1.0;
        let next = if quick { cubic } else { crossing };
        let hair = 1e-3 * width;
        t = next.clamp(a.t + hair, b.t - hair);
        last_width = width;
    }
    let look = tool.look(solid, q, t);
    let lower = falling.into_iter().chain(rising).map(|l| l.value - l.slope.abs()).fold(look.value, f64::min);
    below(Tangent { distance: best, slack: 0.0, lower, gradient: Vector3::zeros() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::{Rng, cutters};
    use crate::solid::tests::SweptSolid;
    use motion::ClPoint;

    #[test]
    fn distances_are_exact_and_planes_lie_below() {
        let mut rng = Rng::new(7);
        let mut within = |size: f64| Vector3::from_fn(|_, _| rng.within(-size, size));
        for cutter in cutters() {
            let solid = Solid::of_cutter(&cutter, None);
            for k in 0..40 {
                let axis = within(1.0).normalize();
                let way = match k % 4 {
                    0 => Vector3::zeros(),
                    1 => axis * within(3.0).x,
                    _ => within(4.0),
                };
                let tip = Point3::from(within(1.0));
                let tool = StandIn::new(tip + axis * solid.pivot(), way, axis, solid.pivot());
                let swept =
                    SweptSolid::new(&solid, &ClPoint { tip, axis }, &ClPoint { tip: tip + way, axis })
                        .unwrap();
                for _ in 0..10 {
                    let q = tip + axis * 4.0 + within(7.0);
                    let exact = swept.distance(&q).distance;
                    let got = slide(&solid, &tool, &q, f64::INFINITY, 1e-9).unwrap();
                    assert!((got.distance - exact).abs() < 2e-9, "{cutter:?} {got:?} {exact}");
                    let loose = slide(&solid, &tool, &q, f64::INFINITY, 0.05).unwrap();
                    assert!(loose.distance > exact - 2e-9 && loose.distance < exact + 0.05 + 2e-9);
                    assert!(slide(&solid, &tool, &q, exact - 1e-6, 0.05).is_none());
                    assert!(slide(&solid, &tool, &q, exact + 1e-6, 1e-9).is_some());
                    for tangent in [got, loose] {
                        assert!(tangent.lower > tangent.distance - 0.05 - 1e-9, "{tangent:?}");
                        let e = within(3.0);
                        let plane = tangent.lower + tangent.gradient.dot(&e);
                        assert!(swept.distance(&(q + e)).distance > plane - 2e-9, "{cutter:?} {tangent:?}");
                    }
                }
            }
        }
    }
}
