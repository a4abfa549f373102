//! What one toolpath left.

use cutter::Holder;
use field::PlannedField;
use machine::kinematics::JointPath;
use metrology::{Measurement, View};
use motion::{Cutters, Toolpath};
use report::{FigureFile, ToolpathResult};

use super::Machined;

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
    /// What a streamline was planned by.
    pub field: Option<PlannedField>,
    /// The figures with their maps and samples.
    pub measurement: Measurement,
    /// What they were found in.
    pub view: View,
    /// The machined part as triangles.
    pub machined: Machined,
    /// Further files of its folder.
    pub files: Vec<FigureFile>,
}
