//! Binary STL of a triangle mesh (80 bytes of header, a count, 50 bytes a triangle, little-endian).

use std::io::{self, Write};

/// Writes triangles given by vertex indices; coordinates in mm. Facet normals follow from the
/// corners, zero for a degenerate triangle.
///
/// # Errors
/// What the writer says; [`io::ErrorKind::InvalidInput`] for more triangles than STL can count or
/// an index out of range.
pub fn write(out: &mut dyn Write, vertices: &[[f32; 3]], triangles: &[[u32; 3]]) -> io::Result<()> {
    let invalid = |what: &str| io::Error::new(io::ErrorKind::InvalidInput, what);
    let count = u32::try_from(triangles.len()).map_err(|_| invalid("too many triangles for an STL file"))?;
    // Readers take a file that begins with "solid" for text, so this must not.
    let mut header = [b' '; 80];
    let words = b"binary STL, mm, written by millstream";
    header[..words.len()].copy_from_slice(words);
    out.write_all(&header)?;
    out.write_all(&count.to_le_bytes())?;
    for triangle in triangles {
        let corner = |k: usize| {
            vertices.get(triangle[k] as usize).ok_or_else(|| invalid("a vertex index is out of range"))
        };
        let corners = [corner(0)?, corner(1)?, corner(2)?];
        let mut record = [0u8; 50];
        let numbers = [normal(corners)].into_iter().chain(corners.map(|c| *c)).flatten();
        for (bytes, number) in record.chunks_exact_mut(4).zip(numbers) {
            bytes.copy_from_slice(&number.to_le_bytes());
        }
        out.write_all(&record)?;
    }
    Ok(())
}

fn normal([a, b, c]: [&[f32; 3]; 3]) -> [f32; 3] {
    let point = |p: &[f32; 3]| nalgebra::Vector3::from(p.map(f64::from));
    let cross = (point(b) - point(a)).cross(&(point(c) - point(a)));
    let length = cross.norm();
    if length > 0.0 { (cross / length).map(|x| x as f32).into() } else { [0.0; 3] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_takes_fifty_bytes_and_knows_its_normal() {
        let mut bytes = Vec::new();
        let vertices = [[0.0, 0.0, 1.0], [2.0, 0.0, 1.0], [0.0, 2.0, 1.0]];
        write(&mut bytes, &vertices, &[[0, 1, 2]]).unwrap();
        assert_eq!(bytes.len(), 84 + 50);
        assert!(!bytes.starts_with(b"solid"));
        let number = |k: usize| f32::from_le_bytes(bytes[84 + 4 * k..88 + 4 * k].try_into().unwrap());
        assert_eq!((number(0), number(1), number(2)), (0.0, 0.0, 1.0));
        assert_eq!((number(6), number(10)), (2.0, 2.0));
        assert!(write(&mut Vec::new(), &vertices, &[[0, 1, 3]]).is_err());
    }
}
