//! Meshes that are no surface: upright cutters plan on them and measure them, what needs two sides refuses
//! them, and what nobody saw is never passed.

use std::path::Path;

use millstream::geometry::Point3;
use serde_json::Value;

use crate::command::{Answer, millstream};
use crate::support::{number, write_stl};

const SCENE: &str = "[part]\nfile = \"part.stl\"\n[cutter]\nshape = \"ball\"\ndiameter = 6\n[tolerance]\nscallop = 0.011\n\
                     [simulation]\ncell = 0.1\n[[toolpath]]\nstrategy = \"zigzag\"\nstepover = 0.5\n";

fn quad(a: [f64; 3], b: [f64; 3], c: [f64; 3], d: [f64; 3]) -> [[Point3; 3]; 2] {
    let [a, b, c, d] = [a, b, c, d].map(Point3::from);
    [[a, b, c], [a, c, d]]
}

/// A level plate of 8 x 6 mm in two halves, with a fin below the edge between them.
fn plate_with_a_fin() -> Vec<[Point3; 3]> {
    let halves = [(0.0, 4.0), (4.0, 8.0)];
    let half = |(x0, x1)| quad([x0, 0.0, 0.0], [x1, 0.0, 0.0], [x1, 6.0, 0.0], [x0, 6.0, 0.0]);
    let fin = quad([4.0, 0.0, 0.0], [4.0, 6.0, 0.0], [4.0, 6.0, -2.0], [4.0, 0.0, -2.0]);
    halves.into_iter().flat_map(half).chain(fin).collect()
}

/// A box whose triangles face inward.
fn inside_out([x0, x1]: [f64; 2], [y0, y1]: [f64; 2], [z0, z1]: [f64; 2]) -> Vec<[Point3; 3]> {
    let corner = |i: usize| [[x0, x1][i & 1], [y0, y1][i >> 1 & 1], [z0, z1][i >> 2]];
    let outward = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    outward.into_iter().flat_map(|[a, b, c, d]| quad(corner(d), corner(c), corner(b), corner(a))).collect()
}

fn run(home: &Path, triangles: &[[Point3; 3]], scene: &str, arguments: &[&str]) -> Answer {
    write_stl(&home.join("part.stl"), triangles);
    std::fs::write(home.join("scene.toml"), scene).unwrap();
    millstream(home, &[&["run", "scene.toml", "--out", "out"], arguments].concat())
}

#[test]
fn upright_cutters_plan_and_measure_where_three_triangles_meet() {
    let home = tempfile::tempdir().unwrap();
    let answer = run(home.path(), &plate_with_a_fin(), SCENE, &[]);
    assert_eq!(answer.code, Some(0), "{answer:?}");
    let report = std::fs::read_to_string(home.path().join("out/report.json")).unwrap();
    assert!(report.contains("left 1 edge open where more than two triangles meet"), "{report}");
}

/// Streamlines and fronts take such an edge for a border of the surface on each side of it.
#[test]
fn fields_end_where_three_triangles_meet() {
    for strategy in ["streamline", "iso-scallop", "streamline\"\ndirection = { angle = 30 }\nname = \"askew"]
    {
        let home = tempfile::tempdir().unwrap();
        let scene = SCENE.replace("zigzag\"\nstepover = 0.5\n", &format!("{strategy}\"\n"));
        let answer = run(home.path(), &plate_with_a_fin(), &scene, &[]);
        assert_eq!(answer.code, Some(0), "{strategy}: {answer:?}");
    }
}

#[test]
fn what_needs_two_sides_says_so() {
    let home = tempfile::tempdir().unwrap();
    let tilted = format!("{SCENE}axis = {{ lead = 10 }}\n");
    for (scene, arguments) in [(tilted.as_str(), vec![]), (SCENE, vec!["--engine", "rays"])] {
        let answer = run(home.path(), &plate_with_a_fin(), scene, &arguments);
        assert_ne!(answer.code, Some(0), "{answer:?}");
        let said = format!("{}{}", answer.stdout, answer.stderr);
        let said = said.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
        assert!(said.contains("3 triangles") && said.contains("the part is no surface"), "{said}");
    }
}

/// The box stands on the plate; its top faces down. No cell measures that, so that the whole does not pass.
#[test]
fn a_soup_seen_from_its_back_does_not_pass() {
    let home = tempfile::tempdir().unwrap();
    let mut triangles = plate_with_a_fin();
    triangles.extend(inside_out([1.0, 3.0], [1.0, 5.0], [0.5, 1.5]));
    let answer = run(home.path(), &triangles, SCENE, &[]);
    assert_eq!(answer.code, Some(1), "{answer:?}");
}

/// A block of a size at its top whose walls lean by an angle, degrees, without an underside.
fn drafted_block([x, y, z]: [f64; 3], draft: f64) -> Vec<[Point3; 3]> {
    let ([x, y], out) = ([0.5 * x, 0.5 * y], z * draft.to_radians().tan());
    let ring = |x: f64, y: f64, z: f64| [[-x, -y, z], [x, -y, z], [x, y, z], [-x, y, z]];
    let (foot, top) = (ring(x + out, y + out, 0.0), ring(x, y, z));
    let wall = |k: usize| quad(foot[k], foot[(k + 1) % 4], top[(k + 1) % 4], top[k]);
    let [a, b, c, d] = top;
    (0..4).flat_map(wall).chain(quad(a, b, c, d)).collect()
}

/// Walls that lean by half a degree to three are a narrow band seen from above. Contours follow them, one
/// strip from the next, and with another strategy on the top the part passes, every place of it measured; the
/// contours alone leave the top, and say so.
#[test]
fn walls_of_a_mesh_that_the_plan_view_hardly_shows_are_cut_and_judged() {
    for draft in [0.5, 3.0] {
        let home = tempfile::tempdir().unwrap();
        let stage =
            |strategy: &str| format!("[[toolpath]]\nname = \"{strategy}\"\nstrategy = \"{strategy}\"\n");
        let head = SCENE
            .split("[[toolpath]]")
            .next()
            .unwrap()
            .replace("[simulation]", "[stock]\nmargin = 4\n[simulation]");
        let scene = format!("{head}{}{}stock = \"previous\"\n", stage("streamline"), stage("waterline"),);
        let answer = run(home.path(), &drafted_block([20.0, 14.0, 8.0], draft), &scene, &[]);
        assert_eq!(answer.code, Some(0), "{draft}: {answer:?}");
        let report = std::fs::read_to_string(home.path().join("out/report.json")).unwrap();
        let report: serde_json::Value = serde_json::from_str(&report).unwrap();
        let [top, walls] = [0, 1].map(|k| &report["toolpaths"][k]);
        let strip = 2.0 * (2.0 * 3.0 * 0.011_f64 - 0.011 * 0.011).sqrt();
        let passes = walls["path"]["passes"].as_f64().unwrap();
        let whole = 8.0 / draft.to_radians().cos() / strip;
        assert!(passes >= whole && passes < 1.05 * whole + 3.0, "{draft}: {passes}");
        // What was left on walls that it does not cut makes no other passes.
        let length = top["path"]["cutting_length_mm"].as_f64().unwrap();
        assert!(length < 2.0 * 280.0 / strip, "{draft}: {length}");
        let excess = &walls["excess"];
        let (highest, bound) =
            (excess["max_mm"].as_f64().unwrap(), excess["error_bound_mm"].as_f64().unwrap());
        assert!(highest > 0.009 && highest + bound <= 0.011, "{draft}: {highest} {bound}");
        assert!(walls.to_string().contains("so level that contours do not cover them"), "{walls}");
        let coverage = &walls["coverage"];
        let (judged, whole) =
            (coverage["judged_mm2"].as_f64().unwrap(), coverage["surface_mm2"].as_f64().unwrap());
        assert!((judged - whole).abs() < 1e-6, "{draft}: {judged} {whole}");
    }
}

/// Waterlines of a flat end show no ridge in the plan view: what they leave on walls of 3 degrees is measured
/// along the normals, and corrected where it stands too high, in the stock that the toolpath on the top left.
#[test]
fn what_toolpaths_leave_together_is_corrected() {
    let home = tempfile::tempdir().unwrap();
    let scene = "[part]\nfile = \"part.stl\"\n[cutter]\nshape = \"flat\"\ndiameter = 2\n[tolerance]\nscallop = 0.01\n[stock]\nmargin = 1\n\
                 [[toolpath]]\nname = \"top\"\nstrategy = \"streamline\"\n\
                 [[toolpath]]\nname = \"walls\"\nstrategy = \"waterline\"\nstock = \"previous\"\n";
    let answer = run(home.path(), &drafted_block([1.2, 1.0, 0.6], 3.0), scene, &[]);
    assert_eq!(answer.code, Some(0), "{answer:?}");
    let report = std::fs::read_to_string(home.path().join("out/report.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    let rounds = report["toolpaths"][1]["correction"]["rounds"].as_array().unwrap();
    let highest = |k: usize| rounds[k]["border_mm"].as_f64().or(rounds[k]["highest_mm"].as_f64()).unwrap();
    assert!(rounds.len() > 1 && highest(0) > 0.01 && highest(rounds.len() - 1) < 0.01, "{rounds:?}");
}

/// A zigzag for the top of such a block and contours for its walls, each asked for by its slopes: both pass,
/// in a fraction of the time of a zigzag that brings its passes as near as the walls ask for.
#[test]
fn level_ground_and_walls_are_shared_by_slope() {
    let home = tempfile::tempdir().unwrap();
    let run_with = |top: &str, walls: &str| {
        let scene = format!(
            "[part]\nfile = \"part.stl\"\n[cutter]\nshape = \"ball\"\ndiameter = 4\n[tolerance]\nscallop = 0.01\n[stock]\nmargin = 4\n\
             [[toolpath]]\nname = \"top\"\nstrategy = \"zigzag\"\n{top}\n\
             [[toolpath]]\nname = \"walls\"\nstrategy = \"waterline\"\nstock = \"previous\"\n{walls}\n"
        );
        let answer = run(home.path(), &drafted_block([3.0, 3.0, 1.5], 7.0), &scene, &[]);
        assert_eq!(answer.code, Some(0), "{answer:?}");
        let report = std::fs::read_to_string(home.path().join("out/report.json")).unwrap();
        let report: serde_json::Value = serde_json::from_str(&report).unwrap();
        let minutes = |k: usize| report["toolpaths"][k]["path"]["machining_time_s"].as_f64().unwrap();
        let coverage = &report["toolpaths"][1]["coverage"];
        assert_eq!(coverage["judged_mm2"], coverage["surface_mm2"]);
        assert!(!report["toolpaths"][1]["notes"].to_string().contains("so level"), "{report}");
        minutes(0) + minutes(1)
    };
    let shared = run_with("slope = [0, 45]", "slope = [45, 90]");
    assert!(shared < 45.0, "{shared}");
}

/// A frustum a hundred metres from the origin, where coordinates are known to some 1e-11 mm, is measured as
/// one beside it.
#[test]
fn far_from_the_origin_a_part_is_measured_as_beside_it() {
    let scene = SCENE.replace("part.stl", "part.obj").replace("diameter = 6", "diameter = 2");
    let at = |away: f64| {
        let home = tempfile::tempdir().unwrap();
        let ring = |half: f64, z: f64| {
            [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
                .map(|[x, y]| format!("v {} {} {z}\n", away + half * x, away + half * y))
        };
        let corners = [ring(2.0, 0.0), ring(1.0, 1.5)].concat().concat();
        let faces = "f 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\nf 4 3 2 1\n";
        std::fs::write(home.path().join("part.obj"), corners + faces).unwrap();
        std::fs::write(home.path().join("scene.toml"), &scene).unwrap();
        let answer = millstream(home.path(), &["run", "scene.toml", "--out", "out"]);
        let report = std::fs::read_to_string(home.path().join("out/report.json"));
        let report: Value = serde_json::from_str(&report.unwrap_or_else(|_| panic!("{answer:?}"))).unwrap();
        ["excess", "gouge"].map(|figure| {
            let key = if figure == "gouge" { "max_depth_mm" } else { "max_mm" };
            number(&report, &format!("/toolpaths/0/{figure}/{key}"))
        })
    };
    let [[high, deep], [far_high, far_deep]] = [at(0.0), at(1e5)];
    assert!(
        (high - far_high).abs() < 2e-4 && (deep - far_deep).abs() < 2e-4,
        "{high} {far_high} {deep} {far_deep}"
    );
}
