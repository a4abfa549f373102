//! Curves of drawings as chords within a tolerance, mm, and a bound of what they are off.

use super::Chords;
use geometry::{MAX_COORDINATE, Point2, foot};

/// A chord is halved at most so often: cusps would be halved without end.
const MAX_HALVINGS: u32 = 24;

/// Whether a place is so far out that its drawing is refused: then no chords are wanted.
fn is_beyond(p: &Point2) -> bool {
    !p.iter().all(|x| x.abs() <= MAX_COORDINATE)
}

/// A control point of a rational curve: its coordinates times its weight, and the weight.
type Weighted = [f64; 3];

fn place(p: &Weighted) -> Point2 {
    Point2::new(p[0] / p[2], p[1] / p[2])
}

/// The two halves of a Bézier curve.
fn halves(control: &[Weighted]) -> [Vec<Weighted>; 2] {
    let (mut left, mut right) = (Vec::with_capacity(control.len()), control.to_vec());
    for last in (0..control.len()).rev() {
        left.push(right[0]);
        for k in 0..last {
            right[k] = [0, 1, 2].map(|c| 0.5 * (right[k][c] + right[k + 1][c]));
        }
    }
    // What is left of the triangle is its lower side, from the middle to the end.
    [left, right]
}

/// How far a Bézier curve of positive weights may lie off its chord, mm: no farther than the farthest control
/// point, less the share that the ends have in every place of it.
fn off_chord(control: &[Weighted]) -> f64 {
    let [Some(first), Some(last)] = [control.first(), control.last()] else { return 0.0 };
    let ends = [place(first), place(last)];
    let farthest = control.iter().map(|p| foot(&place(p), &ends).1).fold(0.0, f64::max);
    let heaviest = control.iter().map(|p| p[2]).fold(0.0, f64::max);
    let of_ends = 0.5f64.powi(control.len() as i32 - 2) * first[2].min(last[2]) / heaviest;
    farthest * (1.0 - of_ends)
}

fn halve(control: &[Weighted], tolerance: f64, halvings: u32, out: &mut Chords) {
    let off = off_chord(control);
    let [Some(first), Some(last)] = [control.first(), control.last()] else { return };
    let beyond = is_beyond(&place(first)) || is_beyond(&place(last));
    if halvings > 0 && !beyond && off > tolerance {
        for half in halves(control) {
            halve(&half, tolerance, halvings - 1, out);
        }
    } else {
        out.points.push(place(last));
        out.off_curve = out.off_curve.max(off);
    }
}

impl Chords {
    /// Appends a Bézier curve of positive weights, without its first point.
    pub fn bezier(&mut self, control: Vec<Weighted>, tolerance: f64) {
        halve(&control, tolerance, MAX_HALVINGS, self);
    }

    /// Appends an arc of an ellipse, without its first point: centre, two conjugate half axes, from one angle
    /// to another (rad).
    pub fn ellipse(
        &mut self,
        centre: Point2,
        axes: [geometry::Vector2; 2],
        from: f64,
        to: f64,
        tolerance: f64,
    ) {
        // The chord of the angle δ lies within r (1 − cos δ/2) of the circle of the greater axis, which a
        // linear map to the ellipse does not enlarge. No half axis is longer than this.
        let squares = axes.map(|axis| axis.norm_squared());
        let radius = (squares[0] + squares[1]).sqrt();
        let step =
            if radius > tolerance { 4.0 * (0.5 * tolerance / radius).sqrt().min(0.38).asin() } else { 1.5 };
        let beyond = is_beyond(&(centre + axes[0])) || is_beyond(&(centre + axes[1]));
        let most = if beyond { 4.0 } else { 1e6 };
        let count = ((to - from).abs() / step).ceil().clamp(1.0, most);
        for k in 1..=count as usize {
            let (sin, cos) = (from + (to - from) * k as f64 / count).sin_cos();
            self.points.push(centre + axes[0] * cos + axes[1] * sin);
        }
        // The greatest one is known better.
        let skew = (squares[0] - squares[1]).hypot(2.0 * axes[0].dot(&axes[1]));
        let radius = (0.5 * (squares[0] + squares[1] + skew)).sqrt();
        self.off_curve = self.off_curve.max(2.0 * radius * (0.25 * (to - from) / count).sin().powi(2));
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

    /// A control point of the Bézier curve over the span that begins at knot `span`: the blossom of the
    /// span's end, `of_end` times, and of its beginning, by de Boor's recursion. Only for splines without
    /// fault.
    fn blossom(&self, span: usize, of_end: usize) -> Weighted {
        let p = self.degree;
        let mut d: Vec<Weighted> = (span - p..=span)
            .map(|k| {
                let (point, w) = self.control[k];
                [point.x * w, point.y * w, w]
            })
            .collect();
        for r in 1..=p {
            let t = self.knots[if r <= of_end { span + 1 } else { span }];
            for j in (r..=p).rev() {
                let i = span - p + j;
                let (a, b) = (self.knots[i], self.knots[i + 1 + p - r]);
                let share = if b > a { (t - a) / (b - a) } else { 0.0 };
                d[j] = [0, 1, 2].map(|c| (1.0 - share) * d[j - 1][c] + share * d[j][c]);
            }
        }
        d[p]
    }

    /// Its chords, first point included.
    pub fn chords(&self, tolerance: f64) -> Chords {
        let (p, n) = (self.degree, self.control.len());
        let mut out = Chords::open(Vec::new());
        for k in (p..n).filter(|&k| self.knots[k + 1] > self.knots[k]) {
            let control: Vec<Weighted> = (0..=p).map(|of_end| self.blossom(k, of_end)).collect();
            if out.points.is_empty() {
                out.points.push(place(&control[0]));
            }
            out.bezier(control, tolerance);
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Vector2;
    use proptest::prelude::*;

    /// The greatest distance of places of a curve from chords that begin with its first point.
    fn farthest(chords: &[Point2], places: impl Iterator<Item = Point2>) -> f64 {
        let off =
            |p: Point2| chords.windows(2).map(|w| foot(&p, &[w[0], w[1]]).1).fold(f64::INFINITY, f64::min);
        places.map(off).fold(0.0, f64::max)
    }

    proptest! {
        /// Every place of a curve lies within the bound, which lies within the tolerance.
        #[test]
        fn bounds_of_chords_hold(
            xy in prop::collection::vec((-20.0..20.0f64, -20.0..20.0f64), 2..9),
            weights in prop::collection::vec(0.2..5.0f64, 9),
            tolerance in 1e-3..0.5f64,
        ) {
            let control: Vec<Weighted> =
                xy.iter().zip(&weights).map(|(p, w)| [p.0 * w, p.1 * w, *w]).collect();
            let mut chords = Chords::open(vec![place(&control[0])]);
            chords.bezier(control.clone(), tolerance);
            let at = |k: usize| {
                let (t, mut p) = (k as f64 / 300.0, control.clone());
                for n in (1..p.len()).rev() {
                    for k in 0..n {
                        p[k] = [0, 1, 2].map(|c| p[k][c] + (p[k + 1][c] - p[k][c]) * t);
                    }
                }
                place(&p[0])
            };
            prop_assert!(chords.off_curve <= tolerance);
            let off = farthest(&chords.points, (0..=300).map(at));
            prop_assert!(off <= chords.off_curve + 1e-9, "{} {}", off, chords.off_curve);
        }

        #[test]
        fn bounds_of_arcs_hold(
            a in (-20.0..20.0f64, -20.0..20.0f64),
            b in (-20.0..20.0f64, -20.0..20.0f64),
            from in -7.0..7.0f64,
            turn in -7.0..7.0f64,
            tolerance in 1e-3..5.0f64,
        ) {
            let axes = [Vector2::new(a.0, a.1), Vector2::new(b.0, b.1)];
            let at = |t: f64| Point2::origin() + axes[0] * t.cos() + axes[1] * t.sin();
            let mut chords = Chords::open(vec![at(from)]);
            chords.ellipse(Point2::origin(), axes, from, from + turn, tolerance);
            let off = farthest(&chords.points, (0..=300).map(|k| at(from + turn * f64::from(k) / 300.0)));
            prop_assert!(chords.off_curve <= tolerance.max(1e-9) && off <= chords.off_curve + 1e-9);
        }
    }

    /// A round of a radius has the sagitta of its chords.
    #[test]
    fn the_bound_of_a_circle_is_its_sagitta() {
        let mut chords = Chords::closed(Vec::new());
        chords.ellipse(
            Point2::origin(),
            [Vector2::new(20.0, 0.0), Vector2::new(0.0, -20.0)],
            0.0,
            6.0,
            0.0025,
        );
        let middle = nalgebra::center(&chords.points[0], &chords.points[1]);
        assert!((20.0 - middle.coords.norm() - chords.off_curve).abs() < 1e-12);
        assert!(chords.off_curve > 0.5 * 0.0025);
    }
}
