//! Stock as heights over a grid (three axes, no undercuts).

use super::{Grid, Stock};
use geometry::{Aabb, Point2};
use work::monitor::{self, Cancelled, Monitor};

/// In [`ZMap::cut_by`]: no move touched this cell.
pub const NOT_CUT: u32 = u32::MAX;

/// Height of the stock at every cell centre, and which move cut it last.
#[derive(Debug, Clone)]
pub struct ZMap {
    /// The cells.
    pub grid: Grid,
    /// Height, mm, `[ny][nx]`.
    pub height: Vec<f32>,
    /// Index of the move that made the final height (the least one of equals), or [`NOT_CUT`].
    pub cut_by: Vec<u32>,
    /// How high the highest of it stood before the first cut, mm.
    pub top: f64,
    /// What stood there before the first cut, where its top is not flat.
    pub shape: Option<Shape>,
    /// The rectangle of the plan that the stock lies in, where its cells may hang over it.
    pub within: Option<[Point2; 2]>,
}

/// Stock that is no block, as cells see it from above.
#[derive(Debug, Clone)]
pub struct Shape {
    /// The stock.
    pub stock: Stock,
    /// Height where there is none, mm.
    pub bottom: f64,
}

/// Shapes are of no account: equal heights of one path came from equal stock.
impl PartialEq for ZMap {
    fn eq(&self, other: &Self) -> bool {
        self.grid == other.grid && self.height == other.height && self.cut_by == other.cut_by
    }
}

impl ZMap {
    /// A block with a flat top.
    pub fn block(grid: Grid, top: f64) -> Self {
        Self {
            grid,
            height: vec![top as f32; grid.len()],
            cut_by: vec![NOT_CUT; grid.len()],
            top,
            shape: None,
            within: None,
        }
    }

    /// The same where nothing stands beyond a box: volumes count what of the outermost cells lies in it.
    #[must_use]
    pub fn within(self, bounds: &Aabb) -> Self {
        Self { within: Some([bounds.min.xy(), bounds.max.xy()]), ..self }
    }

    /// What stands over the cells' centres, seen from above; `bottom` where nothing stands. A roughed block
    /// counts as a whole one.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub fn of_stock(
        grid: Grid,
        stock: &Stock,
        bottom: f64,
        monitor: &dyn Monitor,
    ) -> Result<Self, Cancelled> {
        match stock {
            Stock::Box(block) | Stock::Roughed { block, .. } => Ok(Self::block(grid, block.max.z)),
            Stock::Cylinder { .. } | Stock::Mesh(_) | Stock::Milled { .. } => {
                Self::of_shape(grid, Shape { stock: stock.clone(), bottom }, monitor)
            }
        }
    }

    fn of_shape(grid: Grid, shape: Shape, monitor: &dyn Monitor) -> Result<Self, Cancelled> {
        let row = |j: usize| {
            monitor::check(monitor)?;
            let centres = (0..grid.nx).map(|i| grid.centre(i, j));
            Ok::<Vec<f32>, Cancelled>(centres.map(|q| shape.height_at(q.x, q.y) as f32).collect())
        };
        let height = work::parallel::try_map(grid.ny, row)?.concat();
        let top = shape.stock.bounds().max.z.max(shape.bottom);
        Ok(Self { grid, height, cut_by: vec![NOT_CUT; grid.len()], top, shape: Some(shape), within: None })
    }

    /// The same stock before the first cut on other cells.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub fn uncut(&self, grid: Grid, monitor: &dyn Monitor) -> Result<Self, Cancelled> {
        match &self.shape {
            Some(shape) => Self::of_shape(grid, shape.clone(), monitor),
            None => Ok(Self::block(grid, self.top)),
        }
    }
}

impl Shape {
    /// Height before the first cut, mm.
    pub fn height_at(&self, x: f64, y: f64) -> f64 {
        self.stock.height_at(x, y).max(self.bottom)
    }

    /// The greatest height over the square of `half` mm to each side of `(x, y)` before the first cut, mm.
    pub fn highest_within(&self, x: f64, y: f64, half: f64) -> f64 {
        self.stock.highest_within(x, y, half).max(self.bottom)
    }
}
