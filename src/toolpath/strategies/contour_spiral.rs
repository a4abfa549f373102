//! One spiral between the passes of an iso-scallop path from all borders (a morph spiral): a single pass
//! without retracts.
//!
//! The front from the border gives closed levels, one inside the other. Places of neighbouring levels with
//! the same share of their length correspond; on its way once around the spiral moves evenly from one level
//! to the next, and every place of it is put onto its own level, so that turns keep the distance of levels.
//! At the corners of its turns, where that distance is less than that of the turns, further short passes run
//! halfway.
//!
//! Limits: the levels must be single closed curves up to the middle; a front that parts is refused.

use super::iso_scallop::arrival;
use crate::levels::spacing::level_tangent;
use crate::surface::chart::Chart;
use crate::vocabulary::{PassSettings, Passes, PlanError, Task};
use cutter::Cutter;
use drop_cutter::DropCutter;
use field::{LevelTracer, ScalarField, surface_gradient_length};
use geometry::Point3;
use work::monitor::{self, Cancelled};

/// Grid cells a side on which levels are found.
const TRACE_CELLS: usize = 240;

/// Levels this close to the middle may be missing: their curves are smaller than the grid's cells.
const MISSING_TURNS: usize = 2;

/// Turns may be this share of their distance wider apart than allowed before a further pass is put in
/// between.
const SLACK: f64 = 0.02;

/// How often the distance of two turns is halved by further passes. Corners of right angles need one halving,
/// sharper ones two.
const HALVINGS: usize = 3;

/// Places looked at from one point of a turn to the next.
const PARTS: usize = 8;

/// Further passes reach beyond the stretch that needs them by this many strip widths.
const OVERLAP: f64 = 1.0;

/// A place of the spiral may be this many turns off the line between its two levels; farther, it was put onto
/// another branch.
const MOST_STRAY: f64 = 1.0;

/// Plans one spiral on each patch.
pub fn passes(task: &Task<'_>) -> Result<Passes, PlanError> {
    let Task { part, cutter, ref settings, .. } = *task;
    let mut all = Passes::default();
    let charts = Chart::all(part, cutter, settings.guide())?;
    for (k, chart) in charts.iter().enumerate() {
        all.append_patch([k, charts.len()], on_chart(task, chart)?);
    }
    Ok(all)
}

fn on_chart(task: &Task<'_>, chart: &Chart) -> Result<Passes, PlanError> {
    let Task { part, cutter, ref settings, monitor, .. } = *task;
    let [[u0, u1], [v0, v1]] = chart.domain;
    let border = vec![[u0, v0], [u1, v0], [u1, v1], [u0, v1], [u0, v0]];
    let field = arrival(chart, cutter, settings.step, &[border], false, monitor)?;
    let field = ScalarField::Grid(field);
    let metric = |u: f64, v: f64| chart.jet(u, v).first_form();
    let tracer = LevelTracer::new(&field, &metric, chart.domain, [0.0; 2], TRACE_CELLS, settings.sampling);
    let levels = Levels::trace(&tracer, [0.5 * (u0 + u1), v0])?;
    let spiral = Spiral { tracer: &tracer, levels, chart, cutter, field: &field, settings };
    let dropped = task.dropped();
    let drop = DropCutter::watched(part, dropped, monitor)?;
    let tip = |[u, v]: [f64; 2]| {
        let p = chart.at(u, v)?;
        let axis = chart.axis_over(&p, dropped, settings.chord_tolerance);
        drop.at(axis.x, axis.y).map(|d| Point3::new(axis.x, axis.y, d.tip_z))
    };
    let moves = |points: &[[f64; 2]]| -> Result<Vec<Point3>, Cancelled> {
        if points.len() < 2 {
            return Ok(Vec::new());
        }
        let last = (points.len() - 1) as f64;
        let steps = PassSettings { sampling: 1.0, ..*settings };
        steps.moves_by_contacts([0.0, last], &mut |s| tip(between(points, s)), &drop, monitor)
    };
    let turns = spiral.levels.curves.len();
    monitor.start("planning spiral", turns as u64);
    let mut passes = vec![moves(&spiral.whole())?];
    let further = work::parallel::try_map(turns.saturating_sub(1), |k| {
        monitor::check(monitor)?;
        monitor.advance(1);
        let runs = spiral.further(k);
        runs.iter().map(|run| moves(run)).collect::<Result<Vec<_>, Cancelled>>()
    })?;
    passes.extend(further.into_iter().flatten());
    let mut notes = vec![format!("one spiral of {turns} turns")];
    if passes.len() > 1 {
        notes.push(format!("{} short passes run between turns where they have corners", passes.len() - 1));
    }
    Ok(Passes { passes, notes, ..Passes::default() })
}

/// The point at `s` of a polyline whose points have the parameters 0, 1, 2, …, rounded through them
/// (Catmull–Rom).
fn between(points: &[[f64; 2]], s: f64) -> [f64; 2] {
    let k = (s.max(0.0) as usize).min(points.len() - 2);
    let t = s - k as f64;
    let [a, b, c, d] = [k.saturating_sub(1), k, k + 1, (k + 2).min(points.len() - 1)].map(|k| points[k]);
    [0, 1].map(|i| {
        let (m, n) = (0.5 * (c[i] - a[i]), 0.5 * (d[i] - b[i]));
        let (rise, both) = (c[i] - b[i], m + n);
        b[i] + t * (m + t * (3.0 * rise - both - m + t * (both - 2.0 * rise)))
    })
}

/// Closed levels from the border to the middle, all in the same sense, each beginning near where the one
/// before does.
struct Levels {
    /// φ from one to the next; the first is half of it from the border.
    step: f64,
    curves: Vec<Loop>,
}

/// A closed curve in parameters, the first point repeated at the end, with the length up to each point, mm.
struct Loop {
    points: Vec<[f64; 2]>,
    lengths: Vec<f64>,
}

impl Loop {
    /// The place at a share of the length.
    fn at(&self, share: f64) -> [f64; 2] {
        let s = share * self.length();
        let k = self.lengths.partition_point(|l| *l <= s).clamp(1, self.points.len() - 1);
        let (a, b) = (self.lengths[k - 1], self.lengths[k]);
        let t = if b > a { ((s - a) / (b - a)).clamp(0.0, 1.0) } else { 0.0 };
        [0, 1].map(|c| self.points[k - 1][c] + t * (self.points[k][c] - self.points[k - 1][c]))
    }

    fn length(&self) -> f64 {
        self.lengths[self.lengths.len() - 1]
    }
}

impl Levels {
    /// Traces the levels; the first begins near `start`.
    fn trace(tracer: &LevelTracer<'_>, mut start: [f64; 2]) -> Result<Self, PlanError> {
        let [lo, hi] = tracer.range();
        let turns = ((hi - lo).ceil() as usize).max(1);
        let step = (hi - lo) / turns as f64;
        let mut curves = Vec::with_capacity(turns);
        for k in 0..turns {
            let found = tracer.curves(lo + (k as f64 + 0.5) * step);
            let [curve] = &found[..] else {
                if k + MISSING_TURNS >= turns && k > 0 {
                    break;
                }
                return Err(Self::parted());
            };
            if !curve.closed || curve.points.len() < 3 {
                return Err(Self::parted());
            }
            let mut points = curve.points.clone();
            let next = |i: usize| (i + 1) % points.len();
            let twice_area: f64 = (0..points.len())
                .map(|i| points[i][0] * points[next(i)][1] - points[next(i)][0] * points[i][1])
                .sum();
            if twice_area < 0.0 {
                points.reverse();
            }
            let nearest = (0..points.len()).min_by(|&a, &b| {
                tracer.distance(points[a], start).total_cmp(&tracer.distance(points[b], start))
            });
            points.rotate_left(nearest.unwrap_or(0));
            start = points[0];
            points.push(start);
            let mut lengths = vec![0.0];
            for w in points.windows(2) {
                lengths.push(lengths[lengths.len() - 1] + tracer.distance(w[0], w[1]));
            }
            curves.push(Loop { points, lengths });
        }
        Ok(Self { step, curves })
    }

    fn parted() -> PlanError {
        PlanError::NotApplicable {
            strategy: "contour spiral",
            reason:
                "the front from its border parts before it closes, so that no single spiral covers it; use \
                     `strategy = \"iso-scallop\"` with `start = \"all\"`"
                    .to_owned(),
        }
    }
}

struct Spiral<'a> {
    tracer: &'a LevelTracer<'a>,
    levels: Levels,
    chart: &'a Chart<'a>,
    cutter: &'a Cutter,
    field: &'a ScalarField,
    settings: &'a PassSettings<'a>,
}

impl Spiral<'_> {
    /// The place at `turn` levels from the first one, at a share of the way around.
    fn at(&self, turn: f64, share: f64) -> [f64; 2] {
        let curves = &self.levels.curves;
        let k = (turn.max(0.0) as usize).min(curves.len().saturating_sub(2));
        let t = (turn - k as f64).clamp(0.0, 1.0);
        let (a, b) = (curves[k].at(share), curves[(k + 1).min(curves.len() - 1)].at(share));
        let line = [0, 1].map(|c| a[c] + t * (b[c] - a[c]));
        let q = self.tracer.onto_level(line, (turn + 0.5) * self.levels.step);
        let apart = self.tracer.distance(a, b);
        if self.tracer.distance(line, q) > MOST_STRAY * apart { line } else { q }
    }

    /// Samples for once around level `k`.
    fn samples(&self, k: usize) -> usize {
        ((self.levels.curves[k].length() / self.settings.sampling).ceil() as usize).max(8)
    }

    /// The first level, all turns to the last one, and that.
    fn whole(&self) -> Vec<[f64; 2]> {
        let last = self.levels.curves.len() - 1;
        let mut points = Vec::new();
        let mut around = |k: usize, grows: bool| {
            let n = self.samples(k);
            points.extend((0..n).map(|j| {
                let share = j as f64 / n as f64;
                self.at(k as f64 + if grows { share } else { 0.0 }, share)
            }));
        };
        around(0, false);
        (0..last).for_each(|k| around(k, true));
        around(last, false);
        points.push(self.at(last as f64, 1.0));
        points
    }

    /// Further passes between turn `k` and the next one.
    fn further(&self, k: usize) -> Vec<Vec<[f64; 2]>> {
        let mut runs = Vec::new();
        for halving in 1..=HALVINGS {
            let parts = 1 << halving;
            let before = runs.len();
            for odd in (1..parts).step_by(2) {
                let offset = odd as f64 / parts as f64;
                runs.extend(self.needed(k, offset, 2.0 * self.levels.step / parts as f64));
            }
            if runs.len() == before {
                break;
            }
        }
        runs
    }

    /// The runs of the way `offset` turns inside of turn `k` on which passes `interval` levels apart are too
    /// far apart.
    fn needed(&self, k: usize, offset: f64, interval: f64) -> Vec<Vec<[f64; 2]>> {
        let n = self.samples(k);
        let points: Vec<[f64; 2]> = (0..=n)
            .map(|j| j as f64 / n as f64)
            .map(|share| self.at(k as f64 + share + offset, share))
            .collect();
        let reach = |[u, v]: [f64; 2]| {
            let p = self.chart.at(u, v)?;
            let t = level_tangent(&p, self.field, [u, v])?;
            let [_, phi_u, phi_v] = self.field.value_and_gradient(u, v);
            let gradient = surface_gradient_length(p.jet.first_form(), phi_u, phi_v);
            let (width, _) = p.strip_width(self.cutter, &t, self.settings.step);
            let reach = (OVERLAP * width / self.settings.sampling).ceil() as usize;
            (interval > gradient * width * (1.0 + SLACK)).then_some(reach)
        };
        let mut runs: Vec<[usize; 2]> = Vec::new();
        // Corners are narrower than the points are apart.
        let along = |j: usize| {
            let parts = (0..PARTS).map(|part| part as f64 / PARTS as f64);
            parts.filter_map(|t| reach(between(&points, j as f64 + t))).max()
        };
        for (j, reach) in (0..n).filter_map(|j| along(j).map(|r| (j, r))) {
            let run = [j.saturating_sub(reach), (j + 1 + reach).min(n)];
            match runs.last_mut() {
                Some(last) if run[0] <= last[1] + 1 => last[1] = last[1].max(run[1]),
                _ => runs.push(run),
            }
        }
        runs.into_iter().map(|[a, b]| points[a..=b].to_vec()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_between_samples_of_a_circle_are_on_it() {
        let circle: Vec<[f64; 2]> =
            (0..=64).map(|k| (0.1 * k as f64).sin_cos()).map(|(s, c)| [c, s]).collect();
        for k in 10..600 {
            let [x, y] = between(&circle, 0.1 * k as f64);
            assert!((x.hypot(y) - 1.0).abs() < 5e-6);
        }
        assert_eq!(between(&circle[..2], 0.0), circle[0]);
        assert!((between(&circle[..2], 1.0)[1] - circle[1][1]).abs() < 1e-12);
    }
}
