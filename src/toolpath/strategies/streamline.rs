//! Streamlines: passes along the level curves of a stream function fitted to feed directions.

use std::fmt::{self, Write as _};

use super::direction_keys;
use super::mesh_passes::{self, Aim};
use super::shortest::{self, Objective, ShortestStreamline};
use crate::levels::level_passes::along_levels;
use crate::levels::{obedience, planned_field};
use crate::surface::chart::{Chart, ChartPoint};
use crate::surface::feed;
use crate::surface::mesh_surface::not_applicable;
use crate::vocabulary::{
    Definition, FeedDirection, Guide, Lines, PartKind, Passes, PlanError, Reading, Step, Strategy, Task,
};
use cutter::Cutter;
use field::{
    DIRECTION_WEIGHT, FieldError, KnotRule, LineField, LineSample, MAX_DENSE, SamplePlane, ScalarField,
    Solver, StreamFit, StreamSample, averaged_knots, equal_shares, fit_by_differences, fit_stream_function,
    weighted_knots,
};
use geometry::{KnotVector, Vector3};
use keys::{SceneError, Section, toml_number, toml_string, word_of};

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
    /// As published for vectors of a table: a tensor-product cubic B-spline whose gradient, turned by a right
    /// angle, is nearest to the vectors at their own places, lengths included, on averaged knots and of
    /// minimum norm.
    Published,
    /// Elements for parts of several patches and for meshes that no height surface follows; else a cubic
    /// B-spline on uniform knots.
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
    /// How much following the directions counts over the distances of passes.
    pub direction_weight: f64,
    /// Which lines of the function passes are.
    pub lines: Lines,
}

/// Default control points a side of a stream function. More follow finer changes of the feed direction and
/// cost time as their cube; fewer smooth them away.
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
            direction_weight: DIRECTION_WEIGHT,
            lines: Lines::Levels,
        }
    }
}

/// Keys that say how directions are followed.
const DIRECTED: [&str; 8] =
    ["follow", "control_points", "method", "degree", "knots", "solver", "direction_weight", "lines"];

/// Control points a side of the published fit.
const PUBLISHED_CONTROL_POINTS: usize = 7;

/// What a function is that was fitted to directions.
pub const FITTED: &str = "stream function, fitted";

/// How much dearer passes square to a wanted direction may be made.
const FOLLOW: std::ops::RangeInclusive<f64> = 0.0..=1000.0;

/// How scenes speak of it.
pub(crate) static DEFINITION: Definition = Definition {
    word: "streamline",
    help: "level curves of a stream function that follows feed directions, or that makes the path quickest",
    part: PartKind::Surface,
    keys: &[
        "objective",
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
        "direction_weight",
        "lines",
    ],
    read,
};

fn read(from: &mut Reading<'_>) -> Result<Box<dyn Strategy>, SceneError> {
    let section = from.section;
    let only = |keys: &[&'static str], what: &str| {
        let keys: Vec<&str> = PartKind::Surface.common_keys().iter().chain(keys).copied().collect();
        section.only(&keys, DEFINITION.keys, what)
    };
    let needed = DIRECTED.iter().any(|key| section.has(key));
    let Some(direction) = direction_keys::read(section, &mut from.tables, needed)? else {
        only(&["direction", "objective"], "direction = \"shortest\"")?;
        let objective = section.choice("objective", &Objective::WORDS)?;
        return Ok(Box::new(ShortestStreamline { toward: None, objective }));
    };
    if let Some(dearer) = section.number("follow", FOLLOW, "")? {
        let keys: Vec<&'static str> = direction_keys::KEYS.into_iter().chain(["follow"]).collect();
        only(&keys, "`follow`, which leaves no method to choose")?;
        let objective = Objective::Length;
        return Ok(Box::new(ShortestStreamline { toward: Some((direction, dearer.value)), objective }));
    }
    if section.has("objective") {
        let message = "`objective` does not act where passes follow a direction".to_owned();
        let cure = "delete it, or leave the direction free";
        return Err(section.key_error("objective", message, cure));
    }
    let control_points = section.count("control_points", 4..=200)?.map(|n| n as usize);
    let (method, solver) = read_method(section, control_points.unwrap_or(DEFAULT_CONTROL_POINTS))?;
    let usual = if method == StreamMethod::Published {
        if !matches!(direction, FeedDirection::File { .. }) {
            let message = "the published fit is made to the vectors of a table".to_owned();
            let cure = "add `direction = \"file\"` and `directions = \"FILE\"`, or write another method";
            return Err(section.key_error("method", message, cure));
        }
        PUBLISHED_CONTROL_POINTS
    } else {
        DEFAULT_CONTROL_POINTS
    };
    let control_points = control_points.unwrap_or(usual);
    let direction_weight = direction_keys::read_weight(section)?;
    let lines = section.choice("lines", &Lines::WORDS)?;
    Ok(Box::new(Streamline { direction, control_points, method, solver, direction_weight, lines }))
}

/// Keys that ask for B-splines, unless another method takes them.
const SPLINE_KEYS: [&str; 4] = ["control_points", "degree", "knots", "solver"];

fn read_method(section: &Section<'_>, control_points: usize) -> Result<(StreamMethod, Solver), SceneError> {
    let method = section
        .word("method", &["auto", "bspline", "differences", "elements", "published"])?
        .map(|m| m.value);
    let degree = section.count("degree", 2..=5)?.map(|degree| degree as usize);
    let rule = section.word("knots", &KnotRule::WORDS)?.and_then(|word| KnotRule::from_word(word.value));
    let chosen = section.word("solver", &Solver::WORDS)?;
    let solver = chosen.as_ref().and_then(|word| Solver::from_word(word.value));
    let refuse = |key: &str, message: String, cure: &str| Err(section.key_error(key, message, cure));
    if method == Some("elements") {
        if let Some(key) = SPLINE_KEYS.into_iter().find(|key| section.has(key)) {
            let message = format!("`{key}` does not apply to finite elements, which `method` asks for");
            return refuse(key, message, "delete it, or write `method = \"bspline\"`");
        }
        return Ok((StreamMethod::Elements, Solver::Cholesky));
    }
    if method == Some("published") {
        if let Some(key) =
            ["degree", "knots", "solver", "direction_weight"].into_iter().find(|key| section.has(key))
        {
            let message = format!("`{key}` is as published, which `method` asks for");
            return refuse(key, message, "delete it, or write `method = \"bspline\"`");
        }
        return Ok((StreamMethod::Published, Solver::MinimumNorm));
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
    let asked = method == Some("bspline") || SPLINE_KEYS.iter().any(|key| section.has(key));
    let method = if asked { spline } else { StreamMethod::Automatic };
    Ok((method, solver.unwrap_or(Solver::Cholesky)))
}

impl Strategy for Streamline {
    fn definition(&self) -> &'static Definition {
        &DEFINITION
    }

    fn write(&self, out: &mut String) -> fmt::Result {
        direction_keys::write(out, &self.direction, "\n")?;
        writeln!(out)?;
        // Where the part decides they would ask for B-splines.
        if !matches!(self.method, StreamMethod::Automatic | StreamMethod::Elements) {
            writeln!(out, "control_points = {}", self.control_points)?;
        }
        if self.direction_weight != DIRECTION_WEIGHT {
            writeln!(out, "direction_weight = {}", toml_number(self.direction_weight))?;
        }
        writeln!(out, "lines = \"{}\"", word_of(&Lines::WORDS, &self.lines))?;
        match self.method {
            StreamMethod::Automatic => {
                return writeln!(
                    out,
                    "method = \"auto\"  # {} control points a side where splines serve",
                    self.control_points
                );
            }
            StreamMethod::Elements => return writeln!(out, "method = \"elements\""),
            StreamMethod::Published => return writeln!(out, "method = \"published\""),
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
        mesh_passes::on_mesh(task, Aim::Fitted(&self.direction, self.direction_weight, self.lines))
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
    let mut all = Passes { notes: feed::check(direction, &part.bounds(), &parameters)?, ..Passes::default() };
    // What was measured of an earlier plan moves levels, not the function.
    let by_calculation = Chart::all(part, cutter, Guide { correction: None, ..settings.guide() })?;
    let of = charts.len();
    for (k, (chart, calculated)) in charts.into_iter().zip(by_calculation).enumerate() {
        if matches!(direction, FeedDirection::WidestStrip) && all_strips_are_alike(&chart, cutter) {
            let mut passes = shortest::on_chart(task, &chart, [k, of], None, Objective::Time)?;
            passes.notes.insert(0, ALIKE.to_owned());
            all.append_patch([k, of], passes);
            continue;
        }
        let spread = feed::on_chart(direction, &chart, cutter)?;
        let (field, mut notes, wanted) = stream_function(&calculated, cutter, &spread, asked, settings.step)?;
        let mut passes = along_levels(task, &chart, &field, asked.lines.steps(), asked.lines)?;
        let feed = |[u, v]: [f64; 2]| chart.at(u, v)?.feed(&spread, cutter);
        planned_field::set_directions(&mut passes.field, part, &chart, feed);
        passes.obedience = obedience::on_chart(task, &chart, &mut passes.contacts, [direction, &spread]);
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
        passes.notes.splice(0..0, notes);
        all.append_patch([k, of], passes);
    }
    Ok(all)
}

/// What is told where no direction has a wider strip than others.
const ALIKE: &str = "no direction has a wider strip than another here, so that passes follow the stream function of least \
                     machining time";

/// Whether strips are as wide in all directions, as on planes and spheres: what then is the widest is
/// rounding.
fn all_strips_are_alike(chart: &Chart, cutter: &Cutter) -> bool {
    let matters =
        |[u, v]: [f64; 2]| chart.at(u, v)?.feed(&FeedDirection::WidestStrip, cutter).map(|(_, m)| m);
    chart.grid(PLACES_ALIKE).filter_map(matters).all(|matters| matters < planned_field::NO_MATTER)
}

/// Places a side at which strips are compared in all directions.
const PLACES_ALIKE: usize = 24;

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
            direction: asked.direction_weight,
        })
    };
    let samples: Vec<Option<StreamSample>> = (0..places.len()).map(sample).collect();
    let refused = |e: FieldError| not_applicable(&e.to_string());
    let (psi, method, report) = match asked.method {
        StreamMethod::Differences => {
            let fit = fit_by_differences(&samples, chart.domain, [n; 2], asked.solver).map_err(refused)?;
            (ScalarField::Grid(fit.psi), format!("differences on {n} x {n} cells"), fit.report)
        }
        StreamMethod::Published => {
            let fit = published(direction, chart, asked.control_points)?;
            let name =
                format!("the published cubic B-spline with {0} x {0} control points", asked.control_points);
            (ScalarField::Spline(fit.psi), name, fit.report)
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
            (ScalarField::Spline(fit.psi), name, fit.report)
        }
    };
    let notes = vec![format!("the stream function is {method}, solved by {report}")];
    Ok((psi, notes, FeedGrid { side: n, lines }))
}

/// Degree of the published fit.
const PUBLISHED_DEGREE: usize = 3;

/// The function whose gradient, turned by a right angle, is nearest to the vectors of a table in the
/// parameters of a chart: all count alike, at their own places and with their lengths.
fn published(direction: &FeedDirection, chart: &Chart, controls: usize) -> Result<StreamFit, PlanError> {
    let given: Vec<LineSample> = match direction {
        FeedDirection::File { samples: Some(table), .. } if is_by_parameters(table, chart) => {
            table.given().collect()
        }
        _ => {
            return Err(not_applicable(
                "the published fit needs vectors in its parameters: write the table as u v tu tv",
            ));
        }
    };
    let sample = |s: &LineSample| {
        let length = s.line[0].hypot(s.line[1]);
        let along = s.line.map(|x| x / length);
        let ([u, v], across) = (s.at, [-along[1], along[0]]);
        StreamSample { u, v, along, across, density: length, weight: s.weight, direction: 1.0 }
    };
    let mut samples: Vec<StreamSample> = given.iter().map(sample).collect();
    samples.sort_by(|a, b| a.v.total_cmp(&b.v).then(a.u.total_cmp(&b.u)));
    let knots = |c: usize| {
        let mut parameters: Vec<f64> = given.iter().map(|s| s.at[c]).collect();
        parameters.sort_by(f64::total_cmp);
        parameters.dedup();
        averaged_knots(PUBLISHED_DEGREE, controls, &parameters, chart.domain[c])
            .map_err(|e| not_applicable(&format!("its control points cannot be placed: {e}")))
    };
    fit_stream_function(&samples, knots(0)?, knots(1)?, Solver::MinimumNorm)
        .map_err(|e| not_applicable(&e.to_string()))
}

/// Whether the places of a table are parameters of a chart: those of the plan view are where u and v are x
/// and y.
fn is_by_parameters(table: &LineField, chart: &Chart) -> bool {
    let is_plan = |[u, v]: [f64; 2]| {
        let p = chart.jet(u, v).p;
        (p.x - u).abs().max((p.y - v).abs()) <= SAME_PLACE
    };
    table.plane() == SamplePlane::Parameters || chart.grid(4).all(is_plan)
}

/// Places nearer than this, mm, are one: rounding.
const SAME_PLACE: f64 = 1e-9;

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::{Plan, plan};
    use crate::vocabulary::{Correction, Earlier, Joining, Links, PlanSettings};
    use field::LineSample;
    use field::mesh::Sense;
    use geometry::{AnalyticShape, AnalyticSurface, Point3, TriangleMesh};
    use part::{Part, Patch};
    use std::sync::Arc;
    use work::monitor::Silent;

    /// The velocities of ψ = sin(u/6) cos(v/5) + u v/60 at 15 × 15 places of a plane of 15 by 12 mm, as a
    /// file of directions.
    fn vectors() -> FeedDirection {
        let sample = |k: usize| {
            let at @ [u, v] = [15.0 * (k % 15) as f64 / 14.0, 12.0 * (k / 15) as f64 / 14.0];
            LineSample { at, line: velocity(u, v), weight: 1.0 }
        };
        let samples: Vec<_> = (0..225).map(sample).collect();
        let samples = LineField::new(SamplePlane::Plan, &samples).map(Arc::new);
        FeedDirection::File { name: "vectors.txt".into(), samples }
    }

    fn velocity(u: f64, v: f64) -> [f64; 2] {
        let (psi_u, psi_v) = (
            (u / 6.0).cos() * (v / 5.0).cos() / 6.0 + v / 60.0,
            -(u / 6.0).sin() * (v / 5.0).sin() / 5.0 + u / 60.0,
        );
        [psi_v, -psi_u]
    }

    /// Root mean square and greatest angle between the levels of a fit and the velocities, degrees.
    fn off(method: StreamMethod, solver: Solver, control_points: usize, direction_weight: f64) -> [f64; 2] {
        let surface = AnalyticSurface::new(AnalyticShape::Plane { height: 0.0 }, [[0.0, 15.0], [0.0, 12.0]]);
        let part = Part::from_patches(vec![Patch::Analytic(surface.unwrap())], 0.002).unwrap();
        let cutter = Cutter::ball(6.0).unwrap();
        let chart = Chart::all(&part, &cutter, Guide::default()).unwrap().remove(0);
        let direction = vectors();
        let asked = Streamline {
            control_points,
            method,
            solver,
            direction_weight,
            ..Streamline::along(direction.clone())
        };
        let (psi, ..) = stream_function(&chart, &cutter, &direction, &asked, Step::Scallop(0.01)).unwrap();
        let angles: Vec<f64> = chart
            .grid(61)
            .map(|[u, v]| {
                let ([_, a, b], [x, y]) = (psi.value_and_gradient(u, v), velocity(u, v));
                (a * x + b * y).atan2((b * x - a * y).abs()).abs().to_degrees()
            })
            .collect();
        let squares: f64 = angles.iter().map(|a| a * a).sum();
        [(squares / angles.len() as f64).sqrt(), angles.into_iter().fold(0.0, f64::max)]
    }

    /// On a sphere no strip is wider than another: directions of the widest would be rounding, and passes
    /// along them times as long.
    #[test]
    fn on_a_sphere_passes_of_the_widest_strip_are_the_quickest() {
        let shape = AnalyticShape::Sphere { height: 0.0, radius: 20.0, concave: false };
        let surface = AnalyticSurface::new(shape, [[-4.0, 4.0], [-3.0, 3.0]]).unwrap();
        let part = Part::from_patches(vec![Patch::Analytic(surface)], 0.002).unwrap();
        let cutter = Cutter::ball(6.0).unwrap();
        let settings = PlanSettings {
            step: Step::Scallop(0.02),
            stock_top: part.bounds().max.z + 1.0,
            ..PlanSettings::default()
        };
        let free = ShortestStreamline { toward: None, objective: Objective::Time };
        let widest = Streamline::along(FeedDirection::WidestStrip);
        let [free, widest]: [Plan; 2] = [&free as &dyn Strategy, &widest]
            .map(|strategy| plan(&part, &cutter, strategy, &settings, &Silent).unwrap());
        assert_eq!(widest.path, free.path);
        assert!(widest.notes.iter().any(|note| note == ALIKE), "{:?}", widest.notes);
        assert_eq!(widest.kept.functions.len(), 1);
    }

    /// Passes of the least time on a mesh of two patches take no more of it than those of the least length.
    #[test]
    fn on_meshes_the_least_time_is_less_than_that_of_the_shortest_passes() {
        let shape = AnalyticShape::Saddle { radius_concave: 20.0, radius_convex: 9.0 };
        let patch =
            |x: f64| Patch::Analytic(AnalyticSurface::new(shape, [[x, x + 6.0], [-4.0, 4.0]]).unwrap());
        let part = Part::from_patches(vec![patch(-6.0), patch(0.0)], 0.002).unwrap();
        let cutter = Cutter::ball(6.0).unwrap();
        let settings = joined_on_the_surface(&part, 0.02);
        let machine = &machine::Machine { jerks: [f64::INFINITY; 3], ..settings.machine };
        let [time, length] = [Objective::Time, Objective::Length].map(|objective| {
            let strategy = ShortestStreamline { toward: None, objective };
            let plan = plan(&part, &cutter, &strategy, &settings, &Silent).unwrap();
            let path = machine::slow_corners(&plan.path, machine);
            assert!(plan.notes.iter().any(|note| note.starts_with(objective.told())), "{:?}", plan.notes);
            machine::machining_time(&path, machine, &Silent).unwrap()
        });
        println!("{time} {length}");
        assert!(time <= length * (1.0 + 1e-9), "{time} {length}");
    }

    /// The mesh that a section of radii and heights makes around z.
    fn revolved(section: &[[f64; 2]], around: u32) -> Part {
        let point = |k: u32| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(k % around) / f64::from(around)).sin_cos();
            let [radius, z] = section[(k / around) as usize];
            Point3::new(radius * cos, radius * sin, z)
        };
        let square = |k: u32| {
            let next = k / around * around + (k + 1) % around;
            [[k, k + around, next + around], [k, next + around, next]]
        };
        let rows = section.len() as u32;
        let points = (0..around * rows).map(point).collect();
        let triangles = (0..around * (rows - 1)).flat_map(square).collect();
        Part::from_mesh(TriangleMesh::new(points, triangles).unwrap().0)
    }

    /// A bowl around a hole, from 6 to 12 mm of radius; `bend` is that of its meridian, 1/mm.
    fn ring(bend: f64) -> Part {
        let radii = (0..=15).map(|k| 6.0 + 0.4 * f64::from(k));
        revolved(&radii.map(|radius| [radius, 0.5 * bend * radius * radius]).collect::<Vec<_>>(), 120)
    }

    /// For passes below a scallop height, joined on the surface.
    fn joined_on_the_surface(part: &Part, height: f64) -> PlanSettings {
        PlanSettings {
            step: Step::Scallop(height),
            stock_top: part.bounds().max.z + 1.0,
            joining: Joining { links: Links::Surface, ..Joining::default() },
            ..PlanSettings::default()
        }
    }

    /// The bound of a ring is that of its own area, and not of the rectangle around it; so is that of a plate
    /// without a hole whose border is no rectangle.
    #[test]
    fn the_shortest_possible_path_is_that_of_the_part() {
        let (cutter, h) = (Cutter::ball(6.0).unwrap(), 0.02);
        let width = scallop::strip_width_at(&cutter, &Vector3::z(), &Vector3::x(), &Default::default(), h).0;
        let half = [[0.0, 0.0, 0.0], [20.0, 0.0, 0.0], [0.0, 12.0, 0.0]].map(Point3::from).to_vec();
        let triangle = Part::from_mesh(TriangleMesh::new(half, vec![[0, 1, 2]]).unwrap().0);
        for (part, within) in [(ring(0.0), 1e-9), (triangle, 0.01)] {
            let mesh = part.mesh();
            let area: f64 = (0..mesh.triangles().len()).map(|t| mesh.area(t)).sum();
            let least = shortest::shortest_possible(&part, &cutter, h, &Silent).unwrap();
            assert!((least.cutting_mm * width / area - 1.0).abs() < within, "{least:?} {}", area / width);
        }
    }

    /// Around a hole in level ground passes that close have no ends, and are the quickest.
    #[test]
    fn around_a_hole_the_quickest_passes_close() {
        let part = ring(0.0);
        let cutter = Cutter::ball(6.0).unwrap();
        let settings = joined_on_the_surface(&part, 0.02);
        let time = ShortestStreamline { toward: None, objective: Objective::Time };
        let plan = plan(&part, &cutter, &time, &settings, &Silent).unwrap();
        let passes = &plan.kept.passes;
        let closed = passes.iter().filter(|pass| pass.first() == pass.last()).count();
        let length: f64 = passes.iter().flat_map(|p| p.windows(2)).map(|w| (w[1] - w[0]).norm()).sum();
        let least = shortest::shortest_possible(&part, &cutter, 0.02, &Silent).unwrap().cutting_mm;
        println!("{closed} of {} close, {length} {least} {:?}", passes.len(), plan.notes);
        assert!(closed == passes.len() && closed > 5, "{closed} of {}", passes.len());
        assert!(length > least && length < 1.1 * least, "{length} {least}");
    }

    /// Where many places were measured too high, the function goes on with narrower intervals there, which takes
    /// fewer passes than levels of the old one.
    #[test]
    fn where_many_places_are_narrower_the_function_is() {
        let half = [[0.0, 0.0, 0.0], [40.0, 0.0, 0.0], [0.0, 24.0, 0.0]].map(Point3::from).to_vec();
        let part = Part::from_mesh(TriangleMesh::new(half, vec![[0, 1, 2]]).unwrap().0);
        let cutter = Cutter::ball(6.0).unwrap();
        let settings = joined_on_the_surface(&part, 0.02);
        let time = ShortestStreamline { toward: None, objective: Objective::Time };
        let first = plan(&part, &cutter, &time, &settings, &Silent).unwrap();
        let high = (0..1200).map(|k| Point3::new(0.5 * f64::from(k % 30), 0.6 * f64::from(k / 30), 0.0));
        let places: Vec<_> = high.map(|at| (at, 0.85)).collect();
        let length = |anew: bool| {
            let correction = Correction::new(&places, 0.7);
            let earlier = Earlier { correction, kept: first.kept.clone(), anew, ..Earlier::default() };
            let settings = PlanSettings { earlier: Some(Arc::new(earlier)), ..settings.clone() };
            let plan = plan(&part, &cutter, &time, &settings, &Silent).unwrap();
            plan.kept.passes.iter().flat_map(|p| p.windows(2)).map(|w| (w[1] - w[0]).norm()).sum::<f64>()
        };
        let [halved, anew] = [false, true].map(length);
        println!("{halved} {anew}");
        assert!(anew < 0.99 * halved, "{anew} {halved}");
    }

    /// Passes around the hole of a bezel are taken where the search leads to others that take longer.
    #[test]
    fn on_a_bezel_no_plan_takes_longer_than_passes_along_its_borders() {
        // Its chamfers have 40 degrees.
        let section =
            [[13.3, 0.0], [14.15, 0.75], [15.0, 1.5], [17.5, 1.5], [20.0, 1.5], [20.9, 0.75], [21.8, 0.0]];
        let part = revolved(&section, 160);
        let (cutter, settings) = (Cutter::ball(4.0).unwrap(), joined_on_the_surface(&part, 0.03));
        let time_of = |strategy: &dyn Strategy| {
            let plan = plan(&part, &cutter, strategy, &settings, &Silent).unwrap();
            let path = machine::slow_corners(&plan.path, &settings.machine);
            machine::machining_time(&path, &settings.machine, &Silent).unwrap()
        };
        let along = Streamline::along(FeedDirection::Border(Sense::Along));
        let quickest = ShortestStreamline { toward: None, objective: Objective::Time };
        let [along, quickest] = [&along as &dyn Strategy, &quickest].map(time_of);
        println!("{along} {quickest}");
        assert!(quickest <= 1.001 * along, "{quickest} s for {along}");
    }

    /// Vectors that have a stream function are followed as closely as the published fit does where their
    /// lengths set the distances of passes; where the scallop sets them, by the more the greater their
    /// weight.
    #[test]
    fn vectors_of_a_stream_function_are_followed() {
        let [rms, most] = off(StreamMethod::Published, Solver::MinimumNorm, 7, DIRECTION_WEIGHT);
        println!("published {rms} {most}");
        assert!(rms <= 0.2 && most <= 1.0, "{rms} {most}");
        let spline = StreamMethod::BSpline { degree: 3, knots: KnotRule::Uniform };
        let weighed = [0.3, 10.0, 300.0].map(|weight| off(spline, Solver::Cholesky, 16, weight)[0]);
        println!("{weighed:?}");
        assert!(weighed[2] < 1.0 && weighed[1] < weighed[0] && weighed[2] < weighed[1], "{weighed:?}");
    }
}
