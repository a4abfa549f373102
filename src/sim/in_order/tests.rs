//! The engine against the plain loop and against the one that forgets the order, and what any account
//! of removal must satisfy.

use super::*;
use crate::geometry::Point2;
use crate::monitor::Silent;
use crate::sim::cut_reference;
use crate::sim::scenes::{Rng, cutters, path_through, random_path, square_grid, wave_path};
use crate::toolpath::MoveKind;
use proptest::prelude::*;

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
