use super::super::{AnalyticShape, AnalyticSurface, NurbsSurface, samples};
use super::*;
use approx::assert_relative_eq;

fn nurbs(s: &NurbsSurface, tolerance: f64) -> Tessellation {
    let lines = [s.knots_u().breaks(), s.knots_v().breaks()];
    tessellate(&|u, v| s.jet(u, v), [&lines[0], &lines[1]], tolerance).unwrap()
}

fn analytic(shape: AnalyticShape, domain: [[f64; 2]; 2], tolerance: f64) -> Tessellation {
    let s = AnalyticSurface::new(shape, domain).unwrap();
    tessellate(&|u, v| s.jet(u, v), [&domain[0], &domain[1]], tolerance).unwrap()
}

fn corners(t: &Tessellation, k: usize) -> [Point3; 3] {
    t.triangles[k].map(|i| t.vertices[i as usize])
}

/// Directed edges without a partner in the other direction, vertices told apart by coordinates.
fn open_edges(t: &Tessellation) -> usize {
    let key = |i: u32| t.vertices[i as usize].coords.map(f64::to_bits).data.0[0];
    let edges: std::collections::HashSet<_> =
        t.triangles.iter().map(|c| c.map(key)).flat_map(|[a, b, c]| [(a, b), (b, c), (c, a)]).collect();
    assert_eq!(edges.len(), 3 * t.triangles.len(), "an edge runs twice in one direction");
    edges.iter().filter(|&&(a, b)| !edges.contains(&(b, a))).count()
}

/// True distance of a dense set of points of all triangles from a surface given as a signed
/// distance.
fn worst(t: &Tessellation, distance: impl Fn(&Point3) -> f64) -> f64 {
    let mut worst: f64 = 0.0;
    for k in 0..t.triangles.len() {
        let [a, b, c] = corners(t, k);
        for i in 0..=8 {
            for j in 0..=8 - i {
                let (x, y) = (f64::from(i) / 8.0, f64::from(j) / 8.0);
                worst = worst.max(distance(&(a + (b - a) * x + (c - a) * y)).abs());
            }
        }
    }
    worst
}

#[test]
fn hemisphere_within_tolerance_without_slivers_at_the_pole() {
    let (centre, radius) = (Point3::new(1.0, 2.0, 3.0), 20.0);
    for tolerance in [0.1, 0.01] {
        let t = nurbs(&samples::hemisphere(centre, radius), tolerance);
        let true_worst = worst(&t, |p| (p - centre).norm() - radius);
        assert!(true_worst <= t.deviation && t.deviation <= tolerance, "{true_worst} {}", t.deviation);
        // Not wastefully fine either.
        assert!(t.deviation > 0.3 * tolerance);
        // Closed around the seam and at the pole: only the equator is open.
        // The seam's vertex is there twice.
        let on_equator = t.vertices.iter().filter(|p| (p.z - centre.z).abs() < 1e-9).count();
        assert_eq!(open_edges(&t), on_equator - 1);
        let area: f64 = (0..t.triangles.len())
            .map(|k| {
                let [a, b, c] = corners(&t, k);
                0.5 * (b - a).cross(&(c - a)).norm()
            })
            .sum();
        let exact = std::f64::consts::TAU * radius * radius;
        assert!(area < exact && area > exact * (1.0 - 4.0 * tolerance / radius));
    }
}

#[test]
fn parameters_give_the_vertices() {
    let s = samples::bicubic(&[1.0, 2.0, 0.5]);
    let t = nurbs(&s, 0.02);
    assert_eq!(t.parameters.len(), t.vertices.len());
    for (p, &[u, v]) in t.vertices.iter().zip(&t.parameters) {
        assert_relative_eq!(*p, s.point(u, v), epsilon = 1e-12);
    }
    for (k, triangle) in t.triangles.iter().enumerate() {
        let [a, b, c] = corners(&t, k);
        let q = triangle.map(|i| t.parameters[i as usize]);
        let [u, v] = [0, 1].map(|i| (q[0][i] + q[1][i] + q[2][i]) / 3.0);
        // Orientation is that of the surface.
        assert!((b - a).cross(&(c - a)).dot(&s.jet(u, v).normal().unwrap()) > 0.0);
    }
}

#[test]
fn shapes_hold_their_tolerance() {
    let square = [[-10.0, 30.0], [-20.0, 15.0]];
    let t = analytic(AnalyticShape::Plane { height: 2.0 }, square, 1e-6);
    assert_eq!((t.triangles.len(), t.vertices.len()), (2, 4));
    let t = analytic(AnalyticShape::Inclined { height: 0.0, angle: 0.6, azimuth: 1.0 }, square, 1e-6);
    assert!(t.triangles.len() == 2 && t.deviation < 1e-12);
    let cylinder = AnalyticShape::Cylinder { height: 0.0, radius: 25.0, azimuth: 0.0, concave: true };
    let t = analytic(cylinder, square, 0.002);
    let axis_distance = |p: &Point3| p.y.hypot(p.z - 25.0) - 25.0;
    assert!(worst(&t, axis_distance) <= 0.002 && t.triangles.len() < 4000);
    // Pure twist: no second derivative along either parameter.
    let saddle = AnalyticShape::Saddle { radius_concave: 20.0, radius_convex: 20.0 };
    let t = analytic(saddle, square, 0.01);
    let height = |p: &Point3| p.z - (p.x * p.x - p.y * p.y) / 40.0;
    // The height is more than the distance.
    assert!(worst(&t, height) <= 0.01 * 3.0 && t.deviation <= 0.01);
}

#[test]
fn waves_in_step_with_the_samples_are_seen() {
    // 64 strips over 64 mm, with wavelengths that repeat exactly from strip to strip and from line
    // to line.
    for wavelength in [1.0, 2.0, 4.0] {
        let shape = AnalyticShape::Wave { amplitude: 0.05, wavelength_x: wavelength, wavelength_y: None };
        let t = analytic(shape, [[0.0, 64.0], [0.0, 4.0]], 0.01);
        let k = std::f64::consts::TAU / wavelength;
        assert!(worst(&t, |p| p.z - 0.05 * (k * p.x).sin()) < 0.015);
    }
}

#[test]
fn curved_borders_of_flat_patches_are_followed() {
    // A flat half disc: no normal curvature at all, yet a chord of its border would cut material
    // off. Degree 2 around, 1 from the centre out.
    let arc = samples::half_cylinder(10.0, 1.0);
    let points: Vec<Vec<Point3>> = (0..5)
        .map(|i| {
            let (p, _) = arc.control_point(i, 0);
            vec![Point3::origin(), Point3::new(p.x, p.z, 0.0)]
        })
        .collect();
    let weights: Vec<Vec<f64>> = (0..5).map(|i| vec![arc.control_point(i, 0).1; 2]).collect();
    let disc = NurbsSurface::new(
        2,
        1,
        arc.knots_u().knots().to_vec(),
        arc.knots_v().knots().to_vec(),
        &points,
        Some(&weights),
    );
    let t = nurbs(&disc.unwrap(), 0.01);
    let area: f64 = (0..t.triangles.len())
        .map(|k| {
            let [a, b, c] = corners(&t, k);
            0.5 * (b - a).cross(&(c - a)).norm()
        })
        .sum();
    // A chord with sagitta 0.01 loses 2/3 of 0.01 times its length.
    let exact = 50.0 * std::f64::consts::PI;
    assert!(exact - area < 0.01 * 10.0 * std::f64::consts::PI, "{}", exact - area);
    assert!(t.vertices.iter().filter(|p| p.coords.norm() < 1e-9).all(|p| *p == t.vertices[0]));
    assert_eq!(t.vertices[0], Point3::origin());
}

#[test]
fn refuses_what_cannot_be_done() {
    let s = samples::bicubic(&[1.0]);
    let jet = |u: f64, v: f64| s.jet(u, v);
    let whole: &[f64] = &[0.0, 1.0];
    let run = |tolerance| tessellate(&jet, [whole, whole], tolerance).unwrap_err();
    assert!(matches!(run(0.0), TessellateError::Tolerance(_)));
    assert!(matches!(run(f64::NAN), TessellateError::Tolerance(_)));
    assert!(matches!(run(1e-9), TessellateError::TooMany { .. }));
    assert_eq!(tessellate(&jet, [&[0.0], whole], 0.1), Err(TessellateError::Domain));
    assert_eq!(tessellate(&jet, [&[0.0, f64::NAN], whole], 0.1), Err(TessellateError::Domain));
    let line = |u: f64, _: f64| {
        let zero = Vector3::zeros();
        Jet2 { p: Point3::new(u, u, u), du: Vector3::repeat(1.0), dv: zero, duu: zero, duv: zero, dvv: zero }
    };
    assert_eq!(tessellate(&line, [whole, whole], 0.1), Err(TessellateError::NoArea));
}

/// A flat patch, one of whose sides is a point: no second derivative says how dense its lines must be.
#[test]
fn a_flat_patch_with_three_sides_is_a_triangle() {
    let corners = [[0.0, 0.0, 0.0], [0.0, 20.0, 0.0], [30.0, 0.0, 5.0]].map(Point3::from);
    let jet = |u: f64, v: f64| {
        let [a, b, c] = corners;
        let (side, other) = (b - a, c - a);
        Jet2 {
            p: a + other * u + side * (1.0 - u) * v,
            du: other - side * v,
            dv: side * (1.0 - u),
            duu: Vector3::zeros(),
            duv: -side,
            dvv: Vector3::zeros(),
        }
    };
    let lines: [&[f64]; 2] = [&[0.0, 1.0], &[0.0, 1.0]];
    let found = tessellate(&jet, lines, 0.01).unwrap();
    assert_eq!(found.triangles.len(), 1);
    assert!(found.deviation < 1e-12, "{}", found.deviation);
    // Rounding alone is more than that.
    assert!(matches!(tessellate(&jet, lines, 1e-20), Err(TessellateError::TooMany { .. })));
}
