//! The figures of a toolpath beside scallop, gouge, uncut and deviation. Each is one file, which finds its
//! numbers, tells them in words, and holds them against their limits; a new one is one file and one line in
//! [`FIGURES`].

mod bent_rapids;
mod clearance;
mod correction;
mod coverage;
mod entries;
mod equal_time;
mod feeds;
mod field;
mod least_left;
mod machine;
mod offset;
mod pairs;
mod pocket;
mod program;
mod removal;
mod roughness;
mod section_polynomial;
mod sections;
mod shortest;
mod solid;
mod turning;
mod words;

use report::{Claim, Figure, FigureFile, Verdict};
use work::monitor::{self, Monitor};

pub(crate) use least_left::{LeastLeftFigures, Violated};
pub(crate) use program::with_lengths_open;

use super::JobError;
use super::run::{Finding, Run};

/// How a figure is found.
type Find = fn(&Run<'_>, &dyn Monitor) -> Result<Finding, JobError>;

/// All figures, in the order of report.json.
const FIGURES: [Find; 19] = [
    coverage::find,
    least_left::find,
    shortest::find,
    correction::find,
    equal_time::find,
    program::find,
    field::find,
    machine::find,
    pairs::find,
    section_polynomial::find,
    roughness::find,
    sections::find,
    removal::find,
    pocket::find,
    solid::find,
    offset::find,
    clearance::find,
    feeds::find,
    turning::find,
];

/// What all figures found.
#[derive(Debug, Default)]
pub(crate) struct Found {
    pub figures: Vec<Figure>,
    pub notes: Vec<String>,
    pub claims: Vec<Claim>,
    pub files: Vec<FigureFile>,
}

/// Finds all figures of a toolpath.
pub(crate) fn all(run: &Run<'_>, monitor: &dyn Monitor) -> Result<Found, JobError> {
    let mut found = Found::default();
    for find in FIGURES {
        monitor::check(monitor)?;
        let Finding { figure, notes, claims } = find(run, monitor)?;
        found.notes.extend(notes);
        found.claims.extend(claims);
        if let Some(mut figure) = figure {
            found.files.append(&mut figure.files);
            found.figures.push(figure);
        }
    }
    Ok(found)
}

/// Material that a toolpath leaves for the next one is no fault of it: those limits, which come second, are
/// the last one's. So is what is undecided of its gouges, because the last one is measured with all moves:
/// beside material that was never cut bounds are wide.
pub(crate) fn before_others(claims: Vec<Claim>) -> [Vec<Claim>; 2] {
    let is_left = |claim: &Claim| match claim.what {
        "uncut" | "scallop" => true,
        "gouge" => claim.verdict() == Verdict::Undecided,
        _ => false,
    };
    let (left, own) = claims.into_iter().partition(is_left);
    [own, left]
}

/// Limits of material that is left, where other tools of a program may have cut it: they are not violated for
/// sure.
pub(crate) fn with_other_tools(mut claims: Vec<Claim>) -> Vec<Claim> {
    let decided_by = "the other tools of the program may cut there, and each tool is measured by itself";
    let left = |claim: &&mut Claim| ["uncut", "scallop"].contains(&claim.what);
    for claim in claims.iter_mut().filter(left) {
        removal::doubt(std::slice::from_mut(claim), decided_by);
    }
    claims
}
