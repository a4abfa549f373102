//! See the module.

use std::collections::HashMap;

use super::*;
use cutter::Cutter;
use geometry::{Point2, Point3};
use motion::Move;
use sim::scenes::{Rng, cutters, path_through, random_path};
use sim::{Envelope, Grid, cut_reference};
use work::monitor::Silent;

fn map(nx: usize, ny: usize, height: impl Fn(f64, f64) -> f64) -> ZMap {
    let grid = Grid { origin: Point2::new(-3.0, 2.0), cell: 0.1, nx, ny };
    let mut map = ZMap::block(grid, 0.0);
    for (j, i) in (0..ny).flat_map(|j| (0..nx).map(move |i| (j, i))) {
        let centre = grid.centre(i, j);
        map.height[grid.index(i, j)] = height(centre.x, centre.y) as f32;
    }
    map
}

/// The mesh of a map without passes.
fn smooth(map: &ZMap, bottom: f64, tolerance: f64, max_triangles: usize) -> Option<SurfaceMesh> {
    let (cutter, path) = (Cutter::ball(6.0).unwrap(), path_through([Point3::origin()]));
    surface_mesh(map, &cutter.into(), &path, bottom, tolerance, max_triangles)
}

fn wavy(x: f64, y: f64) -> f64 {
    (0.8 * x).sin() * (1.3 * y).cos() + 0.05 * (9.0 * x).sin().abs()
}

/// Coordinates of f32 leave open on which of two triangles a cell lies that is nearer than this to
/// both, in cells.
const SAME_PLACE: f64 = 1e-4;

/// Greatest vertical distance of a cell from the top, and the number of cells found under it. A cell
/// on an edge counts for the nearer of its triangles.
fn distance(map: &ZMap, mesh: &SurfaceMesh) -> (f64, usize) {
    let grid = map.grid;
    let mut nearest = vec![f64::INFINITY; grid.len()];
    for t in &mesh.triangles {
        let corners = t.map(|k| mesh.vertices[k as usize].map(f64::from));
        let node = |p: [f64; 3]| ((p[0] - grid.origin.x) / grid.cell, (p[1] - grid.origin.y) / grid.cell);
        let nodes = corners.map(node);
        let [(ax, ay), (bx, by), (cx, cy)] = nodes;
        let area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay);
        if area < 1e-7 {
            continue; // walls and bottom
        }
        let range = |a: f64, b: f64, c: f64| {
            let (low, high) = (a.min(b).min(c) - SAME_PLACE, a.max(b).max(c) + SAME_PLACE);
            low.ceil() as usize..=high.floor() as usize
        };
        for j in range(ay, by, cy) {
            for i in range(ax, bx, cx) {
                let (x, y) = (i as f64, j as f64);
                // Twice the area between the place and the side that faces each corner.
                let parts = [1, 2, 0].map(|k| {
                    let ((px, py), (qx, qy)) = (nodes[k], nodes[(k + 1) % 3]);
                    ((qx - px) * (y - py) - (x - px) * (qy - py), (qx - px).hypot(qy - py))
                });
                if parts.iter().all(|(part, side)| *part > -SAME_PLACE * side) {
                    let z: f64 = (0..3).map(|k| parts[k].0 / area * corners[k][2]).sum();
                    let cell = grid.index(i, j);
                    nearest[cell] = nearest[cell].min((z - f64::from(map.height[cell])).abs());
                }
            }
        }
    }
    let found = nearest.iter().filter(|d| d.is_finite()).count();
    (nearest.into_iter().filter(|d| d.is_finite()).fold(0.0, f64::max), found)
}

fn volume(mesh: &SurfaceMesh) -> f64 {
    let corner = |k: u32| nalgebra::Vector3::from(mesh.vertices[k as usize].map(f64::from));
    mesh.triangles.iter().map(|t| corner(t[0]).cross(&corner(t[1])).dot(&corner(t[2])) / 6.0).sum()
}

fn assert_closed(mesh: &SurfaceMesh) {
    let mut edges = HashMap::new();
    for t in &mesh.triangles {
        for k in 0..3 {
            *edges.entry((t[k], t[(k + 1) % 3])).or_insert(0) += 1;
        }
    }
    for ((a, b), count) in &edges {
        assert_eq!((*count, edges.get(&(*b, *a))), (1, Some(&1)), "edge {a} {b}");
    }
}

#[test]
fn every_cell_is_within_the_tolerance_and_the_solid_is_closed() {
    for (nx, ny) in [(2, 2), (3, 2), (65, 65), (70, 33), (300, 130), (5, 600), (258, 257)] {
        let map = map(nx, ny, wavy);
        for tolerance in [1e-6, 0.002, 0.05, 10.0] {
            let mesh = smooth(&map, -5.0, tolerance, usize::MAX).unwrap();
            let (worst, found) = distance(&map, &mesh);
            assert!(worst <= tolerance + 1e-6, "{nx} x {ny}: {worst} at {tolerance}");
            assert_eq!(found, map.grid.len(), "{nx} x {ny}: the top has holes");
            assert_closed(&mesh);
        }
    }
}

#[test]
fn a_plane_needs_few_triangles_and_has_its_volume() {
    let map = map(257, 257, |x, y| 1.0 + 0.1 * x - 0.2 * y);
    let mesh = smooth(&map, -10.0, 1e-3, MAX_TRIANGLES).unwrap();
    // Two on top, and a wall and a bottom triangle or three a rim edge.
    assert_eq!(mesh.triangles.len(), 2 + 4 * 3);
    let side = 25.6;
    let middle = 1.0 + 0.1 * (-3.0 + 12.8) - 0.2 * (2.0 + 12.8);
    assert!((volume(&mesh) / (side * side * (middle + 10.0)) - 1.0).abs() < 1e-6);
}

#[test]
fn the_tolerance_grows_until_the_triangles_fit() {
    let map = map(257, 257, wavy);
    let fine = smooth(&map, -5.0, 1e-4, usize::MAX).unwrap();
    let coarse = smooth(&map, -5.0, 1e-4, 5000).unwrap();
    assert!(fine.triangles.len() > 20_000 && coarse.triangles.len() < 10_000);
    assert!(coarse.tolerance > 1e-4);
    let finer = smooth(&map, -5.0, coarse.tolerance / 1.1, usize::MAX).unwrap();
    assert!(finer.triangles.len() > 5000, "no finer one would have fitted");
    assert!(distance(&map, &coarse).0 <= coarse.tolerance);
}

#[test]
fn a_single_row_spans_no_surface() {
    assert_eq!(smooth(&map(5, 1, wavy), -5.0, 0.01, 100), None);
}

/// A plane of 12 × 9 mm cut by a ball of radius 3 in passes 0.5 mm apart that cross the cells at an
/// angle, and the true height at any place.
fn oblique_passes(cell: f64) -> (ZMap, Cutter, Toolpath, impl Fn(f64, f64) -> f64) {
    let (radius, step, angle) = (3.0, 0.5, 0.3f64);
    let cutter = Cutter::ball(2.0 * radius).unwrap();
    let (sine, cosine) = angle.sin_cos();
    let at = |along: f64, across: f64, z: f64| {
        Point3::new(along * cosine - across * sine, along * sine + across * cosine, z)
    };
    let mut path = path_through([at(-30.0, -10.0, 20.0)]);
    for pass in -20i32..=40 {
        let across = step * f64::from(pass);
        // Over, down, along, up: lifted moves cut nothing.
        for tip in
            [at(-30.0, across, 20.0), at(-30.0, across, 0.0), at(30.0, across, 0.0), at(30.0, across, 20.0)]
        {
            let kind = motion::MoveKind::Cut;
            let to = motion::ClPoint::upright(tip);
            path.moves.push(Move { to, kind, feed_rate: 1000.0, pass: (pass + 20) as u32 });
        }
    }
    let (nx, ny) = ((12.0 / cell) as usize, (9.0 / cell) as usize);
    let grid = Grid { origin: Point2::new(0.123, 0.077), cell, nx, ny };
    let cut = cut_reference(&ZMap::block(grid, 5.0), &cutter, &path, &Silent).unwrap();
    let height = move |x: f64, y: f64| {
        let across = y * cosine - x * sine;
        let d = across - step * (across / step).round();
        radius - (radius * radius - d * d).sqrt()
    };
    (cut, cutter, path, height)
}

/// Height of the top at a place, by brute force over a table of triangles.
struct Top<'a> {
    mesh: &'a SurfaceMesh,
    grid: Grid,
    lists: Vec<Vec<usize>>,
}

impl<'a> Top<'a> {
    fn new(mesh: &'a SurfaceMesh, grid: Grid) -> Self {
        let mut lists = vec![Vec::new(); grid.len()];
        for (k, t) in mesh.triangles.iter().enumerate() {
            if t.iter().any(|v| mesh.places[*v as usize] == VertexPlace::Bottom) {
                continue;
            }
            let places = t.map(|v| mesh.vertices[v as usize].map(f64::from));
            let range = |axis: usize, origin: f64, n: usize| {
                let of = places.map(|p| (p[axis] - origin) / grid.cell);
                let low = of.iter().copied().fold(f64::MAX, f64::min).floor().max(0.0) as usize;
                low..=(of.iter().copied().fold(f64::MIN, f64::max).ceil() as usize).min(n - 1)
            };
            for j in range(1, grid.origin.y, grid.ny) {
                for i in range(0, grid.origin.x, grid.nx) {
                    lists[grid.index(i, j)].push(k);
                }
            }
        }
        Self { mesh, grid, lists }
    }

    fn height(&self, x: f64, y: f64) -> f64 {
        let (i, j) = self.grid.cell_at(x, y).unwrap();
        let mut best = (f64::NEG_INFINITY, f64::NAN);
        for &k in &self.lists[self.grid.index(i, j)] {
            let [a, b, c] = self.mesh.triangles[k].map(|v| self.mesh.vertices[v as usize].map(f64::from));
            let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
            let wb = ((x - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (y - a[1])) / area;
            let wc = ((b[0] - a[0]) * (y - a[1]) - (x - a[0]) * (b[1] - a[1])) / area;
            let inside = wb.min(wc).min(1.0 - wb - wc);
            if inside > best.0 {
                best = (inside, a[2] + wb * (b[2] - a[2]) + wc * (c[2] - a[2]));
            }
        }
        assert!(best.0 > -1e-3, "no triangle at {x} {y}");
        best.1
    }
}

#[test]
fn ridges_between_cells_keep_their_height() {
    let tolerance = 2e-3;
    let (cut, cutter, path, height) = oblique_passes(0.1);
    let mesh = surface_mesh(&cut, &cutter.into(), &path, -5.0, tolerance, usize::MAX).unwrap();
    assert_closed(&mesh);
    let top = Top::new(&mesh, cut.grid);
    let ridge = height(0.25 / 0.3f64.cos() * 0.0, 0.25 / 0.3f64.cos());
    let mut rng = Rng::new(3);
    let (mut ridges, mut worst, mut worst_of_cells) = (0, 0f64, 0f64);
    for _ in 0..20_000 {
        let (x, y) = (rng.within(0.2, 11.8), rng.within(0.2, 8.8));
        worst = worst.max((top.height(x, y) - height(x, y)).abs());
        // Onto the nearest ridge along y.
        let (sine, cosine) = 0.3f64.sin_cos();
        let across = y * cosine - x * sine;
        let y = y + ((across / 0.5).floor() * 0.5 + 0.25 - across) / cosine;
        if cut
            .grid
            .cell_at(x, y)
            .is_some_and(|(i, j)| i.min(j) > 0 && i + 1 < cut.grid.nx && j + 1 < cut.grid.ny)
        {
            ridges += 1;
            assert!((height(x, y) - ridge).abs() < 1e-9);
            worst = worst.max((top.height(x, y) - ridge).abs());
            let (i, j) = cut.grid.cell_at(x, y).unwrap();
            worst_of_cells = worst_of_cells.max(ridge - f64::from(cut.height[cut.grid.index(i, j)]));
        }
    }
    // Between the places that are held, a cut bends away from its chord by cell²/4r.
    assert!(worst < tolerance + 0.1 * 0.1 / 12.0, "{worst}");
    assert!(ridges > 10_000 && worst_of_cells > 1.5 * tolerance, "cells alone would miss: {worst_of_cells}");
}

#[test]
fn maps_cut_at_random_stay_closed_and_within_the_tolerance() {
    let mut rng = Rng::new(11);
    for (k, cutter) in cutters().iter().enumerate() {
        let mut path = random_path(&mut rng, 40, 14.0);
        for (k, m) in path.moves.iter_mut().enumerate() {
            m.pass = k as u32;
        }
        for (nx, ny, cell) in [(2, 2, 3.0), (67, 34, 0.3), (130, 90, 0.11), (9, 300, 0.05)] {
            let grid = Grid { origin: Point2::new(-1.0, 0.4), cell, nx, ny };
            let cut = cut_reference(&ZMap::block(grid, 3.0), cutter, &path, &Silent).unwrap();
            for tolerance in [1e-3, 0.01, 0.3] {
                let mesh = surface_mesh(&cut, &cutter.into(), &path, -9.0, tolerance, usize::MAX).unwrap();
                assert_closed(&mesh);
                assert_eq!(mesh.tolerance, tolerance);
                let (worst, found) = distance(&cut, &mesh);
                // Coordinates of f32 on steep walls.
                assert!(worst <= tolerance + 5e-4, "cutter {k}, {nx} x {ny}: {worst} at {tolerance}");
                assert_eq!(found, grid.len());
            }
        }
    }
}

/// Along each line between neighbouring centres, the greatest of two cuts that meet there is looked
/// for by brute force over all moves; a mesh with a tiny tolerance has it as a vertex.
#[test]
fn ridge_points_are_those_of_a_dense_search() {
    let (cut, cutter, path, _) = oblique_passes(0.15);
    let envelope = Envelope::new(cutter, &path);
    let all: Vec<u32> = (0..path.len() as u32).collect();
    let ridges = RidgePoints::find(&cut, &cutter.into(), &path);
    let mut found = 0;
    for j in 0..cut.grid.ny {
        for point in ridges.of_cells(0, cut.grid.nx, j) {
            let (x, y) = point.place(j);
            let (x, y) = (cut.grid.origin.x + x * cut.grid.cell, cut.grid.origin.y + y * cut.grid.cell);
            let (z, by) = envelope.lowest(x, y, &all).unwrap();
            let others: Vec<u32> = all
                .iter()
                .copied()
                .filter(|k| path.moves[*k as usize].pass != path.moves[by as usize].pass)
                .collect();
            let (other, _) = envelope.lowest(x, y, &others).unwrap();
            // The share is stored as f32.
            assert!((z - f64::from(point.z)).abs() < 1e-4 && (other - z).abs() < 1e-3, "{z} {other}");
            found += 1;
        }
    }
    assert_eq!(found, ridges.len());
    assert!(found > 1000);
}

#[test]
fn points_of_some_cells_are_those_of_the_row_that_stand_there() {
    let (cut, cutter, path, _) = oblique_passes(0.1);
    let ridges = RidgePoints::find(&cut, &cutter.into(), &path);
    let nx = cut.grid.nx;
    let mut rng = Rng::new(5);
    for j in 0..cut.grid.ny {
        let all = ridges.of_cells(0, nx, j);
        let column = |p: &ridge_points::RidgePoint| p.place(j).0.floor() as usize;
        for _ in 0..20 {
            let from = rng.within(0.0, nx as f64) as usize;
            let to = from + rng.within(0.0, if from.is_multiple_of(2) { 3.0 } else { 60.0 }) as usize;
            let expected: Vec<_> = all.iter().filter(|p| (from..=to).contains(&column(p))).collect();
            assert_eq!(ridges.of_cells(from, to, j).iter().collect::<Vec<_>>(), expected);
            let lines =
                [ridge_points::Line::AlongX, ridge_points::Line::AlongY, ridge_points::Line::Diagonal];
            let on_lines: Vec<_> = lines.into_iter().flat_map(|line| ridges.on((from, j), line).1).collect();
            assert_eq!(on_lines, ridges.of_cells(from, from, j).iter().collect::<Vec<_>>());
        }
    }
}

#[test]
fn threads_do_not_change_the_mesh() {
    let (cut, cutter, path, _) = oblique_passes(0.1);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| surface_mesh(&cut, &cutter.into(), &path, -5.0, 2e-3, 20_000))
    };
    let one = on(1);
    assert!([2, 3, 8].into_iter().all(|n| on(n) == one));
}

#[test]
fn a_cut_that_ends_in_stock_ends_in_an_edge() {
    let cutter = Cutter::ball(6.0).unwrap();
    let path = path_through([Point3::new(-20.0, 3.03, 0.0), Point3::new(20.0, 3.03, 0.0)]);
    let grid = Grid { origin: Point2::origin(), cell: 0.1, nx: 80, ny: 80 };
    let cut = cut_reference(&ZMap::block(grid, 1.0), &cutter, &path, &Silent).unwrap();
    let mesh = surface_mesh(&cut, &cutter.into(), &path, -5.0, 1e-3, usize::MAX).unwrap();
    assert_closed(&mesh);
    // The channel of a ball of radius 3 is 2√5 wide at 1 mm.
    let edges = mesh.vertices.iter().zip(&mesh.places).filter(|(_, place)| **place == VertexPlace::Ridge);
    let mut count = 0;
    for (vertex, _) in edges {
        let from_axis = (f64::from(vertex[1]) - 3.03).abs();
        assert!((from_axis - 5f64.sqrt()).abs() < 1e-5 && vertex[2] == 1.0, "{vertex:?}");
        count += 1;
    }
    assert!(count >= 4);
}
