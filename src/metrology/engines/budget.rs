//! The memory that a simulation may take, and the cells that fit into it.

use cutter::Solid;
use geometry::Aabb;
use motion::Toolpath;
use part::Part;
use sim::{Grid, GridError, Rays, Stock};
use work::monitor::Monitor;

use super::{EngineError, Simulation};
use crate::closer::BYTES_PER_SQUARE;

/// Bytes in a MiB.
pub const MIB: u64 = 1 << 20;

/// Bytes a cell that a run takes at its peak: stock and winning moves 8, deviations 12, ridges 16 where every
/// cell has one, the mesh of the surface and height.exr the rest. Too small a figure lets a run exhaust the
/// machine that the scene's `memory_mib` promised to spare; too great a one refuses grids that would fit.
const BYTES_PER_CELL: usize = 80;

/// Bytes a triangle of the part at a run's peak: its corners, neighbours and search tree, and what drops the
/// cutter on it. Reading the file takes half of that. Too small a figure lets a run exhaust the machine; too
/// great a one refuses meshes that would fit.
pub const BYTES_PER_TRIANGLE: u64 = 780;

/// Bytes a cell that was measured: stock, winning move, deviation, ridges.
const BYTES_PER_MEASURED_CELL: usize = 36;

/// Bytes a move: the move itself, its prepared form, and its places in the engine's lists.
const BYTES_PER_MOVE: usize = 240;

/// One part in so many of the memory is kept for the path before there is one. If a path takes more,
/// the cells are laid out again; a smaller share refuses fewer grids that would fit.
const PATH_SHARE: u64 = 16;

/// What a run may take, and what its part takes of that.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Budget {
    /// Memory allowed, MiB.
    pub memory_mib: u32,
    /// What the part takes, bytes.
    pub part_bytes: u64,
}

/// Cells over a stock, and what is to be said about them.
pub type LaidOut = (Grid, Option<String>);

impl Budget {
    /// Of a part under the memory that a scene allows.
    pub fn new(part: &Part, memory_mib: u32) -> Self {
        Self { memory_mib, part_bytes: part.mesh().triangles().len() as u64 * BYTES_PER_TRIANGLE }
    }

    /// What a mesh of stock leaves of it.
    pub fn beside(self, stock: &Stock) -> Self {
        self.without(stock.triangles() as u64 * BYTES_PER_TRIANGLE)
    }

    /// What so many bytes leave of it.
    pub fn without(self, bytes: u64) -> Self {
        Self { part_bytes: self.part_bytes + bytes, ..self }
    }

    /// All of it, bytes.
    pub fn memory(&self) -> u64 {
        u64::from(self.memory_mib) * MIB
    }

    /// What part and path take, bytes.
    pub fn besides(&self, moves: usize) -> u64 {
        self.part_bytes + (moves * BYTES_PER_MOVE) as u64
    }

    /// What part and path leave, bytes.
    pub fn left(&self, moves: usize) -> u64 {
        self.memory().saturating_sub(self.besides(moves))
    }

    /// The moves of a path, ready to be met by rays, beside the grid that was measured.
    ///
    /// # Errors
    /// [`EngineError::Rays`] when they do not fit into what is left; those of [`Rays::new`].
    pub fn rays(
        &self,
        path: &Toolpath,
        solid: &Solid,
        grid: Option<&Grid>,
        monitor: &dyn Monitor,
    ) -> Result<Rays, EngineError> {
        self.check_rays(&[(path, solid)], grid)?;
        Ok(Rays::new(path, solid, monitor)?)
    }

    /// As [`Budget::rays`], of each of several paths.
    ///
    /// # Errors
    /// Those of [`Budget::rays`].
    pub fn rays_of_each(
        &self,
        tools: &[(&Toolpath, &Solid)],
        grid: Option<&Grid>,
        monitor: &dyn Monitor,
    ) -> Result<Vec<Rays>, EngineError> {
        self.check_rays(tools, grid)?;
        tools.iter().map(|(path, solid)| Ok(Rays::new(path, solid, monitor)?)).collect()
    }

    fn check_rays(&self, tools: &[(&Toolpath, &Solid)], grid: Option<&Grid>) -> Result<(), EngineError> {
        let measured = grid.map_or(0, |grid| (grid.len() * BYTES_PER_MEASURED_CELL) as u64);
        let moves = tools.iter().map(|(path, _)| path.len()).sum();
        let left = self.left(moves).saturating_sub(measured);
        let needed: u64 = tools.iter().map(|(path, solid)| Rays::bytes(path, solid)).sum();
        if needed > left {
            return Err(EngineError::Rays { needed_mib: needed.div_ceil(MIB), left_mib: left / MIB });
        }
        Ok(())
    }

    /// Squares that a search may hold beside a grid that was measured.
    pub(crate) fn squares_beside(&self, moves: usize, grid: &Grid) -> usize {
        let left = self.left(moves).saturating_sub((grid.len() * BYTES_PER_MEASURED_CELL) as u64);
        (left / BYTES_PER_SQUARE) as usize
    }

    /// Cells that may be added to a grid.
    pub fn more_cells(&self, moves: usize, grid: &Grid) -> usize {
        (self.left(moves) as usize / BYTES_PER_CELL).saturating_sub(grid.len())
    }

    /// The grid over `area` before any toolpath is known: a share of the memory is kept for those. With it a
    /// note where the automatic cell had to grow to fit into the memory; a cell that the user chose is never
    /// changed.
    ///
    /// # Errors
    /// [`GridError`] when the grid does not fit.
    pub fn grid_before_planning(&self, area: &Aabb, simulation: &Simulation) -> Result<LaidOut, GridError> {
        self.grid(area, simulation, self.part_bytes + self.memory() / PATH_SHARE)
    }

    /// The grid for a path of so many moves; the first grid stays where it fits.
    ///
    /// # Errors
    /// [`GridError`] when the grid does not fit.
    pub fn grid_for(
        &self,
        moves: usize,
        area: &Aabb,
        simulation: &Simulation,
        first: &LaidOut,
    ) -> Result<LaidOut, GridError> {
        if (first.0.len() * BYTES_PER_CELL) as u64 + self.besides(moves) <= self.memory() {
            return Ok(first.clone());
        }
        self.grid(area, simulation, self.besides(moves))
    }

    fn grid(&self, area: &Aabb, simulation: &Simulation, besides: u64) -> Result<LaidOut, GridError> {
        let memory = self.memory().saturating_sub(besides);
        let cell = simulation.cell;
        match Grid::covering(area, cell, BYTES_PER_CELL, memory) {
            Ok(grid) => Ok((grid, None)),
            Err(GridError::Memory { fitting, .. }) if simulation.cell_is_auto => {
                let grid = Grid::covering(area, fitting, BYTES_PER_CELL, memory)?;
                let allowed = self.memory_mib;
                let note =
                    format!("the cell is {fitting} mm instead of {cell} mm, to fit into {allowed} MiB");
                Ok((grid, Some(note)))
            }
            Err(error) => Err(error),
        }
    }
}
