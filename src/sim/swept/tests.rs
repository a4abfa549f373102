//! The sweep against brute force: many places along the move, refined by golden section, with the
//! profile as the cutter gives it.

use super::*;
use crate::scenes::{Rng, cutters, random_path};
use approx::assert_abs_diff_eq;
use cutter::Cutter;
use geometry::Point3;

/// The volume that a cutter sweeps along one straight move.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SweptMove {
    form: Form,
    track: Track,
}

impl SweptMove {
    pub fn new(cutter: &Cutter, from: Point3, to: Point3) -> Self {
        Self { form: Form::new(cutter), track: Track::new(from, to) }
    }

    pub fn height(&self, x: f64, y: f64) -> Option<f64> {
        let height = swept_height(&self.form, &self.track, x, y);
        (height < f64::INFINITY).then_some(height)
    }

    pub fn height_and_normal(&self, x: f64, y: f64) -> Option<(f64, Vector3)> {
        swept_height_and_normal(&self.form, &self.track, x, y)
    }
}

/// Least of `f` over `low..high`, `f` convex (infinite outside of an interval that `inside`
/// belongs to): golden section.
fn least(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    const RATIO: f64 = 0.618_033_988_749_894_9;
    let (mut a, mut b) = (high - RATIO * (high - low), low + RATIO * (high - low));
    let (mut fa, mut fb) = (f(a), f(b));
    let mut best = f(low).min(f(high));
    for _ in 0..90 {
        best = best.min(fa).min(fb);
        if fa < fb {
            (high, b, fb) = (b, a, fa);
            a = high - RATIO * (high - low);
            fa = f(a);
        } else {
            (low, a, fa) = (a, b, fb);
            b = low + RATIO * (high - low);
            fb = f(b);
        }
    }
    best
}

/// The height by definition: the part of t in reach (a quadratic), then golden section over it.
pub(crate) fn brute_height(cutter: &Cutter, from: Point3, to: Point3, x: f64, y: f64) -> Option<f64> {
    let (d, p) = (to - from, Point3::new(x, y, 0.0) - from);
    let (dd, pd) = (d.x * d.x + d.y * d.y, p.x * d.x + p.y * d.y);
    let across = if dd > 0.0 { (p.x * d.y - p.y * d.x).powi(2) / dd } else { p.x * p.x + p.y * p.y };
    let reach = cutter.radius().powi(2) - across;
    if reach < 0.0 {
        return None;
    }
    let (mut low, mut high) = (0.0, 1.0);
    if dd > 0.0 {
        let half = (reach / dd).sqrt();
        (low, high) = ((pd / dd - half).max(0.0), (pd / dd + half).min(1.0));
    }
    let height = |t: f64| {
        let rho = (p.x - t * d.x).hypot(p.y - t * d.y).min(cutter.radius());
        from.z + t * d.z + cutter.height(rho).unwrap()
    };
    (low <= high).then(|| least(height, low, high))
}

/// How far a height may be off when distances are only known to a few units of the last place.
fn rim_allowance(cutter: &Cutter, normal: &Vector3) -> f64 {
    let rounding = 3e-15 * cutter.radius();
    // On the arc the profile is a parabola lying on its side at the rim.
    (rounding / normal.z.max(1e-12)).min((2.0 * cutter.corner_radius().max(1e-9) * rounding).sqrt())
}

#[test]
fn heights_agree_with_brute_force() {
    let mut rng = Rng::new(1);
    let mut compared = 0;
    for cutter in cutters() {
        let path = random_path(&mut rng, 1500, 8.0);
        for (from, to, _) in path.segments() {
            let swept = SweptMove::new(&cutter, from, to);
            for _ in 0..4 {
                let along = rng.within(-0.2, 1.2);
                let near = from + along * (to - from);
                let (x, y) = (near.x + rng.within(-3.2, 3.2), near.y + rng.within(-3.2, 3.2));
                let expected = brute_height(&cutter, from, to, x, y);
                let got = swept.height_and_normal(x, y);
                assert_eq!(got.map(|g| g.0), swept.height(x, y));
                let (Some((height, normal)), Some(expected)) = (got, expected) else {
                    assert_eq!(got.is_some(), expected.is_some(), "{cutter:?} {from} {to} at {x} {y}");
                    continue;
                };
                compared += 1;
                let allowed = 1e-9 + rim_allowance(&cutter, &normal);
                let steep = (to.z - from.z).abs() / (to - from).xy().norm();
                // A ramp ten thousand times higher than long moves its cut by 1e-15·slope.
                let allowed = allowed + if steep.is_finite() { 2e-15 * steep } else { 0.0 };
                assert!(
                    (height - expected).abs() <= allowed,
                    "{cutter:?} {from} {to} at {x} {y}: {height} {expected}, {:e}",
                    height - expected
                );
            }
        }
    }
    assert!(compared > 15_000, "{compared}");
}

/// Differences of heights close by give the normal, unless a crease lies between.
#[test]
fn normals_are_those_of_the_heights() {
    const STEP: f64 = 1e-5;
    let mut rng = Rng::new(2);
    for cutter in cutters() {
        let path = random_path(&mut rng, 600, 8.0);
        let (mut compared, mut differ) = (0, 0);
        for (from, to, _) in path.segments() {
            let swept = SweptMove::new(&cutter, from, to);
            let (x, y) = (from.x + rng.within(-3.0, 3.0), from.y + rng.within(-3.0, 3.0));
            let Some((_, normal)) = swept.height_and_normal(x, y) else { continue };
            assert_abs_diff_eq!(normal.norm(), 1.0, epsilon = 1e-14);
            assert!(normal.z >= 0.0);
            let difference = |dx: f64, dy: f64| {
                Some((swept.height(x + dx, y + dy)? - swept.height(x - dx, y - dy)?) / (2.0 * STEP))
            };
            let (Some(gx), Some(gy)) = (difference(STEP, 0.0), difference(0.0, STEP)) else { continue };
            if normal.z < 0.05 {
                continue;
            }
            compared += 1;
            let numeric = Vector3::new(-gx, -gy, 1.0).normalize();
            differ += usize::from((numeric - normal).norm() > 1e-4);
        }
        assert!(compared > 200 && differ * 100 <= compared, "{cutter:?}: {differ} of {compared} differ");
    }
}

#[test]
fn the_normal_of_a_ball_points_to_its_centre() {
    let mut rng = Rng::new(3);
    let cutter = Cutter::ball(6.0).unwrap();
    for (from, to, _) in random_path(&mut rng, 400, 8.0).segments() {
        let swept = SweptMove::new(&cutter, from, to);
        let (x, y) = (from.x + rng.within(-3.0, 3.0), from.y + rng.within(-3.0, 3.0));
        let Some((height, normal)) = swept.height_and_normal(x, y) else { continue };
        let centre = Point3::new(x, y, height) + 3.0 * normal - Vector3::new(0.0, 0.0, 3.0);
        let d = to - from;
        let t = if d.norm() > 0.0 { (centre - from).dot(&d) / d.norm_squared() } else { 0.0 };
        let on_track = from + t.clamp(0.0, 1.0) * d;
        assert!((centre - on_track).norm() < 1e-7, "{from} {to} {x} {y}: {centre} is off the track");
    }
}

#[test]
fn closed_forms() {
    let ball = Cutter::ball(6.0).unwrap();
    let origin = Point3::origin();
    // Level groove: a cylinder, ended by spheres.
    let level = SweptMove::new(&ball, origin, Point3::new(10.0, 0.0, 0.0));
    assert_abs_diff_eq!(level.height(5.0, 1.0).unwrap(), 3.0 - 8f64.sqrt(), epsilon = 1e-15);
    assert_abs_diff_eq!(level.height(-1.0, 1.0).unwrap(), 3.0 - 7f64.sqrt(), epsilon = 1e-15);
    assert_eq!(level.height(5.0, 3.0), Some(3.0));
    assert_eq!(level.height(5.0, 3.0000001), None);
    assert_eq!(level.height(13.1, 0.0), None);
    // A ramp of 45 degrees: the cylinder's lowest line lies r·(√2 − 1) below the tip's path.
    let ramp = SweptMove::new(&ball, origin, Point3::new(10.0, 0.0, 10.0));
    assert_abs_diff_eq!(ramp.height(5.0, 0.0).unwrap(), 5.0 - 3.0 * (2f64.sqrt() - 1.0), epsilon = 1e-14);
    let (_, normal) = ramp.height_and_normal(5.0, 0.0).unwrap();
    assert_abs_diff_eq!(normal, Vector3::new(-1.0, 0.0, 1.0).normalize(), epsilon = 1e-14);
    // A plunge is a sphere at its lower end.
    let plunge = SweptMove::new(&ball, Point3::new(0.0, 0.0, 5.0), origin);
    assert_abs_diff_eq!(plunge.height(1.0, 1.0).unwrap(), 3.0 - 7f64.sqrt(), epsilon = 1e-15);
    // A flat end that climbs cuts with its rear rim.
    let flat = Cutter::flat(6.0).unwrap();
    let climb = SweptMove::new(&flat, origin, Point3::new(10.0, 0.0, 5.0));
    assert_eq!(climb.height(2.0, 0.0), Some(0.0));
    assert_eq!(climb.height(5.0, 0.0), Some(1.0));
    assert_eq!(climb.height(13.0, 0.0), Some(5.0));
    let (_, normal) = climb.height_and_normal(5.0, 0.0).unwrap();
    assert_abs_diff_eq!(normal, Vector3::new(-0.5, 0.0, 1.0).normalize(), epsilon = 1e-15);
    // A bull nose on a 45 degree ramp touches on its arc: e + c·sin 45° behind the axis.
    let bull = Cutter::bull(6.0, 1.0).unwrap();
    let climb = SweptMove::new(&bull, origin, Point3::new(10.0, 0.0, 10.0));
    let expected = 7.0 - (2.0 + 0.5f64.sqrt()) + 1.0 - 0.5f64.sqrt();
    assert_abs_diff_eq!(climb.height(7.0, 0.0).unwrap(), expected, epsilon = 1e-14);
}

/// A sloping move whose foot passes over its end: cylinder and sphere meet without a step.
#[test]
fn ends_are_continuous() {
    for cutter in cutters() {
        let swept = SweptMove::new(&cutter, Point3::origin(), Point3::new(1.0, 0.5, 0.4));
        let mut last: Option<(f64, Vector3)> = None;
        for k in 0..40_000 {
            let x = -3.5 + 2e-4 * f64::from(k);
            let now = swept.height_and_normal(x, 0.3);
            if let (Some((before, _)), Some((height, normal))) = (last, now)
                && normal.z > 0.2
            {
                assert!((height - before).abs() < 2e-4 * 6.0, "{cutter:?} jumps at {x}");
            }
            last = now;
        }
    }
}

#[test]
fn nan_is_nowhere() {
    for cutter in cutters() {
        let ramp = SweptMove::new(&cutter, Point3::origin(), Point3::new(1.0, 0.5, 0.4));
        let lost = SweptMove::new(&cutter, Point3::origin(), Point3::new(f64::NAN, 0.5, 0.4));
        for (swept, x) in [(ramp, f64::NAN), (ramp, f64::INFINITY), (lost, 0.1)] {
            let got = swept.height_and_normal(x, 0.1);
            assert!(got.is_none_or(|(h, n)| h.is_finite() && n.norm() > 0.5), "{cutter:?} {got:?}");
            assert_eq!(swept.height(x, 0.1), got.map(|g| g.0));
        }
    }
}
