//! The offset surface of a triangle mesh: all places whose distance from it is `d`, on its outward side.
//!
//! Enters: a mesh, its search tree and a distance, mm. Leaves: a mesh every vertex of which lies on the level set
//! {distance = d}, with the lines along which two places of the given mesh are equally near (valleys), and how far its
//! triangles stray from the level set. Where a ball of radius d rolls on the mesh its centre runs on this surface: convex
//! edges are rounded by it, concave creases become sharp valleys on which the ball touches both sides.
//!
//! The distance is the unsigned one, so that a ball fits in between sheets that face each other; what lies behind the mesh
//! is left out afterwards. The level set is dual-contoured in a lattice, in bricks of 8 × 8 × 8 cells only where it passes:
//! distances of two places differ by no more than the places are apart. A cell has a vertex for each piece of the surface
//! that its corners tell apart (G. Nielson, "Dual marching cubes", 2004), at the place nearest to the tangent planes of
//! the level set (T. Ju and others, "Dual contouring of Hermite data", 2002). Where those planes differ they are taken
//! again and again from nearer by: then smooth places show one plane, and valleys keep theirs.
//!
//! On an open mesh the level set runs around the border. What is kept there is a margin: places from which the nearest
//! point of the mesh lies on the border, and over which a ball has rolled by no more than the margin.
//!
//! Limits: channels, bridges and pieces narrower than a cell may be lost.

mod bricks;
mod contour;
mod level_set;
#[cfg(test)]
mod tests;
mod trim;
mod valleys;
mod vertex;

pub use level_set::{LevelSet, LevelSetFoot};
pub use valleys::Valley;

use bricks::Bricks;
use geometry::{Bvh, MAX_COORDINATE, MeshError, Point3, TriangleMesh};
use work::monitor::{Cancelled, Monitor};

/// What an offset is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OffsetSettings {
    /// Distance from the mesh, mm, > 0.
    pub distance: f64,
    /// Side of a cell, mm; at most a quarter of the distance.
    pub cell: f64,
    /// How far beyond a border the surface goes on, mm of the way of a ball that rolls over it; 0 or more.
    pub margin: f64,
    /// Two feet whose directions differ by more than this make a valley, rad.
    pub valley: f64,
    /// Most memory that the work may take, bytes.
    pub memory: f64,
}

/// Cells are at most this share of the distance: between the two sides of a sheet there must be a few.
const WIDEST_CELL: f64 = 0.25;

/// Cells are at least this share of the mesh's greatest coordinate or of the distance: their numbers fit 20 bits.
const NARROWEST_CELL: f64 = 1e-6;

impl OffsetSettings {
    /// Settings for which a mesh of a smooth level set strays by about `tolerance`, mm, from it where a convex edge is
    /// rounded: an edge as long as √2 cells is `cell²/(4d)` off.
    pub fn within(distance: f64, tolerance: f64) -> Self {
        let cell = (2.0 * distance * tolerance).sqrt().min(WIDEST_CELL * distance);
        Self { distance, cell, margin: 0.0, valley: 0.01, memory: 2e9 }
    }
}

/// Why there is no offset surface.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum OffsetError {
    /// Stopped by the user.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The distance is of no use.
    #[error("the offset distance must be a positive number of mm up to {MAX_COORDINATE}, and is {0}")]
    Distance(f64),
    /// The cell does not suit the distance.
    #[error(
        "cells for an offset by {distance} mm must have sides from {least:.3e} to {most} mm, and not {cell}"
    )]
    Cell {
        /// Distance, mm.
        distance: f64,
        /// Side given, mm.
        cell: f64,
        /// Least side, mm.
        least: f64,
        /// Greatest side, mm.
        most: f64,
    },
    /// Margin or valley angle is no number of its range.
    #[error("{what} of an offset must be {range}, and is {value}")]
    Setting {
        /// Which.
        what: &'static str,
        /// What it may be.
        range: &'static str,
        /// What it is.
        value: f64,
    },
    /// It would take too much memory.
    #[error(
        "the offset surface in cells of {cell} mm would take about {needed:.0} MB and {allowed:.0} MB are allowed; \
         cells of {fitting:.3} mm would fit"
    )]
    Memory {
        /// Side given, mm.
        cell: f64,
        /// Estimated memory, MB.
        needed: f64,
        /// Allowed memory, MB.
        allowed: f64,
        /// A side that fits, mm.
        fitting: f64,
    },
    /// No place outward of the mesh is that far from it.
    #[error(
        "no place on the outward side of the mesh is {distance} mm away from it with its foot inside of the surface: a \
         ball of that radius fits nowhere, or the mesh faces the wrong way"
    )]
    Empty {
        /// Distance, mm.
        distance: f64,
    },
    /// The triangles do not make a surface.
    #[error("the offset surface in cells of {cell} mm is no surface ({reason}); use other cells")]
    NoSurface {
        /// Side, mm.
        cell: f64,
        /// What is wrong.
        reason: MeshError,
    },
}

/// The offset surface of a mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshOffset {
    /// Vertices, mm; each as far from the mesh as was asked for, to 1e-9 mm.
    pub vertices: Vec<Point3>,
    /// Vertex indices, counter-clockwise seen from farther away.
    pub triangles: Vec<[u32; 3]>,
    /// Angle between the directions to the nearest points of the mesh at each vertex, rad; 0 where there is one.
    pub valley_angles: Vec<f64>,
    /// The lines along which two or more points of the mesh are equally near.
    pub valleys: Vec<Valley>,
    /// Greatest difference found between the distance from the mesh and the one asked for, in the middles of all triangles
    /// and edges, mm; without the triangles that were cut off at a border, which may cut across a valley's end.
    pub deviation: f64,
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
    /// Vertices lie on the level set to 1e-9 mm (1e-14 of the coordinates, if that is more), those of valleys on both
    /// sides; triangles stray from it by [`MeshOffset::deviation`].
    pub fn new(
        mesh: &TriangleMesh,
        bvh: &Bvh,
        settings: &OffsetSettings,
        monitor: &dyn Monitor,
    ) -> Result<Self, OffsetError> {
        check(mesh, settings)?;
        let level = LevelSet::new(mesh, bvh, settings.distance);
        let bricks = Bricks::around(&level, settings, monitor)?;
        let contour = contour::contour(&level, &bricks, monitor)?;
        let kept = trim::trimmed(&level, contour, settings.margin, monitor)?;
        if kept.triangles.is_empty() {
            return Err(OffsetError::Empty { distance: settings.distance });
        }
        let valleys = valleys::valleys(&level, &kept, settings);
        let deviation = contour::deviation(&level, &kept, monitor)?;
        let contour::Contour { vertices, triangles, angles, .. } = kept;
        Ok(Self { vertices, triangles, valley_angles: angles, valleys, deviation, cell: settings.cell })
    }

    /// The offset of a mesh with cells so small that its triangles stray by no more than `tolerance`, mm, from the level
    /// set, as far as three halvings of the first guess and the memory reach; [`MeshOffset::deviation`] tells.
    ///
    /// # Errors
    /// See [`OffsetError`].
    pub fn within(
        mesh: &TriangleMesh,
        bvh: &Bvh,
        settings: &OffsetSettings,
        tolerance: f64,
        monitor: &dyn Monitor,
    ) -> Result<Self, OffsetError> {
        let mut best = Self::new(mesh, bvh, settings, monitor)?;
        for halvings in 1..=MOST_HALVINGS {
            if best.deviation <= tolerance {
                break;
            }
            let finer = OffsetSettings { cell: settings.cell * 0.5f64.powi(halvings), ..*settings };
            match Self::new(mesh, bvh, &finer, monitor) {
                Ok(offset) => best = offset,
                Err(OffsetError::Memory { .. } | OffsetError::Cell { .. }) => break,
                Err(error) => return Err(error),
            }
        }
        Ok(best)
    }

    /// The triangles as a checked mesh.
    ///
    /// # Errors
    /// [`OffsetError::NoSurface`].
    pub fn mesh(&self) -> Result<TriangleMesh, OffsetError> {
        let refused = |reason| OffsetError::NoSurface { cell: self.cell, reason };
        TriangleMesh::new(self.vertices.clone(), self.triangles.clone())
            .map(|(mesh, _)| mesh)
            .map_err(refused)
    }
}

/// How often cells are halved for a tolerance.
const MOST_HALVINGS: i32 = 3;

fn check(mesh: &TriangleMesh, settings: &OffsetSettings) -> Result<(), OffsetError> {
    let OffsetSettings { distance, cell, margin, valley, memory } = *settings;
    if !(distance > 0.0 && distance <= MAX_COORDINATE) {
        return Err(OffsetError::Distance(distance));
    }
    let bounds = mesh.bounds();
    let largest = bounds.min.coords.amax().max(bounds.max.coords.amax()).max(distance);
    let (least, most) = (NARROWEST_CELL * largest, WIDEST_CELL * distance);
    if !(cell >= least && cell <= most) {
        return Err(OffsetError::Cell { distance, cell, least, most });
    }
    let setting = |what, range, value| Err(OffsetError::Setting { what, range, value });
    if !(margin >= 0.0 && margin.is_finite()) {
        return setting("the margin", "0 mm or more", margin);
    }
    if !(valley > 0.0 && valley < std::f64::consts::PI) {
        return setting("the valley angle", "between 0 and half a turn", valley);
    }
    if memory.is_nan() || memory <= 0.0 {
        return setting("the memory", "more than 0 bytes", memory);
    }
    Ok(())
}
