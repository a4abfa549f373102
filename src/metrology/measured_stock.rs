//! Whether a stock is what a path left over a part. What a measurement reads from cells and what it asks
//! moves for would contradict each other elsewhere.

use super::figures::Limits;
use super::refine::Asked;
use cutter::Cutter;
use geometry::Point2;
use motion::{PathError, Toolpath};
use part::Part;
use sim::{CutError, Envelope, Grid, NOT_CUT, ZMap};
use work::monitor::{self, Cancelled, Monitor};
use work::parallel;

/// Heights of cells are those of the moves to this, mm, and to a unit in their last place ([`sim::cut`]).
const HEIGHTS: f64 = 2e-5;

/// Cells may end so much of a cell short of the part: rounding.
const HAIR: f64 = 1e-6;

/// Why a cut cannot be measured.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeasureError {
    /// Stopped by the monitor.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The path has places that are no numbers, or axes that are not upright.
    #[error(transparent)]
    Path(#[from] PathError),
    /// Part of the part has no cells over it.
    #[error(
        "the stock's cells lie over x {:.3} to {:.3} and y {:.3} to {:.3} mm, and the part over x {:.3} to {:.3} and y {:.3} to {:.3}; \
         the cells must lie over all of the part", cells[0].x, cells[1].x, cells[0].y, cells[1].y,
        part[0].x, part[1].x, part[0].y, part[1].y
    )]
    Beside {
        /// The corners of the rectangle that the cells cover.
        cells: [Point2; 2],
        /// Those of the part's, seen from above.
        part: [Point2; 2],
    },
    /// The stock, where no move cut it, does not stand as high as the part.
    #[error(
        "at x {:.3} y {:.3} the stock is {stands} mm high where no move cut it, and the part {design:.6} mm; begin with \
         stock that lies over all of the part", at.x, at.y
    )]
    Below {
        /// Centre of a cell.
        at: Point2,
        /// Height of the stock there, mm.
        stands: f32,
        /// That of the part, mm.
        design: f64,
    },
    /// The stock has not as many heights, or not as many moves, as its grid has cells.
    #[error("the stock has {heights} heights and {moves} moves for {cells} cells")]
    Cells {
        /// Cells of the grid.
        cells: usize,
        /// Heights.
        heights: usize,
        /// Moves that cut the cells.
        moves: usize,
    },
    /// The top of the stock is no number, or the stock stands higher.
    #[error("at x {:.3} y {:.3} the stock is {stands} mm high, and its top, {top} mm, is said to be the highest of it", at.x, at.y)]
    Top {
        /// Centre of a cell.
        at: Point2,
        /// Height of the stock there, mm.
        stands: f32,
        /// What the stock says of its top, mm.
        top: f64,
    },
    /// A length that must be above 0 is not.
    #[error("`{key}` must be a length above 0 mm, and is {value}")]
    Length {
        /// The field that has it.
        key: &'static str,
        /// Its value.
        value: f64,
    },
    /// The stock does not stand as high as this path leaves it.
    #[error(
        "at x {:.3} y {:.3} the stock is {stands} mm high, and move {move_index} of the path leaves {leaves:.6} mm; cut the stock along \
         this path with this cutter first", at.x, at.y
    )]
    NotCut {
        /// Centre of a cell.
        at: Point2,
        /// Height of the stock there, mm.
        stands: f32,
        /// What the move leaves there at most, mm.
        leaves: f64,
        /// The move.
        move_index: usize,
    },
    /// The stock names a move that the path does not have.
    #[error("the stock was cut by move {move_index} of a path, and this one has {moves} moves")]
    OtherPath {
        /// The move.
        move_index: usize,
        /// How many the path has.
        moves: usize,
    },
}

impl From<CutError> for MeasureError {
    fn from(error: CutError) -> Self {
        match error {
            CutError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            CutError::Path(path) => Self::Path(path),
        }
    }
}

/// Whether the lengths that a measurement goes by are lengths.
pub(super) fn check_lengths(limits: &Limits, asked: &Asked) -> Result<(), MeasureError> {
    for (key, value) in [("Asked.error_bound", asked.error_bound), ("Limits.chord", limits.chord)] {
        if !(value > 0.0 && value.is_finite()) {
            return Err(MeasureError::Length { key, value });
        }
    }
    Ok(())
}

/// Whether `cut` lies over the part and is what the path left: every cell stands where the move that it names
/// cuts, or above the part where it names none, none higher than the middle of any move, and none above the
/// stock's top.
pub(super) fn check_stock(
    part: &Part,
    cutter: &Cutter,
    path: &Toolpath,
    cut: &ZMap,
    monitor: &dyn Monitor,
) -> Result<(), MeasureError> {
    let (grid, bounds) = (cut.grid, part.bounds());
    let [heights, moves] = [cut.height.len(), cut.cut_by.len()];
    if [heights, moves] != [grid.len(); 2] || grid.is_empty() {
        return Err(MeasureError::Cells { cells: grid.len(), heights, moves });
    }
    let cells = rectangle(&grid);
    let around = [bounds.min.xy(), bounds.max.xy()];
    let short = (cells[0] - around[0]).max().max((around[1] - cells[1]).max());
    let covers = short <= HAIR * grid.cell;
    if !covers {
        return Err(MeasureError::Beside { cells, part: around });
    }
    let envelope = Envelope::new(cutter, path);
    let differs = |k: usize, move_index: usize, is_by_it: bool| {
        let (at, stands) = (grid.centre(k % grid.nx, k / grid.nx), cut.height[k]);
        // Where the centre is on the rim to the last bits, the move may pass or not.
        let leaves = envelope.height(move_index as u32, at.x, at.y)?;
        let rounding = HEIGHTS + f64::from(f32::EPSILON) * leaves.abs();
        let over = f64::from(stands) - leaves;
        let agrees = over <= rounding && (!is_by_it || over >= -rounding);
        (!agrees).then_some(MeasureError::NotCut { at, stands, leaves, move_index })
    };
    let below = |k: usize| {
        let (at, stands) = (grid.centre(k % grid.nx, k / grid.nx), cut.height[k]);
        let design = part.highest_at(at.x, at.y)?.point.z;
        let rounding = HEIGHTS + f64::from(f32::EPSILON) * design.abs();
        let lies_over = f64::from(stands) >= design - rounding;
        (!lies_over).then_some(MeasureError::Below { at, stands, design })
    };
    let most = cut.top + HEIGHTS + f64::from(f32::EPSILON) * cut.top.abs();
    let over_top = |k: usize| {
        let (at, stands) = (grid.centre(k % grid.nx, k / grid.nx), cut.height[k]);
        let is_within = f64::from(stands) <= most && cut.top.is_finite();
        (!is_within).then_some(MeasureError::Top { at, stands, top: cut.top })
    };
    parallel::try_map(grid.ny, |j| {
        monitor::check(monitor)?;
        (j * grid.nx..(j + 1) * grid.nx).try_for_each(|k| {
            if cut.cut_by[k] == NOT_CUT {
                return below(k).or_else(|| over_top(k)).map_or(Ok(()), Err);
            }
            let move_index = cut.cut_by[k] as usize;
            if move_index >= path.len() {
                return Err(MeasureError::OtherPath { move_index, moves: path.len() });
            }
            differs(k, move_index, true).or_else(|| over_top(k)).map_or(Ok(()), Err)
        })
    })?;
    monitor::check(monitor)?;
    for move_index in 0..path.len() {
        let ends = [path.start_of(move_index).xy(), path.moves[move_index].to.tip.xy()];
        let middle = middle_within(ends, cells).and_then(|at| grid.cell_at(at.x, at.y));
        if let Some(error) = middle.and_then(|(i, j)| differs(grid.index(i, j), move_index, false)) {
            return Err(error);
        }
    }
    Ok(())
}

/// The corners of what a grid covers.
fn rectangle(grid: &Grid) -> [Point2; 2] {
    let half = geometry::Vector2::new(0.5, 0.5) * grid.cell;
    [grid.origin - half, grid.centre(grid.nx - 1, grid.ny - 1) + half]
}

/// The middle of what of a line lies in a rectangle.
fn middle_within([from, to]: [Point2; 2], [low, high]: [Point2; 2]) -> Option<Point2> {
    let way = to - from;
    let (mut first, mut last) = (0.0f64, 1.0f64);
    for k in 0..2 {
        if way[k] == 0.0 {
            if !(low[k]..=high[k]).contains(&from[k]) {
                return None;
            }
        } else {
            let [a, b] = [(low[k] - from[k]) / way[k], (high[k] - from[k]) / way[k]];
            (first, last) = (first.max(a.min(b)), last.min(a.max(b)));
        }
    }
    (first <= last).then(|| from + way * (0.5 * (first + last)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Measurement, measure};
    use geometry::{AnalyticShape, AnalyticSurface, Point3, Vector3};
    use motion::{ClPoint, Move, MoveKind};
    use part::Patch;
    use sim::{Rays, RaysError, cut};
    use work::monitor::Silent;

    const CELL: f64 = 0.1;

    fn plate() -> Part {
        let shape = AnalyticShape::Plane { height: 0.0 };
        let plane = AnalyticSurface::new(shape, [[0.0, 20.0], [0.0, 1.0]]).unwrap();
        Part::from_patches(vec![Patch::Analytic(plane)], 0.01).unwrap()
    }

    fn grid(part: &Part) -> Grid {
        Grid::covering(&part.bounds(), CELL, 80, 64 << 20).unwrap()
    }

    /// Two passes 1 mm apart.
    fn path() -> Toolpath {
        let tip = |x: f64, y: f64, z: f64| ClPoint::upright(Point3::new(x, y, z));
        let to = |x, y, z, kind, pass| Move { to: tip(x, y, z), kind, feed_rate: 1000.0, pass };
        let moves = vec![
            to(-4.0, 0.0, 0.0, MoveKind::Plunge, 0),
            to(24.0, 0.0, 0.0, MoveKind::Cut, 0),
            to(24.0, 1.0, 0.0, MoveKind::Link, 1),
            to(-4.0, 1.0, 0.0, MoveKind::Cut, 1),
        ];
        Toolpath::new(tip(-4.0, 0.0, 5.0), moves)
    }

    const LIMITS: Limits = Limits { scallop: 0.05, gouge: 0.005, uncut: 0.1, chord: 0.001 };

    const ASKED: Asked = Asked {
        allowed_depth: 0.0,
        error_bound: 1e-5,
        most_cells: 1_000_000,
        most_squares: 1_000_000,
        is_first_look: false,
        border_cuts: true,
        steep_elsewhere: false,
    };

    fn measured(path: &Toolpath, stock: &ZMap) -> Result<Measurement, MeasureError> {
        measure(&plate(), &Cutter::ball(6.0).unwrap(), path, stock, &LIMITS, &ASKED, &Silent)
    }

    fn cut_by(cutter: &Cutter, path: &Toolpath) -> ZMap {
        cut(ZMap::block(grid(&plate()), 1.0), cutter, path, &Silent).unwrap()
    }

    #[test]
    fn a_path_that_leans_or_is_no_number_is_refused_by_all_engines() {
        let cutter = Cutter::ball(6.0).unwrap();
        let (block, done) = (ZMap::block(grid(&plate()), 1.0), cut_by(&cutter, &path()));
        assert!(measured(&path(), &done).is_ok());
        let changed = |change: &dyn Fn(&mut ClPoint)| {
            let mut path = path();
            change(&mut path.moves[1].to);
            path
        };
        let wrong = [
            changed(&|to| to.axis = Vector3::new(0.5, 0.0, 0.866)),
            changed(&|to| to.axis = Vector3::zeros()),
            changed(&|to| to.axis = Vector3::new(0.6, 0.0, 0.8)),
            changed(&|to| to.tip.x = f64::NAN),
            changed(&|to| to.tip.y = f64::INFINITY),
            changed(&|to| to.tip.x = 1e12),
        ];
        for (k, path) in wrong.iter().enumerate() {
            let expected = path.check_upright().unwrap_err();
            assert!(expected.to_string().starts_with("move 1 of the path"), "{expected}");
            // Not equal by their numbers, where these are none.
            let expected = expected.to_string();
            let refused = cut(block.clone(), &cutter, path, &Silent).err();
            assert!(matches!(refused, Some(CutError::Path(error)) if error.to_string() == expected), "{k}");
            let refused = measured(path, &done).err();
            assert!(
                matches!(refused, Some(MeasureError::Path(error)) if error.to_string() == expected),
                "{k}"
            );
            let solid = cutter::Solid::of_cutter(&cutter, None);
            let rays = Rays::new(path, &solid, &Silent).err();
            let is_refused = matches!(rays, Some(RaysError::Path(error)) if error.to_string() == expected);
            // Rays know tools that lean.
            assert_eq!(is_refused, k != 2, "{k}");
        }
    }

    /// Far and strange numbers that are in order end, and give the same figures.
    #[test]
    fn passes_may_have_any_numbers_and_moves_go_far() {
        let cutter = Cutter::ball(6.0).unwrap();
        let usual = measured(&path(), &cut_by(&cutter, &path())).unwrap();
        let mut other = path();
        other.moves[3].pass = u32::MAX;
        let renamed = measured(&other, &cut_by(&cutter, &other)).unwrap();
        assert_eq!(renamed.scallop.max_mm, usual.scallop.max_mm);
        let mut far = path();
        (far.moves[1].to.tip.x, far.moves[2].to.tip.x) = (1e6, 1e6);
        let far = measured(&far, &cut_by(&cutter, &far)).unwrap();
        let [far, near] = [far, usual].map(|found| found.scallop.max_mm.unwrap());
        assert!((far - near).abs() < 1e-8, "{far} {near}");
    }

    #[test]
    fn a_stock_that_the_path_did_not_leave_is_refused() {
        let cutter = Cutter::ball(6.0).unwrap();
        let refused = |stock: &ZMap| measured(&path(), stock).err();
        let block = ZMap::block(grid(&plate()), 1.0);
        assert!(matches!(refused(&block), Some(MeasureError::NotCut { move_index: 1, .. })));
        let by = |change: &dyn Fn(&mut Toolpath)| {
            let mut path = path();
            change(&mut path);
            cut_by(&cutter, &path)
        };
        let larger = cut_by(&Cutter::ball(8.0).unwrap(), &path());
        let deeper = by(&|path| path.moves[1].to.tip.z = -0.1);
        let shorter = by(&|path| path.moves.truncate(2));
        for (k, stock) in [larger, deeper, shorter].iter().enumerate() {
            let error = refused(stock);
            assert!(matches!(error, Some(MeasureError::NotCut { .. })), "{k}: {error:?}");
        }
        let longer = by(&|path| {
            let low = path.moves[3];
            path.moves.extend([low, low, low]);
            path.moves[6].to.tip = Point3::new(24.0, 0.5, -0.5);
        });
        let error = refused(&longer);
        assert!(matches!(error, Some(MeasureError::OtherPath { move_index: 6, moves: 4 })), "{error:?}");
        let fewer = ZMap { height: Vec::new(), ..block.clone() };
        assert!(matches!(
            refused(&fewer),
            Some(MeasureError::Cells { cells: 2000, heights: 0, moves: 2000 })
        ));
    }

    #[test]
    fn a_stock_below_the_part_is_refused() {
        let cutter = Cutter::ball(6.0).unwrap();
        for (top, lies_over) in [(-1.0, false), (-1e-4, false), (f64::NAN, false), (0.0, true)] {
            let stock = cut(ZMap::block(grid(&plate()), top), &cutter, &path(), &Silent).unwrap();
            let error = measured(&path(), &stock).err();
            let is_below = matches!(error, Some(MeasureError::Below { design: 0.0, .. }));
            assert_eq!((is_below, error.is_none()), (!lies_over, lies_over), "{top}: {error:?}");
        }
    }

    /// One pass along the border of a plate: what stands along the other one is known by where the stock's top
    /// is, which the stock says itself.
    #[test]
    fn the_top_of_the_stock_bounds_what_one_pass_leaves() {
        let cutter = Cutter::ball(6.0).unwrap();
        let mut one = path();
        one.moves.truncate(2);
        let stands = 3.0 - 8f64.sqrt();
        let limits = Limits { scallop: 0.17157, uncut: 0.5, ..LIMITS };
        let stock = cut_by(&cutter, &one);
        let found = measure(&plate(), &cutter, &one, &stock, &limits, &ASKED, &Silent).unwrap();
        let highest = found.excess.highest;
        assert!((highest.max_mm - stands).abs() <= highest.error_bound_mm, "{highest:?} {stands}");
        for top in [0.0, 0.03, -1.0, f64::NAN, f64::INFINITY] {
            let error = measured(&one, &ZMap { top, ..stock.clone() }).err();
            assert!(matches!(error, Some(MeasureError::Top { .. })), "{top}: {error:?}");
        }
    }

    #[test]
    fn lengths_that_are_none_are_refused_by_their_names() {
        let cutter = Cutter::ball(6.0).unwrap();
        let stock = cut_by(&cutter, &path());
        for value in [f64::NAN, 0.0, -1.0, f64::INFINITY] {
            let (limits, asked) = (Limits { chord: value, ..LIMITS }, Asked { error_bound: value, ..ASKED });
            for (limits, asked, key) in
                [(&limits, &ASKED, "`Limits.chord`"), (&LIMITS, &asked, "`Asked.error_bound`")]
            {
                let error = measure(&plate(), &cutter, &path(), &stock, limits, asked, &Silent).unwrap_err();
                assert!(error.to_string().starts_with(key), "{value}: {error}");
            }
        }
    }

    #[test]
    fn a_stock_beside_the_part_is_refused() {
        let cutter = Cutter::ball(6.0).unwrap();
        for [dx, dy] in [[100.0, 0.0], [0.0, 0.2], [-0.2, 0.0]] {
            let mut grid = grid(&plate());
            (grid.origin.x, grid.origin.y) = (grid.origin.x + dx, grid.origin.y + dy);
            let stock = cut(ZMap::block(grid, 1.0), &cutter, &path(), &Silent).unwrap();
            let error = measured(&path(), &stock).err();
            assert!(matches!(error, Some(MeasureError::Beside { .. })), "{dx} {dy}: {error:?}");
        }
    }
}
