//! What is measured of a pocket besides its floor: cuts beyond its walls, and the engagement.
//!
//! Enters: region, cutter, path, the cut stock. Leaves: how far the cutter cut beyond the outline in the
//! plan view, once from the moves in closed form and once from the cells of the simulated stock, which know
//! nothing of each other; mm.

use serde::Serialize;

use cutter::Cutter;
use geometry::{Region, SegmentGrid, Vector2, distance_of_segments};
use motion::Toolpath;
use sim::ZMap;
use work::monitor::{self, Cancelled, Monitor};
use work::parallel;

/// A cell counts as cut when it lies lower than the stock's top by more than this, mm: stored heights
/// round.
const CUT: f64 = 1.0e-4;

/// A centre nearer to the outline than this, mm, is on it.
const ON_OUTLINE: f64 = 1.0e-9;

/// A stretch of passes above the engagement that was asked for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ExceedingStretch {
    /// Where it begins: the tip.
    pub x: f64,
    /// y.
    pub y: f64,
    /// z.
    pub z: f64,
    /// Its length.
    pub length_mm: f64,
    /// The greatest angle on it; its error is bounded as that of [`PocketFigures::max_engagement_deg`].
    pub max_engagement_deg: f64,
    /// Its first move, counted from 0.
    pub first_move: u32,
    /// Its line in the program.
    pub line: Option<u32>,
}

/// The engagement of passes with thinner layers of stock counted than in what is judged.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ThinLayers {
    /// Layers from this thickness on count.
    pub counted_from_mm: f64,
    /// Greatest angle of the cutter's circumference in stock along passes.
    pub max_engagement_deg: f64,
    /// Bound of its error.
    pub max_engagement_error_bound_deg: f64,
    /// The move with the greatest angle, counted from 0.
    pub max_engagement_move: u32,
    /// Length of passes above the limit.
    pub over_engagement_limit_mm: f64,
    /// The stretches above it, the one with the greatest angle first and [`PocketFigures::LISTED`] at most.
    pub over_engagement_limit: Vec<ExceedingStretch>,
    /// How many there are.
    pub over_engagement_limit_count: usize,
}

/// Figures of a pocket.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct PocketFigures {
    /// Area of the region.
    pub area_mm2: f64,
    /// Area of it that no position of the cutter reaches: its corners.
    pub unreachable_area_mm2: f64,
    /// Distance of passes.
    pub stepover_mm: f64,
    /// Farthest that the cutter's radius came beyond the outline in the plan view, of all moves, in closed
    /// form; 0 when none did.
    pub wall_gouge_mm: f64,
    /// Bound of its error: chords of the drawing's curves.
    pub wall_gouge_error_bound_mm: f64,
    /// The move that came so far, counted from 0.
    pub wall_gouge_move: u32,
    /// Farthest centre of a cut cell beyond the outline.
    pub wall_gouge_of_cells_mm: f64,
    /// How much farther a cut may reach between centres.
    pub wall_gouge_of_cells_error_bound_mm: f64,
    /// Area of the cut cells beyond the outline.
    pub wall_gouge_area_mm2: f64,
    /// Greatest angle of the cutter's circumference in stock along passes, ways down left out.
    pub max_engagement_deg: f64,
    /// Bound of its error.
    pub max_engagement_error_bound_deg: f64,
    /// Thinner layers of stock beside ground that was cut before do not count in it.
    pub uncounted_layer_mm: f64,
    /// The move with the greatest angle, counted from 0.
    pub max_engagement_move: u32,
    /// 95 % of the cutting length have less.
    pub p95_engagement_deg: f64,
    /// Angle that passes are planned within, if one was asked for; above it the feed falls.
    pub engagement_limit_deg: f64,
    /// Share of the cutting length above it.
    pub over_engagement_limit_fraction: f64,
    /// The stretches above it, the longest first and [`LISTED`](Self::LISTED) at most; none where no engagement was asked for.
    pub over_engagement_limit: Vec<ExceedingStretch>,
    /// How many there are.
    pub over_engagement_limit_count: usize,
    /// The engagement with thinner layers counted, where one was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thin_layers: Option<ThinLayers>,
}

impl PocketFigures {
    /// Stretches that are listed at most.
    pub const LISTED: usize = 100;
}

/// How far beyond the outline the cutter came, and on which move: every move below `top`, mm.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub fn wall_gouge_of_moves(
    region: &Region,
    cutter: &Cutter,
    path: &Toolpath,
    top: f64,
    monitor: &dyn Monitor,
) -> Result<(f64, u32), Cancelled> {
    let walls = SegmentGrid::of_curves(region.curves());
    let r = cutter.radius();
    let depths = parallel::try_map(path.len(), |k| {
        monitor::check(monitor)?;
        let (a, b) = (path.start_of(k), path.moves[k].to.tip);
        if a.z.min(b.z) >= top {
            return Ok(0.0);
        }
        let ends = [a.xy(), b.xy()];
        let beyond = ends.map(|end| if region.contains(&end) { 0.0 } else { walls.distance(&end) });
        if beyond[0].max(beyond[1]) > 0.0 {
            return Ok(r + beyond[0].max(beyond[1]));
        }
        let reach = Vector2::new(r, r);
        let around = [ends[0].inf(&ends[1]) - reach, ends[0].sup(&ends[1]) + reach];
        let mut nearest = r;
        walls.near(&around, |s| {
            nearest = nearest.min(distance_of_segments(&ends, &walls.segments()[s as usize].ends));
        });
        Ok(r - nearest)
    })?;
    let worst =
        depths.iter().enumerate().fold((0.0, 0), |w, (k, d)| if *d > w.0 { (*d, k as u32) } else { w });
    // What rounding leaves is none.
    Ok(if worst.0 < 1e-9 { (0.0, 0) } else { worst })
}

/// Farthest centre of a cut cell outside of the region and the area of all such cells, mm and mm².
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub fn wall_gouge_of_cells(
    region: &Region,
    cut: &ZMap,
    top: f64,
    monitor: &dyn Monitor,
) -> Result<(f64, f64), Cancelled> {
    let walls = SegmentGrid::of_curves(region.curves());
    let grid = &cut.grid;
    let rows = parallel::try_map(grid.ny, |j| {
        monitor::check(monitor)?;
        let y = grid.centre(0, j).y;
        let mut crossings: Vec<f64> = walls
            .segments()
            .iter()
            .filter(|s| (s.ends[0].y > y) != (s.ends[1].y > y))
            .map(|s| {
                s.ends[0].x + (y - s.ends[0].y) / (s.ends[1].y - s.ends[0].y) * (s.ends[1].x - s.ends[0].x)
            })
            .collect();
        crossings.sort_by(f64::total_cmp);
        let (mut farthest, mut count, mut passed) = (0.0f64, 0usize, 0usize);
        for i in 0..grid.nx {
            let centre = grid.centre(i, j);
            while passed < crossings.len() && crossings[passed] <= centre.x {
                passed += 1;
            }
            if passed % 2 == 0 && f64::from(cut.height[grid.index(i, j)]) < top - CUT {
                let beyond = walls.distance(&centre);
                if beyond > ON_OUTLINE {
                    farthest = farthest.max(beyond);
                    count += 1;
                }
            }
        }
        Ok((farthest, count))
    })?;
    let farthest = rows.iter().map(|r| r.0).fold(0.0, f64::max);
    let count: usize = rows.iter().map(|r| r.1).sum();
    Ok((farthest, count as f64 * grid.cell * grid.cell))
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Point2;
    use geometry::Point3;
    use motion::{ClPoint, Move, MoveKind};
    use sim::{Grid, cut};
    use work::monitor::Silent;

    /// A straight pass planted nearer to the wall than the radius, and one right through it.
    #[test]
    fn cuts_beyond_the_outline_are_found_by_moves_and_by_cells() {
        let square = [(0.0, 0.0), (30.0, 0.0), (30.0, 20.0), (0.0, 20.0)].map(|(x, y)| Point2::new(x, y));
        let region = Region::nested(vec![square.to_vec()]).unwrap().0;
        let cutter = Cutter::flat(6.0).unwrap();
        let grid = Grid { origin: Point2::new(-6.97, -6.97), cell: 0.05, nx: 860, ny: 660 };
        let measured = |y: f64, x: f64| {
            let to = |x: f64, y: f64, z: f64| Move {
                to: ClPoint::upright(Point3::new(x, y, z)),
                kind: MoveKind::Cut,
                feed_rate: 1.0,
                pass: 0,
            };
            let path = Toolpath::new(
                ClPoint::upright(Point3::new(10.0, 10.0, 5.0)),
                vec![to(10.0, 10.0, -2.0), to(10.0, y, -2.0), to(x, y, -2.0)],
            );
            let stock = cut(ZMap::block(grid, 0.0), &cutter, &path, &Silent).unwrap();
            let cells = wall_gouge_of_cells(&region, &stock, 0.0, &Silent).unwrap();
            (wall_gouge_of_moves(&region, &cutter, &path, 0.0, &Silent).unwrap(), cells)
        };
        assert_eq!(measured(3.0, 27.0), ((0.0, 0), (0.0, 0.0)));
        let ((exact, _), (cells, area)) = measured(2.8, 20.0);
        assert!(
            (exact - 0.2).abs() < 1e-12 && cells <= exact && cells > exact - 0.05 * 1.5,
            "{exact} {cells}"
        );
        // A strip of 10 mm and the two caps of the discs at its ends.
        let cap = 2.0 * (9.0 * (2.8f64 / 3.0).acos() - 2.8 * (9.0 - 2.8f64 * 2.8).sqrt()) / 2.0;
        assert!((area - (10.0 * 0.2 + cap)).abs() < 0.25, "{area}");
        let ((exact, at), (cells, _)) = measured(10.0, 32.0);
        assert!((exact - 5.0).abs() < 1e-12 && at == 2 && (cells - 5.0).abs() < 0.075, "{exact} {cells}");
    }
}
