//! Iso-scallop passes: each exactly one strip width from the one before, measured on the surface across the
//! feed.
//!
//! A front starts on a curve and moves by the strip width of its place and direction while φ grows by one
//! (`speed |∇φ| = 1`, see [`field::eikonal`]); levels of φ one apart are the passes. The path is as long as
//! `∫ (1 − κ r) dA/w(across)`, κ the curvature along the feed, so the start curve decides the directions and
//! with them the length.
//!
//! Where the strip is much wider across some feed directions than across others (a leaning flat or bull nose
//! end mill on ground nearly as hollow as the cutter), fronts may break into corners of their own without
//! end, and passes would run to and fro. Then they move by the convex hull of their slowness
//! ([`field::Front::convex`]): intervals are nowhere wider, and the path is shorter.
//!
//! Limits: behind the ends of a start curve on the border, and where fronts meet, passes turn sharply;
//! further short passes are put in there.

use std::fmt::{self, Write as _};
use std::sync::Arc;

use super::mesh_front;
use crate::levels::level_passes::along_levelled;
use crate::levels::spacing::level_tangent;
use crate::surface::chart::{Chart, ChartPoint};
use crate::surface::mesh_surface::fills_its_rectangle;
use crate::vocabulary::{
    Along, Definition, LevelFunction, Levelled, PartKind, Passes, PlanError, Reading, Step, Strategy, Task,
};
use cutter::Cutter;
use field::{EikonalError, Front, GridField, ScalarField, Start, eikonal, surface_gradient_length};
use keys::{SceneError, toml_number, word_of};
use scallop::strip_width;
use work::monitor::Monitor;

/// Nodes of the front's grid lie this share of the cutter's radius apart: features that a cutter fits into
/// are wider. Coarser grids blur the strip's width, finer ones cost time.
const PITCH_OVER_RADIUS: f64 = 0.2;

/// Where fronts meet, nodes lie this share of the strip on a plane apart: with fewer the corners of
/// neighbouring passes wander by more than further passes make up for.
const PITCH_OVER_STRIP: f64 = 0.4;

/// Bounds of the nodes a side. The error of φ falls with the square of the pitch; the time grows with its
/// inverse square.
const NODES: [usize; 2] = [81, 401];

/// A front has come to rest where its last round of sweeps moved no level by more than this share of an
/// interval: no ridge shows that.
const SETTLED: f64 = 1e-3;

/// Above this share of an interval its differences of second order have not come to rest, and say less than
/// those of first order.
const MOST_UNSETTLED: f64 = 0.1;

/// Places a side at which a path's length is predicted, and a side's length is measured.
const LENGTH_SAMPLES: usize = 120;

/// How many of the starts with the least predicted length are planned; the prediction leaves out further
/// passes.
pub(super) const PLANNED: usize = 2;

/// Where a front starts whose levels are passes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FrontStart {
    /// The border from which the path is shortest.
    BestBorder,
    /// Where a parameter is least or greatest.
    Border {
        /// The parameter that is constant there.
        constant: Along,
        /// Its greatest value, not its least.
        greatest: bool,
    },
    /// All four borders at once: passes run around.
    AllBorders,
    /// A straight line in shares of the parameters' ranges (0 to 1), to both sides; it is continued to the
    /// borders.
    Line([[f64; 2]; 2]),
}

/// Each pass at exactly the strip's width from the one before, measured on the surface across the feed: level
/// curves of the arrival of a front that starts on a curve and moves by the strip's width.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IsoScallop {
    /// Where the first pass is.
    pub start: FrontStart,
}

/// Words for `start`.
const STARTS: [(&str, FrontStart); 6] = [
    ("best", FrontStart::BestBorder),
    ("u-min", FrontStart::Border { constant: Along::U, greatest: false }),
    ("u-max", FrontStart::Border { constant: Along::U, greatest: true }),
    ("v-min", FrontStart::Border { constant: Along::V, greatest: false }),
    ("v-max", FrontStart::Border { constant: Along::V, greatest: true }),
    ("all", FrontStart::AllBorders),
];

/// Keys of the line that a front starts on, in shares of the parameters' ranges.
const LINE: [&str; 4] = ["from_u", "from_v", "to_u", "to_v"];

/// Ends of a line closer than this share of the parameters' ranges give it no direction.
const LEAST_LINE: f64 = 1e-6;

/// How scenes speak of it.
pub(crate) static DEFINITION: Definition = Definition {
    word: "iso-scallop",
    help: "each pass one strip's width from the one before, from a border or a line",
    part: PartKind::Surface,
    keys: &["start"],
    read: |from| Ok(Box::new(IsoScallop { start: read_start(from)? })),
};

fn read_start(from: &Reading<'_>) -> Result<FrontStart, SceneError> {
    let section = from.section;
    let Some(table) = section.inline("start") else { return section.choice("start", &STARTS) };
    table.only(&LINE, &[], "a line to start from")?;
    let mut line = [0.0; 4];
    for (x, (key, example)) in line.iter_mut().zip(LINE.into_iter().zip([0.5, 0.0, 0.5, 1.0])) {
        *x = table.required_number(key, 0.0..=1.0, " (share of the parameter's range)", example)?.value;
    }
    let [a, b, c, d] = line;
    if (c - a).hypot(d - b) < LEAST_LINE {
        return Err(section.error(
            table.header(),
            "the line to start from begins and ends at the same place",
            "give it two places, such as `start = { from_u = 0.5, from_v = 0.0, to_u = 0.5, to_v = 1.0 }`",
        ));
    }
    Ok(FrontStart::Line([[a, b], [c, d]]))
}

/// What is told where a part has creases, holes or steps.
const ROUNDED: &str = "fronts run on a smooth surface over the mesh, which rounds its creases and goes on over its holes: a streamline is \
                       planned on the facets themselves";

impl Strategy for IsoScallop {
    fn definition(&self) -> &'static Definition {
        &DEFINITION
    }

    fn write(&self, out: &mut String) -> fmt::Result {
        let FrontStart::Line(line) = self.start else {
            return writeln!(out, "start = \"{}\"", word_of(&STARTS, &self.start));
        };
        let places = LINE.iter().zip(line.concat()).map(|(key, x)| format!("{key} = {}", toml_number(x)));
        writeln!(out, "start = {{ {} }}", places.collect::<Vec<_>>().join(", "))
    }

    fn passes(&self, task: &Task<'_>) -> Result<Passes, PlanError> {
        let mut all = Passes::default();
        if task.wants_mesh && task.part.patches().is_empty() {
            all.notes.push(ROUNDED.to_owned());
        }
        if self.on_facets(task) {
            let mut passes = mesh_front::on_part(task, self.start)?;
            passes.notes.splice(0..0, all.notes);
            return Ok(passes);
        }
        let charts = Chart::all(task.part, task.cutter, task.settings.guide())?;
        for (k, chart) in charts.iter().enumerate() {
            let passes = match task.earlier_on_chart(k, charts.len()) {
                Some(levelled) => along_levelled(task, chart, levelled)?,
                None => on_chart(task, chart, self.start)?,
            };
            all.append_patch([k, charts.len()], passes);
        }
        Ok(all)
    }

    fn on_facets(&self, task: &Task<'_>) -> bool {
        task.leaves_its_rectangle()
    }
}

/// Plans passes over one chart from the best start.
fn on_chart(task: &Task<'_>, chart: &Chart, start: FrontStart) -> Result<Passes, PlanError> {
    let fronts = fronts(task, chart, start)?;
    let searched = fronts.len();
    let mut best: Option<Passes> = None;
    for front in fronts.into_iter().take(PLANNED) {
        let passes = along_front(task, chart, front, searched)?;
        if best.as_ref().is_none_or(|best| passes.length() < best.length()) {
            best = Some(passes);
        }
    }
    Ok(best.unwrap_or_default())
}

/// A front from one start.
#[derive(Clone)]
pub(crate) struct StartedFront {
    /// Where it starts.
    pub name: &'static str,
    /// That border, as [`border_name`] takes it.
    pub border: Option<(usize, usize)>,
    pub field: GridField,
    /// The length of its passes as predicted, mm.
    pub predicted: f64,
}

/// The fronts from all starts that are to be tried, that with the least predicted length first.
pub(crate) fn fronts(
    task: &Task<'_>,
    chart: &Chart,
    start: FrontStart,
) -> Result<Vec<StartedFront>, PlanError> {
    started(task, chart, starts(chart, start), matches!(start, FrontStart::Line(_)))
}

/// The fronts from some curves, φ negative on the right of them if `signed`.
pub(super) fn started(
    task: &Task<'_>,
    chart: &Chart,
    starts: Vec<StartCurves>,
    signed: bool,
) -> Result<Vec<StartedFront>, PlanError> {
    let Task { part, cutter, ref settings, monitor, .. } = *task;
    let mut places = places(chart, LENGTH_SAMPLES);
    if !fills_its_rectangle(part) {
        places.0.retain(|([x, y], _)| part.highest_at(*x, *y).is_some());
    }
    let mut tried = Vec::new();
    for (name, border, curves) in starts {
        let field = ScalarField::Grid(arrival(chart, cutter, settings.step, &curves, signed, monitor)?);
        let predicted = predicted_length(&places, cutter, settings.step, &field);
        if let ScalarField::Grid(field) = field {
            tried.push(StartedFront { name, border, field, predicted });
        }
    }
    tried.sort_by(|a, b| a.predicted.total_cmp(&b.predicted));
    Ok(tried)
}

/// Plans passes along the levels of one of so many fronts that were tried.
fn along_front(
    task: &Task<'_>,
    chart: &Chart,
    front: StartedFront,
    tried: usize,
) -> Result<Passes, PlanError> {
    along_levelled(task, chart, &front.levelled(tried))
}

impl StartedFront {
    /// Its arrival times, as one of so many that were tried.
    pub(crate) fn levelled(self, tried: usize) -> Levelled {
        let Self { name, field, predicted, .. } = self;
        let told =
            format!("passes start {name}{}", if tried > 1 { ", the best of four borders" } else { "" });
        let function = LevelFunction::Chart(Arc::new(ScalarField::Grid(field)));
        Levelled {
            function,
            planned_as: format!("front, starting {name}").into(),
            told: Some((told, predicted)),
        }
    }
}

/// Where a front starts: at the border where the parameter (0: u, 1: v) is least (0) or greatest (1).
pub(crate) fn border_name((parameter, end): (usize, usize)) -> &'static str {
    match (parameter, end) {
        (0, 0) => "at the border of least u",
        (0, _) => "at the border of greatest u",
        (_, 0) => "at the border of least v",
        _ => "at the border of greatest v",
    }
}

/// Name and border of a start, and its curves in parameters.
pub(super) type StartCurves = (&'static str, Option<(usize, usize)>, Vec<Vec<[f64; 2]>>);

/// The start curves to try.
fn starts(chart: &Chart, start: FrontStart) -> Vec<StartCurves> {
    let [[u0, u1], [v0, v1]] = chart.domain;
    let border = |constant: Along, greatest: bool| {
        let (parameter, end) = (usize::from(constant == Along::V), usize::from(greatest));
        let at = chart.domain[parameter][end];
        let line = if parameter == 0 { [[at, v0], [at, v1]] } else { [[u0, at], [u1, at]] };
        (border_name((parameter, end)), Some((parameter, end)), vec![line.to_vec()])
    };
    match start {
        FrontStart::BestBorder => [(Along::U, false), (Along::U, true), (Along::V, false), (Along::V, true)]
            .map(|(constant, greatest)| border(constant, greatest))
            .to_vec(),
        FrontStart::Border { constant, greatest } => vec![border(constant, greatest)],
        FrontStart::AllBorders => {
            vec![("at all borders", None, vec![vec![[u0, v0], [u1, v0], [u1, v1], [u0, v1], [u0, v0]]])]
        }
        FrontStart::Line([a, b]) => {
            let at = |t: f64| {
                let share = [0, 1].map(|c| a[c] + t * (b[c] - a[c]));
                [u0 + share[0] * (u1 - u0), v0 + share[1] * (v1 - v0)]
            };
            // Continued until it is beyond the unit square on both sides.
            let reach = 4.0 / (b[0] - a[0]).hypot(b[1] - a[1]).max(1e-9);
            vec![("on a line", None, vec![vec![at(-reach), at(1.0 + reach)]])]
        }
    }
}

/// φ of the front from curves in parameters, a unit for each strip width.
///
/// # Errors
/// When cancelled, or when no front can move over the chart.
pub(crate) fn arrival(
    chart: &Chart,
    cutter: &Cutter,
    step: Step,
    curves: &[Vec<[f64; 2]>],
    signed: bool,
    monitor: &dyn Monitor,
) -> Result<GridField, PlanError> {
    // A closed curve sends out fronts that meet, and so do several curves.
    let meets = curves.len() > 1 || curves.iter().any(|curve| curve.first() == curve.last());
    let pitch = PITCH_OVER_RADIUS * cutter.radius();
    let strip = match step {
        Step::Scallop(h) => strip_width(1.0 / cutter.radius(), 0.0, h, cutter.radius()).0,
        Step::Stepover(width) => width,
    };
    let nodes = nodes(chart, if meets { pitch.min(PITCH_OVER_STRIP * strip) } else { pitch });
    let arrive = |front: &(dyn Fn(f64, f64) -> Option<Front> + Sync)| {
        eikonal(chart.domain, nodes, front, &Start { curves, signed }, monitor).map_err(|error| match error {
            EikonalError::Cancelled(cancelled) => PlanError::Cancelled(cancelled),
            other => PlanError::NotApplicable { strategy: "iso-scallop", reason: other.to_string() },
        })
    };
    let arrival = arrive(&|u, v| front_at(chart, cutter, step, u, v))?;
    if arrival.unsettled <= SETTLED {
        return Ok(arrival.field);
    }
    // Levels of fronts that break into corners without end are no passes.
    let convex = |u, v| front_at(chart, cutter, step, u, v).map(|front| front.convex());
    let convex = arrive(&convex)?;
    Ok(if convex.unsettled <= MOST_UNSETTLED { convex.field } else { convex.first_order })
}

/// Metric and speed at a place of a chart: a front moves by the strip's width.
pub(crate) fn front_at(chart: &Chart, cutter: &Cutter, step: Step, u: f64, v: f64) -> Option<Front> {
    let p = chart.at(u, v)?;
    Front::new(p.jet.first_form(), |[du, dv]| {
        let across = p.jet.du * du + p.jet.dv * dv;
        p.strip_width(cutter, &across.cross(&p.normal), step).0
    })
}

/// Nodes along u and v, `pitch` mm apart on the longest of some parameter lines.
fn nodes(chart: &Chart, pitch: f64) -> [usize; 2] {
    let longest = |along_u: bool| {
        let [a, b] = if along_u { chart.domain } else { [chart.domain[1], chart.domain[0]] };
        let at = |[lo, hi]: [f64; 2], t: f64| lo + t * (hi - lo);
        let point = |s: f64, t: f64| {
            let (x, y) = (at(a, s), at(b, t));
            if along_u { chart.jet(x, y).p } else { chart.jet(y, x).p }
        };
        let n = LENGTH_SAMPLES;
        let step =
            |k: usize, t: f64| (point((k + 1) as f64 / n as f64, t) - point(k as f64 / n as f64, t)).norm();
        let line = |t: f64| (0..n).map(|k| step(k, t)).sum::<f64>();
        [0.0, 0.25, 0.5, 0.75, 1.0].into_iter().map(line).fold(0.0, f64::max)
    };
    [true, false].map(|along_u| {
        let wanted = longest(along_u) / pitch;
        (wanted.ceil() as usize + 1).clamp(NODES[0], NODES[1])
    })
}

/// The places of an even grid of `n` × `n` on a chart, and the area in parameters that each stands for.
pub(crate) fn places<'a>(chart: &Chart<'a>, n: usize) -> (Vec<([f64; 2], ChartPoint<'a>)>, f64) {
    let [[u0, u1], [v0, v1]] = chart.domain;
    let places = chart.grid(n).filter_map(|uv| Some((uv, chart.at(uv[0], uv[1])?))).collect();
    (places, (u1 - u0) * (v1 - v0) / (n * n) as f64)
}

/// Where levels one apart lie farther from each other than the strip by more than this share, which they do
/// along kinks of a front, further passes will be put in. Less takes the error of coarse grids for kinks.
pub(super) const KINK: f64 = 0.05;

/// Length, mm, of the cutter's way along level curves one apart: `∫ |∇φ| (1 − κ r) dA`, κ the curvature along
/// them; twice that along kinks.
pub(crate) fn predicted_length(
    (places, cell): &(Vec<([f64; 2], ChartPoint)>, f64),
    cutter: &Cutter,
    step: Step,
    field: &ScalarField,
) -> f64 {
    let at = |(uv, p): &([f64; 2], ChartPoint)| {
        let (e, f, g) = p.jet.first_form();
        let [_, phi_u, phi_v] = field.value_and_gradient(uv[0], uv[1]);
        let gradient = surface_gradient_length((e, f, g), phi_u, phi_v);
        let tangent = level_tangent(p, field, *uv)?;
        let (width, _) = p.strip_width(cutter, &tangent, step);
        let passes = if gradient * width * (1.0 + KINK) < 1.0 { 2.0 } else { 1.0 };
        Some(passes * (e * g - f * f).max(0.0).sqrt() * gradient * p.offset_ratio(cutter, &tangent))
    };
    cell * places.iter().filter_map(at).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::levels::spacing::{LevelSteps, place_levels, places_of};
    use crate::vocabulary::PassSettings;
    use field::LevelTracer;
    use geometry::{NurbsSurface, Point3};
    use part::{Part, Patch};
    use std::f64::consts::{FRAC_1_SQRT_2, PI};
    use work::monitor::Silent;

    /// A half cylinder of radius 5 and length 10 along y; u runs around it.
    fn half_cylinder() -> Part {
        let around = [[5.0, 0.0], [5.0, 5.0], [0.0, 5.0], [-5.0, 5.0], [-5.0, 0.0]];
        let net = around.map(|[x, z]| [0.0, 10.0].map(|y| Point3::new(x, y, z)).to_vec());
        let weights = [1.0, FRAC_1_SQRT_2, 1.0, FRAC_1_SQRT_2, 1.0].map(|w| vec![w; 2]);
        let knots = vec![0.0, 0.0, 0.0, 0.5, 0.5, 1.0, 1.0, 1.0];
        let surface = NurbsSurface::new(2, 1, knots, vec![0.0, 0.0, 1.0, 1.0], &net, Some(&weights)).unwrap();
        Part::from_patches(vec![Patch::Nurbs(surface)], 0.005).unwrap()
    }

    /// Passes around it lie `√(8 h r)` apart, as on a plane: with h = 0.05 a ball of radius 5 takes
    /// 10/1.414 = 7.07 of them, and whole passes are eight half circles (so are those of any ball from 3.91
    /// to 5.10).
    #[test]
    fn passes_around_a_half_cylinder_are_eight_half_circles_long() {
        let (part, cutter) = (half_cylinder(), Cutter::ball(10.0).unwrap());
        let settings = PassSettings::upright(Step::Scallop(0.05), 0.5);
        let chart = &Chart::all(&part, &cutter, crate::vocabulary::Guide::default()).unwrap()[0];
        let border = vec![vec![[0.0, 0.0], [1.0, 0.0]]];
        let field = arrival(chart, &cutter, settings.step, &border, false, &Silent).unwrap();
        let field = ScalarField::Grid(field);
        let metric = |u: f64, v: f64| chart.jet(u, v).first_form();
        let tracer = LevelTracer::new(&field, &metric, chart.domain, [0.0; 2], 120, 0.1);
        let range = tracer.range();
        let interval = 2.0 * (2.0f64 * 5.0 * 0.05 - 0.05 * 0.05).sqrt();
        assert!((range[1] - range[0] - 10.0 / interval).abs() < 0.01, "{range:?}");
        let allowed = places_of(chart, &cutter, &field, &settings);
        let levels = place_levels(&allowed, range, LevelSteps::Shortest, &mut Vec::new());
        assert_eq!(levels.len(), 8);
        let length = |points: &[[f64; 2]]| {
            let at = |[u, v]: [f64; 2]| chart.jet(u, v).p;
            points.windows(2).map(|w| (at(w[1]) - at(w[0])).norm()).sum::<f64>()
        };
        let curves = levels.iter().flat_map(|&level| tracer.curves(level));
        let total: f64 = curves.map(|curve| length(&curve.points)).sum();
        println!("{total:.3} mm");
        assert!((total / (8.0 * 5.0 * PI) - 1.0).abs() < 0.01, "{total}");
        // Not rounded to whole passes, and of the ball's centre, which runs along circles of twice the
        // radius.
        let exact = predicted_length(&places(chart, LENGTH_SAMPLES), &cutter, settings.step, &field);
        assert!((exact / (2.0 * 50.0 * PI / interval) - 1.0).abs() < 0.01, "{exact}");
    }

    /// A saddle, about as hollow along u as a bull nose end mill under a lead is round.
    fn saddle() -> Part {
        let at = |k: usize| k as f64 / 7.0;
        let net: Vec<Vec<Point3>> = (0..8)
            .map(|i| {
                let place = |j: usize| {
                    let (u, v) = (at(i), at(j));
                    let z = 16.0 * (u - 0.5).powi(2) - 12.0 * (v - 0.5).powi(2);
                    Point3::new(18.0 * u + 1.5 * v, 13.0 * v, z)
                };
                (0..8).map(place).collect()
            })
            .collect();
        let knots = [[0.0; 4].as_slice(), &[0.2, 0.4, 0.6, 0.8], &[1.0; 4]].concat();
        let surface = NurbsSurface::new(3, 3, knots.clone(), knots, &net, None).unwrap();
        Part::from_patches(vec![Patch::Nurbs(surface)], 0.005).unwrap()
    }

    /// Levels one apart run to and fro there where fronts break into corners: by the speeds as they are,
    /// sweeps never settle.
    #[test]
    fn passes_of_a_leaning_bull_nose_over_a_hollow_do_not_run_to_and_fro() {
        let (part, cutter) = (saddle(), Cutter::bull(6.0, 2.0).unwrap());
        let lead = motion::ToolAxis::LeadTilt { lead: 8f64.to_radians(), tilt: 0.0 };
        let guide = crate::vocabulary::Guide { axis: Some(&lead), ..Default::default() };
        let chart = &Chart::all(&part, &cutter, guide).unwrap()[0];
        let step = Step::Scallop(0.01);
        let border = [vec![[0.0, 0.0], [0.0, 1.0]]];
        let start = Start { curves: &border, signed: false };
        let given = |u, v| front_at(chart, &cutter, step, u, v);
        let raw = eikonal(chart.domain, [81; 2], &given, &start, &Silent).unwrap();
        assert!(raw.unsettled > 10.0 * SETTLED, "{}", raw.unsettled);
        let field = arrival(chart, &cutter, step, &border, false, &Silent).unwrap();
        // By how much neighbouring places of a level differ in direction, on average, rad.
        let turn = |field: GridField| {
            let field = ScalarField::Grid(field);
            let metric = |u: f64, v: f64| chart.jet(u, v).first_form();
            let tracer = LevelTracer::new(&field, &metric, chart.domain, [0.0; 2], 120, 0.1);
            let [low, high] = tracer.range();
            let turns = |level: f64| {
                let curves = tracer.curves(level);
                let turns = |points: &[[f64; 2]]| {
                    let at = |[u, v]: [f64; 2]| chart.jet(u, v).p;
                    points
                        .windows(3)
                        .map(|w| (at(w[1]) - at(w[0])).angle(&(at(w[2]) - at(w[1]))))
                        .sum::<f64>()
                };
                curves.iter().map(|curve| turns(&curve.points)).sum::<f64>()
            };
            (1..10).map(|k| turns(low + (high - low) * f64::from(k) / 10.0)).sum::<f64>() / 9.0
        };
        let (before, after) = (turn(raw.field), turn(field));
        println!("{before:.1} rad a level by the speeds as they are, {after:.1} rad");
        assert!(after < 0.5 * before, "{after} of {before} rad");
    }

    /// Across the slope a flat leaves strips a tenth as wide as along it, and slopes change from place to
    /// place: differences of second order carry φ away even by convex speeds. No level is farther than the
    /// narrowest strips on the way to it.
    #[test]
    fn fronts_of_a_flat_over_steep_ground_stay_within_what_their_strips_allow() {
        const HEIGHTS: [[f64; 6]; 6] = [
            [-1.9, -2.0, 2.0, 1.8, -1.7, 1.2],
            [-1.4, 1.0, -3.4, -3.6, 0.7, -1.7],
            [-2.0, 0.2, -0.7, -4.4, -3.1, -4.4],
            [-2.8, -4.9, -3.0, -3.4, -3.0, -3.4],
            [-3.8, -1.6, -2.7, -2.6, -6.9, -3.2],
            [-7.5, -4.2, -4.3, -6.8, -4.4, -3.6],
        ];
        let place = |i: usize, j: usize| Point3::new(2.07 * i as f64, 1.68 * j as f64, HEIGHTS[i][j]);
        let net: Vec<Vec<Point3>> = (0..6).map(|i| (0..6).map(|j| place(i, j)).collect()).collect();
        let knots = [[0.0; 4].as_slice(), &[1.0 / 3.0, 2.0 / 3.0], &[1.0; 4]].concat();
        let surface = NurbsSurface::new(3, 3, knots.clone(), knots, &net, None).unwrap();
        let part = Part::from_patches(vec![Patch::Nurbs(surface)], 0.005).unwrap();
        let cutter = Cutter::flat(4.0).unwrap();
        let chart = &Chart::all(&part, &cutter, crate::vocabulary::Guide::default()).unwrap()[0];
        let step = Step::Scallop(0.05);
        let border = [vec![[0.0, 0.0], [0.0, 1.0]]];
        let convex = |u, v| front_at(chart, &cutter, step, u, v).map(|front| front.convex());
        let start = Start { curves: &border, signed: false };
        let second_order = eikonal(chart.domain, [81; 2], &convex, &start, &Silent).unwrap();
        assert!(second_order.unsettled > MOST_UNSETTLED, "{}", second_order.unsettled);
        let field = arrival(chart, &cutter, step, &border, false, &Silent).unwrap();
        let (looked_at, _) = places(chart, 40);
        let strips = looked_at.iter().flat_map(|(_, p)| {
            let along = p.jet.du.normalize();
            let feed = move |k: u32| {
                let (sin, cos) = (f64::from(k) * PI / 16.0).sin_cos();
                along * cos + p.normal.cross(&along) * sin
            };
            (0..16).map(move |k| p.strip_width(&cutter, &feed(k), step).0)
        });
        let narrowest = strips.fold(f64::INFINITY, f64::min);
        let field = ScalarField::Grid(field);
        let highest = chart.grid(60).map(|[u, v]| field.value_and_gradient(u, v)[0]).fold(0.0, f64::max);
        // No place is farther from the border than this way over the part.
        assert!(highest < 25.0 / narrowest, "{highest} of {narrowest}");
    }

    /// A roof of two facets has a crease longer than the cutter is wide, a plane has none.
    #[test]
    fn fronts_that_round_creases_say_so() {
        for (ridge, is_told) in [(3.0, true), (0.0, false)] {
            let corners = [
                [-4.0, 0.0, 0.0],
                [0.0, 0.0, ridge],
                [4.0, 0.0, 0.0],
                [-4.0, 12.0, 0.0],
                [0.0, 12.0, ridge],
                [4.0, 12.0, 0.0],
            ];
            let triangles = vec![[0, 1, 3], [1, 4, 3], [1, 2, 4], [2, 5, 4]];
            let mesh = geometry::TriangleMesh::new(corners.map(Point3::from).to_vec(), triangles).unwrap().0;
            let part = Part::from_mesh(mesh);
            let settings = crate::vocabulary::PlanSettings {
                step: Step::Scallop(0.05),
                stock_top: ridge + 1.0,
                ..Default::default()
            };
            let iso = IsoScallop { start: FrontStart::BestBorder };
            let plan =
                crate::plan::plan(&part, &Cutter::ball(4.0).unwrap(), &iso, &settings, &Silent).unwrap();
            assert_eq!(plan.notes.iter().any(|note| note == ROUNDED), is_told, "{:?}", plan.notes);
        }
    }
}
