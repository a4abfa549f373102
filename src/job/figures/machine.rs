//! How the joints of a five-axis machine move.

use serde::Serialize;

use ::machine::kinematics::{JointReport, Kinematics};
use report::{Claim, Figure, Gravity};
use work::monitor::Monitor;

use super::value;
use crate::JobError;
use crate::run::{Finding, Run};

/// The way of one joint.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct JointRange {
    /// Its letter.
    pub joint: char,
    /// Least and greatest value, mm, or degrees of a rotary joint.
    pub range: [f64; 2],
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
    /// Of the joints along a path.
    pub fn new(kinematics: &Kinematics, report: &JointReport) -> Self {
        let ranges = kinematics.letters().into_iter().zip(report.ranges);
        let shown = |(k, (joint, range)): (usize, (char, [f64; 2]))| JointRange {
            joint,
            range: if k < 3 { range } else { range.map(f64::to_degrees) },
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
    let figures = MachineFigures::new(&five_axis.kinematics, &joints.report);
    let figure = Figure { key: "machine", value: value(&figures)?, ..Figure::default() };
    Ok(Finding {
        figure: Some(figure),
        notes: note(&joints.report).into_iter().collect(),
        claims: within_travel(&five_axis.kinematics, &joints.report),
    })
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
