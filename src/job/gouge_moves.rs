//! Which move of which toolpath, and which line of its program, cut each gouge.

use cutter::Cutter;
use geometry::{Point3, Vector3};
use metrology::GougeRegion;
use motion::{Cutters, Toolpath};
use sim::{Envelope, NOT_CUT};

use super::earlier::{EarlierPath, WholePath};

/// The moves of the last toolpath, and what makes them.
#[derive(Clone, Copy)]
pub(crate) struct OwnMoves<'a> {
    pub path: &'a Toolpath,
    pub cutters: &'a Cutters,
}

/// Names the moves of gouges, which are told by their index in the `whole` path. Where stock itself lies
/// below the part no move cut.
pub(crate) fn name(
    regions: &mut [GougeRegion],
    whole: &WholePath<'_>,
    earlier: &[EarlierPath],
    own: OwnMoves<'_>,
) {
    for region in regions.iter_mut().filter(|region| region.move_index != NOT_CUT) {
        let at = region.at_mm.into();
        let (mut toolpath, mut move_index) = whole.own_move(region.move_index);
        // What cut deepest may have cut behind the face only, which another toolpath came through.
        let is_own = toolpath == earlier.len();
        let through = if is_own { None } else { came_through(whole, region.move_index, &at) };
        if let Some(own) = through.map(|by| whole.own_move(by)).filter(|own| own.0 > toolpath) {
            (toolpath, move_index) = own;
        }
        let its = earlier.get(toolpath);
        let OwnMoves { path, cutters } =
            its.map_or(own, |before| OwnMoves { path: &before.path, cutters: &before.cutters });
        let step = step_of_cut(path, cutters.of_move(move_index), move_index as usize, &at);
        region.move_index = step as u32;
        region.line = path.line_of(step).unwrap_or_default();
        region.tool = path.named_tool_of(step);
        region.toolpath = its.map(|before| before.name.clone());
        region.program = its.map(|before| before.path.program_name().to_owned());
    }
}

/// The lowest of all moves over a place of the design where the one that cut deepest stays above it.
fn came_through(whole: &WholePath<'_>, deepest: u32, at: &Point3) -> Option<u32> {
    let envelope = Envelope::new(&whole.cutters, &whole.path);
    let stays_above = envelope.height(deepest, at.x, at.y).is_none_or(|height| height > at.z);
    let all: Vec<u32> = (0..whole.path.len() as u32).collect();
    envelope.lowest(at.x, at.y, &all).map(|(_, by)| by).filter(|_| stays_above)
}

/// The move that took the cutter to where it cuts deepest, at a place that a move cuts. That is the one before
/// where the move begins there.
fn step_of_cut(path: &Toolpath, cutter: &Cutter, step: usize, at: &Point3) -> usize {
    /// Places along the move; a start that is lowest by less than a share of it counts as its end.
    const PLACES: u32 = 64;
    let (Some(before), Some(this)) = (step.checked_sub(1), path.moves.get(step)) else { return step };
    let (from, to) = (path.location_before(step), this.to);
    if from.axis != Vector3::z() || to.axis != from.axis {
        return step;
    }
    let height = |k: u32| {
        let tip = from.towards(&to, f64::from(k) / f64::from(PLACES)).tip;
        cutter.height((tip.x - at.x).hypot(tip.y - at.y)).map_or(f64::INFINITY, |above| tip.z + above)
    };
    // A place at the very side of the sweep may lie beside all of these places.
    let begins = height(0).is_finite() && (1..=PLACES).all(|k| height(k) >= height(0));
    if begins { before } else { step }
}
