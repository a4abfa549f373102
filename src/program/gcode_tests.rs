//! What rs274 cannot tell: words of Fanuc, Haas, grbl and Mach by closed forms, faults with their places,
//! bounds on what never ends.

use crate::control::{FANUC, GRBL, HAAS, LINUXCNC};
use crate::*;

fn read(text: &str) -> Program {
    read_with(text, GENERAL_CONTROL, &Setup::default())
}

fn read_with(text: &str, control: &'static Control, setup: &Setup) -> Program {
    read_gcode("a.nc", text.as_bytes(), control, setup).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// Ends of all motions: X Y Z.
fn ends(program: &Program) -> Vec<[f64; 3]> {
    let moves = program.steps.iter().filter(|step| step.kind != StepKind::Set);
    moves.map(|step| [step.to[0], step.to[1], step.to[2]]).collect()
}

#[track_caller]
fn assert_ends(text: &str, expected: &[[f64; 3]]) {
    let found = ends(&read(text));
    assert_eq!(found.len(), expected.len(), "{text}: {found:?}");
    for (a, b) in found.iter().flatten().zip(expected.iter().flatten()) {
        assert!((a - b).abs() < 1e-9, "{text}: {found:?}");
    }
}

#[track_caller]
fn refused(text: &str, control: &'static Control) -> (u32, u32, Fault) {
    let setup = Setup { most_repeats: 10_000, ..Setup::default() };
    let error = read_gcode("a.nc", text.as_bytes(), control, &setup).expect_err(text);
    assert!(!error.cure().is_empty() && error.to_string().starts_with("a.nc:"), "{error}");
    (error.line, error.column, error.fault)
}

#[test]
fn loops_and_branches_of_fanuc() {
    let text = "O1000 (MAIN)\n#1=0\nWHILE [#1 LT 3] DO1\n#1=#1+1\nG1 X#1 F100\nEND1\nIF [#1 EQ 3] GOTO 20\nG1 X99\n\
                N20 IF [#1 GT 5] THEN #2=7\nG1 Y#2\nIF [#1 NE 5] THEN G1 Z4\nM30\n";
    assert_ends(text, &[[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0], [3.0, 0.0, 4.0]]);
    let nested =
        "#1=0\nWHILE[#1LT2]DO1\n#2=0\nWHILE[#2LT2]DO2\nG91 G1 X1 F1\n#2=#2+1\nEND2\n#1=#1+1\nEND1\nM30\n";
    assert_eq!(ends(&read(nested)).last(), Some(&[4.0, 0.0, 0.0]));
}

#[test]
fn subprograms_by_number() {
    let text = "%\nO1\nG91\nM98 P32000\nM98 P2000 L2\nM97 P50\nG65 P3000 X7 I2\nM30\nN50 G1 Y1 F1\nM99\nO2000\nG1 X1 F1\n\
                M99\nO3000\nG1 Z#24 Y#4\nM99\n%\n";
    let at = |x: f64, y: f64, z: f64| [x, y, z];
    let expected = [1.0, 2.0, 3.0, 4.0, 5.0].map(|x| at(x, 0.0, 0.0));
    let mut expected = expected.to_vec();
    expected.extend([at(5.0, 1.0, 0.0), at(5.0, 3.0, 7.0)]);
    assert_ends(text, &expected);
    let nested = "M98 P10\nM30\nO10\nM98 P20 L2\nM99\nO20\nG91 G1 X1 F1\nM99\n";
    assert_ends(nested, &[[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]);
}

#[test]
fn a_rotation_turns_what_follows() {
    assert_ends(
        "G0 X10 Y0\nG68 X10 Y0 R90\nG1 X12 F1\nG91 X2\nG90\nG69\nX0 Y0\nM30\n",
        &[[10.0, 0.0, 0.0], [10.0, 2.0, 0.0], [10.0, 4.0, 0.0], [0.0, 0.0, 0.0]],
    );
    let program = read("G68 X0 Y0 R90\nG0 X10 Y0\nG2 X0 Y10 I-10 J0 F1\nM30\n");
    // Clockwise from east to north is three quarters, and stays so however it is turned.
    assert!((program.arcs[0].sweep - 1.5 * std::f64::consts::PI).abs() < 1e-12);
    assert!((program.steps[1].to[0] + 10.0).abs() < 1e-12 && program.arcs[0].centre[0].abs() < 1e-12);
}

#[test]
fn moves_are_off_arcs_by_no_more_than_is_told() {
    let text = "G18\nG0 X-0.31 Z0\nG2 X0.31 Z0 I0.31 K49.999039 F100\nG17\nG3 X-40 Y0 I-20.155 J0\nM30\n";
    let placing = Placing { chord: 0.001, kinematics: None, lengths: &|_| None };
    let path = &read(text).runs(&placing).unwrap()[0].path;
    let off = path.segments().filter(|(.., step)| step.kind != motion::MoveKind::Rapid).map(|(a, b, _)| {
        let middle = a + 0.5 * (b - a);
        if a.y == 0.0 && b.y == 0.0 {
            50.0 - middle.x.hypot(middle.z - 49.999039)
        } else {
            20.155 - (middle.x + 19.845).hypot(middle.y)
        }
    });
    let most = off.fold(0.0, f64::max);
    assert!(most > 5e-5 && most <= path.origin.strays && path.origin.strays <= 1.01e-4, "{most}");
    let straight = &read("G0 X1\nG1 X5 F100\nM30\n").runs(&placing).unwrap()[0].path;
    assert_eq!(straight.origin.strays, 0.0);
}

#[test]
fn a_chord_tolerance_that_is_none_is_refused() {
    let program = read("G0 X1\nG2 X3 I1 F100\nM30\n");
    for chord in [f64::NAN, 0.0, -1.0, f64::INFINITY] {
        let refused = program.runs(&Placing { chord, kinematics: None, lengths: &|_| None }).err().unwrap();
        assert!(matches!(refused.fault, crate::Fault::Chord(_)), "{chord}");
        // No line of the program is at fault.
        let told = format!("{}: the chord tolerance is {chord} mm; it must be above 0", program.name);
        assert_eq!(refused.to_string(), told);
    }
}

/// Minutes that the feeds of a program ask for on a table that turns about x and z.
fn minutes_on_a_table(text: &str) -> f64 {
    let kinematics = machine::kinematics::Kinematics::by_name("ac-table").unwrap();
    let placing = Placing { chord: 0.001, kinematics: Some(&kinematics), lengths: &|_| None };
    let run = read(text).runs(&placing).unwrap().swap_remove(0);
    run.joints.iter().map(|place| place.pace.asked_s / 60.0).sum()
}

#[test]
fn moves_in_which_axes_turn_take_the_time_of_their_feed() {
    for (text, expected) in [
        ("G0 X50 Y0 Z20 C0 A0\nG93\nG1 C90 F1\nG1 X51 C180 F1\nG94\nM30\n", 2.0),
        ("G0 X50 Z20 C0\nG1 C90 F45\nX60 C0 F5\nM30\n", 4.0),
        // About the tip, and with nothing left to do.
        ("G0 X0 Y0 Z20\nG93 G1 A30 F0.5\nM30\n", 2.0),
        ("G0 X0 Y0 Z20\nG93 G1 C90 F0.5\nM30\n", 2.0),
        ("G43.4 H1 G0 X10 Y0 Z20\nG93 G1 A30 C90 F0.5\nM30\n", 2.0),
        ("G0 X50 Y0 Z20\nG93 G2 X0 Y50 I-50 J0 C90 F2\nM30\n", 0.5),
    ] {
        let minutes = minutes_on_a_table(text);
        assert!((minutes / expected - 1.0).abs() < 1e-4, "{text}: {minutes}");
    }
}

/// Stops and the moves that come from where nobody knows, by the lines before and in which they are.
fn stops_and_approaches(text: &str, control: &'static Control) -> (Vec<u32>, Vec<u32>) {
    let read = read_with(text, control, &Setup::from_above(200.0));
    let placing = Placing { chord: 0.1, kinematics: None, lengths: &|_| None };
    let path = read.runs(&placing).unwrap().swap_remove(0).path;
    let line = |k: &u32| path.line_of(*k as usize).unwrap();
    let approaches = path.origin.approaches.iter().flat_map(|range| range.clone());
    (path.origin.stops.iter().map(line).collect(), approaches.map(|k| line(&k)).collect())
}

#[test]
fn the_machine_rests_at_dwells_and_stops() {
    let stops = |text: &str, control| stops_and_approaches(text, control).0;
    assert_eq!(stops("G0 X1\nG1 X2 F9\nG4 P0\nX3\nX4 M0\nX5\nM1\nX6\nM30\n", GENERAL_CONTROL), [4, 6, 8]);
    // Exact stops end with their mode, that of G9 with its block.
    let exact = "G61\nG1 X1 F9\nX2\nG64 X3\nX4\nG9 X5\nX6\nM30\n";
    assert_eq!(stops(exact, &FANUC), [2, 3, 4, 7]);
    let linuxcnc = Control::from_word("linuxcnc").unwrap();
    assert_eq!(stops("G61\nG1 X1 F9\nX2\nG61.1\nX3\nX4\nG61\nX5\nM30\n", linuxcnc), [5, 6, 8]);
    let noted = read_with("G61\nG1 X1 F9\nM30\n", linuxcnc, &Setup::default());
    assert!(noted.notes[0].text.contains("G61 is timed as G64"), "{:?}", noted.notes);
    assert_eq!(stops("G61\nG1 X1 F9\nX2\nM30\n", Control::from_word("grbl").unwrap()), []);
}

/// The places of the tip from the start on, as the first rapids of a program lead it.
fn led(text: &str) -> Vec<[f64; 3]> {
    let read = read_with(text, GENERAL_CONTROL, &Setup::from_above(200.0)).from_above();
    let tip = |place: &Place| [place[0], place[1], place[2] + 200.0];
    std::iter::once(&read.start).chain(read.steps.iter().map(|step| &step.to)).map(tip).collect()
}

#[test]
fn until_a_place_is_known_the_tool_is_above_all_of_the_program() {
    // Higher than the assumed start, and lower beside it.
    assert_eq!(
        led("G0 Z303\nX-4 Y-2\nG1 Z300 F9\nM30\n"),
        [[0.0, 0.0, 303.0], [-4.0, -2.0, 303.0], [-4.0, -2.0, 303.0], [-4.0, -2.0, 300.0]]
    );
    assert_eq!(
        led("G0 Z5\nX9\nY3\nG1 Z0 F9\nG0 Z8\nM30\n")[..4],
        [[0.0, 0.0, 200.0], [9.0, 3.0, 200.0], [9.0, 3.0, 200.0], [9.0, 3.0, 5.0]]
    );
    assert_eq!(led("G0 X9 Y3 Z5\nG1 Z0 F9\nM30\n")[..2], [[9.0, 3.0, 200.0], [9.0, 3.0, 5.0]]);
    // The tool goes down where it is said to, and feeds from where it is.
    assert_eq!(led("G0 X9 Y3\nZ-5\nG1 X0 F9\nM30\n")[1..3], [[9.0, 3.0, 200.0], [9.0, 3.0, -5.0]]);
    assert_eq!(led("G0 Z5\nG1 X9 F9\nG0 Y3\nM30\n")[1], [0.0, 0.0, 5.0]);
    // A feed to the first place comes straight down on it, however far away that is.
    assert_eq!(
        led("G1 X9e4 Y3 Z5 F9\nX0\nM30\n".replace("9e4", "90000").as_str())[..2],
        [[9e4, 3.0, 200.0], [9e4, 3.0, 5.0]]
    );
}

#[test]
fn the_way_from_where_nobody_knows_is_told() {
    let approaches = |text: &str| stops_and_approaches(text, GENERAL_CONTROL).1;
    assert_eq!(approaches("G0 X5 Y1\nX9\nZ9\nX0\nZ1\nG1 X2 F9\nM30\n"), [1, 2, 3]);
    assert_eq!(approaches("G0 X0 Y0 Z10\nX9\nM30\n"), [1]);
    // Machine zero is a known place.
    assert_eq!(approaches("G91 G28 Z0\nG90 G0 X0 Y0\nZ10\nX9\nM30\n"), []);
    assert_eq!(approaches("G53 G0 Z-20\nG0 X5 Y0\nZ10\nG1 X9 F9\nG0 X0\nM30\n"), [1, 2]);
    // Wherever it begins, a step is known.
    assert_eq!(approaches("G91 G0 X5 Y1 Z1\nG90 X9\nG1 X2 F9\nM30\n"), [1, 2]);
    assert_eq!(approaches("G91 G0 X5 Y1 Z1\nG1 X2 F9\nM30\n"), []);
    // So is a feed to the first place of all.
    assert_eq!(approaches("G1 X5 Y1 Z2 F9\nX9\nG0 Z10\nM30\n"), [1]);
    assert_eq!(approaches("G0 X5 Y1\nG1 Z2 F9\nX9\nM30\n"), [1, 2]);
    assert_eq!(approaches("G0 Z2\nG1 X5 Y1 F9\nX9\nM30\n"), [1, 2]);
    let noted = read("G1 X5 Y1 Z2 F9\nX9\nM30\n").notes;
    assert!(noted.iter().any(|note| note.line == 1 && note.text.contains("from where nobody knows")));
    assert_eq!(approaches("G81 X5 Y1 Z-2 R1 F9\nX9\nM30\n"), [1, 1]);
    let arc = read("G2 X4 Y0 I2 F9\nG3 X0 I-2\nM30\n").notes;
    assert!(arc.len() == 1 && arc[0].text.ends_with("taken to begin at X0.0000 Y0.0000"), "{arc:?}");
    assert!(read("G0 X0 Y0\nG2 X4 I2 F9\nM30\n").notes.is_empty());
    // What feeds from there is not left out.
    assert_eq!(approaches("G1 X5 F9\nG0 Z10\nM30\n"), []);
}

#[test]
fn an_arc_is_one_line() {
    let text = "G0 X10 Y0\nG1 X9 F9\nG3 I-9 J0\nG3 I-9 J0\nG1 X8\nM30\n";
    let placing = Placing { chord: 0.01, kinematics: None, lengths: &|_| None };
    let path = read(text).runs(&placing).unwrap().swap_remove(0).path;
    let arcs = &path.origin.pieces;
    assert!(
        arcs.len() == 2 && arcs[0].start == 2 && arcs[0].len() > 10 && arcs[1].end as usize == path.len() - 1
    );
    assert_eq!(arcs[0].end, arcs[1].start);
}

#[test]
fn dwells_last_as_each_control_counts_them() {
    let lasts = |text: &str, control| -> f64 {
        let read = read_with(text, control, &Setup::default());
        let placing = Placing { chord: 0.001, kinematics: None, lengths: &|_| None };
        let standing = read.runs(&placing).unwrap().iter().map(|run| run.path.origin.standing_s).sum();
        assert!(read.notes.iter().all(|note| note.text.contains("least increments")), "{:?}", read.notes);
        standing
    };
    let around = |dwell: &str| format!("T1 M6\nG0 X1\n{dwell}\nG1 X2 F100\nM30\n");
    let mach = Control::from_word("mach").unwrap();
    for (dwell, control, expected) in [
        ("G4 X60.\nG4 P60000", GENERAL_CONTROL, 120.0),
        ("G4 P0.5", GENERAL_CONTROL, 0.5),
        ("G4 P500", &FANUC, 0.5),
        ("G4 U1.5", &FANUC, 1.5),
        ("G4 P1.", &HAAS, 1.0),
        ("G4 P2", &LINUXCNC, 2.0),
        ("G4 P2", &GRBL, 2.0),
        ("G4 P2", mach, 2.0),
        // Stays for the next hole, not for cycles that do not stand.
        ("G82 X1 Z-1 R1 P250 F10\nX2\nG81 X3", &FANUC, 0.5),
        ("G89 X1 Z-1 R1 P0.25 F10\nX2\nG80", &LINUXCNC, 0.5),
    ] {
        let found = lasts(&around(dwell), control);
        assert!((found - expected).abs() < 1e-12, "{dwell}: {found}");
    }
    assert_eq!(lasts("G0 X1\nG1 X2 F100\nG4 P100\nM30\n", &FANUC), 0.1);
    assert_eq!(refused("G0 X1\nG4 P-1\n", &FANUC).0, 2);
    assert_eq!(read("G4\nG0 X1\nM30\n").notes.len(), 1);
}

#[test]
fn shifts_are_independent_of_each_other_on_fanuc() {
    assert_ends("G92 X5 Y0\nG52 X1\nG1 X0 F1\nG52 X0\nX0\nM30\n", &[[-4.0, 0.0, 0.0], [-5.0, 0.0, 0.0]]);
    assert_ends("G10 L2 P2 X1 Y2\nG55 G0 X0 Y0\nG54.1 P3 X5\nM30\n", &[[1.0, 2.0, 0.0], [5.0, 2.0, 0.0]]);
}

/// Where a work offset that nobody set is on the machine is not known, so that one with machine coordinates
/// has no place beside it.
#[test]
fn an_offset_beside_one_that_nobody_knows_is_refused() {
    let read = |text: &str, control| read_gcode("a.nc", text.as_bytes(), control, &Setup::from_above(200.0));
    let fanuc = &FANUC;
    for (text, line) in [
        ("G0 X1 Y1 Z5\nG10 L2 P1 X0 Y0 Z-2\nG91 X1\nG90 X2\nM30\n", 4),
        ("G0 X1 Y1 Z5\n#5223=-2.\nX2\nY2\nZ1\nM30\n", 5),
        ("G0 X1 Y1 Z5\nG10 L2 P2 Z-2\nG55\nX2 Y2\nG81 Z-1 R1 F9\nM30\n", 5),
        ("G10 L2 P1 X-300 Y-200 Z-400\nG0 X1\nG55 X2\nM30\n", 3),
        ("G53 G0 Z-20\nG10 L2 P1 Z-400\nG0 Z5\nM30\n", 3),
        ("G0 X1 Y1\nG10 L2 P1 Y9\nG68 X0 Y0 R45\nX5\nM30\n", 4),
    ] {
        let error = read(text, fanuc).expect_err(text);
        assert_eq!(error.line, line, "{text}: {error}");
        assert!(matches!(error.fault, Fault::Offset(_)), "{text}: {error}");
        // On a machine whose offsets are known the place is.
        assert!(read_gcode("a.nc", text.as_bytes(), fanuc, &Setup::default()).is_ok(), "{text}");
    }
    for text in [
        // All are set before the first move, or all by what was there.
        "G91 G28 Z0\nG90 G10 L2 P1 X-300 Y-200 Z-400\nG10 L2 P2 X-250 Y-200 Z-400\nG0 X1 Y1 Z1\nG55 X2 Y2 Z2\nM30\n",
        "G0 X1 Y1 Z5\n#5223=#5223-0.1\nX2\nZ1\nM30\n",
        "G0 X1 Y1 Z5\nG91 G10 L2 P1 Z-0.1\nG90 Z1\nM30\n",
        "G0 X1 Y1 Z5\nG10 L20 P2 X0 Y0 Z0\nG55 X2 Z1\nM30\n",
        // Nothing moves in it.
        "G0 X1 Y1 Z5\nG10 L2 P1 X0 Y0 Z0\nG91 G28 Z0\nM30\n",
        "G0 X1 Y1 Z5\nG55 X2 Y2 Z1\nM30\n",
    ] {
        assert!(read(text, fanuc).is_ok(), "{text}: {:?}", read(text, fanuc));
    }
}

#[test]
fn motion_behind_the_closing_mark_is_refused() {
    for (text, line) in [
        ("G1 X1 F9\n%\nG0 X5 Y5\nG1 Z-1\nM30\n", 3),
        ("%\nO1\nG1 X1 F9\nM3\n%\n(NEXT)\nO2\n/N5 G0 Z[#1-5]\n%\n", 8),
    ] {
        assert_eq!(refused(text, GENERAL_CONTROL), (line, 1, Fault::BehindTheEnd("%")), "{text}");
    }
    let noted = read("%\nG1 X1 F9\n%\n\nMADE BY X3 FOR A 5 AXIS MILL\n");
    assert_eq!((noted.ended, noted.notes.len(), noted.notes[0].line), (true, 1, 5));
    assert!(read("%\nG1 X1 F9\n%\n\n%\n").notes.is_empty());
    assert!(read("%\nG1 X1 F9\nM30\n%\nX5\n").notes.is_empty());
}

#[test]
fn cycles_of_fanuc() {
    let program = read_with(
        "G0 Z10\nG98 G83 X1 Y0 Z-4 R2 Q3 F100\nG99 X2\nG98 X3\nG80\nM30\n",
        &FANUC,
        &Setup::default(),
    );
    let z: Vec<f64> = program.steps.iter().filter(|s| s.to[0] == 1.0).map(|s| s.to[2]).collect();
    assert_eq!(z, [10.0, 2.0, -1.0, 2.0, -0.75, -4.0, 10.0]);
    let third: Vec<f64> = program.steps.iter().filter(|s| s.to[0] == 3.0).map(|s| s.to[2]).collect();
    assert_eq!(third, [2.0, -1.0, 2.0, -0.75, -4.0, 10.0], "it comes at the retract plane");
    let back = ends(&read("G0 Z5\nG98 G87 X1 Y0 Z-3 R-8 Q0.5 F100\nG80\nM30\n"));
    let expected = [
        [1.0, 0.0, 5.0],
        [1.5, 0.0, 5.0],
        [1.5, 0.0, -8.0],
        [1.0, 0.0, -8.0],
        [1.0, 0.0, -3.0],
        [1.5, 0.0, -3.0],
        [1.5, 0.0, 5.0],
        [1.0, 0.0, 5.0],
    ];
    assert_eq!(back[1..], expected, "{back:?}");
}

#[test]
fn feeds_in_every_mode() {
    let program = read("S1000 M3\nG95 F0.2\nG1 X10\nG94 F300\nX20\nG93 X30 F6\nG20 G94 F10\nX1\nM30\n");
    let feeds: Vec<f64> = program.steps.iter().map(|step| step.feed).collect();
    assert_eq!(feeds, [200.0, 300.0, 60.0, 254.0]);
}

#[test]
fn lengths_count_for_the_tip() {
    let setup =
        Setup { lengths: [(1, [0.0, 0.0, 80.0]), (2, [0.0, 0.0, 81.0])].into(), ..Setup::from_above(200.0) };
    let program = read_with("T1 M6\nG43 H2\nG0 X1 Z10\nG1 Z-1 F100\nG91 G28 Z0\nM30\n", &HAAS, &setup);
    let placing = |lengths| Placing { chord: 0.01, kinematics: None, lengths };
    let tips = |placing: &Placing<'_>| -> Vec<f64> {
        program.runs(placing).unwrap()[0].path.moves.iter().map(|m| m.to.tip.z).collect()
    };
    let believed = tips(&placing(&|_| None));
    assert_eq!(believed, [10.0, -1.0, 200.0 - 81.0]);
    // The tool is 1 mm shorter than the control thinks.
    let true_lengths = |tool: u32| (tool == 1).then_some(80.0);
    assert_eq!(tips(&placing(&true_lengths)), [11.0, 0.0, 120.0]);
    assert_eq!(program.findings(&|_| None)[0].kind, FindingKind::SpindleOff);
    assert!(program.findings(&|_| None).iter().any(|found| found.kind == FindingKind::OtherLength));
}

/// The spindle stands where a length takes force or ends: the tip has not moved, and what follows moves the one
/// tool that there is.
#[test]
fn a_length_that_takes_force_moves_no_tip() {
    let tips = |text: &str| -> Vec<[f64; 3]> {
        let program = read_with(text, &FANUC, &Setup::from_above(200.0));
        let placing = Placing { chord: 0.01, kinematics: None, lengths: &|_| None };
        program.runs(&placing).unwrap()[0].path.moves.iter().map(|m| m.to.tip.into()).collect()
    };
    let head = "T1 M6\nG10 L10 P1 R20.\nG43 H1 G0 X0 Y0 Z10.\nG1 Z1. F500\n";
    let flat = [[0.0, 0.0, 10.0], [0.0, 0.0, 1.0], [5.0, 0.0, 1.0], [5.0, 4.0, 1.0]];
    assert_eq!(tips(&format!("{head}G49\nG1 X5.\nY4.\nM30\n")), flat);
    // 20 mm of tool hang below where the control takes the tip to be.
    assert_eq!(
        tips(&format!("{head}G49\nG0 Z15.\nG91 G28 Z0\nM30\n"))[2..],
        [[0.0, 0.0, -5.0], [0.0, 0.0, 180.0]]
    );
    let before = "T1 M6\nG10 L10 P1 R20.\nG0 X3. Y0 Z90.\nG43 H1 Z10.\nG1 Z1. F500\nM30\n";
    assert_eq!(tips(before), [[3.0, 0.0, 70.0], [3.0, 0.0, 10.0], [3.0, 0.0, 1.0]]);
}

/// The nose stands as the control lays it; the tip hangs from it by the tool's own length along the leaning
/// axis.
#[test]
fn a_head_swings_each_tool_by_its_own_length() {
    let (sin, cos) = 30f64.to_radians().sin_cos();
    let setup = Setup { lengths: [(1, [0.0, 0.0, 80.0]), (2, [0.0, 0.0, 81.0])].into(), ..Setup::default() };
    let table = |tool: u32| (tool == 1).then_some(80.0);
    for gauge in [80.0, 150.0] {
        let machine = machine::kinematics::Kinematics::by_name("ab-head").unwrap().with_gauge_length(gauge);
        let tip = |register: &str, lengths: &dyn Fn(u32) -> Option<f64>| {
            let text = format!("T1 M6\n{register}\nG0 B30\nG0 X1 Y2 Z3\nM30\n");
            let placing = Placing { chord: 0.01, kinematics: Some(&machine), lengths };
            let program = read_with(&text, GENERAL_CONTROL, &setup);
            program.runs(&placing).unwrap()[0].path.moves.last().unwrap().to.tip
        };
        let swung =
            |taken: f64, own: f64| geometry::Point3::new(1.0 - own * sin, 2.0, 3.0 + taken - own * cos);
        for (register, taken) in [("G43 H1", 80.0), ("G43 H2", 81.0), ("G49", 0.0)] {
            let off = (tip(register, &table) - swung(taken, 80.0)).norm();
            assert!(off < 1e-9, "{register}, {gauge}: {off}");
        }
        let kept = tip("G43.4 H2", &table) - geometry::Point3::new(1.0 + sin, 2.0, 3.0 + cos);
        assert!(kept.norm() < 1e-9, "{kept}");
        // The machine's length is that of a tool that no table knows.
        assert!((tip("G49", &|_| None) - swung(gauge, gauge)).norm() < 1e-9, "{gauge}");
    }
}

/// A table may carry the part turned; the spindle leans as the machine's own axes stand.
#[test]
fn an_offset_of_a_head_s_axis_leans_the_tool() {
    let (sin, cos) = 30f64.to_radians().sin_cos();
    for (machine, x, z) in [("ab-head", sin, cos), ("ab-table", 0.0, 1.0)] {
        let machine = machine::kinematics::Kinematics::by_name(machine).unwrap();
        let placing = Placing { chord: 0.01, kinematics: Some(&machine), lengths: &|_| None };
        for text in ["G10 L2 P1 B30\nG0 B0\nM30\n", "G0 B30\nG92 B0\nG0 X1\nM30\n"] {
            let program = read_with(text, GENERAL_CONTROL, &Setup::default());
            let run = program.runs(&placing).unwrap().swap_remove(0);
            let axis = run.path.moves.last().unwrap().to.axis;
            // What a program sets after its first motion is no zero of the part.
            let [x, z] = if text.starts_with("G0") { [sin, cos] } else { [x, z] };
            assert!((axis - geometry::Vector3::new(x, 0.0, z)).norm() < 1e-12, "{text}: {axis}");
            let turned =
                run.joints.last().unwrap().joints.rotary.iter().map(|angle| angle.to_degrees()).sum::<f64>();
            assert!((turned - 30.0 * f64::from(x > 0.0)).abs() < 1e-9, "{text}: {turned}");
        }
    }
}

#[test]
fn what_cannot_be_followed_is_refused_at_its_place() {
    let unsupported = |text: &str, line: u32, column: u32| {
        let (l, c, fault) = refused(text, GENERAL_CONTROL);
        assert!(matches!(fault, Fault::Unsupported { .. }), "{text}: {fault}");
        assert_eq!((l, c), (line, column), "{text}");
    };
    unsupported("G0 X1\nN5 G33 Z-1 K1\n", 2, 4);
    unsupported("G38.2 Z-1\n", 1, 1);
    unsupported("G1 X1 F1\nG51 X0 Y0 P2\n", 2, 1);
    unsupported("G16\n", 1, 1);
    unsupported("G5 I1 J1 P1 Q1 X3 Y3\n", 1, 1);
    for (text, line, column, fault) in [
        ("G0 X1\nG41 D1 X2\n", 2, 5, Fault::NoRadius(1)),
        ("T4 M6\nG42 X2\n", 2, 1, Fault::NoRadius(4)),
        ("F1\nG41.1 D4 G1 X1\n", 2, 1, Fault::Entry { radius: 2.0 }),
        ("F1\nG41.1 D4 G1 X9\nY1\nX8\n", 3, 1, Fault::Corner { radius: 2.0 }),
        ("F1\nG41.1 D4 G1 X9\nG3 X8 Y1 R1\n", 3, 1, Fault::InnerArc { radius: 2.0, arc: 1.0 }),
        ("F1\nG41.1 D4 G1 X9\nG10 L2 P1 X1\n", 3, 1, Fault::Meanwhile("G10".into())),
        ("T1\nG41.1 D4 G1 X9 F1\nM6\n", 3, 1, Fault::Meanwhile("M6".into())),
        ("G1 X1 F1\nG1 Y2 U3\n", 2, 7, Fault::Unused('U')),
        (
            "X5\n",
            1,
            1,
            Fault::Missing {
                code: "the word X".into(),
                words: "a motion such as G0 or G1, in this block or before",
            },
        ),
        ("G0 G1 X5\n", 1, 4, Fault::Conflict { first: "G0".into(), second: "G1".into() }),
        ("G123 X5\n", 1, 1, Fault::UnknownCode { code: "G123".into(), control: "general" }),
        ("G2 X10 I4 F1\n", 1, 4, Fault::ArcEnds { start: 4.0, end: 6.0 }),
        ("G2 X10 R4 F1\n", 1, 8, Fault::ArcReach { radius: 4.0, apart: 10.0 }),
        ("G1 X[1/0]\n", 1, 7, Fault::Zero),
        ("G1 X1e5 F1\n", 1, 6, Fault::Unused('E')),
        ("G1 X99999999999 F1\n", 1, 4, Fault::Range { letter: 'X', value: 99_999_999_999.0 }),
        ("M6\n", 1, 1, Fault::Missing { code: "M6".into(), words: "T with the number of a tool" }),
        ("G81 X1 Z1 R0 F1\n", 1, 8, Fault::CycleUpward { retract: 0.0, bottom: 1.0 }),
        ("M98 P7\n", 1, 5, Fault::NoTarget("subprogram O7".into())),
        ("GOTO 5\n", 1, 1, Fault::NoTarget("block N5".into())),
        (
            "o1 while [1 EQ 0]\nG0 X1\n",
            1,
            1,
            Fault::Unmatched { found: "the loop O1".into(), wanted: "endwhile or endrepeat" },
        ),
    ] {
        assert_eq!(refused(text, GENERAL_CONTROL), (line, column, fault), "{text}");
    }
    assert!(matches!(refused("G81 X1 Z-1 R1\n", &GRBL).2, Fault::UnknownCode { .. }));
    assert!(matches!(refused("G43.4 H1\n", &LINUXCNC).2, Fault::UnknownCode { .. }));
    assert!(matches!(refused("G93 G1 X1 F5\nX2\n", &LINUXCNC).2, Fault::Missing { .. }));
}

#[test]
fn nothing_runs_without_end() {
    assert!(matches!(refused("N1 G0 X1\nGOTO 1\n", GENERAL_CONTROL).2, Fault::Endless(_)));
    assert!(matches!(refused("o1 while [1]\no1 endwhile\n", GENERAL_CONTROL).2, Fault::Endless(_)));
    assert!(matches!(
        refused("o1 sub\no1 call\no1 endsub\no1 call\n", GENERAL_CONTROL).2,
        Fault::Recursion(_)
    ));
    assert!(matches!(refused("O1\nM98 P1\n", GENERAL_CONTROL).2, Fault::Recursion(_)));
    assert!(matches!(refused("G0 Z9\nG81 X1 Z-1 R1 L999999 F1\n", GENERAL_CONTROL).2, Fault::Endless(_)));
    assert!(matches!(refused("G0 Z9\nG83 X1 Z-999 R1 Q0.0001 F1\n", GENERAL_CONTROL).2, Fault::Value { .. }));
    assert!(matches!(refused("o1 repeat [1e]\n", GENERAL_CONTROL).2, Fault::Expected(_)));
}

#[test]
fn what_moves_nothing_is_noted_and_never_in_silence() {
    let program = read("M100\nM62 P1\nG64 P0.01\nG5.1 Q1\nG0 X1\nM99\n");
    let lines: Vec<u32> = program.notes.iter().map(|note| note.line).collect();
    assert_eq!(lines, [1, 2, 6]);
    assert!(program.ended);
}

#[test]
fn words_of_linuxcnc_switch_the_kinematics() {
    let kept = |program: &Program| -> Vec<bool> {
        let moves = program.steps.iter().filter(|step| step.kind != StepKind::Set);
        moves.map(|step| program.setting(step).tip_kept).collect()
    };
    let text = "G0 X1\nG43 H1 M428\nX2\nM429 G49\nX3\nM2\n";
    assert_eq!(kept(&read_with(text, &LINUXCNC, &Setup::default())), [false, true, false]);
    let general = read(text);
    assert_eq!((kept(&general), general.notes.len()), (vec![false; 3], 2));
    assert_eq!(kept(&read("G0 X1\nG43.4 H1\nX2\nG49\nX3\nM30\n")), [false, true, false]);
}

#[test]
fn rotary_words_need_a_machine() {
    let program = read("G0 X1\nG1 A30 F100\nM30\n");
    let error = program.runs(&Placing { chord: 0.01, kinematics: None, lengths: &|_| None }).unwrap_err();
    assert_eq!((error.line, error.fault), (2, Fault::Rotary('A')));
}

#[test]
fn the_part_s_zero_is_where_the_program_first_moves() {
    let setup = Setup::from_above(200.0);
    let placing = Placing { chord: 0.01, kinematics: None, lengths: &|_| None };
    for text in [
        "G54 G0 X1 Y2 Z3\nM30\n",
        "G10 L2 P2 X50 Y60 Z-70\nG55 G0 X1 Y2 Z3\nM30\n",
        "G92 X0 Y0 Z0\nG0 X1 Y2 Z3\nM30\n",
        "G53 G0 Z0\nG52 X0\nG0 X1 Y2 Z3\nM30\n",
    ] {
        let path = read_with(text, GENERAL_CONTROL, &setup).runs(&placing).unwrap().swap_remove(0).path;
        let tip = path.moves.last().unwrap().to.tip;
        assert!((tip - geometry::Point3::new(1.0, 2.0, 3.0)).norm() < 1e-12, "{text}: {tip}");
    }
}
