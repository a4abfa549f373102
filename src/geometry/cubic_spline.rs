//! Interpolating cubic splines in the plane, open and closed, with their arc length.
//!
//! Enters: points, mm, and a parameter for each. Leaves: the C² piecewise cubic through them, kept as points
//! and tangents (the derivative by the parameter), of which each span is Hermite's cubic. Tangents solve a
//! tridiagonal system, cyclic when closed (de Boor, *A Practical Guide to Splines*, 1978, ch. IV), in a time
//! that grows with the number of points. Ends of open splines are not-a-knot: the first two spans are one
//! cubic, and so are the last two; every cubic is reproduced.
//!
//! Parameters are best chord lengths ([`CubicSpline::chord_lengths`]): then the parameter is nearly arc
//! length.

use super::{MAX_COORDINATE, Point2, Vector2};

/// Neighbouring parameters must lie this share of the domain apart. Less, and third derivatives (which grow
/// with its cube) are rounding; greater refuses honest sections.
const LEAST_GAP: f64 = 1.0e-10;
/// Shorter domains count as this, and no parameter may be greater. Beyond them third derivatives overflow.
const LEAST_DOMAIN: f64 = 1.0e-9;
const MAX_PARAMETER: f64 = 1.0e9;
/// Least tolerance of chords, as a share of the spline's length: less would ask for millions of points.
const LEAST_CHORD_TOLERANCE: f64 = 1.0e-9;
/// Two estimates of a length that differ by this share of the spline's chords agree.
const LENGTH_TOLERANCE: f64 = 1.0e-14;
/// Halvings of a span at most, which only a cusp needs.
const MAX_HALVINGS: usize = 48;
/// Gauss and Legendre's eight places in −1..1 (with both signs) and their weights.
const GAUSS: [[f64; 2]; 4] = [
    [0.183_434_642_495_649_8, 0.362_683_783_378_362],
    [0.525_532_409_916_329, 0.313_706_645_877_887_3],
    [0.796_666_477_413_626_7, 0.222_381_034_453_374_5],
    [0.960_289_856_497_536_3, 0.101_228_536_290_376_3],
];

/// Why no spline goes through the points. Points are counted from 0.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum SplineError {
    /// Too few points.
    #[error("there are {found} points; a spline needs at least {least}")]
    TooFew {
        /// Points found.
        found: usize,
        /// Points needed: 2, or 3 when closed.
        least: usize,
    },
    /// Points and parameters do not belong together.
    #[error("there are {found} parameters for {points} points; {needed} are needed")]
    Count {
        /// Parameters found.
        found: usize,
        /// Points.
        points: usize,
        /// Parameters needed: one for each point, and the end of the period when closed.
        needed: usize,
    },
    /// A coordinate is not finite or beyond [`MAX_COORDINATE`].
    #[error("point {0} is not a finite number of at most 1e6 mm")]
    Coordinate(usize),
    /// Two neighbouring points are the same.
    #[error("point {index} repeats point {before}; delete one of them")]
    Repeated {
        /// The later one; 0 where the last point of a closed spline repeats its first.
        index: usize,
        /// The one before it.
        before: usize,
    },
    /// Parameters do not increase, lie too close, or are no numbers of usual size.
    #[error(
        "parameter {index} is {value}; parameters must be finite, at most 1e9, and increase by more than 1e-10 \
         of their range (points that nearly coincide: delete one of them)"
    )]
    Parameter {
        /// Which.
        index: usize,
        /// What stands there.
        value: f64,
    },
}

/// Interpolating cubic spline in the plane, C².
#[derive(Debug, Clone, PartialEq)]
pub struct CubicSpline {
    parameters: Vec<f64>,
    points: Vec<Point2>,
    tangents: Vec<Vector2>,
    closed: bool,
}

/// A span as a cubic in `u` from 0 to 1: `start + width·u·(a + u·(b + u·c))`.
struct Span {
    start: Point2,
    width: f64,
    a: Vector2,
    b: Vector2,
    c: Vector2,
}

impl Span {
    fn point(&self, u: f64) -> Point2 {
        self.start + (self.a + (self.b + self.c * u) * u) * (self.width * u)
    }

    /// Derivative by the parameter.
    fn first(&self, u: f64) -> Vector2 {
        self.a + (self.b * 2.0 + self.c * (3.0 * u)) * u
    }

    fn second(&self, u: f64) -> Vector2 {
        (self.b * 2.0 + self.c * (6.0 * u)) / self.width
    }

    fn third(&self) -> Vector2 {
        self.c * (6.0 / (self.width * self.width))
    }

    /// Length from `from` to `to` by eight places.
    fn estimate(&self, from: f64, to: f64) -> f64 {
        let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
        let speeds = |x: f64| self.first(middle - half * x).norm() + self.first(middle + half * x).norm();
        GAUSS.iter().map(|[x, weight]| weight * speeds(*x)).sum::<f64>() * half * self.width
    }

    /// Length from `from` to `to`, halved until two estimates agree to `tolerance`, mm.
    fn length(&self, from: f64, to: f64, tolerance: f64) -> f64 {
        self.halved(from, to, self.estimate(from, to), tolerance, MAX_HALVINGS)
    }

    fn halved(&self, from: f64, to: f64, whole: f64, tolerance: f64, halvings: usize) -> f64 {
        let middle = 0.5 * (from + to);
        let (left, right) = (self.estimate(from, middle), self.estimate(middle, to));
        // A span much longer than the tolerance's scale cannot agree better than its own rounding.
        let agreed = (left + right - whole).abs() <= tolerance.max(4.0 * f64::EPSILON * whole.abs());
        if agreed || halvings == 0 {
            return left + right;
        }
        self.halved(from, middle, left, tolerance, halvings - 1)
            + self.halved(middle, to, right, tolerance, halvings - 1)
    }
}

impl CubicSpline {
    /// Through `points`, mm, at strictly increasing `parameters`. Four points or more: not-a-knot ends, so
    /// that every cubic is reproduced; two and three: the line and the parabola through them.
    ///
    /// # Errors
    /// Fewer than two points, another number of parameters, coordinates or parameters that are no finite
    /// numbers of usual size, neighbouring points or parameters that coincide.
    pub fn open(parameters: Vec<f64>, points: Vec<Point2>) -> Result<Self, SplineError> {
        check(&parameters, &points, false)?;
        let tangents = open_tangents(&parameters, &points);
        Ok(Self { parameters, points, tangents, closed: false })
    }

    /// Periodic, through `points`, mm, each given once; `parameters` has one entry more than `points`, the
    /// end of the period, at which the curve is back at the first point.
    ///
    /// # Errors
    /// As [`CubicSpline::open`], and fewer than three points, or the last point repeating the first.
    pub fn closed(parameters: Vec<f64>, points: Vec<Point2>) -> Result<Self, SplineError> {
        check(&parameters, &points, true)?;
        let tangents = closed_tangents(&parameters, &points);
        Ok(Self { parameters, points, tangents, closed: true })
    }

    /// The very same curve between two parameters of the domain, open, with its points in between.
    ///
    /// # Panics
    /// When the stretch has no length or leaves the domain.
    pub fn stretch(&self, [from, to]: [f64; 2]) -> Self {
        let [start, end] = self.domain();
        assert!(start <= from && from < to && to <= end, "a stretch of the domain");
        let inner = self.parameters.iter().copied().filter(|t| *t > from && *t < to);
        let parameters: Vec<f64> = std::iter::once(from).chain(inner).chain(std::iter::once(to)).collect();
        let jets = parameters.iter().map(|&t| {
            // The end of the period is where it starts.
            let (point, tangent, _) = self.jet(t);
            (point, tangent)
        });
        let (points, tangents) = jets.unzip();
        Self { parameters, points, tangents, closed: false }
    }

    /// Cumulated lengths of the chords between `points`, mm, from 0; when `closed` one more entry, for the
    /// chord from the last point to the first.
    pub fn chord_lengths<const D: usize>(points: &[nalgebra::Point<f64, D>], closed: bool) -> Vec<f64> {
        let back = points.first().filter(|_| closed);
        let ends = points.iter().skip(1).chain(back);
        let chords = points.iter().zip(ends).map(|(from, to)| (to - from).norm());
        let mut sum = 0.0;
        let mut lengths: Vec<f64> = points.first().map(|_| 0.0).into_iter().collect();
        lengths.extend(chords.map(|chord| {
            sum += chord;
            sum
        }));
        lengths
    }

    /// Whether the curve returns to its start.
    pub fn is_closed(&self) -> bool {
        self.closed
    }

    /// First and last parameter; when closed they are one period apart.
    pub fn domain(&self) -> [f64; 2] {
        [self.parameters[0], self.parameters[self.parameters.len() - 1]]
    }

    /// Parameters of the points, and the end of the period when closed.
    pub fn parameters(&self) -> &[f64] {
        &self.parameters
    }

    /// The interpolated points, mm.
    pub fn points(&self) -> &[Point2] {
        &self.points
    }

    /// Derivative by the parameter at each point.
    pub fn tangents(&self) -> &[Vector2] {
        &self.tangents
    }

    /// Position at `t`, mm. Closed splines wrap, open ones are clamped to their domain.
    pub fn point(&self, t: f64) -> Point2 {
        let (span, u) = self.place(t);
        self.span(span).point(u)
    }

    /// Position, first and second derivative by the parameter. Closed splines wrap, open ones are clamped.
    pub fn jet(&self, t: f64) -> (Point2, Vector2, Vector2) {
        let (span, u) = self.place(t);
        let span = self.span(span);
        (span.point(u), span.first(u), span.second(u))
    }

    /// Curvature at `t`, 1/mm, positive where the curve turns left; 0 where the first derivative vanishes.
    pub fn curvature(&self, t: f64) -> f64 {
        let (_, first, second) = self.jet(t);
        let speed = first.norm();
        if speed > 0.0 { first.perp(&second) / (speed * speed * speed) } else { 0.0 }
    }

    /// By how much the third derivative, which is constant within a span, jumps at each point; zero at the
    /// ends of open splines.
    pub fn third_jumps(&self) -> Vec<Vector2> {
        let thirds: Vec<Vector2> = (0..self.spans()).map(|k| self.span(k).third()).collect();
        let jump = |k: usize| match (k.checked_sub(1), thirds.get(k)) {
            (Some(before), Some(after)) => after - thirds[before],
            (None, Some(after)) if self.closed => after - thirds[thirds.len() - 1],
            _ => Vector2::zeros(),
        };
        (0..self.points.len()).map(jump).collect()
    }

    /// The spline by its arc length.
    pub fn arc_length(&self) -> ArcLength<'_> {
        let chords: f64 = (0..self.spans()).map(|k| (self.end_of(k) - self.points[k]).norm()).sum();
        let tolerance = LENGTH_TOLERANCE * chords;
        let mut sum = 0.0;
        let lengths = (0..self.spans()).map(|k| {
            sum += self.span(k).length(0.0, 1.0, tolerance);
            sum
        });
        let sums = std::iter::once(0.0).chain(lengths).collect();
        ArcLength { spline: self, sums, tolerance }
    }

    /// Parameters, from first to last of the domain and all those of points among them, whose chords stray no
    /// more than `tolerance`, mm, from the curve.
    ///
    /// # Tolerance
    /// Chords of a piece of the parameter width w stray w²/8 · max|C″| at most, and C″ is linear in a span: a
    /// bound, tight where parameters are lengths. Tolerances below 1e-9 of the spline's length count as that.
    pub fn within_chord(&self, tolerance: f64) -> Vec<f64> {
        let chords: f64 = (0..self.spans()).map(|k| (self.end_of(k) - self.points[k]).norm()).sum();
        let tolerance = tolerance.max(LEAST_CHORD_TOLERANCE * chords);
        let mut found = vec![self.parameters[0]];
        for (k, ends) in self.parameters.windows(2).enumerate() {
            let (span, width) = (self.span(k), ends[1] - ends[0]);
            let bend = span.second(0.0).norm().max(span.second(1.0).norm());
            let pieces = (width * (bend / (8.0 * tolerance)).sqrt()).ceil().max(1.0) as usize;
            found.extend((1..pieces).map(|i| ends[0] + width * i as f64 / pieces as f64));
            found.push(ends[1]);
        }
        found
    }

    fn spans(&self) -> usize {
        self.parameters.len() - 1
    }

    /// The point at which span `k` ends.
    fn end_of(&self, k: usize) -> Point2 {
        self.points[(k + 1) % self.points.len()]
    }

    fn span(&self, k: usize) -> Span {
        let width = self.parameters[k + 1] - self.parameters[k];
        let slope = (self.end_of(k) - self.points[k]) / width;
        let (a, end) = (self.tangents[k], self.tangents[(k + 1) % self.points.len()]);
        Span { start: self.points[k], width, a, b: slope * 3.0 - a * 2.0 - end, c: a + end - slope * 2.0 }
    }

    /// The parameter of the domain that stands for `t`, and how many periods lie between (0 when open).
    fn wrapped(&self, t: f64) -> (f64, f64) {
        let [from, to] = self.domain();
        if !t.is_finite() {
            return (from, 0.0);
        }
        if !self.closed || (from..=to).contains(&t) {
            return (t.clamp(from, to), 0.0);
        }
        let rest = (t - from).rem_euclid(to - from);
        (from + rest, ((t - from - rest) / (to - from)).round())
    }

    /// The span of `t`, and where in it from 0 to 1.
    fn place(&self, t: f64) -> (usize, f64) {
        let (t, _) = self.wrapped(t);
        let k = self.parameters.partition_point(|p| *p <= t).clamp(1, self.spans()) - 1;
        let (start, end) = (self.parameters[k], self.parameters[k + 1]);
        (k, ((t - start) / (end - start)).clamp(0.0, 1.0))
    }
}

/// A spline by its arc length, mm. Closed ones go on: a period further is the length further.
#[derive(Debug, Clone)]
pub struct ArcLength<'a> {
    spline: &'a CubicSpline,
    /// Length up to each parameter.
    sums: Vec<f64>,
    tolerance: f64,
}

impl ArcLength<'_> {
    /// Length of the whole curve, mm.
    ///
    /// # Tolerance
    /// 1e-12 of it; where the first derivative vanishes within a span (a cusp), 1e-4 of that span.
    pub fn total(&self) -> f64 {
        self.sums[self.sums.len() - 1]
    }

    /// Length from the start to the parameter `t`, mm; open splines are clamped.
    ///
    /// # Tolerance
    /// As [`ArcLength::total`].
    pub fn at(&self, t: f64) -> f64 {
        let (_, periods) = self.spline.wrapped(t);
        let (k, u) = self.spline.place(t);
        let within = match u {
            0.0 => 0.0,
            1.0 => self.sums[k + 1] - self.sums[k],
            _ => self.spline.span(k).length(0.0, u, self.tolerance),
        };
        periods * self.total() + self.sums[k] + within
    }

    /// The parameter at which the length from the start is `s`, mm; open splines are clamped.
    ///
    /// # Tolerance
    /// The length there is `s` to that of [`ArcLength::total`].
    pub fn parameter_at(&self, s: f64) -> f64 {
        let ([from, to], total) = (self.spline.domain(), self.total());
        let s = if s.is_finite() { s } else { 0.0 };
        let whole = if self.spline.closed && !(0.0..=total).contains(&s) { s.rem_euclid(total) } else { s };
        let periods = if self.spline.closed { ((s - whole) / total).round() } else { 0.0 };
        let s = whole.clamp(0.0, total);
        let k = self.sums.partition_point(|sum| *sum <= s).clamp(1, self.spline.spans()) - 1;
        let u = self.within(k, s - self.sums[k]);
        let (start, end) = (self.spline.parameters[k], self.spline.parameters[k + 1]);
        periods * (to - from) + start + u * (end - start)
    }

    /// Where in span `k` the length from its start is `length`: Newton's steps, halving where they leave the
    /// bracket.
    fn within(&self, k: usize, length: f64) -> f64 {
        let span = self.spline.span(k);
        let whole = self.sums[k + 1] - self.sums[k];
        let (mut low, mut high) = (0.0, 1.0);
        let mut u = if whole > 0.0 { (length / whole).clamp(0.0, 1.0) } else { 0.0 };
        for _ in 0..2 * MAX_HALVINGS {
            let excess = span.length(0.0, u, self.tolerance) - length;
            if excess.abs() <= 4.0 * self.tolerance {
                break;
            }
            if excess > 0.0 {
                high = u
            } else {
                low = u
            }
            let newton = u - excess / (span.first(u).norm() * span.width);
            u = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        }
        u
    }
}

/// Refuses what no spline can go through.
fn check(parameters: &[f64], points: &[Point2], closed: bool) -> Result<(), SplineError> {
    let least = if closed { 3 } else { 2 };
    if points.len() < least {
        return Err(SplineError::TooFew { found: points.len(), least });
    }
    let needed = points.len() + usize::from(closed);
    if parameters.len() != needed {
        return Err(SplineError::Count { found: parameters.len(), points: points.len(), needed });
    }
    let usual = |p: &Point2| p.coords.iter().all(|c| c.abs() <= MAX_COORDINATE);
    if let Some(index) = points.iter().position(|p| !usual(p)) {
        return Err(SplineError::Coordinate(index));
    }
    if let Some(before) = points.windows(2).position(|pair| pair[0] == pair[1]) {
        return Err(SplineError::Repeated { index: before + 1, before });
    }
    if closed && points.first() == points.last() {
        return Err(SplineError::Repeated { index: 0, before: points.len() - 1 });
    }
    if let Some((index, value)) =
        parameters.iter().enumerate().find(|(_, t)| t.is_nan() || t.abs() > MAX_PARAMETER)
    {
        return Err(SplineError::Parameter { index, value: *value });
    }
    let range = parameters[parameters.len() - 1] - parameters[0];
    let gap = LEAST_GAP * range.max(LEAST_DOMAIN);
    match parameters.windows(2).position(|pair| pair[1] - pair[0] <= gap) {
        Some(before) => Err(SplineError::Parameter { index: before + 1, value: parameters[before + 1] }),
        None => Ok(()),
    }
}

/// Widths of the spans and slopes of their chords.
fn chords(parameters: &[f64], points: &[Point2]) -> (Vec<f64>, Vec<Vector2>) {
    let widths: Vec<f64> = parameters.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let slope = |(k, width): (usize, &f64)| (points[(k + 1) % points.len()] - points[k]) / *width;
    let slopes = widths.iter().enumerate().map(slope).collect();
    (widths, slopes)
}

/// A row of a tridiagonal system: what stands before, on and behind the diagonal, and the right side.
#[derive(Clone, Copy)]
struct Row {
    before: f64,
    on: f64,
    behind: f64,
    right: Vector2,
}

/// C² at the point between the spans of widths `a` and `b`.
fn continuity([a, b]: [f64; 2], [slope_a, slope_b]: [Vector2; 2]) -> Row {
    Row { before: b, on: 2.0 * (a + b), behind: a, right: (slope_a * b + slope_b * a) * 3.0 }
}

fn open_tangents(parameters: &[f64], points: &[Point2]) -> Vec<Vector2> {
    let (h, slopes) = chords(parameters, points);
    let n = h.len();
    if n == 1 {
        return vec![slopes[0]; 2];
    }
    if n == 2 {
        let bend = (slopes[1] - slopes[0]) / (h[0] + h[1]);
        return vec![slopes[0] - bend * h[0], slopes[0] + bend * h[0], slopes[1] + bend * h[1]];
    }
    // Not-a-knot: the two spans at an end are one cubic.
    let end = |near: usize, next: usize| {
        let both = h[near] + h[next];
        let right = slopes[near] * ((h[near] + 2.0 * both) * h[next]) + slopes[next] * (h[near] * h[near]);
        (h[next], both, right / both)
    };
    let (on, behind, right) = end(0, 1);
    let mut rows = vec![Row { before: 0.0, on, behind, right }];
    rows.extend((1..n).map(|k| continuity([h[k - 1], h[k]], [slopes[k - 1], slopes[k]])));
    let (on, before, right) = end(n - 1, n - 2);
    rows.push(Row { before, on, behind: 0.0, right });
    tridiagonal(&rows)
}

fn closed_tangents(parameters: &[f64], points: &[Point2]) -> Vec<Vector2> {
    let (h, slopes) = chords(parameters, points);
    let n = h.len();
    let row = |k: usize| {
        let before = (k + n - 1) % n;
        continuity([h[before], h[k]], [slopes[before], slopes[k]])
    };
    let mut rows: Vec<Row> = (0..n).map(row).collect();
    // Sherman and Morrison: the two corners are a matrix of rank one, once both ends of the diagonal are
    // changed.
    let (first_corner, last_corner) = (rows[0].before, rows[n - 1].behind);
    let gamma = -rows[0].on;
    rows[0].on -= gamma;
    rows[n - 1].on -= first_corner * last_corner / gamma;
    let plain = tridiagonal(&rows);
    for row in &mut rows {
        row.right = Vector2::zeros();
    }
    rows[0].right.x = gamma;
    rows[n - 1].right.x = last_corner;
    let corner = tridiagonal(&rows);
    let share = first_corner / gamma;
    let factor = (plain[0] + plain[n - 1] * share) / (1.0 + corner[0].x + corner[n - 1].x * share);
    plain.iter().zip(&corner).map(|(tangent, z)| tangent - factor * z.x).collect()
}

/// Solves without exchanging rows: those of splines are diagonally dominant, but for the ends of open ones,
/// whose pivots stay positive.
fn tridiagonal(rows: &[Row]) -> Vec<Vector2> {
    let mut reduced: Vec<(f64, Vector2)> = Vec::with_capacity(rows.len());
    let mut last = (0.0, Vector2::zeros());
    for row in rows {
        let pivot = row.on - row.before * last.0;
        last = (row.behind / pivot, (row.right - last.1 * row.before) / pivot);
        reduced.push(last);
    }
    let mut next = Vector2::zeros();
    let mut found: Vec<Vector2> = reduced
        .iter()
        .rev()
        .map(|(factor, right)| {
            next = right - next * *factor;
            next
        })
        .collect();
    found.reverse();
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;
    use std::f64::consts::{PI, TAU};

    fn circle(n: usize, radius: f64) -> Vec<Point2> {
        (0..n)
            .map(|k| TAU * k as f64 / n as f64)
            .map(|a| Point2::new(radius * a.cos(), radius * a.sin()))
            .collect()
    }

    fn closed_through(points: Vec<Point2>) -> CubicSpline {
        CubicSpline::closed(CubicSpline::chord_lengths(&points, true), points).unwrap()
    }

    fn cubic(c: &[[f64; 2]; 4], t: f64) -> Point2 {
        let value = |i: usize| c[0][i] + t * (c[1][i] + t * (c[2][i] + t * c[3][i]));
        Point2::new(value(0), value(1))
    }

    fn gaps() -> impl Strategy<Value = Vec<f64>> {
        prop::collection::vec(0.2f64..2.0, 3..12)
    }

    fn sums(gaps: &[f64]) -> Vec<f64> {
        std::iter::once(0.0)
            .chain(gaps.iter().scan(0.0, |sum, gap| {
                *sum += gap;
                Some(*sum)
            }))
            .collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn cubics_are_reproduced(
            c in prop::array::uniform4(prop::array::uniform2(-3.0f64..3.0)),
            gaps in gaps(),
        ) {
            let t = sums(&gaps);
            let points: Vec<Point2> = t.iter().map(|t| cubic(&c, *t)).collect();
            prop_assume!(points.windows(2).all(|p| p[0] != p[1]));
            let spline = CubicSpline::open(t.clone(), points.clone()).unwrap();
            let size = points.iter().map(|p| p.coords.norm()).fold(1.0, f64::max);
            let end = t[t.len() - 1];
            for k in 0..=40 {
                let at = end * f64::from(k) / 40.0;
                prop_assert!((spline.point(at) - cubic(&c, at)).norm() < 1e-12 * size);
            }
            for jump in spline.third_jumps() {
                prop_assert!(jump.norm() < 1e-10 * size);
            }
        }

        #[test]
        fn second_derivatives_meet_at_points(
            gaps in gaps(),
            xy in prop::collection::vec(prop::array::uniform2(-3.0f64..3.0), 13),
            closed: bool,
        ) {
            let t = sums(&gaps);
            let n = t.len() - usize::from(closed);
            let points: Vec<Point2> = xy.iter().take(n).map(|p| Point2::new(p[0], p[1])).collect();
            let make = if closed { CubicSpline::closed } else { CubicSpline::open };
            let spline = make(t, points.clone()).unwrap();
            for (k, point) in points.iter().enumerate() {
                prop_assert!((spline.point(spline.parameters()[k]) - point).norm() < 1e-12);
                if closed || (k > 0 && k + 1 < n) {
                    let before = spline.span(if k == 0 { n - 1 } else { k - 1 });
                    let after = spline.span(k);
                    prop_assert!((before.first(1.0) - after.first(0.0)).norm() < 1e-11);
                    prop_assert!((before.second(1.0) - after.second(0.0)).norm() < 1e-9);
                    let jump = after.third() - before.third();
                    prop_assert!((jump - spline.third_jumps()[k]).norm() < 1e-12 * (1.0 + jump.norm()));
                }
            }
        }

        #[test]
        fn arc_length_and_its_inverse_agree(
            xy in prop::collection::vec(prop::array::uniform2(-3.0f64..3.0), 5..9),
            share in -0.5f64..1.5,
            closed: bool,
        ) {
            let points: Vec<Point2> = xy.iter().map(|p| Point2::new(p[0], p[1])).collect();
            let t = CubicSpline::chord_lengths(&points, closed);
            let make = if closed { CubicSpline::closed } else { CubicSpline::open };
            let spline = make(t, points).unwrap();
            let arc = spline.arc_length();
            let s = share * arc.total();
            let expected = if closed { s } else { s.clamp(0.0, arc.total()) };
            prop_assert!((arc.at(arc.parameter_at(s)) - expected).abs() < 1e-12 * arc.total());
            // A second way: very many chords.
            let [from, to] = spline.domain();
            let dense: Vec<Point2> =
                (0..=4000).map(|k| spline.point(from + (to - from) * f64::from(k) / 4000.0)).collect();
            let chords: f64 = dense.windows(2).map(|p| (p[1] - p[0]).norm()).sum();
            prop_assert!((arc.total() / chords - 1.0).abs() < 1e-4);
        }
    }

    #[test]
    fn two_and_three_points_give_line_and_parabola() {
        let line =
            CubicSpline::open(vec![0.0, 2.0], vec![Point2::new(1.0, 1.0), Point2::new(3.0, 5.0)]).unwrap();
        assert_relative_eq!(line.point(0.5), Point2::new(1.5, 2.0), epsilon = 1e-15);
        assert_relative_eq!(line.arc_length().total(), 20f64.sqrt(), epsilon = 1e-14);
        let square = |t: f64| Point2::new(t, t * t);
        let parabola = CubicSpline::open(vec![0.0, 1.0, 3.0], [0.0, 1.0, 3.0].map(square).to_vec()).unwrap();
        for t in [0.3, 1.7, 2.9] {
            assert_relative_eq!(parabola.point(t), square(t), epsilon = 1e-14);
        }
        // Length of y = x² from 0 to 3: √37·3/2 + asinh(6)/4.
        let expected = 1.5 * 37f64.sqrt() + 0.25 * 6f64.asinh();
        assert_relative_eq!(parabola.arc_length().total(), expected, max_relative = 1e-13);
        assert_relative_eq!(parabola.curvature(0.0), 2.0, epsilon = 1e-13);
    }

    #[test]
    fn circles_come_with_the_fourth_order() {
        let error = |n: usize| {
            let spline = closed_through(circle(n, 10.0));
            let [_, end] = spline.domain();
            let off = |k: usize| (spline.point(end * k as f64 / 997.0).coords.norm() - 10.0).abs();
            (0..997).map(off).fold(0.0, f64::max)
        };
        let order = (error(20) / error(40)).log2();
        assert!((order - 4.0).abs() < 0.2, "{order}");
        let spline = closed_through(circle(200, 10.0));
        assert_relative_eq!(spline.arc_length().total(), 20.0 * PI, max_relative = 1e-7);
        assert_relative_eq!(spline.curvature(3.0), 0.1, max_relative = 1e-4);
        assert_relative_eq!(spline.point(-1.0), spline.point(spline.domain()[1] - 1.0), epsilon = 1e-12);
        let turned: Vec<Point2> = circle(200, 10.0).into_iter().rev().collect();
        assert!(closed_through(turned).curvature(3.0) < 0.0);
    }

    #[test]
    fn chords_stay_within_their_tolerance_and_use_it() {
        let spline = closed_through(circle(12, 10.0));
        for tolerance in [0.1, 1e-3, 1e-5] {
            let at = spline.within_chord(tolerance);
            let mut most = 0f64;
            for ends in at.windows(2) {
                let [from, to] = [ends[0], ends[1]].map(|t| spline.point(t));
                let normal = (to - from).normalize();
                for k in 1..16 {
                    let p = spline.point(ends[0] + (ends[1] - ends[0]) * f64::from(k) / 16.0);
                    most = most.max(normal.perp(&(p - from)).abs());
                }
            }
            assert!(most <= tolerance && (most > 0.5 * tolerance || tolerance > 0.05), "{tolerance} {most}");
        }
        assert!(spline.within_chord(f64::NAN).len() < 100_000);
    }

    #[test]
    fn a_cusp_has_its_length() {
        // (t², t³) stands still at t = 0; its length from −1 to 1 is 2(13√13 − 8)/27.
        let at = [-1.0, -0.4, 0.3, 1.0];
        let points = at.map(|t: f64| Point2::new(t * t, t * t * t)).to_vec();
        let spline = CubicSpline::open(at.to_vec(), points).unwrap();
        let arc = spline.arc_length();
        assert_relative_eq!(arc.total(), 2.0 * (13.0 * 13f64.sqrt() - 8.0) / 27.0, max_relative = 1e-12);
        assert!(spline.curvature(0.0).is_finite());
    }

    #[test]
    fn bad_input_is_named() {
        let p = |x: f64, y: f64| Point2::new(x, y);
        let square = vec![p(0.0, 0.0), p(1.0, 0.0), p(1.0, 1.0), p(0.0, 1.0)];
        assert_eq!(
            CubicSpline::open(vec![0.0], square[..1].to_vec()),
            Err(SplineError::TooFew { found: 1, least: 2 })
        );
        assert_eq!(
            CubicSpline::closed(vec![0.0, 1.0, 2.0], square[..2].to_vec()),
            Err(SplineError::TooFew { found: 2, least: 3 })
        );
        assert_eq!(
            CubicSpline::closed(vec![0.0, 1.0, 2.0, 3.0], square.clone()),
            Err(SplineError::Count { found: 4, points: 4, needed: 5 })
        );
        let mut repeated = square.clone();
        repeated[2] = repeated[1];
        assert_eq!(
            CubicSpline::open(CubicSpline::chord_lengths(&repeated, false), repeated),
            Err(SplineError::Repeated { index: 2, before: 1 })
        );
        let mut round = square.clone();
        round.push(round[0]);
        let refused = CubicSpline::closed(CubicSpline::chord_lengths(&round, true), round).unwrap_err();
        assert_eq!(refused, SplineError::Repeated { index: 0, before: 4 });
        assert_eq!(refused.to_string(), "point 0 repeats point 4; delete one of them");
        for bad in [f64::NAN, f64::INFINITY, 2e6] {
            let mut points = square.clone();
            points[3].y = bad;
            let t = vec![0.0, 1.0, 2.0, 3.0];
            assert_eq!(CubicSpline::open(t, points), Err(SplineError::Coordinate(3)));
        }
        for (at, bad) in [(2, 1.0), (2, 0.5), (3, f64::NAN), (3, 1e10), (1, 1e-13)] {
            let mut t = vec![0.0, 1.0, 2.0, 3.0];
            t[at] = bad;
            match CubicSpline::open(t, square.clone()) {
                Err(SplineError::Parameter { index, .. }) => assert_eq!(index, at),
                other => panic!("{other:?}"),
            }
        }
        assert_eq!(CubicSpline::chord_lengths::<2>(&[], true), Vec::<f64>::new());
        let spline = closed_through(square);
        assert!(spline.point(f64::NAN).coords.norm().is_finite());
        assert!(spline.arc_length().at(f64::INFINITY).is_finite());
        assert!(spline.arc_length().parameter_at(f64::NAN).is_finite());
    }
}
