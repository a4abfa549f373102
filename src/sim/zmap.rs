//! Stock as heights over a grid (three axes, no undercuts).

use super::Grid;

/// In [`ZMap::cut_by`]: no move touched this cell.
pub const NOT_CUT: u32 = u32::MAX;

/// Height of the stock at every cell centre, and which move cut it last.
#[derive(Debug, Clone, PartialEq)]
pub struct ZMap {
    /// The cells.
    pub grid: Grid,
    /// Height, mm, `[ny][nx]`.
    pub height: Vec<f32>,
    /// Index of the move that made the final height (the least one of equals), or [`NOT_CUT`].
    pub cut_by: Vec<u32>,
}

impl ZMap {
    /// A block with a flat top.
    pub fn block(grid: Grid, top: f64) -> Self {
        Self { grid, height: vec![top as f32; grid.len()], cut_by: vec![NOT_CUT; grid.len()] }
    }
}
