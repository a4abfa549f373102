//! Where the cuts of two passes meet on a line between two points: the ridge in closed form.
//!
//! Enters: the cut surface, and a line on whose ends it is known which move is lowest. Leaves: every
//! place on the line where the lowest move changes from one track to another, mm. Moves that are
//! lowest only between the ends are found on the way.

use super::cut_surface::{CutPoint, CutSurface};
use super::tracks::Tracks;
use geometry::Point2;
use motion::{Cutters, Toolpath};
use sim::NOT_CUT;

/// Two heights that differ by more than this, mm, do not meet.
const MEETING: f64 = 1e-6;

/// Ridges inside ridges (a pass that shows only between the ends): at most this deep.
const MOST_DEPTH: usize = 8;

/// A meeting is found to this share of the line.
const CROSSING: f64 = 1e-10;

/// What stands before an edge is asked for at this share of the line before it: more than [`CROSSING`].
/// Gaps narrower than this are not seen.
const EDGE: f64 = 1e-6;

/// A place where two cuts are equally high and none is lower.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Meeting {
    /// Share of the line.
    pub t: f64,
    /// Where, mm.
    pub at: Point2,
    /// Height, mm.
    pub z: f64,
    /// The moves that meet, in the order of the line.
    pub moves: [u32; 2],
}

/// Finds meetings on a cut surface.
pub struct Meetings<'a> {
    surface: &'a CutSurface<'a>,
    tracks: Tracks<'a>,
    /// Height of flat stock whose rim counts as a ridge, mm.
    stock: Option<f64>,
}

impl<'a> Meetings<'a> {
    /// On the surface that `path` has cut. With a height of `stock` the line along which a cut meets
    /// flat stock counts too.
    pub fn new(
        surface: &'a CutSurface<'a>,
        cutters: impl Into<Cutters>,
        path: &'a Toolpath,
        stock: Option<f64>,
    ) -> Self {
        Self { surface, tracks: Tracks::new(path, cutters), stock }
    }

    /// True when two moves belong to neighbouring tracks rather than to one.
    pub fn apart(&self, a: u32, b: u32) -> bool {
        if a == NOT_CUT || b == NOT_CUT {
            return a != b && self.stock.is_some();
        }
        self.tracks.apart(a, b)
    }

    /// Hands to `found` the meetings between `a`, lowest at the share `ta` of the line `at`, and `b`,
    /// lowest at `tb`, in the order of the line.
    pub fn between(
        &self,
        at: &dyn Fn(f64) -> Point2,
        a: (f64, u32),
        b: (f64, u32),
        found: &mut dyn FnMut(Meeting),
    ) {
        self.between_or_gaps(at, a, b, found, &mut |_| {});
    }

    /// As [`Meetings::between`]; hands to `gap` the places between `a` and `b` that no move around reaches:
    /// stock stands there, or a move passes that no cell saw.
    pub fn between_or_gaps(
        &self,
        at: &dyn Fn(f64) -> Point2,
        a: (f64, u32),
        b: (f64, u32),
        found: &mut dyn FnMut(Meeting),
        gap: &mut dyn FnMut(Point2),
    ) {
        self.search(at, a, b, MOST_DEPTH, found, gap);
    }

    fn search(
        &self,
        at: &dyn Fn(f64) -> Point2,
        (ta, a): (f64, u32),
        (tb, b): (f64, u32),
        depth: usize,
        found: &mut dyn FnMut(Meeting),
        gap: &mut dyn FnMut(Point2),
    ) {
        if !self.apart(a, b) {
            return;
        }
        let t = self.crossing(at, (ta, a), (tb, b));
        let q = at(t);
        let (za, zb) = (self.height(a, q), self.height(b, q));
        let Some(mut lowest) = self.surface.at(q.x, q.y) else { return gap(q) };
        // Neighbours in the program of both, which no cell may have seen where moves are short.
        for (by, z) in [(a, za), (b, zb)] {
            let beside = self.surface.follow(CutPoint { z, by }, q.x, q.y);
            lowest = if beside.z < lowest.z { beside } else { lowest };
        }
        // Another move is lower at the crossing: it stands between the two.
        let third = lowest.z < za.min(zb) - 1e-9 && lowest.by != a && lowest.by != b;
        if third && depth > 0 && self.surface.pass(lowest.by).is_some() {
            self.search(at, (ta, a), (t, lowest.by), depth - 1, found, gap);
            self.search(at, (t, lowest.by), (tb, b), depth - 1, found, gap);
        } else if za.is_finite() && zb.is_finite() && (za - zb).abs() <= MEETING {
            found(Meeting { t, at: q, z: za.max(zb), moves: [a, b] });
        } else if za.is_infinite() != zb.is_infinite() {
            // The crossing is where `b` begins, if `a` has not ended there at the latest.
            let before = at((t - EDGE).max(ta));
            let ended = |by| self.height(by, before).is_infinite();
            if ended(a) && ended(b) && self.surface.at(before.x, before.y).is_none() {
                return gap(before);
            }
            // A cutter with a flat ends in a wall: the ridge is its edge.
            found(Meeting { t, at: q, z: za.min(zb), moves: [a, b] });
        }
    }

    /// Height of the cut of `by`, infinite where it does not pass.
    fn height(&self, by: u32, q: Point2) -> f64 {
        let height = if by == NOT_CUT { self.stock } else { self.surface.envelope.height(by, q.x, q.y) };
        height.unwrap_or(f64::INFINITY)
    }

    /// Where the cuts of `a` and `b` are equally high, by bisection and regula falsi (Illinois).
    fn crossing(&self, at: &dyn Fn(f64) -> Point2, (mut ta, a): (f64, u32), (mut tb, b): (f64, u32)) -> f64 {
        let difference = |t: f64| {
            let q = at(t);
            match (self.height(a, q), self.height(b, q)) {
                (_, f64::INFINITY) => f64::NEG_INFINITY,
                (za, zb) => za - zb,
            }
        };
        let (mut fa, mut fb) = (difference(ta), difference(tb));
        if fa >= 0.0 {
            return ta;
        }
        if fb <= 0.0 {
            return tb;
        }
        let mut side = 0i8;
        for _ in 0..100 {
            if tb - ta < CROSSING {
                break;
            }
            let secant = ta + (tb - ta) * (fa / (fa - fb));
            let t = if secant > ta && secant < tb { secant } else { 0.5 * (ta + tb) };
            let f = difference(t);
            if f.abs() < 1e-13 {
                return t;
            }
            if f < 0.0 {
                (ta, fa) = (t, f);
                if side == -1 && fb.is_finite() {
                    fb *= 0.5;
                }
                side = -1;
            } else {
                (tb, fb) = (t, f);
                if side == 1 && fa.is_finite() {
                    fa *= 0.5;
                }
                side = 1;
            }
        }
        0.5 * (ta + tb)
    }
}
