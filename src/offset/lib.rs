//! Offsets: of plane curves, of NURBS patches and of triangle meshes. Enters: a curve or a surface and a distance, mm.
//! Leaves: what lies that far off it, and where there is no such place.

pub mod curve_offset;
mod mesh_offset;
mod patch_offset;

pub use curve_offset::{CurveOffset, CurveOffsetError, OffsetPiece, TightPlace, offset_curve};
pub use mesh_offset::{LevelSet, LevelSetFoot, MeshOffset, OffsetError, OffsetSettings, Valley};
pub use patch_offset::{FittedOffset, OffsetJet, OffsetSurface, PatchOffsetError, SingularPlace};
