//! What may be written on the command line.

use std::path::PathBuf;

use clap::{ArgGroup, Args, Parser, Subcommand};

use clap::builder::{PossibleValuesParser, TypedValueParser};
use cutter::Cutter;
use io::mesh_extensions;
use metrology::{ENGINES, Judged};
use nightly::Shard;
use program::Control;
use scallop::DEFAULT_DEGREE;
use scene::EngineChoice;
use toolpath::STRATEGIES;

/// Plans milling paths, cuts the part in a simulator, measures the cut surface and gives a verdict.
///
/// Exit status: 0 ran and every limit is proven to hold, 1 ran and one is violated or undecided, 2 could not
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
    #[command(after_help = kinds(), allow_negative_numbers = true)]
    Run(RunOptions),
    /// Verify a program of another system against a part, without a scene.
    #[command(after_help = VERIFY_HELP, allow_negative_numbers = true)]
    Verify(Box<VerifyOptions>),
    /// Run many scenes, compare their figures with a baseline, and report what got worse.
    #[command(after_help = NIGHTLY_HELP, allow_negative_numbers = true)]
    Nightly(Box<NightlyOptions>),
    /// Read and validate a scene, and print it with every default in effect.
    Check(CheckOptions),
    /// Answer scallop height from step and step from scallop height, for a section or a part's place.
    #[command(allow_negative_numbers = true)]
    Scallop(Box<ScallopOptions>),
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
    #[arg(long, value_name = "ENGINE", value_parser = engine_words())]
    pub engine: Option<EngineChoice>,
    /// End when standard input closes, as it does when the program that started this one dies.
    #[arg(long, hide = true)]
    pub until_stdin_closes: bool,
}

const VERIFY_HELP: &str = "The program is G-code or APT cutter locations (known by its text). Its zero is the part's zero, mm are \
millimetres of the part's file, and the machine's zero is taken to be 200 mm above.\n\n\
Exit status: 0 every limit is proven to hold, 1 one is violated or undecided, 2 could not run.";

/// What is verified against what.
#[derive(Debug, Args)]
pub struct VerifyOptions {
    /// The part.
    #[arg(long, value_name = "FILE", help = format!("The part ({})", mesh_extensions().join(", ")))]
    pub part: PathBuf,
    /// Unit of the part's file.
    #[arg(long, value_name = "UNIT", default_value = "mm")]
    pub unit: String,
    /// The program.
    #[arg(long, value_name = "FILE")]
    pub program: PathBuf,
    /// The cutter, in one of the short forms of its families.
    #[arg(long, value_name = "CUTTER", help = format!("The cutter: {} [default: as the program describes it]", cutter::short_forms()),
        conflicts_with = "tools")]
    pub cutter: Option<Cutter>,
    /// A table of tools: a TOML file with a [[tool]] for each, or a .tbl of LinuxCNC in mm.
    #[arg(long, value_name = "FILE")]
    pub tools: Option<PathBuf>,
    /// The tool to verify by itself [default: all that the program cuts with].
    #[arg(long, value_name = "N")]
    pub tool: Option<u32>,
    /// The control that the program is written for.
    #[arg(long, value_name = "CONTROL", default_value = "general", value_parser = PossibleValuesParser::new(Control::words()))]
    pub control: String,
    /// What of the part is judged: what the tool can face, vertical walls too, or all of it.
    #[arg(long, value_name = "WHAT", default_value = Judged::Walls.word(), value_parser = PossibleValuesParser::new(Judged::ALL.map(Judged::word)))]
    pub judge: String,
    /// Stock above the part's highest point, mm [default: 1].
    #[arg(long, value_name = "MM", value_parser = allowance, conflicts_with = "stock")]
    pub allowance: Option<f64>,
    /// The stock: a closed mesh in the unit of the part, or a TOML file with the [stock] of a scene [default:
    /// a block].
    #[arg(long, value_name = "FILE")]
    pub stock: Option<PathBuf>,
    /// The machine: its kinematics by name, or a TOML file with the [machine] of a scene [default: three
    /// axes].
    #[arg(long, value_name = "MACHINE")]
    pub machine: Option<PathBuf>,
    /// Deepest gouge that is tolerated, mm [default: 0.005].
    #[arg(long, value_name = "MM", value_parser = length)]
    pub gouge: Option<f64>,
    /// Highest uncut material that is tolerated, mm [default: 0.05].
    #[arg(long, value_name = "MM", value_parser = length)]
    pub uncut: Option<f64>,
    /// Highest scallop that is tolerated, mm [default: 0.01].
    #[arg(long, value_name = "MM", value_parser = length)]
    pub scallop: Option<f64>,
    /// Where the results go [default: out/NAME OF THE PROGRAM].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// What is printed.
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub format: Format,
    /// Threads to use [default: all cores]. Changes no result.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Pitch of the simulation's cells, mm; auto: the program chooses.
    #[arg(long, value_name = "MM", value_parser = cell)]
    pub cell: Option<Cell>,
    /// Memory that the simulation may take, MiB.
    #[arg(long, value_name = "MIB", value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    pub memory: Option<u32>,
    /// Engine that cuts.
    #[arg(long, value_name = "ENGINE", value_parser = engine_words())]
    pub engine: Option<EngineChoice>,
}

/// How an answer is printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// The table.
    Text,
    /// report.json.
    Json,
    /// report.html.
    Html,
    /// A test case for each limit.
    Junit,
}

const NIGHTLY_HELP: &str = "Each scene runs as a process of its own. One that fails, hangs or takes too much memory costs no other. After a \
kill, the same command continues with the scenes that have not finished.\n\n\
Exit status: 0 nothing got worse, 1 something did, 2 could not run.";

/// Which scenes to run, and what to compare them with.
#[derive(Debug, Args)]
pub struct NightlyOptions {
    /// Scenes, and folders that are searched for scenes; with --merge, the folders of the shards' results.
    #[arg(required = true, value_name = "SCENES")]
    pub paths: Vec<PathBuf>,
    /// Where the results go.
    #[arg(long, value_name = "DIR", default_value = "out/nightly")]
    pub out: PathBuf,
    /// The nightly.json of an earlier nightly.
    #[arg(long, value_name = "FILE")]
    pub baseline: Option<PathBuf>,
    /// The file that this nightly is appended to, and that trend lines come from.
    #[arg(long, value_name = "FILE")]
    pub history: Option<PathBuf>,
    /// What counts as worse, a TOML file.
    #[arg(long, value_name = "FILE")]
    pub rules: Option<PathBuf>,
    /// What others have published, to be shown beside the figures, a TOML file.
    #[arg(long, value_name = "FILE")]
    pub published: Option<PathBuf>,
    /// Scenes that run at the same time [default: all cores].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
    /// Memory that all scenes together may take, MiB [default: four fifths of what is free].
    #[arg(long, value_name = "MIB", value_parser = clap::value_parser!(u32).range(1..=1 << 24))]
    pub memory: Option<u32>,
    /// Time after which a scene is stopped, s.
    #[arg(long, value_name = "S", default_value_t = 1800, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub time_limit: u32,
    /// Run scenes again that have finished already.
    #[arg(long)]
    pub fresh: bool,
    /// Run part i of n of the scenes; --merge puts the parts together.
    #[arg(long, value_name = "I/N", conflicts_with = "history")]
    pub shard: Option<Shard>,
    /// Merge the results of all shards.
    #[arg(long, conflicts_with_all = ["shard", "jobs", "memory", "time_limit", "fresh"])]
    pub merge: bool,
    /// Submit N shards and their merge to Slurm; sbatch reads SBATCH_PARTITION and the like.
    #[arg(long, value_name = "N", conflicts_with_all = ["shard", "merge"],
        value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub slurm: Option<u16>,
}

/// What to check.
#[derive(Debug, Args)]
pub struct CheckOptions {
    /// The scene, a TOML file.
    pub scene: PathBuf,
}

/// What scallop is asked about. Lengths in mm.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("asked").args(["step", "scallop", "table"]).required(true))]
pub struct ScallopOptions {
    /// The cutter, in one of the short forms of its families.
    #[arg(long, value_name = "CUTTER", help = format!("The cutter: {}", cutter::short_forms()))]
    pub cutter: Cutter,
    /// Distance of passes along the surface: answers the scallop height.
    #[arg(long, value_name = "MM")]
    pub step: Option<f64>,
    /// Scallop height: answers the step.
    #[arg(long, value_name = "MM", conflicts_with = "step")]
    pub scallop: Option<f64>,
    /// Radius of a convex section across the feed [default: flat].
    #[arg(long, value_name = "MM", conflicts_with_all = ["concave", "part"])]
    pub convex: Option<f64>,
    /// Radius of a concave section across the feed.
    #[arg(long, value_name = "MM", conflicts_with = "part")]
    pub concave: Option<f64>,
    /// A part whose curvature is taken at a place.
    #[arg(long, value_name = "FILE", requires = "at", help = format!(
        "A part ({}, or NURBS patches in .json) whose curvature is taken at a place", io::mesh_extensions().join(", ")
    ))]
    pub part: Option<PathBuf>,
    /// The place on the part: X,Y (seen from above) or X,Y,Z (the nearest point).
    #[arg(long, value_name = "X,Y[,Z]", requires = "part", allow_hyphen_values = true, value_parser = place)]
    pub at: Option<Coordinates>,
    /// Feed direction there in the plan view, degrees from x.
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0)]
    pub direction: f64,
    /// Lead of the tool axis from the surface normal, degrees, for cutters that are no ball [default: the
    /// normal without a part, upright on a part].
    #[arg(long, value_name = "DEGREES")]
    pub lead: Option<f64>,
    /// Print what the second-order formula and a polynomial section cost, over curvature and step.
    #[arg(long, conflicts_with_all = ["step", "scallop", "part", "convex", "concave"])]
    pub table: bool,
    /// Degree of the table's polynomial.
    #[arg(long, value_name = "DEGREE", default_value_t = DEFAULT_DEGREE)]
    pub degree: usize,
    /// Angle by which the table's neighbouring passes spread, degrees.
    #[arg(long, value_name = "DEGREES", default_value_t = 5.0)]
    pub spread: f64,
}

/// Two or three coordinates, mm.
#[derive(Debug, Clone, PartialEq)]
pub struct Coordinates(Vec<f64>);

impl std::ops::Deref for Coordinates {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        &self.0
    }
}

fn place(text: &str) -> Result<Coordinates, String> {
    let number = |t: &str| t.trim().parse::<f64>().ok().filter(|v| v.abs() <= geometry::MAX_COORDINATE);
    let numbers: Option<Vec<f64>> = text.split(',').map(number).collect();
    numbers
        .filter(|n| matches!(n.len(), 2 | 3))
        .map(Coordinates)
        .ok_or_else(|| "give two or three coordinates in mm, such as 12.5,-3 or 12.5,-3,4".to_owned())
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
    if text == "auto" {
        return Ok(Cell::Auto);
    }
    length(text).map(Cell::Mm).map_err(|expected| format!("{expected}, or auto"))
}

/// A positive length, mm, in the range that scenes take too.
fn length(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|v| (1e-6..=1e4).contains(v));
    value.ok_or_else(|| "give a positive number of millimetres (1e-6 to 10000), such as 0.05".to_owned())
}

fn allowance(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|v| (0.0..=1e4).contains(v));
    value.ok_or_else(|| "give a number of millimetres (0 to 10000)".to_owned())
}

/// What a scene may ask for, from the lists of strategies, engines and part formats.
fn kinds() -> String {
    let line = |(word, help): (&str, &str)| format!("  {word:<16} {help}\n");
    let strategies: String = STRATEGIES.iter().map(|strategy| line((strategy.word, strategy.help))).collect();
    let engines: String = ENGINES.iter().map(|engine| line((engine.word(), engine.help()))).collect();
    let formats = mesh_extensions().join(", ");
    format!("Strategies of a scene:\n{strategies}\nEngines:\n{engines}\nMesh files: {formats}")
}

/// The words of all engines.
fn engine_words() -> impl TypedValueParser<Value = EngineChoice> {
    PossibleValuesParser::new(EngineChoice::words())
        .map(|word| EngineChoice::from_word(&word).unwrap_or_default())
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
    fn a_nightly_is_run_or_merged() {
        assert!(parse("millstream nightly scenes --shard 1/2 --jobs 2 --baseline a --rules b").is_ok());
        assert!(parse("millstream nightly a b --merge --history c --out d").is_ok());
        for bad in ["", "a --shard 3/2", "a --shard 1/2 --history h", "a --merge --shard 1/2", "a --slurm 0"]
        {
            assert!(parse(&format!("millstream nightly {bad}")).is_err(), "{bad}");
        }
    }

    #[test]
    fn the_definition_is_sound() {
        use clap::CommandFactory as _;
        Arguments::command().debug_assert();
    }
}
