//! Zigzag: passes in parallel vertical planes, the cutter dropped on the part along each.
//!
//! One stepover serves the whole part, so it is that of the worst place. Passes a plan-view
//! distance Δ apart lie `Δ/√(1 − (n·e)²)` apart on the surface of the cutter's centres, `e` the
//! plan direction across the feed; that surface is the part's offset, where lengths across the
//! feed are `1 − κ r` times those on the part.

use super::border::{Border, useful_overrun};
use super::chart::Chart;
use super::chord::Watch;
use super::drop::{Drop, DropCutter};
use super::plan::{PassSettings, Passes, PlanError};
use super::{FeedDirection, Step};
use crate::cutter::Cutter;
use crate::geometry::{Point3, Vector2};
use crate::monitor::{self, Cancelled, Monitor};
use crate::part::Part;

/// The stepover is never planned below this share of that on a horizontal plane: a steep wall
/// would otherwise ask for endless passes over the whole part. What is left there is measured.
const LEAST_OVER_PLANE: f64 = 0.1;

/// Places a side of each chart at which the stepover is computed.
const STEPOVER_SAMPLES: usize = 160;

/// How closely the end of a pass is placed, mm.
const END_PRECISION: f64 = 1e-6;

/// Plans passes in the direction `angle` (rad from x).
pub fn passes(
    part: &Part,
    cutter: &Cutter,
    angle: f64,
    settings: &PassSettings,
    monitor: &dyn Monitor,
) -> Result<Passes, PlanError> {
    let charts = Chart::all(part, cutter)?;
    let mut notes = Vec::new();
    let stepover = match settings.step {
        Step::Stepover(s) => s,
        Step::Scallop(h) => safe_stepover(&charts, cutter, angle, h, &mut notes),
    };
    let (along, across) = (Vector2::new(angle.cos(), angle.sin()), Vector2::new(-angle.sin(), angle.cos()));
    let extent = |e: &Vector2| {
        let all = charts.iter().map(|c| c.extent_of_axes(part, cutter, e));
        all.fold([f64::INFINITY, f64::NEG_INFINITY], |a, b| [a[0].min(b[0]), a[1].max(b[1])])
    };
    let (from_to, sides) = (extent(&along), extent(&across));
    let count = ((sides[1] - sides[0]) / stepover - 1e-9).ceil().max(1.0) as usize;
    // A stepover that the user asked for is kept exactly, and the passes stand in the middle.
    let pitch = match settings.step {
        Step::Stepover(s) => s,
        Step::Scallop(_) => (sides[1] - sides[0]) / count as f64,
    };
    let middle = 0.5 * (sides[0] + sides[1]);
    let line = Line {
        drop: DropCutter::new(part, cutter),
        border: Border::of(part),
        cutter,
        along,
        across,
        overrun: pitch,
        settings,
        monitor,
    };
    monitor.start("planning zigzag", count as u64);
    let lines = crate::parallel::try_map(count, |k| {
        monitor::check(monitor)?;
        let offset = middle + (k as f64 - 0.5 * (count as f64 - 1.0)) * pitch;
        let pieces = line.pieces(offset, [from_to[0] - pitch, from_to[1] + pitch])?;
        monitor.advance(1);
        Ok::<_, PlanError>(pieces)
    })?;
    Ok(Passes { passes: lines.into_iter().flatten().collect(), notes })
}

/// The greatest stepover that keeps the scallop everywhere.
fn safe_stepover(charts: &[Chart], cutter: &Cutter, angle: f64, h: f64, notes: &mut Vec<String>) -> f64 {
    let e = Vector2::new(-angle.sin(), angle.cos());
    let plane = (8.0 * h * cutter.radius()).sqrt();
    let mut least = f64::INFINITY;
    for chart in charts {
        for [u, v] in chart.grid(STEPOVER_SAMPLES) {
            let Some(p) = chart.at(u, v) else { continue };
            let Some(t) = p.feed_tangent(FeedDirection::Angle(angle)) else { continue };
            let (width, too_concave) = p.strip_width(cutter, &t, Step::Scallop(h));
            let bend = 1.0 - p.curvature_along(&p.normal.cross(&t)) * cutter.corner_radius();
            let lean = (1.0 - p.normal.xy().dot(&e).powi(2)).max(0.0).sqrt();
            // Where the cutter hardly fits, one pass serves the whole hollow, though the formula asks
            // for ever closer ones.
            if bend > 0.0 && !too_concave {
                least = least.min(width * bend * lean);
            }
        }
    }
    if least.is_finite() && least >= LEAST_OVER_PLANE * plane {
        return least;
    }
    notes.push(format!(
        "the steepest places would need a stepover of {:.4} mm; {:.4} mm is used, and scallops there may exceed the \
         target (another angle, or a streamline path, helps)",
        if least.is_finite() { least } else { 0.0 },
        LEAST_OVER_PLANE * plane
    ));
    LEAST_OVER_PLANE * plane
}

/// How the cutter stands on the part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Contact {
    /// It touches surface.
    Inside,
    /// It touches the border and has rolled over it by no more than the overrun.
    Rolling,
    /// It has rolled farther, or does not touch the part.
    Off,
}

/// One family of parallel vertical planes.
struct Line<'a> {
    drop: DropCutter<'a>,
    border: Border<'a>,
    cutter: &'a Cutter,
    along: Vector2,
    across: Vector2,
    /// How far a pass may roll on over the border, mm.
    overrun: f64,
    settings: &'a PassSettings,
    monitor: &'a dyn Monitor,
}

impl Line<'_> {
    fn drop_at(&self, offset: f64, s: f64) -> Option<(Vector2, Drop)> {
        let xy = self.along * s + self.across * offset;
        self.drop.at(xy.x, xy.y).map(|d| (xy, d))
    }

    fn tip(&self, offset: f64, s: f64) -> Option<Point3> {
        self.drop_at(offset, s).map(|(xy, d)| Point3::new(xy.x, xy.y, d.tip_z))
    }

    /// How the cutter stands at `s`.
    fn contact(&self, offset: f64, s: f64) -> Contact {
        let Some((xy, drop)) = self.drop_at(offset, s) else { return Contact::Off };
        let rc = self.cutter.corner_radius();
        if rc == 0.0 || !self.border.holds(&drop.contact) {
            return Contact::Inside;
        }
        // Direction from the contact to the centre of the corner's circle, against the normal.
        let out = xy - drop.contact.point.coords.xy();
        let rho = out.norm();
        let lean = self.cutter.profile().incline(rho).sin;
        let horizontal = if rho > 0.0 { out * (lean / rho) } else { out };
        let toward = nalgebra::Vector3::new(horizontal.x, horizontal.y, (1.0 - lean * lean).sqrt());
        let rolled = (toward - drop.contact.normal).norm() * rc;
        if rolled <= END_PRECISION {
            Contact::Inside
        } else if rolled <= self.overrun {
            Contact::Rolling
        } else {
            Contact::Off
        }
    }

    /// The runs of the line at `offset` on which the cutter cuts surface, as moves. Each run is made
    /// of stretches inside the part and stretches that roll along its border.
    fn pieces(&self, offset: f64, [s0, s1]: [f64; 2]) -> Result<Vec<Vec<Point3>>, Cancelled> {
        let count = ((s1 - s0) / self.settings.sampling).ceil().max(1.0) as usize;
        let at = |k: usize| s0 + (s1 - s0) * k as f64 / count as f64;
        let mut stretches: Vec<(Contact, f64, f64)> = Vec::new();
        let mut before = (s0, self.contact(offset, s0));
        let mut start = s0;
        let mut watch = Watch::new(self.monitor);
        for k in 1..=count {
            watch.step()?;
            let s = at(k);
            let now = self.contact(offset, s);
            // Several changes may lie between two samples; each is located in turn.
            while before.1 != now {
                watch.step()?;
                let (end, next) = self.change(offset, before, s);
                stretches.push((before.1, start, end));
                (before, start) = ((next, self.contact(offset, next)), next);
            }
            before = (s, now);
        }
        stretches.push((before.1, start, s1));
        let runs = stretches.split_mut(|(contact, ..)| *contact == Contact::Off);
        let pieces = runs.map(|run| {
            self.shorten_ends(run);
            self.moves(offset, run)
        });
        pieces.filter(|points| points.as_ref().map_or(true, |points| points.len() >= 2)).collect()
    }

    /// Cuts the rolls at both ends of a run back to what is of use. A roll over the whole overrun on a
    /// length l means that the pass meets the border at an angle of sine overrun/l.
    fn shorten_ends(&self, run: &mut [(Contact, f64, f64)]) {
        let useful = |a: f64, b: f64| {
            let sine = (self.overrun / (b - a)).min(1.0);
            useful_overrun((1.0 - sine * sine).sqrt() / sine) * self.overrun
        };
        if let Some((Contact::Rolling, a, b)) = run.first_mut() {
            *a = a.max(*b - useful(*a, *b));
        }
        if let Some((Contact::Rolling, a, b)) = run.last_mut() {
            *b = b.min(*a + useful(*a, *b));
        }
    }

    fn moves(&self, offset: f64, run: &[(Contact, f64, f64)]) -> Result<Vec<Point3>, Cancelled> {
        let mut points: Vec<Point3> = Vec::new();
        for &(_, a, b) in run.iter().filter(|(_, a, b)| b - a > END_PRECISION) {
            let stretch = self.settings.moves(a, b, &mut |s| self.tip(offset, s), self.monitor)?;
            let joined = usize::from(!points.is_empty());
            points.extend(stretch.into_iter().skip(joined));
        }
        Ok(points)
    }

    /// Where the contact changes from what it is at `before` on the way to `s`: the last place that
    /// is as before, and the first known one that is not.
    fn change(&self, offset: f64, before: (f64, Contact), s: f64) -> (f64, f64) {
        let (mut same, mut other) = (before.0, s);
        while other - same > 0.5 * END_PRECISION {
            let middle = 0.5 * (same + other);
            if middle <= same || middle >= other {
                break;
            }
            if self.contact(offset, middle) == before.1 {
                same = middle;
            } else {
                other = middle;
            }
        }
        (same, other)
    }
}
