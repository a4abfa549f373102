//! The offset surface of a triangle mesh: all places whose distance from it is `d`, on its outward side.
//!
//! Enters: a mesh, its search tree and a distance, mm. Leaves: a mesh every vertex of which lies on the level
//! set {distance = d}, with the lines along which two places of the given mesh are equally near (valleys).
//! Where a ball of radius d rolls on the mesh its centre runs on this surface: convex edges are rounded by
//! it, concave creases become sharp valleys on which the ball touches both sides.
//!
//! The distance is the unsigned one, so that a ball fits in between sheets that face each other; what lies
//! behind the mesh is left out afterwards. The level set is dual-contoured in a lattice, in bricks of 8 × 8 ×
//! 8 cells only where it passes: distances of two places differ by no more than the places are apart. A cell
//! has a vertex for each piece of the surface that its corners tell apart (G. Nielson, "Dual marching cubes",
//! 2004), at the place nearest to the tangent planes of the level set (T. Ju and others, "Dual contouring of
//! Hermite data", 2002). Where those planes differ they are taken again and again from nearer by: then smooth
//! places show one plane, and valleys keep theirs.
//!
//! On an open mesh the level set runs around the border. What is kept there is a margin: places from which
//! the nearest point of the mesh lies on the border, and over which a ball has rolled by no more than the
//! margin.
//!
//! Limits: channels, bridges and pieces narrower than a cell may be lost.

mod bricks;
mod contour;
mod error;
mod level_set;
mod settings;
#[cfg(test)]
mod tests;
mod triangle;
mod trim;
mod valleys;
mod vertex;

pub use error::OffsetError;
pub use level_set::{LevelSet, LevelSetFoot};
pub use settings::OffsetSettings;
pub use valleys::Valley;

use bricks::Bricks;
use geometry::{Bvh, Point3, TriangleMesh};
use work::monitor::Monitor;

/// The offset surface of a mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshOffset {
    /// Vertices, mm; each as far from the mesh as was asked for, to 1e-9 mm.
    pub vertices: Vec<Point3>,
    /// Vertex indices, counter-clockwise seen from farther away.
    pub triangles: Vec<[u32; 3]>,
    /// The lines along which two or more points of the mesh are equally near.
    pub valleys: Vec<Valley>,
    /// Side of a cell, mm.
    pub cell: f64,
}

impl MeshOffset {
    /// The offset of a mesh.
    ///
    /// # Errors
    /// See [`OffsetError`].
    ///
    /// # Tolerance
    /// Vertices lie on the level set to 1e-9 mm (1e-14 of the coordinates, if that is more), those of valleys
    /// on both sides.
    pub fn new(
        mesh: &TriangleMesh,
        bvh: &Bvh,
        settings: &OffsetSettings,
        monitor: &dyn Monitor,
    ) -> Result<Self, OffsetError> {
        settings.check(mesh)?;
        let level = LevelSet::new(mesh, bvh, settings.distance);
        let bricks = Bricks::around(&level, settings, monitor)?;
        let contour = contour::contour(&level, &bricks, monitor)?;
        let kept = trim::trimmed(&level, contour, settings.margin, monitor)?;
        if kept.triangles.is_empty() {
            return Err(OffsetError::Empty { distance: settings.distance });
        }
        let valleys = valleys::valleys(&level, &kept, settings);
        let contour::Contour { vertices, triangles, .. } = kept;
        Ok(Self { vertices, triangles, valleys, cell: settings.cell })
    }
}
