//! stub
use crate::cutter::Cutter;
use crate::part::{Part, SurfacePoint};
/// Where a cutter dropped along -z comes to rest on a part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drop {
    /// Height of the tip, mm.
    pub tip_z: f64,
    /// Where it touches.
    pub contact: SurfacePoint,
}
/// Drops one cutter onto one part.
#[derive(Debug, Clone, Copy)]
pub struct DropCutter<'a> {
    part: &'a Part,
    cutter: &'a Cutter,
}
impl<'a> DropCutter<'a> {
    /// Prepares.
    pub fn new(part: &'a Part, cutter: &'a Cutter) -> Self {
        Self { part, cutter }
    }
    /// Highest tip position over `(x, y)` at which the cutter touches the part without cutting into
    /// it; `None` where the cutter does not reach the part at all.
    pub fn at(&self, _x: f64, _y: f64) -> Option<Drop> {
        let _ = (self.part, self.cutter);
        todo!()
    }
}
