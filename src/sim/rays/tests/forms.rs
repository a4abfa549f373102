//! Rays against closed forms.

use super::*;
use crate::scenes::random_path;
use crate::swept::tests::SweptMove;

/// What closed forms and rays may lie apart, mm.
const CLOSE: f64 = 1e-9;

fn ball(radius: f64) -> Cutter {
    Cutter::ball(2.0 * radius).unwrap()
}

fn lowest(rays: &Rays, p: [f64; 3], n: Vector3) -> f64 {
    rays.deviation(&Point3::from(p), &n, 20.0, 20.0).unwrap().s
}

/// Where a line enters a ball.
fn into_ball(p: &Point3, n: &Vector3, centre: &Point3, radius: f64) -> Option<f64> {
    let (along, away) = (n.dot(&(centre - p)), n.cross(&(centre - p)).norm());
    (away < radius).then(|| along - (radius - away).sqrt() * (radius + away).sqrt())
}

#[test]
fn a_ball_that_stands_still_is_a_sphere() {
    let mut rng = Rng::new(29);
    let mut hits = 0;
    for _ in 0..300 {
        let at = ClPoint { tip: within(&mut rng, 2.0), axis: axis(&mut rng, 1.0) };
        let rays = alone(&ball(3.0), &path_of(at, &[at]));
        let centre = at.tip + at.axis * 3.0;
        // From below, so that the cylinder above is not met first.
        let n = (at.axis + within(&mut rng, 0.4).coords).normalize();
        let p = centre + within(&mut rng, 2.0).coords - n * 6.0;
        let got = rays.deviation(&p, &n, 0.0, 20.0);
        let Some(expected) = into_ball(&p, &n, &centre, 3.0) else {
            continue;
        };
        if (p + n * expected - centre).dot(&at.axis) > 0.0 {
            continue;
        }
        hits += 1;
        let got = got.unwrap();
        assert!((got.s - expected).abs() < CLOSE, "{got:?} {expected}");
        let inward = (centre - (p + n * expected)).normalize();
        assert!((rays.cut_normal(&p, &n, &got).unwrap() - inward).norm() < 1e-6);
    }
    assert!(hits > 150, "{hits}");
}

#[test]
fn a_ball_on_a_line_is_a_capsule() {
    let mut rng = Rng::new(31);
    let mut hits = 0;
    for _ in 0..400 {
        let from = ClPoint { tip: within(&mut rng, 3.0), axis: axis(&mut rng, 0.5) };
        let to = ClPoint { tip: within(&mut rng, 3.0), ..from };
        let rays = alone(&ball(2.0), &path_of(from, &[to]));
        let (a, way) = (from.tip + from.axis * 2.0, to.tip - from.tip);
        let n = (from.axis + within(&mut rng, 0.3).coords).normalize();
        let p = a + way * rng.within(0.0, 1.0) + within(&mut rng, 1.0).coords - n * 8.0;
        // The infinite cylinder around the line, between its ends; else one of the balls.
        let length = way.norm();
        let along = way / length;
        let (flat_n, flat_p) = (n - along * n.dot(&along), (p - a) - along * (p - a).dot(&along));
        let (qa, qb, qc) = (flat_n.dot(&flat_n), flat_n.dot(&flat_p), flat_p.dot(&flat_p) - 4.0);
        let root = qb * qb - qa * qc;
        let side = (root > 0.0).then(|| (-qb - root.sqrt()) / qa).filter(|s| {
            let place = (p + n * *s - a).dot(&along);
            place > 0.0 && place < length
        });
        let ends = [a, a + way].map(|c| into_ball(&p, &n, &c, 2.0));
        let expected = [side, ends[0], ends[1]].into_iter().flatten().fold(f64::INFINITY, f64::min);
        // Only what the lower half of the ball meets.
        let t = ((p + n * expected - a).dot(&along) / length).clamp(0.0, 1.0);
        if expected == f64::INFINITY || (p + n * expected - a - way * t).dot(&from.axis) > -0.1 {
            continue;
        }
        hits += 1;
        let got = rays.deviation(&p, &n, 0.0, 20.0).unwrap();
        assert!((got.s - expected).abs() < CLOSE, "{got:?} {expected}");
        assert!((got.t - t).abs() < 1e-3 || length < 0.1, "{got:?} {t}");
    }
    assert!(hits > 150, "{hits}");
}

#[test]
fn the_side_of_a_plunge_is_a_cylinder_and_its_end_a_plane() {
    let at = |z: f64| ClPoint::upright(Point3::new(0.0, 0.0, z));
    for cutter in [Cutter::flat(6.0).unwrap(), Cutter::bull(6.0, 1.0).unwrap(), ball(3.0)] {
        let rays = alone(&cutter, &path_of(at(5.0), &[at(-1.0)]));
        for y in [-2.9, -1.0, 0.0, 2.0, 2.999] {
            let got = lowest(&rays, [0.0, y, 4.0], Vector3::x());
            assert!((got + (9.0 - y * y).sqrt()).abs() < CLOSE, "{y} {got}");
            let rho = 0.5 * y;
            let got = lowest(&rays, [rho, 0.0, 0.0], Vector3::z());
            assert!((got - (cutter.height(rho.abs()).unwrap() - 1.0)).abs() < CLOSE, "{y} {got}");
        }
        assert_eq!(rays.deviation(&Point3::new(0.0, 3.1, 4.0), &Vector3::x(), 9.0, 9.0), None);
    }
}

/// The track of a disc that leads by λ is an ellipse across the feed, of half axes R and R sin λ; with a
/// rounded corner the ellipse of the corner's middle, grown by r.
#[test]
fn a_tilted_flat_end_leaves_an_ellipse() {
    for degrees in [0.5f64, 5.0, 30.0, 60.0] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let axis = Vector3::new(sin, 0.0, cos);
        let at = |x: f64| ClPoint { tip: Point3::new(x, 0.0, 0.25), axis };
        let path = path_of(at(-9.0), &[-3.3, 2.0, 2.1, 9.0].map(at));
        let flat = alone(&Cutter::flat(6.0).unwrap(), &path);
        let bull = alone(&Cutter::bull(6.0, 1.0).unwrap(), &path);
        for k in -9..=9 {
            let y = 0.31 * f64::from(k);
            let expected = 0.25 - sin * (9.0 - y * y).sqrt();
            for n in [Vector3::z(), Vector3::new(0.02, 0.0, 1.0).normalize()] {
                let p = Point3::new(0.7, y, 0.0);
                let hit = flat.deviation(&p, &n, 20.0, 20.0).unwrap();
                assert!((hit.s * n.z - expected).abs() < CLOSE, "{degrees} {y}: {hit:?} {expected}");
                // An edge cuts: the normal is that of the ellipse.
                let up = Vector3::new(0.0, -sin * y / (9.0 - y * y).sqrt(), 1.0).normalize();
                let got = flat.cut_normal(&p, &n, &hit).unwrap();
                assert!((got - up).norm() < 3e-5, "{degrees} {y}: {got:?} {up:?}");
            }
            // The corner's middle: half axes 2 and 2 sin λ, cos λ above the tip; its normal at angle φ
            // leads to the surface.
            let (sin_phi, cos_phi) = (0.16 * f64::from(k)).sin_cos();
            let across = Vector3::new(0.0, sin * sin_phi, -cos_phi).normalize();
            let foot = Vector3::new(0.0, 2.0 * sin_phi, 0.25 + cos - 2.0 * sin * cos_phi) + across;
            let got = lowest(&bull, [0.4, foot.y, foot.z], Vector3::z());
            assert!(got.abs() < CLOSE, "{degrees} {k}: {got}");
        }
    }
}

/// A straight track of the ball's middle while the axis turns; tips run along chords, which moves the
/// middle by r θ²/8.
#[test]
fn a_ball_cuts_the_same_however_its_axis_turns() {
    const TURN: f64 = 1e-4;
    let centre = |k: usize| Point3::new(0.01 * k as f64, 0.0, 3.0);
    let leaning = |k: usize| {
        let lean = 0.3 + TURN * k as f64;
        Vector3::new(lean.sin() * 0.6, lean.sin() * 0.8, lean.cos())
    };
    let turning: Vec<ClPoint> =
        (0..=1000).map(|k| ClPoint { tip: centre(k) - leaning(k) * 3.0, axis: leaning(k) }).collect();
    let upright = [0, 1000].map(|k| ClPoint::upright(centre(k) - Vector3::z() * 3.0));
    let turning = alone(&ball(3.0), &path_of(turning[0], &turning[1..]));
    let upright = alone(&ball(3.0), &path_of(upright[0], &upright[1..]));
    for k in 0..200 {
        let p = [0.05 * f64::from(k), -1.0 + 0.01 * f64::from(k), -0.2];
        let n = Vector3::new(0.1, 0.05, 1.0).normalize();
        let (a, b) = (lowest(&turning, p, n), lowest(&upright, p, n));
        assert!((a - b).abs() < 2.0 * 3.0 * TURN * TURN / 8.0 + CLOSE, "{p:?} {a} {b}");
    }
}

#[test]
fn a_leading_ball_touches_the_plane_and_a_wrong_formula_gouges_it() {
    let (radius, lead) = (5.0, 15f64.to_radians());
    let axis = Vector3::new(lead.sin(), 0.0, lead.cos());
    let path = |tip: &dyn Fn(Point3) -> Point3| {
        let at = |k: usize| {
            let (along, row) = (k % 41, k / 41);
            let x = 0.5 * (if row % 2 == 0 { along } else { 40 - along }) as f64;
            ClPoint { tip: tip(Point3::new(x, 0.4 * row as f64, 0.0)), axis }
        };
        let to: Vec<ClPoint> = (0..41 * 20).map(at).collect();
        path_of(to[0], &to[1..])
    };
    let right = alone(&ball(radius), &path(&|p| p + Vector3::z() * radius - axis * radius));
    // As if the tip were at the contact, whatever the lead.
    let wrong = alone(&ball(radius), &path(&|p| p));
    let gouge = radius * (1.0 - lead.cos());
    assert!((gouge - 0.170).abs() < 5e-4);
    let (mut least, mut most) = ([f64::INFINITY; 2], f64::NEG_INFINITY);
    for k in 0..2000 {
        let p = [2.0 + 0.008 * f64::from(k), 2.0 + 0.0017 * f64::from(k), 0.0];
        let found = [&right, &wrong].map(|rays| lowest(rays, p, Vector3::z()));
        least = [0, 1].map(|i| least[i].min(found[i]));
        most = most.max(found[0]);
    }
    assert!(least[0] > -CLOSE && least[0] < 1e-7, "{least:?}");
    let scallop = radius - (radius * radius - 0.04).sqrt();
    assert!(most < scallop + CLOSE && most > scallop - 1e-4, "{most} {scallop}");
    assert!((least[1] + gouge).abs() < 1e-7, "{least:?} {gouge}");
}

#[test]
fn upright_paths_are_cut_as_deep_as_the_swept_moves_say() {
    let mut rng = Rng::new(37);
    let (mut seen, mut far) = (0, 0);
    for cutter in cutters() {
        let path = random_path(&mut rng, 60, 8.0);
        let rays = alone(&cutter, &path);
        let moves: Vec<SweptMove> = path.segments().map(|(a, b, _)| SweptMove::new(&cutter, a, b)).collect();
        for _ in 0..400 {
            let (x, y) = (rng.within(-3.0, 11.0), rng.within(-3.0, 11.0));
            let height = moves.iter().filter_map(|m| m.height(x, y)).fold(f64::INFINITY, f64::min);
            let got = rays.deviation(&Point3::new(x, y, 0.0), &Vector3::z(), 20.0, 20.0);
            let Some(hit) = got else {
                assert_eq!(height, f64::INFINITY, "{cutter:?} {x} {y}");
                continue;
            };
            let off = (hit.s - height).abs();
            seen += 1;
            far += usize::from(off > CLOSE);
            // Where the ray grazes a wall, rounding of the place moves the height by far more.
            assert!(off < 1e-6, "{cutter:?} {x} {y}: {hit:?} {height}");
        }
    }
    assert!(seen > 4000 && far < seen / 500, "{far} of {seen}");
}
