//! stub
use crate::cutter::Cutter;
use crate::geometry::Point3;
/// The volume that a cutter sweeps along one straight move, seen from above: its lower envelope.
#[derive(Debug, Clone, Copy)]
pub struct SweptMove;
impl SweptMove {
    /// Prepares the sweep of the tip from `from` to `to`.
    pub fn new(_cutter: &Cutter, _from: Point3, _to: Point3) -> Self {
        todo!()
    }
    /// Lowest height of the swept cutter at `(x, y)`; `None` where it does not pass.
    pub fn height(&self, _x: f64, _y: f64) -> Option<f64> {
        todo!()
    }
    /// As [`SweptMove::height`] with the outward normal of the CUT surface there (unit, up).
    pub fn height_and_normal(&self, _x: f64, _y: f64) -> Option<(f64, crate::geometry::Vector3)> {
        todo!()
    }
}
