//! The ridges of a cut surface and the remnants along its borders, and nothing else: what a planner is corrected by.

use super::cut_surface::CutSurface;
use super::figures::{Limits, ScallopFigures};
use super::inspection::{Inspection, Sample};
use super::ridges::{RidgeFinder, scallop_figures};
use cutter::Cutter;
use geometry::{Point2, Point3, Vector2};
use motion::Toolpath;
use part::Part;
use sim::{Envelope, ZMap};
use work::monitor::{Cancelled, Monitor};

/// A place of a ridge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RidgePlace {
    /// Where it stands.
    pub at: Point3,
    /// Over the design surface, mm.
    pub height: f64,
}

/// All ridges of a cut surface.
#[derive(Debug, Clone, PartialEq)]
pub struct RidgeMap {
    /// Their places, one where a ridge crosses from a cell to the next.
    pub places: Vec<RidgePlace>,
    /// What stands along the part's borders, one place a side of a cell.
    pub borders: Vec<RidgePlace>,
    /// Their figures, with the bound of the highest.
    pub scallop: ScallopFigures,
}

/// The ridges of `cut`, the stock after `path`; the highest is looked at closer until its bound is `asked` mm, if it comes
/// down to that.
pub(super) fn ridge_map(
    part: &Part,
    cutter: &Cutter,
    path: &Toolpath,
    cut: &ZMap,
    limits: &Limits,
    asked: f64,
    monitor: &dyn Monitor,
) -> Result<RidgeMap, Cancelled> {
    let surface = CutSurface::new(Envelope::new(cutter, path), cut, path);
    let inspection = Inspection { part, cutter, limits, asked, surface: &surface, grid: cut.grid };
    let samples = inspection.samples(monitor)?;
    let mut finder = RidgeFinder::new(&surface, part, cutter, path, limits);
    finder.keeps_places = true;
    let mut ridges = finder.find(&|k| samples[k].deviation, monitor)?;
    let places = std::mem::take(&mut ridges.places);
    let scallop = scallop_figures(&ridges.samples, finder.highest(&ridges, asked), limits);
    Ok(RidgeMap { places, borders: borders(&inspection, &samples), scallop })
}

/// What stands at the outer sides of the cells that lie at the part's border. What is higher than the uncut tolerance is no
/// remnant of a pass.
fn borders(inspection: &Inspection<'_>, samples: &[Sample]) -> Vec<RidgePlace> {
    let Inspection { grid, limits, .. } = *inspection;
    let on = |i: usize, j: usize| {
        i < grid.nx && j < grid.ny && !samples[grid.index(i, j)].deviation.is_nan()
    };
    let of_row = |j: usize| {
        let mut found = Vec::new();
        for i in (0..grid.nx).filter(|&i| on(i, j)) {
            for (di, dj) in [(-1, 0), (1, 0), (0, -1), (0, 1)] {
                // Before the first cell there is none: the index wraps around to one far beyond the last.
                if !on(i.wrapping_add_signed(di), j.wrapping_add_signed(dj)) {
                    found.extend(inspection.at_side(grid.centre(i, j), [di as f64, dj as f64]));
                }
            }
        }
        found
    };
    let rows = work::parallel::map(grid.ny, of_row);
    rows.into_iter().flatten().filter(|p| p.height > 0.0 && p.height <= limits.uncut).collect()
}

impl Inspection<'_> {
    /// What stands where the part ends on the way from a centre to the side of its cell.
    fn at_side(&self, centre: Point2, [x, y]: [f64; 2]) -> Option<RidgePlace> {
        /// Shares of the way; the border may lie within the cell.
        const SHARES: [f64; 4] = [0.999, 0.75, 0.5, 0.25];
        let half = 0.5 * self.grid.cell;
        SHARES.iter().find_map(|share| {
            let q = centre + Vector2::new(x, y) * (share * half);
            let design = self.part.highest_at(q.x, q.y)?;
            let cut = self.surface.along_normal(&design.point, &design.normal)?;
            Some(RidgePlace { at: design.point, height: cut.distance })
        })
    }
}
