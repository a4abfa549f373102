//! The cut surface between cell centres: the lowest of the moves around a point.
//!
//! The z-map knows which move made each cell. Between cells the surface is the lower envelope of
//! the moves that won the cells around, followed along the program to neighbouring moves of the
//! same pass as long as they cut lower. It is evaluated in closed form in f64, so what is measured
//! on it does not depend on the grid, except that a move which is lowest nowhere on a cell centre
//! nor next to one that is would be missed.

use std::sync::{Arc, OnceLock};

use geometry::{Point3, Vector3, share_on};
use motion::Toolpath;
use sim::{Envelope, Grid, NOT_CUT, Shape, ZMap};

/// A point of the cut surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CutPoint {
    /// Height, mm.
    pub z: f64,
    /// The move that cut it, or [`NOT_CUT`] where stock still stands.
    pub by: u32,
}

/// Up to nine different moves around a cell.
pub struct Winners<'a> {
    moves: [u32; 9],
    len: usize,
    /// Height of flat stock that no move touched, if any cell around is such; infinite otherwise.
    stock: f64,
    /// The same of stock in another shape.
    shape: Option<&'a Shape>,
}

impl Winners<'_> {
    /// The moves.
    pub fn moves(&self) -> &[u32] {
        &self.moves[..self.len]
    }

    fn push(&mut self, by: u32) {
        if !self.moves[..self.len].contains(&by) && self.len < self.moves.len() {
            self.moves[self.len] = by;
            self.len += 1;
        }
    }
}

/// A z-map together with the moves that made it.
pub struct CutSurface<'a> {
    /// Closed-form heights of the moves.
    pub envelope: Envelope,
    /// Heights and winners at cell centres.
    pub cut: &'a ZMap,
    /// What cut.
    pub path: &'a Toolpath,
    /// How low the tip comes on each move and those of its pass just before and after it, mm.
    lowest_tips: Arc<[f64]>,
    /// By blocks of cells, how high all that stood surely stands in them, mm.
    standing: OnceLock<Vec<f64>>,
}

/// Cells along the side of such a block: a line along a normal leaves what stands there in one step. In
/// larger ones some cell is cut deeper more often.
const BLOCK: usize = 16;

/// Most steps along the program in search of a lower move. Reached only where moves are some
/// hundred times shorter than a cell.
const MOST_STEPS: usize = 1000;

/// Moves looked at on either side of a winner when none of the winners passes a point: asked at gaps only.
/// With fewer, long chains of short chords under a flat are cut anew on finer cells in vain.
const MOST_BESIDE: u32 = 32;

impl<'a> CutSurface<'a> {
    /// Of a z-map that `path` has cut.
    pub fn new(envelope: Envelope, cut: &'a ZMap, path: &'a Toolpath) -> Self {
        let lowest_tips = lowest_tips(path).into();
        Self { envelope, cut, path, lowest_tips, standing: OnceLock::new() }
    }

    /// What the same path has cut of another z-map.
    pub fn with_cut<'b>(&self, cut: &'b ZMap) -> CutSurface<'b>
    where
        'a: 'b,
    {
        CutSurface {
            envelope: self.envelope.clone(),
            cut,
            path: self.path,
            lowest_tips: Arc::clone(&self.lowest_tips),
            standing: OnceLock::new(),
        }
    }

    /// The moves that won cell `(i, j)` and the eight around it, the cell's own first.
    pub fn winners(&self, i: usize, j: usize) -> Winners<'_> {
        let grid = &self.cut.grid;
        let mut winners = Winners { moves: [NOT_CUT; 9], len: 0, stock: f64::INFINITY, shape: None };
        let columns = i.saturating_sub(1)..=(i + 1).min(grid.nx - 1);
        let rows = j.saturating_sub(1)..=(j + 1).min(grid.ny - 1);
        let around = rows.flat_map(|j| columns.clone().map(move |i| (i, j)));
        for (i, j) in std::iter::once((i, j)).chain(around) {
            let k = grid.index(i, j);
            match self.cut.cut_by[k] {
                NOT_CUT if self.cut.shape.is_some() => winners.shape = self.cut.shape.as_ref(),
                NOT_CUT => winners.stock = f64::from(self.cut.height[k]),
                by => winners.push(by),
            }
        }
        winners
    }

    /// The lowest of the given moves at `(x, y)`.
    pub fn lowest_of(&self, winners: &Winners<'_>, x: f64, y: f64) -> CutPoint {
        let stock = winners.shape.map_or(winners.stock, |shape| shape.height_at(x, y));
        let mut lowest = CutPoint { z: stock, by: NOT_CUT };
        for &by in &winners.moves[..winners.len] {
            if let Some(z) = self.envelope.height(by, x, y)
                && z < lowest.z
            {
                lowest = CutPoint { z, by };
            }
        }
        lowest
    }

    /// The cut surface at `(x, y)`; `None` off the grid.
    pub fn at(&self, x: f64, y: f64) -> Option<CutPoint> {
        self.in_cell(self.cut.grid.cell_at(x, y)?, x, y)
    }

    /// The cut surface at `(x, y)` by what cut a cell and those around it.
    fn in_cell(&self, (i, j): (usize, usize), x: f64, y: f64) -> Option<CutPoint> {
        let winners = self.winners(i, j);
        let lowest = self.lowest_of(&winners, x, y);
        let lowest = if lowest.z.is_finite() { lowest } else { self.beside((i, j), &winners, x, y)? };
        Some(self.follow(lowest, x, y))
    }

    /// A cut that passes `(x, y)`, near the winners of cell `(i, j)` along the program: of moves that are
    /// equally low (flats on level ground) the first wins every cell and may yet end before the point.
    /// What passes more than a cell above the cell's own height is no cut of this place.
    fn beside(&self, (i, j): (usize, usize), winners: &Winners<'_>, x: f64, y: f64) -> Option<CutPoint> {
        let grid = &self.cut.grid;
        let highest = f64::from(self.cut.height[grid.index(i, j)]) + grid.cell;
        let near = winners.moves[..winners.len].iter().flat_map(|&by| {
            let steps = (1..=MOST_BESIDE).flat_map(move |s| [by.checked_add(s), by.checked_sub(s)]);
            steps.flatten().map(move |k| (by, k))
        });
        let mut cuts = near.filter(|&(by, k)| {
            let other = self.path.moves.get(k as usize);
            other.is_some_and(|m| m.kind.is_on_surface() && Some(m.pass) == self.pass(by))
        });
        cuts.find_map(|(_, k)| {
            let z = self.envelope.height(k, x, y).filter(|z| *z <= highest)?;
            Some(CutPoint { z, by: k })
        })
    }

    /// Goes along the program from `from` while the next move of the same pass is lower there.
    pub fn follow(&self, from: CutPoint, x: f64, y: f64) -> CutPoint {
        if from.by == NOT_CUT {
            return from;
        }
        let pass = self.path.moves[from.by as usize].pass;
        let mut lowest = from;
        for step in [-1i64, 1] {
            let mut k = i64::from(from.by) + step;
            for _ in 0..MOST_STEPS {
                let same = usize::try_from(k).ok().and_then(|k| self.path.moves.get(k));
                if same.is_none_or(|m| m.pass != pass) {
                    break;
                }
                match self.envelope.height(k as u32, x, y) {
                    Some(z) if z < lowest.z => lowest = CutPoint { z, by: k as u32 },
                    _ => break,
                }
                k += step;
            }
        }
        lowest
    }

    /// Height of the cut of `by` at `(x, y)`; infinite where the move does not pass.
    pub fn height(&self, by: u32, x: f64, y: f64) -> f64 {
        if by == NOT_CUT {
            return f64::INFINITY;
        }
        self.envelope.height(by, x, y).unwrap_or(f64::INFINITY)
    }

    /// Upward unit normal of the cut surface made by `by` at `(x, y)`.
    pub fn normal(&self, by: u32, x: f64, y: f64) -> Vector3 {
        if by == NOT_CUT {
            let shape = self.cut.shape.as_ref();
            return shape.map_or(Vector3::z(), |shape| shape.stock.normal_at(x, y));
        }
        self.envelope.height_and_normal(by, x, y).map_or(Vector3::z(), |(_, n)| n)
    }

    /// The place of the tip on move `by` that is nearest to `tip`.
    pub fn nearest_tip(&self, by: u32, tip: &Point3) -> Point3 {
        let (from, to) = (self.path.start_of(by as usize), self.path.moves[by as usize].to.tip);
        from + (to - from) * share_on(tip, &from, &to)
    }

    /// The pass that a cut point belongs to; `None` on stock.
    pub fn pass(&self, by: u32) -> Option<u32> {
        self.path.moves.get(by as usize).map(|m| m.pass)
    }
}

/// How low the tip comes on each move of a path and on some of its pass before and after it, which a place
/// may be followed to, mm.
fn lowest_tips(path: &Toolpath) -> Vec<f64> {
    /// Moves before and after.
    const FOLLOWED: usize = 8;
    let tips: Vec<(f64, u32)> =
        path.segments().map(|(from, to, step)| (from.z.min(to.z), step.pass)).collect();
    let around = |k: usize| {
        let near = &tips[k.saturating_sub(FOLLOWED)..(k + FOLLOWED + 1).min(tips.len())];
        near.iter().filter(|(_, pass)| *pass == tips[k].1).map(|(z, _)| *z).fold(f64::INFINITY, f64::min)
    };
    work::parallel::map(tips.len(), around)
}

/// Where the line from a design point along its normal meets the cut surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deviation {
    /// Signed distance, mm: positive excess, negative gouge.
    pub distance: f64,
    /// Sine of the angle between the two surfaces there: how fast the distance changes sideways.
    pub slope: f64,
    /// The move that cut there.
    pub by: u32,
}

/// The meeting is found to this height, mm.
const MEETING: f64 = 1e-9;

/// Newton steps before the search turns to bisection for good, and steps in all.
const NEWTON_STEPS: usize = 12;
const MOST_ITERATIONS: usize = 70;

/// A ray along the normal is followed cell by cell at most this far, in steps of half a cell.
const MOST_MARCHING_STEPS: usize = 20_000;

/// Steps from the end of a block into the next one, and those between two questions in a block that has cuts.
const AT_ENDS: usize = 2;
const STEPS_BETWEEN: usize = 8;

impl CutSurface<'_> {
    /// Height to which the lowest of `moves` cuts above or below a point, mm; infinite where none passes.
    pub(crate) fn height_of(&self, moves: &[u32], at: &Point3) -> f64 {
        self.envelope.lowest(at.x, at.y, moves).map_or(f64::INFINITY, |(z, _)| z)
    }

    /// Signed distance from the design point `p` with outward unit normal `n` to the cut surface along `n`.
    /// `None` off the grid.
    ///
    /// # Tolerance
    /// The meeting lies on the closed-form surface to `MEETING`: beside the grid that of what cut its
    /// outermost cells. Where the line meets none of it, the vertical distance times `n.z` stands in for it.
    pub fn along_normal(&self, p: &Point3, n: &Vector3) -> Option<Deviation> {
        self.along_normal_with(p, n, &[])
    }

    /// As [`CutSurface::along_normal`], with further moves that may be lowest between centres.
    pub fn along_normal_with(&self, p: &Point3, n: &Vector3, further: &[u32]) -> Option<Deviation> {
        self.along_normal_below(f64::INFINITY, p, n, further)
    }

    /// As [`CutSurface::along_normal_with`], where stock stands up to a height, mm, wherever none of these
    /// moves passes: for places where no other does. Without it the line meets nothing there.
    pub fn along_normal_below(
        &self,
        stock: f64,
        p: &Point3,
        n: &Vector3,
        further: &[u32],
    ) -> Option<Deviation> {
        let nothing = CutPoint { z: stock, by: NOT_CUT };
        let lower = |lowest: CutPoint, x: f64, y: f64| {
            let lowest = if lowest.z < stock { lowest } else { nothing };
            match self.envelope.lowest(x, y, further) {
                Some((z, by)) if z < lowest.z => CutPoint { z, by },
                _ => lowest,
            }
        };
        let (i, j) = self.cut.grid.cell_at(p.x, p.y)?;
        let winners = self.winners(i, j);
        let start = lower(self.lowest_of(&winners, p.x, p.y), p.x, p.y);
        if !start.z.is_finite() {
            return None;
        }
        let vertical = start.z - p.z;
        let sideways = vertical * n.z * n.xy().norm();
        let found = if sideways.abs() < 0.5 * self.cut.grid.cell {
            let at = |x: f64, y: f64| Some(lower(self.lowest_of(&winners, x, y), x, y));
            self.newton(p, n, start, None, &at)
        } else {
            let at = |x: f64, y: f64| {
                Some(lower(self.near(x, y).unwrap_or(nothing), x, y)).filter(|cut| cut.z.is_finite())
            };
            let lowest = further.iter().map(|&by| self.lowest_tips[by as usize]).fold(stock, f64::min);
            let stands = |q: &Point3| {
                let cell = self.cut.grid.cell_at(q.x, q.y);
                lowest > q.z && cell.is_some_and(|cell| self.stands(q, cell))
            };
            let standing_steps = |q: &Point3, step: f64| self.standing_steps(q, n, step, lowest);
            self.march(p, n, vertical, &at, &stands, &standing_steps)
                .and_then(|(lo, hi)| self.newton(p, n, start, Some((lo, hi)), &at))
        };
        Some(found.unwrap_or(Deviation {
            distance: vertical * n.z,
            slope: n.cross(&self.normal(start.by, p.x, p.y)).norm(),
            by: start.by,
        }))
    }

    /// Whether what cut a cell and those around it, with the moves that follow on, left all that stood at a
    /// place there: no tool cuts below its tip.
    fn stands(&self, q: &Point3, (i, j): (usize, usize)) -> bool {
        let Grid { nx, ny, .. } = self.cut.grid;
        let is_in_stock = |k: usize| match &self.cut.shape {
            None => f64::from(self.cut.height[k]) > q.z,
            Some(shape) => shape.height_at(q.x, q.y) > q.z,
        };
        let mut in_stock = None;
        let mut is_left = |k: usize| match self.cut.cut_by[k] {
            // The same of all cells.
            NOT_CUT => *in_stock.get_or_insert_with(|| is_in_stock(k)),
            by => self.lowest_tips[by as usize] > q.z,
        };
        let columns = i.saturating_sub(1)..=(i + 1).min(nx - 1);
        let mut rows = j.saturating_sub(1)..=(j + 1).min(ny - 1);
        rows.all(|j| columns.clone().all(|i| is_left(self.cut.grid.index(i, j))))
    }

    /// How many steps of a line from a place along its normal surely lead to places that [`Self::stands`],
    /// where no other move comes lower than `lowest`, mm.
    fn standing_steps(&self, from: &Point3, n: &Vector3, step: f64, lowest: f64) -> usize {
        let grid = &self.cut.grid;
        let Some((i, j)) = grid.cell_at(from.x, from.y) else { return 0 };
        let (bi, bj) = (i / BLOCK, j / BLOCK);
        let blocks = self.standing.get_or_init(|| self.standing_blocks());
        let up = if n.z > 0.0 {
            (lowest.min(blocks[bj * grid.nx.div_ceil(BLOCK) + bi]) - from.z) / n.z
        } else {
            0.0
        };
        let leaves = |at: f64, way: f64, first: f64, b: usize, n: usize| {
            let low = first + ((b * BLOCK) as f64 - 0.5) * grid.cell;
            let high = first + (((b + 1) * BLOCK).min(n) as f64 - 0.5) * grid.cell;
            if way == 0.0 { f64::INFINITY } else { (if way > 0.0 { high } else { low } - at) / way }
        };
        let way = up.min(leaves(from.x, n.x, grid.origin.x, bi, grid.nx)).min(leaves(
            from.y,
            n.y,
            grid.origin.y,
            bj,
            grid.ny,
        ));
        // One step less than there is room for: the ends are rounded.
        ((way / step) as usize).saturating_sub(1).min(MOST_MARCHING_STEPS)
    }

    /// Of each block of cells, row by row, how high all that stood surely stands in each of its cells, and
    /// those around them, mm.
    fn standing_blocks(&self) -> Vec<f64> {
        let (grid, cut) = (&self.cut.grid, self.cut);
        let level = |k: usize| match cut.cut_by[k] {
            NOT_CUT if cut.shape.is_some() => f64::NEG_INFINITY,
            NOT_CUT => f64::from(cut.height[k]),
            by => self.lowest_tips[by as usize],
        };
        let around = |b: usize, n: usize| (b * BLOCK).saturating_sub(1)..((b + 1) * BLOCK + 1).min(n);
        let (columns, rows) = (grid.nx.div_ceil(BLOCK), grid.ny.div_ceil(BLOCK));
        (0..columns * rows)
            .map(|k| {
                let cells = around(k / columns, grid.ny)
                    .flat_map(|j| around(k % columns, grid.nx).map(move |i| grid.index(i, j)));
                cells.map(level).fold(f64::INFINITY, f64::min)
            })
            .collect()
    }

    /// As [`Self::at`]; beside the grid by the moves that cut its outermost cells, as far as they pass.
    fn near(&self, x: f64, y: f64) -> Option<CutPoint> {
        let grid = &self.cut.grid;
        match grid.cell_at(x, y) {
            Some(cell) => self.in_cell(cell, x, y),
            None => self.in_cell(grid.nearest_cell(x, y), x, y).filter(|point| point.by != NOT_CUT),
        }
    }

    /// Follows the normal in steps of half a cell to the first change of side; the bracket `(lower, upper)`
    /// of the meeting. Upward it is not asked how high the cut is where so much `stands` by the tips of the
    /// tools around, and many steps are taken at once where that is known of all of them.
    fn march(
        &self,
        p: &Point3,
        n: &Vector3,
        vertical: f64,
        at: &dyn Fn(f64, f64) -> Option<CutPoint>,
        stands: &dyn Fn(&Point3) -> bool,
        standing_steps: &dyn Fn(&Point3, f64) -> usize,
    ) -> Option<(f64, f64)> {
        let step = 0.5 * self.cut.grid.cell * vertical.signum();
        let (mut t, mut taken, mut asked_at) = (0.0, 0, 0);
        while taken < MOST_MARCHING_STEPS {
            if vertical > 0.0 && taken >= asked_at {
                let known = standing_steps(&(p + n * t), step).min(MOST_MARCHING_STEPS - taken);
                // The same places as step by step, to the last bit.
                (0..known).for_each(|_| t += step);
                taken += known;
                asked_at = taken + if known > 0 { AT_ENDS } else { STEPS_BETWEEN };
            }
            taken += 1;
            let next = t + step;
            let q = p + n * next;
            if vertical > 0.0 && stands(&q) {
                t = next;
                continue;
            }
            let gap = at(q.x, q.y)?.z - q.z;
            if gap * vertical.signum() <= 0.0 {
                return Some(if step > 0.0 { (t, next) } else { (next, t) });
            }
            t = next;
        }
        None
    }

    /// Safeguarded Newton for the meeting; `gap(t)` (surface above the line's point) falls with t.
    fn newton(
        &self,
        p: &Point3,
        n: &Vector3,
        start: CutPoint,
        bracket: Option<(f64, f64)>,
        at: &dyn Fn(f64, f64) -> Option<CutPoint>,
    ) -> Option<Deviation> {
        let (mut lo, mut hi) = bracket.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
        let mut t = bracket.map_or(0.0, |(lo, hi)| 0.5 * (lo + hi));
        let mut here = if bracket.is_some() { None } else { Some(start) };
        let mut result = None;
        for iteration in 0..MOST_ITERATIONS {
            let q = p + n * t;
            let point = match here.take() {
                Some(point) => point,
                None => at(q.x, q.y)?,
            };
            let m = self.normal(point.by, q.x, q.y);
            let gap = point.z - q.z;
            // The line left all that was cut around its place: it meets none of it.
            if !gap.is_finite() {
                return None;
            }
            result = Some(Deviation { distance: t, slope: m.cross(n).norm(), by: point.by });
            if gap.abs() < MEETING {
                break;
            }
            if gap > 0.0 {
                lo = t
            } else {
                hi = t
            }
            let facing = m.dot(n);
            let next = t + gap * m.z / facing;
            let halfway = 0.5 * (lo + hi);
            let trusted = facing > 0.05 && iteration < NEWTON_STEPS && next > lo && next < hi;
            let next = if trusted {
                next
            } else if halfway.is_finite() {
                halfway
            } else {
                t + gap * n.z
            };
            if next == t || hi - lo < 1e-3 * MEETING {
                break;
            }
            t = next;
        }
        result
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cutter::Cutter;
    use geometry::Point2;
    use sim::scenes::path_through;
    use sim::{Grid, cut_reference};
    use work::monitor::Silent;

    #[test]
    fn a_line_that_leaves_the_cuts_meets_them_nowhere_and_stays_finite() {
        let cutter = Cutter::ball(6.0).unwrap();
        let path = path_through([Point3::new(0.0, 10.0, -2.0), Point3::new(20.0, 10.0, -2.0)]);
        let grid = Grid { origin: Point2::new(0.5, 0.5), cell: 1.0, nx: 20, ny: 20 };
        let cut = cut_reference(&ZMap::block(grid, 5.0), &cutter, &path, &Silent).unwrap();
        let surface = CutSurface::new(Envelope::new(cutter, &path), &cut, &path);
        // Sideways, flat and down: no line of these leads up to the cut.
        for n in [[1.0, 0.0, 0.0], [0.0, 0.999, 0.0447], [0.0, -0.6, -0.8], [0.0, 0.0, -1.0]] {
            let n = Vector3::from(n).normalize();
            for (x, y, z) in [(10.0, 10.0, -6.0), (10.0, 10.0, 3.0), (3.2, 12.6, -1.0), (0.4, 9.9, 2.0)] {
                let found = surface.along_normal(&Point3::new(x, y, z), &n).unwrap();
                assert!(
                    found.distance.is_finite() && found.slope.is_finite(),
                    "{n:?} {x} {y} {z}: {found:?}"
                );
            }
        }
    }

    /// A ball of 6 mm along y = 10 and y = 11.5, the second unseen by cells; lines in the plane of a section
    /// meet circles.
    #[test]
    fn a_line_that_leaves_the_grid_meets_what_cut_its_border_and_moves_that_no_cell_saw() {
        let cutter = Cutter::ball(6.0).unwrap();
        let tip = |x: f64, y: f64| Point3::new(x, y, -2.0);
        let seen = path_through([tip(0.0, 10.0), tip(20.0, 10.0)]);
        let path = path_through([tip(0.0, 10.0), tip(20.0, 10.0), tip(20.0, 11.5), tip(0.0, 11.5)]);
        let grid = Grid { origin: Point2::new(8.05, 9.05), cell: 0.1, nx: 40, ny: 18 };
        let cut = cut_reference(&ZMap::block(grid, 5.0), &cutter, &seen, &Silent).unwrap();
        let surface = CutSurface::new(Envelope::new(cutter, &path), &cut, &path);
        let (p, n) = (Point3::new(10.0, 10.7, -3.0), Vector3::new(0.0, 0.6, 0.8));
        let circle = |y: f64| {
            let (to, radius) = (Vector3::new(10.0, y, 1.0) - p.coords, 3.0f64);
            let along = to.dot(&n);
            along - (along * along - to.norm_squared() + radius * radius).sqrt()
        };
        let last = path.len() as u32 - 1;
        for (further, exact) in [(vec![], circle(10.0)), (vec![last], circle(11.5))] {
            let found = surface.along_normal_with(&p, &n, &further).unwrap();
            assert!((found.distance - exact).abs() < 1e-8, "{further:?}: {} {exact}", found.distance);
        }
    }

    /// Steps that are taken at once lead to places where all that stood is left, and there are many of them
    /// in a block that nothing cut.
    #[test]
    fn steps_taken_at_once_lead_through_what_stands() {
        let cutter = Cutter::flat(4.0).unwrap();
        let path = path_through([
            Point3::new(2.0, 3.0, 1.0),
            Point3::new(9.0, 3.0, 1.0),
            Point3::new(9.0, 8.0, 4.0),
        ]);
        let grid = Grid { origin: Point2::new(0.05, 0.05), cell: 0.1, nx: 210, ny: 130 };
        let cut = cut_reference(&ZMap::block(grid, 9.0), &cutter, &path, &Silent).unwrap();
        let surface = CutSurface::new(Envelope::new(cutter, &path), &cut, &path);
        let (step, mut most) = (0.5 * grid.cell, 0);
        for n in [[0.6, 0.0, 0.8], [-0.6, 0.48, 0.64], [0.0, -0.96, 0.28], [0.0, 0.0, 1.0]] {
            let n = Vector3::from(n);
            for k in 0..400 {
                let from = Point3::new(f64::from(k % 20) * 1.04, f64::from(k / 20) * 0.64, f64::from(k % 7));
                for lowest in [9.0, 3.0] {
                    let steps = surface.standing_steps(&from, &n, step, lowest);
                    most = most.max(steps);
                    let all = (1..=steps).map(|k| from + n * (step * k as f64));
                    for q in all {
                        let cell = grid.cell_at(q.x, q.y).unwrap();
                        assert!(q.z < lowest && surface.stands(&q, cell), "{from} {n} {q}");
                    }
                }
            }
        }
        assert!(most > 20, "{most}");
    }
}
