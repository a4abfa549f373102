//! Where the knots of a tensor-product B-spline stand: evenly, by averaging sample parameters, or
//! denser where a weight asks for it.
//!
//! Enters: degree, number of control points, and sample parameters or weights along one parameter.
//! Leaves: a clamped [`KnotVector`] over the range. Source: Piegl & Tiller, The NURBS Book (1997),
//! eq. 9.68 and 9.69, with c = (m + 1)/(n − p + 1) for m + 1 samples and n + 1 control points.

use geometry::{KnotError, KnotVector};

/// How knots are placed along a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum KnotRule {
    /// Equal spans.
    #[default]
    Uniform,
    /// Equally many samples a span, for samples evenly spaced along the surface.
    Averaged,
    /// Denser where the surface bends.
    Curvature,
}

impl KnotRule {
    /// The words of the rules.
    pub const WORDS: [&'static str; 3] = ["uniform", "averaged", "curvature"];

    const ALL: [Self; 3] = [Self::Uniform, Self::Averaged, Self::Curvature];

    /// The rule that a word stands for.
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|rule| rule.name() == word)
    }

    /// Its word.
    pub fn name(self) -> &'static str {
        Self::WORDS[self as usize]
    }
}

/// Knots are placed at most this many times denser than even ones. Samples stand three to an even
/// span: more than three times denser would leave spans without a sample, and coefficients open.
const MOST_DENSITY: f64 = 2.5;

/// And at least this many times as dense: less would leave all that a weight calls level unfollowed.
const LEAST_DENSITY: f64 = 0.5;

/// Clamped knots by averaging `parameters` (ascending, in `range`): equally many of them stand in
/// each span.
///
/// # Errors
/// See [`KnotError`]; fewer parameters than spans, or many at one place, make knots coincide.
pub fn averaged_knots(
    degree: usize,
    control_count: usize,
    parameters: &[f64],
    [lo, hi]: [f64; 2],
) -> Result<KnotVector, KnotError> {
    if control_count <= degree || parameters.is_empty() {
        return KnotVector::clamped_uniform(degree, control_count, [lo, hi]);
    }
    let spans = control_count - degree;
    let share = parameters.len() as f64 / spans as f64;
    let inner = (1..spans).map(|j| {
        let at = j as f64 * share;
        let (i, alpha) = (at as usize, at.fract());
        let parameter = |k: usize| parameters[k.min(parameters.len() - 1)];
        (1.0 - alpha) * parameter(i.saturating_sub(1)) + alpha * parameter(i)
    });
    clamped(degree, control_count, inner, [lo, hi])
}

/// Clamped knots at equal shares of the integral of a weight. `weights` are those of equal parts of
/// the range, from its start; they are kept between `LEAST_DENSITY` and `MOST_DENSITY` times
/// their mean. Weights that are all zero or not finite count as even.
///
/// # Errors
/// See [`KnotError`].
pub fn weighted_knots(
    degree: usize,
    control_count: usize,
    weights: &[f64],
    [lo, hi]: [f64; 2],
) -> Result<KnotVector, KnotError> {
    if control_count <= degree {
        return KnotVector::clamped_uniform(degree, control_count, [lo, hi]);
    }
    let spans = control_count - degree;
    let inner = equal_shares(weights, spans).into_iter().map(|t| lo + t * (hi - lo));
    clamped(degree, control_count, inner, [lo, hi])
}

/// Parameters, as shares of the range, that divide the integral of `weights` (see
/// [`weighted_knots`]) into `parts` equal parts; `parts − 1` of them.
pub fn equal_shares(weights: &[f64], parts: usize) -> Vec<f64> {
    let mean = weights.iter().sum::<f64>() / weights.len().max(1) as f64;
    let density = |w: f64| {
        if mean > 0.0 && mean.is_finite() { (w / mean).clamp(LEAST_DENSITY, MOST_DENSITY) } else { 1.0 }
    };
    let mut sums = vec![0.0];
    for &w in weights {
        sums.push(sums[sums.len() - 1] + density(w));
    }
    let total = sums[sums.len() - 1];
    let mut part = 0;
    (1..parts)
        .map(|k| {
            let share = k as f64 / parts as f64;
            if total == 0.0 {
                return share;
            }
            while part + 2 < sums.len() && sums[part + 1] < share * total {
                part += 1;
            }
            let inside = (share * total - sums[part]) / (sums[part + 1] - sums[part]);
            (part as f64 + inside) / weights.len() as f64
        })
        .collect()
}

fn clamped(
    degree: usize,
    control_count: usize,
    inner: impl Iterator<Item = f64>,
    [lo, hi]: [f64; 2],
) -> Result<KnotVector, KnotError> {
    let ends = |end| std::iter::repeat_n(end, degree + 1);
    KnotVector::new(degree, ends(lo).chain(inner).chain(ends(hi)).collect(), control_count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn averaging_follows_the_samples() {
        // Twelve samples, seven control points of degree 3: c = 12/4 = 3, so that knot j is the sample
        // before number 3j.
        let samples: Vec<f64> = (0..12).map(|k| (k as f64 / 11.0).powi(2)).collect();
        let knots = averaged_knots(3, 7, &samples, [0.0, 1.0]).unwrap();
        let inner = &knots.knots()[4..7];
        assert_eq!(inner, [samples[2], samples[5], samples[8]]);
        // 10 samples: c = 2.5, knots between samples.
        let knots = averaged_knots(3, 7, &samples[..10], [0.0, 1.0]).unwrap();
        let mean = |a: usize| 0.5 * (samples[a] + samples[a + 1]);
        for (knot, expected) in knots.knots()[4..7].iter().zip([mean(1), samples[4], mean(6)]) {
            assert!((knot - expected).abs() < 1e-15, "{knot} {expected}");
        }
    }

    #[test]
    fn weights_draw_knots_and_even_ones_leave_them_even() {
        let even = weighted_knots(3, 11, &[2.0; 50], [-1.0, 3.0]).unwrap();
        let uniform = KnotVector::clamped_uniform(3, 11, [-1.0, 3.0]).unwrap();
        assert!(even.knots().iter().zip(uniform.knots()).all(|(a, b)| (a - b).abs() < 1e-12));
        // Four times the weight in the second half: densities 0.5 and 2 of the mean... 0.4 is raised.
        let weights: Vec<f64> = (0..100).map(|k| if k < 50 { 1.0 } else { 4.0 }).collect();
        let knots = weighted_knots(3, 23, &weights, [0.0, 1.0]).unwrap();
        let below = knots.knots()[4..23].iter().filter(|&&k| k < 0.5).count();
        // 19 inner knots: 0.5/(0.5 + 1.6) of 20 spans lie in the first half.
        assert_eq!(below, 4);
        let nothing = weighted_knots(2, 8, &[0.0; 9], [0.0, 1.0]).unwrap();
        assert_eq!(nothing, KnotVector::clamped_uniform(2, 8, [0.0, 1.0]).unwrap());
        assert!(weighted_knots(3, 3, &[1.0], [0.0, 1.0]).is_err());
    }
}
