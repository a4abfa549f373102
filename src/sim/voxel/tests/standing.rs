//! The holder against what still stands: planted collisions, the order of moves, and brute force.

use super::*;
use cutter::{Holder, HolderSection};
use std::collections::BTreeSet;

fn holder(cutting_length: f64, diameters: &[f64]) -> Holder {
    let section = |&diameter: &f64| HolderSection { diameter, top_diameter: diameter, length: 12.0 };
    Holder::new(cutting_length, diameters.iter().map(section).collect()).unwrap()
}

/// What runs into stock: a ball of 6 mm in a block of 24 × 16 × 10 mm whose top is z = 0.
fn found(path: &Toolpath, holder: &Holder, voxel: f64) -> StandingHits {
    let stock = block([0.0, 0.0, -10.0], [24.0, 16.0, 0.0]);
    let cutter = Solid::of_cutter(&Cutter::ball(6.0).unwrap(), Some(holder));
    let engine = VoxelEngine::new(&stock, &cutter, path).unwrap();
    engine.holder_in_stock(holder, path, voxel, &Silent).unwrap()
}

fn at(x: f64, z: f64) -> Point3 {
    Point3::new(x, 8.0, z)
}

#[test]
fn a_planted_collision_is_found_on_its_move_and_none_where_it_is_clear() {
    let wide = holder(7.0, &[6.0, 16.0]);
    let plunge =
        |depth: f64| path_through([at(-9.0, 20.0), at(12.0, 20.0), at(12.0, -depth), at(12.0, 20.0)]);
    // The second section begins 19 mm above the tip, the first one is no wider than the hole.
    let clear = found(&plunge(9.9), &wide, 0.2);
    assert_eq!((clear.moves.len(), clear.worst), (0, None));
    let short = holder(7.0, &[16.0]);
    assert_eq!(found(&plunge(6.95), &short, 0.2).worst, None);
    for (depth, voxel) in [(7.3, 0.15), (8.0, 0.3), (9.5, 0.3)] {
        let hits = found(&plunge(depth), &short, voxel);
        let worst = hits.worst.unwrap();
        assert_eq!((hits.moves, worst.move_index, worst.section), (vec![1], 1, 0));
        // Between the hole's wall and the holder's side nothing limits the depth but how far it came down.
        let over = depth - 7.0;
        assert!(worst.depth <= over + 1e-6 && worst.depth > over - 1.01 * voxel, "{worst:?} {over}");
        assert!(worst.at.z < 0.0 && worst.at.z > -over, "{worst:?}");
        let rho = (worst.at.x - 12.0).hypot(worst.at.y - 8.0);
        assert!(rho > 3.0 && rho < 8.0, "{worst:?}");
    }
}

#[test]
fn what_was_cut_before_is_in_nobodys_way() {
    // A holder 2 mm wider to each side, 4 mm above the tip, and a slot 6 mm deep.
    let holder = holder(4.0, &[10.0]);
    let beside = |y: f64| [Point3::new(-9.0, y, -3.0), Point3::new(33.0, y, -3.0)];
    let deep = [at(33.0, -6.0), at(-9.0, -6.0)];
    let wide: Vec<Point3> = [2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0].into_iter().flat_map(beside).collect();
    let first = path_through(wide.iter().copied().chain(deep));
    assert_eq!(found(&first, &holder, 0.25).worst, None);
    let second = path_through(deep.into_iter().chain(wide.iter().copied()));
    let hits = found(&second, &holder, 0.25);
    assert_eq!(hits.moves, [0]);
    assert!(hits.worst.unwrap().depth > 1.4, "{:?}", hits.worst);
}

#[test]
fn a_shank_as_wide_as_its_cutter_follows_it_on_the_same_move() {
    let shank = holder(4.0, &[6.0]);
    // The ball's round leaves the slot narrower up to 3 mm above its bottom.
    let levels = path_through([at(-9.0, -3.9), at(33.0, -3.9), at(33.0, -4.8), at(-9.0, -4.8)]);
    assert_eq!(found(&levels, &shank, 0.25).worst, None);
    let hole = path_through([at(12.0, 9.0), at(12.0, -9.0)]);
    assert_eq!(found(&hole, &shank, 0.25).worst, None);
    // Leaning forward it comes before the cutter that would have made way, leaning back after it.
    let axis = Vector3::new(0.6, 0.0, 0.8);
    let fed = |from: f64, to: f64| through(&[from, to].map(|x| ClPoint { tip: at(x, -3.0), axis }));
    assert!(found(&fed(-20.0, 33.0), &shank, 0.25).worst.is_some());
    assert_eq!(found(&fed(43.0, -12.0), &shank, 0.25).worst, None);
}

/// The moves that are the first with the holder at some sample at which stock stands.
#[test]
fn hits_are_those_of_brute_force() {
    let mut rng = Rng::new(77);
    let stock = block([0.0; 3], [10.0; 3]);
    let (voxel, shallow) = (0.5, 0.01);
    for cutter in [Cutter::ball(3.0).unwrap(), Cutter::bull(4.0, 1.0).unwrap()] {
        let holder = holder(5.0, &[3.0, 7.0]);
        let solid = Solid::of_cutter(&cutter, Some(&holder));
        let path = five_axis_path(&mut rng, 14);
        let engine = VoxelEngine::new(&stock, &solid, &path).unwrap();
        let hits = engine.holder_in_stock(&holder, &path, voxel, &Silent).unwrap();
        let swept = |solid| {
            let of = |k| SweptSolid::new(solid, &path.location_before(k), &path.moves[k].to).unwrap();
            (0..path.len()).map(of).collect::<Vec<_>>()
        };
        let sections = Solid::of_sections(&holder);
        let (cuts, sections) = (swept(&solid), [swept(&sections[0]), swept(&sections[1])]);
        let lattice = engine.lattice(voxel).unwrap().unwrap();
        let [nx, ny, nz] = lattice.size;
        let (mut sure, mut possible) = (BTreeSet::new(), BTreeSet::new());
        for at in (0..nx * ny * nz).map(|k| [k % nx, k / nx % ny, k / nx / ny]) {
            let q = lattice.place(at);
            if stock.foot(&q).0 > -shallow {
                continue;
            }
            for section in &sections {
                let first = |swept: &[SweptSolid<'_>], near: f64| {
                    swept.iter().position(|s| s.distance(&q).distance < near).map(|k| k as u32)
                };
                let Some(mine) = first(section, -shallow) else { continue };
                match first(&cuts, shallow) {
                    Some(theirs) if theirs < mine => {}
                    // Who is earlier on the same move only their times tell.
                    Some(theirs) if theirs == mine => drop(possible.insert(mine)),
                    _ => drop(sure.insert(mine)),
                }
            }
        }
        let told: BTreeSet<u32> = hits.moves.iter().copied().collect();
        assert!(sure.is_subset(&told) && !sure.is_empty(), "{cutter:?} {sure:?} {told:?}");
        assert!(told.difference(&sure).all(|k| possible.contains(k)), "{cutter:?} {sure:?} {told:?}");
        let worst = hits.worst.unwrap();
        let inside = -sections[worst.section][worst.move_index as usize].distance(&worst.at).distance;
        let before = cuts[..worst.move_index as usize].iter().map(|s| s.distance(&worst.at).distance);
        let stands = before.fold(-stock.foot(&worst.at).0, f64::min);
        assert!((worst.depth - 2.0 * inside.min(stands)).abs() < 1e-6, "{worst:?} {inside} {stands}");
    }
}
