//! How far the cut surface is from a place along its normal, for any tool axis: the engine of normal rays.
//!
//! Enters: a path, the tool as a solid, and places with unit normals, mm. Leaves: for each the lowest `s` in
//! `[−inward, outward]` at which `P + s n` lies within the swept volume, the move that does it and when. That
//! is the deviation of the cut surface at the place: below zero a gouge, above zero what was left.
//!
//! All moves but rapids cut; a rapid within the part is a collision, which the other engines report.
//!
//! The place runs down the normal as moves are found that reach lower. Of each box of the tree over the
//! moves, and of each move, it is only asked whether it may reach lower still: along the normal too the
//! distance from a convex piece of the tool lies above its supporting plane. Nothing is sampled: where no
//! bound says so, no move is left out.
//!
//! Moves that reach equally low go to the first of the program, and a later one must be lower. Level ground,
//! where hundreds of flat ends are equal, is then as fast as waves.

mod lowest;
mod support_area;
#[cfg(test)]
mod tests;

use std::cell::Cell;

use super::solid::{Moving, OppositeAxes, SweptMoves, below};
use cutter::Solid;
use geometry::{Node, Point3, Vector3};
use lowest::{Ray, Support};
use motion::{Move, MoveKind, PathError, Toolpath};
use work::monitor::{Cancelled, Monitor, check};

/// Moves that reach equally low within this, mm, are equal: the end of one move and the begin of the next
/// are the same tool, but for rounding.
const EQUAL: f64 = 1e-9;

/// How far before the hit the normal is asked for, mm. Less is lost in rounding; more is off where the
/// surface is bent.
const BEFORE: f64 = 1e-6;

/// How far around the nearest time its closer value is looked for, and how often what is left is halved.
const AROUND: f64 = 1e-3;
const HALVINGS: usize = 40;

/// Where a ray meets the swept volume lowest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RayHit {
    /// Place along the normal, mm; −inward where the ray begins inside of the swept volume.
    pub s: f64,
    /// Index of the move in the path, the first of those that reach as low within 1e-9 mm.
    pub index: u32,
    /// When on that move, from 0 to 1.
    pub t: f64,
}

/// Why there are no rays.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum RaysError {
    /// A place of the path is no number, or an axis no unit vector.
    #[error(transparent)]
    Path(#[from] PathError),
    /// A move turns the axis to its opposite.
    #[error(transparent)]
    Opposite(#[from] OppositeAxes),
    /// The monitor stopped it.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// The moves of a path, ready to be met by rays.
///
/// # Tolerance
/// `s` is right to 1e-9 mm over the sine of the angle at which the ray meets the swept volume.
#[derive(Debug, Clone)]
pub struct Rays {
    moves: SweptMoves,
}

/// What was found so far by one ray.
#[derive(Debug, Clone, Copy)]
struct LowestHit {
    /// The lowest place; the upper end of the range while there is none.
    lowest: f64,
    /// The first move that reaches as low, and the slot in which it stands.
    by: Option<(RayHit, usize)>,
}

impl LowestHit {
    /// Up to where the move `index` counts: one before that which was found counts when it is equal, one
    /// after it when it is lower.
    fn limit(&self, index: u32) -> f64 {
        match &self.by {
            None => self.lowest,
            Some((hit, _)) if index < hit.index => self.lowest + EQUAL,
            Some(_) => self.lowest - EQUAL,
        }
    }

    /// Up to where some move counts.
    fn highest(&self) -> f64 {
        self.limit(0)
    }
}

fn cuts(step: &Move) -> bool {
    step.kind != MoveKind::Rapid
}

impl Rays {
    /// Of all moves of `path` but rapids.
    ///
    /// # Errors
    /// [`RaysError::Path`]; [`RaysError::Opposite`] when one turns the axis to its opposite;
    /// [`RaysError::Cancelled`].
    pub fn new(path: &Toolpath, solid: &Solid, monitor: &dyn Monitor) -> Result<Self, RaysError> {
        check(monitor)?;
        path.check()?;
        let moves = SweptMoves::new(solid, path, cuts)?;
        check(monitor)?;
        Ok(Self { moves })
    }

    /// Memory that the moves of `path` take, bytes.
    pub fn bytes(path: &Toolpath, solid: &Solid) -> u64 {
        SweptMoves::bytes(solid, path, cuts)
    }

    /// The moves.
    pub fn moves(&self) -> &SweptMoves {
        &self.moves
    }

    /// The lowest `s` from `−inward` to `outward` at which `point + s·normal` lies in the swept volume; the
    /// normal is of unit length, both limits are mm and not negative. `None` where there is none.
    pub fn deviation(&self, point: &Point3, normal: &Vector3, inward: f64, outward: f64) -> Option<RayHit> {
        self.lowest(point, normal, [-inward, outward], None).map(|(hit, _)| hit)
    }

    /// As [`Rays::deviation`], beginning with what was found nearby; tells where it was found.
    pub fn deviation_near(
        &self,
        point: &Point3,
        normal: &Vector3,
        [inward, outward]: [f64; 2],
        seed: Option<usize>,
    ) -> Option<(RayHit, usize)> {
        self.lowest(point, normal, [-inward, outward], seed)
    }

    /// As [`Rays::deviation`], of one move of the path alone, which no tree is asked for.
    pub fn deviation_by(
        &self,
        point: &Point3,
        normal: &Vector3,
        [inward, outward]: [f64; 2],
        index: u32,
    ) -> Option<RayHit> {
        let part = self.moves.part_of(index)?;
        let ray = Ray { point: *point, normal: *normal, low: -inward, high: outward };
        ray.lowest_of(&self.moves, &part, outward).map(|(s, t)| RayHit { s, index, t })
    }

    /// The unit normal of the cut surface, out of what stands and into the swept volume, where the ray of
    /// `point` and `normal` ended with `hit`; `None` where that is none of its hits.
    ///
    /// # Tolerance
    /// It is that of the distance from the swept move a nanometre before the hit, and off by as much over
    /// the radius at which the surface is bent there. So it also holds where a sharp edge cuts, at which the
    /// tool by itself has many normals.
    pub fn cut_normal(&self, point: &Point3, normal: &Vector3, hit: &RayHit) -> Option<Vector3> {
        let motion = self.moves.motion_of(hit.index)?;
        let q = point + normal * (hit.s - BEFORE);
        let solid = self.moves.solid();
        let t = below(solid, motion, &q, [0.0, 1.0], f64::INFINITY)?.t;
        let distance = |piece: &usize| motion.piece(solid, *piece).look(&q, t).sample.value;
        let piece = (0..solid.pieces()).min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        let look = |t: f64| motion.piece(solid, piece).look(&q, t);
        // The least distance is flat in time, its slope is not: that tells the time much closer.
        let [mut early, mut late] = [t - AROUND, t + AROUND].map(|t| t.clamp(0.0, 1.0));
        if look(early).sample.slope > 0.0 || look(late).sample.slope < 0.0 {
            return (-look(t).gradient).try_normalize(0.5);
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (early + late);
            *(if look(middle).sample.slope < 0.0 { &mut early } else { &mut late }) = middle;
        }
        (-look(0.5 * (early + late)).gradient).try_normalize(0.5)
    }

    /// The lowest hit and the slot of the tree in which it was found, beginning with what stands in the
    /// slot `seed`.
    fn lowest(
        &self,
        point: &Point3,
        normal: &Vector3,
        [low, high]: [f64; 2],
        seed: Option<usize>,
    ) -> Option<(RayHit, usize)> {
        let tree = self.moves.tree()?;
        let ray = Ray { point: *point, normal: *normal, low, high };
        let found = Cell::new(LowestHit { lowest: high, by: None });
        let visit = |slot: usize| {
            let (part, now) = (self.moves.part(slot), found.get());
            let index = self.moves.index(part);
            if let Some((s, t)) = ray.lowest_of(&self.moves, part, now.limit(index)) {
                let lowest = s.min(now.lowest);
                found.set(LowestHit { lowest, by: Some((RayHit { s, index, t }, slot)) });
            }
        };
        if let Some(slot) = seed {
            visit(slot);
        }
        tree.search(
            (-found.get().highest()).next_down(),
            |index, node, _| {
                let limit = found.get().limit(self.moves.first_in(index));
                -self.reach(&ray, index, node, limit)
            },
            |slot, _| {
                if Some(slot) != seed {
                    visit(slot);
                }
                -found.get().highest()
            },
        );
        let LowestHit { lowest, by } = found.get();
        by.map(|(hit, slot)| (RayHit { s: lowest, ..hit }, slot))
    }

    /// The lowest place of the ray up to `limit` that the tools of a node may reach; infinite if none.
    #[inline]
    fn reach(&self, ray: &Ray, index: usize, node: &Node, limit: f64) -> f64 {
        if limit < ray.low {
            return f64::INFINITY;
        }
        let s = if limit < ray.high { limit } else { ray.first() };
        let range = [ray.low, limit];
        let of_piece = |piece: usize| self.support(ray, index, node, piece, s, range).reach(range);
        (0..self.moves.solid().pieces()).map(of_piece).fold(f64::INFINITY, f64::min)
    }

    /// Lower bound along the ray, within a range of it, on the distance from a piece of all tools of a node,
    /// by a look from the place `s`.
    #[inline]
    fn support(
        &self,
        ray: &Ray,
        index: usize,
        node: &Node,
        piece: usize,
        s: f64,
        [low, high]: [f64; 2],
    ) -> Support {
        let view = self.moves.view(index, node, piece, &ray.at(s));
        let rise = ray.normal.dot(&view.gradient);
        // What turns about the middle of a ball does not move it.
        let climb = ray.normal.dot(&view.axis);
        let [down, up] = [low - s, high - s];
        let below = view.height + (down * (climb + view.chord)).max(down * (climb - view.chord)) < 0.0
            && view.height + up * (climb + view.chord) < 0.0;
        if below && self.moves.solid().ball().is_some() {
            return Support { s, value: view.distance - view.moved, rise, lean: view.rounding };
        }
        Support { s, value: view.distance - view.moved - view.leaned, rise, lean: view.chord }
    }
}
