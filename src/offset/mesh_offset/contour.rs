//! The level set as triangles: a vertex for each piece of it in a cell, a quadrilateral around each edge of the lattice that
//! crosses it.
//!
//! In a face of a cell with four crossings, crossings are joined around the corners that are too near to the mesh, from both
//! sides alike. Then each piece in a cell is one closed ring of crossings.

use super::OffsetError;
use super::bricks::{Brick, Bricks, CORNERS, SIDE, cell_number, cell_place, corner_index, corners_of};
use super::level_set::LevelSet;
use super::triangle::shape;
use super::vertex::{Around, Vertex, vertex};
use geometry::{Point3, Vector3};
use work::monitor::{Monitor, check};
use work::parallel;

/// Crossings of edges are sought to this share of a cell: beside a valley a lesser one would tell the wrong side.
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
    /// Whether it lies where the surface was cut off.
    pub cut: Vec<bool>,
}

/// The edges of a cell: two corners each. Edge `4 a + k` runs along axis `a`.
const EDGES: [[usize; 2]; 12] =
    [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];

/// The faces of a cell: four corners each, in their order around it.
const FACES: [[usize; 4]; 6] =
    [[0, 2, 6, 4], [1, 3, 7, 5], [0, 1, 5, 4], [2, 3, 7, 6], [0, 1, 3, 2], [4, 5, 7, 6]];

/// The edge between two corners.
fn edge_between(a: usize, b: usize) -> usize {
    let (low, axis) = (a.min(b), (a ^ b).trailing_zeros() as usize);
    // The bits of the lower corner without that of the axis.
    let rest = match axis {
        0 => low >> 1,
        1 => (low & 1) | (low >> 2) << 1,
        _ => low & 3,
    };
    4 * axis + rest
}

/// For each edge of a cell the number of the piece of surface that crosses it, `NO_PIECE` where none does, and the number of
/// pieces. `near` tells which corners are nearer to the mesh than the level set.
fn pieces(near: [bool; 8]) -> ([u8; 12], usize) {
    let mut of: [usize; 12] = std::array::from_fn(|e| e);
    let crossed = |e: usize| near[EDGES[e][0]] != near[EDGES[e][1]];
    let mut join = |a: usize, b: usize| {
        let (from, to) = (of[a].max(of[b]), of[a].min(of[b]));
        of.iter_mut().filter(|x| **x == from).for_each(|x| *x = to);
    };
    for face in FACES {
        let edges: [usize; 4] = std::array::from_fn(|k| edge_between(face[k], face[(k + 1) % 4]));
        let crossing: Vec<usize> = (0..4).filter(|&k| crossed(edges[k])).collect();
        match crossing[..] {
            [a, b] => join(edges[a], edges[b]),
            // Corner k + 1 lies between sides k and k + 1.
            [_, _, _, _] => {
                (0..4).filter(|&k| near[face[(k + 1) % 4]]).for_each(|k| join(edges[k], edges[(k + 1) % 4]))
            }
            _ => {}
        }
    }
    let mut numbers = [NO_PIECE; 12];
    let mut count = 0;
    for e in (0..12).filter(|&e| crossed(e)) {
        // The least edge of a piece stands for it.
        if of[e] == e {
            numbers[e] = count;
            count += 1;
        }
        numbers[e] = numbers[of[e]];
    }
    (numbers, usize::from(count))
}

const NO_PIECE: u8 = u8::MAX;

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
    let found = parallel::try_map(count, |k| step(k).map(|k| vertices(level, bricks, &bricks.bricks[k])))?;
    let mut firsts = vec![0];
    firsts.extend(found.iter().scan(0, |sum, v| {
        *sum += v.vertices.len() as u32;
        Some(*sum)
    }));
    let all: Vec<Vertex> = found.iter().flat_map(|v| v.vertices.iter().copied()).collect();
    let net = Net { bricks, found: &found, firsts: &firsts, all: &all };
    let triangles = parallel::try_map(count, |k| step(k).map(|k| net.triangles(k)))?;
    Ok(Contour {
        vertices: all.iter().map(|v| v.point).collect(),
        triangles: triangles.concat(),
        angles: all.iter().map(|v| v.angle).collect(),
        cut: vec![false; all.len()],
    })
}

fn near_corners(brick: &Brick, cell: u16) -> [bool; 8] {
    corners_of(cell_place(cell)).map(|c| brick.values[c] < 0.0)
}

fn vertices(level: &LevelSet, bricks: &Bricks, brick: &Brick) -> Vertices {
    let lattice = &bricks.lattice;
    let mut known: Vec<Option<Point3>> = vec![None; 3 * CORNERS * CORNERS * CORNERS];
    let mut found = Vertices::default();
    for &cell in &brick.cells {
        found.starts.push(found.vertices.len() as u32);
        let place = cell_place(cell);
        let (numbers, count) = pieces(near_corners(brick, cell));
        let corner = |k: usize| -> [usize; 3] { std::array::from_fn(|i| place[i] + (k >> i & 1)) };
        let at = |c: [usize; 3]| lattice.corner(std::array::from_fn(|i| brick.low[i] + c[i] as u32));
        let mut crossings: Vec<Vec<Point3>> = vec![Vec::new(); count];
        for (e, &number) in numbers.iter().enumerate().filter(|(_, n)| **n != NO_PIECE) {
            let ends = EDGES[e].map(corner);
            let slot = 3 * corner_index(ends[0]) + e / 4;
            let x = *known[slot].get_or_insert_with(|| {
                crossing(level, ends.map(at), ends.map(|c| brick.values[corner_index(c)]))
            });
            crossings[usize::from(number)].push(x);
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
        let (numbers, _) = pieces(near_corners(brick, cell));
        let number = numbers[edge];
        (number != NO_PIECE).then(|| self.firsts[held] + self.found[held].starts[slot] + u32::from(number))
    }

    fn triangles(&self, k: usize) -> Vec<[u32; 3]> {
        let brick = &self.bricks.bricks[k];
        let mut triangles = Vec::new();
        for &cell in &brick.cells {
            let near = near_corners(brick, cell);
            let place = cell_place(cell);
            let at: [u32; 3] = std::array::from_fn(|i| brick.low[i] + place[i] as u32);
            for axis in (0..3).filter(|&axis| near[1 << axis] != near[0]) {
                self.quadrilateral(at, axis, near[0], k, &mut triangles);
            }
        }
        triangles
    }

    /// The two triangles around the edge from corner `at` along `axis`; `outward` where the mesh is nearer to that corner.
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

    /// Whether a quadrilateral is divided from its first to its third corner: valleys run along edges, and three corners on
    /// one of them make no triangle.
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

/// Greatest difference between the distance from the mesh and that of the level set in the middles of triangles and edges,
/// mm, away from where the surface was cut off.
///
/// # Errors
/// [`OffsetError::Cancelled`].
pub(super) fn deviation(
    level: &LevelSet,
    contour: &Contour,
    monitor: &dyn Monitor,
) -> Result<f64, OffsetError> {
    const TOGETHER: usize = 1024;
    let chunks: Vec<&[[u32; 3]]> = contour.triangles.chunks(TOGETHER).collect();
    monitor.start("measuring the offset surface", chunks.len() as u64);
    let worst = parallel::try_map(chunks.len(), |k| {
        check(monitor)?;
        monitor.advance(1);
        let of_triangle = |corners: &[u32; 3]| {
            let [a, b, c] = corners.map(|v| contour.vertices[v as usize].coords);
            let middles = [(a + b + c) / 3.0, (a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5];
            // Neighbours share sides; each is looked at where it rises in number.
            let asked = [true, corners[0] < corners[1], corners[1] < corners[2], corners[2] < corners[0]];
            let asked = middles.iter().zip(asked).filter(|(_, asked)| *asked);
            asked.map(|(m, _)| level.excess(&Point3::from(*m)).abs()).fold(0.0, f64::max)
        };
        let inner = chunks[k].iter().filter(|t| t.iter().all(|&v| !contour.cut[v as usize]));
        Ok::<_, OffsetError>(inner.map(of_triangle).fold(0.0, f64::max))
    })?;
    Ok(worst.into_iter().fold(0.0, f64::max))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_and_faces_agree() {
        for (e, [a, b]) in EDGES.iter().enumerate() {
            assert_eq!(edge_between(*a, *b), e);
            assert_eq!(edge_between(*b, *a), e);
        }
        for face in FACES {
            for k in 0..4 {
                assert_eq!((face[k] ^ face[(k + 1) % 4]).count_ones(), 1);
            }
        }
    }

    #[test]
    fn every_piece_is_a_ring() {
        for mask in 0..256usize {
            let near = std::array::from_fn(|k| mask >> k & 1 == 1);
            let (numbers, count) = pieces(near);
            for n in 0..count {
                let own = numbers.iter().filter(|&&x| usize::from(x) == n).count();
                assert!((3..=12).contains(&own), "{mask:08b}: piece {n} has {own} crossings");
            }
            // Opposite corners alone are two pieces.
            if mask == 0b1000_0001 {
                assert_eq!(count, 2);
            }
        }
    }
}
