//! The cutter's profile: height of the cutting surface above the tip as a function of the distance
//! from the axis. Lengths in mm, angles in rad.
//!
//! One profile serves all milling cutters of this crate: a flat disc of radius `e`, then an arc of
//! the corner radius, then a cone up to the largest radius (the APT cutter without its bottom
//! angle; ISO 4343 / APT `CUTTER`):
//!
//! ```text
//!            │        ╱   cone, half angle α from the axis (α = 0: a cylinder)
//!            │       ╱
//!            │      ⌒   arc of radius rc around (e, rc)
//!   axis ────┼──────     flat disc of radius e
//! ```
//!
//! The profile is convex and never falls with the distance from the axis. All that drops a cutter
//! or sweeps it relies on that.

/// Which family a cutter was made as; the profile itself no longer depends on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CutterShape {
    /// Ball end: the corner radius is half the diameter.
    Ball,
    /// Flat end: no corner radius.
    Flat,
    /// Bull nose: a corner radius less than half the diameter.
    Bull,
    /// Tapered ball or bull: a conical side.
    Taper,
}

/// Why no cutter could be made.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
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
}

/// A rotating cutter: dimensions of its profile. Always valid once made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cutter {
    shape: CutterShape,
    flat_radius: f64,
    corner_radius: f64,
    half_angle: f64,
    radius: f64,
}

fn positive(what: &'static str, value: f64) -> Result<f64, CutterError> {
    if value > 0.0 && value < 1.0e4 { Ok(value) } else { Err(CutterError::Length { what, value }) }
}

impl Cutter {
    /// A ball end of the given diameter (DC), mm.
    ///
    /// # Errors
    /// [`CutterError::Length`] unless the diameter is positive and finite.
    pub fn ball(diameter: f64) -> Result<Self, CutterError> {
        let radius = 0.5 * positive("diameter", diameter)?;
        let shape = CutterShape::Ball;
        Ok(Self { shape, flat_radius: 0.0, corner_radius: radius, half_angle: 0.0, radius })
    }

    /// A flat end of the given diameter (DC), mm.
    ///
    /// # Errors
    /// [`CutterError::Length`] unless the diameter is positive and finite.
    pub fn flat(diameter: f64) -> Result<Self, CutterError> {
        let radius = 0.5 * positive("diameter", diameter)?;
        let shape = CutterShape::Flat;
        Ok(Self { shape, flat_radius: radius, corner_radius: 0.0, half_angle: 0.0, radius })
    }

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
        let shape = CutterShape::Bull;
        Ok(Self { shape, flat_radius: radius - corner_radius, corner_radius, half_angle: 0.0, radius })
    }

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
        let shape = CutterShape::Taper;
        Ok(Self { shape, flat_radius: half - corner_radius, corner_radius, half_angle, radius })
    }

    /// The family the cutter was made as.
    pub fn shape(&self) -> CutterShape {
        self.shape
    }

    /// Radius of the flat disc at the tip, mm (0 for a ball).
    pub fn flat_radius(&self) -> f64 {
        self.flat_radius
    }

    /// Corner radius (RE), mm (0 for a flat end, the radius for a ball).
    pub fn corner_radius(&self) -> f64 {
        self.corner_radius
    }

    /// Angle between axis and side, rad (0 except for a taper).
    pub fn half_angle(&self) -> f64 {
        self.half_angle
    }

    /// Largest radius that cuts, mm (half of DC).
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Distance from the axis at which the arc ends and the cone or the cylinder begins.
    pub fn arc_end_radius(&self) -> f64 {
        (self.flat_radius + self.corner_radius * self.half_angle.cos()).min(self.radius)
    }

    /// Height of the cutting surface above the tip at distance `rho >= 0` from the axis; `None`
    /// beyond the cutter's radius.
    pub fn height(&self, rho: f64) -> Option<f64> {
        if rho > self.radius {
            return None;
        }
        let x = rho - self.flat_radius;
        if x <= 0.0 {
            return Some(0.0);
        }
        let rc = self.corner_radius;
        let arc_end = self.arc_end_radius();
        if rho <= arc_end {
            return Some(rc - (rc * rc - x * x).max(0.0).sqrt());
        }
        let arc_height = rc * (1.0 - self.half_angle.sin());
        Some(arc_height + (rho - arc_end) / self.half_angle.tan())
    }

    /// Height of the point of the profile at the cutter's largest radius, mm: above it the side is
    /// a cylinder.
    pub fn side_height(&self) -> f64 {
        let arc_end = self.arc_end_radius();
        let arc_height = self.corner_radius * (1.0 - self.half_angle.sin());
        if self.half_angle > 0.0 {
            arc_height + (self.radius - arc_end) / self.half_angle.tan()
        } else {
            arc_height
        }
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
        let end = taper.arc_end_radius();
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
