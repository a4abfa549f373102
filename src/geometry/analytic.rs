//! stub: Surfaces by formula, graphs z = f(x, y) over a rectangle.
use super::Jet2;
/// Shape of a formula surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AnalyticShape {
    /// stub
    Plane,
}
/// A graph over a rectangle.
#[derive(Debug, Clone, PartialEq)]
pub struct AnalyticSurface;
/// Why a formula surface was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AnalyticError {
    /// stub
    #[error("stub")]
    Stub,
}
impl AnalyticSurface {
    /// Parameter range.
    pub fn domain(&self) -> [[f64; 2]; 2] {
        todo!()
    }
    /// Position and derivatives.
    pub fn jet(&self, _u: f64, _v: f64) -> Jet2 {
        todo!()
    }
}
