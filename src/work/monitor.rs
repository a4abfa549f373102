//! How long work reports its progress and learns that it should stop.
//!
//! Core stages print nothing. They take a [`Monitor`], tell it what they do, and ask it now and
//! then whether to go on.

/// Receives progress and answers whether the work should stop.
///
/// Called from several threads at once; implementations must be cheap.
pub trait Monitor: Sync {
    /// The next stages belong to a piece of work of that name.
    fn belongs_to(&self, _name: &str) {}
    /// A stage begins that will take `steps` steps (0: unknown).
    fn start(&self, _stage: &str, _steps: u64) {}
    /// `steps` more steps of the current stage are done.
    fn advance(&self, _steps: u64) {}
    /// True once the user has asked to stop; the stage then returns [`Cancelled`].
    fn cancelled(&self) -> bool {
        false
    }
}

/// Hears nothing and never cancels.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Monitor for Silent {}

/// The work was stopped by its [`Monitor`]; nothing was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("interrupted")]
pub struct Cancelled;

/// `Err(Cancelled)` once the monitor says so.
///
/// # Errors
/// [`Cancelled`] when `monitor.cancelled()`.
pub fn check(monitor: &dyn Monitor) -> Result<(), Cancelled> {
    if monitor.cancelled() { Err(Cancelled) } else { Ok(()) }
}
