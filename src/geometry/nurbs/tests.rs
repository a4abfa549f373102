use super::super::samples;
use super::*;
use approx::assert_relative_eq;
use proptest::prelude::*;

#[test]
fn hemisphere_is_a_sphere() {
    let (centre, radius) = (Point3::new(3.0, -2.0, 5.0), 7.0);
    let s = samples::hemisphere(centre, radius);
    assert_eq!(s.domain(), [[0.0, 4.0], [0.0, 1.0]]);
    for i in 0..=40 {
        for j in 0..=18 {
            let jet = s.jet(0.1 * f64::from(i), 0.05 * f64::from(j));
            let n = jet.normal().unwrap();
            assert_relative_eq!(jet.p, centre + n * radius, epsilon = 1e-12);
            // The normal is the radius: convex, so both curvatures are −1/r.
            let k = jet.principal_curvatures().unwrap();
            assert_relative_eq!(k.min, -1.0 / radius, epsilon = 1e-12);
            assert_relative_eq!(k.max, -1.0 / radius, epsilon = 1e-12);
        }
    }
    let pole = s.jet(1.3, 1.0);
    assert_relative_eq!(pole.p, Point3::new(3.0, -2.0, 12.0), epsilon = 1e-13);
    assert!(pole.normal().is_none() && pole.principal_curvatures().is_none());
}

#[test]
fn half_cylinder_is_a_cylinder() {
    let s = samples::half_cylinder(4.0, 9.0);
    for i in 0..=20 {
        let (u, v) = (0.1 * f64::from(i), 0.05 * f64::from(i));
        let jet = s.jet(u, v);
        assert_relative_eq!(jet.p.x.hypot(jet.p.z), 4.0, epsilon = 1e-13);
        assert_relative_eq!(jet.p.y, 9.0 * v, epsilon = 1e-13);
        let n = jet.normal().unwrap();
        // du × dv points to the axis here (x toward z, then y), hence concave toward the normal.
        assert_relative_eq!(n, -Vector3::new(jet.p.x, 0.0, jet.p.z) / 4.0, epsilon = 1e-12);
        let k = jet.principal_curvatures().unwrap();
        assert_relative_eq!(k.max, 0.25, epsilon = 1e-12);
        assert_relative_eq!(k.min, 0.0, epsilon = 1e-12);
        assert_relative_eq!(k.min_direction.y.abs(), 1.0, epsilon = 1e-12);
        // Along the axis the surface is straight, across it bent.
        assert_relative_eq!(jet.normal_curvature(0.0, 1.0).unwrap(), 0.0, epsilon = 1e-13);
        assert_relative_eq!(jet.normal_curvature(1.0, 0.0).unwrap(), 0.25, epsilon = 1e-12);
    }
}

/// A graph whose control points are Greville abscissae reproduces a quadratic exactly: compare with
/// its closed form, derivatives included.
#[test]
fn a_paraboloid_has_its_own_derivatives() {
    // Bézier form of z = x² − 3xy + 2y² over [0, 2]²: by blossoming, z_ij = x_i x_{i-1} …
    let c = |i: usize| i as f64; // x = 2t, degree 2: abscissae 0, 1, 2
    let square = [0.0, 0.0, 4.0]; // blossom of x²: 0·0, 0·2, 2·2
    let points: Vec<Vec<Point3>> = (0..3)
        .map(|i| {
            (0..3).map(|j| Point3::new(c(i), c(j), square[i] - 3.0 * c(i) * c(j) + 2.0 * square[j])).collect()
        })
        .collect();
    let knots = vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0];
    let s = NurbsSurface::new(2, 2, knots.clone(), knots, &points, None).unwrap();
    let j = s.jet(0.3, 0.8);
    let (x, y) = (0.6, 1.6);
    assert_relative_eq!(j.p, Point3::new(x, y, x * x - 3.0 * x * y + 2.0 * y * y), epsilon = 1e-14);
    assert_relative_eq!(j.du, Vector3::new(2.0, 0.0, 2.0 * (2.0 * x - 3.0 * y)), epsilon = 1e-13);
    assert_relative_eq!(j.dv, Vector3::new(0.0, 2.0, 2.0 * (4.0 * y - 3.0 * x)), epsilon = 1e-13);
    assert_relative_eq!(j.duu, Vector3::new(0.0, 0.0, 8.0), epsilon = 1e-12);
    assert_relative_eq!(j.duv, Vector3::new(0.0, 0.0, -12.0), epsilon = 1e-12);
    assert_relative_eq!(j.dvv, Vector3::new(0.0, 0.0, 16.0), epsilon = 1e-12);
}

/// De Boor's algorithm by repeated interpolation of control points: a second way to a point that
/// shares nothing with the basis functions.
fn de_boor(knots: &KnotVector, u: f64, controls: &[[f64; 4]]) -> [f64; 4] {
    let (p, span) = (knots.degree(), knots.span(u));
    let mut d: Vec<[f64; 4]> = controls[span - p..=span].to_vec();
    for r in 1..=p {
        for j in (r..=p).rev() {
            let i = span - p + j;
            let (lo, hi) = (knots.knots()[i], knots.knots()[i + p + 1 - r]);
            let t = (u - lo) / (hi - lo);
            for c in 0..4 {
                d[j][c] = (1.0 - t) * d[j - 1][c] + t * d[j][c];
            }
        }
    }
    d[p]
}

fn arbitrary_surface() -> impl Strategy<Value = NurbsSurface> {
    (1usize..6, 1usize..6, 0usize..4, 0usize..4).prop_flat_map(|(p, q, extra_u, extra_v)| {
        let (nu, nv) = (p + 1 + extra_u, q + 1 + extra_v);
        let entry = (-1.0f64..1.0, -1.0f64..1.0, -3.0f64..3.0, 0.3f64..3.0);
        proptest::collection::vec(entry, nu * nv).prop_map(move |entries| {
            let at = |i: usize, j: usize| entries[i * nv + j];
            let points: Vec<Vec<Point3>> = (0..nu)
                .map(|i| {
                    let point = |j: usize| {
                        let (dx, dy, z, _) = at(i, j);
                        Point3::new(4.0 * i as f64 + dx, 4.0 * j as f64 + dy, z)
                    };
                    (0..nv).map(point).collect()
                })
                .collect();
            let weights: Vec<Vec<f64>> = (0..nu).map(|i| (0..nv).map(|j| at(i, j).3).collect()).collect();
            let knots = |d, n| KnotVector::clamped_uniform(d, n, [-1.0, 2.0]).unwrap().knots().to_vec();
            NurbsSurface::new(p, q, knots(p, nu), knots(q, nv), &points, Some(&weights)).unwrap()
        })
    })
}

proptest! {
    #[test]
    fn points_agree_with_de_boor(s in arbitrary_surface(), a in 0.0f64..=1.0, b in 0.0f64..=1.0) {
        let (u, v) = (-1.0 + 3.0 * a, -1.0 + 3.0 * b);
        let nv = s.v.control_count();
        let rows: Vec<[f64; 4]> = s.net.chunks(nv).map(|row| de_boor(&s.v, v, row)).collect();
        let [x, y, z, w] = de_boor(&s.u, u, &rows);
        let p = Point3::new(x, y, z) / w;
        prop_assert!((s.point(u, v) - p).norm() < 1e-12);
        prop_assert!((s.jet(u, v).p - p).norm() < 1e-12);
        let bounds = s.control_bounds();
        prop_assert!((0..3).all(|c| p[c] >= bounds.min[c] - 1e-12 && p[c] <= bounds.max[c] + 1e-12));
    }

    #[test]
    fn derivatives_are_those_of_central_differences(s in arbitrary_surface(), a in 0.05f64..0.95, b in 0.05f64..0.95) {
        // Move to the same share of a span, so that no difference reaches over a knot.
        let inside = |k: &KnotVector, t: f64| {
            let breaks = k.breaks();
            let i = ((breaks.len() - 1) as f64 * t) as usize;
            breaks[i] + (breaks[i + 1] - breaks[i]) * (0.1 + 0.8 * t)
        };
        let (u, v, h) = (inside(&s.u, a), inside(&s.v, b), 1e-5);
        let j = s.jet(u, v);
        let [ul, uh, vl, vh] = [s.jet(u - h, v), s.jet(u + h, v), s.jet(u, v - h), s.jet(u, v + h)];
        let close = |exact: Vector3, difference: Vector3| (exact - difference / (2.0 * h)).norm() < 1e-5 * (1.0 + exact.norm());
        prop_assert!(close(j.du, uh.p - ul.p));
        prop_assert!(close(j.dv, vh.p - vl.p));
        prop_assert!(close(j.duu, uh.du - ul.du));
        prop_assert!(close(j.duv, vh.du - vl.du));
        prop_assert!(close(j.duv, uh.dv - ul.dv));
        prop_assert!(close(j.dvv, vh.dv - vl.dv));
    }
}

#[test]
fn equal_weights_change_nothing_and_parameters_are_clamped() {
    let (plain, heavy) = (samples::bicubic(&[1.0]), samples::bicubic(&[8.0]));
    assert_eq!(plain.jet(0.37, 0.61), heavy.jet(0.37, 0.61));
    assert_eq!(plain.jet(-5.0, f64::INFINITY), plain.jet(0.0, 1.0));
    assert!(plain.jet(f64::NAN, f64::NAN).p.iter().all(|c| c.is_finite()));
    assert_relative_eq!(plain.point(1.0, 1.0), plain.control_point(6, 5).0, epsilon = 1e-13);
}

#[test]
fn refuses_and_names_the_place() {
    let k = vec![0.0, 0.0, 1.0, 1.0];
    let square = vec![
        vec![Point3::origin(), Point3::new(0., 1., 0.)],
        vec![Point3::new(1., 0., 0.), Point3::new(1., 1., 0.)],
    ];
    let new = |points: &[Vec<Point3>], weights: Option<&[Vec<f64>]>| {
        NurbsSurface::new(1, 1, k.clone(), k.clone(), points, weights).map(|_| ()).unwrap_err()
    };
    assert!(NurbsSurface::new(1, 1, k.clone(), k.clone(), &square, None).is_ok());
    assert!(matches!(new(&[], None), NurbsError::Knots { axis: 'u', .. }));
    assert!(matches!(new(&[vec![], vec![]], None), NurbsError::Knots { axis: 'v', .. }));
    let ragged = vec![square[0].clone(), vec![Point3::origin()]];
    assert!(matches!(
        new(&ragged, None),
        NurbsError::Row { what: "control points", row: 1, found: 1, expected: 2 }
    ));
    assert!(matches!(new(&square, Some(&[vec![1.0; 2]])), NurbsError::WeightRows { found: 1, expected: 2 }));
    assert!(matches!(
        new(&square, Some(&[vec![1.0; 2], vec![1.0; 3]])),
        NurbsError::Row { what: "weights", .. }
    ));
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e7] {
        let error = new(&square, Some(&[vec![1.0, 1.0], vec![1.0, bad]]));
        assert!(matches!(error, NurbsError::Weight { row: 1, column: 1, .. }));
    }
    for bad in [f64::NAN, f64::INFINITY, -2e6] {
        let mut points = square.clone();
        points[1][0].y = bad;
        let error = new(&points, None);
        assert!(matches!(error, NurbsError::Point { row: 1, column: 0, .. }));
        assert!(error.to_string().starts_with("control point [1][0] is (1, "));
    }
}
