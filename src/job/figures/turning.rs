//! How fast the tool axis turns along passes and from pass to pass, against what the scene allows.

use metrology::{FastestTurn, fastest_turn, fastest_turn_across};
use report::{Claim, Gravity, place};
use work::monitor::Monitor;

use crate::JobError;
use crate::run::{Finding, Run};

/// Where the scene limits it.
pub(super) fn find(run: &Run<'_>, monitor: &dyn Monitor) -> Result<Finding, JobError> {
    let Some(axis) = &run.request.axis else {
        return Ok(Finding::default());
    };
    let (part, cutter, path) = (run.part(), &run.tooling().cutter, run.path());
    let mut claims = Vec::new();
    if let Some(limit) = axis.most_turning {
        let found = fastest_turn(part, cutter, path, monitor)?;
        claims.push(claim(run, "turning", limit, found, "along a pass"));
    }
    if let Some(limit) = axis.most_turning_across {
        let found = fastest_turn_across(part, cutter, path, monitor)?;
        claims.push(claim(run, "turning_across", limit, found, "from pass to pass"));
    }
    Ok(Finding { claims, ..Finding::default() })
}

fn claim(run: &Run<'_>, what: &'static str, limit: f64, found: Option<FastestTurn>, where_: &str) -> Claim {
    let limit = limit.to_degrees();
    let (fastest, text) = match found {
        None => (0.0, format!("the axis never turns {where_}")),
        Some(turn) => {
            let rate = turn.rate.to_degrees();
            let (index, line) = (turn.move_index, run.program_line(turn.move_index));
            let at = place(turn.at.into());
            let text = format!(
                "the axis turns by up to {rate:.3} degrees a mm of contact {where_} (limit {limit:.3}) at {at}, move {index}{line}"
            );
            (rate, text)
        }
    };
    let claim = Claim::length(what, Gravity::Finish, limit, fastest, 0.0).told(text);
    Claim { unit: "deg_per_mm", ..claim }
}
