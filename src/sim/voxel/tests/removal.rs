//! Volumes by move: against closed forms and the engine that keeps the order of upright tools.

use super::*;
use crate::geometry::Point2;
use crate::sim::{Grid, cut_in_order};

#[test]
fn the_sum_is_what_is_missing() {
    let mut rng = Rng::new(51);
    for (c, cutter) in cutters().iter().enumerate() {
        let solid = Solid::of_cutter(cutter, None);
        let stock = block([0.0; 3], [10.0, 9.0, 8.0]);
        let path = five_axis_path(&mut rng, 12);
        let engine = VoxelEngine::new(&stock, &solid, &path).unwrap();
        let missing = removed(&solid, &stock, &path, 0.2);
        let by_move = engine.removed_by_move(0.2, &Silent).unwrap();
        let sum: f64 = by_move.iter().sum();
        assert!((sum - missing).abs() < 5e-3 * missing, "cutter {c}: {sum} {missing}");
        assert!(by_move.iter().all(|&v| v >= 0.0));
    }
}

#[test]
fn a_second_pass_takes_what_the_first_left() {
    let stock = block([0.0; 3], [10.0, 8.0, 5.0]);
    let flat = Solid::of_cutter(&Cutter::flat(6.0).unwrap(), None);
    let at = |x: f64, z: f64| Point3::new(x, 4.0, z);
    let path = path_through([at(-5.0, 3.5), at(15.0, 3.5), at(15.0, 2.9), at(-5.0, 2.9), at(15.0, 3.2)]);
    let by_move = VoxelEngine::new(&stock, &flat, &path).unwrap().removed_by_move(0.1, &Silent).unwrap();
    let exact = [10.0 * 6.0 * 1.5, 0.0, 10.0 * 6.0 * 0.6, 0.0];
    for (got, exact) in by_move.iter().zip(exact) {
        assert!((got - exact).abs() < 1e-3 * 90.0, "{by_move:?}");
    }
}

#[test]
fn upright_moves_take_what_the_z_map_says() {
    let stock = block([0.0, 0.0, -6.0], [12.0, 12.0, 2.5]);
    let path = wave_path(12.0, 1.5, 1.3);
    let n = 240;
    let grid = Grid { origin: Point2::new(0.025, 0.025), cell: 12.0 / n as f64, nx: n, ny: n };
    for cutter in [Cutter::ball(6.0).unwrap(), Cutter::bull(6.0, 1.0).unwrap(), Cutter::flat(6.0).unwrap()] {
        let removal = cut_in_order(ZMap::block(grid, 2.5), &cutter, &path, &Silent).unwrap();
        let solid = Solid::of_cutter(&cutter, None);
        let engine = VoxelEngine::new(&stock, &solid, &path).unwrap();
        let by_move = engine.removed_by_move(0.1, &Silent).unwrap();
        let (sum, expected) = (by_move.iter().sum::<f64>(), removal.volume());
        assert!((sum - expected).abs() < 2e-3 * expected, "{cutter:?}: {sum} {expected}");
        for (k, (got, exact)) in by_move.iter().zip(&removal.moves).enumerate() {
            let off = (got - exact.volume).abs();
            assert!(off < 0.03 * exact.volume + 0.02, "{cutter:?} move {k}: {got} {}", exact.volume);
        }
    }
}
