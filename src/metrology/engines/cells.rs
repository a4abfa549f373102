//! Engines on cells over the plan view, for upright cutters.

use std::time::Instant;

use sim::{CutHeights, ZMap, cut, cut_in_turn, cut_reference};
use work::monitor::Monitor;

use super::normals::{RAYS, ridge_places};
use super::{Engine, EngineError, Measured, Task, View};
use crate::measure::measure_with_walls;
use crate::ridge_map::{places_above, ridge_map};
use crate::{Asked, RidgeMap, RidgePlace};

/// Places along normals that tell the ridges for each cell that could not, at most: with more of them it takes
/// no longer to measure all. Smooth parts have a quarter.
const PLACES_A_CELL: f64 = 0.5;

/// An engine on cells.
pub(super) struct Cells {
    word: &'static str,
    help: &'static str,
    cut: CutHeights,
}

/// Heights over the plan view by branch and bound.
pub(super) const ZMAP: Cells =
    Cells { word: "zmap", help: "heights over the plan view, by branch and bound; upright cutters", cut };

/// Every cell under every move that can reach it, in closed form in f64.
pub(super) const REFERENCE: Cells = Cells {
    word: "reference",
    help: "every cell under every move, in closed form; upright cutters, slow",
    cut: |stock, cutter, path, monitor| cut_reference(&stock, cutter, path, monitor),
};

impl Cells {
    /// What a path leaves of the stock, and a note where cells had to be coarser than was asked.
    fn cut(&self, task: &Task<'_>, monitor: &dyn Monitor) -> Result<(ZMap, Option<String>), EngineError> {
        let bounds = task.stock.bounds();
        let (grid, note) = task.budget.grid_for(task.moves_held(), &bounds, task.simulation, task.cells)?;
        let stock = task.uncut(grid, monitor)?;
        Ok((cut_in_turn(self.cut, stock, task.cutters, task.path, monitor)?, note))
    }
}

impl Engine for Cells {
    fn word(&self) -> &'static str {
        self.word
    }

    fn help(&self) -> &'static str {
        self.help
    }

    fn tilts(&self) -> bool {
        false
    }

    fn measures_pockets(&self) -> bool {
        true
    }

    fn finds_ridges(&self) -> bool {
        true
    }

    fn ridges(&self, task: &Task<'_>, monitor: &dyn Monitor) -> Result<Option<RidgeMap>, EngineError> {
        let (cut, _) = self.cut(task, monitor)?;
        let asked = task.simulation.error_bound;
        let found = ridge_map(task.part, task.cutters, task.path, &cut, task.limits, asked, monitor)?;
        let most_places = PLACES_A_CELL * cut.grid.len() as f64;
        drop(cut);
        // Places along the normals may be as coarse: each sees every move.
        let by_rays = || !task.cutters.are_several() && !task.pocket && ridge_places(task) <= most_places;
        match found {
            None if by_rays() => RAYS.ridges(task, monitor),
            found => Ok(found),
        }
    }

    fn above(&self, task: &Task<'_>, monitor: &dyn Monitor) -> Result<Vec<RidgePlace>, EngineError> {
        let (cut, _) = self.cut(task, monitor)?;
        let most_squares = task.budget.squares_beside(task.moves_held(), &cut.grid);
        Ok(places_above(task.part, task.cutters, task.path, &cut, task.limits, most_squares, monitor)?)
    }

    fn measure(&self, task: &Task<'_>, monitor: &dyn Monitor) -> Result<Measured, EngineError> {
        let begun = Instant::now();
        let (path, held) = (task.path, task.moves_held());
        let (cut, note) = self.cut(task, monitor)?;
        let grid = cut.grid;
        let most_cells = task.budget.more_cells(held, &grid);
        let asked = Asked {
            error_bound: task.simulation.error_bound,
            allowed_depth: task.allowed_depth,
            most_cells,
            most_squares: task.budget.squares_beside(held, &grid),
            is_first_look: task.is_first_look,
            border_cuts: !task.pocket,
            steep_elsewhere: !task.pocket,
        };
        let facing = task.measures_walls().then(|| task.facing());
        let measurement = measure_with_walls(
            task.part,
            task.cutters,
            path,
            &cut,
            task.limits,
            &asked,
            facing.as_ref(),
            monitor,
        )?;
        Ok(Measured {
            cell: grid.cell,
            cells: grid.len(),
            refined_rectangles: measurement.refined.rectangles,
            finest_cell: measurement.refined.finest_cell,
            measurement,
            view: View::Heights(Box::new(cut)),
            wall_s: begun.elapsed().as_secs_f64(),
            note,
        })
    }
}
