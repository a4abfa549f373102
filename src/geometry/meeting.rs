//! The place that is nearest to some planes.
//!
//! Enters: planes, of which there is at least one. Leaves: the place at which they meet, least squares, by
//! the eigenvalues of their normals' outer products (T. Ju, F. Losasso, S. Schaefer and J. Warren, "Dual
//! contouring of Hermite data", 2002). Directions in which the planes say next to nothing are left at the
//! mean of their points.

use super::{Point3, Vector3};
use nalgebra::Matrix3;

/// A plane.
#[derive(Debug, Clone, Copy)]
pub struct Plane {
    /// A place on it.
    pub point: Point3,
    /// Unit normal.
    pub normal: Vector3,
}

/// Where planes meet.
#[derive(Debug, Clone, Copy)]
pub struct Meeting {
    /// The place.
    pub place: Point3,
    /// In how many directions the planes hold it: 1 on a plane, 2 on a line, 3 in a corner; 0 where no place
    /// may be taken, which then is the nearest one along the normal that the planes have most of.
    pub rank: usize,
    /// Mean of the planes' points.
    pub mean: Point3,
}

/// The place nearest to all planes among those that `may_hold` takes: with fewer directions held where more
/// lead elsewhere. Eigenvalues below the share `flat` of the greatest do not count: normals that spread by
/// less than its square root, rad, are one.
pub fn meeting(planes: &[Plane], flat: f64, may_hold: impl Fn(&Point3) -> bool) -> Meeting {
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
    let rank = order.iter().filter(|&&k| eigen.eigenvalues[k] > flat * greatest).count();
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
        if may_hold(&place) {
            return Meeting { place, rank, mean };
        }
    }
    Meeting { place, rank: 0, mean }
}

/// The place of a cube of half side `half` around `centre` that is nearest to `place`.
pub fn into_cube(place: &Point3, centre: &Point3, half: f64) -> Point3 {
    let limit = Vector3::from_element(half);
    place.sup(&(centre - limit)).inf(&(centre + limit))
}
