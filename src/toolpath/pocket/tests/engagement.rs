//! The engagement of planned passes, as metrology measures it.

use cutter::Cutter;
use geometry::{Point2, Region};
use machine::Machine;
use metrology::{ContactArcs, contact_arcs};
use motion::{Move, MoveKind, Toolpath};
use work::monitor::Silent;

use crate::vocabulary::{Joining, PlanSettings, Step};
use crate::{Flow, Pattern, Plan, Pocket, PocketStrategy, plan_pocket};

fn points(c: &[(f64, f64)]) -> Vec<Point2> {
    c.iter().map(|&(x, y)| Point2::new(x, y)).collect()
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
        (region(&[neck]), 5.0, offset, 75.0),
        (with_island.clone(), 5.0, offset, 60.0),
        (with_island, 5.0, zigzag, 60.0),
        (bracket(), 6.0, flow(None), 80.0),
        (bracket(), 6.0, offset, 80.0),
    ] {
        let pocket = Pocket { region, depth: 3.0 };
        let measured = |engagement: Option<f64>| {
            let found = plan(&pocket, diameter, pattern, engagement).path;
            assert!(
                found.segments().all(|(a, b, _)| (b - a).norm() > 1e-9),
                "{pattern:?}: a move without length"
            );
            let arcs =
                contact_arcs(&found, &Cutter::flat(diameter).unwrap(), 0.0, &of_passes, &Silent).unwrap();
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

/// Stretches that are above it beyond that are no longer than this share of the radius: the ends of ways in corners, where the
/// plan's loops become films.
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
    let pocket = Pocket { region: Region::nested(vec![outline]).unwrap().0, depth: 1.5 };
    let limit = 60f64.to_radians();
    let found = plan(&pocket, 5.0, Pattern::Offset { spiral: false }, Some(limit));
    // A move counts whole, and one may be half a radius long.
    let path = divided(&found.path, 0.05);
    let arcs = contact_arcs(&path, &Cutter::flat(5.0).unwrap(), 0.0, &of_passes, &Silent).unwrap();
    let stretches = above(&path, &arcs, limit + SLACK.to_radians());
    let long = stretches.iter().filter(|(_, length)| *length > TIP * 2.5);
    let above: f64 = long.clone().map(|(_, length)| length).sum();
    assert!(long.clone().all(|(at, _)| (left - 0.5..right + 0.5).contains(&at.x)), "{stretches:?}");
    let note = found.notes.iter().find(|n| n.contains("above the engagement")).unwrap();
    let told: f64 = note.split(' ').next().unwrap().parse().unwrap();
    // Where the right room is cleared the slot ends when no more than the limit stands before it. Passes in that room come around
    // the corners of the neck's mouth, by less than a millimetre, and so do those in the left one.
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

fn plan(pocket: &Pocket, diameter: f64, pattern: Pattern, engagement: Option<f64>) -> Plan {
    let strategy = PocketStrategy {
        pattern,
        stepdown: Some(1.5),
        floor_allowance: 0.0,
        wall_allowance: 0.0,
        ramp_angle: 0.1,
        helix_radius: None,
        engagement,
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
