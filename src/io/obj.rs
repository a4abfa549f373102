//! OBJ files (Wavefront, 1992) to meshes: `v` and `f` lines. Units are taken to be mm.
//!
//! All objects and groups are read as one mesh. Normals, texture coordinates, colours, materials, lines,
//! points and all other statements are passed over: they do not change the shape. Faces with more than three
//! corners are cut into triangles; a free-form surface (`curv`, `surf`) is refused, since the part would lack
//! it in silence.
//!
//! The reader is our own: the common crate turns polylines into faces, can panic on missing texture
//! coordinates, fans concave polygons, and reports a bad index without its line.

mod polygon;
#[cfg(test)]
mod tests;

use std::path::Path;

use super::mesh_file::{Corners, FilePlace, MeshFileError, MeshFormat, MeshReadError, number, unexpected};
use geometry::{Point3, RepairNotes, TriangleMesh};

/// Wavefront OBJ.
pub(super) const FORMAT: MeshFormat =
    MeshFormat { word: "OBJ", extensions: &["obj"], read: corners, count: faces };

/// Most corners of a face. Cutting a face takes time with their square, at worst with their cube.
const MAX_CORNERS: usize = 2_000;

/// Statements that carry surface in a form that is not read.
const FREE_FORM: [&[u8]; 4] = [b"surf", b"curv", b"curv2", b"bzp"];

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

/// The faces of a file as triangles.
fn corners(bytes: &[u8]) -> Result<Corners, MeshFileError> {
    if bytes.is_empty() {
        return Err(MeshFileError::Empty);
    }
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let mut file = File::default();
    let mut lines = bytes.split(|&b| b == b'\n').enumerate();
    let mut statement = Vec::new();
    while let Some((k, first)) = lines.next() {
        statement.clear();
        statement.extend_from_slice(first);
        // A backslash at the end joins the next line.
        while let Some(b'\\') = statement.trim_ascii_end().last() {
            statement.truncate(statement.trim_ascii_end().len() - 1);
            statement.push(b' ');
            match lines.next() {
                Some((_, next)) => statement.extend_from_slice(next),
                None => break,
            }
        }
        file.statement(&statement, FilePlace::Line(k + 1))?;
    }
    Ok(Corners { vertices: file.vertices, triangles: file.triangles })
}

/// The faces of a file, each of which gives a triangle or more.
fn faces(bytes: &[u8]) -> usize {
    bytes.split(|&b| b == b'\n').filter(|line| line.trim_ascii_start().starts_with(b"f ")).count()
}

/// What was read so far.
#[derive(Default)]
struct File {
    vertices: Vec<Point3>,
    triangles: Vec<[u32; 3]>,
    /// The corners of the current face; kept to reuse its memory.
    corners: Vec<u32>,
}

impl File {
    fn statement(&mut self, line: &[u8], place: FilePlace) -> Result<(), MeshFileError> {
        let line = line.split(|&b| b == b'#').next().unwrap_or_default();
        let mut words = line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
        match words.next() {
            Some(b"v") => self.vertex(words, place),
            Some(b"f" | b"fo") => self.face(words, place),
            Some(word) if FREE_FORM.contains(&word) => {
                Err(unexpected(word, "a vertex or a face", "export the part as triangles", place))
            }
            _ => Ok(()),
        }
    }

    /// `x y z`, then a weight (1 on all but free-form surfaces) or a colour: both passed over.
    fn vertex<'a>(
        &mut self,
        mut words: impl Iterator<Item = &'a [u8]>,
        place: FilePlace,
    ) -> Result<(), MeshFileError> {
        let mut point = [0.0; 3];
        for x in &mut point {
            let word = words.next().ok_or(MeshFileError::Missing { place, expected: "a coordinate" })?;
            *x = number(word, place)?;
        }
        self.vertices.push(Point3::from(point));
        Ok(())
    }

    /// Corners as `v`, `v/vt`, `v//vn` or `v/vt/vn`; only the vertex counts.
    fn face<'a>(
        &mut self,
        words: impl Iterator<Item = &'a [u8]>,
        place: FilePlace,
    ) -> Result<(), MeshFileError> {
        self.corners.clear();
        for word in words {
            let corner = self.corner(word, place)?;
            self.corners.push(corner);
        }
        let corners = self.corners.len();
        if corners < 3 {
            return Err(MeshFileError::Missing { place, expected: "a third corner of the face" });
        }
        if corners > MAX_CORNERS {
            return Err(MeshFileError::TooManyCorners { place, corners, limit: MAX_CORNERS });
        }
        polygon::cut(&self.vertices, &mut self.corners, &mut self.triangles);
        Ok(())
    }

    /// The vertex of one corner: counted from 1, or back from the last one when negative.
    fn corner(&self, word: &[u8], place: FilePlace) -> Result<u32, MeshFileError> {
        let digits = word.split(|&b| b == b'/').next().unwrap_or_default();
        let index: i64 = std::str::from_utf8(digits)
            .ok()
            .and_then(|d| d.parse().ok())
            .ok_or_else(|| unexpected(word, "the number of a vertex", "export the part again", place))?;
        let vertices = self.vertices.len();
        let from_zero =
            if index < 0 { index.saturating_add(vertices as i64) } else { index.saturating_sub(1) };
        match u32::try_from(from_zero) {
            Ok(vertex) if (vertex as usize) < vertices => Ok(vertex),
            _ => Err(MeshFileError::NoSuchVertex { place, index, vertices }),
        }
    }
}
