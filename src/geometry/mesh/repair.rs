//! The way from a soup of triangles to a [`TriangleMesh`]: check, merge, drop, weld, pair up, orient.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

use super::weld::weld;
use super::{Junctions, MeshError, NONE, Outside, RepairNotes, TriangleMesh};
use crate::{Aabb, MAX_COORDINATE, Point3, Vector3};

/// A triangle counts as degenerate where twice its area is below this share of its longest side
/// squared: the rounding error of the cross product itself, so that the normal of what is kept
/// points the right way. Greater would drop honest slivers and open gaps between their neighbours.
const NO_AREA: f64 = 8.0 * f64::EPSILON;

/// An open mesh whose vertical projection (signed) is below this share of its area is judged by
/// its volume, as a solid with small holes or open seams; above it, by whether it faces up.
/// Greater takes steep walls for solids, less turns a solid over for a hole in its top.
const NEARLY_CLOSED: f64 = 0.01;

/// A volume below this share of area × size is rounding, and decides nothing.
const NO_VOLUME: f64 = 1e-9;

/// Triangles that 32-bit indices can count: three sides each, and one value that stands for none.
const MAX_TRIANGLES: usize = (u32::MAX / 3) as usize;

type Repaired = (TriangleMesh, RepairNotes, Vec<[u32; 3]>);

/// See [`TriangleMesh::with_sources`].
pub(super) fn repair(
    vertices: Vec<Point3>,
    triangles: Vec<[u32; 3]>,
    outside: Outside,
    junctions: Junctions,
    tolerance: f64,
) -> Result<Repaired, MeshError> {
    check(&vertices, &triangles)?;
    let mut notes = RepairNotes::default();
    let (vertices, new_index) = merge(&vertices, &triangles, &mut notes);
    // `faces` are in merged indices, `sources` in the caller's, `origin` the caller's numbers.
    let mut soup = Soup::default();
    for (t, source) in triangles.iter().enumerate() {
        let face = source.map(|i| new_index[i as usize]);
        if has_area(face.map(|i| vertices[i as usize])) {
            soup.push(face, *source, t);
        } else {
            notes.dropped_degenerate += 1;
        }
    }
    drop((triangles, new_index));
    if soup.faces.is_empty() {
        return Err(MeshError::Empty { dropped: notes.dropped_degenerate });
    }
    let mut sides = Sides::of(vertices.len(), &soup.faces);
    let duplicate = sides.duplicates(soup.faces.len());
    if let Some(duplicate) = duplicate {
        let before = soup.faces.len();
        soup = soup.without(&duplicate);
        notes.dropped_duplicates = before - soup.faces.len();
        sides = Sides::of(vertices.len(), &soup.faces);
    }
    if tolerance > 0.0 && weld(&vertices, &mut soup, &sides, tolerance, &mut notes) {
        sides = Sides::of(vertices.len(), &soup.faces);
    }
    let mut opened = Opened { junctions, edges: 0, first: None };
    let (mut neighbours, consistent) = sides.pair_up(&vertices, &soup, &mut opened)?;
    drop(sides);
    if !consistent {
        notes.flipped_triangles = orient(&vertices, &mut soup, &mut neighbours, &mut opened)?;
    }
    notes.opened_edges = opened.edges;
    if outside == Outside::Found && opened.edges > 0 {
        notes.flipped_triangles += face_pieces(&vertices, &mut soup, &mut neighbours);
    } else if outside == Outside::Found
        && faces_wrong_way(&vertices, soup.faces.iter(), is_closed(&neighbours))
    {
        (0..soup.faces.len()).for_each(|t| soup.flip(t, &mut neighbours));
        notes.turned_over = true;
    }
    let vertices = drop_unused(vertices, &mut soup.faces);
    let bounds = Aabb::of(&vertices);
    let junction = opened.first.map(Box::new);
    let moved = notes.moved;
    let mesh = TriangleMesh { vertices, triangles: soup.faces, neighbours, bounds, junction, moved };
    Ok((mesh, notes, soup.sources))
}

/// Edges at which triangles make no surface.
struct Opened {
    junctions: Junctions,
    edges: usize,
    first: Option<MeshError>,
}

impl Opened {
    /// Leaves an edge open, or refuses it.
    fn note(&mut self, refusal: MeshError) -> Result<(), MeshError> {
        if self.junctions == Junctions::Refused {
            return Err(refusal);
        }
        self.edges += 1;
        self.first.get_or_insert(refusal);
        Ok(())
    }
}

/// Triangles on their way through the repair.
#[derive(Default)]
pub(super) struct Soup {
    /// Corners, as indices of merged vertices.
    pub faces: Vec<[u32; 3]>,
    /// Corners, as indices of the vertices given.
    pub sources: Vec<[u32; 3]>,
    /// Place among the triangles given.
    pub origin: Vec<u32>,
}

impl Soup {
    pub fn push(&mut self, face: [u32; 3], source: [u32; 3], origin: usize) {
        self.faces.push(face);
        self.sources.push(source);
        self.origin.push(origin as u32);
    }

    fn without(self, dropped: &[bool]) -> Self {
        let mut kept = Self::default();
        for t in (0..self.faces.len()).filter(|&t| !dropped[t]) {
            kept.push(self.faces[t], self.sources[t], self.origin[t] as usize);
        }
        kept
    }

    /// Turns triangle `t` over: swaps its last two corners, hence its first and last sides.
    fn flip(&mut self, t: usize, neighbours: &mut [[u32; 3]]) {
        self.faces[t].swap(1, 2);
        self.sources[t].swap(1, 2);
        neighbours[t].swap(0, 2);
    }
}

fn coordinates(p: &Point3) -> [f64; 3] {
    [p.x, p.y, p.z]
}

fn check(vertices: &[Point3], triangles: &[[u32; 3]]) -> Result<(), MeshError> {
    if triangles.is_empty() {
        return Err(MeshError::Empty { dropped: 0 });
    }
    if triangles.len() > MAX_TRIANGLES {
        return Err(MeshError::TooMany { triangles: triangles.len(), limit: MAX_TRIANGLES });
    }
    for (triangle, corners) in triangles.iter().enumerate() {
        for &index in corners {
            let Some(p) = vertices.get(index as usize) else {
                return Err(MeshError::IndexOutOfRange { triangle, index, vertices: vertices.len() });
            };
            let point = coordinates(p);
            if point.iter().any(|x| !x.is_finite()) {
                return Err(MeshError::NotFinite { triangle, point });
            }
            if point.iter().any(|x| x.abs() > MAX_COORDINATE) {
                return Err(MeshError::TooFar { triangle, point });
            }
        }
    }
    Ok(())
}

/// Hashes three coordinates in a few operations. The standard hasher takes longer than all the
/// rest of the repair; it guards against chosen collisions, which here only cost their author time.
#[derive(Default)]
pub(super) struct CoordinateHasher(u64);

impl Hasher for CoordinateHasher {
    fn finish(&self) -> u64 {
        self.0
    }
    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|&b| self.write_u64(u64::from(b)));
    }
    fn write_u64(&mut self, x: u64) {
        // A multiplication mixes upward only; the shift brings the high bits of doubles, the only
        // ones that differ between round numbers, down to where the table looks.
        let mixed = (self.0.rotate_left(23) ^ x).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        self.0 = mixed ^ (mixed >> 29);
    }
}

/// Three numbers as a key: of coordinates their bits, where −0 counts as 0.
#[derive(PartialEq, Eq)]
pub(super) struct Key(pub [u64; 3]);

impl Key {
    fn of(p: &Point3) -> Self {
        Self(coordinates(p).map(|x| (x + 0.0).to_bits()))
    }
}

impl std::hash::Hash for Key {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.0.iter().for_each(|&x| state.write_u64(x));
    }
}

/// Merges equal vertices among those in use, in their order. Leaves the merged vertices and, for
/// each vertex given, its new index ([`NONE`] when not in use).
fn merge(vertices: &[Point3], triangles: &[[u32; 3]], notes: &mut RepairNotes) -> (Vec<Point3>, Vec<u32>) {
    let mut used = vec![false; vertices.len()];
    triangles.iter().flatten().for_each(|&i| used[i as usize] = true);
    let mut merged: Vec<Point3> = Vec::with_capacity(vertices.len().min(triangles.len()));
    let mut seen: HashMap<Key, u32, BuildHasherDefault<CoordinateHasher>> =
        HashMap::with_capacity_and_hasher(merged.capacity(), BuildHasherDefault::default());
    let mut new_index = vec![NONE; vertices.len()];
    for (i, p) in vertices.iter().enumerate().filter(|&(i, _)| used[i]) {
        let next = merged.len() as u32;
        let index = *seen.entry(Key::of(p)).or_insert(next);
        if index == next {
            merged.push(*p);
        } else {
            notes.merged_vertices += 1;
        }
        new_index[i] = index;
    }
    (merged, new_index)
}

pub(super) fn has_area([a, b, c]: [Point3; 3]) -> bool {
    let (ab, bc, ca) = (b - a, c - b, a - c);
    let longest = ab.norm_squared().max(bc.norm_squared()).max(ca.norm_squared());
    // The cross product at the corner opposite the longest side loses least to rounding.
    let cross = if longest == bc.norm_squared() {
        ca.cross(&ab)
    } else if longest == ca.norm_squared() {
        ab.cross(&bc)
    } else {
        bc.cross(&ca)
    };
    cross.norm() > NO_AREA * longest
}

/// One side of one triangle, filed under the lower of its two vertices.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Side {
    /// The higher of its two vertices.
    pub other: u32,
    /// The triangle's third corner.
    pub opposite: u32,
    /// 3 × triangle + side.
    pub slot: u32,
}

/// All sides, sorted by edge.
pub(super) struct Sides {
    sides: Vec<Side>,
    /// Sides of lower vertex `v`: `starts[v]..starts[v + 1]`.
    starts: Vec<u32>,
}

impl Sides {
    pub fn of(vertices: usize, faces: &[[u32; 3]]) -> Self {
        let ends = |face: &[u32; 3], k: usize| (face[k], face[(k + 1) % 3], face[(k + 2) % 3]);
        let mut starts = vec![0u32; vertices + 1];
        for face in faces {
            for k in 0..3 {
                let (a, b, _) = ends(face, k);
                starts[a.min(b) as usize + 1] += 1;
            }
        }
        for v in 0..vertices {
            starts[v + 1] += starts[v];
        }
        let mut free = starts.clone();
        let mut sides = vec![Side { other: 0, opposite: 0, slot: 0 }; 3 * faces.len()];
        for (t, face) in faces.iter().enumerate() {
            for k in 0..3 {
                let (a, b, opposite) = ends(face, k);
                let place = &mut free[a.min(b) as usize];
                sides[*place as usize] = Side { other: a.max(b), opposite, slot: (3 * t + k) as u32 };
                *place += 1;
            }
        }
        for v in 0..vertices {
            sides[starts[v] as usize..starts[v + 1] as usize].sort_unstable();
        }
        Self { sides, starts }
    }

    /// The sides at each edge, with the edge's lower vertex.
    pub fn edges(&self) -> impl Iterator<Item = (u32, &[Side])> {
        (0..self.starts.len() - 1).flat_map(|v| {
            let here = &self.sides[self.starts[v] as usize..self.starts[v + 1] as usize];
            here.chunk_by(|a, b| a.other == b.other).map(move |edge| (v as u32, edge))
        })
    }

    /// How many sides an edge has, named by its lower vertex and its higher one.
    pub fn count(&self, [low, high]: [u32; 2]) -> usize {
        let here = &self.sides[self.starts[low as usize] as usize..self.starts[low as usize + 1] as usize];
        let [first, end] = [high, high + 1].map(|v| here.partition_point(|side| side.other < v));
        end - first
    }

    /// Marks triangles whose three corners are those of an earlier one; `None` without any.
    fn duplicates(&self, triangles: usize) -> Option<Vec<bool>> {
        let mut marks: Option<Vec<bool>> = None;
        for (_, edge) in self.edges() {
            // Equal triangles share every edge and lie side by side there, the earliest first.
            for pair in edge.windows(2).filter(|pair| pair[0].opposite == pair[1].opposite) {
                marks.get_or_insert_with(|| vec![false; triangles])[pair[1].slot as usize / 3] = true;
            }
        }
        marks
    }

    /// The neighbours of every triangle, and whether all of them agree in orientation.
    fn pair_up(
        &self,
        vertices: &[Point3],
        soup: &Soup,
        opened: &mut Opened,
    ) -> Result<(Vec<[u32; 3]>, bool), MeshError> {
        let mut neighbours = vec![[NONE; 3]; soup.faces.len()];
        let mut consistent = true;
        let parts = |side: Side| (side.slot as usize / 3, side.slot as usize % 3);
        for (low, edge) in self.edges() {
            match edge {
                [_] => {}
                [a, b] => {
                    let ((s, i), (t, j)) = (parts(*a), parts(*b));
                    neighbours[s][i] = t as u32;
                    neighbours[t][j] = s as u32;
                    consistent &= soup.faces[s][i] != soup.faces[t][j];
                }
                more => {
                    let mut triangles = [more[0], more[1], more[2]].map(|s| soup.origin[parts(s).0] as usize);
                    triangles.sort_unstable();
                    opened.note(MeshError::NonManifoldEdge {
                        triangles,
                        count: more.len(),
                        from: coordinates(&vertices[low as usize]),
                        to: coordinates(&vertices[more[0].other as usize]),
                    })?;
                }
            }
        }
        Ok((neighbours, consistent))
    }
}

/// Turns triangles over until all neighbours agree; in each connected piece the majority stays.
/// Returns how many were turned.
fn orient(
    vertices: &[Point3],
    soup: &mut Soup,
    neighbours: &mut [[u32; 3]],
    opened: &mut Opened,
) -> Result<usize, MeshError> {
    let n = soup.faces.len();
    let mut turned: Vec<Option<bool>> = vec![None; n];
    let mut flipped = 0;
    for seed in 0..n {
        if turned[seed].is_some() {
            continue;
        }
        turned[seed] = Some(false);
        let mut piece = vec![seed];
        let mut next = 0;
        while let Some(&t) = piece.get(next) {
            next += 1;
            for k in 0..3 {
                if neighbours[t][k] == NONE {
                    continue;
                }
                let (other, from, to) =
                    (neighbours[t][k] as usize, soup.faces[t][k], soup.faces[t][(k + 1) % 3]);
                let against =
                    (0..3).any(|j| soup.faces[other][j] == from && soup.faces[other][(j + 1) % 3] == to);
                let wanted = turned[t].map(|f| f ^ against);
                if turned[other].is_none() {
                    turned[other] = wanted;
                    piece.push(other);
                } else if turned[other] != wanted {
                    opened.note(MeshError::NotOrientable {
                        triangles: [t, other].map(|t| soup.origin[t] as usize),
                        from: coordinates(&vertices[from as usize]),
                        to: coordinates(&vertices[to as usize]),
                    })?;
                    neighbours[t][k] = NONE;
                    let ends = [from, to];
                    let same = |j: &usize| {
                        let side = [soup.faces[other][*j], soup.faces[other][(j + 1) % 3]];
                        side.iter().all(|v| ends.contains(v))
                    };
                    if let Some(j) = (0..3).find(same) {
                        neighbours[other][j] = NONE;
                    }
                }
            }
        }
        let to_turn = piece.iter().filter(|&&t| turned[t] == Some(true)).count();
        let majority = 2 * to_turn <= piece.len();
        for &t in piece.iter().filter(|&&t| turned[t] == Some(majority)) {
            soup.flip(t, neighbours);
            flipped += 1;
        }
    }
    Ok(flipped)
}

/// Turns over each open piece that faces down or is inside out; leaves closed ones. Returns how many
/// triangles were turned.
fn face_pieces(vertices: &[Point3], soup: &mut Soup, neighbours: &mut [[u32; 3]]) -> usize {
    let mut seen = vec![false; soup.faces.len()];
    let mut turned = 0;
    for seed in 0..soup.faces.len() {
        if std::mem::replace(&mut seen[seed], true) {
            continue;
        }
        let mut piece = vec![seed];
        let mut next = 0;
        while let Some(&t) = piece.get(next) {
            next += 1;
            for n in neighbours[t].into_iter().filter(|&n| n != NONE).map(|n| n as usize) {
                if !std::mem::replace(&mut seen[n], true) {
                    piece.push(n);
                }
            }
        }
        let closed = piece.iter().all(|&t| neighbours[t].iter().all(|&n| n != NONE));
        if !closed && faces_wrong_way(vertices, piece.iter().map(|&t| &soup.faces[t]), false) {
            piece.iter().for_each(|&t| soup.flip(t, neighbours));
            turned += piece.len();
        }
    }
    turned
}

fn is_closed(neighbours: &[[u32; 3]]) -> bool {
    neighbours.iter().flatten().all(|&n| n != NONE)
}

/// True for closed triangles that are inside out and for open ones that face down. Pieces keep
/// their orientation relative to each other: a cavity stays a cavity.
fn faces_wrong_way<'a>(
    vertices: &[Point3],
    faces: impl Iterator<Item = &'a [u32; 3]> + Clone,
    closed: bool,
) -> bool {
    let bounds = Aabb::of(faces.clone().flatten().map(|&i| &vertices[i as usize]));
    let centre = bounds.min + 0.5 * bounds.size();
    let (mut upward, mut area, mut volume) = (0.0, 0.0, 0.0);
    for face in faces {
        let [a, b, c]: [Vector3; 3] = face.map(|i| vertices[i as usize] - centre);
        let cross = (b - a).cross(&(c - a));
        upward += 0.5 * cross.z;
        area += 0.5 * cross.norm();
        volume += cross.dot(&a) / 6.0;
    }
    if closed || upward.abs() < NEARLY_CLOSED * area {
        volume < -NO_VOLUME * area * bounds.diagonal()
    } else {
        upward < 0.0
    }
}

/// Drops vertices that only dropped triangles used; keeps the order.
fn drop_unused(vertices: Vec<Point3>, faces: &mut [[u32; 3]]) -> Vec<Point3> {
    let mut new_index = vec![NONE; vertices.len()];
    faces.iter().flatten().for_each(|&i| new_index[i as usize] = 0);
    let mut kept = 0;
    for index in new_index.iter_mut().filter(|index| **index != NONE) {
        *index = kept;
        kept += 1;
    }
    if kept as usize == vertices.len() {
        return vertices;
    }
    faces.iter_mut().flatten().for_each(|i| *i = new_index[*i as usize]);
    vertices.into_iter().zip(new_index).filter(|&(_, i)| i != NONE).map(|(p, _)| p).collect()
}
