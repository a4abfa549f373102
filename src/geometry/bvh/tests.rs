use super::nearest::closest_on_triangle;
use super::vertical::height_on_triangle;
use super::*;

/// Deterministic numbers in 0..1 (xorshift64*, Vigna 2016).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1u64 << 53) as f64
    }
    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }
}

fn mesh_of(vertices: Vec<Point3>, triangles: Vec<[u32; 3]>) -> TriangleMesh {
    TriangleMesh::new(vertices, triangles).unwrap().0
}

/// A grid of `n × n` quads over `x, y` in 0..n with the given heights.
fn height_field(n: u32, height: impl Fn(f64, f64) -> f64) -> TriangleMesh {
    let vertex = |i: u32| {
        let (x, y) = (f64::from(i % (n + 1)), f64::from(i / (n + 1)));
        Point3::new(x, y, height(x, y))
    };
    let vertices = (0..(n + 1) * (n + 1)).map(vertex).collect();
    let quads = (0..n * n).map(|q| (q / n) * (n + 1) + q % n);
    let triangles = quads.flat_map(|a| [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]).collect();
    mesh_of(vertices, triangles)
}

/// A closed sphere-like body with dents: latitude and longitude.
fn dented_ball(n: u32) -> TriangleMesh {
    let mut vertices = vec![Point3::new(0.0, 0.0, -4.0)];
    for i in 1..n {
        for j in 0..2 * n {
            let (lat, lon) = (
                std::f64::consts::PI * f64::from(i) / f64::from(n),
                std::f64::consts::PI * f64::from(j) / f64::from(n),
            );
            let r = 4.0 + 0.8 * (3.0 * lat).sin() * (4.0 * lon).cos() * lat.sin();
            vertices.push(Point3::new(r * lat.sin() * lon.cos(), r * lat.sin() * lon.sin(), -r * lat.cos()));
        }
    }
    vertices.push(Point3::new(0.0, 0.0, 4.0));
    let last = vertices.len() as u32 - 1;
    let at = |i: u32, j: u32| 1 + (i - 1) * 2 * n + j % (2 * n);
    let mut triangles = Vec::new();
    for j in 0..2 * n {
        triangles.push([0, at(1, j + 1), at(1, j)]);
        triangles.push([last, at(n - 1, j), at(n - 1, j + 1)]);
        for i in 1..n - 1 {
            triangles.push([at(i, j), at(i, j + 1), at(i + 1, j + 1)]);
            triangles.push([at(i, j), at(i + 1, j + 1), at(i + 1, j)]);
        }
    }
    mesh_of(vertices, triangles)
}

/// Ray casting against all triangles along an odd direction: inside where the crossings are odd.
fn inside_by_parity(mesh: &TriangleMesh, q: &Point3) -> bool {
    let d = Vector3::new(0.577, 0.211, 0.789);
    let crossings = (0..mesh.triangles().len()).filter(|&t| {
        let [a, b, c] = mesh.corners(t).map(|p| p - q);
        let s = [d.dot(&a.cross(&b)), d.dot(&b.cross(&c)), d.dot(&c.cross(&a))];
        let hit = s.iter().all(|&x| x > 0.0) || s.iter().all(|&x| x < 0.0);
        let n = (b - a).cross(&(c - a));
        hit && n.dot(&a) / n.dot(&d) > 0.0
    });
    crossings.count() % 2 == 1
}

#[test]
fn boxes_round_outward() {
    for x in [0.1, -0.1, 1.0 / 3.0, 123_456.789, -1e6, 0.0, 1e-300] {
        assert!(f64::from(round_down(x)) <= x && x <= f64::from(round_up(x)));
        assert!(f64::from(round_up(x)) - f64::from(round_down(x)) <= 1.3e-7 * x.abs() + 1e-44);
    }
}

#[test]
fn nearest_points_are_those_of_brute_force() {
    let mesh = dented_ball(24);
    let bvh = Bvh::new(&mesh);
    let mut numbers = Numbers(7);
    let mut inside = 0;
    for _ in 0..400 {
        let q = Point3::from(Vector3::from_fn(|_, _| numbers.within(-6.0, 6.0)));
        let foot = bvh.closest_point(&mesh, &q);
        let brute = (0..mesh.triangles().len())
            .map(|t| (closest_on_triangle(&mesh.corners(t), &q).distance_squared, t))
            .min_by(|a, b| a.partial_cmp(b).unwrap())
            .unwrap();
        assert_eq!((foot.signed_distance.abs(), foot.triangle as usize), (brute.0.sqrt(), brute.1));
        let corners = mesh.corners(brute.1);
        let again: Vector3 = (0..3).map(|k| corners[k].coords * foot.barycentric[k]).sum();
        assert!((again - foot.point.coords).norm() < 1e-13);
        assert_eq!(foot.signed_distance < 0.0, inside_by_parity(&mesh, &q), "{q}");
        inside += usize::from(foot.signed_distance < 0.0);
    }
    assert!((20..200).contains(&inside), "{inside} queries inside");
}

#[test]
fn the_foot_on_a_triangle_beats_every_sample() {
    // The oracle: all points of a fine barycentric grid. It also holds for slivers.
    let mut numbers = Numbers(3);
    for flat in [1.0, 1e-3, 1e-7] {
        for _ in 0..50 {
            let corners = [0, 1, 2].map(|_| {
                Point3::new(
                    numbers.within(-1.0, 1.0),
                    flat * numbers.within(-1.0, 1.0),
                    numbers.within(-1.0, 1.0),
                )
            });
            let q = Point3::from(Vector3::from_fn(|_, _| numbers.within(-2.0, 2.0)));
            let foot = closest_on_triangle(&corners, &q);
            assert!(((q - foot.point).norm_squared() - foot.distance_squared).abs() < 1e-12);
            let mut least = f64::INFINITY;
            const N: i32 = 60;
            for i in 0..=N {
                for j in 0..=N - i {
                    let (s, t) = (f64::from(i) / f64::from(N), f64::from(j) / f64::from(N));
                    let p = corners[0] + (corners[1] - corners[0]) * s + (corners[2] - corners[0]) * t;
                    least = least.min((p - q).norm_squared());
                }
            }
            assert!(foot.distance_squared <= least + 1e-14);
            assert!(least.sqrt() - foot.distance_squared.sqrt() < 0.1, "and is on the triangle");
        }
    }
}

#[test]
fn the_sign_is_right_where_two_faces_are_equally_near() {
    // A wedge with a sharp ridge: beyond the ridge a single face's normal may point away.
    let (a, b) = (Point3::new(0.0, 0.0, 0.0), Point3::new(0.0, 10.0, 0.0));
    let (c, d) = (Point3::new(1.0, 0.0, -8.0), Point3::new(1.0, 10.0, -8.0));
    let (e, f) = (Point3::new(-1.0, 0.0, -8.0), Point3::new(-1.0, 10.0, -8.0));
    let triangles =
        vec![[0, 2, 3], [0, 3, 1], [0, 1, 5], [0, 5, 4], [2, 4, 5], [2, 5, 3], [0, 4, 2], [1, 3, 5]];
    let mesh = mesh_of(vec![a, b, c, d, e, f], triangles);
    assert!(mesh.is_closed());
    let bvh = Bvh::new(&mesh);
    for q in [Point3::new(0.3, 5.0, 0.01), Point3::new(-0.3, 5.0, 0.01), Point3::new(0.0, -1.0, 1.0)] {
        let foot = bvh.closest_point(&mesh, &q);
        assert!(foot.signed_distance > 0.0, "{q}: {foot:?}");
    }
    let foot = bvh.closest_point(&mesh, &Point3::new(0.0, 5.0, 2.0));
    assert!((foot.normal - Vector3::z()).norm() < 1e-15 && foot.signed_distance == 2.0);
    assert!(bvh.closest_point(&mesh, &Point3::new(0.0, 5.0, -4.0)).signed_distance < 0.0);
}

#[test]
fn vertical_lines_agree_with_brute_force_and_never_slip_through() {
    let n = 20;
    // Vertices at thirds: edges and vertices that no f64 hits except on purpose.
    let base = height_field(n, |x, y| (0.7 * x).sin() + (0.4 * y).cos());
    let scaled = base.vertices().iter().map(|p| Point3::new(p.x / 3.0, p.y / 3.0, p.z)).collect();
    let mesh = mesh_of(scaled, base.triangles().to_vec());
    let bvh = Bvh::new(&mesh);
    let mut numbers = Numbers(11);
    let mut places: Vec<[f64; 2]> = (0..500).map(|_| [0, 1].map(|_| numbers.within(-0.5, 7.0))).collect();
    places.extend(mesh.vertices().iter().map(|p| [p.x, p.y]));
    for face in mesh.triangles() {
        for k in 0..3 {
            let (p, q) = (&mesh.vertices()[face[k] as usize], &mesh.vertices()[face[(k + 1) % 3] as usize]);
            let s = numbers.next();
            places.push([p.x + s * (q.x - p.x), p.y + s * (q.y - p.y)]);
        }
    }
    for [x, y] in places {
        let hit = bvh.highest_at(&mesh, x, y);
        let brute = (0..mesh.triangles().len())
            .filter_map(|t| height_on_triangle(&mesh.corners(t), x, y).map(|(z, _)| z))
            .max_by(f64::total_cmp);
        assert_eq!(hit.map(|h| h.z), brute);
        let b = mesh.bounds();
        let within = x >= b.min.x && x <= b.max.x && y >= b.min.y && y <= b.max.y;
        assert_eq!(hit.is_some(), within, "{x} {y}");
    }
    for p in mesh.vertices() {
        assert!((bvh.highest_at(&mesh, p.x, p.y).unwrap().z - p.z).abs() < 1e-15);
    }
}

#[test]
fn a_vertical_wall_is_met_at_its_top_edge() {
    let wall = vec![
        Point3::new(1.0, 1.0, 0.0),
        Point3::new(3.0, 2.0, 0.0),
        Point3::new(3.0, 2.0, 5.0),
        Point3::new(1.0, 1.0, 4.0),
    ];
    let mesh = mesh_of(wall, vec![[0, 1, 2], [0, 2, 3]]);
    let bvh = Bvh::new(&mesh);
    let hit = bvh.highest_at(&mesh, 2.0, 1.5).unwrap();
    assert!((hit.z - 4.5).abs() < 1e-15);
    assert_eq!(bvh.highest_at(&mesh, 3.0, 2.0).unwrap().z, 5.0);
    assert!(bvh.highest_at(&mesh, 2.0, 1.5 + 1e-12).is_none());
    assert!(bvh.highest_at(&mesh, 5.0, 3.0).is_none());
}

#[test]
fn one_triangle_and_many_equal_boxes_make_a_tree() {
    let corners = vec![Point3::origin(), Point3::new(1.0, 0.0, 0.0), Point3::new(0.0, 1.0, 0.0)];
    let mesh = mesh_of(corners, vec![[0, 1, 2]]);
    let bvh = Bvh::new(&mesh);
    assert_eq!(bvh.closest_point(&mesh, &Point3::new(0.2, 0.2, 3.0)).signed_distance, 3.0);
    assert_eq!(bvh.highest_at(&mesh, 0.5, 0.5).unwrap().z, 0.0);
    assert!(bvh.closest_point(&mesh, &Point3::new(f64::NAN, 0.0, 0.0)).signed_distance.is_nan());
    assert!(bvh.highest_at(&mesh, f64::NAN, 0.0).is_none());
    // 300 sheets through the same vertical axis: all boxes overlap.
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for i in 0..300 {
        let a = f64::from(i) * 0.01;
        let n = 3 * i as u32;
        vertices.extend([
            Point3::new(a.cos(), a.sin(), -1.0 - a),
            Point3::new(-a.cos(), -a.sin(), -1.0),
            Point3::new(a.sin(), -a.cos(), 1.0 + a),
        ]);
        triangles.push([n, n + 1, n + 2]);
    }
    let mesh = mesh_of(vertices, triangles);
    let bvh = Bvh::new(&mesh);
    let q = Point3::new(0.1, 0.2, 0.3);
    let foot = bvh.closest_point(&mesh, &q);
    let brute = (0..300).map(|t| closest_on_triangle(&mesh.corners(t), &q).distance_squared);
    assert_eq!(foot.signed_distance.abs(), brute.fold(f64::INFINITY, f64::min).sqrt());
}
