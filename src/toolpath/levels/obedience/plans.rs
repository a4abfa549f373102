//! Plans of small parts, whose directions are known in closed form: what is reported is what their finished
//! moves do.

use crate::plan::{Plan, plan};
use crate::strategies::shortest::{Objective, ShortestStreamline};
use crate::strategies::streamline::{StreamMethod, Streamline};
use crate::vocabulary::{Along, FeedDirection, Lines, PlanSettings, Step, Strategy};
use cutter::Cutter;
use field::mesh::Sense;
use field::{DirectionError, LineField, LineSample, SamplePlane};
use geometry::{AnalyticShape, AnalyticSurface, Point2, Point3, Vector3};
use part::{Part, Patch};
use std::sync::Arc;
use work::monitor::Silent;

const PLANE: AnalyticShape = AnalyticShape::Plane { height: 0.0 };
const WAVE: AnalyticShape =
    AnalyticShape::Wave { amplitude: 1.0, wavelength_x: 14.0, wavelength_y: Some(12.0) };

const RADIUS: f64 = 3.0;

/// Moves shorter than this, mm, are rounding.
const SHORTEST: f64 = 0.02;

fn part(shape: AnalyticShape, ranges: [[f64; 2]; 2]) -> Part {
    Part::from_patches(vec![Patch::Analytic(AnalyticSurface::new(shape, ranges).unwrap())], 0.002).unwrap()
}

fn planned(part: &Part, strategy: &dyn Strategy) -> (Plan, DirectionError) {
    let settings = PlanSettings {
        step: Step::Scallop(0.03),
        stock_top: part.bounds().max.z + 1.0,
        ..PlanSettings::default()
    };
    let plan = plan(part, &Cutter::ball(2.0 * RADIUS).unwrap(), strategy, &settings, &Silent).unwrap();
    let error = plan.field.as_ref().unwrap().direction_error.unwrap();
    (plan, error)
}

/// Root mean square and greatest angle, degrees, between the contacts of the finished moves and a direction:
/// a tangent of the surface by place and unit normal.
fn of_moves(plan: &Plan, part: &Part, asked: impl Fn(&Point3, &Vector3) -> Option<Vector3>) -> [f64; 2] {
    let (mut squares, mut length, mut most) = (0.0, 0.0, 0.0f64);
    for pass in &plan.kept.passes {
        let feet: Vec<_> =
            pass.iter().map(|tip| part.closest_point(&(tip + Vector3::z() * RADIUS)).0).collect();
        for ends in feet.windows(2) {
            let (a, b) = (&ends[0], &ends[1]);
            // Feet of places beyond the border lie on it.
            let on_part = ends.iter().all(|foot| {
                let b = part.bounds();
                [
                    foot.point.x - b.min.x,
                    b.max.x - foot.point.x,
                    foot.point.y - b.min.y,
                    b.max.y - foot.point.y,
                ]
                .iter()
                .all(|inside| *inside > 1e-6)
            });
            let (way, normal) = (b.point - a.point, (a.normal + b.normal).normalize());
            let Some(asked) = asked(&nalgebra::center(&a.point, &b.point), &normal) else { continue };
            if on_part && way.norm() > SHORTEST {
                let angle = super::off(&way.normalize(), &normal, &asked).abs().to_degrees();
                (squares, length) = (squares + way.norm() * angle.powi(2), length + way.norm());
                most = most.max(angle);
            }
        }
    }
    [(squares / length).sqrt(), most]
}

/// What is reported is as great as what moves do, within its bound and what chords are off their curves.
/// Contacts by elements turn more sharply than chords show, where the surface is nearly as concave as the
/// cutter: by up to two thirds.
fn is_told(name: &str, error: &DirectionError, [rms, most]: [f64; 2], slack: f64) {
    let [told_rms, told, bound] = [error.rms, error.max, error.error_bound].map(f64::to_degrees);
    println!("{name}: {told_rms:.3} {told:.3} ± {bound:.3} at {:?}, moves {rms:.3} {most:.3}", error.at);
    assert!((told_rms - rms).abs() < 0.1 + slack * rms, "{name}: {told_rms} {rms}");
    assert!(
        told + bound > most - 0.5 && told < 1.5 + (1.0 + slack) * most,
        "{name}: {told} ± {bound}, {most}"
    );
}

fn at_angle(angle: f64) -> impl Fn(&Point3, &Vector3) -> Option<Vector3> {
    move |_, normal| Vector3::new(-angle.sin(), angle.cos(), 0.0).cross(normal).try_normalize(1e-9)
}

/// On a wave, by splines and by elements, levels and traced lines.
#[test]
fn angles_of_the_moves_are_told() {
    let part = part(WAVE, [[0.0, 14.0], [0.0, 12.0]]);
    for (method, lines) in [
        (StreamMethod::Automatic, Lines::Levels),
        (StreamMethod::Elements, Lines::Levels),
        (StreamMethod::Elements, Lines::RungeKutta),
    ] {
        for direction_weight in [0.3, 100.0] {
            let angle = 30f64.to_radians();
            let along = Streamline::along(FeedDirection::Angle(angle));
            let strategy = Streamline { method, lines, direction_weight, ..along };
            let (plan, error) = planned(&part, &strategy);
            let moves = of_moves(&plan, &part, at_angle(angle));
            let slack = if method == StreamMethod::Elements { 0.67 } else { 0.1 };
            is_told(&format!("{method:?} {lines:?} {direction_weight}"), &error, moves, slack);
            assert!((0.0..=14.0).contains(&error.at.x) && (0.0..=12.0).contains(&error.at.y), "{error:?}");
        }
    }
}

/// Slopes count alike from a degree on, whatever a fit makes of gentle ones.
#[test]
fn gentle_slopes_count_as_much_as_others() {
    let shape = AnalyticShape::Wave { amplitude: 2.0, wavelength_x: 60.0, wavelength_y: Some(30.0) };
    let part = part(shape, [[10.0, 20.0], [-3.0, 9.0]]);
    let strategy =
        ShortestStreamline { toward: Some((FeedDirection::Contour, 1.0)), objective: Objective::Length };
    let (plan, error) = planned(&part, &strategy);
    let contour = |_: &Point3, normal: &Vector3| {
        let level = Vector3::z().cross(normal);
        (level.norm() >= 1f64.to_radians().sin()).then(|| level.normalize())
    };
    is_told("contour", &error, of_moves(&plan, &part, contour), 0.1);
}

/// Lines along x in one half of a plate and steep ones that hardly count for the fit in the other.
#[test]
fn rows_count_alike_whatever_their_weight() {
    let part = part(PLANE, [[0.0, 14.0], [0.0, 12.0]]);
    let angle = |x: f64| if x < 7.0 { 0.0 } else { 70f64.to_radians() };
    let sample = |k: usize| {
        let at = [0.5 * (k % 29) as f64, 0.5 * (k / 29) as f64];
        let line = [angle(at[0]).cos(), angle(at[0]).sin()];
        LineSample { at, line, weight: if at[0] < 7.0 { 1.0 } else { 0.05 } }
    };
    let samples: Vec<_> = (0..29 * 25).map(sample).collect();
    let field = Arc::new(LineField::new(SamplePlane::Plan, &samples).unwrap());
    let strategy = ShortestStreamline {
        toward: Some((FeedDirection::Samples(field), 1.0)),
        objective: Objective::Length,
    };
    let (plan, error) = planned(&part, &strategy);
    let moves = of_moves(&plan, &part, |p, normal| at_angle(angle(p.x))(p, normal));
    is_told("weights", &error, moves, 0.1);
    assert!(error.max > 1.0, "70 degrees are not left out: {error:?}");
}

/// A table of circles whose stream function is found: passes are told to follow it in the middle as well.
#[test]
fn the_middle_of_a_table_is_no_fault_of_passes() {
    let part = part(PLANE, [[0.0, 14.0], [0.0, 12.0]]);
    let (x0, y0) = (7.01, 6.01);
    let sample = |k: usize| {
        let at = [0.5 * (k % 29) as f64, 0.5 * (k / 29) as f64];
        LineSample { at, line: [y0 - at[1], at[0] - x0], weight: 1.0 }
    };
    let samples: Vec<_> = (0..29 * 25).map(sample).collect();
    let strategy = Streamline {
        method: StreamMethod::Published,
        ..Streamline::along(FeedDirection::File {
            name: "circles.txt".into(),
            samples: LineField::new(SamplePlane::Parameters, &samples).map(Arc::new),
        })
    };
    let (plan, error) = planned(&part, &strategy);
    // Circles but for the one pass at their middle.
    let circles = |p: &Point3, _: &Vector3| {
        let from = p - Point3::new(x0, y0, p.z);
        (from.norm() > 1.0).then(|| Vector3::z().cross(&from).normalize())
    };
    let [rms, most] = of_moves(&plan, &part, circles);
    println!("{error:?} {rms} {most}");
    let [told, max] = [error.rms, error.max].map(f64::to_degrees);
    assert!((told - rms).abs() < 0.5 && max < 5.0, "{told} {max}, moves {rms} {most}");
}

/// A zigzag of steep stretches as a guide: passes smooth over it, and are off the guide by what it is steep.
#[test]
fn guides_are_the_measure_themselves() {
    let part = part(PLANE, [[0.0, 14.0], [0.0, 12.0]]);
    let point = |k: i32| Point2::new(f64::from(k), if k % 2 == 0 { 5.2 } else { 6.8 });
    let curves = Arc::new(vec![(0..=14).map(point).collect::<Vec<_>>()]);
    for method in [StreamMethod::Automatic, StreamMethod::Elements] {
        let direction = FeedDirection::Guides { curves: curves.clone(), sense: Sense::Along };
        let (_, error) = planned(&part, &Streamline { method, ..Streamline::along(direction) });
        let [rms, max] = [error.rms, error.max].map(f64::to_degrees);
        println!("{method:?}: {rms} {max}");
        assert!(rms > 20.0 && max > 35.0, "{method:?}: {rms} {max}");
    }
    // A straight one is followed.
    let curves = Arc::new(vec![vec![Point2::new(0.0, 3.0), Point2::new(14.0, 8.0)]]);
    let direction = FeedDirection::Guides { curves, sense: Sense::Across };
    let (_, error) = planned(&part, &Streamline::along(direction));
    assert!(error.max.to_degrees() < 0.5, "{error:?}");
}

/// On a sphere no strip is wider than another, and of a level plate there is no contour: nothing is asked.
#[test]
fn nothing_is_asked_where_there_is_no_direction() {
    let shape = AnalyticShape::Sphere { height: 0.0, radius: 20.0, concave: false };
    let part = part(shape, [[-4.0, 4.0], [-3.0, 3.0]]);
    let settings = PlanSettings { stock_top: part.bounds().max.z + 1.0, ..PlanSettings::default() };
    let strategy =
        Streamline { method: StreamMethod::Elements, ..Streamline::along(FeedDirection::WidestStrip) };
    let plan = plan(&part, &Cutter::ball(6.0).unwrap(), &strategy, &settings, &Silent).unwrap();
    assert_eq!(plan.field.as_ref().unwrap().direction_error, None);
    let along = Streamline::along(FeedDirection::Parameter(Along::V));
    let (_, error) = planned(&part, &along);
    assert!(error.max.to_degrees() < 3.0, "{error:?}");
}
