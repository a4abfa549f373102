//! Passes along the level curves of a scalar field ψ on a chart.
//!
//! Whole passes run along levels that `spacing` has placed. Where the surface or the field asks for
//! a smaller interval than the levels leave, further passes are put halfway between them, only
//! along the stretches that need one, and between those again.

use super::border::useful_overrun;
use super::chart::Chart;
use super::drop::DropCutter;
use super::plan::{PassSettings, Passes, PlanError};
use super::spacing::{level_tangent, place_levels};
use crate::cutter::Cutter;
use crate::field::{LevelCurve, LevelTracer, ScalarField, surface_gradient_length};
use crate::geometry::Point3;
use crate::monitor::{self, Cancelled, Monitor};
use crate::part::Part;

/// Grid cells a side on which level curves are found.
const TRACE_CELLS: usize = 240;

/// Passes are traced beyond the border by this share of their interval: a little more than the half
/// that a pass outside the border still has to serve inside it.
const BORDER_SHARE: f64 = 0.6;

/// The margin is never more than this share of the chart; it would be where a parametrisation
/// degenerates.
const MOST_MARGIN: f64 = 0.1;

/// Places a side at which the margin is computed.
const MARGIN_SAMPLES: usize = 24;

/// A point between two traced ones may be this many sampling distances off the line between them.
const MOST_STRAY: f64 = 0.25;

/// How closely the crossing of a border is placed, in sampling distances.
const BORDER_PRECISION: f64 = 1e-6;

/// How often the interval between two levels may be halved by further passes. Six times is a
/// sixty-fourth; only singular points of the field ask for more, and are measured.
const MOST_HALVINGS: usize = 6;

/// An interval may exceed the allowed one by this share before a further pass is put in: 2 % are
/// 4 % of the scallop height.
const INTERVAL_SLACK: f64 = 0.02;

/// Further passes reach beyond the stretch that needs them by this many allowed intervals, so that
/// their ends lie where the interval is wide enough without them.
const OVERLAP: f64 = 1.0;

/// Places levels, traces them and turns them into passes.
pub(super) fn along_levels(
    part: &Part,
    cutter: &Cutter,
    chart: &Chart,
    field: &ScalarField,
    settings: &PassSettings,
    monitor: &dyn Monitor,
) -> Result<Passes, PlanError> {
    let metric = |u: f64, v: f64| chart.jet(u, v).first_form();
    let margins = margins(chart, cutter, field, settings);
    let tracer = LevelTracer::new(field, &metric, chart.domain, margins, TRACE_CELLS, settings.sampling);
    let mut notes = Vec::new();
    let range = tracer.range();
    let levels = place_levels(chart, cutter, field, range, settings, &mut notes);
    let drop = DropCutter::new(part, cutter);
    let guide = Guide { tracer: &tracer, chart, cutter, field, drop, settings, monitor };
    monitor.start("planning passes", levels.len() as u64);
    let work = crate::parallel::try_map(levels.len() + 1, |k| {
        monitor::check(monitor)?;
        // Between two levels, or between a level and the border of the range.
        let below = k.checked_sub(1).map(|k| levels[k]);
        let gap = Gap {
            from: below.unwrap_or(range[0]),
            to: levels.get(k).copied().unwrap_or(range[1]),
            open_from: below.is_none(),
            open_to: k == levels.len(),
        };
        let mut passes = Vec::new();
        guide.fill(&gap, MOST_HALVINGS, &mut passes)?;
        let further = passes.len();
        if let Some(&level) = levels.get(k) {
            for curve in tracer.curves(level) {
                passes.extend(guide.pass(&curve, level, None)?);
            }
            monitor.advance(1);
        }
        Ok::<_, PlanError>((passes, further))
    })?;
    let further: usize = work.iter().map(|(_, further)| further).sum();
    if further > 0 {
        notes.push(format!(
            "{further} short passes were put between others where the interval had to be smaller"
        ));
    }
    Ok(Passes { passes: work.into_iter().flat_map(|(passes, _)| passes).collect(), notes })
}

/// A range of ψ between two passes; at an open end stands the end of the range, not a pass.
#[derive(Debug, Clone, Copy)]
struct Gap {
    from: f64,
    to: f64,
    open_from: bool,
    open_to: bool,
}

impl Gap {
    /// Where a further pass would stand, and the interval of ψ that must hold for none to be needed:
    /// a pass serves half an interval beyond itself, so a gap with an open end is half of one.
    fn middle(&self) -> (f64, f64) {
        let width = self.to - self.from;
        match (self.open_from, self.open_to) {
            (false, false) => (self.from + 0.5 * width, width),
            (true, false) => (self.from + width / 3.0, 2.0 * width),
            (false, true) => (self.to - width / 3.0, 2.0 * width),
            // No pass at all: the first one stands in the middle.
            (true, true) => (self.from + 0.5 * width, f64::INFINITY),
        }
    }
}

/// How far beyond the chart passes are traced, in parameters: the width over which a pass outside
/// the border still serves the strip inside it.
fn margins(chart: &Chart, cutter: &Cutter, field: &ScalarField, settings: &PassSettings) -> [f64; 2] {
    let (mut width, mut speed, mut places) = (0.0, [0.0; 2], 0.0);
    for [u, v] in chart.grid(MARGIN_SAMPLES) {
        let Some(p) = chart.at(u, v) else { continue };
        if let Some(t) = level_tangent(&p, field, [u, v]) {
            width += p.strip_width(cutter, &t, settings.step).0;
            speed = [speed[0] + p.jet.du.norm(), speed[1] + p.jet.dv.norm()];
            places += 1.0;
        }
    }
    [0, 1].map(|c| {
        let range = chart.domain[c][1] - chart.domain[c][0];
        if places == 0.0 { 0.0 } else { (BORDER_SHARE * width / speed[c]).min(MOST_MARGIN * range) }
    })
}

/// Turns level curves into passes.
struct Guide<'a> {
    tracer: &'a LevelTracer<'a>,
    chart: &'a Chart<'a>,
    cutter: &'a Cutter,
    field: &'a ScalarField,
    drop: DropCutter<'a>,
    settings: &'a PassSettings,
    monitor: &'a dyn Monitor,
}

impl Guide<'_> {
    /// Where the tip is when the cutter touches the chart at `(u, v)`: put there by the chart's
    /// normal, then dropped, so that it is held off by any other place of the part.
    fn tip(&self, [u, v]: [f64; 2]) -> Option<Point3> {
        let p = self.chart.at(u, v)?;
        let axis = p.jet.p.xy() + self.cutter.axis_offset(&p.normal);
        self.drop.at(axis.x, axis.y).map(|d| Point3::new(axis.x, axis.y, d.tip_z))
    }

    /// Appends the further passes that a gap needs.
    fn fill(&self, gap: &Gap, halvings: usize, passes: &mut Vec<Vec<Point3>>) -> Result<(), Cancelled> {
        monitor::check(self.monitor)?;
        let (level, interval) = gap.middle();
        let before = passes.len();
        for curve in self.tracer.curves(level) {
            let (curve, runs) = self.needed(curve, interval);
            for run in runs {
                passes.extend(self.pass(&curve, level, Some(run))?);
            }
        }
        if passes.len() > before && halvings > 1 {
            self.fill(&Gap { to: level, open_to: false, ..*gap }, halvings - 1, passes)?;
            self.fill(&Gap { from: level, open_from: false, ..*gap }, halvings - 1, passes)?;
        }
        Ok(())
    }

    /// The runs of a curve (first and last point) on which an interval of ψ is wider on the surface
    /// than allowed, with their overlap. A closed curve is turned to begin outside of any run.
    fn needed(&self, mut curve: LevelCurve, interval: f64) -> (LevelCurve, Vec<[usize; 2]>) {
        let too_wide = |&[u, v]: &[f64; 2]| {
            let p = self.chart.at(u, v)?;
            let t = level_tangent(&p, self.field, [u, v])?;
            let [_, psi_u, psi_v] = self.field.value_and_gradient(u, v);
            let gradient = surface_gradient_length(p.jet.first_form(), psi_u, psi_v);
            let (width, _) = p.strip_width(self.cutter, &t, self.settings.step);
            let reach = (OVERLAP * width / self.settings.sampling).ceil() as usize;
            (interval > gradient * width * (1.0 + INTERVAL_SLACK)).then_some(reach)
        };
        let mut reach: Vec<Option<usize>> = curve.points.iter().map(too_wide).collect();
        let n = curve.points.len();
        if curve.closed
            && let Some(calm) = reach.iter().position(Option::is_none)
        {
            curve.points.rotate_left(calm);
            reach.rotate_left(calm);
            curve.points.push(curve.points[0]);
            curve.closed = false;
        }
        let mut runs: Vec<[usize; 2]> = Vec::new();
        for (k, reach) in reach.iter().enumerate().filter_map(|(k, r)| r.map(|r| (k, r))) {
            let run = [k.saturating_sub(reach), (k + reach).min(n - 1)];
            match runs.last_mut() {
                Some(last) if run[0] <= last[1] + 1 => last[1] = last[1].max(run[1]),
                _ => runs.push(run),
            }
        }
        (curve, runs)
    }

    /// The pass along a curve, or along a run of its points; `None` where it does not touch the
    /// chart.
    fn pass(
        &self,
        curve: &LevelCurve,
        level: f64,
        run: Option<[usize; 2]>,
    ) -> Result<Option<Vec<Point3>>, Cancelled> {
        let mut points = curve.points.clone();
        if curve.closed {
            points.push(points[0]);
        }
        let last = points.len() - 1;
        let [first, end] = run.map_or([0, last], |[a, b]| [a, if curve.closed { last } else { b }]);
        if end <= first {
            return Ok(None);
        }
        // The parameter s counts traced points, which are one sampling distance apart.
        let at = |s: f64| {
            let k = (s as usize).min(last - 1);
            let t = s - k as f64;
            let [a, b] = [points[k], points[k + 1]];
            let between = [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
            let q = self.tracer.onto_level(between, level);
            // Near a singular point the level may be found on another branch.
            let strayed = self.tracer.distance(between, q) > MOST_STRAY * self.settings.sampling;
            if strayed { between } else { q }
        };
        let settings = PassSettings { sampling: 1.0, ..*self.settings };
        let mut stretches = self.stretches(&at, first, end);
        if !curve.closed {
            self.shorten_ends(&mut stretches, &at);
        }
        if !stretches.iter().any(|s| s.inside) {
            return Ok(None);
        }
        let mut tips: Vec<Point3> = Vec::new();
        for stretch in stretches {
            let mut tip = |s| self.tip(at(s));
            let moves = settings.moves(stretch.from, stretch.to, &mut tip, self.monitor)?;
            let joined = usize::from(!tips.is_empty());
            tips.extend(moves.into_iter().skip(joined));
        }
        Ok(Some(tips))
    }

    /// The stretches of a curve inside and outside of the chart, in order.
    fn stretches(&self, at: &dyn Fn(f64) -> [f64; 2], first: usize, last: usize) -> Vec<Stretch> {
        let inside = |s: f64| self.chart.holds(at(s));
        let start = first as f64;
        let mut stretches = vec![Stretch { inside: inside(start), from: start, to: start }];
        for k in first + 1..=last {
            let now = inside(k as f64);
            let n = stretches.len();
            let current = &mut stretches[n - 1];
            if now == current.inside {
                current.to = k as f64;
                continue;
            }
            let (mut same, mut other) = (current.to, k as f64);
            while other - same > BORDER_PRECISION {
                let middle = 0.5 * (same + other);
                *(if inside(middle) == current.inside { &mut same } else { &mut other }) = middle;
            }
            current.to = same;
            stretches.push(Stretch { inside: now, from: same, to: k as f64 });
        }
        stretches.retain(|s| s.to - s.from > BORDER_PRECISION);
        stretches
    }

    /// Cuts stretches outside of the chart at both ends back to what is of use.
    fn shorten_ends(&self, stretches: &mut Vec<Stretch>, at: &dyn Fn(f64) -> [f64; 2]) {
        let useful = |s: f64| {
            let p = at(s);
            let (here, [du, dv]) = (self.chart.at(p[0], p[1])?, self.tracer.direction(p)?);
            let feed = here.jet.du * du + here.jet.dv * dv;
            let near = |x: f64, [lo, hi]: [f64; 2]| (x - lo).abs().min((hi - x).abs()) / (hi - lo);
            let [along_u, along_v] = self.chart.domain;
            let border = if near(p[0], along_u) < near(p[1], along_v) { here.jet.dv } else { here.jet.du };
            let (along, across) = (feed.dot(&border).abs(), feed.cross(&border).norm());
            let interval = here.strip_width(self.cutter, &feed, self.settings.step).0;
            Some(useful_overrun(along / across.max(1e-9)) * interval / self.settings.sampling)
        };
        if let Some(first) = stretches.first_mut().filter(|s| !s.inside) {
            first.from = first.from.max(first.to - useful(first.to).unwrap_or(0.0));
        }
        if let Some(end) = stretches.last_mut().filter(|s| !s.inside) {
            end.to = end.to.min(end.from + useful(end.from).unwrap_or(0.0));
        }
        stretches.retain(|s| s.to - s.from > BORDER_PRECISION);
    }
}

/// A stretch of a level curve that lies inside or outside of the chart.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Stretch {
    inside: bool,
    from: f64,
    to: f64,
}
