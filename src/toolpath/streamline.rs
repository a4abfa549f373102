//! Streamlines: passes along the level curves of a stream function fitted to feed directions; and
//! isoparametric lines, whose stream function is a parameter itself.

use super::chart::Chart;
use super::level_passes::along_levels;
use super::plan::{PassSettings, Passes, PlanError};
use super::{Along, FeedDirection};
use crate::cutter::Cutter;
use crate::field::{self, Axis, ScalarField, StreamSample, fit_stream_function};
use crate::geometry::{KnotVector, Vector3};
use crate::monitor::Monitor;
use crate::part::Part;

/// Samples of the feed direction per control point of the stream function and side.
const SAMPLES_PER_CONTROL: usize = 3;

/// Part of a direction's weight that does not depend on how much the direction matters, so that a
/// stream function is determined where it matters nowhere.
const LEAST_WEIGHT: f64 = 0.02;

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
