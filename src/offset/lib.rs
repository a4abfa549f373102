//! Offsets of plane curves, of NURBS patches and of triangle meshes.
//!
//! Enters: a curve or a surface and a distance, mm, with a tolerance. Leaves: a curve or a surface at that
//! distance, its greatest error, and the places where no such offset exists because the shape curves too
//! tightly.
//!
//! Limits: the offset of a curve is trimmed against itself. The offset of a patch is not; its singular places
//! are reported. The offset of a mesh loses pieces that are narrower than its cells.

mod curve_offset;
mod mesh_offset;
mod patch_offset;

pub use curve_offset::{CurveOffset, CurveOffsetError, OffsetPiece, TightPlace, distance_from, offset_curve};
pub use mesh_offset::{LevelSet, LevelSetFoot, MeshOffset, OffsetError, OffsetSettings, Valley};
pub use patch_offset::{OffsetSurface, PatchOffsetError, SingularPlace};
