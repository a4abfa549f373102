//! The z-map engine: the lower envelope of all swept moves by branch and bound. mm, z up.
//!
//! Enters: stock, cutter, path. Leaves: the stock after the whole path, as exact as that of
//! [`cut_reference`](crate::cut_reference)(super::cut_reference) to 0.01 µm, in a small share of its time.
//!
//! Tiles of the grid, one worker each, hold the moves that can reach them and are divided like a quadtree,
//! down to leaves of 8 × 8 cells. At every square moves are dropped that cannot be lowest anywhere in it, so
//! that few are left in a leaf; those are evaluated in closed form at every cell.
//!
//! # The bound
//! Let c be a square's corners and b a move that passes all of it. The height `h_b` is convex ([`sweep`]), so
//! inside the square it lies below the bilinear interpolation of its values at the corners, which is a convex
//! combination of them. Another move lies above any plane that touches it from below, and a plane is its own
//! bilinear interpolation. Hence, if the plane of move j lies at or above `h_b` at the four corners, j lies
//! at or above b in all of the square, and can go. The same holds with the level of the stock in place of b.
//! No curvature enters, and no case is left out: plunges, moves of no length and moves beside the stock have
//! convex heights too.
//!
//! # Choices
//! The bound serves all cutters with one engine. Where the place on the track is at the end of a move in all
//! of a square, the neighbour in the program cuts as low, and the move goes too: short chords cost little
//! more than long ones.
//!
//! Heights in a leaf are f32 in coordinates of the tile. Where their rounding matters (walls, rims, steep
//! tracks, unsettled places on a torus) the leaf is worked out again in f64. Deep tiles and large cutters are
//! cut in f64 throughout. Barrels, whose place on the track has no closed form, go through
//! [`cut_reference`](crate::cut_reference)(super::cut_reference).

mod choose;
mod leaf;
mod local;
#[cfg(test)]
mod tests;

use super::bins::MoveBins;
use super::form::{Family, Form};
use super::sweep::{Ball, Flat, LocalMove, Rounded, Sweep};
use super::tiles::{TileCells, tiles};
use super::track::Track;
use super::{CutError, Grid, NOT_CUT, ZMap};
use crate::reference::reference;
use crate::sweep;
use choose::{Chooser, FEW, SQUARES, Square, ones};
use cutter::Cutter;
use geometry::Point3;
use local::{Chunk, Frame, MoveList, Name};
use motion::Toolpath;
use work::lanes::{self, Real};
use work::monitor::{Cancelled, Monitor, check};
use work::parallel;

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

/// The same where no bound is used: fewer cells see a move in vain.
const CANDIDATES_TILE: usize = 64;

/// Side of a tile in cutter radii, about. In larger ones many moves are carried down a level in vain; in
/// smaller ones a move is listed in many tiles.
const TILE_RADII: f64 = 2.2;

/// Greatest height of stock above the lowest tip in a tile, mm, for which f32 is used: there half a unit in
/// the last place is 1e-6 mm, and a height is rounded a few times. Deeper tiles are cut in f64.
const DEEPEST: f64 = 32.0;

/// Cuts `stock` along every move of `path`, rapids included, in place: the height of a cell becomes the least
/// of the stock and of all moves, and `cut_by` names a move that reaches down to it ([`NOT_CUT`] where the
/// stored height stays that of the stock).
///
/// # Errors
/// [`CutError::Path`] where the path is no path of upright tools; [`CutError::Cancelled`] when the monitor
/// says so; the stock is lost then.
///
/// # Tolerance
/// Heights lie within 1e-5 mm, or half a unit in the last place of f32 if that is more, of those of
/// [`cut_reference`](crate::cut_reference). The bits depend neither on the number of threads nor on the
/// machine's vector unit.
pub fn cut(stock: ZMap, cutter: &Cutter, path: &Toolpath, monitor: &dyn Monitor) -> Result<ZMap, CutError> {
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
) -> Result<(ZMap, Work), CutError> {
    check(monitor)?;
    path.check_upright()?;
    let form = Form::new(cutter);
    // The place of a barrel on its track has no closed form here.
    if path.len() > Name::MOST || form.profile.centre_x < 0.0 {
        return Ok((reference(&stock, cutter, path, monitor)?, Work::default()));
    }
    let side = tile_side(form.radius, stock.grid.cell);
    UnorderedCut { form, path, side, bounded: true, margin: 0.0 }.run(stock, monitor).map_err(CutError::from)
}

/// As [`cut_counted`] without any bound: every move that reaches a tile is evaluated at each of its cells,
/// by the same closed forms and vectors. What the bounds are measured against.
///
/// # Errors
/// As [`cut`].
#[doc(hidden)]
pub fn cut_all_candidates(
    stock: ZMap,
    cutter: &Cutter,
    path: &Toolpath,
    monitor: &dyn Monitor,
) -> Result<(ZMap, Work), CutError> {
    path.check_upright()?;
    let form = Form::new(cutter);
    let side = tile_side(form.radius, stock.grid.cell).min(CANDIDATES_TILE);
    UnorderedCut { form, path, side, bounded: false, margin: 0.0 }.run(stock, monitor).map_err(CutError::from)
}

fn tile_side(radius: f64, cell: f64) -> usize {
    let leaves = TILE_RADII * radius / (cell * LEAF as f64);
    let mut side = LEAF;
    while side < LARGEST_TILE && (2 * side) as f64 <= leaves * LEAF as f64 {
        side *= 2;
    }
    side
}

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

struct UnorderedCut<'a> {
    form: Form,
    path: &'a Toolpath,
    side: usize,
    /// Whether squares drop moves.
    bounded: bool,
    /// Added to every bound: 0 but in tests.
    margin: f64,
}

impl UnorderedCut<'_> {
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

    /// The tip's places where a move starts and ends.
    fn ends(&self, k: u32) -> (Point3, Point3) {
        (self.path.start_of(k as usize), self.path.moves[k as usize].to.tip)
    }

    fn cut_tile(&self, grid: &Grid, cells: &mut TileCells<'_>, moves: &[u32]) -> Work {
        let (radius, half) = (self.form.radius, 0.5 * (self.side as f64) * grid.cell);
        let extent = radius + half * std::f64::consts::SQRT_2;
        let low = grid.centre(cells.i0, cells.j0);
        let high = grid.centre(cells.i0 + cells.nx() - 1, cells.j0 + cells.rows.len() - 1);
        let (x, y) = (0.5 * (low.x + high.x), 0.5 * (low.y + high.y));
        let tracks: Vec<(Track, bool)> = moves
            .iter()
            .map(|&k| {
                let (from, to) = self.ends(k);
                (Track::new(from, to), Track::falls(from, to))
            })
            .collect();
        let lowest_tip = |(track, _): &(Track, bool)| {
            let (along, _) = track.along_across(x, y);
            track.tip((along - extent).max(0.0).min(track.length))
        };
        let z = tracks.iter().map(lowest_tip).fold(f64::INFINITY, f64::min);
        // A height in f32 that is known to f32, so that heights are added to it in one rounding.
        let z = f64::from(if z.is_finite() { z as f32 } else { 0.0 });
        let frame = Frame { x, y, z, reach: 2.0 * extent };
        // As long as no leaf says otherwise; and what leaves find in the cache they write sooner.
        for (_, cut_by) in &mut cells.rows {
            cut_by.fill(NOT_CUT);
        }
        let tops = lanes::dispatch(
            #[inline(always)]
            || leaf_tops(cells, self.side),
        );
        let top = tops.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let shallow = f64::from(top) - frame.z <= DEEPEST;
        let (form, blur) = (&self.form, sweep::blur(extent));
        let share = sweep::rim_share(extent).filter(|_| shallow);
        let tile = TileTask { cells, moves, tracks: &tracks, frame, tops };
        match (form.family, share) {
            (Family::Ball, Some(share)) => self.cut_with::<f32, _>(Ball::new(radius, share), grid, tile),
            (Family::Ball, None) => self.cut_with::<f64, _>(Ball::new(radius, 0.0), grid, tile),
            (Family::Flat, Some(_)) => self.cut_with::<f32, _>(Flat::new(radius, blur), grid, tile),
            (Family::Flat, None) => self.cut_with::<f64, _>(Flat::new(radius, 0.0), grid, tile),
            (Family::Rounded, Some(_)) if form.has_cones() => {
                self.cut_with::<f32, _>(Rounded::<_, true>::new(form, blur), grid, tile)
            }
            (Family::Rounded, Some(_)) => {
                self.cut_with::<f32, _>(Rounded::<_, false>::new(form, blur), grid, tile)
            }
            (Family::Rounded, None) => {
                self.cut_with::<f64, _>(Rounded::<_, true>::new(form, 0.0), grid, tile)
            }
        }
    }

    /// Plain code that goes from square to square. Vector code begins below it, where a call costs little
    /// beside the work: at each leaf and at each choice ([`lanes::dispatch`]).
    fn cut_with<T: Real, S: Sweep<T>>(&self, sweep: S, grid: &Grid, tile: TileTask<'_, '_>) -> Work {
        let TileTask { cells: tile, moves, tracks, frame, tops } = tile;
        let mut levels = vec![Level::new()];
        levels[0].moves.reset(moves.len());
        for (n, (&k, (track, falling))) in moves.iter().zip(tracks).enumerate() {
            let (local, bound_only) = LocalMove::new(track, &frame);
            levels[0].moves.put(n, &local, Name::new(k, bound_only, *falling));
        }
        let mut worker = Worker {
            job: self,
            sweep,
            grid,
            tile,
            frame,
            cells: &offsets(LEAF, grid.cell),
            part_cells: &offsets(PART, grid.cell),
            tops,
            levels,
            chooser: Chooser::new(),
            work: Work::default(),
        };
        worker.whole(self.side);
        worker.work
    }
}

/// What a tile is cut with.
struct TileTask<'a, 'b> {
    cells: &'a mut TileCells<'b>,
    moves: &'a [u32],
    /// Those of the moves, and whether they are passed downwards.
    tracks: &'a [(Track, bool)],
    frame: Frame,
    /// The highest stock in each leaf.
    tops: Vec<f32>,
}

/// The highest height in each leaf of a tile, `[side / LEAF][side / LEAF]`.
#[inline(always)]
fn leaf_tops(tile: &TileCells<'_>, side: usize) -> Vec<f32> {
    let leaves = side / LEAF;
    let mut tops = vec![f32::NEG_INFINITY; leaves * leaves];
    let mut columns = vec![f32::NEG_INFINITY; side];
    for (tops, rows) in tops.chunks_mut(leaves).zip(tile.rows.chunks(LEAF)) {
        columns.fill(f32::NEG_INFINITY);
        for (heights, _) in rows {
            for (column, &height) in columns.iter_mut().zip(heights.iter()) {
                *column = height.larger(*column);
            }
        }
        for (top, columns) in tops.iter_mut().zip(columns.chunks_exact(LEAF)) {
            for &column in columns {
                *top = column.larger(*top);
            }
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

/// The moves of a square, and what the quarters of it chose from them.
struct Level<T> {
    moves: MoveList<T>,
    /// For each chunk and quarter one bit for each lane.
    chosen: Vec<[u32; SQUARES]>,
    /// How many moves each quarter chose.
    kept: [usize; SQUARES],
}

impl<T: Real> Level<T> {
    fn new() -> Self {
        Self { moves: MoveList::new(), chosen: Vec::new(), kept: [0; SQUARES] }
    }

    /// The moves that a quarter chose: chunks and lanes.
    #[inline(always)]
    fn chosen_by(&self, q: usize) -> impl Iterator<Item = (&Chunk<T>, usize)> {
        let chunks = self.moves.chunks().iter().zip(&self.chosen);
        chunks.flat_map(move |(chunk, chosen)| ones(chosen[q]).map(move |lane| (chunk, lane)))
    }
}

struct Worker<'a, 'b, T, S> {
    job: &'a UnorderedCut<'a>,
    sweep: S,
    grid: &'a Grid,
    tile: &'a mut TileCells<'b>,
    frame: Frame,
    /// Places of the cells of a leaf from its first one, and those of a part of a leaf.
    cells: &'a [[T; LEAF_CELLS]; 2],
    part_cells: &'a [[T; PART_CELLS]; 2],
    /// The highest stock in each leaf.
    tops: Vec<f32>,
    /// The moves left at each level of squares.
    levels: Vec<Level<T>>,
    chooser: Chooser<T>,
    work: Work,
}

impl<T: Real, S: Sweep<T>> Worker<'_, '_, T, S> {
    /// The cells of a square inside the tile.
    #[inline(always)]
    fn square_at(&self, [i, j]: [usize; 2], [nx, ny]: [usize; 2]) -> Square<T> {
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

    /// Cuts all of the tile with the moves of the first level.
    fn whole(&mut self, side: usize) {
        if !self.job.bounded {
            self.choose_all(0);
            for at in (0..side * side / LEAF_CELLS).map(|k| [k % (side / LEAF), k / (side / LEAF)]) {
                let at = at.map(|k| k * LEAF);
                if let Some(size) = self.inside(at, LEAF) {
                    self.leaf::<LEAF, LEAF_CELLS>(self.cells, [0, 0], at, size);
                }
            }
            return;
        }
        self.choose::<1>(0, [[0, 0]], side);
        // A stack of squares, each with the level whose moves it chose from and its place among the squares
        // that chose together.
        let mut waiting = [(0usize, 0usize, [0usize; 2], 0usize); 64];
        waiting[0] = (0, 0, [0, 0], side);
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let (level, q, [i, j], side) = waiting[count];
            let Some([nx, ny]) = self.inside([i, j], side) else { continue };
            let kept = self.levels[level].kept[q];
            if kept == 0 {
                continue;
            }
            if side == PART {
                self.leaf::<PART, PART_CELLS>(self.part_cells, [level, q], [i, j], [nx, ny]);
            } else if side == LEAF && kept <= CROWDED {
                self.leaf::<LEAF, LEAF_CELLS>(self.cells, [level, q], [i, j], [nx, ny]);
            } else {
                self.hand_down(level, q);
                let half = side / 2;
                let quarters = [[i, j], [i + half, j], [i, j + half], [i + half, j + half]];
                self.choose(level + 1, quarters, half);
                for (q, &at) in quarters.iter().enumerate() {
                    waiting[count] = (level + 1, q, at, half);
                    count += 1;
                }
            }
        }
    }

    /// The cells that a square has inside the tile, if any.
    #[inline(always)]
    fn inside(&self, [i, j]: [usize; 2], side: usize) -> Option<[usize; 2]> {
        let (width, height) = (self.tile.nx(), self.tile.rows.len());
        (i < width && j < height).then(|| [side.min(width - i), side.min(height - j)])
    }

    /// Marks for each of some squares those of the level's moves that may be lowest somewhere in it.
    fn choose<const Q: usize>(&mut self, level: usize, squares: [[usize; 2]; Q], side: usize) {
        if self.levels[level].moves.len() <= FEW {
            // So few cost less at every cell than telling them apart.
            self.choose_all(level);
            return;
        }
        lanes::dispatch(
            #[inline(always)]
            || self.choose_among_many(level, squares, side),
        );
    }

    #[inline(always)]
    fn choose_among_many<const Q: usize>(&mut self, level: usize, squares: [[usize; 2]; Q], side: usize) {
        let Some(first) = self.inside(squares[0], side) else { return };
        // Squares outside choose as the first one does, which always has cells, and are left out later.
        let first = self.square_at(squares[0], first);
        let (mut places, mut stocks) = ([first; Q], [T::of(f64::NEG_INFINITY); Q]);
        // No calls of `map`: what is not inlined is not vector code.
        for q in 0..Q {
            if let Some(size) = self.inside(squares[q], side) {
                (places[q], stocks[q]) = (self.square_at(squares[q], size), self.stock_top(squares[q], size));
            }
        }
        let Level { moves, chosen, kept } = &mut self.levels[level];
        let margin = T::of(self.job.margin);
        self.work.tests += (moves.len() * Q) as u64;
        // A copy, as in a leaf.
        let sweep = self.sweep;
        *kept = self.chooser.choose(&sweep, moves, &places, &stocks, margin, side > PART, chosen);
    }

    /// Marks all of the level's moves for each square.
    fn choose_all(&mut self, level: usize) {
        let Level { moves, chosen, kept } = &mut self.levels[level];
        chosen.clear();
        chosen.extend((0..moves.chunks().len()).map(|k| [moves.lanes_in_use(k); SQUARES]));
        *kept = [moves.len(); SQUARES];
    }

    /// Leaves the moves that a square chose from a level in the one below.
    fn hand_down(&mut self, level: usize, q: usize) {
        if level + 1 == self.levels.len() {
            self.levels.push(Level::new());
        }
        let (above, below) = self.levels.split_at_mut(level + 1);
        let (above, below) = (&above[level], &mut below[0].moves);
        below.reset(above.kept[q]);
        let mut n = 0;
        for (chunk, chosen) in above.moves.chunks().iter().zip(&above.chosen) {
            for lane in ones(chosen[q]) {
                below.put(n, &chunk.lane(lane), chunk.name(lane));
                n += 1;
            }
        }
    }

    /// The highest stock in the square.
    #[inline(always)]
    fn stock_top(&self, [i, j]: [usize; 2], [nx, ny]: [usize; 2]) -> T {
        let mut top = f32::NEG_INFINITY;
        for row in self.tops.chunks_exact(self.job.side / LEAF).skip(j / LEAF).take(ny.div_ceil(LEAF)) {
            for &height in row.iter().skip(i / LEAF).take(nx.div_ceil(LEAF)) {
                top = if height > top { height } else { top };
            }
        }
        T::of(f64::from(top) - self.frame.z)
    }
}
