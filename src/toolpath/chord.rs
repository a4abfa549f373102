//! Turns a curve of cutter locations into straight moves within a chord tolerance.

use crate::geometry::{Point3, Vector3};

/// Two samples of a pass are never closer than this share of the first sampling interval: where the
/// exact path has a kink, halving would never end. At 2⁻¹² of a quarter of a millimetre the kink is
/// placed to 0.06 µm.
const MAX_HALVINGS: u32 = 12;

/// Distance from `p` to the segment `a`–`b`, mm.
pub fn distance_to_segment(p: &Point3, a: &Point3, b: &Point3) -> f64 {
    let d: Vector3 = b - a;
    let length2 = d.norm_squared();
    let t = if length2 > 0.0 { ((p - a).dot(&d) / length2).clamp(0.0, 1.0) } else { 0.0 };
    (p - (a + d * t)).norm()
}

/// Samples `locate` over `[s0, s1]` so that the straight moves between samples stay within
/// `tolerance` (mm) of the exact curve.
///
/// `locate(s)` gives the cutter location at parameter `s`, `None` where there is none: samples before
/// the first location and after the next gap are left out. The first samples are `step` apart in `s`. Each interval is tested at its middle and its quarters, and halved until all three hold.
///
/// # Tolerance
/// A curve whose curvature changes sign more than four times within one final interval could slip
/// between the tests; `step` should be well below the radius of the cutter.
pub fn sample_within_chord(
    s0: f64,
    s1: f64,
    step: f64,
    tolerance: f64,
    locate: &mut dyn FnMut(f64) -> Option<Point3>,
) -> Vec<Point3> {
    let count = ((s1 - s0) / step).ceil().max(1.0) as usize;
    let at = |k: usize| s0 + (s1 - s0) * k as f64 / count as f64;
    let Some((start, first)) = (0..=count).find_map(|k| locate(at(k)).map(|p| (k, p))) else {
        return Vec::new();
    };
    let mut points = vec![first];
    let mut a = (at(start), first);
    for k in start + 1..=count {
        let s = at(k);
        let Some(p) = locate(s) else { break };
        halve(a, (s, p), tolerance, MAX_HALVINGS, locate, &mut points);
        a = (s, p);
    }
    points
}

/// Appends the samples after `a` up to and with `b`.
fn halve(
    a: (f64, Point3),
    b: (f64, Point3),
    tolerance: f64,
    halvings: u32,
    locate: &mut dyn FnMut(f64) -> Option<Point3>,
    out: &mut Vec<Point3>,
) {
    let s = |t: f64| a.0 + (b.0 - a.0) * t;
    let off = |p: &Option<Point3>| p.is_some_and(|p| distance_to_segment(&p, &a.1, &b.1) > tolerance);
    let middle = locate(s(0.5));
    let split = halvings > 0 && (off(&middle) || off(&locate(s(0.25))) || off(&locate(s(0.75))));
    if let (true, Some(middle)) = (split, middle) {
        let middle = (s(0.5), middle);
        halve(a, middle, tolerance, halvings - 1, locate, out);
        halve(middle, b, tolerance, halvings - 1, locate, out);
    } else if (b.1 - a.1).norm() > 0.0 {
        out.push(b.1);
    }
}

/// No straight move skips more points than this: it bounds the cost on long straight passes, and a
/// pass of n points keeps n/400 at worst where one move would do.
const MAX_SKIP: usize = 400;

/// Drops points that the rest does without: from each kept point the longest straight move that
/// stays within `tolerance` of all points that it skips. The ends stay.
pub fn reduce(points: &[Point3], tolerance: f64) -> Vec<Point3> {
    let Some(&first) = points.first() else { return Vec::new() };
    let mut kept = vec![first];
    let mut from = 0;
    while from + 1 < points.len() {
        let fits = |to: usize| {
            points[from + 1..to]
                .iter()
                .all(|p| distance_to_segment(p, &points[from], &points[to]) <= tolerance)
        };
        let mut to = from + 1;
        while to + 1 < points.len() && to - from < MAX_SKIP && fits(to + 1) {
            to += 1;
        }
        kept.push(points[to]);
        from = to;
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    fn circle(s: f64) -> Option<Point3> {
        Some(Point3::new(10.0 * s.cos(), 10.0 * s.sin(), 0.0))
    }

    #[test]
    fn chords_of_a_circle_hold_the_tolerance_and_no_more() {
        let tolerance = 1e-3;
        let points = sample_within_chord(0.0, 3.0, 0.5, tolerance, &mut circle);
        for pair in points.windows(2) {
            let chord = (pair[1] - pair[0]).norm();
            let sagitta = 10.0 - (100.0 - 0.25 * chord * chord).sqrt();
            assert!(sagitta <= tolerance, "{sagitta}");
            assert!(sagitta >= tolerance / 8.0, "halving loses at most a factor of four: {sagitta}");
        }
        let ideal = 30.0 / (8.0 * tolerance * 10.0f64).sqrt();
        assert!((points.len() as f64) < 2.0 * ideal + 2.0);
    }

    #[test]
    fn a_kink_ends_after_finitely_many_halvings() {
        let points =
            sample_within_chord(0.0, 1.0, 1.0, 1e-9, &mut |s| Some(Point3::new(s, (s - 0.3).abs(), 0.0)));
        assert!(points.len() < 40, "{}", points.len());
        assert!(points.iter().any(|p| (p.x - 0.3).abs() < 1e-3));
    }

    #[test]
    fn reduction_keeps_ends_and_tolerance() {
        let dense: Vec<Point3> = (0..=1000).map(|k| circle(0.003 * k as f64).unwrap()).collect();
        let kept = reduce(&dense, 1e-3);
        assert_eq!(kept.first(), dense.first());
        assert_eq!(kept.last(), dense.last());
        assert!(kept.len() < 120, "{}", kept.len());
        for p in &dense {
            let d = kept.windows(2).map(|w| distance_to_segment(p, &w[0], &w[1])).fold(f64::MAX, f64::min);
            assert!(d <= 1e-3 + 1e-12);
        }
        let line: Vec<Point3> = (0..50).map(|k| Point3::new(k as f64, 0.0, 1.0)).collect();
        assert_eq!(reduce(&line, 1e-9).len(), 2);
    }
}
