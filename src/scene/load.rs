//! From a checked scene to the part that it means: reads the files that it names.

use geometry::TriangleMesh;
use io::MeshFormat;
use keys::SceneError;

use crate::named_file::NamedFile;
use crate::part::{LoadError, Loaded, Loading, flattening, read_mesh};
use crate::{Scene, StockRequest};

fn loading(scene: &Scene) -> Loading<'_> {
    Loading {
        source: &scene.source,
        cutter: &scene.tooling.cutter,
        chord_tolerance: scene.tolerance.chord,
        flattening: flattening(&scene.tolerance),
        margin: match scene.stock {
            StockRequest::Around { margin, .. } => Some(margin),
            _ => None,
        },
        memory_mib: scene.simulation.memory_mib,
    }
}

/// Loads the part of a scene.
///
/// # Errors
/// [`LoadError`] when the part is refused; a file's fault is shown at its name in the scene.
pub fn load_part(scene: &Scene) -> Result<Loaded, LoadError> {
    scene.part.load(&loading(scene))
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
    read_mesh(&loading(scene), file, format, scale)
}
