use super::*;
use crate::along_normals::{RaysCut, RaysCutInTurn};
use cutter::{Cutter, Solid};
use geometry::{Aabb, AnalyticShape, AnalyticSurface, TriangleMesh};
use sim::Rays;
use sim::scenes::path_through;
use work::monitor::Silent;

const LIMITS: Limits = Limits { scallop: 0.01, gouge: 0.005, uncut: 0.05, chord: 0.001 };

/// A profile in the (x, z) plane, counterclockwise seen from −y, extruded by `length` along y; `caps` are its
/// triangles.
fn prism(profile: &[[f64; 2]], length: f64, caps: &[[u32; 3]]) -> Part {
    let n = profile.len() as u32;
    let at = |y: f64| profile.iter().map(move |[x, z]| Point3::new(*x, y, *z));
    let vertices = at(0.0).chain(at(length)).collect();
    let sides = (0..n).map(|k| (k, (k + 1) % n)).flat_map(|(a, b)| [[a, a + n, b + n], [a, b + n, b]]);
    let ends = caps.iter().flat_map(|&[a, b, c]| [[a, b, c], [a + n, c + n, b + n]]);
    let (mesh, notes) = TriangleMesh::new(vertices, sides.chain(ends).collect()).unwrap();
    assert!(mesh.is_closed(), "{notes:?}");
    Part::from_mesh(mesh)
}

/// A web 10 wide and 14 high under a plate of 40 by 6, 30 long.
fn tee() -> Part {
    let profile = [
        [15.0, 0.0],
        [25.0, 0.0],
        [25.0, 14.0],
        [40.0, 14.0],
        [40.0, 20.0],
        [0.0, 20.0],
        [0.0, 14.0],
        [15.0, 14.0],
    ];
    prism(&profile, 30.0, &[[0, 1, 2], [0, 2, 7], [7, 2, 5], [7, 5, 6], [2, 4, 5], [2, 3, 4]])
}

/// An L: a floor 20 wide and 5 high that runs under a lid from x = 12 to 30, z = 9 to 12, held by a wall from
/// 20 to 30.
fn lidded() -> Part {
    let profile = [
        [0.0, 0.0],
        [30.0, 0.0],
        [30.0, 12.0],
        [12.0, 12.0],
        [12.0, 9.0],
        [20.0, 9.0],
        [20.0, 5.0],
        [0.0, 5.0],
    ];
    prism(&profile, 10.0, &[[0, 1, 6], [0, 6, 7], [1, 2, 6], [6, 2, 5], [5, 2, 3], [5, 3, 4]])
}

fn block(part: &Part, margin: f64) -> Aabb {
    let Aabb { mut min, mut max } = part.bounds();
    for c in 0..2 {
        (min[c], max[c]) = (min[c] - margin, max[c] + margin);
    }
    max.z += 1.0;
    Aabb { min, max }
}

/// Cells of a pitch over a part, all measured.
fn all_cells(part: &Part, cell: f64) -> (Grid, Vec<f32>) {
    let grid = Grid::covering(&part.bounds(), cell, 8, 1 << 30).unwrap();
    let deviations = (0..grid.len()).map(|k| {
        let q = grid.centre(k % grid.nx, k / grid.nx);
        part.highest_at(q.x, q.y).map_or(f32::NAN, |_| 0.0)
    });
    (grid, deviations.collect())
}

fn upright() -> Toolpath {
    path_through([Point3::new(0.0, 0.0, 30.0), Point3::new(10.0, 0.0, 30.0)])
}

fn figures(part: &Part, judged: Judged, cell: f64) -> CoverageFigures {
    let facing = Facing::new(part, &upright(), block(part, 0.0));
    let (grid, deviations) = all_cells(part, cell);
    let cells = CellsSeen { grid: &grid, deviations: &deviations, walls: false };
    Coverage::new(part, &facing, judged, Some(cells)).figures()
}

fn sum(f: &CoverageFigures) -> f64 {
    f.by_cells_mm2
        + f.along_normals_mm2
        + f.by_moves_mm2
        + f.walls_mm2
        + f.facing_away_mm2
        + f.hidden_mm2
        + f.outside_stock_mm2
        + f.out_of_reach_mm2
}

#[test]
fn a_tee_is_judged_on_its_top_only_and_its_areas_are_those_of_its_faces() {
    let part = tee();
    let caps = 2.0 * (10.0 * 14.0 + 40.0 * 6.0);
    let walls = caps + 30.0 * 2.0 * (14.0 + 6.0);
    let f = figures(&part, Judged::Facing, 0.1);
    for (area, exact) in [
        (f.by_cells_mm2, 1200.0),
        (f.walls_mm2, walls),
        (f.facing_away_mm2, 1200.0),
        (f.hidden_mm2, 0.0),
        (f.along_normals_mm2, 0.0),
        (f.surface_mm2, 2400.0 + walls),
        (f.judged_mm2, 1200.0),
    ] {
        assert!((area - exact).abs() < 1e-9, "{area} {exact} {f:?}");
    }
    assert_eq!((f.error_bound_mm2, sum(&f)), (0.0, f.surface_mm2));
    assert!(f.scope.starts_with("on 28 % of the surface; not judged: walls 1960 mm²"), "{}", f.scope);
    let all = figures(&part, Judged::All, 0.1);
    assert!((all.judged_mm2 - all.surface_mm2).abs() < 1e-9 && all.scope.is_empty(), "{all:?}");
    assert!((all.along_normals_mm2 - 1200.0 - walls).abs() < 1e-9);
}

#[test]
fn a_floor_under_a_lid_is_hidden_within_the_bound() {
    let f = figures(&lidded(), Judged::Facing, 0.1);
    // The floor from 12 to 20 lies under the lid; the lid's top and the rest of the floor face up.
    assert!((f.hidden_mm2 - 80.0).abs() <= f.error_bound_mm2 && f.error_bound_mm2 < 12.0, "{f:?}");
    assert!((f.judged_mm2 - 180.0 - 120.0).abs() <= f.error_bound_mm2, "{f:?}");
    assert!((f.facing_away_mm2 - 300.0 - 80.0).abs() < 1e-9 && (sum(&f) - f.surface_mm2).abs() < 1e-9);
    // Brute force on a lattice of the floor.
    let part = lidded();
    let covered =
        (0..200).filter(|k| part.highest_at(0.05 + 0.1 * f64::from(*k), 5.0).unwrap().point.z > 6.0).count();
    assert!((f.hidden_mm2 - 0.1 * 10.0 * covered as f64).abs() <= f.error_bound_mm2 + 1.0, "{covered} {f:?}");
}

#[test]
fn a_wave_is_judged_as_a_whole_by_cells() {
    let shape = AnalyticShape::Wave { amplitude: 1.0, wavelength_x: 20.0, wavelength_y: None };
    let surface = AnalyticSurface::new(shape, [[0.0, 20.0], [0.0, 15.0]]).unwrap();
    let part = Part::from_patches(vec![Patch::Analytic(surface)], 0.002).unwrap();
    let f = figures(&part, Judged::Facing, 0.1);
    assert!(f.scope.is_empty() && f.by_cells_mm2 == f.surface_mm2, "{f:?}");
    // The arc of z = a cos(2πx/λ) by a fine sum.
    let slope = |x: f64| std::f64::consts::TAU / 20.0 * (std::f64::consts::TAU * x / 20.0).sin();
    let arc: f64 =
        (0..100_000).map(|k| (1.0 + slope(2e-4 * (f64::from(k) + 0.5)).powi(2)).sqrt() * 2e-4).sum();
    assert!(
        (f.surface_mm2 - 15.0 * arc).abs() <= f.error_bound_mm2 + 1e-6,
        "{} {}",
        f.surface_mm2,
        15.0 * arc
    );
}

#[test]
fn cells_too_coarse_for_a_ledge_leave_it_to_the_normals() {
    // A slot 1 mm wide and 5 mm deep across a block.
    let profile = [
        [0.0, 0.0],
        [20.0, 0.0],
        [20.0, 10.0],
        [7.6, 10.0],
        [7.6, 5.0],
        [6.6, 5.0],
        [6.6, 10.0],
        [0.0, 10.0],
    ];
    let part = prism(&profile, 10.0, &[[0, 5, 6], [0, 6, 7], [0, 1, 4], [0, 4, 5], [1, 2, 3], [1, 3, 4]]);
    let fine = figures(&part, Judged::Facing, 0.1);
    assert!((fine.by_cells_mm2 - 200.0).abs() < 1e-9 && fine.along_normals_mm2 == 0.0, "{fine:?}");
    let coarse = figures(&part, Judged::Facing, 4.0);
    assert!((coarse.along_normals_mm2 - 10.0).abs() < 1e-9, "{coarse:?}");
    assert_eq!(coarse.judged_mm2, fine.judged_mm2);
}

/// What the surface that no cell sees shows after passes of a ball over a box of 20 × 10 × 10.
fn unseen(tips: &[[f64; 3]], margin: f64) -> Measurement {
    let cutter = Cutter::ball(6.0).unwrap();
    unseen_after(&path_through(tips.iter().map(|p| Point3::from(*p))), &cutter.into(), margin)
}

fn unseen_after(path: &Toolpath, cutters: &Cutters, margin: f64) -> Measurement {
    unseen_closer(path, cutters, margin, 0).0
}

/// Also the distance of the places, mm, which is halved so often.
fn unseen_closer(path: &Toolpath, cutters: &Cutters, margin: f64, halvings: i32) -> (Measurement, f64) {
    let profile = [[0.0, 0.0], [20.0, 0.0], [20.0, 10.0], [0.0, 10.0]];
    unseen_of(&prism(&profile, 10.0, &[[0, 1, 2], [0, 2, 3]]), path, cutters, margin, halvings)
}

/// The same of any part.
fn unseen_of(
    part: &Part,
    path: &Toolpath,
    cutters: &Cutters,
    margin: f64,
    halvings: i32,
) -> (Measurement, f64) {
    let facing = Facing::new(part, path, block(part, margin));
    let (grid, deviations) = all_cells(part, 0.1);
    let cells = CellsSeen { grid: &grid, deviations: &deviations, walls: false };
    let coverage = Coverage::new(part, &facing, Judged::All, Some(cells));
    let stretches = cutters.stretches(path);
    let solids: Vec<Solid> = stretches.iter().map(|tool| Solid::of_cutter(tool.cutter, None)).collect();
    let rays = |k: usize| Rays::new(&stretches[k].path, &solids[k], &Silent).unwrap();
    let rays: Vec<Rays> = (0..solids.len()).map(rays).collect();
    let tool = |k: usize| RaysCut { rays: &rays[k], path: &stretches[k].path, solid: &solids[k] };
    let tools = (0..solids.len()).map(|k| (stretches[k].first, tool(k))).collect();
    let by_rays = RaysCutInTurn { tools };
    let cut = SweptVolume {
        part,
        cut: &by_rays,
        inward: 3.0,
        outward: 3.0,
        shallow: 1e-6,
        block: block(part, margin),
    };
    let task = AlongTask {
        cutters,
        path,
        cut: &cut,
        limits: &LIMITS,
        asked: 5e-4,
        finest: 0.1,
        halvings,
        leaves_the_rest: false,
    };
    let UnseenSurface { measurement, spacing, .. } =
        coverage.measure_unseen(&task, &Silent).unwrap().unwrap();
    (measurement, spacing)
}

/// A ball cuts 0.02 mm too deep into a wall: by places half as far apart the area of that is known better.
#[test]
fn places_half_as_far_apart_tell_more() {
    let path = path_through([[-5.0, -2.98, 2.0], [25.0, -2.98, 2.0]].map(Point3::from));
    let cutters = Cutter::ball(6.0).unwrap().into();
    let looks = [0, 1].map(|halvings| unseen_closer(&path, &cutters, 0.0, halvings));
    assert!((looks[0].1 / looks[1].1 - 2.0).abs() < 1e-9, "{} {}", looks[0].1, looks[1].1);
    let area = 20.0 * (5.0 + (9.0f64 - (3.0 - 0.015f64).powi(2)).sqrt());
    let off = looks.map(|(measured, _)| {
        let gouge = measured.gouge;
        assert!((gouge.max_depth_mm - 0.02).abs() <= gouge.error_bound_mm, "{gouge:?}");
        (gouge.area_mm2 / area - 1.0).abs()
    });
    assert!(off[1] < off[0] && off[1] < 0.05, "{off:?}");
}

/// A ball goes 0.02 mm too deep into the wall at y = 0, then a flat 0.05 mm into that at y = 10: both are
/// found with their moves.
#[test]
fn each_of_several_tools_cuts_the_walls_that_it_passes() {
    let tips =
        [[-5.0, -2.98, 2.0], [25.0, -2.98, 2.0], [25.0, 13.95, 20.0], [25.0, 13.95, 4.0], [-5.0, 13.95, 4.0]];
    let path = path_through(tips.map(Point3::from));
    let cutters = Cutters::from(Cutter::ball(6.0).unwrap()).then(1, Cutter::flat(8.0).unwrap());
    let gouge = unseen_after(&path, &cutters, 0.0).gouge;
    let found = |y: f64| gouge.regions.iter().find(|region| (region.at_mm[1] - y).abs() < 1e-9).unwrap();
    for (y, depth, move_index) in [(0.0, 0.02, 0), (10.0, 0.05, 3)] {
        let region = found(y);
        assert!((region.depth_mm - depth).abs() < 1e-3 && region.move_index == move_index, "{gouge:?}");
    }
    assert!((gouge.max_depth_mm - 0.05).abs() <= gouge.error_bound_mm, "{gouge:?}");
}

#[test]
fn walls_stand_as_far_as_the_block_and_are_cut_where_a_ball_passes() {
    // A nanometre into the top: no gouge of the walls. The block ends at the part.
    let over = [[-5.0, 5.0, 10.0 - 2e-4], [25.0, 5.0, 10.0 - 2e-4]];
    let at_block = unseen(&over, 0.0);
    assert!(
        at_block.gouge.max_depth_mm < 1e-6 && at_block.gouge.error_bound_mm < 1e-3,
        "{:?}",
        at_block.gouge
    );
    assert_eq!(at_block.uncut.region_count, 0, "{:?}", at_block.uncut);
    // 2 mm of stock stand before the four walls; the bottom is that of the block.
    let in_stock = unseen(&over, 2.0);
    assert!((in_stock.uncut.max_height_mm - 2.0).abs() < 1e-9, "{:?}", in_stock.uncut);
    assert!((in_stock.uncut.area_mm2 / 600.0 - 1.0).abs() < 0.06, "{:?}", in_stock.uncut);
    // Along the wall at y = 0, 0.02 mm too deep.
    let beside = [[-5.0, -2.98, 2.0], [25.0, -2.98, 2.0]];
    let gouged = unseen(&beside, 0.0);
    assert!((gouged.gouge.max_depth_mm - 0.02).abs() <= gouged.gouge.error_bound_mm, "{:?}", gouged.gouge);
    assert!(
        (gouged.gouge.max_depth_mm - 0.02).abs() < 5e-4 && gouged.gouge.error_bound_mm < 2e-3,
        "{:?}",
        gouged.gouge
    );
    // From the ball's middle at z = 5 upward; below as far as its arc is 5 µm deep.
    let below = (9.0f64 - (3.0 - 0.015f64).powi(2)).sqrt();
    assert!((gouged.gouge.area_mm2 / (20.0 * (5.0 + below)) - 1.0).abs() < 0.1, "{below} {:?}", gouged.gouge);
}

/// A flat plunges past the end of a wall of 89 degrees that hangs from a level top, both open sheets: it cuts
/// the wall no deeper than it comes past its end. A touch is no cut.
#[test]
fn a_plunge_past_the_end_of_an_open_wall_is_as_deep_as_it_comes_over() {
    let (high, radius) = (6.0, 3.0);
    let out = high / 89f64.to_radians().tan();
    let top = [[0.0, 0.0, 0.0], [20.0, 0.0, 0.0], [20.0, 16.0, 0.0], [0.0, 16.0, 0.0]];
    let foot = [[0.0, -out, -high], [20.0, -out, -high]];
    let corners = top.into_iter().chain(foot).map(Point3::from).collect();
    let triangles = vec![[0, 1, 2], [0, 2, 3], [4, 5, 1], [4, 1, 0]];
    let part = Part::from_mesh(TriangleMesh::new(corners, triangles).unwrap().0);
    let cutters = Cutter::flat(2.0 * radius).unwrap().into();
    for beside in [1.0, 0.2, -2.0f64] {
        for over in [0.0, 1e-4, 0.02, 0.4] {
            let at = |z: f64| Point3::new(over - radius, beside, z);
            let path = path_through([at(10.0), at(-4.0), at(10.0)]);
            let gouge = unseen_of(&part, &path, &cutters, 2.0, 0).0.gouge;
            // As far as the surface itself is cut, 0.4 mm below the top; no farther than the tool comes.
            let aside = beside + 0.4 / 89f64.to_radians().tan();
            let cut = if beside > 0.0 { (9.0 - aside * aside).sqrt() - radius + over } else { 0.0 };
            let [found, bound] = [gouge.max_depth_mm, gouge.error_bound_mm];
            assert!(found + bound >= cut && found <= over + 1e-6, "{beside} {over} {cut} {gouge:?}");
            assert!(bound < 3e-3, "{beside} {over} {gouge:?}");
        }
    }
}
