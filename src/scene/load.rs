//! From a checked scene to the part that it means: reads the files that it names.

use geometry::TriangleMesh;
use io::MeshFormat;
use keys::SceneError;
use toolpath::Pocket;

use crate::Scene;
use crate::named_file::NamedFile;
use crate::part::{LoadError, Loaded, Loading, read_mesh};

fn loading(scene: &Scene) -> Loading<'_> {
    Loading { source: &scene.source, cutter: &scene.cutter, chord_tolerance: scene.tolerance.chord }
}

/// Loads the part of a scene.
///
/// # Errors
/// [`LoadError`] when the part is refused; a file's fault is shown at its name in the scene.
pub fn load_part(scene: &Scene) -> Result<Loaded, LoadError> {
    scene.part.load(&loading(scene))
}

/// Loads the pocket of a scene, if its part is the floor of one.
///
/// # Errors
/// [`SceneError::Invalid`] when the drawing is refused, at its name in the scene.
pub fn load_pocket(scene: &Scene) -> Result<Option<Pocket>, SceneError> {
    let Some(pocket) = scene.part.pocket() else { return Ok(None) };
    pocket.pocket(&loading(scene)).map(|(pocket, _)| Some(pocket))
}

/// Loads a mesh that a scene names, in mm. The notes say what was mended to make it usable.
///
/// # Errors
/// [`SceneError::Invalid`]: the file's fault, shown at its name in the scene.
pub fn load_mesh(
    scene: &Scene,
    file: &NamedFile,
    format: &MeshFormat,
    scale: f64,
) -> Result<(TriangleMesh, Vec<String>), SceneError> {
    read_mesh(&scene.source, file, format, scale)
}
