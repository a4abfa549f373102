//! Made-up measurements at and beyond their limits.

use super::*;
use metrology::{
    CloserLook, DeviationFigures, GougeFigures, GougeRegion, PairFigures, ScallopFigures, UncutFigures,
    UncutRegion,
};

fn violations(measured: &Measurement) -> Vec<Violation> {
    judge(measured, &LIMITS, Vec::new()).1
}

const LIMITS: Limits = Limits { scallop: 0.010, gouge: 0.005, uncut: 0.050, chord: 0.001 };

/// A clean surface but for one gouge of the given depth, mm.
fn measurement(gouge: f64) -> Measurement {
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

#[test]
fn a_limit_is_violated_above_it_and_not_at_it() {
    let mut measured = measurement(LIMITS.gouge);
    measured.scallop.max_mm = Some(HIGHEST_RIDGE * LIMITS.scallop);
    measured.scallop.p95_mm = Some(LIMITS.scallop);
    assert_eq!(violations(&measured), []);
    measured.gouge.max_depth_mm = LIMITS.gouge * (1.0 + 1e-12);
    measured.scallop.max_mm = Some(HIGHEST_RIDGE * LIMITS.scallop * (1.0 + 1e-12));
    measured.scallop.p95_mm = Some(LIMITS.scallop * (1.0 + 1e-12));
    let kinds: Vec<&str> = violations(&measured).iter().map(|v| v.what).collect();
    assert_eq!(kinds, ["gouge", "scallop", "scallop"]);
}

#[test]
fn any_uncut_region_is_a_violation_with_its_place() {
    let mut measured = measurement(0.0);
    let at_mm = [1.0, 2.0, 3.0];
    measured.uncut.regions = vec![UncutRegion { height_mm: 0.2, area_mm2: 1.0, volume_mm3: 0.1, at_mm }];
    measured.uncut.max_height_mm = 0.2;
    measured.uncut.region_count = 3;
    let found = violations(&measured);
    assert_eq!(found[0].what, "uncut");
    assert!(found[0].text.ends_with("at x 1.000 y 2.000 z 3.000, and 2 more places"), "{}", found[0].text);
}

#[test]
fn the_gravest_places_are_marked_and_those_within_limits_are_not() {
    assert_eq!(marks(&measurement(0.001), &LIMITS), []);
    let mut measured = measurement(0.032);
    let region = measured.gouge.regions[0];
    measured.gouge.regions.resize(7, region);
    measured.scallop.max_mm = Some(1.01 * HIGHEST_RIDGE * LIMITS.scallop);
    let found = marks(&measured, &LIMITS);
    let names: Vec<&str> = found.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["G1", "G2", "G3", "G4", "G5", "S"]);
    assert_eq!((found[0].at, found[5].at), ([12.5, 7.25], [3.0, 4.0]));
}

#[test]
fn a_gouge_names_move_and_line() {
    let text = violations(&measurement(0.032))[0].text.clone();
    assert!(text.contains("gouge 32.0 ± 0.50 µm deep (limit 5.00)"), "{text}");
    assert!(text.contains("at x 12.500 y 7.250 z -1.032, move 1234, toolpath.nc line 1240"), "{text}");
}

#[test]
fn what_figures_found_comes_by_its_gravity_and_fails() {
    let found = |what| Violation { what, limit_mm: 0.0, measured_mm: 1.0, text: what.to_owned() };
    let (verdict, all) =
        judge(&measurement(0.032), &LIMITS, vec![found("rapid"), found("collision"), found("wall")]);
    let kinds: Vec<&str> = all.iter().map(|v| v.what).collect();
    assert_eq!((verdict, kinds), (Verdict::Fail, vec!["collision", "wall", "rapid", "gouge"]));
    assert_eq!(judge(&measurement(0.0), &LIMITS, Vec::new()).0, Verdict::Pass);
}
