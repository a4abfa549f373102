//! The solid that a path leaves of a block, by voxels: any cutter axis, undercuts included.

use super::{Job, MIB, part_bytes};
use crate::error::CliError;
use crate::outputs::Outputs;
use cutter::Solid;
use io::stl_write;
use motion::{ClPoint, Toolpath};
use report::SolidFigures;
use scene::ToolpathRequest;
use sim::VoxelEngine;

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
        let stock = self.voxel_stock();
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
        let uncut = Toolpath { start: ClPoint::upright(stock.bounds().max), moves: Vec::new() };
        let untouched = VoxelEngine::new(&stock, &tool, &uncut).map_err(refused)?;
        let whole =
            |voxel| Ok::<f64, CliError>(untouched.cut(voxel, left, monitor).map_err(refused)?.volume());
        let (volume_mm3, bricks) = (voxels.volume(), voxels.bricks());
        drop(voxels);
        let coarse = 2.0 * voxel;
        let coarse_volume = engine.cut(coarse, left, monitor).map_err(refused)?.volume();
        let removed_mm3 = whole(voxel)? - volume_mm3;
        let coarse_removed = whole(coarse)? - coarse_volume;
        Ok(Some(SolidFigures {
            voxel_mm: voxel,
            bricks,
            volume_mm3,
            volume_error_bound_mm3: (volume_mm3 - coarse_volume).abs(),
            removed_mm3,
            removed_error_bound_mm3: (removed_mm3 - coarse_removed).abs(),
            triangles: surface.triangles.len(),
        }))
    }
}
