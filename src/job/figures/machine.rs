//! How the joints of a five-axis machine move.

use serde::Serialize;

use ::machine::kinematics::{JointReport, Kinematics};
use report::Figure;
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
        ..Finding::default()
    })
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
