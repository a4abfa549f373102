//! Poisson's equation with constant coefficients on an even grid, by cosine transforms.
//!
//! The operator `c_u L⊗M + c_v M⊗L`, with L the Laplacian of a path and M = diag(½, 1, …, 1, ½), has
//! the cosines `cos(πki/n)` as eigenvectors over M, with eigenvalues `2 − 2cos(πk/n)`. Transforms are
//! those of rustfft on the even extension, two rows at a time as real and imaginary part.

use std::f64::consts::PI;
use std::sync::Arc;

use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};

use super::multigrid::Edges;

/// x of mean 0 with `A x = rhs` where all cells of `edges` have the coefficients `[c_u, c_v]` and no
/// mixed term; padded arrays.
pub(super) fn solve_even(edges: &Edges<f64>, [cu, cv]: [f64; 2], rhs: &[f64]) -> Vec<f64> {
    let [nodes_u, nodes_v] = edges.nodes;
    let [nu, nv] = [nodes_u - 1, nodes_v - 1];
    let mut planner = FftPlanner::new();
    let plans = [nu, nv].map(|n| planner.plan_fft_forward(2 * n));
    let over_m = |k: usize, n: usize| if k == 0 || k == n { 2.0 } else { 1.0 };
    let mut rows = Vec::with_capacity(nodes_u * nodes_v);
    for j in 0..nodes_v {
        let row = &rhs[edges.at(0, j)..][..nodes_u];
        rows.extend(row.iter().enumerate().map(|(i, r)| r * over_m(i, nu) * over_m(j, nv)));
    }
    let mut columns = vec![0.0; rows.len()];
    transform(&mut rows, nodes_u, &plans[0]);
    transpose(&rows, &mut columns, nodes_u);
    transform(&mut columns, nodes_v, &plans[1]);
    let eigenvalues =
        |n: usize| (0..=n).map(|k| 2.0 - 2.0 * (PI * k as f64 / n as f64).cos()).collect::<Vec<_>>();
    let (along_u, along_v) = (eigenvalues(nu), eigenvalues(nv));
    // Twice a transform is a multiplication by 2n.
    let scale = 1.0 / (4.0 * nu as f64 * nv as f64);
    for (column, a) in columns.chunks_exact_mut(nodes_v).zip(&along_u) {
        for (x, b) in column.iter_mut().zip(&along_v) {
            let eigenvalue = cu * a + cv * b;
            *x = if eigenvalue > 0.0 { *x * scale / eigenvalue } else { 0.0 };
        }
    }
    transform(&mut columns, nodes_v, &plans[1]);
    transpose(&columns, &mut rows, nodes_v);
    transform(&mut rows, nodes_u, &plans[0]);
    let mut x = vec![0.0; rhs.len()];
    for (j, row) in rows.chunks_exact(nodes_u).enumerate() {
        x[edges.at(0, j)..][..nodes_u].copy_from_slice(row);
    }
    x
}

/// Replaces each row `x` of `width` by `x_0 + (−1)^k x_n + 2 Σ x_i cos(πik/n)`, n = width − 1.
fn transform(rows: &mut [f64], width: usize, fft: &Arc<dyn Fft<f64>>) {
    let n = width - 1;
    let mut line = vec![Complex::new(0.0, 0.0); 2 * n];
    let mut scratch = vec![Complex::new(0.0, 0.0); fft.get_inplace_scratch_len()];
    for pair in rows.chunks_mut(2 * width) {
        let (a, b) = pair.split_at_mut(width);
        for i in 0..=n {
            line[i] = Complex::new(a[i], b.get(i).copied().unwrap_or(0.0));
        }
        for i in 1..n {
            line[2 * n - i] = line[i];
        }
        fft.process_with_scratch(&mut line, &mut scratch);
        for i in 0..=n {
            a[i] = line[i].re;
            if let Some(b) = b.get_mut(i) {
                *b = line[i].im;
            }
        }
    }
}

/// `to[i][j] = from[j][i]` for rows of `width` in `from`.
fn transpose(from: &[f64], to: &mut [f64], width: usize) {
    /// Side of the squares that stay in the fastest memory.
    const BLOCK: usize = 16;
    let height = from.len() / width;
    for j in (0..height).step_by(BLOCK) {
        for i in (0..width).step_by(BLOCK) {
            for b in j..(j + BLOCK).min(height) {
                for a in i..(i + BLOCK).min(width) {
                    to[a * height + b] = from[b * width + a];
                }
            }
        }
    }
}
