//! TOML whose every refusal names its place and the cure: a text, its tables, typed access to their keys.

mod error;
mod section;

pub use error::{Finding, SceneError, SceneText, listed, nearest, suggestion};
pub use section::{COORDINATE, LENGTH, Located, Section};
