//! What is measured of a scene's pocket.

use cutter::Cutter;
use geometry::{Point2, Region, RegionIndex};
use metrology::{
    ContactArcs, EngagementFigures, ExceedingStretch, PocketFigures, THIN_LAYER, ThinLayers, UNCOUNTED_LAYER,
    WallGouge, WallMaterial, WallSearch, radius_below, stock_beside, wall_gouge_of_cells,
    wall_gouge_of_moves,
};
use motion::{Cutters, Toolpath};
use scene::unmeasured_beside_walls;
use sim::{Envelope, ZMap};
use toolpath::{Engagement, Exceeding, Pocket, PocketStrategy, Step, engagement, limit_feed};
use work::monitor::{self, Cancelled, Monitor};

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

/// What stands on the floor of a pocket where its cutter does not reach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct OutOfReach {
    /// Area of such floor, mm², but for what is nearer to walls than is measured; 0 where there is none.
    pub area: f64,
    /// How high material stands over one of its places, mm, the highest of those that were looked at.
    pub height: f64,
    /// What stands there for certain, mm.
    pub at_least: f64,
    /// No place is higher, mm: floor beside walls counts as far as its material is from them.
    pub at_most: f64,
    /// That place in the plan view.
    pub at: Option<Point2>,
}

/// Places of floor out of reach that are looked at, and pieces of it whose middle is.
const MOST_PLACES: usize = 500;
const MOST_PIECES: usize = 50;

/// Precision of those middles, mm.
const MIDDLE: f64 = 0.01;

/// What `whole` a path of all tools leaves where the scene's cutter does not reach.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub(crate) fn out_of_reach(
    session: &Session,
    pocket: &Pocket,
    (path, cutters): (&Toolpath, &Cutters),
    cut: &ZMap,
    monitor: &dyn Monitor,
) -> Result<OutOfReach, Cancelled> {
    let cutter = &session.scene.tooling.cutter;
    let clear = unmeasured_beside_walls(session.scene.tolerance.chord, cutter.radius());
    let strip = clear + 4.0 * Region::offset_excess(cutter.radius()) + pocket.off_drawing;
    let region = pocket.out_of_reach(cutter, [clear, strip]);
    let mut found = OutOfReach {
        area: region.area(),
        height: 0.0,
        at_least: 0.0,
        at_most: strip.min(pocket.depth),
        at: None,
    };
    if region.is_empty() {
        return Ok(found);
    }
    let stock = |q: &Point2| cut.shape.as_ref().map_or(cut.top, |shape| shape.height_at(q.x, q.y));
    found.at_most = pocket.depth + session.top();
    let corners: Vec<Point2> = region.curves().flatten().copied().collect();
    let mut places: Vec<Point2> =
        corners.iter().step_by(corners.len().div_ceil(MOST_PLACES)).copied().collect();
    // Of equals the last is told: the middle of the largest.
    let mut pieces: Vec<Region> =
        region.pieces.iter().map(|piece| Region { pieces: vec![piece.clone()] }).collect();
    pieces.sort_by(|a, b| a.area().total_cmp(&b.area()));
    for piece in &pieces[pieces.len().saturating_sub(MOST_PIECES)..] {
        places.extend(piece.largest_disc(MIDDLE, monitor)?.map(|disc| disc.0));
    }
    let all: Vec<u32> = (0..path.len() as u32).collect();
    let envelope = Envelope::new(cutters.clone(), path);
    let over = |envelope: &Envelope, q: &Point2| {
        let cut = envelope.lowest(q.x, q.y, &all).map_or(f64::INFINITY, |lowest| lowest.0);
        (cut.min(stock(q)) + pocket.depth).max(0.0)
    };
    let heights = work::parallel::try_map(places.len(), |k| {
        monitor::check(monitor)?;
        Ok(over(&envelope, &places[k]))
    })?;
    let highest = heights.iter().zip(&places).max_by(|a, b| a.0.total_cmp(b.0));
    if let Some((&height, at)) = highest {
        // A tool that strays cuts no more than a larger one on the path.
        let strays = path.origin.strays;
        let at_least = if strays > 0.0 {
            grown(cutters, strays)
                .map_or(0.0, |(cutters, below)| (over(&Envelope::new(cutters, path), at) - below).max(0.0))
        } else {
            height
        };
        found = OutOfReach { height, at_least, at: Some(*at), ..found };
    }
    Ok(found)
}

/// Cutters that are larger on all sides by a distance, mm, and how far the tip of one is lower at most;
/// `None` where one grows beyond the size of cutters.
fn grown(cutters: &Cutters, by: f64) -> Option<(Cutters, f64)> {
    let mut all: Option<Cutters> = None;
    let mut most = 0.0f64;
    for (first, cutter) in cutters.each() {
        let (cutter, below) = cutter.grown(by).ok()?;
        most = most.max(below);
        all = Some(match all {
            None => cutter.into(),
            Some(before) => before.then(first, cutter),
        });
    }
    all.map(|all| (all, most))
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
