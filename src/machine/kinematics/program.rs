//! The joints that a program goes through: its approach, the path, its rises for rewinds, and its end.
//!
//! Enters: a path and its joints. Leaves: the joints at the ends of all straight stretches, in order, as
//! posts write them. Where the machine stands before the first line is not known: the program counts from
//! where X and Y stand over the start at the height of retract.

use super::{Chain, JointPath, Joints, Kinematics, Pace, Turn, Way, Waypoint};
use geometry::{Point3, Vector3};
use motion::Toolpath;

impl JointPath {
    /// The joints of the program of a path.
    pub fn program(&self, kinematics: &Kinematics, path: &Toolpath) -> Vec<Waypoint> {
        let retracted = |joints: Joints| Joints {
            linear: Vector3::new(joints.linear.x, joints.linear.y, kinematics.retracted_z()),
            ..joints
        };
        let at = |joints: Joints, step: usize| Waypoint {
            joints,
            step,
            way: Way::Approach,
            pace: Pace::default(),
        };
        // From the height of retract down to a location.
        let down = |joints: &Joints, tip: Point3| {
            kinematics.place(kinematics.over(path, joints.rotary, tip), joints.rotary)
        };
        let high = down(&self.start, path.start.tip);
        let mut all = vec![at(retracted(high), 0), at(high, 0), at(self.start, 0)];
        let mut last = self.start;
        for location in &self.locations {
            let step = location.step;
            if location.turn == Turn::Rewind {
                let up = retracted(last);
                let turned = Joints { rotary: location.joints.rotary, ..up };
                let high = down(&location.joints, location.at.tip);
                all.extend([up, turned, retracted(high), high].map(|joints| at(joints, step)));
            }
            let way = match location.turn {
                Turn::Rewind => Way::Approach,
                Turn::Along | Turn::AtPole if self.following.tip.is_finite() => Way::Axes,
                Turn::Along | Turn::AtPole => Way::Tip,
            };
            all.push(Waypoint { joints: location.joints, step, way, pace: Pace::default() });
            last = location.joints;
        }
        all.push(at(retracted(last), path.len().saturating_sub(1)));
        all
    }
}

/// The joints of the program of an upright path on a machine of three axes: from over its start at its
/// highest tip, or at `rise_to`, mm, where that is higher, and up there again.
pub fn program_of_three_axes(path: &Toolpath, rise_to: Option<f64>, chain: &Chain) -> Vec<Waypoint> {
    let tips: Vec<Point3> =
        std::iter::once(path.start.tip).chain(path.moves.iter().map(|step| step.to.tip)).collect();
    let top = tips.iter().map(|tip| tip.z).fold(rise_to.unwrap_or(f64::NEG_INFINITY), f64::max);
    let above = |tip: &Point3| Point3::new(tip.x, tip.y, top);
    let from_tip = chain.workpiece_zero().coords - chain.tip().coords;
    let at = |tip: Point3, step: usize, way: Way| Waypoint {
        joints: Joints { linear: tip.coords + from_tip, rotary: [0.0; 2] },
        step,
        way,
        pace: Pace::default(),
    };
    let last = path.len().saturating_sub(1);
    let begin = tips.first().map(|tip| at(above(tip), 0, Way::Approach));
    let end = tips.last().map(|tip| at(above(tip), last, Way::Approach));
    let way = |k: usize| if k == 0 { Way::Approach } else { Way::Axes };
    let between = tips.iter().enumerate().map(|(k, tip)| at(*tip, k.saturating_sub(1), way(k)));
    begin.into_iter().chain(between).chain(end).collect()
}
