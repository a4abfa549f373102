//! Passes as levels of a function: how levels step, and what closes the gaps between them.

pub mod gaps;
pub mod halving;
pub mod level_passes;
pub mod planned_field;
pub mod spacing;
