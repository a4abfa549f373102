//! Blades and offset surfaces: the scenes that ship (`scenes/blades`), and what their reports must say.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::support::{is_good, number, patch, run_scene};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/blades")
}

/// Hollow across with a radius of 8 mm up to 70 degrees, its bottom a wave of 4 mm over 60 mm.
fn duct() -> Value {
    patch([18, 24], |u, v| {
        let angle = (140.0 * u - 70.0).to_radians();
        let bottom = 4.0 * (std::f64::consts::TAU * v).sin();
        [8.0 * angle.sin(), 60.0 * v, bottom - 8.0 * angle.cos()]
    })
}

/// The duct is what its generator makes; `MILLSTREAM_BLESS=1` writes it anew.
#[test]
fn the_duct_is_that_of_its_generator() {
    let path = folder().join("duct.json");
    if std::env::var_os("MILLSTREAM_BLESS").is_some() {
        std::fs::write(&path, duct().to_string() + "\n").unwrap();
    }
    let shipped: Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
    assert_eq!(shipped, duct());
}

/// Runs a scene all of whose toolpaths must be good and clear of collisions.
fn all_good(name: &str) -> Vec<Value> {
    let (_, report) = run_scene(&folder().join(name));
    let paths = report["toolpaths"].as_array().unwrap().clone();
    for path in &paths {
        is_good(path);
        let violations = path["violations"].to_string();
        assert!(!violations.contains("holder") && !violations.contains("cutter"), "{violations}");
    }
    paths
}

/// Streamlines hold every tolerance; more of their ridges than asked of offset surfaces stand a little over
/// the target.
#[test]
#[ignore = "minutes: a blade cut twice"]
fn a_twisted_blade_is_cut_on_both_sides() {
    let (_, report) = run_scene(&folder().join("twisted.toml"));
    is_good(&report["toolpaths"][0]);
    assert_eq!(report["verdict"], "pass", "{:#}", report["toolpaths"][1]["violations"]);
    // Where passes are parallel, what is calculated is what was measured.
    let pairs = &report["toolpaths"][0]["scallop_pairs"];
    let ratio = number(pairs, "/parallel_calculated_over_measured");
    assert!((ratio - 1.0).abs() <= 0.01, "{pairs:#}");
    assert!(number(pairs, "/parallel_count") > 10.0);
}

#[test]
#[ignore = "a minute: a whole blade, rays along its normals"]
fn a_spiral_around_the_blade_never_leaves_it() {
    let paths = all_good("around.toml");
    assert_eq!(number(&paths[0], "/path/passes"), 1.0);
}

#[test]
#[ignore = "a minute: the passage between two blades"]
fn the_sides_of_a_passage_are_cut_clear_of_both_blades() {
    all_good("passage.toml");
}

#[test]
#[ignore = "minutes: both sides of a rotor blade, cut twice"]
fn a_rotor_blade_comes_from_a_faired_section_table() {
    let paths = all_good("rotor.toml");
    assert!(paths[0]["notes"].to_string().contains("section curves were faired"), "{}", paths[0]["notes"]);
}

#[test]
fn a_duct_is_cut_upright_and_leaning() {
    all_good("duct.toml");
}

/// Every strategy holds the target, leaves nothing uncut and gouges nothing. Sections offset in their planes
/// lie too near where the blade leans: what would gouge is left out, which the report tells.
#[test]
#[ignore = "minutes: six toolpaths on a blade"]
fn strategies_compare_on_one_side_of_a_blade() {
    let (_, report) = run_scene(&folder().join("compare.toml"));
    let paths = report["toolpaths"].as_array().unwrap();
    paths[..5].iter().for_each(is_good);
    let named = |name: &str| paths.iter().find(|path| path["name"] == name).unwrap();
    let in_planes = named("offset in planes");
    assert_eq!(in_planes["verdict"], "fail");
    assert!(in_planes["notes"].to_string().contains("cannot be reached"), "{}", in_planes["notes"]);
}

/// The toolpath of a blade of `scenes/blades` with axes that lead by ten degrees and turn by no more than 0.2
/// degrees a mm.
fn turning_slowly(side: &str) -> Value {
    let home = tempfile::tempdir().unwrap();
    let scene = format!(
        "[part]\nsections = {:?}\nside = \"{side}\"\n[cutter]\nshape = \"ball\"\ndiameter = 6\n[tolerance]\nchord = 0.005\n\
         [simulation]\nremoval = false\ncell = 1\nerror_bound = 1\n[[toolpath]]\nstrategy = \"iso-parametric\"\nalong = \"u\"\n\
         stepover = 6\naxis = {{ lead = 10, turning = 0.2 }}\n",
        folder().join("sections.toml")
    );
    let path = home.path().join("blade.toml");
    std::fs::write(&path, scene).unwrap();
    run_scene(&path).1["toolpaths"][0].clone()
}

fn judged<'a>(path: &'a Value, list: &str, what: &str) -> Option<&'a Value> {
    path[list].as_array().unwrap().iter().find(|claim| claim["what"] == what)
}

/// On one side a constant axis is clear, so that slow turns always are possible.
#[test]
fn a_side_of_a_blade_is_cut_with_slow_turns() {
    let path = turning_slowly("pressure");
    let held = judged(&path, "held", "turning").unwrap_or_else(|| panic!("{:#}", path["violations"]));
    assert!(held["measured_deg_per_mm"].as_f64().unwrap() <= 0.2, "{held}");
}

/// All around it the axis must turn, and the edges are short ways: where, how fast and on which line is told.
#[test]
fn where_slow_turns_are_impossible_the_place_is_told() {
    let path = turning_slowly("around");
    let violation = judged(&path, "violations", "turning").unwrap_or_else(|| panic!("{:#}", path["held"]));
    assert!(violation["measured_deg_per_mm"].as_f64().unwrap() > 0.2, "{violation}");
    let text = violation["text"].as_str().unwrap();
    assert!(
        text.contains("degrees a mm of contact along a pass (limit 0.200) at x") && text.contains("move"),
        "{text}"
    );
    assert!(
        path["notes"].to_string().contains("no slower axes that keep the tool clear were found"),
        "{}",
        path["notes"]
    );
}
