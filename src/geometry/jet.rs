//! A surface point with its derivatives to second order, and what follows from them: metric,
//! normal, curvature (do Carmo, *Differential Geometry of Curves and Surfaces*, ch. 2–3).
//!
//! Sign of curvature throughout the crate: positive where the surface is concave toward its
//! normal (the inside of a bowl seen from above), negative where it is convex (a dome).

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
