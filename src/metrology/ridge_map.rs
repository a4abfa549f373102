//! The ridges of a cut surface and the remnants along its borders, and nothing else: what a planner is
//! corrected by.

use super::coverage::STEEP;
use super::cut_surface::CutSurface;
use super::excess::ExcessSearch;
use super::figures::{Limits, NUMERICAL_FLOOR, RidgePlace, ScallopFigures};
use super::inspection::{Inspection, Sample};
use super::meetings::Meetings;
use super::ridges::{Highest, RidgeFinder, scallop_figures};
use geometry::{Point2, Point3, Vector2};
use motion::{Cutters, ROUNDING, Toolpath};
use part::Part;
use sim::{Envelope, Grid, ZMap};
use work::monitor::{Cancelled, Monitor};

/// Most places that all moves are asked at.
const MOST_ASKED: usize = 256;

/// All ridges of a cut surface.
#[derive(Debug, Clone, PartialEq)]
pub struct RidgeMap {
    /// Places near the scallop limit and above it, where a ridge crosses from a cell to the next; above it,
    /// sides of cells along the borders.
    pub above: Vec<RidgePlace>,
    /// The highest remnant along a border, mm.
    pub border: f64,
    /// Their figures, with the bound of the highest.
    pub scallop: ScallopFigures,
    /// Whether the highest was looked at closer.
    pub is_close: bool,
}

/// The ridges of `cut`, the stock after `path`; the highest is looked at closer until its bound is `asked`
/// mm, if it comes down to that. `None` where cells are too coarse for it: moves that none of them saw cut
/// all high places away.
pub(super) fn ridge_map(
    part: &Part,
    cutters: &Cutters,
    path: &Toolpath,
    cut: &ZMap,
    limits: &Limits,
    asked: f64,
    monitor: &dyn Monitor,
) -> Result<Option<RidgeMap>, Cancelled> {
    let surface = CutSurface::new(Envelope::new(cutters, path), cut, path);
    let meetings = Meetings::new(&surface, cutters, path, None);
    let inspection = on_cells(part, cutters, limits, asked, &surface, &meetings);
    let samples = inspection.samples(monitor)?;
    let finder = RidgeFinder::new(&inspection, path);
    let mut ridges = finder.find(&|k| samples[k].deviation, monitor)?;
    let mut highest = finder.highest(&mut ridges, asked, monitor)?;
    let all = (0..path.len() as u32).collect::<Vec<_>>();
    let as_left = |tops: &mut Vec<Top>| as_left(tops, &inspection, &all);
    let of_ridges = ridges
        .above
        .iter()
        .copied()
        .chain(highest.map(|Highest { at, height, .. }| RidgePlace { at, height }));
    let mut tops: Vec<Top> = of_ridges.map(|place| Top { place, at: place.at }).collect();
    if !as_left(&mut tops) {
        return Ok(None);
    }
    if let Some(highest) = &mut highest {
        let others = tops.iter().map(|top| (top.place.height, top.at));
        let top = others.chain(ridges.highest_up_to(limits.scallop)).max_by(|a, b| a.0.total_cmp(&b.0));
        (highest.height, highest.at) = top.unwrap_or((highest.height, highest.at));
    }
    let scallop = scallop_figures(&ridges.samples, highest, limits);
    let of_borders = borders(&inspection, &samples).into_iter().filter_map(|place| {
        let design = part.highest_at(place.at.x, place.at.y)?;
        Some(Top { place, at: design.point + design.normal * place.height })
    });
    let mut of_borders: Vec<Top> = of_borders.collect();
    as_left(&mut of_borders);
    let border = of_borders.iter().map(|top| top.place.height).fold(0.0, f64::max);
    tops.extend(of_borders.into_iter().filter(|top| top.place.height > limits.scallop));
    let above = tops.into_iter().map(|top| top.place).collect();
    Ok(Some(RidgeMap { above, border, scallop, is_close: true }))
}

/// What stands above the scallop limit, or would by the last decimals of a program, also between the places
/// that a map of ridges holds: one place of each cell that a ridge near the limit crosses, or that lies along
/// a border, with the height that it may have at most.
pub(super) fn places_above(
    part: &Part,
    cutters: &Cutters,
    path: &Toolpath,
    cut: &ZMap,
    limits: &Limits,
    most_squares: usize,
    monitor: &dyn Monitor,
) -> Result<Vec<RidgePlace>, Cancelled> {
    let surface = CutSurface::new(Envelope::new(cutters, path), cut, path);
    let meetings = Meetings::new(&surface, cutters, path, None);
    let inspection = on_cells(part, cutters, limits, NUMERICAL_FLOOR, &surface, &meetings);
    let inspection = Inspection { most_squares, ..inspection };
    let samples = inspection.samples(monitor)?;
    let search = ExcessSearch { inspection: &inspection };
    // A ridge rises by little from a line of cells to the next, but where it ends.
    let ridges = RidgeFinder::new(&inspection, path).find(&|k| samples[k].deviation, monitor)?;
    let grid = cut.grid;
    let mut is_near = vec![false; grid.len()];
    for place in &ridges.above {
        // The cells on both sides, whichever line the ridge crosses.
        let half = 0.5 * grid.cell;
        for (x, y) in [(-half, 0.0), (half, 0.0), (0.0, -half), (0.0, half)] {
            let (i, j) = grid.nearest_cell(place.at.x + x, place.at.y + y);
            is_near[grid.index(i, j)] = true;
        }
    }
    for k in 0..grid.len() {
        let (i, j) = (k % grid.nx, k / grid.nx);
        is_near[k] |= on_part(&grid, &samples, i, j) && ending_sides(&grid, &samples, i, j).next().is_some();
    }
    let found = search.places_above(&samples, &|k| is_near[k], monitor)?;
    // Moves that no cell saw may have cut them away.
    let all: Vec<u32> = (0..path.len() as u32).collect();
    let stands = work::parallel::map(found.len(), |k| {
        let design = part.closest_point(&found[k].at).0;
        let left = surface.along_normal_with(&design.point, &design.normal, &all);
        left.is_some_and(|left| left.distance > limits.scallop - 2.0 * ROUNDING)
    });
    Ok(found.into_iter().zip(stands).filter_map(|(place, stands)| stands.then_some(place)).collect())
}

/// An inspection that searches nothing between the centres of cells.
pub(super) fn on_cells<'a>(
    part: &'a Part,
    cutters: &'a Cutters,
    limits: &'a Limits,
    asked: f64,
    surface: &'a CutSurface<'a>,
    meetings: &'a Meetings<'a>,
) -> Inspection<'a> {
    let grid = surface.cut.grid;
    Inspection {
        part,
        cutters,
        limits,
        asked,
        allowed_depth: 0.0,
        most_squares: 0,
        is_first_look: false,
        surface,
        meetings,
        grid,
        steepest: STEEP,
        creases: None,
        borders: None,
        walls: None,
        every_move: None,
    }
}

/// A place and the highest point over it, mm.
#[derive(Debug, Clone, Copy)]
struct Top {
    place: RidgePlace,
    at: Point3,
}

/// Gives the highest places, and the others above the limit, the heights that all moves left there: some pass
/// between coarse cells and no cell saw them. False where none is as high as it was found to be.
fn as_left(tops: &mut [Top], inspection: &Inspection<'_>, all: &[u32]) -> bool {
    let Inspection { part, limits, asked, surface, .. } = *inspection;
    tops.sort_by(|a, b| b.place.height.total_cmp(&a.place.height));
    let above = tops.partition_point(|top| top.place.height > limits.scallop);
    let count = above.clamp(1, MOST_ASKED).min(tops.len());
    let left = work::parallel::map(count, |k| {
        let Top { place, at } = tops[k];
        let z = surface.height_of(all, &at);
        if z >= at.z - NUMERICAL_FLOOR {
            place.height
        } else {
            part.closest_point(&Point3::new(at.x, at.y, z)).1
        }
    });
    let mut is_seen = tops.is_empty();
    for (top, left) in tops.iter_mut().zip(left) {
        is_seen |= left >= top.place.height - asked;
        top.place.height = left;
    }
    is_seen
}

/// What stands at the outer sides of the cells that lie at the part's border. What is higher than the uncut
/// tolerance is no remnant of a pass.
pub(super) fn borders(inspection: &Inspection<'_>, samples: &[Sample]) -> Vec<RidgePlace> {
    let Inspection { grid, limits, .. } = *inspection;
    let of_row = |j: usize| {
        let cells = (0..grid.nx).filter(|&i| on_part(&grid, samples, i, j));
        let sides = cells.flat_map(|i| ending_sides(&grid, samples, i, j).map(move |side| (i, side)));
        sides.filter_map(|(i, side)| inspection.at_side(grid.centre(i, j), side)).collect::<Vec<_>>()
    };
    let rows = work::parallel::map(grid.ny, of_row);
    rows.into_iter().flatten().filter(|p| p.height > 0.0 && p.height <= limits.uncut).collect()
}

/// Whether a cell's centre lies over the part.
fn on_part(grid: &Grid, samples: &[Sample], i: usize, j: usize) -> bool {
    i < grid.nx && j < grid.ny && !samples[grid.index(i, j)].deviation.is_nan()
}

/// The directions in which no cell over the part lies beside a cell.
fn ending_sides<'a>(
    grid: &'a Grid,
    samples: &'a [Sample],
    i: usize,
    j: usize,
) -> impl Iterator<Item = [f64; 2]> + 'a {
    // Before the first cell there is none: the index wraps around to one far beyond the last.
    let beside = move |(di, dj): &(isize, isize)| (i.wrapping_add_signed(*di), j.wrapping_add_signed(*dj));
    let sides = [(-1, 0), (1, 0), (0, -1), (0, 1)].into_iter();
    let ends = sides.filter(move |side| {
        let (i, j) = beside(side);
        !on_part(grid, samples, i, j)
    });
    ends.map(|(di, dj)| [di as f64, dj as f64])
}

impl Inspection<'_> {
    /// What stands where the part ends on the way from a centre to the side of its cell.
    fn at_side(&self, centre: Point2, [x, y]: [f64; 2]) -> Option<RidgePlace> {
        /// Halvings of the way: to a thousandth of a cell.
        const HALVINGS: i32 = 10;
        let half = 0.5 * self.grid.cell;
        let design = |share: f64| {
            let q = centre + Vector2::new(x, y) * (share * half);
            self.part.highest_at(q.x, q.y)
        };
        let mut share = 0.0;
        for halving in 0..=HALVINGS {
            let farther = share + 0.5f64.powi(halving);
            share = if farther < 1.0 && design(farther).is_some() { farther } else { share };
        }
        let design = design(share)?;
        let cut = self.surface.along_normal(&design.point, &design.normal)?;
        Some(RidgePlace { at: design.point, height: cut.distance })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flat_scene::{path, plane};
    use cutter::Cutter;
    use sim::cut_reference;
    use work::monitor::Silent;

    /// Passes along y, the last of them 0.3 mm from the border.
    #[test]
    fn what_stands_along_borders_is_as_high_as_its_closed_form() {
        let (part, ball) = (plane([4.0, 3.0]), Cutter::ball(6.0).unwrap());
        let lines = [0.2, 0.6, 1.0, 1.4, 1.8, 2.2, 2.6, 3.0, 3.4, 3.7];
        let passes: Vec<Vec<Point3>> =
            lines.iter().map(|&x| [-4.0, 8.0].map(|y| Point3::new(x, y, 0.0)).to_vec()).collect();
        let path = path(&passes);
        let grid = Grid::covering(&part.bounds(), 0.13, 64, 1 << 30).unwrap();
        let cut = cut_reference(&ZMap::block(grid, 1.0), &ball, &path, &Silent).unwrap();
        let limits = Limits { scallop: 0.005, gouge: 0.005, uncut: 0.05, chord: 0.001 };
        let map = ridge_map(&part, &ball.into(), &path, &cut, &limits, 1e-4, &Silent).unwrap().unwrap();
        let at = |x: f64| {
            let near = map.above.iter().filter(|p| (p.at.x - x).abs() < 1e-3 && p.at.y > 0.5 && p.at.y < 2.5);
            near.map(|p| p.height).fold(0.0, f64::max)
        };
        let sagitta = |half: f64| 3.0 - (9.0 - half * half).sqrt();
        assert!((at(4.0) - sagitta(0.3)).abs() < 1e-4, "{} {}", at(4.0), sagitta(0.3));
        assert!((at(0.0) - sagitta(0.2)).abs() < 1e-4, "{} {}", at(0.0), sagitta(0.2));
    }

    /// Two passes lie farthest from each other where a third one comes down between them, so little that no
    /// cell sees it.
    #[test]
    fn what_no_cell_saw_lowers_the_highest_places() {
        let (part, ball) = (plane([4.0, 3.0]), Cutter::ball(6.0).unwrap());
        let sagitta = |half: f64| 3.0 - (9.0 - half * half).sqrt();
        let along = |x: f64, middle: f64| {
            let places = [(x, -4.0, 5.0), (x, -4.0, 0.0), (middle, 1.5, 0.0), (x, 7.0, 0.0), (x, 7.0, 5.0)];
            places.map(|(x, y, z)| Point3::new(x, y, z)).to_vec()
        };
        let outer = [0.2, 0.6, 1.0, 1.4, 2.6, 3.0, 3.4, 3.8].map(|x| along(x, x));
        let left = sagitta(0.3) - 4e-4;
        let between = [5.0, left, 5.0].map(|z| Point3::new(2.0, 1.5, z)).to_vec();
        let passes: Vec<Vec<Point3>> =
            outer.into_iter().chain([along(1.8, 1.7), along(2.2, 2.3), between]).collect();
        let path = path(&passes);
        let grid = Grid::covering(&part.bounds(), 0.13, 64, 1 << 30).unwrap();
        let cut = cut_reference(&ZMap::block(grid, 1.0), &ball, &path, &Silent).unwrap();
        assert!(
            !cut.cut_by.contains(&(path.len() as u32 - 1)) && !cut.cut_by.contains(&(path.len() as u32 - 2))
        );
        let limits = Limits { scallop: 0.005, gouge: 0.005, uncut: 0.05, chord: 0.001 };
        let map = ridge_map(&part, &ball.into(), &path, &cut, &limits, 1e-4, &Silent).unwrap().unwrap();
        let highest = map.scallop.max_mm.unwrap();
        assert!(highest > left && highest < sagitta(0.3) - 1e-5, "{highest} {left}");
        let above = map.above.iter().map(|place| place.height).fold(0.0, f64::max);
        assert_eq!(above, highest);
    }

    /// One pass rises between two lines of cells, by less than the width of a cell.
    #[test]
    fn what_stands_between_lines_of_cells_is_found() {
        let (part, ball) = (plane([4.0, 3.0]), Cutter::ball(6.0).unwrap());
        let sagitta = |half: f64| 3.0 - (9.0 - half * half).sqrt();
        let grid = Grid::covering(&part.bounds(), 0.13, 64, 1 << 30).unwrap();
        let half = 0.172;
        let middle = grid.centre(0, 10).y + 0.5 * grid.cell;
        let raised = 1.0 + 2.0 * half;
        // Only the ridges beside that pass come near the limit.
        let axes = [0.1, 0.4, 0.7, 1.0, raised, raised + 2.0 * half];
        let axes = axes.into_iter().chain((1..9).map(|k| axes[5] + 0.3 * f64::from(k)));
        let pass = |x: f64| {
            let rise = if x == raised { 6e-4 } else { 0.0 };
            let [from, to] = [middle - 0.04, middle + 0.04];
            let places =
                [(-4.0, 5.0), (-4.0, 0.0), (from, 0.0), (middle, rise), (to, 0.0), (7.0, 0.0), (7.0, 5.0)];
            places.map(|(y, z)| Point3::new(x, y, z)).to_vec()
        };
        let path = path(&axes.map(pass).collect::<Vec<_>>());
        let cut = cut_reference(&ZMap::block(grid, 1.0), &ball, &path, &Silent).unwrap();
        let limits = Limits { scallop: 0.005, gouge: 0.005, uncut: 0.05, chord: 0.001 };
        let map = ridge_map(&part, &ball.into(), &path, &cut, &limits, 1e-4, &Silent).unwrap().unwrap();
        assert!(map.above.iter().all(|place| place.height < limits.scallop), "{map:?}");
        let found = places_above(&part, &ball.into(), &path, &cut, &limits, 1 << 16, &Silent).unwrap();
        // Over the middle, the raised pass cuts where its rise and the way there together leave least.
        let of_raised = |far: f64| {
            let ways = (0..=4000).map(|k| f64::from(k) * 1e-5);
            let left = ways.map(|way| 6e-4 * (1.0 - way / 0.04) + sagitta(far.hypot(way)));
            left.fold(f64::INFINITY, f64::min)
        };
        let height = |aside: f64| (sagitta(half + aside), of_raised(half - aside));
        let meet = (0..60).fold([0.0, 0.1], |[low, high], _| {
            let aside = 0.5 * (low + high);
            let (still, raised) = height(aside);
            if still < raised { [aside, high] } else { [low, aside] }
        });
        let closed = height(meet[0]).0;
        let near = |place: &&RidgePlace| (place.at.y - middle).abs() < 0.05;
        let highest = found.iter().filter(near).map(|place| place.height).fold(0.0, f64::max);
        assert!(closed > limits.scallop && highest >= closed - 1e-7, "{highest} {closed}");
        assert!(highest <= closed + 0.01 * limits.scallop, "{highest} {closed}");
    }
}
