//! Why an engine could not cut or measure.

use motion::PathError;
use sim::{CutError, GridError, OppositeAxes, RaysError, VoxelError};
use work::monitor::Cancelled;

/// Why an engine could not cut or measure.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EngineError {
    /// The user asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The path cannot be cut by the engine.
    #[error(transparent)]
    Path(PathError),
    /// The grid does not fit.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// A move turns the tool axis by half a turn.
    #[error(transparent)]
    Turn(OppositeAxes),
    /// The voxels do not fit, or have no use.
    #[error(transparent)]
    Voxels(VoxelError),
    /// The places along the normals take more memory than allowed.
    #[error("places {spacing} mm apart on the part need {needed_mib} MiB, and {allowed_mib} MiB are allowed")]
    Places {
        /// What was asked for, mm.
        spacing: f64,
        /// What the run would need.
        needed_mib: u64,
        /// What it may take.
        allowed_mib: u32,
        /// Spacing that fits, mm.
        fitting: f64,
    },
    /// The moves that rays are to meet take more memory than is left.
    #[error("the moves need {needed_mib} MiB to be met by rays, and {left_mib} MiB of the memory are left")]
    Rays {
        /// What they need.
        needed_mib: u64,
        /// What is left.
        left_mib: u64,
    },
}

impl From<CutError> for EngineError {
    fn from(error: CutError) -> Self {
        match error {
            CutError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            CutError::Path(path) => Self::Path(path),
        }
    }
}

impl From<RaysError> for EngineError {
    fn from(error: RaysError) -> Self {
        match error {
            RaysError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            RaysError::Opposite(axes) => Self::Turn(axes),
            RaysError::Path(path) => Self::Path(path),
        }
    }
}

impl From<VoxelError> for EngineError {
    fn from(error: VoxelError) -> Self {
        match error {
            VoxelError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            VoxelError::Moves(path) => Self::Path(path),
            other => Self::Voxels(other),
        }
    }
}
