//! How near a point is to a cubic spline, exactly: chords in buckets find where to look, Newton's steps the
//! foot.

use geometry::{CubicSpline, CurveSegment, Point2, SegmentGrid, Vector2, foot};

/// Chords stray this share of the tolerance from the curve. Less makes more of them, more makes more feet to
/// be refined.
const CHORD_SHARE: f64 = 0.25;
/// Newton's steps at most; near a centre of curvature they are slow, and the distance is settled long before.
const MAX_STEPS: usize = 24;
/// A step must make the squared distance this much less; the rest is rounding.
const SETTLED: f64 = 1.0 - 1.0e-15;

/// A curve whose nearness is asked.
pub struct Walls<'a> {
    curve: &'a CubicSpline,
    grid: SegmentGrid,
    /// Parameters of the ends of the chords.
    parameters: Vec<f64>,
    /// How far chords stray.
    sag: f64,
}

impl<'a> Walls<'a> {
    pub fn new(curve: &'a CubicSpline, tolerance: f64) -> Self {
        let sag = CHORD_SHARE * tolerance;
        let parameters = curve.within_chord(sag);
        let points: Vec<Point2> = parameters.iter().map(|&t| curve.point(t)).collect();
        let segment = |(index, w): (usize, &[Point2])| CurveSegment {
            ends: [w[0], w[1]],
            curve: 0,
            index: index as u32,
        };
        let grid = SegmentGrid::new(points.windows(2).enumerate().map(segment).collect());
        // Where a tolerance is below what chords keep, they stray that much.
        let sag = sag.max(1e-9 * CubicSpline::chord_lengths(curve.points(), false).last().unwrap_or(&0.0));
        Self { curve, grid, parameters, sag }
    }

    /// Whether no point of the curve is nearer to `p` than `within`.
    pub fn is_clear(&self, p: &Point2, within: f64) -> bool {
        let chord = self.grid.distance(p);
        chord >= within + self.sag || (chord >= within - self.sag && self.is_clear_of_feet(p, within, chord))
    }

    /// As [`Walls::is_clear`] where the nearest chord, `chord` away, does not settle it.
    fn is_clear_of_feet(&self, p: &Point2, within: f64, chord: f64) -> bool {
        let reach = chord + 2.0 * self.sag;
        let around = Vector2::repeat(reach);
        let mut clear = true;
        self.grid.near(&[p - around, p + around], |k| {
            let k = k as usize;
            let (share, distance) = self.chord_foot(p, k);
            // Of a run of chords only those that are nearer than their neighbours lead to another foot.
            let farther = |j: Option<usize>| j.is_none_or(|j| self.chord_foot(p, j).1 >= distance);
            if clear && distance <= reach && farther(k.checked_sub(1)) && farther(Some(k + 1)) {
                let [a, b] = [self.parameters[k], self.parameters[k + 1]];
                clear = distance_from(self.curve, p, a + share * (b - a)) >= within;
            }
        });
        clear
    }

    /// Where on chord `k` the foot of `p` is, 0 to 1, and how far; far away beyond the last.
    fn chord_foot(&self, p: &Point2, k: usize) -> (f64, f64) {
        let Some(segment) = self.grid.segments().get(k) else { return (0.0, f64::INFINITY) };
        foot(p, &segment.ends)
    }
}

/// Distance of `p` from the foot to which Newton's steps descend from a parameter.
pub fn distance_from(curve: &CubicSpline, p: &Point2, start: f64) -> f64 {
    let [lo, hi] = curve.domain();
    let inside = |t: f64| if curve.is_closed() { t } else { t.clamp(lo, hi) };
    let mut t = inside(start);
    let (mut at, mut first, mut second) = curve.jet(t);
    let mut squared = (at - p).norm_squared();
    for _ in 0..MAX_STEPS {
        let slope = (at - p).dot(&first);
        let metric = first.norm_squared();
        let bend = metric + (at - p).dot(&second);
        // Toward a greatest distance a step of the length of the slope alone goes downhill.
        let mut step = -slope / if bend > 0.01 * metric { bend } else { metric };
        if step.is_nan() {
            break;
        }
        let mut moved = false;
        for _ in 0..6 {
            let next = inside(t + step);
            let jet = curve.jet(next);
            let nearer = (jet.0 - p).norm_squared();
            if nearer < squared * SETTLED {
                (t, (at, first, second), squared, moved) = (next, jet, nearer, true);
                break;
            }
            step *= 0.25;
        }
        if !moved {
            break;
        }
    }
    squared.sqrt()
}
