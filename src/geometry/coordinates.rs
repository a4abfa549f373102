//! Points, vectors and motions in f64, mm, and how far from the origin they may lie.

/// A point, mm.
pub type Point3 = nalgebra::Point3<f64>;
/// A point of the plane, mm.
pub type Point2 = nalgebra::Point2<f64>;
/// A vector, mm.
pub type Vector3 = nalgebra::Vector3<f64>;
/// A motion of space.
pub type Isometry3 = nalgebra::Isometry3<f64>;
/// A vector of the plane, mm.
pub type Vector2 = nalgebra::Vector2<f64>;

/// Largest coordinate that any part, path or stock may have, mm (one kilometre). Beyond it f64
/// still resolves 1e-10 mm, but f32 boxes and heights no longer resolve a micrometre.
pub const MAX_COORDINATE: f64 = 1.0e6;

/// The angle between two vectors, rad: accurate also near 0 and π, where the arc cosine is not.
#[inline]
pub fn angle_between(a: &Vector3, b: &Vector3) -> f64 {
    a.cross(b).norm().atan2(a.dot(b))
}
