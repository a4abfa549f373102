//! What an offset of a mesh is asked for, mm.

use super::error::OffsetError;
use geometry::{MAX_COORDINATE, TriangleMesh};

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

/// Cells are at least this share of the mesh's greatest coordinate or of the distance: their numbers fit 20
/// bits.
const NARROWEST_CELL: f64 = 1e-6;

impl OffsetSettings {
    /// Refuses numbers out of their ranges for `mesh`.
    pub(super) fn check(&self, mesh: &TriangleMesh) -> Result<(), OffsetError> {
        let OffsetSettings { distance, cell, margin, valley, memory } = *self;
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
}
