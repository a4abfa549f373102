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
mod vocabulary;

pub use drop::{Drop, DropCutter, GridDrop, PlanGrid};
pub use levels::spacing::LevelSteps;
pub use link::{LONGEST_LINK, longest_link};
pub use plan::{Plan, Strategy, plan, plan_tilted};
pub use pocket::{
    Engagement, Flow, Pattern, Pocket, PocketStrategy, engagement, engagement_angle, limit_feed, plan_pocket,
};
pub use strategies::iso_scallop::FrontStart;
pub use strategies::offset_surface::{OffsetAlong, OffsetDrive};
pub use strategies::shortest::shortest_possible;
pub use strategies::streamline::StreamMethod;
pub use tilt::repair::{RepairSummary, Unreachable};
pub use tilt::tilted::Tilting;
pub use vocabulary::{Along, FeedDirection, Joining, Links, PlanError, PlanSettings, Step};
