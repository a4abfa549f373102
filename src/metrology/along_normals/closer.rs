//! Looks closer where more may stand or lie between the places than was found there.
//!
//! Enters: triangles with what was cut at their corners and the ridges that cross them. Leaves: the greatest
//! figures, and how much they may still be exceeded by. mm.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::ridges::Crossing;
use super::{GRAZING, NormalInspection, Sample, Way};
use crate::figures::{Limits, NUMERICAL_FLOOR};
use geometry::{Point3, Vector3};
use work::monitor::{self, Cancelled, Monitor};

/// Triangles that are divided at most in search of extremes.
pub(super) const MOST_DIVIDED: usize = 120_000;

/// Where a limit lies between what is known and what is possible, this share of the asked bound is asked for.
const DECIDING: f64 = 1e-3;

/// A triangle is divided at most so often in a row: to a millionth of its side.
const MOST_DEPTH: u32 = 20;

/// What is searched for, in this order.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Figure {
    Depth,
    Ridge,
    Border,
    Uncut,
}

impl Figure {
    pub(crate) const ALL: &[Self] = &[Self::Depth, Self::Ridge, Self::Border, Self::Uncut];
    /// Where another toolpath cuts off what stands.
    pub(crate) const GOUGES: &[Self] = &[Self::Depth];
}

/// What may be found in a triangle, mm: the greatest depth, the highest uncut place, the highest ridge, the
/// highest place along the border that passes came down to.
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

    fn of(&self, figure: Figure) -> f64 {
        match figure {
            Figure::Depth => self.depth,
            Figure::Ridge => self.ridge,
            Figure::Border => self.border,
            Figure::Uncut => self.uncut,
        }
    }

    /// By how much the figures may be exceeded, none by less than nothing, mm.
    fn beyond(self, greatest: &Greatest, limits: &Limits) -> Self {
        let beyond = |figure| (self.of(figure) - greatest.known(figure, limits)).max(0.0);
        Self {
            depth: beyond(Figure::Depth),
            uncut: beyond(Figure::Uncut),
            ridge: beyond(Figure::Ridge),
            border: beyond(Figure::Border),
        }
    }

    pub fn greatest(self) -> f64 {
        self.depth.max(self.uncut).max(self.ridge).max(self.border)
    }
}

/// How closely figures are to be known.
struct Wanted<'a> {
    limits: &'a Limits,
    /// Which of them.
    figures: &'static [Figure],
    /// Error bound that is asked for, mm.
    asked: f64,
}

impl Wanted<'_> {
    /// Whether a figure is to be known more closely: where it may be exceeded by more than is asked, or a
    /// limit hangs on it.
    fn is_open(&self, possible: &Possible, figure: Figure, greatest: &Greatest) -> bool {
        let limit = match figure {
            Figure::Depth => self.limits.gouge,
            Figure::Uncut => self.limits.uncut,
            Figure::Ridge | Figure::Border => self.limits.scallop,
        };
        let (possible, known) = (possible.of(figure), greatest.known(figure, self.limits));
        // Figures have this floor on top.
        let decides = known <= limit && possible + 2.0 * NUMERICAL_FLOOR > limit;
        possible - known > if decides { DECIDING * self.asked } else { self.asked }.max(NUMERICAL_FLOOR)
    }

    fn is_any_open(&self, possible: &Possible, greatest: &Greatest) -> bool {
        self.figures.iter().any(|figure| self.is_open(possible, *figure, greatest))
    }
}

/// A triangle with what may be found in it.
struct Open {
    possible: Possible,
    samples: [Sample; 3],
    /// Which of its sides are the border of the part.
    on_border: [bool; 3],
    depth: u32,
}

impl Open {
    /// The order of two by what they promise of a figure.
    fn by_promise(&self, other: &Self, figure: Figure) -> Ordering {
        let place = |open: &Self| open.samples[0].place.point;
        let (a, b) = (place(self), place(other));
        self.possible
            .of(figure)
            .total_cmp(&other.possible.of(figure))
            .then(b.x.total_cmp(&a.x))
            .then(b.y.total_cmp(&a.y))
            .then(b.z.total_cmp(&a.z))
            .then(other.depth.cmp(&self.depth))
    }
}

/// A triangle that waits for its turn in the search for a figure.
struct Waiting {
    figure: Figure,
    open: Open,
}

impl PartialEq for Waiting {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Waiting {}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> Ordering {
        self.open.by_promise(&other.open, self.figure)
    }
}

/// Keeps no more triangles than so many: of each figure the most promising ones. Returns what is possible in
/// the others.
fn keep_most_promising(open: &mut Vec<Open>, most: usize, figures: &[Figure]) -> Possible {
    let mut kept = 0;
    for (turn, &figure) in figures.iter().enumerate() {
        let share = (most - kept) / (figures.len() - turn);
        let rest = &mut open[kept..];
        if share < rest.len() {
            rest.select_nth_unstable_by(share, |a, b| b.by_promise(a, figure));
            kept += share;
        } else {
            kept = open.len();
        }
    }
    open.drain(kept..).fold(Possible::NOTHING, |all, open| all.or(open.possible))
}

/// The greatest figures found so far.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Greatest {
    pub depth: f64,
    pub deepest: Option<(Point3, u32)>,
    /// What is cut for certain.
    pub depth_at_least: f64,
    /// What the depth may be where it is uncertain.
    pub possible_depth: f64,
    /// The highest place that is uncut, with its height, mm, as far as ridges were known when it was found.
    pub uncut: Option<(f64, Sample)>,
    /// The highest ridge, where it is, and how much lower it may be.
    pub ridge: Option<(f64, Point3, f64)>,
    /// The highest place up to the uncut tolerance, with its height, mm.
    pub place: Option<(f64, Sample)>,
}

impl Greatest {
    pub fn look_at(&mut self, sample: &Sample, limits: &Limits) {
        let Some(hit) = sample.hit else { return };
        let rounding = GRAZING * sample.slope();
        if hit.deviation <= limits.uncut && hit.deviation - rounding > self.highest_place() {
            self.place = Some((hit.deviation - rounding, *sample));
        }
        self.depth_at_least = self.depth_at_least.max(-hit.deviation - rounding - NUMERICAL_FLOOR);
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

    /// What a triangle must exceed to change a figure, mm.
    fn known(&self, figure: Figure, limits: &Limits) -> f64 {
        match figure {
            Figure::Depth => self.depth,
            Figure::Ridge => self.highest_ridge(),
            Figure::Border => self.highest_place(),
            Figure::Uncut => self.highest_uncut(limits),
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

/// How deep a move may cut in a triangle by the planes that touch the cut at the corners, mm. What one
/// straight move cuts is hollow or straight in every direction. So its height over the design lies above each
/// of these planes, less what the design rises off its own where it is hollow itself.
fn depth_by_tangents(samples: &[Sample; 3], by: u32) -> f64 {
    let way = |i: usize, j: usize| samples[j].place.point - samples[i].place.point;
    let hollow = [(0, 1), (1, 2), (2, 0)].map(|(i, j)| rise(samples, i, j)).into_iter().fold(0.0, f64::max);
    let of_corner = |i: usize| {
        let sample = &samples[i];
        let hit = sample.hit.filter(|hit| hit.by == by)?;
        // Along the normals the design counts as plane; on a ridge the plane is met along any way out that
        // the corners tell.
        let (cos, across, deep, hollow) = match hit.way {
            Way::Normal => {
                let cos = hit.normal.dot(&sample.place.normal);
                (cos, hit.normal - sample.place.normal * cos, -hit.deviation, hollow)
            }
            Way::OutOfRidge(out) => {
                let cos = least_cosine(samples, &hit.normal)?;
                (cos, hit.normal, -hit.deviation * hit.normal.dot(&out) / cos, hollow / cos)
            }
            Way::Thickness => return None,
        };
        // The height falls toward where the cut's normal leans.
        let fall = |j: usize| if cos > 0.0 { across.dot(&way(i, j)) / cos } else { f64::INFINITY };
        Some((0..3).filter(|&j| j != i).map(fall).fold(0.0, f64::max) + deep + hollow)
    };
    (0..3).filter_map(of_corner).fold(f64::INFINITY, f64::min)
}

/// The least cosine between the normal of a cut and the ways out of ridges at the corners of a triangle;
/// `None` where one is none.
fn least_cosine(samples: &[Sample; 3], normal: &Vector3) -> Option<f64> {
    let cosines = samples.iter().filter_map(|sample| sample.hit).map(|hit| match hit.way {
        Way::Normal => f64::INFINITY,
        Way::OutOfRidge(out) => normal.dot(&out),
        Way::Thickness => f64::NEG_INFINITY,
    });
    Some(cosines.fold(f64::INFINITY, f64::min)).filter(|cos| *cos > 0.0)
}

/// How the design rises off its tangent planes at both ends of a side, together, mm: positive where it is
/// hollow.
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
        // Beside what is cut steeply little may be cut all the same.
        if found.depth > greatest.depth + far {
            found.depth = found.depth.min(self.depth_by_distance(samples));
        }
        found.border = self.border_at_most(samples, on_border, crossings);
        let ridge = |c: &Crossing| (c.height + c.rise * longest).min(self.engine.reach().max(c.height));
        found.ridge = crossings.iter().map(ridge).fold(found.ridge, f64::max);
        found
    }

    /// How deep anything may be cut along the normals of a triangle, by how near tools come to the line along
    /// one of them, mm.
    fn depth_by_distance(&self, samples: &[Sample; 3]) -> f64 {
        let places = samples.map(|sample| sample.place);
        let middle = Point3::from(places.iter().map(|place| place.point.coords).sum::<Vector3>() / 3.0);
        let normal = places.iter().map(|place| place.normal).sum::<Vector3>().normalize();
        let far = places.iter().map(|place| (place.point - middle).norm()).fold(0.0, f64::max);
        let turned = places.iter().map(|place| (place.normal - normal).norm()).fold(0.0, f64::max);
        // The lines diverge, and the design lies beside the plane of its corners.
        let aside = far + turned * (self.engine.depth() + far);
        self.engine.depth_at_most(&middle, &normal, aside)
    }

    /// How high material stands at most along the sides of a triangle that are the border, as far as passes
    /// came down to it. What one move leaves is hollow or straight, so that it is highest at an end of a side
    /// or at the ridge where another one takes over, but for what the design sinks between the ends.
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

    /// How deep a move may cut near the corners of a triangle that it cut, by how steep it is there: no place
    /// is farther than `far` from a corner, mm.
    fn depth_around(&self, samples: &[Sample; 3], by: u32, far: f64) -> f64 {
        let of_corner = |sample: &Sample| {
            let slope = sample.slope();
            // A cut of radius r that meets the design at the slope s goes no deeper than about s²r below
            // that.
            let deeper = (slope * far).min(slope * slope * self.radius);
            sample.hit.filter(|hit| hit.by == by).map(|hit| deeper - hit.deviation)
        };
        samples.iter().filter_map(of_corner).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Divides triangles, the most promising ones first, for one figure after the other: what is left open of
    /// one does not keep another one open. Returns by how much the figures may still be exceeded, mm.
    pub fn search<'b>(
        &self,
        triangles: impl Iterator<Item = ([Sample; 3], [bool; 3], &'b [Crossing])>,
        greatest: &mut Greatest,
        asked: f64,
        monitor: &dyn Monitor,
    ) -> Result<Possible, Cancelled> {
        const BATCH: usize = 64;
        monitor.start("looking closer", 0);
        let figures = self.figures;
        let wanted = Wanted { limits: self.limits, figures, asked };
        // What promises little is not kept, but counts.
        let mut closed = Possible::NOTHING;
        let mut open: Vec<Open> = Vec::new();
        for (samples, on_border, crossings) in triangles {
            let possible = self.possible(&samples, on_border, crossings, greatest);
            if wanted.is_any_open(&possible, greatest) {
                open.push(Open { possible, samples, on_border, depth: 0 });
            } else {
                closed = closed.or(possible);
            }
            // No more than so many will be divided.
            if open.len() > 2 * self.most_divided {
                closed = closed.or(keep_most_promising(&mut open, self.most_divided, figures));
            }
        }
        closed = closed.or(keep_most_promising(&mut open, self.most_divided, figures));
        let mut left = self.most_divided;
        // A second time with what is left of all shares.
        for (turn, &figure) in figures.iter().enumerate().chain(figures.iter().enumerate()) {
            let mut share = left / (figures.len() - turn);
            left -= share;
            let (waiting, mut others): (Vec<Open>, Vec<Open>) =
                open.into_iter().partition(|open| wanted.is_open(&open.possible, figure, greatest));
            let mut heap: BinaryHeap<Waiting> =
                waiting.into_iter().map(|open| Waiting { figure, open }).collect();
            while share > 0 && !heap.is_empty() {
                monitor::check(monitor)?;
                let mut batch = Vec::new();
                while batch.len() < BATCH.min(share) {
                    let Some(Waiting { open, .. }) = heap.pop() else { break };
                    // More was found since some of them were put there.
                    if wanted.is_open(&open.possible, figure, greatest) {
                        batch.push(open);
                    } else {
                        others.push(open);
                    }
                }
                share -= batch.len();
                let closer = work::parallel::map(batch.len(), |k| self.divided(&batch[k].samples));
                for (divided, parts) in batch.iter().zip(closer) {
                    let [ab, bc, ca] = divided.on_border;
                    let borders = [[ab, false, ca], [ab, bc, false], [false, bc, ca], [false; 3]];
                    for ((samples, Closer { middles, crossings }), on_border) in
                        parts.into_iter().zip(borders)
                    {
                        crossings.iter().for_each(|crossing| greatest.look_at_ridge(crossing));
                        for sample in &middles {
                            greatest.look_at(sample, self.limits);
                            greatest.look_at_height(sample, self);
                        }
                        let possible = self.possible(&samples, on_border, &crossings, greatest);
                        let open = Open { possible, samples, on_border, depth: divided.depth + 1 };
                        if open.depth == MOST_DEPTH || !wanted.is_any_open(&possible, greatest) {
                            closed = closed.or(possible);
                        } else if wanted.is_open(&possible, figure, greatest) {
                            heap.push(Waiting { figure, open });
                        } else {
                            others.push(open);
                        }
                    }
                }
            }
            left += share;
            others.extend(heap.into_iter().map(|waiting| waiting.open));
            open = others;
        }
        let possible = open.iter().fold(closed, |possible, open| possible.or(open.possible));
        Ok(possible.beyond(greatest, self.limits))
    }

    /// The four triangles of one, and what they hold.
    fn divided(&self, [a, b, c]: &[Sample; 3]) -> Vec<([Sample; 3], Closer)> {
        let middle = |p: &Sample, q: &Sample| {
            self.sample(p.place.towards(&q.place, 0.5, self.part), p.hit.or(q.hit).as_ref())
        };
        let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
        let on = |p: &Sample, q: &Sample| self.on_side(&[*p, *q]);
        // Those between the middles belong to two triangles each.
        let [ab_bc, bc_ca, ca_ab] = [on(&ab, &bc), on(&bc, &ca), on(&ca, &ab)];
        let parts = [
            ([*a, ab, ca], [&on(a, &ab), &ca_ab, &on(&ca, a)]),
            ([ab, *b, bc], [&on(&ab, b), &on(b, &bc), &ab_bc]),
            ([ca, bc, *c], [&bc_ca, &on(&bc, c), &on(c, &ca)]),
            ([ab, bc, ca], [&ab_bc, &bc_ca, &ca_ab]),
        ];
        parts
            .map(|(samples, on_sides)| {
                let crossings = self.crossings(on_sides.into_iter().flatten().copied().collect());
                (samples, Closer { middles: [ab, bc, ca], crossings })
            })
            .into()
    }
}
