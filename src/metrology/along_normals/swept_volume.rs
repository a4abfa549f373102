//! The cut as the volume that the tool swept.

use super::{AlongNormal, NormalHit};
use crate::cutter::Solid;
use crate::geometry::{Point3, Vector3};
use crate::sim::Rays;
use crate::toolpath::Toolpath;

/// What a path cuts, along normals of the design.
pub struct SweptVolume<'a> {
    /// The moves that cut.
    pub rays: &'a Rays,
    /// The path that they are of.
    pub path: &'a Toolpath,
    /// The tool.
    pub solid: &'a Solid,
    /// How far below the design is looked, mm: deeper cuts count as so deep.
    pub inward: f64,
    /// How far above it, mm.
    pub outward: f64,
}

impl AlongNormal for SweptVolume<'_> {
    fn hit(&self, point: &Point3, normal: &Vector3, near: Option<&NormalHit>) -> Option<NormalHit> {
        let seed = near.map(|hit| hit.seed);
        let (hit, seed) = self.rays.deviation_near(point, normal, [self.inward, self.outward], seed)?;
        let cut = if self.solid.ball().is_some() {
            let to = &self.path.moves[hit.index as usize].to;
            let at = self.path.location_before(hit.index as usize).towards(to, hit.t);
            -self.solid.foot(&at.tip, &at.axis, &(point + normal * hit.s)).gradient
        } else {
            // Where an edge cuts, the tool by itself has no normal.
            self.rays.cut_normal(point, normal, &hit)?
        };
        Some(NormalHit { deviation: hit.s, by: hit.index, normal: cut, seed })
    }

    fn reach(&self) -> f64 {
        self.outward
    }
}
