//! A tile of 128 × 128 cells under its moves in the order of the program: sixteen nodes of sixteen
//! leaves of 8 × 8 cells. mm.

use super::bound::{Bound, CHILDREN, Ceiling, Ceilings};
use super::contact::{first_touch, reach};
use super::leaf::{LEAF, Lanes, Leaf, UNTOUCHED};
use super::{ENGAGED, OrderedCut, RapidContact, TileCells, TileRecord};
use crate::form::{Family, Form};
use crate::sweep::{Ball, Flat, Rounded, Sweep};
use crate::track::{Track, larger};
use geometry::Point3;
use motion::MoveKind;
use pulp::Simd;
use work::monitor::{Cancelled, check};

/// Cells along the side of a node.
const NODE: usize = 4 * LEAF;

/// Cells along the side of a tile. A worker's tile takes 262 kB, which a second-level cache holds.
pub(super) const SIDE: usize = 4 * NODE;

/// Moves between two questions whether to go on: a millisecond or so.
const MOVES_A_CHECK: usize = 1024;

/// The cells of a tile in the order of the tree, with the ceilings of its leaves and nodes.
pub(super) struct Tile {
    /// Centres of the columns and rows, also of those beyond the grid.
    x: [[f64; LEAF]; SIDE / LEAF],
    y: [[f64; LEAF]; SIDE / LEAF],
    /// How much of them counts.
    shares: [[[f64; LEAF]; SIDE / LEAF]; 2],
    cell: f64,
    leaves: Vec<[Leaf; CHILDREN]>,
    /// Ceilings of the leaves of each node, and of the nodes.
    nodes: Vec<Ceilings>,
    root: Ceilings,
}

/// Column and row of leaf `l` of node `n`, in leaves.
#[inline(always)]
fn place(n: usize, l: usize) -> (usize, usize) {
    (4 * (n % 4) + l % 4, 4 * (n / 4) + l / 4)
}

impl Tile {
    pub fn load(cells: &TileCells, job: &OrderedCut) -> Self {
        let cell = job.cell;
        let axis = |given: &[f64]| {
            let last = given.len() - 1;
            // Extrapolated beyond the grid, so that bounds about a leaf's middle stay true.
            let beyond = |k: usize| given[last] + (k - last) as f64 * cell;
            let at = |k: usize| given.get(k).copied().unwrap_or_else(|| beyond(k));
            std::array::from_fn(|leaf| std::array::from_fn(|k| at(leaf * LEAF + k)))
        };
        let (x, y) = (axis(&cells.x), axis(&cells.y));
        let shares = |axis: usize, centres: [[f64; LEAF]; SIDE / LEAF]| {
            centres.map(|leaf| leaf.map(|centre| job.share(axis, centre)))
        };
        let mut tile = Self {
            x,
            y,
            shares: [shares(0, x), shares(1, y)],
            cell,
            leaves: vec![std::array::from_fn(|_| Leaf::beyond()); CHILDREN],
            nodes: vec![Ceilings::nothing(); CHILDREN],
            root: Ceilings::nothing(),
        };
        for n in 0..CHILDREN {
            for l in 0..CHILDREN {
                let (column, row) = place(n, l);
                let leaf = &mut tile.leaves[n][l];
                for (j, (heights, _)) in cells.rows.iter().skip(row * LEAF).take(LEAF).enumerate() {
                    for (i, &height) in heights.iter().skip(column * LEAF).take(LEAF).enumerate() {
                        leaf.height[j][i] = f64::from(height);
                    }
                }
                tile.nodes[n].set(l, leaf_ceiling(leaf, cell));
            }
            tile.raise(n);
        }
        tile
    }

    fn store(&self, cells: &mut TileCells) {
        for n in 0..CHILDREN {
            for l in 0..CHILDREN {
                let (column, row) = place(n, l);
                let leaf = &self.leaves[n][l];
                for (j, (heights, cut_by)) in cells.rows.iter_mut().skip(row * LEAF).take(LEAF).enumerate() {
                    for i in 0..heights.len().saturating_sub(column * LEAF).min(LEAF) {
                        if leaf.by[j][i] != UNTOUCHED {
                            heights[column * LEAF + i] = leaf.height[j][i] as f32;
                            cut_by[column * LEAF + i] = leaf.by[j][i] as u32;
                        }
                    }
                }
            }
        }
    }

    /// Runs through `moves` and writes the cells back.
    pub fn cut(
        mut self,
        job: &OrderedCut,
        cells: &mut TileCells,
        moves: &[u32],
    ) -> Result<TileRecord, Cancelled> {
        let arch = pulp::Arch::new();
        let (form, tile) = (&job.form, &mut self);
        let found = match form.family {
            Family::Ball => arch.dispatch(Run { tile, sweep: Ball::new(form.radius, 0.0), job, moves }),
            Family::Flat => arch.dispatch(Run { tile, sweep: Flat::new(form.radius, 0.0), job, moves }),
            Family::Rounded if form.has_cones() => {
                arch.dispatch(Run { tile, sweep: Rounded::<_, true>::new(form, 0.0), job, moves })
            }
            Family::Rounded => {
                arch.dispatch(Run { tile, sweep: Rounded::<_, false>::new(form, 0.0), job, moves })
            }
        }?;
        self.store(cells);
        Ok(found)
    }

    #[inline(always)]
    fn cut_all<S: Simd, W: Sweep<f64>>(
        &mut self,
        simd: S,
        sweep: W,
        job: &OrderedCut,
        moves: &[u32],
    ) -> Result<TileRecord, Cancelled> {
        let mut found = TileRecord::default();
        for run in moves.chunks(MOVES_A_CHECK) {
            check(job.monitor)?;
            for &index in run {
                let k = index as usize;
                let (from, to) = (job.path.start_of(k), job.path.moves[k].to.tip);
                let track = Track::new(from, to);
                let rises = !Track::falls(from, to);
                let bound = Bound::new(sweep, &job.form, &track, rises, k == 0);
                let mut rapid = (job.path.moves[k].kind == MoveKind::Rapid).then_some(Watch {
                    form: &job.form,
                    index,
                    ends: [from, to],
                    first: None,
                });
                let mut lanes = Lanes::new();
                self.cut_one(simd, &bound, index, &mut lanes, &mut rapid);
                let tally = lanes.tally();
                if tally.sum > 0.0 {
                    found.tallies.push((index, tally));
                }
                found.contacts.extend(rapid.and_then(|watch| watch.first));
            }
        }
        Ok(found)
    }

    #[inline(always)]
    fn cut_one<S: Simd, W: Sweep<f64>>(
        &mut self,
        simd: S,
        bound: &Bound<W>,
        index: u32,
        lanes: &mut Lanes,
        rapid: &mut Option<Watch>,
    ) {
        let (node, leaf) = (NODE as f64 * self.cell, LEAF as f64 * self.cell);
        let cell = self.cell;
        let middle = |corner: f64, side: usize| corner + 0.5 * (side - 1) as f64 * cell;
        let half = |side: usize| 0.5 * (side - 1) as f64 * cell;
        let (x, y) = (middle(self.x[0][0], NODE), middle(self.y[0][0], NODE));
        for n in open(&bound.gaps([x, y], node, half(NODE), &self.root)) {
            let (column, row) = place(n, 0);
            let (x, y) = (middle(self.x[column][0], LEAF), middle(self.y[row][0], LEAF));
            let mut changed = false;
            for l in open(&bound.gaps([x, y], leaf, half(LEAF), &self.nodes[n])) {
                changed |= self.cut_leaf(simd, bound, n, l, index, lanes, rapid);
            }
            if changed {
                self.raise(n);
            }
        }
    }

    #[inline(always)]
    fn cut_leaf<S: Simd, W: Sweep<f64>>(
        &mut self,
        simd: S,
        bound: &Bound<W>,
        n: usize,
        l: usize,
        index: u32,
        lanes: &mut Lanes,
        rapid: &mut Option<Watch>,
    ) -> bool {
        let (column, row) = place(n, l);
        let (x, y) = (&self.x[column], &self.y[row]);
        let leaf = &mut self.leaves[n][l];
        if let Some(watch) = rapid {
            watch.look(leaf, x, y);
        }
        let shares = [&self.shares[0][column], &self.shares[1][row]];
        let changed = leaf.cut(simd, bound, [x, y], shares, index, lanes);
        if changed {
            self.nodes[n].set(l, leaf_ceiling(leaf, self.cell));
        }
        changed
    }

    /// Takes the ceiling of node `n` from those of its leaves.
    #[inline(always)]
    fn raise(&mut self, n: usize) {
        let half = 0.5 * (LEAF - 1) as f64 * self.cell;
        let ceiling = self.nodes[n].ceiling(LEAF as f64 * self.cell, half);
        self.root.set(n, ceiling);
    }
}

/// All moves of a tile, compiled for the vectors that the machine has; without fused operations, so
/// that every machine gives the same bits. (Of a closure the call in between is not inlined, and its
/// code stays that of the plainest machine.)
struct Run<'a, 'b, W> {
    sweep: W,
    tile: &'a mut Tile,
    job: &'a OrderedCut<'b>,
    moves: &'a [u32],
}

impl<W: Sweep<f64>> pulp::WithSimd for Run<'_, '_, W> {
    type Output = Result<TileRecord, Cancelled>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        self.tile.cut_all(simd, self.sweep, self.job, self.moves)
    }
}

/// The children that a move may cut, in order.
#[inline(always)]
fn open(gaps: &[f64; CHILDREN]) -> impl Iterator<Item = usize> + use<> {
    let mut mask = 0u32;
    for k in 0..CHILDREN {
        // A gap of NaN (minus infinity less itself) belongs to cells beyond the grid.
        mask |= u32::from(gaps[k] < 0.0) << k;
    }
    std::iter::from_fn(move || {
        let k = mask.trailing_zeros() as usize;
        mask &= mask.wrapping_sub(1);
        (k < CHILDREN).then_some(k)
    })
}

/// A plane above the cells of a leaf: sloped as the means of its halves, through the cell that stands
/// farthest above that.
#[inline(always)]
fn leaf_ceiling(leaf: &Leaf, cell: f64) -> Ceiling {
    let mut columns = [0.0f64; LEAF];
    let mut up = [0.0f64; LEAF];
    for j in 0..LEAF {
        for i in 0..LEAF {
            let height = leaf.height[j][i];
            columns[i] += height;
            up[i] += if j >= LEAF / 2 { height } else { -height };
        }
    }
    let [a, b, c, d, e, f, g, h] = columns;
    let right = ((e - a) + (f - b)) + ((g - c) + (h - d));
    let [a, b, c, d, e, f, g, h] = up;
    let up = ((a + b) + (c + d)) + ((e + f) + (g + h));
    // Half a leaf from the mean of one half to that of the other.
    let scale = 2.0 / (LEAF * LEAF) as f64 / (0.5 * LEAF as f64 * cell);
    let slope = [right * scale, up * scale];
    let slope = if slope[0].is_finite() && slope[1].is_finite() { slope } else { [0.0; 2] };
    let mut tops = [f64::NEG_INFINITY; LEAF];
    let offset = |k: usize| (k as f64 - 0.5 * (LEAF - 1) as f64) * cell;
    for j in 0..LEAF {
        for i in 0..LEAF {
            let plane = slope[0] * offset(i) + slope[1] * offset(j);
            tops[i] = larger(tops[i], leaf.height[j][i] - plane);
        }
    }
    let [a, b, c, d, e, f, g, h] = tops;
    let value = larger(larger(larger(a, b), larger(c, d)), larger(larger(e, f), larger(g, h)));
    Ceiling { value, slope }
}

/// Looks for the cell that a rapid move touches first.
struct Watch<'a> {
    form: &'a Form,
    index: u32,
    ends: [Point3; 2],
    first: Option<RapidContact>,
}

impl Watch<'_> {
    /// Looks at the cells of a leaf before they are cut.
    #[inline(never)]
    fn look(&mut self, leaf: &Leaf, x: &[f64; LEAF], y: &[f64; LEAF]) {
        for (row, &y) in leaf.height.iter().zip(y) {
            for (&height, &x) in row.iter().zip(x).filter(|(height, _)| height.is_finite()) {
                self.see(x, y, height);
            }
        }
    }

    fn see(&mut self, x: f64, y: f64, height: f64) {
        let [from, to] = self.ends;
        let Some((enter, leave)) = reach(self.form, from, to, x, y) else { return };
        let length = (to - from).norm();
        let before = self.first.map_or(f64::INFINITY, |first| first.travel);
        if enter * length >= before {
            return;
        }
        let touched = first_touch(self.form, self.ends, (enter, leave), [x, y], height - ENGAGED);
        if let Some(travel) = touched.map(|t| t * length).filter(|travel| *travel < before) {
            let at = Point3::new(x, y, height);
            self.first = Some(RapidContact { move_index: self.index, at, travel, depth: 0.0 });
        }
    }
}
