//! What one run found, as reports show it, and report.json.

use serde::Serialize;

use super::figure::{Figure, by_key};
use super::verdict::{Verdict, Violation};
use metrology::{DeviationFigures, GougeFigures, Limits, PathFigures, ScallopFigures, UncutFigures};

/// How a toolpath was cut.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SimulationFigures {
    /// The engine that really ran.
    pub engine: &'static str,
    /// Pitch of the cells.
    pub cell_mm: f64,
    /// Number of cells.
    pub cells: usize,
    /// The error bound that was asked for.
    pub error_bound_asked_mm: f64,
    /// Rectangles that were cut and measured anew on finer cells.
    pub refined_rectangles: usize,
    /// Pitch of the finest cells, [`SimulationFigures::cell_mm`] without such rectangles.
    pub finest_cell_mm: f64,
    /// Number of moves.
    pub moves: usize,
    /// Time that cutting and measuring took on the wall clock. Differs from run to run.
    pub wall_s: f64,
    /// Threads used. Changes no other figure.
    pub threads: usize,
}

/// The triangles of machined.stl and machined.ply.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SurfaceMeshFigures {
    /// Number of triangles, sides and bottom included.
    pub triangles: usize,
    /// Greatest vertical distance of the top from the cells' heights and from ridges between them.
    pub tolerance_mm: f64,
}

/// All that is reported of one toolpath, in the order of report.json.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ToolpathResult {
    /// What the user calls it.
    pub name: String,
    /// How it was planned.
    pub strategy: String,
    /// The folder with its files.
    pub folder: String,
    /// Whether every tolerance holds.
    pub verdict: Verdict,
    /// Those that do not.
    pub violations: Vec<Violation>,
    /// What planner and program have to say.
    pub notes: Vec<String>,
    /// The path itself.
    pub path: PathFigures,
    /// Scallops.
    pub scallop: ScallopFigures,
    /// Gouges.
    pub gouge: GougeFigures,
    /// Uncut material.
    pub uncut: UncutFigures,
    /// Deviation in all.
    pub deviation: DeviationFigures,
    /// All other figures, in the order of their list.
    #[serde(flatten, serialize_with = "by_key")]
    pub figures: Vec<Figure>,
    /// How it was cut.
    pub simulation: SimulationFigures,
    /// The machined part as triangles.
    pub surface_mesh: SurfaceMeshFigures,
}

/// The tolerances of the scene.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ToleranceFigures {
    /// Planning target, and limit that 95 % of the ridges stay below.
    pub scallop_mm: f64,
    /// Limit of the highest ridge.
    pub scallop_highest_mm: f64,
    /// Limit of depth.
    pub gouge_mm: f64,
    /// Limit of height.
    pub uncut_mm: f64,
    /// Chord tolerance of the path.
    pub chord_mm: f64,
}

impl From<&Limits> for ToleranceFigures {
    fn from(limits: &Limits) -> Self {
        Self {
            scallop_mm: limits.scallop,
            scallop_highest_mm: super::HIGHEST_RIDGE * limits.scallop,
            gouge_mm: limits.gouge,
            uncut_mm: limits.uncut,
            chord_mm: limits.chord,
        }
    }
}

/// All that is reported of one run, in the order of report.json.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunReport {
    /// Version of this program.
    pub millstream: &'static str,
    /// File name of the scene.
    pub scene: String,
    /// Its SHA-256, in hexadecimal.
    pub scene_sha256: String,
    /// What the user calls the scene.
    pub title: String,
    /// Whether every toolpath passes.
    pub verdict: Verdict,
    /// Name of the quickest toolpath that passes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub best: Option<String>,
    /// The tolerances.
    pub tolerance: ToleranceFigures,
    /// The toolpaths, in the order of the scene.
    pub toolpaths: Vec<ToolpathResult>,
}

/// Why no report.json could be written.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ReportError {
    /// A figure is missing or not finite, and no reason stands beside it. This is a fault of the
    /// program, and better told than written down.
    #[error("the figure {0} is not a finite number; please report this scene as a fault of the program")]
    NotFinite(String),
    /// The report could not be put into JSON.
    #[error("the report could not be written as JSON: {0}")]
    Json(String),
}

impl RunReport {
    /// The report of some toolpaths under one scene.
    pub fn new(
        scene: String,
        scene_sha256: String,
        title: String,
        limits: &Limits,
        toolpaths: Vec<ToolpathResult>,
    ) -> Self {
        let pass = toolpaths.iter().all(|t| t.verdict == Verdict::Pass);
        Self {
            millstream: env!("CARGO_PKG_VERSION"),
            scene,
            scene_sha256,
            title,
            verdict: if pass { Verdict::Pass } else { Verdict::Fail },
            best: best(&toolpaths).map(|k| toolpaths[k].name.clone()),
            tolerance: limits.into(),
            toolpaths,
        }
    }

    /// The text of report.json: pretty-printed, keys in fixed order, every number finite, `null`
    /// only where a `reason` stands beside it.
    ///
    /// # Errors
    /// [`ReportError`].
    pub fn to_json(&self) -> Result<String, ReportError> {
        let failed = |e: serde_json::Error| ReportError::Json(e.to_string());
        // serde_json writes NaN and infinities as null without a word: look for those.
        check_nulls("report", &serde_json::to_value(self).map_err(failed)?)?;
        let mut text = serde_json::to_string_pretty(self).map_err(failed)?;
        text.push('\n');
        Ok(text)
    }
}

/// The quickest of those that pass.
fn best(toolpaths: &[ToolpathResult]) -> Option<usize> {
    let passing = toolpaths.iter().enumerate().filter(|(_, t)| t.verdict == Verdict::Pass);
    let time = |t: &ToolpathResult| t.path.machining_time_s;
    passing.min_by(|a, b| time(a.1).total_cmp(&time(b.1))).map(|(k, _)| k)
}

fn check_nulls(path: &str, value: &serde_json::Value) -> Result<(), ReportError> {
    use serde_json::Value;
    match value {
        Value::Null => Err(ReportError::NotFinite(path.to_owned())),
        Value::Array(items) => {
            items.iter().enumerate().try_for_each(|(k, item)| check_nulls(&format!("{path}[{k}]"), item))
        }
        Value::Object(map) => {
            let reason = map.get("reason").is_some_and(Value::is_string);
            map.iter()
                .filter(|(_, item)| !(reason && item.is_null()))
                .try_for_each(|(key, item)| check_nulls(&format!("{path}.{key}"), item))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixture;
    use super::*;

    #[test]
    fn the_report_is_written_in_its_fixed_order() {
        let text = fixture::report().to_json().unwrap();
        insta::assert_snapshot!(text);
        let read: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(read["toolpaths"][0]["gouge"]["regions"][0]["line"], 1240);
    }

    #[test]
    fn figures_that_are_not_finite_are_refused_by_name() {
        for bad in [f64::NAN, f64::INFINITY] {
            let mut report = fixture::report();
            report.toolpaths[1].deviation.rms_mm = bad;
            let error = report.to_json().unwrap_err();
            assert_eq!(error, ReportError::NotFinite("report.toolpaths[1].deviation.rms_mm".into()));
        }
        let mut report = fixture::report();
        report.toolpaths[0].scallop.max_mm = None;
        assert!(report.to_json().is_err(), "null without a reason");
        report.toolpaths[0].scallop.reason = Some("no ridge".into());
        assert!(report.to_json().is_ok());
    }

    #[test]
    fn the_quickest_that_passes_is_the_best() {
        let report = fixture::report();
        assert_eq!(report.best.as_deref(), Some("streamline"));
        assert_eq!(report.verdict, Verdict::Fail);
        let slower = fixture::toolpath("slower", 900.0, 0.0);
        let both = vec![slower, report.toolpaths[1].clone()];
        let report = RunReport::new("a".into(), "b".into(), "c".into(), &fixture::LIMITS, both);
        assert_eq!((report.best.as_deref(), report.verdict), (Some("streamline"), Verdict::Pass));
    }
}
