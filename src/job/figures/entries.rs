//! How the tool of a program from elsewhere enters stock, and how high it cuts: what a planner of ours would see to itself.

use motion::MoveKind;
use report::{Claim, Gravity};
use sim::{ENGAGED, MoveRemoval};

use crate::run::{Finding, Run};
use crate::tool::ToolMoves;

/// First and last cut of each tool, plunges without an entry, and cuts above the flutes; nothing of paths that were planned here.
pub(super) fn of(run: &Run<'_>, moves: &[MoveRemoval]) -> Finding {
    if run.request.foreign().is_none() {
        return Finding::default();
    }
    let mut found = Finding::default();
    for tool in run.tools {
        let first = (tool.first as usize).min(moves.len());
        let own = Entries { run, tool, moves: &moves[first..moves.len().min(first + tool.path.len())] };
        found.notes.extend(own.first_and_last().into_iter().chain(own.plunges()));
        found.claims.extend(own.within_flutes());
    }
    found
}

/// What the moves of one tool removed.
struct Entries<'a> {
    run: &'a Run<'a>,
    tool: &'a ToolMoves<'a>,
    moves: &'a [MoveRemoval],
}

fn cuts(removed: &MoveRemoval) -> bool {
    removed.volume > 0.0 && removed.axial > ENGAGED
}

impl Entries<'_> {
    /// Index in the whole path.
    fn index(&self, k: usize) -> u32 {
        self.tool.first + k as u32
    }

    fn first_and_last(&self) -> Option<String> {
        let [first, last] =
            [self.moves.iter().position(cuts)?, self.moves.iter().rposition(cuts)?].map(|k| self.index(k));
        let [from, to] = [first, last].map(|k| self.run.line(k));
        let (name, tool) = (self.run.path().program_name(), self.run.tool_name(first));
        Some(format!("{name}{tool}: the first cut is in line {from}, the last one in line {to}"))
    }

    /// Feeds straight down into stock. A cutter that does not cut to its centre breaks there.
    fn plunges(&self) -> Option<String> {
        if self.tool.cutter.flat_radius() <= 0.0 {
            return None;
        }
        let moves = self.moves;
        let into_stock = |k: &usize| self.tool.path.moves[*k].kind == MoveKind::Plunge && cuts(&moves[*k]);
        let found: Vec<usize> = (0..moves.len()).filter(into_stock).collect();
        let deepest = found.iter().copied().max_by(|a, b| moves[*a].axial.total_cmp(&moves[*b].axial))?;
        let others = match found.len() {
            1 => String::new(),
            n => format!(", and {} more feeds do", n - 1),
        };
        let index = self.index(deepest);
        Some(format!(
            "{} line {}{} plunges {:.3} mm into stock without a ramp or helix{others}; the cutter must cut to its centre",
            self.run.path().program_name(),
            self.run.line(index),
            self.run.tool_name(index),
            moves[deepest].axial
        ))
    }

    /// That stock is not met above the cutting edges, where their length is known.
    fn within_flutes(&self) -> Option<Claim> {
        let holder = self.tool.holder.map(|holder| holder.cutting_length());
        let limit = self.tool.cutter.stated_length().or(holder)?;
        let fed = |k: &usize| self.tool.path.moves[*k].kind != MoveKind::Rapid;
        let moves = self.moves;
        let moves_fed = (0..moves.len()).filter(fed);
        let highest = moves_fed.max_by(|a, b| moves[*a].axial.total_cmp(&moves[*b].axial))?;
        let height = moves[highest].axial;
        let text = format!(
            "the cutter meets stock up to {height:.3} mm above its tip{} (length of its edges {limit})",
            self.run.program_line(self.index(highest))
        );
        Some(Claim::length("flute length", Gravity::Crash, limit, height, 0.0).told(text))
    }
}
