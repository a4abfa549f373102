//! Triangle meshes: shared vertices, checked and repaired once, then immutable. mm.
//!
//! Enters: any soup of triangles. Leaves: a manifold, consistently oriented mesh in which every
//! triangle has an area, with its neighbours, or the reason why that soup is none.
//!
//! Vertices are merged where their coordinates are equal. Within a tolerance they are only where asked for
//! ([`TriangleMesh::welded`], for files), along open edges, and where that swallows no narrow feature.

mod repair;
#[cfg(test)]
mod tests;
mod weld;

use super::{Aabb, Point3, Vector3, distance_to_segment};

/// A checked triangle mesh: every index in range, every coordinate finite and within
/// [`super::MAX_COORDINATE`], no degenerate and no duplicate triangle, at most two triangles at an edge,
/// orientation consistent across edges. Open borders are allowed. [`TriangleMesh::opened`] makes one of
/// triangles that are no surface: more of them may meet at edges, where each of them ends.
#[derive(Debug, Clone)]
pub struct TriangleMesh {
    vertices: Vec<Point3>,
    triangles: Vec<[u32; 3]>,
    neighbours: Vec<[u32; 3]>,
    bounds: Aabb,
    /// The first edge that was left open because no surface runs on there, as its refusal.
    junction: Option<Box<MeshError>>,
    /// See [`TriangleMesh::moved`].
    moved: f64,
}

/// Stands for "no triangle" in neighbour lists.
const NONE: u32 = u32::MAX;

/// Which side of a mesh is outside.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outside {
    /// Away from the volume of a closed mesh, above an open one.
    Found,
    /// The one from which triangles run counter-clockwise as given, or most of those that hang together do.
    Given,
}

/// What becomes of edges at which triangles make no surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Junctions {
    Refused,
    Opened,
}

/// What was changed to make a mesh usable.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RepairNotes {
    /// Vertices merged because they coincide. An STL file states every corner anew, so there this
    /// is no defect.
    pub merged_vertices: usize,
    /// Vertices welded to others because they coincide but for rounding.
    pub welded_vertices: usize,
    /// Edges split at vertices that lie on them but for rounding.
    pub split_edges: usize,
    /// How far welding and splitting moved the surface at most, mm.
    pub moved: f64,
    /// Degenerate triangles (without area) dropped.
    pub dropped_degenerate: usize,
    /// Triangles dropped because the same three corners had occurred before.
    pub dropped_duplicates: usize,
    /// Triangles turned over so that they agree with their neighbours.
    pub flipped_triangles: usize,
    /// Edges left open because more than two triangles meet there, or two that cannot face the same side.
    pub opened_edges: usize,
    /// The whole mesh was turned over: it was inside out, or an open surface facing down.
    pub turned_over: bool,
}

impl RepairNotes {
    /// True when nothing but the merging of vertices was done.
    pub fn is_clean(&self) -> bool {
        *self == Self { merged_vertices: self.merged_vertices, ..Self::default() }
    }
}

impl std::fmt::Display for RepairNotes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut done = Vec::new();
        let mut count = |n: usize, before: &str, one: &str, many: &str, after: &str| {
            if n > 0 {
                done.push(format!("{before} {n} {}{after}", if n == 1 { one } else { many }));
            }
        };
        count(self.merged_vertices, "merged", "coincident vertex", "coincident vertices", "");
        let by = match self.moved {
            by if by > 0.0 => format!(" within {:.1e} mm", two_digits_up(by)),
            _ => String::new(),
        };
        count(self.welded_vertices, "welded", "vertex", "vertices", &format!(" to others{by}"));
        count(self.split_edges, "split", "edge", "edges", &format!(" at vertices on them{by}"));
        count(self.dropped_degenerate, "dropped", "triangle", "triangles", " without area");
        count(self.dropped_duplicates, "dropped", "duplicate triangle", "duplicate triangles", "");
        count(self.flipped_triangles, "turned over", "triangle", "triangles", " against the rest");
        count(
            self.opened_edges,
            "left",
            "edge",
            "edges",
            " open where more than two triangles meet, or two that cannot face the same side",
        );
        if self.turned_over {
            done.push("turned the whole mesh over, because it faced the wrong way".to_owned());
        }
        if done.is_empty() { f.write_str("no repairs") } else { f.write_str(&done.join(", ")) }
    }
}

/// Why a mesh was refused. Triangles are counted from 0 in the order in which they were given.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// No triangle is left.
    #[error(
        "the mesh has no triangles{}; export the part as a triangle mesh again",
        if *dropped > 0 { format!(" with an area ({dropped} without were dropped)") } else { String::new() }
    )]
    Empty {
        /// How many triangles without area were dropped.
        dropped: usize,
    },
    /// More vertices or triangles than 32-bit indices can count.
    #[error("the mesh has {triangles} triangles and at most {limit} can be handled; export it coarser")]
    TooMany {
        /// Triangles given.
        triangles: usize,
        /// Triangles allowed.
        limit: usize,
    },
    /// A triangle refers to a vertex that does not exist.
    #[error("triangle {triangle} refers to vertex {index}, but there are {vertices} (counted from 0)")]
    IndexOutOfRange {
        /// Which triangle.
        triangle: usize,
        /// The index given.
        index: u32,
        /// Number of vertices.
        vertices: usize,
    },
    /// A coordinate is not a number or infinite.
    #[error(
        "triangle {triangle} has the corner ({}), which is not finite; export the part again",
        show(point)
    )]
    NotFinite {
        /// Which triangle.
        triangle: usize,
        /// The corner.
        point: [f64; 3],
    },
    /// A coordinate is out of range.
    #[error(
        "triangle {triangle} has the corner ({}) mm; coordinates must lie within ±{} mm: \
         check the units of the export, and move the part near the origin",
        show(point),
        super::MAX_COORDINATE
    )]
    TooFar {
        /// Which triangle.
        triangle: usize,
        /// The corner.
        point: [f64; 3],
    },
    /// More than two triangles meet at an edge.
    #[error(
        "{count} triangles ({}{}) meet at the edge from ({}) to ({}); a surface has at most two there: \
         unite the bodies, or remove inner walls, before exporting",
        show_indices(triangles), if *count > 3 { ", …" } else { "" }, show(from), show(to)
    )]
    NonManifoldEdge {
        /// The first three of the triangles.
        triangles: [usize; 3],
        /// How many there are.
        count: usize,
        /// One end of the edge.
        from: [f64; 3],
        /// The other end.
        to: [f64; 3],
    },
    /// The mesh has no outer side: it is one-sided like a Möbius strip.
    #[error(
        "triangles {} and {} at the edge from ({}) to ({}) cannot be turned to face the same side: \
         the surface is one-sided; repair it in the modeller",
        triangles[0], triangles[1], show(from), show(to)
    )]
    NotOrientable {
        /// The two triangles.
        triangles: [usize; 2],
        /// One end of their edge.
        from: [f64; 3],
        /// The other end.
        to: [f64; 3],
    },
}

/// A number above 0 rounded up to two digits.
fn two_digits_up(x: f64) -> f64 {
    let digit = 10_f64.powf(x.log10().floor() - 1.0);
    (x / digit).ceil() * digit
}

fn show(p: &[f64; 3]) -> String {
    format!("{}, {}, {}", p[0], p[1], p[2])
}

fn show_indices(t: &[usize; 3]) -> String {
    format!("{}, {}, {}", t[0], t[1], t[2])
}

impl TriangleMesh {
    /// What lies within this distance of an edge, mm, belongs to the faces on both sides.
    pub const ON_EDGE: f64 = 1e-6;

    /// Checks and repairs a mesh: merges vertices with equal coordinates, drops vertices that no
    /// triangle uses, triangles without area and triangles that occurred before, turns triangles
    /// to agree with their neighbours, and turns the whole mesh to face outward (closed) or upward
    /// (open). A mesh that needs nothing of that keeps its numbering.
    ///
    /// # Errors
    /// See [`MeshError`].
    pub fn new(vertices: Vec<Point3>, triangles: Vec<[u32; 3]>) -> Result<(Self, RepairNotes), MeshError> {
        Self::with_sources(vertices, triangles, Outside::Found).map(|(mesh, notes, _)| (mesh, notes))
    }

    /// As [`TriangleMesh::new`] with the outside found or given, and tells where each corner comes from: for
    /// every triangle of the mesh, the indices into the given `vertices` of its corners, in the mesh's order.
    /// Whoever keeps parameters per vertex finds them this way after merging, dropping and turning.
    ///
    /// # Errors
    /// See [`MeshError`].
    pub fn with_sources(
        vertices: Vec<Point3>,
        triangles: Vec<[u32; 3]>,
        outside: Outside,
    ) -> Result<(Self, RepairNotes, Vec<[u32; 3]>), MeshError> {
        repair::repair(vertices, triangles, outside, Junctions::Refused, 0.0)
    }

    /// As [`TriangleMesh::new`] for meshes that need not be a surface: an edge where more than two triangles
    /// meet, or two that cannot face the same side, is left open, as a border of each of them. Open pieces
    /// then each face upward. Heights and distances are those of all triangles; what is inside may be
    /// unknown.
    ///
    /// # Errors
    /// See [`MeshError`]; neither [`MeshError::NonManifoldEdge`] nor [`MeshError::NotOrientable`].
    pub fn opened(vertices: Vec<Point3>, triangles: Vec<[u32; 3]>) -> Result<(Self, RepairNotes), MeshError> {
        Self::welded(vertices, triangles, 0.0)
    }

    /// As [`TriangleMesh::opened`] for vertices that rounding moved by up to about `tolerance`, mm. Vertices at open
    /// edges that lie within it of each other are welded, and open edges are split at vertices of others that lie
    /// within it of them. Left open is what would collapse or turn triangles over, join some that do not face the
    /// same side as given, fold two sheets onto each other, or lead a third triangle to an edge.
    ///
    /// # Tolerance
    /// No place of the surface is moved by more than [`TriangleMesh::moved`], at most twice `tolerance`.
    ///
    /// # Errors
    /// As [`TriangleMesh::opened`].
    pub fn welded(
        vertices: Vec<Point3>,
        triangles: Vec<[u32; 3]>,
        tolerance: f64,
    ) -> Result<(Self, RepairNotes), MeshError> {
        let repaired = repair::repair(vertices, triangles, Outside::Found, Junctions::Opened, tolerance);
        repaired.map(|(mesh, notes, _)| (mesh, notes))
    }

    /// How far this surface lies off the triangles that were given at most, mm; 0 where nothing was welded.
    pub fn moved(&self) -> f64 {
        self.moved
    }

    /// For what needs a surface with two sides.
    ///
    /// # Errors
    /// The first of the edges that were left open, as [`TriangleMesh::new`] refuses it.
    pub fn surface(&self) -> Result<(), &MeshError> {
        self.junction.as_deref().map_or(Ok(()), Err)
    }

    /// Vertices, mm.
    pub fn vertices(&self) -> &[Point3] {
        &self.vertices
    }

    /// Vertex indices, counter-clockwise seen from outside.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Area of triangle `t`, mm².
    pub fn area(&self, t: usize) -> f64 {
        let [a, b, c] = self.corners(t);
        0.5 * (b - a).cross(&(c - a)).norm()
    }

    /// The three corners of triangle `t`.
    #[inline]
    pub fn corners(&self, t: usize) -> [Point3; 3] {
        self.triangles[t].map(|i| self.vertices[i as usize])
    }

    /// Unit normal of triangle `t`, by its orientation.
    pub fn normal(&self, t: usize) -> Vector3 {
        let [a, b, c] = self.corners(t);
        (b - a).cross(&(c - a)).normalize()
    }

    /// The triangle across side `k` (from corner `k` to corner `k + 1`) of triangle `t`; `None` at
    /// a border.
    pub fn neighbour(&self, t: usize, k: usize) -> Option<usize> {
        let n = self.neighbours[t][k];
        (n != NONE).then_some(n as usize)
    }

    /// The triangles that a point on triangle `t` belongs to, that one first: two at an edge, a fan at a
    /// vertex.
    pub fn triangles_at(&self, t: usize, point: &Point3) -> Vec<usize> {
        let mut found = vec![t];
        let mut looked = 0;
        while let Some(&t) = found.get(looked) {
            looked += 1;
            let corners = self.corners(t);
            for k in 0..3 {
                let is_near = distance_to_segment(point, &corners[k], &corners[(k + 1) % 3]) <= Self::ON_EDGE;
                found.extend(self.neighbour(t, k).filter(|n| is_near && !found.contains(n)));
            }
        }
        found
    }

    /// True without borders.
    pub fn is_closed(&self) -> bool {
        self.neighbours.iter().flatten().all(|&n| n != NONE)
    }

    /// The mesh in a unit that is `factor > 0` times as small: every coordinate times `factor`.
    ///
    /// # Errors
    /// [`MeshError::TooFar`] or [`MeshError::NotFinite`] when a coordinate leaves its range, and
    /// [`MeshError::Empty`] when nothing with an area is left of it.
    pub fn scaled(&self, factor: f64) -> Result<Self, MeshError> {
        let vertices = self.vertices.iter().map(|p| p * factor).collect();
        let (mesh, _) = Self::opened(vertices, self.triangles.clone())?;
        Ok(Self { moved: self.moved * factor, ..mesh })
    }

    /// Bounds of all vertices.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }
}
