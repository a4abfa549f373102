//! Whether shapes cover a stadium (all that is near to a straight line) whole, told by samples of its rim
//! with a margin that makes it sure.
//!
//! Of convex shapes that hold the middle of the stadium the rim is enough: with a place of the rim such a
//! shape holds all of the straight line from the middle to there.

use crate::Vector2;
use std::f64::consts::TAU;

/// Places of a unit circle, those first that are far from each other: they mostly tell that a stadium is not
/// covered.
#[derive(Debug, Clone)]
pub struct RimSamples {
    directions: Vec<Vector2>,
}

impl RimSamples {
    /// Directions, a power of two. More take longer, and find more stadiums covered.
    const COUNT: usize = 256;

    /// How far around a sample a shape has to reach, over the radius of the stadium.
    pub const MARGIN: f64 = 0.5 * TAU / Self::COUNT as f64;

    /// The samples.
    pub fn new() -> Self {
        let bits = Self::COUNT.trailing_zeros();
        let order = (0..Self::COUNT).map(|k| k.reverse_bits() >> (usize::BITS - bits));
        let at = |k: usize| {
            let (sin, cos) = (TAU * k as f64 / Self::COUNT as f64).sin_cos();
            Vector2::new(cos, sin)
        };
        Self { directions: order.map(at).collect() }
    }

    /// The first place of the rim that convex `shapes`, which all hold the middle between both ends, leave bare of
    /// the stadium of this radius around `ends`; `None` where they cover it. `covers` tells whether a shape holds
    /// all that is within [`RimSamples::MARGIN`] (times the radius) of a place. The order of the shapes changes.
    pub fn first_bare<T>(
        &self,
        [a, b]: [Vector2; 2],
        radius: f64,
        shapes: &mut [T],
        covers: impl Fn(&T, &Vector2) -> bool,
    ) -> Option<Vector2> {
        let along = b - a;
        let length = along.norm();
        let mut is_bare = |p: &Vector2| {
            // Mostly it is the shape that covers the place before.
            let found = shapes.iter().position(|shape| covers(shape, p));
            found.inspect(|k| shapes.swap(0, *k)).is_none()
        };
        let on_rounds = |out: &Vector2| (if out.dot(&along) > 0.0 { b } else { a }) + out * radius;
        let bare = self.directions.iter().map(on_rounds).find(&mut is_bare);
        if bare.is_some() || length == 0.0 {
            return bare;
        }
        let across = Vector2::new(-along.y, along.x) * (radius / length);
        let steps = (length / (2.0 * Self::MARGIN * radius)).ceil();
        let mut on_sides = (0..=steps as usize)
            .flat_map(|k| [1.0, -1.0].map(|side| a + along * (k as f64 / steps) + across * side));
        on_sides.find(is_bare)
    }
}

impl Default for RimSamples {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Discs of radius 1 about the corners of a polygon: whether they cover the one in its middle.
    fn covered_by(corners: u32, away: f64) -> bool {
        let turn = |k| TAU * f64::from(k) / f64::from(corners);
        let mut discs: Vec<Vector2> =
            (0..corners).map(|k| Vector2::new(turn(k).cos(), turn(k).sin()) * away).collect();
        let within = 1.0 - RimSamples::MARGIN;
        let bare = RimSamples::new()
            .first_bare([Vector2::zeros(); 2], 1.0, &mut discs, |c, p| (c - p).norm() <= within);
        bare.is_none()
    }

    #[test]
    fn a_disc_is_covered_by_discs_around_it_or_shows_a_gap() {
        // Of n discs at a distance d, neighbours cross at d cos(π/n) + √(1 − (d sin(π/n))²) from the middle.
        assert!(covered_by(12, 0.6) && covered_by(6, 0.5) && covered_by(12, 0.02) && covered_by(3, 0.2));
        assert!(!covered_by(6, 0.01), "closer than the margin");
        assert!(!covered_by(2, 0.5), "gaps at the rim");
        assert!(!covered_by(0, 0.0));
    }

    /// Rings of discs about both ends of a line cover its stadium; without those on one side its flank shows.
    #[test]
    fn sides_of_a_stadium_are_looked_at() {
        let within = 1.0 - RimSamples::MARGIN;
        let covered = |least: f64, half: f64| {
            let around = |x: f64| {
                (0..8).map(move |k| f64::from(k) * TAU / 8.0).map(move |t| (x + 0.3 * t.cos(), 0.3 * t.sin()))
            };
            let both = around(-half).chain(around(half)).filter(|disc| disc.1 > least);
            let mut discs: Vec<Vector2> = both.map(|(x, y)| Vector2::new(x, y)).collect();
            let ends = [Vector2::new(-half, 0.0), Vector2::new(half, 0.0)];
            let bare = RimSamples::new().first_bare(ends, 1.0, &mut discs, |c, p| (c - p).norm() <= within);
            bare.is_none()
        };
        assert!(covered(-1.0, 0.5) && !covered(-0.1, 0.5));
        // Discs that high cross between the ends where x = 0, at 0.3 + sqrt(1 - half²) at least.
        assert!(covered(-1.0, 0.68) && !covered(-1.0, 0.9));
    }
}
