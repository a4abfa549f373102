//! Whether shapes cover a disc whole, told by samples with a margin that makes it sure.

use crate::Vector2;

/// Places of a disc about the origin, so close that every place of it lies within the margin of one; those farthest out first,
/// which mostly tell that a disc is not covered.
#[derive(Debug, Clone)]
pub struct DiscSamples {
    margin: f64,
    places: Vec<Vector2>,
}

impl DiscSamples {
    /// For discs up to `radius`, mm. A greater `margin` (mm) is quicker, and finds fewer discs covered.
    pub fn new(radius: f64, margin: f64) -> Self {
        let spacing = margin * std::f64::consts::SQRT_2;
        let most = ((radius + margin) / spacing).ceil() as i32;
        let grid = (-most..=most).flat_map(|i| (-most..=most).map(move |j| (i, j)));
        let places = grid.map(|(i, j)| Vector2::new(f64::from(i), f64::from(j)) * spacing);
        let mut places: Vec<Vector2> = places.filter(|p| p.norm() <= radius + margin).collect();
        places.sort_by(|a, b| b.norm().total_cmp(&a.norm()));
        Self { margin, places }
    }

    /// Whether `shapes` cover the disc of this radius. `covers` tells whether a shape covers all that is within the margin of a
    /// place. The order of the shapes changes.
    pub fn covered<T>(&self, radius: f64, shapes: &mut [T], covers: impl Fn(&T, &Vector2) -> bool) -> bool {
        let reach = (radius + self.margin).powi(2);
        self.places.iter().filter(|p| p.norm_squared() <= reach).all(|p| {
            // Mostly it is the shape that covers the place before.
            let found = shapes.iter().position(|shape| covers(shape, p));
            found.is_some_and(|k| {
                shapes.swap(0, k);
                true
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Discs of radius 1 about the corners of a polygon: whether they cover the one in its middle.
    fn covered_by(corners: u32, away: f64) -> bool {
        let turn = |k| std::f64::consts::TAU * f64::from(k) / f64::from(corners);
        let mut discs: Vec<Vector2> =
            (0..corners).map(|k| Vector2::new(turn(k).cos(), turn(k).sin()) * away).collect();
        DiscSamples::new(1.0, 0.05).covered(1.0, &mut discs, |c, p| (c - p).norm() <= 0.95)
    }

    #[test]
    fn a_disc_is_covered_by_discs_around_it_or_shows_a_gap() {
        // Of n discs at a distance d, neighbours cross at d cos(π/n) + √(1 − (d sin(π/n))²) from the middle.
        assert!(covered_by(12, 0.6) && covered_by(6, 0.5));
        assert!(!covered_by(6, 0.02), "the rim beyond them");
        assert!(!covered_by(12, 1.02), "the middle");
        assert!(!covered_by(2, 0.5), "gaps at the rim");
        assert!(!covered_by(0, 0.0));
    }
}
