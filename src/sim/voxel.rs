//! The voxel engine: what is left of any stock after a path of any tool axes. mm.
//!
//! Enters: stock (a box, a round bar, a closed mesh), the tool as a [`Solid`] and a path. Leaves: the signed
//! distance from the surface of the remaining material at the samples near it, each with the move that is
//! nearest there; from those its volume, its heights, its surface as a closed triangle mesh and where a line leaves it; how
//! much each move removes in the order of the program, and whether a holder runs into what still stands.
//!
//! The material is the stock less all that the tool sweeps, so its distance is the greater of that of the
//! stock and the negative of that of the swept volume: exact in sign and at the surface, elsewhere no greater
//! than the true one. Samples stand on a lattice, in bricks of 8 × 8 × 8, only where the surface passes: a
//! cube around all is divided like an octree (`divide`), and hands on only those moves to its parts that may
//! be nearest in them (`moves`). Every move cuts, rapids too.

mod bricks;
mod capsule;
mod cells;
mod divide;
mod leaf;
mod line;
mod moves;
mod octree;
mod removal;
mod slide;
mod standing;
mod stock;
mod surface;
#[cfg(test)]
mod tests;
mod vertex;

use super::solid::OppositeAxes;
use bricks::{BRICK, Block, Brick, Bricks, Lattice, STEPS, slot_of};
use cells::Cells;
use cutter::Solid;
use divide::{Divider, Found};
use geometry::{Point3, Vector3};
pub use line::LineExit;
use motion::{MoveKind, Toolpath};
use moves::Parts;
pub use removal::VoxelRemoval;
pub use standing::{HolderHit, StandingHits};
use std::sync::atomic::{AtomicU64, Ordering};
pub use stock::{Axis, StockMesh, VoxelStock};
pub use surface::VoxelSurface;
use work::monitor::{Cancelled, Monitor, check};
use work::parallel;

/// Why voxels could not be cut.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum VoxelError {
    /// The voxel is not a positive number.
    #[error("the voxel size is {0} mm; it must be a positive number")]
    Voxel(f64),
    /// A size of the stock is not positive, or not finite.
    #[error("the stock is empty or not finite")]
    Stock,
    /// The voxels need more memory than allowed.
    #[error(
        "a voxel of {voxel} mm needs about {needed_mib} MiB, and {allowed_mib} MiB are left for it; voxels of \
         {fitting} mm fit"
    )]
    Memory {
        /// What was asked for, mm.
        voxel: f64,
        /// What the run would need.
        needed_mib: u64,
        /// What it may take.
        allowed_mib: u64,
        /// A voxel that fits, mm, two digits.
        fitting: f64,
    },
    /// The moves alone need more memory than allowed.
    #[error("the moves of the path alone need {needed_mib} MiB, and {allowed_mib} MiB are left for them")]
    Path {
        /// What they need.
        needed_mib: u64,
        /// What they may take.
        allowed_mib: u64,
    },
    /// Nobody can tell which way a tool axis turns.
    #[error(transparent)]
    Axes(#[from] OppositeAxes),
    /// Stopped by the monitor.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Bytes that bricks may take, and have taken.
struct Budget {
    allowed: u64,
    taken: AtomicU64,
}

impl Budget {
    fn new(allowed: u64) -> Self {
        Self { allowed, taken: AtomicU64::new(0) }
    }

    /// Whether so many more bytes are allowed. They count in any case: the sum says what would be needed.
    fn take(&self, bytes: u64) -> bool {
        self.taken.fetch_add(bytes, Ordering::Relaxed) + bytes <= self.allowed
    }

    /// Whether so many cubes of `n` samples that the surface may pass are far too many.
    fn is_hopeless(&self, cubes: usize, n: u32) -> bool {
        /// Cubes that the surface may pass, for one that it does.
        const LOOSE: f64 = 3.0;
        /// How many times too many: below that the true number is counted.
        const FAR_TOO_MANY: f64 = 4.0;
        let side = f64::from(n / BRICK);
        let about = cubes as f64 * side * side / LOOSE * size_of::<Brick>() as f64;
        about > FAR_TOO_MANY * self.allowed as f64
    }
}

const MIB: u64 = 1 << 20;

/// A first look at what voxels take has so many along the stock's longest side.
const COARSE: f64 = 64.0;

/// Voxels that seem to take so many times the memory are tried all the same.
const DOUBTFUL: f64 = 4.0;

/// Stock and moves made ready for voxels of any size: about 350 bytes a move that does not turn, 240 for each
/// further fiftieth of a radian of one that does.
#[derive(Debug)]
pub struct VoxelEngine<'a> {
    stock: &'a VoxelStock,
    parts: Parts,
    /// Which moves are rapid ones.
    rapids: Vec<bool>,
}

impl<'a> VoxelEngine<'a> {
    /// Prepares the moves of `path`, coordinates up to [`MAX_COORDINATE`](geometry::MAX_COORDINATE).
    ///
    /// # Errors
    /// [`VoxelError::Stock`], [`VoxelError::Axes`].
    pub fn new(stock: &'a VoxelStock, solid: &Solid, path: &Toolpath) -> Result<Self, VoxelError> {
        if !stock.is_valid() {
            return Err(VoxelError::Stock);
        }
        let rapids = path.moves.iter().map(|m| m.kind == MoveKind::Rapid).collect();
        Ok(Self { stock, parts: Parts::new(solid, path)?, rapids })
    }

    fn lattice(&self, voxel: f64) -> Result<Option<Lattice>, VoxelError> {
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
        let Some(Found { blocks, inside }) = divider.run(monitor)? else { return Ok(None) };
        let bytes = budget.taken.into_inner() + blocks.len() as u64 * Block::BYTES;
        Ok(Some(Voxels { bricks: Bricks::new(lattice, blocks), inside, bytes }))
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

/// What is left of the stock, as samples near its surface.
#[derive(Debug, Clone, PartialEq)]
pub struct Voxels {
    bricks: Bricks,
    /// Samples inside the material in no brick.
    inside: u64,
    bytes: u64,
}

/// One sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VoxelSample {
    /// Signed distance, mm, below zero in the material; two voxels where it is that or more.
    pub distance: f64,
    /// The move that is nearest there, [`NOT_CUT`](super::NOT_CUT) where the stock's own surface is.
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

    /// Volume of the material, mm³: cells in which the surface passes by linear interpolation.
    ///
    /// # Tolerance
    /// Across a smooth surface about a twelfth of the sum of its curvatures times voxel² for each mm² of it; at a
    /// square edge a tenth of voxel² for each mm of it.
    pub fn volume(&self) -> f64 {
        let of_block = |block: usize| {
            let (mut whole, mut shares) = (0, 0.0);
            for placed in self.bricks.of_block(block) {
                let cells = Cells::of(&self.bricks, &placed);
                whole += cells.inside();
                for (cell, corners) in crossed(&cells) {
                    whole -= usize::from(cells.is_inside(cell));
                    shares += corners.share();
                }
            }
            (whole as u64, shares)
        };
        let blocks = parallel::map(self.bricks.blocks.len(), of_block);
        let whole = self.inside + blocks.iter().map(|b| b.0).sum::<u64>();
        let shares: f64 = blocks.iter().map(|b| b.1).sum();
        (whole as f64 + shares) * self.voxel().powi(3)
    }
}

/// The cells of a brick in which the surface passes.
fn crossed(cells: &Cells) -> impl Iterator<Item = (usize, cells::Corners)> {
    (0..bricks::SAMPLES).filter_map(|cell| cells.crossed(cell).map(|corners| (cell, corners)))
}

/// The way from the least sample of a brick to one of its samples, in samples.
fn offset(slot: usize) -> Vector3 {
    Vector3::new((slot % 8) as f64, (slot / 8 % 8) as f64, (slot / 64) as f64)
}
