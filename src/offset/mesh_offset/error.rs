//! Why a mesh has no such offset surface.

use geometry::MAX_COORDINATE;
use work::monitor::Cancelled;

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
}
