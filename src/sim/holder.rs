//! Whether shank and holder stay clear of the stock.
//!
//! Enters: stock as a z-map (what stands when all is cut), the holder, a path. Leaves: for each move on
//! which they meet, where and how deep, and the least clearance of all; mm.
//!
//! A section of a holder is a disc or a cone, seen from below a convex profile like a cutter's, and is
//! swept by the same exact formulas. It is held against the highest stock of a pyramid of ever larger
//! squares of cells: a square that lies lower than the sweep, by more than the least clearance so far,
//! is left out with all that is in it.
//!
//! Stock only falls while it is cut, so a collision with the final stock is one for certain, and deeper
//! still while material stands that is cut later. What stands before it is cut is not looked at.

use super::ZMap;
use super::form::Form;
use super::swept::swept_height;
use super::track::{Track, larger, smaller};
use cutter::Holder;
use geometry::{Point2, Point3, Vector3};
use motion::Toolpath;
use work::monitor::{Cancelled, Monitor, check};
use work::parallel;

/// Squares of one level of the pyramid along the side of one of the next. Two asks for more levels,
/// eight bounds more loosely.
const SPLIT: usize = 4;

/// Moves that one worker checks at a time. The least clearance so far is known within a chunk only, so
/// fewer leave out less; more leave workers idle on short paths.
const CHUNK_MOVES: usize = 4096;

/// Moves between two questions whether to go on.
const MOVES_BETWEEN_QUESTIONS: usize = 256;

/// Slack of every bound, mm, against rounding.
const SLACK: f64 = 1.0e-9;

/// One move on which shank or holder meet the stock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Collision {
    /// Index of the move.
    pub move_index: u32,
    /// Section of the holder, counted from 0 at the bottom.
    pub section: usize,
    /// The cell at which they meet deepest: its centre and the height of the stock there, mm.
    pub at: Point3,
    /// How far the stock stands into the section there, measured upward, mm.
    pub depth: f64,
    /// How much deeper it may be between the centres of cells, mm.
    pub error_bound: f64,
}

/// How clear a holder stays on a path.
#[derive(Debug, Clone, PartialEq)]
pub struct HolderClearance {
    /// The least height of shank and holder above the stock at the centres of cells, mm; below zero
    /// where they meet, infinite where they are never above stock.
    pub lowest: f64,
    /// How much less it may be between the centres, mm. Sound as long as no place of the stock is higher
    /// than the highest of the nine centres around.
    pub error_bound: f64,
    /// Move, section and place of the least clearance.
    pub at: Option<(u32, usize, Point3)>,
    /// The moves on which they meet, in program order.
    pub collisions: Vec<Collision>,
    /// Moves on which they meet nowhere at a centre, but might between centres.
    pub uncertain: usize,
}

/// Checks every move of `path`, rapids included, against `stock`, which is what stands at the end.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
///
/// # Tolerance
/// The sweep is exact at the centres of cells; see [`HolderClearance`] for what may be between. The
/// result does not depend on the number of threads.
pub fn holder_collisions(
    stock: &ZMap,
    holder: &Holder,
    path: &Toolpath,
    monitor: &dyn Monitor,
) -> Result<HolderClearance, Cancelled> {
    let chunks = path.len().div_ceil(CHUNK_MOVES);
    monitor.start("checking the holder", chunks as u64);
    let check_of = Checks::new(stock, holder);
    let found = parallel::try_map(chunks, |k| {
        let moves = k * CHUNK_MOVES..((k + 1) * CHUNK_MOVES).min(path.len());
        let found = check_of.moves(moves, path, monitor)?;
        monitor.advance(1);
        Ok::<_, Cancelled>(found)
    })?;
    let mut all =
        ChunkClearance { lowest: Lowest::NONE, certain: f64::INFINITY, collisions: Vec::new(), uncertain: 0 };
    for mut chunk in found {
        if chunk.lowest.clearance < all.lowest.clearance {
            all.lowest = chunk.lowest;
        }
        all.certain = smaller(all.certain, chunk.certain);
        all.collisions.append(&mut chunk.collisions);
        all.uncertain += chunk.uncertain;
    }
    let Lowest { clearance, cell, section, move_index } = all.lowest;
    let place = (clearance < f64::INFINITY).then(|| (move_index, section, check_of.plain.place(cell)));
    let error_bound = if place.is_some() { clearance - all.certain } else { 0.0 };
    Ok(HolderClearance {
        lowest: clearance,
        error_bound,
        at: place,
        collisions: all.collisions,
        uncertain: all.uncertain,
    })
}

/// The least clearance found so far, and where.
#[derive(Debug, Clone, Copy)]
struct Lowest {
    clearance: f64,
    cell: [usize; 2],
    section: usize,
    move_index: u32,
}

impl Lowest {
    const NONE: Self = Self { clearance: f64::INFINITY, cell: [0; 2], section: 0, move_index: 0 };
}

/// What a run of moves yields.
struct ChunkClearance {
    lowest: Lowest,
    /// No clearance, also between centres, is less than this.
    certain: f64,
    collisions: Vec<Collision>,
    uncertain: usize,
}

/// The holder as it is against the heights at centres, and grown by half the diagonal of a cell against
/// the highest of nine: any place of the plan view is that near to a centre.
struct Checks {
    plain: Pyramid,
    highest: Pyramid,
    sections: Vec<(f64, Form)>,
    grown: Vec<(f64, Form)>,
}

impl Checks {
    fn new(stock: &ZMap, holder: &Holder) -> Self {
        let forms = |growth: f64| -> Vec<(f64, Form)> {
            holder.profiles(growth).into_iter().map(|(at, profile)| (at, Form::of(profile))).collect()
        };
        let (plain, highest) = parallel::join(
            || Pyramid::new(stock, stock.height.clone()),
            || Pyramid::new(stock, highest_of_nine(stock)),
        );
        Self { plain, highest, sections: forms(0.0), grown: forms(0.5f64.sqrt() * stock.grid.cell) }
    }

    fn moves(
        &self,
        moves: std::ops::Range<usize>,
        path: &Toolpath,
        monitor: &dyn Monitor,
    ) -> Result<ChunkClearance, Cancelled> {
        let mut found = ChunkClearance {
            lowest: Lowest::NONE,
            certain: f64::INFINITY,
            collisions: Vec::new(),
            uncertain: 0,
        };
        for k in moves {
            if k % MOVES_BETWEEN_QUESTIONS == 0 {
                check(monitor)?;
            }
            self.one(k, path.start_of(k), path.moves[k].to.tip, &mut found);
        }
        Ok(found)
    }

    fn one(&self, k: usize, from: Point3, to: Point3, found: &mut ChunkClearance) {
        let move_index = k as u32;
        // Below the least so far, or below zero, where each move counts for itself.
        let sweep = |pyramid: &Pyramid, sections: &[(f64, Form)], limit: f64| {
            let mut lowest = Lowest { clearance: larger(limit, 0.0), move_index, ..Lowest::NONE };
            for (section, (begins, form)) in sections.iter().enumerate() {
                let lift = Vector3::new(0.0, 0.0, *begins);
                let track = Track::new(from + lift, to + lift);
                pyramid.lower(form, &track, section, &mut lowest);
            }
            (lowest.clearance < larger(limit, 0.0)).then_some(lowest)
        };
        let Some(at_worst) = sweep(&self.highest, &self.grown, larger(found.certain, found.lowest.clearance))
        else {
            return;
        };
        found.certain = smaller(found.certain, at_worst.clearance);
        let at_centres = sweep(&self.plain, &self.sections, found.lowest.clearance);
        let collides = at_centres.filter(|lowest| lowest.clearance < 0.0);
        if let Some(lowest) = at_centres.filter(|l| l.clearance < found.lowest.clearance) {
            found.lowest = lowest;
        }
        if let Some(Lowest { clearance, cell, section, .. }) = collides {
            found.collisions.push(Collision {
                move_index,
                section,
                at: self.plain.place(cell),
                depth: -clearance,
                error_bound: clearance - at_worst.clearance,
            });
        } else if at_worst.clearance < 0.0 {
            found.uncertain += 1;
        }
    }
}

/// For each cell the highest of it and its eight neighbours.
fn highest_of_nine(stock: &ZMap) -> Vec<f32> {
    let (nx, ny) = (stock.grid.nx, stock.grid.ny);
    let mut highest = vec![f32::NEG_INFINITY; stock.height.len()];
    if nx == 0 {
        return highest;
    }
    parallel::for_each_chunk(&mut highest, nx, |j, row| {
        for (i, highest) in row.iter_mut().enumerate() {
            for y in j.saturating_sub(1)..(j + 2).min(ny) {
                for x in i.saturating_sub(1)..(i + 2).min(nx) {
                    *highest = highest.max(stock.height[y * nx + x]);
                }
            }
        }
    });
    highest
}

/// Heights over a grid, and over ever larger squares of it the highest.
struct Pyramid {
    origin: Point2,
    cell: f64,
    /// From the cells upward: columns, rows and heights of each level.
    levels: Vec<(usize, usize, Vec<f32>)>,
}

impl Pyramid {
    fn new(stock: &ZMap, heights: Vec<f32>) -> Self {
        let mut levels = vec![(stock.grid.nx, stock.grid.ny, heights)];
        while let Some((nx, ny, below)) = levels.last()
            && nx * ny > 1
        {
            let (columns, rows) = (nx.div_ceil(SPLIT), ny.div_ceil(SPLIT));
            let mut heights = vec![f32::NEG_INFINITY; columns * rows];
            for (j, row) in below.chunks(*nx).enumerate() {
                for (i, &height) in row.iter().enumerate() {
                    let top = &mut heights[j / SPLIT * columns + i / SPLIT];
                    *top = top.max(height);
                }
            }
            levels.push((columns, rows, heights));
        }
        Self { origin: stock.grid.origin, cell: stock.grid.cell, levels }
    }

    /// Centre of a cell, at the height that stands there.
    fn place(&self, [i, j]: [usize; 2]) -> Point3 {
        let (nx, _, heights) = &self.levels[0];
        let (x, y) = (self.origin.x + i as f64 * self.cell, self.origin.y + j as f64 * self.cell);
        Point3::new(x, y, f64::from(heights[j * nx + i]))
    }

    /// Lowers `lowest` to the least clearance of a swept form.
    fn lower(&self, form: &Form, track: &Track, section: usize, lowest: &mut Lowest) {
        let top = self.levels.len() - 1;
        if self.levels[0].2.is_empty() {
            return;
        }
        self.descend(top, [0, 0], form, track, section, lowest);
    }

    fn descend(
        &self,
        level: usize,
        [i, j]: [usize; 2],
        form: &Form,
        track: &Track,
        section: usize,
        lowest: &mut Lowest,
    ) {
        let (nx, _, heights) = &self.levels[level];
        let height = f64::from(heights[j * nx + i]);
        if level == 0 {
            let (x, y) = (self.origin.x + i as f64 * self.cell, self.origin.y + j as f64 * self.cell);
            let clearance = swept_height(form, track, x, y) - height;
            if clearance < lowest.clearance {
                *lowest = Lowest { clearance, cell: [i, j], section, ..*lowest };
            }
            return;
        }
        if self.bound(level, [i, j], form, track) - height >= lowest.clearance {
            return;
        }
        let (columns, rows, _) = &self.levels[level - 1];
        for y in j * SPLIT..((j + 1) * SPLIT).min(*rows) {
            for x in i * SPLIT..((i + 1) * SPLIT).min(*columns) {
                self.descend(level - 1, [x, y], form, track, section, lowest);
            }
        }
    }

    /// No centre in a square lies below the sweep by less than this (infinite: it passes none): the
    /// square is no nearer to the track than its middle less its half diagonal, and is reached only
    /// from the part of the track within a radius of it, whose lower end is the lowest.
    fn bound(&self, level: usize, [i, j]: [usize; 2], form: &Form, track: &Track) -> f64 {
        let cells = SPLIT.pow(level as u32);
        let (nx, ny, _) = &self.levels[0];
        let span = |k: usize, n: usize| {
            let (first, last) = (k * cells, ((k + 1) * cells).min(n) - 1);
            (0.5 * (first + last) as f64, 0.5 * (last - first) as f64)
        };
        let ((mx, wx), (my, wy)) = (span(i, *nx), span(j, *ny));
        let half_diagonal = wx.hypot(wy) * self.cell + SLACK;
        let (x, y) = (self.origin.x + mx * self.cell, self.origin.y + my * self.cell);
        let (along, across) = track.along_across(x, y);
        let ahead = along - smaller(larger(along, 0.0), track.length);
        let near = (ahead * ahead + across * across).sqrt() - half_diagonal;
        if near > form.radius {
            return f64::INFINITY;
        }
        let first = smaller(larger(along - form.radius - half_diagonal, 0.0), track.length);
        track.tip(first) + form.height(larger(near, 0.0)) - SLACK
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::{Rng, path_through, random_path, square_grid};
    use crate::{SweptMove, cut_reference};
    use cutter::{Cutter, HolderSection};
    use work::monitor::Silent;

    fn holder() -> Holder {
        let section = |diameter, top_diameter, length| HolderSection { diameter, top_diameter, length };
        Holder::new(3.0, vec![section(2.0, 2.0, 2.0), section(5.0, 9.0, 3.0), section(12.0, 10.0, 4.0)])
            .unwrap()
    }

    /// Every cell under every section of every move.
    fn by_brute_force(stock: &ZMap, path: &Toolpath) -> Vec<f64> {
        let holder = holder();
        let sections = holder.profiles(0.0);
        let of_move = |(from, to): (Point3, Point3)| {
            let mut least = f64::INFINITY;
            for (begins, profile) in &sections {
                let lift = Vector3::new(0.0, 0.0, *begins);
                for j in 0..stock.grid.ny {
                    for i in 0..stock.grid.nx {
                        let p = stock.grid.centre(i, j);
                        let h =
                            swept_height(&Form::of(*profile), &Track::new(from + lift, to + lift), p.x, p.y);
                        least = least.min(h - f64::from(stock.height[j * stock.grid.nx + i]));
                    }
                }
            }
            least
        };
        path.segments().map(|(from, to, _)| of_move((from, to))).collect()
    }

    fn hills(rng: &mut Rng) -> ZMap {
        let mut stock = ZMap::block(square_grid(8.0, 0.25), 0.0);
        for height in &mut stock.height {
            *height = rng.within(-3.0, 5.0) as f32;
        }
        stock
    }

    #[test]
    fn collisions_are_those_of_brute_force() {
        let mut rng = Rng::new(11);
        let stock = hills(&mut rng);
        let path = random_path(&mut rng, 150, 8.0);
        let got = holder_collisions(&stock, &holder(), &path, &Silent).unwrap();
        let expected = by_brute_force(&stock, &path);
        let least = expected.iter().fold(f64::INFINITY, |a, &b| a.min(b));
        assert_eq!(got.lowest, least);
        let colliding: Vec<usize> = (0..path.len()).filter(|&k| expected[k] < 0.0).collect();
        assert!(colliding.len() > 20 && colliding.len() < path.len(), "{}", colliding.len());
        assert_eq!(got.collisions.iter().map(|c| c.move_index as usize).collect::<Vec<_>>(), colliding);
        for c in &got.collisions {
            assert_eq!(c.depth, -expected[c.move_index as usize]);
            assert!(c.error_bound >= 0.0);
        }
        // The least clearance above zero is found as well.
        let high: Vec<Point3> =
            path.segments().map(|(from, ..)| from + Vector3::new(0.0, 0.0, 9.0)).collect();
        let path = path_through(high);
        let got = holder_collisions(&stock, &holder(), &path, &Silent).unwrap();
        let least = by_brute_force(&stock, &path).into_iter().fold(f64::INFINITY, f64::min);
        assert!(got.lowest == least && least > 0.0 && got.collisions.is_empty(), "{least} {}", got.lowest);
    }

    /// The bound holds the clearance over stock that is known between the centres too: the same hills,
    /// straight between centres four times as close.
    #[test]
    fn what_finer_cells_find_is_within_the_bound() {
        let surface = |x: f64, y: f64| 2.0 * (1.3 * x).sin() * (0.9 * y).cos();
        let map = |cell: f64| {
            let grid = square_grid(8.0, cell);
            let mut map = ZMap::block(grid, 0.0);
            for j in 0..grid.ny {
                for i in 0..grid.nx {
                    let p = grid.centre(i, j);
                    map.height[j * grid.nx + i] = surface(p.x, p.y) as f32;
                }
            }
            map
        };
        let mut rng = Rng::new(12);
        let path = random_path(&mut rng, 60, 8.0);
        let coarse = holder_collisions(&map(0.5), &holder(), &path, &Silent).unwrap();
        let fine = holder_collisions(&map(0.5 / 9.0), &holder(), &path, &Silent).unwrap();
        assert!(fine.lowest <= coarse.lowest + 1e-6 && coarse.error_bound > 0.0);
        // A crest between centres is no higher than the highest of nine by more than its bend.
        let bend = 2.0 * 1.3 * 1.3 * 0.5 * 0.25 * 0.25;
        assert!(fine.lowest >= coarse.lowest - coarse.error_bound - bend, "{} {coarse:?}", fine.lowest);
        for c in &fine.collisions {
            let seen = coarse.collisions.iter().find(|d| d.move_index == c.move_index);
            match seen {
                Some(d) => assert!(c.depth <= d.depth + d.error_bound + bend),
                None => assert!(coarse.uncertain > 0 || c.depth <= bend),
            }
        }
    }

    #[test]
    fn a_wall_beside_a_pass_has_its_closed_form() {
        // A floor at 0 beside a wall of 20: the holder, of radius 6 from 8 above the tip on, cuts into
        // the wall by 12 where the pass runs 4 beside it, and not where it runs 7 beside it.
        let mut stock = ZMap::block(square_grid(40.0, 0.5), 0.0);
        let nx = stock.grid.nx;
        for (k, height) in stock.height.iter_mut().enumerate() {
            if stock.grid.centre(k % nx, 0).x > 20.0 {
                *height = 20.0;
            }
        }
        let holder =
            Holder::new(8.0, vec![HolderSection { diameter: 12.0, top_diameter: 12.0, length: 60.0 }])
                .unwrap();
        let pass = |x: f64| path_through([Point3::new(x, 5.0, 0.0), Point3::new(x, 35.0, 0.0)]);
        let got = holder_collisions(&stock, &holder, &pass(16.0), &Silent).unwrap();
        assert_eq!((got.lowest, got.collisions.len()), (-12.0, 1));
        assert_eq!((got.collisions[0].depth, got.collisions[0].at.z), (12.0, 20.0));
        let got = holder_collisions(&stock, &holder, &pass(13.0), &Silent).unwrap();
        assert_eq!((got.lowest, got.collisions.len(), got.uncertain), (8.0, 0, 0));
        // So near that only the cell decides: the wall stands between centres.
        let got = holder_collisions(&stock, &holder, &pass(14.1), &Silent).unwrap();
        assert_eq!((got.lowest, got.uncertain), (8.0, 1));
        assert_eq!(got.error_bound, 20.0);
        let nothing = holder_collisions(&stock, &holder, &pass(-30.0), &Silent).unwrap();
        assert_eq!((nothing.lowest, nothing.at), (f64::INFINITY, None));
    }

    #[test]
    fn threads_change_nothing_and_the_cut_itself_is_clear() {
        let mut rng = Rng::new(13);
        let (stock, path) = (ZMap::block(square_grid(8.0, 0.25), 5.0), random_path(&mut rng, 9000, 8.0));
        let cutter = Cutter::ball(6.0).unwrap();
        let cut = cut_reference(&stock, &cutter, &path, &Silent).unwrap();
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| holder_collisions(&cut, &holder(), &path, &Silent).unwrap())
        };
        let one = run(1);
        assert_eq!(one, run(3));
        // A shank no wider than the cutter stands where the cutter has been.
        let shank = HolderSection { diameter: 6.0, top_diameter: 6.0, length: 9.0 };
        let shank = Holder::new(3.0, vec![shank]).unwrap();
        let clear = holder_collisions(&cut, &shank, &path, &Silent).unwrap();
        assert!(clear.collisions.is_empty() && clear.lowest >= -1e-6, "{}", clear.lowest);
        let (from, to) = (path.start_of(0), path.moves[0].to.tip);
        assert!(SweptMove::new(&cutter, from, to).height(from.x, from.y).is_some());
    }

    #[test]
    fn it_can_be_cancelled_and_left_empty() {
        struct Stop;
        impl Monitor for Stop {
            fn cancelled(&self) -> bool {
                true
            }
        }
        let stock = ZMap::block(square_grid(2.0, 0.5), 0.0);
        let path = path_through([Point3::origin(), Point3::new(1.0, 0.0, 0.0)]);
        assert_eq!(holder_collisions(&stock, &holder(), &path, &Stop), Err(Cancelled));
        let empty =
            ZMap { height: vec![], cut_by: vec![], grid: super::super::Grid { nx: 0, ny: 0, ..stock.grid } };
        assert_eq!(holder_collisions(&empty, &holder(), &path, &Silent).unwrap().at, None);
    }
}
