//! Fairing as the second source of this project publishes it: the worst point moves, one a round.
//!
//! The worst point is the one that is farthest from its corrected place. It goes there, and the curve is
//! interpolated again. After at least 20 rounds that goes on until the greatest distance changes by less than
//! 0.01 mm from one round to the next. The corrected place is Kjellander's, or with 2 j neighbours the one at
//! the point's parameter on the cubic from the j-th point before to the j-th after it, with their tangents:
//! of all curves with these ends it has the least `∫ |C″|²`.
//!
//! The rule bounds neither what is left nor how far a point goes, so points stay within their cap here as
//! well. It leaves more than the other methods do.

use super::{Faired, FairingError, MOST_ROUNDS, displaced, jump_energy};
use geometry::{CubicSpline, Vector2};

/// Rounds at least.
const LEAST_ROUNDS: usize = 20;

/// Rounds end where the greatest distance changes by less, mm.
const LEAST_CHANGE: f64 = 0.01;

/// The way of a point to its corrected place; `None` for a point that has too few neighbours.
fn way(spline: &CubicSpline, k: usize, neighbours: usize) -> Option<Vector2> {
    let (n, t) = (spline.points().len(), spline.parameters());
    let period = if spline.is_closed() { t[n] - t[0] } else { 0.0 };
    let (before, after) = if spline.is_closed() {
        if 2 * neighbours >= n {
            return None;
        }
        ((k + n - neighbours) % n, (k + neighbours) % n)
    } else {
        (k.checked_sub(neighbours)?, Some(k + neighbours).filter(|after| *after < n)?)
    };
    let a = t[k] - t[before] + if before > k { period } else { 0.0 };
    let b = t[after] - t[k] + if after < k { period } else { 0.0 };
    let ends = [before, after].map(|i| (spline.points()[i].coords, spline.tangents()[i]));
    let [(p, p1), (q, q1)] = ends;
    let place = if neighbours == 1 {
        let own = spline.tangents()[k];
        let sum = p / a.powi(3)
            + q / b.powi(3)
            + (p1 / (a * a) - q1 / (b * b)) * 0.5
            + own * (0.5 * (a.powi(-2) - b.powi(-2)));
        sum / (a.powi(-3) + b.powi(-3))
    } else {
        let (h, s) = (a + b, a / (a + b));
        let r = 1.0 - s;
        p * ((1.0 + 2.0 * s) * r * r) + q * (s * s * (3.0 - 2.0 * s)) + (p1 * r - q1 * s) * (h * s * r)
    };
    Some(place - spline.points()[k].coords)
}

/// Fairs a curve; `cap` is how far any point may end from its first place, mm. A curve whose points have no
/// neighbours on both sides at all is straight, or a cubic, and stays.
pub(super) fn fair(spline: &CubicSpline, neighbours: usize, cap: f64) -> Result<Faired, FairingError> {
    let points = spline.points().len();
    if neighbours > 1 && points <= 2 * neighbours {
        return Err(FairingError::TooFewPoints { neighbours, points });
    }
    let mut faired = Faired::unmoved(spline);
    let mut displacements = vec![Vector2::zeros(); spline.points().len()];
    let mut before = f64::INFINITY;
    while faired.rounds < MOST_ROUNDS {
        // What a point may go of its way.
        let allowed = |k: usize| {
            let to: Vector2 = displacements[k] + way(&faired.spline, k, neighbours)?;
            Some((k, to * (cap / to.norm().max(cap)) - displacements[k]))
        };
        let ways = (0..displacements.len()).filter_map(allowed);
        let worst = ways.max_by(|a, b| a.1.norm().total_cmp(&b.1.norm()));
        let Some((k, step)) = worst.filter(|(_, step)| step.norm() > 0.0) else {
            faired.settled = true;
            break;
        };
        let greatest = step.norm();
        if faired.rounds >= LEAST_ROUNDS && (before - greatest).abs() < LEAST_CHANGE {
            faired.settled = true;
            break;
        }
        before = greatest;
        displacements[k] += step;
        // Half a rounding less, so that no displacement is ever above the cap itself.
        let size = displacements[k].norm();
        if size > cap {
            displacements[k] *= cap * (1.0 - f64::EPSILON) / size;
        }
        faired.spline = displaced(spline, &displacements)?;
        faired.rounds += 1;
        faired.moves += 1;
    }
    faired.jump_energy[1] = jump_energy(&faired.spline);
    faired.length[1] = faired.spline.arc_length().total();
    faired.moved = displacements.into_iter().enumerate().filter(|(_, way)| way.norm() > 0.0).collect();
    Ok(faired)
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Point2;

    /// Points on a cubic are where their cubics want them, whatever the parameters; one that is off is moved
    /// back by what Hermite's cubic between its neighbours says.
    #[test]
    fn points_on_a_cubic_stay_and_one_that_is_off_goes_back() {
        let t: Vec<f64> = [0.0, 1.0, 1.7, 2.9, 4.0, 4.6, 6.0, 7.1, 8.0].to_vec();
        let cubic = |t: f64| Point2::new(t, 0.2 * t - 0.05 * t * t + 0.01 * t * t * t);
        let exact = CubicSpline::open(t.clone(), t.iter().map(|t| cubic(*t)).collect()).unwrap();
        for neighbours in 1..=3 {
            for k in neighbours..t.len() - neighbours {
                assert!(way(&exact, k, neighbours).unwrap().norm() < 1e-12);
            }
            assert!(way(&exact, neighbours - 1, neighbours).is_none());
        }
        // Evenly spaced: half the neighbours and a quarter of the difference of their tangents.
        let even: Vec<f64> = (0..9).map(f64::from).collect();
        let off = |k: usize| if k == 4 { 0.3 } else { 0.0 };
        let points = (0..9).map(|k| Point2::new(k as f64, off(k))).collect();
        let bumped = CubicSpline::open(even, points).unwrap();
        let tangents = bumped.tangents();
        let wanted = (tangents[3] - tangents[5]) * 0.25 + Vector2::new(0.0, -0.3);
        assert!((way(&bumped, 4, 1).unwrap() - wanted).norm() < 1e-12);
    }

    #[test]
    fn at_least_twenty_rounds_are_made_and_caps_are_kept() {
        let noise = |k: usize| 0.04 * ((k * k * 7 + 3) % 11) as f64 / 11.0;
        let at = |k: usize| Point2::new(k as f64, (0.1 * k as f64).sin() * 5.0 + noise(k));
        let points: Vec<Point2> = (0..40).map(at).collect();
        let t = CubicSpline::chord_lengths(&points, false);
        let rough = CubicSpline::open(t, points).unwrap();
        for neighbours in [1, 2, 3] {
            let faired = fair(&rough, neighbours, 0.02).unwrap();
            assert!(faired.settled && faired.rounds >= LEAST_ROUNDS, "{neighbours} {}", faired.rounds);
            assert!(faired.furthest() <= 0.02 && faired.furthest() > 0.01);
            if neighbours == 1 {
                assert!(faired.jump_energy[1] < 0.8 * faired.jump_energy[0]);
            }
        }
        // Forty points have nobody with twenty on each side.
        assert!(fair(&rough, 19, 0.02).unwrap().furthest() > 0.0);
        let short = FairingError::TooFewPoints { neighbours: 20, points: 40 };
        assert_eq!(fair(&rough, 20, 0.02).unwrap_err(), short);
    }
}
