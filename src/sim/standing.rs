//! How near shank and holder of an upright tool come to the stock that stands when they pass.
//!
//! Enters: the stock, the cutter, the holder, a path. Leaves: the least distance with a bound, its move and
//! place, and the moves on which they collide; mm.
//!
//! The program is replayed on square tiles ([`replay`]). A tile knows for each of its cells a height above
//! which nothing stands in the whole cell, and for the corners of the cells what stands there. The first
//! gives a bound, the second a distance that is reached. Where the two leave open what is asked, the tile is
//! divided, and its quarters replay the moves near them on cells of half the size. So the cells are fine only
//! beside the nearest places.
//!
//! A section no wider than the cutter needs no look: it stands where the cutter has been.

mod replay;
#[cfg(test)]
mod tests;

use cutter::{Cutter, Holder, Solid};
use geometry::Point3;
use motion::Toolpath;
use work::monitor::{Cancelled, Monitor, check};
use work::parallel;

use super::form::Form;
use super::stock::Stock;
use super::track::Track;
use replay::{Replay, TILE};

/// Clearances above this, mm, are not told apart: no machinist asks. More takes longer.
pub const FAR: f64 = 10.0;

/// The bound may be this share of the clearance, and this length, mm. Less divides more tiles.
const OPEN_SHARE: f64 = 0.05;
const OPEN: f64 = 0.01;

/// First cells over the cutter's radius. Finer ones take longer where all is clear, coarser ones are divided
/// more often.
const FIRST_CELL: f64 = 0.25;

/// Cells are not divided below this, mm. A holder that rubs along a wall would divide them without end.
pub(crate) const LEAST_CELL: f64 = 1e-3;

/// Tiles that are replayed at most; what is left open by then stays in the bound.
const MOST_REPLAYS: usize = 10_000;

/// Tiles that are replayed at a time. Those of one batch do not know what the others find.
const BATCH: usize = 16;

/// The nearest that shank or holder come to standing stock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearStanding {
    /// Index of the move.
    pub move_index: u32,
    /// Section of the holder, counted from 0 at the bottom.
    pub section: usize,
    /// The place of the stock.
    pub at: Point3,
    /// Signed distance of that place from the section, mm; below zero it is in it at least so deep.
    pub distance: f64,
}

/// How clear shank and holder stay of the stock that stands when they come.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StandingClearance {
    /// The nearest place; `None` where nothing comes nearer than [`FAR`].
    pub nearest: Option<NearStanding>,
    /// No place comes nearer than the nearest, or than [`FAR`], by more than this, mm; infinite where the
    /// search left it open whether they collide. Of a collision the depth is at least that found.
    pub error_bound: f64,
    /// Moves on which they certainly collide, in program order; those beside a deeper one may be missing.
    pub collisions: Vec<u32>,
}

/// A bound above this is near enough where nothing nearer than `limit` was found.
pub(crate) fn enough(limit: f64) -> f64 {
    limit - (OPEN_SHARE * limit).max(OPEN)
}

/// A section that is wider than the cutter.
struct Section {
    solid: Solid,
    index: usize,
}

impl Section {
    /// Distance of a column of stock, `rho` mm or more from the axis and up to `height` above the tip: exact
    /// above zero, and else at most the distance of some place of the column.
    fn distance_of_column(&self, rho: f64, height: f64) -> f64 {
        let [low, high] = self.solid.heights();
        let at = |z: f64| self.solid.outline_foot(rho, z).distance;
        let top = height.min(high);
        let mut least = at(top);
        if top > low {
            // A section is widest at one of its ends.
            least = least.min(at(low)).min(at(0.5 * (low + top)));
        }
        least
    }
}

/// What another cutter did before.
struct Before {
    form: Form,
    tracks: Vec<Track>,
}

/// What every replay needs.
struct Task<'a> {
    stock: &'a Stock,
    before: Vec<Before>,
    form: Form,
    sections: Vec<Section>,
    tracks: Vec<Track>,
    path: &'a Toolpath,
    /// The widest of all, mm.
    radius: f64,
}

/// A tile that is still to be replayed.
struct Pending {
    low: [f64; 2],
    cell: f64,
    /// Moves that come near it, ascending.
    moves: Vec<u32>,
    /// Nothing in it is nearer than this.
    bound: f64,
}

/// How near shank and holder come to what stands of `stock` when they pass, on every move of `path`, rapids
/// included. Other cutters may have cut the stock `before`. `None` where no section is wider than the cutter.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
///
/// # Tolerance
/// See [`StandingClearance::error_bound`]. It is a twentieth of the clearance and a hundredth of a millimetre
/// at most, unless more than 10,000 tiles leave it open. The result does not depend on the number of threads.
pub fn holder_clearance(
    stock: &Stock,
    before: &[(Cutter, Toolpath)],
    cutter: &Cutter,
    holder: &Holder,
    path: &Toolpath,
    monitor: &dyn Monitor,
) -> Result<Option<StandingClearance>, Cancelled> {
    let mut task = Task::new(stock, cutter, holder, path);
    task.before = before.iter().map(|(cutter, path)| Before::of(cutter, path)).collect();
    if task.sections.is_empty() {
        return Ok(None);
    }
    monitor.start("checking the holder", 0);
    let mut search = Search { waiting: task.tiles(cutter.radius()), ..Search::default() };
    while let Some(batch) = search.next_batch() {
        let replayed = parallel::try_map(batch.len(), |k| {
            check(monitor)?;
            let (tile, limit) = (&batch[k], search.limit());
            if task.is_far(tile, limit) {
                return Ok(Replayed { bound: limit, nearest: None, collisions: Vec::new() });
            }
            Replay::new(&task, tile, limit).run(monitor)
        })?;
        for (tile, found) in batch.into_iter().zip(replayed) {
            search.take(&task, tile, found);
        }
    }
    Ok(Some(search.result()))
}

impl Before {
    fn of(cutter: &Cutter, path: &Toolpath) -> Self {
        Self { form: Form::new(cutter), tracks: tracks(path) }
    }
}

fn tracks(path: &Toolpath) -> Vec<Track> {
    path.segments().map(|(from, to, _)| Track::new(from, to)).collect()
}

impl<'a> Task<'a> {
    fn new(stock: &'a Stock, cutter: &Cutter, holder: &Holder, path: &'a Toolpath) -> Self {
        let sections = Solid::of_sections(holder).into_iter().enumerate();
        let wider = sections.filter(|(_, solid)| solid.radius() > cutter.radius());
        let sections: Vec<Section> = wider.map(|(index, solid)| Section { solid, index }).collect();
        let radius = sections.iter().map(|s| s.solid.radius()).fold(cutter.radius(), f64::max);
        let tracks = tracks(path);
        Self { stock, before: Vec::new(), form: Form::new(cutter), sections, tracks, path, radius }
    }

    /// Whether a move runs down its track.
    fn falls(&self, k: u32) -> bool {
        Track::falls(self.path.start_of(k as usize), self.path.moves[k as usize].to.tip)
    }

    /// The first tiles over the stock.
    fn tiles(&self, cutter_radius: f64) -> Vec<Pending> {
        let cell = FIRST_CELL * cutter_radius;
        let side = TILE as f64 * cell;
        let (block, size) = (self.stock.bounds(), self.stock.bounds().size());
        let count = |length: f64| (length / side).ceil().max(1.0) as usize;
        let all: Vec<u32> = (0..self.path.len() as u32).collect();
        let (nx, ny) = (count(size.x), count(size.y));
        parallel::map(nx * ny, |k| {
            let low = [block.min.x + (k % nx) as f64 * side, block.min.y + (k / nx) as f64 * side];
            Pending { low, cell, moves: self.moves_near(&all, low, side), bound: f64::NEG_INFINITY }
        })
    }

    /// Whether on a tile no section comes down to the stock's top by less than the limit.
    fn is_far(&self, tile: &Pending, limit: f64) -> bool {
        let lowest = tile.moves.iter().map(|&k| self.tracks[k as usize].z).fold(f64::INFINITY, f64::min);
        let bottom = self.sections.iter().map(|s| s.solid.heights()[0]).fold(f64::INFINITY, f64::min);
        lowest + bottom - self.stock.bounds().max.z >= limit
    }

    /// Those of the moves that come near a square.
    fn moves_near(&self, moves: &[u32], low: [f64; 2], side: f64) -> Vec<u32> {
        let reach = self.radius + FAR;
        let near =
            |from: f64, to: f64, low: f64| from.min(to) - reach <= low + side && from.max(to) + reach >= low;
        let comes_near = |k: &&u32| {
            let (from, to) = (self.path.start_of(**k as usize), self.path.moves[**k as usize].to.tip);
            near(from.x, to.x, low[0]) && near(from.y, to.y, low[1])
        };
        moves.iter().filter(comes_near).copied().collect()
    }

    /// The quarters of a tile.
    fn quarters(&self, tile: &Pending, bound: f64) -> [Pending; 4] {
        let cell = 0.5 * tile.cell;
        let side = TILE as f64 * cell;
        [0, 1, 2, 3].map(|k| {
            let low = [tile.low[0] + f64::from(k % 2) * side, tile.low[1] + f64::from(k / 2) * side];
            Pending { low, cell, moves: self.moves_near(&tile.moves, low, side), bound }
        })
    }
}

/// What a tile tells.
struct Replayed {
    /// Nothing in it is nearer than this, or than the limit it was replayed with.
    bound: f64,
    nearest: Option<NearStanding>,
    collisions: Vec<u32>,
}

/// The search for the least distance of all.
#[derive(Default)]
struct Search {
    waiting: Vec<Pending>,
    nearest: Option<NearStanding>,
    collisions: Vec<u32>,
    /// The lowest bound of the tiles that are done; `None` before the first.
    done: Option<f64>,
    replays: usize,
}

impl Search {
    /// What is farther than this needs no look.
    fn limit(&self) -> f64 {
        self.nearest.map_or(FAR, |nearest| nearest.distance.max(0.0))
    }

    /// The tiles that may hold the nearest place.
    fn next_batch(&mut self) -> Option<Vec<Pending>> {
        self.waiting.sort_by(|a, b| a.bound.total_cmp(&b.bound));
        let enough = if self.replays < MOST_REPLAYS { enough(self.limit()) } else { f64::NEG_INFINITY };
        let open = self.waiting.partition_point(|tile| tile.bound < enough);
        let mut open: Vec<Pending> = self.waiting.drain(..open).collect();
        let shut = std::mem::take(&mut self.waiting);
        shut.iter().for_each(|tile| self.shut(tile.bound));
        self.waiting = open.split_off(open.len().min(BATCH));
        self.replays += open.len();
        (!open.is_empty()).then_some(open)
    }

    fn shut(&mut self, bound: f64) {
        self.done = Some(self.done.map_or(bound, |done| done.min(bound)));
    }

    fn take(&mut self, task: &Task<'_>, tile: Pending, found: Replayed) {
        self.collisions.extend(found.collisions);
        let nearer = |a: &NearStanding| self.nearest.is_none_or(|b| a.distance < b.distance);
        let collides = found.nearest.is_some_and(|nearest| nearest.distance < 0.0);
        if let Some(nearest) = found.nearest.filter(nearer) {
            self.nearest = Some(nearest);
        }
        if collides || found.bound >= enough(self.limit()) || tile.cell <= LEAST_CELL {
            self.shut(found.bound);
        } else {
            self.waiting.extend(task.quarters(&tile, found.bound));
        }
    }

    fn result(mut self) -> StandingClearance {
        self.collisions.sort_unstable();
        self.collisions.dedup();
        let limit = self.nearest.map_or(FAR, |nearest| nearest.distance);
        let error_bound = if limit < 0.0 { 0.0 } else { (limit - self.done.unwrap_or(limit)).max(0.0) };
        StandingClearance { nearest: self.nearest, error_bound, collisions: self.collisions }
    }
}
