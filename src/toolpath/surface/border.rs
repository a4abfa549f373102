//! Where the part ends: a cutter that touches its border rolls over an edge instead of cutting a surface.
//!
//! A zigzag pass ends where the cutter has rolled over the border by more than one stepover. Passes that end
//! at the border itself leave slivers where they meet it at a small angle.

use std::collections::HashMap;

use cutter::Cutter;
use geometry::{Point2, Point3, Vector3, distance_to_segment};
use part::{Part, SurfacePoint};

/// Contacts within this share of the part's size of its border lie on it: a thousand times f64's
/// rounding of coordinates, a millionth of a cutter.
const ON_BORDER: f64 = 1e-10;

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
    edges: HashMap<u32, Vec<[Point3; 2]>>,
    tolerance: f64,
}

impl<'a> Border<'a> {
    /// Finds the border of the part's mesh: edges of one triangle only.
    pub fn of(part: &'a Part) -> Self {
        let mesh = part.mesh();
        let tolerance = ON_BORDER * (part.bounds().diagonal() + 1.0);
        let mut edges = HashMap::new();
        if part.patches().is_empty() {
            let mut at_vertex: HashMap<u32, Vec<[Point3; 2]>> = HashMap::new();
            for (t, corners) in mesh.triangles().iter().enumerate() {
                for k in (0..3).filter(|&k| mesh.neighbour(t, k).is_none()) {
                    let side = [corners[k], corners[(k + 1) % 3]];
                    let ends = side.map(|i| mesh.vertices()[i as usize]);
                    for i in side {
                        at_vertex.entry(i).or_default().push(ends);
                    }
                }
            }
            for (t, corners) in mesh.triangles().iter().enumerate() {
                let near: Vec<[Point3; 2]> =
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
        if cutter.corner_radius() == 0.0 {
            let pointed = cutter.profile().point().sin > 0.0;
            let there = axis - cutter.axis_offset(&contact.normal) - contact.point.xy();
            return if pointed { there.push(0.0) } else { Vector3::zeros() };
        }
        // Direction from the contact to the centre of the corner's circle, against the normal.
        let out = axis - contact.point.xy();
        let rho = out.norm();
        let lean = cutter.profile().incline(rho).sin;
        let horizontal = if rho > 0.0 { out * (lean / rho) } else { out };
        let toward = Vector3::new(horizontal.x, horizontal.y, (1.0 - lean * lean).sqrt());
        (toward - contact.normal) * cutter.corner_radius()
    }

    /// True when `contact` lies on the border.
    pub fn holds(&self, contact: &SurfacePoint) -> bool {
        if let Some(at) = contact.at {
            return self.part.is_at_patch_end(at);
        }
        let near = |[a, b]: &[Point3; 2]| distance_to_segment(&contact.point, a, b) <= self.tolerance;
        self.edges.get(&contact.triangle).is_some_and(|edges| edges.iter().any(near))
    }
}
