//! Drops at scattered places onto a wavy mesh of 100,000 triangles, on one thread. The table gives
//! places per second.

use divan::Bencher;
use divan::counter::ItemsCount;
use millstream::cutter::Cutter;
use millstream::geometry::{Point3, TriangleMesh};
use millstream::part::Part;
use millstream::toolpath::DropCutter;

fn main() {
    divan::main();
}

/// Quads a side: 2 × 224² triangles.
const QUADS: u32 = 224;
/// Side of the part, mm.
const SIZE: f64 = 100.0;
/// Places dropped at in one run.
const PLACES: u64 = 20_000;

fn wavy() -> Part {
    let vertex = |i: u32| {
        let at = |k: u32| SIZE * f64::from(k) / f64::from(QUADS);
        let (x, y) = (at(i % (QUADS + 1)), at(i / (QUADS + 1)));
        Point3::new(x, y, 4.0 * (0.2 * x).sin() * (0.15 * y).cos() + (0.5 * x + 0.3 * y).sin())
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

fn drop_everywhere(bencher: Bencher, cutter: Cutter) {
    let part = wavy();
    let drops = DropCutter::new(&part, &cutter);
    let places = scattered();
    bencher
        .counter(ItemsCount::new(PLACES))
        .bench_local(|| places.iter().filter_map(|&[x, y]| drops.at(x, y)).map(|d| d.tip_z).sum::<f64>());
}

#[divan::bench(sample_count = 10)]
fn ball(bencher: Bencher) {
    drop_everywhere(bencher, Cutter::ball(6.0).expect("valid"));
}

#[divan::bench(sample_count = 10)]
fn flat(bencher: Bencher) {
    drop_everywhere(bencher, Cutter::flat(6.0).expect("valid"));
}

#[divan::bench(sample_count = 10)]
fn bull(bencher: Bencher) {
    drop_everywhere(bencher, Cutter::bull(6.0, 1.0).expect("valid"));
}

#[divan::bench(sample_count = 10)]
fn taper(bencher: Bencher) {
    drop_everywhere(bencher, Cutter::taper(3.0, 1.5, 0.2, 8.0).expect("valid"));
}
