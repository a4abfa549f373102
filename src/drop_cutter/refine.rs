//! The rest position of a cutter on an exact surface: climbs to the maximum of
//! `F(u, v) = z(u, v) − f(|xy(u, v) − c|)` from a start nearby.
//!
//! A Newton method for a concave function under constraints (sequential quadratic programming,
//! Nocedal & Wright, *Numerical Optimization*, ch. 18): the parameters stay in their rectangle, and
//! the contact stays within the cutter's radius, where the profile ends and a flat end usually
//! touches. Each step solves its quadratic model exactly, by trying all sets of active constraints;
//! it is taken only as far as `F` grows.

use super::touch::Profile;
use geometry::Jet2;

/// How the profile's height depends on the distance from the axis, as one smooth piece.
#[derive(Debug, Clone, Copy)]
pub(super) enum Law {
    /// The point at the axis, nothing beyond.
    Point,
    /// Zero up to the given distance, nothing beyond.
    Disc(f64),
    /// The cone at the bottom of a profile, nothing beyond.
    Bottom(Profile),
    /// The arc of a profile, carried on toward the axis, nothing beyond.
    Arc(Profile),
    /// The whole profile, whose parts meet smoothly.
    Smooth(Profile),
    /// The cone at the side of a profile, carried on toward the axis.
    Cone(Profile),
}

impl Profile {
    /// The smooth pieces of which the profile is the greatest. Where an edge lies between two pieces,
    /// both are needed: the kink would stop a Newton method. The inner piece, which ends at the edge,
    /// finds the contacts of the edge itself.
    pub(super) fn laws(&self) -> impl Iterator<Item = Law> + use<> {
        let shape = &self.shape;
        if shape.is_plain() && self.corner > 0.0 {
            return [Some(Law::Smooth(*self)), None, None, None].into_iter().flatten();
        }
        let level = shape.bottom.sin == 0.0;
        let point = shape.point().sin > 0.0;
        let bottom = if level { Law::Disc(shape.bottom_end) } else { Law::Bottom(*self) };
        [
            point.then_some(Law::Point),
            (shape.bottom_end > 0.0).then_some(bottom),
            (self.corner > 0.0).then_some(Law::Arc(*self)),
            self.cone.is_finite().then_some(Law::Cone(*self)),
        ]
        .into_iter()
        .flatten()
    }
}

/// At the very edge of a ball the profile is vertical. Its slope is worked out no nearer to it
/// than this share of the corner radius; nearer, second derivatives overflow.
const EDGE: f64 = 1e-7;

/// Derivatives beside the point of a cone, where they have no limit, are worked out no nearer to it
/// than this, mm; nearer, second derivatives overflow.
const POINT: f64 = 1e-9;

impl Law {
    /// Height at distance `rho`, then `A = f'/ρ` and `B = (f'' − f'/ρ)/ρ²`: with `d = xy − c` the
    /// derivatives of `f(|d|)` are `A d·∂ᵢd` and `A (∂ᵢd·∂ⱼd + d·∂ᵢⱼd) + B (d·∂ᵢd)(d·∂ⱼd)`.
    fn height(&self, rho: f64) -> [f64; 3] {
        let cone = |height: f64, slope: f64| {
            let rho = rho.max(POINT);
            [height, slope / rho, -slope / (rho * rho * rho)]
        };
        match self {
            Self::Point | Self::Disc(_) => [0.0; 3],
            Self::Bottom(p) => {
                let slope = p.shape.bottom.slope();
                cone(slope * rho, slope)
            }
            Self::Cone(p) => cone(p.shape.arc_end_height + p.cone * (rho - p.arc_end), p.cone),
            Self::Arc(p) if rho <= p.flat => [p.shape.centre_z - p.corner, 0.0, 0.0],
            Self::Arc(p) => {
                let (r, x) = (p.corner, rho - p.flat);
                let w = (r * r - x * x).max(EDGE * EDGE * r * r).sqrt();
                let rho = rho.max(POINT);
                let a = x / (w * rho);
                let height = p.shape.centre_z - ((r - x) * (r + x)).max(0.0).sqrt();
                [height, a, (r * r / (w * w * w) - a) / (rho * rho)]
            }
            Self::Smooth(p) if rho <= p.flat && p.flat > 0.0 => [0.0; 3],
            Self::Smooth(p) if rho > p.arc_end => [p.height(rho), p.cone / rho, -p.cone / (rho * rho * rho)],
            Self::Smooth(p) => {
                let (r, x) = (p.corner, rho - p.flat);
                let w = (r * r - x * x).max(EDGE * EDGE * r * r).sqrt();
                if p.flat == 0.0 {
                    return [p.height(rho), 1.0 / w, 1.0 / (w * w * w)];
                }
                let a = x / (w * rho);
                [p.height(rho), a, (r * r / (w * w * w) - a) / (rho * rho)]
            }
        }
    }

    /// Where the piece ends, of a cutter of that radius.
    fn limit(&self, radius: f64) -> f64 {
        match self {
            Self::Point => 0.0,
            Self::Disc(end) => *end,
            Self::Bottom(p) => p.shape.bottom_end,
            Self::Arc(p) => p.arc_end,
            Self::Smooth(_) | Self::Cone(_) => radius,
        }
    }

    /// Where the piece begins; carried on farther in it lies below the cutter and touches nothing.
    fn begin(&self) -> f64 {
        match self {
            Self::Arc(p) => p.shape.bottom_end,
            Self::Cone(p) => p.arc_end,
            _ => 0.0,
        }
    }
}

/// A maximum that was reached.
#[derive(Debug, Clone, Copy)]
pub(super) struct Peak {
    /// Parameters.
    pub(super) at: [f64; 2],
    /// The surface there.
    pub(super) jet: Jet2,
    /// Height of the tip.
    pub(super) tip_z: f64,
}

/// The function to climb.
pub(super) struct Hill<'s, J: Fn(f64, f64) -> Jet2> {
    jet: &'s J,
    domain: [[f64; 2]; 2],
    law: Law,
    radius: f64,
    axis: [f64; 2],
}

/// Most Newton steps; three to six are usual, more only where the maximum is flat.
const MAX_STEPS: usize = 50;

/// Most halvings of one step before the climb counts as finished.
const MAX_HALVINGS: usize = 30;

/// Most steps to bring a point back within the cutter's radius.
const MAX_RETURNS: usize = 20;

/// A gain below this share of the heights involved is rounding.
const ROUNDING: f64 = 2.0 * f64::EPSILON;

/// A point this much (relative) beyond the radius still counts as on it.
const ON_RIM: f64 = 1e-13;

/// A point this close to the axis, mm, counts as on it.
const ON_AXIS: f64 = 1e-11;

/// A start whose first step ends within this share of its distance from a known maximum would
/// reach that one again. Greater may skip a second maximum beside the first.
const SAME: f64 = 0.25;

/// Curvature of the model, relative to its greatest, below which a direction counts as not
/// concave and is damped.
const CONCAVE: f64 = 1e-9;

/// Value, gradient and Hessian of `F`, and of the rim constraint `(|d|² − R²)/2 <= 0`.
struct Model {
    value: f64,
    gradient: [f64; 2],
    hessian: [f64; 3],
    rim: f64,
    rim_gradient: [f64; 2],
    rim_hessian: [f64; 3],
}

impl<'s, J: Fn(f64, f64) -> Jet2> Hill<'s, J> {
    /// The hill of a surface with the given domain for a cutter of that radius with its axis at
    /// `(axis[0], axis[1])`.
    pub(super) fn new(jet: &'s J, domain: [[f64; 2]; 2], law: Law, radius: f64, axis: [f64; 2]) -> Self {
        Self { jet, domain, law, radius: law.limit(radius), axis }
    }

    /// Climbs from `start` to a local maximum; `None` where the surface near `start` is out of the
    /// cutter's reach, or when the climb heads for a `known` maximum.
    pub(super) fn climb(&self, start: [f64; 2], known: impl Iterator<Item = [f64; 2]>) -> Option<Peak> {
        if let Law::Point = self.law {
            return self.on_axis(start);
        }
        let mut here =
            self.reachable([0, 1].map(|i| start[i].clamp(self.domain[i][0], self.domain[i][1])))?;
        let mut model = self.model(&here.jet);
        let mut step = self.step(here.at, &here.jet, &model);
        let target = [here.at[0] + step.0[0], here.at[1] + step.0[1]];
        let first_form = here.jet.first_form();
        let apart = |a: [f64; 2], b: [f64; 2]| length_squared(first_form, [a[0] - b[0], a[1] - b[1]]);
        for k in known {
            if apart(target, k) <= SAME * SAME * apart(here.at, k) {
                return None;
            }
        }
        for _ in 0..MAX_STEPS {
            if step.1 <= ROUNDING * (model.value.abs() + self.radius) {
                break;
            }
            let Some(better) = self.advance(&here, &step) else {
                break;
            };
            here = better;
            model = self.model(&here.jet);
            step = self.step(here.at, &here.jet, &model);
        }
        let [dx, dy] = self.offset(&here.jet);
        (dx.hypot(dy) >= self.law.begin()).then_some(here)
    }

    /// The place of the surface on the cutter's axis, by Newton's method in the plan view.
    fn on_axis(&self, start: [f64; 2]) -> Option<Peak> {
        let mut at = start;
        for _ in 0..MAX_RETURNS {
            let jet = (self.jet)(at[0], at[1]);
            let d = self.offset(&jet);
            if d[0].hypot(d[1]) <= ON_AXIS {
                return Some(Peak { at, jet, tip_z: jet.p.z });
            }
            let det = jet.du.x * jet.dv.y - jet.dv.x * jet.du.y;
            let step = [(d[1] * jet.dv.x - d[0] * jet.dv.y) / det, (d[0] * jet.du.y - d[1] * jet.du.x) / det];
            if !(step[0].is_finite() && step[1].is_finite()) {
                return None;
            }
            at = [0, 1].map(|i| (at[i] + step[i]).clamp(self.domain[i][0], self.domain[i][1]));
        }
        None
    }

    /// Goes as far along the step as gains height.
    fn advance(&self, here: &Peak, (step, gain): &([f64; 2], f64)) -> Option<Peak> {
        let mut share = 1.0;
        for _ in 0..MAX_HALVINGS {
            let at =
                [0, 1].map(|i| (here.at[i] + share * step[i]).clamp(self.domain[i][0], self.domain[i][1]));
            if let Some(there) = self.reachable(at)
                && there.tip_z > here.tip_z + 1e-4 * share * gain
            {
                return Some(there);
            }
            share *= 0.5;
        }
        None
    }

    fn offset(&self, jet: &Jet2) -> [f64; 2] {
        [jet.p.x - self.axis[0], jet.p.y - self.axis[1]]
    }

    /// The point at these parameters, or near them, brought back within the radius; `None` when the
    /// domain ends before.
    fn reachable(&self, mut at: [f64; 2]) -> Option<Peak> {
        let limit = self.radius * self.radius;
        for _ in 0..MAX_RETURNS {
            let jet = (self.jet)(at[0], at[1]);
            let d = self.offset(&jet);
            let excess = d[0] * d[0] + d[1] * d[1] - limit;
            if excess <= ON_RIM * limit {
                let rho = d[0].hypot(d[1]).min(self.radius);
                return Some(Peak { at, jet, tip_z: jet.p.z - self.law.height(rho)[0] });
            }
            let slope = [plan_dot(d, &jet.du), plan_dot(d, &jet.dv)];
            at = self.toward_axis(at, &jet, slope, 0.5 * excess)?;
        }
        None
    }

    /// The Newton step that lowers half the squared distance by `fall`, shortest on the surface,
    /// along the border where it would leave the domain.
    fn toward_axis(&self, at: [f64; 2], jet: &Jet2, slope: [f64; 2], fall: f64) -> Option<[f64; 2]> {
        let (e, _, g) = jet.first_form();
        let mut weight = [1.0 / e, 1.0 / g].map(|w: f64| if w.is_finite() { w } else { 0.0 });
        for i in 0..2 {
            let [low, high] = self.domain[i];
            if (at[i] <= low && slope[i] > 0.0) || (at[i] >= high && slope[i] < 0.0) {
                weight[i] = 0.0;
            }
        }
        let steepness = (0..2).map(|i| weight[i] * slope[i] * slope[i]).sum::<f64>();
        let next = [0, 1].map(|i| {
            (at[i] - fall * weight[i] * slope[i] / steepness).clamp(self.domain[i][0], self.domain[i][1])
        });
        (steepness > 0.0 && next != at).then_some(next)
    }

    fn model(&self, jet: &Jet2) -> Model {
        let d = self.offset(jet);
        let rho = d[0].hypot(d[1]);
        let [height, a, b] = self.law.height(rho.min(self.radius));
        let slope = [plan_dot(d, &jet.du), plan_dot(d, &jet.dv)];
        let flat = |p: &geometry::Vector3, q: &geometry::Vector3| p.x * q.x + p.y * q.y;
        let bend = [
            flat(&jet.du, &jet.du) + plan_dot(d, &jet.duu),
            flat(&jet.du, &jet.dv) + plan_dot(d, &jet.duv),
            flat(&jet.dv, &jet.dv) + plan_dot(d, &jet.dvv),
        ];
        let square = [slope[0] * slope[0], slope[0] * slope[1], slope[1] * slope[1]];
        let rise = [jet.duu.z, jet.duv.z, jet.dvv.z];
        Model {
            value: jet.p.z - height,
            gradient: [jet.du.z - a * slope[0], jet.dv.z - a * slope[1]],
            hessian: [0, 1, 2].map(|i| rise[i] - a * bend[i] - b * square[i]),
            rim: 0.5 * (rho * rho - self.radius * self.radius),
            rim_gradient: slope,
            rim_hessian: bend,
        }
    }

    /// The step to the maximum of the quadratic model under the constraints, and the gain it
    /// promises.
    fn step(&self, at: [f64; 2], jet: &Jet2, model: &Model) -> ([f64; 2], f64) {
        let (e, _, g) = jet.first_form();
        // Lengths of the parameters: makes both directions of the model comparable.
        let floor = f64::EPSILON * (e + g);
        let scale = [e.max(floor).max(f64::MIN_POSITIVE).sqrt(), g.max(floor).max(f64::MIN_POSITIVE).sqrt()];
        let scaled = |h: [f64; 3]| {
            [h[0] / (scale[0] * scale[0]), h[1] / (scale[0] * scale[1]), h[2] / (scale[1] * scale[1])]
        };
        let gradient = [model.gradient[0] / scale[0], model.gradient[1] / scale[1]];
        let rim_gradient = [model.rim_gradient[0] / scale[0], model.rim_gradient[1] / scale[1]];
        let rim_hessian = scaled(model.rim_hessian);
        // On the rim the constraint's curvature belongs to the model, by its multiplier.
        let on_rim = model.rim >= -1e-9 * self.radius * self.radius;
        let push = dot(gradient, rim_gradient) / dot(rim_gradient, rim_gradient);
        let multiplier = if on_rim && push > 0.0 { push } else { 0.0 };
        let own = scaled(model.hessian);
        let hessian = concave([0, 1, 2].map(|i| own[i] - multiplier * rim_hessian[i]), gradient, self.radius);
        let bounds = [0, 1].map(|i| self.domain[i].map(|end| (end - at[i]) * scale[i]));
        let limits = [
            ([1.0, 0.0], bounds[0][1]),
            ([-1.0, 0.0], -bounds[0][0]),
            ([0.0, 1.0], bounds[1][1]),
            ([0.0, -1.0], -bounds[1][0]),
            (rim_gradient, -model.rim.min(0.0)),
        ];
        let best = highest_within(gradient, hessian, &limits);
        ([best.0[0] / scale[0], best.0[1] / scale[1]], best.1)
    }
}

fn plan_dot(d: [f64; 2], v: &geometry::Vector3) -> f64 {
    d[0] * v.x + d[1] * v.y
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn length_squared((e, f, g): (f64, f64, f64), d: [f64; 2]) -> f64 {
    e * d[0] * d[0] + 2.0 * f * d[0] * d[1] + g * d[1] * d[1]
}

/// The Hessian, lowered where needed until it is concave in all directions: so far that a step up
/// the gradient is about a radius long at most.
fn concave(h: [f64; 3], gradient: [f64; 2], radius: f64) -> [f64; 3] {
    let mean = 0.5 * (h[0] + h[2]);
    let spread = (0.5 * (h[0] - h[2])).hypot(h[1]);
    let least = CONCAVE * (mean.abs() + spread);
    if mean + spread < -least {
        return h;
    }
    let slope = gradient[0].hypot(gradient[1]);
    let lower = mean + spread + least.max(slope / radius).max(f64::MIN_POSITIVE);
    [h[0] - lower, h[1], h[2] - lower]
}

/// The maximum of `g·d + d·H d / 2` under `a·d <= b` for each limit `(a, b)`, with `H` concave and
/// every `b >= 0`: the place and the gain. Tries every set of at most two active limits.
fn highest_within(g: [f64; 2], h: [f64; 3], limits: &[([f64; 2], f64); 5]) -> ([f64; 2], f64) {
    let times = |d: [f64; 2]| [h[0] * d[0] + h[1] * d[1], h[1] * d[0] + h[2] * d[1]];
    let gain = |d: [f64; 2]| dot(g, d) + 0.5 * dot(d, times(d));
    // A limit is kept up to the rounding of its own terms.
    let allowed = |d: [f64; 2]| {
        limits.iter().all(|&(a, b)| dot(a, d) - b <= 1e-12 * ((a[0] * d[0]).abs() + (a[1] * d[1]).abs() + b))
    };
    let mut best = ([0.0; 2], 0.0);
    let mut offer = |d: [f64; 2]| {
        let fits = d[0].is_finite() && d[1].is_finite() && allowed(d);
        if fits && gain(d) > best.1 {
            best = (d, gain(d));
        }
        fits
    };
    let det = h[0] * h[2] - h[1] * h[1];
    if offer([(h[1] * g[1] - h[2] * g[0]) / det, (h[1] * g[0] - h[0] * g[1]) / det]) {
        return best;
    }
    for (i, &(a, b)) in limits.iter().enumerate() {
        let size = dot(a, a);
        let (foot, along) = ([a[0] * b / size, a[1] * b / size], [-a[1], a[0]]);
        let bend = dot(along, times(along));
        let s = -(dot(g, along) + dot(along, times(foot))) / bend;
        offer([foot[0] + s * along[0], foot[1] + s * along[1]]);
        for &(c, e) in &limits[i + 1..] {
            let cross = a[0] * c[1] - a[1] * c[0];
            offer([(b * c[1] - e * a[1]) / cross, (a[0] * e - c[0] * b) / cross]);
        }
    }
    best
}
