//! Splines through the kept stretches of an offset.

use super::trim::Chain;
use super::walls::distance_from;
use super::{CurveOffsetError, Offset, OffsetPiece};
use geometry::{CubicSpline, Point2};

/// Points of a stretch at first, at least.
const LEAST_PIECES: usize = 6;
/// Share of the tolerance at which a span counts as fitted.
const SHARE: f64 = 0.5;
/// Points nearer together than this share of the tolerance are one: splines must not turn around in rounding.
const NEAREST: f64 = 1.0e-2;
const MAX_ROUNDS: usize = 16;
const MOST_POINTS: usize = 100_000;
/// Places between two points at which the distance is measured, as shares.
const LOOKS: [f64; 3] = [0.25, 0.5, 0.75];

/// The splines of a chain, `None` when all of it is shorter than the tolerance; and how far from the distance
/// they lie at most.
pub fn piece(
    offset: &Offset,
    places: &[f64],
    chain: &Chain,
    tolerance: f64,
) -> Result<(Option<OffsetPiece>, f64), CurveOffsetError> {
    let mut piece = OffsetPiece { stretches: Vec::new(), sources: Vec::new(), closed: chain.closed };
    let mut greatest: f64 = 0.0;
    for (k, &range) in chain.ranges.iter().enumerate() {
        // Stretches meet in the very same point.
        let before = piece.stretches.last().map(|s: &CubicSpline| s.points()[s.points().len() - 1]);
        let closing = chain.closed && !chain.whole && k + 1 == chain.ranges.len();
        let first = piece.stretches.first().map(|s| s.points()[0]).or(Some(offset.point(range[0])));
        let ends = [before, first.filter(|_| closing)];
        let stretch = Stretch { offset, range, ends, whole: chain.whole, tolerance };
        if let Some((spline, error)) = stretch.fitted(places)? {
            piece.stretches.push(spline);
            piece.sources.push(range);
            greatest = greatest.max(error);
        }
    }
    Ok(((!piece.stretches.is_empty()).then_some(piece), greatest))
}

/// A kept stretch that becomes one spline.
struct Stretch<'a> {
    offset: &'a Offset<'a>,
    /// Parameters of the curve.
    range: [f64; 2],
    /// First and last point, where they are given.
    ends: [Option<Point2>; 2],
    /// A closed curve.
    whole: bool,
    tolerance: f64,
}

impl Stretch<'_> {
    fn fitted(&self, places: &[f64]) -> Result<Option<(CubicSpline, f64)>, CurveOffsetError> {
        let Self { offset, whole, tolerance, .. } = *self;
        let mut parameters = first_parameters(offset, places, self.range);
        for _ in 0..MAX_ROUNDS {
            thin(offset, &mut parameters, NEAREST * tolerance);
            if parameters.len() < if whole { 4 } else { 2 } {
                return Ok(None);
            }
            let spline = self.through(&parameters)?;
            let errors = errors(offset, &spline, &parameters);
            let greatest = errors.iter().copied().fold(0.0, f64::max);
            if greatest <= SHARE * tolerance {
                return Ok(Some((spline, greatest)));
            }
            let before = parameters.len();
            for (k, error) in errors.iter().enumerate() {
                if *error > SHARE * tolerance {
                    parameters.push(0.5 * (parameters[k] + parameters[k + 1]));
                }
            }
            parameters.sort_by(f64::total_cmp);
            if parameters.len() > MOST_POINTS {
                break;
            }
            let mut thinned = parameters.clone();
            thin(offset, &mut thinned, NEAREST * tolerance);
            if thinned.len() == before {
                return Ok(Some((spline, greatest)));
            }
        }
        Err(CurveOffsetError::TooManyPoints(tolerance))
    }

    fn through(&self, parameters: &[f64]) -> Result<CubicSpline, CurveOffsetError> {
        let mut points: Vec<Point2> = parameters.iter().map(|&t| self.offset.point(t)).collect();
        if self.whole {
            points.pop();
            return Ok(CubicSpline::closed(CubicSpline::chord_lengths(&points, true), points)?);
        }
        let n = points.len();
        for (k, end) in [0, n - 1].into_iter().zip(self.ends) {
            points[k] = end.unwrap_or(points[k]);
        }
        Ok(CubicSpline::open(CubicSpline::chord_lengths(&points, false), points)?)
    }
}

fn first_parameters(offset: &Offset, places: &[f64], [from, to]: [f64; 2]) -> Vec<f64> {
    let [lo, hi] = offset.curve.domain();
    let again = places.iter().map(|t| t + (hi - lo)).skip(1);
    let inside = |t: &f64| *t > from && *t < to;
    let mut parameters: Vec<f64> =
        std::iter::once(from).chain(places.iter().copied().chain(again).filter(inside)).chain([to]).collect();
    while parameters.len() <= LEAST_PIECES {
        let middles: Vec<f64> = parameters.windows(2).map(|w| 0.5 * (w[0] + w[1])).collect();
        parameters.extend(middles);
        parameters.sort_by(f64::total_cmp);
    }
    parameters
}

/// Without points nearer than `least` to the one before; the last one stays.
fn thin(offset: &Offset, parameters: &mut Vec<f64>, least: f64) {
    let Some(&last) = parameters.last() else { return };
    let mut before: Option<Point2> = None;
    parameters.retain(|&t| {
        let p = offset.point(t);
        let keep = before.is_none_or(|b| (p - b).norm() > least);
        if keep {
            before = Some(p);
        }
        keep
    });
    if parameters.last() != Some(&last) {
        if parameters.len() > 1 {
            parameters.pop();
        }
        parameters.push(last);
    }
}

/// How far each span of the spline strays from the distance.
fn errors(offset: &Offset, spline: &CubicSpline, parameters: &[f64]) -> Vec<f64> {
    let spans = parameters.windows(2).zip(spline.parameters().windows(2));
    let stray = |(on_curve, on_spline): (&[f64], &[f64])| {
        let at = |w: &[f64], share: f64| w[0] + share * (w[1] - w[0]);
        let looks = LOOKS.iter().map(|&share| {
            let found = distance_from(offset.curve, &spline.point(at(on_spline, share)), at(on_curve, share));
            (found - offset.distance.abs()).abs()
        });
        looks.fold(0.0, f64::max)
    };
    spans.map(stray).collect()
}
