//! Streamlines along the feed directions that make the whole path shortest.
//!
//! A pass costs `1 − κ_f r` mm of the cutter's way for each mm along the surface (κ_f its curvature along the feed, r the
//! cutter's corner radius) and serves a strip of width w(direction). No path that holds the scallop is shorter than
//! the integral of the least `(1 − κ_f r)/w` over all directions: [`shortest_possible`]. Directions that reach it
//! everywhere seldom belong to passes that also lie one strip apart. The stream function that costs least in all
//! ([`field::minimise`]) settles between both: a B-spline, from straight passes in several directions on a coarse net,
//! the best of them refined.
//!
//! What a machine has to turn counts as a little length: along passes that the surface bends, and at their ends.
//!
//! Fronts from the four borders are further starts, because each start leads to a minimum of its own. Where an
//! iso-scallop path is shorter than the best of them, it is taken.
//!
//! Stiffness of ψ alone would leave passes where the surface bends most, since the cutter's way is shortest there. It does not
//! see that each further pass costs half a turn. So turning has a price. The remainder of the last pass is drawn in to a
//! whole number of passes by a higher price of ends; the shorter of both paths is taken.
//!
//! Enters: a part and the scallop height. Leaves: passes. Lengths in mm.

use std::f64::consts::PI;
use std::fmt::{self, Write as _};
use std::sync::Arc;

use super::direction_keys;
use super::iso_scallop::{front_at, on_chart, places};
use super::mesh_passes::{self, Aim};
use super::streamline;
use crate::levels::level_passes::{along_earlier, along_levels};
use crate::levels::{obedience, planned_field};
use crate::strategies::iso_scallop::FrontStart;
use crate::surface::chart::{Chart, ChartPoint};
use crate::surface::feed;
use crate::vocabulary::{
    Definition, FeedDirection, LevelFunction, Levelled, Passes, PlanError, Step, Strategy, Task,
};
use cutter::Cutter;
use field::{
    Gradients, NormalEquations, Packed, Roughness, Rounds, ScalarField, ScalarSpline, ShortestPossible, Site,
    Start, eikonal, minimise_priced,
};
use geometry::{KnotVector, Vector3};
use keys::toml_number;
use part::Part;
use work::monitor::{Cancelled, Monitor};
use work::parallel;

/// Spans of the spline's knots are this many of the cutter's radii long. Features that a cutter fits into are wider; finer
/// nets gain a few tenths of a per cent.
const SPAN_OVER_RADIUS: f64 = 0.6;

/// Fewest and most spans a side. Time grows with their product.
const SPANS: [usize; 2] = [8, 72];

/// Spans of the coarsest net, on which directions are tried, along the longer side.
const COARSEST: usize = 16;

/// Straight passes to start from, over half a turn.
const STARTS: usize = 8;

/// Nodes a side of the fronts to start from.
const FRONT_NODES: usize = 41;

/// Gauss's points of each span and side.
const GAUSS: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];

const DEGREE: usize = 3;

/// Where a pass bends by the radius of the cutter, it counts as longer by this share. Without it passes on a twisted patch
/// turn by half as much again, and are longer, since there are more minima to end in.
const BEND: f64 = 0.25;

/// What a rad counts for that passes turn by since the surface is bent along them, in radii of the cutter.
const TURN: f64 = 0.78;

/// Directions over half a turn by which the curvature along them is told.
const CURVED: usize = 12;

/// What an end of a pass counts, in radii of the cutter: half of the link to the next pass and its turn.
const END: f64 = 0.28;

/// A number of passes is drawn in to a whole one by a greater price of ends, first by this factor, so often corrected; it
/// shall end within this share of a pass below, or a little above, which levels allow for.
const DEARER: f64 = 1.25;
const PRICES: usize = 4;
const WHOLE: [f64; 2] = [0.3, 0.1];

/// Places a side, and directions over half a turn, of the shortest possible length. With twice as many it changes by
/// less than 0.1 % on the shipped parts.
const PLACES: usize = 150;
const DIRECTIONS: usize = 36;

/// The shortest possible path below the scallop height `h`, mm, by the widest strip over all directions at each place.
///
/// # Errors
/// When no smooth surface can be fitted to a mesh.
pub fn shortest_possible(part: &Part, cutter: &Cutter, h: f64) -> Result<ShortestPossible, PlanError> {
    let mut sum = ShortestPossible { cutting_mm: 0.0, contact_mm: 0.0, limited_fraction: 0.0 };
    let mut total = 0.0;
    for chart in Chart::all(part, cutter, crate::vocabulary::Guide::default())? {
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

/// Streamlines of the feed directions with the shortest path: each one strip from the next, their first curve searched.
#[derive(Debug, Clone, PartialEq)]
pub struct ShortestStreamline {
    /// A direction to keep to, and how much dearer a mm of pass square to it is, in mm: 0 leaves all freedom, a great number
    /// none.
    pub toward: Option<(FeedDirection, f64)>,
}

impl Strategy for ShortestStreamline {
    fn definition(&self) -> &'static Definition {
        &super::streamline::DEFINITION
    }

    fn write(&self, out: &mut String) -> fmt::Result {
        let Some((toward, dearer)) = &self.toward else { return writeln!(out, "direction = \"shortest\"") };
        direction_keys::write(out, toward, "\n")?;
        writeln!(out, "\nfollow = {}  # mm more for each mm of pass square to it", toml_number(*dearer))
    }

    fn passes(&self, task: &Task<'_>) -> Result<Passes, PlanError> {
        let toward = self.toward.as_ref().map(|(direction, dearer)| (direction, *dearer));
        if self.on_facets(task) {
            mesh_passes::on_mesh(task, Aim::Shortest(toward))
        } else {
            passes(task, toward)
        }
    }

    fn on_facets(&self, task: &Task<'_>) -> bool {
        task.plans_on_mesh()
    }

    fn shows_field(&self) -> bool {
        true
    }

    fn direction_mut(&mut self) -> Option<&mut FeedDirection> {
        self.toward.as_mut().map(|(direction, _)| direction)
    }
}

/// Plans passes along the stream function with the shortest path.
fn passes(task: &Task<'_>, toward: Option<(&FeedDirection, f64)>) -> Result<Passes, PlanError> {
    let Task { part, cutter, ref settings, .. } = *task;
    let charts = Chart::all(part, cutter, settings.guide())?;
    let mut all = Passes::default();
    if let Some((direction, _)) = toward {
        let parameters: Vec<_> = charts.iter().map(|chart| chart.domain).collect();
        all.notes.extend(feed::check(direction, part, &parameters)?);
    }
    for (k, chart) in charts.iter().enumerate() {
        let toward = match toward {
            Some((direction, dearer)) => Some((feed::on_chart(direction, chart, cutter)?, dearer)),
            None => None,
        };
        let toward = toward.as_ref().map(|(direction, dearer)| (&**direction, *dearer));
        let mut planned = match task.earlier_on_chart(k, charts.len()) {
            Some((field, levelled)) => along_earlier(task, chart, field, levelled)?,
            None => searched(task, chart, toward)?,
        };
        if let Some((direction, _)) = toward {
            planned_field::set_directions(&mut planned.field, part, chart, |[u, v]| {
                chart.at(u, v)?.feed(direction, cutter)
            });
            obedience::compare_on_chart(&mut planned.contacts, chart, direction, cutter);
        }
        all.append(planned);
    }
    Ok(all)
}

/// Passes along the best function of one chart, which is searched.
fn searched(
    task: &Task<'_>,
    chart: &Chart,
    toward: Option<(&FeedDirection, f64)>,
) -> Result<Passes, PlanError> {
    let Task { cutter, ref settings, monitor, .. } = *task;
    let search = Search { chart, cutter, step: settings.step, toward, monitor };
    let mut all_planned = Vec::new();
    for (spline, promised) in search.run()? {
        let field = ScalarField::Spline(spline);
        all_planned.push((along_levels(task, chart, &field)?, field, promised));
    }
    // With a direction to keep to, the best comes first: a shorter path may be one that leaves the direction.
    if toward.is_none() {
        all_planned.sort_by(|(a, ..), (b, ..)| a.length().total_cmp(&b.length()));
    }
    let Some((mut planned, field, promised)) = all_planned.into_iter().next() else {
        return Ok(Passes::default());
    };
    let worth = planned.length();
    let told = toward.is_none().then(|| (SHORTEST.to_owned(), promised));
    let function = LevelFunction::Chart(Arc::new(field));
    Levelled { function, planned_as: SEARCHED.into(), told }.put_with(&mut planned);
    if toward.is_some() {
        return Ok(planned);
    }
    // A front whose passes run along two whole borders, or are packed without any slack, may still be shorter.
    match on_chart(task, chart, FrontStart::BestBorder, worth) {
        Ok(front) if !front.passes.is_empty() && front.length() < worth => Ok(front),
        Err(PlanError::Cancelled(cancelled)) => Err(cancelled.into()),
        _ => Ok(planned),
    }
}

/// What such a function is.
pub(crate) const SEARCHED: &str = "stream function, searched";

/// What the user is told of passes along such a function.
pub(crate) const SHORTEST: &str = "passes follow the stream function of the shortest path";

/// Borders that fronts start from.
const BORDERS: [(usize, usize); 4] = [(0, 0), (0, 1), (1, 0), (1, 1)];

/// The search for the stream function of one chart.
struct Search<'a> {
    chart: &'a Chart<'a>,
    cutter: &'a Cutter,
    step: Step,
    /// A direction and how much dearer passes square to it are.
    toward: Option<(&'a FeedDirection, f64)>,
    monitor: &'a dyn Monitor,
}

/// A net of control points with the sites that its functions are judged at.
struct Net {
    knots: [KnotVector; 2],
    sites: Vec<Site>,
    gradients: Gradients,
    roughness: Roughness,
}

impl Search<'_> {
    /// The best stream functions and the lengths that they promise, mm.
    fn run(&self) -> Result<Vec<(ScalarSpline, f64)>, PlanError> {
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
        self.monitor.start("searching directions", (STARTS + BORDERS.len() + counts.len()) as u64);
        let finest = self.net(longest, sides).ok_or_else(unfit)?;
        let end = END * self.cutter.radius();
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
        let priced = |f: &Packed| f.cost + f.ends + 2.0 * end * f.passes;
        let shortest = |found: Vec<Option<Packed>>| {
            found.into_iter().flatten().min_by(|a, b| priced(a).total_cmp(&priced(b)))
        };
        let mut best = shortest(straight).ok_or_else(unfit)?;
        while let Some(count) = counts.pop() {
            best = minimise(&net, best.coefficients, Rounds::Last)?.ok_or_else(unfit)?;
            let spline = net.spline(&best).ok_or_else(unfit)?;
            net = self.net(count, sides).ok_or_else(unfit)?;
            best.coefficients =
                net.coefficients(|u, v| spline.value_and_gradient(u, v)[0]).ok_or_else(unfit)?;
        }
        let best = minimise(&net, best.coefficients, Rounds::Last)?;
        let fronts = parallel::try_map(BORDERS.len(), |k| {
            let start = self.border_front(&finest, BORDERS[k]);
            let found = start.map(|start| minimise(&finest, start, Rounds::Last)).transpose()?;
            Ok::<_, Cancelled>(found.flatten())
        })?;
        let fitted = self.fitted(&finest)?;
        let fitted = fitted.map(|start| minimise(&finest, start, Rounds::Last)).transpose()?.flatten();
        let mut found: Vec<Packed> = fronts.into_iter().chain([best, fitted]).flatten().collect();
        // Passes along a whole border have no ends there, which the cost of ends does not know: the best without them
        // is planned too.
        let least = |cost: &dyn Fn(&Packed) -> f64| {
            (0..found.len()).min_by(|&a, &b| cost(&found[a]).total_cmp(&cost(&found[b])))
        };
        let best = [least(&priced), least(&|f| f.cost)];
        let mut chosen: Vec<usize> = best.into_iter().flatten().collect();
        chosen.dedup();
        for k in chosen.clone() {
            if let Some(drawn) = self.drawn_in(&finest, &found[k], end)? {
                chosen.push(found.len());
                found.push(drawn);
            }
        }
        let length = |f: &Packed| f.cost - f.turning + f.ends;
        let spline = |k: usize| Some((finest.spline(&found[k])?, length(&found[k])));
        Ok(chosen.into_iter().filter_map(spline).collect())
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
        minimise_priced(&net.sites, &net.gradients, &net.roughness, end, start, rounds, self.monitor)
    }

    /// A function like the one found, of a whole number of passes: what is left over would be another pass. `None` where
    /// nothing is, or where it does not give way.
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
            Some((u, v, self.site(u, v, du * dv, [0.0; 2])?))
        });
        let [ends_u, ends_v] = self.chart.domain;
        for end in 0..2 {
            sites.extend(
                us.iter().map(|&(u, du)| Some((u, ends_v[end], self.site(u, ends_v[end], 0.0, [du, 0.0])?))),
            );
            sites.extend(
                vs.iter().map(|&(v, dv)| Some((ends_u[end], v, self.site(ends_u[end], v, 0.0, [0.0, dv])?))),
            );
        }
        let nu = knots_u.control_count();
        let mut gradients = Gradients::new(nu * knots_v.control_count());
        let mut kept = Vec::with_capacity(sites.len());
        let mut roughness = Roughness::default();
        let (area, passes) = sites.iter().flatten().fold((0.0, 0.0), |(area, passes), (_, _, site)| {
            (area + site.area, passes + site.area * site.front.mean_slowness())
        });
        let bend = BEND * self.cutter.radius().powi(2) * area / passes;
        for (u, v, site) in sites.into_iter().flatten() {
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
                    roughness.push(bend * site.area * share, row.collect());
                }
            }
            kept.push(site);
        }
        Some(Net { knots: [knots_u, knots_v], sites: kept, gradients, roughness })
    }

    /// Coefficients of the front that starts at the border where the parameter (0: u, 1: v) is least (0) or greatest (1).
    fn border_front(&self, net: &Net, (parameter, end): (usize, usize)) -> Option<Vec<f64>> {
        let domain = self.chart.domain;
        let corner = |other: usize| {
            let mut at = [0.0; 2];
            at[parameter] = domain[parameter][end];
            at[1 - parameter] = domain[1 - parameter][other];
            at
        };
        let curves = [vec![corner(0), corner(1)]];
        let front = |u, v| front_at(self.chart, self.cutter, self.step, u, v);
        let start = Start { curves: &curves, signed: false };
        let front = eikonal(domain, [FRONT_NODES; 2], &front, &start, self.monitor).ok()?;
        net.coefficients(|u, v| front.field.value_and_gradient(u, v)[0])
    }

    /// What passes may do and cost at a place that stands for an area in parameters, or for a step along a border.
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
        let mut turning = [0.0; 3];
        for k in 0..CURVED {
            let angle = PI * k as f64 / CURVED as f64;
            let [du, dv] = front.vector(angle);
            let feed = (p.jet.du * du + p.jet.dv * dv).cross(&p.normal);
            let price = TURN * self.cutter.radius() * p.curvature_along(&feed).abs() / CURVED as f64;
            let (sin, cos) = (2.0 * angle).sin_cos();
            turning = [turning[0] + price, turning[1] + 2.0 * price * cos, turning[2] + 2.0 * price * sin];
        }
        (0..3).for_each(|k| cost[k] += turning[k]);
        let border = (along != [0.0; 2]).then(|| front.components(along));
        let area = area * (e * g - f * f).max(0.0).sqrt();
        Some(Site { area, stiff_area: area, front, cost, turning, border })
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

/// What the second derivatives along two tangents square to each other take of a function's first and second derivatives by
/// the parameters, less those of the surface itself: a share of the sum of their squares, and the factors.
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
    fn spline(&self, found: &Packed) -> Option<ScalarSpline> {
        let [u, v] = self.knots.clone();
        ScalarSpline::new(u, v, found.coefficients.clone())
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
    use crate::levels::spacing::level_tangent;
    use crate::vocabulary::OffDirection;
    use geometry::{NurbsSurface, Point3};
    use work::monitor::Silent;

    /// `z = 0.03 x y` over 20 × 17 mm.
    fn saddle() -> NurbsSurface {
        let at = |i: usize, side: f64| side * (i as f64 / 3.0 - 0.5);
        let point =
            |i: usize, j: usize| Point3::new(at(i, 20.0), at(j, 17.0), 0.03 * at(i, 20.0) * at(j, 17.0));
        let net: Vec<Vec<Point3>> = (0..4).map(|i| (0..4).map(|j| point(i, j)).collect()).collect();
        let knots = vec![0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0];
        NurbsSurface::new(3, 3, knots.clone(), knots, &net, None).unwrap()
    }

    /// What is left over of the last pass is drawn in, for less than that pass would cost.
    #[test]
    fn a_number_of_passes_is_drawn_in_to_a_whole_one() {
        let (surface, cutter) = (saddle(), Cutter::ball(18.0).unwrap());
        let chart = Chart::of_surface(&surface, crate::vocabulary::Guide::default());
        let step = Step::Scallop(0.01);
        let search = Search { chart: &chart, cutter: &cutter, step, toward: None, monitor: &Silent };
        let net = search.net(8.0, search.sides()).unwrap();
        let start = search.straight(&net, search.sides(), 0.25 * PI);
        let end = END * cutter.radius();
        let first = search.minimise(&net, start, end, Rounds::First).unwrap().unwrap();
        let found = search.minimise(&net, first.coefficients, end, Rounds::Last).unwrap().unwrap();
        let drawn = search.drawn_in(&net, &found, end).unwrap().unwrap();
        let (passes, whole) = (found.passes, drawn.passes);
        assert!(whole <= passes.floor() + WHOLE[1] && whole > passes.floor() - WHOLE[0], "{passes} {whole}");
        let pass = found.cost / passes;
        assert!(drawn.cost < found.cost + 0.5 * pass, "{} {} {pass}", drawn.cost, found.cost);
        assert!(drawn.short < 0.01);
    }

    /// Circles about the middle of a part are no front of a border, and straight passes are a minimum of their own, 23 degrees
    /// off and more: the function fitted to the circles is where the search has to start.
    #[test]
    fn circles_are_kept_to_where_leaving_them_is_dear() {
        let (surface, cutter) = (saddle(), Cutter::ball(6.0).unwrap());
        let chart = Chart::of_surface(&surface, crate::vocabulary::Guide::default());
        let circle = |k: usize| {
            let (x, y) = (-10.0 + (k % 21) as f64, -8.5 + 0.85 * (k / 21) as f64);
            field::LineSample { at: [x, y], line: [-y, x + 1e-9], weight: 1.0 }
        };
        let samples: Vec<_> = (0..441).map(circle).collect();
        let samples = field::LineField::new(field::SamplePlane::Plan, &samples).unwrap();
        let direction = FeedDirection::Samples(Arc::new(samples));
        for dearer in [10.0, 100.0] {
            let (step, toward) = (Step::Scallop(0.01), Some((&direction, dearer)));
            let search = Search { chart: &chart, cutter: &cutter, step, toward, monitor: &Silent };
            let (psi, _) = search.run().unwrap().swap_remove(0);
            let psi = ScalarField::Spline(psi);
            let off = |[u, v]: [f64; 2]| {
                let p = chart.at(u, v)?;
                let (asked, matters) = p.feed(&direction, &cutter)?;
                let across = p.normal.cross(&level_tangent(&p, &psi, [u, v])?);
                Some(OffDirection::new(&across, &p.normal, &asked, matters))
            };
            // In the middle, where circles have no direction, it matters little.
            let off: Vec<OffDirection> = chart.grid(41).filter_map(off).collect();
            let weights: f64 = off.iter().map(|off| off.matters).sum();
            let squares: f64 = off.iter().map(|off| off.matters * off.angle.powi(2)).sum();
            let rms = (squares / weights).sqrt().to_degrees();
            assert!(rms <= 3.0, "{dearer}: {rms} degrees");
        }
    }
}
