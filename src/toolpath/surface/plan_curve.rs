//! Curves of the plan view as passes: the cutter dropped on the part along each.
//!
//! Enters: a curve `s → (x, y)` of the cutter's axis, about one mm a unit. Leaves: tip positions of the runs
//! on which the cutter touches surface, and rolls over the part's border no farther than is of use.

use std::mem;

use super::border::Border;
use crate::moves::chord::Watch;
use crate::vocabulary::PassSettings;
use cutter::Cutter;
use drop_cutter::{Drop, DropCutter};
use geometry::{Point2, Point3, Vector2};
use work::monitor::{Cancelled, Monitor};

/// How closely the end of a pass is placed, mm. A pointed cutter has dropped by as much of it as its point is
/// steep, and the pass runs straight to there.
const END_PRECISION: f64 = 1e-9;

/// Shorter stretches are left out, mm.
const LEAST_STRETCH: f64 = 1e-6;

/// Rolls are sampled so many times as finely as passes on surface.
const ROLLING_FINER: usize = 10;

/// Places of a roll at the end of a pass that are looked at.
const ROLL_STEPS: usize = 24;

/// Chords of rolls have no less than this share of the tolerance: the side of a cutter may stand upright.
const LEAST_UPRIGHT: f64 = 0.05;

/// Where the axis is at `s`.
pub(crate) type Curve<'a> = &'a (dyn Fn(f64) -> Vector2 + Sync);

/// How the cutter stands on the part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Footing {
    /// It touches surface.
    Inside,
    /// It touches the border and has rolled over it by no more than the overrun.
    Rolling,
    /// It has rolled farther, or does not touch the part.
    Off,
}

/// Turns curves of the plan view into passes.
pub(crate) struct PlanCurves<'a> {
    pub drop: &'a DropCutter<'a>,
    pub border: &'a Border<'a>,
    pub cutter: &'a Cutter,
    /// How far a pass may roll on over the border, mm.
    pub overrun: f64,
    pub settings: &'a PassSettings<'a>,
    pub monitor: &'a dyn Monitor,
}

impl PlanCurves<'_> {
    fn drop_at(&self, curve: Curve<'_>, s: f64) -> Option<(Vector2, Drop)> {
        let xy = curve(s);
        self.drop.at(xy.x, xy.y).map(|d| (xy, d))
    }

    fn tip(&self, curve: Curve<'_>, s: f64) -> Option<Point3> {
        self.drop_at(curve, s).map(|(xy, d)| Point3::new(xy.x, xy.y, d.tip_z))
    }

    /// How far the cutter has rolled over the border at `s`; `None` off the part.
    fn rolled(&self, curve: Curve<'_>, s: f64) -> Option<f64> {
        let (xy, drop) = self.drop_at(curve, s)?;
        if !self.border.holds(&drop.contact) {
            return Some(0.0);
        }
        Some(self.border.rolled(self.cutter, &xy.into(), &drop.contact))
    }

    /// How the cutter stands at `s`.
    fn contact(&self, curve: Curve<'_>, s: f64) -> Footing {
        match self.rolled(curve, s) {
            Some(rolled) if rolled <= END_PRECISION => Footing::Inside,
            Some(rolled) if rolled <= self.overrun => Footing::Rolling,
            _ => Footing::Off,
        }
    }

    /// The runs of a curve over `[s0, s1]` (`s` in mm) on which the cutter cuts surface, as moves. Each run
    /// is made of stretches inside the part and stretches that roll along its border.
    pub fn pieces(&self, curve: Curve<'_>, [s0, s1]: [f64; 2]) -> Result<Vec<Vec<Point3>>, Cancelled> {
        let count = ((s1 - s0) / self.settings.sampling).ceil().max(1.0) as usize;
        let at = |k: usize| s0 + (s1 - s0) * k as f64 / count as f64;
        let mut stretches: Vec<(Footing, f64, f64)> = Vec::new();
        let mut before = (s0, self.contact(curve, s0));
        let mut start = s0;
        let mut watch = Watch::new(self.monitor);
        for k in 1..=count {
            let whole = at(k);
            let rolls = before.1 == Footing::Rolling && self.contact(curve, whole) == Footing::Rolling;
            // From corner to corner of the border it may leave the part for less than a sample.
            let parts = if rolls { ROLLING_FINER } else { 1 };
            let from = before.0;
            for part in 1..=parts {
                watch.step()?;
                let s =
                    if part == parts { whole } else { from + (whole - from) * part as f64 / parts as f64 };
                let now = self.contact(curve, s);
                // Several changes may lie between two samples; each is located in turn.
                while before.1 != now {
                    watch.step()?;
                    let (end, next) = self.change(curve, before, s);
                    stretches.push((before.1, start, end));
                    (before, start) = ((next, self.contact(curve, next)), next);
                }
                before = (s, now);
            }
        }
        stretches.push((before.1, start, s1));
        let mut pieces = Vec::new();
        for run in stretches.split_mut(|(contact, ..)| *contact == Footing::Off) {
            self.shorten_ends(curve, run);
            pieces.extend(self.moves(curve, run)?);
        }
        pieces.retain(|points| points.len() >= 2);
        Ok(pieces)
    }

    /// Cuts the rolls at both ends of a run back to what is of use.
    fn shorten_ends(&self, curve: Curve<'_>, run: &mut [(Footing, f64, f64)]) {
        let useful = |from: f64, end: f64| {
            let place = |k: usize| from + (end - from) * k as f64 / ROLL_STEPS as f64;
            // Up to the step after the last that serves.
            place(
                (1..=ROLL_STEPS)
                    .rev()
                    .find(|&k| self.serves(curve, place(k)))
                    .map_or(1, |k| (k + 1).min(ROLL_STEPS)),
            )
        };
        if let [(Footing::Rolling, a, b)] = run {
            // Beside the part all along.
            let place = |k: usize| *a + (*b - *a) * k as f64 / ROLL_STEPS as f64;
            if !(1..ROLL_STEPS).any(|k| self.serves(curve, place(k))) {
                *b = *a;
            }
            return;
        }
        if let Some((Footing::Rolling, a, b)) = run.first_mut() {
            *a = useful(*b, *a);
        }
        if let Some((Footing::Rolling, a, b)) = run.last_mut() {
            *b = useful(*a, *b);
        }
    }

    /// Whether the part lies half way from where the cutter touches to where it touches on the pass beside,
    /// on either side. In a hollow contacts lie farther apart than axes.
    fn serves(&self, curve: Curve<'_>, s: f64) -> bool {
        let along = (curve(s + LEAST_STRETCH) - curve(s - LEAST_STRETCH)) / (2.0 * LEAST_STRETCH);
        let across = Vector2::new(-along.y, along.x) * self.overrun;
        let Some(here) = self.touched(curve(s)) else { return false };
        let middle = |beside: Vector2| Some(here + (self.touched(curve(s) + beside)? - here) * 0.5);
        [across, -across].into_iter().any(|beside| middle(beside).is_some_and(|p| self.border.under(&p)))
    }

    /// Where the cutter with its axis there touches the part, or would, had the surface gone on over its
    /// border.
    fn touched(&self, axis: Vector2) -> Option<Point2> {
        let drop = self.drop.at(axis.x, axis.y)?;
        let contact = drop.contact.point.xy();
        let on_border = self.border.holds(&drop.contact);
        let roll = if on_border {
            self.border.roll(self.cutter, &axis.into(), &drop.contact).xy()
        } else {
            Vector2::zeros()
        };
        Some(contact + roll)
    }

    /// The moves of a run; where it leaves the part after all, those before and behind apart.
    fn moves(&self, curve: Curve<'_>, run: &[(Footing, f64, f64)]) -> Result<Vec<Vec<Point3>>, Cancelled> {
        let (mut pieces, mut points) = (Vec::new(), Vec::<Point3>::new());
        for &(contact, a, b) in run.iter().filter(|(_, a, b)| b - a > LEAST_STRETCH) {
            // Rolling over corners of the border the cutter rises and falls within less than it does on
            // surface.
            let mut settings = *self.settings;
            if contact == Footing::Rolling {
                settings.sampling /= ROLLING_FINER as f64;
                settings.chord_tolerance *= self.least_upright(curve, [a, b]);
            }
            let stretch = settings.moves(a, b, &mut |s| self.tip(curve, s), self.monitor)?;
            let ends = points.last().zip(stretch.first());
            if ends.is_some_and(|(end, next)| (next - end).norm() > self.settings.chord_tolerance) {
                pieces.push(mem::take(&mut points));
            }
            let joined = usize::from(!points.is_empty());
            points.extend(stretch.into_iter().skip(joined));
        }
        pieces.push(points);
        Ok(pieces)
    }

    /// The least cosine of the slope by which the cutter touches the border along a roll: a chord cuts the
    /// border deeper by as much as it is off over that.
    fn least_upright(&self, curve: Curve<'_>, [a, b]: [f64; 2]) -> f64 {
        let upright = |k: usize| {
            let (axis, drop) = self.drop_at(curve, a + (b - a) * k as f64 / ROLL_STEPS as f64)?;
            let arm = (drop.contact.point.xy().coords - axis).norm();
            let lean = self.cutter.profile().incline(arm).sin;
            Some((1.0 - lean * lean).max(0.0).sqrt())
        };
        let rounded = self.cutter.corner_radius() > 0.0;
        let least = (0..=ROLL_STEPS).filter(|_| rounded).filter_map(upright).fold(1.0, f64::min);
        least.max(LEAST_UPRIGHT)
    }

    /// Where the contact changes from what it is at `before` on the way to `s`: the last place that
    /// is as before, and the first known one that is not.
    fn change(&self, curve: Curve<'_>, before: (f64, Footing), s: f64) -> (f64, f64) {
        let (mut same, mut other) = (before.0, s);
        while other - same > 0.5 * END_PRECISION {
            let middle = 0.5 * (same + other);
            if middle <= same || middle >= other {
                break;
            }
            if self.contact(curve, middle) == before.1 {
                same = middle;
            } else {
                other = middle;
            }
        }
        (same, other)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vocabulary::{SAMPLING_OVER_RADIUS, Step};
    use geometry::TriangleMesh;
    use part::Part;
    use work::monitor::Silent;

    /// A line beside two plates with a slot between them: the ball rolls off the corner of one and comes to
    /// the other a sixteenth of a millimetre on, less than passes are sampled at. It does not go straight on
    /// over the slot, nor does it lose the way behind it.
    #[test]
    fn between_two_corners_a_pass_ends_and_another_begins() {
        let (half, radius, beside) = (0.8f64, 3.0f64, 2.9f64);
        let plate = |x: [f64; 2]| {
            [[x[0], -5.0], [x[1], -5.0], [x[1], 0.0], [x[0], 0.0]].map(|[x, y]| Point3::new(x, y, 0.0))
        };
        let corners = [plate([-9.0, -half]), plate([half, 9.0])].concat();
        let triangles = vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
        let part = Part::from_mesh(TriangleMesh::new(corners, triangles).unwrap().0);
        let cutter = Cutter::ball(2.0 * radius).unwrap();
        let settings = PassSettings::upright(Step::Stepover(0.5), SAMPLING_OVER_RADIUS * radius);
        let curves = PlanCurves {
            drop: &DropCutter::new(&part, &cutter),
            border: &Border::of(&part),
            cutter: &cutter,
            overrun: 2.0 * radius,
            settings: &settings,
            monitor: &Silent,
        };
        let reach = (radius * radius - beside * beside).sqrt();
        // Wherever the samples fall.
        for shift in [0.0, 0.1, 0.2, 0.3, 0.4] {
            let line = |s: f64| Vector2::new(s, beside);
            let pieces = curves.pieces(&line, [-4.0 + shift, 4.0 + shift]).unwrap();
            let ends: Vec<[f64; 2]> = pieces.iter().map(|p| [p[0].x, p[p.len() - 1].x]).collect();
            let wanted = [[-4.0 + shift, reach - half], [half - reach, 4.0 + shift]];
            assert_eq!(ends.len(), 2, "{ends:?}");
            for (found, wanted) in ends.iter().flatten().zip(wanted.iter().flatten()) {
                assert!((found - wanted).abs() < 1e-6, "{ends:?} {wanted}");
            }
        }
    }
}
