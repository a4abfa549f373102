//! Which stretches of a raw offset are kept, and how they follow each other.

use super::walls::Walls;
use super::{CurveOffsetError, Offset};
use geometry::CubicSpline;
use nalgebra::Matrix2;

/// A place is nearer to the curve than the distance from this share of 1 mm plus the distance on. Less is
/// rounding, more moves ends that Newton's steps do not refine.
const CLEAR: f64 = 1.0e-9;
/// Halvings that find where a kept stretch ends.
const HALVINGS: usize = 50;
/// Newton's steps to a corner at most.
const MAX_STEPS: usize = 20;
/// Points are the same within this share of 1 mm plus their coordinates.
const SAME: f64 = 1.0e-13;
/// Halvings that find the greatest distance of which something is left.
const FITTING: usize = 24;
/// Places, about, at which it is tried.
const FITTED_AT: usize = 300;

/// A kept stretch.
#[derive(Clone, Copy, Debug)]
pub struct Interval {
    /// Parameters of the curve, from and to.
    pub range: [f64; 2],
    /// Whether more of the offset was cut off before its start and beyond its end.
    cut: [bool; 2],
    /// The whole of a closed curve.
    whole: bool,
}

/// Stretches that follow each other.
pub struct Chain {
    pub ranges: Vec<[f64; 2]>,
    pub closed: bool,
    /// A closed curve of which nothing was cut off.
    pub whole: bool,
}

impl Chain {
    /// The same with ranges that end at further parameters of the curve, in `[start, end]`, as well.
    pub fn broken_at(mut self, breaks: &[f64], [start, end]: [f64; 2]) -> Self {
        let mut breaks = breaks.to_vec();
        breaks.sort_by(f64::total_cmp);
        let (Some(&first), true) = (breaks.first(), !self.ranges.is_empty()) else { return self };
        if self.whole {
            self.whole = false;
            self.ranges = vec![[first, first + (end - start)]];
        }
        // Ranges may run on beyond the end of a period.
        let again: Vec<f64> = breaks.iter().map(|t| t + (end - start)).collect();
        breaks.extend(again);
        let parts = |[from, to]: [f64; 2]| {
            let inside = breaks.iter().copied().filter(move |t| *t > from && *t < to);
            let ends: Vec<f64> = std::iter::once(from).chain(inside).chain([to]).collect();
            ends.windows(2).map(|w| [w[0], w[1]]).collect::<Vec<_>>()
        };
        self.ranges = self.ranges.iter().copied().flat_map(parts).collect();
        self
    }
}

fn is_clear(offset: &Offset, walls: &Walls, t: f64) -> bool {
    let reach = offset.distance.abs();
    walls.is_clear(&offset.point(t), reach - CLEAR * (1.0 + reach))
}

/// The stretches of the raw offset that are nowhere nearer to the curve than the distance.
pub fn kept(offset: &Offset, walls: &Walls, places: &[f64], tolerance: f64) -> Vec<Interval> {
    // Middles too: a passage may be narrow between two places.
    let mut all: Vec<f64> = places.windows(2).flat_map(|w| [w[0], 0.5 * (w[0] + w[1])]).collect();
    let [lo, hi] = offset.curve.domain();
    let closed = offset.curve.is_closed();
    if !closed {
        all.push(hi);
    }
    let mut clear = work::parallel::map(all.len(), |k| is_clear(offset, walls, all[k]));
    if clear.iter().all(|c| *c) {
        return vec![Interval { range: [lo, hi], cut: [false; 2], whole: closed }];
    }
    if closed {
        // From a place that is cut off around to it again.
        let first = clear.iter().position(|c| !c).unwrap_or(0);
        all[..first].iter_mut().for_each(|t| *t += hi - lo);
        all.rotate_left(first);
        clear.rotate_left(first);
        all.push(all[0] + (hi - lo));
        clear.push(false);
    }
    let mut found = Vec::new();
    let mut start = clear[0].then_some((lo, false));
    for k in 1..all.len() {
        if clear[k] && !clear[k - 1] {
            start = Some((end_of(offset, walls, [all[k], all[k - 1]]), true));
        } else if !clear[k] && clear[k - 1] {
            let to = end_of(offset, walls, [all[k - 1], all[k]]);
            if let Some((from, cut)) = start.take() {
                found.push(Interval { range: [from, to], cut: [cut, true], whole: false });
            }
        }
    }
    if let Some((from, cut)) = start {
        found.push(Interval { range: [from, hi], cut: [cut, false], whole: false });
    }
    found.retain(|i| longer_than(offset, i.range, tolerance));
    found
}

fn longer_than(offset: &Offset, [from, to]: [f64; 2], tolerance: f64) -> bool {
    let start = offset.point(from);
    (1..=8).any(|k| (offset.point(from + (to - from) * f64::from(k) / 8.0) - start).norm() > tolerance)
}

/// Where a kept stretch ends between a place that is kept and one that is not.
fn end_of(offset: &Offset, walls: &Walls, bracket: [f64; 2]) -> f64 {
    let [mut inside, mut outside] = bracket;
    for _ in 0..HALVINGS {
        let middle = 0.5 * (inside + outside);
        if is_clear(offset, walls, middle) {
            inside = middle;
        } else {
            outside = middle;
        }
    }
    inside
}

/// Where, near the parameters `a` and `b`, the offset comes twice to one point, by Newton's steps that go no
/// farther than `reach`, mm.
fn corner(offset: &Offset, [mut a, mut b]: [f64; 2], reach: f64) -> Option<[f64; 2]> {
    let [lo, hi] = offset.curve.domain();
    let inside = |t: f64| offset.curve.is_closed() || (lo..=hi).contains(&t);
    let start = offset.point(a);
    for _ in 0..MAX_STEPS {
        let ((p, da), (q, db)) = (offset.jet(a), offset.jet(b));
        let apart = q - p;
        if (p - start).norm() > reach || (q - start).norm() > reach {
            return None;
        }
        if apart.norm() <= SAME * (1.0 + p.coords.norm()) {
            return Some([a, b]);
        }
        let step = Matrix2::from_columns(&[da, -db]).try_inverse()? * apart;
        (a, b) = (a + step.x, b + step.y);
        if !(inside(a) && inside(b)) {
            return None;
        }
    }
    None
}

/// Kept stretches joined where one ends at the point at which another begins.
pub fn chains(offset: &Offset, mut intervals: Vec<Interval>, tolerance: f64) -> Vec<Chain> {
    let n = intervals.len();
    let ends: Vec<_> = intervals.iter().map(|i| offset.point(i.range[1])).collect();
    let starts: Vec<_> = intervals.iter().map(|i| offset.point(i.range[0])).collect();
    let mut next = vec![None; n];
    let mut entered = vec![false; n];
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    for i in (0..n).filter(|&i| intervals[i].cut[1]) {
        for j in (0..n).filter(|&j| intervals[j].cut[0]) {
            let apart = (ends[i] - starts[j]).norm();
            if apart <= tolerance {
                pairs.push((apart, i, j));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (_, i, j) in pairs {
        if next[i].is_none() && !entered[j] {
            (next[i], entered[j]) = (Some(j), true);
            let met = [intervals[i].range[1], intervals[j].range[0]];
            // Where steps fail, at corners that are nearly none, the bisected places stay.
            if let Some([end, start]) = corner(offset, met, 2.0 * tolerance) {
                intervals[i].range[1] = end;
                intervals[j].range[0] = start;
            }
        }
    }
    let mut used = vec![false; n];
    let mut found = Vec::new();
    // Open ones begin where nothing leads to; the rest are rings.
    for first in (0..n).filter(|&k| !entered[k]).chain((0..n).filter(|&k| entered[k])) {
        let mut chain = Chain { ranges: Vec::new(), closed: false, whole: intervals[first].whole };
        let mut at = Some(first);
        while let Some(k) = at.filter(|&k| !used[k]) {
            used[k] = true;
            chain.ranges.push(intervals[k].range);
            at = next[k];
        }
        chain.closed = chain.whole || at == Some(first);
        if !chain.ranges.is_empty() {
            found.push(chain);
        }
    }
    found.sort_by(|a, b| a.ranges[0][0].total_cmp(&b.ranges[0][0]));
    found
}

/// The error that tells how little would leave something.
pub fn eaten(offset: &Offset, walls: &Walls, places: &[f64]) -> CurveOffsetError {
    let left = |distance: f64| {
        let tried = Offset { curve: offset.curve, distance };
        places.iter().step_by(places.len().div_ceil(FITTED_AT)).copied().find(|&t| is_clear(&tried, walls, t))
    };
    let (mut fits, mut at) = (0.0, places[0]);
    // More than half its length is beyond every curve's inside.
    let length = CubicSpline::chord_lengths(offset.curve.points(), true).last().copied().unwrap_or(0.0);
    let mut too_much = offset.distance.clamp(-length, length);
    for _ in 0..FITTING {
        let middle = 0.5 * (fits + too_much);
        match left(middle) {
            Some(t) => (fits, at) = (middle, t),
            None => too_much = middle,
        }
    }
    CurveOffsetError::Eaten { distance: offset.distance, fits: fits.abs(), at: offset.curve.point(at) }
}
