//! Whole runs in a folder of their own.

mod offset;

use super::*;
use job::JobError;

/// What every toolpath's folder holds.
const FILES: [&str; 8] = [
    "deviation.png",
    "height.png",
    "height.exr",
    "toolpath.nc",
    "toolpath.cls",
    "machined.stl",
    "machined.ply",
    "scallop_pairs.csv",
];

const PLATE: &str = "[part]\nsurface = \"plane\"\nx = [0, 8]\ny = [0, 6]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n\
    [tolerance]\nscallop = 0.0105\n[simulation]\ncell = 0.1\n[[toolpath]]\nstrategy = \"zigzag\"\nstepover = 0.5\n";

fn options(folder: &Path, scene: &str, threads: u16) -> RunOptions {
    let path = folder.join("plate.toml");
    std::fs::write(&path, scene).unwrap();
    let out = Some(folder.join(format!("out{threads}")));
    RunOptions {
        scene: path,
        out,
        threads: Some(threads),
        cell: None,
        memory: None,
        engine: None,
        until_stdin_closes: false,
    }
}

#[test]
fn a_plate_passes_and_leaves_every_file_of_the_contract() {
    let home = tempfile::tempdir().unwrap();
    let options = options(home.path(), PLATE, 1);
    let outcome = run(&options, &Progress::quiet()).unwrap();
    assert_eq!(outcome.verdict, Verdict::Pass, "{}", outcome.text);
    let out = options.out.unwrap();
    for name in FILES {
        assert!(out.join("zigzag").join(name).metadata().unwrap().len() > 100, "{name}");
    }
    let json: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(out.join("report.json")).unwrap()).unwrap();
    // A ball of radius 3 between passes 0.5 apart.
    let closed_form = 3.0 - (9.0 - 0.0625f64).sqrt();
    let measured = &json["toolpaths"][0]["scallop"];
    let error = (measured["max_mm"].as_f64().unwrap() - closed_form).abs();
    assert!(error <= measured["error_bound_mm"].as_f64().unwrap() + 1e-9, "{error}");
    assert!(std::fs::read_to_string(out.join("report.html")).unwrap().contains("PASS"));
}

/// Two engines on one path: the z-map in the order of the program, and voxels.
#[test]
fn voxels_lose_the_volume_that_the_z_map_does() {
    let home = tempfile::tempdir().unwrap();
    let options = options(home.path(), &PLATE.replace("cell = 0.1\n", "cell = 0.05\nvoxel = 0.1\n"), 2);
    run(&options, &Progress::quiet()).unwrap();
    let out = options.out.unwrap();
    let json: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(out.join("report.json")).unwrap()).unwrap();
    let [a, b] = ["/toolpaths/0/removal/volume_mm3", "/toolpaths/0/solid/removed_mm3"]
        .map(|figure| json.pointer(figure).and_then(serde_json::Value::as_f64).unwrap());
    assert!((a / b - 1.0).abs() < 2e-3, "{a} {b}");
    let bounds =
        ["/toolpaths/0/removal/volume_error_bound_mm3", "/toolpaths/0/solid/removed_error_bound_mm3"]
            .map(|bound| json.pointer(bound).and_then(serde_json::Value::as_f64).unwrap());
    assert!((a - b).abs() <= bounds[0] + bounds[1], "{a} {b} {bounds:?}");
    assert!(bounds[1] < 0.02 * b, "{b} {bounds:?}");
    let (mesh, _) = io::stl::read(&out.join("zigzag/solid.stl")).unwrap();
    assert!(mesh.is_closed());
}

#[test]
fn pockets_are_not_measured_by_rays() {
    let home = tempfile::tempdir().unwrap();
    let pocket = "[part]\nsurface = \"pocket\"\noutline = [[0, 0], [30, 0], [30, 20], [0, 20]]\ndepth = 2\n[cutter]\n\
        shape = \"flat\"\ndiameter = 6\n[simulation]\nengine = \"rays\"\n[[toolpath]]\nstrategy = \"pocket-offset\"\n";
    let error = run(&options(home.path(), pocket, 1), &Progress::quiet()).unwrap_err();
    assert!(matches!(error, CliError::Job(JobError::PocketAlongNormals { .. })), "{error}");
}

#[test]
fn a_holder_that_meets_the_slope_is_a_collision() {
    let home = tempfile::tempdir().unwrap();
    let report = |name: &str, holder: &str| -> serde_json::Value {
        let scene = PLATE.replace("\"plane\"", "\"inclined_plane\"\nangle = 30");
        let folder = home.path().join(name);
        std::fs::create_dir(&folder).unwrap();
        let options = options(&folder, &format!("{scene}{holder}"), 2);
        run(&options, &Progress::quiet()).unwrap();
        serde_json::from_str(&std::fs::read_to_string(options.out.unwrap().join("report.json")).unwrap())
            .unwrap()
    };
    // The slope rises by 4.6 mm: over its foot a holder 3 mm above the tip stands in its head.
    let wide = "[holder]\ncutting_length = 3\n[[holder.section]]\ndiameter = 40\nlength = 30\n";
    let hit = report("wide", wide);
    let violations = hit["toolpaths"][0]["violations"].as_array().unwrap();
    let with = |other: &str| {
        let of =
            |v: &&serde_json::Value| v["what"] == "collision" && v["text"].as_str().unwrap().contains(other);
        violations.iter().find(of).unwrap_or_else(|| panic!("{violations:#?}"))
    };
    let (part, standing) = (with("collides with part"), with("collides with standing stock"));
    let [depth, before] = [part, standing].map(|v| v["measured_mm"].as_f64().unwrap());
    assert!(depth > 0.5 && depth < 8.0 * 30f64.to_radians().tan() - 3.0 + 1.0, "{depth}");
    // Before the slope is cut the block stands as high as its head all over.
    assert!(before > depth, "{before} {depth}");
    assert!(part["text"].as_str().unwrap().contains("toolpath.nc line "), "{part}");
    let clear = report("slim", &wide.replace("= 3\n", "= 12\n"));
    let pairs = clear["toolpaths"][0]["clearance"]["pairs"].as_array().unwrap();
    assert!(
        pairs.len() == 3 && pairs.iter().all(|pair| pair["clearance_mm"].as_f64().is_none_or(|c| c > 1.0)),
        "{pairs:?}"
    );
    let collides = |v: &serde_json::Value| v["what"] == "collision";
    assert!(!clear["toolpaths"][0]["violations"].as_array().unwrap().iter().any(collides));
}

#[test]
fn a_ball_by_its_seven_words_measures_as_a_ball() {
    let home = tempfile::tempdir().unwrap();
    let scallop = |name: &str, cutter: &str| {
        let folder = home.path().join(name);
        std::fs::create_dir(&folder).unwrap();
        // Bends between passes leave other grooves beside the plate.
        let scene = PLATE.replace("\"ball\"\ndiameter = 6", cutter) + "links = \"retract\"\n";
        let options = options(&folder, &scene, 1);
        run(&options, &Progress::quiet()).unwrap();
        let json = std::fs::read_to_string(options.out.unwrap().join("report.json")).unwrap();
        let json: serde_json::Value = serde_json::from_str(&json).unwrap();
        json["toolpaths"][0]["scallop"]["max_mm"].as_f64().unwrap()
    };
    let ball = scallop("ball", "\"ball\"\ndiameter = 6");
    let words = scallop("words", "\"apt\"\ndiameter = 6\ncorner_radius = 3\nlength = 10");
    assert!((ball - words).abs() < 1e-12, "{ball} {words}");
    // A point of 20 degrees leaves grooves of half the stepover times its tangent.
    let point = scallop("point", "\"apt\"\ndiameter = 6\ntip_angle = 20\nlength = 10");
    assert!((point - 0.25 * 20f64.to_radians().tan()).abs() < 1e-9, "{point}");
}

#[test]
fn threads_change_nothing_but_the_time() {
    let home = tempfile::tempdir().unwrap();
    let read = |threads: u16| {
        let options = options(home.path(), PLATE, threads);
        run(&options, &Progress::quiet()).unwrap();
        let out = options.out.unwrap();
        let mut json: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(out.join("report.json")).unwrap()).unwrap();
        json["toolpaths"][0]["simulation"]["wall_s"] = 0.into();
        json["toolpaths"][0]["simulation"]["threads"] = 0.into();
        (json, FILES.map(|name| std::fs::read(out.join("zigzag").join(name)).unwrap()))
    };
    assert!(read(1) == read(3));
}

#[test]
fn a_wish_to_stop_leaves_nothing_behind() {
    let home = tempfile::tempdir().unwrap();
    let options = options(home.path(), PLATE, 1);
    let progress = Progress::quiet();
    progress.stop();
    assert!(matches!(run(&options, &progress), Err(CliError::Interrupted)));
    assert_eq!(std::fs::read_dir(home.path()).unwrap().count(), 1, "only the scene is there");
}
