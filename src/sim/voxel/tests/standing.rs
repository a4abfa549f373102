//! The holder against what still stands: contacts planted at 0.05 mm, the order of moves, and brute force.

use super::*;
use crate::standing::{FAR, StandingClearance};
use cutter::{Holder, HolderSection};
use work::monitor::{Cancelled, Monitor};

fn holder(cutting_length: f64, diameters: &[f64]) -> Holder {
    let section = |&diameter: &f64| HolderSection { diameter, top_diameter: diameter, length: 12.0 };
    Holder::new(cutting_length, diameters.iter().map(section).collect()).unwrap()
}

/// How near a holder comes: a ball of 6 mm in a block of 24 × 16 × 10 mm whose top is z = 0.
fn found(path: &Toolpath, holder: &Holder) -> StandingClearance {
    found_after(&[], path, holder)
}

fn found_after(before: &[(Cutter, Toolpath)], path: &Toolpath, holder: &Holder) -> StandingClearance {
    let stock = block([0.0, 0.0, -10.0], [24.0, 16.0, 0.0]);
    let ball = Cutter::ball(6.0).unwrap();
    let solid = Solid::of_cutter(&ball, Some(holder));
    let engine = VoxelEngine::new(&stock, &solid, path).unwrap();
    engine.holder_clearance(before, &ball, holder, path, &Silent).unwrap()
}

fn at(x: f64, z: f64) -> Point3 {
    Point3::new(x, 8.0, z)
}

/// Its least distance is that, to a bound that decides.
fn is_near(got: &StandingClearance, clearance: f64) {
    let near = got.nearest.unwrap();
    let told = near.distance - clearance;
    match clearance > 0.0 {
        true => {
            assert!(told >= -1e-6 && told <= got.error_bound, "{clearance} {got:?}");
            assert!(got.error_bound < clearance && got.collisions.is_empty(), "{clearance} {got:?}");
        }
        // At least so deep.
        false => assert!(near.distance < 0.0 && told >= -1e-6 && !got.collisions.is_empty(), "{got:?}"),
    }
}

#[test]
fn planted_contacts_are_found_and_planted_clearances_pass() {
    for axis in [Vector3::z(), Vector3::new(0.6, 0.0, 0.8), Vector3::new(0.28, -0.5376, 0.7953)] {
        let axis = axis.normalize();
        // Down along its axis until the holder's rim is so far above the top of the block.
        let lowest = 4.0 * (1.0 - axis.z * axis.z).sqrt();
        for clearance in [0.05, 1.0, -0.05, -0.5] {
            let tip = at(12.0, clearance + lowest) - Vector3::z() * (7.0 * axis.z);
            let path = through(&[20.0, 0.0].map(|far| ClPoint { tip: tip + axis * far, axis }));
            let got = found(&path, &holder(7.0, &[8.0]));
            is_near(&got, clearance);
            if clearance == 0.05 {
                assert!(got.error_bound <= 0.01 + 2e-3, "{got:?}");
            }
        }
    }
}

#[test]
fn what_was_cut_before_is_in_nobodys_way() {
    // A holder 2 mm wider to each side, 4 mm above the tip, and a slot 6 mm deep.
    let holder = holder(4.0, &[10.0]);
    let beside = |y: f64| [Point3::new(-9.0, y, -3.0), Point3::new(33.0, y, -3.0)];
    let deep = [at(33.0, -6.0), at(-9.0, -6.0)];
    let wide: Vec<Point3> = [2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0].into_iter().flat_map(beside).collect();
    let first = found(&path_through(wide.iter().copied().chain(deep)), &holder);
    assert!(first.nearest.unwrap().distance > first.error_bound, "{first:?}");
    let second = found(&path_through(deep.into_iter().chain(wide.iter().copied())), &holder);
    assert!(second.nearest.unwrap().distance < -1.4 && second.collisions.contains(&0), "{second:?}");
    // By another tool.
    let ball = Cutter::ball(6.0).unwrap();
    let after = found_after(&[(ball, path_through(wide))], &path_through(deep), &holder);
    assert!(after.nearest.unwrap().distance > after.error_bound, "{after:?}");
}

#[test]
fn a_shank_as_wide_as_its_cutter_follows_it_on_the_same_move() {
    let shank = holder(4.0, &[6.0]);
    let collides = |path: &Toolpath| {
        let got = found(path, &shank);
        let nearest = got.nearest.unwrap().distance;
        assert!(nearest < 0.0 || nearest >= got.error_bound, "{got:?}");
        nearest < 0.0
    };
    // The ball's round leaves the slot narrower up to 3 mm above its bottom.
    assert!(!collides(&path_through([at(-9.0, -3.9), at(33.0, -3.9), at(33.0, -4.8), at(-9.0, -4.8)])));
    assert!(!collides(&path_through([at(12.0, 9.0), at(12.0, -9.0)])));
    // Leaning forward it comes before the cutter that would have made way, leaning back after it.
    let axis = Vector3::new(0.6, 0.0, 0.8);
    let fed = |from: f64, to: f64| through(&[from, to].map(|x| ClPoint { tip: at(x, -3.0), axis }));
    assert!(collides(&fed(-20.0, 33.0)));
    assert!(!collides(&fed(43.0, -12.0)));
}

/// Samples of the stock, each with the first move on which the cutter covers it.
#[test]
fn no_sample_that_stands_is_nearer() {
    let mut rng = Rng::new(77);
    let stock = block([0.0; 3], [10.0; 3]);
    let (mut clear, mut colliding) = (0, 0);
    for round in 0..16 {
        let cutter = [Cutter::ball(3.0).unwrap(), Cutter::bull(4.0, 1.0).unwrap()][round % 2];
        let holder = holder(5.0 + (round / 2) as f64, &[3.0, 7.0]);
        let solid = Solid::of_cutter(&cutter, Some(&holder));
        let path = five_axis_path(&mut rng, 14);
        let engine = VoxelEngine::new(&stock, &solid, &path).unwrap();
        let got = engine.holder_clearance(&[], &cutter, &holder, &path, &Silent).unwrap();
        let swept = |solid| {
            let of = |k| SweptSolid::new(solid, &path.location_before(k), &path.moves[k].to).unwrap();
            (0..path.len()).map(of).collect::<Vec<_>>()
        };
        let sections = Solid::of_sections(&holder);
        let (cuts, swept_sections) = (swept(&solid), [swept(&sections[0]), swept(&sections[1])]);
        let rub = |section: usize| if section == 0 { 0.01 } else { 0.0 };
        let cut_at =
            |q: &Point3| cuts.iter().position(|s| s.distance(q).distance < 0.0).unwrap_or(path.len());
        let mut least = FAR;
        for k in 0..21 * 21 * 21 {
            let q = Point3::from([k % 21, k / 21 % 21, k / 441].map(|i| 0.5 * f64::from(i)));
            let cut = cut_at(&q);
            for (section, swept) in swept_sections.iter().enumerate() {
                // On the move that cuts it only their times tell.
                let nearest = swept.iter().take(cut).map(|s| s.distance(&q).distance);
                least = nearest.map(|distance| distance + rub(section)).fold(least, f64::min);
            }
        }
        let near = got.nearest.unwrap();
        if near.distance < 0.0 {
            assert!(least >= 1.1 * near.distance - 0.002, "{round} {least} {got:?}");
            colliding += 1;
        } else {
            assert!(least >= near.distance - got.error_bound, "{round} {least} {got:?}");
            clear += 1;
        }
        let there = swept_sections[near.section][near.move_index as usize].distance(&near.at).distance;
        assert!(near.distance >= there + rub(near.section) - 1e-6, "{there} {got:?}");
        assert!(cut_at(&near.at) >= near.move_index as usize && stock.foot(&near.at).0 <= 0.0, "{got:?}");
    }
    assert!(clear > 2 && colliding > 2, "{clear} clear, {colliding} not");
}

#[test]
fn threads_change_nothing_and_it_can_be_stopped() {
    struct Stop;
    impl Monitor for Stop {
        fn cancelled(&self) -> bool {
            true
        }
    }
    let mut rng = Rng::new(78);
    let stock = block([0.0; 3], [10.0; 3]);
    let (path, holder, ball) =
        (five_axis_path(&mut rng, 14), holder(9.0, &[7.0]), Cutter::ball(3.0).unwrap());
    let solid = Solid::of_cutter(&ball, Some(&holder));
    let engine = VoxelEngine::new(&stock, &solid, &path).unwrap();
    let run = |monitor: &dyn Monitor| engine.holder_clearance(&[], &ball, &holder, &path, monitor);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run(&Silent).unwrap())
    };
    assert_eq!(on(1), on(3));
    assert_eq!(run(&Stop), Err(VoxelError::Cancelled(Cancelled)));
}
