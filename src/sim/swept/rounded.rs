//! Bull nose, taper and any other profile: the one-dimensional convex problem of the cutter's place on its
//! track.
//!
//! With a = s − σ the distance of the point ahead of the axis, w across, ρ = √(a² + w²), and m >= 0 the slope
//! of the track, the lowest cut is where m = f′(ρ)·a/ρ, or at the end of the track, or where the cutter ends.
//! The profile itself finds that place ([`Profile::ahead`](cutter::Profile::ahead)).

use super::{Touch, TouchedBy};
use crate::form::Form;
use crate::track::Track;

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
    Some(Touch { height, along: ahead, across, by: TouchedBy::Profile(sine, cosine) })
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
    let (ahead, edge) = form.profile.ahead(track.slope, w);
    let rho = edge.unwrap_or_else(|| (ahead * ahead + w * w).sqrt().min(form.radius));
    let sigma = (along - ahead).clamp(0.0, track.length);
    let by = edge.map_or_else(
        || {
            let (sine, cosine) = form.steepness(rho);
            TouchedBy::Profile(sine, cosine)
        },
        TouchedBy::Edge,
    );
    Some(Touch { height: track.tip(sigma) + form.height(rho), along: ahead, across, by })
}
