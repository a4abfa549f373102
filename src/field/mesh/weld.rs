//! Sews the triangles of several patches together along the borders that they share.
//!
//! Each patch is cut into triangles on its own, so that along a common border the vertices of one lie
//! between those of the other. Enters: points and triangles, a distance (mm) below which borders are
//! one. Leaves: border vertices that lie that near to each other merged, and triangles split at those
//! that lie on their sides.

use std::collections::HashMap;

use geometry::{Aabb, Point3, Vector3};

/// Border edges in the cells of a coarse grid.
struct Sides {
    cell: f64,
    cells: HashMap<[i64; 3], Vec<u32>>,
}

impl Sides {
    fn new(points: &[Point3], sides: &[[u32; 2]], cell: f64) -> Self {
        let mut grid = Self { cell, cells: HashMap::new() };
        for (k, side) in sides.iter().enumerate() {
            let mut bounds = Aabb::EMPTY;
            side.iter().for_each(|&i| bounds.grow(&points[i as usize]));
            let (lo, hi) = (grid.key(&bounds.min), grid.key(&bounds.max));
            for x in lo[0]..=hi[0] {
                for y in lo[1]..=hi[1] {
                    for z in lo[2]..=hi[2] {
                        grid.cells.entry([x, y, z]).or_default().push(k as u32);
                    }
                }
            }
        }
        grid
    }

    fn key(&self, p: &Point3) -> [i64; 3] {
        [p.x, p.y, p.z].map(|c| (c / self.cell).floor() as i64)
    }

    /// Sides that may come within a cell's size of `p`, ascending.
    fn near(&self, p: &Point3) -> Vec<u32> {
        let [x, y, z] = self.key(p);
        let mut found: Vec<u32> = (0..27)
            .filter_map(|k| self.cells.get(&[x + k % 3 - 1, y + k / 3 % 3 - 1, z + k / 9 - 1]))
            .flatten()
            .copied()
            .collect();
        found.sort_unstable();
        found.dedup();
        found
    }
}

/// Sews borders nearer than `distance` together. Merged vertices keep the place of the first of them;
/// triangles that vanish are left out, and so are vertices that no triangle has.
pub fn weld(points: &[Point3], triangles: &[[u32; 3]], distance: f64) -> (Vec<Point3>, Vec<[u32; 3]>) {
    let mut used: HashMap<(u32, u32), u32> = HashMap::new();
    let directed = |t: &[u32; 3]| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])];
    for (a, b) in triangles.iter().flat_map(directed) {
        *used.entry((a.min(b), a.max(b))).or_default() += 1;
    }
    let borders: Vec<[u32; 2]> = triangles
        .iter()
        .flat_map(directed)
        .filter(|&(a, b)| used[&(a.min(b), a.max(b))] == 1)
        .map(|(a, b)| [a, b])
        .collect();
    if borders.is_empty() || distance <= 0.0 {
        return (points.to_vec(), triangles.to_vec());
    }
    let mean = borders.iter().map(|[a, b]| (points[*a as usize] - points[*b as usize]).norm()).sum::<f64>()
        / borders.len() as f64;
    let grid = Sides::new(points, &borders, mean.max(2.0 * distance));
    let mut vertices: Vec<u32> = borders.iter().flatten().copied().collect();
    vertices.sort_unstable();
    vertices.dedup();
    // First merge ends that meet, then see which of the rest lie on sides.
    let mut head: Vec<u32> = (0..points.len() as u32).collect();
    for &v in &vertices {
        let p = points[v as usize];
        let ends = grid.near(&p).into_iter().flat_map(|k| borders[k as usize]);
        let near = ends.filter(|&w| w < v && (points[w as usize] - p).norm() <= distance);
        let joined_already = |w: &u32| used.contains_key(&(*w.min(&v), *w.max(&v)));
        let nearest = near
            .filter(|w| !joined_already(w))
            .min_by(|&a, &b| (points[a as usize] - p).norm().total_cmp(&(points[b as usize] - p).norm()));
        if let Some(w) = nearest {
            head[v as usize] = root(&head, w);
        }
    }
    let heads: Vec<u32> = (0..head.len() as u32).map(|v| root(&head, v)).collect();
    // Vertices on each border edge, named by its ends after merging.
    let mut on_side: HashMap<(u32, u32), Vec<(f64, u32)>> = HashMap::new();
    for &v in vertices.iter().filter(|&&v| heads[v as usize] == v) {
        let p = points[v as usize];
        for k in grid.near(&p) {
            let [a, b] = borders[k as usize].map(|i| heads[i as usize]);
            if a == b || a == v || b == v {
                continue;
            }
            let (from, to) = (points[a as usize], points[b as usize]);
            let d = to - from;
            let s = (p - from).dot(&d) / d.norm_squared();
            if s > 0.0 && s < 1.0 && (p - (from + d * s)).norm() <= distance {
                on_side.entry((a, b)).or_default().push((s, v));
            }
        }
    }
    for list in on_side.values_mut() {
        list.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        list.dedup_by_key(|x| x.1);
    }
    let mut sewn = Vec::with_capacity(triangles.len());
    for corners in triangles {
        let [a, b, c] = corners.map(|i| heads[i as usize]);
        if a == b || b == c || c == a {
            continue;
        }
        let mut polygon = Vec::new();
        for (from, to) in [(a, b), (b, c), (c, a)] {
            polygon.push(from);
            polygon.extend(on_side.get(&(from, to)).into_iter().flatten().map(|x| x.1));
        }
        cut_ears(points, polygon, &mut sewn);
    }
    compact(points, sewn)
}

/// The same triangles, joined only where an edge has two of them, one on each side: where more meet, or both
/// lie on one side, each gets vertices of its own there, and the surface has borders.
pub fn parted(points: &[Point3], triangles: &[[u32; 3]]) -> (Vec<Point3>, Vec<[u32; 3]>) {
    let corner = |t: usize, k: usize| (3 * t + k % 3) as u32;
    // Both corners of a side by its vertices, the lesser one first, and whether it runs that way.
    let mut sides: HashMap<[u32; 2], Vec<([u32; 2], bool)>> = HashMap::new();
    for (t, corners) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (from, to) = (corners[k], corners[(k + 1) % 3]);
            let (ends, at) = ([from.min(to), from.max(to)], [corner(t, k), corner(t, k + 1)]);
            let side = if from < to { (at, true) } else { ([at[1], at[0]], false) };
            sides.entry(ends).or_default().push(side);
        }
    }
    let mut head: Vec<u32> = (0..3 * triangles.len() as u32).collect();
    for side in sides.values() {
        if let [(a, forth), (b, back)] = side[..]
            && forth != back
        {
            for (a, b) in a.into_iter().zip(b) {
                let (a, b) = (root(&head, a), root(&head, b));
                head[a.max(b) as usize] = a.min(b);
            }
        }
    }
    let mut vertex_of: HashMap<u32, u32> = HashMap::new();
    let mut vertices = Vec::new();
    let mut vertex = |t: usize, k: usize| {
        *vertex_of.entry(root(&head, corner(t, k))).or_insert_with(|| {
            vertices.push(points[triangles[t][k] as usize]);
            vertices.len() as u32 - 1
        })
    };
    let triangles = (0..triangles.len()).map(|t| [0, 1, 2].map(|k| vertex(t, k))).collect();
    (vertices, triangles)
}

/// What a number is joined to in the end, each to a lesser one.
pub(super) fn root(head: &[u32], mut v: u32) -> u32 {
    while head[v as usize] != v {
        v = head[v as usize];
    }
    v
}

/// Cuts a polygon, nearly convex, into triangles: next always the ear that leaves both itself and the rest in
/// the best shape. An ear over a whole side would leave the vertices on that side as a sliver, which may even
/// face down.
fn cut_ears(points: &[Point3], mut polygon: Vec<u32>, out: &mut Vec<[u32; 3]>) {
    let p = |v: u32| points[v as usize];
    let doubled_area = |polygon: &[u32]| -> Vector3 {
        let fan = polygon[1..].windows(2);
        fan.map(|w| (p(w[0]) - p(polygon[0])).cross(&(p(w[1]) - p(polygon[0])))).sum()
    };
    let facing = doubled_area(&polygon);
    // Area over the square of the longest side, negative where it faces away.
    let shape = |polygon: &[u32]| {
        let sides = polygon.iter().zip(polygon.iter().cycle().skip(1));
        let longest2 = sides.map(|(&a, &b)| (p(b) - p(a)).norm_squared()).fold(0.0, f64::max);
        doubled_area(polygon).dot(&facing) / longest2
    };
    while polygon.len() > 3 {
        let n = polygon.len();
        let ear = |k: usize| [polygon[(k + n - 1) % n], polygon[k], polygon[(k + 1) % n]];
        let quality = |k: usize| {
            let mut rest = polygon.clone();
            rest.remove(k);
            shape(&ear(k)).min(shape(&rest))
        };
        let best = (0..n).map(|k| (quality(k), k)).max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        let Some((_, k)) = best else { return };
        out.push(ear(k));
        polygon.remove(k);
    }
    out.push([polygon[0], polygon[1], polygon[2]]);
}

/// Leaves out vertices without triangles.
pub(super) fn compact(points: &[Point3], mut triangles: Vec<[u32; 3]>) -> (Vec<Point3>, Vec<[u32; 3]>) {
    let mut number = vec![u32::MAX; points.len()];
    let mut kept = Vec::new();
    for v in triangles.iter_mut().flatten() {
        if number[*v as usize] == u32::MAX {
            number[*v as usize] = kept.len() as u32;
            kept.push(points[*v as usize]);
        }
        *v = number[*v as usize];
    }
    (kept, triangles)
}
