//! Where joints lead the tool astray between the lines of a program: bounds of gouges and clearances against the motion of the joints.

use super::tests::Home;
use crate::{Outcome, Session};
use machine::kinematics::{Joints, Turn};
use motion::ClPoint;
use report::Verdict;

/// Places looked at on each line.
const PLACES: usize = 8;

/// Where the joints bring the tool, with the move, all along the path; the control may keep the `tip` on its line.
fn motion(session: &Session, outcome: &Outcome, tip_kept: bool) -> Vec<(ClPoint, usize)> {
    let machine = &session.scene.five_axis.as_ref().unwrap().kinematics;
    let joints = outcome.joints.as_ref().unwrap();
    let (mut last, mut at, mut all) = (joints.start, outcome.path.start, Vec::new());
    for next in &joints.locations {
        for k in (0..=PLACES).filter(|_| next.turn != Turn::Rewind) {
            let share = k as f64 / PLACES as f64;
            let rotary = [0, 1].map(|k| last.rotary[k] + (next.joints.rotary[k] - last.rotary[k]) * share);
            let place =
                machine.forward(&Joints { linear: last.linear.lerp(&next.joints.linear, share), rotary });
            let tip = if tip_kept { at.tip + (next.at.tip - at.tip) * share } else { place.tip };
            all.push((ClPoint { tip, ..place }, next.step));
        }
        (last, at) = (next.joints, next.at);
    }
    all
}

/// The head leans by up to 11 degrees over a gauge length of 300 mm, and all joints run evenly: the ball sinks below a plane between
/// lines, by the length times an eighth of the square of their turn.
#[test]
fn what_joints_cut_between_lines_is_within_the_bound_of_the_gouge() {
    let scene = |chord: f64| {
        format!(
            "[part]\nsurface = \"plane\"\nx = [-8, 8]\ny = [-4, 4]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n[tolerance]\n\
             scallop = 0.2\nchord = {chord}\n[simulation]\nremoval = false\n[[toolpath]]\nstrategy = \"zigzag\"\nangle = 0\n\
             axis = {{ toward = [[0, 0, 40]] }}\n[machine.kinematics]\npreset = \"ab-head\"\npost = \"full\"\ngauge_length = 300\n\
             workpiece_zero = [0, 0, -400]\nz = [-900, 300]\n"
        )
    };
    for (chord, verdict) in [(0.001, Verdict::Pass), (0.5, Verdict::Undecided)] {
        let (session, outcome) = Home::new("astray").planned(&scene(chord));
        let cuts = motion(&session, &outcome, false).into_iter();
        let cuts = cuts.filter(|(_, step)| outcome.path.moves[*step].kind.is_on_surface());
        let deepest = cuts.map(|(at, _)| 3.0 - (at.tip + 3.0 * at.axis).z).fold(0.0, f64::max);
        let gouge = &outcome.result.gouge;
        assert!((deepest - gouge.max_depth_mm).abs() <= gouge.error_bound_mm, "{chord}: {deepest} {gouge:?}");
        assert!(deepest > 0.03 * chord, "{chord}: {deepest}");
        assert_eq!(outcome.result.verdict, verdict, "{chord}: {:?}", outcome.result.claims);
    }
}
