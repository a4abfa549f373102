//! Smooth derivatives at vertices from values at vertices: a quadratic fitted around each vertex, in
//! its tangent plane (Zhang and Naga, "A new finite element gradient recovery method: superconvergence
//! property", 2005).
//!
//! The gradient of a linear element is of first order and jumps from triangle to triangle; what comes
//! from here is of second order, on borders too.

use super::FieldMesh;
use super::surface::turned;
use geometry::Vector3;
use work::parallel;

/// Vertices that one worker handles at a time.
const CHUNK: usize = 1024;

/// A quadratic needs its five coefficients and something to average over.
const LEAST_NEIGHBOURS: usize = 7;

/// A pivot of the scaled normal equations below this means that the neighbours lie on a conic, on
/// which a quadratic is not determined.
const LEAST_PIVOT: f64 = 1e-7;

/// What stands in a fit, reused from vertex to vertex.
#[derive(Default)]
pub(super) struct Samples {
    /// Places in the tangent plane, mm, values less the one at the vertex, and weights.
    pub list: Vec<([f64; 2], f64, f64)>,
}

impl Samples {
    /// Coefficients of `x, y, x², xy, y²` of the quadratic through 0 at the origin that fits best; of
    /// the linear function where a quadratic is not determined.
    pub fn fit(&self) -> Option<[f64; 5]> {
        let scale = self.list.iter().map(|(p, ..)| p[0].hypot(p[1])).fold(0.0, f64::max);
        if scale <= 0.0 {
            return None;
        }
        let quadratic = if self.list.len() >= LEAST_NEIGHBOURS { self.solve::<5>(scale) } else { None };
        quadratic.or_else(|| self.solve::<2>(scale).map(|[x, y]| [x, y, 0.0, 0.0, 0.0]))
    }

    /// Least squares with the first `N` terms, by Cholesky.
    fn solve<const N: usize>(&self, scale: f64) -> Option<[f64; N]> {
        let (mut a, mut b) = ([[0.0; N]; N], [0.0; N]);
        for &(p, value, weight) in &self.list {
            let (x, y) = (p[0] / scale, p[1] / scale);
            let terms = [x, y, x * x, x * y, y * y];
            for k in 0..N {
                b[k] += weight * terms[k] * value;
                for l in 0..=k {
                    a[k][l] += weight * terms[k] * terms[l];
                }
            }
        }
        let whole: f64 = (0..N).map(|k| a[k][k]).sum();
        for k in 0..N {
            for l in 0..=k {
                let sum = a[k][l] - (0..l).map(|m| a[k][m] * a[l][m]).sum::<f64>();
                if k == l {
                    if sum.is_nan() || sum <= LEAST_PIVOT * whole {
                        return None;
                    }
                    a[k][k] = sum.sqrt();
                } else {
                    a[k][l] = sum / a[l][l];
                }
            }
            b[k] = (b[k] - (0..k).map(|m| a[k][m] * b[m]).sum::<f64>()) / a[k][k];
        }
        for k in (0..N).rev() {
            b[k] = (b[k] - (k + 1..N).map(|m| a[m][k] * b[m]).sum::<f64>()) / a[k][k];
        }
        for k in 0..N {
            b[k] /= if k < 2 { scale } else { scale * scale };
        }
        Some(b)
    }
}

/// Gradients at the vertices, tangent to the surface there, of a function given at the vertices.
///
/// # Tolerance
/// Exact for quadratics on a plane where two rings of neighbours determine one; of second order in the
/// length of the edges elsewhere, of first order where only a linear function is determined.
pub fn vertex_gradients(mesh: &FieldMesh, values: &[f64]) -> Vec<Vector3> {
    let mut gradients = vec![Vector3::zeros(); mesh.points().len()];
    parallel::for_each_chunk(&mut gradients, CHUNK, |chunk, out| {
        let (mut samples, mut near, mut seen) = (Samples::default(), Vec::new(), Vec::new());
        for (k, gradient) in out.iter_mut().enumerate() {
            let v = chunk * CHUNK + k;
            rings(mesh, v, &mut near, &mut seen);
            *gradient = gradient_at(mesh, v, &near, &mut samples, &|w| values[w as usize] - values[v]);
        }
    });
    gradients
}

/// How [`vertex_gradients`] follow from the values: for each vertex the vertices that count, each with what
/// its value is multiplied by.
pub fn gradient_terms(mesh: &FieldMesh) -> Vec<Vec<(u32, Vector3)>> {
    let mut terms = vec![Vec::new(); mesh.points().len()];
    parallel::for_each_chunk(&mut terms, CHUNK, |chunk, out| {
        let (mut samples, mut near, mut seen) = (Samples::default(), Vec::new(), Vec::new());
        for (k, terms) in out.iter_mut().enumerate() {
            let v = chunk * CHUNK + k;
            rings(mesh, v, &mut near, &mut seen);
            let mut own = Vector3::zeros();
            for &one in &near {
                // The fit is linear: that of a function which is 1 there and 0 elsewhere.
                let value = |w: u32| if w == one { 1.0 } else { 0.0 };
                let gradient = gradient_at(mesh, v, &near, &mut samples, &value);
                own -= gradient;
                terms.push((one, gradient));
            }
            terms.push((v as u32, own));
        }
    });
    terms
}

/// The gradient at `v` from the values of the vertices `near`, less its own.
fn gradient_at(
    mesh: &FieldMesh,
    v: usize,
    near: &[u32],
    samples: &mut Samples,
    value: &dyn Fn(u32) -> f64,
) -> Vector3 {
    let [e1, e2] = mesh.frame(v);
    samples.list.clear();
    for &w in near {
        let d = mesh.points()[w as usize] - mesh.points()[v];
        samples.list.push(([d.dot(&e1), d.dot(&e2)], value(w), 1.0 / d.norm_squared()));
    }
    match samples.fit() {
        Some([x, y, ..]) => e1 * x + e2 * y,
        None => mean_of_triangles(mesh, v, &|w| if w as usize == v { 0.0 } else { value(w) }),
    }
}

/// The vertices within two edges of `v`, without `v`, ascending.
fn rings(mesh: &FieldMesh, v: usize, near: &mut Vec<u32>, first: &mut Vec<u32>) {
    let add = |of: usize, list: &mut Vec<u32>| {
        list.extend(mesh.triangles_at(of).iter().flat_map(|&t| mesh.triangles()[t as usize]));
    };
    first.clear();
    add(v, first);
    first.sort_unstable();
    first.dedup();
    near.clear();
    for &w in first.iter() {
        add(w as usize, near);
    }
    near.sort_unstable();
    near.dedup();
    near.retain(|&w| w as usize != v);
}

fn mean_of_triangles(mesh: &FieldMesh, v: usize, value: &dyn Fn(u32) -> f64) -> Vector3 {
    let (mut sum, mut areas) = (Vector3::zeros(), 0.0);
    for &t in mesh.triangles_at(v) {
        let t = t as usize;
        let hats = mesh.hat_gradients(t);
        let gradient: Vector3 = (0..3).map(|k| hats[k] * value(mesh.triangles()[t][k])).sum();
        let area = mesh.area(t);
        sum += turned(&mesh.area_vector(t).normalize(), &mesh.normals()[v], &gradient) * area;
        areas += area;
    }
    sum / areas
}
