//! The cut along the normals of surface that no cell sees.
//!
//! It differs from the cut along any normal in two ways. What lies beyond the sides of the block was never there. And a cut
//! beside a convex edge belongs to the surface that is nearest to it: a pass that dips a nanometre into a level top cuts the
//! uppermost line of the wall below as far as its arc is wide. On the medial axis, where the cut is as far from the top as from the
//! wall, the top's own normal meets it as deep or deeper; so where cells measure that top, the wall has no share in it.

use geometry::{Aabb, Point3, Vector3};

use super::{STEEP, sees_level};
use crate::along_normals::{AlongNormal, NormalHit, SweptVolume, ball_beneath};
use crate::facing::Facing;
use crate::figures::NUMERICAL_FLOOR;

/// How much farther than the medial axis is looked for the surface on its other side, as a share and in mm.
const BEYOND: f64 = 1e-2;
const BEYOND_MM: f64 = 1e-5;

/// Places nearer than about this to a convex edge are at the edge, mm. A greater one hides how cuts change beside edges;
/// a lesser one takes what touches the edge for a cut that may go on.
const AT_EDGE: f64 = 1e-3;

/// The cut along the normals of surface that no cell sees.
pub(super) struct UnseenCut<'a> {
    pub cut: &'a SweptVolume<'a>,
    pub block: &'a Aabb,
    pub facing: &'a Facing<'a>,
}

impl UnseenCut<'_> {
    /// How far a line from a place in the block runs before it leaves, mm.
    fn way_out(&self, point: &Point3, normal: &Vector3) -> f64 {
        let along = |c: usize| {
            let side = if normal[c] > 0.0 { self.block.max[c] } else { self.block.min[c] };
            if normal[c] == 0.0 { f64::INFINITY } else { ((side - point[c]) / normal[c]).max(0.0) }
        };
        along(0).min(along(1)).min(along(2))
    }

    /// A cut into the design, or one that touches it, as far as it belongs to this place.
    fn owned(&self, point: &Point3, normal: &Vector3, hit: NormalHit) -> Option<NormalHit> {
        let part = self.cut.part;
        let most = (-hit.deviation).max(AT_EDGE);
        let fits = ball_beneath(part, point, normal, most);
        if fits >= most {
            return Some(hit);
        }
        let beyond = point - normal * (fits * (1.0 + BEYOND) + BEYOND_MM);
        let other = part.closest_point(&beyond).0;
        let level = other.normal.z >= STEEP && sees_level(self.facing, &other);
        let reaches_axis = -hit.deviation >= fits - NUMERICAL_FLOOR;
        let capped = if reaches_axis {
            self.cut.cut.first_cut(point, normal, [-fits, self.cut.outward], Some(&hit))?
        } else {
            hit
        };
        let reaches_axis = -capped.deviation >= fits - NUMERICAL_FLOOR;
        // As deep as the top says, which is measured there. At the very edge the slope of the cut is that against the top.
        let deviation = if level && reaches_axis { 0.0 } else { capped.deviation };
        let turned = level && (reaches_axis || fits < AT_EDGE);
        Some(NormalHit { deviation, normal: if turned { *normal } else { capped.normal }, ..capped })
    }
}

impl AlongNormal for UnseenCut<'_> {
    fn hit(&self, point: &Point3, normal: &Vector3, near: Option<&NormalHit>) -> Option<NormalHit> {
        let hit = self.cut.hit(point, normal, near)?;
        if hit.deviation < NUMERICAL_FLOOR {
            return self.owned(point, normal, hit);
        }
        (hit.deviation <= self.way_out(point, normal)).then_some(hit)
    }

    fn reach(&self) -> f64 {
        self.cut.reach()
    }

    fn standing(&self, point: &Point3, normal: &Vector3) -> f64 {
        self.reach().min(self.way_out(point, normal))
    }

    fn depth(&self) -> f64 {
        self.cut.depth()
    }
}
