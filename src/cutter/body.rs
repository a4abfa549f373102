//! A rotating cutter: its profile, the seven words that describe it, and what is asked of both. Lengths in
//! mm, angles in rad.

use super::apt_words::{AptError, AptWords};
use super::profile::{Incline, Profile};

/// Why no cutter could be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CutterError {
    /// A length that must be positive is not, or is not finite.
    #[error("{what} is {value} mm; it must be a positive number below 10000")]
    Length {
        /// Which dimension.
        what: &'static str,
        /// What was given.
        value: f64,
    },
    /// The corner radius exceeds half of the diameter.
    #[error("corner radius {corner_radius} mm exceeds half of the diameter, {half} mm")]
    CornerRadius {
        /// What was given.
        corner_radius: f64,
        /// Half of the diameter.
        half: f64,
    },
    /// The half angle of a taper is out of range.
    #[error("half angle {degrees} degrees; a taper needs more than 0 and less than 80")]
    HalfAngle {
        /// What was given.
        degrees: f64,
    },
    /// The seven words make no profile that can be swept.
    #[error(transparent)]
    Apt(#[from] AptError),
}

/// A rotating cutter. Always valid once made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cutter {
    family: &'static str,
    words: AptWords,
    profile: Profile,
}

pub(super) fn positive(what: &'static str, value: f64) -> Result<f64, CutterError> {
    if value > 0.0 && value < 1.0e4 { Ok(value) } else { Err(CutterError::Length { what, value }) }
}

impl Cutter {
    /// A cutter of the family of that word.
    pub(super) fn new(family: &'static str, words: AptWords, profile: Profile) -> Self {
        Self { family, words, profile }
    }

    /// A disc of radius `flat`, an arc of radius `corner`, and a side at `half_angle` from the axis
    /// up to `radius`.
    pub(super) fn rounded(
        family: &'static str,
        flat: f64,
        corner: f64,
        half_angle: f64,
        radius: f64,
    ) -> Self {
        let side = Incline::from_axis(half_angle);
        let profile = Profile::tangent(Incline::LEVEL, [flat, corner], corner, side, radius);
        let words = AptWords {
            diameter: if half_angle == 0.0 { 2.0 * radius } else { 2.0 * profile.foot() },
            corner_radius: corner,
            corner_x: flat,
            corner_z: corner,
            tip_angle: 0.0,
            side_angle: half_angle,
            length: profile.height(radius),
        };
        Self { family, words, profile }
    }

    /// The word of the family that the cutter was made as. The profile does not depend on it.
    pub(super) fn family_word(&self) -> &'static str {
        self.family
    }

    /// Its profile.
    pub fn profile(&self) -> &Profile {
        &self.profile
    }

    /// True for a hemisphere under a cylinder ([`Profile::is_ball`]), whatever family it was made as.
    pub fn is_ball(&self) -> bool {
        self.profile.is_ball()
    }

    /// True for a disc under a cylinder ([`Profile::is_flat`]).
    pub fn is_flat(&self) -> bool {
        self.profile.is_flat()
    }

    /// True for a level bottom under a cylinder, with or without an arc between them
    /// ([`Profile::is_end_mill`]).
    pub fn is_end_mill(&self) -> bool {
        self.profile.is_end_mill()
    }

    /// Its seven words. Where a length was not given it is that of the profile below the cylinder.
    pub fn words(&self) -> &AptWords {
        &self.words
    }

    /// Distance from the axis to the centre of the corner's arc, mm: the radius of the disc of a
    /// flat, bull nose or taper, 0 for a ball, below zero for a barrel.
    pub fn flat_radius(&self) -> f64 {
        self.profile.centre_x
    }

    /// Corner radius (RE), mm (0 for a flat end, the radius for a ball).
    pub fn corner_radius(&self) -> f64 {
        self.profile.corner
    }

    /// Angle between axis and side, rad (0 where the side is a cylinder).
    pub fn half_angle(&self) -> f64 {
        self.words.side_angle
    }

    /// Largest radius that cuts, mm (half of DC).
    pub fn radius(&self) -> f64 {
        self.profile.radius
    }

    /// Height of the cutting surface above the tip at distance `rho >= 0` from the axis; `None`
    /// beyond the cutter's radius.
    pub fn height(&self, rho: f64) -> Option<f64> {
        (rho <= self.profile.radius).then(|| self.profile.height(rho))
    }

    /// Height of the point of the profile at the cutter's largest radius, mm: above it the side is
    /// a cylinder.
    pub fn side_height(&self) -> f64 {
        self.profile.height(self.profile.radius)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn profiles_follow_their_closed_forms() {
        let ball = Cutter::ball(6.0).unwrap();
        assert_eq!(ball.height(0.0), Some(0.0));
        assert!((ball.height(1.0).unwrap() - (3.0 - 8f64.sqrt())).abs() < 1e-15);
        assert_eq!(ball.height(3.0), Some(3.0));
        assert_eq!(ball.height(3.01), None);
        let flat = Cutter::flat(6.0).unwrap();
        assert_eq!(flat.height(3.0), Some(0.0));
        let bull = Cutter::bull(6.0, 1.0).unwrap();
        assert_eq!(bull.height(2.0), Some(0.0));
        assert_eq!(bull.height(3.0), Some(1.0));
        let taper = Cutter::taper(2.0, 1.0, 10f64.to_radians(), 6.0).unwrap();
        let end = taper.profile.arc_end;
        let (below, above) = (taper.height(end - 1e-9).unwrap(), taper.height(end + 1e-9).unwrap());
        assert!((below - above).abs() < 2e-8, "arc and cone meet: {below} {above}");
        // The cone is tangent to the arc: slope 1/tan(alpha) on both sides.
        let slope = (taper.height(end).unwrap() - taper.height(end - 1e-7).unwrap()) / 1e-7;
        assert!((slope * 10f64.to_radians().tan() - 1.0).abs() < 1e-4);
        assert!((taper.height(3.0).unwrap() - taper.side_height()).abs() < 1e-12);
    }

    #[test]
    fn impossible_cutters_are_refused() {
        assert!(Cutter::ball(0.0).is_err());
        assert!(Cutter::ball(f64::NAN).is_err());
        assert!(Cutter::bull(6.0, 3.1).is_err());
        assert!(Cutter::taper(2.0, 1.0, 0.0, 6.0).is_err());
        assert!(Cutter::taper(2.0, 1.0, 0.2, 1.0).is_err());
    }
}
