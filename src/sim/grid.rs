//! A regular grid of cells over a rectangle of the plane, mm.

use geometry::{Aabb, Point2};

/// Cell centres `(x0 + i·cell, y0 + j·cell)` for `i < nx`, `j < ny`; arrays over a grid are
/// `[ny][nx]`, row-major.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// Centre of cell (0, 0).
    pub origin: Point2,
    /// Pitch, mm.
    pub cell: f64,
    /// Cells along x.
    pub nx: usize,
    /// Cells along y.
    pub ny: usize,
}

/// Why no grid could be laid out.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum GridError {
    /// The cell is not a positive number.
    #[error("the cell size is {0} mm; it must be a positive number")]
    Cell(f64),
    /// The area is empty or not finite.
    #[error("the area to cut is empty or not finite")]
    Area,
    /// The grid needs more memory than allowed.
    #[error(
        "a cell of {cell} mm needs {needed_mib} MiB for {nx} x {ny} cells, and {allowed_mib} MiB are left for \
         them; the smallest cell that fits is {fitting} mm"
    )]
    Memory {
        /// What was asked for, mm.
        cell: f64,
        /// Cells along x.
        nx: usize,
        /// Cells along y.
        ny: usize,
        /// What the run would need.
        needed_mib: usize,
        /// What the cells may take.
        allowed_mib: usize,
        /// A cell that fits, mm, rounded up to two digits.
        fitting: f64,
    },
}

/// Cells of this pitch that cover a length.
fn count(length: f64, cell: f64) -> f64 {
    // The hair keeps 0.3 / 0.1 from taking a fourth cell.
    (length / cell - 1e-9).ceil().max(1.0)
}

/// A cell, mm, rounded up to two digits, of which no more than `cells` cover a rectangle (or a single
/// one does).
fn fitting_cell(width: f64, depth: f64, cells: f64) -> f64 {
    let mut cell = (width * depth / cells).sqrt().min(width.max(depth));
    loop {
        let digit = 10f64.powf(cell.log10().floor() - 1.0);
        // Through decimal digits, so that messages say 0.35 and not 0.35000000000000003.
        let rounded = format!("{:.1e}", (cell / digit).ceil() * digit).parse().unwrap_or(cell);
        let needed = count(width, rounded) * count(depth, rounded);
        if needed <= cells || needed <= 1.0 {
            return rounded;
        }
        // Whole rows and columns need a little more than the area alone.
        cell = 1.01 * rounded;
    }
}

impl Grid {
    /// Covers the rectangle of `area` with cells whose centres lie half a cell inside its border.
    /// `bytes_per_cell` is what the caller will allocate a cell in all; `memory` the bytes allowed.
    ///
    /// # Errors
    /// See [`GridError`].
    pub fn covering(area: &Aabb, cell: f64, bytes_per_cell: usize, memory: u64) -> Result<Self, GridError> {
        if !(cell > 0.0 && cell.is_finite()) {
            return Err(GridError::Cell(cell));
        }
        let size = area.size();
        if !(size.x > 0.0 && size.y > 0.0 && size.x.is_finite() && size.y.is_finite()) {
            return Err(GridError::Area);
        }
        let (nx, ny) = (count(size.x, cell), count(size.y, cell));
        let needed = nx * ny * bytes_per_cell as f64;
        if needed > memory as f64 {
            const MIB: f64 = 1048576.0;
            return Err(GridError::Memory {
                cell,
                nx: nx as usize,
                ny: ny as usize,
                needed_mib: (needed / MIB).ceil() as usize,
                allowed_mib: (memory as f64 / MIB) as usize,
                fitting: fitting_cell(size.x, size.y, memory as f64 / bytes_per_cell as f64),
            });
        }
        let origin = Point2::new(
            area.min.x + 0.5 * (size.x - (nx - 1.0) * cell),
            area.min.y + 0.5 * (size.y - (ny - 1.0) * cell),
        );
        Ok(Self { origin, cell, nx: nx as usize, ny: ny as usize })
    }

    /// Along one axis, how much of what reaches from `low` to `high` the cell with this centre stands for:
    /// the cell, but the outermost one that lies in it up to its end.
    pub fn breadth(&self, centre: f64, [low, high]: [f64; 2]) -> f64 {
        let from = if centre - self.cell < low { low } else { centre - 0.5 * self.cell };
        let to = if centre + self.cell > high { high } else { centre + 0.5 * self.cell };
        to - from
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.nx * self.ny
    }

    /// True without cells.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Centre of cell `(i, j)`.
    pub fn centre(&self, i: usize, j: usize) -> Point2 {
        Point2::new(self.origin.x + i as f64 * self.cell, self.origin.y + j as f64 * self.cell)
    }

    /// Position of cell `(i, j)` in an array over this grid.
    pub fn index(&self, i: usize, j: usize) -> usize {
        j * self.nx + i
    }

    /// The cell whose centre is nearest to `(x, y)`; `None` outside of the grid.
    pub fn cell_at(&self, x: f64, y: f64) -> Option<(usize, usize)> {
        let i = ((x - self.origin.x) / self.cell).round();
        let j = ((y - self.origin.y) / self.cell).round();
        let inside = i >= 0.0 && j >= 0.0 && i < self.nx as f64 && j < self.ny as f64;
        inside.then_some((i as usize, j as usize))
    }

    /// The cell whose centre is nearest to `(x, y)`, which may lie outside of the grid.
    pub fn nearest_cell(&self, x: f64, y: f64) -> (usize, usize) {
        let nearest = |at: f64, n: usize| (at.round().max(0.0) as usize).min(n.saturating_sub(1));
        (nearest((x - self.origin.x) / self.cell, self.nx), nearest((y - self.origin.y) / self.cell, self.ny))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Point3;

    /// Whatever the cells, they stand for all of a rectangle and no more.
    #[test]
    fn breadths_add_up() {
        for (cell, from) in [(7.0, 0.0), (0.3, 0.0), (0.11, 0.2), (60.0, 0.0), (0.5, 0.25)] {
            let area = Aabb { min: Point3::new(-1.0, 0.0, 0.0), max: Point3::new(39.03, 30.0, 1.0) };
            let grid = Grid::covering(&area, cell, 1, 1 << 30).unwrap();
            let [low, high] = [-1.0 + from, 39.03 - from];
            let within = (0..grid.nx).map(|i| grid.centre(i, 0).x).filter(|x| (low..=high).contains(x));
            let sum: f64 = within.map(|x| grid.breadth(x, [low, high])).sum();
            assert!((sum - (high - low)).abs() < 1e-9, "{cell}: {sum}");
        }
    }

    #[test]
    fn the_cell_that_is_said_to_fit_does_fit() {
        for (width, depth) in [(800.0, 6.0), (60.0, 40.0), (0.3, 5000.0), (1.0, 1.0)] {
            let area = Aabb { min: Point3::origin(), max: Point3::new(width, depth, 1.0) };
            for memory in [60u64, 1000, 2 << 20, 50 << 20] {
                let Err(GridError::Memory { fitting, .. }) = Grid::covering(&area, 1e-4, 52, memory) else {
                    panic!()
                };
                let grid = Grid::covering(&area, fitting, 52, memory).unwrap();
                assert!(grid.len() as u64 * 52 <= memory, "{width} x {depth} in {memory}");
            }
        }
    }
}
