//! Plane regions with islands: nested outlines, offset inwards and outwards, area, places inside; mm.
//!
//! Enters: closed polylines. Leaves: pieces, each one outer outline (counter-clockwise) and its islands
//! (clockwise), without crossings. Offsets are done by `i_overlay` on a grid of integers: robust
//! on any input, and rounded by a 2⁻³⁰th of the region's size or less.

use i_overlay::core::fill_rule::FillRule;
use i_overlay::core::overlay_rule::OverlayRule;
use i_overlay::float::single::SingleFloatOverlay;
use i_overlay::mesh::float::outline::offset::OutlineOffset;
use i_overlay::mesh::float::style::{LineJoin, OutlineStyle};
use i_overlay::mesh::math::MathMode;

use super::{CurveSegment, Point2, SegmentGrid};
use work::monitor::{self, Cancelled, Monitor};

/// Most points of all outlines together. Fields, offsets and searches grow with them; a drawing with more
/// is noise.
pub const MAX_OUTLINE_POINTS: usize = 200_000;

/// Chords of round corners of an offset span at most this angle, rad, and at least the crate's least
/// angle of 0.01 π. Their sagitta is r·δ²/8, 0.4 µm on a radius of 3 mm.
const ROUND_STEP: f64 = 0.032;

/// Offsets of fewer points than this take milliseconds and are not done aside.
const SOON_OFFSET: usize = 500;

/// Pieces and islands with less area than this share of the square of the offset are rounding, not shape.
const LEAST_AREA: f64 = 1.0e-9;

/// One connected piece.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Piece {
    /// Its outline, counter-clockwise; the last point is joined to the first.
    pub outer: Vec<Point2>,
    /// Its islands, clockwise.
    pub islands: Vec<Vec<Point2>>,
}

/// A region of the plane.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Region {
    /// Its pieces; they do not overlap.
    pub pieces: Vec<Piece>,
}

/// Why closed curves bound no region. Curves are counted from 0.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum RegionError {
    /// There are no curves.
    #[error("there is no closed outline")]
    Empty,
    /// A coordinate is not finite or beyond [`MAX_COORDINATE`](super::MAX_COORDINATE).
    #[error("point {index} is not a finite number of at most 1e6 mm")]
    Coordinate {
        /// Which curve.
        curve: usize,
        /// Which point of it.
        index: usize,
    },
    /// Too few corners, or no area.
    #[error("it encloses no area")]
    NoArea {
        /// Which curve.
        curve: usize,
    },
    /// A curve crosses or touches itself.
    #[error("it crosses itself at x {:.4} y {:.4}", at.x, at.y)]
    SelfCrossing {
        /// Which curve.
        curve: usize,
        /// Where.
        at: Point2,
    },
    /// Two curves cross or touch.
    #[error("it meets another outline at x {:.4} y {:.4}", at.x, at.y)]
    Crossing {
        /// The two.
        curves: [usize; 2],
        /// Where.
        at: Point2,
    },
    /// Two curves are the same.
    #[error("it is drawn twice")]
    Duplicate {
        /// The two.
        curves: [usize; 2],
    },
    /// All outlines together have too many points.
    #[error(
        "the outlines have {0} points, and {MAX_OUTLINE_POINTS} are allowed; use a greater chord tolerance"
    )]
    TooManyPoints(usize),
}

/// Area of a closed curve, mm², positive when counter-clockwise.
pub fn signed_area(curve: &[Point2]) -> f64 {
    let Some(&o) = curve.first() else { return 0.0 };
    let twice: f64 = curve.windows(2).map(|w| (w[0] - o).perp(&(w[1] - o))).sum();
    0.5 * twice
}

/// Whether a closed curve winds around `p` (even-odd rule).
pub fn inside_curve(curve: &[Point2], p: &Point2) -> bool {
    let mut inside = false;
    for (k, a) in curve.iter().enumerate() {
        let b = &curve[(k + 1) % curve.len()];
        if (a.y > p.y) != (b.y > p.y) && p.x < a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x) {
            inside = !inside;
        }
    }
    inside
}

/// Least and greatest coordinates of a curve that has points.
fn plan_box(curve: &[Point2]) -> [Point2; 2] {
    curve.iter().fold([curve[0]; 2], |[lo, hi], p| [lo.inf(p), hi.sup(p)])
}

fn in_box([lo, hi]: &[Point2; 2], p: &Point2) -> bool {
    lo.x <= p.x && p.x <= hi.x && lo.y <= p.y && p.y <= hi.y
}

/// Where two segments meet, if they do.
fn meeting(a: &[Point2; 2], b: &[Point2; 2]) -> Option<Point2> {
    let (d, e) = (a[1] - a[0], b[1] - b[0]);
    let side = |from: &Point2, along: &super::Vector2, p: &Point2| along.perp(&(p - from));
    let (s0, s1) = (side(&a[0], &d, &b[0]), side(&a[0], &d, &b[1]));
    let (t0, t1) = (side(&b[0], &e, &a[0]), side(&b[0], &e, &a[1]));
    let between = |ends: &[Point2; 2], p: &Point2| {
        let (lo, hi) = (ends[0].inf(&ends[1]), ends[0].sup(&ends[1]));
        lo.x <= p.x && p.x <= hi.x && lo.y <= p.y && p.y <= hi.y
    };
    for (cross, segment, p) in [(s0, a, b[0]), (s1, a, b[1]), (t0, b, a[0]), (t1, b, a[1])] {
        if cross == 0.0 && between(segment, &p) {
            return Some(p);
        }
    }
    if (s0 > 0.0) != (s1 > 0.0) && (t0 > 0.0) != (t1 > 0.0) && s0 != s1 {
        return Some(b[0] + e * (s0 / (s0 - s1)));
    }
    None
}

/// Without repeated points, and turned to a sense.
fn tidy(mut curve: Vec<Point2>, counter_clockwise: bool) -> Vec<Point2> {
    curve.dedup();
    while curve.len() > 1 && curve.first() == curve.last() {
        curve.pop();
    }
    if (signed_area(&curve) > 0.0) != counter_clockwise {
        curve.reverse();
    }
    curve
}

impl Piece {
    /// The outline, then the islands.
    pub fn curves(&self) -> impl Iterator<Item = &[Point2]> + Clone {
        std::iter::once(self.outer.as_slice()).chain(self.islands.iter().map(Vec::as_slice))
    }

    /// Area, mm².
    pub fn area(&self) -> f64 {
        self.curves().map(signed_area).sum()
    }

    /// Whether a place lies inside; on the very border either answer may come.
    pub fn contains(&self, p: &Point2) -> bool {
        inside_curve(&self.outer, p) && !self.islands.iter().any(|island| inside_curve(island, p))
    }
}

impl Region {
    /// The region between nested closed curves: those in none are outlines, those in an outline are
    /// islands, those in an island are outlines again. Senses are of no account. Also tells how deep each
    /// curve is nested.
    ///
    /// # Errors
    /// See [`RegionError`]; curves may neither cross nor touch.
    pub fn nested(curves: Vec<Vec<Point2>>) -> Result<(Self, Vec<usize>), RegionError> {
        let count = curves.iter().map(Vec::len).sum();
        if count > MAX_OUTLINE_POINTS {
            return Err(RegionError::TooManyPoints(count));
        }
        if curves.is_empty() {
            return Err(RegionError::Empty);
        }
        for (curve, points) in curves.iter().enumerate() {
            let bad = |p: &Point2| p.coords.iter().any(|c| c.is_nan() || c.abs() > super::MAX_COORDINATE);
            if let Some(index) = points.iter().position(bad) {
                return Err(RegionError::Coordinate { curve, index });
            }
        }
        let curves: Vec<Vec<Point2>> = curves.into_iter().map(|c| tidy(c, true)).collect();
        for (curve, points) in curves.iter().enumerate() {
            if points.len() < 3 {
                return Err(RegionError::NoArea { curve });
            }
        }
        check_crossings(&curves)?;
        if let Some(curve) = curves.iter().position(|c| signed_area(c) <= 0.0) {
            return Err(RegionError::NoArea { curve });
        }
        let boxes: Vec<[Point2; 2]> = curves.iter().map(|curve| plan_box(curve)).collect();
        let inside = |a: usize, b: usize| {
            a != b && in_box(&boxes[b], &curves[a][0]) && inside_curve(&curves[b], &curves[a][0])
        };
        let depth: Vec<usize> =
            work::parallel::map(curves.len(), |a| (0..curves.len()).filter(|&b| inside(a, b)).count());
        let mut region = Self::default();
        let mut piece_of = vec![usize::MAX; curves.len()];
        for (k, curve) in curves.iter().enumerate().filter(|(k, _)| depth[*k].is_multiple_of(2)) {
            piece_of[k] = region.pieces.len();
            region.pieces.push(Piece { outer: curve.clone(), islands: Vec::new() });
        }
        for (k, curve) in curves.iter().enumerate().filter(|(k, _)| !depth[*k].is_multiple_of(2)) {
            let around = (0..curves.len()).find(|&b| depth[b] + 1 == depth[k] && inside(k, b));
            if let Some(piece) = around.map(|b| piece_of[b]) {
                region.pieces[piece].islands.push(tidy(curve.clone(), false));
            }
        }
        Ok((region, depth))
    }

    /// All outlines and islands.
    pub fn curves(&self) -> impl Iterator<Item = &[Point2]> + Clone {
        self.pieces.iter().flat_map(Piece::curves)
    }

    /// True without pieces.
    pub fn is_empty(&self) -> bool {
        self.pieces.is_empty()
    }

    /// Area, mm².
    pub fn area(&self) -> f64 {
        self.pieces.iter().map(Piece::area).sum()
    }

    /// Least and greatest coordinates; `None` without pieces.
    pub fn bounds(&self) -> Option<[Point2; 2]> {
        self.curves()
            .flatten()
            .fold(None, |b, p| Some(b.map_or([*p, *p], |[lo, hi]: [Point2; 2]| [lo.inf(p), hi.sup(p)])))
    }

    /// Whether a place lies inside; on the very border either answer may come.
    pub fn contains(&self, p: &Point2) -> bool {
        self.pieces.iter().any(|piece| piece.contains(p))
    }

    /// The places at least `distance` inside: where the centre of a disc of that radius may be.
    ///
    /// # Tolerance
    /// Nowhere nearer to the border than `distance` less the rounding. Round corners (around corners of
    /// islands) are chords whose middles touch the circle: they stay away up to `distance · 1.3e-4` more.
    pub fn inset(&self, distance: f64) -> Self {
        self.offset(-distance)
    }

    /// The places within `distance` of the region.
    ///
    /// # Tolerance
    /// Round corners are chords whose middles touch the circle, so that they reach out up to
    /// `distance · 1.3e-4` too far.
    pub fn grown(&self, distance: f64) -> Self {
        self.offset(distance)
    }

    /// As [`Region::inset`], and the monitor is asked while it lasts.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub fn watched_inset(&self, distance: f64, monitor: &dyn Monitor) -> Result<Self, Cancelled> {
        self.watched_offset(-distance, monitor)
    }

    /// As [`Region::grown`], and the monitor is asked while it lasts.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub fn watched_grown(&self, distance: f64, monitor: &dyn Monitor) -> Result<Self, Cancelled> {
        self.watched_offset(distance, monitor)
    }

    fn watched_offset(&self, distance: f64, monitor: &dyn Monitor) -> Result<Self, Cancelled> {
        if self.curves().map(<[Point2]>::len).sum::<usize>() < SOON_OFFSET {
            monitor::check(monitor)?;
            return Ok(self.offset(distance));
        }
        let region = self.clone();
        work::aside::run(monitor, move || region.offset(distance))
    }

    /// How much farther than by `distance` straight sides move in an offset, mm: so far that the chords of
    /// round corners come no nearer.
    pub fn offset_excess(distance: f64) -> f64 {
        distance / (0.5 * ROUND_STEP).cos() - distance
    }

    fn offset(&self, distance: f64) -> Self {
        if distance == 0.0 || self.is_empty() {
            return self.clone();
        }
        if let [piece] = self.pieces.as_slice()
            && distance > 0.0
            && !piece.islands.is_empty()
        {
            return Self::piece_grown(piece, distance);
        }
        // Corners of the chords lie outside of the circle by as much as puts their middles on it.
        let radius = distance / (0.5 * ROUND_STEP).cos();
        let round = LineJoin::Round(ROUND_STEP);
        // Straight sides move by as much, which keeps to the safe side.
        let style = OutlineStyle::new(radius).line_join(round).math(MathMode::Float);
        Self::of_shapes(self.shapes().outline_as::<i64>(&style), distance)
    }

    /// A piece whose outline grows and whose islands shrink, each by itself: what lies inside of one island
    /// is nearer to no other curve. Chords of round corners shrink until they cross each other many times,
    /// which takes long by crossings.
    fn piece_grown(piece: &Piece, distance: f64) -> Self {
        let alone = |outer| Self { pieces: vec![Piece { outer, islands: Vec::new() }] };
        let mut grown = alone(piece.outer.clone()).offset(distance);
        let shrunk = work::parallel::map(piece.islands.len(), |k| {
            let island = tidy(piece.islands[k].clone(), true);
            match shrunk_convex(&island, distance) {
                Some(left) => Self::of_shapes(vec![vec![left]], distance),
                None => alone(island).offset(-distance),
            }
        });
        let left = shrunk.into_iter().flat_map(|region| region.pieces).map(|piece| tidy(piece.outer, false));
        if let Some(whole) = grown.pieces.first_mut() {
            whole.islands.extend(left);
        }
        grown
    }

    fn shapes(&self) -> Vec<Vec<Vec<[f64; 2]>>> {
        let plain = |c: &[Point2]| c.iter().map(|p| [p.x, p.y]).collect();
        self.pieces.iter().map(|piece| piece.curves().map(plain).collect()).collect()
    }

    fn of_shapes(shapes: Vec<Vec<Vec<[f64; 2]>>>, scale: f64) -> Self {
        let least = LEAST_AREA * scale * scale;
        let curve =
            |c: Vec<[f64; 2]>, outer| tidy(c.into_iter().map(|[x, y]| Point2::new(x, y)).collect(), outer);
        let mut pieces = Vec::with_capacity(shapes.len());
        for shape in shapes {
            let mut curves = shape.into_iter();
            let Some(outer) = curves.next().map(|c| curve(c, true)) else { continue };
            let islands = curves.map(|c| curve(c, false)).filter(|c| signed_area(c) < -least).collect();
            if signed_area(&outer) > least {
                pieces.push(Piece { outer, islands });
            }
        }
        // The crate's order follows its sweep; by place it follows the drawing.
        pieces.sort_by(|a, b| {
            let key = |p: &Piece| p.outer.iter().fold(Point2::new(f64::MAX, f64::MAX), |m, q| m.inf(q));
            let (a, b) = (key(a), key(b));
            a.y.total_cmp(&b.y).then(a.x.total_cmp(&b.x))
        });
        Self { pieces }
    }

    /// What lies in this region or in the other one.
    pub fn union(&self, other: &Self) -> Self {
        self.combined(other, OverlayRule::Union)
    }

    /// What lies in both regions.
    pub fn intersection(&self, other: &Self) -> Self {
        self.combined(other, OverlayRule::Intersect)
    }

    /// What lies in this region and not in the other one.
    pub fn without(&self, other: &Self) -> Self {
        self.combined(other, OverlayRule::Difference)
    }

    fn combined(&self, other: &Self, rule: OverlayRule) -> Self {
        let size = self.bounds().map_or(0.0, |[lo, hi]| (hi - lo).amax());
        Self::of_shapes(self.shapes().overlay_as::<i64>(&other.shapes(), rule, FillRule::NonZero), size)
    }

    /// The largest disc inside: its centre and its radius, mm, within `precision`. `None` without pieces.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub fn largest_disc(
        &self,
        precision: f64,
        monitor: &dyn Monitor,
    ) -> Result<Option<(Point2, f64)>, Cancelled> {
        /// Squares that are looked at at most; a good answer is found long before.
        const MAX_SQUARES: usize = 20_000;
        let Some([lo, hi]) = self.bounds() else { return Ok(None) };
        let walls = SegmentGrid::of_curves(self.curves());
        let signed = |p: &Point2| if self.contains(p) { walls.distance(p) } else { -walls.distance(p) };
        let half = 0.5 * (hi - lo).amax() / 8.0;
        // Squares by what a disc in them could reach, greatest first.
        let mut queue: Vec<(f64, f64, Point2, f64)> = Vec::new();
        let push = |queue: &mut Vec<(f64, f64, Point2, f64)>, centre: Point2, half: f64| {
            let d = signed(&centre);
            let entry = (d + half * std::f64::consts::SQRT_2, d, centre, half);
            let k = queue.partition_point(|e| e.0 <= entry.0);
            queue.insert(k, entry);
        };
        for j in 0..8 {
            for i in 0..8 {
                let at = |k: i32| half * f64::from(2 * k + 1);
                push(&mut queue, lo + super::Vector2::new(at(i), at(j)), half);
            }
        }
        let mut best = (lo, f64::NEG_INFINITY);
        for _ in 0..MAX_SQUARES {
            monitor::check(monitor)?;
            let Some((could, d, centre, half)) = queue.pop() else { break };
            if d > best.1 {
                best = (centre, d);
            }
            if could <= best.1 + precision {
                break;
            }
            for (x, y) in [(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)] {
                push(&mut queue, centre + super::Vector2::new(x, y) * half, 0.5 * half);
            }
        }
        Ok(Some(best))
    }
}

/// What lies at least `distance` inside of a convex counter-clockwise curve, as far as [`Region::inset`]
/// takes it: what all of its sides have on their left. `None` where the curve is not convex.
fn shrunk_convex(curve: &[Point2], distance: f64) -> Option<Vec<[f64; 2]>> {
    let n = curve.len();
    let side = |k: usize| curve[(k + 1) % n] - curve[k];
    if (0..n).any(|k| side(k).perp(&side((k + 1) % n)) < 0.0) {
        return None;
    }
    let by = distance / (0.5 * ROUND_STEP).cos();
    let mut left = rectangle_around(curve);
    for k in 0..n {
        let Some(along) = side(k).try_normalize(0.0) else { continue };
        let inside = |p: &Point2| along.perp(&(p - curve[k])) - by;
        left = clipped(&left, inside);
    }
    Some(left.into_iter().map(|p| [p.x, p.y]).collect())
}

/// What of a polygon lies where `inside`, linear in the place, is 0 or more (I. Sutherland and G. Hodgman
/// 1974).
pub fn clipped<const D: usize>(
    polygon: &[nalgebra::Point<f64, D>],
    inside: impl Fn(&nalgebra::Point<f64, D>) -> f64,
) -> Vec<nalgebra::Point<f64, D>> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (k, a) in polygon.iter().enumerate() {
        let b = &polygon[(k + 1) % polygon.len()];
        let (from, to) = (inside(a), inside(b));
        if from >= 0.0 {
            kept.push(*a);
        }
        if (from < 0.0) != (to < 0.0) {
            kept.push(a + (b - a) * (from / (from - to)));
        }
    }
    kept
}

/// The rectangle around a curve, counter-clockwise.
fn rectangle_around(curve: &[Point2]) -> Vec<Point2> {
    let [lo, hi] = plan_box(curve);
    vec![lo, Point2::new(hi.x, lo.y), hi, Point2::new(lo.x, hi.y)]
}

/// Where closed curves first cross or touch themselves or each other: the two sides and the place.
pub fn first_crossing(curves: &[Vec<Point2>]) -> Option<(CurveSegment, CurveSegment, Point2)> {
    let grid = SegmentGrid::of_curves(curves.iter().map(Vec::as_slice));
    let mut found: Option<(u32, u32, Point2)> = None;
    for (k, s) in grid.segments().iter().enumerate() {
        grid.near(&s.ends, |other| {
            let o = &grid.segments()[other as usize];
            if other as usize <= k || found.is_some_and(|f| f.0 < k as u32 || f.1 <= other) {
                return;
            }
            let n = curves[s.curve as usize].len() as u32;
            let beside = s.curve == o.curve && (o.index == s.index + 1 || (s.index == 0 && o.index == n - 1));
            if beside {
                // Neighbours share an end; they overlap only where the second turns straight back.
                let (a, b, c) = if o.index == s.index + 1 {
                    (s.ends[0], s.ends[1], o.ends[1])
                } else {
                    (o.ends[0], o.ends[1], s.ends[1])
                };
                if (b - a).perp(&(c - b)) == 0.0 && (b - a).dot(&(c - b)) < 0.0 {
                    found = Some((k as u32, other, b));
                }
            } else if let Some(at) = meeting(&s.ends, &o.ends) {
                found = Some((k as u32, other, at));
            }
        });
        if found.is_some() {
            break;
        }
    }
    found.map(|(a, b, at)| (grid.segments()[a as usize], grid.segments()[b as usize], at))
}

/// Refuses curves that cross or touch themselves or each other.
fn check_crossings(curves: &[Vec<Point2>]) -> Result<(), RegionError> {
    let Some((a, b, at)) = first_crossing(curves) else { return Ok(()) };
    let pair = [a.curve as usize, b.curve as usize];
    if pair[0] == pair[1] {
        return Err(RegionError::SelfCrossing { curve: pair[0], at });
    }
    let same = |a: &[Point2], b: &[Point2]| {
        a.len() == b.len()
            && b.iter()
                .position(|p| *p == a[0])
                .is_some_and(|k| (0..a.len()).all(|i| a[i] == b[(k + i) % b.len()]))
    };
    if same(&curves[pair[0]], &curves[pair[1]]) {
        return Err(RegionError::Duplicate { curves: pair });
    }
    Err(RegionError::Crossing { curves: pair, at })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::PI;
    use work::monitor::Silent;

    fn rectangle(x0: f64, y0: f64, x1: f64, y1: f64) -> Vec<Point2> {
        [(x0, y0), (x1, y0), (x1, y1), (x0, y1)].map(|(x, y)| Point2::new(x, y)).to_vec()
    }

    fn region(curves: Vec<Vec<Point2>>) -> Region {
        Region::nested(curves).unwrap().0
    }

    #[test]
    fn offsets_have_the_areas_of_closed_forms() {
        let island = rectangle(20.0, 15.0, 30.0, 25.0);
        let r = region(vec![island, rectangle(0.0, 0.0, 50.0, 40.0)]);
        assert_eq!((r.pieces.len(), r.pieces[0].islands.len(), r.area()), (1, 1, 1900.0));
        let d = 3.0;
        let inset = r.inset(d);
        let exact = (50.0 - 2.0 * d) * (40.0 - 2.0 * d) - (100.0 + 40.0 * d + PI * d * d);
        // Sides and chords stand off by at most 1.3e-4 of the distance.
        let bound = 1.3e-4 * d * (180.0 + 40.0 + 2.0 * PI * d);
        assert!(inset.area() <= exact && exact - inset.area() < bound, "{} {exact}", inset.area());
        // Rolled back: the square corners of the outline keep r²(1 − π/4) each, the island's are sharp.
        let rest = r.area() - inset.grown(d).area();
        let corners = 4.0 * d * d * (1.0 - PI / 4.0);
        assert!((rest - corners).abs() < 2.0 * bound, "{rest} {corners}");
    }

    /// Islands shrink as they do all at once: those with a neck fall apart, small ones vanish, and bays of
    /// the outline close.
    #[test]
    fn islands_shrink_each_by_itself() {
        let dumbbell =
            [(5., 5.), (11., 5.), (11., 7.), (14., 7.), (14., 5.), (20., 5.), (20., 11.), (14., 11.)]
                .into_iter()
                .chain([(14., 9.), (11., 9.), (11., 11.), (5., 11.)])
                .map(|(x, y)| Point2::new(x, y))
                .collect();
        let bay =
            [(0., 0.), (60., 0.), (60., 40.), (42., 40.), (42., 38.), (48., 38.), (48., 26.), (33., 26.)]
                .into_iter()
                .chain([(33., 38.), (40., 38.), (40., 40.), (0., 40.)])
                .map(|(x, y)| Point2::new(x, y))
                .collect();
        let r =
            region(vec![bay, dumbbell, rectangle(30., 5., 32., 7.), rectangle(40., 8., 52., 20.)]).inset(0.5);
        for distance in [0.3, 1.6, 2.2] {
            let (each, style) = (r.grown(distance), |d: f64| {
                let radius = d / (0.5 * ROUND_STEP).cos();
                OutlineStyle::new(radius).line_join(LineJoin::Round(ROUND_STEP)).math(MathMode::Float)
            });
            let all = Region::of_shapes(r.shapes().outline_as::<i64>(&style(distance)), distance);
            assert!(Region::nested(each.curves().map(<[Point2]>::to_vec).collect()).is_ok());
            assert_eq!(each.curves().count(), all.curves().count(), "{distance}");
            let differ = each.without(&all).area() + all.without(&each).area();
            assert!(differ < 1e-5, "{distance}: {differ}");
        }
    }

    #[test]
    fn an_inset_that_splits_or_vanishes_says_so() {
        let dumbbell =
            [(0., 0.), (20., 0.), (20., 8.), (30., 8.), (30., 0.), (50., 0.), (50., 20.), (30., 20.)]
                .into_iter()
                .chain([(30., 12.), (20., 12.), (20., 20.), (0., 20.)])
                .map(|(x, y)| Point2::new(x, y))
                .collect();
        let r = region(vec![dumbbell]);
        assert_eq!(r.inset(1.9).pieces.len(), 1);
        assert_eq!(r.inset(2.1).pieces.len(), 2);
        assert!(r.inset(10.5).is_empty());
        let (_, radius) = r.largest_disc(1e-4, &Silent).unwrap().unwrap();
        assert!((radius - 10.0).abs() < 0.41, "a disc may lean into the bridge: {radius}");
        let square = region(vec![rectangle(1.0, 2.0, 7.0, 8.0)]);
        let (centre, radius) = square.largest_disc(1e-6, &Silent).unwrap().unwrap();
        assert!((radius - 3.0).abs() < 1e-5 && (centre - Point2::new(4.0, 5.0)).norm() < 1e-4);
    }

    #[test]
    fn wrong_outlines_are_told_with_their_place() {
        let bow = [(0.0, 0.0), (4.0, 4.0), (4.0, 0.0), (0.0, 4.0)].map(|(x, y)| Point2::new(x, y)).to_vec();
        let crossed = RegionError::SelfCrossing { curve: 0, at: Point2::new(2.0, 2.0) };
        assert_eq!(Region::nested(vec![bow]).unwrap_err(), crossed);
        let (a, b) = (rectangle(0.0, 0.0, 10.0, 10.0), rectangle(5.0, 5.0, 15.0, 15.0));
        let error = Region::nested(vec![a.clone(), b]).unwrap_err();
        assert!(matches!(error, RegionError::Crossing { curves: [0, 1], .. }), "{error}");
        let mut turned = a.clone();
        turned.rotate_left(2);
        assert_eq!(
            Region::nested(vec![a.clone(), turned]).unwrap_err(),
            RegionError::Duplicate { curves: [0, 1] }
        );
        let mut nan = a.clone();
        nan[2].y = f64::NAN;
        assert_eq!(Region::nested(vec![nan]).unwrap_err(), RegionError::Coordinate { curve: 0, index: 2 });
        assert_eq!(Region::nested(vec![a[..2].to_vec()]).unwrap_err(), RegionError::NoArea { curve: 0 });
        assert_eq!(Region::nested(vec![]).unwrap_err(), RegionError::Empty);
    }

    proptest! {
        /// Every place of the inset keeps its distance from the walls, and places a little farther in
        /// than the distance are in it.
        #[test]
        fn insets_are_the_places_far_enough_from_the_walls(
            radii in prop::collection::vec(6.0..30.0f64, 5..14), distance in 0.3..5.0f64,
            hole in 0.5..3.0f64, at in prop::collection::vec((-30.0..30.0f64, -30.0..30.0f64), 60),
        ) {
            let n = radii.len() as f64;
            let star = |radii: &[f64]| -> Vec<Point2> {
                let spoke = |(k, r): (usize, &f64)| {
                    let angle = 2.0 * PI * k as f64 / n;
                    Point2::new(r * angle.cos(), r * angle.sin())
                };
                radii.iter().enumerate().map(spoke).collect()
            };
            let r = region(vec![star(&radii), star(&vec![hole; radii.len()])].into_iter().collect());
            let inset = r.inset(distance);
            let walls = SegmentGrid::of_curves(r.curves());
            for p in inset.curves().flatten() {
                prop_assert!(walls.distance(p) >= distance - 1e-6, "{p} {}", walls.distance(p));
            }
            for (x, y) in at {
                let p = Point2::new(x, y);
                let d = walls.distance(&p);
                if r.contains(&p) && d > distance * (1.0 + 2e-4) + 1e-6 {
                    prop_assert!(inset.contains(&p), "{p} {d}");
                } else if d < distance - 1e-6 || !r.contains(&p) {
                    prop_assert!(!inset.contains(&p), "{p} {d}");
                }
            }
        }
    }
}
