//! `stock = "previous"`: toolpaths that cut one block, one after the other.

use std::path::Path;

use serde_json::Value;

use crate::command::millstream;

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
    // Lengths and program are those of its own moves.
    assert_eq!(finish["path"], alone["path"]);
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
    assert!(text.contains("of the toolpath rough before this one, line 6"), "{text}");
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
    let refused = |scene: &str, text: &str| {
        std::fs::write(home.path().join("scene.toml"), scene).unwrap();
        let answer = millstream(home.path(), &["run", "scene.toml", "--out", "out"]);
        assert_eq!(answer.code, Some(2), "{}", answer.stdout);
        assert!(answer.stderr.contains(text), "{}", answer.stderr);
    };
    refused(&format!("{PLATE}{ROUGH}{PREVIOUS}"), "no toolpath comes before this one");
    refused(&format!("{PLATE}{ROUGH}{FINISH}stock = \"next\"\n"), "cannot be \"next\"");
    let leaning = format!("{PLATE}{ROUGH}{FINISH}{PREVIOUS}axis = {{ lead = 10 }}\n");
    let (code, report) = run(home.path(), &leaning);
    let reason = report["toolpaths"][1]["reason"].as_str().unwrap();
    assert!(code == Some(1) && reason.contains("measured on a block of its own"), "{reason}");
}
