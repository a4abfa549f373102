//! Moves of a program made into arcs (G2, G3) in the plan view, also on a slope.
//!
//! Enters: places in the last decimals that a program has, one feed. Leaves: the longest arc from the first
//! of them that stays within a tolerance of the moves, is as long as they are, and can be run at their feed.
//! An arc ends on a place; all it passes lie near it, and so do the moves between them. What is compared is
//! what controls make of the words: the circle about the rounded middle through the first place, drawn to the
//! last one; mm, rad.

use std::f64::consts::PI;

use geometry::{Point2, Point3, Vector2};
use motion::{DECIMALS, in_last_decimals};

/// Fewer moves are no arc.
pub(super) const LEAST_MOVES: usize = 3;

/// Arcs turn by no more, rad: from half a turn on, rounding may make another arc of their words.
const MOST_TURN: f64 = 0.98 * PI;

/// Radii, mm: of greater circles the middle's decimals tell too little, and smaller ones are corners.
const RADII: [f64; 2] = [0.02, 2000.0];

/// An arc is as long as its moves but for this share: times hold.
const AS_LONG: f64 = 0.01;

/// Start and end of an arc may differ in their distance from the middle by so much, mm: controls refuse more
/// than some micrometres, and rounding makes less.
const ROUNDED: f64 = 2.0e-4;

/// An arc in the words of a program.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Arc {
    /// Moves that it stands for.
    pub moves: usize,
    /// From its start to its middle: I and J, mm.
    pub middle: Vector2,
    /// G2.
    pub clockwise: bool,
}

/// Where arcs stand for moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArcRule {
    /// How near they stay to the moves, mm.
    pub tolerance: f64,
    /// Acceleration toward the middle that the machine has, mm/s².
    pub acceleration: f64,
}

/// The longest arc from `places[0]` along the others at a feed, mm/min.
pub(super) fn longest(places: &[Point3], feed: f64, rule: &ArcRule) -> Option<Arc> {
    let mut best = None;
    let mut moves = LEAST_MOVES;
    let least = RADII[0].max((feed / 60.0).powi(2) / rule.acceleration);
    while moves < places.len() {
        match through(&places[..=moves], least, rule.tolerance) {
            found @ Some(_) => best = found,
            None => break,
        }
        moves += 1;
    }
    best
}

/// The arc about the circle through the first, the middle and the last of some places, if it is near all
/// moves.
fn through(places: &[Point3], least: f64, tolerance: f64) -> Option<Arc> {
    let last = places.len() - 1;
    let [a, b, c] = [0, last / 2, last].map(|k| places[k].xy());
    let middle = rounded(&(circumcentre(&a, &b, &c)? - a));
    let (centre, radius) = (a + middle, middle.norm());
    let ends = (c - centre).norm() - radius;
    if !(least..RADII[1]).contains(&radius) || ends.abs() > ROUNDED {
        return None;
    }
    // On the way its radius becomes that of the end.
    let tolerance = tolerance - ends.abs();
    let clockwise = (b - a).perp(&(c - b)) < 0.0;
    let sense = if clockwise { -1.0 } else { 1.0 };
    let turned = |from: &Point2, to: &Point2| {
        let (u, v) = (from - centre, to - centre);
        sense * u.perp(&v).atan2(u.dot(&v))
    };
    // Each move's end and middle, off the circle.
    let mut aside = vec![[0.0; 2]];
    let mut turns = vec![0.0];
    for pair in places.windows(2) {
        let (from, to) = (pair[0].xy(), pair[1].xy());
        let turn = turned(&from, &to);
        let off = [to, nalgebra::center(&from, &to)].map(|p| ((p - centre).norm() - radius).abs());
        if turn <= 0.0 || off.iter().any(|off| *off > tolerance) {
            return None;
        }
        aside.push(off);
        turns.push(turns[turns.len() - 1] + turn);
    }
    let (whole, rise) = (turns[last], places[last].z - places[0].z);
    let above = |k: usize| (places[k].z - places[0].z - rise * turns[k] / whole).abs();
    let near = |k: usize| {
        let [end, middle] = aside[k];
        end.hypot(above(k)) <= tolerance && middle.hypot(above(k - 1).max(above(k))) <= tolerance
    };
    let gone: f64 = places.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
    let as_long = ((whole * radius).hypot(rise) - gone).abs() <= AS_LONG * gone;
    (whole <= MOST_TURN && as_long && (1..=last).all(near)).then_some(Arc { moves: last, middle, clockwise })
}

/// As programs write it.
fn rounded(v: &Vector2) -> Vector2 {
    v.map(decimals)
}

fn decimals(x: f64) -> f64 {
    in_last_decimals(x) / 10f64.powi(DECIMALS as i32)
}

fn circumcentre(a: &Point2, b: &Point2, c: &Point2) -> Option<Point2> {
    let (u, v) = (b - a, c - a);
    let twice = 2.0 * u.perp(&v);
    let (p, q) = (u.norm_squared(), v.norm_squared());
    let to = Vector2::new(v.y * p - u.y * q, u.x * q - v.x * p) / twice;
    to.iter().all(|x| x.is_finite()).then(|| a + to)
}

/// A place as a program says it.
pub(super) fn written(tip: &Point3) -> Point3 {
    Point3::from(tip.coords.map(decimals))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn circle(radius: f64, step: f64, count: usize, drop: f64) -> Vec<Point3> {
        let at = |k: usize| {
            let (sin, cos) = (step * k as f64).sin_cos();
            written(&Point3::new(3.0 + radius * cos, radius * sin, -drop * k as f64))
        };
        (0..=count).map(at).collect()
    }

    fn longest(places: &[Point3], tolerance: f64) -> Option<Arc> {
        super::longest(places, 600.0, &ArcRule { tolerance, acceleration: 1000.0 })
    }

    /// Chords of a circle become arcs of less than half a turn, where their sagitta allows it, level and
    /// sloping.
    #[test]
    fn chords_of_a_circle_are_arcs() {
        for (radius, drop) in [(5.0, 0.0), (2.4, 0.01), (80.0, 0.0)] {
            let step: f64 = 0.05;
            let sagitta = radius * (1.0 - (0.5 * step).cos());
            let places = circle(radius, step, 70, drop);
            let arc = longest(&places, sagitta + 4e-4).unwrap();
            assert_eq!(arc.moves, (MOST_TURN / step) as usize);
            assert!((arc.middle - Vector2::new(-radius, 0.0)).norm() < 1e-3 * radius && !arc.clockwise);
            assert_eq!(longest(&places, 0.8 * sagitta), None);
            let back: Vec<Point3> = places.into_iter().rev().collect();
            assert!(longest(&back, sagitta + 4e-4).unwrap().clockwise);
        }
    }

    /// What an arc is off its moves in the plan and in height it is off together.
    #[test]
    fn arcs_stay_near_their_moves_in_space() {
        let moves = |off: [f64; 2]| {
            let mut places = circle(5.0, 0.02, 12, 0.0);
            let out = (places[11] - Point3::new(3.0, 0.0, 0.0)) * (off[0] / 5.0);
            places[11] += out + nalgebra::Vector3::z() * off[1];
            longest(&places, 1.1e-3).map(|arc| arc.moves)
        };
        assert_eq!([[0.0; 2], [9e-4, 0.0], [0.0, 9e-4]].map(moves), [Some(12); 3]);
        assert_eq!(moves([9e-4; 2]), Some(10));
    }

    /// An arc ends where its moves leave the circle, the plane of its slope or its sense.
    #[test]
    fn arcs_end_where_moves_leave_them() {
        let mut places = circle(5.0, 0.05, 12, 0.0);
        let end = places[12];
        places.push(Point3::new(end.x - 0.3, end.y + 0.4, 0.0));
        let arc = longest(&places, 4e-3).unwrap();
        assert!(arc.moves == 12 || arc.moves == 11, "{arc:?}");
        let mut jump = circle(5.0, 0.05, 12, 0.0);
        jump[9].z = -0.1;
        assert_eq!(longest(&jump, 4e-3).unwrap().moves, 8);
        let mut back = circle(5.0, 0.05, 8, 0.0);
        back.extend(circle(5.0, 0.05, 7, 0.0).into_iter().rev());
        assert_eq!(longest(&back, 4e-3).unwrap().moves, 8);
        // A feed of 10 mm/s around 5 mm takes 20 mm/s².
        let round = circle(5.0, 0.05, 12, 0.0);
        let found = |acceleration| super::longest(&round, 600.0, &ArcRule { tolerance: 4e-3, acceleration });
        assert!(found(100.0).is_some() && found(19.0).is_none());
        let line: Vec<Point3> = (0..9).map(|k| Point3::new(f64::from(k), 0.0, 0.0)).collect();
        assert_eq!(longest(&line, 4e-3), None);
    }
}
