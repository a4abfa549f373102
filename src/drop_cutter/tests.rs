use super::touch::Profile;
use super::*;
use cutter::AptWords;
use geometry::{Aabb, Point3, Vector3};

mod exact;
mod grid;

/// Deterministic numbers in 0..1 (SplitMix64, Steele et al. 2014).
pub(super) struct Numbers(pub(super) u64);

impl Numbers {
    pub(super) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
    pub(super) fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }
}

/// One cutter of each kind, the taper also with a sharp corner and with a ball, and profiles with
/// every piece.
pub(super) fn cutters() -> Vec<Cutter> {
    let mut cutters = vec![
        Cutter::ball(6.0).unwrap(),
        Cutter::flat(5.0).unwrap(),
        Cutter::bull(6.0, 1.2).unwrap(),
        Cutter::taper(3.0, 1.5, 0.3, 6.0).unwrap(),
        Cutter::taper(3.0, 0.7, 0.6, 6.0).unwrap(),
        Cutter::taper(2.0, 0.0, 0.8, 6.0).unwrap(),
    ];
    cutters.extend(AptWords::examples().iter().map(|words| Cutter::apt(words).unwrap()));
    cutters
}

fn mesh_of(vertices: Vec<Point3>, triangles: Vec<[u32; 3]>) -> TriangleMesh {
    TriangleMesh::new(vertices, triangles).unwrap().0
}

/// A grid of `n × n` quads over a square of side `size`, jittered in the plan view.
pub(super) fn height_field(
    n: u32,
    size: f64,
    jitter: f64,
    mut height: impl FnMut(f64, f64) -> f64,
) -> TriangleMesh {
    let mut numbers = Numbers(5);
    let step = size / f64::from(n);
    let vertices = (0..(n + 1) * (n + 1)).map(|i| {
        let mut place = |k: u32| (f64::from(k) + numbers.within(-jitter, jitter)) * step;
        let (x, y) = (place(i % (n + 1)), place(i / (n + 1)));
        Point3::new(x, y, height(x, y))
    });
    let vertices = vertices.collect();
    let quads = (0..n * n).map(|q| (q / n) * (n + 1) + q % n);
    mesh_of(vertices, quads.flat_map(|a| [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]).collect())
}

/// Greatest value of a concave function on an interval, by golden sections.
fn golden(mut low: f64, mut high: f64, f: &dyn Fn(f64) -> f64) -> f64 {
    const PHI: f64 = 0.618_033_988_749_894_8;
    let (mut a, mut b) = (high - PHI * (high - low), low + PHI * (high - low));
    let (mut fa, mut fb) = (f(a), f(b));
    let mut best = f(low).max(f(high)).max(fa).max(fb);
    for _ in 0..90 {
        if fa < fb {
            (low, a, fa) = (a, b, fb);
            b = low + PHI * (high - low);
            fb = f(b);
        } else {
            (high, b, fb) = (b, a, fa);
            a = high - PHI * (high - low);
            fa = f(a);
        }
        best = best.max(fa).max(fb);
    }
    best
}

/// Where the line `p + s d` lies within `radius` of the axis, cut to 0..1.
fn inside_radius(p: &Vector3, d: &Vector3, radius: f64) -> Option<[f64; 2]> {
    let (a, b, c) = (d.x * d.x + d.y * d.y, p.x * d.x + p.y * d.y, p.x * p.x + p.y * p.y - radius * radius);
    if a == 0.0 {
        return (c <= 0.0).then_some([0.0, 1.0]);
    }
    let root = b * b - a * c;
    let (low, high) = (((-b - root.sqrt()) / a).max(0.0), ((-b + root.sqrt()) / a).min(1.0));
    (root >= 0.0 && low <= high).then_some([low, high])
}

/// The rest height on one triangle by two nested searches: no facet, edge or vertex contact is
/// known to it, only that the function is concave. Uses [`Cutter::height`].
fn rest_by_search(corners: [Point3; 3], cutter: &Cutter, x: f64, y: f64) -> f64 {
    let axis = Vector3::new(x, y, 0.0);
    let [a, b, c] = corners.map(|p| p.coords - axis);
    let value = |q: Vector3| q.z - cutter.height(q.x.hypot(q.y).min(cutter.radius())).unwrap();
    // Inner search: along the line from c to the point at `s` on side ab.
    let inner = |s: f64| {
        let d = a + (b - a) * s - c;
        match inside_radius(&c, &d, cutter.radius()) {
            Some([low, high]) => golden(low, high, &|t| value(c + d * t)),
            None => f64::NEG_INFINITY,
        }
    };
    // The outer interval: the lines that meet the cutter's circle, found from the one that passes
    // the axis closest.
    let nearness = |s: f64| {
        let d = a + (b - a) * s - c;
        let t = (-(c.x * d.x + c.y * d.y) / (d.x * d.x + d.y * d.y)).clamp(0.0, 1.0);
        -(c + d * t).xy().norm_squared()
    };
    let mut middle = 0.5;
    let mut best = nearness(middle);
    let mut width = 0.5;
    while width > 1e-17 {
        for s in [(middle - width).max(0.0), (middle + width).min(1.0)] {
            if nearness(s) > best {
                (middle, best) = (s, nearness(s));
            }
        }
        width *= 0.8;
    }
    if inner(middle) == f64::NEG_INFINITY {
        return f64::NEG_INFINITY;
    }
    let edge = |mut out: f64| {
        let mut within = middle;
        if inner(out) > f64::NEG_INFINITY {
            return out;
        }
        for _ in 0..60 {
            let half = 0.5 * (within + out);
            if inner(half) > f64::NEG_INFINITY { within = half } else { out = half }
        }
        within
    };
    golden(edge(0.0), edge(1.0), &inner)
}

fn rest_by_brute_force(mesh: &TriangleMesh, cutter: &Cutter, x: f64, y: f64) -> Option<f64> {
    let lowest = cutter.height(0.0).unwrap();
    let rest_on = |p: &Point3| cutter.height((p.x - x).hypot(p.y - y)).map(|h| p.z - h);
    let mut best = mesh.vertices().iter().filter_map(rest_on).fold(f64::NEG_INFINITY, f64::max);
    for t in 0..mesh.triangles().len() {
        let corners = mesh.corners(t);
        let near = |axis: usize, at: f64| {
            corners.iter().any(|p| p[axis] < at + cutter.radius())
                && corners.iter().any(|p| p[axis] > at - cutter.radius())
        };
        let top = corners.iter().map(|p| p.z).fold(f64::NEG_INFINITY, f64::max);
        if near(0, x) && near(1, y) && top - lowest > best {
            best = best.max(rest_by_search(corners, cutter, x, y));
        }
    }
    (best > f64::NEG_INFINITY).then_some(best)
}

fn dropper<'a>(mesh: &'a TriangleMesh, bvh: &'a Bvh, cutter: &Cutter) -> DropCutter<'a> {
    DropCutter::over(mesh, bvh, cutter, None, &work::monitor::Silent).unwrap()
}

#[test]
fn the_profile_is_the_cutters_and_grows_evenly() {
    for cutter in cutters() {
        let (own, grown) = (Profile::of(&cutter, 0.0), Profile::of(&cutter, 0.1));
        const N: i32 = 1000;
        let own_points: Vec<[f64; 2]> = (0..=N)
            .map(|i| {
                let rho = cutter.radius() * f64::from(i) / f64::from(N);
                assert!((own.height(rho) - cutter.height(rho).unwrap()).abs() < 1e-14, "{cutter:?} {rho}");
                [rho, own.height(rho)]
            })
            .collect();
        // Below its cylinder the grown profile runs 0.1 away from the own one (or from its mirror
        // image beyond the axis).
        for i in 0..N {
            let rho = cutter.radius() * f64::from(i) / f64::from(N);
            let z = grown.height(rho);
            let away = |p: &[f64; 2]| (p[0] - rho).hypot(p[1] - z).min((p[0] + rho).hypot(p[1] - z));
            let least = own_points.iter().map(away).fold(f64::INFINITY, f64::min);
            // Edges and points stay sharp, and so farther out.
            let sharp = !cutter.profile().is_plain() && least > 0.1;
            assert!(
                (least - 0.1).abs() < 2e-3 || sharp || rho > 0.95 * cutter.radius(),
                "{cutter:?} {rho} {least}"
            );
        }
    }
}

#[test]
fn planes_have_their_closed_forms() {
    // z = g x: the tip rises by what the profile leaves between itself and the plane.
    for slope in [0.0f64, 0.2, 1.0, 2.5] {
        let mesh = height_field(6, 60.0, 0.0, |x, _| slope * (x - 30.0));
        let bvh = Bvh::new(&mesh);
        let lift = |cutter: &Cutter| {
            let drop = dropper(&mesh, &bvh, cutter).at(30.0, 31.0).unwrap();
            if slope > 0.0 && drop.contact.point.x != 30.0 {
                assert!(drop.contact.point.x > 30.0, "it touches uphill");
            }
            let n = Vector3::new(-slope, 0.0, 1.0).normalize();
            assert!((drop.contact.normal - n).norm() < 1e-14);
            drop.tip_z
        };
        let root = slope.hypot(1.0);
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-13, "{a} {b} at slope {slope}");
        close(lift(&Cutter::ball(6.0).unwrap()), 3.0 * (root - 1.0));
        close(lift(&Cutter::flat(6.0).unwrap()), 3.0 * slope);
        close(lift(&Cutter::bull(6.0, 1.0).unwrap()), 2.0 * slope + root - 1.0);
        // The cone of half angle 45° is steeper than slopes below 1; beyond it the rim touches.
        let taper = Cutter::taper(2.0, 1.0, std::f64::consts::FRAC_PI_4, 6.0).unwrap();
        let rim = 3.0 * slope - taper.side_height();
        close(lift(&taper), if slope <= 1.0 { root - 1.0 } else { rim });
    }
}

#[test]
fn a_needle_and_a_ridge_carry_every_cutter() {
    // A ridge along y with steep sides, and its end points.
    let ridge = |h: f64| {
        vec![
            Point3::new(0.0, 0.0, h),
            Point3::new(0.0, 10.0, h),
            Point3::new(0.1, 5.0, h - 20.0),
            Point3::new(-0.1, 5.0, h - 20.0),
        ]
    };
    let mesh = mesh_of(ridge(7.0), vec![[0, 2, 1], [0, 1, 3]]);
    let bvh = Bvh::new(&mesh);
    for cutter in cutters() {
        let drops = dropper(&mesh, &bvh, &cutter);
        for rho in [0.0, 0.3, 1.1, 2.0, 2.4] {
            let expected = 7.0 - cutter.height(rho).unwrap();
            let drop = drops.at(rho, 4.0).unwrap();
            assert!((drop.tip_z - expected).abs() < 1e-13, "{cutter:?} {rho}");
            let past_end = drops.at(0.6 * rho, -0.8 * rho).unwrap();
            assert!((past_end.tip_z - expected).abs() < 1e-13, "{cutter:?} {rho}");
            assert!((past_end.contact.point - Point3::new(0.0, 0.0, 7.0)).norm() < 1e-13);
        }
        assert!(drops.at(4.0, 4.0).is_none());
        for far in [f64::NAN, f64::INFINITY, -1e308, 1e200, 1e7] {
            assert!(drops.at(far, 4.0).is_none() && drops.at(0.0, far).is_none());
        }
    }
}

#[test]
fn drops_are_those_of_brute_force() {
    let waves = height_field(14, 20.0, 0.3, |x, y| 2.0 * (0.9 * x).sin() * (0.7 * y).cos() + 0.2 * x);
    let mut numbers = Numbers(9);
    let noise = height_field(12, 14.0, 0.3, |_, _| 4.0 * numbers.next());
    let mut numbers = Numbers(21);
    let slivers = mesh_of(
        (0..120)
            .map(|_| {
                Point3::new(numbers.within(0.0, 15.0), numbers.within(0.0, 15.0), numbers.within(0.0, 6.0))
            })
            .collect(),
        (0..40).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
    );
    for (name, mesh) in [("waves", waves), ("noise", noise), ("slivers", slivers)] {
        let bvh = Bvh::new(&mesh);
        let b = mesh.bounds();
        for cutter in cutters() {
            let drops = dropper(&mesh, &bvh, &cutter);
            for _ in 0..12 {
                let x = numbers.within(b.min.x - 3.0, b.max.x + 3.0);
                let y = numbers.within(b.min.y - 3.0, b.max.y + 3.0);
                let found = drops.at(x, y);
                let expected = rest_by_brute_force(&mesh, &cutter, x, y);
                assert_eq!(found.is_some(), expected.is_some(), "{name} {cutter:?} at {x} {y}");
                if let (Some(drop), Some(expected)) = (found, expected) {
                    let error = drop.tip_z - expected;
                    assert!(error.abs() < 1e-9, "{name} {cutter:?} at {x} {y}: {error}");
                    let p = drop.contact.point;
                    let rest = p.z - cutter.height((p.x - x).hypot(p.y - y).min(cutter.radius())).unwrap();
                    assert!((rest - drop.tip_z).abs() < 1e-9, "the contact carries the cutter");
                }
            }
        }
    }
}

/// The best of all triangles, each looked at alone.
fn rest_on_all(mesh: &TriangleMesh, profile: &Profile, x: f64, y: f64) -> Option<f64> {
    let facet = |t| Facet::new(mesh.corners(t), &mesh.normal(t), Carries::ALL, profile);
    let touch = |t| facet(t).touch(profile, x, y, f64::NEG_INFINITY);
    (0..mesh.triangles().len()).filter_map(touch).map(|t| t.tip_z).max_by(f64::total_cmp)
}

#[test]
fn the_tree_leaves_no_better_triangle_out() {
    let mesh = height_field(60, 100.0, 0.3, |x, y| 3.0 * (0.3 * x).sin() + 2.0 * (0.2 * y + 0.1 * x).cos());
    let bvh = Bvh::new(&mesh);
    let mut numbers = Numbers(2);
    for cutter in cutters() {
        let drops = dropper(&mesh, &bvh, &cutter);
        for _ in 0..100 {
            let (x, y) = (numbers.within(-2.0, 102.0), numbers.within(-2.0, 102.0));
            let all = rest_on_all(&mesh, &drops.search, x, y);
            let found = drops.at(x, y).map(|d| d.tip_z);
            assert_eq!(found.is_some(), all.is_some());
            // From the other side of an edge the same contact is rounded otherwise.
            assert!(found.zip(all).is_none_or(|(f, a)| (f - a).abs() < 1e-12), "{found:?} {all:?}");
        }
    }
}

#[test]
fn no_cutter_cuts_into_a_vertical_wall_or_a_needle() {
    // A box with vertical walls on a plate: the walls carry the cutter with their top edges.
    let (corners, triangles) = Aabb { min: Point3::origin(), max: Point3::new(10.0, 10.0, 10.0) }.surface();
    let mesh = mesh_of(corners, triangles);
    let bvh = Bvh::new(&mesh);
    for cutter in cutters() {
        let drops = dropper(&mesh, &bvh, &cutter);
        for rho in [0.0, 0.5, 1.0, 2.3] {
            let expected = 10.0 - cutter.height(rho).unwrap();
            assert!((drops.at(10.0 + rho, 5.0).unwrap().tip_z - expected).abs() < 1e-13);
            assert!((drops.at(10.0 + 0.6 * rho, 10.0 + 0.8 * rho).unwrap().tip_z - expected).abs() < 1e-13);
        }
        assert_eq!(drops.at(5.0, 5.0).unwrap().tip_z, 10.0);
        assert!((drops.at(5.0, 5.0).unwrap().contact.normal - Vector3::z()).norm() == 0.0);
    }
}

#[test]
fn a_row_of_drops_gives_what_single_drops_give() {
    let waves = height_field(14, 20.0, 0.3, |x, y| 2.0 * (0.9 * x).sin() * (0.7 * y).cos() + 0.2 * x);
    let mut numbers = Numbers(9);
    let noise = height_field(12, 14.0, 0.3, |_, _| 4.0 * numbers.next());
    for mesh in [waves, noise] {
        let bvh = Bvh::new(&mesh);
        for cutter in cutters() {
            let drops = dropper(&mesh, &bvh, &cutter);
            let (mut beside, mut kept) = (Beside::default(), 0);
            for k in 0..400 {
                // Along a line over both borders; every tenth drop jumps, from far away and from no drop.
                let s = 0.1 * f64::from(k) - 8.0;
                let (x, y) = if k % 10 == 9 { (17.0 - s, 3.0 + 0.1 * s) } else { (s, 5.0 + 0.3 * s) };
                let row = drops.at_beside(x, y, &mut beside).map(|d| d.tip_z);
                let single = drops.at(x, y).map(|d| d.tip_z);
                assert_eq!(row.is_some(), single.is_some(), "{cutter:?} at {x} {y}");
                // From the other side of an edge the same contact is rounded otherwise.
                assert!(row.zip(single).is_none_or(|(a, b)| (a - b).abs() < 1e-12), "{row:?} {single:?}");
                kept += usize::from(row.is_some());
            }
            assert!((100..400).contains(&kept), "rows leave the part: {kept}");
        }
    }
}
