//! Where on the part a cutter touches, from part, cutter and location alone.

use cutter::Cutter;
use geometry::{Point3, Vector3};
use motion::{ClPoint, Toolpath};
use part::{Part, PatchPoint, SurfacePoint};
use std::f64::consts::TAU;

/// Rounds at most in which the place where a tilted cutter touches is found: each takes the normal of the one
/// before.
const CONTACT_ROUNDS: usize = 40;

/// A contact that is off by less than this share of the cutter's radius touches; else others around the
/// cutter are looked for.
const TOUCHING: f64 = 0.01;

/// Places around the cutter from which they are.
const AROUND: usize = 8;

/// Changes whose angle has a lesser sine, squared, count as one.
const PARALLEL: f64 = 1e-6;

/// A round that moves the contact by less, mm, is the last.
const CLOSE: f64 = 1e-7;

/// The place of the part that a cutter touches, or comes nearest to, how far it is off, and where on the
/// cutter that is.
///
/// Rounds close in by the ratio of the curvatures of part and cutter, slowly where a bull nose end mill
/// nearly fills a hollow. There the changes of the last two rounds tell where they lead to (D. G. Anderson,
/// "Iterative procedures for nonlinear integral equations", 1965).
pub(super) fn contact(part: &Part, cutter: &Cutter, at: &ClPoint) -> (SurfacePoint, f64, Point3) {
    let profile = cutter.profile();
    let middle = at.tip + at.axis * profile.centre_z;
    let first = contact_from(part, cutter, at, &middle);
    if first.1.abs() < TOUCHING * cutter.radius() || profile.centre_x == 0.0 {
        return first;
    }
    // Beside a border rounds may end beyond it while the other side of the cutter touches.
    let across = if at.axis.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
    let x = at.axis.cross(&across).normalize();
    let y = at.axis.cross(&x);
    let around = (0..AROUND).map(|k| {
        let (sin, cos) = (TAU * k as f64 / AROUND as f64).sin_cos();
        contact_from(part, cutter, at, &(middle + (x * cos + y * sin) * profile.centre_x))
    });
    around.fold(first, |least, one| if one.1.abs() < least.1.abs() { one } else { least })
}

/// The same by rounds that begin at the place nearest to another one.
fn contact_from(part: &Part, cutter: &Cutter, at: &ClPoint, from: &Point3) -> (SurfacePoint, f64, Point3) {
    let by = |foot: &SurfacePoint| at.tip - cutter.contact_to_tip_along(&foot.normal, &at.axis);
    let mut place = by(&part.closest_point(from).0);
    let mut before: Vec<Round> = Vec::new();
    let (mut least, mut contact) = (f64::INFINITY, place);
    for _ in 0..CONTACT_ROUNDS {
        let to = by(&part.closest_point(&place).0);
        let round = Round { to, moved: to - place };
        let moved = round.moved.norm();
        if moved < least {
            (least, contact) = (moved, to);
        } else {
            // What was led to lies no nearer: from here on as it goes by itself.
            before.clear();
        }
        if moved < CLOSE {
            break;
        }
        place = round.led_to(&before).unwrap_or(to);
        before.push(round);
        if before.len() > 2 {
            before.remove(0);
        }
    }
    let (foot, off) = part.closest_point(&contact);
    (foot, off, contact)
}

/// A round: where it led, and by how much.
struct Round {
    to: Point3,
    moved: Vector3,
}

impl Round {
    /// Where rounds lead to if they change as they did from the ones before to this one.
    fn led_to(&self, before: &[Round]) -> Option<Point3> {
        let changes: Vec<[Vector3; 2]> =
            before.iter().map(|one| [self.moved - one.moved, self.to - one.to]).collect();
        let least = match changes[..] {
            [[a, _]] => vec![self.moved.dot(&a) / a.norm_squared()],
            [[a, _], [b, _]] => {
                // The plane of both changes; one of them alone where they are parallel.
                let (aa, ab, bb) = (a.norm_squared(), a.dot(&b), b.norm_squared());
                let (fa, fb) = (self.moved.dot(&a), self.moved.dot(&b));
                let determinant = aa * bb - ab * ab;
                if determinant > PARALLEL * aa * bb {
                    vec![(fa * bb - fb * ab) / determinant, (fb * aa - fa * ab) / determinant]
                } else {
                    vec![0.0, fb / bb]
                }
            }
            _ => return None,
        };
        let by: Vector3 = changes.iter().zip(least).map(|([_, to], share)| to * share).sum();
        by.iter().all(|x| x.is_finite()).then(|| self.to - by)
    }
}

/// Where on the part's patches the cutter touches at the end of each move that runs on the surface. `None`
/// for other moves, and on meshes.
pub fn contacts_on_patches(part: &Part, cutter: &Cutter, path: &Toolpath) -> Vec<Option<PatchPoint>> {
    if part.patches().is_empty() {
        return vec![None; path.len()];
    }
    work::parallel::map(path.len(), |k| {
        let on = path.moves[k].kind.is_on_surface();
        on.then(|| contact(part, cutter, &path.moves[k].to).0.at).flatten()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{AnalyticShape, AnalyticSurface};
    use motion::{CcPoint, location};
    use part::Patch;

    /// In a bowl of 20 mm a bull nose whose flat has a radius of 2 mm touches all around at a lean of
    /// asin(2/19), 6.04 degrees. Little more leaves one contact, which rounds close in on by 0.96 each.
    #[test]
    fn a_bull_nose_that_nearly_fills_a_bowl_touches_where_it_was_put() {
        let shape = AnalyticShape::Sphere { height: 0.0, radius: 20.0, concave: true };
        let surface = AnalyticSurface::new(shape, [[-12.0, 12.0]; 2]).unwrap();
        let part = Part::from_patches(vec![Patch::Analytic(surface)], 0.002).unwrap();
        let cutter = Cutter::bull(6.0, 1.0).unwrap();
        for lean in [6.3f64, 7.0, 9.0, 20.0] {
            for k in 0..12 {
                let (sin, cos) = (TAU * f64::from(k) / 12.0).sin_cos();
                let normal = Vector3::new(0.15 * cos, -0.1 * sin, 1.0).normalize();
                let point = Point3::new(0.0, 0.0, 20.0) - normal * 20.0;
                let across = normal.cross(&Vector3::new(sin, cos, 0.3)).normalize();
                let lean = lean.to_radians();
                let axis = normal * lean.cos() + across * lean.sin();
                let at = location(&cutter, &CcPoint { point, normal }, &axis);
                let (_, off, found) = contact(&part, &cutter, &at);
                assert!(off.abs() < 1e-9, "{lean} {k}: {off}");
                assert!((found - point).norm() < 1e-5, "{lean} {k}: {found} {point}");
            }
        }
    }
}
