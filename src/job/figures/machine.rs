//! How the joints of a five-axis machine move.

use serde::Serialize;

use ::machine::kinematics::{JointReport, Kinematics};
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
    let mut notes: Vec<String> = note(&joints.report).into_iter().collect();
    if five_axis.zero_is_given {
        claims.push(retract_above(machine.retracted_z(), joints.highest_nose(machine, path)));
    } else {
        notes.push(UNKNOWN_ZERO.to_owned());
    }
    let figure = Figure { key: "machine", value: value(&figures)?, ..Figure::default() };
    Ok(Finding { figure: Some(figure), notes, claims })
}

/// What is said where the scene does not tell where the workpiece is in the machine.
const UNKNOWN_ZERO: &str = "the program begins and ends at the upper end of Z's travel, or at the machine's Z zero where no `z` is given; \
                            that must be above the work: give `workpiece_zero` in [machine.kinematics] to have that checked";

/// That the machine's Z to which programs rise is no lower than where they come down from.
fn retract_above(z: f64, nose: f64) -> Claim {
    let text = format!(
        "programs rise to the machine's Z {z:.3}, and the spindle nose must stand at Z {nose:.3} or higher to be over the path"
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
            claim.text.ends_with("must stand at Z 161.000 or higher to be over the path"),
            "{}",
            claim.text
        );
        assert_eq!(retract_above(0.0, -40.0).verdict(), Verdict::Pass);
        assert_eq!(retract_above(700.0, 161.0).verdict(), Verdict::Pass);
    }
}
