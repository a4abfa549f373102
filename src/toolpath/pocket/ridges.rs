//! Passes over the ridges that others leave, of a cutter whose bottom is nowhere level for half an interval.
//!
//! Enters: a piece of the cutter's centre, its runs, half an interval. Leaves: the same runs with ways added,
//! so that no place of the piece is farther than half an interval from a pass. Offsets leave more on the
//! bisectors of sharp corners, and along the medial line where the last ring has no room; level curves at
//! their saddles. Such places are found on square cells, tile by tile; a way goes along the middle of each
//! patch of them, out and back from the last pass beside it, where all around is cut but the ridge; mm.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::f64::consts::{FRAC_1_SQRT_2, PI};

use super::descend::shortened;
use super::lines::{crossings, is_clear};
use super::route::{Entry, Run};
use geometry::{CurveSegment, Piece, Point2, Region, SegmentGrid, Vector2, foot};
use work::monitor::{Cancelled, Monitor, check};

/// Intervals are planned for this share of the stepover. What is left tells the middle between two passes
/// from a ridge, and lets obtuse corners be: those of more than 151 degrees leave no ridge.
pub(super) const INTERVAL_SHARE: f64 = 0.98;

/// Side of a cell over half an interval. A cell in the middle between passes is held whole by one of them.
const CELL: f64 = 0.024;

/// Cells along a side of a tile.
const TILE: usize = 2048;

/// Parts of a side of a cell whose middles are asked where the whole cell does not tell.
const PARTS: usize = 4;

/// Farthest pass from a ridge's end that a way leads there from, over half an interval.
const LONGEST_LINK: f64 = 8.0;

/// Ways added to a run: the side where one begins, its share of that, and the way.
type Detours = Vec<(usize, f64, Vec<Point2>)>;

/// Adds ways to runs so that no place of the piece is farther than `reach` from one, mm.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub(super) fn cut(
    piece: &Piece,
    runs: &mut Vec<Run>,
    reach: f64,
    monitor: &dyn Monitor,
) -> Result<(), Cancelled> {
    let Some([lo, hi]) = (Region { pieces: vec![piece.clone()] }).bounds() else { return Ok(()) };
    let sides = sides_of(runs);
    let mut ridges = Ridges {
        piece,
        walls: SegmentGrid::of_curves(piece.curves()),
        passes: SegmentGrid::new(sides.clone()),
        sides,
        reach,
        cell: CELL * reach,
        ways: Vec::new(),
        detours: vec![Vec::new(); runs.len()],
        alone: Vec::new(),
    };
    let size = ridges.cell * TILE as f64;
    let count = (hi - lo).map(|s| (s / size).ceil().max(1.0) as usize);
    for (i, j) in (0..count.y).flat_map(|j| (0..count.x).map(move |i| (i, j))) {
        check(monitor)?;
        ridges.over_tile(lo + Vector2::new(i as f64, j as f64) * size, monitor)?;
    }
    for (run, detours) in runs.iter_mut().zip(ridges.detours) {
        run.points = with_detours(&run.points, detours);
    }
    runs.extend(ridges.alone);
    Ok(())
}

/// The sides of all runs, by run and place in it. Those of a helix's turn belong to none.
fn sides_of(runs: &[Run]) -> Vec<CurveSegment> {
    let mut sides = Vec::new();
    for (curve, run) in runs.iter().enumerate() {
        let turn = run.turn_at_depth();
        let around = turn.iter().enumerate().map(|(k, a)| [*a, turn[(k + 1) % turn.len()]]);
        sides.extend(around.map(|ends| CurveSegment { ends, curve: u32::MAX, index: 0 }));
        let along = run.points.windows(2).enumerate();
        sides.extend(along.map(|(k, w)| CurveSegment {
            ends: [w[0], w[1]],
            curve: curve as u32,
            index: k as u32,
        }));
    }
    sides
}

/// As much of a way from its beginning as comes within `far` of all places that all of it does.
fn short_enough(way: &[Point2], places: &[Point2], far: f64) -> Vec<Point2> {
    // Where a side first comes so near to a place, in sides from the beginning.
    let first = |p: &Point2| {
        way.windows(2).enumerate().find_map(|(k, w)| {
            let (along, to) = (w[1] - w[0], p - w[0]);
            let (square, middle) = (along.norm_squared(), along.dot(&to));
            let root = middle * middle - square * (to.norm_squared() - far * far);
            let share = if to.norm() <= far { 0.0 } else { (middle - root.max(0.0).sqrt()) / square };
            (root >= 0.0 && (0.0..=1.0).contains(&share)).then_some(k as f64 + share)
        })
    };
    let last = places.iter().filter_map(first).fold(0.0, f64::max);
    let side = (last as usize).min(way.len() - 2);
    let end = way[side] + (way[side + 1] - way[side]) * (last - side as f64);
    way[..=side].iter().copied().chain([end]).collect()
}

/// A way with others put in, each from its place on.
fn with_detours(points: &[Point2], mut detours: Detours) -> Vec<Point2> {
    detours.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut detours = detours.into_iter().peekable();
    let mut out = Vec::with_capacity(points.len());
    for (k, p) in points.iter().enumerate() {
        out.push(*p);
        while let Some((_, _, way)) = detours.next_if(|detour| detour.0 == k) {
            out.extend(way);
        }
    }
    out.dedup();
    out
}

struct Ridges<'a> {
    piece: &'a Piece,
    walls: SegmentGrid,
    sides: Vec<CurveSegment>,
    passes: SegmentGrid,
    /// Half an interval, mm.
    reach: f64,
    /// Side of a cell, mm.
    cell: f64,
    /// Sides of the ways that were added.
    ways: Vec<[Point2; 2]>,
    /// By run.
    detours: Vec<Detours>,
    /// Ways that no run leads to.
    alone: Vec<Run>,
}

impl Ridges<'_> {
    /// Adds the ways over the ridges of the tile at `origin`.
    fn over_tile(&mut self, origin: Point2, monitor: &dyn Monitor) -> Result<(), Cancelled> {
        let mut tile = Tile::new(self.piece, origin, self.cell);
        let within = self.reach - self.cell * FRAC_1_SQRT_2;
        let near = self.reach * LONGEST_LINK;
        let beside: Vec<CurveSegment> =
            self.sides.iter().filter(|side| tile.is_near(&side.ends, near)).copied().collect();
        beside.iter().for_each(|side| tile.clear(&side.ends, within));
        self.ways.iter().for_each(|ends| tile.clear(ends, within));
        for index in 0..tile.open.len() {
            tile.open[index] = tile.open[index] && self.stands(&tile.at(index));
        }
        let mut from = 0;
        while let Some(index) = (from..tile.open.len()).find(|k| tile.open[*k]) {
            check(monitor)?;
            from = index;
            let excess = |p: &Point2| self.passes.distance(p) - self.reach;
            let patch = tile.patch(index);
            let way = shortened(&tile.middle(&patch, excess), self.cell, self.reach, PI, |_, _| true);
            tile.open[index] = false;
            let places: Vec<Point2> = patch.iter().map(|k| tile.at(*k)).collect();
            let added = self.add(&beside, way, |way| short_enough(way, &places, within));
            for ends in added.windows(2).map(|w| [w[0], w[1]]) {
                tile.clear(&ends, within);
                self.ways.push(ends);
            }
        }
        Ok(())
    }

    /// Whether a place of a cell may be farther than half an interval from all passes.
    fn stands(&self, centre: &Point2) -> bool {
        let far = self.passes.distance(centre);
        let part = self.cell / PARTS as f64;
        let places = (0..PARTS * PARTS).map(|k| {
            let at = |k: usize| (k as f64 + 0.5) * part - 0.5 * self.cell;
            centre + Vector2::new(at(k % PARTS), at(k / PARTS))
        });
        far > self.reach
            || far + self.cell * FRAC_1_SQRT_2 > self.reach
                && places.map(|p| self.passes.distance(&p)).any(|far| far + part * FRAC_1_SQRT_2 > self.reach)
    }

    /// Puts as much of a way in as is `enough` after the last pass beside one of its ends, else all of it by
    /// a run of its own. What was put in.
    fn add(
        &mut self,
        beside: &[CurveSegment],
        way: Vec<Point2>,
        enough: impl Fn(&[Point2]) -> Vec<Point2>,
    ) -> Vec<Point2> {
        let back: Vec<Point2> = way.iter().rev().copied().collect();
        let hosts = [&way, &back].map(|way| self.host(beside, &way[0]).map(|host| (host, way)));
        let latest = hosts.into_iter().flatten().max_by_key(|(host, _)| (host.0.curve, host.0.index));
        let Some(((side, share), from)) = latest else {
            let down = way.iter().chain(back.iter().skip(1)).copied().collect();
            self.alone.push(Run { entry: Entry::Ramp(down), points: way.clone() });
            return way;
        };
        let leave = side.ends[0] + (side.ends[1] - side.ends[0]) * share;
        let out = enough(&[&[leave], from.as_slice()].concat());
        let again = out.iter().rev().skip(1);
        let detour = out.iter().chain(again).copied().collect();
        self.detours[side.curve as usize].push((side.index as usize, share, detour));
        out
    }

    /// The last side of a pass that leads straight to a place from beside it, and where on it.
    fn host(&self, beside: &[CurveSegment], to: &Point2) -> Option<(CurveSegment, f64)> {
        let far = (self.passes.distance(to) + self.reach).min(LONGEST_LINK * self.reach);
        let last = |side: &&CurveSegment| (side.curve, side.index);
        let near = beside.iter().filter(|side| side.curve != u32::MAX && foot(to, &side.ends).1 <= far);
        let side = near.max_by_key(last)?;
        let (share, _) = foot(to, &side.ends);
        let leave = side.ends[0] + (side.ends[1] - side.ends[0]) * share;
        is_clear(self.piece, &self.walls, &[leave, *to], far).then_some((*side, share))
    }
}

/// Square cells of a part of a piece, and which of them no pass holds whole.
struct Tile {
    origin: Point2,
    cell: f64,
    open: Vec<bool>,
}

impl Tile {
    /// The cells whose middles are inside a piece are open.
    fn new(piece: &Piece, origin: Point2, cell: f64) -> Self {
        let mut tile = Self { origin, cell, open: vec![false; TILE * TILE] };
        for row in 0..TILE {
            let level = tile.at(row * TILE).y;
            for pair in crossings(piece, level, |p| p.y, |p| p.x).chunks_exact(2) {
                tile.fill(row, [pair[0], pair[1]], true);
            }
        }
        tile
    }

    fn at(&self, index: usize) -> Point2 {
        let at = |k: usize| (k as f64 + 0.5) * self.cell;
        self.origin + Vector2::new(at(index % TILE), at(index / TILE))
    }

    /// Sets the cells of a row whose middles are between two x.
    fn fill(&mut self, row: usize, x: [f64; 2], open: bool) {
        let column = |x: f64| (x - self.origin.x) / self.cell - 0.5;
        let (from, to) = (column(x[0]).ceil().max(0.0) as usize, column(x[1]).floor() + 1.0);
        let to = to.clamp(0.0, TILE as f64) as usize;
        if from < to {
            self.open[row * TILE + from..row * TILE + to].fill(open);
        }
    }

    /// Whether a side comes within `far` of the tile's box.
    fn is_near(&self, ends: &[Point2; 2], far: f64) -> bool {
        let size = self.cell * TILE as f64;
        (0..2).all(|axis| {
            let [a, b] = ends.map(|p| p[axis] - self.origin[axis]);
            a.max(b) >= -far && a.min(b) <= size + far
        })
    }

    /// Closes the cells whose middles are within `far` of a side.
    fn clear(&mut self, ends: &[Point2; 2], far: f64) {
        if !self.is_near(ends, far) {
            return;
        }
        let [a, b] = ends;
        let along = b - a;
        let normal = Vector2::new(-along.y, along.x).try_normalize(0.0).unwrap_or_else(Vector2::zeros) * far;
        let row = |y: f64| (y - self.origin.y) / self.cell - 0.5;
        let from = row(a.y.min(b.y) - far).ceil().max(0.0) as usize;
        let to = (row(a.y.max(b.y) + far).floor() + 1.0).clamp(0.0, TILE as f64) as usize;
        for row in from..to {
            let y = self.at(row * TILE).y;
            let mut x = [f64::INFINITY, f64::NEG_INFINITY];
            let mut add = |at: f64| x = [x[0].min(at), x[1].max(at)];
            for p in ends {
                let half = far * far - (y - p.y) * (y - p.y);
                if half >= 0.0 {
                    [-half.sqrt(), half.sqrt()].into_iter().for_each(|half| add(p.x + half));
                }
            }
            for off in [normal, -normal] {
                let share = (y - a.y - off.y) / along.y;
                if (0.0..=1.0).contains(&share) {
                    add(a.x + off.x + along.x * share);
                }
            }
            self.fill(row, x, false);
        }
    }

    /// The open cells around one, and their distances.
    fn around(&self, index: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let [i, j] = [index % TILE, index / TILE].map(|k| k as isize);
        let steps = (-1..=1isize).flat_map(|v| (-1..=1isize).map(move |u| (u, v)));
        steps.filter_map(move |(u, v)| {
            let inside = |k: isize| (0..TILE as isize).contains(&k);
            let next =
                (inside(i + u) && inside(j + v)).then(|| ((j + v) as usize) * TILE + (i + u) as usize)?;
            (next != index && self.open[next]).then_some((next, ((u * u + v * v) as f64).sqrt()))
        })
    }

    /// The cells that hang together with one, in the order of their indices.
    fn patch(&self, index: usize) -> Vec<usize> {
        let (mut patch, mut seen) = (vec![index], std::collections::HashSet::from([index]));
        let mut next = 0;
        while next < patch.len() {
            let more: Vec<usize> =
                self.around(patch[next]).map(|a| a.0).filter(|k| seen.insert(*k)).collect();
            patch.extend(more);
            next += 1;
        }
        patch.sort_unstable();
        patch
    }

    /// A way from one end of a patch to the other, along where `excess` is greatest.
    fn middle(&self, patch: &[usize], excess: impl Fn(&Point2) -> f64) -> Vec<Point2> {
        let farthest = |from: usize| {
            let (lengths, _) = self.shortest(patch, from, |_| 1.0);
            (0..patch.len()).max_by(|a, b| lengths[*a].total_cmp(&lengths[*b])).unwrap_or(from)
        };
        let begin = farthest(0);
        let end = farthest(begin);
        let costs: Vec<f64> =
            patch.iter().map(|k| excess(&self.at(*k)).max(0.25 * self.cell).powi(-2)).collect();
        let (_, before) = self.shortest(patch, begin, |k| costs[k]);
        let mut way = vec![self.at(patch[end])];
        let mut at = end;
        while at != begin {
            at = before[at];
            way.push(self.at(patch[at]));
        }
        way
    }

    /// From one cell of a patch to all: what ways cost, and the cell before each.
    fn shortest(&self, patch: &[usize], from: usize, cost: impl Fn(usize) -> f64) -> (Vec<f64>, Vec<usize>) {
        let (mut costs, mut before) = (vec![f64::INFINITY; patch.len()], vec![from; patch.len()]);
        costs[from] = 0.0;
        // Costs are positive, and such floats are in the order of their bits.
        let mut queue = BinaryHeap::from([Reverse((0.0f64.to_bits(), from))]);
        while let Some(Reverse((bits, at))) = queue.pop() {
            if f64::from_bits(bits) > costs[at] {
                continue;
            }
            for (next, length) in self.around(patch[at]) {
                let Ok(next) = patch.binary_search(&next) else { continue };
                let sum = costs[at] + length * 0.5 * (cost(at) + cost(next));
                if sum < costs[next] {
                    (costs[next], before[next]) = (sum, at);
                    queue.push(Reverse((sum.to_bits(), next)));
                }
            }
        }
        (costs, before)
    }
}
