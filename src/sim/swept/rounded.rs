//! Bull nose and taper: the one-dimensional convex problem of the cutter's place on its track.
//!
//! With a = s − σ the distance of the point ahead of the axis, w across, ρ = √(a² + w²), and m >= 0
//! the slope of the track, the lowest cut is where m = f′(ρ)·a/ρ, or at the end of the track, or
//! where the cutter ends.

use super::{Part, Touch};
use crate::sim::form::Form;
use crate::sim::track::{Track, larger};

/// Steps of the iteration on the arc. Bisection alone needs 52; a smaller number would leave the
/// slowest cases (the point almost a radius beside a steep track) short of full precision.
const MAX_STEPS: usize = 80;

/// Two places closer than this part of the radius count as one. The height is at its minimum there, so
/// its error is of the order of the square; a larger value would show on tracks steeper than a million
/// to one, a smaller one is below the rounding of the function.
const RESOLUTION: f64 = 1.0e-14;

/// The lowest cut of the form at the point `along` and `across` the track.
pub(super) fn touch(form: &Form, track: &Track, along: f64, across: f64) -> Option<Touch> {
    let w = across.abs();
    if w > form.radius || (along + w).is_nan() {
        return None;
    }
    let at = |sigma: f64| at_place(form, track, along - sigma, across, sigma);
    if along <= 0.0 || track.length == 0.0 || climbs_too_fast(form, track, along, w) {
        return at(0.0);
    }
    if track.slope == 0.0 {
        return at(along.min(track.length));
    }
    let beyond = along - track.length;
    if beyond > 0.0 {
        let rho = (beyond * beyond + w * w).sqrt();
        if rho > form.radius {
            return None;
        }
        let (sine, cosine) = form.steepness(rho);
        if beyond * sine >= track.slope * rho * cosine {
            return at(track.length);
        }
    }
    on_track(form, track, along, across)
}

/// The cut of the cutter that stands at `sigma`, if it reaches a point `ahead` of its axis.
fn at_place(form: &Form, track: &Track, ahead: f64, across: f64, sigma: f64) -> Option<Touch> {
    let rho = (ahead * ahead + across * across).sqrt();
    if rho > form.radius {
        return None;
    }
    let (sine, cosine) = form.steepness(rho);
    let height = track.tip(sigma) + form.height(rho);
    Some(Touch { height, along: ahead, across, by: Part::Profile(sine, cosine) })
}

/// True when the cutter at the lower end reaches the point and moving on lifts it faster than the
/// profile falls towards the point.
fn climbs_too_fast(form: &Form, track: &Track, along: f64, w: f64) -> bool {
    let rho = (along * along + w * w).sqrt();
    let (sine, cosine) = form.steepness(rho);
    rho <= form.radius && along * sine <= track.slope * rho * cosine
}

/// The lowest cut when the cutter stands inside its track.
fn on_track(form: &Form, track: &Track, along: f64, across: f64) -> Option<Touch> {
    let w = across.abs();
    let (ahead, edge) = stationary(form, track.slope, w);
    let rho = edge.unwrap_or_else(|| (ahead * ahead + w * w).sqrt().min(form.radius));
    let sigma = (along - ahead).clamp(0.0, track.length);
    let by = edge.map_or_else(
        || {
            let (sine, cosine) = form.steepness(rho);
            Part::Profile(sine, cosine)
        },
        Part::Edge,
    );
    Some(Touch { height: track.tip(sigma) + form.height(rho), along: ahead, across, by })
}

/// The a at which f′(ρ)·a/ρ = slope, or passes it at a sharp edge, whose radius is then given too.
fn stationary(form: &Form, slope: f64, w: f64) -> (f64, Option<f64>) {
    let ahead_at = |rho: f64| larger((rho - w) * (rho + w), 0.0).sqrt();
    if form.arc_end < form.radius {
        // On the cone f′ = cos/sin: a = m·w/√(f′² − m²), from the axis at ρ = f′·w/√(f′² − m²).
        let climb = slope * form.sin_side;
        let root = larger((form.cos_side - climb) * (form.cos_side + climb), 0.0).sqrt();
        let rho = form.cos_side * w / root;
        if climb >= form.cos_side || rho >= form.radius {
            return (ahead_at(form.radius), Some(form.radius));
        }
        if rho >= form.arc_end {
            return (climb * w / root, None);
        }
    }
    if form.corner == 0.0 {
        return (ahead_at(form.flat), Some(form.flat));
    }
    (arc_ahead(form, slope, w), None)
}

/// The a at which G(a) = x·a − m·ρ·√(c² − x²) vanishes, x = ρ − e the place on the arc of radius c
/// around e: that is f′(ρ)·a/ρ = m without its poles, with one sign change between the inner end of the
/// arc (or the point abeam) and its outer end. Newton steps, and bisection wherever they would leave
/// the bracket or converge slowly; four to eight steps in practice.
fn arc_ahead(form: &Form, slope: f64, w: f64) -> f64 {
    let (flat, corner) = (form.flat, form.corner);
    let ahead_at = |rho: f64| larger((rho - w) * (rho + w), 0.0).sqrt();
    let (mut low, mut high) = (ahead_at(flat), ahead_at(form.arc_end));
    // As if ρ were that of the arc's outer end: exact for w = 0, close for w small.
    let tangent = slope * form.arc_end / larger(high, f64::MIN_POSITIVE);
    let mut a = ahead_at(flat + corner * tangent / (1.0 + tangent * tangent).sqrt());
    let mut last_step = high - low;
    for _ in 0..MAX_STEPS {
        if a <= low || a >= high {
            a = 0.5 * (low + high);
        }
        let rho = (a * a + w * w).sqrt();
        let x = rho - flat;
        let level = larger((corner - x) * (corner + x), 0.0).sqrt();
        let value = x * a - slope * rho * level;
        if value < 0.0 {
            low = a;
        } else {
            high = a;
        }
        let share = a / rho;
        let step = value / (share * a + x - slope * (share * level - a * x / level));
        let newton = a - step;
        if step.abs() <= RESOLUTION * form.radius || high - low <= RESOLUTION * form.radius {
            break;
        }
        let useful = newton > low && newton < high && step.abs() < 0.5 * last_step;
        let next = if useful { newton } else { 0.5 * (low + high) };
        last_step = (next - a).abs();
        a = next;
    }
    a
}
