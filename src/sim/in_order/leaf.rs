//! The lowest level: 8 × 8 cells cut by one move, and what the move removed there. mm.

use super::bound::Bound;
use super::heights::Cells;
use super::{ENGAGED, MoveRemoval};
use crate::sweep::Sweep;
use crate::track::{Track, larger, smaller};
use pulp::Simd;

/// Cells along the side of a leaf: a row is one vector of f64 on the widest machines. Larger leaves
/// are cut where most of their cells keep their height, smaller ones cost more in the tree.
pub(super) const LEAF: usize = 8;

/// Heights (each a value of f32) and moves of a leaf, row by row; all f64, so that one vector holds a
/// row of either. Cells beyond the border of the grid stand at minus infinity, where nothing cuts them.
#[derive(Clone)]
pub(super) struct Leaf {
    pub height: [[f64; LEAF]; LEAF],
    /// Index of the move, or [`UNTOUCHED`].
    pub by: [[f64; LEAF]; LEAF],
}

/// Cells of a leaf.
pub(super) const CELLS: usize = LEAF * LEAF;

/// In [`Leaf::by`]: no move cut the cell.
pub(super) const UNTOUCHED: f64 = -1.0;

/// What a move removed so far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Tally {
    /// Sum over the cells of the height removed, each by the share of it that counts.
    pub sum: f64,
    /// Greatest height removed at a cell.
    pub depth: f64,
    /// Greatest height above the tip at which an engaged cell stood.
    pub axial: f64,
    /// Extents of the engaged cells' centres along and across the track.
    pub along: [f64; 2],
    pub across: [f64; 2],
}

impl Tally {
    pub const NOTHING: Self = Self {
        sum: 0.0,
        depth: 0.0,
        axial: 0.0,
        along: [f64::INFINITY, f64::NEG_INFINITY],
        across: [f64::INFINITY, f64::NEG_INFINITY],
    };

    /// Adds what the move removed elsewhere.
    pub fn add(&mut self, other: &Self) {
        self.sum += other.sum;
        self.depth = larger(self.depth, other.depth);
        self.axial = larger(self.axial, other.axial);
        self.along = union(self.along, other.along);
        self.across = union(self.across, other.across);
    }

    /// Adds one cell that was lowered.
    pub fn add_cell(&mut self, drop: f64, share: f64, now: f64, track: &Track, along: f64, across: f64) {
        self.sum += drop * share;
        self.depth = larger(self.depth, drop);
        if drop > ENGAGED {
            self.axial = larger(self.axial, now - track.tip(smaller(larger(along, 0.0), track.length)));
            self.along = union(self.along, [along, along]);
            self.across = union(self.across, [across, across]);
        }
    }

    /// The figures, with their bounds, for a grid of this cell.
    pub fn removal(&self, track: &Track, cell: f64) -> MoveRemoval {
        // A cell seen along a direction that is turned against the grid is wider than its side.
        let footprint = cell * (track.ux.abs() + track.uy.abs());
        let engaged = self.along[1] >= self.along[0];
        let extent = |[low, high]: [f64; 2]| if engaged { high - low + footprint } else { 0.0 };
        let (along, across) = (extent(self.along), extent(self.across));
        let (radial, radial_bound) = match (engaged, track.length > 0.0) {
            (false, _) => (0.0, 0.0),
            (true, true) => (across, footprint),
            // The diagonal of the extents is no less than the extent in any direction.
            (true, false) => (larger(along, across), footprint + along.hypot(across) - larger(along, across)),
        };
        // Extents along x and y are at most those along and across, turned. Cells lowered by less
        // than ENGAGED lie outside of the extents; what they hold is counted whole.
        let turned = (along + across) * (track.ux.abs() + track.uy.abs());
        let volume_bound = if engaged { cell * self.depth * turned } else { self.sum * cell * cell };
        MoveRemoval {
            volume: self.sum * cell * cell,
            volume_bound,
            depth: self.depth,
            axial: self.axial,
            along: if track.length > 0.0 { along } else { 0.0 },
            radial,
            radial_bound,
        }
    }
}

fn union(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [smaller(a[0], b[0]), larger(a[1], b[1])]
}

/// A [`Tally`] for each column of the leaves, so that rows go through vector lanes.
#[derive(Clone, Copy)]
pub(super) struct Lanes {
    sum: [f64; LEAF],
    depth: [f64; LEAF],
    axial: [f64; LEAF],
    along_low: [f64; LEAF],
    along_high: [f64; LEAF],
    across_low: [f64; LEAF],
    across_high: [f64; LEAF],
}

impl Lanes {
    #[inline(always)]
    pub fn new() -> Self {
        Self {
            sum: [0.0; LEAF],
            depth: [0.0; LEAF],
            axial: [0.0; LEAF],
            along_low: [f64::INFINITY; LEAF],
            along_high: [f64::NEG_INFINITY; LEAF],
            across_low: [f64::INFINITY; LEAF],
            across_high: [f64::NEG_INFINITY; LEAF],
        }
    }

    /// All columns together, from the first to the last.
    #[inline(always)]
    pub fn tally(&self) -> Tally {
        let mut tally = Tally::NOTHING;
        for i in 0..LEAF {
            tally.add(&Tally {
                sum: self.sum[i],
                depth: self.depth[i],
                axial: self.axial[i],
                along: [self.along_low[i], self.along_high[i]],
                across: [self.across_low[i], self.across_high[i]],
            });
        }
        tally
    }
}

impl Leaf {
    /// Cells that lie beyond the grid.
    pub fn beyond() -> Self {
        Self { height: [[f64::NEG_INFINITY; LEAF]; LEAF], by: [[UNTOUCHED; LEAF]; LEAF] }
    }

    /// Lowers each cell to the height of the sweep where that is less once it is stored, and adds to
    /// `lanes`. True when a cell was lowered.
    #[inline(always)]
    pub fn cut<S: Simd, W: Sweep<f64>>(
        &mut self,
        simd: S,
        bound: &Bound<W>,
        centres: [&[f64; LEAF]; 2],
        shares: [&[f64; LEAF]; 2],
        index: u32,
        lanes: &mut Lanes,
    ) -> bool {
        let cells = Cells::new(simd, centres, bound.track);
        let heights = cells.heights(bound, self.height.as_flattened());
        self.lower(simd, bound.track, &cells, &heights, shares, index, lanes)
    }

    #[inline(always)]
    fn lower<S: Simd>(
        &mut self,
        simd: S,
        track: &Track,
        cells: &Cells,
        heights: &[[f64; LEAF]; LEAF],
        [columns, rows]: [&[f64; LEAF]; 2],
        index: u32,
        lanes: &mut Lanes,
    ) -> bool {
        let rank = simd.splat_f64s(f64::from(index));
        let (zero, engaged_drop) = (simd.splat_f64s(0.0), simd.splat_f64s(ENGAGED));
        let (none, beyond) = (simd.splat_f64s(f64::INFINITY), simd.splat_f64s(f64::NEG_INFINITY));
        let mut most = zero;
        for v in 0..LEAF / S::F64_LANES {
            let (mut sum, mut depth, mut axial) = (zero, zero, zero);
            let (mut along_low, mut along_high) = (none, beyond);
            let (mut across_low, mut across_high) = (none, beyond);
            for j in 0..LEAF {
                let along = S::as_simd_f64s(&cells.along[j]).0[v];
                let across = S::as_simd_f64s(&cells.across[j]).0[v];
                let now = &mut S::as_mut_simd_f64s(&mut self.height[j]).0[v];
                let by = &mut S::as_mut_simd_f64s(&mut self.by[j]).0[v];
                let before = *now;
                // Compared as it is stored: what each move removes then adds up without remainder.
                let stored = to_single(simd, S::as_simd_f64s(&heights[j]).0[v]);
                let lower = simd.less_than_f64s(stored, before);
                *now = simd.select_f64s(lower, stored, before);
                *by = simd.select_f64s(lower, rank, *by);
                let drop = simd.select_f64s(lower, simd.sub_f64s(before, stored), zero);
                sum = simd.add_f64s(sum, simd.mul_f64s(drop, simd.splat_f64s(rows[j])));
                depth = simd.max_f64s(depth, drop);
                let engaged = simd.less_than_f64s(engaged_drop, drop);
                let above = simd.sub_f64s(before, tip_abeam(simd, track, along));
                axial = simd.max_f64s(axial, simd.select_f64s(engaged, above, zero));
                along_low = simd.min_f64s(along_low, simd.select_f64s(engaged, along, none));
                along_high = simd.max_f64s(along_high, simd.select_f64s(engaged, along, beyond));
                across_low = simd.min_f64s(across_low, simd.select_f64s(engaged, across, none));
                across_high = simd.max_f64s(across_high, simd.select_f64s(engaged, across, beyond));
            }
            sum = simd.mul_f64s(sum, S::as_simd_f64s(columns).0[v]);
            most = simd.max_f64s(most, depth);
            let join = |all: &mut [f64; LEAF], one: S::f64s, f: fn(S, S::f64s, S::f64s) -> S::f64s| {
                let all = &mut S::as_mut_simd_f64s(all).0[v];
                *all = f(simd, *all, one);
            };
            join(&mut lanes.sum, sum, S::add_f64s);
            join(&mut lanes.depth, depth, S::max_f64s);
            join(&mut lanes.axial, axial, S::max_f64s);
            join(&mut lanes.along_low, along_low, S::min_f64s);
            join(&mut lanes.along_high, along_high, S::max_f64s);
            join(&mut lanes.across_low, across_low, S::min_f64s);
            join(&mut lanes.across_high, across_high, S::max_f64s);
        }
        simd.reduce_max_f64s(most) > 0.0
    }
}

/// Rounded to the nearest value of f32 (T. J. Dekker's splitting, 1971): as a conversion and back, but
/// for ties and for values below the least normal f32. NaN where the value is infinite.
#[inline(always)]
fn to_single<S: Simd>(simd: S, value: S::f64s) -> S::f64s {
    /// One more than 2 to the power of the bits that f32 lacks.
    const SPLIT: f64 = (1u64 << 29) as f64 + 1.0;
    let scaled = simd.mul_f64s(value, simd.splat_f64s(SPLIT));
    simd.add_f64s(simd.sub_f64s(value, scaled), scaled)
}

/// Height of the tip where it passes the place, or at the nearer end of its track.
#[inline(always)]
fn tip_abeam<S: Simd>(simd: S, track: &Track, along: S::f64s) -> S::f64s {
    let sigma = simd.min_f64s(simd.max_f64s(along, simd.splat_f64s(0.0)), simd.splat_f64s(track.length));
    simd.add_f64s(simd.splat_f64s(track.z), simd.mul_f64s(simd.splat_f64s(track.slope), sigma))
}
