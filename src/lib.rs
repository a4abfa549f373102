//! Millstream plans milling paths as the streamlines of a field, cuts the part in a simulator,
//! measures the cut surface, and says with numbers and error bounds whether the plan is good.
//!
//! The folders are the stages of one flow, and each imports only from those before it:
//! [`geometry`] → [`cutter`] → [`part`] → [`field`] → [`toolpath`] → [`sim`] → [`metrology`]
//! → [`machine`] → [`report`] → [`io`] → [`cli`].
//!
//! Units: mm, rad in code (degrees in files), mm/min for feed, s for time. Right-handed, z up, the
//! tool axis points from the tip to the holder.

pub mod cli;
pub mod cutter;
pub mod field;
pub mod geometry;
pub mod io;
mod lanes;
pub mod machine;
pub mod metrology;
pub mod monitor;
pub mod parallel;
pub mod part;
pub mod report;
pub mod sim;
pub mod toolpath;
