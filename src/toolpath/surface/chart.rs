//! The part as planners see it: smooth surfaces over parameter rectangles.
//!
//! Patches are planned on as they are. A mesh has no curvature, so a bicubic B-spline height surface z(x, y)
//! is fitted to it; directions and distances of passes come from that surface, while heights of cutter
//! locations always come from dropping the cutter on the mesh itself.
//!
//! A chart carries the rule for the tool axis and the correction of widths, so that every strip is that of
//! the cutter as it leans and of what was measured.

use super::mesh_surface;
use crate::vocabulary::{Along, FeedDirection, Guide, PlanError, Step};
use cutter::Cutter;
use field::mesh::{blend_lines, slope_at};
use field::{GridField, NormalEquations, SamplePlane};
use geometry::{Jet2, KnotVector, NurbsSurface, Point3, Vector2, Vector3};
use motion::{CcPoint, in_tool_frame};
use part::Part;
use scallop::{FeedCurvature, cut_ahead, least_gap, strip_width_at, strip_width_fed, widest_strip_at};

/// Control points of a height surface lie so many facets apart, and no less and no more than these shares of
/// the cutter's radius. Finer follows the facets of a mesh instead of its shape, and swings beside steps, so
/// that meshes that have any take the greatest; coarser misses curvature that the cutter feels: where bumps
/// are as wide as the cutter, half a radius misses a tenth of it, and intervals are a few per cent too wide.
const FACETS_A_CONTROL: f64 = 5.0;
const CONTROL_PITCH_OVER_RADIUS: [f64; 2] = [0.25, 0.5];

/// A coarse height surface whose normals are off those of the facets by more than this, rad (root mean
/// square), is fitted again with the closest control points. Facets of a smooth shape are off it by less.
const MOST_OFF_FACETS: f64 = 0.04;

/// Places a side at which that is measured.
const FACET_SAMPLES: usize = 60;

/// Most control points a side of a height surface; bounds time and memory of the fit.
const MAX_CONTROLS: usize = 140;

/// Height samples per control point and side.
const SAMPLES_PER_CONTROL: usize = 3;

/// Weight of smoothness against height in the fit, both in units of the control pitch. It decides
/// only where the mesh has holes.
const SMOOTHNESS: f64 = 1e-6;

/// Rounds in which an interval and the curvature over it are made to agree.
const INTERVAL_ROUNDS: usize = 2;

/// Where the slope turns, the axis of a cutter with a flat gets ahead of its contact by no more than so many
/// times the way of that over a crest, and falls behind by no more than this share of it in a hollow.
const MOST_AHEAD: f64 = 2.0;
const MOST_BEHIND: f64 = 0.5;

/// An interval is no less than this share of what its middle allows: at sharper edges further passes are put
/// in.
const LEAST_INTERVAL: f64 = 0.25;

/// Height, mm, of the ridge between contacts `width` apart, where the cutter is `gap(s)` more curved than the
/// surface, 1/mm, s from the middle. From either contact the cutter rises over the surface by the integral of
/// the way left times that; the ridge stands where both have risen equally.
fn ridge_between(width: f64, gap: impl Fn(f64) -> f64) -> f64 {
    // Gauss's three places over each half.
    let (far, weights) = (0.6_f64.sqrt(), [5.0 / 18.0, 4.0 / 9.0, 5.0 / 18.0]);
    let half = 0.5 * width;
    let half_of = |sign: f64| {
        let parts = [1.0 - far, 1.0, 1.0 + far].into_iter().zip(weights).map(|(x, weight)| {
            let s = 0.5 * x * half;
            let g = weight * half * gap(sign * s);
            (g * s, g)
        });
        parts.fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1))
    };
    let ((rise_a, slope_a), (rise_b, slope_b)) = (half_of(-1.0), half_of(1.0));
    let slopes = slope_a + slope_b;
    let s = if slopes > 0.0 { ((rise_b - rise_a) / slopes).clamp(-half, half) } else { 0.0 };
    rise_a + slope_a * s + 0.5 * gap(0.5 * s) * s * s
}

/// A smooth surface to plan on.
pub struct Chart<'a> {
    source: Source<'a>,
    /// Parameter range `[[u0, u1], [v0, v1]]`.
    pub domain: [[f64; 2]; 2],
    /// +1 where the parametrisation's normal points outward, −1 where it points inward.
    sign: f64,
    /// How the cutter is tilted, and what was measured.
    guide: Guide<'a>,
}

enum Source<'a> {
    Patch { part: &'a Part, patch: u32 },
    Heights(NurbsSurface),
    Surface(&'a NurbsSurface),
}

/// A point of a chart with all that planning needs.
#[derive(Debug, Clone, Copy)]
pub struct ChartPoint<'a> {
    /// Position and derivatives.
    pub jet: Jet2,
    /// Outward unit normal.
    pub normal: Vector3,
    /// Its parameters.
    pub at: [f64; 2],
    sign: f64,
    guide: Guide<'a>,
}

impl ChartPoint<'_> {
    /// Where samples of directions in `plane` are asked for this point.
    fn sampled_at(&self, plane: SamplePlane) -> [f64; 2] {
        match plane {
            SamplePlane::Plan => [self.jet.p.x, self.jet.p.y],
            SamplePlane::Parameters => self.at,
        }
    }

    /// Normal curvature along the tangent `b`, 1/mm, positive where concave toward the outside.
    pub fn curvature_along(&self, b: &Vector3) -> f64 {
        let along = self.jet.pull_back(b).and_then(|(du, dv)| self.jet.normal_curvature(du, dv));
        self.sign * along.unwrap_or(0.0)
    }

    /// How much longer the way of the cutter's corner centre is than that of the contact, along the unit
    /// tangent `t`; 0 where the corner does not fit.
    pub fn offset_ratio(&self, cutter: &Cutter, t: &Vector3) -> f64 {
        (1.0 - self.curvature_along(t) * cutter.corner_radius()).max(0.0)
    }

    /// The unit tangent whose plan view runs at an angle from the x axis, rad; `None` on a wall along it.
    pub fn tangent_at(&self, angle: f64) -> Option<Vector3> {
        self.tangent_over([angle.cos(), angle.sin()])
    }

    /// The unit tangent over a direction of the plan view: it lies in the vertical plane along that.
    fn tangent_over(&self, line: [f64; 2]) -> Option<Vector3> {
        Vector3::new(-line[1], line[0], 0.0).cross(&self.normal).try_normalize(1e-12)
    }

    /// The feed as a unit tangent in space, and how much it matters here (0 to 1, or to the weight of
    /// samples); `None` where there is none, also for directions that curves give (see [`super::feed`]).
    pub fn feed(&self, direction: &FeedDirection, cutter: &Cutter) -> Option<(Vector3, f64)> {
        let unit = |t: &Vector3| t.try_normalize(1e-12);
        match direction {
            FeedDirection::Parameter(Along::U) => Some((unit(&self.jet.du)?, 1.0)),
            FeedDirection::Parameter(Along::V) => Some((unit(&self.jet.dv)?, 1.0)),
            FeedDirection::Angle(angle) => Some((self.tangent_at(*angle)?, 1.0)),
            FeedDirection::WidestStrip => {
                let k = self.jet.principal_curvatures()?;
                // The most convex section, seen from outside.
                let t = if self.sign > 0.0 { k.min_direction } else { k.max_direction };
                Some((unit(&t)?, ((k.max - k.min) * cutter.radius()).min(1.0)))
            }
            FeedDirection::Steepest => slope_at(&self.normal, true),
            FeedDirection::Contour => slope_at(&self.normal, false),
            FeedDirection::Samples(samples) | FeedDirection::File { samples: Some(samples), .. } => {
                let (line, sure) = samples.at(self.sampled_at(samples.plane()))?;
                let t = match samples.plane() {
                    SamplePlane::Plan => self.tangent_over(line)?,
                    SamplePlane::Parameters => unit(&(self.jet.du * line[0] + self.jet.dv * line[1]))?,
                };
                Some((t, sure))
            }
            FeedDirection::File { samples: None, .. } => None,
            FeedDirection::Blend(parts) => {
                let e1 = unit(&self.jet.du)?;
                let lines = parts.iter().filter_map(|(part, weight)| {
                    let (t, matters) = self.feed(part, cutter)?;
                    Some((t, weight * matters))
                });
                let (t, length) = blend_lines(&[e1, self.normal.cross(&e1)], lines)?;
                Some((t, length / parts.iter().map(|(_, weight)| weight).sum::<f64>()))
            }
            FeedDirection::Guides { .. } | FeedDirection::Border(_) => None,
        }
    }

    /// How the surface bends where the cutter is fed along the unit tangent `t`.
    pub fn bends(&self, t: &Vector3) -> FeedCurvature {
        FeedCurvature::of(t, &self.normal.cross(t), |d| self.curvature_along(d))
    }

    /// The tangent across the feed `t` along which the cutter cuts: it stands least above the surface there,
    /// of all places of the pass. On a plane a ball cuts at right angles to the feed; a torus fed askew to
    /// its slope does not, nor does any cutter on a surface that twists along the feed. Its part across the
    /// feed has length one.
    pub fn cut_across(&self, cutter: &Cutter, t: &Vector3) -> Vector3 {
        let [n, b] = self.across_in_tool_frame(cutter, t);
        self.normal.cross(t) + t * cut_ahead(cutter, &n, &b, &self.bends(t))
    }

    /// The normal and the tangent across the feed `t`, in the frame of the cutter.
    fn across_in_tool_frame(&self, cutter: &Cutter, t: &Vector3) -> [Vector3; 2] {
        let contact = CcPoint { point: self.jet.p, normal: self.normal };
        // A ball is the same however it leans. A place without an axis is refused where it is cut.
        let axis = self.guide.axis.filter(|_| !cutter.is_ball()).and_then(|rule| rule.at(&contact, t).ok());
        [self.normal, self.normal.cross(t)].map(|v| axis.map_or(v, |axis| in_tool_frame(&axis, &v)))
    }

    /// Distance on the surface that neighbouring passes with unit feed tangent `t` may have, mm,
    /// and whether the surface is too concave for the formula.
    pub fn strip_width(&self, cutter: &Cutter, t: &Vector3, step: Step) -> (f64, bool) {
        match step {
            Step::Stepover(width) => (width, false),
            Step::Scallop(h) => {
                let [n, b] = self.across_in_tool_frame(cutter, t);
                let (width, limited) = strip_width_at(cutter, &n, &b, &self.bends(t), h);
                (self.guide.corrected(width, &self.jet.p, step), limited)
            }
        }
    }

    /// [`ChartPoint::strip_width`] of a cutter that is fed straight along `t`, below the scallop height `h`,
    /// mm: in a plane, wherever that takes its contact.
    pub fn strip_width_fed(&self, cutter: &Cutter, t: &Vector3, h: f64) -> (f64, bool) {
        let [n, b] = self.across_in_tool_frame(cutter, t);
        let (width, limited) = strip_width_fed(cutter, &n, &b, &self.bends(t), h);
        (self.guide.corrected(width, &self.jet.p, Step::Scallop(h)), limited)
    }

    /// Wider than any path's strip along the unit feed tangent `t` below the scallop height `h`, mm, as
    /// [`ChartPoint::strip_width`].
    pub fn widest_strip(&self, cutter: &Cutter, t: &Vector3, h: f64) -> (f64, bool) {
        let [n, b] = self.across_in_tool_frame(cutter, t);
        widest_strip_at(cutter, &n, &b, &self.bends(t), h)
    }

    /// Whether a measurement asked for narrower passes here than elsewhere.
    pub fn was_narrowed(&self) -> bool {
        self.guide.correction.is_some_and(|correction| correction.is_narrower_at(&self.jet.p))
    }
}

impl<'a> Chart<'a> {
    /// All charts of a part, for a cutter that is tilted by a rule, or upright.
    ///
    /// # Errors
    /// When no height surface can be fitted to a mesh.
    pub fn all(part: &'a Part, cutter: &Cutter, guide: Guide<'a>) -> Result<Vec<Self>, PlanError> {
        if part.patches().is_empty() {
            return Ok(vec![Self::of_mesh(part, cutter, guide)?]);
        }
        Ok((0..part.patches().len()).map(|k| Self::of_patch(part, k, guide)).collect())
    }

    fn of_patch(part: &'a Part, k: usize, guide: Guide<'a>) -> Self {
        let (patch, domain) = (k as u32, part.patches()[k].domain());
        let sign = part.outward_sign(k);
        Self { source: Source::Patch { part, patch }, domain, sign, guide }
    }

    /// A surface that is no patch of the part; `du × dv` points outward.
    pub fn of_surface(surface: &'a NurbsSurface, guide: Guide<'a>) -> Self {
        Self { source: Source::Surface(surface), domain: surface.domain(), sign: 1.0, guide }
    }

    /// The smooth surface over a mesh, on the rectangle around it.
    ///
    /// # Errors
    /// When none can be fitted.
    pub fn of_mesh(part: &'a Part, cutter: &Cutter, guide: Guide<'a>) -> Result<Self, PlanError> {
        let bounds = part.bounds();
        let domain = [[bounds.min.x, bounds.max.x], [bounds.min.y, bounds.max.y]];
        // Two facets to a square.
        let area = (domain[0][1] - domain[0][0]) * (domain[1][1] - domain[1][0]);
        let facet = (2.0 * area / part.mesh().triangles().len().max(1) as f64).sqrt();
        let [least, most] = CONTROL_PITCH_OVER_RADIUS.map(|share| share * cutter.radius());
        let stepped = mesh_surface::wants_mesh(part, cutter);
        let pitch = if stepped { most } else { (FACETS_A_CONTROL * facet).clamp(least, most) };
        let fitted = |pitch: f64| {
            let knots = domain.map(|range| {
                let controls = ((range[1] - range[0]) / pitch).ceil().clamp(5.0, MAX_CONTROLS as f64);
                KnotVector::clamped_uniform(3, controls as usize, range)
            });
            let [Ok(knots_u), Ok(knots_v)] = knots else {
                return Err(PlanError::mesh("its plan view has no area"));
            };
            let surface = fit_heights(part, domain, knots_u, knots_v)?;
            Ok(Self { source: Source::Heights(surface), domain, sign: 1.0, guide })
        };
        let coarse = fitted(pitch)?;
        // Few large facets are the shape itself.
        let follows = stepped || pitch <= least || coarse.off_facets(part) <= MOST_OFF_FACETS;
        if follows { Ok(coarse) } else { fitted(least) }
    }

    /// How far the normals of a fitted surface are off those of the facets, rad (root mean square over the
    /// plan view).
    fn off_facets(&self, part: &Part) -> f64 {
        let off = |[u, v]: [f64; 2]| {
            let (here, facet) = (self.at(u, v)?, part.highest_at(u, v)?);
            Some(part.mesh().normal(facet.triangle as usize).cross(&here.normal).norm_squared())
        };
        let squares: Vec<f64> = self.grid(FACET_SAMPLES).filter_map(off).collect();
        (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
    }

    /// [`ChartPoint::strip_width`] for passes on both sides of a place, with the curvature of all that lies
    /// between them: at an edge, or where a blend begins, it is another one half an interval away.
    pub fn interval(&self, p: &ChartPoint, cutter: &Cutter, t: &Vector3, step: Step) -> (f64, bool) {
        let (at_place, limited) = p.strip_width(cutter, t, step);
        let across = p.cut_across(cutter, t);
        let (Step::Scallop(_), Some((du, dv))) = (step, p.jet.pull_back(&across)) else {
            return (at_place, limited);
        };
        let [n, b] = p.across_in_tool_frame(cutter, t);
        let own = least_gap(cutter, &n, &b, &p.bends(t));
        if !own.is_finite() || own <= 0.0 {
            return (at_place, limited);
        }
        // A form of the tangent: the curvature along its direction and the square of its length.
        let bend = |q: &ChartPoint| q.curvature_along(&across) * across.norm_squared();
        let gap_at = |s: f64| {
            let beside = self.at(p.at[0] + s * du, p.at[1] + s * dv);
            beside.map_or(own, |q| own + bend(p) - bend(&q))
        };
        let mut width = at_place;
        for _ in 0..INTERVAL_ROUNDS {
            let ridge = ridge_between(width, gap_at);
            let even = own * width * width / 8.0;
            // Where the surface between is too concave, the place itself decides.
            let share = if ridge > 0.0 { (even / ridge).sqrt() } else { 1.0 };
            width = at_place * share.clamp(LEAST_INTERVAL, 1.0);
        }
        (width, limited)
    }

    /// Where the axis of an upright cutter stands, in the plan view, that touches a place. Its flat reaches
    /// over nearly level ground as far as it does on a plane, but where the slope turns so fast that the axis
    /// would swerve or turn back; `chord` mm are no matter.
    pub fn axis_over(&self, p: &ChartPoint, cutter: &Cutter, chord: f64) -> Vector2 {
        let bends = || {
            let k = p.jet.principal_curvatures()?;
            Some([self.sign * k.min, self.sign * k.max])
        };
        p.jet.p.coords.xy() + axis_offset_over(&p.normal, bends, cutter, chord)
    }

    /// Whether it was fitted to a mesh, on which it does not lie.
    pub fn is_fitted(&self) -> bool {
        matches!(self.source, Source::Heights(_))
    }

    /// The surface at a parameter; `None` where the parametrisation is degenerate.
    pub fn at(&self, u: f64, v: f64) -> Option<ChartPoint<'a>> {
        let jet = self.jet(u, v);
        Some(ChartPoint {
            jet,
            normal: jet.normal()? * self.sign,
            at: [u, v],
            sign: self.sign,
            guide: self.guide,
        })
    }

    /// Position and derivatives at a parameter. Beyond the domain the tangent plane at the nearest
    /// border point continues the surface.
    pub fn jet(&self, u: f64, v: f64) -> Jet2 {
        let [[u0, u1], [v0, v1]] = self.domain;
        let (inner_u, inner_v) = (u.clamp(u0, u1), v.clamp(v0, v1));
        let mut jet = match &self.source {
            Source::Patch { part, patch } => part.patches()[*patch as usize].jet(inner_u, inner_v),
            Source::Heights(surface) => surface.jet(inner_u, inner_v),
            Source::Surface(surface) => surface.jet(inner_u, inner_v),
        };
        jet.p += jet.du * (u - inner_u) + jet.dv * (v - inner_v);
        jet
    }

    /// A function of the parameters by its values at the nodes of an even grid, for a strategy.
    ///
    /// # Errors
    /// When a value is not finite.
    pub fn sampled(
        &self,
        cells: usize,
        strategy: &'static str,
        value: impl Fn(f64, f64) -> f64 + Sync,
    ) -> Result<GridField, PlanError> {
        let at = |c: usize, k: usize| {
            let [lo, hi] = self.domain[c];
            lo + (hi - lo) * k as f64 / cells as f64
        };
        let rows = work::parallel::map(cells + 1, |j| {
            (0..=cells).map(|i| value(at(0, i), at(1, j))).collect::<Vec<_>>()
        });
        let refused =
            || PlanError::NotApplicable { strategy, reason: "its heights are not finite".to_owned() };
        GridField::new(self.domain, [cells; 2], &rows.concat()).ok_or_else(refused)
    }

    /// The points at the corners of the domain.
    pub fn corners(&self) -> [Point3; 4] {
        let [[u0, u1], [v0, v1]] = self.domain;
        [[u0, v0], [u1, v0], [u1, v1], [u0, v1]].map(|[u, v]| self.jet(u, v).p)
    }

    /// True where the chart itself is, not its continuation.
    pub fn holds(&self, [u, v]: [f64; 2]) -> bool {
        let [[u0, u1], [v0, v1]] = self.domain;
        u >= u0 && u <= u1 && v >= v0 && v <= v1
    }

    /// The parameters of an even grid of `n` × `n` places with the centre of each of its cells, and
    /// the share of the domain's sides that a cell has.
    pub fn grid(&self, n: usize) -> impl Iterator<Item = [f64; 2]> + use<> {
        let [[u0, u1], [v0, v1]] = self.domain;
        let at = move |lo: f64, hi: f64, k: usize| lo + (hi - lo) * (k as f64 + 0.5) / n as f64;
        (0..n * n).map(move |k| [at(u0, u1, k % n), at(v0, v1, k / n)])
    }

    /// Least and greatest `x·e` over the plan views of all places where the cutter's axis can be when
    /// the cutter touches one of the charts. On a mesh the triangles themselves answer:
    /// the fitted surface has no creases.
    pub fn extent_of_axes(
        charts: &[Self],
        part: &Part,
        cutter: &Cutter,
        chord: f64,
        e: &Vector2,
    ) -> [f64; 2] {
        let all = charts.iter().map(|chart| chart.extent_of_own_axes(part, cutter, chord, e));
        all.fold([f64::INFINITY, f64::NEG_INFINITY], |a, b| [a[0].min(b[0]), a[1].max(b[1])])
    }

    fn extent_of_own_axes(&self, part: &Part, cutter: &Cutter, chord: f64, e: &Vector2) -> [f64; 2] {
        const N: usize = 200;
        let [[u0, u1], [v0, v1]] = self.domain;
        let at = |lo: f64, hi: f64, k: usize| lo + (hi - lo) * k as f64 / N as f64;
        let mut extent = [f64::INFINITY, f64::NEG_INFINITY];
        let mut include = |axis: Vector2| {
            let x = axis.dot(e);
            extent = [extent[0].min(x), extent[1].max(x)];
        };
        if let Source::Heights(_) = self.source {
            let mesh = part.mesh();
            for t in 0..mesh.triangles().len() {
                let normal = mesh.normal(t);
                if normal.z > 0.0 {
                    let offset = dropped_offset(&normal, cutter, chord);
                    mesh.corners(t).iter().for_each(|corner| include(corner.coords.xy() + offset));
                }
            }
            return extent;
        }
        for k in 0..(N + 1) * (N + 1) {
            if let Some(p) = self.at(at(u0, u1, k % (N + 1)), at(v0, v1, k / (N + 1))) {
                include(p.jet.p.coords.xy() + dropped_offset(&p.normal, cutter, chord));
            }
        }
        extent
    }
}

/// [`Cutter::axis_offset`] on a surface with these principal curvatures, 1/mm, positive concave; `chord` mm
/// are no matter.
pub fn axis_offset_over(
    n: &Vector3,
    bends: impl FnOnce() -> Option<[f64; 2]>,
    cutter: &Cutter,
    chord: f64,
) -> Vector2 {
    let flat = cutter.flat_radius();
    let Some(bends) = (flat > 0.0).then(bends).flatten() else {
        return cutter.axis_offset(n);
    };
    let turns = |bend: f64| flat * if bend > 0.0 { bend / MOST_BEHIND } else { -bend / MOST_AHEAD };
    let level = bends.map(turns).into_iter().fold(0.5 * chord / flat, f64::max);
    cutter.axis_offset_from(n, level)
}

/// From a contact to the axis of a cutter that is dropped on a surface, in the plan view. Its flat reaches as
/// far as it does on a slope, but where that changes heights by less than half of `chord` mm.
pub fn dropped_offset(n: &Vector3, cutter: &Cutter, chord: f64) -> Vector2 {
    let flat = cutter.flat_radius();
    if flat > 0.0 { cutter.axis_offset_from(n, 0.5 * chord / flat) } else { cutter.axis_offset(n) }
}

/// Least-squares bicubic height surface over the plan view of a mesh part.
fn fit_heights(
    part: &Part,
    domain: [[f64; 2]; 2],
    knots_u: KnotVector,
    knots_v: KnotVector,
) -> Result<NurbsSurface, PlanError> {
    let counts = [knots_u.control_count(), knots_v.control_count()];
    let samples = counts.map(|n| n * SAMPLES_PER_CONTROL);
    let at = |c: usize, k: usize| {
        domain[c][0] + (domain[c][1] - domain[c][0]) * (k as f64 + 0.5) / samples[c] as f64
    };
    let rows = work::parallel::map(samples[1], |j| {
        (0..samples[0]).map(|i| part.highest_at(at(0, i), at(1, j)).map(|s| s.point.z)).collect::<Vec<_>>()
    });
    let pitch = [0, 1].map(|c| (domain[c][1] - domain[c][0]) / counts[c] as f64);
    let mut equations = NormalEquations::new(knots_u.clone(), knots_v.clone());
    for (j, row) in rows.iter().enumerate() {
        for (i, z) in row.iter().enumerate() {
            let (x, y) = (at(0, i), at(1, j));
            if let Some(z) = z {
                equations.add(x, y, &[[1.0, 0.0, 0.0], [0.0; 3], [0.0; 3]], *z, 1.0);
            }
            let (bend_x, bend_y) = (pitch[0] * pitch[0], pitch[1] * pitch[1]);
            equations.add(x, y, &[[0.0; 3], [0.0; 3], [bend_x, 0.0, 0.0]], 0.0, SMOOTHNESS);
            equations.add(x, y, &[[0.0, 0.0, bend_y], [0.0; 3], [0.0; 3]], 0.0, SMOOTHNESS);
        }
    }
    let heights = equations.solve(false).map_err(|e| PlanError::mesh(&e.to_string()))?;
    let (gu, gv) = (greville(&knots_u), greville(&knots_v));
    let (nu, nv) = (gu.len(), gv.len());
    let control = |i: usize, j: usize| Point3::new(gu[i], gv[j], heights.coefficients()[j * nu + i]);
    let net: Vec<Vec<Point3>> = (0..nu).map(|i| (0..nv).map(|j| control(i, j)).collect()).collect();
    let knots = [knots_u, knots_v].map(|k| k.knots().to_vec());
    let [knots_u, knots_v] = knots;
    NurbsSurface::new(3, 3, knots_u, knots_v, &net, None).map_err(|e| PlanError::mesh(&e.to_string()))
}

/// Greville abscissae: control points there make the parameter itself the coordinate.
fn greville(knots: &KnotVector) -> Vec<f64> {
    let p = knots.degree();
    (0..knots.control_count()).map(|i| knots.knots()[i + 1..=i + p].iter().sum::<f64>() / p as f64).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use geometry::TriangleMesh;

    /// On both sides of a step of curvature, from 0.2 to 1 more than the surface's, contacts 2 apart: the
    /// ridge stands a third beside the middle and 2/9 high.
    #[test]
    fn ridges_over_a_step_of_curvature_stand_where_both_sides_meet() {
        let step = |s: f64| if s < 0.0 { 0.2 } else { 1.0 };
        assert_relative_eq!(ridge_between(2.0, step), 2.0 / 9.0, epsilon = 1e-12);
        assert_relative_eq!(ridge_between(2.0, |s| step(-s)), 2.0 / 9.0, epsilon = 1e-12);
        assert_relative_eq!(ridge_between(1.5, |_| 0.4), 0.4 * 1.5 * 1.5 / 8.0, epsilon = 1e-15);
    }

    /// A profile across y: level, then an arc of radius 1 that begins at a knot of the curve.
    fn rounded_edge() -> NurbsSurface {
        let weight = std::f64::consts::FRAC_1_SQRT_2;
        let profile = [
            ([-6.0, 0.0], 1.0),
            ([-3.0, 0.0], 1.0),
            ([0.0, 0.0], 1.0),
            ([1.0, 0.0], weight),
            ([1.0, -1.0], 1.0),
        ];
        let net: Vec<Vec<Point3>> =
            profile.iter().map(|([x, z], _)| [0.0, 10.0].map(|y| Point3::new(*x, y, *z)).to_vec()).collect();
        let weights: Vec<Vec<f64>> = profile.iter().map(|(_, w)| vec![*w; 2]).collect();
        let knots = vec![0.0, 0.0, 0.0, 0.5, 0.5, 1.0, 1.0, 1.0];
        NurbsSurface::new(2, 1, knots, vec![0.0, 0.0, 1.0, 1.0], &net, Some(&weights)).unwrap()
    }

    /// Far from an edge the interval is what the place allows; beside the edge, on level ground, it is less,
    /// so that the ridge between contacts on the plane and on the arc is as high as asked.
    #[test]
    fn intervals_are_narrower_where_an_edge_begins_within_them() {
        let surface = rounded_edge();
        let (chart, cutter, h) =
            (Chart::of_surface(&surface, Guide::default()), Cutter::ball(6.0).unwrap(), 0.01);
        let at_x = |x: f64| {
            // On the level half x falls with the square of the way to the edge's knot, or evenly.
            let (mut a, mut b) = (0.0, 0.5);
            for _ in 0..60 {
                let middle = 0.5 * (a + b);
                *(if chart.jet(middle, 0.5).p.x < x { &mut a } else { &mut b }) = middle;
            }
            chart.at(a, 0.5).unwrap()
        };
        let feed = Vector3::y();
        let [far, near] = [at_x(-3.0), at_x(-0.02)];
        let plane = far.strip_width(&cutter, &feed, Step::Scallop(h)).0;
        assert_relative_eq!(chart.interval(&far, &cutter, &feed, Step::Scallop(h)).0, plane, epsilon = 1e-9);
        let width = chart.interval(&near, &cutter, &feed, Step::Scallop(h)).0;
        let gap = |s: f64| if s < 0.02 { 1.0 / 3.0 } else { 1.0 / 3.0 + 1.0 };
        let ridge = ridge_between(width, gap).max(ridge_between(width, |s| gap(-s)));
        assert!(width < 0.8 * plane && ridge < 1.15 * h && ridge > 0.8 * h, "{width} of {plane}: {ridge}");
    }

    /// A torus and a ball on a surface that slopes and twists, fed in all directions: over places at one
    /// distance across the feed the cutter stands least above the one that is told.
    #[test]
    fn the_cutter_cuts_where_it_stands_least_above_the_surface() {
        let corner = |x: f64, y: f64| Point3::new(x, y, 0.35 * x + 0.1 * y + 0.03 * x * y);
        let net: Vec<Vec<Point3>> = [-5.0, 5.0].map(|x| [-5.0, 5.0].map(|y| corner(x, y)).to_vec()).to_vec();
        let ends = || vec![0.0, 0.0, 1.0, 1.0];
        let surface = NurbsSurface::new(1, 1, ends(), ends(), &net, None).unwrap();
        let chart = Chart::of_surface(&surface, Guide::default());
        let here = chart.at(0.6, 0.45).unwrap();
        let (p, n) = (here.jet.p, here.normal);
        for cutter in [Cutter::ball(6.0).unwrap(), Cutter::bull(6.0, 1.5).unwrap()] {
            let tip = p + cutter.contact_to_tip(&n);
            let above = |q: Point3| {
                let reach = (q - tip).xy().norm();
                tip.z + cutter.height(reach).unwrap() - corner(q.x, q.y).z
            };
            for k in 0..12 {
                let t = here.tangent_at(0.5 * f64::from(k)).unwrap();
                let across = n.cross(&t);
                let y = 0.02;
                let gap = |s: f64| above(p + across * y + t * s);
                // The least of a parabola through three places.
                let [a, b, c] = [-y, 0.0, y].map(gap);
                let least = 0.5 * y * (a - c) / (a - 2.0 * b + c);
                let told = here.cut_across(&cutter, &t);
                assert_relative_eq!(told.dot(&across), 1.0, epsilon = 1e-12);
                assert_relative_eq!(told.dot(&t), least / y, epsilon = 0.03);
            }
        }
    }

    /// On a bump hardly wider than the cutter the fitted surface has the curvature of what the facets are
    /// chords of, within a share of the cutter's own that makes intervals wider by less than half that share.
    #[test]
    fn a_surface_fitted_to_fine_facets_is_curved_as_what_they_are_chords_of() {
        const CELLS: usize = 60;
        let height = |x: f64, y: f64| 2.1 * (-((x - 12.0).powi(2) + (y - 12.0).powi(2)) / 90.0).exp();
        let at = |k: usize| 24.0 * k as f64 / CELLS as f64;
        let side = CELLS + 1;
        let corners = (0..side * side).map(|k| (at(k % side), at(k / side)));
        let corners = corners.map(|(x, y)| Point3::new(x, y, height(x, y))).collect();
        let triangles = (0..CELLS * CELLS).flat_map(|k| {
            let a = (k / CELLS * side + k % CELLS) as u32;
            let [b, c] = [a + 1, a + side as u32];
            [[a, b, c + 1], [a, c + 1, c]]
        });
        let (mesh, _) = TriangleMesh::new(corners, triangles.collect()).unwrap();
        let (part, cutter) = (Part::from_mesh(mesh), Cutter::ball(16.0).unwrap());
        let chart = &Chart::all(&part, &cutter, Guide::default()).unwrap()[0];
        let top = chart.at(12.0, 12.0).unwrap().curvature_along(&Vector3::x());
        assert!((top + 2.0 * 2.1 / 90.0).abs() < 0.01 / 8.0, "{top}");
    }
}
