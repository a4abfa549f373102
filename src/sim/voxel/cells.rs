//! The cells of a brick: the cubes between eight samples, of which the least stands in the brick.

use super::bricks::{BRICK, Bricks, Placed, SAMPLES, slot_of};
use crate::NOT_CUT;

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

    /// Samples of the brick inside the material.
    pub(super) fn inside(&self) -> usize {
        (0..SAMPLES).filter(|&cell| self.is_inside(cell)).count()
    }

    /// Whether the least corner of a cell lies inside the material.
    pub(super) fn is_inside(&self, cell: usize) -> bool {
        self.distances[cell % 8 + WIDE * (cell / 8 % 8 + WIDE * (cell / 64))] < 0
    }
}

impl Corners {
    /// Share of the cell that lies inside the material, by linear interpolation on six tetrahedra.
    pub(super) fn share(&self) -> f64 {
        /// Corners on the way from corner 0 to corner 7, one axis after the other.
        const WAYS: [[usize; 2]; 6] = [[1, 3], [1, 5], [2, 3], [2, 6], [4, 5], [4, 6]];
        let d = &self.distances;
        WAYS.iter().map(|&[a, b]| negative_share([d[0], d[a], d[b], d[7]])).sum::<f64>() / 6.0
    }
}

/// Share of a tetrahedron where the linear function with these values at its corners is negative.
fn negative_share(mut values: [f64; 4]) -> f64 {
    values.sort_by(f64::total_cmp);
    // How far from one corner to the other the sign changes.
    let cross = |i: usize, j: usize| values[i] / (values[i] - values[j]);
    match values.iter().filter(|v| **v < 0.0).count() {
        0 => 0.0,
        1 => cross(0, 1) * cross(0, 2) * cross(0, 3),
        2 => {
            let [a, b, c, d] = [cross(0, 2), cross(0, 3), cross(1, 2), cross(1, 3)];
            a * b + a * d * (1.0 - b) + c * d * (1.0 - a)
        }
        3 => 1.0 - cross(3, 0) * cross(3, 1) * cross(3, 2),
        _ => 1.0,
    }
}

/// The cells of a brick in which the surface passes.
pub(super) fn crossed(cells: &Cells) -> impl Iterator<Item = (usize, Corners)> {
    (0..SAMPLES).filter_map(|cell| cells.crossed(cell).map(|corners| (cell, corners)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_a_tetrahedron() {
        // By Σ Πⱼ fᵢ/(fᵢ − fⱼ) over the negative corners, which holds for distinct values.
        let by_sum = |f: [f64; 4]| -> f64 {
            let term = |i: usize| (0..4).filter(|&j| j != i).map(|j| f[i] / (f[i] - f[j])).product::<f64>();
            (0..4).filter(|&i| f[i] < 0.0).map(term).sum()
        };
        for f in
            [[-1.0, 2.0, 3.0, 5.0], [-1.0, -2.5, 3.0, 0.5], [4.0, -1.0, -2.0, -7.0], [1.0, 2.0, 3.0, 4.0]]
        {
            assert!((negative_share(f) - by_sum(f)).abs() < 1e-14, "{f:?}");
        }
        assert_eq!(negative_share([-1.0; 4]), 1.0);
        assert_eq!(negative_share([-1.0, -1.0, 1.0, 1.0]), 0.5);
    }
}
