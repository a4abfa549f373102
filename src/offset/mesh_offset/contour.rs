//! The level set as triangles: a vertex for each piece of it in a cell, a quadrilateral around each edge of
//! the lattice that crosses it.
//!
//! Inside is what is nearer to the mesh; each sheet in a cell is one ring of crossings
//! ([`geometry::sheets`]).

use super::OffsetError;
use super::bricks::{Brick, Bricks, CORNERS, SIDE, cell_number, cell_place, corner_index, corners_of};
use super::level_set::LevelSet;
use super::triangle::shape;
use super::vertex::{Around, Vertex, vertex};
use geometry::sheets::{EDGES, Sheets, edge_at, edge_between, is_crossed};
use geometry::{Point3, Vector3};
use work::monitor::{Monitor, check};
use work::parallel;

/// Crossings of edges are sought to this share of a cell: beside a valley a lesser one would tell the wrong
/// side.
const NEAR: f64 = 1e-7;

/// Looks along an edge at most.
const LOOKS: usize = 24;

/// Triangles and what is known at their vertices.
#[derive(Debug, Clone, Default)]
pub(super) struct Contour {
    pub vertices: Vec<Point3>,
    pub triangles: Vec<[u32; 3]>,
    /// Angle between the directions to the nearest points of the mesh, rad; 0 for one.
    pub angles: Vec<f64>,
}

/// The vertices of one brick.
#[derive(Default)]
struct Vertices {
    vertices: Vec<Vertex>,
    /// Number of the first vertex of each of its crossed cells.
    starts: Vec<u32>,
}

/// The whole level set.
///
/// # Errors
/// [`OffsetError::Cancelled`].
pub(super) fn contour(
    level: &LevelSet,
    bricks: &Bricks,
    monitor: &dyn Monitor,
) -> Result<Contour, OffsetError> {
    let count = bricks.bricks.len();
    monitor.start("offset surface", 2 * count as u64);
    let step = |k: usize| {
        check(monitor)?;
        monitor.advance(1);
        Ok::<_, OffsetError>(k)
    };
    let sheets = Sheets::table();
    let found =
        parallel::try_map(count, |k| step(k).map(|k| vertices(level, bricks, &sheets, &bricks.bricks[k])))?;
    let mut firsts = vec![0];
    firsts.extend(found.iter().scan(0, |sum, v| {
        *sum += v.vertices.len() as u32;
        Some(*sum)
    }));
    let all: Vec<Vertex> = found.iter().flat_map(|v| v.vertices.iter().copied()).collect();
    let net = Net { bricks, sheets: &sheets, found: &found, firsts: &firsts, all: &all };
    let triangles = parallel::try_map(count, |k| step(k).map(|k| net.triangles(k)))?;
    Ok(Contour {
        vertices: all.iter().map(|v| v.point).collect(),
        triangles: triangles.concat(),
        angles: all.iter().map(|v| v.angle).collect(),
    })
}

/// Which corners of a cell are nearer to the mesh than the level set, as bits.
fn shape_of(brick: &Brick, cell: u16) -> u8 {
    let near = corners_of(cell_place(cell)).map(|c| brick.values[c] < 0.0);
    near.iter().rev().fold(0, |shape, &near| shape << 1 | u8::from(near))
}

fn vertices(level: &LevelSet, bricks: &Bricks, sheets: &Sheets, brick: &Brick) -> Vertices {
    let lattice = &bricks.lattice;
    let mut known: Vec<Option<Point3>> = vec![None; 3 * CORNERS * CORNERS * CORNERS];
    let mut found = Vertices::default();
    for &cell in &brick.cells {
        found.starts.push(found.vertices.len() as u32);
        let place = cell_place(cell);
        let shape = shape_of(brick, cell);
        let corner = |k: usize| -> [usize; 3] { std::array::from_fn(|i| place[i] + (k >> i & 1)) };
        let at = |c: [usize; 3]| lattice.corner(std::array::from_fn(|i| brick.low[i] + c[i] as u32));
        let mut crossings: Vec<Vec<Point3>> = vec![Vec::new(); sheets.count(shape).into()];
        for e in (0..12).filter(|&e| is_crossed(shape, e)) {
            let ends = EDGES[e].map(corner);
            let slot = 3 * corner_index(ends[0]) + e / 4;
            let x = *known[slot].get_or_insert_with(|| {
                crossing(level, ends.map(at), ends.map(|c| brick.values[corner_index(c)]))
            });
            crossings[usize::from(sheets.of(shape, e))].push(x);
        }
        let half = 0.5 * lattice.cell;
        let middle = at(place) + Vector3::from_element(half);
        let around = Around { centre: middle, half, taken: &|x| bricks.crosses(x) };
        found.vertices.extend(crossings.iter().map(|piece| vertex(level, piece, &around)));
    }
    found
}

/// Where the level set crosses an edge of the lattice, from the values at its ends, to [`NEAR`].
fn crossing(level: &LevelSet, ends: [Point3; 2], values: [f64; 2]) -> Point3 {
    let along = ends[1] - ends[0];
    let near = NEAR * along.norm();
    let mut range = [(0.0, values[0]), (1.0, values[1])];
    let mut x = ends[0];
    for k in 0..LOOKS {
        let [a, b] = range;
        let share = if k % 3 == 2 { 0.5 } else { a.1 / (a.1 - b.1) };
        let s = a.0 + (b.0 - a.0) * share;
        x = ends[0] + along * s;
        let value = level.excess(&x);
        if value.abs() <= near {
            break;
        }
        range[usize::from((value < 0.0) != (values[0] < 0.0))] = (s, value);
    }
    x
}

/// All vertices, to be joined.
struct Net<'a> {
    bricks: &'a Bricks,
    sheets: &'a Sheets,
    found: &'a [Vertices],
    /// The number of the first vertex of each brick.
    firsts: &'a [u32],
    all: &'a [Vertex],
}

impl Net<'_> {
    /// The vertex on the piece that crosses edge `edge` of the cell whose least corner is `at`.
    fn vertex(&self, at: [u32; 3], edge: usize, here: usize) -> Option<u32> {
        let low = at.map(|x| x / SIDE as u32 * SIDE as u32);
        let held = if low == self.bricks.bricks[here].low { here } else { self.bricks.find(low)? };
        let brick = &self.bricks.bricks[held];
        let cell = cell_number(std::array::from_fn(|i| (at[i] - low[i]) as usize));
        let slot = brick.cells.binary_search(&cell).ok()?;
        let shape = shape_of(brick, cell);
        let number = || self.found[held].starts[slot] + u32::from(self.sheets.of(shape, edge));
        is_crossed(shape, edge).then(|| self.firsts[held] + number())
    }

    fn triangles(&self, k: usize) -> Vec<[u32; 3]> {
        let brick = &self.bricks.bricks[k];
        let mut triangles = Vec::new();
        for &cell in &brick.cells {
            let shape = shape_of(brick, cell);
            let place = cell_place(cell);
            let at: [u32; 3] = std::array::from_fn(|i| brick.low[i] + place[i] as u32);
            for axis in (0..3).filter(|&axis| is_crossed(shape, edge_at(0, axis))) {
                self.quadrilateral(at, axis, shape & 1 == 1, k, &mut triangles);
            }
        }
        triangles
    }

    /// The two triangles around the edge from corner `at` along `axis`; `outward` where the mesh is nearer to
    /// that corner.
    fn quadrilateral(&self, at: [u32; 3], axis: usize, outward: bool, here: usize, to: &mut Vec<[u32; 3]>) {
        let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
        let around = [(1, 1), (0, 1), (0, 0), (1, 0)].map(|(below_b, below_c)| {
            let mut cell = at;
            cell[b] = cell[b].checked_sub(below_b)?;
            cell[c] = cell[c].checked_sub(below_c)?;
            // In the cell below along an axis the edge is on the upper side.
            let corner = (below_b as usize) << b | (below_c as usize) << c;
            self.vertex(cell, edge_between(corner, corner | 1 << axis), here)
        });
        let [Some(p), Some(q), Some(r), Some(s)] = around else { return };
        let [p, q, r, s] = if outward { [p, q, r, s] } else { [p, s, r, q] };
        to.extend(if self.straight([p, q, r, s]) { [[p, q, r], [p, r, s]] } else { [[p, q, s], [q, r, s]] });
    }

    /// Whether a quadrilateral is divided from its first to its third corner: valleys run along edges, and
    /// three corners on one of them make no triangle.
    fn straight(&self, ring: [u32; 4]) -> bool {
        let corner = ring.map(|v| self.all[v as usize]);
        let deep = corner.map(|v| v.angle > 0.0);
        match deep.iter().filter(|d| **d).count() {
            2 if deep[0] && deep[2] => return true,
            2 if deep[1] && deep[3] => return false,
            _ => {}
        }
        let worst = |a: [usize; 3], b: [usize; 3]| {
            [a, b].map(|t| shape(t.map(|k| corner[k].point))).into_iter().fold(1.0, f64::min)
        };
        worst([0, 1, 2], [0, 2, 3]) >= worst([0, 1, 3], [1, 2, 3])
    }
}
