//! How closely the loop looks at a plan: at its ridges on coarse cells, or at all that it leaves.

use metrology::{Engine, EngineError, Measured, Measurement, RidgeMap, Simulation, Task};
use motion::Toolpath;
use report::Verdict;
use scene::ToolpathRequest;
use toolpath::{plane_interval, unused_tolerance};
use work::monitor::Monitor;

use super::standing::Wanted;
use crate::covered::Covered;
use crate::earlier::{EarlierPath, WholePath};
use crate::measuring::{Closeness, MeasuredClosely};
use crate::planned::Planned;
use crate::tool::ToolMoves;
use crate::{JobError, Session, judge};

/// Cells from pass to pass while only ridges are measured.
const CELLS_A_PASS: f64 = 4.0;

/// A path whose whole surface was measured.
pub(crate) struct Looked {
    pub measured: Measured,
    /// Whether a closer look would change no verdict.
    pub(super) is_as_verdict: bool,
    /// What that covers, where [`Session::look`] asks for it.
    pub covered: Option<Covered>,
    /// Whether what no cell sees was left out.
    pub(super) of_cells_alone: bool,
}

impl Looked {
    /// What no cell sees, where it is that of the verdict, and the cell beside which it was measured, mm.
    pub(super) fn beside_cells(self) -> Option<(Covered, f64)> {
        self.covered.filter(|_| self.is_as_verdict).map(|covered| (covered, self.measured.cell))
    }

    /// What stands where no cell sees, as far as it was cut.
    pub(super) fn unseen(&self) -> Option<&Measurement> {
        let unseen = self.covered.as_ref()?.unseen.as_ref()?;
        (!unseen.never_cut).then_some(&unseen.measurement)
    }

    /// Whether a place that no cell sees was never cut.
    pub(super) fn is_never_cut(&self) -> bool {
        let unseen = self.covered.as_ref().and_then(|covered| covered.unseen.as_ref());
        unseen.is_some_and(|unseen| unseen.never_cut)
    }
}

impl Session {
    /// How much deeper moves may go, mm: chords leave that of their tolerance, and the gouge tolerance has to
    /// leave it as well, with what arcs may lead the tool astray, and what meshes are off their files.
    pub(super) fn room(&self, request: &ToolpathRequest) -> f64 {
        let (tolerance, strays) = (&self.scene.tolerance, self.scene.arcs.unwrap_or(0.0) + self.moved());
        let (chord, is_smoothed) = (tolerance.chord, request.joining.smoothing);
        let unused = unused_tolerance(chord, is_smoothed);
        unused.min(tolerance.gouge - (chord - unused) - strays)
    }

    pub(super) fn wanted(&self, request: &ToolpathRequest, target: f64, behind_others: bool) -> Wanted<'_> {
        // A toolpath for the rest takes what deeper moves do not: what no path of this cutter reaches most of all.
        let highest = if self.rest_follows(request) { target + self.room(request) } else { f64::INFINITY };
        Wanted { part: &self.part, target, highest, behind_others }
    }

    /// Measures the whole surface that a path leaves behind `earlier` ones, where no cell sees as well unless
    /// the rest fails for certain.
    pub(crate) fn look(
        &self,
        request: &ToolpathRequest,
        earlier: &[EarlierPath],
        engine: &dyn Engine,
        path: &Toolpath,
        closeness: Closeness,
        monitor: &dyn Monitor,
    ) -> Result<Looked, JobError> {
        let mut looked = self.look_at_cells(request, earlier, engine, path, closeness, monitor)?;
        self.look_beside_unless_failed(request, earlier, path, &mut looked, monitor)?;
        Ok(looked)
    }

    /// Measures where no cell sees as well, unless what cells see fails for certain.
    pub(super) fn look_beside_unless_failed(
        &self,
        request: &ToolpathRequest,
        earlier: &[EarlierPath],
        path: &Toolpath,
        looked: &mut Looked,
        monitor: &dyn Monitor,
    ) -> Result<(), JobError> {
        let fails = self.verdict_on(&looked.measured) == Verdict::Fail;
        if fails { Ok(()) } else { self.look_beside_cells(request, earlier, path, looked, monitor) }
    }

    /// As [`Session::look`], without what no cell sees.
    pub(super) fn look_at_cells(
        &self,
        request: &ToolpathRequest,
        earlier: &[EarlierPath],
        engine: &dyn Engine,
        path: &Toolpath,
        closeness: Closeness,
        monitor: &dyn Monitor,
    ) -> Result<Looked, JobError> {
        monitor.start("measuring a plan", 0);
        let (cutters, _) = self.tools(request);
        let whole = WholePath::new(earlier, path, &cutters, self.scene.machine.rapid_rate);
        let all = (&*whole.path, &whole.cutters);
        let MeasuredClosely { measured, is_as_verdict } =
            self.measure_closely(request, engine, all, closeness, monitor)?;
        Ok(Looked { measured, is_as_verdict, covered: None, of_cells_alone: self.pocket.is_none() })
    }

    /// Measures where no cell sees as well, unless that was done.
    pub(super) fn look_beside_cells(
        &self,
        request: &ToolpathRequest,
        earlier: &[EarlierPath],
        path: &Toolpath,
        looked: &mut Looked,
        monitor: &dyn Monitor,
    ) -> Result<(), JobError> {
        if !looked.of_cells_alone {
            return Ok(());
        }
        monitor.start("measuring the coverage", 0);
        let (cutters, holders) = self.tools(request);
        let whole = WholePath::new(earlier, path, &cutters, self.scene.machine.rapid_rate);
        let (all, own) = ((&*whole.path, &whole.cutters), ToolMoves::of(&cutters, &holders, path));
        let tools = whole.tools(earlier, &own);
        looked.covered = Some(self.covered(request, &looked.measured, all, &tools, monitor)?);
        looked.of_cells_alone = false;
        Ok(())
    }

    /// The ridges that a plan leaves; `None` where finding them takes as long as measuring all, or coarse
    /// cells cannot tell.
    pub(super) fn ridges(
        &self,
        request: &ToolpathRequest,
        engine: &dyn Engine,
        planned: &Planned,
        monitor: &dyn Monitor,
    ) -> Result<Option<RidgeMap>, JobError> {
        monitor.start("measuring the ridges of a plan", 0);
        let mut found = None;
        // Where faces are steep, passes lie nearer to each other in the plan view.
        for share in if engine.gains_by_cells() { &[1.0, 0.5][..] } else { &[1.0] } {
            let ridges = |task: &Task<'_>| engine.ridges(task, monitor);
            found = self.on_share_cells(request, planned, share / CELLS_A_PASS, ridges)?;
            if found.is_some() {
                break;
            }
        }
        Ok(found)
    }

    /// Cells that are just fine enough to show every pass of a plan on level ground.
    pub(super) fn on_coarse_cells<T>(
        &self,
        request: &ToolpathRequest,
        planned: &Planned,
        of_task: impl FnOnce(&Task<'_>) -> Result<T, EngineError>,
    ) -> Result<T, JobError> {
        self.on_share_cells(request, planned, 1.0 / CELLS_A_PASS, of_task)
    }

    /// Cells of a share of the interval of passes on level ground.
    fn on_share_cells<T>(
        &self,
        request: &ToolpathRequest,
        planned: &Planned,
        share: f64,
        of_task: impl FnOnce(&Task<'_>) -> Result<T, EngineError>,
    ) -> Result<T, JobError> {
        let scene = &self.scene;
        let cell = share * plane_interval(&request.tooling.cutter, request.step);
        let simulation = Simulation { cell, cell_is_auto: true, ..scene.simulation };
        let cells =
            self.budget().grid_before_planning(&self.area(), &simulation).map_err(JobError::grid(scene))?;
        let (cutters, _) = self.tools(request);
        let task = self.task(request, (&planned.plan.path, &cutters), &simulation, &cells);
        of_task(&task).map_err(|reason| JobError::engine(scene, &request.name, reason))
    }

    /// Whether moves of a toolpath can go deeper beside places that stand a little too high. Those of a tool
    /// that leans cannot, and where a toolpath is for some places others may have left what stands.
    pub(super) fn may_lower(&self, request: &ToolpathRequest) -> bool {
        request.correct && request.axis.is_none() && self.pocket.is_none() && !request.is_for_places()
    }

    /// Whether a toolpath is planned as if chords raised nothing. The gouge tolerance has to leave moves the
    /// room for it; and where all has to be measured to find such places, passes that leave none take less
    /// time.
    pub(crate) fn is_lowered_later(&self, request: &ToolpathRequest) -> bool {
        let tolerance = &self.scene.tolerance;
        self.may_lower(request)
            && tolerance.gouge >= tolerance.chord
            && self.scene.simulation.engine.for_path(request.tilts()).finds_ridges()
    }

    /// Whether all of the surface that was measured passes, where no cell sees as well.
    pub(super) fn passes(&self, looked: &Looked) -> bool {
        let (limits, rule) = (&self.scene.tolerance, &self.scene.scallop_rule);
        let unseen = looked.covered.as_ref().and_then(|covered| covered.unseen.as_ref());
        self.verdict_on(&looked.measured) == Verdict::Pass
            && unseen
                .is_none_or(|unseen| judge::of_surface(&unseen.measurement, limits, rule) == Verdict::Pass)
    }
}
