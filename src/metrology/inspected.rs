//! What one grid of the cut stock shows of deviations, ridges, gouges and uncut places. mm.

use super::figures::{DeviationFigures, GougeFigures, UncutFigures};
use super::inspection::{Inspection, Sample};
use super::ridges::{Highest, RidgeFinder, Ridges};
use motion::Toolpath;
use work::monitor::{Cancelled, Monitor};

/// What one grid shows.
pub(super) struct Inspected {
    pub deviation: DeviationFigures,
    /// `[ny][nx]`.
    pub samples: Vec<Sample>,
    /// Cells whose deviation counts for less than it is along the normal, beside borders.
    pub counted: Vec<(usize, f32)>,
    pub ridges: Ridges,
    pub highest: Option<Highest>,
    pub gouge: GougeFigures,
    pub uncut: UncutFigures,
}

/// Inspects one grid; `highest_ridge` is that of the surroundings, mm.
pub(super) fn inspect(
    inspection: &Inspection<'_>,
    path: &Toolpath,
    highest_ridge: f64,
    monitor: &dyn Monitor,
) -> Result<Inspected, Cancelled> {
    let mut samples = inspection.samples(monitor)?;
    let finder = RidgeFinder::new(inspection, path);
    let mut ridges = finder.find(&|k| samples[k].deviation, monitor)?;
    // What cells promise between their centres follows from the cut along the normals.
    let counted = inspection.counted_beside_borders(&samples, monitor)?;
    let along: Vec<f32> = counted.iter().map(|(k, _)| samples[*k].deviation).collect();
    counted.iter().for_each(|(k, deviation)| samples[*k].deviation = *deviation);
    let deviation = inspection.deviation_figures(&samples);
    counted.iter().zip(along).for_each(|((k, _), along)| samples[*k].deviation = along);
    let highest_ridge = highest_ridge.max(ridges.highest_sample());
    Ok(Inspected {
        highest: finder.highest(&mut ridges, inspection.asked, monitor)?,
        ridges,
        gouge: inspection.gouges(&samples, monitor)?,
        uncut: inspection.uncut(&samples, highest_ridge, deviation.area_mm2, monitor)?,
        deviation,
        samples,
        counted,
    })
}
