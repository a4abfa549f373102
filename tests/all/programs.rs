//! Programs from elsewhere through the real command: a sound one passes, planted faults are found with their
//! lines.

use std::path::Path;

use serde_json::Value;

use crate::command::{Answer, millstream};

/// Size of the plate along x and y, mm.
const SIZE: [f64; 2] = [16.0, 8.0];

/// Distance of passes, mm: a ball of 6 mm leaves 6.7 µm.
const STEP: f64 = 0.4;

/// A level plate at z = 0.
fn plate() -> String {
    let [x, y] = SIZE;
    let facet = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
        let corner = |[x, y]: [f64; 2]| format!("vertex {x} {y} 0\n");
        format!("facet normal 0 0 1\nouter loop\n{}{}{}endloop\nendfacet\n", corner(a), corner(b), corner(c))
    };
    let [low, right, high, left] = [[0.0, 0.0], [x, 0.0], [x, y], [0.0, y]];
    format!("solid plate\n{}{}endsolid plate\n", facet(low, right, high), facet(low, high, left))
}

/// A raster over the plate with a ball of 6 mm.
fn raster() -> Vec<String> {
    let head = [
        "%",
        "(PLATE)",
        "G21 G90 G17 G94",
        "T1 M6",
        "S12000 M3",
        "G54",
        "G43 H1",
        "G0 X0 Y0 Z10",
        "G1 Z0 F600",
    ];
    let mut lines: Vec<String> = head.iter().map(|&line| line.to_owned()).collect();
    for k in 0..=(SIZE[1] / STEP) as usize {
        let (y, ends) = (STEP * k as f64, if k % 2 == 0 { [0.0, SIZE[0]] } else { [SIZE[0], 0.0] });
        let places = [ends[0], 0.5 * SIZE[0], ends[1]];
        lines.extend(places.map(|x| format!("X{x:.3} Y{y:.3}")));
    }
    lines.extend(["G0 Z10", "M5", "M30", "%"].map(str::to_owned));
    lines
}

/// Verifies a program in a folder of its own.
fn verify(program: &[String], options: &[&str]) -> (Answer, Option<Value>) {
    let home = tempfile::tempdir().unwrap();
    verify_in(home.path(), program, options)
}

fn verify_in(home: &Path, program: &[String], options: &[&str]) -> (Answer, Option<Value>) {
    std::fs::write(home.join("plate.stl"), plate()).unwrap();
    std::fs::write(home.join("job.nc"), program.join("\n") + "\n").unwrap();
    let mut arguments =
        vec!["verify", "--part", "plate.stl", "--program", "job.nc", "--cell", "0.1", "--out", "out"];
    if !options.contains(&"--tools") {
        arguments.extend(["--cutter", "ball:6"]);
    }
    arguments.extend(options);
    let answer = millstream(home, &arguments);
    let report = std::fs::read(home.join("out/report.json")).ok();
    (answer, report.map(|bytes| serde_json::from_slice(&bytes).unwrap()))
}

/// The sentences of the limits that do not hold.
fn violations(report: &Value) -> Vec<String> {
    let all = report["toolpaths"][0]["violations"].as_array().unwrap();
    all.iter().map(|claim| claim["text"].as_str().unwrap().to_owned()).collect()
}

#[track_caller]
fn assert_violates(program: &[String], options: &[&str], text: &str) {
    let (answer, report) = verify(program, options);
    assert_eq!(answer.code, Some(1), "{}", answer.stderr);
    let found = violations(&report.unwrap());
    assert!(found.iter().any(|sentence| sentence.contains(text)), "{text}: {found:?}");
}

/// The line, from 1, of the first that begins so.
fn line_of(program: &[String], begin: &str) -> usize {
    program.iter().position(|line| line.starts_with(begin)).unwrap() + 1
}

#[test]
fn a_sound_program_passes_in_every_format() {
    let home = tempfile::tempdir().unwrap();
    let (answer, report) = verify_in(home.path(), &raster(), &[]);
    assert_eq!(answer.code, Some(0), "{}{}", answer.stdout, answer.stderr);
    assert!(answer.stdout.contains("Every tolerance holds."), "{}", answer.stdout);
    let report = report.unwrap();
    let toolpath = &report["toolpaths"][0];
    assert_eq!((&toolpath["name"], &toolpath["strategy"]), (&Value::from("job"), &Value::from("program")));
    assert_eq!(toolpath["program"]["file"], "job.nc");
    assert!(
        !home.path().join("out/job/toolpath.nc").exists()
            && home.path().join("out/job/toolpath.cls").exists()
    );
    let (json, _) = verify_in(home.path(), &raster(), &["--format", "json"]);
    assert_eq!(serde_json::from_str::<Value>(&json.stdout).unwrap()["verdict"], "pass");
    let (junit, _) = verify_in(home.path(), &raster(), &["--format", "junit"]);
    assert!(junit.stdout.starts_with("<?xml") && !junit.stdout.contains("<failure"), "{}", junit.stdout);
    let (html, _) = verify_in(home.path(), &raster(), &["--format", "html"]);
    assert!(html.stdout.starts_with("<!DOCTYPE html>"), "{}", &html.stdout[..100]);
}

/// The raster the other way: lines shorter than four radii, fed back and forth without a rapid, are tracks of
/// their own.
#[test]
fn ridges_between_short_lines_of_one_pass_are_found() {
    let mut program = raster()[..9].to_vec();
    for k in 0..=(SIZE[0] / STEP) as usize {
        let ends = if k % 2 == 0 { [0.0, SIZE[1]] } else { [SIZE[1], 0.0] };
        program.extend(ends.map(|y| format!("X{:.3} Y{y:.3}", STEP * k as f64)));
    }
    program.extend(["G0 Z10", "M5", "M30", "%"].map(str::to_owned));
    let (answer, report) = verify(&program, &[]);
    let report = report.unwrap();
    let height = 3.0 - (9.0 - 0.25 * STEP * STEP).sqrt();
    let found = report["toolpaths"][0]["scallop"]["max_mm"].as_f64();
    assert!(
        found.is_some_and(|found| (found - height).abs() < 1e-6),
        "{found:?} {height}\n{}",
        answer.stdout
    );
    assert_eq!(report["verdict"], "pass", "{}", answer.stdout);
}

#[test]
fn it_stands_beside_planned_paths_in_one_table() {
    let home = tempfile::tempdir().unwrap();
    std::fs::write(home.path().join("plate.stl"), plate()).unwrap();
    std::fs::write(home.path().join("job.nc"), raster().join("\n")).unwrap();
    let scene = "[part]\nfile = \"plate.stl\"\n[cutter]\nshape = \"ball\"\ndiameter = 6\n[simulation]\ncell = 0.1\n\
                 [[toolpath]]\nstrategy = \"zigzag\"\nstepover = 0.4\n[[toolpath]]\nstrategy = \"program\"\nfile = \"job.nc\"\n";
    std::fs::write(home.path().join("scene.toml"), scene).unwrap();
    let answer = millstream(home.path(), &["run", "scene.toml", "--out", "out"]);
    assert_eq!(answer.code, Some(0), "{}{}", answer.stdout, answer.stderr);
    let report: Value =
        serde_json::from_slice(&std::fs::read(home.path().join("out/report.json")).unwrap()).unwrap();
    let height = |k: usize| report["toolpaths"][k]["scallop"]["max_mm"].as_f64().unwrap();
    let closed = 3.0 - (9.0f64 - 0.25 * STEP * STEP).sqrt();
    assert!(
        (height(0) - closed).abs() < 1e-4 && (height(1) - closed).abs() < 1e-4,
        "{} {}",
        height(0),
        height(1)
    );
    let inputs = report["inputs"].as_array().unwrap();
    assert!(inputs.iter().any(|input| input["file"] == "job.nc"), "{inputs:?}");
    let checked = millstream(home.path(), &["check", "scene.toml"]);
    assert!(
        checked.stdout.contains("strategy = \"program\"\nfile = \"job.nc\"\ncontrol = \"general\""),
        "{}",
        checked.stdout
    );
}

/// Time and air of a plan and of its own program are the same.
#[test]
fn a_planned_path_and_its_program_count_the_same() {
    let home = tempfile::tempdir().unwrap();
    std::fs::write(home.path().join("plate.stl"), plate()).unwrap();
    let scene = "[part]\nfile = \"plate.stl\"\n[cutter]\nshape = \"ball\"\ndiameter = 6\n[simulation]\ncell = 0.5\n\
                 [[toolpath]]\nstrategy = \"zigzag\"\nstepover = 0.4\n";
    let path_of = |scene: &str, k: usize| {
        std::fs::write(home.path().join("scene.toml"), scene).unwrap();
        let answer = millstream(home.path(), &["run", "scene.toml", "--out", "out"]);
        assert!(answer.code.is_some_and(|code| code < 2), "{}", answer.stderr);
        let report: Value =
            serde_json::from_slice(&std::fs::read(home.path().join("out/report.json")).unwrap()).unwrap();
        ["machining_time_s", "air_length_mm"].map(|key| report["toolpaths"][k]["path"][key].as_f64().unwrap())
    };
    let planned = path_of(scene, 0);
    std::fs::copy(home.path().join("out/zigzag/toolpath.nc"), home.path().join("job.nc")).unwrap();
    let read = path_of(&format!("{scene}[[toolpath]]\nstrategy = \"program\"\nfile = \"job.nc\"\n"), 1);
    for (planned, read) in planned.into_iter().zip(read) {
        assert!((read / planned - 1.0).abs() < 1e-3, "{planned} {read}");
    }
}

#[test]
fn a_feed_above_the_rapid_rate_is_found_with_its_line() {
    let home = tempfile::tempdir().unwrap();
    std::fs::write(home.path().join("slow.toml"), "[machine]\nrapid_rate = 500\n").unwrap();
    let (answer, report) = verify_in(home.path(), &raster(), &["--machine", "slow.toml"]);
    assert_eq!(answer.code, Some(1), "{}", answer.stderr);
    let report = report.unwrap();
    let line = line_of(&raster(), "G1 Z0");
    let text = format!("the highest feed is 600.0 mm/min in line {line} of job.nc (limit 500.0");
    assert!(violations(&report).iter().any(|found| found.starts_with(&text)), "{}", answer.stdout);
    let path = &report["toolpaths"][0]["path"];
    let [time, cut] = ["machining_time_s", "cutting_length_mm"].map(|key| path[key].as_f64().unwrap());
    assert!(time >= 60.0 * cut / 500.0, "{time} {cut}");
}

#[test]
fn a_gouge_is_found_with_the_line_that_made_it() {
    let mut program = raster();
    let line = line_of(&program, "X8.000 Y4.000");
    program[line - 1] += " Z-0.2";
    program[line] += " Z0";
    let (answer, report) = verify(&program, &[]);
    assert_eq!(answer.code, Some(1));
    let gouge = &report.unwrap()["toolpaths"][0]["gouge"];
    assert!((gouge["max_depth_mm"].as_f64().unwrap() - 0.2).abs() < 0.002, "{gouge}");
    assert_eq!(
        (&gouge["region_count"], &gouge["regions"][0]["line"]),
        (&Value::from(1), &Value::from(line)),
        "{gouge}"
    );
}

#[test]
fn faults_are_named_with_their_lines() {
    let sound = raster();
    let changed = |begin: &str, new: &str| {
        let mut program = sound.clone();
        let line = line_of(&program, begin);
        program[line - 1] = new.to_owned();
        (program, line)
    };
    let (rapid, line) = changed("X16.000 Y0.000", "G0 X16 Y0\nG1");
    assert_violates(&rapid, &[], "a rapid move touches stock");
    assert_violates(&rapid, &[], &format!("job.nc line {line}"));
    let first = line_of(&sound, "G1 Z0");
    assert_violates(
        &changed("S12000", "S12000").0,
        &[],
        &format!("line {first} feeds while the spindle is off"),
    );
    assert_violates(&changed("G1 Z0", "G1 Z0").0, &[], &format!("line {first} feeds and no F was given"));
    assert_violates(
        &changed("G43", "G43 H2").0,
        &[],
        &format!("line {first} feeds tool 1 with the length of register H2"),
    );
    // The other tool comes too late.
    let mut late = changed("T1 M6", "").0;
    let end = line_of(&late, "M5") - 1;
    late.splice(end..end, ["T2 M6", "S5000 M3", "G0 X0", "G1 Z9"].map(str::to_owned));
    assert_violates(&late, &["--tool", "0"], &format!("line {first} feeds before the first tool change"));
    let (answer, _) = verify(&late, &[]);
    assert!(
        answer.code == Some(2) && answer.stderr.contains("uses several tools (T0, T2)"),
        "{}",
        answer.stderr
    );
}

/// Corners rounded by up to P are off the program by as much, and by as much again where places within Q of a
/// line are left out.
#[test]
fn corners_that_a_control_may_round_widen_all_bounds() {
    let linuxcnc = |codes: &str| {
        let mut program = raster();
        program.insert(3, codes.to_owned());
        let (answer, report) = verify(&program, &["--control", "linuxcnc", "--allowance", "1"]);
        (answer.code, report.unwrap()["toolpaths"][0].clone())
    };
    let bound = |of: &Value| of["gouge"]["error_bound_mm"].as_f64().unwrap();
    let noted = |of: &Value| of["notes"].to_string().contains("nothing bounds by how much");
    let (exact, along_the_lines) = linuxcnc("G61");
    assert!(exact == Some(0) && !noted(&along_the_lines), "{along_the_lines}");
    let (small, near) = linuxcnc("G64 P0.001");
    assert!(small == Some(0) && !noted(&near), "{near}");
    assert!((bound(&near) - bound(&along_the_lines) - 0.002).abs() < 1e-9, "{near}");
    let (large, far) = linuxcnc("G64 P1");
    assert_eq!(large, Some(1), "{far}");
    assert!(far["violations"].as_array().unwrap().is_empty(), "{far}");
    let open = far["undecided"].as_array().unwrap();
    assert!(open.iter().any(|claim| claim["what"] == "gouge"), "{far}");
    assert!(open.iter().all(|claim| claim["text"].to_string().contains("G64 P")), "{far}");
    // No limit is known of either.
    for codes in ["G64", "G21"] {
        let (free, of_default) = linuxcnc(codes);
        assert!(free == Some(0) && noted(&of_default), "{codes}: {of_default}");
    }
}

#[test]
fn a_program_that_never_feeds_is_told_so_under_a_table_of_tools() {
    let tools = "[[tool]]\nnumber = 1\nshape = \"ball\"\ndiameter = 6\n[[tool]]\nnumber = 2\nshape = \"flat\"\ndiameter = 4\n";
    let home = tempfile::tempdir().unwrap();
    std::fs::write(home.path().join("tools.toml"), tools).unwrap();
    let program = ["G21 G90", "T1 M6", "G0 X1 Y1 Z9", "M30"].map(str::to_owned);
    let (answer, _) = verify_in(home.path(), &program, &["--tools", "tools.toml"]);
    assert!(answer.code == Some(2) && answer.stderr.contains("no tool moves at feed"), "{}", answer.stderr);
}

/// The tool has one length, and no table says which: with 20 mm the way down behind G49 ends 5 mm deep in the
/// plate. A rapid there is placed by the length under which the tool feeds.
#[test]
fn two_lengths_of_one_tool_leave_the_verdict_open() {
    let fanuc = ["--control", "fanuc", "--allowance", "1"];
    let with = |end: &[&str]| {
        let mut program = raster();
        program.insert(line_of(&program, "G43") - 1, "G10 L10 P1 R20.".into());
        let at = line_of(&program, "G0 Z10");
        program.splice(at..at, end.iter().map(|&line| line.to_owned()));
        program
    };
    for end in [&["G43 H1", "G1 Z0"][..], &["G49", "G0 Z60."], &["G91 G28 Z0", "G49", "G90"]] {
        let (answer, _) = verify(&with(end), &fanuc);
        assert_eq!(answer.code, Some(0), "{end:?}: {}", answer.stdout);
    }
    let fed = with(&["G49", "G1 Z15. F200"]);
    let (answer, report) = verify(&fed, &fanuc);
    let report = &report.unwrap();
    assert_eq!((answer.code, report["verdict"].as_str()), (Some(1), Some("undecided")), "{}", answer.stdout);
    let [first, line] = ["G1 Z0", "G1 Z15"].map(|begin| line_of(&fed, begin));
    let told = format!(
        "line {line} feeds tool 1 as if it were 0.0000 mm long, and line {first} as if it were 20.0000 mm long"
    );
    let open = report["toolpaths"][0]["undecided"].as_array().unwrap();
    let lengths = open.iter().find(|claim| claim["what"] == "tool lengths").unwrap();
    assert!(lengths["text"].as_str().unwrap().contains(&told), "{lengths}");
    assert!(lengths["reason"].as_str().unwrap().contains("`gauge_length`"), "{lengths}");
    assert_violates(&with(&["G49", "G0 Z15."]), &fanuc, "a rapid move touches stock");
}

/// Back along a slot: straight it is clear, and at 45 degrees it leads through stock.
#[test]
fn a_rapid_that_may_be_bent_into_stock_leaves_the_verdict_open() {
    let mut program = raster();
    let start = line_of(&program, "G1 Z0");
    program.splice(start..start, ["X16. Y4.", "G0 X0. Y0.", "G1"].map(str::to_owned));
    let (straight, _) = verify(&program, &["--allowance", "1"]);
    assert_eq!(straight.code, Some(0), "{}{}", straight.stdout, straight.stderr);
    for (control, setting) in [("haas", "setting 335"), ("fanuc", "parameter 1401")] {
        let (answer, report) = verify(&program, &["--allowance", "1", "--control", control]);
        assert_eq!(answer.code, Some(1), "{}{}", answer.stdout, answer.stderr);
        let report = report.unwrap();
        assert_eq!(report["verdict"], "undecided", "{}", answer.stdout);
        let notes = report["toolpaths"][0]["notes"].to_string();
        let line = format!("first in line {}", start + 2);
        assert!(notes.contains(setting) && notes.contains(&line), "{notes}");
        assert!(answer.stdout.contains("with one rate of all axes"), "{}", answer.stdout);
        // One axis at a time runs straight on every control.
        let mut clear = program.clone();
        clear.splice(start + 1..start + 2, ["G0 Z10.", "G0 X0. Y0.", "G1 Z0."].map(str::to_owned));
        let (answer, report) = verify(&clear, &["--allowance", "1", "--control", control]);
        assert_eq!(answer.code, Some(0), "{}{}", answer.stdout, answer.stderr);
        assert!(!report.unwrap()["toolpaths"][0]["notes"].to_string().contains(setting));
    }
}

#[test]
fn wrong_offsets_and_lengths_show() {
    let mut moved = raster();
    let line = line_of(&moved, "X0.000 Y4.000");
    moved.insert(line - 1, "G91 G10 L2 P2 X0.5 Y0 Z-0.1\nG90 G55 G1 Z0".to_owned());
    assert_violates(&moved, &[], "gouge 100.0");
    let home = tempfile::tempdir().unwrap();
    let tools = "[[tool]]\nnumber = 1\nshape = \"ball\"\ndiameter = 6\ngauge_length = 80\n";
    std::fs::write(home.path().join("tools.toml"), tools).unwrap();
    let (sound, _) = verify_in(home.path(), &raster(), &["--tools", "tools.toml"]);
    assert_eq!(sound.code, Some(0), "{}{}", sound.stdout, sound.stderr);
    let mut longer = raster();
    longer.insert(3, "G10 L1 P1 Z79".to_owned());
    let (answer, report) = verify_in(home.path(), &longer, &["--tools", "tools.toml"]);
    let found = violations(&report.unwrap());
    let named = "feeds tool 1 as if it were 79.0000 mm long; the table of tools has 80.0000 mm";
    assert!(answer.code == Some(1) && found.iter().any(|text| text.contains(named)), "{found:?}");
    assert!(found.iter().any(|text| text.contains("gouge 1000")), "{found:?}");
}

#[test]
fn what_cannot_be_read_is_refused_with_line_and_cure() {
    let cases: [(&str, &[&str]); 9] = [
        ("G1 X1 F1\nG41 D1 X2", &["job.nc:2:1", "must be straight and longer than", "help:"]),
        ("G1 X1 F1\nG2 X5 I1", &["job.nc:2:4", "the arc starts 1.0000 mm from its centre and ends 3.0000"]),
        ("G1 X1 F1\nG1 X[1/0]", &["job.nc:2:7", "division by zero"]),
        ("N1 G4\nGOTO 1", &["still running"]),
        ("G0\u{0}X", &["line 1, column 3", "expected text"]),
        ("(nothing)", &["moves nothing"]),
        ("O1 sub\nO1 call\nO1 endsub\nO1 call\nM2", &["job.nc:2:", "subprograms call each other", "help:"]),
        ("G1 X1 F1\nM6", &["job.nc:2:1", "M6 needs T", "help:"]),
        ("G1 X1 F1\nG1 X[1", &["job.nc:2:", "help:"]),
    ];
    for (program, expected) in cases {
        let (answer, report) = verify(&[program.to_owned()], &[]);
        assert_eq!((answer.code, report.is_none()), (Some(2), true), "{program}: {}", answer.stdout);
        for text in expected {
            assert!(answer.stderr.contains(text), "{program}: {}", answer.stderr);
        }
    }
}

#[test]
fn a_line_of_ten_megabytes_is_refused() {
    let long = "X1 ".repeat(3_500_000);
    let (answer, report) = verify(&["G1 F1".to_owned(), long], &[]);
    assert_eq!((answer.code, report.is_none()), (Some(2), true));
    assert!(answer.stderr.contains("line 2") && answer.stderr.len() < 100_000, "{}", answer.stderr.len());
}

#[test]
fn a_tool_is_judged_on_what_the_tools_before_it_left() {
    let home = tempfile::tempdir().unwrap();
    let tools = "[[tool]]\nnumber = 1\nshape = \"ball\"\ndiameter = 6\n[[tool]]\nnumber = 2\nshape = \"flat\"\ndiameter = 10\n";
    std::fs::write(home.path().join("tools.toml"), tools).unwrap();
    // A face mill takes the block off first; then a rapid of the ball runs close over the plate.
    let mut program = raster();
    let start = line_of(&program, "T1 M6") - 1;
    let face = ["T2 M6", "S8000 M3", "G0 X-10 Y2 Z5", "G1 Z0.2 F500", "X26", "Y7", "X-10", "G0 Z10"];
    program.splice(start..start, face.map(str::to_owned));
    let over = line_of(&program, "G1 Z0 F600");
    program.insert(over - 1, "G0 Z0.5\nX16\nX0".to_owned());
    let claims = |answer: &Answer, report: Option<Value>, kind: &str| -> Vec<String> {
        let report = report.unwrap_or_else(|| panic!("{}", answer.stderr));
        let found = report["toolpaths"][0][kind].as_array().unwrap();
        found.iter().map(|claim| claim["what"].as_str().unwrap().to_owned()).collect()
    };
    let (answer, report) = verify_in(home.path(), &program, &["--tools", "tools.toml", "--tool", "1"]);
    assert_eq!(answer.code, Some(0), "{}{}", answer.stdout, answer.stderr);
    drop(report);
    let (answer, report) = verify_in(home.path(), &program, &["--tool", "1"]);
    assert_eq!((answer.code, claims(&answer, report, "undecided")), (Some(1), vec!["rapid".to_owned()]));
    // What the face mill leaves, another tool may take.
    let (answer, report) = verify_in(home.path(), &program, &["--tools", "tools.toml", "--tool", "2"]);
    assert_eq!(claims(&answer, report, "undecided"), ["uncut"]);
}

/// The lowest place of an arc lies between its ends, 5.50 µm below the plate.
#[test]
fn an_arc_is_judged_and_not_its_chords() {
    let mut lines = raster();
    let end = lines.len() - 4;
    let arc = ["G0 Z5", "X7.69 Y4", "G1 Z-0.004539", "G18 G2 X8.31 Z-0.004539 I0.31 K49.999039", "G17"];
    lines.splice(end..end, arc.map(str::to_owned));
    let (answer, report) = verify(&lines, &[]);
    let gouge = &report.unwrap()["toolpaths"][0]["gouge"];
    let [depth, bound] = ["max_depth_mm", "error_bound_mm"].map(|key| gouge[key].as_f64().unwrap());
    assert!((depth - 0.0055).abs() <= bound && bound < 0.0003, "{depth} {bound}");
    assert!(depth - bound > 0.005 && answer.code == Some(1), "{}", answer.stdout);
}

/// FreeCAD's program for a block with a pocket, a boss and holes. Its arcs are 7 to 8 µm too near to the
/// boss, and its pocket leaves islands and corners: so says a union of the discs of all moves, too.
#[test]
fn a_prismatic_part_is_judged_with_its_walls() {
    let home = tempfile::tempdir().unwrap();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/programs");
    let file = |name: &str| folder.join(name).to_string_lossy().into_owned();
    let (part, job) = (file("freecad_part.stl"), file("freecad_job_linuxcnc.ngc"));
    let arguments =
        ["verify", "--part", &part, "--program", &job, "--cutter", "flat:5", "--cell", "0.1", "--out", "out"];
    let answer = millstream(home.path(), &arguments);
    assert_eq!(answer.code, Some(1), "{}{}", answer.stdout, answer.stderr);
    let report = std::fs::read(home.path().join("out/report.json")).unwrap();
    let report: Value = serde_json::from_slice(&report).unwrap();
    let toolpath = &report["toolpaths"][0];
    let number = |pointer: &str| toolpath.pointer(pointer).unwrap().as_f64().unwrap();
    let gouge = number("/gouge/max_depth_mm");
    assert!(
        (0.0060..0.0086).contains(&gouge) && number("/gouge/error_bound_mm") < 0.002,
        "{}",
        toolpath["gouge"]
    );
    assert_eq!(toolpath["gouge"]["regions"][0]["line"], 125);
    // The walls of the block, the pocket, the boss and the holes; the underside alone is not judged.
    let walls = 2.0 * (60.0 + 40.0) * 15.0
        + 2.0 * (24.0 + 20.0) * 6.0
        + 6.0 * 8.0 * std::f64::consts::PI
        + 3.0 * 15.0 * 5.0 * std::f64::consts::PI;
    assert!((number("/coverage/by_moves_mm2") - walls).abs() < 1e-3 * walls, "{}", toolpath["coverage"]);
    assert_eq!(number("/coverage/walls_mm2"), 0.0);
    assert!((number("/uncut/max_height_mm") - 6.0).abs() < 1e-6, "{}", toolpath["uncut"]);
    assert!(number("/excess/error_bound_mm") < 1.1, "{}", toolpath["excess"]);
}

/// Passes about as far apart as cells leave ridges of one height, and so say all figures.
#[test]
fn passes_as_far_apart_as_cells_leave_ridges_of_one_height() {
    for step in [0.09, 0.093, 0.0952, 0.097, 0.1, 0.1011, 0.104, 0.107, 0.11, 0.21] {
        let mut program = raster();
        let (begin, end) = (line_of(&program, "X0.000 Y0.000"), program.len() - 4);
        let rows = (0..=(SIZE[1] / step).ceil() as usize).flat_map(|k| {
            let (y, ends) = (step * k as f64, if k % 2 == 0 { [0.0, SIZE[0]] } else { [SIZE[0], 0.0] });
            ends.map(|x| format!("X{x:.3} Y{y:.4}"))
        });
        program.splice(begin - 1..end, rows);
        let (answer, report) = verify(&program, &[]);
        assert_eq!(answer.code, Some(0), "{step}: {}{}", answer.stdout, answer.stderr);
        let toolpath = &report.unwrap()["toolpaths"][0];
        let closed = 3.0 - (9.0f64 - 0.25 * step * step).sqrt();
        let number = |pointer: &str| toolpath.pointer(pointer).unwrap().as_f64().unwrap();
        // Where rows turn, ridges are lower.
        for (key, off) in [("max_mm", 1e-3), ("p95_mm", 1e-3), ("p50_mm", 1e-3), ("mean_mm", 0.01)] {
            assert!(
                (number(&format!("/scallop/{key}")) / closed - 1.0).abs() < off,
                "{step} {key}: {toolpath}"
            );
        }
        assert_eq!(number("/scallop/over_target_fraction"), 0.0);
        let ridges = number("/scallop/ridge_length_mm") / (SIZE[0] * (SIZE[1] / step).floor());
        assert!((ridges - 1.0).abs() < 0.03, "{step}: {ridges}");
        // Mean square and mean distance from the mean of parabolas between ridges.
        assert!(
            (number("/deviation/rms_mm") * 5f64.sqrt() / closed - 1.0).abs() < 0.03,
            "{step}: {toolpath}"
        );
        let ra = step * step / (18.0 * 3f64.sqrt() * 3.0);
        assert!((number("/roughness/ra_mm") / ra - 1.0).abs() < 0.03, "{step}: {}", toolpath["roughness"]);
        assert!(number("/excess/max_mm") <= closed + 1e-6, "{step}: {}", toolpath["excess"]);
    }
}

#[test]
fn cutters_come_from_tables_of_linuxcnc_and_from_comments() {
    let home = tempfile::tempdir().unwrap();
    std::fs::write(home.path().join("tool.tbl"), "T1 P1 D6 ;ball nose\nT2 P2 D10 ;end mill\n").unwrap();
    let (answer, report) = verify_in(home.path(), &raster(), &["--tools", "tool.tbl", "--tool", "1"]);
    assert_eq!((answer.code, report.is_some()), (Some(0), true), "{}{}", answer.stdout, answer.stderr);
    std::fs::write(home.path().join("plate.stl"), plate()).unwrap();
    let run = |program: &[String]| {
        std::fs::write(home.path().join("job.nc"), program.join("\n")).unwrap();
        millstream(
            home.path(),
            &["verify", "--part", "plate.stl", "--program", "job.nc", "--cell", "0.1", "--out", "out"],
        )
    };
    let mut described = raster();
    described.insert(2, "(T1 D=6. CR=3. - ball end mill)".to_owned());
    let answer = run(&described);
    assert_eq!(answer.code, Some(0), "{}{}", answer.stdout, answer.stderr);
    let answer = run(&raster());
    assert_eq!(answer.code, Some(2));
    assert!(
        answer.stderr.contains("describes no cutter") && answer.stderr.contains("--cutter"),
        "{}",
        answer.stderr
    );
}

/// Verifies the plate by a program alone, without `--cutter`.
fn verify_by_comments(program: &[String], options: &[&str]) -> (Answer, Option<Value>) {
    let home = tempfile::tempdir().unwrap();
    std::fs::write(home.path().join("plate.stl"), plate()).unwrap();
    std::fs::write(home.path().join("job.nc"), program.join("\n") + "\n").unwrap();
    let mut arguments =
        vec!["verify", "--part", "plate.stl", "--program", "job.nc", "--cell", "0.1", "--out", "out"];
    arguments.extend(options);
    let answer = millstream(home.path(), &arguments);
    let report = std::fs::read(home.path().join("out/report.json")).ok();
    (answer, report.map(|bytes| serde_json::from_slice(&bytes).unwrap()))
}

/// The raster with comments behind its first two lines.
fn raster_with(comments: &[&str]) -> Vec<String> {
    let mut program = raster();
    program.splice(2..2, comments.iter().map(|&comment| comment.to_owned()));
    program
}

#[test]
fn comments_that_leave_the_cutter_open_are_refused_with_their_lines() {
    for (comments, told) in [
        (&["(T1 D=20-0.5 CR=10 - ball end mill)"][..], "line 3 does not say the cutter"),
        (&["(NOT T1 D=20 CR=10 - ball end mill)"], "line 3 does not say the cutter"),
        (&["(T1 D=6. - bull nose end mill)"], "line 3 does not say the cutter"),
        (&["(T1 D=1/4 CR=1/8 - ball end mill)"], "line 3 does not say the cutter"),
        (&["(T1 D=20. CR=10.)", "(T1 D=6. CR=3.)"], "lines 3 and 4 say different cutters of tool 1"),
    ] {
        let (answer, report) = verify_by_comments(&raster_with(comments), &[]);
        let told_all = answer.stderr.replace("\n", " ").split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!((answer.code, report.is_none()), (Some(2), true), "{comments:?}: {}", answer.stdout);
        assert!(told_all.contains(told) && told_all.contains("--cutter"), "{comments:?}: {told_all}");
    }
    // A unit behind the number counts, whatever that of the program is.
    let inches = "(T1 D=.23622in CR=.11811\" - ball end mill)";
    let (answer, _) = verify_by_comments(&raster_with(&[inches]), &[]);
    assert_eq!(answer.code, Some(0), "{}{}", answer.stdout, answer.stderr);
}

#[test]
fn a_cutter_that_is_another_than_the_program_says_is_noted() {
    let notes = |comments: &[&str]| -> Vec<String> {
        let (answer, report) = verify(&raster_with(comments), &[]);
        assert_eq!(answer.code, Some(0), "{}{}", answer.stdout, answer.stderr);
        let notes = report.unwrap()["toolpaths"][0]["notes"].as_array().unwrap().clone();
        notes.iter().map(|note| note.as_str().unwrap().to_owned()).collect()
    };
    let told =
        "the program says that the cutter of tool 1 is ball:20 (job.nc line 3); ball:6 is measured, as asked";
    assert!(notes(&["(T1 D=20. CR=10.)"]).contains(&told.to_owned()));
    assert!(
        notes(&["(T1 D=20.)", "(T1 D=8.)"]).iter().any(|note| note.contains("lines 3 and 4 say different"))
    );
    assert!(notes(&["(T1 D=6. CR=3. - ball)"]).iter().all(|note| !note.contains("is measured")));
}

#[test]
fn one_cutter_for_several_tools_is_refused_with_the_words_of_verify() {
    let (answer, report) = verify(&roughed_and_finished(), &[]);
    assert_eq!((answer.code, report.is_none()), (Some(2), true), "{}", answer.stdout);
    for text in ["--tool 1", "--tools"] {
        assert!(answer.stderr.contains(text), "{text}: {}", answer.stderr);
    }
    assert!(!answer.stderr.contains("tool = "), "{}", answer.stderr);
}

/// A face mill that leaves a hair, then a ball that finishes.
fn roughed_and_finished() -> Vec<String> {
    let mut program = raster();
    let start = line_of(&program, "T1 M6") - 1;
    let rough = [
        "T2 M6",
        "S8000 M3",
        "G43 H2",
        "G0 X-10 Y2 Z10",
        "G1 Z0.2 F500",
        "X26",
        "Y7",
        "X5 Z0.2",
        "X-10",
        "G0 Z10",
        "M5",
    ];
    program.splice(start..start, rough.map(str::to_owned));
    program
}

const TOOLS: &str = "[[tool]]\nnumber = 1\nshape = \"ball\"\ndiameter = 6\ngauge_length = 80\n[[tool]]\nnumber = 2\n\
                     shape = \"flat\"\ndiameter = 10\ngauge_length = 60\ncutting_length = 20\n[[tool.holder]]\ndiameter = 16\n\
                     length = 30\n";

/// All tools of a program with the table [`TOOLS`].
fn verify_all(program: &[String]) -> (Answer, Option<Value>) {
    let home = tempfile::tempdir().unwrap();
    std::fs::write(home.path().join("tools.toml"), TOOLS).unwrap();
    verify_in(home.path(), program, &["--tools", "tools.toml"])
}

#[track_caller]
fn assert_all_violate(program: &[String], texts: &[String]) -> Value {
    let (answer, report) = verify_all(program);
    assert_eq!(answer.code, Some(1), "{}", answer.stderr);
    let report = report.unwrap();
    let found = violations(&report);
    for text in texts {
        assert!(found.iter().any(|sentence| sentence.contains(text)), "{text}: {found:?}");
    }
    report
}

#[test]
fn all_tools_of_a_program_make_one_part() {
    let home = tempfile::tempdir().unwrap();
    std::fs::write(home.path().join("tools.toml"), TOOLS).unwrap();
    let program = roughed_and_finished();
    let (answer, report) = verify_in(home.path(), &program, &["--tools", "tools.toml"]);
    assert_eq!(answer.code, Some(0), "{}{}", answer.stdout, answer.stderr);
    let report = report.unwrap();
    let toolpath = &report["toolpaths"][0];
    assert_eq!(toolpath["program"]["tools"], serde_json::json!([2, 1]));
    // Both tools take their part: the block of 1 mm is gone.
    let removed = toolpath["removal"]["volume_mm3"].as_f64().unwrap();
    assert!((removed / (SIZE[0] * SIZE[1]) - 1.0).abs() < 0.01, "{}", toolpath["removal"]);
    assert!(toolpath["removal"]["engine_difference_mm"].as_f64().unwrap() < 1e-5);
    assert!(toolpath["clearance"]["pairs"].as_array().unwrap().iter().any(|pair| pair["tool_number"] == 2));
    let notes = toolpath["notes"].to_string();
    assert!(notes.contains("job.nc, tool 2: the first cut is in line"), "{notes}");
    let locations = std::fs::read_to_string(home.path().join("out/job/toolpath.cls")).unwrap();
    assert!(
        locations.contains("LOADTL/2\nCUTTER/10.0,0.0") && locations.contains("LOADTL/1\nCUTTER/6.0,3.0")
    );
    // The locations that were written are that program again.
    let again =
        ["verify", "--part", "plate.stl", "--program", "out/job/toolpath.cls", "--tools", "tools.toml"];
    let answer = millstream(home.path(), &[&again[..], &["--cell", "0.1", "--out", "again"]].concat());
    assert_eq!(answer.code, Some(0), "{}{}", answer.stdout, answer.stderr);
}

#[test]
fn a_fault_of_any_tool_is_named_with_line_and_tool() {
    let sound = roughed_and_finished();
    let line = line_of(&sound, "X5 Z0.2");
    let mut gouged = sound.clone();
    gouged[line - 1] = "X5 Z-0.2".to_owned();
    gouged[line] = "X-10 Z0.2".to_owned();
    let report = assert_all_violate(&gouged, &[format!("job.nc line {line}, tool 2")]);
    let gouge = &report["toolpaths"][0]["gouge"];
    assert!((gouge["max_depth_mm"].as_f64().unwrap() - 0.2).abs() < 0.002, "{gouge}");
    assert_eq!((&gouge["regions"][0]["line"], &gouge["regions"][0]["tool"]), (&line.into(), &2.into()));
    // A rapid of the first tool through the block that stands then, and one of the second through what the
    // first left.
    let mut rapid = sound.clone();
    let feed = line_of(&sound, "X26");
    rapid[feed - 1] = "G0 X26\nG1".to_owned();
    assert_all_violate(&rapid, &["a rapid move touches stock".to_owned(), format!("line {feed}, tool 2")]);
    let mut rapid = sound.clone();
    let feed = line_of(&sound, "G1 Z0 F600");
    rapid[feed - 1] = "G0 Z0.1\nG1 F600".to_owned();
    assert_all_violate(
        &rapid,
        &["a rapid move touches stock, 0.".to_owned(), format!("line {feed}, tool 1")],
    );
    // The second tool is taken for a millimetre shorter than it is.
    let mut longer = sound.clone();
    longer.insert(3, "G10 L1 P1 Z79".to_owned());
    let named = "feeds tool 1 as if it were 79.0000 mm long; the table of tools has 80.0000 mm";
    assert_all_violate(&longer, &[named.to_owned(), "gouge 1000".to_owned(), ", tool 1".to_owned()]);
    // A spindle that the second tool forgets.
    let mut still = sound.clone();
    let start = line_of(&sound, "S12000 M3");
    still[start - 1] = "S12000".to_owned();
    let named = format!("line {feed} feeds while the spindle is off, tool 1");
    assert_all_violate(&still, &[named]);
}

#[test]
fn a_missing_tool_change_is_found_and_named() {
    let mut program = roughed_and_finished();
    let change = line_of(&program, "T1 M6");
    program[change - 1].clear();
    let line = line_of(&program, "G1 Z0 F600");
    let named =
        format!("line {line} feeds tool 2 as if it were 80.0000 mm long; the table of tools has 60.0000 mm");
    let (answer, report) = verify_all(&program);
    assert_eq!(answer.code, Some(1), "{}", answer.stderr);
    let found = violations(&report.unwrap());
    assert!(found.iter().any(|text| text.contains(&named)), "{found:?}");
}

#[test]
fn a_tool_whose_cutter_is_not_known_is_named() {
    let mut program = roughed_and_finished();
    let change = line_of(&program, "T1 M6");
    program[change - 1] = "T7 M6".to_owned();
    let (answer, report) = verify_all(&program);
    assert_eq!((answer.code, report.is_none()), (Some(2), true), "{}", answer.stdout);
    let line = line_of(&program, "G1 Z0 F600");
    for text in ["no cutter is known for tool 7", &format!("line {line}"), "describe tool 7"] {
        assert!(answer.stderr.contains(text), "{text}: {}", answer.stderr);
    }
    // Comments may describe them all.
    let mut described = roughed_and_finished();
    described.splice(
        2..2,
        ["(T1 D=6. CR=3. - ball end mill)", "(T2 D=10. CR=0. - flat end mill)"].map(str::to_owned),
    );
    let home = tempfile::tempdir().unwrap();
    std::fs::write(home.path().join("plate.stl"), plate()).unwrap();
    std::fs::write(home.path().join("job.nc"), described.join("\n")).unwrap();
    let arguments = ["verify", "--part", "plate.stl", "--program", "job.nc", "--cell", "0.1", "--out", "out"];
    let answer = millstream(home.path(), &arguments);
    assert_eq!(answer.code, Some(0), "{}{}", answer.stdout, answer.stderr);
}

/// One tool that is all tools has the figures that it has by itself, bit for bit.
#[test]
fn one_tool_as_all_is_that_tool() {
    let home = tempfile::tempdir().unwrap();
    std::fs::write(home.path().join("tools.toml"), TOOLS).unwrap();
    std::fs::write(home.path().join("plate.stl"), plate()).unwrap();
    std::fs::write(home.path().join("job.nc"), raster().join("\n")).unwrap();
    let measured = |tool: &str| {
        let scene = format!(
            "[part]\nfile = \"plate.stl\"\njudge = \"walls\"\n[cutter]\nshape = \"ball\"\ndiameter = 6\n[simulation]\n\
             cell = 0.1\n[[toolpath]]\nstrategy = \"program\"\nfile = \"job.nc\"\ntools = \"tools.toml\"\ntool = {tool}\n"
        );
        std::fs::write(home.path().join("scene.toml"), scene).unwrap();
        let answer = millstream(home.path(), &["run", "scene.toml", "--out", "out"]);
        assert_eq!(answer.code, Some(0), "{}{}", answer.stdout, answer.stderr);
        let report = std::fs::read(home.path().join("out/report.json")).unwrap();
        let mut report: Value = serde_json::from_slice(&report).unwrap();
        report["toolpaths"][0]["simulation"]["wall_s"].take();
        report["toolpaths"].take()
    };
    assert_eq!(measured("1"), measured("\"all\""));
    let checked = millstream(home.path(), &["check", "scene.toml"]);
    assert!(checked.stdout.contains("tool = \"all\"\ntools = \"tools.toml\""), "{}", checked.stdout);
}

/// A round bar along x whose top lies 0.9 mm over the plate, and the block around it.
const BAR: &str = "[stock]\ndiameter = 20\nlength = 16\nfrom = [0, 4, -9.1]\naxis = \"x\"\n";
const BLOCK_AROUND_IT: &str = "[stock]\ncorners = [[0, -6, -19.1], [16, 14, 0.9]]\n";

/// What the raster leaves of a bar, by brute force: mm³ that it removes.
fn removed_of_bar() -> f64 {
    let pitch = 0.02;
    let removed = |x: f64, y: f64| {
        let top = (100.0 - (y - 4.0) * (y - 4.0)).sqrt() - 9.1;
        let beside = (0.0f64).max(-x).max(x - SIZE[0]);
        let cut = |k: usize| {
            let d = (y - STEP * k as f64).hypot(beside);
            if d < 3.0 { 3.0 - (9.0 - d * d).sqrt() } else { f64::INFINITY }
        };
        (top - (0..=(SIZE[1] / STEP) as usize).map(cut).fold(f64::INFINITY, f64::min)).max(0.0)
    };
    let centres = |from: f64, to: f64| {
        (0..((to - from) / pitch).round() as usize).map(move |k| from + pitch * (k as f64 + 0.5))
    };
    centres(-6.0, 14.0).map(|y| removed(8.0, y)).sum::<f64>() * pitch * SIZE[0]
}

/// Where the raster of half of the plate ends, a round bar stands as high as its closed form, and a rapid
/// beside its top is in the air; in the block around it the same rapid cuts.
#[test]
fn stock_has_its_own_shape() {
    let home = tempfile::tempdir().unwrap();
    std::fs::write(home.path().join("bar.toml"), BAR).unwrap();
    std::fs::write(home.path().join("block.toml"), BLOCK_AROUND_IT).unwrap();
    let (_, whole) = verify_in(home.path(), &raster(), &["--stock", "bar.toml"]);
    let removal = &whole.unwrap()["toolpaths"][0]["removal"];
    let [volume, bound] = ["volume_mm3", "volume_error_bound_mm3"].map(|key| removal[key].as_f64().unwrap());
    assert!((volume - removed_of_bar()).abs() < bound, "{volume} ± {bound}, {}", removed_of_bar());
    assert!(bound < 0.1 * volume);
    let mut half: Vec<String> = raster().iter().map(|line| line.replace("X16.000", "X8.000")).collect();
    let end = half.len() - 3;
    half.splice(end..end, ["G0 Y-1", "G0 Z0.2", "G0 X16", "G0 Z10"].map(str::to_owned));
    for (stock, rapids) in [("bar.toml", false), ("block.toml", true)] {
        let (answer, report) = verify_in(home.path(), &half, &["--stock", stock]);
        let report = report.unwrap();
        let toolpath = &report["toolpaths"][0];
        let excess = &toolpath["excess"];
        let [highest, bound] = ["max_mm", "error_bound_mm"].map(|key| excess[key].as_f64().unwrap());
        assert!((highest - 0.9).abs() <= bound && bound < 1e-5, "{stock}: {highest} {bound}");
        let found = violations(&report).iter().any(|sentence| sentence.contains("rapid move touches stock"));
        assert_eq!((answer.code, found), (Some(1), rapids), "{stock}: {}", answer.stdout);
    }
}

/// Cells are wider than the cutter, the rib and the step in the block's side: neither is missed.
#[test]
fn what_stands_between_the_centres_of_cells_is_met() {
    let home = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| std::fs::write(home.path().join(name), text).unwrap();
    file("block.toml", "[stock]\ncorners = [[-5, -5, -20], [21, 13, 0]]\n");
    let tool = |diameter: f64| {
        format!(
            "[[tool]]\nnumber = 1\nshape = \"flat\"\ndiameter = {diameter}\ngauge_length = 80\ncutting_length = 5\n[[tool.holder]]\n\
                 diameter = {diameter}\nlength = 40\n"
        )
    };
    let claims = |diameter: f64, moves: &[&str]| -> [String; 2] {
        file("tools.toml", &tool(diameter));
        let head = ["G21 G90 G17 G94", "T1 M6", "S12000 M3", "G43 H1", "G0 X-13 Y4 Z20"];
        let program: Vec<String> =
            head.iter().chain(moves).chain(&["G0 Z20", "M30"]).map(|&line| line.to_owned()).collect();
        let options = ["--tools", "tools.toml", "--stock", "block.toml"];
        let report = verify_in(home.path(), &program, &options).1.unwrap();
        ["rapid", "flute length"].map(|what| {
            let kinds = ["violations", "undecided", "held"];
            let of_kind = |kind: &&&str| {
                let all = report["toolpaths"][0][**kind].as_array();
                all.is_some_and(|all| all.iter().any(|claim| claim["what"] == what))
            };
            kinds.iter().find(of_kind).map_or_else(String::new, |kind| (*kind).to_owned())
        })
    };
    let violated = "violations".to_owned();
    // Through the block between two rows of cells, and along its side.
    assert_eq!(claims(0.04, &["G0 Y4.00", "G0 Z-5", "G0 X30"])[0], violated);
    assert_eq!(claims(6.0, &["G0 Y-20", "G0 Z-5", "G0 X-7.99", "G0 Y30"])[0], violated);
    assert_eq!(claims(6.0, &["G0 Y-20", "G0 Z-5", "G0 X-8", "G0 Y30"])[0], "held");
    // A rib of 0.03 mm between two slots, which the third pass takes.
    let pass = |y: f64, z: f64| format!("G0 X-13 Y{y}\nG1 Z{z} F600\nX30\nG0 Z20");
    let rib = |wide: f64, deep: f64| {
        let (low, high) = (pass(4.0 - 3.0 - 0.5 * wide, -4.0), pass(4.0 + 3.0 + 0.5 * wide, -4.0));
        claims(6.0, &[&low, &high, &pass(4.0, deep)])
    };
    assert_eq!(rib(0.03, -6.0)[1], violated);
    let layers = claims(6.0, &[&pass(4.0, -4.0), &pass(4.0, -8.0), &pass(4.0, -12.0)]);
    assert_eq!([rib(0.03, -4.5), layers], [["held"; 2], ["held"; 2]]);
}

/// A mesh of the block around the part is that block.
#[test]
fn stock_of_a_mesh_is_measured_as_the_same_block() {
    let home = tempfile::tempdir().unwrap();
    let [x, y] = SIZE;
    let corner = |k: usize| {
        let [a, b, c] = [[0.0, x], [0.0, y], [-5.0, 1.0]];
        format!("vertex {} {} {}\n", a[k & 1], b[k >> 1 & 1], c[k >> 2 & 1])
    };
    let faces = [
        [0, 2, 3],
        [0, 3, 1],
        [4, 5, 7],
        [4, 7, 6],
        [0, 1, 5],
        [0, 5, 4],
        [2, 6, 7],
        [2, 7, 3],
        [0, 4, 6],
        [0, 6, 2],
        [1, 3, 7],
        [1, 7, 5],
    ];
    let facets: String = faces
        .map(|face| {
            format!("facet normal 0 0 0\nouter loop\n{}endloop\nendfacet\n", face.map(corner).concat())
        })
        .concat();
    std::fs::write(home.path().join("casting.stl"), format!("solid block\n{facets}endsolid block\n"))
        .unwrap();
    let (_, of_block) = verify_in(home.path(), &raster(), &[]);
    let (answer, of_mesh) = verify_in(home.path(), &raster(), &["--stock", "casting.stl"]);
    assert_eq!(answer.code, Some(0), "{}{}", answer.stdout, answer.stderr);
    let of_mesh = of_mesh.unwrap();
    assert_eq!(of_mesh["inputs"].as_array().unwrap().len(), 3);
    for key in ["excess", "removal", "uncut", "gouge", "scallop", "deviation"] {
        assert_eq!(of_mesh["toolpaths"][0][key], of_block.as_ref().unwrap()["toolpaths"][0][key], "{key}");
    }
    // A pit in the middle of the top reaches below the plate, whose corners all lie in the stock.
    let pit = |k: usize| {
        let [a, b] = [[4, 5], [5, 7], [7, 6], [6, 4]][k].map(corner);
        format!("facet normal 0 0 0\nouter loop\n{a}{b}vertex 8 4 -2\nendloop\nendfacet\n")
    };
    let others = facets.split_inclusive("endfacet\n").enumerate().filter(|(k, _)| !(2..4).contains(k));
    let others: String = others.map(|(_, facet)| facet).collect();
    let pitted = format!("solid pit\n{others}{}endsolid pit\n", (0..4).map(pit).collect::<String>());
    std::fs::write(home.path().join("pit.stl"), pitted).unwrap();
    let (answer, _) = verify_in(home.path(), &raster(), &["--stock", "pit.stl"]);
    assert_eq!(answer.code, Some(2));
    assert!(answer.stderr.contains("out of its stock at x 8"), "{}", answer.stderr);
    // A part out of its stock is refused with the place.
    std::fs::write(home.path().join("low.toml"), "[stock]\ncorners = [[0, 0, -5], [12, 8, 1]]\n").unwrap();
    let (answer, _) = verify_in(home.path(), &raster(), &["--stock", "low.toml"]);
    assert_eq!(answer.code, Some(2));
    assert!(answer.stderr.contains("4.000 mm out of its stock at x 16.000"), "{}", answer.stderr);
}

/// The start is where the machine is at home: no place higher than its travel is assumed for a program that
/// goes there first.
#[test]
fn a_program_from_the_top_of_a_machine_keeps_within_its_travel() {
    let home = tempfile::tempdir().unwrap();
    let machine = "[machine.kinematics]\npreset = \"ac-table\"\npost = \"full\"\ngauge_length = 120\n\
                   workpiece_zero = [50, 40, -300]\nz = [-500, 0]\n";
    std::fs::write(home.path().join("mill.toml"), machine).unwrap();
    let mut program = raster();
    (program[3], program[6], program[7]) = ("G53 G0 Z0".into(), "A0 C0".into(), "G0 X0 Y0".into());
    program.insert(8, "Z10".into());
    let (answer, report) = verify_in(home.path(), &program, &["--machine", "mill.toml"]);
    assert_eq!(answer.code, Some(0), "{}{}", answer.stdout, answer.stderr);
    assert!(violations(&report.unwrap()).is_empty());
}

#[test]
fn rotary_words_go_through_the_machine_that_is_named() {
    let mut leaning = raster();
    leaning[6] = "G43.4 H1".into();
    leaning.insert(7, "G0 A0 C0".into());
    let (answer, _) = verify(&leaning, &["--machine", "ac-table"]);
    assert_eq!(answer.code, Some(0), "{}{}", answer.stdout, answer.stderr);
    // Five degrees of lean take a ball off its lines and into the plate.
    let at = leaning.iter().position(|line| line == "X8.000 Y0.800").unwrap();
    leaning[at] += " A5";
    assert_violates(&leaning, &["--machine", "ac-table"], "gouge");
    let home = tempfile::tempdir().unwrap();
    std::fs::write(home.path().join("mill.toml"), "[machine]\nkinematics = \"ac-table\"\nfeed = 3\n")
        .unwrap();
    let (answer, _) = verify_in(home.path(), &leaning, &["--machine", "mill.toml"]);
    assert!(answer.code == Some(2) && answer.stderr.contains("feed = 3"), "{}", answer.stderr);
}
