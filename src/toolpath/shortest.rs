//! Streamlines along the feed directions that make the whole path shortest.
//!
//! A pass costs `1 − κ_f r` mm of the cutter's way for each mm along the surface (κ_f its curvature along the feed, r the
//! cutter's corner radius) and serves a strip of width w(direction). No path that holds the scallop is shorter than
//! the integral of the least `(1 − κ_f r)/w` over all directions: [`shortest_possible`]. Directions that reach it
//! everywhere seldom belong to passes that also lie one strip apart. Fronts that move by the strip's width do keep their
//! distance, whatever curve they start on; what is open is the curve. It is searched here: straight lines first, then bent
//! ones, by the length that the front predicts.
//!
//! Enters: a part and the scallop height. Leaves: passes. Lengths in mm; planned to second order, as [`super::strip`]
//! is.

use std::f64::consts::PI;

use super::chart::{Chart, ChartPoint};
use super::iso_scallop::{arrival, front_at, places, predicted_length};
use super::level_passes::along_levels;
use super::plan::{PassSettings, Passes, PlanError, Step};
use crate::cutter::Cutter;
use crate::field::{Front, GridField, ScalarField, Start, eikonal};
use crate::geometry::Vector3;
use crate::monitor::{self, Cancelled, Monitor};
use crate::parallel;
use crate::part::Part;

/// Nodes a side of the fronts that are compared. Coarser ones blur what makes the difference, finer ones take longer.
const SEARCH_NODES: usize = 41;

/// Angles over half a turn, and places across, of the straight lines that are tried.
const ANGLES: usize = 12;
const OFFSETS: [f64; 3] = [-0.6, 0.0, 0.6];

/// Sines and cosines that a line is bent by. More follow the surface closer and take longer to search.
const BENDS: usize = 6;

/// First steps of the search: rad, and shares of half the diagonal; and the share of them at which it ends.
const FIRST_STEPS: [f64; 3] = [0.15, 0.1, 0.08];
const LAST_STEP: f64 = 0.2;

/// Rounds of the search at most.
const MOST_ROUNDS: usize = 12;

/// A path from a border is planned too where it promises to be at most so much longer than the best: promises are
/// right within a per cent.
const WORTH_PLANNING: f64 = 1.02;

/// Pieces of a start curve.
const PIECES: usize = 96;

/// A start curve reaches beyond the middle by this many halves of the diagonal, to be sure to leave the domain.
const REACH: f64 = 1.2;

/// Places a side, and directions over half a turn, of the shortest possible length. With twice as many it changes by
/// less than 0.1 % on the shipped parts.
const PLACES: usize = 150;
const DIRECTIONS: usize = 36;

/// The way that no path can be shorter than, to second order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShortestPossible {
    /// Of the cutter's tip: the integral of the least `(1 − κ r)/w` over all directions, mm.
    pub cutting_mm: f64,
    /// Of the contact on the surface: the integral of `1/w_max`, mm.
    pub contact_mm: f64,
    /// Share of the surface where the part is as concave as the cutter, or nearly so: the strip is limited there.
    pub limited_fraction: f64,
}

/// The shortest possible path below the scallop height `h`, mm, by the widest strip over all directions at each place.
///
/// # Errors
/// When no smooth surface can be fitted to a mesh.
pub fn shortest_possible(part: &Part, cutter: &Cutter, h: f64) -> Result<ShortestPossible, PlanError> {
    let mut sum = ShortestPossible { cutting_mm: 0.0, contact_mm: 0.0, limited_fraction: 0.0 };
    let mut total = 0.0;
    for chart in Chart::all(part, cutter)? {
        let (places, cell) = places(&chart, PLACES);
        for (_, p) in &places {
            let (e, f, g) = p.jet.first_form();
            let area = cell * (e * g - f * f).max(0.0).sqrt();
            let Some(t0) = p.jet.du.try_normalize(1e-300) else { continue };
            let b0 = p.normal.cross(&t0);
            let (mut cutting, mut contact, mut limited) = (f64::INFINITY, f64::INFINITY, false);
            for k in 0..DIRECTIONS {
                let (sin, cos) = (PI * k as f64 / DIRECTIONS as f64).sin_cos();
                let t: Vector3 = t0 * cos + b0 * sin;
                let (width, too_concave) = p.strip_width(cutter, &t, Step::Scallop(h));
                cutting = cutting.min(p.offset_ratio(cutter, &t) / width);
                contact = contact.min(1.0 / width);
                limited |= too_concave;
            }
            sum.cutting_mm += cutting * area;
            sum.contact_mm += contact * area;
            sum.limited_fraction += if limited { area } else { 0.0 };
            total += area;
        }
    }
    sum.limited_fraction /= total.max(f64::MIN_POSITIVE);
    Ok(sum)
}

/// Plans passes from the start curve with the shortest path.
pub(super) fn passes(
    part: &Part,
    cutter: &Cutter,
    settings: &PassSettings,
    monitor: &dyn Monitor,
) -> Result<Passes, PlanError> {
    let mut all = Passes::default();
    for chart in Chart::all(part, cutter)? {
        let search = Search::new(&chart, cutter, settings.step, monitor);
        let (curve, tried) = search.best_curve()?;
        let border = search.best_border()?;
        let mut planned = Vec::new();
        for found in [Some(curve), Some(border).filter(|b| b.length < WORTH_PLANNING * curve.length)] {
            let Some(found) = found else { continue };
            let curves = [search.in_parameters(&found.curve.shares())];
            let field = arrival(&chart, cutter, settings.step, &curves, true, monitor)?;
            let field = ScalarField::Grid(field);
            planned.push((along_levels(part, cutter, &chart, &field, settings, monitor)?, found));
        }
        planned.sort_by(|(a, _), (b, _)| a.length().total_cmp(&b.length()));
        let Some((mut planned, found)) = planned.into_iter().next() else { continue };
        planned.notes.push(format!(
            "passes start {}, the best of {tried} curves: {:.0} mm planned, {:.0} mm predicted",
            found.curve.name(),
            planned.length(),
            found.length,
        ));
        all.append(planned);
    }
    Ok(all)
}

/// A start curve in shares of the parameters' ranges.
#[derive(Debug, Clone, Copy)]
enum Curve {
    Line(Line),
    /// The border where the parameter (0: u, 1: v) is least (0) or greatest (1).
    Border(usize, usize),
}

/// A line through the domain's unit square, turned, shifted and bent.
#[derive(Debug, Clone, Copy)]
struct Line {
    /// From the first parameter's axis, rad.
    angle: f64,
    /// Distance from the middle to the left, and amplitudes of the bends, in halves of the diagonal.
    offset: f64,
    bends: [f64; BENDS],
}

/// A curve and the length, mm, that its front promises.
#[derive(Debug, Clone, Copy)]
struct Found {
    curve: Curve,
    length: f64,
}

impl Curve {
    fn shares(&self) -> Vec<[f64; 2]> {
        match self {
            Self::Line(line) => line.shares(),
            Self::Border(parameter, end) => [0.0, 1.0]
                .map(|along| {
                    let mut at = [along; 2];
                    at[*parameter] = *end as f64;
                    at
                })
                .to_vec(),
        }
    }

    fn name(&self) -> String {
        match self {
            Self::Line(line) => {
                format!("on a curve at {:.0} degrees", line.angle.to_degrees().rem_euclid(180.0))
            }
            Self::Border(parameter, end) => {
                format!("at the border of {} {}", ["least", "greatest"][*end], ["u", "v"][*parameter])
            }
        }
    }
}

impl Line {
    /// Number of what can be changed.
    const FREEDOMS: usize = 2 + BENDS;

    fn shares(&self) -> Vec<[f64; 2]> {
        let (sin, cos) = self.angle.sin_cos();
        let half_diagonal = std::f64::consts::FRAC_1_SQRT_2;
        let at = |k: usize| {
            let s = 2.0 * k as f64 / PIECES as f64 - 1.0;
            let bend = |(k, amplitude): (usize, &f64)| {
                let wave = 0.5 * PI * (k / 2 + 1) as f64 * s;
                amplitude * if k % 2 == 0 { wave.sin() } else { wave.cos() - 1.0 }
            };
            let across = self.offset + self.bends.iter().enumerate().map(bend).sum::<f64>();
            let along = REACH * s;
            [
                0.5 + half_diagonal * (cos * along - sin * across),
                0.5 + half_diagonal * (sin * along + cos * across),
            ]
        };
        (0..=PIECES).map(at).collect()
    }

    /// Changed by `steps` (of angle, offset and bends) along freedom `k`.
    fn moved(mut self, k: usize, steps: [f64; 3]) -> Self {
        match k {
            0 => self.angle += steps[0],
            1 => self.offset += steps[1],
            _ => self.bends[k - 2] += steps[2],
        }
        self
    }
}

/// What all fronts over a chart share: metric and speeds at the nodes, and the places where lengths are summed.
struct Search<'a> {
    chart: &'a Chart<'a>,
    cutter: &'a Cutter,
    step: Step,
    fronts: Vec<Option<Front>>,
    places: (Vec<([f64; 2], ChartPoint)>, f64),
    monitor: &'a dyn Monitor,
}

impl<'a> Search<'a> {
    fn new(chart: &'a Chart, cutter: &'a Cutter, step: Step, monitor: &'a dyn Monitor) -> Self {
        let n = SEARCH_NODES;
        let [[u0, u1], [v0, v1]] = chart.domain;
        let at = |lo: f64, hi: f64, k: usize| lo + (hi - lo) * k as f64 / (n - 1) as f64;
        let front = |k: usize| front_at(chart, cutter, step, at(u0, u1, k % n), at(v0, v1, k / n));
        let fronts = parallel::map(n * n, front);
        Self { chart, cutter, step, fronts, places: places(chart, n), monitor }
    }

    fn in_parameters(&self, shares: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let domain = self.chart.domain;
        let at = |p: &[f64; 2]| [0, 1].map(|c| domain[c][0] + p[c] * (domain[c][1] - domain[c][0]));
        shares.iter().map(at).collect()
    }

    /// The path's length for a start curve; infinite where no front can start on it.
    fn length(&self, curve: &Curve) -> Result<f64, Cancelled> {
        monitor::check(self.monitor)?;
        let shares = curve.shares();
        // One that only passes by is met by coarse grids, but not by fine ones.
        if !shares.iter().any(|p| p.iter().all(|x| (0.0..=1.0).contains(x))) {
            return Ok(f64::INFINITY);
        }
        let field = self.front_from(&[self.in_parameters(&shares)]);
        let length =
            |field| predicted_length(&self.places, self.cutter, self.step, &ScalarField::Grid(field));
        Ok(field.map_or(f64::INFINITY, length))
    }

    fn front_from(&self, curves: &[Vec<[f64; 2]>]) -> Option<GridField> {
        let n = SEARCH_NODES;
        let [[u0, u1], [v0, v1]] = self.chart.domain;
        let node = |x: f64, lo: f64, hi: f64| {
            let k = (x - lo) / (hi - lo) * (n - 1) as f64;
            let near = k.round();
            ((k - near).abs() < 1e-6 && near >= 0.0 && near < n as f64).then_some(near as usize)
        };
        let front = |u: f64, v: f64| match (node(u, u0, u1), node(v, v0, v1)) {
            (Some(i), Some(j)) => self.fronts[j * n + i].clone(),
            _ => front_at(self.chart, self.cutter, self.step, u, v),
        };
        let start = Start { curves, signed: true };
        eikonal(self.chart.domain, [n, n], &front, &start, self.monitor).ok().map(|arrival| arrival.field)
    }

    /// The border with the shortest path.
    fn best_border(&self) -> Result<Found, PlanError> {
        let borders = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(parameter, end)| Curve::Border(parameter, end));
        Ok(self.shortest(&borders)?)
    }

    /// Straight lines, and from the best of them on bent ones; and how many were tried.
    fn best_curve(&self) -> Result<(Found, usize), PlanError> {
        let lines: Vec<Line> = (0..ANGLES * OFFSETS.len())
            .map(|k| Line {
                angle: PI * (k % ANGLES) as f64 / ANGLES as f64,
                offset: OFFSETS[k / ANGLES],
                bends: [0.0; BENDS],
            })
            .collect();
        self.monitor.start("searching directions", (lines.len() + MOST_ROUNDS * 2 * Line::FREEDOMS) as u64);
        let mut tried = lines.len();
        let curves: Vec<Curve> = lines.into_iter().map(Curve::Line).collect();
        let mut best = self.shortest(&curves)?;
        let mut steps = FIRST_STEPS;
        for _ in 0..MOST_ROUNDS {
            let Curve::Line(line) = best.curve else { break };
            let around: Vec<Curve> = (0..2 * Line::FREEDOMS)
                .map(|k| line.moved(k / 2, if k % 2 == 0 { steps } else { steps.map(|s| -s) }))
                .map(Curve::Line)
                .collect();
            tried += around.len();
            let found = self.shortest(&around)?;
            if found.length < best.length {
                best = found;
            } else if steps[0] > LAST_STEP * FIRST_STEPS[0] {
                steps = steps.map(|s| 0.5 * s);
            } else {
                break;
            }
        }
        if !best.length.is_finite() {
            return Err(PlanError::NotApplicable {
                strategy: "streamline",
                reason: "no front of passes can move over the part; use another direction".into(),
            });
        }
        Ok((best, tried))
    }

    fn shortest(&self, curves: &[Curve]) -> Result<Found, Cancelled> {
        let lengths = parallel::try_map(curves.len(), |k| {
            let length = self.length(&curves[k]);
            self.monitor.advance(1);
            length
        })?;
        let found = curves.iter().zip(lengths).map(|(&curve, length)| Found { curve, length });
        let none = Found { curve: Curve::Border(0, 0), length: f64::INFINITY };
        Ok(found.min_by(|a, b| a.length.total_cmp(&b.length)).unwrap_or(none))
    }
}
