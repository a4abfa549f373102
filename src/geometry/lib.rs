//! Points, curves, surfaces, triangle meshes and their search trees, plane regions. Knows nothing of cutters.
//!
//! Enters: control points, knots, formulas, triangles or outlines. Leaves: checked shapes that give places,
//! derivatives, nearest points and tessellations. Lengths in mm, angles in rad, f64 throughout; boxes of
//! search trees are f32, rounded outward.
//!
//! Limits: coordinates up to [`MAX_COORDINATE`]. Shapes out of range are refused by the error type of each
//! shape.

mod aabb;
mod analytic;
mod bspline;
mod bvh;
mod coordinates;
mod cover;
mod cubic_spline;
mod interpolate;
mod jet;
mod meeting;
mod mesh;
mod normal;
mod nurbs;
mod polytope;
mod region;
mod region_index;
#[doc(hidden)]
pub mod samples;
mod segment_grid;
pub mod sheets;
mod tessellate;
mod wall_stretch;

pub use aabb::Aabb;
pub use analytic::{AnalyticError, AnalyticShape, AnalyticSurface, HeightJet, MAX_SLOPE};
pub use bspline::{KnotError, KnotVector, MAX_BASIS, MAX_DEGREE};
pub use bvh::{BoxTree, Bvh, Extent, Feature, MeshFoot, Node, Paired, VerticalHit, round_down, round_up};
pub use coordinates::{Isometry3, MAX_COORDINATE, Point2, Point3, Vector2, Vector3, angle_between};
pub use cover::RimSamples;
pub use cubic_spline::{ArcLength, CubicSpline, SplineError};
pub use interpolate::{InterpolationAxis, interpolate};
pub use jet::{Jet2, PrincipalCurvatures};
pub use meeting::{Plane, into_cube, meeting};
pub use mesh::{MeshError, Outside, RepairNotes, TriangleMesh};
pub use normal::{inward, normal_at, unit_normal};
pub use nurbs::{MAX_WEIGHT, NurbsError, NurbsSurface};
pub use polytope::{HalfSpace, Polytope};
pub use region::{
    MAX_OUTLINE_POINTS, Piece, Region, RegionError, clipped, first_crossing, inside_curve, signed_area,
};
pub use region_index::RegionIndex;
pub use segment_grid::{
    CurveSegment, NearestSegment, SegmentGrid, distance_of_segments, distance_to_segment, foot, share_on,
};
pub use tessellate::{MAX_TRIANGLES, TessellateError, Tessellation, tessellate};
pub use wall_stretch::WallStretch;
