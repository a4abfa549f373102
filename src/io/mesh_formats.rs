//! The list of the formats of mesh files: a new format is a file of its own and a line of the list.

use std::path::Path;

use super::mesh_file::MeshFormat;
use super::{obj, stl};

/// The formats, in the order in which messages list them.
pub static MESH_FORMATS: [MeshFormat; 2] = [stl::FORMAT, obj::FORMAT];

/// A file whose extension is that of no format.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("Unsupported part format {}. Supported: {}", shown(extension.as_deref()), mesh_extensions().join(", "))]
pub struct UnknownMeshFormat {
    /// The file's extension, lower case, if it has one.
    pub extension: Option<String>,
}

fn shown(extension: Option<&str>) -> String {
    extension.map_or("without an extension".to_owned(), |extension| format!("`.{extension}`"))
}

/// The extension of a file, lower case.
pub fn extension(path: &Path) -> Option<String> {
    path.extension().map(|extension| extension.to_string_lossy().to_lowercase())
}

/// The extensions of all formats, `.stl`, `.obj` and so on.
pub fn mesh_extensions() -> Vec<String> {
    MESH_FORMATS
        .iter()
        .flat_map(|format| format.extensions)
        .map(|extension| format!(".{extension}"))
        .collect()
}

impl MeshFormat {
    /// The format of a file, by its extension.
    ///
    /// # Errors
    /// [`UnknownMeshFormat`] lists the extensions that are read.
    pub fn of(path: &Path) -> Result<&'static Self, UnknownMeshFormat> {
        let extension = extension(path);
        let known = |format: &&Self| {
            extension.as_deref().is_some_and(|extension| format.extensions.contains(&extension))
        };
        MESH_FORMATS.iter().find(known).ok_or_else(|| UnknownMeshFormat { extension: extension.clone() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_known_by_their_extensions() {
        assert_eq!(MeshFormat::of(Path::new("a/wave.STL")).map(|format| format.word), Ok("STL"));
        assert_eq!(MeshFormat::of(Path::new("wave.obj")).map(|format| format.word), Ok("OBJ"));
        let refused = |name: &str| MeshFormat::of(Path::new(name)).unwrap_err().to_string();
        assert_eq!(refused("a.step"), "Unsupported part format `.step`. Supported: .stl, .obj");
        assert_eq!(refused("a"), "Unsupported part format without an extension. Supported: .stl, .obj");
    }
}
