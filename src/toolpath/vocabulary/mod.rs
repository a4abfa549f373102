//! The words in which passes are asked for and handed over: settings, feed directions, passes, refusals.
//! Every room of the planner speaks them; they know none of the rooms that cover a surface.

mod correction;
mod error;
mod feed_direction;
mod pass_settings;
mod passes;
mod places;
mod settings;
mod strategy;
mod task;

pub use correction::Correction;
pub use error::PlanError;
pub use feed_direction::{Along, FeedDirection, Lines};
pub(crate) use pass_settings::{COMPARED_CHORDS, SAMPLING_OVER_RADIUS};
pub use pass_settings::{Guide, PassSettings, unused_tolerance};
pub use passes::{Contact, Faces, Kept, LevelFunction, Levelled, Obedience, Passes};
pub use places::{Places, Rest};
pub use settings::{Earlier, Joining, Links, PlanSettings, Step};
pub use strategy::{Definition, PartKind, Reading, Strategy};
pub(crate) use task::Setup;
pub use task::{Pace, Task};
