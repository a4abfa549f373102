//! The command line: arguments, progress, messages, exit status.
//!
//! Exit status: 0 ran and every limit is proven to hold, 1 ran and a limit is violated or undecided,
//! 2 could not run (usage, file, scene, interrupted).

mod args;
mod check;
mod error;
mod outputs;
mod progress;
mod run;
mod scallop;

use std::io::Write as _;
use std::process::ExitCode;

use clap::Parser as _;

use args::{Arguments, Command};
use error::CliError;
use progress::Progress;

use report::Verdict;

/// Ran, and every limit is proven to hold.
const PASSED: u8 = 0;
/// Ran, and a limit is violated or undecided.
const NOT_PASSED: u8 = 1;
/// Could not run.
const COULD_NOT_RUN: u8 = 2;

/// Runs the command that the process was started with.
pub fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => {
            // Help and version come this way too; the message itself cannot be told elsewhere.
            let _ = error.print();
            return ExitCode::from(if error.use_stderr() { COULD_NOT_RUN } else { PASSED });
        }
    };
    let progress = Progress::new();
    match execute(&arguments.command, &progress) {
        Ok((text, verdict)) => {
            progress.finish();
            // A reader that closes the pipe early has read what it wanted.
            let _ = std::io::stdout().lock().write_all(text.as_bytes());
            ExitCode::from(if verdict == Verdict::Pass { PASSED } else { NOT_PASSED })
        }
        Err(error) => {
            progress.finish();
            eprint!("{}", error::render(&error, progress::stderr_is_terminal()));
            ExitCode::from(COULD_NOT_RUN)
        }
    }
}

/// Does what was asked; the text is for stdout.
fn execute(command: &Command, progress: &Progress) -> Result<(String, Verdict), CliError> {
    match command {
        Command::Run(options) => {
            let report = run::run(options, progress)?;
            Ok((report.text, report.verdict))
        }
        Command::Check(options) => Ok((check::check(&options.scene)?, Verdict::Pass)),
        Command::Scallop(options) => Ok((scallop::scallop(options)?, Verdict::Pass)),
    }
}
