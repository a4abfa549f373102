//! What is to be made: one view over patches and meshes.
//!
//! Enters: NURBS patches, surfaces by formula, or a mesh. Leaves: bounds, closest points, heights
//! and curvature, in the part's frame (mm, z up). Parametric patches keep a tessellation to search
//! in; every answer is then refined on the exact surface, so tessellation bounds the search, not
//! the result.

use crate::geometry::{Aabb, AnalyticSurface, Bvh, Jet2, NurbsSurface, Point3, TriangleMesh, Vector3};

/// A parametric patch.
#[derive(Debug, Clone, PartialEq)]
pub enum Patch {
    /// A NURBS patch.
    Nurbs(NurbsSurface),
    /// A surface by formula.
    Analytic(AnalyticSurface),
}

impl Patch {
    /// Parameter range `[[u0, u1], [v0, v1]]`.
    pub fn domain(&self) -> [[f64; 2]; 2] {
        match self {
            Self::Nurbs(s) => s.domain(),
            Self::Analytic(s) => s.domain(),
        }
    }

    /// Position and derivatives to second order; parameters are clamped to the domain.
    pub fn jet(&self, u: f64, v: f64) -> Jet2 {
        match self {
            Self::Nurbs(s) => s.jet(u, v),
            Self::Analytic(s) => s.jet(u, v),
        }
    }
}

/// Which point of which patch: patch index and parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PatchPoint {
    /// Index into [`Part::patches`].
    pub patch: u32,
    /// First parameter.
    pub u: f64,
    /// Second parameter.
    pub v: f64,
}

/// A point of the part's surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Position, mm.
    pub point: Point3,
    /// Outward unit normal (the side that the tool comes from).
    pub normal: Vector3,
    /// Where on which patch; `None` on a mesh.
    pub at: Option<PatchPoint>,
    /// Triangle of [`Part::mesh`] in which the search ended.
    pub triangle: u32,
}

/// What is to be made.
#[derive(Debug)]
pub struct Part {
    patches: Vec<Patch>,
    mesh: TriangleMesh,
    bvh: Bvh,
}

impl Part {
    /// A part that is a mesh.
    pub fn from_mesh(mesh: TriangleMesh) -> Self {
        let bvh = Bvh::new(&mesh);
        Self { patches: Vec::new(), mesh, bvh }
    }
    /// The patches; empty for a mesh part.
    pub fn patches(&self) -> &[Patch] {
        &self.patches
    }
    /// The mesh itself, or the tessellation of the patches.
    pub fn mesh(&self) -> &TriangleMesh {
        &self.mesh
    }
    /// The search tree over [`Part::mesh`].
    pub fn bvh(&self) -> &Bvh {
        &self.bvh
    }
    /// Bounds of the exact surface up to the tessellation's deviation.
    pub fn bounds(&self) -> Aabb {
        self.mesh.bounds()
    }
    /// Largest distance between [`Part::mesh`] and the exact surface, mm; 0 for a mesh part.
    pub fn mesh_deviation(&self) -> f64 {
        todo!()
    }
    /// Vertex parameters of the tessellation: patch and parameters of triangle `t`'s corners.
    pub fn corner_parameters(&self, _t: usize) -> Option<[PatchPoint; 3]> {
        todo!()
    }
    /// The surface point nearest to `q` and the signed distance of `q` from it (positive outside).
    pub fn closest_point(&self, _q: &Point3) -> (SurfacePoint, f64) {
        todo!()
    }
    /// The highest surface point above or below `(x, y)`; `None` off the part.
    pub fn highest_at(&self, _x: f64, _y: f64) -> Option<SurfacePoint> {
        todo!()
    }
}
