//! One cutter under the words of several families: what it plans, cuts and measures is a matter of its
//! profile.

use millstream::cutter::{AptWords, Cutter};
use millstream::drop_cutter::DropCutter;
use millstream::geometry::{Aabb, AnalyticShape, AnalyticSurface, Point3};
use millstream::metrology::{Asked, Limits, measure};
use millstream::monitor::Silent;
use millstream::motion::{MoveKind, ToolAxis, Toolpath};
use millstream::part::{Part, Patch};
use millstream::sim::{Grid, ZMap, cut};
use millstream::toolpath::{
    FrontStart, IsoScallop, Joining, LevelSteps, OffsetAlong, OffsetDrive, OffsetSurface, PlanSettings,
    Spiral, Step, Strategy, Tilting, Waterline, Zigzag, plan, plan_tilted,
};

use crate::support::height_mesh;

/// A ball of 6 mm as `ball`, as `bull` with its radius at the corner, and by the seven words.
fn balls() -> [Cutter; 3] {
    let words = AptWords {
        diameter: 6.0,
        corner_radius: 3.0,
        corner_x: 0.0,
        corner_z: 3.0,
        tip_angle: 0.0,
        side_angle: 0.0,
        length: 20.0,
    };
    [Cutter::ball(6.0).unwrap(), Cutter::bull(6.0, 3.0).unwrap(), Cutter::apt(&words).unwrap()]
}

/// A hollow of radius 30 mm.
fn hollow() -> Part {
    let shape = AnalyticShape::Cylinder { height: 0.0, radius: 30.0, azimuth: 0.3, concave: true };
    let surface = AnalyticSurface::new(shape, [[-6.0, 6.0], [0.0, 8.0]]).unwrap();
    Part::from_patches(vec![Patch::Analytic(surface)], 0.002).unwrap()
}

fn settings(part: &Part) -> PlanSettings {
    PlanSettings {
        step: Step::Scallop(0.02),
        chord_tolerance: 0.002,
        clearance: 2.0,
        stock_top: part.bounds().max.z + 1.0,
        feed_rate: 1000.0,
        plunge_rate: 300.0,
        joining: Joining::default(),
        ..PlanSettings::default()
    }
}

/// Asserts that all three plan the same moves; leaves those of the first.
fn same(of: impl Fn(&Cutter) -> Toolpath) -> Toolpath {
    let [ball, bull, apt] = balls().map(|cutter| of(&cutter));
    assert!(!ball.moves.is_empty());
    assert_eq!(bull, ball);
    assert_eq!(apt, ball);
    ball
}

#[test]
fn a_ball_by_any_name_plans_cuts_and_measures_the_same() {
    let part = hollow();
    let settings = settings(&part);
    let zigzag = Zigzag::at(0.4);
    let offset = OffsetSurface { along: OffsetAlong::U, drive: OffsetDrive::Exact };
    let upright = |strategy: &dyn Strategy| {
        same(|cutter: &Cutter| plan(&part, cutter, strategy, &settings, &Silent).unwrap().path)
    };
    upright(&offset);
    let path = upright(&zigzag);
    let axis = ToolAxis::LeadTilt { lead: 0.2, tilt: 0.1 };
    let tilting = Tilting { axis: &axis, most_turning: None, most_turning_across: None, interference: None };
    same(|cutter| plan_tilted(&part, cutter, &zigzag, &tilting, &settings, &Silent).unwrap().path);

    let area = Aabb { min: Point3::new(-6.0, 0.0, 0.0), max: Point3::new(6.0, 8.0, 0.0) };
    let grid = Grid::covering(&area, 0.1, 80, 1 << 30).unwrap();
    let stock = || ZMap::block(grid, settings.stock_top);
    let limits = Limits { scallop: 0.02, gouge: 0.005, uncut: 0.05, chord: 0.002 };
    let asked = Asked {
        allowed_depth: 0.0,
        error_bound: 0.0005,
        most_cells: 1 << 22,
        most_squares: 1 << 22,
        is_first_look: false,
        border_cuts: true,
        steep_elsewhere: false,
    };
    let of = |cutter: &Cutter| {
        let cut = cut(stock(), cutter, &path, &Silent).unwrap();
        let measured = measure(&part, cutter, &path, &cut, &limits, &asked, &Silent).unwrap();
        (cut.height, format!("{:?} {:?}", measured.scallop, measured.gouge))
    };
    let [ball, bull, apt] = balls().map(|cutter| of(&cutter));
    assert!(bull == ball && apt == ball);
}

/// Where the surface turns from rising to falling, a flat swings to its other side. No place of any move lies
/// below the cutter that is dropped there.
#[test]
fn a_flat_that_swings_to_its_other_side_is_carried_over_the_part() {
    let hill = |x: f64, y: f64, wide: f64| (-(x * x + y * y) / (2.0 * wide * wide)).exp();
    let relief = |x: f64, y: f64| {
        let (x, y) = (x - 4.0, y - 3.0);
        0.5 * hill(x + 2.0, y + 1.0, 1.6) - 0.45 * hill(x - 2.0, y - 1.0, 1.8) + 0.03 * x * y
    };
    let part = Part::from_mesh(height_mesh(80, [8.0, 6.0], relief));
    let cutter = Cutter::bull(6.0, 1.0).unwrap();
    let settings = PlanSettings { step: Step::Scallop(0.02), ..settings(&part) };
    let front = IsoScallop { start: FrontStart::BestBorder };
    let level = Waterline { steps: LevelSteps::Shortest };
    for strategy in [&level as &dyn Strategy, &front] {
        let deepest = deepest(&part, &cutter, strategy, &settings);
        assert!(deepest <= 2.0 * settings.chord_tolerance, "{strategy:?} {deepest}");
    }
}

/// How far moves of a plan lie below the cutter that is dropped there at most, mm.
fn deepest(part: &Part, cutter: &Cutter, strategy: &dyn Strategy, settings: &PlanSettings) -> f64 {
    let drop = DropCutter::new(part, cutter);
    let path = plan(part, cutter, strategy, settings, &Silent).unwrap().path;
    let cutting = path.segments().filter(|(.., step)| step.kind == MoveKind::Cut);
    let places = cutting.flat_map(|(from, to, _)| {
        let count = ((to - from).norm() / 0.02).ceil().max(8.0) as usize;
        (0..=count).map(move |k| from + (to - from) * (k as f64 / count as f64))
    });
    let below = |tip: Point3| drop.at(tip.x, tip.y).map_or(f64::NEG_INFINITY, |drop| drop.tip_z - tip.z);
    places.map(below).fold(f64::NEG_INFINITY, f64::max)
}

/// Passes that lie far apart roll over a corner of the part until the corner of the cutter stands upright on
/// it: a chord that is off by little cuts it deeper by much.
#[test]
fn rolls_over_corners_cut_them_no_deeper_than_chords_may() {
    let plane = AnalyticShape::Plane { height: 0.0 };
    let surface = AnalyticSurface::new(plane, [[-4.0, 4.0], [-3.0, 3.0]]).unwrap();
    let part = Part::from_patches(vec![Patch::Analytic(surface)], 0.002).unwrap();
    let cutter = Cutter::bull(6.0, 1.0).unwrap();
    let settings = PlanSettings { step: Step::Scallop(0.3), chord_tolerance: 0.004, ..settings(&part) };
    for strategy in [&Spiral::Plan as &dyn Strategy, &Zigzag::at(0.4)] {
        let deepest = deepest(&part, &cutter, strategy, &settings);
        assert!(deepest <= settings.chord_tolerance, "{strategy:?} {deepest}");
    }
}
