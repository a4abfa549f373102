//! Stream functions from directions by finite differences on an even grid.
//!
//! Enters: what is asked of ∇ψ in each cell, in parameters. Leaves: the least-squares ψ at the nodes, as a
//! [`GridField`]; of second order in the size h of the cells in the mean, h² log(1/h) in the corners of the
//! rectangle. Natural boundary conditions come by themselves, since the discrete energy itself is made least;
//! the open constant is fixed by a mean of 0.
//!
//! The stream function is that of the `fit` module, `∫ q [α (t·∇ψ)² + (b·∇ψ − g)²] dA`; each sample speaks
//! for one cell.
//!
//! Solvers: CG with a multigrid cycle; sparse Cholesky and GMRES to compare.

use super::fit::{FieldError, StreamSample, checked_sums, refuse_constant};
use super::grid::GridField;
use super::multigrid::{Edges, Multigrid, Tensor};
use super::solve::{Columns, SolveReport, Solver};
use crate::solve;

/// CG on a grid ends at this residual over the right side, in the norm of the preconditioner. What is
/// left is far below the error of the differences; less costs an iteration a decade.
const GRID_TOLERANCE: f64 = 1e-8;

/// Iterations of CG with the multigrid cycle, which takes some ten, before it gives up.
const MAX_GRID_ITERATIONS: usize = 500;

/// Residual of the equations, relative to their terms, that counts as solved.
const RESIDUAL_LIMIT: f64 = 1e-7;

/// Cells without a direction take this share of the mean tensor and ask for nothing: ψ is continued
/// smoothly (harmonically) across them. More would bend the neighbours.
const EMPTY_SHARE: f64 = 1e-6;

/// Most cells of a grid; bounds memory (some 200 bytes a cell).
const MAX_CELLS: usize = 1 << 24;

/// A function on a grid and how it was found.
#[derive(Debug, Clone, PartialEq)]
pub struct GridSolution {
    /// ψ or φ; its mean over the rectangle of parameters is 0.
    pub psi: GridField,
    /// How the system was solved.
    pub report: SolveReport,
}

/// A stream function on a grid and how well it follows its samples.
#[derive(Debug, Clone, PartialEq)]
pub struct GridFit {
    /// ψ; its mean over the rectangle of parameters is 0.
    pub psi: GridField,
    /// Root mean square of the angle between level curves and feed directions, rad, weighted.
    pub angle_rms: f64,
    /// How the system was solved.
    pub report: SolveReport,
}

/// The stream function of samples at the centres of `cells[0]` × `cells[1]` cells over `domain`,
/// `[cells[1]][cells[0]]`, row-major; `None` where there is no direction (see [`FieldError`] and the
/// module's head). `weight` is per area of parameters.
///
/// # Errors
/// [`FieldError`] where samples are not finite, ask for nothing but a constant, do not fit the grid, or
/// the solver is not one of [`Solver::Cholesky`], [`Solver::ConjugateGradient`] and [`Solver::Gmres`].
///
/// # Tolerance
/// Second order in the size of the cells.
pub fn fit_by_differences(
    samples: &[Option<StreamSample>],
    domain: [[f64; 2]; 2],
    cells: [usize; 2],
    solver: Solver,
) -> Result<GridFit, FieldError> {
    check_grid(domain, cells, samples.len(), cells[0].saturating_mul(cells[1]))?;
    let [weights, asked] = checked_sums(samples.iter().flatten())?;
    let size = [0, 1].map(|c| (domain[c][1] - domain[c][0]) / cells[c] as f64);
    let mut mean = [0.0; 2];
    for sample in samples.iter().flatten() {
        let [uu, _, vv] = sample.tensor();
        (mean[0], mean[1]) = (mean[0] + uu, mean[1] + vv);
    }
    let empty = mean.map(|m| EMPTY_SHARE * m / samples.len() as f64);
    let mut tensors = Vec::with_capacity(samples.len());
    let mut fluxes = Vec::with_capacity(samples.len());
    for sample in samples {
        let given = sample.filter(|s| s.weight > 0.0).map(|s| s.tensor());
        let [uu, uv, vv] = given.unwrap_or([empty[0], 0.0, empty[1]]);
        let [fu, fv] = sample.map_or([0.0; 2], |s| s.flux());
        let [size_u, size_v] = size;
        tensors.push([uu / (size_u * size_u), uv / (size_u * size_v), vv / (size_v * size_v)]);
        fluxes.push([fu / size_u, fv / size_v]);
    }
    let GridSolution { psi, mut report } =
        Equations { domain, cells, tensors, fluxes, asked }.solve(solver)?;
    let (mut misfit, mut angle) = (0.0, 0.0);
    for (k, sample) in samples.iter().enumerate() {
        let Some(sample) = sample else { continue };
        let (i, j) = (k % cells[0], k / cells[0]);
        let at = |a: usize, b: usize| psi.node(i + a, j + b);
        let pu = 0.5 * (at(1, 0) - at(0, 0) + at(1, 1) - at(0, 1)) / size[0];
        let pv = 0.5 * (at(0, 1) - at(0, 0) + at(1, 1) - at(1, 0)) / size[1];
        let [m, a] = sample.misfit([pu, pv]);
        (misfit, angle) = (misfit + m, angle + a);
    }
    report.misfit = (misfit / asked).sqrt();
    Ok(GridFit { psi, angle_rms: (angle / weights).sqrt(), report })
}

fn check_grid(
    domain: [[f64; 2]; 2],
    cells: [usize; 2],
    found: usize,
    expected: usize,
) -> Result<(), FieldError> {
    let invalid = |message: String| Err(FieldError::Invalid(message));
    if cells.iter().any(|&n| n < 2) || domain.iter().any(|[lo, hi]| !(hi > lo && (hi - lo).is_finite())) {
        return invalid("a grid of differences needs two cells a side and a rectangle with an area".into());
    }
    if cells[0].saturating_mul(cells[1]) > MAX_CELLS {
        return invalid(format!("{} x {} cells are more than {MAX_CELLS}", cells[0], cells[1]));
    }
    if found != expected {
        return invalid(format!("a grid of {expected} values got {found}"));
    }
    Ok(())
}

/// `∇ψᵀ K ∇ψ − 2 f·∇ψ` of each cell, in units of cells.
struct Equations {
    domain: [[f64; 2]; 2],
    cells: [usize; 2],
    tensors: Vec<Tensor>,
    fluxes: Vec<[f64; 2]>,
    /// The square of what is asked.
    asked: f64,
}

impl Equations {
    fn solve(&self, solver: Solver) -> Result<GridSolution, FieldError> {
        let [nu, nv] = self.cells;
        if matches!(solver, Solver::Qr | Solver::MinimumNorm) {
            return Err(FieldError::Invalid(format!(
                "differences have no rectangular system for the solver \"{}\"; use cholesky, cg or gmres",
                solver.name()
            )));
        }
        let ones = [vec![1.0; nu], vec![1.0; nv]];
        let edges = Edges::new(&self.tensors, [&ones[0], &ones[1]]);
        let rhs = self.right_side(&edges);
        let unknowns = (nu + 1) * (nv + 1);
        let (x, method, rank, iterations) = match solver {
            Solver::Cholesky => (self.cholesky(&edges, &rhs)?, "cholesky", Some(unknowns - 1), None),
            Solver::Gmres => {
                let inverse: Vec<f64> =
                    edges.diagonal().iter().map(|&d| if d > 0.0 { 1.0 / d } else { 0.0 }).collect();
                let solution = solve::gmres(|x, y| edges.apply(x, y), &inverse, &rhs);
                (solution.x, "gmres", None, solution.iterations)
            }
            _ => {
                let mut cycle = Multigrid::new(&edges, &self.tensors);
                let solution = solve::conjugate_gradient(
                    |x, y| edges.apply(x, y),
                    |r, z| cycle.precondition(r, z),
                    &rhs,
                    GRID_TOLERANCE,
                    MAX_GRID_ITERATIONS,
                );
                (solution.x, "cg with multigrid", None, solution.iterations)
            }
        };
        refuse_constant(solve::dot(&x, &rhs) / self.asked)?;
        let residual = relative_residual(&edges, &x, &rhs);
        if residual.is_nan() || residual > RESIDUAL_LIMIT {
            return Err(FieldError::NotSolved { method, residual, iterations: iterations.unwrap_or(0) });
        }
        let mut values: Vec<f64> = (0..unknowns).map(|k| x[edges.at(k % (nu + 1), k / (nu + 1))]).collect();
        let mean = self.mean(&values);
        values.iter_mut().for_each(|x| *x -= mean);
        let misfit = (1.0 - solve::dot(&values, &self.unpadded(&edges, &rhs)) / self.asked).max(0.0).sqrt();
        let psi = GridField::new(self.domain, self.cells, &values)
            .ok_or_else(|| FieldError::Invalid("the grid is too small".into()))?;
        Ok(GridSolution { psi, report: SolveReport { method, unknowns, residual, misfit, rank, iterations } })
    }

    fn unpadded(&self, edges: &Edges<f64>, x: &[f64]) -> Vec<f64> {
        let width = self.cells[0] + 1;
        (0..width * (self.cells[1] + 1)).map(|k| x[edges.at(k % width, k / width)]).collect()
    }

    /// `Σ f·∇ψ` as a linear form of the nodes, padded.
    fn right_side(&self, edges: &Edges<f64>) -> Vec<f64> {
        let mut rhs = vec![0.0; edges.len()];
        for (k, [fu, fv]) in self.fluxes.iter().enumerate() {
            let (i, j) = (k % self.cells[0], k / self.cells[0]);
            rhs[edges.at(i, j)] -= 0.5 * (fu + fv);
            rhs[edges.at(i + 1, j)] += 0.5 * (fu - fv);
            rhs[edges.at(i, j + 1)] += 0.5 * (fv - fu);
            rhs[edges.at(i + 1, j + 1)] += 0.5 * (fu + fv);
        }
        rhs
    }

    /// Sparse Cholesky with the first node pinned; padded.
    fn cholesky(&self, edges: &Edges<f64>, rhs: &[f64]) -> Result<Vec<f64>, FieldError> {
        let width = self.cells[0] + 1;
        let count = width * (self.cells[1] + 1);
        let place = |k: usize| edges.at(k % width, k / width);
        let stride = edges.at(0, 1) - edges.at(0, 0);
        let index = |at: usize| (at / stride - 1) * width + at % stride - 1;
        let mut columns = Columns { starts: vec![0], rows: Vec::new(), values: Vec::new() };
        for k in 1..count {
            columns.rows.push(k - 1);
            columns.values.push(edges.diagonal()[place(k)]);
            for (at, value) in edges.upper(place(k)).filter(|(_, value)| *value != 0.0) {
                columns.rows.push(index(at) - 1);
                columns.values.push(value);
            }
            columns.starts.push(columns.rows.len());
        }
        let sides: Vec<f64> = (1..count).map(|k| rhs[place(k)]).collect();
        let deficient = || FieldError::RankDeficient { samples: self.tensors.len(), coefficients: count - 1 };
        let solution = solve::cholesky(columns, &sides)?.ok_or_else(deficient)?;
        let mut x = vec![0.0; rhs.len()];
        (1..count).for_each(|k| x[place(k)] = solution.x[k - 1]);
        Ok(x)
    }

    /// Mean over the rectangle by the trapezoidal rule.
    fn mean(&self, values: &[f64]) -> f64 {
        let [nu, nv] = self.cells;
        let half = |k: usize, n: usize| if k == 0 || k == n { 0.5 } else { 1.0 };
        let sum: f64 = values
            .chunks_exact(nu + 1)
            .enumerate()
            .map(|(j, row)| half(j, nv) * row.iter().enumerate().map(|(i, x)| half(i, nu) * x).sum::<f64>())
            .sum();
        sum / (nu * nv) as f64
    }
}

/// `max |Ax − b|` over `max (|A||x| + |b|)`.
fn relative_residual(edges: &Edges<f64>, x: &[f64], rhs: &[f64]) -> f64 {
    let mut image = vec![0.0; rhs.len()];
    edges.apply(x, &mut image);
    // Twice the diagonal bounds the row sums of |A|; |x| is taken over the constant that is open.
    let middle = x.iter().sum::<f64>() / x.len() as f64;
    let terms = |k: usize| 2.0 * edges.diagonal()[k] * (x[k] - middle).abs() + rhs[k].abs();
    let scale = (0..rhs.len()).map(terms).fold(0.0, f64::max);
    let mut greatest = 0.0f64;
    for (a, b) in image.iter().zip(rhs) {
        if a.is_nan() {
            return f64::NAN;
        }
        greatest = greatest.max((a - b).abs());
    }
    if scale > 0.0 { greatest / scale } else { greatest }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DIRECTION_WEIGHT;
    use crate::{LevelTracer, ScalarField};

    const SOLVERS: [Solver; 3] = [Solver::ConjugateGradient, Solver::Cholesky, Solver::Gmres];

    /// Samples at the centres of cells of [0, 2] × [0, 1] that follow a known ψ.
    fn samples(n: [usize; 2], gradient: impl Fn(f64, f64) -> [f64; 2]) -> Vec<Option<StreamSample>> {
        (0..n[0] * n[1])
            .map(|k| {
                let u = 2.0 * ((k % n[0]) as f64 + 0.5) / n[0] as f64;
                let v = ((k / n[0]) as f64 + 0.5) / n[1] as f64;
                let [gu, gv] = gradient(u, v);
                let density = gu.hypot(gv);
                let across = [gu / density, gv / density];
                Some(StreamSample {
                    u,
                    v,
                    along: [across[1], -across[0]],
                    across,
                    density,
                    weight: 0.1 + u,
                    direction: DIRECTION_WEIGHT,
                })
            })
            .collect()
    }

    const DOMAIN: [[f64; 2]; 2] = [[0.0, 2.0], [0.0, 1.0]];

    /// Root mean square of the differences of nodes to `psi`, without the constant.
    fn error(field: &GridField, psi: impl Fn(f64, f64) -> f64) -> f64 {
        let [nu, nv] = field.cells();
        let [[u0, u1], [v0, v1]] = field.domain();
        let difference = |k: usize| {
            let (i, j) = (k % (nu + 1), k / (nu + 1));
            field.node(i, j)
                - psi(u0 + (u1 - u0) * i as f64 / nu as f64, v0 + (v1 - v0) * j as f64 / nv as f64)
        };
        let all: Vec<f64> = (0..(nu + 1) * (nv + 1)).map(difference).collect();
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        (all.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / all.len() as f64).sqrt()
    }

    #[test]
    fn known_fields_are_of_second_order() {
        for solver in SOLVERS {
            let fit = |n, gradient: fn(f64, f64) -> [f64; 2]| {
                fit_by_differences(&samples(n, gradient), DOMAIN, n, solver).unwrap()
            };
            let straight = fit([12, 7], |_, _| [0.0, 1.0]);
            assert!(error(&straight.psi, |_, v| v) < 1e-9 && straight.angle_rms < 1e-9);
            // The saddle xy, rotation about (−0.5, −0.5), and its radial field with density 1/r.
            for flow in ["saddle", "rotation", "radial"] {
                let errors = [[32, 22], [64, 44], [128, 88]].map(|n| match flow {
                    "saddle" => error(&fit(n, |u, v| [v + 0.1, u + 0.1]).psi, |u, v| (u + 0.1) * (v + 0.1)),
                    "rotation" => {
                        let psi = |u: f64, v: f64| -0.5 * ((u + 0.5).powi(2) + (v + 0.5).powi(2));
                        error(&fit(n, |u, v| [-u - 0.5, -v - 0.5]).psi, psi)
                    }
                    _ => {
                        let gradient = |u: f64, v: f64| {
                            let (x, y) = (u + 0.5, v + 0.5);
                            [-y / (x * x + y * y), x / (x * x + y * y)]
                        };
                        error(&fit(n, gradient).psi, |u, v| (v + 0.5).atan2(u + 0.5))
                    }
                });
                println!("{} {flow}: {errors:?}", solver.name());
                // The corners next to the pole are the last to show their order.
                let order = (errors[1] / errors[2]).log2();
                // Circles are exact at the nodes but for what iterations leave.
                let exact = errors.iter().all(|e| *e < 1e-7);
                assert!(exact || (order > 1.95 && errors[2] < 5e-4), "{flow}: {errors:?}");
            }
        }
    }

    #[test]
    fn solvers_agree_on_a_field_without_solution() {
        let twisted = |u: f64, v: f64| {
            let (a, density) = (1.2 + 0.8 * (3.0 * u).sin() + v, 1.0 + 0.4 * (5.0 * v).cos());
            [density * a.cos(), density * a.sin()]
        };
        for n in [[24, 31], [60, 20], [33, 64]] {
            let mut given = samples(n, twisted);
            // A hole, and weights over three decades.
            for (k, sample) in given.iter_mut().enumerate() {
                let (i, j) = (k % n[0], k / n[0]);
                if (3..9).contains(&i) && (4..8).contains(&j) {
                    *sample = None;
                } else if let Some(s) = sample {
                    s.weight = 1e-3 + s.u * s.v;
                }
            }
            let [a, b, c] = SOLVERS.map(|solver| fit_by_differences(&given, DOMAIN, n, solver).unwrap());
            for (other, solver) in [(&b, "cholesky"), (&c, "gmres")] {
                let worst = (0..=n[0])
                    .flat_map(|i| (0..=n[1]).map(move |j| (i, j)))
                    .map(|(i, j)| (a.psi.node(i, j) - other.psi.node(i, j)).abs())
                    .fold(0.0, f64::max);
                assert!(worst < 1e-6, "{n:?} {solver}: {worst}, {}, {}", a.report, other.report);
                assert!((a.report.misfit - other.report.misfit).abs() < 1e-8);
            }
            assert!(a.report.iterations.unwrap() < 60, "{}", a.report);
        }
    }

    #[test]
    fn levels_are_traced_on_a_grid() {
        let fit = fit_by_differences(
            &samples([80, 40], |u, v| [-u - 0.5, -v - 0.5]),
            DOMAIN,
            [80, 40],
            Solver::ConjugateGradient,
        )
        .unwrap();
        let field = ScalarField::Grid(fit.psi);
        let flat = |_: f64, _: f64| (1.0, 0.0, 1.0);
        let tracer = LevelTracer::new(&field, &flat, DOMAIN, [0.0; 2], 40, 0.02);
        let level = field.value_and_gradient(0.5, 0.5)[0];
        let curves = tracer.curves(level);
        assert_eq!(curves.len(), 1);
        for p in &curves[0].points {
            let r = (p[0] + 0.5).hypot(p[1] + 0.5);
            assert!((r - 2f64.sqrt()).abs() < 1e-5, "{r}");
        }
    }

    #[test]
    fn what_cannot_be_solved_is_refused() {
        let n = [8, 8];
        let good = samples(n, |_, _| [0.0, 1.0]);
        let with = |change: &dyn Fn(&mut StreamSample)| {
            let mut samples = good.clone();
            samples.iter_mut().flatten().for_each(change);
            fit_by_differences(&samples, DOMAIN, n, Solver::ConjugateGradient).unwrap_err()
        };
        assert!(matches!(with(&|s| s.weight = 0.0), FieldError::Trivial(_)));
        assert!(matches!(with(&|s| s.density = 0.0), FieldError::Trivial(_)));
        assert!(matches!(with(&|s| s.along[0] = f64::NAN), FieldError::Invalid(_)));
        let none = vec![None; 64];
        let error = fit_by_differences(&none, DOMAIN, n, Solver::Cholesky).unwrap_err();
        assert!(matches!(error, FieldError::Trivial(_)), "{error}");
        assert!(fit_by_differences(&good, DOMAIN, [8, 9], Solver::Cholesky).is_err());
        for solver in [Solver::Qr, Solver::MinimumNorm] {
            let error = fit_by_differences(&good, DOMAIN, n, solver).unwrap_err();
            assert!(error.to_string().contains("cholesky, cg or gmres"), "{error}");
        }
    }
}
