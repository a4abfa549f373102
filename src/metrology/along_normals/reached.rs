//! Whether what stands above the uncut tolerance is a tall scallop, or material that no pass came down to.
//!
//! The rule is that of cells: a ridge is a scallop when one of the passes that meet in it touches the design
//! nearby, and a place below such a ridge is part of it when the pass that cut there came down to the design.

use super::ridges::Crossing;
use super::{NormalInspection, Sample};
use geometry::{Point3, Vector3};

/// A pass serves a ridge when it touches the design within this many distances of the two contacts. On a
/// plane it is half of one; in a hollow of radius 4/3 of the cutter's, two.
const FARTHEST_CONTACT: f64 = 2.0;

/// A place is no higher than a ridge when it rises above it by no more than this share.
const RIDGE_IS_TOP: f64 = 1e-3;

impl NormalInspection<'_> {
    /// True for a ridge within the uncut tolerance, and for a higher one between passes that came down to the
    /// design.
    pub fn is_scallop(&self, crossing: &Crossing) -> bool {
        if crossing.height <= self.limits.uncut {
            return true;
        }
        let (foot, _) = self.part.closest_point(&crossing.at);
        let contacts = crossing.moves.map(|by| self.nearest_contact(by, &foot.point, &foot.normal));
        let far = FARTHEST_CONTACT * (contacts[0] - contacts[1]).norm();
        let serves = |contact: &Point3| (contact - foot.point).norm() <= far && self.is_on_design(contact);
        contacts.iter().any(serves)
    }

    /// True where material above the uncut tolerance is no part of a scallop; `highest_ridge` is the highest
    /// of those, mm.
    pub fn is_uncut(&self, sample: &Sample, highest_ridge: f64) -> bool {
        let Some(hit) = sample.hit else { return true };
        hit.deviation > self.limits.uncut
            && !(hit.deviation <= highest_ridge * (1.0 + RIDGE_IS_TOP) && self.reached(sample))
    }

    /// True where the pass that cut came down to the design.
    fn reached(&self, sample: &Sample) -> bool {
        let place = &sample.place;
        sample
            .hit
            .is_some_and(|hit| self.is_on_design(&self.nearest_contact(hit.by, &place.point, &place.normal)))
    }

    fn is_on_design(&self, contact: &Point3) -> bool {
        self.part.closest_point(contact).1 <= self.limits.uncut
    }

    /// Where the cutter touches a surface with this normal while the move `by` passes nearest to `place`.
    fn nearest_contact(&self, by: u32, place: &Point3, normal: &Vector3) -> Point3 {
        let (from, to) = (self.path.location_before(by as usize), self.path.moves[by as usize].to);
        let cutter = self.cutters.of_move(by);
        let contact = |t: f64| {
            let at = from.towards(&to, t);
            at.tip - cutter.contact_to_tip_along(normal, &at.axis)
        };
        let (a, b) = (contact(0.0), contact(1.0));
        let way = b - a;
        let square = way.norm_squared();
        let t = if square > 0.0 { ((place - a).dot(&way) / square).clamp(0.0, 1.0) } else { 0.0 };
        contact(t)
    }
}
