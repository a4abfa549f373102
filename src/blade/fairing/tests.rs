//! What all methods share, on curves of known shape.

use super::*;
use geometry::Point2;
use proptest::prelude::*;
use std::f64::consts::TAU;

const METHODS: [FairingMethod; 4] = [
    FairingMethod::Kjellander { step: 1.0 },
    FairingMethod::Kjellander { step: JUMP_REMOVING_STEP },
    FairingMethod::ControlPoints,
    FairingMethod::Energy,
];

fn through(points: Vec<Point2>, closed: bool) -> CubicSpline {
    let t = CubicSpline::chord_lengths(&points, closed);
    let made = if closed { CubicSpline::closed(t, points) } else { CubicSpline::open(t, points) };
    made.unwrap()
}

/// Random numbers in 0..1.
fn random(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// A blade of the chord 60 mm, 7.7 mm thick, with camber: an ellipse whose ends have the radius 0.5 mm, bent.
fn blade(n: usize) -> Vec<Point2> {
    let at = |k: usize| {
        let (y, x) = (TAU * k as f64 / n as f64).sin_cos();
        Point2::new(30.0 * x, 15f64.sqrt() * y + 3.0 * (1.0 - x * x))
    };
    (0..n).map(at).collect()
}

/// One side of it.
fn side(n: usize) -> Vec<Point2> {
    blade(2 * n - 2)[..n].to_vec()
}

/// Noise of 0.05 mm, evenly in a disc of that radius; or normal, of that standard deviation (in its plane's
/// norm).
fn noisy(points: &[Point2], normal: bool) -> Vec<Point2> {
    let mut random = random(88_172_645_463_325_252);
    let mut add = |p: &Point2| {
        let angle = TAU * random();
        let radius = if normal { (-random().ln()).sqrt() } else { random().sqrt() };
        p + Vector2::new(angle.cos(), angle.sin()) * (0.05 * radius)
    };
    points.iter().map(&mut add).collect()
}

/// ∫ |C″|², whose second derivatives are linear in each span.
fn bending(spline: &CubicSpline) -> f64 {
    let span = |ends: &[f64]| {
        let [a, b] = [ends[0], ends[1]].map(|t| {
            // Inside the span, against wrapping at the end of a period.
            let t = t + 1e-9 * (0.5 * (ends[0] + ends[1]) - t);
            spline.jet(t).2
        });
        (ends[1] - ends[0]) * (a.norm_squared() + a.dot(&b) + b.norm_squared()) / 3.0
    };
    spline.parameters().windows(2).map(span).sum()
}

/// The greatest curvature along the curve, and how far it reaches in x.
fn ends(spline: &CubicSpline) -> (f64, [f64; 2]) {
    let [from, to] = spline.domain();
    let places = (0..20_000).map(|k| from + (to - from) * f64::from(k) / 20_000.0);
    places.fold((0.0, [f64::INFINITY, f64::NEG_INFINITY]), |(curvature, [left, right]), t| {
        let x = spline.point(t).x;
        (spline.curvature(t).max(curvature), [left.min(x), right.max(x)])
    })
}

/// Root mean square of the curvature's error on the sides, at |x| < 27.
fn curvature_error(spline: &CubicSpline, clean: &CubicSpline) -> f64 {
    let places = |of: &CubicSpline, n: usize| -> Vec<(Point2, f64)> {
        let [from, to] = of.domain();
        let at = |k: usize| from + (to - from) * (k as f64 + 0.5) / n as f64;
        (0..n).map(|k| (of.point(at(k)), of.curvature(at(k)))).collect()
    };
    let known = places(clean, 1000);
    let errors = places(spline, 150).into_iter().filter(|(p, _)| p.x.abs() < 27.0).map(|(p, curvature)| {
        let near = known.iter().min_by(|a, b| (a.0 - p).norm().total_cmp(&(b.0 - p).norm())).unwrap();
        (curvature - near.1).powi(2)
    });
    let errors: Vec<f64> = errors.collect();
    (errors.iter().sum::<f64>() / errors.len() as f64).sqrt()
}

fn gaps() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(0.3f64..2.0, 1..14)
}

fn sums(gaps: &[f64]) -> Vec<f64> {
    let mut sums = vec![0.0];
    sums.extend(gaps.iter().scan(0.0, |sum, gap| {
        *sum += gap;
        Some(*sum)
    }));
    sums
}

/// Kjellander's place by its formula.
fn place_by_formula(s: &CubicSpline, k: usize) -> Point2 {
    let (t, p, d) = (s.parameters(), s.points(), s.tangents());
    let (a, b) = (t[k] - t[k - 1], t[k + 1] - t[k]);
    let stiffness = a.powi(-3) + b.powi(-3);
    let sum = p[k - 1].coords / a.powi(3)
        + p[k + 1].coords / b.powi(3)
        + (d[k - 1] / (a * a) - d[k + 1] / (b * b)) * 0.5
        + d[k] * (0.5 * (a.powi(-2) - b.powi(-2)));
    (sum / stiffness).into()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn lines_and_cubics_stay(
        c in prop::array::uniform4(prop::array::uniform2(-3.0f64..3.0)),
        gaps in gaps(),
        line: bool,
    ) {
        let t = sums(&gaps);
        let bend = if line { 0.0 } else { 1.0 };
        let value = |t: f64, i: usize| c[0][i] + t * (c[1][i] + bend * t * (c[2][i] + t * c[3][i]));
        let points: Vec<Point2> = t.iter().map(|t| Point2::new(value(*t, 0), value(*t, 1))).collect();
        prop_assume!(points.windows(2).all(|p| p[0] != p[1]));
        let size = points.iter().map(|p| p.coords.norm()).fold(1.0, f64::max);
        let spline = CubicSpline::open(t, points).unwrap();
        for method in METHODS {
            let faired = Fairing { method, ..Fairing::within(0.05) }.apply(&spline).unwrap();
            prop_assert!(faired.furthest() < 1e-12 * size, "{method:?} {}", faired.furthest());
            prop_assert!(faired.settled && faired.rounds <= 1);
        }
    }

    #[test]
    fn jumps_tell_the_way_to_kjellanders_place(
        gaps in prop::collection::vec(0.3f64..2.0, 6..14),
        xy in prop::collection::vec(prop::array::uniform2(-3.0f64..3.0), 15),
    ) {
        let t = sums(&gaps);
        let points: Vec<Point2> = xy.iter().take(t.len()).map(|p| Point2::from(*p)).collect();
        let spline = CubicSpline::open(t.clone(), points.clone()).unwrap();
        for k in 1..t.len() - 1 {
            let place = place_by_formula(&spline, k);
            let stiffness = (t[k] - t[k - 1]).powi(-3) + (t[k + 1] - t[k]).powi(-3);
            let jump = spline.third_jumps()[k];
            let expected = (points[k] - place) * (12.0 * stiffness);
            prop_assert!((jump - expected).norm() < 1e-10 * (1.0 + jump.norm()));
        }
    }

    #[test]
    fn nothing_leaves_its_cap_and_ends_stay(
        gaps in prop::collection::vec(0.3f64..2.0, 4..14),
        xy in prop::collection::vec(prop::array::uniform2(-0.3f64..0.3), 15),
        cap in 0.01f64..0.3,
        closed: bool,
    ) {
        let t = sums(&gaps);
        let n = t.len() - usize::from(closed);
        let end = t[t.len() - 1];
        let points: Vec<Point2> = (0..n)
            .map(|k| {
                let (sin, cos) = (TAU * t[k] / end).sin_cos();
                Point2::new(5.0 * cos + xy[k][0], 5.0 * sin + xy[k][1])
            })
            .collect();
        let make = if closed { CubicSpline::closed } else { CubicSpline::open };
        let spline = make(t, points.clone()).unwrap();
        for method in METHODS {
            let faired = Fairing { method, ..Fairing::within(cap) }.apply(&spline).unwrap();
            prop_assert!(faired.settled);
            for (k, (before, after)) in points.iter().zip(faired.spline.points()).enumerate() {
                prop_assert!((after - before).norm() <= cap, "{k} {}", (after - before).norm() / cap);
                let way = faired.moved.iter().find(|m| m.0 == k).map_or(Vector2::zeros(), |m| m.1);
                prop_assert!((after - before - way).norm() < 1e-13);
            }
            if !closed {
                prop_assert_eq!(faired.spline.points()[0], points[0]);
                prop_assert_eq!(faired.spline.points()[n - 1], points[n - 1]);
            }
            if let FairingMethod::Kjellander { .. } = method {
                // Not exactly where not-a-knot ends make the way there and back differ.
                let slack = if closed { 1.0 + 1e-9 } else { 1.2 };
                prop_assert!(bending(&faired.spline) <= slack * bending(&spline));
            }
        }
    }
}

/// Evenly spaced, one point off: what is left of its jump after it went `step` times the way, and the spline
/// was interpolated again.
fn left_after(step: f64, closed: bool) -> f64 {
    let points =
        (0..60).map(|k| Point2::new(f64::from(k), if k == 30 { 0.7 } else { (0.3 * f64::from(k)).sin() }));
    let points: Vec<Point2> = points.collect();
    let t: Vec<f64> = (0..60 + i32::from(closed)).map(f64::from).collect();
    let make = if closed { CubicSpline::closed } else { CubicSpline::open };
    let before = make(t.clone(), points.clone()).unwrap();
    let uniform =
        nalgebra::center(&points[29], &points[31]) + (before.tangents()[29] - before.tangents()[31]) * 0.25;
    let place = place_by_formula(&before, 30);
    assert!((place - uniform).norm() < 1e-12);
    let mut moved = points.clone();
    moved[30] += (place - points[30]) * step;
    let after = make(t, moved).unwrap();
    after.third_jumps()[30].dot(&before.third_jumps()[30]) / before.third_jumps()[30].norm_squared()
}

#[test]
fn a_step_to_kjellanders_place_leaves_two_fifths_of_the_jump() {
    for closed in [false, true] {
        assert!((left_after(1.0, closed) - 0.401_92).abs() < 1e-5);
        assert!(left_after(JUMP_REMOVING_STEP, closed).abs() < 1e-5);
    }
}

#[test]
fn foretold_jumps_are_those_of_the_next_interpolation() {
    for (points, closed) in [(blade(100), true), (side(100), false), (blade(12), true), (side(9), false)] {
        let rough = through(noisy(&points, false), closed);
        let before = rough.third_jumps();
        let by_points = kjellander::unknowns(&rough, 1.0).unwrap();
        let by_controls = control_points::unknowns(&rough).unwrap();
        for unknown in by_points.iter().chain(&by_controls) {
            let step = Vector2::new(0.03, -0.02);
            let mut ways = vec![Vector2::zeros(); points.len()];
            unknown.points.iter().for_each(|(point, share)| ways[*point] += step * *share);
            let after = displaced(&rough, &ways).unwrap().third_jumps();
            let greatest = unknown.jumps.iter().map(|(_, change)| change.abs()).fold(0.0, f64::max);
            for (k, (after, before)) in after.iter().zip(&before).enumerate() {
                let foretold = unknown.jumps.iter().find(|(point, _)| *point == k).map_or(0.0, |jump| jump.1);
                assert!((after - before - step * foretold).norm() < 1e-7 * greatest * step.norm());
            }
        }
    }
}

#[test]
fn a_noisy_section_loses_its_jumps_within_the_cap() {
    for (closed, normal) in [(true, false), (true, true), (false, false), (false, true)] {
        let clean = through(if closed { blade(200) } else { side(200) }, closed);
        let rough = through(noisy(clean.points(), normal), closed);
        for method in METHODS {
            let faired = Fairing { method, ..Fairing::within(0.05) }.apply(&rough).unwrap();
            let [before, after] = faired.jump_energy;
            assert!(after < 0.01 * before, "{method:?} {closed} {normal}: {}", after / before);
            assert!(faired.settled && faired.furthest() <= 0.05);
            assert_eq!(before, jump_energy(&rough));
            assert!((after / jump_energy(&faired.spline) - 1.0).abs() < 1e-12);
            assert!(faired.length[1] < faired.length[0]);
            if closed {
                let [was, is] = [&rough, &faired.spline].map(|s| curvature_error(s, &clean));
                assert!(is < 0.5 * was, "{method:?} {normal}: {was} {is}");
            }
        }
    }
}

/// Sections as a table has them, with decimals of a thousandth or a tenth of that: no point of them moves by
/// a tenth of the cap. With noise the cap is the user's.
#[test]
fn smooth_sections_stay_within_a_tenth_of_the_cap() {
    const CAP: f64 = 0.02;
    for (n, decimals) in [(40, 1e4), (60, 1e4), (200, 1e4), (200, 1e3)] {
        let rounded = |p: &Point2| Point2::from(p.coords.map(|x| (x * decimals).round() / decimals));
        let table: Vec<Point2> = side(n).iter().map(rounded).collect();
        for spline in [through(table.clone(), false), through(blade(2 * n), true)] {
            for method in METHODS {
                let faired = Fairing::of_noise(method, CAP, &spline).apply(&spline).unwrap();
                assert!(faired.furthest() <= 0.1 * CAP, "{n} {decimals} {method:?}: {}", faired.furthest());
            }
        }
    }
    for normal in [false, true] {
        let rough = through(noisy(&blade(200), normal), true);
        let found = noise(&rough);
        let truth = if normal { 0.05 } else { 0.05 / 2.0f64.sqrt() };
        assert!((found / truth - 1.0).abs() < 0.2, "{normal}: {found} {truth}");
        assert_eq!(Fairing::of_noise(METHODS[1], CAP, &rough).most_displacement, CAP);
    }
}

#[test]
fn a_thin_leading_edge_stays() {
    for rough in [false, true] {
        let clean = through(blade(200), true);
        let before = if rough { through(noisy(clean.points(), false), true) } else { clean.clone() };
        for method in METHODS {
            let faired = Fairing { method, ..Fairing::within(0.05) }.apply(&before).unwrap();
            let (curvature, [left, right]) = ends(&faired.spline);
            assert!((1.6..2.5).contains(&curvature), "{method:?} {rough}: {curvature}");
            for x in [-left, right] {
                assert!((29.94..30.01).contains(&x), "{method:?} {rough}: {x}");
            }
        }
    }
}

#[test]
fn without_caps_all_becomes_one_cubic() {
    let mut random = random(7);
    let points: Vec<Point2> = (0..9).map(|k| Point2::new(f64::from(k), random())).collect();
    let spline = through(points, false);
    for method in METHODS {
        let faired =
            Fairing { method, most_displacement: 10.0, least_movement: 1e-9 }.apply(&spline).unwrap();
        let [before, after] = faired.jump_energy;
        assert!(after < 1e-9 * before, "{method:?} {after} {before} {}", faired.rounds);
    }
}

#[test]
fn options_out_of_range_are_refused() {
    let spline = through(blade(20), true);
    let good = Fairing::within(0.05);
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        match (Fairing { most_displacement: bad, ..good }).apply(&spline) {
            Err(FairingError::Length { what, .. }) => assert_eq!(what, "the greatest displacement"),
            other => panic!("{other:?}"),
        }
        let refused = Fairing { least_movement: bad, ..good }.apply(&spline);
        assert!(matches!(refused, Err(FairingError::Length { .. })));
    }
    let method = FairingMethod::Published { neighbours: 0 };
    assert!(matches!(Fairing { method, ..good }.apply(&spline), Err(FairingError::NoNeighbours)));
    for step in [0.0, 3.4, f64::NAN] {
        let method = FairingMethod::Kjellander { step };
        let refused = Fairing { method, ..good }.apply(&spline).unwrap_err();
        assert!(refused.to_string().contains("above 0 and below 3.344"), "{refused}");
    }
    // Three points closed, and few open ones.
    for method in METHODS {
        for points in 2..8 {
            let open =
                Fairing { method, ..good }.apply(&through(side(20)[..points].to_vec(), false)).unwrap();
            assert!(open.settled && open.furthest() <= 0.05);
            if points > 2 {
                let closed = Fairing { method, ..good }.apply(&through(blade(points), true)).unwrap();
                assert!(closed.settled && closed.furthest() <= 0.05);
            }
        }
    }
}
