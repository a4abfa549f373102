//! The surface that a measurement covers, and the share of it that no cell sees, measured along its normals.

use cutter::Solid;
use geometry::Vector3;
use metrology::{
    AlongNormal as _, AlongTask, CellsSeen, Coverage, CoverageFigures, Measured, Measurement,
    REACH_OVER_UNCUT, RaysCut, RaysCutInTurn, RidgePlace, SweptVolume, UnseenSurface, View,
};
use motion::{Cutters, Toolpath};
use report::Verdict;
use scene::ToolpathRequest;
use toolpath::Pocket;
use work::monitor::Monitor;

use super::tool::ToolMoves;
use super::{JobError, Session, judge};

/// Where a limit is undecided on surface that no cell sees, it is measured again by places half as far apart,
/// so often. Each time takes up to four times as long.
const MOST_HALVINGS: i32 = 2;

/// The error bound that is asked for is smaller by this each time.
const SMALLER: f64 = 0.25;

/// What a measurement covers.
#[derive(Debug)]
pub(crate) struct Covered {
    /// The areas.
    pub areas: CoverageFigures,
    /// What was found where cells cut and something is judged that they do not see.
    pub unseen: Option<Unseen>,
}

/// What was found along the normals of surface that no cell sees.
#[derive(Debug)]
pub(crate) struct Unseen {
    /// The figures.
    pub measurement: Measurement,
    /// Distance of the places, mm.
    pub spacing_mm: f64,
    /// Whether a place was never cut: material then stands at least as high as is looked.
    pub never_cut: bool,
    /// The places over which more stands than the scallop tolerance, with how much at least, and their outward
    /// unit normals.
    pub above: Vec<(RidgePlace, Vector3)>,
}

impl Session {
    /// What the measurement of a pocket covers: its floor by cells, its walls by the moves.
    pub(crate) fn pocket_covered(&self, pocket: &Pocket, cutters: &Cutters) -> Covered {
        let cutter = cutters.first();
        let radius = cutter.radius();
        // Round corners leave a fillet at the foot.
        let upright = (pocket.depth - cutter.corner_radius()).max(0.0);
        let walls = [upright * pocket.reached_wall_length(radius), pocket.depth * pocket.wall_length()];
        let bound = pocket.depth * pocket.reached_wall_length_bound(radius) + pocket.floor_area_bound(radius);
        let mesh = self.part.mesh();
        let floor = |t: usize| {
            let [a, b, c] = mesh.corners(t);
            0.5 * (b - a).cross(&(c - a)).norm()
        };
        let floor = (0..mesh.triangles().len()).map(floor).sum();
        let areas =
            CoverageFigures::of_pocket(self.scene.judged, [floor, pocket.region.area()], walls, bound);
        Covered { areas, unseen: None }
    }

    /// What `measured`, the cut by `path` with the moves of all its `tools`, covers.
    pub(crate) fn covered(
        &self,
        request: &ToolpathRequest,
        measured: &Measured,
        (path, cutters): (&Toolpath, &Cutters),
        tools: &[ToolMoves<'_>],
        monitor: &dyn Monitor,
    ) -> Result<Covered, JobError> {
        let (scene, part) = (&self.scene, &self.part);
        let own = self.task(request, (path, cutters), &scene.simulation, &self.cells);
        let facing = own.facing();
        let View::Heights(cut) = &measured.view else {
            let areas = Coverage::new(part, &facing, scene.judged, None).figures();
            return Ok(Covered { areas, unseen: None });
        };
        let deviations = &measured.measurement.deviation_map;
        let cells = CellsSeen { grid: &cut.grid, deviations, walls: own.measures_walls() };
        let coverage = Coverage::new(part, &facing, scene.judged, Some(cells));
        let areas = coverage.figures();
        if areas.along_normals_mm2 == 0.0 {
            return Ok(Covered { areas, unseen: None });
        }
        // Holders end the cutters' edges.
        let solids: Vec<Solid> =
            tools.iter().map(|tool| Solid::of_cutter(tool.cutter, tool.holder)).collect();
        let paths: Vec<(&Toolpath, &Solid)> = tools.iter().map(|tool| &*tool.path).zip(&solids).collect();
        let rays = self
            .budget()
            .rays_of_each(&paths, Some(&cut.grid), monitor)
            .map_err(|reason| JobError::engine(scene, &request.name, reason))?;
        let of_tool = |k: usize| {
            let (path, solid) = paths[k];
            (tools[k].first, RaysCut { rays: &rays[k], path, solid })
        };
        let by_rays = RaysCutInTurn { tools: (0..rays.len()).map(of_tool).collect() };
        let inward = cutters.greatest_radius();
        let outward = (REACH_OVER_UNCUT * scene.tolerance.uncut).max(inward);
        let swept = SweptVolume {
            part,
            cut: &by_rays,
            inward,
            outward,
            shallow: scene.tolerance.shallow(),
            block: *facing.block(),
        };
        let mut task = AlongTask {
            cutters,
            path,
            cut: &swept,
            limits: &scene.tolerance,
            asked: scene.simulation.error_bound,
            finest: measured.cell,
            halvings: 0,
            // A toolpath for the rest goes by all that stands.
            leaves_the_rest: self.leaves_the_rest(request) && !self.rest_follows(request),
        };
        // What fails anyway is looked at no closer, nor is what another toolpath cuts off.
        let is_enough = task.leaves_the_rest || self.verdict_on(measured) == Verdict::Fail;
        let most = if is_enough { 0 } else { MOST_HALVINGS };
        loop {
            let found = coverage.measure_unseen(&task, monitor)?;
            let unseen = found.map(|UnseenSurface { measurement, spacing, above }| {
                let never_cut = measurement.uncut.max_height_mm >= swept.reach();
                Unseen { measurement, spacing_mm: spacing, never_cut, above }
            });
            let verdict = unseen
                .as_ref()
                .map(|unseen| judge::of_surface(&unseen.measurement, &scene.tolerance, &scene.scallop_rule));
            if task.halvings >= most || verdict != Some(Verdict::Undecided) {
                return Ok(Covered { areas, unseen });
            }
            task.halvings += 1;
            task.asked *= SMALLER;
        }
    }
}
