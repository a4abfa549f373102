//! One toolpath at work: what its figures are found from.

use cutter::Cutter;
use metrology::{Budget, Measured, Measurement, View};
use motion::{Cutters, Toolpath};
use part::Part;
use report::Claim;
use scene::{Scene, Tooling, ToolpathRequest};

use super::covered::Covered;
use super::earlier::{EarlierPath, WholePath};
use super::planned::Planned;
use super::tool::{Around, ToolMoves};
use super::{JobError, Session};

/// One toolpath that was planned, cut and measured.
pub(crate) struct Run<'a> {
    /// What all toolpaths of the scene share.
    pub session: &'a Session,
    /// What was asked for.
    pub request: &'a ToolpathRequest,
    /// What was planned.
    pub planned: &'a Planned,
    /// Time that the scene's machine takes for the path, s.
    pub machining_time_s: f64,
    /// What was measured.
    pub measured: &'a Measured,
    /// What the measurement covers.
    pub covered: &'a Covered,
    /// The tool, and what it must not touch.
    pub around: Around<'a>,
    /// Its moves behind those of the toolpaths before it: what was measured.
    pub whole: &'a WholePath<'a>,
    /// The toolpaths that cut the stock before it.
    pub earlier: &'a [EarlierPath],
    /// What makes its own moves.
    pub own_cutters: &'a Cutters,
    /// The moves of each tool, in order.
    pub tools: &'a [ToolMoves<'a>],
}

impl Run<'_> {
    pub fn scene(&self) -> &Scene {
        &self.session.scene
    }

    /// What cuts, where it is planned by the scene.
    pub fn tooling(&self) -> &Tooling {
        &self.request.tooling
    }

    pub fn part(&self) -> &Part {
        &self.session.part
    }

    pub fn path(&self) -> &Toolpath {
        &self.planned.plan.path
    }

    /// What makes the moves that were measured.
    pub fn cutters(&self) -> &Cutters {
        &self.whole.cutters
    }

    /// What other toolpaths and tools cut before the first move.
    pub fn before(&self) -> Vec<(Cutter, Toolpath)> {
        let tools = self.request.foreign().into_iter().flat_map(|read| read.before.iter().cloned());
        self.earlier.iter().flat_map(EarlierPath::stretches).chain(tools).collect()
    }

    pub fn measurement(&self) -> &Measurement {
        &self.measured.measurement
    }

    pub fn view(&self) -> &View {
        &self.measured.view
    }

    pub fn budget(&self) -> Budget {
        self.session.budget()
    }

    /// The line of its program that a move stands in; 0 where there is no program.
    pub fn line(&self, move_index: u32) -> u32 {
        self.path().line_of(move_index as usize).unwrap_or_default()
    }

    /// `, PROGRAM line N`, where there is a program, and `, tool N` where it has several.
    pub fn program_line(&self, move_index: u32) -> String {
        let (path, k) = (self.path(), move_index as usize);
        let line =
            path.line_of(k).map_or_else(String::new, |line| format!(", {} line {line}", path.program_name()));
        line + &self.tool_name(move_index)
    }

    /// `, tool N` of a move, where there are several tools.
    pub fn tool_name(&self, move_index: u32) -> String {
        let tool = self.path().named_tool_of(move_index as usize);
        tool.map_or_else(String::new, |tool| format!(", tool {tool}"))
    }

    /// For paths that cannot be cut of heights.
    pub fn heights(&self) -> impl Fn(sim::CutError) -> JobError {
        |reason| JobError::engine(self.scene(), &self.request.name, reason.into())
    }

    /// For voxels that do not fit.
    pub fn voxels(&self) -> impl Fn(sim::VoxelError) -> JobError {
        |reason| JobError::engine(self.scene(), &self.request.name, reason.into())
    }
}

/// What a figure found: itself, and what is to be said.
#[derive(Debug, Default)]
pub(crate) struct Finding {
    /// The figure, where there is one.
    pub figure: Option<report::Figure>,
    /// Notes on the toolpath.
    pub notes: Vec<String>,
    /// The limits that it was held against.
    pub claims: Vec<Claim>,
}
