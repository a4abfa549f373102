//! The heights of a sweep at the cells of a leaf, in loops that become vector code. mm.

use super::bound::Bound;
use super::leaf::{CELLS, LEAF};
use crate::sweep::Sweep;
use crate::swept::swept_height_at;
use crate::track::Track;
use pulp::Simd;

/// Cells for which the place on the track is looked for at once. Fewer are not worth a vector loop.
const BLOCK: usize = 16;
const BLOCKS: usize = CELLS / BLOCK;

/// Where the cells of a leaf lie along and across a track, row by row.
pub(super) struct Cells {
    pub along: [[f64; LEAF]; LEAF],
    pub across: [[f64; LEAF]; LEAF],
}

impl Cells {
    /// As [`Track::along_across`], operation by operation.
    #[inline(always)]
    pub fn new<S: Simd>(simd: S, [x, y]: [&[f64; LEAF]; 2], track: &Track) -> Self {
        let mut cells = Self { along: [[0.0; LEAF]; LEAF], across: [[0.0; LEAF]; LEAF] };
        let (ux, uy) = (simd.splat_f64s(track.ux), simd.splat_f64s(track.uy));
        for v in 0..LEAF / S::F64_LANES {
            let dx = simd.sub_f64s(S::as_simd_f64s(x).0[v], simd.splat_f64s(track.x));
            let (dx_ux, dx_uy) = (simd.mul_f64s(dx, ux), simd.mul_f64s(dx, uy));
            for j in 0..LEAF {
                let dy = simd.splat_f64s(y[j] - track.y);
                let (dy_ux, dy_uy) = (simd.mul_f64s(dy, ux), simd.mul_f64s(dy, uy));
                S::as_mut_simd_f64s(&mut cells.along[j]).0[v] = simd.add_f64s(dx_ux, dy_uy);
                S::as_mut_simd_f64s(&mut cells.across[j]).0[v] = simd.sub_f64s(dy_ux, dx_uy);
            }
        }
        cells
    }

    /// Heights of the sweep where they lie below `now`; elsewhere any that do not.
    #[inline(always)]
    pub fn heights<W: Sweep<f64>>(&self, bound: &Bound<W>, now: &[f64]) -> [[f64; LEAF]; LEAF] {
        let mut heights = [[f64::INFINITY; LEAF]; LEAF];
        let height = heights.as_flattened_mut();
        if bound.steep {
            self.look_again(bound, now, &[f64::NEG_INFINITY; CELLS], height);
        } else if W::TRIES_END {
            self.try_the_end(bound, now, height);
        } else {
            let (along, across) = (self.along.as_flattened(), self.across.as_flattened());
            let mut doubt = [0.0; CELLS];
            for c in 0..CELLS {
                (height[c], doubt[c]) = bound.sweep.height(&bound.local, along[c], across[c]);
            }
            self.look_again(bound, now, &doubt, height);
        }
        heights
    }

    /// By the closed forms of the reference, where heights are in doubt.
    #[inline(always)]
    fn look_again<W>(&self, bound: &Bound<W>, now: &[f64], doubt: &[f64; CELLS], height: &mut [f64]) {
        let mut again = false;
        for c in 0..CELLS {
            again |= doubt[c] <= now[c];
        }
        if again {
            let (along, across) = (self.along.as_flattened(), self.across.as_flattened());
            for c in (0..CELLS).filter(|&c| doubt[c] <= now[c]) {
                height[c] = swept_height_at(bound.form, bound.track, along[c], across[c]);
            }
        }
    }

    /// First as if the cutter stood where the move ends, which is right for most cells that a short move
    /// cuts; then for those that it may cut from elsewhere.
    #[inline(always)]
    fn try_the_end<W: Sweep<f64>>(&self, bound: &Bound<W>, now: &[f64], height: &mut [f64]) {
        let (m, along, across) = (&bound.local, self.along.as_flattened(), self.across.as_flattened());
        let mut least = [0.0; CELLS];
        for c in 0..CELLS {
            (height[c], least[c]) = bound.sweep.at_end(m, bound.rises, along[c], across[c]);
        }
        let mut open = [0; CELLS];
        for c in 0..CELLS {
            // As it would be stored.
            open[c] = usize::from(f64::from(least[c] as f32) < now[c]);
        }
        if open.iter().fold(0, |any, one| any | one) == 0 {
            return;
        }
        // The open cells, without a branch for each.
        let mut list = [0u8; CELLS + 1];
        let mut count = 0;
        for c in 0..CELLS {
            list[count] = c as u8;
            count += open[c];
        }
        // Behind them stand any others, up to a whole block: their heights are no less true.
        let blocks = count.div_ceil(BLOCK);
        let list = &list.as_chunks::<BLOCK>().0[..blocks];
        let cell = |b: usize, k: usize| usize::from(list[b][k]) % CELLS;

        let none = [[0.0; BLOCK]; BLOCKS];
        let (mut a, mut w) = (none, none);
        for b in 0..blocks {
            for k in 0..BLOCK {
                (a[b][k], w[b][k]) = (along[cell(b, k)], across[cell(b, k)]);
            }
        }
        let (mut h, mut doubt) = (none, none);
        bound.sweep.heights(m, &a[..blocks], &w[..blocks], &mut h[..blocks], &mut doubt[..blocks]);
        let mut doubts = [f64::INFINITY; CELLS];
        for b in 0..blocks {
            for k in 0..BLOCK {
                (height[cell(b, k)], doubts[cell(b, k)]) = (h[b][k], doubt[b][k]);
            }
        }
        self.look_again(bound, now, &doubts, height);
    }
}
