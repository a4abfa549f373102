//! The part of a scene, from its file or its formula.

use nalgebra::{Translation3, UnitQuaternion};

use super::JobError;
use super::pocket::{floor_part, pocket_of};
use blade::{Blade, BladeSettings};
use geometry::{Isometry3, MeshError, TriangleMesh};
use io::{nurbs_json, obj, section_table, stl};
use part::{Part, PartError, Patch, default_tessellation_tolerance};
use scene::{BladeRequest, MeshFormat, NamedFile, PartSource, Scene, SceneError};

/// A part as its scene describes it.
pub struct Loaded {
    /// What is made.
    pub part: Part,
    /// The sections that it comes from, if it is a blade.
    pub blade: Option<Blade>,
    /// What was mended to make it usable.
    pub notes: Vec<String>,
}

/// Loads the part.
///
/// # Errors
/// [`JobError`] when the part is refused; a file's fault is shown at its name in the scene.
pub fn load_part(scene: &Scene) -> Result<Loaded, JobError> {
    let (part, notes) = match &scene.part {
        PartSource::Blade(request) => return load_blade(scene, request),
        PartSource::Pocket { outline, depth } => {
            let (pocket, notes) = pocket_of(scene, outline, *depth)?;
            (floor_part(scene, &pocket)?, notes)
        }
        PartSource::Formula { surface } => {
            let part = of_patches(vec![Patch::Analytic(*surface)]).map_err(JobError::part(scene))?;
            (part, Vec::new())
        }
        PartSource::Nurbs { file } => {
            let patches = nurbs_json::read(&file.path).map_err(|e| refused(scene, file, e))?;
            let part = of_patches(patches.into_iter().map(Patch::Nurbs).collect())
                .map_err(|e| refused(scene, file, e))?;
            (seen_from_above(part).map_err(|e| refused(scene, file, e))?, Vec::new())
        }
        PartSource::Mesh { file, format, scale, .. } => {
            let (mesh, notes) = load_mesh(scene, file, *format, *scale)?;
            let part = seen_from_above(Part::from_mesh(mesh)).map_err(|e| refused(scene, file, e))?;
            (part, notes)
        }
    };
    Ok(Loaded { part, blade: None, notes })
}

fn load_blade(scene: &Scene, request: &BladeRequest) -> Result<Loaded, JobError> {
    let file = &request.file;
    let sections = section_table::read(&file.path).map_err(|e| refused(scene, file, e))?;
    let [x, y, z] = request.rotate;
    let settings = BladeSettings {
        side: request.side,
        pitch: request.pitch,
        placed: Isometry3::from_parts(Translation3::identity(), UnitQuaternion::from_euler_angles(x, y, z)),
        fairing: request.fairing,
    };
    let blade = Blade::new(&sections, &settings).map_err(|e| refused(scene, file, e))?;
    let patches: Vec<Patch> = blade.surfaces.iter().cloned().map(Patch::Nurbs).collect();
    let tolerance = default_tessellation_tolerance(&patches);
    let part = Part::from_oriented_patches(patches, tolerance).map_err(|e| refused(scene, file, e))?;
    let notes = blade.notes();
    Ok(Loaded { part, blade: Some(blade), notes })
}

/// Reads a mesh, in mm. The notes tell what was mended to make it usable.
///
/// # Errors
/// [`JobError`]: the file's fault, shown at its name in the scene.
pub fn load_mesh(
    scene: &Scene,
    file: &NamedFile,
    format: MeshFormat,
    scale: f64,
) -> Result<(TriangleMesh, Vec<String>), JobError> {
    let read = match format {
        MeshFormat::Stl => stl::read(&file.path),
        MeshFormat::Obj => obj::read(&file.path),
    };
    let (mesh, repairs) = read.map_err(|e| refused(scene, file, e))?;
    let mesh = in_mm(mesh, scale).map_err(|e| refused(scene, file, e))?;
    let notes = if repairs.is_clean() { Vec::new() } else { vec![format!("{}: {repairs}", file.written)] };
    Ok((mesh, notes))
}

/// A part that has an area in the plan view, which alone can be milled along z.
fn seen_from_above(part: Part) -> Result<Part, String> {
    let size = part.bounds().size();
    if size.x > 0.0 && size.y > 0.0 {
        return Ok(part);
    }
    Err(format!(
        "seen from above it is a line, {} x {} mm: the cutter's axis is z, so turn the part before exporting it",
        size.x, size.y
    ))
}

/// A mesh whose unit is `scale` mm.
fn in_mm(mesh: TriangleMesh, scale: f64) -> Result<TriangleMesh, MeshError> {
    if scale == 1.0 {
        return Ok(mesh);
    }
    let vertices = mesh.vertices().iter().map(|p| p * scale).collect();
    TriangleMesh::new(vertices, mesh.triangles().to_vec()).map(|(mesh, _)| mesh)
}

fn of_patches(patches: Vec<Patch>) -> Result<Part, PartError> {
    let tolerance = default_tessellation_tolerance(&patches);
    Part::from_patches(patches, tolerance)
}

/// A file's fault, shown at its name in the scene.
fn refused(scene: &Scene, file: &NamedFile, fault: impl std::fmt::Display) -> SceneError {
    scene.source.error(
        file.span.clone(),
        format!("the file cannot be used: {fault}"),
        "mend that file or name another one",
    )
}
