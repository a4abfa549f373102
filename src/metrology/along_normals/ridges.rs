//! Ridges between places: where the cuts of two tracks are equally high on the way from one place to another.

use super::net::Place;
use super::tracks::Tracks;
use super::{AlongNormal, NormalHit};
use crate::geometry::{Point3, Vector3};
use crate::part::Part;

/// A crossing is found when the tangents of both cuts meet within this of it, mm.
const MEETING: f64 = 1e-8;

/// Steps of the search for one crossing; tangents halve the way at least, and mostly square the error.
const MOST_STEPS: usize = 48;

/// A way shorter than this share of the side holds one crossing.
const SHORTEST: f64 = 1e-7;

/// Tracks between tracks: at most this deep.
const MOST_DEPTH: usize = 8;

/// A ridge that crosses a side of the net.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Crossing {
    /// Height over the design surface, mm.
    pub height: f64,
    /// Where on the cut surface, mm.
    pub at: Point3,
    /// How fast the ridge rises along itself over the design, mm a mm.
    pub rise: f64,
    /// Length of ridge that it stands for, mm.
    pub length: f64,
    /// The two passes that meet, the first one first.
    pub passes: [u32; 2],
}

pub(super) struct Finder<'a> {
    pub part: &'a Part,
    pub engine: &'a dyn AlongNormal,
    pub tracks: &'a Tracks<'a>,
}

/// A cut on the way: share of the way, place, and hit.
#[derive(Clone, Copy)]
struct End {
    t: f64,
    place: Place,
    hit: NormalHit,
}

impl Finder<'_> {
    /// Appends the ridges between two places with what was cut there.
    pub fn between(
        &self,
        (from, a): (&Place, NormalHit),
        (to, b): (&Place, NormalHit),
        found: &mut Vec<Crossing>,
    ) {
        let ends = [End { t: 0.0, place: *from, hit: a }, End { t: 1.0, place: *to, hit: b }];
        self.search(from, to, ends, MOST_DEPTH, found);
    }

    fn search(
        &self,
        from: &Place,
        to: &Place,
        [mut a, mut b]: [End; 2],
        depth: usize,
        found: &mut Vec<Crossing>,
    ) {
        if !self.tracks.apart(a.hit.by, b.hit.by) {
            return;
        }
        let side = (to.point - from.point).norm();
        for _ in 0..MOST_STEPS {
            // How the heights go on from both ends, as far as their slopes tell.
            let way = (b.place.point - a.place.point) / (b.t - a.t);
            let [fa, fb] =
                [a, b].map(|end| -end.hit.normal.dot(&way) / end.hit.normal.dot(&end.place.normal).max(1e-9));
            let rest = b.t - a.t;
            let meeting = (b.hit.deviation - fb * rest - a.hit.deviation) / (fa - fb);
            let lowest = b.hit.deviation.max(a.hit.deviation);
            let height = a.hit.deviation + fa * meeting;
            if rest * side < SHORTEST * side.max(1e-3) || (height - lowest).abs() < MEETING && rest < 1e-3 {
                break;
            }
            let inside = meeting > 0.05 * rest && meeting < 0.95 * rest;
            let t = if inside { a.t + meeting } else { 0.5 * (a.t + b.t) };
            let place = from.towards(to, t, self.part);
            let Some(hit) = self.engine.hit(&place.point, &place.normal) else { return };
            let here = End { t, place, hit };
            match (self.tracks.apart(a.hit.by, hit.by), self.tracks.apart(hit.by, b.hit.by)) {
                (false, _) => a = here,
                (true, false) => b = here,
                (true, true) if depth > 0 => {
                    self.search(from, to, [a, here], depth - 1, found);
                    return self.search(from, to, [here, b], depth - 1, found);
                }
                (true, true) => return,
            }
        }
        let top = if a.hit.deviation > b.hit.deviation { a } else { b };
        let along: Vector3 = a.hit.normal.cross(&b.hit.normal);
        let rise = along.try_normalize(1e-12).map_or(0.0, |t| t.dot(&top.place.normal).abs());
        found.push(Crossing {
            height: top.hit.deviation,
            at: top.place.point + top.place.normal * top.hit.deviation,
            rise,
            length: 0.0,
            passes: self.tracks.passes(a.hit.by, b.hit.by),
        });
    }
}
