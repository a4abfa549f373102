//! What planning in rounds found: plan, measure, correct, plan again.

use report::{Figure, FigureTable, micrometres, with_bound};
use work::monitor::Monitor;

use super::words::value;
use crate::JobError;
use crate::correction::CorrectionRound;
use crate::run::{Finding, Run};

/// What the word means.
const MEANING: (&str, &str) = (
    "correction",
    "A plan is cut and measured. Where ridges or borders stand above the target, passes are moved together; where none comes \
     near it, apart. Then the path is planned again, a dozen plans at most, and the best one is kept.",
);

/// The highest of all, µm. Of cells alone the bound is not that of the whole surface.
fn highest(round: &CorrectionRound) -> String {
    with_bound(Some(round.highest()), round.error_bound_mm.filter(|_| !round.of_cells_alone))
}

pub(super) fn find(run: &Run<'_>, _: &dyn Monitor) -> Result<Finding, JobError> {
    let Some(correction) = &run.planned.correction else { return Ok(Finding::default()) };
    let row = |(k, round): (usize, &CorrectionRound)| {
        let [least, most] = round.factors;
        vec![
            format!("{}{}", k + 1, if k + 1 == correction.kept { ", kept" } else { "" }),
            highest(round),
            if round.is_on_border() { "border" } else { "ridge" }.to_owned(),
            micrometres(round.median_mm),
            format!("{:.0}", round.cutting_length_mm),
            format!("{least:.3} to {most:.3}"),
        ]
    };
    let table = FigureTable {
        title: "Plans in turn",
        caption: "The first plan is by calculation. Each further one has its passes nearer or farther by the factors of the last \
                  column, from place to place.",
        columns: vec!["plan", "highest, µm", "which", "median, µm", "length, mm", "widths by"],
        rows: correction.rounds.iter().enumerate().map(row).collect(),
    };
    let heights: Vec<String> = correction.rounds.iter().map(highest).collect();
    let name = &run.request.name;
    let several = heights.len() > 1;
    let figure = Figure {
        key: "correction",
        value: value(correction)?,
        meaning: several.then_some(MEANING),
        sentence: several.then(|| {
            let text = format!("{} µm: {name} (plan {} kept)", heights.join(", "), correction.kept);
            ("Highest ridge or border of each plan in turn", text)
        }),
        table: several.then_some(table),
        ..Figure::default()
    };
    Ok(Finding { figure: Some(figure), ..Finding::default() })
}
