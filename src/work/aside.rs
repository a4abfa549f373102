//! Work that cannot be asked to stop, done aside so that whoever waits for it can.
//!
//! Enters: a closure that owns what it needs. Leaves: its result, or [`Cancelled`] some 20 ms after the
//! monitor's wish. Triangulations, offsets of outlines, search trees and sparse factors come from crates that
//! ask nobody. A cancelled closure runs on until it ends, and its result is dropped: a program that goes on
//! has less of the machine meanwhile.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use super::monitor::{Cancelled, Monitor};

/// How long the monitor is not asked at most. Longer answers later, shorter wakes the waiting thread more
/// often.
const LOOK: Duration = Duration::from_millis(20);

/// What `work` gives, on a pool of its own with as many threads as the caller's, so that its loops give the
/// same bits. Where no thread can be started it runs on the calling one.
///
/// # Errors
/// [`Cancelled`] when the monitor says so before the work is done.
pub fn run<T: Send + 'static>(
    monitor: &dyn Monitor,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, Cancelled> {
    super::monitor::check(monitor)?;
    let Ok(pool) = rayon::ThreadPoolBuilder::new().num_threads(super::parallel::threads()).build() else {
        return Ok(work());
    };
    let (done, result) = channel();
    pool.spawn(move || {
        // Nobody may wait for it any more.
        let _ = done.send(catch_unwind(AssertUnwindSafe(work)));
    });
    loop {
        match result.recv_timeout(LOOK) {
            Ok(Ok(value)) => return Ok(value),
            Ok(Err(panic)) => resume_unwind(panic),
            Err(RecvTimeoutError::Timeout) => super::monitor::check(monitor)?,
            Err(RecvTimeoutError::Disconnected) => unreachable!("the closure sends its result or its panic"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::monitor::Silent;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// Cancels when it is asked for the `n`-th time.
    struct After(usize, AtomicUsize);

    impl Monitor for After {
        fn cancelled(&self) -> bool {
            self.1.fetch_add(1, Ordering::Relaxed) >= self.0
        }
    }

    #[test]
    fn results_come_back_from_as_many_threads_as_the_caller_has() {
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert_eq!(pool.install(|| run(&Silent, crate::parallel::threads)), Ok(threads));
        }
    }

    /// The closure ends only once the one that waits has gone: it would wait for ever otherwise.
    #[test]
    fn whoever_waits_can_leave_before_the_work_is_done() {
        let (leave, left) = channel::<()>();
        let monitor = After(2, AtomicUsize::new(0));
        assert_eq!(run(&monitor, move || left.recv().is_ok()), Err(Cancelled));
        drop(leave);
    }

    #[test]
    #[should_panic(expected = "from the closure")]
    fn a_panic_reaches_whoever_waits() {
        let _ = run(&Silent, || panic!("from the closure"));
    }
}
