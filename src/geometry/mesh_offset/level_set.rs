//! The places at one distance from a mesh, as seen from any place near them.

use crate::geometry::{Bvh, MeshFoot, Point3, TriangleMesh, Vector3};

/// Places are on the level set within this share of their coordinates, or of a mm.
const PRECISION: f64 = 1e-14;

/// Steps of the search along a line at most; each halves its bracket at least every other time.
const LINE_STEPS: usize = 90;

/// All places whose distance from a mesh is `distance`.
#[derive(Debug, Clone)]
pub struct LevelSet<'a> {
    mesh: &'a TriangleMesh,
    bvh: &'a Bvh,
    distance: f64,
    on_border: Vec<bool>,
}

/// The nearest point of the mesh to a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LevelSetFoot {
    /// Nearest point, mm.
    pub point: Point3,
    /// Unit vector from there to the place.
    pub direction: Vector3,
    /// Unit normal of the mesh there.
    pub normal: Vector3,
    /// Distance, mm; never negative.
    pub distance: f64,
    /// Triangle that it lies on.
    pub triangle: u32,
    /// Whether it lies on the mesh's border.
    pub on_border: bool,
}

/// A tangent plane of the level set.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plane {
    /// A place on it.
    pub point: Point3,
    /// Unit normal, toward greater distance.
    pub normal: Vector3,
}

impl<'a> LevelSet<'a> {
    /// The level set of a mesh with its search tree; `distance` > 0, mm.
    pub fn new(mesh: &'a TriangleMesh, bvh: &'a Bvh, distance: f64) -> Self {
        let mut on_border = vec![false; mesh.vertices().len()];
        for (t, corners) in mesh.triangles().iter().enumerate() {
            for k in (0..3).filter(|&k| mesh.neighbour(t, k).is_none()) {
                on_border[corners[k] as usize] = true;
                on_border[corners[(k + 1) % 3] as usize] = true;
            }
        }
        Self { mesh, bvh, distance, on_border }
    }

    /// The mesh.
    pub fn mesh(&self) -> &'a TriangleMesh {
        self.mesh
    }

    /// The distance, mm.
    pub fn distance(&self) -> f64 {
        self.distance
    }

    /// The nearest point of the mesh.
    pub fn foot(&self, x: &Point3) -> LevelSetFoot {
        let near = self.bvh.closest_point(self.mesh, x);
        let distance = near.signed_distance.abs();
        let direction = (x - near.point).try_normalize(f64::MIN_POSITIVE).unwrap_or(near.normal);
        let on_border = self.is_on_border(&near);
        LevelSetFoot {
            point: near.point,
            direction,
            normal: near.normal,
            distance,
            triangle: near.triangle,
            on_border,
        }
    }

    fn is_on_border(&self, near: &MeshFoot) -> bool {
        let t = near.triangle as usize;
        let corners = self.mesh.triangles()[t];
        if let Some(k) = (0..3).find(|&k| near.barycentric[k] == 1.0) {
            return self.on_border[corners[k] as usize];
        }
        (0..3).any(|k| near.barycentric[(k + 2) % 3] == 0.0 && self.mesh.neighbour(t, k).is_none())
    }

    /// How much farther than `distance` a place is from the mesh, mm.
    pub fn excess(&self, x: &Point3) -> f64 {
        self.bvh.closest_point(self.mesh, x).signed_distance.abs() - self.distance
    }

    /// How far a ball at this place, which touches the mesh, has rolled over its border, mm; 0 where it touches the outward
    /// side elsewhere, `None` where it touches the other side.
    pub fn rolled(&self, foot: &LevelSetFoot) -> Option<f64> {
        if foot.on_border {
            return Some((foot.direction - foot.normal).norm() * self.distance);
        }
        (foot.direction.dot(&foot.normal) >= 0.0).then_some(0.0)
    }

    /// What counts as on the level set near a place, mm.
    pub(super) fn precision(&self, x: &Point3) -> f64 {
        PRECISION * (1.0 + x.coords.amax() + self.distance) * 4.0
    }

    /// The tangent plane of the level set below or above a place.
    pub(super) fn plane(&self, x: &Point3) -> Plane {
        let foot = self.foot(x);
        Plane { point: foot.point + foot.direction * self.distance, normal: foot.direction }
    }

    /// The place of the level set straight toward or away from the nearest point of the mesh, or, where another one is as
    /// near, along the line from `x` in the unit direction `along`, which leads away from the mesh. `None` where that line
    /// meets no such place within `reach`, mm.
    pub fn settled(&self, x: &Point3, along: &Vector3, reach: f64) -> Option<Point3> {
        let plane = self.plane(x);
        if (plane.point - x).norm() <= reach && self.excess(&plane.point).abs() <= self.precision(x) {
            return Some(plane.point);
        }
        self.on_line(x, along, reach)
    }

    /// The place of the level set on the line from `x` along the unit vector `along` that is found first on the way out (where
    /// `x` is too near to the mesh) or in, within `reach`, mm.
    pub fn on_line(&self, x: &Point3, along: &Vector3, reach: f64) -> Option<Point3> {
        let near = self.precision(x);
        let mut from = (0.0f64, self.excess(x));
        if from.1.abs() <= near {
            return Some(*x);
        }
        let sense = -from.1.signum();
        // Along a gradient the distance is met at once; across it there is more to go.
        let mut step = from.1.abs().max(1e-3 * reach);
        let mut to = from;
        while to.1 * from.1 > 0.0 {
            if to.0.abs() >= reach {
                return None;
            }
            if to.0 != 0.0 {
                from = to;
            }
            let s: f64 = (to.0.abs() + step).min(reach) * sense;
            to = (s, self.excess(&(x + along * s)));
            step *= 2.0;
        }
        // False position that halves the weight of an end that stays (M. Dowell and P. Jarratt, 1971).
        let (mut a, mut b) = (from, to);
        for k in 0..LINE_STEPS {
            if b.1.abs() <= near {
                break;
            }
            let share = if k % 8 == 7 { 0.5 } else { a.1 / (a.1 - b.1) };
            let s = a.0 + (b.0 - a.0) * share;
            let c = (s, self.excess(&(x + along * s)));
            if c.1 * b.1 <= 0.0 {
                a = b;
            } else {
                a.1 *= 0.5;
            }
            b = c;
            if (b.0 - a.0).abs() <= near * 0.25 {
                break;
            }
        }
        Some(x + along * b.0)
    }
}
