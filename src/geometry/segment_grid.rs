//! Segments of the plane in square buckets, for the nearest one and for those near a box; mm.
//!
//! Enters: closed curves as polylines. Leaves: distances in f64, exact but for rounding.

use super::Point2;

/// Segments a bucket aimed at on average. More make a query scan longer lists, fewer more empty buckets.
const SEGMENTS_A_BUCKET: f64 = 1.0;

/// No more buckets than this along a side: thin, long sets of segments would else take memory without end.
const MAX_SIDE: f64 = 2048.0;

/// A segment of a closed curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CurveSegment {
    /// Both ends.
    pub ends: [Point2; 2],
    /// The curve, counted from 0.
    pub curve: u32,
    /// Where it begins in that curve.
    pub index: u32,
}

/// The nearest point of a set of segments.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearestSegment {
    /// How far it is, mm.
    pub distance: f64,
    /// The segment, an index into [`SegmentGrid::segments`].
    pub segment: u32,
    /// Where on it, 0 to 1.
    pub share: f64,
}

/// Segments in buckets.
#[derive(Debug, Clone)]
pub struct SegmentGrid {
    segments: Vec<CurveSegment>,
    origin: Point2,
    cell: f64,
    nx: usize,
    ny: usize,
    first: Vec<u32>,
    items: Vec<u32>,
}

impl SegmentGrid {
    /// The sides of closed curves (the last point is joined to the first).
    pub fn of_curves<'a>(curves: impl IntoIterator<Item = &'a [Point2]>) -> Self {
        let mut segments = Vec::new();
        for (curve, points) in curves.into_iter().enumerate() {
            for (index, &a) in points.iter().enumerate() {
                let b = points[(index + 1) % points.len()];
                segments.push(CurveSegment { ends: [a, b], curve: curve as u32, index: index as u32 });
            }
        }
        Self::new(segments)
    }

    /// Any segments.
    pub fn new(segments: Vec<CurveSegment>) -> Self {
        let (mut lo, mut hi) = (Point2::new(0.0, 0.0), Point2::new(0.0, 0.0));
        if let Some(s) = segments.first() {
            (lo, hi) = (s.ends[0], s.ends[0]);
        }
        for p in segments.iter().flat_map(|s| s.ends) {
            (lo, hi) = (lo.inf(&p), hi.sup(&p));
        }
        let size = hi - lo;
        let area = (size.x * size.y).max(1e-12 * size.norm_squared());
        let cell = (area * SEGMENTS_A_BUCKET / segments.len().max(1) as f64).sqrt();
        let cell = cell.max(size.x.max(size.y) / MAX_SIDE).max(f64::MIN_POSITIVE);
        let side = |length: f64| ((length / cell).floor() as usize + 1).min(MAX_SIDE as usize + 1);
        let (nx, ny) = (side(size.x), side(size.y));
        let mut grid = Self { segments, origin: lo, cell, nx, ny, first: Vec::new(), items: Vec::new() };
        let mut count = vec![0u32; nx * ny + 1];
        for s in &grid.segments {
            grid.each_bucket(&s.ends, |k| count[k + 1] += 1);
        }
        for k in 0..nx * ny {
            count[k + 1] += count[k];
        }
        let mut items = vec![0u32; count[nx * ny] as usize];
        let mut next = count.clone();
        for (index, s) in grid.segments.iter().enumerate() {
            grid.each_bucket(&s.ends, |k| {
                items[next[k] as usize] = index as u32;
                next[k] += 1;
            });
        }
        (grid.first, grid.items) = (count, items);
        grid
    }

    /// The segments, curve by curve.
    pub fn segments(&self) -> &[CurveSegment] {
        &self.segments
    }

    fn bucket(&self, p: &Point2) -> [usize; 2] {
        let along = |x: f64, n: usize| ((x / self.cell).floor().max(0.0) as usize).min(n - 1);
        [along(p.x - self.origin.x, self.nx), along(p.y - self.origin.y, self.ny)]
    }

    /// Buckets that the box of a segment meets, but for those that the segment passes by.
    fn each_bucket(&self, ends: &[Point2; 2], mut f: impl FnMut(usize)) {
        let (a, b) = (self.bucket(&ends[0].inf(&ends[1])), self.bucket(&ends[0].sup(&ends[1])));
        let d = ends[1] - ends[0];
        // Half the diagonal and a hair: a bucket farther than that from the line does not meet it.
        let reach = 0.7072 * self.cell * d.norm() * (1.0 + 1e-9);
        for j in a[1]..=b[1] {
            for i in a[0]..=b[0] {
                let centre = self.origin
                    + super::Vector2::new((i as f64 + 0.5) * self.cell, (j as f64 + 0.5) * self.cell);
                if a == b || d.perp(&(centre - ends[0])).abs() <= reach {
                    f(j * self.nx + i);
                }
            }
        }
    }

    fn in_bucket(&self, i: usize, j: usize) -> &[u32] {
        let k = j * self.nx + i;
        &self.items[self.first[k] as usize..self.first[k + 1] as usize]
    }

    /// The middles of the buckets, in the order of their indices: `None` where segments meet one.
    pub(crate) fn empty_buckets(&self) -> impl Iterator<Item = Option<Point2>> + '_ {
        (0..self.nx * self.ny).map(|k| {
            let at = |k: usize| (k as f64 + 0.5) * self.cell;
            let middle = self.origin + super::Vector2::new(at(k % self.nx), at(k / self.nx));
            (self.first[k] == self.first[k + 1]).then_some(middle)
        })
    }

    /// The bucket of a place, by its index: the nearest one where it lies outside all.
    pub(crate) fn bucket_at(&self, p: &Point2) -> usize {
        let [i, j] = self.bucket(p);
        j * self.nx + i
    }

    /// The nearest segment to `p`; `None` without segments.
    pub fn nearest(&self, p: &Point2) -> Option<NearestSegment> {
        let [ci, cj] = self.bucket(p);
        let mut best: Option<NearestSegment> = None;
        let mut look = |i: usize, j: usize| {
            for &index in self.in_bucket(i, j) {
                let (share, distance) = foot(p, &self.segments[index as usize].ends);
                // Of equals the first, whatever the order of buckets.
                let better = best
                    .is_none_or(|b| distance < b.distance || (distance == b.distance && index < b.segment));
                if better {
                    best = Some(NearestSegment { distance, segment: index, share });
                }
            }
            best.map_or(f64::INFINITY, |b| b.distance)
        };
        let mut found = f64::INFINITY;
        for ring in 0..self.nx.max(self.ny) {
            // What lies beyond the rings that were looked at is at least that far away.
            if ring > 0 && found < (ring - 1) as f64 * self.cell {
                break;
            }
            let (i0, i1) = (ci.saturating_sub(ring), (ci + ring).min(self.nx - 1));
            let (j0, j1) = (cj.saturating_sub(ring), (cj + ring).min(self.ny - 1));
            for j in j0..=j1 {
                let edge = j + ring == cj || j == cj + ring;
                let mut i = i0;
                while i <= i1 {
                    if edge || i + ring == ci || i == ci + ring {
                        found = look(i, j);
                        i += 1;
                    } else {
                        // Over the inside of the ring to its far column.
                        i = (ci + ring).min(i1 + 1).max(i + 1);
                    }
                }
            }
        }
        best
    }

    /// Distance of `p` from the nearest segment, mm; infinite without segments.
    pub fn distance(&self, p: &Point2) -> f64 {
        self.nearest(p).map_or(f64::INFINITY, |n| n.distance)
    }

    /// Calls `f` with the index of every segment in the buckets that the box of `ends` meets (some
    /// several times).
    pub fn near(&self, ends: &[Point2; 2], mut f: impl FnMut(u32)) {
        if self.segments.is_empty() {
            return;
        }
        let (a, b) = (self.bucket(&ends[0].inf(&ends[1])), self.bucket(&ends[0].sup(&ends[1])));
        for j in a[1]..=b[1] {
            for i in a[0]..=b[0] {
                self.in_bucket(i, j).iter().for_each(|&k| f(k));
            }
        }
    }
}

/// Where on the segment `a`–`b` the place nearest to `p` is, 0 to 1; 0 where it has no length.
pub fn share_on<const D: usize>(
    p: &nalgebra::Point<f64, D>,
    a: &nalgebra::Point<f64, D>,
    b: &nalgebra::Point<f64, D>,
) -> f64 {
    let d = b - a;
    let length2 = d.norm_squared();
    if length2 > 0.0 { ((p - a).dot(&d) / length2).clamp(0.0, 1.0) } else { 0.0 }
}

/// Distance from `p` to the segment `a`–`b`, mm.
pub fn distance_to_segment<const D: usize>(
    p: &nalgebra::Point<f64, D>,
    a: &nalgebra::Point<f64, D>,
    b: &nalgebra::Point<f64, D>,
) -> f64 {
    (p - (a + (b - a) * share_on(p, a, b))).norm()
}

/// Where on a segment the foot of `p` is (0 to 1), and how far away.
pub fn foot<const D: usize>(
    p: &nalgebra::Point<f64, D>,
    [a, b]: &[nalgebra::Point<f64, D>; 2],
) -> (f64, f64) {
    let share = share_on(p, a, b);
    (share, (p - (a + (b - a) * share)).norm())
}

/// Distance of two segments; 0 where they cross.
pub fn distance_of_segments(a: &[Point2; 2], b: &[Point2; 2]) -> f64 {
    let side = |s: &[Point2; 2], p: &Point2| (s[1] - s[0]).perp(&(p - s[0]));
    let across = |s: &[Point2; 2], t: &[Point2; 2]| side(s, &t[0]) * side(s, &t[1]) < 0.0;
    if across(a, b) && across(b, a) {
        return 0.0;
    }
    let feet = [foot(&a[0], b), foot(&a[1], b), foot(&b[0], a), foot(&b[1], a)];
    feet.iter().map(|f| f.1).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn segments_cross_touch_and_pass_by() {
        let at = Point2::new;
        let level = [at(0.0, 0.0), at(4.0, 0.0)];
        assert_eq!(distance_of_segments(&level, &[at(1.0, -1.0), at(1.0, 1.0)]), 0.0);
        assert_eq!(distance_of_segments(&level, &[at(4.0, 0.0), at(5.0, 1.0)]), 0.0);
        assert_eq!(distance_of_segments(&level, &[at(7.0, 4.0), at(9.0, 9.0)]), 5.0);
    }

    proptest! {
        /// Against a look at every segment, also from far outside.
        #[test]
        fn the_nearest_is_that_of_all(
            points in prop::collection::vec((-50.0..50.0f64, -20.0..20.0f64), 1..60),
            at in prop::collection::vec((-90.0..90.0f64, -90.0..90.0f64), 20),
        ) {
            let curve: Vec<Point2> = points.iter().map(|&(x, y)| Point2::new(x, y)).collect();
            let grid = SegmentGrid::of_curves([curve.as_slice()]);
            for (x, y) in at {
                let p = Point2::new(x, y);
                let all = grid.segments().iter().map(|s| foot(&p, &s.ends).1).fold(f64::INFINITY, f64::min);
                prop_assert_eq!(grid.distance(&p), all);
            }
        }
    }
}
