//! Cutter contacts, cutter locations, moves and the strategies that plan them. Knows nothing of how
//! stock is stored.

mod drop;
mod levels;
mod link;
mod moves;
mod plan;
mod pocket;
mod strategies;
mod surface;
mod tilt;

pub use crate::strategies::shortest::shortest_possible;
pub use crate::tilt::repair::{RepairSummary, Unreachable};
pub use crate::tilt::tilted::Tilting;
pub use drop::{Drop, DropCutter, GridDrop, PlanGrid};
pub use link::{Joining, LONGEST_LINK, Links, longest_link};
pub use plan::{
    Along, FeedDirection, FrontStart, LevelSteps, OffsetAlong, OffsetDrive, Plan, PlanError, PlanSettings,
    Step, Strategy, StreamMethod, plan, plan_tilted,
};
pub use pocket::{
    Engagement, Flow, Pattern, Pocket, PocketStrategy, engagement, engagement_angle, limit_feed, plan_pocket,
};
