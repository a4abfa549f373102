//! The cutter as a rotating profile. Knows nothing of parts.

mod contact;
mod profile;

pub use profile::{Cutter, CutterError, CutterShape};
