use proptest::prelude::*;

use super::rounding::TailArc;
use super::*;
use geometry::Vector2;

/// A counter-clockwise ellipse from its right end.
fn ellipse(a: f64, b: f64, n: usize) -> Vec<Point2> {
    let at = |k: usize| std::f64::consts::TAU * k as f64 / n as f64;
    (0..n).map(|k| Point2::new(a * at(k).cos(), b * at(k).sin())).collect()
}

fn closed(height: f64, points: Vec<Point2>) -> Section {
    Section { height, outline: Outline::Closed(points) }
}

fn refusal(sections: Vec<Section>) -> String {
    Sections::new(sections).unwrap_err().to_string()
}

fn two(change: impl FnOnce(&mut Vec<Point2>)) -> String {
    let mut points = ellipse(20.0, 3.0, 40);
    change(&mut points);
    refusal(vec![closed(0.0, ellipse(20.0, 3.0, 40)), closed(10.0, points)])
}

/// Sides of an uncambered or cambered profile, mm, chord 40.
fn sides(height: f64, digits: &str) -> Section {
    let d = NacaDigits::parse(digits).unwrap();
    let profile = NacaProfile::new(d.camber, d.position, d.thickness, true).unwrap();
    let side = |upper| profile.side(30, 1.0, upper).into_iter().map(|p| p * 40.0).collect();
    Section { height, outline: Outline::Sides { pressure: side(false), suction: side(true) } }
}

fn exchanged(section: Section) -> Section {
    match section.outline {
        Outline::Sides { pressure, suction } => {
            Section { outline: Outline::Sides { pressure: suction, suction: pressure }, ..section }
        }
        closed @ Outline::Closed(_) => Section { outline: closed, ..section },
    }
}

fn reversed(mut section: Section, which: [bool; 2]) -> Section {
    match &mut section.outline {
        Outline::Closed(points) => points.reverse(),
        Outline::Sides { pressure, suction } => {
            for (side, turn) in [pressure, suction].into_iter().zip(which) {
                if turn {
                    side.reverse();
                }
            }
        }
    }
    section
}

fn blade(trailing_edge: TrailingEdge) -> GeneratedBlade {
    let station = |height: f64, camber, thickness, chord, angle: f64| Station {
        height,
        camber,
        position: 0.4,
        thickness,
        chord,
        angle: angle.to_radians(),
        lean: Vector2::new(0.02 * height, 0.0),
    };
    GeneratedBlade {
        stations: vec![
            station(0.0, 0.06, 0.12, 40.0, 20.0),
            station(30.0, 0.04, 0.10, 36.0, 35.0),
            station(60.0, 0.02, 0.08, 30.0, 50.0),
        ],
        sections: 12,
        points: 50,
        trailing_edge,
        stacking: Stacking::Chord(0.25),
    }
}

#[test]
fn good_sections_are_taken_and_turned_counter_clockwise() {
    let mut clockwise = ellipse(20.0, 3.0, 40);
    clockwise.reverse();
    clockwise.push(clockwise[0]);
    let s = Sections::new(vec![closed(0.0, clockwise.clone()), closed(5.0, clockwise)]).unwrap();
    assert!(s.are_closed() && s.sections().len() == 2);
    for section in s.sections() {
        let exact = std::f64::consts::PI
            * 60.0
            * (40.0 / std::f64::consts::TAU)
            * (std::f64::consts::TAU / 40.0).sin();
        assert!((section.outline.signed_area() - exact).abs() < 1e-9);
        assert_eq!(section.outline.point_count(), 40);
    }
    let s = Sections::new(vec![sides(0.0, "2412"), sides(9.0, "2410")]).unwrap();
    assert!(!s.are_closed() && s.edges().unwrap().is_empty());
    // Pressure and suction exchanged throughout is a blade of the other hand.
    Sections::new(vec![exchanged(sides(0.0, "2412")), exchanged(sides(9.0, "2410"))]).unwrap();
}

#[test]
fn wrong_points_are_told_with_their_place() {
    let at = |text: String, start: &str| assert!(text.starts_with(start), "{text}");
    at(two(|p| p[16] = p[15]), "section 2 (height 10 mm), outline, point 17 repeats point 16; delete");
    at(
        two(|p| p[39] = p[0] + Vector2::new(1e-9, 0.0)),
        "section 2 (height 10 mm), outline, point 40 repeats",
    );
    at(two(|p| p[3].x = f64::NAN), "section 2 (height 10 mm), outline, point 4: (NaN,");
    at(two(|p| p[3].x = 2e6), "section 2 (height 10 mm), outline, point 4: (2000000,");
    at(
        two(|p| p.truncate(4)),
        "section 2 (height 10 mm): the outline has 4 points; a curve needs at least 5",
    );
    let crossed = two(|p| p.swap(7, 8));
    at(crossed.clone(), "section 2 (height 10 mm), outline, point 7: the outline crosses or touches itself");
    assert!(crossed.contains("between points 7 and 8 and between 9 and 10"), "{crossed}");
    at(two(|p| p.iter_mut().for_each(|p| p.y = 0.0)), "section 2 (height 10 mm)");
    at(two(|p| p.reverse()), "section 2 (height 10 mm): the outline runs in the other sense");
    at(two(|p| p.iter_mut().for_each(|p| *p /= 25.4)), "section 2 (height 10 mm) is 1.5");
    at(two(|p| p.iter_mut().for_each(|p| *p *= 25.4)), "section 1 (height 0 mm) is 40");
}

#[test]
fn wrong_sets_are_told_with_their_place() {
    let e = || ellipse(20.0, 3.0, 40);
    let of = |heights: &[f64]| heights.iter().map(|h| closed(*h, e())).collect::<Vec<_>>();
    assert!(refusal(vec![]).starts_with("there is no section"));
    assert!(refusal(of(&[1.0])).starts_with("there is only 1 section"));
    assert!(refusal(of(&[0.0, 5.0, 5.0])).starts_with("section 3 (height 5 mm) is no higher"));
    assert!(refusal(of(&[0.0, f64::NAN])).starts_with("section 2: the height NaN"));
    assert!(refusal(of(&[0.0, 0.06])).contains("different units"));
    assert!(refusal(of(&[0.0, 60_000.0])).contains("different units"));
    let mixed = refusal(vec![closed(0.0, e()), sides(10.0, "2412")]);
    assert!(mixed.starts_with("section 2 (height 10 mm) is a pressure and a suction side"), "{mixed}");
    let many = vec![closed(0.0, ellipse(20.0, 3.0, MAX_POINTS)), closed(1.0, e())];
    assert!(refusal(many).contains("thin them out"));
}

#[test]
fn wrong_sides_are_told_with_their_place() {
    let second = |section: Section| refusal(vec![sides(0.0, "2412"), section]);
    let opposed = second(reversed(sides(10.0, "2412"), [true, false]));
    assert!(opposed.contains("run against each other"), "{opposed}");
    let switched = second(reversed(sides(10.0, "2412"), [true, true]));
    assert!(switched.contains("its leading edge lies where section 1 has its trailing edge"), "{switched}");
    let exchanged = second(exchanged(sides(10.0, "2412")));
    assert!(exchanged.contains("have changed places: exchange them; section 1 does"), "{exchanged}");
    let mut crossing = sides(10.0, "2412");
    if let Outline::Sides { suction, .. } = &mut crossing.outline {
        suction[15].y = -9.0;
    }
    let crossing = second(crossing);
    assert!(crossing.contains("the pressure and the suction side meet at x"), "{crossing}");
    let mut own = sides(10.0, "2412");
    if let Outline::Sides { suction, .. } = &mut own.outline {
        suction.swap(14, 15);
    }
    let own = second(own);
    assert!(own.contains("suction side, point 14") || own.contains("the suction side crosses"), "{own}");
    assert!(own.contains("between points 15 and 14") || own.contains("between points"), "{own}");
}

/// The profiles of NACA report 460 and the usual tables (Abbott and von Doenhoff 1959), per cent of the
/// chord.
#[test]
fn four_digit_profiles_have_their_tabled_ordinates() {
    let naca = |digits: &str| {
        let d = NacaDigits::parse(digits).unwrap();
        NacaProfile::new(d.camber, d.position, d.thickness, false).unwrap()
    };
    // NACA 0012: station, ordinate.
    let table = [
        (1.25, 1.894),
        (2.5, 2.615),
        (5.0, 3.555),
        (7.5, 4.200),
        (10.0, 4.683),
        (15.0, 5.345),
        (20.0, 5.737),
        (25.0, 5.941),
        (30.0, 6.002),
        (40.0, 5.803),
        (50.0, 5.294),
        (60.0, 4.563),
        (70.0, 3.664),
        (80.0, 2.623),
        (90.0, 1.448),
        (95.0, 0.807),
        (100.0, 0.126),
    ];
    for (x, y) in table {
        let at = naca("0012").point(x / 100.0, true);
        assert!((at.y * 100.0 - y).abs() < 6e-4, "{x}: {} {y}", at.y * 100.0);
        assert_eq!(naca("0012").point(x / 100.0, false).y, -at.y);
    }
    // Radius of the nose, 1.1019 t²: y²/2x at its very end.
    let nose = naca("0012").half_thickness(1e-14)[0].powi(2) / 2e-14;
    assert!((nose * 100.0 - 1.58).abs() < 0.01);
    assert!((nose - 1.1019 * 0.12 * 0.12).abs() < 1e-6);
    // Thickest at 30 % of the chord: 12 %.
    let [half, slope] = naca("0012").half_thickness(0.3);
    assert!((2.0 * half - 0.12).abs() < 5e-5 && slope.abs() < 1e-3);
    // NACA 2412: upper and lower side at stations, to the two decimals of the tables (computed by hand).
    let upper = [(1.25, 2.15), (5.0, 4.13), (10.0, 5.63), (20.0, 7.26), (30.0, 7.88), (40.0, 7.80)];
    let lower = [(1.25, -1.65), (5.0, -3.01), (10.0, -3.75), (20.0, -4.23), (30.0, -4.12), (40.0, -3.80)];
    for (side, table) in [(true, upper), (false, lower)] {
        for (x, y) in table {
            let (mut a, mut b) = (0.0, 1.0);
            for _ in 0..60 {
                let middle: f64 = 0.5 * (a + b);
                if naca("2412").point(middle, side).x < x / 100.0 { a = middle } else { b = middle }
            }
            let found = naca("2412").point(a, side).y * 100.0;
            assert!((found - y).abs() < 0.012, "{x}: {found} {y}");
        }
    }
    // NACA 4412: camber 4 % at 40 %, level there; the thickness stands square to the camber line.
    let p = naca("4412");
    assert_eq!(p.camber(0.4)[..2], [0.04, 0.0]);
    for x in [0.01, 0.2, 0.4, 0.7, 1.0] {
        let (u, l) = (p.point(x, true), p.point(x, false));
        let [y, slope, _] = p.camber(x);
        assert!((nalgebra::center(&u, &l) - Point2::new(x, y)).norm() < 1e-15);
        assert!((u - l).dot(&Vector2::new(1.0, slope)).abs() < 1e-15);
        assert!(((u - l).norm() - 2.0 * p.half_thickness(x)[0]).abs() < 1e-15);
    }
    for upper in [true, false] {
        let (h, x) = (1e-6, 0.23);
        let difference = (p.point(x + h, upper) - p.point(x - h, upper)) / (2.0 * h);
        assert!((difference - p.tangent(x, upper)).norm() < 1e-8);
    }
    let closed = NacaProfile::new(0.02, 0.4, 0.12, true).unwrap();
    assert!((closed.point(1.0, true) - closed.point(1.0, false)).norm() < 1e-15);
}

#[test]
fn digits_are_read_or_refused() {
    let d = NacaDigits::parse("2412").unwrap();
    assert_eq!((d.camber, d.position, d.thickness), (0.02, 0.4, 0.12));
    assert_eq!(NacaDigits::parse("0412").unwrap().position, 0.0);
    for wrong in ["", "241", "24120", "24a2", "２４１２", "-412"] {
        assert!(matches!(NacaDigits::parse(wrong), Err(ProfileError::Digits(_))), "{wrong}");
    }
    assert!(matches!(NacaDigits::parse("2012"), Err(ProfileError::NoPosition(_))));
    assert!(matches!(NacaDigits::parse("2400"), Err(ProfileError::Thickness(_))));
}

/// The arc is tangent to both sides where it meets them, and has its radius in its middle.
fn runs_into_both_sides(arc: &TailArc, profile: &NacaProfile) -> Result<(), String> {
    let length = arc.length();
    let ends = [(arc.touches[0], true, length, -1e-6), (arc.touches[1], false, 0.0, 1e-6)];
    for (x, upper, s, ahead) in ends {
        let apart = (profile.point(x, upper) - arc.at(s)).norm();
        let along = (arc.at(s + ahead * arc.radius) - arc.at(s)).normalize();
        let tangent = profile.tangent(x, upper).normalize();
        if apart > 1e-12 || along.perp(&tangent).abs() > 2e-6 || along.dot(&tangent) < 0.99 {
            return Err(format!("{apart} {along} {tangent}"));
        }
    }
    let [a, b, c] = [0.45, 0.5, 0.55].map(|share| arc.at(share * length));
    let found = (b - a).norm() * (c - b).norm() * (c - a).norm() / (2.0 * (b - a).perp(&(c - a)));
    if (found / arc.radius - 1.0).abs() < 1e-6 { Ok(()) } else { Err(format!("{found} {}", arc.radius)) }
}

/// The greatest camber, with its corner in both sides, lies where the arc would take over. With these easings
/// no arc is tangent to both sides: each that is tangent to their stretches as they continue beyond the
/// corner touches one of them beyond it.
#[test]
fn a_trailing_edge_at_the_corners_of_the_sides_has_the_nearest_easing() {
    let profile =
        NacaProfile::new(0.06643373541587784, 0.6908139308811708, 0.11604703662727234, true).unwrap();
    let radius = 0.5 * 0.11604703662727234 * 0.553921104276872;
    for easing in [0.634, 0.6346, 0.6352] {
        let arc = TailArc::of(&profile, radius, easing).unwrap();
        assert!(arc.easing != easing && (arc.easing - easing).abs() < 0.01, "{easing} {}", arc.easing);
        runs_into_both_sides(&arc, &profile).unwrap();
    }
}

/// An arc exists here, and steps from one stretch to the next go past it.
#[test]
fn a_trailing_edge_ahead_of_one_corner_and_behind_the_other_is_found() {
    let profile =
        NacaProfile::new(0.07547708040660736, 0.8655167524703665, 0.3496272771212208, true).unwrap();
    let radius = 0.5 * 0.3496272771212208 * 0.24987185749180668;
    let arc = TailArc::of(&profile, radius, 0.5).unwrap();
    assert_eq!(arc.easing, 0.5);
    runs_into_both_sides(&arc, &profile).unwrap();
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// The arc begins and ends on the sides in their directions, and has its radius in between; without
    /// easing it is a circle, whose centre is as far from both sides as the radius and no nearer to any other
    /// place of them.
    #[test]
    fn round_trailing_edges_run_into_both_sides(
        camber in 0.0..0.09f64, position in 0.2..0.8f64, thickness in 0.05..0.2f64, share in 0.02..0.7f64,
        easing in 0.05..0.8f64,
    ) {
        let profile = NacaProfile::new(camber, position, thickness, true).unwrap();
        let radius = 0.5 * thickness * share;
        for easing in [0.0, easing] {
            let arc = TailArc::of(&profile, radius, easing).unwrap();
            let near = (arc.easing - easing).abs();
            prop_assert!(near < 0.03, "{} {}", arc.easing, easing);
            runs_into_both_sides(&arc, &profile).map_err(TestCaseError::fail)?;
            let length = arc.length();
            let [a, b, c] = [0.45, 0.5, 0.55].map(|share| arc.at(share * length));
            let points = arc.points();
            prop_assert!(points.len() % 2 == 1 && points.len() < 32);
            prop_assert!((points[points.len() / 2] - b).norm() < 1e-12);
            if arc.easing == 0.0 {
                let centre = b + (nalgebra::center(&a, &c) - b).normalize() * radius;
                for k in 0..=40 {
                    prop_assert!(((arc.at(k as f64 / 40.0 * length) - centre).norm() - radius).abs() < 1e-11);
                }
                for (x, upper) in [(arc.touches[0], true), (arc.touches[1], false)] {
                    for k in 1..200 {
                        let ahead = profile.point(x * k as f64 / 200.0, upper);
                        prop_assert!((ahead - centre).norm() > radius - 1e-11);
                    }
                }
            }
        }
    }

}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Wherever a blade is turned and moved to, its edges go along.
    #[test]
    fn edges_move_with_the_blade(angle in -3.0..3.0f64, x in -50.0..50.0f64, start in 0usize..100) {
        let mut generated = blade(TrailingEdge::Rounded { radius: 0.3 });
        generated.sections = 3;
        let plain = generated.generate().unwrap().edges().unwrap();
        for s in &mut generated.stations {
            s.angle += angle;
            s.lean = nalgebra::Rotation2::new(angle) * s.lean + Vector2::new(x, 2.0);
        }
        let moved = generated.generate().unwrap();
        let turned = moved.sections().iter().map(|s| match &s.outline {
            Outline::Closed(points) => {
                let mut points = points.clone();
                points.rotate_left(start);
                closed(s.height, points)
            }
            Outline::Sides { .. } => s.clone(),
        });
        let found = Sections::new(turned.collect()).unwrap().edges().unwrap();
        for (a, b) in plain.iter().zip(&found) {
            let there = |p: Point2| nalgebra::Rotation2::new(angle) * p + Vector2::new(x, 2.0);
            prop_assert!((there(a.leading.point) - b.leading.point).norm() < 1e-6);
            prop_assert!((there(a.trailing.point) - b.trailing.point).norm() < 1e-6);
            prop_assert!(b.pressure_first);
        }
    }
}

#[test]
fn ellipses_have_their_edges_at_their_vertices() {
    // Points off the vertices.
    let turned = |n: usize, shift: f64| -> Vec<Point2> {
        let at = |k: usize| std::f64::consts::TAU * (k as f64 + shift) / n as f64;
        (0..n).map(|k| Point2::new(20.0 * at(k).cos(), 4.0 * at(k).sin())).collect()
    };
    for shift in [0.0, 0.2, 0.5] {
        let s = Sections::new(vec![closed(0.0, turned(90, shift)), closed(9.0, turned(90, shift))]).unwrap();
        for e in s.edges().unwrap() {
            assert!((e.leading.point - Point2::new(-20.0, 0.0)).norm() < 0.02, "{:?}", e.leading);
            assert!((e.trailing.point - Point2::new(20.0, 0.0)).norm() < 0.02, "{:?}", e.trailing);
            // b²/a at the vertex, and more beside it.
            assert!(e.leading.radius > 0.8 && e.leading.radius < 1.3, "{}", e.leading.radius);
            assert!(e.pressure_first);
        }
        let s = s.with_leading(Some(LeadingEnd::PlusX));
        assert!(s.edges().unwrap().iter().all(|e| e.leading.point.x > 19.9));
    }
}

#[test]
fn rounded_blades_have_their_edges_where_they_were_generated() {
    let generated = blade(TrailingEdge::Rounded { radius: 0.3 });
    let sections = generated.generate().unwrap();
    let edges = sections.edges().unwrap();
    let (mut worst, mut trailing) = (0.0f64, 0.0f64);
    for (section, e) in sections.sections().iter().zip(&edges) {
        let Outline::Closed(points) = &section.outline else { panic!("closed") };
        // The nose is the last of 50 points of the upper side, the trailing edge the middle of the arc.
        let nose = points[49];
        let middle = points[99 + (points.len() - 99) / 2];
        worst = worst.max((e.leading.point - nose).norm());
        trailing = trailing.max((e.trailing.point - middle).norm());
        assert!((e.trailing.radius - 0.3).abs() < 0.03, "{}", e.trailing.radius);
        assert!(e.leading.radius > 0.2 && e.pressure_first && e.trailing.is_round());
    }
    assert!(worst < 0.15 && trailing < 1e-9, "{worst} {trailing}");
    // No hollows beside the edge that a cutter would not fit into.
    for spline in edges.iter().map(|e| &e.spline) {
        let places = (0..4000).map(|k| spline.domain()[1] * f64::from(k) / 4000.0);
        let hollow = places.map(|t| spline.curvature(t)).fold(0.0, f64::min);
        assert!(hollow > -0.1, "{hollow}");
    }
}

#[test]
fn generated_leading_edges_may_be_the_finer_ones() {
    for angle in [20.0, 80.0, 170.0, 260.0, 350.0_f64] {
        let mut generated = blade(TrailingEdge::Rounded { radius: 0.6 });
        for s in &mut generated.stations {
            (s.thickness, s.angle) = (0.07, angle.to_radians());
        }
        let way = Vector2::new(angle.to_radians().cos(), angle.to_radians().sin());
        for e in generated.generate().unwrap().edges().unwrap() {
            assert!(e.leading.radius < e.trailing.radius);
            assert!((e.trailing.point - e.leading.point).dot(&way) > 15.0 && e.pressure_first);
        }
    }
}

#[test]
fn sides_of_closed_outlines_begin_and_end_at_the_edges() {
    let sections = blade(TrailingEdge::Rounded { radius: 0.3 }).generate().unwrap();
    let edges = sections.edges().unwrap();
    for ((s, e), section) in sections.sides().unwrap().iter().zip(&edges).zip(sections.sections()) {
        assert_eq!(s.height, section.height);
        for side in [&s.pressure, &s.suction] {
            assert!((side[0] - e.leading.point).norm() < 1e-12);
            assert!((side[side.len() - 1] - e.trailing.point).norm() < 1e-12);
        }
        assert!(s.around_closed && (s.around[0] - e.trailing.point).norm() < 1e-12);
        let given = section.outline.signed_area();
        assert!((geometry::signed_area(&s.around) - given).abs() < 2e-3 * given);
        let both = Outline::Sides { pressure: s.pressure.clone(), suction: s.suction.clone() };
        assert!((both.signed_area() - geometry::signed_area(&s.around)).abs() < 1e-9);
        // Every point of the table is on one of the sides, but for those that an edge replaced.
        assert!(s.around.len() >= section.outline.point_count());
        // The suction side is the longer one.
        let length = |side: &[Point2]| side.windows(2).map(|w| (w[1] - w[0]).norm()).sum::<f64>();
        assert!(length(&s.suction) > length(&s.pressure));
    }
}

#[test]
fn corners_and_blunt_edges_of_closed_outlines_are_found() {
    for (edge, shared) in [(TrailingEdge::Closed, true), (TrailingEdge::Open, false)] {
        let generated = blade(edge).generate().unwrap();
        let outline = |s: &Section| match &s.outline {
            Outline::Sides { pressure, suction } => {
                let skip = usize::from(shared);
                let back = suction.iter().rev().skip(skip);
                let points = pressure.iter().skip(1).chain(back).copied().collect();
                closed(s.height, points)
            }
            Outline::Closed(_) => s.clone(),
        };
        let sections = Sections::new(generated.sections().iter().map(outline).collect()).unwrap();
        for (e, (a, b)) in sections
            .edges()
            .unwrap()
            .iter()
            .zip(sections.sides().unwrap().iter().zip(generated.sides().unwrap()))
        {
            assert!(!e.trailing.is_round() && e.leading.is_round() && !a.around_closed);
            assert_eq!(e.trailing.parameters[0] == e.trailing.parameters[1], shared);
            for (found, given) in [(&a.pressure, &b.pressure), (&a.suction, &b.suction)] {
                assert!((found[found.len() - 1] - given[given.len() - 1]).norm() < 1e-12);
                assert!((found[0] - given[0]).norm() < 0.2);
            }
            assert!((a.around[0] - b.around[0]).norm() < 1e-12);
            assert!((geometry::signed_area(&a.around) - geometry::signed_area(&b.around)).abs() < 0.02);
        }
    }
}

#[test]
fn generated_blades_go_through_their_stations() {
    let mut generated = blade(TrailingEdge::Closed);
    generated.sections = 5;
    let sections = generated.generate().unwrap();
    for (k, station) in [(0, 0), (2, 1), (4, 2)] {
        let (section, s) = (&sections.sections()[k], generated.stations[station]);
        assert!((section.height - s.height).abs() < 1e-12);
        let Outline::Sides { pressure, suction } = &section.outline else { panic!("sides") };
        let chord = suction[49] - suction[0];
        assert!((chord.norm() - s.chord).abs() < 1e-12);
        assert!((chord.y.atan2(chord.x) - s.angle).abs() < 1e-12);
        assert!((suction[0] + chord * 0.25 - Point2::from(s.lean)).norm() < 1e-12);
        assert!((pressure[49] - suction[49]).norm() < 1e-12);
    }
    generated.stacking = Stacking::Centroid;
    generated.trailing_edge = TrailingEdge::Rounded { radius: 0.3 };
    for section in generated.generate().unwrap().sections() {
        let Outline::Closed(points) = &section.outline else { panic!("closed") };
        let (mut moment, mut area) = (Vector2::zeros(), 0.0);
        for (k, a) in points.iter().enumerate() {
            let b = points[(k + 1) % points.len()];
            let cross = a.coords.perp(&b.coords);
            area += 0.5 * cross;
            moment += (a.coords + b.coords) * cross / 6.0;
        }
        assert!((moment / area - Vector2::new(0.02 * section.height, 0.0)).norm() < 1e-9);
    }
}

#[test]
fn blades_that_cannot_be_generated_say_why() {
    let refusal = |change: &dyn Fn(&mut GeneratedBlade)| {
        let mut generated = blade(TrailingEdge::Rounded { radius: 0.3 });
        change(&mut generated);
        generated.generate().unwrap_err().to_string()
    };
    assert!(refusal(&|b| b.stations.truncate(1)).contains("at least 2 stations"));
    assert!(refusal(&|b| b.stations[2].height = 30.0).starts_with("station 3 is no higher"));
    assert!(refusal(&|b| b.stations[1].chord = 0.0).starts_with("station 2: the chord is 0"));
    assert!(refusal(&|b| b.stations[1].angle = f64::NAN).starts_with("station 2: the angle is NaN"));
    assert!(refusal(&|b| b.stations[1].thickness = 0.7).starts_with("station 2: the thickness is 0.7"));
    assert!(refusal(&|b| b.stations[1].camber = -0.1).starts_with("station 2: camber -0.1"));
    assert!(refusal(&|b| b.sections = 1).starts_with("1 sections cannot"));
    assert!(refusal(&|b| b.points = 1_000_000).starts_with("1000000 points a side cannot"));
    assert!(refusal(&|b| b.stacking = Stacking::Chord(-3.0)).contains("stacking point"));
    let radius = refusal(&|b| b.trailing_edge = TrailingEdge::Rounded { radius: 1.9 });
    assert!(radius.contains("may be 80 % of half of that at most"), "{radius}");
    assert!(refusal(&|b| b.trailing_edge = TrailingEdge::Rounded { radius: -1.0 }).contains("radius -1"));
}

/// Circles whose points begin anywhere have their edges one above the other, below an ellipse those of its
/// chord.
#[test]
fn round_sections_have_edges_where_their_neighbours_have_them() {
    let turned = |points: Vec<Point2>, angle: f64| -> Vec<Point2> {
        points.iter().map(|p| nalgebra::Rotation2::new(angle) * p).collect()
    };
    let circle = |height: f64, start: f64| closed(height, turned(ellipse(6.0, 6.0, 60), start));
    let angles = |sections: Vec<Section>| -> Vec<f64> {
        let found = Sections::new(sections).unwrap().edges().unwrap();
        found.iter().map(|e| e.trailing.point - e.leading.point).map(|c| c.y.atan2(c.x)).collect()
    };
    // Snapping moves an edge by a twentieth of the step between two points.
    let near = 0.1 * std::f64::consts::TAU / 60.0;
    let all = angles(vec![circle(0.0, 0.3), circle(2.0, 2.0), circle(4.0, -2.3), circle(5.0, 1.0)]);
    assert!(all.iter().all(|angle| (angle - all[0]).abs() < near), "{all:?}");
    let lens = |height: f64, angle: f64| closed(height, turned(ellipse(8.0, 3.0, 60), angle));
    let mixed =
        angles(vec![circle(0.0, 1.9), circle(2.0, -1.0), lens(4.0, 0.5), lens(6.0, 0.7), circle(8.0, 3.0)]);
    let expected = [0.5, 0.5, 0.5, 0.7, 0.7];
    assert!(mixed.iter().zip(expected).all(|(a, b)| (a - b).abs() < near), "{mixed:?}");
}
