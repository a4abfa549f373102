//! What is left of a stock, as samples near its surface: and its heights. mm.

use super::bricks::{BRICK, Bricks, STEPS, slot_of};
use geometry::Point3;

/// What is left of the stock, as samples near its surface.
#[derive(Debug, Clone, PartialEq)]
pub struct Voxels {
    pub(super) bricks: Bricks,
    pub(super) bytes: u64,
}

/// One sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VoxelSample {
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

    /// Samples along x, y and z around the stock.
    pub fn size(&self) -> [u32; 3] {
        self.bricks.lattice.size
    }

    /// Bricks of 8 × 8 × 8 samples that are kept.
    pub fn bricks(&self) -> usize {
        self.bricks.blocks.iter().map(|block| block.bricks.len()).sum()
    }

    /// Bytes that they take.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Where a sample stands, mm.
    pub fn place(&self, at: [u32; 3]) -> Point3 {
        self.bricks.lattice.place(at)
    }

    /// A sample; `None` away from the surface.
    pub fn sample(&self, at: [u32; 3]) -> Option<VoxelSample> {
        let placed = self.bricks.holding(at)?;
        let slot = slot_of(at);
        let distance = f64::from(placed.brick.distances[slot]) * (self.voxel() / STEPS);
        Some(VoxelSample { distance, cut_by: placed.brick.cut_by(slot) })
    }

    /// The highest place of the material at `(x, y)` by trilinear interpolation, mm; `None` where there is
    /// none.
    ///
    /// # Tolerance
    /// Across a smooth surface of curvature κ an eighth of κ·voxel²; at a ridge or an edge up to half a voxel
    /// times the sine of half its angle.
    pub fn height(&self, x: f64, y: f64) -> Option<f64> {
        let lattice = &self.bricks.lattice;
        let at = [(x - lattice.origin.x) / lattice.pitch, (y - lattice.origin.y) / lattice.pitch];
        if !at.iter().zip(&lattice.size).all(|(at, n)| *at >= 0.0 && *at < f64::from(n - 1)) {
            return None;
        }
        let low = at.map(f64::floor);
        let share = [at[0] - low[0], at[1] - low[1]];
        let column = |k: usize| [low[0] as u32 + (k as u32 & 1), low[1] as u32 + (k as u32 >> 1)];
        let layer = |z: u32| -> Option<f64> {
            let mut mean = 0.0;
            for k in 0..4 {
                let [i, j] = column(k);
                let weight = |axis: usize| if k >> axis & 1 == 1 { share[axis] } else { 1.0 - share[axis] };
                mean += weight(0) * weight(1) * self.sample([i, j, z])?.distance;
            }
            Some(mean)
        };
        let mut above: Option<f64> = None;
        let mut z = lattice.size[2];
        while z > 0 {
            z -= 1;
            let bricks = || (0..4).any(|k| self.bricks.holding([column(k)[0], column(k)[1], z]).is_some());
            if z % BRICK == BRICK - 1 && !bricks() {
                // Nothing passes in all of them.
                above = None;
                z -= BRICK - 1;
                continue;
            }
            let here = layer(z);
            if let (Some(above), Some(here)) = (above, here)
                && here < 0.0
                && above >= 0.0
            {
                return Some(lattice.origin.z + lattice.pitch * (f64::from(z) + here / (here - above)));
            }
            above = here;
        }
        None
    }
}
