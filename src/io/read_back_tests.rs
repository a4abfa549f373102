//! What this stage writes, the reader of programs reads back: every move of a path at the line that the writer names.

use std::collections::HashMap;

use crate::apt_cl;
use crate::gcode::five_axis_tests::{machine, tilting_path};
use crate::gcode::{self, FiveAxisPost, Style, write_five_axis};
use crate::program_text::ProgramHeader;
use crate::program_text::tests::{example, random};
use cutter::Cutter;
use geometry::Vector3;
use machine::kinematics::{Kinematics, PRESETS, follow};
use motion::{Cutters, Move, MoveKind, Toolpath};
use program::{GENERAL_CONTROL, LINUXCNC_CONTROL, Placing, Setup, read_apt, read_gcode};

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
            let lines = gcode::write(&mut bytes, &path, cutter.as_ref().unwrap(), &header()).unwrap();
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
            let post = FiveAxisPost { kinematics: &kinematics, joints: &joints, style, rapid_rate: 15_000.0 };
            let mut bytes = Vec::new();
            let lines =
                write_five_axis(&mut bytes, &path, &post, &Cutter::ball(6.0).unwrap(), &header()).unwrap();
            let program = read_gcode("a.nc", &bytes, GENERAL_CONTROL, &Setup::from_above(400.0)).unwrap();
            let read = program.runs(&placing(Some(&kinematics))).unwrap().swap_remove(0).path;
            let found = by_line(&read);
            for (step, line) in path.moves.iter().zip(&lines) {
                let again = found[line].to;
                // Half of the last decimal on three axes; angles turn the lengths of the machine, 600 mm, besides.
                assert!((again.tip - step.to.tip).norm() < 2.2e-4, "{name} {style:?} line {line}: {again:?}");
                assert!((again.axis - step.to.axis).norm() < 3e-7, "{name} {style:?} line {line}");
            }
        }
    }
}
