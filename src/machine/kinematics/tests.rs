//! Closed forms, both ways against each other, the frames against plain matrices.

mod paths;

use super::*;
use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion};
use proptest::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// The two ways to a location.
pub(super) struct Inverse {
    /// Joints with rotary angles from −π to π. Both are the same where the two ways meet.
    pub(super) solutions: [Joints; 2],
    /// True where the first rotary axis is free: any angle of it serves, zero is given.
    pub(super) free: bool,
}

impl Kinematics {
    /// The ways to a location, whatever the limits; `None` where the rotary axes cannot reach the tool axis.
    pub(super) fn inverse(&self, to: &ClPoint) -> Option<Inverse> {
        let solved = self.triangle.solve(&to.axis)?;
        let free = solved.from_pole < angles::SLACK;
        let solutions = [1.0, -1.0].map(|side| {
            let [first, second] = self.triangle.angles(solved.azimuth, &solved, side);
            let rotary = [if free { 0.0 } else { folded(first) }, folded(second)];
            self.place(to.tip, rotary)
        });
        Some(Inverse { solutions, free })
    }
}

/// Named machines with offset axes and a tilted workpiece zero, and any directions.
pub(super) fn machines() -> impl Strategy<Value = Kinematics> {
    let vector = || prop::array::uniform3(-1.0..1.0f64).prop_map(Vector3::from);
    let point = || prop::array::uniform3(-300.0..300.0f64).prop_map(Point3::from);
    let named = 0..PRESETS.len();
    (named, any::<bool>(), vector(), vector(), point(), point(), point(), 0.0..300.0f64).prop_filter_map(
        "no machine",
        |(k, is_named, u, v, p, q, zero, gauge)| {
            let [mut first, mut second] = preset(PRESETS[k])?;
            if !is_named {
                (first.direction, second.direction) = (u, v);
            }
            (first.point, second.point) = (p, q);
            (first.limits, second.limits) = (None, None);
            let machine = Kinematics::new(first, second, gauge, zero, [None; 3]).ok()?;
            let apart = |a: &Vector3, b: &Vector3| a.cross(b).norm() > 0.05;
            let [u, v] = machine.axes().map(|axis| axis.direction);
            (apart(&u, &v) && apart(&v, &Vector3::z())).then_some(machine)
        },
    )
}

fn close(a: &ClPoint, b: &ClPoint) -> f64 {
    (a.tip - b.tip).norm().max((a.axis - b.axis).norm())
}

/// Differences of angles up to whole turns.
fn same_angles(a: [f64; 2], b: [f64; 2]) -> f64 {
    let apart = |k: usize| folded(a[k] - b[k]).abs();
    apart(0).max(apart(1))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn the_inverse_leads_back(
        machine in machines(),
        angles in prop::array::uniform2(-PI..PI),
        near in prop_oneof![Just(1.0), Just(0.0), Just(1e-13), Just(1e-9), Just(1e-6), Just(1e-3)],
        shift in prop::array::uniform3(-500.0..500.0f64),
    ) {
        // Also close to singular poses and to the edges of reach.
        let rotary = [angles[0], machine.triangle.angles(0.0, &machine.triangle.solve(&machine.tool_axis([0.0; 2])).unwrap(), 1.0)[1]];
        let edge = rotary[1] + near * (angles[1] - rotary[1]);
        for second in [angles[1], edge] {
            let joints = Joints { linear: Vector3::from(shift), rotary: [angles[0], second] };
            let pose = machine.forward(&joints);
            prop_assert!((pose.axis.norm() - 1.0).abs() < 1e-14);
            let inverse = machine.inverse(&pose).unwrap();
            for solution in &inverse.solutions {
                let again = machine.forward(solution);
                prop_assert!(close(&again, &pose) < 1e-9, "{} {:?}", close(&again, &pose), solution);
                prop_assert!(solution.rotary.iter().all(|angle| angle.abs() <= PI + 1e-12));
            }
            // One of the two is where the pose came from. Angles are as good as the pose determines them.
            let solved = machine.triangle.solve(&pose.axis).unwrap();
            let condition = solved.from_pole.min(solved.turn.sin().abs());
            if condition > 1e-6 {
                let apart = |s: &Joints| same_angles(s.rotary, joints.rotary);
                let nearest = inverse.solutions.iter().map(apart).fold(f64::INFINITY, f64::min);
                prop_assert!(nearest < 1e-13 / condition, "{nearest} {condition}");
                let linear = inverse.solutions.iter().map(|s| (s.linear - joints.linear).norm());
                prop_assert!(linear.fold(f64::INFINITY, f64::min) < 1e-10 / condition);
            }
        }
    }

    /// The table is moved, then the tool, each by plain matrices, and the tip looked up in the table.
    #[test]
    fn frames_are_those_of_moved_bodies(
        machine in machines(),
        rotary in prop::array::uniform2(-PI..PI),
        shift in prop::array::uniform3(-500.0..500.0f64),
    ) {
        let about = |k: usize, angle: f64| {
            let RotaryAxis { direction, point, .. } = machine.axes()[k];
            let turn = UnitQuaternion::from_axis_angle(&Unit::new_normalize(direction), angle);
            Translation3::from(point.coords) * turn * Translation3::from(-point.coords)
        };
        let (mut table, mut head) = (Isometry3::identity(), Isometry3::identity());
        // Tables: the second carries the first and turns against the count. Heads: the first carries the
        // second.
        for k in [1, 0] {
            if machine.axes()[k].side == Side::Table {
                table *= about(k, -rotary[k]);
            }
        }
        for k in [0, 1] {
            if machine.axes()[k].side == Side::Head {
                head *= about(k, rotary[k]);
            }
        }
        let joints = Joints { linear: Vector3::from(shift), rotary };
        let tip = head * Point3::new(0.0, 0.0, -machine.gauge_length()) + joints.linear;
        let in_table = table.inverse() * tip - machine.workpiece_zero().coords;
        let axis = table.inverse() * (head * Vector3::z());
        let pose = machine.forward(&joints);
        prop_assert!((pose.tip - in_table).norm() < 1e-11);
        prop_assert!((pose.axis - axis).norm() < 1e-13);
        prop_assert!((machine.upward(rotary) - table.inverse() * Vector3::z()).norm() < 1e-13);
        let placed = machine.place(pose.tip, rotary);
        prop_assert!((placed.linear - joints.linear).norm() < 1e-10);
    }

    /// The bound holds at every share, and is no more than half as much again for small turns.
    #[test]
    fn straying_is_bounded(
        machine in machines(),
        rotary in prop::array::uniform2(-PI..PI),
        turn in prop::array::uniform2(-1.0..1.0f64),
        size in prop_oneof![Just(1.0), Just(0.1), Just(1e-2)],
        tips in prop::array::uniform2(prop::array::uniform3(-200.0..200.0f64)),
    ) {
        let from = machine.place(Point3::from(tips[0]), rotary);
        let there = Point3::from(tips[0]) + (Point3::from(tips[1]) - Point3::from(tips[0])) * size;
        let to = machine.place(there, [0, 1].map(|k| rotary[k] + size * turn[k]));
        let bounds = refine::straying(&machine, &from, &to);
        let ends = [&from, &to].map(|joints| machine.forward(joints));
        let mut worst = [0.0f64; 2];
        for k in 1..32 {
            let s = f64::from(k) / 32.0;
            let lerp = |a: f64, b: f64| a + (b - a) * s;
            let joints = Joints {
                linear: from.linear + (to.linear - from.linear) * s,
                rotary: [0, 1].map(|k| lerp(from.rotary[k], to.rotary[k])),
            };
            let (at, wanted) = (machine.forward(&joints), ends[0].towards(&ends[1], s));
            worst[0] = worst[0].max((at.tip - wanted.tip).norm());
            worst[1] = worst[1].max((at.axis - wanted.axis).norm());
        }
        // 1e-13 times the lengths is rounding.
        prop_assert!(worst[0] <= bounds[0] * (1.0 + 1e-9) + 1e-10, "tip {worst:?} {bounds:?}");
        prop_assert!(worst[1] <= bounds[1] * (1.0 + 1e-9) + 1e-13, "axis {worst:?} {bounds:?}");
        if size < 0.05 && worst[0] > 1e-3 {
            prop_assert!(bounds[0] < 1.5 * worst[0] + 1e-3, "{worst:?} {bounds:?}");
        }
    }
}

#[test]
fn named_machines_tilt_as_machinists_know_them() {
    for name in PRESETS {
        let machine = Kinematics::by_name(name).unwrap();
        assert_eq!(machine.tool_axis([0.0; 2]), Vector3::z(), "{name}");
        let swings_down = machine.reach()[1] >= FRAC_PI_2 - 1e-12 || name.contains("nutating");
        assert!(swings_down, "{name}");
    }
    assert!(Kinematics::by_name("ad-table").is_none());
    let tilt = 0.3f64;
    // A tilts the tool towards −y, B towards x; C turns it from x to y.
    let ac = Kinematics::by_name("ac-table").unwrap();
    assert!((ac.tool_axis([0.0, tilt]) - Vector3::new(0.0, -tilt.sin(), tilt.cos())).norm() < 1e-15);
    let bc = Kinematics::by_name("bc-head").unwrap();
    assert!((bc.tool_axis([0.0, tilt]) - Vector3::new(tilt.sin(), 0.0, tilt.cos())).norm() < 1e-15);
    let turned = Vector3::new(tilt.sin() * 0.5f64.cos(), tilt.sin() * 0.5f64.sin(), tilt.cos());
    assert!((bc.tool_axis([0.5, tilt]) - turned).norm() < 1e-15);
    // Half a turn about the axis at 45° lays the tool level.
    let nutating = Kinematics::by_name("nutating-table").unwrap();
    assert!((nutating.tool_axis([0.0, PI]) - Vector3::y()).norm() < 1e-15);
    assert!((nutating.reach()[1] - FRAC_PI_2).abs() < 1e-15);
}

#[test]
fn a_fork_head_moves_its_pivot_over_the_tip() {
    let [first, mut second] = preset("bc-head").unwrap();
    second.point = Point3::new(0.0, 0.0, 100.0);
    let machine = Kinematics::new(first, second, 50.0, Point3::origin(), [None; 3]).unwrap();
    // Tool level along x: the pivot stands 150 mm from the tip along x, the nose at zero 100 below it.
    let level = ClPoint { tip: Point3::origin(), axis: Vector3::x() };
    let inverse = machine.inverse(&level).unwrap();
    let [way, other] = inverse.solutions;
    assert!((way.linear - Vector3::new(150.0, 0.0, -100.0)).norm() < 1e-12, "{way:?}");
    assert!(
        same_angles(way.rotary, [0.0, FRAC_PI_2]) < 1e-12
            || same_angles(other.rotary, [0.0, FRAC_PI_2]) < 1e-12
    );
    assert!(!inverse.free);
    let upright = machine.inverse(&ClPoint::upright(Point3::new(1.0, 2.0, 3.0))).unwrap();
    assert!(upright.free && (upright.solutions[0].linear - Vector3::new(1.0, 2.0, 53.0)).norm() < 1e-12);
}

#[test]
fn what_is_no_machine_is_refused_with_a_cure() {
    let [first, second] = preset("ac-table").unwrap();
    let make = |first, second| Kinematics::new(first, second, 100.0, Point3::origin(), [None; 3]);
    let refused = |first, second, what: &str| {
        let error = make(first, second).unwrap_err();
        assert!(error.to_string().contains(what) && !error.cure().is_empty(), "{error}");
    };
    let along =
        |axis: RotaryAxis, direction: [f64; 3]| RotaryAxis { direction: Vector3::from(direction), ..axis };
    for none in [[0.0; 3], [f64::NAN, 0.0, 1.0], [f64::INFINITY, 0.0, 0.0]] {
        refused(along(first, none), second, "axis C is not a direction");
        refused(first, along(second, none), "axis A is not a direction");
    }
    assert!(make(along(first, [0.0, 0.0, 1e-200]), along(second, [1e200, 1e190, 0.0])).is_ok());
    refused(along(first, [-2.0, 1e-9, 0.0]), second, "C and A are parallel");
    refused(along(first, [0.0, 1.0, 0.0]), along(second, [0.0, 0.0, -3.0]), "parallel to the spindle");
    refused(RotaryAxis { side: Side::Head, ..first }, second, "comes before the table's");
    refused(first, RotaryAxis { letter: 'C', ..second }, "cannot be called C and C");
    refused(first, RotaryAxis { letter: 'U', ..second }, "cannot be called C and U");
    for limits in [[1.0, 1.0], [1.0, -1.0], [f64::NAN, 1.0], [0.0, f64::INFINITY]] {
        refused(first, RotaryAxis { limits: Some(limits), ..second }, "limits of joint A");
    }
    for rate in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        refused(RotaryAxis { rate, ..first }, second, "rotary rate");
    }
    refused(RotaryAxis { point: Point3::new(0.0, f64::NAN, 0.0), ..first }, second, "point of a rotary axis");
    assert!(Kinematics::new(first, second, f64::NAN, Point3::origin(), [None; 3]).is_err());
    assert!(Kinematics::new(first, second, 0.0, Point3::new(f64::NAN, 0.0, 0.0), [None; 3]).is_err());
}

/// LinuxCNC's `xyzac-trt-kins` and `xyzbc-trt-kins`: a point of the workpiece turns by C about the table's
/// axis, then by A or B about the trunnion's, each as the table itself turns. That is the other way round
/// than ISO 841 counts.
#[test]
fn tables_with_trunnions_are_those_of_linuxcnc_turned_round() {
    let (centre, trunnion) = (Vector3::new(12.0, -7.0, 0.0), Vector3::new(5.0, 9.0, -40.0));
    for (name, across) in [("ac-table", Vector3::x()), ("bc-table", Vector3::y())] {
        let [mut first, mut second] = preset(name).unwrap();
        // The trunnion's own offset lies across it.
        let offset = trunnion - across * across.dot(&trunnion);
        first.point = Point3::from(centre);
        second.point = Point3::from(centre + offset);
        let ours = Kinematics::new(first, second, 0.0, Point3::origin(), [None; 3]).unwrap();
        (first.direction, second.direction) = (-first.direction, -second.direction);
        let theirs = Kinematics::new(first, second, 0.0, Point3::origin(), [None; 3]).unwrap();
        for k in 0..200 {
            let [c, tilt] = [0.37 * f64::from(k), 0.011 * f64::from(k) - 1.0];
            let p = Vector3::new(f64::from(k % 11) * 9.0, f64::from(k % 7) - 30.0, f64::from(k % 5) * 8.0);
            // Rows of both turns, written out.
            let from = p - centre;
            let level = Vector3::new(
                c.cos() * from.x - c.sin() * from.y,
                c.sin() * from.x + c.cos() * from.y,
                from.z,
            );
            let v = level - offset;
            let (sin, cos) = tilt.sin_cos();
            let tilted = if across.x == 1.0 {
                Vector3::new(v.x, cos * v.y - sin * v.z, sin * v.y + cos * v.z)
            } else {
                Vector3::new(cos * v.x + sin * v.z, v.y, cos * v.z - sin * v.x)
            };
            let expected = tilted + offset + centre;
            let got = theirs.place(Point3::from(p), [c, tilt]).linear;
            assert!((got - expected).norm() < 1e-9, "{name}: {got} {expected}");
            let got = ours.place(Point3::from(p), [-c, -tilt]).linear;
            assert!((got - expected).norm() < 1e-9, "{name}: {got} {expected}");
        }
    }
}
