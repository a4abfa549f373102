//! Where the cuts of two passes meet on a line between two points: the ridge in closed form.
//!
//! Enters: the cut surface, and a line on whose ends it is known which move is lowest. Leaves: every place on
//! the line where the lowest move changes from one track to another, mm. Moves that are lowest only between
//! the ends are found on the way. Where passes are nearer to each other than cells, no cell may have seen the
//! pass between two others; so the tracks beside each meeting are asked, too.

use super::cut_surface::{CutPoint, CutSurface};
use super::tracks::Tracks;
use geometry::{Point2, Vector2};
use motion::{Cutters, Toolpath};
use sim::{Grid, MoveBins, NOT_CUT};

/// Two heights that differ by more than this, mm, do not meet.
const MEETING: f64 = 1e-6;

/// Ridges inside ridges (a pass that shows only between the ends): at most this deep.
const MOST_DEPTH: usize = 8;

/// A meeting is found to this share of the line.
const CROSSING: f64 = 1e-10;

/// What stands before an edge is asked for at this share of the line before it: more than [`CROSSING`].
/// Gaps narrower than this are not seen.
const EDGE: f64 = 1e-6;

/// Between two tracks the cut of a third is half as wide as they are apart. So where they are farther apart
/// than two cells, cells saw it; on curved parts it may be narrower.
const HIDDEN_WITHIN: f64 = 3.0;

/// Cells along the side of a bin of tracks.
const CELLS_PER_BIN: usize = 4;

/// Moves that a bin holds on average at most, several passes of them: all are asked at every place where
/// cells are coarser than that, and only the nearest can be lowest.
const MOVES_PER_BIN: f64 = 128.0;

/// A place where two cuts are equally high and none is lower.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Meeting {
    /// Share of the line.
    pub t: f64,
    /// Where, mm.
    pub at: Point2,
    /// Height, mm.
    pub z: f64,
    /// The moves that meet, in the order of the line.
    pub moves: [u32; 2],
}

/// Cells by which tips are sorted: those of a grid and around it, and no coarser than suits the moves.
fn grid_of_tips(grid: &Grid, radius: f64, path: &Toolpath) -> Grid {
    // A tip stands aside of its cut by no more than the radius.
    let margin = radius + grid.cell;
    let corner = grid.centre(0, 0) - Vector2::new(margin, margin);
    let size = Vector2::new(grid.nx as f64, grid.ny as f64) * grid.cell + Vector2::new(2.0, 2.0) * margin;
    // What a bin lists comes from as far around as hidden moves are sought.
    let window = CELLS_PER_BIN as f64 + HIDDEN_WITHIN;
    let all = [corner, corner + size];
    let [low, high] = path
        .moves
        .iter()
        .map(|m| m.to.tip.xy())
        .fold(all, |[low, high], tip| [low.inf(&tip), high.sup(&tip)]);
    let area = (high.x - low.x) * (high.y - low.y);
    let cell = (area * MOVES_PER_BIN / path.len().max(1) as f64).sqrt() / window;
    let cell = cell.min(grid.cell);
    let count = |length: f64| (length / cell).ceil() as usize;
    Grid { origin: corner, cell, nx: count(size.x), ny: count(size.y) }
}

/// Finds meetings on a cut surface.
pub struct Meetings<'a> {
    surface: &'a CutSurface<'a>,
    tracks: Tracks<'a>,
    /// The moves by the places of their tips.
    tips: MoveBins,
    /// Height of flat stock whose rim counts as a ridge, mm.
    stock: Option<f64>,
}

impl<'a> Meetings<'a> {
    /// On the surface that `path` has cut. With a height of `stock` the line along which a cut meets
    /// flat stock counts too.
    pub fn new(
        surface: &'a CutSurface<'a>,
        cutters: impl Into<Cutters>,
        path: &'a Toolpath,
        stock: Option<f64>,
    ) -> Self {
        let tracks = Tracks::new(path, cutters);
        let around = grid_of_tips(&surface.cut.grid, tracks.cutters().greatest_radius(), path);
        let tips = MoveBins::new(&around, CELLS_PER_BIN, 0.5 * HIDDEN_WITHIN * around.cell, path);
        Self { surface, tracks, tips, stock }
    }

    /// True when two moves belong to neighbouring tracks rather than to one.
    pub fn apart(&self, a: u32, b: u32) -> bool {
        if a == NOT_CUT || b == NOT_CUT {
            return a != b && self.stock.is_some();
        }
        self.tracks.apart(a, b)
    }

    /// The moves whose tips pass near a place of the plan.
    pub(crate) fn passing(&self, tip: Point2) -> &[u32] {
        self.tips.at(tip)
    }

    /// Hands to `found` the meetings between `a`, lowest at the share `ta` of the line `at`, and `b`,
    /// lowest at `tb`, in the order of the line.
    pub fn between(
        &self,
        at: &dyn Fn(f64) -> Point2,
        a: (f64, u32),
        b: (f64, u32),
        found: &mut dyn FnMut(Meeting),
    ) {
        self.search(at, a, b, MOST_DEPTH, found, &mut |_| {});
    }

    /// As [`Meetings::between`] where `a` and `b` met nearby: those between them and one that has come in
    /// between.
    pub fn again_between(
        &self,
        at: &dyn Fn(f64) -> Point2,
        a: (f64, u32),
        b: (f64, u32),
        found: &mut dyn FnMut(Meeting),
    ) {
        self.search(at, a, b, 1, found, &mut |_| {});
    }

    /// As [`Meetings::between`]; hands to `gap` the places between `a` and `b` that no move around reaches:
    /// stock stands there, or a move passes that no cell saw.
    pub fn between_or_gaps(
        &self,
        at: &dyn Fn(f64) -> Point2,
        a: (f64, u32),
        b: (f64, u32),
        found: &mut dyn FnMut(Meeting),
        gap: &mut dyn FnMut(Point2),
    ) {
        self.search(at, a, b, MOST_DEPTH, found, gap);
    }

    fn search(
        &self,
        at: &dyn Fn(f64) -> Point2,
        (ta, a): (f64, u32),
        (tb, b): (f64, u32),
        depth: usize,
        found: &mut dyn FnMut(Meeting),
        gap: &mut dyn FnMut(Point2),
    ) {
        if !self.apart(a, b) {
            return;
        }
        let t = self.crossing(at, (ta, a), (tb, b));
        let q = at(t);
        let (za, zb) = (self.height(a, q), self.height(b, q));
        let Some(mut lowest) = self.surface.at(q.x, q.y) else { return gap(q) };
        // Neighbours in the program of both, which no cell may have seen where moves are short.
        for (by, z) in [(a, za), (b, zb)] {
            let beside = self.surface.follow(CutPoint { z, by }, q.x, q.y);
            lowest = if beside.z < lowest.z { beside } else { lowest };
        }
        lowest = self.hidden(q, za.max(zb), [a, b]).filter(|hidden| hidden.z < lowest.z).unwrap_or(lowest);
        // Another move is lower at the crossing: it stands between the two.
        let third = lowest.z < za.min(zb) - 1e-9 && lowest.by != a && lowest.by != b;
        if third && self.surface.pass(lowest.by).is_some() {
            if depth > 0 {
                self.search(at, (ta, a), (t, lowest.by), depth - 1, found, gap);
                self.search(at, (t, lowest.by), (tb, b), depth - 1, found, gap);
            }
        } else if za.is_finite() && zb.is_finite() && (za - zb).abs() <= MEETING {
            found(Meeting { t, at: q, z: za.max(zb), moves: [a, b] });
        } else if za.is_infinite() != zb.is_infinite() {
            // The crossing is where `b` begins, if `a` has not ended there at the latest.
            let before = at((t - EDGE).max(ta));
            let ended = |by| self.height(by, before).is_infinite();
            if ended(a) && ended(b) && self.surface.at(before.x, before.y).is_none() {
                return gap(before);
            }
            // A cutter with a flat ends in a wall: the ridge is its edge.
            found(Meeting { t, at: q, z: za.min(zb), moves: [a, b] });
        }
    }

    /// The lowest cut at a place where two tracks meet that are so near to each other that no cell may have
    /// seen another between them.
    fn hidden(&self, q: Point2, z: f64, moves: [u32; 2]) -> Option<CutPoint> {
        let envelope = &self.surface.envelope;
        let tip = |by: u32| {
            let cut = if by == NOT_CUT { None } else { envelope.height_and_normal(by, q.x, q.y) };
            cut.map(|(_, normal)| q + self.tracks.cutters().of_move(by).contact_to_tip(&normal).xy())
        };
        let [a, b] = [tip(moves[0])?, tip(moves[1])?];
        if (b - a).norm() > HIDDEN_WITHIN * self.surface.cut.grid.cell {
            return None;
        }
        let (lowest, by) = envelope.lowest(q.x, q.y, self.passing(a + (b - a) * 0.5))?;
        (lowest < z).then_some(CutPoint { z: lowest, by })
    }

    /// Height of the cut of `by`, infinite where it does not pass.
    fn height(&self, by: u32, q: Point2) -> f64 {
        let height = if by == NOT_CUT { self.stock } else { self.surface.envelope.height(by, q.x, q.y) };
        height.unwrap_or(f64::INFINITY)
    }

    /// Where the cuts of `a` and `b` are equally high, by bisection and regula falsi (Illinois).
    fn crossing(&self, at: &dyn Fn(f64) -> Point2, (mut ta, a): (f64, u32), (mut tb, b): (f64, u32)) -> f64 {
        let difference = |t: f64| {
            let q = at(t);
            match (self.height(a, q), self.height(b, q)) {
                (_, f64::INFINITY) => f64::NEG_INFINITY,
                (za, zb) => za - zb,
            }
        };
        let (mut fa, mut fb) = (difference(ta), difference(tb));
        if fa >= 0.0 {
            return ta;
        }
        if fb <= 0.0 {
            return tb;
        }
        let mut side = 0i8;
        for _ in 0..100 {
            if tb - ta < CROSSING {
                break;
            }
            let secant = ta + (tb - ta) * (fa / (fa - fb));
            let t = if secant > ta && secant < tb { secant } else { 0.5 * (ta + tb) };
            let f = difference(t);
            if f.abs() < 1e-13 {
                return t;
            }
            if f < 0.0 {
                (ta, fa) = (t, f);
                if side == -1 && fb.is_finite() {
                    fb *= 0.5;
                }
                side = -1;
            } else {
                (tb, fb) = (t, f);
                if side == 1 && fa.is_finite() {
                    fa *= 0.5;
                }
                side = 1;
            }
        }
        0.5 * (ta + tb)
    }
}

#[cfg(test)]
mod tests {
    use crate::figures::Limits;
    use crate::flat_scene::{path, plane};
    use crate::{Asked, measure};
    use cutter::Cutter;
    use geometry::Point3;
    use sim::{Grid, ZMap, cut};
    use work::monitor::Silent;

    /// Passes about as far apart as the cells, and much nearer: every one of them leaves its ridge, though no
    /// cell saw it.
    #[test]
    fn passes_that_no_cell_saw_leave_their_ridges() {
        let ([x, y], cell) = ([6.0, 5.0], 0.1);
        let (part, ball) = (plane([x, y]), Cutter::ball(6.0).unwrap());
        let limits = Limits { scallop: 0.01, gouge: 0.005, uncut: 0.05, chord: 0.001 };
        for step in [0.031, 0.06, 0.09, 0.093, 0.0951, 0.097, 0.0999, 0.1, 0.1003, 0.103, 0.107, 0.11, 0.15] {
            let passes = (-2..=(y / step) as i32 + 3).map(|k| {
                let y = step * f64::from(k);
                [[-5.0, 9.0], [-5.0, 0.0], [11.0, 0.0], [11.0, 9.0]]
                    .map(|[x, z]| Point3::new(x, y, z))
                    .to_vec()
            });
            let path = path(&passes.collect::<Vec<_>>());
            let grid = Grid::covering(&part.bounds(), cell, 64, 1 << 30).unwrap();
            let cut = cut(ZMap::block(grid, 1.0), &ball, &path, &Silent).unwrap();
            let asked = Asked {
                allowed_depth: 0.0,
                error_bound: 5e-4,
                border_cuts: true,
                steep_elsewhere: false,
                most_cells: 1 << 20,
                most_squares: 1 << 20,
                is_first_look: false,
            };
            let found = measure(&part, &ball, &path, &cut, &limits, &asked, &Silent).unwrap();
            let (scallop, closed) = (&found.scallop, 3.0 - (9.0f64 - 0.25 * step * step).sqrt());
            for height in [scallop.max_mm, scallop.p95_mm, scallop.p50_mm, scallop.mean_mm] {
                assert!((height.unwrap() - closed).abs() < 1e-8, "{step}: {closed} {scallop:?}");
            }
            // A ridge counts where it crosses from cell to cell: from the first centre to the last.
            let length = x * (y - cell) / step;
            assert!((scallop.ridge_length_mm / length - 1.0).abs() < 0.03, "{step}: {length} {scallop:?}");
            assert_eq!(scallop.over_target_fraction, Some(0.0));
            // Heights of parabolas between ridges.
            let rms = closed / 5f64.sqrt();
            assert!(
                (found.deviation.rms_mm.unwrap() / rms - 1.0).abs() < 0.02,
                "{step}: {rms} {:?}",
                found.deviation
            );
            assert!(found.excess.highest.max_mm <= closed + 1e-6, "{step}: {:?}", found.excess);
        }
    }
}
