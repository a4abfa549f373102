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
//! Loops may be anywhere in the piece and not only within their nest: thin nests leave them no room. A loop cannot grow out
//! of a single disc, whose far side moves at right angles to its heading; hence the helix. Past the end of a line of a
//! zigzag the link along the wall goes to the side of its loops and finds ground to begin in.

use std::cell::Cell;
use std::f64::consts::{PI, TAU};

use super::cleared::{Cleared, FILM};
use super::route::{Entry, Run, bend, circle};
use super::turning::Turning;
use super::walls::Room;
use super::way::{Way, fitting};
use geometry::{Point2, Vector2};
use work::monitor::{Cancelled, Monitor, check};

/// Places of the way are this share of the radius apart: the chip between two is seen, and the cusp between
/// their discs is a tenth of a film.
pub(super) const STEP: f64 = 0.08;

/// Before the limit the way is gone by steps down to this share of the radius.
const FINEST: f64 = 0.005;

/// Greatest loop over the cutter's radius. Above 1 a core would stand in it.
const GREATEST: f64 = 0.75;

/// Least loop over the cutter's radius. What stays in a square corner after it is a film.
pub(super) const LEAST: f64 = 0.006;

/// Loops are tried by this ratio: the growth of loops around each other is about half as much more.
const SHRINK: f64 = 0.87;

/// An unbroken way at least so long, over the radius, is gone without loops ...
const FREE: f64 = 1.5;

/// ... but for this much before its end, where loops may have to begin.
const BACK: f64 = 1.0;

/// A loop is worth it when it comes this share of what it could in a slot.
const WORTH: f64 = 0.4;

/// Places this far behind, over the radius, are beside the move's own chip.
const FRESH: f64 = 0.5;

/// Sides of loops over the radius, and their number at least.
const SIDE: f64 = 0.08;
const LEAST_SIDES: f64 = 36.0;

/// Bisections for the length between two loops.
const HALVINGS: u32 = 5;

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

/// On which side of the way loops are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Sides {
    /// On the left, the cleared one of passes that climb; on the right where there is none.
    Left,
    /// Of lines back and forth, whose cleared ground is on each side in turns, toward the rows to come, which
    /// this unit vector across them points to: there the next link needs room. Of links and walls on
    /// either.
    Toward(Vector2),
}

impl Sides {
    /// Groups of sides, 1 for the left and -1 for the right, where the way has this direction: a later group
    /// serves where there is no loop on those of the one before.
    fn of(self, heading: &Vector2) -> &'static [&'static [f64]] {
        /// Sine of what is no line any more.
        const ALONG: f64 = 0.01;
        match self {
            Self::Toward(across) if heading.dot(&across).abs() > ALONG => &[&[1.0, -1.0]],
            Self::Toward(across) if heading.perp(&across) < 0.0 => &[&[-1.0], &[1.0]],
            _ => &[&[1.0], &[-1.0]],
        }
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
}

/// Where a ramp would begin in stock, which leaves a slot to begin with, a helix that touches the way takes
/// its place, if there is room for one: at the way's beginning, else from the first place that has room on,
/// and back from there.
fn open(run: &mut Run, room: &Room, cleared: &Cleared, rules: &Rules) {
    /// Where the helix may be so small, over the one wanted, the way is not gone on for a greater one.
    const ENOUGH: f64 = 0.75;
    /// Places that are asked are this share of the radius apart.
    const APART: f64 = 0.25;
    let radius = rules.bounds.radius;
    let way = Way::new(&run.points);
    let Some(heading) = way.heading(0.0) else { return };
    let (Entry::Ramp(_), true) =
        (&run.entry, cleared.arc(&way.at(0.0), &heading, usize::MAX) > rules.bounds.limit)
    else {
        return;
    };
    let [wanted, least] = rules.helix;
    let mut best: Option<(f64, Point2, f64)> = None;
    for k in 0..=(way.total() / (APART * radius)) as usize {
        let s = k as f64 * APART * radius;
        for side in [1.0, -1.0] {
            let fits = fitting(&way, room, radius, s, wanted, side);
            if let Some((centre, rho, _)) = fits.filter(|f| f.1 >= least && best.is_none_or(|b| f.1 > b.2)) {
                best = Some((s, centre, rho));
            }
        }
        if best.is_some_and(|b| b.2 >= ENOUGH * wanted) {
            break;
        }
    }
    let Some((s, centre, rho)) = best else { return };
    let begin = way.at(s);
    if s > 0.0 {
        let back = way.corners_between(0.0, s).iter().rev().copied();
        run.points = std::iter::once(begin).chain(back).chain(way.points.iter().copied()).collect();
    }
    let out = begin - centre;
    run.entry = Entry::Helix { centre, radius: rho, begin: out.y.atan2(out.x) };
}

/// Clears what a helix does at depth. What a ramp leaves below its slope is stock.
fn enter(run: &Run, cleared: &mut Cleared, radius: f64) {
    if let Entry::Helix { centre, radius: turn, begin } = &run.entry {
        circle(centre, *turn, *begin, STEP * radius).into_iter().for_each(|p| cleared.add(p));
    }
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

/// A loop that keeps to the limit.
struct Loop {
    radius: f64,
    /// 1 on the left of the way, counter-clockwise, -1 on its right, clockwise.
    side: f64,
    centre: Point2,
    places: Vec<Point2>,
    /// It cuts nothing.
    empty: bool,
}

impl Loop {
    /// Its direction at one of its places.
    fn tangent(&self, at: &Point2) -> Vector2 {
        let out = (at - self.centre) / self.radius;
        Vector2::new(-out.y, out.x) * self.side
    }
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
    /// Where the last loop that could not be put in was above the limit, in sides from its beginning: others are asked there first.
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
            match self.next_loop(s, reach, here) {
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

    fn place(&mut self, s: f64, at: Point2) {
        self.cleared.add(at);
        self.out.push(at);
        self.marks.push(Mark { s, out: self.out.len(), places: self.cleared.len() });
    }

    /// Leaves out places of the ground that others cover, where none of them will be taken back and none is fresh at `s`.
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

    /// Goes on from `s` to a corner of walls right before it, a film at a time, each after a way back and forth over cleared ground:
    /// where no loop fits any more, only a layer that loads nothing may stand at so great an angle. Leaves how far it came.
    fn nibble(&mut self, s: f64) -> f64 {
        /// Layers over a film. Greater might be more than one, where chords meet.
        const LAYER: f64 = 0.9;
        /// Longer ways, over the radius, are slots that the report has to name. Tips of 40 degrees, and those before necks that are
        /// too narrow, end within it at the smallest limits.
        const MOST: f64 = 0.5;
        /// Half the way back and forth over the radius: what was cut farther behind is no chip of its own any more.
        const BACK: f64 = 0.06;
        /// Cosine of the turn in a corner of walls. Bends that are less sharp have room for loops beyond them.
        const WALLS: f64 = 0.8;
        let (radius, corner) = (self.radius, self.way.corner_after(s));
        let back = s - BACK * radius;
        let Some(heading) = self.way.heading(corner) else { return s };
        let onward = self.way.heading(corner + FINEST * radius).unwrap_or(heading);
        let bends = corner < self.way.total() && heading.dot(&onward) > WALLS;
        if bends || corner - s > MOST * radius || back < 0.0 {
            return s;
        }
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
            self.out.extend(between.iter().rev().chain([&behind]).chain(&between));
            self.place(on, at);
            gone = on;
        }
        gone
    }

    /// The next loop: how far on along the way, at most `reach`, and the loop. `here` is the radius of the
    /// last one at `s` itself.
    fn next_loop(&self, s: f64, reach: f64, here: f64) -> Option<(f64, Loop)> {
        let heading = self.way.heading(s)?;
        self.sides.of(&heading).iter().find_map(|sides| self.loop_on(sides, s, reach, here))
    }

    /// The next loop on one of `sides`.
    fn loop_on(&self, sides: &[f64], s: f64, reach: f64, here: f64) -> Option<(f64, Loop)> {
        /// Loops around the last one are at least so much greater.
        const GROWTH: f64 = 1.03;
        let mut around: Option<Loop> = None;
        let mut rho = GREATEST * self.radius;
        while rho >= LEAST * self.radius {
            let could = self.bounds.ring_step(rho);
            let worth = (WORTH * could).min(reach - s);
            for &side in sides {
                match self.loop_at(s + worth, rho, side) {
                    Some(found) if worth > 0.0 && (!found.empty || side == sides[sides.len() - 1]) => {
                        return Some(self.farthest(s, worth, reach - s, could, rho, found));
                    }
                    _ if around.is_none() => {
                        let grown = |l: &Loop| l.radius > GROWTH * here && !l.empty;
                        around = self.loop_at(s, rho, side).filter(grown);
                    }
                    _ => {}
                }
            }
            rho *= SHRINK;
        }
        around.map(|found| (s, found))
    }

    /// The longest way on for a loop of this radius, that at `lo` being known.
    fn farthest(&self, s: f64, lo: f64, most: f64, could: f64, rho: f64, known: Loop) -> (f64, Loop) {
        let (mut lo, mut hi, mut best) = (lo, most, known);
        let mut next = could.min(most);
        for _ in 0..HALVINGS {
            match self.loop_at(s + next, rho, best.side) {
                Some(found) => (lo, best) = (next, found),
                None => hi = next,
            }
            if hi - lo < 0.02 * could {
                break;
            }
            next = if hi == most && lo > 0.0 { (2.0 * lo).min(hi) } else { 0.5 * (lo + hi) };
            next = if next <= lo { hi } else { next };
        }
        (s + lo, best)
    }

    /// The loop of the radius `rho` (less where there is no room) at `s`, if it keeps to the limit.
    fn loop_at(&self, s: f64, rho: f64, side: f64) -> Option<Loop> {
        let (centre, rho, inwards) = fitting(&self.way, self.room, self.radius, s, rho, side)?;
        let sides = (TAU * rho / (SIDE * self.radius)).ceil().max(LEAST_SIDES) as usize;
        let begin = inwards.y.atan2(inwards.x) + PI;
        let asked = |k: usize| {
            let turn = begin + side * TAU * k as f64 / sides as f64;
            let at = centre + Vector2::new(turn.cos(), turn.sin()) * rho;
            // That of the side that ends here: it looks farther outwards than the tangent.
            let (sin, cos) = (turn - side * PI / sides as f64).sin_cos();
            (at, self.cleared.arc(&at, &(Vector2::new(-sin, cos) * side), usize::MAX))
        };
        if asked(self.above_at.get().min(sides)).1 > self.bounds.limit {
            return None;
        }
        let mut found = Loop { radius: rho, side, centre, places: Vec::new(), empty: true };
        for k in 0..=sides {
            let (at, arc) = asked(k);
            // What stands may be met between two places.
            let keeps = |from| self.cleared.keeps(from, &at, self.bounds.limit, usize::MAX);
            if arc > self.bounds.limit || !found.places.last().is_none_or(keeps) {
                self.above_at.set(k);
                return None;
            }
            found.places.push(at);
            found.empty &= arc == 0.0;
        }
        Some(found)
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
        let way = self.back(found, last, &begin);
        self.out.extend(way);
        self.place(s, begin);
    }

    /// From a place of a loop back to where it began: a bend over cleared ground, else on around the loop.
    fn back(&self, found: &Loop, last: usize, begin: &Point2) -> Vec<Point2> {
        let (from, along) = (found.places[last], found.tangent(&found.places[last]));
        let onward = found.tangent(&found.places[0]);
        let way = bend(from, along, *begin, onward, 0.5 * found.radius);
        let inside = |p: &Point2| (p - found.centre).norm() <= found.radius * (1.0 + 1e-9);
        let free = |w: &[Point2]| {
            (w[1] - w[0])
                .try_normalize(0.0)
                .is_none_or(|heading| self.cleared.arc(&w[0], &heading, usize::MAX) == 0.0)
        };
        if way.iter().all(inside) && way.windows(2).all(free) {
            return way;
        }
        found.places[last + 1..].to_vec()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Piece;

    /// A post of stock that two neighbouring places of a loop do not see, on the circumference of the cutter halfway between them,
    /// 45 degrees ahead to the right: no loop goes there. One does where the post is beyond its reach.
    #[test]
    fn loops_see_what_stands_between_their_places() {
        let (radius, rho) = (3.0, 1.5f64);
        let corners = [(-20., -20.), (20., -20.), (20., 20.), (-20., 20.)];
        let piece = Piece { outer: corners.map(|(x, y)| Point2::new(x, y)).to_vec(), islands: Vec::new() };
        let room = Room::new(&piece);
        let sides = (TAU * rho / (SIDE * radius)).ceil();
        let loop_past = |away: f64| {
            let (sin, cos) = (-0.5 * PI + 19.0 * PI / sides).sin_cos();
            let (out, along) = (Vector2::new(cos, sin), Vector2::new(-sin, cos));
            let between = Point2::new(0.0, rho) + out * (rho * (PI / sides).cos());
            let post = between + (out + along) * (0.5f64.sqrt() * (radius + away));
            let mut cleared = Cleared::new([Point2::new(-20., -20.), Point2::new(20., 20.)], radius);
            let around = (0..2000).map(|k| TAU * f64::from(k) / 2000.0);
            around.for_each(|a| cleared.add(post + Vector2::new(a.cos(), a.sin()) * (radius + 0.07)));
            let grid = (0..1600).map(|k| Point2::new(f64::from(k % 40) - 20.0, f64::from(k / 40) - 20.0));
            grid.filter(|p| (p - post).norm() > radius + 0.07).for_each(|p| cleared.add(p));
            let way = Way::new(&[Point2::new(-10., 0.), Point2::new(10., 0.)]);
            let bounds = Turning { limit: 0.0, radius };
            let rules = Rules { bounds, sides: Sides::Left, helix: [radius; 2], down: 0.0 };
            let walker = Walker::new(way, &room, &mut cleared, &rules);
            let found = walker.loop_at(10.0, rho, 1.0);
            // What its places alone tell.
            let places: Vec<Point2> = (0..=sides as usize)
                .map(|k| -0.5 * PI + TAU * k as f64 / sides)
                .map(|a| Point2::new(rho * a.cos(), rho + rho * a.sin()))
                .collect();
            let clear = places
                .windows(2)
                .all(|w| walker.cleared.arc(&w[1], &(w[1] - w[0]).normalize(), usize::MAX) == 0.0);
            (found.is_some(), clear)
        };
        assert_eq!(loop_past(0.0), (false, true));
        assert_eq!(loop_past(0.5), (true, true));
    }
}
