//! A straight move of the tip in the frame in which all swept cutters are evaluated: how far
//! along, how far across, and how steeply it rises. mm.

use geometry::Point3;

/// Moves shorter than this in the plan view, mm, count as plunges: only their lower end cuts. When
/// it grows, the plan-view travel of steep ramps is neglected; far below 1e-12 the slope of a
/// plunge from the highest allowed coordinate would leave the range in which products stay exact.
const PLUNGE_LENGTH: f64 = 1.0e-12;

/// A straight move seen from its lower end, so that it never falls. A lower envelope does not
/// depend on the direction of travel; taking the lower end first makes a move and its reverse the
/// same record, bit for bit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Track {
    /// The lower end of the tip's path.
    pub x: f64,
    pub y: f64,
    pub z: f64,
    /// Unit direction in the plan view, from the lower end to the higher.
    pub ux: f64,
    pub uy: f64,
    /// Length in the plan view.
    pub length: f64,
    /// Rise over plan-view length, `>= 0`.
    pub slope: f64,
    /// Cosine of the angle of rise.
    pub cos: f64,
}

impl Track {
    /// From the ends of the tip's path, in either order.
    pub fn new(from: Point3, to: Point3) -> Self {
        let descends = Self::falls(from, to);
        let (low, high) = if descends { (to, from) } else { (from, to) };
        let (dx, dy, rise) = (high.x - low.x, high.y - low.y, high.z - low.z);
        let length = (dx * dx + dy * dy).sqrt();
        let at = Self { x: low.x, y: low.y, z: low.z, ux: 1.0, uy: 0.0, length: 0.0, slope: 0.0, cos: 1.0 };
        if length > PLUNGE_LENGTH {
            let cos = length / (length * length + rise * rise).sqrt();
            Self { ux: dx / length, uy: dy / length, length, slope: rise / length, cos, ..at }
        } else {
            at
        }
    }

    /// Whether the lower end is that where the move ends.
    pub fn falls(from: Point3, to: Point3) -> bool {
        (to.z, to.x, to.y) < (from.z, from.x, from.y)
    }

    /// Position of `(x, y)` along the track from its lower end, and across it (positive to the
    /// left).
    #[inline(always)]
    pub fn along_across(&self, x: f64, y: f64) -> (f64, f64) {
        let (dx, dy) = (x - self.x, y - self.y);
        (dx * self.ux + dy * self.uy, dy * self.ux - dx * self.uy)
    }

    /// Height of the tip at plan-view distance `sigma` from the lower end.
    #[inline(always)]
    pub fn tip(&self, sigma: f64) -> f64 {
        self.z + self.slope * sigma
    }

    /// Sine of the angle of rise.
    #[inline(always)]
    pub fn sin(&self) -> f64 {
        self.slope * self.cos
    }

    /// The vector `along` in the direction of the track plus `across` to its left, in x and y.
    pub fn in_plan(&self, along: f64, across: f64) -> [f64; 2] {
        [along * self.ux - across * self.uy, along * self.uy + across * self.ux]
    }
}

/// `a` or `b`, whichever is larger; the one machine instruction that [`f64::max`] is not, because
/// that also orders NaN.
#[inline(always)]
pub(crate) fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// `a` or `b`, whichever is smaller.
#[inline(always)]
pub(crate) fn smaller(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_move_and_its_reverse_are_one_track() {
        let (a, b) = (Point3::new(1.0, 2.0, 3.0), Point3::new(4.0, 6.0, 1.0));
        let track = Track::new(a, b);
        assert_eq!(track, Track::new(b, a));
        assert_eq!((track.z, track.length, track.slope), (1.0, 5.0, 0.4));
        assert!((track.sin().hypot(track.cos) - 1.0).abs() < 1e-15);
        assert_eq!(track.along_across(4.0, 6.0), (0.0, 0.0));
        let [x, y] = track.in_plan(5.0, 0.0);
        assert!((x + 3.0).abs() < 1e-15 && (y + 4.0).abs() < 1e-15);
    }

    #[test]
    fn a_plunge_keeps_its_lower_end_only() {
        let track = Track::new(Point3::new(1.0, 2.0, 30.0), Point3::new(1.0, 2.0, -3.0));
        assert_eq!((track.z, track.length, track.slope), (-3.0, 0.0, 0.0));
        assert!(size_of::<Track>() <= 64, "one cache line");
    }
}
