//! How the tool of a program from elsewhere enters stock, and how high it cuts: what a planner of ours would see to itself.

use motion::MoveKind;
use report::{Claim, Gravity};
use sim::{ENGAGED, MoveRemoval};

use crate::run::{Finding, Run};

/// First and last cut, plunges without an entry, and cuts above the flutes; nothing of paths that were planned here.
pub(super) fn of(run: &Run<'_>, moves: &[MoveRemoval]) -> Finding {
    if run.request.foreign().is_none() {
        return Finding::default();
    }
    let notes = first_and_last(run, moves).into_iter().chain(plunges(run, moves)).collect();
    Finding { notes, claims: within_flutes(run, moves).into_iter().collect(), ..Finding::default() }
}

fn cuts(removed: &MoveRemoval) -> bool {
    removed.volume > 0.0 && removed.axial > ENGAGED
}

fn first_and_last(run: &Run<'_>, moves: &[MoveRemoval]) -> Option<String> {
    let [first, last] =
        [moves.iter().position(cuts)?, moves.iter().rposition(cuts)?].map(|k| run.line(k as u32));
    let name = run.path().program_name();
    Some(format!("{name}: the first cut is in line {first}, the last one in line {last}"))
}

/// Feeds straight down into stock. A cutter that does not cut to its centre breaks there.
fn plunges(run: &Run<'_>, moves: &[MoveRemoval]) -> Option<String> {
    if run.scene().cutter.flat_radius() <= 0.0 {
        return None;
    }
    let path = run.path();
    let into_stock = |k: &usize| path.moves[*k].kind == MoveKind::Plunge && cuts(&moves[*k]);
    let found: Vec<usize> = (0..moves.len().min(path.len())).filter(into_stock).collect();
    let deepest = found.iter().copied().max_by(|a, b| moves[*a].axial.total_cmp(&moves[*b].axial))?;
    let line = run.line(deepest as u32);
    let others = match found.len() {
        1 => String::new(),
        n => format!(", and {} more feeds do", n - 1),
    };
    Some(format!(
        "{} line {line} plunges {:.3} mm into stock without a ramp or helix{others}; the cutter must cut to its centre",
        path.program_name(),
        moves[deepest].axial
    ))
}

/// That stock is not met above the cutting edges, where their length is known.
fn within_flutes(run: &Run<'_>, moves: &[MoveRemoval]) -> Option<Claim> {
    let scene = run.scene();
    let holder = scene.holder.as_ref().map(|holder| holder.cutting_length());
    let limit = scene.cutter.stated_length().or(holder)?;
    let fed = |k: &usize| run.path().moves[*k].kind != MoveKind::Rapid;
    let moves_fed = (0..moves.len().min(run.path().len())).filter(fed);
    let highest = moves_fed.max_by(|a, b| moves[*a].axial.total_cmp(&moves[*b].axial))?;
    let height = moves[highest].axial;
    let text = format!(
        "the cutter meets stock up to {height:.3} mm above its tip{} (length of its edges {limit})",
        run.program_line(highest as u32)
    );
    Some(Claim::length("flute length", Gravity::Crash, limit, height, 0.0).told(text))
}
