//! The vertex of a cell: the place nearest to all tangent planes of the surface in it (T. Ju, F. Losasso,
//! S. Schaefer and J. Warren, "Dual contouring of Hermite data", 2002).

use crate::geometry::{Point3, Vector3};
use nalgebra::Matrix3;

/// Planes whose normals spread less than the square root of this, rad, are one plane. Greater wears shallow
/// ridges down, less lets rounding move vertices along the surface.
const FLAT: f64 = 1e-5;

/// A tangent plane of the surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plane {
    /// A place on it.
    pub(super) point: Point3,
    /// Unit normal.
    pub(super) normal: Vector3,
}

/// The place within the cube of half side `half` around `centre` that is nearest to all planes, of which
/// there is at least one, and whether they meet in a ridge or a corner there.
pub(super) fn vertex(planes: &[Plane], centre: &Point3, half: f64) -> (Point3, bool) {
    let count = planes.len() as f64;
    let mean = Point3::from(planes.iter().map(|p| p.point.coords).sum::<Vector3>() / count);
    let (mut matrix, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for Plane { point, normal } in planes {
        matrix += normal * normal.transpose();
        right += normal * normal.dot(&(point - mean));
    }
    let eigen = matrix.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let greatest = eigen.eigenvalues[order[0]];
    let rank = order.iter().filter(|&&k| eigen.eigenvalues[k] > FLAT * greatest).count();
    let mut place = mean;
    for rank in (1..=rank).rev() {
        let step: Vector3 = order[..rank]
            .iter()
            .map(|&k| {
                let axis = eigen.eigenvectors.column(k).into_owned();
                axis * (axis.dot(&right) / eigen.eigenvalues[k])
            })
            .sum();
        place = mean + step;
        // Planes that meet elsewhere say nothing of this cell.
        if (place - centre).amax() <= half {
            return (place, rank > 1);
        }
    }
    let limit = Vector3::from_element(half);
    (place.sup(&(centre - limit)).inf(&(centre + limit)), false)
}

#[cfg(test)]
mod tests {
    use super::*;

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
