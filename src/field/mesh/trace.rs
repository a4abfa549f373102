//! Streamlines of directions at the vertices of a mesh, by the classical Runge–Kutta method of fourth order.
//!
//! Enters: lines at the vertices, for which d and −d are the same. Within a triangle the line is the mean of
//! those at its corners, in its plane. A step leads over the triangles that it meets, straight on as if they
//! lay in one plane. Errors fall with the square of the edges' length and with the fourth power of the step;
//! mm.

use super::surface::turned;
use super::{FieldMesh, MeshPoint};
use geometry::{Point3, Vector3};

/// A step that would leave the mesh is halved until it is this share of a whole one; then it leads straight
/// to the border.
const LEAST_STEP: f64 = 1e-3;

/// A line is closed where it comes back within this share of a step.
const CLOSED: f64 = 0.75;

/// It cannot come back within fewer steps.
const FEWEST_STEPS: usize = 4;

/// A straight way crosses no more triangles than this: longer ones turn about a vertex by rounding.
const MOST_CROSSED: usize = 10_000;

/// A streamline.
#[derive(Debug, Clone, PartialEq)]
pub struct Streamline {
    /// Points a step apart.
    pub points: Vec<MeshPoint>,
    /// The last point leads back to the first.
    pub closed: bool,
}

/// Traces the streamlines of one field of lines.
#[derive(Debug, Clone, Copy)]
pub struct MeshTracer<'a> {
    mesh: &'a FieldMesh,
    lines: &'a [Vector3],
}

/// Where a straight way ends, its direction there, and what of it is left at a border, mm.
struct Walked {
    at: MeshPoint,
    along: Vector3,
    left: f64,
}

impl<'a> MeshTracer<'a> {
    /// For `lines` at the vertices, tangents of any length.
    ///
    /// # Errors
    /// [`super::MeshFieldError::Invalid`] when there is not one line for each vertex.
    pub fn new(mesh: &'a FieldMesh, lines: &'a [Vector3]) -> Result<Self, super::MeshFieldError> {
        if lines.len() != mesh.points().len() {
            let (given, wanted) = (lines.len(), mesh.points().len());
            return Err(super::MeshFieldError::Invalid(format!(
                "{given} lines were given for {wanted} vertices"
            )));
        }
        Ok(Self { mesh, lines })
    }

    /// The streamline through a point, in both senses, in steps of `step` mm: till it comes to a border, to a
    /// place without a line or back to where it began, or is `longest` mm long.
    pub fn through(&self, seed: MeshPoint, step: f64, longest: f64) -> Streamline {
        let corners = self.mesh.triangles()[seed.triangle as usize];
        let toward =
            corners.map(|v| self.lines[v as usize]).into_iter().max_by(|a, b| a.norm().total_cmp(&b.norm()));
        let toward = toward.unwrap_or_else(Vector3::zeros);
        let (mut points, closed) = self.one_way(seed, toward, step, longest);
        if !closed {
            let (back, _) = self.one_way(seed, -toward, step, longest);
            points = back.into_iter().skip(1).rev().chain(points).collect();
        }
        Streamline { points, closed }
    }

    fn one_way(
        &self,
        seed: MeshPoint,
        mut toward: Vector3,
        step: f64,
        longest: f64,
    ) -> (Vec<MeshPoint>, bool) {
        let mut points = vec![seed];
        let most = (longest / step).ceil().max(1.0) as usize;
        while points.len() <= most {
            let at = points[points.len() - 1];
            let Some(first) = self.line(&at, &toward) else { break };
            let mut h = step;
            let next = loop {
                match self.stepped(&at, first, h) {
                    Some(next) => break next,
                    None if h > LEAST_STEP * step => h *= 0.5,
                    None => break self.walked(at, first, h),
                }
            };
            let is_end = h < step;
            if next.at.position != at.position {
                points.push(next.at);
            }
            toward = next.along;
            let back = (next.at.position - seed.position).norm();
            if points.len() > FEWEST_STEPS && back < CLOSED * step && !is_end {
                return (points, true);
            }
            if next.left > 0.0 || next.at.position == at.position {
                break;
            }
        }
        (points, false)
    }

    /// One step of `h` mm; `None` where it would leave the mesh, or finds no line.
    fn stepped(&self, at: &MeshPoint, k1: Vector3, h: f64) -> Option<Walked> {
        let normal = self.normal(at);
        // The line at the end of a straight way, carried back to where it began.
        let line_after = |along: Vector3, length: f64| {
            let end = self.walked(*at, along, length);
            let line = self.line(&end.at, &end.along).filter(|_| end.left == 0.0)?;
            Some(turned(&self.normal(&end.at), &normal, &line))
        };
        let k2 = line_after(k1, 0.5 * h)?;
        let k3 = line_after(k2, 0.5 * h)?;
        let k4 = line_after(k3, h)?;
        let mean = (k1 + (k2 + k3) * 2.0 + k4) / 6.0;
        let length = mean.norm();
        let end = self.walked(*at, mean.try_normalize(1e-9)?, h * length);
        (end.left == 0.0).then_some(end)
    }

    fn normal(&self, at: &MeshPoint) -> Vector3 {
        self.mesh.area_vector(at.triangle as usize).normalize()
    }

    /// The unit line at a point, in the sense of `toward`.
    fn line(&self, at: &MeshPoint, toward: &Vector3) -> Option<Vector3> {
        let (corners, normal) = (self.mesh.triangles()[at.triangle as usize], self.normal(at));
        let mean: Vector3 = (0..3)
            .map(|k| {
                let line = self.lines[corners[k] as usize];
                line * (at.weights[k] * if line.dot(toward) < 0.0 { -1.0 } else { 1.0 })
            })
            .sum();
        (mean - normal * normal.dot(&mean)).try_normalize(1e-12)
    }

    /// The points of a streamline, and where it passes from one triangle to the next on its way between them.
    pub fn over_triangles(&self, line: &Streamline) -> Vec<MeshPoint> {
        let mut points = Vec::with_capacity(2 * line.points.len());
        for (k, at) in line.points.iter().enumerate() {
            points.push(*at);
            let closing = line.points.first().filter(|_| line.closed);
            let Some(next) = line.points.get(k + 1).or(closing) else { break };
            let (way, normal) = (next.position - at.position, self.normal(at));
            if let Some(along) = (way - normal * normal.dot(&way)).try_normalize(0.0) {
                self.walked_over(*at, along, way.norm(), &mut |crossing| points.push(crossing));
            }
        }
        points
    }

    /// The end of a straight way from a point, `along` a unit vector in its triangle.
    fn walked(&self, at: MeshPoint, along: Vector3, length: f64) -> Walked {
        self.walked_over(at, along, length, &mut |_| ())
    }

    /// The same; `crossed` is told each place on a side of a triangle, as a point of the next one.
    fn walked_over(
        &self,
        mut at: MeshPoint,
        mut along: Vector3,
        mut length: f64,
        crossed: &mut dyn FnMut(MeshPoint),
    ) -> Walked {
        for _ in 0..MOST_CROSSED {
            let t = at.triangle as usize;
            let rates = self.mesh.hat_gradients(t).map(|hat| hat.dot(&along));
            // The first side that is reached: opposite to the corner whose weight is used up.
            let reached = |k: &usize| {
                if rates[*k] < 0.0 { (at.weights[*k].max(0.0) / -rates[*k]).max(0.0) } else { f64::INFINITY }
            };
            let corner = (0..3).min_by(|a, b| reached(a).total_cmp(&reached(b))).unwrap_or(0);
            let to_side = reached(&corner);
            let go = length.min(to_side);
            at.position += along * go;
            at.weights = [0, 1, 2].map(|k| (at.weights[k] + rates[k] * go).max(0.0));
            length -= go;
            if length <= 0.0 {
                return Walked { at, along, left: 0.0 };
            }
            let Some(next) = self.mesh.neighbour(t, (corner + 1) % 3) else {
                return Walked { at, along, left: length };
            };
            along = turned(&self.normal(&at), &self.mesh.area_vector(next).normalize(), &along);
            at = self.in_triangle(next, at.position);
            crossed(at);
        }
        Walked { at, along, left: length }
    }

    /// A place of a triangle by its weights.
    fn in_triangle(&self, t: usize, position: Point3) -> MeshPoint {
        let (corners, hats) = (self.mesh.corners(t), self.mesh.hat_gradients(t));
        let weights = [0, 1, 2].map(|k| (1.0 + hats[k].dot(&(position - corners[k]))).max(0.0));
        MeshPoint { triangle: t as u32, weights, position }
    }
}
