//! All moves of a path as solids, and the search tree over them.
//!
//! The tree is built over the track of one point of the tool, the middle of its corner, which a turning
//! axis moves least; long and fast-turning moves stand in it in parts. Each box also has a mean tool axis
//! and how far others in it lean away from that. The tool in the middle of a box, with its mean axis, then
//! bounds the distance from all tools in the box: by its supporting plane over the sides of the box, and
//! by how far a leaning axis moves the place as seen from the tool.

use super::{Motion, Nearest, OppositeAxes, below};
use crate::cutter::Solid;
use crate::geometry::{BoxTree, Extent, MAX_COORDINATE, Node, Paired, Point3, Vector3, round_up};
use crate::parallel;
use crate::toolpath::{Move, Toolpath};

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

/// Mean tool axis of a box, and the length of the chord to the axis that differs most.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lean {
    axis: [f32; 3],
    chord: f32,
}

/// A part of a move, in one slot of the tree.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Part {
    /// Which of the chosen moves.
    pub(crate) chosen: u32,
    /// From when to when.
    pub(crate) range: [f64; 2],
}

/// Lower bound on the distance from some tools, as the distance from one of them in the middle and what
/// the others may be nearer.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NodeView {
    /// Distance from the tool in the middle.
    pub(crate) distance: f64,
    /// Its gradient.
    pub(crate) gradient: Vector3,
    /// How much nearer another tool may be.
    pub(crate) slack: f64,
    /// How far the gradient of another tool may be turned, as the length of a chord.
    pub(crate) lean: f64,
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
    leans: Paired<Lean>,
    slots: Vec<Part>,
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
            leans: Paired::from_values(&[]),
            slots: Vec::new(),
        };
        moves.plant();
        Ok(moves)
    }

    fn plant(&mut self) {
        let long = RADII_LONG * self.solid.radius();
        let count = |m: &Motion| {
            let pieces = (m.way.norm() / long).max(m.turn / WIDEST_TURN);
            pieces.ceil().clamp(1.0, MAX_PARTS) as u32
        };
        let of_move = |(k, m): (usize, &Motion)| {
            let n = count(m);
            let at = move |i: u32| f64::from(i) / f64::from(n);
            (0..n).map(move |i| Part { chosen: k as u32, range: [at(i), at(i + 1)] })
        };
        let parts: Vec<Part> = self.motions.iter().enumerate().flat_map(of_move).collect();
        if parts.is_empty() {
            return;
        }
        let boxes = parallel::map(parts.len(), |k| self.extent(&parts[k]));
        let (tree, order) = BoxTree::around(&boxes, LEAF);
        self.slots = order.iter().map(|&k| parts[k as usize]).collect();
        self.leans = self.leans_of(&tree);
        self.tree = Some(tree);
    }

    /// The box around the track of the pivot in one part. On an arc it lies off the chord by no more than
    /// pivot·(1 − cos(θ/2)), θ the turn of the part.
    fn extent(&self, part: &Part) -> Extent {
        let motion = self.motion(part);
        let pivot = self.solid.pivot();
        let [a, b] = part.range.map(|t| {
            let pose = motion.at(t);
            pose.tip + pose.axis * pivot
        });
        let half_turn = 0.5 * motion.turn * (part.range[1] - part.range[0]);
        let bulge = pivot * 0.5 * half_turn * half_turn + 1e-15 * a.coords.amax().max(MAX_COORDINATE * 1e-3);
        Extent::new(a.inf(&b).coords.add_scalar(-bulge).into(), a.sup(&b).coords.add_scalar(bulge).into())
    }

    /// From the leaves upward: the mean axis and the farthest from it.
    fn leans_of(&self, tree: &BoxTree) -> Paired<Lean> {
        let nothing = Lean { axis: [0.0, 0.0, 1.0], chord: 0.0 };
        let mut leans = vec![nothing; tree.nodes_len()];
        for i in (0..leans.len()).rev() {
            // Node 1 is of no use.
            let (first, count) = tree.node(i).slots_or_children();
            let held: Vec<(Vector3, f64)> = if count > 0 && i != 1 {
                self.slots[first..first + count].iter().map(|part| self.lean(part)).collect()
            } else if i != 1 {
                leans[first..first + 2].iter().map(Lean::wide).collect()
            } else {
                continue;
            };
            let sum: Vector3 = held.iter().map(|(axis, _)| axis).sum();
            let axis = sum.try_normalize(0.0).unwrap_or_else(Vector3::z).map(|x| x as f32);
            let wide = axis.map(f64::from);
            let chord = held.iter().map(|(a, chord)| (a - wide).norm() + chord).fold(0.0, f64::max);
            leans[i] = Lean { axis: axis.into(), chord: round_up(chord.min(2.0)) };
        }
        Paired::from_values(&leans)
    }

    /// The axis in the middle of a part, and the chord to those at its ends.
    fn lean(&self, part: &Part) -> (Vector3, f64) {
        let (motion, [from, to]) = (self.motion(part), part.range);
        (motion.at(0.5 * (from + to)).axis, 2.0 * (0.25 * motion.turn * (to - from)).sin())
    }

    /// The solid that is swept.
    pub fn solid(&self) -> &Solid {
        &self.solid
    }

    /// Number of moves.
    pub fn len(&self) -> usize {
        self.motions.len()
    }

    /// True without moves.
    pub fn is_empty(&self) -> bool {
        self.motions.is_empty()
    }

    /// The boxes; `None` without moves.
    pub(crate) fn tree(&self) -> Option<&BoxTree> {
        self.tree.as_ref()
    }

    /// What stands in a slot of the tree.
    pub(crate) fn part(&self, slot: usize) -> &Part {
        &self.slots[slot]
    }

    /// The move of a part.
    pub(crate) fn motion(&self, part: &Part) -> &Motion {
        &self.motions[part.chosen as usize]
    }

    /// The index in the path of the move of a part.
    pub(crate) fn index(&self, part: &Part) -> u32 {
        self.indices[part.chosen as usize]
    }

    /// How near the tools of node `index` may be to `q`.
    #[inline]
    pub(crate) fn view(&self, index: usize, node: &Node, q: &Point3) -> NodeView {
        let (middle, half) = node.middle();
        let (axis, chord) = self.leans.at(index).wide();
        let away = q - middle;
        let along = away.dot(&axis);
        let outward = away - axis * along;
        let rho = outward.norm();
        let foot = self.solid.outline_foot(rho, along + self.solid.pivot());
        let radial = if rho > 0.0 { foot.gradient[0] / rho } else { 0.0 };
        let gradient = outward * radial + axis * foot.gradient[1];
        let size = (half[0] * half[0] + half[1] * half[1] + half[2] * half[2]).sqrt();
        let moved = if self.solid.is_convex() {
            gradient.x.abs() * half[0] + gradient.y.abs() * half[1] + gradient.z.abs() * half[2]
        } else {
            size
        };
        let leaned = if chord > 0.0 { (chord + ROUNDING) * (away.norm() + size) } else { 0.0 };
        NodeView { distance: foot.distance, gradient, slack: moved + leaned, lean: chord }
    }

    /// The move that comes nearest to `q`, the first of equals, if it comes nearer than `limit`, mm.
    ///
    /// # Tolerance
    /// As [`SweptSolid`](super::SweptSolid).
    pub fn nearest(&self, q: &Point3, limit: f64) -> Option<SweptHit> {
        let mut best: Option<SweptHit> = None;
        self.tree.as_ref()?.search(
            -limit,
            |index, node, _| {
                let view = self.view(index, node, q);
                view.slack - view.distance
            },
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

    /// Calls `visit` for every move that may come within `reach` mm of `q`, in any order and perhaps more
    /// than once: its index, with a lower bound on its distance.
    pub fn near(&self, q: &Point3, reach: f64, mut visit: impl FnMut(u32, f64)) {
        let Some(tree) = &self.tree else { return };
        tree.search(
            -reach,
            |index, node, _| {
                let view = self.view(index, node, q);
                view.slack - view.distance
            },
            |slot, now| {
                let part = self.part(slot);
                if let Some(found) = below(&self.solid, self.motion(part), q, part.range, reach) {
                    visit(self.index(part), found.distance);
                }
                now
            },
        );
    }
}

impl Lean {
    #[inline(always)]
    fn wide(&self) -> (Vector3, f64) {
        (Vector3::from(self.axis.map(f64::from)), f64::from(self.chord))
    }
}
