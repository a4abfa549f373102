//! The solid that a path leaves of a block, by voxels: any cutter axis, undercuts included.

use serde::Serialize;

use cutter::Solid;
use motion::{ClPoint, Toolpath};
use report::{Figure, FigureFile, FileContent};
use sim::VoxelEngine;
use work::monitor::Monitor;

use super::value;
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
    /// How much it differs from that by voxels twice as large: three times its error, which falls with their square.
    pub volume_error_bound_mm3: f64,
    /// Volume that was cut away.
    pub removed_mm3: f64,
    /// As the bound of the volume that is left.
    pub removed_error_bound_mm3: f64,
    /// Triangles of solid.stl.
    pub triangles: usize,
}

/// Where the scene asks for voxels.
pub(super) fn find(run: &Run<'_>, monitor: &dyn Monitor) -> Result<Finding, JobError> {
    let Some(voxel) = run.scene().simulation.voxel else { return Ok(Finding::default()) };
    let stock = run.session.voxel_stock();
    let tool = Solid::of_cutter(&run.scene().cutter, run.scene().holder.as_ref());
    let left = run.budget().left(0);
    let engine = VoxelEngine::new(&stock, &tool, run.path()).map_err(run.voxels())?;
    let voxels = engine.cut(voxel, left, monitor).map_err(run.voxels())?;
    let surface = engine.surface(&voxels, monitor)?;
    let vertices: Vec<[f32; 3]> =
        surface.vertices.iter().map(|p| p.coords.map(|c| c as f32).into()).collect();
    let uncut = Toolpath::new(ClPoint::upright(stock.bounds().max), Vec::new());
    let untouched = VoxelEngine::new(&stock, &tool, &uncut).map_err(run.voxels())?;
    let whole =
        |voxel| Ok::<f64, JobError>(untouched.cut(voxel, left, monitor).map_err(run.voxels())?.volume());
    let (volume_mm3, bricks) = (voxels.volume(), voxels.bricks());
    drop(voxels);
    let coarse = 2.0 * voxel;
    let coarse_volume = engine.cut(coarse, left, monitor).map_err(run.voxels())?.volume();
    // Stock with a closed form leaves what is removed to rounding.
    let (fine_whole, coarse_whole) = match stock.volume() {
        Some(exact) => (exact, exact),
        None => (whole(voxel)?, whole(coarse)?),
    };
    let removed_mm3 = fine_whole - volume_mm3;
    let coarse_removed = coarse_whole - coarse_volume;
    let figures = SolidFigures {
        voxel_mm: voxel,
        bricks,
        volume_mm3,
        volume_error_bound_mm3: (volume_mm3 - coarse_volume).abs(),
        removed_mm3,
        removed_error_bound_mm3: (removed_mm3 - coarse_removed).abs(),
        triangles: surface.triangles.len(),
    };
    let content = FileContent::Mesh { vertices, triangles: surface.triangles };
    let files = vec![FigureFile { name: "solid.stl", content }];
    let figure = Figure { key: "solid", value: value(&figures)?, files, ..Figure::default() };
    Ok(Finding { figure: Some(figure), ..Finding::default() })
}
