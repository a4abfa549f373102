//! stub
use super::Jet2;
/// A NURBS patch.
#[derive(Debug, Clone, PartialEq)]
pub struct NurbsSurface;
/// Why a patch was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NurbsError {
    /// stub
    #[error("stub")]
    Stub,
}
impl NurbsSurface {
    /// Parameter range `[[u0, u1], [v0, v1]]`.
    pub fn domain(&self) -> [[f64; 2]; 2] {
        todo!()
    }
    /// Position and derivatives.
    pub fn jet(&self, _u: f64, _v: f64) -> Jet2 {
        todo!()
    }
}
