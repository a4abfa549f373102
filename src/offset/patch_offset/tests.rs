use super::*;
use approx::assert_relative_eq;
use geometry::{Point3, samples};
use proptest::prelude::*;

/// `z = f(x) + g(y)` for quartics over ±half, exactly, as a Bézier patch of degree 4.
fn quartic(half: f64, f: [f64; 5], g: [f64; 5]) -> NurbsSurface {
    // Bézier coefficients on [−half, half] of a polynomial: its blossom.
    let blossom = |c: &[f64; 5], i: usize| {
        let at = |k: usize| if k < i { half } else { -half };
        let symmetric = |m: usize| {
            let subsets = (0u32..16).filter(|s| s.count_ones() as usize == m);
            let product = |s: u32| (0..4).filter(|k| s >> k & 1 == 1).map(at).product::<f64>();
            let (sum, count) = subsets.fold((0.0, 0.0), |(a, n), s| (a + product(s), n + 1.0));
            sum / count
        };
        (0..5).map(|m| c[m] * symmetric(m)).sum::<f64>()
    };
    let place = |k: usize| -half + 0.5 * half * k as f64;
    let net: Vec<Vec<Point3>> = (0..5)
        .map(|i| (0..5).map(|j| Point3::new(place(i), place(j), blossom(&f, i) + blossom(&g, j))).collect())
        .collect();
    let knots: Vec<f64> = [0.0, 1.0].iter().flat_map(|&k| [k; 5]).collect();
    NurbsSurface::new(4, 4, knots.clone(), knots, &net, None).unwrap()
}

/// A roof of two flat halves: a crease along x = 0, its sides falling (or rising) by `slope`.
fn roof(slope: f64) -> NurbsSurface {
    let row = |x: f64| (0..4).map(|j| Point3::new(x, 3.0 * f64::from(j), -slope * x.abs())).collect();
    let net: Vec<Vec<Point3>> = (-2..3).map(|i| row(2.0 * f64::from(i))).collect();
    let knots_u = vec![0., 0., 0., 1., 1., 2., 2., 2.];
    NurbsSurface::new(2, 3, knots_u, vec![0., 0., 0., 0., 1., 1., 1., 1.], &net, None).unwrap()
}

#[test]
fn a_crease_is_singular_on_its_concave_side() {
    for (slope, outside) in [(0.5, 1.0), (-0.5, -1.0)] {
        // A ridge is concave from below, a valley from above; du × dv points up.
        let s = roof(slope);
        let above = OffsetSurface::new(&s, outside).unwrap();
        let below = OffsetSurface::new(&s, -outside).unwrap();
        assert!(above.singular_places().is_empty());
        let found = below.singular_places();
        assert_eq!((found.len(), found[0].at[0], found[0].radius), (1, 1.0, 0.0));
    }
}

#[test]
fn an_offset_beyond_the_least_concave_radius_is_found_at_its_place() {
    // z = 0.15 (x − 1)² + 0.1 (y + 2)² but for quartic terms that bend less farther out: the greatest
    // curvature is 0.3 along x, at the bottom (1, −2).
    let f = [0.15, -0.3, 0.15, 0.0, 0.0];
    let g = [0.4, 0.4, 0.1, 0.0, 0.0];
    let s = quartic(6.0, f, g);
    let (u, v) = (7.0 / 12.0, 4.0 / 12.0);
    let bottom = Point3::new(1.0, -2.0, 0.0);
    assert!((s.point(u, v) - bottom).norm() < 1e-12);
    let at = |d: f64| OffsetSurface::new(&s, d).unwrap().singular_places();
    assert!(at(1.0 / 0.3 - 1e-3).is_empty() && at(-50.0).is_empty() && at(0.0).is_empty());
    for d in [1.0 / 0.3 + 1e-3, 4.0, 9.0] {
        let found = at(d);
        assert_eq!(found.len(), 1, "{d} {found:?}");
        assert!((found[0].point - bottom).norm() < 1e-4 && (found[0].at[0] - u).abs() < 1e-5, "{found:?}");
        assert_relative_eq!(found[0].radius, 1.0 / 0.3, epsilon = 1e-8);
        assert_relative_eq!(found[0].curvature, 0.3, epsilon = 1e-8);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]
    /// Against a dense look at every place: the worst region, and none where the offset is regular.
    #[test]
    fn the_worst_place_is_that_of_all(a in 0.4f64..2.5, b in 0.4f64..2.5, side in prop::bool::ANY) {
        let s = samples::bicubic(&[1.0, a, 1.0, b, 1.3]);
        let sign = if side { 1.0 } else { -1.0 };
        let share = |k: usize| (k % 300) as f64 / 299.0;
        let bend = |k: usize| {
            let bent = s.jet(share(k / 300), share(k)).principal_curvatures().unwrap();
            f64::max(bent.min * sign, bent.max * sign)
        };
        let dense = (0..90_000).map(bend).fold(0.0, f64::max);
        let beyond = OffsetSurface::new(&s, sign * 1.02 / dense).unwrap().singular_places();
        prop_assert!(!beyond.is_empty());
        let found = beyond[0].curvature;
        prop_assert!(found >= dense - 1e-9 && found <= dense * 1.02, "{found} {dense}");
        let [u, v] = beyond[0].at;
        prop_assert!((s.point(u, v) - beyond[0].point).norm() < 1e-12);
        prop_assert!(OffsetSurface::new(&s, sign / (found * (1.0 + 1e-9))).unwrap().singular_places().is_empty());
    }
}

#[test]
fn separate_hollows_are_separate_regions_and_seams_do_not_part_them() {
    // −x⁴/40 + x²/… has two hollows along x.
    let s = quartic(6.0, [0.0, 0.0, -0.2, 0.0, 0.005], [0.0, 0.0, 0.02, 0.0, 0.0]);
    let greatest = |x: f64| s.jet(x / 12.0 + 0.5, 0.5).principal_curvatures().unwrap().max;
    let hollow = (0..6000).map(|k| f64::from(k) * 1e-3).map(greatest).fold(0.0, f64::max);
    let found = OffsetSurface::new(&s, 1.0 / hollow + 0.02).unwrap().singular_places();
    assert_eq!(found.len(), 2, "{found:?}");
    assert!((found[0].curvature - hollow).abs() < 1e-6 && (found[0].point.x + found[1].point.x).abs() < 1e-4);
    // A sphere from inside: one region, over its seam and its pole.
    let sphere = samples::hemisphere(Point3::origin(), 7.0);
    let found = OffsetSurface::new(&sphere, -7.5).unwrap().singular_places();
    assert_eq!(found.len(), 1, "{found:?}");
    assert_relative_eq!(found[0].radius, 7.0, epsilon = 1e-6);
    assert!(OffsetSurface::new(&sphere, -6.9).unwrap().singular_places().is_empty());
    let cylinder = samples::half_cylinder(4.0, 9.0);
    assert_eq!(OffsetSurface::new(&cylinder, 4.1).unwrap().singular_places().len(), 1);
}

#[test]
fn what_cannot_be_offset_says_so() {
    let s = samples::bicubic(&[1.0]);
    for d in [f64::NAN, f64::INFINITY, -2e6] {
        assert!(matches!(OffsetSurface::new(&s, d), Err(PatchOffsetError::Distance(_))));
    }
}
