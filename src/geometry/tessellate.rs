//! Triangles inscribed in a parametric surface, within a tolerance.
//!
//! Enters: a surface's jet, the parameter lines that must be kept (its domain and creases), a
//! tolerance in mm. Leaves: triangles whose corners lie on the surface, the parameters of each
//! corner, and how far surface and triangles lie apart. The parameter rectangle is cut by lines of
//! both families whose density follows the surface's second derivatives; what comes out is then
//! measured and refined until the measured distance holds.
//!
//! Density: over a triangle with sides hᵤ and hᵥ the distance is at most
//! ⅛(hᵤ²|S_uu·n| + 2hᵤhᵥ|S_uv·n| + hᵥ²|S_vv·n|), and with 2hᵤhᵥ ≤ a hᵤ² + hᵥ²/a each direction gets
//! its own share: hᵤ²(|S_uu·n| + a|S_uv·n|) ≤ 4ε. On the borders, where no neighbour covers what a
//! straight edge cuts off, the whole curvature of the border counts and not its normal part alone.

use super::{Jet2, Point3, Vector3, distance_to_segment};
use work::parallel;

/// Greatest number of triangles of one tessellation. More costs gigabytes and seconds where a
/// somewhat coarser search mesh would serve as well; fewer refuses large parts.
pub const MAX_TRIANGLES: usize = 2_000_000;

/// By how much the measured distance is raised before it is reported: edge midpoints and centroids
/// miss at most 3 % of a quadratic surface's greatest distance, the rest is for what is not quadratic.
const SAFETY: f64 = 1.25;

/// Sample strips a direction in which second derivatives are looked at, at least this many in all and
/// [`STRIPS_PER_SPAN`] between two kept lines. More cost time; fewer miss bumps between samples.
const STRIPS: usize = 64;
/// See [`STRIPS`].
const STRIPS_PER_SPAN: usize = 4;

/// A strip's second derivative counts at least as this share of the greatest one, so that flat
/// regions beside curved ones do not get cells so long that a bump hides in them.
const LEAST_SHARE: f64 = 0.01;

/// Longest mean side of the cells over the shortest. Longer saves triangles on cylinders and gives
/// search trees poor boxes.
const LONGEST_ASPECT: f64 = 8.0;

/// Border points nearer than this, mm, are one point (poles and closed seams); far out the rounding
/// of coordinates is added. Greater closes real gaps, less leaves poles open by rounding.
const WELD: f64 = 1.0e-9;

/// Triangles with an area below this share of their longest side squared are left out.
const LEAST_HEIGHT: f64 = 1.0e-9;

/// Triangles inscribed in a parametric surface.
#[derive(Debug, Clone, PartialEq)]
pub struct Tessellation {
    /// Points on the surface, mm. At a pole or a closed seam several vertices with different
    /// parameters have the very same coordinates, so that merging equal ones closes it.
    pub vertices: Vec<Point3>,
    /// Parameters of each vertex.
    pub parameters: Vec<[f64; 2]>,
    /// Vertex indices, counter-clockwise about `du × dv`; none is degenerate.
    pub triangles: Vec<[u32; 3]>,
    /// Bound of the distance between triangles and surface, mm: the greatest one measured and a
    /// quarter of it.
    pub deviation: f64,
}

/// Why a surface was not tessellated.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum TessellateError {
    /// The tolerance is not a positive number.
    #[error("the tessellation tolerance is {0} mm; it must be a positive number")]
    Tolerance(f64),
    /// The parameter lines do not span a rectangle.
    #[error("the parameter range is empty")]
    Domain,
    /// More triangles are needed than allowed.
    #[error(
        "a tolerance of {tolerance} mm would need about {needed} triangles, and {MAX_TRIANGLES} are allowed; \
         use a greater tolerance, or a smoother surface with fewer control points"
    )]
    TooMany {
        /// What was asked for, mm.
        tolerance: f64,
        /// Triangles it takes.
        needed: u64,
    },
    /// The surface has no area.
    #[error("the surface has no area: all its points lie on a line or in one point")]
    NoArea,
}

/// Tessellates a surface within `tolerance`, mm. `lines` holds for u and v the ascending
/// parameters at which triangles must end: at least the two ends of the domain, and every parameter
/// where the surface may have a crease or where a new undulation begins.
///
/// # Tolerance
/// The distance is measured at edge midpoints and centroids and raised by a quarter; the lines are
/// refined until that is at most `tolerance`.
///
/// # Errors
/// See [`TessellateError`].
pub fn tessellate(
    jet: &(dyn Fn(f64, f64) -> Jet2 + Sync),
    lines: [&[f64]; 2],
    tolerance: f64,
) -> Result<Tessellation, TessellateError> {
    if !(tolerance > 0.0 && tolerance.is_finite()) {
        return Err(TessellateError::Tolerance(tolerance));
    }
    if lines
        .iter()
        .any(|l| l.len() < 2 || l.windows(2).any(|w| w[0].is_nan() || w[1].is_nan() || w[0] >= w[1]))
    {
        return Err(TessellateError::Domain);
    }
    let density = Density::of(jet, lines);
    let (mut refine, mut least, mut before) = (1.0, 1, 0.0);
    loop {
        let [us, vs] = density.lines(tolerance / SAFETY, refine, least);
        let needed = 2.0 * (us.len as f64 * vs.len as f64);
        if needed > MAX_TRIANGLES as f64 {
            return Err(TessellateError::TooMany { tolerance, needed: needed as u64 });
        }
        let net = Net::new(jet, us.place(), vs.place());
        let deviation = SAFETY * net.measure(jet) + net.rounding();
        if deviation <= tolerance {
            return net.triangulate(deviation);
        }
        // Where second derivatives say nothing, the number of lines itself has to grow.
        least *= if needed > before { 1 } else { 2 };
        before = needed;
        // The distance falls with the square of the cell.
        refine *= (1.05 * (deviation / tolerance).sqrt()).clamp(1.1, 2.0);
    }
}

/// How dense the lines of both families must be.
struct Density {
    u: Family,
    v: Family,
}

/// One family of parameter lines.
struct Family {
    /// Kept lines, from one end of the domain to the other.
    kept: Vec<f64>,
    /// Strips between two kept lines.
    strips: usize,
    /// For each strip, the second derivative that the cell's square multiplies, mm.
    bend: Vec<f64>,
    /// Mean length of the curves across the lines of this family, mm.
    length: f64,
}

/// Lines to be placed: how many spaces between each pair of kept ones.
struct Placement<'a> {
    family: &'a Family,
    spaces: Vec<usize>,
    len: usize,
}

impl Family {
    fn new(kept: &[f64]) -> Self {
        let spans = kept.len() - 1;
        let strips = STRIPS.div_ceil(spans).max(STRIPS_PER_SPAN);
        Self { kept: kept.to_vec(), strips, bend: vec![0.0; spans * strips], length: 0.0 }
    }

    /// Ends of strip `s`.
    fn strip(&self, s: usize) -> [f64; 2] {
        let (span, k) = (s / self.strips, s % self.strips);
        let (a, b) = (self.kept[span], self.kept[span + 1]);
        let at = |k: usize| a + (b - a) * (k as f64 / self.strips as f64);
        [at(k), at(k + 1)]
    }

    /// A parameter inside strip `s`, at a place that changes from strip to strip (golden section): equal
    /// places can all fall on the inflections of a wave.
    fn sample(&self, s: usize) -> f64 {
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        let [a, b] = self.strip(s);
        a + (b - a) * (s as f64 * GOLDEN).fract()
    }

    /// Takes neighbours and the least share into account.
    fn settle(&mut self) {
        let greatest = self.bend.iter().copied().fold(0.0, f64::max);
        let raw = self.bend.clone();
        for s in 0..raw.len() {
            let around = &raw[s.saturating_sub(1)..(s + 2).min(raw.len())];
            self.bend[s] = around.iter().copied().fold(LEAST_SHARE * greatest, f64::max);
        }
    }

    /// Spaces needed over strip `s`.
    fn need(&self, s: usize, tolerance: f64) -> f64 {
        let [a, b] = self.strip(s);
        (b - a) * (self.bend[s] / (4.0 * tolerance)).sqrt()
    }

    fn placement(&self, tolerance: f64, factor: f64, least: usize) -> Placement<'_> {
        let spaces: Vec<usize> = (0..self.kept.len() - 1)
            .map(|span| {
                let strips = span * self.strips..(span + 1) * self.strips;
                let need: f64 = strips.map(|s| self.need(s, tolerance)).sum();
                // More than the limit fails later: keep the number countable.
                (factor * need).ceil().clamp(1.0, MAX_TRIANGLES as f64).max(least as f64) as usize
            })
            .collect();
        let len = spaces.iter().fold(0usize, |n, &k| n.saturating_add(k));
        Placement { family: self, spaces, len }
    }
}

impl Placement<'_> {
    /// The lines, with equal need between neighbours.
    fn place(&self) -> Vec<f64> {
        let family = self.family;
        let mut lines = vec![family.kept[0]];
        for (span, &spaces) in self.spaces.iter().enumerate() {
            let first = span * family.strips;
            let needs: Vec<f64> = (first..first + family.strips).map(|s| family.need(s, 1.0)).collect();
            let total: f64 = needs.iter().sum();
            let (mut s, mut passed) = (0, 0.0);
            for k in 1..spaces {
                let share = k as f64 / spaces as f64;
                if total > 0.0 {
                    while s + 1 < needs.len() && passed + needs[s] < share * total {
                        passed += needs[s];
                        s += 1;
                    }
                    let [a, b] = family.strip(first + s);
                    lines.push(a + (b - a) * ((share * total - passed) / needs[s]).clamp(0.0, 1.0));
                } else {
                    lines.push(family.kept[span] + share * (family.kept[span + 1] - family.kept[span]));
                }
            }
            lines.push(family.kept[span + 1]);
        }
        lines
    }
}

impl Density {
    fn of(jet: &(dyn Fn(f64, f64) -> Jet2 + Sync), lines: [&[f64]; 2]) -> Self {
        let [mut u, mut v] = lines.map(Family::new);
        let (nu, nv) = (u.bend.len(), v.bend.len());
        let rows =
            parallel::map(nu, |i| -> Vec<Jet2> { (0..nv).map(|j| jet(u.sample(i), v.sample(j))).collect() });
        let mean = |f: &dyn Fn(&Jet2) -> f64| rows.iter().flatten().map(f).sum::<f64>() / (nu * nv) as f64;
        u.length = mean(&|j| j.du.norm()) * (u.kept[u.kept.len() - 1] - u.kept[0]);
        v.length = mean(&|j| j.dv.norm()) * (v.kept[v.kept.len() - 1] - v.kept[0]);
        let (du, dv) = (mean(&|j| j.du.norm()), mean(&|j| j.dv.norm()));
        let share = if du > 0.0 && dv > 0.0 { du / dv } else { 1.0 };
        for (i, row) in rows.iter().enumerate() {
            for (j, at) in row.iter().enumerate() {
                let [uu, uv, vv] = normal_parts(at);
                u.bend[i] = u.bend[i].max(uu + share * uv);
                v.bend[j] = v.bend[j].max(vv + uv / share);
            }
        }
        let ends = |f: &Family| [f.kept[0], f.kept[f.kept.len() - 1]];
        for v_end in ends(&v) {
            for i in 0..nu {
                let at = jet(u.sample(i), v_end);
                u.bend[i] = u.bend[i].max(across(&at.du, &at.duu));
            }
        }
        for u_end in ends(&u) {
            for j in 0..nv {
                let at = jet(u_end, v.sample(j));
                v.bend[j] = v.bend[j].max(across(&at.dv, &at.dvv));
            }
        }
        u.settle();
        v.settle();
        Self { u, v }
    }

    /// Lines for a tolerance, `refine` times denser than the formula says, at least so many between two kept
    /// ones, and no cells much longer than wide.
    fn lines(&self, tolerance: f64, refine: f64, least: usize) -> [Placement<'_>; 2] {
        let [u, v] = [&self.u, &self.v].map(|family| family.placement(tolerance, refine, least));
        let (long_u, long_v) = (self.u.length / u.len as f64, self.v.length / v.len as f64);
        let slender = |long: f64, short: f64| {
            // A direction without any length is not worth dividing the other one for.
            if short > 0.0 { (long / (LONGEST_ASPECT * short)).max(1.0) } else { 1.0 }
        };
        let denser = |p: Placement<'_>, by: f64| -> Vec<usize> {
            p.spaces.iter().map(|&n| (n as f64 * by).ceil().min(MAX_TRIANGLES as f64) as usize).collect()
        };
        let make = |family, spaces: Vec<usize>| {
            let len = spaces.iter().fold(0usize, |n, &k| n.saturating_add(k));
            Placement { family, spaces, len }
        };
        let (by_u, by_v) = (slender(long_u, long_v), slender(long_v, long_u));
        [make(&self.u, denser(u, by_u)), make(&self.v, denser(v, by_v))]
    }
}

/// Sizes of the second derivatives' normal parts; the whole sizes where there is no normal.
fn normal_parts(jet: &Jet2) -> [f64; 3] {
    match jet.normal() {
        Some(n) => [jet.duu, jet.duv, jet.dvv].map(|d| d.dot(&n).abs()),
        None => [jet.duu, jet.duv, jet.dvv].map(|d| d.norm()),
    }
}

/// The part of a curve's second derivative across its first.
fn across(first: &Vector3, second: &Vector3) -> f64 {
    let square = first.norm_squared();
    if square > 0.0 { (second - first * (second.dot(first) / square)).norm() } else { second.norm() }
}

/// The surface's points where lines cross.
struct Net {
    us: Vec<f64>,
    vs: Vec<f64>,
    /// `[along u][along v]`.
    points: Vec<Point3>,
}

impl Net {
    fn new(jet: &(dyn Fn(f64, f64) -> Jet2 + Sync), us: Vec<f64>, vs: Vec<f64>) -> Self {
        let columns =
            parallel::map(us.len(), |i| -> Vec<Point3> { vs.iter().map(|&v| jet(us[i], v).p).collect() });
        Self { points: columns.concat(), us, vs }
    }

    fn index(&self, i: usize, j: usize) -> usize {
        i * self.vs.len() + j
    }

    /// The two triangles of cell `(i, j)` as corners `(i, j)` of the net, about `du × dv`. The
    /// shorter diagonal divides the cell.
    fn cell(&self, i: usize, j: usize) -> [[(usize, usize); 3]; 2] {
        let [a, b, c, d] = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
        let length = |p: (usize, usize), q: (usize, usize)| {
            (self.points[self.index(p.0, p.1)] - self.points[self.index(q.0, q.1)]).norm_squared()
        };
        if length(a, c) <= length(b, d) { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] }
    }

    fn parameters(&self, (i, j): (usize, usize)) -> [f64; 2] {
        [self.us[i], self.vs[j]]
    }

    /// How far rounding may move any point, mm.
    fn rounding(&self) -> f64 {
        8.0 * f64::EPSILON * self.points.iter().fold(0.0, |m: f64, p| m.max(p.coords.amax()))
    }

    /// Greatest distance found between triangles and surface, mm.
    fn measure(&self, jet: &(dyn Fn(f64, f64) -> Jet2 + Sync)) -> f64 {
        let columns = parallel::map(self.us.len() - 1, |i| {
            let mut worst: f64 = 0.0;
            for j in 0..self.vs.len() - 1 {
                let triangles = self.cell(i, j);
                let normals = triangles.map(|corners| self.normal(corners));
                for (k, corners) in triangles.into_iter().enumerate() {
                    // What a triangle without area stands for lies on the cell's other one.
                    worst = worst.max(self.measure_triangle(jet, corners, normals[k].or(normals[1 - k])));
                }
            }
            worst
        });
        columns.into_iter().fold(0.0, f64::max)
    }

    fn normal(&self, corners: [(usize, usize); 3]) -> Option<Vector3> {
        let p = corners.map(|(i, j)| self.points[self.index(i, j)]);
        (!is_degenerate(&p)).then(|| (p[1] - p[0]).cross(&(p[2] - p[0])).normalize())
    }

    fn measure_triangle(
        &self,
        jet: &(dyn Fn(f64, f64) -> Jet2 + Sync),
        corners: [(usize, usize); 3],
        normal: Option<Vector3>,
    ) -> f64 {
        let p = corners.map(|(i, j)| self.points[self.index(i, j)]);
        let q = corners.map(|c| self.parameters(c));
        let mut worst: f64 = 0.0;
        for k in 0..3 {
            let (a, b) = (k, (k + 1) % 3);
            let on_surface = jet(0.5 * (q[a][0] + q[b][0]), 0.5 * (q[a][1] + q[b][1])).p;
            let border = self.on_border(corners[a], corners[b]);
            worst = worst.max(match normal {
                Some(n) if !border => (on_surface - p[a]).dot(&n).abs(),
                _ => distance_to_segment(&on_surface, &p[a], &p[b]),
            });
        }
        if let Some(n) = normal {
            let third = |c: usize| (q[0][c] + q[1][c] + q[2][c]) / 3.0;
            worst = worst.max((jet(third(0), third(1)).p - p[0]).dot(&n).abs());
        }
        worst
    }

    /// True where both ends lie on the same border of the domain.
    fn on_border(&self, a: (usize, usize), b: (usize, usize)) -> bool {
        let (last_u, last_v) = (self.us.len() - 1, self.vs.len() - 1);
        (a.0 == b.0 && (a.0 == 0 || a.0 == last_u)) || (a.1 == b.1 && (a.1 == 0 || a.1 == last_v))
    }

    /// Gives the points of poles and closed seams, which differ by rounding, equal coordinates.
    fn weld(&mut self) {
        let (nu, nv) = (self.us.len(), self.vs.len());
        let near = |points: &[Point3], a: usize, b: usize| {
            (points[a] - points[b]).norm() <= WELD + 1.0e-14 * points[a].coords.amax()
        };
        let column = |i: usize| -> Vec<usize> { (0..nv).map(|j| i * nv + j).collect() };
        let row = |j: usize| -> Vec<usize> { (0..nu).map(|i| i * nv + j).collect() };
        for [first, last] in [[column(0), column(nu - 1)], [row(0), row(nv - 1)]] {
            for border in [&first, &last] {
                if border.iter().all(|&k| near(&self.points, border[0], k)) {
                    border.iter().for_each(|&k| self.points[k] = self.points[border[0]]);
                }
            }
            if first.iter().zip(&last).all(|(&a, &b)| near(&self.points, a, b)) {
                first.iter().zip(&last).for_each(|(&a, &b)| self.points[b] = self.points[a]);
            }
        }
    }

    fn triangulate(mut self, deviation: f64) -> Result<Tessellation, TessellateError> {
        self.weld();
        let mut triangles = Vec::with_capacity(2 * self.points.len());
        for i in 0..self.us.len() - 1 {
            for j in 0..self.vs.len() - 1 {
                for corners in self.cell(i, j) {
                    let at = corners.map(|(i, j)| self.index(i, j));
                    if !is_degenerate(&at.map(|k| self.points[k])) {
                        triangles.push(at.map(|k| k as u32));
                    }
                }
            }
        }
        if triangles.is_empty() {
            return Err(TessellateError::NoArea);
        }
        let parameters = self.us.iter().flat_map(|&u| self.vs.iter().map(move |&v| [u, v])).collect();
        Ok(Tessellation { vertices: self.points, parameters, triangles, deviation })
    }
}

/// True for triangles whose height is nothing against their longest side.
fn is_degenerate([a, b, c]: &[Point3; 3]) -> bool {
    let longest = (b - a).norm_squared().max((c - b).norm_squared()).max((a - c).norm_squared());
    (b - a).cross(&(c - a)).norm() <= LEAST_HEIGHT * longest
}

#[cfg(test)]
mod tests;
