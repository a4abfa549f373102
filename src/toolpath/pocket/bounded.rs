//! Runs whose engagement is bounded: loops where more of the cutter would stand in stock than is allowed.
//!
//! Enters: a run, the room of its centre, the ground cleared before it. Leaves: the same way with loops put
//! in (trochoidal milling). A loop touches the way from its left, the side that climb milling clears first
//! (lines back and forth: from the side of the rows to come): a circle, in corners and necks the largest that
//! fits, followed as far as it cuts and left by a bend back over cleared ground. The way between two loops is
//! the longest whose loop keeps to the limit. Loops grow from cleared ground: a run that would begin in stock
//! is opened by a helix where there is room. Every place is asked for the angle of the circumference in stock
//! before the cutter goes there ([`Cleared`]); mm, rad.
//!
//! Loops may be anywhere in the piece and not only within their nest: thin nests leave them no room. A loop
//! cannot grow out of a single disc, whose far side moves at right angles to its heading; hence the helix.
//! Past the end of a line of a zigzag the link along the wall goes to the side of its loops and finds ground
//! to begin in.

use std::cell::Cell;

use super::cleared::{Cleared, FILM};
use super::loops::{Loop, Loops, Sides, enter, open};
use super::route::Run;
use super::turning::Turning;
use super::walls::Room;
use super::way::Way;
use geometry::Point2;
use work::monitor::{Cancelled, Monitor, check};

/// Places of the way are this share of the radius apart: the chip between two is seen, and the cusp between
/// their discs is a tenth of a film.
pub(super) const STEP: f64 = 0.08;

/// Before the limit the way is gone by steps down to this share of the radius.
const FINEST: f64 = 0.005;

/// An unbroken way at least so long, over the radius, is gone without loops ...
const FREE: f64 = 1.5;

/// ... but for this much before its end, where loops may have to begin.
const BACK: f64 = 1.0;

/// Places this far behind, over the radius, are beside the move's own chip.
const FRESH: f64 = 0.5;

/// What bounding did.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Bounding {
    /// Number of loops.
    pub loops: usize,
    /// Stretches of the way that are above the limit since no loop could be put in: where each begins, and
    /// its length, mm.
    pub above: Vec<(Point2, f64)>,
}

impl Bounding {
    /// What was done to several runs.
    pub fn add(&mut self, other: Self) {
        self.loops += other.loops;
        self.above.extend(other.above);
    }
}

/// What runs are bounded by.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rules {
    /// The limit, and the cutter's radius.
    pub bounds: Turning,
    /// Where loops may be.
    pub sides: Sides,
    /// Radius that a helix should have, and the least that is worth one, mm.
    pub helix: [f64; 2],
    /// Length of a way down, mm.
    pub down: f64,
    /// A helix leaves a core where the bottom is round: rings this far apart, mm, take it off, up to the least
    /// one of [`Self::core`].
    pub step: f64,
    /// A ring no larger than this leaves no core, mm.
    pub core: f64,
}

/// Keeps runs to their room, and puts loops into them.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub(super) fn bound_all(
    runs: &mut Vec<Run>,
    room: &Room,
    cleared: &mut Cleared,
    rules: &Rules,
    monitor: &dyn Monitor,
) -> Result<Bounding, Cancelled> {
    let mut did = Bounding::default();
    room.keep_all(runs, monitor)?;
    for run in runs.iter_mut() {
        did.add(bound(run, room, cleared, rules, monitor)?);
    }
    room.keep_all(runs, monitor)?;
    Ok(did)
}

/// Puts loops into `run` so that no more of the circumference stands in stock than `bounds` allow, and adds
/// its ground to `cleared`.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub(super) fn bound(
    run: &mut Run,
    room: &Room,
    cleared: &mut Cleared,
    rules: &Rules,
    monitor: &dyn Monitor,
) -> Result<Bounding, Cancelled> {
    let bounds = rules.bounds;
    open(run, room, cleared, rules);
    enter(run, cleared, bounds.radius);
    if run.points.len() < 2 {
        return Ok(Bounding::default());
    }
    let mut walker = Walker::new(Way::new(&run.points), room, cleared, rules);
    walker.go(monitor)?;
    run.points = walker.out;
    Ok(walker.did)
}

/// A state that can be returned to.
#[derive(Clone, Copy)]
struct Mark {
    s: f64,
    out: usize,
    places: usize,
}

struct Walker<'a> {
    way: Way,
    room: &'a Room<'a>,
    cleared: &'a mut Cleared,
    bounds: Turning,
    sides: Sides,
    radius: f64,
    out: Vec<Point2>,
    marks: Vec<Mark>,
    /// Where the last stretch above the limit ends.
    above_to: f64,
    /// The ground is thinned when it has so many places.
    thin_at: usize,
    /// Where the last loop that could not be put in was above the limit, in sides from its beginning: others
    /// are asked there first.
    above_at: Cell<usize>,
    did: Bounding,
}

impl<'a> Walker<'a> {
    fn new(way: Way, room: &'a Room<'a>, cleared: &'a mut Cleared, rules: &Rules) -> Self {
        Self {
            way,
            room,
            cleared,
            bounds: rules.bounds,
            sides: rules.sides,
            radius: rules.bounds.radius,
            out: Vec::new(),
            marks: Vec::new(),
            above_to: f64::NEG_INFINITY,
            thin_at: 0,
            above_at: Cell::new(0),
            did: Bounding::default(),
        }
    }

    fn go(&mut self, monitor: &dyn Monitor) -> Result<(), Cancelled> {
        let total = self.way.total();
        let (free, back) = (FREE * self.radius, BACK * self.radius);
        self.place(0.0, self.way.at(0.0));
        let mut s = 0.0;
        // The radius of the last loop at this very place.
        let mut here = 0.0;
        while s < total {
            check(monitor)?;
            self.thin(s);
            let begun = self.marks.len();
            let reach = self.walk(s, total, false);
            if reach >= total {
                break;
            }
            if reach - s >= free {
                s = self.back_to(reach - back);
                here = 0.0;
                continue;
            }
            self.back_to_mark(begun - 1);
            match self.loops().next(s, reach, here) {
                Some((on, found)) => {
                    here = found.radius;
                    s = self.walk(s, on, true);
                    self.follow(&found, s);
                }
                None => {
                    let on = (s + STEP * self.radius).min(total).max(reach);
                    s = self.walk(s, reach, true);
                    let nibbled = self.nibble(s);
                    if nibbled > s {
                        s = nibbled;
                    } else {
                        self.tell_above(reach, on);
                        s = self.walk(s, on, true);
                    }
                    here = 0.0;
                }
            }
        }
        Ok(())
    }

    fn loops(&self) -> Loops<'_> {
        let Self { way, room, cleared, bounds, sides, above_at, .. } = self;
        Loops { way, room, cleared, bounds: *bounds, sides: *sides, above_at }
    }

    fn place(&mut self, s: f64, at: Point2) {
        self.cleared.add(at);
        self.out.push(at);
        self.marks.push(Mark { s, out: self.out.len(), places: self.cleared.len() });
    }

    /// Leaves out places of the ground that others cover, where none of them will be taken back and none is
    /// fresh at `s`.
    fn thin(&mut self, s: f64) {
        /// Fewer are no matter.
        const FEW: usize = 200;
        if self.cleared.len() < self.thin_at {
            return;
        }
        let settled = self.fresh_from(s);
        self.cleared.thin(settled);
        for mark in &mut self.marks {
            mark.places = mark.places.max(settled);
        }
        self.thin_at = self.cleared.len() + FEW;
    }

    fn back_to_mark(&mut self, index: usize) {
        self.marks.truncate(index + 1);
        let mark = self.marks[index];
        self.out.truncate(mark.out);
        self.cleared.truncate(mark.places);
    }

    /// Takes back the way beyond `s`; leaves where it ends now.
    fn back_to(&mut self, s: f64) -> f64 {
        let index = self.marks.partition_point(|m| m.s <= s).max(1) - 1;
        self.back_to_mark(index);
        self.marks[index].s
    }

    /// Goes on from `s` to `to`, or until the limit (which `forced` leaves aside). Leaves how far it came.
    fn walk(&mut self, mut s: f64, to: f64, forced: bool) -> f64 {
        let full = STEP * self.radius;
        let mut step = full;
        let mut corner = self.way.corner_after(s);
        while s < to {
            if s >= corner {
                corner = self.way.corner_after(s);
            }
            let next = (s + step).min(to).min(corner);
            let at = self.way.at(next);
            if forced || (self.arc_at(next) <= self.bounds.limit && self.keeps_on(s, next)) {
                self.out.extend(self.way.corners_between(s, next));
                self.place(next, at);
                s = next;
                step = full.min(2.0 * step);
            } else if step > FINEST * self.radius {
                step *= 0.5;
            } else {
                return s;
            }
        }
        s
    }

    /// Notes the stretch from `s` to `on` if more than a film is above the limit at its end.
    fn tell_above(&mut self, s: f64, on: f64) {
        let Some(heading) = self.way.heading(on).filter(|_| s < on) else { return };
        if self.cleared.arc(&self.way.at(on), &heading, usize::MAX) <= self.bounds.limit {
            return;
        }
        match self.did.above.last_mut() {
            Some((_, length)) if s - self.above_to < STEP * self.radius => *length += on - s,
            _ => self.did.above.push((self.way.at(s), on - s)),
        }
        self.above_to = on;
    }

    /// Angle in stock where the way comes to `s`.
    fn arc_at(&self, s: f64) -> f64 {
        let Some(heading) = self.way.heading(s) else { return 0.0 };
        self.cleared.arc(&self.way.at(s), &heading, self.fresh_from(s))
    }

    /// Whether the way between two places keeps to the limit.
    fn keeps_on(&self, s: f64, next: f64) -> bool {
        self.cleared.keeps(&self.way.at(s), &self.way.at(next), self.bounds.limit, self.fresh_from(next))
    }

    /// The first place that is beside the chip of a move at `s`.
    fn fresh_from(&self, s: f64) -> usize {
        let behind = self.marks.partition_point(|m| m.s < s - FRESH * self.radius);
        self.marks.get(behind).map_or(0, |m| m.places - 1)
    }

    /// Goes on from `s` to a corner of walls right before it, a film at a time, each after a way back and
    /// forth over cleared ground: where no loop fits any more, only a layer that loads nothing may stand at
    /// so great an angle. Leaves how far it came.
    fn nibble(&mut self, s: f64) -> f64 {
        /// Layers over a film. Greater might be more than one, where chords meet.
        const LAYER: f64 = 0.9;
        /// Longer ways, over the radius, are slots that the report has to name. Tips of 40 degrees, and those
        /// before necks that are too narrow, end within it at the smallest limits.
        const MOST: f64 = 0.5;
        /// Half the way back and forth over the radius: what was cut farther behind is no chip of its own any
        /// more.
        const BACK: f64 = 0.06;
        /// Cosine of the turn in a corner of walls. Bends that are less sharp have room for loops beyond
        /// them.
        const WALLS: f64 = 0.8;
        let (radius, corner) = (self.radius, self.way.corner_after(s));
        // Where the way begins nearer than that, it is gone back and forth more often.
        let back = (s - BACK * radius).max(0.0);
        let Some(heading) = self.way.heading(corner) else { return s };
        let onward = self.way.heading(corner + FINEST * radius).unwrap_or(heading);
        let bends = corner < self.way.total() && heading.dot(&onward) > WALLS;
        if bends || corner - s > MOST * radius || s - back < FINEST * radius {
            return s;
        }
        let times = (BACK * radius / (s - back)).ceil() as usize;
        let behind = self.way.at(back);
        let between = self.way.corners_between(back, s).to_vec();
        let steps = ((corner - s) / (LAYER * FILM * radius)).ceil() as usize;
        let mut gone = s;
        for step in 1..=steps {
            let on = s + (corner - s) * step as f64 / steps as f64;
            let at = self.way.at(on);
            if self.cleared.arc(&at, &heading, usize::MAX) > self.bounds.limit {
                break;
            }
            for again in 0..times {
                self.out.extend((again > 0).then(|| self.way.at(gone)));
                self.out.extend(between.iter().rev().chain([&behind]).chain(&between));
            }
            self.place(on, at);
            gone = on;
        }
        gone
    }

    /// Follows a loop from the place `s` of the way as far as it cuts, and back.
    fn follow(&mut self, found: &Loop, s: f64) {
        // The way up to here has cut since the loop was tried.
        let cuts: Vec<bool> = found
            .places
            .iter()
            .map(|at| self.cleared.arc(at, &found.tangent(at), usize::MAX) > 0.0)
            .collect();
        let Some(last) = cuts.iter().rposition(|c| *c) else { return };
        self.did.loops += 1;
        for (at, cuts) in found.places.iter().zip(&cuts).take(last + 1) {
            self.out.push(*at);
            if *cuts {
                self.cleared.add(*at);
            }
        }
        let begin = self.way.at(s);
        let way = self.loops().back(found, last, &begin);
        self.out.extend(way);
        self.place(s, begin);
    }
}
