//! Streamlines: passes along the level curves of a stream function fitted to feed directions; and
//! isoparametric lines, whose stream function is a parameter itself.

use crate::levels::level_passes::{along_levels, along_levels_placed};
use crate::levels::planned_field;
use crate::levels::spacing::LevelSteps;
use crate::surface::chart::{Chart, ChartPoint};
use crate::surface::feed;
use crate::surface::mesh_surface::not_applicable;
use crate::vocabulary::{Along, FeedDirection, PassSettings, Passes, PlanError};
use cutter::Cutter;
use field::{
    Axis, FieldError, KnotRule, ScalarField, Solver, StreamSample, averaged_knots, equal_shares,
    fit_by_differences, fit_stream_function, weighted_knots,
};
use geometry::{KnotVector, Vector3};
use part::Part;
use work::monitor::Monitor;

/// Samples of the feed direction per control point of the stream function and side.
const SAMPLES_PER_CONTROL: usize = 3;

/// Part of a direction's weight that does not depend on how much the direction matters, so that a
/// stream function is determined where it matters nowhere.
const LEAST_WEIGHT: f64 = 0.02;

/// Passes along isoparametric lines, with levels placed in a given way; without `along` whichever of the two families
/// is shorter on all patches together.
pub fn iso_parametric(
    part: &Part,
    cutter: &Cutter,
    along: Option<Along>,
    placing: LevelSteps,
    settings: &PassSettings,
    monitor: &dyn Monitor,
) -> Result<Passes, PlanError> {
    if let Some(along) = along {
        return iso_parametric_along(part, cutter, along, placing, settings, monitor);
    }
    let [u, v] =
        [Along::U, Along::V].map(|a| iso_parametric_along(part, cutter, a, placing, settings, monitor));
    let (u, v) = (u?, v?);
    let lengths = [u.length(), v.length()];
    let (mut best, word) = if lengths[0] <= lengths[1] { (u, "u") } else { (v, "v") };
    best.notes.push(format!(
        "feed along {word} was chosen: {:.0} mm of passes along u, {:.0} mm along v",
        lengths[0], lengths[1]
    ));
    Ok(best)
}

fn iso_parametric_along(
    part: &Part,
    cutter: &Cutter,
    along: Along,
    placing: LevelSteps,
    settings: &PassSettings,
    monitor: &dyn Monitor,
) -> Result<Passes, PlanError> {
    let field = ScalarField::Coordinate(match along {
        Along::U => Axis::V,
        Along::V => Axis::U,
    });
    let mut all = Passes::default();
    for chart in Chart::all(part, cutter, settings.axis)? {
        all.append(along_levels_placed(part, cutter, &chart, &field, placing, settings, monitor)?);
    }
    Ok(all)
}

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

/// How a stream function is fitted, and to how many coefficients.
pub struct Fitting {
    /// Control points a side.
    pub controls: usize,
    /// B-spline or differences.
    pub method: StreamMethod,
    /// What solves the equations.
    pub solver: Solver,
}

/// Passes along the level curves of a stream function fitted to feed directions.
pub fn streamline(
    part: &Part,
    cutter: &Cutter,
    direction: &FeedDirection,
    fitting: &Fitting,
    settings: &PassSettings,
    monitor: &dyn Monitor,
) -> Result<Passes, PlanError> {
    let charts = Chart::all(part, cutter, settings.axis)?;
    let parameters: Vec<_> = charts.iter().map(|chart| chart.domain).collect();
    feed::check(direction, part, &parameters)?;
    let mut all = Passes::default();
    for chart in charts {
        let direction = feed::on_chart(direction, &chart, cutter)?;
        let (field, mut notes, wanted) = stream_function(&chart, cutter, &direction, fitting, settings)?;
        let mut passes = along_levels(part, cutter, &chart, &field, settings, monitor)?;
        let feed = |[u, v]: [f64; 2]| chart.at(u, v)?.feed(&direction, cutter);
        planned_field::set_directions(&mut passes.field, part, &chart, feed);
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
struct Wanted {
    /// Places a side.
    side: usize,
    lines: Vec<Option<(Vector3, f64)>>,
}

/// Samples feed directions over a chart and fits the stream function.
fn stream_function(
    chart: &Chart,
    cutter: &Cutter,
    direction: &FeedDirection,
    fitting: &Fitting,
    settings: &PassSettings,
) -> Result<(ScalarField, Vec<String>, Wanted), PlanError> {
    let n = fitting.controls * SAMPLES_PER_CONTROL;
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
            density: 1.0 / p.strip_width(cutter, &t, settings.step).0,
            weight: (e * g - f * f).max(0.0).sqrt() * (matters + LEAST_WEIGHT),
        })
    };
    let samples: Vec<Option<StreamSample>> = (0..places.len()).map(sample).collect();
    let refused = |e: FieldError| not_applicable(&e.to_string());
    let (psi, angle_rms, method, report) = match fitting.method {
        StreamMethod::Differences => {
            let fit = fit_by_differences(&samples, chart.domain, [n; 2], fitting.solver).map_err(refused)?;
            (ScalarField::Grid(fit.psi), fit.angle_rms, format!("differences on {n} x {n} cells"), fit.report)
        }
        spline => {
            let (degree, knots) = match spline {
                StreamMethod::BSpline { degree, knots } => (degree, knots),
                _ => (3, KnotRule::Uniform),
            };
            let given: Vec<StreamSample> = samples.into_iter().flatten().collect();
            let [knots_u, knots_v] = placed_knots(chart, &points, degree, fitting.controls, knots)?;
            let fit = fit_stream_function(&given, knots_u, knots_v, fitting.solver).map_err(refused)?;
            let name =
                format!("a B-spline of degree {degree} with {0} x {0} control points", fitting.controls);
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
    Ok((psi, notes, Wanted { side: n, lines }))
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
