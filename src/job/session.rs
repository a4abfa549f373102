//! A scene with its part, ready to run its toolpaths.

use std::path::Path;
use std::sync::{Mutex, PoisonError};

use blade::Blade;
use cutter::{Cutter, Holder};
use field::ShortestPossible;
use geometry::{Aabb, Bvh, Point3, TriangleMesh, Vector3};
use io::digest::{self, Fingerprint};
use metrology::{Budget, Engine, LaidOut, Limits, Measured, Simulation, Task};
use motion::{Cutters, Toolpath};
use part::Part;
use report::{InputFile, Verdict};
use scene::{Fixture, Loaded, MeshFile, Scene, StockRequest, ToolpathRequest, load_mesh, load_part};
use sim::{Grid, Stock};
use toolpath::{PlanError, Pocket, Step, shortest_possible};
use work::aside;
use work::monitor::{Cancelled, Monitor, Silent};

use super::tool::FixtureMesh;
use super::{JobError, judge, units};

/// Thickness of stock and machined part below the lowest place of the part, mm.
pub(crate) const BASE: f64 = 5.0;

/// Share of the gouge tolerance that triangles may stand off the patches which tools are kept away from. The
/// plan uses half of the tolerance for itself, and triangles may stand off to either side. Less takes more
/// triangles.
const NEAREST_SHARE: f64 = 0.125;

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
    /// What there is before the first cut.
    pub stock: Stock,
    /// What was mended to make the part usable.
    pub notes: Vec<String>,
    /// What is to be said where part and cutter differ in size beyond belief.
    pub doubt: Option<String>,
    /// The files that the scene names, as they were read.
    pub inputs: Vec<InputFile>,
    /// The tolerances of a toolpath that leaves the rest to another: of what it leaves, none can be exceeded.
    leaving: Limits,
    /// The shortest possible paths that were found, with their cutters and scallop heights, mm.
    shortest: Mutex<Vec<(Cutter, f64, ShortestPossible)>>,
}

/// How well it is known that a part lies in a mesh.
const IN_STOCK: &str = "the part was found to lie in its stock at the corners of both meshes and on the cells; what stands out of it \
                        between them by more than the gouge tolerance would not show";

/// What there is before the first cut. What was mended to make its mesh usable is added to the notes.
///
/// # Errors
/// [`JobError`] when its file cannot be used.
fn stock_of(
    scene: &Scene,
    part: &Part,
    pocket: Option<&Pocket>,
    notes: &mut Vec<String>,
) -> Result<Stock, JobError> {
    Ok(match &scene.stock {
        &StockRequest::Around { allowance, margin, .. } => {
            let Aabb { mut min, mut max } = part.bounds();
            // The measured floor ends where the flat of the cutter's bottom does.
            let beyond =
                pocket.map_or(0.0, |_| scene.tooling.cutter.radius() - scene.tooling.cutter.flat_radius());
            let face = pocket.map_or(max.z, |_| 0.0);
            min -= Vector3::new(beyond, beyond, BASE);
            max += Vector3::new(beyond, beyond, 0.0);
            // What the cutter does not reach stands in the block as well.
            if let Some([low, high]) = pocket.and_then(|pocket| pocket.region.bounds()) {
                (min.x, min.y) = (min.x.min(low.x), min.y.min(low.y));
                (max.x, max.y) = (max.x.max(high.x), max.y.max(high.y));
            }
            min -= Vector3::new(margin, margin, 0.0);
            max += Vector3::new(margin, margin, 0.0);
            max.z = face + allowance;
            let block = Aabb { min, max };
            match pocket.filter(|pocket| !pocket.air().is_empty()) {
                Some(pocket) => Stock::milled(block, &pocket.clear_of_stock(), -pocket.depth),
                None => Stock::Box(block),
            }
        }
        StockRequest::Block(block) => Stock::Box(*block),
        &StockRequest::Bar { from, axis, diameter, length } => {
            Stock::Cylinder { base: from, axis, radius: 0.5 * diameter, length }
        }
        StockRequest::Mesh(MeshFile { file, format, scale, .. }) => {
            let (mesh, mended) = load_mesh(scene, file, format, *scale)?;
            notes.extend(mended);
            notes.push(IN_STOCK.to_owned());
            let refused = || {
                let (what, cure) =
                    ("the stock's mesh has borders, so that it has no inside", "close its holes");
                scene.source.error(file.span.clone(), what, cure)
            };
            Stock::from_mesh(mesh).ok_or_else(refused)?
        }
    })
}

/// Refuses a part that stands out of its stock by more than the gouge tolerance, at corners or on the cells.
fn check_inside(scene: &Scene, part: &Part, stock: &Stock, grid: &Grid) -> Result<(), JobError> {
    let in_row = |j: usize| {
        let places = (0..grid.nx).filter_map(|i| {
            let centre = grid.centre(i, j);
            Some(part.highest_at(centre.x, centre.y)?.point)
        });
        farthest_out(stock, places)
    };
    let rows = work::parallel::map(grid.ny, in_row);
    // Where the stock's surface dips, too.
    let over = |p: &Point3| Some(part.highest_at(p.x, p.y)?.point);
    let corners = part.mesh().vertices().iter().copied().chain(stock.corners().iter().filter_map(over));
    let of_corners = farthest_out(stock, corners);
    let farthest = rows.into_iter().chain([of_corners]).flatten().max_by(|a, b| a.0.total_cmp(&b.0));
    match farthest {
        Some((by, at)) if by > scene.tolerance.gouge => {
            Err(JobError::OutsideStock { scene: scene.source.name.clone(), by, at })
        }
        _ => Ok(()),
    }
}

/// The place that stands farthest out of stock, and how far, mm.
fn farthest_out(stock: &Stock, places: impl Iterator<Item = Point3>) -> Option<(f64, Point3)> {
    places.map(|p| (stock.foot(&p).0, p)).max_by(|a, b| a.0.total_cmp(&b.0))
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
        let Loaded { part, blade, pocket, mut notes } = load_part(&scene)?;
        let stock = stock_of(&scene, &part, pocket.as_ref(), &mut notes)?;
        let budget = Budget::new(&part, scene.simulation.memory_mib).beside(&stock);
        let cells = budget
            .grid_before_planning(&stock.bounds(), &scene.simulation)
            .map_err(JobError::grid(&scene))?;
        if !scene.stock.is_around() {
            check_inside(&scene, &part, &stock, &cells.0)?;
        }
        let doubt = units::doubt(&scene, &part);
        let inputs = inputs(&scene)?;
        let tallest = stock.bounds().size().norm();
        let leaving = Limits { scallop: tallest, uncut: tallest, ..scene.tolerance };
        Ok(Self {
            scene,
            part,
            blade,
            pocket,
            cells,
            stock,
            notes,
            doubt,
            inputs,
            leaving,
            shortest: Mutex::default(),
        })
    }

    /// What a simulation may take.
    pub(crate) fn budget(&self) -> Budget {
        Budget::new(&self.part, self.scene.simulation.memory_mib).beside(&self.stock)
    }

    /// What no path of an upright cutter below a scallop height, mm, is shorter than: the same for all plans.
    pub(crate) fn shortest_possible(
        &self,
        cutter: &Cutter,
        height: f64,
        monitor: &dyn Monitor,
    ) -> Result<ShortestPossible, PlanError> {
        // Not locked while it is sought: a thread that waits for its share of that may come by here.
        let known = || self.shortest.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((.., shortest)) = known().iter().find(|(with, of, _)| with == cutter && *of == height) {
            return Ok(*shortest);
        }
        let shortest = shortest_possible(&self.part, cutter, height, monitor)?;
        known().push((*cutter, height, shortest));
        Ok(shortest)
    }

    /// The stock's greatest height, mm.
    pub fn top(&self) -> f64 {
        self.stock.bounds().max.z
    }

    /// The box around the stock.
    pub fn area(&self) -> Aabb {
        self.stock.bounds()
    }

    /// How far welding moved the surfaces of part and stock off their files at most, mm.
    pub(crate) fn moved(&self) -> f64 {
        self.part.mesh().moved() + self.stock.mesh().map_or(0.0, TriangleMesh::moved)
    }

    /// The meshes that are not to be touched.
    pub(crate) fn fixtures(&self, monitor: &dyn Monitor) -> Result<Vec<FixtureMesh>, JobError> {
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

    /// The part with triangles so near to its patches that a tool which is kept off the triangles stays
    /// within the gouge tolerance of the patches; `None` where the part's own do.
    pub(crate) fn closer_part(&self, monitor: &dyn Monitor) -> Result<Option<Part>, Cancelled> {
        let nearest = NEAREST_SHARE * self.scene.tolerance.gouge;
        if self.part.mesh_deviation() <= nearest {
            return Ok(None);
        }
        let patches = self.part.patches().to_vec();
        // Patches that would take too many triangles keep theirs; the measurement finds what that costs.
        aside::run(monitor, move || Part::from_patches(patches, nearest).ok())
    }

    /// What there is before the first cut, roughed as the scene says.
    pub(crate) fn roughed_stock(&self) -> Stock {
        match self.scene.stock.roughed() {
            Some(over) => Stock::roughed(self.area(), self.part.mesh().clone(), over),
            None => self.stock.clone(),
        }
    }

    /// Whether a limit of the measured surface is undecided, and none violated.
    pub(crate) fn is_open(&self, measured: &Measured) -> bool {
        self.verdict_on(measured) == Verdict::Undecided
    }

    /// The verdict on the measured surface alone.
    pub(crate) fn verdict_on(&self, measured: &Measured) -> Verdict {
        judge::of_surface(&measured.measurement, &self.scene.tolerance, &self.scene.scallop_rule)
    }

    /// The engine of a toolpath.
    pub(crate) fn engine(&self, request: &ToolpathRequest) -> Result<&'static dyn Engine, JobError> {
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

    /// The cutters of a toolpath and what holds each: those of its program where all tools of one are meant,
    /// else its own.
    pub(crate) fn tools(&self, request: &ToolpathRequest) -> (Cutters, Vec<Option<Holder>>) {
        let of_program = request.foreign().and_then(|read| read.tools.clone());
        let own = || (Cutters::from(&request.tooling.cutter), vec![request.tooling.holder.clone()]);
        of_program.unwrap_or_else(own)
    }

    pub(crate) fn refused(&self, request: &ToolpathRequest, reason: PlanError) -> JobError {
        JobError::plan(&self.scene, &request.name, reason)
    }

    pub(crate) fn not_applicable(&self, request: &ToolpathRequest, reason: String) -> JobError {
        self.refused(request, PlanError::NotApplicable { strategy: request.strategy_name(), reason })
    }

    /// The toolpath that cuts what this one leaves.
    fn behind(&self, request: &ToolpathRequest) -> Option<&ToolpathRequest> {
        let mut after = self.scene.toolpaths.iter().skip_while(|other| other.name != request.name).skip(1);
        after.next().filter(|next| next.stock_is_previous)
    }

    /// Whether the next toolpath cuts what this one leaves.
    pub(crate) fn goes_on(&self, request: &ToolpathRequest) -> bool {
        self.behind(request).is_some()
    }

    /// Whether the next toolpath is for what this one cannot reach.
    pub(crate) fn rest_follows(&self, request: &ToolpathRequest) -> bool {
        self.behind(request).is_some_and(|next| next.rest)
    }

    /// Whether it is measured for nothing but gouges: another toolpath cuts off what it leaves, and it is not
    /// corrected by that.
    pub(crate) fn leaves_the_rest(&self, request: &ToolpathRequest) -> bool {
        let is_corrected = request.correct && matches!(request.step, Step::Scallop(_));
        self.goes_on(request) && !is_corrected
    }

    /// A path to cut and to measure, with what makes its moves.
    pub(crate) fn task<'a>(
        &'a self,
        request: &'a ToolpathRequest,
        (path, cutters): (&'a Toolpath, &'a Cutters),
        simulation: &'a Simulation,
        cells: &'a LaidOut,
    ) -> Task<'a> {
        Task {
            part: &self.part,
            cutters,
            holder: request.tooling.holder.as_ref(),
            path,
            stock: &self.stock,
            cells,
            limits: if self.leaves_the_rest(request) { &self.leaving } else { &self.scene.tolerance },
            simulation,
            budget: self.budget(),
            judged: self.scene.judged,
            pocket: self.pocket.is_some(),
            is_first_look: false,
            allowed_depth: 0.0,
        }
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tool::Tool;
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

    /// Whoever fills a scene in by hand learns which key is wrong.
    #[test]
    fn a_cell_that_is_no_length_is_refused_by_its_key() {
        let text = "[part]\nsurface = \"plane\"\nx = [0, 8]\ny = [0, 6]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n\
                    [[toolpath]]\nstrategy = \"zigzag\"\n";
        for cell in [f64::NAN, f64::INFINITY, 0.0, -0.1] {
            let mut scene = Scene::parse("plate.toml", text).unwrap();
            assert!(scene.simulation.cell > 0.0 && scene.simulation.cell_is_auto);
            (scene.simulation.cell, scene.simulation.cell_is_auto) = (cell, false);
            let refused = Session::new(scene).unwrap_err();
            assert!(matches!(refused, JobError::Grid { reason: GridError::Cell(_), .. }), "{refused}");
            let told = format!("{refused}; {}", miette::Diagnostic::help(&refused).unwrap());
            assert!(told.contains("another `cell`") && told.contains(&format!("is {cell} mm")), "{told}");
        }
    }

    /// Arcs of a program may be off its moves: what they cut is not proven any nearer.
    #[test]
    fn bounds_are_wider_where_programs_have_arcs() {
        let result = |arcs: &str| {
            let text = format!(
                "[part]\nsurface = \"plane\"\nx = [0, 8]\ny = [0, 6]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n\
                 [tolerance]\ngouge = 0.0015\nchord = 0.002\n[machine]\nclearance = 2\n{arcs}[[toolpath]]\n\
                 strategy = \"zigzag\"\nstepover = 0.4\n"
            );
            let session = Session::new(Scene::parse("plate.toml", text).unwrap()).unwrap();
            session.toolpath(&session.scene.toolpaths[0], &work::monitor::Silent).unwrap().result
        };
        let [moves, arcs] = ["", "arcs = 0.002\n"].map(result);
        let bounds = |result: &report::ToolpathResult| {
            let (excess, scallop) = (&result.excess, &result.scallop);
            let most = [excess.highest, excess.reached.unwrap(), excess.unreached]
                .map(|highest| highest.error_bound_mm);
            [result.gouge.error_bound_mm, result.uncut.error_bound_mm, scallop.error_bound_mm.unwrap()]
                .into_iter()
                .chain(most)
        };
        assert!(bounds(&moves).zip(bounds(&arcs)).all(|(a, b)| (b - a - 0.002).abs() < 1e-12));
        let gouge = |result: &report::ToolpathResult| {
            let claim = result.claims.iter().find(|claim| claim.what == "gouge").unwrap();
            claim.verdict()
        };
        assert_eq!([gouge(&moves), gouge(&arcs)], [report::Verdict::Pass, report::Verdict::Undecided]);
        let said: String = arcs.claims.iter().map(report::Claim::sentence).collect();
        assert!(said.contains("a lesser `arcs`") && !said.contains("finer cell"), "{said}");
    }

    /// Plans keep clear of what arcs may be off their moves, so that they hold the target for certain.
    #[test]
    fn arcs_leave_a_corrected_plan_decided() {
        for (part, toolpath) in [
            ("surface = \"cylinder\"\nradius = 10.4\nazimuth = 0", "strategy = \"zigzag\"\nangle = 90"),
            ("surface = \"sphere\"\nradius = 20.6\nconcave = true", "strategy = \"spiral\""),
        ] {
            let text = format!(
                "[part]\n{part}\nx = [0.6, 5]\ny = [-2.8, 3]\n[cutter]\nshape = \"ball\"\ndiameter = 2.4\n[tolerance]\n\
                 scallop = 0.0055\nchord = 0.002\n[machine]\narcs = 0.0005\n[simulation]\nremoval = false\n[[toolpath]]\n{toolpath}\n"
            );
            let session = Session::new(Scene::parse("dome.toml", text).unwrap()).unwrap();
            let result =
                session.toolpath(&session.scene.toolpaths[0], &work::monitor::Silent).unwrap().result;
            let claims: Vec<String> = result.claims.iter().map(report::Claim::sentence).collect();
            let undecided = |claim: &report::Claim| claim.verdict() != report::Verdict::Pass;
            assert!(!result.claims.iter().any(undecided), "{part}: {claims:?}");
            let highest = result.scallop.max_mm.unwrap();
            assert!(highest > 0.0040 && highest < 0.0050, "{part}: {highest}");
        }
    }

    /// What the planner lets the cutter into the triangles, and these into the true surface, is no gouge.
    #[test]
    fn tools_are_kept_off_triangles_that_lie_within_the_gouge_tolerance() {
        let text = "[part]\nsurface = \"cylinder\"\nradius = 400\nx = [-60, 60]\ny = [0, 90]\n[cutter]\nshape = \"ball\"\n\
                    diameter = 6\n[[toolpath]]\nstrategy = \"zigzag\"\naxis = { lead = 10 }\n";
        let session = Session::new(Scene::parse("shell.toml", text).unwrap()).unwrap();
        let gouge = session.scene.tolerance.gouge;
        let deepest = |part: &Part| {
            let needed =
                Tool::of(&session.scene.tooling).keep_clear(&session.scene, part, &[]).checks[0].needed;
            part.mesh_deviation() - needed
        };
        let near = session.closer_part(&Silent).unwrap().unwrap();
        assert!(deepest(&session.part) > gouge && deepest(&near) <= 0.75 * gouge * (1.0 + 1e-9));
    }
}
