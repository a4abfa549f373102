//! How noisy the points of a curve are.

use geometry::{CubicSpline, Vector2};

/// Points on each side that a point is compared with.
const BESIDE: usize = 2;

/// Fewer points tell nothing.
const LEAST_POINTS: usize = 9;

/// The standard deviation of noise in a plane over the median of what is seen of it: noise along the curve
/// moves the chord lengths as well, so only that across it is seen, and half of a normal distribution lies
/// within 0.6745 of its deviation.
const OVER_MEDIAN: f64 = std::f64::consts::SQRT_2 / 0.674_49;

/// The standard deviation (in the plane's norm, mm) of the noise of a spline's points; infinite where they
/// are too few to tell.
///
/// Each point is compared with the cubic through its four neighbours at its parameter. The median over all
/// points is taken: round ends, where the curve itself leaves such cubics, are few.
pub fn noise(spline: &CubicSpline) -> f64 {
    let n = spline.points().len();
    if n < LEAST_POINTS {
        return f64::INFINITY;
    }
    let off = |k: usize| {
        let (way, gain) = off_neighbours(spline, k);
        way.norm() / gain
    };
    let all = if spline.is_closed() { 0..n } else { BESIDE..n - BESIDE };
    let mut found: Vec<f64> = all.map(off).collect();
    let middle = found.len() / 2;
    *found.select_nth_unstable_by(middle, f64::total_cmp).1 * OVER_MEDIAN
}

/// Noise leaves a point that counts as an outlier once in so many tables.
const TABLES: f64 = 1e6;

/// The point that lies off its neighbours by more than the noise of all of them, and how far, mm: the
/// farthest of those whose neighbours are off the other way, and less, because of it. Where the curve itself
/// bends sharply they are off the same way.
pub fn outlier(spline: &CubicSpline) -> Option<(usize, f64)> {
    let n = spline.points().len();
    if n < LEAST_POINTS {
        return None;
    }
    // A part exp(-t²) of normal noise in a plane is farther off than t times its deviation.
    let least = noise(spline) * (TABLES * n as f64).ln().sqrt();
    let inner = if spline.is_closed() { 0..n } else { BESIDE + 1..n - BESIDE - 1 };
    let off = |k: usize| off_neighbours(spline, k % n);
    let farthest = inner
        .filter_map(|k| {
            let (way, gain) = off(k);
            let is_alone = [off(k + n - 1).0, off(k + 1).0]
                .iter()
                .all(|beside| beside.dot(&way) < 0.0 && beside.norm() < way.norm());
            (is_alone && way.norm() > gain * least).then_some((k, way.norm()))
        })
        .max_by(|a, b| a.1.total_cmp(&b.1));
    farthest.filter(|(_, off)| *off > ROUNDED)
}

/// Points of a table are rounded to this, mm, in any case.
const ROUNDED: f64 = 1e-3;

/// How far a point lies from the cubic through its four neighbours at its parameter, mm, and how much the
/// noise of all five adds up to in that. Open splines have no four neighbours for the first and last two
/// points.
fn off_neighbours(spline: &CubicSpline, k: usize) -> (Vector2, f64) {
    let (n, t, p) = (spline.points().len(), spline.parameters(), spline.points());
    let period = if spline.is_closed() { t[n] - t[0] } else { 0.0 };
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
    (p[k].coords - between, gain)
}
