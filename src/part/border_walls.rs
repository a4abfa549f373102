//! The walls below the borders of a part that is an open sheet.
//!
//! Where all faces look up, what is below them is solid, and ends at each border as at a vertical wall: down
//! to the surface beyond where there is one, as between two plates. mm.

use super::{LEAST_UPRIGHT, Part};
use geometry::{Bvh, Point3, TriangleMesh, Vector3};
use work::parallel;

/// The walls below borders, and the tree to search them.
#[derive(Debug)]
pub(super) struct BorderWalls {
    mesh: TriangleMesh,
    bvh: Bvh,
    /// Unit normals out of the solid, of each triangle.
    outward: Vec<Vector3>,
}

/// Sides of a border are told apart so far from it, mm, and by twice as much as patches that meet may lie
/// apart.
const ASIDE: f64 = 1e-6;

/// How far from a border is looked for what is beyond, mm.
fn aside(part: &Part) -> f64 {
    ASIDE + 2.0 * part.across()
}

impl BorderWalls {
    /// `None` where faces do not look up, or nothing ends.
    pub fn of(part: &Part) -> Option<Self> {
        let mesh = part.mesh();
        let count = mesh.triangles().len();
        if (0..count).any(|t| mesh.normal(t).z < LEAST_UPRIGHT) {
            return None;
        }
        let walls =
            parallel::map(count, |t| (0..3).filter_map(|side| wall(part, t, side)).collect::<Vec<_>>());
        let (mut corners, mut triangles) = (Vec::new(), Vec::new());
        for wall in walls.into_iter().flatten() {
            let first = corners.len() as u32;
            corners.extend(wall);
            triangles.extend([[0, 1, 2], [0, 2, 3]].map(|t: [u32; 3]| t.map(|k| first + k)));
        }
        let (mesh, _) = TriangleMesh::opened(corners, triangles).ok()?;
        let bvh = Bvh::new(&mesh);
        let outward = parallel::map(mesh.triangles().len(), |t| {
            let (normal, [a, b, c]) = (mesh.normal(t), mesh.corners(t));
            let middle = (a.coords + b.coords + c.coords) / 3.0 + normal * aside(part);
            let beside = part.highest_at(middle.x, middle.y);
            let is_inside =
                beside.is_some_and(|highest| highest.point.z > middle.z - aside(part) / LEAST_UPRIGHT);
            if is_inside { -normal } else { normal }
        });
        Some(Self { mesh, bvh, outward })
    }
}

/// The wall below a side of a triangle, if the part ends there.
fn wall(part: &Part, t: usize, side: usize) -> Option<[Point3; 4]> {
    let mesh = part.mesh();
    if mesh.neighbour(t, side).is_some() {
        return None;
    }
    let corners = mesh.corners(t);
    let [a, b] = [corners[side], corners[(side + 1) % 3]];
    let outward = (b - a).cross(&mesh.normal(t)).xy().try_normalize(0.0)?;
    // Gaps between patches are narrower, and steps lower.
    let aside = aside(part);
    let middle = a + (b - a) * 0.5;
    let beyond = part.highest_at(middle.x + aside * outward.x, middle.y + aside * outward.y);
    let lowest = match beyond {
        Some(beyond) if beyond.point.z > middle.z - aside / LEAST_UPRIGHT => return None,
        Some(beyond) => beyond.point.z,
        None => {
            let bounds = part.bounds();
            bounds.min.z - (bounds.max - bounds.min).norm()
        }
    };
    let below = |p: Point3| Point3::new(p.x, p.y, lowest.min(p.z));
    Some([a, b, below(b), below(a)])
}

impl Part {
    /// The nearest place of the walls that end the solid below a sheet whose faces all look up, nearer than a
    /// distance, mm, of those whose unit normal out of it `counts`; `None` without such, and for any other
    /// part.
    pub fn nearest_border_wall(
        &self,
        q: &Point3,
        within: f64,
        counts: &dyn Fn(&Vector3) -> bool,
    ) -> Option<Point3> {
        let walls = self.border_walls.get_or_init(|| BorderWalls::of(self)).as_ref()?;
        let counted = |t: usize| counts(&walls.outward[t]);
        Some(walls.bvh.closest_point_of(&walls.mesh, q, within, counted)?.point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two level plates beside each other, one 2 mm higher: below its border there the wall goes down to the
    /// lower plate, which has none on that side; all other borders have walls down to far below. A part with
    /// a face that looks down has none.
    #[test]
    fn walls_end_what_is_solid_below_a_sheet() {
        let plate = |x: f64, z: f64| {
            [[x, 0.0], [x + 4.0, 0.0], [x, 3.0], [x + 4.0, 3.0]].map(|[x, y]| Point3::new(x, y, z))
        };
        let corners: Vec<Point3> = plate(0.0, 0.0).into_iter().chain(plate(4.0, 2.0)).collect();
        let triangles = vec![[0, 1, 2], [1, 3, 2], [4, 5, 6], [5, 7, 6]];
        let part = Part::from_mesh(TriangleMesh::new(corners, triangles).unwrap().0);
        let nearest = |x: f64, y: f64, z: f64| {
            part.nearest_border_wall(&Point3::new(x, y, z), 1.0, &|out| out.x.abs() > 0.5)
        };
        let near = |found: Option<Point3>, place: [f64; 3]| {
            found.is_some_and(|found| (found - Point3::from(place)).norm() < 1e-9)
        };
        assert!(near(nearest(4.3, 1.0, 1.0), [4.0, 1.0, 1.0]));
        assert!(near(nearest(3.7, 1.0, -0.5), [4.0, 1.0, 0.0]), "{:?}", nearest(3.7, 1.0, -0.5));
        assert!(nearest(4.0, 1.0, -1.5).is_none());
        assert!(near(nearest(0.3, 1.0, -5.0), [0.0, 1.0, -5.0]));
        let leftward = part.nearest_border_wall(&Point3::new(3.7, 1.0, 0.5), 1.0, &|out| out.x < -0.5);
        assert!(near(leftward, [4.0, 1.0, 0.5]));
        let folded = vec![[0, 1, 2], [1, 3, 2], [4, 6, 5], [5, 6, 7]];
        let corners: Vec<Point3> = plate(0.0, 0.0).into_iter().chain(plate(0.0, -2.0)).collect();
        let (mesh, _, _) = TriangleMesh::with_sources(corners, folded, geometry::Outside::Given).unwrap();
        assert!(Part::from_mesh(mesh).nearest_border_wall(&Point3::origin(), 9.0, &|_| true).is_none());
    }
}
