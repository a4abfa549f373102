//! Tables, noses and rams planted at distances that have closed forms.

use super::super::tests::{Home, PLATE, ZIGZAG, claim};
use report::{Claim, ToolpathResult, Verdict};

/// The part's zero in machine coordinates.
const ZERO: [f64; 3] = [200.0, 150.0, -300.0];

fn list(place: [f64; 3]) -> String {
    format!("[{}, {}, {}]", place[0], place[1], place[2])
}

/// A place of the part's frame in machine coordinates, the table at zero.
fn on_machine(place: [f64; 3]) -> String {
    list([0, 1, 2].map(|k| place[k] + ZERO[k]))
}

fn block(name: &str, on: &str, from: &str, to: &str) -> String {
    format!("[[machine.body]]\nname = \"{name}\"\non = \"{on}\"\nshape = \"box\"\nfrom = {from}\nto = {to}\n")
}

fn cylinder(name: &str, on: &str, diameter: f64, from: &str, to: &str) -> String {
    format!(
        "[[machine.body]]\nname = \"{name}\"\non = \"{on}\"\nshape = \"cylinder\"\ndiameter = {diameter}\nfrom = {from}\nto = {to}\n"
    )
}

fn of_pair<'a>(result: &'a ToolpathResult, tool: &str, other: &str) -> &'a Claim {
    let named = |text: &str| {
        let text = text.to_lowercase();
        text.contains(tool) && text.contains(other) && text.find(tool) < text.find(other)
    };
    let found = result.claims.iter().find(|claim| claim.what == "collision" && named(&claim.text));
    found.unwrap_or_else(|| panic!("{tool} to {other}: {:#?}", result.claims))
}

/// That a pair is as near as its closed form says, and judged by it.
fn is_near(result: &ToolpathResult, tool: &str, other: &str, expected: f64) {
    let found = of_pair(result, tool, other);
    let clearance = -found.measured.unwrap();
    let verdict = if expected > 0.0 { Verdict::Pass } else { Verdict::Fail };
    assert_eq!(found.verdict(), verdict, "{found:?}");
    assert!(found.error_bound < 0.02, "{found:?}");
    // Passes lie within the chord tolerance of their place; depths are at least so deep.
    let slack = found.error_bound + 1e-3 + if expected < 0.0 { -0.3 * expected } else { 0.0 };
    assert!((clearance - expected).abs() <= slack, "{tool} to {other}: {clearance} {expected} {found:?}");
}

/// Upright: the tip runs on the plate, so that the nose stands over it by the gauge length, and the tip over
/// the table by what lies between plate and table.
#[test]
fn a_table_and_a_nose_on_three_axes() {
    let home = Home::new("three");
    let scene = |gauge: f64, below: f64| {
        let table =
            block("table", "frame", &on_machine([-90.0, -90.0, -50.0]), &on_machine([90.0, 90.0, -below]));
        let nose = cylinder("spindle nose", "Z", 40.0, "[0, 0, 0]", "[0, 0, 70]");
        format!(
            "{PLATE}{ZIGZAG}[machine]\ngauge_length = {gauge}\nworkpiece_zero = {}\n{table}{nose}",
            list(ZERO)
        )
    };
    let result = home.run(&scene(0.05, 0.05));
    is_near(&result, "spindle nose", "part", 0.05);
    is_near(&result, "cutter", "table", 0.05);
    is_near(&result, "spindle nose", "table", 0.1);
    let result = home.run(&scene(60.0, 12.5));
    is_near(&result, "spindle nose", "part", 60.0);
    is_near(&result, "spindle nose", "table", 72.5);
    let result = home.run(&scene(-0.0, -0.05));
    assert_eq!(of_pair(&result, "cutter", "table").verdict(), Verdict::Fail);
    assert_eq!(result.verdict, Verdict::Fail);
}

/// A box beside the spindle passes a post that stands taller than the spindle's end.
#[test]
fn a_head_beside_the_spindle_and_a_post() {
    let home = Home::new("post");
    let plain = home.outcome(&format!("{PLATE}{ZIGZAG}")).path;
    let reached = plain.moves.iter().map(|m| m.to.tip.x).fold(0.0, f64::max);
    for gap in [0.05, -0.05] {
        home.solid("post.stl", [reached + 60.0 + gap, -5.0, -2.0], [reached + 64.0, 15.0, 200.0]);
        let head = block("motor", "Z", "[-20, -30, 5]", "[60, 30, 90]");
        let text = format!(
            "{PLATE}{ZIGZAG}[[fixture]]\nfile = \"post.stl\"\n[machine]\ngauge_length = 80\nworkpiece_zero = {}\n{head}",
            list(ZERO)
        );
        let result = home.run(&text);
        is_near(&result, "motor", "post.stl", gap);
        let figure = result.figures.iter().find(|figure| figure.key == "clearance").unwrap();
        let pairs = figure.value["pairs"].as_array().unwrap();
        let pair = pairs.iter().find(|pair| pair["tool"] == "motor" && pair["other"] == "post.stl").unwrap();
        assert!(pair["line"].as_u64().is_some_and(|line| line > 5), "{pair}");
        assert!((pair["at_mm"][0].as_f64().unwrap() - reached - 60.0 - gap).abs() < 0.06, "{pair}");
    }
}

/// How far the tool leans, rad, along x or y.
const LEAN: f64 = 0.35;

/// A machine with rotary axes; a ball that leans all along the plate.
fn leaning(axis: [f64; 3], machine: &str) -> String {
    format!(
        "{PLATE}[tolerance]\nscallop = 0.05\n[simulation]\nremoval = false\n{ZIGZAG}axis = {{ fixed = {} }}\n[machine.kinematics]\n\
         post = \"full\"\nz = [-800, 600]\nworkpiece_zero = {}\n{machine}",
        list(axis),
        list(ZERO)
    )
}

/// The tip of a ball that touches the plate z = 0.
fn tip() -> f64 {
    3.0 - 3.0 * LEAN.cos()
}

/// The nose leans over the table of a trunnion: its rim comes nearest, a gauge length up and half its
/// diameter across.
#[test]
fn a_nose_over_a_table_that_turns() {
    let home = Home::new("trunnion");
    let (gauge, diameter) = (90.0, 120.0);
    let over = |below: f64| tip() + below + gauge * LEAN.cos() - 0.5 * diameter * LEAN.sin();
    for gap in [0.05, -0.05] {
        let below = gap - over(0.0);
        // The trunnion's axis and the table's run beside the part.
        let machine = format!(
            "preset = \"ac-table\"\ngauge_length = {gauge}\nfirst = {{ point = {} }}\nsecond = {{ point = {} }}\n{}{}",
            on_machine([40.0, -30.0, 0.0]),
            on_machine([40.0, -30.0, -60.0]),
            block(
                "table",
                "C",
                &on_machine([-400.0, -400.0, -below - 20.0]),
                &on_machine([400.0, 400.0, -below])
            ),
            cylinder("nose", "Z", diameter, "[0, 0, 0]", "[0, 0, 60]"),
        );
        let result = home.run(&leaning([0.0, LEAN.sin(), LEAN.cos()], &machine));
        is_near(&result, "nose", "table", gap);
        // The plate does not reach under the rim.
        assert!(-of_pair(&result, "nose", "part").measured.unwrap() > over(0.0));
    }
}

/// A ram that the head's axes do not turn hangs over the part: the pivot stands as far over the tip as the
/// tool leans.
#[test]
fn a_ram_over_a_part_and_a_head_that_turns() {
    let home = Home::new("ram");
    let (gauge, pivot) = (70.0, 110.0);
    let of_pivot = tip() + (gauge + pivot) * LEAN.cos();
    for gap in [0.05, -0.05] {
        // The ram's lower end, from the nose with the head at zero.
        let low = pivot - of_pivot + gap;
        let machine = format!(
            "preset = \"bc-head\"\ngauge_length = {gauge}\nsecond = {{ point = [0, 0, {pivot}] }}\n{}{}{}",
            block("table", "frame", &on_machine([-400.0, -400.0, -50.0]), &on_machine([400.0, 400.0, -30.0])),
            block("ram", "Z", &list([-300.0, -300.0, low]), &list([300.0, 300.0, low + 100.0])),
            cylinder("motor", "B", 30.0, &list([0.0, 0.0, 20.0]), &list([0.0, 0.0, 90.0])),
        );
        let result = home.run(&leaning([LEAN.sin(), 0.0, LEAN.cos()], &machine));
        is_near(&result, "ram", "part", gap);
        is_near(&result, "ram", "table", gap + 30.0);
        is_near(&result, "motor", "table", 30.0 + tip() + (gauge + 20.0) * LEAN.cos() - 15.0 * LEAN.sin());
        is_near(&result, "cutter", "table", 30.0);
    }
    assert!(
        claim(
            &home.run(&leaning([LEAN.sin(), 0.0, LEAN.cos()], "preset = \"bc-head\"\ngauge_length = 70\n")),
            "approach"
        )
        .verdict()
            == Verdict::Pass
    );
}

/// A program rises to the upper end of Z's travel: over a fixture by what is left of it, whether the path
/// comes near it or not.
#[test]
fn programs_rise_over_the_fixtures_or_violate() {
    let home = Home::new("rise");
    home.solid("post.stl", [60.0, 60.0, -2.0], [64.0, 64.0, 40.0]);
    for (spare, verdict) in [(0.05, Verdict::Pass), (-0.05, Verdict::Fail)] {
        // The nose has to stand at −300 + 40 + 70.
        let machine = "preset = \"ac-table\"\ngauge_length = 70\n[[fixture]]\nfile = \"post.stl\"\n";
        let text = leaning([0.0, 0.0, 1.0], machine).replace("600]", &format!("{}]", -190.0 + spare));
        let result = home.run(&text);
        let retract = result.claims.iter().find(|claim| claim.what == "retract").unwrap();
        assert_eq!(retract.verdict(), verdict, "{retract:?}");
        assert!((retract.measured.unwrap() + spare).abs() < 1e-9, "{retract:?}");
    }
}

/// Over the block that the plate is cut from: the nose of three axes as far as the gauge length is longer
/// than the block stands over the plate, a motor beside the spindle over what no pass comes to.
#[test]
fn bodies_keep_off_the_stock() {
    let home = Home::new("stock");
    let run = |gauge: f64, low: f64| {
        let nose = cylinder("nose", "Z", 40.0, "[0, 0, 0]", "[0, 0, 70]");
        let motor = block("motor", "Z", &list([20.0, -30.0, low]), &list([60.0, 30.0, low + 90.0]));
        home.run(&format!(
            "{PLATE}[stock]\nallowance = 4\n{ZIGZAG}[machine]\ngauge_length = {gauge}\nworkpiece_zero = {}\n{nose}{motor}",
            list(ZERO)
        ))
    };
    for gap in [0.05, -0.05] {
        let result = run(4.0 + gap, 100.0);
        is_near(&result, "nose", "standing stock", gap);
    }
    // Beside the plate, and 26 mm under the spindle's end.
    for gap in [0.05, -0.05] {
        let motor = block("motor", "Z", &list([20.0, -30.0, gap - 26.0]), "[60, 30, 90]");
        let result = home.run(&format!(
            "{PLATE}[stock]\ncorners = [[-40, -40, -5], [48, 46, 4]]\n{ZIGZAG}[machine]\ngauge_length = 30\nworkpiece_zero = {}\n{motor}",
            list(ZERO)
        ));
        is_near(&result, "motor", "standing stock", gap);
    }
}

/// A pin above the cutter that would stand in the block if the cutter had not been there: nothing is proven,
/// and nothing passes.
#[test]
fn what_may_have_been_cut_is_open() {
    let home = Home::new("cut-before");
    let pin = cylinder("pin", "Z", 2.0, "[0, 0, -1]", "[0, 0, 9]");
    let result = home.run(&format!(
        "{PLATE}[stock]\nallowance = 4\n{ZIGZAG}[machine]\ngauge_length = 4\nworkpiece_zero = {}\n{pin}",
        list(ZERO)
    ));
    assert_eq!(of_pair(&result, "pin", "standing stock").verdict(), Verdict::Undecided);
}

/// The program of a planned path, read as one from elsewhere in both styles: bodies come as near to each
/// other.
#[test]
fn programs_from_elsewhere_move_the_bodies() {
    let home = Home::new("foreign");
    for style in ["tcp", "full"] {
        let machine = format!(
            "preset = \"ac-table\"\ngauge_length = 90\nfirst = {{ point = {} }}\nsecond = {{ point = {} }}\n{}{}",
            on_machine([40.0, -30.0, 0.0]),
            on_machine([40.0, -30.0, -60.0]),
            block("table", "C", &on_machine([-400.0, -400.0, -80.0]), &on_machine([400.0, 400.0, -60.0])),
            cylinder("nose", "Z", 120.0, "[0, 0, 0]", "[0, 0, 60]"),
        );
        let text = leaning([0.0, LEAN.sin(), LEAN.cos()], &machine)
            .replace("post = \"full\"", &format!("post = \"{style}\""));
        let (session, outcome) = home.planned(&text);
        let mut program = Vec::new();
        session.write_program(&mut program, &outcome).unwrap();
        home.write("elsewhere.nc", &String::from_utf8(program).unwrap());
        let axis = format!("axis = {{ fixed = {} }}\n", list([0.0, LEAN.sin(), LEAN.cos()]));
        let foreign = text
            .replace(ZIGZAG, "[[toolpath]]\nstrategy = \"program\"\nfile = \"elsewhere.nc\"\n")
            .replace(&axis, "");
        let result = home.opened(&foreign);
        for (tool, other) in
            [("nose", "table"), ("nose", "part"), ("cutter", "table"), ("nose", "standing stock")]
        {
            let planned = -of_pair(&outcome.result, tool, other).measured.unwrap();
            let found = of_pair(&result, tool, other);
            let clearance = -found.measured.unwrap();
            // Both stray by what the bodies' motion is divided by, and words are rounded.
            assert!((clearance - planned).abs() < 0.02, "{style}, {tool} to {other}: {clearance} {planned}");
            assert_eq!(found.verdict(), Verdict::Pass, "{found:?}");
        }
    }
}

/// The nose over a post beside the plate: as far as each tool is longer than the post is high.
#[test]
fn each_tool_of_a_program_has_its_own_length() {
    let home = Home::new("lengths");
    home.write(
        "job.nc",
        "G21 G90 G17 G94\nT1 M6\nG43 H1\nS1000 M3\nG0 X0 Y0 Z10\nG1 Z0 F500\nX8\nG0 Z10\nT2 M6\nG43 H2\nG0 X0 Y3\nG1 Z0\nX8\n\
         G0 Z10\nM30\n",
    );
    let run = |post: f64, length: &str| {
        home.solid("post.stl", [15.0, 2.0, -2.0], [19.0, 4.0, post]);
        let tool = |number: u32, more: &str| {
            format!("[[tool]]\nnumber = {number}\nshape = \"ball\"\ndiameter = 6\n{more}\n")
        };
        home.write("tools.toml", &(tool(1, "gauge_length = 60") + &tool(2, length)));
        let nose = cylinder("nose", "Z", 40.0, "[0, 0, 0]", "[0, 0, 70]");
        home.opened(&format!(
            "{PLATE}[[fixture]]\nfile = \"post.stl\"\n[[toolpath]]\nstrategy = \"program\"\nfile = \"job.nc\"\ntool = \"all\"\n\
             tools = \"tools.toml\"\n[machine]\ngauge_length = 60\nworkpiece_zero = {}\n{nose}",
            list(ZERO)
        ))
    };
    let of_nose = |result: &ToolpathResult, tool: &str| {
        let named = |claim: &&Claim| claim.text.to_lowercase().contains("nose") && claim.text.contains(tool);
        let found = result.claims.iter().filter(named).find(|claim| claim.text.contains("post.stl"));
        found.unwrap_or_else(|| panic!("{tool}: {:#?}", result.claims)).clone()
    };
    for gap in [0.05, -0.05] {
        let result = run(30.0 - gap, "gauge_length = 30");
        for (tool, expected) in [("tool 1", 30.0 + gap), ("tool 2", gap)] {
            let found = of_nose(&result, tool);
            let verdict = if expected > 0.0 { Verdict::Pass } else { Verdict::Fail };
            assert_eq!(found.verdict(), verdict, "{found:?}");
            let off = (found.measured.unwrap() + expected).abs();
            assert!(off <= found.error_bound + 1e-6 && found.error_bound < 0.02, "{found:?}");
        }
    }
    // Without its length nothing is known of the second tool, and of the first as before.
    let result = run(29.95, "");
    assert_eq!(of_nose(&result, "tool 1").verdict(), Verdict::Pass);
    let unknown = result.claims.iter().find(|claim| claim.text.contains("not checked")).unwrap();
    assert_eq!(unknown.verdict(), Verdict::Undecided, "{unknown:?}");
    assert!(unknown.text.contains("with tool 2") && unknown.text.contains("`gauge_length`"), "{unknown:?}");
}

/// The same in a head with rotary axes, whose key is the length of no tool that the table knows.
#[test]
fn a_head_carries_each_tool_by_its_own_length() {
    let home = Home::new("head-lengths");
    home.write(
        "job.nc",
        "G21 G90 G17 G94\nT1 M6\nS1000 M3\nG0 B0 C0\nG43.4 H1\nG0 X0 Y3 Z10\nG1 Z0 F500\nX8\nG0 Z10\nM30\n",
    );
    home.write("tools.toml", "[[tool]]\nnumber = 1\nshape = \"ball\"\ndiameter = 6\ngauge_length = 30\n");
    let nose = cylinder("nose", "B", 40.0, "[0, 0, 0]", "[0, 0, 70]");
    for (gap, gauge) in [(0.05, 30.0), (0.05, 90.0), (-0.05, 90.0)] {
        home.solid("post.stl", [15.0, 2.0, -2.0], [19.0, 4.0, 30.0 - gap]);
        let result = home.opened(&format!(
            "{PLATE}[[fixture]]\nfile = \"post.stl\"\n[[toolpath]]\nstrategy = \"program\"\nfile = \"job.nc\"\n\
             tools = \"tools.toml\"\n[machine.kinematics]\npreset = \"bc-head\"\ngauge_length = {gauge}\n\
             workpiece_zero = {}\n{nose}",
            list(ZERO)
        ));
        is_near(&result, "nose", "post.stl", gap);
    }
}
