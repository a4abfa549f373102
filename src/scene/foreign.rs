//! Programs from elsewhere: their files as paths of one tool, or of all.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use super::named_file::NamedFile;
use super::{Scene, ToolpathRequest};
use cutter::{Cutter, Holder};
use io::regular;
use keys::{SceneError, SceneText, Section};
use machine::kinematics::{Side, Waypoint};
use motion::{Cutters, MoveKind, PathsInTurn, Toolpath};
use program::{
    Control, Described, Finding, Placing, Program, ProgramError, Setup, ToolRun, ToolTable, looks_like_apt,
    read_apt, read_gcode, same_cutter,
};
use toolpath::{ForeignProgram, ReadProgram, ToolsMeant};

/// Largest program that is read, bytes: some twenty million lines.
const MAX_BYTES: u64 = 1 << 29;

/// How far above the program's zero the tool starts, mm, and that of the machine is taken to be where no
/// machine is known: above the highest place of a program that with the longest tool goes higher. G28 and G53
/// go there.
pub const MACHINE_ZERO_ABOVE: f64 = 200.0;

/// Largest table of tools that is read, bytes.
const MAX_TABLE_BYTES: u64 = 1 << 20;

/// Notes of a program that are listed.
const MOST_NOTES: usize = 20;

/// Reads the program of a toolpath, if it is one from elsewhere.
pub(super) fn load(request: &mut ToolpathRequest, scene: &Scene) -> Result<(), SceneError> {
    let Some(foreign) = request.strategy.downcast_ref::<ForeignProgram>() else { return Ok(()) };
    let Some(file) = request.directions.first() else { return Ok(()) };
    let unreadable = |reason: String| {
        let message = format!("cannot read the program {}: {reason}", file.path.display());
        scene.source.error(file.span.clone(), message, "relative paths start from the scene's folder")
    };
    let bytes = regular::read(&file.path, MAX_BYTES).map_err(|e| unreadable(e.to_string()))?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(unreadable(format!("it is larger than {} MiB", MAX_BYTES >> 20)));
    }
    let control = Control::from_word(foreign.control).unwrap_or(program::GENERAL_CONTROL);
    let refused = |error: ProgramError| in_text(&error, &bytes);
    let is_apt = looks_like_apt(&bytes);
    let name =
        file.path.file_name().map_or_else(|| file.written.clone(), |n| n.to_string_lossy().into_owned());
    let table = match request.directions.get(1) {
        Some(tools) => table(tools, scene)?,
        // Their radii shift the path where it is compensated.
        None if foreign.tools_meant == ToolsMeant::All => {
            described(&name, &bytes, control).map_err(refused)?.0.table
        }
        None => ToolTable::default(),
    };
    let lengths: BTreeMap<u32, f64> =
        table.tools.iter().filter_map(|tool| Some((tool.number, tool.gauge_length?))).collect();
    let read = if is_apt {
        read_apt(&name, &bytes)
    } else {
        read_with_lengths((&name, &bytes), control, &table, &lengths, scene)
    };
    let read = read.map_err(refused)?;
    // Where the machine is known, so are its axes' limits: no assumed place may leave them.
    let read = if scene.five_axis.is_none() { read.from_above() } else { read };
    let kinematics = scene.five_axis.as_ref().map(|machine| &machine.kinematics);
    // Locations by APT are of the tip, whatever its length.
    let length = |tool: u32| lengths.get(&tool).copied().filter(|_| !is_apt);
    let placing = Placing { chord: scene.tolerance.chord, kinematics, lengths: &length };
    let runs = read.runs(&placing).map_err(refused)?;
    let refused = |(message, cure): (String, String)| scene.source.error(file.span.clone(), message, cure);
    let said = Described::of(&read);
    let described = if table.tools.is_empty() { said.table.clone() } else { table };
    let (mut findings, mut notes) = (read.findings(&length), notes(&read));
    let (only, runs, others) = if foreign.tools_meant == ToolsMeant::All {
        (None, known(&read, runs, &described, &said).map_err(refused)?, Others::default())
    } else {
        let tool = chosen(foreign.tools_meant, &read, &runs).map_err(refused)?;
        let others = Others::of(&runs, tool, &described);
        findings.retain(|found: &Finding| found.tool == tool || found.tool == 0);
        (Some(tool), runs.into_iter().filter(|run| run.tool == tool).collect(), others)
    };
    let rounded = runs.iter().map(|run| run.rounded).fold(0.0, f64::max);
    let freely = runs.iter().filter_map(|run| run.rounded_freely).min();
    notes.extend(freely.and_then(|line| rounded_freely(&read.name, line, control, kinematics.is_some())));
    let (path, joints) = joined(runs.into_iter());
    let tools = if only.is_none() { tools_of(&path, &described) } else { None };
    match only {
        Some(tool) => told_otherwise(&said, tool, &scene.tooling.cutter, &read.name, &mut notes),
        None => {
            let is_used = |number| path.origin.tools.iter().any(|(_, used)| *used == number);
            let measured = described.tools.iter().filter(|tool| is_used(tool.number));
            measured
                .for_each(|tool| told_otherwise(&said, tool.number, &tool.cutter, &read.name, &mut notes));
        }
    }
    let table_zero = kinematics.map_or([0.0; 2], |kinematics| {
        kinematics.axes().map(|axis| match axis.side {
            Side::Head => 0.0,
            Side::Table => read.zero[3 + usize::from(axis.letter as u8 - b'A').min(2)].to_radians(),
        })
    });
    let program = ReadProgram {
        path,
        joints,
        table_zero,
        straight_rapids: control.straight_rapids.filter(|_| !is_apt),
        rounded,
        tools,
        gauge_lengths: lengths.clone(),
        before: others.before,
        unknown_before: others.unknown_before,
        others: others.any,
        highest_feed: read.highest_feed(|of| only.is_none_or(|tool| of == tool)),
        findings,
        notes,
    };
    request.strategy = Box::new(ForeignProgram { read: Some(Arc::new(program)), ..foreign.clone() });
    Ok(())
}

/// Reads G-code with the lengths and radii of a table of tools, from above all of it where the machine's zero
/// is not known.
fn read_with_lengths(
    (name, bytes): (&str, &[u8]),
    control: &'static Control,
    table: &ToolTable,
    lengths: &BTreeMap<u32, f64>,
    scene: &Scene,
) -> Result<Program, ProgramError> {
    let registers = lengths.iter().map(|(number, length)| (*number, [0.0, 0.0, *length])).collect();
    let radii = table.tools.iter().map(|tool| (tool.number, tool.cutter.radius())).collect();
    let any_radius = table.tools.is_empty().then(|| scene.tooling.cutter.radius());
    let setup = Setup { lengths: registers, radii, any_radius, ..setup(scene, lengths.is_empty()) };
    let read = read_gcode(name, bytes, control, &setup)?;
    // Under a lesser length than its own the tip hangs lower than the control takes it to be.
    let taken = read.settings.iter().map(|setting| setting.length[2]);
    let (least, longest) = lengths
        .values()
        .copied()
        .chain(taken)
        .fold((0.0, 0.0), |(least, most): (f64, f64), z| (least.min(z), most.max(z)));
    let highest = read.highest() + longest - least;
    if setup.offsets_known || highest <= MACHINE_ZERO_ABOVE {
        return Ok(read);
    }
    let above = Setup::from_above(MACHINE_ZERO_ABOVE + highest);
    read_gcode(name, bytes, control, &Setup { work: above.work, ..setup })
}

/// Where the program's zero is on the machine. A control that knows no lengths counts from where the tool's
/// tip is, else from the spindle nose.
fn setup(scene: &Scene, without_lengths: bool) -> Setup {
    let known = scene.five_axis.as_ref().filter(|machine| machine.zero_is_given && machine.gauge_is_given);
    let Some(machine) = known else { return Setup::from_above(MACHINE_ZERO_ABOVE) };
    let (zero, length) = (machine.kinematics.workpiece_zero(), machine.kinematics.gauge_length());
    let length = if without_lengths { length } else { 0.0 };
    Setup::from_zero([zero.x, zero.y, zero.z + length], MACHINE_ZERO_ABOVE)
}

/// The table of tools that a toolpath names.
fn table(file: &NamedFile, scene: &Scene) -> Result<ToolTable, SceneError> {
    tool_table(&file.path).map_err(|error| match error {
        TableError::Fault(error) => error,
        TableError::Unreadable(reason) => {
            let message = format!("cannot read the tools {}: {reason}", file.path.display());
            scene.source.error(
                file.span.clone(),
                message,
                "name a file of tools in TOML, or a .tbl of LinuxCNC",
            )
        }
    })
}

/// Why a table of tools is none.
#[derive(Debug)]
pub enum TableError {
    /// Its file cannot be read.
    Unreadable(String),
    /// Something in it is wrong.
    Fault(SceneError),
}

/// Reads a table of tools: LinuxCNC's by the ending `.tbl`, else TOML. mm.
///
/// # Errors
/// [`TableError`].
pub fn tool_table(path: &Path) -> Result<ToolTable, TableError> {
    let bytes = table_bytes(path)?;
    let name = path.to_string_lossy();
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("tbl")) {
        return ToolTable::of_linuxcnc(&name, &bytes).map_err(|e| TableError::Fault(in_text(&e, &bytes)));
    }
    ToolTable::read(&SceneText::new(name, utf8(bytes)?)).map_err(TableError::Fault)
}

/// The text of a TOML file that holds nothing but the table `key` of a scene.
///
/// # Errors
/// [`TableError`].
pub fn scene_table(path: &Path, key: &str) -> Result<String, TableError> {
    let source = SceneText::new(path.to_string_lossy(), utf8(table_bytes(path)?)?);
    let checked = source.table().and_then(|table| {
        let root = Section::root(&source, table.get_ref());
        root.only(&[key], &[], &format!("a file of [{key}]"))?;
        root.section(key).map(drop)
    });
    checked.map(|()| source.text.to_string()).map_err(TableError::Fault)
}

fn table_bytes(path: &Path) -> Result<Vec<u8>, TableError> {
    let bytes = regular::read(path, MAX_TABLE_BYTES).map_err(|e| TableError::Unreadable(e.to_string()))?;
    if bytes.len() as u64 > MAX_TABLE_BYTES {
        return Err(TableError::Unreadable(format!("it is larger than {MAX_TABLE_BYTES} bytes")));
    }
    Ok(bytes)
}

fn utf8(bytes: Vec<u8>) -> Result<String, TableError> {
    String::from_utf8(bytes).map_err(|_| TableError::Unreadable("it is not UTF-8 text".to_owned()))
}

/// What a program says of its cutters, and the tools that feed in it.
///
/// # Errors
/// [`TableError`] where it cannot be read.
pub fn described_tools(path: &Path, control: &str) -> Result<(Described, Vec<u32>), TableError> {
    let bytes = regular::read(path, MAX_BYTES).map_err(|e| TableError::Unreadable(e.to_string()))?;
    let control = Control::from_word(control).unwrap_or(program::GENERAL_CONTROL);
    let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    described(&name, &bytes, control).map_err(|error| TableError::Fault(in_text(&error, &bytes)))
}

fn described(
    name: &str,
    bytes: &[u8],
    control: &'static Control,
) -> Result<(Described, Vec<u32>), ProgramError> {
    // Neither the radius of a cutter nor where a work offset is moves a tool from its place in the list.
    let setup = Setup { any_radius: Some(0.0), offsets_known: true, ..Setup::from_above(MACHINE_ZERO_ABOVE) };
    let read =
        if looks_like_apt(bytes) { read_apt(name, bytes) } else { read_gcode(name, bytes, control, &setup) }?;
    Ok((Described::of(&read), read.tools_that_feed()))
}

/// The fault shown in the text of the program, where that can be shown.
fn in_text(error: &ProgramError, bytes: &[u8]) -> SceneError {
    let text = String::from_utf8_lossy(bytes);
    let lines = (error.line as usize).saturating_sub(1);
    let start = text.split_inclusive('\n').take(lines).map(str::len).sum::<usize>();
    let at = start + (error.column as usize).saturating_sub(1);
    let source = SceneText::new(&error.name, text.into_owned());
    if error.line == 0 {
        return source.error(0..0, error.fault.to_string(), error.cure());
    }
    let message = format!("line {}, column {}: {}", error.line, error.column, error.fault);
    source.error(at..at + 1, message, error.cure())
}

/// The runs of all tools that cut; else what is wrong, and the cure. Tools without a cutter that only travel
/// are left out.
fn known(
    read: &Program,
    runs: Vec<ToolRun>,
    table: &ToolTable,
    said: &Described,
) -> Result<Vec<ToolRun>, (String, String)> {
    if runs.is_empty() {
        return Err(nothing(read));
    }
    let missing =
        |run: &&ToolRun| feeds(std::slice::from_ref(*run), run.tool) && table.get(run.tool).is_none();
    if let Some(ToolRun { tool, path, .. }) = runs.iter().find(missing) {
        let fed = path.moves.iter().position(|step| step.kind != MoveKind::Rapid).unwrap_or_default();
        let line = path.line_of(fed).unwrap_or_default();
        let mut message =
            format!("no cutter is known for tool {tool}, which feeds in line {line} of {}", read.name);
        said.doubts(Some(*tool)).for_each(|doubt| message += &format!("; {doubt}"));
        let cure = if *tool == 0 {
            "begin with a tool change such as `T1 M6`".to_owned()
        } else {
            format!("describe tool {tool} in a table of tools, or name the one tool that is to be measured")
        };
        return Err((message, cure));
    }
    let known: Vec<ToolRun> = runs.into_iter().filter(|run| table.get(run.tool).is_some()).collect();
    if known.is_empty() { Err(nothing(read)) } else { Ok(known) }
}

/// Notes what a program says of a tool's cutter where another one is measured, or where it leaves that open.
fn told_otherwise(said: &Described, tool: u32, measured: &Cutter, name: &str, notes: &mut Vec<String>) {
    let own = measured.short_name();
    if let Some((cutter, line)) = said.of_tool(tool).filter(|(cutter, _)| !same_cutter(cutter, measured)) {
        let told = cutter.short_name();
        notes.push(format!(
            "the program says that the cutter of tool {tool} is {told} ({name} line {line}); {own} is measured, as asked"
        ));
    }
    notes.extend(said.doubts(Some(tool)).map(|doubt| format!("{name} {doubt}; {own} is measured")));
}

/// The cutters of a path's tools and what holds them, by a table that knows them all.
fn tools_of(path: &Toolpath, table: &ToolTable) -> Option<(Cutters, Vec<Option<Holder>>)> {
    let known = |(first, number): &(u32, u32)| table.get(*number).map(|tool| (*first, tool));
    let mut tools = path.origin.tools.iter().filter_map(known);
    let (_, first) = tools.next()?;
    let (mut cutters, mut holders) = (Cutters::from(first.cutter), vec![first.holder.clone()]);
    for (move_index, tool) in tools {
        cutters = cutters.then(move_index, tool.cutter);
        holders.push(tool.holder.clone());
    }
    Some((cutters, holders))
}

/// That corners are rounded and nothing says by how much, the first before a line.
fn rounded_freely(name: &str, line: u32, control: &Control, turns: bool) -> Option<String> {
    let bounded_by = control.corners_bounded_by?;
    let where_it_turns = if turns { " (where rotary axes turn, G61 alone)" } else { "" };
    Some(format!(
        "{name}: the control may round corners, first where line {line} begins, and nothing bounds by how much: what that \
         leaves or cuts is not measured. {bounded_by} would bound it{where_it_turns}"
    ))
}

fn nothing(read: &Program) -> (String, String) {
    (
        format!("the program {} moves nothing", read.name),
        "name a program with motion such as G1 X10 F100".to_owned(),
    )
}

/// The one tool whose moves are meant; else what is wrong, and the cure.
fn chosen(meant: ToolsMeant, read: &Program, runs: &[ToolRun]) -> Result<u32, (String, String)> {
    let tools = read.tools_in_use();
    let listed = tools.iter().map(|tool| format!("T{tool}")).collect::<Vec<_>>().join(", ");
    let asked = if let ToolsMeant::Number(tool) = meant { Some(tool) } else { None };
    match (asked, &tools[..]) {
        (_, []) => Err(nothing(read)),
        (Some(tool), _) if runs.iter().any(|run| run.tool == tool) => Ok(tool),
        (Some(tool), _) => Err((
            format!("the program {} does not use tool {tool}", read.name),
            format!("write one of {listed}"),
        )),
        (None, [tool]) => Ok(*tool),
        (None, _) => {
            // What moves before the first change is most often no more than a way home.
            let feeding: Vec<u32> = tools.iter().copied().filter(|tool| feeds(runs, *tool)).collect();
            match feeding[..] {
                [tool] => Ok(tool),
                _ => Err((
                    format!(
                        "the program {} uses several tools ({listed}), and a scene has one cutter",
                        read.name
                    ),
                    format!(
                        "write `tool = {}` for the tool that is the scene's cutter, or `tool = \"all\"` with a table of tools",
                        feeding.last().unwrap_or(&tools[tools.len() - 1])
                    ),
                )),
            }
        }
    }
}

/// What the other tools of a program do.
#[derive(Default)]
struct Others {
    before: Vec<(Cutter, Toolpath)>,
    unknown_before: bool,
    any: bool,
}

impl Others {
    /// Of all runs beside those of a tool; what comes before its last run is cut before it.
    fn of(runs: &[ToolRun], tool: u32, table: &ToolTable) -> Self {
        let last = runs.iter().rposition(|run| run.tool == tool).unwrap_or_default();
        let cuts = |run: &&ToolRun| run.tool != tool && feeds(std::slice::from_ref(*run), run.tool);
        let earlier: Vec<&ToolRun> = runs[..last].iter().filter(cuts).collect();
        let known = |run: &&ToolRun| Some((table.get(run.tool)?.cutter, run.path.clone()));
        let before: Vec<(Cutter, Toolpath)> = earlier.iter().filter_map(known).collect();
        let unknown_before = before.len() < earlier.len();
        Self { before, unknown_before, any: runs.iter().any(|run| cuts(&run)) }
    }
}

fn feeds(runs: &[ToolRun], tool: u32) -> bool {
    let of_tool = runs.iter().filter(|run| run.tool == tool);
    of_tool.flat_map(|run| &run.path.moves).any(|step| step.kind != MoveKind::Rapid)
}

/// Runs as one path, and the joints of each. How the machine comes from one to the next is not known.
fn joined(mut runs: impl Iterator<Item = ToolRun>) -> (Toolpath, Vec<(u32, Vec<Waypoint>)>) {
    let Some(ToolRun { tool, path, joints, .. }) = runs.next() else {
        let nowhere = motion::ClPoint::upright(geometry::Point3::origin());
        return (Toolpath::new(nowhere, Vec::new()), Vec::new());
    };
    let (mut all, mut stretches) = (PathsInTurn::new(path), vec![(tool, joints)]);
    runs.for_each(|run| {
        stretches.push((run.tool, run.joints));
        all.push(run.path, program::FEED_WHERE_NONE);
    });
    stretches.retain(|(_, joints)| !joints.is_empty());
    (all.finish(), stretches)
}

fn notes(read: &Program) -> Vec<String> {
    let shown = read
        .notes
        .iter()
        .take(MOST_NOTES)
        .map(|note| format!("{} line {}: {}", read.name, note.line, note.text));
    let mut notes: Vec<String> = shown.collect();
    if read.notes.len() > MOST_NOTES {
        notes.push(format!("{}: {} more remarks", read.name, read.notes.len() - MOST_NOTES));
    }
    let works: std::collections::BTreeSet<u32> = read.settings.iter().map(|setting| setting.work).collect();
    if works.len() > 1 {
        notes.push(format!(
            "{} uses {} work offsets; those it does not set itself are taken to be the part's zero",
            read.name,
            works.len()
        ));
    }
    notes
}
