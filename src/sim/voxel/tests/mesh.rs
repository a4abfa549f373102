//! The surface: closed, outward, on the material, sharp along ridges.

use super::*;
use std::collections::HashMap;

fn surface_of(stock: &VoxelStock, solid: &Solid, path: &Toolpath, voxel: f64) -> (VoxelSurface, Voxels) {
    let engine = VoxelEngine::new(stock, solid, path).unwrap();
    let voxels = engine.cut(voxel, MEMORY, &Silent).unwrap();
    (engine.surface(&voxels, &Silent).unwrap(), voxels)
}

/// Each edge as often one way as the other.
fn assert_closed(surface: &VoxelSurface, name: &str) {
    let mut edges: HashMap<[u32; 2], i32> = HashMap::new();
    for &[a, b, c] in &surface.triangles {
        for [a, b] in [[a, b], [b, c], [c, a]] {
            assert_ne!(a, b, "{name}");
            *edges.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
        }
    }
    assert!(edges.values().all(|&sum| sum == 0), "{name}: not closed");
    assert!(!surface.triangles.is_empty(), "{name}");
}

fn volume(surface: &VoxelSurface) -> f64 {
    let corners = surface.triangles.iter().map(|t| t.map(|k| surface.vertices[k as usize].coords));
    corners.map(|[a, b, c]| a.dot(&b.cross(&c)) / 6.0).sum()
}

#[test]
fn the_surface_is_closed_and_lies_on_the_material() {
    let mut rng = Rng::new(41);
    let stock = block([0.0; 3], [10.0, 9.0, 8.0]);
    for (c, cutter) in cutters().iter().enumerate() {
        let solid = Solid::of_cutter(cutter, None);
        let path = five_axis_path(&mut rng, 10);
        let (surface, voxels) = surface_of(&stock, &solid, &path, 0.25);
        assert_closed(&surface, &format!("cutter {c}"));
        assert_eq!(surface.vertices.len(), surface.cut_by.len());
        let (by_mesh, by_cells) = (volume(&surface), voxels.volume());
        assert!((by_mesh - by_cells).abs() < 0.02 * by_cells, "cutter {c}: {by_mesh} {by_cells}");
        let swept: Vec<SweptSolid<'_>> = (0..path.len())
            .map(|k| SweptSolid::new(&solid, &path.location_before(k), &path.moves[k].to).unwrap())
            .collect();
        let mut off: Vec<f64> = Vec::new();
        for (q, &by) in surface.vertices.iter().zip(&surface.cut_by) {
            let w = swept.iter().map(|s| s.distance(q).distance).fold(f64::INFINITY, f64::min);
            let exact = stock.foot(q).0.max(-w);
            off.push(exact.abs());
            assert!(stock.foot(q).0 < 1e-9, "cutter {c}: {q} lies outside of the stock");
            // In its cell.
            assert!(exact.abs() < 0.25 * 3f64.sqrt(), "cutter {c}: {exact} at {q}");
            assert!(by == NOT_CUT || (by as usize) < path.len());
        }
        off.sort_by(f64::total_cmp);
        let at = |share: f64| off[(share * (off.len() - 1) as f64) as usize];
        assert!(at(0.5) < 1e-3 && at(0.95) < 0.02, "cutter {c}: half {}, most {}", at(0.5), at(0.95));
    }
}

#[test]
fn edges_of_a_block_are_sharp() {
    let stock = block([0.0; 3], [5.0, 4.0, 3.0]);
    let nowhere = path_through([Point3::new(0.0, 0.0, 99.0)]);
    let (surface, _) = surface_of(&stock, &ball(), &nowhere, 0.3);
    assert_closed(&surface, "block");
    assert!((volume(&surface) - 60.0).abs() < 1e-9, "{}", volume(&surface));
    assert!(surface.vertices.iter().all(|q| stock.foot(q).0.abs() < 1e-9));
    assert!(surface.cut_by.iter().all(|&k| k == NOT_CUT));
}

#[test]
fn ridges_between_passes_are_sharp() {
    // Two grooves of a ball 1 mm apart: a ridge 3 − √(9 − ¼) above their bottoms.
    let stock = block([0.0; 3], [10.0, 8.0, 5.0]);
    let at = |x: f64, y: f64| Point3::new(x, y, 3.0);
    let path = path_through([at(-5.0, 3.7), at(15.0, 3.7), at(15.0, 4.7), at(-5.0, 4.7)]);
    let (surface, _) = surface_of(&stock, &ball(), &path, 0.3);
    assert_closed(&surface, "grooves");
    let ridge = 6.0 - 8.75f64.sqrt();
    let near = surface.vertices.iter().filter(|q| (q.y - 4.2).abs() < 0.02 && q.x > 1.0 && q.x < 9.0);
    let on_ridge = near.filter(|q| (q.z - ridge).abs() < 1e-4).count();
    assert!(on_ridge >= 26, "{on_ridge} vertices on the ridge");
    // The facets nowhere cut across it: their middles lie less deep below than a facet of 0.3 mm sags.
    for t in &surface.triangles {
        let [a, b, c] = t.map(|k| surface.vertices[k as usize]);
        let q = Point3::from((a.coords + b.coords + c.coords) / 3.0);
        if q.x > 1.0 && q.x < 9.0 && q.z < 4.0 && q.z > 2.0 && (q.y - 4.2).abs() < 1.0 {
            let y = (q.y - 3.7).abs().min((q.y - 4.7).abs());
            let exact = 6.0 - (9.0 - y * y).sqrt();
            assert!((q.z - exact).abs() < 0.3 * 0.3 / 3.0 / 2.0, "{q} {exact}");
        }
    }
}
