//! The surface: closed, outward, on the material, sharp along ridges.

use super::*;
use std::collections::HashMap;

fn surface_of(stock: &Stock, solid: &Solid, path: &Toolpath, voxel: f64) -> VoxelSurface {
    let engine = VoxelEngine::new(stock, solid, path).unwrap();
    let voxels = engine.cut(voxel, MEMORY, &Silent).unwrap();
    engine.surface(&voxels, &Silent).unwrap()
}

/// Each edge once each way, also where vertices of equal f32 coordinates are one, as readers of STL files
/// take them; and the triangles around each vertex in one ring.
fn assert_closed(surface: &VoxelSurface, name: &str) {
    let mut known: HashMap<[u32; 3], u32> = HashMap::new();
    let welded: Vec<u32> = surface
        .vertices
        .iter()
        .enumerate()
        .map(|(k, q)| {
            let key: [u32; 3] = q.coords.map(|x| (x as f32 + 0.0).to_bits()).into();
            *known.entry(key).or_insert(k as u32)
        })
        .collect();
    let mut edges: HashMap<[u32; 2], u32> = HashMap::new();
    let mut around: HashMap<u32, Vec<[u32; 2]>> = HashMap::new();
    for t in &surface.triangles {
        let [a, b, c] = t.map(|k| welded[k as usize]);
        for [a, b, c] in [[a, b, c], [b, c, a], [c, a, b]] {
            assert_ne!(a, b, "{name}");
            *edges.entry([a, b]).or_default() += 1;
            around.entry(a).or_default().push([b, c]);
        }
    }
    for (&[a, b], &count) in &edges {
        let place = surface.vertices[a as usize];
        assert_eq!((count, edges.get(&[b, a])), (1, Some(&1)), "{name}: an edge at {place}");
    }
    for (a, links) in around {
        let next: HashMap<u32, u32> = links.iter().map(|[b, c]| (*b, *c)).collect();
        let (mut at, mut steps) = (links[0][0], 0);
        while steps == 0 || at != links[0][0] {
            (at, steps) = (next[&at], steps + 1);
        }
        assert_eq!(steps, links.len(), "{name}: several rings at {}", surface.vertices[a as usize]);
    }
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
        let surface = surface_of(&stock, &solid, &path, 0.25);
        assert_closed(&surface, &format!("cutter {c}"));
        assert_eq!(surface.vertices.len(), surface.cut_by.len());
        let engine = VoxelEngine::new(&stock, &solid, &path).unwrap();
        let (by_mesh, [least, _]) = (volume(&surface), engine.volumes(0.5, &Silent).unwrap().left);
        assert!((by_mesh - least).abs() < 0.02 * least, "cutter {c}: {by_mesh} {least}");
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
fn two_triangles_meet_at_every_edge_of_random_cuts() {
    let mut rng = Rng::new(43);
    let cutters = cutters();
    for k in 0..60 {
        // Coarse voxels hold several sheets.
        let voxel = rng.within(0.25, 1.2);
        let cutter = if k % 2 == 0 { Cutter::ball(1.5).unwrap() } else { cutters[k % cutters.len()] };
        let solid = Solid::of_cutter(&cutter, None);
        let stock = match k % 3 {
            0 => block([0.0; 3], [10.0, 9.0, 8.0]),
            1 => block([0.0; 3], [20.0 * voxel, 16.5 * voxel, 9.0]),
            _ => Stock::Cylinder {
                base: Point3::new(0.5, 5.0, 5.0),
                axis: BarAxis::X,
                radius: 4.0,
                length: 9.0,
            },
        };
        let path = if k % 4 == 0 { random_path(&mut rng, 20, 9.0) } else { five_axis_path(&mut rng, 20) };
        let surface = surface_of(&stock, &solid, &path, voxel);
        assert_closed(&surface, &format!("cut {k}, voxel {voxel}"));
        assert!(surface.vertices.iter().all(|q| stock.foot(q).0 < 1e-9), "cut {k}");
    }
}

#[test]
fn edges_of_a_block_are_sharp() {
    let stock = block([0.0; 3], [5.0, 4.0, 3.0]);
    let nowhere = path_through([Point3::new(0.0, 0.0, 99.0)]);
    let surface = surface_of(&stock, &ball(), &nowhere, 0.3);
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
    let surface = surface_of(&stock, &ball(), &path, 0.3);
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
