//! A nightly on Slurm: an array job, a shard each, and a job that merges what they leave.
//!
//! A task that is killed and put in the queue again goes on where it was. The merge starts when all tasks
//! have ended, however they ended, and says which shard is missing.

use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::NightlyOptions;
use crate::error::{CliError, shown};

/// Where the scripts and logs are. Jobs start in the folder that they were submitted from, so paths mean the
/// same.
const FOLDER: &str = "slurm";

/// First lines of the scripts; a file that begins so is ours to replace.
const HEADER: &str = "#!/bin/sh\n# Millstream wrote this file for Slurm.\n";

/// Writes the scripts into the folder `slurm` of the results and submits them; the text says what was
/// submitted.
///
/// # Errors
/// [`CliError::Nightly`] where sbatch refuses them or is not there, [`CliError::InTheWay`] and
/// [`CliError::Output`].
pub fn submit(options: &NightlyOptions, shards: u16, sbatch: &Path) -> Result<String, CliError> {
    let scripts = Scripts { options, shards, program: quoted(&super::program()?)? };
    let folder = options.out.join(FOLDER);
    fs::create_dir_all(&folder).map_err(CliError::output(&folder))?;
    let array = write(&folder.join("shards.sh"), &scripts.shards()?)?;
    let merge = write(&folder.join("merge.sh"), &scripts.merge()?)?;
    let tasks = sent(sbatch, &[format!("--array=1-{shards}")], &array)?;
    // Not afterok: a scene that got worse must not keep the report from being written.
    let report = sent(sbatch, &[format!("--dependency=afterany:{tasks}")], &merge)?;
    Ok(format!(
        "Submitted job {tasks} with {shards} shards, and job {report}, which merges them.\nResults: {}\n",
        shown(&options.out)
    ))
}

struct Scripts<'a> {
    options: &'a NightlyOptions,
    shards: u16,
    program: String,
}

impl Scripts<'_> {
    /// The task of an array: one shard.
    fn shards(&self) -> Result<String, CliError> {
        let Self { options, shards, program } = self;
        let mut lines = self.head("shard-%a.log")?;
        lines.extend(options.jobs.map(|jobs| format!("#SBATCH --cpus-per-task={jobs}")));
        lines.extend(options.memory.map(|mib| format!("#SBATCH --mem={mib}")));
        let mut words = vec![program.clone(), "nightly".into()];
        let files =
            [("rules", &options.rules), ("published", &options.published), ("baseline", &options.baseline)];
        words.extend(named(&files)?);
        words.extend(options.jobs.map(|jobs| format!("--jobs {jobs}")));
        words.extend(options.memory.map(|mib| format!("--memory {mib}")));
        words.push(format!("--time-limit {}", options.time_limit));
        words.extend(options.fresh.then(|| "--fresh".to_owned()));
        words.push(format!("--shard \"$SLURM_ARRAY_TASK_ID/{shards}\""));
        words.push(format!("--out {}/\"$SLURM_ARRAY_TASK_ID\"", quoted(&options.out.join("shards"))?));
        words.push("--".into());
        words.extend(options.paths.iter().map(|path| quoted(path)).collect::<Result<Vec<_>, _>>()?);
        lines.push(words.join(" \\\n    "));
        // What got worse is for the merge to say; a task fails where its shard could not run.
        lines.push("status=$?\n[ \"$status\" -le 1 ] || exit \"$status\"".into());
        Ok(lines.join("\n") + "\n")
    }

    fn merge(&self) -> Result<String, CliError> {
        let Self { options, shards, program } = self;
        let mut lines = self.head("merge.log")?;
        let mut words = vec![program.clone(), "nightly --merge".into()];
        let files = [
            ("rules", &options.rules),
            ("published", &options.published),
            ("baseline", &options.baseline),
            ("history", &options.history),
        ];
        words.extend(named(&files)?);
        words.push(format!("--out {}", quoted(&options.out)?));
        words.push("--".into());
        let folders = (1..=*shards).map(|shard| quoted(&options.out.join("shards").join(shard.to_string())));
        words.extend(folders.collect::<Result<Vec<_>, _>>()?);
        lines.push(words.join(" \\\n    "));
        Ok(lines.join("\n") + "\n")
    }

    fn head(&self, log: &str) -> Result<Vec<String>, CliError> {
        let folder = self.options.out.join(FOLDER);
        let text = folder.to_string_lossy();
        // Slurm ends a value at a quote and reads % and \ in names of logs.
        if text.contains(['"', '\\', '%']) {
            return Err(CliError::nightly(
                format!("Slurm cannot write a log to {text}"),
                "name another --out",
            ));
        }
        Ok(vec![
            format!("{HEADER}#SBATCH --job-name=millstream-nightly"),
            format!("#SBATCH --output=\"{text}/{log}\""),
            "#SBATCH --open-mode=append".into(),
            "#SBATCH --requeue".into(),
        ])
    }
}

/// Options that name files.
fn named(files: &[(&str, &Option<PathBuf>)]) -> Result<Vec<String>, CliError> {
    let given = files.iter().filter_map(|(name, path)| Some((name, path.as_ref()?)));
    given.map(|(name, path)| Ok(format!("--{name} {}", quoted(path)?))).collect()
}

/// A path as a word of the shell.
fn quoted(path: &Path) -> Result<String, CliError> {
    let unusable = || CliError::nightly(format!("a script cannot name {}", path.display()), "rename it");
    let text = path.to_str().filter(|text| !text.contains(char::is_control)).ok_or_else(unusable)?;
    Ok(format!("'{}'", text.replace('\'', "'\\''")))
}

fn write(path: &Path, text: &str) -> Result<PathBuf, CliError> {
    if fs::symlink_metadata(path).is_ok() {
        let mut head = String::new();
        let read =
            io::regular::open(path).and_then(|file| file.take(HEADER.len() as u64).read_to_string(&mut head));
        if read.is_err() || head != HEADER {
            return Err(CliError::InTheWay { path: path.to_owned(), reason: "no nightly wrote it".into() });
        }
    }
    io::atomic::write(path, |out| out.write_all(text.as_bytes())).map_err(CliError::output(path))?;
    Ok(path.to_owned())
}

/// Submits a script; leaves the number of the job.
fn sent(sbatch: &Path, arguments: &[String], script: &Path) -> Result<String, CliError> {
    let refused = |reason: String| {
        let cure = "try it yourself: the scripts are in the folder slurm of the results";
        CliError::nightly(format!("sbatch did not take {}: {reason}", script.display()), cure)
    };
    let answer = Command::new(sbatch).arg("--parsable").args(arguments).arg(script).output();
    let answer = answer.map_err(|e| refused(e.to_string()))?;
    if !answer.status.success() {
        return Err(refused(String::from_utf8_lossy(&answer.stderr).trim().to_owned()));
    }
    // NUMBER, or NUMBER;CLUSTER.
    let text = String::from_utf8_lossy(&answer.stdout);
    let number = text.trim().split(';').next().unwrap_or_default();
    let is_number = !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit());
    is_number.then(|| number.to_owned()).ok_or_else(|| refused(format!("it answered {}", text.trim())))
}
