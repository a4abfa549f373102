//! The true offset of a NURBS patch: every point moved by the same distance along its unit normal.
//!
//! Enters: a patch and a signed distance, mm, along `du × dv` (negative: to the other side). Leaves: points,
//! derivatives and curvatures in closed form (Weingarten's equations; do Carmo, *Differential Geometry of
//! Curves and Surfaces*, 1976, ch. 3); a B-spline surface fitted within a tolerance ([`OffsetSurface::fit`]);
//! the places where the offset is singular ([`OffsetSurface::singular_places`]).
//!
//! The sign of curvature is that of [`Jet2`]: positive where concave toward `du × dv`. A patch whose
//! outward side is the other one is offset outward by a negative distance.

mod crease;
mod fit;
mod singular;
#[cfg(test)]
mod tests;

pub use fit::FittedOffset;
pub use singular::SingularPlace;

use geometry::{MAX_COORDINATE, NurbsError, NurbsSurface, Point3, Vector3, normal_at};

/// Why a patch has no such offset.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PatchOffsetError {
    /// The distance is no usual number.
    #[error("the offset distance is {0} mm; it must be a number of at most 1e6 in size")]
    Distance(f64),
    /// The tolerance is no usual number.
    #[error(
        "the tolerance is {0} mm; it must be a number greater than 0, and at least 1e-12 of the patch's size"
    )]
    Tolerance(f64),
    /// The patch has no normal at a place nor beside it.
    #[error(
        "the patch has no normal at u {u} v {v} (x {:.4} y {:.4} z {:.4}); its control points coincide or lie on a \
         line there: give it an area",
        at.x, at.y, at.z
    )]
    NoNormal {
        /// Parameter.
        u: f64,
        /// Parameter.
        v: f64,
        /// The point, mm.
        at: Point3,
    },
    /// The fit does not come down to the tolerance.
    #[error(
        "the offset is reached within {reached:.2e} mm only, and {tolerance:.2e} mm is asked for; the worst place is \
         u {u} v {v}: use a greater tolerance, or split the patch there"
    )]
    NotReached {
        /// Asked, mm.
        tolerance: f64,
        /// Error bound reached, mm.
        reached: f64,
        /// Parameter.
        u: f64,
        /// Parameter.
        v: f64,
    },
    /// The offset is no surface that may be stored.
    #[error("the offset surface: {0}")]
    Surface(#[from] NurbsError),
}

/// A patch and how far it is offset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OffsetSurface<'a> {
    surface: &'a NurbsSurface,
    distance: f64,
}

/// A place of an offset surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OffsetJet {
    /// Position, mm.
    pub p: Point3,
    /// Derivative by u.
    pub du: Vector3,
    /// Derivative by v.
    pub dv: Vector3,
    /// Unit normal of the patch, which is the offset's too (where one of the curvatures of the patch is
    /// beyond the offset, `du × dv` of the offset points the other way).
    pub normal: Vector3,
    /// Principal curvatures of the patch, 1/mm, the lesser first.
    pub base_curvatures: [f64; 2],
    /// Those of the offset, `κ/(1 − κ d)`, toward the same normal and in the same order; infinite where
    /// singular.
    pub curvatures: [f64; 2],
}

impl<'a> OffsetSurface<'a> {
    /// The offset of `surface` by `distance`, mm, along `du × dv`.
    ///
    /// # Errors
    /// A distance that is not finite or beyond [`MAX_COORDINATE`] in size.
    pub fn new(surface: &'a NurbsSurface, distance: f64) -> Result<Self, PatchOffsetError> {
        if distance.is_nan() || distance.abs() > MAX_COORDINATE {
            return Err(PatchOffsetError::Distance(distance));
        }
        Ok(Self { surface, distance })
    }

    /// The patch.
    pub fn surface(&self) -> &'a NurbsSurface {
        self.surface
    }

    /// How far it is offset along `du × dv`, mm.
    pub fn distance(&self) -> f64 {
        self.distance
    }

    /// The point that belongs to the patch's `(u, v)`, clamped to the domain; at poles with the limit of the
    /// normal.
    ///
    /// # Errors
    /// [`PatchOffsetError::NoNormal`] where the patch has no normal close by either.
    pub fn point(&self, u: f64, v: f64) -> Result<Point3, PatchOffsetError> {
        let (u, v) = (self.surface.knots_u().clamp(u), self.surface.knots_v().clamp(v));
        let jet = self.surface.jet(u, v);
        let normal = normal_at(self.surface, &jet, [u, v]);
        normal.map(|n| jet.p + n * self.distance).ok_or(PatchOffsetError::NoNormal { u, v, at: jet.p })
    }

    /// Position, first derivatives and curvatures, exact but for rounding; `None` where the patch is
    /// degenerate (at a pole).
    pub fn jet(&self, u: f64, v: f64) -> Option<OffsetJet> {
        let jet = self.surface.jet(u, v);
        let normal = jet.normal()?;
        let (e, f, g) = jet.first_form();
        let (l, m, n) = jet.second_form(&normal);
        let determinant = jet.du.cross(&jet.dv).norm_squared();
        let combine = |a: f64, b: f64| (jet.du * a + jet.dv * b) / determinant;
        let normal_du = combine(f * m - g * l, f * l - e * m);
        let normal_dv = combine(f * n - g * m, f * m - e * n);
        let k = jet.principal_curvatures()?;
        let base_curvatures = [k.min, k.max];
        Some(OffsetJet {
            p: jet.p + normal * self.distance,
            du: jet.du + normal_du * self.distance,
            dv: jet.dv + normal_dv * self.distance,
            normal,
            base_curvatures,
            curvatures: base_curvatures.map(|k| k / (1.0 - k * self.distance)),
        })
    }
}
