//! The signed distance against brute force over the outline, and what any distance must keep.

use super::*;
use crate::{AptWords, HolderSection};

fn cutters() -> Vec<Cutter> {
    let taper = |corner: f64| Cutter::taper(2.0, corner, 10f64.to_radians(), 5.0).unwrap();
    let named = [Cutter::ball(6.0), Cutter::flat(6.0), Cutter::bull(6.0, 1.0)].map(Result::unwrap);
    let apt = AptWords::examples().into_iter().map(|words| Cutter::apt(&words).unwrap());
    named.into_iter().chain([taper(1.0), taper(0.3), taper(0.0)]).chain(apt).collect()
}

fn holder(cutting_length: f64) -> Holder {
    let section = |diameter, top_diameter, length| HolderSection { diameter, top_diameter, length };
    Holder::new(
        cutting_length,
        vec![
            section(4.0, 4.0, 3.0),
            section(9.0, 6.0, 2.0),
            section(6.0, 12.0, 4.0),
            section(12.0, 12.0, 1.0),
        ],
    )
    .unwrap()
}

/// Places all along the surface and whether a place is inside, by profile and sections themselves.
fn radius_at(cutter: Option<&Cutter>, holder: Option<&Holder>, length: f64, z: f64) -> Option<f64> {
    if z >= length {
        let mut at = length;
        for s in holder?.sections() {
            if z < at + s.length {
                return Some(0.5 * (s.diameter + (s.top_diameter - s.diameter) * (z - at) / s.length));
            }
            at += s.length;
        }
        return None;
    }
    let cutter = cutter?;
    if z < 0.0 {
        return None;
    }
    // The widest place that the profile has reached at this height.
    let (mut low, mut high) = (0.0, cutter.radius());
    if cutter.height(high)? <= z {
        return Some(high);
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        *(if cutter.height(middle)? <= z { &mut low } else { &mut high }) = middle;
    }
    Some(low)
}

fn surface(cutter: Option<&Cutter>, holder: Option<&Holder>, length: f64, step: f64) -> Vec<RhoZ> {
    let mut places = Vec::new();
    let steps = |places: &mut Vec<RhoZ>, a: RhoZ, b: RhoZ| {
        let n = ((b[0] - a[0]).hypot(b[1] - a[1]) / step).ceil() as i32;
        places.extend((0..=n).map(|k| {
            let t = f64::from(k) / f64::from(n.max(1));
            [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]
        }));
    };
    let mut last = [0.0, length];
    if let Some(cutter) = cutter {
        let profile = cutter.profile();
        // Closer together toward the rim, where profiles rise steeply.
        let n = (12.0 * cutter.radius() / step).ceil() as i32;
        let mut before = [0.0, 0.0];
        for k in 0..=n {
            let share = f64::from(k) / f64::from(n);
            let rho = cutter.radius() * (1.0 - (1.0 - share).powi(2));
            let at = [rho, profile.height(rho)];
            if at[1] > length {
                break;
            }
            places.push(at);
            before = at;
            let corners = [profile.bottom_end, profile.arc_end].map(|rho| [rho, profile.height(rho)]);
            places.extend(corners.iter().filter(|c| k == 0 && c[1] < length));
        }
        last = [radius_at(Some(cutter), None, length, length - 1e-13).unwrap(), length];
        steps(&mut places, before, last);
    }
    if let Some(holder) = holder {
        for [low, top] in slants(holder) {
            steps(&mut places, last, low);
            steps(&mut places, low, top);
            last = top;
        }
    }
    steps(&mut places, last, [0.0, last[1]]);
    places
}

/// A lattice that does not fall on edges.
fn places() -> impl Iterator<Item = RhoZ> {
    (0..20).flat_map(|i| (0..40).map(move |j| [0.0137 + 0.43 * f64::from(i), -2.0 + 0.559 * f64::from(j)]))
}

fn check(name: &str, solid: &Solid, cutter: Option<&Cutter>, holder: Option<&Holder>, length: f64) {
    const STEP: f64 = 0.01;
    let surface = surface(cutter, holder, length, STEP);
    let bend = cutter.map_or(0.0, Cutter::corner_radius);
    let bend = if bend > 0.0 { 1.0 / bend } else { 0.0 };
    for [rho, z] in places() {
        let foot = solid.outline_foot(rho, z);
        let near = surface.iter().map(|s| (s[0] - rho).hypot(s[1] - z)).fold(f64::INFINITY, f64::min);
        // The nearest sample is farther than the nearest place, by what half a step leaves to either curve.
        let half = (0.5 * STEP).powi(2);
        let slack = near - (near * near - half).max(0.0).sqrt() + 0.5 * half * bend + 1e-9;
        let size = foot.distance.abs();
        assert!(size <= near + 1e-9 && size >= near - slack, "{name} {rho} {z}: {size} {near}");
        let inside = radius_at(cutter, holder, length, z).is_some_and(|r| rho < r);
        assert_eq!(foot.distance < 0.0, inside, "{name} {rho} {z}: {}", foot.distance);
        let [a, b] = foot.gradient;
        assert!((a.hypot(b) - 1.0).abs() < 1e-12, "{name} {rho} {z}: {a} {b}");
        // The nearest point lies on the surface.
        let at = solid.outline_foot((rho - a * foot.distance).abs(), z - b * foot.distance);
        assert!(at.distance.abs() < 1e-12, "{name} {rho} {z}: {}", at.distance);
        for (i, h) in [([1e-6, 0.0], a), ([0.0, 1e-6], b)] {
            let ahead = solid.outline_foot(rho + i[0], z + i[1]).distance;
            let behind = solid.outline_foot(rho - i[0], z - i[1]).distance;
            let rise = (ahead - behind) / 2e-6;
            assert!(rise.abs() <= 1.0 + 1e-8, "{name} {rho} {z}: not 1-Lipschitz, {rise}");
            // Between two nearest places, and near one, there is no gradient to compare with.
            let smooth = (ahead + behind - 2.0 * foot.distance).abs() < 1e-10;
            assert!(!smooth || (rise - h).abs() < 1e-5, "{name} {rho} {z}: {rise} {h}");
        }
    }
}

#[test]
fn distances_are_those_of_the_densely_sampled_surface() {
    for cutter in cutters() {
        let name = format!("{:?}", cutter.words());
        let free = Solid::of_cutter(&cutter, None);
        assert!(free.is_convex() && free.pieces() == 1 && free.radius() == cutter.radius());
        check(&name, &free, Some(&cutter), None, free.heights()[1]);
        for length in [9.0, 1.3, 0.4] {
            let holder = holder(length);
            let tool = Solid::of_tool(&cutter, &holder);
            assert!(!tool.is_convex() && tool.pieces() == 5);
            check(&name, &tool, Some(&cutter), Some(&holder), length);
            check(&name, &Solid::of_cutter(&cutter, Some(&holder)), Some(&cutter), None, length);
        }
    }
    let holder = holder(1.0);
    check("holder", &Solid::of_holder(&holder), None, Some(&holder), 1.0);
}

#[test]
fn the_whole_is_the_union_of_convex_pieces() {
    for cutter in cutters() {
        let tool = Solid::of_tool(&cutter, &holder(2.0));
        for [rho, z] in places() {
            let whole = tool.outline_foot(rho, z).distance;
            let feet = (0..tool.pieces()).map(|k| tool.piece_foot(k, rho, z).distance);
            let least = feet.fold(f64::INFINITY, f64::min);
            assert!(if whole < 0.0 { least < 1e-12 } else { (least - whole).abs() < 1e-12 });
            assert!(whole <= least + 1e-12);
            for k in 0..tool.pieces() {
                let at = |d: f64| tool.piece_foot(k, (rho + 0.6 * d).abs(), z + 0.8 * d).distance;
                assert!(at(0.4) + at(-0.4) - 2.0 * at(0.0) > -1e-12, "piece {k} is not convex");
            }
        }
    }
}

#[test]
fn in_space_the_axis_may_lean() {
    let cutter = Cutter::ball(6.0).unwrap();
    let solid = Solid::of_cutter(&cutter, None);
    assert_eq!((solid.ball(), solid.pivot()), (Some(3.0), 3.0));
    // A holder may be nearer than the ball, and a short ball ends near.
    assert_eq!(Solid::of_tool(&cutter, &holder(12.0)).ball(), None);
    assert_eq!(Solid::of_cutter(&cutter, Some(&holder(5.0))).ball(), None);
    let (tip, axis) = (Point3::new(1.0, 2.0, 3.0), Vector3::new(0.48, -0.6, 0.64));
    let centre = tip + axis * 3.0;
    for (x, y, z) in [(3.0, 1.0, -4.0), (-2.0, 0.5, -1.0), (0.5, 0.5, -0.1)] {
        let away = Vector3::new(x, y, z);
        let foot = solid.foot(&tip, &axis, &(centre + away));
        assert!((foot.distance - (away.norm() - 3.0)).abs() < 1e-14);
        assert!((foot.gradient - away.normalize()).norm() < 1e-14);
        assert!((foot.point - (centre + away.normalize() * 3.0)).norm() < 1e-14);
        assert_eq!(foot.distance, solid.distance(&tip, &axis, &(centre + away)));
    }
    // On the axis: below the tip, and inside the cylinder above, where the gradient points any way.
    let below = solid.foot(&tip, &axis, &(tip - axis * 0.5));
    assert!((below.distance - 0.5).abs() < 1e-14 && (below.gradient + axis).norm() < 1e-14);
    let inside = solid.foot(&tip, &axis, &(tip + axis * 10.0));
    assert!((inside.distance + 3.0).abs() < 1e-14 && inside.gradient.dot(&axis).abs() < 1e-14);
    assert!((inside.gradient.norm() - 1.0).abs() < 1e-14);
}

#[test]
fn the_reach_is_that_of_the_farthest_place() {
    for cutter in cutters() {
        let tool = Solid::of_tool(&cutter, &holder(2.0));
        for piece in 0..tool.pieces() {
            for k in 0..=180 {
                let (along, across) =
                    (f64::from(k) * 1f64.to_radians() - 0.5 * std::f64::consts::PI).sin_cos();
                let reach = tool.piece_support(piece, across, along);
                // Signed distances are at least what a place lies beyond; far out they are no more.
                for [rho, z] in places() {
                    assert!(
                        tool.piece_foot(piece, rho, z).distance > rho * across + z * along - reach - 1e-12
                    );
                }
                let far = 1e7;
                let away = tool.piece_foot(piece, far * across, far * along).distance;
                assert!((far - reach - away).abs() < 1e-4, "{piece} {k}: {reach} {}", far - away);
            }
        }
    }
}

#[test]
fn the_sharpest_bend_is_that_of_the_corner_or_an_edge() {
    let sharpest = |cutter: Cutter| Solid::of_cutter(&cutter, None).sharpest();
    assert_eq!(sharpest(Cutter::ball(6.0).unwrap()), 3.0);
    assert_eq!(sharpest(Cutter::bull(6.0, 1.0).unwrap()), 1.0);
    assert_eq!(sharpest(Cutter::flat(6.0).unwrap()), 0.0);
    // Where its cone ends it has an edge.
    assert_eq!(sharpest(Cutter::taper(2.0, 0.5, 0.1, 8.0).unwrap()), 0.0);
}
