//! Machines by name: the letters of both rotary axes in the order of the alphabet. Their letters are those of
//! ISO 841 (A turns about x, B about y, C about z). Which axis carries which: in `ac-head` and `bc-head` C
//! turns the fork that carries the other; in `ab-head` A carries B. In `ac-table` and `bc-table` the trunnion
//! A or B carries the table C, as in LinuxCNC's `xyzac-trt` and `xyzbc-trt`, which count angles the other way
//! round; in `ab-table` A carries B.

use super::{Kinematics, RotaryAxis, Side};
use geometry::{Point3, Vector3};
use std::f64::consts::TAU;

/// From the spindle nose to the tip where nothing else is said, mm: a mid-sized cutter in its holder.
pub const DEFAULT_GAUGE_LENGTH: f64 = 150.0;

/// Rotary rate where nothing else is said, rad/s: 30 turns a minute, as trunnions and fork heads have.
pub const DEFAULT_ROTARY_RATE: f64 = 0.5 * TAU;

/// Rotary acceleration where nothing else is said, rad/s²: a rate of 30 turns a minute is reached in a third
/// of a second.
pub const DEFAULT_ROTARY_ACCELERATION: f64 = 10.0;

/// Tilting axes: to both sides beyond the horizontal.
const TILTING: Option<[f64; 2]> = Some([-TAU / 3.0, TAU / 3.0]);
/// Axes across the spindle that carry another one.
const HALF_TURN: Option<[f64; 2]> = Some([-TAU / 2.0, TAU / 2.0]);
/// C axes of heads: cables and hoses allow a turn to each side.
const CABLED: Option<[f64; 2]> = Some([-TAU, TAU]);

const X: [f64; 3] = [1.0, 0.0, 0.0];
const Y: [f64; 3] = [0.0, 1.0, 0.0];
const Z: [f64; 3] = [0.0, 0.0, 1.0];
/// Halfway between y and z: a half turn brings the spindle from vertical to horizontal.
const NUTATING: [f64; 3] = [0.0, 1.0, 1.0];

/// Letter, direction, side and limits, rad.
type PresetAxis = (char, [f64; 3], Side, Option<[f64; 2]>);

const MACHINES: [(&str, PresetAxis, PresetAxis); 13] = [
    ("ab-head", ('A', X, Side::Head, TILTING), ('B', Y, Side::Head, TILTING)),
    ("ac-head", ('C', Z, Side::Head, CABLED), ('A', X, Side::Head, TILTING)),
    ("bc-head", ('C', Z, Side::Head, CABLED), ('B', Y, Side::Head, TILTING)),
    ("ab-table", ('B', Y, Side::Table, None), ('A', X, Side::Table, TILTING)),
    ("ac-table", ('C', Z, Side::Table, None), ('A', X, Side::Table, TILTING)),
    ("bc-table", ('C', Z, Side::Table, None), ('B', Y, Side::Table, TILTING)),
    ("a-head-b-table", ('B', Y, Side::Table, None), ('A', X, Side::Head, TILTING)),
    ("a-head-c-table", ('C', Z, Side::Table, None), ('A', X, Side::Head, TILTING)),
    ("b-head-a-table", ('A', X, Side::Table, None), ('B', Y, Side::Head, TILTING)),
    ("b-head-c-table", ('C', Z, Side::Table, None), ('B', Y, Side::Head, TILTING)),
    ("nutating-head", ('C', Z, Side::Head, CABLED), ('B', NUTATING, Side::Head, HALF_TURN)),
    ("nutating-table", ('C', Z, Side::Table, None), ('B', NUTATING, Side::Table, HALF_TURN)),
    ("nutating-head-c-table", ('C', Z, Side::Table, None), ('B', NUTATING, Side::Head, HALF_TURN)),
];

/// The names.
pub const PRESETS: [&str; MACHINES.len()] = {
    let mut names = [""; MACHINES.len()];
    let mut k = 0;
    while k < names.len() {
        names[k] = MACHINES[k].0;
        k += 1;
    }
    names
};

/// First and second axis of a machine by name, both through the zero of their frames.
pub fn preset(name: &str) -> Option<[RotaryAxis; 2]> {
    let (_, first, second) = MACHINES.iter().find(|machine| machine.0 == name)?;
    Some([first, second].map(|&(letter, direction, side, limits)| RotaryAxis {
        letter,
        direction: Vector3::from(direction),
        point: Point3::origin(),
        side,
        limits,
        rate: DEFAULT_ROTARY_RATE,
        acceleration: DEFAULT_ROTARY_ACCELERATION,
        jerk: f64::INFINITY,
    }))
}

impl Kinematics {
    /// A machine by name with both rotary axes through the zero of their frames, the gauge length
    /// [`DEFAULT_GAUGE_LENGTH`], workpiece zero at machine zero, and travel without limits.
    /// `None` for a name that is not among [`PRESETS`].
    pub fn by_name(name: &str) -> Option<Self> {
        let [first, second] = preset(name)?;
        Self::new(first, second, DEFAULT_GAUGE_LENGTH, Point3::origin(), [None; 3]).ok()
    }
}
