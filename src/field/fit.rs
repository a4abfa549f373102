//! Least-squares fit of tensor-product B-splines, and of stream functions with it.
//!
//! The stream function minimises, over the surface,
//!
//! ```text
//! ∫ q · [ α (t·∇ψ)² + (b·∇ψ − g)² ] dA
//! ```
//!
//! with `t` the unit feed direction, `b` the unit tangent across it, `g` the density of passes
//! wanted (passes per mm), `q` how much the direction matters there, and `α`
//! ([`DIRECTION_WEIGHT`]) how much direction counts over density. With α = 1 and g = 1 it is the
//! fit of `(ψ_v, −ψ_u)` to a sampled unit direction field; asking for |∇ψ| = 1 alone would also ask
//! for a divergence-free field, which unit directions seldom are, so direction is weighted above
//! density, and density follows the spacing that the scallop allows.
//!
//! ψ is defined up to a constant: its first coefficient is pinned to 0. The normal equations are
//! assembled directly on their 7 × 7-point stencil and solved by sparse Cholesky; the result is
//! checked by its true residual.

use faer::Side;
use faer::linalg::solvers::Solve;
use faer::sparse::{SparseColMat, Triplet};

use super::scalar::ScalarSpline;
use crate::geometry::KnotVector;

/// Weight of following the direction over matching the density, α above. Greater keeps passes along
/// the wanted directions at uneven distances; less bends them to keep their distances even. On a wave
/// of 32° slopes 10, 1 and 0.3 gave paths 1, 4 and 7 % shorter than zigzag, 0.02°, 0.6° and 2.3° off
/// the directions; below 0.1 passes begin to leave them by more than a machinist would accept.
pub const DIRECTION_WEIGHT: f64 = 0.3;

/// Greatest residual of the normal equations, relative to their terms, that counts as solved.
const RESIDUAL_LIMIT: f64 = 1e-8;

/// Why no function could be fitted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FieldError {
    /// The samples do not determine all coefficients.
    #[error(
        "{samples} samples do not determine the {coefficients} coefficients of the stream function (residual \
         {residual:.1e}); use fewer control points or more samples"
    )]
    RankDeficient {
        /// Samples used.
        samples: usize,
        /// Unknown coefficients.
        coefficients: usize,
        /// Relative residual of the normal equations.
        residual: f64,
    },
    /// A sample or the grid of coefficients cannot be used.
    #[error("{0}")]
    Invalid(String),
}

/// Normal equations of a least-squares fit, fed one linear condition at a time.
#[derive(Debug, Clone)]
pub struct NormalEquations {
    knots_u: KnotVector,
    knots_v: KnotVector,
    /// For coefficient k, the couplings to its neighbours within the degree each way,
    /// `[count][2p+1][2p+1]`.
    stencils: Vec<f64>,
    rhs: Vec<f64>,
    conditions: usize,
}

impl NormalEquations {
    /// Without conditions yet.
    pub fn new(knots_u: KnotVector, knots_v: KnotVector) -> Self {
        let count = knots_u.control_count() * knots_v.control_count();
        let width = (2 * knots_u.degree() + 1) * (2 * knots_v.degree() + 1);
        Self { knots_u, knots_v, stencils: vec![0.0; count * width], rhs: vec![0.0; count], conditions: 0 }
    }

    /// Adds `weight · (Σ terms − target)²`, where `terms[a][b]` multiplies the derivative
    /// `∂^(a+b)ψ/∂u^a∂v^b` at `(u, v)`, up to second order.
    pub fn add(&mut self, u: f64, v: f64, terms: &[[f64; 3]; 3], target: f64, weight: f64) {
        let (pu, pv) = (self.knots_u.degree(), self.knots_v.degree());
        let (first_u, bu) = self.knots_u.basis_derivatives(u, 2);
        let (first_v, bv) = self.knots_v.basis_derivatives(v, 2);
        let mut row = [[0.0; crate::geometry::MAX_BASIS]; crate::geometry::MAX_BASIS];
        for j in 0..=pv {
            for i in 0..=pu {
                for a in 0..3 {
                    for b in 0..3 - a {
                        row[j][i] += terms[a][b] * bu[a][i] * bv[b][j];
                    }
                }
            }
        }
        let nu = self.knots_u.control_count();
        let (su, width) = (2 * pu + 1, (2 * pu + 1) * (2 * pv + 1));
        for j in 0..=pv {
            for i in 0..=pu {
                let k = (first_v + j) * nu + first_u + i;
                let scaled = weight * row[j][i];
                self.rhs[k] += scaled * target;
                for l in 0..=pv {
                    let start = k * width + (l + pv - j) * su + pu - i;
                    for m in 0..=pu {
                        self.stencils[start + m] += scaled * row[l][m];
                    }
                }
            }
        }
        self.conditions += 1;
    }

    /// Solves for the coefficients. With `pinned` the first coefficient is held at 0: for
    /// conditions on derivatives only, which leave the constant open.
    ///
    /// # Errors
    /// [`FieldError::RankDeficient`] where the conditions leave a coefficient undetermined.
    pub fn solve(&self, pinned: bool) -> Result<ScalarSpline, FieldError> {
        let count = self.rhs.len();
        let skip = usize::from(pinned);
        let rank_deficient = |residual| FieldError::RankDeficient {
            samples: self.conditions,
            coefficients: count - skip,
            residual,
        };
        let mut triplets = Vec::with_capacity(self.stencils.len());
        self.for_each_coupling(|k, l, value| {
            if k >= skip && l >= skip && l <= k {
                triplets.push(Triplet::new(k - skip, l - skip, value));
            }
        });
        let n = count - skip;
        let matrix = SparseColMat::<usize, f64>::try_new_from_triplets(n, n, &triplets)
            .map_err(|e| FieldError::Invalid(format!("the normal equations cannot be laid out: {e:?}")))?;
        let rhs = faer::Col::from_fn(n, |k| self.rhs[k + skip]);
        let factor = matrix.sp_cholesky(Side::Lower).map_err(|_| rank_deficient(f64::INFINITY))?;
        let solution = factor.solve(&rhs);
        let mut coefficients = vec![0.0; skip];
        coefficients.extend((0..n).map(|k| solution[k]));
        let residual = self.relative_residual(&coefficients, skip);
        if residual.is_nan() || residual > RESIDUAL_LIMIT {
            return Err(rank_deficient(residual));
        }
        ScalarSpline::new(self.knots_u.clone(), self.knots_v.clone(), coefficients)
            .ok_or_else(|| FieldError::Invalid("the number of coefficients does not fit the knots".into()))
    }

    fn for_each_coupling(&self, mut f: impl FnMut(usize, usize, f64)) {
        let (pu, pv) = (self.knots_u.degree(), self.knots_v.degree());
        let (nu, nv) = (self.knots_u.control_count(), self.knots_v.control_count());
        let su = 2 * pu + 1;
        for (k, stencil) in self.stencils.chunks_exact(su * (2 * pv + 1)).enumerate() {
            let (i, j) = (k % nu, k / nu);
            for (at, &value) in stencil.iter().enumerate() {
                let (i2, j2) = (i + at % su, j + at / su);
                if i2 >= pu && j2 >= pv && i2 - pu < nu && j2 - pv < nv {
                    f(k, (j2 - pv) * nu + i2 - pu, value);
                }
            }
        }
    }

    /// `max |Ax − b|` over `max (|A||x| + |b|)`, without the pinned rows.
    fn relative_residual(&self, x: &[f64], skip: usize) -> f64 {
        let mut residual: Vec<f64> = self.rhs.iter().map(|b| -b).collect();
        let mut scale: Vec<f64> = self.rhs.iter().map(|b| b.abs()).collect();
        self.for_each_coupling(|k, l, value| {
            residual[k] += value * x[l];
            scale[k] += (value * x[l]).abs();
        });
        let greatest =
            |v: &[f64]| v[skip..].iter().fold(0.0, |m: f64, r| if r.is_nan() { *r } else { m.max(r.abs()) });
        let scale = greatest(&scale);
        if scale > 0.0 { greatest(&residual) / scale } else { f64::INFINITY }
    }
}

/// What the stream function should do at one place. Directions are in parameters: `along` and
/// `across` are the unit feed tangent and the unit tangent across it, each mapped back to
/// `(du, dv)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StreamSample {
    /// First parameter.
    pub u: f64,
    /// Second parameter.
    pub v: f64,
    /// Unit feed tangent.
    pub along: [f64; 2],
    /// Unit tangent across the feed, to the same side everywhere.
    pub across: [f64; 2],
    /// Density of passes wanted, 1/mm.
    pub density: f64,
    /// Surface area that the sample stands for times how much its direction matters.
    pub weight: f64,
}

/// A fitted stream function and how well it follows its samples.
#[derive(Debug, Clone, PartialEq)]
pub struct StreamFit {
    /// ψ.
    pub psi: ScalarSpline,
    /// Root mean square of the angle between level curves and feed directions, rad, weighted.
    pub angle_rms: f64,
}

/// Fits ψ to samples (see the module's head).
///
/// # Errors
/// [`FieldError`] where the samples leave coefficients undetermined or are not finite.
pub fn fit_stream_function(
    samples: &[StreamSample],
    knots_u: KnotVector,
    knots_v: KnotVector,
) -> Result<StreamFit, FieldError> {
    let mut equations = NormalEquations::new(knots_u, knots_v);
    for s in samples {
        let numbers = [s.u, s.v, s.along[0], s.along[1], s.across[0], s.across[1], s.density, s.weight];
        if numbers.iter().any(|x| !x.is_finite()) {
            return Err(FieldError::Invalid(format!(
                "the feed direction at ({}, {}) is not finite",
                s.u, s.v
            )));
        }
        let gradient_term = |d: [f64; 2]| [[0.0, d[1], 0.0], [d[0], 0.0, 0.0], [0.0; 3]];
        equations.add(s.u, s.v, &gradient_term(s.along), 0.0, DIRECTION_WEIGHT * s.weight);
        equations.add(s.u, s.v, &gradient_term(s.across), s.density, s.weight);
    }
    let psi = equations.solve(true)?;
    let (mut sum, mut weights) = (0.0, 0.0);
    for s in samples {
        let [_, pu, pv] = psi.value_and_gradient(s.u, s.v);
        let along = s.along[0] * pu + s.along[1] * pv;
        let across = s.across[0] * pu + s.across[1] * pv;
        sum += s.weight * along.atan2(across.abs()).powi(2);
        weights += s.weight;
    }
    let angle_rms = if weights > 0.0 { (sum / weights).sqrt() } else { 0.0 };
    Ok(StreamFit { psi, angle_rms })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn knots(n: usize, range: [f64; 2]) -> KnotVector {
        KnotVector::clamped_uniform(3, n, range).unwrap()
    }

    /// Samples of a flat field on [-1, 1]² shifted by `shift`, with |∇ψ| as given.
    fn fit(n: usize, shift: [f64; 2], field: impl Fn(f64, f64) -> ([f64; 2], f64)) -> StreamFit {
        let mut samples = Vec::new();
        for j in 0..=40 {
            for i in 0..=40 {
                let (u, v) = (shift[0] + i as f64 / 20.0 - 1.0, shift[1] + j as f64 / 20.0 - 1.0);
                let (t, density) = field(u, v);
                let length = t[0].hypot(t[1]);
                if length > 1e-9 {
                    let along = [t[0] / length, t[1] / length];
                    let across = [-along[1], along[0]];
                    samples.push(StreamSample { u, v, along, across, density, weight: 1.0 });
                }
            }
        }
        let range = |k: usize| [shift[k] - 1.0, shift[k] + 1.0];
        fit_stream_function(&samples, knots(n, range(0)), knots(n, range(1))).unwrap()
    }

    #[test]
    fn straight_flow_gives_the_distance_across() {
        let fit = fit(8, [0.0, 0.0], |_, _| ([1.0, 0.0], 1.0));
        let [a, ..] = fit.psi.value_and_gradient(0.3, -0.5);
        let [b, gu, gv] = fit.psi.value_and_gradient(-0.7, 0.25);
        assert!((b - a - 0.75).abs() < 1e-10 && gu.abs() < 1e-10 && (gv - 1.0).abs() < 1e-10);
        assert!(fit.angle_rms < 1e-10);
    }

    #[test]
    fn rotation_gives_circles_and_a_saddle_gives_hyperbolas() {
        // τ = (−y, x): ψ = −(x² + y²)/2 up to sign and constant; |∇ψ| is the radius.
        let circles = fit(12, [0.0, 0.0], |x, y| ([-y, x], x.hypot(y)));
        let at = |f: &StreamFit, x: f64, y: f64| f.psi.value_and_gradient(x, y)[0];
        for angle in [0.3f64, 1.7, 4.0] {
            let d = at(&circles, 0.8 * angle.cos(), 0.8 * angle.sin()) - at(&circles, 0.8, 0.0);
            assert!(d.abs() < 1e-9, "{d}");
        }
        let drop = at(&circles, 0.8, 0.0) - at(&circles, 0.2, 0.0);
        assert!((drop.abs() - 0.3).abs() < 1e-9);
        // τ = (x, −y): ψ = xy.
        let saddle = fit(12, [0.0, 0.0], |x, y| ([x, -y], x.hypot(y)));
        let d = at(&saddle, 0.5, 0.6) - at(&saddle, 0.6, 0.5);
        assert!(d.abs() < 1e-9, "{d}");
        assert!(saddle.angle_rms < 1e-9);
    }

    #[test]
    fn a_radial_field_gives_the_angle() {
        // Unit radial directions away from the pole, with density 1/r: ψ = θ.
        let fit = fit(24, [3.0, 0.0], |x, y| ([x, y], 1.0 / x.hypot(y)));
        let at = |x: f64, y: f64| fit.psi.value_and_gradient(x, y)[0];
        let d = at(3.0, 0.9) - at(3.0, -0.9);
        assert!((d.abs() - 2.0 * 0.3f64.atan()).abs() < 1e-5, "{d}");
        assert!(fit.angle_rms < 1e-5, "{}", fit.angle_rms);
    }

    #[test]
    fn too_few_samples_are_refused() {
        let sample =
            StreamSample { u: 0.5, v: 0.5, along: [1.0, 0.0], across: [0.0, 1.0], density: 1.0, weight: 1.0 };
        let error = fit_stream_function(&[sample], knots(8, [0.0, 1.0]), knots(8, [0.0, 1.0])).unwrap_err();
        assert!(matches!(error, FieldError::RankDeficient { .. }), "{error}");
        let bad = StreamSample { density: f64::NAN, ..sample };
        assert!(fit_stream_function(&[bad], knots(8, [0.0, 1.0]), knots(8, [0.0, 1.0])).is_err());
    }

    #[test]
    fn values_are_fitted_too() {
        let mut equations = NormalEquations::new(knots(6, [0.0, 2.0]), knots(7, [0.0, 1.0]));
        let cubic = |u: f64, v: f64| 1.0 + u * v * v - u.powi(3);
        for j in 0..=20 {
            for i in 0..=20 {
                let (u, v) = (0.1 * i as f64, 0.05 * j as f64);
                equations.add(u, v, &[[1.0, 0.0, 0.0], [0.0; 3], [0.0; 3]], cubic(u, v), 1.0);
            }
        }
        let spline = equations.solve(false).unwrap();
        let [f, fu, fv] = spline.value_and_gradient(1.23, 0.456);
        assert!((f - cubic(1.23, 0.456)).abs() < 1e-9);
        assert!((fu - (0.456f64.powi(2) - 3.0 * 1.23f64.powi(2))).abs() < 1e-8);
        assert!((fv - 2.0 * 1.23 * 0.456).abs() < 1e-8);
    }
}
