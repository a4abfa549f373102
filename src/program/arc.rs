//! Arcs and helices (G2, G3): by centre (I J K) or radius (R), in any plane, with whole turns (P).

use std::f64::consts::{PI, TAU};

use crate::compensation::Way;
use crate::error::{Fault, Stop};
use crate::frame::Place;
use crate::interpret::{AXES, Interpreter};
use crate::program::Arc;

/// Difference of the radii at both ends that is allowed as a share of the radius: programs round to a
/// thousandth.
const TOLERANCE_SHARE: f64 = 1e-3;

/// But never more than this, mm.
const GREATEST_TOLERANCE: f64 = 0.127;

/// Most whole turns of a helix.
const MOST_TURNS: f64 = 10_000.0;

/// Ends nearer to each other than this share of the radius are one point: a whole turn.
const SAME_POINT: f64 = 1e-10;

/// Letters of the centre's offsets along X Y Z.
const OFFSETS: [u8; 3] = *b"IJK";

impl Interpreter<'_> {
    /// An arc from here to where the block's words lead.
    pub fn arc(&mut self, clockwise: bool) -> Result<(), Stop> {
        let [u, v, w] = self.plane_axes();
        let start = self.state.at;
        self.note_unknown_start([u, v]);
        let column =
            AXES.iter().filter(|a| self.block.peek(**a).is_some()).map(|a| self.block.column(*a)).min();
        let to = self.target()?;
        if self.control.spare_offset && self.block.peek(OFFSETS[w]) == Some(0.0) {
            self.block.ignore(&[OFFSETS[w]]);
        }
        let radius = self.block.take(b'R').map(|r| r * self.state.modal.unit);
        let centre = match radius {
            Some(radius) => self.centre_by_radius([u, v], &to, radius, clockwise)?,
            None => self.centre_by_offsets([u, v])?,
        };
        let from_centre = |at: &Place| [at[u] - centre[0], at[v] - centre[1]];
        let (a, b) = (from_centre(&start), from_centre(&to));
        let [at_start, at_end] = [a, b].map(|[x, y]| x.hypot(y));
        self.check_radii(at_start, at_end, column.unwrap_or(0))?;
        let sweep = sweep(a, b, at_start, clockwise) + self.turns()?;
        if self.compensation.is_some() {
            let feed = self.feed((0.5 * (at_start + at_end) * sweep).hypot(to[w] - start[w]))?;
            return self.beside(Way::Round { centre, clockwise, sweep }, to, feed);
        }
        let rise = to[w] - start[w];
        let length = (0.5 * (at_start + at_end) * sweep).hypot(rise);
        let feed = self.feed(length)?;
        let mut level = start;
        (level[u], level[v]) = (centre[0], centre[1]);
        let placed = self.state.frame.machine_place(&level);
        let sense = if clockwise { -1.0 } else { 1.0 };
        let normal = self.state.frame.direction(w).map(|x| sense * x);
        let plane = self.state.modal.plane;
        self.arc_to(Arc { centre: [placed[0], placed[1], placed[2]], normal, sweep, plane }, to, feed)
    }

    /// An arc goes by where it begins, which no program says that begins with one.
    fn note_unknown_start(&mut self, axes: [usize; 2]) {
        if axes.iter().any(|axis| !self.is_placed(*axis)) {
            let [u, v] = axes.map(|axis| format!("{}{:.4}", char::from(AXES[axis]), self.state.at[axis]));
            self.note(format!("an arc begins where nobody knows; it is taken to begin at {u} {v}"));
        }
    }

    fn check_radii(&self, start: f64, end: f64, column: usize) -> Result<(), Stop> {
        if start <= 0.0 || end <= 0.0 {
            return Err(Stop::new(column, Fault::ArcPoint));
        }
        if (start - end).abs() > arc_tolerance(self.control.arc_tolerance, start.max(end)) {
            return Err(Stop::new(column, Fault::ArcEnds { start, end }));
        }
        Ok(())
    }

    /// Whole turns that P adds, rad.
    fn turns(&mut self) -> Result<f64, Stop> {
        let Some(turns) = self.block.take(b'P') else { return Ok(0.0) };
        let turns = self.whole(b'P', turns, 1.0..=MOST_TURNS, "a number of turns")?;
        Ok(TAU * f64::from(turns - 1))
    }

    /// The centre in the plane from two of I J K.
    fn centre_by_offsets(&mut self, [u, v]: [usize; 2]) -> Result<[f64; 2], Stop> {
        let modal = self.state.modal;
        let words = [u, v].map(|k| self.block.take(OFFSETS[k]));
        let absolute = modal.arc_absolute;
        if words.iter().all(Option::is_none) || absolute && words.iter().any(Option::is_none) {
            let words = match (absolute, modal.plane.word()) {
                (false, "G17") => "I and J, or R",
                (false, "G18") => "I and K, or R",
                (false, _) => "J and K, or R",
                (true, _) => "both words of its centre under G90.1, or R",
            };
            let code = "an arc".to_owned();
            return Err(Stop::new(0, Fault::Missing { code, words }));
        }
        let from = |k: usize| if absolute { 0.0 } else { self.state.at[k] };
        Ok([from(u) + words[0].unwrap_or(0.0) * modal.unit, from(v) + words[1].unwrap_or(0.0) * modal.unit])
    }

    /// The centre in the plane from a radius: the arc of less than half a turn, or of more where R is
    /// negative.
    fn centre_by_radius(
        &self,
        [u, v]: [usize; 2],
        to: &Place,
        radius: f64,
        clockwise: bool,
    ) -> Result<[f64; 2], Stop> {
        let at = &self.state.at;
        let (x, y) = (to[u] - at[u], to[v] - at[v]);
        let apart = x.hypot(y);
        let column = self.block.column(b'R');
        if apart == 0.0 || radius == 0.0 {
            return Err(Stop::new(column, Fault::ArcReach { radius, apart }));
        }
        let size = radius.abs();
        if 0.5 * apart > size + arc_tolerance(self.control.arc_tolerance, size) {
            return Err(Stop::new(column, Fault::ArcReach { radius, apart }));
        }
        // A little too short a radius is half a turn.
        let off = ((size - 0.5 * apart) * (size + 0.5 * apart)).max(0.0).sqrt();
        let left = (radius > 0.0) != clockwise;
        let side = if left { off / apart } else { -off / apart };
        Ok([at[u] + 0.5 * x - side * y, at[v] + 0.5 * y + side * x])
    }
}

/// How far ends may miss an arc of this radius, mm; `least` is what is always allowed.
pub(crate) fn arc_tolerance(least: f64, radius: f64) -> f64 {
    least.max(TOLERANCE_SHARE * radius).min(GREATEST_TOLERANCE)
}

/// The angle from `a` to `b` about zero, rad; a whole turn where both are one point.
pub(crate) fn sweep(a: [f64; 2], b: [f64; 2], radius: f64, clockwise: bool) -> f64 {
    let apart = (a[0] - b[0]).hypot(a[1] - b[1]);
    if apart <= SAME_POINT * radius {
        return TAU;
    }
    let cross = a[0] * b[1] - a[1] * b[0];
    let angle = cross.atan2(a[0] * b[0] + a[1] * b[1]);
    let angle = if clockwise { -angle } else { angle };
    if angle <= 0.0 { angle + TAU } else { angle.min(TAU) }
}

impl Arc {
    /// The place at the share `t` of the way from `start` to `end`: the radius changes evenly between those
    /// of both ends.
    pub fn at(&self, start: &[f64; 3], end: &[f64; 3], t: f64) -> [f64; 3] {
        if t >= 1.0 {
            return *end;
        }
        let n = self.normal;
        let dot = |a: &[f64; 3], b: &[f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let minus = |a: &[f64; 3], b: &[f64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
        let spoke = minus(start, &self.centre);
        let rise = dot(&minus(end, start), &n);
        let last = minus(end, &self.centre);
        let radius = dot(&spoke, &spoke).sqrt();
        let flat = minus(&last, &n.map(|x| x * dot(&last, &n)));
        let grown = 1.0 + t * (dot(&flat, &flat).sqrt() / radius - 1.0);
        let across = [
            n[1] * spoke[2] - n[2] * spoke[1],
            n[2] * spoke[0] - n[0] * spoke[2],
            n[0] * spoke[1] - n[1] * spoke[0],
        ];
        let (sin, cos) = (t * self.sweep).sin_cos();
        [0, 1, 2].map(|k| self.centre[k] + grown * (cos * spoke[k] + sin * across[k]) + t * rise * n[k])
    }

    /// How far the arc strays at most from so many chords, mm: an eighth of the square of their step times
    /// its bend.
    pub fn strays(&self, start: &[f64; 3], end: &[f64; 3], chords: usize) -> f64 {
        let [first, last] = [start, end].map(|at| {
            let spoke = [0, 1, 2].map(|k| at[k] - self.centre[k]);
            let along = (0..3).map(|k| spoke[k] * self.normal[k]).sum::<f64>();
            (0..3).map(|k| (spoke[k] - along * self.normal[k]).powi(2)).sum::<f64>().sqrt()
        });
        let step = self.sweep / chords as f64;
        0.125 * step * (first.max(last) * step + 2.0 * (last - first).abs() / chords as f64)
    }

    /// Chords from which the arc strays no farther than `tolerance`, mm, where it begins at `start`.
    pub fn chords(&self, start: &[f64; 3], tolerance: f64) -> usize {
        /// Beyond, an arc is a mistake of units.
        const MOST: f64 = 1e5;
        let radius = (0..3).map(|k| (start[k] - self.centre[k]).powi(2)).sum::<f64>().sqrt();
        // The sagitta of a chord over an angle φ is r (1 − cos φ/2).
        let half = (1.0 - tolerance / radius).clamp(-1.0, 1.0).acos().min(0.25 * PI);
        (self.sweep / (2.0 * half)).ceil().clamp(1.0, MOST) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::Plane;

    #[test]
    fn sweeps_run_the_way_that_is_asked_for() {
        let (east, north) = ([2.0, 0.0], [0.0, 2.0]);
        for (a, b, clockwise, expected) in [
            (east, north, false, 0.5 * PI),
            (east, north, true, 1.5 * PI),
            (east, east, true, TAU),
            (north, east, true, 0.5 * PI),
        ] {
            assert!((sweep(a, b, 2.0, clockwise) - expected).abs() < 1e-15);
        }
    }

    #[test]
    fn a_helix_is_followed_and_its_chords_keep_the_tolerance() {
        let arc = Arc { centre: [1.0, 2.0, 3.0], normal: [0.0, 0.0, 1.0], sweep: 1.5 * PI, plane: Plane::Xy };
        let (start, end) = ([6.0, 2.0, 3.0], [1.0, -3.0, 9.0]);
        let middle = arc.at(&start, &end, 0.5);
        let angle = 0.75 * PI;
        for (x, expected) in middle.iter().zip([1.0 + 5.0 * angle.cos(), 2.0 + 5.0 * angle.sin(), 6.0]) {
            assert!((x - expected).abs() < 1e-12, "{middle:?}");
        }
        let last = arc.at(&start, &end, 1.0 - 1e-12);
        assert!((0..3).all(|k| (last[k] - end[k]).abs() < 1e-9));
        let chords = arc.chords(&start, 0.01);
        let sagitta = |n: usize| 5.0 * (1.0 - (0.5 * arc.sweep / n as f64).cos());
        assert!(sagitta(chords) <= 0.01 && sagitta(chords - 1) > 0.01, "{chords}");
        for (end, chords) in [(end, chords), ([1.0, -3.1, 9.0], chords), ([1.0, -2.5, 9.0], 3)] {
            let bound = arc.strays(&start, &end, chords);
            let place = |t: f64| geometry::Point3::from(arc.at(&start, &end, t));
            let off = |k: usize| {
                let [a, b] = [k, k + 1].map(|n| place(n as f64 / chords as f64));
                let apart = |n: usize| {
                    let t = n as f64 / 100.0;
                    (place((k as f64 + t) / chords as f64) - (a + t * (b - a))).norm()
                };
                (1..100).map(apart).fold(0.0, f64::max)
            };
            let most = (0..chords).map(off).fold(0.0, f64::max);
            assert!(most <= bound && bound < 1.2 * most, "{most} {bound}");
        }
    }
}
