//! Closed forms: plane, elliptic speed, cylinder, cone and sphere, from borders, points and curves; signs;
//! cuts.

use std::f64::consts::{FRAC_PI_2, PI};

use proptest::prelude::*;

use super::*;
use work::monitor::Silent;

const SQUARE: [[f64; 2]; 2] = [[-1.0, 1.0], [-1.0, 1.0]];

fn flat(_: f64, _: f64) -> Option<Front> {
    Front::new((1.0, 0.0, 1.0), |_| 1.0)
}

fn arrival(
    domain: [[f64; 2]; 2],
    n: usize,
    front: &(dyn Fn(f64, f64) -> Option<Front> + Sync),
    curves: &[Vec<[f64; 2]>],
    signed: bool,
) -> GridField {
    let got = eikonal(domain, [n, n], front, &Start { curves, signed }, &Silent).unwrap();
    let greatest = nodes(&got.field).fold(0.0f64, |a, (_, b)| a.max(b.abs()));
    assert!(got.unsettled <= 1e-6 * greatest, "unsettled {} of {greatest}", got.unsettled);
    got.field
}

/// Parameters and values of all nodes.
fn nodes(field: &GridField) -> impl Iterator<Item = ([f64; 2], f64)> {
    let ([nu, nv], domain) = (field.cells(), field.domain());
    let at = move |c: usize, k: usize, n: usize| {
        domain[c][0] + (domain[c][1] - domain[c][0]) * k as f64 / n as f64
    };
    (0..=nv).flat_map(move |j| (0..=nu).map(move |i| ([at(0, i, nu), at(1, j, nv)], field.node(i, j))))
}

/// Greatest error at nodes where `exact` knows the value.
fn error(field: &GridField, exact: &dyn Fn(f64, f64) -> Option<f64>) -> f64 {
    let places = nodes(field);
    places.filter_map(|([u, v], got)| Some((got - exact(u, v)?).abs())).fold(0.0, f64::max)
}

/// The errors on two grids and the order between them.
fn order(
    domain: [[f64; 2]; 2],
    front: &(dyn Fn(f64, f64) -> Option<Front> + Sync),
    curves: &[Vec<[f64; 2]>],
    signed: bool,
    exact: &dyn Fn(f64, f64) -> Option<f64>,
) -> (f64, f64) {
    let [coarse, fine] = [61, 121].map(|n| error(&arrival(domain, n, front, curves, signed), exact));
    (fine, (coarse / fine.max(1e-15)).log2())
}

/// Points of a curve.
fn curve(n: usize, at: impl Fn(f64) -> [f64; 2]) -> Vec<[f64; 2]> {
    (0..=n).map(|k| at(k as f64 / n as f64)).collect()
}

#[test]
fn a_plane_front_is_exact_from_a_border_and_from_a_slanted_line() {
    let border = [vec![[-1.0, -1.0], [1.0, -1.0]]];
    assert!(error(&arrival(SQUARE, 40, &flat, &border, false), &|_, v| Some(v + 1.0)) < 1e-12);
    // A line across the whole square and beyond, with a sign. Behind its ends on the border are fans.
    let (c, s) = (0.3f64.cos(), 0.3f64.sin());
    let slanted = [vec![[-3.0 * c, -3.0 * s], [3.0 * c, 3.0 * s]]];
    let signed = arrival(SQUARE, 40, &flat, &slanted, true);
    let off = error(&signed, &|u, v| Some(v * c - u * s).filter(|_| u.abs() < 0.25));
    assert!(off < 1e-5, "{off}");
}

#[test]
fn distance_from_a_circle_is_of_second_order_with_its_sign() {
    let circle = [curve(2000, |t| [0.5 * (2.0 * PI * t).cos(), 0.5 * (2.0 * PI * t).sin()])];
    // The circle runs with its inside on the left; the middle is a kink.
    let exact = |u: f64, v: f64| Some(0.5 - u.hypot(v)).filter(|d| *d < 0.15);
    let (fine, order) = order(SQUARE, &flat, &circle, true, &exact);
    println!("circle: error {fine:.2e}, order {order:.2}");
    assert!(fine < 4e-4 && order > 1.8, "error {fine}, order {order}");
}

#[test]
fn a_point_sends_out_circles_of_first_order() {
    let exact = |u: f64, v: f64| Some((u - 0.1).hypot(v + 0.2));
    let (fine, order) = order(SQUARE, &flat, &[vec![[0.1, -0.2]]], false, &exact);
    println!("point: error {fine:.2e}, order {order:.2}");
    assert!(fine < 0.01 && order > 0.8, "error {fine}, order {order}");
}

/// An elliptic speed is a stretched plane: fronts from a circle in the stretched plane.
#[test]
fn elliptic_fronts_are_those_of_the_stretched_plane() {
    let (a, b, turn) = (1.6f64, 0.8f64, 0.5f64);
    let (c, s) = (turn.cos(), turn.sin());
    // H(p) = |diag(a, b) R p|, a vector n of length 1: speed(n) = |diag(a, b) R n|.
    let stretched = move |u: f64, v: f64| [(c * u + s * v) / a, (c * v - s * u) / b];
    let front = move |_: f64, _: f64| {
        Front::new((1.0, 0.0, 1.0), |[x, y]| (a * (c * x + s * y)).hypot(b * (c * y - s * x)))
    };
    let ring = curve(4000, |t| {
        let (x, y) = (0.4 * a * (2.0 * PI * t).cos(), 0.4 * b * (2.0 * PI * t).sin());
        [c * x - s * y, s * x + c * y]
    });
    let exact = |u: f64, v: f64| {
        let [x, y] = stretched(u, v);
        Some(0.4 - x.hypot(y)).filter(|d| *d < 0.2)
    };
    let (fine, order) = order(SQUARE, &front, &[ring], true, &exact);
    println!("ellipse: error {fine:.2e}, order {order:.2}");
    assert!(fine < 1e-3 && order > 1.7, "error {fine}, order {order}");
}

/// Speed along the axes as strips have them, from a border: φ follows a closed form by separation.
#[test]
fn speeds_that_change_with_place_and_direction_are_of_second_order() {
    // φ = v + 0.2 sin(2u) (1 + v) prescribed, so that φ = 0 on v = -1 is off; start on the curve φ = 0
    // instead.
    let phi = |u: f64, v: f64| v + 0.25 * (2.0 * u).sin();
    let slope = |u: f64, _: f64| [0.5 * (2.0 * u).cos(), 1.0];
    // Slowness² = (1 + 0.3 cos 2(θ − 0.4)) m(u, v), with m such that φ solves it.
    let shape = |x: f64, y: f64| {
        let (cos, sin) = ((x * x - y * y) / (x * x + y * y), 2.0 * x * y / (x * x + y * y));
        1.0 + 0.3 * (cos * 0.8f64.cos() + sin * 0.8f64.sin())
    };
    let front = move |u: f64, v: f64| {
        let [p, q] = slope(u, v);
        let m = (p * p + q * q) / shape(p, q);
        Front::new((1.0, 0.0, 1.0), |[x, y]| 1.0 / (m * shape(x, y)).sqrt())
    };
    let zero = curve(4000, |t| {
        let u = -1.5 + 3.0 * t;
        [u, -0.25 * (2.0 * u).sin()]
    });
    // Where characteristics come in through the sides the answer is another.
    let exact = |u: f64, v: f64| (u.abs() < 0.3).then(|| phi(u, v));
    let (fine, order) = order(SQUARE, &front, &[zero], true, &exact);
    println!("changing speed: error {fine:.2e}, order {order:.2}");
    assert!(fine < 1e-3 && order > 1.7, "error {fine}, order {order}");
}

#[test]
fn geodesic_distances_on_cylinder_cone_and_sphere() {
    // A cylinder of radius 2 by angle and height: unrolled it is a plane.
    let cylinder = |_: f64, _: f64| Front::new((4.0, 0.0, 1.0), |_| 0.5);
    let slanted = [vec![[-2.0, -1.0], [2.0, 1.0]]];
    let norm = (0.25f64 * 0.25 + 1.0).sqrt();
    let off = error(&arrival(SQUARE, 41, &cylinder, &slanted, true), &|u, v| {
        Some(2.0 * (v - 0.5 * u) / norm).filter(|_| u.abs() < 0.4)
    });
    assert!(off < 1e-6, "cylinder {off}");
    // A cone of half angle 30° by angle and distance from its tip, from the ray at angle 0: r sin(angle/2).
    let cone = |_: f64, r: f64| Front::new((0.25 * r * r, 0.0, 1.0), |_| 1.0);
    let domain = [[0.0, 2.0], [0.5, 2.0]];
    let exact = |u: f64, r: f64| Some(r * (0.5 * u).sin()).filter(|_| r * (0.5 * u).cos() > 0.6);
    let (fine, rate) = order(domain, &cone, &[vec![[0.0, 0.1], [0.0, 3.0]]], false, &exact);
    println!("cone: error {fine:.2e}, order {rate:.2}");
    assert!(fine < 2e-4 && rate > 1.8, "cone: error {fine}, order {rate}");
    // A unit sphere by longitude and latitude, from the meridian of 0: asin(cos(latitude) sin(longitude)).
    let sphere = |_: f64, v: f64| Front::new((v.cos().powi(2), 0.0, 1.0), |_| 1.0);
    let domain = [[0.0, 1.2], [-1.0, 1.0]];
    let exact = |u: f64, v: f64| {
        // Great circles across the meridian come from latitudes nearer to the pole.
        (v.tan() / u.cos()).abs().lt(&0.9f64.tan()).then(|| (v.cos() * u.sin()).asin())
    };
    let (fine, rate) = order(domain, &sphere, &[vec![[0.0, -FRAC_PI_2], [0.0, FRAC_PI_2]]], false, &exact);
    println!("sphere: error {fine:.2e}, order {rate:.2}");
    assert!(fine < 5e-4 && rate > 1.8, "sphere: error {fine}, order {rate}");
}

/// The plane with skewed parameters: metric with F, fronts that leave their quadrant of parameters.
#[test]
fn skewed_parameters_change_nothing() {
    // x = u + 0.8 v, y = 0.6 v.
    let skew = |_: f64, _: f64| Front::new((1.0, 0.8, 1.0), |_| 1.0);
    let (x, y) = (|u: f64, v: f64| u + 0.8 * v, |v: f64| 0.6 * v);
    // The line y = 0.2 x + c through the origin, beyond the domain on both sides.
    let line = [curve(1, |t| {
        let px = -6.0 + 12.0 * t;
        let v = 0.2 * px / 0.6;
        [px - 0.8 * v, v]
    })];
    let exact = |u: f64, v: f64| Some((y(v) - 0.2 * x(u, v)) / 1.04f64.sqrt());
    let off = error(&arrival(SQUARE, 41, &skew, &line, true), &|u, v| {
        exact(u, v).filter(|_| (u + v).abs() < 0.2 && v.abs() < 0.5)
    });
    assert!(off < 1e-6, "{off}");
}

#[test]
fn fronts_from_all_borders_meet_in_the_middle() {
    let around = [vec![[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]]];
    let field = arrival(SQUARE, 61, &flat, &around, false);
    let off = error(&field, &|u, v| Some(1.0 - u.abs().max(v.abs())));
    assert!(off < 0.01, "{off}");
}

/// A slowness so uneven that its diagram has dents (ratio of squares 4) still moves plane fronts at their
/// speed.
#[test]
fn plane_fronts_keep_their_speed_where_the_diagram_is_dented() {
    let front = |_: f64, _: f64| Front::new((1.0, 0.0, 1.0), |[x, y]| 1.0 / (x * x + 4.0 * y * y).sqrt());
    for turn in [0.0f64, 0.3, 0.8, 1.3] {
        let (c, s) = (turn.cos(), turn.sin());
        let line = [vec![[-3.0 * c, -3.0 * s], [3.0 * c, 3.0 * s]]];
        // Across the line: (-s, c).
        let slowness = (s * s + 4.0 * c * c).sqrt();
        let field = arrival(SQUARE, 41, &front, &line, true);
        let off = error(&field, &|u, v| Some(slowness * (v * c - u * s)).filter(|_| u.hypot(v) < 0.4));
        println!("dented, turned by {turn}: {off:.2e}");
        assert!(off < 1e-3, "turn {turn}: {off}");
    }
}

/// The hippopede `s² = x² + 4 y²` has a dent on either side, which its common tangent `x = 2/√3` closes.
#[test]
fn a_convex_front_has_the_hull_of_a_hippopede() {
    let slowness = |t: f64| (t.cos().powi(2) + 4.0 * t.sin().powi(2)).sqrt();
    for turn in [0.0, 0.3, 1.9] {
        let speed = |[x, y]: [f64; 2]| 1.0 / slowness(y.atan2(x) - turn);
        let front = Front::new((1.0, 0.0, 1.0), speed).unwrap().convex();
        for k in 0..720 {
            let t = f64::from(k) * PI / 720.0 - FRAC_PI_2;
            let hull = if t.cos().powi(2) > 2.0 / 3.0 { 2.0 / (3f64.sqrt() * t.cos()) } else { slowness(t) };
            let (sin, cos) = (t + turn).sin_cos();
            let got = front.square([cos, sin]).0.sqrt();
            assert!((got - hull).abs() < 2e-3 * hull, "turned by {turn}, at {t}: {got} {hull}");
        }
    }
    // What is convex stays as it is.
    let ellipse = Front::new((1.0, 0.0, 1.0), |[x, y]| 1.0 / (x * x + 1.5 * y * y).sqrt()).unwrap();
    for k in 0..100 {
        let (sin, cos) = (0.1 * f64::from(k)).sin_cos();
        let (given, convex) = (ellipse.square([cos, sin]).0, ellipse.convex().square([cos, sin]).0);
        assert!((given - convex).abs() < 1e-6 * given, "{given} {convex}");
    }
}

#[test]
fn what_cannot_be_solved_is_said() {
    let start = |curves| Start { curves, signed: false };
    let line = [vec![[-1.0, 0.0], [1.0, 0.0]]];
    let (beyond, broken) = ([vec![[5.0, 5.0], [6.0, 5.0]]], [vec![[f64::NAN, 0.0], [0.0, 0.0]]]);
    let run = |nodes, front: &(dyn Fn(f64, f64) -> Option<Front> + Sync), curves| {
        eikonal(SQUARE, nodes, front, &start(curves), &Silent).map(|_| ())
    };
    assert_eq!(run([2, 9], &flat, &line), Err(EikonalError::Grid(2, 9)));
    assert_eq!(run([9, 9], &flat, &beyond), Err(EikonalError::NoStart));
    assert_eq!(run([9, 9], &flat, &broken), Err(EikonalError::NoStart));
    assert_eq!(run([9, 9], &|_, _| None, &line), Err(EikonalError::Degenerate));
    // A hole in the metric is passed over.
    let holed = |u: f64, v: f64| flat(u, v).filter(|_| u.hypot(v) > 0.3);
    assert_eq!(run([31, 31], &holed, &line), Ok(()));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]

    /// A greater speed nowhere makes a front later; twice the speed halves φ.
    #[test]
    fn faster_fronts_are_earlier(least in 0.5..1.0f64, more in 0.0..0.4f64, turn in 0.0..3.0f64, x in -0.9..0.9f64) {
        let speed = move |[a, b]: [f64; 2], u: f64| {
            least + 0.2 * (a * turn.cos() + b * turn.sin()).powi(2) + 0.1 * (3.0 * u).sin()
        };
        let slow = |u: f64, _: f64| Front::new((1.0, 0.2, 1.2), |d| speed(d, u));
        let fast = |u: f64, _: f64| Front::new((1.0, 0.2, 1.2), |d| speed(d, u) + more);
        let twice = |u: f64, _: f64| Front::new((1.0, 0.2, 1.2), |d| 2.0 * speed(d, u));
        let line = [vec![[x, -1.0], [0.3 - x, 1.0]]];
        let run = |front: &(dyn Fn(f64, f64) -> Option<Front> + Sync)| arrival(SQUARE, 21, front, &line, false);
        let (slow, fast, twice) = (run(&slow), run(&fast), run(&twice));
        for (((_, s), (_, f)), (_, t)) in nodes(&slow).zip(nodes(&fast)).zip(nodes(&twice)) {
            prop_assert!(f <= s + 0.02, "{f} {s}");
            prop_assert!((2.0 * t - s).abs() < 1e-5 * (1.0 + s));
        }
    }
}

/// Where the speed changes by much from node to node, and by direction, sweeps may carry φ away without end:
/// they tell that they do not settle. Convex fronts do, and stay within what the least and the greatest speed
/// allow.
#[test]
fn a_front_through_sudden_changes_of_speed_settles_where_it_is_convex() {
    let border = [vec![[-1.0, -1.0], [1.0, -1.0]]];
    let [slow, fast] = [0.05, 1.0];
    let moved = |waves: f64, convex: bool| {
        let front = |u: f64, v: f64| {
            let turn = (waves * u).sin() + (waves * v).cos();
            let along = move |[x, y]: [f64; 2]| (x * turn.cos() + y * turn.sin()).powi(2);
            let front = Front::new((1.0, 0.0, 1.0), |across| slow + (fast - slow) * along(across).powi(4))?;
            Some(if convex { front.convex() } else { front })
        };
        eikonal(SQUARE, [61, 61], &front, &Start { curves: &border, signed: false }, &Silent).unwrap()
    };
    for waves in [9.0, 17.0, 31.0] {
        let given = moved(waves, false).unsettled;
        assert!(given > 1e-3, "{waves}: {given}");
        let arrival = moved(waves, true);
        assert!(arrival.unsettled < 1e-3, "{waves}: {}", arrival.unsettled);
        for ([u, v], phi) in nodes(&arrival.field) {
            let [least, greatest] = [fast, slow].map(|speed| (v + 1.0) / speed);
            assert!((0.9 * least..=1.1 * greatest).contains(&phi), "{waves} {u} {v}: {phi}");
        }
    }
}
