//! NURBS patches in a JSON file as the part of a scene.

use std::fmt::{self, Write as _};

use io::nurbs_json;
use keys::{SceneError, toml_string};
use part::Patch;

use super::source::{LoadError, Loaded, Loading, PartTable, Source, of_patches, seen_from_above};
use crate::named_file::NamedFile;

/// NURBS patches.
#[derive(Debug, Clone, PartialEq)]
pub struct NurbsSource {
    /// Their file.
    pub file: NamedFile,
}

impl Source for NurbsSource {
    const EXTENSIONS: &'static [&'static str] = &["json"];

    fn surfaces() -> Vec<&'static str> {
        vec!["nurbs"]
    }

    fn keys() -> Vec<&'static str> {
        vec!["file"]
    }

    fn read(table: &PartTable<'_>) -> Result<Self, SceneError> {
        table.only(&["surface", "file"], "surface = \"nurbs\"")?;
        Ok(Self { file: table.named(table.table.required_text("file", "wave.json")?) })
    }

    fn write(&self, out: &mut String) -> fmt::Result {
        writeln!(out, "surface = \"nurbs\"")?;
        writeln!(out, "file = {}", toml_string(&self.file.written))
    }

    fn file(&self) -> Option<&NamedFile> {
        Some(&self.file)
    }

    fn load(&self, job: &Loading<'_>) -> Result<Loaded, LoadError> {
        let file = &self.file;
        let patches = nurbs_json::read(&file.path).map_err(|e| job.refused(file, e))?;
        let part =
            of_patches(patches.into_iter().map(Patch::Nurbs).collect()).map_err(|e| job.refused(file, e))?;
        Ok(seen_from_above(part).map_err(|e| job.refused(file, e))?.into())
    }
}
