//! Measures the cut surface against the design part, never against a planner's own prediction.
//!
//! Enters: the part, the stock after a path, and the path. Leaves: signed deviation at a design
//! point above or below every cell centre, the heights of the scallop ridges, gouges and uncut
//! places as connected regions, and a bound of the error beside each figure. mm throughout.
//!
//! Deviation at a design point is the signed distance along its outward normal to the cut surface:
//! positive is excess, negative is gouge.

mod closer;
mod cut_surface;
mod figures;
mod inspection;
mod meetings;
mod path;
mod regions;
mod removal;
mod ridges;

pub(crate) use cut_surface::CutSurface;
pub use figures::{
    DeviationFigures, GougeFigures, GougeRegion, Limits, Measurement, PathFigures, ScallopFigures,
    UncutFigures, UncutRegion,
};
pub(crate) use meetings::Meetings;
pub use path::path_figures;
pub use removal::{RapidContactFigures, RemovalFigures, removal_figures};

use crate::cutter::Cutter;
use crate::monitor::{Cancelled, Monitor};
use crate::part::Part;
use crate::sim::{Envelope, ZMap};
use crate::toolpath::Toolpath;
use inspection::Inspection;
use ridges::{RidgeFinder, scallop_figures};

/// Measures `cut`, the stock after `path`, against `part`, until the error bounds of the greatest scallop,
/// gouge and uncut height are at most `asked` mm each, if that can be reached.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub fn measure(
    part: &Part,
    cutter: &Cutter,
    path: &Toolpath,
    cut: &ZMap,
    limits: &Limits,
    asked: f64,
    monitor: &dyn Monitor,
) -> Result<Measurement, Cancelled> {
    let surface = CutSurface::new(Envelope::new(cutter, path), cut, path);
    let inspection = Inspection { part, cutter, limits, asked, surface: &surface, grid: cut.grid };
    let samples = inspection.samples(monitor)?;
    let finder = RidgeFinder::new(&surface, part, cutter, path, limits);
    let on_part = |k: usize| !samples[k].deviation.is_nan();
    let ridges = finder.find(&on_part, monitor)?;
    let deviation = inspection.deviation_figures(&samples);
    Ok(Measurement {
        scallop: scallop_figures(&ridges, finder.highest(&ridges), limits),
        gouge: inspection.gouges(&samples),
        uncut: inspection.uncut(&samples, ridges.highest_sample(), deviation.area_mm2),
        deviation,
        ridge_samples: ridges.samples,
        deviation_map: samples.into_iter().map(|s| s.deviation).collect(),
    })
}
