//! T-junctions: open edges that vertices of other open edges lie on are split there.
//!
//! A vertex counts where the pieces of the edge on one of its sides or both then meet the edge of one other triangle.
//! So a corner that merely touches an edge splits none.

use std::collections::{BTreeMap, BTreeSet};

use super::{MOST_ROUNDS, are_folded, keeps_its_side};
use crate::mesh::repair::{Sides, Soup};
use crate::segment_grid::foot;
use crate::{Aabb, Point3};

/// Vertices on the sides of a triangle, each list in the side's direction.
type OnSides = [Vec<u32>; 3];

/// Points in a leaf of the search tree.
const LEAF: usize = 4;

/// Splits edges; returns how many, and how far vertices lay off their edges at most, mm.
pub(super) fn split(vertices: &[Point3], soup: &mut Soup, tolerance: f64) -> (usize, f64) {
    let sides = Sides::of(vertices.len(), &soup.faces);
    let open: Vec<u32> =
        sides.edges().filter(|(_, edge)| edge.len() == 1).map(|(_, edge)| edge[0].slot).collect();
    let mut found = vertices_on(vertices, &soup.faces, &open, tolerance);
    if !keep_what_meets(vertices, &soup.faces, (&sides, &open), &mut found, tolerance) {
        return (0, 0.0);
    }
    let mut source_of = BTreeMap::new();
    let wanted: BTreeSet<u32> = found.values().flatten().flatten().copied().collect();
    for (face, source) in soup.faces.iter().zip(&soup.sources) {
        (0..3).filter(|&k| wanted.contains(&face[k])).for_each(|k| _ = source_of.insert(face[k], source[k]));
    }
    let (mut count, mut off) = (0, 0.0_f64);
    for (&t, on_sides) in &found {
        let t = t as usize;
        let (face, source, origin) = (soup.faces[t], soup.sources[t], soup.origin[t]);
        for (k, on) in on_sides.iter().enumerate() {
            let ends = [k, (k + 1) % 3].map(|k| vertices[face[k] as usize]);
            count += usize::from(!on.is_empty());
            off = on.iter().fold(off, |off, &v| off.max(foot(&vertices[v as usize], &ends).1));
        }
        let given = |v: u32| {
            let corner = (0..3).find(|&k| face[k] == v).map(|k| source[k]);
            corner.or_else(|| source_of.get(&v).copied()).unwrap_or(source[0])
        };
        let mut pieces = cut(&face, on_sides).into_iter();
        if let Some(first) = pieces.next() {
            (soup.faces[t], soup.sources[t]) = (first, first.map(given));
        }
        pieces.for_each(|piece| soup.push(piece, piece.map(given), origin as usize));
    }
    (count, off)
}

/// The vertices of open edges that lie on other open edges, by triangle.
fn vertices_on(
    vertices: &[Point3],
    faces: &[[u32; 3]],
    open: &[u32],
    tolerance: f64,
) -> BTreeMap<u32, OnSides> {
    let ends = |slot: u32| {
        let (t, k) = (slot as usize / 3, slot as usize % 3);
        [faces[t][k], faces[t][(k + 1) % 3]]
    };
    let mut points: Vec<u32> = open.iter().flat_map(|&slot| ends(slot)).collect();
    points.sort_unstable();
    points.dedup();
    let mut found: BTreeMap<u32, OnSides> = BTreeMap::new();
    if points.is_empty() {
        return found;
    }
    let tree = PointTree::new(vertices, points);
    let on_edges = work::parallel::map(open.len(), |k| {
        let segment = ends(open[k]).map(|v| vertices[v as usize]);
        let length = (segment[1] - segment[0]).norm();
        let mut on: Vec<(f64, u32)> = Vec::new();
        tree.beside(&segment, tolerance, &mut |v| {
            let (share, off) = foot(&vertices[v as usize], &segment);
            let from_ends = length * share.min(1.0 - share);
            if off <= tolerance && from_ends > tolerance && !faces[open[k] as usize / 3].contains(&v) {
                on.push((share, v));
            }
        });
        on.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        // Vertices that rounding may have put in any order tell of no way along the edge.
        let is_clear = on.windows(2).all(|pair| (pair[1].0 - pair[0].0) * length > tolerance);
        if is_clear { on.into_iter().map(|(_, v)| v).collect() } else { Vec::new() }
    });
    for (&slot, on) in open.iter().zip(on_edges).filter(|(_, on)| !on.is_empty()) {
        found.entry(slot / 3).or_default()[slot as usize % 3] = on;
    }
    found
}

/// Points halved at their middle along the longer side of their box, again and again. A [`crate::BoxTree`] takes
/// minutes to build where many points lie on one line, as along edges.
struct PointTree {
    points: Vec<u32>,
    /// The box of all points, then those of the halves of box `k` at 2 `k` + 1 and 2 `k` + 2.
    boxes: Vec<Aabb>,
}

impl PointTree {
    fn new(vertices: &[Point3], mut points: Vec<u32>) -> Self {
        let mut boxes = Vec::new();
        let mut waiting = vec![(0, 0..points.len())];
        while let Some((k, range)) = waiting.pop() {
            let own = &mut points[range.clone()];
            let bounds = Aabb::of(own.iter().map(|&v| &vertices[v as usize]));
            if boxes.len() <= k {
                boxes.resize(k + 1, Aabb::EMPTY);
            }
            boxes[k] = bounds;
            if own.len() <= LEAF {
                continue;
            }
            let axis = bounds.size().imax();
            let at = |v: &u32| vertices[*v as usize][axis];
            own.select_nth_unstable_by(own.len() / 2, |a, b| at(a).total_cmp(&at(b)).then(a.cmp(b)));
            let middle = range.start + range.len() / 2;
            waiting.extend([(2 * k + 1, range.start..middle), (2 * k + 2, middle..range.end)]);
        }
        Self { points, boxes }
    }

    /// Hands to `found` all points within `reach` of a segment, and some farther ones.
    fn beside(&self, segment: &[Point3; 2], reach: f64, found: &mut impl FnMut(u32)) {
        let mut waiting = vec![(0, 0..self.points.len())];
        while let Some((k, range)) = waiting.pop() {
            if !meets(&self.boxes[k], reach, segment) {
                continue;
            }
            if range.len() <= LEAF {
                self.points[range].iter().for_each(|&v| found(v));
                continue;
            }
            let middle = range.start + range.len() / 2;
            waiting.extend([(2 * k + 1, range.start..middle), (2 * k + 2, middle..range.end)]);
        }
    }
}

/// Whether a segment meets a box that is grown by `reach`.
fn meets(bounds: &Aabb, reach: f64, [a, b]: &[Point3; 2]) -> bool {
    let (mut first, mut last) = (0.0_f64, 1.0_f64);
    for axis in 0..3 {
        let (below, above) = (bounds.min[axis] - reach - a[axis], bounds.max[axis] + reach - a[axis]);
        let way = b[axis] - a[axis];
        if way == 0.0 {
            if below > 0.0 || above < 0.0 {
                return false;
            }
            continue;
        }
        first = first.max((below / way).min(above / way));
        last = last.min((below / way).max(above / way));
    }
    first <= last
}

/// What becomes of a piece of an edge.
#[derive(Clone, Copy, PartialEq)]
enum State {
    /// Open, as the edge was.
    Open,
    /// One other triangle goes on there.
    Met,
    /// There is no place for it: more triangles meet there, or two that face different sides or lie on each other.
    Refused,
}

/// A piece of an open edge.
struct Piece {
    ends: [u32; 2],
    opposite: u32,
    /// Whether the triangle's side runs from its lower to its higher end.
    forward: bool,
    /// 3 × triangle + side.
    slot: u32,
    /// Which of the side's pieces.
    place: usize,
}

/// Leaves those vertices with which pieces of edges meet; false where none is left.
fn keep_what_meets(
    vertices: &[Point3],
    faces: &[[u32; 3]],
    (sides, open): (&Sides, &[u32]),
    found: &mut BTreeMap<u32, OnSides>,
    tolerance: f64,
) -> bool {
    for _ in 0..MOST_ROUNDS {
        found.retain(|&t, on| {
            let face = &faces[t as usize];
            cut(face, on).iter().all(|piece| keeps_its_side(vertices, face, piece))
        });
        let pieces = pieces_of(faces, open, found);
        let mut states: BTreeMap<(u32, usize), State> = BTreeMap::new();
        for edge in pieces.chunk_by(|a, b| a.ends == b.ends) {
            let ends = edge[0].ends;
            let state = match edge {
                _ if sides.count(ends) > 1 => State::Refused,
                [_] => State::Open,
                [a, b] => {
                    let is_folded = are_folded(vertices, ends, [a.opposite, b.opposite], tolerance);
                    if a.forward == b.forward || is_folded { State::Refused } else { State::Met }
                }
                _ => State::Refused,
            };
            states.extend(edge.iter().map(|piece| ((piece.slot, piece.place), state)));
        }
        let before = found.len();
        let taken = within_taken_edges(faces, sides, &pieces, found);
        found.retain(|t, _| taken.binary_search(t).is_err());
        let mut is_done = found.len() == before;
        for (&t, on_sides) in found.iter_mut() {
            for (k, on) in on_sides.iter_mut().enumerate() {
                let before = on.len();
                let state = |place: usize| states.get(&(3 * t + k as u32, place)).copied();
                let mut place = 0;
                on.retain(|_| {
                    let beside = [state(place), state(place + 1)];
                    place += 1;
                    beside.contains(&Some(State::Met)) && !beside.contains(&Some(State::Refused))
                });
                is_done &= on.len() == before;
            }
        }
        found.retain(|_, on| on.iter().any(|on| !on.is_empty()));
        if is_done || found.is_empty() {
            return !found.is_empty();
        }
    }
    false
}

/// The triangles, ascending, whose cuts would run along an edge that others have.
fn within_taken_edges(
    faces: &[[u32; 3]],
    sides: &Sides,
    pieces: &[Piece],
    found: &BTreeMap<u32, OnSides>,
) -> Vec<u32> {
    let mut cuts: Vec<([u32; 2], u32)> = Vec::new();
    for (&t, on_sides) in found {
        let parts = cut(&faces[t as usize], on_sides);
        let edges = parts.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        let mut edges: Vec<[u32; 2]> = edges.map(|[a, b]| [a.min(b), a.max(b)]).collect();
        edges.sort_unstable();
        // Both parts beside a cut have it.
        cuts.extend(edges.windows(2).filter(|pair| pair[0] == pair[1]).map(|pair| (pair[0], t)));
    }
    cuts.sort_unstable();
    let mut taken = Vec::new();
    for same in cuts.chunk_by(|a, b| a.0 == b.0) {
        let ends = same[0].0;
        let of_others = || pieces.binary_search_by_key(&ends, |piece| piece.ends).is_ok();
        if same.len() > 1 || sides.count(ends) > 0 || of_others() {
            taken.extend(same.iter().map(|(_, t)| *t));
        }
    }
    taken.sort_unstable();
    taken.dedup();
    taken
}

/// All open edges in pieces, sorted by their ends.
fn pieces_of(faces: &[[u32; 3]], open: &[u32], found: &BTreeMap<u32, OnSides>) -> Vec<Piece> {
    let mut pieces = Vec::with_capacity(open.len());
    for &slot in open {
        let (t, k) = (slot / 3, slot as usize % 3);
        let face = &faces[t as usize];
        let on: &[u32] = found.get(&t).map_or(&[], |on| &on[k]);
        let mut from = face[k];
        for (place, &to) in on.iter().chain([&face[(k + 1) % 3]]).enumerate() {
            let ends = [from.min(to), from.max(to)];
            pieces.push(Piece { ends, opposite: face[(k + 2) % 3], forward: from < to, slot, place });
            from = to;
        }
    }
    pieces.sort_unstable_by_key(|piece| (piece.ends, piece.slot, piece.place));
    pieces
}

/// A triangle cut so that vertices on its sides are corners: a strip between two sides from their common corner,
/// and a fan to the third side, which has the fewest. Each piece faces the triangle's side.
pub(super) fn cut(face: &[u32; 3], on_sides: &OnSides) -> Vec<[u32; 3]> {
    let third = (0..3).min_by_key(|&k| on_sides[k].len()).unwrap_or(0);
    // From the corner opposite that side along the sides beside it.
    let [c, a, b] = [0, 1, 2].map(|k| face[(third + k) % 3]);
    let toward_c: Vec<u32> =
        [b].into_iter().chain(on_sides[(third + 2) % 3].iter().copied()).chain([c]).collect();
    let backward = on_sides[(third + 1) % 3].iter().rev().copied();
    let toward_a: Vec<u32> = [b].into_iter().chain(backward).chain([a]).collect();
    let mut pieces = Vec::new();
    let (mut i, mut j) = (1, 1);
    // In the direction of the triangle's corners: from the side toward a over b to the side toward c.
    let mut last = [toward_a[1], b, toward_c[1]];
    let share = |place: usize, chain: &[u32]| place as f64 / (chain.len() - 1) as f64;
    while i + 1 < toward_a.len() || j + 1 < toward_c.len() {
        pieces.push(last);
        let is_next = j + 1 == toward_c.len()
            || (i + 1 < toward_a.len() && share(i + 1, &toward_a) <= share(j + 1, &toward_c));
        last = if is_next {
            [toward_a[i + 1], toward_a[i], toward_c[j]]
        } else {
            [toward_a[i], toward_c[j], toward_c[j + 1]]
        };
        if is_next { i += 1 } else { j += 1 }
    }
    // The last one has the third side, and its apex between.
    let apex = last[1];
    let along: Vec<u32> = [c].into_iter().chain(on_sides[third].iter().copied()).chain([a]).collect();
    pieces.extend(along.windows(2).map(|pair| [apex, pair[0], pair[1]]));
    pieces
}
