//! The z-map engine: the lower envelope of all swept moves by branch and bound. mm, z up.
//!
//! Enters: stock, cutter, path. Leaves: the stock after the whole path, as exact as that of
//! [`cut_reference`](super::cut_reference) to 0.01 µm, in a small share of its time.
//!
//! Tiles of the grid, one worker each, hold the moves that can reach them and are divided like a
//! quadtree, down to leaves of 8 × 8 cells. At every square moves are dropped that cannot be lowest
//! anywhere in it, so that few are left in a leaf; those are evaluated in closed form at every cell.
//!
//! # The bound
//! Let c be a square's corners and b a move that passes all of it. The height `h_b` is convex
//! ([`sweep`]), so inside the square it lies below the bilinear interpolation of its values at the
//! corners, which is a convex combination of them. Another move lies above any plane that touches it
//! from below, and a plane is its own bilinear interpolation. Hence, if the plane of move j lies
//! at or above `h_b` at the four corners, j lies at or above b in all of the square, and can go. The same
//! holds with the level of the stock in place of b. No curvature enters, and no case is left out:
//! plunges, moves of no length and moves beside the stock have convex heights too.

mod local;
mod sweep;
#[cfg(test)]
mod tests;

use super::bins::MoveBins;
use super::form::{Family, Form};
use super::swept::swept_height;
use super::tiles::{TileCells, tiles};
use super::track::Track;
use super::{Grid, NOT_CUT, ZMap, cut_reference};
use crate::cutter::Cutter;
use crate::lanes::{self, Real};
use crate::monitor::{Cancelled, Monitor, check};
use crate::parallel;
use crate::toolpath::Toolpath;
use local::{Chunk, Frame, LANES, LocalMove, MoveList, Name};
use sweep::{Ball, Flat, Rounded, Sweep};

/// Cells along the side of a leaf. Smaller leaves keep fewer moves and ask for them more often.
const LEAF: usize = 8;
const LEAF_CELLS: usize = LEAF * LEAF;

/// A leaf with more moves than this is divided once more.
const CROWDED: usize = 5;

/// Cells along the side of such a part of a leaf.
const PART: usize = LEAF / 2;
const PART_CELLS: usize = PART * PART;

/// Most cells along the side of a tile, a power of two times [`LEAF`]. Larger ones leave too few for
/// many workers.
const LARGEST_TILE: usize = 256;

/// Side of a tile in cutter radii, about. In larger ones many moves are carried down a level in vain; in
/// smaller ones a move is listed in many tiles.
const TILE_RADII: f64 = 1.7;

/// Greatest height of stock above the lowest tip in a tile, mm, for which f32 is used: there half a unit in
/// the last place is 1e-6 mm, and a height is rounded a few times. Deeper tiles are cut in f64.
const DEEPEST: f64 = 32.0;

/// Cuts `stock` along every move of `path`, rapids included, in place: the height of a cell becomes the
/// least of the stock and of all moves, and `cut_by` names a move that reaches down to it ([`NOT_CUT`]
/// where the stored height stays that of the stock).
///
/// # Errors
/// [`Cancelled`] when the monitor says so; the stock is lost then.
///
/// # Tolerance
/// Heights lie within 1e-5 mm, or half a unit in the last place of f32 if that is more, of those of
/// [`cut_reference`]. The bits depend neither on the number of threads nor on the machine's vector unit.
pub fn cut(stock: ZMap, cutter: &Cutter, path: &Toolpath, monitor: &dyn Monitor) -> Result<ZMap, Cancelled> {
    cut_counted(stock, cutter, path, monitor).map(|(map, _)| map)
}

/// As [`cut`], with what was done.
///
/// # Errors
/// As [`cut`].
pub fn cut_counted(
    stock: ZMap,
    cutter: &Cutter,
    path: &Toolpath,
    monitor: &dyn Monitor,
) -> Result<(ZMap, Work), Cancelled> {
    check(monitor)?;
    let form = Form::new(cutter);
    // The place of a barrel on its track has no closed form here.
    if path.len() > Name::MOST || form.profile.centre_x < 0.0 {
        return Ok((cut_reference(&stock, cutter, path, monitor)?, Work::default()));
    }
    let side = tile_side(form.radius, stock.grid.cell);
    Job { form, path, side, margin: 0.0 }.run(stock, monitor)
}

fn tile_side(radius: f64, cell: f64) -> usize {
    let leaves = TILE_RADII * radius / (cell * LEAF as f64);
    let mut side = LEAF;
    while side < LARGEST_TILE && (2 * side) as f64 <= leaves * LEAF as f64 {
        side *= 2;
    }
    side
}

/// Most moves that are compared each with each. Comparing more costs more than it saves.
const MOST_JUDGES: usize = 2 * LANES;

/// So few moves go down to the leaves without further tests.
const FEW: usize = 3;

/// What was done, for benchmarks and tests.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Work {
    /// Moves tested at squares.
    pub tests: u64,
    /// Closed forms evaluated at cells.
    pub evaluations: u64,
    /// Cells worked out again in f64.
    pub second_looks: u64,
}

struct Job<'a> {
    form: Form,
    path: &'a Toolpath,
    side: usize,
    /// Added to every bound: 0 but in tests.
    margin: f64,
}

impl Job<'_> {
    fn run(&self, mut stock: ZMap, monitor: &dyn Monitor) -> Result<(ZMap, Work), Cancelled> {
        let grid = stock.grid;
        let bins = MoveBins::new(&grid, self.side, self.form.radius, self.path);
        monitor.start("cutting", (bins.nx() * bins.ny()) as u64);
        let mut tiles = tiles(&mut stock, self.side);
        let works = parallel::try_map_mut(&mut tiles, |k, tile| {
            check(monitor)?;
            let work = self.cut_tile(&grid, tile, bins.of_bin(k % bins.nx(), k / bins.nx()));
            monitor.advance(1);
            Ok(work)
        })?;
        drop(tiles);
        let total = works.iter().fold(Work::default(), |sum, w| Work {
            tests: sum.tests + w.tests,
            evaluations: sum.evaluations + w.evaluations,
            second_looks: sum.second_looks + w.second_looks,
        });
        Ok((stock, total))
    }

    fn cut_tile(&self, grid: &Grid, cells: &mut TileCells<'_>, moves: &[u32]) -> Work {
        let (radius, half) = (self.form.radius, 0.5 * (self.side as f64) * grid.cell);
        let extent = radius + half * std::f64::consts::SQRT_2;
        let tracks: Vec<Track> = moves.iter().map(|&k| track(self.path, k)).collect();
        let low = grid.centre(cells.i0, cells.j0);
        let high = grid.centre(cells.i0 + cells.nx() - 1, cells.j0 + cells.rows.len() - 1);
        let (x, y) = (0.5 * (low.x + high.x), 0.5 * (low.y + high.y));
        let lowest_tip = |track: &Track| {
            let (along, _) = track.along_across(x, y);
            track.tip((along - extent).max(0.0).min(track.length))
        };
        let z = tracks.iter().map(lowest_tip).fold(f64::INFINITY, f64::min);
        let frame = Frame { x, y, z: if z.is_finite() { z } else { 0.0 }, reach: 2.0 * extent };
        let tops = lanes::dispatch(
            #[inline(always)]
            || leaf_tops(cells, self.side),
        );
        let top = tops.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let shallow = f64::from(top) - frame.z <= DEEPEST;
        let (form, blur) = (&self.form, sweep::blur(extent));
        let share = sweep::rim_share(extent).filter(|_| shallow);
        let tile = Tile { cells, moves, tracks: &tracks, frame, tops };
        lanes::dispatch(
            #[inline(always)]
            || match (form.family, share) {
                (Family::Ball, Some(share)) => self.cut_with::<f32, _>(Ball::new(radius, share), grid, tile),
                (Family::Ball, None) => self.cut_with::<f64, _>(Ball::new(radius, 0.0), grid, tile),
                (Family::Flat, Some(_)) => self.cut_with::<f32, _>(Flat::new(radius, blur), grid, tile),
                (Family::Flat, None) => self.cut_with::<f64, _>(Flat::new(radius, 0.0), grid, tile),
                (Family::Rounded, Some(_))
                    if form.profile.is_plain() && form.profile.arc_end == form.radius =>
                {
                    self.cut_with::<f32, _>(Rounded::<_, false>::new(form, blur), grid, tile)
                }
                (Family::Rounded, Some(_)) => {
                    self.cut_with::<f32, _>(Rounded::<_, true>::new(form, blur), grid, tile)
                }
                (Family::Rounded, None) => {
                    self.cut_with::<f64, _>(Rounded::<_, true>::new(form, 0.0), grid, tile)
                }
            },
        )
    }

    #[inline(always)]
    fn cut_with<T: Real, S: Sweep<T>>(&self, sweep: S, grid: &Grid, tile: Tile<'_, '_>) -> Work {
        let Tile { cells: tile, moves, tracks, frame, tops } = tile;
        let mut levels = vec![MoveList::new()];
        for (&k, track) in moves.iter().zip(tracks) {
            let (local, bound_only) = LocalMove::new(track, &frame);
            let falling = Track::falls(self.path.start_of(k as usize), self.path.moves[k as usize].to.tip);
            levels[0].push(&local, Name::new(k, bound_only, falling));
        }
        levels[0].seal();
        let mut worker = Worker {
            job: self,
            sweep,
            grid,
            tile,
            frame,
            cells: offsets(LEAF, grid.cell),
            part_cells: offsets(PART, grid.cell),
            tops,
            levels,
            planes: Vec::new(),
            kept_planes: [Planes::none(); MOST_JUDGES / LANES],
            work: Work::default(),
        };
        worker.square(0, 0, 0, self.side);
        worker.work
    }
}

/// What a tile is cut with.
struct Tile<'a, 'b> {
    cells: &'a mut TileCells<'b>,
    moves: &'a [u32],
    /// Those of the moves.
    tracks: &'a [Track],
    frame: Frame,
    /// The highest stock in each leaf.
    tops: Vec<f32>,
}

fn track(path: &Toolpath, k: u32) -> Track {
    Track::new(path.start_of(k as usize), path.moves[k as usize].to.tip)
}

/// The highest height in each leaf of a tile, `[side / LEAF][side / LEAF]`.
#[inline(always)]
fn leaf_tops(tile: &TileCells<'_>, side: usize) -> Vec<f32> {
    let leaves = side / LEAF;
    let mut tops = vec![f32::NEG_INFINITY; leaves * leaves];
    for (tops, rows) in tops.chunks_mut(leaves).zip(tile.rows.chunks(LEAF)) {
        for (k, top) in tops.iter_mut().enumerate() {
            // One maximum for each column.
            let mut columns = [f32::NEG_INFINITY; LEAF];
            for (heights, _) in rows {
                let mut cells = [f32::NEG_INFINITY; LEAF];
                let n = heights.len().saturating_sub(k * LEAF).min(LEAF);
                copy_row::<LEAF, _>(&mut cells, heights.get(k * LEAF..).unwrap_or(&[]), n);
                for c in 0..LEAF {
                    columns[c] = if cells[c] > columns[c] { cells[c] } else { columns[c] };
                }
            }
            *top = columns.into_iter().fold(f32::NEG_INFINITY, |a, b| if a > b { a } else { b });
        }
    }
    tops
}

/// Places of `n` × `n` cells from the first one, row by row.
fn offsets<T: Real, const CELLS: usize>(n: usize, cell: f64) -> [[T; CELLS]; 2] {
    [
        std::array::from_fn(|c| T::of((c % n) as f64 * cell)),
        std::array::from_fn(|c| T::of((c / n) as f64 * cell)),
    ]
}

/// Planes below the moves of a chunk, at the middle of a square.
#[derive(Clone, Copy)]
struct Planes<T> {
    z: [T; LANES],
    x: [T; LANES],
    y: [T; LANES],
    /// Squared distance from the track.
    away: [T; LANES],
    /// Which end of the move alone cuts in the square, if any: bits [`AT_START`] and [`AT_END`].
    ends: [u32; LANES],
}

/// Only the cutter at the start of the move cuts in the square.
const AT_START: u32 = 1;
/// Only the cutter at the end of the move cuts in the square.
const AT_END: u32 = 2;

impl<T: Real> Planes<T> {
    fn none() -> Self {
        let zero = [T::of(0.0); LANES];
        Self { z: zero, x: zero, y: zero, away: zero, ends: [0; LANES] }
    }

    #[inline(always)]
    fn set(&mut self, lane: usize, from: &Self, from_lane: usize) {
        self.z[lane] = from.z[from_lane];
        self.x[lane] = from.x[from_lane];
        self.y[lane] = from.y[from_lane];
    }

    /// Heights at the corners of a square, raised by a margin.
    #[inline(always)]
    fn corners(&self, lane: usize, square: &Square<T>, margin: T) -> [T; 4] {
        let (dx, dy) = (self.x[lane] * square.half_x, self.y[lane] * square.half_y);
        let z = self.z[lane] + margin;
        [z - dx - dy, z + dx - dy, z - dx + dy, z + dx + dy]
    }
}

struct Worker<'a, 'b, T, S> {
    job: &'a Job<'a>,
    sweep: S,
    grid: &'a Grid,
    tile: &'a mut TileCells<'b>,
    frame: Frame,
    /// Places of the cells of a leaf from its first one, and those of a part of a leaf.
    cells: [[T; LEAF_CELLS]; 2],
    part_cells: [[T; PART_CELLS]; 2],
    /// The highest stock in each leaf.
    tops: Vec<f32>,
    /// The moves left at each level of squares.
    levels: Vec<MoveList<T>>,
    planes: Vec<Planes<T>>,
    /// Those of the moves that are kept, if they are few.
    kept_planes: [Planes<T>; MOST_JUDGES / LANES],
    work: Work,
}

/// A square of cells: its middle in the tile's frame, and the distance from there to its outermost
/// cell centres.
#[derive(Clone, Copy)]
struct Square<T> {
    x: T,
    y: T,
    half_x: T,
    half_y: T,
}

impl<T: Real, S: Sweep<T>> Worker<'_, '_, T, S> {
    /// The cells of a square inside the tile.
    #[inline(always)]
    fn square_at(&self, i: usize, j: usize, nx: usize, ny: usize) -> Square<T> {
        let centre = |first: f64, n: usize| first + 0.5 * (n - 1) as f64 * self.grid.cell;
        let low = self.grid.centre(self.tile.i0 + i, self.tile.j0 + j);
        let half = |n: usize| T::of(0.5 * (n - 1) as f64 * self.grid.cell);
        Square {
            x: T::of(centre(low.x, nx) - self.frame.x),
            y: T::of(centre(low.y, ny) - self.frame.y),
            half_x: half(nx),
            half_y: half(ny),
        }
    }

    /// Cuts the square of `side` cells at `(i, j)` of the tile with the moves of a level.
    #[inline(always)]
    fn square(&mut self, level: usize, i: usize, j: usize, side: usize) {
        // A recursion that is all inlined: an explicit stack of squares.
        let mut waiting = [(0usize, 0usize, 0usize, 0usize); 64];
        waiting[0] = (level, i, j, side);
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let (level, i, j, side) = waiting[count];
            let (width, height) = (self.tile.nx(), self.tile.rows.len());
            if i >= width || j >= height {
                continue;
            }
            let (nx, ny) = (side.min(width - i), side.min(height - j));
            if level + 1 == self.levels.len() {
                self.levels.push(MoveList::new());
            }
            // So few cost less at every cell than telling them apart.
            let level = if self.levels[level].len() <= FEW {
                level
            } else {
                self.keep(level, i, j, nx, ny);
                level + 1
            };
            if self.levels[level].len() == 0 {
                for (_, cut_by) in &mut self.tile.rows[j..j + ny] {
                    cut_by[i..i + nx].fill(NOT_CUT);
                }
            } else if side == PART {
                self.leaf::<PART, PART_CELLS>(self.part_cells, level, [i, j], [nx, ny]);
            } else if side == LEAF && self.levels[level].len() <= CROWDED {
                self.leaf::<LEAF, LEAF_CELLS>(self.cells, level, [i, j], [nx, ny]);
            } else {
                let half = side / 2;
                for (di, dj) in [(half, half), (0, half), (half, 0), (0, 0)] {
                    waiting[count] = (level, i + di, j + dj, half);
                    count += 1;
                }
            }
        }
    }

    /// Leaves in the level below those of the level's moves that may be lowest somewhere in the
    /// square.
    #[inline(always)]
    fn keep(&mut self, level: usize, i: usize, j: usize, nx: usize, ny: usize) {
        let square = self.square_at(i, j, nx, ny);
        let stock = self.stock_top(i, j, nx, ny);
        let (above, below) = self.levels.split_at_mut(level + 1);
        let (all, kept) = (&above[level], &mut below[0]);
        kept.clear();
        self.work.tests += all.len() as u64;
        if self.planes.len() < all.chunks().len() {
            self.planes.resize(all.chunks().len(), Planes::none());
        }
        let half_diagonal = (square.half_x * square.half_x + square.half_y * square.half_y).sqrt();
        let (reach, within) = (self.sweep.radius() + half_diagonal, self.sweep.radius() - half_diagonal);
        let reach2 = reach * reach;
        // Moves that pass all of the square can judge others.
        let covers = if within > T::of(0.0) { within * within } else { T::of(-1.0) };
        let infinite = T::of(f64::INFINITY);
        let (mut least, mut best) = (infinite, usize::MAX);
        for (k, (chunk, planes)) in all.chunks().iter().zip(&mut self.planes).enumerate() {
            *planes = planes_of(&self.sweep, chunk, &square);
            let mut judges = [infinite; LANES];
            for lane in 0..LANES {
                let may = !chunk.name(lane).bound_only() & (planes.away[lane] <= covers);
                judges[lane] = if may { planes.z[lane] } else { infinite };
            }
            let (lowest, lane) = least_of(&judges);
            if lowest < least {
                (least, best) = (lowest, k * LANES + lane);
            }
        }
        let ceiling = if least < infinite {
            corners_of_one(&self.sweep, &all.get(best).0, &square)
        } else {
            [infinite; 4]
        };
        let margin = T::of(self.job.margin);
        for (k, (chunk, planes)) in all.chunks().iter().zip(&self.planes).enumerate() {
            let mut keep = [0u32; LANES];
            for lane in 0..LANES {
                let corners = planes.corners(lane, &square, margin);
                let above = at_or_above(corners, ceiling);
                let lowest = corners[0].smaller(corners[1]).smaller(corners[2].smaller(corners[3]));
                keep[lane] = u32::from(!above & (lowest < stock) & (planes.away[lane] <= reach2));
            }
            let valid = (all.len() - k * LANES).min(LANES);
            let mut wanted = bits(&keep) & (u32::MAX >> (32 - valid));
            if best / LANES == k {
                wanted |= 1 << (best % LANES);
            }
            while wanted != 0 {
                let lane = wanted.trailing_zeros() as usize;
                wanted &= wanted - 1;
                let place = k * LANES + lane;
                if place != best && is_covered(all, &self.planes, place) {
                    continue;
                }
                if kept.len() < MOST_JUDGES {
                    self.kept_planes[kept.len() / LANES].set(kept.len() % LANES, planes, lane);
                }
                kept.push(&chunk.lane(lane), chunk.name(lane));
            }
        }
        if (FEW + 1..=MOST_JUDGES).contains(&kept.len()) {
            judge(&self.sweep, kept, &self.kept_planes, &square, margin);
        }
        kept.seal();
    }

    /// The highest stock in the square.
    #[inline(always)]
    fn stock_top(&self, i: usize, j: usize, nx: usize, ny: usize) -> T {
        let mut top = f32::NEG_INFINITY;
        for row in self.tops.chunks_exact(self.job.side / LEAF).skip(j / LEAF).take(ny.div_ceil(LEAF)) {
            for &height in row.iter().skip(i / LEAF).take(nx.div_ceil(LEAF)) {
                top = if height > top { height } else { top };
            }
        }
        T::of(f64::from(top) - self.frame.z)
    }

    /// Cuts the cells of a leaf of `N` × `N` = `CELLS` cells with all moves of a level.
    #[inline(always)]
    fn leaf<const N: usize, const CELLS: usize>(
        &mut self,
        [x, y]: [[T; CELLS]; 2],
        level: usize,
        [i, j]: [usize; 2],
        [nx, ny]: [usize; 2],
    ) {
        let infinite = T::of(f64::INFINITY);
        let first = self.square_at(i, j, 1, 1);
        let mut height = [infinite; CELLS];
        let mut doubt = [infinite; CELLS];
        let mut by = [NOT_CUT; CELLS];
        let moves = &self.levels[level];
        self.work.evaluations += (moves.len() * nx * ny) as u64;
        let mut second_look = false;
        for k in 0..moves.len() {
            let (m, name) = moves.get(k);
            second_look |= name.bound_only();
            let index = name.index();
            let (along, across) = m.along_across(first.x, first.y);
            for c in 0..CELLS {
                let a = along + (x[c] * m.ux + y[c] * m.uy);
                let w = across + (y[c] * m.ux - x[c] * m.uy);
                let (h, d) = self.sweep.height(&m, a, w);
                let lower = h < height[c];
                height[c] = if lower { h } else { height[c] };
                by[c] = if lower { index } else { by[c] };
                doubt[c] = d.smaller(doubt[c]);
            }
        }
        for c in 0..CELLS {
            second_look |= (doubt[c] <= height[c]) & (doubt[c] < infinite);
        }
        if second_look {
            self.leaf_again(level, i, j, nx, ny);
            return;
        }
        // Through arrays of a fixed length: loops over those become vector code.
        let mut stored = [f32::NEG_INFINITY; CELLS];
        for (row, (heights, _)) in self.tile.rows[j..j + ny].iter().enumerate() {
            copy_row::<N, _>(&mut stored[row * N..], &heights[i..], nx);
        }
        for c in 0..CELLS {
            let cut = (height[c].wide() + self.frame.z) as f32;
            let lower = cut < stored[c];
            stored[c] = if lower { cut } else { stored[c] };
            by[c] = if lower { by[c] } else { NOT_CUT };
        }
        for (row, (heights, cut_by)) in self.tile.rows[j..j + ny].iter_mut().enumerate() {
            copy_row::<N, _>(&mut heights[i..], &stored[row * N..], nx);
            copy_row::<N, _>(&mut cut_by[i..], &by[row * N..], nx);
        }
    }

    /// As [`Self::leaf`], by the closed forms of the reference engine in f64.
    fn leaf_again(&mut self, level: usize, i: usize, j: usize, nx: usize, ny: usize) {
        let moves = &self.levels[level];
        self.work.second_looks += (nx * ny) as u64;
        let tracks: Vec<(u32, Track)> = (0..moves.len())
            .map(|k| moves.get(k).1.index())
            .map(|index| (index, track(self.job.path, index)))
            .collect();
        for dj in 0..ny {
            for di in 0..nx {
                let p = self.grid.centre(self.tile.i0 + i + di, self.tile.j0 + j + dj);
                let mut lowest = (f64::INFINITY, NOT_CUT);
                for (index, track) in &tracks {
                    let h = swept_height(&self.job.form, track, p.x, p.y);
                    if h < lowest.0 {
                        lowest = (h, *index);
                    }
                }
                let (heights, cut_by) = &mut self.tile.rows[j + dj];
                let h = lowest.0 as f32;
                let lower = h < heights[i + di];
                heights[i + di] = if lower { h } else { heights[i + di] };
                cut_by[i + di] = if lower { lowest.1 } else { NOT_CUT };
            }
        }
    }
}

/// Whether the move at `place` of the list is covered by its neighbour in the program, which is in the
/// list too: where only the end of a move cuts, the next move, which begins there, cuts as low; and where
/// only its start cuts, the one before does. Of two that would cover each other the later one stays.
#[inline(always)]
fn is_covered<T: Real>(list: &MoveList<T>, planes: &[Planes<T>], place: usize) -> bool {
    let ends = |place: usize| planes[place / LANES].ends[place % LANES];
    let index = |place: usize| list.name(place).index();
    let (own, here) = (ends(place), index(place));
    if own & AT_END != 0 && place + 1 < list.len() && index(place + 1) == here + 1 {
        return true;
    }
    own & AT_START != 0 && place > 0 && index(place - 1) + 1 == here && ends(place - 1) & AT_END == 0
}

#[inline(always)]
fn at_or_above<T: Real>(a: [T; 4], b: [T; 4]) -> bool {
    (a[0] >= b[0]) & (a[1] >= b[1]) & (a[2] >= b[2]) & (a[3] >= b[3])
}

/// Compares few moves each with each and leaves those that none of the others makes useless.
#[inline(always)]
fn judge<T: Real, S: Sweep<T>>(
    sweep: &S,
    kept: &mut MoveList<T>,
    planes: &[Planes<T>; MOST_JUDGES / LANES],
    square: &Square<T>,
    margin: T,
) {
    const CHUNKS: usize = MOST_JUDGES / LANES;
    let zero = [[T::of(0.0); LANES]; 4];
    let (mut floor, mut height) = ([zero; CHUNKS], [zero; CHUNKS]);
    let mut useless = [[0u32; LANES]; CHUNKS];
    for (k, chunk) in kept.chunks().iter().enumerate() {
        for lane in 0..LANES {
            let floors = planes[k].corners(lane, square, margin);
            let heights = corners(sweep, &chunk.lane(lane), square);
            let unsure = chunk.name(lane).bound_only();
            for c in 0..4 {
                floor[k][c][lane] = floors[c];
                height[k][c][lane] = if unsure { T::of(f64::INFINITY) } else { heights[c] };
            }
        }
    }
    for b in 0..kept.len() {
        let (chunk, lane) = (b / LANES, b % LANES);
        // One that is useless itself lies above another that judges as strictly.
        if useless[chunk][lane] != 0 {
            continue;
        }
        let [h0, h1, h2, h3] = &height[chunk];
        let ceiling = [h0[lane], h1[lane], h2[lane], h3[lane]];
        for (useless, [f0, f1, f2, f3]) in useless.iter_mut().zip(&floor) {
            for lane in 0..LANES {
                let above = at_or_above([f0[lane], f1[lane], f2[lane], f3[lane]], ceiling);
                useless[lane] |= u32::from(above);
            }
        }
        useless[chunk][lane] = 0;
    }
    kept.retain(|k| useless[k / LANES][k % LANES] == 0);
}

/// The least number and its lane. By halves of fixed length, which stay in registers.
#[inline(always)]
fn least_of<T: Real>(numbers: &[T; LANES]) -> (T, usize) {
    let (mut eight, mut four, mut two) = ([numbers[0]; 8], [numbers[0]; 4], [numbers[0]; 2]);
    for k in 0..8 {
        eight[k] = numbers[k].smaller(numbers[k + 8]);
    }
    for k in 0..4 {
        four[k] = eight[k].smaller(eight[k + 4]);
    }
    for k in 0..2 {
        two[k] = four[k].smaller(four[k + 2]);
    }
    let least = two[0].smaller(two[1]);
    let mut lanes = [0u32; LANES];
    for lane in 0..LANES {
        lanes[lane] = u32::from(numbers[lane] <= least);
    }
    (least, bits(&lanes).trailing_zeros() as usize % LANES)
}

/// One bit for each lane that is not zero.
#[inline(always)]
fn bits(lanes: &[u32; LANES]) -> u32 {
    let mut bits = 0;
    for lane in 0..LANES {
        bits |= lanes[lane] << lane;
    }
    bits
}

#[inline(always)]
fn planes_of<T: Real, S: Sweep<T>>(sweep: &S, chunk: &Chunk<T>, square: &Square<T>) -> Planes<T> {
    let mut planes = Planes::none();
    for lane in 0..LANES {
        let m = chunk.lane(lane);
        let (along, across) = m.along_across(square.x, square.y);
        let plane = sweep.plane(&m, along, across);
        planes.z[lane] = plane.z;
        planes.x[lane] = plane.along * m.ux - plane.across * m.uy;
        planes.y[lane] = plane.along * m.uy + plane.across * m.ux;
        let ahead = along - along.larger(m.low).smaller(m.high);
        planes.away[lane] = ahead * ahead + across * across;
        let half_along = square.half_x * m.ux.absolute() + square.half_y * m.uy.absolute();
        let half_across = square.half_x * m.uy.absolute() + square.half_y * m.ux.absolute();
        let (lower, upper) =
            sweep.beyond(&m, [along - half_along, along + half_along], across.absolute() + half_across);
        let name = chunk.name(lane);
        let (start, end) = if name.falling() { (upper, lower) } else { (lower, upper) };
        let ends = u32::from(start) * AT_START + u32::from(end) * AT_END;
        // A plunge has both ends in one place, and only the lower one cuts.
        planes.ends[lane] = if name.bound_only() | (m.low >= m.high) { 0 } else { ends };
    }
    planes
}

/// Heights of a move at the corners of a square, infinite where they are not known for sure.
#[inline(always)]
fn corners<T: Real, S: Sweep<T>>(sweep: &S, m: &LocalMove<T>, square: &Square<T>) -> [T; 4] {
    let (x0, x1) = (square.x - square.half_x, square.x + square.half_x);
    let (y0, y1) = (square.y - square.half_y, square.y + square.half_y);
    [
        sure_height(sweep, m, x0, y0),
        sure_height(sweep, m, x1, y0),
        sure_height(sweep, m, x0, y1),
        sure_height(sweep, m, x1, y1),
    ]
}

/// As [`corners`] of a single move. Most lanes work in vain, but all at the same time.
#[inline(always)]
fn corners_of_one<T: Real, S: Sweep<T>>(sweep: &S, m: &LocalMove<T>, square: &Square<T>) -> [T; 4] {
    let mut x = [square.x - square.half_x; LANES];
    let mut y = [square.y - square.half_y; LANES];
    (x[1], x[3]) = (square.x + square.half_x, square.x + square.half_x);
    (y[2], y[3]) = (square.y + square.half_y, square.y + square.half_y);
    let mut heights = [T::of(0.0); LANES];
    for lane in 0..LANES {
        heights[lane] = sure_height(sweep, m, x[lane], y[lane]);
    }
    [heights[0], heights[1], heights[2], heights[3]]
}

#[inline(always)]
fn sure_height<T: Real, S: Sweep<T>>(sweep: &S, m: &LocalMove<T>, x: T, y: T) -> T {
    let (along, across) = m.along_across(x, y);
    let (height, doubt) = sweep.height(m, along, across);
    let infinite = T::of(f64::INFINITY);
    // NaN is not below.
    if (height < infinite) & (doubt >= infinite) { height } else { infinite }
}

/// The first `n` cells of a row of a leaf; nearly always all of them, in one move.
#[inline(always)]
fn copy_row<const N: usize, V: Copy>(to: &mut [V], from: &[V], n: usize) {
    match (n, to.first_chunk_mut::<N>(), from.first_chunk::<N>()) {
        (n, Some(to), Some(from)) if n == N => *to = *from,
        _ => to[..n].copy_from_slice(&from[..n]),
    }
}
