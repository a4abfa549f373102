//! Where the part ends: a cutter that touches its border rolls over an edge instead of cutting a surface.
//!
//! A zigzag pass ends where the cutter has rolled over the border by more than one stepover. Passes that end
//! at the border itself leave slivers where they meet it at a small angle.
//!
//! A solid ends, seen from above, at the rim of the walls that go down from it: what faces up is planned as
//! were it alone.

use std::collections::HashMap;

use cutter::Cutter;
use geometry::{Point2, Point3, Vector2, Vector3, distance_to_segment};
use part::{Part, SurfacePoint};

/// Contacts within this share of the part's size of its border lie on it: a thousand times f64's
/// rounding of coordinates, a millionth of a cutter.
const ON_BORDER: f64 = 1e-10;

/// Least vertical part of the normal of a wall that faces up; less is upright, or rounding of the file.
pub(crate) const LEAST_FACING: f64 = 1e-4;

/// Beside a rim nothing is looked for farther than this share of the part's size.
const BESIDE_RIM: f64 = 1e-6;

/// A pass counts as nearly parallel to the border where its angle to it has less than one over this
/// as tangent.
const NEARLY_PARALLEL: f64 = 3.0;

/// An overrun shorter than this many intervals is left out.
const LEAST_OVERRUN: f64 = 0.05;

/// How far a pass is worth running on over a border, in intervals, when it meets it at the angle φ
/// (given as 1/tan φ): it ends half an interval over tan φ short of where its ridge to the neighbour
/// leaves the part. A pass nearly parallel to the border serves the strip inside it to its end.
pub fn useful_overrun(cotangent: f64) -> f64 {
    match 0.5 * cotangent {
        _ if cotangent > NEARLY_PARALLEL => f64::INFINITY,
        length if length < LEAST_OVERRUN => 0.0,
        length => length,
    }
}

/// Answers whether a point of the surface lies on the border of the part.
pub struct Border<'a> {
    part: &'a Part,
    /// Border edges that start or end at a vertex or bound a triangle, by triangle of the mesh;
    /// only triangles that have any.
    edges: HashMap<u32, Vec<Edge>>,
    tolerance: f64,
}

/// A side of a triangle that is an edge of the border.
#[derive(Clone, Copy)]
struct Edge {
    ends: [Point3; 2],
    /// Of a rim: the normal of the triangle, without that of the wall.
    normal: Option<Vector3>,
}

impl<'a> Border<'a> {
    /// Finds the border of the part's mesh: edges of one triangle only, and rims of walls beside which nothing
    /// is seen from above.
    pub fn of(part: &'a Part) -> Self {
        let mesh = part.mesh();
        let tolerance = ON_BORDER * (part.bounds().diagonal() + 1.0);
        let mut edges = HashMap::new();
        if part.patches().is_empty() {
            let beside = BESIDE_RIM * (part.bounds().diagonal() + 1.0);
            let is_rim = |t: usize, other: usize, [a, b]: [Point3; 2]| {
                mesh.normal(t).z > LEAST_FACING
                    && mesh.normal(other).z <= LEAST_FACING
                    && (b - a).xy().try_normalize(0.0).is_some_and(|along| {
                        let out = nalgebra::center(&a, &b).xy() + Vector2::new(along.y, -along.x) * beside;
                        part.highest_at(out.x, out.y).is_none()
                    })
            };
            let mut at_vertex: HashMap<u32, Vec<Edge>> = HashMap::new();
            for (t, corners) in mesh.triangles().iter().enumerate() {
                for k in 0..3 {
                    let side = [corners[k], corners[(k + 1) % 3]];
                    let ends = side.map(|i| mesh.vertices()[i as usize]);
                    let normal = match mesh.neighbour(t, k) {
                        None => None,
                        Some(other) if is_rim(t, other, ends) => Some(mesh.normal(t)),
                        Some(_) => continue,
                    };
                    side.iter().for_each(|&i| at_vertex.entry(i).or_default().push(Edge { ends, normal }));
                }
            }
            for (t, corners) in mesh.triangles().iter().enumerate() {
                let near: Vec<Edge> =
                    corners.iter().filter_map(|i| at_vertex.get(i)).flatten().copied().collect();
                if !near.is_empty() {
                    edges.insert(t as u32, near);
                }
            }
        }
        Self { part, edges, tolerance }
    }

    /// How far a cutter with its axis at `axis` has rolled over an edge that it touches at `contact`, mm.
    pub fn rolled(&self, cutter: &Cutter, axis: &Point2, contact: &SurfacePoint) -> f64 {
        self.roll(cutter, axis, contact).norm()
    }

    /// True where the part has surface in the plan view.
    pub fn under(&self, p: &Point2) -> bool {
        self.part.highest_at(p.x, p.y).is_some()
    }

    /// By how much the contact would lie elsewhere had the surface gone on beside the edge; nothing for a
    /// disc with a sharp rim, which touches level ground anywhere.
    pub fn roll(&self, cutter: &Cutter, axis: &Point2, contact: &SurfacePoint) -> Vector3 {
        // On a rim what would go on is the face that ends there.
        let normal = self.edge(contact).and_then(|edge| edge.normal).unwrap_or(contact.normal);
        if cutter.corner_radius() == 0.0 {
            let pointed = cutter.profile().point().sin > 0.0;
            let there = axis - cutter.axis_offset(&normal) - contact.point.xy();
            return if pointed { there.push(0.0) } else { Vector3::zeros() };
        }
        // Direction from the contact to the centre of the corner's circle, against the normal.
        let out = axis - contact.point.xy();
        let rho = out.norm();
        let lean = cutter.profile().incline(rho).sin;
        let horizontal = if rho > 0.0 { out * (lean / rho) } else { out };
        let toward = Vector3::new(horizontal.x, horizontal.y, (1.0 - lean * lean).sqrt());
        (toward - normal) * cutter.corner_radius()
    }

    /// True when `contact` lies on the border.
    pub fn holds(&self, contact: &SurfacePoint) -> bool {
        if let Some(at) = contact.at {
            return self.part.is_at_patch_end(at);
        }
        self.edge(contact).is_some()
    }

    /// The edge of a mesh's border on which a contact lies.
    fn edge(&self, contact: &SurfacePoint) -> Option<&Edge> {
        let near = |edge: &&Edge| {
            let [a, b] = &edge.ends;
            distance_to_segment(&contact.point, a, b) <= self.tolerance
        };
        self.edges.get(&contact.triangle)?.iter().find(near)
    }
}
