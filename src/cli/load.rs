//! The part of a scene, from its file or its formula.

use super::error::CliError;
use crate::io::scene::{PartSource, Scene};
use crate::part::{Part, PartError, Patch, default_tessellation_tolerance};

/// Loads the part. The notes tell what was mended to make it usable.
///
/// # Errors
/// [`CliError`] when the part is refused; a file's fault is shown at its name in the scene.
pub fn load_part(scene: &Scene) -> Result<(Part, Vec<String>), CliError> {
    match &scene.part {
        PartSource::Formula { surface } => Ok((of_patch(Patch::Analytic(*surface))?, Vec::new())),
        _ => todo!(),
    }
}

fn of_patch(patch: Patch) -> Result<Part, PartError> {
    let patches = vec![patch];
    let tolerance = default_tessellation_tolerance(&patches);
    Part::from_patches(patches, tolerance)
}
