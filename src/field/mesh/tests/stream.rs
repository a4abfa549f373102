use super::*;

/// A known stream function on a surface that is the image of the unit square.
struct Known {
    name: &'static str,
    map: fn(f64, f64) -> [f64; 3],
    psi: fn(&Point3) -> f64,
    gradient: fn(&Point3) -> Vector3,
}

const RADIUS: f64 = 2.0;
/// Tangent of the cone's half angle.
const CONE: f64 = 0.75;

/// Angle and distance from the apex on the cone laid flat: cos of the slope is 4/5.
fn unrolled(p: &Point3) -> (f64, f64, Vector3, Vector3) {
    let around = p.y.atan2(p.x);
    let distance = p.coords.norm();
    let across = Vector3::new(-around.sin(), around.cos(), 0.0);
    (0.6 * around, distance, across, p.coords / distance)
}

fn known() -> Vec<Known> {
    let square = |u: f64, v: f64| [u + 0.5, v + 0.4, 0.0];
    let cylinder = |u: f64, v: f64| [RADIUS * (1.8 * u - 0.9).sin(), 3.0 * v, RADIUS * (1.8 * u - 0.9).cos()];
    vec![
        Known {
            name: "rotation",
            map: square,
            psi: |p| -0.5 * (p.x * p.x + p.y * p.y),
            gradient: |p| Vector3::new(-p.x, -p.y, 0.0),
        },
        Known { name: "saddle", map: square, psi: |p| p.x * p.y, gradient: |p| Vector3::new(p.y, p.x, 0.0) },
        Known {
            name: "radial",
            map: square,
            psi: |p| p.y.atan2(p.x),
            gradient: |p| Vector3::new(-p.y, p.x, 0.0) / (p.x * p.x + p.y * p.y),
        },
        Known {
            name: "cylinder, saddle on the unrolled sheet",
            map: cylinder,
            psi: |p| RADIUS * p.x.atan2(p.z) * (p.y + 1.0),
            gradient: |p| {
                let s = RADIUS * p.x.atan2(p.z);
                Vector3::new(p.z, 0.0, -p.x) / RADIUS * (p.y + 1.0) + Vector3::y() * s
            },
        },
        Known {
            name: "cone, circles around a point beside the apex of the sheet laid flat",
            map: |u, v| {
                let (height, around) = (1.0 + v, 1.5 * u);
                [CONE * height * around.cos(), CONE * height * around.sin(), height]
            },
            psi: |p| {
                let (angle, r, ..) = unrolled(p);
                0.5 * ((r * angle.cos() + 1.0).powi(2) + (r * angle.sin()).powi(2))
            },
            gradient: |p| {
                let (angle, r, around, out) = unrolled(p);
                // In the sheet laid flat: (x + 1, y).
                let (x, y) = (r * angle.cos() + 1.0, r * angle.sin());
                out * (x * angle.cos() + y * angle.sin()) + around * (y * angle.cos() - x * angle.sin())
            },
        },
        Known {
            name: "sphere, distance from the pole",
            map: |u, v| {
                let (polar, around) = (0.3 + 0.9 * v, -1.2 * u);
                [polar.sin() * around.cos(), polar.sin() * around.sin(), polar.cos()].map(|c| RADIUS * c)
            },
            psi: |p| RADIUS * p.x.hypot(p.y).atan2(p.z),
            gradient: |p| {
                let r = p.x.hypot(p.y);
                Vector3::new(p.z * p.x / r, p.z * p.y / r, -r) / p.coords.norm()
            },
        },
    ]
}

fn solved(mesh: &FieldMesh, gradient: fn(&Point3) -> Vector3) -> MeshStream {
    solve_stream(mesh, &flows_of(mesh, gradient), 0.3, &Held::default()).unwrap()
}

/// Edges a quarter as long leave a sixteenth of the error, within what random meshes scatter.
#[test]
fn known_fields_converge_with_order_two() {
    for Known { name, map, psi, gradient } in known() {
        for hole in [no_hole, hole] {
            let error = |n: usize| {
                let mesh = mapped(n, hole, map);
                let stream = solved(&mesh, gradient);
                assert!(stream.residual < 1e-10);
                difference(&mesh, &stream.values, psi)
            };
            let (coarse, fine) = (error(12), error(48));
            let order = (coarse / fine).log2() / 2.0;
            println!("{name}: {coarse:.2e} {fine:.2e}, order {order:.2}");
            assert!(order > 1.8, "{name}: {coarse:.2e} {fine:.2e}, order {order:.2}");
            assert!(fine < 2e-3, "{name}: {fine}");
        }
    }
}

#[test]
fn linear_functions_are_exact_and_their_feed_is_followed() {
    let (points, triangles) = grid(9, 7, hole);
    let mesh = FieldMesh::planar(&points, triangles).unwrap();
    let stream = solved(&mesh, |_| Vector3::new(0.6, -0.8, 0.0));
    assert!(difference(&mesh, &stream.values, |p| 0.6 * p.x - 0.8 * p.y) < 1e-12);
    assert!(stream.angle_rms < 1e-10);
    assert_eq!(mesh.loops().len(), 2);
    for (g, n) in
        triangle_gradients(&mesh, &stream.values).iter().zip(vertex_gradients(&mesh, &stream.values))
    {
        assert!((g - Vector3::new(0.6, -0.8, 0.0)).norm() < 1e-11 && (g - n).norm() < 1e-10);
    }
}

/// Laplace's equation (density and direction weighted alike, nothing asked) between held borders.
#[test]
fn held_vertices_keep_their_values_and_the_rest_is_harmonic() {
    let error = |n: usize| {
        // A ring sector between the radii 1 and 2.
        let mesh = mapped(n, no_hole, |u, v| {
            let (r, a) = (1.0 + u, 1.5 * v);
            [r * a.cos(), r * a.sin(), 0.0]
        });
        let radius = |v: usize| mesh.points()[v].coords.norm();
        let fixed: Vec<(u32, f64)> = (0..mesh.points().len())
            .filter(|&v| (radius(v) - 1.0).abs() < 1e-9 || (radius(v) - 2.0).abs() < 1e-9)
            .map(|v| (v as u32, if radius(v) < 1.5 { 3.0 } else { 5.0 }))
            .collect();
        let flow = Flow { along: Vector3::x(), density: 0.0, weight: 1.0 };
        let flows = vec![flow; mesh.triangles().len()];
        let stream = solve_stream(&mesh, &flows, 1.0, &Held { fixed: &fixed, tied: &[] }).unwrap();
        assert!(fixed.iter().all(|&(v, value)| stream.values[v as usize] == value));
        difference(&mesh, &stream.values, |p| 3.0 + 2.0 * p.coords.norm().ln() / 2f64.ln())
    };
    let (coarse, fine) = (error(10), error(40));
    assert!((coarse / fine).log2() / 2.0 > 1.7, "{coarse:.2e} {fine:.2e}");
}

/// A wall whose value is not known, only that it is one: with the density of ψ = y the wall in the
/// middle of a region symmetric about it takes the value of its own height.
#[test]
fn tied_vertices_share_a_value_that_is_found() {
    let n = 20;
    let points: Vec<[f64; 2]> = (0..=n * (n + 2))
        .take((n + 1) * (n + 1))
        .map(|k| [(k % (n + 1)) as f64, (k / (n + 1)) as f64])
        .collect();
    let at = |i: usize, j: usize| (j * (n + 1) + i) as u32;
    let mut triangles = Vec::new();
    for (i, j) in (0..n).flat_map(|j| (0..n).map(move |i| (i, j))) {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        // Cut so that the mesh is symmetric about its middle.
        if (i < n / 2) == (j < n / 2) {
            triangles.extend([[a, b, c], [a, c, d]]);
        } else {
            triangles.extend([[a, b, d], [b, c, d]]);
        }
    }
    let mesh = FieldMesh::planar(&points, triangles).unwrap();
    let row = |j: usize| -> Vec<(u32, f64)> { (0..=n).map(|i| (at(i, j), j as f64)).collect() };
    let fixed: Vec<(u32, f64)> = row(0).into_iter().chain(row(n)).collect();
    let wall: Vec<u32> = (8..=12).flat_map(|i| [at(i, 9), at(i, 10), at(i, 11)]).collect();
    let flows = vec![Flow { along: Vector3::x(), density: 1.0, weight: 1.0 }; mesh.triangles().len()];
    let stream =
        solve_stream(&mesh, &flows, 1.0, &Held { fixed: &fixed, tied: std::slice::from_ref(&wall) }).unwrap();
    for &v in &wall {
        assert!((stream.values[v as usize] - 10.0).abs() < 1e-9, "{}", stream.values[v as usize]);
    }
    assert!((stream.values[at(10, 8) as usize] - 8.0).abs() > 0.1, "the flow gives way to the wall");
}

#[test]
fn what_cannot_be_solved_is_told() {
    let (points, triangles) = grid(4, 4, no_hole);
    let mesh = FieldMesh::planar(&points, triangles.clone()).unwrap();
    let flow = Flow { along: Vector3::x(), density: 1.0, weight: 1.0 };
    let solve_with = |flow: Flow, held: &Held| {
        solve_stream(&mesh, &vec![flow; mesh.triangles().len()], 0.3, held).map_err(|e| e.to_string())
    };
    let none = Held::default();
    for bad in [
        Flow { along: Vector3::z(), ..flow },
        Flow { along: Vector3::zeros(), ..flow },
        Flow { density: f64::NAN, ..flow },
        Flow { weight: 0.0, ..flow },
        Flow { weight: f64::INFINITY, ..flow },
    ] {
        assert!(solve_with(bad, &none).unwrap_err().contains("cannot be used"));
    }
    let twice = Held { fixed: &[(3, 1.0), (3, 2.0)], tied: &[] };
    assert!(solve_with(flow, &twice).unwrap_err().contains("contradicts"));
    assert!(solve_with(flow, &Held { fixed: &[(99, 1.0)], tied: &[] }).unwrap_err().contains("only 25"));
    let tied = [vec![1, 2], vec![2, 3]];
    assert!(solve_with(flow, &Held { fixed: &[], tied: &tied }).unwrap_err().contains("tied twice"));
    assert!(solve_stream(&mesh, &[flow], 0.3, &none).is_err());
    // A mesh in two pieces: each has its own constant.
    let mut apart = points.clone();
    apart.extend(points.iter().map(|p| [p[0] + 5.0, p[1]]));
    let mut both = triangles.clone();
    both.extend(triangles.iter().map(|t| t.map(|v| v + 25)));
    let two = FieldMesh::planar(&apart, both).unwrap();
    assert_eq!(two.pieces().1, 2);
    assert!(solve_stream(&two, &vec![flow; two.triangles().len()], 0.3, &none).is_ok());
    assert!(FieldMesh::planar(&points, vec![[0, 5, 1]]).is_err(), "clockwise");
    assert!(FieldMesh::planar(&[[0.0, 0.0], [1.0, 0.0], [f64::NAN, 1.0]], vec![[0, 1, 2]]).is_err());
    assert!(FieldMesh::planar(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]], vec![[0, 1, 2]]).is_err());
}

#[test]
fn level_curves_close_keep_to_their_level_and_are_all_found() {
    let error = |n: usize| {
        let (points, triangles) = grid(n, n, no_hole);
        let mesh = FieldMesh::planar(&points, triangles).unwrap();
        let off = |p: &Point3| [p.x - 0.5, p.y - 0.5];
        let values: Vec<f64> = mesh.points().iter().map(|p| off(p)[0].powi(2) + off(p)[1].powi(2)).collect();
        let levels = MeshLevels::new(&mesh, &values).unwrap();
        let curves = levels.curves(0.09);
        assert_eq!(curves.len(), 1);
        assert!(curves[0].closed);
        assert!(
            (curves[0].length() / (0.6 * std::f64::consts::PI) - 1.0).abs() < 0.5 / (n * n) as f64 * 10.0
        );
        // Higher values lie outside: clockwise.
        let area: f64 = (0..curves[0].points.len())
            .map(|k| {
                let next = &curves[0].points[(k + 1) % curves[0].points.len()];
                off(&curves[0].points[k].position)[0] * off(&next.position)[1]
                    - off(&curves[0].points[k].position)[1] * off(&next.position)[0]
            })
            .sum();
        assert!(area < 0.0);
        // A level that leaves the square: four arcs.
        let arcs = levels.curves(0.36);
        assert_eq!(arcs.len(), 4);
        assert!(arcs.iter().all(|c| !c.closed && c.points.len() > 2));
        assert!(levels.curves(1.0).is_empty() && levels.curves(f64::NAN).is_empty());
        // Neighbouring points share the triangle that the first one names.
        for pair in curves[0].points.windows(2) {
            let corners = mesh.corners(pair[0].triangle as usize);
            let placed: Vector3 = (0..3).map(|k| corners[k].coords * pair[0].weights[k]).sum();
            assert!((placed - pair[0].position.coords).norm() < 1e-12);
            let hats = mesh.hat_gradients(pair[0].triangle as usize);
            let inside = |k: usize| hats[k].dot(&(pair[1].position - corners[k])) + 1.0;
            assert!((0..3).all(|k| inside(k) > -1e-9));
        }
        let radius = |p: &MeshPoint| off(&p.position)[0].hypot(off(&p.position)[1]);
        curves[0].points.iter().map(|p| (radius(p) - 0.3).abs()).fold(0.0, f64::max)
    };
    // The gradients of a quadratic are recovered exactly: no wiggle is left at the crossings.
    assert!(error(10) < 1e-9 && error(23) < 1e-9, "{} {}", error(10), error(23));
}
