//! The strategies: each a way to cover a part with passes.

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
