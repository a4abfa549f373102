//! Measures the cut surface against the design part, never against a planner's own prediction.
//!
//! Enters: the part, the stock after a path, and the path. Leaves: signed deviation at a design
//! point above or below every cell centre, the heights of the scallop ridges, gouges and uncut
//! places as connected regions, and a bound of the error beside each figure. mm throughout.
//!
//! Deviation at a design point is the signed distance along its outward normal to the cut surface:
//! positive is excess, negative is gouge.

mod along_normals;
mod closer;
mod cut_surface;
mod engagement;
mod engines;
mod figures;
#[cfg(test)]
mod flat_scene;
mod inspection;
mod meetings;
mod offset_distance;
mod pairs;
mod path;
mod pocket;
mod refine;
mod regions;
mod removal;
mod ridges;
mod roughness;
mod sections;
mod tracks;
mod unseen;

pub use along_normals::{
    AlongNormal, FirstCut, NormalHit, NormalMap, PatchGrid, RaysCut, SweptVolume, VoxelCut,
    measure_along_normals, net_places,
};
pub use cut_surface::CutSurface;
pub use engagement::{ContactArcs, contact_arcs};
pub use engines::{
    Budget, ENGINES, Engine, EngineChoice, EngineError, LaidOut, MIB, Measured, REACH_OVER_UNCUT, Simulation,
    Task, View,
};
pub use figures::{
    DeviationFigures, GougeFigures, GougeRegion, Limits, Measurement, PathFigures, ScallopFigures,
    UncutFigures, UncutRegion,
};
pub use meetings::Meetings;
pub use offset_distance::{
    OffsetDistance, OffsetFigures, OffsetPoints, SingularPlaceFigures, measure_offset, offset_figures,
};
pub use pairs::{MOST_PAIRS, PAIRS_HEADER, PairFigures, ScallopPair};
pub use path::path_figures;
pub use pocket::{PocketFigures, wall_gouge_of_cells, wall_gouge_of_moves};
pub use refine::{Asked, Refined};
pub use removal::{RapidContactFigures, RemovalFigures, removal_figures, voxel_removal_figures};
pub use roughness::{RoughnessFigures, roughness};
pub use sections::{SectionFigures, section_figures};

use cutter::Cutter;
use geometry::Point3;
use inspection::Inspection;
use motion::Toolpath;
use part::Part;
use refine::Refinement;
use ridges::{Highest, RidgeFinder, Ridges, scallop_figures};
use sim::{Envelope, ZMap};
use unseen::unseen_depth;
use work::monitor::{Cancelled, Monitor};

/// The least vertical part of the design's normal that dips between centres are thought of with.
const LEAST_LEAN: f64 = 0.2;

/// Measures `cut`, the stock after `path`, against `part`, looking closer until the error bounds of the
/// greatest scallop, gouge and uncut height are the asked ones. Where they do not come down to that, a note
/// in [`Measurement::refined`] says so.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub fn measure(
    part: &Part,
    cutter: &Cutter,
    path: &Toolpath,
    cut: &ZMap,
    limits: &Limits,
    asked: &Asked,
    monitor: &dyn Monitor,
) -> Result<Measurement, Cancelled> {
    let surface = CutSurface::new(Envelope::new(cutter, path), cut, path);
    let bound = asked.error_bound;
    let inspection = Inspection { part, cutter, limits, asked: bound, surface: &surface, grid: cut.grid };
    let mut found = inspect(&inspection, path, 0.0, monitor)?;
    let highest_ridge = found.ridges.highest_sample();
    let lean = found.least_lean;
    let hidden = found.ridges.hidden.clone();
    let pairs = pairs::pair_figures(part, cutter, path, std::mem::take(&mut found.ridges.pairs), monitor)?;
    let mut measured = Measurement {
        scallop: scallop_figures(&found.ridges.samples, found.highest, limits),
        gouge: found.gouge,
        uncut: found.uncut,
        deviation: found.deviation,
        ridge_samples: found.ridges.samples,
        pairs,
        deviation_map: found.deviation_map,
        refined: Refined::default(),
    };
    let mut dips = Vec::new();
    if unseen_depth(cutter, cut.grid.cell, lean.max(LEAST_LEAN)) > bound {
        let known = measured.gouge.max_depth_mm + bound;
        dips = unseen::dips(part, cutter, path, cut.grid.cell, known, monitor)?;
    }
    let refinement = Refinement { coarse: &inspection, path, asked, highest_ridge };
    measured.refined = refinement.run(&hidden, &dips, &mut measured, monitor)?;
    doubt(&mut measured, &surface, part, path, asked);
    Ok(measured)
}

/// Where a move that no cell saw cuts the highest scallop or uncut place away, the figure is too great by
/// an unknown amount: its bound becomes the figure itself. All moves are asked at the two places.
fn doubt(measured: &mut Measurement, surface: &CutSurface<'_>, part: &Part, path: &Toolpath, asked: &Asked) {
    let all: Vec<u32> = (0..path.len() as u32).collect();
    let cut_away = |at: &Point3| {
        surface.envelope.lowest(at.x, at.y, &all).is_some_and(|(z, _)| z < at.z - asked.error_bound)
    };
    let (scallop, uncut) = (&mut measured.scallop, &mut measured.uncut);
    let mut doubtful = false;
    if scallop.max_at_mm.is_some_and(|at| cut_away(&at.into())) {
        scallop.error_bound_mm = scallop.error_bound_mm.zip(scallop.max_mm).map(|(b, m)| b.max(m));
        doubtful = true;
    }
    let highest = uncut.regions.first().and_then(|r| Some((r, part.highest_at(r.at_mm[0], r.at_mm[1])?)));
    if highest.is_some_and(|(r, design)| cut_away(&(design.point + design.normal * r.height_mm))) {
        uncut.error_bound_mm = uncut.error_bound_mm.max(uncut.max_height_mm);
        doubtful = true;
    }
    if doubtful {
        measured.refined.note = Some(
            "moves between the centres of cells cut lower than what was measured there; passes so close need a \
             cell of a third of their distance"
                .into(),
        );
    }
}

/// What one grid shows.
struct Inspected {
    deviation: DeviationFigures,
    /// `[ny][nx]`, mm; NaN off the part.
    deviation_map: Vec<f32>,
    ridges: Ridges,
    highest: Option<Highest>,
    gouge: GougeFigures,
    uncut: UncutFigures,
    /// Least vertical part of the design's normal.
    least_lean: f64,
}

/// Inspects one grid; `highest_ridge` is that of the surroundings, mm.
fn inspect(
    inspection: &Inspection<'_>,
    path: &Toolpath,
    highest_ridge: f64,
    monitor: &dyn Monitor,
) -> Result<Inspected, Cancelled> {
    let samples = inspection.samples(monitor)?;
    let finder =
        RidgeFinder::new(inspection.surface, inspection.part, inspection.cutter, path, inspection.limits);
    let ridges = finder.find(&|k| samples[k].deviation, monitor)?;
    let deviation = inspection.deviation_figures(&samples);
    let highest_ridge = highest_ridge.max(ridges.highest_sample());
    Ok(Inspected {
        highest: finder.highest(&ridges, inspection.asked),
        ridges,
        gouge: inspection.gouges(&samples),
        uncut: inspection.uncut(&samples, highest_ridge, deviation.area_mm2),
        deviation,
        least_lean: samples.iter().map(|s| f64::from(s.lean)).fold(1.0, f64::min),
        deviation_map: samples.into_iter().map(|s| s.deviation).collect(),
    })
}
