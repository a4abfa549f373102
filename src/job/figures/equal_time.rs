//! The machining time that a toolpath was planned for.

use report::{Figure, FigureTable, duration, micrometres};
use work::monitor::Monitor;

use super::words::value;
use crate::JobError;
use crate::equal_time::TriedPlan;
use crate::run::{Finding, Run};

/// What the word means.
const MEANING: (&str, &str) = (
    "equal time",
    "The scallop height was sought whose plan takes the machining time that was asked for, links and all. What stands then is \
     measured as ever. Such plans are not corrected.",
);

pub(super) fn find(run: &Run<'_>, _: &dyn Monitor) -> Result<Finding, JobError> {
    let Some(found) = &run.planned.equal_time else { return Ok(Finding::default()) };
    let taken = found.taken_over_asked * found.asked_s;
    let height = micrometres(Some(found.scallop_mm));
    let name = &run.request.name;
    let row =
        |plan: &TriedPlan| vec![micrometres(Some(plan.scallop_mm)), format!("{:.1}", plan.machining_time_s)];
    let note = (!found.is_met()).then(|| {
        format!(
            "none of {} plans takes {} within 1 %; the nearest takes {} ({:+.2} %)",
            found.plans.len(),
            duration(found.asked_s),
            duration(taken),
            100.0 * (found.taken_over_asked - 1.0)
        )
    });
    let figure = Figure {
        key: "equal_time",
        value: value(found)?,
        rows: vec![(
            "planned for a time, scallop height",
            format!("{} of {}, {height} µm", duration(taken), duration(found.asked_s)),
        )],
        meaning: Some(MEANING),
        sentence: Some((
            "Planned for equal machining times",
            format!("{} of {} at scallops of {height} µm: {name}", duration(taken), duration(found.asked_s)),
        )),
        table: Some(FigureTable {
            title: "Plans for the time",
            caption: "The plans that were made until one took the time asked for.",
            columns: vec!["planned for, µm", "time, s"],
            rows: found.plans.iter().map(row).collect(),
        }),
        ..Figure::default()
    };
    Ok(Finding { figure: Some(figure), notes: note.into_iter().collect(), ..Finding::default() })
}
