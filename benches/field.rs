//! Stream functions on one thread: B-spline fits of 200 × 200 samples to 40 × 40 coefficients by each
//! solver, differences, and Poisson's equation on 500 × 500 cells, flat and on a wave.

use divan::Bencher;
use millstream::field::{Solver, StreamSample, fit_by_differences, fit_stream_function, solve_poisson};
use millstream::geometry::KnotVector;

fn main() {
    divan::main();
}

/// Samples of a winding field at the centres of `n` × `n` cells of the unit square.
fn samples(n: usize) -> Vec<StreamSample> {
    (0..n * n)
        .map(|k| {
            let (u, v) = (((k % n) as f64 + 0.5) / n as f64, ((k / n) as f64 + 0.5) / n as f64);
            let (s, c) = (0.3 * (3.0 * u).sin() + 0.5 * v).sin_cos();
            let density = 1.0 + 0.3 * (2.0 * u + v).cos();
            StreamSample { u, v, along: [c, s], across: [-s, c], density, weight: 0.02 + u * u }
        })
        .collect()
}

fn fit(bencher: Bencher, side: usize, controls: usize, solver: Solver) {
    let samples = samples(side);
    let knots = KnotVector::clamped_uniform(3, controls, [0.0, 1.0]).expect("enough control points");
    bencher.bench_local(|| fit_stream_function(&samples, knots.clone(), knots.clone(), solver));
}

#[divan::bench(args = ["cholesky", "cg", "gmres"], sample_count = 20)]
fn fit_200_samples_40_controls(bencher: Bencher, solver: &str) {
    fit(bencher, 200, 40, Solver::from_word(solver).expect("a solver"));
}

#[divan::bench(sample_count = 3)]
fn fit_200_samples_40_controls_qr(bencher: Bencher) {
    fit(bencher, 200, 40, Solver::Qr);
}

/// The nets that the dense solver takes.
#[divan::bench(args = ["cholesky", "qr", "minimum-norm"], sample_count = 3)]
fn fit_72_samples_24_controls(bencher: Bencher, solver: &str) {
    fit(bencher, 72, 24, Solver::from_word(solver).expect("a solver"));
}

#[divan::bench(args = [72, 200, 500], sample_count = 10)]
fn differences(bencher: Bencher, cells: usize) {
    let samples: Vec<_> = samples(cells).into_iter().map(Some).collect();
    bencher
        .bench_local(|| fit_by_differences(&samples, [[0.0, 1.0]; 2], [cells; 2], Solver::ConjugateGradient));
}

/// On a flat (cosine transform) and on a wave with slopes up to 50° (multigrid).
#[divan::bench(args = ["flat", "wave"], sample_count = 10)]
fn poisson_500(bencher: Bencher, surface: &str) {
    const N: usize = 500;
    let slope = if surface == "wave" { 1.2 } else { 0.0 };
    let at = |k: usize| ((k % (N + 1)) as f64 / N as f64, (k / (N + 1)) as f64 / N as f64);
    let nodes = (N + 1) * (N + 1);
    let metric: Vec<_> = (0..nodes)
        .map(|k| {
            let (u, v) = at(k);
            let (zu, zv) = (slope * (6.0 * u).cos(), slope * (5.0 * v).sin());
            (1.0 + zu * zu, zu * zv, 1.0 + zv * zv)
        })
        .collect();
    let vectors: Vec<_> = (0..nodes)
        .map(|k| {
            let (u, v) = at(k);
            [(3.0 * v).sin() + 1.0, (2.0 * u).cos()]
        })
        .collect();
    bencher.bench_local(|| solve_poisson([[0.0, 1.0]; 2], [N; 2], &metric, &vectors));
}
