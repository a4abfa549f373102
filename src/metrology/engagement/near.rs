//! The segments that decide about every place of moves beside each other.
//!
//! Enters: moves one after the other on one level, and all that was swept before them. Leaves: a short list,
//! the last segments first, from which every place of these moves has the angle that all segments give it.
//!
//! The circumference is divided into sectors. Where one segment covers a sector from all places of the
//! moves, nothing stands there, and of the other segments those alone matter that come near to a sector that
//! is left; mm, rad.

use std::f64::consts::{PI, TAU};
use std::ops::Range;
use std::sync::LazyLock;

use geometry::{Point2, Vector2};
use sim::ENGAGED;

use super::{Front, Segment, Stretch, Swept, TOUCHING, square_distance};

/// Moves whose places are no farther than this from one, over the radius, share a list. Farther ones have
/// fewer sectors covered whole, nearer ones make more lists.
const TOGETHER: f64 = 0.2;

/// Segments of a bundle: one after the other they are near to each other.
const BUNDLE: usize = 16;

/// Sectors of the circumference.
const SECTORS: usize = 32;

/// Moves that share a list.
pub(super) struct Row {
    /// Those that feed sideways, rising.
    pub moves: Vec<usize>,
    z: f64,
    lo: Point2,
    hi: Point2,
}

impl Row {
    fn middle(&self) -> Point2 {
        self.lo + 0.5 * (self.hi - self.lo)
    }

    /// No place of it is farther from its middle, mm.
    fn reach(&self) -> f64 {
        0.5 * (self.hi - self.lo).norm()
    }
}

/// Segments one after the other, the last first, that are passed over together.
#[derive(Clone)]
pub(super) struct Bundle {
    /// A disc that they lie in, mm, where it is worth asking.
    pub around: Option<(Point2, f64)>,
    pub segments: Vec<u32>,
}

impl Bundle {
    /// Whether any of them may be nearer than `radius` to what stands.
    pub(super) fn may_clear(&self, front: &Front, stretch: &Stretch, radius: f64) -> bool {
        self.around.is_none_or(|(middle, reach)| front.may_clear(&[stretch.seen(&middle); 2], radius + reach))
    }

    /// Whether a segment may be one of them.
    pub(super) fn may_hold(&self, k: u32) -> bool {
        self.segments.last().is_some_and(|last| *last <= k)
    }
}

impl Swept<'_> {
    /// The moves that `feed` sideways in rows that share a list.
    pub(super) fn rows(&self, moves: Range<usize>, feed: impl Fn(usize) -> bool) -> Vec<Row> {
        let mut rows: Vec<Row> = Vec::new();
        for k in moves.filter(|k| feed(*k)) {
            let Segment { ends: [a, b], z, .. } = self.segments[k];
            let alone = Row { moves: vec![k], z, lo: a.inf(&b), hi: a.sup(&b) };
            match rows.last_mut() {
                Some(row) if row.z == z => {
                    let (lo, hi) = (row.lo.inf(&alone.lo), row.hi.sup(&alone.hi));
                    if 0.5 * (hi - lo).norm() <= TOGETHER * self.radius {
                        row.moves.push(k);
                        (row.lo, row.hi) = (lo, hi);
                    } else {
                        rows.push(alone);
                    }
                }
                _ => rows.push(alone),
            }
        }
        rows
    }

    /// The segments up to the last move of a row that a place of it can meet, the last first: the ground next
    /// to a place was mostly cleared last, and what it leaves standing is soon so little that most others are
    /// passed over.
    pub(super) fn near_row(&self, row: &Row) -> Vec<u32> {
        let (middle, reach) = (row.middle(), (2.0 + self.film) * self.radius + row.reach());
        let last = row.moves.last().copied().unwrap_or_default();
        let mut near = Vec::new();
        self.each_near(&middle, reach, 0, |other| {
            let segment = &self.segments[other];
            if other <= last && segment.z <= row.z + ENGAGED && segment.is_within(&middle, reach) {
                near.push(other as u32);
            }
            other <= last
        });
        near.sort_unstable_by(|a, b| b.cmp(a));
        near.dedup();
        near
    }

    /// Those of [`Swept::near_row`] that decide about every place of the row, in bundles.
    pub(super) fn deciding_for(&self, row: &Row) -> Vec<Bundle> {
        let near = self.without_covered(row, self.near_row(row));
        near.chunks(BUNDLE).map(|segments| self.bundle(segments)).collect()
    }

    fn bundle(&self, segments: &[u32]) -> Bundle {
        let ends = || segments.iter().flat_map(|k| self.segments[*k as usize].ends);
        let first = self.segments[segments[0] as usize].ends[0];
        let (lo, hi) = ends().fold((first, first), |(lo, hi), p| (lo.inf(&p), hi.sup(&p)));
        let middle = lo + 0.5 * (hi - lo);
        let reach = ends().map(|p| (p - middle).norm()).fold(0.0, f64::max);
        Bundle { around: Some((middle, reach)), segments: segments.to_vec() }
    }

    /// Segments near to a row without those that come near only to sectors that others cover.
    fn without_covered(&self, row: &Row, mut near: Vec<u32>) -> Vec<u32> {
        let (middle, off) = (row.middle(), row.reach() + self.radius * PI / SECTORS as f64);
        let whole = (1.0 - TOUCHING) * self.radius - off;
        if whole <= 0.0 {
            return near;
        }
        let (whole, touched) = (whole * whole, ((1.0 + self.film) * self.radius + off).powi(2));
        let seen = |k: u32| self.segments[k as usize].ends.map(|p| p - middle);
        let mut open: Vec<Vector2> = DIRECTIONS.iter().map(|out| out * self.radius).collect();
        // What no move of the row finds fresh counts whole, and is as wide as its films say at least.
        let before = self.segments[row.moves[0]].gone[0] - self.fresh;
        let settled = near.iter().copied().filter(|k| self.segments[*k as usize].gone[1] < before);
        let covers = |k: &u32| {
            let (ends, left) = (seen(*k), open.len());
            open.retain(|sector| square_distance(sector, &ends) >= whole);
            open.len() < left
        };
        let covering: Vec<u32> = settled.filter(covers).collect();
        let mut covering = covering.into_iter().peekable();
        near.retain(|k| {
            let ends = seen(*k);
            covering.next_if_eq(k).is_some()
                || open.iter().any(|sector| square_distance(sector, &ends) < touched)
        });
        near
    }
}

impl Segment {
    fn is_within(&self, place: &Point2, reach: f64) -> bool {
        square_distance(&Vector2::zeros(), &self.ends.map(|p| p - place)) <= reach * reach
    }
}

/// The middles of the sectors.
static DIRECTIONS: LazyLock<[Vector2; SECTORS]> = LazyLock::new(|| {
    std::array::from_fn(|k| {
        let (sin, cos) = (TAU * k as f64 / SECTORS as f64).sin_cos();
        Vector2::new(cos, sin)
    })
});
