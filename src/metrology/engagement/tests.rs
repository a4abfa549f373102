use std::f64::consts::TAU;

use super::*;
use geometry::{Aabb, Point3, Region};
use motion::ClPoint;
use proptest::prelude::*;
use work::monitor::Silent;

const RADIUS: f64 = 3.0;
const FILM: f64 = UNCOUNTED_LAYER;

/// The path through `places` at z = -2 in stock up to 0, after a plunge to the first of them.
fn through(places: &[(f64, f64)]) -> Toolpath {
    let to = |&(x, y): &(f64, f64), kind| Move {
        to: ClPoint::upright(Point3::new(x, y, -2.0)),
        kind,
        feed_rate: 600.0,
        pass: 0,
    };
    let mut moves = vec![to(&places[0], MoveKind::Plunge)];
    moves.extend(places[1..].iter().map(|p| to(p, MoveKind::Cut)));
    Toolpath::new(ClPoint::upright(Point3::new(places[0].0, places[0].1, 5.0)), moves)
}

fn cuts(m: &Move) -> bool {
    m.kind == MoveKind::Cut
}

/// A block up to z = 0.
fn block() -> Aabb {
    Aabb { min: Point3::new(-500.0, -500.0, -9.0), max: Point3::new(500.0, 500.0, 0.0) }
}

fn arcs_in(stock: &Stock, path: &Toolpath) -> ContactArcs {
    arcs_beyond(FILM, stock, path)
}

fn arcs_beyond(film: f64, stock: &Stock, path: &Toolpath) -> ContactArcs {
    contact_arcs(path, &Cutter::flat(2.0 * RADIUS).unwrap(), stock, film, &cuts, &Silent).unwrap()
}

fn arcs_of(path: &Toolpath) -> ContactArcs {
    arcs_in(&Stock::Box(block()), path)
}

fn arcs(places: &[(f64, f64)]) -> ContactArcs {
    arcs_of(&through(places))
}

/// Beside ground cleared up to a straight wall the way `width` away from the last one.
fn beside(width: f64) -> f64 {
    ((1.0 + FILM) - width / RADIUS).acos()
}

/// A slot is half a turn; beside it passes of the stepover w stand in stock by acos(1 − w/r), in either
/// direction; what is cleared is none, also along its walls.
#[test]
fn straight_passes_have_the_angles_of_closed_forms() {
    for turn in [0.0f64, 0.3, 1.0] {
        let at = |x: f64, y: f64| (x * turn.cos() - y * turn.sin(), x * turn.sin() + y * turn.cos());
        for width in [0.4f64, 1.5, 2.9, 4.5] {
            let y = width;
            let found = arcs(&[
                at(0.0, 0.0),
                at(20.0, 0.0),
                at(0.0, 0.0),
                at(-10.0, 0.0),
                at(-10.0, y),
                at(20.0, y),
                at(20.0, 2.0 * y),
                at(-20.0, 2.0 * y),
                at(20.0, 2.0 * y),
            ]);
            assert!((found.of_moves[1] - PI).abs() < 1e-9 && (found.of_moves[3] - PI).abs() < 1e-9);
            assert_eq!((found.of_moves[2], found.of_moves[8]), (0.0, 0.0));
            assert!(found.bound() < 1e-9, "{}", found.bound());
            // The middle of the long passes; their ends turn into the corner beside.
            let middle = arcs(&[at(-10.0, 0.0), at(30.0, 0.0), at(29.0, y), at(10.0, y)]);
            assert!((middle.of_moves[3] - beside(width)).abs() < 1e-9, "{width}: {}", middle.of_moves[3]);
        }
    }
}

/// Films along ground that was cut before are no stock, thicker layers are.
#[test]
fn films_do_not_count() {
    let places = |by| [(-10.0, 0.0), (30.0, 0.0), (30.0, -5.0), (0.0, -5.0), (0.0, by), (20.0, by)];
    for film in [UNCOUNTED_LAYER, THIN_LAYER] {
        let again =
            |by: f64| arcs_beyond(film, &Stock::Box(block()), &through(&places(by * RADIUS))).of_moves[5];
        assert_eq!(again(0.9 * film), 0.0);
        assert!((again(1.5 * film) - (1.0 - 0.5 * film).acos()).abs() < 1e-9);
    }
}

/// Along both walls of a corner up to `d` before its end, then into it by the bisector: in stock is the
/// quarter between the walls' feet and on either side what the disc there left, asin(d / 2r).
#[test]
fn into_a_square_corner_the_arc_is_a_quarter_and_what_was_left() {
    let d = 2.5f64;
    let to_the_end =
        [(-20.0, 0.0), (-d, 0.0), (-d, -d), (0.0, -d), (0.0, -20.0), (0.0, -d), (-d, -d), (0.0, 0.0)];
    let found = arcs(&to_the_end);
    let exact = FRAC_PI_2 + 2.0 * (d / (2.0 * RADIUS)).asin();
    // Both ends of the arc meet ground whose border crosses the circumference at this angle.
    let film = 2.0 * FILM / (2.0 * (d / (2.0 * RADIUS)).asin()).sin();
    assert!((found.of_moves[7] - exact).abs() <= 1.1 * film, "{} {exact} {film}", found.of_moves[7]);
}

/// Circles of the centre, each a little greater than the one before.
#[test]
fn rings_follow_the_law_of_cosines() {
    let ring = |rho: f64| {
        (0..=400).map(move |k| TAU * f64::from(k) / 400.0).map(move |a| (rho * a.cos(), rho * a.sin()))
    };
    let (first, width) = (2.0f64, 0.6f64);
    let places: Vec<(f64, f64)> = ring(first).chain(ring(first + width)).collect();
    let found = arcs(&places);
    let (rho, cleared) = (first + width, first + (1.0 + FILM) * RADIUS);
    // The circumference crosses the border of what the first ring cleared at this angle from the way out.
    let out = ((cleared * cleared - rho * rho - RADIUS * RADIUS) / (2.0 * rho * RADIUS)).acos();
    for k in 500..700 {
        // A chord's heading is off the circle's by half its angle, its middle nearer to the centre by its
        // rise.
        let (chord, found) = (TAU / 400.0, found.of_moves[k]);
        assert!((found - out).abs() <= chord, "{found} {out}");
    }
    assert!(found.bound() < 1.5 * PRECISE + TAU / 400.0, "{}", found.bound());
}

/// Ground that was cleared less deeply does not count as cleared, and what is above the stock meets none.
#[test]
fn depths_are_told_apart() {
    let mut path = through(&[(0.0, 0.0), (20.0, 0.0), (0.0, 0.0)]);
    path.moves[2].to.tip.z = -4.0;
    path.moves.push(Move { to: ClPoint::upright(Point3::new(20.0, 0.0, -4.0)), ..path.moves[2] });
    assert!((arcs_of(&path).of_moves[3] - PI).abs() < 1e-9);
    for m in &mut path.moves {
        m.to.tip.z = 1.0;
    }
    path.start.tip.z = 5.0;
    assert!(arcs_of(&path).of_moves.iter().all(|angle| *angle == 0.0));
}

/// The angle at a place by many points of the rim, each asked for its distance from all of the way before.
fn brute(path: &Toolpath, film: f64, k: usize, t: f64) -> f64 {
    const POINTS: usize = 20_000;
    let segments: Vec<(Point2, Point2)> = path.segments().map(|(a, b, _)| (a.xy(), b.xy())).collect();
    let (a, b) = segments[k];
    let fresh = RADIUS * (2.0 * film + film * film).sqrt();
    // Short pieces of the way before, each with how far back it lies.
    let mut back = 0.0;
    let mut before: Vec<(Point2, Point2, bool)> = Vec::new();
    for (from, to) in std::iter::once((a, a + (b - a) * t)).chain(segments[1..k].iter().rev().copied()) {
        let (length, way) = ((to - from).norm(), to - from);
        let split = ((fresh - back) / length).clamp(0.0, 1.0);
        before.push((to - way * split, to, false));
        before.push((from, to - way * split, split < 1.0));
        back += length;
    }
    let (centre, heading) = (a + (b - a) * t, (b - a).angle_of());
    let stands = |i: &usize| {
        let angle = heading - FRAC_PI_2 + PI * (*i as f64 + 0.5) / POINTS as f64;
        let p = centre + Vector2::new(angle.cos(), angle.sin()) * RADIUS;
        before.iter().all(|(from, to, filmed)| {
            let cleared = if *filmed { (1.0 + film) * RADIUS } else { (1.0 - TOUCHING) * RADIUS };
            square_distance(&p.coords, &[from.coords, to.coords]) >= cleared * cleared
        })
    };
    PI * (0..POINTS).filter(stands).count() as f64 / POINTS as f64
}

trait Angle {
    fn angle_of(&self) -> f64;
}

impl Angle for Vector2 {
    fn angle_of(&self) -> f64 {
        self.y.atan2(self.x)
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// Ways at random, short and long, with sharp turns: no place of any move exceeds its bound by brute
    /// force, and the greatest of all is what was found, within the bound.
    #[test]
    fn the_angles_are_those_of_brute_force(
        steps in prop::collection::vec((-3.2f64..3.2, prop_oneof![0.02f64..0.4, 0.4f64..6.0]), 3..14),
        places in prop::collection::vec(0.0f64..1.0, 6),
    ) {
        let mut at = (0.0f64, 0.0f64);
        let mut all = vec![at];
        for (angle, length) in steps {
            at = (at.0 + length * angle.cos(), at.1 + length * angle.sin());
            all.push(at);
        }
        let path = through(&all);
        let rough = 4.0 * PI / 20_000.0;
        for film in [UNCOUNTED_LAYER, THIN_LAYER] {
            let found = arcs_beyond(film, &Stock::Box(block()), &path);
            let greatest = found.of_moves.iter().copied().fold(0.0, f64::max);
            for k in 1..path.len() {
                for &t in &places {
                    let angle = brute(&path, film, k, t);
                    let most = found.at_most[k];
                    prop_assert!(angle <= most + rough, "{film}, move {k} at {t}: {angle} {most}");
                    prop_assert!(angle <= greatest + found.bound() + rough);
                }
                // The end of a move is one of the places that are looked at.
                prop_assert!(brute(&path, film, k, 1.0) <= found.of_moves[k] + rough);
            }
        }
    }
}

/// Small loops along a slot that is little wider than the cutter, and once more below: short lists of
/// segments, bundles, and what is left out change no angle and no bound.
#[test]
fn short_lists_change_no_angle() {
    let turn = |k: u32| (0.08 * f64::from(k), 0.2 * RADIUS);
    let at = |k: u32| {
        let (a, rho) = turn(k);
        (0.004 * f64::from(k) + rho * a.cos(), rho * a.sin())
    };
    let mut places: Vec<(f64, f64)> = vec![(-1.0, 0.0)];
    places.extend((0..2600).map(at));
    let mut path = through(&places);
    let deeper = path.moves.clone().into_iter().map(|mut step| {
        step.to.tip.z = -4.0;
        step
    });
    let deeper: Vec<Move> = deeper.collect();
    path.moves.extend(deeper);
    for film in [UNCOUNTED_LAYER, THIN_LAYER] {
        let found = arcs_beyond(film, &Stock::Box(block()), &path);
        let all = Swept::by(&path, RADIUS, film);
        let mut thinned = Swept::by(&path, RADIUS, film);
        let mut cut = 0;
        for k in (1..path.len()).filter(|k| k % 37 == 0 || *k == 2603) {
            let row = all.rows(k..k + 1, |k| all.heading(&path, 0.0, k).is_some()).remove(0);
            let near = Bundle { around: None, segments: all.near_row(&row) };
            let last = all.stretches(&path, 0.0, k).remove(0);
            let exact = all.at(&last, last.half, from_ref(&near));
            assert!((found.of_moves[k] - exact).abs() < 1e-9 || found.of_moves[k] > exact, "{k}");
            thinned.thin(k);
            let few = thinned.deciding_for(&row);
            assert!((thinned.at(&last, last.half, &few) - exact).abs() < 1e-9, "{k}");
            let most = [all.standing(&last, from_ref(&near)), thinned.deciding(&last, &few).0];
            assert!((most[0] - most[1]).abs() < 1e-9, "{k}: {most:?}");
            cut += usize::from(exact > 0.1);
        }
        let left: usize = thinned.buckets.iter().map(Vec::len).sum();
        assert!(cut > 30 && left < 4_000, "{cut} {left}");
    }
}

/// A way into ground that was cleared before, and beside it: as closed forms say, and as brute force over the
/// circumference, films included, in a region with corners and an island; below its floor nothing was
/// cleared.
#[test]
fn ground_cleared_before_is_no_stock() {
    let ring = |c: &[(f64, f64)]| c.iter().map(|&(x, y)| Point2::new(x, y)).collect::<Vec<_>>();
    let island = ring(&[(8.0, 3.0), (11.0, 4.0), (9.0, 7.0)]);
    let outer = ring(&[(0.0, 0.0), (30.0, 0.0), (30.0, 20.0), (12.0, 20.0), (12.0, 12.0), (0.0, 12.0)]);
    let region = Region::nested(vec![outer, island.clone()]).unwrap().0;
    let sides: Vec<[Point2; 2]> =
        region.curves().flat_map(|c| (0..c.len()).map(move |k| [c[k], c[(k + 1) % c.len()]])).collect();
    let stock = Stock::milled(block(), &region, -2.0);
    // Out of the region over its lower side: at the place where half of it has passed, half a turn.
    let beside = |width: f64| ((1.0 + FILM) - width / RADIUS).acos();
    for width in [0.5, 1.5, 2.9] {
        let found = arcs_in(&stock, &through(&[(20.0, RADIUS - width), (27.0, RADIUS - width)]));
        assert!((found.of_moves[1] - beside(width)).abs() < 1e-9, "{} {}", found.of_moves[1], beside(width));
        assert!(found.bound() < 1e-3);
    }
    let lower = Stock::milled(block(), &region, -1.9);
    assert!((arcs_in(&lower, &through(&[(20.0, 4.0), (25.0, 4.0)])).of_moves[1] - PI).abs() < 1e-9);
    // The greatest angle on short moves, each by itself, against places 0.01 degrees apart on the
    // circumference.
    for (k, at) in [(4.0, 3.0), (9.0, 9.5), (13.0, 15.0), (24.0, 5.0), (1.0, 6.0), (9.5, 5.0), (31.0, 10.0)]
        .iter()
        .enumerate()
    {
        let turn = 1.3 * k as f64;
        let heading = Vector2::new(turn.cos(), turn.sin());
        let (from, length) = (Point2::new(at.0, at.1), 0.02);
        let to = from + heading * length;
        let found = arcs_in(&stock, &through(&[*at, (to.x, to.y)]));
        let standing = |p: Point2| {
            let away = sides.iter().map(|side| geometry::foot(&p, side).1).fold(f64::INFINITY, f64::min);
            !region.contains(&p) && away > FILM * RADIUS
        };
        let count = 18_000;
        let brute = |centre: Point2| {
            let one = |i: usize| {
                let angle = turn - FRAC_PI_2 + PI * (i as f64 + 0.5) / count as f64;
                let p = centre + Vector2::new(angle.cos(), angle.sin()) * RADIUS;
                // What the move itself cleared behind it.
                standing(p) && (p - from).norm() >= RADIUS
            };
            (0..count).filter(|i| one(*i)).count() as f64 * PI / count as f64
        };
        let greatest = brute(from).max(brute(to));
        let got = found.of_moves[1];
        assert!(got > greatest - 0.02 && got < greatest + 0.02, "{at:?}: {got} {greatest}");
        assert!(found.at_most[1] >= greatest - 1e-3, "{at:?}");
    }
}
