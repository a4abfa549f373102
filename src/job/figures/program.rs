//! What is wrong with a program from elsewhere before it is cut: spindle, feeds, tools, lengths.

use program::{Finding as Fault, FindingKind};
use report::{Claim, Figure, Gravity};
use serde::Serialize;
use work::monitor::Monitor;

use super::words::value;
use super::{bent_rapids, removal};
use crate::JobError;
use crate::run::{Finding, Run};

/// A finding as report.json has it.
#[derive(Debug, Serialize)]
struct FindingFigures {
    what: &'static str,
    line: u32,
    tool: u32,
    text: String,
}

/// What a program is, and what is wrong with it.
#[derive(Debug, Serialize)]
struct ProgramFigures {
    file: String,
    /// The one that is measured, or the first of all.
    tool: u32,
    /// All that are measured, where there are several, in the order in which they come.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    tools: Vec<u32>,
    findings: Vec<FindingFigures>,
}

/// What is checked; warnings beside.
const CHECKED: [FindingKind; 5] = [
    FindingKind::SpindleOff,
    FindingKind::NoFeed,
    FindingKind::NoTool,
    FindingKind::OtherLength,
    FindingKind::SeveralLengths,
];

/// What decides which of several lengths is a tool's own.
const BY_A_TABLE: &str = "the `gauge_length` of the tool in a table of tools would decide it";

/// Of programs from elsewhere.
pub(super) fn find(run: &Run<'_>, _: &dyn Monitor) -> Result<Finding, JobError> {
    let Some(read) = run.request.foreign() else { return Ok(Finding::default()) };
    let name = run.path().program_name();
    let figures = |found: &Fault| FindingFigures {
        what: found.kind.word(),
        line: found.line,
        tool: found.tool,
        text: found.text.clone(),
    };
    let mut tools: Vec<u32> = run.path().origin.tools.iter().map(|(_, tool)| *tool).collect();
    let listed = tools.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
    let several = tools.len() > 1;
    let rows = vec![("program", format!("{name}, {} {listed}", if several { "tools" } else { "tool" }))];
    let tool = tools.first().copied().unwrap_or_default();
    if !several {
        tools.clear();
    }
    let findings = read.findings.iter().map(figures).collect();
    let figures = ProgramFigures { file: name.to_owned(), tool, tools, findings };
    let warnings = read.findings.iter().filter(|found| !found.kind.is_violation());
    let warnings = warnings.map(|found| format!("{name}: {}", found.text));
    let notes = warnings.chain(bent_rapids::note(run)).collect();
    let claims = CHECKED.iter().flat_map(|kind| claims(name, *kind, &read.findings, several)).collect();
    let figure = Figure { key: "program", value: value(&figures)?, rows, ..Figure::default() };
    Ok(Finding { figure: Some(figure), notes, claims })
}

/// That nothing of a kind was found: of several tools one claim for each of which it was.
fn claims(name: &str, kind: FindingKind, all: &[Fault], several: bool) -> Vec<Claim> {
    let found: Vec<&Fault> = all.iter().filter(|found| found.kind == kind).collect();
    if !several || found.is_empty() {
        return vec![claim(name, kind, &found, "")];
    }
    let of_tool = |found: &&Fault| {
        // The length of a tool names it already.
        let tool = format!(", tool {}", found.tool);
        claim(name, kind, &[*found], if is_of_length(kind) { "" } else { &tool })
    };
    found.iter().map(of_tool).collect()
}

fn claim(name: &str, kind: FindingKind, found: &[&Fault], tool: &str) -> Claim {
    let motions: usize = found.iter().map(|found| found.motions).sum();
    let text = match found.first() {
        Some(first) if motions == 1 => format!("{name}: {}{tool}", first.text),
        Some(first) => format!("{name}: {}{tool} ({motions} motions in all)", first.text),
        None => format!("{name}: no {}", what(kind)),
    };
    let gravity = if is_of_length(kind) { Gravity::Scrap } else { Gravity::Crash };
    let claim =
        Claim { unit: "", ..Claim::length(kind.word(), gravity, 0.0, motions as f64, 0.0) }.told(text);
    match kind {
        // It cuts as it should where the length that was measured with is its own, and the others mean it.
        FindingKind::SeveralLengths if motions > 0 => {
            Claim { measured: None, decided_by: BY_A_TABLE, ..claim }
        }
        _ => claim,
    }
}

fn is_of_length(kind: FindingKind) -> bool {
    matches!(kind, FindingKind::OtherLength | FindingKind::SeveralLengths)
}

/// Where it is not known how long a tool is, no place that it comes to violates a limit for certain.
pub(crate) fn with_lengths_open(mut claims: Vec<Claim>, findings: &[Fault]) -> Vec<Claim> {
    if findings.iter().any(|found| found.kind == FindingKind::SeveralLengths) {
        let of_places = |claim: &&mut Claim| claim.unit == "mm" || claim.what == "scallop";
        for claim in claims.iter_mut().filter(of_places) {
            removal::doubt(std::slice::from_mut(claim), BY_A_TABLE);
        }
    }
    claims
}

/// What is not there where all is well.
fn what(kind: FindingKind) -> &'static str {
    match kind {
        FindingKind::SpindleOff => "feed while the spindle is off",
        FindingKind::NoFeed => "feed move without F",
        FindingKind::NoTool => "feed before the first tool change",
        FindingKind::OtherLength => "feed with the length of another tool",
        FindingKind::SeveralLengths => "tool that feeds under several lengths",
        FindingKind::NoEnd => "missing end",
    }
}
