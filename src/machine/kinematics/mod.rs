//! Five-axis machines: three linear axes and two rotary ones, both in the head, both in the table, or one in
//! each. Enters: the tool's location in the workpiece; leaves: the five joints, and the other way round.
//!
//! Frames. Machine coordinates are those of the linear axes as the machine shows them: the place of the
//! spindle nose with the head's rotary axes at zero. The workpiece lies in the table with its axes along the
//! machine's while the table stands at zero. Lengths in mm, angles in rad.
//!
//! Sense. A rotary joint counts as if the tool turned against the workpiece, right-handed about its direction
//! (ISO 841): a table turns the other way. For a machine that counts otherwise, turn the direction round.
//!
//! Order. The *first* rotary axis is the one nearer to the workpiece, the *second* the one nearer to the
//! cutter. So in all three families the tool axis is a = R₁(θ₁) R₂(θ₂) z, and the first axis is free where a
//! is parallel to its direction (the singular poses).
//!
//! Where a move runs through a singular pose a location is put in. The first axis turns there while the tip
//! stays in place. Feeds and machining time keep every joint within its rate.

mod angles;
mod choice;
mod error;
mod follow;
mod links;
mod presets;
mod program;
mod refine;
mod report;
#[cfg(test)]
mod tests;

pub use error::KinematicsError;
pub use follow::{Following, JointLocation, JointPath, PathError, Turn, follow};
pub use links::{Chain, Link, LinkMove, Pace, STRAY, Way, Waypoint};
pub use presets::{DEFAULT_GAUGE_LENGTH, DEFAULT_ROTARY_ACCELERATION, DEFAULT_ROTARY_RATE, PRESETS, preset};
pub use program::program_of_three_axes;
pub use report::{JointReport, LimitViolation, Obstacle, Rewind, SINGULAR_ANGLE, SingularPose};

use angles::Triangle;

use super::axis_limits::AxisLimits;

use geometry::{Point3, Vector3};
use motion::ClPoint;

/// Rotary axes that stand closer to parallel than this, rad, cannot turn the tool in two ways; nor can a
/// second axis as close to the spindle. Nearer ones would magnify rounding beyond 1e-9.
const LEAST_ANGLE: f64 = 1e-3;

/// Lengths from this on are no machine's, mm.
const GREATEST: f64 = 1.0e5;

/// Angles from this on are no limit of a joint, rad.
const GREATEST_ANGLE: f64 = 25.0 * std::f64::consts::TAU;

/// Limits closer than this, mm or rad, leave a joint no room.
const LEAST_ROOM: f64 = 1e-3;

/// Where a rotary axis sits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// It turns the spindle.
    Head,
    /// It turns the workpiece.
    Table,
}

/// A rotary axis with all joints at zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RotaryAxis {
    /// Its letter in programs: `A`, `B` or `C`.
    pub letter: char,
    /// Its direction; any length but zero.
    pub direction: Vector3,
    /// A point that it runs through, mm: of a table in machine coordinates, of a head from the spindle nose.
    pub point: Point3,
    /// In head or table.
    pub side: Side,
    /// Least and greatest angle, rad; `None` turns without end.
    pub limits: Option<[f64; 2]>,
    /// Fastest turning, rad/s.
    pub rate: f64,
    /// Greatest acceleration, rad/s².
    pub acceleration: f64,
    /// Greatest jerk, rad/s³; infinite limits nothing.
    pub jerk: f64,
}

/// A five-axis machine, checked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kinematics {
    axes: [RotaryAxis; 2],
    /// From the spindle nose to the tip, mm.
    gauge_length: f64,
    /// Workpiece zero with the table at zero, machine coordinates.
    workpiece_zero: Point3,
    /// Least and greatest X, Y and Z, mm.
    travel: [Option<[f64; 2]>; 3],
    /// Fastest X, Y and Z, mm/s.
    rates: [f64; 3],
    /// Greatest acceleration of X, Y and Z, mm/s².
    accelerations: [f64; 3],
    /// Greatest jerk of X, Y and Z, mm/s³.
    jerks: [f64; 3],
    triangle: Triangle,
}

/// Values of the five joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Joints {
    /// X, Y, Z: machine coordinates, mm.
    pub linear: Vector3,
    /// First and second rotary axis, rad.
    pub rotary: [f64; 2],
}

/// What turns or shifts the tool on the way from its own frame to the workpiece's.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Stage {
    /// By rotary axis 0 or 1.
    Turn(usize),
    /// By the linear axes.
    Shift,
}

/// `v` turned by `angle`, rad, about the unit vector `about`.
fn turned(v: &Vector3, about: &Vector3, angle: f64) -> Vector3 {
    let (sin, cos) = angle.sin_cos();
    // 1 − cos by the half angle keeps its digits.
    let versed = 2.0 * (0.5 * angle).sin().powi(2);
    v * cos + about.cross(v) * sin + about * (about.dot(v) * versed)
}

impl Kinematics {
    /// A machine of the rotary axes `first` (next to the workpiece) and `second` (next to the cutter), in mm:
    /// `gauge_length` from the spindle nose to the tip, the workpiece's zero in machine coordinates with the
    /// table at zero, and the `travel` of X, Y and Z, each from least to greatest, in machine coordinates.
    ///
    /// # Errors
    /// [`KinematicsError`] for what is no number, for parallel axes, for a second axis along the spindle, and
    /// for limits in the wrong order.
    pub fn new(
        first: RotaryAxis,
        second: RotaryAxis,
        gauge_length: f64,
        workpiece_zero: Point3,
        travel: [Option<[f64; 2]>; 3],
    ) -> Result<Self, KinematicsError> {
        let letters = [first.letter, second.letter];
        if letters[0] == letters[1] || letters.iter().any(|letter| !"ABC".contains(*letter)) {
            return Err(KinematicsError::Letters { letters });
        }
        if (first.side, second.side) == (Side::Head, Side::Table) {
            return Err(KinematicsError::Order { letter: letters[0] });
        }
        let mut axes = [first, second];
        for axis in &mut axes {
            let letter = axis.letter;
            // By the greatest component first: squares of tiny or huge ones would vanish or overflow.
            let scaled = axis.direction / axis.direction.amax();
            axis.direction = scaled.normalize();
            if !axis.direction.iter().all(|c| c.is_finite()) {
                return Err(KinematicsError::Direction { letter });
            }
            check_limits(letter, axis.limits, GREATEST_ANGLE)?;
            axis.point.iter().try_for_each(|c| number("a coordinate of a point of a rotary axis", *c))?;
            if !(axis.rate > 0.0 && axis.rate.is_finite()) {
                let (what, expected) = ("a rotary rate", "a positive number");
                return Err(KinematicsError::Number { what, value: axis.rate, expected });
            }
            if !(axis.acceleration > 0.0 && axis.acceleration.is_finite()) {
                let (what, expected) = ("a rotary acceleration", "a positive number");
                return Err(KinematicsError::Number { what, value: axis.acceleration, expected });
            }
            if axis.jerk.is_nan() || axis.jerk <= 0.0 {
                let (what, expected) = ("a rotary jerk", "a positive number");
                return Err(KinematicsError::Number { what, value: axis.jerk, expected });
            }
        }
        let [u, v] = axes.map(|axis| axis.direction);
        if u.cross(&v).norm() <= LEAST_ANGLE {
            return Err(KinematicsError::Parallel { letters });
        }
        if v.cross(&Vector3::z()).norm() <= LEAST_ANGLE {
            return Err(KinematicsError::AlongSpindle { letter: letters[1] });
        }
        number("the gauge length", gauge_length)?;
        workpiece_zero.iter().try_for_each(|c| number("a coordinate of the workpiece's zero", *c))?;
        for (joint, limits) in ['X', 'Y', 'Z'].into_iter().zip(travel) {
            check_limits(joint, limits, GREATEST)?;
        }
        let ([rates, accelerations, jerks], triangle) = ([[f64::INFINITY; 3]; 3], Triangle::new(u, v));
        Ok(Self { axes, gauge_length, workpiece_zero, travel, rates, accelerations, jerks, triangle })
    }

    /// The same with another length from the spindle nose to the tip, mm.
    #[must_use]
    pub fn with_gauge_length(self, gauge_length: f64) -> Self {
        Self { gauge_length, ..self }
    }

    /// The same with the fastest motion of X, Y and Z, mm/s; without, they are not limited.
    #[must_use]
    pub fn with_rates(self, rates: [f64; 3]) -> Self {
        Self { rates, ..self }
    }

    /// The same with the greatest acceleration of X, Y and Z, mm/s²; without, they are not limited.
    #[must_use]
    pub fn with_accelerations(self, accelerations: [f64; 3]) -> Self {
        Self { accelerations, ..self }
    }

    /// The same with the greatest jerk of X, Y and Z, mm/s³; without, they are not limited.
    #[must_use]
    pub fn with_jerks(self, jerks: [f64; 3]) -> Self {
        Self { jerks, ..self }
    }

    /// Greatest jerk of the five joints, mm/s³ and rad/s³; infinite ones limit nothing.
    pub fn jerks(&self) -> [f64; 5] {
        let [x, y, z] = self.jerks;
        [x, y, z, self.axes[0].jerk, self.axes[1].jerk]
    }

    /// What the five joints allow.
    pub(crate) fn axis_limits(&self) -> AxisLimits {
        AxisLimits { rates: self.rates(), accelerations: self.accelerations(), jerks: self.jerks() }
    }

    /// Greatest acceleration of the five joints, mm/s² and rad/s².
    pub fn accelerations(&self) -> [f64; 5] {
        let [x, y, z] = self.accelerations;
        [x, y, z, self.axes[0].acceleration, self.axes[1].acceleration]
    }

    /// Fastest motion of the five joints, mm/s and rad/s.
    pub fn rates(&self) -> [f64; 5] {
        let [x, y, z] = self.rates;
        [x, y, z, self.axes[0].rate, self.axes[1].rate]
    }

    /// First and second rotary axis; directions are unit vectors.
    pub fn axes(&self) -> &[RotaryAxis; 2] {
        &self.axes
    }

    /// From the spindle nose to the tip, mm.
    pub fn gauge_length(&self) -> f64 {
        self.gauge_length
    }

    /// The workpiece's zero with the table at zero, machine coordinates, mm.
    pub fn workpiece_zero(&self) -> Point3 {
        self.workpiece_zero
    }

    /// Least and greatest X, Y and Z, machine coordinates, mm.
    pub fn travel(&self) -> &[Option<[f64; 2]>; 3] {
        &self.travel
    }

    /// Where the spindle nose is out of the way of everything, machine coordinates, mm: the upper end of Z's
    /// travel, or the machine's zero where the travel is not known.
    pub fn retracted_z(&self) -> f64 {
        self.travel[2].map_or(0.0, |[_, greatest]| greatest)
    }

    /// The letters of the five joints.
    pub fn letters(&self) -> [char; 5] {
        ['X', 'Y', 'Z', self.axes[0].letter, self.axes[1].letter]
    }

    /// Limits of the five joints, mm and rad.
    pub fn limits(&self) -> [Option<[f64; 2]>; 5] {
        let [x, y, z] = self.travel;
        [x, y, z, self.axes[0].limits, self.axes[1].limits]
    }

    /// True when an axis of this side is there.
    pub fn has(&self, side: Side) -> bool {
        self.axes.iter().any(|axis| axis.side == side)
    }

    /// Least and greatest angle, rad, between tool axis and direction of the first axis.
    pub fn reach(&self) -> [f64; 2] {
        self.triangle.reach()
    }

    /// From the tool to the workpiece.
    fn stages(&self) -> [Stage; 3] {
        match self.axes.map(|axis| axis.side) {
            [Side::Table, Side::Table] => [Stage::Shift, Stage::Turn(1), Stage::Turn(0)],
            [Side::Table, Side::Head] => [Stage::Turn(1), Stage::Shift, Stage::Turn(0)],
            [Side::Head, _] => [Stage::Turn(1), Stage::Turn(0), Stage::Shift],
        }
    }

    /// The tip from the spindle nose with the head at zero.
    fn tip_from_nose(&self) -> Vector3 {
        Vector3::new(0.0, 0.0, -self.gauge_length)
    }

    /// A point turned by one rotary axis.
    fn turn(&self, axis: usize, point: Vector3, angle: f64) -> Vector3 {
        let RotaryAxis { direction, point: through, .. } = &self.axes[axis];
        turned(&(point - through.coords), direction, angle) + through.coords
    }

    /// The tool axis in the workpiece.
    pub fn tool_axis(&self, rotary: [f64; 2]) -> Vector3 {
        let [u, v] = self.axes.map(|axis| axis.direction);
        turned(&turned(&Vector3::z(), &v, rotary[1]), &u, rotary[0])
    }

    /// Where the machine's z points in the workpiece.
    pub fn upward(&self, rotary: [f64; 2]) -> Vector3 {
        (0..2).rev().fold(Vector3::z(), |up, k| match self.axes[k].side {
            Side::Table => turned(&up, &self.axes[k].direction, rotary[k]),
            Side::Head => up,
        })
    }

    /// The location, in the workpiece, that the joints bring the tool to.
    pub fn forward(&self, joints: &Joints) -> ClPoint {
        let tip = self.stages().into_iter().fold(self.tip_from_nose(), |x, stage| match stage {
            Stage::Turn(axis) => self.turn(axis, x, joints.rotary[axis]),
            Stage::Shift => x + joints.linear,
        });
        ClPoint { tip: Point3::from(tip - self.workpiece_zero.coords), axis: self.tool_axis(joints.rotary) }
    }

    /// The joints that bring the tip to a point of the workpiece with the rotary axes at these angles.
    pub fn place(&self, tip: Point3, rotary: [f64; 2]) -> Joints {
        let (mut table, mut head) = (tip.coords + self.workpiece_zero.coords, self.tip_from_nose());
        for k in [0, 1] {
            if self.axes[k].side == Side::Table {
                table = self.turn(k, table, -rotary[k]);
            }
        }
        for k in [1, 0] {
            if self.axes[k].side == Side::Head {
                head = self.turn(k, head, rotary[k]);
            }
        }
        Joints { linear: table - head, rotary }
    }

    /// The pace of X, Y and Z on a line that moves the tip by `way` and turns the rotary axes by `turns`,
    /// over the time of the whole, mm, where the tip is at `tip`.
    fn pace(&self, tip: Point3, way: Vector3, rotary: [f64; 2], turns: [f64; 2]) -> Vector3 {
        let turn = |k: usize, (at, pace): (Vector3, Vector3), sign: f64| {
            let RotaryAxis { direction, point, .. } = &self.axes[k];
            let pace = pace + direction.cross(&(at - point.coords)) * (sign * turns[k]);
            (self.turn(k, at, sign * rotary[k]), turned(&pace, direction, sign * rotary[k]))
        };
        let mut table = (tip.coords + self.workpiece_zero.coords, way);
        let mut head = (self.tip_from_nose(), Vector3::zeros());
        for k in [0, 1].into_iter().filter(|&k| self.axes[k].side == Side::Table) {
            table = turn(k, table, -1.0);
        }
        for k in [1, 0].into_iter().filter(|&k| self.axes[k].side == Side::Head) {
            head = turn(k, head, 1.0);
        }
        table.1 - head.1
    }

    /// The second derivative of that by the share of the line is no greater than this, mm: a turning vector
    /// of length v has derivatives up to those of `v (1 + turn)^n`.
    fn pace_bends(&self, tip: Point3, way: Vector3, turns: [f64; 2]) -> f64 {
        let on = |side: Side, order: [usize; 2], from: [Vector3; 2], pace: f64| {
            let mut bounds = [0.0, pace, 0.0, 0.0];
            let mut centre: Option<Vector3> = None;
            for k in order.into_iter().filter(|&k| self.axes[k].side == side) {
                let (through, turn) = (self.axes[k].point.coords, turns[k].abs());
                // Distances from an axis that runs straight are greatest at an end.
                bounds[0] = match centre {
                    None => (from[0] - through).norm().max((from[1] - through).norm()),
                    Some(before) => bounds[0] + (through - before).norm(),
                };
                let [v, pace, second, third] = bounds;
                bounds[1] = pace + turn * v;
                bounds[2] = second + 2.0 * turn * pace + turn * turn * v;
                bounds[3] = third + 3.0 * turn * second + 3.0 * turn * turn * pace + turn.powi(3) * v;
                centre = Some(through);
            }
            bounds[3]
        };
        let begin = tip.coords + self.workpiece_zero.coords;
        let nose = self.tip_from_nose();
        on(Side::Table, [0, 1], [begin, begin + way], way.norm()) + on(Side::Head, [1, 0], [nose; 2], 0.0)
    }
}

impl Joints {
    /// X, Y, Z and both rotary axes, mm and rad.
    pub fn values(&self) -> [f64; 5] {
        [self.linear.x, self.linear.y, self.linear.z, self.rotary[0], self.rotary[1]]
    }
}

/// An angle brought into −π..=π by whole turns.
fn folded(angle: f64) -> f64 {
    angle - std::f64::consts::TAU * (angle / std::f64::consts::TAU).round()
}

fn number(what: &'static str, value: f64) -> Result<(), KinematicsError> {
    let expected = "a number of mm, below 100 m";
    if value.abs() < GREATEST { Ok(()) } else { Err(KinematicsError::Number { what, value, expected }) }
}

fn check_limits(joint: char, limits: Option<[f64; 2]>, most: f64) -> Result<(), KinematicsError> {
    match limits {
        Some([least, greatest]) if !(-most <= least && least + LEAST_ROOM < greatest && greatest <= most) => {
            Err(KinematicsError::Limits { joint })
        }
        _ => Ok(()),
    }
}
