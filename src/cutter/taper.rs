//! Tapered balls and bulls: a conical side. mm, rad.

use keys::LENGTH;

use super::body::{Cutter, CutterError, positive};
use super::family::{CutterKey, Family, Given};

pub(super) const FAMILY: Family = Family {
    word: "taper",
    title: "TAPER",
    keys: &[
        CutterKey::length("tip_diameter", "TIP D", 2.0, |c| 2.0 * (c.flat_radius() + c.corner_radius())),
        CutterKey::number("corner_radius", "R", 0.0..=*LENGTH.end(), |c| c.corner_radius()),
        CutterKey::angle("half_angle", "HALF ANGLE", 0.01..=79.99, |c| c.half_angle()).needed(5.0),
        CutterKey::length("shank_diameter", "SHANK D", 6.0, |c| 2.0 * c.radius()),
    ],
    example: Some("taper:2:1:5:6"),
    make,
    blame: |error| match error {
        CutterError::Length { what: "tip diameter", .. } => "tip_diameter",
        CutterError::CornerRadius { .. } => "corner_radius",
        CutterError::HalfAngle { .. } => "half_angle",
        _ => "shank_diameter",
    },
};

fn make(given: &Given<'_>) -> Result<Cutter, CutterError> {
    let tip = given.value("tip_diameter");
    // A tapered ball unless said otherwise.
    let corner = given.optional("corner_radius").unwrap_or(0.5 * tip);
    Cutter::taper(tip, corner, given.value("half_angle"), given.value("shank_diameter"))
}

impl Cutter {
    /// A conical cutter: `tip_diameter` is the diameter where arc and cone would meet the tip
    /// plane if the corner were a full ball or bull end (a ball of that diameter when
    /// `corner_radius` is half of it), `half_angle` is between axis and side, and the cone runs up
    /// to `shank_diameter`.
    ///
    /// # Errors
    /// When a dimension is not positive, the corner radius exceeds half of the tip diameter, the
    /// angle is not within 0–80°, or the shank is not wider than the tip.
    pub fn taper(
        tip_diameter: f64,
        corner_radius: f64,
        half_angle: f64,
        shank_diameter: f64,
    ) -> Result<Self, CutterError> {
        let half = 0.5 * positive("tip diameter", tip_diameter)?;
        let radius = 0.5 * positive("shank diameter", shank_diameter)?;
        if !(0.0..=half).contains(&corner_radius) {
            return Err(CutterError::CornerRadius { corner_radius, half });
        }
        if !(half_angle > 0.0 && half_angle < 80f64.to_radians()) {
            return Err(CutterError::HalfAngle { degrees: half_angle.to_degrees() });
        }
        if radius < half {
            return Err(CutterError::Length {
                what: "shank diameter less tip diameter",
                value: 2.0 * (radius - half),
            });
        }
        Ok(Self::rounded(FAMILY.word, half - corner_radius, corner_radius, half_angle, radius))
    }
}
