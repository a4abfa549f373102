//! From a place near the surface to the exact surface: feet of perpendiculars and meetings with
//! vertical lines, by Newton's method in the patch's parameters, which stay inside their range.

use super::Patch;
use super::patch::normal_of;
use crate::geometry::{AnalyticSurface, Jet2, NurbsSurface, Point3, Vector3};

/// Newton steps at most. Regular points take two to five; the rest is for starts beside poles and
/// silhouettes, where steps are halved.
const MAX_STEPS: usize = 60;

/// Halvings of one step at most: 2⁻³⁰ of a step is no step.
const MAX_HALVINGS: usize = 30;

/// Below this length, mm, a Newton step toward a foot is taken without asking whether the distance
/// fell: that close to its minimum the distance no longer resolves the place.
const TRUSTED_STEP: f64 = 1.0e-6;

/// Steps shorter than this end the search for a foot, mm; far out the rounding of coordinates is
/// added.
const SETTLED: f64 = 1.0e-13;

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
        let mut accepted = None;
        let mut share = 1.0;
        for _ in 0..MAX_HALVINGS {
            let next = clamp(&domain, [at[0] + share * step[0], at[1] + share * step[1]]);
            let candidate = patch.jet(next[0], next[1]);
            if length <= TRUSTED_STEP || (candidate.p - q).norm_squared() < r.norm_squared() {
                accepted = Some((next, candidate));
                break;
            }
            share *= 0.5;
        }
        let Some((next, candidate)) = accepted else { break };
        (at, jet) = (next, candidate);
    }
    Foot { at, jet, distance: (jet.p - q).norm(), held }
}

/// The step to the minimum of ½|S − q|², by its Hessian where that has a minimum, else by the
/// first fundamental form, which always points downhill.
fn foot_step(jet: &Jet2, r: &Vector3, g: [f64; 2], held: [bool; 2]) -> [f64; 2] {
    let (e, f, gg) = jet.first_form();
    let [h00, h01, h11] = [e + r.dot(&jet.duu), f + r.dot(&jet.duv), gg + r.dot(&jet.dvv)];
    let alone = |g: f64, newton: f64, metric: f64| match () {
        () if newton > SINGULAR * metric => -g / newton,
        () if metric > 0.0 => -g / metric,
        () => 0.0,
    };
    match held {
        [true, true] => [0.0, 0.0],
        [false, true] => [alone(g[0], h00, e), 0.0],
        [true, false] => [0.0, alone(g[1], h11, gg)],
        [false, false] => {
            if h00 > 0.0 && h11 > 0.0 && h00 * h11 - h01 * h01 > SINGULAR * e * gg {
                return solve(h00, h01, h01, h11, [-g[0], -g[1]]);
            }
            if e * gg - f * f > SINGULAR * e * gg {
                return solve(e, f, f, gg, [-g[0], -g[1]]);
            }
            [alone(g[0], 0.0, e), alone(g[1], 0.0, gg)]
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
    /// Steeper tangent planes are not followed sideways.
    const LEAST_UPRIGHT: f64 = 0.01;
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

fn clamp(domain: &[[f64; 2]; 2], at: [f64; 2]) -> [f64; 2] {
    [0, 1].map(|k| at[k].max(domain[k][0]).min(domain[k][1]))
}
