//! The exact z-map engine: every cell is the least of the stock and of all moves, each in closed
//! form. It stamps nothing and interpolates nothing; faster engines are judged by it.
//!
//! Enters: stock, cutter, path. Leaves: the stock after the whole path, mm, z up.
//!
//! The grid is cut into tiles, one worker each, and a tile into blocks. A block orders the moves of
//! its tile by a lower bound of their height over the block, the lowest first, and evaluates them
//! until the next bound lies above all that stands in the block by then. That leaves out only moves
//! which could not have changed a cell.

#[cfg(test)]
mod tests;

use super::bins::MoveBins;
use super::form::{Family, Form};
use super::swept::{ball_height, flat_height, rounded_height_below};
use super::tiles::{TileCells, tiles};
use super::track::{Track, larger, smaller};
use super::{CutError, NOT_CUT, ZMap};
use cutter::Cutter;
use geometry::Point2;
use motion::Toolpath;
use work::monitor::{Cancelled, Monitor, check};
use work::parallel;

/// Cells along the side of a block. Larger blocks bound the moves more loosely, smaller ones spend
/// more on bounds than on cells.
const BLOCK: usize = 16;

/// Fewest and most blocks along the side of a tile. A tile is about one cutter radius wide, so that
/// a move is listed in about nine of them whatever the cell; below the least count the lists
/// outgrow the cells, above the largest too few tiles are left to share among workers.
const TILE_BLOCKS: [f64; 2] = [2.0, 16.0];

/// Slack of every bound, mm, against rounding. It costs nothing up to a micrometre; below 1e-12 a
/// move could be left out that is lower than its bound by rounding.
const SLACK: f64 = 1.0e-9;

/// The rank of the stock among the moves: before the first one.
const STOCK: f64 = -1.0;

/// Cuts `stock` along every move of `path`, rapids included: the height of a cell becomes the least of the
/// stock and of all moves, and `cut_by` names the first of the moves that reach down to it ([`NOT_CUT`] where
/// the stored height stays that of the stock, also if an earlier path had cut there).
///
/// # Errors
/// [`CutError::Path`] where the path is no path of upright tools; [`CutError::Cancelled`] when the monitor
/// says so.
///
/// # Tolerance
/// Moves are evaluated and compared in f64 (see [`Envelope`](super::Envelope)) at the cell centres; storing
/// the height as f32 adds at most half a unit in its last place: 0.004 µm below 128 mm, 0.03 µm below 1 m.
/// The bits do not depend on the number of threads.
pub fn cut_reference(
    stock: &ZMap,
    cutter: &Cutter,
    path: &Toolpath,
    monitor: &dyn Monitor,
) -> Result<ZMap, CutError> {
    path.check_upright()?;
    Ok(reference(stock, cutter, path, monitor)?)
}

/// As [`cut_reference`], for a path that was checked.
pub(crate) fn reference(
    stock: &ZMap,
    cutter: &Cutter,
    path: &Toolpath,
    monitor: &dyn Monitor,
) -> Result<ZMap, Cancelled> {
    check(monitor)?;
    let form = Form::new(cutter);
    let tile_blocks = (form.radius / (stock.grid.cell * BLOCK as f64)).round();
    let side = BLOCK * tile_blocks.clamp(TILE_BLOCKS[0], TILE_BLOCKS[1]) as usize;
    let bins = MoveBins::new(&stock.grid, side, form.radius, path);
    monitor.start("cutting", (bins.nx() * bins.ny()) as u64);
    let mut cut = ZMap { cut_by: vec![NOT_CUT; stock.height.len()], ..stock.clone() };
    let mut tiles = tiles(&mut cut, side);
    parallel::try_for_each(&mut tiles, |k, tile| {
        check(monitor)?;
        tile.cut(&form, path, bins.of_bin(k % bins.nx(), k / bins.nx()));
        monitor.advance(1);
        Ok(())
    })?;
    drop(tiles);
    Ok(cut)
}

/// A move that may cut in a tile.
struct Candidate {
    track: Track,
    index: u32,
}

impl TileCells<'_> {
    fn cut(&mut self, form: &Form, path: &Toolpath, moves: &[u32]) {
        let candidate = |&index: &u32| {
            let k = index as usize;
            Candidate { track: Track::new(path.start_of(k), path.moves[k].to.tip), index }
        };
        let candidates: Vec<Candidate> = moves.iter().map(candidate).collect();
        let mut order = Vec::with_capacity(candidates.len());
        for j0 in (0..self.rows.len()).step_by(BLOCK) {
            for i0 in (0..self.x.len()).step_by(BLOCK) {
                let mut block = Block::load(self, i0, j0);
                block.cut(form, &candidates, &mut order);
                block.store(self, i0, j0);
            }
        }
    }
}

/// Heights of `BLOCK` × `BLOCK` cells while they are cut. Cells beyond the border of the grid stand
/// at minus infinity, where nothing cuts them and nothing waits for them.
struct Block {
    x: [f64; BLOCK],
    y: [f64; BLOCK],
    rows: [Row; BLOCK],
    /// The middle of the cells and the distance of the outermost centres from it.
    middle: Point2,
    half_diagonal: f64,
}

/// Heights of a row of cells and the index of the move that made each, as f64 so that both go
/// through the same vector lanes.
#[derive(Clone, Copy)]
struct Row {
    height: [f64; BLOCK],
    rank: [f64; BLOCK],
}

impl Block {
    fn load(tile: &TileCells<'_>, i0: usize, j0: usize) -> Self {
        let (nx, ny) = ((tile.x.len() - i0).min(BLOCK), (tile.rows.len() - j0).min(BLOCK));
        let mut x = [tile.x[i0]; BLOCK];
        let mut y = [tile.y[j0]; BLOCK];
        x[..nx].copy_from_slice(&tile.x[i0..i0 + nx]);
        y[..ny].copy_from_slice(&tile.y[j0..j0 + ny]);
        let mut rows = [Row { height: [f64::NEG_INFINITY; BLOCK], rank: [STOCK; BLOCK] }; BLOCK];
        for (row, (heights, _)) in rows.iter_mut().zip(&tile.rows[j0..j0 + ny]) {
            for (height, &stored) in row.height.iter_mut().zip(&heights[i0..i0 + nx]) {
                *height = f64::from(stored);
            }
        }
        let (width, depth) = (x[nx - 1] - x[0], y[ny - 1] - y[0]);
        let middle = Point2::new(x[0] + 0.5 * width, y[0] + 0.5 * depth);
        Self { x, y, rows, middle, half_diagonal: 0.5 * width.hypot(depth) }
    }

    fn store(&self, tile: &mut TileCells<'_>, i0: usize, j0: usize) {
        for (row, (heights, cut_by)) in self.rows.iter().zip(&mut tile.rows[j0..]) {
            let cells = heights[i0..].iter_mut().zip(&mut cut_by[i0..]);
            for ((height, by), (&h, &rank)) in cells.zip(row.height.iter().zip(&row.rank)) {
                let stored = h as f32;
                if rank != STOCK && stored < *height {
                    *height = stored;
                    *by = rank as u32;
                }
            }
        }
    }

    /// Cuts with all candidates that can matter. `order` is scratch.
    fn cut(&mut self, form: &Form, candidates: &[Candidate], order: &mut Vec<(f64, u32)>) {
        let mut top = self.top();
        order.clear();
        for (k, candidate) in candidates.iter().enumerate() {
            let bound = self.lower_bound(form, &candidate.track);
            if bound <= top {
                order.push((bound, k as u32));
            }
        }
        order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for &(bound, k) in order.iter() {
            // Not when they are equal: of equal moves the least index has to win.
            if bound > top {
                break;
            }
            let Candidate { track, index } = &candidates[k as usize];
            self.cut_with(form, track, f64::from(*index));
            top = self.top();
        }
    }

    fn top(&self) -> f64 {
        let mut tops = [f64::NEG_INFINITY; BLOCK];
        for row in &self.rows {
            for i in 0..BLOCK {
                tops[i] = larger(tops[i], row.height[i]);
            }
        }
        tops.into_iter().fold(f64::NEG_INFINITY, larger)
    }

    /// No cell of the block is cut lower than this by the track (infinite: it passes none): the
    /// cells lie at least as far from the track as the middle less the half diagonal, and are
    /// reached only from the part of the track that is within a radius of them; the lower end of
    /// that part is the lowest place of the tip.
    fn lower_bound(&self, form: &Form, track: &Track) -> f64 {
        let (along, across) = track.along_across(self.middle.x, self.middle.y);
        let ahead = along - smaller(larger(along, 0.0), track.length);
        let near = (ahead * ahead + across * across).sqrt() - self.half_diagonal - SLACK;
        if near > form.radius {
            return f64::INFINITY;
        }
        let first = along - form.radius - self.half_diagonal - SLACK;
        track.tip(larger(first, 0.0)) + form.height(larger(near, 0.0)) - SLACK
    }

    fn cut_with(&mut self, form: &Form, track: &Track, rank: f64) {
        let radius = form.radius;
        match form.family {
            Family::Ball => self
                .cut_each(radius, track, rank, |along, across, _| ball_height(track, radius, along, across)),
            Family::Flat => self
                .cut_each(radius, track, rank, |along, across, _| flat_height(track, radius, along, across)),
            Family::Rounded => self.cut_each(radius, track, rank, |along, across, now| {
                rounded_height_below(form, track, along, across, now)
            }),
        }
    }

    /// Lowers each cell to `height(along, across, height now)`; of equal moves the first keeps it.
    #[inline(always)]
    fn cut_each(&mut self, radius: f64, track: &Track, rank: f64, height: impl Fn(f64, f64, f64) -> f64) {
        let end = track.y + track.uy * track.length;
        let (bottom, top) = (smaller(track.y, end) - radius - SLACK, larger(track.y, end) + radius + SLACK);
        for (row, &y) in self.rows.iter_mut().zip(&self.y) {
            if y < bottom || y > top {
                continue;
            }
            for i in 0..BLOCK {
                let (along, across) = track.along_across(self.x[i], y);
                let now = row.height[i];
                let h = height(along, across, now);
                let lower = (h < now) | ((h == now) & (rank < row.rank[i]));
                row.height[i] = if lower { h } else { now };
                row.rank[i] = if lower { rank } else { row.rank[i] };
            }
        }
    }
}
