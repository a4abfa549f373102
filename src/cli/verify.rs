//! `millstream verify`: a program of another system against a part. It makes a scene of the arguments and
//! runs it.

use std::fmt::Write as _;
use std::path::Path;

use cutter::Cutter;
use keys::{toml_number, toml_string};
use program::{Described, Tool, ToolTable};
use scene::{Scene, TableError, described_tools, scene_table, tool_table};
use toolpath::ALL_TOOLS;
use work::monitor;

use super::args::VerifyOptions;
use super::error::{CliError, shown};
use super::progress::Progress;
use super::run::{Chosen as Simulated, RunOutcome, Target, default_target, on_threads, run_scene};

/// Verifies a program and writes the results.
///
/// # Errors
/// [`CliError`]; nothing is written then.
pub fn verify(options: &VerifyOptions, progress: &Progress) -> Result<RunOutcome, CliError> {
    on_threads(options.threads, || {
        let mut scene = Scene::of_text(&name(&options.program), text(options)?)
            .map_err(|error| one_of_several(options).unwrap_or_else(|| error.into()))?;
        Simulated { cell: options.cell, memory: options.memory, engine: options.engine }.apply(&mut scene);
        monitor::check(progress)?;
        let target = options.out.clone().unwrap_or_else(|| default_target(&options.program));
        let machine = options.machine.iter().filter(|file| is_toml(file));
        let inputs = options.tools.iter().chain(&options.stock).chain(machine).cloned().collect();
        run_scene(scene, &Target { target, inputs, format: options.format }, progress)
    })
}

/// What messages call the scene that is made of the arguments.
fn name(program: &Path) -> String {
    let file = program.file_name().map_or_else(|| "program".into(), |name| name.to_string_lossy());
    format!("verify {file}")
}

/// What the scene's cutter is, and which tools of the program are meant.
struct Chosen {
    cutter: Cutter,
    /// As scenes spell it.
    holder: String,
    /// `tool` in the scene; nothing where the program has one.
    tool: Option<String>,
}

/// The scene.
fn text(options: &VerifyOptions) -> Result<String, CliError> {
    let asked = options.tool.map(|number| number.to_string());
    let chosen = match (&options.cutter, &options.tools) {
        (Some(cutter), _) => Chosen { cutter: *cutter, holder: String::new(), tool: asked },
        (None, Some(tools)) => of_table(tools, options)?,
        (None, None) => of_program(options)?,
    };
    let mut text = format!("title = {}\n", toml_string(&name(&options.program)));
    // What comes from a file stands before all other tables, whatever it ends in.
    for (file, key) in [(&options.stock, "stock"), (&options.machine, "machine")] {
        if let Some(file) = file.as_deref().filter(|file| is_toml(file)) {
            text += &scene_table(file, key)
                .map_err(|error| unusable(error, file, &format!("name a TOML file with [{key}]")))?;
            text += "\n";
        }
    }
    write_scene(&mut text, options, &chosen).map_err(|e| refused(&e.to_string(), "check the arguments"))?;
    Ok(text)
}

fn is_toml(file: &Path) -> bool {
    file.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml"))
}

fn unusable(error: TableError, file: &Path, cure: &str) -> CliError {
    match error {
        TableError::Fault(error) => error.into(),
        TableError::Unreadable(reason) => refused(&format!("cannot read {}: {reason}", shown(file)), cure),
    }
}

fn refused(what: &str, cure: &str) -> CliError {
    CliError::Verify { what: what.to_owned(), cure: cure.to_owned() }
}

/// What is wrong with --cutter for a program of several tools.
fn one_of_several(options: &VerifyOptions) -> Option<CliError> {
    if options.cutter.is_none() || options.tool.is_some() {
        return None;
    }
    let (_, feeding) = in_program(options).ok()?;
    let last = feeding.last().filter(|_| feeding.len() > 1)?;
    let listed = feeding.iter().map(|tool| format!("T{tool}")).collect::<Vec<_>>().join(", ");
    let what = format!("{} uses several tools ({listed}), and --cutter is one", shown(&options.program));
    let cure = format!(
        "name the one that --cutter is, such as --tool {last}, or give all of them by --tools FILE instead of --cutter"
    );
    Some(refused(&what, &cure))
}

/// The cutters that the program itself describes in its comments.
fn of_program(options: &VerifyOptions) -> Result<Chosen, CliError> {
    let file = shown(&options.program);
    let cure = "give it with --cutter, such as --cutter ball:6, or in a table with --tools";
    let (described, feeding) = in_program(options)?;
    let table = &described.table;
    let because = |what: String, tool: Option<u32>| {
        described.doubts(tool).fold(what, |what, doubt| what + "; " + doubt)
    };
    if options.tool.is_none() && several(table, &feeding) {
        return all(table, &feeding).ok_or_else(|| refused(&format!("{file} describes no cutter"), cure));
    }
    let known: Vec<u32> = feeding.into_iter().filter(|number| table.get(*number).is_some()).collect();
    let number = match (options.tool, &known[..]) {
        (Some(number), _) => number,
        (None, [only, ..]) => *only,
        (None, []) => return Err(refused(&because(format!("{file} describes no cutter"), None), cure)),
    };
    let tool = table.get(number);
    tool.map(|tool| one(tool, options.tool)).ok_or_else(|| {
        let what = format!("{file} describes no cutter for tool {number}");
        refused(&because(what, Some(number)), cure)
    })
}

/// What the program says of its cutters, and the tools that feed in it.
fn in_program(options: &VerifyOptions) -> Result<(Described, Vec<u32>), CliError> {
    described_tools(&options.program, &options.control)
        .map_err(|error| unusable(error, &options.program, "name a program"))
}

/// Whether several tools cut, of which one is known.
fn several(table: &ToolTable, feeding: &[u32]) -> bool {
    feeding.len() > 1 && feeding.iter().any(|number| table.get(*number).is_some())
}

/// All tools; the scene's cutter, which cells are chosen by, is the last one's, as it finishes.
fn all(table: &ToolTable, feeding: &[u32]) -> Option<Chosen> {
    let last = feeding.iter().rev().find_map(|number| table.get(*number))?;
    Some(Chosen { cutter: last.cutter, holder: String::new(), tool: Some(toml_string(ALL_TOOLS)) })
}

/// One tool with its holder.
fn one(tool: &Tool, asked: Option<u32>) -> Chosen {
    let mut holder = String::new();
    if let Some(known) = &tool.holder {
        let _ = writeln!(holder, "[holder]\ncutting_length = {}", toml_number(known.cutting_length()));
        for section in known.sections() {
            let [diameter, top, length] =
                [section.diameter, section.top_diameter, section.length].map(toml_number);
            let _ = writeln!(
                holder,
                "[[holder.section]]\ndiameter = {diameter}\ntop_diameter = {top}\nlength = {length}"
            );
        }
    }
    Chosen { cutter: tool.cutter, holder, tool: asked.map(|number| number.to_string()) }
}

/// The tools of a table.
fn of_table(file: &Path, options: &VerifyOptions) -> Result<Chosen, CliError> {
    let table = tool_table(file)
        .map_err(|error| unusable(error, file, "name a file of tools in TOML, or a .tbl of LinuxCNC"))?;
    let tools = &table.tools;
    let listed = tools.iter().map(|tool| tool.number.to_string()).collect::<Vec<_>>().join(", ");
    if let Some(number) = options.tool {
        let tool = table.get(number).ok_or_else(|| {
            refused(
                &format!("{} has no tool {number}", shown(file)),
                &format!("name one that it has with --tool: {listed}"),
            )
        })?;
        return Ok(one(tool, Some(number)));
    }
    let (_, feeding) = in_program(options)?;
    if several(&table, &feeding)
        && let Some(all) = all(&table, &feeding)
    {
        return Ok(all);
    }
    let meant = match (&tools[..], &feeding[..]) {
        ([only], _) => Some(only),
        (_, [number]) => table.get(*number),
        (_, []) => {
            let what = format!("{} cuts nothing: no tool moves at feed", shown(&options.program));
            let cure = "name a program with motion such as G1 X10 F100";
            return Err(refused(&what, cure));
        }
        _ => None,
    };
    meant
        .map(|tool| one(tool, None))
        .ok_or_else(|| refused("the table has several tools", &format!("name one with --tool: {listed}")))
}

/// Whether a toolpath can be called so.
fn is_name(stem: &str) -> bool {
    stem.len() <= 40 && stem.is_ascii() && stem.bytes().any(|b| b.is_ascii_alphanumeric())
}

fn write_scene(out: &mut String, options: &VerifyOptions, chosen: &Chosen) -> std::fmt::Result {
    let quoted = |path: &Path| toml_string(&path.to_string_lossy());
    writeln!(out, "[part]\nfile = {}\nunit = {}", quoted(&options.part), toml_string(&options.unit))?;
    writeln!(out, "judge = {}", toml_string(&options.judge))?;
    writeln!(out, "[cutter]")?;
    chosen.cutter.write(out)?;
    out.push_str(&chosen.holder);
    if let Some(allowance) = options.allowance {
        writeln!(out, "[stock]\nallowance = {}", toml_number(allowance))?;
    }
    if let Some(mesh) = options.stock.as_deref().filter(|file| !is_toml(file)) {
        writeln!(out, "[stock]\nfile = {}\nunit = {}", quoted(mesh), toml_string(&options.unit))?;
    }
    if let Some(word) = options.machine.as_deref().filter(|file| !is_toml(file)) {
        writeln!(out, "[machine]\nkinematics = {}", quoted(word))?;
    }
    writeln!(out, "[tolerance]")?;
    for (key, value) in [("gouge", options.gouge), ("uncut", options.uncut), ("scallop", options.scallop)] {
        if let Some(value) = value {
            writeln!(out, "{key} = {}", toml_number(value))?;
        }
    }
    writeln!(out, "[[toolpath]]\nstrategy = \"program\"\nfile = {}", quoted(&options.program))?;
    if let Some(stem) = options.program.file_stem().filter(|stem| is_name(&stem.to_string_lossy())) {
        writeln!(out, "name = {}", toml_string(&stem.to_string_lossy()))?;
    }
    writeln!(out, "control = {}", toml_string(&options.control))?;
    if let Some(tools) = &options.tools {
        writeln!(out, "tools = {}", quoted(tools))?;
    }
    match &chosen.tool {
        Some(tool) => writeln!(out, "tool = {tool}"),
        None => Ok(()),
    }
}
