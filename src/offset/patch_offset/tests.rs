use super::*;
use approx::assert_relative_eq;
use geometry::{samples, unit_normal};
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

fn greatest_miss(fit: &FittedOffset, exact: &OffsetSurface, steps: u32) -> f64 {
    let [[u0, u1], [v0, v1]] = fit.surface.domain();
    let share = |k: u32| (f64::from(k) + 0.37) / f64::from(steps);
    let mut greatest: f64 = 0.0;
    for i in 0..steps {
        for j in 0..steps {
            let (u, v) = (u0 + share(i) * (u1 - u0), v0 + share(j) * (v1 - v0));
            greatest = greatest.max((fit.surface.point(u, v) - exact.point(u, v).unwrap()).norm());
        }
    }
    greatest
}

#[test]
fn spheres_and_cylinders_are_offset_exactly() {
    let centre = Point3::new(3.0, -2.0, 5.0);
    let sphere = samples::hemisphere(centre, 7.0);
    let cylinder = samples::half_cylinder(4.0, 9.0);
    for d in [2.5, -2.5, 6.0, -3.9] {
        let (outer, inner) =
            (OffsetSurface::new(&sphere, d).unwrap(), OffsetSurface::new(&cylinder, d).unwrap());
        for i in 0..=40 {
            for j in 0..=20 {
                let (u, v) = (0.1 * f64::from(i), 0.05 * f64::from(j));
                // The pole is the last row: its normal is the limit.
                assert_relative_eq!((outer.point(u, v).unwrap() - centre).norm(), 7.0 + d, epsilon = 1e-9);
                assert_relative_eq!(
                    unit_normal(&sphere, u, v).unwrap(),
                    (sphere.point(u, v) - centre) / 7.0,
                    epsilon = 1e-9
                );
                if j < 20 {
                    let jet = outer.jet(u, v).unwrap();
                    assert_relative_eq!(jet.curvatures[0], -1.0 / (7.0 + d), epsilon = 1e-9);
                    assert_relative_eq!(jet.curvatures[1], -1.0 / (7.0 + d), epsilon = 1e-9);
                    assert_relative_eq!(jet.du, sphere.jet(u, v).du * ((7.0 + d) / 7.0), epsilon = 1e-9);
                    assert_relative_eq!(jet.dv, sphere.jet(u, v).dv * ((7.0 + d) / 7.0), epsilon = 1e-9);
                }
                // The half cylinder's du × dv points to its axis.
                let p = inner.point(0.5 * u, v).unwrap();
                assert_relative_eq!(p.x.hypot(p.z), (4.0 - d).abs(), epsilon = 1e-9);
                let k = inner.jet(0.5 * u, v).unwrap().curvatures;
                let bent = if d < 4.0 { k[1] } else { -k[1].abs() };
                assert_relative_eq!(bent, 1.0 / (4.0 - d), epsilon = 1e-9);
                assert_relative_eq!(k[0], 0.0, epsilon = 1e-9);
            }
        }
    }
    assert!(OffsetSurface::new(&sphere, 1.0).unwrap().jet(1.3, 1.0).is_none());
}

proptest! {
    /// First derivatives against differences of points, curvatures against those that the derivatives of the
    /// normal give, on a rational patch.
    #[test]
    fn derivatives_are_those_of_central_differences(
        u in 0.02f64..0.98, v in 0.02f64..0.98, d in -3.0f64..3.0, heavy in 0.4f64..3.0,
    ) {
        let s = samples::bicubic(&[1.0, heavy, 1.3]);
        let offset = OffsetSurface::new(&s, d).unwrap();
        let jet = offset.jet(u, v).unwrap();
        let h = 1e-5;
        let point = |u: f64, v: f64| offset.point(u, v).unwrap();
        let du = (point(u + h, v) - point(u - h, v)) / (2.0 * h);
        let dv = (point(u, v + h) - point(u, v - h)) / (2.0 * h);
        // A knot may lie between; the offset is once differentiable there.
        prop_assert!((jet.du - du).norm() < 2e-3 * (1.0 + du.norm()), "{} {}", jet.du, du);
        prop_assert!((jet.dv - dv).norm() < 2e-3 * (1.0 + dv.norm()));
        prop_assert!(jet.normal.dot(&jet.du).abs() < 1e-9 * jet.du.norm());
        prop_assert!(jet.normal.dot(&jet.dv).abs() < 1e-9 * jet.dv.norm());
        // Areas shrink by (1 − κ₁ d)(1 − κ₂ d).
        let base = s.jet(u, v);
        let area = jet.du.cross(&jet.dv).dot(&jet.normal) / base.du.cross(&base.dv).norm();
        let [k1, k2] = jet.base_curvatures;
        prop_assert!((area - (1.0 - k1 * d) * (1.0 - k2 * d)).abs() < 1e-9 * (1.0 + area.abs()));
    }

}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]
    /// The bound holds at places that the fit did not look at.
    #[test]
    fn fits_keep_their_bound(d in -2.5f64..2.5, heavy in 0.5f64..2.0, exponent in 2i32..5) {
        let s = samples::bicubic(&[1.0, heavy, 1.2]);
        let tolerance = 10_f64.powi(-exponent);
        let exact = OffsetSurface::new(&s, d).unwrap();
        let fits = exact.fit(tolerance).unwrap();
        prop_assert_eq!(fits.len(), 1);
        prop_assert!(fits[0].error_mm <= tolerance && fits[0].surface.domain() == s.domain());
        let miss = greatest_miss(&fits[0], &exact, 70);
        prop_assert!(miss <= fits[0].error_mm, "{miss} {}", fits[0].error_mm);
    }
}

#[test]
fn a_sphere_is_fitted_with_its_pole() {
    let centre = Point3::new(0.0, 1.0, 2.0);
    let sphere = samples::hemisphere(centre, 7.0);
    let exact = OffsetSurface::new(&sphere, 3.0).unwrap();
    let fit = &exact.fit(1e-4).unwrap()[0];
    assert!(greatest_miss(fit, &exact, 120) <= fit.error_mm && fit.error_mm <= 1e-4 && fit.samples > 100);
    for k in 0..50 {
        let p = fit.surface.point(0.08 * f64::from(k), 1.0 - 0.004 * f64::from(k));
        assert!(((p - centre).norm() - 10.0).abs() <= 1e-4);
    }
}

/// Between two tolerances the number of control points tells the order: the fourth.
#[test]
fn errors_fall_with_the_fourth_power() {
    let s = samples::bicubic(&[1.0]);
    let exact = OffsetSurface::new(&s, 1.5).unwrap();
    let [coarse, fine] =
        [1e-3, 1e-6].map(|t| exact.fit(t).unwrap().remove(0).surface.knots_u().control_count());
    assert!(fine < 8 * coarse, "{coarse} {fine}");
}

#[test]
fn a_crease_parts_the_fit_and_is_singular_on_its_concave_side() {
    for (slope, outside) in [(0.5, 1.0), (-0.5, -1.0)] {
        // A ridge is concave from below, a valley from above; du × dv points up.
        let s = roof(slope);
        let above = OffsetSurface::new(&s, outside).unwrap();
        let below = OffsetSurface::new(&s, -outside).unwrap();
        let fits = above.fit(1e-5).unwrap();
        assert_eq!(fits.len(), 2);
        assert_eq!(fits[0].surface.domain()[0], [0.0, 1.0]);
        assert_eq!(fits[1].surface.domain()[0], [1.0, 2.0]);
        // The halves are torn apart by 2 d sin(angle / 2).
        let gap = fits[0].surface.point(1.0, 0.5) - fits[1].surface.point(1.0, 0.5);
        assert_relative_eq!(gap.norm(), 2.0 * (0.5_f64).atan().sin(), epsilon = 1e-5);
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
        let unit = OffsetSurface::new(&s, sign).unwrap();
        let share = |k: usize| (k % 300) as f64 / 299.0;
        let bend = |k: usize| {
            let [least, greatest] = unit.jet(share(k / 300), share(k)).unwrap().base_curvatures;
            f64::max(least * sign, greatest * sign)
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
    let greatest =
        |x: f64| OffsetSurface::new(&s, 1.0).unwrap().jet(x / 12.0 + 0.5, 0.5).unwrap().base_curvatures[1];
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
    let offset = OffsetSurface::new(&s, 1.0).unwrap();
    for t in [f64::NAN, 0.0, -1.0, 1e-17] {
        assert!(matches!(offset.fit(t), Err(PatchOffsetError::Tolerance(_))));
    }
    // x = t², z = t³ stands still at t = 0, where its normal turns over.
    let cusp = [[1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, 1.0]];
    let net: Vec<Vec<Point3>> =
        cusp.iter().map(|[x, z]| (0..2).map(|j| Point3::new(*x, f64::from(j), *z)).collect()).collect();
    let knots = vec![0., 0., 0., 0., 1., 1., 1., 1.];
    let cusp = NurbsSurface::new(3, 1, knots, vec![0., 0., 1., 1.], &net, None).unwrap();
    let error = OffsetSurface::new(&cusp, 0.5).unwrap().fit(1e-4).unwrap_err();
    let PatchOffsetError::NotReached { u, reached, .. } = error else { panic!("{error}") };
    assert!((u - 0.5).abs() < 0.01 && reached > 0.1, "{u} {reached}");
    // A patch without an area.
    let knots = vec![0.0, 0.0, 1.0, 1.0];
    let line: Vec<Vec<Point3>> =
        (0..2).map(|i| (0..2).map(|j| Point3::new(f64::from(i + j), 0.0, 0.0)).collect()).collect();
    let line = NurbsSurface::new(1, 1, knots.clone(), knots, &line, None).unwrap();
    let error = OffsetSurface::new(&line, 1.0).unwrap().fit(1e-3).unwrap_err();
    assert!(matches!(error, PatchOffsetError::NoNormal { .. }) && error.to_string().contains("u 0 v 0"));
}
