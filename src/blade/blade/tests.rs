use super::*;
use crate::sections::{Outline, Section};
use geometry::{Point3, signed_area};

/// An ellipse of half axes `a` and `b`, turned by `angle`, bent upward in its middle by `camber`.
fn oval([a, b]: [f64; 2], angle: f64, camber: f64) -> Vec<Point2> {
    let turn = nalgebra::Rotation2::new(angle);
    let at = |k: u32| {
        let t = f64::from(k) * std::f64::consts::TAU / 120.0;
        turn * Point2::new(a * t.cos(), b * t.sin() + camber * t.sin().powi(2))
    };
    (0..120).map(at).collect()
}

/// Ovals from 12 to 8 mm half length over 40 mm, twisted by 30 degrees.
fn twisted() -> Sections {
    let section = |k: u32| {
        let t = f64::from(k) / 7.0;
        let outline = Outline::Closed(oval([12.0 - 4.0 * t, 2.0 - 0.5 * t], 0.5 * t, 1.5));
        Section { height: 40.0 * t, outline }
    };
    Sections::new((0..8).map(section).collect()).unwrap()
}

fn settings(side: BladeSide) -> BladeSettings {
    BladeSettings { side, pitch: None, placed: Isometry3::identity(), fairing: None }
}

/// The middle of a section's material at a height.
fn middle(z: f64) -> Point3 {
    let t = z / 40.0;
    let p = nalgebra::Rotation2::new(0.5 * t) * Point2::new(0.0, 0.75);
    Point3::new(p.x, p.y, z)
}

#[test]
fn surfaces_pass_through_the_sections_and_look_outward() {
    let sections = twisted();
    for (side, count) in [(BladeSide::Both, 2), (BladeSide::Around, 1), (BladeSide::Suction, 1)] {
        let blade = Blade::new(&sections, &settings(side)).unwrap();
        assert_eq!(blade.surfaces.len(), count);
        assert!(blade.error_mm <= LOFT_TOLERANCE);
        for surface in &blade.surfaces {
            for k in 0..400 {
                let [u, v] = [(k % 20, 0.5), (k / 20, 0.5)].map(|(k, half)| (f64::from(k) + half) / 20.0);
                let jet = surface.jet(u, v);
                let outward = jet.p - middle(jet.p.z);
                assert!(jet.normal().unwrap().dot(&outward) > 0.0, "{side:?} {u} {v}");
            }
        }
    }
    // Every point of the table lies on the patch all around.
    let blade = Blade::new(&sections, &settings(BladeSide::Around)).unwrap();
    for (section, curve) in sections.sections().iter().zip(&blade.curves[0].splines) {
        let Outline::Closed(points) = &section.outline else { panic!() };
        for p in points {
            let nearest = curve.points().iter().map(|q| (q - p).norm()).fold(f64::INFINITY, f64::min);
            assert!(nearest < 1e-9, "{nearest}");
        }
    }
}

#[test]
fn sides_meet_at_the_edges_with_one_tangent() {
    let blade = Blade::new(&twisted(), &settings(BladeSide::Both)).unwrap();
    let [a, b] = [&blade.surfaces[0], &blade.surfaces[1]];
    for v in [0.0, 0.31, 1.0] {
        for (from, to) in [(0.0, 1.0), (1.0, 0.0)] {
            let (p, q) = (a.jet(from, v), b.jet(to, v));
            assert!((p.p - q.p).norm() < 1e-3, "{}", (p.p - q.p).norm());
            let angle = p.normal().unwrap().cross(&q.normal().unwrap()).norm();
            assert!(angle < 0.02, "{angle}");
        }
    }
}

#[test]
fn offsets_in_planes_stand_the_distance_off_in_their_planes() {
    let blade = Blade::new(&twisted(), &settings(BladeSide::Around)).unwrap();
    let offset = blade.offset_in_planes(3.0).unwrap();
    assert_eq!(offset.len(), 1);
    let curve = &blade.curves[0].splines[0];
    let dense: Vec<Point2> = (0..20_000)
        .map(|k| {
            let [a, b] = curve.domain();
            curve.point(a + (b - a) * f64::from(k) / 20_000.0)
        })
        .collect();
    for k in 0..100 {
        let p = offset[0].point(f64::from(k) / 100.0, 0.0);
        let distance = dense.iter().map(|q| (q - p.xy()).norm()).fold(f64::INFINITY, f64::min);
        assert!((distance - 3.0).abs() < 2e-3, "{distance}");
    }
}

#[test]
fn a_passage_has_the_sides_that_face_each_other() {
    for (pitch, sense) in [(Vector3::new(0.0, 15.0, 0.0), 1.0), (Vector3::new(0.0, -15.0, 0.0), -1.0)] {
        let settings = BladeSettings { pitch: Some(pitch), ..settings(BladeSide::Passage) };
        let blade = Blade::new(&twisted(), &settings).unwrap();
        let normals: Vec<Vector3> =
            blade.surfaces.iter().map(|s| s.jet(0.5, 0.5).normal().unwrap()).collect();
        assert!(normals[0].y * sense > 0.5 && normals[1].y * sense < -0.5, "{normals:?}");
        assert!((blade.surfaces[1].point(0.5, 0.5).y - pitch.y).abs() < 5.0);
    }
    // Blades of 4 to 3 mm, bent by 1.5, that stand 2 mm apart.
    let near = BladeSettings { pitch: Some(Vector3::new(0.0, 2.0, 0.0)), ..settings(BladeSide::Passage) };
    let refused = Blade::new(&twisted(), &near).unwrap_err();
    assert!(matches!(refused, BladeError::Neighbours { .. }) && refused.cure().is_some(), "{refused}");
    let alone = Blade::new(&twisted(), &settings(BladeSide::Passage)).unwrap_err();
    assert_eq!(alone, BladeError::NoSecondBlade);
}

#[test]
fn a_sharp_trailing_edge_has_sides_but_no_way_around() {
    // A wedge from x = 10 that goes over into half an ellipse, round at x = -10.
    let lens = |height: f64| {
        let wedge = (0..10).map(|k| Point2::new(10.0 - f64::from(k), 0.2 * f64::from(k)));
        let round = (0..=12).map(|k| {
            let t = std::f64::consts::FRAC_PI_2 * (1.0 + f64::from(k) / 12.0);
            Point2::new(10.0 * t.cos(), 2.0 * t.sin())
        });
        let upper = wedge.chain(round);
        let points: Vec<Point2> = upper.collect();
        let lower = points[1..points.len() - 1].iter().rev().map(|p| Point2::new(p.x, -p.y));
        let outline: Vec<Point2> = points.iter().copied().chain(lower).collect();
        assert!(signed_area(&outline) > 0.0);
        Section { height, outline: Outline::Closed(outline) }
    };
    let sections = Sections::new(vec![lens(0.0), lens(20.0), lens(40.0)]).unwrap();
    let refused = Blade::new(&sections, &settings(BladeSide::Around)).unwrap_err();
    assert_eq!(refused, BladeError::SharpEdge);
    assert_eq!(Blade::new(&sections, &settings(BladeSide::Both)).unwrap().surfaces.len(), 2);
}

#[test]
fn a_blade_can_be_turned_and_moved() {
    let placed = Isometry3::new(Vector3::new(1.0, 2.0, 3.0), Vector3::x() * -std::f64::consts::FRAC_PI_2);
    let moved = Blade::new(&twisted(), &BladeSettings { placed, ..settings(BladeSide::Around) }).unwrap();
    let here = Blade::new(&twisted(), &settings(BladeSide::Around)).unwrap();
    let (p, q) = (moved.surfaces[0].point(0.3, 0.7), placed * here.surfaces[0].point(0.3, 0.7));
    assert!((p - q).norm() < 1e-12);
}

/// A section with a bump of 20 µm at one point: faired by what is published, it lies off its drawing where
/// the bump was, by no more than the bump moved.
#[test]
fn what_fairing_moved_is_told_as_a_distance_from_the_drawing() {
    let mut outline = oval([12.0, 2.0], 0.0, 1.0);
    // The normal of the upper side there is nearly upright.
    outline[30].y += 0.02;
    let section = |height: f64| Section { height, outline: Outline::Closed(outline.clone()) };
    let sections = Sections::new((0..4).map(|k| section(10.0 * f64::from(k))).collect()).unwrap();
    let fairing = Some((FairingMethod::Published { neighbours: 1 }, 0.05));
    let blade = Blade::new(&sections, &BladeSettings { fairing, ..settings(BladeSide::Around) }).unwrap();
    for section in &blade.sections {
        let [least, most] = section.off_drawing().unwrap();
        let moved = section.faired.as_ref().unwrap().furthest();
        assert!((0.01..0.02).contains(&moved), "{moved}");
        assert!((least + moved).abs() < 0.05 * moved && most < 0.3 * moved, "{least} {most} {moved}");
    }
    let drawn = Blade::new(&sections, &settings(BladeSide::Around)).unwrap();
    assert!(drawn.sections.iter().all(|section| section.off_drawing().is_none()));
}

/// One point far off its neighbours stays off: fairing moves no point much farther than the noise of all.
/// That is told with its place, also without fairing. Noise, and corners that all sections have, are not.
#[test]
fn a_point_off_its_neighbours_is_told() {
    let step = crate::fairing::JUMP_REMOVING_STEP;
    let methods = [
        None,
        Some(FairingMethod::Kjellander { step }),
        Some(FairingMethod::ControlPoints),
        Some(FairingMethod::Energy),
        Some(FairingMethod::Published { neighbours: 1 }),
    ];
    let notes = |method: Option<FairingMethod>, change: &dyn Fn(usize, &mut Vec<Point2>)| {
        let mut all = twisted().sections().to_vec();
        for (k, section) in all.iter_mut().enumerate() {
            let Outline::Closed(points) = &mut section.outline else { panic!() };
            change(k, points);
        }
        let fairing = method.map(|method| (method, 0.02));
        let settings = BladeSettings { fairing, ..settings(BladeSide::Around) };
        Blade::new(&Sections::new(all).unwrap(), &settings).unwrap().notes()
    };
    let noise = |k: usize| 0.002 * ((k * k * 7919 % 1000) as f64 / 500.0 - 1.0);
    for method in methods {
        let faired = usize::from(method.is_some());
        assert_eq!(notes(method, &|_, _| ()).len(), faired, "{method:?}");
        let noisy = |_: usize, points: &mut Vec<Point2>| {
            points.iter_mut().enumerate().for_each(|(k, p)| p.y += noise(k));
        };
        assert_eq!(notes(method, &noisy).len(), faired, "{method:?}");
        let corners = |_: usize, points: &mut Vec<Point2>| points[30].y += 0.3;
        assert_eq!(notes(method, &corners).len(), faired, "{method:?}");
        let one = |section: usize, points: &mut Vec<Point2>| {
            if section == 3 {
                points[30].y += 0.3;
            }
        };
        let words = notes(method, &one);
        let height = 40.0 * 3.0 / 7.0;
        assert_eq!(words.len(), faired + 1, "{method:?}: {words:?}");
        let said = &words[faired];
        assert!(said.contains(&format!("outline at height {height} lies")), "{said}");
        assert_eq!(said.contains("fairing moved it"), method.is_some(), "{said}");
    }
}
