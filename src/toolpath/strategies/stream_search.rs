//! The search for the stream function of one chart whose passes cost least.
//!
//! A B-spline is minimised from straight passes in several directions on a coarse net, and from fronts of the
//! four borders, because each start leads to a minimum of its own ([`field::minimise`]).
//!
//! A function that goes on from a front is the front itself, whose levels are the first iterate, and what a
//! spline puts to it. It stays constant along the border that the front started at: its first pass runs along
//! that whole border, half an interval inside. Passes that meet a border at a small angle run on beyond it
//! until their strips are cut, which costs half a mm for each mm of the border, so that no function near by
//! is as good. Where the front reaches the border across all along at the same number of passes, that border
//! is kept to as well.
//!
//! The remainder of the last pass is drawn in to a whole number of passes by a higher price of ends.
//!
//! Enters: a chart, the prices of ends and turns. Leaves: the best few functions.

use std::f64::consts::PI;

use super::iso_scallop::{StartedFront, front_at};
use super::streamline;
use crate::surface::chart::{Chart, ChartPoint};
use crate::vocabulary::{FeedDirection, PlanError, Step};
use cutter::Cutter;
use field::{
    Gradients, GridField, NormalEquations, Packed, Roughness, Rounds, ScalarField, ScalarSpline, Site, Tied,
};
use geometry::KnotVector;
use work::monitor::{Cancelled, Monitor};
use work::parallel;

/// Spans of the spline's knots are this many of the cutter's radii long. Features that a cutter fits into are
/// wider; finer nets gain a few tenths of a per cent.
const SPAN_OVER_RADIUS: f64 = 0.6;

/// Fewest and most spans a side. Time grows with their product.
const SPANS: [usize; 2] = [8, 72];

/// Spans of the coarsest net, on which directions are tried, along the longer side.
const COARSEST: usize = 16;

/// Straight passes to start from, over half a turn.
const STARTS: usize = 8;

/// Gauss's points of each span and side.
const GAUSS: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];

const DEGREE: usize = 3;

/// Where a pass bends by the radius of the cutter, it counts as longer by this share. Without it passes on a
/// twisted patch turn by half as much again, and are longer, since there are more minima to end in.
const BEND: f64 = 0.25;

/// Directions over half a turn by which the curvature along them is told.
const CURVED: usize = 12;

/// A number of passes is drawn in to a whole one by a greater price of ends, first by this factor, so often
/// corrected; it shall end within this share of a pass below, or a little above, which levels allow for.
const DEARER: f64 = 1.25;
const PRICES: usize = 4;
const WHOLE: [f64; 2] = [0.3, 0.1];

/// A front that reaches the border across within this many passes is turned to reach it at once, which costs
/// half of that much of the length; passes that end there cost half a pass.
const REACHED: f64 = 1.0;

/// Fronts that are gone on from: those with the shortest passes.
const FRONTS: usize = 2;

/// Functions that promise no more than this share above the best one are planned, since what they promise is
/// not what their levels give. Front and level curves of one function differ by less.
const NEARLY_AS_GOOD: f64 = 0.01;

/// Two minima are the same one where cost and number of passes differ by less than these shares.
const SAME: [f64; 2] = [3e-4, 1e-3];

/// What counts as length besides length.
#[derive(Clone, Copy)]
pub(super) struct Prices<'a> {
    /// Of an end of a pass, mm: half of the link to the next one.
    pub end: f64,
    /// Of a mm along which the surface has a curvature, 1/mm, in mm.
    pub turning: &'a (dyn Fn(f64) -> f64 + Sync),
}

/// Sorts what was found, the most promising first; keeps one of those that are the same minimum, and what is
/// nearly as good as the best.
pub(super) fn keep_promising<T>(
    found: &mut Vec<T>,
    end: f64,
    packed: impl Fn(&T) -> &Packed,
    alike: impl Fn(&T, &T) -> bool,
) {
    let priced = |of: &T| packed(of).priced(end);
    found.sort_by(|a, b| priced(a).total_cmp(&priced(b)));
    let near = |a: f64, b: f64, share: f64| (a - b).abs() <= share * a;
    found.dedup_by(|b, a| {
        let (of_a, of_b) = (packed(a), packed(b));
        near(of_a.cost, of_b.cost, SAME[0]) && near(of_a.passes, of_b.passes, SAME[1]) && alike(a, b)
    });
    let most = found.first().map_or(0.0, &priced) * (1.0 + NEARLY_AS_GOOD);
    found.retain(|of| priced(of) <= most);
}

/// What turning costs by the direction across the passes, as `[m, c, s]` of a [`Site`]; `curvature` is that
/// along them.
pub(super) fn turning(prices: &Prices<'_>, curvature: impl Fn(f64) -> f64) -> [f64; 3] {
    let mut turning = [0.0; 3];
    for k in 0..CURVED {
        let angle = PI * k as f64 / CURVED as f64;
        let price = (prices.turning)(curvature(angle)) / CURVED as f64;
        let (sin, cos) = (2.0 * angle).sin_cos();
        turning = [turning[0] + price, turning[1] + 2.0 * price * cos, turning[2] + 2.0 * price * sin];
    }
    turning
}

/// The search for the stream function of one chart.
pub(super) struct Search<'a> {
    pub chart: &'a Chart<'a>,
    pub cutter: &'a Cutter,
    pub step: Step,
    pub prices: Prices<'a>,
    /// A direction and how much dearer passes square to it are.
    pub toward: Option<(&'a FeedDirection, f64)>,
    /// Fronts of borders, of which the first are gone on from.
    pub fronts: &'a [StartedFront],
    pub monitor: &'a dyn Monitor,
}

/// A function that was found.
pub(super) struct Found {
    pub function: ScalarField,
    /// The length that it promises, mm.
    pub length: f64,
    /// The border that its passes run along from end to end: which parameter is constant there (0: u, 1: v),
    /// and whether it is the least (0) or the greatest (1).
    pub along: Option<Border>,
}

/// The border where the parameter (0: u, 1: v) is least (0) or greatest (1).
pub(super) type Border = (usize, usize);

/// A net of control points with the sites that its functions are judged at.
#[derive(Clone)]
struct Net {
    knots: [KnotVector; 2],
    sites: Vec<Site>,
    /// On which border each site lies.
    borders: Vec<Option<Border>>,
    /// The parameters of each site.
    places: Vec<[f64; 2]>,
    gradients: Gradients,
    roughness: Roughness,
    /// The front to which functions are put, and the ties of their control points; `None` for functions by
    /// themselves.
    put_to: Option<(GridField, Tied)>,
}

impl Search<'_> {
    /// The best stream functions, the most promising first.
    pub fn run(&self) -> Result<Vec<Found>, PlanError> {
        let sides = self.sides();
        let finest = SPAN_OVER_RADIUS * self.cutter.radius();
        let longest = (sides[0].max(sides[1]) / finest).clamp(SPANS[0] as f64, SPANS[1] as f64);
        let mut counts = vec![longest];
        while counts[counts.len() - 1] > COARSEST as f64 {
            counts.push(0.5 * counts[counts.len() - 1]);
        }
        let unfit = || PlanError::NotApplicable {
            strategy: "streamline",
            reason: "no stream function of least length was found; use another direction".into(),
        };
        self.monitor
            .start("searching directions", (STARTS + self.fronts.len().min(FRONTS) + counts.len()) as u64);
        let finest = self.net(longest, sides).ok_or_else(unfit)?;
        let end = self.prices.end;
        let minimise = |net: &Net, start: Vec<f64>, rounds: Rounds| {
            let found = self.minimise(net, start, end, rounds);
            self.monitor.advance(1);
            found
        };
        // Straight passes on a coarse net first; fronts are good already, and lose by coarse nets.
        let mut net = self.net(counts.pop().unwrap_or(longest), sides).ok_or_else(unfit)?;
        let straight = parallel::try_map(STARTS, |k| {
            minimise(&net, self.straight(&net, sides, PI * k as f64 / STARTS as f64), Rounds::First)
        })?;
        let best = straight.into_iter().flatten().min_by(|a, b| a.priced(end).total_cmp(&b.priced(end)));
        let mut best = best.ok_or_else(unfit)?;
        while let Some(count) = counts.pop() {
            best = minimise(&net, best.coefficients, Rounds::Last)?.ok_or_else(unfit)?;
            let spline = net.spline(best.coefficients).ok_or_else(unfit)?;
            net = self.net(count, sides).ok_or_else(unfit)?;
            best.coefficients =
                net.coefficients(|u, v| spline.value_and_gradient(u, v)[0]).ok_or_else(unfit)?;
        }
        let best = minimise(&net, best.coefficients, Rounds::Last)?;
        let fronts = parallel::try_map(self.fronts.len().min(FRONTS), |k| {
            let front = &self.fronts[k];
            let Some((net, start)) = finest.beside(front) else { return Ok(None) };
            let found = minimise(&net, start, Rounds::Last)?;
            Ok::<_, Cancelled>(found.map(|found| (found, net, front.border)))
        })?;
        let fitted = self.fitted(&finest)?;
        let fitted = fitted.map(|start| minimise(&finest, start, Rounds::Last)).transpose()?.flatten();
        let free = [best, fitted].into_iter().flatten().map(|found| (found, finest.clone(), None));
        let mut found: Vec<(Packed, Net, Option<Border>)> =
            fronts.into_iter().flatten().chain(free).collect();
        keep_promising(&mut found, end, |found| &found.0, |a, b| a.2 == b.2);
        for k in 0..found.len() {
            let (packed, net, along) = &found[k];
            if let Some(drawn) = self.drawn_in(net, packed, end)? {
                found.push((drawn, net.clone(), *along));
            }
        }
        let function = |(packed, net, along): (Packed, Net, Option<Border>)| {
            let length = packed.cost - packed.turning + packed.ends;
            Some(Found { function: net.function(&packed)?, length, along })
        };
        Ok(found.into_iter().filter_map(function).collect())
    }

    /// The function fitted to the direction to keep to, as a start; `None` without one.
    fn fitted(&self, net: &Net) -> Result<Option<Vec<f64>>, PlanError> {
        let Some((direction, _)) = self.toward else { return Ok(None) };
        let fit = streamline::fitted_to(self.chart, self.cutter, direction, self.step)?;
        Ok(net.coefficients(|u, v| fit.value_and_gradient(u, v)[0]))
    }

    /// Minimises from `start`, where each end of a pass costs `end`, mm.
    fn minimise(
        &self,
        net: &Net,
        start: Vec<f64>,
        end: f64,
        rounds: Rounds,
    ) -> Result<Option<Packed>, Cancelled> {
        field::minimise(&net.sites, &net.gradients, &net.roughness, end, start, rounds, self.monitor)
    }

    /// A function like the one found, of a whole number of passes: what is left over would be another pass.
    /// `None` where nothing is, or where it does not give way.
    fn drawn_in(&self, net: &Net, found: &Packed, end: f64) -> Result<Option<Packed>, Cancelled> {
        let whole = found.passes.floor();
        let [below, above] = WHOLE;
        if whole < 1.0 || found.passes - whole <= above {
            return Ok(None);
        }
        let (mut last, mut price) = ((end, found.passes), DEARER * end);
        for _ in 0..PRICES {
            let Some(next) = self.minimise(net, found.coefficients.clone(), price, Rounds::Last)? else {
                break;
            };
            if next.passes <= whole + above && next.passes > whole - below {
                return Ok(Some(next));
            }
            let slope = (next.passes - last.1) / (price - last.0);
            let wanted = price + (whole - next.passes) / slope;
            last = (price, next.passes);
            let grown = if slope < 0.0 { wanted.clamp(0.5 * price, 2.0 * price) } else { 1.5 * price };
            price = if grown == price { DEARER * price } else { grown };
        }
        Ok(None)
    }

    /// Lengths of the chart through its middle, along u and v, mm.
    fn sides(&self) -> [f64; 2] {
        let [[u0, u1], [v0, v1]] = self.chart.domain;
        let (u, v) = (0.5 * (u0 + u1), 0.5 * (v0 + v1));
        const PIECES: usize = 64;
        let at = |lo: f64, hi: f64, k: usize| lo + (hi - lo) * k as f64 / PIECES as f64;
        let length = |point: &dyn Fn(usize) -> [f64; 2]| {
            let place = |k: usize| self.chart.jet(point(k)[0], point(k)[1]).p;
            (0..PIECES).map(|k| (place(k + 1) - place(k)).norm()).sum::<f64>()
        };
        [length(&|k| [at(u0, u1, k), v]), length(&|k| [u, at(v0, v1, k)])]
    }

    /// The net with so many spans along the longer side.
    fn net(&self, spans: f64, sides: [f64; 2]) -> Option<Net> {
        let longer = sides[0].max(sides[1]);
        let knots = [0, 1].map(|c| {
            let spans = (spans * sides[c] / longer).ceil().max(4.0) as usize;
            KnotVector::clamped_uniform(DEGREE, spans + DEGREE, self.chart.domain[c])
        });
        let [Ok(knots_u), Ok(knots_v)] = knots else { return None };
        let at = |knots: &KnotVector| {
            let breaks = knots.breaks();
            let places = |w: &[f64]| GAUSS.map(|t| (w[0] + t * (w[1] - w[0]), 0.5 * (w[1] - w[0])));
            breaks.windows(2).flat_map(places).collect::<Vec<_>>()
        };
        let (us, vs) = (at(&knots_u), at(&knots_v));
        let mut sites = parallel::map(us.len() * vs.len(), |k| {
            let ((u, du), (v, dv)) = (us[k % us.len()], vs[k / us.len()]);
            Some((u, v, self.site(u, v, du * dv, [0.0; 2])?, None))
        });
        let [ends_u, ends_v] = self.chart.domain;
        for end in 0..2 {
            sites.extend(us.iter().map(|&(u, du)| {
                Some((u, ends_v[end], self.site(u, ends_v[end], 0.0, [du, 0.0])?, Some((1, end))))
            }));
            sites.extend(vs.iter().map(|&(v, dv)| {
                Some((ends_u[end], v, self.site(ends_u[end], v, 0.0, [0.0, dv])?, Some((0, end))))
            }));
        }
        let nu = knots_u.control_count();
        let mut gradients = Gradients::new(nu * knots_v.control_count());
        let (mut kept, mut borders, mut places) = (Vec::new(), Vec::new(), Vec::new());
        let mut roughness = Roughness::default();
        let (area, passes) = sites.iter().flatten().fold((0.0, 0.0), |(area, passes), (_, _, site, _)| {
            (area + site.area, passes + site.area * site.front.mean_slowness())
        });
        let bend = BEND * self.cutter.radius().powi(2) * area / passes;
        for (u, v, site, border) in sites.into_iter().flatten() {
            let (i, [bu, su, tu]) = knots_u.basis_derivatives(u, 2);
            let (j, [bv, sv, tv]) = knots_v.basis_derivatives(v, 2);
            let terms = (0..=DEGREE).flat_map(|b| (0..=DEGREE).map(move |a| (a, b)));
            let derivatives = |(a, b): (usize, usize)| {
                let second = [tu[a] * bv[b], su[a] * sv[b], bu[a] * tv[b]];
                (((j + b) * nu + i + a) as u32, [su[a] * bv[b], bu[a] * sv[b]], second)
            };
            let terms: Vec<_> = terms.map(derivatives).collect();
            gradients.push(&site, terms.iter().map(|&(k, first, _)| (k, first)));
            if let Some(components) =
                self.chart.at(u, v).filter(|_| site.area > 0.0).and_then(|p| hessian(&p))
            {
                for (share, [first, second]) in components {
                    let row = terms.iter().map(|(k, d1, d2)| (*k, dot(&first, d1) + dot(&second, d2)));
                    roughness.push(bend * site.area * share, row);
                }
            }
            kept.push(site);
            borders.push(border);
            places.push([u, v]);
        }
        let knots = [knots_u, knots_v];
        Some(Net { knots, sites: kept, borders, places, gradients, roughness, put_to: None })
    }

    /// What passes may do and cost at a place that stands for an area in parameters, or for a step along a
    /// border.
    fn site(&self, u: f64, v: f64, area: f64, along: [f64; 2]) -> Option<Site> {
        let front = front_at(self.chart, self.cutter, self.step, u, v)?;
        let p = self.chart.at(u, v)?;
        let (e, f, g) = p.jet.first_form();
        let wanted = self.toward.and_then(|(direction, dearer)| {
            let (tangent, matters) = p.feed(direction, self.cutter)?;
            Some((tangent, dearer * matters))
        });
        let costs = [0, 1, 2].map(|k| {
            let [du, dv] = front.vector(PI * k as f64 / 3.0);
            let feed = (p.jet.du * du + p.jet.dv * dv).cross(&p.normal);
            let away =
                wanted.map_or(0.0, |(direction, dearer)| dearer * (1.0 - feed.dot(&direction).powi(2)));
            1.0 - p.curvature_along(&feed) * self.cutter.corner_radius() + away
        });
        let mut cost = Site::harmonic(costs);
        let turning = turning(&self.prices, |angle| {
            let [du, dv] = front.vector(angle);
            p.curvature_along(&(p.jet.du * du + p.jet.dv * dv).cross(&p.normal))
        });
        (0..3).for_each(|k| cost[k] += turning[k]);
        let border = (along != [0.0; 2]).then(|| front.components(along));
        let area = area * (e * g - f * f).max(0.0).sqrt();
        let leaving = wanted.map_or(0.0, |(_, dearer)| Site::mean_of_leaving(dearer));
        Some(Site { area, stiff_area: area, front, cost, turning, leaving, border })
    }

    /// Coefficients of ψ for straight passes, as dense on the whole as the strips ask for.
    fn straight(&self, net: &Net, sides: [f64; 2], angle: f64) -> Vec<f64> {
        let area: f64 = net.sites.iter().map(|site| site.area).sum();
        let passes = net.sites.iter().map(|site| site.area * site.front.mean_slowness()).sum::<f64>() / area;
        let (sin, cos) = angle.sin_cos();
        let shares = [0, 1].map(|c| {
            let [lo, hi] = net.knots[c].domain();
            net.knots[c].averages().map(|x| (x - lo) / (hi - lo)).collect::<Vec<f64>>()
        });
        let along_u = |t: f64| passes * sides[0] * cos * t;
        let along_v = |t: f64| passes * sides[1] * sin * t;
        shares[1].iter().flat_map(|&v| shares[0].iter().map(move |&u| along_u(u) + along_v(v))).collect()
    }
}

/// What the second derivatives along two tangents square to each other take of a function's first and second
/// derivatives by the parameters, less those of the surface itself: a share of the sum of their squares, and
/// the factors.
fn hessian(p: &ChartPoint) -> Option<[(f64, [Vec<f64>; 2]); 3]> {
    let e1 = p.jet.du.try_normalize(1e-300)?;
    let (a, b) = (p.jet.pull_back(&e1)?, p.jet.pull_back(&p.normal.cross(&e1))?);
    let own = [p.jet.pull_back(&p.jet.duu)?, p.jet.pull_back(&p.jet.duv)?, p.jet.pull_back(&p.jet.dvv)?];
    let along = |x: (f64, f64), y: (f64, f64)| {
        let second = vec![x.0 * y.0, x.0 * y.1 + x.1 * y.0, x.1 * y.1];
        let first = [own.map(|o| o.0), own.map(|o| o.1)].map(|o| -dot(&second, &o));
        [first.to_vec(), second]
    };
    Some([(1.0, along(a, a)), (1.0, along(b, b)), (2.0, along(a, b))])
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl Net {
    fn spline(&self, coefficients: Vec<f64>) -> Option<ScalarSpline> {
        let [u, v] = self.knots.clone();
        ScalarSpline::new(u, v, coefficients)
    }

    fn function(&self, found: &Packed) -> Option<ScalarField> {
        Some(match &self.put_to {
            None => ScalarField::Spline(self.spline(found.coefficients.clone())?),
            Some((front, tied)) => {
                ScalarField::Corrected(front.clone(), self.spline(tied.coefficients(&found.coefficients))?)
            }
        })
    }

    /// The control points on a border.
    fn controls(&self, (parameter, end): Border) -> impl Iterator<Item = usize> {
        let [nu, nv] = [0, 1].map(|c| self.knots[c].control_count());
        let at = end * (if parameter == 0 { nu } else { nv } - 1);
        (0..if parameter == 0 { nv } else { nu })
            .map(move |k| if parameter == 0 { k * nu + at } else { at * nu + k })
    }

    /// The functions beside a front, with itself: constant along the border of its start, and along the one
    /// across where it reaches that nearly at once. Passes have no ends there.
    fn beside(&self, front: &StartedFront) -> Option<(Self, Vec<f64>)> {
        let border = front.border?;
        let across = (border.0, 1 - border.1);
        let [us, vs] = [0, 1].map(|c| self.knots[c].averages().collect::<Vec<f64>>());
        let nu = us.len();
        let reached = |k: usize| (k, front.field.value_and_gradient(us[k % nu], vs[k / nu])[0]);
        let reached: Vec<(usize, f64)> = self.controls(across).map(reached).collect();
        let [lo, hi] = reached
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], (_, x)| [lo.min(*x), hi.max(*x)]);
        let mut tied =
            Tied { offsets: vec![0.0; nu * vs.len()], unknowns: vec![Some(0); nu * vs.len()], count: 1 };
        let mut held = vec![border];
        if hi - lo <= REACHED {
            let mean = reached.iter().map(|(_, x)| x).sum::<f64>() / reached.len() as f64;
            for (k, x) in reached {
                (tied.offsets[k], tied.unknowns[k]) = (mean - x, Some(1));
            }
            tied.count += 1;
            held.push(across);
        }
        self.controls(border).for_each(|k| (tied.offsets[k], tied.unknowns[k]) = (0.0, None));
        for unknown in tied.unknowns.iter_mut().filter(|unknown| **unknown == Some(0)) {
            *unknown = Some(tied.count as u32);
            tied.count += 1;
        }
        let given = |(site, &[u, v]): (&Site, &[f64; 2])| {
            let [_, by_u, by_v] = front.field.value_and_gradient(u, v);
            site.front.covector([by_u, by_v])
        };
        let given: Vec<[f64; 2]> = self.sites.iter().zip(&self.places).map(given).collect();
        let start = tied.given();
        let mut net = Self {
            gradients: self.gradients.tied(&tied, &given),
            roughness: self.roughness.tied(&tied),
            put_to: Some((front.field.clone(), tied)),
            ..self.clone()
        };
        for (site, border) in net.sites.iter_mut().zip(&net.borders) {
            if border.is_some_and(|border| held.contains(&border)) {
                site.border = None;
            }
        }
        Some((net, start))
    }

    /// Coefficients of the spline that has the values of a function at the averages of its knots.
    fn coefficients(&self, function: impl Fn(f64, f64) -> f64) -> Option<Vec<f64>> {
        let [u, v] = self.knots.clone();
        let mut equations = NormalEquations::new(u, v);
        let value = [[1.0, 0.0, 0.0], [0.0; 3], [0.0; 3]];
        for y in self.knots[1].averages() {
            for x in self.knots[0].averages() {
                equations.add(x, y, &value, function(x, y), 1.0);
            }
        }
        equations.solve(false).ok().map(|spline| spline.coefficients().to_vec())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::levels::obedience;
    use crate::levels::spacing::level_tangent;
    use crate::strategies::iso_scallop::{arrival, places, predicted_length};
    use geometry::{NurbsSurface, Point3};
    use std::sync::Arc;
    use work::monitor::Silent;

    /// `z = twist x y` over 20 × 17 mm.
    fn saddle(twist: f64) -> NurbsSurface {
        let at = |i: usize, side: f64| side * (i as f64 / 3.0 - 0.5);
        let point =
            |i: usize, j: usize| Point3::new(at(i, 20.0), at(j, 17.0), twist * at(i, 20.0) * at(j, 17.0));
        let net: Vec<Vec<Point3>> = (0..4).map(|i| (0..4).map(|j| point(i, j)).collect()).collect();
        let knots = vec![0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0];
        NurbsSurface::new(3, 3, knots.clone(), knots, &net, None).unwrap()
    }

    const PRICES: Prices<'_> = Prices { end: 1.5, turning: &|curvature| 2.0 * curvature.abs() };

    /// What is left over of the last pass is drawn in, for less than that pass would cost.
    #[test]
    fn a_number_of_passes_is_drawn_in_to_a_whole_one() {
        let (surface, cutter) = (saddle(0.05), Cutter::ball(18.0).unwrap());
        let chart = Chart::of_surface(&surface, crate::vocabulary::Guide::default());
        let step = Step::Scallop(0.01);
        let search = Search {
            chart: &chart,
            cutter: &cutter,
            step,
            prices: PRICES,
            toward: None,
            fronts: &[],
            monitor: &Silent,
        };
        let net = search.net(8.0, search.sides()).unwrap();
        let start = search.straight(&net, search.sides(), 0.25 * PI);
        let end = PRICES.end;
        let first = search.minimise(&net, start, end, Rounds::First).unwrap().unwrap();
        let found = search.minimise(&net, first.coefficients, end, Rounds::Last).unwrap().unwrap();
        let drawn = search.drawn_in(&net, &found, end).unwrap().unwrap();
        let (passes, whole) = (found.passes, drawn.passes);
        assert!(whole <= passes.floor() + WHOLE[1] && whole > passes.floor() - WHOLE[0], "{passes} {whole}");
        let pass = found.cost / passes;
        assert!(drawn.cost < found.cost + 0.5 * pass, "{} {} {pass}", drawn.cost, found.cost);
        assert!(drawn.short < 0.01);
    }

    /// What goes on from a front has the front's passes to begin with, runs along its whole border, and is no
    /// longer than the front.
    #[test]
    fn a_function_beside_a_front_keeps_its_border_and_is_no_longer() {
        let (surface, cutter) = (saddle(0.03), Cutter::ball(18.0).unwrap());
        let chart = Chart::of_surface(&surface, crate::vocabulary::Guide::default());
        let (step, prices) = (Step::Scallop(0.01), Prices { end: 1.0, turning: &|_| 0.0 });
        let search = Search {
            chart: &chart,
            cutter: &cutter,
            step,
            prices,
            toward: None,
            fronts: &[],
            monitor: &Silent,
        };
        let net = search.net(10.0, search.sides()).unwrap();
        let places = places(&chart, 60);
        for border in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let corner = |other: usize| {
                let mut at = [chart.domain[border.0][border.1]; 2];
                at[1 - border.0] = chart.domain[1 - border.0][other];
                at
            };
            let field =
                arrival(&chart, &cutter, step, &[vec![corner(0), corner(1)]], false, &Silent).unwrap();
            let front = StartedFront { name: "", border: Some(border), field, predicted: 0.0 };
            let (beside, start) = net.beside(&front).unwrap();
            let (_, tied) = beside.put_to.as_ref().unwrap();
            assert!(tied.coefficients(&start).iter().all(|put_to| put_to.abs() <= 0.5 * REACHED));
            let found = search.minimise(&beside, start, prices.end, Rounds::Last).unwrap().unwrap();
            let psi = beside.function(&found).unwrap();
            for k in 0..=20 {
                let t = f64::from(k) / 20.0;
                let at = [0, 1].map(|c| corner(0)[c] + t * (corner(1)[c] - corner(0)[c]));
                assert!(psi.value_and_gradient(at[0], at[1])[0].abs() < 1e-9, "{border:?} {t}");
            }
            let alone = predicted_length(&places, &cutter, step, &ScalarField::Grid(front.field));
            let length = found.cost - found.turning;
            assert!(
                length < 1.002 * alone && found.short < 0.01,
                "{border:?} {length} {alone} {}",
                found.short
            );
        }
    }

    /// Circles about the middle of a part are no front of a border, and straight passes are a minimum of
    /// their own, 23 degrees off and more: the function fitted to the circles is where the search has to
    /// start.
    #[test]
    fn circles_are_kept_to_where_leaving_them_is_dear() {
        let (surface, cutter) = (saddle(0.03), Cutter::ball(6.0).unwrap());
        let chart = Chart::of_surface(&surface, crate::vocabulary::Guide::default());
        let circle = |k: usize| {
            let (x, y) = (-10.0 + (k % 21) as f64, -8.5 + 0.85 * (k / 21) as f64);
            field::LineSample { at: [x, y], line: [-y, x + 1e-9], weight: 1.0 }
        };
        let samples: Vec<_> = (0..441).map(circle).collect();
        let samples = field::LineField::new(field::SamplePlane::Plan, &samples).unwrap();
        let direction = FeedDirection::Samples(Arc::new(samples));
        for dearer in [10.0, 100.0, 1000.0] {
            let (step, toward) = (Step::Scallop(0.01), Some((&direction, dearer)));
            let search = Search {
                chart: &chart,
                cutter: &cutter,
                step,
                prices: PRICES,
                toward,
                fronts: &[],
                monitor: &Silent,
            };
            let psi = search.run().unwrap().swap_remove(0).function;
            let off = |[u, v]: [f64; 2]| {
                let p = chart.at(u, v)?;
                let (asked, matters) = p.feed(&direction, &cutter)?;
                Some((obedience::off(&level_tangent(&p, &psi, [u, v])?, &p.normal, &asked), matters))
            };
            // In the middle, where circles have no direction, it matters little.
            let off: Vec<(f64, f64)> = chart.grid(41).filter_map(off).collect();
            let weights: f64 = off.iter().map(|(_, matters)| matters).sum();
            let squares: f64 = off.iter().map(|(angle, matters)| matters * angle.powi(2)).sum();
            let rms = (squares / weights).sqrt().to_degrees();
            println!("{dearer}: {rms}");
            assert!(rms <= 3.0, "{dearer}: {rms} degrees");
        }
    }
}
