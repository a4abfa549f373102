//! `millstream nightly`: many scenes, each a process of its own; what got worse; the pages that show it.
//!
//! The folder of the results has, beside the pages, `scenes` with the results of each scene and `finished`
//! with a record of each scene that has finished. A record names the digest of all that its figures follow
//! from. By it a later run knows what need not be run again.

mod child;
mod history;
mod merge;
mod plan;
mod pool;
mod scenes;
mod slurm;

use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use ::nightly::{
    Comparison, History, Night, Published, Results, Rules, accuracy, compare, date_of, html_page, junit,
    markdown, published_page, summary,
};
use io::{digest, regular};
use report::Verdict;
use scene::{EngineChoice, printable_lines};
use work::monitor;

use super::args::NightlyOptions;
use super::error::{CliError, shown};
use super::outputs::{Claims, Outputs};
use super::progress::Progress;
use plan::Plan;

/// Largest file of results or rules that is read, bytes.
const MAX_BYTES: u64 = 256 << 20;

/// The figures of a nightly.
const FIGURES: &str = "nightly.json";

/// Runs or merges a nightly and writes its pages; the text is for stdout, the verdict fails where something
/// got worse.
///
/// # Errors
/// [`CliError`]. Scenes that had finished are kept.
pub fn nightly(options: &NightlyOptions, progress: &Progress) -> Result<(String, Verdict), CliError> {
    if let Some(shards) = options.slurm {
        return Ok((slurm::submit(options, shards, Path::new("sbatch"))?, Verdict::Pass));
    }
    let rules = options.rules.as_deref().map_or_else(|| Ok(Rules::default()), read_rules)?;
    let published = options.published.as_deref().map_or_else(|| Ok(Vec::new()), read_published)?;
    let baseline = options.baseline.as_deref().map(read_results).transpose()?;
    if let Some(path) = &options.history {
        history::check(path)?;
    }
    let merged = options.merge.then(|| merge::read(&options.paths)).transpose()?;
    let plan = match merged {
        Some(_) => Plan::default(),
        None => Plan::new(options, &rules, &published, baseline.as_ref())?,
    };
    let outputs = Outputs::begin(&options.out, &claims(options, &plan))?;
    progress.watched().discard_by(outputs.discarding());
    let results = match merged {
        Some(shards) => merge::merge(shards, &options.out)?,
        None => {
            let scenes = scenes::run(options, &plan, progress)?;
            Results::new(env!("CARGO_PKG_VERSION"), date_of(now()), options.shard, scenes)
        }
    };
    monitor::check(progress)?;
    progress.watched().commit();
    let history = match &options.history {
        Some(path) => history::append(path, &night(&results)?)?,
        None => History::default(),
    };
    let comparison = compare(&results, baseline.as_ref(), &rules);
    let page = html_page(&results, baseline.as_ref(), &comparison, &history, &rules, &published);
    write(&results, baseline.as_ref(), &comparison, page, &published, &outputs)?;
    outputs.publish()?;
    let verdict = if comparison.worse.is_empty() { Verdict::Pass } else { Verdict::Fail };
    Ok((summary_text(&results, &comparison, &options.out), verdict))
}

/// Seconds since 1970.
fn now() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_secs())
}

/// What the nightly writes and reads.
fn claims(options: &NightlyOptions, plan: &Plan) -> Claims {
    let shards = options.paths.iter().filter(|_| options.merge).map(|folder| folder.join(FIGURES));
    let named = [&options.baseline, &options.rules, &options.published, &options.history];
    let scenes = plan.cases.iter().map(|planned| planned.path.clone());
    Claims {
        files: &["report.html", "report.md", "accuracy.md", "published.md", FIGURES, "junit.xml"],
        folders: Vec::new(),
        inputs: named.into_iter().flatten().cloned().chain(shards).chain(scenes).collect(),
    }
}

fn write(
    results: &Results,
    baseline: Option<&Results>,
    comparison: &Comparison,
    page: String,
    published: &[Published],
    outputs: &Outputs,
) -> Result<(), CliError> {
    let file = |name: &str, text: String| outputs.file(name, |out| out.write_all(text.as_bytes()));
    file("report.html", printable_lines(&page))?;
    file("report.md", printable_lines(&markdown(results, baseline, comparison)))?;
    file("accuracy.md", printable_lines(&accuracy(results)))?;
    if !published.is_empty() {
        file("published.md", printable_lines(&published_page(results, published)))?;
    }
    file("junit.xml", junit(results, comparison))?;
    file(FIGURES, results.to_json().map_err(|e| CliError::nightly(e.to_string(), "report this error"))?)
}

/// The night of some results. What tells it from all others are its figures and costs.
fn night(results: &Results) -> Result<Night, CliError> {
    let night = Night::of(results, String::new());
    let dateless = Night { date: String::new(), ..night.clone() };
    let line =
        dateless.line().ok_or_else(|| CliError::nightly("a figure is not finite", "report this error"))?;
    Ok(Night { id: digest::of_bytes(line.as_bytes()).sha256, ..night })
}

fn summary_text(results: &Results, comparison: &Comparison, out: &Path) -> String {
    let mut lines = vec![summary(results, comparison)];
    lines.extend(comparison.worse.iter().map(|worse| format!("  {}: {}", worse.place(), worse.text)));
    lines.push(format!("Results: {}", shown(out)));
    lines.join("\n") + "\n"
}

/// A file as text.
fn read_text(path: &Path) -> Result<String, CliError> {
    let unusable = |reason: String| {
        CliError::nightly(format!("cannot read {}: {reason}", path.display()), "name a file that is there")
    };
    let bytes = regular::read(path, MAX_BYTES).map_err(|e| unusable(e.to_string()))?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(unusable(format!("it is larger than {MAX_BYTES} bytes")));
    }
    String::from_utf8(bytes).map_err(|_| unusable("it is not UTF-8 text".into()))
}

fn read_rules(path: &Path) -> Result<Rules, CliError> {
    let engines = EngineChoice::words();
    Ok(Rules::parse(&path.to_string_lossy(), &read_text(path)?, &engines)?)
}

fn read_published(path: &Path) -> Result<Vec<Published>, CliError> {
    Ok(Published::parse(&path.to_string_lossy(), &read_text(path)?)?)
}

/// Reads a nightly.json.
fn read_results(path: &Path) -> Result<Results, CliError> {
    Results::from_json(&read_text(path)?).map_err(|reason| {
        let what = format!("{} cannot be used: {reason}", path.display());
        CliError::nightly(what, "name the nightly.json of an earlier nightly")
    })
}

/// The file of this program, which runs the scenes.
fn program() -> Result<PathBuf, CliError> {
    std::env::current_exe().map_err(|e| {
        let cure = "run it from where it is installed";
        CliError::nightly(format!("cannot find the program's own file: {e}"), cure)
    })
}

/// A path from the folder of the results, with slashes.
fn with_slashes(path: &Path) -> String {
    let parts: Vec<_> = path.components().map(|part| part.as_os_str().to_string_lossy()).collect();
    parts.join("/")
}

/// The folder of a scene's results, from the folder of the nightly's.
fn scene_folder(key: &str) -> PathBuf {
    Path::new("scenes").join(key)
}
