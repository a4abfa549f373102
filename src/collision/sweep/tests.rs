//! Moves against planted collisions and dense samples of the time.

use crate::samples::*;
use crate::*;
use cutter::{Cutter, Holder, HolderSection, Solid};
use geometry::{Point3, Vector3};
use motion::ClPoint;

/// A cylinder of 24 mm from 30 to 60 mm above the tip.
fn spindle() -> Solid {
    let sections = vec![HolderSection { diameter: 24.0, top_diameter: 24.0, length: 30.0 }];
    Solid::of_holder(&Holder::new(30.0, sections).unwrap())
}

#[test]
fn a_planted_tenth_of_a_millimetre_is_found_when_it_happens() {
    let ball = Solid::of_cutter(&Cutter::ball(6.0).unwrap(), None);
    let straight = [-20.0, 20.0].map(|x| ClPoint { tip: Point3::new(x, 0.0, 0.0), axis: Vector3::z() });
    let swing =
        [-0.3f64, 0.3].map(|a| ClPoint { tip: Point3::origin(), axis: Vector3::new(a.sin(), 0.0, a.cos()) });
    // A fin beside the ball's cylinder at x = 1, and a needle beside the swinging spindle at its highest.
    let fin = |y: f64| block([0.95, y, -50.0], [1.05, 10.0 + y, 50.0]);
    let needle = |y: f64| block([-0.05, y, 44.95], [0.05, 10.0 + y, 45.05]);
    let cases =
        [(&ball, straight, fin(2.9), fin(3.1), 0.525), (&spindle(), swing, needle(11.9), needle(12.1), 0.5)];
    for (solid, [from, to], (hit, hit_tree), (free, free_tree), t) in &cases {
        let worst = Obstacle::new(hit, hit_tree).swept_clearance(solid, from, to, 0.0).unwrap();
        assert!((worst.nearest.distance + 0.1).abs() < 0.0011, "{worst:?}");
        assert!((worst.t - t).abs() < 0.005, "{worst:?}");
        let ends = [from, to].map(|at| Obstacle::new(hit, hit_tree).some_nearer(solid, at, 0.0));
        assert_eq!(ends, [None; 2], "only the move collides");
        let free = Obstacle::new(free, free_tree);
        assert!(free.swept_clearance(solid, from, to, 0.0).is_none());
        assert!(free.swept_clearance(solid, from, to, 0.0999).is_none());
        let near = free.swept_clearance(solid, from, to, 0.1001).unwrap();
        assert!((near.nearest.distance - 0.1).abs() < 2e-5, "{near:?}");
    }
}

#[test]
fn sampled_times_find_nothing_worse() {
    let (field, tree) = sheet(40.0, 24, |x, y| 3.0 * (0.3 * x).sin() * (0.2 * y).cos());
    let wave = Obstacle::new(&field, &tree);
    let (solids, mut numbers) = (solids(), Numbers(12));
    let (mut clear, mut hit) = (0, 0);
    for round in 0..160 {
        let solid = &solids[round % solids.len()];
        let from = ClPoint {
            tip: numbers.point(6.0) + Vector3::z() * 6.0,
            axis: (numbers.direction() + Vector3::z() * 1.5).normalize(),
        };
        let axis = (from.axis + numbers.direction() * numbers.within(0.0, 0.8)).normalize();
        let to = ClPoint { tip: from.tip + numbers.direction() * numbers.within(0.0, 10.0), axis };
        let needed = numbers.within(-2.0, 4.0);
        let found = wave.swept_clearance(solid, &from, &to, needed);
        let sampled = (0..=100).filter_map(|k| {
            let at = from.towards(&to, f64::from(k) / 100.0);
            wave.clearance(solid, &at, needed).map(|c| c.distance)
        });
        let least = sampled.fold(needed, f64::min);
        let Some(found) = found else {
            clear += 1;
            assert!(least >= needed - 1e-5, "{round}: {least} {needed}");
            continue;
        };
        hit += 1;
        let there = wave.clearance(solid, &from.towards(&to, found.t), needed).unwrap();
        close(there.distance, found.nearest.distance);
        assert!(
            there.distance <= least + (0.011 * (needed - least)).max(1.1e-5),
            "{round}: {there:?} {least}"
        );
    }
    assert!(clear > 30 && hit > 30, "{clear} {hit}");
}

#[test]
fn sliding_along_a_surface_is_clear() {
    // Around the inside of a cylinder of 20 mm, tangent all the time: deep by chords of facets and moves
    // only.
    let (trough, tree) = sheet(30.0, 600, |_, y| 20.0 - (400.0 - y * y).sqrt());
    let trough = Obstacle::new(&trough, &tree);
    let cutter = Cutter::ball(6.0).unwrap();
    let ball = Solid::of_cutter(&cutter, None);
    let at = |a: f64| {
        let axis = Vector3::new(0.0, -0.5 * a.sin(), a.cos()).normalize();
        let centre = Point3::new(0.3, 17.0 * a.sin(), 20.0 - 17.0 * a.cos());
        ClPoint { tip: centre - axis * 3.0, axis }
    };
    for k in -5..5 {
        let (from, to) = (at(0.1 * f64::from(k)), at(0.1 * f64::from(k + 1)));
        // Chords of 1.7 mm lie off the circle by 21 µm, to its inside; facets of 0.05 mm by 16 nm.
        assert!(trough.swept_clearance(&ball, &from, &to, -2e-5).is_none(), "{k}");
        assert!(trough.swept_clearance(&ball, &from, &to, 1e-3).is_some(), "{k}");
    }
}

#[test]
fn a_turn_to_the_opposite_is_never_clear() {
    let (floor, tree) = sheet(10.0, 1, |_, _| 0.0);
    let from = ClPoint::upright(Point3::new(0.0, 0.0, 900.0));
    let to = ClPoint { axis: -from.axis, ..from };
    assert!(Obstacle::new(&floor, &tree).swept_clearance(&spindle(), &from, &to, 0.0).is_some());
}
