use super::*;
use geometry::Vector2;
use proptest::prelude::*;
use std::f64::consts::{PI, TAU};

fn open(points: Vec<Point2>) -> CubicSpline {
    CubicSpline::open(CubicSpline::chord_lengths(&points, false), points).unwrap()
}

fn closed(points: Vec<Point2>) -> CubicSpline {
    CubicSpline::closed(CubicSpline::chord_lengths(&points, true), points).unwrap()
}

/// An ellipse turned and moved, counter-clockwise.
fn oval(a: f64, b: f64, turn: f64, centre: Vector2) -> Vec<Point2> {
    let at = |k: usize| TAU * k as f64 / 160.0;
    let (s, c) = turn.sin_cos();
    let point = |t: f64| Point2::new(a * t.cos() * c - b * t.sin() * s, a * t.cos() * s + b * t.sin() * c);
    (0..160).map(|k| point(at(k)) + centre).collect()
}

fn stacked<'a>(curves: &'a [CubicSpline], heights: &[f64]) -> Vec<LoftSection<'a>> {
    curves.iter().zip(heights).map(|(curve, &height)| LoftSection { curve, height }).collect()
}

/// How far the surface strays from its sections, looked at densely.
fn deviation(loft: &Loft, sections: &[LoftSection]) -> f64 {
    let mut greatest: f64 = 0.0;
    for (s, &v) in sections.iter().zip(&loft.section_parameters) {
        let fine: Vec<Point2> = s.curve.within_chord(1e-7).iter().map(|&t| s.curve.point(t)).collect();
        let walls = geometry::SegmentGrid::of_curves([fine.as_slice()]);
        for k in 0..700 {
            let p = loft.surface.point((f64::from(k) + 0.4) / 700.0, v);
            assert!((p.z - s.height).abs() < 1e-9);
            greatest = greatest.max(walls.distance(&p.xy()));
        }
    }
    greatest
}

#[test]
fn open_sections_are_followed_whatever_their_number() {
    let wave = |k: usize| -> Vec<Point2> {
        let lean = 0.3 * k as f64;
        (0..=60)
            .map(|i| 0.5 * f64::from(i))
            .map(|x| Point2::new(x * (1.0 + 0.03 * lean), 3.0 * (0.3 * x + lean).sin() + lean))
            .collect()
    };
    for count in 2..8 {
        let curves: Vec<CubicSpline> = (0..count).map(|k| open(wave(k))).collect();
        let heights: Vec<f64> = (0..count).map(|k| (k * k) as f64 + 2.0 * k as f64).collect();
        let sections = stacked(&curves, &heights);
        let loft = loft(&sections, 1e-3).unwrap();
        assert!(loft.error_mm <= 1e-3 && deviation(&loft, &sections) <= loft.error_mm);
        assert_eq!(loft.surface.knots_v().degree(), 3.min(count - 1));
        assert_eq!(loft.surface.domain(), [[0.0, 1.0], [0.0, 1.0]]);
        let start = loft.surface.point(0.0, 0.0).xy();
        assert!((start - curves[0].points()[0]).norm() < 1e-9);
        // Arc lengths are aligned: half of u is half of the length.
        let arc = curves[0].arc_length();
        let middle = curves[0].point(arc.parameter_at(0.5 * arc.total()));
        assert!((loft.surface.point(0.5, 0.0).xy() - middle).norm() < 2e-3);
    }
}

#[test]
fn closed_sections_have_a_seam_without_trace_and_point_outward() {
    let curves: Vec<CubicSpline> = (0..5)
        .map(|k| 0.2 * f64::from(k))
        .map(|k| closed(oval(12.0 - 2.0 * k, 2.0, k, Vector2::new(k, -k))))
        .collect();
    let sections = stacked(&curves, &[-3.0, 0.0, 4.0, 9.0, 10.0]);
    let loft = loft(&sections, 1e-3).unwrap();
    assert!(loft.error_mm <= 1e-3 && deviation(&loft, &sections) <= loft.error_mm);
    for k in 0..=40 {
        let v = f64::from(k) / 40.0;
        let (a, b) = (loft.surface.jet(0.0, v), loft.surface.jet(1.0, v));
        assert!((a.p - b.p).norm() < 1e-10 && (a.du - b.du).norm() < 1e-8 && (a.duu - b.duu).norm() < 1e-4);
        assert!((a.dv - b.dv).norm() < 1e-9);
    }
    // Outward.
    let jet = loft.surface.jet(0.3, loft.section_parameters[0]);
    assert!(jet.normal().unwrap().xy().dot(&jet.p.coords.xy()) > 0.0);
    // Unclamped knots go through the rest of the geometry.
    let [us, vs] = [loft.surface.knots_u().breaks(), loft.surface.knots_v().breaks()];
    let net = geometry::tessellate(&|u, v| loft.surface.jet(u, v), [&us, &vs], 0.01).unwrap();
    assert!(net.triangles.len() > 100);
}

#[test]
fn points_crowd_where_sections_bend() {
    // A thin oval bends at its ends, a hundred times more than beside.
    let curves = [0.0, 0.1].map(|turn| closed(oval(20.0, 0.7, turn, Vector2::zeros())));
    let sections = stacked(&curves, &[0.0, 10.0]);
    let loft = loft(&sections, 1e-4).unwrap();
    let breaks = loft.surface.knots_u().breaks();
    let spans = breaks.windows(2).map(|w| w[1] - w[0]);
    assert!(spans.clone().fold(0.0, f64::max) > 7.0 * spans.fold(1.0, f64::min), "{}", loft.points);
    assert!(deviation(&loft, &sections) <= loft.error_mm);
}

#[test]
fn offsets_of_sections_are_lofted() {
    let curves: Vec<CubicSpline> =
        (0..4).map(|k| closed(oval(12.0, 5.0, 0.2 * f64::from(k), Vector2::zeros()))).collect();
    let sections = stacked(&curves, &[0.0, 5.0, 10.0, 15.0]);
    let outward = loft_of_offsets(&sections, -3.0, 1e-3).unwrap();
    assert_eq!(outward.len(), 1);
    let walls = geometry::SegmentGrid::of_curves([curves[0]
        .within_chord(1e-6)
        .iter()
        .map(|&t| curves[0].point(t))
        .collect::<Vec<_>>()
        .as_slice()]);
    for k in 0..100 {
        let p = outward[0].surface.point(f64::from(k) / 100.0, 0.0).xy();
        assert!((walls.distance(&p) - 3.0).abs() < 1e-3);
    }
    // Inside beyond the least radius (25/12) every section has two corners, and two surfaces stand for it.
    assert_eq!(loft_of_offsets(&sections, 3.0, 1e-3).unwrap().len(), 2);
    let error = loft_of_offsets(&sections, 5.5, 1e-3).unwrap_err();
    assert!(
        matches!(error, LoftError::Offset { section: 0, source: CurveOffsetError::Eaten { .. } }),
        "{error}"
    );
}

/// Greatest difference from `distance`, mm, of places of surfaces at the heights of sections from their
/// curves.
fn off_distance(lofts: &[Loft], sections: &[LoftSection], distance: f64) -> f64 {
    let mut greatest: f64 = 0.0;
    for (k, section) in sections.iter().enumerate() {
        let outline: Vec<Point2> =
            section.curve.within_chord(1e-6).iter().map(|&t| section.curve.point(t)).collect();
        let nearest = |p: Point2| {
            let to_side = |w: &[Point2]| geometry::distance_to_segment(&p, &w[0], &w[1]);
            outline.windows(2).map(to_side).fold(f64::INFINITY, f64::min)
        };
        for loft in lofts {
            let v = loft.section_parameters[k];
            let at = |i: u32| loft.surface.point(f64::from(i) / 100.0, v).xy();
            greatest = (0..=100).map(|i| (nearest(at(i)) - distance).abs()).fold(greatest, f64::max);
        }
    }
    greatest
}

#[test]
fn corners_that_only_some_sections_have_fade_out_in_the_others() {
    // Offset inward beyond the least radius of the ovals (25/12 mm), which rounder ones are not.
    let oval_of = |b: f64, turn: f64| closed(oval(12.0, b, turn, Vector2::zeros()));
    for halves in [[5.0, 5.0, 8.0, 5.0], [9.0, 5.0, 5.0, 9.0], [9.0, 9.0, 9.0, 5.0]] {
        let curves: Vec<CubicSpline> =
            halves.iter().zip([0.0, 0.1, 0.2, 0.3]).map(|(b, turn)| oval_of(*b, turn)).collect();
        let sections = stacked(&curves, &[0.0, 5.0, 10.0, 15.0]);
        let lofts = loft_of_offsets(&sections, 3.0, 1e-3).unwrap();
        assert_eq!(lofts.len(), 2, "{halves:?}");
        let off = off_distance(&lofts, &sections, 3.0);
        assert!(off < 1.5e-3, "{halves:?}: {off}");
        // The surfaces join at the heights of the sections, all around.
        for k in 0..4 {
            let [a, b] = [0, 1].map(|i: usize| (&lofts[i].surface, lofts[i].section_parameters[k]));
            for (from, to) in [(a, b), (b, a)] {
                let gap = (from.0.point(1.0, from.1) - to.0.point(0.0, to.1)).norm();
                assert!(gap < 2e-3, "{halves:?} {k}: {gap}");
            }
        }
    }
}

#[test]
fn open_sections_break_where_their_neighbours_have_corners() {
    // A hollow whose least radius falls from section to section.
    let hollow = |depth: f64| {
        let at = |k: u32| -10.0 + f64::from(k) / 4.0;
        open((0..=80).map(|k| Point2::new(at(k), depth * (at(k) / 2.0).tanh().powi(2))).collect())
    };
    let curves: Vec<CubicSpline> = [0.5, 1.0, 3.0, 6.0].map(hollow).to_vec();
    let sections = stacked(&curves, &[0.0, 4.0, 8.0, 12.0]);
    let radius = |c: &CubicSpline| {
        (0..=400).map(|k| c.curvature(c.domain()[1] * f64::from(k) / 400.0)).fold(0.0, f64::max).recip()
    };
    assert!(radius(&curves[1]) > 1.5 && radius(&curves[2]) < 1.5);
    let lofts = loft_of_offsets(&sections, 1.5, 1e-3).unwrap();
    assert_eq!(lofts.len(), 2);
    assert!(off_distance(&lofts, &sections, 1.5) < 1.5e-3);
    // The break lies at the lowest place, as the corners do.
    assert!(lofts[0].surface.point(1.0, 0.0).x.abs() < 0.05);
}

#[test]
fn offsets_that_fall_apart_or_have_foreign_corners_are_named() {
    // Two rooms with a neck of 2 mm between them.
    let neck = |narrow: f64| {
        let at = |k: u32| std::f64::consts::TAU * f64::from(k) / 160.0;
        let half = |x: f64| 6.0 - narrow * (-(x / 3.0).powi(2)).exp();
        closed(
            (0..160).map(at).map(|t| Point2::new(14.0 * t.cos(), half(14.0 * t.cos()) * t.sin())).collect(),
        )
    };
    let curves = [0.0, 5.0].map(neck);
    let error = loft_of_offsets(&stacked(&curves, &[0.0, 5.0]), 2.0, 1e-3).unwrap_err();
    assert!(matches!(error, LoftError::Parted { section: 1, pieces: 2, .. }), "{error}");
    assert!(error.to_string().contains("section 1 (height 5 mm) falls into 2 pieces"), "{error}");
    // Hollows at the two ends of their lengths, in turn: columns would meet.
    let hollow = |middle: f64| {
        let at = |k: u32| f64::from(k) / 8.0;
        open((0..=160).map(|k| Point2::new(at(k), 4.0 * ((at(k) - middle) / 1.5).tanh().powi(2))).collect())
    };
    let curves = [4.0, 16.0, 4.0].map(hollow);
    let lofts = loft_of_offsets(&stacked(&curves, &[0.0, 5.0, 10.0]), 1.5, 1e-3).unwrap();
    assert_eq!(lofts.len(), 3, "each hollow is a column of its own");
}

#[test]
fn sections_that_do_not_fit_are_named() {
    let points = oval(12.0, 5.0, 0.0, Vector2::zeros());
    let plain = closed(points.clone());
    let refused = |curves: [&CubicSpline; 2], heights: [f64; 2]| {
        let sections = [0, 1].map(|k| LoftSection { curve: curves[k], height: heights[k] });
        loft(&sections, 1e-3).unwrap_err()
    };
    let mut turned = points.clone();
    turned.reverse();
    assert_eq!(refused([&plain, &closed(turned)], [0.0, 1.0]), LoftError::Sense { section: 1 });
    let mut started = points.clone();
    started.rotate_left(80);
    let error = refused([&plain, &closed(started)], [0.0, 1.0]);
    assert_eq!(error, LoftError::Start { section: 1, share: 0.5 });
    assert!(error.to_string().contains("50 %"));
    let tiny = closed(points.iter().map(|p| p * 1e-4).collect());
    assert!(matches!(refused([&plain, &tiny], [0.0, 1.0]), LoftError::Short { section: 1, .. }));
    let error = refused([&plain, &plain], [2.0, 2.0]);
    assert_eq!(error, LoftError::Order { section: 1, height: 2.0, below: 2.0 });
    assert!(matches!(refused([&plain, &plain], [2.0, f64::NAN]), LoftError::Height { section: 1, .. }));
    let arc = |from: f64, to: f64| {
        let at = |k: u32| from + (to - from) * f64::from(k) / 30.0;
        open((0..=30).map(|k| Point2::new(at(k).cos(), at(k).sin()) * 9.0).collect())
    };
    let (there, back) = (arc(0.0, PI), arc(PI, 0.0));
    assert_eq!(refused([&there, &back], [0.0, 1.0]), LoftError::Sense { section: 1 });
    assert_eq!(refused([&there, &plain], [0.0, 1.0]), LoftError::Mixed { section: 1, closed: true });
    let one = [LoftSection { curve: &plain, height: 0.0 }];
    assert_eq!(loft(&one, 1e-3).unwrap_err(), LoftError::TooFew(1));
    assert_eq!(loft(&[], 1e-3).unwrap_err(), LoftError::TooFew(0));
    let two = stacked(std::slice::from_ref(&plain), &[0.0]);
    assert!(loft(&[two[0], LoftSection { height: 1.0, ..two[0] }], f64::NAN).is_err());
    let sections = [two[0], LoftSection { height: 1.0, ..two[0] }];
    assert!(matches!(
        loft(&sections, 1e-15).unwrap_err(),
        LoftError::Short { .. } | LoftError::NotReached { .. }
    ));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    /// Random open sections with uneven points: the bound holds.
    #[test]
    fn lofts_keep_their_bound(
        ys in prop::collection::vec(-3.0f64..3.0, 24), gaps in prop::collection::vec(0.5f64..6.0, 3),
    ) {
        let row = |k: usize| -> Vec<Point2> {
            ys[6 * k..6 * k + 6].iter().enumerate().map(|(i, y)| Point2::new(4.0 * i as f64, *y)).collect()
        };
        let curves: Vec<CubicSpline> = (0..4).map(|k| open(row(k))).collect();
        let heights = [0.0, gaps[0], gaps[0] + gaps[1], gaps[0] + gaps[1] + gaps[2]];
        let sections = stacked(&curves, &heights);
        match loft(&sections, 1e-3) {
            Ok(found) => {
                let strays = deviation(&found, &sections);
                prop_assert!(strays <= found.error_mm, "{strays} {}", found.error_mm);
            }
            // A wild one may resemble its neighbour more when reversed.
            Err(error) => prop_assert!(matches!(error, LoftError::Sense { .. }), "{error}"),
        }
    }
}
