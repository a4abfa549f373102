//! `millstream run`: a scene's job, its progress, and its files.

mod maps;
#[cfg(test)]
mod tests;
mod write;

use std::path::{Path, PathBuf};

use job::Session;
use report::{Verdict, html_page, junit, result_table};
use scene::{EngineChoice, PartSource, Scene, auto_cell, printable_lines};
use work::monitor;

use super::args::{Cell, Format, RunOptions};
use super::error::{CliError, shown};
use super::outputs::{Claims, Outputs};
use super::progress::Progress;

/// What a run hands back to the command line.
#[derive(Debug)]
pub struct RunOutcome {
    /// The result table.
    pub text: String,
    /// Whether every limit holds.
    pub verdict: Verdict,
}

/// Runs a scene and writes its results.
///
/// # Errors
/// [`CliError`]; nothing is written then.
pub fn run(options: &RunOptions, progress: &Progress) -> Result<RunOutcome, CliError> {
    on_threads(options.threads, || {
        let mut scene = Scene::read(&options.scene)?;
        Chosen { cell: options.cell, memory: options.memory, engine: options.engine }.apply(&mut scene);
        monitor::check(progress)?;
        let target = options.out.clone().unwrap_or_else(|| default_target(&options.scene));
        let inputs = vec![options.scene.clone()];
        run_scene(scene, &Target { target, inputs, format: Format::Text }, progress)
    })
}

/// Runs something on so many threads.
pub fn on_threads<T: Send>(
    threads: Option<u16>,
    body: impl FnOnce() -> Result<T, CliError> + Send,
) -> Result<T, CliError> {
    let mut pool = rayon::ThreadPoolBuilder::new();
    if let Some(threads) = threads {
        pool = pool.num_threads(usize::from(threads));
    }
    let pool = pool.build().map_err(|e| CliError::Threads(e.to_string()))?;
    pool.install(body)
}

/// What the command line says of the simulation in the scene's stead.
#[derive(Debug, Clone, Copy)]
pub struct Chosen {
    /// Pitch of the cells.
    pub cell: Option<Cell>,
    /// Memory, MiB.
    pub memory: Option<u32>,
    /// The engine.
    pub engine: Option<EngineChoice>,
}

impl Chosen {
    /// Puts it into a scene.
    pub fn apply(&self, scene: &mut Scene) {
        match self.cell {
            Some(Cell::Mm(cell)) => (scene.simulation.cell, scene.simulation.cell_is_auto) = (cell, false),
            Some(Cell::Auto) => {
                scene.simulation.cell = auto_cell(&scene.toolpaths);
                scene.simulation.cell_is_auto = true;
            }
            None => {}
        }
        if let Some(memory) = self.memory {
            scene.simulation.memory_mib = memory;
        }
        if let Some(engine) = self.engine {
            scene.simulation.engine = engine;
        }
    }
}

/// Where results go, and what is printed.
#[derive(Debug)]
pub struct Target {
    /// The folder.
    pub target: PathBuf,
    /// Files that were read besides those that the scene names.
    pub inputs: Vec<PathBuf>,
    /// What is printed.
    pub format: Format,
}

/// Runs a scene, writes its results, and leaves what is printed.
///
/// # Errors
/// [`CliError`]; nothing is written then.
pub fn run_scene(scene: Scene, to: &Target, progress: &Progress) -> Result<RunOutcome, CliError> {
    let target = &to.target;
    let outputs = Outputs::begin(target, &claims(&to.inputs, &scene))?;
    progress.watched().discard_by(outputs.discarding());
    progress.watched().allow_memory(scene.simulation.memory_mib, work::parallel::threads());
    let session = Session::load(scene, progress)?;
    let mut pages = Vec::new();
    let report = session.run_each(progress, &mut |outcome| {
        pages.push(write::toolpath(&session, outcome, &outputs, progress)?);
        Ok::<(), CliError>(())
    })?;
    if let Some(blade) = &session.blade {
        write::combs(blade, &outputs)?;
    }
    let json = report.to_json().map_err(job::JobError::from)?;
    let page = printable_lines(&html_page(&report, &pages, &session.scene.source.text));
    outputs.file("report.html", |out| out.write_all(page.as_bytes()))?;
    outputs.file("report.json", |out| out.write_all(json.as_bytes()))?;
    monitor::check(progress)?;
    progress.watched().commit();
    outputs.publish()?;
    let text = match to.format {
        Format::Text => format!("{}Results: {}\n", result_table(&report), shown(target)),
        Format::Json => json,
        Format::Html => page,
        Format::Junit => junit(&report),
    };
    Ok(RunOutcome { text, verdict: report.verdict })
}

/// What the run writes and reads.
fn claims(inputs: &[PathBuf], scene: &Scene) -> Claims {
    let sections = matches!(scene.part, PartSource::Blade(_)).then(|| write::SECTIONS.to_owned());
    Claims {
        files: &["report.html", "report.json"],
        folders: scene.toolpaths.iter().map(|request| request.folder.clone()).chain(sections).collect(),
        inputs: scene.files().map(|file| file.path.clone()).chain(inputs.iter().cloned()).collect(),
    }
}

/// `out/NAME` in the working folder.
pub fn default_target(scene: &Path) -> PathBuf {
    Path::new("out").join(scene.file_stem().unwrap_or("scene".as_ref()))
}
