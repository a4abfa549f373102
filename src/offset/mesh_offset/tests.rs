use super::*;
use geometry::{Aabb, Vector3, distance_to_segment};
use proptest::prelude::*;
use work::monitor::{Cancelled, Silent};

fn mesh(points: &[[f64; 3]], triangles: &[[u32; 3]]) -> (TriangleMesh, Bvh) {
    let points = points.iter().map(|p| Point3::from(*p)).collect();
    let (mesh, notes) = TriangleMesh::new(points, triangles.to_vec()).unwrap();
    assert!(notes.is_clean(), "{notes}");
    let bvh = Bvh::new(&mesh);
    (mesh, bvh)
}

/// A grid over parameters of the unit square, `n × m` cells; `wrap` joins the ends of u.
fn grid(n: u32, m: u32, wrap: bool, at: impl Fn(f64, f64) -> [f64; 3]) -> (TriangleMesh, Bvh) {
    let columns = if wrap { n } else { n + 1 };
    let mut points = Vec::new();
    for j in 0..=m {
        for i in 0..columns {
            points.push(at(f64::from(i) / f64::from(n), f64::from(j) / f64::from(m)));
        }
    }
    let mut triangles = Vec::new();
    for j in 0..m {
        for i in 0..n {
            let v = |i: u32, j: u32| j * columns + i % columns;
            let [a, b, c, d] = [v(i, j), v(i + 1, j), v(i + 1, j + 1), v(i, j + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh(&points, &triangles)
}

fn settings(distance: f64, cell: f64) -> OffsetSettings {
    OffsetSettings { distance, cell, margin: 0.0, valley: 0.05, memory: 1e9 }
}

fn offset(of: &(TriangleMesh, Bvh), settings: &OffsetSettings) -> MeshOffset {
    MeshOffset::new(&of.0, &of.1, settings, &Silent).unwrap()
}

/// The nearest distance by a walk over all triangles: inside of each by its plane, else by its sides.
fn distance(mesh: &TriangleMesh, q: &Point3) -> f64 {
    let side = |a: &Point3, b: &Point3| distance_to_segment(q, a, b);
    let of_triangle = |t: usize| {
        let [a, b, c] = mesh.corners(t);
        let n = (b - a).cross(&(c - a)).normalize();
        let foot = q - n * n.dot(&(q - a));
        let within = [(a, b), (b, c), (c, a)].iter().all(|(p, r)| (r - p).cross(&(foot - p)).dot(&n) >= 0.0);
        if within { (q - foot).norm() } else { side(&a, &b).min(side(&b, &c)).min(side(&c, &a)) }
    };
    (0..mesh.triangles().len()).map(of_triangle).fold(f64::INFINITY, f64::min)
}

/// Every vertex on the level set, by brute force, and triangles that make a surface facing away from the
/// mesh.
fn assert_sound(of: &(TriangleMesh, Bvh), found: &MeshOffset, d: f64) {
    let folded = folded(of, found, d);
    assert!(folded < 1e-4, "{folded} of it faces the mesh");
}

/// The triangles of an offset as a checked mesh.
fn surface(of: &MeshOffset) -> TriangleMesh {
    TriangleMesh::new(of.vertices.clone(), of.triangles.clone()).unwrap().0
}

/// The share of its area that faces the mesh, of a surface that is sound else.
fn folded(of: &(TriangleMesh, Bvh), found: &MeshOffset, d: f64) -> f64 {
    // Brute force is slow: some hundreds of them.
    let every = 1 + found.vertices.len() * of.0.triangles().len() / 100_000;
    for p in found.vertices.iter().step_by(every) {
        let off = distance(&of.0, p) - d;
        assert!(off.abs() < 1e-9, "{p}: {off:e}");
    }
    let checked = surface(found);
    let (mut inward, mut all) = (0.0, 0.0);
    for t in &found.triangles {
        let [a, b, c] = t.map(|v| found.vertices[v as usize]);
        let normal = (b - a).cross(&(c - a));
        let middle = Point3::from((a.coords + b.coords + c.coords) / 3.0);
        let away = middle - of.1.closest_point(&of.0, &middle).point;
        all += normal.norm();
        inward += if normal.dot(&away) > 0.0 { 0.0 } else { normal.norm() };
    }
    assert_eq!(checked.triangles().len(), found.triangles.len());
    inward / all
}

/// Greatest difference between the distance from the mesh and `d` in the middles of triangles and edges, mm;
/// without triangles at a border, which may cut across a valley's end.
fn deviation(of: &(TriangleMesh, Bvh), found: &MeshOffset, d: f64) -> f64 {
    let level = LevelSet::new(&of.0, &of.1, d);
    let mesh = surface(found);
    let mut border = vec![false; found.vertices.len()];
    let sides = |t: &[u32; 3]| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]];
    let all: std::collections::HashSet<[u32; 2]> = mesh.triangles().iter().flat_map(sides).collect();
    for [a, b] in all.iter().filter(|[a, b]| !all.contains(&[*b, *a])) {
        [a, b].iter().for_each(|v| border[**v as usize] = true);
    }
    let of_triangle = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| mesh.vertices()[v as usize].coords);
        let middles = [(a + b + c) / 3.0, (a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5];
        middles.map(|m| level.excess(&Point3::from(m)).abs()).into_iter().fold(0.0, f64::max)
    };
    let inner = mesh.triangles().iter().filter(|t| t.iter().all(|&v| !border[v as usize]));
    inner.map(of_triangle).fold(0.0, f64::max)
}

fn length(valley: &Valley) -> f64 {
    assert!(!valley.closed);
    valley.points.windows(2).map(|w| (w[1] - w[0]).norm()).sum()
}

fn area(found: &MeshOffset) -> f64 {
    let of = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| found.vertices[v as usize]);
        0.5 * (b - a).cross(&(c - a)).norm()
    };
    found.triangles.iter().map(of).sum()
}

/// Two planes that meet at the angle `opening` in a crease along y, from (0, 0, 0) up to `side` mm away.
fn groove(opening: f64, side: f64, length: f64) -> (TriangleMesh, Bvh) {
    let (x, z) = (side * (0.5 * opening).sin(), side * (0.5 * opening).cos());
    let points =
        [[-x, 0.0, z], [0.0, 0.0, 0.0], [x, 0.0, z], [-x, length, z], [0.0, length, 0.0], [x, length, z]];
    mesh(&points, &[[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]])
}

#[test]
fn of_a_plane_is_a_plane_of_its_size() {
    let plane = grid(2, 2, false, |u, v| [10.0 * u, 10.0 * v, 2.0 * u + 3.0 * v]);
    let found = offset(&plane, &settings(2.0, 0.4));
    assert_sound(&plane, &found, 2.0);
    let exact = 100.0 * (1.0f64 + 0.04 + 0.09).sqrt();
    assert!((area(&found) / exact - 1.0).abs() < 2e-3, "{}", area(&found) / exact);
    assert!(deviation(&plane, &found, 2.0) < 1e-9 && found.valleys.is_empty());
    // A margin is as wide as a ball rolls, all around.
    let wider = offset(&plane, &OffsetSettings { margin: 0.5, ..settings(2.0, 0.2) });
    assert_sound(&plane, &wider, 2.0);
    let chord_angle = 2.0 * (0.25f64 / 2.0).asin();
    let sides = 10.0 * ((1.04f64).sqrt() + (1.09f64).sqrt()) * 2.0;
    // A strip beside each side, and a piece of a sphere at each corner.
    let strips = sides * 2.0 * chord_angle;
    let rest = area(&wider) - exact - strips;
    assert!(rest > 0.0 && rest < 1.5, "{rest}");
}

#[test]
fn the_valley_of_a_groove_is_where_both_sides_are_equally_near() {
    for opening in [40f64, 90.0, 120.0, 160.0, 175.0].map(f64::to_radians) {
        let v = groove(opening, 20.0, 12.0);
        let found = offset(&v, &settings(3.0, 0.5));
        assert_sound(&v, &found, 3.0);
        let off = deviation(&v, &found, 3.0);
        assert!(off < 1e-9, "flat sides: {off:e} at {opening}");
        assert_eq!(found.valleys.len(), 1, "{opening}");
        let valley = &found.valleys[0];
        let height = 3.0 / (0.5 * opening).sin();
        for p in &valley.points {
            assert!(p.x.abs() < 1e-9 && (p.z - height).abs() < 1e-9, "{p} at {opening}");
        }
        assert!((length(valley) - 12.0).abs() < 0.02 && !valley.closed, "{}", length(valley));
        let between = std::f64::consts::PI - opening;
        assert!(valley.angles.iter().all(|a| (a - between).abs() < 1e-6), "{:?}", valley.angles);
    }
}

#[test]
fn three_planes_meet_in_a_corner_with_three_valleys() {
    let points = [
        [0.0, 0.0, 0.0],
        [10.0, 0.0, 0.0],
        [0.0, 10.0, 0.0],
        [0.0, 0.0, 10.0],
        [10.0, 10.0, 0.0],
        [0.0, 10.0, 10.0],
        [10.0, 0.0, 10.0],
    ];
    let faces = [[0, 1, 4], [0, 4, 2], [0, 2, 5], [0, 5, 3], [0, 3, 6], [0, 6, 1]];
    let corner = mesh(&points, &faces);
    let found = offset(&corner, &settings(2.0, 0.31));
    assert_sound(&corner, &found, 2.0);
    assert!(deviation(&corner, &found, 2.0) < 1e-9);
    assert_eq!(found.valleys.len(), 3);
    assert!((area(&found) - 3.0 * 64.0).abs() < 0.3, "{}", area(&found));
    for valley in &found.valleys {
        let ends = [valley.points[0], valley.points[valley.points.len() - 1]];
        assert!(ends.iter().any(|p| (p - Point3::new(2.0, 2.0, 2.0)).norm() < 1e-9));
        assert!((length(valley) - 8.0).abs() < 0.02, "{}", length(valley));
    }
}

#[test]
fn a_convex_edge_is_rounded_and_second_order() {
    let roof = mesh(
        &[
            [-10.0, 0.0, -10.0],
            [0.0, 0.0, 0.0],
            [10.0, 0.0, -10.0],
            [-10.0, 12.0, -10.0],
            [0.0, 12.0, 0.0],
            [10.0, 12.0, -10.0],
        ],
        &[[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]],
    );
    let deviations = [0.4, 0.25].map(|cell| {
        let found = offset(&roof, &settings(2.0, cell));
        assert_sound(&roof, &found, 2.0);
        assert!(found.valleys.is_empty());
        let exact = 12.0 * (2.0 * 200f64.sqrt() + 2.0 * std::f64::consts::FRAC_PI_2);
        assert!((area(&found) / exact - 1.0).abs() < 4e-3, "{} {exact}", area(&found));
        let off = deviation(&roof, &found, 2.0);
        assert!(off <= cell * cell / (2.0 * 2.0), "{off} at {cell}");
        off
    });
    assert!(deviations[1] < 0.5 * deviations[0], "{deviations:?}");
}

#[test]
fn of_a_sphere_is_a_sphere_inside_and_out() {
    // A band around the equator, seen from outside and from inside.
    let (n, rho) = (80, 10.0);
    let at = |sense: f64| {
        move |u: f64, v: f64| {
            let (phi, theta) = (sense * std::f64::consts::TAU * u, 1.8 * (v - 0.5));
            [rho * theta.cos() * phi.cos(), rho * theta.cos() * phi.sin(), rho * theta.sin()]
        }
    };
    let sagitta = rho * (1.0 - (std::f64::consts::PI / f64::from(n)).cos()) * 2.0;
    let points = |sense: f64| {
        let mut all = Vec::new();
        for j in 0..=24 {
            for i in 0..n {
                all.push(at(sense)(f64::from(i) / f64::from(n), f64::from(j) / 24.0));
            }
        }
        all
    };
    for (sense, radius) in [(1.0, 13.0), (-1.0, 7.0)] {
        let mut triangles = Vec::new();
        for j in 0..24 {
            for i in 0..n {
                let v = |i: u32, j: u32| j * n + i % n;
                triangles.extend([
                    [v(i, j), v(i + 1, j), v(i + 1, j + 1)],
                    [v(i, j), v(i + 1, j + 1), v(i, j + 1)],
                ]);
            }
        }
        let soup = points(sense).iter().map(|p| Point3::from(*p)).collect();
        let band = TriangleMesh::new(soup, triangles).unwrap().0;
        // Open meshes are turned to face up; a band is neither, so both senses are tried and told by the
        // result.
        let outward = band.normal(0).dot(&band.corners(0)[0].coords) > 0.0;
        let radius = if outward == (sense > 0.0) { radius } else { 20.0 - radius };
        let band = (Bvh::new(&band), band);
        let band = (band.1, band.0);
        let found = offset(&band, &settings(3.0, 0.7));
        assert_sound(&band, &found, 3.0);
        for p in &found.vertices {
            assert!((p.coords.norm() - radius).abs() < sagitta, "{p}");
        }
    }
}

#[test]
fn of_a_closed_box_has_its_area() {
    let (points, triangles) = Aabb { min: Point3::origin(), max: Point3::new(6.0, 5.0, 4.0) }.surface();
    let points: Vec<[f64; 3]> = points.into_iter().map(Into::into).collect();
    let cuboid = mesh(&points, &triangles);
    let found = offset(&cuboid, &settings(1.0, 0.1));
    assert_sound(&cuboid, &found, 1.0);
    assert!(surface(&found).is_closed() && found.valleys.is_empty());
    // Faces, a quarter of a cylinder along each edge, a sphere at the corners (Steiner).
    let pi = std::f64::consts::PI;
    let exact = 2.0 * (30.0 + 24.0 + 20.0) + 2.0 * pi * (6.0 + 5.0 + 4.0) + 4.0 * pi;
    assert!((area(&found) / exact - 1.0).abs() < 1e-3, "{} {exact}", area(&found));
}

#[test]
fn a_ball_that_does_not_fit_leaves_nothing() {
    // A slot three wide between walls, its floor: a ball of 2 fits nowhere in it.
    let slot = mesh(
        &[
            [0.0, 0.0, 9.0],
            [0.0, 0.0, 0.0],
            [3.0, 0.0, 0.0],
            [3.0, 0.0, 9.0],
            [0.0, 9.0, 9.0],
            [0.0, 9.0, 0.0],
            [3.0, 9.0, 0.0],
            [3.0, 9.0, 9.0],
        ],
        &[[0, 1, 5], [0, 5, 4], [1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6]],
    );
    let refused = MeshOffset::new(&slot.0, &slot.1, &settings(2.0, 0.3), &Silent);
    assert_eq!(refused, Err(OffsetError::Empty { distance: 2.0 }));
    let fits = offset(&slot, &settings(1.0, 0.2));
    assert_sound(&slot, &fits, 1.0);
    assert_eq!(fits.valleys.len(), 2);
}

#[test]
fn slivers_folded_under_a_border_leave_it_a_border() {
    // A square whose side x = 10 has a sliver behind it, turned under.
    let points = [[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [10.0, 10.0, 0.0], [0.0, 10.0, 0.0], [9.98, 5.0, -1e-4]];
    let folded = mesh(&points, &[[0, 1, 2], [0, 2, 3], [2, 1, 4]]);
    assert!(folded.0.normal(2).z < -0.9);
    let level = LevelSet::new(&folded.0, &folded.1, 3.0);
    for degrees in [20f64, 60.0, 89.0, 120.0] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let foot = level.foot(&Point3::new(10.0 + 3.0 * sin, 4.0, 3.0 * cos));
        let rolled = level.rolled(&foot).unwrap();
        assert!((rolled - 6.0 * (0.5 * degrees.to_radians()).sin()).abs() < 1e-9, "{degrees}: {rolled}");
    }
    let found = offset(&folded, &OffsetSettings { margin: 0.3, ..settings(3.0, 0.4) });
    assert!(found.vertices.iter().all(|p| p.z > 2.9), "nothing hangs beside the border");
    // The edge of a roof is none.
    let roof = mesh(
        &[
            [-9.0, 0.0, -9.0],
            [0.0, 0.0, 0.0],
            [9.0, 0.0, -9.0],
            [-9.0, 9.0, -9.0],
            [0.0, 9.0, 0.0],
            [9.0, 9.0, -9.0],
        ],
        &[[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]],
    );
    let level = LevelSet::new(&roof.0, &roof.1, 3.0);
    assert!(!level.foot(&Point3::new(0.0, 4.0, 3.0)).on_border);
}

#[test]
fn threads_change_nothing() {
    let v = groove(1.9, 8.0, 5.0);
    let pool = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
    let [one, two] = [1, 2].map(|n| pool(n).install(|| offset(&v, &settings(2.0, 0.3))));
    assert_eq!(one, two);
}

#[test]
fn bad_settings_and_too_little_memory_are_refused() {
    let (plane, bvh) = grid(1, 1, false, |u, v| [20.0 * u, 20.0 * v, 0.0]);
    let with = |s: OffsetSettings| MeshOffset::new(&plane, &bvh, &s, &Silent).unwrap_err();
    assert!(matches!(with(settings(f64::NAN, 0.1)), OffsetError::Distance(_)));
    assert!(matches!(with(settings(-1.0, 0.1)), OffsetError::Distance(_)));
    assert!(matches!(with(settings(1.0, 0.3)), OffsetError::Cell { .. }));
    assert!(matches!(with(settings(1.0, f64::NAN)), OffsetError::Cell { .. }));
    assert!(matches!(with(settings(1.0, 1e-12)), OffsetError::Cell { .. }));
    let odd = OffsetSettings { margin: f64::NAN, ..settings(1.0, 0.1) };
    assert!(matches!(with(odd), OffsetError::Setting { what: "the margin", .. }));
    let odd = OffsetSettings { valley: 4.0, ..settings(1.0, 0.1) };
    assert!(matches!(with(odd), OffsetError::Setting { what: "the valley angle", .. }));
    let little = OffsetSettings { memory: 3e7, ..settings(1.0, 0.02) };
    let OffsetError::Memory { fitting, needed, allowed, .. } = with(little) else { panic!() };
    assert!(needed > allowed && fitting > 0.02);
    let fits = OffsetSettings { cell: fitting, ..little };
    let again = MeshOffset::new(&plane, &bvh, &fits, &Silent);
    assert!(again.is_ok(), "{} then {}", little.cell, again.unwrap_err());
}

#[test]
fn work_can_be_stopped() {
    struct Stop;
    impl Monitor for Stop {
        fn cancelled(&self) -> bool {
            true
        }
    }
    let (plane, bvh) = grid(1, 1, false, |u, v| [9.0 * u, 9.0 * v, 0.0]);
    let stopped = MeshOffset::new(&plane, &bvh, &settings(1.0, 0.1), &Stop);
    assert_eq!(stopped, Err(OffsetError::Cancelled(Cancelled)));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 5, ..ProptestConfig::default() })]

    /// Rough ground: vertices on the level set, nothing of the surface much nearer to the mesh, and every
    /// place of the level set above the middle of the ground near the surface.
    #[test]
    fn rough_ground(heights in prop::collection::vec(0.0..1.5f64, 25), d in 0.8..2.0f64, places in prop::collection::vec((2.0..6.0f64, 2.0..6.0f64), 12)) {
        let ground = grid(4, 4, false, |u, v| {
            [8.0 * u, 8.0 * v, heights[(u * 4.0).round() as usize + 5 * (v * 4.0).round() as usize]]
        });
        let found = offset(&ground, &settings(d, 0.15 * d));
        // Where valleys meet within a coarse cell, slivers may fold over.
        let folded = folded(&ground, &found, d);
        prop_assert!(folded < 2e-3, "{folded}");
        let surface = surface(&found);
        let tree = Bvh::new(&surface);
        let level = LevelSet::new(&ground.0, &ground.1, d);
        for (x, y) in places {
            // The highest place above (x, y) that is d away.
            let top = Point3::new(x, y, 1.5 + d);
            let Some(q) = level.on_line(&top, &Vector3::z(), 10.0) else { continue };
            prop_assert!((distance(&ground.0, &q) - d).abs() < 1e-9);
            if level.rolled(&level.foot(&q)) == Some(0.0) {
                let near = tree.closest_point(&surface, &q).signed_distance.abs();
                prop_assert!(near < 0.5 * d, "{near}");
            }
        }
    }
}
