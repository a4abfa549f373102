//! Checks that need no baseline: figures against closed forms, and engines and cells against each other.
//!
//! A figure with an error bound says that the truth is within the bound. So it must agree with a closed form
//! within its bound, and two measurements of one path within the sum of theirs.

use report::capital;

use super::compare::{Finding, finding};
use super::figures::{FIGURES, Figure};
use super::results::{Results, SceneResult, ToolpathResult};
use super::words::number;

/// Closed forms are calculated in f64, and so are the figures; mm.
const ROUNDING_MM: f64 = 1e-9;

/// All measurements of one figure of one toolpath.
#[derive(Debug)]
pub struct Study<'a> {
    /// The scene's name.
    pub scene: &'a str,
    /// The toolpath's name.
    pub toolpath: &'a str,
    /// Which figure.
    pub figure: &'static Figure,
    /// What the measurements are compared with, mm: the closed form, or else what the scene as written
    /// measured.
    pub truth: f64,
    /// Error bound of `truth`, mm.
    pub truth_bound: f64,
    /// Whether `truth` is a closed form.
    pub is_exact: bool,
    /// The measurements.
    pub rows: Vec<Measured<'a>>,
}

/// One measurement.
#[derive(Debug)]
pub struct Measured<'a> {
    /// The scene with engine and cell.
    pub scene: &'a SceneResult,
    /// mm.
    pub value: f64,
    /// Error bound, mm.
    pub bound: f64,
}

impl Study<'_> {
    /// Value less truth, mm.
    pub fn error(&self, row: &Measured<'_>) -> f64 {
        row.value - self.truth
    }

    /// Whether the measurement and the truth exclude each other.
    pub fn contradicts(&self, row: &Measured<'_>) -> bool {
        self.error(row).abs() > row.bound + self.truth_bound + ROUNDING_MM
    }

    fn finding(&self, row: &Measured<'_>) -> Finding {
        let Self { figure, .. } = self;
        let shown = |value: f64| number(figure.shown(value));
        let bound =
            if self.truth_bound > 0.0 { format!(" ± {}", shown(self.truth_bound)) } else { String::new() };
        let text = format!(
            "{}: measured {} ± {} {unit}, {} {}{bound} {unit}.",
            capital(figure.name),
            shown(row.value),
            shown(row.bound),
            if self.is_exact { "closed form" } else { "the scene as written" },
            shown(self.truth),
            unit = figure.unit(),
        );
        finding(&row.scene.name, Some(self.toolpath), text)
    }
}

/// The studies of all scenes that have a closed form or were run more than once.
pub fn studies(results: &Results) -> Vec<Study<'_>> {
    let plain = results.scenes.iter().filter(|scene| scene.case.is_plain());
    plain
        .flat_map(|scene| scene.toolpaths().iter().map(move |toolpath| (scene, toolpath)))
        .flat_map(|(scene, toolpath)| FIGURES.iter().filter_map(move |f| study(results, scene, toolpath, f)))
        .collect()
}

fn study<'a>(
    results: &'a Results,
    base: &'a SceneResult,
    toolpath: &'a ToolpathResult,
    figure: &'static Figure,
) -> Option<Study<'a>> {
    let exact = base.exact.get(figure.key).copied();
    let own = measured(base, toolpath, figure)?;
    let others =
        results.scenes.iter().filter(|other| other.case.scene == base.name && !other.case.is_plain());
    let others: Vec<Measured<'_>> = others.filter_map(|other| same_path(other, toolpath, figure)).collect();
    if exact.is_none() && others.is_empty() {
        return None;
    }
    Some(Study {
        scene: &base.name,
        toolpath: &toolpath.name,
        figure,
        truth: exact.map_or(own.value, |exact| exact.value),
        truth_bound: exact.map_or(own.bound, |exact| exact.within),
        is_exact: exact.is_some(),
        rows: std::iter::once(own).chain(others).collect(),
    })
}

fn measured<'a>(scene: &'a SceneResult, toolpath: &ToolpathResult, figure: &Figure) -> Option<Measured<'a>> {
    let (value, bound) = toolpath.figures.get(figure.key).zip(toolpath.bounds.get(figure.key))?;
    Some(Measured { scene, value: *value, bound: *bound })
}

/// The measurement of another run, if it cut the same path. A plan that is corrected by its measurements is
/// another path with each engine.
fn same_path<'a>(other: &'a SceneResult, plain: &ToolpathResult, figure: &Figure) -> Option<Measured<'a>> {
    const LENGTH: &str = "cutting_length_mm";
    let toolpath = other.toolpaths().iter().find(|toolpath| toolpath.name == plain.name)?;
    let same = toolpath.figures.get(LENGTH) == plain.figures.get(LENGTH);
    same.then(|| measured(other, toolpath, figure)).flatten()
}

/// What contradicts itself or a closed form.
pub(crate) fn contradictions(results: &Results) -> Vec<Finding> {
    let wrong = |study: Study<'_>| -> Vec<Finding> {
        study.rows.iter().filter(|row| study.contradicts(row)).map(|row| study.finding(row)).collect()
    };
    studies(results).into_iter().flat_map(wrong).collect()
}

#[cfg(test)]
mod tests {
    use super::super::fixture::{results, scene};
    use super::super::results::{Case, ClosedForm, Outcome};
    use super::*;

    fn bounded(case: Case, value: f64, bound: f64) -> SceneResult {
        let mut one = SceneResult { name: case.name(), case, ..scene("a", 0.01) };
        if let Outcome::Done { toolpaths, .. } = &mut one.outcome {
            toolpaths[0].figures.insert("scallop_max_mm".into(), value);
            toolpaths[0].bounds.insert("scallop_max_mm".into(), bound);
        }
        one
    }

    fn voxel() -> Case {
        Case { engine: Some("voxel".into()), ..Case::plain("a") }
    }

    #[test]
    fn engines_must_agree_within_their_bounds() {
        let wrong = |value, bound| {
            let own = bounded(Case::plain("a"), 0.010, 0.001);
            contradictions(&results(vec![own, bounded(voxel(), value, bound)])).len()
        };
        assert_eq!((wrong(0.012, 0.001), wrong(0.0121, 0.001)), (0, 1));
        assert!(studies(&results(vec![bounded(Case::plain("a"), 0.01, 0.001)])).is_empty());
    }

    #[test]
    fn a_closed_form_must_be_within_each_bound() {
        let own = |value| {
            let mut own = bounded(Case::plain("a"), 0.010, 0.001);
            own.exact.insert("scallop_max_mm".into(), ClosedForm { value, within: 0.0005 });
            own
        };
        assert!(contradictions(&results(vec![own(0.0115)])).is_empty());
        let found = contradictions(&results(vec![own(0.012), bounded(voxel(), 0.012, 0.0)]));
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].text, "Scallop max: measured 10.00 ± 1.000 µm, closed form 12.00 ± 0.5000 µm.");
    }

    #[test]
    fn another_path_is_not_compared() {
        let mut other = bounded(voxel(), 0.5, 0.0);
        if let Outcome::Done { toolpaths, .. } = &mut other.outcome {
            toolpaths[0].figures.insert("cutting_length_mm".into(), 7.0);
        }
        assert!(contradictions(&results(vec![bounded(Case::plain("a"), 0.01, 0.0), other])).is_empty());
    }
}
