//! Passes along the level curves of a scalar field ψ on a chart.
//!
//! Curves are traced a little beyond the chart, on its continuation, and every place of the cutter comes
//! from dropping it onto the part. Which levels and stretches are cut is decided in `halving`.
//!
//! A pass just outside the border serves a strip inside it. So curves go on beyond the border.

use super::halving::{Allowed, LevelSource, Track, along_and_between};
use super::spacing::{LevelSteps, level_tangent, place_levels, places_of};
use super::{gaps, planned_field};
use crate::moves::touch::Touch;
use crate::surface::chart::{Chart, ChartPoint};
use crate::tilt::tilted;
use crate::vocabulary::{
    Contact, LevelFunction, Levelled, Lines, PassSettings, Passes, PlanError, Step, Task,
};
use cutter::Cutter;
use drop_cutter::{Beside, DropCutter};
use field::{LevelCurve, LevelTracer, ScalarField, surface_gradient_length};
use geometry::{Point3, Vector2, Vector3};
use motion::CcPoint;
use work::monitor::{Cancelled, Monitor};

/// Grid cells a side on which level curves are found.
const TRACE_CELLS: usize = 240;

/// Passes are traced beyond the border by this share of their mean interval. A pass outside the border serves
/// inside it from half of its own interval, which may be wider than the mean.
const BORDER_SHARE: f64 = 0.75;

/// The margin is never more than this share of the chart; it would be where a parametrisation
/// degenerates.
const MOST_MARGIN: f64 = 0.1;

/// Places a side at which the margin is computed.
const MARGIN_SAMPLES: usize = 24;

/// A point between two traced ones may be this many sampling distances off the line between them.
const MOST_STRAY: f64 = 0.25;

/// Places looked at for kinks from one point of a curve to the next.
const PARTS_OF_KINKS: usize = 4;

/// Places looked at between two points outside of the chart.
const PARTS_OUTSIDE: usize = 8;

/// Places beyond a border are tried this far apart, in sampling distances.
const OVERRUN_STEP: f64 = 0.05;

/// How closely the crossing of a border is placed, in sampling distances.
const BORDER_PRECISION: f64 = 1e-6;

/// [`along_levels`] of a function on the chart that is told of; nothing along one on a mesh.
pub(crate) fn along_levelled(
    task: &Task<'_>,
    chart: &Chart,
    levelled: &Levelled,
) -> Result<Passes, PlanError> {
    let LevelFunction::Chart(field) = &levelled.function else { return Ok(Passes::default()) };
    let mut passes = along_levels(task, chart, field, LevelSteps::Shortest, Lines::Levels)?;
    levelled.clone().put_with(&mut passes);
    Ok(passes)
}

/// Places levels, traces them and turns them into passes.
pub(crate) fn along_levels(
    task: &Task<'_>,
    chart: &Chart,
    field: &ScalarField,
    placing: LevelSteps,
    lines: Lines,
) -> Result<Passes, PlanError> {
    let Task { part, cutter, ref settings, monitor, .. } = *task;
    let metric = |u: f64, v: f64| chart.jet(u, v).first_form();
    let margins = margins(chart, cutter, field, settings);
    let mut tracer = LevelTracer::new(field, &metric, chart.domain, margins, TRACE_CELLS, settings.sampling);
    if lines == Lines::RungeKutta {
        tracer = tracer.by_steps_alone();
    }
    let mut notes = Vec::new();
    let range = tracer.range();
    let places = places_of(chart, cutter, field, settings);
    let levels = place_levels(&places, range, placing, &mut notes);
    let dropped = task.dropped();
    let drop = DropCutter::watched(part, dropped, monitor)?;
    let guide = ChartGuide { tracer: &tracer, chart, cutter, dropped, field, drop, settings, monitor };
    let mut passes = along_and_between(&guide, &levels, range, settings.sampling, monitor)?;
    if let Step::Scallop(height) = settings.step {
        let lengths = [height, settings.sampling];
        let further = gaps::close(&guide, chart, cutter, field, lengths, &mut passes, monitor)?;
        if further > 0 {
            let passes = if further == 1 { "pass closes" } else { "passes close" };
            notes.push(format!("{further} short {passes} gaps where the passes bend around or end"));
        }
    }
    passes.notes.splice(0..0, notes);
    passes.field = planned_field::of_levels(part, cutter, chart, field);
    Ok(passes)
}

/// A rim that lies beside the border by no more than this share of its radius touches it.
const HAIR: f64 = 1e-5;

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
struct ChartGuide<'a> {
    tracer: &'a LevelTracer<'a>,
    chart: &'a Chart<'a>,
    cutter: &'a Cutter,
    /// What is dropped in its stead.
    dropped: &'a Cutter,
    field: &'a ScalarField,
    drop: DropCutter<'a>,
    settings: &'a PassSettings<'a>,
    monitor: &'a dyn Monitor,
}

impl ChartGuide<'_> {
    /// Where the tip is when the cutter touches the chart at `(u, v)`: put there by the chart's
    /// normal, then dropped, so that it is held off by any other place of the part.
    fn tip(&self, [u, v]: [f64; 2], beside: &mut Beside) -> Option<Point3> {
        let p = self.chart.at(u, v)?;
        let axis = self.axis_over(&p);
        let mut dropped = |axis: Vector2| {
            self.drop.at_beside(axis.x, axis.y, beside).map(|d| Point3::new(axis.x, axis.y, d.tip_z))
        };
        // The rim of a disc on the border lies beside it by rounding.
        let contact = p.jet.p.coords.xy();
        dropped(axis).or_else(|| dropped(contact + (axis - contact) * (1.0 - HAIR)))
    }

    fn axis_over(&self, p: &ChartPoint) -> Vector2 {
        self.chart.axis_over(p, self.dropped, self.settings.chord_tolerance)
    }

    /// The stretches of a curve inside and outside of the chart, in order.
    fn stretches(&self, at: &dyn Fn(f64) -> [f64; 2], first: usize, last: usize) -> Vec<Stretch> {
        let inside = |s: f64| self.chart.holds(at(s));
        let start = first as f64;
        let mut stretches = vec![Stretch { inside: inside(start), from: start, to: start }];
        let mut places: Vec<f64> = Vec::new();
        for k in first..last {
            // Outside more of them, so that no corner of the chart is missed.
            let parts = if inside(k as f64) || inside((k + 1) as f64) { 1 } else { PARTS_OUTSIDE };
            places.extend((1..=parts).map(|part| k as f64 + part as f64 / parts as f64));
        }
        for s in places {
            let now = inside(s);
            let n = stretches.len();
            let current = &mut stretches[n - 1];
            if now == current.inside {
                current.to = s;
                continue;
            }
            let (mut same, mut other) = (current.to, s);
            while other - same > BORDER_PRECISION {
                let middle = 0.5 * (same + other);
                *(if inside(middle) == current.inside { &mut same } else { &mut other }) = middle;
            }
            current.to = same;
            stretches.push(Stretch { inside: now, from: same, to: s });
        }
        stretches.retain(|s| s.to - s.from > BORDER_PRECISION);
        stretches
    }

    /// Cuts stretches outside of the chart at both ends back to what is of use.
    fn shorten_ends(&self, stretches: &mut Vec<Stretch>, at: &dyn Fn(f64) -> [f64; 2]) {
        // The farthest place, from the border on, whose strip still lies on the chart.
        let useful = |from: f64, to: f64| {
            let steps = ((to - from).abs() / OVERRUN_STEP).ceil().max(1.0) as usize;
            let place = |k: usize| from + (to - from) * k as f64 / steps as f64;
            place((1..=steps).find(|&k| !self.serves(at(place(k)))).unwrap_or(steps))
        };
        if let Some(first) = stretches.first_mut().filter(|s| !s.inside) {
            first.from = useful(first.to, first.from);
        }
        if let Some(end) = stretches.last_mut().filter(|s| !s.inside) {
            end.to = useful(end.from, end.to);
        }
        stretches.retain(|s| s.to - s.from > BORDER_PRECISION);
    }

    /// The place at `s`, which counts traced points one sampling distance apart.
    fn on_level(&self, points: &[[f64; 2]], level: f64, s: f64) -> [f64; 2] {
        let k = (s as usize).min(points.len() - 2);
        let t = s - k as f64;
        let [a, b] = [points[k], points[k + 1]];
        let between = [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
        let q = self.tracer.between([a, b], t, level);
        // Near a singular point the level may be found on another branch.
        let strayed = self.tracer.distance(between, q) > MOST_STRAY * self.settings.sampling;
        if strayed { between } else { q }
    }

    /// The stretches of a curve, or of a run of it, that are worth cutting; `None` without any. A whole curve
    /// that lies outside all along may serve the border beside it, where ψ has its greatest value elsewhere.
    fn useful_stretches(
        &self,
        at: &dyn Fn(f64) -> [f64; 2],
        [first, end]: [usize; 2],
        closed: bool,
        is_whole: bool,
    ) -> Option<Vec<Stretch>> {
        let mut stretches = self.stretches(at, first, end);
        if !stretches.iter().any(|s| s.inside) {
            if !is_whole {
                return None;
            }
            let steps = ((end - first) as f64 / OVERRUN_STEP).ceil() as usize;
            let place = |k: usize| first as f64 + (end - first) as f64 * k as f64 / steps as f64;
            let serves = |k: &usize| self.serves(at(place(*k)));
            let (from, to) = ((0..=steps).find(serves)?, (0..=steps).rev().find(serves)?);
            return (from < to).then(|| vec![Stretch { inside: false, from: place(from), to: place(to) }]);
        }
        if !closed {
            self.shorten_ends(&mut stretches, at);
        }
        Some(stretches)
    }

    /// Whether half an interval to either side of a place outside, where the cutter cuts, lies the chart.
    fn serves(&self, p: [f64; 2]) -> bool {
        let beside = || {
            let (here, [du, dv]) = (self.chart.at(p[0], p[1])?, self.tracer.direction(p)?);
            let feed = (here.jet.du * du + here.jet.dv * dv).try_normalize(1e-300)?;
            let interval = here.strip_width(self.cutter, &feed, self.settings.step).0;
            let half = 0.5 * interval;
            let across = here.cut_across(self.cutter, &feed) * half;
            // The rim of a flat runs back from its foremost place toward the axis.
            let offset = self.axis_over(&here) - here.jet.p.coords.xy();
            let arm = offset.norm();
            let back = if self.dropped.flat_radius() > 0.0 && arm > 0.0 {
                arm - (arm * arm - half * half).max(0.0).sqrt()
            } else {
                0.0
            };
            let toward = here.tangent_at(offset.y.atan2(offset.x)).map_or_else(Vector3::zeros, |t| t * back);
            Some([across, -across].map(|aside| here.jet.pull_back(&(aside + toward))))
        };
        let holds =
            |way: Option<(f64, f64)>| way.is_some_and(|(du, dv)| self.chart.holds([p[0] + du, p[1] + dv]));
        beside().is_some_and(|ways| ways.into_iter().any(holds))
    }
}

impl LevelSource for ChartGuide<'_> {
    type Place = [f64; 2];

    fn curves(&self, level: f64) -> Vec<Track<[f64; 2]>> {
        let track = |curve: LevelCurve| Track { points: curve.points, closed: curve.closed };
        self.tracer.curves(level).into_iter().map(track).collect()
    }

    fn allowed(&self, &[u, v]: &[f64; 2]) -> Option<Allowed> {
        let p = self.chart.at(u, v)?;
        let t = level_tangent(&p, self.field, [u, v])?;
        let [_, psi_u, psi_v] = self.field.value_and_gradient(u, v);
        let gradient = surface_gradient_length(p.jet.first_form(), psi_u, psi_v);
        let (width, _) = self.chart.interval(&p, self.cutter, &t, self.settings.step);
        Some(Allowed { step: gradient * width, width })
    }

    fn contacts(&self, curve: &Track<[f64; 2]>, run: Option<[usize; 2]>) -> Vec<Contact> {
        let Some((points, [first, end])) = curve.opened(run) else { return Vec::new() };
        let contact = |&[u, v]: &[f64; 2]| {
            let p = self.chart.at(u, v)?;
            let t = level_tangent(&p, self.field, [u, v])?;
            let (allowed, _) = self.chart.interval(&p, self.cutter, &t, self.settings.step);
            let across = p.normal.cross(&t);
            Some(Contact {
                at: p.jet.p,
                across,
                normal: p.normal,
                allowed,
                inside: self.chart.holds([u, v]) && self.settings.faces.hold(&p.normal),
                parameters: Some([u, v]),
                asked: None,
            })
        };
        points[first..=end].iter().filter_map(contact).collect()
    }

    fn least_allowed(&self, from: &[f64; 2], to: &[f64; 2]) -> Option<Allowed> {
        let part = |k: usize| {
            let t = k as f64 / PARTS_OF_KINKS as f64;
            self.allowed(&[from[0] + t * (to[0] - from[0]), from[1] + t * (to[1] - from[1])])
        };
        (0..PARTS_OF_KINKS).filter_map(part).min_by(|a, b| a.step.total_cmp(&b.step))
    }

    fn pass(
        &self,
        curve: &Track<[f64; 2]>,
        level: f64,
        run: Option<[usize; 2]>,
    ) -> Result<Vec<Vec<Point3>>, Cancelled> {
        let is_whole = run.is_none();
        let Some((points, run)) = curve.opened(run) else { return Ok(Vec::new()) };
        let at = |s: f64| self.on_level(&points, level, s);
        let Some(stretches) = self.useful_stretches(&at, run, curve.closed, is_whole) else {
            return Ok(Vec::new());
        };
        let settings = PassSettings { sampling: 1.0, ..*self.settings };
        let mut pieces: Vec<Vec<Point3>> = Vec::new();
        for stretch in stretches {
            let mut beside = Beside::default();
            let mut tip = |s| self.tip(at(s), &mut beside);
            let ends = [stretch.from, stretch.to];
            let moves = settings.moves_by_contacts(ends, &mut tip, &self.drop, self.monitor)?;
            put_on(&mut pieces, moves, &|a, b| (a - b).norm() <= settings.chord_tolerance);
        }
        pieces.retain(|piece| piece.len() > 1);
        Ok(pieces)
    }

    fn touches(
        &self,
        curve: &Track<[f64; 2]>,
        level: f64,
        run: Option<[usize; 2]>,
    ) -> Result<Option<Vec<Vec<Touch>>>, PlanError> {
        let is_whole = run.is_none();
        let (Some(rule), Some((points, run))) = (self.settings.axis, curve.opened(run)) else {
            return Ok(None);
        };
        if self.chart.is_fitted() {
            // The mesh itself tells where it is touched.
            return Ok(None);
        }
        let at = |s: f64| self.on_level(&points, level, s);
        let Some(stretches) = self.useful_stretches(&at, run, curve.closed, is_whole) else {
            return Ok(None);
        };
        let contact = |s: f64| {
            let [u, v] = at(s);
            let p = self.chart.at(u, v)?;
            let feed = level_tangent(&p, self.field, [u, v])?;
            Some((CcPoint { point: p.jet.p, normal: p.normal }, feed))
        };
        let mut pieces: Vec<Vec<Touch>> = Vec::new();
        let tolerance = self.settings.chord_tolerance;
        for stretch in stretches {
            let ends = [stretch.from, stretch.to];
            let touches = tilted::along(&contact, ends, self.cutter, rule, tolerance, self.monitor)?;
            let near = |a: &Touch, b: &Touch| (a.contact.point - b.contact.point).norm() <= tolerance;
            put_on(&mut pieces, touches, &near);
        }
        pieces.retain(|piece| piece.len() > 1);
        Ok(Some(pieces))
    }
}

/// Carries the last piece on by a stretch that begins where it ends, or else begins another one: beyond the
/// border the cutter may touch nothing for a while, and no move leads from one side of that to the other.
fn put_on<P>(pieces: &mut Vec<Vec<P>>, stretch: Vec<P>, is_near: &dyn Fn(&P, &P) -> bool) {
    let ends = pieces.last().and_then(|piece| piece.last()).zip(stretch.first());
    let joined = ends.is_some_and(|(last, first)| is_near(last, first));
    match pieces.last_mut() {
        Some(piece) if joined => piece.extend(stretch.into_iter().skip(1)),
        _ => pieces.push(stretch),
    }
}

/// A stretch of a level curve that lies inside or outside of the chart.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Stretch {
    inside: bool,
    from: f64,
    to: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vocabulary::Pace;
    use field::GridField;
    use geometry::{AnalyticShape, AnalyticSurface, distance_to_segment};
    use part::{Part, Patch};
    use std::f64::consts::PI;
    use work::monitor::Silent;

    /// Along a border ψ rises twice, the second time to 0.7 less: no level that lies on the part is within
    /// half an interval of it there.
    #[test]
    fn a_level_that_lies_beside_the_border_all_along_serves_it() {
        const SIDE: f64 = 10.0;
        let plane = AnalyticSurface::new(AnalyticShape::Plane { height: 0.0 }, [[-SIDE, SIDE]; 2]).unwrap();
        let part = Part::from_patches(vec![Patch::Analytic(plane)], 0.002).unwrap();
        let cutter = Cutter::ball(6.0).unwrap();
        let settings = PassSettings::upright(Step::Stepover(1.0), 0.3);
        let pace = Pace { duration: &|passes, _| Ok(passes.length()), link: 1.0, bend: 0.1 };
        let task = Task { part: &part, cutter: &cutter, settings, wants_mesh: false, pace, monitor: &Silent };
        const CELLS: usize = 200;
        let at = |k: usize| SIDE * (2.0 * k as f64 / CELLS as f64 - 1.0);
        let rise = |u: f64| {
            let wave = (PI * u / 5.0).cos();
            if u < 0.0 { -wave } else { -0.65 * wave - 0.35 }
        };
        let psi = |k: usize| at(k / (CELLS + 1)) + rise(at(k % (CELLS + 1)));
        let values: Vec<f64> = (0..(CELLS + 1).pow(2)).map(psi).collect();
        let field = ScalarField::Grid(GridField::new([[-SIDE, SIDE]; 2], [CELLS; 2], &values).unwrap());
        let charts = Chart::all(&part, &cutter, settings.guide()).unwrap();
        let passes =
            along_levels(&task, &charts[0], &field, LevelSteps::Constant, Lines::Levels).unwrap().passes;
        let farthest = (-95..=95).map(|k| {
            let p = Point3::new(0.1 * f64::from(k), SIDE, 0.0);
            let flat = |p: &Point3| Point3::new(p.x, p.y, 0.0);
            let beside = passes.iter().flat_map(|pass| pass.windows(2));
            let beside = beside.map(|w| distance_to_segment(&p, &flat(&w[0]), &flat(&w[1])));
            (beside.fold(f64::INFINITY, f64::min), p.x)
        });
        let (distance, x) = farthest.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
        assert!(distance <= 0.5 * 1.02, "{distance} mm at x = {x}");
    }
}
