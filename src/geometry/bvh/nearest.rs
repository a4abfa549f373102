//! The nearest point of a mesh, and on which side of it the query lies.
//!
//! The sign is that of the angle-weighted pseudonormal at the foot (J. A. Bærentzen and H. Aanæs,
//! "Signed distance computation using the angle weighted pseudonormal", 2005), which is right for
//! every closed mesh. On an open mesh a query beyond the border gets the side of the border's face.

use super::{Bvh, Feature, MeshFoot};
use crate::angle_between;
use crate::{Point3, TriangleMesh, Vector3};

/// The nearest point of one triangle.
pub(super) struct Foot {
    pub(super) point: Point3,
    pub(super) barycentric: [f64; 3],
    pub(super) feature: Feature,
    pub(super) distance_squared: f64,
}

impl Bvh {
    /// The nearest point of the mesh, exact in f64; ties go to the triangle with the least index.
    pub fn closest_point(&self, mesh: &TriangleMesh, q: &Point3) -> MeshFoot {
        let first = self.triangle_in(0);
        let start = (closest_on_triangle(&mesh.corners(first), q), first);
        self.foot(mesh, q, self.nearest(mesh, q, start, |_| true))
    }

    /// The same of the triangles that `counts` says, nearer than a distance, mm; `None` without such.
    pub fn closest_point_of(
        &self,
        mesh: &TriangleMesh,
        q: &Point3,
        within: f64,
        counts: impl Fn(usize) -> bool,
    ) -> Option<MeshFoot> {
        let start = Foot {
            point: *q,
            barycentric: [0.0; 3],
            feature: Feature::Face,
            distance_squared: within * within,
        };
        let found = self.nearest(mesh, q, (start, usize::MAX), counts);
        (found.1 != usize::MAX).then(|| self.foot(mesh, q, found))
    }

    /// The nearest of the triangles that count, and its index, from what is known on.
    fn nearest(
        &self,
        mesh: &TriangleMesh,
        q: &Point3,
        (mut best, mut best_triangle): (Foot, usize),
        counts: impl Fn(usize) -> bool,
    ) -> (Foot, usize) {
        self.tree.search(
            -best.distance_squared,
            |_, node, _| -node.distance_squared(q),
            |slot, _| {
                let t = self.triangle_in(slot);
                if counts(t) {
                    let foot = closest_on_triangle(&mesh.corners(t), q);
                    let nearer = foot.distance_squared < best.distance_squared;
                    if nearer || (foot.distance_squared == best.distance_squared && t < best_triangle) {
                        (best, best_triangle) = (foot, t);
                    }
                }
                -best.distance_squared
            },
        );
        (best, best_triangle)
    }

    fn foot(&self, mesh: &TriangleMesh, q: &Point3, (foot, triangle): (Foot, usize)) -> MeshFoot {
        let normal = self.normal_at(mesh, triangle, foot.feature);
        let sign = if (q - foot.point).dot(&normal) < 0.0 { -1.0 } else { 1.0 };
        MeshFoot {
            point: foot.point,
            triangle: triangle as u32,
            barycentric: foot.barycentric,
            normal,
            signed_distance: sign * foot.distance_squared.sqrt(),
        }
    }
}

/// The nearest point of one triangle. Where the foot on its plane lies outside, the nearest point
/// lies on a side that separates the two; all signs come from products with the plane's normal,
/// which keeps slivers accurate.
pub(super) fn closest_on_triangle(corners: &[Point3; 3], q: &Point3) -> Foot {
    let [a, b, c] = corners;
    let normal = (b - a).cross(&(c - a));
    let area = normal.norm_squared();
    // Twice the signed area, times |normal|, of the triangle from side k to the foot.
    let share = [(a, b), (b, c), (c, a)].map(|(p, r)| normal.dot(&(r - p).cross(&(q - p))));
    if share.iter().all(|&s| s >= 0.0) {
        let height = normal.dot(&(q - a));
        let sum: f64 = share.iter().sum();
        return Foot {
            point: q - normal * (height / area),
            barycentric: [share[1] / sum, share[2] / sum, share[0] / sum],
            feature: Feature::Face,
            distance_squared: height * height / area,
        };
    }
    let outside = (0..3).filter(|&k| share[k] < 0.0);
    let feet = outside.map(|k| closest_on_side(corners, k, q));
    // A NaN query has no side outside; its first side is as good as any.
    feet.min_by(|a, b| a.distance_squared.total_cmp(&b.distance_squared))
        .unwrap_or_else(|| closest_on_side(corners, 0, q))
}

fn closest_on_side(corners: &[Point3; 3], k: usize, q: &Point3) -> Foot {
    let end = (k + 1) % 3;
    let (from, to) = (&corners[k], &corners[end]);
    let along = to - from;
    let s = (q - from).dot(&along) / along.norm_squared();
    let mut barycentric = [0.0; 3];
    let (point, feature) = if s <= 0.0 {
        barycentric[k] = 1.0;
        (*from, Feature::Corner(k))
    } else if s >= 1.0 {
        barycentric[end] = 1.0;
        (*to, Feature::Corner(end))
    } else {
        (barycentric[k], barycentric[end]) = (1.0 - s, s);
        (from + along * s, Feature::Side(k))
    };
    Foot { point, barycentric, feature, distance_squared: (q - point).norm_squared() }
}

/// The angle-weighted sum of the unit normals around each vertex.
pub(super) fn vertex_normals(mesh: &TriangleMesh) -> Vec<Vector3> {
    let mut normals = vec![Vector3::zeros(); mesh.vertices().len()];
    for (t, face) in mesh.triangles().iter().enumerate() {
        let corners = mesh.corners(t);
        let normal = mesh.normal(t);
        for k in 0..3 {
            let to = |i: usize| corners[(k + i) % 3] - corners[k];
            let (u, v) = (to(1), to(2));
            let angle = angle_between(&u, &v);
            normals[face[k] as usize] += normal * angle;
        }
    }
    normals
}

pub(super) fn normal_at(mesh: &TriangleMesh, at_vertex: &[Vector3], t: usize, feature: Feature) -> Vector3 {
    let face = mesh.normal(t);
    let sum = match feature {
        Feature::Face => return face,
        Feature::Side(k) => match mesh.neighbour(t, k) {
            Some(other) => face + mesh.normal(other),
            None => return face,
        },
        Feature::Corner(k) => at_vertex[mesh.triangles()[t][k] as usize],
    };
    // A sheet folded back onto itself has no mean normal.
    sum.try_normalize(f64::EPSILON).unwrap_or(face)
}
