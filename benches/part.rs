//! Cost of evaluating and searching a part, on one thread unless rayon is told otherwise:
//! `cargo bench --bench part`. Times are shown, never asserted.

use divan::{Bencher, black_box};
use millstream::geometry::{AnalyticShape, AnalyticSurface, NurbsSurface, Point2, Point3};
use millstream::io::nurbs_json;
use millstream::monitor::Silent;
use millstream::part::{Part, Patch, default_tessellation_tolerance};

/// Cells a side of the sampled grid: four million in all.
const CELLS: usize = 2000;

fn main() {
    divan::main();
}

fn ridge() -> NurbsSurface {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/ridge.json");
    nurbs_json::read(path.as_ref()).expect("the scene is part of the project").remove(0)
}

fn part_of(patch: Patch) -> Part {
    let patches = vec![patch];
    let tolerance = default_tessellation_tolerance(&patches);
    Part::from_patches(patches, tolerance).expect("a smooth patch")
}

fn wave() -> Patch {
    let shape = AnalyticShape::Wave { amplitude: 1.0, wavelength_x: 13.0, wavelength_y: Some(21.0) };
    Patch::Analytic(AnalyticSurface::new(shape, [[0.0, 60.0], [0.0, 60.0]]).expect("a smooth wave"))
}

fn sample(part: &Part) -> usize {
    let cell = 60.0 / CELLS as f64;
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
    let origin = Point2::new(0.5 * cell, 0.5 * cell);
    let grid = one_thread.install(|| part.sample_grid(origin, cell, CELLS, CELLS, &Silent));
    grid.expect("nobody cancels").samples.iter().filter(|s| s.is_on()).count()
}

/// Places spread over the unit square (golden section).
fn place(k: usize) -> (f64, f64) {
    ((k as f64 * 0.754_877_666).fract(), (k as f64 * 0.569_840_291).fract())
}

#[divan::bench]
fn bicubic_jet(bencher: Bencher) {
    let surface = ridge();
    let mut k = 0;
    bencher.bench_local(|| {
        k += 1;
        let (u, v) = place(k);
        surface.jet(black_box(u), black_box(v))
    });
}

#[divan::bench]
fn closest_point(bencher: Bencher) {
    let part = part_of(Patch::Nurbs(ridge()));
    let mut k = 0;
    bencher.bench_local(|| {
        k += 1;
        let (u, v) = place(k);
        part.closest_point(black_box(&Point3::new(60.0 * u, 60.0 * v, 2.0)))
    });
}

#[divan::bench]
fn highest_at(bencher: Bencher) {
    let part = part_of(Patch::Nurbs(ridge()));
    let mut k = 0;
    bencher.bench_local(|| {
        k += 1;
        let (u, v) = place(k);
        part.highest_at(black_box(60.0 * u), black_box(60.0 * v))
    });
}

#[divan::bench(sample_count = 5)]
fn build_ridge() -> Part {
    part_of(Patch::Nurbs(ridge()))
}

#[divan::bench(sample_count = 3)]
fn sample_ridge_4m_cells(bencher: Bencher) {
    let part = part_of(Patch::Nurbs(ridge()));
    bencher.bench_local(|| sample(&part));
}

#[divan::bench(sample_count = 3)]
fn sample_wave_4m_cells(bencher: Bencher) {
    let part = part_of(wave());
    bencher.bench_local(|| sample(&part));
}
