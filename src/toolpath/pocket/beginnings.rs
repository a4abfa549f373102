//! Places of passes where others may begin, by place: the one nearest to the end of a way, and which of them
//! are known to have stock beside them.
//!
//! Ground is only ever cleared. So a place without stock is forgotten, and one with stock is asked again only
//! after something was cleared so near that it matters. So is a place from which no pass came through, when
//! no other one is left; mm.

use std::collections::HashMap;

use geometry::{Point2, Vector2};

/// Cells that what was cleared in one may matter to, to either side: the circumference of a cutter beside a
/// place and the disc about what was cleared meet within 2.11 radii, and a cell is a radius.
const AROUND: i32 = 3;

type Cell = [i32; 2];

/// A place of a pass where another one may begin.
pub(super) struct Beginning {
    /// Its index in the way.
    pub index: usize,
    pub at: Point2,
    pub heading: Vector2,
    /// Its pass.
    pub pass: usize,
    forgotten: bool,
    /// It had stock when so many passes were done.
    stock_at: Option<usize>,
}

/// All of them, in the order of the way.
pub(super) struct Beginnings {
    radius: f64,
    all: Vec<Beginning>,
    cells: HashMap<Cell, Vec<usize>>,
    left: usize,
    passes: usize,
    /// The last pass that cleared something that may matter to a cell.
    changed: HashMap<Cell, usize>,
    /// Places from which no pass came through, and how many passes were done then.
    failed: Vec<(usize, usize)>,
}

impl Beginnings {
    pub fn new(radius: f64) -> Self {
        let (cells, changed) = (HashMap::new(), HashMap::new());
        Self { radius, all: Vec::new(), cells, left: 0, passes: 0, changed, failed: Vec::new() }
    }

    fn cell(&self, p: &Point2) -> Cell {
        [p.x, p.y].map(|x| (x / self.radius).floor() as i32)
    }

    pub fn get(&self, k: usize) -> &Beginning {
        &self.all[k]
    }

    /// A place of the pass that was done last, the first of the way being 0.
    pub fn push(&mut self, index: usize, at: Point2, heading: Vector2) {
        let (cell, k) = (self.cell(&at), self.all.len());
        self.cells.entry(cell).or_default().push(k);
        self.left += 1;
        self.all.push(Beginning { index, at, heading, pass: self.passes, forgotten: false, stock_at: None });
    }

    /// The way up to here was done, and cleared ground about these places.
    pub fn pass_done(&mut self, places: &[Point2]) {
        self.passes += 1;
        let mut last = None;
        for p in places {
            let cell = self.cell(p);
            if last == Some(cell) {
                continue;
            }
            last = Some(cell);
            for i in -AROUND..=AROUND {
                for j in -AROUND..=AROUND {
                    self.changed.insert([cell[0] + i, cell[1] + j], self.passes);
                }
            }
        }
    }

    pub fn forget(&mut self, k: usize) {
        let cell = self.cell(&self.all[k].at);
        if !std::mem::replace(&mut self.all[k].forgotten, true) {
            self.left -= 1;
            self.cells.entry(cell).or_default().retain(|other| *other != k);
        }
    }

    /// The last pass that cleared something that may matter to a place.
    fn changed_at(&self, k: usize) -> usize {
        self.changed.get(&self.cell(&self.all[k].at)).copied().unwrap_or(0)
    }

    /// No pass came through from a place: it waits for ground to be cleared near to it. Those that are the
    /// same are forgotten: every pass that began there has it, too.
    pub fn fail(&mut self, k: usize) {
        self.failed.push((k, self.passes));
        let (at, heading) = (self.all[k].at, self.all[k].heading);
        let cell = self.cells.get(&self.cell(&at)).cloned().unwrap_or_default();
        let alike = |k: &usize| self.all[*k].at == at && self.all[*k].heading == heading;
        cell.into_iter().filter(alike).collect::<Vec<usize>>().into_iter().for_each(|k| self.forget(k));
    }

    /// Takes back places from which no pass came through where ground was cleared since; whether there are
    /// any.
    pub fn take_back(&mut self) -> bool {
        let failed = std::mem::take(&mut self.failed);
        let (again, waiting) = failed.into_iter().partition(|(k, at)| self.changed_at(*k) > *at);
        self.failed = waiting;
        let again: Vec<(usize, usize)> = again;
        for (k, _) in &again {
            self.all[*k].forgotten = false;
            self.left += 1;
            let cell = self.cell(&self.all[*k].at);
            self.cells.entry(cell).or_default().push(*k);
        }
        !again.is_empty()
    }

    /// Whether a place has stock, which `ask` finds out where it may have changed.
    pub fn has_stock(&mut self, k: usize, ask: impl FnOnce(&Beginning) -> bool) -> bool {
        let (place, changed) = (&self.all[k], self.changed_at(k));
        let has = place.stock_at.is_some_and(|at| at >= changed) || ask(place);
        self.all[k].stock_at = has.then_some(self.passes);
        has
    }

    /// The place before this one in the same pass.
    pub fn before(&self, k: usize) -> Option<usize> {
        let pass = self.all[k].pass;
        let same = (0..k).rev().take_while(|before| self.all[*before].pass == pass);
        same.into_iter().find(|before| !self.all[*before].forgotten)
    }

    /// The index of the place right before this one in the same pass, else its own.
    pub fn index_before(&self, k: usize) -> usize {
        let place = &self.all[k];
        let before = k.checked_sub(1).map(|before| &self.all[before]);
        before.filter(|before| before.pass == place.pass).map_or(place.index, |before| before.index)
    }

    /// Those nearer to a place than half a radius.
    pub fn near(&self, at: &Point2) -> Vec<usize> {
        let [i, j] = self.cell(at);
        let cells = (i - 1..=i + 1).flat_map(|i| (j - 1..=j + 1).map(move |j| [i, j]));
        let all = cells.filter_map(|cell| self.cells.get(&cell)).flatten().copied();
        all.filter(|k| (self.all[*k].at - at).norm() <= 0.5 * self.radius).collect()
    }

    /// The nearest one, of those equally near the first.
    pub fn nearest(&self, to: &Point2) -> Option<usize> {
        if self.left == 0 {
            return None;
        }
        let [x, y] = self.cell(to);
        let mut best: Option<(f64, usize)> = None;
        for ring in 0i32.. {
            // Whatever lies in this ring of cells or beyond is so far away at least.
            let away = f64::from(ring - 1).max(0.0) * self.radius;
            if best.is_some_and(|best| best.0 < away * away) {
                break;
            }
            for i in -ring..=ring {
                let step = if i.abs() == ring || ring == 0 { 1 } else { 2 * ring };
                for j in (-ring..=ring).step_by(step as usize) {
                    for &k in self.cells.get(&[x + i, y + j]).into_iter().flatten() {
                        let one = ((self.all[k].at - to).norm_squared(), k);
                        if best.is_none_or(|best| one < best) {
                            best = Some(one);
                        }
                    }
                }
            }
        }
        best.map(|best| best.1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The nearest of many places is that of a look at all, and forgotten ones are none.
    #[test]
    fn the_nearest_place_is_found_by_cells() {
        let mut places = Beginnings::new(2.0);
        let at = |k: u32, by: f64| {
            let (a, b) = ((0.618_034 * f64::from(k) + by).fract(), (0.754_878 * f64::from(k) + by).fract());
            Point2::new(80.0 * a - 40.0, 60.0 * b - 30.0)
        };
        (0..300).for_each(|k| places.push(k as usize, at(k, 0.0), Vector2::new(1.0, 0.0)));
        for k in 0..300 {
            let to = at(k, 0.3);
            let found = places.nearest(&to).unwrap();
            let away = |k: &usize| (places.get(*k).at - to).norm();
            let left = (0..300).filter(|k| !places.all[*k].forgotten);
            let best = left.min_by(|a, b| away(a).total_cmp(&away(b))).unwrap();
            assert_eq!(found, best);
            places.forget(found);
        }
        assert_eq!(places.nearest(&Point2::origin()), None);
    }

    /// Of places at one point only those with the same heading go together.
    #[test]
    fn places_that_are_the_same_are_forgotten_together() {
        let mut places = Beginnings::new(1.0);
        let (at, x, y) = (Point2::new(0.5, 0.5), Vector2::new(1.0, 0.0), Vector2::new(0.0, 1.0));
        for (index, heading) in [x, y, x, x].into_iter().enumerate() {
            places.push(index, at, heading);
            places.pass_done(&[at]);
        }
        places.push(4, at + x * 1e-9, x);
        places.fail(2);
        let forgotten: Vec<bool> = places.all.iter().map(|place| place.forgotten).collect();
        assert_eq!(forgotten, [true, false, true, true, false]);
        assert_eq!(places.left, 2);
    }

    /// A place from which no pass came through is taken back after ground was cleared near to it, and not
    /// before.
    #[test]
    fn failed_places_are_taken_back_where_ground_was_cleared() {
        let mut places = Beginnings::new(1.0);
        let (at, x) = (Point2::new(0.5, 0.5), Vector2::new(1.0, 0.0));
        places.push(0, at, x);
        places.pass_done(&[at]);
        places.fail(0);
        assert!(!places.take_back() && places.nearest(&at).is_none());
        places.pass_done(&[Point2::new(9.5, 0.5)]);
        assert!(!places.take_back());
        places.pass_done(&[Point2::new(2.5, 0.5)]);
        assert!(places.take_back());
        assert_eq!(places.nearest(&at), Some(0));
        assert!(!places.take_back());
    }

    /// A place is asked again after something was cleared near to it, and not before.
    #[test]
    fn stock_is_asked_for_where_ground_was_cleared() {
        let mut places = Beginnings::new(1.0);
        places.push(0, Point2::new(0.5, 0.5), Vector2::new(1.0, 0.0));
        assert!(places.has_stock(0, |_| true) && places.has_stock(0, |_| false));
        places.pass_done(&[Point2::new(9.5, 0.5)]);
        assert!(places.has_stock(0, |_| false));
        places.pass_done(&[Point2::new(2.5, 0.5)]);
        assert!(!places.has_stock(0, |_| false));
    }
}
