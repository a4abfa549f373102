//! Blades: from the sections of a table to faired curves, lofted surfaces and their offsets. mm.

mod blade;
mod fairing;
mod loft;
pub mod sections;

pub use blade::{Blade, BladeCurve, BladeError, BladeSection, BladeSettings, BladeSide};
pub use fairing::{
    Faired, Fairing, FairingError, FairingMethod, FairingStop, JUMP_REMOVING_STEP, jump_energy,
    kjellander_place,
};
pub use loft::{Loft, LoftError, LoftSection, loft, loft_of_offsets};
