//! Why voxels could not be cut.

use crate::solid::OppositeAxes;
use motion::PathError;
use work::monitor::Cancelled;

/// Why voxels could not be cut.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum VoxelError {
    /// The voxel is not a positive number.
    #[error("the voxel size is {0} mm; it must be a positive number")]
    Voxel(f64),
    /// A size of the stock is not positive, or not finite.
    #[error("the stock is empty or not finite")]
    Stock,
    /// The voxels need more memory than allowed.
    #[error(
        "a voxel of {voxel} mm needs about {needed_mib} MiB, and {allowed_mib} MiB are left for it; voxels of \
         {fitting} mm fit"
    )]
    Memory {
        /// What was asked for, mm.
        voxel: f64,
        /// What the run would need.
        needed_mib: u64,
        /// What it may take.
        allowed_mib: u64,
        /// A voxel that fits, mm, two digits.
        fitting: f64,
    },
    /// The moves alone need more memory than allowed.
    #[error("the moves of the path alone need {needed_mib} MiB, and {allowed_mib} MiB are left for them")]
    Path {
        /// What they need.
        needed_mib: u64,
        /// What they may take.
        allowed_mib: u64,
    },
    /// A place of the path is no number, or an axis no unit vector.
    #[error(transparent)]
    Moves(#[from] PathError),
    /// Nobody can tell which way a tool axis turns.
    #[error(transparent)]
    Axes(#[from] OppositeAxes),
    /// Stopped by the monitor.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}
