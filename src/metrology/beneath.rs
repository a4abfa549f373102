//! How deep a part is cut where it is thin.
//!
//! Along the normal of a smooth face a cut is as deep as the place is far from what is left. Where another
//! face is near, the way down along the normal may be far longer: beneath a sharp ridge it may run along the
//! other side, and through a thin part it comes out there. What is left of a ridge is sought along the middle
//! between the normals of both faces, too, and the lesser way counts. Between faces that look apart, and
//! beside the wall below the border of a sheet, a cut is no deeper than half the thickness: what the far side
//! has lost is no loss of this one. mm.

use geometry::{Point3, Vector3};
use part::{Part, SurfacePoint};

use crate::figures::NUMERICAL_FLOOR;

/// Rounds in which the ball shrinks; each leaves a small part of what is too large.
const SHRINKING: usize = 30;

/// Halvings by which the greatest ball around a place is bounded: each makes the bound half as wide.
const HALVINGS: usize = 16;

/// Faces are a sharp ridge, or the sides of something thin, where their unit normals have no greater product:
/// 75 degrees between them. On a blunter ridge the way along a normal is less than four times as long as what
/// is lost.
const SHARP: f64 = 0.26;

/// Two faces whose unit normals sum up to less, one degree between them, have no ridge: they are the sides of a
/// thin part.
const LEAST_RIDGE: f64 = 0.02;

/// A part that is thinner than a cut is deep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Thin {
    /// Radius of the greatest ball that touches the place from inside: half the thickness.
    pub radius: f64,
    /// Outward unit normal of the other face; `None` of a wall below a border, which is no face.
    pub other: Option<Vector3>,
}

impl Thin {
    /// Whether the part only bends there.
    pub fn is_blunt(&self, normal: &Vector3) -> bool {
        self.other.is_some_and(|other| normal.dot(&other) > SHARP)
    }

    /// The sums of the unit normals of both faces of a sharp ridge, along their middle; none between the
    /// sides of a thin part, at a wall, and where the part bends. Of a pointed part with many faces the
    /// nearest may be one beside, or one that only bends away: second comes the face through which a line
    /// along the normal comes out before it is so `deep`, mm.
    pub fn ridges(
        &self,
        part: &Part,
        point: &Point3,
        normal: &Vector3,
        deep: f64,
        bounding: Bounding<'_>,
    ) -> impl Iterator<Item = Vector3> {
        let opposite = comes_out(part, point, normal, -deep).filter(bounding.counts).map(|face| face.normal);
        let sharp = [self.other, opposite].into_iter().flatten().filter(|other| normal.dot(other) <= SHARP);
        sharp.map(move |other| normal + other).filter(leads_out)
    }
}

/// Whether a sum of unit normals of faces tells a way out of the part: where faces look apart it does not.
pub(crate) fn leads_out(sum: &Vector3) -> bool {
    sum.norm() > LEAST_RIDGE
}

/// Outward unit normal of the face through which a line from a place of the part comes out before it has run
/// so far along a unit vector, mm; `None` where it ends in the part. What does not go down has not left.
pub(crate) fn face_before(part: &Part, place: &Point3, along: &Vector3, way: f64) -> Option<Vector3> {
    comes_out(part, place, along, way).map(|face| face.normal)
}

/// As [`face_before`], where on that face.
fn comes_out(part: &Part, place: &Point3, along: &Vector3, way: f64) -> Option<SurfacePoint> {
    let (face, distance) = part.closest_point(&(place + along * way));
    (way < 0.0 && distance > NUMERICAL_FLOOR).then_some(face)
}

/// The sum of the unit normals of a corner: of a ridge with `normals` as that of its faces, one of which is
/// `face`, and of a third face that bends sharply from both and is nearer than they to the middle of what was
/// cut along their middle, `depth` mm from the place.
pub(crate) fn corner_at(
    part: &Part,
    place: &Point3,
    normals: &Vector3,
    face: &Vector3,
    depth: f64,
) -> Option<Vector3> {
    let (third, distance) = part.closest_point(&(place - normals.normalize() * (0.5 * depth)));
    let is_sharp = [*face, normals - face].iter().all(|own| own.dot(&third.normal) <= SHARP);
    Some(normals + third.normal).filter(|sum| distance < 0.0 && is_sharp && leads_out(sum))
}

/// What part of the surface bounds the solid, besides the place itself.
#[derive(Clone, Copy)]
pub(crate) struct Bounding<'a> {
    /// The places of the surface that do.
    pub counts: &'a dyn Fn(&SurfacePoint) -> bool,
    /// The walls below the borders of a sheet do where the product of their unit normal and that of the place
    /// is less than this: below 0 the way down leads out through them. `None` where none do.
    pub walls: Option<f64>,
}

/// Radius of the greatest ball, `most` at most, mm, that touches the part in `point` from inside: half the
/// thickness there, or the radius of a sharp bend (Ma, Bae & Choi, "3D medial axis point approximation using
/// nearest neighbors and the normal field", 2012).
pub(crate) fn ball_beneath(part: &Part, point: &Point3, normal: &Vector3, most: f64) -> f64 {
    let all = Bounding { counts: &|_| true, walls: None };
    thinner(part, point, normal, most, all).map_or(most, |thin| thin.radius)
}

/// As [`ball_beneath`], not through the walls below the borders of a sheet either.
pub(crate) fn ball_within_borders(part: &Part, point: &Point3, normal: &Vector3, most: f64) -> f64 {
    let all = Bounding { counts: &|_| true, walls: Some(SHARP) };
    thinner(part, point, normal, most, all).map_or(most, |thin| thin.radius)
}

/// No ball that touches the part from inside, at a place no farther than `aside` mm from this one, is larger
/// than this, mm, or than `most`: where something stands nearer to the centre of a ball about the line
/// through `point` than its radius less `aside`, it stands within that of every such place.
pub(crate) fn ball_beneath_at_most(
    part: &Part,
    point: &Point3,
    normal: &Vector3,
    aside: f64,
    most: f64,
) -> f64 {
    let is_too_large = |radius: f64| {
        let (centre, within) = (point - normal * radius, radius - aside - NUMERICAL_FLOOR);
        let is_wall = |outward: &Vector3| normal.dot(outward) < SHARP;
        within > 0.0
            && (part.closest_point(&centre).1.abs() < within
                || part.nearest_border_wall(&centre, within, &is_wall).is_some())
    };
    let (mut fits, mut too_large) = (0.0, most);
    if !is_too_large(most) {
        return most;
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (fits + too_large);
        *(if is_too_large(middle) { &mut too_large } else { &mut fits }) = middle;
    }
    too_large
}

/// The thickness beneath a place where a ball with this radius, mm, does not fit.
pub(crate) fn thinner(
    part: &Part,
    point: &Point3,
    normal: &Vector3,
    depth: f64,
    bounding: Bounding<'_>,
) -> Option<Thin> {
    // What lies so near is the place itself.
    let near = NUMERICAL_FLOOR + 2.0 * part.closest_point(point).1.abs();
    let (mut radius, mut found) = (depth, None);
    for _ in 0..SHRINKING {
        let centre = point - normal * radius;
        let inside = radius - near;
        let fits = |other: &Point3| {
            let way = point - other;
            let along = way.dot(normal);
            if along > 0.0 { 0.5 * way.norm_squared() / along } else { f64::INFINITY }
        };
        let (other, distance) = part.closest_point(&centre);
        let of_surface = (distance.abs() < inside && (bounding.counts)(&other))
            .then(|| (fits(&other.point), Some(other.normal)));
        let wall = bounding.walls.and_then(|most| {
            part.nearest_border_wall(&centre, inside, &|outward| normal.dot(outward) < most)
        });
        let of_wall = wall.map(|place| (fits(&place), None));
        let nearest = of_surface.into_iter().chain(of_wall).min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((fits, other)) = nearest.filter(|(fits, _)| *fits < radius) else { break };
        (radius, found) = (fits, Some(Thin { radius: fits, other }));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flat_scene::gouge_of;
    use cutter::Cutter;
    use geometry::{Aabb, TriangleMesh};

    /// A flat end that runs level over the tip of a cone with twelve faces: lines along their normals run out
    /// through the faces opposite, while the nearest face beside bends away by thirty degrees alone.
    #[test]
    fn a_cut_over_the_tip_of_a_cone_is_as_deep_as_the_tip_is_lower() {
        const FACES: usize = 12;
        let corner = |k: usize| {
            let angle = std::f64::consts::TAU * k as f64 / FACES as f64;
            Point3::new(2.0 * angle.cos(), 2.0 * angle.sin(), -2.0 * 3f64.sqrt())
        };
        let points = (0..FACES).map(corner).chain([Point3::origin()]).collect();
        let triangles = (0..FACES).map(|k| [k, (k + 1) % FACES, FACES].map(|k| k as u32)).collect();
        let cone = Part::from_mesh(TriangleMesh::new(points, triangles).unwrap().0);
        for deep in [0.02, 0.1] {
            let pass = [-5.0, 5.0].map(|y| Point3::new(0.3, y, -deep)).to_vec();
            for cell in [0.1, 0.17] {
                let found = gouge_of(&cone, &Cutter::flat(6.0).unwrap(), std::slice::from_ref(&pass), cell);
                let off = (found.max_depth_mm - deep).abs();
                assert!(
                    off <= found.error_bound_mm && found.error_bound_mm < 6e-4,
                    "{deep} {cell}: {found:?}"
                );
            }
        }
    }

    #[test]
    fn the_ball_beneath_is_half_a_slab_or_the_whole_depth() {
        // A slab 2 mm thick; thick ground beside it is asked on its own.
        let slab = |thick: f64| {
            let block = Aabb { min: Point3::origin(), max: Point3::new(20.0, 20.0, thick) };
            let (vertices, triangles) = block.surface();
            Part::from_mesh(TriangleMesh::new(vertices, triangles).unwrap().0)
        };
        let at =
            |thick: f64, x: f64| ball_beneath(&slab(thick), &Point3::new(x, 10.0, thick), &Vector3::z(), 3.0);
        assert!((at(2.0, 10.0) - 1.0).abs() < 1e-4);
        assert!((at(20.0, 10.0) - 3.0).abs() < 1e-12);
        // Beside the wall at x = 0 the ball touches that instead.
        assert!((at(20.0, 0.5) - 0.5).abs() < 1e-4);
    }

    /// A ball that cuts one face of a ridge by a micrometre: the way down along the normal of the other face
    /// runs along what was cut, far longer than it is deep.
    #[test]
    fn a_cut_along_a_sharp_ridge_is_as_deep_as_the_crest_is_lower() {
        let corners = [
            [-4.0, 0.0, -4.0],
            [0.0; 3],
            [4.0, 0.0, -4.0],
            [-4.0, 2.0, -4.0],
            [0.0, 2.0, 0.0],
            [4.0, 2.0, -4.0],
        ];
        let triangles = vec![[0, 1, 3], [1, 4, 3], [1, 2, 4], [2, 5, 4]];
        let roof =
            Part::from_mesh(TriangleMesh::new(corners.map(Point3::from).to_vec(), triangles).unwrap().0);
        let (radius, normal) = (3.0, Vector3::new(-1.0, 0.0, 1.0).normalize());
        for deep in [0.001, 0.02] {
            let tip = |y: f64| Point3::new(0.0, y, -radius) + normal * (radius - deep);
            // What is left of the crest stands so far below it.
            let up = (radius - deep) / 2f64.sqrt();
            let truth = (radius * radius - up * up).sqrt() - up;
            for cell in [0.1, 0.5] {
                let found =
                    gouge_of(&roof, &Cutter::ball(2.0 * radius).unwrap(), &[vec![tip(-1.0), tip(3.0)]], cell);
                let off = (found.max_depth_mm - truth).abs();
                assert!(
                    off <= found.error_bound_mm && found.error_bound_mm < 6e-4,
                    "{deep} {cell}: {truth} {found:?}"
                );
            }
        }
    }
}
