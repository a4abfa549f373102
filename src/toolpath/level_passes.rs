//! Passes along level curves of a scalar field: isoparametric lines and streamlines.
//!
//! Neighbouring levels c and c + δ lie δ/|∇ψ| apart on the surface, so a pass at level c may have its
//! neighbour at most `δ(c) = min w·|∇ψ|` higher, the minimum over the pass and `w` the strip width
//! there. Levels are then spread so that every step keeps within that and all are equally near to
//! it.

use super::chart::{Chart, ChartPoint};
use super::drop::DropCutter;
use super::plan::{PassSettings, Passes, PlanError};
use super::{Along, FeedDirection};
use crate::cutter::Cutter;
use crate::field::{
    self, Axis, LevelCurve, LevelTracer, ScalarField, StreamSample, fit_stream_function,
    surface_gradient_length,
};
use crate::geometry::{KnotVector, Point3, Vector3};
use crate::monitor::{self, Monitor};
use crate::part::Part;

/// Grid cells a side on which level curves are found.
const TRACE_CELLS: usize = 240;

/// Places a side of a chart at which the step between levels is computed.
const STEP_SAMPLES: usize = 240;

/// Bins over the range of ψ in which the least step is kept.
const STEP_BINS: usize = 4000;

/// The step between levels is never less than this share of its median: near a singular point of
/// the field |∇ψ| vanishes, and passes would crowd without end. What is left there is measured.
const LEAST_OVER_MEDIAN: f64 = 0.2;

/// Samples of the feed direction per control point of the stream function and side.
const SAMPLES_PER_CONTROL: usize = 3;

/// Part of a direction's weight that does not depend on how much the direction matters, so that a
/// stream function is determined where it matters nowhere.
const LEAST_WEIGHT: f64 = 0.02;

/// Passes are traced beyond the border by this share of their interval: a little more than the half
/// that a pass outside the border still has to serve inside it.
const BORDER_SHARE: f64 = 0.6;

/// The margin is never more than this share of the chart; it would be where a parametrisation
/// degenerates.
const MOST_MARGIN: f64 = 0.1;

/// Places a side at which the margin is computed.
const MARGIN_SAMPLES: usize = 24;

/// An overrun shorter than this many intervals is left out.
const LEAST_OVERRUN: f64 = 0.05;

/// How closely the crossing of a border is placed, in sampling distances.
const BORDER_PRECISION: f64 = 1e-6;

/// Passes along isoparametric lines.
pub fn iso_parametric(
    part: &Part,
    cutter: &Cutter,
    along: Along,
    settings: &PassSettings,
    monitor: &dyn Monitor,
) -> Result<Passes, PlanError> {
    let field = ScalarField::Coordinate(match along {
        Along::U => Axis::V,
        Along::V => Axis::U,
    });
    let mut all = Passes::default();
    for chart in Chart::all(part, cutter)? {
        all.append(along_levels(part, cutter, &chart, &field, settings, monitor)?);
    }
    Ok(all)
}

/// Passes along the level curves of a stream function fitted to feed directions, with
/// `control_points` coefficients a side.
pub fn streamline(
    part: &Part,
    cutter: &Cutter,
    direction: FeedDirection,
    control_points: usize,
    settings: &PassSettings,
    monitor: &dyn Monitor,
) -> Result<Passes, PlanError> {
    let mut all = Passes::default();
    for chart in Chart::all(part, cutter)? {
        let (field, notes) = stream_function(&chart, cutter, direction, control_points, settings)?;
        all.notes.extend(notes);
        all.append(along_levels(part, cutter, &chart, &field, settings, monitor)?);
    }
    Ok(all)
}

/// Samples feed directions over a chart and fits the stream function.
fn stream_function(
    chart: &Chart,
    cutter: &Cutter,
    direction: FeedDirection,
    control_points: usize,
    settings: &PassSettings,
) -> Result<(ScalarField, Vec<String>), PlanError> {
    let n = control_points * SAMPLES_PER_CONTROL;
    let places: Vec<[f64; 2]> = chart.grid(n).collect();
    let points: Vec<_> = places.iter().map(|&[u, v]| chart.at(u, v)).collect();
    let mut lines: Vec<Option<(Vector3, f64)>> = points
        .iter()
        .map(|p| p.and_then(|p| Some((p.feed_tangent(direction)?, p.direction_matters(direction, cutter)))))
        .collect();
    let disagreement = field::orient(&mut lines, n);
    let mut samples = Vec::with_capacity(places.len());
    for ((&[u, v], point), line) in places.iter().zip(&points).zip(&lines) {
        let (Some(p), Some((t, matters))) = (point, line) else { continue };
        let b = p.normal.cross(t);
        let (Some(along), Some(across)) = (p.jet.pull_back(t), p.jet.pull_back(&b)) else { continue };
        let (e, f, g) = p.jet.first_form();
        samples.push(StreamSample {
            u,
            v,
            along: along.into(),
            across: across.into(),
            density: 1.0 / p.strip_width(cutter, t, settings.step).0,
            weight: (e * g - f * f).max(0.0).sqrt() * (matters + LEAST_WEIGHT),
        });
    }
    let knots = |range| KnotVector::clamped_uniform(3, control_points, range);
    let not_applicable = |reason: String| PlanError::NotApplicable { strategy: "streamline", reason };
    let [Ok(knots_u), Ok(knots_v)] = chart.domain.map(knots) else {
        return Err(not_applicable(format!(
            "{control_points} control points a side are too few; use 4 or more"
        )));
    };
    let fit = fit_stream_function(&samples, knots_u, knots_v).map_err(|e| not_applicable(e.to_string()))?;
    let mut notes = vec![format!(
        "the stream function follows the feed directions within {:.2} degrees (root mean square)",
        fit.angle_rms.to_degrees()
    )];
    if disagreement > 0.0 {
        notes.push(format!(
            "the feed directions have singular points ({:.1} % of neighbouring samples cannot be oriented alike); \
             passes bend around them",
            100.0 * disagreement
        ));
    }
    Ok((ScalarField::Spline(fit.psi), notes))
}

/// Places levels, traces them and turns them into passes.
fn along_levels(
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
    let levels = place_levels(chart, cutter, field, tracer.range(), settings, &mut notes);
    let guide = Guide { tracer: &tracer, chart, cutter, drop: DropCutter::new(part, cutter), settings };
    monitor.start("planning passes", levels.len() as u64);
    let passes = crate::parallel::try_map(levels.len(), |k| {
        monitor::check(monitor)?;
        let curves = tracer.curves(levels[k]);
        let passes: Vec<_> = curves.iter().flat_map(|curve| guide.passes(curve, levels[k])).collect();
        monitor.advance(1);
        Ok::<_, PlanError>(passes)
    })?;
    Ok(Passes { passes: passes.into_iter().flatten().collect(), notes })
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

/// Unit tangent in space of the level curve of `field` through a chart point.
fn level_tangent(p: &ChartPoint, field: &ScalarField, [u, v]: [f64; 2]) -> Option<Vector3> {
    let [_, psi_u, psi_v] = field.value_and_gradient(u, v);
    (p.jet.du * psi_v - p.jet.dv * psi_u).try_normalize(1e-300)
}

/// The levels of all passes, ascending.
fn place_levels(
    chart: &Chart,
    cutter: &Cutter,
    field: &ScalarField,
    [lo, hi]: [f64; 2],
    settings: &PassSettings,
    notes: &mut Vec<String>,
) -> Vec<f64> {
    if !(hi > lo) {
        return vec![lo];
    }
    let bin_of = |psi: f64| (((psi - lo) / (hi - lo) * STEP_BINS as f64) as usize).min(STEP_BINS - 1);
    let mut least = vec![f64::INFINITY; STEP_BINS];
    let (mut steps, mut limited, mut places) = (Vec::new(), 0usize, 0usize);
    for [u, v] in chart.grid(STEP_SAMPLES) {
        let Some(p) = chart.at(u, v) else { continue };
        let [psi, psi_u, psi_v] = field.value_and_gradient(u, v);
        let Some(t) = level_tangent(&p, field, [u, v]) else { continue };
        let (width, too_concave) = p.strip_width(cutter, &t, settings.step);
        let step = width * surface_gradient_length(p.jet.first_form(), psi_u, psi_v);
        places += 1;
        limited += usize::from(too_concave);
        steps.push(step);
        let bin = &mut least[bin_of(psi)];
        *bin = bin.min(step);
    }
    if limited > 0 {
        notes.push(format!(
            "on {:.1} % of the surface the part is nearly as concave as the cutter, or more: the strip is limited there",
            100.0 * limited as f64 / places as f64
        ));
    }
    steps.sort_by(f64::total_cmp);
    let floor = LEAST_OVER_MEDIAN * steps.get(steps.len() / 2).copied().unwrap_or(hi - lo);
    if steps.first().is_some_and(|&s| s < floor) {
        notes.push(
            "passes diverge strongly or the field has a singular point: their distance was limited there, and \
             scallops may exceed the target"
                .into(),
        );
    }
    let width = (hi - lo) / STEP_BINS as f64;
    fill_gaps(&mut least);
    let counts = cumulative_passes(&with_neighbours(&least, width, floor, hi - lo), width);
    let total = counts[STEP_BINS];
    let passes = (total - 1e-9).ceil().max(1.0);
    // Levels at (k + 1/2)/passes of the total count.
    let mut bin = 0;
    (0..passes as usize)
        .map(|k| {
            let wanted = total * (k as f64 + 0.5) / passes;
            while bin + 1 < STEP_BINS && counts[bin + 1] < wanted {
                bin += 1;
            }
            lo + width * (bin as f64 + (wanted - counts[bin]) / (counts[bin + 1] - counts[bin]))
        })
        .collect()
}

/// Gives bins that no sample fell into the lesser of the nearest known steps on both sides.
fn fill_gaps(least: &mut [f64]) {
    let mut from_below = least.to_vec();
    for k in 1..least.len() {
        if from_below[k].is_infinite() {
            from_below[k] = from_below[k - 1];
        }
    }
    let mut above = f64::INFINITY;
    for k in (0..least.len()).rev() {
        if least[k].is_infinite() {
            least[k] = from_below[k].min(above);
        } else {
            above = least[k];
        }
    }
}

/// The least step around each bin: a step that begins or ends in a bin must suit all it passes over.
fn with_neighbours(least: &[f64], width: f64, floor: f64, range: f64) -> Vec<f64> {
    let own: Vec<f64> = least.iter().map(|s| s.max(floor)).collect();
    (0..own.len())
        .map(|k| {
            let reach = |step: f64| if step.is_finite() { (step / width).ceil() as usize } else { 1 };
            let r = reach(own[k]).min(own.len());
            let around = &own[k.saturating_sub(r)..(k + r + 1).min(own.len())];
            around.iter().copied().fold(range, f64::min)
        })
        .collect()
}

/// Running sum of `width/step`: how many passes lie below each bin's start.
fn cumulative_passes(steps: &[f64], width: f64) -> Vec<f64> {
    let mut sum = 0.0;
    std::iter::once(0.0)
        .chain(steps.iter().map(|step| {
            sum += width / step;
            sum
        }))
        .collect()
}

/// Turns level curves into passes.
struct Guide<'a> {
    tracer: &'a LevelTracer<'a>,
    chart: &'a Chart<'a>,
    cutter: &'a Cutter,
    drop: DropCutter<'a>,
    settings: &'a PassSettings,
}

impl Guide<'_> {
    /// Where the tip is when the curve's point `(u, v)` guides the cutter.
    ///
    /// A ball is put where it touches that point, then dropped, so that it is held off by any other
    /// place of the part. Cutters with a flat have no single place where they touch a level plane:
    /// the curve guides their axis.
    fn tip(&self, [u, v]: [f64; 2]) -> Option<Point3> {
        let p = self.chart.at(u, v)?;
        let offset = if self.cutter.flat_radius() > 0.0 { 0.0 } else { self.cutter.corner_radius() };
        let (x, y) = (p.jet.p.x + offset * p.normal.x, p.jet.p.y + offset * p.normal.y);
        self.drop.at(x, y).map(|d| Point3::new(x, y, d.tip_z))
    }

    /// The passes along one curve: it may leave the chart and come back.
    fn passes(&self, curve: &LevelCurve, level: f64) -> Vec<Vec<Point3>> {
        let mut points = curve.points.clone();
        if curve.closed {
            points.push(points[0]);
        }
        let last = points.len() - 1;
        // The parameter s counts traced points, which are one sampling distance apart.
        let at = |s: f64| {
            let k = (s as usize).min(last - 1);
            let t = s - k as f64;
            let [a, b] = [points[k], points[k + 1]];
            self.tracer.onto_level([a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])], level)
        };
        let settings = PassSettings { sampling: 1.0, ..*self.settings };
        let mut stretches = self.stretches(&at, last);
        if !curve.closed {
            self.shorten_ends(&mut stretches, &at);
        }
        if !stretches.iter().any(|s| s.inside) {
            return Vec::new();
        }
        let mut tips: Vec<Point3> = Vec::new();
        for stretch in stretches {
            let moves = settings.moves(stretch.from, stretch.to, &mut |s| self.tip(at(s)));
            let joined = usize::from(!tips.is_empty());
            tips.extend(moves.into_iter().skip(joined));
        }
        vec![tips]
    }

    /// The stretches of a curve inside and outside of the chart, in order.
    fn stretches(&self, at: &dyn Fn(f64) -> [f64; 2], last: usize) -> Vec<Stretch> {
        let inside = |s: f64| self.chart.holds(at(s));
        let mut stretches = vec![Stretch { inside: inside(0.0), from: 0.0, to: 0.0 }];
        for k in 1..=last {
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

    /// Cuts stretches outside of the chart at both ends back to what is of use: a pass that meets the
    /// border at the angle φ ends half an interval over tan φ short of where its ridge to the
    /// neighbour leaves the part.
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
            let length = 0.5 * interval * along / across.max(1e-9);
            Some(if length < LEAST_OVERRUN * interval { 0.0 } else { length / self.settings.sampling })
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
