//! Where a cutter stands and how it moves: contacts, locations, tool axes, moves, paths. Everything that cuts, measures or
//! drives a machine stands on these words; none of them knows how a path was planned. mm; feed in mm/min; axes are unit
//! vectors from the tip to the holder.

mod path;
mod tool_axis;

pub use path::{CcPoint, ClPoint, Move, MoveKind, Toolpath};
pub use tool_axis::{AxisError, ToolAxis, in_tool_frame, location};
