//! The cut along the normals of surface that no cell sees.
//!
//! It differs from the cut along any normal in two ways. What lies beyond the sides of the block was never
//! there. And a cut beside a convex edge belongs to the surface that is nearest to it: a pass that dips a
//! nanometre into a level top cuts the uppermost line of the wall below as far as its arc is wide. On the
//! medial axis, where the cut is as far from the top as from the wall, the top's own normal meets it as deep
//! or deeper; so where cells measure that top, the wall has no share in it. At the border of an open sheet the
//! part ends as at a vertical wall: a tool that comes past the end of a face cuts it no deeper than that wall
//! is near.

use geometry::{Point3, Vector3};

use super::{STEEP, sees_level};
use motion::{ClPoint, MoveKind, Toolpath};

use crate::along_normals::{AlongNormal, NormalHit, SweptVolume, Way};
use crate::beneath::{ball_beneath, ball_beneath_at_most, ball_within_borders};
use crate::facing::Facing;
use crate::figures::NUMERICAL_FLOOR;

/// How much farther than the medial axis is looked for the surface on its other side, as a share and in mm.
const BEYOND: f64 = 1e-2;
const BEYOND_MM: f64 = 1e-5;

/// Places nearer than about this to a convex edge are at the edge, mm. A greater one hides how cuts change
/// beside edges; with a lesser one rays along the edge graze every pass over it, which takes as long as all
/// others.
const AT_EDGE: f64 = 1e-3;

/// How often what surrounds a place where nothing was cut is divided. Each takes four times the lines, and
/// has a quarter of what moves rise by aside.
const DIVISIONS: u32 = 2;

/// The cosine between normals of one face so near to each other.
const SAME_FACE: f64 = 0.97;

/// The cut along the normals of surface that no cell sees.
pub(super) struct UnseenCut<'a> {
    pub cut: &'a SweptVolume<'a>,
    pub facing: &'a Facing<'a>,
    /// No tool cuts below this, mm.
    pub lowest: f64,
}

/// The lowest place that tools no wider than a radius come to while they cut, mm.
pub(super) fn lowest_of_tools(path: &Toolpath, radius: f64) -> f64 {
    // On the way from one axis to another none leans more than both.
    let lowest = |at: &ClPoint| match at.axis.z {
        up if up > 0.0 => at.tip.z - radius * at.axis.xy().norm(),
        _ => f64::NEG_INFINITY,
    };
    let cuts = (0..path.len()).filter(|k| path.moves[*k].kind != MoveKind::Rapid);
    cuts.flat_map(|k| [path.location_before(k), path.moves[k].to])
        .fold(f64::INFINITY, |z, at| z.min(lowest(&at)))
}

impl UnseenCut<'_> {
    /// Whether a place lies at a convex edge with surface that cells measure.
    fn is_at_level_edge(&self, point: &Point3, normal: &Vector3) -> bool {
        let fits = ball_beneath(self.cut.part, point, normal, AT_EDGE);
        fits < AT_EDGE && self.is_level_beyond(point, normal, fits)
    }

    /// Whether cells measure the surface on the other side of the medial axis, which is `fits` mm below a
    /// place.
    fn is_level_beyond(&self, point: &Point3, normal: &Vector3, fits: f64) -> bool {
        let beyond = point - normal * (fits * (1.0 + BEYOND) + BEYOND_MM);
        let other = self.cut.part.closest_point(&beyond).0;
        other.normal.z >= STEEP && sees_level(self.facing, &other)
    }

    /// A cut into the design as far as it belongs to this place.
    fn owned(&self, point: &Point3, normal: &Vector3, hit: NormalHit) -> Option<NormalHit> {
        let fits = ball_within_borders(self.cut.part, point, normal, -hit.deviation);
        if fits >= -hit.deviation {
            return Some(hit);
        }
        let capped = self.cut.cut.first_cut(point, normal, [-fits, self.cut.outward], Some(&hit))?;
        if -capped.deviation < fits - NUMERICAL_FLOOR || !self.is_level_beyond(point, normal, fits) {
            // Where all that belongs to the place is cut, the cut itself lies deeper.
            let is_all = capped.deviation <= NUMERICAL_FLOOR - fits;
            return Some(NormalHit { way: if is_all { Way::Thickness } else { capped.way }, ..capped });
        }
        // As deep as the top says, which is measured there.
        Some(NormalHit { deviation: 0.0, normal: *normal, way: Way::Normal, ..capped })
    }

    /// How high all places of a square, `aside` mm to each side along the surface, are left at most; infinite
    /// where the move over its middle does not pass over all of it. What one move leaves is a convex
    /// function: it is greatest at a corner. The square is divided so often.
    fn left_within(&self, point: &Point3, normal: &Vector3, aside: f64, divisions: u32) -> f64 {
        let Some(hit) = self.cut.hit(point, normal, None) else { return f64::INFINITY };
        let Some(along) = normal.cross(&normal.yzx()).try_normalize(1e-9) else { return f64::INFINITY };
        let across = normal.cross(&along);
        let foot =
            |[a, b]: [f64; 2]| self.cut.part.closest_point(&(point + (along * a + across * b) * aside)).0;
        let corners = [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]];
        // Beyond the end of the face its end tells, along the normal of the face.
        let left = |corner| self.cut.cut_by(&foot(corner).point, normal, hit.by);
        let left = corners.map(|corner| left(corner).map_or(f64::INFINITY, |left| left.s));
        let whole = left.into_iter().fold(hit.deviation, f64::max);
        if divisions == 0 {
            return whole;
        }
        let quarters = corners.map(|corner| {
            let middle = foot(corner.map(|x| 0.5 * x));
            let own = if middle.normal.dot(normal) > SAME_FACE { &middle.normal } else { normal };
            self.left_within(&middle.point, own, 0.5 * aside, divisions - 1)
        });
        whole.min(quarters.into_iter().fold(0.0, f64::max))
    }

    /// Whether the line through a place stays below all that cuts.
    fn is_below_all(&self, point: &Point3, normal: &Vector3) -> bool {
        let highest = (normal.z * self.cut.outward).max(-normal.z * self.cut.inward);
        point.z + highest < self.lowest
    }
}

impl AlongNormal for UnseenCut<'_> {
    fn hit(&self, point: &Point3, normal: &Vector3, near: Option<&NormalHit>) -> Option<NormalHit> {
        if self.is_below_all(point, normal) {
            return None;
        }
        let fits = ball_beneath(self.cut.part, point, normal, AT_EDGE);
        let at_edge = fits < AT_EDGE;
        if at_edge && self.is_level_beyond(point, normal, fits) {
            return None;
        }
        let hit = self.cut.hit(point, normal, near)?;
        let hit = if hit.deviation < -NUMERICAL_FLOOR {
            self.owned(point, normal, hit)?
        } else {
            Some(hit).filter(|hit| hit.deviation <= self.cut.way_out(point, normal))?
        };
        // At the very edge the slope of a cut is that against the surface on the other side.
        Some(if at_edge { NormalHit { normal: *normal, way: Way::Normal, ..hit } } else { hit })
    }

    fn reach(&self) -> f64 {
        self.cut.reach()
    }

    fn standing(&self, point: &Point3, normal: &Vector3) -> f64 {
        // The top that is measured there says what stands at its edge.
        if self.is_at_level_edge(point, normal) {
            0.0
        } else {
            self.reach().min(self.cut.way_out(point, normal))
        }
    }

    fn standing_at_most(&self, point: &Point3, normal: &Vector3, within: f64) -> f64 {
        if self.is_at_level_edge(point, normal) {
            0.0
        } else {
            // Places at level edges tell nothing: those beside them stand for these as well.
            let aside = 2.0 * within;
            let out = self.reach().min(self.cut.way_out_within(point, normal, aside));
            if out > NUMERICAL_FLOOR {
                out.min(self.left_within(point, normal, aside, DIVISIONS))
            } else {
                out
            }
        }
    }

    fn depth(&self) -> f64 {
        self.cut.depth()
    }

    fn beyond_depth(&self) -> f64 {
        self.cut.beyond_depth()
    }

    fn depth_at_most(&self, point: &Point3, normal: &Vector3, aside: f64) -> f64 {
        let depth = self.cut.depth_at_most(point, normal, aside);
        // A cut is no deeper than belongs to the place.
        ball_beneath_at_most(self.cut.part, point, normal, aside, depth)
    }
}
