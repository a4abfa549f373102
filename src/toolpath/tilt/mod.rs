//! Cutters whose axis tilts. Enters: contacts along passes, and a rule for the axis. Leaves: touches and
//! locations within the chord tolerance, clear of what the tool is to keep away from, with axes that turn no
//! faster than asked.

pub mod repair;
pub mod tilted;
pub(crate) mod turning;
