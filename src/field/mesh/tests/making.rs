use super::*;

fn refined(mesh: &FieldMesh, length: f64) -> Refined {
    let sheets = Sheets::of(mesh, 1.0);
    let mut refined =
        Refined { points: mesh.points().to_vec(), triangles: mesh.triangles().to_vec(), sheets };
    refined.refine(length).unwrap();
    refined
}

fn area(mesh: &FieldMesh) -> f64 {
    (0..mesh.triangles().len()).map(|t| mesh.area(t)).sum()
}

/// A plate and a wall that falls away from it, a long triangle or two each.
fn folded() -> FieldMesh {
    let points = [
        [0.0, 0.0, 0.0],
        [10.0, 0.0, 0.0],
        [10.0, 2.0, 0.0],
        [0.0, 2.0, 0.0],
        [10.0, 3.0, -4.0],
        [0.0, 3.0, -4.0],
    ];
    let triangles = vec![[0, 1, 2], [0, 2, 3], [3, 2, 4], [3, 4, 5]];
    FieldMesh::new(points.map(Point3::from).to_vec(), triangles, None).unwrap()
}

#[test]
fn refining_bounds_edges_keeps_the_surface_and_mends_slivers() {
    let coarse = folded();
    let made = refined(&coarse, 0.7);
    let fine = FieldMesh::new(made.points.clone(), made.triangles.clone(), None).unwrap();
    assert!((area(&fine) - area(&coarse)).abs() < 1e-9);
    assert_eq!(fine.loops().len(), 1);
    for [a, b] in fine.edges() {
        assert!((fine.points()[a as usize] - fine.points()[b as usize]).norm() <= 0.7 + 1e-9);
    }
    for p in fine.points() {
        let on_plate = p.z.abs() < 1e-12 && p.y <= 2.0 + 1e-12;
        let on_wall = (p.z + 4.0 * (p.y - 2.0)).abs() < 1e-12;
        assert!(on_plate || on_wall, "{p}");
    }
    // Long triangles become well-shaped ones: area over longest side squared, as a share of the
    // best there is; halves of squares have 0.58, the first triangles 0.22.
    let shape = |t: usize| {
        let [a, b, c] = fine.corners(t);
        let longest = (a - b).norm_squared().max((b - c).norm_squared()).max((c - a).norm_squared());
        4.0 / 3f64.sqrt() * fine.area(t) / longest
    };
    let mean = (0..fine.triangles().len()).map(shape).sum::<f64>() / fine.triangles().len() as f64;
    assert!(mean > 0.45, "{mean}");
    assert!(refined(&coarse, 100.0).triangles.len() == 4, "nothing to do");
    let mut endless = made.clone();
    assert!(endless.refine(1e-4).is_err(), "too many triangles");
}

#[test]
fn creases_part_the_sheets_and_stand_out_or_in() {
    let made = refined(&folded(), 0.5);
    let creases = made.creases(0.0);
    let length: f64 =
        creases.iter().map(|([a, b], _)| (made.points[*a as usize] - made.points[*b as usize]).norm()).sum();
    assert!((length - 10.0).abs() < 1e-9, "{length}");
    assert!(creases.iter().all(|(edge, out)| *out && edge.iter().all(|&v| made.points[v as usize].y == 2.0)));
    assert!(made.creases(10.0).is_empty(), "no triangle is that high");
    let (normals, bends) = made.at_points();
    assert!(bends.iter().all(|b| b.0.iter().all(|x| x.abs() < 1e-9)), "two flat sheets");
    let wall = Vector3::new(0.0, 4.0, 1.0).normalize();
    for (corners, normals) in made.triangles.iter().zip(made.corner_normals(&normals, &creases)) {
        let low = corners.iter().any(|&v| made.points[v as usize].y > 2.0);
        let own = if low { wall } else { Vector3::z() };
        assert!(normals.iter().all(|n| (n - own).norm() < 1e-9));
    }
    // On the crease itself the mean normal stands between the two.
    let on = creases[3].0[0] as usize;
    assert!(normals[on].dot(&wall) < 0.99 && normals[on].z < 0.99);
}

/// Curvature of facets of a cylinder and a sphere, at the corners and at the middles put in between.
#[test]
fn curvature_is_that_of_the_surface_behind_the_facets() {
    let radius = 8.0;
    let angle = 0.8;
    let cylinder = mapped(20, no_hole, |u, v| {
        let a = angle * (u - 0.5);
        [radius * a.sin(), 6.0 * v, radius * a.cos()]
    });
    let made = refined(&cylinder, 0.25);
    let (normals, bends) = made.at_points();
    for (v, p) in made.points.iter().enumerate() {
        // Clear of the border, where quadratics see one side only.
        if p.x.abs() < 2.0 && (1.0..5.0).contains(&p.y) {
            let out = Vector3::new(p.x, 0.0, p.z).normalize();
            assert!(normals[v].cross(&out).norm() < 0.02, "{}", normals[v].cross(&out).norm());
            let around = Vector3::y().cross(&out);
            assert!((bends[v].along(&around) * radius + 1.0).abs() < 0.1, "{}", bends[v].along(&around));
            assert!(bends[v].along(&Vector3::y()).abs() * radius < 0.1);
        }
    }
    let bowl = mapped(24, no_hole, |u, v| {
        let (x, y) = (4.0 * (u - 0.5), 4.0 * (v - 0.5));
        [x, y, radius - (radius * radius - x * x - y * y).sqrt()]
    });
    let sheets = Sheets::of(&bowl, 1.0);
    for (t, wedges) in sheets.corners.iter().enumerate() {
        for (k, &wedge) in wedges.iter().enumerate() {
            let p = bowl.corners(t)[k];
            if p.x.hypot(p.y) < 1.4 {
                let bend = &sheets.bends[wedge as usize];
                assert!((bend.along(&Vector3::x()) * radius - 1.0).abs() < 0.15, "concave is positive");
            }
        }
    }
}

#[test]
fn principal_directions_are_those_of_the_form() {
    let (e1, e2) = (Vector3::new(0.6, 0.8, 0.0), Vector3::new(-0.8, 0.6, 0.0));
    let bend = Bend::new(&e1, &e2, [-0.5, 0.0, 0.25]);
    let (least, greatest, tangent) = bend.principal([Vector3::x(), Vector3::y()]);
    assert!((least + 0.5).abs() < 1e-12 && (greatest - 0.25).abs() < 1e-12);
    assert!(tangent.cross(&e1).norm() < 1e-12);
    assert!((bend.along(&e1) + 0.5).abs() < 1e-12 && (bend.along(&e2) - 0.25).abs() < 1e-12);
}

/// Two sheets with different numbers of vertices along a curved common border, a little apart.
#[test]
fn sheets_cut_differently_are_sewn_without_gaps() {
    let gap = 1e-3;
    let sheet = |nx: usize, ny: usize, x0: f64, shift: f64| {
        let (points, triangles) = grid(nx, ny, no_hole);
        let bulge = |y: f64| 0.2 * (2.0 * y).sin();
        let place = |p: &[f64; 2]| Point3::new(x0 + p[0] + bulge(p[1]) + shift, p[1], 0.1 * p[1] * p[1]);
        (points.iter().map(place).collect::<Vec<_>>(), triangles)
    };
    // Up to two, and five, vertices on each side of the coarser one.
    for ny in [43, 151] {
        let (mut points, mut triangles) = sheet(6, 30, 0.0, 0.0);
        let (others, their) = sheet(5, ny, 1.0, 0.3 * gap);
        let apart = points.len() as u32;
        points.extend(others);
        triangles.extend(their.iter().map(|t| t.map(|v| v + apart)));
        let loose = FieldMesh::new(points.clone(), triangles.clone(), None).unwrap();
        assert_eq!((loose.loops().len(), loose.pieces().1), (2, 2));
        let (points, triangles) = weld(&points, &triangles, gap);
        let sewn = FieldMesh::new(points, triangles, None).unwrap();
        assert_eq!((sewn.loops().len(), sewn.pieces().1), (1, 1));
        assert!((area(&sewn) - area(&loose)).abs() < 1e-3);
        assert!((0..sewn.triangles().len()).all(|t| sewn.area_vector(t).z > 0.0), "none is turned over");
        // Too small a distance leaves them apart.
        let again = weld(loose.points(), loose.triangles(), 1e-6);
        assert_eq!(FieldMesh::new(again.0, again.1, None).unwrap().pieces().1, 2);
    }
}

#[test]
fn borders_are_loops_with_the_surface_on_their_left() {
    let (points, triangles) = grid(20, 20, hole);
    let mesh = FieldMesh::planar(&points, triangles).unwrap();
    let signed: Vec<f64> = mesh
        .loops()
        .iter()
        .map(|ring| {
            let p = |k: usize| mesh.points()[ring[k % ring.len()] as usize];
            (0..ring.len()).map(|k| 0.5 * (p(k).x * p(k + 1).y - p(k).y * p(k + 1).x)).sum()
        })
        .collect();
    assert_eq!(signed.len(), 2);
    assert!((signed.iter().cloned().fold(f64::MIN, f64::max) - 1.0).abs() < 1e-12);
    assert!(signed.iter().any(|a| *a < -0.1), "the hole goes round the other way");
    assert!((signed.iter().sum::<f64>() - area(&mesh)).abs() < 1e-12);
}
