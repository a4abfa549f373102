//! Where stock may still stand.
//!
//! Enters: a piece of the cutter's centre, ways that were gone. Leaves: runs to places where stock may stand,
//! and the place deep in stock with most room. Whether stock may stand is told by square cells: the middle of
//! one, and all around it, is cleared for sure where one disc holds it whole; mm.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use super::air::sides;
use super::bounded::STEP;
use super::cleared::Cleared;
use super::lines::crossings;
use super::route::{Entry, Run};
use super::walls::Room;
use geometry::{Piece, Point2, Region, SegmentGrid, Vector2};
use work::monitor::{Cancelled, Monitor, check};

/// Side of a cell over the radius, and most cells along a side.
const CELL: f64 = 0.1;
const MOST_CELLS: f64 = 2048.0;

/// Places along a side of a cell that are asked whether they stand.
const PLACES: i32 = 15;

/// Runs to what stands on the floor of a piece after others, under a cutter whose bottom is level up to a
/// `radius`, mm. None where that is so small, or the piece so large, that cells cannot tell.
pub(super) fn runs_to_rest(
    piece: &Piece,
    gone: &[Run],
    radius: f64,
    monitor: &dyn Monitor,
) -> Result<Vec<Run>, Cancelled> {
    let cells = if radius > 0.0 { Cells::new(piece, radius) } else { None };
    let Some(mut cells) = cells else { return Ok(Vec::new()) };
    let turns: Vec<Vec<Point2>> = gone.iter().map(Run::turn_at_depth).collect();
    let ways = || gone.iter().map(|run| run.points.as_slice()).chain(turns.iter().map(Vec::as_slice));
    ways().for_each(|way| cells.clear_along(way));
    let all = SegmentGrid::new(sides(ways()));
    let step = cells.cell / f64::from(PLACES);
    let half = PLACES / 2;
    let farthest = |p: &Point2| {
        let places = (-half..=half).flat_map(|j| (-half..=half).map(move |i| (i, j)));
        let places = places.map(|(i, j)| p + Vector2::new(f64::from(i), f64::from(j)) * step);
        let far = places.map(|place| (all.distance(&place), place));
        far.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|far| far.0 > radius - step * FRAC_1_SQRT_2)
    };
    cells.runs_to_standing(gone, &[], &|p| farthest(p).map(|far| far.1), monitor)
}

/// Cells of the box of a piece, and which of them are cleared for sure.
pub(super) struct Cells {
    radius: f64,
    origin: Point2,
    cell: f64,
    side: [usize; 2],
    clear: Vec<bool>,
}

impl Cells {
    /// `None` where the piece is so large that cells would be as large as the cutter.
    pub fn new(piece: &Piece, radius: f64) -> Option<Self> {
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
        for pair in crossings(piece, level, |p| p.y, |p| p.x - self.origin.x).chunks_exact(2) {
            let (from, to) = ((pair[0] / self.cell).ceil() as usize, (pair[1] / self.cell).floor() as usize);
            (from..=to.min(self.side[0] - 1)).for_each(|i| self.clear[row * self.side[0] + i] = false);
        }
    }

    fn at(&self, index: usize) -> Point2 {
        let (i, j) = (index % self.side[0], index / self.side[0]);
        self.origin + Vector2::new(i as f64, j as f64) * self.cell
    }

    /// Clears the cells that the cutter at `p` holds whole.
    pub fn clear_at(&mut self, p: &Point2) {
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

    pub fn clear_along(&mut self, way: &[Point2]) {
        for ends in way.windows(2) {
            let along = ends[1] - ends[0];
            let steps = (along.norm() / (STEP * self.radius)).ceil().max(1.0);
            (0..=steps as usize).for_each(|k| self.clear_at(&(ends[0] + along * (k as f64 / steps))));
        }
    }

    /// Of the places where the cutter would stand in stock all around, the one with most room, `least` or
    /// more.
    pub fn deep_in_stock(
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

    /// Runs from the ways that were gone straight to cells that may hold stock; `stands` tells where in one,
    /// if anywhere.
    pub fn runs_to_standing(
        &mut self,
        gone: &[Run],
        ways: &[Vec<Point2>],
        stands: &dyn Fn(&Point2) -> Option<Point2>,
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
            let Some(p) = stands(&self.at(index)) else { continue };
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
}
