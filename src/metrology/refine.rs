//! Looks closer, on finer cells, where the cells of the stock may have missed something.
//!
//! Enters: what was measured on the stock's grid, places where a move or stock may stand between the
//! centres, and the path. Around these places small rectangles of stock are cut and measured anew at half
//! the cell, and again at half of that, until the moves there are seen. Leaves: the greatest figures and
//! their bounds, merged. mm.
//!
//! Areas, volumes and shares remain those of the grid; a place that no cell of the grid saw adds the
//! region that is seen of it in its rectangle. Whether such a place is uncut or a scallop is decided
//! within the rectangle, by the rule for the whole and the highest ridge of the whole.

use std::collections::BTreeMap;

use super::figures::{CloserLook, Measurement, NUMERICAL_FLOOR};
use super::inspected::{Inspected, inspect};
use super::inspection::{Inspection, Within};
use super::meetings::Meetings;
use super::ridges::Hidden;
use super::unseen::{Dip, most_unseen};
use geometry::Point2;
use motion::Toolpath;
use sim::{CutError, Grid, Shape, cut, cut_in_turn};
use work::monitor::{self, Monitor};

/// Cells of the grid along the side of a rectangle. More are cut for nothing around a place; fewer share
/// less of what each rectangle costs, which grows with the moves of the path.
const SIDE: usize = 8;

/// Halvings of the cell at most: 1/64 of it. Each takes four times the cells.
const MOST_HALVINGS: u32 = 6;

/// Rectangles at most, those that may hold most first. With fewer, wide bounds stay where much is hidden;
/// each takes some ms.
const MOST_RECTANGLES: usize = 256;

/// What is asked of a measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Asked {
    /// Error bound of the highest scallop, the deepest gouge and the highest uncut place, mm.
    pub error_bound: f64,
    /// A gouge that is shown to be no deeper than this, mm, need not be known as closely; 0 where all are to be.
    pub allowed_depth: f64,
    /// Whether cuts beside the part's borders are looked for. Beside the floor of a pocket stand its walls,
    /// which tell theirs.
    pub border_cuts: bool,
    /// Cells that may be held beside those of the stock at a time.
    pub most_cells: usize,
    /// Squares that a search between cell centres may hold at a time.
    pub most_squares: usize,
    /// Whether finer cells follow where this measurement leaves a limit open: then it gives up early.
    pub is_first_look: bool,
    /// Whether steep faces are measured along their normals beside this
    /// ([`crate::Coverage::measure_unseen`]): what cells see of them counts, and bounds do not cover them.
    pub steep_elsewhere: bool,
}

/// What a rectangle may hold, mm.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Suspicion {
    /// Height of material that no cell saw, at most.
    height: f64,
    /// Depth at which the cutter stood in the design.
    depth: f64,
    /// The same between the places where that was looked at.
    deeper: f64,
}

/// The greatest heights and depths so far, and what they may be at most, mm.
#[derive(Debug, Clone, Copy)]
struct GreatestSoFar {
    height: f64,
    possible_height: f64,
    depth: f64,
    possible_depth: f64,
    ridge: f64,
    possible_ridge: f64,
}

pub(super) struct Refinement<'a> {
    /// On the stock's grid.
    pub coarse: &'a Inspection<'a>,
    pub path: &'a Toolpath,
    pub asked: &'a Asked,
    /// The highest ridge on that grid, mm.
    pub highest_ridge: f64,
}

impl Refinement<'_> {
    /// Refines `measured` around the places that are hidden and the dips.
    pub fn run(
        &self,
        hidden: &[Hidden],
        dips: &[Dip],
        measured: &mut Measurement,
        monitor: &dyn Monitor,
    ) -> Result<CloserLook, CutError> {
        let bound = self.asked.error_bound;
        let mut refined = CloserLook { finest_cell: self.coarse.grid.cell, ..CloserLook::default() };
        let scallop = measured.scallop.max_mm.unwrap_or(0.0);
        let mut greatest = GreatestSoFar {
            height: measured.uncut.max_height_mm,
            possible_height: measured.uncut.max_height_mm + measured.uncut.error_bound_mm - NUMERICAL_FLOOR,
            depth: measured.gouge.max_depth_mm,
            possible_depth: measured.gouge.max_depth_mm + measured.gouge.error_bound_mm - NUMERICAL_FLOOR,
            ridge: scallop,
            possible_ridge: scallop + measured.scallop.error_bound_mm.unwrap_or(0.0) - NUMERICAL_FLOOR,
        };
        let tiles = self.tiles(hidden, dips);
        if !tiles.is_empty() {
            monitor.start("looking closer", tiles.len().min(MOST_RECTANGLES) as u64);
        }
        for (tile, suspicion) in tiles {
            monitor::check(monitor)?;
            let open = self.open(&suspicion, &greatest, 0.0);
            if open && refined.rectangles < MOST_RECTANGLES {
                refined.rectangles += 1;
                self.look(tile, suspicion, measured, &mut greatest, &mut refined, monitor)?;
                monitor.advance(1);
            } else {
                let height = if open { suspicion.height } else { 0.0 };
                greatest.possible_height = greatest.possible_height.max(height);
                greatest.possible_depth = greatest.possible_depth.max(suspicion.deeper);
            }
        }
        let (uncut, gouge) = (&mut measured.uncut, &mut measured.gouge);
        uncut.error_bound_mm = (greatest.possible_height - uncut.max_height_mm).max(0.0) + NUMERICAL_FLOOR;
        gouge.error_bound_mm = (greatest.possible_depth - gouge.max_depth_mm).max(0.0) + NUMERICAL_FLOOR;
        uncut.regions.sort_by(|a, b| b.height_mm.total_cmp(&a.height_mm));
        gouge.regions.sort_by(|a, b| b.depth_mm.total_cmp(&a.depth_mm));
        let area = measured.deviation.area_mm2;
        uncut.fraction = if area > 0.0 { uncut.area_mm2 / area } else { 0.0 };
        let possible = greatest.possible_ridge.max(greatest.ridge);
        measured.scallop.error_bound_mm =
            measured.scallop.max_mm.map(|height| possible - height + NUMERICAL_FLOOR);
        refined.note = open_bounds(measured, bound, self.coarse.grid.cell);
        Ok(refined)
    }

    /// True where a rectangle of cells of `cell` mm (0 before it is cut) may hold more than is known.
    fn open(&self, suspicion: &Suspicion, greatest: &GreatestSoFar, cell: f64) -> bool {
        let asked = self.asked.error_bound;
        let seen = cell > 0.0 && most_unseen(self.coarse.cutters, cell) <= asked;
        let depth = if seen { suspicion.depth } else { suspicion.deeper };
        suspicion.height > greatest.height.max(self.coarse.limits.uncut) + asked
            || depth > greatest.depth + asked
    }

    /// What each tile may hold, the most suspicious first.
    fn tiles(&self, hidden: &[Hidden], dips: &[Dip]) -> Vec<([usize; 2], Suspicion)> {
        let mut tiles: BTreeMap<[usize; 2], Suspicion> = BTreeMap::new();
        let mut add = |q: Point2, s: Suspicion| {
            if let Some((i, j)) = self.coarse.grid.cell_at(q.x, q.y) {
                let tile = tiles.entry([j / SIDE, i / SIDE]).or_default();
                tile.height = tile.height.max(s.height);
                tile.depth = tile.depth.max(s.depth);
                tile.deeper = tile.deeper.max(s.deeper);
            }
        };
        for place in hidden {
            let (q, height) = self.height(place);
            add(q, Suspicion { height, ..Suspicion::default() });
        }
        for dip in dips {
            add(dip.at, Suspicion { height: 0.0, depth: dip.depth, deeper: dip.possible });
        }
        let mut tiles: Vec<_> = tiles.into_iter().collect();
        // A stable sort: equals stay row by row.
        tiles.sort_by(|a, b| (b.1.height + b.1.deeper).total_cmp(&(a.1.height + a.1.deeper)));
        tiles
    }

    /// Where a hidden place is, and how high the material may be there.
    fn height(&self, place: &Hidden) -> (Point2, f64) {
        match *place {
            Hidden::Ridge(q, height) => (q, height),
            Hidden::Gap(q) => {
                let design = self.coarse.part.highest_at(q.x, q.y);
                let shape = self.coarse.surface.cut.shape.as_ref();
                let within = |shape: &Shape| shape.highest_within(q.x, q.y, self.coarse.grid.cell);
                let top = shape.map_or(self.coarse.surface.cut.top, within);
                (q, design.map_or(0.0, |d| (top - d.point.z) * d.normal.z))
            }
        }
    }

    /// Cuts and measures a tile at half the cell and less, and merges what is found.
    fn look(
        &self,
        [tj, ti]: [usize; 2],
        suspicion: Suspicion,
        measured: &mut Measurement,
        greatest: &mut GreatestSoFar,
        refined: &mut CloserLook,
        monitor: &dyn Monitor,
    ) -> Result<(), CutError> {
        let grid = &self.coarse.grid;
        // One cell more on every side, for the surroundings.
        let span = |t: usize, n: usize| ((t * SIDE).saturating_sub(1), ((t + 1) * SIDE + 1).min(n));
        let ((i0, i1), (j0, j1)) = (span(ti, grid.nx), span(tj, grid.ny));
        let mut rest = suspicion;
        let mut last = None;
        for halvings in 1..=MOST_HALVINGS {
            let parts = 1 << halvings;
            let (nx, ny) = ((i1 - i0) * parts, (j1 - j0) * parts);
            if nx * ny > self.asked.most_cells {
                break;
            }
            let cell = grid.cell / parts as f64;
            let corner = 0.5 * (grid.cell - cell);
            let origin = grid.centre(i0, j0) - geometry::Vector2::new(corner, corner);
            let fine = Grid { origin, cell, nx, ny };
            let (found, hidden) = self.measure(fine, monitor)?;
            refined.finest_cell = refined.finest_cell.min(cell);
            let now = GreatestSoFar {
                height: greatest.height.max(found.uncut.max_height_mm),
                depth: greatest.depth.max(found.gouge.max_depth_mm),
                ..*greatest
            };
            rest.height = hidden;
            // What these cells may have missed in turn.
            let missed = most_unseen(self.coarse.cutters, cell);
            rest.deeper = rest.deeper.min(found.gouge.max_depth_mm + found.gouge.error_bound_mm + missed);
            last = Some(found);
            if !self.open(&rest, &now, cell) {
                rest.height = 0.0;
                break;
            }
        }
        let limits = self.coarse.limits;
        let seen = |test: &dyn Fn(f64) -> bool| {
            (j0..j1).any(|j| (i0..i1).any(|i| test(measured.deviation_map[grid.index(i, j)].into())))
        };
        let (high, deep) = (seen(&|d| d > limits.uncut), seen(&|d| d < -limits.gouge));
        greatest.possible_height = greatest.possible_height.max(rest.height);
        greatest.possible_depth = greatest.possible_depth.max(rest.deeper);
        let Some(found) = last else { return Ok(()) };
        greatest.merge(&found);
        let (uncut, gouge, scallop) = (&mut measured.uncut, &mut measured.gouge, &mut measured.scallop);
        if let Some(region) =
            found.uncut.regions.first().filter(|_| found.uncut.max_height_mm > uncut.max_height_mm)
        {
            uncut.max_height_mm = found.uncut.max_height_mm;
            if !high {
                uncut.area_mm2 += region.area_mm2;
                uncut.volume_mm3 += region.volume_mm3;
                uncut.region_count += 1;
                uncut.regions.push(*region);
            }
        }
        if found.gouge.max_depth_mm > gouge.max_depth_mm {
            gouge.max_depth_mm = found.gouge.max_depth_mm;
            if let (Some(region), false) = (found.gouge.regions.first(), deep) {
                // What the search between the centres found here was a part of it.
                let here = |at: &[f64; 3]| {
                    grid.cell_at(at[0], at[1])
                        .is_some_and(|(i, j)| (i0..i1).contains(&i) && (j0..j1).contains(&j))
                };
                let before = gouge.regions.len();
                gouge.regions.retain(|known| known.area_mm2 > 0.0 || !here(&known.at_mm));
                gouge.region_count -= before - gouge.regions.len();
                gouge.area_mm2 += region.area_mm2;
                gouge.region_count += 1;
                gouge.regions.push(region.clone());
            }
        }
        if let (Some(highest), Some(max)) = (found.highest, scallop.max_mm)
            && highest.height > max
        {
            (scallop.max_mm, scallop.max_at_mm) = (Some(highest.height), Some(highest.at.into()));
        }
        Ok(())
    }

    /// What is measured on a fine grid, and how high material may be that its cells missed as well.
    fn measure(&self, fine: Grid, monitor: &dyn Monitor) -> Result<(Inspected, f64), CutError> {
        let (coarse, within) = (self.coarse, Within(monitor));
        let stock = coarse.surface.cut.uncut(fine, &within)?;
        let cut = cut_in_turn(cut, stock, coarse.cutters, self.path, &within)?;
        let surface = coarse.surface.with_cut(&cut);
        let meetings = &Meetings::new(&surface, coarse.cutters, self.path, None);
        let inspection = Inspection { surface: &surface, meetings, grid: fine, ..*coarse };
        let found = inspect(&inspection, self.path, self.highest_ridge, &within)?;
        let hidden = found.ridges.hidden.iter().map(|place| self.height(place).1).fold(0.0, f64::max);
        Ok((found, hidden))
    }
}

impl GreatestSoFar {
    fn merge(&mut self, found: &Inspected) {
        let (uncut, gouge) = (&found.uncut, &found.gouge);
        self.height = self.height.max(uncut.max_height_mm);
        self.possible_height =
            self.possible_height.max(uncut.max_height_mm + uncut.error_bound_mm - NUMERICAL_FLOOR);
        self.depth = self.depth.max(gouge.max_depth_mm);
        self.possible_depth =
            self.possible_depth.max(gouge.max_depth_mm + gouge.error_bound_mm - NUMERICAL_FLOOR);
        if let Some(highest) = found.highest {
            self.ridge = self.ridge.max(highest.height);
            self.possible_ridge = self.possible_ridge.max(highest.possible);
        }
    }
}

/// Says which bounds exceed the asked one, and the cell that would hold them: a bound shrinks at least as
/// the cell does.
pub(super) fn open_bounds(measured: &Measurement, asked: f64, cell: f64) -> Option<String> {
    let bounds = [
        ("highest scallop", measured.scallop.error_bound_mm.unwrap_or(0.0)),
        ("deepest gouge", measured.gouge.error_bound_mm),
        ("highest uncut place", measured.uncut.error_bound_mm),
    ];
    // The floor is there in any case.
    let open: Vec<_> = bounds.iter().filter(|(_, bound)| *bound > asked + 2.0 * NUMERICAL_FLOOR).collect();
    let widest = open.iter().map(|(_, bound)| *bound).fold(0.0, f64::max);
    if open.is_empty() {
        return None;
    }
    let words: Vec<String> = open.iter().map(|(what, bound)| format!("the {what} {bound:.2e} mm")).collect();
    Some(format!(
        "the error bound asked for is {asked:.2e} mm, and there remains that of {}; a cell of about {:.1e} mm may hold it",
        words.join(", of "),
        cell * asked / widest
    ))
}
