//! What is left of a stock, as samples near its surface, mm.

use super::bricks::{Bricks, STEPS, slot_of};

/// What is left of the stock, as samples near its surface.
#[derive(Debug, Clone, PartialEq)]
pub struct Voxels {
    pub(super) bricks: Bricks,
    pub(super) bytes: u64,
}

/// One sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct VoxelSample {
    /// Signed distance, mm, below zero in the material; two voxels where it is that or more.
    pub distance: f64,
    /// The move that is nearest there, [`NOT_CUT`](crate::NOT_CUT) where the stock's own surface is.
    pub cut_by: u32,
}

impl Voxels {
    /// Size of a voxel, mm: samples are that far apart.
    pub fn voxel(&self) -> f64 {
        self.bricks.lattice.pitch
    }

    /// Bricks of 8 × 8 × 8 samples that are kept.
    pub fn bricks(&self) -> usize {
        self.bricks.blocks.iter().map(|block| block.bricks.len()).sum()
    }

    /// A sample; `None` away from the surface.
    pub(super) fn sample(&self, at: [u32; 3]) -> Option<VoxelSample> {
        let placed = self.bricks.holding(at)?;
        let slot = slot_of(at);
        let distance = f64::from(placed.brick.distances[slot]) * (self.voxel() / STEPS);
        Some(VoxelSample { distance, cut_by: placed.brick.cut_by(slot) })
    }
}
