//! How long computations run: spread over threads ([`parallel`]), over vector lanes ([`lanes`]), watched and cancelled
//! ([`monitor`]). Every other stage stands on this one.

pub mod lanes;
pub mod monitor;
pub mod parallel;
