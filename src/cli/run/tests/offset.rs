//! What a run says of offset surfaces.

use super::super::run;
use crate::args::RunOptions;
use crate::progress::Progress;

/// Runs a suction side that leans by 20 degrees out of its sections' planes, straight or hollow; its `offset`
/// and notes.
fn offset_of(side: &dyn Fn(f64) -> f64, offset: &str, diameter: f64) -> (serde_json::Value, String) {
    let path = path_of(side, offset, diameter);
    (path["offset"].clone(), path["notes"].to_string())
}

/// The same; all that report.json has of its path.
fn path_of(side: &dyn Fn(f64) -> f64, offset: &str, diameter: f64) -> serde_json::Value {
    let home = tempfile::tempdir().unwrap();
    let mut table = String::from("unit mm\n");
    for height in [0.0, 4.0, 8.0, 12.0_f64] {
        let lean = height * 20_f64.to_radians().tan();
        table += &format!("section {height}\n");
        for (name, y) in [("pressure", &(|_| -9.0) as &dyn Fn(f64) -> f64), ("suction", side)] {
            table += &format!("{name}\n");
            for k in 0..=24 {
                let x = 0.5 * f64::from(k);
                let inside = if k == 0 || k == 24 { 0.0 } else { y(x) };
                table += &format!("{x} {}\n", lean + inside);
            }
        }
    }
    std::fs::write(home.path().join("side.txt"), table).unwrap();
    let scene = home.path().join("side.toml");
    let text = format!(
        "[part]\nsections = \"side.txt\"\nside = \"suction\"\nrotate = [90, 0, 0]\n[cutter]\nshape = \"ball\"\n\
         diameter = {diameter}\n[tolerance]\nscallop = 0.1\nscallop_highest = 3\n\
         correct = false\n[simulation]\ncell = 0.2\nengine = \"rays\"\n\
         [[toolpath]]\nname = \"a\"\nstrategy = \"offset-surface\"\n\
         offset = \"{offset}\"\n"
    );
    std::fs::write(&scene, text).unwrap();
    let out = Some(home.path().join("out"));
    let options = RunOptions {
        scene,
        out,
        threads: Some(2),
        cell: None,
        memory: None,
        engine: None,
        until_stdin_closes: false,
    };
    run(&options, &Progress::quiet()).unwrap();
    let json = std::fs::read_to_string(home.path().join("out/report.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&json).unwrap();
    report["toolpaths"][0].clone()
}

#[test]
fn a_run_tells_what_its_offset_surface_is_off_the_part() {
    let flat = |_| 0.0;
    let (planar, notes) = offset_of(&flat, "in-plane", 4.0);
    let distance = &planar["distance"];
    let of = |key: &str| distance[key].as_f64().unwrap();
    // d cos φ, φ the lean.
    assert!((of("least_mm") - 1.8794).abs() < 1e-4 && (of("greatest_mm") - 1.8794).abs() < 1e-4, "{planar}");
    assert!(of("error_bound_mm") < 1e-4 && (of("rms_error_mm") - 0.1206).abs() < 1e-4);
    assert!(planar["made"] == "in-plane" && planar["singular_place_count"] == 0);
    assert!(notes.contains("in their planes, is 1.8794 to 1.8794 mm off the part"), "{notes}");
    let (exact, notes) = offset_of(&flat, "normal", 4.0);
    assert!((exact["distance"]["greatest_mm"].as_f64().unwrap() - 2.0).abs() < 1e-9, "{exact}");
    assert!(notes.contains("is 2 mm off the part everywhere"), "{notes}");
}

#[test]
fn a_run_tells_where_its_ball_does_not_fit() {
    // At its bottom x = 6 the hollow bends with y'' = 2 (0.2 + 7.2 · 0.05) = 1.12 in the section, times the
    // cosine of the lean in the surface.
    let hollow = |x: f64| 0.2 * ((x - 6.0).powi(2) - 36.0) / (1.0 + 0.05 * (x - 6.0).powi(2));
    let (offset, notes) = offset_of(&hollow, "normal", 6.0);
    let worst = &offset["singular_places"][0];
    assert!(offset["singular_place_count"].as_u64().unwrap() >= 1, "{offset}");
    assert!((worst["at_mm"][0].as_f64().unwrap() - 6.0).abs() < 0.05, "{worst}");
    // A loft that follows its sections to 0.1 µm waves by some per cent of their curvature.
    let curvature = worst["curvature_per_mm"].as_f64().unwrap() / (1.12 * 20_f64.to_radians().cos());
    assert!((curvature - 1.0).abs() < 0.15, "{worst}");
    assert!(notes.contains("at least as hollow as the ball of 3 mm"), "{notes}");
    let small = offset_of(&hollow, "normal", 1.0).0;
    assert_eq!(small["singular_place_count"], 0);
}

/// How deep the published offset of a hollow that is narrower than the ball cuts, by brute force: of each
/// centre, its radius less its distance from the part.
#[test]
fn an_offset_that_crosses_itself_is_cut_as_it_is_and_judged() {
    let hollow = |x: f64| 0.2 * ((x - 6.0).powi(2) - 36.0) / (1.0 + 0.05 * (x - 6.0).powi(2));
    let slope = |x: f64| (hollow(x + 1e-6) - hollow(x - 1e-6)) / 2e-6;
    let lean = 20_f64.to_radians().tan();
    let radius = 3.0;
    // Through a centre, the part has the same section everywhere, moved by the lean: a place `up` higher lies
    // `up lean` farther.
    let distance = |centre: [f64; 2]| {
        let places =
            (0..=1200).flat_map(|k| (-120..=120).map(move |up| (0.01 * f64::from(k), 0.02 * f64::from(up))));
        let to = |(x, up): (f64, f64)| {
            ((x - centre[0]).powi(2) + (hollow(x) + lean * up - centre[1]).powi(2) + up * up).sqrt()
        };
        places.map(to).fold(f64::INFINITY, f64::min)
    };
    let depth = |k: i32| {
        let x = 0.05 * f64::from(k);
        let length = (1.0 + slope(x).powi(2)).sqrt();
        radius - distance([x - radius * slope(x) / length, hollow(x) + radius / length])
    };
    let deepest = (0..=240).map(depth).fold(0.0, f64::max);
    let path = path_of(&hollow, "published", 2.0 * radius);
    let found = path["gouge"]["max_depth_mm"].as_f64().unwrap();
    assert!((found / deepest - 1.0).abs() < 0.03, "{found} {deepest}");
    assert_eq!(path["verdict"], "fail");
    let trimmed = path_of(&hollow, "in-plane", 2.0 * radius)["gouge"]["max_depth_mm"].as_f64().unwrap();
    assert!(trimmed < 0.5 * found, "{trimmed} {found}");
}
