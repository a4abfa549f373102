//! Poses against the forward kinematics, and stretches against dense samples of the joints.

use super::super::PRESETS;
use super::super::tests::machines;
use super::*;
use proptest::prelude::*;

fn links() -> [Link; 4] {
    [Link::Frame, Link::Linear, Link::Rotary(0), Link::Rotary(1)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn the_tool_stands_in_the_workpiece_where_the_joints_bring_it(
        machine in machines(),
        rotary in prop::array::uniform2(-4.0..4.0f64),
        shift in prop::array::uniform3(-500.0..500.0f64),
    ) {
        let chain = Chain::of(&machine);
        let joints = Joints { linear: Vector3::from(shift), rotary };
        let seen = chain.pose(chain.of_workpiece(), &joints).inverse() * chain.pose(chain.of_tool(), &joints);
        let at = machine.forward(&joints);
        let tip = seen * chain.tip() - chain.workpiece_zero().coords;
        prop_assert!((tip - at.tip).norm() < 1e-10, "{tip} {}", at.tip);
        prop_assert!((seen * Vector3::z() - at.axis).norm() < 1e-13);
    }

    /// Of each pair of links, whether the tip or the axes run straight.
    #[test]
    fn bodies_stray_no_farther_than_told(
        machine in machines(),
        rotary in prop::array::uniform2(-3.0..3.0f64),
        turn in prop::array::uniform2(-1.5..1.5f64),
        size in prop_oneof![Just(1.0), Just(0.1), Just(0.01)],
        tips in prop::array::uniform2(prop::array::uniform3(-200.0..200.0f64)),
        middle in prop::array::uniform3(-300.0..300.0f64),
        away in prop::array::uniform3(-1.0..1.0f64),
        keeps_tip in any::<bool>(),
    ) {
        let chain = Chain::of(&machine);
        let way = if keeps_tip { Way::Tip } else { Way::Axes };
        let there = Point3::from(tips[0]) + (Point3::from(tips[1]) - Point3::from(tips[0])) * size;
        let program = [
            machine.place(Point3::from(tips[0]), rotary),
            machine.place(there, [0, 1].map(|k| rotary[k] + size * turn[k])),
        ]
        .map(|joints| Waypoint { joints, step: 7, way, pace: Pace::default() });
        let (middle, reach) = (Point3::from(middle), 150.0);
        let place = middle + Vector3::from(away).normalize() * reach;
        for link in links() {
            for other in links() {
                if link == other || chain.side(other) == Side::Head {
                    continue;
                }
                let moves = chain.motion(&program, [link, other], &middle, reach);
                let mut worst = 0.0f64;
                for (k, part) in moves.iter().enumerate() {
                    let [from, to] = part.ends;
                    let spin = (to.rotation * from.rotation.inverse()).scaled_axis();
                    for i in 1..4 {
                        let s = f64::from(i) / 4.0;
                        let share = (k as f64 + s) / moves.len() as f64;
                        let joints = chain.between(&program[0], &program[1], share);
                        let seen = chain.pose(other, &joints).inverse() * chain.pose(link, &joints) * place;
                        let turned = UnitQuaternion::from_scaled_axis(spin * s) * from.rotation;
                        let ends = part.ends.map(|end| end * middle);
                        let simple = ends[0] + (ends[1] - ends[0]) * s + turned * (place - middle);
                        worst = worst.max((seen - simple).norm());
                    }
                }
                prop_assert!(worst <= STRAY + 1e-9, "{link:?} {other:?} {worst} in {}", moves.len());
                prop_assert!(moves.iter().all(|part| part.step == 7));
            }
        }
    }
}

#[test]
fn three_axes_and_presets_have_their_links() {
    let chain = Chain::three_axes(120.0, Point3::new(10.0, 20.0, -300.0));
    assert_eq!((chain.of_workpiece(), chain.of_tool()), (Link::Frame, Link::Linear));
    let at = |x: f64| Waypoint {
        joints: Joints { linear: Vector3::new(x, 0.0, 5.0), rotary: [0.0; 2] },
        step: 0,
        way: Way::Axes,
        pace: Pace::default(),
    };
    let moves = chain.motion(&[at(0.0), at(300.0)], [Link::Linear, Link::Frame], &chain.tip(), 50.0);
    assert_eq!(moves.len(), 1);
    assert_eq!(moves[0].ends[1] * chain.tip(), Point3::new(300.0, 0.0, -115.0));
    for name in PRESETS {
        let chain = Chain::of(&Kinematics::by_name(name).unwrap());
        let expected = match (chain.side(Link::Rotary(0)), chain.side(Link::Rotary(1))) {
            (Side::Table, Side::Table) => (Link::Rotary(0), Link::Linear),
            (Side::Table, Side::Head) => (Link::Rotary(0), Link::Rotary(1)),
            (Side::Head, _) => (Link::Frame, Link::Rotary(1)),
        };
        assert_eq!((chain.of_workpiece(), chain.of_tool()), expected, "{name}");
    }
}
