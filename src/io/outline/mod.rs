//! Outlines of plane regions from drawings.
//!
//! Enters: a drawing of one of [`OUTLINE_FORMATS`]. Leaves: closed polylines in mm, y up, and the entity that
//! each came from. Curves are flattened within a chord tolerance; open chains are joined where ends lie
//! within [`JOIN_TOLERANCE`]. How far the polylines lie off the curves by both is bounded. Nothing is left
//! out in silence: what cannot be an outline is refused with file, line and place, or named in a note.

mod chain;
mod curve;
pub mod dxf;
pub mod svg;
#[cfg(test)]
mod tests;

use std::path::Path;

use geometry::{Point2, Region, RegionError};

use crate::mesh_formats::extension;
use crate::regular;

/// Ends of open chains that lie no farther apart are joined, mm. Drawings are exact to four decimals as a
/// rule; much more would close gaps that were meant, or join neighbours.
pub const JOIN_TOLERANCE: f64 = 0.01;

/// Points that lie no farther apart, mm, are one but for rounding of the file.
pub const ROUNDING: f64 = 1.0e-6;

/// Largest drawing that is read, bytes.
pub const MAX_BYTES: u64 = 64 << 20;

/// The formats of drawings, in the order in which messages list them: a new one is a file of its own and a
/// line here.
pub const OUTLINE_FORMATS: [OutlineFormat; 2] = [dxf::FORMAT, svg::FORMAT];

/// Extensions of the files of all formats, lower case.
pub const EXTENSIONS: [&str; OUTLINE_FORMATS.len()] = {
    let mut extensions = [""; OUTLINE_FORMATS.len()];
    let mut k = 0;
    while k < extensions.len() {
        extensions[k] = OUTLINE_FORMATS[k].extension;
        k += 1;
    }
    extensions
};

/// A format of drawings.
#[derive(Debug, Clone, Copy)]
pub struct OutlineFormat {
    /// The extension of its files, lower case.
    pub extension: &'static str,
    parse: ParseDrawing,
}

/// Takes the bytes of a drawing, how it is read, and what was left out so far.
type ParseDrawing = fn(&[u8], &OutlineOptions, &mut Vec<String>) -> Result<Vec<Drawn>, OutlineError>;

impl PartialEq for OutlineFormat {
    fn eq(&self, other: &Self) -> bool {
        self.extension == other.extension
    }
}

impl OutlineFormat {
    /// The format of a file, by its extension.
    pub fn of(path: &Path) -> Option<Self> {
        let extension = extension(path)?;
        OUTLINE_FORMATS.into_iter().find(|format| format.extension == extension)
    }
}

/// How a drawing is read.
#[derive(Debug, Clone, PartialEq)]
pub struct OutlineOptions {
    /// Largest distance between a curve and its chords, mm. What it is at most in the end is known better.
    pub chord_tolerance: f64,
    /// One unit of the drawing in mm; `None`: as the file says (a DXF without units is in mm, an SVG
    /// without them has 96 to the inch).
    pub scale: Option<f64>,
    /// Only entities of this layer (DXF), or within the element of this id or Inkscape label (SVG).
    pub layer: Option<String>,
}

/// Why a drawing holds no outlines.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{}{what}", line.map_or_else(String::new, |line| format!("line {line}: ")))]
pub struct OutlineError {
    /// Line of the file, counted from 1, where there is one to name.
    pub line: Option<usize>,
    /// What is wrong, where, and what would help.
    pub what: String,
}

impl OutlineError {
    fn at(line: usize, what: impl Into<String>) -> Self {
        Self { line: Some(line), what: what.into() }
    }

    fn new(what: impl Into<String>) -> Self {
        Self { line: None, what: what.into() }
    }
}

/// A curve of a drawing as chords, mm.
#[derive(Debug, Clone, PartialEq)]
struct Chords {
    points: Vec<Point2>,
    /// Whether the drawing says that the last point is joined to the first.
    closed: bool,
    /// The curve and its chords lie no farther apart.
    off_curve: f64,
}

impl Chords {
    fn open(points: Vec<Point2>) -> Self {
        Self { points, closed: false, off_curve: 0.0 }
    }

    fn closed(points: Vec<Point2>) -> Self {
        Self { closed: true, ..Self::open(points) }
    }
}

/// A polyline of a drawing, and where it has it.
#[derive(Debug, Clone, PartialEq)]
struct Drawn {
    chords: Chords,
    /// Its line in the file and its kind (`LINE`, `circle`).
    line: usize,
    entity: String,
}

impl Drawn {
    fn name(&self) -> String {
        format!("{} (line {})", self.entity, self.line)
    }
}

/// The closed outlines of a drawing.
#[derive(Debug, Clone, PartialEq)]
pub struct Outlines {
    /// The region that they bound: outlines, islands in them, outlines in those.
    pub region: Region,
    /// The region's border and the curves as they were drawn lie no farther apart, mm.
    pub off_curves: f64,
    /// What was left out or joined, in words.
    pub notes: Vec<String>,
}

/// Reads a drawing.
///
/// # Errors
/// [`OutlineError`].
pub fn read(path: &Path, format: OutlineFormat, options: &OutlineOptions) -> Result<Outlines, OutlineError> {
    let bytes = regular::read(path, MAX_BYTES).map_err(|e| OutlineError::new(e.to_string()))?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(OutlineError::new(format!("it is larger than {} MiB", MAX_BYTES >> 20)));
    }
    parse(&bytes, format, options)
}

/// Outlines from the bytes of a drawing.
///
/// # Errors
/// [`OutlineError`].
pub fn parse(
    bytes: &[u8],
    format: OutlineFormat,
    options: &OutlineOptions,
) -> Result<Outlines, OutlineError> {
    let mut notes = Vec::new();
    let drawn = (format.parse)(bytes, options, &mut notes)?;
    if drawn.is_empty() {
        let place = options.layer.as_ref().map_or_else(String::new, |layer| format!(" on \"{layer}\""));
        // What was left out may be what was meant.
        let left_out = notes.iter().filter(|note| note.contains("left out")).map(String::as_str);
        let left_out: String = left_out.map(|note| format!("; {note}")).collect();
        return Err(OutlineError::new(format!("it has no outlines{place}{left_out}")));
    }
    let closed = chain::join(drawn, &mut notes)?;
    let names: Vec<String> = closed.iter().map(Drawn::name).collect();
    let off_curves = closed.iter().map(|d| d.chords.off_curve).fold(0.0, f64::max);
    let curves = closed.into_iter().map(|d| d.chords.points).collect();
    let (region, _) = Region::nested(curves).map_err(|e| blame(&e, &names))?;
    Ok(Outlines { region, off_curves, notes })
}

fn blame(error: &RegionError, names: &[String]) -> OutlineError {
    let name = |k: usize| names.get(k).map_or("an outline", String::as_str);
    OutlineError::new(match *error {
        RegionError::Coordinate { curve, .. }
        | RegionError::NoArea { curve }
        | RegionError::SelfCrossing { curve, .. } => format!("{}: {error}", name(curve)),
        RegionError::Crossing { curves: [a, b], at } => {
            format!(
                "{} and {} meet at x {:.4} y {:.4}; outlines and islands must stay apart",
                name(a),
                name(b),
                at.x,
                at.y
            )
        }
        RegionError::Duplicate { curves: [a, b] } => {
            format!("{} and {} are the same outline; delete one", name(a), name(b))
        }
        RegionError::Empty | RegionError::TooManyPoints(_) => error.to_string(),
    })
}
