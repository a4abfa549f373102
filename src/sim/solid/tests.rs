//! Distances from swept tools against brute force over time, and the tree against all moves.

use super::*;
use crate::scenes::{Rng, cutters};
use cutter::{Cutter, Holder, HolderSection};
use geometry::Vector3;
use motion::{ClPoint, Move, MoveKind, Toolpath};

/// Time steps of the brute force.
const STEPS: usize = 10_000;

/// The volume that a solid sweeps on one move.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SweptSolid<'a> {
    solid: &'a Solid,
    motion: Motion,
}

impl<'a> SweptSolid<'a> {
    /// `None` where the two axes are opposite.
    pub fn new(solid: &'a Solid, from: &ClPoint, to: &ClPoint) -> Option<Self> {
        Some(Self { solid, motion: Motion::new(from, to)? })
    }

    /// Signed distance of `q` from the swept volume: the least over the move.
    pub fn distance(&self, q: &Point3) -> Nearest {
        let begin = Nearest { distance: self.at(q, 0.0), t: 0.0 };
        self.below(q, begin.distance).unwrap_or(begin)
    }

    /// The same where that is less than `limit`.
    pub fn below(&self, q: &Point3, limit: f64) -> Option<Nearest> {
        below(self.solid, &self.motion, q, [0.0, 1.0], limit)
    }

    /// Signed distance from the solid as it stands at time `t`.
    pub fn at(&self, q: &Point3, t: f64) -> f64 {
        distance_at(self.solid, &self.motion, q, t)
    }
}

pub(crate) fn axis(rng: &mut Rng, widest: f64) -> Vector3 {
    let (lean, around) = (rng.within(0.0, widest), rng.within(0.0, std::f64::consts::TAU));
    Vector3::new(lean.sin() * around.cos(), lean.sin() * around.sin(), lean.cos())
}

pub(crate) fn within(rng: &mut Rng, size: f64) -> Point3 {
    Point3::from([0, 1, 2].map(|_| rng.within(-size, size)))
}

/// Moves of every sort: `kind` picks one.
pub(crate) fn some_move(rng: &mut Rng, kind: usize) -> (ClPoint, ClPoint) {
    let from = ClPoint { tip: within(rng, 3.0), axis: axis(rng, 1.0) };
    let near = from.tip + within(rng, 0.4).coords;
    let slightly = (from.axis + within(rng, 0.05).coords).normalize();
    let to = match kind % 8 {
        // Along, across a short way with a slight turn, far with a large one, and nowhere.
        0 => ClPoint { tip: within(rng, 3.0), axis: from.axis },
        1 => ClPoint { tip: near, axis: slightly },
        2 => ClPoint { tip: within(rng, 8.0), axis: axis(rng, 2.9) },
        3 => from,
        // Turning on the spot, plunging, turning while plunging, and a turn below what shows.
        4 => ClPoint { axis: axis(rng, 3.0), ..from },
        5 => ClPoint { tip: from.tip - from.axis * rng.within(0.0, 4.0), ..from },
        6 => ClPoint { tip: from.tip + from.axis * rng.within(0.0, 4.0), axis: slightly },
        _ => ClPoint { tip: near, axis: (from.axis + within(rng, 1e-9).coords).normalize() },
    };
    (from, to)
}

fn holder(length: f64) -> Holder {
    let section = |diameter, top_diameter, length| HolderSection { diameter, top_diameter, length };
    Holder::new(length, vec![section(4.0, 4.0, 3.0), section(9.0, 6.0, 2.0), section(6.0, 12.0, 4.0)])
        .unwrap()
}

/// Least distance by 10,000 steps and a closer look around the best of them.
fn by_force(solid: &Solid, from: &ClPoint, to: &ClPoint, q: &Point3) -> f64 {
    let at = |t: f64| {
        let pose = from.towards(to, t);
        solid.distance(&pose.tip, &pose.axis, q)
    };
    let time = |k: usize| k as f64 / STEPS as f64;
    let best = (0..=STEPS).min_by(|&i, &j| at(time(i)).total_cmp(&at(time(j)))).unwrap();
    let (mut low, mut high) = (time(best.saturating_sub(1)), time((best + 1).min(STEPS)));
    while high - low > 1e-12 {
        let (a, b) = (low + 0.4 * (high - low), low + 0.6 * (high - low));
        if at(a) < at(b) { high = b } else { low = a }
    }
    at(0.5 * (low + high)).min(at(time(best)))
}

#[test]
fn distances_are_least_over_the_move() {
    let mut rng = Rng::new(5);
    for (c, cutter) in cutters().iter().enumerate() {
        for kind in 0..24 {
            let tool = kind >= 16;
            let solid =
                if tool { Solid::of_tool(cutter, &holder(3.0)) } else { Solid::of_cutter(cutter, None) };
            let (from, to) = some_move(&mut rng, kind);
            let swept = SweptSolid::new(&solid, &from, &to).unwrap();
            for _ in 0..6 {
                let q = within(&mut rng, 6.0) + Vector3::z() * 3.0;
                let (got, expected) = (swept.distance(&q), by_force(&solid, &from, &to, &q));
                let name = format!("cutter {c}, kind {kind}, {from:?} {to:?} {q:?}: {got:?} {expected}");
                let pose = from.towards(&to, got.t);
                let there = solid.distance(&pose.tip, &pose.axis, &q);
                assert!((got.distance - there).abs() < 1e-12, "{name}: at that time {there}");
                // Deep in a tool of several pieces only the sign is promised.
                if tool && expected < 0.0 {
                    assert!(got.distance < 1e-9, "{name}");
                    continue;
                }
                assert!((got.distance - expected).abs() < 1e-9, "{name}");
                let limit = expected + rng.within(-1.0, 1.0);
                let below = swept.below(&q, limit);
                assert_eq!(below.is_some(), expected < limit, "{name}");
                assert!(below.is_none_or(|b| (b.distance - expected).abs() < 1e-9), "{name}");
            }
        }
    }
}

#[test]
fn opposite_axes_are_refused() {
    let solid = Solid::of_cutter(&Cutter::ball(6.0).unwrap(), None);
    let from = ClPoint::upright(Point3::origin());
    let nearly = |off: f64| ClPoint { tip: Point3::origin(), axis: Vector3::new(off, 0.0, -1.0).normalize() };
    assert!(SweptSolid::new(&solid, &from, &nearly(0.0)).is_none());
    assert!(SweptSolid::new(&solid, &from, &nearly(1e-7)).is_none());
    assert!(SweptSolid::new(&solid, &from, &nearly(1e-5)).is_some());
    let moves = [ClPoint::upright(Point3::new(1.0, 0.0, 0.0)), nearly(0.0)];
    let path = path_of(from, &moves);
    assert_eq!(SweptMoves::new(&solid, &path, |_| true).unwrap_err(), OppositeAxes { index: 1 });
    assert!(SweptMoves::new(&solid, &path, |_| false).is_ok());
}

pub(crate) fn path_of(start: ClPoint, to: &[ClPoint]) -> Toolpath {
    let moves = to.iter().map(|&to| Move { to, kind: MoveKind::Cut, feed_rate: 1000.0, pass: 0 });
    Toolpath::new(start, moves.collect())
}

#[test]
fn the_tree_finds_what_all_moves_give() {
    let mut rng = Rng::new(11);
    for (c, cutter) in cutters().iter().enumerate() {
        for upright in [false, true] {
            let solid = if c % 2 == 0 {
                Solid::of_cutter(cutter, None)
            } else {
                Solid::of_tool(cutter, &holder(3.0))
            };
            let mut to: Vec<ClPoint> = (0..60).map(|k| some_move(&mut rng, k).1).collect();
            if upright {
                to.iter_mut().for_each(|at| at.axis = Vector3::z());
            }
            let path = path_of(to[0], &to[1..]);
            let moves = SweptMoves::new(&solid, &path, |_| true).unwrap();
            let each =
                |k: usize| SweptSolid::new(&solid, &path.location_before(k), &path.moves[k].to).unwrap();
            let swept: Vec<SweptSolid<'_>> = (0..path.len()).map(each).collect();
            for _ in 0..40 {
                let q = within(&mut rng, 12.0);
                let all: Vec<f64> = swept.iter().map(|s| s.distance(&q).distance).collect();
                let least = all.iter().copied().fold(f64::INFINITY, f64::min);
                let found = moves.nearest(&q, f64::INFINITY).unwrap();
                if least > 0.0 || solid.is_convex() {
                    assert!((found.distance - least).abs() < 1e-9, "cutter {c}: {found:?} {least}");
                    assert!((all[found.index as usize] - least).abs() < 1e-9);
                    let limit = least + rng.within(-1.0, 1.0);
                    assert_eq!(moves.nearest(&q, limit).is_some(), least < limit);
                } else {
                    assert!(found.distance < 1e-9);
                }
            }
        }
    }
}

#[test]
fn a_ball_turning_about_its_middle_stays_where_it_is() {
    let solid = Solid::of_cutter(&Cutter::ball(6.0).unwrap(), None);
    let centre = Point3::new(1.0, 2.0, 3.0);
    let steps = 2000;
    let pose = |k: usize| {
        let lean = 0.8 * k as f64 / steps as f64;
        let axis = Vector3::new(lean.sin(), 0.0, lean.cos());
        ClPoint { tip: centre - axis * 3.0, axis }
    };
    let to: Vec<ClPoint> = (1..=steps).map(pose).collect();
    let moves = SweptMoves::new(&solid, &path_of(pose(0), &to), |_| true).unwrap();
    // Tips run along chords: the middle errs by r θ²/8.
    let error = 3.0 * (0.8 / steps as f64).powi(2) / 8.0;
    for (x, y, z) in [(0.0, 0.0, -4.0), (2.0, 1.0, -3.0), (-1.0, -1.0, -1.0)] {
        let away = Vector3::new(x, y, z);
        let found = moves.nearest(&(centre + away), f64::INFINITY).unwrap();
        assert!((found.distance - (away.norm() - 3.0)).abs() < error, "{found:?}");
    }
}
