//! What is measured of a scene's pocket.

use cutter::Cutter;
use geometry::{Region, RegionIndex};
use metrology::{
    ContactArcs, EngagementFigures, ExceedingStretch, PocketFigures, THIN_LAYER, ThinLayers, UNCOUNTED_LAYER,
    WallGouge, WallMaterial, WallSearch, radius_below, stock_beside, wall_gouge_of_cells,
    wall_gouge_of_moves,
};
use motion::Toolpath;
use scene::unmeasured_beside_walls;
use sim::ZMap;
use toolpath::{Engagement, Exceeding, Pocket, PocketStrategy, Step, engagement, limit_feed};
use work::monitor::{Cancelled, Monitor};

use super::Session;
use super::tool::ToolMoves;

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

/// What is measured of a pocket besides its floor and the engagement, whoever planned the moves; `cut` is the
/// stock that they leave.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub(crate) fn pocket_figures(
    session: &Session,
    pocket: &Pocket,
    path: &Toolpath,
    tools: &[ToolMoves<'_>],
    cut: &ZMap,
    monitor: &dyn Monitor,
) -> Result<PocketFigures, Cancelled> {
    let top = session.top();
    let room = pocket.room();
    let beside = stock_beside(&room, &session.stock.bounds());
    let mut gouge = WallGouge::default();
    let mut most = 0.0f64;
    for tool in tools {
        let its = wall_gouge_of_moves(&beside, tool.cutter, &tool.path, top, monitor)?;
        most = most.max(its.depth + its.error_bound);
        if its.depth > gouge.depth {
            gouge = WallGouge { move_index: tool.first + its.move_index, ..its };
        }
    }
    let (of_cells, area) = wall_gouge_of_cells(&room, cut, top, monitor)?;
    let off = pocket.off_drawing.max(ROUNDING) + path.origin.strays;
    let left = material_on_walls(session, pocket, tools, monitor)?;
    Ok(PocketFigures {
        area_mm2: pocket.region.area(),
        unreachable_area_mm2: pocket.rest_area(narrowest(session, tools), monitor)?,
        stepover_mm: None,
        wall_gouge_mm: gouge.depth,
        wall_gouge_error_bound_mm: off + (most - gouge.depth),
        wall_gouge_move: gouge.move_index,
        wall_gouge_of_cells_mm: of_cells,
        wall_gouge_of_cells_error_bound_mm: off + std::f64::consts::FRAC_1_SQRT_2 * cut.grid.cell,
        wall_gouge_area_mm2: area,
        wall_uncut_mm: left.thickness,
        wall_uncut_error_bound_mm: Some(left.error_bound + off).filter(|bound| bound.is_finite()),
        wall_uncut_at_mm: left.at.map(Into::into),
        engagement: None,
    })
}

/// The tool with the least radius, by which walls are reached.
fn narrowest<'a>(session: &'a Session, tools: &'a [ToolMoves<'_>]) -> &'a Cutter {
    let cutters = tools.iter().map(|tool| tool.cutter);
    cutters.min_by(|a, b| a.radius().total_cmp(&b.radius())).unwrap_or(&session.scene.tooling.cutter)
}

/// What tools leave on the walls that they come to, above the round of their corners.
fn material_on_walls(
    session: &Session,
    pocket: &Pocket,
    tools: &[ToolMoves<'_>],
    monitor: &dyn Monitor,
) -> Result<WallMaterial, Cancelled> {
    let (cutter, limits) = (narrowest(session, tools), &session.scene.tolerance);
    let foot = cutter.corner_radius();
    if foot >= pocket.depth {
        return Ok(WallMaterial::default());
    }
    // As far as the floor is not measured, which is offset twice.
    let radius = cutter.radius();
    let strip = unmeasured_beside_walls(limits.chord, radius) + 4.0 * Region::offset_excess(radius);
    let deep = strip + foot;
    let search = WallSearch {
        walls: &pocket.reached_walls(radius),
        level: limits.uncut - pocket.depth,
        deep,
        farthest: deep + 2.0 * limits.uncut,
        before: (!pocket.air().is_empty())
            .then(|| (RegionIndex::new(pocket.air().clone()), pocket.borders_of_air())),
    };
    // What is wider farther up is as wide as at the foot of the wall.
    let tools = tools.iter().map(|tool| (radius_below(tool.cutter, foot), &*tool.path));
    search.run(&tools.collect::<Vec<_>>(), monitor)
}

/// The engagement of passes that `strategy` planned; each engagement is one with the bound of its greatest
/// angle, rad.
pub(crate) fn engagement_figures(
    strategy: &PocketStrategy,
    step: Step,
    path: &Toolpath,
    radius: f64,
    (engaged, engagement_bound): &(Engagement, f64),
    engaged_thinly: Option<&(Engagement, f64)>,
) -> EngagementFigures {
    let exceeding = if strategy.engagement.is_some() { &engaged.exceeding[..] } else { &[] };
    EngagementFigures {
        max_engagement_deg: engaged.max.to_degrees(),
        max_engagement_error_bound_deg: engagement_bound.to_degrees(),
        uncounted_layer_mm: UNCOUNTED_LAYER * radius,
        max_engagement_move: engaged.max_move,
        p95_engagement_deg: engaged.p95.to_degrees(),
        engagement_limit_deg: as_asked(strategy.engagement_limit(step, radius)),
        over_engagement_limit_fraction: engaged.over_limit,
        over_engagement_limit: listed(exceeding, path, |one| one.length),
        over_engagement_limit_count: exceeding.len(),
        thin_layers: engaged_thinly.map(|(engaged, bound)| thin_layers(engaged, *bound, radius, path)),
    }
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

/// The engagement with layers counted down to [`THIN_LAYER`] of a `radius`, mm; `bound` is that of its
/// greatest angle, rad.
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
