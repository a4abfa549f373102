//! When a cutter on its way first touches the stock of a cell. mm.

use crate::form::Form;
use crate::track::{larger, smaller};
use geometry::Point3;

/// Steps of each of the two searches: to 1e-12 of the move (a golden section gains 0.2 decimal digits
/// a step). Fewer would show in the place; more is below rounding.
const STEPS: usize = 60;

/// The part of the way from `from` to `to`, as shares of it, on which a cutter of this form stands
/// over `(x, y)`; `None` if it never does.
pub(super) fn reach(form: &Form, from: Point3, to: Point3, x: f64, y: f64) -> Option<(f64, f64)> {
    let (dx, dy, px, py) = (to.x - from.x, to.y - from.y, x - from.x, y - from.y);
    let (dd, pd) = (dx * dx + dy * dy, px * dx + py * dy);
    if dd == 0.0 {
        return (px.hypot(py) <= form.radius).then_some((0.0, 1.0));
    }
    let across = (px * dy - py * dx).powi(2) / dd;
    let square = form.radius * form.radius - across;
    let half = (square / dd).sqrt();
    let (enter, leave) = (larger(pd / dd - half, 0.0), smaller(pd / dd + half, 1.0));
    (square >= 0.0 && enter <= leave).then_some((enter, leave))
}

/// The share of the way at which the cutter first comes down to `height` at `(x, y)`; `None` if it
/// never does. The height of the cutter above the place is convex along the way: golden section finds
/// where it is least, bisection where it first reaches `height` before that.
pub(super) fn first_touch(
    form: &Form,
    [from, to]: [Point3; 2],
    (enter, leave): (f64, f64),
    [x, y]: [f64; 2],
    height: f64,
) -> Option<f64> {
    const RATIO: f64 = 0.618_033_988_749_894_9;
    let above = |t: f64| {
        let rho = (x - from.x - t * (to.x - from.x)).hypot(y - from.y - t * (to.y - from.y));
        from.z + t * (to.z - from.z) + form.height(smaller(rho, form.radius)) - height
    };
    if above(enter) <= 0.0 {
        return Some(enter);
    }
    let (mut low, mut high) = (enter, leave);
    let mut inside = leave;
    for _ in 0..STEPS {
        let (a, b) = (high - RATIO * (high - low), low + RATIO * (high - low));
        if above(inside) <= 0.0 {
            break;
        }
        if above(a) <= above(b) {
            (high, inside) = (b, a);
        } else {
            (low, inside) = (a, b);
        }
    }
    if above(inside) > 0.0 {
        return None;
    }
    let (mut low, mut high) = (enter, inside);
    for _ in 0..STEPS {
        let middle = 0.5 * (low + high);
        *(if above(middle) <= 0.0 { &mut high } else { &mut low }) = middle;
    }
    Some(high)
}
