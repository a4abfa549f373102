//! How the tool of a program from elsewhere enters stock, and how high it cuts: what a planner of ours would
//! see to itself.

use metrology::View;
use motion::MoveKind;
use report::{Claim, Gravity};
use sim::{ENGAGED, InStock, KeptOut, MoveRemoval};
use work::monitor::Monitor;

use super::removal::first_in_stock;
use crate::JobError;
use crate::run::{Finding, Run};
use crate::tool::ToolMoves;

/// First and last cut of each tool, plunges without an entry, and cuts above the flutes; nothing of paths
/// that were planned here. Stock is met up to `bound` mm higher than cells or voxels show.
pub(super) fn of(
    run: &Run<'_>,
    moves: &[MoveRemoval],
    bound: f64,
    monitor: &dyn Monitor,
) -> Result<Finding, JobError> {
    if run.request.foreign().is_none() {
        return Ok(Finding::default());
    }
    let mut found = Finding::default();
    for tool in run.tools {
        let first = (tool.first as usize).min(moves.len());
        let own = Entries { run, tool, moves: &moves[first..moves.len().min(first + tool.path.len())] };
        found.notes.extend(own.first_and_last().into_iter().chain(own.plunges()));
        found.claims.extend(own.within_flutes(bound, monitor)?);
    }
    Ok(found)
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
    fn within_flutes(&self, bound: f64, monitor: &dyn Monitor) -> Result<Option<Claim>, JobError> {
        let holder = self.tool.holder.map(|holder| holder.cutting_length());
        let Some(limit) = self.tool.cutter.stated_length().or(holder) else { return Ok(None) };
        let fed = |k: &usize| self.tool.path.moves[*k].kind != MoveKind::Rapid;
        let moves = self.moves;
        let moves_fed = (0..moves.len()).filter(fed);
        let Some(highest) = moves_fed.max_by(|a, b| moves[*a].axial.total_cmp(&moves[*b].axial)) else {
            return Ok(None);
        };
        let seen = (moves[highest].axial, self.index(highest));
        let (mut height, mut index, mut bound) = (seen.0, seen.1, bound);
        // What cells show fails by itself. What stands between their centres is asked of the moves.
        let by_cells = matches!(self.run.view(), View::Heights(_));
        if by_cells && height <= limit {
            let own = self.tool.first as usize..self.tool.first as usize + moves.len();
            let above =
                |k: usize| (own.contains(&k) && fed(&(k - own.start))).then_some(KeptOut::Above(limit));
            match first_in_stock(self.run, above, monitor)? {
                // A hair less, so that the sum is not beyond the limit by rounding.
                None => bound = (limit - height) * (1.0 - 1e-12),
                Some(InStock { move_index, depth: Some(depth), .. }) => {
                    (height, index, bound) = (limit + depth, move_index, 0.0);
                }
                Some(InStock { move_index, .. }) => index = move_index,
            }
        } else if by_cells {
            bound = 0.0;
        }
        let line = self.run.program_line(index);
        let text = match height + bound <= limit || height > limit {
            true => format!(
                "the cutter meets stock up to {height:.3} mm above its tip{line} (length of its edges {limit})"
            ),
            false => format!(
                "the cutter meets stock up to {height:.3} mm above its tip at the centres of cells, and may meet it higher{line} \
                 (length of its edges {limit})"
            ),
        };
        Ok(Some(Claim::length("flute length", Gravity::Crash, limit, height, bound).told(text)))
    }
}
