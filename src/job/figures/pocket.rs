//! Walls and engagement of a pocket.

use metrology::{PocketFigures, View};
use report::{Claim, Figure, Gravity, micrometres, with_bound};
use toolpath::PocketStrategy;
use work::monitor::Monitor;

use super::value;
use crate::JobError;
use crate::pocket::pocket_figures;
use crate::run::{Finding, Run};

pub(super) fn find(run: &Run<'_>, _: &dyn Monitor) -> Result<Finding, JobError> {
    let (Some(pocket), Some(strategy)) =
        (&run.session.pocket, run.request.strategy.downcast_ref::<PocketStrategy>())
    else {
        return Ok(Finding::default());
    };
    let (View::Heights(cut), Some(engaged)) = (run.view(), &run.planned.engaged) else {
        return Ok(Finding::default());
    };
    let step = run.request.step;
    let p = pocket_figures(run.scene(), pocket, strategy, step, run.path(), cut, run.session.top, engaged);
    let claims = vec![within_walls(run, &p)];
    let figure = Figure { key: "pocket", value: value(&p)?, rows: rows(&p), ..Figure::default() };
    Ok(Finding { figure: Some(figure), claims, ..Finding::default() })
}

fn rows(p: &PocketFigures) -> Vec<(&'static str, String)> {
    vec![
        ("stepover", format!("{:.3} mm", p.stepover_mm)),
        (
            "engagement, greatest and 95 %",
            format!(
                "{:.0} ± {:.0}, {:.0} degrees",
                p.max_engagement_deg, p.max_engagement_error_bound_deg, p.p95_engagement_deg
            ),
        ),
        (
            "above the limit",
            format!(
                "{:.1} % of the length above {:.0} degrees",
                100.0 * p.over_engagement_limit_fraction,
                p.engagement_limit_deg
            ),
        ),
        (
            "cut beyond the walls",
            format!("{} µm", with_bound(Some(p.wall_gouge_mm), Some(p.wall_gouge_error_bound_mm))),
        ),
        ("out of reach in corners", format!("{:.3} mm²", p.unreachable_area_mm2)),
    ]
}

/// That the cutter does not come beyond a pocket's outline.
fn within_walls(run: &Run<'_>, pocket: &PocketFigures) -> Claim {
    let limit = run.scene().tolerance.gouge;
    let measured = pocket.wall_gouge_mm.max(pocket.wall_gouge_of_cells_mm);
    let bound = pocket.wall_gouge_error_bound_mm;
    let index = pocket.wall_gouge_move;
    let text = format!(
        "the wall is cut {} µm beyond the outline (limit {}) by move {index}, toolpath.nc line {}",
        with_bound(Some(measured), Some(bound)),
        micrometres(Some(limit)),
        run.line(index)
    );
    Claim::length("wall", Gravity::Scrap, limit, measured, bound).told(text)
}
