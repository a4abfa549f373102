//! The command line: arguments, progress, messages, exit status.
//!
//! Exit status: 0 ran and every limit is proven to hold, 1 ran and a limit is violated or undecided,
//! 2 could not run (usage, file, scene, interrupted).

mod args;
mod check;
mod error;
mod nightly;
mod outputs;
mod progress;
mod run;
mod scallop;
mod signals;
mod system;
mod verify;
mod watch;

use std::io::{ErrorKind, Write as _};
use std::process::ExitCode;

use clap::Parser as _;

use args::{Arguments, Command};
use error::CliError;
use progress::Progress;

use report::Verdict;
use scene::printable_lines;

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
        Err(error) => return report_usage(&error),
    };
    let progress = Progress::new();
    let done = execute(&arguments.command, &progress).map_err(|error| match error {
        CliError::Interrupted => progress.watched().reason(),
        other => other,
    });
    progress.finish();
    let printed = done.and_then(|(text, verdict)| print_answer(&text).map(|()| verdict));
    ExitCode::from(match printed {
        Ok(Verdict::Pass) => PASSED,
        Ok(_) => NOT_PASSED,
        Err(error) => report_error(&error),
    })
}

/// Reports what is wrong with the arguments, or prints the help or the version that they ask for.
fn report_usage(error: &clap::Error) -> ExitCode {
    let text = error.render().to_string();
    let quotes_controls = printable_lines(&text) != text;
    if error.use_stderr() {
        // A quoted argument with control characters could bring colours of its own: such a message has none.
        let _ = if quotes_controls { to_stderr(&text) } else { error.print() };
        return ExitCode::from(COULD_NOT_RUN);
    }
    let printed = error.print().and_then(|()| std::io::stdout().flush());
    ExitCode::from(unless_closed(printed).map_or_else(|error| report_error(&error), |()| PASSED))
}

/// Writes the answer to stdout.
fn print_answer(text: &str) -> Result<(), CliError> {
    let mut out = std::io::stdout().lock();
    unless_closed(out.write_all(printable_lines(text).as_bytes()).and_then(|()| out.flush()))
}

/// A reader that closes the pipe early has read what it wanted. Any other failure is an error.
fn unless_closed(written: std::io::Result<()>) -> Result<(), CliError> {
    written
        .or_else(|error| if error.kind() == ErrorKind::BrokenPipe { Ok(()) } else { Err(error) })
        .map_err(|error| CliError::Stdout(error.to_string()))
}

/// Reports an error; returns the exit status.
fn report_error(error: &CliError) -> u8 {
    let colour = progress::stderr_is_terminal();
    let text = error::render(error, colour);
    // Where stderr takes nothing, the exit status alone reports it.
    let _ = if colour { std::io::stderr().write_all(text.as_bytes()) } else { to_stderr(&text) };
    COULD_NOT_RUN
}

fn to_stderr(text: &str) -> std::io::Result<()> {
    std::io::stderr().write_all(printable_lines(text).as_bytes())
}

/// Does what was asked; the text is for stdout.
fn execute(command: &Command, progress: &Progress) -> Result<(String, Verdict), CliError> {
    match command {
        Command::Run(options) => {
            if options.until_stdin_closes {
                signals::end_with_stdin(COULD_NOT_RUN);
                progress.watched().tell_nobody();
            }
            let report = run::run(options, progress)?;
            Ok((report.text, report.verdict))
        }
        Command::Verify(options) => {
            let report = verify::verify(options, progress)?;
            Ok((report.text, report.verdict))
        }
        Command::Check(options) => Ok((check::check(&options.scene, progress)?, Verdict::Pass)),
        Command::Nightly(options) => nightly::nightly(options, progress),
        Command::Scallop(options) => Ok((scallop::scallop(options)?, Verdict::Pass)),
    }
}
