//! The engine against a plain double loop. What every engine must keep is tested in
//! `engine_tests`.

use super::*;
use crate::Grid;
use crate::scenes::{Rng, cutters, random_path, square_grid, wave_path};
use crate::swept::tests::brute_height;
use work::monitor::Silent;

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
        let envelope = crate::Envelope::new(cutter, &path);
        let all: Vec<u32> = (0..path.len() as u32).collect();
        for k in 0..stock.grid.len() {
            let p = stock.grid.centre(k % stock.grid.nx, k / stock.grid.nx);
            let (height, by) = envelope.lowest(p.x, p.y, &all).unwrap();
            let expected = if (height as f32) < 5.0 { (height as f32, by) } else { (5.0, NOT_CUT) };
            assert_eq!((got.height[k], got.cut_by[k]), expected, "{cutter:?} at {p}");
        }
    }
}
