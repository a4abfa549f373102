//! What no path can be shorter than.

use serde::Serialize;

use field::ShortestPossible;
use metrology::path_figures;
use report::Figure;
use work::monitor::Monitor;

use super::words::value;
use crate::JobError;
use crate::run::{Finding, Run};

/// The length that no path below the scallop height can go under, by the widest strips over all directions.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ShortestFigures {
    /// Of the cutter's way, as `path.cutting_length_mm` is.
    pub cutting_length_mm: f64,
    /// Of the contact's way on the part: the integral of 1/(widest strip).
    pub contact_length_mm: f64,
    /// The first of these over the path's cutting length.
    pub efficiency: f64,
    /// Share of the part's area where it is about as concave as the cutter and the strip was limited.
    pub limited_fraction: f64,
}

impl ShortestFigures {
    /// Of a path with a cutting length, mm; `None` for an empty one.
    pub fn new(shortest: &ShortestPossible, cutting_length_mm: f64) -> Option<Self> {
        (cutting_length_mm > 0.0).then(|| Self {
            cutting_length_mm: shortest.cutting_mm,
            contact_length_mm: shortest.contact_mm,
            efficiency: shortest.cutting_mm / cutting_length_mm,
            limited_fraction: shortest.limited_fraction,
        })
    }
}

pub(super) fn find(run: &Run<'_>, _: &dyn Monitor) -> Result<Finding, JobError> {
    let length = path_figures(run.path(), 0.0).cutting_length_mm;
    let shortest = run.planned.plan.shortest.and_then(|shortest| ShortestFigures::new(&shortest, length));
    let Some(s) = shortest else { return Ok(Finding::default()) };
    let per_cent = 100.0 * s.efficiency;
    let name = &run.request.name;
    let figure = Figure {
        key: "shortest",
        value: value(&s)?,
        rows: vec![(
            "shortest possible cutting length",
            format!("{:.1} mm ({per_cent:.1} % of this path)", s.cutting_length_mm),
        )],
        sentence: Some((
            "Shortest possible cutting length below the scallop target (widest strips)",
            format!("{:.0} mm: {per_cent:.1} % of {name}", s.cutting_length_mm),
        )),
        ..Figure::default()
    };
    Ok(Finding { figure: Some(figure), ..Finding::default() })
}
