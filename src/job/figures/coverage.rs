//! How much of the surface the verdict covers, and the surface that no cell sees.

use metrology::CoverageFigures;
use report::{Claim, Figure, Gravity, micrometres, place};
use serde::Serialize;
use work::monitor::Monitor;

use super::words::value;
use crate::covered::{Covered, Unseen};
use crate::run::{Finding, Run};
use crate::{JobError, judge};

/// What the word means.
const MEANING: (&str, &str) = (
    "coverage",
    "What share of the part's surface the verdict covers. Cells over the plan view measure what is seen from above and is \
     not too steep, moves measure vertical walls; the rest of what is judged is measured along its normals. Its areas sum up to the whole surface.",
);

/// The coverage, and what was found on the surface that no cell sees.
#[derive(Debug, Serialize)]
struct Value<'a> {
    #[serde(flatten)]
    areas: &'a CoverageFigures,
    /// Where cells cut and something is judged that they do not see.
    #[serde(skip_serializing_if = "Option::is_none")]
    unseen: Option<UnseenValue<'a>>,
}

/// What was found along the normals of surface that no cell sees. mm.
#[derive(Debug, Serialize)]
struct UnseenValue<'a> {
    spacing_mm: f64,
    places: usize,
    scallop: &'a metrology::ScallopFigures,
    gouge: &'a metrology::GougeFigures,
    uncut: &'a metrology::UncutFigures,
    /// Whether a place was never cut: material then stands at least as high as `uncut` says.
    never_cut: bool,
}

/// Of every toolpath.
pub(super) fn find(run: &Run<'_>, _: &dyn Monitor) -> Result<Finding, JobError> {
    let Covered { areas, unseen } = run.covered;
    let mut claims = nothing_judged(areas).into_iter().collect::<Vec<_>>();
    claims.extend(unseen.as_ref().map_or_else(Vec::new, |unseen| judged(run, unseen)));
    let sentence = (!areas.scope.is_empty()).then(|| {
        ("Coverage", format!("the verdict of {} covers {}", run.request.name, covered(&areas.scope)))
    });
    let rows = rows(areas);
    let unseen = unseen.as_ref().map(|Unseen { measurement, spacing_mm, never_cut, .. }| UnseenValue {
        spacing_mm: *spacing_mm,
        places: measurement.deviation_map.len(),
        scallop: &measurement.scallop,
        gouge: &measurement.gouge,
        uncut: &measurement.uncut,
        never_cut: *never_cut,
    });
    let value = value(&Value { areas, unseen })?;
    let figure =
        Figure { key: "coverage", value, rows, meaning: Some(MEANING), sentence, ..Figure::default() };
    Ok(Finding { figure: Some(figure), claims, ..Finding::default() })
}

/// `31 % of the surface …` of `on 31 % of the surface …`.
fn covered(scope: &str) -> &str {
    scope.strip_prefix("on ").unwrap_or(scope)
}

/// The limits of the surface that no cell sees.
fn judged(run: &Run<'_>, unseen: &Unseen) -> Vec<Claim> {
    let measured = &unseen.measurement;
    let (limits, rule) = (&run.scene().tolerance, &run.scene().scallop_rule);
    let mut claims = judge::judge(measured, limits, rule, Vec::new(), run.path().program_name());
    for claim in &mut claims {
        if claim.what == "uncut" && unseen.never_cut {
            let at = measured
                .uncut
                .regions
                .first()
                .map_or_else(String::new, |r| format!(" at {}", place(r.at_mm)));
            claim.text = format!(
                "material was never cut over {:.3} mm² and stands at least {} µm high (limit {}){at}",
                measured.uncut.area_mm2,
                micrometres(Some(measured.uncut.max_height_mm)),
                micrometres(Some(limits.uncut)),
            );
        }
        claim.text += judge::UNSEEN;
    }
    claims
}

/// A verdict on no surface is none.
fn nothing_judged(areas: &CoverageFigures) -> Option<Claim> {
    (areas.judged_mm2 <= 0.0).then(|| Claim {
        what: "coverage",
        gravity: Gravity::Finish,
        unit: "",
        limit: 0.0,
        measured: None,
        error_bound: f64::INFINITY,
        text: "the tool faces nothing of the part's surface".to_owned(),
        at_least: None,
        decided_by: "turn the part, or tilt the tool",
    })
}

fn rows(areas: &CoverageFigures) -> Vec<(&'static str, String)> {
    let mm2 = |area: f64| format!("{area:.1} mm²");
    vec![
        ("surface, judged", format!("{}, {}", mm2(areas.surface_mm2), mm2(areas.judged_mm2))),
        (
            "measured by cells, along normals, by moves",
            format!(
                "{}, {}, {}",
                mm2(areas.by_cells_mm2),
                mm2(areas.along_normals_mm2),
                mm2(areas.by_moves_mm2)
            ),
        ),
        (
            "walls, facing away, hidden: not judged",
            format!("{}, {}, {}", mm2(areas.walls_mm2), mm2(areas.facing_away_mm2), mm2(areas.hidden_mm2)),
        ),
    ]
}
