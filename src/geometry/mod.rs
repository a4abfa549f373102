//! Points, surfaces, triangle meshes and their search tree. Knows nothing of cutters.

mod aabb;
mod analytic;
mod blade;
mod bspline;
mod bvh;
mod cubic_spline;
mod curve_offset;
mod fairing;
mod interpolate;
mod jet;
mod loft;
mod meeting;
mod mesh;
mod mesh_offset;
mod nurbs;
mod patch_offset;
mod region;
#[cfg(test)]
pub(crate) mod samples;
pub mod sections;
mod segment_grid;
mod tessellate;

pub use aabb::Aabb;
pub use analytic::{AnalyticError, AnalyticShape, AnalyticSurface, HeightJet, MAX_SLOPE};
pub use blade::{Blade, BladeCurve, BladeError, BladeSection, BladeSettings, BladeSide};
pub use bspline::{KnotError, KnotVector, MAX_BASIS, MAX_DEGREE};
pub(crate) use bvh::{BoxTree, Extent, Feature, Node, Paired, round_down, round_up};
pub use bvh::{Bvh, MeshFoot, VerticalHit};
pub use cubic_spline::{ArcLength, CubicSpline, SplineError};
pub use curve_offset::{CurveOffset, CurveOffsetError, OffsetPiece, TightPlace, offset_curve};
pub use fairing::{
    Faired, Fairing, FairingError, FairingMethod, FairingStop, JUMP_REMOVING_STEP, jump_energy,
    kjellander_place,
};
pub use jet::{Jet2, PrincipalCurvatures};
pub use loft::{Loft, LoftError, LoftSection, loft, loft_of_offsets};
pub(crate) use meeting::{Plane, into_cube, meeting};
pub use mesh::{MeshError, Outside, RepairNotes, TriangleMesh};
pub use mesh_offset::{LevelSet, LevelSetFoot, MeshOffset, OffsetError, OffsetSettings, Valley};
pub use nurbs::{MAX_WEIGHT, NurbsError, NurbsSurface};
pub use patch_offset::{
    FittedOffset, OffsetJet, OffsetSurface, PatchOffsetError, SingularPlace, unit_normal,
};
pub(crate) use region::first_crossing;
pub use region::{MAX_OUTLINE_POINTS, Piece, Region, RegionError, inside_curve, signed_area};
pub(crate) use segment_grid::foot;
pub use segment_grid::{CurveSegment, NearestSegment, SegmentGrid};
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
