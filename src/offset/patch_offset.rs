//! The true offset of a NURBS patch: every point moved by the same distance along its unit normal.
//!
//! Enters: a patch and a signed distance, mm, along `du × dv` (negative: to the other side). Leaves: the
//! places where the offset is singular ([`OffsetSurface::singular_places`]).
//!
//! The sign of curvature is that of [`geometry::Jet2`]: positive where concave toward `du × dv`. A patch
//! whose outward side is the other one is offset outward by a negative distance.

mod crease;
mod singular;
#[cfg(test)]
mod tests;

pub use singular::SingularPlace;

use geometry::{MAX_COORDINATE, NurbsSurface};

/// Why a patch has no such offset.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PatchOffsetError {
    /// The distance is no usual number.
    #[error("the offset distance is {0} mm; it must be a number of at most 1e6 in size")]
    Distance(f64),
}

/// A patch and how far it is offset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OffsetSurface<'a> {
    surface: &'a NurbsSurface,
    distance: f64,
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
}
