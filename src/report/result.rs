//! What one run found, as reports show it, and report.json.

use serde::Serialize;

use super::verdict::{Verdict, Violation};
use field::{PassPoint, PlannedField, ShortestPossible};
use machine::kinematics::{JointReport, Kinematics};
use metrology::{
    DeviationFigures, GougeFigures, Limits, OffsetFigures, PairFigures, PathFigures, PocketFigures,
    RemovalFigures, RoughnessFigures, ScallopFigures, SectionFigures, UncutFigures,
};

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

/// The way of one joint.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct JointRange {
    /// Its letter.
    pub joint: char,
    /// Least and greatest value, mm, or degrees of a rotary joint.
    pub range: [f64; 2],
}

/// How the joints of a five-axis machine move along a path.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MachineFigures {
    /// X, Y, Z and the two rotary joints.
    pub joints: Vec<JointRange>,
    /// How far each of the rotary joints turns in all.
    pub rotary_travel_deg: [f64; 2],
    /// Places where the tool axis comes within a degree of the first rotary axis.
    pub singular_poses: usize,
    /// Turns for which the tool leaves the part.
    pub rewinds: usize,
    /// Locations put in to keep the tool within the chord tolerance.
    pub inserted_locations: usize,
}

impl MachineFigures {
    /// Of the joints along a path.
    pub fn new(kinematics: &Kinematics, report: &JointReport) -> Self {
        let ranges = kinematics.letters().into_iter().zip(report.ranges);
        let shown = |(k, (joint, range)): (usize, (char, [f64; 2]))| JointRange {
            joint,
            range: if k < 3 { range } else { range.map(f64::to_degrees) },
        };
        Self {
            joints: ranges.enumerate().map(shown).collect(),
            rotary_travel_deg: report.rotary_travel.map(f64::to_degrees),
            singular_poses: report.singular.len(),
            rewinds: report.rewinds.len(),
            inserted_locations: report.inserted,
        }
    }
}

/// The solid that is left of a block, by voxels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SolidFigures {
    /// Pitch of the voxels.
    pub voxel_mm: f64,
    /// Bricks of 8³ voxels that the surface passes.
    pub bricks: usize,
    /// Volume that is left.
    pub volume_mm3: f64,
    /// How much it differs from that by voxels twice as large: three times its error, which falls with their square.
    pub volume_error_bound_mm3: f64,
    /// Volume that was cut away.
    pub removed_mm3: f64,
    /// As the bound of the volume that is left.
    pub removed_error_bound_mm3: f64,
    /// Triangles of solid.stl.
    pub triangles: usize,
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
    /// What no path can be shorter than, for one planned by scallop height.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shortest: Option<ShortestFigures>,
    /// What it was planned by, for a streamline.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub field: Option<FieldFigures>,
    /// How the machine's joints move, on a machine of five axes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub machine: Option<MachineFigures>,
    /// Scallops.
    pub scallop: ScallopFigures,
    /// Scallops of pairs of passes, calculated beside measured.
    pub scallop_pairs: PairFigures,
    /// Roughness across the feed; not of pockets.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub roughness: Option<RoughnessFigures>,
    /// Gouges.
    pub gouge: GougeFigures,
    /// Uncut material.
    pub uncut: UncutFigures,
    /// Deviation in all.
    pub deviation: DeviationFigures,
    /// Deviation at the sections of a blade, where it is measured along its normals.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sections: Vec<SectionFigures>,
    /// What each move removed, if the scene asks for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub removal: Option<RemovalFigures>,
    /// Walls and engagement, if the part is a pocket.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pocket: Option<PocketFigures>,
    /// What is left of the block, if the scene asks for voxels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub solid: Option<SolidFigures>,
    /// The offset surface that the ball's centre rides on, for a path along one on patches.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset: Option<OffsetFigures>,
    /// How it was cut.
    pub simulation: SimulationFigures,
    /// The machined part as triangles.
    pub surface_mesh: SurfaceMeshFigures,
}

/// The length that no path below the scallop height can go under, by the widest strips over all directions, to second
/// order.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ShortestFigures {
    /// Of the cutter's way, as `path.cutting_length_mm` is.
    pub cutting_length_mm: f64,
    /// Of the contact's way on the part: the integral of 1/(widest strip).
    pub contact_length_mm: f64,
    /// The first of these over the path's cutting length.
    pub efficiency: f64,
    /// Share of the part's area where it is about as concave as the cutter and the strip was limited.
    pub limited_fraction: f64,
}

impl ShortestFigures {
    /// Of a path with a cutting length, mm; `None` for an empty one.
    pub fn new(shortest: &ShortestPossible, cutting_length_mm: f64) -> Option<Self> {
        (cutting_length_mm > 0.0).then(|| Self {
            cutting_length_mm: shortest.cutting_mm,
            contact_length_mm: shortest.contact_mm,
            efficiency: shortest.cutting_mm / cutting_length_mm,
            limited_fraction: shortest.limited_fraction,
        })
    }
}

/// A point around which the feed directions turn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SingularPointFigures {
    /// Where.
    pub at_mm: [f64; 3],
    /// Turns of the direction on a way around it: 0.5 for the end of a fold, 1 for a centre, -0.5 for a three-way
    /// junction, -1 for a saddle.
    pub index: f64,
}

/// Planned intervals over the allowed ones, at even distances along all passes; at each place of the farther neighbour.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct IntervalFigures {
    /// 5 % are narrower.
    pub p5: f64,
    /// Half are narrower.
    pub p50: f64,
    /// 95 % are narrower.
    pub p95: f64,
    /// The widest.
    pub max: f64,
}

/// What a streamline path was planned by. Predictions of the planner; nothing of it is measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FieldFigures {
    /// Number of singular points.
    pub singular_point_count: usize,
    /// The first of them, 100 at most.
    pub singular_points: Vec<SingularPointFigures>,
    /// Intervals over the allowed ones, where passes have neighbours.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interval_over_allowed: Option<IntervalFigures>,
}

/// Most singular points in report.json. Noise can make thousands.
pub const MOST_SINGULAR_POINTS: usize = 100;

impl FieldFigures {
    /// Of a planned field.
    pub fn new(field: &PlannedField) -> Self {
        let mut ratios: Vec<f64> =
            field.passes.iter().flatten().filter(|p| p.inside).filter_map(PassPoint::ratio).collect();
        ratios.sort_by(f64::total_cmp);
        let at =
            |share: f64| Some(*ratios.get((share * ratios.len().checked_sub(1)? as f64).round() as usize)?);
        let interval_over_allowed = (|| {
            Some(IntervalFigures { p5: at(0.05)?, p50: at(0.5)?, p95: at(0.95)?, max: *ratios.last()? })
        })();
        let point = |s: &field::mesh::SingularPoint| SingularPointFigures {
            at_mm: s.position.into(),
            index: 0.5 * f64::from(s.half_turns),
        };
        Self {
            singular_point_count: field.singular_points.len(),
            singular_points: field.singular_points.iter().take(MOST_SINGULAR_POINTS).map(point).collect(),
            interval_over_allowed,
        }
    }
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
