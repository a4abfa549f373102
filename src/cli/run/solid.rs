//! The solid that a path leaves of a block, by voxels: any cutter axis, undercuts included.

use super::{BASE, Job, MIB, part_bytes};
use crate::cli::error::CliError;
use crate::cli::outputs::Outputs;
use crate::cutter::Solid;
use crate::geometry::Aabb;
use crate::io::scene::ToolpathRequest;
use crate::io::stl_write;
use crate::report::SolidFigures;
use crate::sim::{VoxelEngine, VoxelStock};
use crate::toolpath::Toolpath;

impl Job<'_> {
    /// Cuts the part's block into voxels where the scene asks for it, and writes solid.stl.
    pub(super) fn write_solid(
        &self,
        request: &ToolpathRequest,
        path: &Toolpath,
        outputs: &Outputs,
    ) -> Result<Option<SolidFigures>, CliError> {
        let (scene, monitor) = (self.scene, self.progress);
        let Some(voxel) = scene.simulation.voxel else { return Ok(None) };
        let refused = |reason| CliError::voxels(scene, &request.name, reason);
        let Aabb { mut min, mut max } = self.part.bounds();
        let margin = scene.stock.margin;
        (min.x, min.y, min.z) = (min.x - margin, min.y - margin, min.z - BASE);
        (max.x, max.y, max.z) = (max.x + margin, max.y + margin, self.top);
        let stock = VoxelStock::Box(Aabb { min, max });
        let tool = Solid::of_cutter(&scene.cutter, scene.holder.as_ref());
        let memory = u64::from(scene.simulation.memory_mib) * MIB;
        let engine = VoxelEngine::new(&stock, &tool, path).map_err(refused)?;
        let left = memory.saturating_sub(part_bytes(&self.part));
        let voxels = engine.cut(voxel, left, monitor).map_err(refused)?;
        let surface = engine.surface(&voxels, monitor)?;
        let places: Vec<[f32; 3]> =
            surface.vertices.iter().map(|p| p.coords.map(|c| c as f32).into()).collect();
        outputs.file(&format!("{}/solid.stl", request.folder), |out| {
            stl_write::write(out, &places, &surface.triangles)
        })?;
        // Square edges cost the voxels' volume a little, before and after alike.
        let before = engine_volume(&stock, &tool, voxel, left, self).map_err(refused)?;
        let volume_mm3 = voxels.volume();
        Ok(Some(SolidFigures {
            voxel_mm: voxel,
            bricks: voxels.bricks(),
            volume_mm3,
            removed_mm3: before - volume_mm3,
            triangles: surface.triangles.len(),
        }))
    }
}

/// Volume of the stock by the same voxels before it is cut, mm³.
fn engine_volume(
    stock: &VoxelStock,
    tool: &Solid,
    voxel: f64,
    memory: u64,
    job: &Job<'_>,
) -> Result<f64, crate::sim::VoxelError> {
    let start = crate::toolpath::ClPoint::upright(stock.bounds().max);
    let uncut = VoxelEngine::new(stock, tool, &Toolpath { start, moves: Vec::new() })?;
    Ok(uncut.cut(voxel, memory, job.progress)?.volume())
}
