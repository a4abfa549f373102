//! How near a tool comes to a mesh on a move.
//!
//! Seen from the tool a place q runs along a curve with the velocity `−(v + Ω×w)` and an acceleration of at
//! most `2|Ω×v| + |Ω||Ω×w|`, w its way from the tip. The supporting plane at one time and one place therefore
//! bounds the distance of all places of a box, or of a triangle, over a stretch of time from below: a surface
//! that the tool slides along is no nearer for that, since it moves along the plane. Stretches that this does
//! not settle are halved.

use super::piece::{Convex, Sample, ToolPiece, middle};
use super::{Clearance, Obstacle};
use cutter::Solid;
use geometry::{Node, Point3, Vector3};
use motion::ClPoint;
use std::collections::VecDeque;

/// A move counts as clear when nothing comes nearer than what is needed less this, mm. Less costs time where
/// a tool slides along a surface at just the distance that is needed.
pub(crate) const RESOLUTION: f64 = 1e-5;

/// The worst of a move is found to this share of what is missing.
const SHARE: f64 = 0.01;

/// Stretches of a move that are looked at once a place that is too near is known. A tool that ploughs along
/// below the surface is as deep at most times as it ever can be, and to tell the deepest would take for ever.
const MOST_LOOKS: usize = 100;

/// Axes are opposite when this close to it, rad.
const OPPOSITE: f64 = 1e-6;

/// The nearest that a tool comes to a mesh on a move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SweptClearance {
    /// When, from 0 at the begin of the move to 1 at its end.
    pub t: f64,
    /// What is nearest then.
    pub nearest: Clearance,
}

/// A body of convex pieces on a move: its origin runs straight, and it turns evenly.
pub(crate) trait Moving {
    /// What it consists of.
    type Piece: Convex;
    /// How many pieces.
    fn pieces(&self) -> usize;
    /// A piece at a time from 0 to 1.
    fn piece(&self, index: usize, t: f64) -> Self::Piece;
    /// Way of the origin, and turn, over the whole move, mm and rad. `None` where it turns to the opposite,
    /// any way round.
    fn course(&self) -> Option<[Vector3; 2]>;
}

/// A tool on a move.
pub(crate) struct ToolMove<'a> {
    pub solid: &'a Solid,
    pub ends: [ClPoint; 2],
}

impl<'a> Moving for ToolMove<'a> {
    type Piece = ToolPiece<'a>;

    fn pieces(&self) -> usize {
        self.solid.pieces()
    }

    fn piece(&self, index: usize, t: f64) -> ToolPiece<'a> {
        ToolPiece { solid: self.solid, index, at: self.ends[0].towards(&self.ends[1], t) }
    }

    fn course(&self) -> Option<[Vector3; 2]> {
        let [from, to] = &self.ends;
        let across = from.axis.cross(&to.axis);
        let (sin, cos) = (across.norm(), from.axis.dot(&to.axis));
        if sin < OPPOSITE && cos < 0.0 {
            return None;
        }
        let spin = if sin > 0.0 { across * (sin.atan2(cos) / sin) } else { across };
        Some([to.tip - from.tip, spin])
    }
}

/// A piece in the middle of a stretch of a move.
struct Stretch<P> {
    piece: P,
    /// Way of the origin and turn over the whole move, mm and rad.
    way: Vector3,
    spin: Vector3,
    /// Half of the stretch, as a share of the move.
    half: f64,
}

impl Obstacle<'_> {
    /// The nearest place of the mesh on a move of a tool ([`ClPoint::towards`]), if it is nearer than
    /// `needed` (finite), mm.
    ///
    /// # Tolerance
    /// What is told comes as near as told. `None` proves that nothing comes nearer than `needed` less 1e-5
    /// mm. No other time is nearer than the one told by more than that or a hundredth of what is missing,
    /// unless it takes more than a hundred looks to find it: then it is the worst of these. Which way an axis
    /// turns to its opposite is not told: nearer than anything.
    pub fn swept_clearance(
        &self,
        solid: &Solid,
        from: &ClPoint,
        to: &ClPoint,
        needed: f64,
    ) -> Option<SweptClearance> {
        self.swept(&ToolMove { solid, ends: [*from, *to] }, needed)
    }

    /// As [`Obstacle::swept_clearance`], of any body.
    pub(crate) fn swept<M: Moving>(&self, moving: &M, needed: f64) -> Option<SweptClearance> {
        let Some([way, spin]) = moving.course() else {
            let place = moving.piece(0, 0.0).origin();
            let nearest = Clearance { distance: f64::NEG_INFINITY, place, triangle: 0 };
            return Some(SweptClearance { t: 0.5, nearest });
        };
        let mut worst: Option<SweptClearance> = None;
        for index in 0..moving.pieces() {
            let mut waiting = VecDeque::from([[0.0, 1.0]]);
            let mut looks = 0;
            while let Some([a, b]) = waiting.pop_front() {
                looks += usize::from(worst.is_some());
                if looks > MOST_LOOKS {
                    break;
                }
                let t = 0.5 * (a + b);
                let piece = moving.piece(index, t);
                let limit = worst.map_or(needed, |w| w.nearest.distance);
                let enough = limit - (SHARE * (needed - limit)).max(RESOLUTION);
                if !self.may_come_nearer(&Stretch { piece, way, spin, half: 0.5 * (b - a) }, enough) {
                    continue;
                }
                // Both ends are where a tool that runs into something is deepest.
                let ends = if [a, b] == [0.0, 1.0] { &[0.0, 1.0][..] } else { &[] };
                for &t in [t].iter().chain(ends) {
                    let piece = moving.piece(index, t);
                    let mut nearest = worst.map(|w| w.nearest);
                    if self.nearest(&piece, needed, &mut nearest) {
                        worst = nearest.map(|nearest| SweptClearance { t, nearest });
                    }
                }
                waiting.extend([[a, t], [t, b]]);
            }
        }
        worst
    }

    /// Whether a bound leaves it open that the mesh comes nearer than `limit` during a stretch.
    fn may_come_nearer<P: Convex>(&self, stretch: &Stretch<P>, limit: f64) -> bool {
        let mut open = false;
        self.bvh.tree().search(
            -limit,
            |_, node, _| -stretch.least_of_box(node),
            |slot, now| {
                open |= stretch.may_come_nearer(&self.mesh.corners(self.bvh.triangle_in(slot)), limit);
                if open { f64::INFINITY } else { now }
            },
        );
        open
    }
}

impl<P: Convex> Stretch<P> {
    /// How much a place may move against `gradient`, mm; `beside` is how far others that are asked for lie
    /// from it.
    fn moved(&self, gradient: &Vector3, q: &Point3, beside: f64) -> f64 {
        let turning = self.spin.cross(&(q - self.piece.origin()));
        let pace = self.spin.cross(&self.way).norm();
        let turn = self.spin.norm();
        let arm = turning.norm() + turn * beside + self.half * pace;
        self.half * (gradient.dot(&(self.way + turning)).abs() + 0.5 * self.half * (turn * arm + 2.0 * pace))
    }

    /// Lower bound on the distance of a box during the stretch.
    fn least_of_box(&self, node: &Node) -> f64 {
        let (middle, half) = node.middle();
        let sample = self.piece.sample(&middle);
        let g = sample.gradient;
        let turned = g.cross(&self.spin) * self.half;
        let sides: f64 = (0..3).map(|i| (g[i].abs() + turned[i].abs()) * half[i]).sum();
        let size = (half[0] * half[0] + half[1] * half[1] + half[2] * half[2]).sqrt();
        sample.distance - sides - self.moved(&g, &middle, size)
    }

    /// As [`Obstacle::may_come_nearer`], for one triangle. It is divided until the time costs more than its
    /// size.
    fn may_come_nearer(&self, corners: &[Point3; 3], limit: f64) -> bool {
        let centre = middle(corners);
        let sample = self.piece.sample(&centre);
        if sample.distance < limit {
            return true;
        }
        let (normal, off) = self.piece.off_plane(corners);
        if off - corners.iter().map(|c| self.moved(&normal, c, 0.0)).fold(0.0, f64::max) >= limit {
            return false;
        }
        let (mut least, mut falls, mut most) = (f64::INFINITY, 0.0f64, 0.0f64);
        for corner in corners {
            let rise = sample.gradient.dot(&(corner - centre));
            let moved = self.moved(&sample.gradient, corner, 0.0);
            least = least.min(rise - moved);
            falls = falls.max(-rise);
            most = most.max(moved);
        }
        if sample.distance + least >= limit {
            return false;
        }
        if falls <= most.max(0.1 * RESOLUTION) {
            return true;
        }
        // What supports the distance at the nearest place rises toward all corners.
        if let Some(near) = self.piece.nearest_on(corners, f64::INFINITY) {
            let Sample { distance, gradient } = self.piece.sample(&near.point);
            let left = |c: &Point3| gradient.dot(&(c - near.point)) - self.moved(&gradient, c, 0.0);
            if distance + corners.iter().map(left).fold(f64::INFINITY, f64::min) >= limit {
                return false;
            }
            if distance < limit {
                return true;
            }
        }
        let side = |k: usize| (corners[(k + 1) % 3] - corners[k]).norm_squared();
        let longest = (0..3).max_by(|&a, &b| side(a).total_cmp(&side(b))).unwrap_or(0);
        let [a, b, c] = [0, 1, 2].map(|k| corners[(longest + k) % 3]);
        let half = nalgebra::center(&a, &b);
        self.may_come_nearer(&[a, half, c], limit) || self.may_come_nearer(&[half, b, c], limit)
    }
}

#[cfg(test)]
mod tests;
