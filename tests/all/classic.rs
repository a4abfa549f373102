//! The classical strategies against closed forms, brute force, and the simulator.

use std::f64::consts::{FRAC_PI_2, PI};

use millstream::cutter::Cutter;
use millstream::geometry::{AnalyticShape, Point3};
use millstream::monitor::Silent;
use millstream::motion::{MoveKind, Toolpath};
use millstream::part::Part;
use millstream::toolpath::{
    Along, FrontStart, IsoParametric, IsoScallop, LevelSteps, Plan, PlanError, Spiral, Step, Strategy,
    Waterline, Zigzag, ZigzagAngle, plan,
};

use crate::support::{LIMITS, cut_and_measure, formula, mesh, off, settings};

const TARGET: Step = Step::Scallop(0.010);

fn planned(part: &Part, strategy: &dyn Strategy) -> Plan {
    plan(part, &Cutter::ball(6.0).unwrap(), strategy, &settings(part, TARGET), &Silent).unwrap()
}

fn cutting_length(path: &Toolpath) -> f64 {
    path.segments().filter(|(.., m)| m.kind == MoveKind::Cut).map(|(a, b, _)| (b - a).norm()).sum()
}

fn saddle() -> Part {
    formula(AnalyticShape::Saddle { radius_concave: 8.0, radius_convex: 10.0 }, [-5.0, 5.0], [-5.0, 5.0])
}

fn dome() -> Part {
    formula(AnalyticShape::Sphere { height: 0.0, radius: 25.0, concave: false }, [-8.0, 8.0], [-8.0, 8.0])
}

fn wave() -> Part {
    let shape = AnalyticShape::Wave { amplitude: 1.0, wavelength_x: 20.0, wavelength_y: Some(25.0) };
    formula(shape, [0.0, 12.0], [0.0, 12.0])
}

const OPEN: [(&str, &dyn Strategy); 5] = [
    ("best zigzag", &Zigzag { angle: ZigzagAngle::Best, one_way: false }),
    ("iso-parametric, better way", &IsoParametric { along: None, steps: LevelSteps::Shortest }),
    ("iso-parametric, least", &IsoParametric { along: Some(Along::V), steps: LevelSteps::Least }),
    ("iso-scallop", &IsoScallop { start: FrontStart::BestBorder }),
    ("iso-scallop, line", &IsoScallop { start: FrontStart::Line([[0.4, 0.0], [0.6, 1.0]]) }),
];

/// Passes that run around have corners; a few of their ridges are higher, none is uncut.
const AROUND: [(&str, &dyn Strategy); 3] = [
    ("iso-scallop, all borders", &IsoScallop { start: FrontStart::AllBorders }),
    ("spiral", &Spiral::Plan),
    ("contour spiral", &Spiral::Contour),
];

#[test]
fn every_classical_strategy_holds_the_scallop_and_leaves_nothing_uncut() {
    let cutter = Cutter::ball(6.0).unwrap();
    for (shape, part) in [("saddle", saddle()), ("wave", wave())] {
        for (name, strategy) in OPEN.into_iter().chain(AROUND) {
            let path = planned(&part, strategy).path;
            let m = cut_and_measure(&part, &cutter, &path, 0.1, &LIMITS);
            let [max, over] = [m.scallop.max_mm.unwrap(), m.scallop.over_target_fraction.unwrap()];
            println!(
                "{shape}, {name}: {:.0} mm, scallop max {:.2} um, over {:.2} %, gouge {:.2} um",
                cutting_length(&path),
                1e3 * max,
                100.0 * over,
                1e3 * m.gouge.max_depth_mm
            );
            let around = AROUND.iter().any(|(other, _)| *other == name);
            assert!(max < if around { 0.020 } else { 0.0125 }, "{shape}, {name}: {max}");
            assert!(over < if around { 0.05 } else { 0.01 }, "{shape}, {name}: {over}");
            assert!(m.gouge.max_depth_mm < 0.0011, "{shape}, {name}: {}", m.gouge.max_depth_mm);
            assert_eq!(m.uncut.region_count, 0, "{shape}, {name}: {:?}", m.uncut.regions);
        }
    }
}

#[test]
fn the_best_zigzag_is_as_short_as_the_best_of_many_planned() {
    let shape = AnalyticShape::Cylinder { height: 0.0, radius: 12.0, azimuth: 0.6, concave: false };
    let part = formula(shape, [-6.0, 6.0], [-6.0, 6.0]);
    let best = cutting_length(&planned(&part, &Zigzag { angle: ZigzagAngle::Best, one_way: false }).path);
    for k in 0..9 {
        let angle = PI * f64::from(k) / 9.0;
        let other = cutting_length(&planned(&part, &Zigzag::at(angle)).path);
        assert!(best <= 1.02 * other, "{best} against {other} at {angle}");
    }
    let one_way = planned(&part, &Zigzag { angle: ZigzagAngle::Best, one_way: true }).path;
    assert!(off(cutting_length(&one_way), best) < 0.01);
}

#[test]
fn iso_scallop_passes_on_a_cylinder_are_those_of_its_arc() {
    let (rho, half, r) = (20.0f64, 10.0f64, 3.0f64);
    let shape = AnalyticShape::Cylinder { height: 0.0, radius: rho, azimuth: FRAC_PI_2, concave: false };
    let part = formula(shape, [-half, half], [0.0, 12.0]);
    let start = FrontStart::Border { constant: Along::U, greatest: false };
    let path = planned(&part, &IsoScallop { start }).path;
    let (arc, h) = (2.0 * rho * (half / rho).asin(), 0.010 - 0.26 * LIMITS.chord);
    let exact = arc / (8.0 * h / (1.0 / r + 1.0 / rho)).sqrt();
    let passes = path.passes() as f64;
    assert!(passes >= exact && passes <= 1.02 * exact + 1.0, "{passes} for {exact}");
    assert!(off(cutting_length(&path), 12.0 * passes) < 0.02);
}

/// Parts far smaller than the cutter are found between the first samples of a pass.
#[test]
fn a_huge_cutter_reaches_a_small_plane() {
    let part = formula(AnalyticShape::Plane { height: 0.0 }, [0.0, 10.0], [0.0, 8.0]);
    for diameter in [80.0, 300.0, 3000.0] {
        let cutter = Cutter::ball(diameter).unwrap();
        let plan = plan(&part, &cutter, &Zigzag::at(0.0), &settings(&part, TARGET), &Silent).unwrap();
        assert!(cutting_length(&plan.path) > 9.9, "{diameter}: {}", cutting_length(&plan.path));
    }
}

/// A roof of two planes that meet in a ridge: its facets need the stepover of a plane, whatever a smooth
/// surface over the ridge bends.
#[test]
fn a_crease_does_not_narrow_all_passes_of_a_zigzag() {
    let at = |x: f64, y: f64, z: f64| Point3::new(x, y, z);
    let rows = [0.0, 12.0].map(|y| [at(0.0, y, 0.0), at(8.0, y, 4.0), at(16.0, y, 0.0)]);
    let triangles = vec![[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]];
    let part = mesh(rows.concat(), triangles);
    let path = planned(&part, &Zigzag::at(FRAC_PI_2)).path;
    // Along the slope and square to the ridge, lengths in the plan are shorter by the cosine.
    let strip = 2.0 * (2.0 * 3.0 * 0.010_f64 - 0.010 * 0.010).sqrt() * 2.0 / 5.0_f64.sqrt();
    // Beside the foot the axis stands off the border.
    let across = 16.0 + 2.0 * 3.0 / 5.0_f64.sqrt();
    let passes = path.passes() as f64;
    assert!(
        passes >= across / strip && passes < 1.05 * across / strip + 1.0,
        "{passes} for {}",
        across / strip
    );
}

#[test]
fn iso_scallop_takes_the_shortest_of_the_borders() {
    let part = saddle();
    let length = |start| cutting_length(&planned(&part, &IsoScallop { start }).path);
    let best = length(FrontStart::BestBorder);
    for constant in [Along::U, Along::V] {
        for greatest in [false, true] {
            let other = length(FrontStart::Border { constant, greatest });
            assert!(best <= 1.005 * other, "{best} {other}");
        }
    }
}

#[test]
fn waterlines_keep_their_height() {
    let part = dome();
    for steps in [LevelSteps::Constant, LevelSteps::Shortest] {
        let path = planned(&part, &Waterline { steps }).path;
        let mut range = vec![[f64::INFINITY, f64::NEG_INFINITY]; path.passes()];
        for (a, b, m) in path.segments().filter(|(.., m)| m.kind == MoveKind::Cut) {
            let [lo, hi] = &mut range[m.pass as usize];
            (*lo, *hi) = (lo.min(a.z).min(b.z), hi.max(a.z).max(b.z));
        }
        // Over the border the surface is continued, and the cutter rolls.
        let level = range.iter().filter(|[lo, hi]| hi - lo < 2e-3).count();
        assert!(level as f64 > 0.2 * range.len() as f64, "{level} of {}", range.len());
        let cutter = Cutter::ball(6.0).unwrap();
        let m = cut_and_measure(&part, &cutter, &path, 0.1, &LIMITS);
        assert_eq!(m.uncut.region_count, 0, "{:?}", m.uncut.regions);
        assert!(m.scallop.over_target_fraction.unwrap() < 0.02);
    }
}

#[test]
fn the_contour_spiral_is_one_pass_and_a_few_short_ones() {
    let part = formula(AnalyticShape::Plane { height: 0.0 }, [0.0, 20.0], [0.0, 20.0]);
    let path = planned(&part, &Spiral::Contour).path;
    let mut lengths = vec![0.0; path.passes()];
    for (a, b, m) in path.segments().filter(|(.., m)| m.kind == MoveKind::Cut) {
        lengths[m.pass as usize] += (b - a).norm();
    }
    lengths.sort_by(|a, b| b.total_cmp(a));
    let all: f64 = lengths.iter().sum();
    // A square of 20 mm in strips of the plane's width.
    let strip = (8.0 * (0.010 - 0.26 * LIMITS.chord) * 3.0f64).sqrt();
    // The first turn is whole though half of one would do.
    assert!(off(lengths[0], 400.0 / strip + 40.0) < 0.05, "{}", lengths[0]);
    assert!(lengths[0] > 0.8 * all, "{} of {all}", lengths[0]);
    assert!(lengths[1..].iter().all(|l| *l < 0.1 * lengths[0]));
}

#[test]
fn strategies_say_where_they_do_not_apply() {
    let part = formula(AnalyticShape::Plane { height: 0.0 }, [0.0, 20.0], [0.0, 20.0]);
    let strategy = Waterline { steps: LevelSteps::Shortest };
    let cutter = Cutter::ball(6.0).unwrap();
    let refused = plan(&part, &cutter, &strategy, &settings(&part, TARGET), &Silent);
    let Err(PlanError::NotApplicable { strategy: "waterline", reason }) = refused else {
        panic!("{refused:?}")
    };
    assert!(reason.contains("level"), "{reason}");
}
