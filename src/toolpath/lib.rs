//! Cutter contacts, cutter locations, moves and the strategies that plan them. Knows nothing of how
//! stock is stored.

mod facets;
mod keep;
mod layers;
mod levels;
mod link;
mod lowering;
mod moves;
mod plan;
mod pocket;
mod strategies;
mod surface;
mod tilt;
mod touch_up;
mod vocabulary;

pub use levels::spacing::LevelSteps;
pub use link::{Detour, LONGEST_LINK, around_fixtures, longest_link, plane_interval};
pub use lowering::Lowered;
pub use plan::{Plan, plan, plan_tilted};
pub use pocket::{
    Engagement, Exceeding, Flow, Gentle, LEAST_SHARE, NotOnOutline, Pattern, Pocket, PocketStrategy, Vectors,
    WallFinish, engagement, engagement_angle, limit_feed, plan_pocket, read_pocket_step,
};
pub use strategies::iso_parametric::IsoParametric;
pub use strategies::iso_scallop::{FrontStart, IsoScallop};
pub use strategies::offset_surface::{OffsetAlong, OffsetDrive, OffsetSurface};
pub use strategies::program::{ALL_TOOLS, ForeignProgram, ReadProgram, ToolsMeant};
pub use strategies::shortest::{Objective, ShortestStreamline, shortest_possible};
pub use strategies::spiral::Spiral;
pub use strategies::streamline::{DEFAULT_CONTROL_POINTS, DEFAULT_DEGREE, FITTED, StreamMethod, Streamline};
pub use strategies::waterline::Waterline;
pub use strategies::zigzag::{Zigzag, ZigzagAngle};
pub use strategies::{STRATEGIES, StrategyRead, read_strategy, words_for};
pub use tilt::repair::{RepairSummary, Unreachable};
pub use tilt::tilted::Tilting;
pub use touch_up::short_passes;
pub use vocabulary::{
    Along, Correction, Definition, Earlier, Faces, FeedDirection, Joining, Kept, Levelled, Lines, Links,
    PartKind, Places, PlanError, PlanSettings, Reading, Rest, Step, Strategy, unused_tolerance,
};
