//! Places where an offset is singular: concave toward its side with a radius of no more than the distance.

use super::OffsetSurface;
use super::crease::creases;
use geometry::{Jet2, KnotVector, Point3, inward};
use work::parallel;

/// Places in each span of knots along a parameter, its two ends among them. Fewer miss narrow places; more
/// cost time with their square.
const LOOKS_A_SPAN: usize = 9;
/// With many spans fewer will do; this many places in all are enough.
const MAX_LOOKS: usize = 4_000_000;
/// Places of a single span at least, since a Bézier patch may wave within.
const LOOKS_ALONE: usize = 33;
/// Near a pole curvature is looked at this share of the way across. Less drowns in rounding.
const FROM_POLE: f64 = 1.0e-3;
/// A place is near a pole where derivatives, as shares of the patch, or the sine between them are less than
/// this.
const NEAR_POLE: f64 = 1.0e-4;
/// Halvings of the step of a search for the greatest curvature: from a cell down to a 1e-9th.
const HALVINGS: usize = 30;
/// Curvatures that differ by less than this share are one: nothing higher lies between.
const LEVEL: f64 = 1.0e-9;
/// Angle times distance below which a crease is not one, mm.
const LEAST_TEAR: f64 = 1.0e-9;

/// A connected region in which an offset is singular, by its worst place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SingularPlace {
    /// Parameters `(u, v)` of the worst place.
    pub at: [f64; 2],
    /// The point of the patch there, mm.
    pub point: Point3,
    /// Its greatest curvature toward the side of the offset, 1/mm, positive (whatever the sign of the
    /// distance); infinite on a crease.
    pub curvature: f64,
    /// Its inverse, mm: the greatest offset that is not singular here; 0 on a crease.
    pub radius: f64,
}

/// A grid of places, span by span.
struct Looks<'a> {
    /// Parameters along u and v.
    at: [Vec<f64>; 2],
    /// The span of each.
    spans: [Vec<[f64; 2]>; 2],
    /// How many of them a span has.
    a_span: [usize; 2],
    /// Whether the first and the last line are the same in space, along u and v.
    closed: [bool; 2],
    /// Concavity times distance at each place, `[u][v]`.
    depth: Vec<f64>,
    /// What tells depths between.
    gauge: Gauge<'a>,
}

/// Curvature of a patch toward the side of its offset.
#[derive(Clone, Copy)]
struct Gauge<'a> {
    offset: &'a OffsetSurface<'a>,
    /// Derivatives by the parameters that are shorter are those of a pole.
    shortest: [f64; 2],
}

impl<'a> Gauge<'a> {
    fn new(offset: &'a OffsetSurface<'a>) -> Self {
        let least = NEAR_POLE * offset.surface.control_bounds().diagonal();
        Self { offset, shortest: offset.surface.domain().map(|[lo, hi]| least / (hi - lo)) }
    }

    /// Curvature toward the side of the offset times the distance: singular from 1 on.
    fn depth(&self, [u, v]: [f64; 2]) -> f64 {
        let OffsetSurface { surface, distance } = *self.offset;
        let mut jet = surface.jet(u, v);
        if self.is_near_pole(&jet) {
            let [a, b] = inward(surface, [u, v]);
            jet = surface.jet(u + FROM_POLE * a, v + FROM_POLE * b);
        }
        let curvatures = jet.principal_curvatures();
        curvatures.map_or(f64::NEG_INFINITY, |k| (k.min * distance).max(k.max * distance))
    }

    fn is_near_pole(&self, jet: &Jet2) -> bool {
        let [du, dv] = [jet.du.norm(), jet.dv.norm()];
        du < self.shortest[0] || dv < self.shortest[1] || jet.du.cross(&jet.dv).norm() < NEAR_POLE * du * dv
    }
}

impl OffsetSurface<'_> {
    /// The regions where `1 − κ d ≤ 0` for one of the principal curvatures, each once, by its place of
    /// greatest curvature; the worst first. Concave creases are such regions too.
    ///
    /// # Tolerance
    /// Curvature is looked at 9 times or more in each span of knots along each parameter (less where there
    /// are more than some 400 spans along both), and its greatest values are searched from there: a region is
    /// missed only where a peak of the curvature is narrower than that. Parameters to about 1e-8 of a span.
    pub fn singular_places(&self) -> Vec<SingularPlace> {
        let mut found = self.concave_creases();
        if self.distance != 0.0 {
            let looks = self.look();
            found.extend(looks.regions().into_iter().map(|(at, depth)| self.place(at, depth)));
        }
        found.sort_by(|a, b| b.curvature.total_cmp(&a.curvature));
        found
    }

    fn place(&self, at: [f64; 2], depth: f64) -> SingularPlace {
        let curvature = depth / self.distance.abs();
        SingularPlace { at, point: self.surface.point(at[0], at[1]), curvature, radius: curvature.recip() }
    }

    fn concave_creases(&self) -> Vec<SingularPlace> {
        let along = |axis: usize| {
            creases(self, axis, LEAST_TEAR).into_iter().filter_map(move |c| {
                c.most_concave.map(|other| if axis == 0 { [c.at, other] } else { [other, c.at] })
            })
        };
        along(0).chain(along(1)).map(|at| self.place(at, f64::INFINITY)).collect()
    }

    fn look(&self) -> Looks<'_> {
        let knots = [self.surface.knots_u(), self.surface.knots_v()];
        let spans = knots.map(|k| k.breaks().len() - 1);
        let most = (MAX_LOOKS as f64 / (spans[0] * spans[1]) as f64).sqrt() as usize;
        let a_span = spans.map(|n| LOOKS_A_SPAN.max(LOOKS_ALONE / n).min(most).max(3));
        let [us, vs] = [0, 1].map(|k| places(knots[k], a_span[k]));
        let gauge = Gauge::new(self);
        let depth =
            parallel::map(us.len(), |i| vs.iter().map(|v| gauge.depth([us[i].0, v.0])).collect::<Vec<f64>>());
        let closed = [0, 1].map(|k| self.meets_itself(k));
        let apart = |p: Vec<(f64, [f64; 2])>| p.into_iter().unzip();
        let ((u, u_spans), (v, v_spans)) = (apart(us), apart(vs));
        Looks { at: [u, v], spans: [u_spans, v_spans], a_span, closed, depth: depth.concat(), gauge }
    }

    /// Whether the two borders at the ends of a parameter are the same line in space.
    fn meets_itself(&self, k: usize) -> bool {
        let domain = self.surface.domain();
        let [lo, hi] = domain[1 - k];
        let size = self.surface.control_bounds().diagonal();
        (0..=LOOKS_A_SPAN).all(|i| {
            let other = lo + (hi - lo) * i as f64 / LOOKS_A_SPAN as f64;
            let [a, b] = domain[k].map(|end| {
                let [u, v] = if k == 0 { [end, other] } else { [other, end] };
                self.surface.point(u, v)
            });
            (a - b).norm() <= 1e-9 * size
        })
    }
}

/// Parameters looked at, with their spans.
fn places(knots: &KnotVector, a_span: usize) -> Vec<(f64, [f64; 2])> {
    let breaks = knots.breaks();
    let end = knots.domain()[1];
    let in_span = |w: &[f64]| {
        // Curvature jumps at knots: the end of a span is its own side of the next knot.
        let span = [w[0], if w[1] < end { w[1].next_down() } else { w[1] }];
        let step = (span[1] - span[0]) / (a_span - 1) as f64;
        (0..a_span).map(move |k| ((span[0] + step * k as f64).min(span[1]), span))
    };
    breaks.windows(2).flat_map(in_span).collect()
}

impl Looks<'_> {
    fn size(&self) -> [usize; 2] {
        [self.at[0].len(), self.at[1].len()]
    }

    fn place_of(&self, [i, j]: [usize; 2]) -> [f64; 2] {
        [self.at[0][i], self.at[1][j]]
    }

    /// How far the places of a span are apart.
    fn cell(&self, at: [usize; 2]) -> [f64; 2] {
        [0, 1].map(|k| {
            let [lo, hi] = self.spans[k][at[k]];
            (hi - lo) / (self.a_span[k] - 1) as f64
        })
    }

    fn index(&self, [i, j]: [usize; 2]) -> usize {
        i * self.at[1].len() + j
    }

    /// The (up to eight) places around one, over closed seams too.
    fn around(&self, [i, j]: [usize; 2]) -> impl Iterator<Item = [usize; 2]> + '_ {
        let [n, m] = self.size();
        let step = |k: usize, by: usize, n: usize, closed: bool| match (k + by).checked_sub(1) {
            Some(k) if k < n => Some(k),
            Some(_) => closed.then_some(0),
            None => closed.then_some(n - 1),
        };
        (0..9).filter(|k| *k != 4).filter_map(move |k| {
            Some([step(i, k / 3, n, self.closed[0])?, step(j, k % 3, m, self.closed[1])?])
        })
    }

    /// Peaks of at least 1, one for each connected region.
    fn regions(&self) -> Vec<([f64; 2], f64)> {
        let peaks = self.peaks();
        let mut region = vec![usize::MAX; self.depth.len()];
        let mut found: Vec<([f64; 2], f64)> = Vec::new();
        for (start, at, depth) in peaks {
            let seed = std::iter::once(start).chain(self.around(start));
            let marked = seed.into_iter().any(|k| region[self.index(k)] != usize::MAX);
            // Two spans may climb to the knot between them.
            let cell = self.cell(start);
            let met = |(place, _): &([f64; 2], f64)| (0..2).all(|c| (place[c] - at[c]).abs() <= cell[c]);
            if marked || found.iter().any(met) {
                continue;
            }
            self.flood(start, found.len(), &mut region);
            found.push((at, depth));
        }
        found
    }

    /// The greatest places around each local greatest one of the grid, deepest first.
    fn peaks(&self) -> Vec<([usize; 2], [f64; 2], f64)> {
        let [n, m] = self.size();
        // Each span by itself: a peak just inside one may be hidden by the knot's other side.
        let same_span =
            |a: [usize; 2], b: [usize; 2]| (0..2).all(|c| self.spans[c][a[c]] == self.spans[c][b[c]]);
        let range = |k: [usize; 2]| {
            let depths = self.around(k).filter(|o| same_span(k, *o)).map(|o| self.depth[self.index(o)]);
            depths.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], d| [lo.min(d), hi.max(d)])
        };
        // Peaks between places rise little above them: by half at most where nine are in a span.
        let highest = |k: [usize; 2]| self.depth[self.index(k)] >= range(k)[1].max(0.5);
        let starts: Vec<[usize; 2]> = (0..n * m).map(|k| [k / m, k % m]).filter(|&k| highest(k)).collect();
        let mut peaks: Vec<([usize; 2], [f64; 2], f64)> = parallel::map(starts.len(), |s| {
            let (start, depth) = (starts[s], self.depth[self.index(starts[s])]);
            let level = depth - range(start)[0] <= LEVEL * depth;
            let (at, depth) = if level { (self.place_of(start), depth) } else { self.climb(start) };
            (start, at, depth)
        });
        peaks.retain(|p| p.2 >= 1.0);
        // Equal peaks keep the order of the grid.
        peaks.sort_by(|a, b| b.2.total_cmp(&a.2));
        peaks
    }

    /// From a place of the grid uphill within its span, by steps along eight directions that are halved where
    /// none goes up.
    fn climb(&self, start: [usize; 2]) -> ([f64; 2], f64) {
        let spans = [0, 1].map(|k| self.spans[k][start[k]]);
        let mut step = self.cell(start);
        let mut at = self.place_of(start);
        let mut depth = self.depth[self.index(start)];
        let mut halvings = 0;
        // Every rise but those of a halved step is of a cell's length: a long ridge ends at the span's end.
        for _ in 0..HALVINGS * 16 {
            let tried = (0..9).filter(|k| *k != 4).map(|k| {
                let way = [f64::from(k / 3) - 1.0, f64::from(k % 3) - 1.0];
                let to = [0, 1].map(|c| (at[c] + way[c] * step[c]).clamp(spans[c][0], spans[c][1]));
                (to, self.gauge.depth(to))
            });
            match tried.max_by(|a, b| a.1.total_cmp(&b.1)) {
                Some((to, higher)) if higher > depth => (at, depth) = (to, higher),
                _ => {
                    step = step.map(|s| 0.5 * s);
                    halvings += 1;
                }
            }
            if halvings == HALVINGS {
                break;
            }
        }
        (at, depth)
    }

    /// Marks what is connected with a place, itself included.
    fn flood(&self, start: [usize; 2], mark: usize, region: &mut [usize]) {
        let mut open = vec![start];
        region[self.index(start)] = mark;
        while let Some(place) = open.pop() {
            for next in self.around(place) {
                let k = self.index(next);
                if region[k] == usize::MAX && self.depth[k] >= 1.0 {
                    region[k] = mark;
                    open.push(next);
                }
            }
        }
    }
}
