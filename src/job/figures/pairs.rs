//! Scallops of pairs of passes, calculated beside measured.

use metrology::PAIRS_HEADER;
use report::{Figure, FigureFile, FileContent, micrometres};
use work::monitor::Monitor;

use super::words::{share, value};
use crate::JobError;
use crate::run::{Finding, Run};

/// What the word means.
const MEANING: (&str, &str) = (
    "calculated",
    "The scallop that two neighbouring passes of a ball should leave by the finished path and the design alone, \
     beside the measured one at the same places (scallop_pairs.csv has every pair). Passes are parallel where \
     their directions differ by no more than a degree.",
);

pub(super) fn find(run: &Run<'_>, _: &dyn Monitor) -> Result<Finding, JobError> {
    let pairs = &run.measurement().pairs;
    let mut rows = Vec::new();
    if pairs.calculated_over_measured.is_some() {
        rows.push((
            "pairs of passes, parallel ones",
            format!("{}, {}", pairs.pair_count, pairs.parallel_count),
        ));
        let [all, parallel] =
            [pairs.calculated_over_measured, pairs.parallel_calculated_over_measured].map(share);
        rows.push(("scallop calculated over measured", format!("{all}, parallel {parallel}")));
    }
    if pairs.parallel_greatest_difference_mm.is_some() {
        let greatest = micrometres(pairs.parallel_greatest_difference_mm);
        let means = share(pairs.parallel_greatest_mean_difference);
        rows.push(("greatest difference of parallel pairs", format!("{greatest} µm, means {means}")));
    }
    let mut csv = format!("{PAIRS_HEADER}\n");
    pairs.pairs.iter().for_each(|pair| csv += &format!("{}\n", pair.csv()));
    let files = vec![FigureFile { name: "scallop_pairs.csv", content: FileContent::Text(csv) }];
    let figure = Figure {
        key: "scallop_pairs",
        value: value(pairs)?,
        rows,
        meaning: Some(MEANING),
        files,
        ..Figure::default()
    };
    Ok(Finding { figure: Some(figure), ..Finding::default() })
}
