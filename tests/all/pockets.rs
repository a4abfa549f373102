//! Pockets through the command: programs with arcs, sides at the edge of the stock.

use std::fs;
use std::path::Path;

use millstream::geometry::Point3;
use millstream::motion::{MoveKind, Toolpath};
use millstream::program::{GENERAL_CONTROL, Placing, Program, Setup, read_apt, read_gcode};
use serde_json::Value;

use crate::command::millstream;

fn scene(part: &str, rest: &str) -> String {
    format!(
        "[part]\nsurface = \"pocket\"\noutline = [[0, 0], [30, 0], [30, 10], [15, 10], [15, 20], [0, 20]]\n{part}depth = 2\n[cutter]\n\
         shape = \"flat\"\ndiameter = 6\n[tolerance]\nchord = 0.005\n{rest}[[toolpath]]\nstrategy = \"pocket-offset\"\n\
         engagement = 70\n"
    )
}

/// Runs a scene, which passes, and leaves its report's first toolpath and the place of its files.
fn run(home: &Path, name: &str, text: &str) -> (Value, std::path::PathBuf) {
    fs::write(home.join(format!("{name}.toml")), text).unwrap();
    let answer = millstream(home, &["run", &format!("{name}.toml"), "--out", name]);
    assert_eq!(answer.code, Some(0), "{} {}", answer.stdout, answer.stderr);
    let report: Value =
        serde_json::from_slice(&fs::read(home.join(name).join("report.json")).unwrap()).unwrap();
    (report["toolpaths"][0].clone(), home.join(name).join("pocket-offset"))
}

fn path_of(program: &Program) -> Toolpath {
    let placing = Placing { chord: 1e-4, kinematics: None, lengths: &|_| None };
    program.runs(&placing).unwrap().swap_remove(0).path
}

/// How far places that a path feeds to lie from another one at most.
fn farthest(from: &Toolpath, to: &Toolpath) -> f64 {
    let away = |p: &Point3, a: &Point3, b: &Point3| {
        let along = b - a;
        let square = along.norm_squared();
        let t = if square > 0.0 { ((p - a).dot(&along) / square).clamp(0.0, 1.0) } else { 0.0 };
        (p - (a + along * t)).norm()
    };
    let sides: Vec<(Point3, Point3)> = to.segments().map(|(a, b, _)| (a, b)).collect();
    let nearest = |p: &Point3| sides.iter().map(|(a, b)| away(p, a, b)).fold(f64::INFINITY, f64::min);
    let fed = from.moves.iter().filter(|m| m.kind != MoveKind::Rapid);
    fed.map(|m| nearest(&m.to.tip)).fold(0.0, f64::max)
}

/// The program with arcs, read back, stays as near to the moves, which the locations in APT are, as it was asked to.
#[test]
fn arcs_of_a_program_stay_at_the_moves() {
    let home = tempfile::tempdir().unwrap();
    let (_, folder) = run(home.path(), "arcs", &scene("", "[machine]\narcs = 0.002\n"));
    let text = fs::read(folder.join("toolpath.nc")).unwrap();
    let lines = String::from_utf8_lossy(&text);
    let arcs = lines.lines().filter(|line| line.contains(" I") && line.contains(" J")).count();
    assert!(arcs > 20, "{arcs}");
    let program = read_gcode("toolpath.nc", &text, GENERAL_CONTROL, &Setup::default()).unwrap();
    assert!(program.findings(&|_| None).is_empty());
    let with_arcs = path_of(&program);
    let moves = path_of(&read_apt("toolpath.cls", &fs::read(folder.join("toolpath.cls")).unwrap()).unwrap());
    // Chords by which arcs are read, and last decimals.
    let most = 0.002 + 2e-4;
    let found = [farthest(&moves, &with_arcs), farthest(&with_arcs, &moves)];
    assert!(found[0] < most && found[1] < most, "{found:?}");
    assert!(found[0] > 1e-4, "an arc is no move");
}

/// Sides on the edge of the stock are as open as those that are listed: the same passes.
#[test]
fn sides_at_the_edge_of_the_stock_are_open() {
    let home = tempfile::tempdir().unwrap();
    let listed = "open = [[[15, 20], [0, 20], [0, 0], [30, 0], [30, 10]]]\n";
    let (listed, _) = run(home.path(), "listed", &scene(listed, ""));
    let (at_edge, _) = run(home.path(), "at_edge", &scene("", "[stock]\nmargin = 0\n"));
    let (walls, _) = run(home.path(), "walls", &scene("", ""));
    let length = |toolpath: &Value| toolpath["path"]["cutting_length_mm"].as_f64().unwrap();
    assert_eq!(length(&at_edge), length(&listed));
    assert_ne!(length(&walls), length(&listed));
    let engaged = |toolpath: &Value| toolpath["pocket"]["max_engagement_deg"].as_f64().unwrap();
    assert!((engaged(&at_edge) - engaged(&listed)).abs() < 1e-9);
}
