//! What is wrong with a program from elsewhere before it is cut: spindle, feeds, tools, lengths.

use program::{Finding as Fault, FindingKind};
use report::{Claim, Figure, Gravity};
use serde::Serialize;
use work::monitor::Monitor;

use super::value;
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
    tool: u32,
    findings: Vec<FindingFigures>,
}

/// What is checked; warnings beside.
const CHECKED: [FindingKind; 4] =
    [FindingKind::SpindleOff, FindingKind::NoFeed, FindingKind::NoTool, FindingKind::OtherLength];

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
    let tool = run.path().origin.tool;
    let findings = read.findings.iter().map(figures).collect();
    let figures = ProgramFigures { file: name.to_owned(), tool, findings };
    let warnings = read.findings.iter().filter(|found| !found.kind.is_violation());
    let notes = warnings.map(|found| format!("{name}: {}", found.text)).collect();
    let claims = CHECKED.iter().map(|kind| claim(name, *kind, &read.findings)).collect();
    let rows = vec![("program", format!("{name}, tool {tool}"))];
    let figure = Figure { key: "program", value: value(&figures)?, rows, ..Figure::default() };
    Ok(Finding { figure: Some(figure), notes, claims })
}

/// That nothing of a kind was found.
fn claim(name: &str, kind: FindingKind, all: &[Fault]) -> Claim {
    let mut found = all.iter().filter(|found| found.kind == kind);
    let motions: usize = all.iter().filter(|found| found.kind == kind).map(|found| found.motions).sum();
    let text = match found.next() {
        Some(first) if motions == 1 => format!("{name}: {}", first.text),
        Some(first) => format!("{name}: {} ({motions} motions in all)", first.text),
        None => format!("{name}: no {}", what(kind)),
    };
    let gravity = if kind == FindingKind::OtherLength { Gravity::Scrap } else { Gravity::Crash };
    let claim = Claim::length(kind.word(), gravity, 0.0, motions as f64, 0.0);
    Claim { unit: "", ..claim }.told(text)
}

/// What is not there where all is well.
fn what(kind: FindingKind) -> &'static str {
    match kind {
        FindingKind::SpindleOff => "feed while the spindle is off",
        FindingKind::NoFeed => "feed move without F",
        FindingKind::NoTool => "feed before the first tool change",
        FindingKind::OtherLength => "feed with the length of another tool",
        FindingKind::NoEnd => "missing end",
    }
}
