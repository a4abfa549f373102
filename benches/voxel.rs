//! What voxels cost: a wave of 100 × 100 mm in passes 0.3 mm apart with chords of 1 mm (34,000 moves) by a
//! ball of radius 3 mm with upright and with turning axes, and by a bull nose. Voxels of 0.1 mm;
//! `RAYON_NUM_THREADS=1` for one thread. divan prints the rates (items are moves).

use divan::Bencher;
use divan::counter::ItemsCount;
use millstream::cutter::Solid;
use millstream::geometry::{Aabb, Point3, Vector3};
use millstream::monitor::Silent;
use millstream::motion::{ClPoint, Toolpath};
use millstream::sim::{Stock, VoxelEngine};

#[allow(dead_code)]
#[path = "common/wave.rs"]
mod wave;
use wave::{RADIUS, cutter, wave};

/// Both sides of the part.
const PART: [f64; 2] = [0.0, 100.0];
/// Side of a voxel, mm.
const VOXEL: f64 = 0.1;

fn main() {
    divan::main();
}

fn block() -> Stock {
    Stock::Box(Aabb { min: Point3::new(0.0, 0.0, -5.0), max: Point3::new(100.0, 100.0, 3.0) })
}

/// The same path with axes that sway about 20 degrees to all sides, the middle of the ball where it was.
fn swaying(mut path: Toolpath) -> Toolpath {
    let sway = |at: &ClPoint| {
        let (a, b) = (0.35 * (at.tip.x / 9.0).sin(), 0.35 * (at.tip.y / 7.0).cos());
        let axis = Vector3::new(a, b, 1.0).normalize();
        ClPoint { tip: at.tip + (Vector3::z() - axis) * RADIUS, axis }
    };
    path.start = sway(&path.start);
    path.moves.iter_mut().for_each(|m| m.to = sway(&m.to));
    path
}

fn path(axes: &str) -> Toolpath {
    let upright = wave(PART, 0.3, 1.0);
    if axes == "five" { swaying(upright) } else { upright }
}

#[divan::bench(sample_count = 3, args = [("ball", "three"), ("ball", "five"), ("bull", "three"), ("bull", "five")])]
fn cut(bencher: Bencher, (tool, axes): (&str, &str)) {
    let (stock, path) = (block(), path(axes));
    let solid = Solid::of_cutter(&cutter(tool), None);
    bencher.counter(ItemsCount::new(path.len())).bench(|| {
        let engine = VoxelEngine::new(&stock, &solid, &path).expect("no axis turns around");
        engine.cut(VOXEL, u64::MAX, &Silent).expect("never cancelled")
    });
}

#[divan::bench(sample_count = 1)]
fn surface(bencher: Bencher) {
    let (stock, path) = (block(), path("three"));
    let solid = Solid::of_cutter(&cutter("ball"), None);
    let engine = VoxelEngine::new(&stock, &solid, &path).expect("no axis turns around");
    let voxels = engine.cut(VOXEL, u64::MAX, &Silent).expect("never cancelled");
    bencher.bench(|| engine.surface(&voxels, &Silent).expect("never cancelled"));
}

#[divan::bench(sample_count = 1)]
fn volume(bencher: Bencher) {
    let (stock, path) = (block(), path("three"));
    let solid = Solid::of_cutter(&cutter("ball"), None);
    let engine = VoxelEngine::new(&stock, &solid, &path).expect("no axis turns around");
    bencher.bench(|| engine.volumes(VOXEL, &Silent).expect("never cancelled"));
}

#[divan::bench(sample_count = 1)]
fn removal(bencher: Bencher) {
    let (stock, path) = (block(), path("three"));
    let solid = Solid::of_cutter(&cutter("ball"), None);
    let engine = VoxelEngine::new(&stock, &solid, &path).expect("no axis turns around");
    bencher.bench(|| engine.removal(VOXEL, &Silent).expect("never cancelled"));
}
