//! Search tree over the triangles of a mesh: nearest point, highest point, and a walk for others.
//!
//! The boxes are f32 and hold their triangles with a margin; every answer is computed in f64 at the
//! triangles. So the tree decides how fast an answer comes, never which.

mod nearest;
mod orient;
#[cfg(test)]
mod tests;
mod tree;
mod vertical;

use super::{Point3, TriangleMesh, Vector3};
pub use tree::{BoxTree, Extent, Node, Paired, round_down, round_up};

/// Bounding volume hierarchy over the triangles of one mesh.
///
/// Queries take that mesh again, which saves a second copy of its vertices; another mesh gives
/// wrong answers.
#[derive(Debug)]
pub struct Bvh {
    tree: BoxTree,
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
pub enum Feature {
    /// Its inside.
    Face,
    /// The side from corner `k` to corner `k + 1`, without its ends.
    Side(usize),
    /// Corner `k`.
    Corner(usize),
}

/// Triangles a leaf may hold. More makes the walk test triangles in vain, fewer makes it test
/// boxes in vain.
const LEAF: u32 = 2;

/// Boxes are grown on each side by this share of the mesh's largest coordinate: far more than the
/// f64 rounding of any distance computed from them, so that no bound is ever too tight; far less
/// than a triangle, so that it costs nothing.
const MARGIN: f64 = f32::EPSILON as f64;

impl Bvh {
    /// Builds the tree.
    pub fn new(mesh: &TriangleMesh) -> Self {
        let bounds = mesh.bounds();
        let margin = MARGIN * bounds.min.coords.amax().max(bounds.max.coords.amax());
        let boxes: Vec<Extent> = work::parallel::map(mesh.triangles().len(), |t| {
            let b = super::Aabb::of(&mesh.corners(t));
            Extent::new(b.min.coords.map(|x| x - margin).into(), b.max.coords.map(|x| x + margin).into())
        });
        let (tree, triangles) = BoxTree::around(&boxes, LEAF);
        Self { tree, triangles, vertex_normals: nearest::vertex_normals(mesh) }
    }

    /// The boxes around the triangles.
    pub fn tree(&self) -> &BoxTree {
        &self.tree
    }

    /// Number of slots; each holds one triangle.
    pub fn slots(&self) -> usize {
        self.triangles.len()
    }

    /// The triangle in a slot.
    pub fn triangle_in(&self, slot: usize) -> usize {
        self.triangles[slot] as usize
    }

    /// One more than the greatest index of a box; even.
    pub fn boxes(&self) -> usize {
        self.tree.nodes.count()
    }

    /// Box `index` and the slots in it, if there are at most `limit`.
    pub fn few_slots_in(&self, index: usize, limit: usize) -> Option<(&Node, Vec<usize>)> {
        let mut slots = Vec::new();
        let mut waiting = vec![index];
        while let Some(i) = waiting.pop() {
            let node = self.tree.nodes.at(i);
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
        Some((self.tree.nodes.at(index), slots))
    }

    /// Outward unit normal at a part of triangle `t`: of the face, the mean of both faces at a
    /// side, the angle-weighted mean at a corner.
    pub fn normal_at(&self, mesh: &TriangleMesh, t: usize, feature: Feature) -> Vector3 {
        nearest::normal_at(mesh, &self.vertex_normals, t, feature)
    }
}
