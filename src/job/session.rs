//! A scene with its part, ready to run its toolpaths.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;

use blade::Blade;
use cutter::{Cutter, Holder};
use geometry::{Aabb, Bvh, Point3, Vector3};
use io::ProgramHeader;
use io::digest::{self, Fingerprint};
use metrology::{Budget, Engine, EngineError, LaidOut, Measured, Simulation, Task, path_figures};
use motion::{Cutters, Toolpath};
use part::Part;
use report::{
    InputFile, NotPlanned, RunReport, SimulationFigures, ToleranceFigures, ToolpathReport, ToolpathResult,
    Verdict,
};
use scene::{Fixture, Loaded, PartSource, Scene, ToolpathRequest, auto_cell, load_mesh, load_part};
use sim::VoxelStock;
use toolpath::{PlanError, Pocket};
use work::aside;
use work::monitor::{self, Cancelled, Monitor, Silent};

use super::earlier::{EarlierPath, WholePath};
use super::machined::BASE;
use super::planned::{self, Planned};
use super::run::Run;
use super::tool::{Around, FixtureMesh, Tool, ToolMoves};
use super::{JobError, Machined, Outcome, figures, judge, units};

/// The cell shrinks to this share where a limit is undecided. Nearer to 1 more cuts are made in vain, nearer to 0 more
/// cells.
const FINER: f64 = 0.5;

/// Rounds in which bounds are asked for that are smaller by the square of that, down to a share of the first; the cell may
/// be the finest already that suits the scene. It shrinks in them, too, up to so many cells: more take minutes.
const CLOSER_ROUNDS: usize = 2;
const MOST_CLOSER_CELLS: usize = 4_000_000;
const CLOSEST_BOUND: f64 = 0.02;
/// Share of the gouge tolerance that triangles may stand off the patches which tools are kept away from. The plan uses half
/// of the tolerance for itself, and triangles may stand off to either side. Less takes more triangles.
const NEAREST_SHARE: f64 = 0.125;

/// How closely a path is measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Closeness {
    /// As the verdict needs it.
    Verdict,
    /// The highest place to `within` mm; no closer where it is above `limit`, mm, for certain, and the path is to be planned
    /// anew.
    Plan { within: f64, limit: f64 },
}

impl Closeness {
    /// `coarse` cells may tell heights that finer ones do not have.
    fn is_enough(self, measured: &Measured, coarse: bool) -> bool {
        let highest = judge::highest_reached(&measured.measurement);
        match self {
            Self::Verdict => false,
            Self::Plan { within, limit } => {
                highest.error_bound_mm <= within || !coarse && highest.max_mm > limit
            }
        }
    }
}

/// A scene with its part: what all its toolpaths share.
#[derive(Debug)]
pub struct Session {
    /// What was asked for.
    pub scene: Scene,
    /// What is to be made.
    pub part: Part,
    /// The sections that the part comes from, if it is a blade.
    pub blade: Option<Blade>,
    /// What the part is the floor of, if it is a pocket.
    pub pocket: Option<Pocket>,
    /// The cells over the stock before there is a path, and what is to be said about them.
    pub cells: LaidOut,
    /// Height of the stock's flat top, mm.
    pub top: f64,
    /// What was mended to make the part usable.
    pub notes: Vec<String>,
    /// What is to be said where part and cutter differ in size beyond belief.
    pub doubt: Option<String>,
    /// The files that the scene names, as they were read.
    pub inputs: Vec<InputFile>,
    /// The scene's cutter, for all moves.
    cutters: Cutters,
}

/// The rectangle to simulate: the part's, grown by the stock's margin.
pub fn stock_area(scene: &Scene, part: &Part) -> Aabb {
    let mut area = part.bounds();
    let mut margin = scene.stock.margin;
    if matches!(scene.part, PartSource::Pocket { .. }) {
        // The measured floor ends where the flat of the cutter's bottom does.
        margin += scene.cutter.radius() - scene.cutter.flat_radius();
    }
    (area.min.x, area.min.y) = (area.min.x - margin, area.min.y - margin);
    (area.max.x, area.max.y) = (area.max.x + margin, area.max.y + margin);
    area
}

impl Session {
    /// Reads a scene file and loads its part.
    ///
    /// # Errors
    /// [`JobError`] when scene or part cannot be used.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, JobError> {
        Self::new(Scene::read(path.as_ref())?)
    }

    /// Loads the part of a scene.
    ///
    /// # Errors
    /// [`JobError`] when the part cannot be used, or its cells do not fit into the memory.
    pub fn new(scene: Scene) -> Result<Self, JobError> {
        Self::load(scene, &Silent)
    }

    /// As [`Session::new`], and the monitor is asked while it lasts.
    ///
    /// # Errors
    /// Those of [`Session::new`], and [`JobError::Cancelled`] when the monitor says so.
    pub fn load(scene: Scene, monitor: &dyn Monitor) -> Result<Self, JobError> {
        monitor.start("reading the part", 0);
        // Readers, triangulations and search trees ask nobody.
        aside::run(monitor, move || Self::read(scene))?
    }

    fn read(scene: Scene) -> Result<Self, JobError> {
        let Loaded { part, blade, pocket, notes } = load_part(&scene)?;
        let budget = Budget::new(&part, scene.simulation.memory_mib);
        let cells = budget
            .grid_before_planning(&stock_area(&scene, &part), &scene.simulation)
            .map_err(JobError::grid(&scene))?;
        let face = if pocket.is_some() { 0.0 } else { part.bounds().max.z };
        let top = face + scene.stock.allowance;
        let doubt = units::doubt(&scene, &part);
        let inputs = inputs(&scene)?;
        let cutters = Cutters::from(&scene.cutter);
        Ok(Self { scene, part, blade, pocket, cells, top, notes, doubt, inputs, cutters })
    }

    /// Runs all toolpaths. Maps, paths and meshes are dropped; [`Session::toolpath`] leaves them. One that cannot be
    /// planned is a row with its reason, and fails the run.
    ///
    /// # Errors
    /// [`JobError`] of the first toolpath that cannot be run, or if none could be planned.
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
        let (mut rows, mut refused) = (Vec::new(), None);
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
                    rows.push(ToolpathReport::Measured(Box::new(outcome.result)));
                }
                Err(error) => {
                    let Some(reason) = error.why_not_planned() else { return Err(error.into()) };
                    earlier = None;
                    rows.push(not_planned(request, reason));
                    refused = refused.or(Some(error));
                }
            }
        }
        match refused {
            Some(error) if rows.iter().all(|row| row.measured().is_none()) => Err(error.into()),
            _ => Ok(self.report(rows)),
        }
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

    /// Plans, cuts, measures and judges one toolpath; where it cuts what others left, those are planned before it.
    ///
    /// # Errors
    /// [`JobError`]
    pub fn toolpath(&self, request: &ToolpathRequest, monitor: &dyn Monitor) -> Result<Outcome, JobError> {
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

    /// Whether the next toolpath cuts what this one leaves.
    fn goes_on(&self, request: &ToolpathRequest) -> bool {
        let mut after = self.scene.toolpaths.iter().skip_while(|other| other.name != request.name).skip(1);
        after.next().is_some_and(|next| next.stock_is_previous)
    }

    /// As [`Session::toolpath`], behind the toolpaths that cut the same stock.
    fn toolpath_after(
        &self,
        earlier: &[EarlierPath],
        request: &ToolpathRequest,
        monitor: &dyn Monitor,
    ) -> Result<Outcome, JobError> {
        monitor::check(monitor)?;
        let scene = &self.scene;
        let engine = self.engine(request)?;
        let (cutters, holders) = self.tools(request);
        if cutters.are_several() {
            self.on_cells(request, engine, "measured with one tool at a time: write `tool = 2` for tool 2")?;
        }
        if !earlier.is_empty() {
            self.on_cells(request, engine, "measured on a block of its own: delete `stock`")?;
        }
        let tool = Tool::of(scene);
        let fixtures = self.fixtures(monitor)?;
        let closer = if engine.tilts() { self.closer_part(monitor)? } else { None };
        let near = closer.as_ref().unwrap_or(&self.part);
        let around = Around { tool: &tool, near, fixtures: &fixtures };
        let at_time;
        let (request, planned, mut measured) = match &request.equal_time {
            None => {
                let (planned, measured) = self.plan_and_measure(request, around, engine, monitor)?;
                (request, planned, measured)
            }
            Some(time) => {
                let (found, planned) = self.plan_for_time(request, time, around, monitor)?;
                let measured =
                    self.measure(&found, engine, &planned.plan.path, Closeness::Verdict, monitor)?;
                at_time = found;
                (&at_time, planned, measured)
            }
        };
        let whole = WholePath::new(earlier, &planned.plan.path, cutters, scene.machine.rapid_rate);
        if !earlier.is_empty() {
            measured = self.measure_whole(
                request,
                engine,
                (&whole.path, &whole.cutters),
                Closeness::Verdict,
                monitor,
            )?;
        }
        for region in &mut measured.measurement.gouge.regions {
            let at = region.at_mm.into();
            let (toolpath, move_index) = whole.own_move(region.move_index);
            let its = earlier.get(toolpath);
            let (path, cutters) =
                its.map_or((&planned.plan.path, cutters), |before| (&before.path, &before.cutters));
            region.move_index = move_index;
            region.line = line_of_cut(path, cutters.of_move(move_index), move_index as usize, &at);
            region.tool = path.named_tool_of(move_index as usize);
            region.toolpath = its.map(|before| before.name.clone());
        }
        let tools = ToolMoves::of(cutters, holders, &planned.plan.path);
        let run = Run {
            session: self,
            request,
            planned: &planned,
            measured: &measured,
            around,
            whole: &whole,
            earlier,
            own_cutters: cutters,
            tools: &tools,
        };
        let found = figures::all(&run, monitor)?;
        let machined = Machined::new(&run);
        let simulation = SimulationFigures {
            engine: engine.word(),
            cell_mm: measured.cell,
            cells: measured.cells,
            error_bound_asked_mm: scene.simulation.error_bound,
            refined_rectangles: measured.refined_rectangles,
            finest_cell_mm: measured.finest_cell,
            moves: planned.plan.path.len(),
            wall_s: measured.wall_s,
            threads: work::parallel::threads(),
        };
        let (verdict, claims) = judge::judge(
            &measured.measurement,
            &scene.tolerance,
            &scene.scallop_rule,
            found.claims,
            planned.plan.path.program_name(),
        );
        let (verdict, claims) = if self.goes_on(request) {
            figures::before_others(claims)
        } else if request.foreign().is_some_and(|read| read.others) {
            figures::with_other_tools(claims)
        } else {
            (verdict, claims)
        };
        let measurement = &measured.measurement;
        let result = ToolpathResult {
            name: request.name.clone(),
            strategy: request.strategy_name().to_owned(),
            folder: request.folder.clone(),
            verdict,
            claims,
            notes: self.notes_on(&planned, &measured, found.notes),
            path: path_figures(&planned.plan.path, planned.time(scene)),
            scallop: measurement.scallop.clone(),
            gouge: measurement.gouge.clone(),
            uncut: measurement.uncut.clone(),
            excess: measurement.excess,
            deviation: measurement.deviation,
            figures: found.figures,
            simulation,
            surface_mesh: machined.figures(),
        };
        let Planned { plan, joints, .. } = planned;
        Ok(Outcome {
            result,
            path: plan.path,
            cutters: cutters.clone(),
            holders: holders.to_vec(),
            joints,
            field: plan.field,
            measurement: measured.measurement,
            view: measured.view,
            machined,
            files: found.files,
        })
    }

    /// Cuts and measures; closer, and on finer cells where these help, where a limit hangs on that.
    pub(crate) fn measure(
        &self,
        request: &ToolpathRequest,
        engine: &dyn Engine,
        path: &Toolpath,
        closeness: Closeness,
        monitor: &dyn Monitor,
    ) -> Result<Measured, JobError> {
        let (cutters, _) = self.tools(request);
        self.measure_whole(request, engine, (path, cutters), closeness, monitor)
    }

    /// As [`Session::measure`], of a path that may begin with the moves of other toolpaths.
    fn measure_whole(
        &self,
        request: &ToolpathRequest,
        engine: &dyn Engine,
        (path, cutters): (&Toolpath, &Cutters),
        closeness: Closeness,
        monitor: &dyn Monitor,
    ) -> Result<Measured, JobError> {
        let scene = &self.scene;
        let failed = |reason| JobError::engine(scene, &request.name, reason);
        let own = self.own_cells(request)?;
        let (simulation, cells) =
            own.as_ref().map_or((&scene.simulation, &self.cells), |(simulation, cells)| (simulation, cells));
        let first = Task { cutters, ..self.task(path, simulation, cells) };
        let mut measured = engine.measure(&first, monitor).map_err(failed)?;
        let mut finest = auto_cell(&scene.cutter, &scene.toolpaths).min(simulation.cell);
        let mut simulation = Simulation { cell_is_auto: false, cell: measured.cell, ..scene.simulation };
        if !engine.gains_by_cells() {
            finest = simulation.cell;
        }
        let (mut rounds, least) = (0, CLOSEST_BOUND * scene.simulation.error_bound);
        while (simulation.cell > finest || rounds < CLOSER_ROUNDS)
            && self.is_open(&measured)
            && !closeness.is_enough(&measured, engine.gains_by_cells())
        {
            rounds += 1;
            let before = simulation.cell;
            let few = measured.cells as f64 <= FINER * FINER * MOST_CLOSER_CELLS as f64;
            if engine.gains_by_cells() {
                simulation.cell = if few { FINER * before } else { (FINER * before).max(finest.min(before)) };
            }
            simulation.error_bound = (FINER * FINER * simulation.error_bound).max(least);
            let cells = self.budget().grid_before_planning(&self.area(), &simulation);
            let finer = cells.map(|cells| {
                let task = Task { cutters, ..self.task(path, &simulation, &cells) };
                engine.measure(&task, monitor)
            });
            match finer {
                Ok(Ok(finer)) => {
                    let wall_s = measured.wall_s + finer.wall_s;
                    measured =
                        Measured { note: finer_note(&simulation, scene).or(finer.note), wall_s, ..finer }
                }
                Ok(Err(EngineError::Cancelled(cancelled))) => return Err(cancelled.into()),
                // Finer cells do not fit into the memory; smaller bounds on the same ones may be enough.
                _ if simulation.cell < before => (simulation.cell, finest) = (before, before),
                _ => break,
            }
        }
        Ok(measured)
    }

    /// The cells of a toolpath that was planned for a time, where its passes lie nearer than those of the scene's scallop height.
    fn own_cells(&self, request: &ToolpathRequest) -> Result<Option<(Simulation, LaidOut)>, JobError> {
        let scene = &self.scene;
        let cell = auto_cell(&scene.cutter, std::slice::from_ref(request));
        if request.equal_time.is_none() || !scene.simulation.cell_is_auto || cell >= scene.simulation.cell {
            return Ok(None);
        }
        let simulation = Simulation { cell, ..scene.simulation };
        let cells = self.budget().grid_before_planning(&self.area(), &simulation);
        Ok(Some((simulation, cells.map_err(JobError::grid(scene))?)))
    }

    /// Whether a limit of the measured surface is undecided, and none violated.
    pub(crate) fn is_open(&self, measured: &Measured) -> bool {
        judge::is_open(&measured.measurement, &self.scene.tolerance, &self.scene.scallop_rule)
    }

    /// The notes on a toolpath: on the part, the cells, the measurement, the plan, and of its figures.
    fn notes_on(&self, planned: &Planned, measured: &Measured, figures: Vec<String>) -> Vec<String> {
        let first = self.notes.iter().chain(&measured.note).chain(&measured.measurement.refined.note);
        first.chain(&planned.plan.notes).cloned().chain(figures).collect()
    }

    /// The engine of a toolpath.
    fn engine(&self, request: &ToolpathRequest) -> Result<&'static dyn Engine, JobError> {
        let (scene, name) = (&self.scene, &request.name);
        let engine = scene.simulation.engine.for_path(request.tilts());
        if self.pocket.is_some() && !engine.measures_pockets() {
            return Err(JobError::PocketAlongNormals {
                scene: scene.source.name.clone(),
                name: name.clone(),
            });
        }
        if request.tilts() && !engine.tilts() {
            let engine = engine.word();
            return Err(JobError::Upright { scene: scene.source.name.clone(), name: name.clone(), engine });
        }
        if engine.tilts()
            && let Err(reason) = self.part.mesh().surface()
        {
            let (scene, reason) = (scene.source.name.clone(), Box::new(reason.clone()));
            return Err(JobError::NoSurface { scene, name: name.clone(), reason });
        }
        Ok(engine)
    }

    /// The cutters of a toolpath and what holds each: those of its program where all tools of one are meant, else the scene's.
    fn tools<'a>(&'a self, request: &'a ToolpathRequest) -> (&'a Cutters, &'a [Option<Holder>]) {
        let of_program = request.foreign().and_then(|read| read.tools.as_ref());
        let of_scene = || (&self.cutters, std::slice::from_ref(&self.scene.holder));
        of_program.map_or_else(of_scene, |(cutters, holders)| (cutters, holders.as_slice()))
    }

    /// Refuses what is not measured on cells under upright tools; `otherwise` is how it is.
    fn on_cells(
        &self,
        request: &ToolpathRequest,
        engine: &dyn Engine,
        otherwise: &str,
    ) -> Result<(), JobError> {
        let what = match () {
            () if request.tilts() => "what tools that lean leave is".to_owned(),
            () if self.pocket.is_some() => "the floor of a pocket is".to_owned(),
            () if engine.tilts() => format!("with the engine `{}` a toolpath is", engine.word()),
            () if self.scene.simulation.voxel.is_some() => {
                "the solid of `voxel` in [simulation] is".to_owned()
            }
            () => return Ok(()),
        };
        Err(self.not_applicable(request, format!("{what} {otherwise}")))
    }

    fn not_applicable(&self, request: &ToolpathRequest, reason: String) -> JobError {
        self.refused(request, PlanError::NotApplicable { strategy: request.strategy_name(), reason })
    }

    /// A path to cut and to measure.
    pub(crate) fn task<'a>(
        &'a self,
        path: &'a Toolpath,
        simulation: &'a Simulation,
        cells: &'a LaidOut,
    ) -> Task<'a> {
        Task {
            part: &self.part,
            cutters: &self.cutters,
            holder: self.scene.holder.as_ref(),
            path,
            top: self.top,
            area: self.area(),
            cells,
            limits: &self.scene.tolerance,
            simulation,
            budget: self.budget(),
            judged: self.scene.judged,
            pocket: self.pocket.is_some(),
        }
    }

    /// What a simulation may take.
    pub(crate) fn budget(&self) -> Budget {
        Budget::new(&self.part, self.scene.simulation.memory_mib)
    }

    /// The rectangle to simulate.
    pub fn area(&self) -> Aabb {
        stock_area(&self.scene, &self.part)
    }

    /// The meshes that are not to be touched.
    fn fixtures(&self, monitor: &dyn Monitor) -> Result<Vec<FixtureMesh>, JobError> {
        if self.scene.keep_clear.fixtures.is_empty() {
            return Ok(Vec::new());
        }
        let scene = self.scene.clone();
        aside::run(monitor, move || {
            let load = |fixture: &Fixture| {
                let (mesh, _) = load_mesh(&scene, &fixture.file, fixture.format, fixture.scale)?;
                let bvh = Bvh::new(&mesh);
                Ok((mesh, bvh))
            };
            scene.keep_clear.fixtures.iter().map(load).collect()
        })?
    }

    /// The part with triangles so near to its patches that a tool which is kept off the triangles stays within the gouge
    /// tolerance of the patches; `None` where the part's own do.
    fn closer_part(&self, monitor: &dyn Monitor) -> Result<Option<Part>, Cancelled> {
        let nearest = NEAREST_SHARE * self.scene.tolerance.gouge;
        if self.part.mesh_deviation() <= nearest {
            return Ok(None);
        }
        let patches = self.part.patches().to_vec();
        // Patches that would take too many triangles keep theirs; the measurement finds what that costs.
        aside::run(monitor, move || Part::from_patches(patches, nearest).ok())
    }

    /// The block that the part is cut from.
    pub(crate) fn stock_block(&self) -> Aabb {
        let Aabb { mut min, mut max } = self.area();
        (min.z, max.z) = (min.z - BASE, self.top);
        Aabb { min, max }
    }

    /// That block, as far as it was roughed before.
    pub(crate) fn voxel_stock(&self) -> VoxelStock {
        let block = self.stock_block();
        match self.scene.stock.roughed {
            Some(over) => VoxelStock::roughed(block, self.part.mesh().clone(), over),
            None => VoxelStock::Box(block),
        }
    }

    /// The header of a toolpath's programs.
    pub fn header(&self, name: &str) -> ProgramHeader {
        planned::header(&self.scene, name)
    }

    /// Writes the program of an outcome as G-code: nothing where the tool leans and the scene names no machine for it.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write_program(&self, out: &mut dyn std::io::Write, outcome: &Outcome) -> std::io::Result<()> {
        let header = self.header(&outcome.result.name);
        planned::write_program(out, &self.scene, &outcome.path, outcome.joints.as_ref(), &header).map(drop)
    }

    /// Whether an outcome has a program.
    pub fn has_program(&self, outcome: &Outcome) -> bool {
        // A program from elsewhere has its own file.
        outcome.path.origin.program.is_empty() && (outcome.path.is_upright() || outcome.joints.is_some())
    }
}

/// The line that took the cutter to where it cuts deepest, at a place that a move cuts. That is the line before where the
/// move begins there.
fn line_of_cut(path: &Toolpath, cutter: &Cutter, step: usize, at: &Point3) -> u32 {
    /// Places along the move; a start that is lowest by less than a share of it counts as its end.
    const PLACES: u32 = 64;
    let line = |k: usize| path.line_of(k).unwrap_or_default();
    let (Some(before), Some(this)) = (step.checked_sub(1), path.moves.get(step)) else { return line(step) };
    let (from, to) = (path.location_before(step), this.to);
    if from.axis != Vector3::z() || to.axis != from.axis {
        return line(step);
    }
    let height = |k: u32| {
        let tip = from.towards(&to, f64::from(k) / f64::from(PLACES)).tip;
        cutter.height((tip.x - at.x).hypot(tip.y - at.y)).map_or(f64::INFINITY, |above| tip.z + above)
    };
    let begins = (1..=PLACES).all(|k| height(k) >= height(0));
    line(if begins { before } else { step })
}

fn finer_note(simulation: &Simulation, scene: &Scene) -> Option<String> {
    (simulation.cell < scene.simulation.cell).then(|| {
        format!(
            "measured on cells of {} mm instead of {} mm: on those a limit was undecided",
            simulation.cell, scene.simulation.cell
        )
    })
}

fn not_planned(request: &ToolpathRequest, reason: String) -> ToolpathReport {
    ToolpathReport::NotPlanned(NotPlanned {
        name: request.name.clone(),
        strategy: request.strategy_name().to_owned(),
        verdict: Verdict::NotPlanned,
        reason,
    })
}

/// The files that a scene names, each once.
fn inputs(scene: &Scene) -> Result<Vec<InputFile>, JobError> {
    let mut inputs: Vec<InputFile> = Vec::new();
    for file in scene.files() {
        if inputs.iter().any(|input| input.file == file.written) {
            continue;
        }
        let Fingerprint { bytes, sha256 } = digest::of_file(&file.path).map_err(|e| {
            let message = format!("cannot read {}: {e}", file.written);
            scene.source.error(file.span.clone(), message, "relative paths start from the scene's folder")
        })?;
        inputs.push(InputFile { file: file.written.clone(), bytes, sha256 });
    }
    Ok(inputs)
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

#[cfg(test)]
mod tests {
    use super::*;
    use sim::GridError;

    #[test]
    fn a_chosen_cell_is_kept_or_refused_and_a_default_one_grows() {
        let session = |simulation: &str| {
            let text = format!(
                "[part]\nsurface = \"plane\"\nx = [0, 800]\ny = [0, 6]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n\
                 [simulation]\nmemory_mib = 2\n{simulation}[[toolpath]]\nstrategy = \"zigzag\"\nstepover = 0.5\n"
            );
            Session::new(Scene::parse("plate.toml", text).unwrap())
        };
        let (grid, note) = session("").unwrap().cells;
        assert!(grid.cell > 0.05 && grid.len() * 80 <= 2 << 20);
        assert!(note.unwrap().contains("instead of 0.05 mm, to fit into 2 MiB"));
        let refused = session("cell = 0.05\n").unwrap_err();
        assert!(matches!(refused, JobError::Grid { reason: GridError::Memory { .. }, .. }), "{refused}");
    }

    /// What the planner lets the cutter into the triangles, and these into the true surface, is no gouge.
    #[test]
    fn tools_are_kept_off_triangles_that_lie_within_the_gouge_tolerance() {
        let text = "[part]\nsurface = \"cylinder\"\nradius = 400\nx = [-60, 60]\ny = [0, 90]\n[cutter]\nshape = \"ball\"\n\
                    diameter = 6\n[[toolpath]]\nstrategy = \"zigzag\"\naxis = { lead = 10 }\n";
        let session = Session::new(Scene::parse("shell.toml", text).unwrap()).unwrap();
        let gouge = session.scene.tolerance.gouge;
        let deepest = |part: &Part| {
            let needed = Tool::of(&session.scene).keep_clear(&session.scene, part, &[]).checks[0].needed;
            part.mesh_deviation() - needed
        };
        let near = session.closer_part(&Silent).unwrap().unwrap();
        assert!(deepest(&session.part) > gouge && deepest(&near) <= 0.75 * gouge * (1.0 + 1e-9));
    }
}
