//! The cutter as a rotating profile, and what holds it. Knows nothing of parts.

mod apt;
mod contact;
mod holder;
mod profile;
mod shape;
mod solid;
mod spec;

pub use apt::{AptError, AptWord, AptWords};
pub use holder::{Holder, HolderError, HolderSection};
pub use profile::{Incline, Profile};
pub use shape::{Cutter, CutterError, CutterShape};
pub use solid::{OutlineFoot, Solid, SolidFoot};
pub use spec::CutterWordError;
