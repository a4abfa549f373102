//! Places of a curve dense enough for its offset's chords, and where it is tighter than the distance.

use super::{CurveOffsetError, Offset, TightPlace};
use geometry::{CubicSpline, Point2};

/// Greatest turn between two places, rad. Greater would let loops begin and end between them.
const MOST_TURN: f64 = 0.1;
/// Halvings of a span at most.
const MOST_HALVINGS: usize = 24;
/// Most places.
const MOST_PLACES: usize = 100_000;
/// Steps of a golden section: down to a 1e-10th.
const GOLDEN_STEPS: usize = 48;

/// Parameters, ascending from first to last of the domain, whose chords stray at most `tolerance` from the
/// curve and from the raw offset.
pub fn places(offset: &Offset, tolerance: f64) -> Result<Vec<f64>, CurveOffsetError> {
    let knots = offset.curve.parameters();
    let mut found = vec![knots[0]];
    for span in knots.windows(2) {
        divide(offset, [span[0], span[1]], tolerance, MOST_HALVINGS, &mut found)?;
    }
    Ok(found)
}

fn divide(
    offset: &Offset,
    [a, b]: [f64; 2],
    tolerance: f64,
    halvings: usize,
    found: &mut Vec<f64>,
) -> Result<(), CurveOffsetError> {
    let middle = 0.5 * (a + b);
    let jets = [a, middle, b].map(|t| offset.curve.jet(t));
    for ((at, first, _), parameter) in jets.iter().zip([a, middle, b]) {
        if first.norm() <= 1e-9 {
            return Err(CurveOffsetError::Cusp { parameter, at: *at });
        }
    }
    let turn = jets[0].1.angle(&jets[1].1) + jets[1].1.angle(&jets[2].1);
    let moved = [a, middle, b].map(|t| offset.point(t));
    let close = stray(&moved) <= tolerance && stray(&jets.map(|j| j.0)) <= tolerance;
    if halvings == 0 || (turn <= MOST_TURN && close) {
        found.push(b);
        return if found.len() > MOST_PLACES {
            Err(CurveOffsetError::TooManyPoints(tolerance))
        } else {
            Ok(())
        };
    }
    divide(offset, [a, middle], tolerance, halvings - 1, found)?;
    divide(offset, [middle, b], tolerance, halvings - 1, found)
}

/// Distance of the middle one of three points from the chord of the others.
fn stray([a, m, b]: &[Point2; 3]) -> f64 {
    let chord = b - a;
    let length = chord.norm();
    if length > 0.0 { (chord.perp(&(m - a)) / length).abs() } else { (m - a).norm() }
}

/// Each connected stretch in which the curve is tighter than the distance, by its tightest place.
pub fn tight_places(offset: &Offset, places: &[f64]) -> Vec<TightPlace> {
    let [lo, hi] = offset.curve.domain();
    let closed = offset.curve.is_closed();
    // On closed curves the last place is the first again.
    let places = if closed { &places[..places.len() - 1] } else { places };
    let n = places.len();
    let depths: Vec<f64> = places.iter().map(|&t| offset.depth(t)).collect();
    // Places by their steps from `k`: around the seam a period on, at open ends the end itself.
    let beside = |k: usize, forward: bool| match (k, forward) {
        (0, false) => {
            if closed {
                (n - 1, lo - hi)
            } else {
                (0, 0.0)
            }
        }
        (_, false) => (k - 1, 0.0),
        (_, true) if k + 1 == n => {
            if closed {
                (0, hi - lo)
            } else {
                (k, 0.0)
            }
        }
        _ => (k + 1, 0.0),
    };
    let refined = |k: usize| {
        let ends = [false, true].map(|forward| {
            let (j, shift) = beside(k, forward);
            places[j] + shift
        });
        let found = [[ends[0], places[k]], [places[k], ends[1]]].map(|range| greatest(offset, range));
        found.into_iter().fold((places[k], depths[k]), |a, b| if b.1 > a.1 { b } else { a })
    };
    let tight = |k: usize| depths[k] >= 1.0;
    let mut found = Vec::new();
    // A peak between two places that are not tight themselves.
    let peaks = |k: usize| [false, true].iter().all(|&f| depths[beside(k, f).0] <= depths[k]);
    found.extend(
        (0..n).filter(|&k| depths[k] > 0.5 && !tight(k) && peaks(k)).map(refined).filter(|p| p.1 >= 1.0),
    );
    // Runs of tight places, from one whose neighbour before is not.
    let begins = (0..n).filter(|&k| tight(k) && (beside(k, false).0 == k || !tight(beside(k, false).0)));
    let begins: Vec<usize> = begins.collect();
    let all_around = closed && begins.is_empty() && n > 0 && tight(0);
    for first in begins.into_iter().chain(all_around.then_some(0)) {
        let (mut k, mut best) = (first, first);
        loop {
            best = if depths[k] > depths[best] { k } else { best };
            let next = beside(k, true).0;
            if next == k || next == first || !tight(next) {
                break;
            }
            k = next;
        }
        found.push(refined(best));
    }
    let place = |(t, depth): (f64, f64)| {
        let parameter = if closed { lo + (t - lo).rem_euclid(hi - lo) } else { t };
        TightPlace { parameter, point: offset.curve.point(t), curvature: depth / offset.distance.abs() }
    };
    let mut tight: Vec<TightPlace> = found.into_iter().map(place).collect();
    tight.sort_by(|a, b| a.parameter.total_cmp(&b.parameter));
    tight
}

/// The greatest depth of a range without another peak, by golden section.
fn greatest(offset: &Offset, [mut a, mut b]: [f64; 2]) -> (f64, f64) {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let (mut best, mut depth) = (a, offset.depth(a));
    for _ in 0..GOLDEN_STEPS {
        let [c, d] = [b - GOLDEN * (b - a), a + GOLDEN * (b - a)];
        let (dc, dd) = (offset.depth(c), offset.depth(d));
        if dc > dd {
            b = d;
        } else {
            a = c;
        }
        for (t, found) in [(c, dc), (d, dd)] {
            if found > depth {
                (best, depth) = (t, found);
            }
        }
    }
    (best, depth)
}

/// Places with the tight ones among them.
pub fn with(places: &[f64], tight: &[TightPlace], curve: &CubicSpline) -> Vec<f64> {
    let [lo, hi] = curve.domain();
    let mut all = places.to_vec();
    all.extend(tight.iter().map(|t| t.parameter).filter(|t| (lo..=hi).contains(t)));
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}
