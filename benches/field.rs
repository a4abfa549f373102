//! Stream functions: B-spline fits of 200 × 200 samples to 40 × 40 coefficients by each solver, differences,
//! and Poisson's equation on 500 × 500 cells, flat and on a wave, on one thread; directions, ψ and all passes
//! on a mesh of 500,000 triangles on every thread that `RAYON_NUM_THREADS` allows; and whole plans, from the
//! part to the joined path, by a field of 500 × 500 nodes and on such a mesh:
//! `cargo bench --bench field planned`.

use divan::Bencher;
use millstream::cutter::Cutter;
use millstream::field::mesh::{
    FieldMesh, Held, MeshLevels, flows, orient_lines, slope, smooth_lines, solve_stream,
};
use millstream::field::{DIRECTION_WEIGHT, Solver, StreamSample, fit_by_differences, fit_stream_function};
use millstream::geometry::{AnalyticShape, AnalyticSurface, KnotVector, Point3, TriangleMesh};
use millstream::monitor::Silent;
use millstream::part::{Part, Patch, default_tessellation_tolerance};
use millstream::toolpath::{FeedDirection, PlanSettings, StreamMethod, Streamline, plan};

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

/// A wave of 100 × 100 mm in 2 × 500² triangles.
fn wave_mesh() -> (Vec<Point3>, Vec<[u32; 3]>) {
    const N: u32 = 500;
    let point = |i: u32| {
        let (x, y) = (f64::from(i % (N + 1)) / 5.0, f64::from(i / (N + 1)) / 5.0);
        Point3::new(x, y, 4.0 * (0.2 * x).sin() * (0.15 * y).cos())
    };
    let points = (0..(N + 1) * (N + 1)).map(point).collect();
    let corners = (0..N * N).map(|q| (q / N) * (N + 1) + q % N);
    (points, corners.flat_map(|a| [[a, a + 1, a + N + 2], [a, a + N + 2, a + N + 1]]).collect())
}

/// The moves of a plan along a fixed direction, all but the fit by default.
fn planned(bencher: Bencher, part: &Part, method: StreamMethod, control_points: usize) {
    let cutter = Cutter::ball(8.0).expect("a ball");
    let along = Streamline::along(FeedDirection::Angle(0.5));
    let strategy = Streamline { method, control_points, ..along };
    let settings = PlanSettings { stock_top: part.bounds().max.z + 1.0, ..PlanSettings::default() };
    bencher
        .bench_local(|| plan(part, &cutter, &strategy, &settings, &Silent).expect("a plan").path.moves.len());
}

/// 501 × 501 places of the feed direction: three for each of 167 control points and side.
#[divan::bench(sample_count = 3)]
fn planned_500_nodes(bencher: Bencher) {
    let shape = AnalyticShape::Wave { amplitude: 4.0, wavelength_x: 31.0, wavelength_y: Some(42.0) };
    let wave = AnalyticSurface::new(shape, [[0.0, 100.0]; 2]).expect("a smooth wave");
    let patches = vec![Patch::Analytic(wave)];
    let tolerance = default_tessellation_tolerance(&patches);
    let part = Part::from_patches(patches, tolerance).expect("a smooth patch");
    planned(bencher, &part, StreamMethod::Differences, 167);
}

#[divan::bench(sample_count = 3)]
fn planned_500_000_triangles(bencher: Bencher) {
    let (points, triangles) = wave_mesh();
    let part = Part::from_mesh(TriangleMesh::new(points, triangles).expect("a height field is a mesh").0);
    planned(bencher, &part, StreamMethod::Elements, 24);
}

/// A wave of 2 × 500² triangles: the smooth field of lines up its slope, ψ, 250 levels.
#[divan::bench(sample_count = 3)]
fn mesh_500_000(bencher: Bencher) {
    let (points, triangles) = wave_mesh();
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
