//! Where passes are asked for, besides the slopes of faces.

use std::sync::Arc;

use geometry::{Point2, Point3, Region};

/// What stands between cells within this share of an interval beside a higher cell is cut with it: passes come
/// as near to both as half an interval. Less adds passes at the rim of what is left, more leaves the rim.
const SERVED: f64 = 0.25;

/// Where passes are to be: everywhere, unless one of these says otherwise.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Places {
    /// Within it the axis of an upright tool stays, in the plan view.
    pub boundary: Option<Arc<Region>>,
    /// What toolpaths before left.
    pub rest: Option<Arc<Rest>>,
}

/// Where too much stands on a part, on cells of the plan view.
#[derive(Debug, Clone, PartialEq)]
pub struct Rest {
    origin: Point2,
    cell: f64,
    count: [usize; 2],
    stands: Vec<bool>,
    /// The cells over which too much may stand between the centres; none where nobody asked.
    between: Vec<bool>,
    /// The highest place, and its height, mm, to which no upright tool comes.
    out_of_reach: Option<(Point3, f64)>,
}

impl Rest {
    /// Of cells in rows along x, the centre of the first at `origin`, their pitch, mm, and how many there are
    /// along x and y.
    ///
    /// # Panics
    /// When there are more or fewer cells than that.
    pub fn new(origin: Point2, cell: f64, count: [usize; 2], stands: Vec<bool>) -> Self {
        assert_eq!(stands.len(), count[0] * count[1], "one value for each cell");
        Self { origin, cell, count, stands, between: Vec::new(), out_of_reach: None }
    }

    /// With the cells of further places.
    #[must_use]
    pub fn and(mut self, places: impl Iterator<Item = Point2>) -> Self {
        for place in places {
            if let Some(k) = self.cell_of(&place) {
                self.stands[k] = true;
            }
        }
        self
    }

    /// With the cells over which too much may stand between the centres.
    ///
    /// # Panics
    /// When there are more or fewer of them.
    #[must_use]
    pub fn and_between(self, between: Vec<bool>) -> Self {
        assert_eq!(between.len(), self.stands.len(), "one value for each cell");
        Self { between, ..self }
    }

    /// With a place that stands so high, mm, and to which no upright tool comes.
    #[must_use]
    pub fn and_out_of_reach(self, highest: Option<(Point3, f64)>) -> Self {
        Self { out_of_reach: highest, ..self }
    }

    /// What the user is told of it.
    pub(crate) fn note(&self) -> Option<String> {
        let left = self.out_of_reach.map(|(at, height)| {
            format!(
                "{:.0} µm at x {:.3} y {:.3} z {:.3}, on a face that looks down or lies below others",
                1e3 * height,
                at.x,
                at.y,
                at.z
            )
        });
        let nothing = "the toolpaths before left nothing above the scallop tolerance";
        match (self.is_empty(), left) {
            (true, None) => Some(nothing.to_owned()),
            (true, Some(left)) => Some(format!("{nothing} that an upright tool comes to; they left {left}")),
            (false, left) => left.map(|left| format!("an upright tool does not come to {left}")),
        }
    }

    /// Whether nothing is left that an upright tool comes to.
    pub fn is_empty(&self) -> bool {
        !self.stands.contains(&true) && !self.between.contains(&true)
    }

    /// Whether too much stands in the cell of a place.
    pub fn stands(&self, p: &Point2) -> bool {
        let between = |k: usize| self.between.get(k).is_some_and(|between| *between);
        self.cell_of(p).is_some_and(|k| self.stands[k] || between(k))
    }

    fn cell_of(&self, p: &Point2) -> Option<usize> {
        let [i, j] = [0, 1].map(|axis| ((p[axis] - self.origin[axis]) / self.cell).round());
        let [nx, ny] = self.count;
        let is_on = i >= 0.0 && j >= 0.0 && i < nx as f64 && j < ny as f64;
        is_on.then(|| j as usize * nx + i as usize)
    }

    /// With the squares of `reach`, mm, around each place. What stands between the centres of cells beside
    /// higher ones lies within their squares, and adds none.
    #[must_use]
    pub fn grown(&self, reach: f64) -> Self {
        let served = self.spread(&self.stands, (SERVED * reach / self.cell) as usize);
        let between = self.between.iter().zip(served).map(|(between, served)| *between && !served);
        let mut all = self.stands.clone();
        all.iter_mut().zip(between).for_each(|(stands, between)| *stands |= between);
        let stands = self.spread(&all, (reach / self.cell).ceil() as usize);
        Self { stands, between: Vec::new(), ..self.clone() }
    }

    /// As many cells around each that is set.
    fn spread(&self, set: &[bool], cells: usize) -> Vec<bool> {
        let [nx, ny] = self.count;
        let along_x = spread(set, [nx, ny], [1, nx], cells);
        spread(&along_x, [ny, nx], [nx, 1], cells)
    }
}

/// Each line of `length` cells that lie `step` apart, of `lines` that begin `next` apart, with as many `cells`
/// around each that is set.
fn spread(set: &[bool], [length, lines]: [usize; 2], [step, next]: [usize; 2], cells: usize) -> Vec<bool> {
    let mut all = vec![false; set.len()];
    for line in 0..lines {
        // The first cell that is not covered yet.
        let mut covered = 0;
        for k in (0..length).filter(|k| set[line * next + k * step]) {
            let end = (k + cells + 1).min(length);
            for place in k.saturating_sub(cells).max(covered)..end {
                all[line * next + place * step] = true;
            }
            covered = end;
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_grow_by_whole_cells_on_all_sides() {
        let (nx, ny) = (9, 7);
        let mut stands = vec![false; nx * ny];
        stands[3 * nx + 2] = true;
        stands[5 * nx + 8] = true;
        let rest = Rest::new(Point2::new(10.0, 20.0), 0.5, [nx, ny], stands.clone());
        let grown = rest.grown(0.7);
        for j in 0..ny {
            for i in 0..nx {
                let near = |a: usize, b: usize| i.abs_diff(a) <= 2 && j.abs_diff(b) <= 2;
                let p = Point2::new(10.0 + 0.5 * i as f64, 20.0 + 0.5 * j as f64);
                assert_eq!(grown.stands(&p), near(2, 3) || near(8, 5), "{i} {j}");
                assert_eq!(rest.stands(&p), stands[j * nx + i]);
            }
        }
        assert!(!grown.stands(&Point2::new(9.0, 20.0)) && !grown.stands(&Point2::new(14.4, 20.0)));
        // Beside a higher cell what stands between centres adds nothing, and farther off as much as that.
        for (i, adds) in [(3, false), (4, true)] {
            let mut between = vec![false; nx * ny];
            between[3 * nx + i] = true;
            let with = rest.clone().and_between(between).grown(2.0);
            let alone = rest.grown(2.0);
            assert_eq!(with.stands != alone.stands, adds, "{i}");
        }
        let none = Rest::new(Point2::origin(), 1.0, [1, 1], vec![false]);
        assert_eq!(none.note().unwrap(), "the toolpaths before left nothing above the scallop tolerance");
        assert!(!none.clone().and_between(vec![true]).is_empty() && rest.note().is_none());
        let below = none.and_out_of_reach(Some((Point3::new(1.0, 2.0, -3.0), 0.25)));
        assert!(below.is_empty() && below.note().unwrap().contains("250 µm at x 1.000 y 2.000 z -3.000"));
        let more = rest.clone().and([Point2::new(10.0, 20.0), Point2::new(0.0, 0.0)].into_iter());
        assert!(more.stands(&Point2::new(10.2, 20.2)) && !rest.stands(&Point2::new(10.2, 20.2)));
        assert!(!rest.is_empty() && Rest::new(Point2::origin(), 1.0, [1, 1], vec![false]).is_empty());
    }
}
