//! The part of a scene, from its file or its formula.

use super::error::CliError;
use crate::io::nurbs_json;
use crate::io::scene::{NamedFile, PartSource, Scene, SceneError};
use crate::part::{Part, PartError, Patch, default_tessellation_tolerance};

/// Loads the part. The notes tell what was mended to make it usable.
///
/// # Errors
/// [`CliError`] when the part is refused; a file's fault is shown at its name in the scene.
pub fn load_part(scene: &Scene) -> Result<(Part, Vec<String>), CliError> {
    match &scene.part {
        PartSource::Formula { surface } => Ok((of_patches(vec![Patch::Analytic(*surface)])?, Vec::new())),
        PartSource::Nurbs { file } => {
            let patches = nurbs_json::read(&file.path).map_err(|e| refused(scene, file, e))?;
            let part = of_patches(patches.into_iter().map(Patch::Nurbs).collect())
                .map_err(|e| refused(scene, file, e))?;
            Ok((part, Vec::new()))
        }
        PartSource::Mesh { file, .. } => {
            Err(refused(scene, file, "mesh files cannot be read by this version").into())
        }
    }
}

fn of_patches(patches: Vec<Patch>) -> Result<Part, PartError> {
    let tolerance = default_tessellation_tolerance(&patches);
    Part::from_patches(patches, tolerance)
}

/// A file's fault, shown at its name in the scene.
fn refused(scene: &Scene, file: &NamedFile, fault: impl std::fmt::Display) -> SceneError {
    scene.source.error(
        file.span.clone(),
        format!("the part's file cannot be used: {fault}"),
        "mend that file or name another one",
    )
}
