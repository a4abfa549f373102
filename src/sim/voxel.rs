//! The voxel engine: what is left of any stock after a path of any tool axes. mm.
//!
//! Enters: stock (a box, a round bar, a closed mesh), the tool as a [`Solid`] and a path. Leaves: the signed
//! distance from the surface of the remaining material at the samples near it, each with the move that is
//! nearest there; from those its heights, its surface as a closed triangle mesh and where a line leaves it;
//! its volume between proven bounds; how much each move removes in the order of the program, and how near a
//! holder comes to what still stands.
//!
//! The material is the stock less all that the tool sweeps, so its distance is the greater of that of the
//! stock and the negative of that of the swept volume: exact in sign and at the surface, elsewhere no greater
//! than the true one. Samples stand on a lattice, in bricks of 8 × 8 × 8, only where the surface passes: a
//! cube around all is divided like an octree (`divide`), and hands on only those moves to its parts that may
//! be nearest in them (`moves`). Every move cuts, rapids too.

mod bricks;
mod budget;
mod capsule;
mod cells;
mod cube;
mod divide;
mod engine;
mod error;
mod groups;
mod kept_out;
mod leaf;
mod line;
mod moves;
mod octree;
mod removal;
mod slide;
mod standing;
mod surface;
#[cfg(test)]
mod tests;
mod vertex;
mod volume;
mod voxels;

pub use engine::VoxelEngine;
pub use error::VoxelError;
pub use line::LineExit;
pub use removal::VoxelRemoval;
pub use surface::VoxelSurface;
pub use volume::VoxelVolumes;
pub use voxels::Voxels;
