//! Programs of other systems, read as motion.
//!
//! Enters: the text of a program (G-code as controls and CAM systems write it, or APT cutter locations), a
//! control, and what the machine finds when it starts. Leaves: a [`Program`]: every motion with its line,
//! tool and feed, arcs as exact arcs, and remarks on what moves nothing. Lengths in mm, angles in degrees
//! where they are axis values, feeds in mm/min.
//!
//! What may move the tool and is not understood stops the reading with its line, column and cure. Nothing is
//! read from files here, and no input makes it panic or run without end.
//!
//! Text becomes words (`block`), words become codes in force and motion (`interpret`), a motion becomes a
//! step (`program`). Controls differ as data only (`control`).

mod apt;
mod arc;
mod block;
#[cfg(test)]
mod canonical_tests;
mod checks;
mod compensation;
mod control;
mod corners;
mod cursor;
mod cycle;
#[cfg(test)]
mod dialect_tests;
mod dwell;
mod error;
mod expression;
mod flow;
mod frame;
#[cfg(test)]
mod gcode_tests;
mod interpret;
mod lines;
mod parameters;
mod program;
mod runs;
mod state;
mod tools;

pub use apt::{looks_like_apt, read_apt};
pub use checks::{Finding, FindingKind};
pub use control::{
    CONTROLS, Code, Control, Cycle, Down, FeedMode, Length, Logic, Motion, Plane, RadiusSide, Variables,
};
pub use corners::Corners;
pub use error::{Fault, ProgramError};
pub use frame::{Place, WORK_OFFSETS};
pub use interpret::read_gcode;
pub use program::{Arc, Note, Program, Setting, Spindle, Step, StepKind, ToolRemark, Unset};
pub use runs::{FEED_WHERE_NONE, Placing, ToolRun};
pub use state::Setup;
pub use tools::{Described, TableTool, Tool, ToolTable, read_tool_table, same_cutter};

/// The control that is taken where none is named.
pub const GENERAL_CONTROL: &Control = &CONTROLS[0];

/// LinuxCNC, which rs274 interprets for.
pub const LINUXCNC_CONTROL: &Control = &CONTROLS[1];
