//! Points, surfaces, triangle meshes and their search tree. Knows nothing of cutters.

mod aabb;
mod analytic;
mod bspline;
mod bvh;
mod cubic_spline;
mod interpolate;
mod jet;
mod meeting;
mod mesh;
mod normal;
mod nurbs;
mod region;
#[doc(hidden)]
pub mod samples;
mod segment_grid;
mod tessellate;

pub use aabb::Aabb;
pub use analytic::{AnalyticError, AnalyticShape, AnalyticSurface, HeightJet, MAX_SLOPE};
pub use bspline::{KnotError, KnotVector, MAX_BASIS, MAX_DEGREE};
pub use bvh::{BoxTree, Extent, Feature, Node, Paired, round_down, round_up};
pub use bvh::{Bvh, MeshFoot, VerticalHit};
pub use cubic_spline::{ArcLength, CubicSpline, SplineError};
pub use interpolate::{Axis, interpolate};
pub use jet::{Jet2, PrincipalCurvatures};
pub use meeting::{Plane, into_cube, meeting};
pub use mesh::{MeshError, Outside, RepairNotes, TriangleMesh};
pub use normal::{inward, normal_at, unit_normal};
pub use nurbs::{MAX_WEIGHT, NurbsError, NurbsSurface};
pub use region::first_crossing;
pub use region::{MAX_OUTLINE_POINTS, Piece, Region, RegionError, inside_curve, signed_area};
pub use segment_grid::{CurveSegment, NearestSegment, SegmentGrid, distance_to_segment, foot};
pub use tessellate::{MAX_TRIANGLES, TessellateError, Tessellation, tessellate};

/// A point, mm.
pub type Point3 = nalgebra::Point3<f64>;
/// A point of the plane, mm.
pub type Point2 = nalgebra::Point2<f64>;
/// A vector, mm.
pub type Vector3 = nalgebra::Vector3<f64>;
/// A motion of space.
pub type Isometry3 = nalgebra::Isometry3<f64>;
/// A vector of the plane, mm.
pub type Vector2 = nalgebra::Vector2<f64>;

/// Largest coordinate that any part, path or stock may have, mm (one kilometre). Beyond it f64
/// still resolves 1e-10 mm, but f32 boxes and heights no longer resolve a micrometre.
pub const MAX_COORDINATE: f64 = 1.0e6;
