//! Numbers and words that several figures use.

use serde::Serialize;
use serde_json::Value;

use report::ReportError;

use crate::JobError;

/// Numbers as report.json has them.
pub(super) fn value(figures: &impl Serialize) -> Result<Value, JobError> {
    serde_json::to_value(figures).map_err(|e| ReportError::Json(e.to_string()).into())
}

/// A share as per cent with two digits.
pub(super) fn share(ratio: Option<f64>) -> String {
    ratio.map_or("-".to_owned(), |r| format!("{:.2} %", 100.0 * r))
}

/// On how many moves more than the one that was told.
pub(super) fn more_moves(moves: usize) -> String {
    match moves {
        0 | 1 => String::new(),
        2 => ", and on one more move".to_owned(),
        n => format!(", and on {} more moves", n - 1),
    }
}
