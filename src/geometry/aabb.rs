//! Axis-aligned boxes, mm.

use super::Point3;

/// An axis-aligned box; empty when `min > max` on any axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aabb {
    /// Least corner.
    pub min: Point3,
    /// Greatest corner.
    pub max: Point3,
}

impl Aabb {
    /// The box of nothing: growing it by a point gives that point.
    pub const EMPTY: Self = Self {
        min: Point3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
        max: Point3::new(f64::NEG_INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY),
    };

    /// The smallest box around all points; [`Aabb::EMPTY`] for none.
    pub fn of<'a>(points: impl IntoIterator<Item = &'a Point3>) -> Self {
        let mut bounds = Self::EMPTY;
        for p in points {
            bounds.grow(p);
        }
        bounds
    }

    /// Enlarges the box to hold `p`.
    #[inline]
    pub fn grow(&mut self, p: &Point3) {
        self.min = self.min.inf(p);
        self.max = self.max.sup(p);
    }

    /// The smallest box that holds both.
    #[inline]
    pub fn union(&self, other: &Self) -> Self {
        Self { min: self.min.inf(&other.min), max: self.max.sup(&other.max) }
    }

    /// The corners, and the triangles of the faces, outward.
    pub fn surface(&self) -> (Vec<Point3>, Vec<[u32; 3]>) {
        let pick = |k: usize, axis: usize| if k >> axis & 1 == 1 { self.max[axis] } else { self.min[axis] };
        let corners = (0..8).map(|k| Point3::new(pick(k, 0), pick(k, 1), pick(k, 2))).collect();
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        (corners, quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect())
    }

    /// Edge lengths.
    pub fn size(&self) -> super::Vector3 {
        self.max - self.min
    }

    /// Length of the space diagonal.
    pub fn diagonal(&self) -> f64 {
        self.size().norm()
    }
}
