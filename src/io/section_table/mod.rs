//! Sections of blades from files: tables of points, and blades generated from stations.
//!
//! The extension decides: `.toml` is a generated blade ([`parse_blade`]), anything else a table
//! ([`parse_table`]).
//!
//! # Tables
//!
//! ```text
//! # Rotor 7, cold
//! unit mm                  # um, mm, cm, m or inch; before the first section, mm without it
//! leading -x               # optional: which end of closed outlines leads (-x, +x, -y, +y)
//!
//! section 0                # its height
//! closed                   # the points of a closed outline, in either sense
//! 20.0   0.0
//! 18.2   1.4  0            # a third number is z, and must be the section's height
//!
//! section 5.5
//! pressure                 # or both sides, each from leading to trailing edge
//! -20, 0
//! suction
//! -20, 0
//! ```
//!
//! (Curves need five points or more.) Numbers stand apart by blanks, tabs, commas or semicolons; `#` begins a
//! comment; empty lines are passed over; words may be in upper or lower case. A closed outline may repeat its
//! first point at its end. What sections must be like is told at [`Sections::new`].
//!
//! # Generated blades
//!
//! ```toml
//! unit = "mm"                          # of every length here
//! sections = 12                        # how many are made, at equal steps of height
//! points = 60                          # a side
//! trailing_edge = { radius = 0.3 }     # or "closed" (sharp), "open" (blunt as published)
//! stacking = 0.25                      # the point that leans and turns: a share of the chord, or "centroid"
//!
//! [[station]]
//! height = 0
//! naca = "6412"
//! chord = 40
//! angle = 20                           # degrees, from x to the chord, counter-clockwise seen from above
//! thickness = 0.13                     # share of the chord, in place of the last two digits
//! lean = [0, 0]                        # where the stacking point lies
//!
//! [[station]]
//! height = 60
//! naca = "2408"
//! chord = 30
//! angle = 50
//! ```
//!
//! Between stations quantities follow monotone cubics; see [`GeneratedBlade`].

mod generated;
mod table;
#[cfg(test)]
mod tests;
mod write;

use std::path::{Path, PathBuf};

pub use generated::parse_blade;
pub use table::{SectionTableError, parse_table};
pub use write::write_table;

use blade::sections::{GenerateError, GeneratedBlade, Sections};
use keys::{SceneError, SceneText};

use crate::regular;

/// Greatest file that is read, bytes: the most points that are allowed take a third of it.
pub const MAX_BYTES: u64 = 32 << 20;

/// Units that lengths may be in, and each in mm.
const UNITS: [(&str, f64); 5] = [("mm", 1.0), ("cm", 10.0), ("m", 1000.0), ("inch", 25.4), ("um", 0.001)];

/// Why a file holds no sections.
#[derive(Debug, thiserror::Error)]
pub enum SectionFileError {
    /// The file system refused.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is too large.
    #[error("{} is greater than {} MiB; thin out its points", path.display(), MAX_BYTES >> 20)]
    TooLarge {
        /// The file.
        path: PathBuf,
    },
    /// The table cannot be used.
    #[error("{}, {source}", path.display())]
    Table {
        /// The file.
        path: PathBuf,
        /// What is wrong, and where.
        source: SectionTableError,
    },
    /// The text of a generated blade cannot be used.
    #[error("{message}")]
    Blade {
        /// File, line, column, what is wrong and what cures it.
        message: String,
        /// The same as a finding with the lines that are meant.
        source: SceneError,
    },
    /// The blade cannot be generated.
    #[error("{}: {source}", path.display())]
    Generate {
        /// The file.
        path: PathBuf,
        /// Why.
        source: GenerateError,
    },
}

/// Reads the sections of a file.
///
/// # Errors
/// [`SectionFileError`].
pub fn read(path: &Path) -> Result<Sections, SectionFileError> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
        let generate = |source| SectionFileError::Generate { path: path.to_owned(), source };
        return read_blade(path)?.generate().map_err(generate);
    }
    parse_table(&bytes(path)?).map_err(|source| SectionFileError::Table { path: path.to_owned(), source })
}

/// Reads the stations of a generated blade.
///
/// # Errors
/// [`SectionFileError`].
pub fn read_blade(path: &Path) -> Result<GeneratedBlade, SectionFileError> {
    let bytes = bytes(path)?;
    let text = std::str::from_utf8(&bytes).map_err(|e| {
        let source = table::not_text(&bytes, e.valid_up_to());
        SectionFileError::Table { path: path.to_owned(), source }
    })?;
    let text = SceneText::new(path.to_string_lossy(), text);
    parse_blade(&text).map_err(|source| SectionFileError::Blade { message: told(&text, &source), source })
}

fn bytes(path: &Path) -> Result<Vec<u8>, SectionFileError> {
    let io = |source| SectionFileError::Io { path: path.to_owned(), source };
    let bytes = regular::read(path, MAX_BYTES).map_err(io)?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(SectionFileError::TooLarge { path: path.to_owned() });
    }
    Ok(bytes)
}

/// An error of a text in one line, with its place and cure.
fn told(text: &SceneText, error: &SceneError) -> String {
    let SceneError::Invalid(finding) = error else { return error.to_string() };
    let (line, column) = text.line_and_column(finding.at.offset());
    let place = format!("{}:{line}:{column}: ", text.name);
    // Where the text cannot be shown the message begins with the place.
    let message = finding.message.strip_prefix(&place).unwrap_or(&finding.message);
    format!("{place}{message}; {}", finding.cure)
}
