//! Voxels against closed forms, brute force, and the engines for upright tools.

mod heights;
mod kept_out;
mod mesh;
mod removal;
mod standing;
mod volume;

use super::bricks::{BRICK, STEPS};
use super::*;
use crate::scenes::{Rng, cutters, path_through, random_path, wave_path};
use crate::solid::tests::SweptSolid;
use crate::{BarAxis, NOT_CUT, Stock, ZMap};
use cutter::{Cutter, Solid};
use geometry::{Aabb, Point3, Vector3};
use motion::{ClPoint, Move, MoveKind, Toolpath};
use std::f64::consts::PI;
use std::sync::atomic::{AtomicU64, Ordering};
use work::monitor::{Cancelled, Monitor, Silent};

/// More than any test takes.
const MEMORY: u64 = 1 << 30;

fn block(min: [f64; 3], max: [f64; 3]) -> Stock {
    Stock::Box(Aabb { min: min.into(), max: max.into() })
}

fn ball() -> Solid {
    Solid::of_cutter(&Cutter::ball(6.0).unwrap(), None)
}

fn through(locations: &[ClPoint]) -> Toolpath {
    let moves = locations[1..].iter().map(|&to| Move { to, kind: MoveKind::Cut, feed_rate: 1.0, pass: 0 });
    Toolpath::new(locations[0], moves.collect())
}

fn axis(rng: &mut Rng, widest: f64) -> Vector3 {
    let (lean, around) = (rng.within(0.0, widest), rng.within(0.0, std::f64::consts::TAU));
    Vector3::new(lean.sin() * around.cos(), lean.sin() * around.sin(), lean.cos())
}

/// Moves through a cube of 10 mm: short and long ones, turns small and large, on the spot, plunges, none.
fn five_axis_path(rng: &mut Rng, moves: usize) -> Toolpath {
    let place = |rng: &mut Rng| Point3::from([0, 1, 2].map(|_| rng.within(0.0, 10.0)));
    let mut at = ClPoint { tip: place(rng), axis: axis(rng, 1.0) };
    let mut all = vec![at];
    for k in 0..moves {
        let near = Vector3::new(rng.within(-1.0, 1.0), rng.within(-1.0, 1.0), rng.within(-0.3, 0.3));
        let slightly = (at.axis + axis(rng, 3.0) * 0.05).normalize();
        at = match k % 7 {
            0 => ClPoint { tip: at.tip + near, axis: slightly },
            1 => ClPoint { tip: place(rng), axis: at.axis },
            2 => ClPoint { tip: at.tip, axis: axis(rng, 1.2) },
            3 => at,
            4 => ClPoint { tip: at.tip - at.axis * rng.within(-2.0, 2.0), ..at },
            5 => ClPoint { tip: place(rng), axis: axis(rng, 1.2) },
            _ => ClPoint { tip: at.tip + near * 0.1, axis: slightly },
        };
        all.push(at);
    }
    through(&all)
}

impl Voxels {
    /// The highest place of the material at `(x, y)` by trilinear interpolation, mm; `None` where there is
    /// none.
    fn height(&self, x: f64, y: f64) -> Option<f64> {
        let lattice = &self.bricks.lattice;
        let at = [(x - lattice.origin.x) / lattice.pitch, (y - lattice.origin.y) / lattice.pitch];
        if !at.iter().zip(&lattice.size).all(|(at, n)| *at >= 0.0 && *at < f64::from(n - 1)) {
            return None;
        }
        let low = at.map(f64::floor);
        let share = [at[0] - low[0], at[1] - low[1]];
        let column = |k: usize| [low[0] as u32 + (k as u32 & 1), low[1] as u32 + (k as u32 >> 1)];
        let layer = |z: u32| -> Option<f64> {
            let mut mean = 0.0;
            for k in 0..4 {
                let [i, j] = column(k);
                let weight = |axis: usize| if k >> axis & 1 == 1 { share[axis] } else { 1.0 - share[axis] };
                mean += weight(0) * weight(1) * self.sample([i, j, z])?.distance;
            }
            Some(mean)
        };
        let mut above: Option<f64> = None;
        let mut z = lattice.size[2];
        while z > 0 {
            z -= 1;
            let bricks = || (0..4).any(|k| self.bricks.holding([column(k)[0], column(k)[1], z]).is_some());
            if z % BRICK == BRICK - 1 && !bricks() {
                // Nothing passes in all of them.
                above = None;
                z -= BRICK - 1;
                continue;
            }
            let here = layer(z);
            if let (Some(above), Some(here)) = (above, here)
                && here < 0.0
                && above >= 0.0
            {
                return Some(lattice.origin.z + lattice.pitch * (f64::from(z) + here / (here - above)));
            }
            above = here;
        }
        None
    }
}

/// Every sample against the least of all moves.
fn against_brute_force(stock: &Stock, solid: &Solid, path: &Toolpath, voxel: f64, name: &str) {
    let engine = VoxelEngine::new(stock, solid, path).unwrap();
    let voxels = engine.cut(voxel, MEMORY, &Silent).unwrap();
    let band = voxels.bricks.lattice.band();
    let swept: Vec<SweptSolid<'_>> = (0..path.len())
        .map(|k| SweptSolid::new(solid, &path.location_before(k), &path.moves[k].to).unwrap())
        .collect();
    let [nx, ny, nz] = voxels.bricks.lattice.size;
    for at in (0..nx * ny * nz).map(|k| [k % nx, k / nx % ny, k / nx / ny]) {
        let q = voxels.bricks.lattice.place(at);
        let mut nearest: Option<(f64, u32)> = None;
        for (k, s) in swept.iter().enumerate() {
            if let Some(found) = s.below(&q, nearest.map_or(f64::INFINITY, |n| n.0)) {
                nearest = Some((found.distance, k as u32));
            }
        }
        let (from_stock, w) = (stock.foot(&q).0, nearest.map_or(f64::INFINITY, |n| n.0));
        let exact = from_stock.max(-w);
        let tolerance = 1.1e-5 + voxel / STEPS;
        let Some(sample) = voxels.sample(at) else {
            assert!(exact.abs() > voxel, "{name}: {exact} at {q} is not kept");
            continue;
        };
        let clamped = exact.clamp(-band, band);
        assert!((sample.distance - clamped).abs() < tolerance, "{name}: {sample:?} {exact} at {q}");
        if clamped.abs() < band - tolerance && (from_stock + w).abs() > tolerance {
            let by = sample.cut_by;
            assert_eq!(by == NOT_CUT, from_stock > -w, "{name}: {sample:?} {exact} at {q}");
            if by != NOT_CUT {
                let of_it = swept[by as usize].distance(&q).distance;
                assert!((of_it - w).abs() < 2.0 * tolerance, "{name}: {of_it} {w}");
            }
        }
    }
}

#[test]
fn distances_are_those_of_brute_force() {
    let mut rng = Rng::new(3);
    for (c, cutter) in cutters().iter().enumerate() {
        let solid = Solid::of_cutter(cutter, None);
        let stock = match c % 3 {
            0 => block([1.0, 0.0, 1.0], [9.0, 9.5, 8.0]),
            1 => Stock::Cylinder {
                base: Point3::new(0.5, 5.0, 5.0),
                axis: BarAxis::X,
                radius: 4.0,
                length: 9.0,
            },
            _ => octahedron(Point3::new(5.0, 5.0, 5.0), 6.0),
        };
        let path = five_axis_path(&mut rng, 15);
        against_brute_force(&stock, &solid, &path, 0.37, &format!("five axes, cutter {c}"));
        let path = random_path(&mut rng, 15, 9.0);
        against_brute_force(&stock, &solid, &path, 0.41, &format!("upright, cutter {c}"));
    }
}

#[test]
fn a_tool_with_its_holder_cuts_as_one() {
    use cutter::{Holder, HolderSection};
    let mut rng = Rng::new(9);
    let sections = vec![
        HolderSection { diameter: 2.0, top_diameter: 2.0, length: 2.0 },
        HolderSection { diameter: 5.0, top_diameter: 8.0, length: 3.0 },
    ];
    let holder = Holder::new(4.0, sections).unwrap();
    let solid = Solid::of_tool(&Cutter::ball(3.0).unwrap(), &holder);
    let stock = block([0.0; 3], [9.0; 3]);
    let path = five_axis_path(&mut rng, 7);
    let engine = VoxelEngine::new(&stock, &solid, &path).unwrap();
    let voxels = engine.cut(0.4, MEMORY, &Silent).unwrap();
    let swept: Vec<SweptSolid<'_>> = (0..path.len())
        .map(|k| SweptSolid::new(&solid, &path.location_before(k), &path.moves[k].to).unwrap())
        .collect();
    let [nx, ny, nz] = voxels.bricks.lattice.size;
    for at in (0..nx * ny * nz).map(|k| [k % nx, k / nx % ny, k / nx / ny]) {
        let q = voxels.bricks.lattice.place(at);
        let w = swept.iter().map(|s| s.distance(&q).distance).fold(f64::INFINITY, f64::min);
        let exact = stock.foot(&q).0.max(-w);
        // Inside of several pieces only the sign is promised.
        match voxels.sample(at) {
            None => assert!(exact.abs() > 0.4),
            Some(s) if w < 0.0 => assert!(s.distance > -1e-4, "{s:?} {exact}"),
            Some(s) => assert!((s.distance - exact.clamp(-0.8, 0.8)).abs() < 1e-4, "{s:?} {exact}"),
        }
    }
}

/// An octahedron of the given size.
fn octahedron(middle: Point3, size: f64) -> Stock {
    let corner = |k: usize| {
        let mut at = middle;
        at[k / 2] += if k.is_multiple_of(2) { size } else { -size };
        at
    };
    let mut triangles = Vec::new();
    for x in [0, 1] {
        for (y, z) in [(2, 4), (4, 3), (3, 5), (5, 2)] {
            triangles.push(if x == 0 { [x, y, z] } else { [x, z, y] });
        }
    }
    let (mesh, _) = geometry::TriangleMesh::new((0..6).map(corner).collect(), triangles).unwrap();
    Stock::from_mesh(mesh).unwrap()
}

#[test]
fn stock_is_as_large_as_it_should_be() {
    let nowhere = path_through([Point3::new(0.0, 0.0, 900.0)]);
    let solid = ball();
    let shapes = [
        (block([-1.0, 2.0, 3.0], [9.0, 8.0, 7.3]), 10.0 * 6.0 * 4.3),
        (octahedron(Point3::new(1.0, 2.0, 3.0), 5.0), 4.0 / 3.0 * 125.0),
    ];
    let bars = [BarAxis::X, BarAxis::Y, BarAxis::Z].map(|axis| Stock::Cylinder {
        base: Point3::new(1.0, 2.0, 3.0),
        axis,
        radius: 4.0,
        length: 7.0,
    });
    for (stock, exact) in shapes.into_iter().chain(bars.map(|bar| (bar, PI * 16.0 * 7.0))) {
        assert!((stock.volume().unwrap() - exact).abs() < 1e-9 * exact);
        let engine = VoxelEngine::new(&stock, &solid, &nowhere).unwrap();
        let VoxelVolumes { left, removed } = engine.volumes(0.2, &Silent).unwrap();
        let hair = 1e-9 * exact;
        assert!(removed[1] < hair && (left[0] - exact).abs() < hair, "{stock:?}: {left:?} {exact}");
    }
    assert!(VoxelEngine::new(&block([0.0; 3], [1.0, 1.0, 0.0]), &solid, &nowhere).is_err());
}

#[test]
fn a_roughed_block_ends_where_it_was_roughed() {
    // A slope 5 mm high over 10, roughed to 0.7; at the back the block's own top cuts it off.
    let corners = [[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [10.0, 10.0, 5.0], [0.0, 10.0, 5.0]].map(Point3::from);
    let (mesh, _) = geometry::TriangleMesh::new(corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]]).unwrap();
    let around = Aabb { min: Point3::new(0.0, 0.0, -2.0), max: Point3::new(10.0, 10.0, 5.0) };
    let stock = Stock::roughed(around, mesh, 0.7);
    let over = 0.7 * 1.25f64.sqrt();
    let exact = |y: f64| (0.5 * y + over).min(5.0);
    let mut rng = Rng::new(4);
    for _ in 0..200 {
        let q = Point3::from([0, 1, 2].map(|_| rng.within(-3.0, 12.0)));
        let (distance, gradient) = stock.foot(&q);
        let inside = (0..3).all(|i| q[i] > around.min[i] && q[i] < around.max[i]) && q.z < exact(q.y);
        assert!((distance < 0.0) == inside && (gradient.norm() - 1.0).abs() < 1e-9, "{q} {distance}");
    }
    assert_eq!((stock.volume(), stock.bounds()), (None, around));
    let nowhere = path_through([Point3::new(0.0, 0.0, 900.0)]);
    let solid = ball();
    let engine = VoxelEngine::new(&stock, &solid, &nowhere).unwrap();
    let edge = (5.0 - over) / 0.5;
    let volume = 10.0 * (2.0 * 10.0 + 0.25 * edge * edge + over * edge + 5.0 * (10.0 - edge));
    let [low, high] = engine.volumes(0.4, &Silent).unwrap().left;
    assert!(low < volume && volume < high && high - low < 0.1 * volume, "{low} {high} {volume}");
}

/// What a path takes, mm³: the middle between its bounds.
fn removed(solid: &Solid, stock: &Stock, path: &Toolpath, voxel: f64) -> f64 {
    let [low, high] = VoxelEngine::new(stock, solid, path).unwrap().volumes(voxel, &Silent).unwrap().removed;
    0.5 * (low + high)
}

#[test]
fn volumes_of_capsules_spheres_and_swept_cylinders() {
    // A ball in the very middle of the stock, below its shank's begin: half a capsule and the slot above.
    let stock = block([-10.0, -8.0, -6.0], [10.0, 8.0, 0.0]);
    let (r, length) = (3.0, 6.0);
    let at = |x: f64, z: f64| Point3::new(x, 0.3, z);
    let slot = path_through([at(-3.0, -5.0), at(3.0, -5.0)]);
    let level = PI * r * r + 2.0 * r * length;
    let exact = 0.5 * (PI * r * r * length + 4.0 / 3.0 * PI * r.powi(3)) + level * 2.0;
    let got = removed(&ball(), &stock, &slot, 0.1);
    assert!((got - exact).abs() < 1e-3 * exact, "capsule: {got} {exact}");
    // A plunge: half a sphere and the hole above.
    let exact = 2.0 / 3.0 * PI * 27.0 + PI * 9.0 * 2.0;
    let got = removed(&ball(), &stock, &path_through([at(0.0, 9.0), at(0.0, -5.0)]), 0.1);
    assert!((got - exact).abs() < 1e-3 * exact, "plunge: {got} {exact}");
    // A flat end: a slot with round ends.
    let flat = Solid::of_cutter(&Cutter::flat(6.0).unwrap(), None);
    let got = removed(&flat, &stock, &path_through([at(-3.0, -4.05), at(3.0, -4.05)]), 0.1);
    assert!((got - level * 4.05).abs() < 1e-3 * level * 4.05, "slot: {got} {}", level * 4.05);
    // A cylinder that turns about its own tip in the plane x = 0: at x it is a rectangle of half width
    // w = √(r² − x²), whose far corners run on a circle about the middle of its near side.
    let theta = 0.6f64;
    let lean = |a: f64| Vector3::new(0.0, a.sin(), a.cos());
    let tip = Point3::origin();
    let path =
        through(&[ClPoint { tip, axis: lean(-0.5 * theta) }, ClPoint { tip, axis: lean(0.5 * theta) }]);
    let long = flat.heights()[1];
    // Of the disc of radius ρ = √(w² + l²) the turn and the rectangle's own angle, and a triangle each side.
    let area = |w: f64| {
        let far = w * w + long * long;
        0.5 * theta * far + far * (w / long).atan() + w * long
    };
    let steps = 20000;
    let sum: f64 =
        (0..steps).map(|k| area((r * r - ((k as f64 + 0.5) / steps as f64 * r).powi(2)).sqrt())).sum();
    let exact = 2.0 * sum * r / steps as f64;
    let stock = block([-4.0, -25.0, -4.0], [4.0, 25.0, long + 4.0]);
    let got = removed(&flat, &stock, &path, 0.2);
    assert!((got - exact).abs() < 1e-3 * exact, "turning: {got} {exact}");
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let mut rng = Rng::new(23);
    let stock = block([0.0; 3], [7.0; 3]);
    for cutter in cutters() {
        let solid = Solid::of_cutter(&cutter, None);
        let path = five_axis_path(&mut rng, 8);
        let engine = VoxelEngine::new(&stock, &solid, &path).unwrap();
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let voxels = engine.cut(0.2, MEMORY, &Silent).unwrap();
                let surface = engine.surface(&voxels, &Silent).unwrap();
                (
                    engine.volumes(0.5, &Silent).unwrap(),
                    surface,
                    engine.removal(0.4, &Silent).unwrap(),
                    voxels,
                )
            })
        };
        assert!(run(1) == run(5), "{cutter:?}");
    }
}

#[test]
fn memory_is_refused_and_the_voxel_that_is_said_to_fit_fits() {
    let stock = block([0.0; 3], [20.0, 15.0, 6.0]);
    let (solid, path) = (ball(), wave_path(20.0, 2.0, 2.0));
    let engine = VoxelEngine::new(&stock, &solid, &path).unwrap();
    for (voxel, memory) in
        [(0.1, 2 << 20), (0.05, 3 << 20), (0.01, 3 << 20), (1e-4, 4 << 20), (1e-9, 2 << 20)]
    {
        let Err(VoxelError::Memory { fitting, needed_mib, allowed_mib, .. }) =
            engine.cut(voxel, memory, &Silent)
        else {
            panic!("{voxel} in {memory}")
        };
        assert!(needed_mib > allowed_mib && fitting > voxel);
        let voxels = engine.cut(fitting, memory, &Silent).unwrap();
        assert!(voxels.bytes <= memory && voxels.bytes > memory / 6, "{voxel}: {fitting} {}", voxels.bytes);
    }
    assert!(matches!(engine.cut(0.5, 1000, &Silent), Err(VoxelError::Path { .. })));
    assert!(matches!(engine.cut(0.0, MEMORY, &Silent), Err(VoxelError::Voxel(_))));
    assert!(matches!(engine.cut(f64::NAN, MEMORY, &Silent), Err(VoxelError::Voxel(_))));
}

/// Says stop after some questions.
struct Impatient(AtomicU64);

impl Monitor for Impatient {
    fn cancelled(&self) -> bool {
        self.0.fetch_sub(1, Ordering::Relaxed) < 2
    }
}

#[test]
fn work_stops_when_told() {
    let stock = block([0.0; 3], [20.0, 15.0, 6.0]);
    let (solid, path) = (ball(), wave_path(20.0, 2.0, 2.0));
    let engine = VoxelEngine::new(&stock, &solid, &path).unwrap();
    for patience in [1, 3, 6] {
        let impatient = || Impatient(AtomicU64::new(patience));
        assert_eq!(engine.cut(0.1, MEMORY, &impatient()), Err(VoxelError::Cancelled(Cancelled)));
        assert_eq!(engine.volumes(0.1, &impatient()), Err(VoxelError::Cancelled(Cancelled)));
        let removed = engine.removal(0.1, &impatient());
        assert_eq!(removed, Err(VoxelError::Cancelled(Cancelled)));
    }
    let voxels = engine.cut(0.2, MEMORY, &Silent).unwrap();
    assert_eq!(engine.surface(&voxels, &Impatient(AtomicU64::new(1))), Err(Cancelled));
}

#[test]
fn paths_of_nothing_and_far_away_take_nothing() {
    let stock = block([0.0; 3], [8.0, 6.0, 4.0]);
    let solid = ball();
    let still = path_through([Point3::new(4.0, 3.0, 2.0)]);
    let far = path_through([Point3::new(900.0, 0.0, 0.0), Point3::new(1000.0, -700.0, 0.0)]);
    let plain = VoxelEngine::new(&stock, &solid, &still).unwrap().cut(0.2, MEMORY, &Silent).unwrap();
    let engine = VoxelEngine::new(&stock, &solid, &far).unwrap();
    assert!((engine.volumes(0.2, &Silent).unwrap().left[0] - 192.0).abs() < 1e-9);
    assert_eq!(engine.cut(0.2, MEMORY, &Silent).unwrap(), plain);
    assert_eq!(engine.removal(0.2, &Silent).unwrap().volume(), 0.0);
    // A move of no length cuts where the tool stands.
    let spot = path_through([Point3::new(4.0, 3.0, 2.0); 2]);
    let voxels = VoxelEngine::new(&stock, &solid, &spot).unwrap().cut(0.2, MEMORY, &Silent).unwrap();
    assert!((voxels.height(4.0, 3.0).unwrap() - 2.0).abs() < 0.01);
    // All of it.
    let gone = path_through([Point3::new(-20.0, 3.0, -9.0), Point3::new(20.0, 3.0, -9.0)]);
    let wide = Solid::of_cutter(&Cutter::flat(30.0).unwrap(), None);
    let engine = VoxelEngine::new(&stock, &wide, &gone).unwrap();
    let voxels = engine.cut(0.2, MEMORY, &Silent).unwrap();
    assert_eq!(voxels.bricks(), 0);
    assert!(engine.volumes(0.2, &Silent).unwrap().left[1] < 1e-9);
    assert!(engine.surface(&voxels, &Silent).unwrap().triangles.is_empty());
    let removed = engine.removal(0.2, &Silent).unwrap().volume();
    assert!((removed - stock.volume().unwrap()).abs() < 1e-9 * removed);
    let opposite = [Vector3::z(), -Vector3::z()].map(|axis| ClPoint { tip: Point3::origin(), axis });
    assert!(matches!(VoxelEngine::new(&stock, &solid, &through(&opposite)), Err(VoxelError::Axes(_))));
}
