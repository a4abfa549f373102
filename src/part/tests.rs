use super::*;
use approx::assert_relative_eq;
use geometry::{AnalyticShape, AnalyticSurface, NurbsSurface, Point2, samples};
use proptest::prelude::*;
use work::monitor::{Cancelled, Monitor, Silent};

fn nurbs_part(s: NurbsSurface, tolerance: f64) -> Part {
    Part::from_patches(vec![Patch::Nurbs(s)], tolerance).unwrap()
}

fn graph(shape: AnalyticShape, domain: [[f64; 2]; 2]) -> Patch {
    Patch::Analytic(AnalyticSurface::new(shape, domain).unwrap())
}

fn graph_part(shape: AnalyticShape, domain: [[f64; 2]; 2]) -> Part {
    Part::from_patches(vec![graph(shape, domain)], 0.05).unwrap()
}

const CENTRE: Point3 = Point3::new(1.0, -2.0, 3.0);

fn dome() -> Part {
    nurbs_part(samples::hemisphere(CENTRE, 10.0), 0.05)
}

#[test]
fn closest_point_of_a_dome_is_radial() {
    let part = dome();
    // At the pole, across the closed seam, inside and outside.
    let directions = [
        [0.0, 0.0, 1.0],
        [1.0, 0.0, 0.5],
        [1.0, -1e-7, 0.5],
        [1.0, 1e-7, 0.5],
        [-0.3, 0.8, 0.2],
        [1e-3, 0.0, 1.0],
        [-0.02, 0.03, 1.0],
        [0.05, 0.05, 1.0],
    ];
    for d in directions.map(|[x, y, z]| Vector3::new(x, y, z).normalize()) {
        for radius in [4.0, 9.99, 10.0, 10.5, 40.0] {
            let (foot, distance) = part.closest_point(&(CENTRE + d * radius));
            assert_relative_eq!(foot.point, CENTRE + d * 10.0, epsilon = 1e-11);
            assert_relative_eq!(foot.normal, d, epsilon = 1e-6);
            assert_relative_eq!(distance, radius - 10.0, epsilon = 1e-11);
            let at = foot.at.unwrap();
            assert_relative_eq!(part.patches()[0].point(at.u, at.v), foot.point, epsilon = 1e-12);
        }
    }
    // Below the equator the border holds the foot.
    let (foot, distance) = part.closest_point(&(CENTRE + Vector3::new(20.0, 0.0, -3.0)));
    assert_relative_eq!(foot.point, CENTRE + Vector3::new(10.0, 0.0, 0.0), epsilon = 1e-9);
    assert_relative_eq!(distance, 109f64.sqrt(), epsilon = 1e-12);
}

#[test]
fn heights_of_a_dome_up_to_pole_and_silhouette() {
    let part = dome();
    for rho in [0.0, 1e-9, 1e-4, 0.3, 5.0, 9.0, 9.9, 9.94] {
        for k in 0..12 {
            let angle = 0.523 * f64::from(k);
            let (dx, dy) = (rho * angle.cos(), rho * angle.sin());
            let hit = part.highest_at(CENTRE.x + dx, CENTRE.y + dy).unwrap();
            let up = (100.0 - rho * rho).sqrt();
            assert_relative_eq!(hit.point.z, CENTRE.z + up, epsilon = 1e-11);
            // Beside the pole du is as small as rho, and so are the digits left of its direction.
            assert_relative_eq!(hit.normal, Vector3::new(dx, dy, up) / 10.0, epsilon = 1e-5);
        }
    }
    assert!(part.highest_at(CENTRE.x + 10.1, CENTRE.y).is_none());
}

#[test]
fn patches_that_face_down_are_turned_over() {
    // A half cylinder's du × dv points to its axis, down on the whole.
    let part = nurbs_part(samples::half_cylinder(5.0, 20.0), 0.02);
    let at = PatchPoint { patch: 0, u: 1.0, v: 0.5 };
    let (point, normal) = part.point_and_normal(at);
    assert_relative_eq!(normal, Vector3::z(), epsilon = 1e-14);
    assert_relative_eq!(point, Point3::new(0.0, 10.0, 5.0), epsilon = 1e-13);
    // Convex seen from outside, whatever the parametrisation says.
    let k = part.curvature(at).unwrap();
    assert_relative_eq!(k.min, -0.2, epsilon = 1e-13);
    assert_relative_eq!(k.max, 0.0, epsilon = 1e-13);
    assert_relative_eq!(k.max_direction.y.abs(), 1.0, epsilon = 1e-12);
    for t in 0..part.mesh().triangles().len() {
        let middle = part.mesh().corners(t).iter().fold(Vector3::zeros(), |s, p| s + p.coords) / 3.0;
        assert!(part.mesh().normal(t).dot(&Vector3::new(middle.x, 0.0, middle.z)) > 0.0);
        for (p, at) in part.mesh().corners(t).iter().zip(part.corner_parameters(t).unwrap()) {
            assert_relative_eq!(*p, part.point_and_normal(at).0, epsilon = 1e-12);
        }
    }
    assert_relative_eq!(part.closest_point(&Point3::new(0.0, 10.0, 4.0)).1, -1.0, epsilon = 1e-11);
}

#[test]
fn graphs_answer_on_their_very_border() {
    let shape = AnalyticShape::Wave { amplitude: 1.0, wavelength_x: 13.0, wavelength_y: Some(17.0) };
    let domain = [[-11.0, 9.3], [0.1, 20.7]];
    let part = graph_part(shape, domain);
    let exact = AnalyticSurface::new(shape, domain).unwrap();
    for (x, y) in [(-11.0, 0.1), (9.3, 20.7), (-11.0, 7.77), (1.234, 20.7), (0.0, 3.0)] {
        let hit = part.highest_at(x, y).unwrap();
        assert_eq!((hit.point.x, hit.point.y), (x, y));
        assert_relative_eq!(hit.point.z, exact.height(x, y), epsilon = 1e-15);
        assert_relative_eq!(hit.normal, exact.height_jet(x, y).normal(), epsilon = 1e-15);
        assert_eq!(hit.at, Some(PatchPoint { patch: 0, u: x, v: y }));
    }
    assert!(part.highest_at(9.4, 3.0).is_none() && part.highest_at(f64::NAN, 0.0).is_none());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn closest_point_is_that_of_a_dense_search(
        weights in proptest::collection::vec(0.4f64..2.5, 42),
        queries in proptest::collection::vec((0.0f64..60.0, 0.0f64..60.0, -12.0f64..12.0), 6),
    ) {
        const DENSE: usize = 120;
        let surface = samples::bicubic(&weights);
        let part = nurbs_part(surface.clone(), 0.05);
        let lattice: Vec<Point3> = (0..=DENSE * DENSE + 2 * DENSE)
            .map(|k| surface.point((k % (DENSE + 1)) as f64 / DENSE as f64, (k / (DENSE + 1)) as f64 / DENSE as f64))
            .collect();
        for (x, y, z) in queries {
            let q = Point3::new(x, y, z);
            let (foot, distance) = part.closest_point(&q);
            prop_assert!(((foot.point - q).norm() - distance.abs()).abs() < 1e-12);
            let dense = lattice.iter().map(|p| (p - q).norm()).fold(f64::INFINITY, f64::min);
            // Never farther than any other point, up to twice the deviation, as documented.
            prop_assert!(distance.abs() <= dense + 2.0 * part.mesh_deviation());
            let on_mesh = part.bvh().closest_point(part.mesh(), &q).signed_distance.abs();
            prop_assert!(distance.abs() <= on_mesh + part.mesh_deviation() + 1e-9);
            let at = foot.at.unwrap();
            let jet = surface.jet(at.u, at.v);
            prop_assert!((jet.p - foot.point).norm() < 1e-12);
            // A foot of the perpendicular, where no border holds it.
            for (d, t) in [(jet.du, at.u), (jet.dv, at.v)] {
                if t > 0.0 && t < 1.0 {
                    prop_assert!((q - foot.point).dot(&d.normalize()).abs() < 1e-10);
                }
            }
        }
    }

    #[test]
    fn heights_lie_on_the_patch(
        weights in proptest::collection::vec(0.4f64..2.5, 42),
        places in proptest::collection::vec((0.0f64..=60.0, 0.0f64..=60.0), 20),
    ) {
        let surface = samples::bicubic(&weights);
        let part = nurbs_part(surface.clone(), 0.05);
        for (x, y) in places {
            let Some(hit) = part.highest_at(x, y) else {
                // Only beside the border.
                prop_assert!(!(0.1..=59.9).contains(&x) || !(0.1..=59.9).contains(&y));
                continue;
            };
            let at = hit.at.unwrap();
            prop_assert!((surface.point(at.u, at.v) - hit.point).norm() < 1e-12);
            let normal = surface.jet(at.u, at.v).normal().unwrap();
            prop_assert!((normal * normal.z.signum() - hit.normal).norm() < 1e-10);
        }
    }
}

/// A bicubic surface over 30 mm by 20 mm, whole and as its two halves along u.
fn whole_and_halves() -> [Part; 2] {
    let net: Vec<Vec<Point3>> = (0..4)
        .map(|i| (0..4).map(move |j| (f64::from(i), f64::from(j))))
        .map(|row| {
            row.map(|(i, j)| Point3::new(10.0 * i + 2.0 * j, 7.0 * j, 3.0 * (2.1 * i + 1.3 * j).sin()))
                .collect()
        })
        .collect();
    let bicubic = |net: &[Vec<Point3>]| {
        let ends = || vec![0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0];
        Patch::Nurbs(NurbsSurface::new(3, 3, ends(), ends(), net, None).unwrap())
    };
    // By de Casteljau's means.
    let mean = |rows: &[Vec<Point3>]| -> Vec<Vec<Point3>> {
        let of = |pair: &[Vec<Point3>]| {
            pair[0].iter().zip(&pair[1]).map(|(a, b)| nalgebra::center(a, b)).collect()
        };
        rows.windows(2).map(of).collect()
    };
    let (once, twice) = (mean(&net), mean(&mean(&net)));
    let middle = mean(&twice)[0].clone();
    let first = [net[0].clone(), once[0].clone(), twice[0].clone(), middle.clone()];
    let second = [middle, twice[1].clone(), once[2].clone(), net[3].clone()];
    [vec![bicubic(&net)], vec![bicubic(&first), bicubic(&second)]]
        .map(|patches| Part::from_patches(patches, 0.05).unwrap())
}

/// Beside a seam the mesh may come nearest on the other side of it.
#[test]
fn closest_points_beside_a_seam_are_those_of_the_whole_surface() {
    let [whole, halves] = whole_and_halves();
    for k in 0..4000 {
        let [u, v] = [0.5 + 2e-3 * (f64::from(k % 101) / 50.0 - 1.0), f64::from(k) / 4000.0];
        let (point, normal) = whole.point_and_normal(PatchPoint { patch: 0, u, v });
        for height in [-0.3, 0.01, 0.01 + 0.29 * v] {
            let (foot, distance) = halves.closest_point(&(point + normal * height));
            assert_relative_eq!(distance, height, epsilon = 1e-11);
            assert_relative_eq!(foot.point, point, epsilon = 1e-9);
        }
    }
}

/// From beside a centre of curvature the distance to the surface is the same over a wide stretch; the
/// foot still is where the line to it stands upright.
#[test]
fn feet_seen_from_centres_of_curvature_stand_upright() {
    let mut compared = 0;
    for seed in 0..40u32 {
        let weights: Vec<f64> =
            (0..42).map(|k| 0.4 + f64::from((seed * 97 + k * k * 31 + k * 7) % 64) / 30.0).collect();
        let surface = samples::bicubic(&weights);
        let part = nurbs_part(surface.clone(), 0.05);
        for k in 0..24u32 {
            let share = |n: u32| 0.08 + 0.84 * f64::from((k * n + seed * 5) % 29) / 28.0;
            let at = PatchPoint { patch: 0, u: share(11), v: share(17) };
            let Some(bend) = part.curvature(at) else { continue };
            let (point, normal) = part.point_and_normal(at);
            let sharpest = if bend.max.abs() > bend.min.abs() { bend.max } else { bend.min };
            for off in [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9] {
                let q = point + normal * ((1.0 - off) / sharpest);
                let (foot, _) = part.closest_point(&q);
                let at = foot.at.unwrap();
                let jet = surface.jet(at.u, at.v);
                for (d, t) in [(jet.du, at.u), (jet.dv, at.v)] {
                    if t > 0.0 && t < 1.0 {
                        compared += 1;
                        let lean = (q - foot.point).dot(&d.normalize()).abs();
                        assert!(lean < 1e-10, "{seed} {k} {off}: {lean:e}");
                    }
                }
            }
        }
    }
    assert!(compared > 10_000, "{compared}");
}

/// The grid gives what single lines give, on and off the part, for any number of threads.
#[test]
fn grids_agree_with_single_lines() {
    let wave = AnalyticShape::Wave { amplitude: 1.0, wavelength_x: 13.0, wavelength_y: None };
    let parts = [
        nurbs_part(samples::bicubic(&[1.0, 0.6, 2.0, 1.3, 0.8]), 0.05),
        dome(),
        graph_part(wave, [[-5.0, 12.0], [-4.0, 9.0]]),
    ];
    for part in &parts {
        let bounds = part.bounds();
        let cell = bounds.size().x / 37.3;
        let origin = Point2::new(bounds.min.x - 1.7 * cell, bounds.min.y - 2.3 * cell);
        let (nx, ny) = (43, (bounds.size().y / cell) as usize + 6);
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| part.sample_grid(origin, cell, nx, ny, &Silent).unwrap())
        };
        let grid = run(1);
        assert_eq!(grid, run(3));
        let mut on = 0;
        for j in 0..ny {
            for i in 0..nx {
                let (x, y) = (origin.x + i as f64 * cell, origin.y + j as f64 * cell);
                let sample = grid.at(i, j);
                match part.highest_at(x, y) {
                    Some(hit) => {
                        on += 1;
                        assert!(sample.is_on());
                        assert_relative_eq!(sample.z, hit.point.z, epsilon = 1e-11);
                        assert_relative_eq!(sample.normal, hit.normal, epsilon = 1e-8);
                    }
                    None => assert!(!sample.is_on()),
                }
            }
        }
        assert!(on > nx * ny / 2 && on < nx * ny, "{on}");
    }
}

#[test]
fn seams_between_patches_have_no_pinholes() {
    // Two graphs side by side, cut differently by their tessellations; rows and columns of cell
    // centres lie on the seam itself.
    let wave = |x0: f64, x1: f64| {
        let shape = AnalyticShape::Wave { amplitude: 1.0, wavelength_x: 11.0, wavelength_y: Some(7.0) };
        graph(shape, [[x0, x1], [0.0, 10.0]])
    };
    let part = Part::from_patches(vec![wave(0.0, 3.3), wave(3.3, 10.0)], 0.02).unwrap();
    let grid = part.sample_grid(Point2::new(0.3, 0.05), 0.1, 95, 100, &Silent).unwrap();
    assert!(grid.samples.iter().all(GridSample::is_on));
    let exact = |i: usize, j: usize| {
        let (x, y) = (0.3 + 0.1 * i as f64, 0.05 + 0.1 * j as f64);
        (std::f64::consts::TAU * x / 11.0).sin() * (std::f64::consts::TAU * y / 7.0).cos()
    };
    for j in 0..100 {
        for i in 0..95 {
            assert_relative_eq!(grid.at(i, j).z, exact(i, j), epsilon = 1e-13);
        }
    }
    assert_eq!(part.corner_parameters(0).unwrap()[0].patch, 0);
    assert_eq!(part.corner_parameters(part.mesh().triangles().len() - 1).unwrap()[0].patch, 1);
}

#[test]
fn a_mesh_is_a_part() {
    let vertices = vec![Point3::origin(), Point3::new(4.0, 0.0, 0.0), Point3::new(0.0, 4.0, 4.0)];
    let (mesh, _) = TriangleMesh::new(vertices, vec![[0, 1, 2]]).unwrap();
    let part = Part::from_mesh(mesh);
    assert!(part.patches().is_empty() && part.corner_parameters(0).is_none() && part.mesh_deviation() == 0.0);
    let hit = part.highest_at(1.0, 1.0).unwrap();
    assert_relative_eq!(hit.point, Point3::new(1.0, 1.0, 1.0), epsilon = 1e-15);
    assert!(hit.at.is_none());
    let n = Vector3::new(0.0, -1.0, 1.0).normalize();
    let (foot, distance) = part.closest_point(&(hit.point + n * 0.5));
    assert_relative_eq!(foot.point, hit.point, epsilon = 1e-14);
    assert_relative_eq!(distance, 0.5, epsilon = 1e-14);
    let grid = part.sample_grid(Point2::new(0.5, 0.5), 1.0, 4, 4, &Silent).unwrap();
    let on: Vec<bool> = grid.samples.iter().map(GridSample::is_on).collect();
    let (t, f) = (true, false);
    // Centres on the slanting edge count as on the part.
    assert_eq!(on, [t, t, t, t, t, t, t, f, t, t, f, f, t, f, f, f]);
    assert_relative_eq!(grid.at(1, 2).z, 2.5, epsilon = 1e-14);
    assert_relative_eq!(grid.at(1, 2).normal, n, epsilon = 1e-14);
}

#[test]
fn refuses_and_cancels() {
    assert_eq!(Part::from_patches(vec![], 0.1).unwrap_err(), PartError::NoPatches);
    let plane = || graph(AnalyticShape::Plane { height: 0.0 }, [[0.0, 1.0], [0.0, 1.0]]);
    let error = Part::from_patches(vec![plane(), plane()], f64::NAN).unwrap_err();
    assert!(matches!(error, PartError::Patch { patch: 0, .. }));
    struct Stop;
    impl Monitor for Stop {
        fn cancelled(&self) -> bool {
            true
        }
    }
    let part = Part::from_patches(vec![plane()], 0.1).unwrap();
    assert_eq!(part.sample_grid(Point2::new(0.0, 0.0), 0.1, 5, 5, &Stop), Err(Cancelled));
    assert!(part.sample_grid(Point2::new(0.0, 0.0), 0.1, 0, 5, &Stop).unwrap().samples.is_empty());
    // 5 µm for a 60 mm part, less for a 2 mm one.
    assert_eq!(default_tessellation_tolerance(&[Patch::Nurbs(samples::bicubic(&[1.0]))]), 0.005);
    assert_relative_eq!(default_tessellation_tolerance(&[plane()]), 1.4142e-4, epsilon = 1e-7);
}

/// Along a seam single lines meet the surface as on the whole one, whichever triangles they pass.
#[test]
fn heights_on_a_seam_are_those_of_the_whole_surface() {
    let [whole, halves] = whole_and_halves();
    let (seam, deviation) = (0.5, halves.mesh_deviation());
    for k in 1..400 {
        let at = PatchPoint { patch: 0, u: seam, v: f64::from(k) / 400.0 };
        let (place, _) = whole.point_and_normal(at);
        for aside in [-1.5, -1.0, -0.3, -1e-6, 0.0, 1e-6, 0.3, 1.0, 1.5] {
            let (x, y) = (place.x + aside * deviation, place.y);
            let [expected, hit] = [&whole, &halves].map(|part| part.highest_at(x, y).unwrap());
            assert_relative_eq!(hit.point, expected.point, epsilon = 1e-9);
            assert_relative_eq!(hit.normal, expected.normal, epsilon = 1e-7);
        }
    }
}

/// Patches of a file may end a little before each other: a line between them meets the part.
#[test]
fn narrow_gaps_between_patches_are_no_holes() {
    const GAP: f64 = 1e-4;
    let wave = |x0: f64, x1: f64| {
        let shape = AnalyticShape::Wave { amplitude: 1.0, wavelength_x: 11.0, wavelength_y: Some(7.0) };
        graph(shape, [[x0, x1], [0.0, 10.0]])
    };
    let part = Part::from_patches(vec![wave(0.0, 3.3), wave(3.3 + GAP, 10.0)], 0.02).unwrap();
    let grid = part.sample_grid(Point2::new(0.3 + 0.5 * GAP, 0.05), 0.1, 60, 99, &Silent).unwrap();
    for j in 0..grid.ny {
        let (x, y) = (3.3 + 0.5 * GAP, 0.05 + 0.1 * j as f64);
        let exact = (std::f64::consts::TAU * x / 11.0).sin() * (std::f64::consts::TAU * y / 7.0).cos();
        assert_relative_eq!(part.highest_at(x, y).unwrap().point.z, exact, epsilon = GAP);
        assert_relative_eq!(grid.at(30, j).z, exact, epsilon = GAP);
        // Beside one patch alone the part ends.
        assert!(part.highest_at(10.0 + GAP, y).is_none());
    }
}

/// Where two sheets end in one outline, a line beyond it passes both.
#[test]
fn beside_a_common_outline_the_part_ends() {
    let sheet = |amplitude: f64| {
        let shape = AnalyticShape::Wave { amplitude, wavelength_x: 11.0, wavelength_y: None };
        graph(shape, [[0.0, 3.3], [0.0, 10.0]])
    };
    let part = Part::from_patches(vec![sheet(1.0), sheet(0.5)], 0.02).unwrap();
    for aside in [1e-6, 1e-4, 0.5 * part.mesh_deviation()] {
        assert!(part.highest_at(3.3 + aside, 4.0).is_none());
    }
    assert!(part.highest_at(3.3, 4.0).is_some());
}

/// On a crease the surface is that of the patch over the place, on either side, for lines and grids.
#[test]
fn heights_beside_a_crease_are_those_of_the_patch_there() {
    // Two flanks that meet in one bent line. The one bends more, so that its triangles are smaller.
    let side = |sign: f64, bend: f64| {
        let control = |i: usize, j: usize| {
            let (out, t) = (i as f64, j as f64 / 3.0);
            let edge = Point3::new(1.3 * (3.0 * t).sin(), 20.0 * t, 2.0 * (2.0 * t).cos());
            edge + Vector3::new(sign * 3.0 * out, 0.0, -0.9 * out - bend * out * out * (5.0 * t).sin())
        };
        let net: Vec<Vec<Point3>> = (0..4).map(|i| (0..4).map(|j| control(i, j)).collect()).collect();
        let ends = || vec![0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0];
        NurbsSurface::new(3, 3, ends(), ends(), &net, None).unwrap()
    };
    let (left, right) = (side(-1.0, 0.02), side(1.0, 0.6));
    let patches = vec![Patch::Nurbs(left.clone()), Patch::Nurbs(right.clone())];
    let part = Part::from_patches(patches, 0.03).unwrap();
    let alone = [left, right].map(|surface| Part::from_patches(vec![Patch::Nurbs(surface)], 1e-4).unwrap());
    let deviation = part.mesh_deviation();
    let mut beside = 0;
    for k in 1..300 {
        let (place, _) = part.point_and_normal(PatchPoint { patch: 0, u: 0.0, v: f64::from(k) / 300.0 });
        for aside in [-1.8, -1.0, -0.4, -0.01, 0.01, 0.4, 1.0, 1.8] {
            let (x, y) = (place.x + aside * deviation, place.y);
            let hit = part.highest_at(x, y).unwrap();
            // Only the flank over the place has a point there.
            let own = &alone[usize::from(aside > 0.0)];
            let Some(expected) = own.highest_at(x, y) else { continue };
            beside += 1;
            assert_relative_eq!(hit.point, expected.point, epsilon = 1e-8);
            let grid = part.sample_grid(Point2::new(x, y), 1.0, 1, 1, &Silent).unwrap();
            if grid.at(0, 0).is_on() {
                assert_relative_eq!(grid.at(0, 0).z, expected.point.z, epsilon = 1e-8);
            }
        }
    }
    assert!(beside > 1500, "{beside}");
}
