//! `millstream verify`: a program of another system against a part. It makes a scene of the arguments and runs it.

use std::fmt::Write as _;
use std::path::Path;

use cutter::Cutter;
use keys::{toml_number, toml_string};
use scene::{Scene, TableError, described_tools, tool_table};
use work::monitor;

use super::args::VerifyOptions;
use super::error::{CliError, shown};
use super::progress::Progress;
use super::run::{Chosen, RunOutcome, Target, default_target, on_threads, run_scene};

/// Verifies a program and writes the results.
///
/// # Errors
/// [`CliError`]; nothing is written then.
pub fn verify(options: &VerifyOptions, progress: &Progress) -> Result<RunOutcome, CliError> {
    on_threads(options.threads, || {
        let mut scene = Scene::of_text(&name(&options.program), text(options)?)?;
        Chosen { cell: options.cell, memory: options.memory, engine: options.engine }.apply(&mut scene);
        monitor::check(progress)?;
        let target = options.out.clone().unwrap_or_else(|| default_target(&options.program));
        let inputs = options.tools.iter().cloned().collect();
        run_scene(scene, &Target { target, inputs, format: options.format }, progress)
    })
}

/// What messages call the scene that is made of the arguments.
fn name(program: &Path) -> String {
    let file = program.file_name().map_or_else(|| "program".into(), |name| name.to_string_lossy());
    format!("verify {file}")
}

/// The scene.
fn text(options: &VerifyOptions) -> Result<String, CliError> {
    let (cutter, holder) = match (&options.cutter, &options.tools) {
        (Some(cutter), _) => (*cutter, String::new()),
        (None, Some(tools)) => of_table(tools, options.tool)?,
        (None, None) => of_program(options)?,
    };
    let mut text = String::new();
    write_scene(&mut text, options, &cutter, &holder)
        .map_err(|e| refused(&e.to_string(), "check the arguments"))?;
    Ok(text)
}

fn refused(what: &str, cure: &str) -> CliError {
    CliError::Verify { what: what.to_owned(), cure: cure.to_owned() }
}

/// The cutter that the program itself describes in its comments.
fn of_program(options: &VerifyOptions) -> Result<(Cutter, String), CliError> {
    let file = shown(&options.program);
    let cure = "add --cutter or --tools";
    let (table, used) = described_tools(&options.program, &options.control).map_err(|error| match error {
        TableError::Fault(error) => error.into(),
        TableError::Unreadable(reason) => refused(&format!("cannot read {file}: {reason}"), "name a program"),
    })?;
    let known: Vec<u32> = used.into_iter().filter(|number| table.get(*number).is_some()).collect();
    let number = match (options.tool, &known[..]) {
        (Some(number), _) => number,
        (None, [only]) => *only,
        (None, []) => return Err(refused(&format!("{file} describes no cutter"), cure)),
        (None, _) => {
            return Err(refused(&format!("{file} describes several cutters"), "name one with --tool"));
        }
    };
    let described = table.get(number).map(|tool| (tool.cutter, String::new()));
    described.ok_or_else(|| refused(&format!("{file} describes no cutter for tool {number}"), cure))
}

/// Cutter and holder of a tool of a table, the latter as scenes spell it.
fn of_table(file: &Path, number: Option<u32>) -> Result<(Cutter, String), CliError> {
    let table = tool_table(file).map_err(|error| match error {
        TableError::Fault(error) => error.into(),
        TableError::Unreadable(reason) => refused(
            &format!("cannot read {}: {reason}", shown(file)),
            "name a file of tools in TOML, or a .tbl of LinuxCNC",
        ),
    })?;
    let tools = &table.tools;
    let listed = tools.iter().map(|tool| tool.number.to_string()).collect::<Vec<_>>().join(", ");
    let tool = match (number, &tools[..]) {
        (None, [only]) => only,
        (None, _) => {
            return Err(refused("the table has several tools", &format!("name one of {listed} with --tool")));
        }
        (Some(number), _) => tools.iter().find(|tool| tool.number == number).ok_or_else(|| {
            refused(
                &format!("{} has no tool {number}", shown(file)),
                &format!("name one of {listed} with --tool"),
            )
        })?,
    };
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
    Ok((tool.cutter, holder))
}

/// Whether a toolpath can be called so.
fn is_name(stem: &str) -> bool {
    stem.len() <= 40 && stem.is_ascii() && stem.bytes().any(|b| b.is_ascii_alphanumeric())
}

fn write_scene(out: &mut String, options: &VerifyOptions, cutter: &Cutter, holder: &str) -> std::fmt::Result {
    let quoted = |path: &Path| toml_string(&path.to_string_lossy());
    writeln!(out, "title = {}", toml_string(&name(&options.program)))?;
    writeln!(out, "[part]\nfile = {}\nunit = {}", quoted(&options.part), toml_string(&options.unit))?;
    writeln!(out, "judge = {}", toml_string(&options.judge))?;
    writeln!(out, "[cutter]")?;
    cutter.write(out)?;
    out.push_str(holder);
    if let Some(allowance) = options.allowance {
        writeln!(out, "[stock]\nallowance = {}", toml_number(allowance))?;
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
    match options.tool {
        Some(tool) => writeln!(out, "tool = {tool}"),
        None => Ok(()),
    }
}
