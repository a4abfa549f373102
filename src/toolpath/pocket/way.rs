//! A way of the cutter's centre by its length, and the circles that touch it and fit into its room; mm.

use super::loops::LEAST;
use super::walls::Room;
use geometry::{Point2, Vector2};

/// A circle may be this share of the radius less than one that fits.
const FIT: f64 = 0.002;

/// Length of a polyline up to each of its points.
fn lengths(points: &[Point2]) -> Vec<f64> {
    let mut lengths = vec![0.0];
    for w in points.windows(2) {
        lengths.push(lengths[lengths.len() - 1] + (w[1] - w[0]).norm());
    }
    lengths
}

/// A polyline by its length.
pub(super) struct Way {
    pub points: Vec<Point2>,
    lengths: Vec<f64>,
}

impl Way {
    pub fn new(points: &[Point2]) -> Self {
        let mut points = points.to_vec();
        points.dedup();
        let lengths = lengths(&points);
        Self { points, lengths }
    }

    pub fn total(&self) -> f64 {
        self.lengths[self.lengths.len() - 1]
    }

    /// The side that ends at or after `s`.
    fn side(&self, s: f64) -> usize {
        self.lengths.partition_point(|l| *l < s).clamp(1, (self.points.len() - 1).max(1)) - 1
    }

    pub fn at(&self, s: f64) -> Point2 {
        let k = self.side(s);
        let Some(&b) = self.points.get(k + 1) else { return self.points[k] };
        let (a, long) = (self.points[k], self.lengths[k + 1] - self.lengths[k]);
        a + (b - a) * ((s - self.lengths[k]) / long).clamp(0.0, 1.0)
    }

    /// The direction in which the way comes to `s`.
    pub fn heading(&self, s: f64) -> Option<Vector2> {
        let side = self.side(s);
        (self.points.get(side + 1)? - self.points[side]).try_normalize(0.0)
    }

    /// The points of the polyline between two places.
    pub fn corners_between(&self, from: f64, to: f64) -> &[Point2] {
        let first = self.lengths.partition_point(|l| *l <= from);
        &self.points[first..self.lengths.partition_point(|l| *l < to).max(first)]
    }

    /// The next corner after `s` at which the way turns sharply, or its end.
    pub fn corner_after(&self, s: f64) -> f64 {
        /// Cosine of what is sharp.
        const SHARP: f64 = 0.9985;
        let first = self.lengths.partition_point(|l| *l <= s);
        for k in first..self.points.len() - 1 {
            let (a, b) = (self.points[k] - self.points[k - 1], self.points[k + 1] - self.points[k]);
            if a.dot(&b) < SHARP * a.norm() * b.norm() {
                return self.lengths[k];
            }
        }
        self.total()
    }
}

/// The greatest circle up to the radius `rho` that touches the way at `s` from one side and fits in.
pub(super) fn fitting(
    way: &Way,
    room: &Room,
    radius: f64,
    s: f64,
    rho: f64,
    side: f64,
) -> Option<(Point2, f64, Vector2)> {
    let at = way.at(s);
    let heading = way.heading(s)?;
    let inwards = Vector2::new(-heading.y, heading.x) * side;
    /// Each shrinks the circle to the wall that it crosses; a few suffice.
    const SHRINKS: usize = 40;
    let mut rho = rho;
    for _ in 0..SHRINKS {
        let centre = at + inwards * rho;
        let (wall, distance) = room.nearest(&centre)?;
        if distance >= rho - FIT * radius {
            return room.holds_place(&centre).then_some((centre, rho.min(distance), inwards));
        }
        let to = wall - at;
        let across = to.dot(&inwards);
        if across <= 0.0 {
            return None;
        }
        rho = rho.min(0.5 * to.norm_squared() / across) * (1.0 - 1e-9);
        if rho < LEAST * radius {
            return None;
        }
    }
    None
}
