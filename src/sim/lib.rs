//! Stock, the swept cutter, and the engines that cut: on heights, along normals, and on voxels.
//!
//! Enters: stock, a cutter or a solid tool, and moves. Leaves: the stock after the moves, the move that cut
//! each place, and what each move removes. Lengths in mm, volumes in mm³, z up. This crate sees neither
//! strategies nor the design part.
//!
//! Limits: engines on heights ([`cut`], [`cut_in_order`]) need an upright tool, and return an error for
//! others. Tilted tools are cut by [`VoxelEngine`] and [`Rays`]. Results depend neither on the number of
//! threads nor on the vector unit.

mod bins;
mod cut;
#[cfg(test)]
mod engine_tests;
mod envelope;
mod form;
mod grid;
mod heights;

mod in_order;
mod in_stock;
mod in_turn;
mod rays;
mod reference;
#[doc(hidden)]
pub mod scenes;
mod solid;
mod standing;
mod stock;
mod sweep;
mod swept;
mod tiles;
mod track;
mod voxel;
mod zmap;

pub use bins::MoveBins;
pub use cut::{Work, cut, cut_all_candidates, cut_counted};
pub use envelope::Envelope;
pub use grid::{Grid, GridError};
pub use heights::CutError;

pub use in_order::{ENGAGED, MoveRemoval, RapidContact, Removal, cut_in_order, cut_in_order_plain};
pub use in_stock::{InStock, KeptOut, first_in_stock};
pub use in_turn::{CutHeights, cut_in_order_in_turn, cut_in_turn};
pub use rays::{RayHit, Rays, RaysError};
pub use reference::cut_reference;
pub use solid::{OppositeAxes, SweptHit, SweptMoves};
pub use standing::{FAR, NearStanding, StandingClearance, holder_clearance};
pub use stock::{BarAxis, Stock, StockMesh};
pub use voxel::{LineExit, VoxelEngine, VoxelError, VoxelRemoval, VoxelSurface, VoxelVolumes, Voxels};
pub use zmap::{NOT_CUT, Shape, ZMap};
