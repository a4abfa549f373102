//! A stretch of a vertical wall in the plan view.

use super::{Point2, Vector2};

/// A straight stretch of a wall, or an edge that is gone around, where both ends are the same place; mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallStretch {
    /// Where it begins and ends.
    pub ends: [Point2; 2],
    /// Unit normals away from the material at both ends.
    pub inward: [Vector2; 2],
}

impl WallStretch {
    /// Its length, mm; 0 of an edge.
    pub fn length(&self) -> f64 {
        (self.ends[1] - self.ends[0]).norm()
    }

    /// Its two halves.
    pub fn halves(&self) -> [Self; 2] {
        let at = nalgebra::center(&self.ends[0], &self.ends[1]);
        let between = self.inward[0] + self.inward[1];
        // The same bits where the wall is straight.
        let inward = if self.inward[0] == self.inward[1] { self.inward[0] } else { between.normalize() };
        [
            Self { ends: [self.ends[0], at], inward: [self.inward[0], inward] },
            Self { ends: [at, self.ends[1]], inward: [inward, self.inward[1]] },
        ]
    }
}
