//! Streamlines: passes along the level curves of a stream function fitted to feed directions.

use std::fmt::{self, Write as _};

use super::direction_keys;
use super::mesh_passes::{self, Aim};
use super::shortest::ShortestStreamline;
use crate::levels::level_passes::along_levels;
use crate::levels::{obedience, planned_field};
use crate::surface::chart::{Chart, ChartPoint};
use crate::surface::feed;
use crate::surface::mesh_surface::not_applicable;
use crate::vocabulary::{
    Definition, FeedDirection, Guide, PartKind, Passes, PlanError, Reading, Step, Strategy, Task,
};
use cutter::Cutter;
use field::{
    FieldError, KnotRule, MAX_DENSE, ScalarField, Solver, StreamSample, averaged_knots, equal_shares,
    fit_by_differences, fit_stream_function, weighted_knots,
};
use geometry::{KnotVector, Vector3};
use keys::{SceneError, Section, toml_string};

/// Samples of the feed direction per control point of the stream function and side.
const SAMPLES_PER_CONTROL: usize = 3;

/// Part of a direction's weight that does not depend on how much the direction matters, so that a
/// stream function is determined where it matters nowhere.
const LEAST_WEIGHT: f64 = 0.02;

/// How a stream function is fitted to feed directions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StreamMethod {
    /// A tensor-product B-spline by least squares.
    BSpline {
        /// Its degree, 2 to 5.
        degree: usize,
        /// How its knots are placed.
        knots: KnotRule,
    },
    /// Finite differences on a grid.
    Differences,
    /// Finite elements on the part's mesh: all patches as one surface, holes and steps as they are.
    Elements,
    /// Elements for parts of several patches and for meshes that no height surface follows; else a cubic B-spline on
    /// uniform knots.
    Automatic,
}

/// Level curves of a stream function fitted to feed directions.
#[derive(Debug, Clone, PartialEq)]
pub struct Streamline {
    /// The feed directions.
    pub direction: FeedDirection,
    /// Control points a side of the stream function's B-spline; differences have three cells for each.
    pub control_points: usize,
    /// How the stream function is fitted.
    pub method: StreamMethod,
    /// What solves its equations.
    pub solver: Solver,
}

/// Default control points a side of a stream function. More follow finer changes of the feed direction and cost time as
/// their cube; fewer smooth them away.
pub const DEFAULT_CONTROL_POINTS: usize = 24;

/// Default degree of a stream function: smooth to the curvature of passes.
pub const DEFAULT_DEGREE: usize = 3;

impl Streamline {
    /// Passes along a direction, all else by default.
    pub fn along(direction: FeedDirection) -> Self {
        Self {
            direction,
            control_points: DEFAULT_CONTROL_POINTS,
            method: StreamMethod::Automatic,
            solver: Solver::Cholesky,
        }
    }
}

/// How much dearer passes square to a wanted direction may be made.
const FOLLOW: std::ops::RangeInclusive<f64> = 0.0..=1000.0;

/// How scenes speak of it.
pub(crate) static DEFINITION: Definition = Definition {
    word: "streamline",
    help: "level curves of a stream function that follows feed directions, or that makes the path shortest",
    part: PartKind::Surface,
    keys: &[
        "follow",
        "direction",
        "directions",
        "guides",
        "across",
        "control_points",
        "method",
        "degree",
        "knots",
        "solver",
    ],
    read,
};

fn read(from: &mut Reading<'_>) -> Result<Box<dyn Strategy>, SceneError> {
    let section = from.section;
    let shortest = |keys: &[&'static str], what: &str| {
        let keys: Vec<&str> = PartKind::Surface.common_keys().iter().chain(keys).copied().collect();
        section.only(&keys, DEFINITION.keys, what)
    };
    let Some(direction) = direction_keys::read(section, &mut from.tables)? else {
        shortest(&["direction"], "direction = \"shortest\"")?;
        return Ok(Box::new(ShortestStreamline { toward: None }));
    };
    if let Some(dearer) = section.number("follow", FOLLOW, "")? {
        let keys: Vec<&'static str> = direction_keys::KEYS.into_iter().chain(["follow"]).collect();
        shortest(&keys, "`follow`, which leaves no method to choose")?;
        return Ok(Box::new(ShortestStreamline { toward: Some((direction, dearer.value)) }));
    }
    let control_points =
        section.count("control_points", 4..=200)?.map_or(DEFAULT_CONTROL_POINTS, |n| n as usize);
    let (method, solver) = read_method(section, control_points)?;
    Ok(Box::new(Streamline { direction, control_points, method, solver }))
}

fn read_method(section: &Section<'_>, control_points: usize) -> Result<(StreamMethod, Solver), SceneError> {
    let method = section.word("method", &["auto", "bspline", "differences", "elements"])?.map(|m| m.value);
    let degree = section.count("degree", 2..=5)?.map(|degree| degree as usize);
    let rule = section.word("knots", &KnotRule::WORDS)?.and_then(|word| KnotRule::from_word(word.value));
    let chosen = section.word("solver", &Solver::WORDS)?;
    let solver = chosen.as_ref().and_then(|word| Solver::from_word(word.value));
    let refuse =
        |key: &str, message: String, cure: &str| Err(section.error(&section.key_span(key), message, cure));
    if method == Some("elements") {
        if let Some(key) = ["degree", "knots", "solver"].into_iter().find(|key| section.has(key)) {
            let message = format!("`{key}` does not apply to finite elements, which `method` asks for");
            return refuse(key, message, "delete it, or write `method = \"bspline\"`");
        }
        return Ok((StreamMethod::Elements, Solver::Cholesky));
    }
    if method == Some("differences") {
        if let Some(key) = ["degree", "knots"].into_iter().find(|key| section.has(key)) {
            let message = format!("`{key}` belongs to B-splines, and `method` is \"differences\"");
            return refuse(key, message, "delete it, or write `method = \"bspline\"`");
        }
        if matches!(solver, Some(Solver::Qr | Solver::MinimumNorm)) {
            let message = "differences have no rectangular system, which this solver takes".to_owned();
            return refuse("solver", message, "write `solver = \"cg\"`, \"cholesky\" or \"gmres\"");
        }
        return Ok((StreamMethod::Differences, solver.unwrap_or(Solver::ConjugateGradient)));
    }
    let degree = degree.unwrap_or(DEFAULT_DEGREE);
    if control_points <= degree {
        let message = format!("{control_points} control points a side are too few for degree {degree}");
        return refuse(
            if section.has("degree") { "degree" } else { "control_points" },
            message,
            "write at least one control point more than the degree",
        );
    }
    if solver == Some(Solver::MinimumNorm) && control_points.pow(2) > MAX_DENSE {
        let message = format!(
            "the minimum-norm solver takes at most {MAX_DENSE} coefficients, and {control_points} control points a \
             side make {}",
            control_points.pow(2)
        );
        return refuse("solver", message, "write `control_points = 24` or fewer, or another solver");
    }
    let spline = StreamMethod::BSpline { degree, knots: rule.unwrap_or_default() };
    let asked = method == Some("bspline") || ["degree", "knots", "solver"].iter().any(|key| section.has(key));
    let method = if asked { spline } else { StreamMethod::Automatic };
    Ok((method, solver.unwrap_or(Solver::Cholesky)))
}

impl Strategy for Streamline {
    fn definition(&self) -> &'static Definition {
        &DEFINITION
    }

    fn write(&self, out: &mut String) -> fmt::Result {
        direction_keys::write(out, &self.direction, "\n")?;
        writeln!(out, "\ncontrol_points = {}", self.control_points)?;
        match self.method {
            StreamMethod::Automatic => return writeln!(out, "method = \"auto\""),
            StreamMethod::Elements => return writeln!(out, "method = \"elements\""),
            StreamMethod::Differences => {
                writeln!(out, "method = \"differences\"  # on three cells for each control point and side")?;
            }
            StreamMethod::BSpline { degree, knots } => {
                let knots = toml_string(knots.name());
                writeln!(out, "method = \"bspline\"\ndegree = {degree}\nknots = {knots}")?;
            }
        }
        writeln!(out, "solver = {}", toml_string(self.solver.name()))
    }

    fn passes(&self, task: &Task<'_>) -> Result<Passes, PlanError> {
        if !self.on_facets(task) {
            return on_charts(task, self);
        }
        if task.settings.probe.is_some() {
            let reason =
                "its passes by elements are spaced for an upright cutter; use a ball, or another `method`";
            return Err(PlanError::NotApplicable { strategy: DEFINITION.word, reason: reason.to_owned() });
        }
        mesh_passes::on_mesh(task, Aim::Fitted(&self.direction))
    }

    fn on_facets(&self, task: &Task<'_>) -> bool {
        match self.method {
            StreamMethod::Automatic => task.plans_on_mesh(),
            method => method == StreamMethod::Elements,
        }
    }

    fn shows_field(&self) -> bool {
        true
    }

    fn direction_mut(&mut self) -> Option<&mut FeedDirection> {
        Some(&mut self.direction)
    }
}

/// Passes along the level curves of a stream function fitted to feed directions.
fn on_charts(task: &Task<'_>, asked: &Streamline) -> Result<Passes, PlanError> {
    let Task { part, cutter, ref settings, .. } = *task;
    let direction = &asked.direction;
    let charts = Chart::all(part, cutter, settings.guide())?;
    let parameters: Vec<_> = charts.iter().map(|chart| chart.domain).collect();
    feed::check(direction, part, &parameters)?;
    // What was measured of an earlier plan moves levels, not the function.
    let by_calculation = Chart::all(part, cutter, Guide { correction: None, ..settings.guide() })?;
    let mut all = Passes::default();
    for (chart, calculated) in charts.into_iter().zip(by_calculation) {
        let direction = feed::on_chart(direction, &chart, cutter)?;
        let (field, mut notes, wanted) =
            stream_function(&calculated, cutter, &direction, asked, settings.step)?;
        let mut passes = along_levels(task, &chart, &field)?;
        let feed = |[u, v]: [f64; 2]| chart.at(u, v)?.feed(&direction, cutter);
        planned_field::set_directions(&mut passes.field, part, &chart, feed);
        obedience::compare_on_chart(&mut passes.contacts, &chart, &direction, cutter);
        let places: Vec<[f64; 2]> = chart.grid(wanted.side).collect();
        planned_field::set_singular_points(
            &mut passes.field,
            &chart,
            cutter,
            &places,
            &wanted.lines,
            wanted.side,
        );
        notes.extend(planned_field::singular_note(&passes.field));
        all.notes.extend(notes);
        all.append(passes);
    }
    Ok(all)
}

/// Feed directions and how much they matter on an even grid of a chart, oriented alike.
struct FeedGrid {
    /// Places a side.
    side: usize,
    lines: Vec<Option<(Vector3, f64)>>,
}

/// The stream function that fits feed directions over a chart, all else by default.
pub(crate) fn fitted_to(
    chart: &Chart,
    cutter: &Cutter,
    direction: &FeedDirection,
    step: Step,
) -> Result<ScalarField, PlanError> {
    let asked = Streamline::along(direction.clone());
    Ok(stream_function(chart, cutter, direction, &asked, step)?.0)
}

/// Samples feed directions over a chart and fits the stream function.
fn stream_function(
    chart: &Chart,
    cutter: &Cutter,
    direction: &FeedDirection,
    asked: &Streamline,
    step: Step,
) -> Result<(ScalarField, Vec<String>, FeedGrid), PlanError> {
    let n = asked.control_points * SAMPLES_PER_CONTROL;
    let places: Vec<[f64; 2]> = chart.grid(n).collect();
    let points: Vec<_> = places.iter().map(|&[u, v]| chart.at(u, v)).collect();
    let mut lines: Vec<Option<(Vector3, f64)>> =
        points.iter().map(|p| p.and_then(|p| p.feed(direction, cutter))).collect();
    if lines.iter().all(Option::is_none) {
        return Err(feed::nowhere(direction, chart.corners().into_iter()));
    }
    field::orient(&mut lines, n);
    let sample = |k: usize| {
        let (p, (t, matters)) = (points[k]?, lines[k]?);
        let (along, across) = (p.jet.pull_back(&t)?, p.jet.pull_back(&p.normal.cross(&t))?);
        let (e, f, g) = p.jet.first_form();
        Some(StreamSample {
            u: places[k][0],
            v: places[k][1],
            along: along.into(),
            across: across.into(),
            density: 1.0 / p.strip_width(cutter, &t, step).0,
            weight: (e * g - f * f).max(0.0).sqrt() * (matters + LEAST_WEIGHT),
        })
    };
    let samples: Vec<Option<StreamSample>> = (0..places.len()).map(sample).collect();
    let refused = |e: FieldError| not_applicable(&e.to_string());
    let (psi, angle_rms, method, report) = match asked.method {
        StreamMethod::Differences => {
            let fit = fit_by_differences(&samples, chart.domain, [n; 2], asked.solver).map_err(refused)?;
            (ScalarField::Grid(fit.psi), fit.angle_rms, format!("differences on {n} x {n} cells"), fit.report)
        }
        spline => {
            let (degree, knots) = match spline {
                StreamMethod::BSpline { degree, knots } => (degree, knots),
                _ => (3, KnotRule::Uniform),
            };
            let given: Vec<StreamSample> = samples.into_iter().flatten().collect();
            let [knots_u, knots_v] = placed_knots(chart, &points, degree, asked.control_points, knots)?;
            let fit = fit_stream_function(&given, knots_u, knots_v, asked.solver).map_err(refused)?;
            let name =
                format!("a B-spline of degree {degree} with {0} x {0} control points", asked.control_points);
            (ScalarField::Spline(fit.psi), fit.angle_rms, name, fit.report)
        }
    };
    let notes = vec![
        format!(
            "the stream function follows the feed directions within {:.2} degrees (root mean square)",
            angle_rms.to_degrees()
        ),
        format!("the stream function is {method}, solved by {report}"),
    ];
    Ok((psi, notes, FeedGrid { side: n, lines }))
}

/// Knots of both parameters by a rule. What the rule weighs along one parameter is the mean over the
/// other: speed for averaged knots, which then suit samples evenly spaced on the surface; speed times
/// the root of the normal curvature where the surface bends.
fn placed_knots(
    chart: &Chart,
    points: &[Option<ChartPoint>],
    degree: usize,
    controls: usize,
    rule: KnotRule,
) -> Result<[KnotVector; 2], PlanError> {
    let n = controls * SAMPLES_PER_CONTROL;
    let along = |axis: usize| {
        let range = chart.domain[axis];
        let mut weights = vec![0.0; n];
        for (k, p) in points.iter().enumerate() {
            let Some(p) = p else { continue };
            let d = if axis == 0 { p.jet.du } else { p.jet.dv };
            let bend = if rule == KnotRule::Curvature { p.curvature_along(&d).abs().sqrt() } else { 1.0 };
            weights[if axis == 0 { k % n } else { k / n }] += d.norm() * bend;
        }
        match rule {
            KnotRule::Uniform => KnotVector::clamped_uniform(degree, controls, range),
            KnotRule::Curvature => weighted_knots(degree, controls, &weights, range),
            KnotRule::Averaged => {
                let shares = equal_shares(&weights, n);
                let inner = shares.iter().map(|t| range[0] + t * (range[1] - range[0]));
                let parameters: Vec<f64> =
                    std::iter::once(range[0]).chain(inner).chain(std::iter::once(range[1])).collect();
                averaged_knots(degree, controls, &parameters, range)
            }
        }
        .map_err(|e| not_applicable(&format!("its control points cannot be placed: {e}")))
    };
    Ok([along(0)?, along(1)?])
}
