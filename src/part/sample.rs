//! The part's surface over a regular grid of the plane: millions of vertical lines at once.
//!
//! A vertical line at a time costs a tree search each. Here the search mesh is drawn into the grid
//! triangle by triangle, the topmost kept, and each cell then refined on the exact surface from
//! its triangle's parameters. Bands of rows are drawn independently, each by one worker and in
//! triangle order, so any number of threads gives the same bits.

use super::seams::OnPatch;
use super::{Part, refine};
use geometry::{Point2, Vector3};
use work::monitor::{Cancelled, Monitor, check};
use work::parallel;

/// In [`GridSample::triangle`]: the cell's centre is off the part.
pub const OFF_PART: u32 = u32::MAX;

/// Rows that one worker draws at a time. More rows meet each triangle fewer times and spread
/// unevenly over the threads.
const BAND_ROWS: usize = 16;

/// The topmost surface point at the centre of a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridSample {
    /// Height, mm; 0 off the part.
    pub z: f64,
    /// Outward unit normal; up off the part.
    pub normal: Vector3,
    /// Triangle of [`Part::mesh`] that lies there, or [`OFF_PART`].
    pub triangle: u32,
}

impl GridSample {
    const OFF: Self = Self { z: 0.0, normal: Vector3::new(0.0, 0.0, 1.0), triangle: OFF_PART };

    /// True where the part lies under the cell's centre.
    pub fn is_on(&self) -> bool {
        self.triangle != OFF_PART
    }
}

/// The part's topmost surface over a grid; 40 bytes a cell.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceGrid {
    /// Centre of cell (0, 0), mm.
    pub origin: Point2,
    /// Pitch, mm.
    pub cell: f64,
    /// Cells along x.
    pub nx: usize,
    /// Cells along y.
    pub ny: usize,
    /// `[ny][nx]`, row-major.
    pub samples: Vec<GridSample>,
}

impl SurfaceGrid {
    /// The sample of cell `(i, j)`.
    ///
    /// # Panics
    /// Off the grid.
    pub fn at(&self, i: usize, j: usize) -> &GridSample {
        &self.samples[j * self.nx + i]
    }
}

impl Part {
    /// The topmost surface point at the centre of every cell: what [`Part::highest_at`] answers, for
    /// a whole grid. `cell` (mm) is the pitch, `origin` the centre of cell (0, 0).
    ///
    /// # Tolerance
    /// As [`Part::highest_at`].
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub fn sample_grid(
        &self,
        origin: Point2,
        cell: f64,
        nx: usize,
        ny: usize,
        monitor: &dyn Monitor,
    ) -> Result<SurfaceGrid, Cancelled> {
        monitor.start("sampling the part", ny as u64);
        let mut grid = SurfaceGrid { origin, cell, nx, ny, samples: vec![GridSample::OFF; nx * ny] };
        if grid.samples.is_empty() {
            return Ok(grid);
        }
        let bands = Bands::new(self, &grid);
        let lines = Lines { origin, cell };
        parallel::for_each_chunk(&mut grid.samples, BAND_ROWS * nx, |band, samples| {
            if monitor.cancelled() {
                return;
            }
            for &t in bands.of(band) {
                self.draw(t, &lines, band * BAND_ROWS, nx, samples);
            }
        });
        check(monitor)?;
        self.fill_beside_triangles(&lines, nx, &mut grid.samples);
        parallel::for_each_chunk(&mut grid.samples, nx, |j, row| {
            if monitor.cancelled() {
                return;
            }
            for (i, sample) in row.iter_mut().enumerate().filter(|(_, s)| s.is_on()) {
                *sample = self.refine_sample(sample, lines.x(i), lines.y(j));
            }
            monitor.advance(1);
        });
        check(monitor)?;
        Ok(grid)
    }

    /// Draws triangle `t` into the rows of a band: where it is the highest so far, its height and its
    /// number.
    fn draw(&self, t: u32, lines: &Lines, first_row: usize, nx: usize, samples: &mut [GridSample]) {
        let corners = self.mesh.corners(t as usize);
        let Some(plane) = Plan::new(self, t) else { return };
        let ys = corners.map(|c| c.y);
        let rows = samples.len() / nx;
        let Some([j0, j1]) = lines.rows(min3(ys), max3(ys), first_row, first_row + rows) else { return };
        let xs = corners.map(|c| c.x);
        let Some([i0, i1]) = lines.columns(min3(xs), max3(xs), nx) else { return };
        for j in j0..j1 {
            let y = lines.y(j);
            let row = &mut samples[(j - first_row) * nx..(j - first_row + 1) * nx];
            let [i0, i1] = plane.narrow(lines, y, [i0, i1]);
            for (i, sample) in (i0..i1).zip(&mut row[i0..i1]) {
                let Some(barycentric) = plane.barycentric(lines.x(i), y) else { continue };
                let z = corners[0].z * barycentric[0]
                    + corners[1].z * barycentric[1]
                    + corners[2].z * barycentric[2];
                if !sample.is_on() || z > sample.z {
                    *sample = GridSample { z, triangle: t, ..GridSample::OFF };
                }
            }
        }
    }

    /// A patch ends up to the deviation beside its triangles: where two meet, gaps stay between theirs, and
    /// where the part ends, it ends beyond them. Centres that fall there lie beside one on the part.
    fn fill_beside_triangles(&self, lines: &Lines, nx: usize, samples: &mut [GridSample]) {
        if self.patches.is_empty() {
            return;
        }
        let rows = samples.len() / nx;
        let mut found = Vec::new();
        for k in (0..samples.len()).filter(|&k| !samples[k].is_on()) {
            let (i, j) = (k % nx, k / nx);
            let along_x = i > 0 && samples[k - 1].is_on() || i + 1 < nx && samples[k + 1].is_on();
            let along_y = j > 0 && samples[k - nx].is_on() || j + 1 < rows && samples[k + nx].is_on();
            if (along_x || along_y)
                && let Some(place) = self.across_seams(None, lines.x(i), lines.y(j))
            {
                found.push((k, place));
            }
        }
        for (k, OnPatch { triangle, meeting, .. }) in found {
            samples[k] = GridSample { z: meeting.z, triangle, ..GridSample::OFF };
        }
    }

    /// From the mesh to the exact surface.
    fn refine_sample(&self, sample: &GridSample, x: f64, y: f64) -> GridSample {
        let t = sample.triangle;
        let Some(index) = self.patch_of(t) else {
            return GridSample { normal: self.mesh.normal(t as usize), ..*sample };
        };
        let meeting = self.refine_vertical(index, x, y, || self.nearest_in_plan(t, x, y));
        let on_own = meeting.map(|meeting| OnPatch { patch: index, triangle: t, meeting });
        match self.across_seams(on_own, x, y) {
            Some(OnPatch { patch, triangle, meeting: refine::VerticalMeeting { z, normal, .. } }) => {
                GridSample { z, normal: normal * self.signs[patch], triangle }
            }
            None => GridSample::OFF,
        }
    }

    /// The parameters of the place of a triangle that is about nearest to `(x, y)` in the plan.
    pub(super) fn nearest_in_plan(&self, triangle: u32, x: f64, y: f64) -> [f64; 2] {
        let plan = Plan::new(self, triangle);
        let barycentric = plan.map_or([1.0 / 3.0; 3], |plan| plan.clamped_barycentric(x, y));
        self.interpolate(triangle, &barycentric)
    }
}

/// Where the cells' centres lie.
struct Lines {
    origin: Point2,
    cell: f64,
}

impl Lines {
    fn x(&self, i: usize) -> f64 {
        self.origin.x + i as f64 * self.cell
    }

    fn y(&self, j: usize) -> f64 {
        self.origin.y + j as f64 * self.cell
    }

    /// Columns whose centres may lie in `[lo, hi]`, one more on each side for rounding.
    fn columns(&self, lo: f64, hi: f64, nx: usize) -> Option<[usize; 2]> {
        indices((lo - self.origin.x) / self.cell, (hi - self.origin.x) / self.cell, 0, nx)
    }

    /// As [`Lines::columns`] for rows, of which only `first..end` are wanted.
    fn rows(&self, lo: f64, hi: f64, first: usize, end: usize) -> Option<[usize; 2]> {
        indices((lo - self.origin.y) / self.cell, (hi - self.origin.y) / self.cell, first, end)
    }
}

/// The whole numbers in `[lo, hi]`, one more on each side, cut to `first..end`.
fn indices(lo: f64, hi: f64, first: usize, end: usize) -> Option<[usize; 2]> {
    let from = (lo.floor().max(first as f64)) as usize;
    let to = ((hi.ceil() + 1.0).min(end as f64)).max(0.0) as usize;
    (from < to).then_some([from, to])
}

/// A triangle in the plan view.
struct Plan {
    /// For each corner the opposite edge, from the vertex with the lesser index to the other one, and
    /// the sign that this order takes. Both triangles at an edge thus compute the very same number
    /// and no centre falls between them.
    edges: [([f64; 2], [f64; 2], f64); 3],
    /// Twice the signed area.
    area: f64,
}

impl Plan {
    /// `None` for triangles that stand upright.
    fn new(part: &Part, t: u32) -> Option<Self> {
        let indices = part.mesh.triangles()[t as usize];
        let at = |k: usize| {
            let p = part.mesh.vertices()[indices[k] as usize];
            [p.x, p.y]
        };
        let edges = [0, 1, 2].map(|k| {
            let (a, b) = ((k + 1) % 3, (k + 2) % 3);
            if indices[a] < indices[b] { (at(a), at(b), 1.0) } else { (at(b), at(a), -1.0) }
        });
        let [a, b, c] = [at(0), at(1), at(2)];
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        (area != 0.0).then_some(Self { edges, area })
    }

    fn weights(&self, x: f64, y: f64) -> [f64; 3] {
        let turn = self.area.signum();
        self.edges.map(|(p, q, sign)| sign * turn * ((q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0])))
    }

    /// Barycentric coordinates of a point of the triangle, border included; `None` outside.
    fn barycentric(&self, x: f64, y: f64) -> Option<[f64; 3]> {
        let w = self.weights(x, y);
        let sum = w[0] + w[1] + w[2];
        (w.iter().all(|&w| w >= 0.0) && sum > 0.0).then(|| w.map(|w| w / sum))
    }

    /// Barycentric coordinates of a point that may lie outside by a little.
    fn clamped_barycentric(&self, x: f64, y: f64) -> [f64; 3] {
        let w = self.weights(x, y).map(|w| w.max(0.0));
        let sum = w[0] + w[1] + w[2];
        if sum > 0.0 { w.map(|w| w / sum) } else { [1.0 / 3.0; 3] }
    }

    /// The columns of a row at `y` that the triangle can touch, one more on each side.
    fn narrow(&self, lines: &Lines, y: f64, [i0, i1]: [usize; 2]) -> [usize; 2] {
        let (mut lo, mut hi) = (f64::INFINITY, f64::NEG_INFINITY);
        for (p, q, _) in &self.edges {
            let crosses = (p[1] <= y && q[1] >= y) || (q[1] <= y && p[1] >= y);
            if !crosses {
                continue;
            }
            let rise = q[1] - p[1];
            let t = if rise == 0.0 { 0.0 } else { ((y - p[1]) / rise).clamp(0.0, 1.0) };
            let x = p[0] + t * (q[0] - p[0]);
            let level = rise == 0.0;
            lo = lo.min(x).min(if level { q[0] } else { x });
            hi = hi.max(x).max(if level { q[0] } else { x });
        }
        if lo > hi {
            return [i0, i0];
        }
        let from = ((lo - lines.origin.x) / lines.cell - 1.0).floor().max(i0 as f64) as usize;
        let to = (((hi - lines.origin.x) / lines.cell + 2.0).ceil().max(0.0)).min(i1 as f64) as usize;
        [from.min(i1), to.max(from.min(i1))]
    }
}

fn min3([a, b, c]: [f64; 3]) -> f64 {
    a.min(b).min(c)
}

fn max3([a, b, c]: [f64; 3]) -> f64 {
    a.max(b).max(c)
}

/// For each band of rows the triangles that may touch it, in ascending order.
struct Bands {
    /// Where each band's triangles begin in `triangles`, and the end.
    starts: Vec<usize>,
    triangles: Vec<u32>,
}

impl Bands {
    fn new(part: &Part, grid: &SurfaceGrid) -> Self {
        let lines = Lines { origin: grid.origin, cell: grid.cell };
        let touched = |t: usize| {
            let ys = part.mesh.corners(t).map(|c| c.y);
            let [j0, j1] = lines.rows(min3(ys), max3(ys), 0, grid.ny)?;
            Some(j0 / BAND_ROWS..(j1 - 1) / BAND_ROWS + 1)
        };
        let count = part.mesh.triangles().len();
        let mut starts = vec![0; grid.ny.div_ceil(BAND_ROWS) + 1];
        for band in (0..count).filter_map(touched).flatten() {
            starts[band + 1] += 1;
        }
        for band in 1..starts.len() {
            starts[band] += starts[band - 1];
        }
        let mut next = starts.clone();
        let mut triangles = vec![0; starts[starts.len() - 1]];
        for t in 0..count {
            for band in touched(t).into_iter().flatten() {
                triangles[next[band]] = t as u32;
                next[band] += 1;
            }
        }
        Self { starts, triangles }
    }

    fn of(&self, band: usize) -> &[u32] {
        &self.triangles[self.starts[band]..self.starts[band + 1]]
    }
}
