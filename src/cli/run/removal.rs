//! What a path takes of a block move by move, and whether the holder runs into what still stands, by voxels: for any
//! cutter axis.

use super::{BASE, Job, stock_area};
use crate::error::CliError;
use cutter::Solid;
use geometry::Aabb;
use metrology::{RemovalFigures, voxel_removal_figures};
use motion::Toolpath;
use report::{Violation, standing_collision, standing_note};
use scene::ToolpathRequest;
use sim::{StandingHits, VoxelEngine, VoxelStock};

/// Voxels in the block where the program chooses: more take longer than planning and measuring do, fewer leave engagement
/// and rates rough.
const VOXELS: f64 = 1e6;

/// What one path takes in the order of its moves, by voxels.
pub(super) struct InOrder {
    removal: RemovalFigures,
    /// Where shank and holder run into standing stock, if there is a holder.
    holder: Option<StandingHits>,
    voxel: f64,
}

/// What is to be said of a holder.
#[derive(Default)]
pub(super) struct Held {
    pub(super) note: Option<String>,
    pub(super) violation: Option<Violation>,
}

impl InOrder {
    /// With the lines of the moves in the program.
    pub(super) fn in_program(mut self, lines: &[u32]) -> (RemovalFigures, Held) {
        for contact in &mut self.removal.rapid_contacts {
            contact.line = lines.get(contact.move_index as usize).copied().unwrap_or_default();
        }
        let held = self.holder.map_or_else(Held::default, |hits| Held {
            note: Some(standing_note(&hits, self.voxel)),
            violation: standing_collision(&hits, self.voxel, lines),
        });
        (self.removal, held)
    }
}

impl Job<'_> {
    /// The block that the part is cut from, as far as it was roughed before.
    pub(super) fn voxel_stock(&self) -> VoxelStock {
        let Aabb { mut min, mut max } = stock_area(self.scene, &self.part);
        (min.z, max.z) = (min.z - BASE, self.top);
        let block = Aabb { min, max };
        match self.scene.stock.roughed {
            Some(over) => VoxelStock::roughed(block, self.part.mesh().clone(), over),
            None => VoxelStock::Box(block),
        }
    }

    /// Cuts the block in the order of the path, where the scene asks for it.
    pub(super) fn in_order(
        &self,
        request: &ToolpathRequest,
        path: &Toolpath,
    ) -> Result<Option<InOrder>, CliError> {
        let (scene, monitor) = (self.scene, self.progress);
        if !scene.simulation.removal {
            return Ok(None);
        }
        let refused = |reason| CliError::voxels(scene, &request.name, reason);
        let stock = self.voxel_stock();
        let about = || (stock.bounds().size().product() / VOXELS).cbrt();
        let voxel = scene.simulation.voxel.unwrap_or_else(about);
        let cutter = Solid::of_cutter(&scene.cutter, scene.holder.as_ref());
        let engine = VoxelEngine::new(&stock, &cutter, path).map_err(refused)?;
        let removed = engine.removal(voxel, monitor).map_err(refused)?;
        let removal = voxel_removal_figures(path, &removed, voxel);
        let look = |holder| engine.holder_in_stock(holder, path, voxel, monitor).map_err(refused);
        let holder = scene.holder.as_ref().map(look).transpose()?;
        Ok(Some(InOrder { removal, holder, voxel }))
    }
}
