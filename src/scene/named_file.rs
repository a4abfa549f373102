//! Files that a scene names.

use std::ops::Range;
use std::path::{Path, PathBuf};

/// A file that the scene names, and where in the scene it does.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NamedFile {
    /// As the scene has it.
    pub written: String,
    /// From the scene's folder.
    pub path: PathBuf,
    /// Bytes of the scene's text.
    pub span: Range<usize>,
}

impl NamedFile {
    /// The file that a scene in `folder` names.
    pub(super) fn beside(folder: &Path, written: &str, span: Range<usize>) -> Self {
        // Joining an absolute path gives that path.
        Self { written: written.to_owned(), path: folder.join(written), span }
    }
}
