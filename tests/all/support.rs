//! What several tests need: a part cut by a strategy and measured.

use std::path::Path;
use std::process::Command;

use millstream::cutter::Cutter;
use millstream::geometry::{AnalyticShape, AnalyticSurface, Point3, TriangleMesh};
use millstream::metrology::{Asked, Limits, Measurement, measure};
use millstream::monitor::Silent;
use millstream::motion::Toolpath;
use millstream::part::{Part, Patch};
use millstream::sim::{Grid, ZMap, cut_reference};
use millstream::toolpath::{Joining, PlanSettings, Step, Strategy, plan};
use serde_json::{Value, json};

pub const LIMITS: Limits = Limits { scallop: 0.010, gouge: 0.005, uncut: 0.050, chord: 0.001 };

/// Error bound asked of every figure, mm.
pub const ASKED: f64 = 0.0005;

/// Stock over a part's highest point, mm.
const ALLOWANCE: f64 = 1.0;

pub fn formula(shape: AnalyticShape, x: [f64; 2], y: [f64; 2]) -> Part {
    let surface = AnalyticSurface::new(shape, [x, y]).unwrap();
    Part::from_patches(vec![Patch::Analytic(surface)], 0.002).unwrap()
}

pub fn mesh(vertices: Vec<Point3>, triangles: Vec<[u32; 3]>) -> Part {
    Part::from_mesh(TriangleMesh::new(vertices, triangles).unwrap().0)
}

pub fn settings(part: &Part, step: Step) -> PlanSettings {
    PlanSettings {
        step,
        chord_tolerance: LIMITS.chord,
        clearance: 2.0,
        stock_top: part.bounds().max.z + ALLOWANCE,
        feed_rate: 1000.0,
        plunge_rate: 300.0,
        joining: Joining::default(),
        ..PlanSettings::default()
    }
}

/// Cuts a path out of a block around the part and measures.
pub fn cut_and_measure(
    part: &Part,
    cutter: &Cutter,
    path: &Toolpath,
    cell: f64,
    limits: &Limits,
) -> Measurement {
    let bounds = part.bounds();
    let grid = Grid::covering(&bounds, cell, 64, 1 << 32).unwrap();
    let stock = ZMap::block(grid, bounds.max.z + ALLOWANCE);
    let cut = cut_reference(&stock, cutter, path, &Silent).unwrap();
    let asked = Asked {
        allowed_depth: 0.0,
        error_bound: ASKED,
        most_cells: 1 << 20,
        most_squares: 1 << 22,
        is_first_look: false,
        border_cuts: true,
        steep_elsewhere: false,
    };
    measure(part, cutter, path, &cut, limits, &asked, &Silent).unwrap()
}

pub fn plan_and_measure(
    part: &Part,
    cutter: &Cutter,
    strategy: &dyn Strategy,
    step: Step,
    cell: f64,
) -> Measurement {
    let plan = plan(part, cutter, strategy, &settings(part, step), &Silent).unwrap();
    cut_and_measure(part, cutter, &plan.path, cell, &LIMITS)
}

/// |a / b − 1|.
pub fn off(a: f64, b: f64) -> f64 {
    (a / b - 1.0).abs()
}

/// A grid of `n` × `n` squares over `[0, size]²`, each split in two.
pub fn height_mesh(n: usize, size: [f64; 2], height: impl Fn(f64, f64) -> f64) -> TriangleMesh {
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

/// Binary STL.
pub fn write_stl(path: &Path, triangles: &[[Point3; 3]]) {
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

/// Runs a scene and returns its exit status and report.
pub fn run_scene(scene: &Path) -> (i32, Value) {
    let out = tempfile::tempdir().unwrap();
    run_scene_into(scene, &out.path().join("out"))
}

/// As [`run_scene`], with a folder that keeps the results.
pub fn run_scene_into(scene: &Path, folder: &Path) -> (i32, Value) {
    let output = Command::new(env!("CARGO_BIN_EXE_millstream"))
        .arg("run")
        .arg(scene)
        .arg("--out")
        .arg(folder)
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    println!("{text}");
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    // On a slow machine lines come that begin with the time and tell how far the run is.
    let is_progress = |line: &str| {
        line.split_once("  ").is_some_and(|(time, _)| time.starts_with(|first: char| first.is_ascii_digit()))
    };
    assert!(errors.lines().all(is_progress), "{}: {errors}", scene.display());
    let report = std::fs::read_to_string(folder.join("report.json")).unwrap();
    (output.status.code().unwrap(), serde_json::from_str(&report).unwrap())
}

pub fn number(value: &Value, pointer: &str) -> f64 {
    value.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer} in {value}"))
}

/// A bicubic patch whose control points stand where a surface has them at the averages of its knots.
pub fn patch([nu, nv]: [usize; 2], surface: impl Fn(f64, f64) -> [f64; 3]) -> Value {
    let knots = |n: usize| -> Vec<f64> {
        let inner = (1..n - 3).map(|k| k as f64 / (n - 3) as f64);
        [0.0; 4].into_iter().chain(inner).chain([1.0; 4]).collect()
    };
    let averages = |n: usize| -> Vec<f64> {
        knots(n)[1..].windows(3).take(n).map(|w| w.iter().sum::<f64>() / 3.0).collect()
    };
    let rounded = |p: [f64; 3]| p.map(|c| (c * 1e3).round() / 1e3);
    let points: Vec<Vec<[f64; 3]>> = averages(nu)
        .iter()
        .map(|&u| averages(nv).iter().map(|&v| rounded(surface(u, v))).collect())
        .collect();
    json!({
        "unit": "mm",
        "patches": [{
            "degree_u": 3, "degree_v": 3, "knots_u": knots(nu), "knots_v": knots(nv), "control_points": points,
        }],
    })
}

/// Nothing uncut, no gouge over 5 µm, at most 1 % of the ridges over the target, by a quarter of it at most.
pub fn is_good(path: &Value) {
    let name = &path["name"];
    assert!(number(path, "/scallop/over_target_fraction") <= 0.01, "{name}: {:#}", path["scallop"]);
    assert!(
        number(path, "/scallop/max_mm") <= 1.25 * number(path, "/scallop/target_mm"),
        "{name}: {:#}",
        path["scallop"]
    );
    assert!(number(path, "/gouge/max_depth_mm") <= 0.005, "{name}: {:#}", path["gouge"]);
    assert_eq!(number(path, "/uncut/area_mm2"), 0.0, "{name}: {:#}", path["uncut"]);
    // Where passes are parallel, every pair's calculated scallop is what was measured.
    if let Some(off) = path["scallop_pairs"]["parallel_greatest_mean_difference"].as_f64() {
        assert!(off <= 0.01, "{name}: {off}");
    }
}

/// Runs the scene in `path` with other words, and those of its toolpaths that are wanted.
pub fn run_changed(path: &Path, words: &[[&str; 2]], wanted: impl Fn(&str) -> bool) -> (i32, Value) {
    let text = std::fs::read_to_string(path).unwrap();
    let folder = path.parent().unwrap();
    let text = text.replace("file = \"", &format!("file = \"{}/", folder.display()));
    let text = words.iter().fold(text, |text, [from, to]| {
        assert!(text.contains(from), "{} has no {from}", path.display());
        text.replace(from, to)
    });
    let (head, toolpaths) = text.split_once("[[toolpath]]").unwrap();
    let kept = toolpaths.split("[[toolpath]]").filter(|toolpath| wanted(toolpath));
    let changed = kept.fold(head.to_owned(), |text, toolpath| text + "[[toolpath]]" + toolpath);
    let file = tempfile::Builder::new().suffix(".toml").tempfile().unwrap();
    std::fs::write(file.path(), changed).unwrap();
    run_scene(file.path())
}
