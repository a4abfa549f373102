//! Triangle meshes: shared vertices, checked once, then immutable.

use super::{Aabb, Point3, Vector3};

/// A checked triangle mesh: every index in range, every coordinate finite and within
/// [`super::MAX_COORDINATE`], no degenerate triangle, orientation consistent across edges.
#[derive(Debug, Clone)]
pub struct TriangleMesh {
    vertices: Vec<Point3>,
    triangles: Vec<[u32; 3]>,
}

/// What was changed to make a mesh usable.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct RepairNotes {
    /// Vertices merged because they coincide.
    pub merged_vertices: usize,
    /// Degenerate triangles dropped.
    pub dropped_degenerate: usize,
}

/// Why a mesh was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// No triangle is left.
    #[error("the mesh has no triangles")]
    Empty,
}

impl TriangleMesh {
    /// TODO H1
    pub fn new(vertices: Vec<Point3>, triangles: Vec<[u32; 3]>) -> Result<(Self, RepairNotes), MeshError> {
        Ok((Self { vertices, triangles }, RepairNotes::default()))
    }
    /// Vertices, mm.
    pub fn vertices(&self) -> &[Point3] {
        &self.vertices
    }
    /// Vertex indices, counter-clockwise seen from outside.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }
    /// The three corners of triangle `t`.
    pub fn corners(&self, t: usize) -> [Point3; 3] {
        self.triangles[t].map(|i| self.vertices[i as usize])
    }
    /// Unit normal of triangle `t`, by its orientation.
    pub fn normal(&self, t: usize) -> Vector3 {
        let [a, b, c] = self.corners(t);
        (b - a).cross(&(c - a)).normalize()
    }
    /// Bounds of all vertices.
    pub fn bounds(&self) -> Aabb {
        Aabb::of(&self.vertices)
    }
}
