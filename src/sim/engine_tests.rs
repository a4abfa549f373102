//! What every engine that cuts stock must keep, whatever its method: each test runs for each engine of
//! [`ENGINES`]. How near an engine comes to the truth is tested beside it.

use super::scenes::{Rng, cutters, path_through, random_path, square_grid, wave_path};
use super::{Grid, NOT_CUT, ZMap, cut, cut_reference};
use crate::CutError;
use cutter::Cutter;
use geometry::{Point2, Point3};
use motion::{MoveKind, Toolpath};
use proptest::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};
use work::monitor::{Cancelled, Monitor, Silent};

/// An engine and what it promises.
struct Engine {
    name: &'static str,
    cut: fn(&ZMap, &Cutter, &Toolpath, &dyn Monitor) -> Result<ZMap, CutError>,
    /// How far heights may lie from the exact ones, mm; 0 for those that round only once, on storing.
    tolerance: f32,
}

const ENGINES: [Engine; 2] = [
    Engine { name: "reference", cut: cut_reference, tolerance: 0.0 },
    Engine {
        name: "branch and bound",
        cut: |stock, cutter, path, monitor| cut(stock.clone(), cutter, path, monitor),
        tolerance: 1e-5,
    },
];

impl Engine {
    fn run(&self, stock: &ZMap, cutter: &Cutter, path: &Toolpath) -> ZMap {
        (self.cut)(stock, cutter, path, &Silent).unwrap()
    }

    /// How far two results for the same stock may lie apart, mm: each may err to its own side.
    fn apart(&self) -> f32 {
        2.0 * self.tolerance
    }
}

fn ball() -> Cutter {
    Cutter::ball(6.0).unwrap()
}

fn farthest(a: &ZMap, b: &ZMap) -> f32 {
    assert_eq!(a.grid.len(), b.height.len());
    a.height.iter().zip(&b.height).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let path = wave_path(20.0, 0.9, 0.7);
    let stock = ZMap::block(square_grid(20.0, 0.1), 5.0);
    for engine in &ENGINES {
        for cutter in cutters() {
            let run = |threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| engine.run(&stock, &cutter, &path))
            };
            let one = run(1);
            for threads in [2, 3, 8] {
                assert_eq!(one, run(threads), "{} {cutter:?} on {threads} threads", engine.name);
            }
        }
    }
}

#[test]
fn small_and_empty_cases() {
    let one_cell = ZMap::block(Grid { origin: Point2::new(0.0, 0.0), cell: 0.1, nx: 1, ny: 1 }, 2.0);
    let nowhere = path_through([Point3::origin()]);
    let plunge = path_through([Point3::new(0.0, 0.0, 9.0), Point3::new(0.0, 0.0, -1.0)]);
    let far = path_through([Point3::new(900.0, 0.0, 0.0), Point3::new(1000.0, -700.0, 0.0)]);
    for engine in &ENGINES {
        for cutter in cutters() {
            assert_eq!(engine.run(&one_cell, &cutter, &nowhere), one_cell);
            let got = engine.run(&one_cell, &cutter, &plunge);
            assert_eq!((got.height[0], got.cut_by[0]), (-1.0, 0), "{} {cutter:?}", engine.name);
            assert_eq!(engine.run(&one_cell, &cutter, &far), one_cell);
            for (nx, ny) in [(0, 0), (7, 0), (0, 7)] {
                let grid = Grid { nx, ny, ..one_cell.grid };
                let empty = ZMap::block(grid, 2.0);
                assert_eq!(engine.run(&empty, &cutter, &plunge), empty);
            }
        }
    }
}

/// A grid of one row, and widths on both sides of those of leaves, blocks and tiles: each cell is what
/// it is in a larger grid.
#[test]
fn a_part_of_a_grid_is_cut_like_the_whole() {
    let mut rng = Rng::new(41);
    let path = random_path(&mut rng, 30, 8.0);
    let whole = ZMap::block(Grid { origin: Point2::origin(), cell: 0.0625, nx: 300, ny: 40 }, 3.0);
    for engine in &ENGINES {
        let expected = engine.run(&whole, &ball(), &path);
        for (nx, ny) in [(1, 1), (1, 9), (7, 1), (8, 8), (9, 17), (64, 3), (65, 33), (257, 2)] {
            let got = engine.run(&ZMap::block(Grid { nx, ny, ..whole.grid }, 3.0), &ball(), &path);
            for (j, row) in got.height.chunks(nx).enumerate() {
                for (i, height) in row.iter().enumerate() {
                    let off = (height - expected.height[whole.grid.index(i, j)]).abs();
                    assert!(off <= engine.apart(), "{} {nx} x {ny}: {off}", engine.name);
                }
            }
        }
    }
}

#[test]
fn rapids_cut() {
    let feed = path_through([Point3::new(-9.0, 0.0, 1.0), Point3::new(9.0, 0.0, 1.0)]);
    let mut rapid = feed.clone();
    rapid.moves[0].kind = MoveKind::Rapid;
    let stock = ZMap::block(square_grid(4.0, 0.5), 3.0);
    for engine in &ENGINES {
        let got = engine.run(&stock, &ball(), &rapid);
        assert!(got.cut_by.contains(&0), "{}", engine.name);
        assert_eq!(got, engine.run(&stock, &ball(), &feed));
    }
}

/// The second path cuts in a corner of the part only: in its tiles and in those that it never meets
/// the first path's names are gone, and its heights stay.
#[test]
fn names_of_an_earlier_path_are_forgotten() {
    let stock = ZMap::block(square_grid(20.0, 0.1), 5.0);
    let first = wave_path(20.0, 1.5, 1.0);
    let corner = path_through([Point3::new(1.0, 1.0, -4.0), Point3::new(3.0, 2.0, -4.0)]);
    for engine in &ENGINES {
        for cutter in cutters() {
            let once = engine.run(&stock, &cutter, &first);
            assert!(once.cut_by.iter().any(|by| *by != NOT_CUT));
            let twice = engine.run(&once, &cutter, &corner);
            let lower = |k: usize| twice.height[k] < once.height[k];
            for k in 0..stock.grid.len() {
                assert_eq!(twice.cut_by[k], if lower(k) { 0 } else { NOT_CUT }, "{}", engine.name);
                assert!(lower(k) || twice.height[k] == once.height[k]);
            }
            assert!((0..stock.grid.len()).any(lower), "the corner is cut");
            let again = engine.run(&once, &cutter, &first);
            assert!(farthest(&again, &once) <= engine.apart(), "nothing is left to cut");
        }
    }
}

/// Says stop from one question on, and adds up what it is told.
struct Listener {
    stop_at: u64,
    questions: AtomicU64,
    announced: AtomicU64,
    advanced: AtomicU64,
}

impl Listener {
    fn stopping_at(stop_at: u64) -> Self {
        let zero = || AtomicU64::new(0);
        Self { stop_at, questions: zero(), announced: zero(), advanced: zero() }
    }
}

impl Monitor for Listener {
    fn start(&self, _stage: &str, steps: u64) {
        self.announced.fetch_add(steps, Ordering::Relaxed);
    }
    fn advance(&self, steps: u64) {
        self.advanced.fetch_add(steps, Ordering::Relaxed);
    }
    fn cancelled(&self) -> bool {
        self.questions.fetch_add(1, Ordering::Relaxed) >= self.stop_at
    }
}

#[test]
fn a_cancelled_cut_returns_nothing_and_progress_adds_up() {
    let stock = ZMap::block(square_grid(20.0, 0.1), 5.0);
    let path = wave_path(20.0, 2.0, 2.0);
    for engine in &ENGINES {
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let run = |listener: &Listener| pool.install(|| (engine.cut)(&stock, &ball(), &path, listener));
            let all = Listener::stopping_at(u64::MAX);
            assert_eq!(run(&all).as_ref(), Ok(&engine.run(&stock, &ball(), &path)));
            let [questions, announced, advanced] =
                [&all.questions, &all.announced, &all.advanced].map(|n| n.load(Ordering::Relaxed));
            assert!(questions > 4 && announced > 4, "{}: {questions} {announced}", engine.name);
            assert_eq!(announced, advanced, "{}", engine.name);
            for stop_at in [0, 1, 3, questions / 2, questions - 1] {
                let listener = Listener::stopping_at(stop_at);
                assert_eq!(
                    run(&listener),
                    Err(CutError::Cancelled(Cancelled)),
                    "{} at {stop_at}",
                    engine.name
                );
                assert!(listener.advanced.into_inner() < announced);
            }
            assert!(run(&Listener::stopping_at(questions)).is_ok());
        }
    }
}

/// The groove of one level pass has the volume of half a capsule; a grid of cell centres finds it
/// with an error of order 1.5 in the cell, because the walls of the groove are vertical parabolas.
#[test]
fn volume_of_a_groove_converges() {
    let path = path_through([Point3::new(4.013, 5.0, 0.0), Point3::new(9.004, 5.0, 0.0)]);
    let expected = 0.5 * std::f64::consts::PI * (9.0 * 4.991 + 4.0 / 3.0 * 27.0);
    for engine in &ENGINES {
        for cell in [0.5, 0.2, 0.1, 0.05, 0.02] {
            let stock = ZMap::block(square_grid(13.0, cell), 3.0);
            let cut = engine.run(&stock, &ball(), &path);
            let depth: f64 = cut.height.iter().map(|h| 3.0 - f64::from(*h)).sum();
            let error = (depth * cell * cell / expected - 1.0).abs();
            assert!(error < 0.03 * cell.powf(1.5), "{}: {error} at {cell}", engine.name);
        }
    }
}

fn tips() -> impl Strategy<Value = Vec<Point3>> {
    let tip = (0.0..10.0f64, 0.0..10.0f64, -1.0..4.0f64).prop_map(|(x, y, z)| Point3::new(x, y, z));
    prop::collection::vec(tip, 2..12)
}

fn any_cutter() -> impl Strategy<Value = Cutter> {
    prop::sample::select(cutters())
}

/// From tiles of a leaf to tiles of many, mm. Powers of two, so that places on the grid are exact.
fn any_cell() -> impl Strategy<Value = f64> {
    prop::sample::select(vec![0.5, 0.25, 0.0625])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn stock_never_grows(tips in tips(), cutter in any_cutter(), top in -1.0..5.0f64, cell in any_cell()) {
        let stock = ZMap::block(square_grid(10.0, cell), top);
        let path = path_through(tips);
        for engine in &ENGINES {
            let got = engine.run(&stock, &cutter, &path);
            for k in 0..stock.grid.len() {
                prop_assert!(got.height[k] <= stock.height[k]);
                prop_assert_eq!(got.cut_by[k] == NOT_CUT, got.height[k] == stock.height[k]);
            }
        }
    }

    /// Cutting along a second path after a first one leaves what cutting along both at once does.
    #[test]
    fn one_path_after_another_cuts_like_both(tips in tips(), cutter in any_cutter(), cell in any_cell()) {
        let stock = ZMap::block(square_grid(10.0, cell), 5.0);
        let turn = tips.len() / 2;
        for engine in &ENGINES {
            let whole = engine.run(&stock, &cutter, &path_through(tips.clone()));
            let half = engine.run(&stock, &cutter, &path_through(tips[..=turn].iter().copied()));
            let both = engine.run(&half, &cutter, &path_through(tips[turn..].iter().copied()));
            prop_assert!(farthest(&whole, &both) <= engine.apart(), "{}", engine.name);
        }
    }

    #[test]
    fn splitting_and_reversing_change_nothing(
        tips in tips(), cutter in any_cutter(), t in 0.0..1.0f64, cell in any_cell()
    ) {
        let stock = ZMap::block(square_grid(10.0, cell), 5.0);
        let halves = tips.windows(2).flat_map(|w| [w[0] + t * (w[1] - w[0]), w[1]]);
        let split = path_through([tips[0]].into_iter().chain(halves));
        let reversed = path_through(tips.iter().rev().copied());
        let path = path_through(tips);
        for engine in &ENGINES {
            let whole = engine.run(&stock, &cutter, &path);
            // The place where a move is split is rounded.
            let off = farthest(&whole, &engine.run(&stock, &cutter, &split));
            prop_assert!(off < 1e-6 + engine.apart(), "{}: {off}", engine.name);
            let off = farthest(&whole, &engine.run(&stock, &cutter, &reversed));
            prop_assert!(off <= engine.apart(), "{}: {off}", engine.name);
        }
    }

    #[test]
    fn shifting_by_whole_cells_shifts_the_map(
        tips in tips(), cutter in any_cutter(), n in -40i32..40, cell in any_cell()
    ) {
        // All coordinates are multiples of 1/1024, so that nothing is rounded anew.
        let shift = f64::from(n) * cell;
        let snapped: Vec<Point3> = tips.iter().map(|p| p.map(|c| (c * 1024.0).round() / 1024.0)).collect();
        let stock = ZMap::block(square_grid(10.0, cell), 5.0);
        let mut moved = stock.clone();
        moved.grid.origin.x += shift;
        moved.grid.origin.y -= 2.0 * shift;
        let there = path_through(snapped.iter().map(|p| Point3::new(p.x + shift, p.y - 2.0 * shift, p.z)));
        let here = path_through(snapped);
        for engine in &ENGINES {
            let (a, b) = (engine.run(&stock, &cutter, &here), engine.run(&moved, &cutter, &there));
            prop_assert!(farthest(&a, &b) <= engine.apart(), "{}", engine.name);
            prop_assert!(engine.tolerance > 0.0 || a.cut_by == b.cut_by, "{}", engine.name);
        }
    }

    #[test]
    fn order_changes_no_height(
        tips in tips(), cutter in any_cutter(), turn in 0usize..12, cell in any_cell()
    ) {
        let stock = ZMap::block(square_grid(10.0, cell), 5.0);
        // A closed round can begin anywhere.
        let n = tips.len();
        let round = |first: usize| path_through((0..=n).map(|k| tips[(first + k) % n]));
        for engine in &ENGINES {
            let (a, b) =
                (engine.run(&stock, &cutter, &round(0)), engine.run(&stock, &cutter, &round(turn % n)));
            prop_assert!(farthest(&a, &b) <= engine.apart(), "{}", engine.name);
        }
    }
}
