//! What a verdict covers: surface that upright tools see, walls, undersides, and parts of which nothing is
//! measured.

use std::path::Path;

use millstream::geometry::{Aabb, Point3};
use serde_json::Value;

use crate::support::{number, run_changed, run_scene, write_stl};

/// Triangles of the faces of a box, outward.
fn faces(low: [f64; 3], high: [f64; 3]) -> Vec<[Point3; 3]> {
    let (corners, triangles) = Aabb { min: low.into(), max: high.into() }.surface();
    triangles.iter().map(|t| t.map(|k| corners[k as usize])).collect()
}

/// A web 4 wide and 6 high under a plate of 16 by 4, 10 long: watertight.
fn tee() -> Vec<[Point3; 3]> {
    let profile = [[6, 0], [10, 0], [10, 6], [16, 6], [16, 10], [0, 10], [0, 6], [6, 6]];
    let at = |k: usize, y: f64| Point3::new(f64::from(profile[k][0]), y, f64::from(profile[k][1]));
    let sides = (0..8)
        .map(|a| (a, (a + 1) % 8))
        .flat_map(|(a, b)| [[at(a, 0.0), at(b, 10.0), at(a, 10.0)], [at(a, 0.0), at(b, 0.0), at(b, 10.0)]]);
    let caps = [[0, 1, 2], [0, 2, 7], [7, 2, 5], [7, 5, 6], [2, 4, 5], [2, 3, 4]];
    let ends = caps.iter().flat_map(|&[a, b, c]| {
        [[at(a, 0.0), at(b, 0.0), at(c, 0.0)], [at(a, 10.0), at(c, 10.0), at(b, 10.0)]]
    });
    sides.chain(ends).collect()
}

/// Runs an upright zigzag over some triangles: exit status and the report of the run.
fn run(triangles: &[[Point3; 3]], part: &str, further: &str) -> (i32, Value) {
    let folder = tempfile::tempdir().unwrap();
    write_stl(&folder.path().join("part.stl"), triangles);
    let scene = folder.path().join("part.toml");
    let text = format!(
        "[part]\nfile = \"part.stl\"\n{part}\n[cutter]\nshape = \"ball\"\ndiameter = 6\n{further}\n\
         [[toolpath]]\nstrategy = \"zigzag\"\nstepover = 0.4\n"
    );
    std::fs::write(&scene, text).unwrap();
    run_scene(&scene)
}

/// The parts of the surface sum up to the whole.
fn is_partition(coverage: &Value) {
    let area = |key: &str| number(coverage, &format!("/{key}_mm2"));
    let not_judged =
        ["walls", "facing_away", "hidden", "outside_stock", "out_of_reach"].map(area).iter().sum::<f64>();
    let measured = ["by_cells", "along_normals", "by_moves"].map(area).iter().sum::<f64>();
    assert!((area("surface") - area("judged") - not_judged).abs() < 1e-9 * area("surface"), "{coverage:#}");
    assert!((area("measured") - measured).abs() < 1e-9 && area("judged") == area("measured"), "{coverage:#}");
}

#[test]
fn a_tee_passes_on_its_top_and_fails_as_a_whole() {
    let (exit, report) = run(&tee(), "", "");
    let path = &report["toolpaths"][0];
    let coverage = &path["coverage"];
    is_partition(coverage);
    let walls = 10.0 * 2.0 * (6.0 + 4.0) + 2.0 * (4.0 * 6.0 + 16.0 * 4.0);
    assert_eq!((exit, &path["verdict"]), (0, &Value::from("pass")));
    for (key, exact) in [
        ("/surface_mm2", 320.0 + walls),
        ("/judged_mm2", 160.0),
        ("/walls_mm2", walls),
        ("/facing_away_mm2", 160.0),
    ] {
        assert!((number(coverage, key) - exact).abs() < 1e-3, "{key}: {coverage:#}");
    }
    assert_eq!(coverage["scope"], "on 23 % of the surface; not judged: walls 376 mm², facing away 160 mm²");

    let (exit, report) = run(&tee(), "judge = \"all\"", "");
    let path = &report["toolpaths"][0];
    is_partition(&path["coverage"]);
    assert_eq!(exit, 1);
    let uncut: Vec<&Value> =
        path["violations"].as_array().unwrap().iter().filter(|v| v["what"] == "uncut").collect();
    assert_eq!(uncut.len(), 1, "{:#}", path["violations"]);
    // The tool's radius is looked at; more stands there.
    assert!((number(uncut[0], "/measured_mm") - 3.0).abs() < 1e-9, "{:#}", uncut[0]);
    // Both sides of the web and both undersides; the other walls and the bottom end with the block.
    let area = number(&path["coverage"], "/unseen/uncut/area_mm2");
    assert!((area - 240.0).abs() < 12.0, "{area}");
    assert_eq!(path["coverage"]["scope"], "");
}

#[test]
fn the_walls_of_a_box_in_a_larger_block_are_uncut_and_hold_without_a_margin() {
    let block = faces([0.0, 0.0, 0.0], [12.0, 10.0, 5.0]);
    let (exit, report) = run(&block, "judge = \"all\"", "");
    assert_eq!(exit, 0, "{:#}", report["toolpaths"][0]["violations"]);
    let (exit, report) = run(&block, "judge = \"all\"", "[stock]\nmargin = 1.5");
    let unseen = &report["toolpaths"][0]["coverage"]["unseen"];
    assert_eq!(exit, 1);
    assert!((number(unseen, "/uncut/max_height_mm") - 1.5).abs() < 1e-9, "{unseen:#}");
    assert_eq!(run(&block, "", "[stock]\nmargin = 1.5").0, 0, "walls are not judged by default");
}

/// A block of 6 x 4 x 3 mm without one upright edge: there it has a face from 0.1 mm aside at the foot to 0.2
/// mm at the top, with all its corners on the sides of the block, so that material stands between them alone.
/// No pass comes there.
#[test]
fn what_stands_between_never_cut_places_is_in_the_bound() {
    let ring = |aside: f64, z: f64| {
        [[aside, 0.0], [6.0, 0.0], [6.0, 4.0], [0.0, 4.0], [0.0, aside]].map(|[x, y]| Point3::new(x, y, z))
    };
    let (foot, top) = (ring(0.1, 0.0), ring(0.2, 3.0));
    let side = |k: usize| {
        let next = (k + 1) % 5;
        [[foot[k], foot[next], top[next]], [foot[k], top[next], top[k]]]
    };
    let ends = (1..4).flat_map(|k| [[top[0], top[k], top[k + 1]], [foot[0], foot[k + 1], foot[k]]]);
    let part: Vec<[Point3; 3]> = (0..5).flat_map(side).chain(ends).collect();
    let folder = tempfile::tempdir().unwrap();
    write_stl(&folder.path().join("part.stl"), &part);
    let scene = folder.path().join("part.toml");
    let text = "[part]\nfile = \"part.stl\"\n[cutter]\nshape = \"flat\"\ndiameter = 4\n[stock]\nmargin = 0\n\
                [[toolpath]]\nstrategy = \"zigzag\"\nstepover = 3\n";
    std::fs::write(&scene, text).unwrap();
    let (exit, report) = run_scene(&scene);
    let uncut = &report["toolpaths"][0]["coverage"]["unseen"]["uncut"];
    let [highest, bound] = ["/max_height_mm", "/error_bound_mm"].map(|key| number(uncut, key));
    let truth = 0.2 / 2.0_f64.sqrt();
    assert_eq!(exit, 1);
    assert!(highest < truth + 1e-3 && highest + bound > truth, "{highest} {bound} {truth}");
}

/// Along the border of an offset surface normals lead out of the block at once, and moves go on beyond it:
/// what they leave around there is known as well as elsewhere.
#[test]
fn what_moves_leave_at_the_side_of_the_block_is_bounded() {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/sources/offset_12.toml");
    let sections = format!("sections = \"{}/", scene.parent().unwrap().display());
    let words = [["sections = \"", sections.as_str()]];
    let (exit, report) = run_changed(&scene, &words, |toolpath| toolpath.contains("along normals"));
    let excess = &report["toolpaths"][0]["excess"];
    let [highest, bound] = ["/max_mm", "/error_bound_mm"].map(|key| number(excess, key));
    assert!(exit == 0 && highest + bound < 0.06 && bound < 0.003, "{excess:#}");
}

#[test]
fn a_wave_is_judged_as_a_whole() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("wave.toml");
    let text = "[part]\nsurface = \"wave\"\namplitude = 1\nwavelength_x = 20\nx = [0, 10]\ny = [0, 10]\n\
                [cutter]\nshape = \"ball\"\ndiameter = 6\n[[toolpath]]\nstrategy = \"zigzag\"\nstepover = 0.4\n";
    std::fs::write(&scene, text).unwrap();
    let (exit, report) = run_scene(&scene);
    let coverage = &report["toolpaths"][0]["coverage"];
    is_partition(coverage);
    assert_eq!((exit, &coverage["scope"]), (0, &Value::from("")));
    assert_eq!(coverage["by_cells_mm2"], coverage["surface_mm2"]);
}

#[test]
fn a_soup_of_triangles_has_finite_figures_and_never_passes() {
    let mut state = 5u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        20.0 * (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let soup: Vec<[Point3; 3]> =
        (0..150).map(|_| [0, 1, 2].map(|_| Point3::new(random(), random(), random()))).collect();
    let (exit, report) = run(&soup, "", "[simulation]\ncell = 1.0\nerror_bound = 0.1");
    assert_eq!(exit, 1);
    is_partition(&report["toolpaths"][0]["coverage"]);
}
