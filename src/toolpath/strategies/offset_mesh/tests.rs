use super::*;
use crate::vocabulary::Pace;
use geometry::TriangleMesh;
use std::f64::consts::FRAC_PI_2;
use work::monitor::Silent;

const RADIUS: f64 = 3.0;
const TARGET: f64 = 0.02;

const SETTINGS: PassSettings = PassSettings::upright(Step::Scallop(TARGET), 0.5);

/// Points are put half way to where chords of 1 µm cut short.
const SHORT: f64 = 5e-4;

fn planned(part: &Part, angle: f64) -> Passes {
    passes(&task(part, &Cutter::ball(2.0 * RADIUS).unwrap()), angle).unwrap()
}

fn task<'a>(part: &'a Part, cutter: &'a Cutter) -> Task<'a> {
    Task {
        part,
        cutter,
        settings: SETTINGS,
        wants_mesh: false,
        pace: Pace { duration: &|passes, _| Ok(passes.length()), link: 1.0, bend: 0.1 },
        monitor: &Silent,
    }
}

/// A mesh over a grid of the plan view.
fn ground(xs: &[f64], ys: &[f64], z: impl Fn(f64, f64) -> f64) -> Part {
    let points =
        ys.iter().flat_map(|&y| xs.iter().map(move |&x| (x, y))).map(|(x, y)| Point3::new(x, y, z(x, y)));
    let n = xs.len() as u32;
    let square = |k: u32| {
        let at = k / (n - 1) * n + k % (n - 1);
        [[at, at + 1, at + n + 1], [at, at + n + 1, at + n]]
    };
    let triangles = (0..(n - 1) * (ys.len() as u32 - 1)).flat_map(square).collect();
    Part::from_mesh(TriangleMesh::new(points.collect(), triangles).unwrap().0)
}

fn centres(pass: &[Point3]) -> impl Iterator<Item = Point3> + '_ {
    pass.iter().map(|tip| tip + Vector3::z() * RADIUS)
}

#[test]
fn a_groove_has_a_pass_along_its_crease_and_passes_one_interval_apart_beside() {
    // Two planes at 30 degrees, 12 mm long.
    let slope = 30_f64.to_radians();
    let part = ground(&[-9.0, 0.0, 9.0], &[0.0, 12.0], |x, _| x.abs() * slope.tan());
    let found = planned(&part, FRAC_PI_2);
    // In the crease the ball touches both sides.
    let middle = RADIUS / slope.cos();
    // Beyond the ends of the part the ball rolls down.
    let inside = |c: &Point3| (0.0..=12.0).contains(&c.y);
    let in_crease = |pass: &&Vec<Point3>| {
        centres(pass).all(|c| c.x.abs() < 1e-6 && (!inside(&c) || (c.z - middle).abs() < SHORT))
    };
    let creases: Vec<&Vec<Point3>> = found.passes.iter().filter(in_crease).collect();
    assert_eq!(creases.len(), 1, "{:?}", found.notes);
    let ys = creases[0].iter().map(|p| p.y);
    let range = [ys.clone().fold(f64::INFINITY, f64::min), ys.fold(f64::NEG_INFINITY, f64::max)];
    assert!(range[0] < 0.05 && range[1] > 11.95, "{range:?}");
    // On a plane the interval is 2 √(2rh − h²).
    let flat = 2.0 * (2.0 * RADIUS * TARGET - TARGET * TARGET).sqrt();
    let side = Vector3::new(slope.cos(), 0.0, slope.sin());
    let crease = side.dot(&Vector3::new(0.0, 0.0, middle));
    let mut offsets = vec![crease];
    for pass in &found.passes {
        for c in centres(pass) {
            let distance = part.closest_point(&c).1;
            assert!((distance - RADIUS).abs() < SHORT, "{distance} at {c}");
        }
        // Beyond the ends of the part the ball rolls about an axis along the side, so that any of its places
        // will do.
        offsets.extend(
            pass.first()
                .map(|tip| tip + Vector3::z() * RADIUS)
                .filter(|c| c.x > 1e-3)
                .map(|c| side.dot(&c.coords)),
        );
    }
    offsets.sort_by(f64::total_cmp);
    let gaps: Vec<f64> = offsets.windows(2).map(|w| w[1] - w[0]).collect();
    let (widest, mean) =
        (gaps.iter().copied().fold(0.0, f64::max), gaps.iter().sum::<f64>() / gaps.len() as f64);
    assert!(widest <= 1.01 * flat && mean > 0.75 * flat, "{widest} {mean} of {flat}: {gaps:?}");
    // From the crease to the far border of this side.
    assert!(offsets[offsets.len() - 1] > 9.0 / slope.cos() - 0.5 * flat);
}

#[test]
fn over_a_cap_the_centre_runs_on_the_larger_sphere() {
    let rho = 20.0;
    let line: Vec<f64> = (0..=48).map(|k| -6.0 + 0.25 * f64::from(k)).collect();
    let part = ground(&line, &line, |x, y| (rho * rho - x * x - y * y).sqrt() - rho);
    let found = planned(&part, 0.3);
    // Facets of 0.25 √2 mm stay this far below the sphere.
    let sagitta = 0.25 * 0.25 / (4.0 * rho);
    let allowed = -1.5 * sagitta - SHORT..=SHORT;
    let mut levels = Vec::new();
    for pass in &found.passes {
        for c in centres(pass) {
            let off = (c - Point3::new(0.0, 0.0, -rho)).norm() - (rho + RADIUS);
            // Beyond the border a ball that rolls over it lies lower.
            let inside = c.x.abs().max(c.y.abs()) < 6.0;
            assert!(!inside || allowed.contains(&off), "{off:e} at {c}");
        }
        // Signed angle across the feed at the middle of the cap.
        let across = Vector3::new(-0.3_f64.sin(), 0.3_f64.cos(), 0.0);
        let along = Vector3::new(0.3_f64.cos(), 0.3_f64.sin(), 0.0);
        let near =
            centres(pass).min_by(|a, b| a.coords.dot(&along).abs().total_cmp(&b.coords.dot(&along).abs()));
        let Some(c) = near.filter(|c| c.coords.dot(&along).abs() < 0.5) else { continue };
        levels.push((c.coords.dot(&across) / (c.z + rho)).atan());
    }
    levels.sort_by(f64::total_cmp);
    // Two balls whose centres stand the angle θ apart on the larger sphere meet at this height over the cap.
    let ridge = |theta: f64| {
        let half = 0.5 * theta;
        (rho + RADIUS) * half.cos() - (RADIUS.powi(2) - ((rho + RADIUS) * half.sin()).powi(2)).sqrt() - rho
    };
    let heights: Vec<f64> = levels.windows(2).map(|w| ridge(w[1] - w[0])).collect();
    assert!(heights.len() > 10);
    let highest = heights.iter().copied().fold(0.0, f64::max);
    assert!(highest <= 1.05 * TARGET, "{heights:?}");
    assert!(heights.iter().sum::<f64>() / heights.len() as f64 > 0.7 * TARGET, "{heights:?}");
}

#[test]
fn other_cutters_and_no_place_for_the_ball_are_refused() {
    let part = ground(&[0.0, 4.0], &[0.0, 4.0], |_, _| 0.0);
    let refused = passes(&task(&part, &Cutter::flat(6.0).unwrap()), 0.0).unwrap_err();
    assert!(refused.to_string().contains("use a ball"), "{refused}");
}
