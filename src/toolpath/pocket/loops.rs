//! Loops that bound the engagement: circles that touch a way from one side.
//!
//! Enters: the way, the room of the cutter's centre, the ground cleared so far, the limit. Leaves: the loop
//! from which the way goes on farthest, and the way back from where a loop ends; or the helix by which a way
//! begins in stock; mm, rad.

use std::cell::Cell;
use std::f64::consts::{PI, TAU};

use super::bounded::{Rules, STEP};
use super::cleared::Cleared;
use super::route::{Entry, Run, bend, circle};
use super::turning::Turning;
use super::walls::Room;
use super::way::{Way, fitting};
use geometry::{Point2, Vector2};

/// Greatest loop over the cutter's radius. Above 1 a core would stand in it.
const GREATEST: f64 = 0.75;

/// Least loop over the cutter's radius. What stays in a square corner after it is a film.
pub(super) const LEAST: f64 = 0.006;

/// Loops are tried by this ratio: the growth of loops around each other is about half as much more.
const SHRINK: f64 = 0.87;

/// A loop is worth it when it comes this share of what it could in a slot.
const WORTH: f64 = 0.4;

/// Sides of loops over the radius, and their number at least.
const SIDE: f64 = 0.08;
const LEAST_SIDES: f64 = 36.0;

/// Bisections for the length between two loops.
const HALVINGS: u32 = 5;

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

/// A loop that keeps to the limit.
pub(super) struct Loop {
    pub radius: f64,
    /// 1 on the left of the way, counter-clockwise, -1 on its right, clockwise.
    side: f64,
    centre: Point2,
    pub places: Vec<Point2>,
    /// It cuts nothing.
    empty: bool,
}

impl Loop {
    /// Its direction at one of its places.
    pub fn tangent(&self, at: &Point2) -> Vector2 {
        let out = (at - self.centre) / self.radius;
        Vector2::new(-out.y, out.x) * self.side
    }
}

/// Where a ramp would begin in stock, which leaves a slot to begin with, a helix that touches the way takes
/// its place, if there is room for one: at the way's beginning, else from the first place that has room on,
/// and back from there.
pub(super) fn open(run: &mut Run, room: &Room, cleared: &Cleared, rules: &Rules) {
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
pub(super) fn enter(run: &Run, cleared: &mut Cleared, radius: f64) {
    if let Entry::Helix { centre, radius: turn, begin } = &run.entry {
        circle(centre, *turn, *begin, STEP * radius).into_iter().for_each(|p| cleared.add(p));
    }
}

/// What loops are looked for by.
pub(super) struct Loops<'a> {
    pub way: &'a Way,
    pub room: &'a Room<'a>,
    pub cleared: &'a Cleared,
    pub bounds: Turning,
    pub sides: Sides,
    /// Where the last loop that could not be put in was above the limit, in sides from its beginning: others
    /// are asked there first.
    pub above_at: &'a Cell<usize>,
}

impl Loops<'_> {
    /// The next loop: how far on along the way, at most `reach`, and the loop. `here` is the radius of the
    /// last one at `s` itself.
    pub fn next(&self, s: f64, reach: f64, here: f64) -> Option<(f64, Loop)> {
        let heading = self.way.heading(s)?;
        self.sides.of(&heading).iter().find_map(|sides| self.loop_on(sides, s, reach, here))
    }

    /// The next loop on one of `sides`.
    fn loop_on(&self, sides: &[f64], s: f64, reach: f64, here: f64) -> Option<(f64, Loop)> {
        /// Loops around the last one are at least so much greater.
        const GROWTH: f64 = 1.03;
        let mut around: Option<Loop> = None;
        let mut rho = GREATEST * self.bounds.radius;
        while rho >= LEAST * self.bounds.radius {
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
        let (centre, rho, inwards) = fitting(self.way, self.room, self.bounds.radius, s, rho, side)?;
        let sides = (TAU * rho / (SIDE * self.bounds.radius)).ceil().max(LEAST_SIDES) as usize;
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

    /// From a place of a loop back to where it began: a bend over cleared ground, else on around the loop.
    pub fn back(&self, found: &Loop, last: usize, begin: &Point2) -> Vec<Point2> {
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

    /// A post of stock that two neighbouring places of a loop do not see, on the circumference of the cutter
    /// halfway between them, 45 degrees ahead to the right: no loop goes there. One does where the post is
    /// beyond its reach.
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
            let (bounds, above_at) = (Turning { limit: 0.0, radius }, Cell::new(0));
            let loops = Loops {
                way: &way,
                room: &room,
                cleared: &cleared,
                bounds,
                sides: Sides::Left,
                above_at: &above_at,
            };
            let found = loops.loop_at(10.0, rho, 1.0);
            // What its places alone tell.
            let places: Vec<Point2> = (0..=sides as usize)
                .map(|k| -0.5 * PI + TAU * k as f64 / sides)
                .map(|a| Point2::new(rho * a.cos(), rho + rho * a.sin()))
                .collect();
            let clear =
                places.windows(2).all(|w| cleared.arc(&w[1], &(w[1] - w[0]).normalize(), usize::MAX) == 0.0);
            (found.is_some(), clear)
        };
        assert_eq!(loop_past(0.0), (false, true));
        assert_eq!(loop_past(0.5), (true, true));
    }
}
