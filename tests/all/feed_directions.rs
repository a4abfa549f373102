//! Feed directions of slopes, curves, borders, blends and samples, on charts and on meshes, against closed
//! forms.

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

use millstream::cutter::Cutter;
use millstream::field::PlannedField;
use millstream::field::mesh::Sense;
use millstream::field::{DIRECTION_WEIGHT, KnotRule, LineField, LineSample, SamplePlane, Solver};
use millstream::geometry::{AnalyticShape, Point2, Point3};
use millstream::monitor::Silent;
use millstream::motion::{MoveKind, Toolpath};
use millstream::part::Part;
use millstream::toolpath::{
    FeedDirection, Lines, Objective, PlanError, ShortestStreamline, Step, StreamMethod, Streamline, plan,
};

use crate::command::{PLATE, millstream};
use crate::support::{formula, mesh, settings};

const SPLINE: StreamMethod = StreamMethod::BSpline { degree: 3, knots: KnotRule::Uniform };

/// Every way to fit a stream function.
const METHODS: [(StreamMethod, Solver); 3] = [
    (SPLINE, Solver::Cholesky),
    (StreamMethod::Differences, Solver::ConjugateGradient),
    (StreamMethod::Elements, Solver::Cholesky),
];

fn planned(
    part: &Part,
    direction: &FeedDirection,
    (method, solver): (StreamMethod, Solver),
) -> Result<Toolpath, PlanError> {
    let strategy = Streamline {
        direction: direction.clone(),
        control_points: 12,
        method,
        solver,
        direction_weight: DIRECTION_WEIGHT,
        lines: Lines::Levels,
    };
    let cutter = Cutter::ball(6.0).unwrap();
    plan(part, &cutter, &strategy, &settings(part, Step::Stepover(0.6)), &Silent).map(|plan| plan.path)
}

fn fields(
    part: &Part,
    direction: FeedDirection,
    (method, solver): (StreamMethod, Solver),
) -> Arc<PlannedField> {
    let strategy = Streamline {
        direction,
        control_points: 24,
        method,
        solver,
        direction_weight: DIRECTION_WEIGHT,
        lines: Lines::Levels,
    };
    let cutter = Cutter::ball(6.0).unwrap();
    plan(part, &cutter, &strategy, &settings(part, Step::Stepover(0.6)), &Silent).unwrap().field.unwrap()
}

/// Share of the cutting length within a rectangle of the plan view that is off the wanted direction, a
/// function of the place, by more than `most` rad.
fn share_off(path: &Toolpath, [x, y]: [[f64; 2]; 2], most: f64, wanted: impl Fn(&Point3) -> f64) -> f64 {
    let (mut off, mut all) = (0.0, 0.0);
    for (from, to) in path.moves.iter().zip(&path.moves[1..]) {
        let (a, b) = (from.to.tip, to.to.tip);
        let d = b - a;
        let middle = Point3::from((a.coords + b.coords) * 0.5);
        let inside = middle.x > x[0] && middle.x < x[1] && middle.y > y[0] && middle.y < y[1];
        if to.kind != MoveKind::Cut || d.xy().norm() < 1e-6 || !inside {
            continue;
        }
        let turn = d.y.atan2(d.x) - wanted(&middle);
        let turn = (turn - PI * (turn / PI).round()).abs();
        all += d.xy().norm();
        off += if turn > most { d.xy().norm() } else { 0.0 };
    }
    assert!(all > 10.0, "{all} mm of cuts");
    off / all
}

/// All of it but a margin, over which fields are continued.
const INSIDE: [[f64; 2]; 2] = [[1.0, 29.0], [1.0, 19.0]];

fn plate() -> Part {
    formula(AnalyticShape::Plane { height: 0.0 }, [0.0, 30.0], [0.0, 20.0])
}

/// A frustum's side, z = 40 − r/2 over part of the ring from radius 20 to 60 round the origin, as triangles.
fn cone() -> Part {
    let n = 60;
    let at = |i: usize, j: usize| {
        let (r, a) = (20.0 + 20.0 * j as f64 / n as f64, FRAC_PI_2 * i as f64 / n as f64);
        Point3::new(r * a.cos(), r * a.sin(), 40.0 - 0.5 * r)
    };
    let vertices = (0..=n).flat_map(|j| (0..=n).map(move |i| at(i, j))).collect();
    let corner = |i: usize, j: usize| (j * (n + 1) + i) as u32;
    let triangles = (0..n).flat_map(|j| (0..n).map(move |i| (i, j))).flat_map(|(i, j)| {
        [
            [corner(i, j), corner(i + 1, j + 1), corner(i + 1, j)],
            [corner(i, j), corner(i, j + 1), corner(i + 1, j + 1)],
        ]
    });
    mesh(vertices, triangles.collect())
}

#[test]
fn on_a_tilted_plane_steepest_is_the_slope_and_contour_is_level() {
    let azimuth = 0.4;
    let shape = AnalyticShape::Inclined { height: 0.0, angle: 0.3, azimuth };
    let part = formula(shape, [0.0, 30.0], [0.0, 20.0]);
    for method in METHODS {
        let up = planned(&part, &FeedDirection::Steepest, method).unwrap();
        assert!(share_off(&up, INSIDE, 0.005, |_| azimuth) < 0.01, "{method:?}");
        let level = planned(&part, &FeedDirection::Contour, method).unwrap();
        assert!(share_off(&level, INSIDE, 0.005, |_| azimuth + FRAC_PI_2) < 0.01, "{method:?}");
    }
}

#[test]
fn on_a_cone_contours_are_circles_and_the_steepest_lines_are_rays() {
    const BESIDE: [[f64; 2]; 2] = [[12.0, 28.0], [12.0, 28.0]];
    let part = cone();
    let method = METHODS[2];
    let circles = planned(&part, &FeedDirection::Contour, method).unwrap();
    assert!(share_off(&circles, BESIDE, 0.03, |p| p.y.atan2(p.x) + FRAC_PI_2) < 0.02);
    let rays = planned(&part, &FeedDirection::Steepest, method).unwrap();
    // The density of passes, which rays cannot keep, bends them away from their bisector.
    assert!(share_off(&rays, [[19.0, 24.0]; 2], 0.06, |p| p.y.atan2(p.x)) < 0.02);
    // On charts: the heights of a sphere, too, are circles.
    let dome = AnalyticShape::Sphere { height: 0.0, radius: 80.0, concave: false };
    let dome = formula(dome, [10.0, 40.0], [10.0, 30.0]);
    for method in &METHODS[..2] {
        let circles = planned(&dome, &FeedDirection::Contour, *method).unwrap();
        assert!(share_off(&circles, BESIDE, 0.03, |p| p.y.atan2(p.x) + FRAC_PI_2) < 0.02, "{method:?}");
    }
}

#[test]
fn one_straight_guide_gives_parallel_passes() {
    let part = plate();
    let curves = Arc::new(vec![vec![Point2::new(-5.0, 2.0), Point2::new(40.0, 17.0)]]);
    let along = 15f64.atan2(45.0);
    for method in METHODS {
        for (sense, angle) in [(Sense::Along, along), (Sense::Across, along + FRAC_PI_2)] {
            let direction = FeedDirection::Guides { curves: curves.clone(), sense };
            let path = planned(&part, &direction, method).unwrap();
            assert!(share_off(&path, INSIDE, 0.005, |_| angle) < 0.01, "{method:?} {sense:?}");
        }
    }
}

/// Passes run along or across the longer borders close to them, away from their corners.
#[test]
fn borders_are_followed_or_met_square() {
    let part = plate();
    for method in METHODS {
        for (sense, along) in [(Sense::Along, 0.0), (Sense::Across, FRAC_PI_2)] {
            let path = planned(&part, &FeedDirection::Border(sense), method).unwrap();
            for y in [[0.0, 1.5], [18.5, 20.0]] {
                let off = share_off(&path, [[12.0, 18.0], y], 0.25, |_| along);
                assert!(off < 0.02, "{method:?} {sense:?}: {off}");
            }
        }
    }
}

#[test]
fn blends_are_means_of_doubled_angles() {
    let part = plate();
    let angle = |degrees: f64| FeedDirection::Angle(degrees.to_radians());
    for method in METHODS {
        for (parts, mean) in [
            // One with itself is itself, for opposite arrows as well.
            (vec![(angle(25.0), 1.0), (angle(205.0), 3.0)], 25f64.to_radians()),
            (vec![(angle(0.0), 2.0), (angle(90.0), 1.0)], 0.0),
            // 2 e^0 + 1 e^(2i 60°) points at 30°, half of it is 15°.
            (vec![(angle(0.0), 2.0), (angle(60.0), 1.0)], 15f64.to_radians()),
        ] {
            let path = planned(&part, &FeedDirection::Blend(parts.clone()), method).unwrap();
            assert!(share_off(&path, INSIDE, 0.005, |_| mean) < 0.01, "{method:?} {parts:?}");
        }
        let cancels = FeedDirection::Blend(vec![(angle(10.0), 1.5), (angle(100.0), 1.5)]);
        let said = planned(&part, &cancels, method).unwrap_err().to_string();
        assert!(said.contains("from (0.0, 0.0) to (30.0, 20.0): the blended directions cancel"), "{said}");
        let slope = FeedDirection::Blend(vec![(FeedDirection::Steepest, 5.0), (angle(30.0), 0.1)]);
        let path = planned(&part, &slope, method).unwrap();
        assert!(
            share_off(&path, INSIDE, 0.005, |_| 30f64.to_radians()) < 0.01,
            "level ground leaves the other"
        );
        let said = planned(&part, &FeedDirection::Steepest, method).unwrap_err().to_string();
        assert!(said.contains("the part is level there"), "{said}");
    }
}

#[test]
fn samples_are_followed_on_meshes_and_by_elements() {
    let sample = |k: usize| {
        let at = [30.0 * ((k * 37) % 599) as f64 / 598.0, 20.0 * ((k * 101) % 593) as f64 / 592.0];
        let sign = if k.is_multiple_of(3) { -1.0 } else { 1.0 };
        LineSample { at, line: [-sign * (at[1] + 15.0), sign * (at[0] + 20.0)], weight: 1.0 }
    };
    let samples: Vec<LineSample> = (0..600).map(sample).collect();
    let circle = |p: &Point3| (p.y + 15.0).atan2(p.x + 20.0) + FRAC_PI_2;
    let corners = [[0.0, 0.0], [30.0, 0.0], [30.0, 20.0], [0.0, 20.0]].map(|[x, y]| Point3::new(x, y, 0.0));
    let flat = mesh(corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
    for plane in [SamplePlane::Plan, SamplePlane::Parameters] {
        let direction = FeedDirection::Samples(Arc::new(LineField::new(plane, &samples).unwrap()));
        // u and v of a plane by formula, and of a mesh, are x and y.
        for part in [&plate(), &flat] {
            let path = planned(part, &direction, METHODS[2]).unwrap();
            assert!(share_off(&path, INSIDE, 0.02, circle) < 0.02, "{plane:?}");
        }
    }
    let far: Vec<LineSample> =
        samples.iter().map(|s| LineSample { at: [s.at[0] + 99.0, s.at[1]], ..*s }).collect();
    let far = FeedDirection::Samples(Arc::new(LineField::new(SamplePlane::Plan, &far).unwrap()));
    let said = planned(&flat, &far, METHODS[2]).unwrap_err().to_string();
    assert!(said.contains("all 600 sampled directions lie outside of it"), "{said}");
}

#[test]
fn guides_off_the_part_are_refused_in_blends_as_well() {
    let curves = Arc::new(vec![vec![Point2::new(90.0, 2.0), Point2::new(99.0, 17.0)]]);
    let guide = FeedDirection::Guides { curves, sense: Sense::Along };
    let blend = FeedDirection::Blend(vec![(FeedDirection::WidestStrip, 1.0), (guide.clone(), 1.0)]);
    for (direction, method) in [guide, blend].iter().flat_map(|d| METHODS.map(|m| (d, m))) {
        let said = planned(&plate(), direction, method).unwrap_err().to_string();
        assert!(said.contains("all 1 guide curves lie outside of it (x from 90 to 99"), "{said}");
    }
}

/// On a dome steepest lines are rays and heights are circles: both turn once around the top. A saddle's
/// heights turn once the other way, and the borders of a rectangle once around it.
#[test]
fn singular_points_are_named_with_their_index() {
    let dome = AnalyticShape::Sphere { height: 0.0, radius: 80.0, concave: false };
    let dome = formula(dome, [-15.0, 14.0], [-10.0, 12.0]);
    let saddle = AnalyticShape::Saddle { radius_concave: 60.0, radius_convex: 60.0 };
    let saddle = formula(saddle, [-15.0, 14.0], [-10.0, 12.0]);
    for method in METHODS {
        for (part, direction, half_turns) in [
            (&dome, FeedDirection::Steepest, 2),
            (&dome, FeedDirection::Contour, 2),
            (&saddle, FeedDirection::Contour, -2),
        ] {
            let field = fields(part, direction.clone(), method);
            // Elements smooth lines, which parts a point of index 1 into two halves.
            let most = if method.0 == StreamMethod::Elements { (2, 3.0) } else { (1, 0.6) };
            let points = &field.singular_points;
            assert!((1..=most.0).contains(&points.len()), "{method:?} {direction:?}: {points:?}");
            assert!(points.iter().all(|p| p.position.xy().coords.norm() < most.1), "{method:?}: {points:?}");
            assert_eq!(
                points.iter().map(|p| p.half_turns).sum::<i32>(),
                half_turns,
                "{method:?} {direction:?}"
            );
        }
        let border = fields(&plate(), FeedDirection::Border(Sense::Along), method);
        // Once round in all, by one point in the middle or two halves on the longer axis.
        let points = &border.singular_points;
        assert_eq!(points.iter().map(|p| p.half_turns).sum::<i32>(), 2, "{method:?}: {points:?}");
        assert!(points.iter().all(|p| p.half_turns > 0 && (p.position.y - 10.0).abs() < 1.0), "{points:?}");
    }
}

/// Parallel passes of a plate, 20 mm wide: 34 of them, 20/34 mm apart where 0.6 mm are allowed.
#[test]
fn planned_intervals_are_those_of_the_passes() {
    let part = plate();
    for method in METHODS {
        let field = fields(&part, FeedDirection::Angle(0.0), method);
        assert!(field.directions.len() > 500 && field.directions.iter().all(|s| s.direction.y.abs() < 1e-9));
        assert!(field.singular_points.is_empty());
        assert_eq!((field.level_lines.len(), field.passes.len()), (32, 34), "{method:?}");
        for line in &field.level_lines {
            assert!(line.points.iter().all(|p| (p.y - line.points[0].y).abs() < 0.01), "{method:?}");
        }
        for ratio in field.passes.iter().flatten().filter(|p| p.inside).map(|p| p.ratio().unwrap()) {
            assert!((ratio - 20.0 / 34.0 / 0.6).abs() < 0.01, "{method:?}: {ratio}");
        }
    }
}

#[test]
fn the_report_tells_singular_points_and_intervals() {
    let home = tempfile::tempdir().unwrap();
    let scene = PLATE
        .replace(
            "surface = \"plane\"\nx = [0, 8]\ny = [0, 6]",
            "surface = \"sphere\"\nradius = 40\nx = [-5, 8]\ny = [-4, 6]",
        )
        .replace("strategy = \"zigzag\"\n", "strategy = \"streamline\"\ndirection = \"contour\"\n");
    std::fs::write(home.path().join("scene.toml"), scene).unwrap();
    let run = millstream(home.path(), &["run", "scene.toml", "--out", "out"]);
    assert!(run.code.is_some_and(|code| code < 2), "{}", run.stderr);
    let report = std::fs::read_to_string(home.path().join("out/report.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    let field = &report["toolpaths"][0]["field"];
    assert_eq!(field["singular_point_count"], 1, "{field}");
    let point = &field["singular_points"][0];
    assert_eq!(point["index"], 1.0);
    let at = |k: usize| point["at_mm"][k].as_f64().unwrap();
    assert!(at(0).hypot(at(1)) < 0.6, "{point}");
    let interval = |name: &str| field["interval_over_allowed"][name].as_f64().unwrap();
    assert!(interval("p5") > 0.4 && interval("p50") > 0.8 && interval("p95") < 1.05, "{field}");
    let page = std::fs::read_to_string(home.path().join("out/report.html")).unwrap();
    assert!(page.contains("singular points with their index") && page.contains("Intervals of streamline"));
}

/// Between the shortest path and a wanted direction: the dearer passes square to it are, the nearer they keep
/// to it and the longer the path is; on charts and on meshes.
#[test]
fn passes_keep_to_a_direction_as_far_as_it_is_worth() {
    let shape = AnalyticShape::Saddle { radius_concave: 20.0, radius_convex: 20.0 };
    let patch = formula(shape, [-12.0, 12.0], [-12.0, 12.0]);
    let n = 48;
    let at = |k: usize| -12.0 + 24.0 * k as f64 / n as f64;
    let corner = |i: usize, j: usize| (j * (n + 1) + i) as u32;
    let squares = (0..n)
        .flat_map(|j| (0..n).map(move |i| (i, j)))
        .filter(|&(i, j)| !(20..24).contains(&i) || !(20..24).contains(&j));
    let triangles = squares.flat_map(|(i, j)| {
        let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    let z = |x: f64, y: f64| (x * x - y * y) / 40.0;
    let vertices = (0..=n).flat_map(|j| (0..=n).map(move |i| Point3::new(at(i), at(j), z(at(i), at(j)))));
    let holed = mesh(vertices.collect(), triangles.collect());
    let cutter = Cutter::ball(12.0).unwrap();
    for part in [patch, holed] {
        let run = |toward: Option<(FeedDirection, f64)>| {
            let strategy = ShortestStreamline { toward, objective: Objective::Length };
            plan(&part, &cutter, &strategy, &settings(&part, Step::Scallop(0.01)), &Silent).unwrap().path
        };
        let length = |path: &Toolpath| -> f64 {
            let cuts = path.moves.windows(2).filter(|w| w[1].kind == MoveKind::Cut);
            cuts.map(|w| (w[1].to.tip - w[0].to.tip).norm()).sum()
        };
        let inside = [[-10.0, 10.0], [-10.0, 10.0]];
        let off = |path: &Toolpath| share_off(path, inside, 0.1, |_| FRAC_PI_2);
        let [free, held] = [run(None), run(Some((FeedDirection::Angle(FRAC_PI_2), 10.0)))];
        assert!(off(&free) > 0.9, "along the valley's bend the cutter moves least: {}", off(&free));
        assert!(off(&held) < 0.1, "{}", off(&held));
        assert!(length(&free) < 0.95 * length(&held), "{} {}", length(&free), length(&held));
    }
}
