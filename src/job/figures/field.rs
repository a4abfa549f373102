//! What a streamline was planned by.

use serde::Serialize;

use ::field::{DirectionError, PassPoint, PlannedField};
use report::{Claim, Figure, Gravity, place};
use toolpath::{FITTED, Levelled};
use work::monitor::Monitor;

use super::words::value;
use crate::JobError;
use crate::run::{Finding, Run};

/// A point around which the feed directions turn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SingularPointFigures {
    /// Where.
    pub at_mm: [f64; 3],
    /// Turns of the direction on a way around it: 0.5 for the end of a fold, 1 for a centre, -0.5 for a
    /// three-way junction, -1 for a saddle.
    pub index: f64,
}

/// Planned intervals over the allowed ones, at even distances along all passes; at each place of the farther
/// neighbour.
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
    /// What the functions are whose levels are the passes, each once: a stream function that was searched or
    /// fitted, or a front from a border where its passes are shorter.
    pub planned_as: Vec<String>,
    /// Number of singular points.
    pub singular_point_count: usize,
    /// The first of them, 100 at most.
    pub singular_points: Vec<SingularPointFigures>,
    /// The angle between passes and the feed directions asked for, degrees: root mean square over the length
    /// of all passes; over the rows of a table; over the length of guides and borders. Absent where none were
    /// asked for, as the three that follow.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub direction_error_rms_deg: Option<f64>,
    /// The greatest, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub direction_error_max_deg: Option<f64>,
    /// By how much it may be greater between the places that were looked at, and less at a row, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub direction_error_bound_deg: Option<f64>,
    /// Where.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub direction_error_at_mm: Option<[f64; 3]>,
    /// Intervals over the allowed ones, where passes have neighbours.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interval_over_allowed: Option<IntervalFigures>,
}

/// Most singular points in report.json. Noise can make thousands.
pub const MOST_SINGULAR_POINTS: usize = 100;

impl FieldFigures {
    /// Of a planned field and the functions that were kept of it; those fitted to directions over charts are
    /// not.
    pub fn new(field: &PlannedField, functions: &[Levelled]) -> Self {
        let mut planned_as: Vec<String> = functions.iter().map(|f| f.planned_as.to_string()).collect();
        planned_as.sort();
        planned_as.dedup();
        if planned_as.is_empty() {
            planned_as.push(FITTED.to_owned());
        }
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
            planned_as,
            singular_point_count: field.singular_points.len(),
            singular_points: field.singular_points.iter().take(MOST_SINGULAR_POINTS).map(point).collect(),
            direction_error_rms_deg: field.direction_error.map(|error| error.rms.to_degrees()),
            direction_error_max_deg: field.direction_error.map(|error| error.max.to_degrees()),
            direction_error_bound_deg: field.direction_error.map(|error| error.error_bound.to_degrees()),
            direction_error_at_mm: field.direction_error.map(|error| error.at.into()),
            interval_over_allowed,
        }
    }
}

pub(super) fn find(run: &Run<'_>, _: &dyn Monitor) -> Result<Finding, JobError> {
    let limit = run.scene().off_direction;
    let unjudged = |error: Option<DirectionError>| {
        Vec::from_iter((limit.is_some() && error.is_none()).then(|| UNJUDGED.to_owned()))
    };
    let Some(field) = &run.planned.plan.field else {
        return Ok(Finding { notes: unjudged(None), ..Finding::default() });
    };
    let figures = FieldFigures::new(field, &run.planned.plan.kept.functions);
    let mut rows = vec![
        ("planned as", figures.planned_as.join("; ")),
        ("singular points of the feed", figures.singular_point_count.to_string()),
    ];
    let sentence = field.direction_error.map(|error| {
        let [rms, max] = [error.rms, error.max].map(|angle| format!("{:.2}", angle.to_degrees()));
        let told = format!("{rms} (root mean square), {max} at most");
        rows.push(("off the directions asked for, degrees", told.clone()));
        ("Degrees off the feed directions asked for", format!("{told}: {}", run.request.name))
    });
    if let Some(i) = &figures.interval_over_allowed {
        let [p5, p50, p95, max] = [i.p5, i.p50, i.p95, i.max].map(|r| format!("{:.0}", 100.0 * r));
        rows.push((
            "interval planned, % of allowed",
            format!("{p5}, {p50}, {p95} (5, 50, 95 %), widest {max}"),
        ));
    }
    let meaning = sentence.is_some().then_some((
        "off the directions asked for",
        "Angle between passes and the feed directions that the scene asks for: along all passes, or at the rows of a table, or along \
         guides and borders. Where directions turn around a point, passes cannot follow them close to it.",
    ));
    let figure =
        Figure { key: "field", value: value(&figures)?, rows, sentence, meaning, ..Figure::default() };
    let claims = field.direction_error.zip(limit).map(obeys).into_iter().collect();
    Ok(Finding { figure: Some(figure), claims, notes: unjudged(field.direction_error) })
}

/// The claim that passes keep to the directions asked for, within a limit, rad.
fn obeys((error, limit): (DirectionError, f64)) -> Claim {
    let [max, bound, limit] = [error.max, error.error_bound, limit].map(f64::to_degrees);
    let text = format!(
        "passes are up to {max:.2} ± {bound:.2} degrees off the directions asked for (limit {limit:.2}) at {}",
        place(error.at.into())
    );
    let claim = Claim::length("direction", Gravity::Finish, limit, max, bound).told(text);
    Claim { unit: "deg", decided_by: DECIDED_BY, ..claim }
}

/// What decides whether passes keep to their directions: no cell does, because it is not measured by the cut.
const DECIDED_BY: &str = "passes that turn less there, or a limit with more room, would decide it";

/// What is told where a limit for directions has nothing to hold to.
const UNJUDGED: &str =
    "`[tolerance] direction` judges nothing here: no passes of this toolpath were asked for a direction";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Session;
    use report::{ToolpathResult, Verdict};
    use scene::Scene;
    use work::monitor::Silent;

    /// The first toolpath of a plate of 8 by 6 mm with a limit for directions, degrees.
    fn planned(limit: f64, toolpath: &str) -> ToolpathResult {
        let text = format!(
            "[part]\nsurface = \"plane\"\nx = [0, 8]\ny = [0, 6]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n\
             [tolerance]\nscallop = 0.05\nchord = 0.005\ndirection = {limit}\n[[toolpath]]\nstrategy = \"streamline\"\n{toolpath}\n"
        );
        let session = Session::new(Scene::parse("plate.toml", text).unwrap()).unwrap();
        session.toolpath(&session.scene.toolpaths[0], &Silent).unwrap().result
    }

    fn claim(result: &ToolpathResult) -> Option<Verdict> {
        result.claims.iter().find(|claim| claim.what == "direction").map(report::Claim::verdict)
    }

    #[test]
    fn passes_that_leave_their_directions_violate_the_limit_for_them() {
        let along = planned(0.5, "direction = { angle = 30 }");
        let figure = along.figures.iter().find(|figure| figure.key == "field").unwrap();
        let of = |key: &str| figure.value[key].as_f64().unwrap();
        assert!(of("direction_error_rms_deg") <= of("direction_error_max_deg"), "{}", figure.value);
        assert!(of("direction_error_max_deg") + of("direction_error_bound_deg") < 0.5, "{}", figure.value);
        assert_eq!(claim(&along), Some(Verdict::Pass));
        // Left free, passes of least length run along the longer sides.
        let free = planned(0.5, "direction = { angle = 30 }\nfollow = 0");
        assert_eq!(claim(&free), Some(Verdict::Fail));
        assert!(free.notes.iter().any(|note| note.contains("off the directions")), "{:?}", free.notes);
        let shortest = planned(0.5, "direction = \"shortest\"");
        assert_eq!(claim(&shortest), None, "none was asked for");
        assert!(shortest.notes.iter().any(|note| note == UNJUDGED), "{:?}", shortest.notes);
        assert!(!along.notes.iter().any(|note| note == UNJUDGED), "{:?}", along.notes);
    }

    /// A limit within the bound of the angle is not decided by cells.
    #[test]
    fn what_would_decide_a_limit_for_directions_is_told() {
        let error = DirectionError { rms: 0.01, max: 0.1, error_bound: 0.02, at: geometry::Point3::origin() };
        let sentence = obeys((error, 0.11)).sentence();
        assert!(sentence.contains("a limit with more room") && !sentence.contains("cell"), "{sentence}");
    }
}
