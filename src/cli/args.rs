//! What may be written on the command line.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};

use crate::io::scene::Engine;

/// Plans milling paths, cuts the part in a simulator, measures the cut surface and gives a verdict.
///
/// Exit status: 0 ran and every tolerance holds, 1 ran and a tolerance is violated, 2 could not
/// run.
#[derive(Debug, Parser)]
#[command(name = "millstream", version, arg_required_else_help = true)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Plan, cut, measure and report all toolpaths of a scene.
    Run(RunOptions),
    /// Read and validate a scene, and print it with every default in effect.
    Check(CheckOptions),
}

/// How to run a scene.
#[derive(Debug, Args)]
pub struct RunOptions {
    /// The scene, a TOML file.
    pub scene: PathBuf,
    /// Where the results go [default: out/NAME OF THE SCENE].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Threads to use [default: all cores]. Changes no result.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Pitch of the simulation's cells, mm, instead of the scene's; auto: the program chooses.
    #[arg(long, value_name = "MM", value_parser = cell)]
    pub cell: Option<Cell>,
    /// Memory that one simulation may take, MiB, instead of the scene's.
    #[arg(long, value_name = "MIB", value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    pub memory: Option<u32>,
    /// Engine that cuts, instead of the scene's.
    #[arg(long, value_name = "ENGINE", value_parser = clap::builder::PossibleValuesParser::new(Engine::WORDS))]
    pub engine: Option<String>,
}

/// What to check.
#[derive(Debug, Args)]
pub struct CheckOptions {
    /// The scene, a TOML file.
    pub scene: PathBuf,
}

/// Pitch of the cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cell {
    /// The program chooses.
    Auto,
    /// This, mm.
    Mm(f64),
}

fn cell(text: &str) -> Result<Cell, String> {
    /// The range of lengths that scenes take too, mm.
    const CELL: std::ops::RangeInclusive<f64> = 1e-6..=1e4;
    if text == "auto" {
        return Ok(Cell::Auto);
    }
    let value: Option<f64> = text.parse().ok();
    value
        .filter(|v| CELL.contains(v))
        .map(Cell::Mm)
        .ok_or_else(|| "give a positive number of millimetres, such as 0.05, or auto".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(line: &str) -> Result<Arguments, clap::Error> {
        Arguments::try_parse_from(line.split(' '))
    }

    #[test]
    fn options_are_checked() {
        assert!(parse("millstream run a.toml --cell 0.05 --threads 3 --engine zmap --out x").is_ok());
        assert!(parse("millstream run a.toml --cell auto --memory 512").is_ok());
        for bad in [
            "--cell automatic",
            "--memory 0",
            "--memory 1.5",
            "--cell 0",
            "--cell nan",
            "--cell inf",
            "--cell -1",
            "--threads 0",
            "--engine lathe",
            "--nonsense",
        ] {
            let error = parse(&format!("millstream run a.toml {bad}")).unwrap_err();
            assert!(error.use_stderr() && error.exit_code() == 2, "{bad}");
        }
        assert!(!parse("millstream --version").unwrap_err().use_stderr());
    }

    #[test]
    fn the_definition_is_sound() {
        use clap::CommandFactory as _;
        Arguments::command().debug_assert();
    }
}
