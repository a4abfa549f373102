//! Files: the only stage that reads and writes them.

pub mod apt_cl;
pub mod atomic;
pub mod gcode;
mod program_text;

pub use program_text::ProgramHeader;
