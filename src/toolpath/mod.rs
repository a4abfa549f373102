//! Cutter contacts, cutter locations, moves and the strategies that plan them. Knows nothing of how
//! stock is stored.

mod across;
mod arc;
mod border;
mod chart;
mod chord;
mod contour_spiral;
mod drop;
mod feed;
mod gaps;
mod halving;
mod interference;
mod iso_scallop;
mod level_passes;
mod link;
mod mesh_passes;
mod mesh_shortest;
mod mesh_surface;
mod offset_mesh;
mod offset_surface;
mod path;
mod plan;
mod plan_curve;
mod planned_field;
mod pocket;
pub mod scallop;
mod shortest;
mod smooth;
mod spacing;
mod spiral;
mod streamline;
mod strip;
mod tilted;
mod tool_axis;
mod waterline;
mod zigzag;

pub use arc::{ARC_SHARE, Arc, ArcError, Plane};
pub use chord::distance_to_segment;
pub use drop::{Drop, DropCutter, GridDrop, PlanGrid};
pub use interference::{
    Check, Clearance, Interference, Obstacle, RepairSummary, Shortfall, SweptClearance, Unreachable,
    local_gouge_free_lead,
};
pub use link::{Joining, LONGEST_LINK, Links, longest_link};
pub use path::{CcPoint, ClPoint, Move, MoveKind, Toolpath};
pub use plan::{
    Along, FeedDirection, FrontStart, LevelSteps, OffsetAlong, OffsetDrive, Plan, PlanError, PlanSettings,
    Step, Strategy, StreamMethod, plan, plan_tilted,
};
pub use planned_field::{FeedSample, PassPoint, PlannedField};
pub use pocket::{
    Engagement, Flow, Pattern, Pocket, PocketStrategy, engagement, engagement_angle, limit_feed, plan_pocket,
};
pub use scallop::ball_scallop_height;
pub use shortest::{ShortestPossible, shortest_possible};
pub use strip::{strip_width, strip_width_at};
pub use tilted::Tilting;
pub use tool_axis::{AxisError, ToolAxis, location};
