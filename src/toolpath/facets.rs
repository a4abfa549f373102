//! What the facets of a mesh take of a scallop target: ridges cross them at any height.

use geometry::TriangleMesh;

/// On a mesh passes are planned for less by what facets stand off the smooth surface: on elements, whose
/// curvature is that of the facets around, and on meshes with steps, by the height that this share of them
/// (by area) stays below. On surfaces fitted to smooth meshes by the height that nearly all stay below, less
/// a share of the target, and by no more than another share: ridges cross facets at any height, and not all
/// passes leave all of the target. Facets at sharper angles than the last, rad, are edges of the part.
const FACETS_ON_ELEMENTS: f64 = 0.6;
const FACETS: f64 = 0.95;
const FACETS_LESS: f64 = 0.055;
const MOST_FACETS: f64 = 0.09;
const SHARPEST_FACETS: f64 = 0.3;

/// What the facets of a mesh, planned on a surface fitted to it or on itself, take of a scallop target, mm.
pub(crate) fn facet_charge(mesh: &TriangleMesh, fitted: bool, target: f64) -> f64 {
    if fitted {
        (facet_height(mesh, FACETS) - FACETS_LESS * target).max(0.0).min(MOST_FACETS * target)
    } else {
        facet_height(mesh, FACETS_ON_ELEMENTS)
    }
}

/// How far facets stand off the smooth surface that they are chords of, mm: where two meet at the angle δ,
/// each is as wide as its neighbours and has a sagitta of an eighth of δ times the width; the one that a
/// share of them stays below.
fn facet_height(mesh: &TriangleMesh, share: f64) -> f64 {
    let mut facets: Vec<(f64, f64)> = Vec::new();
    for t in 0..mesh.triangles().len() {
        for k in 0..3 {
            let Some(n) = mesh.neighbour(t, k).filter(|&n| n > t) else { continue };
            let corners = mesh.corners(t);
            let (edge, both) = ((corners[(k + 1) % 3] - corners[k]).norm(), mesh.area(t) + mesh.area(n));
            let angle = mesh.normal(t).cross(&mesh.normal(n)).norm();
            if angle < SHARPEST_FACETS && edge > 0.0 {
                facets.push((0.125 * angle * both / edge, both));
            }
        }
    }
    facets.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut left = share * facets.iter().map(|(_, area)| area).sum::<f64>();
    let reached = facets.iter().find(|(_, area)| {
        left -= area;
        left <= 0.0
    });
    reached.map_or(0.0, |(height, _)| *height)
}
