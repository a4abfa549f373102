//! Search tree over the triangles of a mesh (stub)
use super::{Point3, TriangleMesh, Vector3};

/// Bounding volume hierarchy over the triangles of one mesh.
#[derive(Debug)]
pub struct Bvh;

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

impl Bvh {
    /// Builds the tree.
    pub fn new(_mesh: &TriangleMesh) -> Self {
        todo!()
    }
    /// The nearest point of the mesh, exact in f64; ties go to the triangle with the least index.
    pub fn closest_point(&self, _mesh: &TriangleMesh, _q: &Point3) -> MeshFoot {
        todo!()
    }
    /// The highest meeting of the vertical line at `(x, y)` with the mesh.
    pub fn highest_at(&self, _mesh: &TriangleMesh, _x: f64, _y: f64) -> Option<VerticalHit> {
        todo!()
    }
}
