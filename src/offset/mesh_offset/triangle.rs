//! How far a triangle is from a sliver.

use geometry::Point3;

/// Twice the area over the square of the longest side: 0 for none, 0.87 for an equilateral triangle.
pub(super) fn shape([a, b, c]: [Point3; 3]) -> f64 {
    let longest = (b - a).norm_squared().max((c - b).norm_squared()).max((a - c).norm_squared());
    if longest > 0.0 { (b - a).cross(&(c - a)).norm() / longest } else { 0.0 }
}
