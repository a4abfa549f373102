//! The seven words of an APT cutter, `CUTTER/d,r,e,f,α,β,h` (ISO 4343), and their ranges. mm, rad.
//!
//! The bottom runs from the tip at the angle α above the plane of the tip, the side at the angle β
//! from the axis up to the height h; d is twice the distance from the axis at which the two, carried
//! on, cross. The corner is a circle of radius r around the point `(e, f)`, distance from the axis and
//! height above the tip.

/// Angles from this on leave so flat or so thin a cone that its other end is kilometres away, degrees.
const GREATEST_ANGLE: f64 = 80.0;

/// Lengths from this on are no cutter's, mm.
const GREATEST_LENGTH: f64 = 1.0e4;

/// The seven words: mm and rad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AptWords {
    /// d: twice the distance from the axis at which bottom and side, carried on, cross.
    pub diameter: f64,
    /// r: radius of the corner.
    pub corner_radius: f64,
    /// e: distance of the corner's centre from the axis.
    pub corner_x: f64,
    /// f: height of the corner's centre above the tip.
    pub corner_z: f64,
    /// α: angle of the bottom above the plane of the tip.
    pub tip_angle: f64,
    /// β: angle between axis and side.
    pub side_angle: f64,
    /// h: height of the cutter above its tip.
    pub length: f64,
}

/// One of the seven words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AptWord {
    /// d.
    Diameter,
    /// r.
    CornerRadius,
    /// e.
    CornerX,
    /// f.
    CornerZ,
    /// α.
    TipAngle,
    /// β.
    SideAngle,
    /// h.
    Length,
}

/// Why seven words make no cutter.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{reason}")]
pub struct AptError {
    /// The word to change.
    pub word: AptWord,
    /// What is wrong.
    pub reason: String,
    /// What would cure it.
    pub cure: String,
}

pub(super) fn refused<T>(
    word: AptWord,
    reason: impl Into<String>,
    cure: impl Into<String>,
) -> Result<T, AptError> {
    Err(AptError { word, reason: reason.into(), cure: cure.into() })
}

/// A length or an angle in a message: four decimals, as programs have.
pub(super) fn shown(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

impl AptWords {
    /// The centre `(e, f)` of the corner that touches bottom and side, whatever centre is given.
    pub fn tangent_centre(&self) -> [f64; 2] {
        let (sin, cos) = self.tip_angle.sin_cos();
        let (sin_side, cos_side) = self.side_angle.sin_cos();
        let r = self.corner_radius;
        let e = if self.tip_angle == 0.0 && self.side_angle == 0.0 {
            0.5 * self.diameter - r
        } else {
            (self.foot() * cos_side + r * sin_side / cos - r) / (cos_side - sin_side * sin / cos)
        };
        [e, (r + e * sin) / cos]
    }

    /// With a corner around the given centre; a coordinate that is left away is the one at which the
    /// circle touches the side (e) or the bottom (f).
    pub fn with_centre(mut self, e: Option<f64>, f: Option<f64>) -> Self {
        let (tip, side, r) = (self.tip_angle, self.side_angle, self.corner_radius);
        [self.corner_x, self.corner_z] = match (e, f) {
            (None, None) => self.tangent_centre(),
            (Some(e), None) => [e, (r + e * tip.sin()) / tip.cos()],
            (None, Some(f)) => [self.foot() + (f * side.sin() - r) / side.cos(), f],
            (Some(e), Some(f)) => [e, f],
        };
        self
    }

    /// Distance from the axis at which the side, carried on, meets the plane of the tip.
    pub(super) fn foot(&self) -> f64 {
        0.5 * self.diameter * (1.0 - self.tip_angle.tan() * self.side_angle.tan())
    }

    pub(super) fn check_ranges(&self) -> Result<(), AptError> {
        use AptWord::{CornerRadius, CornerX, CornerZ, Diameter, Length, SideAngle, TipAngle};
        let lengths = [
            (Diameter, "diameter", self.diameter, f64::MIN_POSITIVE),
            (CornerRadius, "corner radius", self.corner_radius, 0.0),
            (CornerX, "place of the corner's centre along x", self.corner_x, -GREATEST_LENGTH),
            (CornerZ, "place of the corner's centre along z", self.corner_z, -GREATEST_LENGTH),
            (Length, "length", self.length, 0.0),
        ];
        for (word, what, value, least) in lengths {
            if !(value >= least && value < GREATEST_LENGTH) {
                return refused(
                    word,
                    format!("the {what} is {value} mm"),
                    "write a length that a cutter can have",
                );
            }
        }
        let angles = [
            (
                TipAngle,
                "tip",
                self.tip_angle,
                "falls toward the axis: a hollow end, which leaves a cone in the middle",
            ),
            (
                SideAngle,
                "side",
                self.side_angle,
                "leans inward: an undercut, which a vertical axis cannot use",
            ),
        ];
        for (word, what, angle, below) in angles {
            let degrees = shown(angle.to_degrees());
            if angle < 0.0 {
                let reason = format!("with a {what} angle of {degrees} degrees the profile {below}");
                return refused(word, reason, "write an angle of 0 or more");
            }
            if angle.is_nan() || angle.to_degrees() >= GREATEST_ANGLE {
                let reason = format!("the {what} angle is {degrees} degrees");
                return refused(word, reason, format!("write an angle below {GREATEST_ANGLE} degrees"));
            }
        }
        let sum = (self.tip_angle + self.side_angle).to_degrees();
        if sum > 90.0 - 1e-6 {
            let reason = format!(
                "tip angle and side angle make {} degrees: the bottom is steeper than the side",
                shown(sum)
            );
            return refused(TipAngle, reason, "write angles that make less than 90 degrees together");
        }
        Ok(())
    }
}

impl AptWords {
    #[doc(hidden)]
    /// Profiles of up to 3 mm of radius with every piece, with edges and without; angles in degrees.
    pub fn examples() -> Vec<Self> {
        let words = |d: f64, r: f64, centre: Option<[f64; 2]>, alpha: f64, beta: f64, length: f64| {
            let mut words = Self {
                diameter: d,
                corner_radius: r,
                corner_x: 0.0,
                corner_z: 0.0,
                tip_angle: alpha.to_radians(),
                side_angle: beta.to_radians(),
                length,
            };
            [words.corner_x, words.corner_z] = centre.unwrap_or_else(|| words.tangent_centre());
            words
        };
        let barrel = 20f64;
        vec![
            // A bull nose with a cone below and a cone above, all tangent.
            words(4.0, 0.8, None, 12.0, 20.0, 3.4),
            // A drill point, an engraver's point and a chamfer mill.
            words(6.0, 0.0, None, 31.0, 0.0, 5.0),
            words(0.2, 0.0, None, 0.0, 20.0, 7.0),
            words(3.0, 0.0, None, 10.0, 35.0, 2.0),
            // A rounded point.
            words(1.5, 0.5, None, 15.0, 40.0, 2.4),
            // A barrel: a flat tip, an edge, an arc of 20 mm that ends upright.
            words(6.0, barrel, Some([3.0 - barrel, 6.0]), 0.0, 0.0, 8.0),
            // A barrel that ends in an edge against a leaning side, over a conical bottom.
            words(4.0, 6.0, Some([-2.7, 5.0]), 5.0, 15.0, 5.0),
            // A lens: an arc of 5 mm through the tip that ends in an edge at 3 mm.
            words(6.0, 5.0, Some([0.0, 5.0]), 0.0, 0.0, 4.0),
            // A bull nose whose circle dips below the bottom and beyond the side: two edges.
            words(6.0, 1.2, Some([2.0, 1.0]), 0.0, 0.0, 4.0),
        ]
    }
}
