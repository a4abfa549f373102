//! Where on the part a cutter touches, from part, cutter and location alone.

use cutter::Cutter;
use geometry::Point3;
use motion::{ClPoint, Toolpath};
use part::{Part, PatchPoint, SurfacePoint};

/// Rounds at most in which the place where a tilted cutter touches is found: each takes the normal of the one before. They close
/// in by the ratio of the curvatures of part and cutter.
const CONTACT_ROUNDS: usize = 40;

/// A round that moves the contact by less, mm, is the last.
const CLOSE: f64 = 1e-7;

/// The place of the part that a cutter touches, or comes nearest to, how far it is off, and where on the cutter that is.
pub(super) fn contact(part: &Part, cutter: &Cutter, at: &ClPoint) -> (SurfacePoint, f64, Point3) {
    let mut foot = part.closest_point(&(at.tip + at.axis * cutter.profile().centre_z)).0;
    let (mut off, mut contact) = (f64::INFINITY, at.tip);
    for _ in 0..CONTACT_ROUNDS {
        let before = contact;
        contact = at.tip - cutter.contact_to_tip_along(&foot.normal, &at.axis);
        (foot, off) = part.closest_point(&contact);
        if (contact - before).norm() < CLOSE {
            break;
        }
    }
    (foot, off, contact)
}

/// Where on the part's patches the cutter touches at the end of each move that runs on the surface. `None` for other moves, and
/// on meshes.
pub fn contacts_on_patches(part: &Part, cutter: &Cutter, path: &Toolpath) -> Vec<Option<PatchPoint>> {
    if part.patches().is_empty() {
        return vec![None; path.len()];
    }
    work::parallel::map(path.len(), |k| {
        let on = path.moves[k].kind.is_on_surface();
        on.then(|| contact(part, cutter, &path.moves[k].to).0.at).flatten()
    })
}
