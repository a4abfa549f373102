//! The cutter as a rotating profile, and what holds it. Knows nothing of parts.

mod apt;
mod apt_words;
mod ball;
mod body;
mod bull;
mod contact;
mod families;
mod family;
mod flat;
mod holder;
mod profile;
mod solid;
mod spec;
mod taper;

pub use apt_words::{AptError, AptWord, AptWords};
pub use body::{Cutter, CutterError};
pub use families::{FAMILIES, short_forms};
pub use family::{CutterKey, Family};
pub use holder::{Holder, HolderError, HolderSection};
pub use profile::{Incline, Profile};
pub use solid::{OutlineFoot, Solid, SolidFoot};
pub use spec::CutterWordError;
