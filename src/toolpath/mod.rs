//! Cutter contacts, cutter locations, moves and the strategies that plan them. Knows nothing of how
//! stock is stored.

mod drop;
mod path;
mod plan;

pub use drop::{Drop, DropCutter};
pub use path::{CcPoint, ClPoint, Move, MoveKind, Toolpath};
pub use plan::{Along, FeedDirection, Plan, PlanError, PlanSettings, Step, Strategy, plan};
