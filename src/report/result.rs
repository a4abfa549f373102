//! What one run found, as reports show it, and report.json.

use serde::Serialize;
use serde::ser::{SerializeMap as _, Serializer};

use super::figure::{Figure, by_key};
use super::verdict::{Claim, Verdict};
use metrology::{
    Bounded, DeviationFigures, ExcessFigures, ExcessKind, GougeFigures, Limits, PathFigures, ScallopFigures,
    ScallopRule, UncutFigures,
};

/// The claim that no wall of a pocket is cut.
pub const WALL: &str = "wall";

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
    /// Whether it cuts what the toolpath before it left.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub stock_is_previous: bool,
    /// Whether every limit holds.
    pub verdict: Verdict,
    /// Every limit with the figure that was held against it, the gravest first. report.json has them as
    /// `violations`, `undecided` and `held`.
    #[serde(flatten, serialize_with = "by_verdict")]
    pub claims: Vec<Claim>,
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
    /// The highest material anywhere.
    pub excess: ExcessReport,
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

impl ToolpathResult {
    /// The limits of which that is the verdict.
    pub fn claims_that(&self, verdict: Verdict) -> impl Iterator<Item = &Claim> {
        self.claims.iter().filter(move |claim| claim.verdict() == verdict)
    }

    /// The deepest cut and its bound, mm: into the surface or, in a pocket, beyond its walls, which have a
    /// limit of their own.
    pub fn deepest_cut(&self) -> [f64; 2] {
        let walls = self.claims.iter().filter(|claim| claim.what == WALL);
        let mut all: Vec<[f64; 2]> =
            walls.filter_map(|claim| Some([claim.measured?, claim.error_bound])).collect();
        all.push([self.gouge.max_depth_mm, self.gouge.error_bound_mm]);
        let deepest = all.iter().map(|cut| cut[0]).fold(0.0, f64::max);
        [deepest, all.iter().map(|cut| (cut[0] - deepest) + cut[1]).fold(0.0, f64::max)]
    }

    /// What share of the surface the verdict covers, in words to stand behind it; empty where that is all of
    /// it.
    pub fn scope(&self) -> &str {
        let coverage = self.figures.iter().find(|figure| figure.key == "coverage");
        coverage.and_then(|figure| figure.value.get("scope")?.as_str()).unwrap_or_default()
    }

    /// That share as a number; 1 where it is not known.
    pub fn share(&self) -> f64 {
        let coverage = self.figures.iter().find(|figure| figure.key == "coverage");
        let area = |key: &str| coverage.and_then(|figure| figure.value.get(key)?.as_f64());
        let shared = area("judged_mm2").zip(area("surface_mm2")).filter(|areas| areas.1 > 0.0);
        shared.map_or(1.0, |(judged, surface)| judged / surface)
    }
}

/// Claims as lists, one for each verdict.
fn by_verdict<S: Serializer>(claims: &[Claim], serializer: S) -> Result<S::Ok, S::Error> {
    let of = |verdict| claims.iter().filter(|c| c.verdict() == verdict).collect::<Vec<_>>();
    let mut map = serializer.serialize_map(Some(3))?;
    map.serialize_entry("violations", &of(Verdict::Fail))?;
    map.serialize_entry("undecided", &of(Verdict::Undecided))?;
    map.serialize_entry("held", &of(Verdict::Pass))?;
    map.end()
}

/// A toolpath that could not be planned.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NotPlanned {
    /// What the user calls it.
    pub name: String,
    /// How it was to be planned.
    pub strategy: String,
    /// [`Verdict::NotPlanned`].
    pub verdict: Verdict,
    /// Why there is no path.
    pub reason: String,
}

/// One toolpath of a report.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum ToolpathReport {
    /// It was planned, cut and measured.
    Measured(Box<ToolpathResult>),
    /// It could not be planned.
    NotPlanned(NotPlanned),
}

impl ToolpathReport {
    /// What the user calls it.
    pub fn name(&self) -> &str {
        match self {
            Self::Measured(result) => &result.name,
            Self::NotPlanned(missing) => &missing.name,
        }
    }

    /// Its verdict.
    pub fn verdict(&self) -> Verdict {
        match self {
            Self::Measured(result) => result.verdict,
            Self::NotPlanned(missing) => missing.verdict,
        }
    }

    /// Its figures, if it was planned.
    pub fn measured(&self) -> Option<&ToolpathResult> {
        match self {
            Self::Measured(result) => Some(result),
            Self::NotPlanned(_) => None,
        }
    }
}

/// The tolerances of the scene.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ToleranceFigures {
    /// Planning target.
    pub scallop_mm: f64,
    /// Share of the ridge length that must not exceed the target.
    pub scallop_share: f64,
    /// Limit of the highest ridge.
    pub scallop_highest_mm: f64,
    /// Limit of depth.
    pub gouge_mm: f64,
    /// Limit of height.
    pub uncut_mm: f64,
    /// Chord tolerance of the path.
    pub chord_mm: f64,
}

impl ToleranceFigures {
    /// Of a scene's limits and its rule for ridges.
    pub fn new(limits: &Limits, rule: &ScallopRule) -> Self {
        Self {
            scallop_mm: limits.scallop,
            scallop_share: rule.share,
            scallop_highest_mm: rule.highest * limits.scallop,
            gouge_mm: limits.gouge,
            uncut_mm: limits.uncut,
            chord_mm: limits.chord,
        }
    }
}

/// A file that the scene names, as it was read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct InputFile {
    /// As the scene has it.
    pub file: String,
    /// Its length.
    pub bytes: u64,
    /// Its SHA-256, in hexadecimal.
    pub sha256: String,
}

/// The highest material of a toolpath, as report.json has it.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct ExcessReport {
    /// The highest of all.
    #[serde(flatten)]
    pub highest: Bounded,
    /// What it is.
    pub kind: ExcessKind,
    /// The highest where passes came down to the design; `None` where its bound says nothing.
    pub reached: Option<Bounded>,
    /// The highest elsewhere.
    pub unreached: Bounded,
    /// Why a figure is missing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

impl From<ExcessFigures> for ExcessReport {
    fn from(excess: ExcessFigures) -> Self {
        let ExcessFigures { highest, kind, reached, unreached } = excess;
        Self { highest, kind, reached: Some(reached), unreached, reason: None }
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
    /// The files that the scene names: of the part, the fixtures, the feed directions.
    pub inputs: Vec<InputFile>,
    /// What the user calls the scene.
    pub title: String,
    /// That of the worst toolpath; one that was not planned fails the run.
    pub verdict: Verdict,
    /// Name of the quickest toolpath that passes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub best: Option<String>,
    /// What is to be said of the whole run.
    pub notes: Vec<String>,
    /// The tolerances.
    pub tolerance: ToleranceFigures,
    /// The toolpaths, in the order of the scene.
    pub toolpaths: Vec<ToolpathReport>,
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
    /// The report of some toolpaths under one scene that names no files, without notes.
    pub fn new(
        scene: String,
        scene_sha256: String,
        title: String,
        tolerance: ToleranceFigures,
        toolpaths: Vec<ToolpathReport>,
    ) -> Self {
        Self {
            millstream: env!("CARGO_PKG_VERSION"),
            scene,
            scene_sha256,
            inputs: Vec::new(),
            title,
            verdict: Verdict::of_run(toolpaths.iter().map(ToolpathReport::verdict)),
            best: best(&toolpaths).map(|t| t.name.clone()),
            notes: Vec::new(),
            tolerance,
            toolpaths,
        }
    }

    /// The toolpaths that cut one block in turn, or a single one.
    pub fn chains(&self) -> impl Iterator<Item = &[ToolpathReport]> {
        chains(&self.toolpaths)
    }

    /// The toolpaths that were planned, cut and measured.
    pub fn measured(&self) -> impl Iterator<Item = &ToolpathResult> {
        self.toolpaths.iter().filter_map(ToolpathReport::measured)
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

fn chains(toolpaths: &[ToolpathReport]) -> impl Iterator<Item = &[ToolpathReport]> {
    let is_behind = |next: &ToolpathReport| next.measured().is_some_and(|t| t.stock_is_previous);
    toolpaths.chunk_by(move |_, next| is_behind(next))
}

/// How long toolpaths take one after the other, s.
pub(super) fn time_of(chain: &[ToolpathReport]) -> f64 {
    chain.iter().filter_map(ToolpathReport::measured).map(|t| t.path.machining_time_s).sum()
}

/// The last toolpath of the quickest of those that pass; toolpaths that cut one block in turn are one.
fn best(toolpaths: &[ToolpathReport]) -> Option<&ToolpathResult> {
    let passing = chains(toolpaths).filter(|chain| chain.iter().all(|t| t.verdict() == Verdict::Pass));
    passing.min_by(|a, b| time_of(a).total_cmp(&time_of(b)))?.last()?.measured()
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

    fn edit(report: &mut RunReport, k: usize, change: impl FnOnce(&mut ToolpathResult)) {
        match &mut report.toolpaths[k] {
            ToolpathReport::Measured(result) => change(result),
            ToolpathReport::NotPlanned(missing) => panic!("{missing:?}"),
        }
    }

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
            edit(&mut report, 1, |t| t.deviation.rms_mm = Some(bad));
            let error = report.to_json().unwrap_err();
            assert_eq!(error, ReportError::NotFinite("report.toolpaths[1].deviation.rms_mm".into()));
        }
        let mut report = fixture::report();
        edit(&mut report, 0, |t| t.scallop.max_mm = None);
        assert!(report.to_json().is_err(), "null without a reason");
        edit(&mut report, 0, |t| t.scallop.reason = Some("no ridge".into()));
        assert!(report.to_json().is_ok());
    }

    #[test]
    fn the_quickest_that_passes_is_the_best() {
        let report = fixture::report();
        assert_eq!(report.best.as_deref(), Some("streamline"));
        assert_eq!(report.verdict, Verdict::Fail);
        let slower = ToolpathReport::Measured(Box::new(fixture::toolpath("slower", 900.0, 0.0)));
        let both = vec![slower, report.toolpaths[1].clone()];
        let report = RunReport::new("a".into(), "b".into(), "c".into(), fixture::tolerance(), both.clone());
        assert_eq!((report.best.as_deref(), report.verdict), (Some("streamline"), Verdict::Pass));
        // Two that cut one block in turn take longer than one that does it alone.
        let quick = |name: &str, stock_is_previous| {
            let one = fixture::toolpath(name, 300.0, 0.0);
            ToolpathReport::Measured(Box::new(ToolpathResult { stock_is_previous, ..one }))
        };
        let in_turn = |second: &str| {
            let all = vec![both[1].clone(), quick("rough", false), quick(second, true)];
            RunReport::new("a".into(), "b".into(), "c".into(), fixture::tolerance(), all)
        };
        let time = both[1].measured().unwrap().path.machining_time_s;
        assert!(time > 300.0 && time < 600.0, "{time}");
        assert_eq!(in_turn("finish").best.as_deref(), Some("streamline"));
        assert_eq!(in_turn("finish").chains().map(<[_]>::len).collect::<Vec<_>>(), [1, 2]);
        let missing = NotPlanned {
            name: "odd".into(),
            strategy: "streamline".into(),
            verdict: Verdict::NotPlanned,
            reason: "it has no feed direction".into(),
        };
        let all = [both, vec![ToolpathReport::NotPlanned(missing)]].concat();
        let report = RunReport::new("a".into(), "b".into(), "c".into(), fixture::tolerance(), all);
        assert_eq!((report.best.as_deref(), report.verdict), (Some("streamline"), Verdict::Fail));
        let read: serde_json::Value = serde_json::from_str(&report.to_json().unwrap()).unwrap();
        assert_eq!(read["toolpaths"][2]["verdict"], "not planned");
        assert_eq!(read["toolpaths"][2]["reason"], "it has no feed direction");
    }
}
