//! Closes the seams that rounding leaves in a mesh: vertices that are one but for rounding become one, and
//! edges that a vertex of a neighbour lies on are split there.
//!
//! Enters: triangles whose equal vertices are merged, and a tolerance (mm) within which rounding may have moved
//! vertices. Only vertices at open edges are looked at, so that what hangs together already stays as it is.
//! "Close to" is not transitive: every vertex goes to one that keeps its place, no farther than the tolerance.
//!
//! Left open is what the tolerance cannot tell apart: around sides no longer than twice the tolerance nothing is
//! merged (a thin wall would collapse), nor where a triangle would turn over, where triangles do not face the same
//! side as given, where two sheets that lie on each other would be joined along their rims, or where a third triangle
//! would come to an edge of two.

mod junctions;
#[cfg(test)]
mod tests;

use std::collections::{HashMap, HashSet};
use std::hash::BuildHasherDefault;

use super::RepairNotes;
use super::repair::{CoordinateHasher, Key, Side, Sides, Soup, has_area};
use crate::{Point3, Vector3};

/// Merging is taken back where it does harm, and looked at anew, so many times. Each time usually takes back all
/// that there is; beyond that nothing is merged.
const MOST_ROUNDS: usize = 16;

/// Cells of vertices are so many tolerances wide: most vertices then look into one cell only.
const CELL_OVER_TOLERANCE: f64 = 4.0;

type Hashed = BuildHasherDefault<CoordinateHasher>;

/// Welds the triangles of `soup`, whose sides are `sides`; true where that changed any. `notes` get what was done,
/// and how far it moved the surface at most.
pub(super) fn weld(
    vertices: &[Point3],
    soup: &mut Soup,
    sides: &Sides,
    tolerance: f64,
    notes: &mut RepairNotes,
) -> bool {
    let open = open_vertices(vertices.len(), sides);
    if open.is_empty() {
        return false;
    }
    let heads = join(vertices, &soup.faces, &open, tolerance);
    let mut moved: f64 = 0.0;
    for &v in &open {
        let head = heads[v as usize];
        if head != v {
            notes.welded_vertices += 1;
            moved = moved.max((vertices[head as usize] - vertices[v as usize]).norm());
        }
    }
    soup.faces.iter_mut().flatten().for_each(|v| *v = heads[*v as usize]);
    let (split, bent) = junctions::split(vertices, soup, tolerance);
    notes.split_edges = split;
    notes.moved = moved + bent;
    notes.welded_vertices + split > 0
}

/// The vertices at edges with one triangle, ascending.
fn open_vertices(vertices: usize, sides: &Sides) -> Vec<u32> {
    let mut is_open = vec![false; vertices];
    for (low, edge) in sides.edges() {
        if let [side] = edge {
            is_open[low as usize] = true;
            is_open[side.other as usize] = true;
        }
    }
    (0..vertices as u32).filter(|&v| is_open[v as usize]).collect()
}

/// For each vertex the one that it becomes.
fn join(vertices: &[Point3], faces: &[[u32; 3]], open: &[u32], tolerance: f64) -> Vec<u32> {
    let mut heads: Vec<u32> = (0..vertices.len() as u32).collect();
    let crowded = Crowded::of(vertices, faces, tolerance);
    let mut kept = Kept::new(vertices, tolerance);
    for &v in open.iter().filter(|&&v| !crowded.is_near(&vertices[v as usize])) {
        match kept.nearest(v) {
            Some(head) => heads[v as usize] = head,
            None => kept.add(v),
        }
    }
    for _ in 0..MOST_ROUNDS {
        let harmed = harmed(vertices, faces, &heads, tolerance);
        let mut is_done = true;
        for &v in open {
            let head = &mut heads[v as usize];
            if *head != v && harmed[*head as usize] {
                *head = v;
                is_done = false;
            }
        }
        if is_done {
            return heads;
        }
    }
    (0..vertices.len() as u32).collect()
}

/// The cell of a place.
fn cell(p: &Point3, width: f64) -> [i64; 3] {
    [p.x, p.y, p.z].map(|x| (x / width).floor() as i64)
}

/// The cells that a cube of half width `reach` around a place meets.
fn cells_around(p: &Point3, reach: f64, width: f64) -> impl Iterator<Item = Key> {
    let aside = Vector3::repeat(reach);
    let (low, high) = (cell(&(p - aside), width), cell(&(p + aside), width));
    (low[0]..=high[0]).flat_map(move |x| {
        (low[1]..=high[1]).flat_map(move |y| (low[2]..=high[2]).map(move |z| key([x, y, z])))
    })
}

fn key(cell: [i64; 3]) -> Key {
    Key(cell.map(|i| i as u64))
}

/// Where triangles have sides so short that both ends may be the same vertex but for rounding.
struct Crowded {
    tolerance: f64,
    cells: HashSet<Key, Hashed>,
}

impl Crowded {
    fn of(vertices: &[Point3], faces: &[[u32; 3]], tolerance: f64) -> Self {
        let mut cells = HashSet::default();
        for face in faces {
            let corners = face.map(|v| vertices[v as usize]);
            for k in 0..3 {
                let ends = [corners[k], corners[(k + 1) % 3]];
                if (ends[1] - ends[0]).norm() <= 2.0 * tolerance {
                    cells.extend(ends.iter().map(|p| key(cell(p, tolerance))));
                }
            }
        }
        Self { tolerance, cells }
    }

    /// True within the tolerance of such ends, and a little farther.
    fn is_near(&self, p: &Point3) -> bool {
        !self.cells.is_empty()
            && cells_around(p, self.tolerance, self.tolerance).any(|cell| self.cells.contains(&cell))
    }
}

/// Vertices that keep their place, in cells. None is within the tolerance of another, so that a cell holds few.
struct Kept<'a> {
    vertices: &'a [Point3],
    tolerance: f64,
    width: f64,
    /// The last vertex of each cell.
    last: HashMap<Key, u32, Hashed>,
    /// The one before a vertex in its cell.
    before: HashMap<u32, u32, Hashed>,
}

impl<'a> Kept<'a> {
    fn new(vertices: &'a [Point3], tolerance: f64) -> Self {
        let width = CELL_OVER_TOLERANCE * tolerance;
        Self { vertices, tolerance, width, last: HashMap::default(), before: HashMap::default() }
    }

    fn add(&mut self, v: u32) {
        let place = key(cell(&self.vertices[v as usize], self.width));
        if let Some(before) = self.last.insert(place, v) {
            self.before.insert(v, before);
        }
    }

    /// The nearest within the tolerance of a vertex.
    fn nearest(&self, v: u32) -> Option<u32> {
        let p = &self.vertices[v as usize];
        let mut found: Option<(f64, u32)> = None;
        for cell in cells_around(p, self.tolerance, self.width) {
            let mut next = self.last.get(&cell);
            while let Some(&w) = next {
                let distance = (self.vertices[w as usize] - p).norm();
                if distance <= self.tolerance && found.is_none_or(|best| (distance, w) < best) {
                    found = Some((distance, w));
                }
                next = self.before.get(&w);
            }
        }
        found.map(|(_, w)| w)
    }
}

/// Marks the vertices at which merging others with them does harm.
fn harmed(vertices: &[Point3], faces: &[[u32; 3]], heads: &[u32], tolerance: f64) -> Vec<bool> {
    let mut harmed = vec![false; vertices.len()];
    let joined: Vec<[u32; 3]> = faces.iter().map(|face| face.map(|v| heads[v as usize])).collect();
    for (face, now) in faces.iter().zip(&joined).filter(|(face, now)| face != now) {
        if !keeps_its_side(vertices, face, now) {
            now.iter().for_each(|&head| harmed[head as usize] = true);
        }
    }
    let sides = Sides::of(vertices.len(), &joined);
    // The edge as it was before.
    let was = |side: &Side| {
        let (t, k) = (side.slot as usize / 3, side.slot as usize % 3);
        let (a, b) = (faces[t][k], faces[t][(k + 1) % 3]);
        (a.min(b), a.max(b))
    };
    for (low, edge) in sides.edges().filter(|(_, edge)| edge.len() > 1) {
        // Two triangles with the same corners: a wall without thickness, or a sheet on a sheet.
        for pair in edge.windows(2).filter(|pair| pair[0].opposite == pair[1].opposite) {
            [low, pair[0].other, pair[0].opposite].iter().for_each(|&head| harmed[head as usize] = true);
        }
        let mut before: Vec<(u32, u32)> = edge.iter().map(was).collect();
        before.sort_unstable();
        if before.first() == before.last() {
            continue;
        }
        let forward =
            edge.iter().filter(|side| joined[side.slot as usize / 3][side.slot as usize % 3] == low);
        let agree = 2 * forward.count() == edge.len();
        let does_harm = match edge {
            [a, b] => are_folded(vertices, [low, a.other], [a.opposite, b.opposite], tolerance),
            _ => before.windows(2).any(|pair| pair[0] == pair[1]),
        };
        if does_harm || !agree {
            [low, edge[0].other].iter().for_each(|&head| harmed[head as usize] = true);
        }
    }
    harmed
}

fn doubled_area(vertices: &[Point3], face: &[u32; 3]) -> Vector3 {
    let [a, b, c] = face.map(|v| vertices[v as usize]);
    (b - a).cross(&(c - a))
}

/// True where a triangle has an area and faces the side that another does.
fn keeps_its_side(vertices: &[Point3], face: &[u32; 3], now: &[u32; 3]) -> bool {
    has_area(now.map(|v| vertices[v as usize]))
        && doubled_area(vertices, face).dot(&doubled_area(vertices, now)) > 0.0
}

/// True where two triangles at an edge lie on each other, as far as corners that each moved by the tolerance can
/// tell.
fn are_folded(vertices: &[Point3], edge: [u32; 2], opposite: [u32; 2], tolerance: f64) -> bool {
    let [from, to] = edge.map(|v| vertices[v as usize]);
    let along = (to - from).normalize();
    let [a, b] = opposite.map(|v| {
        let way = vertices[v as usize] - from;
        way - along * way.dot(&along)
    });
    let farther = a.norm().max(b.norm());
    a.dot(&b) > 0.0 && a.cross(&b).norm() <= 2.0 * tolerance * farther
}
