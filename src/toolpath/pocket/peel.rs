//! Passes of constant engagement: the stock peeled off along its border.
//!
//! Enters: the piece of the cutter's centre, the ground cleared so far, a way that has been cut. Leaves: that
//! way, gone on. At each step the cutter turns as far into the stock, which is on its right, as the limit of
//! the engagement lets it, and along walls that it meets. So passes wind around what is cleared, have no
//! cusps, and cut as much as they may. A pass ends where nothing is left to cut, or where no turn keeps to
//! the limit. The next one begins beside the nearest stock, on a way that was gone before, and is reached
//! over cleared ground; mm, rad.
//!
//! Every place of a pass is asked for the angle in stock ([`Cleared`]) before the cutter goes there, and
//! whatever is left (the tips of corners, narrow necks) is what runs along the walls find.

use std::cell::Cell;

use super::beginnings::{Beginning, Beginnings};
use super::bounded::STEP;
use super::chambers::Chambers;
use super::cleared::Cleared;
use super::link::{Links, Visited};
use super::walls::Room;
use geometry::{Point2, Vector2};
use work::monitor::{Cancelled, Monitor, check};

/// Sharpest turn into the stock: its radius over the cutter's.
const INTO: f64 = 0.4;

/// Greatest turn away from the stock in one step, rad.
const AWAY: f64 = 0.25;

/// Shortest step over the radius. With [`AWAY`] it bounds how tight passes get in corners.
const SHORTEST: f64 = 0.02;

/// A turn that comes so near to the limit, rad, is as good as the one that reaches it.
const NEAR: f64 = 0.006;

/// Steps that had to be made shorter keep so far below the limit, rad: there the stock begins or ends, and
/// the angle changes fast.
const CORNERS: f64 = 0.01;

/// Turns that are tried for one step at most.
const TRIALS: usize = 8;

/// Stock is looked for so far to the right of a place, over the radius.
const PROBE: f64 = 0.1;

/// Angle in stock that tells that there is some, rad.
const STOCK: f64 = 0.02;

/// Places this far behind, over the radius, are beside the move's own chip.
const FRESH: f64 = 0.5;

/// A pass ends when it cut nothing over so long a way, over the radius: the first less the second for each
/// radius of a pass's width. Wide passes that go on for longer gain less than links take, narrow ones leave
/// bits to the loops when they end too soon.
const FREE: [f64; 2] = [0.3, 0.3];
const LEAST_FREE: f64 = 0.1;

/// Passes that cut along a way shorter than this over the radius are none.
const LEAST_CUT: f64 = 0.1;

/// A pass that no step leads on from, so long after its beginning over the radius, is tried again with more
/// care.
const SOON: f64 = 1.5;

/// Places where passes may begin are this far apart over the radius.
const APART: f64 = 0.35;

/// A step that is admissible.
#[derive(Clone, Copy)]
struct Step {
    to: Point2,
    heading: Vector2,
    turn: f64,
    arc: f64,
}

/// How a pass came out that was tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Came {
    Through,
    /// It cut next to nothing, or ended soon without care, and nothing changed.
    Stopped,
    /// It met no stock, and nothing changed.
    ToNothing,
}

/// Peels stock off as long as there is some to be reached.
pub(super) struct Peeler<'a> {
    room: &'a Room<'a>,
    /// Passes end where they come to a closed one.
    chambers: Option<&'a Chambers>,
    cleared: &'a mut Cleared,
    limit: f64,
    radius: f64,
    /// A pass ends when it cut nothing over so long a way, mm.
    longest_free: f64,
    /// Whether turns into the stock leave room to turn along it again.
    careful: bool,
    out: Vec<Point2>,
    places: Beginnings,
    visited: Visited,
    thin_at: usize,
    /// A place, and how far around it there is no wall, mm.
    open: Cell<(Point2, f64)>,
}

impl<'a> Peeler<'a> {
    /// Goes on from `way`, whose ground is cleared, within `room`.
    pub fn new(
        room: &'a Room<'a>,
        chambers: Option<&'a Chambers>,
        cleared: &'a mut Cleared,
        [limit, radius]: [f64; 2],
        way: &[Point2],
    ) -> Self {
        let mut peeler = Self {
            room,
            chambers,
            cleared,
            limit,
            radius,
            longest_free: (FREE[0] - FREE[1] * (1.0 - limit.cos())).max(LEAST_FREE) * radius,
            careful: false,
            out: Vec::new(),
            places: Beginnings::new(radius),
            visited: Visited::new(radius),
            thin_at: 0,
            open: Cell::new((Point2::origin(), 0.0)),
        };
        let headings = way.windows(2).map(|w| (w[1] - w[0]).normalize());
        peeler.out.extend_from_slice(way);
        peeler.note_places(0, headings.collect());
        peeler
    }

    /// Peels all stock off that passes reach.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub fn peel(&mut self, monitor: &dyn Monitor) -> Result<(), Cancelled> {
        while let Some(k) = self.next_place() {
            check(monitor)?;
            self.careful = false;
            let mut came = self.pass(k, monitor)?;
            // Care changes steps that cut, and those alone.
            if came == Came::Stopped {
                self.careful = true;
                came = self.pass(k, monitor)?;
            }
            if came != Came::Through {
                self.places.fail(k);
            }
        }
        Ok(())
    }

    /// Takes back places from which no pass came through where ground was cleared since; whether there are
    /// any.
    pub fn take_back(&mut self) -> bool {
        self.places.take_back()
    }

    /// The ground.
    pub fn ground(&self) -> &Cleared {
        self.cleared
    }

    /// The way.
    pub fn way(&self) -> &[Point2] {
        &self.out
    }

    /// The way.
    pub fn into_way(self) -> Vec<Point2> {
        self.out
    }

    /// Notes places of the way from `first` on.
    fn note_places(&mut self, first: usize, headings: Vec<Vector2>) {
        let mut gone = f64::INFINITY;
        for (k, heading) in headings.into_iter().enumerate() {
            let index = first + k;
            if gone >= APART * self.radius {
                self.places.push(index, self.out[index], heading);
                gone = 0.0;
            }
            if let Some(next) = self.out.get(index + 1) {
                gone += (next - self.out[index]).norm();
            }
        }
        self.out[first..].iter().for_each(|p| self.visited.add(*p));
        self.places.pass_done(&self.out[first..]);
    }

    fn nearest_inside(&self, p: &Point2) -> Point2 {
        let (at, open) = self.open.get();
        if (p - at).norm() < open {
            return *p;
        }
        let kept = self.room.nearest_inside(p);
        self.open.set((kept, if kept == *p { self.room.distance(p) } else { 0.0 }));
        kept
    }

    /// Whether stock stands to the right of a place.
    fn has_stock(&mut self, k: usize) -> bool {
        let mut places = std::mem::replace(&mut self.places, Beginnings::new(self.radius));
        let has = places.has_stock(k, |place| self.stock_beside(&place.at, &place.heading));
        self.places = places;
        has
    }

    /// Whether stock stands to the right of a place, or where there is a wall, ahead along it.
    fn stock_beside(&self, at: &Point2, heading: &Vector2) -> bool {
        let right = Vector2::new(heading.y, -heading.x);
        let probes = [right, *heading].map(|by| at + by * (PROBE * self.radius));
        let mut inside = probes.iter().map(|probe| self.nearest_inside(probe));
        let Some(beside) = inside.find(|p| (p - at).norm() >= 0.2 * PROBE * self.radius) else {
            return false;
        };
        let arc = |heading: Vector2| self.cleared.arc(&beside, &heading, usize::MAX);
        arc(right) > STOCK || arc(-right) > STOCK
    }

    /// Where the next pass begins: the first place with stock of the stretch that is nearest. Places without
    /// stock are forgotten.
    fn next_place(&mut self) -> Option<usize> {
        let end = *self.out.last()?;
        loop {
            let mut k = self.places.nearest(&end)?;
            if self.has_stock(k) {
                while let Some(before) = self.places.before(k)
                    && self.has_stock(before)
                {
                    k = before;
                }
                return Some(k);
            }
            for near in self.places.near(&self.places.get(k).at) {
                if !self.has_stock(near) {
                    self.places.forget(near);
                }
            }
        }
    }

    /// Where a pass from a place begins: at the first of the places of its way right before it that have
    /// stock beside them.
    fn beginning(&self, place: usize) -> (usize, Vector2) {
        let Beginning { index, heading, .. } = *self.places.get(place);
        let mut begin = (index, heading);
        for k in (self.places.index_before(place)..index).rev() {
            let Some(heading) = (self.out[k + 1] - self.out[k]).try_normalize(0.0) else { break };
            if !self.stock_beside(&self.out[k], &heading) {
                break;
            }
            begin = (k, heading);
        }
        begin
    }

    /// The way over cleared ground to a place of the way, which is to be left in the direction `heading`.
    /// What was cleared `since` so many places is not there yet.
    fn link_to(&mut self, index: usize, heading: Vector2, since: usize) -> Vec<Point2> {
        let later = self.cleared.split_off(since);
        let (room, cleared, visited) = (self.room, &*self.cleared, &self.visited);
        let links = Links { room, cleared, visited, radius: self.radius };
        let link = links.between(&self.out, index, heading);
        later.into_iter().for_each(|p| self.cleared.add(p));
        link
    }

    /// How many places of earlier passes are beside the chip of one that began here and has `gone` so far,
    /// mm, after a straight link.
    fn recent(&self, begin: &Point2, gone: f64) -> usize {
        let mut left = FRESH * self.radius - gone - self.out.last().map_or(0.0, |end| (begin - end).norm());
        let back = self.out.windows(2).rev().map(|w| (w[1] - w[0]).norm());
        back.take_while(|length| {
            left -= length;
            left > 0.0
        })
        .count()
    }

    /// One pass from a place.
    fn pass(&mut self, place: usize, monitor: &dyn Monitor) -> Result<Came, Cancelled> {
        let (index, heading) = self.beginning(place);
        let begin = self.out[index];
        let (full, shortest) = (STEP * self.radius, SHORTEST * self.radius);
        let before = self.cleared.len();
        // Most passes that are tried end soon: the way to one is looked for when it is sure.
        let mut link = None;
        let mut way = vec![Step { to: begin, heading, turn: 0.0, arc: 0.0 }];
        // The length of the way at each of its places.
        let mut lengths = vec![0.0];
        let (mut step, mut gone, mut cut, mut free, mut last_cut) = (full, 0.0, 0.0, 0.0, 0);
        let mut stuck = false;
        loop {
            check(monitor)?;
            // Places of the way from here on are the last ones that were cleared.
            let settled = lengths.partition_point(|l| *l < gone - FRESH * self.radius);
            let mut fresh = self.cleared.len() - (way.len() - settled.max(1));
            if settled == 0 {
                fresh -= self.recent(&begin, gone).min(fresh);
            }
            if gone >= SOON * self.radius && settled <= last_cut && self.cleared.len() >= self.thin_at {
                if link.is_none() {
                    link = Some(self.link_to(index, heading, before));
                }
                self.thin(fresh);
            }
            let Some(next) = self.next(&way[way.len() - 1], step, fresh) else {
                if step <= shortest {
                    stuck = true;
                    break;
                }
                step *= 0.5;
                continue;
            };
            if self.chambers.is_some_and(|chambers| chambers.is_closed(&next.to)) {
                break;
            }
            let length = (next.to - way[way.len() - 1].to).norm();
            gone += length;
            way.push(next);
            self.cleared.add(next.to);
            lengths.push(gone);
            if next.arc > 0.0 {
                (cut, free, last_cut) = (cut + length, 0.0, way.len());
            } else {
                free += length;
            }
            if free > self.longest_free {
                break;
            }
            step = full.min(2.0 * step);
        }
        let soon = stuck && gone < SOON * self.radius;
        if cut < LEAST_CUT * self.radius || (soon && !self.careful) {
            self.cleared.truncate(before);
            return Ok(if cut == 0.0 && !stuck { Came::ToNothing } else { Came::Stopped });
        }
        // What was gone without cutting is not gone in the end; it may have taken films away.
        self.cleared.truncate(self.cleared.len() - (way.len() - last_cut));
        way.truncate(last_cut);
        let link = link.unwrap_or_else(|| self.link_to(index, heading, before));
        self.out.extend_from_slice(&link);
        let first = self.out.len();
        self.out.extend(way.iter().map(|step| step.to));
        self.note_places(first, way.iter().map(|step| step.heading).collect());
        self.thin(self.cleared.len());
        Ok(Came::Through)
    }

    /// Leaves out what the first `count` places of the ground cover of each other, from time to time.
    fn thin(&mut self, count: usize) {
        /// Fewer are no matter.
        const FEW: usize = 60;
        if self.cleared.len() >= self.thin_at {
            self.cleared.thin(count);
            self.thin_at = self.cleared.len() + FEW;
        }
    }

    /// The step that turns farthest into the stock.
    fn next(&self, from: &Step, step: f64, fresh: usize) -> Option<Step> {
        let full = step >= STEP * self.radius;
        let limit = self.limit - if full { 0.0 } else { CORNERS };
        let tried = |turn: f64| {
            let (sin, cos) = turn.sin_cos();
            let h = from.heading;
            let ahead = Vector2::new(h.x * cos - h.y * sin, h.x * sin + h.y * cos);
            let to = self.nearest_inside(&(from.to + ahead * step));
            let along = to - from.to;
            let length = along.norm();
            // A wall ahead.
            if length < 0.3 * step {
                return Step { to, heading: ahead, turn, arc: f64::INFINITY };
            }
            let heading = along / length;
            // Head-on into stock there is no way on but through more of it.
            let arc = if self.careful && turn < 0.0 {
                self.cleared.arc_from_right(&to, &heading, fresh)
            } else {
                self.cleared.arc(&to, &heading, fresh)
            };
            Step { to, heading, turn, arc }
        };
        let most = -step / (INTO * self.radius);
        let keeps =
            |found: &Step| found.arc <= limit && self.cleared.keeps(&from.to, &found.to, limit, fresh);
        // Over cleared ground the tool turns as far as it may.
        let mut far = None;
        if from.arc == 0.0 {
            let found = tried(most);
            if keeps(&found) {
                return Some(found);
            }
            far = Some(found);
        }
        let goal = limit - 0.5 * NEAR;
        // The angle grows by the turn, and as the tool comes nearer to the border of the stock, which is as
        // far off as the way.
        let by_growth = |found: &Step| {
            let growth = 1.0 + (step / self.radius + found.turn).max(0.0) / limit.sin();
            found.turn + (found.arc - goal) / growth
        };
        // Mostly the turn of the step before is as good as any, but in corners.
        let mut turn = match &far {
            Some(far) if far.arc.is_finite() => by_growth(far),
            _ => from.turn,
        }
        .clamp(0.8 * most, 0.8 * AWAY);
        let mut best: Option<Step> = None;
        for trial in 0..TRIALS {
            let found = tried(turn);
            if found.arc <= limit {
                best = Some(found);
                if found.arc > limit - NEAR || turn <= most {
                    break;
                }
            } else {
                far = Some(found);
            }
            turn = match (&best, &far) {
                (Some(near), Some(far)) if near.turn - far.turn < 0.003 => break,
                (Some(near), Some(far)) => {
                    let share = if far.arc.is_finite() && near.arc > 0.0 {
                        ((goal - near.arc) / (far.arc - near.arc)).clamp(0.1, 0.9)
                    } else {
                        0.5
                    };
                    near.turn + (far.turn - near.turn) * share
                }
                (Some(near), None) if trial == 0 && near.arc > 0.0 => by_growth(near).max(most),
                // Where that turn is too much, so is a greater one.
                (Some(_), None) => most,
                (None, _) if turn >= AWAY => return None,
                (None, Some(far)) if trial == 0 && far.arc.is_finite() => by_growth(far).min(AWAY),
                (None, _) => {
                    let next = (turn + 0.06).max(0.5 * (turn + AWAY)).min(AWAY);
                    if AWAY - next < 0.02 { AWAY } else { next }
                }
            };
        }
        best.filter(keeps)
    }
}
