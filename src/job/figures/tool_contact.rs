//! The finished path against part and fixtures, whatever its planner thought of it.

use collision::{Check, Interference, Obstacle, Shortfall};
use metrology::View;
use motion::{Move, MoveKind};
use report::{Claim, Gravity, place};
use work::monitor::Monitor;

use super::more_moves;
use crate::JobError;
use crate::run::{Finding, Run};

/// That shank and holder touch neither part nor fixture, the cutter no fixture, nor the part while it is not cutting. Of
/// tools that lean.
pub(super) fn find(run: &Run<'_>, monitor: &dyn Monitor) -> Result<Finding, JobError> {
    let View::Normals(_) = run.view() else { return Ok(Finding::default()) };
    monitor.start("looking for collisions", 0);
    let (tool, mesh_deviation) = (run.tool, run.part().mesh_deviation());
    let part = Obstacle::new(run.part().mesh(), run.part().bvh());
    let slack = -(run.scene().tolerance.gouge + mesh_deviation);
    let check = |solid, obstacle, needed| Check { solid, obstacle, needed };
    let mut always: Vec<Check> =
        tool.holder.iter().map(|solid| check(solid, part, -mesh_deviation)).collect();
    for (mesh, bvh) in run.fixtures {
        let solids = std::iter::once(&tool.cutter).chain(&tool.holder);
        always.extend(solids.map(|solid| check(solid, Obstacle::new(mesh, bvh), 0.0)));
    }
    let mut found = contacts(run, always, &|_| true);
    found.extend(contacts(run, vec![check(&tool.cutter, part, slack)], &|to| to.kind == MoveKind::Rapid));
    Ok(Finding { claims: vec![clear(&found, run)], ..Finding::default() })
}

/// What the chosen moves touch: the move, what is missing there, and what of the tool it is.
fn contacts<'a>(
    run: &Run<'_>,
    checks: Vec<Check<'a>>,
    chosen: &(dyn Fn(&Move) -> bool + Sync),
) -> Vec<(usize, Shortfall, &'static str)> {
    let name =
        |check: &Check| if std::ptr::eq(check.solid, &run.tool.cutter) { "the cutter" } else { "the holder" };
    let whose: Vec<&str> = checks.iter().map(name).collect();
    let keep = Interference { checks, greatest_tilt: 0.0, greatest_lift: 0.0 };
    let found = keep.on_path(run.path(), chosen);
    found.into_iter().map(|(k, hit)| (k, hit, whose[hit.check])).collect()
}

fn clear(found: &[(usize, Shortfall, &str)], run: &Run<'_>) -> Claim {
    let claim = |depth| Claim::length("collision", Gravity::Crash, 0.0, depth, 0.0);
    let deepest = found.iter().reduce(|a, b| if b.1.depth > a.1.depth { b } else { a });
    let Some((index, worst, what)) = deepest else {
        return claim(0.0).told("no part of the tool that does not cut touches part or fixture".into());
    };
    let at = worst.nearest.place;
    let text = format!(
        "{what} runs at least {:.3} mm into part or fixture at {}, move {index}{}{}",
        worst.depth,
        place(at.into()),
        run.program_line(*index as u32),
        more_moves(found.len())
    );
    claim(worst.depth).told(text)
}
