//! Paths in joints: sampled against the true motion, choices against brute force.

use super::*;
use motion::{Move, MoveKind, Toolpath};

/// A path of cuts through tilted locations.
fn path(stations: impl IntoIterator<Item = ([f64; 3], [f64; 3])>) -> Toolpath {
    let at = |(tip, axis): ([f64; 3], [f64; 3])| ClPoint {
        tip: Point3::from(tip),
        axis: Vector3::from(axis).normalize(),
    };
    let mut stations = stations.into_iter().map(at);
    let start = stations.next().unwrap();
    let moves = stations.map(|to| Move { to, kind: MoveKind::Cut, feed_rate: 1000.0, pass: 0 }).collect();
    Toolpath::new(start, moves)
}

fn tilted(tilt: f64, azimuth: f64) -> [f64; 3] {
    [tilt.sin() * azimuth.cos(), tilt.sin() * azimuth.sin(), tilt.cos()]
}

/// Checks that joints meet the path at its locations and stay within the tolerance between them.
fn check(machine: &Kinematics, path: &Toolpath, following: &Following) -> JointPath {
    let joints = follow(machine, path, following).unwrap();
    let mut last = (joints.start, path.start);
    assert!(close(&machine.forward(&joints.start), &path.start) < 2e-6);
    let mut reached = 0;
    for location in &joints.locations {
        let wanted = &location.at;
        assert!(close(&machine.forward(&location.joints), wanted) < 1e-9, "{location:?}");
        for k in 1..4 {
            if location.turn == Turn::Rewind {
                break;
            }
            let s = 0.25 * f64::from(k);
            let mix = Joints {
                linear: last.0.linear.lerp(&location.joints.linear, s),
                rotary: [0, 1].map(|k| last.0.rotary[k] + (location.joints.rotary[k] - last.0.rotary[k]) * s),
            };
            let (at, truth) = (machine.forward(&mix), last.1.towards(wanted, s));
            assert!(
                (at.tip - truth.tip).norm() <= following.tip,
                "{location:?} {}",
                (at.tip - truth.tip).norm()
            );
            let off = (at.axis - truth.axis).norm();
            assert!(off <= following.axis + 3e-6, "{off} {location:?}");
        }
        if location.turn == Turn::Along {
            // In the order of the path, on the path.
            assert!(location.step >= reached);
            reached = location.step;
        }
        last = (location.joints, *wanted);
    }
    // No two pieces in a row of a move could be one.
    for (k, pair) in joints.locations.windows(2).enumerate() {
        let begin = k.checked_sub(1).map_or(joints.start, |k| joints.locations[k].joints);
        if pair[0].step == pair[1].step && pair.iter().all(|at| at.turn == Turn::Along) {
            let [tip, axis] = refine::straying(machine, &begin, &pair[1].joints);
            assert!(tip > following.tip || axis > following.axis, "{pair:?}");
        }
    }
    for (k, step) in path.moves.iter().enumerate() {
        let end = joints.locations.iter().rfind(|l| l.step == k && l.turn == Turn::Along).unwrap();
        assert!(close(&end.at, &step.to) < 2e-6, "{k}");
    }
    joints
}

const FINE: Following = Following { tip: 1e-3, axis: 1e-4 };

#[test]
fn a_table_goes_round_and_round() {
    let stations = (0..=200).map(|k| {
        let azimuth = 0.1 * PI * f64::from(k);
        ([30.0 * azimuth.cos(), 30.0 * azimuth.sin(), 0.0], tilted(0.4, azimuth + 0.3))
    });
    let path = path(stations);
    let machine = Kinematics::by_name("ac-table").unwrap();
    let joints = check(&machine, &path, &FINE);
    let report = &joints.report;
    assert!((report.rotary_travel[0] - 10.0 * TAU).abs() < 1e-9, "{report:?}");
    // The chord of the tool's azimuth lets it rise: the second axis moves a little with each move.
    assert!(report.rewinds.is_empty() && report.violations.is_empty() && report.obstacle().is_none());
    let [least, greatest] = report.ranges[3];
    assert!((greatest - least - 10.0 * TAU).abs() < 1e-9);
    assert!(report.singular.is_empty());
    // Points for chords of 1 µm at 30 mm: √(8 h/r) rad a piece.
    let needed = 10.0 * TAU / (8.0 * 1e-3 / 30.0f64).sqrt();
    let given = joints.locations.len() as f64;
    assert!(given > needed && given < 2.5 * needed, "{given} {needed}");
    // A head with two turns has to unwind at the part, and says where.
    let head = Kinematics::by_name("ac-head").unwrap();
    let wound = check(&head, &path, &FINE);
    assert!(!wound.report.rewinds.is_empty() && wound.report.violations.is_empty());
    assert!(matches!(wound.report.obstacle(), Some(Obstacle::Rewind { .. })));
    assert!(wound.report.rewinds.len() <= 6, "{:?}", wound.report.rewinds);
    let at = wound.report.rewinds[0].step;
    assert!(wound.report.obstacle().unwrap().to_string().contains(&format!("before move {at} ")));
}

#[test]
fn unwinding_waits_for_clear_air() {
    // Five rounds, and after each a pair of rapids.
    let mut whole = path((0..=100).map(|k| {
        let azimuth = 0.1 * PI * f64::from(k);
        ([30.0, 0.1 * f64::from(k), 0.0], tilted(0.5, azimuth))
    }));
    for k in (19..99).step_by(20) {
        whole.moves[k].kind = MoveKind::Rapid;
        whole.moves[k + 1].kind = MoveKind::Rapid;
    }
    let machine = Kinematics::by_name("ac-head").unwrap();
    let joints = check(&machine, &whole, &FINE);
    assert!(!joints.report.rewinds.is_empty());
    for rewind in &joints.report.rewinds {
        assert!(rewind.clear && rewind.step % 20 == 0, "{rewind:?}");
    }
    assert!(joints.report.obstacle().is_none() && joints.report.violations.is_empty());
}

#[test]
fn through_a_singular_pose_the_cheaper_way_is_taken() {
    // Straight over the top, from y to −y, the pole inside of the second move.
    let over = path([
        ([0.0, 20.0, 0.0], tilted(0.5, FRAC_PI_2)),
        ([0.0, 10.0, 0.0], tilted(0.2, FRAC_PI_2)),
        ([0.0, -10.0, 0.0], tilted(0.3, -FRAC_PI_2)),
    ]);
    let machine = Kinematics::by_name("ac-table").unwrap();
    let joints = check(&machine, &over, &FINE);
    assert!(joints.report.rotary_travel[0] < 1e-9, "{:?}", joints.report);
    assert!((joints.report.rotary_travel[1] - 0.8).abs() < 1e-9);
    assert_eq!(joints.report.singular.len(), 1);
    assert!(joints.report.singular[0].step == 1 && joints.report.singular[0].angle < 1e-6);
    // A trunnion that tilts to one side only has to turn the table by half a turn at the pole.
    let [first, second] = *machine.axes();
    let one_sided = RotaryAxis { limits: Some([-0.05, 2.0]), ..second };
    let one_sided = Kinematics::new(first, one_sided, 100.0, Point3::new(3.0, 40.0, 0.0), [None; 3]).unwrap();
    let joints = check(&one_sided, &over, &FINE);
    assert!((joints.report.rotary_travel[0] - PI).abs() < 1e-6, "{:?}", joints.report);
    assert!(joints.locations.iter().any(|l| l.turn == Turn::AtPole) && joints.report.rewinds.is_empty());
    assert!(joints.report.obstacle().is_none());
    // Past it at a hundredth of a degree the table turns on the way.
    let by = path([([0.0, 10.0, 0.0], [0.0, 0.3, 1.0]), ([0.0, -10.0, 0.0], [2e-4, -0.3, 1.0])]);
    let joints = check(&one_sided, &by, &FINE);
    assert!((joints.report.rotary_travel[0] - PI).abs() < 2e-3, "{:?}", joints.report);
    assert!(joints.report.rewinds.is_empty());
}

#[test]
fn an_upright_path_turns_nothing() {
    let upright = path((0..20).map(|k| ([f64::from(k), f64::from(k * k), 1.0], [0.0, 0.0, 1.0])));
    for name in PRESETS {
        let machine = Kinematics::by_name(name).unwrap();
        let joints = check(&machine, &upright, &FINE);
        assert!(joints.locations.len() == 19 && joints.report.rotary_travel == [0.0; 2], "{name}");
        assert!(joints.start.rotary.iter().all(|angle| angle.abs() < 1e-9), "{name} {:?}", joints.start);
    }
}

#[test]
fn limits_that_cannot_be_kept_are_told() {
    let deep = path([
        ([0.0; 3], tilted(0.3, 0.0)),
        ([10.0, 0.0, 0.0], tilted(2.3, 0.0)),
        ([20.0, 0.0, 0.0], tilted(0.3, 0.0)),
    ]);
    let machine = Kinematics::by_name("ac-table").unwrap();
    let joints = check(&machine, &deep, &FINE);
    let [violation] = joints.report.violations[..] else { panic!("{:?}", joints.report) };
    assert!(violation.joint == 'A' && violation.step == 0 && (violation.value.abs() - 2.3).abs() < 1e-9);
    assert!((violation.limit.abs() - TAU / 3.0).abs() < 1e-12);
    let message = joints.report.obstacle().unwrap().to_string();
    assert!(message.contains("move 0 needs A at") && message.contains("120.000"), "{message}");
    // Travel of linear axes.
    let [first, second] = *machine.axes();
    let short = [Some([-5.0, 5.0]), None, None];
    let short = Kinematics::new(first, second, 100.0, Point3::origin(), short).unwrap();
    let along = path([([0.0; 3], [0.0, 0.0, 1.0]), ([7.0, 0.0, 0.0], [0.0, 0.0, 1.0])]);
    let report = check(&short, &along, &FINE).report;
    assert_eq!(report.violations, [LimitViolation { step: 0, joint: 'X', value: 7.0, limit: 5.0 }]);
    let nutating = Kinematics::by_name("nutating-head").unwrap();
    let error = follow(&nutating, &deep, &FINE).unwrap_err();
    assert!(matches!(error, PathError::Unreachable { step: 0, letter: 'C', .. }), "{error}");
    assert!(error.to_string().contains("0.000° to 90.000°"), "{error}");
    let round = path([([0.0; 3], [0.0, 0.0, 1.0]), ([1.0; 3], [0.0, 0.0, -1.0])]);
    assert_eq!(follow(&machine, &round, &FINE), Err(PathError::HalfTurn { step: 0 }));
    let none = path([([0.0; 3], [0.0, 0.0, 1.0])]);
    assert!(follow(&machine, &none, &FINE).unwrap().locations.is_empty());
}

/// A table far off its axis: between locations X bulges by an eighth of the square of the turn times the
/// distance. Where the rotary axes stand still, or all joints run evenly, it does not.
#[test]
fn linear_joints_that_bulge_between_locations_are_told() {
    let [first, second] = preset("ac-table").unwrap();
    let zero = Point3::new(300.0, 0.0, -200.0);
    let machine = |limits| Kinematics::new(first, second, 100.0, zero, limits).unwrap();
    let path = path((0..=4).map(|k| {
        let azimuth = 0.3 * (f64::from(k) - 2.5);
        ([f64::from(k), 0.2, 0.0], tilted(0.4, azimuth + FRAC_PI_2))
    }));
    let coarse = Following::with_tip_kept(10.0, 50.0);
    let free = machine([None; 3]);
    let joints = follow(&free, &path, &coarse).unwrap();
    let sampled = |share: f64, last: &(Joints, Point3), at: &JointLocation| {
        let rotary = [0, 1].map(|k| last.0.rotary[k] + (at.joints.rotary[k] - last.0.rotary[k]) * share);
        free.place(last.1 + (at.at.tip - last.1) * share, rotary).values()
    };
    let (mut last, mut truth) =
        ((joints.start, path.start.tip), joints.start.values().map(|value| [value; 2]));
    let mut at_locations = truth;
    for at in &joints.locations {
        for n in 0..=2000 {
            let values = sampled(f64::from(n) / 2000.0, &last, at);
            for (k, value) in values.into_iter().enumerate() {
                truth[k] = [truth[k][0].min(value), truth[k][1].max(value)];
                if n == 2000 {
                    at_locations[k] = [at_locations[k][0].min(value), at_locations[k][1].max(value)];
                }
            }
        }
        last = (at.joints, at.at.tip);
    }
    for (told, truth) in joints.report.ranges.iter().zip(&truth) {
        assert!((0..2).all(|side| (told[side] - truth[side]).abs() < 1e-5), "{told:?} {truth:?}");
    }
    let [bulge, greatest] = [truth[0][1] - at_locations[0][1], truth[0][1]];
    assert!(bulge > 0.1, "{bulge}");
    let limited = |limit: f64| machine([Some([-500.0, limit]), None, None]);
    let beyond = follow(&limited(greatest - 0.5 * bulge), &path, &coarse).unwrap().report;
    assert!(
        matches!(beyond.obstacle(), Some(Obstacle::Limit { violation }) if violation.joint == 'X'),
        "{beyond:?}"
    );
    assert!((beyond.violations[0].value - greatest).abs() < 1e-5);
    assert!(follow(&limited(greatest + 1e-5), &path, &coarse).unwrap().report.violations.is_empty());
}

/// No choice of ways and turns, tried by brute force over all of them, turns less.
#[test]
fn no_other_choice_turns_less() {
    let machine = Kinematics::by_name("bc-head").unwrap();
    let mut rng = sim::scenes::Rng::new(3);
    for _ in 0..20 {
        let stations: Vec<_> =
            (0..5).map(|_| ([0.0; 3], tilted(rng.within(0.05, 1.0), rng.within(-PI, PI)))).collect();
        let mut whole = path(stations);
        whole.moves.iter_mut().for_each(|m| m.kind = MoveKind::Rapid);
        let joints = check(&machine, &whole, &Following { tip: f64::INFINITY, axis: 0.1 });
        let apart = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).abs() + (a[1] - b[1]).abs();
        let price = |travel: f64, rewinds: usize, start: [f64; 2]| {
            travel + PI * rewinds as f64 + 1e-3 * (start[0].abs() + start[1].abs())
        };
        // From end to end of each move: what a joint does in between is the move's own.
        let (mut got, mut last) = (price(0.0, 0, joints.start.rotary), joints.start.rotary);
        for (k, location) in joints.locations.iter().enumerate() {
            let ends = joints.locations.get(k + 1).is_none_or(|next| {
                next.step != location.step || next.turn != Turn::Along || location.turn != Turn::Along
            });
            if ends {
                got += price(apart(last, location.joints.rotary), 0, [0.0; 2]);
                last = location.joints.rotary;
            }
        }
        got += price(0.0, joints.report.rewinds.len(), [0.0; 2]);
        // Each move on each side with each whole turn that its ends allow; its own turning is the same.
        let ends = |k: usize| [whole.location_before(k), whole.moves[k].to];
        let options = |k: usize| -> Vec<[[f64; 2]; 2]> {
            let [a, b] = ends(k).map(|at| machine.inverse(&at).unwrap().solutions);
            let mut all = Vec::new();
            for side in 0..2 {
                for m in -2..=2 {
                    let c = a[side].rotary[0] + TAU * f64::from(m);
                    let to = c + folded(b[side].rotary[0] - a[side].rotary[0]);
                    if c.abs() <= TAU && to.abs() <= TAU {
                        all.push([[c, a[side].rotary[1]], [to, b[side].rotary[1]]]);
                    }
                }
            }
            all
        };
        let mut best: Vec<([f64; 2], f64)> =
            options(0).iter().map(|[a, b]| (*b, price(apart(*a, *b), 0, *a))).collect();
        for k in 1..whole.len() {
            best = options(k)
                .iter()
                .map(|[a, b]| {
                    let over = |(from, cost): &([f64; 2], f64)| {
                        let turn = apart(*from, *a);
                        cost + turn + if turn > 1e-6 { PI } else { 0.0 } + apart(*a, *b)
                    };
                    (*b, best.iter().map(over).fold(f64::INFINITY, f64::min))
                })
                .collect();
        }
        let least = best.iter().map(|(_, cost)| *cost).fold(f64::INFINITY, f64::min);
        assert!((got - least).abs() < 1e-9, "{got} {least}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn any_path_is_followed(
        k in 0..PRESETS.len(),
        points in prop::array::uniform2(prop::array::uniform3(-100.0..100.0f64)),
        stations in prop::collection::vec(
            (prop::array::uniform3(-100.0..100.0f64), prop_oneof![Just(0.0), 0.0..1.5f64], -PI..PI), 2..6),
        all_joints in any::<bool>(),
    ) {
        let [mut first, mut second] = preset(PRESETS[k]).unwrap();
        (first.point, second.point) = (Point3::from(points[0]), Point3::from(points[1]));
        let machine = Kinematics::new(first, second, 120.0, Point3::new(10.0, 20.0, 30.0), [None; 3]).unwrap();
        let path = path(stations.iter().map(|(tip, tilt, azimuth)| (*tip, tilted(*tilt, *azimuth))));
        let following = if all_joints { Following::all_joints(0.01, 50.0) } else { Following::with_tip_kept(0.01, 50.0) };
        let joints = check(&machine, &path, &following);
        let times = joints.least_times(&machine, path.len());
        // Both joints at their rate take no longer than one after the other.
        let travel: f64 = joints.report.rotary_travel.iter().sum();
        let time: f64 = times.iter().sum();
        prop_assert!(time <= travel / DEFAULT_ROTARY_RATE + 1e-9 && time >= 0.5 * travel / DEFAULT_ROTARY_RATE - 1e-9);
    }
}
