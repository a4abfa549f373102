//! Moves in the coordinates of one tile, many side by side, for vector loops. mm.

use crate::sweep::LocalMove;
use crate::track::Track;
use work::lanes::{LANES, Real};

/// Slope from which a move counts as steep. Along steep moves the rounding of the place is magnified by
/// the slope; they are kept as the level move at their lowest tip, which bounds them from below, and
/// evaluated in f64 where they may cut.
const STEEP: f64 = 4.0;

/// Where and how high the middle of a tile is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    pub x: f64,
    pub y: f64,
    pub z: f64,
    /// Parts of a track farther than this from its point next to the middle cannot reach the tile.
    pub reach: f64,
}

impl<T: Real> LocalMove<T> {
    /// The record of a track, and whether it only bounds the move from below.
    pub(super) fn new(track: &Track, frame: &Frame) -> (Self, bool) {
        let (along, _) = track.along_across(frame.x, frame.y);
        let next = along.max(0.0).min(track.length);
        let (low, high) = ((-next).max(-frame.reach), (track.length - next).min(frame.reach));
        let steep = track.slope > STEEP;
        let z = if steep { track.tip(next + low) } else { track.tip(next) };
        let local = Self {
            x: T::of(track.x + next * track.ux - frame.x),
            y: T::of(track.y + next * track.uy - frame.y),
            z: T::of(z - frame.z),
            ux: T::of(track.ux),
            uy: T::of(track.uy),
            low: T::of(low),
            high: T::of(high),
            slope: T::of(if steep { 0.0 } else { track.slope }),
            sin: T::of(if steep { 0.0 } else { track.sin() }),
            sec: T::of(if steep { 1.0 } else { 1.0 / track.cos }),
        };
        (local, steep)
    }
}

/// A name of a move with two remarks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Name(u32);

/// The record only bounds its move from below.
const BOUND_ONLY: u32 = 1 << 31;

/// The program goes along the track from its higher end to its lower one.
const FALLING: u32 = 1 << 30;

impl Name {
    /// Most moves that can be named.
    pub const MOST: usize = FALLING as usize;

    pub fn new(index: u32, bound_only: bool, falling: bool) -> Self {
        Self(index | if bound_only { BOUND_ONLY } else { 0 } | if falling { FALLING } else { 0 })
    }
    #[inline(always)]
    pub fn index(self) -> u32 {
        self.0 & !(BOUND_ONLY | FALLING)
    }
    #[inline(always)]
    pub fn bound_only(self) -> bool {
        self.0 & BOUND_ONLY != 0
    }
    #[inline(always)]
    pub fn falling(self) -> bool {
        self.0 & FALLING != 0
    }
}

/// Numbers of one move.
const NUMBERS: usize = 10;

/// Up to [`LANES`] moves, one array for each of their numbers.
#[derive(Debug, Clone, Copy)]
pub(super) struct Chunk<T> {
    numbers: [[T; LANES]; NUMBERS],
    names: [Name; LANES],
}

/// A list of moves in chunks; its memory is kept when it is emptied.
#[derive(Debug, Clone)]
pub(super) struct MoveList<T> {
    chunks: Vec<Chunk<T>>,
    len: usize,
}

impl<T: Real> MoveList<T> {
    pub fn new() -> Self {
        Self { chunks: Vec::new(), len: 0 }
    }

    #[inline(always)]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Makes room for `len` moves, all of which are to be put in.
    #[inline(always)]
    pub fn reset(&mut self, len: usize) {
        if self.chunks.len() * LANES < len {
            self.chunks.resize(len.div_ceil(LANES), Chunk::empty());
        }
        self.len = len;
        // Loops over whole chunks do not take what is behind the last move for one.
        if let Some(chunk) = self.chunks.get_mut(len / LANES) {
            chunk.names[len % LANES..].fill(Name(BOUND_ONLY));
        }
    }

    /// The chunks in use. The last one may end with moves of an earlier use.
    #[inline(always)]
    pub fn chunks(&self) -> &[Chunk<T>] {
        &self.chunks[..self.len.div_ceil(LANES)]
    }

    /// One bit for each lane of chunk `k` that holds a move.
    #[inline(always)]
    pub fn lanes_in_use(&self, k: usize) -> u32 {
        let count = (self.len - k * LANES).min(LANES);
        u32::MAX >> (u32::BITS as usize - count)
    }

    /// Move `k`.
    #[inline(always)]
    pub fn put(&mut self, k: usize, m: &LocalMove<T>, name: Name) {
        self.chunks[k / LANES].set(k % LANES, m, name);
    }

    /// Move `k` and its name.
    #[inline(always)]
    pub fn get(&self, k: usize) -> (LocalMove<T>, Name) {
        let chunk = &self.chunks[k / LANES];
        (chunk.lane(k % LANES), chunk.names[k % LANES])
    }
}

impl<T: Real> Chunk<T> {
    /// Of moves that only bound.
    #[inline(always)]
    pub fn empty() -> Self {
        Self { numbers: [[T::of(0.0); LANES]; NUMBERS], names: [Name(BOUND_ONLY); LANES] }
    }

    #[inline(always)]
    pub fn set(&mut self, lane: usize, m: &LocalMove<T>, name: Name) {
        let numbers = [m.x, m.y, m.z, m.ux, m.uy, m.low, m.high, m.slope, m.sin, m.sec];
        for (column, number) in self.numbers.iter_mut().zip(numbers) {
            column[lane] = number;
        }
        self.names[lane] = name;
    }

    #[inline(always)]
    pub fn lane(&self, lane: usize) -> LocalMove<T> {
        let [x, y, z, ux, uy, low, high, slope, sin, sec] = &self.numbers;
        LocalMove {
            x: x[lane],
            y: y[lane],
            z: z[lane],
            ux: ux[lane],
            uy: uy[lane],
            low: low[lane],
            high: high[lane],
            slope: slope[lane],
            sin: sin[lane],
            sec: sec[lane],
        }
    }

    #[inline(always)]
    pub fn name(&self, lane: usize) -> Name {
        self.names[lane % LANES]
    }
}
