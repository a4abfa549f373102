//! Isoparametric lines: one parameter grows along a pass, the other one is the function whose levels passes
//! are.

use std::fmt::{self, Write as _};

use crate::levels::level_passes::along_levels;
use crate::levels::spacing::LevelSteps;
use crate::surface::chart::Chart;
use crate::vocabulary::{Along, Definition, Lines, PartKind, Passes, PlanError, Strategy, Task};
use field::{Axis, ScalarField};
use keys::word_of;

/// Lines of constant parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IsoParametric {
    /// Which parameter grows along a pass; the one with the shorter path without it.
    pub along: Option<Along>,
    /// How the other parameter steps from pass to pass.
    pub steps: LevelSteps,
}

impl IsoParametric {
    /// Passes along a parameter, shortest in all.
    pub const fn along(along: Along) -> Self {
        Self { along: Some(along), steps: LevelSteps::Shortest }
    }
}

/// Words for `along`.
const ALONG: [(&str, Option<Along>); 3] = [("u", Some(Along::U)), ("v", Some(Along::V)), ("best", None)];

/// Words for `step`.
const STEPS: [(&str, LevelSteps); 3] =
    [("shortest", LevelSteps::Shortest), ("constant", LevelSteps::Constant), ("least", LevelSteps::Least)];

/// How scenes speak of it.
pub(crate) static DEFINITION: Definition = Definition {
    word: "iso-parametric",
    help: "lines along a parameter of the surface, or along the better one",
    part: PartKind::Surface,
    keys: &["along", "step"],
    read: |from| {
        let along = from.section.choice("along", &ALONG)?;
        Ok(Box::new(IsoParametric { along, steps: from.section.choice("step", &STEPS)? }))
    },
};

impl Strategy for IsoParametric {
    fn definition(&self) -> &'static Definition {
        &DEFINITION
    }

    fn write(&self, out: &mut String) -> fmt::Result {
        writeln!(out, "along = \"{}\"", word_of(&ALONG, &self.along))?;
        writeln!(out, "step = \"{}\"", word_of(&STEPS, &self.steps))
    }

    fn passes(&self, task: &Task<'_>) -> Result<Passes, PlanError> {
        passes(task, self.along, self.steps)
    }
}

/// Passes along isoparametric lines, with levels placed in a given way; without `along` whichever of the two
/// families is shorter on all patches together.
fn passes(task: &Task<'_>, along: Option<Along>, placing: LevelSteps) -> Result<Passes, PlanError> {
    if let Some(along) = along {
        return passes_along(task, along, placing);
    }
    let [u, v] = [Along::U, Along::V].map(|a| passes_along(task, a, placing));
    let (u, v) = (u?, v?);
    let lengths = [u.length(), v.length()];
    let (mut best, word) = if lengths[0] <= lengths[1] { (u, "u") } else { (v, "v") };
    best.notes.push(format!(
        "feed along {word} was chosen: {:.0} mm of passes along u, {:.0} mm along v",
        lengths[0], lengths[1]
    ));
    Ok(best)
}

fn passes_along(task: &Task<'_>, along: Along, placing: LevelSteps) -> Result<Passes, PlanError> {
    let Task { part, cutter, ref settings, .. } = *task;
    let field = ScalarField::Coordinate(match along {
        Along::U => Axis::V,
        Along::V => Axis::U,
    });
    let mut all = Passes::default();
    let charts = Chart::all(part, cutter, settings.guide())?;
    for (k, chart) in charts.iter().enumerate() {
        all.append_patch([k, charts.len()], along_levels(task, chart, &field, placing, Lines::Levels)?);
    }
    Ok(all)
}
