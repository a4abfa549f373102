//! How the joints of a five-axis machine move.

use serde::Serialize;

use ::machine::kinematics::{Chain, JointPath, JointReport, Kinematics, Link, STRAY, Turn, Way};
use geometry::{Aabb, Point3};
use report::{Claim, Figure, Gravity};
use scene::FiveAxis;
use toolpath::ReadProgram;
use work::monitor::Monitor;

use super::words::value;
use crate::JobError;
use crate::run::{Finding, Run};

/// The way of one joint.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct JointRange {
    /// Its letter.
    pub joint: char,
    /// Least and greatest value, mm, or degrees of a rotary joint.
    pub range: [f64; 2],
    /// Its fastest motion, mm/min, or degrees/min of a rotary joint.
    pub fastest: f64,
}

/// How the joints of a five-axis machine move along a path.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MachineFigures {
    /// X, Y, Z and the two rotary joints.
    pub joints: Vec<JointRange>,
    /// How far each of the rotary joints turns in all.
    pub rotary_travel_deg: [f64; 2],
    /// Places where the tool axis comes within a degree of the first rotary axis.
    pub singular_poses: usize,
    /// Turns for which the tool leaves the part.
    pub rewinds: usize,
    /// Locations put in to keep the tool within the chord tolerance.
    pub inserted_locations: usize,
}

impl MachineFigures {
    /// Of the joints along a path, and their fastest motion, mm/s and rad/s.
    pub fn new(kinematics: &Kinematics, report: &JointReport, fastest: [f64; 5]) -> Self {
        let ranges = kinematics.letters().into_iter().zip(report.ranges);
        let shown = |(k, (joint, range)): (usize, (char, [f64; 2]))| {
            let degrees = |value: f64| if k < 3 { value } else { value.to_degrees() };
            JointRange { joint, range: range.map(degrees), fastest: 60.0 * degrees(fastest[k]) }
        };
        Self {
            joints: ranges.enumerate().map(shown).collect(),
            rotary_travel_deg: report.rotary_travel.map(f64::to_degrees),
            singular_poses: report.singular.len(),
            rewinds: report.rewinds.len(),
            inserted_locations: report.inserted,
        }
    }
}

pub(super) fn find(run: &Run<'_>, _: &dyn Monitor) -> Result<Finding, JobError> {
    let Some(five_axis) = run.scene().five_axis.as_ref() else { return Ok(Finding::default()) };
    let Some(joints) = run.planned.joints.as_ref() else {
        return Ok(run.request.foreign().map_or_else(Finding::default, |read| of_program(five_axis, read)));
    };
    let (machine, path) = (&five_axis.kinematics, run.path());
    let fastest = joints.fastest(machine, path, run.scene().machine.rapid_rate);
    let figures = MachineFigures::new(machine, &joints.report, fastest);
    let mut claims = within_travel(machine, &joints.report.ranges, &joints.report.ranges);
    let notes: Vec<String> = note(&joints.report).into_iter().collect();
    let nose = joints.highest_nose(machine, path).max(over_the_work(run, machine, joints));
    claims.push(retract_above(machine.retracted_z(), nose));
    let figure = Figure { key: "machine", value: value(&figures)?, ..Figure::default() };
    Ok(Finding { figure: Some(figure), notes, claims })
}

/// The travel of a program from elsewhere. Where the machine stood before it is not known.
fn of_program(five_axis: &FiveAxis, read: &ReadProgram) -> Finding {
    let machine = &five_axis.kinematics;
    if machine.limits().iter().all(Option::is_none) {
        return Finding::default();
    }
    if read.joints.is_empty() {
        let note = "the travel of joints is not judged: cutter locations name no joints".to_owned();
        return Finding { notes: vec![note], ..Finding::default() };
    }
    let [found, most] = travelled(machine, read);
    let mut claims = within_travel(machine, &found, &most);
    let unknown = read.joints.iter().find(|(tool, _)| !read.gauge_lengths.contains_key(tool));
    let cure = match unknown {
        _ if !five_axis.zero_is_given => Some("add `workpiece_zero` to [machine.kinematics]".to_owned()),
        Some((tool, _)) if !five_axis.gauge_is_given => {
            Some(format!("add the `gauge_length` of tool {tool} to the table of tools"))
        }
        _ => None,
    };
    if let Some((cure, claim)) = cure.zip(claims.iter_mut().find(|claim| claim.unit == "mm")) {
        let unknown = Claim::length("travel", Gravity::Crash, ROUNDING, 0.0, f64::INFINITY);
        let text = format!("where X, Y and Z stand is not known: {cure}");
        *claim = Claim { decided_by: "that would decide it", ..unknown.told(text) };
    }
    Finding { claims, ..Finding::default() }
}

/// Least and greatest value of each joint, mm and rad.
type Ranges = [[f64; 2]; 5];

/// The ranges that are found, and those that no joint leaves. Places of the program are reached exactly; what lies between, where
/// linear joints follow rotary ones, is known less closely.
fn travelled(machine: &Kinematics, read: &ReadProgram) -> [Ranges; 2] {
    let mut ranges = [[[f64::INFINITY, f64::NEG_INFINITY]; 5]; 2];
    let mut widen = |k: usize, value: f64, stray: f64| {
        for (range, off) in ranges.iter_mut().zip([0.0, stray]) {
            range[k] = [range[k][0].min(value - off), range[k][1].max(value + off)];
        }
    };
    for (tool, program) in &read.joints {
        let chain = Chain::of(&read.with_tool(machine, *tool));
        // Where the machine stood before does not count, nor does it while rotary axes alone turn.
        let (begin, mut is_known) = (program.first().map(|way| way.joints.linear), [false; 3]);
        for (at, way) in program.iter().enumerate().skip(1) {
            for (k, value) in way.joints.linear.iter().enumerate() {
                is_known[k] |= begin.is_some_and(|begin| begin[k] != *value);
                if is_known[k] {
                    widen(k, *value, 0.0);
                }
            }
            (0..2).for_each(|k| widen(k + 3, way.joints.rotary[k] + read.table_zero[k], 0.0));
            // Where rotary axes turn about a tip that is kept, the linear ones follow.
            if at > 1 && way.way == Way::Tip && way.joints.rotary != program[at - 1].joints.rotary {
                let links = [Link::Linear, Link::Frame];
                let between = chain.motion(&program[at - 1..=at], links, &Point3::origin(), 0.0);
                let noses = between.iter().map(|stretch| stretch.ends[1].translation.vector);
                noses.for_each(|nose| nose.iter().enumerate().for_each(|(k, value)| widen(k, *value, STRAY)));
            }
        }
    }
    ranges
}

/// How high the spindle nose has to stand, machine coordinates, mm, for the tip to be over part, stock and
/// fixtures wherever the rotary axes stand when a program begins, rises or ends.
fn over_the_work(run: &Run<'_>, machine: &Kinematics, joints: &JointPath) -> f64 {
    let meshes = run.around.fixtures.iter().map(|(mesh, _)| mesh).chain([run.around.near.mesh()]);
    let vertices: Vec<Point3> = meshes.flat_map(|mesh| mesh.vertices().iter().copied()).collect();
    let Aabb { min, max } = run.session.area();
    let side = |k: usize, axis: usize| if k >> axis & 1 == 1 { max[axis] } else { min[axis] };
    let corners: Vec<Point3> = (0..8).map(|k| Point3::new(side(k, 0), side(k, 1), side(k, 2))).collect();
    let nose = |rotary: [f64; 2]| {
        let up = machine.upward(rotary);
        let over = |height: f64, place: &Point3| height.max(up.dot(&place.coords));
        let height = vertices.iter().chain(&corners).fold(f64::NEG_INFINITY, over);
        // With the head swung, the side of the cutter reaches below its tip.
        let lean = machine.tool_axis(rotary).cross(&up).norm();
        machine.place(Point3::origin(), rotary).linear.z + height + lean * run.around.tool.cutter.radius()
    };
    let rewinds = joints.locations.windows(2).filter(|pair| pair[1].turn == Turn::Rewind);
    let turned = rewinds.flat_map(|pair| pair.iter().map(|at| at.joints.rotary));
    let ends = [joints.start.rotary].into_iter().chain(joints.locations.last().map(|at| at.joints.rotary));
    turned.chain(ends).map(nose).fold(f64::NEG_INFINITY, f64::max)
}

/// That the machine's Z to which programs rise is no lower than where they come down from.
fn retract_above(z: f64, nose: f64) -> Claim {
    let text = format!(
        "programs rise to the machine's Z {z:.3}, and the spindle nose must stand at Z {nose:.3} or higher to be over the path and the work"
    );
    Claim::length("retract", Gravity::Crash, 0.0, nose - z, 0.0).told(text)
}

/// Beyond a limit by so little, mm or degrees, a joint is at it.
const ROUNDING: f64 = 1e-6;

/// That the joints keep to their travels: one claim for those of the linear and one for those of the rotary
/// joints that are limited, by the ranges that are `found` and the `most` that they may be.
fn within_travel(kinematics: &Kinematics, found: &Ranges, most: &Ranges) -> Vec<Claim> {
    let all = kinematics.letters().into_iter().zip(kinematics.limits()).enumerate();
    let beyond = all.filter_map(|(k, (joint, limits))| {
        let [least, greatest] = limits.filter(|_| found[k][0] <= found[k][1])?;
        let over = [found, most].map(|ranges| (least - ranges[k][0]).max(ranges[k][1] - greatest));
        Some((k < 3, joint, if k < 3 { over } else { over.map(f64::to_degrees) }))
    });
    let beyond: Vec<_> = beyond.collect();
    let worst = |linear: bool| {
        let of = || beyond.iter().filter(|(kind, ..)| *kind == linear);
        let (_, joint, [over, _]) = of().max_by(|a, b| a.2[0].total_cmp(&b.2[0]))?;
        let most = of().map(|joint| joint.2[1]).fold(*over, f64::max);
        let unit = if linear { "mm" } else { "degrees" };
        let text = if *over <= ROUNDING {
            format!("joint {joint} comes nearest to its limit, {:.3} {unit} inside of it", (-over).max(0.0))
        } else {
            format!("joint {joint} runs {over:.3} {unit} beyond its limit")
        };
        let (unit, bound) = (if linear { "mm" } else { "deg" }, most - over);
        let claim = Claim::length("travel", Gravity::Crash, ROUNDING, *over, bound).told(text);
        let at_least = (bound > 0.0).then_some(*over);
        Some(Claim { unit, at_least, decided_by: "more travel would decide it", ..claim })
    };
    [true, false].into_iter().filter_map(worst).collect()
}

/// What the user should know of how the machine moves.
fn note(report: &JointReport) -> Option<String> {
    let (poses, rewinds) = (report.singular.len(), report.rewinds.len());
    (poses + rewinds > 0).then(|| {
        format!(
            "the rotary joints come within a degree of a singular pose {poses} times, and unwind {rewinds} times \
             between passes"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::machine::kinematics::{Joints, Pace, Waypoint};
    use geometry::Vector3;
    use motion::{ClPoint, Toolpath};
    use report::Verdict;

    fn head(more: &str) -> FiveAxis {
        let text = format!(
            "[part]\nsurface = \"plane\"\nx = [0, 8]\ny = [0, 6]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n[[toolpath]]\n\
             strategy = \"program\"\nfile = \"a.nc\"\n[machine.kinematics]\npreset = \"ab-head\"\ngauge_length = 150\n{more}"
        );
        scene::Scene::parse("a.toml", &text).unwrap().five_axis.unwrap()
    }

    fn program(joints: Vec<(u32, Vec<Waypoint>)>) -> ReadProgram {
        ReadProgram {
            rounded: 0.0,
            straight_rapids: None,
            path: Toolpath::new(ClPoint::upright(Point3::origin()), Vec::new()),
            joints,
            table_zero: [0.0; 2],
            tools: None,
            gauge_lengths: [(1, 80.0), (2, 90.0)].into(),
            before: Vec::new(),
            unknown_before: false,
            others: false,
            highest_feed: None,
            findings: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// A start that nothing is known of, then these places of X and B, degrees.
    fn through(way: Way, places: &[[f64; 2]]) -> Vec<Waypoint> {
        let at = |(step, &[x, b]): (usize, &[f64; 2])| {
            let joints = Joints { linear: Vector3::new(x, 0.0, -320.0), rotary: [0.0, f64::to_radians(b)] };
            Waypoint { joints, step, way, pace: Pace::default() }
        };
        [[999.0, 170.0]].iter().chain(places).enumerate().map(at).collect()
    }

    fn told(five_axis: &FiveAxis, read: &ReadProgram) -> Vec<(Verdict, String)> {
        let found = of_program(five_axis, read);
        found.claims.iter().map(|claim| (claim.verdict(), claim.text.clone())).collect()
    }

    #[test]
    fn programs_from_elsewhere_keep_to_the_travel() {
        let limits = "workpiece_zero = [0, 0, -400]\nx = [-20, 20]\nsecond = { limits = [-10, 10] }\n";
        let machine = head(limits);
        let inside = through(Way::Axes, &[[12.0, 5.0], [-3.0, 4.0]]);
        // Each tool's stretches count.
        let beyond = through(Way::Axes, &[[32.0, 5.0], [46.0, 30.0]]);
        let passed = told(&machine, &program(vec![(1, inside.clone())]));
        assert!(passed.iter().all(|(verdict, _)| *verdict == Verdict::Pass), "{passed:?}");
        assert_eq!(passed[0].1, "joint X comes nearest to its limit, 8.000 mm inside of it");
        let failed = told(&machine, &program(vec![(1, inside.clone()), (2, beyond)]));
        let expected =
            ["joint X runs 26.000 mm beyond its limit", "joint B runs 20.000 degrees beyond its limit"];
        assert_eq!(failed, expected.map(|text| (Verdict::Fail, text.to_owned())));
        // While rotary joints alone turn, the linear ones stand where they stood before.
        let turning = through(Way::Axes, &[[999.0, 5.0], [999.0, -5.0], [12.0, 5.0]]);
        let passed = told(&machine, &program(vec![(1, turning)]));
        assert!(passed.iter().all(|(verdict, _)| *verdict == Verdict::Pass), "{passed:?}");
        // Without its places nothing is known of the linear joints, and of cutter locations nothing at all.
        let nowhere = told(&head(&limits.replace("workpiece", "# ")), &program(vec![(1, inside)]));
        assert_eq!((nowhere[0].0, nowhere[1].0), (Verdict::Undecided, Verdict::Pass));
        assert!(nowhere[0].1.contains("`workpiece_zero`"), "{nowhere:?}");
        let located = of_program(&machine, &program(Vec::new()));
        assert_eq!((located.claims.len(), located.notes.len()), (0, 1));
        assert!(
            told(
                &head("first = { limits = \"none\" }\nsecond = { limits = \"none\" }"),
                &program(Vec::new())
            )
            .is_empty()
        );
    }

    /// The nose is highest in the middle of a swing about a tip that stays, and the tool's own length counts.
    #[test]
    fn linear_joints_follow_a_head_that_swings() {
        let (lean, own) = (60f64, 80.0);
        let [low, top] = [-400.0 + own * lean.to_radians().cos(), -400.0 + own];
        let swing = [-lean, lean].map(|b| {
            let rotary = [0.0, b.to_radians()];
            let linear = Vector3::new(own * rotary[1].sin(), 0.0, low);
            Waypoint { joints: Joints { linear, rotary }, step: 0, way: Way::Tip, pace: Pace::default() }
        });
        let joints = through(Way::Tip, &[]).into_iter().chain(swing).collect::<Vec<_>>();
        for (over, verdict) in [(10.0, Verdict::Fail), (0.01, Verdict::Fail), (-0.01, Verdict::Pass)] {
            let machine = head(&format!("workpiece_zero = [0, 0, -400]\nz = [-500, {}]\n", top - over));
            let claims = of_program(&machine, &program(vec![(1, joints.clone())])).claims;
            let claim = claims.iter().find(|claim| claim.unit == "mm").unwrap();
            assert_eq!(claim.verdict(), verdict, "{claim:?}");
            assert!((claim.measured.unwrap() - over).abs() <= claim.error_bound, "{claim:?}");
        }
    }

    /// A program that swings about its tip and rises to the very end of the travel is within it: places that it names are reached
    /// exactly.
    #[test]
    fn the_end_of_the_travel_is_within_it() {
        let swing = [[0.0, -320.0, 0.0], [0.0, -320.0, 5.0], [0.0, 0.0, 5.0]].map(|[x, z, b]| {
            let joints = Joints { linear: Vector3::new(x, 0.0, z), rotary: [0.0, f64::to_radians(b)] };
            Waypoint { joints, step: 0, way: Way::Tip, pace: Pace::default() }
        });
        let joints = through(Way::Tip, &[]).into_iter().chain(swing).collect::<Vec<_>>();
        let machine = head("workpiece_zero = [0, 0, -400]\nz = [-500, 0]\n");
        let passed = told(&machine, &program(vec![(1, joints.clone())]));
        assert_eq!(passed[0].0, Verdict::Pass, "{passed:?}");
        let machine = head("workpiece_zero = [0, 0, -400]\nz = [-500, -0.001]\n");
        assert_eq!(told(&machine, &program(vec![(1, joints)]))[0].0, Verdict::Fail);
    }

    #[test]
    fn a_retract_below_the_work_is_a_violation() {
        let claim = retract_above(0.0, 161.0);
        assert_eq!((claim.what, claim.verdict()), ("retract", Verdict::Fail));
        assert!(
            claim.text.ends_with("must stand at Z 161.000 or higher to be over the path and the work"),
            "{}",
            claim.text
        );
        assert_eq!(retract_above(0.0, -40.0).verdict(), Verdict::Pass);
        assert_eq!(retract_above(700.0, 161.0).verdict(), Verdict::Pass);
    }
}
