//! The highest material anywhere above the design, with a true bound. mm.
//!
//! Enters: the cut surface over its grid, and the part. Leaves: the highest place and what may stand at most:
//! in all, where passes came down to the design, and elsewhere.
//!
//! The bound rests on one fact. The surface that an upright convex cutter sweeps along a straight move is a
//! convex function of x and y wherever it passes. So, over a polygon of the plan:
//!
//! - what one move leaves above a plane is greatest at a corner of the polygon;
//! - so is any mean of moves, by whatever weights;
//! - the cut is nowhere above the lowest move, so nowhere above such a mean.
//!
//! The weights are chosen so that the greatest corner is lowest (the value of a matrix game). On a ridge the
//! slopes of both passes then cancel, and the bound is off by second order only. The polygons are the part's
//! triangles, each clipped by a square; so the part's borders and creases are borders of polygons, and
//! nothing beyond them counts. Squares that may hold more than is known are divided until none does by more
//! than was asked.

mod cells_above;
mod outline;
mod patch;

use std::collections::BinaryHeap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{PoisonError, RwLock};

use super::closer::{Effort, Promising, Square, Value, search};
use super::figures::{Bounded, ExcessFigures, ExcessKind, Measurement, NUMERICAL_FLOOR, RidgePlace};
use super::inspection::{Inspection, Sample};
use geometry::{Node, Point2, Point3};
use motion::ROUNDING;
use patch::{Held, LEAST_HALF, Patches, STEEPEST, around};
use sim::Grid;
use work::monitor::{self, Cancelled, Monitor};

pub use cells_above::cells_above;

/// Squares looked at in search of one figure. Each takes some 10 µs; with fewer, wide bounds stay.
const MOST: usize = 400_000;

/// The same where finer cells follow: enough where cells show every pass.
const MOST_AT_FIRST: usize = 25_000;

/// Rows of cells that are looked through at a time: enough for many workers.
const ROWS: usize = 64;

/// A square whose middle is of the other kind is left out once it is this share of a cell.
const OTHER_KIND_SHARE: f64 = 0.25;

/// What the highest material is sought with.
pub(super) struct ExcessSearch<'a> {
    pub inspection: &'a Inspection<'a>,
}

/// Of the cells that may hold more than a pass may leave, so many are looked through for such places.
const MOST_HIGH_CELLS: usize = 4096;

/// Such a place is known to this share of what a pass may leave: plans are made anew by no finer figures.
/// What is told is how high it may be at most.
const HIGH_SLACK: f64 = 0.01;

/// How often such a cell is divided before it counts as low enough.
const HIGH_DIVISIONS: i32 = 6;

/// Places of such a cell that are looked at in any case.
const LEAST_LOOKS: usize = 21;

/// Moves that no cell saw, lowest between centres only, that are asked at every place once they are found.
const MOST_UNSEEN: usize = 64;

/// Which places count.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Any,
    Reached,
    Unreached,
}

impl ExcessSearch<'_> {
    /// The figures, and one place of each cell where passes came down to the design and left more than the
    /// scallop limit. `samples` are those of the grid's cells, `measured` what was found so far.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub fn run(
        &self,
        samples: &[Sample],
        measured: &Measurement,
        monitor: &dyn Monitor,
    ) -> Result<(ExcessFigures, Vec<RidgePlace>), Cancelled> {
        let limits = self.inspection.limits;
        let (scallop, uncut) = (&measured.scallop, &measured.uncut);
        // What moves that no cell saw cut away does not stand.
        let stands = scallop.max_at_mm.filter(|at| self.cuts_away(&Point3::from(*at)).is_none());
        let ridge = stands.map_or(Bounded::default(), |at| Bounded {
            at_mm: Some(self.inspection.part.closest_point(&Point3::from(at)).0.point.into()),
            ..standing(scallop.max_mm.unwrap_or(0.0))
        });
        let stands = uncut.regions.first().filter(|region| {
            self.cut_away_below([region.at_mm[0], region.at_mm[1]], region.height_mm).is_none()
        });
        let region = stands.map_or(Bounded::default(), |region| Bounded {
            at_mm: Some(region.at_mm),
            ..standing(region.height_mm)
        });
        let known = if region.max_mm > ridge.max_mm { region } else { ridge };
        monitor.start("looking for the highest material", 0);
        // Where nothing is known to stand above the limit, all that may has to be divided to tell, and crowds
        // out what does.
        let is_closer = known.max_mm < limits.scallop && !self.inspection.is_first_look;
        let closer_above = if is_closer { limits.scallop } else { f64::INFINITY };
        let open =
            self.open(samples, [known.max_mm.min(limits.scallop), closer_above], &|_| true, monitor)?;
        // Moves that no cell saw, as they are found.
        let unseen = RwLock::default();
        // Uncut material stands above its limit for certain, so that no bound changes the verdict.
        let fails = |unreached: &Bounded| unreached.at_least_mm > limits.uncut;
        let sought = |known, kind, fails| self.highest(&open, known, kind, fails, &unseen, monitor);
        let highest = sought(known, Kind::Any, fails(&region))?;
        monitor::check(monitor)?;
        let (reached, unreached) = if highest.at_most() <= limits.scallop {
            // Whatever it is, it holds every limit.
            (highest, Bounded::new(0.0, highest.at_most()))
        } else {
            // Below its limit it is of no account.
            let floor = limits.uncut - self.inspection.asked.max(2.0 * NUMERICAL_FLOOR);
            let unreached = Bounded { max_mm: region.max_mm.max(floor), ..region };
            let found = sought(unreached, Kind::Unreached, fails(&region))?;
            monitor::check(monitor)?;
            let most = found.at_most();
            let found = if found.max_mm > unreached.max_mm { found } else { region };
            let unreached = Bounded { error_bound_mm: (most - found.max_mm).max(0.0), ..found };
            // Nothing at all is higher than a ridge, which passes reached, or than another place that they
            // did.
            let is_known = highest.max_mm <= ridge.max_mm || self.is_reached(&highest);
            let reached = if is_known { highest } else { sought(ridge, Kind::Reached, fails(&unreached))? };
            (reached, unreached)
        };
        // Moves that no cell saw came up only after the first search.
        let highest = if reached.max_mm > highest.max_mm { highest.or(&reached) } else { highest };
        // What is higher than all that passes came down to is uncut, also below its own limit.
        let is_uncut = unreached.max_mm >= highest.max_mm && unreached.max_mm > 0.0
            || highest.max_mm > reached.at_most();
        let unreached = if is_uncut { highest } else { unreached };
        let kind =
            if is_uncut { ExcessKind::Uncut } else { ExcessKind::of_reached(reached.max_mm, ridge.max_mm) };
        // Nothing high is known, and what is open will be looked at on finer cells.
        let is_low = reached.at_most() <= limits.scallop
            || self.inspection.is_first_look && reached.max_mm <= limits.scallop;
        let high = if is_low {
            Vec::new()
        } else {
            let squares = Promising::of(open.squares.into_iter(), MOST_HIGH_CELLS).squares;
            // Places are found no more closely.
            let high = (1.0 - HIGH_SLACK) * limits.scallop;
            let most = (self.most_places() / squares.len().max(1)).max(LEAST_LOOKS);
            let unseen = unseen.into_inner().unwrap_or_else(PoisonError::into_inner);
            self.high_places(&squares, high, most, &unseen, monitor)?
        };
        Ok((ExcessFigures { highest, kind, reached, unreached }, high))
    }

    /// One place of each cell, `among` those asked for, where passes came down to the design and left more
    /// than the scallop limit, or would by the last decimals of a program.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub fn places_above(
        &self,
        samples: &[Sample],
        among: &(dyn Fn(usize) -> bool + Sync),
        monitor: &dyn Monitor,
    ) -> Result<Vec<RidgePlace>, Cancelled> {
        monitor.start("looking for high material", 0);
        let high = self.inspection.limits.scallop - 2.0 * ROUNDING;
        let open = self.open(samples, [high, f64::INFINITY], among, monitor)?;
        // What is left out comes to light when all is measured.
        let most = (MOST_AT_FIRST / open.squares.len().max(1)).max(1);
        self.high_places(&open.squares, high, most, &[], monitor)
    }

    /// One place of each square where passes came down to the design and left more than is `high`, mm, the
    /// highest that is found there by no more than `most` looks, with the height that it may have at most.
    fn high_places(
        &self,
        squares: &[Square],
        high: f64,
        most: usize,
        unseen: &[u32],
        monitor: &dyn Monitor,
    ) -> Result<Vec<RidgePlace>, Cancelled> {
        let Inspection { part, limits, .. } = *self.inspection;
        let patches = self.patches(high, unseen);
        let slack = HIGH_SLACK * limits.scallop;
        let small = OTHER_KIND_SHARE * 0.5 * self.inspection.grid.cell;
        let found = work::parallel::try_map(squares.len(), |k| {
            monitor::check(monitor)?;
            let smallest = 0.5f64.powi(HIGH_DIVISIONS) * squares[k].half;
            let mut highest: Option<RidgePlace> = None;
            // What squares promise that are divided no further.
            let mut left = 0f64;
            let mut waiting = BinaryHeap::from([squares[k]]);
            for _ in 0..most {
                let known = highest.map_or(high, |highest| highest.height + slack);
                if waiting.peek().is_none_or(|square| square.possible <= known) {
                    break;
                }
                let Some(Square { possible, centre, half }) = waiting.pop() else { break };
                let (possible, is_open) = match patches.held(centre, half) {
                    Held::Nothing => continue,
                    Held::Unknown => (possible, true),
                    Held::Some { possible: its, place, here, by } => {
                        let possible = its.min(possible);
                        let rises = here > known;
                        let is_reached = rises && patches.reached(place, here, by);
                        if is_reached {
                            let design = part.highest_at(place.x, place.y);
                            highest = design.map(|design| RidgePlace { at: design.point, height: here });
                        }
                        let enough = here + if is_reached { slack } else { NUMERICAL_FLOOR };
                        // Where no pass came down to the design, all around is as high.
                        let is_uncut = rises && !is_reached && half <= small;
                        (possible, possible > known.max(enough) && !is_uncut)
                    }
                };
                if is_open && half > smallest {
                    waiting.extend(Square { possible, centre, half }.quarters());
                } else {
                    left = left.max(possible);
                }
            }
            // What was not looked at is rarely higher than around.
            let waits = waiting.peek().map_or(0.0, |square| square.possible);
            let most = |height: f64| height.max(left).max(waits.min(height + slack));
            Ok(highest.map(|place| RidgePlace { height: most(place.height), ..place }))
        })?;
        Ok(found.into_iter().flatten().collect())
    }

    /// The squares of cells, `among` those asked for, that may hold more than `known`, mm: those whose own
    /// move leaves more at a corner, those beside the part's border, and those whose centre cannot speak for
    /// them. Those that may hold more than `closer_above`, mm, are bounded by their quarters.
    fn open(
        &self,
        samples: &[Sample],
        [known, closer_above]: [f64; 2],
        among: &(dyn Fn(usize) -> bool + Sync),
        monitor: &dyn Monitor,
    ) -> Result<Promising, Cancelled> {
        let grid = &self.inspection.grid;
        let fine = self.finer_than_cells(grid);
        let row = |j: usize| {
            monitor::check(monitor)?;
            let patches = self.patches(known, &[]);
            let looked_at = (0..grid.nx).filter(|&i| {
                let k = grid.index(i, j);
                let on = !samples[k].deviation.is_nan();
                let may_hold =
                    || if on { f64::from(samples[k].top) > known } else { beside_part(grid, samples, i, j) };
                among(k) && (fine[k].load(Ordering::Relaxed) || may_hold())
            });
            let bounded = |square: Square| {
                let possible = match patches.held(square.centre, square.half) {
                    Held::Nothing => return None,
                    Held::Unknown => patches.most(),
                    Held::Some { possible, .. } => possible,
                };
                let possible = possible.min(square.possible);
                (possible > known).then_some(Square { possible, ..square })
            };
            let whole =
                |i| Square { possible: f64::INFINITY, centre: grid.centre(i, j), half: 0.5 * grid.cell };
            // As low as its quarters show; none where they hold nothing.
            let closer = |square: Square| {
                if square.possible <= closer_above {
                    return Some(square);
                }
                let possible = square.quarters().into_iter().filter_map(bounded).map(|part| part.possible);
                possible.max_by(f64::total_cmp).map(|possible| Square { possible, ..square })
            };
            Ok(looked_at.filter_map(|i| closer(bounded(whole(i))?)).collect::<Vec<_>>())
        };
        // Band by band, so that there are never many more squares than will be divided.
        let most = self.most_places().min(self.inspection.most_squares);
        let mut open = Promising::default();
        for first in (0..grid.ny).step_by(ROWS) {
            let rows = work::parallel::try_map(ROWS.min(grid.ny - first), |j| row(first + j))?;
            open.add(rows.into_iter().flatten(), (most / 4).max(1));
        }
        Ok(open)
    }

    fn most_places(&self) -> usize {
        if self.inspection.is_first_look { MOST_AT_FIRST } else { MOST }
    }

    fn patches<'b>(&'b self, least: f64, unseen: &'b [u32]) -> Patches<'b> {
        let stock_top = self.inspection.surface.cut.top;
        Patches { inspection: self.inspection, stock_top, least, unseen }
    }

    /// How far off the highest place may be, mm: nearer where it is to be told from its limit.
    fn asked(&self, known: f64, kind: Kind) -> f64 {
        let Inspection { limits, asked, .. } = *self.inspection;
        let limit = if kind == Kind::Unreached { limits.uncut } else { limits.scallop };
        if known < limit { asked.min(0.5 * (limit - known)).max(NUMERICAL_FLOOR) } else { asked }
    }

    /// The move that cuts away what stands so high, mm, on the design over a place.
    fn cut_away_below(&self, [x, y]: [f64; 2], height: f64) -> Option<u32> {
        let design = self.inspection.part.highest_at(x, y)?;
        self.inspection.every_move?.cuts_away_over(&design, height)
    }

    fn cuts_away(&self, at: &Point3) -> Option<u32> {
        self.inspection.every_move?.cuts_away(at)
    }

    /// Whether passes came down to the design at the highest place.
    fn is_reached(&self, highest: &Bounded) -> bool {
        let Some((at, every_move)) = highest.at_mm.zip(self.inspection.every_move) else { return false };
        let q = Point2::new(at[0], at[1]);
        let Inspection { part, surface, .. } = *self.inspection;
        let cut = part
            .highest_at(q.x, q.y)
            .and_then(|design| surface.along_normal_with(&design.point, &design.normal, every_move.over(q)));
        cut.is_some_and(|cut| self.patches(0.0, &[]).reached(q, highest.max_mm, cut.by))
    }

    /// Whether what stands so high, mm, on a place stands between the end of the part and the rim of a cutter
    /// that ends beside it by less than a program's rounding.
    fn is_foil(&self, place: Point2, height: f64) -> bool {
        /// Other material rises by no more than so many times the way aside.
        const SLOPE: f64 = 10.0;
        let below = height - SLOPE * 2.0 * ROUNDING;
        // Beside a step another level tells nothing of this one.
        let level = |q: Point2| self.inspection.part.highest_at(q.x, q.y).map(|design| design.point.z);
        let here = level(place);
        let is_level = |q: &Point2| {
            here.zip(level(*q)).is_some_and(|(here, there)| (there - here).abs() <= SLOPE * 2.0 * ROUNDING)
        };
        self.patches(0.0, &[]).ends_beside(place)
            && around(place, 2.0 * ROUNDING)
                .iter()
                .any(|q| is_level(q) && self.cut_away_below([q.x, q.y], below).is_some())
    }

    /// The highest place of a kind in some squares, if it is higher than `known`. Moves that are found to
    /// have cut away what seemed to be the highest are added to those that no cell saw. Where the part
    /// `fails` whatever is found, a bound that can decide no limit stays wide.
    fn highest(
        &self,
        open: &Promising,
        known: Bounded,
        kind: Kind,
        fails: bool,
        unseen: &RwLock<Vec<u32>>,
        monitor: &dyn Monitor,
    ) -> Result<Bounded, Cancelled> {
        let small = OTHER_KIND_SHARE * 0.5 * self.inspection.grid.cell;
        let at = |centre: Point2, half: f64| {
            let unseen = unseen.read().unwrap_or_else(PoisonError::into_inner);
            let patches = self.patches(known.max_mm, &unseen);
            // One that is told from the rest, and one whose height is.
            let is_foil = |possible: f64, place: Point2, here: f64| {
                half < LEAST_HALF
                    && (possible - here > STEEPEST * half && patches.ends_beside(centre)
                        || here > known.max_mm && self.is_foil(place, here))
            };
            let unknown = |place| (place, Value { here: f64::NEG_INFINITY, possible: patches.most() });
            match patches.held(centre, half) {
                Held::Nothing => None,
                Held::Unknown => Some(unknown(centre)),
                Held::Some { possible, place, here, .. } if is_foil(possible, place, here) => None,
                Held::Some { possible, place, here, by } => {
                    let value = Value { here, possible };
                    if kind == Kind::Any || possible <= known.max_mm {
                        return Some((place, value));
                    }
                    let reached = patches.reached(place, here, by);
                    if reached == (kind == Kind::Reached) {
                        Some((place, value))
                    } else if half <= small {
                        None
                    } else {
                        Some((place, Value { here: f64::NEG_INFINITY, possible }))
                    }
                }
            }
        };
        let squares = open.squares.iter().filter(|square| square.possible > known.max_mm).copied().collect();
        let whole = Effort::whole(self.most_places(), self.inspection.most_squares);
        let useful = match kind {
            _ if !fails || self.inspection.is_first_look => f64::INFINITY,
            Kind::Reached => self.inspection.limits.scallop,
            Kind::Any | Kind::Unreached => 0.0,
        };
        let most = Effort { useful, ..whole };
        let stands = |q: Point2, height: f64| match self.cut_away_below([q.x, q.y], height) {
            None => !self.is_foil(q, height),
            Some(by) => {
                let mut unseen = unseen.write().unwrap_or_else(PoisonError::into_inner);
                if unseen.len() < MOST_UNSEEN && !unseen.contains(&by) {
                    unseen.push(by);
                }
                false
            }
        };
        let asked = |highest| self.asked(highest, kind);
        let mut found = search(squares, known.max_mm, &asked, most, &at, &stands, monitor)?;
        found.possible = found.possible.max(open.others);
        let mut highest = match found.greatest {
            Some((height, q)) => {
                let z = self.inspection.part.highest_at(q.x, q.y).map_or(0.0, |design| design.point.z);
                Bounded { at_mm: Some([q.x, q.y, z]), ..standing(height) }
            }
            None => known,
        };
        highest.error_bound_mm = (found.possible - highest.max_mm).max(0.0) + NUMERICAL_FLOOR;
        Ok(highest)
    }

    /// The cells in which the part has details that their centres do not show: triangles narrower than two
    /// cells that bend away from their neighbours, or end.
    fn finer_than_cells(&self, grid: &Grid) -> Vec<AtomicBool> {
        /// Neighbours that turn by less, rad, are part of a bend that the cells' normals show.
        const BENT: f64 = 0.05;
        let cells: Vec<AtomicBool> = (0..grid.len()).map(|_| AtomicBool::new(false)).collect();
        let mesh = self.inspection.part.mesh();
        work::parallel::map(mesh.triangles().len(), |t| {
            let normal = mesh.normal(t);
            let [a, b, c] = mesh.corners(t);
            let longest = (b - a).norm().max((c - b).norm()).max((a - c).norm());
            let narrow = (b - a).cross(&(c - a)).norm() < 2.0 * grid.cell * longest;
            let bent = |k: usize| {
                mesh.neighbour(t, k).is_none_or(|other| mesh.normal(other).dot(&normal) < BENT.cos())
            };
            if !(normal.z > 0.0 && narrow && (0..3).any(bent)) {
                return;
            }
            let column = |x: f64, n: usize, origin: f64| {
                (((x - origin) / grid.cell + 0.5).floor().max(0.0) as usize).min(n.saturating_sub(1))
            };
            let row = |y: f64| column(y, grid.ny, grid.origin.y);
            let corners = [a, b, c].map(|p| p.xy());
            let [low, high] = ends(&corners, &|p| p.y);
            for j in row(low)..=row(high) {
                // Long triangles askew cross few cells of a row.
                let (centre, half) = (grid.centre(0, j).y, 0.5 * grid.cell);
                let within = [centre - half, centre + half];
                let places = (0..3).flat_map(|k| within_band(&corners[k], &corners[(k + 1) % 3], within));
                let [from, to] = ends(&places.collect::<Vec<_>>(), &|p| p.x);
                if from <= to {
                    for i in column(from, grid.nx, grid.origin.x)..=column(to, grid.nx, grid.origin.x) {
                        cells[grid.index(i, j)].store(true, Ordering::Relaxed);
                    }
                }
            }
        });
        cells
    }
}

/// What stands so high, mm, as all moves tell.
fn standing(height: f64) -> Bounded {
    Bounded { at_least_mm: (height - NUMERICAL_FLOOR).max(0.0), ..Bounded::new(height, 0.0) }
}

/// Least and greatest of a coordinate.
fn ends(points: &[Point2], of: &dyn Fn(&Point2) -> f64) -> [f64; 2] {
    points.iter().map(of).fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
}

/// The ends of the part of a side that lies in a band of y; none if no part does.
fn within_band(a: &Point2, b: &Point2, [low, high]: [f64; 2]) -> Vec<Point2> {
    let (from, to) = (a.y.min(b.y), a.y.max(b.y));
    if to < low || from > high {
        return Vec::new();
    }
    let at = |y: f64| if to > from { a + (b - a) * ((y.clamp(from, to) - a.y) / (b.y - a.y)) } else { *a };
    if to > from { vec![at(low), at(high)] } else { vec![*a, *b] }
}

/// Whether a cell whose centre is off the part has one beside it that is on it.
fn beside_part(grid: &Grid, samples: &[Sample], i: usize, j: usize) -> bool {
    let around = (j.saturating_sub(1)..=(j + 1).min(grid.ny - 1))
        .flat_map(|j| (i.saturating_sub(1)..=(i + 1).min(grid.nx - 1)).map(move |i| (i, j)));
    around.into_iter().any(|(i, j)| !samples[grid.index(i, j)].deviation.is_nan())
}

/// For walks over the part's boxes.
fn meets(node: &Node, centre: Point2, half: f64) -> bool {
    node.meets([centre.x - half, centre.y - half], [centre.x + half, centre.y + half])
}

#[cfg(test)]
mod tests;
