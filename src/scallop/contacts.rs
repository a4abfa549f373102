//! Any two places of a ball: the ridge where both balls meet, whatever the surface.

use geometry::{Point3, Vector3};

/// The top of the ridge, mm, between balls of radius `r` around two centres, on their side against `outward`
/// (a unit vector out of the material): `K = (C₁+C₂)/2 − √(r² − d²/4) ŵ`, `ŵ` square to `C₁C₂`. `None` where
/// they do not meet, or stand over each other.
pub fn ridge_between(centres: [Point3; 2], r: f64, outward: &Vector3) -> Option<Point3> {
    let [a, b] = centres;
    let (middle, half) = (nalgebra::center(&a, &b), 0.5 * (b - a));
    let half_distance = half.norm();
    let inside = (r - half_distance) * (r + half_distance);
    if inside.is_nan() || inside < 0.0 {
        return None;
    }
    let along = half.try_normalize(0.0).unwrap_or_else(Vector3::zeros);
    let up = (outward - along * along.dot(outward)).try_normalize(1e-9)?;
    Some(middle - up * inside.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BallSection;
    use motion::CcPoint;
    use proptest::prelude::*;

    fn on_circle(k: f64, arc: f64) -> CcPoint {
        let angle = arc * k;
        // Concave: the middle stands above; the normal points to it.
        let point = Point3::new(angle.sin() / k, 0.0, (1.0 - angle.cos()) / k);
        CcPoint { point, normal: Vector3::new(-angle.sin(), 0.0, angle.cos()) }
    }

    /// The ridge between two contacts of a ball of radius `r`.
    fn ridge_of_contacts(contacts: &[CcPoint; 2], r: f64) -> Option<Point3> {
        let centres = contacts.map(|c| c.point + c.normal * r);
        let up = (contacts[0].normal + contacts[1].normal).try_normalize(1e-9)?;
        ridge_between(centres, r, &up)
    }

    #[test]
    fn contacts_that_are_none_or_too_far_apart_have_no_ridge() {
        let flat = |x: f64| CcPoint { point: Point3::new(x, 0.0, 0.0), normal: Vector3::z() };
        assert_eq!(ridge_of_contacts(&[flat(0.0), flat(6.1)], 3.0), None);
        assert_eq!(ridge_of_contacts(&[flat(0.0), flat(f64::NAN)], 3.0), None);
        assert_eq!(ridge_of_contacts(&[flat(0.0), flat(1.0)], f64::NAN), None);
        let same = ridge_of_contacts(&[flat(0.5), flat(0.5)], 3.0).unwrap();
        assert!((same - flat(0.5).point).norm() < 1e-12);
    }

    proptest! {
        #[test]
        fn on_circles_it_is_the_height_of_the_closed_form(r in 0.2..8.0f64, bend in -3.0..0.9f64, share in 0.01..0.95f64) {
            prop_assume!(bend.abs() > 1e-3);
            let k = bend / r;
            let section = BallSection::new(r, k).unwrap();
            let arc = share * section.greatest_step().arc;
            let ridge = ridge_of_contacts(&[on_circle(k, -0.3 * arc), on_circle(k, 0.7 * arc)], r).unwrap();
            let middle = Point3::new(0.0, 0.0, 1.0 / k);
            let height = k.signum() * (1.0 / k.abs() - (ridge - middle).norm());
            prop_assert!((height - section.height(arc).unwrap()).abs() < 1e-10 * (1.0 + 1.0 / k.abs()));
        }
    }
}
