//! Engines along the normals of the design, for any cutter axis and any shape.

use std::time::Instant;

use cutter::Solid;
use geometry::{Aabb, Vector3};
use sim::{Rays, Stock, VoxelEngine, Voxels};
use work::monitor::Monitor;

use super::budget::MIB;
use super::{Budget, Engine, EngineError, Measured, NormalView, Task, View};
use crate::along_normals::ridges_along_normals;
use crate::coverage::area;
use crate::{
    FirstCut, RaysCut, RidgeMap, SweptVolume, VoxelCut, measure_along_normals, net_places, path_figures,
};

/// Bytes a place of the net: place, hit, triangles with their crossings, and the map; and the map of the
/// measurement before, which stays until this one is known to be better.
const BYTES_PER_PLACE: u64 = 800;

/// Distance of the places over that of cells where the program chooses: three places from pass to pass.
const PLACES_OVER_CELLS: f64 = 2.0;

/// Places from pass to pass while only ridges are measured: these are found between places.
const PLACES_A_PASS: f64 = 2.0;

/// Material is looked for this many uncut tolerances above the design, and no less far than the cutter's
/// radius; cuts as far below it as that radius, so that the far side of a thin part counts for nothing.
pub const REACH_OVER_UNCUT: f64 = 4.0;

/// By how much space for voxels is larger than it need be, mm: then none of its own surface is met.
const BEYOND: f64 = 1.0;

/// An engine along normals.
pub(super) struct Normals {
    word: &'static str,
    help: &'static str,
    by_voxels: bool,
}

/// The swept volume itself.
pub(super) const RAYS: Normals =
    Normals { word: "rays", help: "the swept volume along the normals; any cutter axis", by_voxels: false };

/// What is left as voxels.
pub(super) const VOXEL: Normals =
    Normals { word: "voxel", help: "voxels along the normals; any cutter axis", by_voxels: true };

impl Engine for Normals {
    fn word(&self) -> &'static str {
        self.word
    }

    fn help(&self) -> &'static str {
        self.help
    }

    fn tilts(&self) -> bool {
        true
    }

    fn measures_pockets(&self) -> bool {
        false
    }

    fn gains_by_cells(&self) -> bool {
        self.by_voxels
    }

    fn finds_ridges(&self) -> bool {
        // Voxels take longer than the places between them.
        !self.by_voxels
    }

    fn ridges(&self, task: &Task<'_>, monitor: &dyn Monitor) -> Result<Option<RidgeMap>, EngineError> {
        if !self.finds_ridges() {
            return Ok(None);
        }
        let spacing = ridge_spacing(task);
        let solid = Solid::of_cutter(task.cutters.first(), task.holder);
        // Measuring may still fit into the memory; where it does not, it says so.
        let budget = task.budget.without(Rays::bytes(task.path, &solid));
        if check_places(task, &budget, spacing).is_err() {
            return Ok(None);
        }
        let rays = match task.budget.rays(task.path, &solid, None, monitor) {
            Ok(rays) => rays,
            Err(EngineError::Cancelled(cancelled)) => return Err(cancelled.into()),
            Err(_) => return Ok(None),
        };
        let first = RaysCut { rays: &rays, path: task.path, solid: &solid };
        Ok(Some(ridges_along_normals(task, &swept_volume(task, &first), spacing, monitor)?))
    }

    fn measure(&self, task: &Task<'_>, monitor: &dyn Monitor) -> Result<Measured, EngineError> {
        let begun = Instant::now();
        let (part, path, cutter) = (task.part, task.path, task.cutters.first());
        let solid = Solid::of_cutter(cutter, task.holder);
        // Deviations are exact at the places, and ridges are found between them, so that fewer do than cells.
        let wider = if task.simulation.cell_is_auto { PLACES_OVER_CELLS } else { 1.0 };
        let spacing = wider * task.simulation.cell;
        let rays = task.budget.rays(path, &solid, None, monitor)?;
        let budget = task.budget.without(Rays::bytes(path, &solid));
        check_places(task, &budget, spacing)?;
        let space = space(task, outward(task));
        let voxels = self
            .by_voxels
            .then(|| cut_voxels(task, &budget, &space, &solid, spacing, monitor))
            .transpose()?;
        let by_rays = RaysCut { rays: &rays, path, solid: &solid };
        let by_voxels = voxels.as_ref().map(|(engine, voxels)| VoxelCut { engine, voxels });
        let first: &dyn FirstCut = by_voxels.as_ref().map_or(&by_rays, |cut| cut);
        let cut = swept_volume(task, first);
        let asked = task.simulation.error_bound;
        let facing = task.facing();
        let judged = Some((&facing, task.judged));
        let (measurement, map) =
            measure_along_normals(part, cutter, path, &cut, spacing, task.limits, asked, judged, monitor)?;
        let finest_cell = voxels.as_ref().map_or(spacing, |(_, voxels)| voxels.voxel());
        Ok(Measured {
            measurement,
            cell: spacing,
            cells: map.points.len(),
            refined_rectangles: 0,
            finest_cell,
            view: View::Normals(Box::new(NormalView { map, spacing, rays, solid })),
            wall_s: begun.elapsed().as_secs_f64(),
            note: None,
        })
    }
}

/// Distance of the places that show ridges, mm.
fn ridge_spacing(task: &Task<'_>) -> f64 {
    let widest = task.part.bounds().size().norm();
    task.simulation.cell.max((mean_interval(task) / PLACES_A_PASS).min(widest))
}

/// How many places show the ridges of a path: on a mesh each facet has its own.
pub(super) fn ridge_places(task: &Task<'_>) -> f64 {
    net_places(task.part, ridge_spacing(task))
}

/// The part's surface over the length that is cut, mm.
fn mean_interval(task: &Task<'_>) -> f64 {
    let mesh = task.part.mesh();
    let surface: f64 = (0..mesh.triangles().len()).map(|t| area(&mesh.corners(t))).sum();
    surface / path_figures(task.path, 0.0).cutting_length_mm.max(f64::MIN_POSITIVE)
}

/// How far above the design material is looked for, mm.
fn outward(task: &Task<'_>) -> f64 {
    (REACH_OVER_UNCUT * task.limits.uncut).max(task.cutters.first().radius())
}

fn swept_volume<'a>(task: &'a Task<'_>, cut: &'a dyn FirstCut) -> SweptVolume<'a> {
    let inward = task.cutters.first().radius();
    SweptVolume {
        part: task.part,
        cut,
        inward,
        outward: outward(task),
        shallow: task.limits.shallow(),
        block: task.block(),
    }
}

/// More than the part by `reach` all around, so that what a normal leaves is what was cut.
fn space(task: &Task<'_>, reach: f64) -> Stock {
    let Aabb { min, max } = task.part.bounds();
    let around = Vector3::repeat(reach + BEYOND);
    Stock::Box(Aabb { min: min - around, max: max + around })
}

/// What a path leaves of `space` where places `spacing` mm apart take their memory too.
fn cut_voxels<'a>(
    task: &Task<'_>,
    budget: &Budget,
    space: &'a Stock,
    solid: &Solid,
    spacing: f64,
    monitor: &dyn Monitor,
) -> Result<(VoxelEngine<'a>, Voxels), EngineError> {
    let voxel = task.simulation.voxel.unwrap_or(task.simulation.cell);
    let places = (net_places(task.part, spacing) * BYTES_PER_PLACE as f64) as u64;
    let left = budget.without(places).left(task.path.len());
    let engine = VoxelEngine::new(space, solid, task.path)?;
    let voxels = engine.cut(voxel, left, monitor)?;
    Ok((engine, voxels))
}

/// Refuses places that do not fit into the memory.
fn check_places(task: &Task<'_>, budget: &Budget, spacing: f64) -> Result<(), EngineError> {
    let moves = task.path.len();
    let needed = net_places(task.part, spacing) * BYTES_PER_PLACE as f64;
    let left = budget.left(moves) as f64;
    if needed <= left {
        return Ok(());
    }
    // Places grow as the square of what their distance shrinks; two digits, rounded up.
    let exact = spacing * (needed / left.max(1.0)).sqrt();
    let digit = 10f64.powf(exact.log10().floor() - 1.0);
    Err(EngineError::Places {
        spacing,
        needed_mib: (needed as u64 + budget.besides(moves)).div_ceil(MIB),
        allowed_mib: budget.memory_mib,
        fitting: (exact / digit).ceil() * digit,
    })
}
