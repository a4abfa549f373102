use super::*;
use crate::{Asked, Limits, Measurement, measure};
use geometry::{AnalyticShape, AnalyticSurface, Vector2, Vector3};
use motion::{ClPoint, Move, MoveKind};
use part::Patch;
use scallop::BallSection;
use sim::{Grid, ZMap, cut_reference};
use work::monitor::Silent;

const LIMITS: Limits = Limits { scallop: 0.01, gouge: 0.005, uncut: 0.05, chord: 0.001 };

fn part(shape: AnalyticShape) -> Part {
    let surface = AnalyticSurface::new(shape, [[-3.0, 3.0], [-3.0, 3.0]]).unwrap();
    Part::from_patches(vec![Patch::Analytic(surface)], 0.002).unwrap()
}

/// Along y.
fn cylinder(concave: bool) -> AnalyticShape {
    AnalyticShape::Cylinder { height: 0.0, radius: 12.0, azimuth: std::f64::consts::FRAC_PI_2, concave }
}

/// Passes of a ball of radius 3 through places of the plan view, each on the surface.
fn path(part: &Part, passes: &[[Vector2; 2]]) -> Toolpath {
    let ball = Cutter::ball(6.0).unwrap();
    let tip = |p: &Vector2| {
        let at = part.highest_at(p.x, p.y).unwrap();
        at.point + ball.contact_to_tip(&at.normal)
    };
    let mut moves = Vec::new();
    for (pass, ends) in passes.iter().enumerate() {
        let [a, b] = ends.each_ref().map(tip);
        let up = Vector3::z() * 9.0;
        let stops = [
            (a + up, MoveKind::Rapid),
            (a, MoveKind::Plunge),
            (b, MoveKind::Cut),
            (b + up, MoveKind::Retract),
        ];
        moves.extend(stops.map(|(to, kind)| Move {
            to: ClPoint::upright(to),
            kind,
            feed_rate: 1000.0,
            pass: pass as u32,
        }));
    }
    Toolpath::new(ClPoint::upright(Point3::new(0.0, 0.0, 9.0)), moves)
}

fn measured(part: &Part, cutter: &Cutter, path: &Toolpath) -> Measurement {
    let grid = Grid::covering(&part.bounds(), 0.07, 64, 1 << 30).unwrap();
    let cut = cut_reference(&ZMap::block(grid, 9.0), cutter, path, &Silent).unwrap();
    let asked = Asked {
        allowed_depth: 0.0,
        error_bound: 5e-4,
        most_cells: 1 << 20,
        most_squares: 1 << 20,
        is_first_look: false,
        border_cuts: true,
        steep_elsewhere: false,
    };
    measure(part, cutter, path, &cut, &LIMITS, &asked, &Silent).unwrap()
}

/// Along y, at even arcs of a cylinder along y of radius `rho` (infinite: a plane), `turn` rad a pass.
fn passes(rho: f64, step: f64, turn: f64) -> Vec<[Vector2; 2]> {
    let pass = |k: i32| {
        let arc = step * f64::from(k);
        let x = if rho.is_finite() { rho * (arc / rho).sin() } else { arc };
        let aside = 3.0 * (turn * f64::from(k)).tan();
        [Vector2::new(x - aside, -3.0), Vector2::new(x + aside, 3.0)]
    };
    (-4..=4).map(pass).collect()
}

#[test]
fn calculated_and_measured_agree_on_planes_and_cylinders() {
    let shapes = [
        (AnalyticShape::Plane { height: 0.0 }, f64::INFINITY, 0.0),
        (cylinder(false), 12.0, -1.0 / 12.0),
        (cylinder(true), 12.0, 1.0 / 12.0),
    ];
    for (shape, rho, curvature) in shapes {
        let part = part(shape);
        let path = path(&part, &passes(rho, 0.5, 0.0));
        let figures = measured(&part, &Cutter::ball(6.0).unwrap(), &path).pairs;
        assert_eq!((figures.pair_count, figures.parallel_count), (8, 8), "{figures:#?}");
        let exact = BallSection::new(3.0, curvature).unwrap().height(0.5).unwrap();
        for pair in &figures.pairs {
            let all =
                [pair.measured_mean_mm, pair.calculated_mean_mm.unwrap(), pair.section_mean_mm.unwrap()];
            assert!(all.iter().all(|h| (h / exact - 1.0).abs() < 1e-4), "{exact} {pair:#?}");
            assert!(pair.greatest_difference_mm.unwrap() < 1e-6 && pair.calculated_places > 5, "{pair:#?}");
            assert!((pair.ridge_length_mm / 6.0 - 1.0).abs() < 0.03, "{pair:#?}");
        }
        assert!((figures.parallel_section_over_measured.unwrap() - 1.0).abs() < 1e-4);
        assert!(figures.reason.is_none() && figures.error_bound_mm.unwrap() < 1e-6, "{figures:#?}");
    }
}

/// Passes that spread: the balls still tell the ridge, and the section, which takes them for parallel, does
/// not.
#[test]
fn passes_that_spread_are_not_parallel() {
    let part = part(AnalyticShape::Plane { height: 0.0 });
    let path = path(&part, &passes(f64::INFINITY, 0.5, 0.04));
    let figures = measured(&part, &Cutter::ball(6.0).unwrap(), &path).pairs;
    assert_eq!(figures.parallel_count, 0);
    assert!(figures.reason.as_ref().unwrap().contains("parallel"));
    assert!((figures.calculated_over_measured.unwrap() - 1.0).abs() < 1e-4, "{figures:#?}");
    assert!(figures.pairs.iter().all(|pair| pair.greatest_difference_mm.unwrap() < 1e-6), "{figures:#?}");
}

/// Passes that cross others, squarely or not: what is calculated there is the ridge that stands there.
#[test]
fn where_passes_cross_the_ridge_is_that_of_the_place() {
    let part = part(AnalyticShape::Plane { height: 0.0 });
    for askew in [0.0, 0.05, 0.4, 1.0] {
        let coarse =
            (-1..=1).map(|k| 1.5 * f64::from(k)).map(|y| [Vector2::new(-3.0, y), Vector2::new(3.0, y)]);
        let across = (-4..=4).map(|k| 0.35 * f64::from(k));
        let across =
            across.map(|x| [Vector2::new(x - 1.5 * askew, -3.0), Vector2::new(x + 1.5 * askew, 3.0)]);
        let path = path(&part, &coarse.chain(across).collect::<Vec<_>>());
        let figures = measured(&part, &Cutter::ball(6.0).unwrap(), &path).pairs;
        assert!(figures.pairs.iter().any(|pair| pair.passes[0] < 3 && pair.calculated_places > 0), "{askew}");
        for pair in &figures.pairs {
            let difference = pair.greatest_difference_mm.unwrap_or(0.0);
            assert!(difference < 1e-3, "{askew}: {pair:#?}");
        }
        assert!((figures.calculated_over_measured.unwrap() - 1.0).abs() < 1e-3, "{askew}: {figures:#?}");
    }
}

#[test]
fn other_cutters_have_measured_heights_alone() {
    let part = part(cylinder(false));
    let path = path(&part, &passes(12.0, 0.5, 0.0));
    let figures = measured(&part, &Cutter::bull(6.0, 1.0).unwrap(), &path).pairs;
    assert!(figures.reason.unwrap().contains("ball cutters only"));
    assert!(figures.pairs.iter().all(|pair| pair.calculated_mean_mm.is_none()));
}

#[test]
fn a_line_of_the_table_has_every_column() {
    let part = part(AnalyticShape::Plane { height: 0.0 });
    let path = path(&part, &passes(f64::INFINITY, 0.5, 0.0));
    let figures = measured(&part, &Cutter::ball(6.0).unwrap(), &path).pairs;
    let columns = PAIRS_HEADER.split(',').count();
    assert!(figures.pairs.iter().all(|pair| pair.csv().split(',').count() == columns));
    let json = serde_json::to_value(&figures).unwrap();
    assert_eq!(json["pairs"].as_array().unwrap().len(), 8);
    assert!(PAIRS_HEADER.starts_with("pass_a,pass_b,crossings"));
}
