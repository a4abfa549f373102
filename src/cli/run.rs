//! `millstream run`: scene → part → for each toolpath plan, cut, measure → results.

mod normals;
mod offset;
mod removal;
mod solid;

use std::path::{Path, PathBuf};
use std::time::Instant;

use super::args::{Cell, RunOptions};
use super::error::CliError;
use super::load::{Loaded, load_part};
use super::outputs::Outputs;
use super::pocket::{limit_feed_by, load_pocket, pocket_figures};
use super::program;
use super::progress::Progress;
use blade::Blade;
use geometry::Aabb;
use io::{ProgramHeader, apt_cl, exr, ply_write, png, stl_write};
use machine::kinematics::{JointPath, JointReport};
use machine::slow_corners;
use metrology::{
    Asked, Measurement, PAIRS_HEADER, RemovalFigures, contact_arcs, measure, path_figures, removal_figures,
};
use motion::Toolpath;
use part::Part;
use report::{
    FieldFigures, HIGHEST_RIDGE, Histogram, MAX_TRIANGLES, MachineFigures, MapSize, MapWords, Picture,
    RunReport, ShortestFigures, SimulationFigures, SurfaceMeshFigures, ToolpathPage, ToolpathResult, Verdict,
    collision, comb_picture, deviation_colours, deviation_picture, field_picture, height_picture,
    holder_note, html_page, interval_picture, marks, rapid_violation, result_table, surface_mesh, violations,
    wall_violation,
};
use scene::{Engine, PartSource, Scene, ToolpathRequest, auto_cell};
use sim::{Grid, GridError, ZMap, cut, cut_in_order, cut_reference, holder_collisions};
use toolpath::{
    Engagement, OffsetDrive, OffsetSurface, Plan, PlanError, PlanSettings, Pocket, PocketStrategy, Strategy,
    plan, plan_pocket,
};
use work::monitor;
use work::monitor::Monitor as _;
use work::parallel;

/// Bytes a cell that a run takes at its peak: stock and winning moves 8, deviations 12, ridges 16 where
/// every cell has one, the mesh of the surface and height.exr the rest. The peak resident memory of
/// whole runs, less the program's own 12 MiB, was 75 with passes one cell apart, 61 with two or more
/// and on the wave. Too small a figure lets a run exhaust the machine that the scene's `memory_mib`
/// promised to spare; too great a one refuses grids that would fit.
const BYTES_PER_CELL: usize = 80;

/// Bytes a cell while a path has been cut and nothing measured yet.
const BYTES_PER_CUT_CELL: usize = 8;

/// Bytes a triangle of the part while it is read: its file, corners, neighbours, search tree; 345 were
/// measured on an STL file of 880 000.
const BYTES_PER_TRIANGLE: usize = 350;

/// Bytes a move: the move itself, its prepared form, and its places in the engine's lists.
const BYTES_PER_MOVE: usize = 240;

/// One part in so many of the memory is kept for the path before there is one. If a path takes more,
/// the cells are laid out again; a smaller share refuses fewer grids that would fit.
const PATH_SHARE: u64 = 16;

const MIB: u64 = 1 << 20;

/// The machined part's triangles stay within this share of the scallop tolerance: ridges remain
/// visible in them.
const MESH_SHARE: f64 = 0.25;

/// Thickness of machined.stl below the lowest point, mm.
const BASE: f64 = 5.0;

/// What a run hands back to the command line.
#[derive(Debug)]
pub struct RunOutcome {
    /// The result table.
    pub text: String,
    /// Whether every tolerance holds.
    pub verdict: Verdict,
}

/// Runs a scene and writes its results.
///
/// # Errors
/// [`CliError`]; nothing is written then.
pub fn run(options: &RunOptions, progress: &Progress) -> Result<RunOutcome, CliError> {
    let mut pool = rayon::ThreadPoolBuilder::new();
    if let Some(threads) = options.threads {
        pool = pool.num_threads(usize::from(threads));
    }
    let pool = pool.build().map_err(|e| CliError::Threads(e.to_string()))?;
    pool.install(|| run_scene(options, progress))
}

/// The scene with what the command line says in its stead.
fn read_scene(options: &RunOptions) -> Result<Scene, CliError> {
    let mut scene = Scene::read(&options.scene)?;
    match options.cell {
        Some(Cell::Mm(cell)) => (scene.simulation.cell, scene.simulation.cell_is_auto) = (cell, false),
        Some(Cell::Auto) => {
            scene.simulation.cell = auto_cell(&scene.cutter, &scene.toolpaths);
            scene.simulation.cell_is_auto = true;
        }
        None => {}
    }
    if let Some(memory) = options.memory {
        scene.simulation.memory_mib = memory;
    }
    if let Some(engine) = options.engine.as_deref().and_then(Engine::from_word) {
        scene.simulation.engine = engine;
    }
    Ok(scene)
}

fn run_scene(options: &RunOptions, progress: &Progress) -> Result<RunOutcome, CliError> {
    let scene = read_scene(options)?;
    let job = Job::new(&scene, progress)?;
    let target = options.out.clone().unwrap_or_else(|| default_target(&options.scene));
    let outputs = Outputs::begin(&target)?;
    let mut results = Vec::with_capacity(scene.toolpaths.len());
    let mut pages = Vec::with_capacity(scene.toolpaths.len());
    for request in &scene.toolpaths {
        progress.belongs_to(&request.name);
        let (result, page) = job.toolpath(request, &outputs)?;
        results.push(result);
        pages.push(page);
    }
    if let Some(blade) = &job.blade {
        write_combs(blade, &outputs)?;
    }
    let name = options.scene.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let report =
        RunReport::new(name, sha256(&scene.source.text), scene.title.clone(), &scene.tolerance, results);
    let json = report.to_json()?;
    let page = html_page(&report, &pages, &scene.source.text);
    outputs.file("report.html", |out| out.write_all(page.as_bytes()))?;
    outputs.file("report.json", |out| out.write_all(json.as_bytes()))?;
    monitor::check(progress)?;
    outputs.publish()?;
    let text = format!("{}Results: {}\n", result_table(&report), target.display());
    Ok(RunOutcome { text, verdict: report.verdict })
}

/// Writes the curvature combs of a blade's sections into the folder `sections`.
fn write_combs(blade: &Blade, outputs: &Outputs) -> Result<(), CliError> {
    outputs.folder("sections")?;
    let mut number = 0;
    for (k, section) in blade.sections.iter().enumerate() {
        let above = k.checked_sub(1).is_none_or(|k| blade.sections[k].height < section.height);
        number += usize::from(above);
        let title = format!("Section {number}, {}, height {} mm", section.curve, section.height);
        let picture =
            comb_picture(&title, &section.spline, section.faired.as_ref().map(|faired| &faired.spline));
        let name = format!("sections/{number:02}-{}.svg", section.curve.to_string().replace(' ', "-"));
        outputs.file(&name, |out| out.write_all(picture.as_bytes()))?;
    }
    Ok(())
}

/// `out/NAME` in the working folder.
fn default_target(scene: &Path) -> PathBuf {
    Path::new("out").join(scene.file_stem().unwrap_or("scene".as_ref()))
}

fn sha256(text: &str) -> String {
    use sha2::Digest as _;
    sha2::Sha256::digest(text.as_bytes()).iter().map(|byte| format!("{byte:02x}")).collect()
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

/// The grid over the part's stock when all else takes `besides` bytes, and a note when the automatic
/// cell had to grow to fit into the memory. A cell that the user chose is never changed.
///
/// # Errors
/// [`GridError`] when the grid does not fit.
fn lay_out(scene: &Scene, part: &Part, besides: u64) -> Result<(Grid, Option<String>), GridError> {
    let area = &stock_area(scene, part);
    let memory = (u64::from(scene.simulation.memory_mib) * MIB).saturating_sub(besides);
    let cell = scene.simulation.cell;
    match Grid::covering(area, cell, BYTES_PER_CELL, memory) {
        Ok(grid) => Ok((grid, None)),
        Err(GridError::Memory { fitting, .. }) if scene.simulation.cell_is_auto => {
            let grid = Grid::covering(area, fitting, BYTES_PER_CELL, memory)?;
            let allowed = scene.simulation.memory_mib;
            Ok((
                grid,
                Some(format!("the cell is {fitting} mm instead of {cell} mm, to fit into {allowed} MiB")),
            ))
        }
        Err(error) => Err(error),
    }
}

/// Bytes that a part takes.
fn part_bytes(part: &Part) -> u64 {
    (part.mesh().triangles().len() * BYTES_PER_TRIANGLE) as u64
}

/// [`lay_out`] before any toolpath is known: a share of the memory is kept for those.
///
/// # Errors
/// [`GridError`] when the grid does not fit.
pub fn lay_out_before_planning(scene: &Scene, part: &Part) -> Result<(Grid, Option<String>), GridError> {
    let memory = u64::from(scene.simulation.memory_mib) * MIB;
    lay_out(scene, part, part_bytes(part) + memory / PATH_SHARE)
}

/// [`lay_out`] for a planned path. The first grid stays where it fits.
///
/// # Errors
/// [`GridError`] when the grid does not fit.
fn lay_out_for(
    scene: &Scene,
    part: &Part,
    first: &(Grid, Option<String>),
    path: &Toolpath,
) -> Result<(Grid, Option<String>), GridError> {
    let memory = u64::from(scene.simulation.memory_mib) * MIB;
    let besides = part_bytes(part) + (path.len() * BYTES_PER_MOVE) as u64;
    if (first.0.len() * BYTES_PER_CELL) as u64 + besides <= memory {
        return Ok(first.clone());
    }
    lay_out(scene, part, besides)
}

/// What all toolpaths of a scene share.
struct Job<'a> {
    scene: &'a Scene,
    progress: &'a Progress,
    part: Part,
    /// The sections that the part comes from, if it is a blade.
    blade: Option<Blade>,
    /// What the part is the floor of, if it is a pocket.
    pocket: Option<Pocket>,
    /// The cells, and what is to be said about them, if a path leaves memory for them.
    grid: (Grid, Option<String>),
    /// Height of the stock's flat top, mm.
    top: f64,
    notes: Vec<String>,
}

impl<'a> Job<'a> {
    fn new(scene: &'a Scene, progress: &'a Progress) -> Result<Self, CliError> {
        monitor::check(progress)?;
        let Loaded { part, blade, notes } = load_part(scene)?;
        let pocket = load_pocket(scene)?;
        let grid = lay_out_before_planning(scene, &part).map_err(CliError::grid(scene))?;
        let face = if pocket.is_some() { 0.0 } else { part.bounds().max.z };
        let top = face + scene.stock.allowance;
        Ok(Self { scene, progress, part, blade, pocket, grid, top, notes })
    }

    fn settings(&self, request: &ToolpathRequest) -> PlanSettings {
        PlanSettings {
            step: request.step,
            chord_tolerance: self.scene.tolerance.chord,
            clearance: self.scene.clearance,
            stock_top: self.top,
            feed_rate: self.scene.cutting.feed_rate,
            plunge_rate: self.scene.cutting.plunge_rate,
            rapid_rate: self.scene.machine.rapid_rate,
            joining: request.joining,
        }
    }

    /// The strategy of a toolpath, with the offset surfaces that it rides on where these come from sections.
    fn strategy(&self, request: &ToolpathRequest) -> Result<Box<dyn Strategy>, CliError> {
        let asked = request.strategy.downcast_ref::<OffsetSurface>();
        let (Some(OffsetSurface { along, drive: OffsetDrive::InPlane }), Some(blade)) = (asked, &self.blade)
        else {
            return Ok(request.strategy.clone());
        };
        let surfaces = blade.offset_in_planes(self.scene.cutter.radius()).map_err(|e| {
            let reason = PlanError::NotApplicable { strategy: "offset-surface", reason: e.to_string() };
            CliError::plan(self.scene, &request.name, reason)
        })?;
        Ok(Box::new(OffsetSurface { along: *along, drive: OffsetDrive::on(surfaces) }))
    }

    /// Plans, cuts and measures one toolpath and writes its folder.
    fn toolpath(
        &self,
        request: &ToolpathRequest,
        outputs: &Outputs,
    ) -> Result<(ToolpathResult, ToolpathPage), CliError> {
        let (scene, monitor) = (self.scene, self.progress);
        monitor::check(monitor)?;
        let engine = scene.simulation.engine.for_path(request.axis.is_some());
        if matches!(engine, Engine::Rays | Engine::Voxel) {
            if self.pocket.is_some() {
                let (scene, name) = (scene.source.name.clone(), request.name.clone());
                return Err(CliError::PocketAlongNormals { scene, name });
            }
            return self.along_normals(request, engine, outputs);
        }
        if request.axis.is_some() {
            return Err(CliError::engine(scene, &request.name, engine));
        }
        let settings = self.settings(request);
        let strategy = self.strategy(request)?;
        let milled = self.pocket.as_ref().zip(request.strategy.downcast_ref::<PocketStrategy>());
        let mut planned = match milled {
            Some((pocket, strategy)) => plan_pocket(pocket, &scene.cutter, strategy, &settings, monitor),
            None => plan(&self.part, &scene.cutter, &*strategy, &settings, monitor),
        }
        .map_err(|reason| CliError::plan(scene, &request.name, reason))?;
        if scene.machine.slow_corners {
            planned.path = slow_corners(&planned.path, &scene.machine);
        }
        let joints = program::joints(scene, &request.name, &planned.path)?;
        let (grid, note) =
            lay_out_for(scene, &self.part, &self.grid, &planned.path).map_err(CliError::grid(scene))?;
        let begun = Instant::now();
        let stock = ZMap::block(grid, self.top);
        let cut = match engine {
            Engine::Reference => cut_reference(&stock, &scene.cutter, &planned.path, monitor)?,
            _ => cut(stock, &scene.cutter, &planned.path, monitor)?,
        };
        let besides = part_bytes(&self.part) + (planned.path.len() * BYTES_PER_MOVE) as u64;
        let memory = (u64::from(scene.simulation.memory_mib) * MIB).saturating_sub(besides);
        let mut engaged = (Engagement::default(), 0.0);
        if let Some((_, strategy)) = milled {
            let left = memory.saturating_sub((grid.len() * BYTES_PER_CUT_CELL) as u64);
            let arcs = contact_arcs(&planned.path, &scene.cutter, self.top, left, monitor)?;
            let radius = scene.cutter.radius();
            engaged = limit_feed_by(&mut planned.path, &arcs, strategy, request.step, radius);
        }
        let mut removal = None;
        if scene.simulation.removal {
            let stock = ZMap::block(grid, self.top);
            let removed = cut_in_order(stock, &scene.cutter, &planned.path, monitor)?;
            removal = Some(removal_figures(&planned.path, &removed, &cut.height));
        }
        let most_cells = (memory as usize / BYTES_PER_CELL).saturating_sub(grid.len());
        let asked = Asked { error_bound: scene.simulation.error_bound, stock_top: self.top, most_cells };
        let mut measured =
            measure(&self.part, &scene.cutter, &planned.path, &cut, &scene.tolerance, &asked, monitor)?;
        let check = |holder| holder_collisions(&cut, holder, &planned.path, monitor);
        let held = scene.holder.as_ref().map(check).transpose()?;
        let roughness = match milled {
            None => Some(self.roughness(request, &planned.path, &measured)?),
            Some(_) => None,
        };
        let simulation = SimulationFigures {
            engine: engine.name(),
            cell_mm: grid.cell,
            cells: grid.len(),
            error_bound_asked_mm: asked.error_bound,
            refined_rectangles: measured.refined.rectangles,
            finest_cell_mm: measured.refined.finest_cell,
            moves: planned.path.len(),
            wall_s: begun.elapsed().as_secs_f64(),
            threads: rayon::current_num_threads(),
        };
        monitor::check(monitor)?;
        monitor.start("writing results", 0);
        outputs.folder(&request.folder)?;
        let programs = || self.write_programs(request, &planned, joints.as_ref(), outputs);
        let maps = || self.write_maps(request, &planned, &cut, &measured, outputs);
        let mesh = || self.write_mesh(request, &planned.path, &cut, &measured, outputs);
        self.write_pairs(request, &measured, outputs)?;
        let (surface_mesh, (page, lines)) = parallel::join(mesh, || parallel::join(maps, programs));
        let (surface_mesh, page, lines) = (surface_mesh?, page?, lines?);
        for region in &mut measured.gouge.regions {
            region.line = lines.get(region.move_index as usize).copied().unwrap_or_default();
        }
        for contact in removal.iter_mut().flat_map(|removal| &mut removal.rapid_contacts) {
            contact.line = lines.get(contact.move_index as usize).copied().unwrap_or_default();
        }
        let solid = self.write_solid(request, &planned.path, outputs)?;
        let mut result = self.result(
            request,
            &planned,
            joints.as_ref(),
            note,
            measured,
            removal,
            simulation,
            surface_mesh,
        );
        result.solid = solid;
        result.roughness = roughness;
        self.add_offset(&*strategy, &mut result);
        if let Some((pocket, strategy)) = milled {
            let figures =
                pocket_figures(scene, pocket, strategy, request.step, &planned.path, &cut, self.top, engaged);
            if let Some(violation) = wall_violation(&figures, &scene.tolerance, &lines) {
                result.violations.insert(0, violation);
                result.verdict = Verdict::Fail;
            }
            result.pocket = Some(figures);
        }
        if let Some(held) = held {
            result.notes.push(holder_note(&held));
            if let Some(violation) = collision(&held, &lines) {
                result.violations.insert(0, violation);
                result.verdict = Verdict::Fail;
            }
        }
        Ok((result, page))
    }

    fn result(
        &self,
        request: &ToolpathRequest,
        planned: &Plan,
        joints: Option<&JointPath>,
        note: Option<String>,
        measured: Measurement,
        removal: Option<RemovalFigures>,
        simulation: SimulationFigures,
        surface_mesh: SurfaceMeshFigures,
    ) -> ToolpathResult {
        let rapid = removal.as_ref().and_then(rapid_violation);
        let violations: Vec<_> =
            rapid.into_iter().chain(violations(&measured, &self.scene.tolerance)).collect();
        let time = program::time(self.scene, &planned.path, joints);
        let path = path_figures(&planned.path, time);
        ToolpathResult {
            name: request.name.clone(),
            strategy: request.strategy_name().to_owned(),
            folder: request.folder.clone(),
            verdict: if violations.is_empty() { Verdict::Pass } else { Verdict::Fail },
            violations,
            notes: self
                .notes
                .iter()
                .chain(&note)
                .chain(&measured.refined.note)
                .chain(&planned.notes)
                .cloned()
                .chain(joints.and_then(|joints| machine_note(&joints.report)))
                .collect(),
            path,
            shortest: planned
                .shortest
                .and_then(|shortest| ShortestFigures::new(&shortest, path.cutting_length_mm)),
            field: planned.field.as_ref().map(FieldFigures::new),
            machine: joints
                .zip(self.scene.five_axis.as_ref())
                .map(|(joints, five_axis)| MachineFigures::new(&five_axis.kinematics, &joints.report)),
            scallop: measured.scallop,
            scallop_pairs: measured.pairs,
            roughness: None,
            gouge: measured.gouge,
            uncut: measured.uncut,
            deviation: measured.deviation,
            sections: Vec::new(),
            removal,
            pocket: None,
            solid: None,
            offset: None,
            simulation,
            surface_mesh,
        }
    }

    /// Writes toolpath.nc and toolpath.cls; leaves the line of each move in the former.
    fn write_programs(
        &self,
        request: &ToolpathRequest,
        planned: &Plan,
        joints: Option<&JointPath>,
        outputs: &Outputs,
    ) -> Result<Vec<u32>, CliError> {
        let (path, cutter) = (&planned.path, &self.scene.cutter);
        let header = ProgramHeader {
            name: format!("{} - {}", self.scene.title, request.name),
            spindle_speed: Some(self.scene.cutting.spindle_speed),
        };
        let file = |name: &str| format!("{}/{name}", request.folder);
        outputs.file(&file("toolpath.cls"), |out| apt_cl::write(out, path, cutter, &header))?;
        program::write_gcode(self.scene, path, joints, &header, outputs, &file("toolpath.nc"))
    }

    /// Writes scallop_pairs.csv.
    fn write_pairs(
        &self,
        request: &ToolpathRequest,
        measured: &Measurement,
        outputs: &Outputs,
    ) -> Result<(), CliError> {
        outputs.file(&format!("{}/scallop_pairs.csv", request.folder), |out| {
            writeln!(out, "{PAIRS_HEADER}")?;
            measured.pairs.pairs.iter().try_for_each(|pair| writeln!(out, "{}", pair.csv()))
        })
    }

    /// Writes height.exr and the pictures; leaves what the page shows.
    fn write_maps(
        &self,
        request: &ToolpathRequest,
        planned: &Plan,
        cut: &ZMap,
        measured: &Measurement,
        outputs: &Outputs,
    ) -> Result<ToolpathPage, CliError> {
        let exr = || {
            let name = format!("{}/height.exr", request.folder);
            let bytes =
                exr::encode(cut, &measured.deviation_map).map_err(CliError::output(Path::new(&name)))?;
            outputs.file(&name, |out| out.write_all(&bytes))
        };
        let pictures = || self.write_pictures(request, planned, cut, measured, outputs);
        let (exr, pictures) = parallel::join(exr, pictures);
        exr?;
        let pictures = pictures?;
        let scallop = self.scene.tolerance.scallop;
        let histogram = Histogram::new(&measured.ridge_samples, scallop, HIGHEST_RIDGE * scallop);
        Ok(ToolpathPage { histogram, ..pictures })
    }

    /// Writes deviation.png, height.png, and field.png and interval.png of streamlines; leaves the smaller ones for the
    /// page.
    fn write_pictures(
        &self,
        request: &ToolpathRequest,
        planned: &Plan,
        cut: &ZMap,
        measured: &Measurement,
        outputs: &Outputs,
    ) -> Result<ToolpathPage, CliError> {
        let (scene, grid, deviation) = (self.scene, &cut.grid, &measured.deviation_map);
        let cell = format!("{} mm", grid.cell);
        let engine = scene.simulation.engine.for_path(false).name();
        let subtitle = format!("{} · cell {cell} · engine {engine}", scene.title);
        let notes = [("Title", scene.title.as_str()), ("Scene", &scene.source.name), ("Cell", &cell)];
        let both = |name: &str, draw: &dyn Fn(MapSize) -> Picture| {
            let name = format!("{}/{name}", request.folder);
            let encode = |size| png::encode(&draw(size), &notes).map_err(CliError::output(Path::new(&name)));
            let bytes = encode(MapSize::File)?;
            outputs.file(&name, |out| out.write_all(&bytes))?;
            encode(MapSize::Page)
        };
        let (deviations, heights) =
            (format!("Deviation, {}", request.name), format!("Height, {}", request.name));
        let (fields, intervals) =
            (format!("Feed directions, {}", request.name), format!("Interval of passes, {}", request.name));
        let marks = marks(measured, &scene.tolerance);
        let words = |title, marks| MapWords { title, subtitle: &subtitle, marks, axes: ["x", "y"] };
        let (deviation_png, height_png) = parallel::join(
            || {
                both("deviation.png", &|size| {
                    deviation_picture(grid, deviation, &scene.tolerance, &words(&deviations, &marks), size)
                })
            },
            || both("height.png", &|size| height_picture(grid, &cut.height, &words(&heights, &[]), size)),
        );
        let field_pngs = planned.field.as_ref().map(|field| {
            let (field, interval) = parallel::join(
                || {
                    both("field.png", &|size| {
                        field_picture(grid, deviation, field, &words(&fields, &[]), size)
                    })
                },
                || {
                    both("interval.png", &|size| {
                        interval_picture(grid, deviation, field, &words(&intervals, &[]), size)
                    })
                },
            );
            Ok::<_, CliError>([field?, interval?])
        });
        let field_pngs = field_pngs.transpose()?;
        Ok(ToolpathPage {
            deviation_png: deviation_png?,
            height_png: Some(height_png?),
            field_pngs,
            histogram: None,
        })
    }

    fn write_mesh(
        &self,
        request: &ToolpathRequest,
        path: &Toolpath,
        cut: &ZMap,
        measured: &Measurement,
        outputs: &Outputs,
    ) -> Result<SurfaceMeshFigures, CliError> {
        let tolerance = MESH_SHARE * self.scene.tolerance.scallop;
        let lowest = cut.height.iter().copied().fold(f32::INFINITY, f32::min);
        let bottom = f64::from(lowest).min(self.part.bounds().min.z) - BASE;
        // A grid of one row has no surface; its file then holds no triangle.
        let mesh = surface_mesh(cut, &self.scene.cutter, path, bottom, tolerance, MAX_TRIANGLES);
        let (vertices, triangles): (&[_], &[_]) =
            mesh.as_ref().map_or((&[], &[]), |m| (&m.vertices, &m.triangles));
        outputs.file(&format!("{}/machined.stl", request.folder), |out| {
            stl_write::write(out, vertices, triangles)
        })?;
        let deviations =
            mesh.as_ref().map_or_else(Vec::new, |m| m.deviations(&self.part, &measured.deviation_map));
        let colours = deviation_colours(&deviations, &self.scene.tolerance);
        outputs.file(&format!("{}/machined.ply", request.folder), |out| {
            let vertices =
                ply_write::Vertices { places: vertices, colours: &colours, deviations: &deviations };
            ply_write::write(out, &vertices, triangles)
        })?;
        let tolerance_mm = mesh.as_ref().map_or(tolerance, |m| m.tolerance);
        Ok(SurfaceMeshFigures { triangles: triangles.len(), tolerance_mm })
    }
}

/// What the user should know of how the machine moves.
fn machine_note(report: &JointReport) -> Option<String> {
    let (poses, rewinds) = (report.singular.len(), report.rewinds.len());
    (poses + rewinds > 0).then(|| {
        format!(
            "the rotary joints come within a degree of a singular pose {poses} times, and unwind {rewinds} times \
             between passes"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What every toolpath's folder holds.
    const FILES: [&str; 8] = [
        "deviation.png",
        "height.png",
        "height.exr",
        "toolpath.nc",
        "toolpath.cls",
        "machined.stl",
        "machined.ply",
        "scallop_pairs.csv",
    ];

    const PLATE: &str = "[part]\nsurface = \"plane\"\nx = [0, 8]\ny = [0, 6]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n\
        [tolerance]\nscallop = 0.0105\n[simulation]\ncell = 0.1\n[[toolpath]]\nstrategy = \"zigzag\"\nstepover = 0.5\n";

    fn options(folder: &Path, scene: &str, threads: u16) -> RunOptions {
        let path = folder.join("plate.toml");
        std::fs::write(&path, scene).unwrap();
        let out = Some(folder.join(format!("out{threads}")));
        RunOptions { scene: path, out, threads: Some(threads), cell: None, memory: None, engine: None }
    }

    #[test]
    fn a_plate_passes_and_leaves_every_file_of_the_contract() {
        let home = tempfile::tempdir().unwrap();
        let options = options(home.path(), PLATE, 1);
        let outcome = run(&options, &Progress::quiet()).unwrap();
        assert_eq!(outcome.verdict, Verdict::Pass, "{}", outcome.text);
        let out = options.out.unwrap();
        for name in FILES {
            assert!(out.join("zigzag").join(name).metadata().unwrap().len() > 100, "{name}");
        }
        let json: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(out.join("report.json")).unwrap()).unwrap();
        // A ball of radius 3 between passes 0.5 apart.
        let closed_form = 3.0 - (9.0 - 0.0625f64).sqrt();
        let measured = &json["toolpaths"][0]["scallop"];
        let error = (measured["max_mm"].as_f64().unwrap() - closed_form).abs();
        assert!(error <= measured["error_bound_mm"].as_f64().unwrap() + 1e-9, "{error}");
        assert!(std::fs::read_to_string(out.join("report.html")).unwrap().contains("PASS"));
    }

    /// Two engines on one path: the z-map in the order of the program, and voxels.
    #[test]
    fn voxels_lose_the_volume_that_the_z_map_does() {
        let home = tempfile::tempdir().unwrap();
        let options = options(home.path(), &PLATE.replace("cell = 0.1\n", "cell = 0.05\nvoxel = 0.1\n"), 2);
        run(&options, &Progress::quiet()).unwrap();
        let out = options.out.unwrap();
        let json: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(out.join("report.json")).unwrap()).unwrap();
        let [a, b] = ["/toolpaths/0/removal/volume_mm3", "/toolpaths/0/solid/removed_mm3"]
            .map(|figure| json.pointer(figure).and_then(serde_json::Value::as_f64).unwrap());
        assert!((a / b - 1.0).abs() < 2e-3, "{a} {b}");
        let bounds =
            ["/toolpaths/0/removal/volume_error_bound_mm3", "/toolpaths/0/solid/removed_error_bound_mm3"]
                .map(|bound| json.pointer(bound).and_then(serde_json::Value::as_f64).unwrap());
        assert!((a - b).abs() <= bounds[0] + bounds[1], "{a} {b} {bounds:?}");
        assert!(bounds[1] < 0.02 * b, "{b} {bounds:?}");
        let (mesh, _) = io::stl::read(&out.join("zigzag/solid.stl")).unwrap();
        assert!(mesh.is_closed());
    }

    #[test]
    fn pockets_are_not_measured_by_rays() {
        let home = tempfile::tempdir().unwrap();
        let pocket = "[part]\nsurface = \"pocket\"\noutline = [[0, 0], [30, 0], [30, 20], [0, 20]]\ndepth = 2\n[cutter]\n\
            shape = \"flat\"\ndiameter = 6\n[simulation]\nengine = \"rays\"\n[[toolpath]]\nstrategy = \"pocket-offset\"\n";
        let error = run(&options(home.path(), pocket, 1), &Progress::quiet()).unwrap_err();
        assert!(matches!(error, CliError::PocketAlongNormals { .. }), "{error}");
    }

    #[test]
    fn a_holder_that_meets_the_slope_is_a_collision() {
        let home = tempfile::tempdir().unwrap();
        let report = |name: &str, holder: &str| -> serde_json::Value {
            let scene = PLATE.replace("\"plane\"", "\"inclined_plane\"\nangle = 30");
            let folder = home.path().join(name);
            std::fs::create_dir(&folder).unwrap();
            let options = options(&folder, &format!("{scene}{holder}"), 2);
            run(&options, &Progress::quiet()).unwrap();
            serde_json::from_str(&std::fs::read_to_string(options.out.unwrap().join("report.json")).unwrap())
                .unwrap()
        };
        // The slope rises by 4.6 mm: over its foot a holder 3 mm above the tip stands in its head.
        let wide = "[holder]\ncutting_length = 3\n[[holder.section]]\ndiameter = 40\nlength = 30\n";
        let hit = report("wide", wide);
        let violation = &hit["toolpaths"][0]["violations"][0];
        assert_eq!(
            (&violation["what"], &hit["toolpaths"][0]["verdict"]),
            (&"collision".into(), &"fail".into())
        );
        let depth = violation["measured_mm"].as_f64().unwrap();
        assert!(depth > 0.5 && depth < 8.0 * 30f64.to_radians().tan() - 3.0 + 1.0, "{depth}");
        assert!(violation["text"].as_str().unwrap().contains("toolpath.nc line "), "{violation}");
        let clear = report("slim", &wide.replace("= 3\n", "= 12\n"));
        let notes = clear["toolpaths"][0]["notes"].to_string();
        assert!(notes.contains("above the finished stock"), "{notes}");
        let collides = |v: &serde_json::Value| v["what"] == "collision";
        assert!(!clear["toolpaths"][0]["violations"].as_array().unwrap().iter().any(collides));
    }

    #[test]
    fn a_ball_by_its_seven_words_measures_as_a_ball() {
        let home = tempfile::tempdir().unwrap();
        let scallop = |name: &str, cutter: &str| {
            let folder = home.path().join(name);
            std::fs::create_dir(&folder).unwrap();
            // Bends between passes leave other grooves beside the plate.
            let scene = PLATE.replace("\"ball\"\ndiameter = 6", cutter) + "links = \"retract\"\n";
            let options = options(&folder, &scene, 1);
            run(&options, &Progress::quiet()).unwrap();
            let json = std::fs::read_to_string(options.out.unwrap().join("report.json")).unwrap();
            let json: serde_json::Value = serde_json::from_str(&json).unwrap();
            json["toolpaths"][0]["scallop"]["max_mm"].as_f64().unwrap()
        };
        let ball = scallop("ball", "\"ball\"\ndiameter = 6");
        let words = scallop("words", "\"apt\"\ndiameter = 6\ncorner_radius = 3\nlength = 10");
        assert!((ball - words).abs() < 1e-12, "{ball} {words}");
        // A point of 20 degrees leaves grooves of half the stepover times its tangent.
        let point = scallop("point", "\"apt\"\ndiameter = 6\ntip_angle = 20\nlength = 10");
        assert!((point - 0.25 * 20f64.to_radians().tan()).abs() < 1e-9, "{point}");
    }

    #[test]
    fn threads_change_nothing_but_the_time() {
        let home = tempfile::tempdir().unwrap();
        let read = |threads: u16| {
            let options = options(home.path(), PLATE, threads);
            run(&options, &Progress::quiet()).unwrap();
            let out = options.out.unwrap();
            let mut json: serde_json::Value =
                serde_json::from_str(&std::fs::read_to_string(out.join("report.json")).unwrap()).unwrap();
            json["toolpaths"][0]["simulation"]["wall_s"] = 0.into();
            json["toolpaths"][0]["simulation"]["threads"] = 0.into();
            (json, FILES.map(|name| std::fs::read(out.join("zigzag").join(name)).unwrap()))
        };
        assert!(read(1) == read(3));
    }

    #[test]
    fn a_wish_to_stop_leaves_nothing_behind() {
        let home = tempfile::tempdir().unwrap();
        let options = options(home.path(), PLATE, 1);
        let progress = Progress::quiet();
        progress.stop();
        assert!(matches!(run(&options, &progress), Err(CliError::Interrupted)));
        assert_eq!(std::fs::read_dir(home.path()).unwrap().count(), 1, "only the scene is there");
    }

    #[test]
    fn a_chosen_cell_is_kept_or_refused_and_a_default_one_grows() {
        let scene = |simulation: &str| {
            let text = PLATE.replace("[simulation]\ncell = 0.1\n", simulation).replace("[0, 8]", "[0, 800]");
            Scene::parse("plate.toml", text).unwrap()
        };
        let part = load_part(&scene("")).unwrap().part;
        let lay_out_of = |scene: &Scene| lay_out_before_planning(scene, &part);
        let (grid, note) = lay_out_of(&scene("[simulation]\nmemory_mib = 2\n")).unwrap();
        assert!(grid.cell > 0.05 && grid.len() * BYTES_PER_CELL <= 2 << 20);
        assert!(note.unwrap().contains("instead of 0.05 mm, to fit into 2 MiB"));
        let chosen = scene("[simulation]\nmemory_mib = 2\ncell = 0.05\n");
        assert!(matches!(lay_out_of(&chosen), Err(GridError::Memory { .. })));
    }
}
