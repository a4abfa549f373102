use super::*;
use crate::{FindingKind, Placing};

fn read(text: &str) -> Program {
    read_apt("a.cls", text.as_bytes()).unwrap()
}

/// As NX writes it.
const NX: &str = "\
TOOL PATH/CONTOUR,TOOL,MILL_10
TLDATA/MILL,10.0000,5.0000,75.0000,0.0000,0.0000
MSYS/0.0000,0.0000,0.0000,1.0000000,0.0000000,0.0000000,0.0000000,1.0000000,0.0000000
$$ centerline data
PAINT/PATH
LOAD/TOOL,3
SPINDL/RPM,8000,CLW
RAPID
GOTO/0.0000,0.0000,50.0000,0.0000000,0.0000000,1.0000000
RAPID
GOTO/10.0000,0.0000,5.0000
FEDRAT/MMPM,250.0000
GOTO/10.0000,0.0000,-1.0000
CIRCLE/0.0000,0.0000,-1.0000,0.0000000,0.0000000,1.0000000,10.0000,0.0600,0.5000,10.0000,0.0000
GOTO/0.0000,10.0000,-1.0000
GOTO/0.0000,10.0000,$
  5.0000
END-OF-PATH
FINI
";

#[test]
fn nx_is_read_with_its_arcs() {
    let program = read(NX);
    assert!(program.ended && program.findings(&|_| None).is_empty(), "{:?}", program.findings(&|_| None));
    let kinds: Vec<(StepKind, u32)> = program.steps.iter().map(|s| (s.kind, s.line)).collect();
    use StepKind::{Arc, Feed, Rapid};
    assert_eq!(kinds, [(Rapid, 11), (Feed, 13), (Arc(0), 15), (Feed, 16)]);
    assert!((program.arcs[0].sweep - 0.5 * std::f64::consts::PI).abs() < 1e-12);
    assert_eq!((program.steps[1].feed, program.setting(&program.steps[1]).tool), (250.0, 3));
    let placing = Placing { chord: 0.01, kinematics: None, lengths: &|_| None };
    let runs = program.runs(&placing).unwrap();
    assert_eq!((runs.len(), runs[0].tool), (1, 3));
    for (_, to, m) in runs[0].path.segments().filter(|(.., m)| m.to.tip.z == -1.0) {
        let radius = to.x.hypot(to.y);
        assert!((radius - 10.0).abs() < 1e-9, "{m:?}");
    }
}

/// Locations of a half circle in XZ, its lowest place at z = -5, under a tool axis of these words.
fn half_circle(before: &str, after: &str) -> String {
    format!(
        "FEDRAT/MMPM,200\nFROM/10.0,20.0,20.0\nGOTO/10.0,20.0,5.0{before}\n\
         CIRCLE/20.0,20.0,5.0,0.0,-1.0,0.0,10.0\nGOTO/30.0,20.0,5.0{after}\nFINI\n"
    )
}

#[test]
fn circles_are_followed_under_upright_and_leaning_tools() {
    let axes = [
        ("", ""),
        (",0,0,1", ",0.0001,0,1"),
        (",0.6,0,0.8", ",0.6,0,0.8"),
        (",0.6,0,0.8", ",0.600001,0,0.8"),
    ];
    for (before, after) in axes {
        let placing = Placing { chord: 0.001, kinematics: None, lengths: &|_| None };
        let runs = read(&half_circle(before, after)).runs(&placing).unwrap();
        let path = &runs[0].path;
        let along = &path.moves[1..];
        let lowest = along.iter().map(|step| step.to.tip.z).fold(f64::INFINITY, f64::min);
        assert!((lowest + 5.0).abs() < 0.001, "{before} {after}: {lowest}");
        for step in along {
            let radius = (step.to.tip.x - 20.0).hypot(step.to.tip.z - 5.0);
            let lean = step.to.axis.dot(&path.moves[0].to.axis);
            assert!((radius - 10.0).abs() < 1e-9 && lean > 1.0 - 1e-7, "{before} {after}: {step:?}");
        }
    }
}

#[test]
fn circles_that_cannot_be_followed_are_refused_with_their_line() {
    let sound = half_circle("", "");
    for (text, line) in [
        (sound.replace("GOTO/30.0", "GOTO/30.02"), 5),
        (sound.replace("GOTO/10.0", "GOTO/9.98"), 5),
        (sound.replace(",10.0\n", ",0.0\n"), 5),
        (sound.replace(",10.0\n", ",10.0,TIMES,2\n"), 4),
        (sound.replace("GOTO/30.0", "RAPID\nGOTO/30.0"), 6),
        (sound.replace("GOTO/30.0", "FROM/30.0"), 5),
        (sound.replace("FROM/10.0,20.0,20.0\nGOTO/10.0,20.0,5.0\n", ""), 3),
        (half_circle(",0,0,1", ",0.001,0,1"), 5),
        (half_circle(",0.6,0,0.8", ",0,0,1"), 5),
        ("GOTO/0,1000,0\nCIRCLE/0,0,0,0,0,1,1000\nGOTO/0,-1000.2,0\n".to_owned(), 3),
    ] {
        let error = read_apt("a.cls", text.as_bytes()).expect_err(&text);
        assert_eq!(error.line, line, "{text}: {error}");
    }
    assert!(read_apt("a.cls", sound.replace("GOTO/30.0", "GOTO/30.005").as_bytes()).is_ok());
}

#[test]
fn delays_are_seconds_or_turns() {
    let program = read("SPINDL/1200,CLW\nGOTO/0,0,1\nDELAY/2.5\nGOTO/1,0,1\nDELAY/REV,10\nFINI\n");
    assert_eq!(program.dwells, [(0, 2.5), (1, 0.5)]);
}

#[test]
fn every_msys_is_another_frame() {
    let text = "\
MSYS/5,0,0,1,0,0,0,1,0
FEDRAT/MMPM,200
GOTO/1,0,10
GOTO/2,0,10
MSYS/105,0,0,0,0,-1,0,1,0
GOTO/1,2,3
GODLTA/0,0,1
GODLTA/1
CIRCLE/1,0,5,0,0,1,2
GOTO/1,-2,5
MSYS/5,0,0,1,0,0,0,1,0
GOTO/3,0,10
FINI
";
    let program = read(text);
    let ends: Vec<[f64; 3]> = program.steps.iter().map(|step| [step.to[0], step.to[1], step.to[2]]).collect();
    let expected = [
        [2.0, 0.0, 10.0],
        [103.0, 2.0, -1.0],
        [104.0, 2.0, -1.0],
        [105.0, 2.0, -1.0],
        [105.0, -2.0, -1.0],
        [3.0, 0.0, 10.0],
    ];
    assert_eq!(ends, expected);
    assert_eq!(program.axes[2], [1.0, 0.0, 0.0]);
    assert_eq!((program.axes[6], program.arcs[0].centre), ([0.0, 0.0, 1.0], [105.0, 0.0, -1.0]));
    assert_eq!((program.notes.len(), program.notes[0].line), (1, 5));
}

/// CATIA describes a cutter before its tool is loaded.
#[test]
fn a_cutter_is_that_of_the_tool_that_moves_next() {
    let text = "CUTTER/10,5\nLOADTL/1\nGOTO/0,0,1\nGOTO/1,0,1\nUNITS/INCHES\nCUTTER/0.25,0,0.125,0,0,0,2\nLOADTL/2\nGOTO/2,0,1\nFINI\n";
    let tools = crate::Described::of(&read(text)).table;
    let cutter = |tool: u32| tools.get(tool).map(|tool| tool.cutter);
    assert_eq!((cutter(1), cutter(2)), (cutter::Cutter::ball(10.0).ok(), cutter::Cutter::flat(6.35).ok()));
    let twice = "LOADTL/1\nCUTTER/10,5\nGOTO/0,0,1\nGOTO/1,0,1\nCUTTER/8,4\nGOTO/2,0,1\nFINI\n";
    let error = read_apt("a.cls", twice.as_bytes()).unwrap_err();
    assert_eq!((error.line, error.fault), (5, Fault::OtherCutter { tool: 1, line: 2 }));
    let early =
        crate::Described::of(&read("CUTTER/0.25,0.125\nUNITS/INCHES\nGOTO/0,0,1\nGOTO/1,0,1\nFINI\n"));
    assert!(
        early.table.tools.is_empty()
            && early.doubts(Some(0)).next().is_some_and(|doubt| doubt.contains("line 1"))
    );
    // Before any motion the last one counts, and the same one may be said again in more words.
    let again = "CUTTER/8,4\nCUTTER/10,5\nGOTO/0,0,1\nGOTO/1,0,1\nCUTTER/10,5,0,5,0,0,50\nGOTO/2,0,1\nFINI\n";
    let tools = crate::Described::of(&read(again)).table;
    assert_eq!(tools.get(0).map(|tool| tool.cutter), cutter::Cutter::ball(10.0).ok());
}

#[test]
fn catia_habits_inches_and_five_axes() {
    let text = "\
$$ -----------------------------------------------------------------
PARTNO PART TO BE MACHINED
CUTTER/ 10.000000,  5.000000,  0.000000,  5.000000,  0.000000,$
  0.000000, 50.000000
MULTAX
TPRINT/T1 END MILL D 10
LOADTL/1
FEDRAT/ 1000.0000,MMPM
SPINDL/   70.0000,RPM,CLW
GOTO  /    0.00000,    0.00000,   10.00000, 0.000000, 0.000000, 1.000000
GOTO  /    5.00000,    0.00000,   10.00000, 0.600000, 0.000000, 0.800000
GODLTA/1,0,0
UNITS/INCHES
GOTO/1,1,1
FINI
";
    let program = read(text);
    assert_eq!(program.steps.len(), 3);
    assert!((program.axes[1][0] - 0.6).abs() < 1e-12 && program.axes[2] == program.axes[1]);
    assert_eq!(program.steps[1].to[..3], [6.0, 0.0, 10.0]);
    assert_eq!(program.steps[2].to[..3], [25.4, 25.4, 25.4]);
    assert_eq!(program.tools[0].text, "CUTTER/10,5,0,5,0,0,50");
}

#[test]
fn what_may_move_the_tool_is_refused_with_its_line() {
    for (text, line, column) in [
        ("GOTO/1,2\n", 1, 1),
        ("PARTNO x\nGOTO/1,2,z\n", 2, 10),
        ("GOTO/1,2,3\nGOFWD/L1,TANTO,C2\n", 2, 1),
        ("GOTO/1,2,3\nCYCLE/DRILL,10,1\n", 2, 1),
        ("GOTO/1,2,3,0,0,0\n", 1, 1),
        ("L1=LINE/P1,P2\n", 1, 1),
        ("GOTO/1e9,2,3\n", 1, 6),
        ("GOTO/1,2,3\nMODE/INCR\nGOTO/1,0,0\n", 2, 1),
        ("GOTO/1,2,3\nCUTCOM/LEFT,1\n", 2, 1),
        ("GOTO/1,2,3\nCUTCOM/ON,RIGHT\n", 2, 1),
        ("MSYS/0,0,0,1,0,0\n", 1, 1),
        ("MSYS/0,0,0,1,0,0,1,0,0\n", 1, 1),
        ("GOTO/1,2,3\nMSYS/0,0,0,1,0,0,0,1,0\n", 2, 1),
        ("ROTHED/30\n", 1, 1),
        ("ROTHED/AAXIS,ATANGL,-5\n", 1, 1),
        ("GOTO/1,2,3\nINSERT/G1 Z-1\n", 2, 1),
        ("GOTO/1,2,3\nINSERT G1 Z-1 F100\n", 2, 1),
        ("GOTO/1,2,3\nINSERT/(A) X5\n", 2, 1),
        ("GOTO/1,2,3\nINSERT/M98 P5\n", 2, 1),
        ("GOTO/1,2,3\nPREFUN/91\n", 2, 1),
        ("GOTO/1,2,3\nPREFUN/55\n", 2, 1),
        ("PREFUN/G91\n", 1, 1),
        ("AUXFUN/98\n", 1, 1),
        ("AUXFUN/6\n", 1, 1),
        ("PIVOTZ/100\n", 1, 1),
        ("GOTO/1,2,3\nRETRCT\n", 2, 1),
        ("GOTO/1,2,3\nREWIND\n", 2, 1),
        ("CATCALL/A\n", 1, 1),
        ("HEAD/1\nGOTO/1,2,3\nHEAD/1\nHEAD/2\n", 4, 1),
        ("GOTO/1,2,3\nFINI\nRAPID\nGOTO/1,2,4\n", 4, 1),
        ("GOTO/1,2,3\nAUXFUN/30\nGOTO/1,2,4\n", 3, 1),
    ] {
        let error = read_apt("a.cls", text.as_bytes()).unwrap_err();
        assert_eq!((error.line, error.column), (line, column), "{text}: {error}");
    }
    assert!(read_apt("a.cls", b"GOTO/1,2,3\nCYCLE/OFF\nCUTCOM/OFF\nMODE/ABSOL\nFINI").is_ok());
    let quiet = "PREFUN/54\nROTHED/0\nHEAD/1\nGOTO/1,2,3\nPREFUN/64\nAUXFUN/8\nINSERT/\nINSERT/(M98 P5)\nINSERT N5 M8\nGOTO/2,2,3\nFINI\n";
    let program = read(quiet);
    assert!(program.ended && program.steps.len() == 1 && program.notes.is_empty(), "{:?}", program.notes);
    let behind = read("GOTO/1,2,3\nFINI\nPPRINT DONE\n");
    assert_eq!((behind.notes.len(), behind.notes[0].line), (1, 3));
    let off = read("SPINDL/100\nGOTO/0,0,1\nGOTO/1,0,1\nAUXFUN/5\nFEDRAT/100\nGOTO/2,0,1\nFINI\n");
    assert!(
        off.findings(&|_| None).iter().any(|found| found.kind == FindingKind::SpindleOff && found.line == 6)
    );
    let cut = read("GOTO/0,0,1\nFEDRAT/100\nGOTO/1,0,1\n");
    assert_eq!(cut.findings(&|_| None).last().map(|f| f.kind), Some(FindingKind::NoEnd));
}

#[test]
fn locations_are_told_from_g_code() {
    assert!(looks_like_apt(NX.as_bytes()) && looks_like_apt(b"PARTNO a\nGOTO/1,2,3"));
    assert!(!looks_like_apt(b"%\nO1\nG0 X1\nIF [#1 GT 2] GOTO 5\nN5 M30\n") && !looks_like_apt(b""));
}
