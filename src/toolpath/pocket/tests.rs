mod engagement;
mod ridges;

use super::*;
use crate::levels::halving::LevelSource;
use crate::vocabulary::{FeedDirection, Joining, Lines, Step};
use field::mesh::Sense;
use geometry::{Point2, Point3};
use machine::Machine;
use motion::MoveKind;
use std::f64::consts::PI;
use std::sync::Arc;
use work::monitor::Silent;

fn rectangle(x0: f64, y0: f64, x1: f64, y1: f64) -> Vec<Point2> {
    [(x0, y0), (x1, y0), (x1, y1), (x0, y1)].map(|(x, y)| Point2::new(x, y)).to_vec()
}

fn disc(x: f64, y: f64, r: f64) -> Vec<Point2> {
    (0..90)
        .map(|k| 2.0 * PI * f64::from(k) / 90.0)
        .map(|a| Point2::new(x + r * a.cos(), y + r * a.sin()))
        .collect()
}

fn pocket(curves: Vec<Vec<Point2>>) -> Pocket {
    Pocket::new(Region::nested(curves).unwrap().0, 6.0)
}

fn with_island() -> Pocket {
    pocket(vec![rectangle(0.0, 0.0, 60.0, 40.0), disc(40.0, 22.0, 7.0)])
}

fn settings() -> PlanSettings {
    PlanSettings {
        step: Step::Stepover(2.4),
        chord_tolerance: 0.005,
        clearance: 2.0,
        stock_top: 0.0,
        feed_rate: 1000.0,
        plunge_rate: 300.0,
        machine: Machine { rapid_rate: 5000.0, ..Machine::default() },
        joining: Joining::default(),
        ..PlanSettings::default()
    }
}

fn strategy(pattern: Pattern) -> PocketStrategy {
    PocketStrategy {
        pattern,
        stepdown: Some(3.0),
        floor_allowance: 0.0,
        wall_allowance: 0.0,
        wall_finish: WallFinish::Steps,
        ramp_angle: 3f64.to_radians(),
        helix_radius: None,
        engagement: None,
        gentle: Vec::new(),
    }
}

/// Streamlines along walls, at an angle, and from guides.
fn streamlines() -> [Pattern; 3] {
    let guide = vec![Point2::new(0.0, 5.0), Point2::new(25.0, 15.0), Point2::new(60.0, 10.0)];
    [
        (FeedDirection::Border(Sense::Along), true),
        (FeedDirection::Angle(0.4), false),
        (FeedDirection::Guides { curves: Arc::new(vec![guide]), sense: Sense::Along }, false),
    ]
    .map(|(direction, along_walls)| {
        Pattern::Streamline(Vectors { direction, direction_weight: 1.0, along_walls, lines: Lines::Levels })
    })
}

fn patterns() -> [Pattern; 6] {
    [
        Pattern::Flow(Flow { smoothing: None, spiral: false }),
        Pattern::Flow(Flow { smoothing: Some(4.0), spiral: true }),
        Pattern::Offset { spiral: false },
        Pattern::Offset { spiral: true },
        Pattern::Zigzag { angle: 0.0 },
        Pattern::Zigzag { angle: 0.5 },
    ]
}

/// Every tip below the face keeps the cutter's radius from all walls, no rapid is fed through stock height,
/// no way down is steeper than asked, and every place of the floor is within the radius of a pass.
#[test]
fn programs_keep_to_the_pocket_and_clear_it() {
    let cutter = Cutter::flat(6.0).unwrap();
    let dumbbell = [(0., 0.), (20., 0.), (20., 8.), (30., 8.), (30., 0.), (50., 0.), (50., 20.), (30., 20.)]
        .into_iter()
        .chain([(30., 12.), (20., 12.), (20., 20.), (0., 20.)])
        .map(|(x, y)| Point2::new(x, y))
        .collect();
    for pocket in [with_island(), pocket(vec![rectangle(0.0, 0.0, 30.0, 30.0)]), pocket(vec![dumbbell])] {
        let walls = SegmentGrid::of_curves(pocket.region.curves());
        let floor = pocket.reachable_floor(&cutter, 0.02);
        let bounded = |pattern| (pattern, Some(70f64.to_radians()));
        let all = patterns().map(|pattern| (pattern, None)).into_iter();
        let vectors = streamlines().map(|pattern| (pattern, None));
        for (pattern, engagement) in
            all.chain([0, 2, 4].map(|k| bounded(patterns()[k].clone()))).chain(vectors)
        {
            let strategy = PocketStrategy { engagement, ..strategy(pattern.clone()) };
            let plan = plan_pocket(&pocket, &cutter, &strategy, &settings(), &Silent).unwrap();
            let mut segments = Vec::new();
            for (a, b, m) in plan.path.segments() {
                let what = format!("{pattern:?} {a} {b} {:?}", m.kind);
                if m.kind == MoveKind::Rapid {
                    // To rounding: programs have four decimals.
                    let vertical = (a.xy() - b.xy()).norm() < 1e-9;
                    assert!(vertical || (a.z == 2.0 && b.z == 2.0), "{what}");
                    continue;
                }
                for t in [0.0, 0.3, 0.7, 1.0] {
                    let p = a + (b - a) * t;
                    let off = walls.distance(&p.xy());
                    assert!(pocket.region.contains(&p.xy()) && off > 3.0 - 1e-4 - 0.005, "{what}: {off}");
                }
                if m.kind == MoveKind::Plunge && a.xy() != b.xy() {
                    let slope = (a.z - b.z) / (b.xy() - a.xy()).norm();
                    assert!(slope <= 3f64.to_radians().tan() * 1.001, "{what}: {slope}");
                }
                if a.z == -6.0 && b.z == -6.0 {
                    segments.push(geometry::CurveSegment { ends: [a.xy(), b.xy()], curve: 0, index: 0 });
                }
            }
            let passes = SegmentGrid::new(segments);
            let [lo, hi] = floor.bounds().unwrap();
            let mut farthest = 0.0f64;
            for j in 0..200 {
                for i in 0..200 {
                    let at = |a: f64, b: f64, k: i32| a + (b - a) * (f64::from(k) + 0.5) / 200.0;
                    let p = Point2::new(at(lo.x, hi.x, i), at(lo.y, hi.y, j));
                    if floor.contains(&p) {
                        farthest = farthest.max(passes.distance(&p));
                    }
                }
            }
            assert!(
                farthest <= 3.0,
                "{pattern:?}, {engagement:?}: a place is {farthest} from the nearest pass"
            );
            let lowest = plan.path.moves.iter().map(|m| m.to.tip.z).fold(0.0, f64::min);
            assert_eq!(lowest, -6.0);
        }
    }
}

/// From each curve of a flow the next one inwards is within the stepover, and somewhere just that far.
/// Rings of many sizes, drawn with more chords or fewer: no way down has two places that writing puts
/// together, none is steeper than asked but for its last decimals, and flat ones are fed as passes are.
#[test]
fn ways_down_of_rings_survive_writing() {
    let cutter = Cutter::flat(8.0).unwrap();
    let circle = |at: Point2, r: f64, n: usize| -> Vec<Point2> {
        let angle = |k: usize| 2.0 * PI * k as f64 / n as f64;
        // As scenes write them.
        let written = |c: f64| (c * 1e6).round() / 1e6;
        (0..n)
            .map(|k| Point2::new(written(at.x + r * angle(k).cos()), written(at.y + r * angle(k).sin())))
            .collect()
    };
    for k in 0..24 {
        let chord = [0.005, 0.01, 0.02][k % 3];
        let outer = circle(Point2::origin(), 22.0 + 0.375 * k as f64, 180);
        let inner = circle(Point2::new(3.0, 2.0), 5.5 + 0.125 * k as f64, 72);
        let pocket = Pocket::new(Region::nested(vec![outer, inner]).unwrap().0, 4.0);
        let strategy = PocketStrategy { stepdown: None, ..strategy(Pattern::Offset { spiral: false }) };
        let settings = PlanSettings { step: Step::Stepover(3.0), chord_tolerance: chord, ..settings() };
        let path = plan_pocket(&pocket, &cutter, &strategy, &settings, &Silent).unwrap().path.as_written();
        let under = |p: &Point3| p.z < 1e-9;
        for (a, b, m) in path.segments().filter(|(a, b, m)| m.kind == MoveKind::Plunge && under(a) && a != b)
        {
            let (run, drop) = ((b - a).xy().norm(), a.z - b.z);
            let decimals = 2.0 * motion::ROUNDING;
            assert!(run > 5.0 * decimals || drop == 0.0, "{k}: {a} {b}");
            let slope = (drop - 1.01 * decimals).atan2(run + 1.5 * decimals);
            assert!(slope <= 3f64.to_radians(), "{k}: {a} {b}");
            assert!(m.feed_rate >= 900.0, "{k}: {} from {a} to {b}", m.feed_rate);
        }
    }
}

#[test]
fn neighbouring_passes_lie_within_the_stepover() {
    let region = with_island().region.inset(3.0);
    let step = 2.4;
    for sigma in [0.5, 2.0, 8.0] {
        let field = nest::FlowField::new(&region.pieces[0], step, &Silent).unwrap();
        let nest = field.nest(&region.pieces[0], sigma, nest::Spacing::strict(step), 2.85, &Silent).unwrap();
        let mut greatest = 0.0f64;
        let mut stack = vec![&nest];
        while let Some(nest) = stack.pop() {
            if nest.inner.is_empty() {
                continue;
            }
            let closed = nest.inner.iter().flat_map(|n| n.curves.curves());
            let mut sides = SegmentGrid::of_curves(closed).segments().to_vec();
            for w in nest.between.iter().flat_map(|s| s.windows(2)) {
                sides.push(geometry::CurveSegment { ends: [w[0], w[1]], curve: 0, index: 0 });
            }
            let inner = SegmentGrid::new(sides);
            for p in nest.curves.curves().flatten() {
                greatest = greatest.max(inner.distance(p));
            }
            stack.extend(&nest.inner);
        }
        assert!(greatest <= step * 1.01 && greatest > 0.95 * step, "{sigma}: {greatest}");
    }
}

#[test]
fn what_corners_keep_has_a_closed_form() {
    let cutter = Cutter::flat(6.0).unwrap();
    let rest = pocket(vec![rectangle(0.0, 0.0, 60.0, 40.0)]).rest_area(&cutter, &Silent).unwrap();
    let exact = 4.0 * 9.0 * (1.0 - PI / 4.0);
    assert!((rest - exact).abs() < 0.1, "{rest} {exact}: chords and sides stand off by 0.4 µm over 200 mm");
}

#[test]
fn a_cutter_that_fits_nowhere_is_told_the_largest_that_does() {
    let slot = pocket(vec![rectangle(0.0, 0.0, 30.0, 5.0)]);
    let error = plan_pocket(
        &slot,
        &Cutter::flat(6.0).unwrap(),
        &strategy(patterns()[0].clone()),
        &settings(),
        &Silent,
    )
    .unwrap_err();
    assert!(
        error.to_string().contains("fits nowhere") && error.to_string().contains("is 4.99 mm")
            || error.to_string().contains("is 5.00 mm"),
        "{error}"
    );
    let taper = Cutter::taper(2.0, 0.5, 0.1, 6.0).unwrap();
    assert!(plan_pocket(&slot, &taper, &strategy(patterns()[0].clone()), &settings(), &Silent).is_err());
    // Just room: a single line of positions.
    assert!(
        plan_pocket(
            &slot,
            &Cutter::flat(4.9).unwrap(),
            &strategy(patterns()[0].clone()),
            &settings(),
            &Silent
        )
        .is_ok()
    );
}

#[test]
fn steps_go_down_evenly_and_the_floor_has_its_own() {
    let mut s = strategy(patterns()[2].clone());
    assert_eq!(descend::floors([0.0, 6.0], &s), [-3.0, -6.0]);
    assert_eq!(descend::floors([0.0, 7.0], &s).len(), 3);
    s.floor_allowance = 0.5;
    assert_eq!(descend::floors([0.0, 6.0], &s), [-2.75, -5.5, -6.0]);
    s.stepdown = None;
    assert_eq!(descend::floors([0.0, 6.0], &s), [-5.5, -6.0]);
    // From the top of the stock on, where that stands over the face.
    (s.stepdown, s.floor_allowance) = (Some(2.5), 0.0);
    assert_eq!(descend::floors([1.5, 6.0], &s), [-1.0, -3.5, -6.0]);
}

/// A bull nose with next to no flat leaves ridges between its passes, by the stepover. No pass of its own
/// goes along each of them.
#[test]
fn ridges_of_a_narrow_flat_are_no_rest() {
    let triangle = [(23.0, 15.0), (31.0, 17.0), (27.0, 23.0)].map(|(x, y)| Point2::new(x, y)).to_vec();
    let pocket = pocket(vec![rectangle(0.0, 0.0, 46.0, 39.0), triangle]);
    let moves = |corner: f64| {
        let cutter = Cutter::bull(6.0, corner).unwrap();
        let s = strategy(Pattern::Offset { spiral: true });
        plan_pocket(&pocket, &cutter, &s, &settings(), &Silent).unwrap().path.len()
    };
    let wide = moves(1.0);
    for corner in [2.0, 2.7] {
        let narrow = moves(corner);
        assert!(narrow < 5 * wide, "{corner}: {narrow} {wide}");
    }
}

/// Several steps with both allowances: until the passes along the walls the allowance stands there, also
/// below what the floor is left; only the last step comes to the floor; all is cleared in the end. Passes
/// along walls are one for each step and wall, or one for each wall, which then comes last and leaves no
/// marks of steps.
#[test]
fn floor_and_walls_are_finished_from_their_allowances() {
    let (cutter, pocket) = (Cutter::flat(6.0).unwrap(), with_island());
    let walls = SegmentGrid::of_curves(pocket.region.curves());
    for (wall_finish, engagement) in
        [(WallFinish::Steps, None), (WallFinish::Depth, None), (WallFinish::Depth, Some(70f64.to_radians()))]
    {
        let (wall_allowance, floor_allowance) = (0.2, 0.3);
        let strategy = PocketStrategy {
            wall_allowance,
            floor_allowance,
            wall_finish,
            engagement,
            ..strategy(patterns()[2].clone())
        };
        let path = plan_pocket(&pocket, &cutter, &strategy, &settings(), &Silent).unwrap().path;
        let (mut finishing, mut levels, mut last) = (Vec::new(), Vec::new(), 0);
        for pass in 0..path.passes() as u32 {
            let moves: Vec<_> =
                path.segments().filter(|(_, _, m)| m.pass == pass && m.kind == MoveKind::Cut).collect();
            let Some(&(_, first, _)) = moves.first() else { continue };
            let floor = first.z;
            let nearest = moves
                .iter()
                .map(|(a, b, _)| walls.distance(&nalgebra::center(a, b).xy()).min(walls.distance(&b.xy())));
            let nearest = nearest.fold(f64::INFINITY, f64::min);
            levels.push(floor);
            if nearest < 3.0 + 0.5 * wall_allowance {
                assert!((nearest - 3.0).abs() < 1e-3, "{wall_finish:?}: {nearest}");
                finishing.push(floor);
                last = pass;
            } else {
                assert!(nearest > 3.0 + wall_allowance - 5e-3, "{wall_finish:?}: {nearest}");
            }
        }
        levels.dedup();
        let whole = match wall_finish {
            WallFinish::Steps => vec![-2.85, -2.85, -5.7, -5.7, -6.0, -6.0],
            WallFinish::Depth => vec![-6.0, -6.0],
        };
        let close =
            |a: &[f64], b: &[f64]| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(close(&levels, &[-2.85, -5.7, -6.0]), "{levels:?}");
        assert!(close(&finishing, &whole), "{wall_finish:?}: {finishing:?}");
        assert_eq!(last + 1, path.passes() as u32);
        let at_floor = path.segments().filter(|(a, b, _)| a.z == -6.0 && b.z == -6.0);
        let sides =
            at_floor.map(|(a, b, _)| geometry::CurveSegment { ends: [a.xy(), b.xy()], curve: 0, index: 0 });
        let passes = SegmentGrid::new(sides.collect());
        let floor = pocket.reachable_floor(&cutter, 0.02);
        for k in 0..10_000 {
            let p = Point2::new(0.6 * f64::from(k % 100) + 0.3, 0.4 * f64::from(k / 100) + 0.2);
            assert!(!floor.contains(&p) || passes.distance(&p) <= 3.0, "{wall_finish:?} {p}");
        }
    }
}

/// A circle of a twentieth of a mm whose thinning by the tolerance alone would leave sides that look aside.
#[test]
fn shortened_ways_keep_their_heading() {
    let circle: Vec<Point2> = route::circle(&Point2::origin(), 0.05, 0.0, 1e-3);
    let turn = |points: &[Point2]| {
        let side = |k: usize| points[k + 1] - points[k];
        (2..points.len()).map(|k| side(k - 1).angle(&side(k - 2))).fold(0.0, f64::max)
    };
    let sides = descend::shortened(&circle, 0.0025, 1.0, PI, |_, _| true);
    assert!(turn(&sides) > 0.4);
    let sides = descend::shortened(&circle, 0.0025, 1.0, 0.03, |_, _| true);
    assert!(turn(&sides) < 0.085 && sides.len() < circle.len() / 2, "{} {}", turn(&sides), sides.len());
}

#[test]
fn feeds_fall_where_more_of_the_cutter_cuts() {
    assert!((engagement_angle(3.0, 3.0) - PI / 2.0).abs() < 1e-15);
    assert_eq!(engagement_angle(6.0, 3.0), PI);
    let to = |x: f64| motion::Move {
        to: motion::ClPoint::upright(Point3::new(x, 0.0, 0.0)),
        kind: MoveKind::Cut,
        feed_rate: 1000.0,
        pass: 0,
    };
    let mut path =
        motion::Toolpath::new(motion::ClPoint::upright(Point3::origin()), vec![to(10.0), to(20.0), to(30.0)]);
    let angles = [1.0, PI, 1.0];
    let figures = engagement(&path, &angles, PI / 2.0);
    assert_eq!((figures.max, figures.p95, figures.max_move), (PI, PI, 1));
    assert!((figures.over_limit - 1.0 / 3.0).abs() < 1e-12);
    assert!(engagement(&path, &angles, PI).over_limit.is_sign_positive(), "no -0 % in reports");
    limit_feed(&mut path, &angles, PI / 2.0);
    let feeds: Vec<f64> = path.moves.iter().map(|m| m.feed_rate).collect();
    assert_eq!(feeds, [1000.0, 500.0, 1000.0]);
}

/// Directions straight across a pocket, and one value along each wall: both together leave no function but a
/// level one, whose lines are noise.
#[test]
fn directions_across_do_not_run_along_walls() {
    let island = rectangle(10.0, 5.0, 14.0, 9.0);
    let pocket = pocket(vec![rectangle(0.0, 0.0, 24.0, 14.0), island]);
    let cutter = Cutter::flat(4.0).unwrap();
    let settings = PlanSettings { step: Step::Stepover(1.2), ..settings() };
    let planned = |direction: FeedDirection, along_walls: bool| {
        let vectors = Vectors { direction, direction_weight: 1.0, along_walls, lines: Lines::Levels };
        plan_pocket(&pocket, &cutter, &strategy(Pattern::Streamline(vectors)), &settings, &Silent)
    };
    let refused = planned(FeedDirection::Angle(30f64.to_radians()), true).unwrap_err().to_string();
    assert!(refused.contains("along_walls"), "{refused}");
    assert!(planned(FeedDirection::Angle(30f64.to_radians()), false).is_ok());
    assert!(planned(FeedDirection::Border(Sense::Along), true).is_ok());
}

/// No function with one value along the wall follows both sides of a slot. Passes then end at walls, which a
/// note tells, and clear it.
#[test]
fn streamlines_of_a_slot_end_at_its_walls() {
    let cutter = Cutter::flat(6.0).unwrap();
    let side = |x: f64, from: f64| {
        let at = move |k: i32| from + PI * f64::from(k) / 48.0;
        (0..=48).map(move |k| Point2::new(x + 4.0 * at(k).cos(), 4.0 * at(k).sin()))
    };
    let slot = pocket(vec![side(40.0, -0.5 * PI).chain(side(0.0, 0.5 * PI)).collect()]);
    let along = FeedDirection::Border(Sense::Along);
    let vectors =
        Vectors { direction: along, direction_weight: 1.0, along_walls: true, lines: Lines::Levels };
    let strategy = strategy(Pattern::Streamline(vectors));
    let plan = plan_pocket(&slot, &cutter, &strategy, &settings(), &Silent).unwrap();
    assert!(plan.notes.iter().any(|note| note.contains("along_walls = false")), "{:?}", plan.notes);
    let cuts = plan.path.segments().filter(|(.., m)| m.kind == MoveKind::Cut);
    let passes: Vec<[Point2; 2]> = cuts.map(|(a, b, _)| [a.xy(), b.xy()]).collect();
    for k in 0..400 {
        let q = Point2::new(-3.9 + 0.12 * f64::from(k), 3.9 * (0.7 * f64::from(k)).sin());
        if slot.reachable_floor(&cutter, 0.02).contains(&q) {
            let near = passes.iter().any(|[a, b]| geometry::distance_to_segment(&q, a, b) <= 3.0 + 1e-3);
            assert!(near, "{q}");
        }
    }
}

/// What flows around a round island in a round pocket: passes are circles, none ends at a wall, and
/// streamlines traced by Runge and Kutta's method stay on them within the chord tolerance.
#[test]
fn streamlines_around_an_island_are_the_traced_ones() {
    let pocket = pocket(vec![disc(0.0, 0.0, 30.0), disc(0.0, 0.0, 6.0)]);
    let along = streamlines()[0].clone();
    let plan =
        plan_pocket(&pocket, &Cutter::flat(6.0).unwrap(), &strategy(along.clone()), &settings(), &Silent)
            .unwrap();
    let passes = &plan.field.as_ref().unwrap().passes;
    assert!(passes.len() > 5, "{}", passes.len());
    for pass in passes {
        let radii = pass.iter().map(|p| p.at.xy().coords.norm());
        let [least, most] = radii.fold([f64::INFINITY, 0.0], |[a, b]: [f64; 2], r| [a.min(r), b.max(r)]);
        assert!(
            most - least < 0.1 && pass.first().map(|p| p.at) == pass.last().map(|p| p.at),
            "{least} {most}"
        );
    }
    let Pattern::Streamline(vectors) = along else { panic!("streamlines") };
    let ring = pocket.region.inset(3.0);
    let (chord, mut worst) = (settings().chord_tolerance, 0.0f64);
    let cutter = Cutter::flat(6.0).unwrap();
    let found = stream::Fitted::new(&ring.pieces[0], &vectors, &cutter, 2.4, &Silent).unwrap();
    let source = found.source(2.4, Lines::Levels).unwrap();
    let tracer = found.source(2.4, Lines::RungeKutta).unwrap();
    let [lo, hi] = source.on.levels.range();
    for share in [0.2, 0.4, 0.6, 0.8] {
        let level = lo + share * (hi - lo);
        let curve: Vec<Point2> =
            source.curves(level)[0].points.iter().map(|spot| spot.at.position.xy()).collect();
        let curve = SegmentGrid::of_curves([curve.as_slice()]);
        let traced = &tracer.on.curves(level)[0];
        // Steps of its own, not the crossings of sides.
        assert!(traced.closed && traced.points != source.on.curves(level)[0].points);
        worst = traced.points.iter().map(|p| curve.distance(&p.position.xy())).fold(worst, f64::max);
    }
    println!("{worst}");
    assert!(worst <= chord, "{worst}");
}

/// Passes of a pocket along traced lines lie no farther apart than levels do: around singular points both
/// leave gaps.
#[test]
fn traced_lines_fill_a_pocket() {
    let cutter = Cutter::flat(6.0).unwrap();
    for pattern in streamlines() {
        let Pattern::Streamline(vectors) = pattern else { panic!("streamlines") };
        let [levels, traced] = [Lines::Levels, Lines::RungeKutta].map(|lines| {
            let pattern = Pattern::Streamline(Vectors { lines, ..vectors.clone() });
            let plan =
                plan_pocket(&with_island(), &cutter, &strategy(pattern), &settings(), &Silent).unwrap();
            let passes = &plan.field.as_ref().unwrap().passes;
            let points: usize = passes.iter().map(Vec::len).sum();
            let ratios = passes.iter().flatten().filter_map(field::PassPoint::ratio);
            (passes.len(), ratios.filter(|ratio| *ratio > 1.02).count() as f64 / points as f64)
        });
        println!("{:?}: passes and share too far apart {levels:?} {traced:?}", vectors.direction);
        assert!(traced.0 > 5 && traced.1 <= levels.1 + 0.01, "{traced:?} {levels:?}");
    }
}

/// Beside an island off the middle the function of the walls has saddles, where no interval is narrow enough:
/// traced lines do not crowd for that.
#[test]
fn traced_lines_do_not_crowd_at_saddles() {
    let around = pocket(vec![rectangle(0.0, 0.0, 65.0, 40.0), rectangle(20.0, 14.0, 32.0, 24.0)]);
    let length = |lines: Lines| {
        let direction = FeedDirection::Border(Sense::Along);
        let vectors = Vectors { direction, direction_weight: 0.3, along_walls: true, lines };
        let strategy = strategy(Pattern::Streamline(vectors));
        let settings = PlanSettings { step: Step::Stepover(3.0), ..settings() };
        let plan = plan_pocket(&around, &Cutter::flat(8.0).unwrap(), &strategy, &settings, &Silent).unwrap();
        plan.path.segments().filter(|(.., m)| m.kind == MoveKind::Cut).map(|(a, b, _)| (b - a).norm()).sum()
    };
    let [levels, traced]: [f64; 2] = [Lines::Levels, Lines::RungeKutta].map(length);
    assert!(traced < 1.6 * levels, "{traced} {levels}");
}
