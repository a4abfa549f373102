//! Drops at all points of a regular grid, many at a time.
//!
//! Enters: a grid in the plan view, mm. Leaves: at each point the height of the tip and the triangle
//! that carries the cutter, the same as [`DropCutter::at`] gives but for rounding in the last digits.
//! The grid is worked through in square tiles: one walk down the tree for each, which visits the
//! triangles whose domain ([`super::domain`]) meets the tile and looks only at the points inside
//! that domain. Each tile is worked out by itself, so the number of threads changes no bit.

use super::{Cull, DropCutter};
use geometry::{BoxTree, Extent, Feature};
use work::lanes;

/// Points of a grid in the plan view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanGrid {
    first: [f64; 2],
    step: [f64; 2],
    counts: [usize; 2],
}

impl PlanGrid {
    /// The grid of `counts[0] × counts[1]` points from `first` on, `step > 0` apart along x and y,
    /// mm; `None` if a number is not finite, a step not positive, or the points cannot be counted.
    pub fn new(first: [f64; 2], step: [f64; 2], counts: [usize; 2]) -> Option<Self> {
        let last = |k: usize| first[k] + step[k] * counts[k] as f64;
        let valid = (0..2).all(|k| first[k].is_finite() && step[k] > 0.0 && last(k).is_finite());
        (valid && counts[0].checked_mul(counts[1]).is_some()).then_some(Self { first, step, counts })
    }

    /// Number of points along x and y.
    pub fn counts(&self) -> [usize; 2] {
        self.counts
    }

    /// Point `i` along x and `j` along y, mm.
    pub fn point(&self, i: usize, j: usize) -> [f64; 2] {
        [self.along(0, i), self.along(1, j)]
    }

    fn along(&self, axis: usize, k: usize) -> f64 {
        self.first[axis] + self.step[axis] * k as f64
    }
}

/// Where the tip rests at one point of a grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridDrop {
    /// Height of the tip, mm; minus infinity where the cutter does not reach the part.
    pub tip_z: f64,
    /// The triangle that carries the cutter, one of several at its sides and corners;
    /// `u32::MAX` where there is none.
    pub triangle: u32,
}

impl GridDrop {
    const NOTHING: Self = Self { tip_z: f64::NEG_INFINITY, triangle: u32::MAX };
}

/// Points along the side of a tile. More visits more triangles a tile that matter to few of its
/// points, fewer walks down the tree more often.
const TILE: usize = 16;

/// A tile which so many triangles lie below, on the mean of the mesh, is dropped point by point. More
/// visits triangles between the points of a wide grid in vain.
const MOST_BELOW: f64 = 1024.0;

/// Slots whose sides wait until as many faces have been looked at. More raises the floor of the walk
/// later, fewer looks at sides which a face would have made superfluous.
const WAITING: usize = 64;

impl DropCutter<'_> {
    /// The drops at all points of a grid, in rows along x: that of point `(i, j)` at
    /// `i + j · counts[0]`.
    ///
    /// # Tolerance
    /// Heights are those of [`DropCutter::at`] to 1e-9 mm.
    pub fn over_grid(&self, grid: &PlanGrid) -> Vec<GridDrop> {
        let [nx, ny] = grid.counts;
        let mut drops = vec![GridDrop::NOTHING; nx * ny];
        match &self.cull {
            Cull::Domains { tree, parts } if self.below_tile(grid) <= MOST_BELOW => {
                work::parallel::for_each_chunk(&mut drops, TILE * nx, |band, rows| {
                    for i in (0..nx).step_by(TILE) {
                        let mut tile = Tile::new(grid, [i, TILE * band]);
                        tile.drop_onto(self, tree, parts);
                        for (j, row) in rows.chunks_mut(nx).enumerate() {
                            for (drop, k) in row[i..].iter_mut().zip(0..TILE) {
                                let (tip_z, slot) = (tile.tips[j][k], tile.slots[j][k]);
                                if tip_z > f64::NEG_INFINITY {
                                    let triangle = self.bvh.triangle_in(slot as usize) as u32;
                                    *drop = GridDrop { tip_z, triangle };
                                }
                            }
                        }
                    }
                });
            }
            _ => work::parallel::for_each_chunk(&mut drops, nx, |j, row| {
                for (i, drop) in row.iter_mut().enumerate() {
                    let [x, y] = grid.point(i, j);
                    if let Some(found) = self.at(x, y) {
                        *drop = GridDrop { tip_z: found.tip_z, triangle: found.contact.triangle };
                    }
                }
            }),
        }
        drops
    }

    /// How many triangles lie below a tile, on the mean of the mesh.
    fn below_tile(&self, grid: &PlanGrid) -> f64 {
        let b = self.mesh.bounds();
        let area = (b.max.x - b.min.x) * (b.max.y - b.min.y);
        let tile = (TILE * TILE) as f64 * grid.step[0] * grid.step[1];
        self.facets.len() as f64 * (tile / area).min(1.0)
    }
}

/// The parts of the triangles on which the cutter can rest, by slot.
#[derive(Debug, Clone)]
pub(super) struct Parts {
    /// Where those of each slot begin, and the end.
    starts: Vec<u32>,
    parts: Vec<Part>,
}

/// A part of a facet, and a box around the places of the axis while the cutter rests on it.
#[derive(Debug, Clone, Copy)]
struct Part {
    min: [f32; 2],
    max: [f32; 2],
    part: Feature,
    /// Of a side, the slot of the triangle across it; of others, and at a border, their own.
    across: u32,
}

impl Parts {
    /// Of the parts of each slot, with the slot across each of them.
    pub(super) fn new<I: Iterator<Item = (Feature, Extent, u32)>>(
        slots: usize,
        of: impl Fn(usize) -> I,
    ) -> Self {
        let mut parts = Self { starts: vec![0], parts: Vec::with_capacity(3 * slots) };
        for slot in 0..slots {
            parts.parts.extend(of(slot).map(|(part, extent, across)| {
                let [min, max] = extent.plan();
                Part { min, max, part, across }
            }));
            parts.starts.push(parts.parts.len() as u32);
        }
        parts
    }

    fn of(&self, slot: usize) -> &[Part] {
        &self.parts[self.starts[slot] as usize..self.starts[slot + 1] as usize]
    }
}

/// A square of grid points with the best drops found so far.
struct Tile {
    x: [f64; TILE],
    y: [f64; TILE],
    low: [f64; 2],
    high: [f64; 2],
    /// Steps in 1 mm.
    per_mm: [f64; 2],
    /// By rows along x. Infinite at points beyond the grid, which so stay as they are.
    tips: [[f64; TILE]; TILE],
    slots: [[u32; TILE]; TILE],
}

impl Tile {
    fn new(grid: &PlanGrid, first: [usize; 2]) -> Self {
        let along = |axis: usize| std::array::from_fn(|k| grid.along(axis, first[axis] + k));
        let (x, y): ([f64; TILE], [f64; TILE]) = (along(0), along(1));
        let count = [0, 1].map(|axis| (grid.counts[axis] - first[axis]).min(TILE));
        let inside = |i: usize, j: usize| i < count[0] && j < count[1];
        let tip = |i, j| if inside(i, j) { f64::NEG_INFINITY } else { f64::INFINITY };
        Self {
            x,
            y,
            low: [x[0], y[0]],
            high: [x[count[0] - 1], y[count[1] - 1]],
            per_mm: grid.step.map(|s| 1.0 / s),
            tips: std::array::from_fn(|j| std::array::from_fn(|i| tip(i, j))),
            slots: [[0; TILE]; TILE],
        }
    }

    /// Faces first: on most ground they carry most, and what they carry needs no look at the sides.
    fn drop_onto(&mut self, drops: &DropCutter, tree: &BoxTree, parts: &Parts) {
        let (low, high) = (self.low, self.high);
        let mut waiting = [0u32; WAITING];
        let mut len = 0;
        tree.search(
            f64::NEG_INFINITY,
            |_, node, _| if node.meets(low, high) { node.top() } else { f64::NEG_INFINITY },
            |slot, floor| {
                let mut raised = false;
                for part in parts.of(slot) {
                    if part.part == Feature::Face {
                        raised |= self.rest_on_face(drops, part, slot);
                    } else if self.reached(part).is_some() {
                        // One entry serves all sides and corners of a slot.
                        waiting[len] = slot as u32;
                        len += 1;
                        break;
                    }
                }
                if len == WAITING {
                    for &slot in &waiting {
                        raised |= self.rest_on_sides(drops, parts, slot as usize);
                    }
                    len = 0;
                }
                if raised { self.floor() } else { floor }
            },
        );
        for &slot in &waiting[..len] {
            self.rest_on_sides(drops, parts, slot as usize);
        }
    }

    /// Columns and rows of points that may lie in the part's box.
    fn reached(&self, part: &Part) -> Option<[std::ops::Range<usize>; 2]> {
        let ranges = [0, 1].map(|axis| {
            let place = |x: f32| (f64::from(x) - self.low[axis]) * self.per_mm[axis];
            // Rounded away from the box; negative numbers become 0.
            place(part.min[axis]) as usize..(place(part.max[axis]) + 1.0).min(TILE as f64) as usize
        });
        ranges.iter().all(|r| !r.is_empty()).then_some(ranges)
    }

    /// Drops the cutter on a face; tells whether that raised it.
    fn rest_on_face(&mut self, drops: &DropCutter, part: &Part, slot: usize) -> bool {
        let Some([_, rows]) = self.reached(part) else {
            return false;
        };
        let (facet, x) = (&drops.facets[slot], &self.x);
        lanes::dispatch(
            #[inline(always)]
            || {
                let mut raised = false;
                for j in rows {
                    let (tips, slots) = (&mut self.tips[j], &mut self.slots[j]);
                    raised |= facet.raise_by_face(x, self.y[j], slot as u32, tips, slots);
                }
                raised
            },
        )
    }

    /// Drops the cutter on sides and corners; tells whether that raised it.
    fn rest_on_sides(&mut self, drops: &DropCutter, parts: &Parts, slot: usize) -> bool {
        let mut raised = false;
        let facet = &drops.facets[slot];
        for part in parts.of(slot).iter().filter(|p| p.part != Feature::Face) {
            let Some([columns, rows]) = self.reached(part) else {
                continue;
            };
            let across = &drops.facets[part.across as usize];
            let mut higher = [[false; TILE]; TILE];
            lanes::dispatch(
                #[inline(always)]
                || {
                    for j in rows.clone() {
                        // A side lies in both planes, so it lifts the tip no higher than either.
                        let (y, tips) = (self.y[j], &self.tips[j]);
                        let (own, other) = (facet.peaks(&self.x, y), across.peaks(&self.x, y));
                        for i in 0..TILE {
                            higher[j][i] = (own[i] > tips[i]) & (other[i] > tips[i]);
                        }
                    }
                },
            );
            for j in rows {
                for i in columns.clone().filter(|&i| higher[j][i]) {
                    let tip = &mut self.tips[j][i];
                    if let Some(tip_z) =
                        facet.touch_part(part.part, &drops.search, self.x[i], self.y[j], *tip)
                    {
                        (*tip, self.slots[j][i]) = (tip_z, slot as u32);
                        raised = true;
                    }
                }
            }
        }
        raised
    }

    /// The lowest tip so far.
    fn floor(&self) -> f64 {
        let mut least = [f64::INFINITY; TILE];
        for row in &self.tips {
            for (least, tip) in least.iter_mut().zip(row) {
                *least = if *tip < *least { *tip } else { *least };
            }
        }
        least.into_iter().fold(f64::INFINITY, f64::min)
    }
}
