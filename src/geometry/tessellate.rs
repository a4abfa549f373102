//! stub
use super::{Jet2, TriangleMesh};
/// A triangle mesh inscribed in a parametric surface.
#[derive(Debug, Clone)]
pub struct Tessellation {
    /// The mesh; its vertices lie on the surface.
    pub mesh: TriangleMesh,
    /// Parameters of each vertex.
    pub parameters: Vec<[f64; 2]>,
    /// Largest distance between mesh and surface that was measured, mm.
    pub deviation: f64,
}
/// Tessellates within `tolerance`.
pub fn tessellate(
    _jet: &(dyn Fn(f64, f64) -> Jet2 + Sync),
    _domain: [[f64; 2]; 2],
    _tolerance: f64,
) -> Tessellation {
    todo!()
}
