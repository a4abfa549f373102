//! The engine against the plain loop and against the one that forgets the order, and what any account
//! of removal must satisfy.

use super::*;
use crate::scenes::{Rng, cutters, path_through, random_path, square_grid, wave_path};
use crate::swept::swept_height;
use crate::{Grid, cut_reference};
use geometry::{Point2, Vector3};
use motion::MoveKind;
use proptest::prelude::*;
use work::monitor::Silent;

fn cut(stock: &ZMap, cutter: &Cutter, path: &Toolpath) -> Removal {
    cut_in_order(stock.clone(), cutter, path, &Silent).unwrap()
}

fn plain(stock: &ZMap, cutter: &Cutter, path: &Toolpath) -> Removal {
    cut_in_order_plain(stock.clone(), cutter, path, &Silent).unwrap()
}

fn ball() -> Cutter {
    Cutter::ball(6.0).unwrap()
}

/// One unit in the last place of f32 below 16 mm, and some.
const LAST_PLACE: f32 = 2.0e-6;

fn farthest(a: &ZMap, b: &ZMap) -> f32 {
    let apart = |(a, b): (&f32, &f32)| if a == b { 0.0 } else { (a - b).abs() };
    a.height.iter().zip(&b.height).map(apart).fold(0.0, f32::max)
}

/// Volume between two stocks, mm³.
fn between(before: &ZMap, after: &ZMap) -> f64 {
    let drops = before.height.iter().zip(&after.height).map(|(b, a)| f64::from(*b) - f64::from(*a));
    drops.sum::<f64>() * before.grid.cell.powi(2)
}

fn check_against_plain(stock: &ZMap, cutter: &Cutter, path: &Toolpath) {
    let (got, expected) = (cut(stock, cutter, path), plain(stock, cutter, path));
    let reference = cut_reference(stock, cutter, path, &Silent).unwrap();
    assert_eq!(expected.stock.height, reference.height, "{cutter:?}");
    assert!(farthest(&got.stock, &reference) <= LAST_PLACE, "{cutter:?}");
    let area = stock.grid.cell.powi(2);
    for (k, (got, expected)) in got.moves.iter().zip(&expected.moves).enumerate() {
        // Cells that a move meets at the very height of the one before may go to either.
        let rounding = f64::from(LAST_PLACE) * area * stock.grid.len() as f64;
        assert!((got.volume - expected.volume).abs() <= rounding, "{cutter:?} {k}: {got:?} {expected:?}");
        assert!((got.depth - expected.depth).abs() <= f64::from(LAST_PLACE), "{k}: {got:?} {expected:?}");
        if expected.depth > 2.0 * ENGAGED {
            assert_eq!((got.axial, got.radial), (expected.axial, expected.radial), "{cutter:?} move {k}");
        }
    }
    let total = between(stock, &got.stock);
    assert!((got.volume() - total).abs() <= 1e-9 * total.max(1e-9), "{} {total}", got.volume());
}

#[test]
fn random_programs_of_all_cutters_agree_with_the_plain_loop() {
    let mut rng = Rng::new(21);
    for cutter in cutters() {
        for round in 0..12 {
            let size = [4.0, 12.0, 40.0][round % 3];
            let path = random_path(&mut rng, 150, size);
            let cell = size / rng.within(25.0, 160.0);
            let grid =
                Grid { origin: Point2::new(-1.0, 0.3), cell, nx: 1 + rng.below(300), ny: 1 + rng.below(150) };
            check_against_plain(&ZMap::block(grid, 3.0), &cutter, &path);
        }
    }
}

#[test]
fn milling_in_passes_agrees_with_the_plain_loop() {
    for cutter in cutters() {
        let path = wave_path(12.0, 0.4, 0.3);
        check_against_plain(&ZMap::block(square_grid(12.0, 0.06), 5.0), &cutter, &path);
    }
}

/// Moves along the axes and along sides of triangles of 3, 4 and 5, over cells of the same lattice: many lie
/// on the rim of the cutter, and whether it reaches them is a matter of rounding.
#[test]
fn cells_on_the_rim_are_cut_where_the_closed_forms_say_so() {
    let mut rng = Rng::new(33);
    let grid = Grid { origin: Point2::new(0.0, 0.0), cell: 0.1, nx: 100, ny: 100 };
    for cutter in cutters() {
        for direction in [[5.0, 0.0], [0.0, 5.0], [3.0, 4.0], [-4.0, 3.0], [-3.0, -4.0], [4.0, -3.0]] {
            let from = Point3::new(4.0 + 0.1 * rng.below(20) as f64, 4.0 + 0.1 * rng.below(20) as f64, 1.0);
            let [dx, dy] = direction.map(|d| d * 0.1 * rng.below(7) as f64);
            let to = from + Vector3::new(dx, dy, rng.below(3) as f64 * 0.3 - 0.3);
            let got = cut(&ZMap::block(grid, 5.0), &cutter, &path_through([from, to])).stock;
            let (form, track) = (Form::new(&cutter), Track::new(from, to));
            for k in 0..grid.len() {
                let p = grid.centre(k % grid.nx, k / grid.nx);
                let expected = (swept_height(&form, &track, p.x, p.y) as f32).min(5.0);
                let off = (got.height[k] - expected).abs();
                assert!(off <= LAST_PLACE, "{cutter:?} {from} {to} at {p}: {} {expected}", got.height[k]);
            }
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let path = wave_path(20.0, 0.9, 0.7);
    let stock = ZMap::block(square_grid(20.0, 0.05), 5.0);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| cut(&stock, &ball(), &path))
    };
    let one = run(1);
    for threads in [2, 3, 8] {
        assert_eq!(one, run(threads), "{threads} threads");
    }
}

/// Roughing with a flat end, finishing with a ball: the second cutter finds what the first has left.
#[test]
fn stock_goes_from_one_cutter_to_the_next() {
    let block = ZMap::block(square_grid(16.0, 0.08), 6.0);
    let flat = Cutter::flat(6.0).unwrap();
    let mut rough = wave_path(16.0, 2.0, 0.5);
    rough.start.tip.z += 1.0;
    rough.moves.iter_mut().for_each(|m| m.to.tip.z += 1.0);
    let finish = wave_path(16.0, 0.4, 0.3);
    let first = cut(&block, &flat, &rough);
    let second = cut(&first.stock, &ball(), &finish);
    let total = between(&block, &second.stock);
    assert!(first.volume() > second.volume() && second.volume() > 100.0);
    assert!(((first.volume() + second.volume()) / total - 1.0).abs() < 1e-9);
    let reference = cut_reference(&block, &flat, &rough, &Silent).unwrap();
    let reference = cut_reference(&reference, &ball(), &finish, &Silent).unwrap();
    assert!(farthest(&second.stock, &reference) <= LAST_PLACE);
    let again = cut(&second.stock, &ball(), &finish);
    assert!(again.volume() < 1e-3 && again.moves.iter().all(|m| m.radial == 0.0), "nothing is left to cut");
}

#[test]
fn each_cell_names_the_last_move_that_lowered_it() {
    let path = path_through([
        Point3::new(2.0, 5.0, 2.0),
        Point3::new(8.0, 5.0, 2.0),
        Point3::new(8.0, 5.0, 4.0),
        Point3::new(2.0, 5.0, 4.0),
        Point3::new(2.0, 5.0, 1.0),
    ]);
    let got = cut(&ZMap::block(square_grid(10.0, 0.1), 5.0), &ball(), &path);
    let by = |x: f64, y: f64| {
        let (i, j) = got.stock.grid.cell_at(x, y).unwrap();
        got.stock.cut_by[got.stock.grid.index(i, j)]
    };
    assert_eq!((by(6.0, 5.0), by(2.0, 5.0), by(9.9, 9.9)), (0, 3, NOT_CUT));
    let volumes: Vec<f64> = got.moves.iter().map(|m| m.volume).collect();
    assert!(volumes[0] > 0.0 && volumes[1] == 0.0 && volumes[2] == 0.0 && volumes[3] > 0.0, "{volumes:?}");
    assert!((got.moves[0].axial - 3.0).abs() < 1e-6 && got.moves[0].depth <= 3.0);
}

/// Volumes, depths and widths of single moves against a grid sixteen times as fine.
#[test]
fn bounds_of_a_move_hold_against_a_finer_grid() {
    let mut rng = Rng::new(31);
    for round in 0..48 {
        let cutter = cutters()[round / 2 % 6];
        let end =
            |rng: &mut Rng| Point3::new(rng.within(4.0, 8.0), rng.within(4.0, 8.0), rng.within(-1.0, 1.0));
        let (a, mut b) = (end(&mut rng), end(&mut rng));
        let level = round % 2 == 0;
        if level {
            b.z = a.z;
        }
        let path = path_through([a, a, b]);
        let coarse = cut(&ZMap::block(square_grid(12.0, 0.32), 1.5), &cutter, &path);
        let fine = cut(&ZMap::block(square_grid(12.0, 0.02), 1.5), &cutter, &path);
        for (coarse, fine) in coarse.moves.iter().zip(&fine.moves) {
            let off = (coarse.volume - fine.volume).abs();
            assert!(off <= coarse.volume_bound + fine.volume_bound, "{cutter:?} {coarse:?} {fine:?}");
            // A rising cutter ends its cut in lips thinner than any cell.
            let off = (coarse.radial - fine.radial).abs();
            assert!(
                !level || off <= coarse.radial_bound + fine.radial_bound,
                "{cutter:?} {coarse:?} {fine:?}"
            );
        }
        let off = (coarse.volume() - fine.volume()).abs();
        assert!(off <= coarse.volume_bound + fine.volume_bound, "{cutter:?}");
    }
}

#[test]
fn a_rapid_in_stock_is_found_where_it_enters() {
    let through = |z: f64| {
        let mut path = path_through([Point3::new(-9.0, 5.0, z), Point3::new(9.0, 5.0, z)]);
        path.moves[0].kind = MoveKind::Rapid;
        path
    };
    let stock = ZMap::block(square_grid(10.0, 0.05), 3.0);
    assert_eq!(cut(&stock, &ball(), &through(3.0)).rapid_contacts, [], "on the top is not in the stock");
    let found = cut(&stock, &ball(), &through(1.0)).rapid_contacts;
    // 2 mm above the tip the ball has a radius of √8; the first column of cells stands at 0.025.
    assert_eq!(found.len(), 1);
    assert!((found[0].travel - (9.025 - 8f64.sqrt())).abs() < 1e-3, "{found:?}");
    assert!((found[0].at - Point3::new(0.025, 5.0, 3.0)).norm() < 0.03, "{found:?}");
    assert!((found[0].depth - 2.0).abs() < 1e-3);
    let mut again = through(1.0);
    again.moves.push(again.moves[0]);
    assert_eq!(cut(&stock, &ball(), &again).rapid_contacts.len(), 1, "the way back is free");
}

#[test]
fn small_and_empty_cases() {
    let one_cell = ZMap::block(Grid { origin: Point2::new(0.0, 0.0), cell: 0.1, nx: 1, ny: 1 }, 2.0);
    let nothing = cut(&one_cell, &ball(), &path_through([Point3::origin()]));
    assert_eq!((nothing.stock, nothing.moves.len()), (one_cell.clone(), 0));
    let plunge = path_through([Point3::new(0.0, 0.0, 9.0), Point3::new(0.0, 0.0, -1.0)]);
    let got = cut(&one_cell, &ball(), &plunge);
    assert_eq!((got.stock.height[0], got.stock.cut_by[0], got.moves[0].depth), (-1.0, 0, 3.0));
    let empty = ZMap::block(Grid { nx: 0, ny: 0, ..one_cell.grid }, 2.0);
    assert_eq!(cut(&empty, &ball(), &plunge).volume(), 0.0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn volumes_add_up_and_stock_never_grows(
        tips in prop::collection::vec((0.0..10.0f64, 0.0..10.0f64, -1.0..4.0f64), 2..30),
        cutter in prop::sample::select(cutters().to_vec()), top in -1.0..5.0f64, cell in 0.05..0.9f64,
    ) {
        let path = path_through(tips.into_iter().map(|(x, y, z)| Point3::new(x, y, z)));
        let stock = ZMap::block(square_grid(10.0, cell), top);
        let got = cut(&stock, &cutter, &path);
        let total = between(&stock, &got.stock);
        prop_assert!((got.volume() - total).abs() <= 1e-9 * total);
        for k in 0..stock.grid.len() {
            prop_assert!(got.stock.height[k] <= stock.height[k]);
            prop_assert_eq!(got.stock.cut_by[k] == NOT_CUT, got.stock.height[k] == stock.height[k]);
        }
        prop_assert!(got.moves.iter().all(|m| m.volume >= 0.0 && m.depth <= m.axial + 5.0));
    }
}
