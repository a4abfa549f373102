//! Steps, walls, and whole plans against the figure that judges them.

use super::*;
use crate::vocabulary::{Joining, Links, PlanSettings, Step};
use crate::{Tilting, Zigzag, plan_tilted};
use collision::{Check, Interference, Obstacle};
use cutter::Solid;
use geometry::{AnalyticShape, AnalyticSurface};
use geometry::{Bvh, TriangleMesh};
use metrology::{fastest_turn, fastest_turn_across};
use motion::{CcPoint, ToolAxis};
use part::{Part, Patch};
use work::monitor::Silent;

/// Passes along x, half a millimetre apart, each with its lean toward y.
fn passes(cutter: &Cutter, lean: impl Fn(i32) -> f64) -> Vec<Vec<Touch>> {
    let touch = |x: i32, y: i32| {
        let point = Point3::new(0.4 * f64::from(x), 0.5 * f64::from(y), 0.0);
        let (sin, cos) = lean(y).sin_cos();
        let axis = Vector3::new(0.0, sin, cos);
        Touch::along(axis, cutter, CcPoint { point, normal: Vector3::z() }, Vector3::x())
    };
    (0..24).map(|y| (0..30).map(|x| touch(x, y)).collect()).collect()
}

fn room<'a>(cutter: &'a Cutter, keep: &'a Interference<'a>) -> Room<'a> {
    Room { cutter, keep, firm: true }
}

fn rates(across: f64) -> TurningRates {
    TurningRates { across: Some(across), along: None }
}

#[test]
fn a_step_between_two_passes_is_spread_over_those_beside() {
    let cutter = Cutter::ball(6.0).unwrap();
    let start = passes(&cutter, |y| if y < 12 { 0.1 } else { -0.1 });
    let mut got = start.clone();
    even_out(&mut got, &cutter, rates(0.1), None, &Silent).unwrap();
    let left = too_fast(&got, &cutter, rates(0.1));
    assert_eq!(left, None);
    for (a, b) in got.iter().zip(&got[1..]) {
        for (a, b) in a.iter().zip(b) {
            assert!((a.at.axis - b.at.axis).norm() <= 0.1 * 0.5 * 1.003);
        }
    }
    let turned = got[11][7].at.axis.y - got[12][7].at.axis.y;
    assert!(turned > 0.03, "no more than it takes: {turned}");
    assert_eq!((&got[..4], &got[20..]), (&start[..4], &start[20..]), "far off nothing changes");
    let centre = |touch: &Touch| touch.at.tip + touch.at.axis * 3.0 - touch.contact.point;
    assert!(got.iter().flatten().all(|touch| (centre(touch) - Vector3::z() * 3.0).norm() < 1e-12));
}

#[test]
fn what_holds_is_left_alone() {
    let cutter = Cutter::bull(6.0, 1.0).unwrap();
    let start = passes(&cutter, |y| 0.01 * f64::from(y));
    let mut got = start.clone();
    even_out(&mut got, &cutter, rates(0.021), None, &Silent).unwrap();
    assert_eq!(got, start);
}

#[test]
fn axes_that_must_lean_are_held_and_the_others_come_to_them() {
    let cutter = Cutter::ball(6.0).unwrap();
    // Beside the last pass, and beside the first, stands a wall that overhangs: the tool must lean away from
    // it.
    let wall = |y: f64, over: f64| {
        let corner = |x: f64, z: f64| Point3::new(x, y + over * z, z);
        let vertices = vec![corner(-30.0, 0.0), corner(40.0, 0.0), corner(40.0, 12.0), corner(-30.0, 12.0)];
        let mesh = TriangleMesh::new(vertices, vec![[0, 1, 2], [0, 2, 3]]).unwrap().0;
        (Bvh::new(&mesh), mesh)
    };
    let (first, last) = (wall(-4.9, 0.45), wall(16.4, -0.45));
    let solid = Solid::of_cutter(&cutter, None);
    fn check<'a>(solid: &'a Solid, (tree, mesh): &'a (Bvh, TriangleMesh)) -> Check<'a> {
        Check { solid, obstacle: Obstacle::new(mesh, tree), needed: 0.1 }
    }
    let one = Interference { checks: vec![check(&solid, &last)], ..Interference::default() };
    let both =
        Interference { checks: vec![check(&solid, &first), check(&solid, &last)], ..Interference::default() };
    let is_clear = |keep: &Interference, passes: &[Vec<Touch>]| {
        passes.iter().flatten().all(|touch| keep.is_clear(&touch.at))
    };
    let start = passes(&cutter, |y| if y < 12 { 0.0 } else { -0.45 });
    let mut got = start.clone();
    even_out(&mut got, &cutter, rates(0.02), Some(room(&cutter, &one)), &Silent).unwrap();
    let left = too_fast(&got, &cutter, rates(0.02));
    assert!(is_clear(&one, &start) && is_clear(&one, &got));
    assert_eq!(left, None);
    assert_eq!(got[23], start[23], "held");
    assert!(got[0][0].at.axis.y < -0.1, "and the first comes to the last");
    // Both cannot be had between two walls.
    let start = passes(&cutter, |y| 0.45 * (11.5 - f64::from(y)) / 11.5);
    let mut got = start.clone();
    even_out(&mut got, &cutter, rates(1e-3), Some(room(&cutter, &both)), &Silent).unwrap();
    let left = too_fast(&got, &cutter, rates(1e-3));
    assert!(is_clear(&both, &start) && is_clear(&both, &got));
    assert!(left.is_some_and(|left| left.worst > 1e-3 && left.count > 0), "{left:?}");
}

/// A wave that is as steep as 32 degrees, the side of a cylinder over its top, and a hollow.
fn parts() -> Vec<Part> {
    let part = |shape, x: [f64; 2], y: [f64; 2]| {
        let surface = AnalyticSurface::new(shape, [x, y]).unwrap();
        Part::from_patches(vec![Patch::Analytic(surface)], 0.002).unwrap()
    };
    let wave = AnalyticShape::Wave { amplitude: 5.0, wavelength_x: 50.0, wavelength_y: Some(50.0) };
    vec![
        part(wave, [0.0, 25.0], [0.0, 25.0]),
        part(
            AnalyticShape::Cylinder { height: 20.0, radius: 20.0, azimuth: 0.0, concave: false },
            [-15.0, 15.0],
            [0.0, 12.0],
        ),
        part(
            AnalyticShape::Sphere { height: 0.0, radius: 20.0, concave: true },
            [-10.0, 10.0],
            [-10.0, 10.0],
        ),
    ]
}

/// The limits hold in the path, by the figure that judges it, and so does what the tool keeps away from.
#[test]
fn plans_turn_no_faster_than_asked() {
    let guide = |x: f64, lean: f64| (Point3::new(x, 0.0, 0.0), Vector3::new(lean, 0.1, 1.0).normalize());
    let rules = [
        ToolAxis::LeadTilt { lead: 0.0, tilt: 0.0 },
        ToolAxis::LeadTilt { lead: 0.15, tilt: 0.1 },
        ToolAxis::Fixed(Vector3::new(0.1, 0.0, 1.0).normalize()),
        ToolAxis::Away(vec![Point3::new(0.0, 5.0, -25.0)]),
        ToolAxis::Between(vec![guide(-12.0, -0.3), guide(3.0, 0.3), guide(15.0, -0.3)]),
    ];
    let cutters = [Cutter::ball(6.0).unwrap(), Cutter::bull(6.0, 1.0).unwrap()];
    let limits = [[Some(1.0), None], [Some(0.01), None], [Some(1.0), Some(2.0)]];
    let joining =
        [Joining::default(), Joining { smoothing: true, links: Links::Surface, ..Joining::default() }];
    for (p, part) in parts().iter().enumerate() {
        for (c, cutter) in cutters.iter().enumerate() {
            let solid = Solid::of_cutter(cutter, None);
            let obstacle = Obstacle::new(part.mesh(), part.bvh());
            let keep = Interference {
                checks: vec![Check { solid: &solid, obstacle, needed: -0.01 }],
                greatest_tilt: 0.8,
                greatest_lift: 0.0,
            };
            for (r, rule) in rules.iter().enumerate() {
                let [along, across] = limits[(p + c + r) % 3].map(|rate| rate.map(f64::to_radians));
                let settings = PlanSettings {
                    step: Step::Stepover(2.5),
                    chord_tolerance: 0.01,
                    clearance: 2.0,
                    stock_top: 8.0,
                    feed_rate: 1000.0,
                    plunge_rate: 300.0,
                    joining: joining[(p + r) % 2],
                    ..PlanSettings::default()
                };
                // In a hollow the flat of a bull nose may touch beside the contact that was planned: as a job
                // does, such a path is planned for lower rates. All others hold at once.
                let at_once = cutter.is_ball() || p == 1;
                let mut share = 0.99;
                let (path, what) = loop {
                    let lower = |rate: Option<f64>| rate.map(|rate| share * rate);
                    let tilting = Tilting {
                        axis: rule,
                        most_turning: lower(along),
                        most_turning_across: lower(across),
                        interference: Some(&keep),
                    };
                    let plan =
                        plan_tilted(part, cutter, &Zigzag::at(0.0), &tilting, &settings, &Silent).unwrap();
                    let path = plan.path.as_written();
                    let turns = [
                        (along, fastest_turn(part, cutter, &path, &Silent).unwrap()),
                        (across, fastest_turn_across(part, cutter, &path, &Silent).unwrap()),
                    ];
                    let over =
                        turns.iter().filter_map(|(limit, found)| Some(found.as_ref()?.rate / (*limit)?));
                    let over = over.fold(0.0, f64::max);
                    let what = format!("part {p}, cutter {c}, rule {r}: {over} {:?}", plan.notes);
                    if over <= 1.0 {
                        break (path, what);
                    }
                    assert!(!at_once && share > 0.2, "{what}");
                    share *= 0.97 / over;
                };
                assert!(keep.on_path(&path, |to| to.kind == motion::MoveKind::Cut).is_empty(), "{what}");
            }
        }
    }
}
