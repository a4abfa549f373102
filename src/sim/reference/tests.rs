//! The engine against a plain double loop, and the properties that any engine must have.

use super::*;
use crate::geometry::Point3;
use crate::monitor::Silent;
use crate::sim::Grid;
use crate::sim::scenes::{Rng, cutters, path_through, random_path, square_grid, wave_path};
use crate::sim::swept::tests::brute_height;
use proptest::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

fn cut(stock: &ZMap, cutter: &Cutter, path: &Toolpath) -> ZMap {
    cut_reference(stock, cutter, path, &Silent).unwrap()
}

fn ball() -> Cutter {
    Cutter::ball(6.0).unwrap()
}

/// Every cell against every move, each by numeric minimisation over its length, in f64.
fn cut_brute_force(stock: &ZMap, cutter: &Cutter, path: &Toolpath) -> Vec<(f64, u32)> {
    let cell = |k: usize| {
        let p = stock.grid.centre(k % stock.grid.nx, k / stock.grid.nx);
        let mut lowest = (f64::from(stock.height[k]), NOT_CUT);
        for (index, (from, to, _)) in path.segments().enumerate() {
            if let Some(h) = brute_height(cutter, from, to, p.x, p.y).filter(|h| *h < lowest.0) {
                lowest = (h, index as u32);
            }
        }
        lowest
    };
    parallel::map(stock.grid.len(), cell)
}

/// Heights within 0.01 µm of brute force, and each cell's move cuts as low as the lowest.
fn compare(cutter: &Cutter, path: &Toolpath, grid: Grid) {
    let stock = ZMap::block(grid, 3.0);
    let got = cut(&stock, cutter, path);
    for (k, (height, by)) in cut_brute_force(&stock, cutter, path).into_iter().enumerate() {
        let p = grid.centre(k % grid.nx, k / grid.nx);
        let found = f64::from(got.height[k]);
        assert!((found - height).abs() <= 1e-5, "{cutter:?} cell {k}: {found} {height}");
        if got.cut_by[k] != by {
            // Equal to the rounding of f32: both sides of a joint, or the floor that many moves share.
            let other = match got.cut_by[k] {
                NOT_CUT => 3.0,
                m => {
                    let (from, to) = (path.start_of(m as usize), path.moves[m as usize].to.tip);
                    brute_height(cutter, from, to, p.x, p.y).unwrap()
                }
            };
            assert!((other - height).abs() < 2.5e-7, "{cutter:?} cell {k} by {} not {by}", got.cut_by[k]);
        }
    }
}

#[test]
fn ball_agrees_with_brute_force_over_ten_thousand_moves() {
    let mut rng = Rng::new(11);
    for round in 0..40 {
        let size = [4.0, 12.0, 30.0, 80.0][round % 4];
        let path = random_path(&mut rng, 250, size);
        let cell = size / rng.within(9.0, 14.0);
        let nx = 1 + rng.below(20);
        let grid = Grid { origin: Point2::new(-1.0, 0.3), cell, nx, ny: 1 + 200 / (nx * 2) };
        compare(&ball(), &path, grid);
    }
}

#[test]
fn other_cutters_agree_with_brute_force() {
    let mut rng = Rng::new(12);
    for cutter in &cutters()[1..] {
        for size in [4.0, 12.0, 40.0] {
            let path = random_path(&mut rng, 120, size);
            let grid = Grid { origin: Point2::new(-1.0, 0.3), cell: size / 11.0, nx: 14, ny: 17 };
            compare(cutter, &path, grid);
        }
    }
}

/// Dense cells and short moves: here the blocks are small against the cutter and most moves of a
/// tile are left out.
#[test]
fn blocks_leave_out_no_move_that_matters() {
    for cutter in cutters() {
        let path = wave_path(8.0, 0.8, 0.7);
        let stock = ZMap::block(square_grid(8.0, 0.05), 5.0);
        let got = cut(&stock, &cutter, &path);
        let envelope = crate::sim::Envelope::new(&cutter, &path);
        let all: Vec<u32> = (0..path.len() as u32).collect();
        for k in 0..stock.grid.len() {
            let p = stock.grid.centre(k % stock.grid.nx, k / stock.grid.nx);
            let (height, by) = envelope.lowest(p.x, p.y, &all).unwrap();
            let expected = if (height as f32) < 5.0 { (height as f32, by) } else { (5.0, NOT_CUT) };
            assert_eq!((got.height[k], got.cut_by[k]), expected, "{cutter:?} at {p}");
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let path = wave_path(20.0, 0.9, 0.7);
    let stock = ZMap::block(square_grid(20.0, 0.1), 5.0);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| cut(&stock, &ball(), &path))
    };
    let one = run(1);
    for threads in [2, 3, 8] {
        assert_eq!(one, run(threads), "{threads} threads");
    }
}

#[test]
fn small_and_empty_cases() {
    let one_cell = ZMap::block(Grid { origin: Point2::new(0.0, 0.0), cell: 0.1, nx: 1, ny: 1 }, 2.0);
    let nowhere = path_through([Point3::origin()]);
    assert_eq!(cut(&one_cell, &ball(), &nowhere), one_cell);
    let plunge = path_through([Point3::new(0.0, 0.0, 9.0), Point3::new(0.0, 0.0, -1.0)]);
    let got = cut(&one_cell, &ball(), &plunge);
    assert_eq!((got.height[0], got.cut_by[0]), (-1.0, 0));
    let far = path_through([Point3::new(900.0, 0.0, 0.0), Point3::new(1000.0, -700.0, 0.0)]);
    assert_eq!(cut(&one_cell, &ball(), &far), one_cell);
    let empty = ZMap { grid: Grid { nx: 0, ny: 0, ..one_cell.grid }, height: vec![], cut_by: vec![] };
    assert_eq!(cut(&empty, &ball(), &plunge), empty);
}

#[test]
fn rapids_cut_and_names_of_an_earlier_path_are_forgotten() {
    let mut path = path_through([Point3::new(-9.0, 0.0, 1.0), Point3::new(9.0, 0.0, 1.0)]);
    path.moves[0].kind = crate::toolpath::MoveKind::Rapid;
    let stock = ZMap::block(square_grid(4.0, 0.5), 3.0);
    let once = cut(&stock, &ball(), &path);
    assert!(once.cut_by.contains(&0));
    let twice = cut(&once, &ball(), &path);
    assert_eq!(twice.height, once.height);
    assert!(twice.cut_by.iter().all(|by| *by == NOT_CUT), "nothing goes below what is cut already");
}

/// Stops after so many questions.
struct StopAfter(AtomicU64);

impl Monitor for StopAfter {
    fn cancelled(&self) -> bool {
        self.0.fetch_sub(1, Ordering::Relaxed) == 0
    }
}

#[test]
fn a_cancelled_cut_returns_nothing() {
    let stock = ZMap::block(square_grid(20.0, 0.1), 5.0);
    let monitor = StopAfter(AtomicU64::new(3));
    assert_eq!(cut_reference(&stock, &ball(), &wave_path(20.0, 2.0, 2.0), &monitor), Err(Cancelled));
}

/// The groove of one level pass has the volume of half a capsule; a grid of cell centres finds it
/// with an error of order 1.5 in the cell, because the walls of the groove are vertical parabolas.
#[test]
fn volume_of_a_groove_converges() {
    let path = path_through([Point3::new(4.013, 5.0, 0.0), Point3::new(9.004, 5.0, 0.0)]);
    let expected = 0.5 * std::f64::consts::PI * (9.0 * 4.991 + 4.0 / 3.0 * 27.0);
    let error = |cell: f64| {
        let stock = ZMap::block(square_grid(13.0, cell), 3.0);
        let depth: f64 = cut(&stock, &ball(), &path).height.iter().map(|h| 3.0 - f64::from(*h)).sum();
        (depth * cell * cell / expected - 1.0).abs()
    };
    for cell in [0.5, 0.2, 0.1, 0.05, 0.02] {
        assert!(error(cell) < 0.03 * cell.powf(1.5), "{} at {cell}", error(cell));
    }
}

fn tips() -> impl Strategy<Value = Vec<Point3>> {
    let tip = (0.0..10.0f64, 0.0..10.0f64, -1.0..4.0f64).prop_map(|(x, y, z)| Point3::new(x, y, z));
    prop::collection::vec(tip, 2..12)
}

fn any_cutter() -> impl Strategy<Value = Cutter> {
    prop::sample::select(cutters().to_vec())
}

fn farthest(a: &ZMap, b: &ZMap) -> f32 {
    a.height.iter().zip(&b.height).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn stock_never_grows(tips in tips(), cutter in any_cutter(), top in -1.0..5.0f64) {
        let stock = ZMap::block(square_grid(10.0, 0.4), top);
        let got = cut(&stock, &cutter, &path_through(tips));
        for k in 0..stock.grid.len() {
            prop_assert!(got.height[k] <= stock.height[k]);
            prop_assert_eq!(got.cut_by[k] == NOT_CUT, got.height[k] == stock.height[k]);
        }
    }

    #[test]
    fn splitting_and_reversing_change_nothing(tips in tips(), cutter in any_cutter(), t in 0.0..1.0f64) {
        let stock = ZMap::block(square_grid(10.0, 0.4), 5.0);
        let whole = cut(&stock, &cutter, &path_through(tips.clone()));
        let halves = tips.windows(2).flat_map(|w| [w[0] + t * (w[1] - w[0]), w[1]]);
        let split = cut(&stock, &cutter, &path_through([tips[0]].into_iter().chain(halves)));
        prop_assert!(farthest(&whole, &split) < 1e-6);
        let back = cut(&stock, &cutter, &path_through(tips.into_iter().rev()));
        prop_assert_eq!(whole.height, back.height);
    }

    #[test]
    fn shifting_by_whole_cells_shifts_the_map(tips in tips(), cutter in any_cutter(), n in -40i32..40) {
        // A cell of a power of two keeps every coordinate exact, so that nothing is rounded anew.
        let shift = f64::from(n) * 0.25;
        let snapped: Vec<Point3> = tips.iter().map(|p| p.map(|c| (c * 1024.0).round() / 1024.0)).collect();
        let stock = ZMap::block(square_grid(10.0, 0.25), 5.0);
        let mut moved = stock.clone();
        moved.grid.origin.x += shift;
        moved.grid.origin.y -= 2.0 * shift;
        let there = snapped.iter().map(|p| Point3::new(p.x + shift, p.y - 2.0 * shift, p.z));
        let here = cut(&stock, &cutter, &path_through(snapped.clone()));
        let there = cut(&moved, &cutter, &path_through(there));
        prop_assert_eq!(here.height, there.height);
        prop_assert_eq!(here.cut_by, there.cut_by);
    }

    #[test]
    fn order_changes_no_height(tips in tips(), cutter in any_cutter(), turn in 0usize..12) {
        let stock = ZMap::block(square_grid(10.0, 0.4), 5.0);
        // A closed round can begin anywhere.
        let n = tips.len();
        let round = |first: usize| path_through((0..=n).map(|k| tips[(first + k) % n]));
        let (a, b) = (cut(&stock, &cutter, &round(0)), cut(&stock, &cutter, &round(turn % n)));
        prop_assert_eq!(a.height, b.height);
    }
}
