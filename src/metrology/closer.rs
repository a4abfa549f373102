//! The greatest value of a figure between cell centres, by branch and bound over squares of the plan.
//!
//! Enters: squares with what may stand in them at most, and a function that gives value and bound at the
//! centre of any square. Leaves: the greatest value, its place, and what it may be at most. The square
//! that promises most is divided into four, until none promises more than is asked, or the work that is
//! allowed is done; what is left over is the bound. mm.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::figures::NUMERICAL_FLOOR;
use geometry::{Point2, Vector2};
use work::monitor::{self, Cancelled, Monitor};

/// A square of the plan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Square {
    /// No value in it is greater, mm (first order).
    pub possible: f64,
    /// Centre, mm.
    pub centre: Point2,
    /// Half its side, mm.
    pub half: f64,
}

impl Square {
    /// The four squares in it, each of which may hold as much.
    pub fn quarters(&self) -> [Self; 4] {
        let Self { possible, centre, half } = *self;
        let quarter = 0.5 * half;
        let side = |up: bool| if up { quarter } else { -quarter };
        [0, 1, 2, 3].map(|k| {
            let centre = centre + Vector2::new(side(k & 1 != 0), side(k & 2 != 0));
            Self { possible, centre, half: quarter }
        })
    }
}

/// What a square holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Value {
    /// At its centre, mm.
    pub here: f64,
    /// At most anywhere in it, mm.
    pub possible: f64,
}

/// The squares that promise most, as many as will be looked at.
#[derive(Debug, Clone)]
pub(super) struct Promising {
    /// In no order.
    pub squares: Vec<Square>,
    /// What those left out promise at most, mm.
    pub others: f64,
}

impl Default for Promising {
    fn default() -> Self {
        Self { squares: Vec::new(), others: f64::NEG_INFINITY }
    }
}

impl Promising {
    /// The `most` best of some squares.
    pub fn of(squares: impl Iterator<Item = Square>, most: usize) -> Self {
        let mut all = Self::default();
        all.add(squares, most);
        all
    }

    /// Joins more squares and keeps the `most` best of all.
    pub fn add(&mut self, squares: impl Iterator<Item = Square>, most: usize) {
        for square in squares {
            self.squares.push(square);
            if self.squares.len() >= 2 * most {
                self.keep(most);
            }
        }
        self.keep(most);
    }

    fn keep(&mut self, most: usize) {
        if self.squares.len() > most {
            self.squares.select_nth_unstable_by(most, |a, b| b.cmp(a));
            self.others = self.others.max(self.squares[most].possible);
            self.squares.truncate(most);
        }
    }
}

/// Places asked for in any case, each some 2 µs: they bring most figures to nanometres. Fewer leave wider
/// bounds than need be, more take time where nobody asked.
const CHEAP: usize = 20_000;

/// Places asked for while the asked bound does not hold: some seconds. With fewer, small asked bounds stay
/// open along crests; with more a run that cannot meet its bound takes minutes to say so.
const MOST: usize = 2_000_000;

/// Squares divided at a time, by as many workers as there are. More of them look at squares that the
/// first ones would have ruled out.
const BATCH: usize = 256;

/// Values of a batch that are asked whether they stand, in vain: what disproved them changes the next batch.
const MOST_DISPROVED: usize = 16;

/// Half sides, mm, of squares that are divided no more: coordinates are rounded not far below.
const FINEST: f64 = 1e-9;

/// A square whose centre and corners lie off the part is divided until it is this share of the first one.
const OFF_PART_SHARE: f64 = 1.0 / 16.0;

/// What a search may spend.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Effort {
    /// Places that are asked for.
    pub places: usize,
    /// Squares that are held at a time, [`BYTES_PER_SQUARE`] each.
    pub squares: usize,
    /// The search ends where it can bring the bound neither to this, mm, nor to what was asked: nothing is
    /// decided by a higher one. Infinite where each bound is of use.
    pub useful: f64,
}

impl Effort {
    /// So many places and squares for a value of which each bound is of use.
    pub fn whole(places: usize, squares: usize) -> Self {
        Self { places, squares, useful: f64::INFINITY }
    }

    /// Whether no bound below `least`, mm, comes of the places that are left after `spent` ones: each square
    /// that promises more has to be divided once at least.
    fn is_in_vain(&self, open: &BinaryHeap<Square>, least: f64, spent: usize) -> bool {
        let promising = || open.iter().filter(|square| square.possible > least).count();
        self.useful.is_finite() && 4 * promising() > self.places - spent
    }
}

/// Bytes that a square takes while its list grows.
pub(super) const BYTES_PER_SQUARE: u64 = 2 * size_of::<Square>() as u64;

/// What a search found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct BoundedGreatest {
    /// The greatest value and its place, where it exceeds what was known.
    pub greatest: Option<(f64, Point2)>,
    /// No value is greater by more than [`NUMERICAL_FLOOR`], mm.
    pub possible: f64,
}

impl Eq for Square {}

impl Ord for Square {
    fn cmp(&self, other: &Self) -> Ordering {
        self.possible
            .total_cmp(&other.possible)
            .then(other.centre.y.total_cmp(&self.centre.y))
            .then(other.centre.x.total_cmp(&self.centre.x))
    }
}

impl PartialOrd for Square {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Searches `squares`, all of one size, for values above `known`, holding no more than `held` at a time. `at`
/// tells what the square around a place with a given half side holds, and at which of its places; `None` off
/// the part. `asked` tells how closely a greatest value is to be known.
///
/// # Tolerance
/// `possible` exceeds the greater of `known` and the value found by no more than is asked unless [`MOST`]
/// places or `held` squares did not suffice. It is as right as the bounds that `at` gives.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub(super) fn greatest(
    squares: Vec<Square>,
    known: f64,
    asked: &dyn Fn(f64) -> f64,
    held: usize,
    at: &(dyn Fn(Point2, f64) -> Option<(Point2, Value)> + Sync),
    monitor: &dyn Monitor,
) -> Result<BoundedGreatest, Cancelled> {
    let least = squares.first().map_or(0.0, |s| s.half * OFF_PART_SHARE);
    let inside = |centre: Point2, half: f64| {
        // Where the centre lies off the part a corner may not, from which all of the square is twice as far.
        let corner = |k: usize| {
            let side = |up: bool| if up { half } else { -half };
            let corner = Point2::new(centre.x + side(k & 1 != 0), centre.y + side(k & 2 != 0));
            at(corner, 2.0 * half)
        };
        let unknown = (centre, Value { here: f64::NEG_INFINITY, possible: f64::INFINITY });
        let found = at(centre, half).or_else(|| (0..4).find_map(corner));
        found.or((half > least).then_some(unknown))
    };
    search(squares, known, asked, Effort::whole(MOST, held), &inside, &|_, _| true, monitor)
}

/// As [`greatest`], with `most` effort; `asked` tells how closely a greatest value is to be known. `inside`
/// tells what the square around a centre with a given half side holds, and at which of its places; `None`
/// where it holds nothing. A value that would be the greatest counts only where `stands` says so; what it
/// says may change `inside` for squares that are looked at later.
pub(super) fn search(
    squares: Vec<Square>,
    known: f64,
    asked: &dyn Fn(f64) -> f64,
    most: Effort,
    inside: &(dyn Fn(Point2, f64) -> Option<(Point2, Value)> + Sync),
    stands: &dyn Fn(Point2, f64) -> bool,
    monitor: &dyn Monitor,
) -> Result<BoundedGreatest, Cancelled> {
    let mut open = BinaryHeap::from(squares);
    let (mut best, mut place, mut spent, mut undivided) = (known, None, 0, f64::NEG_INFINITY);
    while spent < most.places && open.len() < most.squares.max(BATCH) {
        let enough = if spent < CHEAP { NUMERICAL_FLOOR } else { asked(best).max(NUMERICAL_FLOOR) };
        // What is divided no more keeps the bound as wide, however low the rest is.
        let least = if spent < CHEAP { best + enough } else { undivided.max(best + enough) };
        if spent >= CHEAP && most.is_in_vain(&open, least.max(most.useful), spent) {
            break;
        }
        let mut batch = Vec::with_capacity(BATCH);
        while batch.len() < BATCH && open.peek().is_some_and(|s| s.possible > least) {
            match open.pop() {
                Some(fine) if fine.half < FINEST => undivided = fine.possible.max(undivided),
                square => batch.extend(square),
            }
        }
        if batch.is_empty() {
            break;
        }
        spent += 4 * batch.len();
        let quarters = work::parallel::try_map(4 * batch.len(), |k| {
            monitor::check(monitor)?;
            let Square { possible: whole, centre, half } = batch[k / 4].quarters()[k % 4];
            Ok(inside(centre, half).map(|(place, v)| {
                // A part of a square promises no more than the whole.
                let possible = v.possible.min(whole).max(v.here);
                (v.here, place, Square { possible, centre, half })
            }))
        })?;
        let mut disproved = 0;
        for &(here, at, _) in quarters.iter().flatten() {
            if here > best && disproved < MOST_DISPROVED {
                if stands(at, here) {
                    (best, place) = (here, Some(at));
                } else {
                    disproved += 1;
                }
            }
        }
        open.extend(
            quarters.into_iter().flatten().map(|q| q.2).filter(|s| s.possible > best + NUMERICAL_FLOOR),
        );
    }
    let possible = open.peek().map_or(best, |s| s.possible.max(best)).max(undivided);
    Ok(BoundedGreatest { greatest: place.map(|place| (best, place)), possible })
}

#[cfg(test)]
mod tests {
    use super::*;
    use work::monitor::Silent;

    /// Squares of side 1 over [0, n]², with values and slopes of `f`.
    fn search(
        n: u32,
        known: f64,
        asked: f64,
        f: &(dyn Fn(Point2) -> Option<(f64, f64)> + Sync),
    ) -> BoundedGreatest {
        let at = |centre: Point2, half: f64| {
            let (here, slope) = f(centre)?;
            Some((centre, Value { here, possible: here + slope * half * std::f64::consts::SQRT_2 }))
        };
        let centres = (0..n * n).map(|k| Point2::new(f64::from(k % n) + 0.5, f64::from(k / n) + 0.5));
        let squares = centres.filter_map(|centre| {
            at(centre, 0.5).map(|(_, v)| Square { possible: v.possible, centre, half: 0.5 })
        });
        greatest(squares.collect(), known, &|_| asked, usize::MAX, &at, &Silent).unwrap()
    }

    #[test]
    fn peaks_and_roofs_are_found_to_the_nanometre() {
        let peak = |p: Point2| {
            let d = p - Point2::new(3.217, 4.891);
            Some((7.0 - 0.1 * d.norm_squared(), 0.2 * d.norm()))
        };
        let found = search(8, 0.0, 1e-4, &peak);
        let (value, place) = found.greatest.unwrap();
        assert!(
            value <= 7.0 && found.possible >= 7.0 - NUMERICAL_FLOOR && found.possible - value <= 1.1e-6,
            "{found:?}"
        );
        assert!((place - Point2::new(3.217, 4.891)).norm() < 1e-2);
        // A crest askew to the squares, as high all along.
        let roof = |p: Point2| Some((2.0 - 0.3 * (p.x - 0.61 * p.y - 1.07).abs(), 0.3 * 1.1714));
        let found = search(8, 0.0, 1e-3, &roof);
        let value = found.greatest.unwrap().0;
        assert!(
            value <= 2.0 && found.possible >= 2.0 - NUMERICAL_FLOOR && found.possible - value <= 1e-3,
            "{found:?}"
        );
    }

    #[test]
    fn nothing_above_what_is_known_is_nothing_found() {
        let hill = |p: Point2| Some((1.0 - 0.1 * (p.x - 2.0).powi(2), 0.2 * (p.x - 2.0).abs()));
        let found = search(4, 5.0, 1e-3, &hill);
        assert_eq!(found, BoundedGreatest { greatest: None, possible: 5.0 });
    }

    /// A plateau whose squares promise more than it is high however small they are. The search cannot close
    /// its bound, and ends early where so high a bound is of no use. A crest is told as ever.
    #[test]
    fn a_search_in_vain_ends_where_its_bound_is_of_no_use() {
        use std::sync::atomic::{AtomicUsize, Ordering};
        let run = |n: u32, useful: f64, f: &(dyn Fn(Point2, f64) -> Value + Sync)| {
            let asked = AtomicUsize::new(0);
            let at = |centre: Point2, half: f64| {
                asked.fetch_add(1, Ordering::Relaxed);
                Some((centre, f(centre, half)))
            };
            let centres = (0..n * n).map(|k| Point2::new(f64::from(k % n) + 0.5, f64::from(k / n) + 0.5));
            let squares =
                centres.map(|centre| Square { possible: f(centre, 0.5).possible, centre, half: 0.5 });
            let most = Effort { useful, ..Effort::whole(400_000, usize::MAX) };
            let found =
                super::search(squares.collect(), 0.0, &|_| 1e-4, most, &at, &|_, _| true, &Silent).unwrap();
            (found, asked.into_inner())
        };
        let plateau = |_: Point2, half: f64| Value { here: 1.0, possible: 2.5 + half };
        let (whole, all) = run(20, f64::INFINITY, &plateau);
        for useful in [0.0, 2.0] {
            let (short, few) = run(20, useful, &plateau);
            assert_eq!(short.greatest, whole.greatest);
            assert!(short.possible >= whole.possible && short.possible < 2.6, "{short:?} {whole:?}");
            assert!(few < all / 3, "{useful}: {all} {few}");
        }
        // Nothing promises more than this.
        assert_eq!(run(20, 3.0, &plateau), (whole, all));
        let crest = |p: Point2, half: f64| {
            let here = 2.0 - 0.3 * (p.x - 0.61 * p.y - 1.07).abs();
            Value { here, possible: here + 0.3 * 1.62 * half }
        };
        assert_eq!(run(8, 0.0, &crest), run(8, f64::INFINITY, &crest));
    }

    /// The brink of a cliff, along which no square closes soon: a bound that is enough ends the search.
    #[test]
    fn a_bound_that_is_enough_ends_a_search() {
        use std::sync::atomic::{AtomicUsize, Ordering};
        let run = |asked: &dyn Fn(f64) -> f64| {
            let places = AtomicUsize::new(0);
            let at = |p: Point2, half: f64| {
                places.fetch_add(1, Ordering::Relaxed);
                let off = 9.03 - 0.1 * p.y - p.x;
                let here = if off > 0.0 { 1.0 - 0.5 * off } else { 0.0 };
                // The square may reach up to the brink, where it holds any of it.
                let possible =
                    if off > -1.2 * half { here.max(1.0 - 0.5 * off.max(0.0)) + 0.8 * half } else { here };
                Some((p, Value { here, possible }))
            };
            let centres = (0..400).map(|k| Point2::new(f64::from(k % 20) + 0.5, f64::from(k / 20) + 0.5));
            let squares = centres.map(|centre| Square { possible: 2.0, centre, half: 0.5 }).collect();
            (greatest(squares, 0.0, asked, usize::MAX, &at, &Silent).unwrap(), places.into_inner())
        };
        let (closely, all) = run(&|_| 1e-4);
        let (enough, few) = run(&|best| 1.25 - best);
        assert!(closely.possible <= 1.0 + 1e-4 && enough.possible <= 1.25, "{closely:?} {enough:?}");
        assert!(few < all / 2, "{all} {few}");
    }

    #[test]
    fn a_peak_beside_the_border_is_found_and_nothing_beyond_it() {
        // The value rises to the border at x = 2.93; the centre of the last square is off.
        let cliff = |p: Point2| (p.x <= 2.93).then_some((p.x, 1.0));
        let squares = vec![Square { possible: 4.0, centre: Point2::new(2.5, 0.5), half: 0.5 }];
        let at = |centre: Point2, half: f64| {
            let (here, slope) = cliff(centre)?;
            Some((centre, Value { here, possible: here + 1.5 * slope * half }))
        };
        let value = greatest(squares, 0.0, &|_| 1e-3, usize::MAX, &at, &Silent).unwrap().greatest.unwrap().0;
        assert!((2.93 - 2e-3..=2.93).contains(&value), "{value}");
    }
}
