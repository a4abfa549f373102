//! Ways over cleared ground, at depth, from the end of one pass to the beginning of the next one.
//!
//! Enters: the room of the cutter's centre, the ground, where and in which direction a pass ends and the next
//! one begins, and places that the centre has been at. Leaves: the places between. A link is an arc, a
//! straight line and an arc, the shortest of the four such ways that is free (L. E. Dubins, 1957); else a way
//! with corners from place to place whose sides are free (A*: P. Hart, N. Nilsson, B. Raphael, 1968), pulled
//! taut; mm, rad.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};
use std::f64::consts::TAU;

use super::cleared::Cleared;
use super::walls::Room;
use geometry::{Point2, Vector2};

/// Radii of the arcs over the cutter's, the first that has a free way is taken. Greater ones make longer
/// links, which are half of a path in narrow places.
const RADII: [f64; 2] = [0.15, 0.1];

/// Sides of arcs turn by at most so much, rad: their chords stay far within a film of the arc.
const SIDE: f64 = 0.1;

/// Links are asked for stock at places this far apart over the radius.
const LINK: f64 = 0.12;

/// Side of the cells over the radius of which one place each may be a corner of a link.
const CELL: f64 = 0.5;

/// A place and a direction there.
pub(super) type Pose = (Point2, Vector2);

type Cell = [i32; 2];

/// Places that the centre has been at, the first in each square cell.
pub(super) struct Visited {
    cell: f64,
    first: HashMap<Cell, Point2>,
}

impl Visited {
    pub fn new(radius: f64) -> Self {
        Self { cell: CELL * radius, first: HashMap::new() }
    }

    pub fn add(&mut self, p: Point2) {
        self.first.entry(self.cell_of(&p)).or_insert(p);
    }

    fn cell_of(&self, p: &Point2) -> Cell {
        [p.x, p.y].map(|x| (x / self.cell).floor() as i32)
    }

    /// The places of the cell that a place is in and of those beside it.
    fn near(&self, p: &Point2) -> impl Iterator<Item = (Cell, Point2)> {
        let [i, j] = self.cell_of(p);
        let cells = (i - 1..=i + 1).flat_map(move |i| (j - 1..=j + 1).map(move |j| [i, j]));
        cells.filter_map(|cell| Some((cell, *self.first.get(&cell)?)))
    }
}

/// What links keep to.
pub(super) struct Links<'a> {
    pub room: &'a Room<'a>,
    pub cleared: &'a Cleared,
    pub visited: &'a Visited,
    pub radius: f64,
}

impl Links<'_> {
    /// The places between the end of the way `gone` and one of its places, which is to be left in the
    /// direction `heading`.
    pub fn between(&self, gone: &[Point2], index: usize, heading: Vector2) -> Vec<Point2> {
        let n = gone.len();
        let (end, to) = (gone[n - 1], gone[index]);
        if end == to {
            return Vec::new();
        }
        let along = n.checked_sub(2).and_then(|k| (end - gone[k]).try_normalize(0.0)).unwrap_or(heading);
        let ways = RADII.iter().flat_map(|share| {
            let mut ways = dubins((end, along), (to, heading), share * self.radius);
            ways.sort_by(|a, b| a.0.total_cmp(&b.0));
            ways.into_iter().map(|way| way.1)
        });
        let smooth = ways.into_iter().find(|way| {
            let whole = || std::iter::once(&end).chain(way).chain([&to]);
            whole().zip(whole().skip(1)).all(|(a, b)| self.is_free(a, b))
        });
        smooth.or_else(|| self.around(end, to)).unwrap_or_else(|| back(gone, index))
    }

    /// A short way with corners at places that were visited. Sides are asked for only where such a way wants
    /// them.
    fn around(&self, end: Point2, to: Point2) -> Option<Vec<Point2>> {
        const TARGET: usize = 1;
        let mut nodes = vec![end, to];
        let mut ids: HashMap<Cell, usize> = HashMap::new();
        let mut from: Vec<Option<usize>> = vec![Some(0), None];
        // By the length of the whole way at least; equal ones in the order in which they were found.
        let mut open = BinaryHeap::new();
        let mut found = 0u64;
        let mut push = |open: &mut BinaryHeap<_>, [before, node]: [usize; 2], gone: f64, at: &Point2| {
            found += 1;
            open.push(Reverse(((gone + (to - at).norm()).to_bits(), found, [before, node], gone.to_bits())));
        };
        push(&mut open, [0, TARGET], (to - end).norm(), &to);
        push(&mut open, [0, 0], 0.0, &end);
        while let Some(Reverse((_, _, [before, node], gone))) = open.pop() {
            let begins = node == 0 && before == 0;
            if !begins && (from[node].is_some() || !self.is_free(&nodes[before], &nodes[node])) {
                continue;
            }
            from[node] = Some(before);
            if node == TARGET {
                break;
            }
            let (at, gone) = (nodes[node], f64::from_bits(gone));
            let target = self.visited.cell_of(&to);
            for (cell, place) in self.visited.near(&at) {
                let next = *ids.entry(cell).or_insert_with(|| {
                    nodes.push(place);
                    from.push(None);
                    nodes.len() - 1
                });
                if from[next].is_none() {
                    push(&mut open, [node, next], gone + (place - at).norm(), &place);
                }
                if cell == target && node != 0 {
                    push(&mut open, [node, TARGET], gone + (to - at).norm(), &to);
                }
            }
        }
        let mut way = vec![to];
        let mut at = TARGET;
        while at != 0 {
            at = from[at]?;
            way.push(nodes[at]);
        }
        way.reverse();
        Some(self.taut(&way))
    }

    /// Corners of a way that its other corners do not make needless, ends left out.
    fn taut(&self, way: &[Point2]) -> Vec<Point2> {
        let (mut at, mut corners) = (0, Vec::new());
        while at + 1 < way.len() {
            let mut next = way.len() - 1;
            while next > at + 1 && !self.is_free(&way[at], &way[next]) {
                next = at + (next - at) / 2;
            }
            corners.push(way[next]);
            at = next;
        }
        corners.pop();
        corners
    }

    /// Whether a straight move stays inside and cuts nothing.
    pub fn is_free(&self, a: &Point2, b: &Point2) -> bool {
        let Some(heading) = (b - a).try_normalize(0.0) else { return true };
        let steps = ((b - a).norm() / (LINK * self.radius)).ceil();
        let free =
            |k: usize| self.cleared.arc(&(a + (b - a) * (k as f64 / steps)), &heading, usize::MAX) == 0.0;
        (0..=steps as usize).rev().all(free) && self.room.holds(a, b)
    }
}

/// The way back to one of the places of a way, ends left out. What it was at before it does not go around to
/// again.
fn back(gone: &[Point2], index: usize) -> Vec<Point2> {
    let mut way: Vec<Point2> = Vec::new();
    let mut known = HashMap::new();
    let key = |p: &Point2| [p.x, p.y].map(f64::to_bits);
    for p in gone[index..].iter().rev() {
        if let Some(&at) = known.get(&key(p)) {
            way.drain(at..).for_each(|p| {
                known.remove(&key(&p));
            });
        }
        known.insert(key(p), way.len());
        way.push(*p);
    }
    way.pop();
    way.drain(..1.min(way.len()));
    way
}

/// The ways of an arc, a straight line and an arc between two poses, ends left out, with their lengths.
fn dubins((p, u): Pose, (q, v): Pose, rho: f64) -> Vec<(f64, Vec<Point2>)> {
    let left = |h: &Vector2| Vector2::new(-h.y, h.x);
    let angle = |h: &Vector2| h.y.atan2(h.x);
    let mut ways = Vec::new();
    for (first, last) in [(1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0)] {
        let centres = [p + left(&u) * (first * rho), q + left(&v) * (last * rho)];
        let across = rho * (last - first);
        let between = centres[1] - centres[0];
        let (square, off) = (between.norm_squared(), across * across);
        if square < off || square == 0.0 {
            continue;
        }
        // Along the straight line lies what is left of the way between the centres, across it what their
        // sides differ by.
        let straight = (square - off).sqrt();
        let along = angle(&between) - across.atan2(straight);
        let turns =
            [(first * (along - angle(&u))).rem_euclid(TAU), (last * (angle(&v) - along)).rem_euclid(TAU)];
        let mut way = Vec::new();
        let on = |centre: &Point2, side: f64, direction: f64| {
            let (sin, cos) = direction.sin_cos();
            centre - Vector2::new(-sin, cos) * (side * rho)
        };
        let mut arc = |centre: &Point2, side: f64, begin: f64, turn: f64, ends: [bool; 2]| {
            let sides = (turn / SIDE).ceil().max(1.0) as usize;
            let from = usize::from(!ends[0]);
            let until = sides + usize::from(ends[1]);
            let at = |k: usize| begin + side * turn * k as f64 / sides as f64;
            way.extend((from..until).map(|k| on(centre, side, at(k))));
        };
        arc(&centres[0], first, angle(&u), turns[0], [false, true]);
        arc(&centres[1], last, along, turns[1], [true, false]);
        ways.push((rho * (turns[0] + turns[1]) + straight, way));
    }
    ways
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each way leaves and arrives in the directions asked for, has the length that its places have, and is
    /// bent no more than its arcs; straight ahead it is straight.
    #[test]
    fn arcs_and_lines_join_two_poses() {
        let pose = |x: f64, y: f64, turn: f64| (Point2::new(x, y), Vector2::new(turn.cos(), turn.sin()));
        for (p, q) in [
            (pose(0., 0., 0.3), pose(10., 3., 2.0)),
            (pose(0., 0., -2.0), pose(1.5, 0.2, 1.0)),
            (pose(3., 1., 1.57), pose(-6., 1., -1.57)),
        ] {
            let ways = dubins(p, q, 1.0);
            assert!(ways.len() >= 2);
            for (length, way) in ways {
                let whole: Vec<Point2> = std::iter::once(p.0).chain(way).chain([q.0]).collect();
                let sides: Vec<Vector2> = whole.windows(2).map(|w| w[1] - w[0]).collect();
                let found: f64 = sides.iter().map(|s| s.norm()).sum();
                assert!(found <= length && found > length * (1.0 - SIDE * SIDE / 20.0), "{found} {length}");
                assert!(sides[0].angle(&p.1) <= SIDE && sides[sides.len() - 1].angle(&q.1) <= SIDE);
                let long = |s: &&Vector2| s.norm() > 1e-9;
                let sides: Vec<&Vector2> = sides.iter().filter(long).collect();
                assert!(sides.windows(2).all(|w| w[0].angle(w[1]) <= SIDE + 1e-6));
            }
        }
        let ways = dubins(pose(0., 0., 0.), pose(7., 0., 0.), 1.0);
        assert!(ways.iter().any(|way| (way.0 - 7.0).abs() < 1e-12));
    }

    /// Where an earlier link went back over the same ground, a way back goes there once.
    #[test]
    fn ways_back_pass_no_place_twice() {
        let places: Vec<Point2> = (0..5).map(|k| Point2::new(f64::from(k), 0.0)).collect();
        let at = |order: &[usize]| order.iter().map(|k| places[*k]).collect::<Vec<_>>();
        assert_eq!(back(&at(&[0, 1, 2, 3, 4]), 0), at(&[3, 2, 1]));
        assert_eq!(back(&at(&[0, 1, 2, 3, 2, 1, 2, 3, 4]), 0), at(&[3, 2, 1]));
        assert_eq!(back(&at(&[0, 1]), 0), []);
    }

    /// Along a U that has been cleared: from the end of one leg to that of the other one there is no arc, and
    /// the way with corners is little longer than the taut one around the two inner corners.
    #[test]
    fn a_way_with_corners_goes_around_what_stands() {
        let corners =
            [(0., 0.), (20., 0.), (20., 20.), (13., 20.), (13., 7.), (7., 7.), (7., 20.), (0., 20.)];
        let outer = corners.map(|(x, y)| Point2::new(x, y)).to_vec();
        let piece = geometry::Piece { outer, islands: Vec::new() };
        let (room, radius) = (Room::new(&piece), 2.0);
        let mut cleared = Cleared::new([Point2::new(-2.0, -2.0), Point2::new(22.0, 22.0)], radius);
        let mut visited = Visited::new(radius);
        let places = (0..=200)
            .flat_map(|j| (0..=200).map(move |i| Point2::new(0.1 * f64::from(i), 0.1 * f64::from(j))));
        for p in places.filter(|p| room.nearest_inside(p) == *p) {
            cleared.add(p);
            visited.add(p);
        }
        let links = Links { room: &room, cleared: &cleared, visited: &visited, radius };
        let (from, to) = (Point2::new(3.5, 19.0), Point2::new(16.5, 19.0));
        let way = links.around(from, to).unwrap();
        let whole: Vec<Point2> = std::iter::once(from).chain(way).chain([to]).collect();
        let length: f64 = whole.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
        let taut = 2.0 * 12f64.hypot(3.5) + 6.0;
        assert!(length >= taut - 1e-9 && length < 1.1 * taut, "{length} {taut}");
        assert!(whole.windows(2).all(|w| links.is_free(&w[0], &w[1])));
    }
}
