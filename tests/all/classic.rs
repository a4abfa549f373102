//! The classical strategies against closed forms, brute force, and the simulator.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use millstream::cutter::Cutter;
use millstream::geometry::{AnalyticShape, Point3, Vector3};
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
    ("best zigzag", &Zigzag { angle: ZigzagAngle::Best, one_way: false, ..Zigzag::at(0.0) }),
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
    let best = cutting_length(
        &planned(&part, &Zigzag { angle: ZigzagAngle::Best, one_way: false, ..Zigzag::at(0.0) }).path,
    );
    for k in 0..9 {
        let angle = PI * f64::from(k) / 9.0;
        let other = cutting_length(&planned(&part, &Zigzag::at(angle)).path);
        assert!(best <= 1.02 * other, "{best} against {other} at {angle}");
    }
    let one_way = planned(&part, &Zigzag { angle: ZigzagAngle::Best, one_way: true, ..Zigzag::at(0.0) }).path;
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

/// Where the planes of zigzag passes stand across their direction.
fn planes(path: &Toolpath, angle: f64) -> Vec<f64> {
    let moves = path.segments().filter(|(.., m)| m.kind == MoveKind::Cut);
    let across = |p: Point3| p.y * angle.cos() - p.x * angle.sin();
    let mut all: Vec<f64> = moves.map(|(_, to, _)| across(to)).collect();
    all.sort_by(f64::total_cmp);
    all.dedup_by(|a, b| (*a - *b).abs() < 1e-6);
    all
}

/// Balls of 6 mm over a wave, from its height alone: how far apart planes may stand at a place, and where the
/// one stands that touches it.
fn allowed_over_wave([amplitude, kx, ky]: [f64; 3], [x, y]: [f64; 2], angle: f64, h: f64) -> [f64; 2] {
    let (r, s) = (3.0, amplitude);
    let ((sx, cx), (sy, cy)) = ((kx * x).sin_cos(), (ky * y).sin_cos());
    let (zx, zy) = (s * kx * cx * cy, -s * ky * sx * sy);
    let n = Vector3::new(-zx, -zy, 1.0).normalize();
    let e = Vector3::new(-angle.sin(), angle.cos(), 0.0);
    // The feed lies in the surface and in the plane.
    let b = n.cross(&e.cross(&n).normalize());
    let (zxx, zxy, zyy) = (-kx * kx * s * sx * cy, -s * kx * ky * cx * sy, -ky * ky * s * sx * cy);
    let bend = (zxx * b.x * b.x + 2.0 * zxy * b.x * b.y + zyy * b.y * b.y) * n.z;
    // On the surface of the centres, of curvature κ/(1 − κ r), ridges between balls stand as over a plane.
    let lean = (1.0 - n.dot(&e).powi(2)).sqrt();
    [e.dot(&Vector3::new(x, y, 0.0)) + r * n.dot(&e), (8.0 * h * r * (1.0 - bend * r)).sqrt() * lean]
}

/// Each gap between two planes is as wide as the tightest place in it allows, and no wider.
#[test]
fn gaps_of_a_zigzag_are_what_the_surface_between_allows() {
    let (amplitude, lengths, size) = (1.0, [20.0, 25.0], 12.0);
    let [kx, ky] = lengths.map(|length| TAU / length);
    let (part, h) = (wave(), 0.010 - 0.26 * LIMITS.chord);
    for angle in [0.0, 0.5, FRAC_PI_2] {
        let planes = planes(&planned(&part, &Zigzag::at(angle)).path, angle);
        let mut least = vec![f64::INFINITY; planes.len()];
        const PLACES: usize = 600;
        for k in 0..PLACES * PLACES {
            let at = [k % PLACES, k / PLACES].map(|k| size * (k as f64 + 0.5) / PLACES as f64);
            let [axis, allowed] = allowed_over_wave([amplitude, kx, ky], at, angle, h);
            let gap = planes.partition_point(|plane| *plane < axis);
            if let Some(least) = least.get_mut(gap) {
                *least = least.min(allowed);
            }
        }
        let gaps = planes.windows(2).zip(&least[1..]).map(|(w, least)| (w[1] - w[0]) / least);
        let gaps: Vec<f64> = gaps.filter(|share| share.is_finite()).collect();
        let widest = gaps.iter().copied().fold(0.0, f64::max);
        let mean = gaps.iter().sum::<f64>() / gaps.len() as f64;
        assert!(widest < 1.005 && mean > 0.95, "{angle}: {widest} {mean} of {}", gaps.len());
        let constant = Zigzag { steps: LevelSteps::Constant, ..Zigzag::at(angle) };
        let constant = self::planes(&planned(&part, &constant).path, angle);
        let steps: Vec<f64> = constant.windows(2).map(|w| w[1] - w[0]).collect();
        assert!(steps.iter().all(|step| off(*step, steps[0]) < 1e-5), "{angle}: {steps:?}");
        assert!(constant.len() > planes.len(), "{angle}: {} {}", constant.len(), planes.len());
    }
}

/// A flat end fed along a cylinder leaves stairs: on a slope of λ it is h over the surface t from where its rim
/// touches, λ t + t²/(2 R) = h. Over the crest it rests as long as it is wide. The rim leaves the part at its
/// lowest lines, and nothing stays there.
#[test]
fn a_flat_end_along_a_cylinder_takes_narrow_steps_on_its_flanks_alone() {
    let (radius, half, h) = (1000.0, 20.0, 0.010 - 0.26 * LIMITS.chord);
    let cutter = Cutter::flat(20.0).unwrap();
    let shape = AnalyticShape::Cylinder { height: 0.0, radius, azimuth: 0.0, concave: false };
    let smooth = formula(shape, [0.0, 30.0], [-half, half]);
    let at = |x: f64, k: u32| {
        let y = half * (f64::from(k) / 40.0 - 1.0);
        Point3::new(x, y, (radius * radius - y * y).sqrt() - radius)
    };
    let corners = (0..=80).flat_map(|k| [at(0.0, k), at(30.0, k)]).collect();
    let strips =
        (0..80).flat_map(|k| [[2 * k, 2 * k + 1, 2 * k + 3], [2 * k, 2 * k + 3, 2 * k + 2]]).collect();
    let facets = mesh(corners, strips);
    let stair = |y: f64| ((y / radius).powi(2) + 2.0 * h / radius).sqrt() * radius - y;
    let flank: f64 = (0..2000).map(|k| 0.01 / stair((f64::from(k) + 0.5) * 0.01)).sum();
    let exact = 2.0 * flank + 20.0 / stair(0.0);
    // Each step is that of its lower end.
    for (part, most) in [(&smooth, 1.05 * exact + 2.0), (&facets, 1.1 * exact + 2.0)] {
        let plan = plan(part, &cutter, &Zigzag::at(0.0), &settings(part, TARGET), &Silent).unwrap();
        let count = planes(&plan.path, 0.0).len() as f64;
        assert!(count >= exact && count <= most, "{count} for {exact}");
        let m = cut_and_measure(part, &cutter, &plan.path, 0.1, &LIMITS);
        assert_eq!(m.uncut.region_count, 0, "{:?}", m.uncut.regions);
        assert!(m.excess.highest.max_mm < 0.0115, "{:?}", m.excess.highest);
    }
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
