//! NURBS patches with known closed forms, for tests of several stages.

use super::{NurbsSurface, Point3};
use std::f64::consts::FRAC_1_SQRT_2;

/// Control points and weights of the full circle x² + y² = 1 in nine points (Piegl & Tiller
/// ex. 7.2).
const CIRCLE: [[f64; 3]; 9] = [
    [1.0, 0.0, 1.0],
    [1.0, 1.0, FRAC_1_SQRT_2],
    [0.0, 1.0, 1.0],
    [-1.0, 1.0, FRAC_1_SQRT_2],
    [-1.0, 0.0, 1.0],
    [-1.0, -1.0, FRAC_1_SQRT_2],
    [0.0, -1.0, 1.0],
    [1.0, -1.0, FRAC_1_SQRT_2],
    [1.0, 0.0, 1.0],
];

fn circle_knots(quarters: usize) -> Vec<f64> {
    let mut knots = vec![0.0; 3];
    for q in 1..=quarters {
        knots.extend([q as f64; 2]);
    }
    knots.push(quarters as f64);
    knots
}

fn build(ku: Vec<f64>, kv: Vec<f64>, net: Vec<Vec<(Point3, f64)>>, degree_v: usize) -> NurbsSurface {
    let points: Vec<Vec<Point3>> = net.iter().map(|r| r.iter().map(|p| p.0).collect()).collect();
    let weights: Vec<Vec<f64>> = net.iter().map(|r| r.iter().map(|p| p.1).collect()).collect();
    NurbsSurface::new(2, degree_v, ku, kv, &points, Some(&weights)).unwrap()
}

/// The upper half of a sphere about `centre`: u runs around from x, v from the equator (0) to the
/// pole (1), where the patch is degenerate; the seam u = 0, 4 is closed.
pub fn hemisphere(centre: Point3, radius: f64) -> NurbsSurface {
    let net = CIRCLE.iter().map(|&[x, y, w]| {
        let meridian = [(1.0, 0.0, 1.0), (1.0, 1.0, FRAC_1_SQRT_2), (0.0, 1.0, 1.0)];
        let lift = |&(s, z, w2): &(f64, f64, f64)| {
            (centre + nalgebra::Vector3::new(s * x, s * y, z) * radius, w * w2)
        };
        meridian.iter().map(lift).collect()
    });
    build(circle_knots(4), circle_knots(1), net.collect(), 2)
}

/// Half a cylinder about the y axis, 0 <= y <= length, top at z = radius: u runs over the arc from
/// +x over the top to −x (0 to 2), v along the axis (0 to 1).
pub fn half_cylinder(radius: f64, length: f64) -> NurbsSurface {
    let net = CIRCLE[..5].iter().map(|&[x, z, w]| {
        let at = |y: f64| (Point3::new(radius * x, y, radius * z), w);
        vec![at(0.0), at(length)]
    });
    build(circle_knots(2), vec![0.0, 0.0, 1.0, 1.0], net.collect(), 1)
}

/// A gently waved bicubic patch over about 60 × 60 mm, 7 × 6 control points, with the given
/// weights repeated over the net.
pub fn bicubic(weights: &[f64]) -> NurbsSurface {
    let knots = |n: usize| super::KnotVector::clamped_uniform(3, n, [0.0, 1.0]).unwrap().knots().to_vec();
    let points: Vec<Vec<Point3>> = (0..7)
        .map(|i| {
            let x = 10.0 * i as f64;
            (0..6)
                .map(|j| Point3::new(x, 12.0 * j as f64, 6.0 * (1.3 * i as f64 + 0.9 * j as f64).sin()))
                .collect()
        })
        .collect();
    let weights: Vec<Vec<f64>> =
        (0..7).map(|i| (0..6).map(|j| weights[(i * 6 + j) % weights.len()]).collect()).collect();
    NurbsSurface::new(3, 3, knots(7), knots(6), &points, Some(&weights)).unwrap()
}

/// The patch of scenes/ridge.json: a winding ridge between two winding valleys over 60 × 60 mm.
/// Bicubic, 16 × 16 control points, parameter lines that wind as well; control points to 0.001 mm, so
/// that the file does not depend on the last digit of anyone's sine.
pub fn ridge() -> NurbsSurface {
    const SIDE: f64 = 60.0;
    const COUNT: usize = 16;
    let knots = super::KnotVector::clamped_uniform(3, COUNT, [0.0, 1.0]).unwrap();
    // Averages of three knots (Greville), where control points reproduce straight lines.
    let average = |i: usize| knots.knots()[i + 1..=i + 3].iter().sum::<f64>() / 3.0;
    let round = |c: f64| (c * 1000.0).round() / 1000.0 + 0.0;
    let point = |i: usize, j: usize| {
        use std::f64::consts::{PI, TAU};
        let (s, t) = (average(i), average(j));
        let x = SIDE * s + 2.5 * (PI * s).sin() * (TAU * t).sin();
        let y = SIDE * t + 2.5 * (TAU * s).sin() * (PI * t).sin();
        let across = (x - 0.5 * SIDE - 5.0 * (TAU * y / SIDE).sin()) / 15.0;
        let z = 3.2 * (PI * across).cos() * (1.0 + 0.12 * (TAU * y / 40.0).cos()) + 0.02 * y;
        Point3::new(round(x), round(y), round(z))
    };
    let points: Vec<Vec<Point3>> = (0..COUNT).map(|i| (0..COUNT).map(|j| point(i, j)).collect()).collect();
    NurbsSurface::new(3, 3, knots.knots().to_vec(), knots.knots().to_vec(), &points, None).unwrap()
}

/// The patches of scenes/joined.json: three side by side with tangent planes in common along their borders,
/// cut into spans and parametrised differently. About 54 × 36 mm; control points to 0.001 mm, but for those
/// that follow from a neighbour's.
pub fn joined() -> Vec<NurbsSurface> {
    let round = |c: f64| (c * 1000.0).round() / 1000.0 + 0.0;
    let height = |x: f64, y: f64| 2.6 * (0.16 * x + 0.5).sin() * (0.13 * y).cos() + 0.04 * x;
    // Control columns of each patch by their distance along x; the first two of a later patch follow
    // from the last two of the one before.
    let columns: [&[f64]; 3] = [
        &[0.0, 4.0, 9.0, 13.0, 16.0, 18.0],
        &[18.0, 20.0, 24.0, 27.0, 31.0, 34.0, 36.0],
        &[36.0, 40.0, 45.0, 50.0, 54.0],
    ];
    let rows = 8;
    let mut patches: Vec<Vec<Vec<Point3>>> = Vec::new();
    for xs in columns {
        let mut net: Vec<Vec<Point3>> = xs
            .iter()
            .map(|&x| {
                (0..rows)
                    .map(|j| {
                        let y = 36.0 * j as f64 / (rows - 1) as f64;
                        let x = x + 1.2 * (0.17 * y).sin();
                        Point3::new(round(x), round(y), round(height(x, y)))
                    })
                    .collect()
            })
            .collect();
        if let Some(before) = patches.last() {
            let n = before.len();
            let ratio = (xs[1] - xs[0]) / 2.0;
            for j in 0..rows {
                let (end, inner) = (before[n - 1][j], before[n - 2][j]);
                net[0][j] = end;
                net[1][j] = end + (end - inner) * ratio;
            }
        }
        patches.push(net);
    }
    let knots = |n: usize| super::KnotVector::clamped_uniform(3, n, [0.0, 1.0]).unwrap().knots().to_vec();
    let surface =
        |net: &Vec<Vec<Point3>>| NurbsSurface::new(3, 3, knots(net.len()), knots(rows), net, None).unwrap();
    patches.iter().map(surface).collect()
}
