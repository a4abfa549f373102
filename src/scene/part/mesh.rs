//! Mesh files in a scene: the part itself, or what tilted tools keep away from.

use std::fmt::{self, Write as _};
use std::path::Path;

use geometry::{MeshError, RepairNotes, TriangleMesh};
use io::{MAX_MESH_FILE_BYTES, MeshFormat, MeshLimits, MeshReadError, mesh_extensions};
use keys::{SceneError, Section, toml_string};
use metrology::{BYTES_PER_TRIANGLE, MIB};
use part::Part;

use super::source::{LoadError, Loaded, Loading, PartTable, Source, seen_from_above};
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
/// [`SceneError::Invalid`]: the file's fault, shown at its name in the scene; also where the mesh takes more memory than the
/// run may take, which is known before it is made.
pub(crate) fn read_mesh(
    job: &Loading<'_>,
    file: &NamedFile,
    format: &MeshFormat,
    scale: f64,
) -> Result<(TriangleMesh, Vec<String>), SceneError> {
    let limits = MeshLimits { weld: job.flattening / scale, ..limits(job.memory_mib) };
    let (mesh, repairs) = format.read_within(&file.path, &limits).map_err(|e| match e {
        MeshReadError::TooLarge { mib, .. } if limits.bytes < MAX_MESH_FILE_BYTES => {
            too_little_memory(job, file, mib)
        }
        MeshReadError::TooManyTriangles { triangles, .. } => {
            too_little_memory(job, file, (triangles as u64 * BYTES_PER_TRIANGLE).div_ceil(MIB))
        }
        other => job.refused(file, other),
    })?;
    let mesh = in_mm(mesh, scale).map_err(|e| job.refused(file, e))?;
    let repairs = RepairNotes { moved: mesh.moved(), ..repairs };
    let notes = if repairs.is_clean() { Vec::new() } else { vec![format!("{}: {repairs}", file.written)] };
    Ok((mesh, notes))
}

/// What a mesh file may hold under a run's memory.
fn limits(memory_mib: u32) -> MeshLimits {
    let memory = u64::from(memory_mib) * MIB;
    let triangles = (memory / BYTES_PER_TRIANGLE) as usize;
    MeshLimits { bytes: memory.min(MAX_MESH_FILE_BYTES), triangles, ..MeshLimits::default() }
}

fn too_little_memory(job: &Loading<'_>, file: &NamedFile, needed_mib: u64) -> SceneError {
    job.source.error(
        file.span.clone(),
        format!("the mesh needs about {needed_mib} MiB, and the run may take {} MiB", job.memory_mib),
        "write a greater `memory_mib` in [simulation] (or --memory), or export the part coarser",
    )
}

/// A mesh whose unit is `scale` mm.
fn in_mm(mesh: TriangleMesh, scale: f64) -> Result<TriangleMesh, MeshError> {
    if scale == 1.0 {
        return Ok(mesh);
    }
    mesh.scaled(scale)
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
        let (mesh, notes) = read_mesh(job, &self.file, self.format, self.scale)?;
        let part = seen_from_above(Part::from_mesh(mesh)).map_err(|e| job.refused(&self.file, e))?;
        Ok(Loaded { notes, ..Loaded::from(part) })
    }
}
