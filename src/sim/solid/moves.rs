//! All moves of a path as solids, and the search tree over them.
//!
//! The tree is built over the track of one point of the tool, the middle of its corner, which a turning axis
//! moves least; long and fast-turning moves stand in it in parts. Each box also has a mean tool axis and how
//! far others in it lean away from that. The tool in the middle of a box, with its mean axis, then bounds the
//! distance from all tools in the box: by its supporting plane over the sides of the box, or over the
//! thinnest slab that holds what stands in it, and by how far a leaning axis turns that plane toward the
//! place.

use super::{Motion, Nearest, OppositeAxes, below};
use cutter::Solid;
use geometry::{BoxTree, Extent, MAX_COORDINATE, Node, Paired, Point3, Vector3, round_up};
use motion::{Move, Toolpath};
use nalgebra::Matrix3;
use work::parallel;

/// A part of a move is at most this many radii of the tool long. Longer ones have large boxes; shorter
/// ones fill the tree.
const RADII_LONG: f64 = 1.0;

/// A part of a move turns by at most this angle, rad.
const WIDEST_TURN: f64 = 0.1;

/// Parts of one move at most: a rapid over the whole machine need not fill the memory.
const MAX_PARTS: f64 = 256.0;

/// Parts in a leaf. More are looked at in vain, fewer make more boxes to look at.
const LEAF: u32 = 2;

/// Relative rounding of an axis that is kept in f32.
const ROUNDING: f64 = 4.0 * f32::EPSILON as f64;

/// Bytes a move, and at most a part while the tree grows: the part twice, its box three times, the tree and
/// what it is made from.
const BYTES_PER_MOTION: u64 = (size_of::<Motion>() + size_of::<u32>()) as u64;
const BYTES_PER_PART: u64 = 240;

/// Axes that differ from their mean by this chord or less lie in a convex cone (half a right angle to each
/// side is the chord of 1.41).
const WIDEST_CONE: f64 = 1.4;

/// A place nearest to one of many moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SweptHit {
    /// Signed distance from the swept volume, mm.
    pub distance: f64,
    /// Index of the move.
    pub index: u32,
    /// When on that move, from 0 to 1.
    pub t: f64,
}

/// What is known of all tools in a box: their mean axis, the length of the chord to the axis that differs
/// most, and the first move.
#[derive(Debug, Clone, Copy)]
struct Summary {
    axis: [f32; 3],
    chord: f32,
    first: u32,
}

/// All pivots of a box lie between two planes, which box sides askew to their surface are far from telling:
/// no farther than `half`, mm, from its middle along `across`.
#[derive(Debug, Clone, Copy)]
struct Slab {
    across: [f32; 3],
    half: f32,
}

/// A part of a move, in one slot of the tree.
#[derive(Debug, Clone, Copy)]
pub(crate) struct MovePart {
    /// Which of the chosen moves.
    pub(crate) chosen: u32,
    /// From when to when.
    pub(crate) range: [f64; 2],
}

/// How near some tools may be, as the distance from one of them in the middle and what the others may be
/// nearer.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NodeView {
    /// Distance from the tool in the middle.
    pub(crate) distance: f64,
    /// Its gradient.
    pub(crate) gradient: Vector3,
    /// How much nearer another tool may be that stands elsewhere, and that leans otherwise.
    pub(crate) moved: f64,
    pub(crate) leaned: f64,
    /// How far directions seen from another tool may be turned, as the length of a chord.
    pub(crate) chord: f64,
    /// What of that is rounding.
    pub(crate) rounding: f64,
    /// Axis of the tool in the middle.
    pub(crate) axis: Vector3,
    /// Greatest height of the place above the pivot of any of the tools.
    pub(crate) height: f64,
}

/// Moves of a path as swept solids: about 250 bytes a move.
#[derive(Debug, Clone)]
pub struct SweptMoves {
    solid: Solid,
    motions: Vec<Motion>,
    /// Index in the path of each.
    indices: Vec<u32>,
    /// Nothing without moves.
    tree: Option<BoxTree>,
    summaries: Paired<Summary>,
    slabs: Paired<Slab>,
    slots: Vec<MovePart>,
}

/// Into how many parts a move is divided.
fn parts(m: &Motion, solid: &Solid) -> u32 {
    let pieces = (m.way.norm() / (RADII_LONG * solid.radius())).max(m.turn / WIDEST_TURN);
    pieces.ceil().clamp(1.0, MAX_PARTS) as u32
}

impl SweptMoves {
    /// Of the moves of `path` that `chosen` picks; coordinates up to [`MAX_COORDINATE`].
    ///
    /// # Errors
    /// [`OppositeAxes`] for the first chosen move that turns the axis to its opposite.
    pub fn new(solid: &Solid, path: &Toolpath, chosen: impl Fn(&Move) -> bool) -> Result<Self, OppositeAxes> {
        let indices: Vec<u32> = (0..path.len() as u32).filter(|&k| chosen(&path.moves[k as usize])).collect();
        let motions = parallel::try_map(indices.len(), |k| {
            let index = indices[k] as usize;
            Motion::new(&path.location_before(index), &path.moves[index].to).ok_or(OppositeAxes { index })
        })?;
        let mut moves = Self {
            solid: solid.clone(),
            motions,
            indices,
            tree: None,
            summaries: Paired::from_values(&[]),
            slabs: Paired::from_values(&[]),
            slots: Vec::new(),
        };
        moves.plant();
        Ok(moves)
    }

    /// Memory at most while the chosen moves of `path` are put in order, bytes.
    pub fn bytes(solid: &Solid, path: &Toolpath, chosen: impl Fn(&Move) -> bool) -> u64 {
        let chosen = (0..path.len()).filter(|&k| chosen(&path.moves[k]));
        let motions = chosen.filter_map(|k| Motion::new(&path.location_before(k), &path.moves[k].to));
        motions.map(|m| BYTES_PER_MOTION + u64::from(parts(&m, solid)) * BYTES_PER_PART).sum()
    }

    fn plant(&mut self) {
        let of_move = |(k, m): (usize, &Motion)| {
            let n = parts(m, &self.solid);
            let at = move |i: u32| f64::from(i) / f64::from(n);
            (0..n).map(move |i| MovePart { chosen: k as u32, range: [at(i), at(i + 1)] })
        };
        let parts: Vec<MovePart> = self.motions.iter().enumerate().flat_map(of_move).collect();
        if parts.is_empty() {
            return;
        }
        let boxes = parallel::map(parts.len(), |k| self.extent(&parts[k]));
        let (tree, order) = BoxTree::around(&self.apart_by_axis(&parts, &boxes), LEAF);
        let tree = tree.refitted(&order.iter().map(|&k| boxes[k as usize]).collect::<Vec<_>>());
        self.slots = order.iter().map(|&k| parts[k as usize]).collect();
        // What follows takes as much memory.
        drop((parts, boxes, order));
        self.summaries = self.summaries_of(&tree);
        self.slabs = self.slabs_of(&tree);
        self.tree = Some(tree);
    }

    /// The boxes as the tree is built over: tools that lean quite differently far apart, so that they do not
    /// share nodes until its top. Such neighbours (passes fed forth and back with a lead, both sides of a
    /// blade) would leave each other's boxes without a common axis to speak of.
    fn apart_by_axis(&self, parts: &[MovePart], boxes: &[Extent]) -> Vec<Extent> {
        let whole = boxes.iter().fold(Extent::NOTHING, |all, one| all.with(one));
        let apart = 2.0 * (whole.max[0] - whole.min[0]) + self.solid.radius() as f32;
        let moved = |k: usize| {
            let Extent { mut min, mut max } = boxes[k];
            let by = apart * cell_of(&self.lean(&parts[k]).0) as f32;
            (min[0], max[0]) = (min[0] + by, max[0] + by);
            Extent { min, max }
        };
        parallel::map(parts.len(), moved)
    }

    /// The box around the track of the pivot in one part. On an arc it lies off the chord by no more than
    /// pivot·(1 − cos(θ/2)), θ the turn of the part.
    fn extent(&self, part: &MovePart) -> Extent {
        let ([a, b], bulge) = self.pivots(part);
        Extent::new(a.inf(&b).coords.add_scalar(-bulge).into(), a.sup(&b).coords.add_scalar(bulge).into())
    }

    /// The pivot at the ends of a part, and how far it may be off the chord between them.
    fn pivots(&self, part: &MovePart) -> ([Point3; 2], f64) {
        let motion = self.motion(part);
        let pivot = self.solid.pivot();
        let ends = part.range.map(|t| {
            let pose = motion.at(t);
            pose.tip + pose.axis * pivot
        });
        let half_turn = 0.5 * motion.turn * (part.range[1] - part.range[0]);
        let rounding = 1e-15 * ends[0].coords.amax().max(MAX_COORDINATE * 1e-3);
        (ends, pivot * 0.5 * half_turn * half_turn + rounding)
    }

    /// From the leaves upward: the mean axis and the farthest from it.
    fn summaries_of(&self, tree: &BoxTree) -> Paired<Summary> {
        let nothing = Summary { axis: [0.0, 0.0, 1.0], chord: 0.0, first: u32::MAX };
        let mut summaries = vec![nothing; tree.nodes_len()];
        for i in (0..summaries.len()).rev() {
            // Node 1 is of no use.
            let (first, count) = tree.node(i).slots_or_children();
            let held: Vec<(Vector3, f64, u32)> = if i == 1 {
                continue;
            } else if count > 0 {
                self.slots[first..first + count].iter().map(|part| self.lean(part)).collect()
            } else {
                summaries[first..first + 2].iter().map(|s| (s.axis(), f64::from(s.chord), s.first)).collect()
            };
            let sum: Vector3 = held.iter().map(|h| h.0).sum();
            let axis = sum.try_normalize(0.0).unwrap_or_else(Vector3::z).map(|x| x as f32);
            let mean = axis.map(f64::from);
            let chord = held.iter().map(|h| (h.0 - mean).norm() + h.1).fold(0.0, f64::max);
            let first = held.iter().map(|h| h.2).min().unwrap_or(u32::MAX);
            summaries[i] = Summary { axis: axis.into(), chord: round_up(chord.min(2.0)), first };
        }
        Paired::from_values(&summaries)
    }

    /// The thinnest slab around the pivots of each node; where they lie along a line, across the mean axis.
    fn slabs_of(&self, tree: &BoxTree) -> Paired<Slab> {
        /// How little the axis counts beside how the pivots lie.
        const AXIS: f64 = 1e-3;
        let pivots = parallel::map(self.slots.len(), |k| self.pivots(&self.slots[k]));
        let mut below = vec![0..0; tree.nodes_len()];
        for i in (0..below.len()).rev().filter(|i| *i != 1) {
            let (first, count) = tree.node(i).slots_or_children();
            below[i] =
                if count > 0 { first..first + count } else { below[first].start..below[first + 1].end };
        }
        let slab = |i: usize| {
            let (middle, axis) = (tree.node(i).middle().0, self.summaries.at(i).axis());
            let held = &pivots[below[i].clone()];
            let ways = held.iter().flat_map(|(ends, _)| ends).map(|p| p - middle);
            let spread: Matrix3<f64> = ways.map(|way| way * way.transpose()).sum();
            let level = (Matrix3::identity() - axis * axis.transpose()) * (AXIS * spread.trace());
            let eigen = (spread + level).symmetric_eigen();
            let across = eigen.eigenvectors.column(eigen.eigenvalues.imin()).map(|x| x as f32);
            let direction = across.map(f64::from);
            let off = |(ends, bulge): &([Point3; 2], f64)| {
                ends.iter().map(|p| (p - middle).dot(&direction).abs()).fold(0.0, f64::max) + 2.0 * bulge
            };
            Slab { across: across.into(), half: round_up(held.iter().map(off).fold(0.0, f64::max)) }
        };
        Paired::from_values(&parallel::map(tree.nodes_len(), slab))
    }

    /// How far the pivots of a node lie along a direction from the middle of its box at most, which has these
    /// half sides.
    #[inline]
    fn spread(&self, index: usize, along: &Vector3, half: [f64; 3]) -> f64 {
        let within = |v: &Vector3| v.x.abs() * half[0] + v.y.abs() * half[1] + v.z.abs() * half[2];
        let slab = self.slabs.at(index);
        let across = Vector3::from(slab.across.map(f64::from));
        let share = along.dot(&across);
        let by_slab = share.abs() * f64::from(slab.half) + within(&(along - across * share));
        by_slab.min(within(along))
    }

    /// The axis in the middle of a part, the chord to those at its ends, and its move.
    fn lean(&self, part: &MovePart) -> (Vector3, f64, u32) {
        let (motion, [from, to]) = (self.motion(part), part.range);
        let chord = 2.0 * (0.25 * motion.turn * (to - from)).sin();
        (motion.at(0.5 * (from + to)).axis, chord, self.index(part))
    }

    /// The solid that is swept.
    pub fn solid(&self) -> &Solid {
        &self.solid
    }

    /// The boxes; `None` without moves.
    pub(crate) fn tree(&self) -> Option<&BoxTree> {
        self.tree.as_ref()
    }

    /// What stands in a slot of the tree.
    pub(crate) fn part(&self, slot: usize) -> &MovePart {
        &self.slots[slot]
    }

    /// The move of a part.
    pub(crate) fn motion(&self, part: &MovePart) -> &Motion {
        &self.motions[part.chosen as usize]
    }

    /// All of the move with that index in the path, if it was chosen.
    pub(crate) fn part_of(&self, index: u32) -> Option<MovePart> {
        let chosen = self.indices.binary_search(&index).ok()? as u32;
        Some(MovePart { chosen, range: [0.0, 1.0] })
    }

    /// The move with that index in the path, if it was chosen.
    pub(crate) fn motion_of(&self, index: u32) -> Option<&Motion> {
        self.indices.binary_search(&index).ok().map(|k| &self.motions[k])
    }

    /// The index in the path of the move of a part.
    pub(crate) fn index(&self, part: &MovePart) -> u32 {
        self.indices[part.chosen as usize]
    }

    /// Index of the first move in a node.
    #[inline]
    pub(crate) fn first_in(&self, index: usize) -> u32 {
        self.summaries.at(index).first
    }

    /// How near one piece of the tools of node `index` may be to `q`.
    #[inline]
    pub(crate) fn view(&self, index: usize, node: &Node, piece: usize, q: &Point3) -> NodeView {
        let (middle, half) = node.middle();
        let summary = self.summaries.at(index);
        let (axis, chord) = (summary.axis(), f64::from(summary.chord));
        let away = q - middle;
        let along = away.dot(&axis);
        let outward = away - axis * along;
        let rho = outward.norm();
        if let Some(radius) = self.solid.ball()
            && chord > 0.0
            && chord < WIDEST_CONE
        {
            let moved = |gradient: &Vector3| self.spread(index, gradient, half);
            return in_cone(radius, &away, [rho, along], &axis, chord + ROUNDING, moved);
        }
        let foot = self.solid.piece_foot(piece, rho, along + self.solid.pivot());
        let radial = if rho > 0.0 { foot.gradient[0] / rho } else { 0.0 };
        let gradient = outward * radial + axis * foot.gradient[1];
        let mut moved = self.spread(index, &gradient, half);
        let (mut leaned, mut height, mut rounding) = (0.0, along, 0.0);
        if chord > 0.0 {
            rounding = ROUNDING;
            let size = Vector3::from(half).norm();
            let reach = away.norm() + size;
            // The supporting plane turns about the pivot, which it passes at this arm.
            let arm = (foot.gradient[0] * along - foot.gradient[1] * rho).abs() + size;
            leaned = chord * reach.min(arm + 0.5 * chord * reach);
            moved += rounding * reach;
            height += (chord + rounding) * reach;
        }
        height += axis.x.abs() * half[0] + axis.y.abs() * half[1] + axis.z.abs() * half[2];
        let chord = chord + rounding;
        NodeView { distance: foot.distance, gradient, moved, leaned, chord, rounding, axis, height }
    }

    /// Lower bound on the distance of `q` from the tools of node `index`.
    #[inline]
    fn bound(&self, index: usize, node: &Node, q: &Point3) -> f64 {
        let below = |piece| {
            let view = self.view(index, node, piece, q);
            view.distance - view.moved - view.leaned
        };
        (0..self.solid.pieces()).map(below).fold(f64::INFINITY, f64::min)
    }

    /// The move that comes nearest to `q`, the first of equals, if it comes nearer than `limit`, mm.
    ///
    /// # Tolerance
    /// Distances are least over the time of the move to 1e-9 mm. Inside of a solid of several pieces it is
    /// the depth at the time at which one piece is deepest around the place, which another time may exceed;
    /// its sign, and all distances outside, are exact.
    pub fn nearest(&self, q: &Point3, limit: f64) -> Option<SweptHit> {
        let mut best: Option<SweptHit> = None;
        self.tree.as_ref()?.search(
            -limit,
            |index, node, _| -self.bound(index, node, q),
            |slot, now| {
                let part = self.part(slot);
                let index = self.index(part);
                // One unit beyond what stands, so that an equal move with a lower index is found.
                let Some(Nearest { distance, t }) =
                    below(&self.solid, self.motion(part), q, part.range, (-now).next_up())
                else {
                    return now;
                };
                if best.is_none_or(|b| distance < b.distance || (distance == b.distance && index < b.index)) {
                    best = Some(SweptHit { distance, index, t });
                }
                -distance
            },
        );
        best
    }
}

/// Which of 54 equal cells on the faces of a cube an axis points to.
fn cell_of(axis: &Vector3) -> usize {
    let face = axis.iamax();
    let beside = [1, 2].map(|k| axis[(face + k) % 3] / axis[face].abs());
    let third = |x: f64| ((1.5 * x).round().clamp(-1.0, 1.0) + 1.0) as usize;
    (2 * face + usize::from(axis[face] < 0.0)) * 9 + 3 * third(beside[0]) + third(beside[1])
}

/// How near ball ends may be whose axes differ from `axis` by a chord or less and that stand in a box, seen
/// from its middle: all of them lie within the radius of a cone around that axis, which is convex. `away` is
/// the way from the middle to the place, `rho` across the axis and `along` it; `moved` tells how far along a
/// direction they may lie from the middle.
#[inline]
fn in_cone(
    radius: f64,
    away: &Vector3,
    [rho, along]: [f64; 2],
    axis: &Vector3,
    chord: f64,
    moved: impl Fn(&Vector3) -> f64,
) -> NodeView {
    let (sin, cos) = (chord * (1.0 - 0.25 * chord * chord).sqrt(), 1.0 - 0.5 * chord * chord);
    let (distance, gradient) = if rho * sin + along * cos <= 0.0 {
        // The tip of the cone is nearest.
        let far = away.norm();
        (far, if far > 0.0 { away / far } else { Vector3::zeros() })
    } else {
        let outward = if rho > 0.0 { (away - axis * along) / rho } else { Vector3::zeros() };
        (rho * cos - along * sin, outward * cos - axis * sin)
    };
    NodeView {
        distance: distance - radius,
        gradient,
        moved: moved(&gradient) + ROUNDING * away.norm(),
        leaned: 0.0,
        chord: 0.0,
        rounding: 0.0,
        axis: *axis,
        height: f64::INFINITY,
    }
}

impl Summary {
    #[inline(always)]
    fn axis(&self) -> Vector3 {
        Vector3::from(self.axis.map(f64::from))
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{path_of, some_move};
    use super::*;
    use crate::scenes::Rng;
    use cutter::Cutter;

    #[test]
    fn slabs_hold_the_tracks_of_the_pivot_below_them() {
        let mut rng = Rng::new(48);
        let solid = Solid::of_cutter(&Cutter::bull(6.0, 1.0).unwrap(), None);
        let (from, mut all) = (some_move(&mut rng, 0).0, Vec::new());
        for kind in 0..24 {
            let (a, b) = some_move(&mut rng, kind);
            all.extend([a, b]);
        }
        let moves = SweptMoves::new(&solid, &path_of(from, &all), |_| true).unwrap();
        let tree = moves.tree.as_ref().unwrap();
        let mut thin = 0;
        for i in (0..tree.nodes_len()).filter(|i| *i != 1) {
            let (middle, half) = tree.node(i).middle();
            let Slab { across, half: slab } = *moves.slabs.at(i);
            let across = Vector3::from(across.map(f64::from));
            for part in tree.slots_below(i).into_iter().map(|slot| &moves.slots[slot]) {
                for k in 0..=10 {
                    let t = part.range[0] + (part.range[1] - part.range[0]) * f64::from(k) / 10.0;
                    let pose = moves.motion(part).at(t);
                    let off = (pose.tip + pose.axis * solid.pivot() - middle).dot(&across).abs();
                    assert!(off <= f64::from(slab), "node {i}: {off} > {slab}");
                }
            }
            let box_alone = (0..3).map(|k| across[k].abs() * half[k]).sum::<f64>();
            thin += usize::from(f64::from(slab) < 0.5 * box_alone);
        }
        assert!(thin > tree.nodes_len() / 4, "{thin} of {}", tree.nodes_len());
    }

    #[test]
    fn boxes_hold_the_track_of_the_pivot() {
        let mut rng = Rng::new(47);
        let solid = Solid::of_cutter(&Cutter::ball(6.0).unwrap(), None);
        for kind in 0..64 {
            let (from, to) = some_move(&mut rng, kind);
            let moves = SweptMoves::new(&solid, &path_of(from, &[to]), |_| true).unwrap();
            let parts = moves.slots.iter().map(|part| part.range[1] - part.range[0]).sum::<f64>();
            assert!((parts - 1.0).abs() < 1e-12);
            for part in &moves.slots {
                for k in 0..=20 {
                    let t = part.range[0] + (part.range[1] - part.range[0]) * f64::from(k) / 20.0;
                    let pose = from.towards(&to, t);
                    assert!(moves.extent(part).holds(&(pose.tip + pose.axis * 3.0)), "{from:?} {to:?} {t}");
                }
            }
        }
    }
}
