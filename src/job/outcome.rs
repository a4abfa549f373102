//! What one toolpath left.

use std::sync::Arc;

use cutter::Holder;
use field::PlannedField;
use io::ProgramHeader;
use machine::kinematics::JointPath;
use metrology::{Measurement, View};
use motion::{Cutters, Toolpath};
use report::{Claim, FigureFile, ToolpathResult};
use toolpath::Rest;

use super::planned::write_program;
use super::{Machined, Session};

/// What one toolpath left: its results, and what files and pictures are made from.
#[derive(Debug)]
pub struct Outcome {
    /// Figures, notes, violations, verdict.
    pub result: ToolpathResult,
    /// The path, with the feeds of its program.
    pub path: Toolpath,
    /// What cuts along it.
    pub cutters: Cutters,
    /// What holds each of them.
    pub holders: Vec<Option<Holder>>,
    /// The path in the joints of a five-axis machine.
    pub joints: Option<JointPath>,
    /// What its programs say before the first move.
    pub header: ProgramHeader,
    /// What a streamline was planned by.
    pub field: Option<Arc<PlannedField>>,
    /// The figures with their maps and samples.
    pub measurement: Measurement,
    /// What they were found in. Moves are counted from the first of the toolpaths that cut the same stock.
    pub view: View,
    /// Which of those moves is the first of this toolpath.
    pub first_move: u32,
    /// The machined part as triangles.
    pub machined: Machined,
    /// Further files of its folder.
    pub files: Vec<FigureFile>,
    /// The limits of what it leaves to the toolpath behind it.
    pub(crate) left: Vec<Claim>,
    /// Where it and those before it left too much, if the toolpath behind it is for that.
    pub(crate) rest: Option<Arc<Rest>>,
}

impl Session {
    /// Writes the program of an outcome as G-code: nothing where the tool leans and the scene names no
    /// machine for it.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write_program(&self, out: &mut dyn std::io::Write, outcome: &Outcome) -> std::io::Result<()> {
        let Outcome { cutters, path, joints, header, .. } = outcome;
        write_program(out, &self.scene, (path, cutters.first()), joints.as_ref(), header).map(drop)
    }

    /// Whether an outcome has a program.
    pub fn has_program(&self, outcome: &Outcome) -> bool {
        // A program from elsewhere has its own file.
        outcome.path.origin.program.is_empty() && (outcome.path.is_upright() || outcome.joints.is_some())
    }
}
