//! Flat ends: no corner radius. mm.

use super::body::{Cutter, CutterError, positive};
use super::family::{CutterKey, Family};

pub(super) const FAMILY: Family = Family {
    word: "flat",
    title: "FLAT END",
    keys: &[CutterKey::length("diameter", "D", 6.0, |c| 2.0 * c.radius())],
    example: Some("flat:6"),
    make: |given| Cutter::flat(given.value("diameter")),
    blame: |_| "diameter",
};

impl Cutter {
    /// A flat end of the given diameter (DC), mm.
    ///
    /// # Errors
    /// [`CutterError::Length`] unless the diameter is positive and finite.
    pub fn flat(diameter: f64) -> Result<Self, CutterError> {
        let radius = 0.5 * positive("diameter", diameter)?;
        Ok(Self::rounded(FAMILY.word, radius, 0.0, 0.0, radius))
    }
}
