//! Runs the scenes of a plan, those that have finished already left out.

use std::fs;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use ::nightly::{Outcome, SceneResult, reference_work};
use io::{atomic, regular};
use serde_json::Value;
use work::monitor::{self, Monitor as _};

use super::child::{self, Limits, Stopped};
use super::plan::{Plan, Planned};
use super::{NightlyOptions, pool, scene_folder, with_slashes};
use crate::error::CliError;
use crate::outputs;
use crate::progress::Progress;

/// The folder of the records.
const FINISHED: &str = "finished";

/// Largest record that is read, bytes.
const MAX_RECORD_BYTES: u64 = 16 << 20;

/// Memory that all scenes may take where the system does not say what is free, MiB.
const DEFAULT_BUDGET_MIB: u64 = 4096;

/// Runs the scenes; leaves their results in the plan's order.
///
/// # Errors
/// [`CliError::NightlyInterrupted`], [`CliError::InTheWay`] for a record that is none, and
/// [`CliError::Output`].
pub fn run(options: &NightlyOptions, plan: &Plan, progress: &Progress) -> Result<Vec<SceneResult>, CliError> {
    let finished = options.out.join(FINISHED);
    fs::create_dir_all(&finished).map_err(CliError::output(&finished))?;
    let records: Vec<Option<SceneResult>> =
        plan.cases.iter().map(|planned| record(options, planned)).collect::<Result<_, _>>()?;
    let (done, left): (Vec<_>, Vec<_>) =
        plan.cases.iter().zip(records).partition(|(_, record)| record.is_some());
    let mut results: Vec<SceneResult> = done
        .into_iter()
        .filter_map(|(planned, record)| record.map(|record| current(record, planned, options, &plan.further)))
        .collect();
    if !results.is_empty() {
        progress.line(&format!("{} of {} scenes have finished already", results.len(), plan.cases.len()));
    }
    let left: Vec<&Planned> = left.into_iter().map(|(planned, _)| planned).collect();
    results.extend(Runner::new(options, left.len(), &plan.further, progress)?.run(&left)?);
    // Whoever else uses the machine makes the reference work slower now and then, never quicker.
    let least = results.iter().map(|result| result.cost.reference_s).fold(f64::INFINITY, f64::min);
    results.iter_mut().for_each(|result| result.cost.reference_s = least);
    Ok(results)
}

/// A finished scene with what the rules say today.
fn current(
    record: SceneResult,
    planned: &Planned,
    options: &NightlyOptions,
    further: &[String],
) -> SceneResult {
    let outcome = outcome(&options.out.join(scene_folder(&planned.key)), further);
    SceneResult { exact: planned.exact.clone(), outcome, ..record }
}

fn record_path(options: &NightlyOptions, planned: &Planned) -> PathBuf {
    options.out.join(FINISHED).join(format!("{}.json", planned.key))
}

/// The record of a scene that need not run again.
fn record(options: &NightlyOptions, planned: &Planned) -> Result<Option<SceneResult>, CliError> {
    let path = record_path(options, planned);
    if fs::symlink_metadata(&path).is_err() {
        return Ok(None);
    }
    let foreign = || CliError::InTheWay { path: path.clone(), reason: "it is no record of a nightly".into() };
    let bytes = regular::read(&path, MAX_RECORD_BYTES).map_err(|_| foreign())?;
    let record: Value = serde_json::from_slice(&bytes).map_err(|_| foreign())?;
    record["digest"].as_str().ok_or_else(foreign)?;
    // One of another version is ours, and useless.
    let Ok(record) = serde_json::from_value::<SceneResult>(record) else { return Ok(None) };
    let has_page = record.page.as_ref().is_some_and(|page| options.out.join(page).is_file());
    let holds = record.digest == planned.digest && record.name == planned.case.name();
    let is_done = matches!(record.outcome, Outcome::Done { .. });
    Ok((holds && is_done && has_page && !options.fresh).then_some(record))
}

/// What all runs have in common.
struct Runner<'a> {
    options: &'a NightlyOptions,
    further: &'a [String],
    progress: &'a Progress,
    program: PathBuf,
    jobs: usize,
    threads: usize,
    budget_mib: u64,
}

impl<'a> Runner<'a> {
    fn new(
        options: &'a NightlyOptions,
        scenes: usize,
        further: &'a [String],
        progress: &'a Progress,
    ) -> Result<Self, CliError> {
        let program = super::program()?;
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let jobs = options.jobs.map_or(cores, usize::from).min(scenes.max(1));
        let free = child::free_mib().map(|free| free / 5 * 4);
        let budget_mib = options.memory.map(u64::from).or(free).unwrap_or(DEFAULT_BUDGET_MIB);
        Ok(Self { options, further, progress, program, jobs, threads: (cores / jobs).max(1), budget_mib })
    }

    fn run(&self, left: &[&Planned]) -> Result<Vec<SceneResult>, CliError> {
        self.progress.start("scenes", left.len() as u64);
        let claims: Vec<u64> = left.iter().map(|planned| most_mib(planned)).collect();
        let results = pool::run_all(self.jobs, self.budget_mib, &claims, |number| {
            monitor::check(self.progress).map_err(|_| CliError::NightlyInterrupted)?;
            let result = self.scene(left[number])?;
            self.progress.advance(1);
            let seconds = result.cost.wall_s;
            self.progress.line(&format!("{}: {}, {seconds:.1} s", result.name, result.word()));
            Ok(result)
        });
        results.into_iter().collect()
    }

    /// Runs a scene and records its result.
    fn scene(&self, planned: &Planned) -> Result<SceneResult, CliError> {
        let folder = self.options.out.join(scene_folder(&planned.key));
        outputs::wait_until_free(&folder);
        let reference_s = reference_s();
        let limits = Limits {
            time: Duration::from_secs(self.options.time_limit.into()),
            memory_mib: most_mib(planned).min(self.budget_mib),
        };
        let cancelled = || self.progress.cancelled();
        let (ended, mut cost) = child::watch(self.command(planned, &folder), &limits, &cancelled);
        cost.reference_s = reference_s;
        let outcome = match ended {
            Ok(()) => outcome(&folder, self.further),
            // A signal to all processes of a terminal or a job ends the scene, too.
            Err(_) if cancelled() => return Err(CliError::NightlyInterrupted),
            Err(Stopped::Cancelled) => return Err(CliError::NightlyInterrupted),
            Err(Stopped::Failed(reason)) => Outcome::Failed { reason },
        };
        let page = scene_folder(&planned.key).join("report.html");
        let result = SceneResult {
            name: planned.case.name(),
            case: planned.case.clone(),
            exact: planned.exact.clone(),
            digest: planned.digest.clone(),
            page: matches!(outcome, Outcome::Done { .. }).then(|| with_slashes(&page)),
            outcome,
            cost,
        };
        self.keep(planned, &result)?;
        Ok(result)
    }

    fn keep(&self, planned: &Planned, result: &SceneResult) -> Result<(), CliError> {
        let path = record_path(self.options, planned);
        atomic::write(&path, |out| Ok(serde_json::to_writer_pretty(out, result)?))
            .map_err(CliError::output(&path))
    }

    fn command(&self, planned: &Planned, folder: &Path) -> Command {
        let mut command = Command::new(&self.program);
        command.arg("run").arg("--out").arg(folder).arg("--until-stdin-closes");
        command.arg("--threads").arg(self.threads.to_string());
        if let Some(engine) = &planned.case.engine {
            command.arg("--engine").arg(engine);
        }
        if let Some(cell) = planned.case.cell_mm {
            command.arg("--cell").arg(cell.to_string());
        }
        command.arg("--").arg(&planned.path);
        command
    }
}

/// The memory at which a scene is stopped, MiB. Its own estimate keeps within `memory_mib`; a scene that
/// exceeds it by a quarter and what the program itself takes is out of hand.
fn most_mib(planned: &Planned) -> u64 {
    planned.memory_mib + planned.memory_mib / 4 + 64
}

/// What the report.json of a scene says.
fn outcome(folder: &Path, further: &[String]) -> Outcome {
    let path = folder.join("report.json");
    let read = super::read_text(&path).map_err(|e| e.to_string());
    let further: Vec<&str> = further.iter().map(String::as_str).collect();
    let outcome = read.and_then(|text| Outcome::of_report(&text, &further).map_err(|e| e.to_string()));
    outcome.unwrap_or_else(|e| Outcome::Failed { reason: format!("Its results cannot be read: {e}") })
}

/// Time of the reference work, s: the least of a few, since others may use the machine, too.
fn reference_s() -> f64 {
    const TIMES: usize = 5;
    let time = |_| {
        let start = Instant::now();
        black_box(reference_work());
        start.elapsed().as_secs_f64()
    };
    (0..TIMES).map(time).fold(f64::INFINITY, f64::min)
}
