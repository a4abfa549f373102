//! The lowest level: 8 × 8 cells cut by one move, and what the move removed there. mm.

use super::{ENGAGED, MoveRemoval};
use crate::sim::track::{Track, larger, smaller};
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

/// Steepest track of which [`gentle_ball_heights`] are taken. The error grows with the slope: 1e-12 mm
/// at this one for a ball of 10 mm, and hundreds of times the tolerance on the steepest tracks there are.
pub(super) const GENTLE: f64 = 100.0;

/// In [`Leaf::by`]: no move cut the cell.
pub(super) const UNTOUCHED: f64 = -1.0;

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

    /// Lowers each cell to `height(along, across, height now)` (infinite where the move does not pass)
    /// where that is less once it is stored, and adds to `lanes`. True when a cell was lowered.
    #[inline(always)]
    pub fn cut<S: Simd>(
        &mut self,
        simd: S,
        [x, y]: [&[f64; LEAF]; 2],
        track: &Track,
        index: u32,
        lanes: &mut Lanes,
        height: impl Fn(S, S::f64s, S::f64s, S::f64s) -> S::f64s,
    ) -> bool {
        let rank = simd.splat_f64s(f64::from(index));
        let (ux, uy) = (simd.splat_f64s(track.ux), simd.splat_f64s(track.uy));
        let (zero, engaged_drop) = (simd.splat_f64s(0.0), simd.splat_f64s(ENGAGED));
        let (none, beyond) = (simd.splat_f64s(f64::INFINITY), simd.splat_f64s(f64::NEG_INFINITY));
        let mut most = zero;
        for v in 0..LEAF / S::F64_LANES {
            let dx = simd.sub_f64s(S::as_simd_f64s(x).0[v], simd.splat_f64s(track.x));
            let (dx_ux, dx_uy) = (simd.mul_f64s(dx, ux), simd.mul_f64s(dx, uy));
            let (mut sum, mut depth, mut axial) = (zero, zero, zero);
            let (mut along_low, mut along_high) = (none, beyond);
            let (mut across_low, mut across_high) = (none, beyond);
            for j in 0..LEAF {
                let dy = simd.splat_f64s(y[j] - track.y);
                let along = simd.add_f64s(dx_ux, simd.mul_f64s(dy, uy));
                let across = simd.sub_f64s(simd.mul_f64s(dy, ux), dx_uy);
                let now = &mut S::as_mut_simd_f64s(&mut self.height[j]).0[v];
                let by = &mut S::as_mut_simd_f64s(&mut self.by[j]).0[v];
                let before = *now;
                // Compared as it is stored: what each move removes then adds up without remainder.
                let stored = to_single(simd, height(simd, along, across, before));
                let lower = simd.less_than_f64s(stored, before);
                *now = simd.select_f64s(lower, stored, before);
                *by = simd.select_f64s(lower, rank, *by);
                let drop = simd.select_f64s(lower, simd.sub_f64s(before, stored), zero);
                sum = simd.add_f64s(sum, drop);
                depth = simd.max_f64s(depth, drop);
                let engaged = simd.less_than_f64s(engaged_drop, drop);
                let above = simd.sub_f64s(before, tip_abeam(simd, track, along));
                axial = simd.max_f64s(axial, simd.select_f64s(engaged, above, zero));
                along_low = simd.min_f64s(along_low, simd.select_f64s(engaged, along, none));
                along_high = simd.max_f64s(along_high, simd.select_f64s(engaged, along, beyond));
                across_low = simd.min_f64s(across_low, simd.select_f64s(engaged, across, none));
                across_high = simd.max_f64s(across_high, simd.select_f64s(engaged, across, beyond));
            }
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
    tip(simd, track, sigma)
}

#[inline(always)]
fn tip<S: Simd>(simd: S, track: &Track, sigma: S::f64s) -> S::f64s {
    simd.add_f64s(simd.splat_f64s(track.z), simd.mul_f64s(simd.splat_f64s(track.slope), sigma))
}

/// [`swept::ball_height`](crate::sim::swept::ball_height) on a vector of places, operation by
/// operation.
#[inline(always)]
pub(super) fn ball_heights<S: Simd>(
    simd: S,
    track: &Track,
    radius: f64,
    along: S::f64s,
    across: S::f64s,
) -> S::f64s {
    let (zero, length) = (simd.splat_f64s(0.0), simd.splat_f64s(track.length));
    let r = simd.splat_f64s(radius);
    let chord_square = simd.mul_f64s(simd.sub_f64s(r, across), simd.add_f64s(r, across));
    let half_chord = simd.sqrt_f64s(simd.max_f64s(chord_square, zero));
    let free = simd.sub_f64s(along, simd.mul_f64s(half_chord, simd.splat_f64s(track.sin())));
    let sigma = simd.min_f64s(simd.max_f64s(free, zero), length);
    let ahead = simd.sub_f64s(along, sigma);
    let on_track = simd.and_m64s(simd.less_than_f64s(zero, free), simd.less_than_f64s(free, length));
    let end_square = simd.mul_f64s(simd.sub_f64s(half_chord, ahead), simd.add_f64s(half_chord, ahead));
    let at_end = simd.sqrt_f64s(simd.max_f64s(end_square, zero));
    let on_side = simd.mul_f64s(half_chord, simd.splat_f64s(track.cos));
    let depth = simd.select_f64s(on_track, on_side, at_end);
    let height = simd.add_f64s(tip(simd, track, sigma), simd.sub_f64s(r, depth));
    let near = simd.less_than_or_equal_f64s(simd.abs_f64s(ahead), half_chord);
    let inside =
        simd.and_m64s(simd.less_than_or_equal_f64s(zero, chord_square), simd.or_m64s(on_track, near));
    simd.select_f64s(inside, height, simd.splat_f64s(f64::INFINITY))
}

/// As [`ball_heights`] for tracks up to [`GENTLE`], with one square root. With q the half chord and
/// m = tan φ the slope, the ball cuts at s − q sin φ, so that the cut lies at z + m·s + r − q/cos φ;
/// beyond the ends at z + m·σ + r − √(q² − (s − σ)²). Which of the three holds is seen from squares.
#[inline(always)]
pub(super) fn gentle_ball_heights<S: Simd>(
    simd: S,
    track: &Track,
    radius: f64,
    along: S::f64s,
    across: S::f64s,
) -> S::f64s {
    let (zero, length) = (simd.splat_f64s(0.0), simd.splat_f64s(track.length));
    let r = simd.splat_f64s(radius);
    let chord_square = simd.mul_f64s(simd.sub_f64s(r, across), simd.add_f64s(r, across));
    let climb_square = simd.mul_f64s(chord_square, simd.splat_f64s(track.sin() * track.sin()));
    let past_start = simd.and_m64s(
        simd.less_than_f64s(zero, along),
        simd.less_than_f64s(climb_square, simd.mul_f64s(along, along)),
    );
    let beyond = simd.sub_f64s(along, length);
    let before_end = simd.or_m64s(
        simd.less_than_f64s(beyond, zero),
        simd.less_than_f64s(simd.mul_f64s(beyond, beyond), climb_square),
    );
    let on_track = simd.and_m64s(past_start, before_end);
    let end = simd.select_f64s(past_start, length, zero);
    let ahead = simd.sub_f64s(along, end);
    let at_end = simd.sub_f64s(chord_square, simd.mul_f64s(ahead, ahead));
    let on_side = simd.mul_f64s(chord_square, simd.splat_f64s(1.0 / (track.cos * track.cos)));
    let square = simd.select_f64s(on_track, on_side, at_end);
    let place = simd.select_f64s(on_track, along, end);
    let depth = simd.sqrt_f64s(simd.max_f64s(square, zero));
    let height = simd.add_f64s(tip(simd, track, place), simd.sub_f64s(r, depth));
    let inside = simd.and_m64s(
        simd.less_than_or_equal_f64s(zero, chord_square),
        simd.less_than_or_equal_f64s(zero, square),
    );
    simd.select_f64s(inside, height, simd.splat_f64s(f64::INFINITY))
}

/// [`swept::flat_height`](crate::sim::swept::flat_height) on a vector of places, operation by
/// operation.
#[inline(always)]
pub(super) fn flat_heights<S: Simd>(
    simd: S,
    track: &Track,
    radius: f64,
    along: S::f64s,
    across: S::f64s,
) -> S::f64s {
    let (zero, r) = (simd.splat_f64s(0.0), simd.splat_f64s(radius));
    let chord_square = simd.mul_f64s(simd.sub_f64s(r, across), simd.add_f64s(r, across));
    let half_chord = simd.sqrt_f64s(simd.max_f64s(chord_square, zero));
    let sigma = simd.max_f64s(simd.sub_f64s(along, half_chord), zero);
    let in_length = simd.and_m64s(
        simd.less_than_or_equal_f64s(sigma, simd.splat_f64s(track.length)),
        simd.less_than_or_equal_f64s(zero, simd.add_f64s(along, half_chord)),
    );
    let inside = simd.and_m64s(simd.less_than_or_equal_f64s(zero, chord_square), in_length);
    simd.select_f64s(inside, tip(simd, track, sigma), simd.splat_f64s(f64::INFINITY))
}

/// Any height, one place after the other.
#[inline(always)]
pub(super) fn each<S: Simd>(
    along: S::f64s,
    across: S::f64s,
    now: S::f64s,
    height: impl Fn(f64, f64, f64) -> f64,
) -> S::f64s {
    let (along, across, mut now) = ([along], [across], [now]);
    let (along, across): (&[f64], &[f64]) =
        (pulp::bytemuck::cast_slice(&along), pulp::bytemuck::cast_slice(&across));
    let heights: &mut [f64] = pulp::bytemuck::cast_slice_mut(&mut now);
    for i in 0..heights.len() {
        heights[i] = height(along[i], across[i], heights[i]);
    }
    now[0]
}
