//! What one move takes off a level line before a wall.
//!
//! What a cutter sweeps along a straight move, and all above it, is convex. So a level line meets it in one
//! stretch, and the height of the cut over that line is a convex function. mm.

use geometry::{Point2, Point3, Vector2};
use motion::{Cutters, Toolpath};
use sim::Envelope;

/// Steps of a golden section: each leaves 0.62 of a stretch.
const GOLDEN_STEPS: usize = 48;
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Halvings in search of where a cut begins.
const HALVINGS: usize = 50;

/// How far inside the border of a sweep its height is asked for, mm: at the border itself rounding decides.
const INSIDE: f64 = 1e-10;

/// The moves before walls.
pub(super) struct Moves<'a> {
    pub envelope: &'a Envelope,
    pub path: &'a Toolpath,
    pub cutters: &'a Cutters,
}

/// A level line: from a place of the plan along a unit vector, at a height.
#[derive(Clone, Copy)]
pub(super) struct Line {
    pub from: Point2,
    pub way: Vector2,
    pub z: f64,
}

impl Moves<'_> {
    /// Radius of the cutter of a move, mm.
    pub fn radius(&self, k: u32) -> f64 {
        self.cutters.of_move(k).radius()
    }

    /// Both ends of a move.
    pub fn ends(&self, k: u32) -> [Point3; 2] {
        [self.path.start_of(k as usize), self.path.moves[k as usize].to.tip]
    }

    /// Height of the cut of a move over a place; infinite where it does not pass.
    pub fn height(&self, k: u32, q: Point2) -> f64 {
        self.envelope.height(k, q.x, q.y).unwrap_or(f64::INFINITY)
    }

    /// Where the cut of a move begins on a line; `None` where it takes nothing of the line in front of its
    /// begin.
    pub fn begin(&self, k: u32, line: &Line) -> Option<f64> {
        let [a, b] = self.ends(k);
        if a.z.min(b.z) > line.z {
            return None;
        }
        let [first, last] = stadium(&a.xy(), &b.xy(), self.radius(k), line.from, line.way)?;
        if last <= 0.0 {
            return None;
        }
        let over = |s: f64| self.height(k, line.from + line.way * s) - line.z;
        let inside = INSIDE.min(0.25 * (last - first));
        let begin = if over(first + inside) <= 0.0 {
            first
        } else {
            let (within, least) = lowest(&over, [first + inside, last - inside]);
            if least > 0.0 {
                return None;
            }
            let (mut out, mut within) = (first + inside, within);
            for _ in 0..HALVINGS {
                let middle = 0.5 * (out + within);
                *(if over(middle) <= 0.0 { &mut within } else { &mut out }) = middle;
            }
            within
        };
        // One stretch that begins behind the line's begin goes on in front of it only where that is inside.
        (begin >= 0.0 || over(0f64.max(first + inside)) <= 0.0).then_some(begin)
    }
}

/// Where a convex function is least, or not above 0.
fn lowest(f: &dyn Fn(f64) -> f64, range: [f64; 2]) -> (f64, f64) {
    let (x, least) = greatest(&|x| -f(x), range, Some(0.0));
    (x, -least)
}

/// Where a function with one hill is greatest; the search ends where it is not below `enough`.
pub(super) fn greatest(f: &dyn Fn(f64) -> f64, [mut a, mut b]: [f64; 2], enough: Option<f64>) -> (f64, f64) {
    let mut best =
        [a, b].map(|x| (x, f(x))).into_iter().max_by(|p, q| p.1.total_cmp(&q.1)).unwrap_or((a, f(a)));
    let (mut c, mut d) = (b - GOLDEN * (b - a), a + GOLDEN * (b - a));
    let (mut fc, mut fd) = (f(c), f(d));
    for _ in 0..GOLDEN_STEPS {
        for (x, y) in [(c, fc), (d, fd)] {
            if y > best.1 {
                best = (x, y);
            }
        }
        if enough.is_some_and(|enough| best.1 >= enough) {
            break;
        }
        if fc >= fd {
            (b, d, fd) = (d, c, fc);
            c = b - GOLDEN * (b - a);
            fc = f(c);
        } else {
            (a, c, fc) = (c, d, fd);
            d = a + GOLDEN * (b - a);
            fd = f(d);
        }
    }
    best
}

/// The stretch of the line from `from` along the unit vector `way` within `radius` of the segment from `a` to
/// `b`.
pub(super) fn stadium(a: &Point2, b: &Point2, radius: f64, from: Point2, way: Vector2) -> Option<[f64; 2]> {
    let across = Vector2::new(-way.y, way.x);
    let seen = |p: &Point2| [(p - from).dot(&way), (p - from).dot(&across)];
    let (a, b) = (seen(a), seen(b));
    let mut found = [f64::INFINITY, f64::NEG_INFINITY];
    let mut add = |s: f64| found = [found[0].min(s), found[1].max(s)];
    for end in [a, b] {
        let half = radius * radius - end[1] * end[1];
        if half >= 0.0 {
            add(end[0] - half.sqrt());
            add(end[0] + half.sqrt());
        }
    }
    let d = Vector2::new(b[0] - a[0], b[1] - a[1]);
    let length = d.norm();
    if length > 0.0 && d.y != 0.0 {
        let side = Vector2::new(-d.y, d.x) * (radius / length);
        for side in [side, -side] {
            let t = -(a[1] + side.y) / d.y;
            if (0.0..=1.0).contains(&t) {
                add(a[0] + side.x + t * d.x);
            }
        }
    }
    (found[0] <= found[1]).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use cutter::Cutter;
    use sim::scenes::{Rng, cutters, path_through};

    #[test]
    fn a_stadium_is_met_where_its_distance_is_the_radius() {
        let mut rng = Rng::new(11);
        let mut met = 0;
        for _ in 0..2000 {
            let mut point = || Point2::new(rng.within(-3.0, 3.0), rng.within(-3.0, 3.0));
            let (a, b, from, to) = (point(), point(), point(), point());
            let way = (to - from).normalize();
            let distance = |s: f64| geometry::distance_to_segment(&(from + way * s), &a, &b);
            match stadium(&a, &b, 1.2, from, way) {
                Some(ends) => {
                    met += 1;
                    assert!(ends.iter().all(|s| (distance(*s) - 1.2).abs() < 1e-9), "{ends:?}");
                }
                None => assert!((-80..80).all(|k| distance(0.1 * f64::from(k)) >= 1.2 - 1e-9)),
            }
        }
        assert!(met > 500);
    }

    #[test]
    fn a_cut_begins_where_the_envelope_comes_down_to_the_line() {
        let mut rng = Rng::new(3);
        for cutter in cutters() {
            for _ in 0..60 {
                let mut point =
                    || Point3::new(rng.within(-3.0, 3.0), rng.within(1.0, 6.0), rng.within(-2.0, 1.0));
                let path = path_through([point(), point()]);
                let envelope = Envelope::new(cutter, &path);
                let moves = Moves { envelope: &envelope, path: &path, cutters: &cutter.into() };
                let line = Line { from: Point2::origin(), way: Vector2::y(), z: 0.5 };
                let taken = |s: f64| moves.height(0, Point2::new(0.0, s)) <= 0.5;
                let first = (0..9000).map(|k| 1e-3 * f64::from(k)).find(|s| taken(*s));
                match (moves.begin(0, &line), first) {
                    (Some(begin), Some(first)) if begin >= 0.0 => {
                        assert!(begin <= first + 1e-6 && begin > first - 1.1e-3, "{begin} {first}");
                    }
                    (Some(begin), first) => assert!(first == Some(0.0) || begin > 0.0 && first.is_none()),
                    (None, first) => assert_eq!(first, None, "{cutter:?}"),
                }
            }
        }
        // A flat's side is vertical at every height.
        let path = path_through([Point3::new(-5.0, 2.9, -1.0), Point3::new(5.0, 2.9, -1.0)]);
        let cutter = Cutter::flat(6.0).unwrap();
        let envelope = Envelope::new(cutter, &path);
        let moves = Moves { envelope: &envelope, path: &path, cutters: &cutter.into() };
        let begin = |z: f64| moves.begin(0, &Line { from: Point2::origin(), way: Vector2::y(), z });
        assert!((begin(0.0).unwrap() + 0.1).abs() < 1e-12 && begin(-1.1).is_none());
    }
}
