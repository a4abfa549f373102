//! The part of a scene.

pub use scene::{Loaded, load_mesh, load_part};
