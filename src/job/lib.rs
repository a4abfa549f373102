//! A job: a scene in, plain report data out. Nothing is written and nothing is printed here.
//!
//! One way leads through it for every engine and for pockets: plan, cut, measure, find further figures,
//! judge. A figure of the report is one file in `figures` and one line in their list; the rule by which a
//! toolpath passes stands in `judge`.

mod beside_part;
mod correction;
mod covered;
mod earlier;
mod equal_time;
mod error;
mod figures;
mod flow;
mod gouge_moves;
mod judge;
mod machined;
mod measurable;
mod measuring;
mod outcome;
mod planned;
mod pocket;
mod run;
mod session;
mod tool;
#[cfg(test)]
mod torn_mesh_tests;
mod units;

pub use error::JobError;
pub use judge::{judge_surface, marks};
pub use machined::Machined;
pub use outcome::Outcome;
pub use session::Session;
