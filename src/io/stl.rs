//! STL files, binary and text, to meshes. Units are taken to be mm, since the format has none.
//!
//! Binary: 80 bytes of header, a 32-bit count, 50 bytes a triangle (normal and corners as
//! little-endian f32, and two bytes of attributes). Text: `solid … facet normal … outer loop vertex
//! … endloop endfacet … endsolid`, in upper or lower case, with any white space, and any number of
//! solids, which are read as one mesh. Stated normals are ignored; the order of corners decides.
//!
//! A file whose length fits its count is binary whatever its header says: many binary files begin
//! with "solid". A file that was cut off is refused, never read in part.
//!
//! The reader is our own: the common crate silently drops further solids and accepts NaN.

#[cfg(test)]
mod tests;

use std::path::Path;

use super::mesh_file::{
    Corners, FilePlace, MeshFileError, MeshFormat, MeshReadError, coordinate, number, unexpected,
};
use geometry::{Point3, RepairNotes, TriangleMesh};

/// STL, binary or text.
pub(super) const FORMAT: MeshFormat =
    MeshFormat { word: "STL", extensions: &["stl"], read: corners, count: triangles };

/// Bytes before the first triangle.
const HEADER: usize = 84;
/// Bytes of a triangle.
const RECORD: usize = 50;
/// Bytes of a triangle's stated normal.
const NORMAL: usize = 12;

const EXPORT_AGAIN: &str =
    "this is no STL text as the format wants it: export the part again, best as binary STL";

/// Reads a file.
///
/// # Errors
/// See [`MeshReadError`].
pub fn read(path: &Path) -> Result<(TriangleMesh, RepairNotes), MeshReadError> {
    FORMAT.read(path)
}

/// Reads the bytes of a file.
///
/// # Errors
/// See [`MeshFileError`].
pub fn parse(bytes: &[u8]) -> Result<(TriangleMesh, RepairNotes), MeshFileError> {
    corners(bytes)?.mesh(f64::INFINITY)
}

/// The triangles of a file, each of which states its own corners.
fn corners(bytes: &[u8]) -> Result<Corners, MeshFileError> {
    let vertices = match count(bytes) {
        Some((declared, expected)) if expected == bytes.len() as u64 => binary(bytes, declared)?,
        _ if bytes.is_empty() => return Err(MeshFileError::Empty),
        _ if is_text(bytes) => text(bytes)?,
        Some((declared, expected)) => {
            return Err(MeshFileError::Count { declared, expected, actual: bytes.len() as u64 });
        }
        None => return Err(MeshFileError::TooShort { bytes: bytes.len() }),
    };
    let triangles = (0..vertices.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    Ok(Corners { vertices, triangles })
}

/// The triangles that a file has if it is whole.
fn triangles(bytes: &[u8]) -> usize {
    match count(bytes) {
        Some((declared, expected)) if expected == bytes.len() as u64 => declared as usize,
        _ => {
            const END: &[u8] = b"endfacet";
            let begins =
                |k: usize| bytes[k..].get(..END.len()).is_some_and(|word| word.eq_ignore_ascii_case(END));
            (0..bytes.len()).filter(|&k| matches!(bytes[k], b'e' | b'E') && begins(k)).count()
        }
    }
}

/// The triangles that a binary file states, and its length if that is true.
fn count(bytes: &[u8]) -> Option<(u32, u64)> {
    let field = bytes.get(HEADER - 4..HEADER)?;
    let declared = u32::from_le_bytes(field.try_into().ok()?);
    Some((declared, HEADER as u64 + u64::from(declared) * RECORD as u64))
}

/// Text begins with "solid" and has no zero byte in its first line, which binary headers are
/// padded with, nor in what follows.
fn is_text(bytes: &[u8]) -> bool {
    /// Enough to meet the padding or the coordinates of a binary file.
    const LOOK_AT: usize = 1024;
    let start = &bytes[..bytes.len().min(LOOK_AT)];
    let mut words = Words::of(start);
    words.next().is_some_and(|w| w.eq_ignore_ascii_case(b"solid")) && !start.contains(&0)
}

fn binary(bytes: &[u8], declared: u32) -> Result<Vec<Point3>, MeshFileError> {
    let mut corners = Vec::with_capacity(3 * declared as usize);
    for (t, record) in bytes[HEADER..].chunks_exact(RECORD).enumerate() {
        let mut numbers = [0.0; 9];
        for (k, field) in record[NORMAL..NORMAL + 36].chunks_exact(4).enumerate() {
            let value = f32::from_le_bytes([field[0], field[1], field[2], field[3]]);
            let place = FilePlace::Byte(HEADER + t * RECORD + NORMAL + 4 * k);
            numbers[k] = coordinate(f64::from(value), place)?;
        }
        corners.extend(numbers.chunks_exact(3).map(Point3::from_slice));
    }
    Ok(corners)
}

/// The words of a text with the lines they stand in.
struct Words<'a> {
    rest: &'a [u8],
    /// Line of the next byte, from 1.
    line: usize,
}

impl<'a> Words<'a> {
    fn of(bytes: &'a [u8]) -> Self {
        let rest = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
        Self { rest, line: 1 }
    }

    fn next(&mut self) -> Option<&'a [u8]> {
        while let Some((&byte, rest)) = self.rest.split_first() {
            if !byte.is_ascii_whitespace() {
                break;
            }
            self.line += usize::from(byte == b'\n');
            self.rest = rest;
        }
        let end = self.rest.iter().position(u8::is_ascii_whitespace).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        self.rest = rest;
        (!word.is_empty()).then_some(word)
    }

    /// Passes over the rest of the line.
    fn skip_line(&mut self) {
        let end = self.rest.iter().position(|&b| b == b'\n').unwrap_or(self.rest.len());
        self.rest = &self.rest[end..];
    }

    fn place(&self) -> FilePlace {
        FilePlace::Line(self.line)
    }

    fn required(&mut self, expected: &'static str) -> Result<&'a [u8], MeshFileError> {
        self.next().ok_or(MeshFileError::Missing { place: self.place(), expected })
    }

    /// The next word must be one of these; says which.
    fn one_of(&mut self, words: &[&str], expected: &'static str) -> Result<usize, MeshFileError> {
        let found = self.required(expected)?;
        let known = words.iter().position(|w| found.eq_ignore_ascii_case(w.as_bytes()));
        known.ok_or_else(|| unexpected(found, expected, EXPORT_AGAIN, self.place()))
    }
}

fn text(bytes: &[u8]) -> Result<Vec<Point3>, MeshFileError> {
    let mut words = Words::of(bytes);
    let mut corners = Vec::new();
    while let Some(word) = words.next() {
        if !word.eq_ignore_ascii_case(b"solid") {
            return Err(unexpected(word, "\"solid\"", EXPORT_AGAIN, words.place()));
        }
        // Its name may hold anything, also the words of the format.
        words.skip_line();
        while words.one_of(&["facet", "endsolid"], "\"facet\" or \"endsolid\"")? == 0 {
            facet(&mut words, &mut corners)?;
        }
        words.skip_line();
    }
    Ok(corners)
}

/// One facet, after the word itself.
fn facet(words: &mut Words<'_>, corners: &mut Vec<Point3>) -> Result<(), MeshFileError> {
    // The normal is ignored and may be anything, also left out: three numbers, "nan", "-nan(ind)".
    /// `normal`, its three numbers, `outer`.
    const MOST_WORDS: usize = 5;
    let mut before_loop = 0;
    loop {
        let word = words.required("\"outer loop\"")?;
        before_loop += 1;
        if word.eq_ignore_ascii_case(b"outer") {
            break;
        }
        if before_loop >= MOST_WORDS {
            return Err(unexpected(word, "\"outer loop\"", EXPORT_AGAIN, words.place()));
        }
    }
    words.one_of(&["loop"], "\"loop\"")?;
    for _ in 0..3 {
        words.one_of(&["vertex"], "\"vertex\"")?;
        let mut point = [0.0; 3];
        for x in &mut point {
            let word = words.required("a coordinate")?;
            *x = number(word, words.place())?;
        }
        corners.push(Point3::from(point));
    }
    words.one_of(&["endloop"], "\"endloop\" after three corners")?;
    words.one_of(&["endfacet"], "\"endfacet\"")?;
    Ok(())
}
