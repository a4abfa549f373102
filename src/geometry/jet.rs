//! A surface point with its derivatives to second order, and what follows from them: metric,
//! normal, curvature (do Carmo, *Differential Geometry of Curves and Surfaces*, ch. 2–3).
//!
//! Sign of curvature throughout the crate: positive where the surface is concave toward its
//! normal (the inside of a bowl seen from above), negative where it is convex (a dome).
//!
//! With this sign cutter and surface are compared by a plain difference of curvatures.

use super::{Point3, Vector3};

/// Position and partial derivatives of a parametric surface at one parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jet2 {
    /// Position, mm.
    pub p: Point3,
    /// ∂S/∂u.
    pub du: Vector3,
    /// ∂S/∂v.
    pub dv: Vector3,
    /// ∂²S/∂u².
    pub duu: Vector3,
    /// ∂²S/∂u∂v.
    pub duv: Vector3,
    /// ∂²S/∂v².
    pub dvv: Vector3,
}

/// Principal curvatures, 1/mm, and their unit directions in space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PrincipalCurvatures {
    /// The lesser curvature (the most convex section).
    pub min: f64,
    /// The greater curvature (the most concave section).
    pub max: f64,
    /// Unit tangent along which the curvature is `min`.
    pub min_direction: Vector3,
    /// Unit tangent along which the curvature is `max`; `min_direction × max_direction = normal`
    /// up to sign.
    pub max_direction: Vector3,
}

/// A parametrisation counts as degenerate where `|du × dv|` is below this share of
/// `|du|² + |dv|²` (the poles of a sphere patch). Greater refuses honest slender patches; less
/// lets normals be computed from rounding noise.
const DEGENERATE: f64 = 1e-12;

impl Jet2 {
    /// First fundamental form `(E, F, G)`, mm² per squared parameter.
    pub fn first_form(&self) -> (f64, f64, f64) {
        (self.du.norm_squared(), self.du.dot(&self.dv), self.dv.norm_squared())
    }

    /// Unit normal `du × dv / |du × dv|`; `None` where the parametrisation is degenerate.
    pub fn normal(&self) -> Option<Vector3> {
        let cross = self.du.cross(&self.dv);
        let scale = self.du.norm_squared() + self.dv.norm_squared();
        let length = cross.norm();
        (length > DEGENERATE * scale).then(|| cross / length)
    }

    /// Second fundamental form `(L, M, N)` for the unit normal `n`.
    pub fn second_form(&self, n: &Vector3) -> (f64, f64, f64) {
        (self.duu.dot(n), self.duv.dot(n), self.dvv.dot(n))
    }

    /// Curvature of the normal section along the tangent `(a, b)` in parameters (any length),
    /// 1/mm, positive where concave toward [`Jet2::normal`]. `None` where degenerate.
    pub fn normal_curvature(&self, a: f64, b: f64) -> Option<f64> {
        let n = self.normal()?;
        let (e, f, g) = self.first_form();
        let (l, m, nn) = self.second_form(&n);
        let metric = e * a * a + 2.0 * f * a * b + g * b * b;
        (metric > 0.0).then(|| (l * a * a + 2.0 * m * a * b + nn * b * b) / metric)
    }

    /// Parameters `(a, b)` of the tangential part of a vector in space. `None` where degenerate.
    pub fn pull_back(&self, w: &Vector3) -> Option<(f64, f64)> {
        let (e, f, g) = self.first_form();
        let det = e * g - f * f;
        let scale = e + g;
        if det <= DEGENERATE * DEGENERATE * scale * scale {
            return None;
        }
        let (wu, wv) = (w.dot(&self.du), w.dot(&self.dv));
        Some(((g * wu - f * wv) / det, (e * wv - f * wu) / det))
    }

    /// Principal curvatures and directions. `None` where degenerate. At an umbilic the directions
    /// are any orthonormal pair.
    pub fn principal_curvatures(&self) -> Option<PrincipalCurvatures> {
        let n = self.normal()?;
        // An orthonormal tangent frame turns the shape operator into a symmetric 2x2 matrix.
        let e1 = self.du.normalize();
        let e2 = n.cross(&e1);
        let (a1, b1) = self.pull_back(&e1)?;
        let (a2, b2) = self.pull_back(&e2)?;
        let (l, m, nn) = self.second_form(&n);
        let form = |a: f64, b: f64, c: f64, d: f64| l * a * c + m * (a * d + b * c) + nn * b * d;
        let (k11, k12, k22) = (form(a1, b1, a1, b1), form(a1, b1, a2, b2), form(a2, b2, a2, b2));
        let mean = 0.5 * (k11 + k22);
        let half = 0.5 * (k11 - k22);
        let radius = half.hypot(k12);
        let angle = 0.5 * k12.atan2(half);
        let max_direction = e1 * angle.cos() + e2 * angle.sin();
        Some(PrincipalCurvatures {
            min: mean - radius,
            max: mean + radius,
            min_direction: n.cross(&max_direction),
            max_direction,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    /// A jet with z = ½(a x² + 2 b x y + c y²) + p x + q y at the origin.
    fn graph([p, q]: [f64; 2], [a, b, c]: [f64; 3]) -> Jet2 {
        let up = |z| Vector3::new(0.0, 0.0, z);
        Jet2 {
            p: Point3::origin(),
            du: Vector3::new(1.0, 0.0, p),
            dv: Vector3::new(0.0, 1.0, q),
            duu: up(a),
            duv: up(b),
            dvv: up(c),
        }
    }

    #[test]
    fn a_torus_has_its_two_curvatures() {
        // Major radius 10, minor 3, at angle v around the tube: outward curvatures −1/3 and
        // −cos v / (10 + 3 cos v).
        let (big, small) = (10.0, 3.0);
        for v in [0.0, 0.4, 1.3, 2.0, 3.1] {
            let (sv, cv) = f64::sin_cos(v);
            let (su, cu) = f64::sin_cos(0.7);
            let ring = big + small * cv;
            let jet = Jet2 {
                p: Point3::new(ring * cu, ring * su, small * sv),
                du: Vector3::new(-ring * su, ring * cu, 0.0),
                dv: Vector3::new(-small * sv * cu, -small * sv * su, small * cv),
                duu: Vector3::new(-ring * cu, -ring * su, 0.0),
                duv: Vector3::new(small * sv * su, -small * sv * cu, 0.0),
                dvv: Vector3::new(-small * cv * cu, -small * cv * su, -small * sv),
            };
            assert_relative_eq!(jet.normal().unwrap(), Vector3::new(cv * cu, cv * su, sv), epsilon = 1e-14);
            let k = jet.principal_curvatures().unwrap();
            assert_relative_eq!(k.min, -1.0 / small, epsilon = 1e-13);
            assert_relative_eq!(k.max, -cv / ring, epsilon = 1e-13);
            assert_relative_eq!(k.max_direction.dot(&jet.du.normalize()).abs(), 1.0, epsilon = 1e-12);
        }
    }

    #[test]
    fn bowls_are_positive_and_umbilics_have_a_frame() {
        let k = graph([0.0, 0.0], [0.5, 0.0, 0.5]).principal_curvatures().unwrap();
        assert_relative_eq!(k.min, 0.5);
        assert_relative_eq!(k.max, 0.5);
        assert_relative_eq!(k.min_direction.dot(&k.max_direction), 0.0);
        assert_relative_eq!(k.min_direction.norm(), 1.0, epsilon = 1e-15);
    }

    #[test]
    fn degenerate_jets_say_so() {
        let mut jet = graph([0.0, 0.0], [1.0, 0.0, 1.0]);
        jet.dv = jet.du * 2.0;
        assert!(jet.normal().is_none() && jet.principal_curvatures().is_none());
        assert!(jet.pull_back(&Vector3::x()).is_none() && jet.normal_curvature(1.0, 0.0).is_none());
        jet.du = Vector3::zeros();
        jet.dv = Vector3::zeros();
        assert!(jet.normal().is_none() && jet.pull_back(&Vector3::x()).is_none());
        assert!(graph([0.0, 0.0], [1.0; 3]).normal_curvature(0.0, 0.0).is_none());
    }

    proptest! {
        /// Principal curvatures bound every normal section, are attained along their directions, and
        /// Euler's formula gives all others; none of it depends on the parametrisation.
        #[test]
        fn euler(
            slope in proptest::array::uniform2(-2.0f64..2.0),
            bend in proptest::array::uniform3(-1.0f64..1.0),
            angle in 0.0f64..3.2,
            [a, d] in proptest::array::uniform2(0.5f64..2.0),
            [b, c] in proptest::array::uniform2(-0.4f64..0.4),
        ) {
            let jet = graph(slope, bend);
            let k = jet.principal_curvatures().unwrap();
            let tangent = k.min_direction * angle.cos() + k.max_direction * angle.sin();
            let (s, t) = jet.pull_back(&tangent).unwrap();
            prop_assert!((jet.du * s + jet.dv * t - tangent).norm() < 1e-12);
            let euler = k.min * angle.cos().powi(2) + k.max * angle.sin().powi(2);
            prop_assert!((jet.normal_curvature(s, t).unwrap() - euler).abs() < 1e-12);
            let (_, m, _) = jet.second_form(&jet.normal().unwrap());
            prop_assert!((m - bend[1] / (1.0 + slope[0].powi(2) + slope[1].powi(2)).sqrt()).abs() < 1e-14);
            // Other parameters on the same side: a d − b c > 0.
            let other = Jet2 {
                p: jet.p,
                du: jet.du * a + jet.dv * b,
                dv: jet.du * c + jet.dv * d,
                duu: jet.duu * (a * a) + jet.duv * (2.0 * a * b) + jet.dvv * (b * b),
                duv: jet.duu * (a * c) + jet.duv * (a * d + b * c) + jet.dvv * (b * d),
                dvv: jet.duu * (c * c) + jet.duv * (2.0 * c * d) + jet.dvv * (d * d),
            };
            let same = other.principal_curvatures().unwrap();
            prop_assert!((same.min - k.min).abs() < 1e-9 && (same.max - k.max).abs() < 1e-9);
        }
    }
}
