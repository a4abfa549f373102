//! The last pass along walls: entered and left by arcs that touch them.
//!
//! Enters: a wall of the piece of the cutter's centre, with the piece on its left, the rooms of the last pass
//! and of the passes before it, what these left. Leaves: a run that comes down beside the wall over ground
//! that is cleared, swings onto it by a quarter of a circle, goes around it and swings off it. So the cutter
//! neither stops nor turns sharply where it touches the wall. Without room for an arc the run begins on the
//! wall itself, which it ramps along; mm.

use std::f64::consts::FRAC_PI_2;

use super::route::{Entry, Run, begun_near};
use super::walls::Room;
use geometry::{Piece, Point2, Region, SegmentGrid, Vector2};

/// Radii of the arcs over the cutter's, the first that has room is taken.
const RADII: [f64; 4] = [0.6, 0.4, 0.25, 0.12];

/// Places along the wall where arcs are tried, and sides of an arc.
const PLACES: usize = 48;
const SIDES: usize = 24;

/// The pass ends at most this far beyond its beginning, over the radius, so that no mark stays between its
/// arcs.
const OVERLAP: f64 = 0.05;

/// The runs along all walls of the centre's region, by piece, beside what `rough` passes have cleared.
pub(super) fn along_walls<'p>(region: &'p Region, rough: &Region, radius: f64) -> Vec<(&'p Piece, Vec<Run>)> {
    let of_piece = |piece: &'p Piece| {
        let room = Room::new(piece);
        let around = |wall: &[Point2]| {
            // What is cleared beside this wall.
            let beside = rough.pieces.iter().min_by(|a, b| {
                let away = |piece: &Piece| SegmentGrid::of_curves(piece.curves()).distance(&wall[0]);
                away(a).total_cmp(&away(b))
            });
            around(wall, &room, beside, radius)
        };
        (piece, piece.curves().map(around).collect())
    };
    region.pieces.iter().map(of_piece).collect()
}

/// The run of the last pass along `wall`. `rough` is the piece that the passes before have cleared with the
/// cutter's centre.
fn around(wall: &[Point2], room: &Room, rough: Option<&Piece>, radius: f64) -> Run {
    rough.and_then(|rough| swung(wall, room, rough, radius)).unwrap_or_else(|| {
        let mut around = wall.to_vec();
        around.push(wall[0]);
        Run { entry: Entry::Ramp(around.clone()), points: around }
    })
}

fn swung(wall: &[Point2], room: &Room, rough: &Piece, radius: f64) -> Option<Run> {
    let cleared = Room::new(rough);
    let inside = SegmentGrid::of_curves(rough.curves());
    let curves: Vec<&[Point2]> = rough.curves().collect();
    for share in RADII {
        let rho = share * radius;
        for place in places(wall) {
            let closed = begun_near(wall, &place, 0.0);
            let (first, next) = (closed[0], *closed.get(1)?);
            let Some(along) = (next - first).try_normalize(0.0) else { continue };
            // Both arcs touch the same straight line.
            let over = first + along * (OVERLAP * radius).min((next - first).norm());
            let on = quarter(&first, &along, rho, [-1.0, 0.0]);
            let off = quarter(&over, &along, rho, [0.0, 1.0]);
            let holds = |way: &[Point2]| way.windows(2).all(|w| room.holds(&w[0], &w[1]));
            let Some(near) = inside.nearest(&on[0]) else { continue };
            let [a, b] = inside.segments()[near.segment as usize].ends;
            let begin = a + (b - a) * near.share;
            if !holds(&on) || !holds(&off) || !cleared.holds(&begin, &on[0]) || !rough.contains(&on[0]) {
                continue;
            }
            let mut way =
                begun_near(curves[inside.segments()[near.segment as usize].curve as usize], &begin, 0.0);
            way.push(way[0]);
            let mut points = vec![way[0]];
            points.extend(on);
            points.extend(closed.into_iter().skip(1).chain([first]));
            points.extend(off);
            return Some(Run { entry: Entry::Ramp(way), points });
        }
    }
    None
}

/// Middles of the sides of a wall, the longest first, as many as are tried.
fn places(wall: &[Point2]) -> Vec<Point2> {
    let n = wall.len();
    let mut sides: Vec<[Point2; 2]> = (0..n).map(|k| [wall[k], wall[(k + 1) % n]]).collect();
    sides.sort_by(|a, b| (b[1] - b[0]).norm().total_cmp(&(a[1] - a[0]).norm()));
    sides.iter().take(PLACES).map(|[a, b]| nalgebra::center(a, b)).collect()
}

/// An arc that turns left about the place on the left of `at`, from one quarter of a turn to another one; at
/// 0 it touches `at`.
fn quarter(at: &Point2, along: &Vector2, rho: f64, [from, to]: [f64; 2]) -> Vec<Point2> {
    let left = Vector2::new(-along.y, along.x);
    let place = |k: usize| {
        let turn = FRAC_PI_2 * (from + (to - from) * k as f64 / SIDES as f64);
        at + left * (rho * (1.0 - turn.cos())) + along * (rho * turn.sin())
    };
    (0..=SIDES).map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(a: f64, b: f64) -> Vec<Point2> {
        [(a, a), (b, a), (b, b), (a, b)].map(|(x, y)| Point2::new(x, y)).to_vec()
    }

    /// Comes onto the wall and leaves it in its direction, from ground that is cleared, and goes over all of
    /// it.
    #[test]
    fn the_last_pass_swings_onto_the_wall_and_off_it() {
        let island = |a, b| square(a, b).into_iter().rev().collect::<Vec<_>>();
        let piece = Piece { outer: square(0.0, 40.0), islands: vec![island(18.0, 22.0)] };
        let rough = Piece { outer: square(0.3, 39.7), islands: vec![island(17.7, 22.3)] };
        let room = Room::new(&piece);
        for wall in piece.curves() {
            let run = around(wall, &room, Some(&rough), 3.0);
            let Entry::Ramp(way) = &run.entry else { panic!("a ramp over cleared ground") };
            assert!(way.windows(2).all(|w| Room::new(&rough).holds(&w[0], &w[1])));
            assert_eq!((way[0], way[way.len() - 1]), (run.points[0], run.points[0]));
            assert!(run.points.windows(2).all(|w| room.holds(&w[0], &w[1])));
            let walls = SegmentGrid::of_curves([wall]);
            for end in [run.points[1], run.points[run.points.len() - 1]] {
                assert!((walls.distance(&end) - 1.8).abs() < 1e-9 && rough.contains(&end));
            }
            let passed = SegmentGrid::new(
                run.points
                    .windows(2)
                    .map(|w| geometry::CurveSegment { ends: [w[0], w[1]], curve: 0, index: 0 })
                    .collect(),
            );
            assert!(wall.iter().all(|corner| passed.distance(corner) < 1e-9));
            // Only the four corners of the wall are sharp, and where the way comes from beside it.
            let sides: Vec<Vector2> =
                run.points.windows(2).map(|w| w[1] - w[0]).filter(|s| s.norm() > 1e-9).collect();
            let sharp = sides.windows(2).skip(1).filter(|w| w[0].angle(&w[1]) > 0.1).count();
            assert_eq!(sharp, 4);
        }
    }

    /// Where no arc has room the wall is ramped along.
    #[test]
    fn without_room_the_run_begins_on_the_wall() {
        let thin: Vec<Point2> =
            [(0., 0.), (30., 0.), (30., 0.2), (0., 0.2)].map(|(x, y)| Point2::new(x, y)).to_vec();
        let piece = Piece { outer: thin.clone(), islands: Vec::new() };
        let run = around(&thin, &Room::new(&piece), Some(&piece), 3.0);
        assert!(run.points.len() == 5 && matches!(&run.entry, Entry::Ramp(way) if *way == run.points));
        let run = around(&thin, &Room::new(&piece), None, 3.0);
        assert!(run.points.len() == 5);
    }
}
