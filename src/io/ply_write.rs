//! Binary PLY of a triangle mesh with a colour and a deviation at every vertex (little-endian, mm).
//!
//! The writer is our own: the format is a text header and plain records, while the common crate keeps
//! every vertex as a table of named values, several hundred bytes each.

use std::io::{self, Write};

/// What stands at the vertices; all three of the same length.
#[derive(Debug, Clone, Copy)]
pub struct Vertices<'a> {
    /// Places, mm.
    pub places: &'a [[f32; 3]],
    /// Red, green and blue.
    pub colours: &'a [[u8; 3]],
    /// Deviation from the design, mm; NaN where there is none.
    pub deviations: &'a [f32],
}

/// Writes triangles given by vertex indices: 19 bytes a vertex, 13 a triangle.
///
/// # Errors
/// What the writer says; [`io::ErrorKind::InvalidInput`] for an index out of range or lists of
/// different lengths.
pub fn write(out: &mut dyn Write, vertices: &Vertices<'_>, triangles: &[[u32; 3]]) -> io::Result<()> {
    let invalid = |what: &str| io::Error::new(io::ErrorKind::InvalidInput, what);
    let count = vertices.places.len();
    if vertices.colours.len() != count || vertices.deviations.len() != count {
        return Err(invalid("every vertex needs a place, a colour and a deviation"));
    }
    write!(
        out,
        "ply\nformat binary_little_endian 1.0\n\
         comment written by millstream; lengths in mm; deviation is positive where material stands on the design\n\
         element vertex {count}\nproperty float x\nproperty float y\nproperty float z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float deviation\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        triangles.len()
    )?;
    for ((place, colour), deviation) in vertices.places.iter().zip(vertices.colours).zip(vertices.deviations)
    {
        let mut record = [0u8; 19];
        for (bytes, number) in record.chunks_exact_mut(4).zip(place) {
            bytes.copy_from_slice(&number.to_le_bytes());
        }
        record[12..15].copy_from_slice(colour);
        record[15..].copy_from_slice(&deviation.to_le_bytes());
        out.write_all(&record)?;
    }
    for triangle in triangles {
        let mut record = [3u8; 13];
        for (bytes, index) in record[1..].chunks_exact_mut(4).zip(triangle) {
            // Readers take indices as signed 32-bit numbers.
            let index = i32::try_from(*index).ok().filter(|k| (*k as usize) < count);
            let index = index.ok_or_else(|| invalid("a vertex index is out of range"))?;
            bytes.copy_from_slice(&index.to_le_bytes());
        }
        out.write_all(&record)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_follow_their_header() {
        let places = [[0.0, 0.0, 1.0], [2.0, 0.0, 1.5], [0.0, 2.0, 1.0]];
        let colours = [[1, 2, 3], [4, 5, 6], [7, 8, 9]];
        let vertices = Vertices { places: &places, colours: &colours, deviations: &[0.25, -0.5, f32::NAN] };
        let mut bytes = Vec::new();
        write(&mut bytes, &vertices, &[[0, 1, 2]]).unwrap();
        let end = b"end_header\n";
        let body = bytes.windows(end.len()).position(|w| w == end).unwrap() + end.len();
        let header = std::str::from_utf8(&bytes[..body]).unwrap();
        assert!(header.contains("element vertex 3\n") && header.contains("element face 1\n"));
        let body = &bytes[body..];
        assert_eq!(body.len(), 3 * 19 + 13);
        let float = |at: usize| f32::from_le_bytes(body[at..at + 4].try_into().unwrap());
        assert_eq!((float(19), float(27), float(19 + 15)), (2.0, 1.5, -0.5));
        assert_eq!(body[19 + 12..19 + 15], [4, 5, 6]);
        assert!(float(38 + 15).is_nan());
        assert_eq!(body[57..], [3, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0]);
        assert!(write(&mut Vec::new(), &vertices, &[[0, 1, 3]]).is_err());
        let short = Vertices { colours: &colours[..2], ..vertices };
        assert!(write(&mut Vec::new(), &short, &[]).is_err());
    }
}
