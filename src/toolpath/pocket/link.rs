//! Ways over cleared ground, at depth, from the end of one pass to the beginning of the next one.
//!
//! Enters: the room of the cutter's centre, the ground, where and in which direction a pass ends and the next one begins, and
//! places that the centre has been at. Leaves: the places between. A link is an arc, a straight line and an arc, the shortest
//! of the four such ways that is free (L. E. Dubins, 1957); else the shortest way from place to place whose sides are free, with
//! corners; mm, rad.

use std::f64::consts::TAU;

use super::cleared::Cleared;
use super::walls::Room;
use geometry::{Point2, Vector2};

/// Radii of the arcs over the cutter's, the first that has a free way is taken. Greater ones make longer links, which are half of
/// a path in narrow places.
const RADII: [f64; 2] = [0.15, 0.1];

/// Sides of arcs turn by at most so much, rad: their chords stay far within a film of the arc.
const SIDE: f64 = 0.1;

/// Links are asked for stock at places this far apart over the radius.
const LINK: f64 = 0.12;

/// Places of earlier passes that may be corners of a link, and sides that are asked for at most before it goes back the way
/// that it came.
const CORNERS: usize = 64;
const TRIALS: usize = 400;

/// A place and a direction there.
pub(super) type Pose = (Point2, Vector2);

/// What links keep to.
pub(super) struct Links<'a> {
    pub room: &'a Room<'a>,
    pub cleared: &'a Cleared,
    pub radius: f64,
}

impl Links<'_> {
    /// The places between the end of the way `gone` and one of its places, which is to be left in the direction `heading`.
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
        let back = || gone[index + 1..n - 1].iter().rev().copied().collect();
        smooth.or_else(|| self.around(gone, index)).unwrap_or_else(back)
    }

    /// The shortest way with corners at places of `gone`. Sides are asked for only where such a way wants them.
    fn around(&self, gone: &[Point2], index: usize) -> Option<Vec<Point2>> {
        let n = gone.len();
        let mut nodes = vec![gone[n - 1], gone[index]];
        nodes.extend((0..CORNERS).map(|k| gone[k * n / CORNERS]));
        let count = nodes.len();
        let mut blocked = vec![false; count * count];
        let mut known = vec![false; count * count];
        for _ in 0..TRIALS {
            let way = shortest(&nodes, &blocked)?;
            let side = way.windows(2).find(|side| !known[side[0] * count + side[1]]);
            let Some(&[a, b]) = side else {
                return Some(way[1..way.len() - 1].iter().map(|k| nodes[*k]).collect());
            };
            let free = self.is_free(&nodes[a], &nodes[b]);
            for at in [a * count + b, b * count + a] {
                (known[at], blocked[at]) = (true, !free);
            }
        }
        None
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

/// The shortest way from the first to the second of the places by sides that are not blocked.
fn shortest(nodes: &[Point2], blocked: &[bool]) -> Option<Vec<usize>> {
    let count = nodes.len();
    let (mut far, mut from, mut done) = (vec![f64::INFINITY; count], vec![0; count], vec![false; count]);
    far[0] = 0.0;
    loop {
        let open = (0..count).filter(|k| !done[*k] && far[*k].is_finite());
        let at = open.min_by(|a, b| far[*a].total_cmp(&far[*b]))?;
        if at == 1 {
            break;
        }
        done[at] = true;
        for next in (0..count).filter(|next| !done[*next] && !blocked[at * count + *next]) {
            let length = far[at] + (nodes[next] - nodes[at]).norm();
            if length < far[next] {
                (far[next], from[next]) = (length, at);
            }
        }
    }
    let mut way = vec![1];
    while way[way.len() - 1] != 0 {
        way.push(from[way[way.len() - 1]]);
    }
    way.reverse();
    Some(way)
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
        // Along the straight line lies what is left of the way between the centres, across it what their sides differ by.
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

    /// Each way leaves and arrives in the directions asked for, has the length that its places have, and is bent no more than
    /// its arcs; straight ahead it is straight.
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

    /// The first straight way is blocked; the shorter of two detours is taken, and no way is none.
    #[test]
    fn the_shortest_free_way_is_taken() {
        let nodes = [(0., 0.), (10., 0.), (5., 1.), (5., -3.)].map(|(x, y)| Point2::new(x, y));
        let mut blocked = vec![false; 16];
        assert_eq!(shortest(&nodes, &blocked), Some(vec![0, 1]));
        (blocked[1], blocked[4]) = (true, true);
        assert_eq!(shortest(&nodes, &blocked), Some(vec![0, 2, 1]));
        (blocked[2], blocked[8]) = (true, true);
        assert_eq!(shortest(&nodes, &blocked), Some(vec![0, 3, 1]));
        blocked.fill(true);
        assert_eq!(shortest(&nodes, &blocked), None);
    }
}
