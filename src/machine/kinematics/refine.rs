//! How far joints that run straight from one value to the next lead the tool astray, and points between so
//! that it stays within a tolerance.
//!
//! A machine moves its five joints in proportion. With x(s) the true place at the share s of the piece and
//! y(s) that of the joints, e = y − x is zero at both ends, and
//! |e| ≤ |e″(½)|/8 + M/48 with M ≥ |e‴| (the Green's function of the second derivative: ∫G ds = 1/8,
//! ∫G |s − ½| ds = 1/48). e″ at the middle is exact; M is a bound carried through the turns and shifts from
//! the tool to the workpiece. The first term alone is the deviation to leading order, so that the bound costs
//! few points.

use super::{Joints, Kinematics, RotaryAxis, Stage};
use geometry::{Vector3, angle_between};

/// A place in the middle of a piece with two derivatives by the share, and bounds on the lengths of the place
/// and of three derivatives over the whole piece.
struct Motion {
    at: Vector3,
    first: Vector3,
    second: Vector3,
    bounds: [f64; 4],
}

impl Motion {
    fn still(at: Vector3) -> Self {
        Self { at, first: Vector3::zeros(), second: Vector3::zeros(), bounds: [at.norm(), 0.0, 0.0, 0.0] }
    }

    /// Turned about an axis through `through` by `angle` in the middle, with `rate` rad over the piece.
    fn turned(self, axis: &Vector3, through: &Vector3, angle: f64, rate: f64) -> Self {
        let turn = |v: &Vector3| super::turned(v, axis, angle);
        let (arm, first, second) = (turn(&(self.at - through)), turn(&self.first), turn(&self.second));
        let spin = axis * rate;
        let [_, b1, b2, b3] = self.bounds;
        // No farther than in the middle and half a piece on.
        let b0 = arm.norm() + 0.5 * b1;
        let w = rate.abs();
        Self {
            at: arm + through,
            first: first + spin.cross(&arm),
            second: second + 2.0 * spin.cross(&first) + spin.cross(&spin.cross(&arm)),
            bounds: [
                b0 + through.norm(),
                b1 + w * b0,
                b2 + w * (2.0 * b1 + w * b0),
                b3 + w * (3.0 * b2 + w * (3.0 * b1 + w * b0)),
            ],
        }
    }

    fn shifted(self, by: Vector3, rate: Vector3) -> Self {
        let [b0, b1, b2, b3] = self.bounds;
        let bounds = [b0 + by.norm() + 0.5 * rate.norm(), b1 + rate.norm(), b2, b3];
        Self { at: self.at + by, first: self.first + rate, second: self.second, bounds }
    }
}

/// Bounds on how far the tool strays when the joints run straight from `from` to `to`: its tip from
/// the straight line between its ends, mm, and its axis from turning evenly between its own, rad (small).
pub(super) fn straying(kinematics: &Kinematics, from: &Joints, to: &Joints) -> [f64; 2] {
    let rates = [0, 1].map(|k| to.rotary[k] - from.rotary[k]);
    if rates == [0.0; 2] {
        return [0.0; 2];
    }
    let middle = [0, 1].map(|k| 0.5 * (from.rotary[k] + to.rotary[k]));
    let turned = |motion: Motion, k: usize, through: &Vector3| {
        let RotaryAxis { direction, .. } = &kinematics.axes()[k];
        motion.turned(direction, through, middle[k], rates[k])
    };
    let tip =
        kinematics.stages().into_iter().fold(
            Motion::still(kinematics.tip_from_nose()),
            |x, stage| match stage {
                Stage::Turn(k) => turned(x, k, &kinematics.axes()[k].point.coords),
                Stage::Shift => x.shifted(0.5 * (from.linear + to.linear), to.linear - from.linear),
            },
        );
    let axis = [1, 0].into_iter().fold(Motion::still(Vector3::z()), |x, k| turned(x, k, &Vector3::zeros()));
    // Turning evenly by α between its ends: a″ = −α² a, |a‴| = α³.
    let ends = [from, to].map(|joints| kinematics.tool_axis(joints.rotary));
    let angle = angle_between(&ends[0], &ends[1]);
    let even = (ends[0] + ends[1]).try_normalize(1e-12).unwrap_or(ends[0]);
    let bound = |second: Vector3, third: f64| second.norm() / 8.0 + third / 48.0;
    [
        bound(tip.second, tip.bounds[3]),
        bound(axis.second + even * (angle * angle), axis.bounds[3] + angle.powi(3)),
    ]
}

/// What the joints have to do within a piece of the path.
pub(super) trait Course {
    /// Why it cannot be done.
    type Error;
    /// The joints at the share `t` of the piece, strictly inside of it.
    fn joints(&self, t: f64) -> Result<Joints, Self::Error>;
    /// For a piece that cannot be followed within the tolerance.
    fn endless(&self) -> Self::Error;
}

/// Appends the shares of a course and its joints there, in order and the end included, between which the tool
/// stays within `tip` (mm; infinite where the control keeps the tip) and `axis` (rad). No two pieces in a row
/// could be one.
pub(super) fn refine<C: Course>(
    kinematics: &Kinematics,
    course: &C,
    ends: [&Joints; 2],
    tolerance: [f64; 2],
    mut push: impl FnMut(f64, Joints),
) -> Result<(), C::Error> {
    /// Halvings of a piece: beyond, its shares are no longer told apart.
    const DEEPEST: u32 = 48;
    let within = |from: &Joints, to: &Joints| {
        let [tip, axis] = straying(kinematics, from, to);
        tip <= tolerance[0] && axis <= tolerance[1]
    };
    let mut last = (0.0, *ends[0]);
    // A piece that may still become longer by the next one, and where it begins.
    let (mut begin, mut piece) = (*ends[0], None::<(f64, Joints)>);
    // What is still to be reached, the nearest at the end, with the halvings that it took.
    let mut ahead = vec![(1.0, *ends[1], 0u32)];
    while let Some(&(t, joints, depth)) = ahead.last() {
        if within(&last.1, &joints) {
            if let Some((t, before)) = piece.filter(|_| !within(&begin, &joints)) {
                push(t, before);
                begin = before;
            }
            piece = Some((t, joints));
            last = (t, joints);
            ahead.pop();
        } else if depth == DEEPEST {
            return Err(course.endless());
        } else {
            let middle = 0.5 * (last.0 + t);
            if let Some(end) = ahead.last_mut() {
                end.2 = depth + 1;
            }
            ahead.push((middle, course.joints(middle)?, depth + 1));
        }
    }
    if let Some((t, joints)) = piece {
        push(t, joints);
    }
    Ok(())
}
