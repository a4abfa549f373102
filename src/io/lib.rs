//! Files: the only stage that reads and writes them.

pub mod apt_cl;
pub mod atomic;
pub mod direction_table;
pub mod exr;
pub mod gcode;
mod mesh_file;
pub mod nurbs_json;
pub mod obj;
pub mod outline;
pub mod ply_write;
pub mod png;
mod program_text;
pub mod section_table;
pub mod stl;
pub mod stl_write;

pub use mesh_file::{MAX_BYTES as MAX_MESH_FILE_BYTES, MeshFileError, MeshReadError, Place};
pub use program_text::ProgramHeader;
