//! The program as its users meet it: arguments, exit status, streams and the files of a run.

use std::collections::BTreeMap;
use std::path::Path;

use exr::prelude::{AttributeValue, FlatSamples, ReadChannels as _, ReadLayers as _, Text};
use serde_json::Value;

use crate::command::{PLATE, entries, millstream};

/// Files of every toolpath.
const TOOLPATH_FILES: [&str; 9] = [
    "deviation.png",
    "height.exr",
    "height.png",
    "machined.ply",
    "machined.stl",
    "path.png",
    "scallop_pairs.csv",
    "toolpath.cls",
    "toolpath.nc",
];

/// The plate, and a strategy of each kind on a surface that curves.
const WAVE: &str = r#"title = "A wave <&> its \"passes\""
[part]
surface = "wave"
amplitude = 0.5
wavelength_x = 12
x = [-2, 6]
y = [0, 3]
[stock]
margin = 1.0
[cutter]
shape = "ball"
diameter = 4
[tolerance]
scallop = 0.02
[simulation]
cell = 0.1
[[toolpath]]
strategy = "zigzag"
angle = 33.3
[[toolpath]]
name = "along v: 1/2"
strategy = "iso-parametric"
along = "v"
[[toolpath]]
strategy = "streamline"
direction = { angle = 10 }
control_points = 8
"#;

fn home_with(scene: &str) -> tempfile::TempDir {
    let home = tempfile::tempdir().unwrap();
    std::fs::write(home.path().join("plate.toml"), scene).unwrap();
    home
}

/// Runs `plate.toml` in `home`; it must have run, and leaves nothing on stderr.
fn run(home: &Path, out: &str, more: &[&str]) -> String {
    let answer = millstream(home, &[&["run", "plate.toml", "--out", out], more].concat());
    assert!(answer.code == Some(0) || answer.code == Some(1), "{answer:?}");
    assert_eq!(answer.stderr, "");
    answer.stdout
}

fn report(out: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(out.join("report.json")).unwrap()).unwrap()
}

/// All files below a folder: their paths with slashes, and their bytes.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for name in entries(folder) {
        let path = folder.join(&name);
        if path.is_dir() {
            found.extend(files(&path).into_iter().map(|(below, bytes)| (format!("{name}/{below}"), bytes)));
        } else {
            found.insert(name, std::fs::read(&path).unwrap());
        }
    }
    found
}

/// What may differ from run to run: the time taken, and how many threads took it.
fn without_time(mut report: Value) -> Value {
    for toolpath in report["toolpaths"].as_array_mut().unwrap() {
        let simulation = toolpath["simulation"].as_object_mut().unwrap();
        simulation.remove("wall_s").unwrap();
        simulation.remove("threads").unwrap();
    }
    report
}

/// The page without the sentences that tell the time.
fn page_without_time(page: &[u8]) -> String {
    let page = std::str::from_utf8(page).unwrap();
    let mut pieces = page.split("Cutting and measuring took ");
    let mut kept = pieces.next().unwrap().to_owned();
    for piece in pieces {
        kept += &piece[piece.find("</p>").expect("the sentence ends its paragraph")..];
    }
    assert!(kept.len() < page.len(), "the page tells the time");
    kept
}

fn no_number_is_missing(place: &str, value: &Value) {
    match value {
        // JSON has no NaN; serde_json writes null for it.
        Value::Null => panic!("{place} is null"),
        Value::Number(number) => assert!(number.as_f64().is_some_and(f64::is_finite), "{place}"),
        Value::Array(items) => items.iter().for_each(|item| no_number_is_missing(place, item)),
        Value::Object(map) => {
            for (key, item) in map {
                no_number_is_missing(&format!("{place}.{key}"), item);
            }
        }
        Value::Bool(_) | Value::String(_) => (),
    }
}

#[test]
fn exit_status_and_streams_tell_the_verdict() {
    let home = home_with(PLATE);
    let passed = millstream(home.path(), &["run", "plate.toml"]);
    assert_eq!((passed.code, passed.stderr.as_str()), (Some(0), ""), "{passed:?}");
    assert!(passed.stdout.starts_with("Plate\n") && passed.stdout.contains("pass"), "{}", passed.stdout);
    assert!(passed.stdout.ends_with(&format!("Results: {}\n", Path::new("out").join("plate").display())));
    assert!(!passed.stdout.contains('\x1b'), "no colours in a pipe");
    assert!(home.path().join("out/plate/report.json").is_file());

    std::fs::write(home.path().join("plate.toml"), PLATE.replace("0.0105", "0.005")).unwrap();
    let violated = millstream(home.path(), &["run", "plate.toml"]);
    assert_eq!((violated.code, violated.stderr.as_str()), (Some(1), ""), "{violated:?}");
    assert!(violated.stdout.contains("fail"), "{}", violated.stdout);
    let report = report(&home.path().join("out/plate"));
    assert_eq!(report["verdict"], "fail");
    assert!(!report["toolpaths"][0]["violations"].as_array().unwrap().is_empty());
}

#[test]
fn wrong_usage_is_told_on_stderr() {
    let home = home_with(PLATE);
    let cases: [(&[&str], &str); 11] = [
        (&[], "Usage"),
        (&["run"], "<SCENE>"),
        (&["runn", "plate.toml"], "runn"),
        (&["run", "plate.toml", "--thread", "2"], "--threads"),
        (&["run", "plate.toml", "--threads", "0"], "0"),
        (&["run", "plate.toml", "--threads", "many"], "many"),
        (&["run", "plate.toml", "--cell", "-1"], "-1"),
        (&["run", "plate.toml", "--cell", "nan"], "millimetres"),
        (&["run", "plate.toml", "--engine", "zmapp"], "zmap"),
        (&["run", "plate.toml", "--out"], "--out"),
        (&["run", "plate.toml", "other.toml"], "other.toml"),
    ];
    for (arguments, word) in cases {
        let answer = millstream(home.path(), arguments);
        assert_eq!((answer.code, answer.stdout.as_str()), (Some(2), ""), "{arguments:?}");
        assert!(answer.stderr.contains(word), "{arguments:?}: {}", answer.stderr);
        assert!(!answer.stderr.contains('\x1b'), "{arguments:?}");
        assert_eq!(entries(home.path()), ["plate.toml"], "{arguments:?}");
    }
    for (arguments, word) in
        [(["--help"], "Exit status"), (["--version"], concat!("millstream ", env!("CARGO_PKG_VERSION")))]
    {
        let answer = millstream(home.path(), &arguments);
        assert_eq!((answer.code, answer.stderr.as_str()), (Some(0), ""));
        assert!(answer.stdout.contains(word), "{}", answer.stdout);
    }
}

#[test]
fn a_run_leaves_the_files_of_the_contract_and_no_other() {
    let home = home_with(WAVE);
    run(home.path(), "deep/er/out", &[]);
    let out = home.path().join("deep/er/out");
    assert_eq!(entries(out.parent().unwrap()), ["out"], "no scratch is left");
    let report = report(&out);
    let toolpaths = report["toolpaths"].as_array().unwrap();
    let folders: Vec<&str> = toolpaths.iter().map(|t| t["folder"].as_str().unwrap()).collect();
    let names: Vec<&str> = toolpaths.iter().map(|t| t["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["zigzag", "along v: 1/2", "streamline"]);
    let mut expected = vec!["millstream.sha256", "report.html", "report.json"];
    expected.extend(&folders);
    expected.sort_unstable();
    assert_eq!(entries(&out), expected);
    for (folder, toolpath) in folders.iter().zip(toolpaths) {
        let folder = out.join(folder);
        let streamline = toolpath["strategy"] == "streamline";
        let mut files = TOOLPATH_FILES.to_vec();
        files.extend(["field.png", "interval.png", "psi.png"].iter().filter(|_| streamline));
        files.sort_unstable();
        assert_eq!(entries(&folder), files);
        assert_eq!(toolpath.get("field").is_some(), streamline);
        // 8 x 3 mm and a margin of 1 mm in cells of 0.1 mm.
        assert_eq!(toolpath["simulation"]["cells"], 100 * 50);
        pictures_have_the_grid(&folder, [100, 50]);
        the_programs_and_the_part_are_whole(&folder, toolpath);
    }
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(!page.contains("http://") && !page.contains("https://"), "the page opens offline");
    assert!(!page.contains("src=\"") || page.contains("src=\"data:"), "pictures stand in the page");
    assert!(page.contains("A wave &lt;&amp;&gt; its"), "the title is shown as it was written");
}

fn pictures_have_the_grid(folder: &Path, [nx, ny]: [usize; 2]) {
    let names = ["deviation.png", "height.png", "path.png", "field.png", "interval.png"];
    for name in names.into_iter().filter(|name| folder.join(name).exists()) {
        let picture = image::open(folder.join(name)).unwrap();
        // The map is drawn with one pixel or more a cell, and has axes, a key and a scale bar around.
        assert!(picture.width() as usize > nx && picture.height() as usize > ny, "{name}");
        assert!((picture.width() as usize) < 4000 && (picture.height() as usize) < 4000, "{name}");
    }
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_file(folder.join("height.exr"))
        .unwrap();
    let layer = &image.layer_data;
    assert_eq!([layer.size.0, layer.size.1], [nx, ny]);
    let channels = &layer.channel_data.list;
    let names: Vec<String> = channels.iter().map(|c| c.name.to_string()).collect();
    assert_eq!(names, ["Z", "deviation", "move"]);
    let FlatSamples::F32(heights) = &channels[0].sample_data else { panic!("Z is 32-bit float") };
    assert!(heights.iter().all(|z| z.is_finite()));
    let Some(AttributeValue::Text(text)) = layer.attributes.other.get(&Text::from("millstream")) else {
        panic!("cell and origin stand in an attribute")
    };
    let about: Value = serde_json::from_str(&text.to_string()).unwrap();
    assert_eq!(about["cell_mm"], 0.1);
    // Centre of the first cell: half a cell inside the border of part and margin.
    let [x, y] = [0, 1].map(|k| about["origin_mm"][k].as_f64().unwrap());
    assert!((x + 2.95).abs() < 1e-9 && (y + 0.95).abs() < 1e-9, "{x} {y}");
}

fn the_programs_and_the_part_are_whole(folder: &Path, toolpath: &Value) {
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
    let points = toolpath["path"]["cl_points"].as_u64().unwrap() as usize;
    let program = read("toolpath.nc");
    assert!(program.contains("G21") && program.trim_end().ends_with('%'), "{}", &program[..200]);
    let cl = read("toolpath.cls");
    assert!(cl.lines().filter(|line| line.starts_with("GOTO")).count() >= points);
    assert!(cl.trim_end().ends_with("FINI"));
    let (mesh, repairs) = millstream::io::stl::read(&folder.join("machined.stl")).unwrap();
    assert!(mesh.is_closed() && repairs.is_clean(), "{repairs}");
    assert_eq!(toolpath["surface_mesh"]["triangles"], mesh.triangles().len());
    the_ply_is_the_stl(&std::fs::read(folder.join("machined.ply")).unwrap(), &mesh, toolpath);
}

/// Reads the PLY by its header and compares it with the STL, corner by corner.
fn the_ply_is_the_stl(bytes: &[u8], stl: &millstream::geometry::TriangleMesh, toolpath: &Value) {
    let end = b"end_header\n";
    let body = bytes.windows(end.len()).position(|w| w == end).unwrap() + end.len();
    let header = std::str::from_utf8(&bytes[..body]).unwrap();
    let count = |element: &str| -> usize {
        let line = header.lines().find_map(|l| l.strip_prefix(&format!("element {element} "))).unwrap();
        line.parse().unwrap()
    };
    let (vertices, faces) = (count("vertex"), count("face"));
    assert!(header.starts_with("ply\nformat binary_little_endian 1.0\n"));
    assert_eq!(bytes.len(), body + vertices * 19 + faces * 13);
    let float = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let vertex = |k: usize| [0, 4, 8].map(|axis| f64::from(float(body + 19 * k + axis)));
    for (f, triangle) in stl.triangles().iter().enumerate() {
        let record = &bytes[body + 19 * vertices + 13 * f..][..13];
        assert_eq!(record[0], 3);
        for (k, corner) in triangle.iter().enumerate() {
            let index = u32::from_le_bytes(record[1 + 4 * k..5 + 4 * k].try_into().unwrap());
            let place: [f64; 3] = stl.vertices()[*corner as usize].into();
            assert_eq!(vertex(index as usize), place, "face {f}");
        }
    }
    let ridge_or_cell = |k: usize| (float(body + 19 * k + 15), &bytes[body + 19 * k + 12..][..3]);
    let known: Vec<f64> =
        (0..vertices).map(|k| f64::from(ridge_or_cell(k).0)).filter(|d| d.is_finite()).collect();
    let extreme = |sign: f64| known.iter().map(|d| sign * d).fold(f64::MIN, f64::max);
    let figure = |of: &str, key: &str| toolpath[of][key].as_f64().unwrap_or(0.0);
    let highest = figure("deviation", "max_mm").max(figure("scallop", "max_mm"));
    assert!(extreme(1.0) <= highest + 1e-5 && extreme(1.0) > 0.5 * highest, "{} {highest}", extreme(1.0));
    assert!(extreme(-1.0) <= figure("gouge", "max_depth_mm") + 1e-5);
    // Red where material stands, blue where it was gouged, grey where there is no design.
    for k in 0..vertices {
        let (deviation, colour) = ridge_or_cell(k);
        match deviation {
            d if d.is_nan() => assert_eq!(colour, [176, 180, 184]),
            d if d > 0.002 => assert!(colour[0] > colour[2], "{d} {colour:?}"),
            d if d < -0.002 => assert!(colour[2] > colour[0], "{d} {colour:?}"),
            _ => {}
        }
    }
}

#[test]
fn the_report_has_the_keys_of_the_contract_and_finite_numbers() {
    let home = home_with(WAVE);
    run(home.path(), "out", &["--threads", "2"]);
    let report = report(&home.path().join("out"));
    no_number_is_missing("report", &report);
    let has = |value: &Value, keys: &str| {
        for key in keys.split(' ') {
            assert!(!value[key].is_null(), "{key}");
        }
    };
    has(&report, "millstream scene scene_sha256 inputs verdict notes toolpaths");
    assert_eq!(report["millstream"], env!("CARGO_PKG_VERSION"));
    assert_eq!(report["scene"], "plate.toml");
    let digest = report["scene_sha256"].as_str().unwrap();
    assert!(digest.len() == 64 && digest.bytes().all(|b| b.is_ascii_hexdigit()), "{digest}");
    for t in report["toolpaths"].as_array().unwrap() {
        has(t, "name strategy verdict violations path scallop gouge uncut deviation simulation");
        has(
            &t["path"],
            "cutting_length_mm link_length_mm air_length_mm passes surface_links retracts cl_points total_turning_rad sharp_turns machining_time_s",
        );
        has(&t["scallop"], "target_mm max_mm p95_mm p50_mm mean_mm over_target_fraction error_bound_mm");
        has(&t["gouge"], "max_depth_mm area_mm2 error_bound_mm regions");
        has(&t["uncut"], "max_height_mm area_mm2 fraction volume_mm3 regions");
        has(&t["deviation"], "samples min_mm max_mm rms_mm");
        has(&t["simulation"], "engine cell_mm cells moves wall_s threads");
        assert_eq!(t["simulation"]["threads"], 2);
    }
}

#[test]
fn what_check_prints_is_the_same_scene() {
    let home = home_with(WAVE);
    let check = |name: &str| {
        let answer = millstream(home.path(), &["check", name]);
        assert_eq!((answer.code, answer.stderr.as_str()), (Some(0), ""), "{answer:?}");
        answer.stdout
    };
    let complete = check("plate.toml");
    assert_eq!(entries(home.path()), ["plate.toml"], "check writes nothing");
    run(home.path(), "short", &[]);
    std::fs::write(home.path().join("plate.toml"), &complete).unwrap();
    assert_eq!(check("plate.toml"), complete);
    run(home.path(), "complete", &[]);
    let read = |out: &str| {
        let mut report = without_time(report(&home.path().join(out)));
        (report.as_object_mut().unwrap().remove("scene_sha256").unwrap(), report)
    };
    let ((digest, report), (digest_of_complete, report_of_complete)) = (read("short"), read("complete"));
    assert_ne!(digest, digest_of_complete);
    assert_eq!(report, report_of_complete);
}

#[test]
fn every_file_is_the_same_for_any_number_of_threads() {
    let home = home_with(WAVE);
    let table = run(home.path(), "out", &["--threads", "1"]);
    let first = files(&home.path().join("out"));
    // Over the results of the first run, which are replaced.
    assert_eq!(run(home.path(), "out", &["--threads", "3"]), table);
    let second = files(&home.path().join("out"));
    assert!(first.keys().eq(second.keys()));
    for (name, bytes) in &first {
        let json = |bytes: &[u8]| without_time(serde_json::from_slice(bytes).unwrap());
        match name.as_str() {
            // The digests of the report and the page, which tell the time.
            "millstream.sha256" => assert_eq!(bytes.len(), second[name].len()),
            "report.json" => assert_eq!(json(bytes), json(&second[name])),
            "report.html" => assert!(page_without_time(bytes) == page_without_time(&second[name])),
            _ => assert!(*bytes == second[name], "{name}"),
        }
    }
}

#[test]
fn the_cell_can_be_given_in_place_of_the_scenes() {
    let home = home_with(PLATE);
    run(home.path(), "out", &["--cell", "0.2", "--engine", "reference"]);
    let coarse = report(&home.path().join("out"));
    assert_eq!(coarse["toolpaths"][0]["simulation"]["cell_mm"], 0.2);
    assert_eq!(coarse["toolpaths"][0]["simulation"]["cells"], 40 * 30);
    // The scallop between two passes is no matter of the cell: 3 - sqrt(9 - 0.25 * 0.25).
    let scallop = &coarse["toolpaths"][0]["scallop"];
    let error = scallop["max_mm"].as_f64().unwrap() - (3.0 - (9.0 - 0.0625f64).sqrt());
    assert!(error.abs() <= scallop["error_bound_mm"].as_f64().unwrap() + 1e-9, "{scallop}");
}

#[test]
fn a_second_run_replaces_the_first() {
    let home = home_with(PLATE);
    run(home.path(), "out", &[]);
    let out = home.path().join("out");
    std::fs::write(out.join("notes.txt"), "mine").unwrap();
    std::fs::write(home.path().join("plate.toml"), PLATE.replace("\"Plate\"", "\"Second\"")).unwrap();
    run(home.path(), "out", &[]);
    assert_eq!(report(&out)["title"], "Second");
    assert_eq!(entries(&out), ["millstream.sha256", "notes.txt", "report.html", "report.json", "zigzag"]);
    assert_eq!(entries(&out.join("zigzag")), TOOLPATH_FILES);
    assert_eq!(entries(home.path()), ["out", "plate.toml"], "no scratch is left");
}

#[test]
fn results_that_cannot_be_written_are_told_and_the_scene_stays() {
    let home = home_with(PLATE);
    for (out, word) in [("plate.toml", "it is a file"), ("plate.toml/out", "plate.toml")] {
        let answer = millstream(home.path(), &["run", "plate.toml", "--out", out]);
        assert_eq!((answer.code, answer.stdout.as_str()), (Some(2), ""), "{answer:?}");
        assert!(answer.stderr.contains(word) && answer.stderr.contains("--out"), "{}", answer.stderr);
        assert!(!answer.stderr.contains("panicked"));
        assert_eq!(entries(home.path()), ["plate.toml"]);
    }
    assert_eq!(std::fs::read_to_string(home.path().join("plate.toml")).unwrap(), PLATE);
}

/// Sends Ctrl-C: status 2, and no file.
#[cfg(unix)]
fn answers_to_ctrl_c(child: std::process::Child, home: &Path) {
    use crate::command::{Answer, ctrl_c};

    let kill = std::process::Command::new("kill").args([ctrl_c(), &child.id().to_string()]).status();
    assert!(kill.unwrap().success());
    let answer = Answer::from(child.wait_with_output().unwrap());
    assert_eq!((answer.code, answer.stdout.as_str()), (Some(2), ""), "{answer:?}");
    assert!(answer.stderr.contains("interrupted; nothing was written"), "{}", answer.stderr);
    assert_eq!(entries(home), ["plate.toml"]);
}

/// Ctrl-C at moments all over a run that would take a minute: status 2, and no file. A run that went on would
/// end with another status.
#[cfg(unix)]
#[test]
fn an_interrupted_run_leaves_nothing() {
    use crate::command::command;
    use std::time::Duration;

    let scene = WAVE.replace("x = [-2, 6]", "x = [0, 250]").replace("y = [0, 3]", "y = [0, 250]");
    let home = home_with(&scene);
    for delay_ms in [0, 200, 1000] {
        let mut child = command(home.path(), &["run", "plate.toml", "--out", "deep/out"]).spawn().unwrap();
        // The staging folder shows that the scene was read and signals are listened to.
        while entries(home.path()).len() < 2 {
            assert!(child.try_wait().unwrap().is_none(), "the run ends before it begins");
            std::thread::sleep(Duration::from_millis(5));
        }
        std::thread::sleep(Duration::from_millis(delay_ms));
        answers_to_ctrl_c(child, home.path());
    }
}

/// Ctrl-C while an outline with 2000 islands is read, which takes far longer than the answer.
#[cfg(target_os = "linux")]
#[test]
fn check_and_run_can_be_interrupted_while_the_part_is_read() {
    use crate::command::command;
    use std::fmt::Write as _;
    use std::time::Duration;

    let square = |x: f64, y: f64, s: f64| {
        format!("[[{x}, {y}], [{}, {y}], [{}, {}], [{x}, {}]]", x + s, x + s, y + s, y + s)
    };
    let mut islands = String::new();
    for k in 0..2025 {
        write!(islands, "{}, ", square(f64::from(k % 45) * 6.0 + 5.0, f64::from(k / 45) * 6.0 + 5.0, 2.0))
            .unwrap();
    }
    let scene = format!(
        "[part]\nsurface = \"pocket\"\noutline = {}\nislands = [{islands}]\ndepth = 2\n[cutter]\nshape = \"flat\"\n\
         diameter = 3\n[[toolpath]]\nstrategy = \"pocket-flow\"\n",
        square(0.0, 0.0, 274.0)
    );
    let home = home_with(&scene);
    for arguments in [vec!["check", "plate.toml"], vec!["run", "plate.toml", "--out", "out"]] {
        let mut child = command(home.path(), &arguments).spawn().unwrap();
        let catches = |signals: u64| signals & 0b100_0000_0000_0010 == 0b100_0000_0000_0010;
        while !catches(caught_signals(child.id())) {
            assert!(child.try_wait().unwrap().is_none(), "it ends before it listens to signals");
            std::thread::sleep(Duration::from_millis(2));
        }
        std::thread::sleep(Duration::from_millis(300));
        answers_to_ctrl_c(child, home.path());
    }
}

/// The signals that a process handles, a bit each, or ignores: a shell lets what it starts in the background
/// ignore Ctrl-C.
#[cfg(target_os = "linux")]
fn caught_signals(process: u32) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let lines =
        status.lines().filter_map(|l| l.strip_prefix("SigCgt:").or_else(|| l.strip_prefix("SigIgn:")));
    lines.filter_map(|digits| u64::from_str_radix(digits.trim(), 16).ok()).fold(0, |all, some| all | some)
}
