//! The surface of the material as a closed triangle mesh, by dual contouring: a vertex for each sheet of the
//! surface in a cell, a quadrilateral around each edge of the lattice on which its sign changes.
//!
//! Each sheet leaves a cell over pairs of edges on its faces, and the sheet of the next cell goes on over the
//! same pair: two quadrilaterals share the line between their vertices. Only where two sheets meet twice on
//! one face would four of them share it; there each pair gets a vertex of its own on the face (`pinches`). So
//! two triangles meet at every edge of the mesh, and those around a vertex form one ring. Vertices lie on the
//! exact tangent planes of the tool, which keeps ridges sharp.

use super::bricks::{Bricks, Placed, offset, slot_of};
use super::cells::{Cells, Corners, crossed};
use super::engine::VoxelEngine;
use super::vertex::vertex;
use super::voxels::Voxels;
use crate::NOT_CUT;
use geometry::sheets::{EDGES, Sheets, edge_at, is_crossed};
use geometry::{Plane, Point3, Vector3, into_cube};
use std::collections::HashMap;
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
    /// Where each brick's cells begin, and its cells in rising order.
    starts: Vec<u32>,
    cells: Vec<u16>,
    /// Of each cell, which of its corners are inside, and its first vertex; the others follow sheet by sheet.
    shapes: Vec<u8>,
    firsts: Vec<u32>,
}

/// A face of a cell upward along an axis on which two sheets meet twice, and a corner inside on it.
type Pinch = ([u32; 3], usize, [u32; 3]);

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

/// Vertices stay so far inside of their cells, as a share of half a cell, that those of neighbours stay apart
/// in f32.
const APART: f64 = 2e-3;

impl VoxelEngine<'_> {
    /// The surface of what [`VoxelEngine::cut`] of the same engine has left.
    ///
    /// # Errors
    /// [`Cancelled`].
    ///
    /// # Tolerance
    /// Vertices lie on the tangent planes of the tool near them, which is second order in the voxel; on
    /// ridges on both. None lies outside of the stock. Every edge has two triangles.
    pub fn surface(&self, voxels: &Voxels, monitor: &dyn Monitor) -> Result<VoxelSurface, Cancelled> {
        let bricks = &voxels.bricks;
        monitor.start("surface of voxels", 3 * bricks.blocks.len() as u64);
        let sheets = Sheets::table();
        let step = |block: usize| {
            check(monitor)?;
            monitor.advance(1);
            Ok(block)
        };
        let blocks = bricks.blocks.len();
        let found = parallel::try_map(blocks, |block| Ok(self.vertices(bricks, &sheets, step(block)?)))?;
        let mut firsts = vec![0];
        firsts.extend(found.iter().scan(0, |sum, v| {
            *sum += v.places.len() as u32;
            Some(*sum)
        }));
        let mut net =
            Net { bricks, sheets: &sheets, found: &found, firsts: &firsts, pinches: HashMap::new() };
        let pinched = parallel::try_map(blocks, |block| Ok(net.pinched(step(block)?)))?.concat();
        let all = firsts[blocks];
        net.pinches = pinched.iter().enumerate().map(|(k, pinch)| (pinch.0, all + k as u32)).collect();
        let triangles = parallel::try_map(blocks, |block| Ok(net.triangles(step(block)?)))?;
        let mut surface = VoxelSurface { triangles: triangles.concat(), ..VoxelSurface::default() };
        for block in &found {
            surface.vertices.extend(&block.places);
            surface.cut_by.extend(&block.cut_by);
        }
        for (_, place, cut_by) in pinched {
            surface.vertices.push(self.within_stock(place));
            surface.cut_by.push(cut_by);
        }
        Ok(surface)
    }

    fn vertices(&self, bricks: &Bricks, sheets: &Sheets, block: usize) -> Vertices {
        let mut vertices = Vertices::default();
        for placed in bricks.of_block(block) {
            vertices.starts.push(vertices.cells.len() as u32);
            let cells = Cells::of(bricks, &placed);
            for (cell, corners) in crossed(&cells) {
                let low = bricks.lattice.place(placed.low) + offset(cell) * bricks.lattice.pitch;
                let shape = corners.shape();
                vertices.cells.push(cell as u16);
                vertices.shapes.push(shape);
                vertices.firsts.push(vertices.places.len() as u32);
                for sheet in 0..sheets.count(shape) {
                    let of_it = |&edge: &usize| is_crossed(shape, edge) && sheets.of(shape, edge) == sheet;
                    let edges = (0..12).filter(of_it);
                    let (place, cut_by, ridge) = self.vertex(&low, bricks.lattice.pitch, &corners, edges);
                    vertices.places.push(place);
                    vertices.cut_by.push(cut_by);
                    vertices.ridges.push(ridge);
                }
            }
        }
        vertices
    }

    /// The vertex of the sheet that crosses these edges of a cell whose least corner is `low`, what cuts it,
    /// and whether it stands on a ridge.
    fn vertex(
        &self,
        low: &Point3,
        pitch: f64,
        corners: &Corners,
        edges: impl Iterator<Item = usize>,
    ) -> (Point3, u32, bool) {
        let mut planes = Vec::with_capacity(12);
        let mut movers = Vec::with_capacity(12);
        for ends in edges.map(|edge| EDGES[edge]) {
            let values = ends.map(|k| corners.distances[k]);
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
        place = self.within_stock(into_cube(&place, &middle, half * (1.0 - APART)));
        let off = |k: &usize| planes[*k].normal.dot(&(place - planes[*k].point)).abs();
        let nearest = (0..planes.len()).min_by(|a, b| off(a).total_cmp(&off(b)));
        (place, nearest.map_or(NOT_CUT, |k| movers[k].cut_by), ridge)
    }

    /// The nearest place in the stock: where planes meet outside of it is no place of the material.
    fn within_stock(&self, place: Point3) -> Point3 {
        let (beyond, outward) = self.stock.foot(&place);
        if beyond > 0.0 { place - outward * beyond } else { place }
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

    /// Signed distance of the material near samples that are cut by these moves, its gradient, and which of
    /// them it comes from.
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
    sheets: &'a Sheets,
    found: &'a [Vertices],
    /// The number of the first vertex of each block.
    firsts: &'a [u32],
    /// The numbers of the vertices on faces.
    pinches: HashMap<Pinch, u32>,
}

impl Net<'_> {
    /// The block of the cell whose least sample is `at`, and which of the block's it is.
    fn cell(&self, at: [u32; 3], here: &Placed<'_>) -> Option<(usize, usize)> {
        let near = (0..3).all(|i| at[i] / 8 == here.low[i] / 8);
        let held = if near { *here } else { self.bricks.holding(at)? };
        let block = &self.found[held.block];
        let start = block.starts[held.slot] as usize;
        let end = block.starts.get(held.slot + 1).map_or(block.cells.len(), |&end| end as usize);
        let k = start + block.cells[start..end].binary_search(&(slot_of(at) as u16)).ok()?;
        Some((held.block, k))
    }

    /// The number of the vertex of the sheet that crosses an edge of the cell whose least sample is `at`, and
    /// whether it stands on a ridge.
    fn vertex(&self, at: [u32; 3], edge: usize, here: &Placed<'_>) -> Option<(u32, bool)> {
        let (block, k) = self.cell(at, here)?;
        let found = &self.found[block];
        let within = found.firsts[k] + u32::from(self.sheets.of(found.shapes[k], edge));
        Some((self.firsts[block] + within, found.ridges[within as usize]))
    }

    /// The faces of a block's cells on which two sheets meet twice, with a vertex for each of the two corners
    /// inside and what cuts it.
    fn pinched(&self, block: usize) -> Vec<(Pinch, Point3, u32)> {
        let mut pinched = Vec::new();
        for placed in self.bricks.of_block(block) {
            let cells = Cells::of(self.bricks, &placed);
            for (cell, corners) in crossed(&cells) {
                let at = cell_at(&placed, cell);
                for axis in 0..3 {
                    let Some(inside) = self.sheets.twice(corners.shape(), axis, true) else { continue };
                    let mut next = at;
                    next[axis] += 1;
                    let beyond = self.cell(next, &placed).map(|(block, k)| self.found[block].shapes[k]);
                    if beyond.is_none_or(|shape| self.sheets.twice(shape, axis, false).is_none()) {
                        continue;
                    }
                    for corner in inside {
                        let place = self.bricks.lattice.place(at)
                            + corners.beside(corner, axis) * self.bricks.lattice.pitch;
                        let sample = std::array::from_fn(|i| at[i] + (corner >> i & 1) as u32);
                        pinched.push(((at, axis, sample), place, corners.cut_by[corner]));
                    }
                }
            }
        }
        pinched
    }

    fn triangles(&self, block: usize) -> Vec<[u32; 3]> {
        let mut triangles = Vec::new();
        for placed in self.bricks.of_block(block) {
            let cells = Cells::of(self.bricks, &placed);
            for (cell, corners) in crossed(&cells) {
                let at = cell_at(&placed, cell);
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

    /// The triangles around the edge from sample `at` along `axis`: two where nothing is pinched.
    fn quad(&self, at: [u32; 3], axis: usize, outward: bool, here: &Placed<'_>, to: &mut Vec<[u32; 3]>) {
        let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut ways = [[1, 1], [0, 1], [0, 0], [1, 0]];
        if !outward {
            ways.reverse();
        }
        let cell = |[below_b, below_c]: [u32; 2]| {
            let mut cell = at;
            cell[b] = cell[b].checked_sub(below_b)?;
            cell[c] = cell[c].checked_sub(below_c)?;
            let corner = (below_b as usize) << b | (below_c as usize) << c;
            Some((cell, self.vertex(cell, edge_at(corner, axis), here)?))
        };
        let [Some(p), Some(q), Some(r), Some(s)] = ways.map(cell) else { return };
        let ring = [p, q, r, s];
        if let Some(around) = self.pinched_ring(&ring, at, axis, outward) {
            let fan = around[1..].windows(2).map(|pair| [around[0], pair[0], pair[1]]);
            to.extend(fan);
            return;
        }
        let ring = ring.map(|(_, vertex)| vertex);
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

    /// The vertices around an edge with those on its pinched faces, one of which is the first; `None` without
    /// such a face.
    fn pinched_ring(
        &self,
        ring: &[([u32; 3], (u32, bool)); 4],
        at: [u32; 3],
        axis: usize,
        outward: bool,
    ) -> Option<Vec<u32>> {
        if self.pinches.is_empty() {
            return None;
        }
        let mut inside = at;
        inside[axis] += u32::from(!outward);
        let (mut around, mut first) = (Vec::with_capacity(8), None);
        for (k, (cell, vertex)) in ring.iter().enumerate() {
            let next = ring[(k + 1) % 4].0;
            around.push(vertex.0);
            let lower = std::array::from_fn(|i| cell[i].min(next[i]));
            let across = (0..3).find(|&i| cell[i] != next[i])?;
            if let Some(&pinch) = self.pinches.get(&(lower, across, inside)) {
                first = Some(around.len());
                around.push(pinch);
            }
        }
        around.rotate_left(first?);
        Some(around)
    }

    fn place(&self, vertex: u32) -> Point3 {
        let block = self.firsts.partition_point(|&first| first <= vertex) - 1;
        self.found[block].places[(vertex - self.firsts[block]) as usize]
    }
}

/// The least sample of a cell of a brick.
fn cell_at(placed: &Placed<'_>, cell: usize) -> [u32; 3] {
    let at = [cell % 8, cell / 8 % 8, cell / 64];
    std::array::from_fn(|i| placed.low[i] + at[i] as u32)
}
