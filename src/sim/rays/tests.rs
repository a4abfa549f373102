//! Rays against brute force, and what any ray must keep.

mod forms;

use super::*;
use crate::scenes::{Rng, cutters};
use crate::solid::tests::{axis, path_of, some_move, within};
use cutter::{Cutter, Holder, HolderSection};
use motion::ClPoint;
use work::monitor::Silent;

fn alone(cutter: &Cutter, path: &Toolpath) -> Rays {
    Rays::new(path, &Solid::of_cutter(cutter, None), &Silent).unwrap()
}

/// The least of the entries at many times, each by steps as long as the distance, and the best closer.
fn by_force(rays: &Rays, path: &Toolpath, p: &Point3, n: &Vector3, [low, high]: [f64; 2]) -> Option<f64> {
    let solid = rays.moves().solid();
    let entry = |k: usize, t: f64| {
        let pose = path.location_before(k).towards(&path.moves[k].to, t);
        let mut s = low;
        for _ in 0..20_000 {
            let distance = solid.distance(&pose.tip, &pose.axis, &(p + n * s));
            if distance < 1e-13 {
                return s;
            }
            s += distance;
            if s > high {
                return f64::INFINITY;
            }
        }
        s
    };
    let mut best = f64::INFINITY;
    for k in 0..path.len() {
        const STEPS: usize = 400;
        let time = |i: usize| i as f64 / STEPS as f64;
        let at: Vec<f64> = (0..=STEPS).map(|i| entry(k, time(i))).collect();
        let least = (0..=STEPS).min_by(|&i, &j| at[i].total_cmp(&at[j])).unwrap();
        best = best.min(at[least]);
        if at[least] > best + 0.05 || at[least] == f64::INFINITY {
            continue;
        }
        let (mut from, mut to) = (time(least.saturating_sub(1)), time((least + 1).min(STEPS)));
        while to - from > 1e-10 {
            let (a, b) = (from + 0.4 * (to - from), from + 0.6 * (to - from));
            if entry(k, a) < entry(k, b) { to = b } else { from = a }
        }
        best = best.min(entry(k, 0.5 * (from + to)));
    }
    (best < f64::INFINITY).then_some(best)
}

#[test]
fn rays_end_where_brute_force_ends() {
    let mut rng = Rng::new(3);
    let section = |diameter, top_diameter, length| HolderSection { diameter, top_diameter, length };
    let holder = Holder::new(3.0, vec![section(4.0, 4.0, 3.0), section(9.0, 6.0, 2.0)]).unwrap();
    let (mut hits, mut below) = (0, 0);
    for (c, cutter) in cutters().iter().enumerate() {
        for round in 0..8 {
            let solid =
                if round == 7 { Solid::of_tool(cutter, &holder) } else { Solid::of_cutter(cutter, None) };
            let moves = (2 * round..2 * round + 2).map(|kind| some_move(&mut rng, kind));
            let to: Vec<ClPoint> = moves.flat_map(|(from, to)| [from, to]).collect();
            let path = path_of(to[0], &to[1..]);
            let rays = Rays::new(&path, &solid, &Silent).unwrap();
            for _ in 0..30 {
                let (p, n) = (within(&mut rng, 14.0), axis(&mut rng, 3.0));
                let (inward, outward) = (rng.within(0.0, 3.0), rng.within(0.0, 12.0));
                let expected = by_force(&rays, &path, &p, &n, [-inward, outward]);
                let got = rays.deviation(&p, &n, inward, outward);
                let name = format!("cutter {c} round {round}: {got:?} {expected:?}");
                let Some(hit) = got else {
                    assert!(expected.is_none_or(|s| s > outward - 1e-9), "{name}");
                    continue;
                };
                hits += 1;
                below += usize::from(hit.s == -inward);
                // No lower than the tool is, and no higher than brute force finds it.
                let k = hit.index as usize;
                let pose = path.location_before(k).towards(&path.moves[k].to, hit.t);
                let there = solid.distance(&pose.tip, &pose.axis, &(p + n * hit.s));
                assert!(there < 2e-9 && (there > -2e-9 || hit.s == -inward), "{name}: {there}");
                assert!(hit.s <= expected.unwrap() + 1e-9, "{name}");
            }
        }
    }
    assert!(hits > 300 && below > 30 && below < hits - 150, "{hits} {below}");
}

fn turning_path(moves: usize) -> Toolpath {
    let mut rng = Rng::new(17);
    let at = |k: usize, rng: &mut Rng| {
        let (x, y) = (0.1 * (k % 200) as f64, 0.7 * (k / 200) as f64);
        ClPoint { tip: Point3::new(x, y, 0.3 * (x * 0.7).sin()), axis: axis(rng, 0.3) }
    };
    let to: Vec<ClPoint> = (0..=moves).map(|k| at(k, &mut rng)).collect();
    path_of(to[0], &to[1..])
}

#[test]
fn where_the_search_begins_does_not_matter() {
    let path = turning_path(1000);
    let mut rng = Rng::new(23);
    let points: Vec<Point3> = (0..3000)
        .map(|_| Point3::new(rng.within(0.0, 20.0), rng.within(-3.0, 6.0), rng.within(-0.5, 0.5)))
        .collect();
    let normals: Vec<Vector3> = points.iter().map(|_| axis(&mut rng, 0.3)).collect();
    for cutter in [Cutter::ball(3.0), Cutter::bull(3.0, 0.5), Cutter::flat(3.0)].map(Result::unwrap) {
        let rays = alone(&cutter, &path);
        let (mut seed, mut hits) = (None, 0);
        for (p, n) in points.iter().zip(&normals) {
            let alone = rays.deviation(p, n, 1.0, 2.0);
            let seeded = rays.deviation_near(p, n, [1.0, 2.0], seed);
            assert_eq!(alone.is_some(), seeded.is_some());
            if let (Some(a), Some((b, slot))) = (alone, seeded) {
                assert!((a.s - b.s).abs() < 1e-10 && a.index == b.index, "{a:?} {b:?}");
                (seed, hits) = (Some(slot), hits + 1);
            }
        }
        assert!(hits > 2000);
    }
}

/// Asks to stop from the beginning.
struct Impatient;

impl Monitor for Impatient {
    fn cancelled(&self) -> bool {
        true
    }
}

#[test]
fn rays_can_be_stopped_and_take_nothing() {
    let path = turning_path(10);
    let solid = Solid::of_cutter(&Cutter::ball(6.0).unwrap(), None);
    assert_eq!(Rays::new(&path, &solid, &Impatient).unwrap_err(), RaysError::Cancelled(Cancelled));
    let nowhere = Rays::new(&path_of(path.start, &[]), &solid, &Silent).unwrap();
    assert_eq!(nowhere.deviation(&Point3::origin(), &Vector3::z(), 1.0, 1.0), None);
    let around = ClPoint { tip: Point3::origin(), axis: -path.start.axis };
    let path = path_of(path.start, &[path.start, around]);
    let refused = Rays::new(&path, &solid, &Silent).unwrap_err();
    assert_eq!(refused, RaysError::Opposite(OppositeAxes { index: 1 }));
}

#[test]
fn of_equal_moves_the_first_wins() {
    let at = |x: f64| ClPoint::upright(Point3::new(x, 0.0, 0.0));
    let there_and_back = [1.0, 2.0, 3.0, 2.0, 1.0, 0.0, 1.0, 2.0, 3.0].map(at);
    let path = path_of(at(0.0), &there_and_back);
    for cutter in cutters() {
        let rays = alone(&cutter, &path);
        for (x, index) in [(0.5, 0), (1.0, 0), (1.5, 1), (2.0, 1), (2.5, 2), (3.0, 2)] {
            let hit = rays.deviation(&Point3::new(x, 0.0, 0.5), &Vector3::z(), 2.0, 2.0).unwrap();
            assert!((hit.s + 0.5).abs() < 1e-9, "{hit:?}");
            // A flat reaches every one of these places from the first move on, as far as it is wide.
            let flat = cutter.profile().bottom.sin == 0.0 && cutter.profile().bottom_end > 0.0;
            assert!(if flat { hit.index <= index } else { hit.index == index }, "{x} {hit:?} {cutter:?}");
        }
    }
}

#[test]
fn rapids_do_not_cut() {
    let at = |x: f64, z: f64| ClPoint::upright(Point3::new(x, 0.0, z));
    let mut path = path_of(at(0.0, 0.0), &[at(10.0, 0.0), at(10.0, -1.0), at(0.0, -1.0)]);
    path.moves[1].kind = MoveKind::Plunge;
    path.moves[2].kind = MoveKind::Rapid;
    let solid = Solid::of_cutter(&Cutter::ball(6.0).unwrap(), None);
    let p = Point3::new(4.0, 0.0, 0.0);
    let cut = Rays::new(&path, &solid, &Silent).unwrap().deviation(&p, &Vector3::z(), 3.0, 3.0).unwrap();
    assert!(cut.s.abs() < 1e-9 && cut.index == 0 && (cut.t - 0.4).abs() < 1e-4, "{cut:?}");
}

#[test]
fn far_from_the_origin_only_rounding_is_lost() {
    let path = turning_path(400);
    let away = Vector3::new(9e4, -7e4, 3e4);
    let mut far = path.clone();
    far.start.tip += away;
    far.moves.iter_mut().for_each(|m| m.to.tip += away);
    let mut rng = Rng::new(41);
    for cutter in [Cutter::ball(3.0), Cutter::bull(3.0, 0.5)].map(Result::unwrap) {
        let (near, far) = (alone(&cutter, &path), alone(&cutter, &far));
        for _ in 0..500 {
            let (p, n) = (Point3::new(rng.within(0.0, 20.0), rng.within(0.0, 2.0), 0.1), axis(&mut rng, 0.3));
            let a = near.deviation(&p, &n, 1.0, 2.0).unwrap();
            let b = far.deviation(&(p + away), &n, 1.0, 2.0).unwrap();
            assert!((a.s - b.s).abs() < 1e-9, "{p:?} {a:?} {b:?}");
        }
    }
}

#[test]
fn places_that_are_no_numbers_meet_nothing() {
    let rays = alone(&Cutter::bull(6.0, 1.0).unwrap(), &turning_path(20));
    let places = [f64::NAN, f64::INFINITY].map(|x| Point3::new(1.0, 0.0, x));
    for n in [Vector3::z(), Vector3::new(f64::NAN, 0.0, 1.0)] {
        for p in places {
            assert_eq!(rays.deviation(&p, &n, 1.0, 1.0), None);
            assert_eq!(rays.moves().nearest(&p, 1.0), None);
        }
    }
}

#[test]
fn boxes_bound_the_distance_from_all_tools_in_them() {
    let mut rng = Rng::new(43);
    let (mut nearest, mut balls) = (f64::INFINITY, 0);
    for (c, cutter) in cutters().iter().enumerate() {
        let solid = Solid::of_cutter(cutter, None);
        // Axes that differ little, and by up to a radian, and such that turn about a point.
        let widest = if c % 2 == 0 { 0.02 } else { 1.0 };
        let place = |k: usize, rng: &mut Rng| {
            let axis = axis(rng, widest);
            let tip = Point3::new(0.2 * k as f64, rng.within(0.0, 0.3), rng.within(0.0, 0.3));
            let about = Point3::new(4.0, 0.0, 0.0) - axis * solid.pivot();
            ClPoint { tip: if c % 3 == 0 { about } else { tip }, axis }
        };
        let to: Vec<ClPoint> = (0..40).map(|k| place(k, &mut rng)).collect();
        let rays = Rays::new(&path_of(to[0], &to[1..]), &solid, &Silent).unwrap();
        let (moves, tree) = (rays.moves(), rays.moves().tree().unwrap());
        for index in (0..tree.nodes_len()).filter(|&index| index != 1) {
            let node = tree.node(index);
            let slots = tree.slots_below(index);
            for _ in 0..6 {
                let point = Point3::new(rng.within(0.0, 8.0), rng.within(-2.0, 2.0), rng.within(-2.0, 1.0));
                let (low, high) = (rng.within(-3.0, 0.0), rng.within(0.0, 3.0));
                let ray = Ray { point, normal: axis(&mut rng, 1.0), low, high };
                let support = rays.support(&ray, index, node, 0, rng.within(low, high), [low, high]);
                balls += usize::from(support.lean < 1e-6);
                for &slot in &slots {
                    let part = moves.part(slot);
                    let t = rng.within(part.range[0], part.range[1]);
                    let s = rng.within(low, high);
                    let pose = moves.motion(part).at(t);
                    let distance = solid.distance(&pose.tip, &pose.axis, &ray.at(s));
                    let by = s - support.s;
                    let bound = support.value + support.rise * by - support.lean * by.abs();
                    assert!(distance > bound - 1e-9, "cutter {c} node {index}: {distance} {bound}");
                    nearest = nearest.min(distance - bound);
                }
            }
        }
    }
    assert!(nearest < 1e-2 && balls > 20, "bounds that are never near bound nothing: {nearest} {balls}");
}
