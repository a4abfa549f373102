use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

use super::*;

fn square(n: usize) -> FieldMesh {
    let (points, triangles) = grid(n, n, no_hole);
    FieldMesh::planar(&points, triangles).unwrap()
}

/// Lines at an angle given by a formula, each turned round at random: the same line.
fn wanted(mesh: &FieldMesh, angle: impl Fn(&Point3) -> f64) -> Vec<Wanted> {
    let line = |(k, p): (usize, &Point3)| {
        let (sin, cos) = angle(p).sin_cos();
        let sign = if (k * 7919) % 3 == 0 { -1.0 } else { 1.0 };
        Some((Vector3::new(cos, sin, 0.0) * sign, 1.0))
    };
    mesh.points().iter().enumerate().map(line).collect()
}

/// Angle between two lines, rad.
fn between(a: &Vector3, b: &Vector3) -> f64 {
    a.cross(b).norm().atan2(a.dot(b).abs())
}

#[test]
fn a_constant_field_survives_any_smoothing_and_is_oriented() {
    let mesh = square(15);
    for length in [0.0, 0.1, 10.0] {
        let mut lines = smooth_lines(&mesh, &wanted(&mesh, |_| 0.7), &[], length).unwrap();
        assert!(orient_lines(&mesh, &mut lines).is_empty());
        let first = lines[0].direction;
        assert!(between(&first, &Vector3::new(0.7f64.cos(), 0.7f64.sin(), 0.0)) < 1e-9);
        assert!(
            lines.iter().all(|l| (l.direction - first).norm() < 1e-9 && (l.agreement - 1.0).abs() < 1e-9)
        );
        assert!(singular_points(&mesh, &lines, 0.1).is_empty());
    }
}

/// Lines held on two opposite sides of a strip turn evenly between them: θ is harmonic.
#[test]
fn held_lines_spread_harmonically() {
    let mesh = square(24);
    let hard: Vec<(u32, Vector3)> = (0..mesh.points().len())
        .filter(|&v| mesh.points()[v].x == 0.0 || mesh.points()[v].x == 1.0)
        .map(|v| {
            let angle = 0.9 * mesh.points()[v].x;
            (v as u32, Vector3::new(angle.cos(), angle.sin(), 0.0))
        })
        .collect();
    let none = vec![None; mesh.points().len()];
    let lines = smooth_lines(&mesh, &none, &hard, 1.0).unwrap();
    for (line, p) in lines.iter().zip(mesh.points()) {
        // |z| sags between the two, sin(1.8 x) and cos(1.8 x) being replaced by straight lines.
        let (a, b) = (1.0 - p.x, p.x);
        let exact = 0.5 * (b * 1.8f64.sin()).atan2(a + b * 1.8f64.cos());
        assert!(between(&line.direction, &Vector3::new(exact.cos(), exact.sin(), 0.0)) < 0.02);
    }
    let error = smooth_lines(&mesh, &none, &[], 1.0).unwrap_err();
    assert!(matches!(error, MeshFieldError::Undetermined { .. }), "{error}");
    assert!(smooth_lines(&mesh, &none, &[(0, Vector3::z())], 1.0).is_err());
    assert!(smooth_lines(&mesh, &none, &hard, f64::NAN).is_err());
}

#[test]
fn singular_points_have_their_place_and_index() {
    let mesh = square(31);
    let centre = [0.513, 0.488];
    let around = |p: &Point3| (p.y - centre[1]).atan2(p.x - centre[0]);
    for half_turns in [1, 2, -1, -2, 3] {
        let lines = wanted(&mesh, |p| 0.5 * f64::from(half_turns) * around(p) + 0.3);
        let mut lines = smooth_lines(&mesh, &lines, &[], 0.0).unwrap();
        let found = singular_points(&mesh, &lines, 0.15);
        assert_eq!(found.len(), 1, "{half_turns}: {found:?}");
        assert_eq!(found[0].half_turns, half_turns);
        let off = (found[0].position - Point3::new(centre[0], centre[1], 0.0)).norm();
        assert!(off < 0.1, "{half_turns}: {off}");
        // Only halves have a cut, and it runs from the point to the border; a whole turn leaves no more
        // than the edges across the point itself.
        let cut = orient_lines(&mesh, &mut lines).len();
        assert!(if half_turns % 2 == 0 { cut <= 3 } else { cut >= 10 }, "{half_turns}: {cut}");
    }
}

/// On a closed sphere the indices of any field add up to 2 (Poincaré and Hopf): meridians have one at
/// each pole, whatever the frames do.
#[test]
fn indices_on_a_sphere_add_up_to_two() {
    // A cube's faces cut into squares and blown up.
    let n = 8;
    let mut points: Vec<[i32; 3]> = Vec::new();
    let mut triangles = Vec::new();
    let mut number = |p: [i32; 3]| {
        points.iter().position(|q| *q == p).unwrap_or_else(|| {
            points.push(p);
            points.len() - 1
        }) as u32
    };
    for (axis, side) in (0..3).flat_map(|a| [(a, -1), (a, 1)]) {
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let mut at = |i: i32, j: i32| {
                let mut p = [side * n; 3];
                (p[(axis + 1) % 3], p[(axis + 2) % 3]) = (2 * i - n, 2 * j - n);
                number(p)
            };
            let q = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            let [a, b, c, d] = if side > 0 { q } else { [q[3], q[2], q[1], q[0]] };
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    let onto = |p: &[i32; 3]| Point3::from(Vector3::from(p.map(f64::from)).normalize());
    let mesh = FieldMesh::new(points.iter().map(onto).collect(), triangles, None).unwrap();
    assert!(mesh.loops().is_empty());
    let north = Vector3::new(0.31, 0.55, 0.77);
    let meridian = |n: &Vector3| Some((north - n * n.dot(&north), 1.0));
    for length in [0.0, 0.2] {
        let wanted: Vec<Wanted> = mesh.normals().iter().map(meridian).collect();
        let lines = smooth_lines(&mesh, &wanted, &[], length).unwrap();
        let found = singular_points(&mesh, &lines, 0.5);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found.iter().all(|s| s.half_turns == 2 && between(&s.position.coords, &north) < 0.3));
    }
}

#[test]
fn borders_guides_slopes_and_blends_give_their_directions() {
    let mesh = mapped(16, no_hole, |u, v| [u, v, 0.5 * u]);
    // The plane rises along x.
    let up = Vector3::new(1.0, 0.0, 0.5).normalize();
    let check = |wanted: &[Wanted], exact: &Vector3| {
        assert!(wanted.iter().all(|w| between(&w.unwrap().0, exact) < 1e-9));
    };
    check(&slope(&mesh, true), &up);
    check(&slope(&mesh, false), &Vector3::y());
    assert!(slope(&mesh, true).iter().all(|w| w.unwrap().0.z > 0.0), "ascent, not descent");
    check(&fixed_angle(&mesh, FRAC_PI_2), &Vector3::y());
    let along = fixed_angle(&mesh, 0.4);
    assert!(along.iter().all(|w| {
        let t = w.unwrap().0;
        (t.y.atan2(t.x) - 0.4).abs() < 1e-9
    }));
    // Equal shares of two directions square to each other cancel; unequal ones leave the stronger.
    let (x, y) = (fixed_angle(&mesh, 0.0), fixed_angle(&mesh, FRAC_PI_2));
    check(&blend(&mesh, &[(&x, 2.0), (&y, 1.0)]).unwrap(), &up);
    assert!(blend(&mesh, &[(&x, 1.0), (&y[1..], 1.0)]).is_err());
    let side = borders(&mesh, Sense::Along);
    let is_border = |v: usize| mesh.loops().iter().flatten().any(|&b| b as usize == v);
    let (mut on, mut corners) = (0, 0);
    for (v, p) in mesh.points().iter().enumerate() {
        match side[v] {
            Some((t, _)) => {
                let [beside, across] = [p.x, p.y].map(|c| c == 0.0 || c == 1.0);
                let exact = if beside { Vector3::y() } else { up };
                // Halfway between its two sides at a corner.
                let turned = if beside && across { FRAC_PI_4 } else { 0.0 };
                assert!((between(&t, &exact) - turned).abs() < 1e-9 && is_border(v));
                (on, corners) = (on + 1, corners + usize::from(beside && across));
            }
            None => assert!(!is_border(v)),
        }
    }
    assert_eq!((on, corners), (4 * 16, 4));
    let curve = vec![Point2::new(0.2, -1.0), Point2::new(0.2, 2.0)];
    for (sense, exact) in [(Sense::Along, Vector3::y()), (Sense::Across, up)] {
        let near = guides(&mesh, std::slice::from_ref(&curve), 0.1, sense);
        let found = near.iter().zip(mesh.points()).filter(|(w, _)| w.is_some());
        assert!(found.clone().count() > 20);
        assert!(
            found.clone().all(|(w, p)| (p.x - 0.2).abs() <= 0.1 && between(&w.unwrap().0, &exact) < 1e-9)
        );
    }
}

/// From border directions to passes: around a ring, along its borders, the level curves are circles.
#[test]
fn along_the_borders_of_a_ring_passes_are_circles() {
    let n = 40;
    let points: Vec<[f64; 2]> = (0..=n / 4)
        .flat_map(|j| {
            (0..n).map(move |i| {
                let (r, a) = (1.0 + j as f64 / (n / 4) as f64, TAU * i as f64 / n as f64);
                [r * a.cos(), r * a.sin()]
            })
        })
        .collect();
    let at = |i: usize, j: usize| (j * n + i % n) as u32;
    let triangles = (0..n / 4)
        .flat_map(|j| (0..n).map(move |i| (i, j)))
        .flat_map(|(i, j)| {
            [[at(i, j), at(i, j + 1), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i + 1, j)]]
        })
        .collect();
    let mesh = FieldMesh::planar(&points, triangles).unwrap();
    assert_eq!(mesh.loops().len(), 2);
    let side = borders(&mesh, Sense::Along);
    let hard: Vec<(u32, Vector3)> =
        side.iter().enumerate().filter_map(|(v, w)| Some((v as u32, (*w)?.0))).collect();
    let mut lines = smooth_lines(&mesh, &side, &hard, 1.0).unwrap();
    assert!(orient_lines(&mesh, &mut lines).is_empty());
    let ones = vec![1.0; mesh.points().len()];
    let stream = solve_stream(&mesh, &flows(&mesh, &lines, &ones, &ones), 0.3, &Held::default()).unwrap();
    assert!(stream.angle_rms < 0.04, "{}", stream.angle_rms);
    let levels = MeshLevels::new(&mesh, &stream.values).unwrap();
    let [lo, hi] = levels.range();
    assert!(((hi - lo) - 1.0).abs() < 0.01);
    for share in [0.2, 0.5, 0.9] {
        let curves = levels.curves(lo + share * (hi - lo));
        assert_eq!(curves.len(), 1);
        assert!(curves[0].closed);
        let radii = curves[0].points.iter().map(|p| p.position.coords.norm());
        let (least, greatest) = radii.fold((f64::MAX, f64::MIN), |(a, b), r| (a.min(r), b.max(r)));
        assert!(greatest - least < 0.01, "{least} {greatest}");
    }
}
