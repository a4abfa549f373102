//! TOML whose every refusal names its place and the cure: a text, its tables, typed access to their keys.

mod error;
mod printable;
mod section;
mod write;

pub use error::{Finding, SceneError, SceneText, listed, nearest, suggestion};
pub use printable::{printable, printable_lines};
pub use section::{COORDINATE, LENGTH, Located, Section};
pub use write::{toml_number, toml_numbers, toml_points, toml_string, word_of};
