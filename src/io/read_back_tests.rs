//! What this stage writes, the reader of programs reads back: every move of a path at the line that the
//! writer names.

use std::collections::HashMap;

use crate::apt_cl;
use crate::gcode::five_axis_tests::{machine, tilting_path};
use crate::gcode::{self, ArcRule, FiveAxisPost, Style, TCP_WORDS, write_five_axis};
use crate::program_text::ProgramHeader;
use crate::program_text::tests::{example, random};
use cutter::Cutter;
use geometry::{Point3, Vector3, distance_to_segment};
use machine::kinematics::{Kinematics, PRESETS, follow};
use motion::{ClPoint, Cutters, Move, MoveKind, Toolpath};
use program::{GENERAL_CONTROL, LINUXCNC_CONTROL, Placing, Setup, Spindle, read_apt, read_gcode};

fn placing(kinematics: Option<&Kinematics>) -> Placing<'_> {
    Placing { chord: 0.002, kinematics, lengths: &|_| None }
}

/// The last move of each line.
fn by_line(path: &Toolpath) -> HashMap<u32, &Move> {
    path.origin.lines.iter().copied().zip(&path.moves).collect()
}

fn header() -> ProgramHeader {
    ProgramHeader { name: "read back".into(), spindle_speed: Some(9000.0), rise_to: None }
}

#[test]
fn three_axes_by_every_control_that_has_no_own_words_for_them() {
    for (path, cutter) in [(example(), Cutter::ball(6.0)), (random(500), Cutter::flat(10.0))] {
        for control in [GENERAL_CONTROL, LINUXCNC_CONTROL] {
            let mut bytes = Vec::new();
            let lines = gcode::write(&mut bytes, &path, cutter.as_ref().unwrap(), &header(), None).unwrap();
            let program = read_gcode("a.nc", &bytes, control, &Setup::from_above(200.0)).unwrap();
            assert!(program.findings(&|_| None).is_empty(), "{:?}", program.findings(&|_| None));
            let read = program.runs(&placing(None)).unwrap().swap_remove(0).path;
            let found = by_line(&read);
            for (step, line) in path.moves.iter().zip(&lines) {
                let Some(again) = found.get(line) else { continue };
                assert!((again.to.tip - step.to.tip).amax() <= 0.5001e-4, "line {line}");
            }
            let moved = |path: &Toolpath| path.segments().filter(|(a, b, _)| (a - b).norm() > 2e-4).count();
            assert!(read.len() >= moved(&path));
            for (k, step) in path.moves.iter().enumerate() {
                let still = (path.start_of(k) - step.to.tip).norm() < 2e-4;
                let again = found.get(&lines[k]).filter(|_| !still);
                let Some(again) = again else { continue };
                assert_eq!(again.kind == MoveKind::Rapid, step.kind == MoveKind::Rapid, "line {}", lines[k]);
                let fed =
                    step.kind == MoveKind::Rapid || (again.feed_rate - step.feed_rate).abs() <= 0.5001e-4;
                assert!(fed, "line {}", lines[k]);
            }
        }
    }
}

/// Down a helix, along a line onto a circle and off it, and around a corner, at three feeds; and the places
/// of it.
fn round_path() -> Toolpath {
    let mut path = example();
    path.moves.clear();
    let mut to = |x: f64, y: f64, z: f64, kind, feed_rate| {
        path.moves.push(Move { to: ClPoint::upright(Point3::new(x, y, z)), kind, feed_rate, pass: 0 });
    };
    to(8.0, 0.0, 10.0, MoveKind::Rapid, 0.0);
    to(8.0, 0.0, 0.5, MoveKind::Rapid, 0.0);
    for k in 1..=200 {
        let turn = 0.06 * f64::from(k);
        to(5.0 + 3.0 * turn.cos(), 3.0 * turn.sin(), 0.5 - 0.01 * f64::from(k), MoveKind::Plunge, 300.0);
    }
    for k in 0..=90 {
        let turn = -0.05 * f64::from(k);
        let feed = if k < 30 { 1200.0 } else { 1100.0 };
        to(25.0 + 12.0 * turn.cos(), 4.0 + 12.0 * turn.sin(), -1.5, MoveKind::Cut, feed);
    }
    to(0.0, 30.0, -1.5, MoveKind::Cut, 1200.0);
    to(0.0, 0.0, -1.5, MoveKind::Cut, 1200.0);
    to(0.0, 0.0, 10.0, MoveKind::Retract, 1200.0);
    path.as_written()
}

/// Arcs stay within their tolerance of the moves, begin and end where these do, and have their feeds: lengths
/// and times hold.
#[test]
fn arcs_stay_as_near_to_the_moves_as_they_are_asked_to() {
    let path = round_path();
    let feet = |p: &Point3, of: &Toolpath| {
        of.segments().map(|(a, b, _)| distance_to_segment(p, &a, &b)).fold(f64::INFINITY, f64::min)
    };
    let written = |arcs: Option<f64>| {
        let arcs = arcs.map(|tolerance| ArcRule { tolerance, acceleration: 1000.0 });
        let mut bytes = Vec::new();
        let lines = gcode::write(&mut bytes, &path, &Cutter::flat(6.0).unwrap(), &header(), arcs).unwrap();
        (String::from_utf8(bytes).unwrap(), lines)
    };
    let (plain, _) = written(None);
    // The sagittas of its circles are 1.4 and 3.8 µm.
    for (tolerance, count) in [(0.001, 0), (0.002, 4), (0.005, 6)] {
        let (text, lines) = written(Some(tolerance));
        let arcs = text.lines().filter(|line| line.contains(" I")).count();
        assert_eq!((arcs, lines.len()), (count, path.len()), "{tolerance}");
        assert!(count == 0 || text.lines().count() + 150 < plain.lines().count());
        for control in [GENERAL_CONTROL, LINUXCNC_CONTROL] {
            let program = read_gcode("a.nc", text.as_bytes(), control, &Setup::from_above(200.0)).unwrap();
            assert!(program.findings(&|_| None).is_empty(), "{:?}", program.findings(&|_| None));
            let placing = Placing { chord: 1e-4, ..placing(None) };
            let read = program.runs(&placing).unwrap().swap_remove(0).path;
            let own: Vec<_> = read.moves.iter().filter(|m| m.kind != MoveKind::Rapid).collect();
            // Chords of the arcs and last decimals.
            let most = tolerance + 1e-4 + 1e-4;
            let farthest = own.iter().map(|m| feet(&m.to.tip, &path)).fold(0.0, f64::max);
            assert!(farthest < most, "{tolerance}: {farthest}");
            let farthest = path.moves.iter().map(|m| feet(&m.to.tip, &read)).fold(0.0, f64::max);
            assert!(farthest < most, "{tolerance}: {farthest}");
            let found = by_line(&read);
            for (k, step) in
                path.moves.iter().enumerate().filter(|(k, _)| lines.get(k + 1) != Some(&lines[*k]))
            {
                let again = found[&lines[k]];
                assert!((again.to.tip - step.to.tip).amax() < 1.001e-4, "move {k}: {again:?}");
                assert!(step.kind == MoveKind::Rapid || (again.feed_rate - step.feed_rate).abs() < 1e-4);
            }
            let fed = |path: &Toolpath| -> f64 {
                let fed = path.segments().filter(|(_, _, m)| m.kind != MoveKind::Rapid);
                fed.map(|(a, b, m)| (b - a).norm() / m.feed_rate).sum()
            };
            assert!((fed(&read) / fed(&path) - 1.0).abs() < 1e-3, "{} {}", fed(&read), fed(&path));
        }
    }
}

#[test]
fn locations_with_and_without_axes() {
    let mut tilted = random(300);
    let mut rng = sim::scenes::Rng::new(8);
    for step in &mut tilted.moves {
        let [x, y] = [0, 1].map(|_| rng.within(-1.0, 1.0));
        step.to.axis = Vector3::new(x, y, 1.0).normalize();
    }
    for path in [random(300), tilted] {
        let mut bytes = Vec::new();
        apt_cl::write(&mut bytes, &path, &Cutter::ball(6.0).unwrap().into(), &header()).unwrap();
        let program = read_apt("a.cls", &bytes).unwrap();
        assert!(program.ended && program.notes.is_empty() && program.findings(&|_| None).is_empty());
        let read = program.runs(&placing(None)).unwrap().swap_remove(0).path;
        assert_eq!(read.len(), path.len());
        for (again, step) in read.moves.iter().zip(&path.moves) {
            assert!((again.to.tip - step.to.tip).amax() <= 0.5001e-4);
            assert!((again.to.axis - step.to.axis).norm() < 1e-6);
            assert_eq!(again.kind == MoveKind::Rapid, step.kind == MoveKind::Rapid);
        }
    }
}

/// What a program says of the spindle is in the locations, where it says so; the header's speed is another.
#[test]
fn locations_have_the_spindle_of_the_program() {
    let text = "T1 M6\nS8000 M3\nG0 X0 Y0 Z9\nG1 Z0 F100\nS6000\nX5\nM4\nX9\nM5\nG0 Z9\nM30\n";
    let spindle = |program: &program::Program| -> Vec<(Spindle, f64)> {
        let steps = program.steps.iter().map(|step| program.setting(step));
        steps
            .map(|held| (held.spindle, if held.spindle == Spindle::Off { 0.0 } else { held.speed }))
            .collect()
    };
    let read = read_gcode("a.nc", text.as_bytes(), GENERAL_CONTROL, &Setup::default()).unwrap();
    let path = read.runs(&placing(None)).unwrap().swap_remove(0).path;
    let mut bytes = Vec::new();
    apt_cl::write(&mut bytes, &path, &Cutter::ball(6.0).unwrap().into(), &header()).unwrap();
    let again = read_apt("a.cls", &bytes).unwrap();
    assert_eq!(spindle(&again), spindle(&read), "{}", String::from_utf8_lossy(&bytes));
    // A tool change stops it.
    let text = text.replace("M5\n", "T2 M6\nS5000 M3\nG0 Z8\nG1 Z0\n");
    let read = read_gcode("a.nc", text.as_bytes(), GENERAL_CONTROL, &Setup::default()).unwrap();
    let mut runs = read.runs(&placing(None)).unwrap().into_iter();
    let mut all = motion::PathsInTurn::new(runs.next().unwrap().path);
    let second = all.push(runs.next().unwrap().path, 100.0) - 2;
    let flat = Cutter::flat(8.0).unwrap();
    let cutters = Cutters::from(Cutter::ball(6.0).unwrap()).then(second, flat);
    let mut bytes = Vec::new();
    apt_cl::write(&mut bytes, &all.finish(), &cutters, &header()).unwrap();
    let text = String::from_utf8_lossy(&bytes);
    let said: Vec<&str> =
        text.lines().filter(|line| line.starts_with("SPINDL") || line.starts_with("LOADTL")).collect();
    let expected = [
        "LOADTL/1",
        "SPINDL/8000.0,RPM,CLW",
        "SPINDL/6000.0,RPM,CLW",
        "SPINDL/6000.0,RPM,CCLW",
        "LOADTL/2",
        "SPINDL/5000.0,RPM,CLW",
        "SPINDL/OFF",
    ];
    assert_eq!(said, expected);
}

#[test]
fn locations_of_several_tools() {
    let mut path = random(40);
    path.origin.tools = vec![(0, 4), (15, 7), (30, 4)];
    let [flat, ball] = [Cutter::flat(8.0).unwrap(), Cutter::ball(6.0).unwrap()];
    let cutters = Cutters::from(flat).then(15, ball).then(30, flat);
    let mut bytes = Vec::new();
    apt_cl::write(&mut bytes, &path, &cutters, &header()).unwrap();
    let program = read_apt("a.cls", &bytes).unwrap();
    assert!(program.findings(&|_| None).is_empty(), "{:?}", program.findings(&|_| None));
    let runs = program.runs(&placing(None)).unwrap();
    let read: Vec<(u32, usize)> = runs.iter().map(|run| (run.tool, run.path.len())).collect();
    assert_eq!(read, [(4, 15), (7, 15), (4, 10)]);
    let cutters: Vec<&str> = program.tools.iter().map(|remark| remark.text.as_str()).collect();
    assert_eq!(cutters, ["CUTTER/8,0", "CUTTER/6,3", "CUTTER/8,0"]);
}

#[test]
fn five_axes_on_every_machine_in_both_styles() {
    let path = tilting_path();
    for name in PRESETS {
        let kinematics = machine(name);
        for style in [Style::Tcp, Style::Full] {
            let joints = follow(&kinematics, &path, &style.following(0.002, 50.0)).unwrap();
            let post = FiveAxisPost {
                kinematics: &kinematics,
                joints: &joints,
                style,
                tcp_words: TCP_WORDS,
                rapid_rate: 15_000.0,
            };
            let mut bytes = Vec::new();
            let lines =
                write_five_axis(&mut bytes, &path, &post, &Cutter::ball(6.0).unwrap(), &header()).unwrap();
            let program = read_gcode("a.nc", &bytes, GENERAL_CONTROL, &Setup::from_above(400.0)).unwrap();
            let read = program.runs(&placing(Some(&kinematics))).unwrap().swap_remove(0).path;
            let found = by_line(&read);
            for (step, line) in path.moves.iter().zip(&lines) {
                let again = found[line].to;
                // Half of the last decimal on three axes; angles turn the lengths of the machine, 600 mm,
                // besides.
                assert!((again.tip - step.to.tip).norm() < 2.2e-4, "{name} {style:?} line {line}: {again:?}");
                assert!((again.axis - step.to.axis).norm() < 3e-7, "{name} {style:?} line {line}");
            }
        }
    }
}
