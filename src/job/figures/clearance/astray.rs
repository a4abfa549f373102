//! Where joints lead the tool astray between the lines of a program: bounds of gouges and clearances against
//! the motion of the joints.

use super::tests::Home;
use crate::{Outcome, Session};
use cutter::Solid;
use geometry::Point3;
use machine::kinematics::{Joints, Turn};
use motion::ClPoint;
use report::Verdict;

/// Places looked at on each line.
const PLACES: usize = 8;

/// Where the joints bring the tool, with the move, all along the path; the control may keep the `tip` on its
/// line.
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

/// The head leans by up to 11 degrees over a gauge length of 300 mm, and all joints run evenly: the ball
/// sinks below a plane between lines, by the length times an eighth of the square of their turn.
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

/// A cutter 5 mm long below a holder of 95: it sweeps a post beside its upper end.
#[test]
fn a_holder_that_joints_lead_astray_is_within_the_bound_of_its_clearance() {
    let home = Home::new("held-astray");
    let (low, high) = ([38.74, -19.93, 91.1], [44.0, -19.33, 91.8]);
    home.solid("post.stl", low, high);
    let (session, outcome) = home.planned(
        "[part]\nsurface = \"sphere\"\nradius = 20\nx = [-4, 4]\ny = [-4, 4]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n[tolerance]\n\
         scallop = 0.2\nchord = 0.02\ngouge = 0.05\n[simulation]\nremoval = false\n[holder]\ncutting_length = 5\n\
         [[holder.section]]\ndiameter = 6\nlength = 75\n[[holder.section]]\ndiameter = 40\nlength = 20\n[interference]\n\
         clearance = 0\n[[fixture]]\nfile = \"post.stl\"\n[[toolpath]]\nstrategy = \"zigzag\"\nangle = 90\naxis = \"normal\"\n\
         [machine.kinematics]\npreset = \"ac-head\"\npost = \"tcp\"\ngauge_length = 120\nworkpiece_zero = [0, 0, -400]\n\
         z = [-900, 300]\nfirst = { limits = [-720, 720] }\n",
    );
    let holder = Solid::of_holder(outcome.holders[0].as_ref().unwrap());
    let motion = motion(&session, &outcome, true);
    let share = |k: usize, n: usize| low[k] + (high[k] - low[k]) * n as f64 / 4.0;
    let places = (0..125).map(|n| Point3::new(share(0, n % 5), share(1, n / 5 % 5), share(2, n / 25)));
    let places: Vec<Point3> = places.collect();
    let to_post = |(at, _): &(ClPoint, usize)| {
        places.iter().map(|place| holder.distance(&at.tip, &at.axis, place)).fold(f64::INFINITY, f64::min)
    };
    let nearest = motion.iter().map(to_post).fold(f64::INFINITY, f64::min);
    let figure = outcome.result.figures.iter().find(|figure| figure.key == "clearance").unwrap();
    let pairs = figure.value["pairs"].as_array().unwrap();
    let pair = pairs.iter().find(|pair| pair["tool"] == "holder" && pair["other"] == "post.stl").unwrap();
    let [clearance, bound] = ["clearance_mm", "error_bound_mm"].map(|key| pair[key].as_f64().unwrap());
    assert!(nearest >= clearance - bound && nearest < clearance + 0.5, "{nearest} {pair}");
    // All of the tool follows within a fraction of the chord tolerance.
    assert!(bound < 0.3 * 0.02, "{pair}");
}
