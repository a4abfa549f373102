//! Nested curves joined to runs: what the cutter cuts from one entry to the next retract, in the plane.
//!
//! Enters: a [`Nest`]. Leaves: [`Run`]s, from the innermost curves to the wall. Neighbouring curves are
//! joined by links that leave and meet them along their tangents; with `spiral`, curves around one another
//! become one spiral.

use std::f64::consts::TAU;

use super::nest::Nest;
use geometry::{Piece, Point2, SegmentGrid, Vector2};

/// Chords of links and helices.
const LINK_PIECES: usize = 16;

/// Handles of a link over the spacing of points: long links are straight but for their ends.
const LONGEST_HANDLE: f64 = 4.0;

/// Places of a spiral's turn at least.
const LEAST_PLACES: f64 = 48.0;

/// A link meets the next curve this many times its length of gap farther on.
pub(super) const LEADS: [f64; 3] = [2.5, 1.5, 0.8];

/// The same where the engagement is bounded: a link at an angle to the pass beside it cuts as much more.
pub(super) const LONG_LEADS: [f64; 3] = [7.0, 4.0, 2.0];

/// How a run gets down to its depth.
#[derive(Debug, Clone, PartialEq)]
pub enum Entry {
    /// A helix about a centre and once around at depth; the run goes on from the circle's point at `begin`.
    Helix {
        /// Its axis.
        centre: Point2,
        /// Its radius, mm.
        radius: f64,
        /// Angle of the point on its circle where it begins and ends, rad.
        begin: f64,
    },
    /// Back and forth, or around: a way in the plane that ends where the run begins.
    Ramp(Vec<Point2>),
    /// Straight down where no stock stands.
    Air,
}

/// From an entry to a retract.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// The way down.
    pub entry: Entry,
    /// The way at depth.
    pub points: Vec<Point2>,
}

impl Run {
    /// A run that has yet to go anywhere.
    fn new(entry: Entry) -> Self {
        Self { entry, points: Vec::new() }
    }

    /// The turn at depth that ends its way down, if that is a helix.
    pub fn turn_at_depth(&self) -> Vec<Point2> {
        match &self.entry {
            Entry::Helix { centre, radius, begin } => circle(centre, *radius, *begin, *radius),
            Entry::Ramp(_) | Entry::Air => Vec::new(),
        }
    }

    /// Where it ends so far, and in which direction.
    fn end(&self) -> Option<(Point2, Vector2)> {
        let n = self.points.len();
        let end = *self.points.last()?;
        match (&self.entry, n.checked_sub(2)) {
            (_, Some(before)) => Some((end, direction(&self.points[before], &end))),
            (Entry::Helix { centre, .. }, None) => {
                let out = direction(centre, &end);
                Some((end, Vector2::new(-out.y, out.x)))
            }
            (Entry::Ramp(_) | Entry::Air, None) => None,
        }
    }
}

/// What routes need to know.
#[derive(Debug, Clone, Copy)]
pub struct RouteSettings {
    /// Radius that a helix should have, and the least that is worth one, mm.
    pub helix: [f64; 2],
    /// One spiral where curves are nested around one place.
    pub spiral: bool,
    /// Longest side of the spiral's polyline, mm.
    pub spacing: f64,
    /// Leads of links, the first that stays inside is taken.
    pub leads: [f64; 3],
}

/// All runs of a nest.
pub fn runs(nest: &Nest, walls: &SegmentGrid, settings: &RouteSettings) -> Vec<Run> {
    let mut route = Route { walls, settings, runs: Vec::new(), bore: None, last: None };
    route.visit(nest);
    route.finish_spiral();
    route.runs
}

struct Route<'a> {
    walls: &'a SegmentGrid,
    settings: &'a RouteSettings,
    runs: Vec<Run>,
    /// The circle of the last helix.
    bore: Option<(Point2, f64)>,
    /// The closed curve at whose beginning the last run stands, while it can be spiralled on.
    last: Option<Vec<Point2>>,
}

/// The curve from its point nearest to `from` on, plus `lead` mm, which becomes its first point.
pub(super) fn begun_near(curve: &[Point2], from: &Point2, lead: f64) -> Vec<Point2> {
    let grid = SegmentGrid::of_curves([curve]);
    let Some(nearest) = grid.nearest(from) else { return curve.to_vec() };
    let n = curve.len();
    let (mut k, mut share) = (nearest.segment as usize, nearest.share);
    let mut rest = lead;
    for _ in 0..2 * n {
        let length = (curve[(k + 1) % n] - curve[k]).norm();
        if share * length + rest <= length {
            share += if length > 0.0 { rest / length } else { 0.0 };
            break;
        }
        rest -= (1.0 - share) * length;
        (k, share) = ((k + 1) % n, 0.0);
    }
    let start = curve[k] + (curve[(k + 1) % n] - curve[k]) * share;
    let mut out = vec![start];
    out.extend((1..=n).map(|i| curve[(k + i) % n]));
    out.dedup();
    if out.len() > 1 && out[out.len() - 1] == start {
        out.pop();
    }
    out
}

fn direction(a: &Point2, b: &Point2) -> Vector2 {
    (b - a).try_normalize(0.0).unwrap_or_else(Vector2::zeros)
}

/// A cubic from `a` along `u` to `b` along `v`, ends left out.
pub(super) fn bend(a: Point2, u: Vector2, b: Point2, v: Vector2, longest: f64) -> Vec<Point2> {
    let handle = (0.4 * (b - a).norm()).min(longest);
    let (c, d) = (a + u * handle, b - v * handle);
    (1..LINK_PIECES)
        .map(|k| {
            let t = k as f64 / LINK_PIECES as f64;
            let s = 1.0 - t;
            Point2::from(
                a.coords * (s * s * s)
                    + c.coords * (3.0 * s * s * t)
                    + d.coords * (3.0 * s * t * t)
                    + b.coords * (t * t * t),
            )
        })
        .collect()
}

impl Route<'_> {
    fn visit(&mut self, nest: &Nest) {
        if nest.inner.is_empty() {
            self.enter(nest);
        } else {
            let mut inner: Vec<&Nest> = nest.inner.iter().collect();
            // The one with most passes last: it leads on without a retract.
            inner.sort_by(|a, b| a.length().total_cmp(&b.length()));
            inner.into_iter().for_each(|n| self.visit(n));
            if nest.inner.len() > 1 {
                self.finish_spiral();
            }
        }
        if !nest.between.is_empty() {
            self.finish_spiral();
            nest.between.iter().for_each(|stretch| self.stretch(stretch, &nest.curves));
        }
        let bored = |p: &Point2| self.bore.is_some_and(|(centre, radius)| (p - centre).norm() <= radius);
        if nest.curves.curves().flatten().all(bored) {
            return;
        }
        let single = nest.curves.islands.is_empty() && nest.inner.len() <= 1;
        if self.settings.spiral && single && self.turn(&nest.curves) {
            return;
        }
        self.finish_spiral();
        let mut left: Vec<&[Point2]> = nest.curves.curves().collect();
        while !left.is_empty() {
            let end = self.end();
            let away = |curve: &[Point2]| end.map_or(0.0, |e| SegmentGrid::of_curves([curve]).distance(&e));
            let nearest = (0..left.len()).min_by(|a, b| away(left[*a]).total_cmp(&away(left[*b])));
            let curve = left.remove(nearest.unwrap_or(0));
            self.curve(curve, &nest.curves, &nest.seed);
        }
    }

    fn end(&self) -> Option<Point2> {
        self.runs.last().and_then(|run| run.points.last()).copied()
    }

    /// Begins a run at the seed by a helix, if there is room for one.
    fn enter(&mut self, nest: &Nest) {
        self.finish_spiral();
        let [wanted, least] = self.settings.helix;
        let radius = wanted.min(self.walls.distance(&nest.seed));
        if radius < least {
            // The first curve is ramped along: `curve` sees a run without points.
            self.runs.push(Run::new(Entry::Ramp(Vec::new())));
            return;
        }
        self.bore = Some((nest.seed, radius));
        let circle = circle(&nest.seed, radius, 0.0, self.settings.spacing);
        let entry = Entry::Helix { centre: nest.seed, radius, begin: 0.0 };
        self.runs.push(Run { entry, points: vec![circle[0]] });
        if self.settings.spiral {
            self.last = Some(circle);
        }
    }

    /// Goes around the curve at which a spiral ends.
    fn finish_spiral(&mut self) {
        let (Some(curve), Some(run)) = (self.last.take(), self.runs.last_mut()) else { return };
        // The circle of a helix has been gone around.
        if run.points.len() > 1 {
            run.points.extend(curve.iter().skip(1));
            run.points.push(curve[0]);
        }
    }

    /// One turn of a spiral, from the last curve to that of `nest`; false where there is none, or where
    /// it would leave the curve.
    fn turn(&mut self, nest: &Piece) -> bool {
        let (Some(inner), Some(run)) = (&self.last, self.runs.last_mut()) else { return false };
        let outer = begun_near(&nest.outer, &inner[0], 0.0);
        let turn = spiral_turn(inner, &outer, self.settings.spacing);
        let border = SegmentGrid::of_curves([outer.as_slice()]);
        let within = |p: &Point2| nest.contains(p) || border.distance(p) < 1e-6;
        let mut before = inner[0];
        for p in &turn {
            if !within(p) || !within(&nalgebra::center(&before, p)) {
                return false;
            }
            before = *p;
        }
        run.points.extend(turn);
        self.last = Some(outer);
        true
    }

    /// Links to a closed curve within `inside` and goes around it.
    fn curve(&mut self, curve: &[Point2], inside: &Piece, seed: &Point2) {
        let fresh = self.runs.last().is_none_or(|run| run.points.is_empty());
        if fresh {
            let closed = begun_near(curve, seed, 0.0);
            self.ramp(closed);
            return;
        }
        let Some(run) = self.runs.last_mut() else { return };
        let Some((end, along)) = run.end() else { return };
        let gap = SegmentGrid::of_curves([curve]).distance(&end);
        let border = SegmentGrid::of_curves(inside.curves());
        // A link cuts nothing but what lies within the curve; on the curve itself it may be by rounding.
        let within = |p: &Point2| inside.contains(p) || border.distance(p) < 1e-6;
        for lead in self.settings.leads {
            let closed = begun_near(curve, &end, lead * gap);
            let onward = direction(&closed[0], &closed[1 % closed.len()]);
            let link = bend(end, along, closed[0], onward, LONGEST_HANDLE * self.settings.spacing);
            if link.iter().all(within) {
                run.points.extend(link);
                go_around(run, closed);
                return;
            }
        }
        let closed = begun_near(curve, &end, 0.0);
        let straight = (1..LINK_PIECES).map(|k| end + (closed[0] - end) * (k as f64 / LINK_PIECES as f64));
        if straight.clone().all(|p| within(&p)) {
            go_around(run, closed);
        } else {
            self.ramp(closed);
        }
    }

    /// Goes along an open stretch: linked straight over ground that is cut, or else by a run of its own.
    fn stretch(&mut self, stretch: &[Point2], inside: &Piece) {
        let linked = self.runs.last_mut().and_then(|run| {
            let (end, along) = run.end()?;
            let onward = direction(&stretch[0], &stretch[1]);
            let handle = LONGEST_HANDLE * self.settings.spacing;
            let link = bend(end, along, stretch[0], onward, handle);
            link.iter().all(|p| inside.contains(p)).then(|| {
                run.points.extend(link.into_iter().chain(stretch.iter().copied()));
            })
        });
        if linked.is_none() {
            let way = stretch.iter().chain(stretch.iter().rev().skip(1)).copied().collect();
            self.runs.push(Run { entry: Entry::Ramp(way), points: stretch.to_vec() });
        }
    }

    /// A run that ramps along a closed curve and then goes around it.
    fn ramp(&mut self, closed: Vec<Point2>) {
        if self.runs.last().is_some_and(|run| run.points.is_empty()) {
            self.runs.pop();
        }
        let mut way = closed.clone();
        way.push(closed[0]);
        let mut run = Run::new(Entry::Ramp(way));
        go_around(&mut run, closed);
        self.runs.push(run);
    }
}

fn go_around(run: &mut Run, closed: Vec<Point2>) {
    let first = closed[0];
    run.points.extend(closed);
    run.points.push(first);
}

/// A circle, counter-clockwise from the angle `begin`, rad.
pub(super) fn circle(centre: &Point2, radius: f64, begin: f64, spacing: f64) -> Vec<Point2> {
    /// A circle has at least so many corners.
    const LEAST: f64 = 48.0;
    let n = (TAU * radius / spacing).ceil().max(LEAST);
    let at = |k: usize| begin + TAU * k as f64 / n;
    (0..n as usize).map(|k| centre + Vector2::new(at(k).cos(), at(k).sin()) * radius).collect()
}

/// From the beginning of `inner` once around to the beginning of `outer`, its first point left out: each
/// point of the outer curve, drawn to the nearest of the inner one by the share of the turn that is left.
fn spiral_turn(inner: &[Point2], outer: &[Point2], spacing: f64) -> Vec<Point2> {
    let shares = |curve: &[Point2]| {
        let mut s = vec![0.0];
        for k in 0..curve.len() {
            s.push(s[k] + (curve[(k + 1) % curve.len()] - curve[k]).norm());
        }
        let whole = s[curve.len()].max(f64::MIN_POSITIVE);
        s.iter_mut().for_each(|v| *v /= whole);
        (s, whole)
    };
    let ((inner_s, _), (outer_s, whole)) = (shares(inner), shares(outer));
    let at = |curve: &[Point2], s: &[f64], t: f64| {
        let k = s.partition_point(|v| *v <= t).clamp(1, curve.len()) - 1;
        let part = if s[k + 1] > s[k] { (t - s[k]) / (s[k + 1] - s[k]) } else { 0.0 };
        curve[k] + (curve[(k + 1) % curve.len()] - curve[k]) * part
    };
    let grid = SegmentGrid::of_curves([inner]);
    // The corners of the outer curve and, on its longer sides, places between.
    let mut turns = Vec::new();
    for k in 0..outer.len() {
        let (from, to) = (outer_s[k], outer_s[k + 1]);
        let n = ((to - from) * (whole / spacing).max(LEAST_PLACES)).ceil().max(1.0);
        turns.extend((1..=n as usize).map(|i| from + (to - from) * (i as f64 / n)));
    }
    let mut last = 0.0f64;
    let place = |t: f64| {
        let found = grid.nearest(&at(outer, &outer_s, t)).map_or(t, |f| {
            let j = f.segment as usize;
            inner_s[j] + f.share * (inner_s[j + 1] - inner_s[j])
        });
        // The nearest place goes around with the turn; where it jumps or falls back, hold on.
        last = (found + (t - found).round()).clamp(last, 1.0);
        let (p, q) = (at(inner, &inner_s, last), at(outer, &outer_s, t));
        p + (q - p) * t
    };
    let mut points: Vec<Point2> = turns.into_iter().map(place).collect();
    if let Some(end) = points.last_mut() {
        *end = outer[0];
    }
    points
}
