//! The surface of the material as a closed triangle mesh, by dual contouring: a vertex in each cell in
//! which the surface passes, a quadrilateral around each edge of the lattice on which its sign changes.
//!
//! Four cells stand around an edge, and a face between two cells has an even number of such edges, so
//! that an even number of triangles meets at every edge of the mesh. Vertices lie on the exact tangent
//! planes of the tool, which keeps ridges sharp.

use super::bricks::{Bricks, Placed, offset, slot_of};
use super::cells::{Cells, Corners, crossed};
use super::engine::VoxelEngine;
use super::vertex::vertex;
use super::voxels::Voxels;
use crate::NOT_CUT;
use geometry::{Plane, Point3, Vector3};
use work::monitor::{Cancelled, Monitor, check};
use work::parallel;

/// The machined surface.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct VoxelSurface {
    /// Vertices, mm.
    pub vertices: Vec<Point3>,
    /// The move that cuts each vertex, [`NOT_CUT`] where the stock's own surface is left.
    pub cut_by: Vec<u32>,
    /// Vertex indices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// The vertices of one block, brick by brick.
#[derive(Default)]
struct Vertices {
    places: Vec<Point3>,
    cut_by: Vec<u32>,
    ridges: Vec<bool>,
    /// Where each brick's begin, and their cells in rising order.
    starts: Vec<u32>,
    cells: Vec<u16>,
}

/// The surface as seen from a place near it.
pub(super) struct Foot {
    at: Point3,
    /// Signed distance of the material, and its gradient.
    pub(super) distance: f64,
    pub(super) normal: Vector3,
    pub(super) cut_by: u32,
}

impl Foot {
    fn plane(&self) -> Plane {
        Plane { point: self.at - self.normal * self.distance, normal: self.normal }
    }
}

/// Crossings are sought to this share of a voxel; their planes are exact in any case.
const NEAR: f64 = 4e-3;

/// Halvings of an edge of the lattice at most.
const HALVINGS: usize = 12;

/// How much closer to a ridge its planes are taken a second time.
const CLOSER: f64 = 0.1;

/// The edges of a cell: two corners each.
const EDGES: [[usize; 2]; 12] =
    [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];

impl VoxelEngine<'_> {
    /// The surface of what [`VoxelEngine::cut`] of the same engine has left.
    ///
    /// # Errors
    /// [`Cancelled`].
    ///
    /// # Tolerance
    /// Vertices lie on the tangent planes of the tool near them, which is second order in the voxel; on ridges
    /// on both. None lies outside of the stock. Every edge has an even number of triangles, two but where sheets touch within a
    /// cell.
    pub fn surface(&self, voxels: &Voxels, monitor: &dyn Monitor) -> Result<VoxelSurface, Cancelled> {
        let bricks = &voxels.bricks;
        monitor.start("surface of voxels", 2 * bricks.blocks.len() as u64);
        let step = |block: usize| {
            check(monitor)?;
            monitor.advance(1);
            Ok(block)
        };
        let blocks = bricks.blocks.len();
        let found = parallel::try_map(blocks, |block| Ok(self.vertices(bricks, step(block)?)))?;
        let mut firsts = vec![0];
        firsts.extend(found.iter().scan(0, |sum, v| {
            *sum += v.places.len() as u32;
            Some(*sum)
        }));
        let net = Net { bricks, found: &found, firsts: &firsts };
        let triangles = parallel::try_map(blocks, |block| Ok(net.triangles(step(block)?)))?;
        let mut surface = VoxelSurface { triangles: triangles.concat(), ..VoxelSurface::default() };
        for block in found {
            surface.vertices.extend(block.places);
            surface.cut_by.extend(block.cut_by);
        }
        Ok(surface)
    }

    fn vertices(&self, bricks: &Bricks, block: usize) -> Vertices {
        let mut vertices = Vertices::default();
        for placed in bricks.of_block(block) {
            vertices.starts.push(vertices.cells.len() as u32);
            let cells = Cells::of(bricks, &placed);
            for (cell, corners) in crossed(&cells) {
                let low = bricks.lattice.place(placed.low) + offset(cell) * bricks.lattice.pitch;
                let (place, cut_by, ridge) = self.vertex(&low, bricks.lattice.pitch, &corners);
                vertices.places.push(place);
                vertices.cut_by.push(cut_by);
                vertices.ridges.push(ridge);
                vertices.cells.push(cell as u16);
            }
        }
        vertices
    }

    /// The vertex of a cell whose least corner is `low`, what cuts it, and whether it stands on a ridge.
    fn vertex(&self, low: &Point3, pitch: f64, corners: &Corners) -> (Point3, u32, bool) {
        let mut planes = Vec::with_capacity(12);
        let mut movers = Vec::with_capacity(12);
        for ends in EDGES {
            let values = ends.map(|k| corners.distances[k]);
            if (values[0] < 0.0) == (values[1] < 0.0) {
                continue;
            }
            let corner = |k: usize| low + Vector3::from_fn(|i, _| f64::from(k as u32 >> i & 1) * pitch);
            let foot = self.crossing(ends.map(corner), values, ends.map(|k| corners.cut_by[k]));
            planes.push(foot.plane());
            movers.push(foot);
        }
        let half = 0.5 * pitch;
        let middle = low + Vector3::from_element(half);
        let (mut place, ridge) = vertex(&planes, &middle, half);
        let first = movers.first().map_or(NOT_CUT, |foot| foot.cut_by);
        if ridge && movers.iter().any(|foot| foot.cut_by != first) {
            // Closer to the ridge, on the same sides of it, the planes tell more exactly where it is.
            for (plane, foot) in planes.iter_mut().zip(&mut movers) {
                if foot.cut_by != NOT_CUT {
                    let q = place + (foot.at - place) * CLOSER;
                    *foot = self.foot(&q, &[foot.cut_by]);
                    *plane = foot.plane();
                }
            }
            place = vertex(&planes, &middle, half).0;
        }
        // Planes that meet outside of the stock, or of a cell that it ends in, are no place of the material.
        let (beyond, outward) = self.stock.foot(&place);
        if beyond > 0.0 {
            place -= outward * beyond;
        }
        let off = |k: &usize| planes[*k].normal.dot(&(place - planes[*k].point)).abs();
        let nearest = (0..planes.len()).min_by(|a, b| off(a).total_cmp(&off(b)));
        (place, nearest.map_or(NOT_CUT, |k| movers[k].cut_by), ridge)
    }

    /// The surface where it crosses an edge of the lattice, from the values at its ends.
    fn crossing(&self, ends: [Point3; 2], values: [f64; 2], cut_by: [u32; 2]) -> Foot {
        let length = (ends[1] - ends[0]).norm();
        let outward = values[0] < 0.0;
        let mut range = [0.0, 1.0];
        let mut share = values[0] / (values[0] - values[1]);
        let mut foot = self.foot(&(ends[0] + (ends[1] - ends[0]) * share), &cut_by);
        // At an edge of the tool or the stock interpolation may land before another face.
        for _ in 0..HALVINGS {
            if foot.distance.abs() <= NEAR * length {
                break;
            }
            range[usize::from((foot.distance < 0.0) != outward)] = share;
            share = 0.5 * (range[0] + range[1]);
            foot = self.foot(&(ends[0] + (ends[1] - ends[0]) * share), &cut_by);
        }
        foot
    }

    /// Signed distance of the material near samples that are cut by these moves, its gradient, and which of them it comes
    /// from.
    pub(super) fn foot(&self, q: &Point3, cut_by: &[u32]) -> Foot {
        let mut nearest: Option<(f64, f64, u32)> = None;
        for (k, &index) in cut_by.iter().enumerate() {
            if index == NOT_CUT || cut_by[..k].contains(&index) {
                continue;
            }
            let limit = nearest.map_or(f64::INFINITY, |n| n.0);
            if let Some(found) = self.parts.of_move(index, q, limit) {
                nearest = Some((found.distance, found.t, index));
            }
        }
        let by_stock = cut_by.contains(&NOT_CUT).then(|| self.stock.foot(q));
        match (nearest, by_stock) {
            (Some((distance, t, index)), stock) if stock.is_none_or(|s| -distance > s.0) => {
                Foot { at: *q, distance: -distance, normal: -self.parts.normal(index, q, t), cut_by: index }
            }
            (_, stock) => {
                let (distance, normal) = stock.unwrap_or_else(|| self.stock.foot(q));
                Foot { at: *q, distance, normal, cut_by: NOT_CUT }
            }
        }
    }
}

/// All vertices, to be joined.
struct Net<'a> {
    bricks: &'a Bricks,
    found: &'a [Vertices],
    /// The number of the first vertex of each block.
    firsts: &'a [u32],
}

impl Net<'_> {
    /// The number of the vertex of the cell whose least sample is `at`, and whether it stands on a ridge.
    fn vertex(&self, at: [u32; 3], here: &Placed<'_>) -> Option<(u32, bool)> {
        let near = (0..3).all(|i| at[i] / 8 == here.low[i] / 8);
        let held = if near { *here } else { self.bricks.holding(at)? };
        let block = &self.found[held.block];
        let start = block.starts[held.slot] as usize;
        let end = block.starts.get(held.slot + 1).map_or(block.cells.len(), |&end| end as usize);
        let k = start + block.cells[start..end].binary_search(&(slot_of(at) as u16)).ok()?;
        Some((self.firsts[held.block] + k as u32, block.ridges[k]))
    }

    fn triangles(&self, block: usize) -> Vec<[u32; 3]> {
        let mut triangles = Vec::new();
        for placed in self.bricks.of_block(block) {
            let cells = Cells::of(self.bricks, &placed);
            for (cell, corners) in crossed(&cells) {
                let at = [cell % 8, cell / 8 % 8, cell / 64];
                let at = std::array::from_fn(|i| placed.low[i] + at[i] as u32);
                let inside = corners.distances[0] < 0.0;
                for axis in 0..3 {
                    if (corners.distances[1 << axis] < 0.0) != inside {
                        self.quad(at, axis, inside, &placed, &mut triangles);
                    }
                }
            }
        }
        triangles
    }

    /// The two triangles around the edge from sample `at` along `axis`.
    fn quad(&self, at: [u32; 3], axis: usize, outward: bool, here: &Placed<'_>, to: &mut Vec<[u32; 3]>) {
        let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
        let around = [(1, 1), (0, 1), (0, 0), (1, 0)].map(|(below_b, below_c)| {
            let mut cell = at;
            cell[b] = cell[b].checked_sub(below_b)?;
            cell[c] = cell[c].checked_sub(below_c)?;
            self.vertex(cell, here)
        });
        let [Some(p), Some(q), Some(r), Some(s)] = around else { return };
        let ring = if outward { [p, q, r, s] } else { [p, s, r, q] };
        let length = |i: usize, j: usize| {
            let place = |k: usize| self.place(ring[k].0);
            (place(i) - place(j)).norm_squared()
        };
        // A ridge runs along edges.
        let straight = match [ring[0].1 && ring[2].1, ring[1].1 && ring[3].1] {
            [true, false] => true,
            [false, true] => false,
            _ => length(0, 2) <= length(1, 3),
        };
        let [p, q, r, s] = ring.map(|v| v.0);
        to.extend(if straight { [[p, q, r], [p, r, s]] } else { [[p, q, s], [q, r, s]] });
    }

    fn place(&self, vertex: u32) -> Point3 {
        let block = self.firsts.partition_point(|&first| first <= vertex) - 1;
        self.found[block].places[(vertex - self.firsts[block]) as usize]
    }
}
