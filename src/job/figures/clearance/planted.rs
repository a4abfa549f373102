//! Every pair of the tool, upright and leaning, at 0.05 mm to either side of touching, against closed forms.

use super::tests::{Home, PLATE};
use report::{Claim, ToolpathResult, Verdict};

/// A holder of 20 mm, 30 mm long, that begins 20 mm above the tip.
const BOTTOM: f64 = 20.0;
const RADIUS: f64 = 10.0;
const HOLDER: &str = "[holder]\ncutting_length = 20\n[[holder.section]]\ndiameter = 20\nlength = 30\n";
/// A shank of 5 mm before it, which begins 6 mm above the tip.
const SHANK: &str = "[holder]\ncutting_length = 6\n[[holder.section]]\ndiameter = 5\nlength = 14\n\
                     [[holder.section]]\ndiameter = 20\nlength = 30\n";

/// A shank alone, wider than the cutter: an upright one no wider stands where the cutter has been.
const SHANK_BOTTOM: f64 = 6.0;
const SHANK_RADIUS: f64 = 4.0;
const SHANK_ALONE: &str = "[holder]\ncutting_length = 6\n[[holder.section]]\ndiameter = 8\nlength = 44\n";

const GAPS: [f64; 2] = [0.05, -0.05];
const AXES: [[f64; 2]; 2] = [[0.0, 1.0], [0.6, 0.8]];

/// A program that goes down along the axis `[x, z]` to `tip`, and back.
fn program(tip: [f64; 3], [x, z]: [f64; 2], rapid: &str) -> String {
    let at =
        |far: f64| format!("GOTO/{:.6},{:.6},{:.6},{x},0,{z}\n", tip[0] + far * x, tip[1], tip[2] + far * z);
    format!(
        "UNITS/MM\nSPINDL/8000,CLW\nRAPID\n{}{rapid}{}FEDRAT/800,MMPM\n{}FINI\n",
        at(70.0),
        at(0.0),
        at(70.0)
    )
}

struct Case {
    home: Home,
    axis: [f64; 2],
    holder: &'static str,
    /// Between the top of the plate and that of the block.
    allowance: f64,
    rapid: &'static str,
}

impl Case {
    fn new(name: &str, axis: [f64; 2]) -> Self {
        let home = Home::new(&format!("planted-{name}-{}", axis[0]));
        Self { home, axis, holder: HOLDER, allowance: 0.0, rapid: "FEDRAT/800,MMPM\n" }
    }

    fn run(&self, tip: [f64; 3]) -> ToolpathResult {
        self.home.write("path.cls", &program(tip, self.axis, self.rapid));
        let fixture = "[[fixture]]\nfile = \"clamp.stl\"\n";
        self.home.opened(&format!(
            "{PLATE}[stock]\nallowance = {}\n{}[interference]\nclearance = 0\n{fixture}[[toolpath]]\nstrategy = \"program\"\n\
             file = \"path.cls\"\n",
            self.allowance, self.holder
        ))
    }

    /// A clamp that begins so far along x, at the heights around `z`.
    fn clamp(&self, x: [f64; 2], z: f64) {
        self.home.solid("clamp.stl", [x[0], -20.0, z - 2.0], [x[1], 20.0, z + 2.0]);
    }

    /// Where the tip is when the lowest place of a rim, so far above the tip and so wide, is over the plate
    /// at `z`.
    fn tip_under_rim(&self, [bottom, radius]: [f64; 2], z: f64) -> [f64; 3] {
        let [x, up] = self.axis;
        [3.0 - bottom * x - radius * up, 3.0, z - bottom * up + radius * x]
    }

    /// A clamp under the tool, whose edge lies so far above the tip along the axis and so far from the axis.
    fn beside(&self, tip: [f64; 3], height: f64, far: f64) {
        let [x, z] = [
            tip[0] + height * self.axis[0] + far * self.axis[1],
            tip[2] + height * self.axis[1] - far * self.axis[0],
        ];
        self.home.solid("clamp.stl", [x, -20.0, z - 1.0], [x + 1.0, 20.0, z]);
    }
}

/// The claim on a pair, as it begins.
fn of_pair<'a>(result: &'a ToolpathResult, tool: &str, other: &str) -> &'a Claim {
    let of_pair = |claim: &&Claim| {
        let text = claim.text.to_lowercase();
        let named = text.contains(&format!("{tool} to {other}"));
        claim.what == "collision" && (named || text.starts_with(&format!("{tool} collides with {other}")))
    };
    result.claims.iter().find(of_pair).unwrap_or_else(|| panic!("{tool} {other} {:#?}", result.claims))
}

/// A contact is found and a clearance passes, with a figure that the closed form lies in.
fn holds(result: &ToolpathResult, tool: &str, other: &str, gap: f64) {
    let found = of_pair(result, tool, other);
    let verdict = if gap < 0.0 { Verdict::Fail } else { Verdict::Pass };
    assert_eq!(found.verdict(), verdict, "{tool} {other} {gap}: {found:?}");
    let clearance = -found.measured.unwrap();
    if gap > 0.0 {
        assert!(clearance >= gap - 1e-5 && clearance - found.error_bound <= gap + 1e-5, "{gap} {found:?}");
    } else {
        assert!(clearance >= gap - 1e-5 && clearance < 0.6 * gap, "{gap} {found:?}");
    }
}

/// A clamp beside the cutter on the side away from where it leans, and one under the holder.
#[test]
fn cutter_and_holder_against_a_fixture() {
    for (axis, gap) in AXES.into_iter().flat_map(|axis| GAPS.map(|gap| (axis, gap))) {
        let case = Case::new("fixture", axis);
        let tip = [4.0, 3.0, 0.0];
        let ball = [tip[0] + 3.0 * axis[0], tip[2] + 3.0 * axis[1]];
        let side = ball[0] - 3.0 - gap;
        case.clamp([side - 5.0, side], ball[1]);
        holds(&case.run(tip), "cutter", "clamp.stl", gap);
        case.beside(tip, 35.0, RADIUS + gap);
        holds(&case.run(tip), "holder", "clamp.stl", gap);
    }
}

/// The rim of the holder over plate and block, the tip beside them; over stock of 4 mm also from its shank.
#[test]
fn holder_and_shank_against_part_and_standing_stock() {
    for (axis, gap) in AXES.into_iter().flat_map(|axis| GAPS.map(|gap| (axis, gap))) {
        let mut case = Case::new("part", axis);
        case.clamp([200.0, 205.0], 0.0);
        let beside = |case: &Case, z: f64| case.tip_under_rim([BOTTOM, RADIUS], z + gap);
        let result = case.run(beside(&case, 0.0));
        holds(&result, "holder", "part", gap);
        holds(&result, "holder", "standing stock", gap);
        case.allowance = 4.0;
        let result = case.run(beside(&case, 4.0));
        holds(&result, "holder", "standing stock", gap);
        case.holder = SHANK;
        holds(&case.run(beside(&case, 4.0)), "holder", "standing stock", gap);
        // A clamp beside the shank, in the middle of its length.
        let tip = beside(&case, 20.0);
        case.beside(tip, 13.0, 2.5 + gap);
        holds(&case.run(tip), "holder", "clamp.stl", gap);
    }
}

/// The cutter goes down into a block of 8 mm until its shank is over the wall of the cut.
#[test]
fn a_shank_alone_against_standing_stock() {
    for (axis, gap) in AXES.into_iter().flat_map(|axis| GAPS.map(|gap| (axis, gap))) {
        let mut case = Case::new("shank", axis);
        case.clamp([200.0, 205.0], 0.0);
        (case.allowance, case.holder) = (8.0, SHANK_ALONE);
        let result = case.run(case.tip_under_rim([SHANK_BOTTOM, SHANK_RADIUS], 8.0 + gap));
        holds(&result, "holder", "standing stock", gap);
    }
}

/// A rapid move of the cutter into the plate collides with it; feeds are gouges.
#[test]
fn a_cutter_on_rapid_moves_against_the_part() {
    for (axis, gap) in AXES.into_iter().flat_map(|axis| GAPS.map(|gap| (axis, gap))) {
        let mut case = Case::new("rapid", axis);
        case.clamp([200.0, 205.0], 0.0);
        case.rapid = "RAPID\n";
        // The lowest place of the ball.
        let tip = [4.0, 3.0, gap + 3.0 - 3.0 * axis[1]];
        holds(&case.run(tip), "cutter on rapid moves", "part", gap);
    }
}

/// A cutter that lifts out of what a feed has cut by the gouge tolerance touches it; any other rapid move that
/// is as deep in the part collides with it.
#[test]
fn rapid_moves_may_lift_a_cutter_out_of_its_cut_and_no_more() {
    let home = Home::new("lifts");
    home.solid("box.stl", [0.0, 0.0, -10.0], [8.0, 6.0, 10.0]);
    let run = |moves: &[(&str, [f64; 3])]| {
        let moves: String =
            moves.iter().map(|(kind, [x, y, z])| format!("{kind}\nGOTO/{x},{y},{z}\n")).collect();
        home.write("path.cls", &format!("UNITS/MM\nSPINDL/8000,CLW\n{moves}FINI\n"));
        home.opened(
            "[part]\nfile = \"box.stl\"\n[cutter]\nshape = \"ball\"\ndiameter = 6\n[[toolpath]]\n\
             strategy = \"program\"\nfile = \"path.cls\"\n",
        )
    };
    let (rapid, feed) = ("RAPID", "FEDRAT/800,MMPM");
    let above = (rapid, [20.0, 3.0, 60.0]);
    // 3 µm in the wall at x = 8, whose top is 10 mm up.
    let beside = |kind, z: f64| (kind, [10.997, 3.0, z]);
    let (lifting, others) = ("cutter lifting at rapid rate", "cutter on rapid moves");
    for moves in [
        [above, (rapid, [20.0, 3.0, 0.0]), beside(feed, 0.0), beside(rapid, 30.0), above],
        [above, (rapid, [20.0, 3.0, 0.0]), beside(feed, 0.0), beside(rapid, 4.0), beside(rapid, 30.0)],
    ] {
        let result = run(&moves);
        let found = of_pair(&result, lifting, "part");
        assert_eq!(found.verdict(), Verdict::Pass, "{found:?}");
        assert!((found.measured.unwrap() - 0.003).abs() <= found.error_bound, "{found:?}");
        let found = of_pair(&result, others, "part");
        assert!(found.verdict() == Verdict::Pass && found.measured.unwrap() < -0.9, "{found:?}");
    }
    // Past the wall, down along it, and out of it aslant.
    for moves in [
        [
            above,
            (rapid, [10.997, -20.0, 0.0]),
            (rapid, [10.997, 30.0, 0.0]),
            (rapid, [20.0, 30.0, 0.0]),
            above,
        ],
        [above, beside(rapid, 30.0), beside(rapid, 0.0), beside(feed, -1.0), (feed, [20.0, 3.0, 0.0])],
        [above, beside(feed, 0.0), (rapid, [10.997, 4.0, 4.0]), (rapid, [20.0, 3.0, 4.0]), above],
    ] {
        let result = run(&moves);
        let found = of_pair(&result, others, "part");
        assert_eq!(found.verdict(), Verdict::Fail, "{found:?}");
        assert!(found.measured.unwrap() > 0.002, "{found:?}");
    }
}

/// A lip over a wall, 3 µm in the way of a lift that touches nothing where it begins, while the shank stood
/// beside the lip.
#[test]
fn what_the_end_of_a_cutter_meets_on_a_lift_collides() {
    let home = Home::new("lip");
    home.solid("lip.stl", [0.0, 0.0, 8.0], [8.0, 6.0, 12.0]);
    let (rapid, feed) = ("RAPID", "FEDRAT/800,MMPM");
    let program = [(rapid, 60.0), (feed, 0.0), (rapid, 60.0)];
    let moves = program.map(|(kind, z)| format!("{kind}\nGOTO/10.997,3,{z}\n")).concat();
    home.write("path.cls", &format!("UNITS/MM\nSPINDL/8000,CLW\n{moves}FINI\n"));
    let result = home.opened(
        "[part]\nfile = \"lip.stl\"\n[cutter]\nshape = \"ball\"\ndiameter = 6\n[[toolpath]]\n\
         strategy = \"program\"\nfile = \"path.cls\"\n",
    );
    let found = of_pair(&result, "cutter on rapid moves", "part");
    assert_eq!(found.verdict(), Verdict::Fail, "{found:?}");
}
