use super::*;
use geometry::{SegmentGrid, signed_area};
use proptest::prelude::*;
use std::f64::consts::{PI, TAU};

fn closed(points: Vec<Point2>) -> CubicSpline {
    CubicSpline::closed(CubicSpline::chord_lengths(&points, true), points).unwrap()
}

fn open(points: Vec<Point2>) -> CubicSpline {
    CubicSpline::open(CubicSpline::chord_lengths(&points, false), points).unwrap()
}

fn ellipse(a: f64, b: f64, n: u32) -> CubicSpline {
    let at = |k: u32| TAU * f64::from(k) / f64::from(n);
    closed((0..n).map(|k| Point2::new(a * at(k).cos(), b * at(k).sin())).collect())
}

impl OffsetPiece {
    /// The corners between stretches, the one at the start of a closed piece last.
    fn corners(&self) -> Vec<Point2> {
        let ends = self.stretches.iter().filter(|s| !s.is_closed()).map(|s| s.point(s.domain()[1]));
        let mut corners: Vec<Point2> = ends.collect();
        if !self.closed {
            corners.pop();
        }
        corners
    }

    /// Points, corners among them, whose chords stray no more than `tolerance`, mm, from the stretches; of a
    /// closed piece the first is not repeated.
    fn polyline(&self, tolerance: f64) -> Vec<Point2> {
        let mut points: Vec<Point2> = Vec::new();
        for stretch in &self.stretches {
            // A corner is the end of one stretch and the start of the next.
            points.pop();
            points.extend(stretch.within_chord(tolerance).iter().map(|&t| stretch.point(t)));
        }
        if self.closed {
            points.pop();
        }
        points
    }
}

fn polyline(curve: &CubicSpline, tolerance: f64) -> Vec<Point2> {
    curve.within_chord(tolerance).iter().map(|&t| curve.point(t)).collect()
}

/// Distance of a point from a curve by brute force over its chords.
fn brute(points: &[Point2], p: &Point2) -> f64 {
    points.windows(2).map(|w| geometry::distance_to_segment(p, &w[0], &w[1])).fold(f64::INFINITY, f64::min)
}

/// No point of the offset nearer than the distance, and none farther.
fn keeps_its_distance(offset: &CurveOffset, curve: &CubicSpline, d: f64, tolerance: f64) {
    let walls = polyline(curve, 0.1 * tolerance);
    for piece in &offset.pieces {
        for p in piece.polyline(0.1 * tolerance) {
            let found = brute(&walls, &p);
            assert!((found - d.abs()).abs() <= 1.3 * tolerance, "{p} {found} {d}");
        }
        for (a, b) in piece.stretches.iter().zip(piece.stretches.iter().skip(1)) {
            assert!((a.point(a.domain()[1]) - b.point(b.domain()[0])).norm() < 1e-9);
        }
    }
}

#[test]
fn circles_become_circles() {
    let circle = ellipse(10.0, 10.0, 240);
    for d in [-4.0, 4.0, 9.0, -0.01, 0.0] {
        let offset = offset_curve(&circle, d, 1e-4, &[]).unwrap();
        assert_eq!((offset.pieces.len(), offset.tight.len()), (1, 0));
        let piece = &offset.pieces[0];
        assert!(piece.closed && piece.stretches.len() == 1 && piece.stretches[0].is_closed());
        assert!(piece.corners().is_empty() && offset.error_mm <= 1e-4);
        let ring = piece.polyline(1e-5);
        assert!(ring.iter().all(|p| (p.coords.norm() - (10.0 - d)).abs() < 1.1e-4));
        assert!((signed_area(&ring) - PI * (10.0 - d).powi(2)).abs() < 0.01);
    }
    for d in [10.5, 25.0, 1e4] {
        let error = offset_curve(&circle, d, 1e-3, &[]).unwrap_err();
        let CurveOffsetError::Eaten { fits, .. } = error else { panic!("{error}") };
        assert!((fits - 10.0).abs() < 0.05, "{fits}");
        assert!(error.to_string().contains("to the left eats the whole section"));
    }
}

#[test]
fn an_ellipse_offset_beyond_its_least_radius_has_two_corners_on_its_axis() {
    let (a, b) = (10.0_f64, 5.0_f64);
    let ellipse = ellipse(a, b, 400);
    let least = b * b / a;
    assert!(offset_curve(&ellipse, least - 0.02, 1e-4, &[]).unwrap().tight.is_empty());
    let d = 3.5;
    let offset = offset_curve(&ellipse, d, 1e-4, &[]).unwrap();
    assert_eq!((offset.pieces.len(), offset.tight.len()), (1, 2));
    for tight in &offset.tight {
        assert!((tight.curvature - 1.0 / least).abs() < 5e-4, "{tight:?}");
        assert!((tight.point.x.abs() - a).abs() < 1e-4 && tight.point.y.abs() < 2e-2);
    }
    let piece = &offset.pieces[0];
    let corners = piece.corners();
    assert!(piece.closed && piece.stretches.len() == 2 && corners.len() == 2);
    // The normal from (a cos t, b sin t) meets the axis at (a² − b²)/a cos t, after b √(sin² + (b/a)² cos²) =
    // d.
    let cos2 = (1.0 - (d / b).powi(2)) / (1.0 - (b / a).powi(2));
    let x = (a * a - b * b) / a * cos2.sqrt();
    for corner in corners {
        assert!((corner.x.abs() - x).abs() < 1e-5 && corner.y.abs() < 1e-6, "{corner} {x}");
    }
    keeps_its_distance(&offset, &ellipse, d, 1e-4);
    let outward = offset_curve(&ellipse, -30.0, 1e-4, &[]).unwrap();
    keeps_its_distance(&outward, &ellipse, 30.0, 1e-4);
    assert!(outward.pieces[0].stretches[0].is_closed());
}

/// A parabola y = x²/2r has its least radius r at its bottom.
#[test]
fn a_trough_beyond_its_least_radius_gets_one_corner() {
    let r = 2.0;
    let at = |k: i32| 0.05 * f64::from(k);
    let trough = open((-120..=120).map(|k| Point2::new(at(k), at(k).powi(2) / (2.0 * r))).collect());
    // Left of its sense (toward +x) is its inside.
    let shallow = offset_curve(&trough, 1.99, 1e-4, &[]).unwrap();
    assert!(shallow.tight.is_empty() && shallow.pieces[0].stretches.len() == 1 && !shallow.pieces[0].closed);
    let d = 3.0;
    let offset = offset_curve(&trough, d, 1e-4, &[]).unwrap();
    assert_eq!((offset.tight.len(), offset.pieces.len()), (1, 1));
    let tight = offset.tight[0];
    assert!(
        (tight.point - Point2::new(0.0, 0.0)).norm() < 1e-3 && (tight.curvature - 0.5).abs() < 5e-4,
        "{tight:?}"
    );
    let piece = &offset.pieces[0];
    assert_eq!((piece.stretches.len(), piece.closed), (2, false));
    // Normals of the parabola from ±x meet on its axis at height r + x²/2r, √(x² + r²) away.
    let corner = piece.corners()[0];
    assert!(corner.x.abs() < 1e-6 && (corner.y - (r + (d * d - r * r) / (2.0 * r))).abs() < 1e-5, "{corner}");
    keeps_its_distance(&offset, &trough, d, 1e-4);
    let below = offset_curve(&trough, -3.0, 1e-4, &[]).unwrap();
    assert!(below.tight.is_empty() && below.pieces[0].stretches.len() == 1);
    keeps_its_distance(&below, &trough, 3.0, 1e-4);
}

/// Two round chambers with a narrow passage between: beyond half its width the offset falls into two.
#[test]
fn a_narrow_passage_parts_the_offset() {
    let n = 360;
    let peanut = |k: i32| {
        let t = TAU * f64::from(k) / f64::from(n);
        let radius = (6.0_f64.powi(2) * (2.0 * t).cos()
            + (6.0_f64.powi(4) * (2.0 * t).cos().powi(2) + 450.0).sqrt())
        .sqrt();
        Point2::new(radius * t.cos(), radius * t.sin())
    };
    let curve = closed((0..n).map(peanut).collect());
    let neck = peanut(n / 4).y;
    let through = offset_curve(&curve, neck - 0.02, 1e-4, &[]).unwrap();
    assert_eq!(through.pieces.len(), 1);
    let parted = offset_curve(&curve, neck + 0.1, 1e-4, &[]).unwrap();
    assert_eq!(parted.pieces.len(), 2);
    for piece in &parted.pieces {
        assert!(piece.closed && piece.corners().len() == 1);
        let ring = piece.polyline(1e-4);
        assert!(signed_area(&ring) > 1.0);
        let side = ring[0].x.signum();
        assert!(ring.iter().all(|p| p.x * side > -1e-6));
    }
    assert!(parted.tight.is_empty());
    keeps_its_distance(&parted, &curve, neck + 0.1, 1e-4);
}

/// A ring that is nearly closed: its outside cannot go on between its ends.
#[test]
fn ends_of_open_curves_are_kept_clear_of() {
    let hook = |k: i32| {
        let t = 1.85 * PI * f64::from(k) / 200.0;
        Point2::new(10.0 * t.cos(), 10.0 * t.sin())
    };
    let mut points: Vec<Point2> = (0..=200).map(hook).collect();
    let tail = points[200];
    points.extend((1..=40).map(|k| tail + Vector2::new(0.4, 0.2) * f64::from(k)));
    let curve = open(points);
    let offset = offset_curve(&curve, -2.0, 1e-3, &[]).unwrap();
    keeps_its_distance(&offset, &curve, 2.0, 1e-3);
    let from = offset.pieces[0].sources[0][0];
    assert!(offset.pieces.iter().all(|p| !p.closed));
    assert!(from >= 0.0 && offset.pieces.len() == 1, "{} {from}", offset.pieces.len());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]
    /// On random stars, inward and outward: everything that is kept has its distance, and every place of the
    /// raw offset that has its distance is near to something kept.
    #[test]
    fn offsets_of_stars_are_those_of_brute_force(
        radii in prop::collection::vec(4.0..14.0f64, 6..14), d in -4.0..4.0f64,
    ) {
        let n = radii.len() as f64;
        let spoke = |(k, r): (usize, &f64)| {
            let angle = TAU * k as f64 / n;
            Point2::new(r * angle.cos(), r * angle.sin())
        };
        let curve = closed(radii.iter().enumerate().map(spoke).collect());
        let walls = polyline(&curve, 1e-5);
        prop_assume!(d.abs() > 0.05);
        // Splines through wild stars may cross themselves: then there is no inside.
        prop_assume!(geometry::Region::nested(vec![walls[1..].to_vec()]).is_ok());
        let tolerance = 1e-3;
        let raw = Offset { curve: &curve, distance: d };
        let [lo, hi] = curve.domain();
        let places: Vec<f64> = (0..700).map(|k| lo + (hi - lo) * f64::from(k) / 700.0).collect();
        let clear: Vec<Point2> =
            places.iter().map(|&t| raw.point(t)).filter(|p| brute(&walls, p) > d.abs() - 2e-5).collect();
        match offset_curve(&curve, d, tolerance, &[]) {
            Ok(offset) => {
                keeps_its_distance(&offset, &curve, d, tolerance);
                let lines = offset.pieces.iter().map(|p| p.polyline(1e-4)).collect::<Vec<_>>();
                prop_assert!(offset.pieces.iter().all(|p| p.closed));
                let grid = SegmentGrid::of_curves(lines.iter().map(Vec::as_slice));
                for p in clear {
                    prop_assert!(grid.distance(&p) < 0.05, "{p} {}", grid.distance(&p));
                }
            }
            Err(error) => {
                prop_assert!(matches!(error, CurveOffsetError::Eaten { .. }) && clear.len() < 3, "{error}");
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20))]
    /// The same on random open curves, whose ends are kept clear of too.
    #[test]
    fn offsets_of_open_curves_are_those_of_brute_force(
        turns in prop::collection::vec(-1.4..1.4f64, 4..12), d in -4.0..4.0f64,
    ) {
        prop_assume!(d.abs() > 0.05);
        let mut points = vec![Point2::origin()];
        let mut heading: f64 = 0.0;
        for (k, turn) in turns.iter().enumerate() {
            heading += turn;
            points.push(points[k] + Vector2::new(heading.cos(), heading.sin()) * 5.0);
        }
        let curve = open(points);
        let walls = polyline(&curve, 1e-5);
        let raw = Offset { curve: &curve, distance: d };
        let [lo, hi] = curve.domain();
        let at = |k: u32| raw.point(lo + (hi - lo) * f64::from(k) / 700.0);
        let clear: Vec<Point2> = (0..=700).map(at).filter(|p| brute(&walls, p) > d.abs() - 2e-5).collect();
        match offset_curve(&curve, d, 1e-3, &[]) {
            Ok(offset) => {
                keeps_its_distance(&offset, &curve, d, 1e-3);
                let line = |piece: &OffsetPiece| {
                    let mut line = piece.polyline(1e-4);
                    line.extend(line.first().copied().filter(|_| piece.closed));
                    line
                };
                let lines: Vec<Vec<Point2>> = offset.pieces.iter().map(line).collect();
                for p in clear {
                    let near = lines.iter().map(|line| brute(line, &p)).fold(f64::INFINITY, f64::min);
                    prop_assert!(near < 0.05, "{p} {near}");
                }
            }
            Err(error) => {
                prop_assert!(matches!(error, CurveOffsetError::Eaten { .. }) && clear.len() < 3, "{error}");
            }
        }
    }
}

#[test]
fn the_start_of_a_closed_curve_does_not_matter() {
    let points: Vec<Point2> = (0..200)
        .map(|k| TAU * f64::from(k) / 200.0)
        .map(|t| Point2::new(12.0 * t.cos(), 4.0 * t.sin()))
        .collect();
    let mut areas = Vec::new();
    for by in [0, 1, 37, 100, 199] {
        let mut turned = points.clone();
        turned.rotate_left(by);
        let offset = offset_curve(&closed(turned), 2.5, 1e-4, &[]).unwrap();
        assert_eq!((offset.pieces.len(), offset.tight.len()), (1, 2), "{by}");
        assert_eq!(offset.pieces[0].corners().len(), 2);
        areas.push(signed_area(&offset.pieces[0].polyline(1e-5)));
    }
    assert!(areas.iter().all(|a| (a - areas[0]).abs() < 1e-2), "{areas:?}");
}

#[test]
fn what_cannot_be_says_so() {
    let circle = ellipse(10.0, 10.0, 60);
    for d in [f64::NAN, f64::INFINITY, 2e6] {
        assert!(matches!(offset_curve(&circle, d, 1e-3, &[]), Err(CurveOffsetError::Distance(_))));
    }
    for t in [f64::NAN, 0.0, -1.0, 1e-12, f64::INFINITY] {
        assert!(matches!(offset_curve(&circle, 1.0, t, &[]), Err(CurveOffsetError::Tolerance(_))));
    }
    // y² = x³ has a cusp.
    let cusp = CubicSpline::open(
        vec![-2.0, -1.0, 0.0, 1.0, 2.0],
        [-2.0_f64, -1.0, 0.0, 1.0, 2.0].map(|t| Point2::new(t * t, t * t * t)).to_vec(),
    );
    let error = offset_curve(&cusp.unwrap(), 0.5, 1e-3, &[]).unwrap_err();
    assert!(matches!(error, CurveOffsetError::Cusp { .. }), "{error}");
}
