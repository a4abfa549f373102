//! The part of a scene, from its file or its formula.

use super::error::CliError;
use crate::io::scene::{PartSource, Scene};
use crate::part::{Part, Patch, default_tessellation_tolerance};

/// Loads the part. The notes tell what was mended to make it usable.
///
/// # Errors
/// [`CliError::Scene`], pointing at the file's name in the scene, when the part is refused.
pub fn load_part(scene: &Scene) -> Result<(Part, Vec<String>), CliError> {
    match &scene.part {
        PartSource::Formula { surface } => {
            let patches = vec![Patch::Analytic(surface.clone())];
            let tolerance = default_tessellation_tolerance(&patches);
            let part = Part::from_patches(patches, tolerance).unwrap();
            Ok((part, Vec::new()))
        }
        _ => todo!(),
    }
}
