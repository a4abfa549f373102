//! Level curves of a scalar field on a parameter rectangle, traced by arc length on the surface.
//!
//! A coarse grid finds every component of a level curve (marching squares); each component is then
//! traced by the classical Runge–Kutta method of fourth order along `(ψ_v, −ψ_u)`, scaled to unit
//! speed on the surface, and pulled back onto the level after each step. Tracing by arc length has
//! no trouble where the curve runs along v (dv/du infinite).

use super::scalar::ScalarField;

/// One component of a level curve, in parameters, about `step` apart on the surface.
#[derive(Debug, Clone, PartialEq)]
pub struct LevelCurve {
    /// Points `[u, v]`; all lie on the level to rounding.
    pub points: Vec<[f64; 2]>,
    /// True when the last point leads back to the first.
    pub closed: bool,
}

/// A traced curve whose length differs from that of its marching-squares chain by more than this
/// factor has jumped to another branch; the chain's own points are used instead. Less would refuse
/// honest traces on coarse grids.
const LENGTH_RATIO: f64 = 1.3;

/// Finds and traces the level curves of one field.
pub struct LevelTracer<'a> {
    field: &'a ScalarField,
    /// First fundamental form `(E, F, G)` at `(u, v)`.
    metric: &'a (dyn Fn(f64, f64) -> (f64, f64, f64) + Sync),
    /// Where the field is given; beyond it is continued linearly.
    inner: [[f64; 2]; 2],
    /// Where curves are traced.
    domain: [[f64; 2]; 2],
    cells: usize,
    /// ψ at the grid's nodes, `[cells + 1][cells + 1]`.
    values: Vec<f64>,
    step: f64,
    /// Whether traced points are pulled back onto their level.
    pulled: bool,
}

/// A step advances by about its own length; one that does not has come to a critical point, or its
/// level was found on another branch.
const LEAST_ADVANCE: f64 = 0.3;
const MOST_ADVANCE: f64 = 2.0;

/// A grid edge, by its lower node and direction (0 along u, 1 along v).
type Edge = (usize, usize);

impl<'a> LevelTracer<'a> {
    /// Prepares a grid of `cells` × `cells` over `inner` grown by `margins` on both sides, and traces
    /// with steps of `step` mm. A component that passes through no grid edge is not found.
    pub fn new(
        field: &'a ScalarField,
        metric: &'a (dyn Fn(f64, f64) -> (f64, f64, f64) + Sync),
        inner: [[f64; 2]; 2],
        margins: [f64; 2],
        cells: usize,
        step: f64,
    ) -> Self {
        let domain = [0, 1].map(|c| [inner[c][0] - margins[c], inner[c][1] + margins[c]]);
        let mut tracer = Self {
            field,
            metric,
            inner,
            domain,
            cells: cells.max(1),
            values: Vec::new(),
            step,
            pulled: true,
        };
        let n = tracer.cells + 1;
        tracer.values = (0..n * n).map(|k| tracer.value_and_gradient(tracer.node(k))[0]).collect();
        tracer
    }

    /// The same, but what it traces is the streamline through the first point of each component, by
    /// Runge–Kutta steps that nothing pulls onto the level.
    pub fn by_steps_alone(self) -> Self {
        Self { pulled: false, ..self }
    }

    /// The place at a share of the way from a traced point to the next one: on the level, or by one shorter
    /// step.
    pub fn between(&self, [a, b]: [[f64; 2]; 2], share: f64, level: f64) -> [f64; 2] {
        let way = [b[0] - a[0], b[1] - a[1]];
        let line = [a[0] + share * way[0], a[1] + share * way[1]];
        if self.pulled {
            return self.onto_level(line, level);
        }
        let backward = self.direction(a).is_some_and(|d| d[0] * way[0] + d[1] * way[1] < 0.0);
        let length = share * self.distance(a, b);
        self.step(a, if backward { -length } else { length }).unwrap_or(line)
    }

    /// Least and greatest ψ over a grid on the domain without its margins.
    pub fn range(&self) -> [f64; 2] {
        let at = |[lo, hi]: [f64; 2], k: usize| lo + (hi - lo) * k as f64 / self.cells as f64;
        let n = self.cells + 1;
        let values = (0..n * n)
            .map(|k| self.field.value_and_gradient(at(self.inner[0], k % n), at(self.inner[1], k / n))[0]);
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], psi| [lo.min(psi), hi.max(psi)])
    }

    /// `[ψ, ψ_u, ψ_v]`; in the margins the tangent plane at the nearest border point continues ψ.
    fn value_and_gradient(&self, p: [f64; 2]) -> [f64; 3] {
        let q = [0, 1].map(|c| p[c].clamp(self.inner[c][0], self.inner[c][1]));
        let [value, gu, gv] = self.field.value_and_gradient(q[0], q[1]);
        [value + gu * (p[0] - q[0]) + gv * (p[1] - q[1]), gu, gv]
    }

    /// All components of `ψ = level`, in a fixed order.
    pub fn curves(&self, level: f64) -> Vec<LevelCurve> {
        self.chains(level)
            .into_iter()
            .filter(|chain| chain.points.len() >= 2)
            .map(|chain| {
                let length = self.length(&chain);
                let longest = LENGTH_RATIO * length + 2.0 * self.step;
                let traced = self.trace(&chain, level, longest);
                let honest = |curve: &LevelCurve| {
                    let traced = self.length(curve);
                    traced < longest && length < LENGTH_RATIO * traced + 2.0 * self.step
                };
                traced.filter(honest).unwrap_or(chain)
            })
            .filter(|curve| curve.points.len() >= 2)
            .collect()
    }

    /// Moves `[u, v]` along the gradient onto the level, by Newton's method.
    pub fn onto_level(&self, mut p: [f64; 2], level: f64) -> [f64; 2] {
        for _ in 0..4 {
            let [value, gu, gv] = self.value_and_gradient(p);
            let square = gu * gu + gv * gv;
            if square == 0.0 {
                break;
            }
            let t = (level - value) / square;
            p = self.clamp([p[0] + t * gu, p[1] + t * gv]);
        }
        p
    }

    /// Unit surface tangent along the level curve, in parameters; `None` at a critical point.
    pub fn direction(&self, p: [f64; 2]) -> Option<[f64; 2]> {
        let [_, gu, gv] = self.value_and_gradient(p);
        let (e, f, g) = (self.metric)(p[0], p[1]);
        let length = (e * gv * gv - 2.0 * f * gu * gv + g * gu * gu).max(0.0).sqrt();
        (length > 1e-300 && length.is_finite()).then(|| [gv / length, -gu / length])
    }

    fn node(&self, k: usize) -> [f64; 2] {
        let n = self.cells + 1;
        let at = |[lo, hi]: [f64; 2], i: usize| lo + (hi - lo) * i as f64 / self.cells as f64;
        [at(self.domain[0], k % n), at(self.domain[1], k / n)]
    }

    fn clamp(&self, p: [f64; 2]) -> [f64; 2] {
        let [[u0, u1], [v0, v1]] = self.domain;
        [p[0].clamp(u0, u1), p[1].clamp(v0, v1)]
    }

    fn inside(&self, p: [f64; 2]) -> bool {
        self.clamp(p) == p
    }

    /// Surface length between neighbouring parameters, mm.
    pub fn distance(&self, a: [f64; 2], b: [f64; 2]) -> f64 {
        let (e, f, g) = (self.metric)(0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]));
        let (du, dv) = (b[0] - a[0], b[1] - a[1]);
        (e * du * du + 2.0 * f * du * dv + g * dv * dv).max(0.0).sqrt()
    }

    fn length(&self, curve: &LevelCurve) -> f64 {
        let open: f64 = curve.points.windows(2).map(|w| self.distance(w[0], w[1])).sum();
        match (curve.closed, curve.points.first(), curve.points.last()) {
            (true, Some(&first), Some(&last)) => open + self.distance(last, first),
            _ => open,
        }
    }

    /// One RK4 step of arc length `h` (its sign is the sense); `None` at a critical point.
    fn step(&self, p: [f64; 2], h: f64) -> Option<[f64; 2]> {
        let at = |k: [f64; 2], t: f64| [p[0] + t * k[0], p[1] + t * k[1]];
        let k1 = self.direction(p)?;
        let k2 = self.direction(at(k1, 0.5 * h))?;
        let k3 = self.direction(at(k2, 0.5 * h))?;
        let k4 = self.direction(at(k3, h))?;
        let mean = |c: usize| (k1[c] + 2.0 * k2[c] + 2.0 * k3[c] + k4[c]) / 6.0;
        Some([p[0] + h * mean(0), p[1] + h * mean(1)])
    }

    /// Traces from the first point of a chain toward the second, until the domain's border or the beginning
    /// is reached again; `None` where that takes `longest` mm or more.
    fn trace(&self, chain: &LevelCurve, level: f64, longest: f64) -> Option<LevelCurve> {
        let (next, closed) = (chain.points[1], chain.closed);
        let seed = self.seed(chain.points[0], level);
        let mut points = vec![seed];
        let sense = match self.direction(seed) {
            Some(d) if d[0] * (next[0] - seed[0]) + d[1] * (next[1] - seed[1]) < 0.0 => -1.0,
            _ => 1.0,
        };
        let (mut travelled, mut length) = (0.0, 0.0);
        loop {
            let p = points[points.len() - 1];
            let Some(q) = self.step(p, sense * self.step) else { break };
            if !self.inside(q) {
                points.push(self.leave(p, q, level));
                break;
            }
            let q = if self.pulled { self.onto_level(q, level) } else { q };
            let advance = self.distance(p, q);
            let advanced = advance / self.step;
            if !(LEAST_ADVANCE..MOST_ADVANCE).contains(&advanced) {
                break;
            }
            travelled += self.step;
            length += advance;
            if length >= longest {
                return None;
            }
            if closed && travelled > 3.0 * self.step && self.distance(q, seed) < 0.75 * self.step {
                break;
            }
            points.push(q);
        }
        Some(LevelCurve { points, closed })
    }

    /// Where the level curve from `p` (inside) to `q` (outside) crosses the border: the point of
    /// that border line with ψ = level.
    fn leave(&self, p: [f64; 2], q: [f64; 2], level: f64) -> [f64; 2] {
        let mut t = 1.0;
        let mut axis = 0;
        for c in 0..2 {
            let border = q[c].clamp(self.domain[c][0], self.domain[c][1]);
            if border != q[c] {
                let here = (border - p[c]) / (q[c] - p[c]);
                if here <= t {
                    (t, axis) = (here, c);
                }
            }
        }
        let mut r = self.clamp([p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])]);
        r[axis] = q[axis].clamp(self.domain[axis][0], self.domain[axis][1]);
        // A curve that runs nearly along the border is left where the step ended.
        let most = (q[0] - p[0]).abs() + (q[1] - p[1]).abs();
        self.along_border(r, 1 - axis, level, most)
    }

    /// Moves a place along a border, in one parameter, onto the level, by Newton's method in steps of at most
    /// `most`.
    fn along_border(&self, mut r: [f64; 2], along: usize, level: f64, most: f64) -> [f64; 2] {
        for _ in 0..4 {
            let values = self.value_and_gradient(r);
            let slope = values[1 + along];
            let step = (level - values[0]) / slope;
            if slope == 0.0 || step.abs() > most {
                break;
            }
            r[along] += step;
        }
        self.clamp(r)
    }

    /// Where a chain's curve begins: on the level, and on the border where an open chain does.
    fn seed(&self, first: [f64; 2], level: f64) -> [f64; 2] {
        let on_border = (0..2).find(|&c| self.domain[c].contains(&first[c]));
        let Some(across) = on_border else { return self.onto_level(first, level) };
        let along = 1 - across;
        let [lo, hi] = self.domain[along];
        self.along_border(first, along, level, (hi - lo) / self.cells as f64)
    }

    /// Marching squares: chains of crossing points, open ones (border to border) first.
    fn chains(&self, level: f64) -> Vec<LevelCurve> {
        let n = self.cells + 1;
        let crosses = |(k, d): Edge| {
            let other = if d == 0 { k + 1 } else { k + n };
            (self.values[k] >= level) != (self.values[other] >= level)
        };
        let mut seen = vec![[false; 2]; n * n];
        let mut chains = Vec::new();
        for open in [true, false] {
            for k in 0..n * n {
                let (i, j) = (k % n, k / n);
                for d in 0..2 {
                    let exists = if d == 0 { i + 1 < n } else { j + 1 < n };
                    let on_border = if d == 0 { j == 0 || j + 1 == n } else { i == 0 || i + 1 == n };
                    if exists && on_border == open && !seen[k][d] && crosses((k, d)) {
                        let edges = self.walk((k, d), open, level, &crosses, &mut seen);
                        let points = edges.iter().map(|&e| self.crossing(e, level)).collect();
                        chains.push(LevelCurve { points, closed: !open });
                    }
                }
            }
        }
        chains
    }

    /// Follows crossing edges from cell to cell.
    fn walk(
        &self,
        start: Edge,
        open: bool,
        level: f64,
        crosses: &impl Fn(Edge) -> bool,
        seen: &mut [[bool; 2]],
    ) -> Vec<Edge> {
        let n = self.cells + 1;
        let (i, j) = (start.0 % n, start.0 / n);
        // The first cell: above or right of the edge, else (on the far border) below or left.
        let mut cell = match start.1 {
            0 if j + 1 == n => Some((i, j - 1)),
            1 if i + 1 == n => Some((i - 1, j)),
            _ => Some((i, j)),
        };
        let mut edges = vec![start];
        seen[start.0][start.1] = true;
        while let Some((ci, cj)) = cell {
            let from = edges[edges.len() - 1];
            let Some(next) = self.partner(from, (ci, cj), level, crosses) else { break };
            if seen[next.0][next.1] {
                break;
            }
            seen[next.0][next.1] = true;
            edges.push(next);
            let (ni, nj) = (next.0 % n, next.0 / n);
            cell = match next.1 {
                0 if nj == cj => (cj > 0).then(|| (ci, cj - 1)),
                0 => (nj + 1 < n).then_some((ci, nj)),
                _ if ni == ci => (ci > 0).then(|| (ci - 1, cj)),
                _ => (ni + 1 < n).then_some((ni, cj)),
            };
        }
        debug_assert!(!open || edges.len() >= 2);
        edges
    }

    /// The edge through which a curve that enters `cell` by `from` leaves it. At a saddle (four
    /// crossings) the mean of the corners decides which corner is cut off.
    fn partner(
        &self,
        from: Edge,
        (i, j): (usize, usize),
        level: f64,
        crosses: &impl Fn(Edge) -> bool,
    ) -> Option<Edge> {
        let n = self.cells + 1;
        let k = j * n + i;
        // Counter-clockwise: bottom, right, top, left.
        let sides: [Edge; 4] = [(k, 0), (k + 1, 1), (k + n, 0), (k, 1)];
        let at = sides.iter().position(|&s| s == from)?;
        let others: Vec<usize> = (1..4).map(|o| (at + o) % 4).filter(|&s| crosses(sides[s])).collect();
        if others.len() < 3 {
            return others.first().map(|&s| sides[s]);
        }
        let corners = [k, k + 1, k + n + 1, k + n].map(|c| self.values[c] >= level);
        let mean = 0.25 * [k, k + 1, k + n, k + n + 1].iter().map(|&c| self.values[c]).sum::<f64>();
        // Side s runs from corner s to corner s + 1. If the corner at its end belongs to the middle,
        // the curve cuts off the corner at its start, which side s - 1 shares.
        let end_with_middle = corners[(at + 1) % 4] == (mean >= level);
        Some(sides[if end_with_middle { (at + 3) % 4 } else { (at + 1) % 4 }])
    }

    fn crossing(&self, (k, d): Edge, level: f64) -> [f64; 2] {
        let other = if d == 0 { k + 1 } else { k + self.cells + 1 };
        let (a, b) = (self.values[k], self.values[other]);
        let t = ((level - a) / (b - a)).clamp(0.0, 1.0);
        let (p, q) = (self.node(k), self.node(other));
        [p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])]
    }
}

#[cfg(test)]
mod tests {
    use super::super::fit::NormalEquations;
    use super::super::scalar::Axis;
    use super::*;
    use geometry::KnotVector;

    const SQUARE: [[f64; 2]; 2] = [[-1.0, 1.0], [-1.0, 1.0]];

    fn flat(_: f64, _: f64) -> (f64, f64, f64) {
        (1.0, 0.0, 1.0)
    }

    /// A bicubic spline that reproduces a polynomial of degree 3 in each parameter.
    fn spline(f: impl Fn(f64, f64) -> f64) -> ScalarField {
        let knots = KnotVector::clamped_uniform(3, 6, [-1.0, 1.0]).unwrap();
        let mut equations = NormalEquations::new(knots.clone(), knots);
        for j in 0..=24 {
            for i in 0..=24 {
                let (u, v) = (i as f64 / 12.0 - 1.0, j as f64 / 12.0 - 1.0);
                equations.add(u, v, &[[1.0, 0.0, 0.0], [0.0; 3], [0.0; 3]], f(u, v), 1.0);
            }
        }
        ScalarField::Spline(equations.solve(false).unwrap())
    }

    #[test]
    fn circles_close_and_keep_their_radius() {
        let field = spline(|x, y| x * x + y * y);
        let tracer = LevelTracer::new(&field, &flat, SQUARE, [0.0; 2], 40, 0.02);
        let curves = tracer.curves(0.25);
        assert_eq!(curves.len(), 1);
        assert!(curves[0].closed);
        let worst = curves[0].points.iter().map(|p| (p[0].hypot(p[1]) - 0.5).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-9, "{worst}");
        let around = tracer.length(&curves[0]);
        assert!((around / std::f64::consts::PI - 1.0).abs() < 1e-3, "{around}");
        // A level that leaves the square: four arcs.
        assert_eq!(tracer.curves(1.5).len(), 4);
    }

    #[test]
    fn runge_kutta_alone_is_of_fourth_order() {
        let field = spline(|x, y| x * x + y * y);
        let error = |h: f64| {
            let tracer = LevelTracer::new(&field, &flat, SQUARE, [0.0; 2], 10, h);
            let mut p = [0.5, 0.0];
            for _ in 0..(1.0 / h).round() as usize {
                p = tracer.step(p, h).unwrap();
            }
            (p[0].hypot(p[1]) - 0.5).abs().max(1e-16)
        };
        let order = (error(0.1) / error(0.05)).log2();
        assert!(order > 3.7, "order {order}");
    }

    /// Once around a level of 31 mm on a surface that bends, by steps alone, no place is off it by as much as
    /// a chord tolerance.
    #[test]
    fn levels_and_traced_lines_agree() {
        let field = spline(|x, y| x * x + y * y + 0.3 * x * y * y);
        // z = sin(2 u) over 10 mm for each unit of u and v.
        let metric = |u: f64, _: f64| (100.0 + (2.0 * (2.0 * u).cos()).powi(2), 0.0, 100.0);
        let tracer = LevelTracer::new(&field, &metric, SQUARE, [0.0; 2], 40, 0.2);
        let level = field.value_and_gradient(0.5, 0.0)[0];
        let length = tracer.length(&tracer.curves(level)[0]);
        let (mut p, mut worst) = ([0.5, 0.0], 0.0f64);
        for _ in 0..(length / 0.2).ceil() as usize {
            p = tracer.step(p, 0.2).unwrap();
            worst = worst.max(tracer.distance(p, tracer.onto_level(p, level)));
        }
        let back = tracer.distance(p, [0.5, 0.0]);
        assert!(length > 30.0 && back < 0.2 && worst < 1e-5, "{length} {back} {worst}");
    }

    /// Whole lines without a pull, and places between their points, are as near to their level.
    #[test]
    fn lines_by_steps_alone_are_levels() {
        let field = spline(|x, y| x * x + y * y + 0.3 * x * y * y);
        let metric = |u: f64, _: f64| (100.0 + (2.0 * (2.0 * u).cos()).powi(2), 0.0, 100.0);
        let tracer = LevelTracer::new(&field, &metric, SQUARE, [0.0; 2], 40, 0.2);
        let level = field.value_and_gradient(0.5, 0.0)[0];
        let whole = tracer.curves(level);
        let alone = LevelTracer::new(&field, &metric, SQUARE, [0.0; 2], 40, 0.2).by_steps_alone();
        for level in [level, 1.6 * level, 5.5 * level] {
            let lines = alone.curves(level);
            assert_eq!(lines.len(), tracer.curves(level).len());
            for line in &lines {
                let places = line
                    .points
                    .windows(2)
                    .flat_map(|w| [0.0, 0.3, 0.8].map(|share| alone.between([w[0], w[1]], share, level)));
                let worst =
                    places.map(|p| tracer.distance(p, tracer.onto_level(p, level))).fold(0.0, f64::max);
                assert!(worst > 0.0 && worst < 1e-5, "{level} {worst}");
            }
        }
        assert!(whole[0].closed && alone.curves(level)[0].closed);
    }

    #[test]
    fn open_curves_end_on_the_border_and_saddles_give_two_branches() {
        let field = spline(|x, y| x * y);
        let tracer = LevelTracer::new(&field, &flat, SQUARE, [0.0; 2], 33, 0.03);
        for level in [0.2, -0.2, 1e-4] {
            let curves = tracer.curves(level);
            assert_eq!(curves.len(), 2, "level {level}");
            for curve in &curves {
                assert!(!curve.closed);
                for end in [curve.points[0], curve.points[curve.points.len() - 1]] {
                    let on_border = end[0].abs().max(end[1].abs());
                    assert!((on_border - 1.0).abs() < 1e-9, "{end:?}");
                    assert!((end[0] * end[1] - level).abs() < 1e-9, "{end:?}");
                }
            }
        }
    }

    #[test]
    fn coordinates_give_isoparametric_lines() {
        let field = ScalarField::Coordinate(Axis::V);
        let tracer = LevelTracer::new(&field, &flat, SQUARE, [0.0; 2], 16, 0.1);
        let curves = tracer.curves(0.3);
        assert_eq!(curves.len(), 1);
        assert!(curves[0].points.iter().all(|p| (p[1] - 0.3).abs() < 1e-12));
        assert!((tracer.length(&curves[0]) - 2.0).abs() < 1e-9);
        assert!(tracer.curves(2.0).is_empty());
    }

    #[test]
    fn margins_continue_the_field_and_do_not_widen_its_range() {
        let field = spline(|x, y| x + 0.1 * y);
        let tracer = LevelTracer::new(&field, &flat, SQUARE, [0.25, 0.5], 20, 0.1);
        let [lo, hi] = tracer.range();
        assert!((lo + 1.1).abs() < 1e-9 && (hi - 1.1).abs() < 1e-9);
        let curves = tracer.curves(1.05);
        assert_eq!(curves.len(), 1);
        let ends = [curves[0].points[0], curves[0].points[curves[0].points.len() - 1]];
        for [x, y] in ends {
            assert!((y.abs() - 1.5).abs() < 1e-9 && (x + 0.1 * y - 1.05).abs() < 1e-9, "{x} {y}");
        }
    }

    #[test]
    fn steps_are_even_on_the_surface_not_in_parameters() {
        // A surface ten times as long in u as in v.
        let field = ScalarField::Coordinate(Axis::V);
        let metric = |_: f64, _: f64| (100.0, 0.0, 1.0);
        let tracer = LevelTracer::new(&field, &metric, SQUARE, [0.0; 2], 16, 0.5);
        let curve = &tracer.curves(0.01)[0];
        assert_eq!(curve.points.len(), 41);
    }
}
