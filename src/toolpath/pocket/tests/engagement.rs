//! The engagement of planned passes, as metrology measures it.

use cutter::Cutter;
use geometry::{Aabb, Point2, Point3, Region, RegionIndex, SegmentGrid, Vector2};
use machine::Machine;
use metrology::{ContactArcs, UNCOUNTED_LAYER, contact_arcs};
use motion::{Move, MoveKind, Toolpath};
use sim::Stock;
use work::monitor::Silent;

use super::super::walls;
use super::{PI, disc, pocket, rectangle, settings, strategy};
use crate::vocabulary::{Joining, PlanSettings, Step};
use crate::{Flow, Pattern, Plan, Pocket, PocketStrategy, WallFinish, plan_pocket};

fn points(c: &[(f64, f64)]) -> Vec<Point2> {
    c.iter().map(|&(x, y)| Point2::new(x, y)).collect()
}

/// A block around a pocket, as it stands before the first cut.
fn stock(pocket: &Pocket) -> Stock {
    let [lo, hi] = pocket.free().bounds().unwrap();
    let (min, max) = (Point3::new(lo.x - 9.0, lo.y - 9.0, -20.0), Point3::new(hi.x + 9.0, hi.y + 9.0, 0.0));
    Stock::milled(Aabb { min, max }, pocket.air(), -pocket.depth)
}

/// The shipped drawing.
fn bracket() -> Region {
    use io::outline::{OutlineOptions, parse, svg};
    let drawing = include_bytes!("../../../../scenes/bracket.svg");
    let options = OutlineOptions { chord_tolerance: 0.0025, scale: None, layer: Some("pocket".into()) };
    parse(drawing, svg::FORMAT, &options).unwrap().region
}

/// Pockets whose passes are bounded, with sharp corners, a neck, islands: nothing above the limit but by
/// what the measurement is unsure of, at any step down; plain passes are slots somewhere.
#[test]
fn bounded_passes_keep_to_their_engagement() {
    let region = |curves: &[Vec<Point2>]| Region::nested(curves.to_vec()).unwrap().0;
    let square = points(&[(0., 0.), (18., 0.), (18., 18.), (0., 18.)]);
    let island = points(&[(7., 8.), (9., 8.), (9., 10.), (7., 10.)]);
    let neck =
        points(&[(0., 0.), (12., 0.), (12., 3.), (17., 3.), (17., 10.), (12., 10.), (12., 12.), (0., 12.)]);
    let flow = |smoothing| Pattern::Flow(Flow { smoothing, spiral: false });
    let (offset, zigzag) = (Pattern::Offset { spiral: false }, Pattern::Zigzag { angle: 0.0 });
    let with_island = region(&[square.clone(), island]);
    for (region, diameter, pattern, limit) in [
        (region(&[square]), 5.0, flow(Some(3.0)), 60.0f64),
        (region(std::slice::from_ref(&neck)), 5.0, flow(Some(3.0)), 60.0),
        (region(&[neck]), 5.0, offset.clone(), 75.0),
        (with_island.clone(), 5.0, offset.clone(), 60.0),
        (with_island, 5.0, zigzag, 60.0),
        (bracket(), 6.0, flow(None), 80.0),
        (bracket(), 6.0, offset, 80.0),
    ] {
        let pocket = Pocket::new(region, 3.0);
        let measured = |engagement: Option<f64>| {
            let found = plan(&pocket, diameter, &pattern, engagement).path;
            assert!(
                found.segments().all(|(a, b, _)| (b - a).norm() > 1e-9),
                "{pattern:?}: a move without length"
            );
            let arcs = contact_arcs(
                &found,
                &Cutter::flat(diameter).unwrap(),
                &stock(&pocket),
                UNCOUNTED_LAYER,
                &of_passes,
                &Silent,
            )
            .unwrap();
            (found, arcs)
        };
        let (bounded, arcs) = measured(Some(limit.to_radians()));
        assert!(arcs.bound() < 1f64.to_radians(), "{}", arcs.bound().to_degrees());
        let above = above(&bounded, &arcs, (limit + SLACK).to_radians());
        // Where a line of a zigzag meets a wall, its loops become films.
        let longest = if matches!(pattern, Pattern::Zigzag { .. }) { 0.01 * diameter } else { 0.0 };
        assert!(above.iter().all(|(_, length)| *length <= longest), "{pattern:?}: {above:?}");
        let (plain, arcs) = measured(None);
        let cut = plain.moves.iter().zip(&arcs.of_moves).filter(|(m, _)| of_passes(m));
        let plain = cut.map(|(_, arc)| *arc).fold(0.0, f64::max);
        assert!(plain > (limit + 30.0).to_radians(), "{pattern:?}: {}", plain.to_degrees());
    }
}

/// Passes may be so much above their limit, degrees: their angle is looked at from place to place.
const SLACK: f64 = 2.0;

/// Stretches that are above it beyond that are no longer than this share of the radius: the ends of ways in
/// corners, where the plan's loops become films.
const TIP: f64 = 0.1;

/// Stretches of passes on which the angle is above `limit`, rad: where each begins, and its length, mm.
fn above(path: &Toolpath, arcs: &ContactArcs, limit: f64) -> Vec<(Point2, f64)> {
    let mut found: Vec<(Point2, f64)> = Vec::new();
    let mut last = None;
    for (k, ((a, b, m), arc)) in path.segments().zip(&arcs.of_moves).enumerate() {
        if of_passes(m) && *arc > limit {
            match found.last_mut() {
                Some((_, length)) if last == k.checked_sub(1) => *length += (b - a).norm(),
                _ => found.push((a.xy(), (b - a).norm())),
            }
            last = Some(k);
        }
    }
    found
}

/// At small limits the last of an acute tip is cut in layers: nothing is above, and nothing is told.
#[test]
fn acute_tips_keep_to_small_engagements() {
    let kite = points(&[(0., 0.), (9., -3.4), (12., 0.), (9., 3.4)]);
    let pocket = Pocket::new(Region::nested(vec![kite]).unwrap().0, 1.5);
    let limit = 20f64.to_radians();
    let found = plan(&pocket, 2.0, &Pattern::Offset { spiral: false }, Some(limit));
    let arcs = contact_arcs(
        &found.path,
        &Cutter::flat(2.0).unwrap(),
        &stock(&pocket),
        UNCOUNTED_LAYER,
        &of_passes,
        &Silent,
    );
    let stretches = above(&found.path, &arcs.unwrap(), limit + SLACK.to_radians());
    assert!(stretches.is_empty(), "{stretches:?}");
    assert!(!found.notes.iter().any(|note| note.contains("above the engagement")), "{:?}", found.notes);
}

/// A run along walls may begin right before a corner, as it does here: what is left of it is cut in layers
/// all the same.
#[test]
fn corners_before_which_a_run_begins_keep_to_the_engagement() {
    let outline = points(&[
        (0., 0.),
        (25., 0.),
        (25., 11.01),
        (40., 11.01),
        (40., 0.),
        (65., 0.),
        (65., 30.),
        (40., 30.),
        (40., 18.99),
        (25., 18.99),
        (25., 30.),
        (0., 30.),
    ]);
    let pocket = Pocket::new(Region::nested(vec![outline]).unwrap().0, 3.0);
    let limit = 30f64.to_radians();
    let found = plan(&pocket, 8.0, &Pattern::Offset { spiral: false }, Some(limit));
    let cutter = Cutter::flat(8.0).unwrap();
    let arcs = contact_arcs(&found.path, &cutter, &stock(&pocket), UNCOUNTED_LAYER, &of_passes, &Silent);
    // A side of one of the smallest loops may be above.
    let stretches = above(&found.path, &arcs.unwrap(), limit);
    assert!(stretches.iter().all(|(_, length)| *length < 0.01 * 4.0), "{stretches:?}");
}

/// Two squares joined by a neck that has no room beside the cutter: there, and nowhere else, it is in a
/// slot, and place and length are told.
#[test]
fn a_neck_as_wide_as_the_cutter_is_told() {
    let (left, right, low, high) = (14.0, 24.0, 4.49, 9.51);
    let outline = points(&[
        (0., 0.),
        (left, 0.),
        (left, low),
        (right, low),
        (right, 0.),
        (38., 0.),
        (38., 14.),
        (right, 14.),
        (right, high),
        (left, high),
        (left, 14.),
        (0., 14.),
    ]);
    let pocket = Pocket::new(Region::nested(vec![outline]).unwrap().0, 1.5);
    let limit = 60f64.to_radians();
    let found = plan(&pocket, 5.0, &Pattern::Offset { spiral: false }, Some(limit));
    // A move counts whole, and one may be half a radius long.
    let path = divided(&found.path, 0.05);
    let arcs = contact_arcs(
        &path,
        &Cutter::flat(5.0).unwrap(),
        &stock(&pocket),
        UNCOUNTED_LAYER,
        &of_passes,
        &Silent,
    )
    .unwrap();
    let stretches = above(&path, &arcs, limit + SLACK.to_radians());
    let long = stretches.iter().filter(|(_, length)| *length > TIP * 2.5);
    let above: f64 = long.clone().map(|(_, length)| length).sum();
    assert!(long.clone().all(|(at, _)| (left - 0.5..right + 0.5).contains(&at.x)), "{stretches:?}");
    let note = found.notes.iter().find(|n| n.contains("above the engagement")).unwrap();
    let told: f64 = note.split(' ').next().unwrap().parse().unwrap();
    // Where the right room is cleared the slot ends when no more than the limit stands before it. Passes in
    // that room come around the corners of the neck's mouth, by less than a millimetre, and so do those in
    // the left one.
    let whole = right - left - 2.5 * (0.5 * (limit + SLACK.to_radians())).sin();
    assert!((whole - 1.0..whole + 0.5).contains(&above), "{above} {whole}");
    // What is told goes from one step of the way to another one, at both ends.
    assert!((told - above).abs() < 2.0 * 0.08 * 2.5, "{above}: {note}");
    assert!(note.contains("begins at 13.") || note.contains("begins at 24."), "{note}");
}

/// The same path in moves no longer than `longest`, mm.
fn divided(path: &Toolpath, longest: f64) -> Toolpath {
    let mut moves = Vec::new();
    for (k, step) in path.moves.iter().enumerate() {
        let (from, length) = (path.location_before(k), (step.to.tip - path.start_of(k)).norm());
        let parts = (length / longest).ceil().max(1.0);
        moves.extend(
            (1..=parts as usize)
                .map(|part| Move { to: from.towards(&step.to, part as f64 / parts), ..*step }),
        );
    }
    Toolpath::new(path.start, moves)
}

fn of_passes(step: &Move) -> bool {
    step.kind == MoveKind::Cut
}

fn plan(pocket: &Pocket, diameter: f64, pattern: &Pattern, engagement: Option<f64>) -> Plan {
    let strategy = PocketStrategy {
        pattern: pattern.clone(),
        stepdown: Some(1.5),
        floor_allowance: 0.0,
        wall_allowance: 0.0,
        wall_finish: WallFinish::Steps,
        ramp_angle: 0.1,
        helix_radius: None,
        engagement,
        gentle: Vec::new(),
    };
    let settings = PlanSettings {
        step: Step::Stepover(2.0),
        chord_tolerance: 0.005,
        clearance: 2.0,
        stock_top: 0.0,
        feed_rate: 1000.0,
        plunge_rate: 300.0,
        machine: Machine { rapid_rate: 5000.0, ..Machine::default() },
        joining: Joining::default(),
        ..PlanSettings::default()
    };
    plan_pocket(pocket, &Cutter::flat(diameter).unwrap(), &strategy, &settings, &Silent).unwrap()
}

/// Open sides and what a larger cutter left, with and without a bounded engagement: every place of the floor
/// is cut or was clear before, no disc comes over a wall, the engagement is kept as measured in that stock,
/// ways down are straight only where no stock stands, and there is no helix where the cutter may come from
/// outside.
#[test]
fn open_pockets_and_rests_are_cleared_from_the_air() {
    let rectangle = || Region::nested(vec![points(&[(0., 0.), (40., 0.), (40., 24.), (0., 24.)])]).unwrap().0;
    let ell = points(&[(0., 0.), (40., 0.), (40., 14.), (18., 14.), (18., 34.), (0., 34.)]);
    let ell = || Region::nested(vec![ell.clone()]).unwrap().0;
    let radius = 2.5;
    let open = |region: Region, lines: &[&[(f64, f64)]]| {
        let lines: Vec<_> = lines.iter().map(|line| points(line)).collect();
        Pocket::new(region, 3.0).opened(&lines, 1e-3, radius).unwrap()
    };
    let pockets = [
        open(rectangle(), &[&[(40., 0.), (40., 24.)]]),
        open(rectangle(), &[&[(40., 6.), (40., 20.)]]),
        open(rectangle(), &[&[(40., 0.), (40., 24.), (0., 24.)]]),
        open(ell(), &[&[(40., 0.), (40., 14.)], &[(18., 34.), (0., 34.)]]),
        Pocket::new(ell(), 3.0).cleared_by(6.0, 0.0),
        Pocket::new(ell(), 3.0).cleared_by(5.0, 0.4),
    ];
    for (k, pocket) in pockets.into_iter().enumerate() {
        for (pattern, limit) in [
            (Pattern::Offset { spiral: false }, Some(60f64)),
            (Pattern::Offset { spiral: false }, None),
            (Pattern::Zigzag { angle: 0.0 }, Some(70.0)),
            (Pattern::Zigzag { angle: 0.3 }, None),
        ] {
            let what = format!("pocket {k}, {pattern:?} {limit:?}");
            let found = plan(&pocket, 2.0 * radius, &pattern, limit.map(f64::to_radians));
            let path = found.path;
            let stock = stock(&pocket);
            let (air, _) = stock.cleared().unwrap();
            let clear = |p: &Point2| air.contains(p) && air.sides().distance(p) >= radius;
            let walls = walls::Walls::new(pocket.free(), radius - 1e-6);
            let mut at_floor = Vec::new();
            for (a, b, m) in path.segments() {
                let (from, to) = (a.xy(), b.xy());
                if m.kind == MoveKind::Rapid || m.kind == MoveKind::Retract {
                    assert!(from == to || (a.z == 2.0 && b.z == 2.0), "{what}");
                    continue;
                }
                assert!(walls.hold(&from, &to) && pocket.free().contains(&to), "{what}: {a} {b}");
                // The second step begins on the floor of the first.
                if m.kind == MoveKind::Plunge && b.z < 0.0 && (a.z, b.z) != (-1.0, -1.5) {
                    let slope = (a.z - b.z) / (to - from).norm();
                    assert!(slope <= 0.1f64.tan() * 1.001 || clear(&to), "{what}: {a} {b}");
                }
                if a.z == -3.0 && b.z == -3.0 {
                    at_floor.push(geometry::CurveSegment { ends: [from, to], curve: 0, index: 0 });
                }
            }
            let floor = RegionIndex::new(pocket.reachable_floor(&Cutter::flat(2.0 * radius).unwrap(), 0.02));
            let passes = SegmentGrid::new(at_floor);
            let [lo, hi] = floor.region().bounds().unwrap();
            let at = |a: f64, b: f64, k: i32| a + (b - a) * (f64::from(k) + 0.5) / 300.0;
            for p in (0..300).flat_map(|j| (0..300).map(move |i| (i, j))) {
                let p = Point2::new(at(lo.x, hi.x, p.0), at(lo.y, hi.y, p.1));
                let left = floor.contains(&p) && air.depth(&p) < 1e-4 && passes.distance(&p) > radius + 1e-4;
                assert!(!left, "{what}: {p} is left, {} from a pass", passes.distance(&p));
            }
            if let Some(limit) = limit {
                let arcs = contact_arcs(
                    &path,
                    &Cutter::flat(2.0 * radius).unwrap(),
                    &stock,
                    UNCOUNTED_LAYER,
                    &of_passes,
                    &Silent,
                );
                let above = above(&path, &arcs.unwrap(), (limit + SLACK).to_radians());
                // Where the fronts from two open sides meet, one move may be above; jobs then plan again for
                // less. Loops of a zigzag lean to one side, and in corners they become films.
                let longest = if matches!(pattern, Pattern::Zigzag { .. }) { TIP } else { 0.15 };
                assert!(above.iter().all(|(_, length)| *length <= longest * radius), "{what}: {above:?}");
            }
        }
    }
}

/// Where an engagement is asked for beside a stepover, no place that the cutter's centre may come to is farther
/// from a pass than half of the stepover, with what turns add; the core of a helix is taken off as well.
#[test]
fn bounded_passes_keep_to_the_stepover() {
    let cutter = Cutter::ball(8.0).unwrap();
    for (outline, step) in [(rectangle(0.0, 0.0, 30.0, 24.0), 0.4), (disc(0.0, 0.0, 14.0), 1.1)] {
        let pocket = pocket(vec![outline]);
        let engagement = Some(PI / 2.0);
        for pattern in
            [Pattern::Offset { spiral: false }, Pattern::Flow(Flow { smoothing: None, spiral: false })]
        {
            let strategy = PocketStrategy { engagement, stepdown: None, ..strategy(pattern) };
            let settings = PlanSettings { step: Step::Stepover(step), ..settings() };
            let path = plan_pocket(&pocket, &cutter, &strategy, &settings, &Silent).unwrap().path;
            let floor = -pocket.depth + 1e-6;
            let cuts = path.segments().filter(|(a, b, _)| a.z < floor && b.z < floor);
            let sides: Vec<_> = cuts
                .map(|(a, b, _)| geometry::CurveSegment { ends: [a.xy(), b.xy()], curve: 0, index: 0 })
                .collect();
            let passes = SegmentGrid::new(sides);
            let room = pocket.region.inset(4.0);
            let [low, high] = room.bounds().unwrap();
            let (mut farthest, mut at) = (0.0, low);
            for k in 0..40_000 {
                let share = |by: f64| (f64::from(k) * by).fract();
                let size = high - low;
                let q = low + Vector2::new(size.x * share(0.618_033_988_7), size.y * share(0.754_877_666));
                let off = passes.distance(&q);
                if room.contains(&q) && off > farthest {
                    (farthest, at) = (off, q);
                }
            }
            assert!(farthest <= 0.66 * step, "{step}: {farthest} at {at}");
        }
    }
}
