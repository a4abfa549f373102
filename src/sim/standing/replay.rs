//! One tile of the stock: the program replayed on it, and how near the holder comes to what stands.
//!
//! The surface that an upright cutter sweeps along a straight move is a convex function of x and y. So over a
//! cell it is no higher than at the highest of the four corners: where a move sweeps all four, nothing above
//! that is left. A plunge cuts before its holder comes. On every other move the stock before the move counts
//! for the bound. For the distance that is reached, a place counts just before the cutter gets there, and
//! with what is left of it after the move.

use geometry::Point3;
use work::monitor::{Cancelled, Monitor, check};

use super::super::form::Form;
use super::super::swept::swept_height;
use super::super::track::{Track, larger, smaller};
use super::{NearStanding, Pending, Replayed, Section, Task};

/// Cells along the side of a tile. Fewer make more tiles, each with its own replay; more are replayed for
/// nothing.
pub(super) const TILE: usize = 32;

/// Cells along the side of a block of cells.
const BLOCK: usize = 8;

/// Corners of cells along the side of a tile.
const NODES: usize = TILE + 1;

/// Blocks along the side of a tile.
const BLOCKS: usize = TILE / BLOCK;

/// Pieces of a rising move that are looked at one by one at most.
const MOST_PIECES: f64 = 64.0;

/// Moves between two questions whether to go on.
const MOVES_BETWEEN_QUESTIONS: usize = 1024;

/// Slack of every bound, mm, against rounding.
const SLACK: f64 = 1.0e-9;

/// A place that may be nearer than anything so far: the section and the cell.
type Open = (usize, usize);

/// The stock of one tile.
pub(super) struct Replay<'a> {
    task: &'a Task<'a>,
    tile: &'a Pending,
    /// What stands at the corners of the cells.
    nodes: Vec<f64>,
    /// Nothing stands above this in a cell, and in a block of cells.
    cells: Vec<f64>,
    blocks: Vec<f64>,
    limit: f64,
    found: Replayed,
}

/// A square of cells, seen from above.
#[derive(Clone, Copy)]
struct Square {
    x: f64,
    y: f64,
    half_diagonal: f64,
}

impl<'a> Replay<'a> {
    pub fn new(task: &'a Task<'a>, tile: &'a Pending, limit: f64) -> Self {
        let at = |k: usize, axis: usize| tile.low[axis] + k as f64 * tile.cell;
        let node = |k: usize| task.stock.height_at(at(k % NODES, 0), at(k / NODES, 1));
        let half = 0.5 * tile.cell;
        let cell = |k: usize| task.stock.highest_within(at(k % TILE, 0) + half, at(k / TILE, 1) + half, half);
        let nodes = (0..NODES * NODES).map(node).collect();
        let cells = (0..TILE * TILE).map(cell).collect();
        let found = Replayed { bound: limit, nearest: None, collisions: Vec::new() };
        let mut replay = Self { task, tile, nodes, cells, blocks: vec![0.0; BLOCKS * BLOCKS], limit, found };
        (0..BLOCKS * BLOCKS).for_each(|block| replay.lower_block(block));
        replay
    }

    /// Runs through all moves of the tile.
    pub fn run(mut self, monitor: &dyn Monitor) -> Result<Replayed, Cancelled> {
        let mut open = Vec::new();
        let task = self.task;
        for before in &task.before {
            check(monitor)?;
            before.tracks.iter().for_each(|track| self.cut(&before.form, track));
        }
        for (count, &k) in self.tile.moves.iter().enumerate() {
            if count % MOVES_BETWEEN_QUESTIONS == 0 {
                check(monitor)?;
            }
            let track = self.task.tracks[k as usize];
            open.clear();
            let before = self.found.collisions.len();
            if track.length > 0.0 {
                self.look(&track, &mut open);
                let falls = self.task.falls(k);
                self.reach(k, &open, |section, at| vec![just_before(&track, falls, self.task, section, at)]);
                self.cut(&task.form, &track);
            } else {
                self.cut(&task.form, &track);
                self.look(&track, &mut open);
            }
            self.reach(k, &open, |_, at| abeam(&track, at));
            // Once is enough for each move.
            self.found.collisions.truncate(before + usize::from(self.found.collisions.len() > before));
        }
        Ok(self.found)
    }

    /// A square of `cells` cells from cell `(i, j)` on.
    fn square(&self, i: usize, j: usize, cells: usize) -> Square {
        let half = 0.5 * cells as f64 * self.tile.cell;
        Square {
            x: self.tile.low[0] + i as f64 * self.tile.cell + half,
            y: self.tile.low[1] + j as f64 * self.tile.cell + half,
            half_diagonal: half * std::f64::consts::SQRT_2 + SLACK,
        }
    }

    /// Lowers the stock to what a move leaves.
    fn cut(&mut self, form: &Form, track: &Track) {
        for block in 0..BLOCKS * BLOCKS {
            let (bi, bj) = (block % BLOCKS * BLOCK, block / BLOCKS * BLOCK);
            let square = self.square(bi, bj, BLOCK);
            let (along, across) = track.along_across(square.x, square.y);
            let ahead = along - smaller(larger(along, 0.0), track.length);
            let near = (ahead * ahead + across * across).sqrt() - square.half_diagonal;
            if near > form.radius {
                continue;
            }
            let first = smaller(larger(along - form.radius - square.half_diagonal, 0.0), track.length);
            if track.tip(first) + form.height(larger(near, 0.0)) - SLACK >= self.blocks[block] {
                continue;
            }
            self.cut_block(form, track, bi, bj);
            self.lower_block(block);
        }
    }

    fn cut_block(&mut self, form: &Form, track: &Track, bi: usize, bj: usize) {
        let mut swept = [[0.0; BLOCK + 1]; BLOCK + 1];
        for (j, row) in swept.iter_mut().enumerate() {
            let y = self.tile.low[1] + (bj + j) as f64 * self.tile.cell;
            for (i, height) in row.iter_mut().enumerate() {
                let x = self.tile.low[0] + (bi + i) as f64 * self.tile.cell;
                *height = swept_height(form, track, x, y);
                let node = &mut self.nodes[(bj + j) * NODES + bi + i];
                *node = smaller(*node, *height);
            }
        }
        for j in 0..BLOCK {
            for i in 0..BLOCK {
                let ends = [swept[j][i], swept[j][i + 1], swept[j + 1][i], swept[j + 1][i + 1]];
                let cell = &mut self.cells[(bj + j) * TILE + bi + i];
                *cell = smaller(*cell, ends.into_iter().fold(f64::NEG_INFINITY, larger));
            }
        }
    }

    /// The highest of a block's cells.
    fn lower_block(&mut self, block: usize) {
        let (bi, bj) = (block % BLOCKS * BLOCK, block / BLOCKS * BLOCK);
        let rows = (bj..bj + BLOCK).map(|j| &self.cells[j * TILE + bi..j * TILE + bi + BLOCK]);
        self.blocks[block] = rows.flatten().copied().fold(f64::NEG_INFINITY, larger);
    }

    /// Lists where a move may come nearer than the limit, and notes how near.
    fn look(&mut self, track: &Track, open: &mut Vec<Open>) {
        for (number, section) in self.task.sections.iter().enumerate() {
            for block in 0..BLOCKS * BLOCKS {
                let (bi, bj) = (block % BLOCKS * BLOCK, block / BLOCKS * BLOCK);
                let square = self.square(bi, bj, BLOCK);
                if self.bound(section, track, square, self.blocks[block], 1.0) >= self.limit {
                    continue;
                }
                for cell in 0..BLOCK * BLOCK {
                    let (i, j) = (bi + cell % BLOCK, bj + cell / BLOCK);
                    let cell = j * TILE + i;
                    let pieces = (track.slope * track.length / self.tile.cell).ceil().clamp(1.0, MOST_PIECES);
                    let bound = self.bound(section, track, self.square(i, j, 1), self.cells[cell], pieces);
                    if bound < self.limit {
                        self.found.bound = smaller(self.found.bound, bound);
                        open.push((number, cell));
                    }
                }
            }
        }
    }

    /// No stock in a square, up to `height`, is nearer to a section on a move than this. The move is taken in
    /// pieces, each with its lowest tip.
    fn bound(&self, section: &Section, track: &Track, square: Square, height: f64, pieces: f64) -> f64 {
        if height == f64::NEG_INFINITY {
            return f64::INFINITY;
        }
        let (along, across) = track.along_across(square.x, square.y);
        let reach = section.solid.radius() + self.limit + square.half_diagonal;
        // What is farther along the track than this is farther away than the limit.
        let [from, to] = [along - reach, along + reach].map(|s| smaller(larger(s, 0.0), track.length));
        let step = (to - from) / pieces;
        let mut least = f64::INFINITY;
        for k in 0..pieces as usize {
            let begin = from + k as f64 * step;
            let ahead = along - smaller(larger(along, begin), begin + step);
            let rho = (ahead * ahead + across * across).sqrt() - square.half_diagonal;
            let distance = section.distance_of_column(larger(rho, 0.0), height - track.tip(begin) + SLACK);
            // Within a section no distance of one place bounds that of the others.
            least = smaller(least, if distance <= SLACK { f64::NEG_INFINITY } else { distance - SLACK });
        }
        least
    }

    /// Takes the distances that a move reaches at the corners of the open cells, where the tool stands at the
    /// given places.
    fn reach(&mut self, k: u32, open: &[Open], places: impl Fn(&Section, &Point3) -> Vec<Standing>) {
        let bottom = self.task.stock.bounds().min.z;
        for &(number, cell) in open {
            let section = &self.task.sections[number];
            let (i, j) = (cell % TILE, cell / TILE);
            for (i, j) in [(i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)] {
                let x = self.tile.low[0] + i as f64 * self.tile.cell;
                let y = self.tile.low[1] + j as f64 * self.tile.cell;
                let at = Point3::new(x, y, self.nodes[j * NODES + i]);
                if at.z == f64::NEG_INFINITY {
                    continue;
                }
                for Standing { rho, tip } in places(section, &at) {
                    if tip + section.solid.heights()[0] >= bottom {
                        self.take(k, section, at, section.distance_of_column(rho, at.z - tip));
                    }
                }
            }
        }
    }

    fn take(&mut self, k: u32, section: &Section, at: Point3, distance: f64) {
        if distance < 0.0 {
            self.found.collisions.push(k);
        }
        if self.found.nearest.map_or(self.limit, |n| n.distance) > distance {
            self.found.nearest = Some(NearStanding { move_index: k, section: section.index, at, distance });
            self.limit = larger(distance, 0.0);
            self.found.bound = smaller(self.found.bound, distance);
        }
    }
}

/// A tool that stands somewhere on its track: how far from a place, and how high its tip.
struct Standing {
    rho: f64,
    tip: f64,
}

impl Standing {
    fn on(track: &Track, s: f64, [along, across]: [f64; 2]) -> Self {
        let s = smaller(larger(s, 0.0), track.length);
        let ahead = along - s;
        Self { rho: (ahead * ahead + across * across).sqrt(), tip: track.tip(s) }
    }
}

/// Where the tool is nearest to a place, and at its lowest.
fn abeam(track: &Track, at: &Point3) -> Vec<Standing> {
    let (along, across) = track.along_across(at.x, at.y);
    [along, 0.0].map(|s| Standing::on(track, s, [along, across])).into()
}

/// Where a section has come to a place, and the cutter has not yet.
fn just_before(track: &Track, falls: bool, task: &Task<'_>, section: &Section, at: &Point3) -> Standing {
    let (along, across) = track.along_across(at.x, at.y);
    let between = 0.5 * (task.form.radius + section.solid.radius());
    let back = larger(between * between - across * across, 0.0).sqrt();
    Standing::on(track, if falls { along + back } else { along - back }, [along, across])
}
