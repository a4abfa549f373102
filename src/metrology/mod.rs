//! Measures the cut surface against the design part, never against a planner's own prediction.

mod figures;

pub use figures::{
    DeviationFigures, GougeFigures, GougeRegion, Limits, Measurement, PathFigures, ScallopFigures,
    UncutFigures, UncutRegion,
};

use crate::cutter::Cutter;
use crate::monitor::{Cancelled, Monitor};
use crate::part::Part;
use crate::sim::ZMap;
use crate::toolpath::Toolpath;

/// Measures `cut`, the stock after `path`, against `part`.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub fn measure(
    _part: &Part,
    _cutter: &Cutter,
    _path: &Toolpath,
    _cut: &ZMap,
    _limits: &Limits,
    _monitor: &dyn Monitor,
) -> Result<Measurement, Cancelled> {
    todo!()
}
