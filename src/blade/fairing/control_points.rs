//! The spline as a B-spline, and fairing by its control points: each moves so that the jump of the third
//! derivative at its middle knot vanishes, which is what taking that knot out and putting it in again does
//! (G. Farin, G. Rein, N. Sapidis, A. J. Worsey, "Fairing cubic B-spline curves", *Computer Aided Geometric
//! Design* 4, 1987).

use super::FairingError;
use super::relaxation::{Unknown, jump_changes};
use geometry::{CubicSpline, KnotVector};

/// Shares of a point below this are rounding.
const LEAST_SHARE: f64 = 1e-12;

/// A control point: the point at its middle knot, and the points that it moves, by what shares.
pub(super) type ControlPoint = (usize, Vec<(usize, f64)>);

/// The control points of a spline of five points or more, or closed; those that move an end are left out.
pub(super) fn control_points(spline: &CubicSpline) -> Result<Vec<ControlPoint>, FairingError> {
    let (n, closed) = (spline.points().len(), spline.is_closed());
    let [from, _] = spline.domain();
    let t: Vec<f64> = spline.parameters().iter().map(|t| t - from).collect();
    let knots = if closed { periodic_knots(&t) } else { open_knots(&t) };
    let controls = knots.len() - 4;
    let knots = KnotVector::new(3, knots, controls)?;
    let mut found: Vec<ControlPoint> = (0..n).map(|k| (k, Vec::new())).collect();
    for (point, at) in t.iter().enumerate().take(n) {
        let (first, shares) = knots.basis(*at);
        for (k, share) in shares.iter().enumerate().filter(|(_, share)| **share > LEAST_SHARE) {
            // The first of the periodic ones has its middle knot a span before the start.
            let control = if closed { (first + k + n - 1) % n } else { first + k };
            add(&mut found[control].1, point, *share);
        }
    }
    if !closed {
        found.pop();
        found.remove(0);
    }
    Ok(found)
}

fn add(shares: &mut Vec<(usize, f64)>, point: usize, share: f64) {
    match shares.iter_mut().find(|(known, _)| *known == point) {
        Some((_, sum)) => *sum += share,
        None => shares.push((point, share)),
    }
}

/// Not-a-knot: the parameters next to the ends are no knots.
fn open_knots(t: &[f64]) -> Vec<f64> {
    let (first, last) = (t[0], t[t.len() - 1]);
    let inner = t[2..t.len() - 2].iter().copied();
    std::iter::repeat_n(first, 4).chain(inner).chain(std::iter::repeat_n(last, 4)).collect()
}

/// Three more knots on both sides.
fn periodic_knots(t: &[f64]) -> Vec<f64> {
    let n = t.len() - 1;
    let knot = |k: usize| t[k % n] + t[n] * ((k / n) as f64 - 1.0);
    (n - 3..=2 * n + 3).map(knot).collect()
}

pub(super) fn unknowns(spline: &CubicSpline) -> Result<Vec<Unknown>, FairingError> {
    let mut unknowns = Vec::new();
    for (middle, points) in control_points(spline)? {
        let jumps = jump_changes(spline, &points, middle)?;
        // None where the middle knot is none of an open spline's: next to its ends.
        if let Some((_, own)) = jumps.iter().copied().find(|(point, _)| *point == middle) {
            unknowns.push(Unknown { points, jumps, wish: vec![(middle, 1.0 / own)], worth: own.abs() });
        }
    }
    Ok(unknowns)
}
