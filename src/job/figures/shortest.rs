//! What no path can be shorter than.

use serde::Serialize;

use field::ShortestPossible;
use metrology::path_figures;
use report::Figure;
use toolpath::{Faces, PlanError, Step};
use work::monitor::Monitor;

use super::words::value;
use crate::JobError;
use crate::run::{Finding, Run};

const SECONDS_PER_MINUTE: f64 = 60.0;

/// The length that no path below the scallop height can go under, by the widest strips over all directions.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ShortestFigures {
    /// Of the cutter's way, as `path.cutting_length_mm` is.
    pub cutting_length_mm: f64,
    /// Of the contact's way on the part: the integral of 1/(widest strip).
    pub contact_length_mm: f64,
    /// The first of these over the path's cutting length.
    pub efficiency: f64,
    /// The first of these at the feed, s: no path below the scallop height that cuts no deeper than the part
    /// takes less, whatever its turns and links.
    pub least_time_s: f64,
    /// That over the path's machining time.
    pub time_efficiency: f64,
    /// Share of the part's area where it is about as concave as the cutter and the strip was limited.
    pub limited_fraction: f64,
}

impl ShortestFigures {
    /// Of a path with a cutting length, mm, at a feed, mm/min, and a machining time, s; `None` for an empty
    /// one.
    pub fn new(shortest: &ShortestPossible, cutting_length_mm: f64, feed: f64, time_s: f64) -> Option<Self> {
        let least_time_s = shortest.cutting_mm / feed * SECONDS_PER_MINUTE;
        (cutting_length_mm > 0.0).then(|| Self {
            least_time_s,
            time_efficiency: least_time_s / time_s,
            cutting_length_mm: shortest.cutting_mm,
            contact_length_mm: shortest.contact_mm,
            efficiency: shortest.cutting_mm / cutting_length_mm,
            limited_fraction: shortest.limited_fraction,
        })
    }
}

pub(super) fn find(run: &Run<'_>, monitor: &dyn Monitor) -> Result<Finding, JobError> {
    let length = path_figures(run.path(), 0.0).cutting_length_mm;
    let (scene, planned) = (run.scene(), run.planned);
    // Tools that lean take other strips, a path for some places covers a part of the whole, one by levels covers
    // it more than once, and nobody planned a program from elsewhere for a scallop height.
    let request = run.request;
    let covers_all = request.axis.is_none()
        && request.faces() == Faces::ALL
        && !request.is_for_places()
        && request.stepdown.is_none()
        && request.foreign().is_none();
    let (true, Step::Scallop(height)) = (covers_all && run.session.pocket.is_none(), request.step) else {
        return Ok(Finding::default());
    };
    let shortest = match run.session.shortest_possible(&request.tooling.cutter, height, monitor) {
        Err(PlanError::Cancelled(cancelled)) => return Err(cancelled.into()),
        // No smooth surface can be fitted to the part: its directions are unknown.
        Err(_) => return Ok(Finding::default()),
        Ok(shortest) => shortest,
    };
    let time = planned.time(scene, monitor)?;
    let shortest = ShortestFigures::new(&shortest, length, request.tooling.cutting.feed_rate, time);
    let Some(s) = shortest else { return Ok(Finding::default()) };
    let per_cent = 100.0 * s.efficiency;
    let name = &run.request.name;
    let figure = Figure {
        key: "shortest",
        value: value(&s)?,
        rows: vec![
            (
                "shortest possible cutting length",
                format!("{:.1} mm ({per_cent:.1} % of this path)", s.cutting_length_mm),
            ),
            (
                "that length at the feed",
                format!("{:.1} s ({:.1} % of the machining time)", s.least_time_s, 100.0 * s.time_efficiency),
            ),
        ],
        sentence: Some((
            "Shortest possible cutting length below the scallop target (widest strips)",
            format!(
                "{:.0} mm: {per_cent:.1} % of {name}; at the feed {:.1} % of its time",
                s.cutting_length_mm,
                100.0 * s.time_efficiency
            ),
        )),
        ..Figure::default()
    };
    Ok(Finding { figure: Some(figure), ..Finding::default() })
}
