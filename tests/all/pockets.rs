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

/// The program with arcs, read back, stays as near to the moves, which the locations in APT are, as it was
/// asked to.
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

/// With `judge = "all"` a neck and corners that no cutter reaches fail with their whole height, and all of the
/// surface is judged; a hole as round as the drawing's chords passes. By default both pass, for the share of
/// the surface that the cutter reaches.
#[test]
fn what_no_cutter_reaches_fails_where_all_is_judged() {
    let home = tempfile::tempdir().unwrap();
    let neck = "[[0, 0], [20, 0], [20, 10], [40, 10], [40, 0], [60, 0], [60, 20], [40, 20], [40, 14], [20, 14], [20, 20], [0, 20]]";
    let turn = |k: i32| std::f64::consts::TAU * f64::from(k) / 240.0;
    let round = (0..240).map(|k| [9.0 * turn(k).cos(), 9.0 * turn(k).sin()]).collect::<Vec<_>>();
    let round = format!("{round:?}");
    let text = |outline: &str, judge: &str| {
        format!(
            "[part]\nsurface = \"pocket\"\noutline = {outline}\ndepth = 5\n{judge}[cutter]\nshape = \"flat\"\ndiameter = 6\n\
             [tolerance]\nchord = 0.005\n[[toolpath]]\nstrategy = \"pocket-offset\"\n"
        )
    };
    let all = "judge = \"all\"\n";
    let share = |toolpath: &Value| {
        let area = |key: &str| toolpath["coverage"][key].as_f64().unwrap();
        area("judged_mm2") / area("surface_mm2")
    };
    let (code, toolpath) = judged(home.path(), &text(neck, all));
    let violated = violations(&toolpath);
    let said = "uncut material 5000 ± 0.00 µm high (limit 50.0) at x 2";
    assert!(code == Some(1) && violated.len() == 1 && violated[0].starts_with(said), "{violated:?}");
    assert!((share(&toolpath) - 1.0).abs() < 1e-12);
    let map = fs::read(home.path().join("out/pocket-offset/height.png")).unwrap();
    let size = |at: usize| u32::from_be_bytes(map[at..at + 4].try_into().unwrap());
    assert!(size(16) > 2 * size(20), "{} {}", size(16), size(20));
    let (code, toolpath) = judged(home.path(), &text(neck, ""));
    assert!(code == Some(0) && share(&toolpath) < 0.8, "{}", share(&toolpath));
    let (code, toolpath) = judged(home.path(), &text(&round, all));
    assert_eq!((code, share(&toolpath)), (Some(0), 1.0), "{:?}", violations(&toolpath));
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

/// In a neck as wide as the cutter the engagement is exceeded: the toolpath fails, and the stretches are
/// listed. They lie where the neck is, make up the share that is reported, and hold the greatest angle; the
/// program has their lines.
#[test]
fn stretches_above_the_engagement_are_listed() {
    let home = tempfile::tempdir().unwrap();
    let neck = "[part]\nsurface = \"pocket\"\noutline = [[0, 0], [14, 0], [14, 4.49], [24, 4.49], [24, 0], [38, 0], [38, 14], [24, 14], \
                [24, 9.51], [14, 9.51], [14, 14], [0, 14]]\ndepth = 1.5\n[cutter]\nshape = \"flat\"\ndiameter = 5\n[tolerance]\n\
                chord = 0.005\n[[toolpath]]\nstrategy = \"pocket-offset\"\nengagement = 60\n";
    fs::write(home.path().join("neck.toml"), neck).unwrap();
    let answer = millstream(home.path(), &["run", "neck.toml", "--out", "neck"]);
    assert_eq!(answer.code, Some(1), "{} {}", answer.stdout, answer.stderr);
    let report: Value =
        serde_json::from_slice(&fs::read(home.path().join("neck/report.json")).unwrap()).unwrap();
    let pocket = &report["toolpaths"][0]["pocket"];
    let all = pocket["over_engagement_limit"].as_array().unwrap();
    assert_eq!(pocket["over_engagement_limit_count"], all.len());
    let number = |one: &Value, key: &str| one[key].as_f64().unwrap();
    let lengths: Vec<f64> = all.iter().map(|one| number(one, "length_mm")).collect();
    assert!(lengths.is_sorted_by(|a, b| a >= b));
    let greatest = all.iter().map(|one| number(one, "max_engagement_deg")).fold(0.0, f64::max);
    assert_eq!(greatest, number(pocket, "max_engagement_deg"));
    // The slot is the neck, but for where its mouths are cleared by loops; others are the last of loops
    // before it.
    let longest = &all[0];
    let neck = (13.5..24.5).contains(&number(longest, "x"));
    assert!(neck && (4.0..=10.0).contains(&number(longest, "length_mm")), "{longest}");
    assert!((number(longest, "max_engagement_deg") - 180.0).abs() < 0.5 && number(longest, "z") == -1.5);
    let program = fs::read_to_string(home.path().join("neck/pocket-offset/toolpath.nc")).unwrap();
    let line = program.lines().nth(longest["line"].as_u64().unwrap() as usize - 1).unwrap();
    assert!(line.contains('X') || line.contains('Y'), "{line}");
    // All of them are above it with thinner layers counted, too.
    let thin = &pocket["thin_layers"];
    assert!((number(pocket, "uncounted_layer_mm") - 0.005 * 2.5).abs() < 1e-12);
    assert!((number(thin, "counted_from_mm") - 0.001 * 2.5).abs() < 1e-12);
    assert!(number(thin, "max_engagement_deg") >= greatest);
    assert_eq!(thin["over_engagement_limit"][0]["max_engagement_deg"], thin["max_engagement_deg"]);
    assert!(number(thin, "over_engagement_limit_mm") >= lengths.iter().sum::<f64>());
    let whole = number(pocket, "over_engagement_limit_fraction");
    let moves =
        read_apt("toolpath.cls", &fs::read(home.path().join("neck/pocket-offset/toolpath.cls")).unwrap());
    let moves = path_of(&moves.unwrap());
    let level = |(a, b, m): (Point3, Point3, &millstream::motion::Move)| {
        (m.kind != MoveKind::Rapid && a.z == -1.5 && b.z == -1.5).then(|| (b - a).norm())
    };
    let cut: f64 = moves.segments().filter_map(level).sum();
    // The last turns of helices at depth are no passes.
    let above = lengths.iter().sum::<f64>() / cut;
    assert!(above <= whole && above > 0.8 * whole, "{above} {whole}");
    let page = fs::read_to_string(home.path().join("neck/report.html")).unwrap();
    assert!(page.contains("Stretches above the engagement") && page.contains("greatest with thin chips"));
}

/// Straight walls have no chords: however coarse those of the passes may be, what they cut beyond the walls
/// is known.
#[test]
fn straight_walls_are_judged_with_coarse_chords() {
    let home = tempfile::tempdir().unwrap();
    let slot = "[part]\nsurface = \"pocket\"\noutline = [[0, 0], [40, 0], [40, 30], [25, 30], [25, 12], [15, 12], [15, 30], [0, 30]]\n\
                depth = 2.0\n[cutter]\nshape = \"flat\"\ndiameter = 8\n[tolerance]\nchord = 0.02\n\
                [[toolpath]]\nstrategy = \"pocket-offset\"\n";
    let (toolpath, _) = run(home.path(), "slot", slot);
    let pocket = &toolpath["pocket"];
    let [gouge, bound] =
        ["wall_gouge_mm", "wall_gouge_error_bound_mm"].map(|key| pocket[key].as_f64().unwrap());
    assert!(gouge < 1e-4 && bound < 1e-5, "{gouge} {bound}");
}

/// Inner passes that lie far apart turn more sharply than the cutter reaches around: what they leave gets a
/// pass of its own. Without it 0.005 mm² stand in the first pocket, 1.2 mm² in the second, as high as it is
/// deep.
#[test]
fn what_passes_far_apart_leave_is_cut() {
    let slot = "outline = [[0, 0], [40, 0], [40, 30], [25, 30], [25, 12], [15, 12], [15, 30], [0, 30]]";
    let odd = "outline = [[14.867, 0.44], [-2.138, 21.489], [-7.655, 17.37], [-14.748, 9.241], [-6.535, -15.613], [0.932, -20.089], \
               [13.233, -17.591], [10.144, -10.657]]\nislands = [[[-1.066, 7.458], [2.022, 2.404], [2.21, 2.688]]]";
    let of = |outline: &str, diameter: f64, rest: &str| {
        format!(
            "[part]\nsurface = \"pocket\"\n{outline}\ndepth = 1.7\n[cutter]\nshape = \"flat\"\ndiameter = {diameter}\n\
             [tolerance]\nchord = 0.002\n[[toolpath]]\n{rest}\n"
        )
    };
    let home = tempfile::tempdir().unwrap();
    let slot = of(slot, 8.0, "strategy = \"pocket-flow\"\nspiral = true\nstepover = 5.6");
    let odd = of(odd, 6.0, "strategy = \"pocket-offset\"\nwall_allowance = 0.1\nstepover = 4.2");
    for (name, text) in [("slot", slot), ("odd", odd)] {
        let (toolpath, _) = run(home.path(), name, &text);
        assert_eq!(toolpath["uncut"]["area_mm2"], 0.0, "{name}");
    }
}

/// Runs a scene; its exit status and its report's first toolpath.
fn judged(home: &Path, text: &str) -> (Option<i32>, Value) {
    fs::write(home.join("scene.toml"), text).unwrap();
    let answer = millstream(home, &["run", "scene.toml", "--out", "out"]);
    let report = fs::read(home.join("out/report.json"));
    let report: Value =
        serde_json::from_slice(&report.unwrap_or_else(|_| panic!("{}", answer.stderr))).unwrap();
    (answer.code, report["toolpaths"][0].clone())
}

/// The texts of the limits that are violated.
fn violations(toolpath: &Value) -> Vec<String> {
    let all = toolpath["violations"].as_array().unwrap().iter();
    all.map(|one| one["text"].as_str().unwrap().to_owned()).collect()
}

/// A program of another system in a square pocket of 20 mm: passes along the walls, `corner` by `far` mm, and
/// between them.
fn program_of(corner: f64, far: f64) -> String {
    let end = 20.0 - corner;
    format!(
        "G17 G21 G40 G90 G94\nT1 M6\nS8000 M3\nG0 X{corner} Y{corner}\nG0 Z5\nG0 Z1\nG1 Z-2 F200\nG1 X{far} F800\nG1 Y{end}\n\
         G1 X{corner}\nG1 Y{corner}\nG1 X8\nG1 Y{end}\nG1 X12\nG1 Y{corner}\nG1 X10\nG1 Y16\nG0 Z5\nM30\n"
    )
}

/// Walls and islands are judged under a program from elsewhere as under ours: what is cut beyond them, and
/// what is left on them.
#[test]
fn programs_are_held_against_walls_and_islands() {
    let home = tempfile::tempdir().unwrap();
    let scene = |islands: &str| {
        format!(
            "[part]\nsurface = \"pocket\"\noutline = [[0, 0], [20, 0], [20, 20], [0, 20]]\n{islands}depth = 2\n[cutter]\nshape = \"flat\"\n\
             diameter = 7\n[tolerance]\nchord = 0.3\n[[toolpath]]\nstrategy = \"program\"\nfile = \"cut.nc\"\n"
        )
    };
    let of = |program: String, islands: &str| {
        fs::write(home.path().join("cut.nc"), program).unwrap();
        judged(home.path(), &scene(islands))
    };
    let (code, good) = of(program_of(3.5, 16.5), "");
    assert_eq!((code, violations(&good)), (Some(0), Vec::new()));
    let (code, beyond) = of(program_of(3.5, 17.5), "");
    let depth = beyond["pocket"]["wall_gouge_mm"].as_f64().unwrap();
    assert!(code == Some(1) && (depth - 1.0).abs() < 1e-9, "{depth}");
    assert!(
        violations(&beyond)[0].contains("beyond the outline")
            && violations(&beyond)[0].contains("cut.nc line 8")
    );
    let (code, left) = of(program_of(3.5, 16.1), "");
    let thickness = left["pocket"]["wall_uncut_mm"].as_f64().unwrap();
    // Up to half a micrometre more counts as reached beside corners.
    assert!(code == Some(1) && (0.4..0.4006).contains(&thickness), "{thickness}");
    assert!(violations(&left)[0].contains("on the walls"), "{:?}", violations(&left));
    // A wall that no pass comes near.
    let (code, far) = of(program_of(3.5, 12.0), "");
    let bound = far["pocket"].get("wall_uncut_error_bound_mm");
    assert!(code == Some(1) && bound.is_none(), "{bound:?}");
    assert!(
        violations(&far).iter().any(|text| text.contains("or more µm thick on the walls")),
        "{:?}",
        violations(&far)
    );
    // The passes between those along the walls go through an island.
    let (code, island) = of(program_of(3.5, 16.5), "islands = [[[9, 9], [11, 9], [11, 11], [9, 11]]]\n");
    assert!(code == Some(1) && island["pocket"]["wall_gouge_mm"].as_f64().unwrap() > 4.0, "{island}");
}

/// A program comes from beside the block, over an open side, with a cutter that is small beside the margin of
/// the stock. Nothing stands there.
#[test]
fn programs_come_in_over_open_sides() {
    let home = tempfile::tempdir().unwrap();
    let passes = |open: &str| {
        let rows =
            (0..13).map(|k| format!("G1 Y{y}\nG1 X9\nG1 X-4\n", y = 1.0 + 0.6667 * f64::from(k).min(12.0)));
        let around = "G1 Y9\nG1 X9\nG1 Y1\nG1 X-4\nG0 Z5\nM30\n";
        let cut = "G17 G21 G40 G90 G94\nT1 M6\nS8000 M3\nG0 X-9 Y1\nG0 Z-1\nG1 X-4 F800\n".to_owned();
        fs::write(home.path().join("cut.nc"), cut + &rows.collect::<String>() + around).unwrap();
        judged(
            home.path(),
            &format!(
                "[part]\nsurface = \"pocket\"\noutline = [[0, 0], [10, 0], [10, 10], [0, 10]]\n{open}depth = 1\n[cutter]\nshape = \"flat\"\n\
                 diameter = 2\n[stock]\nmargin = 3\n[[toolpath]]\nstrategy = \"program\"\nfile = \"cut.nc\"\n"
            ),
        )
    };
    let (code, open) = passes("open = [[[0, 0], [0, 10]]]\n");
    assert_eq!((code, violations(&open)), (Some(0), Vec::new()));
    let (code, closed) = passes("");
    let depth = closed["pocket"]["wall_gouge_mm"].as_f64().unwrap();
    assert!(code == Some(1) && depth > 2.0, "{depth}");
}

/// Coarse chords along a round wall leave as much on it, which is held against `uncut`.
#[test]
fn material_left_on_round_walls_is_judged() {
    let home = tempfile::tempdir().unwrap();
    let circle = (0..720).map(|k| std::f64::consts::TAU * f64::from(k) / 720.0);
    let circle: Vec<String> =
        circle.map(|t| format!("[{:.6}, {:.6}]", 15.0 * t.cos(), 15.0 * t.sin())).collect();
    let of = |uncut: f64| {
        judged(
            home.path(),
            &format!(
                "[part]\nsurface = \"pocket\"\noutline = [{}]\ndepth = 2\n[cutter]\nshape = \"flat\"\ndiameter = 6\n[tolerance]\n\
                 chord = 0.3\nuncut = {uncut}\n[[toolpath]]\nstrategy = \"pocket-zigzag\"\n",
                circle.join(", ")
            ),
        )
    };
    let (code, coarse) = of(0.05);
    let [thickness, bound] =
        ["wall_uncut_mm", "wall_uncut_error_bound_mm"].map(|key| coarse["pocket"][key].as_f64().unwrap());
    // Half of the chord tolerance is for the chords of passes.
    assert!(code == Some(1) && thickness > 0.1 && thickness < 0.16 && bound < 1e-3, "{thickness} {bound}");
    assert!(
        violations(&coarse).iter().any(|text| text.contains("on the walls")),
        "{:?}",
        violations(&coarse)
    );
    assert_eq!(of(0.2).0, Some(0));
}

/// Where the way down leads through ground that is cleared, or beyond an open side, it may be as steep as it
/// likes.
#[test]
fn ways_down_through_air_may_be_steep() {
    let home = tempfile::tempdir().unwrap();
    let scene = |part: &str, stock: &str, strategy: &str| {
        format!(
            "[part]\nsurface = \"pocket\"\noutline = [[0, 0], [40, 0], [40, 30], [0, 30]]\n{part}depth = 4\n[cutter]\nshape = \"flat\"\n\
             diameter = 6\n[tolerance]\nchord = 0.005\n{stock}[[toolpath]]\nstrategy = \"pocket-offset\"\n{strategy}"
        )
    };
    let (code, cleared) = judged(home.path(), &scene("", "", "helix_radius = 6\nengagement = 60\n"));
    assert!(!violations(&cleared).iter().any(|text| text.contains("way down")), "{:?}", violations(&cleared));
    assert_eq!(code, Some(0), "{:?}", violations(&cleared));
    // Steps are counted from the top of the stock.
    let allowed = scene("", "[stock]\nallowance = 1\n", "stepdown = 2.5\n");
    let (code, stepped) = judged(home.path(), &allowed);
    assert_eq!((code, violations(&stepped)), (Some(0), Vec::new()));
}

/// Chords of a drawn curve cut its inside, and beside an island of a drawing the cutter comes so much nearer:
/// the bound holds it, the table tells it, and it stays far below the limit.
#[test]
fn what_chords_of_drawings_are_off_is_in_the_bounds() {
    let home = tempfile::tempdir().unwrap();
    let svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"60mm\" height=\"60mm\" viewBox=\"0 0 60 60\">\
               <rect x=\"5\" y=\"5\" width=\"50\" height=\"50\"/><circle cx=\"30\" cy=\"30\" r=\"18\"/></svg>";
    fs::write(home.path().join("island.svg"), svg).unwrap();
    let text = "[part]\nsurface = \"pocket\"\nfile = \"island.svg\"\ndepth = 2\n[cutter]\nshape = \"flat\"\ndiameter = 4\n[tolerance]\n\
                chord = 0.005\ngouge = 0.005\n[[toolpath]]\nstrategy = \"pocket-offset\"\n";
    let (toolpath, files) = run(home.path(), "island", text);
    let program = fs::read(files.join("toolpath.nc")).unwrap();
    let path = path_of(&read_gcode("toolpath.nc", &program, GENERAL_CONTROL, &Setup::default()).unwrap());
    let centre = Point3::new(30.0, 30.0, -2.0);
    let fed = path.segments().filter(|(_, _, m)| m.kind == MoveKind::Cut);
    let away = |(a, b): (Point3, Point3)| {
        let (along, from) = ((b - a).xy(), (centre - a).xy());
        let share = if along.norm() > 0.0 { from.dot(&along) / along.norm_squared() } else { 0.0 };
        (from - along * share.clamp(0.0, 1.0)).norm()
    };
    let nearest = fed.map(|(a, b, _)| away((a, b))).fold(f64::INFINITY, f64::min);
    let cut = 18.0 + 2.0 - nearest;
    let figure = |key: &str| toolpath["pocket"][key].as_f64().unwrap();
    let (depth, bound) = (figure("wall_gouge_mm"), figure("wall_gouge_error_bound_mm"));
    assert!(cut > 1e-4 && cut <= depth + bound, "{cut} {depth} {bound}");
    assert!(bound <= 0.1 * 0.005, "{bound}");
    let answer = millstream(home.path(), &["run", "island.toml", "--out", "again"]);
    let row = answer.stdout.lines().find(|line| line.starts_with("pocket-offset ")).unwrap().to_owned();
    let told = row.split(" ± ").last().and_then(|rest| rest.split(' ').next()).unwrap();
    assert!(told.parse::<f64>().unwrap() >= 1e3 * (cut - depth) - 0.01, "{row}");
}

/// A flat that cuts all of the floor but goes round one place leaves a post there, thinner than a cell. Its
/// height is the depth; a circle through that place leaves nothing.
#[test]
fn a_post_thinner_than_a_cell_is_uncut() {
    let home = tempfile::tempdir().unwrap();
    let program = |around: f64| {
        let mut text =
            String::from("G17 G21 G40 G90 G94\nS8000 M3\nG0 X2 Y2 Z3\nG0 X7.7 Y5.5\nG1 Z-1 F300\n");
        for k in 1..=200 {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / 200.0).sin_cos();
            text += &format!("G1 X{:.4} Y{:.4} F500\n", 5.0567 + around * cos, 5.5089 + around * sin);
        }
        // Beyond the circle.
        text += "G1 X9 Y5.5\nG1 X9 Y8\nG1 X2 Y8\nG1 X2 Y2\nG1 X9 Y2\nG1 X9 Y5.5\nG0 Z3\nM30\n";
        text
    };
    for (around, post) in [(2.003, true), (1.99, false)] {
        fs::write(home.path().join("post.nc"), program(around)).unwrap();
        let text = "[part]\nsurface = \"pocket\"\noutline = [[0, 0], [11, 0], [11, 10], [0, 10]]\ndepth = 1\n[cutter]\n\
                    shape = \"flat\"\ndiameter = 4\n[tolerance]\nchord = 0.002\n[[toolpath]]\nstrategy = \"program\"\n\
                    file = \"post.nc\"\n";
        for cell in ["auto", "0.2"] {
            let text = text.replace(
                "[[toolpath]]",
                &if cell == "auto" {
                    "[[toolpath]]".to_owned()
                } else {
                    format!("[simulation]\ncell = {cell}\n[[toolpath]]")
                },
            );
            let (_, toolpath) = judged(home.path(), &text);
            let excess = &toolpath["excess"];
            let [height, bound] = ["max_mm", "error_bound_mm"].map(|key| excess[key].as_f64().unwrap());
            let expected = if post { 1.0 } else { 0.0 };
            assert!((height - expected).abs() <= bound && bound < 1e-5, "{cell} {around}: {excess}");
            assert_eq!(violations(&toolpath).iter().any(|text| text.contains("uncut")), post, "{toolpath:#}");
        }
    }
}

/// The highest ridge of a ball on a pocket's floor is told within its bound on cells of any size, as the
/// moves themselves leave it.
#[test]
fn ridges_in_pockets_do_not_depend_on_cells() {
    let home = tempfile::tempdir().unwrap();
    let mut figures = Vec::new();
    for cell in ["0.02", "0.07", "0.2"] {
        let text = format!(
            "[part]\nsurface = \"pocket\"\noutline = [[0, 0], [4.596, 0], [4.426, 3.636], [0.232, 3.609]]\ndepth = 1\n[cutter]\n\
             shape = \"ball\"\ndiameter = 1.5\n[tolerance]\nscallop = 0.07\nuncut = 0.07\n[simulation]\ncell = {cell}\n\
             [[toolpath]]\nstrategy = \"pocket-flow\"\nstepover = 0.67\n"
        );
        let (code, toolpath) = judged(home.path(), &text);
        let excess = &toolpath["excess"];
        let [height, bound] = ["max_mm", "error_bound_mm"].map(|key| excess[key].as_f64().unwrap());
        assert!(bound < 1e-5 && code == Some(1), "{cell}: {toolpath:#}");
        figures.push(height);
    }
    // 0.07793 mm over the moves of the program, by their distance from the place climbed to.
    for height in figures {
        assert!((height - 0.07793).abs() < 2e-5, "{height}");
    }
}
