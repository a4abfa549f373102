//! Streamlines by every method and solver, and along directions from a file.

use std::fmt::Write as _;
use std::sync::Arc;

use millstream::cutter::Cutter;
use millstream::field::{DIRECTION_WEIGHT, KnotRule, PassPoint, Solver};
use millstream::geometry::AnalyticShape;
use millstream::io::direction_table;
use millstream::monitor::Silent;
use millstream::toolpath::{
    FeedDirection, Lines, Objective, Plan, ShortestStreamline, Step, StreamMethod, Streamline, plan,
};

use crate::command::{PLATE, millstream};
use crate::support::{LIMITS, cut_and_measure, formula, settings};

/// Radius of the path's points round (−20, −15): directions of the table turn about there.
fn radii(plan: &Plan) -> Vec<f64> {
    let points = plan.path.moves.iter().map(|m| m.to.tip);
    points.filter(|p| p.z.abs() < 1e-3).map(|p| (p.x + 20.0).hypot(p.y + 15.0)).collect()
}

/// Scattered samples of circles round (−20, −15) over [0, 30] × [0, 20], every third turned round.
fn circles(header: &str, scale: [f64; 2]) -> String {
    let mut text = format!("# circles\n{header}\n");
    for k in 0..600usize {
        let (x, y) = (30.0 * ((k * 37) % 599) as f64 / 598.0, 20.0 * ((k * 101) % 593) as f64 / 592.0);
        let sign = if k % 3 == 0 { -1.0 } else { 1.0 };
        let (tx, ty) = (-sign * (y + 15.0), sign * (x + 20.0));
        let (x, y, tx, ty) = (x * scale[0], y * scale[1], tx * scale[0], ty * scale[1]);
        writeln!(text, "{x} {y} {tx} {ty}").unwrap();
    }
    text
}

#[test]
fn sampled_circles_are_followed_by_every_method_and_solver() {
    let part = formula(AnalyticShape::Plane { height: 0.0 }, [0.0, 30.0], [0.0, 20.0]);
    let cutter = Cutter::ball(6.0).unwrap();
    let samples = Arc::new(direction_table::parse(circles("", [1.0; 2]).as_bytes()).unwrap());
    let spline = |degree, knots| StreamMethod::BSpline { degree, knots };
    for (method, solver) in [
        (spline(3, KnotRule::Uniform), Solver::Cholesky),
        (spline(2, KnotRule::Averaged), Solver::Qr),
        (spline(5, KnotRule::Curvature), Solver::ConjugateGradient),
        (spline(4, KnotRule::Uniform), Solver::MinimumNorm),
        (spline(3, KnotRule::Uniform), Solver::Gmres),
        (StreamMethod::Differences, Solver::ConjugateGradient),
        (StreamMethod::Differences, Solver::Cholesky),
    ] {
        let direction = FeedDirection::Samples(samples.clone());
        let strategy = Streamline {
            direction,
            control_points: 12,
            method,
            solver,
            direction_weight: DIRECTION_WEIGHT,
            lines: Lines::Levels,
        };
        let plan = plan(&part, &cutter, &strategy, &settings(&part, Step::Stepover(0.6)), &Silent).unwrap();
        assert!(plan.notes.iter().any(|n| n.contains(", residual ")), "{:?}", plan.notes);
        println!("{method:?} {solver:?}: {:?}", plan.notes);
        // Between radii 25 and 61, 36 of 0.6 mm steps: each pass keeps its radius.
        let all = radii(&plan);
        let longest =
            plan.path.moves.windows(2).filter(|w| w[0].to.tip.z.abs() < 1e-3 && w[1].to.tip.z.abs() < 1e-3);
        let worst = longest
            .filter(|w| (w[0].to.tip - w[1].to.tip).norm() > 0.01)
            .map(|w| {
                let r = |p: &millstream::geometry::Point3| (p.x + 20.0).hypot(p.y + 15.0);
                let (a, b) = (&w[0].to.tip, &w[1].to.tip);
                (r(a) - r(b)).abs() / (a - b).norm()
            })
            .fold(Vec::new(), |mut all: Vec<f64>, x| {
                all.push(x);
                all
            });
        let mut sorted = worst.clone();
        sorted.sort_by(f64::total_cmp);
        // All but the links between passes lie along circles.
        assert!(sorted[sorted.len() * 9 / 10] < 0.02, "{method:?}: {}", sorted[sorted.len() * 9 / 10]);
        assert!(all.len() > 500);
        let measured = cut_and_measure(&part, &cutter, &plan.path, 0.1, &LIMITS);
        assert_eq!(measured.uncut.region_count, 0, "{method:?}");
        assert!(measured.gouge.max_depth_mm < 0.002, "{method:?}");
    }
}

/// Streamlines traced by Runge-Kutta steps are as round as the levels of the same function, on a chart and on
/// a mesh, lie no farther apart than they may, and leave nothing.
#[test]
fn traced_lines_are_levels() {
    let part = formula(AnalyticShape::Plane { height: 0.0 }, [0.0, 30.0], [0.0, 20.0]);
    let cutter = Cutter::ball(6.0).unwrap();
    let samples = Arc::new(direction_table::parse(circles("", [1.0; 2]).as_bytes()).unwrap());
    for method in [StreamMethod::Automatic, StreamMethod::Elements] {
        let [levels, traced] = [Lines::Levels, Lines::RungeKutta].map(|lines| {
            let along = Streamline::along(FeedDirection::Samples(samples.clone()));
            let strategy = Streamline { method, lines, ..along };
            let plan =
                plan(&part, &cutter, &strategy, &settings(&part, Step::Stepover(0.6)), &Silent).unwrap();
            let measured = cut_and_measure(&part, &cutter, &plan.path, 0.1, &LIMITS);
            assert_eq!(measured.uncut.region_count, 0, "{method:?} {lines:?}");
            let passes = &plan.field.as_ref().unwrap().passes;
            let radius = |p: &PassPoint| (p.at.x + 20.0).hypot(p.at.y + 15.0);
            let spread = passes.iter().map(|pass| {
                let radii = pass.iter().filter(|p| p.inside).map(radius);
                let [lo, hi] =
                    radii.fold([f64::INFINITY, 0.0], |[lo, hi]: [f64; 2], r| [lo.min(r), hi.max(r)]);
                (hi - lo).max(0.0)
            });
            let widest = passes.iter().flatten().filter(|p| p.inside).filter_map(PassPoint::ratio);
            (spread.fold(0.0, f64::max), widest.fold(0.0, f64::max))
        });
        println!("{method:?}: {levels:?} {traced:?}");
        assert!(traced.0 <= levels.0 + LIMITS.chord, "{method:?}: {traced:?} {levels:?}");
        assert!(traced.1 <= 1.01, "{method:?}: {traced:?}");
    }
}

/// Circles that leaving is dear are kept to within a degree, or else the plan says how far its passes are
/// off.
#[test]
fn circles_are_followed_or_said_not_to_be() {
    let part = formula(AnalyticShape::Plane { height: 0.0 }, [0.0, 30.0], [0.0, 20.0]);
    let cutter = Cutter::ball(6.0).unwrap();
    let samples = Arc::new(direction_table::parse(circles("", [1.0; 2]).as_bytes()).unwrap());
    for dearer in [1.5, 10.0, 100.0] {
        let toward = Some((FeedDirection::Samples(samples.clone()), dearer));
        let strategy = ShortestStreamline { toward, objective: Objective::Length };
        let plan = plan(&part, &cutter, &strategy, &settings(&part, Step::Scallop(0.01)), &Silent).unwrap();
        let off = plan.field.as_ref().unwrap().direction_error.unwrap().rms.to_degrees();
        let told = plan.notes.iter().any(|note| note.contains("off the directions that were asked for"));
        println!("{dearer}: {off} {told}");
        assert_eq!(told, off > 1.0, "{dearer}: {off}");
        assert!(dearer < 10.0 || off <= 1.0, "{dearer}: {off}");
    }
}

#[test]
fn a_table_outside_of_the_part_or_of_the_wrong_kind_is_refused() {
    let part = formula(AnalyticShape::Plane { height: 0.0 }, [0.0, 30.0], [0.0, 20.0]);
    let cutter = Cutter::ball(6.0).unwrap();
    let samples = direction_table::parse(b"x y tx ty\n100 100 1 0\n110 100 1 0\n").unwrap();
    let strategy = Streamline {
        direction: FeedDirection::Samples(Arc::new(samples)),
        control_points: 8,
        method: StreamMethod::Differences,
        solver: Solver::ConjugateGradient,
        direction_weight: DIRECTION_WEIGHT,
        lines: Lines::Levels,
    };
    let refused = plan(&part, &cutter, &strategy, &settings(&part, Step::Stepover(0.6)), &Silent);
    let message = refused.unwrap_err().to_string();
    assert!(message.contains("all 2 sampled directions lie outside of it (x from 100 to 110"), "{message}");
}

#[test]
fn the_program_reads_directions_beside_the_scene_and_says_where_they_fail() {
    let home = tempfile::tempdir().unwrap();
    let scene = PLATE.replace(
        "strategy = \"zigzag\"\n",
        "strategy = \"streamline\"\ndirection = \"file\"\ndirections = \"flow.txt\"\ncontrol_points = 8\n",
    );
    std::fs::write(home.path().join("scene.toml"), scene).unwrap();
    let missing = millstream(home.path(), &["check", "scene.toml"]);
    assert_eq!(missing.code, Some(2), "{}", missing.stderr);
    assert!(missing.stderr.contains("flow.txt"), "{}", missing.stderr);
    for (table, word) in [
        ("", "line 1: the table has no direction"),
        ("0 0 1 0\n1 1 0 0\n", "line 2: the direction has no length"),
        ("0 0 1 0\n1 1 nan 0\n", "line 2: \"nan\" is no finite number"),
        ("0 0 1 0\n1 1 1\n", "line 2: 3 numbers"),
    ] {
        std::fs::write(home.path().join("flow.txt"), table).unwrap();
        for command in ["check", "run"] {
            let answer = millstream(home.path(), &[command, "scene.toml"]);
            let said = answer.stderr.split_whitespace().filter(|w| *w != "│").collect::<Vec<_>>().join(" ");
            assert_eq!(answer.code, Some(2), "{said}");
            assert!(said.contains(word) && said.contains("flow.txt"), "{word}: {said}");
        }
    }
    std::fs::write(home.path().join("flow.txt"), "1 1 1 0.2\n7 5 -1 -0.2\n4 3 1 0.2\n").unwrap();
    let checked = millstream(home.path(), &["check", "scene.toml"]);
    assert_eq!(checked.code, Some(0), "{}", checked.stderr);
    for key in ["directions = \"flow.txt\"", "method = \"bspline\"", "control_points = 8"] {
        assert!(checked.stdout.contains(key), "{key}: {}", checked.stdout);
    }
    let run = millstream(home.path(), &["run", "scene.toml"]);
    assert!(run.code.is_some_and(|code| code < 2), "{}", run.stderr);
}
