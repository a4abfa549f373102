//! Cuts a stock into voxels of any size that the memory allows. mm.
//!
//! Enters: stock, tool and path, made ready once. Leaves: [`Voxels`], or how much memory they would take and
//! the size that fits.

use super::bricks::{Block, Brick, Bricks, Lattice};
use super::budget::Budget;
use super::divide::Divider;
use super::error::VoxelError;
use super::moves::MotionParts;
use super::voxels::Voxels;
use crate::stock::Stock;
use cutter::Solid;
use motion::{MoveKind, Toolpath};
use work::monitor::{Monitor, check};

const MIB: u64 = 1 << 20;

/// A first look at what voxels take has so many along the stock's longest side.
const COARSE: f64 = 64.0;

/// Voxels that seem to take so many times the memory are tried all the same.
const DOUBTFUL: f64 = 4.0;

/// Stock and moves made ready for voxels of any size: about 350 bytes a move that does not turn, 240 for each
/// further fiftieth of a radian of one that does.
#[derive(Debug)]
pub struct VoxelEngine<'a> {
    pub(super) stock: &'a Stock,
    pub(super) parts: MotionParts,
    /// Which moves are rapid ones.
    pub(super) rapids: Vec<bool>,
}

impl<'a> VoxelEngine<'a> {
    /// Prepares the moves of `path`, coordinates up to [`MAX_COORDINATE`](geometry::MAX_COORDINATE).
    ///
    /// # Errors
    /// [`VoxelError::Stock`], [`VoxelError::Moves`], [`VoxelError::Axes`].
    pub fn new(stock: &'a Stock, solid: &Solid, path: &Toolpath) -> Result<Self, VoxelError> {
        if !stock.is_valid() {
            return Err(VoxelError::Stock);
        }
        path.check()?;
        let rapids = path.moves.iter().map(|m| m.kind == MoveKind::Rapid).collect();
        Ok(Self { stock, parts: MotionParts::new(solid, path)?, rapids })
    }

    pub(super) fn lattice(&self, voxel: f64) -> Result<Option<Lattice>, VoxelError> {
        if !(voxel > 0.0 && voxel.is_finite()) {
            return Err(VoxelError::Voxel(voxel));
        }
        Ok(Lattice::around(&self.stock.bounds(), voxel))
    }

    /// Cuts all moves into voxels of `voxel` mm with `memory` bytes at most.
    ///
    /// # Errors
    /// [`VoxelError::Voxel`], [`VoxelError::Memory`] and [`VoxelError::Path`] before the memory is taken,
    /// [`VoxelError::Cancelled`].
    ///
    /// # Tolerance
    /// Distances lie within 1e-5 mm, 2e-7 of a ball's radius and half a 16384th of a voxel of the exact ones
    /// up to two voxels from the surface; beyond only their sign is known. The bits depend neither on the
    /// number of threads nor on the machine's vector unit.
    pub fn cut(&self, voxel: f64, memory: u64, monitor: &dyn Monitor) -> Result<Voxels, VoxelError> {
        check(monitor)?;
        let moves = self.parts.bytes();
        let Some(left) = memory.checked_sub(moves).filter(|left| *left > size_of::<Brick>() as u64) else {
            return Err(VoxelError::Path { needed_mib: moves.div_ceil(MIB), allowed_mib: memory / MIB });
        };
        self.lattice(voxel)?;
        // What coarser voxels take tells how much finer ones would: far too fine ones are not tried.
        let doublings = (self.stock.bounds().size().max() / (COARSE * voxel)).log2().ceil().max(0.0);
        let mut pitch = voxel * doublings.exp2();
        let (mut counted, mut taken) = (pitch, 0.0);
        loop {
            // Where they are too many to be counted, the last ones that were tell.
            let found = self.try_cut(pitch, left, monitor)?;
            let too_many = found.is_none();
            if let Some(voxels) = found {
                if pitch == voxel && voxels.bytes <= left {
                    return Ok(voxels);
                }
                (counted, taken) = (pitch, voxels.bytes as f64);
            }
            let (finer, left) = (taken * (counted / voxel).powi(2), left as f64);
            if too_many || pitch == voxel || finer > DOUBTFUL * left && 4.0 * taken > left {
                return Err(VoxelError::Memory {
                    voxel,
                    needed_mib: ((finer + moves as f64) / MIB as f64).ceil() as u64,
                    allowed_mib: memory / MIB,
                    fitting: fitting(counted, taken / left),
                });
            }
            pitch = if finer <= DOUBTFUL * left { voxel } else { 0.5 * pitch };
        }
    }

    /// Cuts, keeping only as many bricks as are allowed; their bytes tell whether that is all of them. `None`
    /// where they are too many to be counted.
    fn try_cut(&self, voxel: f64, allowed: u64, monitor: &dyn Monitor) -> Result<Option<Voxels>, VoxelError> {
        let Some(lattice) = self.lattice(voxel)? else { return Ok(None) };
        let budget = Budget::new(allowed);
        let divider = Divider { parts: &self.parts, stock: self.stock, lattice, budget: &budget };
        let Some(blocks) = divider.run(monitor)? else { return Ok(None) };
        let bytes = budget.taken.into_inner() + blocks.len() as u64 * Block::BYTES;
        Ok(Some(Voxels { bricks: Bricks::new(lattice, blocks), bytes }))
    }
}

/// A voxel, two digits, that needs `times` less memory than `voxel`.
fn fitting(voxel: f64, times: f64) -> f64 {
    // Bricks along edges grow less than in proportion to the area.
    let size = 1.05 * voxel * times.sqrt();
    let digit = 10f64.powf(size.log10().floor() - 1.0);
    // Through decimal digits, so that messages say 0.35 and not 0.35000000000000003.
    format!("{:.1e}", (size / digit).ceil() * digit).parse().unwrap_or(size)
}
