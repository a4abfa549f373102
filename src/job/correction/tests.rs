use std::sync::atomic::{AtomicUsize, Ordering};

use super::*;
use scene::Scene;
use work::monitor::Silent;

/// A part of a wave under a ball of 6 mm.
const SCENE: &str = "[part]\nsurface = \"wave\"\namplitude = 0.8\nwavelength_x = 25\nwavelength_y = 30\nx = [-8, 8]\ny = [-8, 8]\n[cutter]\nshape = \"ball\"\n\
                     diameter = 6\n[tolerance]\nscallop = 0.05\nchord = 0.005\n";

fn planned(correct: bool, toolpath: &str) -> report::ToolpathResult {
    let text = format!("{SCENE}correct = {correct}\n[[toolpath]]\n{toolpath}\n");
    let session = Session::new(Scene::parse("bump.toml", text).unwrap()).unwrap();
    session.toolpath(&session.scene.toolpaths[0], &Silent).unwrap().result
}

fn figure(result: &report::ToolpathResult) -> Option<&serde_json::Value> {
    figure_of(result, "correction")
}

fn figure_of<'a>(result: &'a report::ToolpathResult, key: &str) -> Option<&'a serde_json::Value> {
    result.figures.iter().find(|figure| figure.key == key).map(|figure| &figure.value)
}

/// Cells that show no pass tell nothing about a plan: it is made as by finer ones, and judged on these.
#[test]
fn coarse_cells_change_no_plan() {
    let [fine, coarse] = [0.1, 4.0].map(|cell| {
        let scene = format!("strategy = \"streamline\"\n[simulation]\ncell = {cell}");
        planned(true, &scene)
    });
    let lengths = |result: &report::ToolpathResult| -> Vec<f64> {
        let rounds = figure(result).unwrap()["rounds"].as_array().unwrap().clone();
        rounds.iter().map(|round| round["cutting_length_mm"].as_f64().unwrap()).collect()
    };
    assert_eq!(lengths(&fine), lengths(&coarse));
    assert_eq!([fine.verdict, coarse.verdict], [report::Verdict::Pass; 2]);
}

#[test]
fn rounds_bring_ridges_toward_the_target() {
    for toolpath in ["strategy = \"streamline\"", "strategy = \"iso-parametric\""] {
        let [open, closed] = [false, true].map(|correct| planned(correct, toolpath));
        assert!(figure(&open).is_none());
        let rounds = figure(&closed).unwrap()["rounds"].as_array().unwrap();
        assert!((1..=MOST_ROUNDS + MOST_MEASURED_NEAR).contains(&rounds.len()));
        let [before, after] = [&open, &closed].map(|result| result.scallop.max_mm.unwrap());
        assert!(after <= before.max(0.05), "{toolpath}: {before} {after} {rounds:?}");
    }
    assert!(figure(&planned(true, "strategy = \"zigzag\"\nstepover = 0.5")).is_none());
}

/// On a slope of one degree the rim of a flat is an arc of r/sin 1° across the feed along the slope:
/// strips of 6.8 mm, and the low edge is cut by passes that run on until the rim has left it.
#[test]
fn a_flat_end_takes_the_strips_that_it_has() {
    for toolpath in ["iso-scallop", "streamline", "iso-parametric"] {
        let text = format!(
            "[part]\nsurface = \"inclined_plane\"\nangle = 1\nx = [0, 40]\ny = [0, 40]\n[cutter]\nshape = \"flat\"\n\
             diameter = 20\n[[toolpath]]\nstrategy = \"{toolpath}\"\n"
        );
        let session = Session::new(Scene::parse("slope.toml", text).unwrap()).unwrap();
        let result = session.toolpath(&session.scene.toolpaths[0], &Silent).unwrap().result;
        assert_eq!(result.verdict, report::Verdict::Pass, "{toolpath}: {:?}", result.claims);
        assert!(result.path.cutting_length_mm < 260.0, "{toolpath}: {}", result.path.cutting_length_mm);
    }
}

/// A spiral leaves a corner of the part by a turn that stands 39 times as high as the target there: no
/// width matters, and a short pass of its own cuts it.
#[test]
fn a_corner_that_was_never_cut_gets_a_pass_of_its_own() {
    let text = "[part]\nsurface = \"wave\"\namplitude = 0.5\nwavelength_x = 12\nx = [-4, 3.3]\ny = [-3, 3]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n\
                [tolerance]\nscallop = 0.0001\nchord = 1e-5\n[[toolpath]]\nstrategy = \"spiral\"\n";
    let session = Session::new(Scene::parse("corner.toml", text.to_owned()).unwrap()).unwrap();
    let result = session.toolpath(&session.scene.toolpaths[0], &Silent).unwrap().result;
    let rounds = figure(&result).unwrap()["rounds"].as_array().unwrap();
    let highest = |round: &serde_json::Value| round["border_mm"].as_f64().unwrap();
    assert!(highest(&rounds[0]) > NEVER_CUT * 0.0001, "{rounds:?}");
    assert_eq!(result.verdict, report::Verdict::Pass, "{rounds:?}");
}

/// A zigzag under a ball of 6 mm for ridges of so many mm, with further keys, over a mesh 12 mm wide: level ground and
/// walls in turn, each `(across, up)`, mm.
fn over_steps(profile: &[[f64; 2]], with: (f64, &str), monitor: &dyn Monitor) -> report::ToolpathResult {
    over_steps_at(profile, with, 0, monitor)
}

/// The same of that toolpath.
fn over_steps_at(
    profile: &[[f64; 2]],
    (scallop, keys): (f64, &str),
    toolpath: usize,
    monitor: &dyn Monitor,
) -> report::ToolpathResult {
    let corner = |at: [f64; 2], y: f64| {
        let [x, z] = at.map(|x| f64::from(x as f32));
        format!("vertex {x} {y} {z}\n")
    };
    let facet = |corners: [String; 3]| {
        format!("facet normal 0 0 0\nouter loop\n{}endloop\nendfacet\n", corners.concat())
    };
    let mut at = [0.0; 2];
    let mut facets = String::new();
    for [across, up] in profile {
        let next = [at[0] + across, at[1] + up];
        let [a, b, c, d] = [corner(at, 0.0), corner(next, 0.0), corner(next, 12.0), corner(at, 12.0)];
        facets += &(facet([a.clone(), b, c.clone()]) + &facet([a, c, d]));
        at = next;
    }
    let of = format!("{scallop}_{}_{}", profile.len(), std::process::id());
    let file = std::env::temp_dir().join(format!("steps_{of}.stl"));
    std::fs::write(&file, format!("solid steps\n{facets}endsolid steps\n")).unwrap();
    let text = format!(
        "[part]\nfile = {:?}\n[cutter]\nshape = \"ball\"\ndiameter = 6\n[tolerance]\nscallop = {scallop}\nuncut = 6\n\
         [simulation]\ncell = 0.3\nerror_bound = 0.02\n[[toolpath]]\nstrategy = \"zigzag\"\n{keys}\n",
        file.to_str().unwrap()
    );
    let session = Session::new(Scene::parse("steps.toml", text).unwrap()).unwrap();
    let result = session.toolpath(&session.scene.toolpaths[toolpath], monitor).unwrap().result;
    std::fs::remove_file(file).unwrap();
    result
}

/// A wall of so many degrees and of a height, mm.
fn wall(degrees: f64, up: f64) -> [f64; 2] {
    [up.abs() / degrees.to_radians().tan(), up]
}

/// Cells do not see walls of 85 and 88 degrees. Plans that fail on level ground as well are compared by all that
/// they leave, and the one that is kept tells it.
#[test]
fn plans_are_compared_by_what_no_cell_sees_as_well() {
    let profile = [[6.0, 0.0], wall(85.0, 6.0), [6.0, 0.0], wall(88.0, -8.0), [6.0, 0.0]];
    let result = over_steps(&profile, (0.9, "angle = 90"), &Silent);
    let correction = figure(&result).unwrap();
    let kept = &correction["rounds"][correction["kept"].as_u64().unwrap() as usize - 1];
    let told = ["highest_mm", "border_mm"].map(|key| kept[key].as_f64().unwrap_or_default());
    let told = told[0].max(told[1]);
    assert!(told >= result.excess.reached.unwrap().max_mm, "{told} {:?} {correction}", result.excess);
}

/// At the foot of a wall of 85 degrees a ball that touches both leaves `r (1 - √(1 - tan² 42.5°))` along the normal of
/// either, which cells see along that of the level ground alone. No width takes it away.
#[test]
fn passes_are_not_narrowed_for_the_foot_of_a_wall() {
    let stands = 3.0 * (1.0 - (1.0 - 42.5f64.to_radians().tan().powi(2)).sqrt());
    let steps = [[6.0, 0.0], wall(85.0, 6.0), [6.0, 0.0]];
    let behind = "\n[[toolpath]]\nname = \"again\"\nstrategy = \"zigzag\"\nstock = \"previous\"";
    for (keys, own) in [("", 0), ("angle = 90", 0), (&format!("stepover = 2{behind}"), 1)] {
        let result = over_steps_at(&steps, (0.9, keys), own, &Silent);
        let left = figure_of(&result, "least_left").unwrap_or_else(|| panic!("{keys}: {:?}", result.notes));
        let [height, bound] = ["height_mm", "error_bound_mm"].map(|key| left[key].as_f64().unwrap());
        assert!(height - bound <= stands + 1e-6 && height >= stands - 1e-6, "{height} ± {bound} {stands}");
        let rounds = figure(&result).unwrap()["rounds"].as_array().unwrap();
        let measured = rounds.iter().filter(|round| round["measured"].as_bool().unwrap()).count();
        assert!(measured <= 2, "{keys}: {rounds:?}");
        assert!(result.excess.reached.unwrap().max_mm < 1.3 * stands, "{keys}: {:?}", result.excess);
    }
}

/// A plate of 16 mm with a boss of 4 mm on its top, 1 mm up walls of 30 degrees, finished by a ball of 3 mm for
/// ridges of 0.02 mm.
fn over_boss(strategy: &str) -> report::ToolpathResult {
    let foot = 2.0 + 1.0 / 30f64.to_radians().tan();
    let square = |half: f64, z: f64| {
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .map(|[x, y]| format!("vertex {} {} {z}\n", x * half, y * half))
    };
    let [border, foot, top] = [square(8.0, 0.0), square(foot, 0.0), square(2.0, 1.0)];
    let facet =
        |a: &str, b: &str, c: &str| format!("facet normal 0 0 0\nouter loop\n{a}{b}{c}endloop\nendfacet\n");
    let four = |[a, b, c, d]: [&str; 4]| facet(a, b, c) + &facet(a, c, d);
    let mut facets = four([0, 1, 2, 3].map(|k| &*top[k]));
    for (outer, inner) in [(&border, &foot), (&foot, &top)] {
        facets.extend(
            (0..4)
                .map(|k| (k, (k + 1) % 4))
                .map(|(a, b)| four([&*outer[a], &*outer[b], &*inner[b], &*inner[a]])),
        );
    }
    let file = std::env::temp_dir().join(format!("boss_{strategy}_{}.stl", std::process::id()));
    std::fs::write(&file, format!("solid boss\n{facets}endsolid boss\n")).unwrap();
    let text = format!(
        "[part]\nfile = {:?}\n[cutter]\nshape = \"ball\"\ndiameter = 3\n[tolerance]\nscallop = 0.02\nuncut = 0.2\n\
         [[toolpath]]\nstrategy = \"{strategy}\"\n",
        file.to_str().unwrap()
    );
    let session = Session::new(Scene::parse("boss.toml", text).unwrap()).unwrap();
    let result = session.toolpath(&session.scene.toolpaths[0], &Silent).unwrap().result;
    std::fs::remove_file(file).unwrap();
    result
}

/// Along the foot of a boss every path of a ball leaves 0.055 mm. The ridges on level ground come below the target
/// all the same, and no pass is narrowed for the foot.
#[test]
fn what_every_path_leaves_keeps_no_other_place_from_being_corrected() {
    let stands = 1.5 * (1.0 - (1.0 - 15f64.to_radians().tan().powi(2)).sqrt());
    for strategy in ["streamline", "zigzag"] {
        let result = over_boss(strategy);
        let rounds = figure(&result).unwrap()["rounds"].as_array().unwrap();
        let length = |round: &serde_json::Value| round["cutting_length_mm"].as_f64().unwrap();
        assert!((2..=5).contains(&rounds.len()), "{strategy}: {rounds:?}");
        let kept = result.path.cutting_length_mm;
        assert!(kept <= 1.2 * length(&rounds[0]), "{strategy}: {kept} {rounds:?}");
        // The ball touches ground and wall as far from the foot.
        let reach = 1.5 * 15f64.to_radians().tan();
        let foot = 8.0 * (2.0 + 1.0 / 30f64.to_radians().tan());
        let over = result.scallop.over_target_fraction.unwrap();
        assert!(over <= 2.0 * reach * foot / 256.0, "{strategy}: {over} {rounds:?}");
        let left = figure_of(&result, "least_left").unwrap();
        let [height, bound] = ["height_mm", "error_bound_mm"].map(|key| left[key].as_f64().unwrap());
        // At a corner of the foot it leaves less.
        assert!(
            height - bound <= stands && result.scallop.max_mm.unwrap() <= 2.0 * stands,
            "{strategy}: {left}"
        );
        assert_eq!(result.verdict, report::Verdict::Fail, "{strategy}");
    }
}

/// Counts how often all that a plan leaves is measured.
struct Looks(AtomicUsize);

impl Monitor for Looks {
    fn start(&self, stage: &str, _: u64) {
        self.0.fetch_add(usize::from(stage == "measuring a plan"), Ordering::Relaxed);
    }
}

/// The planner has a least interval on walls: narrower widths bring the path of an earlier round, which is cut and
/// measured once. Of a bar nothing tells what every path leaves at the foot of a wall, so that plans go on.
#[test]
fn a_plan_that_comes_out_as_an_earlier_one_is_not_measured_again() {
    let profile = [[6.0, 0.0], wall(80.0, 4.0), [6.0, 0.0], wall(88.0, -5.0), [6.0, 0.0]];
    let looks = Looks(AtomicUsize::new(0));
    let bar = "[stock]\nfrom = [9, 6, -2]\naxis = \"z\"\ndiameter = 40\nlength = 7";
    let result = over_steps(&profile, (0.4, bar), &looks);
    let rounds = figure(&result).unwrap()["rounds"].as_array().unwrap();
    let measured = rounds.iter().filter(|round| round["measured"].as_bool().unwrap());
    let mut lengths: Vec<f64> = measured.map(|round| round["cutting_length_mm"].as_f64().unwrap()).collect();
    let plans = lengths.len();
    lengths.sort_unstable_by(f64::total_cmp);
    lengths.dedup();
    let (paths, looks) = (lengths.len(), looks.0.into_inner());
    // The best one may be looked at once more, closer.
    assert!(paths < plans && looks <= paths + 1, "{looks} {paths} {plans} {rounds:?}");
}

/// As far as ridges tell, short passes made a plan better; measured, it cuts 0.2 mm deep. The plan before them is
/// taken up, and no such plan takes its place again.
#[test]
fn short_passes_that_cut_too_deep_give_way_to_the_plan_before_them() {
    let text = format!("{SCENE}[[toolpath]]\nstrategy = \"iso-parametric\"\n");
    let session = Session::new(Scene::parse("deep.toml", text).unwrap()).unwrap();
    let (request, target) = (&session.scene.toolpaths[0], 0.05);
    let (tool, engine) = (crate::tool::Tool::of(&request.tooling), session.engine(request).unwrap());
    let around = Around { tool: &tool, near: &session.part, fixtures: &[], rest: None };
    let [before, mut deep] = [0, 1].map(|_| session.plan(request, around, &Silent).unwrap());
    deep.plan.path = deep.plan.path.moved(geometry::Vector3::new(0.0, 0.0, -0.2));
    let (closeness, wanted) = (Closeness::Verdict, session.wanted(request, target, false));
    let looked = session.look(request, &[], engine, &deep.plan.path, closeness, &Silent).unwrap();
    let standing = Standing::of_all(&looked, &deep, [1.0; 2], wanted);
    let widths = Widths::by_calculation(plane_interval(&request.tooling.cutter, request.step));
    let touched_up = Widths { touch_up: vec![geometry::Point3::origin()], ..widths.clone() };
    let kept = deep.plan.kept.clone();
    let mut corrected = Corrected {
        session: &session,
        request,
        earlier: &[],
        around,
        engine,
        goal: Goal { target, rule: session.scene.scallop_rule, is_hopeless: false },
        closeness,
        best: deep,
        rounds: vec![standing.round],
        tried: Tried { widths: touched_up, standing: standing.clone(), kept },
        latest: None,
        narrower: None,
        untouched: Some(widths),
        kept: 0,
        made: Vec::new(),
        is_complete: false,
        hollows: None,
    };
    assert_eq!(corrected.cut_of(&standing), Cut::FarTooDeep);
    let looked = corrected.unless_touched_up_too_deep(looked, &Silent).unwrap();
    assert_eq!(corrected.best.plan.path.moves, before.plan.path.moves);
    assert!(looked.measured.measurement.gouge.max_depth_mm < 0.005 && corrected.kept == 1);
    assert_eq!(corrected.gain(&standing, [false; 2]), Gain::None);
}
