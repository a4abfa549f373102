//! Cutting a polygon in space into triangles.

use geometry::{Point3, Vector3};

/// Cuts the polygon into triangles that cover it once and face its way, and adds them to
/// `triangles`. `corners` is used up.
///
/// Convex polygons become a fan around their first corner. Others lose one ear after the other (G.
/// H. Meisters, "Polygons have ears", 1975), seen along their mean normal (Newell's). A polygon that
/// crosses itself has no right answer; it gets some triangles.
pub(super) fn cut(vertices: &[Point3], corners: &mut Vec<u32>, triangles: &mut Vec<[u32; 3]>) {
    let at = |i: u32| vertices[i as usize].coords;
    let normal = mean_normal(corners.iter().map(|&i| at(i)));
    let turn = |a: u32, b: u32, c: u32| (at(b) - at(a)).cross(&(at(c) - at(b))).dot(&normal);
    while corners.len() > 3 && !is_convex(corners, &turn) {
        let n = corners.len();
        let around = |k: usize| [corners[(k + n - 1) % n], corners[k], corners[(k + 1) % n]];
        let is_ear = |k: usize| {
            let [a, b, c] = around(k);
            // A reflex corner inside or on the border forbids the cut.
            let blocks = |&p: &u32| {
                at(p) != at(a)
                    && at(p) != at(b)
                    && at(p) != at(c)
                    && turn(a, b, p) >= 0.0
                    && turn(b, c, p) >= 0.0
                    && turn(c, a, p) >= 0.0
            };
            turn(a, b, c) > 0.0 && !corners.iter().any(blocks)
        };
        // Without an ear (it crosses itself, or has no area) any corner goes.
        let ear = (0..n).find(|&k| is_ear(k)).unwrap_or(0);
        triangles.push(around(ear));
        corners.remove(ear);
    }
    triangles.extend(corners.windows(2).skip(1).map(|pair| [corners[0], pair[0], pair[1]]));
}

fn is_convex(corners: &[u32], turn: &impl Fn(u32, u32, u32) -> f64) -> bool {
    let n = corners.len();
    // Every fan triangle must face the polygon's way, not only every corner: a star turns the same
    // way all around, twice.
    (0..n).all(|k| turn(corners[k], corners[(k + 1) % n], corners[(k + 2) % n]) >= 0.0)
        && (1..n - 1).all(|k| turn(corners[0], corners[k], corners[k + 1]) >= 0.0)
}

/// Newell's normal, of any length: the sum of the triangles seen from the first corner.
fn mean_normal(mut points: impl Iterator<Item = Vector3>) -> Vector3 {
    let Some(first) = points.next() else {
        return Vector3::zeros();
    };
    let mut sum = Vector3::zeros();
    let mut last = Vector3::zeros();
    for p in points {
        sum += last.cross(&(p - first));
        last = p - first;
    }
    sum
}
