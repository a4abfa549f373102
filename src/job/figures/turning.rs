//! How fast the tool axis turns along passes, against what the scene allows.

use metrology::fastest_turn;
use report::{Claim, Gravity, place};
use work::monitor::Monitor;

use crate::JobError;
use crate::run::{Finding, Run};

/// Where the scene limits it.
pub(super) fn find(run: &Run<'_>, monitor: &dyn Monitor) -> Result<Finding, JobError> {
    let Some(limit) = run.request.axis.as_ref().and_then(|axis| axis.most_turning) else {
        return Ok(Finding::default());
    };
    let limit = limit.to_degrees();
    let found = fastest_turn(run.part(), &run.scene().cutter, run.path(), monitor)?;
    let (fastest, text) = match found {
        None => (0.0, "the axis never turns along a pass".to_owned()),
        Some(turn) => {
            let rate = turn.rate.to_degrees();
            let (index, line) = (turn.move_index, run.program_line(turn.move_index));
            let at = place(turn.at.into());
            let text = format!(
                "the axis turns by up to {rate:.3} degrees a mm of contact (limit {limit:.3}) at {at}, move {index}{line}"
            );
            (rate, text)
        }
    };
    let claim = Claim::length("turning", Gravity::Finish, limit, fastest, 0.0).told(text);
    Ok(Finding { claims: vec![Claim { unit: "deg_per_mm", ..claim }], ..Finding::default() })
}
