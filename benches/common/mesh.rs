//! A wavy mesh of 100,000 triangles and places above it, for the benchmarks of drops. mm.

use millstream::cutter::Cutter;
use millstream::geometry::{Point3, TriangleMesh};
use millstream::part::Part;

/// Quads a side: 2 × 224² triangles.
const QUADS: u32 = 224;
/// Side of the part, mm.
pub const SIZE: f64 = 100.0;

/// A mesh with waves into which a ball of 6 mm fits, just.
pub fn wavy() -> Part {
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
pub fn scattered(places: u64) -> Vec<[f64; 2]> {
    let place =
        |k: u64| [0.754_877_666_246_692_8, 0.569_840_290_998_053_2].map(|a| SIZE * (a * k as f64).fract());
    (0..places).map(place).collect()
}

/// Places along passes, as a planner asks for them.
pub fn along_passes(places: u64) -> Vec<[f64; 2]> {
    /// Places of one pass.
    const ALONG: u64 = 1000;
    let place = |k: u64| {
        let (along, pass) = ((k % ALONG) as f64 / ALONG as f64, (k / ALONG) as f64 / (places / ALONG) as f64);
        [SIZE * along, SIZE * pass]
    };
    (0..places).map(place).collect()
}

/// One cutter of each family.
pub fn cutter(name: &str) -> Cutter {
    let made = match name {
        "ball" => Cutter::ball(6.0),
        "flat" => Cutter::flat(6.0),
        "bull" => Cutter::bull(6.0, 1.0),
        _ => Cutter::taper(3.0, 1.5, 0.2, 8.0),
    };
    made.expect("valid dimensions")
}
