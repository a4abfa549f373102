//! The walk down a tree of boxes, without knowing what lies in them.
//!
//! Boxes are f32, rounded outward. A tree of the mesh's own boxes answers for the mesh; the same tree
//! with other boxes around its slots ([`BoxTree::refitted`]) answers for what else belongs to each
//! triangle, and costs no building.
//!
//! Trees are built by PLOC with reinsertion (Meister & Bittner 2018, crate obvhs) and are the same for
//! any number of threads.

use std::time::Duration;

use obvhs::bvh2::builder::build_bvh2;
use obvhs::{Boundable, BvhBuildParams};

use crate::Point3;

/// Values of up to 32 bytes, two in each cache line: what belongs to the two children of one node
/// then comes with one access to memory, and those accesses are most of what a query costs.
#[derive(Debug, Clone)]
pub struct Paired<T>(Vec<Pair<T>>);

#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
struct Pair<T>([T; 2]);

impl<T: Copy> Paired<T> {
    /// From an even number of values; a last odd one is left out.
    pub fn from_values(values: &[T]) -> Self {
        Self(values.chunks_exact(2).map(|pair| Pair([pair[0], pair[1]])).collect())
    }

    /// Value `i`.
    #[inline]
    pub fn at(&self, i: usize) -> &T {
        &self.0[i / 2].0[i % 2]
    }

    /// Number of values; even.
    pub fn count(&self) -> usize {
        2 * self.0.len()
    }
}

/// A box of the tree: 32 bytes.
#[derive(Debug, Clone, Copy)]
pub struct Node {
    pub(super) min: [f32; 3],
    /// Number of triangles; 0 for an inner node.
    pub(super) count: u32,
    pub(super) max: [f32; 3],
    /// First slot of a leaf, or the first of an inner node's two children.
    pub(super) first: u32,
}

/// As `f64::max` for numbers, in one instruction instead of five: the walk does little else.
#[inline]
fn greater(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

impl Node {
    fn extent(&self) -> Extent {
        Extent { min: self.min, max: self.max }
    }

    /// Squared distance from `(x, y)` to the box in the plan view, mm²; 0 inside.
    #[inline]
    pub fn plan_distance_squared(&self, x: f64, y: f64) -> f64 {
        let dx = self.gap(0, x);
        let dy = self.gap(1, y);
        dx * dx + dy * dy
    }

    /// Squared distance from `q` to the box, mm²; 0 inside.
    #[inline]
    pub fn distance_squared(&self, q: &Point3) -> f64 {
        let dz = self.gap(2, q.z);
        self.plan_distance_squared(q.x, q.y) + dz * dz
    }

    #[inline]
    fn gap(&self, axis: usize, x: f64) -> f64 {
        let (before, beyond) = (f64::from(self.min[axis]) - x, x - f64::from(self.max[axis]));
        greater(greater(before, beyond), 0.0)
    }

    /// Middle of the box in the plan view, mm.
    pub fn plan_centre(&self) -> [f64; 2] {
        [0, 1].map(|axis| 0.5 * (f64::from(self.min[axis]) + f64::from(self.max[axis])))
    }

    /// Whether the box holds `(x, y)` in the plan view.
    #[inline]
    pub fn holds(&self, x: f64, y: f64) -> bool {
        self.meets([x, y], [x, y])
    }

    /// Whether the box and the rectangle from `low` to `high` have a point in common in the plan view.
    #[inline]
    pub fn meets(&self, low: [f64; 2], high: [f64; 2]) -> bool {
        // Four comparisons without a branch: which of them fails is never predictable.
        (f64::from(self.min[0]) <= high[0])
            & (f64::from(self.min[1]) <= high[1])
            & (low[0] <= f64::from(self.max[0]))
            & (low[1] <= f64::from(self.max[1]))
    }

    /// Middle of the box and half its sides, mm.
    pub fn middle(&self) -> (Point3, [f64; 3]) {
        let half =
            |axis: usize, sign: f64| 0.5 * (f64::from(self.max[axis]) + sign * f64::from(self.min[axis]));
        (Point3::from([0, 1, 2].map(|axis| half(axis, 1.0))), [0, 1, 2].map(|axis| half(axis, -1.0)))
    }

    /// First slot and number of slots of a leaf, or first of an inner node's two children and 0.
    pub fn slots_or_children(&self) -> (usize, usize) {
        (self.first as usize, self.count as usize)
    }

    /// Upper end of the box, mm.
    #[inline]
    pub fn top(&self) -> f64 {
        f64::from(self.max[2])
    }
}

/// The greatest f32 that is not above `x`.
pub fn round_down(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) > x { near.next_down() } else { near }
}

/// The least f32 that is not below `x`.
pub fn round_up(x: f64) -> f32 {
    -round_down(-x)
}

/// Nodes that wait on the walk's stack without an allocation. A tree of a million triangles is
/// about 30 deep; deeper ones spill to the heap.
const STACK: usize = 64;

/// A box around what belongs to one slot: its least and its greatest corner.
#[derive(Debug, Clone, Copy)]
pub struct Extent {
    /// Least corner, mm.
    pub min: [f32; 3],
    /// Greatest corner, mm.
    pub max: [f32; 3],
}

impl Extent {
    /// Holds nothing.
    pub const NOTHING: Self = Self { min: [f32::INFINITY; 3], max: [f32::NEG_INFINITY; 3] };

    /// From `min` to `max`, mm, rounded outward.
    pub fn new(min: [f64; 3], max: [f64; 3]) -> Self {
        Self { min: min.map(round_down), max: max.map(round_up) }
    }

    /// Its least and its greatest corner in the plan view, mm.
    pub fn plan(&self) -> [[f32; 2]; 2] {
        [self.min, self.max].map(|[x, y, _]| [x, y])
    }

    /// Whether it holds a point.
    pub fn holds(&self, p: &Point3) -> bool {
        (0..3).all(|i| f64::from(self.min[i]) <= p[i] && p[i] <= f64::from(self.max[i]))
    }

    /// The box around both.
    pub fn with(&self, other: &Self) -> Self {
        let pick = |i: usize| (self.min[i].min(other.min[i]), self.max[i].max(other.max[i]));
        let [x, y, z] = [0, 1, 2].map(pick);
        Self { min: [x.0, y.0, z.0], max: [x.1, y.1, z.1] }
    }
}

impl Boundable for Extent {
    fn aabb(&self) -> obvhs::aabb::Aabb {
        obvhs::aabb::Aabb::new(self.min.into(), self.max.into())
    }
}

/// Boxes around boxes around slots.
#[derive(Debug, Clone)]
pub struct BoxTree {
    /// The root at 0, nothing of use at 1, then the children of inner nodes side by side, after
    /// their parent.
    pub(super) nodes: Paired<Node>,
}

impl BoxTree {
    /// A tree around boxes, up to `leaf` of them in a leaf, and which of them stands in each slot; the
    /// slots of a leaf follow each other. There must be at least one box.
    ///
    /// Nodes and slots are in the order of a depth-first walk: what a query visits one after the other
    /// then lies close together in memory, which is most of what a scattered query costs.
    pub fn around(boxes: &[Extent], leaf: u32) -> (Self, Vec<u32>) {
        let parameters = BvhBuildParams { max_prims_per_leaf: leaf, ..BvhBuildParams::medium_build() };
        let tree = build_bvh2(boxes, parameters, &mut Duration::default());
        let copy = |index: usize| {
            let n = &tree.nodes[index];
            let (min, max) = (n.aabb().min.to_array(), n.aabb().max.to_array());
            Node { min, count: n.prim_count, max, first: n.first_index }
        };
        let mut nodes = vec![copy(0); 2];
        let mut in_slots = Vec::with_capacity(tree.primitive_indices.len());
        let mut waiting = vec![0];
        while let Some(index) = waiting.pop() {
            let Node { first, count, .. } = nodes[index];
            let first = first as usize;
            if count > 0 {
                nodes[index].first = in_slots.len() as u32;
                in_slots.extend_from_slice(&tree.primitive_indices[first..first + count as usize]);
            } else {
                let children = nodes.len();
                nodes[index].first = children as u32;
                nodes.extend([copy(first), copy(first + 1)]);
                waiting.extend([children + 1, children]);
            }
        }
        (Self { nodes: Paired::from_values(&nodes) }, in_slots)
    }

    /// One more than the greatest index of a box; even.
    pub fn nodes_len(&self) -> usize {
        self.nodes.count()
    }

    /// Box `index`.
    pub fn node(&self, index: usize) -> &Node {
        self.nodes.at(index)
    }

    /// All slots below box `index`, for tests.
    pub fn slots_below(&self, index: usize) -> Vec<usize> {
        let (first, count) = self.node(index).slots_or_children();
        if count > 0 {
            return (first..first + count).collect();
        }
        [first, first + 1].iter().flat_map(|&child| self.slots_below(child)).collect()
    }

    /// The same tree around other boxes, one for each slot.
    pub fn refitted(&self, slots: &[Extent]) -> Self {
        let mut nodes: Vec<Node> = (0..self.nodes.count()).map(|i| *self.nodes.at(i)).collect();
        for i in (0..nodes.len()).rev() {
            let (first, count) = (nodes[i].first as usize, nodes[i].count as usize);
            let extent = if count > 0 {
                slots[first..first + count].iter().fold(Extent::NOTHING, |all, one| all.with(one))
            } else {
                nodes[first].extent().with(&nodes[first + 1].extent())
            };
            (nodes[i].min, nodes[i].max) = (extent.min, extent.max);
        }
        Self { nodes: Paired::from_values(&nodes) }
    }

    /// Branch and bound for a maximum: walks down to every leaf whose `bound(index, box, best)`
    /// exceeds the best value so far, the most promising first, and calls `visit(slot, best)`
    /// there, which returns the best value from then on. Starts with `best`; allocates nothing in
    /// trees of usual depth.
    #[inline]
    pub fn search(
        &self,
        mut best: f64,
        bound: impl Fn(usize, &Node, f64) -> f64,
        mut visit: impl FnMut(usize, f64) -> f64,
    ) {
        let mut waiting = Stack::new();
        let mut next = Some((0, bound(0, self.nodes.at(0), best)));
        while let Some((index, limit)) = next.take().or_else(|| waiting.pop()) {
            if limit <= best {
                continue;
            }
            let node = self.nodes.at(index as usize);
            let first = node.first as usize;
            if node.count > 0 {
                for slot in first..first + node.count as usize {
                    best = visit(slot, best);
                }
                continue;
            }
            let a = (node.first, bound(first, self.nodes.at(first), best));
            let b = (node.first + 1, bound(first + 1, self.nodes.at(first + 1), best));
            let (near, far) = if a.1 >= b.1 { (a, b) } else { (b, a) };
            if near.1 > best {
                next = Some(near);
                if far.1 > best {
                    waiting.push(far);
                }
            }
        }
    }
}

/// A stack of nodes with their bounds that spills to the heap when it grows deep.
struct Stack {
    near: [(u32, f64); STACK],
    len: usize,
    spilled: Vec<(u32, f64)>,
}

impl Stack {
    #[inline]
    fn new() -> Self {
        Self { near: [(0, 0.0); STACK], len: 0, spilled: Vec::new() }
    }

    #[inline]
    fn push(&mut self, item: (u32, f64)) {
        if self.len < STACK {
            self.near[self.len] = item;
            self.len += 1;
        } else {
            self.spilled.push(item);
        }
    }

    #[inline]
    fn pop(&mut self) -> Option<(u32, f64)> {
        self.spilled.pop().or_else(|| {
            self.len = self.len.checked_sub(1)?;
            Some(self.near[self.len])
        })
    }
}
