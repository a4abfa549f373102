//! `millstream run`: a scene's job, its progress, and its files.

mod maps;
#[cfg(test)]
mod tests;
mod write;

use std::path::{Path, PathBuf};

use job::Session;
use report::{Verdict, html_page, result_table};
use scene::{PartSource, Scene, auto_cell, printable_lines};
use work::monitor;

use super::args::{Cell, RunOptions};
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
    if let Some(engine) = options.engine {
        scene.simulation.engine = engine;
    }
    Ok(scene)
}

fn run_scene(options: &RunOptions, progress: &Progress) -> Result<RunOutcome, CliError> {
    let scene = read_scene(options)?;
    monitor::check(progress)?;
    let target = options.out.clone().unwrap_or_else(|| default_target(&options.scene));
    let outputs = Outputs::begin(&target, &claims(options, &scene))?;
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
    let text = format!("{}Results: {}\n", result_table(&report), shown(&target));
    Ok(RunOutcome { text, verdict: report.verdict })
}

/// What the run writes and reads.
fn claims(options: &RunOptions, scene: &Scene) -> Claims {
    let sections = matches!(scene.part, PartSource::Blade(_)).then(|| write::SECTIONS.to_owned());
    Claims {
        files: &["report.html", "report.json"],
        folders: scene.toolpaths.iter().map(|request| request.folder.clone()).chain(sections).collect(),
        inputs: scene.files().map(|file| file.path.clone()).chain([options.scene.clone()]).collect(),
    }
}

/// `out/NAME` in the working folder.
fn default_target(scene: &Path) -> PathBuf {
    Path::new("out").join(scene.file_stem().unwrap_or("scene".as_ref()))
}
