//! The chambers of a piece: its wide places, each with the ground around it up to the necks between them.
//!
//! Enters: the piece of the cutter's centre. Leaves: the chamber of each place. Two wide places are chambers
//! of their own where every way between them passes a neck with half of the room that the narrower of them
//! has. Places are square cells in the order of their distance from the walls, the greatest first: each
//! belongs to the chamber of one beside it, and two chambers meet at the neck between them (watersheds: S.
//! Beucher, C. Lantuéjoul, 1979); mm.

use super::walls::Room;
use geometry::{Piece, Point2, Region, Vector2};
use work::monitor::{Cancelled, Monitor, check};
use work::parallel;

/// Side of a cell over the radius, and most cells along a side.
const CELL: f64 = 0.1;
const MOST_CELLS: f64 = 512.0;

/// A neck has at most this share of the room of a chamber.
const NECK: f64 = 0.5;

/// The chamber of a cell outside of the piece.
const OUTSIDE: usize = usize::MAX;

pub(super) struct Chambers {
    origin: Point2,
    cell: f64,
    side: [usize; 2],
    of_cells: Vec<usize>,
    /// Which of them passes may go to.
    entered: Vec<bool>,
}

impl Chambers {
    /// The chambers with room for a helix of the radius `least`; `None` where there is no neck between such.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub fn of(
        piece: &Piece,
        room: &Room,
        radius: f64,
        least: f64,
        monitor: &dyn Monitor,
    ) -> Result<Option<Self>, Cancelled> {
        let Some([lo, hi]) = (Region { pieces: vec![piece.clone()] }).bounds() else { return Ok(None) };
        let size = hi - lo;
        let cell = (CELL * radius).max(size.x.max(size.y) / MOST_CELLS);
        let side = [size.x, size.y].map(|s| (s / cell).ceil() as usize + 1);
        let mut chambers = Self { origin: lo, cell, side, of_cells: Vec::new(), entered: Vec::new() };
        let row = |j: usize| {
            check(monitor)?;
            let at = |i| chambers.origin + Vector2::new(i as f64, j as f64) * cell;
            let places = (0..side[0]).map(at);
            Ok(places.map(|p| if room.holds_place(&p) { room.distance(&p) } else { -1.0 }).collect())
        };
        let distances: Vec<Vec<f64>> = parallel::try_map(side[1], row)?;
        chambers.divide(&distances.concat(), least);
        Ok((chambers.entered.len() > 1).then_some(chambers))
    }

    /// Gives each cell its chamber.
    fn divide(&mut self, distances: &[f64], least: f64) {
        let mut cells: Vec<usize> = (0..distances.len()).filter(|k| distances[*k] >= 0.0).collect();
        cells.sort_by(|a, b| distances[*b].total_cmp(&distances[*a]));
        // Wide places, with the one that each was found to be the same as, and with their greatest distance.
        let mut wide: Vec<(usize, f64)> = Vec::new();
        let same = |wide: &[(usize, f64)], mut k: usize| {
            while wide[k].0 != k {
                k = wide[k].0;
            }
            k
        };
        let mut of_cells = vec![OUTSIDE; distances.len()];
        for cell in cells {
            let known: Vec<usize> = self.beside(cell).filter(|k| of_cells[*k] != OUTSIDE).collect();
            // Along a wall, too, the way up leads to the chamber that a cell belongs to.
            let up =
                known.iter().copied().max_by(|a, b| distances[*a].total_cmp(&distances[*b]).then(b.cmp(a)));
            let mut beside: Vec<usize> = known.iter().map(|k| same(&wide, of_cells[*k])).collect();
            // Those found first are the widest.
            beside.sort_unstable();
            beside.dedup();
            for other in beside.iter().skip(1) {
                let room = wide[*other].1;
                if room < least || distances[cell] > NECK * room {
                    wide[*other].0 = beside[0];
                }
            }
            of_cells[cell] = up.map_or_else(
                || {
                    wide.push((wide.len(), distances[cell]));
                    wide.len() - 1
                },
                |up| of_cells[up],
            );
        }
        let kept: Vec<usize> = (0..wide.len()).filter(|k| wide[*k].0 == *k).collect();
        let number = |k: usize| kept.binary_search(&same(&wide, k)).unwrap_or(OUTSIDE);
        self.of_cells = of_cells.into_iter().map(|k| if k == OUTSIDE { k } else { number(k) }).collect();
        self.entered = vec![false; kept.len()];
    }

    /// The cells around one.
    fn beside(&self, cell: usize) -> impl Iterator<Item = usize> {
        let [width, height] = self.side;
        let (i, j) = (cell % width, cell / width);
        let rows = j.saturating_sub(1)..=(j + 1).min(height - 1);
        rows.flat_map(move |j| (i.saturating_sub(1)..=(i + 1).min(width - 1)).map(move |i| j * width + i))
    }

    fn at(&self, p: &Point2) -> Option<usize> {
        let at = (p - self.origin) / self.cell;
        let [i, j] = [0, 1].map(|axis| (at[axis].round().max(0.0) as usize).min(self.side[axis] - 1));
        let cell = j * self.side[0] + i;
        // The cell of a place on a wall may be beyond it.
        std::iter::once(cell).chain(self.beside(cell)).map(|k| self.of_cells[k]).find(|k| *k != OUTSIDE)
    }

    /// Passes may go to the chamber of a place.
    pub fn enter(&mut self, p: &Point2) {
        if let Some(k) = self.at(p) {
            self.entered[k] = true;
        }
    }

    /// Whether a place belongs to a chamber that passes may not go to.
    pub fn is_closed(&self, p: &Point2) -> bool {
        self.at(p).is_some_and(|k| !self.entered[k])
    }

    /// Whether passes may go everywhere.
    pub fn all_entered(&self) -> bool {
        self.entered.iter().all(|entered| *entered)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use work::monitor::Silent;

    /// Two squares of the half side 10 joined by a corridor: chambers of their own where it is narrower than
    /// half, and divided in it.
    #[test]
    fn places_are_apart_beyond_a_neck() {
        let chambers = |half: f64| {
            let corners = [
                (-30., -10.),
                (-10., -10.),
                (-10., -half),
                (10., -half),
                (10., -10.),
                (30., -10.),
                (30., 10.),
                (10., 10.),
                (10., half),
                (-10., half),
                (-10., 10.),
                (-30., 10.),
            ];
            let outer = corners.map(|(x, y)| Point2::new(x, y)).to_vec();
            let piece = Piece { outer, islands: Vec::new() };
            Chambers::of(&piece, &Room::new(&piece), 4.0, 1.0, &Silent).unwrap()
        };
        assert!(chambers(5.5).is_none());
        let mut found = chambers(4.0).unwrap();
        assert_eq!(found.entered.len(), 2);
        let [left, right] = [-20.0, 20.0].map(|x| Point2::new(x, 3.0));
        found.enter(&left);
        assert!(!found.is_closed(&left) && found.is_closed(&right) && !found.all_entered());
        assert!(!found.is_closed(&Point2::new(-11.0, 0.0)) && found.is_closed(&Point2::new(11.0, 0.0)));
        // Along the walls as well, up to places on them.
        let along = [-10.0, -9.97, -9.0, -6.0, 0.0, 9.97, 10.0]
            .map(|y| [10.2, 15.0, 22.0, 30.0].map(|x| Point2::new(x, y)));
        assert!(along.as_flattened().iter().all(|p| found.is_closed(p)));
        found.enter(&right);
        assert!(!found.is_closed(&right) && found.all_entered());
    }
}
