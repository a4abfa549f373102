//! A small made-up measurement for the tests of this folder.

use super::{RunReport, SimulationFigures, SurfaceMeshFigures, ToolpathResult, Verdict, violations};
use metrology::{
    CloserLook, DeviationFigures, GougeFigures, GougeRegion, Limits, Measurement, PairFigures, PathFigures,
    RoughnessFigures, ScallopFigures, ScallopPair, UncutFigures,
};

pub const LIMITS: Limits = Limits { scallop: 0.010, gouge: 0.005, uncut: 0.050, chord: 0.001 };

/// A clean surface but for one gouge of the given depth, mm.
pub fn measurement(gouge: f64) -> Measurement {
    let at_mm = [12.5, 7.25, -1.0 - gouge];
    let region = GougeRegion { depth_mm: gouge, area_mm2: 0.25, at_mm, move_index: 1234, line: 1240 };
    let regions = if gouge > LIMITS.gouge { vec![region] } else { Vec::new() };
    Measurement {
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
        },
        uncut: UncutFigures { error_bound_mm: 0.0005, ..UncutFigures::default() },
        deviation: DeviationFigures {
            samples: 4800,
            min_mm: -gouge,
            max_mm: 0.0105,
            rms_mm: 0.005,
            area_mm2: 1200.0,
        },
        deviation_map: Vec::new(),
        ridge_samples: Vec::new(),
        pairs: PairFigures {
            reason: Some("no ridge stands between passes on the part".into()),
            ..PairFigures::default()
        },
        refined: CloserLook::default(),
    }
}

pub fn toolpath(name: &str, machining_time_s: f64, gouge: f64) -> ToolpathResult {
    let measured = measurement(gouge);
    let violations = violations(&measured, &LIMITS);
    ToolpathResult {
        name: name.to_owned(),
        strategy: "zigzag".to_owned(),
        folder: name.to_owned(),
        verdict: if violations.is_empty() { Verdict::Pass } else { Verdict::Fail },
        violations,
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
        shortest: None,
        field: None,
        machine: None,
        scallop: measured.scallop,
        scallop_pairs: measured.pairs,
        roughness: None,
        gouge: measured.gouge,
        uncut: measured.uncut,
        deviation: measured.deviation,
        sections: Vec::new(),
        removal: None,
        pocket: None,
        solid: None,
        offset: None,
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

/// Two passes that are parallel and meet in a ridge.
fn pairs() -> PairFigures {
    let pair = ScallopPair {
        passes: [3, 4],
        crossings: 400,
        ridge_length_mm: 40.0,
        measured_mean_mm: 0.0071,
        measured_max_mm: 0.0105,
        calculated_places: 80,
        parallel: true,
        calculated_mean_mm: Some(0.00709),
        calculated_max_mm: Some(0.01049),
        section_mean_mm: Some(0.00705),
        calculated_over_measured: Some(0.9986),
        greatest_difference_mm: Some(0.00001),
    };
    PairFigures {
        pair_count: 1,
        parallel_count: 1,
        calculated_over_measured: Some(0.9986),
        parallel_calculated_over_measured: Some(0.9986),
        parallel_greatest_mean_difference: Some(0.0014),
        parallel_greatest_difference_mm: Some(0.00001),
        parallel_section_over_measured: Some(0.993),
        error_bound_mm: Some(1e-9),
        reason: None,
        pairs: vec![pair],
    }
}

/// A zigzag that gouges and a streamline that does not.
pub fn report() -> RunReport {
    let mut toolpaths = vec![toolpath("zigzag", 402.0, 0.032), toolpath("streamline", 385.0, 0.001)];
    toolpaths[0].scallop_pairs = pairs();
    toolpaths[0].roughness = Some(RoughnessFigures {
        ra_mm: Some(0.0018),
        rz_mm: Some(0.0071),
        ra_max_mm: Some(0.0026),
        rz_max_mm: Some(0.0101),
        rz_max_at_mm: Some([3.0, 4.0, 0.5]),
        error_bound_mm: Some(0.00002),
        max_error_bound_mm: Some(0.00004),
        profiles: 22,
        intervals_per_sampling_length: [2, 3],
        sampling_length_mm: Some(1.5),
        samples_per_interval: 24,
        reason: None,
    });
    RunReport::new("wave.toml".into(), "0123abcd".into(), "Wave".into(), &LIMITS, toolpaths)
}
