//! How much of the cutter's circumference stands in stock along a path, in the plan view.
//!
//! Enters: path, cutter, stock with a flat top. Leaves: for every move the greatest angle of the front half
//! of the circumference in stock, and what it is at most anywhere on the move. Corners of bull cutters and
//! balls count as cylinders of the same radius; mm, rad. Nothing here knows how a path was planned.
//!
//! What the path has cleared is the union of what its segments swept, each a stadium of the cutter's radius.
//! A circle meets a stadium along arcs in closed form, so the angle at a place is exact. Where a layer beyond
//! the circumference is thinner than a film, whose thickness the caller chooses, it does not count as stock:
//! chords and rounding leave films along ground that was cut before, which load nothing. Only the chip that
//! is just being cut begins as thin as one likes. So what the path cleared just before is taken as it is, as
//! far back as it would hide the sides of a straight slot.
//!
//! A stadium is convex. So what lies in it as seen from both ends of a stretch lies in it as seen from
//! everywhere between, and the same calculation from both ends bounds the angle on the whole stretch. What it
//! loses are places that one segment clears at one end and the next segment at the other: a layer whose depth
//! is of second order. Stretches are halved until the bound is near the greatest angle that was found.
//!
//! Moves are taken in blocks, one after the other. What was cleared well before a block and lies whole in
//! what else was is left out from then on: loops and passes over cleared ground are most of a long path.

mod near;
mod thin;

use std::f64::consts::{FRAC_PI_2, PI};
use std::ops::Range;
use std::slice::from_ref;

use cutter::Cutter;
use geometry::{Point2, RegionIndex, RimSamples, Vector2};
use motion::{Move, MoveKind, Toolpath};
use near::Bundle;
use sim::{ENGAGED, Stock};
use work::monitor::{self, Cancelled, Monitor};

/// Films up to this share of the radius are no stock for an engagement that is judged. Beside a straight wall
/// an angle `a` is seen smaller by about as much over `sin a`.
pub const UNCOUNTED_LAYER: f64 = 0.005;

/// Thinner layers, over the radius, are no chips in any case: an edge needs about a third of its own radius
/// to cut, and edges are rounded by one to three thousandths of the cutter's radius.
pub const THIN_LAYER: f64 = 0.001;

/// Stretches of a move that are looked at are no longer than this share of the radius, and may be halved so
/// often.
const STRETCH: f64 = 0.05;
const HALVINGS: u32 = 12;

/// A bound that exceeds the greatest angle by no more is good enough, rad.
const PRECISE: f64 = 0.02 * PI / 180.0;

/// Shorter arcs, rad, and nearer places, over the radius, are rounding.
const ROUNDING: f64 = 1e-12;
const TOUCHING: f64 = 1e-9;

/// Moves of a block: fewer are thinned more often, more see more that lies in other ground.
const BLOCK: usize = 512;

/// Longer segments, over the radius, are never left out, and longer moves are looked at in parts.
const SHORT: f64 = 1.0;

/// Buckets along a side at most.
const MOST_BUCKETS: f64 = 1024.0;

/// Angles of the circumference in stock.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactArcs {
    /// The greatest that was found on each move, rad; 0 of moves that do not feed sideways.
    pub of_moves: Vec<f64>,
    /// What it is at most on each move that counts, rad; not below the greatest of all that count.
    pub at_most: Vec<f64>,
}

impl ContactArcs {
    /// By how much the greatest angle of the moves that count may exceed the greatest that was found, rad.
    pub fn bound(&self) -> f64 {
        let greatest = |angles: &[f64]| angles.iter().copied().fold(0.0, f64::max);
        let counted = self.of_moves.iter().zip(&self.at_most).filter(|(_, most)| **most > 0.0);
        let found: Vec<f64> = counted.map(|(found, _)| *found).collect();
        (greatest(&self.at_most) - greatest(&found)).max(0.0)
    }
}

/// The angles along `path` in a stock whose top is flat, but for what was [cleared](Stock::cleared) before.
/// Those of the moves that `count` are bounded. Layers up to the share `film` of the radius beside ground
/// that was cleared before are no stock.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
///
/// # Tolerance
/// Exact at the places that are looked at. Between them [`ContactArcs::at_most`] holds but for rounding.
pub fn contact_arcs(
    path: &Toolpath,
    cutter: &Cutter,
    stock: &Stock,
    film: f64,
    count: &(dyn Fn(&Move) -> bool + Sync),
    monitor: &dyn Monitor,
) -> Result<ContactArcs, Cancelled> {
    monitor.start("measuring engagement", path.len() as u64);
    let top = stock.bounds().max.z;
    let mut cleared = Swept::by(path, cutter.radius(), film);
    cleared.before = stock.cleared();
    let (mut of_moves, mut at_most) = (Vec::new(), Vec::new());
    // Of the moves that count, so far.
    let mut greatest = 0.0f64;
    while of_moves.len() < path.len() {
        monitor::check(monitor)?;
        let first = of_moves.len();
        cleared.thin(first);
        let count_of = BLOCK.min(path.len() - first);
        let stretches = cleared.all_looked_at(path, top, first..first + count_of, monitor)?;
        of_moves.extend(stretches.iter().map(|all| all.iter().map(|one| one.found).fold(0.0, f64::max)));
        let counted: Vec<bool> = path.moves[first..first + count_of].iter().map(count).collect();
        let greatest_of = |found: &[f64]| {
            let counted = found.iter().zip(&counted).filter(|(_, counted)| **counted);
            counted.map(|(found, _)| *found).fold(0.0, f64::max)
        };
        greatest = greatest.max(greatest_of(&of_moves[first..]));
        let bounds = work::parallel::try_map(count_of, |k| {
            monitor::check(monitor)?;
            let of_counted = stretches[k].iter().filter(|_| counted[k]);
            let each = of_counted
                .map(|one| cleared.bounded(&one.stretch, one.most, one.deciding(), greatest, HALVINGS));
            Ok(each.fold([0.0f64; 2], |most, one| [0, 1].map(|side| most[side].max(one[side]))))
        })?;
        for (k, [least, most]) in bounds.into_iter().enumerate() {
            of_moves[first + k] = of_moves[first + k].max(least);
            at_most.push(most);
        }
        greatest = greatest.max(greatest_of(&of_moves[first..]));
        monitor.advance(count_of as u64);
    }
    // What stays below the greatest of all is of no account.
    at_most.iter_mut().filter(|most| **most > 0.0).for_each(|most| *most = most.max(greatest));
    Ok(ContactArcs { of_moves, at_most })
}

/// A part of a straight move.
#[derive(Debug, Clone, Copy)]
struct Stretch {
    /// Its middle, and the unit vector along it.
    middle: Point2,
    heading: Vector2,
    /// Half its length, mm.
    half: f64,
    /// The way gone up to its middle, mm.
    gone: f64,
    /// Whether it is no lower than what was cleared before the path.
    over_floor: bool,
}

impl Stretch {
    /// A place as seen from the middle, x along the heading.
    fn seen(&self, p: &Point2) -> Vector2 {
        let to = p - self.middle;
        Vector2::new(self.heading.dot(&to), self.heading.perp(&to))
    }

    /// All of a row of stretches of one move.
    fn over(part: &[Self]) -> Self {
        let half = part.iter().map(|stretch| stretch.half).sum();
        let (first, by) = (part[0], half - part[0].half);
        Self { middle: first.middle + first.heading * by, gone: first.gone + by, half, ..first }
    }

    fn halves(&self) -> [Self; 2] {
        let half = 0.5 * self.half;
        [-half, half].map(|by| Self {
            middle: self.middle + self.heading * by,
            gone: self.gone + by,
            half,
            ..*self
        })
    }
}

/// A stretch that was looked at from both of its ends.
struct Looked {
    stretch: Stretch,
    /// The greater angle at its ends, and what the angle is at most anywhere on it, rad.
    found: f64,
    most: f64,
    /// The segments that decide about every place of it, the last first.
    deciding: Bundle,
}

impl Looked {
    fn deciding(&self) -> &[Bundle] {
        from_ref(&self.deciding)
    }
}

/// A straight way of the cutter's axis.
#[derive(Debug, Clone, Copy)]
struct Segment {
    ends: [Point2; 2],
    /// It cleared down to this height, mm.
    z: f64,
    /// The way gone when it began and ended, mm.
    gone: [f64; 2],
}

/// What a path sweeps, in order, with buckets to find what is near.
struct Swept<'a> {
    radius: f64,
    /// Layers up to this share of the radius do not count.
    film: f64,
    /// Where nothing stood above a level before the path, and that level, mm.
    before: Option<(&'a RegionIndex, f64)>,
    /// The way just behind the cutter that leaves no films, mm.
    fresh: f64,
    segments: Vec<Segment>,
    origin: Point2,
    bucket: f64,
    side: [usize; 2],
    buckets: Vec<Vec<u32>>,
    rim: RimSamples,
    /// So many segments no later place finds fresh.
    settled: usize,
    /// How many of them thinning left in each bucket.
    left: Vec<usize>,
    /// By segment: how many were settled when it was looked at, and where its rim was bare then.
    bare: Vec<Option<(u32, Vector2)>>,
}

impl<'a> Swept<'a> {
    fn by(path: &Toolpath, radius: f64, film: f64) -> Self {
        let fresh = radius * (2.0 * film + film * film).sqrt();
        let mut gone = 0.0;
        let mut segments = Vec::with_capacity(path.len());
        for (a, b, m) in path.segments() {
            let length = (b.xy() - a.xy()).norm();
            if m.kind == MoveKind::Rapid || length == 0.0 {
                // What was cut before the tool was lifted or plunged is no chip of its own any more.
                gone += fresh;
            }
            segments.push(Segment { ends: [a.xy(), b.xy()], z: a.z.max(b.z), gone: [gone, gone + length] });
            gone += length;
            if length == 0.0 {
                gone += fresh;
            }
        }
        let ends = || segments.iter().flat_map(|s: &Segment| s.ends);
        let first = path.start.tip.xy();
        let (lo, hi) = ends().fold((first, first), |(lo, hi), p| (lo.inf(&p), hi.sup(&p)));
        let size = hi - lo;
        let bucket = radius.max(size.x.max(size.y) / MOST_BUCKETS);
        let side = [size.x, size.y].map(|s| (s / bucket).floor() as usize + 1);
        let mut swept = Self {
            radius,
            film,
            before: None,
            fresh,
            segments: Vec::new(),
            origin: lo,
            bucket,
            side,
            buckets: vec![Vec::new(); side[0] * side[1]],
            rim: RimSamples::new(),
            settled: 0,
            left: vec![0; side[0] * side[1]],
            bare: vec![None; segments.len()],
        };
        for (k, segment) in segments.iter().enumerate() {
            for at in swept.buckets_of(segment.ends) {
                swept.buckets[at].push(k as u32);
            }
        }
        swept.segments = segments;
        swept
    }

    /// The buckets of places along a segment, a bucket apart at most; who looks for it looks a bucket
    /// farther.
    fn buckets_of(&self, [a, b]: [Point2; 2]) -> Vec<usize> {
        let steps = ((b - a).norm() / self.bucket).ceil().max(1.0);
        let of = |step: usize| {
            let at = a + (b - a) * (step as f64 / steps) - self.origin;
            self.column(1, at.y) * self.side[0] + self.column(0, at.x)
        };
        let mut all: Vec<usize> = (0..=steps as usize).map(of).collect();
        all.dedup();
        all
    }

    /// Tells the segments from `first` on that may come so near to a place, bucket by bucket in the order of the
    /// path, until `tell` has enough of a bucket.
    fn each_near(&self, place: &Point2, reach: f64, first: usize, mut tell: impl FnMut(usize) -> bool) {
        let reach = Vector2::new(1.0, 1.0) * (reach + self.bucket);
        let (lo, hi) = (place - reach - self.origin, place + reach - self.origin);
        for j in self.column(1, lo.y)..=self.column(1, hi.y) {
            for i in self.column(0, lo.x)..=self.column(0, hi.x) {
                let bucket = &self.buckets[j * self.side[0] + i];
                let from = if first == 0 { 0 } else { bucket.partition_point(|&k| (k as usize) < first) };
                let _ = bucket[from..].iter().all(|&k| tell(k as usize));
            }
        }
    }

    fn column(&self, axis: usize, at: f64) -> usize {
        ((at / self.bucket).floor().max(0.0) as usize).min(self.side[axis] - 1)
    }

    /// The direction of a move that feeds sideways below the stock's top.
    fn heading(&self, path: &Toolpath, top: f64, k: usize) -> Option<Vector2> {
        let Segment { ends: [a, b], z, .. } = self.segments[k];
        (b - a).try_normalize(0.0).filter(|_| path.moves[k].kind != MoveKind::Rapid && z < top)
    }

    /// A move that feeds sideways below the stock's top, in stretches.
    fn stretches(&self, path: &Toolpath, top: f64, k: usize) -> Vec<Stretch> {
        let Segment { ends: [a, _], z, gone } = self.segments[k];
        let Some(heading) = self.heading(path, top, k) else { return Vec::new() };
        let length = gone[1] - gone[0];
        let count = (length / (STRETCH * self.radius)).ceil().max(1.0);
        let half = 0.5 * length / count;
        let over_floor = self.before.is_some_and(|(_, floor)| z > floor - ENGAGED);
        (0..count as usize)
            .map(|i| {
                let to = (2 * i + 1) as f64 * half;
                Stretch { middle: a + heading * to, heading, half, gone: gone[0] + to, over_floor }
            })
            .collect()
    }

    /// The angle so far from the middle of a stretch, mm.
    fn at(&self, stretch: &Stretch, by: f64, near: &[Bundle]) -> f64 {
        let (middle, gone) = (stretch.middle + stretch.heading * by, stretch.gone + by);
        self.standing(&Stretch { middle, gone, half: 0.0, ..*stretch }, near)
    }

    /// Looks at the stretches of each of these moves.
    fn all_looked_at(
        &self,
        path: &Toolpath,
        top: f64,
        moves: Range<usize>,
        monitor: &dyn Monitor,
    ) -> Result<Vec<Vec<Looked>>, Cancelled> {
        let rows = self.rows(moves.clone(), |k| self.heading(path, top, k).is_some());
        let of_rows = work::parallel::try_map(rows.len(), |row| {
            monitor::check(monitor)?;
            let deciding = self.deciding_for(&rows[row]);
            let looked_at = |k: &usize| self.looked_at(&self.stretches(path, top, *k), &deciding);
            Ok(rows[row].moves.iter().map(looked_at).collect::<Vec<_>>())
        })?;
        let first = moves.start;
        let mut all: Vec<Vec<Looked>> = moves.map(|_| Vec::new()).collect();
        for (row, of_row) in rows.iter().zip(of_rows) {
            row.moves.iter().zip(of_row).for_each(|(k, looked_at)| all[k - first] = looked_at);
        }
        Ok(all)
    }

    /// Looks at those stretches of a move that may meet stock, each from both ends.
    fn looked_at(&self, stretches: &[Stretch], near: &[Bundle]) -> Vec<Looked> {
        let Some(first) = stretches.first() else { return Vec::new() };
        let together = ((0.5 * SHORT * self.radius / first.half) as usize).max(1);
        // One stretch begins where another one ends.
        let mut last: Option<(f64, f64)> = None;
        let parts = stretches.chunks(together).flat_map(|part| {
            let (most, near) = self.deciding(&Stretch::over(part), near);
            let alone = part.len() == 1;
            let part = if most > 0.0 { part } else { &[] };
            let looked_at = part.iter().map(|stretch| {
                let (most, deciding) =
                    if alone { (most, near.clone()) } else { self.deciding(stretch, from_ref(&near)) };
                let begin = stretch.gone - stretch.half;
                let known = last.filter(|(gone, _)| (gone - begin).abs() < TOUCHING * self.radius);
                let ends = [
                    known.map_or_else(
                        || self.at(stretch, -stretch.half, from_ref(&deciding)),
                        |(_, angle)| angle,
                    ),
                    self.at(stretch, stretch.half, from_ref(&deciding)),
                ];
                last = Some((stretch.gone + stretch.half, ends[1]));
                Looked { stretch: *stretch, found: ends[0].max(ends[1]), most, deciding }
            });
            looked_at.collect::<Vec<Looked>>()
        });
        parts.collect()
    }

    /// What the angle is at most anywhere on a stretch, and the segments that decide about every place of it.
    fn deciding(&self, stretch: &Stretch, near: &[Bundle]) -> (f64, Bundle) {
        let mut taking = Vec::new();
        let front = self.front(stretch, near, |k| taking.push(k));
        // What those that took some cover from both ends they cover from everywhere between. Others can only
        // matter where the rest stands.
        let (reach, end) = ((1.0 + self.film) * self.radius + stretch.half, stretch.gone + stretch.half);
        let mut took = taking.iter().copied().peekable();
        let mut segments = Vec::new();
        for bundle in near {
            let may_clear = bundle.may_clear(&front, stretch, reach);
            if !may_clear && took.peek().is_none_or(|k| !bundle.may_hold(*k)) {
                continue;
            }
            let matters = |k: &u32| {
                let Segment { ends, gone, .. } = &self.segments[*k as usize];
                took.next_if_eq(k).is_some()
                    || may_clear && gone[0] <= end && front.may_clear(&ends.map(|p| stretch.seen(&p)), reach)
            };
            segments.extend(bundle.segments.iter().copied().filter(matters));
        }
        (front.angle(), Bundle { around: None, segments })
    }

    /// What the angle is at least and at most on a stretch, as far as it exceeds `enough`. It is known to be
    /// `most` at most.
    fn bounded(&self, stretch: &Stretch, most: f64, near: &[Bundle], enough: f64, halvings: u32) -> [f64; 2] {
        if most <= enough + PRECISE {
            return [0.0, most.max(enough)];
        }
        let here = self.at(stretch, 0.0, near);
        // One that stands so high all along need not be divided for its bound.
        if halvings == 0 || most - here <= PRECISE {
            return [here, most];
        }
        let [a, b] = stretch
            .halves()
            .map(|half| self.bounded(&half, self.standing(&half, near), near, enough, halvings - 1));
        [here.max(a[0]).max(b[0]), a[1].max(b[1])]
    }

    /// The angle of the front half of the circumference in stock, at most anywhere on a stretch.
    fn standing(&self, stretch: &Stretch, near: &[Bundle]) -> f64 {
        self.front(stretch, near, |_| ()).angle()
    }

    /// The front half of the circumference without what is cleared from everywhere on a stretch. Tells the
    /// segments that clear some.
    fn front(&self, stretch: &Stretch, near: &[Bundle], mut tell: impl FnMut(u32)) -> Front {
        let gone = stretch.gone - stretch.half;
        let before = gone - self.fresh;
        let (own, earlier) = ((1.0 - TOUCHING) * self.radius, (1.0 + self.film) * self.radius);
        let mut front = Front::new(self.radius);
        if let Some((region, _)) = self.before.filter(|_| stretch.over_floor) {
            front.clear_region(region, stretch, stretch.half - self.film * self.radius);
        }
        for bundle in near {
            if !bundle.may_clear(&front, stretch, earlier) {
                continue;
            }
            for &k in &bundle.segments {
                let segment = &self.segments[k as usize];
                if segment.gone[0] > gone {
                    continue;
                }
                let mut took = false;
                for (ways, radius) in [([f64::NEG_INFINITY, before], earlier), ([before, gone], own)] {
                    if let Some(ends) = segment.between(ways) {
                        took |= front.clear(&ends.map(|p| stretch.seen(&p)), radius, stretch.half);
                    }
                }
                if took {
                    tell(k);
                }
                if front.standing.is_empty() {
                    return front;
                }
            }
        }
        front
    }
}

impl Segment {
    /// The ends of what was gone of it between two ways.
    fn between(&self, [from, to]: [f64; 2]) -> Option<[Point2; 2]> {
        let [begin, end] = self.gone;
        if end < from || begin > to {
            return None;
        }
        let [a, b] = self.ends;
        let at = |way: f64| if end > begin { a + (b - a) * ((way - begin) / (end - begin)) } else { a };
        Some([if from <= begin { a } else { at(from) }, if to >= end { b } else { at(to) }])
    }
}

/// The front half of a circle around the origin, x along the heading; what of it was not cleared yet.
struct Front {
    rim: f64,
    /// Arcs from the right to the left, rad.
    standing: Vec<[f64; 2]>,
    /// Where each of them begins and ends, mm.
    ends: Vec<[Vector2; 2]>,
    /// Where the first arc begins and the last one ends, and how far to the left that is, mm.
    span: Option<[f64; 2]>,
    across: [f64; 2],
    /// Room for angles.
    angles: Vec<f64>,
}

impl Front {
    fn new(rim: f64) -> Self {
        let whole = [-FRAC_PI_2, FRAC_PI_2];
        Self {
            rim,
            standing: vec![whole],
            ends: vec![[Vector2::new(0.0, -rim), Vector2::new(0.0, rim)]],
            span: Some(whole),
            across: [-rim, rim],
            angles: Vec::new(),
        }
    }

    fn angle(&self) -> f64 {
        self.standing.iter().map(|[from, to]| to - from).sum()
    }

    /// Finds where what stands begins and ends.
    fn find_ends(&mut self) {
        self.span = self.standing.first().zip(self.standing.last()).map(|(first, last)| [first[0], last[1]]);
        self.across = self.span.unwrap_or_default().map(|angle| self.at(angle).y);
        self.ends = self.standing.iter().map(|arc| arc.map(|angle| self.at(angle))).collect();
    }

    fn stands_between(&self, from: f64, to: f64) -> bool {
        self.standing.iter().any(|[a, b]| to > *a && from < *b)
    }

    fn at(&self, angle: f64) -> Vector2 {
        let (sin, cos) = angle.sin_cos();
        Vector2::new(cos, sin) * self.rim
    }

    /// Clears what is nearer than `radius` to a segment wherever the circle is between `half` behind and
    /// `half` ahead; whether any of it was standing.
    fn clear(&mut self, ends: &[Vector2; 2], radius: f64, half: f64) -> bool {
        let behind = ends.map(|end| end + Vector2::new(half, 0.0));
        if behind[0].x.max(behind[1].x) + radius <= 0.0 || !self.may_clear(ends, radius) {
            return false;
        }
        let ahead = ends.map(|end| end - Vector2::new(half, 0.0));
        let mut angles = std::mem::take(&mut self.angles);
        self.crossings(&behind, radius, &mut angles);
        if half > 0.0 {
            self.crossings(&ahead, radius, &mut angles);
        }
        let square = radius * radius;
        let clears = |p: Vector2| [behind, ahead].iter().all(|ends| square_distance(&p, ends) < square);
        let taken = self.clear_between(&mut angles, |front, angle| clears(front.at(angle)));
        self.angles = angles;
        taken
    }

    /// Clears arcs between some angles, which are sorted and forgotten, where `clears` holds of their
    /// middles; whether any of it was standing.
    fn clear_between(&mut self, angles: &mut Vec<f64>, clears: impl Fn(&Self, f64) -> bool) -> bool {
        let Some([begin, end]) = self.span else { return false };
        angles.extend([begin, end]);
        angles.sort_unstable_by(f64::total_cmp);
        let mut taken = false;
        for arc in angles.windows(2) {
            let (from, to) = (arc[0], arc[1]);
            if self.stands_between(from, to) && clears(self, 0.5 * (from + to)) {
                self.take(from, to);
                taken = true;
            }
        }
        angles.clear();
        if taken {
            self.find_ends();
        }
        taken
    }

    /// Clears what lies in a region, and farther than `depth` from its sides: with that of half a stretch,
    /// wherever the circle is on it. Below zero, what lies no farther outside counts as well.
    fn clear_region(&mut self, region: &RegionIndex, stretch: &Stretch, depth: f64) {
        let middle = stretch.middle;
        let reach = Vector2::new(1.0, 1.0) * (self.rim + depth.abs());
        let mut near: Vec<u32> = Vec::new();
        region.sides().near(&[middle - reach, middle + reach], |k| near.push(k));
        near.sort_unstable();
        near.dedup();
        let sides: Vec<[Vector2; 2]> = near
            .iter()
            .map(|k| region.sides().segments()[*k as usize].ends.map(|p| stretch.seen(&p)))
            .collect();
        let mut angles = Vec::new();
        sides.iter().for_each(|side| self.crossings(side, depth.abs(), &mut angles));
        let (along, left) = (stretch.heading, Vector2::new(-stretch.heading.y, stretch.heading.x));
        self.clear_between(&mut angles, |front, angle| {
            let seen = front.at(angle);
            let away = sides.iter().map(|side| square_distance(&seen, side)).fold(f64::INFINITY, f64::min);
            let away = away.sqrt();
            let inside = region.contains(&(middle + along * seen.x + left * seen.y));
            if inside { away >= depth } else { -away >= depth }
        });
    }

    /// Whether a segment is near enough to clear any arc. A place of the segment that is so near to an arc, and
    /// to neither of its ends, lies in a direction between them.
    fn may_clear(&self, ends: &[Vector2; 2], radius: f64) -> bool {
        let rounding = TOUCHING * self.rim;
        let square = (radius + rounding).powi(2);
        let is_near = |place: &Vector2| square_distance(place, ends) < square;
        let is_between = |[from, to]: &[Vector2; 2]| {
            let beyond = |side: [f64; 2]| side[0].max(side[1]) < -rounding * self.rim;
            !beyond(ends.map(|p| from.perp(&p))) && !beyond(ends.map(|p| p.perp(to)))
        };
        let reaches = square_distance(&Vector2::zeros(), ends) < (self.rim + radius).powi(2);
        self.ends.iter().any(|arc| arc.iter().any(is_near) || (reaches && is_between(arc)))
    }

    /// Adds the angles where the circle crosses the border of the stadium around a segment, of those between
    /// the ends of what stands.
    fn crossings(&self, ends: &[Vector2; 2], radius: f64, found: &mut Vec<f64>) {
        let along = ends[1] - ends[0];
        let square = along.norm_squared();
        let share = |p: &Vector2| (p - ends[0]).dot(&along);
        // Both places of the circle whose share along a direction is `off`.
        let mut across = |direction: &Vector2, off: f64, valid: &dyn Fn(f64) -> bool| {
            let beside = self.rim * self.rim - off * off;
            if beside >= 0.0 {
                let (middle, aside) =
                    (direction * off, Vector2::new(-direction.y, direction.x) * beside.sqrt());
                let stands = |p: &Vector2| p.x >= 0.0 && p.y > self.across[0] && p.y < self.across[1];
                let both = [middle - aside, middle + aside].into_iter();
                found.extend(both.filter(|p| stands(p) && valid(share(p))).map(|p| p.y.atan2(p.x)));
            }
        };
        for (k, end) in ends.iter().enumerate() {
            let away = end.norm();
            let off = (self.rim * self.rim + away * away - radius * radius) / (2.0 * away);
            let valid = |share: f64| if k == 0 { share <= 0.0 } else { share >= square };
            if away > 0.0 {
                across(&(end / away), off, &valid);
            }
        }
        if square > 0.0 {
            let unit = along / square.sqrt();
            let beside = Vector2::new(-unit.y, unit.x);
            for side in [-radius, radius] {
                across(&beside, beside.dot(&ends[0]) + side, &|share| share > 0.0 && share < square);
            }
        }
    }

    /// Takes an arc away.
    fn take(&mut self, from: f64, to: f64) {
        let whole = std::mem::take(&mut self.standing);
        let left = whole.iter().flat_map(|&[a, b]| [[a, b.min(from)], [a.max(to), b]]);
        self.standing = left.filter(|[a, b]| b - a > ROUNDING).collect();
    }
}

/// Square of the distance of a point from a segment.
fn square_distance(p: &Vector2, [a, b]: &[Vector2; 2]) -> f64 {
    let along = b - a;
    let square = along.norm_squared();
    let t = if square > 0.0 { ((p - a).dot(&along) / square).clamp(0.0, 1.0) } else { 0.0 };
    (p - (a + along * t)).norm_squared()
}

#[cfg(test)]
mod tests;
