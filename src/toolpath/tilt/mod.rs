//! Tools that lean: axes along passes and across them, keeping clear.

pub mod across;
pub mod repair;
pub mod tilted;
