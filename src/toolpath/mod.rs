//! Cutter contacts, cutter locations, moves and the strategies that plan them. Knows nothing of how
//! stock is stored.

mod arc;
mod border;
mod chart;
mod chord;
mod drop;
mod level_passes;
mod link;
mod path;
mod plan;
mod spacing;
mod streamline;
mod strip;
mod zigzag;

pub use arc::{ARC_SHARE, Arc, ArcError, Plane};
pub use chord::distance_to_segment;
pub use drop::{Drop, DropCutter, GridDrop, PlanGrid};
pub use path::{CcPoint, ClPoint, Move, MoveKind, Toolpath};
pub use plan::{Along, FeedDirection, Plan, PlanError, PlanSettings, Step, Strategy, plan};
pub use strip::{ball_scallop_height, strip_width, strip_width_at};
