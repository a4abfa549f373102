//! Ball and circular section: height from step, step from height, both ways exact.
//!
//! Across the feed the surface is a circle of curvature κ (a line where κ = 0) and the ball's centres stand
//! `(1 − κr)/κ` from its middle. The law of cosines in the triangle of that middle, a ball's centre and the
//! ridge gives, with `g = (2/κ · sin(κs/4))²` for the arc `s`,
//!
//! ```text
//! h (2r − h) = (1 − κr)(1 − κh) g
//! ```
//!
//! a quadratic in `h` and linear in `g`. Nothing in it cancels as κ goes to zero, where `g = s²/4`, so one
//! form serves flat, convex and concave sections. It is the same as
//! `h = σ[(ρ+σr)cos(θ/2) − ρ] − √(r² − (ρ+σr)² sin²(θ/2))`, which loses as many digits as ρ is longer than h.

use super::ScallopError;
use super::error::positive;

/// Sections of less curvature times radius than this share below one count as not fitting: the ball's centres
/// would then all stand in one place.
const LEAST_ROOM: f64 = 1e-9;

/// A ball on a circular section across the feed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BallSection {
    radius: f64,
    curvature: f64,
    /// `1 − κr`: how much longer the track of the centres is than that of the contacts.
    stretch: f64,
}

/// The step that leaves a scallop height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScallopStep {
    /// Along the surface, mm.
    pub arc: f64,
    /// Between the contacts, mm.
    pub chord: f64,
    /// True where any step leaves less than the height, since the section is nearly as concave as the ball;
    /// the step is then half of its circle.
    pub limited: bool,
}

impl BallSection {
    /// A ball of radius `radius`, mm, on a section of curvature `curvature`, 1/mm, positive concave.
    ///
    /// # Errors
    /// [`ScallopError::Range`] for numbers that are none; [`ScallopError::DoesNotFit`] where the section is
    /// as concave as the ball or more.
    pub fn new(radius: f64, curvature: f64) -> Result<Self, ScallopError> {
        positive("the radius of the ball", radius)?;
        if !curvature.is_finite() {
            let wanted = "a finite number of 1/mm";
            return Err(ScallopError::Range {
                what: "the curvature of the section",
                value: curvature,
                wanted,
            });
        }
        let stretch = 1.0 - curvature * radius;
        if stretch < LEAST_ROOM {
            let section = 1.0 / curvature;
            return Err(ScallopError::DoesNotFit { ball: radius, section, diameter: 2.0 * section });
        }
        Ok(Self { radius, curvature, stretch })
    }

    /// Radius of the ball, mm.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Curvature of the section, 1/mm, positive concave.
    pub fn curvature(&self) -> f64 {
        self.curvature
    }

    /// Scallop height, mm, between passes `arc` mm apart along the surface.
    ///
    /// # Errors
    /// [`ScallopError::Step`] when the two balls do not meet, or stand more than half of a circle apart.
    ///
    /// # Tolerance
    /// A few rounding errors of the height itself, up to where the balls hardly meet.
    pub fn height(&self, arc: f64) -> Result<f64, ScallopError> {
        positive("the step", arc)?;
        let greatest = self.greatest_step();
        // A hair beyond is rounding.
        if arc > greatest.arc * (1.0 + 1e-12) {
            return Err(ScallopError::Step { step: arc, ball: self.radius, greatest: greatest.arc });
        }
        let sine = sine_over(0.25 * self.curvature * arc) * 0.5 * arc;
        Ok(self.height_of(sine * sine))
    }

    /// As [`BallSection::height`], of contacts `chord` mm apart in space.
    ///
    /// # Errors
    /// As [`BallSection::height`].
    pub fn height_of_chord(&self, chord: f64) -> Result<f64, ScallopError> {
        positive("the step", chord)?;
        let greatest = self.greatest_step();
        if chord > greatest.chord * (1.0 + 1e-12) {
            return Err(ScallopError::Step { step: chord, ball: self.radius, greatest: greatest.chord });
        }
        let sine = (0.5 * self.curvature * chord).clamp(-1.0, 1.0);
        Ok(self.height_of(0.5 * chord * chord / (1.0 + (1.0 - sine * sine).sqrt())))
    }

    /// The step that leaves a scallop of `height` mm.
    ///
    /// # Errors
    /// [`ScallopError::Height`] when no step leaves so high a ridge.
    pub fn step(&self, height: f64) -> Result<ScallopStep, ScallopError> {
        positive("the scallop height", height)?;
        let highest = self.greatest_height();
        if height > highest * (1.0 + 1e-12) {
            // On a concave section of more than the ball's diameter there is a highest ridge; on a narrower
            // one every step up to half a circle leaves less.
            return if 2.0 * self.curvature * self.radius > 1.0 {
                Ok(ScallopStep { limited: true, ..self.greatest_step() })
            } else {
                Err(ScallopError::Height { height, ball: self.radius, greatest: highest })
            };
        }
        let height = height.min(highest);
        let room = self.stretch * (1.0 - self.curvature * height);
        Ok(self.step_of(height * (2.0 * self.radius - height) / room))
    }

    /// The step to second order, `√(8h/(1/r − κ))`, mm: short to print, and too wide where κ is 0.
    pub fn second_order_step(&self, height: f64) -> f64 {
        (8.0 * height * self.radius / self.stretch).sqrt()
    }

    /// The height to second order, `s²(1/r − κ)/8`, mm.
    pub fn second_order_height(&self, arc: f64) -> f64 {
        arc * arc * self.stretch / (8.0 * self.radius)
    }

    /// The widest step that leaves a ridge and nothing else.
    pub fn greatest_step(&self) -> ScallopStep {
        self.step_of(self.greatest_g())
    }

    /// The height that it leaves, mm.
    pub fn greatest_height(&self) -> f64 {
        self.height_of(self.greatest_g())
    }

    /// `g` where the centres are a diameter apart, or half of a concave circle if that is nearer.
    fn greatest_g(&self) -> f64 {
        let (r, k, q) = (self.radius, self.curvature, self.stretch);
        // Sine of half the angle between the passes.
        let sine = k * r / q;
        if sine >= 1.0 {
            return 2.0 / (k * k);
        }
        let chord = r / q;
        2.0 * chord * chord / (1.0 + ((1.0 - sine) * (1.0 + sine)).max(0.0).sqrt())
    }

    fn height_of(&self, g: f64) -> f64 {
        let w = self.stretch * g;
        let b = 2.0 * self.radius + self.curvature * w;
        2.0 * w / (b + (b * b - 4.0 * w).max(0.0).sqrt())
    }

    fn step_of(&self, g: f64) -> ScallopStep {
        let half = g.sqrt();
        // Sine of a quarter of the angle; half of a circle is its greatest.
        let sine = (0.5 * self.curvature * half).clamp(-1.0, 1.0);
        let arc = 2.0 * half * if sine.abs() < 1e-4 { 1.0 + sine * sine / 6.0 } else { sine.asin() / sine };
        ScallopStep { arc, chord: 2.0 * half * (1.0 - sine * sine).sqrt(), limited: false }
    }
}

/// `sin x / x`.
fn sine_over(x: f64) -> f64 {
    if x.abs() < 1e-4 { 1.0 - x * x / 6.0 } else { x.sin() / x }
}

/// Exact scallop height, mm, of a ball of radius `r` between two passes an arc `s` apart on a circular
/// section of curvature `kappa` (1/mm, positive concave); `None` when the ball does not reach across or does
/// not fit.
pub fn ball_scallop_height(r: f64, kappa: f64, s: f64) -> Option<f64> {
    BallSection::new(r, kappa).and_then(|section| section.height(s)).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn section(r: f64, k: f64) -> BallSection {
        BallSection::new(r, k).unwrap()
    }

    /// The formula as it is usually printed, `k` not zero.
    fn printed(r: f64, k: f64, s: f64) -> f64 {
        let (rho, sigma) = (1.0 / k.abs(), -k.signum());
        let (c, half) = (rho + sigma * r, 0.5 * s / rho);
        sigma * (c * half.cos() - rho) - (r * r - (c * half.sin()).powi(2)).sqrt()
    }

    #[test]
    fn heights_and_steps_of_flat_convex_and_concave_sections() {
        let h = |r, k, s| section(r, k).height(s).unwrap();
        assert!((h(5.0, 0.0, 1.0) - (5.0 - 24.75f64.sqrt())).abs() < 1e-14);
        assert!((h(3.0, 0.0, 0.5) - (3.0 - 8.9375f64.sqrt())).abs() < 1e-14);
        let arc = |k| section(5.0, k).step(0.01).unwrap().arc;
        assert!((arc(0.0) - 2.0 * (0.1f64 - 1e-4).sqrt()).abs() < 1e-14);
        assert!((arc(-0.02) - 0.602_661_8).abs() < 5e-8 && (arc(0.02) - 0.666_401_1).abs() < 5e-8);
        let chord = |h| section(0.25, 1.0 / 0.75).step(h).unwrap().chord;
        assert!((chord(0.0075) - 0.149_435).abs() < 5e-7 && (chord(0.01) - 0.172_333).abs() < 5e-7);
    }

    #[test]
    fn the_chord_between_contacts_is_that_of_the_closed_form() {
        for (sigma, rho, r, h) in [(1.0, 50.0, 5.0, 0.01), (-1.0, 0.75, 0.25, 0.0075), (1.0, 2.0, 5.0, 0.3)] {
            let (c, d) = (rho + sigma * r, rho + sigma * h);
            let product: f64 = h * (2.0 * r - h) * (2.0 * rho + sigma * h) * (2.0 * c + sigma * h);
            let exact = rho * product.sqrt() / (c * d);
            let step = section(r, -sigma / rho).step(h).unwrap();
            assert!((step.chord - exact).abs() < 1e-12 * exact, "{} {exact}", step.chord);
            assert!((step.chord - 2.0 * rho * (0.5 * step.arc / rho).sin()).abs() < 1e-12 * exact);
        }
    }

    /// Where the printed form still has its digits, and beyond, by its own series.
    #[test]
    fn nearly_flat_sections_go_over_into_flat_ones() {
        for k in [0.1, 1e-2, 1e-3, -1e-3, -1e-2, -0.1] {
            assert!((section(5.0, k).height(0.6).unwrap() - printed(5.0, k, 0.6)).abs() < 1e-13 / k.abs());
        }
        let flat = section(5.0, 0.0).height(0.6).unwrap();
        for k in [1e-4, 1e-7, 1e-10, 1e-13, 1e-300] {
            // h changes by −κ times this, by differentiating the quadratic at κ = 0.
            let (r, g) = (5.0, 0.09);
            let slope = -(r + flat) * g / (2.0 * r - 2.0 * flat);
            for k in [k, -k] {
                let h = section(r, k).height(0.6).unwrap();
                assert!((h - flat - slope * k).abs() < 1.0 * k * k + 1e-16, "{k}: {}", h - flat);
            }
        }
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let error = BallSection::new(5.0, 0.2).unwrap_err().to_string();
        assert!(error.contains("machinable limit") && error.contains("less than 10 mm"), "{error}");
        assert!(matches!(BallSection::new(5.0, 0.25), Err(ScallopError::DoesNotFit { .. })));
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(BallSection::new(bad, 0.0).is_err());
            assert!(section(5.0, 0.01).height(bad).is_err() && section(5.0, 0.01).step(bad).is_err());
            assert!(section(5.0, 0.01).height_of_chord(bad).is_err());
        }
        assert!(BallSection::new(5.0, f64::NAN).is_err());
        let flat = section(5.0, 0.0);
        assert!(
            (flat.greatest_step().arc - 10.0).abs() < 1e-14 && (flat.greatest_height() - 5.0).abs() < 1e-14
        );
        assert_eq!(flat.height(11.0), Err(ScallopError::Step { step: 11.0, ball: 5.0, greatest: 10.0 }));
        assert!(matches!(flat.step(5.1), Err(ScallopError::Height { .. })));
    }

    #[test]
    fn in_a_hollow_nearly_as_concave_as_the_ball_every_step_will_do() {
        let hollow = section(5.0, 1.0 / 5.05);
        let step = hollow.step(0.1).unwrap();
        assert!(step.limited && (step.arc - std::f64::consts::PI * 5.05).abs() < 1e-12);
        assert!((step.chord - 10.1).abs() < 1e-6);
        // Half a circle apart the ridge stands in the middle, over centres 0.05 from that of the circle.
        let exact = 5.05 - (25.0f64 - 0.0025).sqrt();
        assert!((hollow.greatest_height() - exact).abs() < 1e-12);
        assert!(!hollow.step(0.01).unwrap().limited);
    }

    #[test]
    fn the_second_order_is_right_to_second_order() {
        for k in [-0.1, 0.0, 0.1] {
            let off = |h: f64| {
                (section(5.0, k).second_order_step(h) / section(5.0, k).step(h).unwrap().arc - 1.0).abs()
            };
            assert!(
                off(0.01) < 1.1e-3 && off(0.1) < 1.1e-2 && off(0.01) < 0.2 * off(0.1),
                "{} {}",
                off(0.01),
                off(0.1)
            );
            let s = section(5.0, k);
            assert!((s.second_order_height(s.second_order_step(0.02)) - 0.02).abs() < 1e-15);
        }
    }

    proptest! {
        #[test]
        fn step_and_height_are_inverses(r in 0.1..20.0f64, bend in -5.0..0.95f64, share in 1e-4..0.98f64) {
            let s = section(r, bend / r);
            let arc = share * s.greatest_step().arc;
            let h = s.height(arc).unwrap();
            let back = s.step(h).unwrap();
            prop_assert!((back.arc / arc - 1.0).abs() < 1e-8, "{} {}", back.arc, arc);
            prop_assert!((s.height_of_chord(back.chord).unwrap() / h - 1.0).abs() < 1e-7);
        }

        /// The ridge is as far from both centres as the ball's radius.
        #[test]
        fn the_ridge_is_on_both_balls(r in 0.1..20.0f64, bend in -5.0..0.95f64, share in 1e-3..0.98f64) {
            let k = bend / r;
            prop_assume!(bend.abs() > 1e-3);
            let s = section(r, k);
            let arc = share * s.greatest_step().arc;
            let h = s.height(arc).unwrap();
            let (c, d, half) = (1.0 / k - r, 1.0 / k - h, 0.5 * arc * k);
            let distance = (c * c + d * d - 2.0 * c * d * half.cos()).sqrt();
            prop_assert!((distance - r).abs() < 1e-9 * r.max(1.0 / k.abs()), "{distance} {r}");
        }
    }
}
