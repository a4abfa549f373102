//! Known fields on plane and curved meshes, with the order of convergence that linear elements promise.

mod lines;
mod making;
mod stream;
mod trace;

use super::*;
use geometry::{Point2, Point3, Vector3, distance_to_segment};

/// A grid of `nx` × `ny` squares over `[0, 1]²` with inner vertices shifted at random, each square cut
/// by one or the other diagonal, squares whose centre `hole` holds left out.
fn grid(nx: usize, ny: usize, hole: impl Fn(f64, f64) -> bool) -> (Vec<[f64; 2]>, Vec<[u32; 3]>) {
    let mut state = 12345u64;
    let mut random = move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((state >> 33) as f64 / (1u64 << 31) as f64) - 0.5
    };
    let mut points = Vec::new();
    for j in 0..=ny {
        for i in 0..=nx {
            let (a, b) = (0.5 * random(), 0.5 * random());
            let inner = i > 0 && i < nx && j > 0 && j < ny;
            let [a, b] = if inner { [a, b] } else { [0.0; 2] };
            points.push([(i as f64 + a) / nx as f64, (j as f64 + b) / ny as f64]);
        }
    }
    let at = |i: usize, j: usize| (j * (nx + 1) + i) as u32;
    let mut triangles = Vec::new();
    for j in 0..ny {
        for i in 0..nx {
            if hole((i as f64 + 0.5) / nx as f64, (j as f64 + 0.5) / ny as f64) {
                continue;
            }
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            if random() < 0.0 {
                triangles.extend([[a, b, c], [a, c, d]]);
            } else {
                triangles.extend([[a, b, d], [b, c, d]]);
            }
        }
    }
    // Without the vertices in the middle of a hole.
    let mut used = vec![u32::MAX; points.len()];
    let mut kept = Vec::new();
    for v in triangles.iter_mut().flatten() {
        if used[*v as usize] == u32::MAX {
            used[*v as usize] = kept.len() as u32;
            kept.push(points[*v as usize]);
        }
        *v = used[*v as usize];
    }
    (kept, triangles)
}

fn no_hole(_: f64, _: f64) -> bool {
    false
}

/// A hole of about a fifth of the side, near the middle.
fn hole(x: f64, y: f64) -> bool {
    (x - 0.45).hypot(y - 0.55) < 0.2
}

/// The grid mapped onto a surface.
fn mapped(n: usize, hole: fn(f64, f64) -> bool, map: impl Fn(f64, f64) -> [f64; 3]) -> FieldMesh {
    let (points, triangles) = grid(n, n, hole);
    let points = points.iter().map(|p| Point3::from(map(p[0], p[1]))).collect();
    FieldMesh::new(points, triangles, None).unwrap()
}

fn centroid(mesh: &FieldMesh, t: usize) -> Point3 {
    let [a, b, c] = mesh.corners(t);
    Point3::from((a.coords + b.coords + c.coords) / 3.0)
}

/// Flows whose stream function has the given gradient: `|∇ψ|` as density, `b` along it.
fn flows_of(mesh: &FieldMesh, gradient: impl Fn(&Point3) -> Vector3) -> Vec<Flow> {
    let flow = |t: usize| {
        let g = gradient(&centroid(mesh, t));
        // b = n × t, so t = b × n.
        Flow { along: g.cross(&mesh.area_vector(t)), density: g.norm(), weight: 1.0 }
    };
    (0..mesh.triangles().len()).map(flow).collect()
}

/// Root mean square difference of two functions at the vertices, up to a constant.
fn difference(mesh: &FieldMesh, values: &[f64], exact: impl Fn(&Point3) -> f64) -> f64 {
    let off: Vec<f64> = mesh.points().iter().zip(values).map(|(p, v)| v - exact(p)).collect();
    let n = off.len() as f64;
    let mean = off.iter().sum::<f64>() / n;
    (off.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt()
}

/// A plate in two halves and a fin on the edge between them; and a band with half a turn, which is cut where
/// its sides meet the wrong way.
#[test]
fn parted_surfaces_have_borders_where_more_than_two_triangles_meet() {
    let points: Vec<Point3> = [
        [0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [2.0, 0.0, 0.0],
        [2.0, 1.0, 0.0],
        [1.0, 0.5, 1.0],
    ]
    .map(Point3::from)
    .to_vec();
    let halves = vec![[0, 2, 1], [1, 2, 3], [2, 4, 3], [3, 4, 5], [2, 3, 6]];
    assert!(FieldMesh::new(points.clone(), halves.clone(), None).is_err());
    let (parted_points, triangles) = parted(&points, &halves);
    let mesh = FieldMesh::new(parted_points, triangles, None).unwrap();
    // Two halves of four corners each, and the fin.
    assert_eq!((mesh.points().len(), mesh.pieces().1), (11, 3));
    // What is a surface stays one.
    let (same, whole) = parted(&points[..6], &halves[..4]);
    assert_eq!((same.len(), FieldMesh::new(same, whole, None).unwrap().pieces().1), (6, 1));
    let band: Vec<Point3> = (0..10)
        .map(|k| {
            let (around, turn) = (f64::from(k / 2) * 1.2566, f64::from(k / 2) * 0.62832);
            let out = if k % 2 == 0 { 0.3 } else { -0.3 };
            let r = 2.0 + out * turn.cos();
            Point3::new(r * around.cos(), r * around.sin(), out * turn.sin())
        })
        .collect();
    let mut strip: Vec<[u32; 3]> =
        (0..4).flat_map(|k| [[2 * k, 2 * k + 2, 2 * k + 1], [2 * k + 1, 2 * k + 2, 2 * k + 3]]).collect();
    strip.extend([[8, 1, 9], [9, 1, 0]]);
    let (points, triangles) = parted(&band, &strip);
    let mesh = FieldMesh::new(points, triangles, None).unwrap();
    assert_eq!((mesh.points().len(), mesh.pieces().1), (12, 1));
}
