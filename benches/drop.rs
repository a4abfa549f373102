//! Drops on one thread: at scattered places onto a wavy mesh of 100,000 triangles, along passes, and
//! onto a wavy patch. The table gives places per second.

use divan::Bencher;
use divan::counter::ItemsCount;
use millstream::cutter::Cutter;
use millstream::drop_cutter::{DropCutter, PlanGrid};
use millstream::geometry::{AnalyticShape, AnalyticSurface};
use millstream::part::{Part, Patch, default_tessellation_tolerance};

#[path = "common/mesh.rs"]
mod mesh;
use mesh::{SIZE, along_passes, cutter as named, scattered, wavy};

fn main() {
    divan::main();
}

/// Places dropped at in one run.
const PLACES: u64 = 20_000;

/// A patch with waves that every cutter here fits into.
fn patch() -> Part {
    let shape = AnalyticShape::Wave { amplitude: 2.0, wavelength_x: 40.0, wavelength_y: Some(60.0) };
    let surface = AnalyticSurface::new(shape, [[0.0, SIZE]; 2]).expect("a smooth wave");
    let patches = vec![Patch::Analytic(surface)];
    let tolerance = default_tessellation_tolerance(&patches);
    Part::from_patches(patches, tolerance).expect("a smooth patch")
}

fn run(bencher: Bencher, part: &Part, cutter: &Cutter, places: &[[f64; 2]]) {
    let drops = DropCutter::new(part, cutter);
    bencher
        .counter(ItemsCount::new(places.len()))
        .bench_local(|| places.iter().filter_map(|&[x, y]| drops.at(x, y)).map(|d| d.tip_z).sum::<f64>());
}

#[divan::bench(args = ["ball", "flat", "bull", "taper"], sample_count = 10)]
fn mesh_scattered(bencher: Bencher, cutter: &str) {
    run(bencher, &wavy(), &named(cutter), &scattered(PLACES));
}

#[divan::bench(args = ["ball", "flat", "bull", "taper"], sample_count = 10)]
fn mesh_along_passes(bencher: Bencher, cutter: &str) {
    run(bencher, &wavy(), &named(cutter), &along_passes(PLACES));
}

/// A million points.
#[divan::bench(args = ["ball", "flat", "bull", "taper"], sample_count = 5)]
fn mesh_grid(bencher: Bencher, cutter: &str) {
    /// Points a side.
    const SIDE: usize = 1000;
    let part = wavy();
    let drops = DropCutter::new(&part, &named(cutter));
    let step = SIZE / SIDE as f64;
    let grid = PlanGrid::new([0.5 * step; 2], [step; 2], [SIDE; 2]).expect("a grid");
    bencher.counter(ItemsCount::new(SIDE * SIDE)).bench_local(|| drops.over_grid(&grid));
}

/// The preparation, in triangles.
#[divan::bench(args = ["ball", "flat", "bull", "taper"], sample_count = 5)]
fn mesh_prepare(bencher: Bencher, cutter: &str) {
    let (part, cutter) = (wavy(), named(cutter));
    bencher
        .counter(ItemsCount::new(part.mesh().triangles().len()))
        .bench_local(|| DropCutter::new(&part, &cutter));
}

#[divan::bench(args = ["ball", "flat", "bull", "taper"], sample_count = 10)]
fn patch_along_passes(bencher: Bencher, cutter: &str) {
    run(bencher, &patch(), &named(cutter), &along_passes(PLACES));
}
