//! The strategies, one file each: its parameters, its keys in a scene, its planner. Enters: part, cutter and pass settings.
//! Leaves: passes, not yet joined.

pub mod contour_spiral;
pub mod iso_scallop;
pub mod mesh_passes;
pub mod mesh_shortest;
pub mod offset_mesh;
pub mod offset_surface;
pub mod shortest;
pub mod spiral;
pub mod streamline;
pub mod waterline;
pub mod zigzag;
