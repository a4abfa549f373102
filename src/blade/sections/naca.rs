//! NACA four-digit profiles: camber line, thickness and both sides, on a chord from 0 to 1.
//!
//! Enters: greatest camber `m`, its place `p` and the thickness `t`, shares of the chord. Leaves: points of
//! both sides at a place `x` of the chord: the half thickness is laid off at right angles to the camber line
//! (Jacobs, Ward, Pinkerton, *The characteristics of 78 related airfoil sections*, NACA report 460, 1933):
//!
//! - camber `m/p² (2px − x²)` before `p`, `m/(1−p)² (1 − 2p + 2px − x²)` behind it;
//! - half thickness `5t (0.2969 √x − 0.126 x − 0.3516 x² + 0.2843 x³ − 0.1015 x⁴)`; with 0.1036 in place of
//!   0.1015 the sides meet at the trailing edge.
//!
//! The suction side is the upper one, of greater y.

use geometry::{Point2, Vector2};

/// Factors of √x, x, x² and x³; that of x⁴ depends on the trailing edge.
const THICKNESS: [f64; 4] = [0.2969, -0.1260, -0.3516, 0.2843];
/// Factor of x⁴ as published: half of 0.0021 t is left at the trailing edge for each t.
const OPEN: f64 = -0.1015;
/// Factor of x⁴ that closes the trailing edge.
const CLOSED: f64 = -0.1036;

/// Thicknesses that make a blade, shares of the chord.
pub(super) const THICKNESSES: std::ops::RangeInclusive<f64> = 0.005..=0.5;

/// What the four digits say, shares of the chord.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NacaDigits {
    /// Greatest camber, 0 to 0.09.
    pub camber: f64,
    /// Its place, 0.1 to 0.9; 0 where there is no camber.
    pub position: f64,
    /// Thickness, 0.01 to 0.5.
    pub thickness: f64,
}

/// Why there is no such profile.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ProfileError {
    /// Not four digits.
    #[error("\"{0}\" is no NACA number of four digits")]
    Digits(String),
    /// Camber without a place.
    #[error(
        "\"{0}\" has camber at no place: the second digit, tenths of the chord, must be 1 to 9 unless the \
         first is 0"
    )]
    NoPosition(String),
    /// No thickness, or too much.
    #[error("the thickness is {0} of the chord; it must be from 0.005 to 0.5")]
    Thickness(f64),
    /// Camber or its place out of range.
    #[error(
        "camber {camber} at {position} of the chord is out of range; camber may be 0 to 0.1, at 0.05 to 0.95"
    )]
    Camber {
        /// Greatest camber.
        camber: f64,
        /// Its place.
        position: f64,
    },
}

impl NacaDigits {
    /// Reads four digits such as `2412`: camber in hundredths, its place in tenths, thickness in hundredths.
    ///
    /// # Errors
    /// [`ProfileError`] when they are no four digits or make no profile.
    pub fn parse(text: &str) -> Result<Self, ProfileError> {
        let shown = || text.chars().take(20).collect::<String>();
        let digits: Option<Vec<f64>> = text.chars().map(|c| c.to_digit(10).map(f64::from)).collect();
        let Some([camber, position, tens, ones]) = digits.as_deref() else {
            return Err(ProfileError::Digits(shown()));
        };
        let found = Self {
            camber: camber / 100.0,
            position: if *camber == 0.0 { 0.0 } else { position / 10.0 },
            thickness: (10.0 * tens + ones) / 100.0,
        };
        if found.camber > 0.0 && found.position == 0.0 {
            return Err(ProfileError::NoPosition(shown()));
        }
        NacaProfile::new(found.camber, found.position, found.thickness, false).map(|_| found)
    }
}

/// A profile on the chord from (0, 0) to (1, 0).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NacaProfile {
    camber: f64,
    position: f64,
    /// Where the camber line changes from one parabola to the other.
    change: f64,
    thickness: f64,
    fourth: f64,
}

impl NacaProfile {
    /// A profile of greatest camber `camber` at `position` and of a thickness, shares of the chord (0 to 0.1,
    /// 0.05 to 0.95, 0.005 to 0.5; the position does not matter without camber), with a trailing edge that is
    /// closed or, as published, open.
    ///
    /// # Errors
    /// [`ProfileError`] for numbers out of these ranges.
    pub fn new(camber: f64, position: f64, thickness: f64, closed: bool) -> Result<Self, ProfileError> {
        if !THICKNESSES.contains(&thickness) {
            return Err(ProfileError::Thickness(thickness));
        }
        if !(0.0..=0.1).contains(&camber) || (camber > 0.0 && !(0.05..=0.95).contains(&position)) {
            return Err(ProfileError::Camber { camber, position });
        }
        let fourth = if closed { CLOSED } else { OPEN };
        Ok(Self { camber, position, change: position, thickness, fourth })
    }

    /// The profile with the parabola ahead of the greatest camber, or that behind it, for the whole camber
    /// line. The camber line's curvature jumps from one to the other, and both sides have a corner there;
    /// those of this profile have none.
    pub(super) fn continued(&self, ahead: bool) -> Self {
        Self { change: if ahead { f64::INFINITY } else { f64::NEG_INFINITY }, ..*self }
    }

    /// Whether a place is ahead of the greatest camber.
    pub(super) fn is_ahead(&self, x: f64) -> bool {
        x < self.position
    }

    /// Height of the camber line at `x` with its first and second derivative.
    pub fn camber(&self, x: f64) -> [f64; 3] {
        let (m, p) = (self.camber, self.position);
        if m == 0.0 {
            return [0.0; 3];
        }
        let ahead = x < self.change;
        let k = if ahead { m / (p * p) } else { m / ((1.0 - p) * (1.0 - p)) };
        let constant = if ahead { 0.0 } else { 1.0 - 2.0 * p };
        [k * (constant + 2.0 * p * x - x * x), k * 2.0 * (p - x), -2.0 * k]
    }

    /// Half thickness at `x` from 0 to 1, and its derivative (infinite at 0).
    pub fn half_thickness(&self, x: f64) -> [f64; 2] {
        let [a, b, c, d] = THICKNESS;
        let (e, root) = (self.fourth, x.max(0.0).sqrt());
        let height = a * root + x * (b + x * (c + x * (d + x * e)));
        let slope = 0.5 * a / root + b + x * (2.0 * c + x * (3.0 * d + x * 4.0 * e));
        [5.0 * self.thickness * height, 5.0 * self.thickness * slope]
    }

    /// Point of the upper or the lower side over the place `x` (0 to 1) of the camber line.
    pub fn point(&self, x: f64, upper: bool) -> Point2 {
        let [y, slope, _] = self.camber(x);
        let half = if upper { self.half_thickness(x)[0] } else { -self.half_thickness(x)[0] };
        // Sine and cosine of the slope angle.
        let cosine = 1.0 / slope.hypot(1.0);
        Point2::new(x - half * slope * cosine, y + half * cosine)
    }

    /// Derivative of [`point`](Self::point) by `x`, for `x` above 0.
    pub fn tangent(&self, x: f64, upper: bool) -> Vector2 {
        let [_, slope, bend] = self.camber(x);
        let sign = if upper { 1.0 } else { -1.0 };
        let [half, rise] = self.half_thickness(x).map(|v| sign * v);
        let cosine = 1.0 / slope.hypot(1.0);
        let sine = slope * cosine;
        let turn = bend * cosine * cosine;
        Vector2::new(1.0 - rise * sine - half * cosine * turn, slope + rise * cosine - half * sine * turn)
    }

    /// Points of a side from the leading edge to `end` (a place of the chord, 1 for the trailing edge), close
    /// near both ends: `x = end · (1 − cos β)/2` in equal steps of β. `count` points, 2 or more.
    pub fn side(&self, count: usize, end: f64, upper: bool) -> Vec<Point2> {
        let last = count.max(2) - 1;
        let place = |k: usize| 0.5 * end * (1.0 - (std::f64::consts::PI * k as f64 / last as f64).cos());
        (0..=last).map(|k| self.point(place(k), upper)).collect()
    }
}
