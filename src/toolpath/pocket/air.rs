//! Where no stock stands before the first cut: beyond open sides, and where a larger cutter was.
//!
//! Enters: the pocket, the cutter's radius, runs. Leaves: discs of that ground for the plan, ways along its
//! border where passes begin, and the runs without what they would do in the air. There the cutter comes down
//! straight; mm.

use super::route::{Entry, Run};
use super::shape::Pocket;
use super::walls::Room;
use geometry::{CurveSegment, Point2, Region, RegionIndex, SegmentGrid, Vector2};

/// A disc over the cutter's radius that lies in the air where the cutter may come down, so that it touches no
/// stock.
const HELD: f64 = 1.02;

/// Places along borders, and of ground far from them, over the radius: discs there leave no more than films
/// between them.
const ALONG: f64 = 0.12;
const APART: f64 = 0.7;

/// Runs are asked at places this far apart over the radius; and ways in the air are left out that are longer
/// than so many.
const BIT: f64 = 0.1;
const LONG: f64 = 6.0;

/// Passes begin and end so far in the air, over the radius.
const LEAD: f64 = 0.1;

pub(super) struct Air {
    radius: f64,
    index: RegionIndex,
    /// Sides of the air beside which stock stands.
    stock: SegmentGrid,
    /// Centres whose discs lie in it.
    pub discs: Vec<Point2>,
    /// Closed ways of the centre along its border, the stock on their right.
    pub ways: Vec<Vec<Point2>>,
    borders: SegmentGrid,
}

impl Air {
    /// `None` where all is stock.
    pub fn of(pocket: &Pocket, radius: f64) -> Option<Self> {
        let air = pocket.air();
        let sampled = |region: &Region| -> Vec<Vec<Point2>> {
            region.curves().map(|curve| divided(curve, ALONG * radius)).collect()
        };
        // Once more than asked of it, so that places on a way are surely held.
        let ways = sampled(&air.inset((HELD + 1e-3) * radius));
        if ways.is_empty() {
            return None;
        }
        let within = air.union(&pocket.ground_beyond(radius)).inset(radius);
        let mut discs = sampled(&within).concat();
        discs.extend(inside(&within, APART * radius));
        let borders = SegmentGrid::of_curves(ways.iter().map(Vec::as_slice));
        Some(Self {
            radius,
            stock: pocket.borders_of_air(),
            index: RegionIndex::new(air.clone()),
            discs,
            ways,
            borders,
        })
    }

    /// Whether the cutter at a place where it may be touches no stock. It may touch walls.
    pub fn holds(&self, centre: &Point2) -> bool {
        self.index.contains(centre) && self.stock.distance(centre) >= HELD * self.radius
    }

    /// The stretches of the ways along its border that lie in a room.
    pub fn ways_in(&self, contains: impl Fn(&Point2) -> bool) -> Vec<Vec<Point2>> {
        let mut found = Vec::new();
        for way in &self.ways {
            let mut closed = way.clone();
            closed.push(way[0]);
            found.extend(closed.split(|p| !contains(p)).filter(|part| part.len() > 1).map(<[_]>::to_vec));
        }
        found
    }

    /// The run entered from the nearest border instead of down through stock, if a straight way leads from
    /// there.
    pub fn entered(&self, mut run: Run, room: &Room) -> Run {
        let begin = run.points.first().filter(|p| !self.holds(p));
        let near = begin.and_then(|begin| Some((begin, self.borders.nearest(begin)?)));
        let from = near.and_then(|(begin, near)| {
            let [a, b] = self.borders.segments()[near.segment as usize].ends;
            let from = a + (b - a) * near.share;
            room.holds(&from, begin).then_some(from)
        });
        if let Some(from) = from {
            run.points.insert(0, from);
            run.entry = Entry::Air;
        }
        run
    }

    /// The parts of a run that cut, each with a short way in the air before and behind it.
    pub fn trimmed(&self, run: Run) -> Vec<Run> {
        let places = places(&run.points, BIT * self.radius);
        if places.len() < 2 {
            return vec![run];
        }
        let held: Vec<bool> = places.iter().map(|place| self.holds(&place.at)).collect();
        let cuts = (0..places.len() - 1).filter(|k| !(held[*k] && held[*k + 1]));
        let mut parts: Vec<[usize; 2]> = Vec::new();
        for k in cuts {
            match parts.last_mut() {
                Some(last) if places[k].gone - places[last[1]].gone <= LONG * self.radius => last[1] = k + 1,
                _ => parts.push([k, k + 1]),
            }
        }
        let lead = LEAD * self.radius;
        let part = |&[from, to]: &[usize; 2]| {
            let first = (0..from)
                .rev()
                .take_while(|k| held[*k])
                .find(|k| places[from].gone - places[*k].gone >= lead);
            let last = (to + 1..places.len())
                .take_while(|k| held[*k])
                .find(|k| places[*k].gone - places[to].gone >= lead);
            let (first, last) = (first.unwrap_or(from), last.unwrap_or(to));
            let kept = |k: &usize| *k == first || *k == last || places[*k].is_corner;
            let points = (first..=last).filter(kept).map(|k| places[k].at).collect();
            let entry = if held[first] { Entry::Air } else { run.entry.clone() };
            Run { entry, points }
        };
        parts.iter().map(part).collect()
    }
}

/// A place of a way.
struct Place {
    at: Point2,
    /// Length of the way up to it, mm.
    gone: f64,
    is_corner: bool,
}

/// Places of a way no farther apart than `most`, its corners among them.
fn places(points: &[Point2], most: f64) -> Vec<Place> {
    let Some(&first) = points.first() else { return Vec::new() };
    let mut places = vec![Place { at: first, gone: 0.0, is_corner: true }];
    let mut gone = 0.0;
    for side in points.windows(2) {
        let along = side[1] - side[0];
        let count = (along.norm() / most).ceil().max(1.0) as usize;
        for k in 1..=count {
            let share = k as f64 / count as f64;
            let at = if k == count { side[1] } else { side[0] + along * share };
            places.push(Place { at, gone: gone + along.norm() * share, is_corner: k == count });
        }
        gone += along.norm();
    }
    places
}

/// A closed curve with places no farther apart than `most`.
fn divided(curve: &[Point2], most: f64) -> Vec<Point2> {
    let mut closed = curve.to_vec();
    closed.push(curve[0]);
    let mut places: Vec<Point2> = places(&closed, most).into_iter().map(|place| place.at).collect();
    places.pop();
    places
}

/// Places of a square grid inside a region.
fn inside(region: &Region, apart: f64) -> Vec<Point2> {
    let Some([lo, hi]) = region.bounds() else { return Vec::new() };
    let index = RegionIndex::new(region.clone());
    let count = ((hi - lo) / apart).map(|n| n.floor() as usize);
    let at = |i: usize, j: usize| lo + Vector2::new(i as f64, j as f64) * apart;
    let all = (0..=count.y).flat_map(|j| (0..=count.x).map(move |i| at(i, j)));
    all.filter(|p| index.contains(p)).collect()
}

/// Sides of ways that are not closed.
pub(super) fn sides<'a>(ways: impl IntoIterator<Item = &'a [Point2]>) -> Vec<CurveSegment> {
    let of_one =
        |way: &'a [Point2]| way.windows(2).map(|w| CurveSegment { ends: [w[0], w[1]], curve: 0, index: 0 });
    ways.into_iter().flat_map(of_one).collect()
}
