//! Least-squares fit of tensor-product B-splines, and of stream functions with it.
//!
//! The stream function minimises, over the surface,
//!
//! ```text
//! ∫ q · [ α (t·∇ψ)² + (b·∇ψ − g)² ] dA
//! ```
//!
//! with `t` the unit feed direction, `b` the unit tangent across it, `g` the density of passes
//! wanted (passes per mm), `q` how much the direction matters there, and `α` (mostly
//! [`DIRECTION_WEIGHT`]) how much direction counts over density. With α = 1 and g = 1 it is the
//! fit of `(ψ_v, −ψ_u)` to a sampled unit direction field; asking for |∇ψ| = 1 alone would also ask
//! for a divergence-free field, which unit directions seldom are, so direction is weighted above
//! density, and density follows the spacing that the scallop allows.
//!
//! ψ is defined up to a constant: its first coefficient is 0. The normal equations are assembled
//! directly on their stencil, `(2p + 1)` coefficients each way, and row by row: samples of equal `v`
//! meet in sums over `u` before the basis of `v` is multiplied in. What solves them is a choice
//! ([`Solver`]); every result is checked by its true residual.

use super::scalar::ScalarSpline;
use super::solve::{Columns, Rows, Solution, SolveReport, Solver};
use crate::solve;
use geometry::{KnotVector, MAX_BASIS};

/// The usual weight of following the direction over matching the density, α above. Greater keeps passes along
/// the wanted directions at uneven distances; less bends them to keep their distances even. On a wave
/// of 32° slopes 10, 1 and 0.3 gave paths 1, 4 and 7 % shorter than zigzag, 0.02°, 0.6° and 2.3° off
/// the directions; below 0.1 passes begin to leave them by more than a machinist would accept.
pub const DIRECTION_WEIGHT: f64 = 0.3;

/// Greatest residual of the normal equations, relative to their terms, that counts as solved.
const RESIDUAL_LIMIT: f64 = 1e-8;

/// A function that meets less than this share of what is asked of its gradient is a constant with
/// rounding on it.
const LEAST_MET: f64 = 1e-12;

/// Why no function could be fitted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FieldError {
    /// The samples do not determine all coefficients.
    #[error(
        "{samples} samples do not determine the {coefficients} coefficients of the stream function; use fewer \
         control points or more samples"
    )]
    RankDeficient {
        /// Samples used.
        samples: usize,
        /// Unknown coefficients.
        coefficients: usize,
    },
    /// An iterative solver came to its end before the solution.
    #[error("{method} left a residual of {residual:.1e} after {iterations} iterations; use another solver")]
    NotSolved {
        /// The solver.
        method: &'static str,
        /// Relative residual of the normal equations.
        residual: f64,
        /// Iterations done.
        iterations: usize,
    },
    /// Only a constant solves the system, which has no level curves.
    #[error("the field has no stream function but a constant: {0}")]
    Trivial(String),
    /// A system too large for the memory.
    #[error("a system of {unknowns} unknowns does not fit into memory; use fewer control points")]
    Memory {
        /// Its unknowns.
        unknowns: usize,
    },
    /// A sample or the grid of coefficients cannot be used.
    #[error("{0}")]
    Invalid(String),
}

/// A basis at one parameter.
#[derive(Debug, Clone, Copy)]
struct Line {
    first: usize,
    value: [f64; MAX_BASIS],
    slope: [f64; MAX_BASIS],
}

impl Line {
    fn at(knots: &KnotVector, u: f64) -> Self {
        let (first, [value, slope, _]) = knots.basis_derivatives(u, 1);
        Self { first, value, slope }
    }
}

/// The bases of a row of samples; rows of a grid have the same parameters, which are not evaluated
/// again.
#[derive(Default)]
struct RowLines {
    lines: Vec<(f64, Line)>,
}

impl RowLines {
    fn of(&mut self, knots: &KnotVector, row: &[StreamSample]) -> &[(f64, Line)] {
        self.lines.truncate(row.len());
        for (k, sample) in row.iter().enumerate() {
            match self.lines.get_mut(k) {
                Some((u, _)) if *u == sample.u => {}
                Some(known) => *known = (sample.u, Line::at(knots, sample.u)),
                None => self.lines.push((sample.u, Line::at(knots, sample.u))),
            }
        }
        &self.lines
    }
}

/// Normal equations of a least-squares fit, fed one linear condition or one row of samples at a time.
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
        let mut row = [[0.0; MAX_BASIS]; MAX_BASIS];
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

    /// Adds the conditions of samples that share `v`.
    fn add_row(&mut self, row: &[StreamSample], lines: &[(f64, Line)]) {
        let Some(v) = row.first().map(|s| s.v) else { return };
        let (pu, pv) = (self.knots_u.degree(), self.knots_v.degree());
        let (nu, su) = (self.knots_u.control_count(), 2 * pu + 1);
        let begin = lines.iter().map(|(_, l)| l.first).min().unwrap_or(0);
        let end = lines.iter().map(|(_, l)| l.first + pu + 1).max().unwrap_or(0);
        // Sums over u: for coefficient i of the row and its neighbour m − p away, those of
        // weight · B'B', B'B, BB' and BB; and of the right side.
        let mut sums = vec![[[0.0; 4]; 2 * MAX_BASIS - 1]; end - begin];
        let mut sides = vec![[0.0; 2]; end - begin];
        for (sample, (_, line)) in row.iter().zip(lines) {
            let [uu, uv, vv] = sample.tensor();
            let [fu, fv] = sample.flux();
            for i in 0..=pu {
                let (value, slope) = (line.value[i], line.slope[i]);
                let terms = [uu * slope, uv * slope, uv * value, vv * value];
                let at = line.first + i - begin;
                sides[at][0] += fu * slope;
                sides[at][1] += fv * value;
                for m in 0..=pu {
                    let (value, slope) = (line.value[m], line.slope[m]);
                    let sum = &mut sums[at][m + pu - i];
                    sum[0] += terms[0] * slope;
                    sum[1] += terms[1] * value;
                    sum[2] += terms[2] * slope;
                    sum[3] += terms[3] * value;
                }
            }
        }
        let across = Line::at(&self.knots_v, v);
        let width = su * (2 * pv + 1);
        for j in 0..=pv {
            let (value, slope) = (across.value[j], across.slope[j]);
            for i in begin..end {
                let k = (across.first + j) * nu + i;
                let [side_u, side_v] = sides[i - begin];
                self.rhs[k] += side_u * value + side_v * slope;
                for l in 0..=pv {
                    let (other, other_slope) = (across.value[l], across.slope[l]);
                    let (a, b, c, d) =
                        (value * other, value * other_slope, slope * other, slope * other_slope);
                    let start = k * width + (l + pv - j) * su;
                    let stencil = &mut self.stencils[start..start + su];
                    for (entry, sum) in stencil.iter_mut().zip(&sums[i - begin]) {
                        *entry += a * sum[0] + b * sum[1] + c * sum[2] + d * sum[3];
                    }
                }
            }
        }
        self.conditions += 2 * row.len();
    }

    /// Solves for the coefficients by sparse Cholesky. With `pinned` the first coefficient is held
    /// at 0: for conditions on derivatives only, which leave the constant open.
    ///
    /// # Errors
    /// [`FieldError::RankDeficient`] where the conditions leave a coefficient undetermined.
    pub fn solve(&self, pinned: bool) -> Result<ScalarSpline, FieldError> {
        let skip = usize::from(pinned);
        let solution = solve::cholesky(self.lower(skip), &self.rhs[skip..])?;
        let solution = solution.ok_or_else(|| self.rank_deficient(skip))?;
        let (coefficients, _) = self.checked(solution, skip, Solver::Cholesky)?;
        self.spline(coefficients)
    }

    fn spline(&self, coefficients: Vec<f64>) -> Result<ScalarSpline, FieldError> {
        ScalarSpline::new(self.knots_u.clone(), self.knots_v.clone(), coefficients)
            .ok_or_else(|| FieldError::Invalid("the number of coefficients does not fit the knots".into()))
    }

    fn rank_deficient(&self, skip: usize) -> FieldError {
        FieldError::RankDeficient { samples: self.conditions, coefficients: self.rhs.len() - skip }
    }

    /// All coefficients and the residual of a solution without the first `skip`, if it is one.
    fn checked(
        &self,
        solution: Solution,
        skip: usize,
        solver: Solver,
    ) -> Result<(Vec<f64>, f64), FieldError> {
        let mut coefficients = vec![0.0; skip];
        coefficients.extend(solution.x);
        let residual = self.relative_residual(&coefficients, skip);
        if residual.is_nan() || residual > RESIDUAL_LIMIT {
            return Err(match solution.iterations {
                Some(iterations) => FieldError::NotSolved { method: solver.name(), residual, iterations },
                None => self.rank_deficient(skip),
            });
        }
        Ok((coefficients, residual))
    }

    /// The lower half of the matrix without its first `skip` rows and columns.
    fn lower(&self, skip: usize) -> Columns {
        let count = self.rhs.len();
        let room = self.stencils.len() / 2 + count;
        let mut columns =
            Columns { starts: vec![0], rows: Vec::with_capacity(room), values: Vec::with_capacity(room) };
        for k in skip..count {
            self.for_each_coupling(k, |l, value| {
                if l >= k {
                    columns.rows.push(l - skip);
                    columns.values.push(value);
                }
            });
            columns.starts.push(columns.rows.len());
        }
        columns
    }

    /// The couplings of coefficient `k`, by ascending index.
    fn for_each_coupling(&self, k: usize, mut f: impl FnMut(usize, f64)) {
        let (pu, pv) = (self.knots_u.degree(), self.knots_v.degree());
        let (nu, nv) = (self.knots_u.control_count(), self.knots_v.control_count());
        let su = 2 * pu + 1;
        let width = su * (2 * pv + 1);
        let stencil = &self.stencils[k * width..(k + 1) * width];
        let (i, j) = (k % nu, k / nu);
        for b in pv.saturating_sub(j)..(2 * pv + 1).min(nv + pv - j) {
            for a in pu.saturating_sub(i)..su.min(nu + pu - i) {
                f((j + b - pv) * nu + i + a - pu, stencil[b * su + a]);
            }
        }
    }

    /// `y = N x`.
    fn apply(&self, x: &[f64], y: &mut [f64]) {
        let (pu, pv) = (self.knots_u.degree(), self.knots_v.degree());
        let (nu, nv) = (self.knots_u.control_count(), self.knots_v.control_count());
        let su = 2 * pu + 1;
        let width = su * (2 * pv + 1);
        for (k, y) in y.iter_mut().enumerate() {
            let stencil = &self.stencils[k * width..(k + 1) * width];
            let (i, j) = (k % nu, k / nu);
            let (from, to) = (pu.saturating_sub(i), su.min(nu + pu - i));
            let mut sum = 0.0;
            for b in pv.saturating_sub(j)..(2 * pv + 1).min(nv + pv - j) {
                let start = (j + b - pv) * nu + i + from - pu;
                let others = &x[start..start + to - from];
                sum +=
                    stencil[b * su + from..b * su + to].iter().zip(others).map(|(a, x)| a * x).sum::<f64>();
            }
            *y = sum;
        }
    }

    /// One over the diagonal; 0 where nothing is asked of a coefficient.
    fn inverse_diagonal(&self) -> Vec<f64> {
        let (pu, pv) = (self.knots_u.degree(), self.knots_v.degree());
        let width = (2 * pu + 1) * (2 * pv + 1);
        let inverse = |d: f64| if d > 0.0 { 1.0 / d } else { 0.0 };
        self.stencils.chunks_exact(width).map(|stencil| inverse(stencil[width / 2])).collect()
    }

    /// `max |Ax − b|` over `max (|A||x| + |b|)`, without the pinned rows.
    fn relative_residual(&self, x: &[f64], skip: usize) -> f64 {
        let (mut greatest, mut scale) = (0.0f64, 0.0f64);
        for k in skip..self.rhs.len() {
            let (mut residual, mut terms) = (-self.rhs[k], self.rhs[k].abs());
            self.for_each_coupling(k, |l, value| {
                residual += value * x[l];
                terms += (value * x[l]).abs();
            });
            if residual.is_nan() {
                return f64::NAN;
            }
            greatest = greatest.max(residual.abs());
            scale = scale.max(terms);
        }
        // Without a right side the solution 0 is exact.
        if scale > 0.0 { greatest / scale } else { greatest }
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
    /// How much its direction counts over its density, α.
    pub direction: f64,
}

impl StreamSample {
    /// `K` of the quadratic form `∇ψᵀ K ∇ψ` that the sample asks to be small, `[K_uu, K_uv, K_vv]`.
    pub(super) fn tensor(&self) -> [f64; 3] {
        let ([a, b], [c, d]) = (self.along, self.across);
        let along = self.direction * self.weight;
        [
            along * a * a + self.weight * c * c,
            along * a * b + self.weight * c * d,
            along * b * b + self.weight * d * d,
        ]
    }

    /// `f` of the linear form `f·∇ψ` that it asks to be great.
    pub(super) fn flux(&self) -> [f64; 2] {
        self.across.map(|c| self.weight * self.density * c)
    }

    /// What is left of its two conditions for a gradient, squared, and the weighted square of the
    /// angle between level curve and direction.
    pub(super) fn misfit(&self, [pu, pv]: [f64; 2]) -> [f64; 2] {
        let along = self.along[0] * pu + self.along[1] * pv;
        let across = self.across[0] * pu + self.across[1] * pv;
        let left = self.direction * along * along + (across - self.density).powi(2);
        [self.weight * left, self.weight * along.atan2(across.abs()).powi(2)]
    }
}

/// Checks samples and sums their weights and `weight · density²`.
pub(super) fn checked_sums<'a>(
    samples: impl Iterator<Item = &'a StreamSample>,
) -> Result<[f64; 2], FieldError> {
    let mut sums = [0.0; 2];
    for s in samples {
        let numbers =
            [s.u, s.v, s.along[0], s.along[1], s.across[0], s.across[1], s.density, s.weight, s.direction];
        if numbers.iter().any(|x| !x.is_finite()) || s.weight.min(s.direction) < 0.0 {
            let fault =
                if s.weight.min(s.direction) < 0.0 { "has a negative weight" } else { "is not finite" };
            return Err(FieldError::Invalid(format!("the feed direction at ({}, {}) {fault}", s.u, s.v)));
        }
        sums[0] += s.weight;
        sums[1] += s.weight * s.density * s.density;
    }
    if sums[0] == 0.0 {
        return Err(FieldError::Trivial("no feed direction has any weight".into()));
    }
    if sums[1] == 0.0 {
        return Err(FieldError::Trivial("no density of passes is asked for".into()));
    }
    Ok(sums)
}

/// Refuses a solution that is constant but for rounding; `met` is the share of what was asked.
pub(super) fn refuse_constant(met: f64) -> Result<(), FieldError> {
    // What is no number is for the residual to refuse.
    if met > LEAST_MET || met.is_nan() {
        return Ok(());
    }
    Err(FieldError::Trivial("the densities asked across the feed directions cancel".into()))
}

/// A fitted stream function and how well it follows its samples.
#[derive(Debug, Clone, PartialEq)]
pub struct StreamFit {
    /// ψ; its first coefficient is 0.
    pub psi: ScalarSpline,
    /// Root mean square of the angle between level curves and feed directions, rad, weighted.
    pub angle_rms: f64,
    /// How the system was solved.
    pub report: SolveReport,
}

/// Fits ψ to samples (see the module's head). Samples in rows of equal `v` are the fastest; any
/// order and any places serve.
///
/// # Errors
/// [`FieldError`] where the samples leave coefficients undetermined (except for
/// [`Solver::MinimumNorm`] and the iterative solvers, which then take a solution of small norm), are
/// not finite, or ask for nothing but a constant.
pub fn fit_stream_function(
    samples: &[StreamSample],
    knots_u: KnotVector,
    knots_v: KnotVector,
    solver: Solver,
) -> Result<StreamFit, FieldError> {
    let [weights, asked] = checked_sums(samples.iter())?;
    if solver == Solver::MinimumNorm {
        solve::refuse_dense(knots_u.control_count() * knots_v.control_count())?;
    }
    let mut equations = NormalEquations::new(knots_u, knots_v);
    let mut known = RowLines::default();
    for row in samples.chunk_by(|a, b| a.v == b.v) {
        let lines = known.of(&equations.knots_u, row);
        equations.add_row(row, lines);
    }
    let count = equations.rhs.len();
    // Factorisations pin the first coefficient; the others shift the function afterwards.
    let skip = usize::from(matches!(solver, Solver::Cholesky | Solver::Qr));
    let deficient = || equations.rank_deficient(skip);
    let apply = |x: &[f64], y: &mut [f64]| equations.apply(x, y);
    let solution = match solver {
        Solver::Cholesky => {
            let solution = solve::cholesky(equations.lower(skip), &equations.rhs[skip..])?;
            solution.filter(|s| s.rank.is_some()).ok_or_else(deficient)?
        }
        Solver::Qr => {
            let rows = condition_rows(samples, &equations.knots_u, &equations.knots_v);
            solve::qr(&rows, count, skip)?.ok_or_else(deficient)?
        }
        Solver::MinimumNorm => {
            let rows = condition_rows(samples, &equations.knots_u, &equations.knots_v);
            solve::minimum_norm(&rows, count)?
        }
        Solver::ConjugateGradient => solve::diagonal_cg(apply, &equations.inverse_diagonal(), &equations.rhs),
        Solver::Gmres => solve::gmres(apply, &equations.inverse_diagonal(), &equations.rhs),
    };
    refuse_constant(solve::dot(&solution.x, &equations.rhs[skip..]) / asked)?;
    let (rank, iterations) = (solution.rank, solution.iterations);
    let (mut coefficients, residual) = equations.checked(solution, skip, solver)?;
    let first = coefficients[0];
    coefficients.iter_mut().for_each(|c| *c -= first);
    let psi = equations.spline(coefficients)?;
    let [misfit, angle] = misfits(samples, &psi);
    let report = SolveReport {
        method: solver.name(),
        unknowns: count,
        residual,
        misfit: (misfit / asked).sqrt(),
        rank,
        iterations,
    };
    Ok(StreamFit { psi, angle_rms: (angle / weights).sqrt(), report })
}

/// The two conditions of every sample as rows, multiplied by the root of their weights.
fn condition_rows(samples: &[StreamSample], knots_u: &KnotVector, knots_v: &KnotVector) -> Rows {
    let (pu, pv, nu) = (knots_u.degree(), knots_v.degree(), knots_u.control_count());
    let mut rows = Rows::default();
    for s in samples {
        let (a, b) = (Line::at(knots_u, s.u), Line::at(knots_v, s.v));
        let conditions = [(s.along, 0.0, s.direction * s.weight), (s.across, s.density, s.weight)];
        for (d, target, weight) in conditions {
            let root = weight.sqrt();
            rows.starts.push(rows.columns.len());
            rows.targets.push(root * target);
            for j in 0..=pv {
                for i in 0..=pu {
                    rows.columns.push((b.first + j) * nu + a.first + i);
                    let slope = d[0] * a.slope[i] * b.value[j] + d[1] * a.value[i] * b.slope[j];
                    rows.values.push(root * slope);
                }
            }
        }
    }
    rows
}

/// Sums of [`StreamSample::misfit`].
fn misfits(samples: &[StreamSample], psi: &ScalarSpline) -> [f64; 2] {
    let (knots_u, knots_v) = psi.knots();
    let (nu, pu, pv) = (knots_u.control_count(), knots_u.degree(), knots_v.degree());
    let mut known = RowLines::default();
    let (mut value, mut slope) = (vec![0.0; nu], vec![0.0; nu]);
    let mut sums = [0.0; 2];
    for row in samples.chunk_by(|a, b| a.v == b.v) {
        let across = Line::at(knots_v, row[0].v);
        let lines = known.of(knots_u, row);
        // A row of few samples needs few coefficients.
        let begin = lines.iter().map(|(_, l)| l.first).min().unwrap_or(0);
        let end = lines.iter().map(|(_, l)| l.first + pu + 1).max().unwrap_or(0);
        for i in begin..end {
            (value[i], slope[i]) = (0.0, 0.0);
            for j in 0..=pv {
                let c = psi.coefficients()[(across.first + j) * nu + i];
                value[i] += c * across.value[j];
                slope[i] += c * across.slope[j];
            }
        }
        for (sample, (_, line)) in row.iter().zip(lines) {
            let mut gradient = [0.0; 2];
            for i in 0..=pu {
                gradient[0] += value[line.first + i] * line.slope[i];
                gradient[1] += slope[line.first + i] * line.value[i];
            }
            let [misfit, angle] = sample.misfit(gradient);
            sums[0] += misfit;
            sums[1] += angle;
        }
    }
    sums
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
                    samples.push(StreamSample {
                        u,
                        v,
                        along,
                        across,
                        density,
                        weight: 1.0,
                        direction: DIRECTION_WEIGHT,
                    });
                }
            }
        }
        let range = |k: usize| [shift[k] - 1.0, shift[k] + 1.0];
        fit_stream_function(&samples, knots(n, range(0)), knots(n, range(1)), Solver::Cholesky).unwrap()
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
        let sample = StreamSample {
            u: 0.5,
            v: 0.5,
            along: [1.0, 0.0],
            across: [0.0, 1.0],
            density: 1.0,
            weight: 1.0,
            direction: DIRECTION_WEIGHT,
        };
        let error =
            fit_stream_function(&[sample], knots(8, [0.0, 1.0]), knots(8, [0.0, 1.0]), Solver::Cholesky)
                .unwrap_err();
        assert!(matches!(error, FieldError::RankDeficient { .. }), "{error}");
        let bad = StreamSample { density: f64::NAN, ..sample };
        assert!(
            fit_stream_function(&[bad], knots(8, [0.0, 1.0]), knots(8, [0.0, 1.0]), Solver::Cholesky)
                .is_err()
        );
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

    /// Flow of which ψ is known: directions along its level curves, density |∇ψ|; at the centres of
    /// `m` × `m` cells of [0, 1]².
    fn samples_of(m: usize, gradient: impl Fn(f64, f64) -> [f64; 2]) -> Vec<StreamSample> {
        (0..m * m)
            .map(|k| {
                let (u, v) = (((k % m) as f64 + 0.5) / m as f64, ((k / m) as f64 + 0.5) / m as f64);
                let [gu, gv] = gradient(u, v);
                let density = gu.hypot(gv);
                let across = [gu / density, gv / density];
                let along = [across[1], -across[0]];
                StreamSample { u, v, along, across, density, weight: 0.1 + u, direction: DIRECTION_WEIGHT }
            })
            .collect()
    }

    type Gradient = fn(f64, f64) -> [f64; 2];

    /// A harmonic function, its gradient, and θ around (−0.5, −0.5): none of them a polynomial.
    fn known(radial: bool) -> (fn(f64, f64) -> f64, Gradient) {
        if radial {
            let gradient = |u: f64, v: f64| {
                let (x, y) = (u + 0.5, v + 0.5);
                [-y / (x * x + y * y), x / (x * x + y * y)]
            };
            (|u, v| (v + 0.5).atan2(u + 0.5), gradient)
        } else {
            let psi = |u: f64, v: f64| (2.0 * u).exp() * (2.0 * v + 0.3).sin();
            let gradient = |u: f64, v: f64| {
                [2.0 * (2.0 * u).exp() * (2.0 * v + 0.3).sin(), 2.0 * (2.0 * u).exp() * (2.0 * v + 0.3).cos()]
            };
            (psi, gradient)
        }
    }

    /// Points and weights of Gauss and Legendre's rule over [0, 1].
    fn gauss(n: usize) -> Vec<[f64; 2]> {
        (0..n)
            .map(|k| {
                let mut x = (std::f64::consts::PI * (k as f64 + 0.75) / (n as f64 + 0.5)).cos();
                let mut slope = 1.0;
                for _ in 0..50 {
                    let (mut before, mut value) = (1.0, x);
                    for m in 2..=n {
                        let m = m as f64;
                        (before, value) = (value, ((2.0 * m - 1.0) * x * value - (m - 1.0) * before) / m);
                    }
                    slope = n as f64 * (x * value - before) / (x * x - 1.0);
                    x -= value / slope;
                }
                [0.5 * (x + 1.0), 1.0 / ((1.0 - x * x) * slope * slope)]
            })
            .collect()
    }

    #[test]
    fn known_functions_come_back_with_the_order_of_their_degree() {
        for radial in [false, true] {
            let (psi, gradient) = known(radial);
            for degree in 2..=5 {
                // Samples stand for the integral exactly enough at Gauss points of each span; at even
                // ones the last order is lost in fine nets.
                let errors = [4usize, 8, 16].map(|spans| {
                    let places: Vec<[f64; 2]> = (0..spans)
                        .flat_map(|s| {
                            gauss(degree + 1)
                                .into_iter()
                                .map(move |[x, w]| [(s as f64 + x) / spans as f64, w])
                        })
                        .collect();
                    let samples: Vec<StreamSample> = places
                        .iter()
                        .flat_map(|[v, b]| places.iter().map(move |[u, a]| (*u, *v, a * b)))
                        .map(|(u, v, weight)| {
                            let [gu, gv] = gradient(u, v);
                            let density = gu.hypot(gv);
                            let across = [gu / density, gv / density];
                            StreamSample {
                                u,
                                v,
                                along: [across[1], -across[0]],
                                across,
                                density,
                                weight,
                                direction: DIRECTION_WEIGHT,
                            }
                        })
                        .collect();
                    let knots = KnotVector::clamped_uniform(degree, spans + degree, [0.0, 1.0]).unwrap();
                    let fit = fit_stream_function(&samples, knots.clone(), knots, Solver::Cholesky).unwrap();
                    let difference = |k: usize| {
                        let (u, v) = ((k % 41) as f64 / 40.0, (k / 41) as f64 / 40.0);
                        fit.psi.value_and_gradient(u, v)[0] - psi(u, v)
                    };
                    let mean = (0..41 * 41).map(difference).sum::<f64>() / (41.0 * 41.0);
                    (0..41 * 41).map(|k| (difference(k) - mean).powi(2)).sum::<f64>().sqrt() / 41.0
                });
                let order = (errors[1] / errors[2]).log2();
                println!("radial {radial}, degree {degree}: {errors:?}, order {order:.2}");
                assert!(
                    (order - degree as f64 - 1.0).abs() < 0.35,
                    "radial {radial}, degree {degree}: {errors:?}"
                );
            }
        }
    }

    #[test]
    fn all_solvers_give_the_same_function() {
        // Directions that turn, densities that do not fit them, weights over two decades.
        let samples: Vec<StreamSample> = samples_of(54, |u, v| {
            let a = 1.2 + 0.8 * (3.0 * u).sin() + v;
            let density = 1.0 + 0.4 * (5.0 * v).cos();
            [density * a.cos(), density * a.sin()]
        })
        .into_iter()
        .map(|s| StreamSample { weight: 0.02 + s.u * s.v, ..s })
        .collect();
        for (degree, controls) in [(2, [18, 14]), (3, [18, 18]), (5, [12, 20])] {
            let [knots_u, knots_v] =
                controls.map(|n| KnotVector::clamped_uniform(degree, n, [0.0, 1.0]).unwrap());
            let fits = Solver::ALL.map(|solver| {
                fit_stream_function(&samples, knots_u.clone(), knots_v.clone(), solver).unwrap()
            });
            let coefficients = fits[0].psi.coefficients();
            let range = coefficients.iter().fold([0.0f64; 2], |[lo, hi], c| [lo.min(*c), hi.max(*c)]);
            let unknowns = controls[0] * controls[1];
            for (fit, solver) in fits.iter().zip(Solver::ALL) {
                let worst = fit.psi.coefficients().iter().zip(coefficients).map(|(a, b)| (a - b).abs());
                let worst = worst.fold(0.0, f64::max) / (range[1] - range[0]);
                println!("degree {degree}: {}, off by {worst:.1e}", fit.report);
                assert!(worst < 1e-7, "{}: {worst}", solver.name());
                assert!((fit.report.misfit - fits[0].report.misfit).abs() < 1e-9);
                assert!(fit.report.misfit > 0.05 && fit.report.residual < 1e-10);
                assert_eq!(fit.report.unknowns, unknowns);
                match solver {
                    Solver::ConjugateGradient | Solver::Gmres => {
                        assert!(fit.report.rank.is_none() && fit.report.iterations.unwrap() > 10);
                    }
                    _ => assert_eq!(fit.report.rank, Some(unknowns - 1)),
                }
            }
        }
    }

    #[test]
    fn rows_and_single_conditions_make_the_same_equations() {
        let samples = samples_of(23, known(true).1);
        let knots = knots(9, [0.0, 1.0]);
        let mut single = NormalEquations::new(knots.clone(), knots.clone());
        for s in &samples {
            let gradient = |d: [f64; 2]| [[0.0, d[1], 0.0], [d[0], 0.0, 0.0], [0.0; 3]];
            single.add(s.u, s.v, &gradient(s.along), 0.0, s.direction * s.weight);
            single.add(s.u, s.v, &gradient(s.across), s.density, s.weight);
        }
        let expected = single.solve(true).unwrap();
        // In rows and, turned round, one by one.
        let mut scattered = samples.clone();
        scattered.sort_by(|a, b| a.u.total_cmp(&b.u));
        for samples in [samples, scattered] {
            let fit = fit_stream_function(&samples, knots.clone(), knots.clone(), Solver::Cholesky).unwrap();
            let pairs = fit.psi.coefficients().iter().zip(expected.coefficients());
            assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-10));
        }
    }

    #[test]
    fn the_dense_solver_tells_the_rank_of_what_others_refuse() {
        // All samples in one corner: most coefficients are open.
        let samples: Vec<StreamSample> =
            samples_of(40, known(false).1).into_iter().filter(|s| s.u < 0.4 && s.v < 0.4).collect();
        let fit =
            |solver, n| fit_stream_function(&samples, knots(n, [0.0, 1.0]), knots(n, [0.0, 1.0]), solver);
        for solver in [Solver::Cholesky, Solver::Qr] {
            let error = fit(solver, 13).unwrap_err();
            assert!(matches!(error, FieldError::RankDeficient { .. }), "{}: {error}", solver.name());
        }
        let dense = fit(Solver::MinimumNorm, 13).unwrap();
        // Ten spans: samples in the first four reach seven basis functions each way.
        assert_eq!(dense.report.rank, Some(7 * 7 - 1));
        let large = fit(Solver::MinimumNorm, 30).unwrap_err();
        assert!(large.to_string().contains("at most 600 coefficients, and here are 900"), "{large}");
    }

    #[test]
    fn fields_without_a_stream_function_are_refused() {
        let k = || knots(6, [0.0, 1.0]);
        let samples = samples_of(20, |_, _| [0.0, 1.0]);
        for solver in Solver::ALL {
            let fit = |samples: &[StreamSample]| fit_stream_function(samples, k(), k(), solver).unwrap_err();
            let nothing: Vec<_> = samples.iter().map(|s| StreamSample { weight: 0.0, ..*s }).collect();
            assert!(matches!(fit(&nothing), FieldError::Trivial(_)));
            let level: Vec<_> = samples.iter().map(|s| StreamSample { density: 0.0, ..*s }).collect();
            assert!(matches!(fit(&level), FieldError::Trivial(_)));
            // Opposite densities in equal measure cancel everywhere.
            let both = samples.iter().flat_map(|s| [*s, StreamSample { density: -s.density, ..*s }]);
            let error = fit(&both.collect::<Vec<_>>());
            assert!(matches!(error, FieldError::Trivial(_)), "{}: {error}", solver.name());
            assert!(matches!(fit(&[]), FieldError::Trivial(_)));
            let negative = [StreamSample { weight: -1.0, ..samples[0] }];
            assert!(matches!(fit(&negative), FieldError::Invalid(_)));
        }
    }
}
