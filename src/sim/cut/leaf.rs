//! The cells of a leaf: the lowest of the moves left there, in closed form.
//!
//! Enters: what a square chose from the moves of its level. Leaves: heights and names of moves in the tile.

use super::choose::{Square, ones};
use super::local::Chunk;
use super::{Level, Worker};
use crate::NOT_CUT;
use crate::sweep::Sweep;
use crate::swept::swept_height;
use crate::track::Track;
use work::lanes::{self, LANES, Real, bits};

impl<T: Real, S: Sweep<T>> Worker<'_, '_, T, S> {
    /// Cuts the cells of a leaf of `N` × `N` = `CELLS` cells with all moves of a level.
    pub(super) fn leaf<const N: usize, const CELLS: usize>(
        &mut self,
        cells: &[[T; CELLS]; 2],
        chosen: [usize; 2],
        at: [usize; 2],
        size: [usize; 2],
    ) {
        lanes::dispatch(
            #[inline(always)]
            || self.leaf_in_lanes::<N, CELLS>(cells, chosen, at, size),
        );
    }

    #[inline(always)]
    fn leaf_in_lanes<const N: usize, const CELLS: usize>(
        &mut self,
        [x, y]: &[[T; CELLS]; 2],
        [level, q]: [usize; 2],
        [i, j]: [usize; 2],
        [nx, ny]: [usize; 2],
    ) {
        let infinite = T::of(f64::INFINITY);
        // A copy: numbers that loops read through a reference keep their branches, and so become no vector
        // code.
        let sweep = self.sweep;
        let first = self.square_at([i, j], [1, 1]);
        let diagonal = (x[CELLS - 1] * x[CELLS - 1] + y[CELLS - 1] * y[CELLS - 1]).sqrt();
        // Through arrays of a fixed length: loops over those become vector code. Read long before they are
        // needed: vectors of what was just written in parts have to wait for it.
        let mut stored = [f32::NEG_INFINITY; CELLS];
        let (stored_rows, _) = stored.as_chunks_mut::<N>();
        let rows = self.tile.rows[j..j + ny].iter().zip(stored_rows);
        if nx == N {
            for ((heights, _), stored) in rows {
                copy_row::<N, _>(stored, &heights[i..]);
            }
        } else {
            for ((heights, _), stored) in rows {
                stored[..nx].copy_from_slice(&heights[i..]);
            }
        }
        let mut height = [infinite; CELLS];
        let mut doubt = [infinite; CELLS];
        let mut by = [NOT_CUT; CELLS];
        let mut second_look = false;
        self.work.evaluations += (self.levels[level].kept[q] * nx * ny) as u64;
        let Level { moves, chosen, .. } = &self.levels[level];
        for (chunk, chosen) in moves.chunks().iter().zip(chosen) {
            if chosen[q] == 0 {
                continue;
            }
            let near = Near::of(&sweep, chunk, &first, diagonal);
            second_look |= near.bound_only & chosen[q] != 0;
            for lane in ones(chosen[q]) {
                let (m, index) = (chunk.lane(lane), chunk.name(lane).index());
                // From the first cell of a block to each of its cells.
                let (mut along, mut across) = ([infinite; LANES], [infinite; LANES]);
                for c in 0..LANES {
                    along[c] = x[c] * m.ux + y[c] * m.uy;
                    across[c] = y[c] * m.ux - x[c] * m.uy;
                }
                for block in 0..CELLS / LANES {
                    let up = y[block * LANES];
                    let (a, w) = (near.along[lane] + up * m.uy, near.across[lane] + up * m.ux);
                    let cells = block * LANES..(block + 1) * LANES;
                    let (height, by, doubt) =
                        (&mut height[cells.clone()], &mut by[cells.clone()], &mut doubt[cells]);
                    if near.inner & (1 << lane) != 0 {
                        for c in 0..LANES {
                            let h = sweep.inner_height(&m, a + along[c], w + across[c]);
                            by[c] = if h < height[c] { index } else { by[c] };
                            height[c] = h.smaller(height[c]);
                        }
                    } else {
                        for c in 0..LANES {
                            let (h, d) = sweep.height(&m, a + along[c], w + across[c]);
                            by[c] = if h < height[c] { index } else { by[c] };
                            height[c] = h.smaller(height[c]);
                            doubt[c] = d.smaller(doubt[c]);
                        }
                    }
                }
            }
        }
        for c in 0..CELLS {
            second_look |= (doubt[c] <= height[c]) & (doubt[c] < infinite);
        }
        if second_look {
            self.leaf_again([level, q], [i, j], [nx, ny]);
            return;
        }
        // To new arrays: what is written lane by lane only where it changes is waited for when it is read.
        let (mut lowest, mut lowest_by) = ([0.0; CELLS], [NOT_CUT; CELLS]);
        for c in 0..CELLS {
            let cut = height[c].plus(self.frame.z);
            lowest[c] = cut.smaller(stored[c]);
            lowest_by[c] = if cut < stored[c] { by[c] } else { NOT_CUT };
        }
        let ((stored, _), (by, _)) = (lowest.as_chunks::<N>(), lowest_by.as_chunks::<N>());
        let rows = self.tile.rows[j..j + ny].iter_mut().zip(stored).zip(by);
        if nx == N {
            for (((heights, cut_by), stored), by) in rows {
                copy_row::<N, _>(&mut heights[i..], stored);
                copy_row::<N, _>(&mut cut_by[i..], by);
            }
        } else {
            for (((heights, cut_by), stored), by) in rows {
                heights[i..].copy_from_slice(&stored[..nx]);
                cut_by[i..].copy_from_slice(&by[..nx]);
            }
        }
    }

    /// As [`Self::leaf`], by the closed forms of the reference engine in f64.
    fn leaf_again(&mut self, [level, q]: [usize; 2], [i, j]: [usize; 2], [nx, ny]: [usize; 2]) {
        self.work.second_looks += (nx * ny) as u64;
        let tracks: Vec<(u32, Track)> = self.levels[level]
            .chosen_by(q)
            .map(|(chunk, lane)| chunk.name(lane).index())
            .map(|index| {
                let (from, to) = self.job.ends(index);
                (index, Track::new(from, to))
            })
            .collect();
        for dj in 0..ny {
            for di in 0..nx {
                let p = self.grid.centre(self.tile.i0 + i + di, self.tile.j0 + j + dj);
                let mut lowest = (f64::INFINITY, NOT_CUT);
                for (index, track) in &tracks {
                    let h = swept_height(&self.job.form, track, p.x, p.y);
                    if h < lowest.0 {
                        lowest = (h, *index);
                    }
                }
                let (heights, cut_by) = &mut self.tile.rows[j + dj];
                let h = lowest.0 as f32;
                let lower = h < heights[i + di];
                heights[i + di] = if lower { h } else { heights[i + di] };
                cut_by[i + di] = if lower { lowest.1 } else { NOT_CUT };
            }
        }
    }
}

/// The moves of a chunk, seen from the first cell of a leaf.
struct Near<T> {
    along: [T; LANES],
    across: [T; LANES],
    /// One bit for each move whose rim is far from the leaf, and for each that only bounds.
    inner: u32,
    bound_only: u32,
}

impl<T: Real> Near<T> {
    #[inline(always)]
    fn of<S: Sweep<T>>(sweep: &S, chunk: &Chunk<T>, first: &Square<T>, diagonal: T) -> Self {
        let (mut along, mut across) = ([first.x; LANES], [first.x; LANES]);
        let (mut inner, mut bound_only) = ([false; LANES], [false; LANES]);
        for lane in 0..LANES {
            let m = chunk.lane(lane);
            (along[lane], across[lane]) = m.along_across(first.x, first.y);
            inner[lane] = sweep.surrounds(&m, along[lane], across[lane], diagonal);
            bound_only[lane] = chunk.name(lane).bound_only();
        }
        Self { along, across, inner: bits(&inner), bound_only: bits(&bound_only) }
    }
}

/// The first `N` cells of a row.
#[inline(always)]
fn copy_row<const N: usize, V: Copy>(to: &mut [V], from: &[V]) {
    if let (Some(to), Some(from)) = (to.first_chunk_mut::<N>(), from.first_chunk::<N>()) {
        *to = *from;
    }
}
