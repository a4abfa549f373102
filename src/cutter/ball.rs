//! Ball ends: the corner radius is half of the diameter. mm.

use super::body::{Cutter, CutterError, positive};
use super::family::{CutterKey, Family};

pub(super) const FAMILY: Family = Family {
    word: "ball",
    title: "BALL END",
    keys: &[CutterKey::length("diameter", "D", 6.0, |c| 2.0 * c.radius())],
    example: Some("ball:6"),
    make: |given| Cutter::ball(given.value("diameter")),
    blame: |_| "diameter",
};

impl Cutter {
    /// A ball end of the given diameter (DC), mm.
    ///
    /// # Errors
    /// [`CutterError::Length`] unless the diameter is positive and finite.
    pub fn ball(diameter: f64) -> Result<Self, CutterError> {
        let radius = 0.5 * positive("diameter", diameter)?;
        Ok(Self::rounded(FAMILY.word, 0.0, radius, 0.0, radius))
    }
}
