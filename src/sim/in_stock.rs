//! Proof that moves stay out of what stands when they come, for upright tools.
//!
//! Enters: the stock, cutters, a path, and which of its moves are asked for. Leaves: the first of them that
//! certainly meets stock, or else that is not shown to stay out; mm.
//!
//! A square of the plan holds nothing that a move meets where the cutter passes over the stock's greatest
//! height there, or where an earlier move leaves no more: what a move sweeps is a convex function of x and y,
//! so no higher in a rectangle than at its highest corner. Rectangles that neither shows are halved, down to
//! half of what counts as a touch. The stock's rectangle is divided itself, so that its sides are exact.
//!
//! Places of the tip at which the same cutter has been before, as deep or deeper, cut nothing: they are left
//! out first. So a move back along a slot or out of a hole is told exactly, where it touches walls all along;
//! so is what lies behind a place that a move leaves.

use std::rc::Rc;

use cutter::Cutter;
use geometry::{Point2, Point3};
use motion::{Cutters, Toolpath};
use work::monitor::{Cancelled, Monitor, check};
use work::parallel;

use super::bins::MoveBins;
use super::form::Form;
use super::swept::{swept_height, swept_height_and_normal};
use super::track::Track;
use super::{ENGAGED, Grid, Stock};

/// Rectangles that one move may take in all, and one bin in any case; what is left then stays open.
const MOST_RECTANGLES: usize = 20_000;
const LEAST_RECTANGLES: usize = 200;

/// Bins along the longer side of the stock at most, and their least side over the cutter's radius. Finer ones
/// take memory for each move, coarser ones longer lists.
const MOST_BINS: f64 = 64.0;
const LEAST_BIN: f64 = 0.5;

/// Moves that are looked at before the first finding ends the search.
const BATCH: usize = 256;

/// Lists of moves shorter than this are not sorted out again for half a rectangle.
const SHORT: usize = 16;

/// What of the tool must not meet stock on a move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum KeptOut {
    /// The cutter.
    Cutter,
    /// A disc as wide as the cutter, so far above the tip: what stands higher meets the tool above its edges.
    Above(f64),
}

/// A move that is not shown to stay out of stock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InStock {
    /// Index of the move.
    pub move_index: u32,
    /// Where stock stands, or may.
    pub at: Point3,
    /// How deep the move is in stock there for certain; `None` where it stays open whether it meets any.
    pub depth: Option<f64>,
}

/// Moves that cut before all others, or in order.
struct Cuts {
    /// First move and form of each cutter.
    forms: Vec<(u32, Form)>,
    tracks: Vec<Track>,
    bins: MoveBins,
}

impl Cuts {
    fn new(cutters: &Cutters, path: &Toolpath, grid: &Grid) -> Self {
        Self {
            forms: cutters.each().map(|(first, cutter)| (first, Form::new(cutter))).collect(),
            tracks: path.segments().map(|(from, to, _)| Track::new(from, to)).collect(),
            bins: MoveBins::new(grid, 1, cutters.greatest_radius(), path),
        }
    }

    fn form(&self, k: u32) -> &Form {
        &self.forms[self.forms.partition_point(|(first, _)| *first <= k).max(1) - 1].1
    }

    fn cut(&self, k: u32) -> (&Form, &Track) {
        (self.form(k), &self.tracks[k as usize])
    }
}

/// A rectangle of the plan.
#[derive(Debug, Clone, Copy)]
struct Rectangle {
    low: Point2,
    high: Point2,
}

impl Rectangle {
    fn centre(&self) -> Point2 {
        self.low + 0.5 * (self.high - self.low)
    }

    fn half_diagonal(&self) -> f64 {
        0.5 * (self.high - self.low).norm()
    }

    fn corners(&self) -> [Point2; 4] {
        let Self { low, high } = *self;
        [low, Point2::new(high.x, low.y), high, Point2::new(low.x, high.y)]
    }

    fn halves(&self) -> [Self; 2] {
        let axis = usize::from(self.high.y - self.low.y > self.high.x - self.low.x);
        let mut halves = [*self; 2];
        halves[0].high[axis] = self.centre()[axis];
        halves[1].low[axis] = self.centre()[axis];
        halves
    }

    /// Distance from the track in the plan.
    fn distance(&self, track: &Track) -> f64 {
        let ends = [0.0, track.length].map(|s| {
            let [x, y] = track.in_plan(s, 0.0);
            Point2::new(track.x + x, track.y + y)
        });
        let beside = |p: &Point2| {
            let out = |i: usize| (self.low[i] - p[i]).max(p[i] - self.high[i]).max(0.0);
            out(0).hypot(out(1))
        };
        let from_track = |q: &Point2| {
            let (along, across) = track.along_across(q.x, q.y);
            (along - along.clamp(0.0, track.length)).hypot(across)
        };
        // The part of the track within both of the rectangle's strips.
        let mut within = [0.0f64, 1.0];
        for i in 0..2 {
            let (from, way) = (ends[0][i], ends[1][i] - ends[0][i]);
            if way == 0.0 {
                if from < self.low[i] || from > self.high[i] {
                    within = [1.0, 0.0];
                }
                continue;
            }
            let [a, b] = [self.low[i], self.high[i]].map(|x| (x - from) / way);
            within = [within[0].max(a.min(b)), within[1].min(a.max(b))];
        }
        if within[0] <= within[1] {
            return 0.0;
        }
        let of_ends = ends.iter().map(beside).fold(f64::INFINITY, f64::min);
        self.corners().iter().map(from_track).fold(of_ends, f64::min)
    }
}

/// What must stay out of stock on one move: a form along parts of its way.
struct Body {
    form: Form,
    parts: Vec<Part>,
}

/// A part of a move's way, and whether nothing is cut at its lower and its upper end.
struct Part {
    track: Track,
    been: [bool; 2],
}

impl Part {
    /// Whether over a rectangle the move is as low as at an end where it cuts nothing: what lies behind that.
    fn is_behind(&self, over: &Rectangle) -> bool {
        let along = over.corners().map(|q| self.track.along_across(q.x, q.y).0);
        self.been[0] && along.iter().all(|s| *s <= 0.0)
            || self.been[1] && self.track.slope == 0.0 && along.iter().all(|s| *s >= self.track.length)
    }
}

impl Body {
    /// No lower than this over a rectangle, where a hair `less` of the radius and of the depth does not
    /// count.
    fn lowest(&self, over: &Rectangle, less: f64) -> f64 {
        let of_part = |part: &Part| {
            let track = &part.track;
            let near = (over.distance(track) + less).max(0.0);
            if near >= self.form.radius || part.is_behind(over) {
                return f64::INFINITY;
            }
            let (middle, half) = (over.centre(), over.half_diagonal());
            let (along, _) = track.along_across(middle.x, middle.y);
            let reach = self.form.radius + half - less.min(0.0);
            let first = (along - reach).clamp(0.0, track.length);
            let rough = track.tip(first) + self.form.height(near);
            if less < 0.0 {
                return rough + less;
            }
            // A convex function lies above its tangent plane.
            let tangent = swept_height_and_normal(&self.form, track, middle.x, middle.y)
                .filter(|(_, normal)| normal.z > 0.0)
                .map_or(f64::NEG_INFINITY, |(z, normal)| z - half * normal.xy().norm() / normal.z);
            rough.max(tangent) + less
        };
        self.parts.iter().map(of_part).fold(f64::INFINITY, f64::min)
    }

    /// Its height at a place where it reaches by more than a touch; infinite elsewhere.
    fn height(&self, q: &Point2, touch: f64) -> f64 {
        let of_part = |Part { track, .. }: &Part| {
            let (along, across) = track.along_across(q.x, q.y);
            let rho = (along - along.clamp(0.0, track.length)).hypot(across);
            if rho + touch < self.form.radius {
                swept_height(&self.form, track, q.x, q.y)
            } else {
                f64::INFINITY
            }
        };
        self.parts.iter().map(of_part).fold(f64::INFINITY, f64::min)
    }
}

/// The first of the moves that are asked for that certainly is in what stands when it comes, or else the
/// first that is not shown to stay out; `None` where all do. What cut `before` the path has its cutters
/// beside it.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
///
/// # Tolerance
/// Less than [`ENGAGED`] of the radius and of the depth is a touch. The cutters may stray from the path by
/// `strays`: stock is taken to stand by as much beyond what they sweep. Places of the tip are taken as they
/// are.
pub fn first_in_stock(
    stock: &Stock,
    before: &[(Cutter, Toolpath)],
    cutters: &Cutters,
    path: &Toolpath,
    strays: f64,
    asked: impl Fn(usize) -> Option<KeptOut> + Sync + Send,
    monitor: &dyn Monitor,
) -> Result<Option<InStock>, Cancelled> {
    let top = stock.bounds().max.z;
    let reaches = |&k: &usize| {
        let lowest = path.start_of(k).z.min(path.moves[k].to.tip.z);
        asked(k).is_some_and(|kept| lowest + raised(kept) + ENGAGED < top + strays)
    };
    let open: Vec<usize> = (0..path.len()).filter(reaches).collect();
    if open.is_empty() {
        return Ok(None);
    }
    let size = stock.bounds().size();
    let bin = (LEAST_BIN * cutters.greatest_radius()).max(size.x.max(size.y) / MOST_BINS);
    let [nx, ny] = [size.x, size.y].map(|s| (s / bin).ceil().max(1.0) as usize);
    let origin = stock.bounds().min.xy() + geometry::Vector2::new(0.5, 0.5) * bin;
    let grid = Grid { origin, cell: bin, nx, ny };
    let before = before.iter().map(|(cutter, path)| Cuts::new(&cutter.into(), path, &grid)).collect();
    let search = Search { stock, grid, before, own: Cuts::new(cutters, path, &grid), path, strays, monitor };
    let mut unsure = None;
    for batch in open.chunks(BATCH) {
        let found = parallel::try_map(batch.len(), |k| {
            let kept = asked(batch[k]).unwrap_or(KeptOut::Cutter);
            search.of_move(batch[k], kept)
        })?;
        for found in found.into_iter().flatten() {
            if found.depth.is_some() {
                return Ok(Some(found));
            }
            unsure = unsure.or(Some(found));
        }
    }
    Ok(unsure)
}

fn raised(kept: KeptOut) -> f64 {
    match kept {
        KeptOut::Cutter => 0.0,
        KeptOut::Above(height) => height,
    }
}

struct Search<'a> {
    stock: &'a Stock,
    grid: Grid,
    before: Vec<Cuts>,
    own: Cuts,
    path: &'a Toolpath,
    strays: f64,
    monitor: &'a dyn Monitor,
}

/// What one rectangle shows of a move.
enum Seen {
    Clear,
    Meets(Point3, f64),
    Open,
}

impl Search<'_> {
    fn of_move(&self, k: usize, kept: KeptOut) -> Result<Option<InStock>, Cancelled> {
        check(self.monitor)?;
        let own = *self.own.form(k as u32);
        let form = match kept {
            KeptOut::Cutter => own,
            KeptOut::Above(_) => {
                let Ok(disc) = Cutter::flat(2.0 * own.radius) else { return Ok(None) };
                Form::new(&disc)
            }
        };
        let ends = [self.path.start_of(k), self.path.moves[k].to.tip];
        let reach = form.radius + self.strays;
        let bins = self.bins_beside(ends, reach);
        let parts = self.new_places(k, &form, ends, raised(kept), &bins);
        let body = Body { form, parts };
        let (mut open, mut left) = (None, MOST_RECTANGLES);
        for &(i, j) in &bins {
            let Some(rectangle) = self.rectangle(i, j) else { continue };
            let earlier = self.earlier(k, i, j);
            match self.of_rectangle(&body, rectangle, earlier, &mut left) {
                Seen::Clear => {}
                Seen::Meets(at, depth) => {
                    return Ok(Some(InStock { move_index: k as u32, at, depth: Some(depth) }));
                }
                Seen::Open => open = open.or(Some(rectangle)),
            }
        }
        let place = |rectangle: Rectangle| {
            let (q, half) = (rectangle.centre(), rectangle.half_diagonal());
            Point3::new(q.x, q.y, self.stock.highest_within(q.x, q.y, half))
        };
        Ok(open.map(|r| InStock { move_index: k as u32, at: place(r), depth: None }))
    }

    /// The rectangle of a bin, within the stock's.
    fn rectangle(&self, i: usize, j: usize) -> Option<Rectangle> {
        let bounds = self.stock.bounds();
        let low = bounds.min.xy() + geometry::Vector2::new(i as f64, j as f64) * self.grid.cell;
        let high = low + geometry::Vector2::new(self.grid.cell, self.grid.cell);
        let high = Point2::new(high.x.min(bounds.max.x), high.y.min(bounds.max.y));
        (low.x < high.x && low.y < high.y).then_some(Rectangle { low, high })
    }

    /// Bins that a move comes near.
    fn bins_beside(&self, [from, to]: [Point3; 2], reach: f64) -> Vec<(usize, usize)> {
        let track = Track::new(from, to);
        let bounds = self.stock.bounds();
        let span = |axis: usize, n: usize| {
            let at = |x: f64| ((x - bounds.min[axis]) / self.grid.cell).floor().clamp(0.0, n as f64) as usize;
            at(from[axis].min(to[axis]) - reach)..(at(from[axis].max(to[axis]) + reach) + 1).min(n)
        };
        let columns = span(0, self.grid.nx);
        let all = span(1, self.grid.ny).flat_map(|j| columns.clone().map(move |i| (i, j)));
        all.filter(|&(i, j)| self.rectangle(i, j).is_some_and(|r| r.distance(&track) < reach)).collect()
    }

    /// What cut in a bin before a move, the latest first.
    fn earlier(&self, k: usize, i: usize, j: usize) -> Vec<(&Form, &Track)> {
        let own = self.own.bins.of_bin(i, j);
        let own = &own[..own.partition_point(|m| (*m as usize) < k)];
        let own = own.iter().rev().map(|&m| self.own.cut(m));
        let before = self.before.iter().rev();
        own.chain(before.flat_map(|cuts| cuts.bins.of_bin(i, j).iter().map(|&m| cuts.cut(m)))).collect()
    }

    /// The parts of a move's way at which no cutter that takes as much has been before.
    fn new_places(
        &self,
        k: usize,
        form: &Form,
        [from, to]: [Point3; 2],
        raised: f64,
        bins: &[(usize, usize)],
    ) -> Vec<Part> {
        let up = geometry::Vector3::new(0.0, 0.0, raised);
        let whole = Track::new(from + up, to + up);
        // A quarter of a touch, so that what is left of the radius is one.
        let near = 0.25 * ENGAGED;
        let mut been: Vec<[f64; 2]> = Vec::new();
        for &(i, j) in bins {
            for (other, track) in self.earlier(k, i, j) {
                // What the other takes at the rim stands no higher than this over its tip.
                let rise = match () {
                    () if other == form => 0.0,
                    () if form.profile.is_flat() && other.radius >= form.radius => other.height(form.radius),
                    () => continue,
                };
                been.extend(passed(&whole, track, rise, near));
            }
        }
        if whole.length == 0.0 {
            let part = Part { track: whole, been: [false; 2] };
            return if been.is_empty() { vec![part] } else { Vec::new() };
        }
        // Crossings are left out, which would only divide the way.
        been.retain(|[a, b]| b - a > near || *a <= near || *b >= whole.length - near);
        been.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let place = |s: f64| {
            let [x, y] = whole.in_plan(s, 0.0);
            Point3::new(whole.x + x, whole.y + y, whole.tip(s))
        };
        let at_start = been.first().is_some_and(|[a, _]| *a <= near);
        let at_end = been.iter().any(|[_, b]| *b >= whole.length - near);
        let (mut parts, mut at, mut before) = (Vec::new(), 0.0, at_start);
        for (k, [a, b]) in been.iter().copied().chain([[whole.length; 2]]).enumerate() {
            if a > at + near {
                let Point3 { coords } = place(at);
                let track = Track { x: coords.x, y: coords.y, z: coords.z, length: a - at, ..whole };
                parts.push(Part { track, been: [before, k < been.len() || at_end] });
            }
            (at, before) = (at.max(b), true);
        }
        parts
    }

    fn of_rectangle(
        &self,
        body: &Body,
        whole: Rectangle,
        earlier: Vec<(&Form, &Track)>,
        left: &mut usize,
    ) -> Seen {
        *left = (*left).max(LEAST_RECTANGLES);
        let mut waiting = vec![(whole, Rc::new(earlier))];
        let mut open = false;
        while let Some((rectangle, earlier)) = waiting.pop() {
            if *left == 0 {
                return Seen::Open;
            }
            *left -= 1;
            if self.is_clear(body, &rectangle, &earlier) {
                continue;
            }
            let q = rectangle.centre();
            if let Some((at, depth)) = self.meets(body, &q, &earlier) {
                return Seen::Meets(at, depth);
            }
            if rectangle.half_diagonal() < 0.25 * ENGAGED {
                open = true;
                continue;
            }
            for half in rectangle.halves() {
                let reaches = |(form, track): &&(&Form, &Track)| half.distance(track) <= form.radius;
                let near = if earlier.len() > SHORT {
                    Rc::new(earlier.iter().filter(reaches).copied().collect())
                } else {
                    earlier.clone()
                };
                waiting.push((half, near));
            }
        }
        if open { Seen::Open } else { Seen::Clear }
    }

    fn is_clear(&self, body: &Body, rectangle: &Rectangle, earlier: &[(&Form, &Track)]) -> bool {
        let (q, half) = (rectangle.centre(), 0.5 * (rectangle.high - rectangle.low).max());
        let lowest = body.lowest(rectangle, ENGAGED);
        if lowest == f64::INFINITY || self.stock.highest_within(q.x, q.y, half) <= lowest {
            return true;
        }
        let lowest = if self.strays > 0.0 { body.lowest(rectangle, ENGAGED - self.strays) } else { lowest };
        let corners = rectangle.corners();
        earlier
            .iter()
            .any(|(form, track)| corners.iter().all(|c| swept_height(form, track, c.x, c.y) <= lowest))
    }

    /// How deep a move certainly is in stock at a place.
    fn meets(&self, body: &Body, q: &Point2, earlier: &[(&Form, &Track)]) -> Option<(Point3, f64)> {
        let touch = ENGAGED + 2.0 * self.strays;
        let height = body.height(q, touch) + touch;
        let mut stands = self.stock.height_at(q.x, q.y);
        for (form, track) in earlier {
            if stands <= height {
                return None;
            }
            stands = stands.min(swept_height(form, track, q.x, q.y));
        }
        (stands > height).then(|| (Point3::new(q.x, q.y, stands), stands - height + touch))
    }
}

/// Between which places of a track another comes so near in the plan and is no higher, counted with `rise`.
fn passed(track: &Track, other: &Track, rise: f64, near: f64) -> Option<[f64; 2]> {
    let place = |track: &Track, s: f64| {
        let [x, y] = track.in_plan(s, 0.0);
        Point2::new(track.x + x, track.y + y)
    };
    let along = |q: Point2| track.along_across(q.x, q.y).0.clamp(0.0, track.length);
    let ends = [along(place(other, 0.0)), along(place(other, other.length))];
    let [a, b] = [ends[0].min(ends[1]), ends[0].max(ends[1])];
    let holds = |s: f64| {
        let q = place(track, s);
        let (along, across) = other.along_across(q.x, q.y);
        let abeam = along.clamp(0.0, other.length);
        (along - abeam).hypot(across) <= near && other.tip(abeam) + rise <= track.tip(s) + near
    };
    (holds(a) && holds(b)).then_some([a, b])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BarAxis;
    use geometry::Aabb;
    use motion::{ClPoint, Move, MoveKind};
    use work::monitor::Silent;

    fn block() -> Stock {
        Stock::Box(Aabb { min: Point3::new(-5.0, -5.0, -20.0), max: Point3::new(45.0, 35.0, 0.0) })
    }

    /// Moves from place to place; `true` at rapid rate.
    fn path(start: [f64; 3], to: &[(bool, [f64; 3])]) -> Toolpath {
        let at = |[x, y, z]: [f64; 3]| ClPoint::upright(Point3::new(x, y, z));
        let moves = to.iter().map(|&(rapid, place)| Move {
            to: at(place),
            kind: if rapid { MoveKind::Rapid } else { MoveKind::Cut },
            feed_rate: 600.0,
            pass: 0,
        });
        Toolpath::new(at(start), moves.collect())
    }

    fn rapid_in(stock: &Stock, cutter: Cutter, path: &Toolpath) -> Option<InStock> {
        let rapid = |k: usize| (path.moves[k].kind == MoveKind::Rapid).then_some(KeptOut::Cutter);
        first_in_stock(stock, &[], &Cutters::from(cutter), path, 0.0, rapid, &Silent).unwrap()
    }

    fn flat() -> Cutter {
        Cutter::flat(6.0).unwrap()
    }

    #[test]
    fn a_thin_cutter_is_found_wherever_it_passes() {
        let found = rapid_in(
            &block(),
            Cutter::flat(0.8).unwrap(),
            &path([-13.0, 10.0, -5.0], &[(true, [50.0, 10.0, -5.0])]),
        );
        assert!((found.unwrap().depth.unwrap() - 5.0).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn the_sides_of_a_block_are_exact() {
        let beside = |x: f64| rapid_in(&block(), flat(), &path([x, -20.0, -5.0], &[(true, [x, 50.0, -5.0])]));
        assert_eq!(beside(-8.0), None);
        assert_eq!(beside(-8.0 + 0.5 * ENGAGED), None);
        assert!(beside(-8.0 + 2.0 * ENGAGED).unwrap().depth.is_some());
        assert!(beside(-7.98).unwrap().depth.is_some());
        // Down beside it, and over its top.
        let down =
            |x: f64, z: f64| rapid_in(&block(), flat(), &path([x, 10.0, 5.0], &[(true, [x, 10.0, z])]));
        assert_eq!((down(-8.0, -20.0), down(20.0, 0.0)), (None, None));
        assert!(down(20.0, -0.01).unwrap().depth.is_some() && down(-7.99, -1.0).unwrap().depth.is_some());
    }

    /// Along walls that the cutter made itself, out of holes and back into them.
    #[test]
    fn where_the_cutter_has_been_it_may_go_again() {
        let slot = [(false, [50.0, 10.0, -4.0]), (true, [-13.0, 10.0, -4.0]), (true, [20.0, 10.0, 5.0])];
        assert_eq!(rapid_in(&block(), flat(), &path([-13.0, 10.0, -4.0], &slot)), None);
        let hole = [
            (false, [20.0, 10.0, -4.0]),
            (true, [20.0, 10.0, 5.0]),
            (true, [20.0, 10.0, -4.0]),
            (false, [20.0, 10.0, -8.0]),
            (true, [20.0, 10.0, 5.0]),
        ];
        for cutter in [flat(), Cutter::ball(6.0).unwrap(), Cutter::bull(6.0, 1.0).unwrap()] {
            assert_eq!(rapid_in(&block(), cutter, &path([20.0, 10.0, 5.0], &hole)), None);
        }
        let deeper = path([20.0, 10.0, 5.0], &[hole[0], hole[1], (true, [20.0, 10.0, -4.01])]);
        assert!(rapid_in(&block(), flat(), &deeper).unwrap().depth.is_some());
    }

    /// From a wall into what was cleared, and over scallops.
    #[test]
    fn across_a_cleared_floor() {
        let passes = |from: [f64; 3]| {
            let mut to: Vec<(bool, [f64; 3])> = Vec::new();
            for k in 0..6 {
                let (y, x) = (2.0 + 4.0 * f64::from(k), if k % 2 == 0 { 30.0 } else { 5.0 });
                to.extend([(false, [35.0 - x, y, from[2]]), (false, [x, y, from[2]])]);
            }
            to
        };
        let start = [5.0, 2.0, -3.0];
        let with = |cutter: Cutter, z: f64, last: [f64; 3]| {
            let mut to = passes(start);
            to.extend([(true, [5.0, 22.0, z]), (true, last)]);
            rapid_in(&block(), cutter, &path(start, &to))
        };
        assert_eq!(with(flat(), -3.0, [17.0, 11.0, -3.0]), None);
        // Not beyond the walls.
        assert!(with(flat(), -3.0, [4.9, 11.0, -3.0]).unwrap().depth.is_some());
        // A ball leaves ridges of 0.764 mm.
        let ball = Cutter::ball(6.0).unwrap();
        assert_eq!(with(ball, -3.0 + 0.78, [17.0, 11.0, -3.0 + 0.78]), None);
        assert!(with(ball, -3.0, [17.0, 11.0, -3.0]).unwrap().depth.is_some());
    }

    /// Stock that stands above the edges, however thin.
    #[test]
    fn what_stands_above_the_edges() {
        let rib = |wide: f64, limit: f64| {
            let y = 3.0 + 0.5 * wide;
            let passes = [
                (false, [50.0, 10.0 - y, -4.0]),
                (false, [50.0, 10.0 - y, 5.0]),
                (false, [-13.0, 10.0 + y, 5.0]),
                (false, [-13.0, 10.0 + y, -4.0]),
                (false, [50.0, 10.0 + y, -4.0]),
                (false, [50.0, 10.0 + y, 5.0]),
                (false, [-13.0, 10.0, 5.0]),
                (false, [-13.0, 10.0, -6.0]),
                (false, [50.0, 10.0, -6.0]),
            ];
            let path = path([-13.0, 10.0 - y, -4.0], &passes);
            let above = |_: usize| Some(KeptOut::Above(limit));
            first_in_stock(&block(), &[], &Cutters::from(flat()), &path, 0.0, above, &Silent).unwrap()
        };
        for wide in [0.3, 0.03, 0.002] {
            let found = rib(wide, 5.0).unwrap();
            assert!((found.depth.unwrap() - 1.0).abs() < 1e-9 && found.move_index == 8, "{wide}: {found:?}");
            assert_eq!(rib(wide, 6.0), None);
        }
        // In layers the edges need not be as long as the slot is deep.
        let mut layers = Vec::new();
        for k in 1..=6 {
            let z = -2.0 * f64::from(k);
            layers.extend([(false, [20.0, 10.0, z]), (false, [30.0, 15.0, z]), (false, [20.0, 10.0, z])]);
        }
        let path = path([20.0, 10.0, 5.0], &layers);
        let above = |_: usize| Some(KeptOut::Above(2.0));
        let found = first_in_stock(&block(), &[], &Cutters::from(flat()), &path, 0.0, above, &Silent);
        assert_eq!(found.unwrap(), None);
    }

    /// Other tools, other stock, and a path that strays.
    #[test]
    fn what_stands_depends_on_all() {
        let over = path([20.0, 10.0, -4.0], &[(true, [21.0, 10.0, -4.0])]);
        let before =
            vec![(Cutter::flat(12.0).unwrap(), path([20.0, 10.5, -4.0], &[(false, [21.0, 10.5, -4.0])]))];
        let rapid = |_: usize| Some(KeptOut::Cutter);
        let with = |before: &[(Cutter, Toolpath)], strays: f64| {
            first_in_stock(&block(), before, &Cutters::from(flat()), &over, strays, rapid, &Silent).unwrap()
        };
        assert_eq!(with(&before, 0.0), None);
        assert!(with(&[], 0.0).unwrap().depth.is_some());
        assert_eq!(with(&before, 0.1).map(|found| found.depth), Some(None));
        let bar = Stock::Cylinder {
            base: Point3::new(0.0, 0.0, -5.0),
            axis: BarAxis::X,
            radius: 5.0,
            length: 40.0,
        };
        let past = |y: f64| rapid_in(&bar, flat(), &path([-10.0, y, -3.0], &[(true, [50.0, y, -3.0])]));
        assert!(past(8.0 - 0.5).unwrap().depth.is_some());
        assert_eq!(past(8.1), None);
    }
}
