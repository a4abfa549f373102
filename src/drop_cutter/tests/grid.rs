//! Domains and grids against drops that look at every triangle.

use super::*;

/// Meshes on which domains could go wrong: where the cutter fits and where it does not, level ground,
/// borders, a hole, walls, overhangs, slivers.
fn meshes() -> Vec<(&'static str, TriangleMesh)> {
    let mut numbers = Numbers(4);
    let mut noise = || numbers.within(0.0, 3.0);
    let (corners, cube) = Aabb { min: Point3::origin(), max: Point3::new(10.0, 10.0, 10.0) }.surface();
    let terraces = |x: f64, y: f64| (x / 4.0).floor() + 2.0 * (y / 5.0).floor();
    let holed = height_field(12, 15.0, 0.2, |x, y| (0.8 * x).sin() + (0.6 * y).cos());
    let triangles = holed.triangles().iter().copied();
    let holed = triangles.enumerate().filter(|(t, _)| ![100, 101, 102, 103, 150].contains(t)).map(|(_, t)| t);
    let vertices = height_field(12, 15.0, 0.2, |x, y| (0.8 * x).sin() + (0.6 * y).cos()).vertices().to_vec();
    // A ball of triangles: its lower half overhangs.
    let (n, m) = (14u32, 8u32);
    let at = |i: u32, j: u32| {
        let (a, b) = (f64::from(i % n) / f64::from(n), f64::from(j) / f64::from(m));
        let ((sa, ca), (sb, cb)) =
            ((a * std::f64::consts::TAU).sin_cos(), (b * std::f64::consts::PI).sin_cos());
        Point3::new(4.0 * sb * ca, 4.0 * sb * sa, 4.0 * cb)
    };
    let globe = (0..=m).flat_map(|j| (0..n).map(move |i| at(i, j))).collect();
    let ring = |j: u32, i: u32| j * n + i % n;
    let belts = (0..m).flat_map(|j| {
        (0..n).flat_map(move |i| {
            [
                [ring(j, i), ring(j + 1, i), ring(j + 1, i + 1)],
                [ring(j, i), ring(j + 1, i + 1), ring(j, i + 1)],
            ]
        })
    });
    vec![
        ("waves", height_field(40, 30.0, 0.3, |x, y| (0.5 * x).sin() + (0.4 * y).cos())),
        ("tight waves", height_field(40, 30.0, 0.3, |x, y| 2.0 * (0.9 * x).sin() * (0.8 * y).cos())),
        ("level", height_field(20, 20.0, 0.3, |_, _| 1.5)),
        ("slope", height_field(20, 20.0, 0.0, |x, y| 0.3 * x - 0.2 * y)),
        ("steep", height_field(20, 20.0, 0.2, |x, y| 6.0 * x - 3.0 * y)),
        ("terraces", height_field(30, 20.0, 0.0, terraces)),
        ("noise", height_field(25, 20.0, 0.3, |_, _| noise())),
        ("hole", mesh_of(vertices, holed.collect())),
        ("cube", mesh_of(corners, cube)),
        ("globe", mesh_of(globe, belts.collect())),
    ]
}

/// A grid over the mesh and somewhat beyond it; its border cuts through tiles.
fn grid_over(mesh: &TriangleMesh, step: f64) -> PlanGrid {
    let b = mesh.bounds();
    let (low, size) = (b.min - Vector3::repeat(2.0), b.max - b.min + Vector3::repeat(4.0));
    PlanGrid::new([low.x, low.y], [step, 1.1 * step], [size.x, size.y].map(|s| (s / step) as usize)).unwrap()
}

#[test]
fn no_contact_lies_outside_its_domain() {
    for (name, mesh) in meshes() {
        let bvh = Bvh::new(&mesh);
        let b = mesh.bounds();
        let mut numbers = Numbers(8);
        let step = 0.25;
        for cutter in cutters() {
            let drops = dropper(&mesh, &bvh, &cutter);
            let facets: Vec<Facet> = (0..mesh.triangles().len())
                .map(|t| Facet::new(mesh.corners(t), &mesh.normal(t), Carries::ALL, &drops.search))
                .collect();
            for k in 0..300 {
                let mut place = [0, 1].map(|i| numbers.within(b.min[i] - 2.0, b.max[i] + 2.0));
                if k % 3 == 0 {
                    // Round places, where contacts lie on edges and rims exactly.
                    place = place.map(|x: f64| (x / step).round() * step);
                }
                let [x, y] = place;
                let all = facets
                    .iter()
                    .filter_map(|f| f.touch(&drops.search, x, y, f64::NEG_INFINITY))
                    .map(|t| t.tip_z)
                    .max_by(f64::total_cmp);
                let found = drops.at(x, y).map(|d| d.tip_z);
                let same = found.zip(all).map_or(found == all, |(f, a)| (f - a).abs() < 1e-11);
                assert!(same, "{name} {cutter:?} at {x} {y}: {found:?}, all {all:?}");
            }
        }
    }
}

/// On smooth ground a ball touches each part of a triangle with every normal between those of its
/// faces: the domains reach to the ends of that, so a domain narrower by 1 µm fails.
#[test]
fn domains_reach_to_the_normals_of_all_faces_around() {
    let ball = Cutter::ball(6.0).unwrap();
    let profile = Profile::of(&ball, 0.0);
    for (name, mesh) in meshes().into_iter().take(5) {
        let domains = domain::domains(&mesh, &profile, &work::monitor::Silent).unwrap();
        let tip = |p: &Point3, n: &Vector3| p + (n - Vector3::z()) * ball.radius();
        let mut around = vec![Vec::new(); mesh.vertices().len()];
        for (t, face) in mesh.triangles().iter().enumerate() {
            face.iter().for_each(|&v| around[v as usize].push(mesh.normal(t)));
        }
        for (t, domain) in domains.iter().enumerate() {
            let (corners, normal) = (mesh.corners(t), mesh.normal(t));
            let face = domain.face.unwrap();
            assert!(corners.iter().all(|p| face.holds(&tip(p, &normal))), "{name}: face {t}");
            for k in 0..3 {
                let across = mesh.neighbour(t, k).map(|n| mesh.normal(n));
                let ends = [corners[k], corners[(k + 1) % 3]];
                for n in across.into_iter().chain([normal]) {
                    let reached = |side: Extent| ends.iter().all(|p| side.holds(&tip(p, &n)));
                    assert!(domain.sides[k].is_none_or(reached), "{name}: side {k} of {t}");
                }
                let normals = &around[mesh.triangles()[t][k] as usize];
                let reached = |corner: Extent| normals.iter().all(|n| corner.holds(&tip(&corners[k], n)));
                assert!(domain.corners[k].is_none_or(reached), "{name}: corner {k} of {t}");
            }
        }
    }
}

#[test]
fn grids_are_single_drops() {
    for (name, mesh) in meshes() {
        let bvh = Bvh::new(&mesh);
        for cutter in cutters() {
            let drops = dropper(&mesh, &bvh, &cutter);
            for grid in [grid_over(&mesh, 0.29), grid_over(&mesh, 2.5)] {
                let found = drops.over_grid(&grid);
                let [nx, ny] = grid.counts();
                for j in 0..ny {
                    for i in 0..nx {
                        let [x, y] = grid.point(i, j);
                        let GridDrop { tip_z, triangle } = found[i + j * nx];
                        let Some(one) = drops.at(x, y) else {
                            assert_eq!((tip_z, triangle), (f64::NEG_INFINITY, u32::MAX));
                            continue;
                        };
                        let at = format!("{name} {cutter:?} at {x} {y}");
                        assert!((tip_z - one.tip_z).abs() < 1e-11, "{at}: {tip_z} {}", one.tip_z);
                        let t = triangle as usize;
                        let facet = Facet::new(mesh.corners(t), &mesh.normal(t), Carries::ALL, &drops.search);
                        let alone = facet.touch(&drops.search, x, y, f64::NEG_INFINITY).unwrap();
                        assert!((tip_z - alone.tip_z).abs() < 1e-11, "{at}: its triangle carries it");
                    }
                }
            }
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_grid() {
    let mesh = height_field(40, 30.0, 0.3, |x, y| 2.0 * (0.9 * x).sin() * (0.8 * y).cos());
    let bvh = Bvh::new(&mesh);
    let drops = dropper(&mesh, &bvh, &Cutter::bull(6.0, 1.2).unwrap());
    let grid = grid_over(&mesh, 0.1);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| drops.over_grid(&grid))
    };
    let one = with(1);
    for threads in [2, 3, 8] {
        assert_eq!(with(threads), one);
    }
}

#[test]
fn grids_that_are_none_are_refused() {
    assert!(PlanGrid::new([0.0; 2], [1.0, 0.0], [2; 2]).is_none());
    assert!(PlanGrid::new([0.0; 2], [1.0, -1.0], [2; 2]).is_none());
    assert!(PlanGrid::new([f64::NAN, 0.0], [1.0; 2], [2; 2]).is_none());
    assert!(PlanGrid::new([0.0; 2], [f64::INFINITY, 1.0], [2; 2]).is_none());
    assert!(PlanGrid::new([0.0; 2], [1.0; 2], [usize::MAX; 2]).is_none());
    let mesh = height_field(3, 3.0, 0.0, |_, _| 0.0);
    let bvh = Bvh::new(&mesh);
    let drops = dropper(&mesh, &bvh, &Cutter::ball(6.0).unwrap());
    for counts in [[0, 0], [5, 0], [0, 5]] {
        assert!(drops.over_grid(&PlanGrid::new([0.0; 2], [1.0; 2], counts).unwrap()).is_empty());
    }
}
