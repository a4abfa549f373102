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
