//! A multigrid cycle for weighted Laplacians on an even grid of nodes, as preconditioner of CG.
//!
//! Enters: a tensor per cell, the quadratic form of the gradient in units of cells. Leaves: the
//! operator (f64) and an approximate inverse of it (f32, which halves the memory that has to be read:
//! CG around it works in f64, and settles what rounding leaves).
//!
//! The form of a cell with corners `n00 n10 n01 n11` is `K_uu (e₁² + e₂²)/2 + K_vv (f₁² + f₂²)/2 +
//! 2 K_uv ē f̄`, with e its differences along u, f along v. Since `4ēf̄ = (n11 − n00)² − (n10 − n01)²`
//! the whole is a sum of `w (ψ_a − ψ_b)²` over edges and diagonals. It is positive semi-definite for
//! every positive tensor, constants alone give 0, and natural boundary conditions are built in.
//!
//! Coarse grids keep every other line and the last; along the weaker coupled parameter all lines are
//! kept until couplings are alike. A cycle smooths twice before and twice after, by the two steps of
//! the Chebyshev polynomial over the rough part of the spectrum (Adams et al. 2003).

use work::lanes;

/// A tensor of a cell, `[K_uu, K_uv, K_vv]`.
pub(super) type Tensor = [f64; 3];

/// Weights of the edges from each node to its neighbours east, north, north-east and north-west; all
/// arrays have a line of zeros around the nodes.
pub(super) struct Edges<T> {
    /// Nodes along u and v.
    pub nodes: [usize; 2],
    stride: usize,
    diagonal: Vec<T>,
    east: Vec<T>,
    north: Vec<T>,
    /// Empty where no cell couples along its diagonals.
    north_east: Vec<T>,
    north_west: Vec<T>,
}

impl Edges<f64> {
    /// From a tensor per cell `[v][u]` and the widths of the columns and rows of cells.
    pub fn new(tensors: &[Tensor], widths: [&[f64]; 2]) -> Self {
        let [nu, nv] = widths.map(<[f64]>::len);
        let stride = nu + 3;
        let zeros = vec![0.0; stride * (nv + 3)];
        let (mut diagonal, mut east, mut north) = (zeros.clone(), zeros.clone(), zeros.clone());
        let skew = tensors.iter().any(|t| t[1] != 0.0);
        let (mut north_east, mut north_west) =
            if skew { (zeros.clone(), zeros) } else { (Vec::new(), Vec::new()) };
        for (j, b) in widths[1].iter().enumerate() {
            for (i, a) in widths[0].iter().enumerate() {
                let [uu, uv, vv] = tensors[j * nu + i];
                let k = (j + 1) * stride + i + 1;
                let (along_u, along_v) = (0.5 * uu * b / a, 0.5 * vv * a / b);
                let mut add = |weights: &mut [f64], from: usize, to: usize, w: f64| {
                    weights[from] += w;
                    diagonal[from] += w;
                    diagonal[to] += w;
                };
                add(&mut east, k, k + 1, along_u);
                add(&mut east, k + stride, k + stride + 1, along_u);
                add(&mut north, k, k + stride, along_v);
                add(&mut north, k + 1, k + 1 + stride, along_v);
                if skew {
                    add(&mut north_east, k, k + stride + 1, 0.5 * uv);
                    add(&mut north_west, k + 1, k + stride, -0.5 * uv);
                }
            }
        }
        Self { nodes: [nu + 1, nv + 1], stride, diagonal, east, north, north_east, north_west }
    }

    fn rounded(&self, scale: f64) -> Edges<f32> {
        let round = |x: &[f64]| x.iter().map(|x| (x * scale) as f32).collect();
        Edges {
            nodes: self.nodes,
            stride: self.stride,
            diagonal: round(&self.diagonal),
            east: round(&self.east),
            north: round(&self.north),
            north_east: round(&self.north_east),
            north_west: round(&self.north_west),
        }
    }

    /// The diagonal of the operator, padded.
    pub fn diagonal(&self) -> &[f64] {
        &self.diagonal
    }

    /// The neighbours of greater index of the node at padded place `k` and minus the weights to them,
    /// by ascending place.
    pub fn upper(&self, k: usize) -> impl Iterator<Item = (usize, f64)> {
        let skew = !self.north_east.is_empty();
        let diagonal = |w: &[f64]| if skew { w[k] } else { 0.0 };
        [
            (k + 1, -self.east[k]),
            (k + self.stride - 1, -diagonal(&self.north_west)),
            (k + self.stride, -self.north[k]),
            (k + self.stride + 1, -diagonal(&self.north_east)),
        ]
        .into_iter()
    }
}

impl<T: Copy + Default + std::ops::Mul<Output = T> + std::ops::Add<Output = T> + std::ops::Sub<Output = T>>
    Edges<T>
{
    /// Length of padded arrays.
    pub fn len(&self) -> usize {
        self.diagonal.len()
    }

    /// Node `(i, j)`'s place in padded arrays.
    pub fn at(&self, i: usize, j: usize) -> usize {
        (j + 1) * self.stride + i + 1
    }

    /// `y = A x`, padded; the padding of `x` must be 0 and that of `y` becomes so.
    pub fn apply(&self, x: &[T], y: &mut [T]) {
        lanes::dispatch(
            #[inline(always)]
            || self.apply_in_lanes(x, y),
        );
    }

    #[inline(always)]
    fn apply_in_lanes(&self, x: &[T], y: &mut [T]) {
        let (s, n) = (self.stride, self.len());
        // From the first node to the last; slices of one length need no check of bounds and become
        // vector code.
        let (base, count) = (s + 1, n - 2 * s - 2);
        let d = &self.diagonal[base..base + count];
        let (e, w) = (&self.east[base..base + count], &self.east[base - 1..base - 1 + count]);
        let (n, from_s) = (&self.north[base..base + count], &self.north[base - s..base - s + count]);
        let (c, xe, xw) =
            (&x[base..base + count], &x[base + 1..base + 1 + count], &x[base - 1..base - 1 + count]);
        let (xn, xs) = (&x[base + s..base + s + count], &x[base - s..base - s + count]);
        let out = &mut y[base..base + count];
        if self.north_east.is_empty() {
            for k in 0..count {
                out[k] = d[k] * c[k] - (e[k] * xe[k] + w[k] * xw[k]) - (n[k] * xn[k] + from_s[k] * xs[k]);
            }
            return;
        }
        let (ne, sw) = (&self.north_east[base..base + count], &self.north_east[..count]);
        let (nw, se) = (&self.north_west[base..base + count], &self.north_west[2..2 + count]);
        let (xne, xsw) = (&x[base + s + 1..base + s + 1 + count], &x[..count]);
        let (xnw, xse) = (&x[base + s - 1..base + s - 1 + count], &x[2..2 + count]);
        for k in 0..count {
            let straight = (e[k] * xe[k] + w[k] * xw[k]) + (n[k] * xn[k] + from_s[k] * xs[k]);
            let skew = (ne[k] * xne[k] + sw[k] * xsw[k]) + (nw[k] * xnw[k] + se[k] * xse[k]);
            out[k] = d[k] * c[k] - straight - skew;
        }
    }
}

/// Half the nodes along one axis: the even ones and the last.
struct Halving {
    /// Nodes before.
    fine: usize,
    /// For each node between two kept ones, the weight of the one before (from the widths of cells).
    before: Vec<f32>,
}

impl Halving {
    /// Of cells of the given widths; and the widths after.
    fn new(widths: &[f64]) -> (Self, Vec<f64>) {
        let before = (0..=widths.len())
            .map(|i| match (i % 2, widths.get(i)) {
                (1, Some(right)) => (right / (widths[i - 1] + right)) as f32,
                _ => 1.0,
            })
            .collect();
        let merged: Vec<f64> = widths.chunks(2).map(|pair| pair.iter().sum()).collect();
        (Self { fine: widths.len() + 1, before }, merged)
    }

    /// Values of kept nodes, each with its share of those between: `put(coarse, fine, weight)`.
    fn each(&self, mut put: impl FnMut(usize, usize, f32)) {
        for i in 0..self.fine {
            if i % 2 == 1 && i + 1 < self.fine {
                put(i / 2, i, self.before[i]);
                put(i / 2 + 1, i, 1.0 - self.before[i]);
            } else {
                put(i.div_ceil(2), i, 1.0);
            }
        }
    }
}

/// One grid of the hierarchy.
struct Level {
    edges: Edges<f32>,
    /// One over the diagonal, 0 in the padding.
    inverse: Vec<f32>,
    /// How the next coarser grid comes from this one, along u and v; both `None` on the coarsest.
    halvings: [Option<Halving>; 2],
    x: Vec<f32>,
    r: Vec<f32>,
    work: Vec<f32>,
}

/// A hierarchy of grids.
pub(super) struct Multigrid {
    levels: Vec<Level>,
    /// Steps of the smoother, each over the diagonal.
    steps: [f32; 2],
    scale: f64,
}

/// Grids of at most this many cells along both axes are not halved again.
const COARSEST: usize = 3;

/// Sweeps on the coarsest grid: more than its few nodes need.
const COARSEST_SWEEPS: usize = 16;

/// Couplings along the two axes that differ by more than this factor are not halved together: the
/// smoother does not smooth across the weaker one.
const ALIKE: f64 = 2.5;

impl Multigrid {
    /// Builds the grids under `finest`, whose cells have `tensors` and unit widths.
    pub fn new(finest: &Edges<f64>, tensors: &[Tensor]) -> Self {
        let greatest = finest.diagonal.iter().fold(0.0, |m: f64, d| m.max(*d));
        let scale = if greatest > 0.0 { 1.0 / greatest } else { 1.0 };
        // Chebyshev points over [1/5, 1] of the greatest eigenvalue over the diagonal: at most 2 without
        // diagonals, 8/3 with them.
        let most = if finest.north_east.is_empty() { 2.0 } else { 8.0 / 3.0 };
        let (middle, half) = (0.6 * most, 0.4 * most);
        let steps = [1.0, -1.0].map(|sign| (1.0 / (middle + sign * half * 0.5f64.sqrt())) as f32);
        let mut widths = [0, 1].map(|c| vec![1.0; finest.nodes[c] - 1]);
        let (mut tensors, mut levels) = (tensors.to_vec(), Vec::new());
        let mut edges = finest.rounded(scale);
        loop {
            let cells = [0, 1].map(|c| widths[c].len());
            let mean = |c: usize| tensors.iter().map(|t| t[2 * c]).sum::<f64>() / square_of_mean(&widths[c]);
            let coupling = [mean(0), mean(1)];
            let open = cells.map(|n| n > COARSEST);
            let weak = |c: usize| open[1 - c] && coupling[1 - c] > ALIKE * coupling[c];
            let halved = [open[0] && !weak(0), open[1] && !weak(1)];
            let mut coarser = widths.clone();
            let halvings = [0, 1].map(|c| {
                halved[c].then(|| {
                    let (halving, merged) = Halving::new(&widths[c]);
                    coarser[c] = merged;
                    halving
                })
            });
            let zeros = vec![0.0; edges.len()];
            let inverse = edges.diagonal.iter().map(|&d| if d > 0.0 { 1.0 / d } else { 0.0 }).collect();
            levels.push(Level { edges, inverse, halvings, x: zeros.clone(), r: zeros.clone(), work: zeros });
            if halved == [false; 2] {
                return Self { levels, steps, scale };
            }
            tensors = merged_tensors(&tensors, &widths, halved);
            widths = coarser;
            edges = Edges::new(&tensors, [&widths[0], &widths[1]]).rounded(scale);
        }
    }

    /// `z` ≈ A⁻¹ r for padded arrays; symmetric, and the same for the same `r` but for scale.
    pub fn precondition(&mut self, r: &[f64], z: &mut [f64]) {
        let greatest = r.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        if greatest == 0.0 || !greatest.is_finite() {
            z.fill(0.0);
            return;
        }
        // f32 resolves parts of the greatest value, whatever that is.
        let down = 1.0 / greatest;
        for (to, from) in self.levels[0].r.iter_mut().zip(r) {
            *to = (from * down) as f32;
        }
        self.cycle(0);
        let up = greatest * self.scale;
        for (to, from) in z.iter_mut().zip(&self.levels[0].x) {
            *to = f64::from(*from) * up;
        }
    }

    fn cycle(&mut self, depth: usize) {
        let [first, second] = self.steps;
        if depth + 1 == self.levels.len() {
            let level = &mut self.levels[depth];
            level.start(first);
            level.smooth(second);
            for _ in 1..COARSEST_SWEEPS {
                level.smooth(first);
                level.smooth(second);
            }
            return;
        }
        let (upper, lower) = self.levels.split_at_mut(depth + 1);
        let (level, coarse) = (&mut upper[depth], &mut lower[0]);
        level.start(first);
        level.smooth(second);
        level.residual();
        level.restrict(coarse);
        self.cycle(depth + 1);
        let (upper, lower) = self.levels.split_at_mut(depth + 1);
        upper[depth].prolong(&lower[0]);
        upper[depth].smooth(second);
        upper[depth].smooth(first);
    }
}

/// Square of the mean width.
fn square_of_mean(widths: &[f64]) -> f64 {
    (widths.iter().sum::<f64>() / widths.len() as f64).powi(2)
}

/// Means of the tensors of merged cells, weighted by area.
fn merged_tensors(tensors: &[Tensor], widths: &[Vec<f64>; 2], halved: [bool; 2]) -> Vec<Tensor> {
    let counts = [0, 1].map(|c| widths[c].len());
    let by = halved.map(|h| if h { 2 } else { 1 });
    let coarse = [0, 1].map(|c| counts[c].div_ceil(by[c]));
    (0..coarse[0] * coarse[1])
        .map(|k| {
            let (i, j) = (k % coarse[0] * by[0], k / coarse[0] * by[1]);
            let (mut sum, mut area) = ([0.0; 3], 0.0);
            for b in j..(j + by[1]).min(counts[1]) {
                for a in i..(i + by[0]).min(counts[0]) {
                    let weight = widths[0][a] * widths[1][b];
                    area += weight;
                    for c in 0..3 {
                        sum[c] += weight * tensors[b * counts[0] + a][c];
                    }
                }
            }
            sum.map(|s| s / area)
        })
        .collect()
}

impl Level {
    /// The first step of the smoother, from 0.
    fn start(&mut self, step: f32) {
        for ((x, r), d) in self.x.iter_mut().zip(&self.r).zip(&self.inverse) {
            *x = step * d * r;
        }
    }

    /// `x += step · D⁻¹ (r − A x)`.
    fn smooth(&mut self, step: f32) {
        let Self { edges, x, r, work, inverse, .. } = self;
        lanes::dispatch(
            #[inline(always)]
            || {
                edges.apply_in_lanes(x, work);
                for (((x, r), d), a) in x.iter_mut().zip(&*r).zip(&*inverse).zip(&*work) {
                    *x += step * d * (r - a);
                }
            },
        );
    }

    /// `work = r − A x`.
    fn residual(&mut self) {
        self.edges.apply(&self.x, &mut self.work);
        for (a, r) in self.work.iter_mut().zip(&self.r) {
            *a = r - *a;
        }
    }

    /// The residual in `work` as the right side of `coarse`: the transpose of [`Level::prolong`].
    fn restrict(&self, coarse: &mut Level) {
        let [nu, nv] = self.edges.nodes;
        let width = coarse.edges.nodes[0];
        coarse.r.fill(0.0);
        let mut row = vec![0.0; width];
        let [along_u, along_v] = &self.halvings;
        // Along u first: a row at a time, then shared out to the coarse rows.
        let mut share = |coarse: &mut Level, j: usize, to: &[(usize, f32)]| {
            let from = &self.work[self.edges.at(0, j)..][..nu];
            let row: &[f32] = match along_u {
                None => from,
                Some(h) => {
                    row.fill(0.0);
                    let pairs = nu.saturating_sub(1) / 2;
                    row[0] = from[0];
                    for k in 0..pairs {
                        let (left, middle, right) = (2 * k, from[2 * k + 1], from[2 * k + 2]);
                        let weight = h.before[left + 1];
                        row[k] += weight * middle;
                        row[k + 1] = right + (1.0 - weight) * middle;
                    }
                    if nu % 2 == 0 {
                        row[nu / 2] = from[nu - 1];
                    }
                    &row
                }
            };
            for &(target, weight) in to {
                let start = coarse.edges.at(0, target);
                for (to, from) in coarse.r[start..start + width].iter_mut().zip(row) {
                    *to += weight * from;
                }
            }
        };
        match along_v {
            None => (0..nv).for_each(|j| share(coarse, j, &[(j, 1.0)])),
            Some(h) => {
                let mut targets = vec![Vec::new(); nv];
                h.each(|to, from, weight| targets[from].push((to, weight)));
                targets.iter().enumerate().for_each(|(j, to)| share(coarse, j, to));
            }
        }
    }

    /// Adds the solution of `coarse`, linearly between its nodes.
    fn prolong(&mut self, coarse: &Level) {
        let [nu, nv] = self.edges.nodes;
        let width = coarse.edges.nodes[0];
        let [along_u, along_v] = &self.halvings;
        let mut sources: Vec<Vec<(usize, f32)>> = (0..nv).map(|j| vec![(j, 1.0)]).collect();
        if let Some(h) = along_v {
            sources.iter_mut().for_each(Vec::clear);
            h.each(|to, from, weight| sources[from].push((to, weight)));
        }
        let mut row = vec![0.0; width];
        for (j, from) in sources.iter().enumerate() {
            row.fill(0.0);
            for &(source, weight) in from {
                let start = coarse.edges.at(0, source);
                for (to, x) in row.iter_mut().zip(&coarse.x[start..start + width]) {
                    *to += weight * x;
                }
            }
            let start = self.edges.at(0, j);
            let target = &mut self.x[start..start + nu];
            match along_u {
                None => target.iter_mut().zip(&row).for_each(|(x, r)| *x += r),
                Some(h) => {
                    let pairs = nu.saturating_sub(1) / 2;
                    target[0] += row[0];
                    for k in 0..pairs {
                        let weight = h.before[2 * k + 1];
                        target[2 * k + 1] += weight * row[k] + (1.0 - weight) * row[k + 1];
                        target[2 * k + 2] += row[k + 1];
                    }
                    if nu % 2 == 0 {
                        target[nu - 1] += row[nu / 2];
                    }
                }
            }
        }
    }
}
