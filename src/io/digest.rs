//! Fingerprints of files: how long they are, and their SHA-256 (FIPS 180-4).

use std::io::{self, Read as _, Write};
use std::path::Path;

use sha2::{Digest as _, Sha256};

use crate::regular;

/// What tells one file's content from another's.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fingerprint {
    /// Length, bytes.
    pub bytes: u64,
    /// SHA-256, 64 hexadecimal digits in lower case.
    pub sha256: String,
}

/// The fingerprint of a text or of other bytes.
pub fn of_bytes(bytes: &[u8]) -> Fingerprint {
    Fingerprint { bytes: bytes.len() as u64, sha256: hexadecimal(Sha256::digest(bytes).as_ref()) }
}

/// The fingerprint of a regular file, read piece by piece.
///
/// # Errors
/// Those of [`regular::open`] and of reading.
pub fn of_file(path: &Path) -> io::Result<Fingerprint> {
    /// Bytes of a piece.
    const PIECE: usize = 1 << 16;
    let mut file = regular::open(path)?;
    let mut hashing = Hashing::new(io::sink());
    let mut piece = vec![0; PIECE];
    loop {
        match file.read(&mut piece)? {
            0 => return Ok(hashing.finish().1),
            count => hashing.write_all(&piece[..count])?,
        }
    }
}

/// A writer that takes the fingerprint of all that goes through it.
#[derive(Debug)]
pub struct Hashing<W> {
    inner: W,
    hasher: Sha256,
    bytes: u64,
}

impl<W: Write> Hashing<W> {
    /// Before the first byte.
    pub fn new(inner: W) -> Self {
        Self { inner, hasher: Sha256::new(), bytes: 0 }
    }

    /// What was written to, and the fingerprint of what was written.
    pub fn finish(self) -> (W, Fingerprint) {
        let sha256 = hexadecimal(self.hasher.finalize().as_ref());
        (self.inner, Fingerprint { bytes: self.bytes, sha256 })
    }
}

impl<W: Write> Write for Hashing<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.inner.write(bytes)?;
        self.hasher.update(&bytes[..count]);
        self.bytes += count as u64;
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of FIPS 180-4, in bytes, in a file, and through a writer.
    #[test]
    fn the_standards_example_has_its_digest() {
        let expected = Fingerprint {
            bytes: 3,
            sha256: "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad".into(),
        };
        assert_eq!(of_bytes(b"abc"), expected);
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("abc"), "abc").unwrap();
        assert_eq!(of_file(&folder.path().join("abc")).unwrap(), expected);
        let mut hashing = Hashing::new(Vec::new());
        hashing.write_all(b"a").unwrap();
        hashing.write_all(b"bc").unwrap();
        assert_eq!(hashing.finish(), (b"abc".to_vec(), expected));
    }
}
