//! Results that the tests compare.

use std::collections::BTreeMap;

use super::figures::FIGURES;
use super::results::{Case, Cost, Outcome, Results, SceneResult, ToolpathResult};
use report::Verdict;

/// A scene with one toolpath whose figures are all `value`.
pub fn scene(name: &str, value: f64) -> SceneResult {
    let figures: BTreeMap<String, f64> =
        FIGURES.iter().map(|figure| (figure.key.to_owned(), value)).collect();
    let toolpath = ToolpathResult {
        name: "zigzag".into(),
        strategy: "zigzag".into(),
        verdict: Verdict::Pass,
        figures,
        bounds: BTreeMap::new(),
        further: BTreeMap::new(),
    };
    SceneResult {
        name: name.into(),
        case: Case::plain(name),
        exact: BTreeMap::new(),
        digest: "d".into(),
        page: Some(format!("scenes/{name}/report.html")),
        outcome: Outcome::Done { verdict: Verdict::Pass, toolpaths: vec![toolpath] },
        cost: Cost { wall_s: 10.0, cpu_s: Some(20.0), peak_mib: Some(50.0), reference_s: 0.01 },
    }
}

/// A scene that could not run.
pub fn failed(name: &str, reason: &str) -> SceneResult {
    SceneResult { outcome: Outcome::Failed { reason: reason.into() }, page: None, ..scene(name, 0.0) }
}

pub fn results(scenes: Vec<SceneResult>) -> Results {
    Results::new("0.1.0", "2026-11-23T04:30:00Z".into(), None, scenes)
}
