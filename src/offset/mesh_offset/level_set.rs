//! The places at one distance from a mesh, as seen from any place near them.

use std::collections::HashMap;

use super::triangle::shape;
use geometry::{Bvh, MeshFoot, Plane, Point3, TriangleMesh, Vector3};

/// Places are on the level set within this share of their coordinates, or of a mm.
const PRECISION: f64 = 1e-14;

/// Steps of the search along a line at most; each halves its bracket at least every other time.
const LINE_STEPS: usize = 90;

/// The sheet ends where its triangles turn back with a cosine between their normals below this: slivers that
/// are folded over along a border hide it. Greater would take sharp convex edges for borders, less leaves
/// slivers that are folded a little less.
const FOLD: f64 = -0.85;

/// A triangle whose height is less than this share of its longest side is a sliver; which way it is folded is
/// chance.
const SLIVER: f64 = 0.05;

/// All places whose distance from a mesh is `distance`.
#[derive(Debug, Clone)]
pub struct LevelSet<'a> {
    mesh: &'a TriangleMesh,
    bvh: &'a Bvh,
    distance: f64,
    /// Of vertices on borders the sum of the area vectors around, in which slivers do not count.
    at_border: HashMap<u32, Vector3>,
}

/// Whether the sheet ends at side `k` of triangle `t`: at a border, and where a wedge or a sliver turns back.
fn ends_at(mesh: &TriangleMesh, t: usize, k: usize) -> bool {
    let Some(other) = mesh.neighbour(t, k) else { return true };
    if mesh.normal(t).dot(&mesh.normal(other)) >= FOLD {
        return false;
    }
    let ends = [k, (k + 1) % 3].map(|k| mesh.triangles()[t][k]);
    let beyond = (0..3).find(|&c| !ends.contains(&mesh.triangles()[other][c])).unwrap_or(0);
    let [here, there] = [t, other].map(|t| mesh.corners(t));
    let is_convex = mesh.normal(t).dot(&(there[beyond] - here[k])) <= 0.0;
    is_convex || shape(here).min(shape(there)) < SLIVER
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

impl<'a> LevelSet<'a> {
    /// The level set of a mesh with its search tree; `distance` > 0, mm.
    pub fn new(mesh: &'a TriangleMesh, bvh: &'a Bvh, distance: f64) -> Self {
        let mut at_border = HashMap::new();
        for (t, corners) in mesh.triangles().iter().enumerate() {
            for k in (0..3).filter(|&k| ends_at(mesh, t, k)) {
                at_border.insert(corners[k], Vector3::zeros());
                at_border.insert(corners[(k + 1) % 3], Vector3::zeros());
            }
        }
        for (t, corners) in mesh.triangles().iter().enumerate() {
            for corner in corners {
                if let Some(sum) = at_border.get_mut(corner) {
                    let [a, b, c] = mesh.corners(t);
                    *sum += (b - a).cross(&(c - a));
                }
            }
        }
        Self { mesh, bvh, distance, at_border }
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
        let border = self.border_normal(&near);
        let on_border = border.is_some();
        LevelSetFoot {
            point: near.point,
            direction,
            normal: border.unwrap_or(near.normal),
            distance,
            triangle: near.triangle,
            on_border,
        }
    }

    /// The normal of the sheet that ends at a foot; `None` where none does.
    fn border_normal(&self, near: &MeshFoot) -> Option<Vector3> {
        let t = near.triangle as usize;
        let corners = self.mesh.triangles()[t];
        if let Some(k) = (0..3).find(|&k| near.barycentric[k] == 1.0) {
            let sum = self.at_border.get(&corners[k])?;
            return Some(sum.try_normalize(0.0).unwrap_or(near.normal));
        }
        let side = (0..3).find(|&k| near.barycentric[(k + 2) % 3] == 0.0)?;
        // Most sides are told by their ends.
        if !self.at_border.contains_key(&corners[side]) || !ends_at(self.mesh, t, side) {
            return None;
        }
        let area = |t: usize| {
            let [a, b, c] = self.mesh.corners(t);
            (b - a).cross(&(c - a)).norm()
        };
        let other = self.mesh.neighbour(t, side).filter(|&other| area(other) > area(t));
        Some(self.mesh.normal(other.unwrap_or(t)))
    }

    /// How much farther than `distance` a place is from the mesh, mm.
    pub fn excess(&self, x: &Point3) -> f64 {
        self.bvh.closest_point(self.mesh, x).signed_distance.abs() - self.distance
    }

    /// How far a ball at this place, which touches the mesh, has rolled over its border, mm; 0 where it
    /// touches the outward side elsewhere, `None` where it touches the other side.
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

    /// The place of the level set straight toward or away from the nearest point of the mesh, or, where
    /// another one is as near, along the line from `x` in the unit direction `along`, which leads away from
    /// the mesh. `None` where that line meets no such place within `reach`, mm.
    pub fn settled(&self, x: &Point3, along: &Vector3, reach: f64) -> Option<Point3> {
        let plane = self.plane(x);
        if (plane.point - x).norm() <= reach && self.excess(&plane.point).abs() <= self.precision(x) {
            return Some(plane.point);
        }
        self.on_line(x, along, reach)
    }

    /// The place of the level set on the line from `x` along the unit vector `along` that is found first on
    /// the way out (where `x` is too near to the mesh) or in, within `reach`, mm.
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
