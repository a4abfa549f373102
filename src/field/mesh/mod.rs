//! Fields on triangle meshes: surfaces with holes, several patches as one, plane regions.
//!
//! Enters: a mesh, directions at its vertices and the density of passes wanted there. Leaves: smooth
//! line fields with their singular points and streamlines, stream functions, and their level curves.

mod coarser;
mod levels;
mod lines;
mod recover;
mod refine;
mod sheets;
mod sources;
mod stream;
mod surface;
#[cfg(test)]
mod tests;
mod trace;
mod weld;

pub use coarser::Coarser;
pub use levels::{MeshCurve, MeshLevels, MeshPoint};
pub use lines::{
    Line, SingularPoint, Wanted, blend, blend_lines, flows, merge_singular_points, orient_lines,
    singular_points, smooth_lines,
};
pub use recover::{gradient_terms, vertex_gradients};
pub use refine::Refined;
pub use sheets::{Bend, Sheets};
pub use sources::{Sense, borders, fixed_angle, guides, slope, slope_at};
pub use stream::{Flow, Held, MeshStream, solve_stream, triangle_gradients};
pub use surface::{FieldMesh, MeshFieldError};
pub use trace::{MeshTracer, Streamline};
pub use weld::{parted, weld};
