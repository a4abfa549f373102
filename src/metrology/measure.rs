//! The figures of a cut on heights: the stock's own grid first, then a closer look where something may hide.
//! mm.

use super::beside_border::Borders;
use super::coverage::STEEP;
use super::creases::Creases;
use super::cut_surface::CutSurface;
use super::every_move::EveryMove;
use super::excess::ExcessSearch;
use super::facing::LEAST_FACING;
use super::figures::{
    CloserLook, ExcessFigures, ExcessKind, Limits, Measurement, NUMERICAL_FLOOR, ScallopFigures, UncutFigures,
};
use super::inspected::inspect;
use super::inspection::Inspection;
use super::measured_stock::{MeasureError, check_lengths, check_stock};
use super::meetings::Meetings;
use super::pairs::pair_figures;
use super::refine::{Asked, Refinement, open_bounds};
use super::ridge_map::borders;
use super::ridges::{Ridges, scallop_figures};
use super::tracks::Tracks;
use super::walls::{WallTask, Walls};
use super::{Facing, REACH_OVER_UNCUT};
use cutter::Cutter;
use geometry::{Aabb, Point3, Vector3};
use motion::{Cutters, Toolpath};
use part::Part;
use sim::{CutError, Envelope, ZMap};
use work::monitor::Monitor;

/// Measures `cut`, the stock after `path`, against `part`, looking closer until the error bounds of the
/// greatest scallop, gouge and uncut height are the asked ones. Where they do not come down to that, a note
/// in [`Measurement::refined`] says so.
///
/// The tool must be upright all along `path`, and `cut` must be what [`sim::cut`] left along this path with
/// this cutter, of stock that lies over all of the part.
///
/// # Errors
/// [`MeasureError`] where that is not so, where [`Asked::error_bound`] or [`Limits::chord`] is no length above
/// 0, or when the monitor says so.
pub fn measure(
    part: &Part,
    cutter: &Cutter,
    path: &Toolpath,
    cut: &ZMap,
    limits: &Limits,
    asked: &Asked,
    monitor: &dyn Monitor,
) -> Result<Measurement, MeasureError> {
    check_lengths(limits, asked)?;
    path.check_upright()?;
    check_stock(part, cutter, path, cut, monitor)?;
    Ok(measure_with_walls(part, &cutter.into(), path, cut, limits, asked, None, monitor)?)
}

/// As [`measure`], each move by its own cutter, and the part's vertical walls too, as far as they are walls
/// to the path. Path and stock are not checked: an engine has just cut the one along the other.
///
/// # Errors
/// [`CutError::Cancelled`] when the monitor says so.
pub(crate) fn measure_with_walls(
    part: &Part,
    cutters: &Cutters,
    path: &Toolpath,
    cut: &ZMap,
    limits: &Limits,
    asked: &Asked,
    facing: Option<&Facing<'_>>,
    monitor: &dyn Monitor,
) -> Result<Measurement, CutError> {
    let surface = CutSurface::new(Envelope::new(cutters, path), cut, path);
    let bound = asked.error_bound;
    let grid = cut.grid;
    let walls = walls_of(part, cutters, path, (&surface, limits, bound), facing, monitor)?;
    let every_move = EveryMove::new(&surface, cutters, &up_to(part, cut.top));
    let creases = Creases::new(part);
    let edges = asked.border_cuts.then(|| Borders::new(part, cutters));
    let inspection = Inspection {
        part,
        cutters,
        limits,
        asked: bound,
        allowed_depth: asked.allowed_depth,
        most_squares: asked.most_squares,
        is_first_look: asked.is_first_look,
        surface: &surface,
        meetings: &Meetings::new(&surface, cutters, path, None),
        grid,
        creases: Some(&creases),
        borders: edges.as_ref(),
        walls: walls.as_ref(),
        steepest: if asked.steep_elsewhere { STEEP } else { LEAST_FACING },
        every_move: Some(&every_move),
    };
    let mut found = inspect(&inspection, path, 0.0, monitor)?;
    let highest_ridge = found.ridges.highest_sample();
    let mut deviation_map: Vec<f32> = found.samples.iter().map(|s| s.deviation).collect();
    found.counted.iter().for_each(|(k, counted)| deviation_map[*k] = *counted);
    let hidden = found.ridges.hidden.clone();
    let pairs = pair_figures(part, cutters, path, std::mem::take(&mut found.ridges.pairs), monitor)?;
    let mut above = std::mem::take(&mut found.ridges.above);
    above.extend(
        borders(&inspection, &found.samples).into_iter().filter(|place| place.height > limits.scallop),
    );
    let mut measured = Measurement {
        above,
        scallop: scallop_figures(&found.ridges.samples, found.highest, limits),
        gouge: found.gouge,
        uncut: found.uncut,
        excess: ExcessFigures::default(),
        deviation: found.deviation,
        ridge_samples: std::mem::take(&mut found.ridges.samples),
        pairs,
        deviation_map,
        refined: CloserLook::default(),
    };
    let hiding = inspection.raise_by_moves(path, &found.samples, &mut measured.gouge, monitor)?;
    let refinement = Refinement { coarse: &inspection, path, asked, highest_ridge };
    measured.refined = refinement.run(&hidden, &hiding, &mut measured, monitor)?;
    inspection.cut_borders(&found.samples, &mut measured.gouge, monitor)?;
    let was_doubted = doubt(&mut measured, part, &every_move, bound);
    let search = ExcessSearch { inspection: &inspection };
    let (excess, high) = search.run(&found.samples, &measured, monitor)?;
    measured.excess = excess;
    measured.above.extend(high);
    drop_disproved_ridges(&mut measured, &found.ridges);
    raise_highest_ridge(&mut measured, &inspection, path);
    let highest = measured.excess.highest.max_mm;
    measured.deviation.max_mm = measured.deviation.max_mm.map(|max| max.max(highest));
    tell_uncut(&mut measured, limits);
    // The search between cells may have closed what cells left open.
    if measured.refined.note.is_some() {
        measured.refined.note = open_bounds(&measured, bound, cut.grid.cell);
    }
    tell_doubt(&mut measured, was_doubted);
    if let Some(walls) = &walls {
        walls.add_to(&mut measured, limits);
    }
    Ok(measured)
}

/// The vertical walls of a part, where they are asked for, with the error bound that is asked for, mm.
pub(super) fn walls_of(
    part: &Part,
    cutters: &Cutters,
    path: &Toolpath,
    (surface, limits, asked): (&CutSurface<'_>, &Limits, f64),
    facing: Option<&Facing<'_>>,
    monitor: &dyn Monitor,
) -> Result<Option<Walls>, CutError> {
    let Some(facing) = facing else { return Ok(None) };
    let (envelope, grid) = (&surface.envelope, surface.cut.grid);
    let reach = (REACH_OVER_UNCUT * limits.uncut).max(cutters.greatest_radius());
    let task = WallTask { part, cutters, path, envelope, grid, facing, limits, reach, asked };
    Ok(Walls::measure(&task, monitor)?)
}

/// The box around a part, up to the stock's top.
pub(super) fn up_to(part: &Part, stock_top: f64) -> Aabb {
    let mut around = part.bounds();
    around.max.z = around.max.z.max(stock_top);
    around
}

/// Leaves ridges out that stand above the highest material: moves that no cell saw cut them away. The others
/// stand no higher than it.
fn drop_disproved_ridges(measured: &mut Measurement, ridges: &Ridges) {
    let (highest, scallop) = (measured.excess.highest.at_most(), &mut measured.scallop);
    if scallop.max_mm.is_some_and(|ridge| ridge > highest) {
        measured.ridge_samples.retain(|[height, _]| f64::from(*height) <= highest);
        let known = |figure: Option<f64>| figure.filter(|height| *height <= highest);
        let next = ridges.highest_up_to(highest);
        *scallop = ScallopFigures {
            max_mm: next.map(|(height, _)| height),
            max_at_mm: next.map(|(_, at)| at.into()),
            error_bound_mm: next.map(|(height, _)| highest - height + NUMERICAL_FLOOR),
            p95_mm: known(scallop.p95_mm),
            p50_mm: known(scallop.p50_mm),
            mean_mm: known(scallop.mean_mm),
            over_target_fraction: (highest <= scallop.target_mm).then_some(0.0),
            ..std::mem::take(scallop)
        };
        let known =
            [scallop.max_mm, scallop.p95_mm, scallop.p50_mm, scallop.mean_mm, scallop.over_target_fraction];
        if known.contains(&None) {
            scallop.reason = Some("cells are too coarse to tell the ridges apart".into());
        }
    }
    let most = (highest - scallop.max_mm.unwrap_or(0.0)).max(NUMERICAL_FLOOR);
    scallop.error_bound_mm = scallop.error_bound_mm.map(|bound| bound.min(most));
}

/// The highest uncut place is the highest material that passes did not come down to, where that is higher
/// than what cells show, or where moves that no cell saw cut away what they show.
fn tell_uncut(measured: &mut Measurement, limits: &Limits) {
    let (unreached, uncut) = (measured.excess.unreached, &mut measured.uncut);
    let (shown, most) = (uncut.max_height_mm, unreached.at_most());
    let is_disproved = shown > most || shown > 0.0 && uncut.error_bound_mm >= shown;
    if is_disproved && most <= limits.uncut {
        *uncut = UncutFigures { error_bound_mm: NUMERICAL_FLOOR, ..UncutFigures::default() };
    } else if is_disproved || unreached.max_mm > shown {
        (uncut.max_height_mm, uncut.error_bound_mm) = (unreached.max_mm, unreached.error_bound_mm);
        uncut.regions.iter_mut().for_each(|region| region.height_mm = region.height_mm.min(unreached.max_mm));
        if let Some((first, at)) = uncut.regions.first_mut().zip(unreached.at_mm) {
            (first.height_mm, first.at_mm) = (unreached.max_mm, at);
        }
    }
}

/// The highest place that passes reached is the highest ridge, where two passes leave equally much: ridges
/// are measured on the grid's lines, and rise between them.
fn raise_highest_ridge(measured: &mut Measurement, inspection: &Inspection<'_>, path: &Toolpath) {
    /// Two passes leave equally much where their heights differ by no more than this share of it.
    const EQUAL: f64 = 0.05;
    let Inspection { part, cutters, surface, .. } = *inspection;
    let (reached, scallop) = (measured.excess.reached, &mut measured.scallop);
    let place = reached.at_mm.filter(|_| reached.max_mm > scallop.max_mm.unwrap_or(NUMERICAL_FLOOR));
    let Some(design) = place.and_then(|[x, y, _]| part.highest_at(x, y)) else { return };
    let top = design.point + design.normal * reached.max_mm;
    let all: Vec<u32> = (0..path.len() as u32).collect();
    let Some((z, by)) = surface.envelope.lowest(top.x, top.y, &all) else { return };
    let tracks = Tracks::new(path, cutters);
    let other = |&k: &u32| {
        let equal = |height: f64| height - z <= EQUAL * reached.max_mm;
        tracks.apart(by, k) && surface.envelope.height(k, top.x, top.y).is_some_and(equal)
    };
    if !all.iter().any(other) {
        return;
    }
    (scallop.max_mm, scallop.max_at_mm) = (Some(reached.max_mm), Some(top.into()));
    scallop.error_bound_mm = Some(reached.error_bound_mm);
    if scallop.p95_mm.is_none() {
        scallop.reason = Some("cells are too coarse for any but the highest".into());
    }
    if measured.excess.kind == ExcessKind::Border {
        measured.excess.kind = ExcessKind::Scallop;
    }
}

/// Where a move that no cell saw cuts the highest uncut place away, the figure is too great by an unknown
/// amount: its bound becomes the figure itself. Whether that is so.
fn doubt(measured: &mut Measurement, part: &Part, every_move: &EveryMove<'_>, asked: f64) -> bool {
    let uncut = &mut measured.uncut;
    let cut_away = |at: &Point3| every_move.cuts_away(&(at - Vector3::z() * asked)).is_some();
    let highest = uncut.regions.first().and_then(|r| Some((r, part.highest_at(r.at_mm[0], r.at_mm[1])?)));
    let is_doubted =
        highest.is_some_and(|(r, design)| cut_away(&(design.point + design.normal * r.height_mm)));
    if is_doubted {
        uncut.error_bound_mm = uncut.error_bound_mm.max(uncut.max_height_mm);
    }
    is_doubted
}

/// Says so where nothing else told the figure that was doubted.
fn tell_doubt(measured: &mut Measurement, was_doubted: bool) {
    let uncut = &measured.uncut;
    if was_doubted && uncut.max_height_mm > 0.0 && uncut.error_bound_mm >= uncut.max_height_mm {
        measured.refined.note = Some(
            "moves between the centres of cells cut lower than what was measured there; passes so close need a \
             cell of a third of their distance"
                .into(),
        );
    }
}
