//! Files: the only stage that reads and writes them.

pub mod apt_cl;
pub mod atomic;
pub mod exr;
pub mod gcode;
pub mod nurbs_json;
pub mod png;
mod program_text;
pub mod scene;
pub mod stl_write;

pub use program_text::ProgramHeader;
