//! The results of a nightly: what nightly.json holds. Lengths in mm, times in s.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::str::FromStr;

use report::Verdict;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::figures::{FIGURES, Figure};
use super::words::number;

/// The format of nightly.json that this version writes and reads.
const FORMAT: u32 = 1;

/// Why results are none.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum ResultsError {
    /// The text is no nightly.json.
    #[error("it is no nightly.json of a nightly: {0}")]
    Json(String),
    /// Another version wrote it.
    #[error("it has format {0}, and this version reads format {FORMAT}")]
    Format(u32),
    /// The report of a scene lacks something.
    #[error("report.json has no {0}")]
    Report(&'static str),
    /// One scene came from two shards.
    #[error("scene {0} is in two of the folders")]
    Twice(String),
    /// The shards are not those of one nightly.
    #[error("the folders are no complete set of shards: {0}")]
    Shards(String),
}

/// One toolpath of a scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ToolpathResult {
    /// Its name in the scene.
    pub name: String,
    /// Its strategy.
    #[serde(default)]
    pub strategy: String,
    /// Its verdict.
    pub verdict: Verdict,
    /// Values of [`FIGURES`] by their keys. What was not measured is not there.
    pub figures: BTreeMap<String, f64>,
    /// Error bounds of those figures that have one, mm.
    pub bounds: BTreeMap<String, f64>,
    /// Further values, by their place in the toolpath of report.json (RFC 6901).
    #[serde(default)]
    pub further: BTreeMap<String, f64>,
}

/// What became of a scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// It ran.
    Done {
        /// That of the worst toolpath.
        verdict: Verdict,
        /// In the order of the scene.
        toolpaths: Vec<ToolpathResult>,
    },
    /// It could not run, or was stopped.
    Failed {
        /// Why.
        reason: String,
    },
}

/// What a scene's run took.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    /// From start to end, s.
    pub wall_s: f64,
    /// Of all its threads, s; `None` where the system does not tell.
    pub cpu_s: Option<f64>,
    /// Highest resident memory that was seen, MiB; `None` where the system does not tell.
    pub peak_mib: Option<f64>,
    /// The least that the reference work took on this machine that night, s.
    pub reference_s: f64,
}

impl Cost {
    /// CPU time, or else time from start to end, as a multiple of the reference work's time. It is what two
    /// machines, or one on two nights, can compare. `None` where the reference work took no time.
    pub fn ratio(&self) -> Option<f64> {
        let ratio = self.cpu_s.unwrap_or(self.wall_s) / self.reference_s;
        ratio.is_finite().then_some(ratio)
    }
}

/// Which scene was run, and how.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Case {
    /// The scene's path below the folder that was given, with slashes, without `.toml`.
    pub scene: String,
    /// The engine instead of the scene's.
    pub engine: Option<String>,
    /// The cell instead of the scene's, mm.
    pub cell_mm: Option<f64>,
}

impl Case {
    /// A scene as it is written.
    pub fn plain(scene: &str) -> Self {
        Self { scene: scene.to_owned(), engine: None, cell_mm: None }
    }

    /// Whether the scene is run as it is written.
    pub fn is_plain(&self) -> bool {
        self.engine.is_none() && self.cell_mm.is_none()
    }

    /// The case's own name: the scene's, and what replaces its settings.
    pub fn name(&self) -> String {
        let engine = self.engine.iter().map(|engine| format!(" {engine}"));
        let cell = self.cell_mm.iter().map(|cell| format!(" {cell} mm"));
        self.scene.clone() + &engine.chain(cell).collect::<String>()
    }
}

/// What a figure is by a closed form, in the figure's unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ClosedForm {
    /// Its value.
    pub value: f64,
    /// How far from it the truth may be, because a program's places are rounded.
    pub within: f64,
}

/// One scene of a nightly.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SceneResult {
    /// That of its case.
    pub name: String,
    /// Which scene, and how it was run.
    pub case: Case,
    /// Closed forms of its figures, by their keys.
    pub exact: BTreeMap<String, ClosedForm>,
    /// SHA-256 over the program, the scene, its files and what replaces its settings.
    pub digest: String,
    /// The scene's report.html, from the folder of nightly.json, with slashes; `None` where the scene failed.
    pub page: Option<String>,
    /// What became of it.
    pub outcome: Outcome,
    /// What it took.
    pub cost: Cost,
}

impl SceneResult {
    /// The verdict in a word, or "failed".
    pub fn word(&self) -> &'static str {
        match &self.outcome {
            Outcome::Done { verdict, .. } => verdict.word(),
            Outcome::Failed { .. } => "failed",
        }
    }

    /// [`Cost::ratio`]; `None` where it failed, since nobody knows how far it came.
    pub fn cost_ratio(&self) -> Option<f64> {
        match self.outcome {
            Outcome::Done { .. } => self.cost.ratio(),
            Outcome::Failed { .. } => None,
        }
    }

    /// Its toolpaths; none where it failed.
    pub fn toolpaths(&self) -> &[ToolpathResult] {
        match &self.outcome {
            Outcome::Done { toolpaths, .. } => toolpaths,
            Outcome::Failed { .. } => &[],
        }
    }
}

impl Outcome {
    /// What the text of a report.json says, with the `further` values of each toolpath that stand at these
    /// places.
    ///
    /// # Errors
    /// [`ResultsError`] where it is none.
    pub fn of_report(text: &str, further: &[&str]) -> Result<Self, ResultsError> {
        let report: Value = serde_json::from_str(text).map_err(|e| ResultsError::Json(e.to_string()))?;
        let verdict = verdict_of(&report).ok_or(ResultsError::Report("verdict"))?;
        let toolpaths = report["toolpaths"].as_array().ok_or(ResultsError::Report("toolpaths"))?;
        let toolpaths = toolpaths.iter().map(|value| toolpath(value, further)).collect::<Result<_, _>>()?;
        Ok(Self::Done { verdict, toolpaths })
    }
}

fn verdict_of(value: &Value) -> Option<Verdict> {
    Verdict::deserialize(&value["verdict"]).ok()
}

impl ToolpathResult {
    /// A figure with its error bound, if it has one, as the pages show it; a dash where it was not measured.
    pub(crate) fn shown(&self, figure: &Figure) -> String {
        let value =
            self.figures.get(figure.key).map_or_else(|| "–".into(), |value| number(figure.shown(*value)));
        match self.bounds.get(figure.key) {
            Some(bound) => format!("{value} ± {}", report::bound(*bound)),
            None => value,
        }
    }
}

fn toolpath(value: &Value, further: &[&str]) -> Result<ToolpathResult, ResultsError> {
    let name = value["name"].as_str().ok_or(ResultsError::Report("name of a toolpath"))?;
    let verdict = verdict_of(value).ok_or(ResultsError::Report("verdict of a toolpath"))?;
    let figures = FIGURES.iter().filter_map(|figure| Some((figure.key.to_owned(), figure.of(value)?)));
    let bounds = FIGURES.iter().filter_map(|figure| Some((figure.key.to_owned(), figure.bound_of(value)?)));
    let further = further.iter().filter_map(|at| Some(((*at).to_owned(), value.pointer(at)?.as_f64()?)));
    Ok(ToolpathResult {
        name: name.to_owned(),
        strategy: value["strategy"].as_str().unwrap_or_default().to_owned(),
        verdict,
        figures: figures.collect(),
        bounds: bounds.collect(),
        further: further.collect(),
    })
}

/// Which part of the scenes a machine takes: of the sorted scenes, each `count`-th from `index` on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shard {
    /// From 1.
    pub index: usize,
    /// How many shards there are.
    pub count: usize,
}

impl Shard {
    /// Whether it takes the scene with this number, from 0, of the sorted ones.
    pub fn takes(&self, number: usize) -> bool {
        number % self.count == self.index - 1
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        let shard = numbers.map(|(index, count)| Self { index, count });
        let in_range = |shard: &Self| (1..=shard.count).contains(&shard.index);
        shard
            .filter(in_range)
            .ok_or_else(|| "give two whole numbers i/n with i from 1 to n, such as 1/4".into())
    }
}

/// The results of a nightly.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Results {
    /// The format of the file.
    pub(super) format: u32,
    /// Version of the program.
    pub millstream: String,
    /// When it ended, UTC, as `2026-11-23T04:30:00Z`.
    pub date: String,
    /// Which part of the scenes it is; `None` for all of them.
    pub shard: Option<Shard>,
    /// Sorted by name.
    pub scenes: Vec<SceneResult>,
}

impl Results {
    /// Results of these scenes, which need not be sorted.
    pub fn new(millstream: &str, date: String, shard: Option<Shard>, mut scenes: Vec<SceneResult>) -> Self {
        scenes.sort_by(|a, b| a.name.cmp(&b.name));
        Self { format: FORMAT, millstream: millstream.to_owned(), date, shard, scenes }
    }

    /// Reads nightly.json.
    ///
    /// # Errors
    /// [`ResultsError::Json`] and [`ResultsError::Format`].
    pub fn from_json(text: &str) -> Result<Self, ResultsError> {
        #[derive(Deserialize)]
        struct Head {
            format: u32,
        }
        let bad = |error: serde_json::Error| ResultsError::Json(error.to_string());
        // The format first: another one may lack the rest.
        match serde_json::from_str(text).map_err(bad)? {
            Head { format: FORMAT } => serde_json::from_str(text).map_err(bad),
            Head { format } => Err(ResultsError::Format(format)),
        }
    }

    /// The text of nightly.json.
    ///
    /// # Errors
    /// [`ResultsError::Json`]; numbers and texts always succeed.
    pub fn to_json(&self) -> Result<String, ResultsError> {
        let text = serde_json::to_string_pretty(self).map_err(|e| ResultsError::Json(e.to_string()))?;
        Ok(text + "\n")
    }

    /// The scene of this name.
    pub fn scene(&self, name: &str) -> Option<&SceneResult> {
        self.scenes.iter().find(|scene| scene.name == name)
    }
}

/// The results of all shards as one machine would have them. The date is the latest of theirs.
///
/// # Errors
/// [`ResultsError::Twice`], and [`ResultsError::Shards`] where one is missing or comes from another nightly.
pub fn merge(shards: Vec<Results>) -> Result<Results, ResultsError> {
    complete(&shards)?;
    let Some(millstream) = shards.first().map(|first| first.millstream.clone()) else {
        return Err(ResultsError::Shards("there is none".into()));
    };
    let date = shards.iter().map(|shard| shard.date.clone()).max().unwrap_or_default();
    let scenes: Vec<SceneResult> = shards.into_iter().flat_map(|shard| shard.scenes).collect();
    let mut names = BTreeSet::new();
    match scenes.iter().find(|scene| !names.insert(scene.name.as_str())) {
        Some(scene) => Err(ResultsError::Twice(scene.name.clone())),
        None => Ok(Results::new(&millstream, date, None, scenes)),
    }
}

/// Refuses shards of several versions, of several counts, or with one missing.
fn complete(results: &[Results]) -> Result<(), ResultsError> {
    let refused = |reason: String| Err(ResultsError::Shards(reason));
    let versions: BTreeSet<&str> = results.iter().map(|r| r.millstream.as_str()).collect();
    if versions.len() > 1 {
        return refused(format!("they come from versions {}", Vec::from_iter(versions).join(" and ")));
    }
    let shards: Vec<Shard> = results.iter().filter_map(|r| r.shard).collect();
    let Some(first) = shards.first() else { return Ok(()) };
    if shards.len() < results.len() || shards.iter().any(|shard| shard.count != first.count) {
        return refused("they were not made with one n of --shard i/n".into());
    }
    // Shards that are there are few, whatever n a file claims.
    let there: BTreeSet<usize> = shards.iter().map(|shard| shard.index).collect();
    match (1..=first.count).find(|index| !there.contains(index)) {
        Some(missing) => refused(format!("shard {missing}/{} is missing", first.count)),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixture::{results, scene};
    use super::*;

    #[test]
    fn a_report_gives_its_figures() {
        let text = r#"{"verdict": "fail", "toolpaths": [
            {"name": "a", "verdict": "pass", "excess": {"max_mm": 0.01, "error_bound_mm": 0.001}, "scallop": {"max_mm": null}},
            {"name": "b", "verdict": "not planned", "reason": "no room"}]}"#;
        let Ok(Outcome::Done { verdict, toolpaths }) = Outcome::of_report(text, &["/scallop/target_mm"])
        else {
            panic!()
        };
        assert_eq!((verdict, toolpaths[1].verdict), (Verdict::Fail, Verdict::NotPlanned));
        assert_eq!(toolpaths[0].figures, BTreeMap::from([("highest_mm".to_owned(), 0.01)]));
        assert_eq!(toolpaths[0].bounds, BTreeMap::from([("highest_mm".to_owned(), 0.001)]));
        for bad in ["", "[]", "{}", r#"{"verdict": "pass"}"#, r#"{"verdict": "good", "toolpaths": []}"#] {
            assert!(Outcome::of_report(bad, &[]).is_err(), "{bad}");
        }
    }

    #[test]
    fn results_come_back_from_their_text() {
        let all = results(vec![scene("b", 0.01), scene("a", 0.02)]);
        assert_eq!(all.scenes[0].name, "a");
        let text = all.to_json().unwrap();
        assert_eq!(Results::from_json(&text), Ok(all));
        let later = text.replace("\"format\": 1", "\"format\": 2");
        assert_eq!(Results::from_json(&later), Err(ResultsError::Format(2)));
        assert!(Results::from_json("{}").is_err());
    }

    #[test]
    fn shards_take_each_scene_once() {
        let shards: Vec<Shard> = ["1/3", "2/3", "3/3"].map(|s| s.parse().unwrap()).into();
        for number in 0..10 {
            assert_eq!(shards.iter().filter(|shard| shard.takes(number)).count(), 1);
        }
        for bad in ["0/3", "4/3", "1", "1/0", "a/b", "-1/2", "", "1/2/3"] {
            assert!(bad.parse::<Shard>().is_err(), "{bad}");
        }
    }

    #[test]
    fn shards_are_merged_when_all_are_there() {
        let part = |index, names: &[&str]| Results {
            shard: Some(Shard { index, count: 2 }),
            ..results(names.iter().map(|name| scene(name, 0.01)).collect())
        };
        let merged = merge(vec![part(2, &["b"]), part(1, &["c", "a"])]).unwrap();
        assert_eq!(merged, results(["a", "b", "c"].map(|name| scene(name, 0.01)).into()));
        assert_eq!(merge(vec![part(1, &["a"])]), Err(ResultsError::Shards("shard 2/2 is missing".into())));
        assert_eq!(merge(vec![part(1, &["a"]), part(2, &["a"])]), Err(ResultsError::Twice("a".into())));
        assert!(merge(vec![]).is_err());
        assert!(merge(vec![part(1, &["a"]), results(vec![])]).is_err());
    }
}
