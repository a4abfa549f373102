//! Search tree over the triangles of a mesh: nearest point, highest point, and a walk for others.
//!
//! The boxes are f32 and hold their triangles with a margin; every answer is computed in f64 at the
//! triangles. So the tree decides how fast an answer comes, never which.
//! The tree is built by PLOC with reinsertion (Meister & Bittner 2018, crate obvhs) and is the same
//! for any number of threads.

mod nearest;
mod orient;
#[cfg(test)]
mod tests;
mod vertical;

use std::time::Duration;

use obvhs::bvh2::builder::build_bvh2;
use obvhs::{Boundable, BvhBuildParams};

use super::{Point3, TriangleMesh, Vector3};

/// Bounding volume hierarchy over the triangles of one mesh.
///
/// Queries take that mesh again, which saves a second copy of its vertices; another mesh gives
/// wrong answers.
#[derive(Debug)]
pub struct Bvh {
    /// The root at 0, nothing of use at 1, then the children of inner nodes side by side.
    nodes: Paired<Node>,
    /// Triangle in each slot; the slots of a leaf follow each other.
    triangles: Vec<u32>,
    /// Angle-weighted mean normal at each vertex, any length (Bærentzen & Aanæs 2005).
    vertex_normals: Vec<Vector3>,
}

/// The point of a mesh nearest to a query point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshFoot {
    /// Nearest point, mm.
    pub point: Point3,
    /// Triangle it lies on.
    pub triangle: u32,
    /// Barycentric coordinates on that triangle (sum 1).
    pub barycentric: [f64; 3],
    /// Unit normal: of the face inside a face, angle-weighted mean on an edge or at a vertex.
    pub normal: Vector3,
    /// Distance, mm; negative when the query lies on the inner side.
    pub signed_distance: f64,
}

/// Where a vertical line meets a mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VerticalHit {
    /// Height, mm.
    pub z: f64,
    /// Triangle that is met.
    pub triangle: u32,
    /// Barycentric coordinates there (sum 1).
    pub barycentric: [f64; 3],
}

/// Part of a triangle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Feature {
    /// Its inside.
    Face,
    /// The side from corner `k` to corner `k + 1`, without its ends.
    Side(usize),
    /// Corner `k`.
    Corner(usize),
}

/// Values of up to 32 bytes, two in each cache line: what belongs to the two children of one node
/// then comes with one access to memory, and those accesses are most of what a query costs.
#[derive(Debug, Clone)]
pub(crate) struct Paired<T>(Vec<Pair<T>>);

#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
struct Pair<T>([T; 2]);

impl<T: Copy> Paired<T> {
    /// From an even number of values; a last odd one is left out.
    pub(crate) fn from_values(values: &[T]) -> Self {
        Self(values.chunks_exact(2).map(|pair| Pair([pair[0], pair[1]])).collect())
    }

    /// Value `i`.
    pub(crate) fn at(&self, i: usize) -> &T {
        &self.0[i / 2].0[i % 2]
    }
}

/// A box of the tree: 32 bytes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Node {
    min: [f32; 3],
    /// Number of triangles; 0 for an inner node.
    count: u32,
    max: [f32; 3],
    /// First slot of a leaf, or the first of an inner node's two children.
    first: u32,
}

/// As `f64::max` for numbers, in one instruction instead of five: the walk does little else.
fn greater(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

impl Node {
    /// Squared distance from `(x, y)` to the box in the plan view, mm²; 0 inside.
    pub(crate) fn plan_distance_squared(&self, x: f64, y: f64) -> f64 {
        let dx = self.gap(0, x);
        let dy = self.gap(1, y);
        dx * dx + dy * dy
    }

    /// Squared distance from `q` to the box, mm²; 0 inside.
    fn distance_squared(&self, q: &Point3) -> f64 {
        let dz = self.gap(2, q.z);
        self.plan_distance_squared(q.x, q.y) + dz * dz
    }

    fn gap(&self, axis: usize, x: f64) -> f64 {
        let (before, beyond) = (f64::from(self.min[axis]) - x, x - f64::from(self.max[axis]));
        greater(greater(before, beyond), 0.0)
    }

    /// Middle of the box in the plan view, mm.
    pub(crate) fn plan_centre(&self) -> [f64; 2] {
        [0, 1].map(|axis| 0.5 * (f64::from(self.min[axis]) + f64::from(self.max[axis])))
    }

    /// Upper end of the box, mm.
    pub(crate) fn top(&self) -> f64 {
        f64::from(self.max[2])
    }
}

/// Triangles a leaf may hold. More makes the walk test triangles in vain, fewer makes it test
/// boxes in vain.
const LEAF: u32 = 2;

/// Boxes are grown on each side by this share of the mesh's largest coordinate: far more than the
/// f64 rounding of any distance computed from them, so that no bound is ever too tight; far less
/// than a triangle, so that it costs nothing.
const MARGIN: f64 = f32::EPSILON as f64;

/// Nodes that wait on the walk's stack without an allocation. A tree of a million triangles is
/// about 30 deep; deeper ones spill to the heap.
const STACK: usize = 64;

/// A triangle's grown box, for the builder.
struct Bounds(obvhs::aabb::Aabb);

impl Boundable for Bounds {
    fn aabb(&self) -> obvhs::aabb::Aabb {
        self.0
    }
}

/// The greatest f32 that is not above `x`.
pub(crate) fn round_down(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) > x { near.next_down() } else { near }
}

/// The least f32 that is not below `x`.
pub(crate) fn round_up(x: f64) -> f32 {
    -round_down(-x)
}

/// Nodes and triangles in the order of a depth-first walk: what a query visits one after the other
/// then lies close together in memory, which is most of what a scattered query costs.
fn depth_first(tree: &obvhs::bvh2::Bvh2) -> (Paired<Node>, Vec<u32>) {
    let copy = |index: usize| {
        let n = &tree.nodes[index];
        let (min, max) = (n.aabb().min.to_array(), n.aabb().max.to_array());
        Node { min, count: n.prim_count, max, first: n.first_index }
    };
    let mut nodes = vec![copy(0); 2];
    let mut triangles = Vec::with_capacity(tree.primitive_indices.len());
    let mut waiting = vec![0];
    while let Some(index) = waiting.pop() {
        let Node { first, count, .. } = nodes[index];
        let first = first as usize;
        if count > 0 {
            nodes[index].first = triangles.len() as u32;
            triangles.extend_from_slice(&tree.primitive_indices[first..first + count as usize]);
        } else {
            let children = nodes.len();
            nodes[index].first = children as u32;
            nodes.extend([copy(first), copy(first + 1)]);
            waiting.extend([children + 1, children]);
        }
    }
    (Paired::from_values(&nodes), triangles)
}

impl Bvh {
    /// Builds the tree.
    pub fn new(mesh: &TriangleMesh) -> Self {
        let bounds = mesh.bounds();
        let margin = MARGIN * bounds.min.coords.amax().max(bounds.max.coords.amax());
        let boxes: Vec<Bounds> = crate::parallel::map(mesh.triangles().len(), |t| {
            let b = super::Aabb::of(&mesh.corners(t));
            let min = b.min.coords.map(|x| round_down(x - margin));
            let max = b.max.coords.map(|x| round_up(x + margin));
            Bounds(obvhs::aabb::Aabb::new([min.x, min.y, min.z].into(), [max.x, max.y, max.z].into()))
        });
        let parameters = BvhBuildParams { max_prims_per_leaf: LEAF, ..BvhBuildParams::medium_build() };
        let tree = build_bvh2(&boxes, parameters, &mut Duration::default());
        let (nodes, triangles) = depth_first(&tree);
        Self { nodes, triangles, vertex_normals: nearest::vertex_normals(mesh) }
    }

    /// Number of slots; each holds one triangle.
    pub(crate) fn slots(&self) -> usize {
        self.triangles.len()
    }

    /// The triangle in a slot.
    pub(crate) fn triangle_in(&self, slot: usize) -> usize {
        self.triangles[slot] as usize
    }

    /// One more than the greatest index of a box; even.
    pub(crate) fn boxes(&self) -> usize {
        2 * self.nodes.0.len()
    }

    /// Box `index` and the slots in it, if there are at most `limit`.
    pub(crate) fn few_slots_in(&self, index: usize, limit: usize) -> Option<(&Node, Vec<usize>)> {
        let mut slots = Vec::new();
        let mut waiting = vec![index];
        while let Some(i) = waiting.pop() {
            let node = self.nodes.at(i);
            let (first, count) = (node.first as usize, node.count as usize);
            if count > 0 {
                slots.extend(first..first + count);
            } else {
                waiting.extend([first, first + 1]);
            }
            if slots.len() + waiting.len() > limit {
                return None;
            }
        }
        Some((self.nodes.at(index), slots))
    }

    /// Branch and bound for a maximum: walks down to every leaf whose `bound(index, box, best)`
    /// exceeds the best value so far, the most promising first, and calls `visit(slot, best)`
    /// there, which returns the best value from then on. Starts with `best`; allocates nothing in
    /// trees of usual depth.
    pub(crate) fn search(
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

    /// Outward unit normal at a part of triangle `t`: of the face, the mean of both faces at a
    /// side, the angle-weighted mean at a corner.
    pub(crate) fn normal_at(&self, mesh: &TriangleMesh, t: usize, feature: Feature) -> Vector3 {
        nearest::normal_at(mesh, &self.vertex_normals, t, feature)
    }
}

/// A stack of nodes with their bounds that spills to the heap when it grows deep.
struct Stack {
    near: [(u32, f64); STACK],
    len: usize,
    spilled: Vec<(u32, f64)>,
}

impl Stack {
    fn new() -> Self {
        Self { near: [(0, 0.0); STACK], len: 0, spilled: Vec::new() }
    }

    fn push(&mut self, item: (u32, f64)) {
        if self.len < STACK {
            self.near[self.len] = item;
            self.len += 1;
        } else {
            self.spilled.push(item);
        }
    }

    fn pop(&mut self) -> Option<(u32, f64)> {
        self.spilled.pop().or_else(|| {
            self.len = self.len.checked_sub(1)?;
            Some(self.near[self.len])
        })
    }
}
