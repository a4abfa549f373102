//! Files: the only stage that reads and writes them.

pub mod apt_cl;
pub mod atomic;
pub mod digest;
pub mod direction_table;
pub mod exr;
pub mod gcode;
mod mesh_file;
mod mesh_formats;
pub mod nurbs_json;
pub mod obj;
pub mod outline;
pub mod ply_write;
pub mod png;
mod program_text;
#[cfg(test)]
mod read_back_tests;
pub mod regular;
pub mod section_table;
pub mod stl;
pub mod stl_write;

pub use mesh_file::{
    FilePlace, MAX_BYTES as MAX_MESH_FILE_BYTES, MeshFileError, MeshFormat, MeshLimits, MeshReadError,
};
pub use mesh_formats::{MESH_FORMATS, UnknownMeshFormat, extension, mesh_extensions};
pub use program_text::ProgramHeader;
