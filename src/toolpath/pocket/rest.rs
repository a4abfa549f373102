//! A piece cleared by passes of constant engagement, and what they leave.
//!
//! Enters: the piece of the cutter's centre, the ground. Leaves: runs of such passes, each of which begins with a helix, or in
//! the air where there is some, and runs that keep to the limit by loops: to places where stock may still stand, and along the walls. Whether stock may
//! stand is told by square cells: the middle of one, and all around it, is cleared for sure where one disc holds it whole; mm.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use super::air::{Air, sides};
use super::bounded::{Bounding, Rules, STEP, bound_all};
use super::chambers::Chambers;
use super::cleared::Cleared;
use super::peel::Peeler;
use super::route::{Entry, Run, begun_near, circle};
use super::walls::Room;
use geometry::{Piece, Point2, Region, SegmentGrid, Vector2};
use work::monitor::{Cancelled, Monitor, check};
use work::parallel;

/// Side of a cell over the radius, and most cells along a side.
const CELL: f64 = 0.1;
const MOST_CELLS: f64 = 2048.0;

/// Precision of the place with most room, over the radius.
const DISC_PRECISION: f64 = 0.05;

/// Runs that clear a piece.
#[derive(Default)]
pub(super) struct Clearing {
    /// Passes of constant engagement.
    pub peeled: Vec<Run>,
    /// What has to follow, bounded by loops.
    pub rest: Vec<Run>,
    /// What bounding that did.
    pub bounding: Bounding,
}

impl Clearing {
    /// Length of all ways, those down included, mm.
    fn length(&self, down: f64) -> f64 {
        let along = |run: &Run| down + run.points.windows(2).map(|w| (w[1] - w[0]).norm()).sum::<f64>();
        self.peeled.iter().chain(&self.rest).map(along).sum()
    }
}

/// Clears a piece; `None` where it has neither air nor room for a helix.
///
/// Passes go through necks, or each chamber gets a helix of its own before they do, whichever makes the shorter path.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub(super) fn clear(
    piece: &Piece,
    air: Option<&Air>,
    ground: &mut Cleared,
    rules: &Rules,
    monitor: &dyn Monitor,
) -> Result<Option<Clearing>, Cancelled> {
    let radius = rules.bounds.radius;
    let room = Room::new(piece);
    let ways = air.map_or_else(Vec::new, |air| air.ways_in(|p| piece.contains(p)));
    let chambers = match ways.first() {
        Some(_) => None,
        None => Chambers::of(piece, &room, radius, rules.helix[1], monitor)?,
    };
    let mut plans = vec![(None, ground.clone())];
    plans.extend(chambers.map(|chambers| (Some(chambers), ground.clone())));
    let cleared = parallel::try_map_mut(&mut plans, |_, (chambers, ground)| {
        let Some(cells) = Cells::new(piece, radius) else { return Ok(None) };
        Clearer {
            piece,
            air,
            ways: &ways,
            room: &room,
            rules,
            monitor,
            cells,
            ground,
            chambers: chambers.as_mut(),
        }
        .clear()
    })?;
    let found = cleared.into_iter().zip(plans).filter_map(|(clearing, plan)| Some((clearing?, plan.1)));
    let best = found.min_by(|(a, _), (b, _)| {
        let exceeds = |clearing: &Clearing| !clearing.bounding.above.is_empty();
        exceeds(a).cmp(&exceeds(b)).then(a.length(rules.down).total_cmp(&b.length(rules.down)))
    });
    Ok(best.map(|(clearing, its)| {
        *ground = its;
        clearing
    }))
}

/// Clears a piece in one way.
struct Clearer<'a> {
    piece: &'a Piece,
    air: Option<&'a Air>,
    ways: &'a [Vec<Point2>],
    room: &'a Room<'a>,
    rules: &'a Rules,
    monitor: &'a dyn Monitor,
    cells: Cells,
    ground: &'a mut Cleared,
    /// What passes may not go to before a helix is there.
    chambers: Option<&'a mut Chambers>,
}

impl Clearer<'_> {
    fn clear(mut self) -> Result<Option<Clearing>, Cancelled> {
        let (radius, [wanted, least]) = (self.rules.bounds.radius, self.rules.helix);
        let mut clearing = Clearing::default();
        self.air.iter().flat_map(|air| &air.discs).for_each(|p| self.cells.clear_at(p));
        for way in self.ways {
            let run = self.peeled(way, Entry::Air)?;
            if run.points.len() > 1 {
                clearing.peeled.extend(self.room.kept_runs(run));
            }
        }
        let whole = Region { pieces: vec![self.piece.clone()] };
        let mut next = match self.ways.first() {
            Some(_) => self.deep_in_stock()?,
            None => whole
                .largest_disc(DISC_PRECISION * radius, self.monitor)?
                .filter(|disc| disc.1 >= least)
                .map(|disc| disc.0),
        };
        while let Some(centre) = next {
            let helix = wanted.min(self.room.distance(&centre));
            let mut turn = circle(&centre, helix, 0.0, STEP * radius);
            turn.push(turn[0]);
            turn.iter().for_each(|p| self.ground.add(*p));
            self.chambers.iter_mut().for_each(|chambers| chambers.enter(&centre));
            self.cells.clear_along(&turn);
            let run = self.peeled(&turn, Entry::Helix { centre, radius: helix, begin: 0.0 })?;
            // A step past an inner corner follows the wall around it.
            clearing.peeled.extend(self.room.kept_runs(run));
            next = self.deep_in_stock()?;
        }
        if clearing.peeled.is_empty() || self.chambers.is_some_and(|chambers| !chambers.all_entered()) {
            return Ok(None);
        }
        for wall in self.piece.curves() {
            self.cells.clear_along(wall);
            self.cells.clear_along(&[wall[wall.len() - 1], wall[0]]);
        }
        clearing.rest = self.cells.runs_to_standing(&clearing.peeled, self.ways, self.monitor)?;
        clearing.rest.extend(around_walls(self.piece, &clearing));
        clearing.bounding = bound_all(&mut clearing.rest, self.room, self.ground, self.rules, self.monitor)?;
        Ok(Some(clearing))
    }

    /// The passes that go on from the end of a way over ground that is cleared. Before another helix has to go down, places from which
    /// none came through are tried again, which stays where it comes to the place of that helix.
    fn peeled(&mut self, way: &[Point2], entry: Entry) -> Result<Run, Cancelled> {
        let bounds = self.rules.bounds;
        let chambers = self.chambers.as_deref();
        let mut peeler = Peeler::new(self.room, chambers, self.ground, [bounds.limit, bounds.radius], way);
        peeler.peel(self.monitor)?;
        let deep = |cells: &Cells, ground: &Cleared| {
            cells.deep_in_stock(self.room, ground, self.rules.helix[1], self.monitor)
        };
        let mut next = deep(&self.cells, peeler.ground())?;
        let (mut done, mut ground) = (peeler.way().len(), None);
        while next.is_some() && peeler.take_back() {
            ground = Some(peeler.ground().clone());
            peeler.peel(self.monitor)?;
            let left = deep(&self.cells, peeler.ground())?;
            if left == next {
                break;
            }
            (next, done, ground) = (left, peeler.way().len(), None);
        }
        let mut points = peeler.into_way();
        points.truncate(done);
        if let Some(ground) = ground {
            *self.ground = ground;
        }
        let points = points.split_off(way.len() - 1);
        self.cells.clear_along(&points);
        Ok(Run { entry, points })
    }

    fn deep_in_stock(&self) -> Result<Option<Point2>, Cancelled> {
        self.cells.deep_in_stock(self.room, self.ground, self.rules.helix[1], self.monitor)
    }
}

/// Once around each wall.
fn around_walls(piece: &Piece, clearing: &Clearing) -> Vec<Run> {
    let last = clearing.rest.last().or(clearing.peeled.last());
    let mut end = last.and_then(|run| run.points.last()).copied().unwrap_or(piece.outer[0]);
    let around = |wall: &[Point2]| {
        let mut points = begun_near(wall, &end, 0.0);
        points.push(points[0]);
        end = points[0];
        Run { entry: Entry::Ramp(points.clone()), points }
    };
    piece.curves().map(around).collect()
}

/// Cells of the box of a piece, and which of them are cleared for sure.
struct Cells {
    radius: f64,
    origin: Point2,
    cell: f64,
    side: [usize; 2],
    clear: Vec<bool>,
}

impl Cells {
    /// `None` where the piece is so large that cells would be as large as the cutter.
    fn new(piece: &Piece, radius: f64) -> Option<Self> {
        let [lo, hi] = Region { pieces: vec![piece.clone()] }.bounds()?;
        let size = hi - lo;
        let cell = (CELL * radius).max(size.x.max(size.y) / MOST_CELLS);
        let side = [size.x, size.y].map(|s| (s / cell).ceil() as usize + 1);
        let clear = vec![true; side[0] * side[1]];
        let mut cells = (cell < 0.5 * radius).then_some(Self { radius, origin: lo, cell, side, clear })?;
        (0..side[1]).for_each(|row| cells.fill(piece, row));
        Some(cells)
    }

    /// Marks the cells of a row inside a piece: those between every other two crossings with its curves.
    fn fill(&mut self, piece: &Piece, row: usize) {
        let level = self.origin.y + row as f64 * self.cell;
        let mut crossings = Vec::new();
        for curve in piece.curves() {
            for (k, a) in curve.iter().enumerate() {
                let b = &curve[(k + 1) % curve.len()];
                if (a.y > level) != (b.y > level) {
                    crossings.push(a.x + (b.x - a.x) * ((level - a.y) / (b.y - a.y)) - self.origin.x);
                }
            }
        }
        crossings.sort_by(f64::total_cmp);
        for pair in crossings.chunks_exact(2) {
            let (from, to) = ((pair[0] / self.cell).ceil() as usize, (pair[1] / self.cell).floor() as usize);
            (from..=to.min(self.side[0] - 1)).for_each(|i| self.clear[row * self.side[0] + i] = false);
        }
    }

    fn at(&self, index: usize) -> Point2 {
        let (i, j) = (index % self.side[0], index / self.side[0]);
        self.origin + Vector2::new(i as f64, j as f64) * self.cell
    }

    /// Clears the cells that the cutter at `p` holds whole.
    fn clear_at(&mut self, p: &Point2) {
        let within = self.radius - self.cell * FRAC_1_SQRT_2;
        // The cells of an axis so far to both sides of the place.
        let range = |axis: usize, reach: f64| {
            let x = p[axis] - self.origin[axis];
            let from = ((x - reach) / self.cell).ceil().max(0.0) as usize;
            from..(((x + reach) / self.cell).floor() + 1.0).clamp(0.0, self.side[axis] as f64) as usize
        };
        for j in range(1, within) {
            let up = self.origin.y + j as f64 * self.cell - p.y;
            let row = range(0, (within * within - up * up).max(0.0).sqrt());
            if !row.is_empty() {
                self.clear[j * self.side[0] + row.start..j * self.side[0] + row.end].fill(true);
            }
        }
    }

    fn clear_along(&mut self, way: &[Point2]) {
        for ends in way.windows(2) {
            let along = ends[1] - ends[0];
            let steps = (along.norm() / (STEP * self.radius)).ceil().max(1.0);
            (0..=steps as usize).for_each(|k| self.clear_at(&(ends[0] + along * (k as f64 / steps))));
        }
    }

    /// Of the places where the cutter would stand in stock all around, the one with most room, `least` or more.
    fn deep_in_stock(
        &self,
        room: &Room,
        ground: &Cleared,
        least: f64,
        monitor: &dyn Monitor,
    ) -> Result<Option<Point2>, Cancelled> {
        let x = Vector2::new(1.0, 0.0);
        let mut best: Option<(f64, Point2)> = None;
        for index in (0..self.clear.len()).filter(|index| !self.clear[*index]) {
            check(monitor)?;
            let p = self.at(index);
            let distance = room.distance(&p);
            if distance >= least
                && best.is_none_or(|best| distance > best.0)
                && [x, -x].iter().all(|x| ground.arc(&p, x, usize::MAX) > PI - 1e-6)
            {
                best = Some((distance, p));
            }
        }
        Ok(best.map(|best| best.1))
    }

    /// Runs from the ways that were gone straight to cells that may hold stock.
    fn runs_to_standing(
        &mut self,
        gone: &[Run],
        ways: &[Vec<Point2>],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Run>, Cancelled> {
        let of_runs = gone.iter().map(|run| run.points.as_slice());
        let gone = SegmentGrid::new(sides(of_runs.chain(ways.iter().map(Vec::as_slice))));
        let mut runs = Vec::new();
        for index in 0..self.clear.len() {
            if self.clear[index] {
                continue;
            }
            check(monitor)?;
            let p = self.at(index);
            self.clear_at(&p);
            let Some(near) = gone.nearest(&p).filter(|near| near.distance > 0.0) else { continue };
            let mut points = self.way_to(&gone, near.segment as usize, near.share);
            // The way down goes back and forth where all is cleared.
            let way = points.iter().chain(points.iter().rev().skip(1)).copied().collect();
            points.push(p);
            runs.push(Run { entry: Entry::Ramp(way), points });
        }
        Ok(runs)
    }

    /// The last of a way that was gone, about a radius of it, up to a place of one of its sides.
    fn way_to(&self, gone: &SegmentGrid, mut side: usize, share: f64) -> Vec<Point2> {
        let ends = |side: usize| gone.segments()[side].ends;
        let [a, b] = ends(side);
        let mut points = vec![a + (b - a) * share];
        let mut length = 0.0;
        loop {
            let begin = ends(side)[0];
            length += (begin - points[points.len() - 1]).norm();
            points.push(begin);
            if length > self.radius || side == 0 || ends(side - 1)[1] != begin {
                break;
            }
            side -= 1;
        }
        points.reverse();
        points
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cells inside a piece are told by its curves, and cleared by a disc where it holds them whole.
    #[test]
    fn cells_are_those_of_the_piece_that_no_disc_holds() {
        let square =
            |a: f64, b: f64| [(a, a), (b, a), (b, b), (a, b)].map(|(x, y)| Point2::new(x, y)).to_vec();
        let piece = Piece { outer: square(0.0, 10.0), islands: vec![square(4.0, 6.0)] };
        let mut cells = Cells::new(&piece, 2.0).unwrap();
        let left = |cells: &Cells| (0..cells.clear.len()).filter(|k| !cells.clear[*k]).collect::<Vec<_>>();
        let inside = left(&cells);
        let walls = SegmentGrid::of_curves(piece.curves());
        let within = |p: &Point2| piece.contains(p) || walls.distance(p) < 1e-9;
        assert!(inside.iter().all(|k| within(&cells.at(*k))));
        let area = inside.len() as f64 * cells.cell * cells.cell;
        assert!((area - 96.0).abs() < 44.0 * cells.cell, "{area}");
        let disc = Point2::new(2.5, 2.5);
        cells.clear_at(&disc);
        let reach = cells.cell * FRAC_1_SQRT_2;
        for k in inside {
            let held = (cells.at(k) - disc).norm() + reach <= 2.0;
            assert_eq!(cells.clear[k], held, "{}", cells.at(k));
        }
    }
    /// What the turn of a helix clears needs no run of its own: one to its middle would come straight down.
    #[test]
    fn the_middle_of_a_helix_is_cleared() {
        let square = [(0., 0.), (12., 0.), (12., 12.), (0., 12.)].map(|(x, y)| Point2::new(x, y)).to_vec();
        let piece = Piece { outer: square, islands: Vec::new() };
        let bounds = crate::pocket::turning::Turning { limit: 1.2, radius: 2.0 };
        let rules =
            Rules { bounds, sides: crate::pocket::bounded::Sides::Left, helix: [1.6, 0.4], down: 40.0 };
        let around = [Point2::new(-2.0, -2.0), Point2::new(14.0, 14.0)];
        let mut ground = Cleared::new(around, 2.0);
        let found = clear(&piece, None, &mut ground, &rules, &work::monitor::Silent).unwrap().unwrap();
        let Entry::Helix { centre, .. } = found.peeled[0].entry else { panic!("a helix") };
        let ends = found.rest.iter().map(|run| (run.points[run.points.len() - 1] - centre).norm());
        assert!(ends.fold(f64::INFINITY, f64::min) > 2.0);
    }
}
