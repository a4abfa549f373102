//! Clearances with closed forms, and against a dense replay.

use super::*;
use crate::scenes::{Rng, path_through, random_path};
use crate::swept::swept_height;
use cutter::HolderSection;
use geometry::Aabb;
use work::monitor::Silent;

const SHARP: f64 = 1e-9;

/// A shank of 6 mm for 4 mm, and a nut of 24 mm, the first `length` mm above the tip.
fn holder(length: f64) -> Holder {
    let section = |diameter, length| HolderSection { diameter, top_diameter: diameter, length };
    Holder::new(length - 4.0, vec![section(6.0, 4.0), section(24.0, 30.0)]).unwrap()
}

fn block(low: [f64; 3], high: [f64; 3]) -> Stock {
    Stock::Box(Aabb { min: Point3::from(low), max: Point3::from(high) })
}

fn flat() -> Cutter {
    Cutter::flat(6.0).unwrap()
}

fn of(block: &Stock, cutter: &Cutter, holder: &Holder, path: &Toolpath) -> StandingClearance {
    holder_clearance(block, &[], cutter, holder, path, &Silent).unwrap().unwrap()
}

/// A slot of 8 mm down from the top, along x.
fn slot() -> Toolpath {
    let at = |x: f64, z: f64| Point3::new(x, 20.0, z);
    path_through([at(-5.0, 15.0), at(-5.0, -8.0), at(45.0, -8.0), at(45.0, 15.0)])
}

#[test]
fn a_nut_over_standing_stock_is_as_clear_as_the_flute_is_longer_than_the_slot_is_deep() {
    let block = block([0.0, 0.0, -30.0], [40.0, 40.0, 0.0]);
    for clearance in [0.05, 1.0, 7.5] {
        let got = of(&block, &flat(), &holder(8.0 + clearance), &slot());
        let near = got.nearest.unwrap();
        assert!((near.distance - clearance).abs() <= got.error_bound + SHARP, "{clearance} {got:?}");
        assert!(got.error_bound <= (0.05 * clearance).max(0.011), "{got:?}");
        assert_eq!((near.section, near.at.z, got.collisions.len()), (1, 0.0, 0));
    }
    let far = of(&block, &flat(), &holder(19.0), &slot());
    assert_eq!((far.nearest, far.error_bound), (None, 0.0));
}

#[test]
fn a_nut_a_twentieth_of_a_millimetre_into_standing_stock_collides() {
    let block = block([0.0, 0.0, -30.0], [40.0, 40.0, 0.0]);
    let got = of(&block, &flat(), &holder(7.95), &slot());
    assert!((got.nearest.unwrap().distance + 0.05).abs() < 1e-6, "{got:?}");
    // The plunge stands beside the block with its nut over the block.
    assert_eq!(got.collisions, [0, 1, 2]);
}

/// Ground that a first pass lowers is no longer in the way of a second.
#[test]
fn what_is_cut_before_does_not_stand_any_more() {
    let block = block([0.0, 0.0, -30.0], [60.0, 5.0, 0.0]);
    let at = |x: f64, z: f64| Point3::new(x, 2.5, z);
    let depths = [-4.0, -8.0, -12.0];
    let deepening = depths.iter().flat_map(|&z| [at(-20.0, z), at(80.0, z), at(80.0, 20.0), at(-20.0, 20.0)]);
    let path = path_through(std::iter::once(at(-20.0, 20.0)).chain(deepening));
    let got = of(&block, &flat(), &holder(6.0), &path);
    // The block is no wider than the cutter, so that each level leaves its own floor only.
    assert!((got.nearest.unwrap().distance - 2.0).abs() <= got.error_bound + SHARP, "{got:?}");
    let at_once = path_through([at(-20.0, 20.0), at(-20.0, -12.0), at(80.0, -12.0)]);
    assert!(of(&block, &flat(), &holder(6.0), &at_once).nearest.unwrap().distance < 0.0);
}

/// A face mill of 40 mm that takes the top off makes way for the nut.
#[test]
fn what_another_cutter_took_before_does_not_stand() {
    let block = block([0.0, 0.0, -30.0], [40.0, 40.0, 0.0]);
    let at = |x: f64| Point3::new(x, 20.0, -5.0);
    let faced = (Cutter::flat(60.0).unwrap(), path_through([at(-40.0), at(80.0)]));
    let clearance = |before: &[(Cutter, Toolpath)]| {
        holder_clearance(&block, before, &flat(), &holder(7.0), &slot(), &Silent).unwrap().unwrap()
    };
    assert!(!clearance(&[]).collisions.is_empty());
    let got = clearance(&[faced]);
    // The nut is 7 mm above the tip, and 3 mm of the slot are left.
    assert!((got.nearest.unwrap().distance - 4.0).abs() <= got.error_bound + SHARP, "{got:?}");
}

/// Beside the block, as near as the pass lies.
#[test]
fn a_pass_beside_the_block_has_its_distance() {
    let block = block([0.0, 0.0, -30.0], [40.0, 40.0, 0.0]);
    let beside = |gap: f64| {
        let at = |y: f64, z: f64| Point3::new(-12.0 - gap, y, z);
        path_through([at(5.0, 15.0), at(5.0, -20.0), at(35.0, -20.0)])
    };
    for gap in [0.05, 2.0] {
        let got = of(&block, &flat(), &holder(9.0), &beside(gap));
        let near = got.nearest.unwrap();
        assert!((near.distance - gap).abs() <= got.error_bound + SHARP, "{gap} {got:?}");
        assert!(near.distance >= gap - SHARP && got.collisions.is_empty(), "{got:?}");
        assert!(got.error_bound <= (0.05 * gap).max(0.011), "{got:?}");
    }
    assert!(!of(&block, &flat(), &holder(9.0), &beside(-0.05)).collisions.is_empty());
    // One that rubs along the side is neither clear nor in it.
    let rubs = of(&block, &flat(), &holder(9.0), &beside(0.0));
    let distance = rubs.nearest.unwrap().distance;
    assert!(distance.abs() < 1e-3 && distance - rubs.error_bound <= 0.0, "{rubs:?}");
}

#[test]
fn a_shank_as_wide_as_the_cutter_stands_where_it_has_been() {
    let block = block([0.0, 0.0, -30.0], [40.0, 40.0, 0.0]);
    let shank = HolderSection { diameter: 6.0, top_diameter: 6.0, length: 90.0 };
    let shank = Holder::new(2.0, vec![shank]).unwrap();
    assert_eq!(holder_clearance(&block, &[], &flat(), &shank, &slot(), &Silent), Ok(None));
}

/// Columns of stock on a dense grid, and the holder at many times of each move.
fn by_brute_force(block: &Stock, cutter: &Cutter, holder: &Holder, path: &Toolpath, pitch: f64) -> f64 {
    let task = Task::new(block, cutter, holder, path);
    let block = block.bounds();
    let n = [0, 1].map(|axis| (block.size()[axis] / pitch).round() as usize);
    let place = |k: usize| {
        let (i, j) = (k % (n[0] + 1), k / (n[0] + 1));
        (block.min.x + i as f64 * pitch, block.min.y + j as f64 * pitch)
    };
    let mut heights = vec![block.max.z; (n[0] + 1) * (n[1] + 1)];
    let mut least = FAR;
    for (k, track) in task.tracks.iter().enumerate() {
        let before = heights.clone();
        for (c, height) in heights.iter_mut().enumerate() {
            let (x, y) = place(c);
            *height = height.min(swept_height(&task.form, track, x, y));
        }
        let (from, to) = (path.start_of(k), path.moves[k].to.tip);
        let standing = if track.length > 0.0 { &before } else { &heights };
        for (c, height) in standing.iter().enumerate() {
            let (x, y) = place(c);
            for t in 0..=20 {
                let tip = from + (to - from) * (f64::from(t) / 20.0);
                let rho = (x - tip.x).hypot(y - tip.y);
                for section in &task.sections {
                    least = least.min(section.distance_of_column(rho, height - tip.z));
                }
            }
        }
    }
    least
}

#[test]
fn a_dense_replay_finds_nothing_nearer() {
    let mut rng = Rng::new(31);
    let block = block([0.0, 0.0, -40.0], [8.0, 6.0, 0.0]);
    let (mut clear, mut colliding) = (0, 0);
    for round in 0..24 {
        let cutter = [Cutter::ball(6.0).unwrap(), flat(), Cutter::bull(6.0, 1.0).unwrap()][round % 3];
        let path = random_path(&mut rng, 12, 8.0);
        let sections = vec![
            HolderSection { diameter: 6.0, top_diameter: 6.0, length: 0.5 },
            HolderSection { diameter: 7.0, top_diameter: 12.0, length: 3.0 },
            HolderSection { diameter: 16.0, top_diameter: 10.0, length: 9.0 },
        ];
        let holder = Holder::new(rng.within(0.2, 2.5), sections).unwrap();
        let got = of(&block, &cutter, &holder, &path);
        let brute = by_brute_force(&block, &cutter, &holder, &path, 0.1);
        let found = got.nearest.map_or(FAR, |nearest| nearest.distance);
        if brute < 0.0 {
            // A place that the same move takes away may be gone when the section comes.
            assert!(found - got.error_bound <= 0.0, "{round}: {brute} {got:?}");
            colliding += 1;
        } else {
            assert!(found - got.error_bound <= brute + SHARP, "{round}: {brute} {got:?}");
            assert!(found >= brute - 0.15, "{round}: {brute} {got:?}");
            clear += 1;
        }
    }
    assert!(clear > 5 && colliding > 5, "{clear} clear, {colliding} not");
}

#[test]
fn threads_change_nothing_and_it_can_be_stopped() {
    struct Stop;
    impl Monitor for Stop {
        fn cancelled(&self) -> bool {
            true
        }
    }
    let mut rng = Rng::new(32);
    let block = block([0.0, 0.0, -40.0], [30.0, 30.0, 0.0]);
    let path = random_path(&mut rng, 300, 30.0);
    let (cutter, holder) = (Cutter::ball(6.0).unwrap(), holder(9.0));
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| of(&block, &cutter, &holder, &path))
    };
    assert_eq!(run(1), run(3));
    assert_eq!(holder_clearance(&block, &[], &cutter, &holder, &path, &Stop), Err(Cancelled));
    let nothing = path_through([Point3::origin()]);
    assert_eq!(of(&block, &cutter, &holder, &nothing), StandingClearance::default());
}

/// What was roughed before is not in the way of a holder that would run into the full block.
#[test]
fn a_roughed_block_is_as_low_as_it_was_left() {
    let at = Point3::new;
    let corners = vec![at(0.0, 0.0, -8.0), at(40.0, 0.0, -8.0), at(40.0, 40.0, -8.0), at(0.0, 40.0, -8.0)];
    let floor = geometry::TriangleMesh::new(corners, vec![[0, 1, 2], [0, 2, 3]]).unwrap().0;
    let whole = Aabb { min: at(0.0, 0.0, -30.0), max: at(40.0, 40.0, 0.0) };
    let roughed = Stock::roughed(whole, floor, 0.5);
    let got = of(&roughed, &flat(), &holder(6.0), &slot());
    // The nut is 6 mm above the floor, and half a millimetre stands on that.
    assert!((got.nearest.unwrap().distance - 5.5).abs() < got.error_bound + 0.02, "{got:?}");
    assert!(!of(&Stock::Box(whole), &flat(), &holder(6.0), &slot()).collisions.is_empty());
}
