//! The cutter's profile prepared for sweeping: heights, slopes and reach without trigonometry.
//! The profile itself is defined by [`Cutter`]. mm.

use super::track::larger;
use crate::cutter::Cutter;

/// Which formula sweeps the profile.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Family {
    /// One arc from the axis to the side.
    Ball,
    /// A disc only.
    Flat,
    /// A disc, an arc and a cone, any of which may be missing.
    Rounded,
}

/// A profile f(ρ): convex, never falling, 0 at the axis, defined up to the radius.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Form {
    pub family: Family,
    /// Radius of the flat disc.
    pub flat: f64,
    /// Radius of the arc.
    pub corner: f64,
    /// Largest radius.
    pub radius: f64,
    /// Where the arc ends and the cone begins.
    pub arc_end: f64,
    /// Sine and cosine of the angle between axis and side.
    pub sin_side: f64,
    pub cos_side: f64,
}

impl Form {
    pub fn new(cutter: &Cutter) -> Self {
        let (flat, corner, radius) = (cutter.flat_radius(), cutter.corner_radius(), cutter.radius());
        let arc_end = cutter.arc_end_radius();
        let family = if arc_end < radius || cutter.half_angle() > 0.0 {
            Family::Rounded
        } else if flat == 0.0 {
            Family::Ball
        } else if corner == 0.0 {
            Family::Flat
        } else {
            Family::Rounded
        };
        let (sin_side, cos_side) = cutter.half_angle().sin_cos();
        Self { family, flat, corner, radius, arc_end, sin_side, cos_side }
    }

    /// f(ρ) for `0 <= rho <= radius`. The square root is taken of a product of differences, so that
    /// near the side it loses no more than the rounding of `rho` itself costs.
    #[inline]
    pub fn height(&self, rho: f64) -> f64 {
        let x = rho - self.flat;
        if x <= 0.0 {
            return 0.0;
        }
        if rho <= self.arc_end {
            return self.corner - larger((self.corner - x) * (self.corner + x), 0.0).sqrt();
        }
        self.corner * (1.0 - self.sin_side) + (rho - self.arc_end) * self.cos_side / self.sin_side
    }

    /// Sine and cosine of the angle of the profile at ρ: f′ = sine/cosine, which may be infinite.
    pub fn steepness(&self, rho: f64) -> (f64, f64) {
        let x = rho - self.flat;
        if x <= 0.0 {
            return (0.0, 1.0);
        }
        if rho <= self.arc_end {
            let sine = if x < self.corner { x / self.corner } else { 1.0 };
            return (sine, ((1.0 - sine) * (1.0 + sine)).sqrt());
        }
        (self.cos_side, self.sin_side)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_are_those_of_the_cutter() {
        let angle = 20f64.to_radians();
        let cutters = [
            Cutter::ball(6.0).unwrap(),
            Cutter::flat(6.0).unwrap(),
            Cutter::bull(6.0, 1.0).unwrap(),
            Cutter::bull(6.0, 3.0).unwrap(),
            Cutter::taper(2.0, 1.0, angle, 6.0).unwrap(),
            Cutter::taper(2.0, 0.4, angle, 6.0).unwrap(),
            Cutter::taper(2.0, 0.0, angle, 6.0).unwrap(),
        ];
        for cutter in &cutters {
            let form = Form::new(cutter);
            for k in 0..=600 {
                let rho = 3.0 * f64::from(k) / 600.0;
                let (got, expected) = (form.height(rho), cutter.height(rho).unwrap());
                assert!((got - expected).abs() < 1e-13, "{cutter:?} at {rho}: {got} {expected}");
                let (sine, cosine) = form.steepness(rho);
                assert!((sine.hypot(cosine) - 1.0).abs() < 1e-14);
                let ahead = cutter.height(rho + 1e-7);
                if let Some(ahead) = ahead.filter(|_| cosine > 0.1) {
                    assert!(((ahead - expected) * 1e7 - sine / cosine).abs() < 1e-4 || rho == form.flat);
                }
            }
        }
        assert_eq!(Form::new(&cutters[3]).family, Family::Ball, "a bull nose without a disc is a ball");
    }
}
