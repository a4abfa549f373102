//! Why a command could not be done, and how that is told.

use std::path::{Path, PathBuf};

use miette::{Diagnostic, GraphicalReportHandler, GraphicalTheme};

use job::JobError;
use scallop::ScallopError;
use scene::{SceneError, printable};
use work::monitor::Cancelled;

/// Why a command could not be done.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub enum CliError {
    /// The job could not be done.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Job(JobError),
    /// No scallop follows from what was asked.
    #[error("no scallop can be calculated: {0}")]
    #[diagnostic(help("`millstream scallop --help` tells what can be asked"))]
    Scallop(ScallopError),
    /// The part that `scallop` was to look at is none.
    #[error("{}: {}", shown(file), printable(reason))]
    #[diagnostic(help("{cure}"))]
    ScallopPart {
        /// Its file.
        file: PathBuf,
        /// What is wrong.
        reason: String,
        /// What mends it.
        cure: String,
    },
    /// A result could not be written.
    #[error("cannot write {}: {}", shown(path), printable(reason))]
    #[diagnostic(help("make room there, or name another folder with --out"))]
    Output {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        reason: String,
    },
    /// What stands where results go is not ours to replace.
    #[error("{} is in the way: {reason}; nothing was written", shown(path))]
    #[diagnostic(help(
        "move it to another place, or name another folder with --out (another file with --history)"
    ))]
    InTheWay {
        /// The file or folder.
        path: PathBuf,
        /// Why it is kept.
        reason: String,
    },
    /// The answer could not be written.
    #[error("cannot write to standard output: {0}")]
    #[diagnostic(help("send it to another place; the results of a run are in their folder all the same"))]
    Stdout(String),
    /// The threads could not be started.
    #[error("cannot start the threads: {0}")]
    #[diagnostic(help("ask for fewer with --threads"))]
    Threads(String),
    /// What was to be verified cannot be.
    #[error("{}", printable(what))]
    #[diagnostic(help("{cure}"))]
    Verify {
        /// What is wrong, and where.
        what: String,
        /// What mends it.
        cure: String,
    },
    /// A nightly cannot begin or cannot use what it was given.
    #[error("{}", printable(what))]
    #[diagnostic(help("{cure}"))]
    Nightly {
        /// What is wrong, and where.
        what: String,
        /// What mends it.
        cure: String,
    },
    /// The user asked a nightly to stop.
    #[error("interrupted; the scenes that had finished are kept")]
    #[diagnostic(help("the same command continues with the others"))]
    NightlyInterrupted,
    /// The run takes more memory than the scene allows.
    #[error("the run needs more than the {allowed_mib} MiB of memory that it may take; nothing was written")]
    #[diagnostic(help(
        "write a greater `memory_mib` in [simulation] (or --memory), a greater `cell` or `stepover`, or make the part \
         coarser or smaller"
    ))]
    Memory {
        /// What the scene allows.
        allowed_mib: u64,
    },
    /// The user asked to stop.
    #[error("interrupted; nothing was written")]
    Interrupted,
}

impl From<Cancelled> for CliError {
    fn from(_: Cancelled) -> Self {
        Self::Interrupted
    }
}

impl From<JobError> for CliError {
    fn from(error: JobError) -> Self {
        match error {
            JobError::Cancelled(_) => Self::Interrupted,
            other => Self::Job(other),
        }
    }
}

impl From<SceneError> for CliError {
    fn from(error: SceneError) -> Self {
        Self::Job(error.into())
    }
}

/// A path as a terminal may have it.
pub fn shown(path: &Path) -> String {
    printable(&path.to_string_lossy())
}

impl CliError {
    /// What a nightly cannot use.
    pub fn nightly(what: impl Into<String>, cure: impl Into<String>) -> Self {
        Self::Nightly { what: what.into(), cure: cure.into() }
    }

    /// For results that could not be written: `map_err(CliError::output(path))`.
    pub fn output(path: &Path) -> impl Fn(std::io::Error) -> Self + use<'_> {
        |error| Self::Output { path: path.to_owned(), reason: error.to_string() }
    }
}

/// The message as it stands on stderr: what, where (file, line, column and caret when the text of a
/// scene is meant), and the cure.
pub fn render(error: &CliError, colour: bool) -> String {
    let theme = if colour { GraphicalTheme::unicode() } else { GraphicalTheme::unicode_nocolor() };
    let handler = GraphicalReportHandler::new_themed(theme).with_width(100).with_links(false);
    let mut text = String::new();
    match handler.render_report(&mut text, error) {
        Ok(()) => text,
        Err(_) => format!("error: {error}\n"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use scene::Scene;
    use sim::GridError;

    fn message(text: &str) -> String {
        render(&CliError::from(Scene::parse("scenes/wave.toml", text).unwrap_err()), false)
    }

    #[test]
    fn a_misspelt_key_is_shown_in_its_line() {
        let text = message("[part]\nfile = \"wave.stl\"\n[cutter]\nshape = \"ball\"\ndiametr = 6.0\n");
        insta::assert_snapshot!(text);
    }

    #[test]
    fn broken_toml_is_shown_where_it_breaks() {
        insta::assert_snapshot!(message("[part]\nfile = \"wave.stl\n"));
        insta::assert_snapshot!(message("[part]\nsurface = \"wav\"\n"));
        insta::assert_snapshot!(message(
            "[part]\nfile = \"wave.stl\"\n[cutter]\nshape = \"ball\"\ndiameter = -6\n"
        ));
        insta::assert_snapshot!(message(""));
    }

    #[test]
    fn errors_without_a_place_name_the_cure() {
        insta::assert_snapshot!(render(&CliError::Interrupted, false));
        insta::assert_snapshot!(render(
            &CliError::Job(JobError::Grid { scene: "plate.toml".into(), reason: GridError::Cell(-1.0) }),
            false
        ));
    }
}
