//! Poses of a tool along passes over a wave of a million triangles, each asked for cutter and holder, and the
//! least clearance of a whole path. The table gives poses, or moves, per second.

use divan::Bencher;
use divan::counter::ItemsCount;
use millstream::collision::{Check, Interference, Obstacle};
use millstream::cutter::{Cutter, Holder, HolderSection, Solid};
use millstream::geometry::{Aabb, Bvh, Point3, TriangleMesh, Vector3};
use millstream::monitor::Silent;
use millstream::motion::{CcPoint, ClPoint, Move, MoveKind, Toolpath, location};
use millstream::parallel;
use millstream::sim::{Stock, VoxelEngine, holder_clearance};

fn main() {
    divan::main();
}

/// Quads a side: 2 × 708² triangles.
const QUADS: u32 = 708;
/// Side of the part, mm.
const SIZE: f64 = 100.0;
/// Passes, and poses on each.
const PASSES: usize = 100;
const POSES: usize = 1000;
/// Lean of the axis forward from the normal, rad.
const LEAD: f64 = 0.15;

fn height(x: f64, y: f64) -> f64 {
    4.0 * (0.1 * x).sin() * (0.08 * y).cos()
}

fn normal(x: f64, y: f64) -> Vector3 {
    let (dx, dy) = (0.4 * (0.1 * x).cos() * (0.08 * y).cos(), -0.32 * (0.1 * x).sin() * (0.08 * y).sin());
    Vector3::new(-dx, -dy, 1.0).normalize()
}

fn wave() -> (TriangleMesh, Bvh) {
    let vertex = |i: u32| {
        let at = |k: u32| SIZE * f64::from(k) / f64::from(QUADS);
        let (x, y) = (at(i % (QUADS + 1)), at(i / (QUADS + 1)));
        Point3::new(x, y, height(x, y))
    };
    let vertices = (0..(QUADS + 1) * (QUADS + 1)).map(vertex).collect();
    let quads = (0..QUADS * QUADS).map(|q| (q / QUADS) * (QUADS + 1) + q % QUADS);
    let triangles = quads.flat_map(|a| [[a, a + 1, a + QUADS + 2], [a, a + QUADS + 2, a + QUADS + 1]]);
    let (mesh, _) = TriangleMesh::new(vertices, triangles.collect()).expect("a height field is a mesh");
    let bvh = Bvh::new(&mesh);
    (mesh, bvh)
}

fn holder() -> Holder {
    let section = |diameter, top_diameter, length| HolderSection { diameter, top_diameter, length };
    let sections = vec![section(6.0, 6.0, 20.0), section(16.0, 24.0, 15.0), section(40.0, 40.0, 30.0)];
    Holder::new(10.0, sections).expect("valid dimensions")
}

fn cutter(name: &str) -> Cutter {
    match name {
        "ball" => Cutter::ball(6.0),
        "flat" => Cutter::flat(6.0),
        _ => Cutter::bull(6.0, 1.0),
    }
    .expect("valid dimensions")
}

fn poses(cutter: &Cutter) -> Vec<ClPoint> {
    let pose = |k: usize| {
        let at = |k: usize, n: usize| SIZE * (k as f64 + 0.5) / n as f64;
        let (x, y) = (at(k % POSES, POSES), at(k / POSES, PASSES));
        let normal = normal(x, y);
        let forward = Vector3::new(normal.z, 0.0, -normal.x).normalize();
        let axis = normal * LEAD.cos() + forward * LEAD.sin();
        location(cutter, &CcPoint { point: Point3::new(x, y, height(x, y)), normal }, &axis)
    };
    (0..PASSES * POSES).map(pose).collect()
}

struct Tool {
    edges: Solid,
    held: Solid,
}

fn tool(cutter: &Cutter) -> Tool {
    Tool { edges: Solid::of_cutter(cutter, Some(&holder())), held: Solid::of_holder(&holder()) }
}

/// Whether the cutter stays out by a micrometre and the holder 1 mm away, on all threads.
#[divan::bench(args = ["ball", "flat", "bull"], sample_count = 3)]
fn checked(bencher: Bencher, name: &str) {
    let (mesh, bvh) = wave();
    let cutter = cutter(name);
    let (tool, poses, obstacle) = (tool(&cutter), poses(&cutter), Obstacle::new(&mesh, &bvh));
    let check = |solid, needed| Check { solid, obstacle, needed };
    let checks = vec![check(&tool.edges, -0.001), check(&tool.held, 1.0)];
    let keep = Interference { checks, greatest_tilt: 0.0, greatest_lift: 0.0 };
    bencher.counter(ItemsCount::new(poses.len())).bench_local(|| {
        parallel::map(poses.len(), |k| keep.is_clear(&poses[k])).iter().filter(|&&c| c).count()
    });
}

/// The exact clearance of the cutter and of the holder up to 2 mm, on all threads.
#[divan::bench(args = ["ball", "flat", "bull"], sample_count = 3)]
fn measured(bencher: Bencher, name: &str) {
    let (mesh, bvh) = wave();
    let cutter = cutter(name);
    let (tool, poses, obstacle) = (tool(&cutter), poses(&cutter), Obstacle::new(&mesh, &bvh));
    let least = |solid, at| obstacle.clearance(solid, at, 2.0).map_or(2.0, |c| c.distance);
    bencher.counter(ItemsCount::new(poses.len())).bench_local(|| {
        parallel::map(poses.len(), |k| least(&tool.edges, &poses[k]).min(least(&tool.held, &poses[k])))
    });
}

/// The moves between the poses of a pass, on all threads, for one pass in ten.
#[divan::bench(args = ["ball", "flat", "bull"], sample_count = 3)]
fn moves(bencher: Bencher, name: &str) {
    let (mesh, bvh) = wave();
    let cutter = cutter(name);
    let (tool, poses, obstacle) = (tool(&cutter), poses(&cutter), Obstacle::new(&mesh, &bvh));
    let check = |solid, needed| Check { solid, obstacle, needed };
    let checks = vec![check(&tool.edges, -0.001), check(&tool.held, 1.0)];
    let keep = Interference { checks, greatest_tilt: 0.0, greatest_lift: 0.0 };
    let starts: Vec<usize> =
        (0..poses.len()).filter(|k| (k + 1) % POSES != 0 && (k / POSES).is_multiple_of(10)).collect();
    bencher.counter(ItemsCount::new(starts.len())).bench_local(|| {
        let clear = |&k: &usize| keep.on_move(&poses[k], &poses[k + 1]).is_none();
        parallel::map(starts.len(), |i| clear(&starts[i])).iter().filter(|&&c| c).count()
    });
}

/// A zigzag over the wave through all poses.
fn path(cutter: &Cutter, upright: bool) -> Toolpath {
    let mut poses = poses(cutter);
    for pass in poses.chunks_mut(POSES).skip(1).step_by(2) {
        pass.reverse();
    }
    if upright {
        let stand = |pose: &ClPoint| {
            ClPoint::upright(Point3::new(pose.tip.x, pose.tip.y, height(pose.tip.x, pose.tip.y)))
        };
        poses = poses.iter().map(stand).collect();
    }
    let cut = |&to: &ClPoint| Move { to, kind: MoveKind::Cut, feed_rate: 1000.0, pass: 0 };
    Toolpath::new(poses[0], poses[1..].iter().map(cut).collect())
}

/// The least clearance of the holder from the part on a path of 100,000 moves.
#[divan::bench(args = ["leaning", "upright"], sample_count = 3)]
fn least(bencher: Bencher, how: &str) {
    let (mesh, bvh) = wave();
    let cutter = cutter("ball");
    let (tool, path, obstacle) = (tool(&cutter), path(&cutter, how == "upright"), Obstacle::new(&mesh, &bvh));
    bencher.counter(ItemsCount::new(path.len())).bench_local(|| {
        obstacle.least_clearance(&tool.held, &path, &|_| true, &Silent).expect("nothing stops it")
    });
}

/// The same from the stock that stands when the holder passes: `top` mm over the middle of the wave.
#[divan::bench(args = [10.0, 25.5], sample_count = 3)]
fn standing(bencher: Bencher, top: f64) {
    let cutter = cutter("ball");
    let (path, held) = (path(&cutter, true), holder());
    let block = Aabb { min: Point3::new(0.0, 0.0, -20.0), max: Point3::new(SIZE, SIZE, top) };
    let stock = Stock::Box(block);
    bencher.counter(ItemsCount::new(path.len())).bench_local(|| {
        holder_clearance(&stock, &[], &cutter, &held, &path, &Silent).expect("nothing stops it")
    });
}

/// The same of a tool that leans, whose holder passes over the block by less than a millimetre.
#[divan::bench(sample_count = 3)]
fn standing_leaning(bencher: Bencher) {
    let cutter = cutter("ball");
    let section = |diameter, top_diameter, length| HolderSection { diameter, top_diameter, length };
    let sections = vec![section(5.0, 5.0, 4.0), section(16.0, 24.0, 15.0), section(40.0, 40.0, 30.0)];
    let held = Holder::new(10.0, sections).expect("valid dimensions");
    let path = path(&cutter, false);
    let block = Aabb { min: Point3::new(0.0, 0.0, -20.0), max: Point3::new(SIZE, SIZE, 5.0) };
    let (stock, solid) = (Stock::Box(block), Solid::of_cutter(&cutter, Some(&held)));
    bencher.counter(ItemsCount::new(path.len())).bench_local(|| {
        let engine = VoxelEngine::new(&stock, &solid, &path).expect("moves that can be followed");
        engine.holder_clearance(&[], &cutter, &held, &path, &Silent).expect("nothing stops it")
    });
}
