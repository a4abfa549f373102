//! How a control shares acceleration where it rounds corners by arcs.
//!
//! Enters: stretches with the speeds at their corners. Leaves: what of each stretch belongs to arcs, and the
//! acceleration along it there. The planner of LinuxCNC (G64 P) puts an arc into each corner. In the arc's
//! plane the axes allow a circle of accelerations, the least of their limits there. √3/2 of it is for the
//! bend and half of it for speeding up, so that both together stay within. An arc takes in what is left of
//! the line before it where that lasts less than a few cycles of the control. So a chain of short chords
//! speeds up with half of what its slowest axis allows.

use super::Machine;
use geometry::Vector3;

/// Acceleration at corners.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Blending {
    /// All of it, across as well as along the path.
    #[default]
    Full,
    /// √3/2 of it across and half of it along arcs, as LinuxCNC does.
    Arcs,
}

/// Share of the acceleration for the bend of an arc, √3/2, and along it.
const ACROSS: f64 = 0.866_025_403_784_438_6;
const ALONG: f64 = 0.5;

/// What is left of a line between arcs belongs to the one behind it where it lasts less than this, s: four
/// cycles of a millisecond.
const LEFT_OVER: f64 = 0.004;

/// Corners that turn by less than this, rad, are none.
const STRAIGHT: f64 = 1e-9;

impl Machine {
    /// What all axes allow in the plane of two directions, whichever way in it, mm/s².
    fn in_plane(&self, before: &Vector3, after: &Vector3) -> f64 {
        let Some(normal) = before.cross(after).try_normalize(STRAIGHT) else { return self.acceleration };
        let of_axis = |k: usize| self.accelerations[k] / (1.0 - normal[k] * normal[k]).max(0.0).sqrt();
        (0..3).map(of_axis).fold(self.acceleration, f64::min)
    }

    /// Acceleration across the path at a corner between two directions, mm/s².
    pub(super) fn across(&self, before: &Vector3, after: &Vector3) -> f64 {
        match self.blending {
            Blending::Full => self.acceleration,
            Blending::Arcs => ACROSS * self.in_plane(before, after),
        }
    }
}

/// A stretch between two corners: its direction, its length, and the squared speeds at both, mm and s.
#[derive(Debug, Clone, Copy)]
pub(super) struct Straight {
    pub direction: Vector3,
    pub length: f64,
    pub corners: [f64; 2],
}

/// What of a stretch belongs to the arcs at its ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Arcs {
    /// Lengths at its begin and at its end, mm.
    lengths: [f64; 2],
    /// Acceleration along them and between them, mm/s².
    along: [f64; 3],
    /// Squared speeds at the corners.
    corners: [f64; 2],
}

impl Arcs {
    /// Of a stretch between its neighbours.
    pub fn new(
        before: Option<&Straight>,
        here: &Straight,
        after: Option<&Straight>,
        machine: &Machine,
    ) -> Self {
        let arc = |pair: Option<(&Straight, &Straight)>, corner: f64| {
            let (a, b) = pair?;
            let (sin, cos) = (a.direction.cross(&b.direction).norm(), a.direction.dot(&b.direction));
            let half = 0.5 * sin.atan2(cos);
            let most = machine.in_plane(&a.direction, &b.direction);
            // The arc's radius times the tangent of half the turn.
            let length = corner / (ACROSS * most) * half.tan();
            (half > STRAIGHT).then(|| (length.min(0.5 * here.length), ALONG * most))
        };
        let free = f64::INFINITY;
        let first = arc(before.map(|before| (before, here)), here.corners[0]);
        let last = arc(after.map(|after| (here, after)), here.corners[1]);
        let lengths = [first, last].map(|arc| arc.map_or(0.0, |(length, _)| length));
        let left = here.length - lengths[0] - lengths[1];
        let of_last = last.filter(|_| left < LEFT_OVER * here.corners[1].sqrt());
        let along = [first, of_last, last].map(|arc| arc.map_or(free, |(_, along)| along));
        Self { lengths, along, corners: here.corners }
    }

    /// Divides stages, given by their lengths, where an arc ends or begins.
    pub fn divided(&self, stages: Vec<f64>) -> Vec<f64> {
        let whole: f64 = stages.iter().sum();
        let marks = [self.lengths[0], whole - self.lengths[1]];
        let mut at = 0.0;
        let mut divided = Vec::with_capacity(stages.len() + 2);
        for length in stages {
            let mut begin = at;
            at += length;
            for mark in marks {
                // Slivers would only be more stages.
                if mark - begin > 1e-3 * length && at - mark > 1e-3 * length {
                    divided.push(mark - begin);
                    begin = mark;
                }
            }
            divided.push(at - begin);
        }
        divided
    }

    /// The acceleration along a stage between two places of a stretch, mm/s², and the greatest squared speed
    /// at its begin.
    pub fn limits(&self, whole: f64, [begin, end]: [f64; 2]) -> [f64; 2] {
        let middle = 0.5 * (begin + end);
        if middle < self.lengths[0] {
            return [self.along[0], self.corners[0]];
        }
        if middle > whole - self.lengths[1] {
            return [self.along[2], self.corners[1]];
        }
        [self.along[1], f64::INFINITY]
    }
}
