//! A z-map dealt out in square tiles, one worker each.

use super::ZMap;

/// A square of cells that one worker owns.
pub(super) struct TileCells<'a> {
    /// Its first cell in the grid.
    pub i0: usize,
    pub j0: usize,
    /// Centres of its columns and rows, mm.
    pub x: Vec<f64>,
    pub y: Vec<f64>,
    /// Heights and moves of its part of each row of the map.
    pub rows: Vec<(&'a mut [f32], &'a mut [u32])>,
}

impl TileCells<'_> {
    /// Cells along x.
    pub fn nx(&self) -> usize {
        self.rows.first().map_or(0, |row| row.0.len())
    }
}

/// The map in tiles of `side` × `side` cells (smaller ones at its upper borders), row by row.
pub(super) fn tiles(map: &mut ZMap, side: usize) -> Vec<TileCells<'_>> {
    let grid = map.grid;
    let mut tiles: Vec<TileCells<'_>> = Vec::with_capacity(grid.nx.div_ceil(side) * grid.ny.div_ceil(side));
    if grid.is_empty() {
        return tiles;
    }
    let bands = map.height.chunks_mut(side * grid.nx).zip(map.cut_by.chunks_mut(side * grid.nx));
    for (band, (height, cut_by)) in bands.enumerate() {
        let (first, j0) = (tiles.len(), band * side);
        for i0 in (0..grid.nx).step_by(side) {
            let x = (i0..(i0 + side).min(grid.nx)).map(|i| grid.centre(i, j0).x).collect();
            let y = (j0..(j0 + side).min(grid.ny)).map(|j| grid.centre(i0, j).y).collect();
            tiles.push(TileCells { i0, j0, x, y, rows: Vec::with_capacity(side) });
        }
        for (height, cut_by) in height.chunks_mut(grid.nx).zip(cut_by.chunks_mut(grid.nx)) {
            let pieces = height.chunks_mut(side).zip(cut_by.chunks_mut(side));
            for (tile, piece) in tiles[first..].iter_mut().zip(pieces) {
                tile.rows.push(piece);
            }
        }
    }
    tiles
}
