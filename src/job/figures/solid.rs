//! The solid that a path leaves of a block, by voxels: any cutter axis, undercuts included.

use serde::Serialize;

use cutter::Solid;
use geometry::{Point3, round_down, round_up};
use report::{Figure, FigureFile, FileContent};
use sim::{VoxelEngine, VoxelVolumes};
use work::monitor::Monitor;

use super::words::value;
use crate::JobError;
use crate::run::{Finding, Run};

/// The solid that is left of a block, by voxels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SolidFigures {
    /// Pitch of the voxels.
    pub voxel_mm: f64,
    /// Bricks of 8³ voxels that the surface passes.
    pub bricks: usize,
    /// Volume that is left.
    pub volume_mm3: f64,
    /// Bound of its error: half of what lies between two proven volumes.
    pub volume_error_bound_mm3: Option<f64>,
    /// Volume that was cut away.
    pub removed_mm3: f64,
    /// Bound of its error.
    pub removed_error_bound_mm3: Option<f64>,
    /// Why there are no bounds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<&'static str>,
    /// Triangles of solid.stl.
    pub triangles: usize,
}

/// Why a roughed block may have no bounds.
const OPEN: &str = "beside the borders of an open surface nothing bounds what was roughed";

/// Where the scene asks for voxels.
pub(super) fn find(run: &Run<'_>, monitor: &dyn Monitor) -> Result<Finding, JobError> {
    let Some(voxel) = run.scene().simulation.voxel else { return Ok(Finding::default()) };
    let stock = run.session.roughed_stock();
    let tool = Solid::of_cutter(&run.tooling().cutter, run.tooling().holder.as_ref());
    let memory = run.budget().left(0);
    let engine = VoxelEngine::new(&stock, &tool, run.path()).map_err(run.voxels())?;
    let voxels = engine.cut(voxel, memory, monitor).map_err(run.voxels())?;
    let surface = engine.surface(&voxels, monitor)?;
    // Rounding may not take them out of the block.
    let bounds = stock.bounds();
    let (least, most) = (bounds.min.map(round_up), bounds.max.map(round_down));
    let narrow = |p: &Point3| p.map(|c| c as f32).sup(&least).inf(&most).into();
    let vertices: Vec<[f32; 3]> = surface.vertices.iter().map(narrow).collect();
    let VoxelVolumes { left, removed } = engine.volumes(voxel, monitor).map_err(run.voxels())?;
    let [volume_mm3, removed_mm3] = [left, removed].map(|[low, high]| 0.5 * (low + high));
    let roughed = run.scene().stock.roughed().is_some();
    let reason = (roughed && !run.session.part.mesh().is_closed()).then_some(OPEN);
    let [of_left, of_removed] = [left, removed].map(|[low, high]| 0.5 * (high - low));
    let figures = SolidFigures {
        voxel_mm: voxel,
        bricks: voxels.bricks(),
        volume_mm3,
        volume_error_bound_mm3: reason.is_none().then_some(of_left),
        removed_mm3,
        removed_error_bound_mm3: reason.is_none().then_some(of_removed),
        reason,
        triangles: surface.triangles.len(),
    };
    let content = FileContent::Mesh { vertices, triangles: surface.triangles };
    let files = vec![FigureFile { name: "solid.stl", content }];
    let figure = Figure { key: "solid", value: value(&figures)?, files, ..Figure::default() };
    Ok(Finding { figure: Some(figure), ..Finding::default() })
}
