//! Reading and writing of files: scenes, parts, programs, pictures.

pub mod exr;
pub mod png;
pub mod scene;
pub mod stl_write;
