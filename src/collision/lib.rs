//! Where a tool or a body of the machine touches what it should not: the part away from the contact,
//! neighbours, fixtures.
//!
//! Enters: the tool as a [`Solid`] of convex pieces, its location, and meshes with their search trees, mm.
//! Leaves: the nearest place of the meshes with its signed distance from the tool, for one location
//! ([`Obstacle::clearance`]), a whole move ([`Obstacle::swept_clearance`]) or a whole path
//! ([`Obstacle::least_clearance`]). Boxes and cylinders of a machine move in any way
//! ([`Obstacle::least_clearance_of_body`]).
//!
//! The distance from a convex piece is convex, so its gradient supports it over a box, a triangle and a
//! stretch of a move. A tool that slides along a surface comes no nearer by its motion: its supporting plane
//! moves along itself. A bound by speed alone would need far more looks. Cutter and holder are checked apart,
//! because a cutter may cut in by a tolerance.
//!
//! Limits: only the surface of a mesh counts, closed or not. A tool wholly inside a closed mesh touches none
//! of it. It reached that position through the surface, and the move that did so is reported, or it began
//! there ([`Obstacle::least_clearance`]).

mod body;
mod checks;
mod least;
mod piece;
#[doc(hidden)]
pub mod samples;
mod sweep;
#[cfg(test)]
mod tests;

pub use body::{Body, Ends};
pub use checks::{Check, Interference, LastRefusal, Shortfall};
use cutter::Solid;
use geometry::{Aabb, Bvh, Node, Point3, TriangleMesh};
pub use least::LeastClearance;
use motion::ClPoint;
#[cfg(test)]
use piece::middle;
use piece::{Convex, ToolPiece};
pub use sweep::SweptClearance;

/// A mesh that a tool may run into.
#[derive(Debug, Clone, Copy)]
pub struct Obstacle<'a> {
    mesh: &'a TriangleMesh,
    bvh: &'a Bvh,
}

/// The place of a mesh that is nearest to a tool, or deepest in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clearance {
    /// Signed distance of the place from the tool, mm; negative inside.
    pub distance: f64,
    /// The place, on the mesh.
    pub place: Point3,
    /// Triangle it lies on.
    pub triangle: u32,
}

impl<'a> Obstacle<'a> {
    /// A mesh with its own search tree.
    pub fn new(mesh: &'a TriangleMesh, bvh: &'a Bvh) -> Self {
        Self { mesh, bvh }
    }

    /// The box around the mesh.
    pub fn bounds(&self) -> Aabb {
        self.mesh.bounds()
    }

    /// The nearest place of the mesh, if it is nearer than `limit`, mm, to a tool standing at `at`.
    ///
    /// # Tolerance
    /// The distance is the least of the whole mesh to 1e-9 mm. Inside of a solid of several pieces it is the
    /// depth in the piece in which a place lies deepest; what adjoining pieces add to it is not counted.
    pub fn clearance(&self, solid: &Solid, at: &ClPoint, limit: f64) -> Option<Clearance> {
        let mut best = None;
        for index in 0..solid.pieces() {
            let piece = ToolPiece { solid, index, at: *at };
            self.nearest(&piece, limit, &mut best);
        }
        best
    }

    /// The first piece and triangle that are found to be nearer to each other than `limit`, mm.
    fn some_nearer(&self, solid: &Solid, at: &ClPoint, limit: f64) -> Option<(usize, usize)> {
        (0..solid.pieces()).find_map(|index| {
            let piece = ToolPiece { solid, index, at: *at };
            let mut found = None;
            self.bvh.tree().search(-limit, farthest(&piece), |slot, now| {
                let triangle = self.bvh.triangle_in(slot);
                if piece.nearest_on(&self.mesh.corners(triangle), limit).is_some() {
                    found = Some((index, triangle));
                }
                if found.is_some() { f64::INFINITY } else { now }
            });
            found
        })
    }

    /// Whether a piece and a triangle are nearer to each other than `limit`, mm.
    fn are_nearer(&self, solid: &Solid, at: &ClPoint, (index, triangle): (usize, usize), limit: f64) -> bool {
        let piece = ToolPiece { solid, index, at: *at };
        piece.nearest_on(&self.mesh.corners(triangle), limit).is_some()
    }

    /// Puts in `best` what is nearer than that, or than `limit`; tells whether there is such a place.
    fn nearest<P: Convex>(&self, piece: &P, limit: f64, best: &mut Option<Clearance>) -> bool {
        let start = best.as_ref().map_or(limit, |b| b.distance);
        let mut found = false;
        self.bvh.tree().search(-start, farthest(piece), |slot, now| {
            let triangle = self.bvh.triangle_in(slot);
            let Some(place) = piece.nearest_on(&self.mesh.corners(triangle), -now) else { return now };
            *best =
                Some(Clearance { distance: place.distance, place: place.point, triangle: triangle as u32 });
            found = true;
            -place.distance
        });
        found
    }
}

/// Minus a lower bound on the distance of a box: what the supporting plane at its middle leaves over its
/// sides.
fn farthest<P: Convex>(piece: &P) -> impl Fn(usize, &Node, f64) -> f64 {
    |_, node, _| {
        let (middle, half) = node.middle();
        let sample = piece.sample(&middle);
        let g = sample.gradient;
        g.x.abs() * half[0] + g.y.abs() * half[1] + g.z.abs() * half[2] - sample.distance
    }
}
