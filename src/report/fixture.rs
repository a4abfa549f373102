//! A small made-up report for the tests of this folder.

use super::{
    Claim, Figure, FigureTable, Gravity, InputFile, RunReport, SimulationFigures, SurfaceMeshFigures,
    ToleranceFigures, ToolpathReport, ToolpathResult,
};
use metrology::{
    DeviationFigures, ExcessFigures, GougeFigures, GougeRegion, Limits, PathFigures, ScallopFigures,
    ScallopRule, UncutFigures,
};

pub const LIMITS: Limits = Limits { scallop: 0.010, gouge: 0.005, uncut: 0.050, chord: 0.001 };

/// The core figures of one toolpath.
struct Measured {
    scallop: ScallopFigures,
    gouge: GougeFigures,
    uncut: UncutFigures,
    deviation: DeviationFigures,
}

/// A clean surface but for one gouge of the given depth, mm.
fn measurement(gouge: f64) -> Measured {
    let at_mm = [12.5, 7.25, -1.0 - gouge];
    let region = GougeRegion {
        depth_mm: gouge,
        area_mm2: 0.25,
        at_mm,
        move_index: 1234,
        line: 1240,
        ..GougeRegion::default()
    };
    let regions = if gouge > LIMITS.gouge { vec![region] } else { Vec::new() };
    Measured {
        scallop: ScallopFigures {
            target_mm: LIMITS.scallop,
            max_mm: Some(0.0105),
            p95_mm: Some(0.0098),
            p50_mm: Some(0.0071),
            mean_mm: Some(0.0069),
            over_target_fraction: Some(0.015),
            ridge_length_mm: 2345.5,
            max_at_mm: Some([3.0, 4.0, 0.5]),
            error_bound_mm: Some(0.00025),
            reason: None,
        },
        gouge: GougeFigures {
            max_depth_mm: gouge,
            area_mm2: 0.25 * regions.len() as f64,
            error_bound_mm: 0.0005,
            region_count: regions.len(),
            regions,
            ..GougeFigures::default()
        },
        uncut: UncutFigures { error_bound_mm: 0.0005, ..UncutFigures::default() },
        deviation: DeviationFigures {
            samples: 4800,
            min_mm: Some(-gouge),
            max_mm: Some(0.0105),
            rms_mm: Some(0.005),
            area_mm2: 1200.0,
            reason: None,
        },
    }
}

pub fn toolpath(name: &str, machining_time_s: f64, gouge: f64) -> ToolpathResult {
    let measured = measurement(gouge);
    let claims = vec![depth(gouge)];
    ToolpathResult {
        name: name.to_owned(),
        strategy: "zigzag".to_owned(),
        stock_is_previous: false,
        folder: name.to_owned(),
        verdict: claims[0].verdict(),
        claims,
        notes: vec!["the last step was narrowed".to_owned()],
        path: PathFigures {
            cutting_length_mm: 6012.25,
            link_length_mm: 25.5,
            air_length_mm: 512.5,
            passes: 60,
            surface_links: 52,
            retracts: 7,
            cl_points: 12345,
            total_turning_rad: 215.5,
            sharp_turns: 2,
            machining_time_s,
        },
        scallop: measured.scallop,
        gouge: measured.gouge,
        uncut: measured.uncut,
        excess: ExcessFigures::default().into(),
        deviation: measured.deviation,
        figures: Vec::new(),
        simulation: SimulationFigures {
            engine: "reference",
            cell_mm: 0.05,
            cells: 480_000,
            error_bound_asked_mm: 0.0005,
            refined_rectangles: 0,
            finest_cell_mm: 0.05,
            moves: 12345,
            wall_s: 1.5,
            threads: 2,
        },
        surface_mesh: SurfaceMeshFigures { triangles: 20_000, tolerance_mm: 0.0025 },
    }
}

/// As the rule tells it.
fn depth(gouge: f64) -> Claim {
    let text = format!(
        "gouge {:.1} ± 0.50 µm deep (limit 5.00) at x 12.500 y 7.250 z -1.032, move 1234, toolpath.nc line 1240",
        1e3 * gouge
    );
    Claim::length("gouge", Gravity::Scrap, LIMITS.gouge, gouge, 0.0005).told(text)
}

pub fn tolerance() -> ToleranceFigures {
    ToleranceFigures::new(&LIMITS, &ScallopRule::default())
}

/// A figure with all that one can have.
fn figure() -> Figure {
    let table = FigureTable {
        title: "Sections",
        caption: "One row a section.",
        columns: vec!["height mm", "mean µm"],
        rows: vec![vec!["5".to_owned(), "0.25".to_owned()]],
    };
    Figure {
        key: "roughness",
        value: serde_json::json!({ "ra_mm": 0.0018, "rz_mm": 0.0071, "profiles": 22 }),
        rows: vec![("roughness Ra, Rz across the feed", "1.80 ± 0.02, 7.10 ± 0.02 µm".to_owned())],
        meaning: Some(("roughness", "Ra and Rz of profiles of the deviation across the feed.")),
        sentence: Some((
            "Roughness across the feed, µm",
            "Ra 1.80 ± 0.02, Rz 7.10 ± 0.02: zigzag".to_owned(),
        )),
        table: Some(table),
        files: Vec::new(),
    }
}

/// A zigzag that gouges and a streamline that does not.
pub fn report() -> RunReport {
    let mut toolpaths = vec![toolpath("zigzag", 402.0, 0.032), toolpath("streamline", 385.0, 0.001)];
    toolpaths[0].figures.push(figure());
    let toolpaths = toolpaths.into_iter().map(|t| ToolpathReport::Measured(Box::new(t))).collect();
    let report = RunReport::new("wave.toml".into(), "0123abcd".into(), "Wave".into(), tolerance(), toolpaths);
    let part = InputFile { file: "wave.stl".to_owned(), bytes: 684, sha256: "4567cdef".to_owned() };
    let note = "The longest side of the part is 0.1 mm, the diameter of the cutter 6 mm.".to_owned();
    RunReport { inputs: vec![part], notes: vec![note], ..report }
}
