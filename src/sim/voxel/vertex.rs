//! The vertex of a cell: the place nearest to all tangent planes of the surface in it.

use geometry::{Plane, Point3, into_cube, meeting};

/// Planes whose normals spread less than the square root of this, rad, are one plane. Greater wears shallow
/// ridges down, less lets rounding move vertices along the surface.
const FLAT: f64 = 1e-5;

/// The place within the cube of half side `half` around `centre` that is nearest to all planes, of which
/// there is at least one, and whether they meet in a ridge or a corner there.
pub(super) fn vertex(planes: &[Plane], centre: &Point3, half: f64) -> (Point3, bool) {
    // Planes that meet elsewhere say nothing of this cell.
    let found = meeting(planes, FLAT, |place| (place - centre).amax() <= half);
    if found.rank > 0 {
        return (found.place, found.rank > 1);
    }
    (into_cube(&found.place, centre, half), false)
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Vector3;

    fn plane(point: [f64; 3], normal: [f64; 3]) -> Plane {
        Plane { point: point.into(), normal: Vector3::from(normal).normalize() }
    }

    #[test]
    fn planes_meet_where_they_should() {
        let centre = Point3::origin();
        let flat = [plane([0.3, 0.1, 0.2], [0.0, 0.0, 1.0]), plane([-0.2, 0.0, 0.2], [0.0, 0.0, 1.0])];
        let (place, ridge) = vertex(&flat, &centre, 0.5);
        assert!((place - Point3::new(0.05, 0.05, 0.2)).norm() < 1e-12 && !ridge);
        // A shallow ridge along y, of slopes ±0.05 from (0.1, ·, 0.3).
        let slope = |x: f64, s: f64| plane([x, 0.2, 0.3 + s * (x - 0.1)], [-s, 0.0, 1.0]);
        let (place, ridge) = vertex(&[slope(-0.5, 0.05), slope(0.5, -0.05)], &centre, 0.5);
        assert!((place - Point3::new(0.1, 0.2, 0.3)).norm() < 1e-9 && ridge, "{place}");
        // Planes that meet outside.
        let (place, _) = vertex(&[slope(0.4, 0.05), slope(0.5, 0.06)], &centre, 0.5);
        assert!(place.coords.amax() <= 0.5);
        let corner = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|n| plane([0.1, 0.2, 0.3], n));
        let (place, ridge) = vertex(&corner, &centre, 0.5);
        assert!((place - Point3::new(0.1, 0.2, 0.3)).norm() < 1e-12 && ridge);
    }
}
