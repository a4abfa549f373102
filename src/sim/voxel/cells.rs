//! The cells of a brick: the cubes between eight samples, of which the least stands in the brick.

use super::bricks::{BRICK, Bricks, Placed, SAMPLES, slot_of};
use crate::NOT_CUT;
use geometry::Vector3;

/// Samples along the side of a brick and its upper neighbours' first layer.
const WIDE: usize = BRICK as usize + 1;

/// The samples of a brick and of the layer above it on each axis.
pub(super) struct Cells {
    distances: [i16; WIDE * WIDE * WIDE],
    cut_by: [u32; WIDE * WIDE * WIDE],
    known: [bool; 8],
}

/// The corners of a cell in which the surface passes; corner `k` lies higher along axis `i` where bit `i` of
/// `k` is set.
pub(super) struct Corners {
    pub(super) distances: [f64; 8],
    pub(super) cut_by: [u32; 8],
}

impl Cells {
    pub(super) fn of(bricks: &Bricks, placed: &Placed<'_>) -> Self {
        let near: [_; 8] = std::array::from_fn(|k| {
            if k == 0 {
                return Some(placed.brick);
            }
            let step = |i: usize| if k >> i & 1 == 1 { BRICK } else { 0 };
            bricks.holding(std::array::from_fn(|i| placed.low[i] + step(i))).map(|p| p.brick)
        });
        let mut cells = Self {
            distances: [0; WIDE * WIDE * WIDE],
            cut_by: [NOT_CUT; WIDE * WIDE * WIDE],
            known: near.map(|brick| brick.is_some()),
        };
        for at in 0..WIDE * WIDE * WIDE {
            let [x, y, z] = [at % WIDE, at / WIDE % WIDE, at / WIDE / WIDE];
            let which = x / 8 + 2 * (y / 8) + 4 * (z / 8);
            if let Some(brick) = near[which] {
                let sample = slot_of([x as u32, y as u32, z as u32]);
                cells.distances[at] = brick.distances[sample];
                cells.cut_by[at] = brick.cut_by(sample);
            }
        }
        cells
    }

    /// The corners of cell `x + 8 (y + 8 z)` if the surface passes in it.
    pub(super) fn crossed(&self, cell: usize) -> Option<Corners> {
        let at = [cell % 8, cell / 8 % 8, cell / 64];
        let corner = |k: usize| [0, 1, 2].map(|i| at[i] + (k >> i & 1));
        let slots: [usize; 8] = std::array::from_fn(|k| {
            let [x, y, z] = corner(k);
            x + WIDE * (y + WIDE * z)
        });
        let inside = slots.map(|s| self.distances[s] < 0);
        if inside == [inside[0]; 8] {
            return None;
        }
        // Bricks are kept so that this never fails where the surface passes.
        let known = (0..8).all(|k| {
            let [x, y, z] = corner(k);
            self.known[x / 8 + 2 * (y / 8) + 4 * (z / 8)]
        });
        known.then(|| Corners {
            distances: slots.map(|s| f64::from(self.distances[s])),
            cut_by: slots.map(|s| self.cut_by[s]),
        })
    }
}

impl Corners {
    /// Which of them are inside the material: bit `k` is that of corner `k`.
    pub(super) fn shape(&self) -> u8 {
        self.distances.iter().enumerate().map(|(k, d)| u8::from(*d < 0.0) << k).sum()
    }

    /// The middle between the two places where the surface crosses the edges from a corner inside along a
    /// face square to `axis`, from the least corner, in cells. It stays off the corners.
    pub(super) fn beside(&self, corner: usize, axis: usize) -> Vector3 {
        let mut place = Vector3::from_fn(|i, _| (corner >> i & 1) as f64);
        for along in (0..3).filter(|i| *i != axis) {
            let (inside, outside) = (self.distances[corner], self.distances[corner ^ 1 << along]);
            let share = (inside / (inside - outside)).clamp(0.05, 0.95);
            place[along] += 0.5 * share * (1.0 - 2.0 * place[along]);
        }
        place
    }
}

/// The cells of a brick in which the surface passes.
pub(super) fn crossed(cells: &Cells) -> impl Iterator<Item = (usize, Corners)> {
    (0..SAMPLES).filter_map(|cell| cells.crossed(cell).map(|corners| (cell, corners)))
}
