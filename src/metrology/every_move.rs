//! Every move of a path by the places that it may cut, also those that no cell shows.

use crate::cut_surface::CutSurface;
use crate::figures::NUMERICAL_FLOOR;
use geometry::{Aabb, Point2, Point3, Vector2};
use motion::Cutters;
use part::SurfacePoint;
use sim::{Grid, MoveBins};

/// Bins at most: 8 bytes each.
const MOST_BINS: f64 = 1e6;

/// Moves, sorted into bins as wide as the cutter where these are not too many.
pub(crate) struct EveryMove<'a> {
    surface: &'a CutSurface<'a>,
    bins: MoveBins,
}

impl<'a> EveryMove<'a> {
    /// The moves that cut a surface, by places over a box and as far beside it as it is high.
    pub fn new(surface: &'a CutSurface<'a>, cutters: &Cutters, around: &Aabb) -> Self {
        let radius = cutters.greatest_radius();
        let size = around.max - around.min;
        let margin = size.z + radius;
        let sides = size.xy() + Vector2::new(margin, margin) * 2.0;
        let cell = radius.max((sides.x * sides.y / MOST_BINS).sqrt());
        let count = |length: f64| (length / cell).ceil() as usize + 1;
        let origin = around.min.xy() - Vector2::new(margin, margin);
        let grid = Grid { origin, cell, nx: count(sides.x), ny: count(sides.y) };
        Self { surface, bins: MoveBins::new(&grid, 1, radius, surface.path) }
    }

    /// The moves that may cut at a place.
    pub fn over(&self, q: Point2) -> &[u32] {
        self.bins.at(q)
    }

    /// The lowest move at a point, where it cuts below.
    pub fn cuts_away(&self, at: &Point3) -> Option<u32> {
        let (z, by) = self.surface.envelope.lowest(at.x, at.y, self.over(at.xy()))?;
        (z < at.z - 0.5 * NUMERICAL_FLOOR).then_some(by)
    }

    /// The move that cuts away what stands so high, mm, over a place of the design. A line along a normal may
    /// end at the side of what the rim of a cutter swept: what stands is looked at just below. What is left
    /// for that and for [`Self::cuts_away`] is one [`NUMERICAL_FLOOR`] together.
    pub fn cuts_away_over(&self, design: &SurfacePoint, height: f64) -> Option<u32> {
        self.cuts_away(&(design.point + design.normal * (height - 0.5 * NUMERICAL_FLOOR)))
    }
}
