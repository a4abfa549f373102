//! Rapid moves that lift a cutter straight out of what it has just cut.
//!
//! A cutter that goes back along its axis touches the wall beside it as deep as the feed before it did, and
//! gouges tell how deep that was. Such moves are judged by the gouge tolerance, all other rapid moves as
//! collisions. It is the end of the cutter that counts, not the shank above: what the end meets on its way
//! that it did not touch before, it has not cut.

use collision::Obstacle;
use cutter::Solid;
use motion::{ClPoint, Move, MoveKind, ROUNDING, Toolpath};

/// Places that the program rounds may lie off a line between them, and deeper, by so much, mm.
const WRITTEN: f64 = 4.0 * ROUNDING;

/// Which moves of a path are lifts, by the `end` of the cutter. The obstacle stands off the true surface by up
/// to `off`, mm, so that a touch reads as deep or as far, and what is as deep as another place may read so much
/// deeper twice.
pub(super) fn lifts(obstacle: Obstacle<'_>, end: &Solid, path: &Toolpath, off: f64) -> Vec<bool> {
    // How near the part the cutter came to rest before the lift, if it touches there.
    let mut rest: Option<f64> = None;
    let mut is_one = |k: usize, to: &Move| {
        if to.kind != MoveKind::Rapid {
            rest = touch(obstacle, end, &to.to, off);
            return false;
        }
        let from = path.location_before(k);
        rest = rest.filter(|rest| {
            let deepest = rest.min(0.0) - 2.0 * off - WRITTEN;
            is_lift(&from, &to.to) && obstacle.swept_clearance(end, &from, &to.to, deepest).is_none()
        });
        rest.is_some()
    };
    path.moves.iter().enumerate().map(|(k, to)| is_one(k, to)).collect()
}

/// The distance from the part where a cutter stands, mm, if it touches.
fn touch(obstacle: Obstacle<'_>, end: &Solid, at: &ClPoint, off: f64) -> Option<f64> {
    obstacle.clearance(end, at, off + WRITTEN).map(|near| near.distance)
}

/// Whether a move goes back along the axis.
fn is_lift(from: &ClPoint, to: &ClPoint) -> bool {
    let way = to.tip - from.tip;
    let up = way.dot(&from.axis);
    from.axis == to.axis && up > 0.0 && (way - from.axis * up).norm() <= WRITTEN
}

/// The path with the rapid moves alone that `chosen` tells; what it fed it feeds.
pub(super) fn with_rapids(path: &Toolpath, chosen: impl Fn(usize) -> bool) -> Toolpath {
    let kind = |k: usize, to: &Move| match to.kind {
        MoveKind::Rapid if !chosen(k) => MoveKind::Retract,
        kind => kind,
    };
    let moves = path.moves.iter().enumerate().map(|(k, to)| Move { kind: kind(k, to), ..*to }).collect();
    Toolpath { moves, ..path.clone() }
}
