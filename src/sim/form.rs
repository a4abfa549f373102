//! The cutter's profile prepared for sweeping, and which formula sweeps it. The profile itself is
//! defined by [`Cutter`]. mm.

use cutter::{Cutter, Profile};

/// Which formula sweeps the profile.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Family {
    /// One arc from the axis to the side.
    Ball,
    /// A disc only.
    Flat,
    /// A bottom, an arc and a cone, any of which may be missing.
    Rounded,
}

/// A profile f(ρ): convex, never falling, 0 at the axis, defined up to the radius.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Form {
    pub family: Family,
    /// Largest radius.
    pub radius: f64,
    pub profile: Profile,
}

impl Form {
    pub fn new(cutter: &Cutter) -> Self {
        Self::of(*cutter.profile())
    }

    /// Any profile: a cutter's, or that of what holds it.
    pub fn of(profile: Profile) -> Self {
        let family = match () {
            () if profile.is_ball() => Family::Ball,
            () if profile.is_flat() => Family::Flat,
            () => Family::Rounded,
        };
        Self { family, radius: profile.radius, profile }
    }

    /// Whether there is more than a disc and an arc up to the radius.
    pub fn has_cones(&self) -> bool {
        !self.profile.is_plain() || self.profile.arc_end < self.radius
    }

    /// f(ρ) for `0 <= rho <= radius`.
    #[inline]
    pub fn height(&self, rho: f64) -> f64 {
        self.profile.height(rho)
    }

    /// Sine and cosine of the angle of the profile at ρ: f′ = sine/cosine, which may be infinite.
    pub fn steepness(&self, rho: f64) -> (f64, f64) {
        let incline = self.profile.incline(rho);
        (incline.sin, incline.cos)
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
                let edge = [form.profile.bottom_end, form.profile.arc_end].contains(&rho);
                if let Some(ahead) = ahead.filter(|_| cosine > 0.1) {
                    assert!(((ahead - expected) * 1e7 - sine / cosine).abs() < 1e-4 || edge);
                }
            }
        }
        assert_eq!(Form::new(&cutters[3]).family, Family::Ball, "a bull nose without a disc is a ball");
    }
}
