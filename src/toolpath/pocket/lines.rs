//! Zigzag over a plane piece: parallel lines, joined along the walls, then once around each wall.

use super::route::{Entry, Run, begun_near};
use geometry::{Piece, Point2, SegmentGrid, Vector2};

/// One line within the piece, from wall to wall.
#[derive(Debug, Clone)]
pub(super) struct Line {
    pub points: Vec<Point2>,
    pub row: usize,
}

impl Line {
    fn ends(&self) -> [Point2; 2] {
        [self.points[0], self.points[self.points.len() - 1]]
    }
}

/// Where the curves of a piece cross the line on which `row` is `level`: the rising `along` of these places.
pub(super) fn crossings(
    piece: &Piece,
    level: f64,
    row: impl Fn(&Point2) -> f64,
    along: impl Fn(&Point2) -> f64,
) -> Vec<f64> {
    let mut crossings = Vec::new();
    for curve in piece.curves() {
        for (k, a) in curve.iter().enumerate() {
            let b = &curve[(k + 1) % curve.len()];
            let (from, to) = (row(a), row(b));
            if (from > level) != (to > level) {
                crossings.push(along(&(a + (b - a) * ((level - from) / (to - from)))));
            }
        }
    }
    crossings.sort_by(f64::total_cmp);
    crossings
}

/// Lines at `angle` (rad) from the x axis, `step` apart.
pub fn runs(piece: &Piece, angle: f64, step: f64) -> Vec<Run> {
    let (sin, cos) = angle.sin_cos();
    let (u, v) = (Vector2::new(cos, sin), Vector2::new(-sin, cos));
    let rows = |p: &Point2| p.coords.dot(&v);
    let (lo, hi) = piece.outer.iter().map(rows).fold((f64::MAX, f64::MIN), |(a, b), r| (a.min(r), b.max(r)));
    // The walls are gone around: the first line stands off by a step or less.
    let count = ((hi - lo) / step).ceil().max(1.0) as usize;
    let spacing = (hi - lo) / count as f64;
    let mut lines: Vec<Line> = Vec::new();
    for row in 1..count.max(2) {
        let level = if count == 1 { 0.5 * (lo + hi) } else { lo + spacing * row as f64 };
        let cuts = crossings(piece, level, rows, |p| p.coords.dot(&u));
        let at = |s: f64| Point2::from(u * s + v * level);
        lines.extend(
            cuts.chunks_exact(2)
                .filter(|c| c[1] > c[0])
                .map(|c| Line { points: vec![at(c[0]), at(c[1])], row }),
        );
    }
    along_walls(lines, Vec::new(), piece, spacing, |row, next| next == row + 1)
}

/// Runs that go on with lines, each from the end of one that it follows by its row, and then go around each
/// wall.
pub(super) fn along_walls(
    lines: Vec<Line>,
    runs: Vec<Run>,
    piece: &Piece,
    spacing: f64,
    follows: impl Fn(usize, usize) -> bool,
) -> Vec<Run> {
    let mut runs = chained(lines, runs, piece, spacing, follows);
    for wall in piece.curves() {
        let end = runs.last().and_then(|r: &Run| r.points.last()).copied();
        let closed = begun_near(wall, &end.unwrap_or(wall[0]), 0.0);
        let mut around = closed.clone();
        around.push(closed[0]);
        match runs.last_mut() {
            // The last line ended at this wall.
            Some(run) if end.is_some_and(|e| (e - closed[0]).norm() < 1e-6) => {
                run.points.extend(around.into_iter().skip(1))
            }
            _ => runs.push(Run { entry: Entry::Ramp(around.clone()), points: around }),
        }
    }
    runs
}

/// Lines one after the other: from each to one that follows it and whose end can be reached along a wall.
fn chained(
    mut lines: Vec<Line>,
    mut runs: Vec<Run>,
    piece: &Piece,
    spacing: f64,
    follows: impl Fn(usize, usize) -> bool,
) -> Vec<Run> {
    let walls = SegmentGrid::of_curves(piece.curves());
    let mut at: Option<(usize, Point2)> = None;
    while !lines.is_empty() {
        let next = at.and_then(|(row, end)| {
            let ends = lines.iter().enumerate().filter(|(_, l)| follows(row, l.row));
            ends.flat_map(|(k, l)| [(k, 0), (k, 1)].map(|(k, e)| (k, e, l.ends()[e])))
                .filter_map(|(k, e, p)| link(piece, &walls, &[end, p], spacing).map(|way| (k, e, way)))
                .min_by(|a, b| length(&a.2).total_cmp(&length(&b.2)))
        });
        if let (Some((k, e, way)), Some(run)) = (next, runs.last_mut()) {
            let line = lines.remove(k);
            run.points.extend(way.into_iter().skip(1));
            let end = line.ends()[1 - e];
            let mut points = line.points;
            if e == 1 {
                points.reverse();
            }
            run.points.extend(points.into_iter().skip(1));
            at = Some((line.row, end));
        } else {
            let first = (0..lines.len()).min_by_key(|k| lines[*k].row).unwrap_or(0);
            let line = lines.remove(first);
            let way = line.points.iter().chain(line.points.iter().rev().skip(1)).copied().collect();
            at = Some((line.row, line.ends()[1]));
            runs.push(Run { entry: Entry::Ramp(way), points: line.points });
        }
    }
    runs
}

/// A way from an end of a line to that of another: along the wall that both are at, else straight where
/// nothing is between.
fn link(piece: &Piece, walls: &SegmentGrid, [a, b]: &[Point2; 2], spacing: f64) -> Option<Vec<Point2>> {
    /// It is at most so many times the distance of rows long.
    const LONGEST: f64 = 4.0;
    /// Ends this share of the distance of rows off a wall are at it: triangles follow it no closer.
    const AT_WALL: f64 = 0.01;
    let longest = LONGEST * spacing;
    if [a, b].iter().all(|p| walls.distance(p) <= AT_WALL * spacing) {
        return along_wall(piece, walls, a, b, longest);
    }
    is_clear(piece, walls, &[*a, *b], longest).then(|| vec![*a, *b])
}

/// Whether a straight way is no longer than `longest` and stays in the piece, as far as some places of it
/// tell.
pub(super) fn is_clear(piece: &Piece, walls: &SegmentGrid, [a, b]: &[Point2; 2], longest: f64) -> bool {
    const PLACES: usize = 16;
    let inside = |p: &Point2| piece.contains(p) || walls.distance(p) < 1e-6;
    (b - a).norm() <= longest && (1..PLACES).all(|k| inside(&(a + (b - a) * (k as f64 / PLACES as f64))))
}

fn length(way: &[Point2]) -> f64 {
    way.windows(2).map(|w| (w[1] - w[0]).norm()).sum()
}

/// The way along one wall from `a` to `b`, both on it, if it is no longer than `longest`.
fn along_wall(
    piece: &Piece,
    walls: &SegmentGrid,
    a: &Point2,
    b: &Point2,
    longest: f64,
) -> Option<Vec<Point2>> {
    if (b - a).norm() > longest {
        return None;
    }
    let (from, to) = (walls.nearest(a)?, walls.nearest(b)?);
    let (s, t) = (walls.segments()[from.segment as usize], walls.segments()[to.segment as usize]);
    if s.curve != t.curve {
        return None;
    }
    let curve = piece.curves().nth(s.curve as usize)?;
    let n = curve.len();
    let walk = |forwards: bool| {
        let mut way = vec![*a];
        let (mut k, last) = (s.index as usize, t.index as usize);
        let ahead = if forwards { from.share <= to.share } else { from.share >= to.share };
        let mut first = true;
        while k != last || (first && !ahead) {
            first = false;
            way.push(curve[if forwards { (k + 1) % n } else { k }]);
            k = if forwards { (k + 1) % n } else { (k + n - 1) % n };
            if length(&way) > longest {
                return None;
            }
        }
        way.push(*b);
        (length(&way) <= longest).then_some(way)
    };
    match (walk(true), walk(false)) {
        (Some(x), Some(y)) => Some(if length(&x) <= length(&y) { x } else { y }),
        (x, y) => x.or(y),
    }
}
