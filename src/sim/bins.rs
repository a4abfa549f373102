//! Which moves can touch which part of the plan view: square bins of cells, each with the
//! ascending list of the moves that may cut there.

use super::Grid;
use geometry::{Point2, Point3};
use motion::Toolpath;
use work::parallel;

/// Moves that one worker sorts into bins at a time. Fewer cost a table of bins each; more leave
/// workers idle on short paths.
const CHUNK_MOVES: usize = 1 << 16;

/// Most chunks: each holds one counter a bin while the bins are built.
const MAX_CHUNKS: usize = 16;

/// By how much every bin is grown, as a part of its size, so that rounding never loses a move.
const PADDING: f64 = 1.0e-6;

/// The moves of a path, sorted into square bins over a grid (compressed rows: one array of move
/// indices, one of starts).
#[derive(Debug, Clone, PartialEq)]
pub struct MoveBins {
    starts: Vec<usize>,
    moves: Vec<u32>,
    layout: Layout,
}

/// Where the bins lie.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Layout {
    x0: f64,
    y0: f64,
    size: f64,
    nx: usize,
    ny: usize,
}

impl MoveBins {
    /// Bins of `cells_per_bin` by `cells_per_bin` cells over the whole of `grid`. A move enters
    /// every bin that a cutter of `radius` mm can touch on its way; a few that it misses by less
    /// than the corner of a bin are listed too.
    pub fn new(grid: &Grid, cells_per_bin: usize, radius: f64, path: &Toolpath) -> Self {
        let layout = Layout::over(grid, cells_per_bin.max(1));
        let bins = layout.nx * layout.ny;
        let chunk = path.len().div_ceil(MAX_CHUNKS).max(CHUNK_MOVES);
        let pieces = parallel::map(path.len().div_ceil(chunk), |k| {
            ChunkBins::of(&layout, radius, path, k * chunk..((k + 1) * chunk).min(path.len()))
        });
        let mut starts = vec![0usize; bins + 1];
        for b in 0..bins {
            starts[b + 1] = starts[b] + pieces.iter().map(|p| p.of_bin(b).len()).sum::<usize>();
        }
        let mut moves = vec![0u32; starts[bins]];
        let mut rows = Vec::with_capacity(layout.ny);
        let mut rest = moves.as_mut_slice();
        for row in 0..layout.ny {
            let bins_of_row = row * layout.nx..(row + 1) * layout.nx;
            let (head, tail) = rest.split_at_mut(starts[bins_of_row.end] - starts[bins_of_row.start]);
            rows.push(head);
            rest = tail;
        }
        parallel::for_each_chunk(&mut rows, 1, |row, slices| {
            let mut filled = 0;
            for b in row * layout.nx..(row + 1) * layout.nx {
                for list in pieces.iter().map(|p| p.of_bin(b)) {
                    slices[0][filled..filled + list.len()].copy_from_slice(list);
                    filled += list.len();
                }
            }
        });
        Self { starts, moves, layout }
    }

    /// Bins along x.
    pub fn nx(&self) -> usize {
        self.layout.nx
    }

    /// Bins along y.
    pub fn ny(&self) -> usize {
        self.layout.ny
    }

    /// The moves that may touch the bin at a place of the plan, ascending; none off the grid.
    pub fn at(&self, p: Point2) -> &[u32] {
        let Layout { x0, y0, size, nx, ny } = self.layout;
        let [x, y] = [(p.x - x0) / size, (p.y - y0) / size];
        let within = x >= 0.0 && y >= 0.0 && x < nx as f64 && y < ny as f64;
        if within { self.of_bin(x as usize, y as usize) } else { &[] }
    }

    /// The moves that may touch bin `(i, j)`, ascending.
    pub fn of_bin(&self, i: usize, j: usize) -> &[u32] {
        let b = j * self.layout.nx + i;
        &self.moves[self.starts[b]..self.starts[b + 1]]
    }
}

impl Layout {
    fn over(grid: &Grid, cells_per_bin: usize) -> Self {
        Self {
            x0: grid.origin.x - 0.5 * grid.cell,
            y0: grid.origin.y - 0.5 * grid.cell,
            size: grid.cell * cells_per_bin as f64,
            nx: grid.nx.div_ceil(cells_per_bin),
            ny: grid.ny.div_ceil(cells_per_bin),
        }
    }

    /// Calls `visit` with each bin that a disc of radius `reach` touches on its way from `a` to
    /// `b`: in each row of bins, the part of the move that can reach that row, grown by the radius.
    fn visit(&self, reach: f64, a: Point3, b: Point3, mut visit: impl FnMut(usize)) {
        let grown = reach + PADDING * self.size;
        let span = |from: f64, to: f64, start: f64, n: usize| {
            let low = (from.min(to) - grown - start) / self.size;
            let high = (from.max(to) + grown - start) / self.size;
            // Casts saturate, so anything left or below of the grid counts as bin 0 and is
            // sorted out by the test for an empty range.
            let beyond = if high < 0.0 { 0 } else { (high as usize).saturating_add(1).min(n) };
            (low.max(0.0) as usize)..beyond
        };
        for row in span(a.y, b.y, self.y0, self.ny) {
            let bottom = self.y0 + row as f64 * self.size - grown;
            let top = bottom + self.size + 2.0 * grown;
            let (from, to) = clip(a, b, bottom, top);
            for column in span(from, to, self.x0, self.nx) {
                visit(row * self.nx + column);
            }
        }
    }
}

/// x at the ends of the part of `a`–`b` whose y lies between `bottom` and `top`.
fn clip(a: Point3, b: Point3, bottom: f64, top: f64) -> (f64, f64) {
    let rise = b.y - a.y;
    let at = |y: f64, otherwise: f64| {
        let t = (y - a.y) / rise;
        if t > 0.0 && t < 1.0 { a.x + t * (b.x - a.x) } else { otherwise }
    };
    let inside = |y: f64| y >= bottom && y <= top;
    let nearest = |y: f64| if y < bottom { bottom } else { top };
    let from = if inside(a.y) { a.x } else { at(nearest(a.y), a.x) };
    let to = if inside(b.y) { b.x } else { at(nearest(b.y), b.x) };
    (from, to)
}

/// The bins of one run of moves.
struct ChunkBins {
    starts: Vec<usize>,
    moves: Vec<u32>,
}

impl ChunkBins {
    fn of(layout: &Layout, radius: f64, path: &Toolpath, range: std::ops::Range<usize>) -> Self {
        let bins = layout.nx * layout.ny;
        // Counted into the slot after next, so that one running sum leaves in slot b + 1 the place
        // where bin b begins; filling then moves it to where bin b ends.
        let mut starts = vec![0usize; bins + 2];
        let mut visits = Vec::with_capacity(4 * range.len());
        for k in range {
            layout.visit(radius, path.start_of(k), path.moves[k].to.tip, |b| {
                starts[b + 2] += 1;
                visits.push((b, k as u32));
            });
        }
        for b in 2..starts.len() {
            starts[b] += starts[b - 1];
        }
        let mut moves = vec![0u32; visits.len()];
        for (b, k) in visits {
            moves[starts[b + 1]] = k;
            starts[b + 1] += 1;
        }
        Self { starts, moves }
    }

    fn of_bin(&self, b: usize) -> &[u32] {
        &self.moves[self.starts[b]..self.starts[b + 1]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::path_through;
    use proptest::prelude::*;

    fn distance(x: f64, y: f64, a: Point3, b: Point3) -> f64 {
        let (p, d) = (Point2::new(x, y) - a.xy(), b.xy() - a.xy());
        let t = if d.norm_squared() > 0.0 { (p.dot(&d) / d.norm_squared()).clamp(0.0, 1.0) } else { 0.0 };
        (p - d * t).norm()
    }

    proptest! {
        #[test]
        fn no_move_that_reaches_a_point_is_missing(
            tips in prop::collection::vec((-15.0..35.0f64, -15.0..35.0f64), 1..40),
            cells_per_bin in 1usize..9, radius in 0.1..4.0f64,
        ) {
            let grid = Grid { origin: Point2::new(0.5, -1.0), cell: 0.7, nx: 30, ny: 23 };
            let path = path_through(tips.into_iter().map(|(x, y)| Point3::new(x, y, 0.0)));
            let bins = MoveBins::new(&grid, cells_per_bin, radius, &path);
            for j in 0..grid.ny {
                for i in 0..grid.nx {
                    let p = grid.centre(i, j);
                    let found = bins.of_bin(i / cells_per_bin, j / cells_per_bin);
                    prop_assert_eq!(found, bins.at(p));
                    prop_assert!(found.windows(2).all(|w| w[0] < w[1]));
                    for (k, (a, b, _)) in path.segments().enumerate() {
                        if distance(p.x, p.y, a, b) <= radius {
                            prop_assert!(found.contains(&(k as u32)), "move {k} at {i} {j}");
                        }
                    }
                }
            }
        }
    }

    /// More moves than one chunk holds: the pieces join in the order of the moves.
    #[test]
    fn chunks_join_in_order() {
        let grid = Grid { origin: Point2::new(0.5, 0.5), cell: 1.0, nx: 20, ny: 12 };
        let mut rng = crate::scenes::Rng::new(4);
        let tips = (0..150_000).map(|_| Point3::new(rng.within(-2.0, 22.0), rng.within(-2.0, 14.0), 0.0));
        let near = |tip: Point3, k: usize| Point3::new(tip.x + 0.01 * (k % 7) as f64, tip.y, 0.0);
        let path = path_through(tips.enumerate().flat_map(|(k, tip)| [tip, near(tip, k)]).take(150_000));
        assert!(path.len() > 2 * CHUNK_MOVES);
        let bins = MoveBins::new(&grid, 4, 0.5, &path);
        let mut expected = vec![Vec::new(); 15];
        for (k, (a, b, _)) in path.segments().enumerate() {
            bins.layout.visit(0.5, a, b, |bin| expected[bin].push(k as u32));
        }
        for (bin, expected) in expected.iter().enumerate() {
            assert_eq!(bins.of_bin(bin % 5, bin / 5), expected);
        }
    }

    #[test]
    fn a_long_diagonal_enters_few_bins() {
        let grid = Grid { origin: Point2::new(0.5, 0.5), cell: 1.0, nx: 100, ny: 100 };
        let path = path_through([Point3::new(0.0, 0.0, 0.0), Point3::new(100.0, 100.0, 0.0)]);
        let bins = MoveBins::new(&grid, 1, 1.0, &path);
        let entered = (0..100).flat_map(|j| (0..100).map(move |i| (i, j)));
        let entered = entered.filter(|&(i, j)| !bins.of_bin(i, j).is_empty()).count();
        assert!(entered < 700, "{entered} of 10000");
    }
}
