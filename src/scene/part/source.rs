//! What every source of a part has: its words and keys, its reader, its writer, and the part itself.

use std::fmt;
use std::path::Path;

use blade::Blade;
use cutter::Cutter;
use keys::{Located, SceneError, SceneText, Section};
use part::{Part, PartError, Patch, default_tessellation_tolerance};
use toolpath::Pocket;

use super::JUDGE;
use crate::named_file::NamedFile;

/// A kind of source. Which one `[part]` means is said by `surface`, or else by the key that it has.
pub(crate) trait Source: Sized {
    /// The key that means it where there is no `surface`.
    const KEY: Option<&'static str> = None;
    /// How it begins in a scene; `None` where another source shows the same.
    const EXAMPLE: Option<&'static str> = None;
    /// The extensions of its files.
    const EXTENSIONS: &'static [&'static str] = &[];

    /// The values of `surface` that mean it.
    fn surfaces() -> Vec<&'static str> {
        Vec::new()
    }

    /// All its keys but `surface`.
    fn keys() -> Vec<&'static str>;

    /// Reads it.
    fn read(table: &PartTable<'_>) -> Result<Self, SceneError>;

    /// Writes it as scenes spell it.
    fn write(&self, out: &mut String) -> fmt::Result;

    /// The file that it comes from.
    fn file(&self) -> Option<&NamedFile> {
        None
    }

    /// Makes the part.
    fn load(&self, job: &Loading<'_>) -> Result<Loaded, LoadError>;
}

/// The table `[part]`.
pub(crate) struct PartTable<'a> {
    pub table: &'a Section<'a>,
    /// The scene's folder.
    pub folder: &'a Path,
    /// The keys of all sources.
    pub all_keys: &'a [&'static str],
}

impl PartTable<'_> {
    /// Refuses every key but `keys`; those of other sources do not apply to `what`.
    pub fn only(&self, keys: &[&str], what: &str) -> Result<(), SceneError> {
        let keys: Vec<&str> = keys.iter().copied().chain([JUDGE]).collect();
        self.table.only(&keys, self.all_keys, what)
    }

    /// A file beside the scene.
    pub fn named(&self, file: Located<&str>) -> NamedFile {
        NamedFile::beside(self.folder, file.value, file.span)
    }

    /// The value of `surface`; empty where it is not there.
    pub fn surface(&self) -> Result<Located<&str>, SceneError> {
        Ok(self.table.text("surface")?.unwrap_or(Located { value: "", span: self.table.header().clone() }))
    }
}

/// What a source needs of the scene to make its part.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Loading<'a> {
    pub source: &'a SceneText,
    pub cutter: &'a Cutter,
    /// mm.
    pub chord_tolerance: f64,
    /// How far curves of drawings may lie off the chords that stand for them, mm.
    pub flattening: f64,
    /// How far the stock's block stands out beyond the part on all sides, if it is one around the part, mm.
    pub margin: Option<f64>,
    /// Memory that the run may take.
    pub memory_mib: u32,
}

impl Loading<'_> {
    /// A file's fault, shown at its name in the scene.
    pub fn refused(&self, file: &NamedFile, fault: impl fmt::Display) -> SceneError {
        file_refused(self.source, file, fault)
    }
}

/// A file's fault, shown at its name in the scene.
pub(crate) fn file_refused(source: &SceneText, file: &NamedFile, fault: impl fmt::Display) -> SceneError {
    source.error(
        file.span.clone(),
        format!("the file cannot be used: {fault}"),
        "mend that file or name another one",
    )
}

/// A part as its scene describes it.
#[derive(Debug)]
pub struct Loaded {
    /// What is made.
    pub part: Part,
    /// The sections that it comes from, if it is a blade.
    pub blade: Option<Blade>,
    /// What it is the floor of, if it is a pocket.
    pub pocket: Option<Pocket>,
    /// What was mended to make it usable.
    pub notes: Vec<String>,
}

impl From<Part> for Loaded {
    fn from(part: Part) -> Self {
        Self { part, blade: None, pocket: None, notes: Vec::new() }
    }
}

/// Why a scene's part could not be loaded.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum LoadError {
    /// The scene, or a file that it names, cannot be used.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Scene(#[from] SceneError),
    /// The part's surface cannot be searched.
    #[error("{scene}: the part cannot be used: {reason}")]
    #[diagnostic(help("change [part] in the scene"))]
    Part {
        /// The scene, as its messages call it.
        scene: String,
        /// What is wrong with the surface.
        reason: PartError,
    },
}

/// The part of some patches.
pub(crate) fn of_patches(patches: Vec<Patch>) -> Result<Part, PartError> {
    let tolerance = default_tessellation_tolerance(&patches);
    Part::from_patches(patches, tolerance)
}

/// A part that has an area in the plan view, which alone can be milled along z.
pub(crate) fn seen_from_above(part: Part) -> Result<Part, String> {
    let size = part.bounds().size();
    if size.x > 0.0 && size.y > 0.0 {
        return Ok(part);
    }
    Err(format!(
        "seen from above it is a line, {} x {} mm: the cutter's axis is z, so turn the part before exporting it",
        size.x, size.y
    ))
}
