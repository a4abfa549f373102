//! The rotary angles for a tool axis: one spherical triangle for every machine.
//!
//! u₁ and u₂ are the directions of the rotary axes, z that of the spindle, a that of the tool. R₁(θ₁) R₂(θ₂)
//! z = a asks that b = R₂(θ₂) z stands at the angle φ of a from u₁, which R₁ does not change. The triangle of
//! u₁, u₂ and b has the sides γ (u₁ to u₂), δ (u₂ to b) and φ, so that its angle Θ at u₂ comes from the three
//! sides (half-angle formula, exact for small and for great angles alike), and θ₂ = θ₂₀ ± Θ, with θ₂₀ where b
//! is nearest to u₁. The angle ψ at u₁ then tells how far R₁ has to turn: θ₁ = azimuth(a) ± ψ.

use geometry::{Vector3, angle_between};
use std::f64::consts::{FRAC_PI_2, PI};

/// How far beyond reach, rad, a tool axis may be by rounding; it is then taken at the edge. Also where
/// the first axis counts as free. 1e-10 moves the end of a cutter of 100 mm by 1e-8 mm.
pub(super) const SLACK: f64 = 1e-10;

/// What does not depend on the tool axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Triangle {
    /// Direction of the first axis.
    pub pole: Vector3,
    /// Across the first axis: towards the second, and square to both.
    across: [Vector3; 2],
    /// γ and δ.
    between: f64,
    tilt: f64,
    /// θ₂₀.
    zero: f64,
}

/// What depends on it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Solved {
    /// Of the tool axis about the first, rad, −π..=π.
    pub azimuth: f64,
    /// Θ, 0..=π.
    pub turn: f64,
    /// ψ, 0..=π.
    pub lead: f64,
    /// Angle to the nearer end of the first axis, rad.
    pub from_pole: f64,
}

impl Triangle {
    /// Of two unit vectors that are not parallel, the second not along z.
    pub fn new(first: Vector3, second: Vector3) -> Self {
        let z = Vector3::z();
        let towards = (second - first * first.dot(&second)).normalize();
        let level = z.dot(&first) - second.dot(&z) * second.dot(&first);
        Self {
            pole: first,
            across: [towards, first.cross(&towards)],
            between: angle_between(&first, &second),
            tilt: angle_between(&second, &z),
            zero: second.dot(&z.cross(&first)).atan2(level),
        }
    }

    /// Least and greatest φ.
    pub fn reach(&self) -> [f64; 2] {
        let sum = self.between + self.tilt;
        [(self.between - self.tilt).abs(), sum.min(2.0 * PI - sum)]
    }

    /// `None` out of reach, or for what is no direction.
    pub fn solve(&self, axis: &Vector3) -> Option<Solved> {
        let (g, d, phi) = (self.between, self.tilt, angle_between(&self.pole, axis));
        let differences =
            [0.5 * (phi + d - g), 0.5 * (phi + g - d), 0.5 * (g + d - phi), PI - 0.5 * (g + d + phi)];
        if !(differences.iter().all(|x| *x >= -SLACK) && axis.norm() > 0.0) {
            return None;
        }
        let [p, q, r, s] = differences.map(|x| x.max(0.0).sin());
        let turn = 2.0 * (p * q).sqrt().atan2((r * s).sqrt());
        let from_pole = phi.min(PI - phi);
        let (sin, sin_half) = (turn.sin(), (0.5 * turn).sin());
        let lead = if from_pole < SLACK {
            // Its limit.
            FRAC_PI_2
        } else {
            // b along `across[0]`: cos δ sin γ − sin δ cos γ cos Θ, without what cancels.
            let along = (g - d).sin() + 2.0 * d.sin() * g.cos() * sin_half * sin_half;
            (d.sin() * sin).atan2(along)
        };
        let azimuth = axis.dot(&self.across[1]).atan2(axis.dot(&self.across[0]));
        Some(Solved { azimuth, turn, lead, from_pole })
    }

    /// θ₁ and θ₂ on one side of the triangle (1 or −1), with `azimuth` in place of the tool axis' own.
    pub fn angles(&self, azimuth: f64, solved: &Solved, side: f64) -> [f64; 2] {
        [azimuth + side * solved.lead, self.zero + side * solved.turn]
    }
}
