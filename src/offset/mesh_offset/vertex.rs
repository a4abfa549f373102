//! The vertex of a piece of the level set in a cell.

use super::level_set::LevelSet;
use geometry::{Plane, Point3, Vector3, into_cube};

/// Planes whose normals spread less than the square root of this, rad, are one plane.
const FLAT: f64 = 1e-6;

/// How much nearer to a vertex its planes are taken each time, and how often. The last ones are taken a
/// hundred-thousandth of a cell away: what they miss of a bent surface is of second order in that.
const NEARER: f64 = 0.1;
const TIMES: i32 = 5;

/// Normals that still spread by this share of what they did from ten times as far away belong to different
/// places of the mesh.
const STAYS: f64 = 0.5;

/// Shallower valleys than this, rad, are not told from smooth places.
const LEAST_VALLEY: f64 = 5e-3;

/// Between steep sides a valley may be deeper than the cell that sees both: the vertex may lie this many
/// times as far from the middle of a cell as its faces, in cells that see nothing of the surface.
const DEEPER: f64 = 4.0;

/// A cell in which a vertex is sought.
pub(super) struct Around<'a> {
    pub centre: Point3,
    /// Half its side, mm.
    pub half: f64,
    /// Whether a place lies in a cell that has vertices of its own.
    pub taken: &'a dyn Fn(&Point3) -> bool,
}

impl Around<'_> {
    fn may_hold(&self, place: &Point3) -> bool {
        let off = (place - self.centre).amax();
        off <= self.half * (1.0 + 1e-9) || (off <= DEEPER * self.half && !(self.taken)(place))
    }
}

/// A vertex: where it is, and the angle between the directions to the mesh's points nearest to it, rad (0 for
/// one).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Vertex {
    pub point: Point3,
    pub angle: f64,
}

/// The vertex for a surface that crosses edges of a cell at `crossings`, of which there are some.
pub(super) fn vertex(level: &LevelSet, crossings: &[Point3], around: &Around) -> Vertex {
    let half = around.half;
    let planes: Vec<Plane> = crossings.iter().map(|x| level.plane(x)).collect();
    let along = mean_normal(&planes);
    let (point, angle) = valley_near(level, &planes, crossings, around);
    let settled =
        level.settled(&point, &along, 4.0 * half).unwrap_or_else(|| nearest_of(level, &point, &planes));
    // A vertex that had to leave the valley's planes is on one side of it.
    let moved = (settled - point).norm();
    Vertex { point: settled, angle: if moved > 1e-3 * half { 0.0 } else { angle } }
}

/// Twelve directions, the corners of an icosahedron.
fn directions() -> impl Iterator<Item = Vector3> {
    let golden = 0.5 * (1.0 + 5f64.sqrt());
    let signs = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]];
    (0..3).flat_map(move |axis| {
        signs.map(|[s, t]| {
            let mut v = Vector3::zeros();
            (v[axis], v[(axis + 1) % 3]) = (s, t * golden);
            v.normalize()
        })
    })
}

impl LevelSet<'_> {
    /// The place of a valley within `reach`, mm, of a place near it, and the angle between the directions to
    /// the mesh's nearest points there, rad; `None` where there is none.
    ///
    /// # Tolerance
    /// The place lies on the level sets of both sides to 1e-9 mm.
    pub fn valley_at(&self, x: &Point3, reach: f64) -> Option<(Point3, f64)> {
        let probes: Vec<Point3> = directions().map(|d| x + d * (0.9 * reach)).collect();
        let planes: Vec<Plane> = probes.iter().map(|q| self.plane(q)).collect();
        let (point, angle) =
            valley_near(self, &planes, &probes, &Around { centre: *x, half: reach, taken: &|_| true });
        let on_it = angle > 0.0 && self.excess(&point).abs() <= ON_VALLEY.max(self.precision(x));
        on_it.then_some((point, angle))
    }
}

/// A place counts as on a valley when it is this near to the level set, mm.
const ON_VALLEY: f64 = 5e-10;

/// The place where two or more points of the mesh are equally near and `distance` away, and the angle between
/// the directions to them, seen from a place near it: `crossings` are places of the level set around.
fn valley_near(level: &LevelSet, planes: &[Plane], crossings: &[Point3], around: &Around) -> (Point3, f64) {
    let mean = Point3::from(planes.iter().map(|p| p.point.coords).sum::<Vector3>() / planes.len() as f64);
    let first = spread(planes);
    if first < LEAST_VALLEY {
        return (mean, 0.0);
    }
    let (mut point, mut before) = (meeting(planes, around), first);
    for k in 1..=TIMES {
        let nearer = NEARER.powi(k);
        let probes: Vec<Plane> =
            crossings.iter().map(|x| level.plane(&(point + (x - point) * nearer))).collect();
        let now = spread(&probes);
        if now < STAYS * before || now < LEAST_VALLEY {
            return (if k == 1 { mean } else { point }, 0.0);
        }
        before = now;
        point = meeting(&probes, around);
    }
    (point, before)
}

/// Greatest angle between two normals, rad.
pub(super) fn spread(planes: &[Plane]) -> f64 {
    let mut greatest: f64 = 0.0;
    for (k, a) in planes.iter().enumerate() {
        for b in &planes[k + 1..] {
            greatest = greatest.max((a.normal - b.normal).norm_squared());
        }
    }
    2.0 * (0.5 * greatest.sqrt()).min(1.0).asin()
}

fn mean_normal(planes: &[Plane]) -> Vector3 {
    let sum: Vector3 = planes.iter().map(|p| p.normal).sum();
    sum.try_normalize(1e-6).unwrap_or_else(|| planes.first().map_or(Vector3::z(), |p| p.normal))
}

/// Where no line search helps: on one of the planes, or the nearest of the level set that straight ways to
/// the mesh find.
fn nearest_of(level: &LevelSet, point: &Point3, planes: &[Plane]) -> Point3 {
    let mut x = *point;
    for _ in 0..64 {
        let plane = level.plane(&x);
        x = plane.point;
        if level.excess(&x).abs() <= level.precision(&x) {
            return x;
        }
    }
    let off = |p: &&Plane| level.excess(&p.point).abs();
    planes.iter().min_by(|a, b| off(a).total_cmp(&off(b))).map_or(x, |p| p.point)
}

/// The place in a cell that is nearest to all planes, of which there is at least one.
fn meeting(planes: &[Plane], around: &Around) -> Point3 {
    // Planes that meet elsewhere say nothing of this cell.
    let found = geometry::meeting(planes, FLAT, |place| around.may_hold(place));
    if found.rank > 0 { found.place } else { into_cube(&found.mean, &around.centre, around.half) }
}
