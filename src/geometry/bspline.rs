//! Knot vectors and B-spline basis functions: what a NURBS surface and a fitted stream function
//! share.
//!
//! Enters: a degree, knots, a parameter. Leaves: the `degree + 1` basis functions that are not zero
//! there, with derivatives to second order. Nothing allocates after construction. Values follow
//! Cox and de Boor's recurrence (Piegl & Tiller, *The NURBS Book*, 1997, A2.1 and A2.2), derivatives
//! eq. 2.7 applied once and twice, which gives the numbers of A2.3 without its table.

/// Greatest degree of a B-spline. Greater enlarges the arrays that every evaluation fills; CAD
/// systems write 3 and 5, seldom 7 or 9.
pub const MAX_DEGREE: usize = 9;

/// Length of the arrays of basis functions; entries above the degree are 0.
pub const MAX_BASIS: usize = MAX_DEGREE + 1;

/// Greatest size of a knot. Beyond it neighbouring parameters are no longer told apart well enough
/// for Newton steps to 1e-12 mm.
pub const MAX_KNOT: f64 = 1.0e9;

/// Two different knots must lie this share of the greatest knot apart. Smaller lets derivatives
/// grow until their products overflow; greater refuses honest files.
const LEAST_GAP: f64 = 1.0e-10;

/// The shortest domain. Shorter makes second derivatives overflow.
const LEAST_DOMAIN: f64 = 1.0e-9;

/// Why a knot vector was refused.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum KnotError {
    /// The degree is 0 or too great.
    #[error("the degree is {0}; it must be 1 to {MAX_DEGREE} (reduce the degree when exporting)")]
    Degree(usize),
    /// Too few control points for the degree.
    #[error("a curve of degree {degree} needs at least {} control points, and there are {controls}", degree + 1)]
    TooFewControls {
        /// Degree.
        degree: usize,
        /// Control points.
        controls: usize,
    },
    /// The number of knots does not fit.
    #[error(
        "there are {found} knots; degree {degree} with {controls} control points needs {} (control points + degree + 1)",
        controls + degree + 1
    )]
    Count {
        /// Degree.
        degree: usize,
        /// Control points.
        controls: usize,
        /// Knots found.
        found: usize,
    },
    /// A knot is not a number or too great.
    #[error("knot {index} is {value}; knots must be numbers of at most {MAX_KNOT:e} in size")]
    NotFinite {
        /// Which, counted from 0.
        index: usize,
        /// What stands there.
        value: f64,
    },
    /// A knot is less than the one before.
    #[error("knot {index} is {value}, less than the {previous} before it; knots must not decrease")]
    Decreasing {
        /// Which, counted from 0.
        index: usize,
        /// What stands there.
        value: f64,
        /// The knot before.
        previous: f64,
    },
    /// Two knots are nearly but not quite the same.
    #[error("knots {} and {index} differ by only {gap:e}; make them equal or separate them", index - 1)]
    NearlyEqual {
        /// The latter of the two, counted from 0.
        index: usize,
        /// Their difference.
        gap: f64,
    },
    /// Too many equal knots.
    #[error(
        "the knot {value} stands {found} times; degree {degree} allows {allowed} there (more would tear the surface)"
    )]
    Multiplicity {
        /// The knot.
        value: f64,
        /// How often it stands.
        found: usize,
        /// How often it may stand.
        allowed: usize,
        /// Degree.
        degree: usize,
    },
    /// The domain is empty or too short.
    #[error("the parameters run from {lo} to {hi}; they need a range of at least {LEAST_DOMAIN:e}")]
    Domain {
        /// First parameter.
        lo: f64,
        /// Last parameter.
        hi: f64,
    },
}

/// A checked knot vector with its degree. Its ends need not be clamped; inner knots stand at most
/// `degree` times, so that what it describes is continuous.
#[derive(Debug, Clone, PartialEq)]
pub struct KnotVector {
    degree: usize,
    knots: Vec<f64>,
}

impl KnotVector {
    /// Checks knots for `control_count` control points.
    ///
    /// # Errors
    /// See [`KnotError`].
    pub fn new(degree: usize, knots: Vec<f64>, control_count: usize) -> Result<Self, KnotError> {
        check_counts(degree, control_count)?;
        if Some(knots.len()) != control_count.checked_add(degree + 1) {
            return Err(KnotError::Count { degree, controls: control_count, found: knots.len() });
        }
        check_order(&knots)?;
        let [lo, hi] = [knots[degree], knots[control_count]];
        if hi - lo < LEAST_DOMAIN {
            return Err(KnotError::Domain { lo, hi });
        }
        check_multiplicity(degree, &knots, [lo, hi])?;
        Ok(Self { degree, knots })
    }

    /// The clamped knot vector with equal inner spans over `[lo, hi]`.
    ///
    /// # Errors
    /// See [`KnotError`].
    pub fn clamped_uniform(
        degree: usize,
        control_count: usize,
        [lo, hi]: [f64; 2],
    ) -> Result<Self, KnotError> {
        check_counts(degree, control_count)?;
        let spans = control_count - degree;
        let inner = (1..spans).map(|k| lo + (hi - lo) * (k as f64 / spans as f64));
        let knots: Vec<f64> = std::iter::repeat_n(lo, degree + 1)
            .chain(inner)
            .chain(std::iter::repeat_n(hi, degree + 1))
            .collect();
        Self::new(degree, knots, control_count)
    }

    /// Greville's averages, one for each control point: the function `x` has them as its coefficients.
    pub fn averages(&self) -> impl Iterator<Item = f64> + '_ {
        let mean = |w: &[f64]| w.iter().sum::<f64>() / w.len() as f64;
        (0..self.control_count()).map(move |k| mean(&self.knots[k + 1..=k + self.degree]))
    }

    /// Degree.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// All knots.
    pub fn knots(&self) -> &[f64] {
        &self.knots
    }

    /// Number of control points, which is that of basis functions.
    pub fn control_count(&self) -> usize {
        self.knots.len() - self.degree - 1
    }

    /// First and last parameter.
    pub fn domain(&self) -> [f64; 2] {
        [self.knots[self.degree], self.knots[self.control_count()]]
    }

    /// The different knots of the domain, ascending: between two of them all is one polynomial.
    pub fn breaks(&self) -> Vec<f64> {
        let mut breaks = self.knots[self.degree..=self.control_count()].to_vec();
        breaks.dedup();
        breaks
    }

    /// The nearest parameter inside the domain; its start for NaN.
    pub fn clamp(&self, u: f64) -> f64 {
        let [lo, hi] = self.domain();
        u.max(lo).min(hi)
    }

    /// Index `i` of the span with `knots[i] <= u < knots[i + 1]`; the last span is closed at its
    /// end. `u` is clamped to the domain.
    pub fn span(&self, u: f64) -> usize {
        let u = self.clamp(u);
        let inside = &self.knots[self.degree + 1..self.control_count()];
        let mut i = self.degree + inside.partition_point(|&k| k <= u);
        // Only at the end of the domain, when its knot stands before the last position: step back to
        // the last span that is not empty.
        while i > self.degree && self.knots[i] >= self.knots[i + 1] {
            i -= 1;
        }
        i
    }

    /// The basis functions at `u`: the index of the first one that is not zero, and the values of
    /// it and the `degree` that follow. `u` is clamped to the domain.
    pub fn basis(&self, u: f64) -> (usize, [f64; MAX_BASIS]) {
        let u = self.clamp(u);
        let span = self.span(u);
        let mut values = [0.0; MAX_BASIS];
        values[0] = 1.0;
        for k in 1..=self.degree {
            self.raise(&mut values, k, span, u);
        }
        (span - self.degree, values)
    }

    /// As [`KnotVector::basis`], with derivatives: `[0]` the values, `[1]` and `[2]` the first and
    /// second derivatives. Rows above `order` (at most 2) stay 0.
    pub fn basis_derivatives(&self, u: f64, order: usize) -> (usize, [[f64; MAX_BASIS]; 3]) {
        self.derivatives(u, self.degree, order)
    }

    /// As [`KnotVector::basis_derivatives`] of second order, where the number `N` of basis functions, one
    /// more than the degree, is known to the compiler: the same bits in a fraction of the time.
    ///
    /// # Panics
    /// Where `N` is another number.
    #[inline]
    pub fn basis_and_bends<const N: usize>(&self, u: f64) -> (usize, [[f64; N]; 3]) {
        assert_eq!(N, self.degree + 1, "the number of basis functions is one more than the degree");
        self.derivatives(u, N - 1, 2)
    }

    /// Of degree `p`, which is the own one, and at most `N - 1`.
    #[inline(always)]
    fn derivatives<const N: usize>(&self, u: f64, p: usize, order: usize) -> (usize, [[f64; N]; 3]) {
        let u = self.clamp(u);
        let span = self.span(u);
        let mut out = [[0.0; N]; 3];
        let mut values = [0.0; N];
        values[0] = 1.0;
        for k in 1..=p {
            if k == p && order >= 1 {
                out[1] = self.differentiate(&values, k, span);
            }
            if k + 1 == p && order >= 2 {
                let first = self.differentiate(&values, k, span);
                out[2] = self.differentiate(&first, p, span);
            }
            self.raise(&mut values, k, span, u);
        }
        out[0] = values;
        (span - p, out)
    }

    /// As [`KnotVector::basis_derivatives`] of first order, where the number `N` of basis functions, one more
    /// than the degree, is known to the compiler: the same bits in a fraction of the time.
    ///
    /// # Panics
    /// Where `N` is another number.
    #[inline]
    pub fn basis_and_slopes<const N: usize>(&self, u: f64) -> (usize, [[f64; N]; 2]) {
        assert_eq!(N, self.degree + 1, "the number of basis functions is one more than the degree");
        let (first, [values, slopes, _]) = self.derivatives(u, N - 1, 1);
        (first, [values, slopes])
    }

    /// From the basis of degree `k - 1` to that of degree `k`, in place.
    #[inline(always)]
    fn raise<const N: usize>(&self, values: &mut [f64; N], k: usize, span: usize, u: f64) {
        let mut saved = 0.0;
        for r in 0..k {
            let right = self.knots[span + r + 1];
            let left = self.knots[span + r + 1 - k];
            // [left, right] holds the span, which is not empty.
            let share = values[r] / (right - left);
            values[r] = saved + (right - u) * share;
            saved = (u - left) * share;
        }
        values[k] = saved;
    }

    /// Derivatives of what the basis of degree `k` combines from `lower`, the values (or
    /// derivatives) of degree `k - 1` (Piegl & Tiller eq. 2.7).
    #[inline(always)]
    fn differentiate<const N: usize>(&self, lower: &[f64; N], k: usize, span: usize) -> [f64; N] {
        let mut out = [0.0; N];
        let mut before = 0.0;
        for r in 0..k {
            let width = self.knots[span + r + 1] - self.knots[span + r + 1 - k];
            let share = k as f64 * lower[r] / width;
            out[r] = before - share;
            before = share;
        }
        out[k] = before;
        out
    }
}

fn check_counts(degree: usize, controls: usize) -> Result<(), KnotError> {
    if !(1..=MAX_DEGREE).contains(&degree) {
        return Err(KnotError::Degree(degree));
    }
    if controls <= degree {
        return Err(KnotError::TooFewControls { degree, controls });
    }
    Ok(())
}

fn check_order(knots: &[f64]) -> Result<(), KnotError> {
    // Not `k.abs() > MAX_KNOT`: NaN must fail too.
    if let Some(index) = knots.iter().position(|k| k.is_nan() || k.abs() > MAX_KNOT) {
        return Err(KnotError::NotFinite { index, value: knots[index] });
    }
    let greatest = knots.iter().fold(0.0, |m: f64, k| m.max(k.abs()));
    for index in 1..knots.len() {
        let (previous, value) = (knots[index - 1], knots[index]);
        if value < previous {
            return Err(KnotError::Decreasing { index, value, previous });
        }
        if value > previous && value - previous < LEAST_GAP * greatest {
            return Err(KnotError::NearlyEqual { index, gap: value - previous });
        }
    }
    Ok(())
}

fn check_multiplicity(degree: usize, knots: &[f64], domain: [f64; 2]) -> Result<(), KnotError> {
    for equal in knots.chunk_by(|a, b| a == b) {
        let value = equal[0];
        let inside = value > domain[0] && value < domain[1];
        let allowed = if inside { degree } else { degree + 1 };
        if equal.len() > allowed {
            return Err(KnotError::Multiplicity { value, found: equal.len(), allowed, degree });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    fn bernstein(p: usize, i: usize, t: f64) -> f64 {
        let choose = (0..i).fold(1.0, |c, k| c * (p - k) as f64 / (k + 1) as f64);
        choose * t.powi(i as i32) * (1.0 - t).powi((p - i) as i32)
    }

    #[test]
    fn one_span_is_bernstein() {
        for p in 1..=MAX_DEGREE {
            let k = KnotVector::clamped_uniform(p, p + 1, [2.0, 6.0]).unwrap();
            for t in [0.0, 0.13, 0.5, 0.99, 1.0] {
                let (first, n) = k.basis(2.0 + 4.0 * t);
                assert_eq!(first, 0);
                for i in 0..=p {
                    assert_relative_eq!(n[i], bernstein(p, i, t), epsilon = 1e-14);
                }
            }
        }
    }

    #[test]
    fn worked_example_of_the_nurbs_book() {
        // Ex2.3 and Ex2.4: U = {0,0,0,1,2,3,4,4,5,5,5}, p = 2, u = 5/2.
        let knots = vec![0., 0., 0., 1., 2., 3., 4., 4., 5., 5., 5.];
        let k = KnotVector::new(2, knots, 8).unwrap();
        let (first, d) = k.basis_derivatives(2.5, 2);
        assert_eq!((k.span(2.5), first), (4, 2));
        assert_eq!(d[0][..3], [0.125, 0.75, 0.125]);
        assert_eq!(d[1][..3], [-0.5, 0.0, 0.5]);
        assert_eq!(d[2][..3], [1.0, -2.0, 1.0]);
    }

    #[test]
    fn last_span_is_closed() {
        let k = KnotVector::clamped_uniform(3, 8, [0.0, 1.0]).unwrap();
        let (first, n) = k.basis(1.0);
        assert_eq!((first, n[3]), (4, 1.0));
        assert_eq!(k.basis(7.0), k.basis(1.0));
        assert_eq!(k.basis(f64::NAN), k.basis(0.0));
        // Unclamped, and with the end of the domain repeated.
        let open = KnotVector::new(2, vec![0., 1., 2., 3., 4., 5., 6.], 4).unwrap();
        assert_eq!((open.domain(), open.span(4.0)), ([2.0, 4.0], 3));
        let (_, n) = open.basis(4.0);
        assert_relative_eq!(n[0] + n[1] + n[2], 1.0, epsilon = 1e-15);
        let repeated = KnotVector::new(2, vec![0., 1., 2., 3., 3., 3., 6.], 4).unwrap();
        assert_eq!((repeated.domain(), repeated.span(3.0)), ([2.0, 3.0], 2));
        assert_eq!(repeated.breaks(), [2.0, 3.0]);
    }

    #[test]
    fn refuses_what_it_cannot_use() {
        let new = |p, k: &[f64], n| KnotVector::new(p, k.to_vec(), n).unwrap_err();
        assert!(matches!(new(0, &[0., 1.], 1), KnotError::Degree(0)));
        assert!(matches!(new(10, &[], 0), KnotError::Degree(10)));
        assert!(matches!(new(3, &[], 3), KnotError::TooFewControls { .. }));
        assert!(matches!(new(1, &[0., 0., 1.], 2), KnotError::Count { found: 3, .. }));
        assert!(matches!(new(1, &[0., 0.], usize::MAX), KnotError::Count { .. }));
        assert!(matches!(new(1, &[0., f64::NAN, 1., 1.], 2), KnotError::NotFinite { index: 1, .. }));
        assert!(matches!(new(1, &[0., 0., 1., f64::INFINITY], 2), KnotError::NotFinite { index: 3, .. }));
        assert!(matches!(new(1, &[0., 0., 1., 0.5], 2), KnotError::Decreasing { index: 3, .. }));
        assert!(matches!(new(1, &[0., 0., 1., 1. + 1e-12], 2), KnotError::NearlyEqual { index: 3, .. }));
        assert!(matches!(new(1, &[0., 0., 0., 1.], 2), KnotError::Domain { .. }));
        assert!(matches!(
            new(2, &[0., 0., 0., 1., 1., 1., 2., 2., 2.], 6),
            KnotError::Multiplicity { found: 3, allowed: 2, .. }
        ));
        assert!(KnotVector::clamped_uniform(3, 4, [0.0, f64::NAN]).is_err());
        assert!(KnotVector::clamped_uniform(3, 4, [1.0, 1.0]).is_err());
    }

    fn random_knots() -> impl Strategy<Value = KnotVector> {
        (1..=MAX_DEGREE, proptest::collection::vec((0.05f64..2.0, 1usize..3), 1..6)).prop_map(|(p, gaps)| {
            let mut knots = vec![-1.0; p + 1];
            let mut at = -1.0;
            for (k, &(gap, times)) in gaps.iter().enumerate() {
                at += gap;
                let times = if k + 1 == gaps.len() { p + 1 } else { times.min(p) };
                knots.extend(std::iter::repeat_n(at, times));
            }
            let controls = knots.len() - p - 1;
            KnotVector::new(p, knots, controls).unwrap()
        })
    }

    proptest! {
        #[test]
        fn values_sum_to_one_and_derivatives_to_zero(k in random_knots(), t in 0.0f64..=1.0) {
            let [lo, hi] = k.domain();
            let (first, d) = k.basis_derivatives(lo + t * (hi - lo), 2);
            prop_assert!(first + k.degree() < k.control_count());
            prop_assert!((d[0].iter().sum::<f64>() - 1.0).abs() < 1e-13);
            prop_assert!(d[0].iter().all(|&n| n >= -1e-15));
            for row in &d[1..] {
                let size = row.iter().fold(1.0, |m: f64, n| m.max(n.abs()));
                prop_assert!(row.iter().sum::<f64>().abs() < 1e-13 * size);
            }
        }

        #[test]
        fn derivatives_are_those_of_central_differences(k in random_knots(), t in 0.0f64..1.0) {
            let breaks = k.breaks();
            // Well inside one span: across a knot the differences see another polynomial.
            let s = ((breaks.len() - 1) as f64 * t) as usize;
            let width = breaks[s + 1] - breaks[s];
            let (u, h) = (breaks[s] + width * (0.1 + 0.8 * t), 1e-4 * width);
            let (_, d) = k.basis_derivatives(u, 2);
            let (_, lo) = k.basis_derivatives(u - h, 2);
            let (_, hi) = k.basis_derivatives(u + h, 2);
            for i in 0..=k.degree() {
                for order in 1..3 {
                    let difference = (hi[order - 1][i] - lo[order - 1][i]) / (2.0 * h);
                    let scale = (k.degree() as f64 / width).powi(order as i32);
                    prop_assert!((difference - d[order][i]).abs() < 1e-4 * scale);
                }
            }
        }
    }
}
