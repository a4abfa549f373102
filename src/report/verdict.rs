//! What a verdict is, and how a violation is told.

use serde::Serialize;

/// The highest ridge may exceed the scallop tolerance by this factor. Less fails plans for single
/// points of a few per cent; more lets visible ridges pass.
pub const HIGHEST_RIDGE: f64 = 1.25;

/// Whether all tolerances hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// Every tolerance holds.
    Pass,
    /// At least one does not.
    Fail,
}

impl Verdict {
    /// `pass` or `fail`.
    pub fn word(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Fail => "fail",
        }
    }
}

/// One tolerance that does not hold.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Violation {
    /// `collision`, `rapid`, `wall`, `scallop`, `gouge` or `uncut`.
    pub what: &'static str,
    /// The limit that was exceeded.
    pub limit_mm: f64,
    /// What was measured.
    pub measured_mm: f64,
    /// The finding in a sentence, with its place.
    pub text: String,
}

/// A place as reports write it.
pub fn place(at: [f64; 3]) -> String {
    format!("x {:.3} y {:.3} z {:.3}", at[0], at[1], at[2])
}
