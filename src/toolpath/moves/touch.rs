//! A tilted cutter where it touches the part.

use super::chord::Waypoint;
use cutter::Cutter;
use geometry::{Point3, Vector3};
use motion::{AxisError, CcPoint, ClPoint, ToolAxis, location};

/// The axis turns by no more than this in one move, rad: controls interpolate rotary axes, not the axis
/// itself, and the holder swings in between.
pub(crate) const GREATEST_TURN: f64 = 0.1;

/// A cutter touching the part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// Where it touches.
    pub contact: CcPoint,
    /// Unit feed direction.
    pub feed: Vector3,
    /// Where the cutter is.
    pub at: ClPoint,
    /// Height of the arc's centre above the tip, mm.
    height: f64,
    /// Distance of the arc's centre from the axis, mm.
    reach: f64,
}

impl Touch {
    /// A cutter that touches `contact` with its axis by a rule.
    pub fn by(rule: &ToolAxis, cutter: &Cutter, contact: CcPoint, feed: Vector3) -> Result<Self, AxisError> {
        Ok(Self::along(rule.at(&contact, &feed)?, cutter, contact, feed))
    }

    /// A cutter that touches `contact` with its axis along a unit vector.
    pub fn along(axis: Vector3, cutter: &Cutter, contact: CcPoint, feed: Vector3) -> Self {
        let profile = cutter.profile();
        let (height, reach) = (profile.centre_z, profile.centre_x.abs());
        Self { contact, feed, at: location(cutter, &contact, &axis), height, reach }
    }

    /// The centre of the arc's circle, on the axis.
    pub fn centre(&self) -> Point3 {
        on_axis(&self.at, self.height)
    }

    /// With the same axis and another centre.
    pub fn around(&self, centre: Point3) -> Self {
        Self { at: ClPoint { tip: centre - self.at.axis * self.height, axis: self.at.axis }, ..*self }
    }

    /// The same touch with the cutter at another location.
    #[cfg(test)]
    pub fn located(&self, at: ClPoint) -> Self {
        Self { at, ..*self }
    }

    /// The same place fed the other way.
    pub fn fed_back(&self) -> Self {
        Self { feed: -self.feed, ..*self }
    }
}

/// A point on the axis of a location.
fn on_axis(at: &ClPoint, height: f64) -> Point3 {
    at.tip + at.axis * height
}

impl Waypoint for Touch {
    fn stray(&self, from: &Self, to: &Self) -> f64 {
        if from.at.axis.dot(&to.at.axis) < GREATEST_TURN.cos() {
            return f64::INFINITY;
        }
        let [a, b, c] = [from, to, self].map(|touch| on_axis(&touch.at, self.height));
        let (d, turn) = (b - a, to.at.axis - from.at.axis);
        // On the spot the turn tells how far the move has come.
        let t = if d.norm_squared() > turn.norm_squared() * f64::EPSILON {
            (c - a).dot(&d) / d.norm_squared()
        } else {
            (self.at.axis - from.at.axis).dot(&turn) / turn.norm_squared().max(f64::MIN_POSITIVE)
        };
        let there = from.at.towards(&to.at, t.clamp(0.0, 1.0));
        (c - on_axis(&there, self.height)).norm() + self.reach * (self.at.axis - there.axis).norm()
    }

    fn is_at(&self, other: &Self) -> bool {
        self.at == other.at
    }
}
