//! A function given at the nodes of an even grid, once continuously differentiable between them.
//!
//! Enters: values at nodes. Leaves: value and gradient anywhere in the rectangle, by bicubic
//! interpolation with central differences as slopes (Catmull & Rom 1974): quadratics are reproduced,
//! the error is O(h³) in values. Beyond the border stands one more row of nodes, by quadratic
//! extrapolation, so that slopes there are one-sided differences of second order.

/// A function on an even grid of nodes over a rectangle, borders included.
#[derive(Debug, Clone, PartialEq)]
pub struct GridField {
    domain: [[f64; 2]; 2],
    cells: [usize; 2],
    /// `[cells_v + 3][cells_u + 3]`, row-major: the nodes and a row beyond each border.
    values: Vec<f64>,
}

impl GridField {
    /// From values `[cells_v + 1][cells_u + 1]`, row-major. `None` unless there are as many, at least
    /// two cells a side, and the rectangle has an area.
    pub fn new(domain: [[f64; 2]; 2], cells: [usize; 2], values: &[f64]) -> Option<Self> {
        let [nu, nv] = cells;
        let sound = nu >= 2 && nv >= 2 && domain.iter().all(|[lo, hi]| hi > lo);
        if !sound || values.len() != (nu + 1) * (nv + 1) {
            return None;
        }
        let stride = nu + 3;
        let mut padded = vec![0.0; stride * (nv + 3)];
        for (row, target) in values.chunks_exact(nu + 1).zip(padded.chunks_exact_mut(stride).skip(1)) {
            target[1..nu + 2].copy_from_slice(row);
            target[0] = extrapolated(row[0], row[1], row[2]);
            target[nu + 2] = extrapolated(row[nu], row[nu - 1], row[nu - 2]);
        }
        for i in 0..stride {
            let at = |j: usize| padded[j * stride + i];
            let (below, above) =
                (extrapolated(at(1), at(2), at(3)), extrapolated(at(nv + 1), at(nv), at(nv - 1)));
            padded[i] = below;
            padded[(nv + 2) * stride + i] = above;
        }
        Some(Self { domain, cells, values: padded })
    }

    /// The parameter rectangle.
    pub fn domain(&self) -> [[f64; 2]; 2] {
        self.domain
    }

    /// Cells along u and v.
    pub fn cells(&self) -> [usize; 2] {
        self.cells
    }

    /// The value at node `(i, j)`; indices beyond the border are clamped.
    pub fn node(&self, i: usize, j: usize) -> f64 {
        let (i, j) = (i.min(self.cells[0]), j.min(self.cells[1]));
        self.values[(j + 1) * (self.cells[0] + 3) + i + 1]
    }

    /// Value and first derivatives `[f, f_u, f_v]`; parameters are clamped to the domain.
    pub fn value_and_gradient(&self, u: f64, v: f64) -> [f64; 3] {
        let (i, wu, du) = self.weights(0, u);
        let (j, wv, dv) = self.weights(1, v);
        let stride = self.cells[0] + 3;
        let mut out = [0.0; 3];
        for b in 0..4 {
            let row = &self.values[(j + b) * stride + i..][..4];
            let value: f64 = (0..4).map(|a| wu[a] * row[a]).sum();
            let slope: f64 = (0..4).map(|a| du[a] * row[a]).sum();
            out[0] += wv[b] * value;
            out[1] += wv[b] * slope;
            out[2] += dv[b] * value;
        }
        out
    }

    /// First padded node, weights of four values, and of four values for the derivative.
    fn weights(&self, axis: usize, at: f64) -> (usize, [f64; 4], [f64; 4]) {
        let ([lo, hi], n) = (self.domain[axis], self.cells[axis]);
        let scale = n as f64 / (hi - lo);
        let x = ((at - lo) * scale).max(0.0).min(n as f64);
        let cell = (x as usize).min(n - 1);
        let t = x - cell as f64;
        let w = [
            t * (-0.5 + t * (1.0 - 0.5 * t)),
            1.0 + t * t * (-2.5 + 1.5 * t),
            t * (0.5 + t * (2.0 - 1.5 * t)),
            t * t * (-0.5 + 0.5 * t),
        ];
        let d = [
            -0.5 + t * (2.0 - 1.5 * t),
            t * (-5.0 + 4.5 * t),
            0.5 + t * (4.0 - 4.5 * t),
            t * (-1.0 + 1.5 * t),
        ];
        (cell, w, d.map(|d| d * scale))
    }
}

fn extrapolated(a: f64, b: f64, c: f64) -> f64 {
    3.0 * a - 3.0 * b + c
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field(n: [usize; 2], f: impl Fn(f64, f64) -> f64) -> GridField {
        let domain = [[-1.0, 2.0], [0.5, 1.5]];
        let at = |c: usize, k: usize| domain[c][0] + (domain[c][1] - domain[c][0]) * k as f64 / n[c] as f64;
        let values: Vec<f64> =
            (0..(n[0] + 1) * (n[1] + 1)).map(|k| f(at(0, k % (n[0] + 1)), at(1, k / (n[0] + 1)))).collect();
        GridField::new(domain, n, &values).unwrap()
    }

    #[test]
    fn quadratics_are_reproduced_to_the_border() {
        let f = |u: f64, v: f64| 1.0 + u - 2.0 * v + 0.5 * u * u - u * v + 3.0 * v * v;
        let grid = field([7, 5], f);
        for (u, v) in [(-1.0, 0.5), (2.0, 1.5), (0.123, 0.77), (1.99, 0.501), (-0.9, 1.49)] {
            let [value, fu, fv] = grid.value_and_gradient(u, v);
            assert!((value - f(u, v)).abs() < 1e-12);
            assert!((fu - (1.0 + u - v)).abs() < 1e-12, "{fu}");
            assert!((fv - (-2.0 - u + 6.0 * v)).abs() < 1e-11, "{fv}");
        }
    }

    #[test]
    fn gradient_is_that_of_the_value_and_continuous() {
        let grid = field([9, 8], |u, v| (2.0 * u).sin() * (3.0 * v).cos());
        let step = 1e-6;
        for (u, v) in [(0.11, 0.93), (-0.53, 1.21), (1.7, 0.6)] {
            let [_, fu, fv] = grid.value_and_gradient(u, v);
            let at = |u: f64, v: f64| grid.value_and_gradient(u, v)[0];
            assert!((fu - (at(u + step, v) - at(u - step, v)) / (2.0 * step)).abs() < 1e-8);
            assert!((fv - (at(u, v + step) - at(u, v - step)) / (2.0 * step)).abs() < 1e-8);
        }
        // Across a line between cells.
        let (a, b) =
            (grid.value_and_gradient(1.0 / 3.0 - 1e-9, 0.8), grid.value_and_gradient(1.0 / 3.0 + 1e-9, 0.8));
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6));
    }

    #[test]
    fn unfit_grids_are_refused() {
        assert!(GridField::new([[0.0, 1.0]; 2], [1, 4], &[0.0; 10]).is_none());
        assert!(GridField::new([[0.0, 1.0]; 2], [2, 2], &[0.0; 8]).is_none());
        assert!(GridField::new([[0.0, 0.0], [0.0, 1.0]], [2, 2], &[0.0; 9]).is_none());
    }
}
