//! How the joints of a five-axis machine move.

use serde::Serialize;

use ::machine::kinematics::{JointPath, JointReport, Kinematics, Turn};
use geometry::{Aabb, Point3};
use report::{Claim, Figure, Gravity};
use work::monitor::Monitor;

use super::words::value;
use crate::JobError;
use crate::run::{Finding, Run};

/// The way of one joint.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct JointRange {
    /// Its letter.
    pub joint: char,
    /// Least and greatest value, mm, or degrees of a rotary joint.
    pub range: [f64; 2],
    /// Its fastest motion, mm/min, or degrees/min of a rotary joint.
    pub fastest: f64,
}

/// How the joints of a five-axis machine move along a path.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MachineFigures {
    /// X, Y, Z and the two rotary joints.
    pub joints: Vec<JointRange>,
    /// How far each of the rotary joints turns in all.
    pub rotary_travel_deg: [f64; 2],
    /// Places where the tool axis comes within a degree of the first rotary axis.
    pub singular_poses: usize,
    /// Turns for which the tool leaves the part.
    pub rewinds: usize,
    /// Locations put in to keep the tool within the chord tolerance.
    pub inserted_locations: usize,
}

impl MachineFigures {
    /// Of the joints along a path, and their fastest motion, mm/s and rad/s.
    pub fn new(kinematics: &Kinematics, report: &JointReport, fastest: [f64; 5]) -> Self {
        let ranges = kinematics.letters().into_iter().zip(report.ranges);
        let shown = |(k, (joint, range)): (usize, (char, [f64; 2]))| {
            let degrees = |value: f64| if k < 3 { value } else { value.to_degrees() };
            JointRange { joint, range: range.map(degrees), fastest: 60.0 * degrees(fastest[k]) }
        };
        Self {
            joints: ranges.enumerate().map(shown).collect(),
            rotary_travel_deg: report.rotary_travel.map(f64::to_degrees),
            singular_poses: report.singular.len(),
            rewinds: report.rewinds.len(),
            inserted_locations: report.inserted,
        }
    }
}

pub(super) fn find(run: &Run<'_>, _: &dyn Monitor) -> Result<Finding, JobError> {
    let joints = run.planned.joints.as_ref();
    let Some((joints, five_axis)) = joints.zip(run.scene().five_axis.as_ref()) else {
        return Ok(Finding::default());
    };
    let (machine, path) = (&five_axis.kinematics, run.path());
    let fastest = joints.fastest(machine, path, run.scene().machine.rapid_rate);
    let figures = MachineFigures::new(machine, &joints.report, fastest);
    let mut claims = within_travel(machine, &joints.report);
    let notes: Vec<String> = note(&joints.report).into_iter().collect();
    let nose = joints.highest_nose(machine, path).max(over_the_work(run, machine, joints));
    claims.push(retract_above(machine.retracted_z(), nose));
    let figure = Figure { key: "machine", value: value(&figures)?, ..Figure::default() };
    Ok(Finding { figure: Some(figure), notes, claims })
}

/// How high the spindle nose has to stand, machine coordinates, mm, for the tip to be over part, stock and fixtures wherever the rotary
/// axes stand when a program begins, rises or ends.
fn over_the_work(run: &Run<'_>, machine: &Kinematics, joints: &JointPath) -> f64 {
    let meshes = run.around.fixtures.iter().map(|(mesh, _)| mesh).chain([run.around.near.mesh()]);
    let vertices: Vec<Point3> = meshes.flat_map(|mesh| mesh.vertices().iter().copied()).collect();
    let Aabb { min, max } = run.session.area();
    let side = |k: usize, axis: usize| if k >> axis & 1 == 1 { max[axis] } else { min[axis] };
    let corners: Vec<Point3> = (0..8).map(|k| Point3::new(side(k, 0), side(k, 1), side(k, 2))).collect();
    let nose = |rotary: [f64; 2]| {
        let up = machine.upward(rotary);
        let over = |height: f64, place: &Point3| height.max(up.dot(&place.coords));
        let height = vertices.iter().chain(&corners).fold(f64::NEG_INFINITY, over);
        // With the head swung, the side of the cutter reaches below its tip.
        let lean = machine.tool_axis(rotary).cross(&up).norm();
        machine.place(Point3::origin(), rotary).linear.z + height + lean * run.around.tool.cutter.radius()
    };
    let rewinds = joints.locations.windows(2).filter(|pair| pair[1].turn == Turn::Rewind);
    let turned = rewinds.flat_map(|pair| pair.iter().map(|at| at.joints.rotary));
    let ends = [joints.start.rotary].into_iter().chain(joints.locations.last().map(|at| at.joints.rotary));
    turned.chain(ends).map(nose).fold(f64::NEG_INFINITY, f64::max)
}

/// That the machine's Z to which programs rise is no lower than where they come down from.
fn retract_above(z: f64, nose: f64) -> Claim {
    let text = format!(
        "programs rise to the machine's Z {z:.3}, and the spindle nose must stand at Z {nose:.3} or higher to be over the path and the work"
    );
    Claim::length("retract", Gravity::Crash, 0.0, nose - z, 0.0).told(text)
}

/// Beyond a limit by so little, mm or degrees, a joint is at it.
const ROUNDING: f64 = 1e-6;

/// That the joints keep to their travels: one claim for those of the linear and one for those of the rotary joints that are
/// limited.
fn within_travel(kinematics: &Kinematics, report: &JointReport) -> Vec<Claim> {
    let all = kinematics.letters().into_iter().zip(report.ranges).zip(kinematics.limits()).enumerate();
    let beyond = all.filter_map(|(k, ((joint, range), limits))| {
        let [least, greatest] = limits?;
        let over = (least - range[0]).max(range[1] - greatest);
        Some((k < 3, joint, if k < 3 { over } else { over.to_degrees() }))
    });
    let beyond: Vec<_> = beyond.collect();
    let worst = |linear: bool| {
        let of = beyond.iter().filter(|(kind, ..)| *kind == linear);
        let (_, joint, over) = of.max_by(|a, b| a.2.total_cmp(&b.2))?;
        let unit = if linear { "mm" } else { "degrees" };
        let text = if *over <= ROUNDING {
            format!("joint {joint} comes nearest to its limit, {:.3} {unit} inside of it", (-over).max(0.0))
        } else {
            format!("joint {joint} runs {over:.3} {unit} beyond its limit")
        };
        let claim = Claim::length("travel", Gravity::Crash, ROUNDING, *over, 0.0).told(text);
        Some(Claim { unit: if linear { "mm" } else { "deg" }, ..claim })
    };
    [true, false].into_iter().filter_map(worst).collect()
}

/// What the user should know of how the machine moves.
fn note(report: &JointReport) -> Option<String> {
    let (poses, rewinds) = (report.singular.len(), report.rewinds.len());
    (poses + rewinds > 0).then(|| {
        format!(
            "the rotary joints come within a degree of a singular pose {poses} times, and unwind {rewinds} times \
             between passes"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use report::Verdict;

    #[test]
    fn a_retract_below_the_work_is_a_violation() {
        let claim = retract_above(0.0, 161.0);
        assert_eq!((claim.what, claim.verdict()), ("retract", Verdict::Fail));
        assert!(
            claim.text.ends_with("must stand at Z 161.000 or higher to be over the path and the work"),
            "{}",
            claim.text
        );
        assert_eq!(retract_above(0.0, -40.0).verdict(), Verdict::Pass);
        assert_eq!(retract_above(700.0, 161.0).verdict(), Verdict::Pass);
    }
}
