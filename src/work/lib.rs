//! How long computations run: on all threads ([`parallel`]), on vector lanes ([`lanes`]), watched and
//! cancelled ([`monitor`]), and left where they cannot be stopped ([`aside`]).
//!
//! Enters: closures. Leaves: their results in a fixed order, the same bits for any number of threads and any
//! vector unit. Every other stage depends on this crate, and it depends on none of them. Nothing here prints,
//! and nothing starts a thread pool for them: loops run on the rayon pool of the caller.

pub mod aside;
pub mod lanes;
pub mod monitor;
pub mod parallel;
