//! Where the tool axis points at a contact, and the location of a tilted cutter that touches there.
//!
//! Enters: a contact with its outward normal, the feed direction, and a rule. Leaves: a unit axis from the
//! tip to the holder, and the location; mm, rad.

use crate::path::{CcPoint, ClPoint};
use cutter::Cutter;
use geometry::{Point3, Vector3, share_on};

/// An axis nearer to the surface than this (sine) lies along it.
const ALONG: f64 = 1e-9;

/// How the tool axis is chosen.
#[derive(Debug, Clone, PartialEq)]
pub enum ToolAxis {
    /// The same unit vector everywhere.
    Fixed(Vector3),
    /// Leaning from the normal of the surface: by `lead` forward in feed direction (a flat then cuts with its
    /// toe and lifts its heel), by `tilt` to the left of it, rad.
    LeadTilt {
        /// Forward, rad.
        lead: f64,
        /// To the left, rad.
        tilt: f64,
    },
    /// The holder towards a polyline, or a point, mm; the nearest point of it counts.
    Toward(Vec<Point3>),
    /// The holder away from a polyline, or a point, mm.
    Away(Vec<Point3>),
    /// The mean of unit vectors given at places (mm), weighed by the inverse square of the distance.
    Between(Vec<(Point3, Vector3)>),
}

/// Why there is no axis at a place.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum AxisError {
    /// The axis lies along the surface, or points into it.
    #[error(
        "the tool axis leans {degrees:.1} degrees from the surface's normal at ({x:.3}, {y:.3}, {z:.3}), and 90 or more would \
         cut with the shank; lean it less, or leave the place out"
    )]
    AlongSurface {
        /// Angle between axis and normal.
        degrees: f64,
        /// Place, mm.
        x: f64,
        /// Place, mm.
        y: f64,
        /// Place, mm.
        z: f64,
    },
    /// The rule gives no direction at a place.
    #[error(
        "no tool axis follows from the rule at ({x:.3}, {y:.3}, {z:.3}): the place is on its curve, or its vectors cancel out"
    )]
    None {
        /// Place, mm.
        x: f64,
        /// Place, mm.
        y: f64,
        /// Place, mm.
        z: f64,
    },
}

impl ToolAxis {
    /// The unit axis at a contact, with the unit feed direction there.
    ///
    /// # Errors
    /// [`AxisError`].
    pub fn at(&self, contact: &CcPoint, feed: &Vector3) -> Result<Vector3, AxisError> {
        let (p, n) = (contact.point, contact.normal);
        let [x, y, z] = [p.x, p.y, p.z];
        let from = |curve: &[Point3]| Some(nearest(curve, &p)? - p);
        let axis = match self {
            Self::Fixed(axis) => Some(*axis),
            Self::LeadTilt { lead, tilt } => {
                let forward = (feed - n * n.dot(feed)).try_normalize(1e-12);
                forward.map(|t| (n * lead.cos() + t * lead.sin()) * tilt.cos() + n.cross(&t) * tilt.sin())
            }
            Self::Toward(curve) => from(curve),
            Self::Away(curve) => from(curve).map(|v| -v),
            Self::Between(guides) => mean(guides, &p),
        };
        let axis = axis.and_then(|axis| axis.try_normalize(1e-9)).ok_or(AxisError::None { x, y, z })?;
        if axis.dot(&n) <= ALONG {
            let degrees = axis.dot(&n).clamp(-1.0, 1.0).acos().to_degrees();
            return Err(AxisError::AlongSurface { degrees, x, y, z });
        }
        Ok(axis)
    }

    /// True where the axis changes when the feed is reversed.
    pub fn follows_feed(&self) -> bool {
        matches!(self, Self::LeadTilt { lead, tilt } if *lead != 0.0 || *tilt != 0.0)
    }
}

/// The point of a polyline nearest to `p`; `None` for an empty one.
fn nearest(curve: &[Point3], p: &Point3) -> Option<Point3> {
    let on = |w: &[Point3]| w[0] + (w[1] - w[0]) * share_on(p, &w[0], &w[1]);
    let sides = curve.windows(2).map(on);
    sides
        .chain(curve.first().copied())
        .min_by(|a, b| (a - p).norm_squared().total_cmp(&(b - p).norm_squared()))
}

fn mean(guides: &[(Point3, Vector3)], p: &Point3) -> Option<Vector3> {
    if let Some((_, axis)) = guides.iter().find(|(at, _)| at == p) {
        return Some(*axis);
    }
    guides.iter().map(|(at, axis)| axis / (at - p).norm_squared()).reduce(|a, b| a + b)
}

/// The location of a cutter that touches `contact` and stands along the unit `axis`.
pub fn location(cutter: &Cutter, contact: &CcPoint, axis: &Vector3) -> ClPoint {
    ClPoint { tip: contact.point + cutter.contact_to_tip_along(&contact.normal, axis), axis: *axis }
}

/// A direction in the frame of a tool along `axis`, whose z is the axis.
pub fn in_tool_frame(axis: &Vector3, v: &Vector3) -> Vector3 {
    let across = if axis.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    let x = axis.cross(&across).normalize();
    Vector3::new(v.dot(&x), v.dot(&axis.cross(&x)), v.dot(axis))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn level() -> CcPoint {
        CcPoint { point: Point3::new(1.0, 2.0, 3.0), normal: Vector3::z() }
    }

    #[test]
    fn a_lead_moves_the_tip_and_not_the_ball() {
        let lead = 15f64.to_radians();
        let rule = ToolAxis::LeadTilt { lead, tilt: 0.0 };
        let axis = rule.at(&level(), &Vector3::x()).unwrap();
        assert!((axis - Vector3::new(lead.sin(), 0.0, lead.cos())).norm() < 1e-15);
        let ball = Cutter::ball(10.0).unwrap();
        let at = location(&ball, &level(), &axis);
        assert!(
            (at.tip + axis * 5.0 - (level().point + Vector3::z() * 5.0)).norm() < 1e-12,
            "the ball's centre"
        );
        let upright = location(&ball, &level(), &Vector3::z());
        assert!(((at.tip - upright.tip).norm() - 1.305_261_922).abs() < 1e-8, "2 r sin(λ/2)");
    }

    #[test]
    fn flat_and_bull_ends_touch_with_their_arc() {
        let (lead, contact) = (0.2f64, level());
        let axis = Vector3::new(lead.sin(), 0.0, lead.cos());
        let flat = location(&Cutter::flat(6.0).unwrap(), &contact, &axis);
        // The toe, a radius ahead of the axis, stands on the contact, and the heel is lifted.
        let toe = flat.tip + Vector3::new(lead.cos(), 0.0, -lead.sin()) * 3.0;
        assert!((toe - contact.point).norm() < 1e-12);
        let bull = location(&Cutter::bull(6.0, 1.0).unwrap(), &contact, &axis);
        let centre = bull.tip + axis + Vector3::new(lead.cos(), 0.0, -lead.sin()) * 2.0;
        assert!((centre - (contact.point + Vector3::z())).norm() < 1e-12);
        let square = location(&Cutter::flat(6.0).unwrap(), &contact, &Vector3::z());
        assert_eq!(square.tip, contact.point);
    }

    #[test]
    fn the_holder_points_to_and_from_points_and_curves() {
        let (contact, feed) = (level(), Vector3::x());
        let above = vec![Point3::new(1.0, 2.0, 13.0)];
        assert!((ToolAxis::Toward(above.clone()).at(&contact, &feed).unwrap() - Vector3::z()).norm() < 1e-15);
        assert!(matches!(ToolAxis::Away(above).at(&contact, &feed), Err(AxisError::AlongSurface { .. })));
        let line = vec![Point3::new(-9.0, 5.0, 6.0), Point3::new(9.0, 5.0, 6.0)];
        let axis = ToolAxis::Toward(line).at(&contact, &feed).unwrap();
        assert!((axis - Vector3::new(0.0, 0.5f64.sqrt(), 0.5f64.sqrt())).norm() < 1e-15);
        let here = ToolAxis::Toward(vec![contact.point]).at(&contact, &feed);
        assert!(matches!(here, Err(AxisError::None { .. })));
        let lying = ToolAxis::Fixed(Vector3::x()).at(&contact, &feed).unwrap_err();
        assert!(lying.to_string().starts_with("the tool axis leans 90.0 degrees"), "{lying}");
    }

    #[test]
    fn guides_are_met_and_mixed() {
        let (a, b) = (Vector3::new(0.6, 0.0, 0.8), Vector3::new(-0.6, 0.0, 0.8));
        let rule = ToolAxis::Between(vec![(Point3::new(0.0, 2.0, 3.0), a), (Point3::new(2.0, 2.0, 3.0), b)]);
        let middle = rule.at(&level(), &Vector3::x()).unwrap();
        assert!((middle - Vector3::z()).norm() < 1e-15);
        let at = CcPoint { point: Point3::new(0.0, 2.0, 3.0), normal: Vector3::z() };
        assert_eq!(rule.at(&at, &Vector3::x()).unwrap(), a.normalize());
    }
}
