//! Stream functions: B-spline fits of 200 × 200 samples to 40 × 40 coefficients by each solver, differences, and
//! Poisson's equation on 500 × 500 cells, flat and on a wave, on one thread; directions, ψ and all passes on a mesh of
//! 500,000 triangles on every thread that `RAYON_NUM_THREADS` allows.

use divan::Bencher;
use millstream::field::mesh::{
    FieldMesh, Held, MeshLevels, flows, orient_lines, slope, smooth_lines, solve_stream,
};
use millstream::field::{DIRECTION_WEIGHT, Solver, StreamSample, fit_by_differences, fit_stream_function};
use millstream::geometry::{KnotVector, Point3};

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
            StreamSample {
                u,
                v,
                along: [c, s],
                across: [-s, c],
                density,
                weight: 0.02 + u * u,
                direction: DIRECTION_WEIGHT,
            }
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

/// A wave of 2 × 500² triangles: the smooth field of lines up its slope, ψ, 250 levels.
#[divan::bench(sample_count = 3)]
fn mesh_500_000(bencher: Bencher) {
    const N: u32 = 500;
    let point = |i: u32| {
        let (x, y) = (f64::from(i % (N + 1)) / 5.0, f64::from(i / (N + 1)) / 5.0);
        Point3::new(x, y, 4.0 * (0.2 * x).sin() * (0.15 * y).cos())
    };
    let points = (0..(N + 1) * (N + 1)).map(point).collect();
    let corners = (0..N * N).map(|q| (q / N) * (N + 1) + q % N);
    let triangles = corners.flat_map(|a| [[a, a + 1, a + N + 2], [a, a + N + 2, a + N + 1]]).collect();
    let mesh = FieldMesh::new(points, triangles, None).expect("a height field is a mesh");
    bencher.bench_local(|| {
        let mut lines = smooth_lines(&mesh, &slope(&mesh, true), &[], 3.0).expect("the mesh slopes");
        orient_lines(&mesh, &mut lines);
        let count = mesh.points().len();
        let flows = flows(&mesh, &lines, &vec![2.5; count], &vec![1.0; count]);
        let psi = solve_stream(&mesh, &flows, DIRECTION_WEIGHT, &Held::default())
            .expect("lines determine it")
            .values;
        let levels = MeshLevels::new(&mesh, &psi).expect("a value for each vertex");
        let [lo, hi] = levels.range();
        (0..250).map(|k| levels.curves(lo + (hi - lo) * (f64::from(k) + 0.5) / 250.0).len()).sum::<usize>()
    });
}
