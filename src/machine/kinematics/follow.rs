//! A toolpath as joints: enters a path, leaves the values of the five joints along it with points put in
//! where straight joints would lead the tool astray, and a report of what the machine has to do.

use super::choice::{State, Stop};
use super::refine::{Course, refine, straying};
use super::report::{JointReport, Rewind};
use super::{Joints, Kinematics};
use crate::kinematics::{choice, report};
use geometry::{Vector3, angle_between};
use motion::{ClPoint, MoveKind, Toolpath};

/// A tool axis this near to the first rotary axis, rad, is taken to be along it: the end of a cutter of 100
/// mm is off by 0.1 µm, less than programs are rounded.
const AT_POLE: f64 = 1e-6;

/// How exactly the tool has to follow the path between locations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Following {
    /// How far the tip may stray from its straight line, mm; infinite where the control keeps the tip there.
    pub tip: f64,
    /// How far the tool axis may stray from turning evenly, rad.
    pub axis: f64,
}

impl Following {
    /// For a control that keeps the tip on its line and moves rotary joints evenly: the axis strays so little
    /// that the cutter, `length` mm above its tip, stays within `chord`, mm.
    pub fn with_tip_kept(chord: f64, length: f64) -> Self {
        Self { tip: f64::INFINITY, axis: chord / length }
    }

    /// For a control that moves all five joints evenly; the tip stays within `chord` too.
    pub fn all_joints(chord: f64, length: f64) -> Self {
        Self { tip: chord, axis: chord / length }
    }
}

/// How a joint location is reached from the one before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Turn {
    /// Along the path.
    Along,
    /// The first axis turns while tip and tool axis stand still, at a singular pose.
    AtPole,
    /// The rotary joints go another way or unwind by whole turns: the tool axis sweeps round, and the tool
    /// has to be clear of the part.
    Rewind,
}

/// One location in joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointLocation {
    /// The joints there.
    pub joints: Joints,
    /// What they bring the tool to.
    pub at: ClPoint,
    /// Index of the move that leads to it; of turns at a location the move that follows.
    pub step: usize,
    /// How it is reached.
    pub turn: Turn,
}

/// A toolpath in joints.
#[derive(Debug, Clone, PartialEq)]
pub struct JointPath {
    /// How exactly it follows.
    pub following: Following,
    /// The joints before the first move.
    pub start: Joints,
    /// The locations after it, in order; the last one of each move along the path is the move's end.
    pub locations: Vec<JointLocation>,
    /// How far the tool strays from the path between locations at most: its tip, mm, and its axis, rad.
    pub strays: [f64; 2],
    /// What the machine has to do.
    pub report: JointReport,
}

/// Why a path cannot be followed.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PathError {
    /// The rotary axes cannot turn the tool that way.
    #[error("move {step} needs the tool axis ({:.4}, {:.4}, {:.4}), {:.3}° from axis {letter}; this machine reaches {:.3}° to {:.3}°: tilt the tool otherwise or take another machine", axis[0], axis[1], axis[2], angle.to_degrees(), reach[0].to_degrees(), reach[1].to_degrees())]
    Unreachable {
        /// The move; 0 also for the start.
        step: usize,
        /// The tool axis asked for.
        axis: [f64; 3],
        /// The first rotary axis.
        letter: char,
        /// Angle between both, rad.
        angle: f64,
        /// Least and greatest that can be reached, rad.
        reach: [f64; 2],
    },
    /// The axis turns by 180° within a move, any way round.
    #[error("the tool axis turns right round within move {step}: put a location in between")]
    HalfTurn {
        /// The move.
        step: usize,
    },
    /// No number of points keeps the tolerance.
    #[error(
        "the joints cannot follow move {step} within the chord tolerance: widen it, or tilt the tool elsewhere"
    )]
    Endless {
        /// The move.
        step: usize,
    },
}

/// A location of the path, or a singular pose within a move.
struct Knot {
    at: ClPoint,
    step: usize,
}

/// Follows a path with the joints of a machine.
///
/// Of the two ways and the whole turns of the rotary joints those are taken that turn least along the path
/// while limits are kept. The report tells limits and rewinds that cannot be avoided;
/// [`JointReport::obstacle`] says whether a program may be made.
///
/// # Errors
/// [`PathError`] for tool axes that the machine cannot reach.
///
/// # Tolerance
/// At all locations [`Kinematics::forward`] gives the path within rounding (tool axes within 1e-6 rad of a
/// singular pose are taken there); between them the tool stays within `following`, by a proven bound.
pub fn follow(
    kinematics: &Kinematics,
    path: &Toolpath,
    following: &Following,
) -> Result<JointPath, PathError> {
    let knots = knots(kinematics, path)?;
    let stops = stops(kinematics, path, &knots)?;
    let states = choice::choose(kinematics, &stops);
    let triangle = &kinematics.triangle;
    let angles = |k: usize, state: State, leaving: bool| stops[k].angles(triangle, state, leaving);
    let start = kinematics.place(knots[0].at.tip, angles(0, states[0], true));
    let tolerance = [following.tip, following.axis];
    let mut locations: Vec<JointLocation> = Vec::with_capacity(knots.len());
    let mut report = JointReport::default();
    for k in 0..knots.len() - 1 {
        let step = knots[k + 1].step;
        let leaving = angles(k, states[k], true);
        let from = kinematics.place(knots[k].at.tip, leaving);
        let mut push = |joints: Joints, at: ClPoint, turn: Turn| {
            locations.push(JointLocation { joints, at, step, turn });
        };
        let before = if k > 0 { angles(k, states[k - 1], false) } else { leaving };
        if choice::is_rewind(&stops[k], before, leaving) {
            let turn = [0, 1].map(|axis| leaving[axis] - before[axis]);
            report.rewinds.push(Rewind { step, turn, clear: stops[k].clear });
            push(from, knots[k].at, Turn::Rewind);
        } else if before != leaving {
            let arrived = kinematics.place(knots[k].at.tip, before);
            let course = AtPole { kinematics, at: &knots[k].at, turn: [before, leaving], step };
            refine(kinematics, &course, [&arrived, &from], tolerance, |_, joints| {
                push(joints, knots[k].at, Turn::AtPole);
            })?;
        }
        let to = kinematics.place(knots[k + 1].at.tip, angles(k + 1, states[k], false));
        let course = Along {
            kinematics,
            knots: [&knots[k].at, &knots[k + 1].at],
            stops: [&stops[k], &stops[k + 1]],
            state: states[k],
            step,
        };
        let mut pieces = 0;
        refine(kinematics, &course, [&from, &to], tolerance, |t, joints| {
            let at = if t < 1.0 { knots[k].at.towards(&knots[k + 1].at, t) } else { knots[k + 1].at };
            push(joints, at, Turn::Along);
            pieces += 1;
        })?;
        report.inserted += pieces - 1;
    }
    report.singular = report::singular(kinematics, path);
    let mut path = JointPath { following: *following, start, locations, strays: [0.0; 2], report };
    path.strays = path.straying(kinematics);
    path.measure(kinematics);
    Ok(path)
}

impl JointPath {
    /// [`JointPath::strays`]. Rewinds leave the path.
    fn straying(&self, kinematics: &Kinematics) -> [f64; 2] {
        let from = std::iter::once(&self.start).chain(self.locations.iter().map(|at| &at.joints));
        let pieces = from.zip(&self.locations).filter(|(_, to)| to.turn != Turn::Rewind);
        let [tip, axis] = pieces
            .map(|(from, to)| straying(kinematics, from, &to.joints))
            .fold([0.0f64; 2], |most, its| [most[0].max(its[0]), most[1].max(its[1])]);
        [if self.following.tip.is_finite() { tip } else { 0.0 }, axis]
    }
}

/// The path's locations, and singular poses that a move runs through.
fn knots(kinematics: &Kinematics, path: &Toolpath) -> Result<Vec<Knot>, PathError> {
    let pole = kinematics.triangle.pole;
    let snapped = |at: ClPoint| {
        let near = |axis: &Vector3| angle_between(&at.axis, axis) < AT_POLE;
        let axis = [pole, -pole].into_iter().find(near).unwrap_or(at.axis);
        ClPoint { tip: at.tip, axis }
    };
    let mut knots = Vec::with_capacity(path.len() + 1);
    knots.push(Knot { at: snapped(path.start), step: 0 });
    for (step, next) in path.moves.iter().enumerate() {
        let (from, to) = (snapped(path.location_before(step)), snapped(next.to));
        if from.axis == -to.axis {
            return Err(PathError::HalfTurn { step });
        }
        if let Some((t, axis)) = passes(&from.axis, &to.axis, &pole)
            .filter(|(_, _, off)| *off < AT_POLE)
            .map(|(t, axis, _)| (t, axis))
            && from.axis != axis
            && to.axis != axis
        {
            knots.push(Knot { at: ClPoint { tip: from.towards(&to, t).tip, axis }, step });
        }
        knots.push(Knot { at: to, step });
    }
    Ok(knots)
}

/// Where an axis that turns evenly comes closest to `pole` or its opposite within the turn: the share, that
/// end of the pole, and the angle from it. `None` where it comes closest at an end of the turn.
pub(super) fn passes(from: &Vector3, to: &Vector3, pole: &Vector3) -> Option<(f64, Vector3, f64)> {
    let whole = angle_between(from, to);
    let normal = from.cross(to).try_normalize(1e-9)?;
    [*pole, -pole].into_iter().find_map(|pole| {
        let ahead = normal.dot(&from.cross(&pole)).atan2(from.dot(&pole));
        let off = normal.dot(&pole).abs().min(1.0).asin();
        (0.0 < ahead && ahead < whole).then_some((ahead / whole, pole, off))
    })
}

fn stops(kinematics: &Kinematics, path: &Toolpath, knots: &[Knot]) -> Result<Vec<Stop>, PathError> {
    let rapid = |step: usize| path.moves.get(step).is_some_and(|m| m.kind == MoveKind::Rapid);
    let mut stops = Vec::with_capacity(knots.len());
    for (k, knot) in knots.iter().enumerate() {
        let solved = kinematics.triangle.solve(&knot.at.axis);
        let solved = solved.ok_or_else(|| unreachable(kinematics, &knot.at.axis, knot.step))?;
        let clear = k > 0 && rapid(knot.step) && knots.get(k + 1).is_some_and(|next| rapid(next.step));
        let free = solved.from_pole < AT_POLE;
        stops.push(Stop { solved, free, clear, arriving: 0.0, leaving: 0.0 });
    }
    choice::unwind(&mut stops);
    Ok(stops)
}

fn unreachable(kinematics: &Kinematics, axis: &Vector3, step: usize) -> PathError {
    PathError::Unreachable {
        step,
        axis: (*axis).into(),
        letter: kinematics.axes()[0].letter,
        angle: angle_between(axis, &kinematics.triangle.pole),
        reach: kinematics.reach(),
    }
}

/// A move between two knots.
struct Along<'a> {
    kinematics: &'a Kinematics,
    knots: [&'a ClPoint; 2],
    stops: [&'a Stop; 2],
    state: State,
    step: usize,
}

impl Course for Along<'_> {
    type Error = PathError;

    fn joints(&self, t: f64) -> Result<Joints, PathError> {
        let at = self.knots[0].towards(self.knots[1], t);
        let triangle = &self.kinematics.triangle;
        let solved =
            triangle.solve(&at.axis).ok_or_else(|| unreachable(self.kinematics, &at.axis, self.step))?;
        let [from, to] = self.stops;
        // From a pole to anywhere the azimuth stays; between others it turns by less than half a turn.
        let azimuth = match (from.free, to.free) {
            (true, _) => from.leaving,
            (false, true) => to.arriving,
            (false, false) => from.leaving + super::folded(solved.azimuth - from.leaving),
        };
        let stop = Stop { solved, arriving: azimuth, leaving: azimuth, ..*from };
        Ok(self.kinematics.place(at.tip, stop.angles(triangle, self.state, true)))
    }

    fn endless(&self) -> PathError {
        PathError::Endless { step: self.step }
    }
}

/// A turn of the first axis at a pole.
struct AtPole<'a> {
    kinematics: &'a Kinematics,
    at: &'a ClPoint,
    turn: [[f64; 2]; 2],
    step: usize,
}

impl Course for AtPole<'_> {
    type Error = PathError;

    fn joints(&self, t: f64) -> Result<Joints, PathError> {
        let [from, to] = self.turn;
        let rotary = [0, 1].map(|k| from[k] + (to[k] - from[k]) * t);
        Ok(self.kinematics.place(self.at.tip, rotary))
    }

    fn endless(&self) -> PathError {
        PathError::Endless { step: self.step }
    }
}
