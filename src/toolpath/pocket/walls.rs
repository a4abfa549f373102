//! Ways kept to where the cutter's centre may be.
//!
//! Enters: the piece of the centre, the exact region, a way. Leaves: the same way, in the piece: where it
//! would leave, it follows the wall of the piece instead; and whether a straight move keeps the cutter out of
//! the region's walls. Links are bends between curves and level curves come from triangles, so neither keeps
//! to walls by itself; mm.

use super::route::{Entry, Run};
use geometry::{NearestSegment, Piece, Point2, Region, SegmentGrid, Vector2, distance_of_segments};
use work::monitor::{Cancelled, Monitor, check};

/// What offsets may be off by rounding, mm: some 2⁻³⁰ of the size of the region.
pub(super) const ROUNDING: f64 = 5.0e-7;

/// Places nearer to the piece's wall than this, mm, are on it: far above rounding, far below any tolerance.
const ON_WALL: f64 = 1.0e-6;

/// Tips between round corners are moved by less than this over the radius.
const NEAR_TIP: f64 = 0.02;

/// The piece of the cutter's centre.
pub(super) struct Room<'a> {
    piece: &'a Piece,
    curves: Vec<&'a [Point2]>,
    walls: SegmentGrid,
}

/// A stretch of a move: how far along it begins and ends, 0 to 1.
type Stretch = [f64; 2];

impl<'a> Room<'a> {
    pub fn new(piece: &'a Piece) -> Self {
        let curves = piece.curves().collect();
        Self { piece, curves, walls: SegmentGrid::of_curves(piece.curves()) }
    }

    /// All runs in this room.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub fn keep_all(&self, runs: &mut Vec<Run>, monitor: &dyn Monitor) -> Result<(), Cancelled> {
        for run in std::mem::take(runs) {
            check(monitor)?;
            runs.extend(self.kept_runs(run));
        }
        Ok(())
    }

    /// The run in this room: several where a move would cross from one wall to another one.
    pub fn kept_runs(&self, run: Run) -> Vec<Run> {
        let entry = match run.entry {
            Entry::Ramp(way) => Entry::Ramp(self.kept(&way).pop().unwrap_or_default()),
            other => other,
        };
        let mut parts = self.kept(&run.points).into_iter();
        let first = Run { entry, points: parts.next().unwrap_or_default() };
        let back_and_forth = |points: Vec<Point2>| {
            let way = points.iter().chain(points.iter().rev().skip(1)).copied().collect();
            Run { entry: Entry::Ramp(way), points }
        };
        std::iter::once(first).chain(parts.map(back_and_forth)).collect()
    }

    /// The way in this room.
    fn kept(&self, way: &[Point2]) -> Vec<Vec<Point2>> {
        let places: Vec<Point2> = way.iter().map(|p| self.nearest_inside(p)).collect();
        let mut parts: Vec<Vec<Point2>> = vec![places.first().copied().into_iter().collect()];
        for ends in places.windows(2) {
            let (a, b) = (ends[0], ends[1]);
            for [from, to] in self.outside(&a, &b) {
                let ends = [from, to].map(|t| a + (b - a) * t);
                match (self.along_wall(&ends), parts.last_mut()) {
                    (Some(wall), Some(part)) => part.extend(wall),
                    _ => {
                        parts.last_mut().into_iter().for_each(|part| part.push(ends[0]));
                        parts.push(vec![ends[1]]);
                    }
                }
            }
            parts.last_mut().into_iter().for_each(|part| part.push(b));
        }
        parts.iter_mut().for_each(|part| part.dedup());
        parts.retain(|part| part.len() > 1 || part.len() == way.len());
        parts
    }

    /// The place of the wall that is nearest to a place, and its distance, mm.
    pub fn nearest(&self, p: &Point2) -> Option<(Point2, f64)> {
        let near = self.walls.nearest(p)?;
        Some((self.foot(&near), near.distance))
    }

    fn foot(&self, near: &NearestSegment) -> Point2 {
        let [a, b] = self.walls.segments()[near.segment as usize].ends;
        a + (b - a) * near.share
    }

    /// Whether the piece contains a place: it lies on the left of its sides. At a corner of two sides all of
    /// them are asked.
    fn contains(&self, p: &Point2, near: &NearestSegment) -> bool {
        /// Nearer to an end of a side, as a share of it, the place may be beside the next one.
        const END: f64 = 1e-6;
        let [a, b] = self.walls.segments()[near.segment as usize].ends;
        if near.distance > ON_WALL && (END..=1.0 - END).contains(&near.share) {
            return (b - a).perp(&(p - a)) > 0.0;
        }
        self.piece.contains(p)
    }

    /// The wall nearest to a place that is outside.
    fn outside_of(&self, p: &Point2) -> Option<NearestSegment> {
        self.walls.nearest(p).filter(|near| near.distance > ON_WALL && !self.contains(p, near))
    }

    fn is_outside(&self, p: &Point2) -> bool {
        self.outside_of(p).is_some()
    }

    /// Whether a place is inside.
    pub fn holds_place(&self, p: &Point2) -> bool {
        self.walls.nearest(p).is_some_and(|near| self.contains(p, &near))
    }

    /// The place itself, or the nearest one of the wall where it is outside.
    pub fn nearest_inside(&self, p: &Point2) -> Point2 {
        self.outside_of(p).map_or(*p, |near| self.foot(&near))
    }

    /// Distance of a place from the nearest wall, mm.
    pub fn distance(&self, p: &Point2) -> f64 {
        self.walls.distance(p)
    }

    /// Whether a straight move stays inside.
    pub fn holds(&self, a: &Point2, b: &Point2) -> bool {
        self.outside(a, b).is_empty()
    }

    /// The stretches of a move that lie outside.
    fn outside(&self, a: &Point2, b: &Point2) -> Vec<Stretch> {
        let mut cuts = vec![0.0, 1.0];
        let along = b - a;
        self.walls.near(&[a.inf(b), a.sup(b)], |k| {
            let [c, d] = self.walls.segments()[k as usize].ends;
            let across = along.perp(&(d - c));
            if across != 0.0 {
                let (t, u) = ((c - a).perp(&(d - c)) / across, (c - a).perp(&along) / across);
                if (0.0..=1.0).contains(&t) && (-1e-9..=1.0 + 1e-9).contains(&u) {
                    cuts.push(t);
                }
            }
        });
        cuts.sort_by(f64::total_cmp);
        let middle = |c: &Stretch| a + along * (0.5 * (c[0] + c[1]));
        let stretches = cuts.windows(2).map(|w| [w[0], w[1]]);
        stretches.filter(|c| self.is_outside(&middle(c))).collect()
    }

    /// The shorter way along a wall between two places on it, ends included; `None` where they are on two
    /// walls.
    fn along_wall(&self, ends: &[Point2; 2]) -> Option<Vec<Point2>> {
        let [from, to] = [self.walls.nearest(&ends[0])?, self.walls.nearest(&ends[1])?];
        let [first, last] = [from.segment, to.segment].map(|k| self.walls.segments()[k as usize]);
        if first.curve != last.curve {
            return None;
        }
        let curve = self.curves[first.curve as usize];
        let n = curve.len();
        let at = |index: usize, share: f64| curve[index] + (curve[(index + 1) % n] - curve[index]) * share;
        let (i, j) = (first.index as usize, last.index as usize);
        let [begin, end] = [at(i, from.share), at(j, to.share)];
        let way = |corners: Vec<usize>| {
            let corners = corners.into_iter().map(|k| curve[k % n]);
            std::iter::once(begin).chain(corners).chain([end]).collect::<Vec<Point2>>()
        };
        let wraps = |back: bool| i == j && (from.share > to.share) != back;
        let steps = (j + n - i) % n + if wraps(false) { n } else { 0 };
        let onwards = way((1..=steps).map(|k| i + k).collect());
        let steps = (i + n - j) % n + if wraps(true) && from.share != to.share { n } else { 0 };
        let backwards = way((0..steps).map(|k| i + 2 * n - k).collect());
        let length = |way: &[Point2]| way.windows(2).map(|w| (w[1] - w[0]).norm()).sum::<f64>();
        Some(if length(&onwards) <= length(&backwards) { onwards } else { backwards })
    }
}

/// An inset of `region` by `radius` whose round corners are chords between places on the circle: each chord
/// becomes the two tangents at its ends. So no side comes nearer to a wall than the radius, and straight ones
/// stand just there.
pub(super) fn tangent(inset: Region, region: &Region, radius: f64) -> Region {
    let walls = SegmentGrid::of_curves(region.curves());
    // The nearest place of the walls where a chord comes nearer than the radius, and which of its ends are on
    // the circle.
    let chord = |a: &Point2, b: &Point2| {
        let middle = nalgebra::center(a, b);
        let near = walls.nearest(&middle).filter(|near| near.distance < radius - ROUNDING)?;
        let [from, to] = walls.segments()[near.segment as usize].ends;
        let foot = from + (to - from) * near.share;
        let on_circle = |p: &Point2| ((p - foot).norm() - radius).abs() < ROUNDING;
        Some((foot, [on_circle(a), on_circle(b)]))
    };
    let corner = |a: &Point2, b: &Point2| {
        let (foot, _) = chord(a, b).filter(|(_, on)| *on == [true, true])?;
        let out = nalgebra::center(a, b) - foot;
        Some(foot + out * (radius * radius / out.norm_squared()))
    };
    // A chord that another one ends early ends where both circles meet.
    let tip = |before: &Point2, p: &Point2, after: &Point2| {
        let (Some((one, [true, false])), Some((other, [false, true]))) = (chord(before, p), chord(p, after))
        else {
            return *p;
        };
        let (half, middle) = (0.5 * (other - one), nalgebra::center(&one, &other));
        let (square, off) = (half.norm_squared(), p - middle);
        let out = (off - half * (off.dot(&half) / square)).try_normalize(0.0);
        let met = out.map(|out| middle + out * (radius * radius - square).max(0.0).sqrt());
        met.filter(|met| (met - p).norm() < NEAR_TIP * radius).unwrap_or(*p)
    };
    let rounded = |curve: Vec<Point2>| {
        let n = curve.len();
        let tips = (0..n).map(|k| tip(&curve[(k + n - 1) % n], &curve[k], &curve[(k + 1) % n]));
        let curve: Vec<Point2> = tips.collect();
        let corners: Vec<Option<Point2>> = (0..n).map(|k| corner(&curve[k], &curve[(k + 1) % n])).collect();
        // Between two tangents an end of chords lies on their common line, but in a tip.
        let begin = |k: usize| {
            let before = (k + n - 1) % n;
            let smooth = corners[before].zip(corners[k]).is_some_and(|(a, b)| {
                let (a, b) = (curve[k] - a, b - curve[k]);
                a.perp(&b).abs() < ROUNDING * (a.norm() + b.norm()) && a.dot(&b) > 0.0
            });
            (!smooth).then_some(curve[k])
        };
        (0..n).flat_map(|k| begin(k).into_iter().chain(corners[k])).collect::<Vec<Point2>>()
    };
    let pieces = inset.pieces.into_iter().map(|piece| Piece {
        outer: rounded(piece.outer),
        islands: piece.islands.into_iter().map(rounded).collect(),
    });
    Region { pieces: pieces.collect() }
}

/// The walls themselves, which a cutter may touch.
pub(super) struct Walls {
    grid: SegmentGrid,
    nearest: f64,
}

impl Walls {
    /// Of a region, and how near to them the cutter's centre may come, mm.
    pub fn new(region: &Region, nearest: f64) -> Self {
        Self { grid: SegmentGrid::of_curves(region.curves()), nearest }
    }

    /// Whether a straight move of a centre that is inside keeps its distance.
    pub fn hold(&self, a: &Point2, b: &Point2) -> bool {
        let reach = Vector2::new(self.nearest, self.nearest);
        let mut hold = true;
        self.grid.near(&[a.inf(b) - reach, a.sup(b) + reach], |k| {
            hold = hold
                && distance_of_segments(&[*a, *b], &self.grid.segments()[k as usize].ends) >= self.nearest;
        });
        hold
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(c: &[(f64, f64)]) -> Vec<Point2> {
        c.iter().map(|&(x, y)| Point2::new(x, y)).collect()
    }

    /// An L with an island.
    fn room() -> Piece {
        let outer = points(&[(0., 0.), (20., 0.), (20., 8.), (8., 8.), (8., 20.), (0., 20.)]);
        Piece { outer, islands: vec![points(&[(3., 3.), (3., 5.), (5., 5.), (5., 3.)])] }
    }

    #[test]
    fn a_way_past_a_reflex_corner_goes_around_it() {
        let piece = room();
        let kept = Room::new(&piece).kept(&points(&[(7., 12.), (12., 7.)]));
        assert_eq!(kept, [points(&[(7., 12.), (8., 11.), (8., 8.), (11., 8.), (12., 7.)])]);
    }

    #[test]
    fn places_beyond_a_wall_go_onto_it_and_ways_inside_stay() {
        let piece = room();
        let room = Room::new(&piece);
        let inside = points(&[(1., 1.), (19., 1.), (19., 0.), (0., 0.), (0., 20.)]);
        assert_eq!(room.kept(&inside), std::slice::from_ref(&inside));
        let beyond = points(&[(1., 1.), (10., -0.01), (19., 1.)]);
        assert_eq!(room.kept(&beyond), [points(&[(1., 1.), (10., 0.), (19., 1.)])]);
        // Through the island: around it, the shorter way.
        let through = room.kept(&points(&[(4.5, 2.), (4.5, 6.)]));
        assert_eq!(through, [points(&[(4.5, 2.), (4.5, 3.), (5., 3.), (5., 5.), (4.5, 5.), (4.5, 6.)])]);
    }

    /// Islands that touch: whichever way it takes around them, no move is outside.
    #[test]
    fn ways_over_islands_that_touch_stay_inside() {
        let slit = Piece {
            outer: points(&[(0., 0.), (9., 0.), (9., 9.), (0., 9.)]),
            islands: vec![
                points(&[(3., 1.), (3., 2.), (4., 2.), (4., 1.)]),
                points(&[(4., 1.), (4., 2.), (5., 2.), (5., 1.)]),
            ],
        };
        let run = Run { entry: Entry::Ramp(Vec::new()), points: points(&[(1., 1.5), (8., 1.5)]) };
        let runs = Room::new(&slit).kept_runs(run);
        assert!(
            runs.iter().all(|run| !run
                .points
                .windows(2)
                .any(|w| !Room::new(&slit).outside(&w[0], &w[1]).is_empty()))
        );
    }

    /// Around a reflex corner no side comes nearer than the radius, and straight walls are touched.
    #[test]
    fn sides_of_round_corners_are_tangents() {
        let region = Region { pieces: vec![room()] };
        for radius in [0.5, 0.9] {
            let inset = region.inset(radius - Region::offset_excess(radius));
            let round = tangent(inset.clone(), &region, radius);
            let nearest = |of: &Region| {
                let sides = SegmentGrid::of_curves(of.curves());
                let gap = |k: &geometry::CurveSegment| {
                    let all =
                        region.curves().flat_map(|c| (0..c.len()).map(move |i| [c[i], c[(i + 1) % c.len()]]));
                    all.map(|wall| distance_of_segments(&k.ends, &wall)).fold(f64::INFINITY, f64::min)
                };
                sides.segments().iter().map(gap).fold(f64::INFINITY, f64::min)
            };
            assert!(nearest(&inset) < radius * (1.0 - 1e-4), "chords cut in");
            assert!((nearest(&round) - radius).abs() < ROUNDING, "{}", nearest(&round));
            let walls = SegmentGrid::of_curves(region.curves());
            assert!(round.curves().flatten().all(|p| walls.distance(p) < radius * (1.0 + 2e-4)));
        }
    }

    /// Places are inside by the side nearest to them as they are by all sides.
    #[test]
    fn places_are_inside_by_their_nearest_side() {
        let piece = room();
        let room = Room::new(&piece);
        let mut inside = 0;
        for k in 0..4000 {
            let (a, b) = (0.618_034 * f64::from(k), 0.754_878 * f64::from(k));
            let p = Point2::new(24.0 * a.fract() - 2.0, 24.0 * b.fract() - 2.0);
            assert_eq!(room.holds_place(&p), piece.contains(&p), "{p}");
            inside += usize::from(piece.contains(&p));
        }
        assert!(inside > 1000, "{inside}");
    }

    /// In front of a neck that is too narrow two round corners meet in a tip.
    #[test]
    fn tips_between_round_corners_keep_the_radius() {
        let (low, high) = (points(&[(0., 0.), (20., 0.)]), points(&[(20., 20.), (0., 20.)]));
        for width in [7.6, 7.9, 7.98] {
            let (a, b) = (10.0 - 0.5 * width, 10.0 + 0.5 * width);
            let neck = points(&[(20., a), (26., a), (26., b), (20., b)]);
            let outline = [low.clone(), neck, high.clone()].concat();
            let region = Region::nested(vec![outline]).unwrap().0;
            let radius = 4.0;
            let inset = region.inset(radius - Region::offset_excess(radius));
            let round = tangent(inset, &region, radius);
            let walls = Walls::new(&region, radius - 2.0 * ROUNDING);
            let sides = SegmentGrid::of_curves(round.curves());
            let corner = Point2::new(20.0, a);
            assert!((sides.distance(&corner) - radius).abs() < 2.0 * ROUNDING);
            assert!(sides.segments().iter().all(|side| walls.hold(&side.ends[0], &side.ends[1])), "{width}");
        }
    }

    #[test]
    fn walls_hold_where_the_radius_has_room() {
        let region = Region { pieces: vec![room()] };
        let walls = Walls::new(&region, 1.0);
        assert!(walls.hold(&Point2::new(1.0, 1.0), &Point2::new(19.0, 1.0)));
        assert!(!walls.hold(&Point2::new(1.0, 1.0), &Point2::new(19.0, 0.99)));
        assert!(!walls.hold(&Point2::new(6.5, 12.0), &Point2::new(12.0, 6.5)));
    }
}
