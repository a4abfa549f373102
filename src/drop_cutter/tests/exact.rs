//! Drops onto exact surfaces, against searches that know no contact conditions.

use super::*;
use geometry::Jet2;

/// A graph `z(x, y)` with its derivatives `[z, zx, zy, zxx, zxy, zyy]`, over a rectangle, searched
/// through a coarse mesh.
struct Graph<F> {
    z: F,
    domain: [[f64; 2]; 2],
    mesh: TriangleMesh,
    parameters: Vec<[f64; 2]>,
}

impl<F> std::fmt::Debug for Graph<F> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "graph over {:?}", self.domain)
    }
}

/// The parametrisation is a shear, a stretch and a bend of the plan view, so that no test passes
/// only because parameters are coordinates.
const STRETCH: [f64; 3] = [40.0, 0.025, 0.3];

fn place(u: f64, v: f64) -> [f64; 2] {
    [STRETCH[0] * (u + 0.02 * u * u), v / STRETCH[1] + STRETCH[2] * STRETCH[0] * u]
}

impl<F: Fn(f64, f64) -> [f64; 6] + Sync> Graph<F> {
    fn new(n: u32, domain: [[f64; 2]; 2], z: F) -> Self {
        let at = |range: [f64; 2], k: u32| range[0] + (range[1] - range[0]) * f64::from(k) / f64::from(n);
        let parameters: Vec<[f64; 2]> = (0..(n + 1) * (n + 1))
            .map(|i| [at(domain[0], i % (n + 1)), at(domain[1], i / (n + 1))])
            .collect();
        let vertices = parameters
            .iter()
            .map(|&[u, v]| {
                let [x, y] = place(u, v);
                Point3::new(x, y, z(x, y)[0])
            })
            .collect();
        let quads = (0..n * n).map(|q| (q / n) * (n + 1) + q % n);
        let triangles = quads.flat_map(|a| [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]).collect();
        Self { z, domain, mesh: mesh_of(vertices, triangles), parameters }
    }

    /// Greatest vertical distance between the surface and its mesh at points inside triangles: an
    /// upper bound of the distance there.
    fn deviation(&self) -> f64 {
        let mut most = 0.0f64;
        for t in 0..self.mesh.triangles().len() {
            let [a, b, c] = self.mesh.corners(t).map(|p| p.coords);
            for w in [[1.0, 1.0, 1.0], [1.0, 1.0, 0.0], [0.0, 1.0, 1.0], [1.0, 0.0, 1.0]] {
                let p = (a * w[0] + b * w[1] + c * w[2]) / (w[0] + w[1] + w[2]);
                most = most.max(((self.z)(p.x, p.y)[0] - p.z).abs());
            }
        }
        most
    }

    fn point(&self, u: f64, v: f64) -> Point3 {
        let [x, y] = place(u, v);
        Point3::new(x, y, (self.z)(x, y)[0])
    }

    /// Rest height by two pattern searches: in parameters, where the borders are straight, and in
    /// polar coordinates around the axis, where the rim is.
    fn rest(&self, cutter: &Cutter, x: f64, y: f64) -> f64 {
        let on_surface = |p: Point3| {
            let height = cutter.height((p.x - x).hypot(p.y - y));
            height.map_or(f64::NEG_INFINITY, |h| p.z - h)
        };
        let reach = cutter.radius();
        let [u, v] = parameters_of(x, y);
        let size = [1.2 * reach / STRETCH[0], 1.6 * reach * STRETCH[1]];
        let limits = |i: usize, at: f64| {
            let [low, high] = self.domain[i];
            [(at - size[i]).clamp(low, high), (at + size[i]).clamp(low, high)]
        };
        let by_parameters =
            highest_by_pattern([limits(0, u), limits(1, v)], &|[u, v]| on_surface(self.point(u, v)));
        let by_angle = highest_by_pattern([[0.0, reach], [-4.0, 4.0]], &|[rho, angle]| {
            let (sin, cos) = angle.sin_cos();
            let (px, py) = (x + rho * cos, y + rho * sin);
            let at = parameters_of(px, py);
            let inside = (0..2).all(|i| at[i] >= self.domain[i][0] && at[i] <= self.domain[i][1]);
            if !inside {
                return f64::NEG_INFINITY;
            }
            (self.z)(px, py)[0] - cutter.height(rho.min(reach)).unwrap()
        });
        by_parameters.max(by_angle)
    }
}

/// Inverts [`place`].
fn parameters_of(x: f64, y: f64) -> [f64; 2] {
    let w = x / STRETCH[0];
    let u = 2.0 * w / (1.0 + (1.0 + 0.08 * w).sqrt());
    [u, (y - STRETCH[2] * STRETCH[0] * u) * STRETCH[1]]
}

/// The greatest value over a box, by a dense grid and patterns of 24 directions that shrink around
/// its best places.
fn highest_by_pattern(limits: [[f64; 2]; 2], value: &dyn Fn([f64; 2]) -> f64) -> f64 {
    const N: i32 = 160;
    let size = limits.map(|[low, high]| high - low);
    let at = |i: usize, k: i32| limits[i][0] + size[i] * f64::from(k) / f64::from(N);
    let mut starts: Vec<(f64, [f64; 2])> = (0..=N)
        .flat_map(|i| (0..=N).map(move |j| (i, j)))
        .map(|(i, j)| [at(0, i), at(1, j)])
        .map(|p| (value(p), p))
        .collect();
    starts.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut best = f64::NEG_INFINITY;
    for &(start_value, start) in starts.iter().step_by(7).take(5) {
        let (mut top, mut here, mut share) = (start_value, start, 3.0 / f64::from(N));
        while share > 1e-12 {
            let mut moved = false;
            for k in 0..24 {
                let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / 24.0).sin_cos();
                let step = [share * size[0] * cos, share * size[1] * sin];
                let there = [0, 1].map(|i| (here[i] + step[i]).clamp(limits[i][0], limits[i][1]));
                if value(there) > top {
                    (top, here, moved) = (value(there), there, true);
                }
            }
            if !moved {
                share *= 0.7;
            }
        }
        best = best.max(top);
    }
    best
}

impl<F: Fn(f64, f64) -> [f64; 6] + Sync> ExactSurface for Graph<F> {
    fn corner_parameters(&self, t: usize) -> Option<[PatchPoint; 3]> {
        let corner = |i: u32| {
            let [u, v] = self.parameters[i as usize];
            PatchPoint { patch: 0, u, v }
        };
        Some(self.mesh.triangles()[t].map(corner))
    }
    fn domain(&self, _patch: u32) -> [[f64; 2]; 2] {
        self.domain
    }
    fn jet(&self, _patch: u32, u: f64, v: f64) -> Jet2 {
        let [x, y] = place(u, v);
        let [z, zx, zy, zxx, zxy, zyy] = (self.z)(x, y);
        let (xu, xuu) = (STRETCH[0] * (1.0 + 0.04 * u), 0.04 * STRETCH[0]);
        let (yu, yv) = (STRETCH[2] * STRETCH[0], 1.0 / STRETCH[1]);
        let second = |a: [f64; 2], b: [f64; 2]| {
            zxx * a[0] * b[0] + zxy * (a[0] * b[1] + a[1] * b[0]) + zyy * a[1] * b[1]
        };
        let (du, dv) = ([xu, yu], [0.0, yv]);
        Jet2 {
            p: Point3::new(x, y, z),
            du: Vector3::new(xu, yu, zx * xu + zy * yu),
            dv: Vector3::new(0.0, yv, zy * yv),
            duu: Vector3::new(xuu, 0.0, second(du, du) + zx * xuu),
            duv: Vector3::new(0.0, 0.0, second(du, dv)),
            dvv: Vector3::new(0.0, 0.0, second(dv, dv)),
        }
    }
}

fn compare<F: Fn(f64, f64) -> [f64; 6] + Sync>(
    name: &str,
    graph: &Graph<F>,
    places: &[[f64; 2]],
    rest: impl Fn(&Cutter, f64, f64) -> f64,
) {
    let bvh = Bvh::new(&graph.mesh);
    let deviation = graph.deviation();
    for cutter in cutters() {
        let drops =
            DropCutter::over(&graph.mesh, &bvh, &cutter, Some((graph, deviation)), &work::monitor::Silent)
                .unwrap();
        let on_mesh = dropper(&graph.mesh, &bvh, &cutter);
        let (mut mesh_error, mut beside) = (0.0f64, Beside::default());
        for &[x, y] in places {
            let drop = drops.at(x, y).unwrap();
            let expected = rest(&cutter, x, y);
            let error = drop.tip_z - expected;
            assert!(error.abs() < 1e-9, "{name} {cutter:?} at {x} {y}: {error}");
            let error = drops.at_beside(x, y, &mut beside).unwrap().tip_z - expected;
            assert!(error.abs() < 1e-9, "after another drop, {name} {cutter:?} at {x} {y}: {error}");
            let p = drop.contact.point;
            let at = drop.contact.at.unwrap();
            assert!((graph.point(at.u, at.v) - p).norm() < 1e-12);
            assert!(drop.contact.normal.z > 0.0);
            mesh_error = mesh_error.max((on_mesh.at(x, y).unwrap().tip_z - expected).abs());
        }
        assert!(mesh_error > 1e-6, "the mesh alone is off by {mesh_error}");
    }
}

#[test]
fn a_ball_on_a_sphere_is_a_greater_sphere() {
    const R: f64 = 30.0;
    let cap = |x: f64, y: f64| {
        let z = (R * R - x * x - y * y).sqrt();
        let (zx, zy) = (-x / z, -y / z);
        let second = |a: f64, b: f64, same: f64| -(same + a * b) / z;
        [z, zx, zy, second(zx, zx, 1.0), second(zx, zy, 0.0), second(zy, zy, 1.0)]
    };
    let graph = Graph::new(16, [[-0.35, 0.35], [-0.4, 0.4]], cap);
    let bvh = Bvh::new(&graph.mesh);
    let cutter = Cutter::ball(6.0).unwrap();
    let drops = DropCutter::over(
        &graph.mesh,
        &bvh,
        &cutter,
        Some((&graph, graph.deviation())),
        &work::monitor::Silent,
    )
    .unwrap();
    for (x, y) in [(0.0, 0.0), (1.0, 2.0), (-7.0, 3.0), (6.0, -6.0), (0.1, 9.0)] {
        let drop = drops.at(x, y).unwrap();
        let centre: f64 = ((R + 3.0f64).powi(2) - x * x - y * y).sqrt();
        assert!((drop.tip_z - (centre - 3.0)).abs() < 1e-13, "{x} {y}");
        let normal = Vector3::new(x, y, centre) / (R + 3.0);
        assert!((drop.contact.normal - normal).norm() < 1e-7);
        assert!((drop.contact.point.coords - R * normal).norm() < 1e-6);
    }
}

#[test]
fn a_sine_wave_agrees_with_a_dense_search_along_x() {
    let (a, k) = (2.0, 0.4);
    let wave = move |x: f64, _: f64| {
        let (s, c) = (k * x).sin_cos();
        [a * s, a * k * c, 0.0, -a * k * k * s, 0.0, 0.0]
    };
    let graph = Graph::new(60, [[-0.6, 0.6], [-0.8, 0.8]], wave);
    // Wherever the surface does not change across, the best contact lies at the axis's own y.
    let rest = |cutter: &Cutter, x: f64, _: f64| {
        let value = |q: f64| a * (k * q).sin() - cutter.height((q - x).abs().min(cutter.radius())).unwrap();
        const N: i32 = 600;
        let r = cutter.radius();
        let at = |i: i32| x + r * f64::from(i) / f64::from(N);
        let top = (-N..=N).max_by(|&i, &j| value(at(i)).total_cmp(&value(at(j)))).unwrap();
        golden(at((top - 1).max(-N)), at((top + 1).min(N)), &value)
    };
    let mut numbers = Numbers(4);
    let mut places: Vec<[f64; 2]> =
        (0..40).map(|_| [numbers.within(-15.0, 15.0), numbers.within(-8.0, 8.0)]).collect();
    // The bottom of a valley, too narrow for most cutters: two contacts equally high.
    places.push([-std::f64::consts::FRAC_PI_2 / k, 1.0]);
    compare("wave", &graph, &places, rest);
}

#[test]
fn bumps_borders_and_corners_agree_with_a_pattern_search() {
    let bumps = |x: f64, y: f64| {
        let ((sx, cx), (sy, cy)) = ((0.5 * x).sin_cos(), (0.35 * y).sin_cos());
        [
            1.5 * sx * cy + 0.1 * x,
            0.75 * cx * cy + 0.1,
            -0.525 * sx * sy,
            -0.375 * sx * cy,
            -0.2625 * cx * sy,
            -0.18375 * sx * cy,
        ]
    };
    let graph = Graph::new(60, [[-0.4, 0.4], [-0.4, 0.4]], bumps);
    let mut numbers = Numbers(14);
    let mut places: Vec<[f64; 2]> =
        (0..5).map(|_| place(numbers.within(-0.35, 0.35), numbers.within(-0.35, 0.35))).collect();
    // Beyond a border and beyond a corner.
    let [x, y] = place(0.4, 0.1);
    places.push([x + 0.7, y]);
    let [x, y] = place(-0.4, -0.4);
    places.push([x - 0.4, y - 0.5]);
    compare("bumps", &graph, &places, |cutter, x, y| graph.rest(cutter, x, y));
}

#[test]
fn flat_ground_takes_any_cutter() {
    // No curvature at all: every step of the climb meets a model without a maximum.
    let graph =
        Graph::new(8, [[-0.4, 0.4], [-0.4, 0.4]], |x, y| [0.3 * x - 0.2 * y, 0.3, -0.2, 0.0, 0.0, 0.0]);
    let level = Graph::new(8, [[-0.4, 0.4], [-0.4, 0.4]], |_, _| [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let (bvh, level_bvh) = (Bvh::new(&graph.mesh), Bvh::new(&level.mesh));
    for cutter in cutters() {
        for deviation in [0.0, 1e-3] {
            let drops = DropCutter::over(
                &graph.mesh,
                &bvh,
                &cutter,
                Some((&graph, deviation)),
                &work::monitor::Silent,
            )
            .unwrap();
            let on_mesh = dropper(&graph.mesh, &bvh, &cutter).at(1.0, 2.0).unwrap();
            let drop = drops.at(1.0, 2.0).unwrap();
            assert!((drop.tip_z - on_mesh.tip_z).abs() < 1e-12, "{cutter:?}");
            let drops = DropCutter::over(
                &level.mesh,
                &level_bvh,
                &cutter,
                Some((&level, deviation)),
                &work::monitor::Silent,
            )
            .unwrap();
            assert!((drops.at(1.0, 2.0).unwrap().tip_z - 1.0).abs() < 1e-14);
        }
    }
}
