//! The lowest level: 8 × 8 cells cut by one move, and what the move removed there. mm.

use super::{ENGAGED, MoveRemoval};
use crate::sim::NOT_CUT;
use crate::sim::track::{Track, larger, smaller};

/// Cells along the side of a leaf: a row is one vector of f64 on the widest machines. Larger leaves
/// are cut where most of their cells keep their height, smaller ones cost more in the tree.
pub(super) const LEAF: usize = 8;

/// Heights and moves of a leaf, row by row. Cells beyond the border of the grid stand at minus
/// infinity, where nothing cuts them.
#[derive(Clone)]
pub(super) struct Leaf {
    pub height: [f32; LEAF * LEAF],
    pub by: [u32; LEAF * LEAF],
}

/// What a move removed so far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Tally {
    /// Sum over the cells of the height removed.
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
    pub fn add_cell(&mut self, drop: f64, now: f64, track: &Track, along: f64, across: f64) {
        self.sum += drop;
        self.depth = larger(self.depth, drop);
        if drop > ENGAGED {
            self.axial = larger(self.axial, now - tip_abeam(track, along));
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
            radial,
            radial_bound,
        }
    }
}

fn union(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [smaller(a[0], b[0]), larger(a[1], b[1])]
}

/// Height of the tip where it passes the place, or at the nearer end of its track.
#[inline(always)]
fn tip_abeam(track: &Track, along: f64) -> f64 {
    track.tip(smaller(larger(along, 0.0), track.length))
}

/// A [`Tally`] for each column of the leaves, so that rows go through vector lanes.
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
        Self { height: [f32::NEG_INFINITY; LEAF * LEAF], by: [NOT_CUT; LEAF * LEAF] }
    }

    /// Lowers each cell to `height(along, across, height now)` where that is less once it is stored,
    /// and adds to `lanes`. True when a cell was lowered.
    #[inline(always)]
    pub fn cut(
        &mut self,
        [x, y]: [&[f64; LEAF]; 2],
        track: &Track,
        index: u32,
        lanes: &mut Lanes,
        height: impl Fn(f64, f64, f64) -> f64,
    ) -> bool {
        let before = lanes.sum;
        for j in 0..LEAF {
            let heights: &mut [f32; LEAF] =
                (&mut self.height[j * LEAF..(j + 1) * LEAF]).try_into().expect("a row of the leaf");
            let by: &mut [u32; LEAF] =
                (&mut self.by[j * LEAF..(j + 1) * LEAF]).try_into().expect("a row of the leaf");
            for i in 0..LEAF {
                let (along, across) = track.along_across(x[i], y[j]);
                let now = f64::from(heights[i]);
                // Compared as it is stored: what each move removes then adds up without remainder.
                let stored = f64::from(height(along, across, now) as f32);
                let lower = stored < now;
                let drop = if lower { now - stored } else { 0.0 };
                let engaged = drop > ENGAGED;
                let axial = if engaged { now - tip_abeam(track, along) } else { 0.0 };
                lanes.sum[i] += drop;
                lanes.depth[i] = larger(lanes.depth[i], drop);
                lanes.axial[i] = larger(lanes.axial[i], axial);
                let (low, high) = (lanes.along_low[i], lanes.along_high[i]);
                lanes.along_low[i] = if engaged { smaller(low, along) } else { low };
                lanes.along_high[i] = if engaged { larger(high, along) } else { high };
                let (low, high) = (lanes.across_low[i], lanes.across_high[i]);
                lanes.across_low[i] = if engaged { smaller(low, across) } else { low };
                lanes.across_high[i] = if engaged { larger(high, across) } else { high };
                heights[i] = if lower { stored as f32 } else { heights[i] };
                by[i] = if lower { index } else { by[i] };
            }
        }
        before != lanes.sum
    }
}
