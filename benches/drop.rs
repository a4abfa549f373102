//! Drops on one thread: at scattered places onto a wavy mesh of 100,000 triangles, along passes, and
//! onto a wavy patch. The table gives places per second.

use divan::Bencher;
use divan::counter::ItemsCount;
use millstream::cutter::Cutter;
use millstream::geometry::{AnalyticShape, AnalyticSurface, Point3, TriangleMesh};
use millstream::part::{Part, Patch, default_tessellation_tolerance};
use millstream::toolpath::{DropCutter, PlanGrid};

fn main() {
    divan::main();
}

/// Quads a side: 2 × 224² triangles.
const QUADS: u32 = 224;
/// Side of the part, mm.
const SIZE: f64 = 100.0;
/// Places dropped at in one run.
const PLACES: u64 = 20_000;

/// A mesh with waves into which a ball of 6 mm fits, just.
fn wavy() -> Part {
    let vertex = |i: u32| {
        let at = |k: u32| SIZE * f64::from(k) / f64::from(QUADS);
        let (x, y) = (at(i % (QUADS + 1)), at(i / (QUADS + 1)));
        Point3::new(x, y, 4.0 * (0.2 * x).sin() * (0.15 * y).cos())
    };
    let vertices = (0..(QUADS + 1) * (QUADS + 1)).map(vertex).collect();
    let quads = (0..QUADS * QUADS).map(|q| (q / QUADS) * (QUADS + 1) + q % QUADS);
    let triangles = quads.flat_map(|a| [[a, a + 1, a + QUADS + 2], [a, a + QUADS + 2, a + QUADS + 1]]);
    let (mesh, _) = TriangleMesh::new(vertices, triangles.collect()).expect("a height field is a mesh");
    Part::from_mesh(mesh)
}

/// Places without order: the golden ratio and its plastic cousin fill the square evenly.
fn scattered() -> Vec<[f64; 2]> {
    let place =
        |k: u64| [0.754_877_666_246_692_8, 0.569_840_290_998_053_2].map(|a| SIZE * (a * k as f64).fract());
    (0..PLACES).map(place).collect()
}

/// Places along passes, as a planner asks for them.
fn along_passes() -> Vec<[f64; 2]> {
    /// Places of one pass.
    const ALONG: u64 = 1000;
    let place = |k: u64| {
        let (along, pass) = ((k % ALONG) as f64 / ALONG as f64, (k / ALONG) as f64 / (PLACES / ALONG) as f64);
        [SIZE * along, SIZE * pass]
    };
    (0..PLACES).map(place).collect()
}

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
    run(bencher, &wavy(), &named(cutter), &scattered());
}

#[divan::bench(args = ["ball", "flat", "bull", "taper"], sample_count = 10)]
fn mesh_along_passes(bencher: Bencher, cutter: &str) {
    run(bencher, &wavy(), &named(cutter), &along_passes());
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
    run(bencher, &patch(), &named(cutter), &along_passes());
}

fn named(cutter: &str) -> Cutter {
    let made = match cutter {
        "ball" => Cutter::ball(6.0),
        "flat" => Cutter::flat(6.0),
        "bull" => Cutter::bull(6.0, 1.0),
        _ => Cutter::taper(3.0, 1.5, 0.2, 8.0),
    };
    made.expect("valid dimensions")
}
