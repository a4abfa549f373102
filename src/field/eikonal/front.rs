//! How fast a front moves through one place of a surface, by direction, and when it comes to a node of a grid
//! from its neighbours.
//!
//! A front φ = const moves by `speed(b)` mm while φ grows by one, `b` the unit vector across it. In
//! orthonormal components q of ∇φ that is `|q|² = s²(q)`, with the slowness `s = 1/speed`. For a ball cutter
//! s² is a quadratic in the curvature of the surface along `b`, but for terms of fourth order in the strip's
//! width: a constant plus a second and a fourth harmonic of the angle of `b`; what other cutters and limited
//! strips add to that is kept as a table.

/// Directions of the table over half a turn (a front and its reverse are equally fast). More follow sudden
/// changes of the speed closer.
const DIRECTIONS: usize = 32;

/// What the table adds is left out below this share of s².
const HARMONIC: f64 = 1e-6;

/// With a table the least and greatest slowness lie between its directions; they are widened by this share.
const BETWEEN_DIRECTIONS: f64 = 0.02;

/// A front may come from outside of its quadrant by this share and still count as coming from it.
const CAUSALITY_SLACK: f64 = 1e-9;

/// Rounding of s²: roots are found to this share.
const ROOT: f64 = 1e-13;

/// Bisection and Newton steps for one arrival; bisection alone is exact after some fifty.
const MOST_STEPS: usize = 60;

/// The entries of a table around a direction. Minimisers turn it little from step to step, and tables of many
/// places lie far apart in memory.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Window {
    /// The direction before it.
    from: usize,
    entries: [f64; 4],
}

impl Default for Window {
    fn default() -> Self {
        Self { from: usize::MAX, entries: [0.0; 4] }
    }
}

/// The speed of fronts at a place, by direction.
#[derive(Debug, Clone)]
pub struct Front {
    /// Components of ∇φ from derivatives: `q1 = frame[0] φ_u`, `q2 = frame[1] φ_u + frame[2] φ_v`.
    frame: [f64; 3],
    /// s² = mean + cosine cos 2θ + sine sin 2θ + fourth[0] cos 4θ + fourth[1] sin 4θ + table.
    mean: f64,
    cosine: f64,
    sine: f64,
    fourth: [f64; 2],
    /// What remains of s² at angles kπ/[`DIRECTIONS`].
    table: Option<Box<[f64; DIRECTIONS]>>,
    /// Bounds of s².
    least: f64,
    greatest: f64,
}

impl Front {
    /// From the first fundamental form `(E, F, G)` and the speed (mm for each unit of φ) across fronts with
    /// the unit normal `du ∂u + dv ∂v`; `None` where the metric is degenerate or a speed is not a positive
    /// number.
    pub fn new((e, f, g): (f64, f64, f64), mut speed: impl FnMut([f64; 2]) -> f64) -> Option<Self> {
        let determinant = e * g - f * f;
        if !(e > 0.0 && determinant > 1e-24 * e * g && determinant.is_finite()) {
            return None;
        }
        let root = (e * determinant).sqrt();
        let frame = [1.0 / e.sqrt(), -f / root, e / root];
        let mut slowness = [0.0; DIRECTIONS];
        for (k, slowness) in slowness.iter_mut().enumerate() {
            let (sin, cos) = angle(k).sin_cos();
            // Vectors change by the transpose of what covectors change by.
            let s = 1.0 / speed([frame[0] * cos + frame[1] * sin, frame[2] * sin]);
            if !(s > 0.0 && s.is_finite()) {
                return None;
            }
            *slowness = s;
        }
        Some(Self::of(frame, &slowness))
    }

    /// The same with the convex hull of the polar diagram of slowness: nowhere faster. Such fronts are
    /// unique, and have no corners of their own.
    #[must_use]
    pub fn convex(&self) -> Self {
        let slowness = std::array::from_fn(|k| {
            let (sin, cos) = angle(k).sin_cos();
            self.square([cos, sin]).0.max(0.0).sqrt()
        });
        Self::of(self.frame, &hull(&slowness))
    }

    /// From the slowness in the directions of the table.
    fn of(frame: [f64; 3], slowness: &[f64; DIRECTIONS]) -> Self {
        let squares = slowness.map(|s| s * s);
        let project = |wave: fn(f64) -> f64| {
            (0..DIRECTIONS).map(|k| squares[k] * wave(2.0 * angle(k))).sum::<f64>() / DIRECTIONS as f64
        };
        let (mean, cosine, sine) = (project(|_| 1.0), 2.0 * project(f64::cos), 2.0 * project(f64::sin));
        let twice = |wave: fn(f64) -> f64| {
            2.0 * (0..DIRECTIONS).map(|k| squares[k] * wave(4.0 * angle(k))).sum::<f64>() / DIRECTIONS as f64
        };
        let fourth = [twice(f64::cos), twice(f64::sin)];
        let mut rest = squares;
        for (k, rest) in rest.iter_mut().enumerate() {
            let ((sin2, cos2), (sin4, cos4)) = ((2.0 * angle(k)).sin_cos(), (4.0 * angle(k)).sin_cos());
            *rest -= mean + cosine * cos2 + sine * sin2 + fourth[0] * cos4 + fourth[1] * sin4;
        }
        let harmonic = rest.iter().all(|r| r.abs() <= HARMONIC * mean);
        let (least, greatest) = if harmonic {
            let swing = cosine.hypot(sine) + fourth[0].hypot(fourth[1]);
            (mean - swing, mean + swing)
        } else {
            let bounds = squares.iter().fold([f64::INFINITY, 0.0f64], |[a, b], &s| [a.min(s), b.max(s)]);
            (bounds[0] * (1.0 - BETWEEN_DIRECTIONS), bounds[1] * (1.0 + BETWEEN_DIRECTIONS))
        };
        let table = (!harmonic).then(|| Box::new(rest));
        Self { frame, mean, cosine, sine, fourth, table, least, greatest }
    }

    /// Greatest φ_u and φ_v of any front: φ by which the neighbour along an axis is later at most, over the
    /// distance.
    pub(super) fn steepest(&self) -> [f64; 2] {
        [self.latest([1.0, 0.0]), self.latest([0.0, 1.0])]
    }

    /// Components of a gradient in the orthonormal frame, from its derivatives by the parameters.
    pub fn covector(&self, [du, dv]: [f64; 2]) -> [f64; 2] {
        [self.frame[0] * du, self.frame[1] * du + self.frame[2] * dv]
    }

    /// The parameters of the unit vector at an angle in the orthonormal frame.
    pub fn vector(&self, angle: f64) -> [f64; 2] {
        let (sin, cos) = angle.sin_cos();
        [self.frame[0] * cos + self.frame[1] * sin, self.frame[2] * sin]
    }

    /// The slowness of the mean square over all directions.
    pub fn mean_slowness(&self) -> f64 {
        self.mean.sqrt()
    }

    /// s² of the direction of `q`, and its derivative by the angle.
    pub fn square(&self, q: [f64; 2]) -> (f64, f64) {
        self.square_near(q, &mut Window::default())
    }

    /// The same, with the entries of the table that were asked for last at this place.
    pub(crate) fn square_near(&self, [q1, q2]: [f64; 2], window: &mut Window) -> (f64, f64) {
        let norm2 = q1 * q1 + q2 * q2;
        let (cos, sin) =
            if norm2 > 0.0 { ((q1 * q1 - q2 * q2) / norm2, 2.0 * q1 * q2 / norm2) } else { (1.0, 0.0) };
        let (cos4, sin4) = (1.0 - 2.0 * sin * sin, 2.0 * sin * cos);
        let [even, odd] = self.fourth;
        let value = self.mean + self.cosine * cos + self.sine * sin + even * cos4 + odd * sin4;
        let slope = 2.0 * (self.sine * cos - self.cosine * sin) + 4.0 * (odd * cos4 - even * sin4);
        let Some(table) = &self.table else { return (value, slope) };
        let per_angle = DIRECTIONS as f64 / std::f64::consts::PI;
        let x = (q2.atan2(q1) * per_angle).rem_euclid(DIRECTIONS as f64);
        let (k, t) = (x as usize, x.fract());
        if window.from != k {
            let entries = [k + DIRECTIONS - 1, k, k + 1, k + 2].map(|k| table[k % DIRECTIONS]);
            *window = Window { from: k, entries };
        }
        let [a, b, c, d] = window.entries;
        let (s1, s2) = (0.5 * (c - a), 0.5 * (d - b));
        let (c2, c3) = (3.0 * (c - b) - 2.0 * s1 - s2, 2.0 * (b - c) + s1 + s2);
        let rest = b + t * (s1 + t * (c2 + t * c3));
        (value + rest, slope + (s1 + t * (2.0 * c2 + 3.0 * t * c3)) * per_angle)
    }

    /// Scalar product of two vectors given by their parameters.
    pub(super) fn dot(&self, a: [f64; 2], b: [f64; 2]) -> f64 {
        let ([a1, a2], [b1, b2]) = (self.components(a), self.components(b));
        a1 * b1 + a2 * b2
    }

    /// Components in the orthonormal frame of the vector with the parameters `[du, dv]`.
    pub fn components(&self, [du, dv]: [f64; 2]) -> [f64; 2] {
        let x2 = dv / self.frame[2];
        [(du - self.frame[1] * x2) / self.frame[0], x2]
    }

    /// φ for each mm that a front whose normal has the parameters `[du, dv]` (of any length) moves along it,
    /// times the length: the arrival of a plane front.
    pub(super) fn plane(&self, across: [f64; 2]) -> f64 {
        let x = self.components(across);
        x[0].hypot(x[1]) * self.square(x).0.max(0.0).sqrt()
    }

    /// The arrival at `[du, dv]` of a front that starts at a point: the greatest of all fronts through it.
    pub(super) fn latest(&self, across: [f64; 2]) -> f64 {
        let [x1, x2] = self.components(across);
        let length = x1.hypot(x2);
        if length == 0.0 {
            return 0.0;
        }
        if self.greatest - self.least <= 1e-12 * self.greatest {
            return length * self.mean.sqrt();
        }
        let toward = x2.atan2(x1);
        let arrival = |turn: f64| {
            let (sin, cos) = (toward + turn).sin_cos();
            turn.cos() * self.square([cos, sin]).0.max(0.0).sqrt()
        };
        // The best of the directions within a quarter turn, then golden section around it.
        let spread = angle(1);
        let half = DIRECTIONS as i32 / 2;
        let best =
            (-half..=half).map(|k| f64::from(k) * spread).max_by(|a, b| arrival(*a).total_cmp(&arrival(*b)));
        let best = best.unwrap_or(0.0);
        let (mut a, mut b) = (best - spread, best + spread);
        let golden = 0.5 * (5f64.sqrt() - 1.0);
        for _ in 0..24 {
            let (c, d) = (b - golden * (b - a), a + golden * (b - a));
            if arrival(c) >= arrival(d) { b = d } else { a = c }
        }
        length * arrival(0.5 * (a + b)).max(arrival(best))
    }

    /// φ at a node from its neighbours at distances `pitch` along u and along v, on the sides `toward` (±1:
    /// the front moves along or against the parameter), where it has the values `known`. The smallest of the
    /// front through both and of those along one, which are [`Front::steepest`]; infinite when nothing is
    /// known.
    pub(super) fn arrival(
        &self,
        steepest: [f64; 2],
        pitch: [f64; 2],
        toward: [f64; 2],
        known: [f64; 2],
    ) -> f64 {
        let alone = [0, 1].map(|c| known[c] + pitch[c] * steepest[c]);
        let alone = alone[0].min(alone[1]);
        match self.through_both(pitch, toward, known, true) {
            Some(both) => both.min(alone),
            None => alone,
        }
    }

    /// φ of the front through both neighbours; `None` where there is none, or (if `causal`) where its energy
    /// comes from elsewhere.
    pub(super) fn through_both(
        &self,
        pitch: [f64; 2],
        toward: [f64; 2],
        known: [f64; 2],
        causal: bool,
    ) -> Option<f64> {
        if !(known[0].is_finite() && known[1].is_finite()) {
            return None;
        }
        // φ is counted from the earlier neighbour. q = rise φ − start.
        let zero = known[0].min(known[1]);
        let rate = [toward[0] / pitch[0], toward[1] / pitch[1]];
        let late = [known[0] - zero, known[1] - zero];
        let components = |x: [f64; 2]| [self.frame[0] * x[0], self.frame[1] * x[0] + self.frame[2] * x[1]];
        let rise = components(rate);
        let start = components([rate[0] * late[0], rate[1] * late[1]]);
        let square = rise[0] * rise[0] + rise[1] * rise[1];
        let half = rise[0] * start[0] + rise[1] * start[1];
        let fixed = start[0] * start[0] + start[1] * start[1];
        // Fronts with the greatest slowness arrive last, those with the least first.
        let with = |s2: f64| {
            let root = half * half - square * (fixed - s2);
            (root >= 0.0).then(|| (half + root.sqrt()) / square)
        };
        let mut high = with(self.greatest)?;
        let mut low = with(self.least).unwrap_or(half / square);
        let q_at = |x: f64| [rise[0] * x - start[0], rise[1] * x - start[1]];
        let excess = |x: f64| {
            let q = q_at(x);
            let (s2, turn) = self.square(q);
            let norm2 = q[0] * q[0] + q[1] * q[1];
            let angular = (q[0] * rise[1] - q[1] * rise[0]) / norm2.max(1e-300);
            (norm2 - s2, 2.0 * (q[0] * rise[0] + q[1] * rise[1]) - turn * angular)
        };
        let mut x = high;
        if high - low > 1e-13 * high.abs() {
            if excess(low).0 > 0.0 {
                return None;
            }
            for _ in 0..MOST_STEPS {
                let (f, slope) = excess(x);
                if f.abs() <= ROOT * self.greatest || high - low <= ROOT * high.abs() {
                    break;
                }
                if f > 0.0 {
                    high = x
                } else {
                    low = x
                }
                let newton = x - f / slope;
                x = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            }
        }
        if !causal {
            return Some(zero + x);
        }
        // Does the front's energy come out of this quadrant?
        let q = q_at(x);
        let norm2 = (q[0] * q[0] + q[1] * q[1]).max(1e-300);
        let (_, turn) = self.square(q);
        let c = [2.0 * q[0] + turn * q[1] / norm2, 2.0 * q[1] - turn * q[0] / norm2];
        let along_u = toward[0] * (self.frame[0] * c[0] + self.frame[1] * c[1]);
        let along_v = toward[1] * self.frame[2] * c[1];
        let slack = -CAUSALITY_SLACK * norm2.sqrt();
        (along_u >= slack * self.frame[0] && along_v >= slack * self.frame[2]).then_some(zero + x)
    }
}

fn angle(k: usize) -> f64 {
    std::f64::consts::PI * k as f64 / DIRECTIONS as f64
}

/// The convex hull of a polar diagram that is its own reverse, at the directions of the table.
fn hull(radii: &[f64; DIRECTIONS]) -> [f64; DIRECTIONS] {
    let place = |k: usize| {
        let (sin, cos) = angle(k).sin_cos();
        [radii[k % DIRECTIONS] * cos, radii[k % DIRECTIONS] * sin]
    };
    let cross = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
    let way = |from: usize, to: usize| {
        let (a, b) = (place(from), place(to));
        [b[0] - a[0], b[1] - a[1]]
    };
    // The farthest place is a corner of the hull, and so is the opposite one.
    let first = (0..DIRECTIONS).max_by(|&a, &b| radii[a].total_cmp(&radii[b])).unwrap_or(0);
    let mut corners: Vec<usize> = Vec::with_capacity(DIRECTIONS + 1);
    for k in first..=first + DIRECTIONS {
        while let [.., a, b] = corners[..]
            && cross(way(a, b), way(b, k)) <= 0.0
        {
            corners.pop();
        }
        corners.push(k);
    }
    let mut hull = *radii;
    for pair in corners.windows(2) {
        let side = way(pair[0], pair[1]);
        for k in pair[0] + 1..pair[1] {
            let (sin, cos) = angle(k).sin_cos();
            hull[k % DIRECTIONS] = cross(side, place(pair[0])) / cross(side, [cos, sin]);
        }
    }
    hull
}
