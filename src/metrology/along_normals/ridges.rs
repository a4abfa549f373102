//! Ridges between places: where the cuts of two tracks are equally high on the way from one place to another.

use super::net::NetPlace;
use super::{AlongNormal, NormalHit};
use crate::tracks::Tracks;
use geometry::{Point3, Vector3};
use part::Part;
use sim::RayHit;

/// A crossing is found when both tracks were seen within this share of the side from each other: what the
/// tangents then miss is of the order of its square.
pub(super) const CLOSE: f64 = 1e-3;

/// The same where heights within a few per cent are enough.
pub(super) const NEARLY: f64 = 0.1;

/// Looks are taken this share of the side before and beyond where the crossing should be, so that both tracks
/// are seen.
const ASIDE: f64 = 2e-4;

/// Looks of the search for one crossing; of these so many by tangents, the others halve the way.
const MOST_LOOKS: usize = 32;
const BY_TANGENTS: usize = 8;

/// Tracks are equally high within this, mm, ten times what rays tell, and a look along all moves that finds
/// as much is one at them.
const EQUALLY_HIGH: f64 = 1e-8;
const SAME: f64 = 2e-8;

/// Places at which two moves alone are asked at most; three or four are enough.
const MOST_GUESSES: usize = 16;

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
    /// The moves that meet.
    pub moves: [u32; 2],
    /// How much lower it may be, mm.
    pub uncertain: f64,
}

pub(super) struct Finder<'a> {
    pub part: &'a Part,
    pub engine: &'a dyn AlongNormal,
    pub tracks: &'a Tracks<'a>,
    /// Radius with which the cutter bends across the feed, about, mm.
    pub radius: f64,
    /// Share of the side within which both tracks of a crossing are seen.
    pub close: f64,
}

/// A cut on the way: share of the way, place, and hit.
#[derive(Clone, Copy)]
struct End {
    t: f64,
    place: NetPlace,
    hit: NormalHit,
}

impl Finder<'_> {
    /// Appends the ridges between two places with what was cut there.
    pub fn between(
        &self,
        (from, a): (&NetPlace, NormalHit),
        (to, b): (&NetPlace, NormalHit),
        found: &mut Vec<Crossing>,
    ) {
        let ends = [End { t: 0.0, place: *from, hit: a }, End { t: 1.0, place: *to, hit: b }];
        self.search(from, to, ends, MOST_DEPTH, found);
    }

    fn search(
        &self,
        from: &NetPlace,
        to: &NetPlace,
        [mut a, mut b]: [End; 2],
        depth: usize,
        found: &mut Vec<Crossing>,
    ) {
        if !self.tracks.apart(a.hit.by, b.hit.by) {
            return;
        }
        if let Some(met) = self.meeting_of_moves(from, to, [&a, &b]) {
            let place = met.place;
            let Some(hit) = self.engine.hit(&place.point, &place.normal, Some(&a.hit)) else { return };
            let lower = met.height() - hit.deviation;
            if lower.abs() <= SAME {
                return found.extend(self.crossing_of(&met, hit.uncertain));
            }
            if lower > 0.0 && depth > 0 {
                // One cuts there that neither end knows: a track between them, or moves farther on along one
                // of theirs.
                let here = End { t: met.t, place, hit };
                self.search(from, to, [a, here], depth - 1, found);
                return self.search(from, to, [here, b], depth - 1, found);
            }
        }
        // Cuts bend away from the design as the cutter's arc does; what is seen corrects that.
        let mut bend = (to.point - from.point).norm_squared() / self.radius;
        let mut aside = -ASIDE;
        for look in 0..MOST_LOOKS {
            if b.t - a.t < self.close {
                break;
            }
            let rest = b.t - a.t;
            let [x, _] = meeting(&a, &b, bend);
            let ahead = x + aside;
            let by_tangents = look < BY_TANGENTS && ahead > 0.0 && ahead < rest;
            let ahead = if by_tangents { ahead } else { 0.5 * rest };
            let place = from.towards(to, a.t + ahead, self.part);
            let near = if ahead < 0.5 * rest { &a.hit } else { &b.hit };
            let Some(hit) = self.engine.hit(&place.point, &place.normal, Some(near)) else { return };
            let here = End { t: a.t + ahead, place, hit };
            // How far beside the parabola of its track it lies tells how the track bends.
            let bent = |end: &End, way: f64, sense: f64| {
                let slope = sense * rise_over(end, &a, &b);
                (2.0 * (hit.deviation - end.hit.deviation - slope * way) / (way * way))
                    .clamp(0.0, 16.0 * bend)
            };
            match (self.tracks.apart(a.hit.by, hit.by), self.tracks.apart(hit.by, b.hit.by)) {
                (false, _) => {
                    bend = bent(&a, ahead, 1.0).max(1e-3 * bend);
                    (a, aside) = (here, ASIDE);
                }
                (true, false) => {
                    bend = bent(&b, rest - ahead, -1.0).max(1e-3 * bend);
                    (b, aside) = (here, -ASIDE);
                }
                (true, true) if depth > 0 => {
                    self.search(from, to, [a, here], depth - 1, found);
                    return self.search(from, to, [here, b], depth - 1, found);
                }
                (true, true) => return,
            }
        }
        let [x, height] = meeting(&a, &b, bend);
        let (rest, top) = (b.t - a.t, a.hit.deviation.max(b.hit.deviation));
        let steepest = rise_over(&a, &a, &b).abs().max(rise_over(&b, &a, &b).abs());
        // Beside a wall one track ends: the ridge is the higher edge.
        let smooth = x >= 0.0 && x <= rest && (height - top).abs() <= steepest * rest + 1e-9;
        // Tangents of cuts that nearly hold the normal meet anywhere; no hit was looked for farther out or
        // deeper than the engine tells.
        let smooth = smooth && height >= -self.engine.depth() && height <= top.max(self.engine.reach());
        let place = from.towards(to, if smooth { a.t + x } else { 0.5 * (a.t + b.t) }, self.part);
        let height = if smooth { height } else { top };
        let along: Vector3 = a.hit.normal.cross(&b.hit.normal);
        found.push(Crossing {
            height,
            at: place.point + place.normal * height,
            rise: along.try_normalize(1e-12).map_or(0.0, |t| t.dot(&place.normal).abs()),
            length: 0.0,
            passes: self.tracks.passes(a.hit.by, b.hit.by),
            moves: [a.hit.by, b.hit.by],
            uncertain: a.hit.uncertain.max(b.hit.uncertain),
        });
    }

    /// Where on the way from `a` to `b` the moves that cut these, with those that go on where they end, would
    /// meet the normal equally high; `None` where they do not tell it alone. Two moves are asked much faster
    /// than all.
    fn meeting_of_moves(&self, from: &NetPlace, to: &NetPlace, [a, b]: [&End; 2]) -> Option<Meeting> {
        let rest = b.t - a.t;
        let bend = (b.place.point - a.place.point).norm_squared() / self.radius / (rest * rest);
        let mut by = [a.hit.by, b.hit.by];
        let mut t = a.t + meeting(a, b, bend)[0];
        // How much faster the first track rises along the way than the second; there the bends are equal.
        let mut rise = rise_over(a, a, b) - rise_over(b, a, b) + bend * rest;
        let mut last: Option<[f64; 2]> = None;
        // Each end is cut by its own moves.
        let mut within = [a.t, b.t];
        for _ in 0..MOST_GUESSES {
            if !(t >= within[0] && t <= within[1]) {
                t = 0.5 * (within[0] + within[1]);
            }
            let place = from.towards(to, t, self.part);
            let cut = |by: u32| self.engine.cut_by(&place.point, &place.normal, by);
            let cuts = match [cut(by[0]), cut(by[1])] {
                [Some(first), Some(second)] => [first, second],
                // No lower than where the other one cuts.
                [Some(_), None] => {
                    (within[0], t, last) = (t, f64::NAN, None);
                    continue;
                }
                [None, Some(_)] => {
                    (within[1], t, last) = (t, f64::NAN, None);
                    continue;
                }
                [None, None] => return None,
            };
            let apart = cuts[0].s - cuts[1].s;
            if apart.abs() <= EQUALLY_HIGH {
                return Some(Meeting { t, place, cuts });
            }
            within[usize::from(apart > 0.0)] = t;
            if let Some([before, then]) = last {
                rise = (apart - then) / (t - before);
            }
            (last, by) = (Some([t, apart]), cuts.map(|cut| cut.index));
            t -= apart / rise;
        }
        None
    }

    /// The ridge where two tracks meet, which may be lower by what is `uncertain`, mm.
    fn crossing_of(&self, met: &Meeting, uncertain: f64) -> Option<Crossing> {
        let Meeting { place, cuts, .. } = met;
        let normal = |cut: &RayHit| self.engine.normal_of(&place.point, &place.normal, cut);
        let along: Vector3 = normal(&cuts[0])?.cross(&normal(&cuts[1])?);
        let (height, moves) = (met.height(), cuts.map(|cut| cut.index));
        Some(Crossing {
            height,
            at: place.point + place.normal * height,
            rise: along.try_normalize(1e-12).map_or(0.0, |t| t.dot(&place.normal).abs()),
            length: 0.0,
            passes: self.tracks.passes(moves[0], moves[1]),
            moves,
            uncertain,
        })
    }
}

/// A place between two ends, and where the tracks of both would cut its normal.
struct Meeting {
    t: f64,
    place: NetPlace,
    cuts: [RayHit; 2],
}

impl Meeting {
    /// Over the design, mm.
    fn height(&self) -> f64 {
        self.cuts[0].s.min(self.cuts[1].s)
    }
}

/// How fast the cut at an end rises along the way from `a` to `b`, mm a whole side.
fn rise_over(end: &End, a: &End, b: &End) -> f64 {
    let way = (b.place.point - a.place.point) / (b.t - a.t);
    -end.hit.normal.dot(&way) / end.hit.normal.dot(&end.place.normal).max(1e-9)
}

/// Where after `a`, and how high, two parabolas of the same bend meet that leave the ends with the slopes of
/// their cuts.
fn meeting(a: &End, b: &End, bend: f64) -> [f64; 2] {
    let rest = b.t - a.t;
    let [fa, fb] = [a, b].map(|end| rise_over(end, a, b));
    let x =
        (b.hit.deviation - a.hit.deviation - fb * rest + 0.5 * bend * rest * rest) / (fa - fb + bend * rest);
    [x, a.hit.deviation + fa * x + 0.5 * bend * x * x]
}
