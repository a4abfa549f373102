//! Traced streamlines beside known ones, and beside the levels of stream functions.

use super::*;

/// The point of a mesh nearest to a place, by the triangle whose middle is nearest.
fn seed(mesh: &FieldMesh, at: [f64; 2]) -> MeshPoint {
    let away = |t: &usize| (centroid(mesh, *t).xy() - Point2::new(at[0], at[1])).norm();
    let t = (0..mesh.triangles().len()).min_by(|a, b| away(a).total_cmp(&away(b))).unwrap();
    MeshPoint { triangle: t as u32, weights: [1.0 / 3.0; 3], position: centroid(mesh, t) }
}

/// A cap of a sphere of radius 1.2 over the unit square.
fn cap(n: usize) -> FieldMesh {
    mapped(n, no_hole, |x, y| {
        let (x, y) = (x - 0.5, y - 0.5);
        [x, y, (1.44 - x * x - y * y).sqrt()]
    })
}

/// Parallels of a sphere close, and keep their radius the better the finer the mesh.
#[test]
fn parallels_of_a_sphere_close() {
    let worst = |n: usize| {
        let mesh = cap(n);
        let lines: Vec<Vector3> = mesh.points().iter().map(|p| Vector3::new(-p.y, p.x, 0.0)).collect();
        let tracer = MeshTracer::new(&mesh, &lines).unwrap();
        let start = seed(&mesh, [0.3, 0.0]);
        let radius = start.position.xy().coords.norm();
        let line = tracer.through(start, 0.02, 10.0);
        assert!(line.closed, "{n}: {} points", line.points.len());
        assert!((line.points.len() as f64 * 0.02 / (std::f64::consts::TAU * radius) - 1.0).abs() < 0.03);
        // Each side of its polygon with all crossings lies in the triangle that it begins in.
        let over = tracer.over_triangles(&line);
        assert!(over.len() > line.points.len());
        for w in over.windows(2) {
            let (corners, hats) =
                (mesh.corners(w[0].triangle as usize), mesh.hat_gradients(w[0].triangle as usize));
            let least = (0..3).map(|k| 1.0 + hats[k].dot(&(w[1].position - corners[k])));
            assert!(least.fold(1.0, f64::min) > -1e-3, "{w:?}");
        }
        line.points.iter().map(|p| (p.position.xy().coords.norm() - radius).abs()).fold(0.0, f64::max)
    };
    let (coarse, fine) = (worst(10), worst(40));
    assert!(fine < 1e-3 && coarse / fine > 6.0, "{coarse} {fine}");
}

/// Lines whose senses are mixed at random, hyperbolas around a saddle, end at the border and keep x y.
#[test]
fn senses_do_not_matter_and_lines_end_at_borders() {
    let mesh = mapped(40, no_hole, |x, y| [x, y, 0.0]);
    let sense = |v: usize| if (v * 7919).is_multiple_of(3) { -1.0 } else { 1.0 };
    let lines: Vec<Vector3> =
        mesh.points().iter().enumerate().map(|(v, p)| Vector3::new(p.x, -p.y, 0.0) * sense(v)).collect();
    let line = MeshTracer::new(&mesh, &lines).unwrap().through(seed(&mesh, [0.5, 0.4]), 0.01, 10.0);
    let product = |p: &MeshPoint| p.position.x * p.position.y;
    let held = product(&line.points[line.points.len() / 2]);
    assert!(!line.closed);
    for end in [line.points[0], line.points[line.points.len() - 1]] {
        assert!((end.position.x.max(end.position.y) - 1.0).abs() < 1e-9, "{end:?}");
    }
    let worst = line.points.iter().map(|p| (product(p) - held).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-4, "{worst}");
}

/// The flow around a hole that nothing forces: ψ of elements with one value along each border. Its levels,
/// and lines traced along its recovered gradient turned by a right angle, are the same lines.
#[test]
fn levels_and_traced_lines_of_a_flow_around_a_hole_agree() {
    let (inner, outer): (f64, f64) = (4.0, 20.0);
    let worst = |n: usize| {
        // A ring, by polar coordinates of a grid that is sewn together.
        let at = |k: usize| {
            let (i, j) = (k % (6 * n), k / (6 * n));
            let angle = std::f64::consts::TAU * i as f64 / (6 * n) as f64;
            let radius = inner * (outer / inner).powf(j as f64 / n as f64);
            [radius * angle.cos(), radius * angle.sin()]
        };
        let points: Vec<[f64; 2]> = (0..6 * n * (n + 1)).map(at).collect();
        let corner = |i: usize, j: usize| (j * 6 * n + i % (6 * n)) as u32;
        let squares = (0..n).flat_map(|j| (0..6 * n).map(move |i| (i, j)));
        let triangles = squares.flat_map(|(i, j)| {
            let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            // Diagonals all alike would turn all lines to one side.
            if (i + j) % 2 == 0 { [[a, c, b], [a, d, c]] } else { [[a, d, b], [b, d, c]] }
        });
        let mesh = FieldMesh::planar(&points, triangles.collect()).unwrap();
        let flows = flows_of(&mesh, |p| p.coords / p.coords.norm_squared());
        let tied = mesh.loops().to_vec();
        let held = Held { fixed: &[(corner(0, 0), 0.0)], tied: &tied };
        let psi = solve_stream(&mesh, &flows, 1.0, &held).unwrap().values;
        assert!((psi[psi.len() - 1] - (outer / inner).ln()).abs() < 0.01);
        let levels = MeshLevels::new(&mesh, &psi).unwrap();
        let lines: Vec<Vector3> = levels.gradients().iter().map(|g| Vector3::new(-g.y, g.x, 0.0)).collect();
        let tracer = MeshTracer::new(&mesh, &lines).unwrap();
        let mut worst = 0.0f64;
        for share in [0.15, 0.4, 0.8] {
            let curves = levels.curves(share * (outer / inner).ln());
            assert!(curves.len() == 1 && curves[0].closed);
            let line = tracer.through(curves[0].points[0], 0.25, 200.0);
            assert!(line.closed || n < 60);
            let radius = |p: &MeshPoint| p.position.xy().coords.norm();
            let of_level = curves[0].points.iter().map(radius).sum::<f64>() / curves[0].points.len() as f64;
            worst = line.points.iter().map(|p| (radius(p) - of_level).abs()).fold(worst, f64::max);
        }
        worst
    };
    let (coarse, fine) = (worst(20), worst(60));
    println!("{coarse} {fine}");
    // A chord tolerance of 5 µm.
    assert!(fine < 0.005 && fine < 0.4 * coarse, "{coarse} {fine}");
}

/// On a curved mesh, too, levels and lines that are traced along the recovered gradient turned by a right
/// angle agree: by the chord tolerance of 5 µm on triangles of 0.2 mm over 20 mm, and by the square of their
/// sides.
#[test]
fn levels_and_traced_lines_of_a_curved_mesh_agree() {
    let worst = |n: usize| {
        let mesh = mapped(n, no_hole, |x, y| {
            let (x, y) = (20.0 * (x - 0.5), 20.0 * (y - 0.5));
            [x, y, (24.0f64.powi(2) - x * x - y * y).sqrt()]
        });
        let psi = |p: &Point3| p.x + 0.4 * p.z + 1.5 * (0.2 * p.y).sin();
        let values: Vec<f64> = mesh.points().iter().map(psi).collect();
        let levels = MeshLevels::new(&mesh, &values).unwrap();
        let normal = |p: &Point3| p.coords.normalize();
        let lines = mesh.points().iter().zip(levels.gradients()).map(|(p, g)| normal(p).cross(g));
        let lines: Vec<Vector3> = lines.collect();
        let tracer = MeshTracer::new(&mesh, &lines).unwrap();
        let [lo, hi] = levels.range();
        let mut worst = 0.0f64;
        for share in [0.25, 0.5, 0.75] {
            let curve = &levels.curves(lo + share * (hi - lo))[0];
            let traced = tracer.through(curve.points[curve.points.len() / 2], 0.2, 100.0);
            // From border to border.
            assert!(traced.points.len() as f64 * 0.2 > 0.95 * curve.length(), "{n} {share}");
            let off = |p: &MeshPoint| {
                let sides = curve.points.windows(2);
                let away = sides.map(|w| distance_to_segment(&p.position, &w[0].position, &w[1].position));
                away.fold(f64::INFINITY, f64::min)
            };
            worst = traced.points.iter().map(off).fold(worst, f64::max);
        }
        worst
    };
    let (coarse, fine) = (worst(25), worst(100));
    println!("{coarse} {fine}");
    assert!(fine < 0.005 && fine < 0.2 * coarse, "{coarse} {fine}");
}
