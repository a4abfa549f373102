//! Where a cutter is and how it moves: contacts, locations, tool axes, moves, paths.
//!
//! Enters: contacts with unit normals, or tip positions with axes. Leaves: a [`Toolpath`] of moves. What
//! cuts, measures or drives a machine depends on these types; none of them knows how a path was planned.
//!
//! Lengths in mm, feed in mm/min, tilt in rad. A location is that of the tip; an axis is a unit vector from
//! the tip to the holder. A [`Toolpath`] holds whatever it was made of: what cuts and measures checks it
//! first ([`Toolpath::check`]).

mod beside;
mod checked;
mod cutters;
mod in_turn;
mod path;
mod tool_axis;
mod written;

pub use beside::{Beside, PassStretches};
pub use checked::PathError;
pub use cutters::{Cutters, Stretch};
pub use in_turn::PathsInTurn;
pub use path::{CcPoint, ClPoint, Move, MoveKind, Origin, Toolpath};
pub use tool_axis::{AxisError, ToolAxis, in_tool_frame, location};
pub use written::{DECIMALS, ROUNDING, in_last_decimals};
