//! Stepovers that keep the engagement where passes turn.
//!
//! Enters: the angle of the circumference that may stand in stock, the cutter's radius, the curvature of a
//! pass. Leaves: how far the pass may be from the one before; mm, rad.
//!
//! A loop costs many times its advance, so a pass beside cleared ground should need none. Stepovers therefore
//! follow the law of cosines where passes turn, and inner offsets have round corners.

use super::nest::closed_length;
use geometry::Point2;

/// What passes may have in stock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turning {
    /// Greatest angle of the circumference in stock, rad.
    pub limit: f64,
    /// The cutter's radius, mm.
    pub radius: f64,
}

impl Turning {
    /// How far a circle of the centre of the radius `rho`, mm, may be outside of one that was cut before:
    /// the arc beyond the ground of that one, `ρ + r − w` from the middle, ends at the limit by the law of
    /// cosines: `(ρ + r − w)² = ρ² + r² + 2 ρ r cos a`.
    pub fn ring_step(&self, rho: f64) -> f64 {
        let sum = rho + self.radius;
        sum - (sum * sum - 2.0 * rho * self.radius * (1.0 - self.limit.cos())).max(0.0).sqrt()
    }

    /// The stepover of a pass of this curvature, 1/mm, positive where it turns toward the stock that was
    /// cut before, mm. Where it turns away, that of a straight one does.
    pub fn step(&self, curvature: f64) -> f64 {
        /// Turns sharper than this radius over the cutter's are corners, which loops clear.
        const CORNER: f64 = 0.25;
        /// Curvature times radius below which the pass is straight: the difference of the two forms.
        const STRAIGHT: f64 = 1.0e-3;
        if curvature * self.radius < STRAIGHT {
            return self.radius * (1.0 - self.limit.cos());
        }
        self.ring_step((1.0 / curvature).max(CORNER * self.radius))
    }
}

/// Curvature of a closed curve at its points, 1/mm, positive where it turns left: of the circle through the
/// point and those `reach` mm before and after it.
pub fn curvatures(points: &[Point2], reach: f64) -> Vec<f64> {
    let n = points.len();
    let reach = reach.min(closed_length(points) / 6.0);
    let off = |k: usize, forwards: bool| {
        let (mut at, mut gone) = (k, 0.0);
        while gone < reach {
            let next = if forwards { (at + 1) % n } else { (at + n - 1) % n };
            gone += (points[next] - points[at]).norm();
            at = next;
        }
        points[at]
    };
    (0..n)
        .map(|k| {
            let (a, b, c) = (off(k, false), points[k], off(k, true));
            let product = (b - a).norm() * (c - b).norm() * (c - a).norm();
            if product > 0.0 { 2.0 * (b - a).perp(&(c - b)) / product } else { 0.0 }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// The arc beyond the ring cleared before has the limit's angle.
    #[test]
    fn stepovers_of_turns_follow_the_law_of_cosines() {
        for limit in [0.3f64, 1.0, 1.9] {
            let turning = Turning { limit, radius: 3.0 };
            let straight = 3.0 * (1.0 - limit.cos());
            assert_eq!((turning.step(0.0), turning.step(-0.2)), (straight, straight));
            assert!((turning.step(1e-3) - straight).abs() < 0.01 * straight);
            for rho in [1.0f64, 4.0, 20.0] {
                let before = rho + 3.0 - turning.step(1.0 / rho);
                let exact = rho * rho + 9.0 + 6.0 * rho * limit.cos();
                assert!((before * before - exact).abs() < 1e-9, "{limit} {rho}");
            }
        }
    }

    #[test]
    fn circles_have_their_curvature() {
        let circle = |sense: f64| {
            (0..90)
                .map(|k| sense * TAU * f64::from(k) / 90.0)
                .map(|a| Point2::new(5.0 * a.cos(), 5.0 * a.sin()))
                .collect::<Vec<_>>()
        };
        assert!(curvatures(&circle(1.0), 1.5).iter().all(|k| (k - 0.2).abs() < 1e-9));
        assert!(curvatures(&circle(-1.0), 1.5).iter().all(|k| (k + 0.2).abs() < 1e-9));
    }
}
