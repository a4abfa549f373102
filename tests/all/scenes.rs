//! The scenes that ship: their generated parts, and what their reports must say.

use std::path::{Path, PathBuf};
use std::process::Command;

use millstream::geometry::{Point3, TriangleMesh};
use serde_json::Value;

fn scene(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name)
}

/// A grid of `n` × `n` squares over `[0, size]²`, each split in two.
fn height_mesh(n: usize, size: [f64; 2], height: impl Fn(f64, f64) -> f64) -> TriangleMesh {
    let at = |c: usize, k: usize| size[c] * k as f64 / n as f64;
    let vertices: Vec<Point3> = (0..=n)
        .flat_map(|j| (0..=n).map(move |i| (i, j)))
        .map(|(i, j)| Point3::new(at(0, i), at(1, j), height(at(0, i), at(1, j))))
        .collect();
    let k = |i: usize, j: usize| (j * (n + 1) + i) as u32;
    let triangles = (0..n)
        .flat_map(|j| (0..n).map(move |i| (i, j)))
        .flat_map(|(i, j)| [[k(i, j), k(i + 1, j), k(i + 1, j + 1)], [k(i, j), k(i + 1, j + 1), k(i, j + 1)]])
        .collect();
    TriangleMesh::new(vertices, triangles).unwrap().0
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

/// Each part of a scene is what its generator makes; `MILLSTREAM_BLESS=1` writes them anew.
#[test]
fn mesh_parts_are_those_of_their_generators() {
    for (name, mesh) in [("relief.stl", relief()), ("groove.stl", groove())] {
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
    let out = tempfile::tempdir().unwrap();
    let folder = out.path().join("out");
    let output = Command::new(env!("CARGO_BIN_EXE_millstream"))
        .arg("run")
        .arg(scene(name))
        .arg("--out")
        .arg(&folder)
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    println!("{text}");
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(errors.is_empty(), "{name}: {errors}");
    let report = std::fs::read_to_string(folder.join("report.json")).unwrap();
    (output.status.code().unwrap(), serde_json::from_str(&report).unwrap())
}

fn number(value: &Value, pointer: &str) -> f64 {
    value.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer} in {value}"))
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

#[test]
fn wave_streamlines_are_good_and_shorter_than_zigzag() {
    let (status, report) = run("wave.toml");
    assert_eq!(status, 0);
    assert_good("wave", &report);
    assert!(length(&report, 1) < 0.95 * length(&report, 0), "{} {}", length(&report, 1), length(&report, 0));
}

#[test]
fn pit_and_crest_ridge_and_relief_are_good() {
    for name in ["pit_and_crest.toml", "ridge.toml", "relief.toml"] {
        let (status, report) = run(name);
        assert_eq!(status, 0, "{name}");
        assert_good(name, &report);
    }
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

/// Binary STL.
fn write_stl(path: &Path, triangles: &[[Point3; 3]]) {
    let mut bytes = vec![0u8; 80];
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for [a, b, c] in triangles {
        let normal = (b - a).cross(&(c - a)).normalize();
        for v in [normal, a.coords, b.coords, c.coords] {
            v.iter().for_each(|x| bytes.extend((*x as f32).to_le_bytes()));
        }
        bytes.extend([0, 0]);
    }
    std::fs::write(path, bytes).unwrap();
}
