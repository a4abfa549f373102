//! The cut stock as a closed triangle mesh, fine where the surface bends, coarse where it is flat, with its
//! ridges along edges.
//!
//! Enters: the cut map, and the cutters and path that cut it. Leaves: vertices in mm, triangles
//! counter-clockwise seen from outside. The top is a hierarchy of right triangles over the cell centres
//! ([`network`]). Where two neighbouring centres were cut by different passes, the cuts are brought to
//! intersection in closed form ([`ridge_points`]), and a side that crosses such a ridge is divided at it, so
//! that ridges keep their heights and run straight instead of along the cells.
//!
//! Triangles along the cells would miss the ridges between them. With ridges along edges the same number of
//! triangles lies closer to the cut surface.

mod network;
mod ridge_points;
mod split;
#[cfg(test)]
mod tests;

use std::collections::HashMap;

use geometry::Point3;
use motion::{Cutters, Toolpath};
use network::{Network, Scratch};
use part::Part;
use ridge_points::RidgePoints;
use sim::ZMap;
use split::Corner;

/// More triangles than this and the tolerance is grown: programs that view STL files grow slow, and a
/// file takes 50 bytes a triangle. On a map of 2000 × 2000 cells with ridges of 10 µm, 500 000 only
/// hold 11 µm, a million hold 7 µm, and a quarter of the ridges would take 2.1 million (105 MB);
/// height.exr has every cell.
pub const MAX_TRIANGLES: usize = 1_000_000;

/// Least tolerance, mm: below a nanometre heights are rounding noise.
const LEAST_TOLERANCE: f64 = 1e-6;

/// Ridge points that lie closer to a side than this share of the tolerance are left out of it. A
/// greater share leaves more of the tolerance unused by the ridges and more to their neighbours; with
/// a smaller one ridges that nobody sees cost triangles.
const UNSEEN: f64 = 1.0 / 16.0;

/// Triangles that miss the surface by this many tolerances are not measured to the end. Where so many
/// would be needed that the tolerance must grow past it, the cap grows as many times and all is measured
/// again; a greater cap measures more in vain.
const CAP: f64 = 16.0;

/// What a vertex stands on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VertexPlace {
    /// The centre of a cell, by its index.
    Cell(u32),
    /// A ridge between cell centres.
    Ridge,
    /// The bottom.
    Bottom,
}

/// A closed triangle mesh, counter-clockwise seen from outside.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceMesh {
    /// Vertices, mm.
    pub vertices: Vec<[f32; 3]>,
    /// What each of them stands on.
    pub places: Vec<VertexPlace>,
    /// Vertex indices.
    pub triangles: Vec<[u32; 3]>,
    /// No cell centre, and no ridge between two neighbouring ones, lies farther above or below the
    /// top than this, mm.
    pub tolerance: f64,
}

impl SurfaceMesh {
    /// Signed deviation from the design surface at every vertex, mm: that of `map` (a value a cell) at
    /// cell centres, the distance from `part` on ridges; NaN off the part and at the bottom.
    pub fn deviations(&self, part: &Part, map: &[f32]) -> Vec<f32> {
        work::parallel::map(self.vertices.len(), |k| match self.places[k] {
            VertexPlace::Cell(cell) => map[cell as usize],
            VertexPlace::Bottom => f32::NAN,
            VertexPlace::Ridge => {
                let vertex = Point3::from(self.vertices[k].map(f64::from));
                if part.highest_at(vertex.x, vertex.y).is_none() {
                    return f32::NAN;
                }
                let (foot, distance) = part.closest_point(&vertex);
                (if (vertex - foot.point).dot(&foot.normal) < 0.0 { -distance } else { distance }) as f32
            }
        })
    }
}

/// A node of the grid, in cells; nodes beyond the grid's last row and column hold no height.
type Node = (usize, usize);

/// The solid between the surface that `path` has cut and a flat bottom at height `bottom` (mm, below
/// every cell). Its walls stand at the centres of the outermost cells.
///
/// `None` for a grid of a single row or column, which spans no surface.
///
/// # Tolerance
/// The top stays within `tolerance` (mm, vertically) of every cell centre, and of every ridge where
/// it passes between two neighbouring ones (along x, along y or along the diagonal that its square is
/// cut by; ridge points are moved sideways by 1/256 of that line at most), or within the
/// [`SurfaceMesh::tolerance`] that `max_triangles` allows, if that is greater.
pub fn surface_mesh(
    cut: &ZMap,
    cutters: &Cutters,
    path: &Toolpath,
    bottom: f64,
    tolerance: f64,
    max_triangles: usize,
) -> Option<SurfaceMesh> {
    if cut.grid.nx < 2 || cut.grid.ny < 2 {
        return None;
    }
    let ridges = RidgePoints::find(cut, cutters, path);
    let wanted = tolerance.max(LEAST_TOLERANCE);
    let lowest = cut.height.iter().copied().fold(f32::INFINITY, f32::min);
    let highest = cut.height.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let mut cap = CAP * wanted;
    let (network, tolerance) = loop {
        let network = Network::new(cut, &ridges, UNSEEN * wanted, cap);
        let tolerance = network.least_tolerance(wanted, max_triangles);
        if cap >= f64::from(highest - lowest) || !network.exceeds(tolerance, max_triangles) {
            break (network, tolerance);
        }
        cap *= CAP;
    };
    let mut solid = Solid::new(cut, ridges.len());
    let mut scratch = Scratch::default();
    network.visit(tolerance, &mut |corners| {
        network.pieces(corners, &mut scratch);
        scratch.pieces.iter().for_each(|piece| solid.top(piece));
        true
    });
    solid.close(bottom);
    Some(SurfaceMesh {
        vertices: solid.vertices,
        places: solid.places,
        triangles: solid.triangles,
        tolerance,
    })
}

/// In [`Solid::index`]: a point that is no vertex.
const NO_VERTEX: u32 = u32::MAX;

/// The mesh while it grows.
struct Solid<'a> {
    cut: &'a ZMap,
    vertices: Vec<[f32; 3]>,
    places: Vec<VertexPlace>,
    triangles: Vec<[u32; 3]>,
    /// Vertex at each cell's centre, then at each ridge point.
    index: Vec<u32>,
    /// Edges of the top along the grid's border, counter-clockwise seen from above.
    rim: Vec<[u32; 2]>,
}

impl<'a> Solid<'a> {
    fn new(cut: &'a ZMap, ridge_points: usize) -> Self {
        let index = vec![NO_VERTEX; cut.grid.len() + ridge_points];
        Self { cut, vertices: Vec::new(), places: Vec::new(), triangles: Vec::new(), index, rim: Vec::new() }
    }

    fn push(&mut self, vertex: [f32; 3], place: VertexPlace) -> u32 {
        self.vertices.push(vertex);
        self.places.push(place);
        (self.vertices.len() - 1) as u32
    }

    fn vertex(&mut self, corner: &Corner) -> u32 {
        if self.index[corner.vertex] == NO_VERTEX {
            let grid = &self.cut.grid;
            let (x, y) = (grid.origin.x + corner.x * grid.cell, grid.origin.y + corner.y * grid.cell);
            let place =
                if corner.on_ridge { VertexPlace::Ridge } else { VertexPlace::Cell(corner.vertex as u32) };
            self.index[corner.vertex] = self.push([x as f32, y as f32, corner.z as f32], place);
        }
        self.index[corner.vertex]
    }

    /// Adds a triangle of the top.
    fn top(&mut self, piece: &[Corner; 3]) {
        let triangle = [0, 1, 2].map(|k| self.vertex(&piece[k]));
        self.triangles.push(triangle);
        let (right, back) = ((self.cut.grid.nx - 1) as f64, (self.cut.grid.ny - 1) as f64);
        for k in 0..3 {
            let (p, q) = (&piece[k], &piece[(k + 1) % 3]);
            let along = |a: f64, b: f64, border: f64| a == border && b == border;
            if along(p.x, q.x, 0.0) || along(p.x, q.x, right) || along(p.y, q.y, 0.0) || along(p.y, q.y, back)
            {
                self.rim.push([triangle[k], triangle[(k + 1) % 3]]);
            }
        }
    }

    /// Adds walls and bottom.
    fn close(&mut self, bottom: f64) {
        let grid = self.cut.grid;
        let bottom = bottom as f32;
        let (low, high) = (grid.centre(0, 0), grid.centre(grid.nx - 1, grid.ny - 1));
        let middle = [(0.5 * (low.x + high.x)) as f32, (0.5 * (low.y + high.y)) as f32, bottom];
        let hub = self.push(middle, VertexPlace::Bottom);
        let mut feet = HashMap::new();
        for [from, to] in std::mem::take(&mut self.rim) {
            let [foot, next] = [from, to].map(|top| {
                *feet.entry(top).or_insert_with(|| {
                    let [x, y, _] = self.vertices[top as usize];
                    self.push([x, y, bottom], VertexPlace::Bottom)
                })
            });
            self.triangles.extend([[foot, next, to], [foot, to, from], [hub, next, foot]]);
        }
    }
}
