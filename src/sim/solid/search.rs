//! The least value of the distance over a move.
//!
//! At a time t₀ the distance has the value f, the slope f′ and, along its supporting plane, the bend β: at
//! t₀ + τ it is at least `f + f′τ + ½βτ² − J|τ|³/6` with J the greatest third derivative of the place as
//! seen from the tool. Between two samples the greater of their two bounds has its least where they cross,
//! or at an end. What lies above the best value so far is left out; else a further sample is taken in
//! between (Breiman and Cutler, "A deterministic algorithm for global optimization", 1993, with bends of
//! each stretch in place of one constant, and steps of a cubic where the distance is smooth).

use super::Nearest;
use geometry::{Point3, Vector3};

/// How far above the true one a least value may lie, mm. Less costs samples; more shows in what depends on
/// it to 1e-9.
const TOLERANCE: f64 = 1e-10;

/// Stretches that wait at once, but for odd moves.
const USUALLY: usize = 24;

/// Stretches shorter than this share of a move are not divided: their samples differ by rounding.
pub(crate) const SHORTEST: f64 = 1e-13;

/// The distance at one time.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sample {
    pub(crate) t: f64,
    pub(crate) value: f64,
    /// By time.
    pub(crate) slope: f64,
    /// Second derivative along the supporting plane.
    pub(crate) bend: f64,
}

/// The distance at one place and time, with its gradient by place.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Look {
    pub(crate) sample: Sample,
    /// Of unit length, or shorter where it could point to several sides.
    pub(crate) gradient: Vector3,
}

/// A convex solid on its way.
pub(crate) trait Moving {
    /// Distance, slope and bend by time, and gradient by place.
    fn look(&self, q: &Point3, t: f64) -> Look;

    /// Bounds on the size of the bend, and of its change by time, within a range.
    fn bends(&self, q: &Point3, range: [f64; 2]) -> [f64; 2];

    /// How fast its directions turn, rad for the whole move.
    fn turn(&self) -> f64;

    /// How far places of it move at most while its axis stands still, mm for the whole move.
    fn pace(&self) -> f64;
}

/// A stretch between two samples.
#[derive(Clone, Copy)]
pub(crate) struct Stretch {
    pub(crate) a: Sample,
    pub(crate) b: Sample,
    /// Whether the last division made it much shorter.
    pub(crate) quick: bool,
}

impl Stretch {
    /// Lower bound in the stretch and where it is reached.
    pub(crate) fn bound(&self, [bend, jerk]: [f64; 2]) -> (f64, f64) {
        let (a, b) = (&self.a, &self.b);
        let width = b.t - a.t;
        let bend = bend.min((-a.bend).max(-b.bend).max(0.0) + jerk * width / 3.0);
        let from_a = |x: f64| a.value + x * (a.slope - 0.5 * bend * x);
        let from_b = |x: f64| b.value + (x - width) * (b.slope - 0.5 * bend * (x - width));
        // The squares cancel in the difference of the two.
        let rise = a.slope - b.slope - bend * width;
        let gap = from_b(0.0) - a.value;
        let x = if rise < 0.0 { (gap / rise).clamp(0.0, width) } else { 0.5 * width };
        let higher = |x: f64| from_a(x).max(from_b(x));
        (higher(0.0).min(higher(x)).min(higher(width)), a.t + x)
    }

    /// Where to look next: the lowest place of a cubic, or where the bounds cross.
    pub(crate) fn next(&self, crossing: f64) -> f64 {
        let (a, b) = (&self.a, &self.b);
        let width = b.t - a.t;
        if self.quick && a.slope < 0.0 && b.slope > 0.0 {
            let c = a.slope + b.slope - 3.0 * (b.value - a.value) / width;
            let d = (c * c - a.slope * b.slope).sqrt();
            let t = b.t - width * (b.slope + d - c) / (b.slope - a.slope + 2.0 * d);
            if t > a.t && t < b.t {
                return t;
            }
        }
        // Far enough from both ends that the stretch shrinks.
        crossing.clamp(a.t + 0.05 * width, b.t - 0.05 * width)
    }
}

/// The least value in `range` and when, if it is less than `limit`.
pub(super) fn least(moving: &impl Moving, q: &Point3, [from, to]: [f64; 2], limit: f64) -> Option<Nearest> {
    let bends = moving.bends(q, [from, to]);
    let sample = |t: f64| moving.look(q, t).sample;
    // A look from the middle leaves out most.
    let middle = sample(0.5 * (from + to));
    let half = 0.5 * (to - from);
    if middle.value - half * (middle.slope.abs() + 0.5 * half * bends[0]) >= limit {
        return None;
    }
    let mut best = Nearest { distance: limit, t: f64::NAN };
    let take = |sample: Sample, best: &mut Nearest| {
        if sample.value < best.distance {
            *best = Nearest { distance: sample.value, t: sample.t };
        }
        sample
    };
    let [a, b, middle] = [sample(from), sample(to), middle].map(|s| take(s, &mut best));
    let mut waiting = Vec::with_capacity(USUALLY);
    waiting.extend([Stretch { a, b: middle, quick: true }, Stretch { a: middle, b, quick: true }]);
    while let Some(stretch) = waiting.pop() {
        let (bound, crossing) = stretch.bound(bends);
        let width = stretch.b.t - stretch.a.t;
        // No number comes of places that are none.
        if bound > best.distance - TOLERANCE || width < SHORTEST || bound.is_nan() {
            continue;
        }
        let between = take(sample(stretch.next(crossing)), &mut best);
        let quick = |width_now: f64| width_now < 0.5 * width || !stretch.quick;
        let left = Stretch { b: between, quick: quick(between.t - stretch.a.t), ..stretch };
        let right = Stretch { a: between, quick: quick(stretch.b.t - between.t), ..stretch };
        // The one that goes down from the new place is looked at first.
        waiting.extend(if between.slope > 0.0 { [right, left] } else { [left, right] });
    }
    (!best.t.is_nan()).then_some(best)
}
