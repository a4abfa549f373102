//! Smooths the points of a pass and spreads them, within a tolerance.
//!
//! Enters: points on the exact path, dense enough for the straight lines between them to stand for it.
//! Leaves: fewer points whose straight moves stay within a tolerance of those lines.
//!
//! Smoothing takes the values of the natural cubic spline (C2) that minimises
//! `Σ |f(tᵢ) − pᵢ|²/uᵢ + λ ∫ |f″|²` (C. H. Reinsch, "Smoothing by spline functions", 1967) at its knots `tᵢ`,
//! the length along the pass. The weights `uᵢ` shrink where the spline strays too far, until it stays within
//! a share of the tolerance everywhere: kinks at a mesh's edges turn over their surroundings, and sharp ones
//! keep their place.
//!
//! Spreading puts the points beside the curve: a chord between points on it lies on one side of it by its
//! whole sagitta, between points as far on the other side by half of it, so that chords can be √2 times as
//! long. Every input point is held against the move that passes it, whatever smoothing did.
//!
//! Of a tilted cutter the centres of its arc are smoothed and spread; each keeps the axis that it has.

use super::chord::{Side, Watch, Waypoint, moved_aside, reduce, reduced_indices};
use crate::moves::touch::Touch;
use geometry::{Point3, Vector3};
use std::ops::Range;
use work::monitor::Cancelled;

/// Waves shorter than this many sampling distances are smoothed. Longer ones belong to the part's shape; as
/// the tolerance holds anyway, a greater number gains little.
const WAVE: f64 = 2.0;

/// No point is moved farther than this share of the tolerance by smoothing.
const SHARE: f64 = 0.3;

/// Rounds in which weights shrink; what still strays then is scaled back.
const ROUNDS: usize = 12;

/// Sagitta of a chord over the tolerance before its ends are moved aside by half of it. Two would leave
/// nothing for curvature that changes from chord to chord, and chords that then fail are halved.
const SAGITTA: f64 = 1.8;

/// The same of tilted cutters, of which the one with the fewest points is taken: what turning adds to a
/// sagitta, on a move and between axes, lies on one side of it.
const SAGITTAS_TILTED: [f64; 3] = [SAGITTA, 1.5, 1.2];

/// Rounds in which chords that do not hold are divided; what remains then is thinned without spreading.
const DIVISIONS: usize = 8;

/// The points of a pass, smoothed and spread: straight moves that stay within `tolerance` of the lines
/// between `points`. The ends stay. `sampling` is the length, mm, that one sampling distance stands for.
///
/// # Errors
/// [`Cancelled`] when the watch says so.
pub fn smooth_and_spread(
    points: &[Point3],
    sampling: f64,
    tolerance: f64,
    watch: &mut Watch<'_>,
) -> Result<Vec<Point3>, Cancelled> {
    if points.len() < 3 {
        return Ok(points.to_vec());
    }
    let smoothed = smoothed(points, WAVE * sampling, SHARE * tolerance, watch)?;
    match spread(points, &smoothed, &|_, p| p, &|_, _, _| true, SAGITTA, tolerance, watch)? {
        Some(spread) => Ok(spread),
        None => reduce(points, tolerance, watch),
    }
}

/// As [`smooth_and_spread`], for a tilted cutter; `None` where that fails, or where moves would not `hold`:
/// of the touches that they pass, from one touch to another.
///
/// # Errors
/// [`Cancelled`] when the watch says so.
pub fn smooth_and_spread_tilted(
    pass: &[Touch],
    sampling: f64,
    tolerance: f64,
    hold: &dyn Fn(Range<usize>, &Touch, &Touch) -> bool,
    watch: &mut Watch<'_>,
) -> Result<Option<Vec<Touch>>, Cancelled> {
    if pass.len() < 3 {
        return Ok(None);
    }
    let centres: Vec<Point3> = pass.iter().map(Touch::centre).collect();
    let smoothed = smoothed(&centres, WAVE * sampling, SHARE * tolerance, watch)?;
    let last = pass.len() - 1;
    let place = |k: usize, centre: Point3| match k {
        // Without rounding.
        0 => pass[0],
        k if k == last => pass[last],
        k => pass[k].around(centre),
    };
    let mut fewest: Option<Vec<Touch>> = None;
    for sagitta in SAGITTAS_TILTED {
        let found = spread(pass, &smoothed, &place, hold, sagitta, tolerance, watch)?;
        fewest = [fewest, found].into_iter().flatten().min_by_key(Vec::len);
    }
    Ok(fewest)
}

/// Values at its knots of the smoothing spline that suppresses waves shorter than `wave` (mm) and stays
/// within `most` (mm) of each point. The ends stay.
fn smoothed(
    points: &[Point3],
    wave: f64,
    most: f64,
    watch: &mut Watch<'_>,
) -> Result<Vec<Point3>, Cancelled> {
    let n = points.len();
    let steps: Vec<f64> = points.windows(2).map(|w| (w[1] - w[0]).norm()).collect();
    if steps.iter().any(|&h| h <= 0.0) {
        return Ok(points.to_vec());
    }
    // A wave of length L keeps 1/(1 + λ (2π/L)⁴) of its height where a point stands for 1 mm.
    let lambda = (wave / std::f64::consts::TAU).powi(4);
    let length: f64 = steps.iter().sum();
    let mut at = 0.0;
    // Each point counts by the length that it stands for. The spline is straight at its ends, and the pass
    // may not be: towards them the points are held.
    let mut slack = vec![0.0; n];
    for k in 1..n - 1 {
        at += steps[k - 1];
        let from_end = (at.min(length - at) / (2.0 * wave)).min(1.0);
        slack[k] = 2.0 * from_end.powi(4) / (steps[k - 1] + steps[k]);
    }
    let mut moved = Vec::new();
    for _ in 0..ROUNDS {
        watch.step()?;
        moved = moves_of_spline(points, &steps, &slack, lambda);
        let mut strayed = false;
        for (slack, by) in slack.iter_mut().zip(&moved) {
            let far = by.norm();
            if far > most {
                *slack *= (0.9 * most / far).powi(2);
                strayed = true;
            }
        }
        if !strayed {
            break;
        }
    }
    let worst = moved.iter().map(Vector3::norm).fold(0.0, f64::max);
    // Between two curves within the tolerance every mean of them is as well.
    let share = if worst > most { most / worst } else { 1.0 };
    Ok(points.iter().zip(&moved).map(|(p, by)| p + by * share).collect())
}

/// How far the smoothing spline lies from each point. Solves `(R + λ Qᵀ U Q) γ = Qᵀ p` for the second
/// derivatives `γ` at the inner knots; then `f − p = −λ U Q γ`.
fn moves_of_spline(points: &[Point3], steps: &[f64], slack: &[f64], lambda: f64) -> Vec<Vector3> {
    let n = points.len();
    let inner = n - 2;
    // Column k of Q has its entries in rows k, k + 1, k + 2.
    let q = |k: usize| {
        let (a, b) = (1.0 / steps[k], 1.0 / steps[k + 1]);
        [a, -a - b, b]
    };
    // LDLᵀ of the five-banded matrix.
    let (mut d, mut l1, mut l2) = (vec![0.0; inner], vec![0.0; inner], vec![0.0; inner]);
    let mut gamma = vec![Vector3::zeros(); inner];
    for k in 0..inner {
        let q0 = q(k);
        let weight = |i: usize| lambda * slack[i];
        let own =
            (steps[k] + steps[k + 1]) / 3.0 + (0..3).map(|c| q0[c] * q0[c] * weight(k + c)).sum::<f64>();
        let next = (k + 1 < inner).then(|| {
            let q1 = q(k + 1);
            steps[k + 1] / 6.0 + q0[1] * q1[0] * weight(k + 1) + q0[2] * q1[1] * weight(k + 2)
        });
        let after = (k + 2 < inner).then(|| q0[2] * q(k + 2)[0] * weight(k + 2));
        let one = if k > 0 { l1[k - 1] * l1[k - 1] * d[k - 1] } else { 0.0 };
        let two = if k > 1 { l2[k - 2] * l2[k - 2] * d[k - 2] } else { 0.0 };
        d[k] = own - one - two;
        let mixed = if k > 0 { l2[k - 1] * l1[k - 1] * d[k - 1] } else { 0.0 };
        l1[k] = (next.unwrap_or(0.0) - mixed) / d[k];
        l2[k] = after.unwrap_or(0.0) / d[k];
        let bend = (points[k + 2] - points[k + 1]) / steps[k + 1] - (points[k + 1] - points[k]) / steps[k];
        let one = if k > 0 { gamma[k - 1] * l1[k - 1] } else { Vector3::zeros() };
        let two = if k > 1 { gamma[k - 2] * l2[k - 2] } else { Vector3::zeros() };
        gamma[k] = bend - one - two;
    }
    for k in (0..inner).rev() {
        let one = if k + 1 < inner { gamma[k + 1] * l1[k] } else { Vector3::zeros() };
        let two = if k + 2 < inner { gamma[k + 2] * l2[k] } else { Vector3::zeros() };
        gamma[k] = gamma[k] / d[k] - one - two;
    }
    let mut moved = vec![Vector3::zeros(); n];
    for (k, gamma) in gamma.iter().enumerate() {
        for (c, q) in q(k).into_iter().enumerate() {
            moved[k + c] -= gamma * (q * lambda * slack[k + c]);
        }
    }
    moved
}

/// Fewer points along `curve`, `sagitta` tolerances apart and each moved aside by half the sagittas beside
/// it, whose moves `hold` and stay within `tolerance` of all `points`; `None` where they do not. `place` puts
/// the point of an index on a place of the curve. Both lists have the same length.
fn spread<P: Waypoint>(
    points: &[P],
    curve: &[Point3],
    place: &dyn Fn(usize, Point3) -> P,
    hold: &dyn Fn(Range<usize>, &P, &P) -> bool,
    sagitta: f64,
    tolerance: f64,
    watch: &mut Watch<'_>,
) -> Result<Option<Vec<P>>, Cancelled> {
    let on_curve: Vec<P> = curve.iter().enumerate().map(|(k, p)| place(k, *p)).collect();
    // What smoothing has used up.
    let used = points.iter().zip(&on_curve).map(|(p, q)| p.stray(q, q)).fold(0.0, f64::max);
    let mut knots = reduced_indices(&on_curve, sagitta * (tolerance - used), watch)?;
    for _ in 0..DIVISIONS {
        let aside = moved_aside(curve, &knots, Side::Greater, tolerance - used);
        let tips: Vec<P> = knots.iter().zip(aside).map(|(&k, p)| place(k, p)).collect();
        let fails = |k: usize| {
            let passed = knots[k]..knots[k + 1] + 1;
            let strays = |p: &P| p.stray(&tips[k], &tips[k + 1]) > tolerance;
            points[passed.clone()].iter().any(strays) || !hold(passed, &tips[k], &tips[k + 1])
        };
        let failing: Vec<usize> = (0..knots.len() - 1).filter(|&k| fails(k)).collect();
        if failing.is_empty() {
            return Ok(Some(tips));
        }
        watch.step()?;
        let further = failing.iter().map(|&k| (knots[k] + knots[k + 1]) / 2);
        let further: Vec<usize> = further.filter(|k| knots.binary_search(k).is_err()).collect();
        if further.is_empty() {
            break;
        }
        knots.extend(further);
        knots.sort_unstable();
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::distance_to_segment;
    use proptest::prelude::*;
    use work::monitor::Silent;

    /// Greatest distance of a point from the moves that pass it, each move after the one before.
    fn farthest(points: &[Point3], moves: &[Point3]) -> f64 {
        let mut worst: f64 = 0.0;
        for p in points {
            let to = |w: &[Point3]| distance_to_segment(p, &w[0], &w[1]);
            worst = worst.max(moves.windows(2).map(to).fold(f64::INFINITY, f64::min));
        }
        worst
    }

    fn run(points: &[Point3], tolerance: f64) -> Vec<Point3> {
        smooth_and_spread(points, 0.45, tolerance, &mut Watch::new(&Silent)).unwrap()
    }

    fn thinned(points: &[Point3], tolerance: f64) -> Vec<Point3> {
        reduce(points, tolerance, &mut Watch::new(&Silent)).unwrap()
    }

    #[test]
    fn chords_of_an_arc_become_longer_by_the_root_of_two() {
        let arc: Vec<Point3> = (0..=3000)
            .map(|k| 1e-3 * f64::from(k))
            .map(|t| Point3::new(10.0 * t.cos(), 10.0 * t.sin(), 0.0))
            .collect();
        let (spread, plain) = (run(&arc, 6e-4), thinned(&arc, 6e-4));
        let ratio = plain.len() as f64 / spread.len() as f64;
        // Whole steps of 10 µm and the two ends, which stay, cost a little of it.
        assert!((1.25..1.4).contains(&ratio), "{ratio}");
        assert!(farthest(&arc, &spread) <= 6e-4 * (1.0 + 1e-9));
        // On both sides of the arc alike.
        let radii = spread.windows(2).map(|w| (w[0].coords + w[1].coords).norm() / 2.0 - 10.0);
        let least = radii.fold(0.0, f64::min);
        assert!((-6e-4..-3e-4).contains(&least), "{least}");
    }

    #[test]
    fn lines_and_cubics_are_not_smoothed() {
        let line: Vec<Point3> =
            (0..50).map(|k| Point3::new(f64::from(k * k), -2.0 * f64::from(k * k), 1.0)).collect();
        let watch = &mut Watch::new(&Silent);
        for (p, q) in line.iter().zip(smoothed(&line, 10.0, 1.0, watch).unwrap()) {
            assert!((p - q).norm() < 1e-9);
        }
        assert_eq!(run(&line, 1e-6).len(), 2);
    }

    /// A wave of n points a length keeps 1/(1 + λ(2π/L)⁴) of its height, the transfer of the spline.
    #[test]
    fn waves_are_damped_as_the_spline_damps_them() {
        let h = 0.01;
        for length in [0.5, 1.0, 2.0] {
            let height = |k: i32| (std::f64::consts::TAU * h * f64::from(k) / length).cos();
            let points: Vec<Point3> =
                (0..=4000).map(|k| Point3::new(h * f64::from(k), 1e-6 * height(k), 0.0)).collect();
            let got = smoothed(&points, 1.0, 1.0, &mut Watch::new(&Silent)).unwrap();
            let kept = 1.0 / (1.0 + (1.0 / length).powi(4));
            let ratio = got[2000].y / points[2000].y;
            assert!((ratio - kept).abs() < 2e-3, "{length}: {ratio} {kept}");
        }
    }

    #[test]
    fn a_kink_is_rounded_within_the_share_and_noise_needs_fewer_points() {
        // Facets of 0.2 mm inscribed in an arc of 20 mm: 0.25 µm of sagitta.
        let arc = |s: f64| Point3::new(20.0 * (s / 20.0).sin(), 0.0, 20.0 * (s / 20.0).cos());
        let facets: Vec<Point3> = (0..2000)
            .map(|k| {
                let (a, t) = (0.2 * f64::from(k / 10), 0.1 * f64::from(k % 10));
                let (a, b) = (arc(a), arc(a + 0.2));
                a + (b - a) * t
            })
            .collect();
        let got = run(&facets, 6e-4);
        assert!(farthest(&facets, &got) <= 6e-4 * (1.0 + 1e-9));
        assert!(got.len() < thinned(&facets, 6e-4).len(), "{}", got.len());
        let kink: Vec<Point3> =
            (-500..=500).map(|k| 0.01 * f64::from(k)).map(|x| Point3::new(x, 0.0, x.abs())).collect();
        let rounded = smoothed(&kink, 1.0, 1e-3, &mut Watch::new(&Silent)).unwrap();
        let turn =
            |p: &[Point3]| p.windows(3).map(|w| (w[1] - w[0]).angle(&(w[2] - w[1]))).fold(0.0, f64::max);
        assert!(turn(&rounded) < 0.95 * turn(&kink), "{}", turn(&rounded));
        assert!(kink.iter().zip(&rounded).all(|(p, q)| (p - q).norm() <= 1e-3 * (1.0 + 1e-9)));
    }

    proptest! {
        #[test]
        fn whatever_comes_ends_stay_and_the_tolerance_holds(
            steps in prop::collection::vec((0.001..1.0f64, -1.0..1.0f64, -1.0..1.0f64), 1..120),
            tolerance in 1e-5..0.3f64,
        ) {
            let mut at = Point3::origin();
            let mut points = vec![at];
            for (x, y, z) in steps {
                at += Vector3::new(x, 0.2 * y, 0.2 * z);
                points.push(at);
            }
            let got = run(&points, tolerance);
            prop_assert_eq!(got.first(), points.first());
            prop_assert_eq!(got.last(), points.last());
            prop_assert!(farthest(&points, &got) <= tolerance * (1.0 + 1e-9));
            prop_assert!(got.windows(2).all(|w| w[0] != w[1]));
        }
    }
}
