//! The list of the sources of a part, and what reads, writes and loads all of them: a new source is a
//! file of its own and a line of the list.

mod blade;
mod formula;
mod mesh;
mod nurbs;
mod pocket;
mod source;

pub use blade::BladeRequest;
pub use formula::FormulaSource;
pub use mesh::MeshFile;
pub(crate) use mesh::read_mesh;
pub use nurbs::NurbsSource;
pub(crate) use pocket::flattening;
pub use pocket::{EarlierCutter, OpenLine, OutlineSource, PocketSource, unmeasured_beside_walls};
pub(crate) use source::Loading;
pub use source::{LoadError, Loaded};

use std::fmt::{self, Write as _};
use std::path::Path;

use crate::named_file::NamedFile;
use keys::{SceneError, Section, listed, toml_string};
use metrology::Judged;
use source::{PartTable, Source};

/// What the list says of a source.
struct SourceKind {
    surfaces: fn() -> Vec<&'static str>,
    key: Option<&'static str>,
    keys: fn() -> Vec<&'static str>,
    example: Option<&'static str>,
    extensions: &'static [&'static str],
    read: fn(&PartTable<'_>) -> Result<PartSource, SceneError>,
}

/// Makes [`PartSource`] and the list of its kinds from a line for each.
macro_rules! part_sources {
    ($($(#[$doc:meta])* $name:ident($source:ty),)*) => {
        /// Where the part comes from.
        #[derive(Debug, Clone, PartialEq)]
        pub enum PartSource {
            $($(#[$doc])* $name($source),)*
        }

        const KINDS: &[SourceKind] = &[$(SourceKind {
            surfaces: <$source>::surfaces,
            key: <$source>::KEY,
            keys: <$source>::keys,
            example: <$source>::EXAMPLE,
            extensions: <$source>::EXTENSIONS,
            read: |table| <$source>::read(table).map(PartSource::$name),
        },)*];

        impl PartSource {
            /// The file that the part comes from, if it comes from one.
            pub fn file(&self) -> Option<&NamedFile> {
                match self {
                    $(Self::$name(source) => source.file(),)*
                }
            }

            fn write_keys(&self, out: &mut String) -> fmt::Result {
                match self {
                    $(Self::$name(source) => source.write(out),)*
                }
            }

            /// Makes the part.
            pub(crate) fn load(&self, job: &Loading<'_>) -> Result<Loaded, LoadError> {
                match self {
                    $(Self::$name(source) => source.load(job),)*
                }
            }
        }
    };
}

part_sources! {
    /// A triangle mesh.
    Mesh(MeshFile),
    /// A blade from its sections.
    Blade(BladeRequest),
    /// NURBS patches in a JSON file.
    Nurbs(NurbsSource),
    /// A pocket: a plane region with islands, cut down to a level floor.
    Pocket(PocketSource),
    /// A surface by formula over a rectangle.
    Formula(FormulaSource),
}

/// The values of `surface`.
fn words() -> Vec<&'static str> {
    KINDS.iter().flat_map(|kind| (kind.surfaces)()).collect()
}

/// The keys of all sources, each once.
fn all_keys() -> Vec<&'static str> {
    let mut all = vec!["surface", JUDGE];
    for key in KINDS.iter().flat_map(|kind| (kind.keys)()) {
        if !all.contains(&key) {
            all.push(key);
        }
    }
    all
}

/// The key for what of the part is judged.
pub(crate) const JUDGE: &str = "judge";

/// Reads what of the part is judged.
pub(crate) fn read_judged(part: &Section<'_>) -> Result<Judged, SceneError> {
    let word = part.word(JUDGE, &Judged::ALL.map(Judged::word))?;
    Ok(word.and_then(|word| Judged::from_word(word.value)).unwrap_or_default())
}

/// Reads `[part]`.
pub(crate) fn read(part: &Section<'_>, folder: &Path) -> Result<PartSource, SceneError> {
    let all_keys = all_keys();
    let surface = part.word("surface", &words())?;
    let means = |kind: &&SourceKind| match &surface {
        Some(word) => (kind.surfaces)().contains(&word.value),
        None => kind.key.is_some_and(|key| part.has(key)),
    };
    let Some(kind) = KINDS.iter().find(means) else {
        part.only(&all_keys, &[], "a part")?;
        let examples: Vec<&str> = KINDS.iter().filter_map(|kind| kind.example).collect();
        return Err(part.error(
            part.header(),
            "the scene does not say which part to make",
            format!("add a table [part] with {}", listed(&examples)),
        ));
    };
    if surface.is_none() {
        check_extension(part)?;
    }
    (kind.read)(&PartTable { table: part, folder, all_keys: &all_keys })
}

/// Refuses a file that only a value of `surface` says how to read.
fn check_extension(part: &Section<'_>) -> Result<(), SceneError> {
    if !part.is_text("file") {
        return Ok(());
    }
    let Some(file) = part.text("file")? else { return Ok(()) };
    let Some(extension) = io::extension(Path::new(file.value)) else { return Ok(()) };
    let kind = KINDS.iter().find(|kind| kind.extensions.contains(&extension.as_str()));
    let Some(word) = kind.and_then(|kind| (kind.surfaces)().first().copied()) else { return Ok(()) };
    let message = format!("a .{extension} file needs to say what it holds");
    Err(part.error(&file.span, message, format!("add `surface = \"{word}\"`")))
}

/// Writes `[part]`.
pub(crate) fn write(out: &mut String, part: &PartSource, judged: Judged) -> fmt::Result {
    writeln!(out, "[part]")?;
    part.write_keys(out)?;
    writeln!(out, "{JUDGE} = {}  # {}", toml_string(judged.word()), judged.meaning())
}
