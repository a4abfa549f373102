//! Why heights could not be cut.

use motion::PathError;
use work::monitor::Cancelled;

/// Why heights could not be cut.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum CutError {
    /// Stopped by the monitor.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The path has places that are no numbers, or axes that are not upright.
    #[error(transparent)]
    Path(#[from] PathError),
}
