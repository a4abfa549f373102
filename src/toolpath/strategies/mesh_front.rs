//! Iso-scallop passes on a mesh that does not fill the rectangle around it.
//!
//! Fronts move over the rectangle, on the smooth surface over the mesh, which goes on beside it: so no front bends
//! around a notch. Passes are the levels of their arrival on the triangles alone, piece by piece, each from the
//! start that is best for it.
//!
//! Enters: a start. Leaves: passes.

use super::iso_scallop::{self, FrontStart, KINK, PLANNED, StartedFront, fronts, started};
use super::mesh_passes::{self, Aim, width_at};
use crate::surface::chart::Chart;
use crate::surface::mesh_surface::ConnectedPiece;
use crate::vocabulary::{Levelled, Passes, PlanError, Task};
use field::mesh::{FieldMesh, MeshPoint};
use field::{GridField, ScalarField};
use geometry::Vector3;

/// How closely a crossing of an edge is placed: halvings of the edge.
const HALVINGS: usize = 30;

/// Plans passes on a mesh that does not fill its chart, from the best start for each piece of it.
pub(super) fn on_part(task: &Task<'_>, start: FrontStart) -> Result<Passes, PlanError> {
    mesh_passes::on_mesh(task, Aim::Front(start)).map_err(|error| match error {
        PlanError::NotApplicable { reason, .. } => {
            PlanError::NotApplicable { strategy: iso_scallop::DEFINITION.word, reason }
        }
        other => other,
    })
}

/// The fronts over a mesh that does not fill its chart, which starts at all borders at those of its pieces.
pub(super) fn fronts_over(
    task: &Task<'_>,
    pieces: &[ConnectedPiece],
    start: FrontStart,
) -> Result<Vec<StartedFront>, PlanError> {
    let chart = &Chart::of_mesh(task.part, task.cutter, task.settings.guide())?;
    if start != FrontStart::AllBorders {
        return fronts(task, chart, start);
    }
    let meshes = pieces.iter().map(|piece| &piece.mesh);
    let borders = meshes.flat_map(|mesh| {
        let at = |&v: &u32| [mesh.points()[v as usize].x, mesh.points()[v as usize].y];
        mesh.loops().iter().map(move |ring| ring.iter().chain(ring.first()).map(at).collect::<Vec<_>>())
    });
    // Beyond the borders φ goes on below 0, so that it has no kink there.
    started(task, chart, vec![("at all borders", None, borders.collect())], true)
}

/// Those of some fronts over a piece of mesh that promise the least length there.
pub(super) fn best_on_piece(
    task: &Task<'_>,
    fronts: &[StartedFront],
    piece: &ConnectedPiece,
) -> Vec<Levelled> {
    let on_piece = |front: &StartedFront| {
        let predicted = predicted_on_piece(task, piece, &front.field);
        StartedFront { predicted, ..front.clone() }
    };
    let mut tried: Vec<StartedFront> = fronts.iter().map(on_piece).collect();
    tried.sort_by(|a, b| a.predicted.total_cmp(&b.predicted));
    tried.into_iter().take(PLANNED).map(|front| front.levelled(fronts.len())).collect()
}

/// The length that is predicted of passes over a piece of mesh, mm, as on charts.
fn predicted_on_piece(task: &Task<'_>, piece: &ConnectedPiece, field: &GridField) -> f64 {
    let Task { cutter, ref settings, .. } = *task;
    let on_triangle = |t: usize| {
        let (normal, bend) = piece.facet(t)?;
        let [a, b, c] = piece.mesh.corners(t);
        let middle = (a.coords + b.coords + c.coords) / 3.0;
        let [_, x, y] = field.value_and_gradient(middle.x, middle.y);
        let gradient = along_surface([x, y], &normal);
        let across = gradient.try_normalize(1e-300)?;
        let (width, _) = width_at(cutter, &normal, &across, &bend, settings.step);
        let passes = if gradient.norm() * width * (1.0 + KINK) < 1.0 { 2.0 } else { 1.0 };
        let ratio = (1.0 - bend.along(&normal.cross(&across)) * cutter.corner_radius()).max(0.0);
        Some(passes * piece.mesh.area(t) * gradient.norm() * ratio)
    };
    (0..piece.mesh.triangles().len()).filter_map(on_triangle).sum()
}

/// The gradient along a surface of a function of the plan view that has the derivatives `[x, y]`.
pub(super) fn along_surface([x, y]: [f64; 2], normal: &Vector3) -> Vector3 {
    let flat = Vector3::new(x, y, 0.0);
    flat - normal * normal.dot(&flat)
}

/// Moves a point at which a level crosses an edge of a mesh to where the arrival itself has the level: over
/// kinks the values at the ends of the edge do not tell where.
pub(super) fn put_on_level(front: &ScalarField, mesh: &FieldMesh, point: &mut MeshPoint, level: f64) {
    let Some(k) = (0..3).find(|&k| point.weights[(k + 2) % 3] == 0.0) else { return };
    let corners = mesh.corners(point.triangle as usize);
    let (from, edge) = (corners[k], corners[(k + 1) % 3] - corners[k]);
    let above = |s: f64| {
        let at = from + edge * s;
        front.value_and_gradient(at.x, at.y)[0] >= level
    };
    let (mut low, mut high, from_above) = (0.0, 1.0, above(0.0));
    if above(1.0) == from_above {
        return;
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        *(if above(middle) == from_above { &mut low } else { &mut high }) = middle;
    }
    let s = 0.5 * (low + high);
    (point.weights[k], point.weights[(k + 1) % 3]) = (1.0 - s, s);
    point.position = from + edge * s;
}
