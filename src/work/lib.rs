//! How long computations run: on all threads ([`parallel`]), on vector lanes ([`lanes`]), watched and cancelled
//! ([`monitor`]).
//!
//! Enters: closures. Leaves: their results in a fixed order, the same bits for any number of threads and any vector unit.
//! Every other stage depends on this crate, and it depends on none of them. Nothing here prints, and nothing starts a
//! thread pool: loops run on the rayon pool of the caller.

pub mod lanes;
pub mod monitor;
pub mod parallel;
