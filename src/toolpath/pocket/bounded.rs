//! Runs whose engagement is bounded: loops where more of the cutter would stand in stock than is allowed.
//!
//! Enters: a run, the curves that its centre stays within, the ground cleared before it. Leaves: the same
//! way with loops put in (trochoidal milling). A loop touches the way from its left, the side that climb
//! milling clears first: a circle, in corners and necks the largest that fits, followed as far as it cuts
//! and left by a bend back over cleared ground. The way between two loops is the longest whose loop keeps to
//! the limit. Every place is asked for the angle of the circumference in stock before the cutter goes there
//! ([`Cleared`]); mm, rad.

use std::f64::consts::{PI, TAU};

use super::cleared::Cleared;
use super::route::{Entry, Room, Run, bend, circle};
use super::turning::Turning;
use crate::geometry::{Piece, Point2, SegmentGrid, Vector2};
use crate::monitor::{Cancelled, Monitor, check};

/// Places of the way are this share of the radius apart: the chip between two is seen, and the cusp between
/// their discs is a tenth of a film.
const STEP: f64 = 0.08;

/// Before the limit the way is gone by steps down to this share of the radius.
const FINEST: f64 = 0.005;

/// Greatest loop over the cutter's radius. Above 1 a core would stand in it.
const GREATEST: f64 = 0.75;

/// Least loop over the cutter's radius. What stays in a square corner after it is a film.
const LEAST: f64 = 0.006;

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
const SIDE: f64 = 0.12;
const LEAST_SIDES: f64 = 24.0;

/// Bisections for the length between two loops.
const HALVINGS: u32 = 5;

/// A circle may be this share of the radius less than one that fits.
const FIT: f64 = 0.002;

/// What bounding did.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Bounding {
    /// Number of loops.
    pub loops: usize,
    /// Length of the way that is above the limit since no loop could be put in, mm.
    pub above: f64,
}

/// Clears what a helix does at depth. What a ramp leaves below its slope is stock.
fn enter(run: &Run, cleared: &mut Cleared, radius: f64) {
    if let Entry::Helix { centre, radius: turn } = &run.entry {
        circle(centre, *turn, STEP * radius).into_iter().for_each(|p| cleared.add(p));
    }
}

/// Puts loops into `run` so that no more of the circumference stands in stock than `bounds` allow, and adds
/// its ground to `cleared`.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub(super) fn bound(
    run: &mut Run,
    cleared: &mut Cleared,
    bounds: Turning,
    monitor: &dyn Monitor,
) -> Result<Bounding, Cancelled> {
    enter(run, cleared, bounds.radius);
    if run.points.len() < 2 {
        return Ok(Bounding::default());
    }
    let way = Way::new(&run.points);
    let begins = lengths(&run.points);
    let walls = |room: &Room| SegmentGrid::of_curves(room.within.curves());
    let rooms = run.rooms.iter().map(|room| (begins[room.first], &room.within, walls(room))).collect();
    let mut walker = Walker {
        way,
        rooms,
        cleared,
        bounds,
        radius: bounds.radius,
        out: Vec::new(),
        marks: Vec::new(),
        did: Bounding::default(),
    };
    walker.go(monitor)?;
    run.points = walker.out;
    Ok(walker.did)
}

/// Length of a polyline up to each of its points.
fn lengths(points: &[Point2]) -> Vec<f64> {
    let mut lengths = vec![0.0];
    for w in points.windows(2) {
        lengths.push(lengths[lengths.len() - 1] + (w[1] - w[0]).norm());
    }
    lengths
}

/// A polyline by its length.
struct Way {
    points: Vec<Point2>,
    lengths: Vec<f64>,
}

impl Way {
    fn new(points: &[Point2]) -> Self {
        let mut points = points.to_vec();
        points.dedup();
        let lengths = lengths(&points);
        Self { points, lengths }
    }

    fn total(&self) -> f64 {
        self.lengths[self.lengths.len() - 1]
    }

    /// The side that ends at or after `s`.
    fn side(&self, s: f64) -> usize {
        self.lengths.partition_point(|l| *l < s).clamp(1, (self.points.len() - 1).max(1)) - 1
    }

    fn at(&self, s: f64) -> Point2 {
        let k = self.side(s);
        let Some(&b) = self.points.get(k + 1) else { return self.points[k] };
        let (a, long) = (self.points[k], self.lengths[k + 1] - self.lengths[k]);
        a + (b - a) * ((s - self.lengths[k]) / long).clamp(0.0, 1.0)
    }

    /// The direction in which the way comes to `s`.
    fn heading(&self, s: f64) -> Option<Vector2> {
        let side = self.side(s);
        (self.points.get(side + 1)? - self.points[side]).try_normalize(0.0)
    }

    /// The points of the polyline between two places.
    fn corners_between(&self, from: f64, to: f64) -> &[Point2] {
        let first = self.lengths.partition_point(|l| *l <= from);
        &self.points[first..self.lengths.partition_point(|l| *l < to).max(first)]
    }

    /// The next corner after `s` at which the way turns sharply, or its end.
    fn corner_after(&self, s: f64) -> f64 {
        /// Cosine of what is sharp.
        const SHARP: f64 = 0.98;
        let first = self.lengths.partition_point(|l| *l <= s);
        for k in first..self.points.len() - 1 {
            let (a, b) = (self.points[k] - self.points[k - 1], self.points[k + 1] - self.points[k]);
            if a.dot(&b) < SHARP * a.norm() * b.norm() {
                return self.lengths[k];
            }
        }
        self.total()
    }
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
    centre: Point2,
    places: Vec<Point2>,
    /// It cuts nothing.
    empty: bool,
}

impl Loop {
    /// Its direction at one of its places.
    fn tangent(&self, at: &Point2) -> Vector2 {
        let out = (at - self.centre) / self.radius;
        Vector2::new(-out.y, out.x)
    }
}

struct Walker<'a> {
    way: Way,
    /// From which length on, what the centre stays within, and its sides.
    rooms: Vec<(f64, &'a Piece, SegmentGrid)>,
    cleared: &'a mut Cleared,
    bounds: Turning,
    radius: f64,
    out: Vec<Point2>,
    marks: Vec<Mark>,
    did: Bounding,
}

impl Walker<'_> {
    fn go(&mut self, monitor: &dyn Monitor) -> Result<(), Cancelled> {
        let total = self.way.total();
        let (free, back) = (FREE * self.radius, BACK * self.radius);
        self.place(0.0, self.way.at(0.0));
        let mut s = 0.0;
        // The radius of the last loop at this very place.
        let mut here = 0.0;
        while s < total {
            check(monitor)?;
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
                    let on = (s + STEP * self.radius).min(total);
                    if reach < on {
                        self.did.above += on - reach;
                    }
                    s = self.walk(s, on.max(reach), true);
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
            if forced || self.arc_at(next) <= self.bounds.limit {
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

    /// Angle in stock where the way comes to `s`.
    fn arc_at(&self, s: f64) -> f64 {
        let Some(heading) = self.way.heading(s) else { return 0.0 };
        let behind = self.marks.partition_point(|m| m.s < s - FRESH * self.radius);
        let fresh = self.marks.get(behind).map_or(0, |m| m.places - 1);
        self.cleared.arc(&self.way.at(s), &heading, fresh)
    }

    /// The next loop: how far on along the way, at most `reach`, and the loop. `here` is the radius of the
    /// last one at `s` itself.
    fn next_loop(&self, s: f64, reach: f64, here: f64) -> Option<(f64, Loop)> {
        /// Loops around the last one are at least so much greater.
        const GROWTH: f64 = 1.03;
        let mut around: Option<Loop> = None;
        let mut rho = GREATEST * self.radius;
        while rho >= LEAST * self.radius {
            let could = self.bounds.ring_step(rho);
            let worth = (WORTH * could).min(reach - s);
            let first = self.loop_at(s + worth, rho);
            match first {
                Some(found) if worth > 0.0 => {
                    return Some(self.farthest(s, worth, reach - s, could, rho, found));
                }
                _ if around.is_none() => {
                    let grown = |l: &Loop| l.radius > GROWTH * here && !l.empty;
                    around = self.loop_at(s, rho).filter(grown);
                }
                _ => {}
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
            match self.loop_at(s + next, rho) {
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

    /// The greatest circle up to the radius `rho` that touches the way at `s` from its left and fits in.
    fn fitting(&self, s: f64, rho: f64) -> Option<(Point2, f64, Vector2)> {
        let at = self.way.at(s);
        let heading = self.way.heading(s)?;
        let left = Vector2::new(-heading.y, heading.x);
        let (_, within, walls) = self.rooms.iter().rev().find(|room| room.0 < s || room.0 == 0.0)?;
        /// Each shrinks the circle to the wall that it crosses; a few suffice.
        const SHRINKS: usize = 40;
        let mut rho = rho;
        for _ in 0..SHRINKS {
            let centre = at + left * rho;
            let nearest = walls.nearest(&centre)?;
            if nearest.distance >= rho - FIT * self.radius {
                let inside = within.contains(&centre);
                return inside.then_some((centre, rho.min(nearest.distance), left));
            }
            let ends = walls.segments()[nearest.segment as usize].ends;
            let to = ends[0] + (ends[1] - ends[0]) * nearest.share - at;
            let across = to.dot(&left);
            if across <= 0.0 {
                return None;
            }
            rho = rho.min(0.5 * to.norm_squared() / across) * (1.0 - 1e-9);
            if rho < LEAST * self.radius {
                return None;
            }
        }
        None
    }

    /// The loop of the radius `rho` (less where there is no room) at `s`, if it keeps to the limit.
    fn loop_at(&self, s: f64, rho: f64) -> Option<Loop> {
        let (centre, rho, left) = self.fitting(s, rho)?;
        let sides = (TAU * rho / (SIDE * self.radius)).ceil().max(LEAST_SIDES) as usize;
        let begin = left.y.atan2(left.x) + PI;
        let mut found = Loop { radius: rho, centre, places: Vec::new(), empty: true };
        for k in 0..=sides {
            let (sin, cos) = (begin + TAU * k as f64 / sides as f64).sin_cos();
            let at = centre + Vector2::new(cos, sin) * rho;
            let arc = self.cleared.arc(&at, &Vector2::new(-sin, cos), usize::MAX);
            if arc > self.bounds.limit {
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
