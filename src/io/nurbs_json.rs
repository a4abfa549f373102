//! NURBS patches as JSON: the plain form in which surfaces come from scripts and other programs.
//!
//! ```json
//! {"unit": "mm",
//!  "patches": [
//!   {"degree_u": 1, "degree_v": 1,
//!    "knots_u": [0, 0, 1, 1], "knots_v": [0, 0, 1, 1],
//!    "control_points": [[[0, 0, 0], [0, 20, 0]], [[30, 0, 5], [30, 20, 5]]],
//!    "weights": [[1, 1], [1, 1]]}]}
//! ```
//!
//! `control_points[i][j]` is `[x, y, z]` in mm and belongs to the `i`-th basis function of u and the
//! `j`-th of v; `weights` has the same shape and may be left out (all 1). Knots are given in full:
//! control points + degree + 1 of them. A file with a single patch may leave `patches` out and
//! give the patch's keys beside `unit`. Unknown keys are refused. JSON has no NaN or infinity, and
//! numbers beyond f64 (1e999) are refused.

use geometry::{NurbsError, NurbsSurface, Point3};
use serde::Deserialize;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use crate::regular;

/// Greatest file that is read, bytes. Text of this length holds about a million control points; more
/// is a mistake or a mesh in disguise.
pub const MAX_BYTES: u64 = 64 << 20;

/// Greatest number of patches of one file. Each brings its own search mesh.
pub const MAX_PATCHES: usize = 10_000;

/// Keys of a file, for suggestions.
const KEYS: [&str; 8] =
    ["unit", "patches", "degree_u", "degree_v", "knots_u", "knots_v", "control_points", "weights"];

/// A key counts as a misspelling of a known one from this likeness on (1: equal).
const LIKENESS: f64 = 0.7;

/// What is wrong with a text, and where.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("line {line}, column {column}: {message}")]
pub struct NurbsJsonError {
    /// Line, from 1. For a patch that cannot be used, where it ends.
    pub line: usize,
    /// Column, from 1.
    pub column: usize,
    /// What was found and what would help.
    pub message: String,
}

/// Why a file was not read.
#[derive(Debug, thiserror::Error)]
pub enum NurbsFileError {
    /// The file system refused.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is too large.
    #[error("{} is greater than {} MiB; split it, or thin out its control points", path.display(), MAX_BYTES >> 20)]
    TooLarge {
        /// The file.
        path: PathBuf,
    },
    /// The text cannot be used.
    #[error("{}, {source}", path.display())]
    Text {
        /// The file.
        path: PathBuf,
        /// What is wrong, and where.
        source: NurbsJsonError,
    },
}

/// Reads all patches of a file.
///
/// # Errors
/// See [`NurbsFileError`].
pub fn read(path: &Path) -> Result<Vec<NurbsSurface>, NurbsFileError> {
    let io = |source| NurbsFileError::Io { path: path.to_owned(), source };
    let bytes = regular::read(path, MAX_BYTES).map_err(io)?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(NurbsFileError::TooLarge { path: path.to_owned() });
    }
    let in_file = |source| NurbsFileError::Text { path: path.to_owned(), source };
    let text = std::str::from_utf8(&bytes).map_err(|e| {
        let (line, column) = position(&bytes[..e.valid_up_to()]);
        in_file(NurbsJsonError { line, column, message: "not UTF-8 text; save the file as UTF-8".into() })
    })?;
    parse(text).map_err(in_file)
}

/// Line and column, from 1, of the end of `text`.
fn position(text: &[u8]) -> (usize, usize) {
    let line_start = text.iter().rposition(|&b| b == b'\n').map_or(0, |k| k + 1);
    (1 + text.iter().filter(|&&b| b == b'\n').count(), 1 + text.len() - line_start)
}

/// Reads all patches of a text.
///
/// # Errors
/// See [`NurbsJsonError`].
pub fn parse(text: &str) -> Result<Vec<NurbsSurface>, NurbsJsonError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    match serde_json::from_str::<CheckedFile>(text) {
        Ok(file) => Ok(file.0),
        Err(e) => {
            Err(NurbsJsonError { line: e.line().max(1), column: e.column().max(1), message: explain(&e) })
        }
    }
}

/// The reader's message without its position, and with a suggestion.
fn explain(error: &serde_json::Error) -> String {
    let full = error.to_string();
    let place = format!(" at line {} column {}", error.line(), error.column());
    let message = full.strip_suffix(&place).unwrap_or(&full);
    let unknown = message.strip_prefix("unknown field `").and_then(|rest| rest.split('`').next());
    if let Some(key) = unknown {
        let likeness = |known: &str| strsim::jaro_winkler(key, known);
        let best = KEYS.into_iter().max_by(|a, b| likeness(a).total_cmp(&likeness(b)));
        return match best.filter(|known| likeness(known) >= LIKENESS) {
            Some(known) => format!("unknown key \"{key}\"; did you mean \"{known}\"?"),
            None => format!("unknown key \"{key}\"; the keys are {}", KEYS.join(", ")),
        };
    }
    if let Some(rest) = message.strip_prefix("missing field `") {
        return format!("the key \"{}\" is missing", rest.trim_end_matches('`'));
    }
    if error.is_eof() {
        return format!("the text ends too early ({message}); is the file complete?");
    }
    message.replace('`', "\"")
}

/// The file as written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFile {
    unit: Millimetres,
    patches: Option<Vec<CheckedPatch>>,
    degree_u: Option<usize>,
    degree_v: Option<usize>,
    knots_u: Option<Vec<f64>>,
    knots_v: Option<Vec<f64>>,
    control_points: Option<Vec<Vec<[f64; 3]>>>,
    weights: Option<Vec<Vec<f64>>>,
}

/// One patch as written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPatch {
    degree_u: usize,
    degree_v: usize,
    knots_u: Vec<f64>,
    knots_v: Vec<f64>,
    control_points: Vec<Vec<[f64; 3]>>,
    weights: Option<Vec<Vec<f64>>>,
}

/// Checked while the reader still knows where in the text it stands.
#[derive(Deserialize)]
#[serde(try_from = "RawPatch")]
struct CheckedPatch(NurbsSurface);

#[derive(Deserialize)]
#[serde(try_from = "RawFile")]
struct CheckedFile(Vec<NurbsSurface>);

#[derive(Deserialize)]
#[serde(try_from = "String")]
struct Millimetres;

/// What a patch or a file lacks beyond its syntax.
#[derive(Debug, thiserror::Error)]
enum ContentError {
    #[error("this patch cannot be used: {0}")]
    Patch(#[from] NurbsError),
    #[error("the unit is \"{0}\"; only \"mm\" is read (multiply inches by 25.4)")]
    Unit(String),
    #[error("there is no patch; give \"patches\", or the keys of one patch")]
    Empty,
    #[error("\"{0}\" stands beside \"patches\"; give the keys of a patch inside of \"patches\"")]
    Both(&'static str),
    #[error("the key \"{0}\" is missing")]
    Missing(&'static str),
    #[error("there are {0} patches, and {MAX_PATCHES} are allowed; split the file")]
    TooMany(usize),
}

impl TryFrom<String> for Millimetres {
    type Error = ContentError;
    fn try_from(unit: String) -> Result<Self, ContentError> {
        if unit == "mm" { Ok(Self) } else { Err(ContentError::Unit(unit)) }
    }
}

impl TryFrom<RawPatch> for CheckedPatch {
    type Error = ContentError;
    fn try_from(raw: RawPatch) -> Result<Self, ContentError> {
        let points: Vec<Vec<Point3>> =
            raw.control_points.into_iter().map(|row| row.into_iter().map(Point3::from).collect()).collect();
        let weights = raw.weights.as_deref();
        let surface =
            NurbsSurface::new(raw.degree_u, raw.degree_v, raw.knots_u, raw.knots_v, &points, weights)?;
        Ok(Self(surface))
    }
}

impl TryFrom<RawFile> for CheckedFile {
    type Error = ContentError;
    fn try_from(raw: RawFile) -> Result<Self, ContentError> {
        let RawFile { unit: Millimetres, .. } = raw;
        let given = [
            ("degree_u", raw.degree_u.is_some()),
            ("degree_v", raw.degree_v.is_some()),
            ("knots_u", raw.knots_u.is_some()),
            ("knots_v", raw.knots_v.is_some()),
            ("control_points", raw.control_points.is_some()),
            ("weights", raw.weights.is_some()),
        ];
        let first_given = given.iter().find(|g| g.1).map(|g| g.0);
        if let Some(patches) = raw.patches {
            return match first_given {
                Some(key) => Err(ContentError::Both(key)),
                None if patches.is_empty() => Err(ContentError::Empty),
                None if patches.len() > MAX_PATCHES => Err(ContentError::TooMany(patches.len())),
                None => Ok(Self(patches.into_iter().map(|p| p.0).collect())),
            };
        }
        if first_given.is_none() {
            return Err(ContentError::Empty);
        }
        let single = RawPatch {
            degree_u: raw.degree_u.ok_or(ContentError::Missing("degree_u"))?,
            degree_v: raw.degree_v.ok_or(ContentError::Missing("degree_v"))?,
            knots_u: raw.knots_u.ok_or(ContentError::Missing("knots_u"))?,
            knots_v: raw.knots_v.ok_or(ContentError::Missing("knots_v"))?,
            control_points: raw.control_points.ok_or(ContentError::Missing("control_points"))?,
            weights: raw.weights,
        };
        Ok(Self(vec![CheckedPatch::try_from(single)?.0]))
    }
}

/// Patches as the text that [`parse`] reads back to the same numbers (control points of rational
/// patches to the last digit but one, since they are kept multiplied by their weights).
pub fn to_text(patches: &[NurbsSurface]) -> String {
    let mut text = String::from("{\"unit\": \"mm\",\n \"patches\": [");
    for (k, patch) in patches.iter().enumerate() {
        text.push_str(if k == 0 { "\n" } else { ",\n" });
        write_patch(&mut text, patch);
    }
    text.push_str("]}\n");
    text
}

fn write_patch(text: &mut String, patch: &NurbsSurface) {
    let (u, v) = (patch.knots_u(), patch.knots_v());
    let list = |numbers: &[f64]| numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(", ");
    let rows = |entry: &dyn Fn(usize, usize) -> String| {
        let row = |i| (0..v.control_count()).map(|j| entry(i, j)).collect::<Vec<_>>().join(", ");
        (0..u.control_count()).map(|i| format!("[{}]", row(i))).collect::<Vec<_>>().join(",\n    ")
    };
    let points = rows(&|i, j| format!("[{}]", list(patch.control_point(i, j).0.coords.as_slice())));
    // Writing to a string cannot fail.
    let _ = write!(
        text,
        "  {{\"degree_u\": {}, \"degree_v\": {},\n   \"knots_u\": [{}],\n   \"knots_v\": [{}],\n   \
         \"control_points\": [\n    {points}]",
        u.degree(),
        v.degree(),
        list(u.knots()),
        list(v.knots()),
    );
    let rational =
        (0..u.control_count()).any(|i| (0..v.control_count()).any(|j| patch.control_point(i, j).1 != 1.0));
    if rational {
        let weights = rows(&|i, j| patch.control_point(i, j).1.to_string());
        let _ = write!(text, ",\n   \"weights\": [\n    {weights}]");
    }
    text.push('}');
}

#[cfg(test)]
mod tests;
