//! The engines: each cuts a path out of the stock and measures what is left against the part.
//!
//! Enters: a [`Task`], mm. Leaves: a [`Measurement`] with its bounds, and the [`View`] that figures and
//! pictures are drawn from. A new engine is one file here and one line in [`ENGINES`].

mod budget;
mod cells;
mod choice;
mod error;
mod normals;
mod task;

pub use budget::{BYTES_PER_TRIANGLE, Budget, LaidOut, MIB};
pub use choice::EngineChoice;
pub use error::EngineError;
pub use normals::REACH_OVER_UNCUT;
pub use task::{Measured, NormalView, Simulation, Task, View};

use crate::{RidgeMap, RidgePlace};
use work::monitor::Monitor;

/// A way to cut and to measure.
pub trait Engine: Sync {
    /// As scenes and the command line spell it.
    fn word(&self) -> &'static str;
    /// What it does, in one line.
    fn help(&self) -> &'static str;
    /// Whether it cuts with cutters that lean.
    fn tilts(&self) -> bool;
    /// Whether it measures the floor of a pocket.
    fn measures_pockets(&self) -> bool;
    /// Whether finer cells lower its bounds, beside being asked for lower ones.
    fn gains_by_cells(&self) -> bool {
        true
    }
    /// Whether ridges alone are found in less time than all is measured.
    fn finds_ridges(&self) -> bool;
    /// Cuts, and measures no more than ridges and borders; `None` where that takes as long as all, or
    /// the cells are too coarse to tell.
    ///
    /// # Errors
    /// [`EngineError`].
    fn ridges(&self, _task: &Task<'_>, _monitor: &dyn Monitor) -> Result<Option<RidgeMap>, EngineError> {
        Ok(None)
    }
    /// Cuts on the same cells, and finds places above the scallop limit beside those that [`Engine::ridges`]
    /// finds, each with the height that it may have at most. Nothing where that takes as long as measuring
    /// all.
    ///
    /// # Errors
    /// [`EngineError`].
    fn above(&self, _task: &Task<'_>, _monitor: &dyn Monitor) -> Result<Vec<RidgePlace>, EngineError> {
        Ok(Vec::new())
    }
    /// Cuts and measures.
    ///
    /// # Errors
    /// [`EngineError`].
    fn measure(&self, task: &Task<'_>, monitor: &dyn Monitor) -> Result<Measured, EngineError>;
}

/// All engines. Where a scene leaves the choice open, the first one that can do the path cuts it.
pub const ENGINES: [&dyn Engine; 4] = [&cells::ZMAP, &cells::REFERENCE, &normals::RAYS, &normals::VOXEL];
