//! The volume that a tool sweeps, as a solid, for any tool axis.
//!
//! Enters: the tool as a [`Solid`] and its moves, on each of which the tip runs straight while the axis turns
//! evenly ([`ClPoint::towards`]). Leaves: the signed distance of a place from the swept volume, mm, with the
//! time at which the tool comes nearest; for one move, and for all moves of a path through a search tree.
//!
//! Seen from a tool that stands still, a place runs along a smooth curve, and the distance from a convex
//! solid is a convex function of the place. Its supporting plane at one time and a bound on how the curve
//! bends therefore bound the distance from below at all other times, which both the tree and the search for
//! the nearest time rest on.
//!
//! A bound by speed alone would need many more looks. The tree holds the track of one point of the tool and a
//! mean axis. Boxes around the whole leaning tool would be so large that every place lies in them. A move
//! that turns the axis to its opposite is refused, since nothing says which way round.

mod moves;
mod search;
#[cfg(test)]
pub(crate) mod tests;
mod turning;

use cutter::Solid;
use geometry::Point3;
pub(crate) use moves::MovePart;
pub use moves::{SweptHit, SweptMoves};
use search::least;
pub(crate) use search::{Look, Moving, SHORTEST, Sample, Stretch};
pub use turning::Motion;

/// A move turns the axis to its very opposite, so that nobody can tell which way round.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("move {index} turns the tool axis around to its opposite: which way is not told")]
pub struct OppositeAxes {
    /// Index of the move.
    pub index: usize,
}

/// How near a tool comes on one move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Nearest {
    /// Signed distance, mm; negative where the tool passes over the place.
    pub distance: f64,
    /// When, from 0 at the begin of the move to 1 at its end.
    pub t: f64,
}

fn distance_at(solid: &Solid, motion: &Motion, q: &Point3, t: f64) -> f64 {
    let pose = motion.at(t);
    solid.distance(&pose.tip, &pose.axis, q)
}

/// The least distance within a stretch of a move, if it is below `limit`.
///
/// # Tolerance
/// As [`SweptMoves::nearest`].
pub(super) fn below(
    solid: &Solid,
    motion: &Motion,
    q: &Point3,
    range: [f64; 2],
    limit: f64,
) -> Option<Nearest> {
    if let Some(ball) = motion.ball(solid, std::slice::from_ref(q), range) {
        return least(&ball, q, range, limit);
    }
    let (mut best, mut now) = (None, limit);
    for piece in 0..solid.pieces() {
        if let Some(found) = least(&motion.piece(solid, piece), q, range, now) {
            (best, now) = (Some(found), found.distance);
        }
    }
    if solid.is_convex() {
        return best;
    }
    best.map(|found: Nearest| Nearest { distance: distance_at(solid, motion, q, found.t), ..found })
}
