use super::super::flat_scene::{path, plane};
use super::*;
use crate::{RaysCut, SweptVolume};
use cutter::{Cutter, Solid};
use geometry::{Aabb, samples};
use part::Patch;
use sim::Rays;
use work::monitor::Silent;

const RADIUS: f64 = 3.0;

fn of(part: &Part, path: &Toolpath, interval: f64) -> RoughnessFigures {
    let ball = Cutter::ball(2.0 * RADIUS).unwrap();
    let solid = Solid::of_cutter(&ball, None);
    let rays = Rays::new(path, &solid, &Silent).unwrap();
    let by_rays = RaysCut { rays: &rays, path, solid: &solid };
    let cut = SweptVolume {
        part,
        cut: &by_rays,
        inward: 1.0,
        outward: 1.0,
        shallow: f64::INFINITY,
        block: Aabb { min: Point3::new(-1e3, -1e3, -1e3), max: Point3::new(1e3, 1e3, 1e3) },
    };
    roughness(part, ball, path, &cut, interval, &Silent).unwrap()
}

/// Passes along x, `step` apart, every second one `lower` than the others.
fn straight(step: f64, count: usize, lower: f64) -> Toolpath {
    let pass = |k: usize| {
        let z = if k.is_multiple_of(2) { 0.0 } else { -lower };
        [-4.0, 20.0].map(|x| Point3::new(x, step * k as f64, z)).to_vec()
    };
    path(&(0..count).map(pass).collect::<Vec<_>>())
}

/// Ra and Rz of a circle of the ball's radius between passes `step` apart, by ten thousand samples.
fn circle(step: f64) -> [f64; 2] {
    const N: usize = 10_000;
    let z = |k: usize| {
        let x = 0.5 * step * (k as f64 + 0.5) / N as f64;
        RADIUS - (RADIUS * RADIUS - x * x).sqrt()
    };
    let mean = (0..N).map(z).sum::<f64>() / N as f64;
    let distance = (0..N).map(|k| (z(k) - mean).abs()).sum::<f64>() / N as f64;
    [distance, RADIUS - (RADIUS * RADIUS - 0.25 * step * step).sqrt()]
}

#[test]
fn a_plane_has_the_roughness_of_the_circle_and_nearly_of_the_parabola() {
    for step in [0.3, 0.5] {
        let figures = of(&plane([12.0; 2]), &straight(step, 45, 0.0), 1.3 * step);
        let [ra, rz] = circle(step);
        assert!((figures.ra_mm.unwrap() - ra).abs() <= figures.error_bound_mm.unwrap(), "{figures:?} {ra}");
        assert!((figures.rz_mm.unwrap() - rz).abs() <= figures.error_bound_mm.unwrap(), "{figures:?} {rz}");
        assert!(figures.error_bound_mm.unwrap() < 1e-3 * rz, "{figures:?}");
        assert!(figures.max_error_bound_mm >= figures.error_bound_mm, "{figures:?}");
        assert!((ra / (4.0 * rz / (9.0 * 3f64.sqrt())) - 1.0).abs() < 0.01);
        assert!(figures.profiles > 15, "{figures:?}");
        let intervals = figures.intervals_per_sampling_length;
        assert!(intervals[0] >= 1 && intervals[1] == MOST_INTERVALS, "{intervals:?}");
        assert!((figures.ra_max_mm.unwrap() - ra).abs() < 1e-5 && figures.reason.is_none());
    }
}

/// Three intervals of a sampling length hold high and low valleys.
#[test]
fn passes_of_uneven_height_are_in_the_figures() {
    let (step, lower) = (0.5f64, 0.004);
    let figures = of(&plane([16.0; 2]), &straight(step, 40, lower), step);
    // Between a pass and a lower one the ridge stands nearer to the higher.
    let aside = lower * RADIUS / step;
    let ridge = RADIUS - (RADIUS * RADIUS - (0.5 * step - aside).powi(2)).sqrt();
    assert!((figures.rz_mm.unwrap() - (ridge + lower)).abs() < 2e-5, "{figures:?} {}", ridge + lower);
}

#[test]
fn across_rings_of_a_dome_it_is_that_of_the_circular_section() {
    let (rho, step) = (10.0, 0.05f64);
    let part =
        Part::from_patches(vec![Patch::Nurbs(samples::hemisphere(Point3::origin(), rho))], 0.01).unwrap();
    let ring = |k: usize| {
        let polar = 0.5 * step + step * k as f64;
        let at = |n: usize| {
            let turn = std::f64::consts::TAU * n as f64 / 720.0;
            let normal = Vector3::new(polar.sin() * turn.cos(), polar.sin() * turn.sin(), polar.cos());
            Point3::origin() + normal * (rho + RADIUS) - Vector3::z() * RADIUS
        };
        (0..=720).map(at).collect::<Vec<_>>()
    };
    let figures = of(&part, &path(&(0..31).map(ring).collect::<Vec<_>>()), step * rho);
    let exact = scallop::ball_scallop_height(RADIUS, -1.0 / rho, step * rho).unwrap();
    // 720 chords a turn lie up to 0.13 µm inside.
    assert!((figures.rz_mm.unwrap() - exact).abs() < 2e-4, "{figures:?} {exact}");
    assert!((figures.ra_mm.unwrap() / (4.0 * exact / (9.0 * 3f64.sqrt())) - 1.0).abs() < 0.02, "{figures:?}");
}

#[test]
fn without_five_intervals_there_is_a_reason() {
    let figures = of(&plane([1.2; 2]), &straight(0.5, 10, 0.0), 0.5);
    assert!(figures.ra_mm.is_none() && figures.reason.unwrap().contains("five path intervals"));
    let none = of(&plane([1.2; 2]), &straight(0.5, 10, 0.0), f64::NAN);
    assert!(none.reason.is_some() && none.profiles == 0);
}
