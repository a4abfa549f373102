//! What a streamline was planned by.

use serde::Serialize;

use ::field::{PassPoint, PlannedField};
use report::Figure;
use work::monitor::Monitor;

use super::value;
use crate::JobError;
use crate::run::{Finding, Run};

/// A point around which the feed directions turn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SingularPointFigures {
    /// Where.
    pub at_mm: [f64; 3],
    /// Turns of the direction on a way around it: 0.5 for the end of a fold, 1 for a centre, -0.5 for a three-way
    /// junction, -1 for a saddle.
    pub index: f64,
}

/// Planned intervals over the allowed ones, at even distances along all passes; at each place of the farther neighbour.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct IntervalFigures {
    /// 5 % are narrower.
    pub p5: f64,
    /// Half are narrower.
    pub p50: f64,
    /// 95 % are narrower.
    pub p95: f64,
    /// The widest.
    pub max: f64,
}

/// What a streamline path was planned by. Predictions of the planner; nothing of it is measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FieldFigures {
    /// Number of singular points.
    pub singular_point_count: usize,
    /// The first of them, 100 at most.
    pub singular_points: Vec<SingularPointFigures>,
    /// Intervals over the allowed ones, where passes have neighbours.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interval_over_allowed: Option<IntervalFigures>,
}

/// Most singular points in report.json. Noise can make thousands.
pub const MOST_SINGULAR_POINTS: usize = 100;

impl FieldFigures {
    /// Of a planned field.
    pub fn new(field: &PlannedField) -> Self {
        let mut ratios: Vec<f64> =
            field.passes.iter().flatten().filter(|p| p.inside).filter_map(PassPoint::ratio).collect();
        ratios.sort_by(f64::total_cmp);
        let at =
            |share: f64| Some(*ratios.get((share * ratios.len().checked_sub(1)? as f64).round() as usize)?);
        let interval_over_allowed = (|| {
            Some(IntervalFigures { p5: at(0.05)?, p50: at(0.5)?, p95: at(0.95)?, max: *ratios.last()? })
        })();
        let point = |s: &::field::mesh::SingularPoint| SingularPointFigures {
            at_mm: s.position.into(),
            index: 0.5 * f64::from(s.half_turns),
        };
        Self {
            singular_point_count: field.singular_points.len(),
            singular_points: field.singular_points.iter().take(MOST_SINGULAR_POINTS).map(point).collect(),
            interval_over_allowed,
        }
    }
}

pub(super) fn find(run: &Run<'_>, _: &dyn Monitor) -> Result<Finding, JobError> {
    let Some(field) = &run.planned.plan.field else { return Ok(Finding::default()) };
    let figures = FieldFigures::new(field);
    let mut rows = vec![("singular points of the feed", figures.singular_point_count.to_string())];
    if let Some(i) = &figures.interval_over_allowed {
        let [p5, p50, p95, max] = [i.p5, i.p50, i.p95, i.max].map(|r| format!("{:.0}", 100.0 * r));
        rows.push((
            "interval planned, % of allowed",
            format!("{p5}, {p50}, {p95} (5, 50, 95 %), widest {max}"),
        ));
    }
    let figure = Figure { key: "field", value: value(&figures)?, rows, ..Figure::default() };
    Ok(Finding { figure: Some(figure), ..Finding::default() })
}
