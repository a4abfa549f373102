//! Blades: from the sections of a table to faired curves, lofted surfaces and their offsets.
//!
//! Enters: sections, each a closed outline of points on one level, or the digits of a NACA profile. Leaves:
//! NURBS patches through the sections, their offsets, and a report of what fairing moved. Lengths in mm; the
//! levels of sections ascend.
//!
//! Limits: each section has one leading and one trailing edge, and an outline does not cross itself.
//! [`sections`] refuses the others and names the section and the point.

mod blade;
mod fairing;
mod loft;
mod neighbours;
pub mod sections;

pub use blade::{Blade, BladeCurve, BladeError, BladeSection, BladeSettings, BladeSide};
pub use fairing::{Faired, Fairing, FairingError, FairingMethod, JUMP_REMOVING_STEP, jump_energy, noise};
pub use loft::{Loft, LoftError, LoftSection, loft, loft_as_published, loft_of_offsets};
