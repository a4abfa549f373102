//! The machined part as triangles.

use metrology::{NormalMap, View};
use report::{MAX_TRIANGLES, SurfaceMeshFigures, surface_mesh};
use sim::ZMap;

use super::run::Run;
use super::session::BASE;

/// The machined part's triangles stay within this share of the scallop tolerance: ridges remain
/// visible in them.
const MESH_SHARE: f64 = 0.25;

/// The machined part as triangles with the deviation at each corner.
#[derive(Debug, Clone, PartialEq)]
pub struct Machined {
    /// Corners, mm.
    pub vertices: Vec<[f32; 3]>,
    /// Three corners each.
    pub triangles: Vec<[u32; 3]>,
    /// Deviation at each corner, mm; NaN off the part.
    pub deviations: Vec<f32>,
    /// Greatest distance from what was measured, mm.
    pub tolerance: f64,
}

impl Machined {
    pub(crate) fn new(run: &Run<'_>) -> Self {
        match run.view() {
            View::Heights(cut) => of_heights(run, cut),
            View::Normals(view) => of_normals(&view.map, run.scene().tolerance.scallop),
        }
    }

    /// Its figures.
    pub fn figures(&self) -> SurfaceMeshFigures {
        SurfaceMeshFigures { triangles: self.triangles.len(), tolerance_mm: self.tolerance }
    }
}

fn of_heights(run: &Run<'_>, cut: &ZMap) -> Machined {
    let tolerance = MESH_SHARE * run.scene().tolerance.scallop;
    let lowest = cut.height.iter().copied().fold(f32::INFINITY, f32::min);
    let bottom = f64::from(lowest).min(run.part().bounds().min.z) - BASE;
    // A grid of one row has no surface; its file then holds no triangle.
    let Some(mesh) = surface_mesh(cut, run.cutters(), &run.whole.path, bottom, tolerance, MAX_TRIANGLES)
    else {
        return Machined { vertices: Vec::new(), triangles: Vec::new(), deviations: Vec::new(), tolerance };
    };
    let deviations = mesh.deviations(run.part(), &run.measurement().deviation_map);
    Machined { deviations, tolerance: mesh.tolerance, vertices: mesh.vertices, triangles: mesh.triangles }
}

/// The design moved by its deviation.
fn of_normals(map: &NormalMap, tolerance: f64) -> Machined {
    let moved = |k: usize| {
        let deviation = if map.deviations[k].is_nan() { 0.0 } else { f64::from(map.deviations[k]) };
        (map.points[k] + map.normals[k] * deviation).coords.map(|c| c as f32).into()
    };
    Machined {
        vertices: work::parallel::map(map.points.len(), moved),
        triangles: map.triangles.clone(),
        deviations: map.deviations.clone(),
        tolerance,
    }
}
