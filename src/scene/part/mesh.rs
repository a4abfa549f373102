//! Mesh files in a scene: the part itself, or what tilted tools keep away from.

use std::fmt::{self, Write as _};
use std::path::Path;

use geometry::{MeshError, TriangleMesh};
use io::{MeshFormat, mesh_extensions};
use keys::{SceneError, SceneText, Section, toml_string};
use part::Part;

use super::source::{LoadError, Loaded, Loading, PartTable, Source, file_refused, seen_from_above};
use crate::named_file::NamedFile;

/// Units that a file may be in, and each in mm.
pub(crate) const UNITS: [(&str, f64); 5] =
    [("mm", 1.0), ("cm", 10.0), ("m", 1000.0), ("inch", 25.4), ("um", 0.001)];

/// A triangle mesh in a file.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshFile {
    /// The file.
    pub file: NamedFile,
    /// Its format, from its extension.
    pub format: &'static MeshFormat,
    /// Name of the unit of its coordinates.
    pub unit: &'static str,
    /// That unit in mm.
    pub scale: f64,
}

impl MeshFile {
    /// Reads `file` and `unit` of a table.
    pub(crate) fn of_table(table: &Section<'_>, folder: &Path, example: &str) -> Result<Self, SceneError> {
        let file = table.required_text("file", example)?;
        let unit_words = UNITS.map(|(word, _)| word);
        let unit = table.word("unit", &unit_words)?.map_or("mm", |u| u.value);
        let scale = UNITS.iter().find(|(word, _)| *word == unit).map_or(1.0, |(_, scale)| *scale);
        let format = MeshFormat::of(Path::new(file.value)).map_err(|e| {
            let cure = format!("name a file that ends in {}", mesh_extensions().join(" or "));
            table.error(&file.span, e.to_string(), cure)
        })?;
        Ok(Self { file: NamedFile::beside(folder, file.value, file.span), format, unit, scale })
    }

    /// Writes both keys as scenes spell them.
    pub(crate) fn write_keys(&self, out: &mut String) -> fmt::Result {
        writeln!(out, "file = {}", toml_string(&self.file.written))?;
        writeln!(out, "unit = {}", toml_string(self.unit))
    }
}

/// Reads a mesh, in mm. The notes say what was mended to make it usable.
///
/// # Errors
/// [`SceneError::Invalid`]: the file's fault, shown at its name in the scene.
pub fn read_mesh(
    source: &SceneText,
    file: &NamedFile,
    format: &MeshFormat,
    scale: f64,
) -> Result<(TriangleMesh, Vec<String>), SceneError> {
    let (mesh, repairs) = format.read(&file.path).map_err(|e| file_refused(source, file, e))?;
    let mesh = in_mm(mesh, scale).map_err(|e| file_refused(source, file, e))?;
    let notes = if repairs.is_clean() { Vec::new() } else { vec![format!("{}: {repairs}", file.written)] };
    Ok((mesh, notes))
}

/// A mesh whose unit is `scale` mm.
fn in_mm(mesh: TriangleMesh, scale: f64) -> Result<TriangleMesh, MeshError> {
    if scale == 1.0 {
        return Ok(mesh);
    }
    let vertices = mesh.vertices().iter().map(|p| p * scale).collect();
    TriangleMesh::new(vertices, mesh.triangles().to_vec()).map(|(mesh, _)| mesh)
}

impl Source for MeshFile {
    const KEY: Option<&'static str> = Some("file");
    const EXAMPLE: Option<&'static str> = Some("file = \"part.stl\"");

    fn keys() -> Vec<&'static str> {
        vec!["file", "unit"]
    }

    fn read(table: &PartTable<'_>) -> Result<Self, SceneError> {
        table.only(&Self::keys(), "a part from a mesh file (it has no `surface`)")?;
        Self::of_table(table.table, table.folder, "part.stl")
    }

    fn write(&self, out: &mut String) -> fmt::Result {
        self.write_keys(out)
    }

    fn file(&self) -> Option<&NamedFile> {
        Some(&self.file)
    }

    fn load(&self, job: &Loading<'_>) -> Result<Loaded, LoadError> {
        let (mesh, notes) = read_mesh(job.source, &self.file, self.format, self.scale)?;
        let part = seen_from_above(Part::from_mesh(mesh)).map_err(|e| job.refused(&self.file, e))?;
        Ok(Loaded { part, blade: None, notes })
    }
}
