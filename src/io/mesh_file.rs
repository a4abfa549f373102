//! What STL and OBJ have in common: reading the bytes, the errors, and where in a file they are.

use std::path::{Path, PathBuf};

use geometry::{MAX_COORDINATE, MeshError, Point3, RepairNotes, TriangleMesh};

use crate::regular;

/// Greatest file that is read, bytes. Twenty million triangles in binary STL; reading it takes about
/// six times as much memory.
pub const MAX_BYTES: u64 = 1 << 30;

/// Longest piece of a file that is quoted in a message, in characters.
const LONGEST_QUOTE: usize = 40;

/// Where in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FilePlace {
    /// Byte offset, from 0.
    Byte(usize),
    /// Line, from 1.
    Line(usize),
}

impl std::fmt::Display for FilePlace {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Byte(offset) => write!(f, "byte {offset}"),
            Self::Line(line) => write!(f, "line {line}"),
        }
    }
}

/// Why the content of a mesh file is no mesh.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeshFileError {
    /// Nothing in it.
    #[error("the file is empty; export the part again")]
    Empty,
    /// Neither a binary STL file, which begins with 84 bytes of header, nor text.
    #[error(
        "{bytes} bytes that do not begin with \"solid\" are too few for a binary STL file; \
         export the part again"
    )]
    TooShort {
        /// Length of the file.
        bytes: usize,
    },
    /// The header of a binary STL file states another number of triangles than the file holds.
    #[error(
        "byte 80 of the file says {declared} triangles, which would make it {expected} bytes long, \
         but it is {actual} bytes long: it was {}; export or copy it again",
        if actual < expected { "cut off, or is no STL file" } else { "not written to its format" }
    )]
    Count {
        /// Triangles stated.
        declared: u32,
        /// Bytes that they take, with the header.
        expected: u64,
        /// Bytes that there are.
        actual: u64,
    },
    /// The text, or a line, ends too early.
    #[error("{place}: {expected} is missing; the file was cut off or damaged: export or copy it again")]
    Missing {
        /// Where.
        place: FilePlace,
        /// What is missing.
        expected: &'static str,
    },
    /// A word that does not belong there.
    #[error("{place}: {expected} should stand here, not \"{found}\"; {cure}")]
    Unexpected {
        /// Where.
        place: FilePlace,
        /// What would be right.
        expected: &'static str,
        /// What was found, shortened.
        found: String,
        /// What to do.
        cure: &'static str,
    },
    /// A coordinate that is no number, infinite, or too large.
    #[error(
        "{place}: {value} is no coordinate; it must be a number within ±{MAX_COORDINATE} mm: \
         check the units of the export, or export the part again"
    )]
    Coordinate {
        /// Where.
        place: FilePlace,
        /// The value.
        value: f64,
    },
    /// A face refers to a vertex that the file has not given before.
    #[error("{place}: the face refers to vertex {index}, but {vertices} vertices stand above it")]
    NoSuchVertex {
        /// Where.
        place: FilePlace,
        /// The index as written.
        index: i64,
        /// Vertices given so far.
        vertices: usize,
    },
    /// A face with too many corners.
    #[error(
        "{place}: the face has {corners} corners; at most {limit} are read: export the part as triangles"
    )]
    TooManyCorners {
        /// Where.
        place: FilePlace,
        /// How many.
        corners: usize,
        /// How many are allowed.
        limit: usize,
    },
    /// The triangles make no mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

/// Why a mesh file was not read.
#[derive(Debug, thiserror::Error)]
pub enum MeshReadError {
    /// The file system refused.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is too large.
    #[error("{} is {mib} MiB large, and at most {} MiB are read; export the part coarser", path.display(), most >> 20)]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its size.
        mib: u64,
        /// Bytes that may be read.
        most: u64,
    },
    /// The file holds too many triangles.
    #[error("{} has {triangles} triangles, and at most {most} are read; export the part coarser", path.display())]
    TooManyTriangles {
        /// The file.
        path: PathBuf,
        /// Triangles in it.
        triangles: usize,
        /// Triangles that may be read.
        most: usize,
    },
    /// The content is no mesh.
    #[error("{}: {source}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong, and where.
        source: MeshFileError,
    },
}

/// A format of mesh files.
pub struct MeshFormat {
    /// What it is called.
    pub word: &'static str,
    /// The extensions of its files, lower case.
    pub extensions: &'static [&'static str],
    pub(super) read: fn(&[u8]) -> Result<Corners, MeshFileError>,
    /// Triangles that a file has at least, counted in a glance.
    pub(super) count: fn(&[u8]) -> usize,
}

/// What is read of a mesh file at most.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshLimits {
    /// Its size.
    pub bytes: u64,
    /// Its triangles.
    pub triangles: usize,
    /// Vertices that are one but for rounding are welded over no more than this, in the file's unit.
    pub weld: f64,
}

impl Default for MeshLimits {
    fn default() -> Self {
        Self { bytes: MAX_BYTES, triangles: usize::MAX, weld: f64::INFINITY }
    }
}

impl MeshFormat {
    /// Reads a file of this format, whatever its extension.
    ///
    /// # Errors
    /// [`MeshReadError`] when it cannot be read or holds no mesh.
    pub fn read(&self, path: &Path) -> Result<(TriangleMesh, RepairNotes), MeshReadError> {
        self.read_within(path, &MeshLimits::default())
    }

    /// As [`MeshFormat::read`] within limits, which are checked before any memory is taken for what is beyond
    /// them.
    ///
    /// # Errors
    /// [`MeshReadError`] when it cannot be read, holds no mesh, or is beyond the limits.
    pub fn read_within(
        &self,
        path: &Path,
        limits: &MeshLimits,
    ) -> Result<(TriangleMesh, RepairNotes), MeshReadError> {
        let bytes = bytes_of(path, limits.bytes)?;
        let triangles = (self.count)(&bytes);
        if triangles > limits.triangles {
            return Err(MeshReadError::TooManyTriangles {
                path: path.to_owned(),
                triangles,
                most: limits.triangles,
            });
        }
        let parsed = (self.read)(&bytes).and_then(|corners| corners.mesh(limits.weld));
        parsed.map_err(|source| MeshReadError::Content { path: path.to_owned(), source })
    }
}

impl PartialEq for MeshFormat {
    fn eq(&self, other: &Self) -> bool {
        self.word == other.word
    }
}

impl std::fmt::Debug for MeshFormat {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.word)
    }
}

/// A mesh with what was changed to make it one, or why it is none.
pub(super) type Parsed = Result<(TriangleMesh, RepairNotes), MeshFileError>;

/// The triangles of a file.
pub(super) struct Corners {
    /// Places, in the file's unit.
    pub vertices: Vec<Point3>,
    /// Corners, as indices of them.
    pub triangles: Vec<[u32; 3]>,
}

/// Corners that are one but for rounding lie a step of f32 apart along each axis, 1.73 steps in space; and a
/// corner in the middle of an edge lies as far off it, since the three are rounded by half a step each. So many
/// steps leave room for the rounding of these distances.
const STEPS: f64 = 2.0;

impl Corners {
    /// A mesh of them. Neighbours that a modeller or its exporter rounded apart are welded, up to `most`.
    pub fn mesh(self, most: f64) -> Parsed {
        let tolerance = self.rounding().min(most);
        Ok(TriangleMesh::welded(self.vertices, self.triangles, tolerance)?)
    }

    /// How far rounding to f32 may set copies of a corner apart. Formats and modellers that store doubles often
    /// got them from f32, or from calculations that agree no better.
    fn rounding(&self) -> f64 {
        let used = self.triangles.iter().flatten().filter_map(|&v| self.vertices.get(v as usize));
        let largest = used.fold(0.0, |largest: f64, p| largest.max(p.coords.amax())) as f32;
        STEPS * (f64::from(largest.next_up()) - f64::from(largest))
    }
}

/// The bytes of a file of at most `most`.
fn bytes_of(path: &Path, most: u64) -> Result<Vec<u8>, MeshReadError> {
    let io = |source| MeshReadError::Io { path: path.to_owned(), source };
    let too_large =
        |bytes: u64| MeshReadError::TooLarge { path: path.to_owned(), mib: bytes.div_ceil(1 << 20), most };
    let size = regular::open(path).and_then(|file| file.metadata()).map_err(io)?.len();
    if size > most {
        return Err(too_large(size));
    }
    // It may have grown meanwhile.
    let bytes = regular::read(path, most).map_err(io)?;
    if bytes.len() as u64 > most { Err(too_large(bytes.len() as u64)) } else { Ok(bytes) }
}

/// A coordinate, if it is one.
pub(super) fn coordinate(value: f64, place: FilePlace) -> Result<f64, MeshFileError> {
    if value.abs() <= MAX_COORDINATE { Ok(value) } else { Err(MeshFileError::Coordinate { place, value }) }
}

/// A number written in a text file.
pub(super) fn number(word: &[u8], place: FilePlace) -> Result<f64, MeshFileError> {
    let parsed = std::str::from_utf8(word).ok().and_then(|w| w.parse().ok());
    let value = parsed.ok_or_else(|| {
        let cure = if word.contains(&b',') {
            "write decimals with a point, not with a comma"
        } else {
            "export the part again"
        };
        unexpected(word, "a number", cure, place)
    })?;
    coordinate(value, place)
}

/// An error about a word.
pub(super) fn unexpected(
    word: &[u8],
    expected: &'static str,
    cure: &'static str,
    place: FilePlace,
) -> MeshFileError {
    let text = String::from_utf8_lossy(&word[..word.len().min(4 * LONGEST_QUOTE)]);
    let printable = |c: char| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c };
    let mut found: String = text.chars().take(LONGEST_QUOTE).map(printable).collect();
    if text.chars().count() > LONGEST_QUOTE {
        found.push('…');
    }
    MeshFileError::Unexpected { place, expected, found, cure }
}

#[cfg(test)]
pub(super) mod tests {
    //! What every parser of mesh files must do with any bytes.
    use super::*;
    use proptest::prelude::*;

    /// Changes to a valid file: bytes overwritten, a piece cut out, a piece doubled.
    #[derive(Debug, Clone)]
    pub(crate) enum Damage {
        Overwrite(prop::sample::Index, u8),
        Cut(prop::sample::Index, prop::sample::Index),
        Double(prop::sample::Index, prop::sample::Index),
    }

    pub(crate) fn damages() -> impl Strategy<Value = Vec<Damage>> {
        let index = any::<prop::sample::Index>;
        let one = prop_oneof![
            (index(), any::<u8>()).prop_map(|(i, b)| Damage::Overwrite(i, b)),
            (index(), index()).prop_map(|(i, j)| Damage::Cut(i, j)),
            (index(), index()).prop_map(|(i, j)| Damage::Double(i, j)),
        ];
        prop::collection::vec(one, 1..5)
    }

    pub(crate) fn damaged(mut bytes: Vec<u8>, damages: &[Damage]) -> Vec<u8> {
        for damage in damages {
            if bytes.is_empty() {
                break;
            }
            let n = bytes.len();
            let range = |i: &prop::sample::Index, j: &prop::sample::Index| {
                let (i, j) = (i.index(n), j.index(n));
                i.min(j)..i.max(j)
            };
            match damage {
                Damage::Overwrite(i, b) => bytes[i.index(n)] = *b,
                Damage::Cut(i, j) => drop(bytes.drain(range(i, j))),
                Damage::Double(i, j) => {
                    let piece = bytes[range(i, j)].to_vec();
                    let end = range(i, j).end;
                    bytes.splice(end..end, piece);
                }
            }
        }
        bytes
    }

    /// Never a panic; a mesh of finite numbers, or a message that says something.
    pub(crate) fn holds_up(parse: fn(&[u8]) -> Parsed, bytes: &[u8]) {
        match parse(bytes) {
            Ok((mesh, _)) => {
                assert!(!mesh.triangles().is_empty());
                let vertices = mesh.vertices().iter().flat_map(|p| p.coords.iter());
                assert!(vertices.into_iter().all(|x| x.abs() <= MAX_COORDINATE));
                assert!((0..mesh.triangles().len()).all(|t| (mesh.normal(t).norm() - 1.0).abs() < 1e-9));
            }
            Err(error) => assert!(error.to_string().len() > 20, "{error}"),
        }
    }
}
