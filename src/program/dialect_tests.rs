//! Words that controls read in different ways, by closed forms, and what is refused where the machine alone
//! could know.

use crate::control::{FANUC, GRBL, HAAS, LINUXCNC};
use crate::*;

const GENERAL: &Control = GENERAL_CONTROL;

fn try_read(text: &str, control: &'static Control) -> Result<Program, ProgramError> {
    read_gcode("a.nc", text.as_bytes(), control, &Setup { most_repeats: 10_000, ..Setup::default() })
}

fn read(text: &str, control: &'static Control) -> Program {
    try_read(text, control).unwrap_or_else(|error| panic!("{}: {error}\n{text}", control.word))
}

#[track_caller]
fn refused(text: &str, control: &'static Control) -> (u32, Fault) {
    let error = try_read(text, control).expect_err(text);
    assert!(!error.cure().is_empty(), "{error}");
    (error.line, error.fault)
}

/// Ends of all motions: X Y Z.
fn ends(program: &Program) -> Vec<[f64; 3]> {
    let moves = program.steps.iter().filter(|step| step.kind != StepKind::Set);
    moves.map(|step| [step.to[0], step.to[1], step.to[2]]).collect()
}

#[track_caller]
fn assert_ends(text: &str, control: &'static Control, expected: &[[f64; 3]]) {
    let found = ends(&read(text, control));
    assert_eq!(found.len(), expected.len(), "{} {text}: {found:?}", control.word);
    for (a, b) in found.iter().flatten().zip(expected.iter().flatten()) {
        assert!((a - b).abs() < 1e-9, "{} {text}: {found:?}", control.word);
    }
}

#[test]
fn a_motion_code_takes_force_beside_a_code_that_takes_the_words() {
    for words in
        ["G91 G28 Z0", "G30 Z0", "G4 P1", "G4 X1", "G10 L2 P2 X0", "G52 X0", "G92 X1", "G68 X0 Y0 R0"]
    {
        for control in [GENERAL, &FANUC, &HAAS] {
            let program = read(&format!("G1 X1 F1\nG0 {words}\nG90 X9\nG1 G40\nX3\nM30\n"), control);
            let kinds: Vec<StepKind> = program.steps.iter().map(|step| step.kind).collect();
            assert_eq!(
                kinds[kinds.len() - 2..],
                [StepKind::Rapid, StepKind::Feed],
                "{} {words}",
                control.word
            );
        }
    }
    let homed = "G0 Z9\nG81 X1 Z-1 R2 F1\nG80 G91 G28 Z0\nG90 X3\nM30\n";
    for control in [GENERAL, &FANUC, &HAAS, &LINUXCNC] {
        let (line, fault) = refused(homed, control);
        assert!(line == 4 && matches!(fault, Fault::Missing { .. }), "{}: {fault}", control.word);
    }
    let rapid = read(&homed.replace("G80", "G80 G0"), &FANUC);
    assert_eq!(ends(&rapid).last(), Some(&[3.0, 0.0, 0.0]));
    for words in ["G28 Z0", "G30", "G10 L2 P1 X0", "G52 X0", "G92 X0"] {
        for control in [&LINUXCNC, &GRBL] {
            let (line, fault) = refused(&format!("F1\nG0 {words}\nM2\n"), control);
            assert!(
                line == 2 && matches!(fault, Fault::Conflict { .. }),
                "{} {words}: {fault}",
                control.word
            );
        }
    }
}

/// As rs274 of LinuxCNC 2.9 moves.
#[test]
fn a_dwell_of_linuxcnc_takes_no_axis_words() {
    let text = "G0 X1\nF100\nG1 G4 P1 X10\nG4 P1 X20\nX30\nM2\n";
    let expected = [1.0, 10.0, 20.0, 30.0].map(|x| [x, 0.0, 0.0]);
    assert_ends(text, &LINUXCNC, &expected);
    assert_eq!(read(text, &LINUXCNC).steps[1].kind, StepKind::Feed);
    assert!(matches!(refused("G4 X2\n", &LINUXCNC).1, Fault::Missing { .. }));
    assert!(matches!(refused("G2 G4 P1 X10 I5 F1\n", &LINUXCNC).1, Fault::Conflict { .. }));
    assert_ends("G1 X1 F1\nG4 X2.\nG4 P9\nM30\n", &FANUC, &[[1.0, 0.0, 0.0]]);
    assert_eq!(refused("G1 X1 F1\nG4 P1 X10\n", &FANUC), (2, Fault::Unused('X')));
}

#[test]
fn operators_bind_outside_of_brackets_too() {
    let text = "#1=1+2*3\n#2=10-4/2\n#3=-#1+2*[#2-1]*2\nG1 X#1 Y#2 Z#3 F1\nM30\n";
    for control in [GENERAL, &FANUC, &HAAS] {
        assert_ends(text, control, &[[7.0, 8.0, 21.0]]);
    }
    assert_eq!(refused("#1=[1+2]\n#1=1+2\n", &LINUXCNC), (2, Fault::Unbracketed('+')));
}

#[test]
fn cycles_repeat_by_the_letter_of_their_control() {
    let text = "G0 Z20\nG91 G99 G81 X10 Z-5 R-15 K3 F100\nX10\nG90 G80\nM30\n";
    let mut expected = vec![[0.0, 0.0, 20.0]];
    expected.push([10.0, 0.0, 20.0]);
    for x in [10.0, 20.0, 30.0, 40.0] {
        expected.extend([[x, 0.0, 5.0], [x, 0.0, 0.0], [x, 0.0, 5.0]]);
    }
    for control in [GENERAL, &FANUC] {
        assert_ends(text, control, &expected);
        assert_ends(&text.replace('K', "L"), control, &expected);
        let none = format!("{}G80\nG0 X7\nM30\n", &text.replace("K3", "K0")[..text.find("X10\n").unwrap()]);
        assert_ends(&none, control, &[[0.0, 0.0, 20.0], [7.0, 0.0, 20.0]]);
    }
    for control in [&HAAS, &LINUXCNC] {
        assert_ends(&text.replace('K', "L"), control, &expected);
        assert_eq!(refused(text, control), (2, Fault::Unused('K')));
    }
    assert!(matches!(refused(&text.replace("K3", "L0"), &LINUXCNC).1, Fault::Value { .. }));
}

/// As rs274 moves: R and Z stay as they were written, and R counts from the level before the first cycle.
#[test]
fn levels_of_linuxcnc_count_from_the_level_before_the_first_cycle() {
    let text = "G0 Z20\nF100\nG91 G99 G81 X10 Z-5 R-15\nX10 R-2\nX10 Z-3\nM2\n";
    let lowest = |x: f64| {
        let there = ends(&read(text, &LINUXCNC)).into_iter().filter(move |at| at[0] == x);
        there.map(|at| at[2]).fold(f64::INFINITY, f64::min)
    };
    assert_eq!([10.0, 20.0, 30.0].map(lowest), [0.0, 13.0, 15.0]);
}

/// The example of Haas' manual: a row of holes by G91 and L after the first one by G90.
#[test]
fn levels_stay_where_holes_go_on_in_g91() {
    let text = "G0 Z10\nG90 G99 G81 X5 Y5 Z-1 R1 F100\nG91 X5 L2\nG90 G80\nM30\n";
    for control in [GENERAL, &FANUC, &HAAS] {
        let mut expected = vec![[0.0, 0.0, 10.0], [5.0, 5.0, 10.0]];
        for x in [5.0, 10.0, 15.0] {
            expected.extend([[x, 5.0, 1.0], [x, 5.0, -1.0], [x, 5.0, 1.0]]);
        }
        assert_ends(text, control, &expected);
    }
}

#[test]
fn work_offsets_are_read_and_set_as_variables() {
    let text = "#5221=10\nG54 G1 X5 F1\n#5242=7\n#5221=#5221+1\nX5\nG55 X#5242 Y1\nG20 X1\n#5221=1\nG21 G54 X1\nM30\n";
    for control in [GENERAL, &FANUC, &HAAS] {
        let expected =
            [[15.0, 0.0, 0.0], [16.0, 0.0, 0.0], [7.0, 8.0, 0.0], [25.4, 8.0, 0.0], [26.4, 8.0, 0.0]];
        assert_ends(text, control, &expected);
    }
    let (line, fault) = refused("F1\n#5221=10\n", &LINUXCNC);
    assert_eq!((line, fault), (2, Fault::ReadOnly(5221)));
    assert_ends("G10 L2 P2 X4\nG0 X#5241\nM2\n", &LINUXCNC, &[[4.0, 0.0, 0.0]]);
    assert_eq!(refused("G41.1 D2 G1 X5 F1\n#5221=1\n", &FANUC).0, 2);
}

#[test]
fn positions_are_read_where_they_are_known() {
    let setup = Setup { lengths: [(1, [0.0, 0.0, 80.0])].into(), ..Setup::from_above(200.0) };
    let read = |text: &str| read_gcode("a.nc", text.as_bytes(), &FANUC, &setup);
    let text = "G0 X3 Z5\nX[#5001+1]\nY#5041\nZ#5003\nZ[#5023+200]\nM30\n";
    let found = ends(&read(text).unwrap());
    assert_eq!(found[1..], [[4.0, 0.0, -195.0], [4.0, 4.0, -195.0]], "{found:?}");
    let error = read("G43 H1 G0 Z5\n#1=#5043\n").unwrap_err();
    assert_eq!((error.line, error.fault), (2, Fault::System(5043)));
}

#[test]
fn variables_of_the_control_are_never_taken_for_empty() {
    for (number, controls) in [
        (2001, &[GENERAL, &FANUC, &HAAS][..]),
        (4114, &[GENERAL, &FANUC, &HAAS]),
        (3011, &[GENERAL, &FANUC, &HAAS]),
        (5061, &[GENERAL, &FANUC, &HAAS, &LINUXCNC]),
        (5399, &[GENERAL, &FANUC, &HAAS, &LINUXCNC]),
        (10_001, &[GENERAL, &FANUC]),
        (1_000, &[GENERAL, &FANUC, &HAAS]),
    ] {
        for control in controls {
            let faults = [Fault::System(number), Fault::ReadOnly(number)];
            assert_eq!(refused(&format!("F1\nG0 X#{number}\n"), control), (2, faults[0].clone()));
            assert_eq!(refused(&format!("F1\n#{number}=1\n"), control), (2, faults[1].clone()));
        }
    }
    assert_ends("#2001=4 #3000=5\nG0 X#2001 Y#3000\nM2\n", &LINUXCNC, &[[4.0, 5.0, 0.0]]);
    assert_ends("#10001=4\nG0 X#10001\nM30\n", &HAAS, &[[4.0, 0.0, 0.0]]);
    assert_ends("#3003=1\n#3006=1(LOOK)\nG0 X#500 Y1\nM30\n", &FANUC, &[[0.0, 1.0, 0.0]]);
    let alarm = "#1=2\nIF [#1 EQ 1] THEN #3000=5(NO)\nG0 X1\nIF [#1 EQ 2] THEN #3000=1(ALARM)\nG0 X2\nM30\n";
    assert_eq!(refused(alarm, &FANUC), (4, Fault::Alarm(1.0)));
}

#[test]
fn wear_adds_to_lengths_and_radii() {
    let text = "G10 L10 P1 R100.\nG10 L11 P1 R0.05\nG91 G10 L11 P1 R0.01\nG90 G43 H1 G0 Z10\nM30\n";
    for control in [GENERAL, &FANUC, &HAAS] {
        assert_eq!(read(text, control).settings.last().unwrap().length[2], 100.06, "{}", control.word);
        let radius = "G10 L12 P1 R3.\nG10 L13 P1 R-0.5\nF1\nG41 D1 G1 X10\nX20\nG40\nM30\n";
        assert_eq!(ends(&read(radius, control))[1], [20.0, 2.5, 0.0], "{}", control.word);
    }
    let known = Setup { any_radius: Some(3.0), ..Setup::default() };
    let text = "G10 L13 P1 R-0.5\nF1\nG41 D1 G1 X10\nX20\nG40\nM30\n";
    let program = read_gcode("a.nc", text.as_bytes(), &FANUC, &known).unwrap();
    assert_eq!(ends(&program)[1], [20.0, 2.5, 0.0]);
    for words in ["L10 P1 Z10", "L11 P1 Z10", "L10 P1 R3"] {
        let (line, fault) = refused(&format!("F1\nG10 {words}\n"), &LINUXCNC);
        assert!(line == 2 && matches!(fault, Fault::Unsupported { .. }), "{words}: {fault}");
    }
    assert!(matches!(refused("G10 L10 P1 Z10\n", GENERAL).1, Fault::Unsupported { .. }));
}

#[test]
fn a_cutter_that_cannot_reach_an_inner_arc_is_refused() {
    let text =
        "G0 X-5\nF200\nG41.1 D6 G1 X5 Y0\nX20\nG3 X21.2426 Y0.9535 I-3. J5.1962\nG1 X21.2426 Y20\nG40\nM30\n";
    for control in [GENERAL, &LINUXCNC] {
        let (line, fault) = refused(text, control);
        assert!(matches!(fault, Fault::Corner { .. }) && line == 6, "{line}: {fault}");
    }
    // A smaller one turns less than the programmed arc.
    let small = read(&text.replace("D6", "D0.2"), &LINUXCNC);
    let sweeps: Vec<f64> = small.arcs.iter().map(|arc| arc.sweep).collect();
    assert!(sweeps.len() == 1 && sweeps[0] > 0.0 && sweeps[0] < 0.27, "{sweeps:?}");
    // Whole turns stay whole turns: a helix between two inner corners.
    let helix = "G0 X-20 Y0\nF1\nG41.1 D2 G1 X-10 Y0\nX0\nG3 X0 Y0 Z-2 I-3. J4. P2\nG1 X10\nG40\nM2\n";
    if let Ok(program) = try_read(helix, &LINUXCNC) {
        let turns = program.arcs[0].sweep / std::f64::consts::TAU;
        assert!(turns > 1.5 && turns < 2.0, "{turns}");
    }
}

#[test]
fn a_number_without_a_point_is_noted_where_it_may_count_increments() {
    let notes = |text: &str, control| -> Vec<u32> {
        read(text, control).notes.iter().map(|note| note.line).collect()
    };
    for control in [&FANUC, &HAAS] {
        assert_eq!(notes("G0 X0 Y1.\nG1 X10 F100\nX20\nM30\n", control), [2]);
        assert_eq!(notes("G0 X0 Y1.\nG1 X10. F100\nM30\n", control), []);
    }
    assert_eq!(notes("G1 X10 F100\nM30\n", GENERAL), []);
}

#[test]
fn a_subprogram_of_another_device_is_refused() {
    for control in [GENERAL, &FANUC, &HAAS] {
        let (line, fault) = refused("G0 X1.\nM198 P1234\n", control);
        assert!(line == 2 && matches!(fault, Fault::NoTarget(_)), "{fault}");
        assert!(fault.to_string().contains("O1234"), "{fault}");
    }
    assert_eq!(read("M198 P1\nM2\n", &LINUXCNC).notes.len(), 1, "a word of its user");
}

#[test]
fn locals_of_linuxcnc_end_at_30() {
    let text = "#30=3 #31=5\no1 sub\nG0 X#31 Y#30\n#31=7\no1 endsub\no1 call\nG0 X#31\nM2\n";
    assert_ends(text, &LINUXCNC, &[[5.0, 0.0, 0.0], [7.0, 0.0, 0.0]]);
}

#[test]
fn lengths_along_a_turning_axis_are_refused() {
    assert!(matches!(refused("G43.1 H1 Z50.\n", &FANUC).1, Fault::Unsupported { .. }));
    assert!(matches!(refused("G43.1 H1 Z50.\n", &HAAS).1, Fault::UnknownCode { .. }));
    assert_eq!(refused("G43.1 H1 Z50.\n", GENERAL), (1, Fault::Unused('H')));
    assert_eq!(read("G43.1 Z50\nM2\n", &LINUXCNC).settings[0].length[2], 50.0);
}

#[test]
fn loops_may_stand_aside() {
    let text = "#1=0\n  WHILE [#1 LT 3] DO1\n  #1=#1+1\n  G1 X#1 F1\n  END1\n\tN9 M30\n";
    assert_ends(text, &FANUC, &[[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]]);
    let over = text.replace("LT 3", "LT 0");
    assert_ends(&over, &FANUC, &[]);
}

#[test]
fn places_beyond_every_machine_are_refused_with_offsets_in_them() {
    for text in [
        "G0 X1.\nG10 L2 P1 X1099999999999\nG1 X10. F1\nM30\n",
        "G0 X1.\nG92 X-1099999999999\nG1 X10. F1\nM30\n",
        "G0 X1.\n\nG53 G0 X1099999999999\nM30\n",
    ] {
        for control in [GENERAL, &FANUC] {
            let (line, fault) = refused(text, control);
            assert!(line == 3 && matches!(fault, Fault::Range { letter: 'X', .. }), "{line}: {fault}");
        }
    }
}

/// How far each run is off its corners by the leave of the program, mm, and the line behind the first corner
/// that nothing bounds.
fn rounded(text: &str, control: &'static Control) -> (f64, Option<u32>) {
    let placing = Placing { chord: 0.1, kinematics: None, lengths: &|_| None };
    let run = read(text, control).runs(&placing).unwrap().swap_remove(0);
    assert_eq!(run.path.origin.strays, run.rounded, "{text}");
    (run.rounded, run.rounded_freely)
}

#[test]
fn a_tolerance_of_corners_is_how_far_the_motion_strays() {
    let corner = |codes: &str| format!("{codes}\nG0 X1\nG1 Y1 F9\nX2\nM30\n");
    let mach = Control::from_word("mach").unwrap();
    for (codes, control, expected) in [
        // What is off a line by Q is left out, and corners are rounded by P; P stands for both.
        ("G64 P1", &LINUXCNC, (2.0, None)),
        ("G64 P0.5 Q0.25", &LINUXCNC, (0.75, None)),
        ("G20 G64 P0.1", &LINUXCNC, (5.08, None)),
        ("G64 P0.1 G20", GENERAL, (5.08, None)),
        ("G64 P1\nG61", &LINUXCNC, (0.0, None)),
        ("G64 P1\nG61.1", &LINUXCNC, (0.0, None)),
        ("G64 P1\nG64", &LINUXCNC, (0.0, Some(3))),
        ("G64 P0", &LINUXCNC, (0.0, Some(3))),
        ("G21", &LINUXCNC, (0.0, Some(3))),
        ("G21", &HAAS, (0.0, None)),
        ("G64", &HAAS, (0.0, Some(3))),
        ("G64", &FANUC, (0.0, Some(3))),
        ("G64", mach, (0.0, Some(3))),
        ("G64", &GRBL, (0.0, None)),
        ("G187 P1 E0.01", &HAAS, (0.01, None)),
        ("G187 E0.01\nG61\nG64", &HAAS, (0.01, None)),
        ("G187 E0.01\nG61", &HAAS, (0.0, None)),
        ("G187 E0.01\nG187", &HAAS, (0.0, Some(4))),
    ] {
        let lines = codes.matches('\n').count() as u32;
        let (by, line) = rounded(&corner(codes), control);
        assert!((by - expected.0).abs() < 1e-12, "{} {codes}: {by}", control.word);
        assert_eq!(line, expected.1.map(|line| line.max(lines + 3)), "{} {codes}", control.word);
    }
    // Straight on there is no corner, nor where the machine rests.
    assert_eq!(rounded("G64 P1\nG1 X1 F9\nX2\nG4 P1\nY2\nM30\n", &LINUXCNC), (0.0, None));
    assert_eq!(rounded("G64 P1\nG1 X1 F9\nX0\nM30\n", &LINUXCNC), (2.0, None));
    assert!(matches!(refused(&corner("G64 P-1"), &LINUXCNC), (1, Fault::Value { letter: 'P', .. })));
}

#[test]
fn two_codes_of_one_modal_group_are_refused_in_one_block() {
    for block in
        ["G41 G40 D1", "G40 G42", "G90 G91", "G17 G18", "G20 G21", "G61 G64", "G54 G55", "M3 M4", "M5 M3"]
    {
        for control in [GENERAL, &LINUXCNC, &FANUC] {
            let (line, fault) = refused(&format!("G1 X1 F1\n{block} S100\nM30\n"), control);
            assert!(
                line == 2 && matches!(fault, Fault::Conflict { .. }),
                "{} {block}: {fault}",
                control.word
            );
        }
    }
    read("G17 G21 G40 G49 G54 G64 G80 G90 G94\nM3 M8 S9\nG90 G90 G0 X1\nM30\n", &FANUC);
}
