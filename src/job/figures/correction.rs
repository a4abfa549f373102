//! What planning in rounds found: plan, measure the ridges, correct, plan again.

use report::Figure;
use work::monitor::Monitor;

use super::value;
use crate::JobError;
use crate::run::{Finding, Run};

/// What the word means.
const MEANING: (&str, &str) = (
    "correction",
    "A plan is cut and its ridges are measured. Where they exceed the target, passes are moved together; where none comes \
     near it, apart. Then the path is planned again, up to three plans in all, and the best one is kept.",
);

pub(super) fn find(run: &Run<'_>, _: &dyn Monitor) -> Result<Finding, JobError> {
    let Some(correction) = &run.planned.correction else { return Ok(Finding::default()) };
    let um = |mm: f64| format!("{:.3}", 1e3 * mm);
    let rounds = correction.rounds.iter().map(|round| {
        let [least, most] = round.factors;
        format!(
            "highest {} ± {}, median {} µm, {:.0} mm, widths × {least:.3} to {most:.3}",
            um(round.highest_mm),
            um(round.error_bound_mm),
            um(round.median_mm),
            round.cutting_length_mm
        )
    });
    const NAMES: [&str; 3] = ["first plan", "second plan", "third plan"];
    let mut rows: Vec<(&'static str, String)> = NAMES.into_iter().zip(rounds).collect();
    rows.push(("plan kept", format!("{} of {}", correction.kept, correction.rounds.len())));
    let heights: Vec<String> = correction.rounds.iter().map(|round| um(round.highest_mm)).collect();
    let name = &run.request.name;
    let figure = Figure {
        key: "correction",
        value: value(correction)?,
        rows,
        meaning: Some(MEANING),
        sentence: (heights.len() > 1).then(|| {
            let text = format!("{} µm: {name} (plan {} kept)", heights.join(", "), correction.kept);
            ("Highest ridge of each plan in turn", text)
        }),
        ..Figure::default()
    };
    Ok(Finding { figure: Some(figure), ..Finding::default() })
}
