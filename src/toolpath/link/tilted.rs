//! Joins the passes of a tilted cutter into one program.
//!
//! Enters: passes as touches of the cutter, mm. Leaves: a program that feeds along every pass from one end to
//! the other, and goes from one to the next by the quickest way that is clear: on the surface, a little off
//! it, over the block of part and stock, or around a sphere ([`ways`]). Where the tool is to keep away from
//! something, passes are repaired first, and what it comes too near to in between, where no way is clear, is
//! noted.

mod ahead;
mod bent;
mod ways;

use super::order::{Costs, Visit, is_closed, order};
use super::{Speeds, longest_link, plane_interval};
use crate::RepairSummary;
use crate::moves::touch::Touch;
use crate::tilt::repair::{Repaired, Room, repair};
use crate::tilt::tilted::{MoveRules, TiltedPasses, Tilting, located, reversed};
use crate::tilt::turning::{TurningRates, even_out, too_fast};
use crate::vocabulary::{Links, PlanError, PlanSettings, Setup};
use ahead::run_on;
use bent::Bent;
use collision::{Check, Interference, Obstacle};
use cutter::{Cutter, Solid};
use geometry::Point3;
use motion::{ClPoint, Move, MoveKind, Toolpath};
use ways::{Block, Leg, Ways};
use work::monitor::{self, Monitor};

/// Times that axes are evened out and passes repaired by turns.
const EVENINGS: usize = 2;

/// Moves take an axis off that of its pass by no more than this share of what it may turn to the pass beside
/// it.
const STRAYING: f64 = 5e-3;

/// Joins passes; see the module. Leaves, beside the path, [`crate::Plan::too_near_between`].
///
/// # Errors
/// [`PlanError::Axis`] where the rule gives no axis for a pass fed the other way round, or cancelled.
pub(crate) fn join_tilted(
    passes: TiltedPasses,
    both_ways: bool,
    tilting: &Tilting,
    setup: &Setup<'_>,
    notes: &mut Vec<String>,
) -> Result<(Toolpath, f64), PlanError> {
    let Setup { part, cutter, settings, monitor } = *setup;
    let TiltedPasses { passes, tolerance, smoothing } = passes;
    let passes: Vec<Vec<Touch>> = passes.into_iter().filter(|p| p.len() >= 2).collect();
    monitor.start("joining passes", 0);
    let contacts: Vec<Vec<Point3>> =
        passes.iter().map(|pass| pass.iter().map(|touch| touch.contact.point).collect()).collect();
    // Without anything to keep away from, ways still keep the cutter out of the part.
    let alone = Solid::of_cutter(cutter, None);
    let depth = settings.chord_tolerance + part.mesh_deviation();
    let obstacle = Obstacle::new(part.mesh(), part.bvh());
    let cutter_alone = Interference {
        checks: vec![Check { solid: &alone, obstacle, needed: -depth }],
        ..Interference::default()
    };
    let touching = tilting.interference.unwrap_or(&cutter_alone);
    let bent = (settings.joining.links == Links::Surface).then(|| Bent {
        part,
        cutter,
        tilting,
        touching,
        interval: plane_interval(cutter, settings.step),
        longest: longest_link(&settings.joining, cutter, settings.step),
        chord_tolerance: settings.chord_tolerance,
        thinning: tolerance,
    });
    let block = Block::of(part, settings);
    let ways = Ways::new(part, cutter, settings, Speeds::of(settings), &block, touching, bent);
    // Where such a path begins and ends hardly matters: it comes and goes along the tool's axis.
    let costs = Costs { between: &|a, b| ways.cost((b - a).norm()), start: &|_| 0.0, finish: &|_| 0.0 };
    let visits = order(&contacts, both_ways, costs);
    monitor::check(monitor)?;
    let turned = |k: usize| {
        let contacts = &contacts[visits[k].pass];
        let pass = visited(&passes[visits[k].pass], contacts, &visits[k], cutter, tilting)?;
        Ok::<_, PlanError>(if is_closed(contacts) { pass } else { run_on(pass, tilting.axis, setup)? })
    };
    let turned = work::parallel::try_map(visits.len(), turned)?;
    let passes = cleared(turned, cutter, tilting, notes, monitor)?;
    let interval = plane_interval(cutter, settings.step);
    let rules = MoveRules {
        keep: tilting.interference,
        turning: tilting.most_turning,
        straying: tilting.most_turning_across.map(|rate| STRAYING * rate * interval),
    };
    let pieces = work::parallel::try_map(passes.len(), |k| {
        LocatedPass::of(&passes[k], tolerance, smoothing, rules, monitor)
    })?;
    let between = work::parallel::try_map(pieces.len().saturating_sub(1), |k| {
        ways.between(&pieces[k].ends[1], &pieces[k + 1].ends[0], monitor)
    })?;
    let path = program(&pieces, &between, &ways, settings);
    let too_near = tilting.interference.and_then(|keep| too_near_between(keep, &path));
    let missing = too_near.map_or(0.0, |(missing, note)| {
        notes.push(note);
        missing
    });
    Ok((path, missing))
}

/// The passes repaired so that the tool stays clear, with axes that turn as slowly as is asked for.
fn cleared(
    passes: Vec<Vec<Touch>>,
    cutter: &Cutter,
    tilting: &Tilting,
    notes: &mut Vec<String>,
    monitor: &dyn Monitor,
) -> Result<Vec<Vec<Touch>>, PlanError> {
    let rates = TurningRates { along: tilting.most_turning, across: tilting.most_turning_across };
    let limited = rates.along.or(rates.across).is_some();
    // Where a ball touches hangs on its axis nowhere.
    let firm = limited && !cutter.is_ball();
    let room = tilting.interference.map(|keep| Room { cutter, keep, firm });
    let mut summary = RepairSummary::default();
    let mut repair_all = |passes: Vec<Vec<Touch>>| {
        let again = |k: usize| repaired(passes[k].clone(), room, tilting, monitor);
        let again = work::parallel::try_map(passes.len(), again)?;
        again.iter().for_each(|one| summary.add(&one.summary));
        Ok::<_, PlanError>(again.into_iter().flat_map(|one| one.passes).collect::<Vec<_>>())
    };
    let mut passes = repair_all(passes)?;
    if limited {
        let mut left = None;
        for _ in 0..EVENINGS {
            even_out(&mut passes, cutter, rates, room, monitor)?;
            // The touches are clear; moves between them may be no longer.
            passes = repair_all(passes)?;
            left = too_fast(&passes, cutter, rates);
            if left.is_none() {
                break;
            }
        }
        notes.extend(left.map(|left| left.note()));
    }
    notes.extend(summary.notes());
    passes.retain(|pass| pass.len() >= 2);
    Ok(passes)
}

/// A pass on which the tool stays clear.
fn repaired(
    pass: Vec<Touch>,
    room: Option<Room<'_>>,
    tilting: &Tilting,
    monitor: &dyn Monitor,
) -> Result<Repaired, PlanError> {
    Ok(match room {
        Some(room) => repair(&pass, room, tilting.most_turning, monitor)?,
        None => Repaired { passes: vec![pass], summary: RepairSummary::default() },
    })
}

/// A pass, or a piece of one.
struct LocatedPass {
    /// Its moves' ends.
    at: Vec<ClPoint>,
    /// The touches at which it begins and ends.
    ends: [Touch; 2],
}

impl LocatedPass {
    fn of(
        pass: &[Touch],
        tolerance: f64,
        smoothing: Option<f64>,
        rules: MoveRules<'_>,
        monitor: &dyn Monitor,
    ) -> Result<Self, PlanError> {
        let ends = [pass[0], pass[pass.len() - 1]];
        Ok(Self { at: located(pass, tolerance, smoothing, rules, monitor)?, ends })
    }
}

/// All pieces one after the other.
fn program(pieces: &[LocatedPass], between: &[Vec<Leg>], ways: &Ways, settings: &PlanSettings) -> Toolpath {
    let (Some(first), Some(last)) = (pieces.first(), pieces.last()) else {
        return Toolpath::new(ways.above(), Vec::new());
    };
    let from = ways.away(&first.at[0]);
    let start = from[from.len() - 1];
    let mut moves = Vec::new();
    let mut at = start;
    let mut push = |to: ClPoint, kind: MoveKind, pass: usize| {
        let feed_rate = match kind {
            MoveKind::Rapid => 0.0,
            MoveKind::Plunge => settings.plunge_rate,
            MoveKind::Cut | MoveKind::Link => settings.feed_rate,
            MoveKind::Retract => {
                settings.feed_rate.min(60.0 * ways.rates.entering(&at.tip, &to.tip, &to.axis))
            }
        };
        moves.push(Move { to, kind, feed_rate, pass: pass as u32 });
        at = to;
    };
    ways.into(&from, &first.at[0]).into_iter().for_each(|(to, kind)| push(to, kind, 0));
    for (k, piece) in pieces.iter().enumerate() {
        if let Some(way) = k.checked_sub(1).and_then(|k| between.get(k)) {
            way.iter().for_each(|(to, kind)| push(*to, *kind, k));
        }
        piece.at[1..].iter().for_each(|to| push(*to, MoveKind::Cut, k));
    }
    let mut kind = MoveKind::Retract;
    for to in ways.away(&last.ends[1].at) {
        push(to, std::mem::replace(&mut kind, MoveKind::Rapid), pieces.len() - 1);
    }
    Toolpath::new(start, moves)
}

/// How much nearer than asked the tool comes to anything between passes at most, mm, and that in words.
fn too_near_between(keep: &Interference, path: &Toolpath) -> Option<(f64, String)> {
    let found = keep.on_path(path, |to| !to.kind.is_on_surface());
    let (_, worst) = found.iter().max_by(|a, b| a.1.depth.total_cmp(&b.1.depth))?;
    let p = worst.nearest.place;
    let note = format!(
        "{} moves between passes come nearer to part or fixtures than asked; {:.3} mm are missing at ({:.3}, {:.3}, {:.3}): \
         lean the tool otherwise there, or clear the way",
        found.len(),
        worst.depth,
        p.x,
        p.y,
        p.z
    );
    Some((worst.depth, note))
}

/// A pass as it is visited.
fn visited(
    pass: &[Touch],
    contacts: &[Point3],
    visit: &Visit,
    cutter: &Cutter,
    tilting: &Tilting,
) -> Result<Vec<Touch>, PlanError> {
    if is_closed(contacts) {
        let mut pass = pass[..pass.len() - 1].to_vec();
        pass.rotate_left(visit.start);
        pass.push(pass[0]);
        return Ok(pass);
    }
    if !visit.reversed {
        return Ok(pass.to_vec());
    }
    if tilting.axis.follows_feed() {
        return Ok(reversed(pass, cutter, tilting.axis)?);
    }
    Ok(pass.iter().rev().map(Touch::fed_back).collect())
}

#[cfg(test)]
mod tests;
