//! What is measured of a scene's pocket.

use metrology::{
    ContactArcs, ExceedingStretch, PocketFigures, THIN_LAYER, ThinLayers, UNCOUNTED_LAYER,
    wall_gouge_of_cells, wall_gouge_of_moves,
};
use motion::Toolpath;
use scene::Scene;
use sim::ZMap;
use toolpath::{Engagement, Exceeding, Pocket, PocketStrategy, Step, engagement, limit_feed};
use work::monitor::{Cancelled, Monitor};

/// Lowers the feed where more of the cutter was measured in stock than the strategy allows. Leaves the
/// engagement of the passes, and the bound of its greatest angle, rad.
pub fn limit_feed_by(
    path: &mut Toolpath,
    arcs: &ContactArcs,
    strategy: &PocketStrategy,
    step: Step,
    radius: f64,
) -> (Engagement, f64) {
    let limit = strategy.engagement_limit(step, radius);
    let found = engagement(path, &arcs.of_moves, limit);
    limit_feed(path, &arcs.of_moves, limit);
    (found, arcs.bound())
}

/// Distances from walls below this are rounding, mm.
const ROUNDING: f64 = 1e-6;

/// What is measured of a pocket besides its floor. `top` is the height of the stock, mm; each engagement is one with the bound of its
/// greatest angle, rad.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub fn pocket_figures(
    scene: &Scene,
    pocket: &Pocket,
    strategy: &PocketStrategy,
    step: Step,
    path: &Toolpath,
    cut: &ZMap,
    top: f64,
    (engaged, engagement_bound): &(Engagement, f64),
    engaged_thinly: Option<&(Engagement, f64)>,
    monitor: &dyn Monitor,
) -> Result<PocketFigures, Cancelled> {
    let cutter = &scene.cutter;
    let (wall_gouge_mm, wall_gouge_move) = wall_gouge_of_moves(pocket.free(), cutter, path, top, monitor)?;
    let exceeding = if strategy.engagement.is_some() { &engaged.exceeding[..] } else { &[] };
    let (of_cells, area) = wall_gouge_of_cells(pocket.free(), cut, top, monitor)?;
    Ok(PocketFigures {
        area_mm2: pocket.region.area(),
        unreachable_area_mm2: pocket.rest_area(cutter, monitor)?,
        stepover_mm: strategy.stepover(step, cutter.radius()),
        wall_gouge_mm,
        wall_gouge_error_bound_mm: pocket.off_drawing.max(ROUNDING) + path.origin.strays,
        wall_gouge_move,
        wall_gouge_of_cells_mm: of_cells,
        wall_gouge_of_cells_error_bound_mm: std::f64::consts::FRAC_1_SQRT_2 * cut.grid.cell,
        wall_gouge_area_mm2: area,
        max_engagement_deg: engaged.max.to_degrees(),
        max_engagement_error_bound_deg: engagement_bound.to_degrees(),
        uncounted_layer_mm: UNCOUNTED_LAYER * cutter.radius(),
        max_engagement_move: engaged.max_move,
        p95_engagement_deg: engaged.p95.to_degrees(),
        engagement_limit_deg: as_asked(strategy.engagement_limit(step, cutter.radius())),
        over_engagement_limit_fraction: engaged.over_limit,
        over_engagement_limit: listed(exceeding, path, |one| one.length),
        over_engagement_limit_count: exceeding.len(),
        thin_layers: engaged_thinly
            .map(|(engaged, bound)| thin_layers(engaged, *bound, cutter.radius(), path)),
    })
}

/// An angle, rad, in the degrees that it was asked in, without what turning them over rounds.
fn as_asked(angle: f64) -> f64 {
    const DECIMALS: f64 = 1e9;
    (angle.to_degrees() * DECIMALS).round() / DECIMALS
}

/// The stretches with the greatest `by`, in that order.
fn listed(all: &[Exceeding], path: &Toolpath, by: impl Fn(&Exceeding) -> f64) -> Vec<ExceedingStretch> {
    let mut all = all.to_vec();
    all.sort_by(|a, b| by(b).total_cmp(&by(a)));
    all.iter().take(PocketFigures::LISTED).map(|one| stretch(one, path)).collect()
}

fn stretch(one: &Exceeding, path: &Toolpath) -> ExceedingStretch {
    ExceedingStretch {
        x: one.from.x,
        y: one.from.y,
        z: one.from.z,
        length_mm: one.length,
        max_engagement_deg: one.max.to_degrees(),
        first_move: one.first_move,
        line: path.line_of(one.first_move as usize),
    }
}

/// The engagement with layers counted down to [`THIN_LAYER`] of a `radius`, mm; `bound` is that of its greatest angle, rad.
fn thin_layers(engaged: &Engagement, bound: f64, radius: f64, path: &Toolpath) -> ThinLayers {
    let above = &engaged.exceeding;
    ThinLayers {
        counted_from_mm: THIN_LAYER * radius,
        max_engagement_deg: engaged.max.to_degrees(),
        max_engagement_error_bound_deg: bound.to_degrees(),
        max_engagement_move: engaged.max_move,
        over_engagement_limit_mm: above.iter().map(|one| one.length).fold(0.0, |a, b| a + b),
        over_engagement_limit: listed(above, path, |one| one.max),
        over_engagement_limit_count: above.len(),
    }
}
