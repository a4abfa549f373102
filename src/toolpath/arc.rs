//! Arcs and helices as straight moves.
//!
//! Enters: start, end and centre of an arc in one of the three main planes, its sense and its turns, as
//! programs have them (ISO 6983: G2 and G3 in G17, G18, G19); mm. Leaves: the ends of chords that stay
//! within a deviation of the arc, as few as there can be.
//!
//! A chord over the angle δ of a circle of radius r stays within the sagitta `r (1 − cos δ/2)` of it,
//! and one of a helix no farther from that: along the axis both rise evenly. Ends whose radii differ a
//! little, by the rounding of a program, are joined by a spiral `r = r₀ + k φ`, whose second derivative
//! `√(r² + 4k²)` bounds the deviation by `δ²/8` of it.

use crate::geometry::Point3;
use std::f64::consts::{FRAC_PI_2, TAU};

/// Share of the chord tolerance that the chords of an arc may use, when the rest is left to what is done
/// with the moves afterwards (thinning, rounding to four decimals). Greater shares make fewer moves.
pub const ARC_SHARE: f64 = 0.5;

/// Start and end of an arc may differ by this much in their distance from the centre, mm: twice what
/// rounding all coordinates to three decimals does. More would turn misprints into spirals.
const MOST_MISMATCH: f64 = 3.0e-3;

/// Radii that differ by this share of the coordinates are the same, rounded.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// An arc with a smaller radius, mm, has no direction left in coordinates of a metre.
const LEAST_RADIUS: f64 = 1.0e-6;

/// No chord spans a greater angle, rad, whatever the deviation: a turn keeps four corners.
const GREATEST_STEP: f64 = FRAC_PI_2;

/// Most chords of one arc. More are a mistake in the radius or the deviation, and fill the memory.
const MAX_CHORDS: f64 = 1.0e7;

/// The plane of an arc, with the axis along which a helix rises.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Plane {
    /// G17: counter-clockwise from x to y; a helix rises along z.
    Xy,
    /// G18: counter-clockwise from z to x; a helix rises along y.
    Zx,
    /// G19: counter-clockwise from y to z; a helix rises along x.
    Yz,
}

impl Plane {
    /// The coordinates along its first and its second axis, and along the helix.
    fn axes(self) -> [usize; 3] {
        match self {
            Self::Xy => [0, 1, 2],
            Self::Zx => [2, 0, 1],
            Self::Yz => [1, 2, 0],
        }
    }
}

/// An arc or a helix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arc {
    /// Plane of the circle.
    pub plane: Plane,
    /// Where it begins, mm.
    pub start: Point3,
    /// Where it ends, mm. Where that is above, below or at the start, the arc is a full turn.
    pub end: Point3,
    /// Centre of the circle; its coordinate along the helix is of no account.
    pub centre: Point3,
    /// Clockwise (G2), seen against the axis of the helix.
    pub clockwise: bool,
    /// Full turns besides that from start to end.
    pub further_turns: u32,
}

/// Why an arc has no chords.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ArcError {
    /// A coordinate is not a finite number.
    #[error("a coordinate of the arc is not a finite number")]
    NotFinite,
    /// The deviation is not a positive number.
    #[error("chords cannot stay within {0} mm of an arc; the deviation must be positive")]
    Deviation(f64),
    /// The centre is at the start or at the end.
    #[error("the arc has the radius {0} mm; its centre must stand off its ends")]
    NoRadius(f64),
    /// Start and end are not equally far from the centre.
    #[error("the arc begins {start} mm from its centre and ends {end} mm from it")]
    Mismatch {
        /// Radius at the start.
        start: f64,
        /// Radius at the end.
        end: f64,
    },
    /// More chords than make sense.
    #[error("the arc would take {0:.0} chords; check its radius, its turns and the chord tolerance")]
    TooMany(f64),
}

/// An arc in polar coordinates around its centre.
#[derive(Debug, Clone, Copy)]
struct Sweep {
    /// Angle at the start, rad, and how far it goes on, signed.
    from: f64,
    angle: f64,
    /// Radius at the start and at the end.
    radii: [f64; 2],
}

impl Arc {
    fn sweep(&self) -> Result<Sweep, ArcError> {
        let all = [self.start, self.end, self.centre];
        if !all.iter().all(|p| p.coords.iter().all(|c| c.is_finite())) {
            return Err(ArcError::NotFinite);
        }
        let [a, b, _] = self.plane.axes();
        let polar = |p: Point3| {
            let (x, y) = (p[a] - self.centre[a], p[b] - self.centre[b]);
            (x.hypot(y), y.atan2(x))
        };
        let ((r0, from), (r1, to)) = (polar(self.start), polar(self.end));
        // Of the two the lesser, NaN excluded above.
        let least = r0.min(r1);
        if least < LEAST_RADIUS {
            return Err(ArcError::NoRadius(least));
        }
        if (r0 - r1).abs() > MOST_MISMATCH {
            return Err(ArcError::Mismatch { start: r0, end: r1 });
        }
        let same = self.start[a] == self.end[a] && self.start[b] == self.end[b];
        let on = if self.clockwise { from - to } else { to - from };
        let once = if same { TAU } else { on.rem_euclid(TAU) };
        // An end just behind the start by rounding makes a full turn, one at the start in angle none.
        let whole = once + TAU * f64::from(self.further_turns);
        Ok(Sweep { from, angle: if self.clockwise { -whole } else { whole }, radii: [r0, r1] })
    }

    /// Where the arc is at the share `t` (0 to 1) of its angle.
    fn at(&self, sweep: &Sweep, t: f64) -> Point3 {
        let [a, b, c] = self.plane.axes();
        let radius = sweep.radii[0] + t * (sweep.radii[1] - sweep.radii[0]);
        let (sin, cos) = (sweep.from + t * sweep.angle).sin_cos();
        let mut p = self.start;
        p[a] = self.centre[a] + radius * cos;
        p[b] = self.centre[b] + radius * sin;
        p[c] = self.start[c] + t * (self.end[c] - self.start[c]);
        p
    }

    /// The ends of the chords, the start left out, the last one the arc's end as it was given; all span
    /// the same angle. No chord strays from the arc, nor the arc from its chords, by more than
    /// `deviation`, mm.
    ///
    /// # Errors
    /// See [`ArcError`].
    ///
    /// # Tolerance
    /// The number of chords is the least one, but that a chord spans 90 degrees at most and that for a
    /// spiral the bound is used instead of the sagitta. Between chords the coordinates are rounded.
    pub fn chords(&self, deviation: f64) -> Result<Vec<Point3>, ArcError> {
        let sweep = self.sweep()?;
        if deviation.is_nan() || deviation <= 0.0 {
            return Err(ArcError::Deviation(deviation));
        }
        let radius = sweep.radii[0].max(sweep.radii[1]);
        let mismatch = sweep.radii[1] - sweep.radii[0];
        let drift = mismatch / sweep.angle;
        let farthest = [self.start, self.end, self.centre].iter().fold(0.0f64, |m, p| m.max(p.coords.amax()));
        let step = if mismatch.abs() <= ROUNDING * farthest || sweep.angle == 0.0 {
            // sagitta = 2 r sin²(δ/4), which keeps its digits where 1 − cos δ/2 loses them.
            4.0 * (0.5 * deviation / radius).sqrt().min(1.0).asin()
        } else {
            (8.0 * deviation / radius.hypot(2.0 * drift)).sqrt()
        };
        // The hair keeps a whole number of steps from taking one more by rounding.
        let count = (sweep.angle.abs() / step.min(GREATEST_STEP) - 1e-9).ceil().max(1.0);
        if count.is_nan() || count > MAX_CHORDS {
            return Err(ArcError::TooMany(count));
        }
        let inner = (1..count as u64).map(|k| self.at(&sweep, k as f64 / count));
        Ok(inner.chain(std::iter::once(self.end)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cutter::Cutter;
    use crate::monitor::Silent;
    use crate::sim::scenes::{path_through, square_grid};
    use crate::sim::{NOT_CUT, ZMap, cut_reference};
    use crate::toolpath::distance_to_segment;
    use proptest::prelude::*;

    fn quarter() -> Arc {
        Arc {
            plane: Plane::Xy,
            start: Point3::new(11.0, 2.0, 5.0),
            end: Point3::new(1.0, 12.0, 5.0),
            centre: Point3::new(1.0, 2.0, 0.0),
            clockwise: false,
            further_turns: 0,
        }
    }

    #[test]
    fn the_number_of_chords_is_the_least() {
        // A sagitta of 10 (1 − cos 1°): exactly 45 chords of 2° in a quarter.
        let sagitta = |degrees: f64| 10.0 * (1.0 - (0.5 * degrees).to_radians().cos());
        assert_eq!(quarter().chords(sagitta(2.0)).unwrap().len(), 45);
        assert_eq!(quarter().chords(0.999 * sagitta(2.0)).unwrap().len(), 46);
        assert_eq!(Arc { clockwise: true, ..quarter() }.chords(sagitta(2.0)).unwrap().len(), 135);
        assert_eq!(Arc { further_turns: 2, ..quarter() }.chords(sagitta(2.0)).unwrap().len(), 45 + 360);
        let circle = Arc { end: quarter().start, ..quarter() };
        assert_eq!(circle.chords(sagitta(2.0)).unwrap().len(), 180);
        assert_eq!(circle.chords(1e3).unwrap().len(), 4, "a turn keeps four corners");
    }

    #[test]
    fn planes_turn_as_controls_turn_them() {
        // Seen against the axis of the helix, counter-clockwise from the first axis to the second.
        for (plane, [a, b, c]) in [(Plane::Xy, [0, 1, 2]), (Plane::Zx, [2, 0, 1]), (Plane::Yz, [1, 2, 0])] {
            let (mut start, mut end, mut middle) = (Point3::origin(), Point3::origin(), Point3::origin());
            (start[a], end[b], end[c]) = (1.0, 1.0, 4.0);
            (middle[a], middle[b], middle[c]) = (0.5f64.sqrt(), 0.5f64.sqrt(), 2.0);
            let arc = Arc { plane, start, end, centre: Point3::origin(), clockwise: false, further_turns: 0 };
            let chords = arc.chords(1.0 - (22.5f64).to_radians().cos() + 1e-12).unwrap();
            assert_eq!(chords.len(), 2);
            assert!((chords[0] - middle).norm() < 1e-15 && chords[1] == end, "{plane:?} {chords:?}");
        }
    }

    proptest! {
        /// Dense places of the true helix lie within the deviation of the chords, and the middles of the
        /// chords within it of the helix; half as many chords would not do.
        #[test]
        fn chords_stay_within_the_deviation(
            radius in 0.01..300.0f64, from in -4.0..4.0f64, turn in 0.01..6.2f64, rise in -40.0..40.0f64,
            further_turns in 0..3u32, clockwise: bool, plane in 0..3usize, share in 1e-6..0.2f64,
            mismatch in prop_oneof![Just(0.0), -2.9e-3..2.9e-3f64],
        ) {
            let plane = [Plane::Xy, Plane::Zx, Plane::Yz][plane];
            let [a, b, c] = plane.axes();
            let centre = Point3::new(3.0, -7.0, 11.0);
            let at = |angle: f64, r: f64, z: f64| {
                let mut p = centre;
                (p[a], p[b], p[c]) = (centre[a] + r * angle.cos(), centre[b] + r * angle.sin(), z);
                p
            };
            let sense = if clockwise { -1.0 } else { 1.0 };
            let end = at(from + sense * turn, radius + mismatch.max(-0.5 * radius), rise);
            let arc = Arc { plane, start: at(from, radius, 0.0), end, centre, clockwise, further_turns };
            let deviation = share * radius;
            let chords = arc.chords(deviation).unwrap();
            prop_assert_eq!(chords[chords.len() - 1], end);
            let whole = turn + TAU * f64::from(further_turns);
            let true_at = |t: f64| {
                let r = radius + t * mismatch.max(-0.5 * radius);
                at(from + sense * t * whole, r, t * rise)
            };
            let n = chords.len() as f64;
            let mut greatest = 0.0f64;
            let mut before = arc.start;
            for (k, &p) in chords.iter().enumerate().take(40) {
                for i in 0..=16 {
                    let t = (k as f64 + f64::from(i) / 16.0) / n;
                    greatest = greatest.max(distance_to_segment(&true_at(t), &before, &p));
                }
                before = p;
            }
            let rounding = 1e-14 * (radius + 40.0);
            prop_assert!(greatest <= deviation * (1.0 + 1e-7) + rounding, "{greatest} {deviation}");
            // One chord fewer would stray farther: the sagitta of its angle.
            let coarser = whole / (n - 1.0);
            if mismatch == 0.0 && coarser < GREATEST_STEP {
                prop_assert!(radius * (1.0 - (0.5 * coarser).cos()) > deviation * (1.0 - 1e-6) - rounding);
            }
        }
    }

    #[test]
    fn impossible_arcs_are_refused() {
        let arc = quarter();
        let nan = Point3::new(f64::NAN, 0.0, 0.0);
        assert_eq!(Arc { centre: nan, ..arc }.chords(0.1), Err(ArcError::NotFinite));
        assert_eq!(arc.chords(0.0), Err(ArcError::Deviation(0.0)));
        assert!(matches!(arc.chords(f64::NAN), Err(ArcError::Deviation(_))));
        assert_eq!(Arc { centre: arc.start, ..arc }.chords(0.1), Err(ArcError::NoRadius(0.0)));
        let beside = Arc { centre: Point3::new(1.0, 2.1, 0.0), ..arc };
        assert!(matches!(beside.chords(0.1), Err(ArcError::Mismatch { .. })));
        let endless = Arc { further_turns: u32::MAX, ..arc };
        assert!(matches!(endless.chords(0.1), Err(ArcError::TooMany(_))));
        assert!(matches!(arc.chords(1e-300), Err(ArcError::TooMany(_))));
    }

    /// A ball cut along the chords of a helix leaves a surface within the deviation, along the normal, of
    /// that along a hundred times as many chords.
    #[test]
    fn a_part_cut_along_chords_differs_by_no_more_than_they_do() {
        const DEVIATION: f64 = 2e-3;
        let ball = Cutter::ball(6.0).unwrap();
        let arc = Arc {
            plane: Plane::Xy,
            start: Point3::new(16.0, 10.0, 1.0),
            end: Point3::new(10.0, 4.0, -1.0),
            centre: Point3::new(10.0, 10.0, 0.0),
            clockwise: false,
            further_turns: 0,
        };
        let tips = |deviation| {
            let mut tips = arc.chords(deviation).unwrap();
            tips.insert(0, arc.start);
            tips
        };
        let (coarse, fine) = (tips(DEVIATION), tips(DEVIATION * 1e-4));
        assert!(fine.len() > 95 * coarse.len());
        let stock = ZMap::block(square_grid(20.0, 0.25), 8.0);
        let cut = |tips: &[Point3]| {
            cut_reference(&stock, &ball, &path_through(tips.iter().copied()), &Silent).unwrap()
        };
        let (cut, exact) = (cut(&coarse), cut(&fine));
        let mut greatest = 0.0f64;
        for j in 0..stock.grid.ny {
            for i in 0..stock.grid.nx {
                let k = j * stock.grid.nx + i;
                if cut.cut_by[k] == NOT_CUT || exact.cut_by[k] == NOT_CUT {
                    continue;
                }
                // How far the cut point is from the centres of the fine path, less the radius.
                let at = stock.grid.centre(i, j);
                let p = Point3::new(at.x, at.y, f64::from(cut.height[k]) - 3.0);
                let away = fine.windows(2).map(|w| distance_to_segment(&p, &w[0], &w[1]));
                greatest = greatest.max((away.fold(f64::INFINITY, f64::min) - 3.0).abs());
            }
        }
        assert!(greatest <= DEVIATION + 1e-6, "{greatest}: {DEVIATION} and heights in f32");
        assert!(greatest > 0.5 * DEVIATION, "the chords are there at all: {greatest}");
    }
}
