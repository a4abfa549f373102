//! Where samples stand: bricks of 8 × 8 × 8, in blocks of 8 × 8 × 8 bricks, where the surface passes.
//!
//! A sample keeps its distance in 16 bits and its nearest move as an index into the brick's own short list:
//! half of what 32 bits would take.

use super::cube::Cube;
use crate::NOT_CUT;
use geometry::{Aabb, Point3, Vector3};
use std::collections::HashMap;

/// Samples along the side of a brick.
pub(super) const BRICK: u32 = 8;
/// Samples in a brick.
pub(super) const SAMPLES: usize = (BRICK * BRICK * BRICK) as usize;
/// Samples along the side of a block.
pub(super) const BLOCK: u32 = 64;

/// Distances are kept up to this many voxels from the surface: a cell in which it passes has all its
/// corners within √3.
pub(super) const BAND: f64 = 2.0;

/// Steps of a kept distance to a voxel. Fewer show in heights, more do not fit 16 bits.
pub(super) const STEPS: f64 = 16384.0;

/// In the table of a block: no brick. In a brick: no move.
const NONE: u16 = u16::MAX;

/// Places of the samples: `origin + pitch·(i, j, k)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lattice {
    pub(super) origin: Point3,
    pub(super) pitch: f64,
    /// Samples along each axis that lie around the stock, one beyond it on each side.
    pub(super) size: [u32; 3],
}

impl Lattice {
    /// Around a box, its faces half way between samples where the pitch divides it; `None` where there are
    /// more samples than can be counted.
    pub(super) fn around(bounds: &Aabb, pitch: f64) -> Option<Self> {
        // The hair keeps 0.3 / 0.1 from taking a fourth one.
        let count = |length: f64| (length / pitch - 1e-9).ceil() + 4.0;
        let size = bounds.size().map(count);
        let lattice = Self {
            origin: bounds.min - Vector3::from_element(1.5 * pitch),
            pitch,
            size: [size.x, size.y, size.z].map(|n| n as u32),
        };
        (size.max() < f64::from(1u32 << 30)).then_some(lattice)
    }

    /// Samples along the side of the cube that is divided.
    pub(super) fn side(&self) -> u32 {
        self.size.into_iter().fold(BLOCK, u32::max).next_power_of_two()
    }

    /// The distance up to which distances are kept, mm.
    pub(super) fn band(&self) -> f64 {
        BAND * self.pitch
    }

    pub(super) fn place(&self, at: [u32; 3]) -> Point3 {
        self.origin + Vector3::from(at.map(f64::from)) * self.pitch
    }

    /// The middle of a cube of samples.
    pub(super) fn centre(&self, cube: &Cube) -> Point3 {
        self.place(cube.low) + Vector3::from_element(0.5 * f64::from(cube.n - 1) * self.pitch)
    }
}

/// Samples `x + 8 (y + 8 z)`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Brick {
    pub(super) distances: [i16; SAMPLES],
    /// Into `moves`.
    pub(super) nearest: [u16; SAMPLES],
    pub(super) moves: Box<[u32]>,
}

impl Brick {
    pub(super) fn bytes(&self) -> u64 {
        (size_of::<Self>() + size_of_val(&self.moves[..])) as u64
    }

    pub(super) fn cut_by(&self, sample: usize) -> u32 {
        self.moves.get(usize::from(self.nearest[sample])).copied().unwrap_or(NOT_CUT)
    }
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Block {
    /// Which block, counted along each axis.
    at: [u32; 3],
    pub(super) bricks: Vec<Brick>,
    /// Which brick of the block each is.
    places: Vec<u16>,
    /// The brick at each place, `x + 8 (y + 8 z)`.
    table: Box<[u16]>,
}

impl Block {
    /// Bytes of one without bricks.
    pub(super) const BYTES: u64 = (size_of::<Self>() + 2 * SAMPLES) as u64;

    pub(super) fn new(at: [u32; 3]) -> Self {
        Self { at, bricks: Vec::new(), places: Vec::new(), table: vec![NONE; SAMPLES].into() }
    }

    /// Puts in the brick whose least sample is `low`.
    pub(super) fn put(&mut self, low: [u32; 3], brick: Brick) {
        let [x, y, z] = low.map(|x| (x % BLOCK) / BRICK);
        let place = x + 8 * (y + 8 * z);
        self.table[place as usize] = self.bricks.len() as u16;
        self.places.push(place as u16);
        self.bricks.push(brick);
    }
}

/// All samples near the surface.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Bricks {
    pub(super) lattice: Lattice,
    pub(super) blocks: Vec<Block>,
    index: HashMap<[u32; 3], u32>,
}

/// A brick and where it stands: its block, which of the block's, and its least sample.
#[derive(Clone, Copy)]
pub(super) struct Placed<'a> {
    pub(super) brick: &'a Brick,
    pub(super) block: usize,
    pub(super) slot: usize,
    pub(super) low: [u32; 3],
}

impl Bricks {
    pub(super) fn new(lattice: Lattice, blocks: Vec<Block>) -> Self {
        let index = blocks.iter().enumerate().map(|(k, block)| (block.at, k as u32)).collect();
        Self { lattice, blocks, index }
    }

    /// All bricks, in a fixed order.
    pub(super) fn of_block(&self, block: usize) -> impl Iterator<Item = Placed<'_>> {
        let Block { at, bricks, places, .. } = &self.blocks[block];
        bricks.iter().zip(places).enumerate().map(move |(slot, (brick, &place))| {
            let place = u32::from(place);
            let within = [place % 8, place / 8 % 8, place / 64];
            Placed { brick, block, slot, low: std::array::from_fn(|i| at[i] * BLOCK + within[i] * BRICK) }
        })
    }

    /// The brick that holds a sample.
    pub(super) fn holding(&self, at: [u32; 3]) -> Option<Placed<'_>> {
        let block = *self.index.get(&at.map(|x| x / BLOCK))? as usize;
        let [x, y, z] = at.map(|x| (x % BLOCK / BRICK) as usize);
        let held = &self.blocks[block];
        let slot = usize::from(held.table[x + 8 * (y + 8 * z)]);
        let brick = held.bricks.get(slot)?;
        Some(Placed { brick, block, slot, low: at.map(|x| x / BRICK * BRICK) })
    }
}

/// Where a sample stands in its brick.
pub(super) fn slot_of(at: [u32; 3]) -> usize {
    let [x, y, z] = at.map(|x| (x % BRICK) as usize);
    x + 8 * (y + 8 * z)
}

/// The way from the least sample of a brick to one of its samples, in samples.
pub(super) fn offset(slot: usize) -> Vector3 {
    Vector3::new((slot % 8) as f64, (slot / 8 % 8) as f64, (slot / 64) as f64)
}
