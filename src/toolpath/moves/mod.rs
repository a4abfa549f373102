//! From places along a pass to moves. Enters: a function that locates the cutter. Leaves: as few points as
//! hold the chord tolerance, smoothed where that is asked for, mm.

pub mod chord;
pub mod smooth;
pub mod touch;
