//! Five axes: the scenes that ship (`scenes/five_axes`), and what their reports must say.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::support::{is_good, number, patch, run_scene};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/five_axes")
}

/// A cap of a ball of radius 20, 22 mm square: 51 degrees steep at its corners.
fn dome() -> Value {
    patch([14, 14], |u, v| {
        let (x, y) = (22.0 * u - 11.0, 22.0 * v - 11.0);
        [x, y, (400.0 - x * x - y * y).sqrt() - 20.0]
    })
}

/// 28 mm wide and 30 mm deep, with walls of up to 83 degrees.
fn trough() -> Value {
    patch([24, 4], |u, v| {
        let s = 2.0 * u - 1.0;
        [14.0 * s, 20.0 * v, 30.0 * s.powi(4)]
    })
}

/// From 20 degrees beside the top of a cylinder of radius 15 to 30 degrees below its side.
fn lip() -> Value {
    patch([16, 4], |u, v| {
        let angle = (120.0 - 100.0 * u).to_radians();
        [15.0 * angle.sin(), 20.0 * v, 15.0 * angle.cos()]
    })
}

/// Each part of a scene is what its generator makes; `MILLSTREAM_BLESS=1` writes them anew.
#[test]
fn parts_are_those_of_their_generators() {
    for (name, part) in [("dome", dome()), ("trough", trough()), ("lip", lip())] {
        let path = folder().join(name).with_extension("json");
        if std::env::var_os("MILLSTREAM_BLESS").is_some() {
            std::fs::write(&path, part.to_string() + "\n").unwrap();
        }
        let shipped: Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
        assert_eq!(shipped, part, "{name}");
    }
}

/// From pass to pass the tool stays near: around the part, the air is 0.6 to 3 times as long as all passes.
fn stays_near(path: &Value) {
    let [air, cutting] = ["/path/air_length_mm", "/path/cutting_length_mm"].map(|key| number(path, key));
    assert!(air < 0.35 * cutting, "{}: {air} mm of air for {cutting} mm cut", path["name"]);
}

#[test]
fn a_lead_makes_passes_on_a_dome_wider() {
    let (_, report) = run_scene(&folder().join("dome.toml"));
    let [upright, lead] = [0, 1].map(|k| &report["toolpaths"][k]);
    assert_eq!(
        (&upright["simulation"]["engine"], &lead["simulation"]["engine"]),
        (&"zmap".into(), &"rays".into())
    );
    is_good(lead);
    stays_near(lead);
    let length = |path: &Value| number(path, "/path/cutting_length_mm");
    assert!(length(lead) < 0.7 * length(upright), "{} {}", length(lead), length(upright));
}

#[test]
fn a_lip_is_cut_from_the_side_below_its_widest_place() {
    let (_, report) = run_scene(&folder().join("lip.toml"));
    for path in report["toolpaths"].as_array().unwrap() {
        is_good(path);
        stays_near(path);
        // The area of 100 degrees of the cylinder.
        let area = 15.0 * 100f64.to_radians() * 20.0;
        assert!((number(path, "/deviation/area_mm2") / area - 1.0).abs() < 0.01, "{:#}", path["deviation"]);
    }
}

#[test]
fn a_holder_that_leans_away_from_the_walls_is_clear_of_them() {
    let (code, report) = run_scene(&folder().join("trough.toml"));
    let [upright, leaning] = [0, 1].map(|k| &report["toolpaths"][k]);
    assert_eq!(
        (code, &upright["violations"][0]["what"]),
        (1, &"collision".into()),
        "{:#}",
        upright["violations"]
    );
    assert!(number(upright, "/violations/0/measured_mm") > 1.0);
    assert_eq!(leaning["verdict"], "pass", "{:#}", leaning["violations"]);
    is_good(leaning);
    stays_near(leaning);
}

/// The same upright path under two engines that share no code: heights on a grid, and rays along normals.
#[test]
fn rays_measure_what_the_z_map_does() {
    let home = tempfile::tempdir().unwrap();
    let measured = |engine: &str| {
        let scene = format!(
            "[part]\nsurface = \"wave\"\namplitude = 0.5\nwavelength_x = 20\nwavelength_y = 24\nx = [0, 12]\ny = [0, 12]\n\
             [cutter]\nshape = \"ball\"\ndiameter = 6\n\
             [simulation]\ncell = 0.05\nengine = \"{engine}\"\n[[toolpath]]\nstrategy = \"iso-parametric\"\n"
        );
        let path = home.path().join(format!("{engine}.toml"));
        std::fs::write(&path, scene).unwrap();
        let (_, report) = run_scene(&path);
        report["toolpaths"][0].clone()
    };
    let [map, rays] = ["zmap", "rays"].map(measured);
    let both = |figure: &str| [number(&map, figure), number(&rays, figure)];
    let within = |figure: &str, bound: &str| {
        let ([a, b], [x, y]) = (both(figure), both(bound));
        assert!((a - b).abs() <= x + y, "{figure}: {a} ± {x}, {b} ± {y}");
    };
    within("/scallop/max_mm", "/scallop/error_bound_mm");
    within("/gouge/max_depth_mm", "/gouge/error_bound_mm");
    for (figure, share) in [
        ("/scallop/p50_mm", 1e-3),
        ("/scallop/p95_mm", 1e-3),
        ("/scallop/mean_mm", 1e-3),
        ("/scallop/ridge_length_mm", 1e-3),
        ("/deviation/area_mm2", 1e-5),
        ("/deviation/rms_mm", 5e-3),
    ] {
        let [a, b] = both(figure);
        assert!((a / b - 1.0).abs() < share, "{figure}: {a} {b}");
    }
}
