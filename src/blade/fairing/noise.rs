//! How noisy the points of a curve are.

use geometry::{CubicSpline, Vector2};

/// Points on each side that a point is compared with.
const BESIDE: usize = 2;

/// Fewer points tell nothing.
const LEAST_POINTS: usize = 9;

/// The standard deviation of noise in a plane over the median of what is seen of it: noise along the curve moves the chord
/// lengths as well, so only that across it is seen, and half of a normal distribution lies within 0.6745 of its deviation.
const OVER_MEDIAN: f64 = std::f64::consts::SQRT_2 / 0.674_49;

/// The standard deviation (in the plane's norm, mm) of the noise of a spline's points; infinite where they are too few to tell.
///
/// Each point is compared with the cubic through its four neighbours at its parameter. The median over all points is taken:
/// round ends, where the curve itself leaves such cubics, are few.
pub fn noise(spline: &CubicSpline) -> f64 {
    let (n, t, p) = (spline.points().len(), spline.parameters(), spline.points());
    if n < LEAST_POINTS {
        return f64::INFINITY;
    }
    let period = if spline.is_closed() { t[n] - t[0] } else { 0.0 };
    let off = |k: usize| {
        let around = [-2isize, -1, 1, 2].map(|by| {
            let at = k as isize + by;
            let turns = at.div_euclid(n as isize);
            let at = at.rem_euclid(n as isize) as usize;
            (t[at] + period * turns as f64 - t[k], p[at])
        });
        let weight = |i: usize| -> f64 {
            let others = around.iter().enumerate().filter(|(j, _)| *j != i);
            others.map(|(_, (at, _))| at / (at - around[i].0)).product()
        };
        let weights = [0, 1, 2, 3].map(weight);
        let between: Vector2 = around.iter().zip(weights).map(|((_, q), weight)| q.coords * weight).sum();
        let gain = (1.0 + weights.iter().map(|weight| weight * weight).sum::<f64>()).sqrt();
        (p[k].coords - between).norm() / gain
    };
    let all = if spline.is_closed() { 0..n } else { BESIDE..n - BESIDE };
    let mut found: Vec<f64> = all.map(off).collect();
    let middle = found.len() / 2;
    *found.select_nth_unstable_by(middle, f64::total_cmp).1 * OVER_MEDIAN
}
