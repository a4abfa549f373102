//! Leading and trailing edges of closed outlines, and the two sides between them.
//!
//! Enters: [`Sections`]. Leaves: for each closed outline its periodic spline and both edges on it; for every
//! section its sides as points, and its outline from the trailing edge round.
//!
//! An edge is looked for near one of the two points that lie farthest apart. Where the outline has a corner
//! there, the corner is the edge; two corners close to each other bound a blunt edge. Else it is the middle
//! of the turn of the stretch that turns at least half as fast as the fastest place: of an arc its middle, of
//! an ellipse its vertex. A place of greatest curvature alone would lie anywhere on an arc.

use super::{LeadingEnd, Outline, SectionError, SectionPlace, Sections};
use geometry::{CubicSpline, Point2, SplineError, Vector2, signed_area};

/// An edge is looked for within this share of the outline's length to each side of the end of its greatest
/// extent. A tenth: a sixth would reach into the hollow of a strongly bent blade, a twentieth would miss
/// thick noses.
const REACH: f64 = 0.1;

/// A point where the outline turns by more than this is a corner, if its neighbours turn by less than a third
/// of it, rad (60°). Round edges of five points turn by less at each.
const CORNER: f64 = std::f64::consts::FRAC_PI_3;

/// Corners no farther apart than this share of the section's size bound a blunt edge.
const BLUNT: f64 = 0.1;

/// Turning is averaged over this share of the section's size. Rounded digits bend a spline through close
/// points more than edges do; edges of a lesser radius than half of it are still found, at a coarser radius.
const AVERAGED: f64 = 0.005;

/// Looks at a span of the spline.
pub(super) const LOOKS: usize = 8;

/// An edge nearer to a point of the table than this share of the span is that point.
const SNAP: f64 = 0.05;

/// Radii that differ by less than this factor are equal.
const EQUAL_RADII: f64 = 1.05;

/// An edge of a closed outline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Edge {
    /// Where it begins and ends on the outline's spline, counter-clockwise: the corners of a blunt edge, else
    /// twice the same parameter.
    pub parameters: [f64; 2],
    /// Its middle, mm.
    pub point: Point2,
    /// Mean radius where the outline turns fastest, mm; 0 for a corner or a blunt edge.
    pub radius: f64,
}

/// A closed outline with its edges.
#[derive(Debug, Clone, PartialEq)]
pub struct OutlineEdges {
    /// The periodic spline through the outline, counter-clockwise, by chord length.
    pub spline: CubicSpline,
    /// The leading edge.
    pub leading: Edge,
    /// The trailing edge.
    pub trailing: Edge,
    /// Whether the stretch from the leading counter-clockwise to the trailing edge is the pressure side.
    pub pressure_first: bool,
}

/// The sides of a section, and the way around it; mm.
#[derive(Debug, Clone, PartialEq)]
pub struct SectionSides {
    /// z of its plane.
    pub height: f64,
    /// From the leading to the trailing edge, both included.
    pub pressure: Vec<Point2>,
    /// From the leading to the trailing edge, both included.
    pub suction: Vec<Point2>,
    /// From the trailing edge counter-clockwise around the leading edge and back to the trailing edge.
    pub around: Vec<Point2>,
    /// Whether `around` is a closed curve, the trailing edge being round; its first point then is not
    /// repeated. Otherwise it ends at the other end of the trailing edge, or at the same point of a sharp
    /// one.
    pub around_closed: bool,
}

impl Edge {
    /// False for corners and blunt edges.
    pub fn is_round(&self) -> bool {
        self.radius > 0.0
    }
}

impl OutlineEdges {
    /// From where to where the spline lies between two parameters. The second is the greater, beyond the end
    /// of the period where the stretch passes it.
    fn stretch(&self, from: f64, to: f64) -> [f64; 2] {
        let [start, end] = self.spline.domain();
        [from, if to > from { to } else { to + (end - start) }]
    }

    /// Points of a stretch with both ends.
    fn points(&self, [from, to]: [f64; 2]) -> Vec<Point2> {
        let [start, end] = self.spline.domain();
        let within = |t: f64| t > from && t < to;
        let knots = || self.spline.parameters().iter().copied().zip(self.spline.points());
        let once = knots().filter(|(t, _)| within(*t)).map(|(_, p)| *p);
        let again = knots().filter(|(t, _)| within(t + (end - start))).map(|(_, p)| *p);
        let mut points = vec![self.spline.point(from)];
        points.extend(once.chain(again));
        points.push(self.spline.point(to));
        points
    }

    fn exchange(&mut self) {
        std::mem::swap(&mut self.leading, &mut self.trailing);
    }

    /// Logarithm of how much blunter the leading edge is than the trailing one.
    fn bluntness(&self) -> f64 {
        // Corners have no radius; what is finer than a thousandth of the chord is as good as one.
        let least = 1e-3 * (self.trailing.point - self.leading.point).norm();
        (self.leading.radius.max(least) / self.trailing.radius.max(least)).ln()
    }

    /// Area by which the stretch from the trailing to the leading edge bulges more than the other one, as a
    /// share of the square of the chord.
    fn camber(&self) -> f64 {
        let between = |from: &Edge, to: &Edge| {
            signed_area(&self.points(self.stretch(from.parameters[1], to.parameters[0])))
        };
        let chord = (self.trailing.point - self.leading.point).norm_squared();
        (between(&self.trailing, &self.leading) - between(&self.leading, &self.trailing)) / chord
    }

    /// Both sides and the way around.
    fn sides(&self, height: f64) -> SectionSides {
        let mut first = self.points(self.stretch(self.leading.parameters[1], self.trailing.parameters[0]));
        let mut second = self.points(self.stretch(self.trailing.parameters[1], self.leading.parameters[0]));
        let around_closed = self.trailing.is_round();
        let shared = self.leading.parameters[0] == self.leading.parameters[1];
        let mut around = second.clone();
        around.extend(first.iter().skip(usize::from(shared)));
        if around_closed {
            around.pop();
        }
        second.reverse();
        if !self.pressure_first {
            std::mem::swap(&mut first, &mut second);
        }
        SectionSides { height, pressure: first, suction: second, around, around_closed }
    }
}

impl Sections {
    /// The edges of closed outlines, section by section; nothing for sections of two sides, whose edges are
    /// their ends.
    ///
    /// Each section's leading edge is the one on the side of that of the section before. A round section has
    /// its edges in the directions of its neighbour's chord; where all are round, of the lowest one's first
    /// point. Which end of the blade it is, is what was stated ([`with_leading`](Self::with_leading)), else
    /// the blunter one by the mean of all sections, else (within 5 %) that of the lesser x of the lowest
    /// section. The pressure side is the one that the camber, the mean of all sections, bends away from; of
    /// symmetric sections the one on the right of the chord.
    ///
    /// # Errors
    /// [`SectionError::Spline`] where no spline can be laid through an outline.
    pub fn edges(&self) -> Result<Vec<OutlineEdges>, SectionError> {
        let mut found: Vec<OutlineEdges> = Vec::new();
        for (k, section) in self.sections.iter().enumerate() {
            let Outline::Closed(points) = &section.outline else { continue };
            let place = SectionPlace { section: k, height: section.height, point: None };
            found.push(both_ends(points).map_err(|source| SectionError::Spline { place, source })?);
        }
        follow_each_other(&mut found);
        if !leading_is_right(&found, self.leading) {
            found.iter_mut().for_each(OutlineEdges::exchange);
        }
        let camber: f64 = found.iter().map(OutlineEdges::camber).sum();
        found
            .iter_mut()
            .for_each(|edges| edges.pressure_first = camber >= -NO_CAMBER * self.sections.len() as f64);
        Ok(found)
    }

    /// The sides of every section, and the way around it.
    ///
    /// # Errors
    /// [`SectionError::Spline`] where no spline can be laid through an outline.
    pub fn sides(&self) -> Result<Vec<SectionSides>, SectionError> {
        if self.are_closed() {
            let edges = self.edges()?;
            return Ok(edges.iter().zip(&self.sections).map(|(e, s)| e.sides(s.height)).collect());
        }
        Ok(self.sections.iter().filter_map(|s| given_sides(s.height, &s.outline)).collect())
    }
}

/// Less camber than this share of the square of the chord is none: a mean bend of 0.04 µm on 40 mm.
const NO_CAMBER: f64 = 1e-6;

/// Sides as the table gave them.
fn given_sides(height: f64, outline: &Outline) -> Option<SectionSides> {
    let Outline::Sides { pressure, suction } = outline else { return None };
    let (first, second) = if outline.signed_area() > 0.0 { (pressure, suction) } else { (suction, pressure) };
    let near = |a: Option<&Point2>, b: Option<&Point2>| {
        a.zip(b).is_some_and(|(a, b)| (a - b).norm() <= 1e-9 * outline.size())
    };
    let shared = usize::from(near(first.first(), second.first()));
    let around = second.iter().rev().chain(first.iter().skip(shared)).copied().collect();
    Some(SectionSides {
        height,
        pressure: pressure.clone(),
        suction: suction.clone(),
        around,
        around_closed: false,
    })
}

/// Puts leading edges on the same side, from the lowest section that has edges of its own up and down; round
/// ones take the chord of their neighbour.
fn follow_each_other(found: &mut [OutlineEdges]) {
    let round: Vec<bool> = found.iter().map(OutlineEdges::is_round).collect();
    let first = round.iter().position(|round| !round).unwrap_or(0);
    let chord = |edges: &OutlineEdges| edges.trailing.point - edges.leading.point;
    let mut follow = |k: usize, neighbour: usize| {
        let beside = chord(&found[neighbour]);
        if round[k] {
            found[k].put_along(&beside);
        } else if beside.dot(&chord(&found[k])) < 0.0 {
            found[k].exchange();
        }
    };
    (first + 1..round.len()).for_each(|k| follow(k, k - 1));
    (0..first).rev().for_each(|k| follow(k, k + 1));
}

/// Whether the edges that are taken for leading are.
fn leading_is_right(found: &[OutlineEdges], stated: Option<LeadingEnd>) -> bool {
    let Some(lowest) = found.first() else { return true };
    let chord = lowest.trailing.point - lowest.leading.point;
    match stated {
        Some(LeadingEnd::MinusX) => chord.x >= 0.0,
        Some(LeadingEnd::PlusX) => chord.x <= 0.0,
        Some(LeadingEnd::MinusY) => chord.y >= 0.0,
        Some(LeadingEnd::PlusY) => chord.y <= 0.0,
        None => {
            let mean = found.iter().map(OutlineEdges::bluntness).sum::<f64>() / found.len() as f64;
            if mean.abs() < EQUAL_RADII.ln() { (chord.x, chord.y) >= (0.0, 0.0) } else { mean > 0.0 }
        }
    }
}

/// The outline's spline with both edges, in either order.
fn both_ends(points: &[Point2]) -> Result<OutlineEdges, SplineError> {
    let spline = CubicSpline::closed(CubicSpline::chord_lengths(points, true), points.to_vec())?;
    let ends = farthest(points);
    let size = (points[ends[0]] - points[ends[1]]).norm();
    let [leading, trailing] = ends.map(|end| edge_near(&spline, end, size));
    Ok(OutlineEdges { spline, leading, trailing, pressure_first: true })
}

/// Two points that lie as far apart as any, or nearly so: from a far point to the farthest from it, until
/// that gains nothing.
fn farthest(points: &[Point2]) -> [usize; 2] {
    /// Each round gains; outlines of blades take two or three.
    const ROUNDS: usize = 20;
    let from = |k: usize| {
        let apart = |p: &Point2| (p - points[k]).norm_squared();
        let far = points.iter().enumerate().max_by(|a, b| apart(a.1).total_cmp(&apart(b.1)));
        far.map_or((k, 0.0), |(far, p)| (far, apart(p)))
    };
    let (mut pair, mut distance) = ([0, 0], -1.0);
    for _ in 0..ROUNDS {
        let (far, apart) = from(pair[1]);
        if apart <= distance {
            break;
        }
        (pair, distance) = ([pair[1], far], apart);
    }
    pair
}

/// The edge near a point of the outline.
fn edge_near(spline: &CubicSpline, end: usize, size: f64) -> Edge {
    let [start, stop] = spline.domain();
    let reach = REACH * (stop - start);
    let about = spline.parameters()[end];
    let corners = corners(spline, about, reach);
    let at = |k: usize| (spline.parameters()[k], spline.points()[k]);
    match corners[..] {
        [only] => {
            let (t, point) = at(only);
            return Edge { parameters: [t, t], point, radius: 0.0 };
        }
        [a, b] if (at(a).1 - at(b).1).norm() <= BLUNT * size => {
            let ((s, p), (t, q)) = (at(a), at(b));
            return Edge { parameters: [s, t], point: nalgebra::center(&p, &q), radius: 0.0 };
        }
        _ => {}
    }
    let (t, radius) = Turning::around(spline, about, reach, AVERAGED * size).middle(spline);
    let t = snapped(spline, start + (t - start).rem_euclid(stop - start));
    Edge { parameters: [t, t], point: spline.point(t), radius }
}

/// The corners within reach of a place, counter-clockwise; none where more than two points turn like corners.
fn corners(spline: &CubicSpline, about: f64, reach: f64) -> Vec<usize> {
    let (points, n) = (spline.points(), spline.points().len());
    let [start, stop] = spline.domain();
    let turn = |k: usize| {
        let side = |k: usize| points[(k + 1) % n] - points[k % n];
        let (a, b) = (side(k + n - 1), side(k));
        a.perp(&b).atan2(a.dot(&b))
    };
    let offset = |k: usize| {
        let half = 0.5 * (stop - start);
        (spline.parameters()[k] - about + half).rem_euclid(2.0 * half) - half
    };
    let near: Vec<usize> = (0..n).filter(|k| offset(*k).abs() <= reach).collect();
    let mut corners: Vec<usize> = near.into_iter().filter(|k| turn(*k) > CORNER).collect();
    if corners.len() > 2 {
        return Vec::new();
    }
    corners.sort_by(|a, b| offset(*a).total_cmp(&offset(*b)));
    // Points of a round edge that lie far apart turn much, but so do their neighbours.
    let alone = |k: usize, beside: usize| corners.contains(&beside) || turn(beside) < turn(k) / 3.0;
    let all = corners.iter().all(|&k| alone(k, (k + 1) % n) && alone(k, (k + n - 1) % n));
    if all { corners } else { Vec::new() }
}

/// A parameter, or that of a point of the outline next to it.
pub(super) fn snapped(spline: &CubicSpline, t: f64) -> f64 {
    let knots = spline.parameters();
    let k = knots.partition_point(|knot| *knot <= t).clamp(1, knots.len() - 1);
    let near = SNAP * (knots[k] - knots[k - 1]);
    let [start, stop] = spline.domain();
    if t - knots[k - 1] < near {
        knots[k - 1]
    } else if knots[k] - t < near {
        if knots[k] == stop { start } else { knots[k] }
    } else {
        t
    }
}

/// The direction of a spline along a stretch.
struct Turning {
    /// Parameters, which are lengths but for the bulge of the spans; they may run over the end of the period.
    places: Vec<f64>,
    /// Angle of the tangent, rad, without jumps.
    angles: Vec<f64>,
    /// Length over which turning is averaged.
    averaged: f64,
}

impl Turning {
    fn around(spline: &CubicSpline, about: f64, reach: f64, averaged: f64) -> Self {
        let knots = spline.parameters();
        let [start, stop] = spline.domain();
        let mut places: Vec<f64> = Vec::new();
        for shift in [start - stop, 0.0, stop - start] {
            for span in knots.windows(2) {
                let look = |k: usize| span[0] + (span[1] - span[0]) * k as f64 / LOOKS as f64 + shift;
                places.extend((0..LOOKS).map(look).filter(|t| (t - about).abs() <= reach + averaged));
            }
        }
        let mut angles: Vec<f64> = Vec::with_capacity(places.len());
        for &t in &places {
            let tangent = spline.jet(t).1;
            let angle = tangent.y.atan2(tangent.x);
            let before = angles.last().copied().unwrap_or(angle);
            angles.push(before + wrapped(angle - before));
        }
        Self { places, angles, averaged }
    }

    /// Angle at a place between the first and the last.
    fn angle(&self, t: f64) -> f64 {
        let last = self.places.len() - 1;
        if last == 0 {
            return self.angles[0];
        }
        let k = self.places.partition_point(|p| *p <= t).clamp(1, last);
        let (a, b) = (self.places[k - 1], self.places[k]);
        let share = ((t - a) / (b - a)).clamp(0.0, 1.0);
        self.angles[k - 1] + share * (self.angles[k] - self.angles[k - 1])
    }

    /// Mean curvature around a place.
    fn rate(&self, t: f64) -> f64 {
        (self.angle(t + 0.5 * self.averaged) - self.angle(t - 0.5 * self.averaged)) / self.averaged
    }

    /// Middle of the turn of the stretch that turns fastest, and its mean radius.
    fn middle(&self, spline: &CubicSpline) -> (f64, f64) {
        let rates: Vec<f64> = self.places.iter().map(|t| self.rate(*t)).collect();
        let fastest = rates.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).map_or(0, |(k, _)| k);
        let half = 0.5 * rates[fastest];
        let ahead = (fastest..rates.len() - 1).find(|k| rates[k + 1] < half);
        let behind = (1..=fastest).rev().find(|k| rates[k - 1] < half);
        // Where the rate passes the half between two looks.
        let pass = |k: usize, l: usize| {
            let share = (rates[k] - half) / (rates[k] - rates[l]);
            self.places[k] + share * (self.places[l] - self.places[k])
        };
        let from = behind.map_or(self.places[0], |k| pass(k, k - 1));
        let to = ahead.map_or(self.places[self.places.len() - 1], |k| pass(k, k + 1));
        let (first, last) = (self.angle(from), self.angle(to));
        let turn = (last - first).max(f64::MIN_POSITIVE);
        let wanted = 0.5 * (first + last);
        let inside = |k: &usize| self.places[*k] >= from && self.places[*k] <= to;
        // Of several places with that direction (a wavy outline) the one nearest to the fastest.
        let apart = |k: &usize| k.abs_diff(fastest);
        let crossing = (0..rates.len().saturating_sub(1))
            .filter(|k| inside(k) || inside(&(k + 1)))
            .filter(|k| self.angles[*k] <= wanted && self.angles[k + 1] > wanted)
            .min_by_key(apart);
        let place = crossing.map_or(self.places[fastest], |k| {
            self.direction_reached(spline, wanted, [self.places[k], self.places[k + 1]])
        });
        (place, (to - from) / turn)
    }

    /// Where the spline's tangent has the angle `wanted`, between two places on both sides of it.
    fn direction_reached(&self, spline: &CubicSpline, wanted: f64, [mut a, mut b]: [f64; 2]) -> f64 {
        let across = Vector2::new(-wanted.sin(), wanted.cos());
        for _ in 0..60 {
            let middle = 0.5 * (a + b);
            if spline.jet(middle).1.dot(&across) > 0.0 { b = middle } else { a = middle }
        }
        0.5 * (a + b)
    }
}

/// An angle between −π and π.
fn wrapped(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    (angle + PI).rem_euclid(TAU) - PI
}
