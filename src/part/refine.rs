//! From a place near the surface to the exact surface: feet of perpendiculars and meetings with vertical
//! lines, by Newton's method in the patch's parameters, which stay inside their range.
//!
//! Where two distances are equal within rounding, a step is judged by what it leaves to gain. Past a centre
//! of curvature Newton's step would climb; there it goes downhill by the size of each bend.

use super::patch::normal_of;
use super::{LEAST_UPRIGHT, Patch};
use geometry::{AnalyticSurface, Jet2, NurbsSurface, Point3, Vector3};

/// Newton steps at most. Regular points take two to five; the rest is for starts beside poles,
/// silhouettes and centres of curvature.
const MAX_STEPS: usize = 100;

/// Halvings of one step at most: 2⁻³⁰ of a step is no step.
const MAX_HALVINGS: i32 = 30;

/// Stretches of one step to four times its length at most: a step of a nanometre becomes one of
/// centimetres.
const MAX_STRETCHES: i32 = 12;

/// Two squared distances closer than this share of their rounding are the same: which of two feet is
/// nearer is then told by how upright they stand. A smaller share takes rounding for a fall or a rise,
/// and ends the search for a foot early; a larger one lets the distance rise by as much.
const UNRESOLVED: f64 = 16.0 * f64::EPSILON;

/// Steps shorter than this end the search for a foot, mm; far out the rounding of coordinates is
/// added.
const SETTLED: f64 = 1.0e-13;

/// Bends of the squared distance below this, relative to that over a plane, count as no more than
/// this: a smaller value sends steps far off where the bend is rounding, a larger one shortens steps
/// beside centres of curvature and so the way that can be made there.
const LEAST_BEND: f64 = 1.0e-7;

/// Where distances are the same, a step must leave less than this share of what there was to gain: near 1
/// the search walks about among rounding until its steps are used up, below 0.45 it refuses the
/// slowest steps that still lead somewhere (beside a cusp Newton's leave 0.3 to 0.44).
const PROGRESS: f64 = 0.6;

/// A determinant below this share of its factors counts as singular.
const SINGULAR: f64 = 1.0e-10;

/// The last step to a vertical line is a Taylor step once its second-order part is below this, mm:
/// the third-order part, which is left out, is then below 1e-13 mm, and the normal is right to 1e-10,
/// on any surface whose radii are above a tenth of a millimetre.
const TAYLOR: f64 = 1.0e-11;

/// The point of a patch nearest to a query point, as far as a descent from one start finds it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Foot {
    /// Its parameters.
    pub at: [f64; 2],
    /// Its jet.
    pub jet: Jet2,
    /// Its distance, mm.
    pub distance: f64,
    /// For u and v: the border of the patch holds the foot back.
    pub held: [bool; 2],
}

/// Descends from `start` to a foot of the perpendicular from `q`: a parameter at which `S − q` is
/// perpendicular to the surface, or would be but for the border. The distance never rises above
/// that of the start by more than rounding.
///
/// Near a foot the squared distance is flat, near a centre of curvature over a wide stretch: steps
/// there change it by less than its rounding, and are judged by what is left of the gradient.
pub(super) fn foot(patch: &Patch, q: &Point3, start: [f64; 2]) -> Foot {
    let domain = patch.domain();
    let mut at = clamp(&domain, start);
    let mut jet = patch.jet(at[0], at[1]);
    let mut held = [false; 2];
    for _ in 0..MAX_STEPS {
        let r = jet.p - q;
        let gradient = [r.dot(&jet.du), r.dot(&jet.dv)];
        held = [0, 1].map(|k| {
            let [lo, hi] = domain[k];
            (at[k] <= lo && gradient[k] > 0.0) || (at[k] >= hi && gradient[k] < 0.0)
        });
        let step = foot_step(&jet, &r, gradient, held);
        let length = (jet.du * step[0] + jet.dv * step[1]).norm();
        if length <= SETTLED + f64::EPSILON * jet.p.coords.amax() {
            break;
        }
        // Longer steps only where shorter ones gain nothing: past a place where a valley is all but level.
        let shares =
            (0..MAX_HALVINGS).map(|k| 0.5f64.powi(k)).chain((1..=MAX_STRETCHES).map(|k| 4f64.powi(k)));
        let mut tried = shares.map(|share| {
            let next = clamp(&domain, [at[0] + share * step[0], at[1] + share * step[1]]);
            (next, patch.jet(next[0], next[1]))
        });
        let accepted = tried.find(|(_, candidate)| nearer(candidate, &jet, q, step, held));
        let Some((next, candidate)) = accepted else { break };
        (at, jet) = (next, candidate);
    }
    Foot { at, jet, distance: (jet.p - q).norm(), held }
}

/// True when `candidate` is nearer to `q` than `jet` is or, where the two distances are the same, when
/// less is left to gain there than from `jet` by Newton's `step`. What is left to gain is measured by
/// one Hessian for both (the natural test of Deuflhard, *Newton Methods for Nonlinear Problems*, 2004):
/// lengths of the gradients alone would forbid all but the shortest steps along a bent valley.
fn nearer(candidate: &Jet2, jet: &Jet2, q: &Point3, step: [f64; 2], held: [bool; 2]) -> bool {
    let [now, before] = [candidate, jet].map(|j| (j.p - q).norm_squared());
    // The difference of coordinates is no better than these are.
    let rounding = UNRESOLVED * (before + before.sqrt() * (q.coords.amax() + jet.p.coords.amax()));
    if (now - before).abs() > rounding {
        return now < before;
    }
    let (r, r_now) = (jet.p - q, candidate.p - q);
    let gradient = |j: &Jet2, r: &Vector3| [r.dot(&j.du), r.dot(&j.dv)];
    let (g, g_now) = (gradient(jet, &r), gradient(candidate, &r_now));
    let left = foot_step(jet, &r, g_now, held);
    let lean = |j: &Jet2, g: [f64; 2]| {
        let along = |k: usize, d: &Vector3| if held[k] { 0.0 } else { g[k] * g[k] / d.norm_squared() };
        along(0, &j.du) + along(1, &j.dv)
    };
    let gain = |g: [f64; 2], step: [f64; 2]| (g[0] * step[0] + g[1] * step[1]).abs();
    lean(candidate, g_now) < PROGRESS * lean(jet, g) || gain(g_now, left) < PROGRESS * gain(g, step)
}

/// The step to the minimum of ½|S − q|²: Newton's, where the Hessian has a minimum. Past a centre of
/// curvature it has none: the step then goes downhill along each principal direction of the Hessian by
/// the size of its bend, at most that over a plane (beside a pole of the parameters bends are
/// rounding); by the first fundamental form alone it would creep.
fn foot_step(jet: &Jet2, r: &Vector3, g: [f64; 2], held: [bool; 2]) -> [f64; 2] {
    let (e, f, gg) = jet.first_form();
    let [h00, h01, h11] = [e + r.dot(&jet.duu), f + r.dot(&jet.duv), gg + r.dot(&jet.dvv)];
    let alone = |g: f64, bend: f64, metric: f64| {
        if metric > 0.0 { -g / bend.abs().max(LEAST_BEND * metric) } else { 0.0 }
    };
    match held {
        [true, true] => [0.0, 0.0],
        [false, true] => [alone(g[0], h00, e), 0.0],
        [true, false] => [0.0, alone(g[1], h11, gg)],
        [false, false] => {
            let area2 = e * gg - f * f;
            if h00 > 0.0 && h11 > 0.0 && h00 * h11 - h01 * h01 > SINGULAR * e * gg {
                return solve(h00, h01, h01, h11, [-g[0], -g[1]]);
            }
            if area2 <= SINGULAR * e * gg {
                return [alone(g[0], e, e), alone(g[1], gg, gg)];
            }
            // Orthonormal coordinates on the tangent plane: x = (√e u + f/√e v, √(area²/e) v).
            let (a, b) = (e.sqrt(), (area2 / e).sqrt());
            let c = f / a;
            let [gx, gy] = [g[0] / a, (g[1] - c * g[0] / a) / b];
            let hxx = h00 / e;
            let hxy = (h01 - c * h00 / a) / (a * b);
            let hyy = (h11 - 2.0 * c * h01 / a + c * c * h00 / e) / (b * b);
            let (mean, half) = (0.5 * (hxx + hyy), 0.5 * (hxx - hyy));
            let spread = half.hypot(hxy);
            // Projector onto the direction of the greater eigenvalue.
            let [pxx, pxy] = if spread > 0.0 { [half / spread, hxy / spread] } else { [1.0, 0.0] };
            let greater = [0.5 * (gx + pxx * gx + pxy * gy), 0.5 * (gy + pxy * gx - pxx * gy)];
            let bends = [mean + spread, mean - spread].map(|bend| bend.abs().clamp(LEAST_BEND, 1.0));
            let step = |greater: f64, all: f64| -greater / bends[0] - (all - greater) / bends[1];
            let (x, y) = (step(greater[0], gx), step(greater[1], gy));
            let v = y / b;
            [(x - c * v) / a, v]
        }
    }
}

/// Where a vertical line meets a patch.
#[derive(Debug, Clone, Copy)]
pub(super) struct VerticalMeeting {
    /// Parameters.
    pub at: [f64; 2],
    /// Height, mm; where the line passes beside the patch, that of the tangent plane.
    pub z: f64,
    /// Unit normal on the side of `du × dv`.
    pub normal: Vector3,
    /// By how much the line passes beside the patch, mm.
    pub miss: f64,
}

/// The vertical line through `(x, y)` and a graph, in closed form.
pub(super) fn vertical_on_graph(graph: &AnalyticSurface, x: f64, y: f64) -> VerticalMeeting {
    let h = graph.height_jet(x, y);
    let [[x0, x1], [y0, y1]] = graph.domain();
    let beside = [x - x.max(x0).min(x1), y - y.max(y0).min(y1)];
    let z = h.z + h.zx * beside[0] + h.zy * beside[1];
    VerticalMeeting { at: [x, y], z, normal: h.normal(), miss: beside[0].hypot(beside[1]) }
}

/// Follows the patch from `start` to the vertical line through `(x, y)`.
pub(super) fn vertical(patch: &NurbsSurface, x: f64, y: f64, start: [f64; 2]) -> VerticalMeeting {
    let domain = patch.domain();
    let mut at = clamp(&domain, start);
    let mut jet = patch.jet(at[0], at[1]);
    for _ in 0..MAX_STEPS {
        let r = [x - jet.p.x, y - jet.p.y];
        let step = vertical_step(&jet, r);
        let aim = [at[0] + step.delta[0], at[1] + step.delta[1]];
        let inside = clamp(&domain, aim) == aim;
        if step.regular && step.second_order <= TAYLOR && inside {
            return taylor(patch, &jet, at, step.delta);
        }
        let mut accepted = None;
        let mut share = 1.0;
        for _ in 0..MAX_HALVINGS {
            let next = clamp(&domain, [at[0] + share * step.delta[0], at[1] + share * step.delta[1]]);
            if next == at {
                break;
            }
            let candidate = patch.jet(next[0], next[1]);
            if (x - candidate.p.x).hypot(y - candidate.p.y) < r[0].hypot(r[1]) {
                accepted = Some((next, candidate));
                break;
            }
            share *= 0.5;
        }
        let Some((next, candidate)) = accepted else { break };
        (at, jet) = (next, candidate);
    }
    beside(patch, &jet, at, x, y)
}

struct VerticalStep {
    delta: [f64; 2],
    /// Size of the step's second-order part in space, mm.
    second_order: f64,
    /// False where the patch stands upright or has no normal, and the step only points the way.
    regular: bool,
}

/// The step to the vertical line at `r` from the jet's point, to second order.
fn vertical_step(jet: &Jet2, r: [f64; 2]) -> VerticalStep {
    let (du, dv) = (jet.du.xy(), jet.dv.xy());
    let det = du.x * dv.y - du.y * dv.x;
    let (e, g) = (jet.du.norm_squared(), jet.dv.norm_squared());
    if det * det <= SINGULAR * SINGULAR * e * g || det == 0.0 {
        // Steepest descent of the miss, each parameter by its own scale.
        let alone = |d: &nalgebra::Vector2<f64>| {
            let square = d.norm_squared();
            if square > 0.0 { (d.x * r[0] + d.y * r[1]) / square } else { 0.0 }
        };
        return VerticalStep {
            delta: [0.5 * alone(&du), 0.5 * alone(&dv)],
            second_order: f64::INFINITY,
            regular: false,
        };
    }
    let [a, b] = solve(du.x, dv.x, du.y, dv.y, r);
    let bend = (jet.duu * (a * a) + jet.duv * (2.0 * a * b) + jet.dvv * (b * b)) * 0.5;
    let second_order = bend.norm();
    let length = (jet.du * a + jet.dv * b).norm();
    // Where the second-order part is no small correction the series says nothing: plain Newton.
    if second_order > 0.25 * length {
        return VerticalStep { delta: [a, b], second_order, regular: true };
    }
    let delta = solve(du.x, dv.x, du.y, dv.y, [r[0] - bend.x, r[1] - bend.y]);
    VerticalStep { delta, second_order, regular: true }
}

/// The surface a small step away from a jet.
fn taylor(patch: &NurbsSurface, jet: &Jet2, at: [f64; 2], [a, b]: [f64; 2]) -> VerticalMeeting {
    let z = jet.p.z
        + jet.du.z * a
        + jet.dv.z * b
        + 0.5 * (jet.duu.z * a * a + 2.0 * jet.duv.z * a * b + jet.dvv.z * b * b);
    let moved =
        Jet2 { du: jet.du + jet.duu * a + jet.duv * b, dv: jet.dv + jet.duv * a + jet.dvv * b, ..*jet };
    let at = [at[0] + a, at[1] + b];
    VerticalMeeting { at, z, normal: normal_of(patch, &moved, at), miss: 0.0 }
}

/// The tangent plane over `(x, y)`, for lines that pass beside the patch.
fn beside(patch: &NurbsSurface, jet: &Jet2, at: [f64; 2], x: f64, y: f64) -> VerticalMeeting {
    let normal = normal_of(patch, jet, at);
    let (rx, ry) = (x - jet.p.x, y - jet.p.y);
    let rise = if normal.z.abs() > LEAST_UPRIGHT { -(normal.x * rx + normal.y * ry) / normal.z } else { 0.0 };
    VerticalMeeting { at, z: jet.p.z + rise, normal, miss: rx.hypot(ry) }
}

/// Solves `[[a, b], [c, d]] x = r`, whose determinant the caller knows not to vanish.
fn solve(a: f64, b: f64, c: f64, d: f64, r: [f64; 2]) -> [f64; 2] {
    let det = a * d - b * c;
    [(r[0] * d - b * r[1]) / det, (a * r[1] - r[0] * c) / det]
}

pub(super) fn clamp(domain: &[[f64; 2]; 2], at: [f64; 2]) -> [f64; 2] {
    [0, 1].map(|k| at[k].max(domain[k][0]).min(domain[k][1]))
}
