//! The scenes that ship: their generated parts, and what their reports must say.

use std::path::{Path, PathBuf};

use millstream::geometry::{Point3, TriangleMesh};
use serde_json::Value;

use crate::support::{height_mesh, number, run_changed, run_scene, write_stl};

fn scene(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name)
}

/// Four soft bumps and two hollows on a plate of 40 × 40 mm.
fn relief() -> TriangleMesh {
    let bumps = [
        (10.0, 11.0, 7.0, 2.5),
        (29.0, 9.0, 6.0, 1.8),
        (31.0, 30.0, 8.0, 3.0),
        (11.0, 30.0, 6.5, -1.8),
        (20.0, 20.0, 6.0, 1.2),
        (37.0, 19.0, 6.0, -1.0),
    ];
    height_mesh(100, [40.0, 40.0], |x, y| {
        let bump = |&(cx, cy, width, height): &(f64, f64, f64, f64)| {
            height * (-((x - cx).powi(2) + (y - cy).powi(2)) / (width * width)).exp()
        };
        bumps.iter().map(bump).sum()
    })
}

/// A groove along y with walls at 30°, 30 × 20 mm; its corner runs along x = 15.
fn groove() -> TriangleMesh {
    height_mesh(2, [30.0, 20.0], |x, _| (x - 15.0).abs() * 30f64.to_radians().tan())
}

/// A plateau that falls to a lower floor over a sharp edge at x = 14: a wall of 55°, a fillet of
/// radius 5, the floor with a round hole of radius 4; all of it gently waved. 40 × 30 mm.
fn stepped() -> TriangleMesh {
    let (edge, slope, fillet, height) = (14.0, 55f64.to_radians(), 5.0, 4.0);
    let (hole, radius) = ([29.0, 15.0], 4.0);
    let fall = fillet * (1.0 - slope.cos());
    let foot = edge + (height - fall) / slope.tan();
    let profile = |x: f64| {
        if x <= edge {
            height
        } else if x < foot {
            height - (x - edge) * slope.tan()
        } else if x < foot + fillet * slope.sin() {
            let along = foot + fillet * slope.sin() - x;
            fillet - (fillet * fillet - along * along).sqrt()
        } else {
            0.0
        }
    };
    let z = |x: f64, y: f64| profile(x) + 0.6 * (0.21 * y).sin() + 0.3 * (0.25 * x + 0.1 * y).cos();
    // Columns a quarter as wide over wall and fillet: a ball stands off the edges between facets of a
    // hollow, by r (1/cos ½δ − 1) where they meet at the angle δ.
    let columns = (0..35).map(|i| 0.4 * f64::from(i));
    let columns = columns.chain((0..60).map(|i| 14.0 + 0.1 * f64::from(i)));
    let xs: Vec<f64> = columns.chain((0..=50).map(|i| 20.0 + 0.4 * f64::from(i))).collect();
    let (nx, ny, cell) = (xs.len() - 1, 75usize, 0.4);
    let mut points: Vec<[f64; 2]> =
        (0..=ny).flat_map(|j| xs.iter().map(move |&x| [x, cell * j as f64])).collect();
    let inside = |x: f64, y: f64| (x - hole[0]).hypot(y - hole[1]) < radius;
    let at = |i: usize, j: usize| j * (nx + 1) + i;
    let squares: Vec<[usize; 2]> = (0..ny)
        .flat_map(|j| (0..nx).map(move |i| [i, j]))
        .filter(|&[i, j]| !inside(0.5 * (xs[i] + xs[i + 1]), cell * (j as f64 + 0.5)))
        .collect();
    // Vertices of the hole's border move onto the circle.
    let mut squares_at = vec![0u8; points.len()];
    for &[i, j] in &squares {
        for k in [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)] {
            squares_at[k] += 1;
        }
    }
    for (k, p) in points.iter_mut().enumerate() {
        let inner = k % (nx + 1) > 0 && k % (nx + 1) < nx && k > nx && k < (nx + 1) * ny;
        if inner && (1..4).contains(&squares_at[k]) {
            let d = [p[0] - hole[0], p[1] - hole[1]];
            let stretch = radius / d[0].hypot(d[1]);
            *p = [hole[0] + d[0] * stretch, hole[1] + d[1] * stretch];
        }
    }
    let vertices = points.iter().map(|p| Point3::new(p[0], p[1], z(p[0], p[1]))).collect();
    let triangles = squares
        .iter()
        .flat_map(|&[i, j]| {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)].map(|k| k as u32);
            [[a, b, c], [a, c, d]]
        })
        .collect();
    TriangleMesh::new(vertices, triangles).unwrap().0
}

/// Slope of the pan's walls, rad.
const PAN_SLOPE: f64 = 20.0 * std::f64::consts::PI / 180.0;

/// A floor of 16 × 12 mm between four walls, 4 mm wide in the plan view, that rise from it at 20 degrees.
fn pan() -> TriangleMesh {
    let corner =
        |x: f64, y: f64, z: f64| [[-x, -y], [x, -y], [x, y], [-x, y]].map(|[x, y]| Point3::new(x, y, z));
    let vertices = [corner(8.0, 6.0, 0.0), corner(12.0, 10.0, 4.0 * PAN_SLOPE.tan())].concat();
    let wall = |k: u32| [[k, k + 4, (k + 1) % 4 + 4], [k, (k + 1) % 4 + 4, (k + 1) % 4]];
    let triangles = [[0, 1, 2], [0, 2, 3]].into_iter().chain((0..4).flat_map(wall)).collect();
    TriangleMesh::new(vertices, triangles).unwrap().0
}

/// Each part of a scene is what its generator makes; `MILLSTREAM_BLESS=1` writes them anew.
#[test]
fn mesh_parts_are_those_of_their_generators() {
    let parts =
        [("relief.stl", relief()), ("groove.stl", groove()), ("stepped.stl", stepped()), ("pan.stl", pan())];
    for (name, mesh) in parts {
        let path = scene(name);
        if std::env::var_os("MILLSTREAM_BLESS").is_some() {
            let triangles: Vec<[Point3; 3]> = (0..mesh.triangles().len()).map(|t| mesh.corners(t)).collect();
            write_stl(&path, &triangles);
        }
        let (shipped, notes) = millstream::io::stl::read(&path).unwrap();
        assert!(notes.is_clean() || notes.to_string().contains("merged"), "{name}: {notes}");
        assert_eq!(shipped.triangles().len(), mesh.triangles().len(), "{name}");
        for t in 0..mesh.triangles().len() {
            for (a, b) in shipped.corners(t).iter().zip(mesh.corners(t)) {
                assert!((a - b).norm() < 1e-5, "{name}, triangle {t}");
            }
        }
    }
}

/// Runs a shipped scene and returns its exit status and report.
fn run(name: &str) -> (i32, Value) {
    run_scene(&scene(name))
}

/// What every streamline of a shipped scene must reach, and every other strategy as well.
fn assert_good(name: &str, report: &Value) {
    for toolpath in report["toolpaths"].as_array().unwrap() {
        let what = format!("{name}, {}", toolpath["name"]);
        let target = number(toolpath, "/scallop/target_mm");
        assert!(number(toolpath, "/scallop/max_mm") <= 1.25 * target, "{what}");
        assert!(number(toolpath, "/scallop/over_target_fraction") <= 0.05, "{what}");
        assert!(number(toolpath, "/gouge/max_depth_mm") <= 0.005, "{what}");
        assert_eq!(number(toolpath, "/uncut/area_mm2"), 0.0, "{what}");
    }
}

fn length(report: &Value, toolpath: usize) -> f64 {
    number(report, &format!("/toolpaths/{toolpath}/path/cutting_length_mm"))
}

#[test]
fn plate_reports_the_closed_form() {
    let (status, report) = run("plate.toml");
    assert_eq!(status, 0);
    for k in 0..2 {
        let max = number(&report, &format!("/toolpaths/{k}/scallop/max_mm"));
        assert!((max / 0.0104348 - 1.0).abs() < 1e-3, "{max}");
    }
}

/// A shipped scene with other words, and those of its toolpaths that are wanted.
fn run_with(name: &str, words: &[[&str; 2]], wanted: impl Fn(&str) -> bool) -> (i32, Value) {
    run_changed(&scene(name), words, wanted)
}

fn wave_is_good((status, report): (i32, Value)) {
    assert_eq!(status, 0);
    assert_good("wave", &report);
    assert!(length(&report, 1) < 0.95 * length(&report, 0), "{} {}", length(&report, 1), length(&report, 0));
}

/// An eighth of it, one wave long and half a wave wide, in coarser cells.
#[test]
fn wave_streamlines_are_good_and_shorter_than_zigzag() {
    let eighth = [
        ["cell = 0.05", "cell = 0.2"],
        ["x = [0.0, 100.0]", "x = [0.0, 50.0]"],
        ["y = [0.0, 100.0]", "y = [0.0, 25.0]"],
    ];
    wave_is_good(run_with("wave.toml", &eighth, |_| true));
}

#[test]
#[ignore = "minutes: four million cells, cut and measured twice"]
fn wave_streamlines_are_good_and_shorter_than_zigzag_as_shipped() {
    wave_is_good(run("wave.toml"));
}

/// A mesh with a sharp edge and a hole.
#[test]
fn streamlines_on_a_stepped_mesh_are_good() {
    let (status, report) = run_with("stepped.toml", &[["cell = 0.05", "cell = 0.1"]], |_| true);
    assert_eq!(status, 0);
    assert_good("stepped", &report);
}

#[test]
#[ignore = "minutes: six parts, cut by two to five toolpaths each"]
fn the_other_parts_are_good() {
    for name in [
        "pit_and_crest.toml",
        "ridge.toml",
        "relief.toml",
        "stepped.toml",
        "joined.toml",
        "rough_finish_rest.toml",
    ] {
        let (status, report) = run(name);
        assert_eq!(status, 0, "{name}");
        assert_good(name, &report);
    }
}

/// A hollow of three tools: what they leave together passes, the second alone leaves ten times the target, and
/// the third goes no farther than it has to.
#[test]
fn three_tools_rough_finish_and_cut_the_rest() {
    let part = [
        ["x = [0, 40]", "x = [2, 18]"],
        ["y = [0, 40]", "y = [1, 12]"],
        ["[stock]", "[tolerance]\nscallop = 0.02\n[stock]"],
    ];
    let (status, report) = run_with("rough_finish_rest.toml", &part, |_| true);
    assert_eq!(status, 0, "{report}");
    let [rough, finish, rest] = [0, 1, 2].map(|k| &report["toolpaths"][k]);
    assert!((number(rough, "/deviation/min_mm") - 0.3).abs() < 0.002, "{}", rough["deviation"]);
    assert!(number(finish, "/excess/max_mm") > 0.1, "{}", finish["excess"]);
    assert!(number(rest, "/excess/max_mm") <= 0.02, "{}", rest["excess"]);
    assert!(length(&report, 2) < 0.5 * length(&report, 1), "{} {}", length(&report, 1), length(&report, 2));
}

/// Passes that leave the part over its border and come back: no move leads from one side to the other.
#[test]
fn streamlines_of_a_wide_cutter_do_not_cut_across_a_corner() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("across.toml");
    let text = format!(
        "[part]\nsurface = \"nurbs\"\nfile = \"{}\"\n[cutter]\nshape = \"bull\"\ndiameter = 8\ncorner_radius = 2\n\
         [tolerance]\nscallop = 0.3\nchord = 0.03\ngouge = 0.15\nuncut = 0.6\ncorrect = false\n\
         [[toolpath]]\nstrategy = \"streamline\"\n",
        scene("compare/blade_side.json").display()
    );
    std::fs::write(&path, text).unwrap();
    let (_, report) = run_scene(&path);
    let gouge = &report["toolpaths"][0]["gouge"];
    assert!(number(gouge, "/max_depth_mm") + number(gouge, "/error_bound_mm") <= 0.15, "{gouge}");
}

/// The ball touches both sides of each crease, at r tan(δ/2) beside it, δ the angle between the sides'
/// normals; there the crease lies r (1 − √(1 − tan²(δ/2))) below it along either normal.
fn creases_have_passes_of_their_own((status, report): (i32, Value)) {
    assert_eq!(status, 0);
    assert_good("pan", &report);
    let toolpath = &report["toolpaths"][0];
    let notes = toolpath["notes"].to_string();
    let (before, _) =
        notes.split_once(" mm of passes run along creases").unwrap_or_else(|| panic!("{notes}"));
    let along: f64 = before.rsplit(['"', ' ']).next().unwrap().parse().unwrap();
    // Once around the floor, and from each of its corners to the rim; the ball's centre a little less.
    let creases = 4.0 * (8.0 + 6.0) + 4.0 * 4.0 * (2.0 + PAN_SLOPE.tan().powi(2)).sqrt();
    assert!((0.95 * creases..=creases).contains(&along), "{along} {creases}");
    // The steepest ones lie between walls: their normals' product is cos² of the slope.
    let between = PAN_SLOPE.cos().powi(2).acos();
    let left = 1.25 * (1.0 - (1.0 - (0.5 * between).tan().powi(2)).sqrt());
    let highest = number(toolpath, "/deviation/max_mm");
    assert!((highest - left).abs() < 5e-4, "{highest} {left}");
}

#[test]
fn creases_of_a_mesh_have_passes_of_their_own() {
    creases_have_passes_of_their_own(run_with("pan.toml", &[], |toolpath| toolpath.contains("\"upright\"")));
}

#[test]
#[ignore = "minutes: a tool that leans"]
fn creases_of_a_mesh_have_passes_of_their_own_leaning_as_well() {
    creases_have_passes_of_their_own(run("pan.toml"));
}

/// A hole whose rim has slivers folded under it: the ball does not climb into it, and the target is held
/// everywhere.
#[test]
fn an_offset_surface_ends_at_the_rim_of_a_hole() {
    let home = tempfile::tempdir().unwrap();
    std::fs::copy(scene("stepped.stl"), home.path().join("stepped.stl")).unwrap();
    let text = std::fs::read_to_string(scene("stepped.toml")).unwrap();
    let head = text[..text.find("[[toolpath]]").unwrap()].replace("cell = 0.05", "cell = 0.1");
    let path = home.path().join("rim.toml");
    std::fs::write(&path, format!("{head}[[toolpath]]\nstrategy = \"offset-surface\"\nangle = 0\n")).unwrap();
    let (status, report) = run_scene(&path);
    assert_eq!(status, 0, "{:#}", report["toolpaths"][0]["violations"]);
    assert_good("rim", &report);
}

#[test]
fn groove_fails_for_its_uncut_corner() {
    let (status, report) = run("groove.toml");
    assert_eq!(status, 1);
    let toolpath = &report["toolpaths"][0];
    assert_eq!(toolpath["verdict"], "fail");
    let region = &toolpath["uncut"]["regions"][0];
    assert!((number(region, "/at_mm/0") - 15.0).abs() < 0.2, "the corner runs along x = 15: {region}");
    // The ball of radius 3 stands 0.5505 mm from a wall's foot, measured along the wall's normal.
    let height = number(region, "/height_mm");
    assert!((0.50..=0.5506).contains(&height), "{height}");
    assert!(number(toolpath, "/gouge/max_depth_mm") <= 0.005);
}

#[test]
fn coarse_chords_fail_for_their_gouges() {
    let (status, report) = run("coarse_chords.toml");
    assert_eq!(status, 1);
    let toolpath = &report["toolpaths"][0];
    let depth = number(toolpath, "/gouge/max_depth_mm");
    assert!(depth > 0.005 && depth <= 0.030 + 1e-6, "not deeper than the chord tolerance: {depth}");
    let region = &toolpath["gouge"]["regions"][0];
    assert!(number(region, "/line") > 1.0);
}

/// Nothing is gouged, on the floor or beyond the walls, nothing is left but in corners, and no rapid runs in
/// stock.
fn is_cleared_to_its_walls(pocket: &str, (status, report): &(i32, Value)) {
    assert_eq!(*status, 0, "{pocket}");
    for t in report["toolpaths"].as_array().unwrap() {
        let what = format!("{pocket}, {}", t["name"]);
        assert_eq!(number(t, "/uncut/area_mm2"), 0.0, "{what}");
        assert!(number(t, "/gouge/max_depth_mm") < 1e-3, "{what}");
        let bound = number(t, "/pocket/wall_gouge_error_bound_mm");
        // Half of the chord tolerance is the passes'.
        assert!(number(t, "/pocket/wall_gouge_mm") <= 0.0025 && bound <= 0.0025, "{what}");
        assert!(number(t, "/pocket/wall_gouge_of_cells_mm") <= 1e-6, "{what}");
        assert_eq!(number(t, "/removal/rapid_contact_count"), 0.0, "{what}");
        assert!(number(t, "/removal/max_axial_engagement_mm") <= 4.001, "{what}");
    }
}

/// The flow has less of its length in too much stock than plain offsets of the walls have.
fn flow_is_smoother_than_offsets(run: &(i32, Value)) {
    is_cleared_to_its_walls("bracket", run);
    let over = |strategy: &str| {
        let t = run.1["toolpaths"].as_array().unwrap().iter().find(|t| t["strategy"] == strategy).unwrap();
        number(t, "/pocket/over_engagement_limit_fraction")
    };
    assert!(over("pocket-flow") < over("pocket-offset"));
}

#[test]
fn a_pocket_with_islands_is_cleared_by_every_strategy() {
    flow_is_smoother_than_offsets(&run_with("bracket.toml", &[], |toolpath| !toolpath.contains("smoothing")));
}

#[test]
#[ignore = "minutes: smooth flow in a pocket with islands"]
fn a_pocket_with_islands_is_cleared_by_smooth_flow_as_well() {
    flow_is_smoother_than_offsets(&run("bracket.toml"));
}

/// Passes from vectors, along walls and from guides clear a pocket with an island, and keep to
/// what was asked for where nothing turns around a point.
#[test]
fn a_pocket_is_cleared_along_vectors_walls_and_guides() {
    let (status, report) = run("sources/pocket_vectors.toml");
    let toolpaths = report["toolpaths"].as_array().unwrap();
    assert_eq!((status, toolpaths.len()), (0, 5));
    for t in toolpaths {
        assert_eq!(number(t, "/uncut/area_mm2"), 0.0, "{}", t["name"]);
        // Walls askew are met to the decimals of the program; the ends of traced lines to a tenth of the
        // chord tolerance.
        let most = if t["name"] == "vectors, traced" { 0.1 * 0.005 } else { 5e-5 };
        assert!(number(t, "/pocket/wall_gouge_mm") < most, "{}", t["name"]);
    }
    let named = |name: &str| toolpaths.iter().find(|t| t["name"] == name).unwrap();
    let off = |name: &str| named(name)["field"]["direction_error_rms_deg"].as_f64().unwrap();
    // Along the guides themselves, which bend more tightly than passes beside them.
    let most = [("vectors", 5.0), ("vectors, traced", 5.0), ("along the walls", 10.0), ("guides", 3.5)];
    for (name, most) in most {
        assert!(off(name) < most, "{name}: {}", off(name));
    }
    assert!(named("parallel").get("field").is_none());
}

/// Beyond open sides, and where a larger cutter was, no stock stands: passes begin there, without a helix or
/// little of one.
#[test]
fn open_pockets_and_corners_left_by_a_larger_cutter_are_cleared() {
    for (scene, limit) in [("open_step", 70.0), ("rest_corners", 60.0)] {
        let run = run(&format!("{scene}.toml"));
        is_cleared_to_its_walls(scene, &run);
        let t = &run.1["toolpaths"][0];
        let greatest = number(t, "/pocket/max_engagement_deg");
        assert!(greatest > limit - 5.0 && greatest <= limit, "{scene}: {greatest}");
    }
    // In each of five square corners a radius of 6 mm leaves more than one of 2.5 mm does.
    let rest = &run("rest_corners.toml").1["toolpaths"][0];
    let left = 5.0 * (1.0 - std::f64::consts::FRAC_PI_4) * (36.0 - 6.25) * 4.0;
    let (removed, bound) =
        (number(rest, "/removal/volume_mm3"), number(rest, "/removal/volume_error_bound_mm3"));
    assert!((removed - left).abs() < bound && bound < 0.2 * left, "{removed} {left} {bound}");
}

/// Where the scene bounds the engagement it is measured there, and nearly all of it is used.
#[test]
fn a_tray_is_cleared_to_its_walls_within_the_engagement() {
    let run = run("tray.toml");
    is_cleared_to_its_walls("tray", &run);
    for t in run.1["toolpaths"].as_array().unwrap() {
        let greatest = number(t, "/pocket/max_engagement_deg");
        let bound = number(t, "/pocket/max_engagement_error_bound_deg");
        assert!(greatest > 75.0 && greatest + bound <= 80.0, "{}: {greatest} ± {bound}", t["name"]);
        // No feed is so low that the cutter stands still: at half the feed it would take no longer.
        let (time, length) = (number(t, "/path/machining_time_s"), number(t, "/path/cutting_length_mm"));
        assert!(time > 60.0 * length / 1000.0 && time < 120.0 * length / 1000.0, "{}: {time} s", t["name"]);
    }
    // From both sides of a corner of angle 2a the disc leaves r²/tan a less its sector r²(π/2 − a).
    let corner = |a: f64| 16.0 * (1.0 / a.tan() - (std::f64::consts::FRAC_PI_2 - a));
    let slant = 20f64.atan2(10.0);
    let exact = 4.0 * corner(0.5 * (std::f64::consts::PI - slant)) + 2.0 * corner(slant);
    let found = number(&run.1, "/toolpaths/0/pocket/unreachable_area_mm2");
    assert!((found - exact).abs() < 0.15, "{found} {exact}");
}
