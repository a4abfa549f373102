//! The ridges of a cut surface and the remnants along its borders, and nothing else: what a planner is corrected by.

use super::cut_surface::CutSurface;
use super::figures::{Limits, ScallopFigures};
use super::inspection::{Inspection, Sample};
use super::ridges::{RidgeFinder, scallop_figures};
use cutter::Cutter;
use geometry::Point3;
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
    /// What stands along the part's borders, one place a cell, to first order.
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

/// What stands at the outer side of the cells that lie at the part's border. What is higher than the uncut tolerance is no
/// remnant of a pass.
fn borders(inspection: &Inspection<'_>, samples: &[Sample]) -> Vec<RidgePlace> {
    let Inspection { grid, limits, part, .. } = *inspection;
    let off = |i: Option<usize>, j: Option<usize>| match (i, j) {
        (Some(i), Some(j)) if i < grid.nx && j < grid.ny => samples[grid.index(i, j)].deviation.is_nan(),
        _ => true,
    };
    let place = |k: usize| {
        let (i, j, sample) = (k % grid.nx, k / grid.nx, &samples[k]);
        let ends = off(i.checked_sub(1), Some(j))
            || off(Some(i + 1), Some(j))
            || off(Some(i), j.checked_sub(1))
            || off(Some(i), Some(j + 1));
        if sample.deviation.is_nan() || !ends {
            return None;
        }
        let outward = 0.5 * grid.cell / f64::from(sample.lean).max(1e-3);
        let height = f64::from(sample.deviation) + f64::from(sample.slope) * outward;
        if height <= 0.0 || height > limits.uncut {
            return None;
        }
        let centre = grid.centre(i, j);
        Some(RidgePlace { at: part.highest_at(centre.x, centre.y)?.point, height })
    };
    (0..samples.len()).filter_map(place).collect()
}
