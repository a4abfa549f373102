//! Coordinates as programs hold them.
//!
//! A path is rounded before it is cut and measured, so that what is judged is the program.

use geometry::Point3;

use crate::{ClPoint, Move, Toolpath};

/// Decimals of every coordinate in a program, mm.
pub const DECIMALS: usize = 4;

/// How far writing may move a point along each axis, mm: half of the last decimal.
pub const ROUNDING: f64 = 0.5e-4;

/// A coordinate in units of the last decimal.
pub fn in_last_decimals(value: f64) -> f64 {
    (value * 10f64.powi(DECIMALS as i32)).round() + 0.0
}

impl Toolpath {
    /// The path as its programs have it: every coordinate is rounded to [`DECIMALS`]. Axes and feeds stay as
    /// they are.
    pub fn as_written(self) -> Self {
        let at = |at: &ClPoint| ClPoint {
            tip: Point3::from(at.tip.coords.map(|c| in_last_decimals(c) / 10f64.powi(DECIMALS as i32))),
            axis: at.axis,
        };
        let moves = self.moves.iter().map(|step| Move { to: at(&step.to), ..*step }).collect();
        Self { start: at(&self.start), moves, origin: self.origin }
    }
}
