//! `stock = "previous"`: toolpaths that cut one block, one after the other.

use std::path::Path;

use exr::prelude::{FlatSamples, ReadChannels as _, ReadLayers as _};
use millstream::geometry::Point3;
use serde_json::Value;

use crate::command::millstream;
use crate::support::write_stl;

const PLATE: &str = "[part]\nsurface = \"plane\"\nx = [0, 12]\ny = [0, 8]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n\
                     [simulation]\ncell = 0.1\n";

/// Passes 2 mm apart leave ridges of 0.17 mm.
const ROUGH: &str = "[[toolpath]]\nname = \"rough\"\nstrategy = \"zigzag\"\nstepover = 2\n";
const FINISH: &str = "[[toolpath]]\nname = \"finish\"\nstrategy = \"zigzag\"\nstepover = 0.4\nangle = 90\n";
const PREVIOUS: &str = "stock = \"previous\"\n";

fn run(home: &Path, scene: &str) -> (Option<i32>, Value) {
    std::fs::write(home.join("scene.toml"), scene).unwrap();
    let answer = millstream(home, &["run", "scene.toml", "--out", "out"]);
    let report = std::fs::read(home.join("out/report.json"));
    let report = report.unwrap_or_else(|_| panic!("{}{}", answer.stdout, answer.stderr));
    (answer.code, serde_json::from_slice(&report).unwrap())
}

/// The scene cannot run, and the message says so.
fn refused(home: &Path, scene: &str, text: &str) {
    std::fs::write(home.join("scene.toml"), scene).unwrap();
    let answer = millstream(home, &["run", "scene.toml", "--out", "out"]);
    let words = answer.stderr.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(answer.code == Some(2) && words.contains(text), "{}{words}", answer.stdout);
}

fn number(toolpath: &Value, pointer: &str) -> f64 {
    toolpath.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer}: {toolpath}"))
}

#[test]
fn a_finish_begins_with_what_roughing_left() {
    let home = tempfile::tempdir().unwrap();
    let alone = FINISH.replace("finish", "alone");
    let scene = format!("{PLATE}{ROUGH}{FINISH}{PREVIOUS}{alone}");
    let (code, report) = run(home.path(), &scene);
    assert_eq!(code, Some(0), "{report}");
    let [rough, finish, alone] = [0, 1, 2].map(|k| &report["toolpaths"][k]);
    // What roughing leaves is the finish's to take, and said to be; both together take what the finish takes
    // alone.
    assert!(number(rough, "/excess/max_mm") > 0.17, "{}", rough["excess"]);
    assert!(rough["notes"].to_string().contains("judged after finish"), "{}", rough["notes"]);
    assert!(!finish["notes"].to_string().contains("judged after"), "{}", finish["notes"]);
    let volume = |toolpath: &Value| number(toolpath, "/removal/volume_mm3");
    assert!(volume(finish) < 0.1 * volume(rough), "{} {}", volume(finish), volume(rough));
    let both = volume(rough) + volume(finish);
    assert!((both - volume(alone)).abs() < 1e-3 * both, "{both} {}", volume(alone));
    // Every ridge of the finish lies under those of roughing, or is cut lower by it.
    let closed = 3.0 - (9.0f64 - 0.04).sqrt();
    assert!((number(finish, "/excess/max_mm") - closed).abs() < 1e-3, "{}", finish["excess"]);
    // Lengths and program are those of its own moves, and so is what cut each cell.
    assert_eq!(finish["path"], alone["path"]);
    let cut_by = |name: &str| {
        let layers = exr::prelude::read().no_deep_data().largest_resolution_level().all_channels();
        let file = home.path().join(format!("out/{name}/height.exr"));
        let image = layers.first_valid_layer().all_attributes().from_file(file).unwrap();
        let FlatSamples::U32(moves) = &image.layer_data.channel_data.list[2].sample_data else { panic!() };
        moves.clone()
    };
    // Where passes of both lie at the design the first of them cut.
    let moves = cut_by("finish");
    let own: Vec<u32> = moves.iter().copied().filter(|by| *by != u32::MAX).collect();
    assert!(own.len() > moves.len() / 2, "{}", own.len());
    assert!(own.iter().all(|by| f64::from(*by) < number(finish, "/simulation/moves")), "{own:?}");
    let program =
        |name: &str| std::fs::read_to_string(home.path().join(format!("out/{name}/toolpath.nc"))).unwrap();
    assert_eq!(program("finish").lines().count(), program("alone").lines().count());
    let checked = millstream(home.path(), &["check", "scene.toml"]);
    assert!(checked.stdout.contains("stock = \"previous\""), "{}", checked.stdout);
}

/// A program roughs 0.2 mm too deep at one place; the finish after it tells whose move that was.
#[test]
fn a_gouge_of_an_earlier_toolpath_is_named() {
    let home = tempfile::tempdir().unwrap();
    let program = "G21 G90\nS9000 M3\nG0 X-5 Y4 Z10\nG1 Z0.3 F900\nX6\nZ-0.2\nZ0.3\nX17\nG0 Z10\nM30\n";
    std::fs::write(home.path().join("rough.nc"), program).unwrap();
    let rough = "[[toolpath]]\nname = \"rough\"\nstrategy = \"program\"\nfile = \"rough.nc\"\n";
    let (code, report) = run(home.path(), &format!("{PLATE}{rough}{FINISH}{PREVIOUS}"));
    assert_eq!(code, Some(1), "{report}");
    for (k, toolpath) in [(0, None), (1, Some("rough"))] {
        let gouge = &report["toolpaths"][k]["gouge"];
        assert!((number(gouge, "/max_depth_mm") - 0.2).abs() < 2e-3, "{gouge}");
        assert_eq!(gouge["regions"][0]["line"], 6, "{gouge}");
        assert_eq!(gouge["regions"][0].get("toolpath").and_then(Value::as_str), toolpath, "{gouge}");
    }
    let text = report["toolpaths"][1]["violations"].to_string();
    assert!(text.contains("of the toolpath rough before this one, rough.nc line 6"), "{text}");
    assert_eq!(report["toolpaths"][1]["gouge"]["regions"][0]["program"], "rough.nc");
}

/// A side of a blade that looks down is cut from its back: roughing that leaves an allowance there opens
/// nothing, and what the finish opens is the finish's gouge.
#[test]
fn a_cut_from_the_back_is_of_the_toolpath_that_came_through() {
    let home = tempfile::tempdir().unwrap();
    let station = |height: u32| format!("[[station]]\nheight = {height}\nnaca = \"4418\"\nchord = 12\n");
    let blade = "sections = 4\npoints = 40\ntrailing_edge = { radius = 0.5 }\n";
    std::fs::write(home.path().join("blade.toml"), format!("{blade}{}{}", station(0), station(2))).unwrap();
    let scene = |rotate: &str| {
        format!(
            "[part]\nsections = \"blade.toml\"\nside = \"suction\"\nrotate = {rotate}\njudge = \"all\"\n[cutter]\n\
             shape = \"ball\"\ndiameter = 4\n[tolerance]\nscallop = 0.05\ncorrect = false\n[stock]\nmargin = 3\n[simulation]\ncell = 0.2\n\
             removal = false\nerror_bound = 0.05\nmemory_mib = 64\n[[toolpath]]\nname = \"rough\"\nstrategy = \"zigzag\"\n\
             stepover = 2\nallowance = 0.3\n[[toolpath]]\nname = \"finish\"\nstrategy = \"zigzag\"\nstepover = 0.5\n{PREVIOUS}"
        )
    };
    let looks_down = |toolpath: &Value| {
        toolpath["notes"].to_string().contains("of the part's surface looks down, and an upright tool")
    };
    let (code, report) = run(home.path(), &scene("[-90, 0, 0]"));
    let [rough, finish] = [0, 1].map(|k| &report["toolpaths"][k]);
    assert!(code == Some(1) && looks_down(rough) && looks_down(finish), "{report}");
    assert_eq!(number(rough, "/gouge/max_depth_mm"), 0.0, "{}", rough["gouge"]);
    assert!(number(finish, "/gouge/max_depth_mm") > 1.0, "{}", finish["gouge"]);
    let regions = finish["coverage"]["unseen"]["gouge"]["regions"].as_array().unwrap();
    let moves = number(finish, "/simulation/moves");
    let is_own = |region: &Value| region.get("toolpath").is_none() && number(region, "/move") < moves;
    assert!(!regions.is_empty() && regions.iter().all(is_own), "{regions:?}");
    let (_, report) = run(home.path(), &scene("[90, 0, 0]"));
    assert!(!looks_down(&report["toolpaths"][1]), "{report}");
}

/// A wall of 5 × 8 mm that leans by so much, mm, and the level ground behind it.
fn steep_wall(home: &Path, lean: f64) {
    let [a, b, c, d] =
        [[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [5.0, lean, 8.0], [0.0, lean, 8.0]].map(Point3::from);
    let [e, f] = [[5.0, 3.0, 8.0], [0.0, 3.0, 8.0]].map(Point3::from);
    write_stl(&home.join("wall.stl"), &[[a, b, c], [a, c, d], [d, c, e], [d, e, f]]);
}

/// Level passes 1 mm apart along a wall of 85 degrees: no cell sees their ridges, and the table does.
#[test]
fn ridges_where_no_cell_sees_are_among_the_scallops() {
    let home = tempfile::tempdir().unwrap();
    let (lean, radius) = (0.7, 2.0f64);
    steep_wall(home.path(), lean);
    let long = 8f64.hypot(lean);
    let pass = |k: i32| {
        let z = 1.0 + f64::from(k);
        let y = (lean * (z + radius) - radius * long) / 8.0;
        let [from, to] = if k % 2 == 0 { [-4, 9] } else { [9, -4] };
        format!("G1 X{from} Y{y:.6} Z{z}\nX{to}\n")
    };
    let passes: String = (0..5).map(pass).collect();
    let program = format!("G21 G90\nS9000 M3\nG0 X-4 Y-9 Z12\nG0 Z1\nF900\n{passes}G0 Z12\nM30\n");
    std::fs::write(home.path().join("wall.nc"), program).unwrap();
    let scene = "[part]\nfile = \"wall.stl\"\n[cutter]\nshape = \"ball\"\ndiameter = 4\n[stock]\nmargin = 5\n\
                 [tolerance]\nscallop = 0.04\n[[toolpath]]\nstrategy = \"program\"\nfile = \"wall.nc\"\n";
    let (_, report) = run(home.path(), scene);
    let toolpath = &report["toolpaths"][0];
    // A ridge stands between the shank of one pass and the ball of the next one above it.
    let aside = lean / 8.0;
    let up = 1.0 - (radius * radius - (radius - aside).powi(2)).sqrt();
    let closed = (aside * up + radius * (long / 8.0 - 1.0)) * 8.0 / long;
    let highest = number(toolpath, "/scallop/max_mm");
    assert!((highest - closed).abs() < 1e-4, "{highest} {closed}: {}", toolpath["scallop"]);
    assert_eq!(toolpath["scallop"], toolpath["coverage"]["unseen"]["scallop"]);
}

/// A ball comes 0.24 mm into a wall of 85 degrees at one place, where no cell sees. Before and after a program
/// that cuts nothing there it is the same move and line.
#[test]
fn a_gouge_where_no_cell_sees_is_named_as_others_are() {
    let home = tempfile::tempdir().unwrap();
    let lean = 0.7;
    steep_wall(home.path(), lean);
    let head = "G21 G90\nS9000 M3\nG0 X-4 Y-1.9 Z12\nZ1\n";
    let program = |name: &str, rest: &str| {
        std::fs::write(home.path().join(format!("{name}.nc")), format!("{head}{rest}")).unwrap();
        format!("[[toolpath]]\nname = \"{name}\"\nstrategy = \"program\"\nfile = \"{name}.nc\"\n")
    };
    let deep = program("deep", "G1 X2.5 F900\nY-1.5\nY-1.9\nX9\nG0 Z12\nM30\n");
    let clear = program("clear", "G1 X0 F900\nX1\nX2\nX3\nX9\nG0 Z12\nM30\n");
    let part = "[part]\nfile = \"wall.stl\"\n[cutter]\nshape = \"ball\"\ndiameter = 4\n[stock]\nmargin = 5\n";
    let depth = 2.0 - (1.5 * 8.0 + lean * 3.0) / 8f64.hypot(lean);
    for (scene, k, toolpath) in [
        (deep.clone(), 0, None),
        (format!("{clear}{deep}{PREVIOUS}"), 1, None),
        (format!("{deep}{clear}{PREVIOUS}"), 1, Some("deep")),
    ] {
        let (code, report) = run(home.path(), &format!("{part}{scene}"));
        assert_eq!(code, Some(1), "{report}");
        let gouge = &report["toolpaths"][k]["coverage"]["unseen"]["gouge"];
        let region = &gouge["regions"][0];
        assert!((number(region, "/depth_mm") - depth).abs() < 1e-3, "{depth} {gouge}");
        assert_eq!([&region["move"], &region["line"]], [3, 6], "{gouge}");
        assert_eq!(region.get("toolpath").and_then(Value::as_str), toolpath, "{gouge}");
        let text = report["toolpaths"][k]["violations"].to_string();
        let of = toolpath.map_or(", deep.nc", |_| " of the toolpath deep before this one, deep.nc");
        assert!(text.contains(&format!("move 3{of} line 6; 244")), "{text}");
        assert!(text.contains("measured along normals where no cell sees"), "{text}");
    }
}

/// What a toolpath left to one that could not be planned is its own: it fails. Behind one that passes,
/// roughing is not the fastest.
#[test]
fn toolpaths_in_turn_answer_for_what_they_leave_together() {
    let home = tempfile::tempdir().unwrap();
    let contours = "[[toolpath]]\nname = \"contours\"\nstrategy = \"waterline\"\n";
    let (code, report) = run(home.path(), &format!("{PLATE}{ROUGH}{contours}{PREVIOUS}"));
    assert_eq!(code, Some(1), "{report}");
    let verdict = |k: usize| report["toolpaths"][k]["verdict"].as_str().unwrap();
    assert_eq!([verdict(0), verdict(1)], ["fail", "not planned"], "{report}");
    assert!(report["toolpaths"][0]["violations"].to_string().contains("scallop"), "{report}");
    assert_eq!(report["best"], Value::Null);
    let (code, report) = run(home.path(), &format!("{PLATE}{ROUGH}{FINISH}{PREVIOUS}"));
    assert_eq!((code, &report["best"]), (Some(0), &Value::from("finish")), "{report}");
}

/// Where no toolpath has a path the message has the reason of each.
#[test]
fn where_none_can_be_planned_each_says_why() {
    let home = tempfile::tempdir().unwrap();
    let contours =
        |name: &str, rest: &str| format!("[[toolpath]]\nname = \"{name}\"\nstrategy = \"waterline\"\n{rest}");
    let scene = [contours("first", ""), contours("second", PREVIOUS), contours("third", "")].concat();
    std::fs::write(home.path().join("scene.toml"), format!("{PLATE}{scene}")).unwrap();
    let answer = millstream(home.path(), &["run", "scene.toml", "--out", "out"]);
    assert_eq!((answer.code, answer.stdout.as_str()), (Some(2), ""));
    let words = answer.stderr.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(words.contains("none of the 3 toolpaths could be planned"), "{words}");
    for told in [
        "\"first\":",
        "\"second\": waterline cannot plan this part: the toolpath before it could not be planned",
        "\"third\":",
    ] {
        assert!(words.contains(told), "{told}: {words}");
    }
}

#[test]
fn what_has_no_previous_stock_says_so() {
    let home = tempfile::tempdir().unwrap();
    let refused = |scene: &str, text: &str| refused(home.path(), scene, text);
    refused(&format!("{PLATE}{ROUGH}{PREVIOUS}"), "no toolpath comes before this one");
    refused(&format!("{PLATE}{ROUGH}{FINISH}stock = \"next\"\n"), "cannot be \"next\"");
    let leaning = format!("{PLATE}{ROUGH}{FINISH}{PREVIOUS}axis = {{ lead = 10 }}\n");
    let (code, report) = run(home.path(), &leaning);
    let reason = report["toolpaths"][1]["reason"].as_str().unwrap();
    assert!(code == Some(1) && reason.contains("measured on a block of its own"), "{reason}");
}

/// Whether a chain can be measured hangs on [simulation] alone: nothing is planned before it is refused.
#[test]
fn engines_that_measure_no_chain_refuse_it_before_any_work() {
    let home = tempfile::tempdir().unwrap();
    for simulation in ["engine = \"rays\"", "engine = \"voxel\"", "voxel = 0.5"] {
        let scene = format!("{PLATE}{simulation}\n{ROUGH}{FINISH}{PREVIOUS}");
        std::fs::write(home.path().join("scene.toml"), scene).unwrap();
        let answer = millstream(home.path(), &["run", "scene.toml", "--out", "out"]);
        assert_eq!((answer.code, answer.stdout.as_str()), (Some(2), ""), "{simulation}");
        let words = answer.stderr.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(words.contains("\"finish\"") && words.contains("measured on a block of its own"), "{words}");
        assert!(words.contains("zmap"), "{words}");
    }
}

/// A larger cutter roughs by levels and leaves the same everywhere over a part with a hollow and a dome: no
/// move comes nearer, and the flat of the dome's top tells that none keeps farther away.
#[test]
fn roughing_has_its_own_cutter_and_leaves_an_allowance() {
    const PART: &str = "[part]\nsurface = \"pit_and_crest\"\nx = [20, 50]\ny = [20, 50]\n\
                        [cutter]\nshape = \"ball\"\ndiameter = 6\n[stock]\nallowance = 4\n";
    const ROUGH: &str = "[[toolpath]]\nname = \"rough\"\nstrategy = \"zigzag\"\nstepover = 3\nstepdown = 2\n\
                         allowance = 0.3\n[toolpath.cutter]\nshape = \"bull\"\ndiameter = 8\ncorner_radius = 2\n\
                         feed_rate = 2000\n";
    let home = tempfile::tempdir().unwrap();
    let (code, report) = run(
        home.path(),
        &format!("{PART}{ROUGH}[[toolpath]]\nname = \"finish\"\nstrategy = \"zigzag\"\n{PREVIOUS}"),
    );
    assert_eq!(code, Some(0), "{report}");
    let [rough, finish] = [0, 1].map(|k| &report["toolpaths"][k]);
    // Chords of the path may cut a micrometre into it.
    let least = number(rough, "/deviation/min_mm");
    assert!((0.299..0.31).contains(&least), "{least}");
    assert_eq!(number(rough, "/gouge/max_depth_mm"), 0.0, "{}", rough["gouge"]);
    assert!(number(finish, "/excess/max_mm") <= 0.01, "{}", finish["excess"]);
    // Nobody holds against the target what the finish cuts off.
    assert_eq!(rough["scallop"]["over_target_fraction"], Value::Null, "{}", rough["scallop"]);
    let text =
        |name: &str| std::fs::read_to_string(home.path().join(format!("out/{name}/toolpath.nc"))).unwrap();
    assert!(
        text("rough").contains("BULL NOSE D=8.0 R=2.0") && text("rough").contains("F2000"),
        "{}",
        text("rough")
    );
    assert!(text("finish").contains("BALL END D=6.0") && !text("finish").contains("F2000"));
    // A complete scene says the same.
    let checked = millstream(home.path(), &["check", "scene.toml"]).stdout;
    for line in ["[toolpath.cutter]", "corner_radius = 2.0", "stepdown = 2.0", "allowance = 0.3"] {
        assert!(checked.contains(line), "{line}: {checked}");
    }
    std::fs::write(home.path().join("scene.toml"), &checked).unwrap();
    let again = millstream(home.path(), &["check", "scene.toml"]).stdout;
    let scene = |text: &str| text[text.find("title").unwrap()..].to_owned();
    assert_eq!(scene(&again), scene(&checked));
}

/// A level plate under 3 mm of stock: three levels of 1 mm, and the cutter never meets more.
#[test]
fn levels_are_no_deeper_than_the_stepdown() {
    let home = tempfile::tempdir().unwrap();
    let plate = PLATE.replace("[simulation]", "[stock]\nallowance = 3\nmargin = 0\n[simulation]");
    let flat = "[toolpath.cutter]\nshape = \"flat\"\ndiameter = 5\n";
    let levels = format!("{}stepdown = 1.2\n{flat}", ROUGH.replace("stepover = 2", "stepover = 4"));
    let (code, report) = run(home.path(), &format!("{plate}{levels}"));
    assert_eq!(code, Some(0), "{report}");
    let rough = &report["toolpaths"][0];
    assert!((number(rough, "/removal/max_axial_engagement_mm") - 1.0).abs() < 1e-4, "{}", rough["removal"]);
    let program = std::fs::read_to_string(home.path().join("out/rough/toolpath.nc")).unwrap();
    for level in ["Z2.0", "Z1.0", "Z0.0"] {
        assert!(program.contains(level), "{program}");
    }
}

#[test]
fn roughing_that_cannot_be_meant_is_refused() {
    let home = tempfile::tempdir().unwrap();
    let refused = |scene: &str, text: &str| refused(home.path(), scene, text);
    let leaving = format!("{ROUGH}allowance = 0.2\n");
    refused(&format!("{PLATE}{leaving}{FINISH}"), "no toolpath behind it cuts that off");
    refused(&format!("{PLATE}{leaving}"), "no toolpath behind it cuts that off");
    let by_height = leaving.replace("stepover = 2\n", "");
    refused(&format!("{PLATE}{by_height}{FINISH}{PREVIOUS}"), "is planned by a `stepover`");
    refused(&format!("{PLATE}{ROUGH}stepdown = 1\naxis = {{ lead = 10 }}\n"), "does not apply beside `axis`");
    refused(&format!("{PLATE}{ROUGH}stepdown = 1e-6\n"), "set a greater one");
    let contours = ROUGH.replace("zigzag", "iso-scallop");
    refused(&format!("{PLATE}{contours}stepdown = 1\n"), "rough by `zigzag`");
    let holder = "holder = { cutting_length = 9, section = [{ diameter = 9, length = 30 }] }\n";
    refused(&format!("{PLATE}{ROUGH}{holder}"), "`holder` in a toolpath without `cutter`");
    let cutter = "cutter = { shape = \"flat\", diameter = 8 }\n";
    let held = PLATE.replace(
        "[simulation]",
        &format!(
            "[holder]\n{}\n[simulation]",
            "cutting_length = 9\nsection = [{ diameter = 9, length = 30 }]"
        ),
    );
    refused(&format!("{held}{ROUGH}{cutter}"), "it would go unchecked");
    refused(
        &format!("{PLATE}{ROUGH}{}", cutter.replace("}", ", feed_rate = 90000 }")),
        "more than the machine's `rapid_rate`",
    );
}

/// Hollows of a radius of 2.3 mm: a ball of 4 mm radius leaves 0.1 mm in them, one of 1.5 mm cuts that off and
/// goes nowhere else.
#[test]
fn a_small_cutter_cuts_the_rest_alone() {
    const PART: &str = "[part]\nsurface = \"wave\"\namplitude = 0.4\nwavelength_x = 6\nwavelength_y = 1000\nx = [0, 12]\n\
                        y = [0, 6]\n[cutter]\nshape = \"ball\"\ndiameter = 8\n[tolerance]\nscallop = 0.02\n\
                        [[toolpath]]\nname = \"finish\"\nstrategy = \"zigzag\"\ncorrect = false\n";
    let small = "strategy = \"zigzag\"\nangle = 90\ncutter = { shape = \"ball\", diameter = 3 }\n";
    let home = tempfile::tempdir().unwrap();
    let rest = format!("[[toolpath]]\nname = \"rest\"\n{PREVIOUS}rest = true\n{small}");
    let whole = format!("[[toolpath]]\nname = \"whole\"\n{small}");
    let (_, report) = run(home.path(), &format!("{PART}{rest}{whole}"));
    let [finish, rest, whole] = [0, 1, 2].map(|k| &report["toolpaths"][k]);
    assert!(number(finish, "/excess/max_mm") > 0.1, "{}", finish["excess"]);
    assert_eq!([&rest["verdict"], &whole["verdict"]], ["pass", "pass"], "{report}");
    let length = |toolpath: &Value| number(toolpath, "/path/cutting_length_mm");
    assert!(length(rest) < 0.5 * length(whole), "{} {}", length(rest), length(whole));
    // On the crests, at x = 1.5 and 7.5, the large ball has done its work.
    let program = std::fs::read_to_string(home.path().join("out/rest/toolpath.nc")).unwrap();
    let places = program.lines().filter_map(|line| line.split(' ').find_map(|word| word.strip_prefix('X')));
    let from_crest = |x: &str| {
        (x.parse::<f64>().unwrap() - 1.5)
            .rem_euclid(6.0)
            .min((1.5 - x.parse::<f64>().unwrap()).rem_euclid(6.0))
    };
    let nearest = places.map(from_crest).fold(f64::INFINITY, f64::min);
    assert!(nearest > 0.8, "{nearest}");
}

/// Ridges of 33.19 µm that stand 5 µm beside the centre of a cell or farther: all of these are below the limit.
#[test]
fn a_rest_cuts_what_stands_between_cells() {
    let home = tempfile::tempdir().unwrap();
    let plate = PLATE.replace("cell = 0.1", "cell = 0.2\n[tolerance]\nscallop = 0.0325");
    let passes = "[[toolpath]]\nname = \"passes\"\nstrategy = \"zigzag\"\nstepover = 0.89\n";
    let rest = format!("[[toolpath]]\nname = \"rest\"\nstrategy = \"zigzag\"\n{PREVIOUS}rest = true\n");
    let (code, report) = run(home.path(), &format!("{plate}{passes}{rest}"));
    let [passes, rest] = [0, 1].map(|k| &report["toolpaths"][k]);
    let closed = 3.0 - (9.0 - 0.445f64.powi(2)).sqrt();
    assert!((number(passes, "/excess/max_mm") - closed).abs() < 1e-5, "{}", passes["excess"]);
    assert_eq!((code, rest["verdict"].as_str()), (Some(0), Some("pass")), "{rest}");
    assert!(number(rest, "/excess/max_mm") < 0.0325, "{}", rest["excess"]);
}

/// The underside of a T is judged, and no tool from above comes to it.
#[test]
fn a_rest_says_what_it_cannot_come_to() {
    let home = tempfile::tempdir().unwrap();
    let outline = [
        [0.0, 0.0],
        [6.0, 0.0],
        [6.0, -1.0],
        [4.0, -1.0],
        [4.0, -3.0],
        [2.0, -3.0],
        [2.0, -1.0],
        [0.0, -1.0],
    ];
    let ring = |y: f64| outline.map(|[x, z]| Point3::new(x, y, z));
    let (front, back) = (ring(0.0), ring(4.0));
    let sides = (0..8).flat_map(|k| {
        let n = (k + 1) % 8;
        [[front[k], back[n], back[k]], [front[k], front[n], back[n]]]
    });
    let caps = [[0, 1, 2], [0, 2, 3], [0, 3, 6], [0, 6, 7], [3, 4, 5], [3, 5, 6]];
    let ends = caps.iter().flat_map(|t| [t.map(|k| back[k]), [front[t[0]], front[t[2]], front[t[1]]]]);
    write_stl(&home.path().join("t.stl"), &sides.chain(ends).collect::<Vec<_>>());
    let plan = "strategy = \"zigzag\"\n";
    let scene = format!(
        "[part]\nfile = \"t.stl\"\njudge = \"all\"\n[cutter]\nshape = \"ball\"\ndiameter = 4\n\
         [simulation]\ncell = 0.1\n[[toolpath]]\nname = \"top\"\n{plan}[[toolpath]]\nname = \"rest\"\n{plan}{PREVIOUS}rest = true\n"
    );
    let (code, report) = run(home.path(), &scene);
    let rest = &report["toolpaths"][1];
    let notes = rest["notes"].to_string();
    assert_eq!(code, Some(1), "{report}");
    assert!(notes.contains("that an upright tool comes to; they left 2000 µm at"), "{notes}");
    assert!(notes.contains("on a face that looks down or lies below others"), "{notes}");
}

/// Two toolpaths share a plate at x = 6; around an island nothing is cut by the first.
#[test]
fn a_boundary_keeps_the_axis_within() {
    let home = tempfile::tempdir().unwrap();
    let left = "boundary = [[[-9, -9], [6, -9], [6, 17], [-9, 17]], [[2, 2], [4, 2], [4, 6], [2, 6]]]\n";
    let right = "boundary = [[[5.9, -9], [21, -9], [21, 17], [5.9, 17]], [[1.9, 1.9], [4.1, 1.9], [4.1, 6.1], [1.9, 6.1]]]\n";
    let stage = |name: &str, more: &str| {
        format!("[[toolpath]]\nname = \"{name}\"\nstrategy = \"zigzag\"\nangle = 90\nscallop = 0.01\n{more}")
    };
    let scene = format!("{PLATE}{}{}", stage("left", left), stage("right", &format!("{right}{PREVIOUS}")));
    let (code, report) = run(home.path(), &scene);
    assert_eq!(code, Some(0), "{report}");
    let program = std::fs::read_to_string(home.path().join("out/left/toolpath.nc")).unwrap();
    let farthest = program.lines().filter_map(|line| line.split(' ').find_map(|word| word.strip_prefix('X')));
    let farthest = farthest.map(|x| x.parse::<f64>().unwrap()).fold(f64::NEG_INFINITY, f64::max);
    assert!(farthest <= 6.0, "{farthest}");
    // Alone it leaves the rest of the plate and the island.
    let (code, report) = run(home.path(), &format!("{PLATE}{}", stage("left", left)));
    assert_eq!(code, Some(1), "{report}");
    let checked = millstream(home.path(), &["check", "scene.toml"]).stdout;
    std::fs::write(home.path().join("scene.toml"), &checked).unwrap();
    assert_eq!(millstream(home.path(), &["check", "scene.toml"]).stdout, checked);
    assert!(checked.contains("boundary = [[[-9.0, -9.0]"), "{checked}");
    for (bad, text) in [
        ("boundary = [[[0, 0], [4, 4], [4, 0], [0, 4]]]\n", "neither cross nor touch"),
        ("rest = true\n", "the rest is what the toolpaths before it left"),
    ] {
        refused(home.path(), &format!("{PLATE}{}", stage("bad", bad)), text);
    }
}
