//! Looks closer where more may stand or lie between the places than was found there.
//!
//! Enters: triangles with what was cut at their corners and the ridges that cross them. Leaves: the greatest figures, and
//! how much they may still be exceeded by. mm.

use std::collections::BinaryHeap;

use super::ridges::Crossing;
use super::{NormalInspection, Sample, Way};
use crate::figures::{Limits, NUMERICAL_FLOOR};
use geometry::{Point3, Vector3};
use work::monitor::{self, Cancelled, Monitor};

/// Triangles that are divided at most in search of extremes. Each asks for some ten places.
pub(super) const MOST_DIVIDED: usize = 40_000;

/// Where a limit lies between what is known and what is possible, this share of the asked bound is asked for.
const DECIDING: f64 = 1e-3;

/// A triangle is divided at most so often in a row: to a millionth of its side.
const MOST_DEPTH: u32 = 20;

/// Ways out of ridges are the same where the cosine between them is less than one by no more: an angle of a thousandth.
const ALIKE: f64 = 1e-6;

/// What may be found in a triangle, mm: the greatest depth, the highest uncut place, the highest ridge, the highest place along
/// the border that passes came down to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Possible {
    pub depth: f64,
    pub uncut: f64,
    pub ridge: f64,
    pub border: f64,
}

impl Possible {
    const NOTHING: Self = Self {
        depth: f64::NEG_INFINITY,
        uncut: f64::NEG_INFINITY,
        ridge: f64::NEG_INFINITY,
        border: f64::NEG_INFINITY,
    };

    fn or(self, other: Self) -> Self {
        Self {
            depth: self.depth.max(other.depth),
            uncut: self.uncut.max(other.uncut),
            ridge: self.ridge.max(other.ridge),
            border: self.border.max(other.border),
        }
    }

    /// By how much the figures may be exceeded, none by less than nothing, mm.
    fn beyond(self, greatest: &Greatest, limits: &Limits) -> Self {
        Self {
            depth: (self.depth - greatest.depth).max(0.0),
            uncut: (self.uncut - greatest.highest_uncut(limits)).max(0.0),
            ridge: (self.ridge - greatest.highest_ridge()).max(0.0),
            border: (self.border - greatest.highest_place()).max(0.0),
        }
    }

    pub fn greatest(self) -> f64 {
        self.depth.max(self.uncut).max(self.ridge).max(self.border)
    }

    /// Whether it is to be known more closely: where a figure may be exceeded by more than is `asked`, or a limit hangs on it.
    fn is_open(self, greatest: &Greatest, limits: &Limits, asked: f64) -> bool {
        let open = |possible: f64, known: f64, limit: f64| {
            // Figures have this floor on top.
            let decides = known <= limit && possible + 2.0 * NUMERICAL_FLOOR > limit;
            possible - known > if decides { DECIDING * asked } else { asked }.max(NUMERICAL_FLOOR)
        };
        open(self.depth, greatest.depth, limits.gouge)
            || open(self.uncut, greatest.highest_uncut(limits), limits.uncut)
            || open(self.ridge, greatest.highest_ridge(), limits.scallop)
            || open(self.border, greatest.highest_place(), limits.scallop)
    }
}

/// A triangle with what may be found in it, by promise.
struct Open {
    /// How much any figure may exceed what was known when it was opened, mm.
    promise: f64,
    possible: Possible,
    samples: [Sample; 3],
    /// Which of its sides are the border of the part.
    on_border: [bool; 3],
    depth: u32,
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Open {}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Open {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        let place = |open: &Self| open.samples[0].place.point;
        let (a, b) = (place(self), place(other));
        self.promise
            .total_cmp(&other.promise)
            .then(b.x.total_cmp(&a.x))
            .then(b.y.total_cmp(&a.y))
            .then(b.z.total_cmp(&a.z))
            .then(other.depth.cmp(&self.depth))
    }
}

/// The greatest figures found so far.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Greatest {
    pub depth: f64,
    pub deepest: Option<(Point3, u32)>,
    /// What the depth may be where it is uncertain.
    pub possible_depth: f64,
    /// The highest place that is uncut, with its height, mm, as far as ridges were known when it was found.
    pub uncut: Option<(f64, Sample)>,
    /// The highest ridge, where it is, and how much lower it may be.
    pub ridge: Option<(f64, Point3, f64)>,
    /// The highest place up to the uncut tolerance, with its height, mm.
    pub place: Option<(f64, Point3)>,
}

impl Greatest {
    pub fn look_at(&mut self, sample: &Sample, limits: &Limits) {
        let Some(hit) = sample.hit else { return };
        if hit.deviation <= limits.uncut && hit.deviation > self.highest_place() {
            self.place = Some((hit.deviation, sample.place.point));
        }
        self.possible_depth = self.possible_depth.max(hit.uncertain - hit.deviation);
        if -hit.deviation > self.depth {
            (self.depth, self.deepest) = (-hit.deviation, Some((sample.place.point, hit.by)));
        }
    }

    /// As [`Greatest::look_at`], and whether it stands higher than what was known to be uncut.
    pub fn look_at_height(&mut self, sample: &Sample, inspection: &NormalInspection<'_>) {
        let height = sample.height(inspection.engine);
        let higher = height > self.highest_uncut(inspection.limits);
        if higher && inspection.is_uncut(sample, self.highest_ridge()) {
            self.uncut = Some((height, *sample));
        }
    }

    /// Height of the highest ridge, mm; 0 without one.
    pub fn highest_ridge(&self) -> f64 {
        self.ridge.map_or(0.0, |(height, ..)| height)
    }

    /// Height of the highest place up to the uncut tolerance, mm; 0 without one.
    fn highest_place(&self) -> f64 {
        self.place.map_or(0.0, |(height, _)| height)
    }

    /// What a place must exceed to be the highest that is uncut, mm.
    fn highest_uncut(&self, limits: &Limits) -> f64 {
        self.uncut.map_or(limits.uncut, |(height, _)| height)
    }

    pub fn look_at_ridge(&mut self, crossing: &Crossing) {
        if self.ridge.is_none_or(|(height, ..)| crossing.height > height) {
            self.ridge = Some((crossing.height, crossing.at, crossing.uncertain));
        }
    }
}

/// What one triangle holds besides its corners.
struct Closer {
    middles: [Sample; 3],
    crossings: Vec<Crossing>,
}

/// How deep a move may cut in a triangle by the planes that touch the cut at the corners, mm. What one straight move cuts is
/// hollow or straight in every direction. So its height over the design lies above each of these planes, less what the
/// design rises off its own where it is hollow itself.
fn depth_by_tangents(samples: &[Sample; 3], by: u32) -> f64 {
    let way = |i: usize, j: usize| samples[j].place.point - samples[i].place.point;
    let hollow = [(0, 1), (1, 2), (2, 0)].map(|(i, j)| rise(samples, i, j)).into_iter().fold(0.0, f64::max);
    let of_corner = |i: usize| {
        let sample = &samples[i];
        let hit = sample.hit.filter(|hit| hit.by == by)?;
        // Along the normals the design counts as plane; on a ridge the plane is met in the same direction all over the triangle.
        let (cos, across, hollow) = match hit.way {
            Way::Normal => {
                let cos = hit.normal.dot(&sample.place.normal);
                (cos, hit.normal - sample.place.normal * cos, hollow)
            }
            Way::OutOfRidge(out) if is_one_ridge(samples, &out) => {
                let cos = hit.normal.dot(&out);
                (cos, hit.normal, hollow / cos)
            }
            Way::OutOfRidge(_) | Way::Thickness => return None,
        };
        // The height falls toward where the cut's normal leans.
        let fall = |j: usize| if cos > 0.0 { across.dot(&way(i, j)) / cos } else { f64::INFINITY };
        Some((0..3).filter(|&j| j != i).map(fall).fold(0.0, f64::max) - hit.deviation + hollow)
    };
    (0..3).filter_map(of_corner).fold(f64::INFINITY, f64::min)
}

/// Whether no corner of a triangle lies on a ridge that leads out another way.
fn is_one_ridge(samples: &[Sample; 3], out: &Vector3) -> bool {
    samples.iter().filter_map(|sample| sample.hit).all(|hit| match hit.way {
        Way::Normal => true,
        Way::OutOfRidge(other) => other.dot(out) > 1.0 - ALIKE,
        Way::Thickness => false,
    })
}

/// How the design rises off its tangent planes at both ends of a side, together, mm: positive where it is hollow.
fn rise(samples: &[Sample; 3], i: usize, j: usize) -> f64 {
    let [a, b] = [&samples[i].place, &samples[j].place];
    -(b.normal - a.normal).dot(&(b.point - a.point))
}

impl NormalInspection<'_> {
    /// What may be found in a triangle.
    fn possible(
        &self,
        samples: &[Sample; 3],
        on_border: [bool; 3],
        crossings: &[Crossing],
        greatest: &Greatest,
    ) -> Possible {
        let points = samples.map(|sample| sample.place.point);
        let longest = (0..3).map(|k| (points[(k + 1) % 3] - points[k]).norm()).fold(0.0, f64::max);
        // No place of a triangle is farther than this from its nearest corner.
        let far = longest / 3f64.sqrt();
        let mut found = Possible::NOTHING;
        for sample in samples {
            let Some(hit) = sample.hit else { continue };
            let slope = sample.slope();
            // What is part of a scallop rises to its ridge, which promises for itself.
            if self.is_uncut(sample, greatest.highest_ridge()) {
                found.uncut = found.uncut.max((hit.deviation + slope * far).min(self.engine.reach()));
            }
            // Nothing counts as deeper or higher than is looked, however steep a cut is.
            let depth = self.depth_around(samples, hit.by, far).min(depth_by_tangents(samples, hit.by));
            found.depth = found.depth.max(depth.min(self.engine.depth()));
        }
        found.border = self.border_at_most(samples, on_border, crossings);
        let ridge = |c: &Crossing| (c.height + c.rise * longest).min(self.engine.reach().max(c.height));
        found.ridge = crossings.iter().map(ridge).fold(found.ridge, f64::max);
        found
    }

    /// How high material stands at most along the sides of a triangle that are the border, as far as passes came down to it. What
    /// one move leaves is hollow or straight, so that it is highest at an end of a side or at the ridge where another one takes
    /// over, but for what the design sinks between the ends.
    fn border_at_most(&self, samples: &[Sample; 3], on_border: [bool; 3], crossings: &[Crossing]) -> f64 {
        let of_side = |k: usize| {
            let (i, j) = (k, (k + 1) % 3);
            let hit = |k: usize| samples[k].hit.filter(|hit| hit.deviation <= self.limits.uncut);
            // What rises to uncut material belongs to that.
            let (Some(a), Some(b)) = (hit(i), hit(j)) else { return f64::NEG_INFINITY };
            let ridges = crossings.iter().filter(|c| c.moves == [a.by, b.by] || c.moves == [b.by, a.by]);
            let ridge = ridges.map(|c| c.height).fold(f64::NEG_INFINITY, f64::max);
            let highest = a.deviation.max(b.deviation).max(ridge);
            if a.by == b.by || ridge.is_finite() {
                return highest + 0.5 * rise(samples, i, j).max(0.0);
            }
            let half = 0.5 * (samples[j].place.point - samples[i].place.point).norm();
            (highest + samples[i].slope().max(samples[j].slope()) * half).min(self.limits.uncut.max(highest))
        };
        (0..3).filter(|&k| on_border[k]).map(of_side).fold(f64::NEG_INFINITY, f64::max)
    }

    /// How deep a move may cut near the corners of a triangle that it cut, by how steep it is there: no place is farther than
    /// `far` from a corner, mm.
    fn depth_around(&self, samples: &[Sample; 3], by: u32, far: f64) -> f64 {
        let of_corner = |sample: &Sample| {
            let slope = sample.slope();
            // A cut of radius r that meets the design at the slope s goes no deeper than about s²r below that.
            let deeper = (slope * far).min(slope * slope * self.radius);
            sample.hit.filter(|hit| hit.by == by).map(|hit| deeper - hit.deviation)
        };
        samples.iter().filter_map(of_corner).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Divides triangles, the most promising ones first. Returns by how much the figures may still be exceeded, mm.
    pub fn search<'b>(
        &self,
        triangles: impl Iterator<Item = ([Sample; 3], [bool; 3], &'b [Crossing])>,
        greatest: &mut Greatest,
        asked: f64,
        monitor: &dyn Monitor,
    ) -> Result<Possible, Cancelled> {
        const BATCH: usize = 64;
        monitor.start("looking closer", 0);
        let (mut heap, mut divided, mut closed) = (BinaryHeap::new(), 0, Possible::NOTHING);
        let mut settled = Possible::NOTHING;
        // What promises little is not kept, but counts.
        let mut keep = |samples: [Sample; 3],
                        on_border: [bool; 3],
                        crossings: &[Crossing],
                        depth: u32,
                        greatest: &Greatest| {
            let possible = self.possible(&samples, on_border, crossings, greatest);
            let promise = possible.beyond(greatest, self.limits).greatest();
            if !possible.is_open(greatest, self.limits, asked) || depth == MOST_DEPTH {
                closed = closed.or(possible);
                return None;
            }
            Some(Open { promise, possible, samples, on_border, depth })
        };
        let mut first: Vec<Open> = Vec::new();
        let mut dropped = Possible::NOTHING;
        // No more than so many will be divided; of the others what is possible counts.
        let mut least_promising = |first: &mut Vec<Open>| {
            if first.len() > self.most_divided {
                first.select_nth_unstable_by(self.most_divided, |a, b| b.cmp(a));
                dropped = first.drain(self.most_divided..).fold(dropped, |all, open| all.or(open.possible));
            }
        };
        for (samples, on_border, crossings) in triangles {
            first.extend(keep(samples, on_border, crossings, 0, greatest));
            if first.len() > 2 * self.most_divided {
                least_promising(&mut first);
            }
        }
        least_promising(&mut first);
        heap.extend(first);
        while divided < self.most_divided && !heap.is_empty() {
            monitor::check(monitor)?;
            // More was found since some of them were put there.
            let next = || loop {
                let open: Open = heap.pop()?;
                if open.possible.is_open(greatest, self.limits, asked) {
                    return Some(open);
                }
                settled = settled.or(open.possible);
            };
            let batch: Vec<Open> = std::iter::from_fn(next).take(BATCH).collect();
            divided += batch.len();
            let closer = work::parallel::map(batch.len(), |k| self.divided(&batch[k].samples));
            for (open, parts) in batch.iter().zip(closer) {
                let [ab, bc, ca] = open.on_border;
                let borders = [[ab, false, ca], [ab, bc, false], [false, bc, ca], [false; 3]];
                for ((samples, Closer { middles, crossings }), on_border) in parts.into_iter().zip(borders) {
                    crossings.iter().for_each(|crossing| greatest.look_at_ridge(crossing));
                    for sample in &middles {
                        greatest.look_at(sample, self.limits);
                        greatest.look_at_height(sample, self);
                    }
                    heap.extend(keep(samples, on_border, &crossings, open.depth + 1, greatest));
                }
            }
        }
        let possible =
            heap.iter().fold(closed.or(dropped).or(settled), |possible, open| possible.or(open.possible));
        Ok(possible.beyond(greatest, self.limits))
    }

    /// The four triangles of one, and what they hold.
    fn divided(&self, [a, b, c]: &[Sample; 3]) -> Vec<([Sample; 3], Closer)> {
        let middle = |p: &Sample, q: &Sample| {
            self.sample(p.place.towards(&q.place, 0.5, self.part), p.hit.or(q.hit).as_ref())
        };
        let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
        let parts = [[*a, ab, ca], [ab, *b, bc], [ca, bc, *c], [ab, bc, ca]];
        parts
            .map(|samples| (samples, Closer { middles: [ab, bc, ca], crossings: self.crossings(&samples) }))
            .into()
    }
}
