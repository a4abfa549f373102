//! Volumes by move: against closed forms and the engine that keeps the order of upright tools.

use super::*;
use crate::{Grid, cut_in_order};
use geometry::Point2;

#[test]
fn the_sum_is_what_is_missing() {
    let mut rng = Rng::new(51);
    for (c, cutter) in cutters().iter().enumerate() {
        let solid = Solid::of_cutter(cutter, None);
        let stock = block([0.0; 3], [7.0, 6.5, 6.0]);
        let path = five_axis_path(&mut rng, 6);
        let engine = VoxelEngine::new(&stock, &solid, &path).unwrap();
        let missing = removed(&solid, &stock, &path, 0.1);
        let removal = engine.removal(0.1, &Silent).unwrap();
        let sum = removal.volume();
        // What is missing lies between proven bounds; the sum by moves is interpolated between voxels.
        assert!((sum - missing).abs() < 5e-3 * missing, "cutter {c}: {sum} {missing}");
        assert!((sum - missing).abs() < removal.volume_bound, "cutter {c}: {sum} {missing}");
        assert!(removal.moves.iter().all(|m| m.volume >= 0.0));
    }
}

#[test]
fn a_second_pass_takes_what_the_first_left() {
    let stock = block([0.0; 3], [10.0, 8.0, 5.0]);
    let flat = Solid::of_cutter(&Cutter::flat(6.0).unwrap(), None);
    let at = |x: f64, z: f64| Point3::new(x, 4.0, z);
    let path = path_through([at(-5.0, 3.5), at(15.0, 3.5), at(15.0, 2.9), at(-5.0, 2.9), at(15.0, 3.2)]);
    let by_move = VoxelEngine::new(&stock, &flat, &path).unwrap().removal(0.1, &Silent).unwrap().moves;
    let exact = [10.0 * 6.0 * 1.5, 0.0, 10.0 * 6.0 * 0.6, 0.0];
    for (got, exact) in by_move.iter().zip(exact) {
        let off = (got.volume - exact).abs();
        assert!(off < 1e-3 * 90.0 && off <= got.volume_bound, "{by_move:?}");
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
        let by_voxels = engine.removal(0.1, &Silent).unwrap();
        let (sum, expected) = (by_voxels.volume(), removal.volume());
        assert!((sum - expected).abs() < 2e-3 * expected, "{cutter:?}: {sum} {expected}");
        let bound = by_voxels.volume_bound + removal.volume_bound;
        assert!((sum - expected).abs() <= bound && bound < 0.05 * expected, "{cutter:?}: {bound} {expected}");
        for (k, (got, exact)) in by_voxels.moves.iter().zip(&removal.moves).enumerate() {
            let off = (got.volume - exact.volume).abs();
            assert!(off < 0.03 * exact.volume + 0.02, "{cutter:?} move {k}: {} {}", got.volume, exact.volume);
            assert!(off <= got.volume_bound + exact.volume_bound, "{cutter:?} move {k}: {got:?} {exact:?}");
            // A place that is seen lies within half a voxel of one that is cut, or a cell.
            assert!((got.axial - exact.axial).abs() < 0.2, "{cutter:?} move {k}: {got:?} {exact:?}");
        }
    }
}

/// A cylinder that leans by θ in the plane across its feed: its section is a strip from the bottom, slanting,
/// to the top.
#[test]
fn a_leaning_slot_has_the_section_of_its_closed_form() {
    let (radius, depth, lean, step) = (3.0, 4.0, 0.35f64, 1.3);
    let stock = block([-12.0, 0.0, -8.0], [12.0, 30.0, 0.0]);
    let flat = Solid::of_cutter(&Cutter::flat(2.0 * radius).unwrap(), None);
    let axis = Vector3::new(lean.sin(), 0.0, lean.cos());
    let at = |k: usize| ClPoint { tip: Point3::new(0.3, -5.0 + step * k as f64, -depth), axis };
    let path = through(&(0..32).map(at).collect::<Vec<_>>());
    let voxel = 0.15;
    let removal = VoxelEngine::new(&stock, &flat, &path).unwrap().removal(voxel, &Silent).unwrap();
    let section = 2.0 * radius * depth / lean.cos();
    let highest = (depth + radius * lean.sin()) / lean.cos();
    // Where all of the cutter has come in and nothing of it is out again.
    for m in &removal.moves[8..24] {
        let off = (m.volume - section * step).abs();
        assert!(off <= m.volume_bound && off < 0.01 * section * step, "{m:?} {}", section * step);
        assert!((m.radial - 2.0 * radius).abs() <= m.radial_bound, "{m:?}");
        assert!((m.axial - highest).abs() < 0.5 * 3f64.sqrt() * voxel, "{m:?} {highest}");
    }
    let off = (removal.volume() - section * 30.0).abs();
    assert!(off <= removal.volume_bound && off < 2e-3 * section * 30.0, "{} {}", removal.volume(), section);
    assert_eq!(removal.rapid_contacts, []);
}

#[test]
fn rapid_moves_are_told_where_they_cut_and_only_there() {
    let stock = block([0.0; 3], [20.0, 12.0, 5.0]);
    let flat = Solid::of_cutter(&Cutter::flat(6.0).unwrap(), None);
    let with = |height: f64| {
        let at = |x: f64, z: f64| Point3::new(x, 6.0, z);
        // A slot 2 mm deep half way in, back through it, and over the rest.
        let mut path =
            path_through([at(-4.0, 3.0), at(8.0, 3.0), at(-4.0, 3.0), at(-4.0, height), at(24.0, height)]);
        for k in [1, 2, 3] {
            path.moves[k].kind = MoveKind::Rapid;
        }
        VoxelEngine::new(&stock, &flat, &path).unwrap().removal(0.25, &Silent).unwrap().rapid_contacts
    };
    assert_eq!(with(5.001), []);
    let [contact] = with(4.6)[..] else { panic!() };
    assert_eq!(contact.move_index, 3);
    // Below the top by nearly 0.4, beyond the slot's round end, where the front meets it.
    assert!(contact.depth > 0.25 && contact.depth <= 0.4, "{contact:?}");
    assert!((contact.at.x - 8.0).hypot(contact.at.y - 6.0) > 2.8 && contact.at.z > 4.4, "{contact:?}");
    // The front comes to the slot's round end when the tip stands at x = 8.
    assert!((contact.travel - 12.0).abs() < 0.3, "{contact:?}");
    // Less than a voxel is told as well.
    let [contact] = with(4.99)[..] else { panic!() };
    assert!(contact.depth > 1e-3 && contact.depth < 0.02, "{contact:?}");
}

/// What a plane leaves of a cube is off by no more than the bound says, and for some plane nearly by that.
#[test]
fn shares_of_planes_are_off_by_what_is_said() {
    let n = 60;
    let at = |k: usize| (k as f64 + 0.5) / n as f64 - 0.5;
    let mut worst = 0f64;
    for normal in [[1.0, 1.0, 1.0], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0], [3.0, 2.0, 1.0], [2.0, 2.0, 1.0]] {
        let normal = Vector3::from(normal).normalize();
        for step in 0..=20 {
            let d = -0.9 + 0.09 * f64::from(step);
            let places = (0..n * n * n).map(|k| Vector3::new(at(k % n), at(k / n % n), at(k / n / n)));
            let left = places.filter(|q| q.dot(&normal) + d > 0.0).count() as f64 / (n * n * n) as f64;
            worst = worst.max((left - (0.5 + d).clamp(0.0, 1.0)).abs());
        }
    }
    assert!(worst > 0.045 && worst < super::super::removal::PLANE + 1e-3, "{worst}");
}
