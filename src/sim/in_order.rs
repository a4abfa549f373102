//! The engine that keeps the order of the program: what each move removes from the stock that the moves
//! before it left.
//!
//! Enters: stock, cutter, path. Leaves: the stock after the path, and for every move its volume, its
//! engagement, and where a rapid move touched stock; mm, z up.
//!
//! The grid is cut into tiles, one worker each, and a tile runs through its moves in the order of the
//! program. Over the cells of a tile stands a tree with sixteen children a node (`tile`), each with a plane
//! above all heights below it; a move descends only where a plane below its own cut reaches beneath that
//! plane (`bound`). It cuts leaves of 8 × 8 cells (`leaf`), whose heights come from the vector loops of the
//! engine without order, and from the closed forms of [`Envelope`](super::Envelope) where those leave a
//! doubt (`heights`).
//!
//! A move leaves out the places that it cuts from its very start, since the move before cut them. A torus is
//! tried first where the move ends: most cells of a short move are cut from there, and its slope bounds the
//! height of the others.
//!
//! Volumes are differences of stored heights, so that they add up to the stock removed. The bound of the
//! total is half a cell times the variation of the heights before and after.

mod bound;
mod contact;
mod heights;
mod leaf;
mod plain;
#[cfg(test)]
mod tests;
mod tile;

use super::bins::MoveBins;
use super::form::Form;
use super::tiles::{TileCells, tiles};
use super::track::Track;
use super::{CutError, Grid, NOT_CUT, ZMap};
use cutter::Cutter;
use geometry::{Point2, Point3};
use leaf::Tally;
use motion::Toolpath;
#[doc(hidden)]
pub use plain::cut_in_order_plain;
use tile::{SIDE, Tile};
use work::monitor::{Cancelled, Monitor, check};
use work::parallel;

/// A cell counts as engaged by a move that lowers it by more than this, mm. Below the rounding of a
/// stored height (0.06 µm at a metre) moves that meet on one surface would seem to cut each other's
/// work; far above it light finishing cuts would have no engagement.
pub const ENGAGED: f64 = 1.0e-4;

/// What one move removes.
///
/// # Tolerance
/// `volume` is the exact sum over the cells of what left their stored heights, so that the volumes of
/// all moves add up to the stock before less the stock after; of cells that hang over the stock's rectangle
/// ([`ZMap::within`]) what lies in it counts. As an integral over the plane it is off
/// by `volume_bound` at most, as long as what the move removes is, along each row and column of
/// cells, one piece with one summit: the sum over a row then errs by a cell times the summit.
/// `depth`, `axial` and `radial` are taken at cell centres. The true width lies within
/// `radial_bound` of `radial` where the cut ends at least a cell long in the direction of travel; a lip
/// thinner than that (such as a rising cutter leaves) passes between the centres and is not seen.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct MoveRemoval {
    /// Volume removed, mm³.
    pub volume: f64,
    /// Bound of its error, mm³.
    pub volume_bound: f64,
    /// Greatest height removed at a cell, mm. Of a short move it is less than the depth of cut, since
    /// the move before has left a slope.
    pub depth: f64,
    /// Greatest height above the tip (abeam of the place) at which the cutter met the stock that it
    /// removed, mm: the axial engagement. It does not depend on how a path is split into moves.
    pub axial: f64,
    /// Extent of the engaged cells along the plan direction of the move, mm: it is in material no longer than
    /// that and its radius. 0 of a plunge.
    pub along: f64,
    /// Extent of the engaged cells across the plan direction of the move, mm; of a plunge the greater
    /// of their extents along x and y.
    pub radial: f64,
    /// Bound of its error, mm.
    pub radial_bound: f64,
}

/// A rapid move that touched stock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RapidContact {
    /// The move, counted from 0.
    pub move_index: u32,
    /// The cell that the cutter touched first, with the height of stock there, mm.
    pub at: Point3,
    /// How far the tip had travelled by then, mm.
    pub travel: f64,
    /// Greatest height that the move removed at a cell, mm.
    pub depth: f64,
}

/// What a path removes, move by move.
#[derive(Debug, Clone, PartialEq)]
pub struct Removal {
    /// The stock after the path. `cut_by` names the last move that lowered a cell, [`NOT_CUT`] where
    /// none did.
    pub stock: ZMap,
    /// One entry a move of the path.
    pub moves: Vec<MoveRemoval>,
    /// Rapid moves that lowered a cell by more than [`ENGAGED`], in the order of the program.
    pub rapid_contacts: Vec<RapidContact>,
    /// Bound of the error of the sum of all volumes against the integral between the surfaces, mm³:
    /// half a cell times the variation of the heights before and after (the midpoint rule), as seen by
    /// the cells.
    pub volume_bound: f64,
}

impl Removal {
    /// Volume removed by all moves, mm³.
    pub fn volume(&self) -> f64 {
        self.moves.iter().map(|m| m.volume).sum()
    }
}

/// Cuts `stock` in place along every move of `path`, rapids included, in the order of the program, and says
/// what each move removed. The stock that is left can be handed to the next cutter.
///
/// # Errors
/// [`CutError::Path`] where the path is no path of upright tools; [`CutError::Cancelled`] when the monitor
/// says so.
///
/// # Tolerance
/// Heights are those of [`cut_reference`](super::cut_reference) to one unit in the last place of f32 (the
/// order of moves changes no height), except that a cell whose centre lies on the rim of the cutter to the
/// last bits may be cut or not. The bits depend neither on the number of threads nor on the machine's vector
/// unit.
///
/// # Cost
/// Beside the stock 64 bytes for each move in each tile of 128 × 128 cells that it cuts in, and 48 a move.
pub fn cut_in_order(
    stock: ZMap,
    cutter: &Cutter,
    path: &Toolpath,
    monitor: &dyn Monitor,
) -> Result<Removal, CutError> {
    cut_by_tiles(stock, cutter, path, monitor, SIDE, |job, cells, moves| {
        Tile::load(cells, job).cut(job, cells, moves)
    })
}

/// What all tiles of a cut share.
struct OrderedCut<'a> {
    /// Side of a cell, mm.
    cell: f64,
    grid: Grid,
    within: Option<[Point2; 2]>,
    form: Form,
    path: &'a Toolpath,
    monitor: &'a dyn Monitor,
}

impl OrderedCut<'_> {
    /// The share of a cell along an axis that the stock's rectangle holds.
    fn share(&self, axis: usize, centre: f64) -> f64 {
        let breadth =
            |[low, high]: [Point2; 2]| self.grid.breadth(centre, [low[axis], high[axis]]) / self.cell;
        self.within.map_or(1.0, breadth)
    }

    fn track(&self, index: u32) -> Track {
        let k = index as usize;
        Track::new(self.path.start_of(k), self.path.moves[k].to.tip)
    }
}

/// What the moves of one tile removed, in the order of the program.
#[derive(Default)]
struct TileRecord {
    tallies: Vec<(u32, Tally)>,
    contacts: Vec<RapidContact>,
}

/// Deals the map out to tiles, has each cut, and joins what they found in the order of the tiles.
fn cut_by_tiles(
    mut stock: ZMap,
    cutter: &Cutter,
    path: &Toolpath,
    monitor: &dyn Monitor,
    side: usize,
    cut: impl Fn(&OrderedCut, &mut TileCells, &[u32]) -> Result<TileRecord, Cancelled> + Sync + Send,
) -> Result<Removal, CutError> {
    check(monitor)?;
    path.check_upright()?;
    let (grid, within) = (stock.grid, stock.within);
    let job = OrderedCut { cell: grid.cell, grid, within, form: Form::new(cutter), path, monitor };
    let bins = MoveBins::new(&stock.grid, side, job.form.radius, path);
    monitor.start("cutting in order", (bins.nx() * bins.ny()) as u64);
    let before = variation(&stock);
    stock.cut_by.fill(NOT_CUT);
    let mut tiles: Vec<(TileCells, TileRecord)> =
        tiles(&mut stock, side).into_iter().map(|cells| (cells, TileRecord::default())).collect();
    parallel::try_for_each(&mut tiles, |k, (cells, found)| {
        check(monitor)?;
        let moves = bins.of_bin(k % bins.nx(), k / bins.nx());
        if !moves.is_empty() {
            *found = cut(&job, cells, moves)?;
        }
        monitor.advance(1);
        Ok::<(), Cancelled>(())
    })?;
    let found: Vec<TileRecord> = tiles.into_iter().map(|(_, found)| found).collect();
    let (moves, rapid_contacts) = join(found, &job, stock.grid.cell);
    let volume_bound = 0.5 * stock.grid.cell.powi(2) * (before + variation(&stock));
    Ok(Removal { stock, moves, rapid_contacts, volume_bound })
}

/// Sum over all pairs of neighbours of the difference of their heights, mm.
fn variation(map: &ZMap) -> f64 {
    let nx = map.grid.nx;
    let rows = parallel::map(map.grid.ny, |j| {
        let row = &map.height[j * nx..(j + 1) * nx];
        let step = |(a, b): (&f32, &f32)| f64::from((a - b).abs());
        let along: f64 = row.iter().zip(&row[1..]).map(step).sum();
        let across: f64 = row.iter().zip(&map.height[(j + 1) * nx..]).map(step).sum();
        along + across
    });
    rows.into_iter().sum()
}

fn join(found: Vec<TileRecord>, job: &OrderedCut, cell: f64) -> (Vec<MoveRemoval>, Vec<RapidContact>) {
    let mut tallies = vec![Tally::NOTHING; job.path.len()];
    let mut contacts: Vec<RapidContact> = Vec::new();
    for tile in found {
        for (index, tally) in &tile.tallies {
            tallies[*index as usize].add(tally);
        }
        contacts.extend(tile.contacts);
    }
    // Stable: where two tiles are touched at the same time the first of them names the place.
    contacts.sort_by(|a, b| a.move_index.cmp(&b.move_index).then(a.travel.total_cmp(&b.travel)));
    contacts.dedup_by_key(|contact| contact.move_index);
    for contact in &mut contacts {
        contact.depth = tallies[contact.move_index as usize].depth;
    }
    let removal = |k: usize| tallies[k].removal(&job.track(k as u32), cell);
    (parallel::map(tallies.len(), removal), contacts)
}
