//! Where passes are asked for, besides the slopes of faces.

use std::sync::Arc;

use geometry::{Point2, Region};

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
}

impl Rest {
    /// Of cells in rows along x, the centre of the first at `origin`, their pitch, mm, and how many there are
    /// along x and y.
    ///
    /// # Panics
    /// When there are more or fewer cells than that.
    pub fn new(origin: Point2, cell: f64, count: [usize; 2], stands: Vec<bool>) -> Self {
        assert_eq!(stands.len(), count[0] * count[1], "one value for each cell");
        Self { origin, cell, count, stands }
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

    /// Whether anything is left at all.
    pub fn is_empty(&self) -> bool {
        !self.stands.contains(&true)
    }

    /// Whether too much stands in the cell of a place.
    pub fn stands(&self, p: &Point2) -> bool {
        self.cell_of(p).is_some_and(|k| self.stands[k])
    }

    fn cell_of(&self, p: &Point2) -> Option<usize> {
        let [i, j] = [0, 1].map(|axis| ((p[axis] - self.origin[axis]) / self.cell).round());
        let [nx, ny] = self.count;
        let is_on = i >= 0.0 && j >= 0.0 && i < nx as f64 && j < ny as f64;
        is_on.then(|| j as usize * nx + i as usize)
    }

    /// With the squares of `reach`, mm, around each place.
    #[must_use]
    pub fn grown(&self, reach: f64) -> Self {
        let cells = (reach / self.cell).ceil() as usize;
        let [nx, ny] = self.count;
        let along_x = spread(&self.stands, [nx, ny], [1, nx], cells);
        let stands = spread(&along_x, [ny, nx], [nx, 1], cells);
        Self { stands, ..self.clone() }
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
        let more = rest.clone().and([Point2::new(10.0, 20.0), Point2::new(0.0, 0.0)].into_iter());
        assert!(more.stands(&Point2::new(10.2, 20.2)) && !rest.stands(&Point2::new(10.2, 20.2)));
        assert!(!rest.is_empty() && Rest::new(Point2::origin(), 1.0, [1, 1], vec![false]).is_empty());
    }
}
