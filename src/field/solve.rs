//! Solvers of the least-squares systems of stream functions.
//!
//! Enters: normal equations (symmetric, positive semi-definite) or the rectangular system itself.
//! Leaves: the coefficients and a [`SolveReport`]. All solvers give the same function within
//! 1e-7 of its range where the system determines it (tests of the `fit` module).
//!
//! The constant of a stream function is open, so systems have rank ≤ n − 1. Direct solvers pin one
//! coefficient; CG and GMRES run on the singular but consistent equations, and the dense singular
//! value decomposition takes the solution of least norm. All work runs on the calling thread: at
//! these sizes threads cost more than they save, and bits do not depend on their number.
//!
//! A factorisation that succeeds does not prove full rank. So the true residual of every result is checked.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::sparse::linalg::cholesky::factorize_symbolic_cholesky;
use faer::sparse::linalg::qr::factorize_symbolic_qr;
use faer::sparse::{SparseColMat, SymbolicSparseColMat};
use faer::{Conj, Mat, Par, Side};

use super::fit::FieldError;

/// How a least-squares system is solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Solver {
    /// Sparse Cholesky of the normal equations, one coefficient pinned: the fastest.
    #[default]
    Cholesky,
    /// Sparse QR of the rectangular system, one coefficient pinned: does not square the condition.
    Qr,
    /// Dense singular value decomposition of the rectangular system; tells the rank and solves
    /// systems that leave coefficients open. At most [`MAX_DENSE`] coefficients.
    MinimumNorm,
    /// Conjugate gradients on the normal equations, preconditioned by their diagonal.
    ConjugateGradient,
    /// GMRES on the normal equations, restarted, preconditioned by their diagonal.
    Gmres,
}

impl Solver {
    /// The words of the solvers.
    pub const WORDS: [&'static str; 5] = ["cholesky", "qr", "minimum-norm", "cg", "gmres"];

    /// All solvers.
    pub const ALL: [Self; 5] =
        [Self::Cholesky, Self::Qr, Self::MinimumNorm, Self::ConjugateGradient, Self::Gmres];

    /// The solver that a word stands for.
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|solver| solver.name() == word)
    }

    /// Its word.
    pub fn name(self) -> &'static str {
        Self::WORDS[self as usize]
    }
}

/// How a system was solved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolveReport {
    /// What solved it, in a word or two.
    pub method: &'static str,
    /// Coefficients, the open constant included.
    pub unknowns: usize,
    /// `max |Nx − r|` of the normal equations over `max (|N||x| + |r|)`: how well they are solved.
    pub residual: f64,
    /// `‖Ax − b‖/‖b‖` of the conditions: how well they can be met at all.
    pub misfit: f64,
    /// Rank of the system, at most `unknowns − 1` where the constant is open. From singular values for
    /// minimum norm; else shown to be full by a known solution that comes back; `None` for iterations.
    pub rank: Option<usize>,
    /// Iterations, of iterative solvers.
    pub iterations: Option<usize>,
}

impl std::fmt::Display for SolveReport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}, {} unknowns", self.method, self.unknowns)?;
        if let Some(rank) = self.rank {
            write!(f, ", rank {rank}")?;
        }
        if let Some(iterations) = self.iterations {
            write!(f, ", {iterations} iterations")?;
        }
        write!(f, ", residual {:.1e}, misfit {:.1e}", self.residual, self.misfit)
    }
}

/// Most coefficients of the dense solver. Its time grows as samples × coefficients²: seconds here.
pub const MAX_DENSE: usize = 600;

/// A direct solution counts as determined when a known vector comes back within this, relative. Its
/// error is about rounding times the condition, so that beyond it nothing is left of a coefficient.
const RECOVERY_LIMIT: f64 = 1e-3;

/// Iterations end when the residual is below this share of the right side. Less cannot be reached on
/// fine nets; more shows in the last digits of a path.
const ITERATION_TOLERANCE: f64 = 1e-13;

/// Steps of GMRES before it starts anew; each keeps a vector.
const RESTART: usize = 100;

/// Iterations before the solver gives up.
const MAX_ITERATIONS: usize = 20_000;

/// Solution and, where told, rank and iterations.
pub(super) struct Solution {
    pub x: Vec<f64>,
    pub rank: Option<usize>,
    pub iterations: Option<usize>,
}

/// A sparse matrix by columns, rows ascending in each.
pub(super) struct Columns {
    pub starts: Vec<usize>,
    pub rows: Vec<usize>,
    pub values: Vec<f64>,
}

impl Columns {
    fn matrix(self, rows: usize) -> Option<SparseColMat<usize, f64>> {
        let columns = self.starts.len() - 1;
        let ordered = self.starts.windows(2).all(|w| w[0] <= w[1])
            && self.starts[columns] == self.rows.len()
            && self.rows.len() == self.values.len()
            && self.starts.windows(2).all(|w| {
                let column = &self.rows[w[0]..w[1]];
                column.windows(2).all(|r| r[0] < r[1]) && column.last().is_none_or(|&r| r < rows)
            });
        ordered.then(|| {
            let symbolic = SymbolicSparseColMat::new_checked(rows, columns, self.starts, None, self.rows);
            SparseColMat::new(symbolic, self.values)
        })
    }
}

/// A least-squares system by rows: `Σ values·x[columns] = target`, each row weighted already.
#[derive(Default)]
pub(super) struct Rows {
    pub starts: Vec<usize>,
    pub columns: Vec<usize>,
    pub values: Vec<f64>,
    pub targets: Vec<f64>,
}

impl Rows {
    /// The row `k`: columns and values.
    fn row(&self, k: usize) -> impl Iterator<Item = (usize, f64)> {
        let end = self.starts.get(k + 1).copied().unwrap_or(self.columns.len());
        let range = self.starts[k]..end;
        self.columns[range.clone()].iter().copied().zip(self.values[range].iter().copied())
    }

    /// By columns, without the first `skip` columns.
    fn by_columns(&self, count: usize, skip: usize) -> Columns {
        let mut starts = vec![0; count - skip + 1];
        for &c in self.columns.iter().filter(|&&c| c >= skip) {
            starts[c - skip + 1] += 1;
        }
        for c in 1..starts.len() {
            starts[c] += starts[c - 1];
        }
        let total = starts[count - skip];
        let (mut next, mut rows, mut values) = (starts.clone(), vec![0; total], vec![0.0; total]);
        for k in 0..self.targets.len() {
            for (c, value) in self.row(k).filter(|&(c, _)| c >= skip) {
                let at = next[c - skip];
                (rows[at], values[at]) = (k, value);
                next[c - skip] += 1;
            }
        }
        Columns { starts, rows, values }
    }
}

/// A vector that no system favours, to see whether it comes back: ±1 in a fixed, irregular order.
fn probe(n: usize) -> impl Iterator<Item = f64> {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    (0..n).map(move |_| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        if state & (1 << 40) == 0 { 1.0 } else { -1.0 }
    })
}

/// True when `found` is the probe again.
fn recovered(found: impl Iterator<Item = f64>, n: usize) -> bool {
    let square: f64 = found.zip(probe(n)).map(|(a, b)| (a - b).powi(2)).sum();
    square <= RECOVERY_LIMIT.powi(2) * n as f64
}

/// Solves a positive definite system, given by its lower half, by sparse Cholesky. `None` where the
/// factorisation fails; without a rank where a known vector does not come back: then some combination
/// of unknowns is hardly determined.
pub(super) fn cholesky(lower: Columns, rhs: &[f64]) -> Result<Option<Solution>, FieldError> {
    let n = rhs.len();
    let laid_out = || FieldError::Invalid("the normal equations cannot be laid out".into());
    let a = lower.matrix(n).ok_or_else(laid_out)?;
    let symbolic =
        factorize_symbolic_cholesky(a.symbolic(), Side::Lower, Default::default(), Default::default())
            .map_err(|_| FieldError::Memory { unknowns: n })?;
    let mut factor = vec![0.0; symbolic.len_val()];
    let scratch = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
    let mut memory = MemBuffer::try_new(scratch.or(symbolic.solve_in_place_scratch::<f64>(2, Par::Seq)))
        .map_err(|_| FieldError::Memory { unknowns: n })?;
    let Ok(factor) = symbolic.factorize_numeric_llt(
        &mut factor,
        a.as_ref(),
        Side::Lower,
        LltRegularization::default(),
        Par::Seq,
        MemStack::new(&mut memory),
        Default::default(),
    ) else {
        return Ok(None);
    };
    // The right side, and that of the probe.
    let mut sides = Mat::<f64>::zeros(n, 2);
    let known: Vec<f64> = probe(n).collect();
    for c in 0..n {
        sides[(c, 0)] = rhs[c];
        let (rows, values) = (a.symbolic().row_idx_of_col_raw(c), a.val_of_col(c));
        for (&r, value) in rows.iter().zip(values) {
            sides[(r, 1)] += value * known[c];
            if r != c {
                sides[(c, 1)] += value * known[r];
            }
        }
    }
    factor.solve_in_place_with_conj(Conj::No, sides.as_mut(), Par::Seq, MemStack::new(&mut memory));
    let full = recovered((0..n).map(|k| sides[(k, 1)]), n);
    let x = (0..n).map(|k| sides[(k, 0)]).collect();
    Ok(Some(Solution { x, rank: full.then_some(n), iterations: None }))
}

/// Solves a least-squares system of `count` columns by sparse QR, the first `skip` unknowns held at
/// 0. `None` where the rank is not full.
pub(super) fn qr(rows: &Rows, count: usize, skip: usize) -> Result<Option<Solution>, FieldError> {
    let (m, n) = (rows.targets.len(), count - skip);
    if m < n {
        return Ok(None);
    }
    let memory_short = |_| FieldError::Memory { unknowns: n };
    let a = rows
        .by_columns(count, skip)
        .matrix(m)
        .ok_or_else(|| FieldError::Invalid("the conditions cannot be laid out".into()))?;
    // A column without entries is an unknown that nothing determines.
    if (0..n).any(|c| a.val_of_col(c).is_empty()) {
        return Ok(None);
    }
    let symbolic = factorize_symbolic_qr(a.symbolic(), Default::default())
        .map_err(|_| FieldError::Memory { unknowns: n })?;
    let (mut indices, mut values) = (vec![0usize; symbolic.len_idx()], vec![0.0; symbolic.len_val()]);
    let scratch = symbolic.factorize_numeric_qr_scratch::<f64>(Par::Seq, Default::default());
    let mut memory = MemBuffer::try_new(scratch.or(symbolic.solve_in_place_scratch::<f64>(2, Par::Seq)))
        .map_err(memory_short)?;
    let factor = symbolic.factorize_numeric_qr(
        &mut indices,
        &mut values,
        a.as_ref(),
        Par::Seq,
        MemStack::new(&mut memory),
        Default::default(),
    );
    let known: Vec<f64> = probe(n).collect();
    let mut sides = Mat::<f64>::zeros(m, 2);
    for k in 0..m {
        sides[(k, 0)] = rows.targets[k];
        sides[(k, 1)] = rows.row(k).filter(|&(c, _)| c >= skip).map(|(c, v)| v * known[c - skip]).sum();
    }
    factor.solve_in_place_with_conj(Conj::No, sides.as_mut(), Par::Seq, MemStack::new(&mut memory));
    let full = recovered((0..n).map(|k| sides[(k, 1)]), n);
    let x = (0..n).map(|k| sides[(k, 0)]).collect();
    Ok(full.then_some(Solution { x, rank: Some(n), iterations: None }))
}

/// Refuses more unknowns than the dense solver takes, before anything is laid out for it.
///
/// # Errors
/// [`FieldError::Invalid`] for more than [`MAX_DENSE`].
pub(super) fn refuse_dense(count: usize) -> Result<(), FieldError> {
    if count <= MAX_DENSE {
        return Ok(());
    }
    Err(FieldError::Invalid(format!(
        "the minimum-norm solver is dense and takes at most {MAX_DENSE} coefficients, and here are {count}; use \
         fewer control points or another solver"
    )))
}

/// The least-squares solution of least norm by dense singular value decomposition.
///
/// # Errors
/// [`FieldError::Invalid`] for more than [`MAX_DENSE`] unknowns.
pub(super) fn minimum_norm(rows: &Rows, count: usize) -> Result<Solution, FieldError> {
    refuse_dense(count)?;
    let m = rows.targets.len();
    // Singular values of A are those of its triangular factor, which rows can be added to in blocks.
    let mut upper = Mat::<f64>::zeros(count, count + 1);
    let block = 2 * count + 1;
    for first in (0..m).step_by(block) {
        let taken = block.min(m - first);
        let mut stacked = Mat::<f64>::zeros(count + taken, count + 1);
        stacked.as_mut().subrows_mut(0, count).copy_from(&upper);
        for k in 0..taken {
            for (c, value) in rows.row(first + k) {
                stacked[(count + k, c)] = value;
            }
            stacked[(count + k, count)] = rows.targets[first + k];
        }
        let factor = with_one_thread::qr_upper(stacked);
        upper.as_mut().copy_from(factor.as_ref().subrows(0, count));
    }
    let square = upper.as_ref().subcols(0, count);
    let (u, s, v) = with_one_thread::svd(square).ok_or_else(|| {
        FieldError::Invalid("the singular value decomposition did not converge; use another solver".into())
    })?;
    let cut = m.max(count) as f64 * f64::EPSILON * s.first().copied().unwrap_or(0.0);
    let rank = s.iter().filter(|&&s| s > cut).count();
    let mut x = vec![0.0; count];
    for k in 0..rank {
        let share: f64 = (0..count).map(|i| u[(i, k)] * upper[(i, count)]).sum::<f64>() / s[k];
        for i in 0..count {
            x[i] += share * v[(i, k)];
        }
    }
    Ok(Solution { x, rank: Some(rank), iterations: None })
}

/// faer's dense decompositions with the number of threads said at the call.
mod with_one_thread {
    use faer::dyn_stack::{MemBuffer, MemStack};
    use faer::linalg::{qr::no_pivoting::factor as qr, svd};
    use faer::{Mat, MatRef, Par};

    /// The upper triangular factor of `a` (its lower part zeroed), as many rows as columns less one,
    /// the last column being a right side.
    pub fn qr_upper(mut a: Mat<f64>) -> Mat<f64> {
        let (m, n) = (a.nrows(), a.ncols());
        let size = m.min(n);
        let block = qr::recommended_block_size::<f64>(m, n);
        let mut householder = Mat::<f64>::zeros(block, size);
        let scratch = qr::qr_in_place_scratch::<f64>(m, n, block, Par::Seq, Default::default());
        let mut memory = MemBuffer::new(scratch);
        qr::qr_in_place(
            a.as_mut(),
            householder.as_mut(),
            Par::Seq,
            MemStack::new(&mut memory),
            Default::default(),
        );
        Mat::from_fn(size, n, |i, j| if i <= j { a[(i, j)] } else { 0.0 })
    }

    /// `(U, singular values, V)` of a square matrix.
    pub fn svd(a: MatRef<'_, f64>) -> Option<(Mat<f64>, Vec<f64>, Mat<f64>)> {
        let n = a.nrows();
        let (mut u, mut v) = (Mat::<f64>::zeros(n, n), Mat::<f64>::zeros(n, n));
        let mut s = faer::diag::Diag::<f64>::zeros(n);
        let full = svd::ComputeSvdVectors::Full;
        let scratch = svd::svd_scratch::<f64>(n, n, full, full, Par::Seq, Default::default());
        let mut memory = MemBuffer::new(scratch);
        svd::svd(
            a,
            s.as_mut(),
            Some(u.as_mut()),
            Some(v.as_mut()),
            Par::Seq,
            MemStack::new(&mut memory),
            Default::default(),
        )
        .ok()?;
        Some((u, s.column_vector().iter().copied().collect(), v))
    }
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Four running sums, which compilers turn into one vector; the order is fixed.
    let mut sums = [0.0; 8];
    let (a8, b8) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = a8.remainder().iter().zip(b8.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in a8.zip(b8) {
        for k in 0..8 {
            sums[k] += x[k] * y[k];
        }
    }
    sums.iter().sum::<f64>() + rest
}

/// Conjugate gradients from 0 for `apply(x, y)`: y = Nx, symmetric and positive semi-definite, with
/// the preconditioner `precondition(r, z)`. `stop` is the residual relative to the right side, both in
/// the preconditioner's norm.
pub(super) fn conjugate_gradient(
    mut apply: impl FnMut(&[f64], &mut [f64]),
    mut precondition: impl FnMut(&[f64], &mut [f64]),
    rhs: &[f64],
    stop: f64,
    most: usize,
) -> Solution {
    let n = rhs.len();
    let (mut x, mut r) = (vec![0.0; n], rhs.to_vec());
    let (mut z, mut q) = (vec![0.0; n], vec![0.0; n]);
    precondition(&r, &mut z);
    let mut p = z.clone();
    let mut rho = dot(&r, &z);
    let goal = stop * stop * rho;
    let mut iterations = 0;
    while rho > goal && iterations < most {
        apply(&p, &mut q);
        let curvature = dot(&p, &q);
        // Only rounding is left of the search direction.
        if curvature.is_nan() || curvature <= 0.0 {
            break;
        }
        let step = rho / curvature;
        for k in 0..n {
            x[k] += step * p[k];
            r[k] -= step * q[k];
        }
        precondition(&r, &mut z);
        let next = dot(&r, &z);
        let turn = next / rho;
        for k in 0..n {
            p[k] = z[k] + turn * p[k];
        }
        rho = next;
        iterations += 1;
    }
    Solution { x, rank: None, iterations: Some(iterations) }
}

/// Conjugate gradients with the inverse diagonal as preconditioner.
pub(super) fn diagonal_cg(apply: impl FnMut(&[f64], &mut [f64]), inverse: &[f64], rhs: &[f64]) -> Solution {
    let scale = |r: &[f64], z: &mut [f64]| {
        for k in 0..r.len() {
            z[k] = inverse[k] * r[k];
        }
    };
    conjugate_gradient(apply, scale, rhs, ITERATION_TOLERANCE, MAX_ITERATIONS)
}

/// Restarted GMRES (Saad & Schultz 1986) from 0 on `D^-½ N D^-½`, D the diagonal of N given by its
/// inverse; the scaling on both sides keeps the system symmetric and consistent.
pub(super) fn gmres(mut apply: impl FnMut(&[f64], &mut [f64]), inverse: &[f64], rhs: &[f64]) -> Solution {
    let n = rhs.len();
    let roots: Vec<f64> = inverse.iter().map(|d| d.sqrt()).collect();
    let mut inner = vec![0.0; n];
    let mut scaled = |x: &[f64], y: &mut Vec<f64>| {
        for k in 0..n {
            inner[k] = roots[k] * x[k];
        }
        apply(&inner, y);
        for k in 0..n {
            y[k] *= roots[k];
        }
    };
    let b: Vec<f64> = (0..n).map(|k| roots[k] * rhs[k]).collect();
    let goal = ITERATION_TOLERANCE * dot(&b, &b).sqrt();
    let (mut x, mut residual) = (vec![0.0; n], b.clone());
    let mut iterations = 0;
    let mut best = f64::INFINITY;
    loop {
        let beta = dot(&residual, &residual).sqrt();
        // Rounding ends the progress of restarts a little above the goal.
        if beta <= goal || beta >= 0.9 * best || iterations >= MAX_ITERATIONS {
            break;
        }
        best = beta;
        let mut basis = vec![residual.iter().map(|r| r / beta).collect::<Vec<f64>>()];
        // Columns of the Hessenberg matrix, made triangular by rotations as they come.
        let mut upper: Vec<Vec<f64>> = Vec::new();
        let mut rotations: Vec<[f64; 2]> = Vec::new();
        let mut side = vec![beta];
        for step in 0..RESTART {
            let mut w = vec![0.0; n];
            scaled(&basis[step], &mut w);
            let mut column = Vec::with_capacity(step + 2);
            // Twice: once leaves the vectors orthogonal to rounding times the condition only.
            let mut heights = vec![0.0; step + 1];
            for _ in 0..2 {
                for (v, height) in basis.iter().zip(&mut heights) {
                    let h = dot(&w, v);
                    *height += h;
                    for k in 0..n {
                        w[k] -= h * v[k];
                    }
                }
            }
            column.append(&mut heights);
            let below = dot(&w, &w).sqrt();
            for (k, [c, s]) in rotations.iter().enumerate() {
                let (a, b) = (column[k], column[k + 1]);
                (column[k], column[k + 1]) = (c * a + s * b, c * b - s * a);
            }
            let diagonal = column[step].hypot(below);
            iterations += 1;
            if diagonal == 0.0 {
                break;
            }
            let (c, s) = (column[step] / diagonal, below / diagonal);
            column[step] = diagonal;
            rotations.push([c, s]);
            upper.push(column);
            let last = side[step];
            side[step] = c * last;
            side.push(-s * last);
            if (s * last).abs() <= 0.1 * goal || below <= f64::EPSILON * diagonal {
                break;
            }
            basis.push(w.iter().map(|w| w / below).collect());
        }
        let steps = upper.len();
        let mut y = side[..steps].to_vec();
        for i in (0..steps).rev() {
            y[i] = (y[i] - (i + 1..steps).map(|k| upper[k][i] * y[k]).sum::<f64>()) / upper[i][i];
        }
        for (v, y) in basis.iter().zip(&y) {
            for k in 0..n {
                x[k] += y * v[k];
            }
        }
        let mut image = vec![0.0; n];
        scaled(&x, &mut image);
        for k in 0..n {
            residual[k] = b[k] - image[k];
        }
    }
    for k in 0..n {
        x[k] *= roots[k];
    }
    Solution { x, rank: None, iterations: Some(iterations) }
}
