//! The lower envelope of a rotating cutter swept along one straight move of its tip.
//!
//! Enters: a cutter and the two ends of a move. Leaves: the height of the cut surface at any
//! `(x, y)` and its normal, mm, z up. The tool axis is vertical.
//!
//! With f the profile and c(t), z(t) the tip in plan view and its height,
//! `height(p) = min over t in [0, 1] of z(t) + f(|p - c(t)|)`. The bracket is jointly convex in
//! (t, p), because f is convex and never falls, so at each p there is one minimum over t to find, and
//! the envelope of one move is itself convex.

mod rounded;
#[cfg(test)]
pub(super) mod tests;

use super::form::{Family, Form};
use super::track::{Track, larger, smaller};
use geometry::Vector3;

/// Where the cutter stands when it makes the lowest cut at a point.
#[derive(Debug, Clone, Copy)]
struct Touch {
    /// Height of the cut surface.
    height: f64,
    /// The point as seen from the cutter's axis: along the track and across it.
    along: f64,
    across: f64,
    /// What of the cutter made the cut.
    by: TouchedBy,
}

/// The part of a cutter that makes the lowest cut, with the slope of the profile there.
#[derive(Debug, Clone, Copy)]
enum TouchedBy {
    /// The rotating profile where it rises by this angle (sine and cosine).
    Profile(f64, f64),
    /// A sharp edge of this radius, as the cutter climbs past: the profile is less steep than the
    /// move inside of the edge, and steeper, or ended, outside.
    Edge(f64),
}

/// Lowest height of the form swept along the track at `(x, y)`; infinite where it does not pass.
#[inline(always)]
pub(super) fn swept_height(form: &Form, track: &Track, x: f64, y: f64) -> f64 {
    let (along, across) = track.along_across(x, y);
    swept_height_at(form, track, along, across)
}

/// As [`swept_height`], at a place along the track and across it.
#[inline(always)]
pub(super) fn swept_height_at(form: &Form, track: &Track, along: f64, across: f64) -> f64 {
    match form.family {
        Family::Ball => ball_height(track, form.radius, along, across),
        Family::Flat => flat_height(track, form.radius, along, across),
        Family::Rounded => rounded_height(form, track, along, across),
    }
}

/// Height of the lower envelope of bull nose or taper; infinite where it does not pass.
pub(super) fn rounded_height(form: &Form, track: &Track, along: f64, across: f64) -> f64 {
    rounded::touch(form, track, along, across).map_or(f64::INFINITY, |touch| touch.height)
}

/// As [`rounded_height`] where that may lie at or below `now`, else infinite. The true place on the track is
/// looked for only when the nearest place and the lowest tip in reach, taken together, leave the
/// question open.
#[inline(always)]
pub(super) fn rounded_height_below(form: &Form, track: &Track, along: f64, across: f64, now: f64) -> f64 {
    /// Against rounding, mm; below 1e-12 a height could be left out that is lower than its bound.
    const SLACK: f64 = 1.0e-9;
    let ahead = along - smaller(larger(along, 0.0), track.length);
    let near = larger((ahead * ahead + across * across).sqrt() - SLACK, 0.0);
    let bound = track.tip(larger(along - form.radius - SLACK, 0.0)) + form.height(near) - SLACK;
    if near > form.radius || bound > now {
        return f64::INFINITY;
    }
    rounded_height(form, track, along, across)
}

/// As [`swept_height`], with the outward normal of the cut surface there (unit, up): for a ball it points
/// from the cut to the ball's centre.
pub(super) fn swept_height_and_normal(form: &Form, track: &Track, x: f64, y: f64) -> Option<(f64, Vector3)> {
    let (along, across) = track.along_across(x, y);
    let touch = match form.family {
        Family::Ball => ball_touch(track, form.radius, along, across),
        Family::Flat => flat_touch(track, form.radius, along, across),
        Family::Rounded => rounded::touch(form, track, along, across),
    }?;
    Some((touch.height, touch.normal(track)))
}

impl Touch {
    /// The gradient of the envelope is that of the profile at the place of the cutter which makes
    /// the cut (the minimum over t does not move the value to first order); at an edge it is that of
    /// z = slope·(s − √(R² − w²)), the trace of the rear half of a climbing circle.
    fn normal(&self, track: &Track) -> Vector3 {
        let (along, across, up) = match self.by {
            TouchedBy::Profile(sine, cosine) => {
                let rho = (self.along * self.along + self.across * self.across).sqrt();
                let level = if rho > 0.0 { sine / rho } else { 0.0 };
                (level * self.along, level * self.across, cosine)
            }
            TouchedBy::Edge(radius) => {
                let steep = track.slope * radius;
                let size = steep.hypot(self.along);
                if size == 0.0 {
                    (0.0, 0.0, 1.0)
                } else {
                    let level = track.slope / size;
                    (level * self.along, level * self.across, self.along / size)
                }
            }
        };
        let [x, y] = track.in_plan(along, across);
        Vector3::new(-x, -y, up).normalize()
    }
}

/// The ball's place on its track when it makes the lowest cut, in the ball's own terms.
struct BallTouch {
    /// Plan-view distance of the ball from the lower end of the track.
    sigma: f64,
    /// Depth of the cut below the ball's centre.
    depth: f64,
    /// False where the ball does not pass; the other members mean nothing then.
    inside: bool,
}

/// A capsule from below. Across the track at distance w the infinite cylinder around the centres'
/// line shows the half chord q = √(r² − w²); in the vertical plane along the track its lowest line
/// touches the circle of radius q on the normal of a track that rises by φ, so the ball that cuts at
/// s stands at σ = s − q sin φ and the cut lies q cos φ below its centre. Where that σ leaves the
/// track, convexity makes the nearer end the lowest: a sphere, √(q² − (s − σ)²) below its centre. A
/// plunge has no length, so only its lower end is left. |s − σ| = q sin φ <= q: the unbounded foot is
/// always within the ball, and only the ends need the test whether the ball reaches the point at all.
#[inline(always)]
fn ball_place(track: &Track, radius: f64, along: f64, across: f64) -> BallTouch {
    let chord_square = (radius - across) * (radius + across);
    let half_chord = larger(chord_square, 0.0).sqrt();
    let free = along - half_chord * track.sin();
    let sigma = smaller(larger(free, 0.0), track.length);
    let ahead = along - sigma;
    let on_track = (free > 0.0) & (free < track.length);
    let at_end = larger((half_chord - ahead) * (half_chord + ahead), 0.0).sqrt();
    let depth = if on_track { half_chord * track.cos } else { at_end };
    let inside = (chord_square >= 0.0) & (on_track | (ahead.abs() <= half_chord));
    BallTouch { sigma, depth, inside }
}

/// Height of the capsule's lower envelope; infinite where the ball does not pass. Free of branches,
/// so that a loop over a row of cells becomes vector code.
#[inline(always)]
pub(super) fn ball_height(track: &Track, radius: f64, along: f64, across: f64) -> f64 {
    let place = ball_place(track, radius, along, across);
    let height = track.tip(place.sigma) + (radius - place.depth);
    if place.inside { height } else { f64::INFINITY }
}

fn ball_touch(track: &Track, radius: f64, along: f64, across: f64) -> Option<Touch> {
    let place = ball_place(track, radius, along, across);
    let ahead = along - place.sigma;
    let rho = (ahead * ahead + across * across).sqrt();
    let by = TouchedBy::Profile(rho / radius, place.depth / radius);
    place.inside.then(|| Touch {
        height: ball_height(track, radius, along, across),
        along: ahead,
        across,
        by,
    })
}

/// A disc: it covers the point while |s − σ| <= q = √(R² − w²), and as the track rises the first of
/// those σ that lies on the track is the lowest.
#[inline(always)]
pub(super) fn flat_height(track: &Track, radius: f64, along: f64, across: f64) -> f64 {
    let chord_square = (radius - across) * (radius + across);
    let half_chord = larger(chord_square, 0.0).sqrt();
    let sigma = larger(along - half_chord, 0.0);
    let inside = (chord_square >= 0.0) & (sigma <= track.length) & (along >= -half_chord);
    if inside { track.tip(sigma) } else { f64::INFINITY }
}

fn flat_touch(track: &Track, radius: f64, along: f64, across: f64) -> Option<Touch> {
    let height = flat_height(track, radius, along, across);
    let half_chord = larger((radius - across) * (radius + across), 0.0).sqrt();
    let touch = if along > half_chord {
        Touch { height, along: half_chord, across, by: TouchedBy::Edge(radius) }
    } else {
        Touch { height, along, across, by: TouchedBy::Profile(0.0, 1.0) }
    };
    (height < f64::INFINITY).then_some(touch)
}
