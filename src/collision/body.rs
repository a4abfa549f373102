//! Boxes, cylinders and whole tools that are fixed to a link of a machine, in motion against meshes.
//!
//! Enters: a body in the frame of its link, mm, and where that link stands, seen from the mesh, at both ends
//! of each move. Leaves: the least distance on all moves. On a move the middle of the body runs straight, and
//! it turns evenly.

use super::piece::{Convex, NearPlace, Sample, ToolPiece};
use super::sweep::Moving;
use super::{LeastClearance, Obstacle};
use cutter::Solid;
use geometry::{Aabb, Isometry3, Point3, TriangleMesh, Vector3};
use motion::ClPoint;
use nalgebra::{Rotation3, Translation3, UnitQuaternion, UnitVector3};
use work::monitor::{Cancelled, Monitor};

/// What a body looks like in its own frame.
#[derive(Debug, Clone, PartialEq)]
enum Form {
    /// About z, from the origin up.
    Round(Solid),
    /// About the origin, by half its sides.
    Block([f64; 3]),
}

/// A rigid body that is fixed to a link.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    form: Form,
    /// Of its own frame in that of the link.
    place: Isometry3,
    /// Its middle in its own frame.
    middle: Vector3,
}

/// Where a link stands, seen from a mesh, at the begin and at the end of a move.
pub type Ends = [Isometry3; 2];

/// Corners of a cylinder as a mesh.
const CORNERS: u32 = 720;

impl Body {
    /// A box between two opposite corners; `None` where it has no volume.
    pub fn block(from: Point3, to: Point3) -> Option<Self> {
        let half = (to - from).abs() * 0.5;
        let place = Isometry3::from(nalgebra::center(&from, &to).coords);
        (half.min() > 0.0).then(|| Self { form: Form::Block(half.into()), place, middle: Vector3::zeros() })
    }

    /// A cylinder about the line between two places; `None` where it has no volume.
    pub fn cylinder(from: Point3, to: Point3, diameter: f64) -> Option<Self> {
        let along = to - from;
        let length = along.norm();
        if !(length > 0.0 && diameter > 0.0) {
            return None;
        }
        // Of the turns that bring z to a direction any one serves; to −z half a turn about x.
        let turn = UnitQuaternion::rotation_between(&Vector3::z(), &along)
            .unwrap_or_else(|| UnitQuaternion::from_scaled_axis(Vector3::x() * std::f64::consts::PI));
        let place = Isometry3::from_parts(Translation3::from(from.coords), turn);
        let form = Form::Round(Solid::cylinder(0.5 * diameter, length));
        Some(Self { form, place, middle: Vector3::z() * (0.5 * length) })
    }

    /// A tool, with its tip at `tip` and its axis along z.
    pub fn tool(solid: Solid, tip: Point3) -> Self {
        let place = Isometry3::from(tip.coords);
        Self { form: Form::Round(solid), place, middle: Vector3::zeros() }
    }

    /// The place that it turns about, in the frame of its link.
    pub fn middle(&self) -> Point3 {
        self.place * Point3::from(self.middle)
    }

    /// No place of it is farther from its middle, mm.
    pub fn reach(&self) -> f64 {
        match &self.form {
            Form::Block(half) => Vector3::from(*half).norm(),
            Form::Round(solid) => {
                let heights = solid.heights().map(|z| (z - self.middle.z).abs());
                solid.radius().hypot(heights[0].max(heights[1]))
            }
        }
    }

    /// Its surface in the frame of its link, and how far that stands off it outward at most, mm; `None` of a
    /// tool.
    pub fn mesh(&self) -> Option<(TriangleMesh, f64)> {
        let (vertices, triangles, off) = match &self.form {
            Form::Block(half) => {
                let (vertices, triangles) =
                    Aabb { min: half.map(|x| -x).into(), max: (*half).into() }.surface();
                (vertices, triangles, 0.0)
            }
            Form::Round(solid) if self.middle.z > 0.0 => {
                // The sides touch the cylinder in their middles.
                let step = std::f64::consts::TAU / f64::from(CORNERS);
                let radius = solid.radius() / (0.5 * step).cos();
                let rim = |z: f64| {
                    (0..CORNERS).map(move |k| {
                        let (sin, cos) = (step * f64::from(k)).sin_cos();
                        Point3::new(radius * cos, radius * sin, z)
                    })
                };
                let top = 2.0 * self.middle.z;
                let centres = [0.0, top].map(|z| Point3::new(0.0, 0.0, z));
                let vertices: Vec<Point3> = rim(0.0).chain(rim(top)).chain(centres).collect();
                let (low, high) = (2 * CORNERS, 2 * CORNERS + 1);
                let triangles = (0..CORNERS).flat_map(|k| {
                    let (next, up) = ((k + 1) % CORNERS, CORNERS);
                    [[k, next, next + up], [k, next + up, k + up], [next, k, low], [k + up, next + up, high]]
                });
                (vertices, triangles.collect(), radius - solid.radius())
            }
            Form::Round(_) => return None,
        };
        let placed = vertices.iter().map(|vertex| self.place * vertex).collect();
        TriangleMesh::new(placed, triangles).ok().map(|(mesh, _)| (mesh, off))
    }
}

/// A piece of a body that stands somewhere.
#[derive(Clone, Copy)]
enum BodyPiece<'a> {
    Round { piece: ToolPiece<'a>, middle: Point3 },
    Block { middle: Point3, turn: Rotation3<f64>, half: Vector3 },
}

impl Convex for BodyPiece<'_> {
    fn origin(&self) -> Point3 {
        match self {
            Self::Round { middle, .. } | Self::Block { middle, .. } => *middle,
        }
    }

    fn sample(&self, q: &Point3) -> Sample {
        let (middle, turn, half) = match self {
            Self::Round { piece, .. } => return piece.sample(q),
            Self::Block { middle, turn, half } => (middle, turn, half),
        };
        let at = turn.inverse_transform_vector(&(q - middle));
        let beyond = at.abs() - half;
        let outside = beyond.map(|x| x.max(0.0));
        let distance = outside.norm();
        if distance > 0.0 {
            let gradient = turn * outside.component_mul(&at.map(f64::signum)) / distance;
            return Sample { distance, gradient };
        }
        let side = beyond.imax();
        let mut gradient = Vector3::zeros();
        gradient[side] = at[side].signum();
        Sample { distance: beyond[side], gradient: turn * gradient }
    }

    fn support(&self, u: &Vector3) -> f64 {
        match self {
            Self::Round { piece, middle } => piece.support(u) + u.dot(&(piece.at.tip - middle)),
            Self::Block { turn, half, .. } => turn.inverse_transform_vector(u).abs().dot(half),
        }
    }

    fn lowest_of_plane(&self, corners: &[Point3; 3], normal: &Vector3) -> Option<NearPlace> {
        let (middle, turn, half) = match self {
            Self::Round { piece, .. } => return piece.lowest_of_plane(corners, normal),
            Self::Block { middle, turn, half } => (middle, turn, half),
        };
        // The plane is n·x = c in the box' own frame.
        let n = turn.inverse_transform_vector(normal);
        let c = normal.dot(&(corners[0] - middle));
        let toward = |half: Vector3| half.component_mul(&n.map(f64::signum)) * c.signum();
        let corner = toward(*half);
        let off = c.abs() - n.abs().dot(half);
        let (at, distance) = if off > 0.0 {
            (corner + n * (off * c.signum()), off)
        } else {
            // The box with its sides moved inward that just reaches the plane, unless it is flat before.
            let depth = (off / n.abs().sum()).max(-half.min());
            let smaller = toward(half.map(|x| x + depth));
            let reached = n.dot(&smaller);
            // Both have the sign of c.
            let share = if reached == 0.0 { 0.0 } else { (c / reached).min(1.0) };
            (smaller * share, depth)
        };
        Some(NearPlace { point: middle + turn * at, distance })
    }
}

/// A body on a move.
struct BodyMove<'a> {
    body: &'a Body,
    /// Of the body's own frame, seen from the mesh, at the begin.
    from: Isometry3,
    /// Where its middle begins.
    middle: Point3,
    way: Vector3,
    spin: Vector3,
}

impl<'a> BodyMove<'a> {
    fn new(body: &'a Body, ends: &Ends) -> Self {
        let [from, to] = ends.map(|link| link * body.place);
        let [begin, end] = [from, to].map(|own| own * Point3::from(body.middle));
        let spin = (to.rotation * from.rotation.inverse()).scaled_axis();
        Self { body, from, middle: begin, way: end - begin, spin }
    }
}

impl<'a> Moving for BodyMove<'a> {
    type Piece = BodyPiece<'a>;

    fn pieces(&self) -> usize {
        match &self.body.form {
            Form::Round(solid) => solid.pieces(),
            Form::Block(_) => 1,
        }
    }

    fn piece(&self, index: usize, t: f64) -> BodyPiece<'a> {
        let turn = UnitQuaternion::from_scaled_axis(self.spin * t) * self.from.rotation;
        let middle = self.middle + self.way * t;
        match &self.body.form {
            Form::Block(half) => {
                BodyPiece::Block { middle, turn: turn.to_rotation_matrix(), half: Vector3::from(*half) }
            }
            Form::Round(solid) => {
                let axis = UnitVector3::new_normalize(turn * Vector3::z()).into_inner();
                let at = ClPoint { tip: middle - turn * self.body.middle, axis };
                BodyPiece::Round { piece: ToolPiece { solid, index, at }, middle }
            }
        }
    }

    fn course(&self) -> Option<[Vector3; 2]> {
        Some([self.way, self.spin])
    }
}

impl Obstacle<'_> {
    /// The least signed distance between a body and the mesh on so many moves, of which `ends` tells where
    /// the body's link begins and ends; `None` without moves. A link turns by less than half a turn on a
    /// move.
    ///
    /// A body whose middle begins inside a closed mesh is as deep in it as that.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    ///
    /// # Tolerance
    /// As [`Obstacle::least_clearance`].
    pub fn least_clearance_of_body(
        &self,
        body: &Body,
        moves: usize,
        ends: &(dyn Fn(usize) -> Ends + Sync),
        monitor: &dyn Monitor,
    ) -> Result<Option<LeastClearance>, Cancelled> {
        self.least(moves, &|k| BodyMove::new(body, &ends(k)), monitor)
    }
}

#[cfg(test)]
mod tests;
