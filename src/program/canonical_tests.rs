//! Every program of the corpus against the motion that LinuxCNC's own interpreter makes of it, move by move:
//! end point, centre, sense, plane and feed. `tests/programs/README.md` says how that motion is made anew.

use std::path::{Path, PathBuf};

use crate::control::LINUXCNC;
use crate::{Program, Setup, Step, StepKind, read_gcode};

/// rs274 prints four decimals, of coordinates before offsets are added and turned.
const PLACE: f64 = 1.5e-4;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/programs")
}

/// Lengths and radii of tool.tbl, which is in inches.
fn setup() -> Setup {
    let radii = [(1, 3.175), (2, 6.35), (3, 1.5875)].into_iter().collect();
    let lengths = [(1, [0.0, 0.0, 50.8]), (2, [0.0, 0.0, 38.1]), (3, [2.54, 0.0, 25.4])];
    Setup { lengths: lengths.into_iter().collect(), radii, ..Setup::default() }
}

fn near(name: &str, line: u32, what: &str, found: &[f64], expected: &[f64], within: f64) {
    let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(off <= within, "{name} line {line}: {what} {found:?}, rs274 has {expected:?}");
}

fn compare(name: &str, program: &Program, step: &Step, expected: &str) {
    let (expected, decimals) = expected.strip_suffix(" inch").map_or((expected, 1.0), |line| (line, 25.4));
    let (place, feed) = (PLACE * decimals, (1e-3 + 1e-4 * step.feed) * decimals);
    let words: Vec<&str> = expected.split(' ').collect();
    let numbers: Vec<f64> = words[1..].iter().map(|w| w.parse().unwrap()).collect();
    let kind = match step.kind {
        StepKind::Rapid => "r",
        StepKind::Feed => "f",
        StepKind::Arc(_) => "a",
        StepKind::Set => "s",
    };
    assert_eq!(kind, words[0], "{name} line {}: {step:?}, rs274 has {expected}", step.line);
    near(name, step.line, "end", &step.to, &numbers[..6], place);
    if kind != "r" {
        near(name, step.line, "feed", &[step.feed], &numbers[6..7], feed);
    }
    if let StepKind::Arc(index) = step.kind {
        let arc = &program.arcs[index as usize];
        let [u, v, w] = arc.plane.axes();
        near(
            name,
            step.line,
            "centre",
            &[arc.centre[u], arc.centre[v]],
            &[numbers[7 + u], numbers[7 + v]],
            place,
        );
        let turns = (arc.sweep / std::f64::consts::TAU).ceil() * arc.normal[w].signum();
        assert_eq!(turns, numbers[10], "{name} line {}: turns and sense", step.line);
        assert_eq!(arc.plane.word(), format!("G{}", numbers[11]), "{name} line {}", step.line);
    }
}

fn check(program: &Path) -> usize {
    let name = program.file_name().unwrap().to_string_lossy().into_owned();
    let read = read_gcode(&name, &std::fs::read(program).unwrap(), &LINUXCNC, &setup());
    let read = read.unwrap_or_else(|error| panic!("{error}"));
    let expected = std::fs::read_to_string(program.with_extension("motion")).unwrap();
    let moves: Vec<&Step> = read.steps.iter().filter(|step| step.kind != StepKind::Set).collect();
    for (step, line) in moves.iter().zip(expected.lines()) {
        compare(&name, &read, step, line);
    }
    assert_eq!(moves.len(), expected.lines().count(), "{name}: motions");
    moves.len()
}

#[test]
fn every_program_moves_as_rs274_says() {
    let mut programs: Vec<PathBuf> = std::fs::read_dir(folder())
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "ngc"))
        .collect();
    programs.sort();
    let motions: usize = programs.iter().map(|program| check(program)).sum();
    assert!(programs.len() >= 30 && motions > 2000, "{} programs, {motions} motions", programs.len());
}

/// Posts for other controls write the same operation with words that rs274 refuses, and with fewer decimals.
#[test]
fn posts_of_one_system_agree() {
    let ends = |name: &str, control| -> Vec<[f64; 3]> {
        let bytes = std::fs::read(folder().join(name)).unwrap();
        let program = read_gcode(name, &bytes, control, &setup()).unwrap_or_else(|error| panic!("{error}"));
        let moves = program.steps.iter().filter(|step| step.kind != StepKind::Set);
        moves.map(|step| [step.to[0], step.to[1], step.to[2]]).collect()
    };
    for operation in ["pocket", "profile"] {
        let expected = ends(&format!("freecad_{operation}_linuxcnc.ngc"), &LINUXCNC);
        for post in ["grbl", "centroid"] {
            let mut found = ends(&format!("freecad_{operation}_{post}.nc"), crate::GENERAL_CONTROL);
            // Some posts write a place twice with different words; what moves is the same.
            found.dedup();
            let mut expected = expected.clone();
            expected.dedup();
            assert_eq!(found.len(), expected.len(), "{operation} {post}");
            let off = found.iter().flatten().zip(expected.iter().flatten()).map(|(a, b)| (a - b).abs());
            assert!(off.fold(0.0, f64::max) < 1.1e-3, "{operation} {post}");
        }
    }
}
