//! The engine against the reference. What every engine must keep is
//! tested in `engine_tests`.

use super::*;
use crate::cut_reference;
use crate::scenes::{Rng, cutters, path_through, random_path, square_grid, wave_path};
use geometry::{Point2, Point3};
use work::monitor::Silent;

/// What the engine promises against the reference, mm.
const PROMISED: f32 = 1e-5;

/// Raised by a micrometre the bound drops moves that are needed.
#[test]
fn a_bound_tightened_by_a_micrometre_is_wrong() {
    // Short moves: lists of a few go down without tests. Small cells: in large leaves the bound is wide.
    let path = wave_path(2.0, 0.3, 0.05);
    let stock = ZMap::block(square_grid(2.0, 0.005), 5.0);
    for cutter in cutters().into_iter().take(6) {
        compare(&stock, &cutter, &path);
        let exact = cut_reference(&stock, &cutter, &path, &Silent).unwrap();
        let with = |margin: f64| {
            let job = UnorderedCut { form: Form::new(&cutter), path: &path, side: 64, bounded: true, margin };
            farthest(&job.run(stock.clone(), &Silent).unwrap().0, &exact)
        };
        assert!(with(0.0) <= PROMISED, "{cutter:?} {}", with(0.0));
        assert!(with(1e-3) > 10.0 * PROMISED, "{cutter:?} {}", with(1e-3));
    }
}

fn farthest(a: &ZMap, b: &ZMap) -> f32 {
    a.height.iter().zip(&b.height).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

/// The engine cuts what the reference cuts, and names a move that does.
fn compare(stock: &ZMap, cutter: &Cutter, path: &Toolpath) {
    let expected = cut_reference(stock, cutter, path, &Silent).unwrap();
    let got = cut(stock.clone(), cutter, path, &Silent).unwrap();
    let envelope = crate::Envelope::new(cutter, path);
    for k in 0..got.height.len() {
        let (height, by) = (got.height[k], got.cut_by[k]);
        let place = || {
            format!(
                "{cutter:?} cell {k} {} by {} not {height} by {by}",
                expected.height[k], expected.cut_by[k]
            )
        };
        assert!(
            (height - expected.height[k]).abs() <= PROMISED.max(height.abs() * f32::EPSILON),
            "{}",
            place()
        );
        if by != NOT_CUT {
            let p = stock.grid.centre(k % stock.grid.nx, k / stock.grid.nx);
            let made = envelope.height(by, p.x, p.y).unwrap();
            assert!(
                (made - f64::from(height)).abs() <= f64::from(PROMISED.max(height.abs() * f32::EPSILON)),
                "{}",
                place()
            );
        }
    }
}

#[test]
fn a_thousand_random_programs_agree_with_the_reference() {
    let mut rng = Rng::new(24);
    for round in 0..1000 {
        let cutter = {
            let all = cutters();
            all[round % all.len()]
        };
        let size = [2.0, 4.0, 12.0, 40.0, 200.0][rng.below(5)];
        let moves = 1 + rng.below(60);
        let path = random_path(&mut rng, moves, size);
        let cell = size / rng.within(8.0, 60.0);
        let origin = Point2::new(rng.within(-2.0, 1.0), rng.within(-2.0, 1.0));
        let grid = Grid { origin, cell, nx: 1 + rng.below(40), ny: 1 + rng.below(40) };
        compare(&ZMap::block(grid, 3.0), &cutter, &path);
    }
}

/// Alone in its stock a move cuts with every part of its cutter. (Where the side of a taper takes over from
/// its corner, places on the corner were once taken for it: 0.07 µm too high.)
#[test]
fn single_moves_agree_with_the_reference() {
    let mut rng = Rng::new(26);
    let stock = ZMap::block(square_grid(10.0, 0.0625), 5.0);
    for cutter in cutters() {
        for k in 0..100 {
            let from = Point3::new(rng.within(0.0, 10.0), rng.within(0.0, 10.0), 0.0);
            let by = 10.0 * rng.within(0.1, 1.0).powi(2);
            let (y, x) = rng.within(0.0, std::f64::consts::TAU).sin_cos();
            let rise = by * if k % 4 == 0 { rng.within(0.0, 4.0) } else { rng.within(0.0, 1.0) };
            compare(
                &stock,
                &cutter,
                &path_through([from, Point3::new(from.x + by * x, from.y + by * y, rise)]),
            );
        }
    }
    let taper = Cutter::taper(2.0, 0.4, 35f64.to_radians(), 5.0).unwrap();
    let tips = [
        Point3::new(6.491700149109909, 0.0, 3.497523830535373),
        Point3::new(6.465612557934223, 7.850611841699978, 0.0),
    ];
    compare(&stock, &taper, &path_through(tips));
}

#[test]
fn dense_programs_agree_with_the_reference() {
    for cutter in cutters() {
        for (stepover, chord, cell) in [(0.3, 0.2, 0.05), (0.7, 1.3, 0.02), (0.2, 0.01, 0.1), (1.5, 0.4, 0.3)]
        {
            let size = if chord < 0.1 { 2.0 } else { 6.0 };
            compare(&ZMap::block(square_grid(size, cell), 5.0), &cutter, &wave_path(size, stepover, chord));
        }
    }
}

/// Heights and places far from zero, large cutters (f64 throughout), stock that was cut before.
#[test]
fn unusual_sizes_agree_with_the_reference() {
    let mut rng = Rng::new(25);
    for diameter in [0.02, 30.0, 900.0] {
        let cutter = Cutter::ball(diameter).unwrap();
        let path = random_path(&mut rng, 40, 4.0 * diameter);
        let grid = Grid { origin: Point2::new(-diameter, 0.0), cell: 0.07 * diameter, nx: 60, ny: 50 };
        compare(&ZMap::block(grid, 3.0), &cutter, &path);
    }
    for cutter in cutters() {
        let path = random_path(&mut rng, 40, 8.0);
        let far = path.segments().map(|(from, ..)| from + nalgebra::Vector3::new(9000.0, -7000.0, 400.0));
        let grid = Grid { origin: Point2::new(9000.0, -7000.0), cell: 0.1, nx: 80, ny: 80 };
        let stock = ZMap::block(grid, 404.0);
        let path = path_through(far.collect::<Vec<Point3>>());
        compare(&stock, &cutter, &path);
        let first = cut_reference(&stock, &cutter, &path, &Silent).unwrap();
        let again = path_through(
            path.segments().map(|(from, ..)| Point3::new(from.y + 16000.0, from.x - 16000.0, from.z)),
        );
        compare(&first, &cutter, &again);
    }
}

/// A deep hole beside shallow passes: heights in one tile differ by far more than the cutter's size.
#[test]
fn a_deep_hole_leaves_the_passes_beside_it_exact() {
    for cutter in cutters() {
        let hole = [Point3::new(1.0, 1.0, 50.0), Point3::new(1.0, 1.0, -700.0), Point3::new(1.0, 1.0, 50.0)];
        let passes = wave_path(8.0, 0.3, 0.2);
        let path = path_through(hole.into_iter().chain(passes.segments().map(|(_, to, _)| to)));
        compare(&ZMap::block(square_grid(8.0, 0.05), 5.0), &cutter, &path);
    }
}

/// Ten times as many moves of a tenth of the length: a cell sees few of them.
#[test]
fn evaluations_hardly_grow_with_the_moves() {
    let stock = ZMap::block(square_grid(20.0, 0.05), 5.0);
    let per_cell = |chord: f64| {
        let path = wave_path(20.0, 0.3, chord);
        let (_, work) = cut_counted(stock.clone(), &Cutter::ball(6.0).unwrap(), &path, &Silent).unwrap();
        work.evaluations as f64 / stock.grid.len() as f64
    };
    assert!(per_cell(0.5) < 4.0 && per_cell(0.05) < 8.0, "{} {}", per_cell(0.5), per_cell(0.05));
}

/// Loops over cells are vector code for every family: where those of one are not, it is two to five times as
/// slow.
#[test]
#[ignore = "times: every night"]
fn every_family_is_cut_in_vector_code() {
    let path = wave_path(10.0, 0.3, 0.2);
    let stock = ZMap::block(square_grid(10.0, 0.05), 5.0);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let seconds = |work: &(dyn Fn() + Sync)| {
        let start = std::time::Instant::now();
        work();
        start.elapsed().as_secs_f64()
    };
    for cutter in cutters().into_iter().take(5) {
        pool.install(|| {
            let mut least = [f64::INFINITY; 2];
            // In turns, and the least of each: others only ever add time.
            for _ in 0..9 {
                let ours = seconds(&|| drop(cut(stock.clone(), &cutter, &path, &Silent)));
                let reference = seconds(&|| drop(cut_reference(&stock, &cutter, &path, &Silent)));
                least = [least[0].min(ours), least[1].min(reference)];
            }
            let ratio = least[1] / least[0];
            println!("{cutter:?}: {ratio:.1} times as fast as the reference");
            assert!(ratio > 5.0, "{cutter:?}: only {ratio:.1} times as fast as the reference");
        });
    }
}
