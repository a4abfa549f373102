//! The cells over which something may stand above a height, also between their centres.
//!
//! Enters: a cut surface over its grid, and the part. Leaves: for each cell whether anything in its square
//! may stand higher; where nothing is said to, that is proven. mm.

use std::collections::BinaryHeap;
use std::sync::atomic::Ordering;

use super::patch::Held;
use super::{ExcessSearch, beside_part};
use crate::closer::Square;
use crate::cut_surface::CutSurface;
use crate::engines::Task;
use crate::every_move::EveryMove;
use crate::inspection::{Inspection, Sample};
use crate::measure::{up_to, walls_of};
use crate::meetings::Meetings;
use crate::ridge_map::on_cells;
use sim::{CutError, Envelope, ZMap};
use work::monitor::{self, Cancelled, Monitor};

/// How often a cell is divided before it counts as one over which more may stand.
const DIVISIONS: i32 = 6;

/// Squares of one cell that are looked at. With fewer, more cells count without need.
const MOST_LOOKS: usize = 64;

/// Whether more than `height`, mm, may stand over each cell of `cut`, which is what the path of a task left,
/// `[ny][nx]`. Faces that are measured along their normals count as far as cells see them.
///
/// # Errors
/// [`CutError::Cancelled`] when the monitor says so.
pub fn cells_above(
    task: &Task<'_>,
    cut: &ZMap,
    height: f64,
    monitor: &dyn Monitor,
) -> Result<Vec<bool>, CutError> {
    let Task { part, cutters, path, limits, .. } = *task;
    let surface = CutSurface::new(Envelope::new(cutters, path), cut, path);
    let facing = task.measures_walls().then(|| task.facing());
    let facing = facing.as_ref();
    let asked = task.simulation.error_bound;
    let walls = walls_of(part, cutters, path, (&surface, limits, asked), facing, monitor)?;
    let meetings = Meetings::new(&surface, cutters, path, None);
    let inspection = Inspection {
        walls: walls.as_ref(),
        every_move: Some(&EveryMove::new(&surface, cutters, &up_to(part, cut.top))),
        ..on_cells(part, cutters, limits, asked, &surface, &meetings)
    };
    let samples = inspection.samples(monitor)?;
    let search = ExcessSearch { inspection: &inspection };
    Ok(search.cells_above(&samples, height, monitor)?)
}

impl ExcessSearch<'_> {
    fn cells_above(
        &self,
        samples: &[Sample],
        height: f64,
        monitor: &dyn Monitor,
    ) -> Result<Vec<bool>, Cancelled> {
        let grid = &self.inspection.grid;
        monitor.start("looking for what is left", 0);
        let fine = self.finer_than_cells(grid);
        let row = |j: usize| {
            monitor::check(monitor)?;
            let stands = |i: usize| {
                let (k, half) = (grid.index(i, j), 0.5 * grid.cell);
                let Sample { deviation, top, .. } = samples[k];
                let is_off = deviation.is_nan();
                let may_hold =
                    if is_off { beside_part(grid, samples, i, j) } else { f64::from(top) > height };
                let whole = Square { possible: f64::INFINITY, centre: grid.centre(i, j), half };
                f64::from(deviation) > height
                    || (may_hold || fine[k].load(Ordering::Relaxed)) && self.may_stand(whole, height)
            };
            Ok((0..grid.nx).map(stands).collect::<Vec<_>>())
        };
        Ok(work::parallel::try_map(grid.ny, row)?.concat())
    }

    /// Whether more than a height, mm, stands somewhere over a square, or is not shown not to.
    fn may_stand(&self, whole: Square, height: f64) -> bool {
        let patches = self.patches(height, &[]);
        let smallest = 0.5f64.powi(DIVISIONS) * whole.half;
        let mut waiting = BinaryHeap::from([whole]);
        for _ in 0..MOST_LOOKS {
            let Some(Square { centre, half, .. }) = waiting.pop() else { return false };
            let possible = match patches.held(centre, half) {
                Held::Nothing => continue,
                Held::Unknown => patches.most(),
                Held::Some { place, here, .. } if here > height && !self.is_foil(place, here) => return true,
                Held::Some { possible, .. } => possible,
            };
            if possible > height {
                if half <= smallest {
                    return true;
                }
                waiting.extend(Square { possible, centre, half }.quarters());
            }
        }
        !waiting.is_empty()
    }
}
