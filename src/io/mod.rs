//! Reading and writing of files: scenes, parts, programs, pictures.

pub mod scene;
