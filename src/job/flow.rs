//! The flow of a job: every toolpath of a scene is planned, cut, measured and judged.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;
use std::sync::Arc;

use geometry::Vector3;
use io::digest;
use metrology::{Engine, Measured, Measurement, ScallopFigures};
use motion::Toolpath;
use report::{
    Claim, ExcessReport, NotPlanned, RunReport, SimulationFigures, ToleranceFigures, ToolpathReport,
    ToolpathResult, Verdict,
};
use scene::ToolpathRequest;
use work::monitor::{self, Monitor};

use super::correction::Looked;
use super::earlier::{EarlierPath, WholePath, left_over};
use super::gouge_moves::{self, OwnMoves};
use super::measuring::Closeness;
use super::planned::Planned;
use super::run::Run;
use super::tool::{Around, Tool, ToolMoves};
use super::{JobError, Machined, Outcome, Session, figures, judge};

impl Session {
    /// Runs all toolpaths. Maps, paths and meshes are dropped; [`Session::toolpath`] leaves them. One that
    /// cannot be planned is a row with its reason, and fails the run.
    ///
    /// # Errors
    /// [`JobError`] of the first toolpath that cannot be run, or if none could be planned, with the reason of
    /// each.
    pub fn run(&self, monitor: &dyn Monitor) -> Result<RunReport, JobError> {
        self.run_each(monitor, &mut |_| Ok::<(), JobError>(()))
    }

    /// As [`Session::run`]; hands over what each toolpath left.
    ///
    /// # Errors
    /// Those of [`Session::run`] and of `done`.
    pub fn run_each<E: From<JobError>>(
        &self,
        monitor: &dyn Monitor,
        done: &mut dyn FnMut(&Outcome) -> Result<(), E>,
    ) -> Result<RunReport, E> {
        // The engine and the solid are those of the whole scene; an axis is the toolpath's own, which is a row.
        let mut upright = self.scene.toolpaths.iter().filter(|request| !request.tilts());
        upright.try_for_each(|request| self.refuse_behind_others(request))?;
        let (mut rows, mut refused, mut left) = (Vec::new(), Vec::new(), Vec::new());
        let (mut seen, mut earlier) = (Vec::new(), Some(Vec::new()));
        for request in &self.scene.toolpaths {
            monitor.belongs_to(&request.name);
            if !request.stock_is_previous {
                earlier = Some(Vec::new());
            }
            let outcome = match &earlier {
                Some(earlier) => self.toolpath_after(earlier, request, monitor),
                None => {
                    Err(self.not_applicable(request, "the toolpath before it could not be planned".into()))
                }
            };
            match outcome {
                Ok(mut outcome) => {
                    note_same_path(&mut seen, &mut outcome);
                    done(&outcome)?;
                    if let Some(earlier) = earlier.as_mut().filter(|_| self.goes_on(request)) {
                        earlier.push(EarlierPath::of(&outcome));
                    }
                    if request.stock_is_previous {
                        answers_later(rows.last_mut(), &left, &request.name);
                    }
                    left = outcome.left;
                    rows.push(ToolpathReport::Measured(Box::new(outcome.result)));
                }
                Err(error) => {
                    let Some(reason) = error.why_not_planned() else { return Err(error.into()) };
                    earlier = None;
                    if request.stock_is_previous {
                        answers_itself(rows.last_mut(), &mut left);
                    }
                    rows.push(not_planned(request, reason));
                    refused.push((request.name.clone(), error));
                }
            }
        }
        if refused.is_empty() || rows.iter().any(|row| row.measured().is_some()) {
            return Ok(self.report(rows));
        }
        Err(JobError::of_all(&self.scene, refused).into())
    }

    /// The report of the scene's toolpaths.
    fn report(&self, toolpaths: Vec<ToolpathReport>) -> RunReport {
        let source = &self.scene.source;
        let name = Path::new(&source.name).file_name();
        let name = name.map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let title = self.scene.title.clone();
        let tolerance = ToleranceFigures::new(&self.scene.tolerance, &self.scene.scallop_rule);
        let sha256 = digest::of_bytes(source.text.as_bytes()).sha256;
        let report = RunReport::new(name, sha256, title, tolerance, toolpaths);
        RunReport { inputs: self.inputs.clone(), notes: self.doubt.iter().cloned().collect(), ..report }
    }

    /// Plans, cuts, measures and judges one toolpath; where it cuts what others left, those are planned
    /// before it.
    ///
    /// # Errors
    /// [`JobError`]
    pub fn toolpath(&self, request: &ToolpathRequest, monitor: &dyn Monitor) -> Result<Outcome, JobError> {
        self.refuse_behind_others(request)?;
        let all = &self.scene.toolpaths;
        let own = all.iter().position(|other| other.name == request.name).unwrap_or_default();
        let first = (0..=own).rev().find(|&k| !all[k].stock_is_previous).unwrap_or_default();
        let mut earlier = Vec::new();
        for before in all[first..own].iter().filter(|_| request.stock_is_previous) {
            let outcome = self.toolpath_after(&earlier, before, monitor)?;
            earlier.push(EarlierPath::of(&outcome));
        }
        self.toolpath_after(&earlier, request, monitor)
    }

    /// As [`Session::toolpath`], behind the toolpaths that cut the same stock.
    fn toolpath_after(
        &self,
        earlier: &[EarlierPath],
        request: &ToolpathRequest,
        monitor: &dyn Monitor,
    ) -> Result<Outcome, JobError> {
        monitor::check(monitor)?;
        let engine = self.engine(request)?;
        self.refuse_unmeasured(request, earlier, engine)?;
        let tool = Tool::of(&request.tooling);
        let fixtures = self.fixtures(monitor)?;
        let closer = if engine.tilts() { self.closer_part(monitor)? } else { None };
        let near = closer.as_ref().unwrap_or(&self.part);
        let rest = earlier.last().filter(|_| request.rest).and_then(|before| before.left.as_ref());
        let around = Around { tool: &tool, near, fixtures: &fixtures, rest };
        let at_time;
        let (request, planned, mut measured, covered) = match &request.equal_time {
            None => {
                let (planned, measured, covered) =
                    self.plan_and_measure(request, earlier, around, engine, monitor)?;
                (request, planned, measured, covered)
            }
            Some(time) => {
                let (found, planned) = self.plan_for_time(request, time, around, monitor)?;
                let path = &planned.plan.path;
                let Looked { measured, covered, .. } =
                    self.look(&found, earlier, engine, path, Closeness::Verdict, monitor)?;
                at_time = found;
                (&at_time, planned, measured, covered)
            }
        };
        let (cutters, holders) = self.tools(request);
        let path = &planned.plan.path;
        let whole = WholePath::new(earlier, path, &cutters, self.scene.machine.rapid_rate);
        // The programs are as far off the moves that were measured, and the files' surfaces off the meshes.
        let off = whole.path.origin.strays + self.moved();
        measured.measurement.widen(off);
        let tools = ToolMoves::of(&cutters, &holders, path);
        let mut covered = match (covered, &self.pocket) {
            (Some(known), _) => known,
            (None, Some(pocket)) => self.pocket_covered(pocket, &cutters),
            (None, None) => {
                monitor.start("measuring the coverage", 0);
                let all = (&*whole.path, &whole.cutters);
                self.covered(request, &measured, all, &whole.tools(earlier, &tools), monitor)?
            }
        };
        if let Some(unseen) = &mut covered.unseen {
            unseen.measurement.widen(off);
        }
        let unseen = covered.unseen.iter_mut().map(|unseen| &mut unseen.measurement);
        for found in unseen.chain([&mut measured.measurement]) {
            let own = OwnMoves { path, cutters: &cutters };
            gouge_moves::name(&mut found.gouge.regions, &whole, earlier, own);
        }
        // Limits of jerk make it a search: it is told once.
        let path_figures = planned.path_figures(&self.scene, monitor)?;
        let run = Run {
            session: self,
            request,
            planned: &planned,
            machining_time_s: path_figures.machining_time_s,
            measured: &measured,
            covered: &covered,
            around,
            whole: &whole,
            earlier,
            own_cutters: &cutters,
            tools: &tools,
        };
        let found = figures::all(&run, monitor)?;
        let machined = Machined::new(&run);
        let [claims, left] = self.claims(&run, found.claims);
        let first_move = whole.own_first();
        let rest = self.rest_follows(request).then(|| left_over(&run, monitor)).transpose()?.map(Arc::new);
        let measurement = &measured.measurement;
        let unseen = covered.unseen.as_ref().map(|unseen| &unseen.measurement);
        let result = ToolpathResult {
            name: request.name.clone(),
            strategy: request.strategy_name().to_owned(),
            folder: request.folder.clone(),
            stock_is_previous: request.stock_is_previous,
            verdict: Verdict::by(&claims),
            claims,
            notes: self.notes_on(request, &planned, &measured, found.notes),
            path: path_figures,
            scallop: self.scallop_figures(request, measurement, unseen),
            gouge: unseen
                .map_or_else(|| measurement.gouge.clone(), |unseen| measurement.gouge.or(&unseen.gouge)),
            uncut: measurement.uncut.clone(),
            excess: self.excess(measurement, unseen),
            deviation: measurement.deviation,
            figures: found.figures,
            simulation: self.simulation_figures(engine, &measured, path),
            surface_mesh: machined.figures(),
        };
        let Planned { plan, joints, header, .. } = planned;
        Ok(Outcome {
            result,
            path: plan.path,
            cutters,
            holders,
            joints,
            header,
            field: plan.field,
            measurement: measured.measurement,
            view: measured.view,
            first_move,
            machined,
            files: found.files,
            left,
            rest,
        })
    }

    /// What the verdict is made of, and what the toolpath leaves to those behind it.
    fn claims(&self, run: &Run<'_>, of_figures: Vec<Claim>) -> [Vec<Claim>; 2] {
        let (scene, path) = (&self.scene, run.path());
        let measurement = &run.measured.measurement;
        let (limits, rule) = (&scene.tolerance, &scene.scallop_rule);
        let claims = judge::judge(measurement, limits, rule, of_figures, path.program_name());
        let mut claims = judge::each_violation_once(claims);
        let [lesser_arcs, lesser_chord, other_lines] = judge::LESS_STRAYING;
        let less = match (run.request.foreign(), scene.arcs) {
            (Some(_), _) => other_lines,
            (None, Some(_)) => lesser_arcs,
            (None, None) => lesser_chord,
        };
        let rounded = run.request.foreign().map_or(0.0, |read| read.rounded);
        judge::name_strays(&mut claims, (path.origin.strays, less), rounded);
        if let Some(read) = run.request.foreign() {
            claims = figures::with_lengths_open(claims, &read.findings);
        }
        if self.goes_on(run.request) {
            figures::before_others(claims)
        } else if run.request.foreign().is_some_and(|read| read.others) {
            [figures::with_other_tools(claims), Vec::new()]
        } else {
            [claims, Vec::new()]
        }
    }

    /// The figures of ridges, also where no cell sees; none is held against the target where another toolpath
    /// cuts them off. The highest is left out where its bound says nothing, and nothing hangs on it.
    fn scallop_figures(
        &self,
        request: &ToolpathRequest,
        measurement: &Measurement,
        unseen: Option<&Measurement>,
    ) -> ScallopFigures {
        let (limits, rule) = (&self.scene.tolerance, &self.scene.scallop_rule);
        let all = |unseen| measurement.scallops_with(unseen, limits);
        let mut scallop = unseen.map_or_else(|| measurement.scallop.clone(), all);
        let goes_on = self.goes_on(request);
        let wider = scallop.max_mm.zip(scallop.error_bound_mm).is_some_and(|(height, bound)| bound > height);
        let reason = match wider {
            true if goes_on => {
                "the bound of the highest ridge is wider than that, and the next toolpath cuts it off"
            }
            true if judge::hides_scallops(measurement, limits, rule) => {
                "uncut material stands as high as ridges may"
            }
            _ => "",
        };
        if !reason.is_empty() {
            (scallop.max_mm, scallop.error_bound_mm, scallop.max_at_mm) = (None, None, None);
            scallop.reason = Some(reason.into());
        }
        if goes_on {
            (scallop.target_mm, scallop.over_target_fraction) = (limits.scallop, None);
            scallop.reason.get_or_insert_with(|| "the next toolpath cuts these ridges off".into());
        }
        scallop
    }

    /// The highest material, also where no cell sees. The highest that passes reached is left out where its bound
    /// says nothing.
    fn excess(&self, measurement: &Measurement, unseen: Option<&Measurement>) -> ExcessReport {
        let excess = unseen.map_or(measurement.excess, |unseen| measurement.excess.or(&unseen.excess));
        if judge::hides_reached(&excess, &self.scene.tolerance, &self.scene.scallop_rule) {
            let reason = Some("uncut material stands as high as ridges may".into());
            return ExcessReport { reached: None, reason, ..excess.into() };
        }
        excess.into()
    }

    fn simulation_figures(
        &self,
        engine: &dyn Engine,
        measured: &Measured,
        path: &Toolpath,
    ) -> SimulationFigures {
        SimulationFigures {
            engine: engine.word(),
            cell_mm: measured.cell,
            cells: measured.cells,
            error_bound_asked_mm: self.scene.simulation.error_bound,
            refined_rectangles: measured.refined_rectangles,
            finest_cell_mm: measured.finest_cell,
            moves: path.moves.len(),
            wall_s: measured.wall_s,
            threads: work::parallel::threads(),
        }
    }

    /// The notes on a toolpath: on the part, the cells, the measurement, the plan, and of its figures.
    fn notes_on(
        &self,
        request: &ToolpathRequest,
        planned: &Planned,
        measured: &Measured,
        figures: Vec<String>,
    ) -> Vec<String> {
        let first = self.notes.iter().chain(&measured.note).chain(&measured.measurement.refined.note);
        let back = if request.tilts() { None } else { self.looks_down() };
        back.into_iter().chain(first.chain(&planned.plan.notes).cloned()).chain(figures).collect()
    }

    /// Says so where upright tools come to the back of an open surface. Which side is milled follows from the
    /// sections of a blade: it is not turned over as a mesh is.
    fn looks_down(&self) -> Option<String> {
        /// Closed parts, and open ones that curl, have as much area on both sides.
        const MOSTLY: f64 = 0.5;
        let mesh = self.part.mesh();
        mesh.surface().ok()?;
        let areas: Vec<Vector3> = (0..mesh.triangles().len())
            .map(|t| {
                let [a, b, c] = mesh.corners(t);
                (b - a).cross(&(c - a))
            })
            .collect();
        let sum = |of: &dyn Fn(&Vector3) -> f64| areas.iter().fold(0.0, |sum, area| sum + of(area));
        let down = sum(&|area| if area.z < 0.0 { area.norm() } else { 0.0 });
        (-sum(&|area| area.z) > MOSTLY * sum(&|area| area.z.abs())).then(|| {
            format!(
                "{:.0} % of the part's surface looks down, and an upright tool cuts that from its back; turn the part over",
                100.0 * down / sum(&Vector3::norm)
            )
        })
    }
}

/// Says by which toolpath that is judged which another leaves beyond the limits.
fn answers_later(toolpath: Option<&mut ToolpathReport>, left: &[Claim], next: &str) {
    if let Some(ToolpathReport::Measured(result)) = toolpath
        && left.iter().any(|claim| claim.verdict() != Verdict::Pass)
    {
        result.notes.push(format!(
            "the material that it leaves is judged after {next}, which cuts the same stock next"
        ));
    }
}

/// What a toolpath left to one that could not be planned is its own.
fn answers_itself(toolpath: Option<&mut ToolpathReport>, left: &mut Vec<Claim>) {
    if let Some(ToolpathReport::Measured(result)) = toolpath {
        result.claims.append(left);
        result.claims.sort_by_key(|claim| std::cmp::Reverse(claim.gravity));
        result.verdict = Verdict::by(&result.claims);
    }
}

fn not_planned(request: &ToolpathRequest, reason: String) -> ToolpathReport {
    ToolpathReport::NotPlanned(NotPlanned {
        name: request.name.clone(),
        strategy: request.strategy_name().to_owned(),
        verdict: Verdict::NotPlanned,
        reason,
    })
}

/// Says so where a toolpath moves as one before it, as two strategies do whose best path is the same.
fn note_same_path(seen: &mut Vec<(u64, String)>, outcome: &mut Outcome) {
    let mut hasher = DefaultHasher::new();
    let stops = outcome.path.moves.iter().map(|step| &step.to);
    for place in stops.chain([&outcome.path.start]) {
        place.tip.iter().chain(place.axis.iter()).for_each(|x| x.to_bits().hash(&mut hasher));
    }
    let (path, result) = (hasher.finish(), &mut outcome.result);
    if let Some((_, other)) = seen.iter().find(|(earlier, _)| *earlier == path) {
        result.notes.insert(0, format!("this is the same path as that of {other}"));
    }
    seen.push((path, result.name.clone()));
}
