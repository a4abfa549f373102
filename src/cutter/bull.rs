//! Bull noses: a corner radius of up to half of the diameter. mm.

use super::body::{Cutter, CutterError, positive};
use super::family::{CutterKey, Family};

pub(super) const FAMILY: Family = Family {
    word: "bull",
    title: "BULL NOSE",
    keys: &[
        CutterKey::length("diameter", "D", 6.0, |c| 2.0 * c.radius()),
        CutterKey::length("corner_radius", "R", 1.0, |c| c.corner_radius()),
    ],
    example: Some("bull:10:2"),
    make: |given| Cutter::bull(given.value("diameter"), given.value("corner_radius")),
    blame: |error| match error {
        CutterError::Length { what: "diameter", .. } => "diameter",
        _ => "corner_radius",
    },
};

impl Cutter {
    /// A bull nose of the given diameter (DC) and corner radius (RE), mm.
    ///
    /// # Errors
    /// When a dimension is not positive or the corner radius exceeds half of the diameter.
    pub fn bull(diameter: f64, corner_radius: f64) -> Result<Self, CutterError> {
        let radius = 0.5 * positive("diameter", diameter)?;
        let corner_radius = positive("corner radius", corner_radius)?;
        if corner_radius > radius {
            return Err(CutterError::CornerRadius { corner_radius, half: radius });
        }
        Ok(Self::rounded(FAMILY.word, radius - corner_radius, corner_radius, 0.0, radius))
    }
}
