//! Whatever stands in a file: status 2, a message with place and cure, nothing written, no panic.

use std::fmt::Write as _;
use std::path::Path;

use crate::command::{PLATE, entries, millstream};

/// Stands in a table's scene before the very thing that the message must point at.
const HERE: char = '§';

/// What is said of a scene, as one line: without the frame around it and without line breaks.
fn flat(message: &str) -> String {
    let words = message.split_whitespace().filter(|word| *word != "│");
    words.collect::<Vec<_>>().join(" ")
}

/// Runs and checks `scene.toml` in `home`, which must be refused by both; returns what was said.
fn refused(home: &Path, what: &str) -> String {
    let before = entries(home);
    let answers = ["check", "run"].map(|command| millstream(home, &[command, "scene.toml"]));
    for answer in &answers {
        let said = &answer.stderr;
        assert_eq!((answer.code, answer.stdout.as_str()), (Some(2), ""), "{what}: {said}");
        assert!(!said.contains("panicked") && !said.contains("RUST_BACKTRACE"), "{what}: {said}");
        assert!(!said.contains('\x1b') && said.contains("help: "), "{what}: {said}");
        assert!(said.lines().count() < 25 && said.len() < 4000, "{what}: too much to read: {said}");
        assert_eq!(entries(home), before, "{what}: something was written");
    }
    let [checked, run] = answers;
    assert_eq!(checked.stderr, run.stderr, "{what}");
    checked.stderr
}

/// A refused scene: the message must name `scene.toml` and contain every one of `words`.
fn scene_is_refused(bytes: &[u8], what: &str, words: &[&str]) {
    let home = tempfile::tempdir().unwrap();
    std::fs::write(home.path().join("scene.toml"), bytes).unwrap();
    let said = flat(&refused(home.path(), what));
    for word in words.iter().chain(&["scene.toml"]) {
        assert!(said.contains(word), "{what}: \"{word}\" is not in: {said}");
    }
}

/// The plate with one piece of text changed. The message must point at [`HERE`] in `new`.
fn edit_is_refused(old: &str, new: &str, words: &[&str]) {
    assert!(PLATE.contains(old), "{old}");
    let marked = PLATE.replacen(old, new, 1);
    let before = &marked[..marked.find(HERE).expect("a mark")];
    let line = before.matches('\n').count() + 1;
    let column = before.chars().rev().take_while(|c| *c != '\n').count() + 1;
    let place = format!("scene.toml:{line}:{column}");
    let what = new.replace(HERE, "");
    scene_is_refused(marked.replace(HERE, "").as_bytes(), &what, &[words, &[&place]].concat());
}

/// Bytes without order, the same in every run.
fn noise(count: usize) -> Vec<u8> {
    let mut state = 0x2545_f491_4f6c_dd1d_u64;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 32) as u8
    };
    (0..count).map(|_| next()).collect()
}

#[test]
fn scenes_that_are_no_scenes() {
    let home = tempfile::tempdir().unwrap();
    assert!(refused(home.path(), "missing").contains("scene.toml"));
    std::fs::create_dir(home.path().join("scene.toml")).unwrap();
    assert!(refused(home.path(), "folder").contains("scene.toml"));

    scene_is_refused(b"", "empty", &["[part]", "surface"]);
    scene_is_refused(b"# nothing yet\n", "comment", &["[part]"]);
    scene_is_refused(&noise(4096), "noise", &["UTF-8"]);
    scene_is_refused(b"title = \"caf\xe9\"\n", "latin-1", &["line 1", "UTF-8"]);
    scene_is_refused(&[0; 64], "zeros", &["not valid TOML"]);
    scene_is_refused(&b"#".repeat((1 << 20) + 1), "a megabyte", &["larger than"]);
    // Nothing that a terminal would obey gets through, and no line that floods it.
    scene_is_refused(b"title = \"a\"\n# \x1b[31m\n", "escape", &["scene.toml:2:", "not valid TOML"]);
    scene_is_refused(b"\"\\u001b[31m\" = 1\n", "escaped", &["unknown key"]);
    let long = format!("title = \"{}\"\nx = 1\n", "long ".repeat(1000));
    scene_is_refused(long.as_bytes(), "long line", &["scene.toml:2:1", "unknown key `x`"]);
    scene_is_refused("k".repeat(100_000).as_bytes(), "long key", &["scene.toml:1:"]);
    scene_is_refused(
        format!("{} = 1", "k".repeat(100_000)).as_bytes(),
        "unknown long key",
        &["scene.toml:1:1"],
    );
    // Deep nesting must not exhaust the stack.
    scene_is_refused("[".repeat(100_000).as_bytes(), "deep", &["not valid TOML"]);
    scene_is_refused(format!("a = {}", "[".repeat(50_000)).as_bytes(), "deep list", &["not valid TOML"]);
    scene_is_refused(format!("a{} = 1", ".a".repeat(50_000)).as_bytes(), "deep key", &[]);
    scene_is_refused("a = {b = ".repeat(50_000).as_bytes(), "deep table", &["not valid TOML"]);
}

#[test]
fn values_that_no_scene_may_have() {
    let numbers: &[(&str, &str)] = &[
        ("nan", "in mm (1e-6 to 10000)"),
        ("inf", "in mm (1e-6 to 10000)"),
        ("-inf", "in mm (1e-6 to 10000)"),
        ("1e999", "in mm (1e-6 to 10000)"),
        ("1e12", "in mm (1e-6 to 10000)"),
        ("1e-300", "in mm (1e-6 to 10000)"),
        ("0", "in mm (1e-6 to 10000)"),
        ("-6", "in mm (1e-6 to 10000)"),
        ("\"6\"", "without quotes"),
        ("[6]", "found a list"),
        ("true", "true or false"),
        ("99999999999999999999999", "`diameter`"),
    ];
    for (number, word) in numbers {
        edit_is_refused("diameter = 6", &format!("diameter = §{number}"), &["`diameter`", "[cutter]", word]);
    }
    for bad in ["0", "-0.01", "nan", "inf", "1e9"] {
        edit_is_refused("scallop = 0.0105", &format!("scallop = §{bad}"), &["`scallop`", "[tolerance]"]);
        edit_is_refused("scallop = 0.0105", &format!("gouge = §{bad}"), &["`gouge`", "[tolerance]"]);
        edit_is_refused("scallop = 0.0105", &format!("chord = §{bad}"), &["`chord`", "[tolerance]"]);
        edit_is_refused("cell = 0.1", &format!("cell = §{bad}"), &["`cell`", "[simulation]"]);
        edit_is_refused("stepover = 0.5", &format!("stepover = §{bad}"), &["`stepover`", "[[toolpath]]"]);
    }
    for bad in ["0", "-1", "0.5", "nan", "1e10"] {
        edit_is_refused("cell = 0.1", &format!("memory_mib = §{bad}"), &["`memory_mib`"]);
    }
    edit_is_refused("x = [0, 8]", "x = §[8, 0]", &["`x`", "lesser"]);
    edit_is_refused("x = [0, 8]", "x = §[8, 8]", &["`x`", "lesser"]);
    edit_is_refused("x = [0, 8]", "x = §[0, 4, 8]", &["`x`", "two numbers"]);
    edit_is_refused("x = [0, 8]", "x = §8", &["`x`", "two numbers"]);
    edit_is_refused("x = [0, 8]", "x = [0, §nan]", &["`x`"]);
    edit_is_refused("x = [0, 8]", "x = [0, §1e7]", &["`x`", "1000000"]);
    edit_is_refused("x = [0, 8]", "x = [0, §\"8\"]", &["`x`"]);
    edit_is_refused("stepover = 0.5", "angle = §\"30\"", &["`angle`"]);
    edit_is_refused("\"ball\"\n", "\"ball\"\nfeed_rate = §0\n", &["`feed_rate`"]);
    edit_is_refused("title = \"Plate\"", "title = §3", &["`title`", "a string"]);
    edit_is_refused("title = \"Plate\"", "title = §\"a\\u001b[31mb\"", &["control character"]);
    edit_is_refused("title = \"Plate\"", "title = §\"a\\nb\"", &["line break"]);
    edit_is_refused("title = \"Plate\"", "title = §\"\"", &["`title` is empty"]);
    edit_is_refused(
        "\"ball\"\ndiameter = 6",
        "\"bull\"\ndiameter = 6\n§corner_radius = 4",
        &["corner_radius"],
    );
}

#[test]
fn words_that_no_scene_knows() {
    edit_is_refused("diameter", "§diametr", &["did you mean `diameter`?"]);
    edit_is_refused("[tolerance]", "[§tolerence]", &["did you mean `tolerance`?"]);
    edit_is_refused("stepover", "§step_over", &["did you mean `stepover`?"]);
    edit_is_refused("title", "§zzz", &["unknown key `zzz`", "`title`"]);
    edit_is_refused("diameter = 6", "diameter = 6\n§corner_radius = 1", &["does not apply", "\"ball\""]);
    edit_is_refused("\"zigzag\"", "§\"zigzig\"", &["did you mean `zigzag`?"]);
    edit_is_refused("\"zigzag\"", "§\"stremline\"", &["`streamline`"]);
    edit_is_refused("\"plane\"", "§\"plain\"", &["did you mean `plane`?"]);
    edit_is_refused("\"plane\"", "§\"torus\"", &["`sphere`"]);
    edit_is_refused("\"ball\"", "§\"bal\"", &["did you mean `ball`?"]);
    edit_is_refused("[simulation]\n", "[simulation]\nengine = §\"zmapp\"\n", &["did you mean `zmap`?"]);
    edit_is_refused("[part]\nsurface = \"plane\"\nx = [0, 8]\ny = [0, 6]", "[§part]", &["which part"]);
    edit_is_refused("surface = \"plane\"\nx = [0, 8]\ny = [0, 6]", "file = §\"part.doc\"", &[".stl or .obj"]);
    edit_is_refused("title = \"Plate\"", "title = \"Plate\"\n§title = \"Two\"", &["not valid TOML"]);
    edit_is_refused("title = \"Plate\"", "title = \"Plate§", &["not valid TOML"]);
}

#[test]
fn toolpaths_that_cannot_be() {
    let toolpath = "[[toolpath]]\nstrategy = \"zigzag\"\nstepover = 0.5\n";
    scene_is_refused(PLATE.replace(toolpath, "").as_bytes(), "none", &["no toolpath", "[[toolpath]]"]);
    scene_is_refused(PLATE.replace(toolpath, "toolpath = []\n").as_bytes(), "empty list", &["`toolpath`"]);
    scene_is_refused(
        PLATE.replace("[[toolpath]]", "[toolpath]").as_bytes(),
        "one bracket",
        &["`[[toolpath]]`"],
    );
    scene_is_refused(
        PLATE.replace("stepover = 0.5", "stepover = 0.5\nscallop = 0.01").as_bytes(),
        "both",
        &["`stepover`", "`scallop`"],
    );
    let twice = format!("{PLATE}[[toolpath]]\nname = \"zigzag\"\nstrategy = \"iso-parametric\"\n");
    scene_is_refused(twice.as_bytes(), "same names", &["\"zigzag\"", "name"]);
    // Names that would meet in one folder, or leave the folder of the results.
    for name in ["Zigzag", "../zigzag", "/etc/zigzag", "zigzag/", "con", ".", "..", "\\u0000"] {
        let text = format!("{PLATE}[[toolpath]]\nname = \"{name}\"\nstrategy = \"iso-parametric\"\n");
        let home = tempfile::tempdir().unwrap();
        std::fs::write(home.path().join("scene.toml"), text).unwrap();
        let answer = millstream(home.path(), &["run", "scene.toml", "--cell", "0.5", "--out", "results"]);
        assert!(answer.code != Some(101) && !answer.stderr.contains("panicked"), "{name}: {answer:?}");
        if answer.code == Some(2) {
            assert!(answer.stderr.contains("help: "), "{name}: {answer:?}");
            assert_eq!(entries(home.path()), ["scene.toml"], "{name}");
        } else {
            assert_eq!(entries(home.path()), ["results", "scene.toml"], "{name}");
            assert_eq!(entries(&home.path().join("results")).len(), 5, "{name}");
        }
    }
}

#[test]
fn grids_that_do_not_fit() {
    let home = tempfile::tempdir().unwrap();
    let scene = home.path().join("scene.toml");
    let too_fine = PLATE.replace("cell = 0.1", "cell = 0.00002\nmemory_mib = 16");
    std::fs::write(&scene, &too_fine).unwrap();
    let said = flat(&refused(home.path(), "a cell of 20 nm"));
    assert!(said.contains("scene.toml: the stock cannot be simulated"), "{said}");
    let fitting = said.split("the smallest cell that fits is ").nth(1).expect("the cell that fits");
    let fitting: f64 = fitting.split(' ').next().unwrap().parse().unwrap();
    // The cell that is said to fit does fit, and one a tenth smaller does not (two digits are told).
    for (cell, code) in [(fitting, Some(0)), (0.9 * fitting, Some(2))] {
        std::fs::write(&scene, too_fine.replace("0.00002", &cell.to_string())).unwrap();
        assert_eq!(millstream(home.path(), &["check", "scene.toml"]).code, code, "{cell}");
    }
    std::fs::write(&scene, PLATE).unwrap();
    let answer = millstream(home.path(), &["run", "scene.toml", "--cell", "0.000001"]);
    assert_eq!(answer.code, Some(2), "{answer:?}");
    assert!(flat(&answer.stderr).contains("the smallest cell that fits is"), "{answer:?}");
    assert_eq!(entries(home.path()), ["scene.toml"]);
}

#[test]
fn formulas_that_are_no_part() {
    let formula = "surface = \"plane\"\nx = [0, 8]";
    let part = |text: &str| PLATE.replace(formula, text);
    let ripples =
        part("surface = \"wave\"\namplitude = 50\nwavelength_x = 0.07\nwavelength_y = 0.07\nx = [0, 8]");
    scene_is_refused(ripples.as_bytes(), "ripples", &["the part cannot be used", "triangles", "[part]"]);
    let ball = part("surface = \"sphere\"\nradius = 3\nx = [0, 8]");
    scene_is_refused(ball.as_bytes(), "beyond a ball", &["scene.toml:3:11", "radius 3 mm"]);
}

/// Paths that would take days and all memory are refused before they are planned.
#[test]
fn plans_without_end() {
    let home = tempfile::tempdir().unwrap();
    let default_cell = PLATE.replace("cell = 0.1\n", "");
    let scenes = [
        default_cell.replace("[0, 8]", "[-1e6, 1e6]").replace("[0, 6]", "[-1e6, 1e6]"),
        PLATE.replace("stepover = 0.5", "stepover = 1e-6"),
        default_cell.replace("stepover = 0.5", "scallop = 1e-6").replace("[0, 6]", "[0, 20000]"),
    ];
    for strategy in ["zigzag", "iso-parametric", "streamline"] {
        for scene in &scenes {
            let scene = scene.replace("\"zigzag\"", &format!("\"{strategy}\""));
            std::fs::write(home.path().join("scene.toml"), &scene).unwrap();
            let answer = millstream(home.path(), &["run", "scene.toml"]);
            assert_eq!((answer.code, answer.stdout.as_str()), (Some(2), ""), "{scene}\n{answer:?}");
            let said = flat(&answer.stderr);
            for word in ["scene.toml", "would be too many", strategy, "`stepover`", "help: "] {
                assert!(said.contains(word), "{word}: {said}");
            }
            assert_eq!(entries(home.path()), ["scene.toml"]);
        }
    }
}

/// A part from a file of this name and these bytes must be refused at its name in the scene, with
/// every one of `words` in the message.
fn part_is_refused(name: &str, bytes: &[u8], what: &str, words: &[&str]) {
    let home = tempfile::tempdir().unwrap();
    std::fs::write(home.path().join(name), bytes).unwrap();
    part_in_home_is_refused(home.path(), name, what, words);
}

fn part_in_home_is_refused(home: &Path, name: &str, what: &str, words: &[&str]) {
    let source = if name.ends_with(".json") { "surface = \"nurbs\"\nfile = " } else { "file = " };
    let formula = "surface = \"plane\"\nx = [0, 8]\ny = [0, 6]";
    let scene = PLATE.replace(formula, &format!("{source}\"{name}\""));
    std::fs::write(home.join("scene.toml"), &scene).unwrap();
    let said = flat(&refused(home, what));
    let line = 3 + source.matches('\n').count();
    let place = format!("scene.toml:{line}:{}", 1 + "file = ".len());
    for word in words.iter().chain(&[name, place.as_str()]) {
        assert!(said.contains(word), "{what}: \"{word}\" is not in: {said}");
    }
}

/// Missing, a folder, empty and noise, for a kind of file.
fn usual_faults(name: &str) {
    let home = tempfile::tempdir().unwrap();
    part_in_home_is_refused(home.path(), name, "missing", &["cannot read"]);
    std::fs::create_dir(home.path().join(name)).unwrap();
    part_in_home_is_refused(home.path(), name, "folder", &["it is a folder"]);
    part_is_refused(name, b"", "empty", &[]);
    part_is_refused(name, &noise(5000), "noise", &[]);
    part_is_refused(name, &[0; 5000], "zeros", &[]);
    part_is_refused(name, b"\xef\xbb\xbf", "byte order mark alone", &[]);
    // No file of another kind is taken for this one.
    part_is_refused(name, b"<html><body>404 Not Found</body></html>\n", "web page", &[]);
}

const NURBS: &str = r#"{"unit": "mm", "degree_u": 1, "degree_v": 1,
 "knots_u": [0, 0, 1, 1], "knots_v": [0, 0, 1, 1],
 "control_points": [[[0, 0, 0], [0, 20, 0]], [[30, 0, 5], [30, 20, 5]]],
 "weights": [[1, 1], [1, 1]]}
"#;

#[test]
fn nurbs_files() {
    usual_faults("part.json");
    let edit = |old: &str, new: &str, words: &[&str]| {
        assert!(NURBS.contains(old), "{old}");
        part_is_refused(
            "part.json",
            NURBS.replacen(old, new, 1).as_bytes(),
            new,
            &[words, &["line "]].concat(),
        );
    };
    part_is_refused(
        "part.json",
        &NURBS.as_bytes()[..NURBS.len() / 2],
        "truncated",
        &["ends too early", "line 3"],
    );
    edit("30, 0, 5", "30, NaN, 5", &["line 3"]);
    edit("30, 0, 5", "30, Infinity, 5", &["line 3"]);
    edit("30, 0, 5", "30, 1e999, 5", &["line 3", "column"]);
    edit("30, 0, 5", "30, 1e30, 5", &["within ±1e6 mm"]);
    edit("30, 0, 5", "30, 0", &["line 3"]);
    edit("30, 0, 5", "30, 0, 5, 1", &["line 3"]);
    edit("30, 0, 5", "30, \"0\", 5", &["line 3"]);
    edit(", [30, 20, 5]", "", &["row 1", "2 are needed"]);
    edit("[0, 0, 1, 1]", "[0, 0, 1]", &["knots"]);
    edit("[0, 0, 1, 1]", "[0, 1, 0, 1]", &["must not decrease"]);
    edit("[0, 0, 1, 1]", "[0, 0, 0, 0]", &["along u"]);
    edit("[0, 0, 1, 1]", "[0, 0, 1e999, 1e999]", &["line 2"]);
    edit("\"degree_u\": 1", "\"degree_u\": 0", &["degree is 0"]);
    edit("\"degree_u\": 1", "\"degree_u\": -1", &["line 1"]);
    edit("\"degree_u\": 1", "\"degree_u\": 18446744073709551615", &["degree"]);
    edit("\"degree_u\": 1", "\"degree_u\": 1.5", &["line 1"]);
    edit("[[1, 1], [1, 1]]", "[[1, 0], [1, 1]]", &["weight [0][1] is 0"]);
    edit("[[1, 1], [1, 1]]", "[[1, -1], [1, 1]]", &["weight [0][1] is -1"]);
    edit("[[1, 1], [1, 1]]", "[[1, 1]]", &["rows of weights"]);
    edit("\"weights\"", "\"wieghts\"", &["did you mean \"weights\"?"]);
    edit("\"mm\"", "\"inch\"", &["only \"mm\" is read"]);
    edit("\"unit\": \"mm\", ", "", &["\"unit\" is missing"]);
    edit("\"unit\": \"mm\", ", "\"unit\": \"mm\", \"unit\": \"mm\", ", &["line 1"]);
    part_is_refused("part.json", b"{\"unit\": \"mm\", \"patches\": []}", "no patch", &["there is no patch"]);
    part_is_refused("part.json", b"[]", "a list", &[]);
    part_is_refused("part.json", b"3", "a number", &[]);
    part_is_refused("part.json", "[".repeat(100_000).as_bytes(), "deep", &[]);
    part_is_refused("part.json", NURBS.replace("20", "0").as_bytes(), "no area", &[]);
    part_is_refused("part.json", wild_net().as_bytes(), "wild net", &["triangles", "fewer control points"]);
    let home = tempfile::tempdir().unwrap();
    let file = std::fs::File::create(home.path().join("part.json")).unwrap();
    file.set_len((64 << 20) + 1).unwrap();
    part_in_home_is_refused(
        home.path(),
        "part.json",
        "64 MiB and a byte",
        &["greater than 64 MiB", "thin out"],
    );
}

/// A net that swings by a kilometre between control points: finite, and beyond any mesh.
fn wild_net() -> String {
    const SIDE: usize = 60;
    let list = |one: &dyn Fn(usize) -> String| (0..SIDE).map(one).collect::<Vec<_>>().join(",");
    let knots = format!("[0,0,{},{},{}]", list(&|k| k.to_string()), SIDE - 1, SIDE - 1);
    let height = |i, j| if (i + j) % 2 == 0 { -1e6 } else { 1e6 };
    let points = list(&|i| format!("[{}]", list(&|j| format!("[{i},{j},{}]", height(i, j)))));
    let mut text = String::from("{\"unit\": \"mm\", \"degree_u\": 3, \"degree_v\": 3, ");
    let _ = write!(text, "\"knots_u\": {knots}, \"knots_v\": {knots}, \"control_points\": [{points}]}}");
    text
}

type Triangle = [[f32; 3]; 3];

const ROOF: [Triangle; 2] = [
    [[0.0, 0.0, 0.0], [8.0, 0.0, 0.0], [8.0, 6.0, 1.0]],
    [[0.0, 0.0, 0.0], [8.0, 6.0, 1.0], [0.0, 6.0, 1.0]],
];

fn binary_stl(triangles: &[Triangle], declared: u32) -> Vec<u8> {
    let mut bytes = vec![0; 80];
    bytes.extend(declared.to_le_bytes());
    for triangle in triangles {
        bytes.extend([0; 12]);
        bytes.extend(triangle.iter().flatten().flat_map(|x| x.to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

fn with_corner(x: f32) -> Vec<u8> {
    let mut triangles = ROOF;
    triangles[1][2][0] = x;
    binary_stl(&triangles, 2)
}

const TEXT_STL: &str = "solid roof\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 8 0 0\nvertex 8 6 1\n\
    endloop\nendfacet\nendsolid roof\n";

#[test]
fn stl_files() {
    let name = "part.stl";
    usual_faults(name);
    let whole = binary_stl(&ROOF, 2);
    for kept in [1, 79, 83, 84, 100, whole.len() - 50, whole.len() - 1] {
        part_is_refused(name, &whole[..kept], &format!("{kept} bytes"), &["export"]);
    }
    part_is_refused(name, &[&whole[..], b"x"].concat(), "a byte too many", &["185 bytes"]);
    for declared in [0, 1, 3, u32::MAX] {
        let words = format!("{declared} triangles");
        part_is_refused(name, &binary_stl(&ROOF, declared), "a lying count", &["byte 80", &words]);
    }
    part_is_refused(name, &binary_stl(&[], 0), "no triangle", &["no triangles"]);
    // The third corner of the second triangle: 84 + 50 + 12 + 24.
    part_is_refused(name, &with_corner(f32::NAN), "NaN", &["byte 170", "NaN"]);
    part_is_refused(name, &with_corner(f32::INFINITY), "infinite", &["byte 170", "inf"]);
    part_is_refused(name, &with_corner(f32::MAX), "huge", &["byte 170", "units"]);
    part_is_refused(name, &binary_stl(&[[[1.0; 3]; 3]; 2], 2), "points", &["no triangles with an area"]);
    part_is_refused(
        name,
        &binary_stl(&[ROOF[0], [[0.0; 3], [1.0; 3], [2.0; 3]]], 2)[..160],
        "cut",
        &["export"],
    );
    let wall = [[[0.0, 0.0, 0.0], [8.0, 0.0, 0.0], [8.0, 0.0, 5.0]]];
    part_is_refused(name, &binary_stl(&wall, 1), "an upright wall", &["seen from above", "turn the part"]);
    let edit = |old: &str, new: &str, words: &[&str]| {
        assert!(TEXT_STL.contains(old), "{old}");
        part_is_refused(name, TEXT_STL.replacen(old, new, 1).as_bytes(), new, words);
    };
    edit("vertex 8 6 1\n", "", &["line 6", "\"vertex\""]);
    edit("vertex 8 6 1", "vertex 8 6", &["line 7"]);
    edit("vertex 8 6 1", "vertex 8 6 nan", &["line 6"]);
    edit("vertex 8 6 1", "vertex 8 6 -inf", &["line 6"]);
    edit("vertex 8 6 1", "vertex 8 6 1e999", &["line 6"]);
    edit("vertex 8 6 1", "vertex 8 6 1e7", &["line 6", "units"]);
    edit("vertex 8 6 1", "vertex 8 6,5 1", &["line 6", "point, not with a comma"]);
    edit("vertex 8 6 1", "vertex 8 0 0", &["no triangles with an area"]);
    edit("endloop", "vertex 1 1 1\nendloop", &["line 7", "endloop"]);
    edit("endsolid roof\n", "", &["endsolid"]);
    part_is_refused(name, b"solid nothing\nendsolid\n", "no facet", &["no triangles"]);
    part_is_refused(name, b"solid", "a word", &["export"]);
}

const OBJ: &str = "# roof\nv 0 0 0\nv 8 0 0\nv 8 6 1\nv 0 6 1\nf 1 2 3 4\n";

#[test]
fn obj_files() {
    let name = "part.obj";
    usual_faults(name);
    let edit = |old: &str, new: &str, words: &[&str]| {
        assert!(OBJ.contains(old), "{old}");
        part_is_refused(name, OBJ.replacen(old, new, 1).as_bytes(), new, words);
    };
    edit("f 1 2 3 4", "", &["no triangles"]);
    edit("f 1 2 3 4", "f 1 2 3 5", &["line 6", "vertex 5", "4 vertices"]);
    edit("f 1 2 3 4", "f 0 1 2", &["line 6", "vertex 0"]);
    edit("f 1 2 3 4", "f -1 -2 -5", &["line 6", "vertex -5"]);
    edit("f 1 2 3 4", "f 1 2 9223372036854775807", &["line 6"]);
    edit("f 1 2 3 4", "f 1 2 -9223372036854775808", &["line 6"]);
    edit("f 1 2 3 4", "f 1 2 99999999999999999999", &["line 6"]);
    edit("f 1 2 3 4", "f 1 2 x", &["line 6", "not \"x\""]);
    edit("f 1 2 3 4", "f 1 2", &["line 6", "third corner"]);
    edit("f 1 2 3 4", "f 1 1 1", &["no triangles"]);
    edit("f 1 2 3 4", &format!("f{}", " 1 2 3 4".repeat(1000)), &["line 6", "4000 corners"]);
    edit("v 8 6 1", "v 8 6", &["line 4", "coordinate"]);
    edit("v 8 6 1", "v 8 6 nan", &["line 4"]);
    edit("v 8 6 1", "v 8 6 inf", &["line 4"]);
    edit("v 8 6 1", "v 8 6 1e999", &["line 4"]);
    edit("v 8 6 1", "v 8 6 1e7", &["line 4", "units"]);
    edit("v 8 6 1", "v 8 6 1\u{7}\u{1b}[31m", &["line 4"]);
    edit("f 1 2 3 4", "surf 0 1 0 1 1 2 3", &["line 6", "triangles"]);
}

/// A mesh in metres may leave the range of coordinates only once it is in mm.
#[test]
fn units_that_make_a_part_too_large() {
    let home = tempfile::tempdir().unwrap();
    std::fs::write(home.path().join("part.obj"), OBJ.replace('8', "8000")).unwrap();
    let formula = "surface = \"plane\"\nx = [0, 8]\ny = [0, 6]";
    let scene = PLATE.replace(formula, "file = \"part.obj\"\nunit = \"m\"");
    std::fs::write(home.path().join("scene.toml"), scene).unwrap();
    let said = flat(&refused(home.path(), "8 km"));
    assert!(said.contains("units of the export") && said.contains("part.obj"), "{said}");
}
