//! The ridges of a cut surface and where they stand, and nothing else: what a planner is corrected by.

use super::cut_surface::CutSurface;
use super::figures::{Limits, ScallopFigures};
use super::inspection::Inspection;
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
    Ok(RidgeMap { places, scallop })
}
