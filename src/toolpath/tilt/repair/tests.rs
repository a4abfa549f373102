//! Repairs in cavities, slots and bowls.

use super::*;
use crate::moves::touch::Touch;
use collision::samples::*;
use collision::{Check, Obstacle};
use cutter::Solid;
use geometry::{Bvh, TriangleMesh};
use motion::{CcPoint, location};
use work::monitor::Silent;

/// A floor at z = 0 with walls at ±half along x and y, open at the top.
fn cavity(half: [f64; 2], depth: f64) -> (TriangleMesh, Bvh) {
    let corner = |i: usize| {
        let sign = |bit: usize| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
        Point3::new(sign(0) * half[0], sign(1) * half[1], if i >> 2 == 1 { depth } else { 0.0 })
    };
    let quads = [[0, 1, 3, 2], [0, 4, 5, 1], [2, 3, 7, 6], [1, 5, 7, 3], [0, 2, 6, 4]];
    mesh(
        (0..8).map(corner).collect(),
        quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
    )
}

struct Tool {
    edges: Solid,
    held: Solid,
}

fn tool(cutter: Cutter) -> Tool {
    let holder = holder(10.0);
    Tool { edges: Solid::of_cutter(&cutter, Some(&holder)), held: Solid::of_holder(&holder) }
}

const NEEDED: f64 = 0.5;
const ALLOWED: f64 = 0.004;

fn room<'a>(cutter: &'a Cutter, keep: &'a Interference<'a>) -> Room<'a> {
    Room { cutter, keep, firm: false }
}

fn keep<'a>(tool: &'a Tool, part: &'a (TriangleMesh, Bvh)) -> Interference<'a> {
    let obstacle = Obstacle::new(&part.0, &part.1);
    let checks = vec![
        Check { solid: &tool.edges, obstacle, needed: -ALLOWED },
        Check { solid: &tool.held, obstacle, needed: NEEDED },
    ];
    Interference { checks, greatest_tilt: 0.8, greatest_lift: 2.0 }
}

/// Upright along y on the floor.
fn along_floor(cutter: &Cutter, x: f64, ys: impl Iterator<Item = f64>) -> Vec<Touch> {
    let touch = |y: f64| {
        let contact = CcPoint { point: Point3::new(x, y, 0.0), normal: Vector3::z() };
        Touch::along(Vector3::z(), cutter, contact, Vector3::y())
    };
    ys.map(touch).collect()
}

fn moves_are_clear(keep: &Interference, passes: &[Vec<Touch>]) {
    for w in passes.iter().flat_map(|pass| pass.windows(2)) {
        for k in 0..=20 {
            let at = w[0].at.towards(&w[1].at, f64::from(k) / 20.0);
            assert!(keep.shortfall(&at).is_none_or(|s| s.depth < 1e-5), "{:?}", keep.shortfall(&at));
        }
    }
}

#[test]
fn in_a_deep_cavity_the_tool_leans_away_from_the_wall() {
    for cutter in [Cutter::ball(6.0).unwrap(), Cutter::bull(6.0, 1.0).unwrap()] {
        let (part, tool) = (cavity([25.0, 40.0], 40.0), tool(cutter));
        let keep = keep(&tool, &part);
        let pass = along_floor(&cutter, 20.0, (0..81).map(|k| 0.25 * f64::from(k) - 10.0));
        assert!(pass.iter().all(|touch| !keep.is_clear(&touch.at)), "upright, the holder is in the wall");
        let repaired = repair(&pass, room(&cutter, &keep), None, &Silent).unwrap();
        let (passes, summary) = (repaired.passes, repaired.summary);
        assert_eq!((passes.len(), summary.tilted, summary.lifted), (1, 81, 0), "{summary:?}");
        assert!(summary.unreachable.is_empty() && summary.greatest_lift.is_none());
        assert!(summary.notes()[0].starts_with("at 81 contacts the axis is tilted by up to"));
        moves_are_clear(&keep, &passes);
        let kept: Vec<_> = passes[0].iter().filter(|t| pass.iter().any(|p| p.contact == t.contact)).collect();
        assert_eq!(kept.len(), 81, "every contact is still touched");
        for touch in &kept {
            let there = location(&cutter, &touch.contact, &touch.at.axis);
            assert!((there.tip - touch.at.tip).norm() < 1e-12);
        }
        for w in passes[0].windows(2) {
            assert!((w[1].at.axis - w[0].at.axis).norm() < 0.02, "{:?} {:?}", w[0].at, w[1].at);
        }
        // No axis that leans a degree less is clear with what repaired ones spare.
        let least = kept.iter().map(|t| t.at.axis.z.acos()).fold(f64::INFINITY, f64::min);
        for around in 0..720 {
            let (sin, cos) = (f64::from(around) * 0.5f64.to_radians()).sin_cos();
            let lean = least - 1f64.to_radians();
            let axis = Vector3::new(cos * lean.sin(), sin * lean.sin(), lean.cos());
            let at = location(&cutter, &pass[40].contact, &axis);
            assert!(!keep.holds(&at, true), "{around}");
        }
    }
}

#[test]
fn where_nothing_helps_the_tool_is_lifted_or_the_place_reported() {
    let cutter = Cutter::ball(6.0).unwrap();
    let (part, tool) = (cavity([4.0, 300.0], 40.0), tool(cutter));
    let mut keep = keep(&tool, &part);
    let pass = along_floor(&cutter, 0.0, (0..5).map(f64::from));
    let repaired = repair(&pass, room(&cutter, &keep), None, &Silent).unwrap();
    assert!(repaired.passes.is_empty());
    let unreachable = repaired.summary.unreachable;
    assert_eq!(
        unreachable.iter().map(|u| u.place).collect::<Vec<_>>(),
        pass.iter().map(|t| t.contact.point).collect::<Vec<_>>()
    );
    // The cone, 8 mm wide 30 mm above the tip and 12 mm wide at 45, is in the walls, 4 mm from its axis; the
    // place that is as far from its slant as from its upper end is deepest.
    let cos = 15.0 / 15f64.hypot(4.0);
    let deepest = 45.0 - (45.0 + cos * (30.0 * 4.0 / 15.0 - 4.0)) / (1.0 + cos * 4.0 / 15.0);
    assert!(
        unreachable.iter().all(|u| (u.depth - NEEDED - deepest).abs() < 1e-6),
        "{unreachable:?} {deepest}"
    );
    // The cone stands 30 mm above the tip, the walls are 40 high.
    keep.greatest_lift = 15.0;
    let repaired = repair(&pass, room(&cutter, &keep), None, &Silent).unwrap();
    let (most, _) = repaired.summary.greatest_lift.unwrap();
    assert!((10.52..10.53).contains(&most), "{most}");
    assert_eq!(
        (repaired.summary.lifted, repaired.passes.len(), repaired.summary.unreachable.len()),
        (5, 1, 0)
    );
    moves_are_clear(&keep, &repaired.passes);
}

#[test]
fn a_pass_is_left_out_where_a_clamp_stands() {
    let cutter = Cutter::ball(6.0).unwrap();
    let (part, tool) = (cavity([60.0, 60.0], 1.0), tool(cutter));
    let (clamp, clamp_tree) = block([-20.0, -2.0, 0.0], [20.0, 2.0, 12.0]);
    let mut keep = keep(&tool, &part);
    let obstacle = Obstacle::new(&clamp, &clamp_tree);
    keep.checks.extend([&tool.edges, &tool.held].map(|solid| Check { solid, obstacle, needed: 1.0 }));
    let pass = along_floor(&cutter, 0.0, (0..161).map(|k| 0.25 * f64::from(k) - 20.0));
    let Repaired { passes, summary } = repair(&pass, room(&cutter, &keep), None, &Silent).unwrap();
    assert_eq!(passes.len(), 2);
    moves_are_clear(&keep, &passes);
    // A ball of 3 mm that keeps 1 mm from a wall higher than its middle stays 4 mm away from it.
    let ends = [passes[0].last().unwrap().contact.point.y, passes[1][0].contact.point.y];
    assert_eq!(ends, [-6.0, 6.0]);
    assert_eq!(summary.unreachable.len(), 47);
    assert!(summary.notes().last().unwrap().starts_with("47 places cannot be reached"));
}

#[test]
fn what_stands_between_two_contacts_is_passed_by() {
    let cutter = Cutter::ball(6.0).unwrap();
    let (part, tool) = (cavity([60.0, 60.0], 1.0), tool(cutter));
    let mut keep = keep(&tool, &part);
    // Beside the widest section of the holder, which is 20 mm thick from 45 mm upward.
    let (post, post_tree) = block([15.0, -1.0, 30.0], [30.0, 1.0, 100.0]);
    keep.checks.push(Check { solid: &tool.held, obstacle: Obstacle::new(&post, &post_tree), needed: NEEDED });
    let pass = along_floor(&cutter, 0.0, [-20.0, 20.0].into_iter());
    assert!(pass.iter().all(|touch| keep.is_clear(&touch.at)));
    let Repaired { passes, summary } = repair(&pass, room(&cutter, &keep), None, &Silent).unwrap();
    assert_eq!((passes.len(), summary.unreachable.len(), summary.lifted), (1, 0, 0), "{summary:?}");
    assert!(summary.added > 2 && passes[0].len() == 2 + summary.added);
    moves_are_clear(&keep, &passes);
}

#[test]
fn the_axis_is_led_over_to_where_it_must_lean() {
    let cutter = Cutter::ball(6.0).unwrap();
    let (part, tool) = (cavity([60.0, 60.0], 1.0), tool(cutter));
    let mut keep = keep(&tool, &part);
    // A wall that begins half way along the pass.
    let (wall, wall_tree) = block([25.0, 0.0, 0.0], [27.0, 60.0, 40.0]);
    keep.checks.push(Check { solid: &tool.held, obstacle: Obstacle::new(&wall, &wall_tree), needed: NEEDED });
    let pass = along_floor(&cutter, 20.0, (0..161).map(|k| 0.25 * f64::from(k) - 30.0));
    let fastest = |turning: Option<f64>| {
        let Repaired { passes, summary } = repair(&pass, room(&cutter, &keep), turning, &Silent).unwrap();
        assert_eq!((passes.len(), summary.unreachable.len(), summary.lifted), (1, 0, 0), "{summary:?}");
        moves_are_clear(&keep, &passes);
        assert_eq!(passes[0][0], pass[0], "far from the wall nothing changes");
        let rate = |w: &[Touch]| {
            (w[1].at.axis - w[0].at.axis).norm() / (w[1].contact.point - w[0].contact.point).norm()
        };
        passes[0].windows(2).map(rate).fold(0.0, f64::max)
    };
    assert!(fastest(Some(1e3)) > 0.03, "{}", fastest(Some(1e3)));
    assert!(fastest(Some(0.015)) < 0.0151, "{}", fastest(Some(0.015)));
}

/// Rules that turn fast beside a wall: led over to its neighbour's axis, none leans from its own by more than
/// is allowed.
#[test]
fn no_axis_leans_from_its_rule_by_more_than_is_allowed() {
    let cutter = Cutter::ball(6.0).unwrap();
    let (part, tool) = (cavity([60.0, 60.0], 1.0), tool(cutter));
    let (wall, wall_tree) = block([25.0, -60.0, 0.0], [27.0, 60.0, 40.0]);
    let mut keep = keep(&tool, &part);
    keep.checks.push(Check { solid: &tool.held, obstacle: Obstacle::new(&wall, &wall_tree), needed: NEEDED });
    let turned = |touch: Touch| {
        let lean = 0.5 * (0.8 * touch.contact.point.y).sin();
        let axis = Vector3::new(0.0, lean.sin(), lean.cos());
        Touch::along(axis, &cutter, touch.contact, touch.feed)
    };
    let pass: Vec<Touch> = along_floor(&cutter, 20.0, (0..161).map(|k| 0.25 * f64::from(k) - 20.0))
        .into_iter()
        .map(turned)
        .collect();
    let needed = repair(&pass, room(&cutter, &keep), None, &Silent).unwrap().summary.greatest_tilt;
    for greatest_tilt in [0.8, 0.6 * needed, 0.45, 0.4] {
        let keep = Interference { checks: keep.checks.clone(), greatest_tilt, greatest_lift: 30.0 };
        let found = repair(&pass, room(&cutter, &keep), None, &Silent).unwrap().summary;
        assert!(
            found.tilted > 0 && found.greatest_tilt <= greatest_tilt + 1e-12,
            "{greatest_tilt}: {found:?}"
        );
    }
}

#[test]
fn the_rear_of_a_flat_leaves_bowls_and_troughs_at_the_lead_of_their_curvature() {
    const RADIUS: f64 = 20.0;
    let depth = |square: f64| RADIUS - (RADIUS * RADIUS - square).sqrt();
    let bowl = sheet(16.0, 320, |x, y| depth(x * x + y * y));
    let trough = sheet(16.0, 320, |_, y| depth(y * y));
    let feed = Vector3::x();
    let contact = CcPoint { point: Point3::origin(), normal: Vector3::z() };
    for cutter in [Cutter::flat(6.0).unwrap(), Cutter::bull(6.0, 1.0).unwrap()] {
        let expected = (cutter.flat_radius() / (RADIUS - cutter.corner_radius())).asin();
        let edges = Solid::of_cutter(&cutter, None);
        for surface in [&bowl, &trough] {
            let gouge = |lead: f64| {
                let at = location(&cutter, &contact, &(Vector3::z() * lead.cos() + feed * lead.sin()));
                let mesh = Obstacle::new(&surface.0, &surface.1);
                mesh.clearance(&edges, &at, 1.0).unwrap().distance
            };
            // Facets of 0.05 mm lie up to 31 nm inside of the surface.
            assert!(gouge(expected + 1e-4) > -3.2e-5, "{}", gouge(expected + 1e-4));
            assert!(gouge(expected - 0.01) < -8e-4, "{}", gouge(expected - 0.01));
        }
        // The repair finds about the same lead from a cutter that stands along the normal.
        let mut along = Vec::new();
        for k in -8..=8 {
            let point = Point3::new(0.25 * f64::from(k), 0.0, depth(0.0625 * f64::from(k * k)));
            let normal = (Point3::new(0.0, 0.0, RADIUS) - point) / RADIUS;
            along.push(Touch::along(normal, &cutter, CcPoint { point, normal }, feed));
        }
        let check = Check { solid: &edges, obstacle: Obstacle::new(&bowl.0, &bowl.1), needed: -0.001 };
        let keep = Interference { checks: vec![check], greatest_tilt: 0.5, greatest_lift: 0.0 };
        let Repaired { passes, summary } = repair(&along, room(&cutter, &keep), None, &Silent).unwrap();
        assert_eq!((passes.len(), summary.tilted), (1, 17), "{summary:?}");
        assert!((summary.greatest_tilt - expected).abs() < 0.01, "{} {expected}", summary.greatest_tilt);
        moves_are_clear(&keep, &passes);
    }
}

#[test]
fn a_pass_that_is_clear_stays_as_it_is() {
    let cutter = Cutter::ball(6.0).unwrap();
    let (part, tool) = (cavity([60.0, 60.0], 1.0), tool(cutter));
    let pass = along_floor(&cutter, 0.0, (0..20).map(f64::from));
    let Repaired { passes, summary } =
        repair(&pass, room(&cutter, &keep(&tool, &part)), None, &Silent).unwrap();
    assert_eq!((passes, summary.clone()), (vec![pass], RepairSummary::default()));
    assert!(summary.notes().is_empty());
}
