//! From places along a pass to moves: chords within a tolerance, smoothing.

pub mod chord;
pub mod smooth;
