//! Curves of drawings as chords within a tolerance, mm.

use geometry::{MAX_COORDINATE, Point2, foot};

/// A chord is halved at most so often: cusps would be halved without end.
const MAX_HALVINGS: u32 = 24;

/// Whether a place is so far out that its drawing is refused: then no chords are wanted.
fn is_beyond(p: &Point2) -> bool {
    !p.iter().all(|x| x.abs() <= MAX_COORDINATE)
}

/// Appends the chords of `curve` over `[t0, t1]`, without its first point. The curve is first cut in
/// `pieces`, each of which should turn by less than a right angle or so.
///
/// # Tolerance
/// Chords are tested at their quarters and their middle.
pub fn flatten(
    curve: &dyn Fn(f64) -> Point2,
    t0: f64,
    t1: f64,
    pieces: usize,
    tolerance: f64,
    out: &mut Vec<Point2>,
) {
    let mut a = (t0, curve(t0));
    for k in 1..=pieces {
        let t = if k == pieces { t1 } else { t0 + (t1 - t0) * k as f64 / pieces as f64 };
        let b = (t, curve(t));
        halve(curve, a, b, tolerance, MAX_HALVINGS, out);
        a = b;
    }
}

fn halve(
    curve: &dyn Fn(f64) -> Point2,
    a: (f64, Point2),
    b: (f64, Point2),
    tolerance: f64,
    halvings: u32,
    out: &mut Vec<Point2>,
) {
    let at = |share: f64| curve(a.0 + (b.0 - a.0) * share);
    let middle = at(0.5);
    let off = |p: &Point2| foot(p, &[a.1, b.1]).1 > tolerance;
    let beyond = [&a.1, &middle, &b.1].into_iter().any(is_beyond);
    if halvings > 0 && !beyond && (off(&middle) || off(&at(0.25)) || off(&at(0.75))) {
        let middle = (0.5 * (a.0 + b.0), middle);
        halve(curve, a, middle, tolerance, halvings - 1, out);
        halve(curve, middle, b, tolerance, halvings - 1, out);
    } else {
        out.push(b.1);
    }
}

/// An arc of an ellipse: centre, two conjugate half axes, from one angle to another (rad), without its
/// first point.
pub fn ellipse(
    centre: Point2,
    axes: [geometry::Vector2; 2],
    from: f64,
    to: f64,
    tolerance: f64,
    out: &mut Vec<Point2>,
) {
    // The chord of the angle δ lies within r (1 − cos δ/2) of the circle of the greater axis, which a
    // linear map to the ellipse does not enlarge.
    let radius = (axes[0].norm_squared() + axes[1].norm_squared()).sqrt();
    let step =
        if radius > tolerance { 4.0 * (0.5 * tolerance / radius).sqrt().min(0.38).asin() } else { 1.5 };
    let beyond = is_beyond(&(centre + axes[0])) || is_beyond(&(centre + axes[1]));
    let most = if beyond { 4.0 } else { 1e6 };
    let count = ((to - from).abs() / step).ceil().clamp(1.0, most);
    for k in 1..=count as usize {
        let (sin, cos) = (from + (to - from) * k as f64 / count).sin_cos();
        out.push(centre + axes[0] * cos + axes[1] * sin);
    }
}

/// A rational B-spline curve of a drawing.
#[derive(Debug, Clone, PartialEq)]
pub struct Spline {
    /// Degree, 1 or more.
    pub degree: usize,
    /// Non-decreasing, `control.len() + degree + 1` of them.
    pub knots: Vec<f64>,
    /// Control points and their positive weights.
    pub control: Vec<(Point2, f64)>,
}

impl Spline {
    /// Why it cannot be drawn, if it cannot.
    pub fn fault(&self) -> Option<String> {
        let n = self.control.len();
        if self.degree < 1 || self.degree > 25 {
            return Some(format!("its degree is {}", self.degree));
        }
        if n <= self.degree {
            return Some(format!("degree {} needs more than {n} control points", self.degree));
        }
        if self.knots.len() != n + self.degree + 1 {
            return Some(format!(
                "it has {} knots, and {n} control points of degree {} need {}",
                self.knots.len(),
                self.degree,
                n + self.degree + 1
            ));
        }
        let rising = self.knots.windows(2).all(|w| w[0] <= w[1]);
        if !rising || self.knots.iter().any(|k| !k.is_finite()) || self.knots[self.degree] >= self.knots[n] {
            return Some("its knots do not rise".into());
        }
        let bad = self
            .control
            .iter()
            .any(|(p, w)| !(p.coords.iter().all(|c| c.is_finite()) && *w > 0.0 && w.is_finite()));
        bad.then(|| "a control point is not finite or a weight is not positive".into())
    }

    /// By de Boor's recursion in homogeneous coordinates. Only for splines without fault.
    fn at(&self, t: f64) -> Point2 {
        let (p, n) = (self.degree, self.control.len());
        let span = self.knots[p + 1..n].partition_point(|k| *k <= t) + p;
        let mut d: Vec<[f64; 3]> = (span - p..=span)
            .map(|k| {
                let (point, w) = self.control[k];
                [point.x * w, point.y * w, w]
            })
            .collect();
        for r in 1..=p {
            for j in (r..=p).rev() {
                let i = span - p + j;
                let (a, b) = (self.knots[i], self.knots[i + 1 + p - r]);
                let share = if b > a { (t - a) / (b - a) } else { 0.0 };
                d[j] = [0, 1, 2].map(|c| (1.0 - share) * d[j - 1][c] + share * d[j][c]);
            }
        }
        Point2::new(d[p][0] / d[p][2], d[p][1] / d[p][2])
    }

    /// Its chords, first point included.
    pub fn chords(&self, tolerance: f64) -> Vec<Point2> {
        let (p, n) = (self.degree, self.control.len());
        let mut out = vec![self.at(self.knots[p])];
        for k in p..n {
            if self.knots[k + 1] > self.knots[k] {
                let pieces = if p == 1 { 1 } else { 4 };
                flatten(&|t| self.at(t), self.knots[k], self.knots[k + 1], pieces, tolerance, &mut out);
            }
        }
        out
    }
}
