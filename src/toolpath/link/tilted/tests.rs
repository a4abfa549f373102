//! A plate beside a wall that the holder must not touch.

use super::*;
use crate::cutter::{Holder, HolderSection, Solid};
use crate::geometry::{AnalyticShape, AnalyticSurface, Bvh, TriangleMesh};
use crate::monitor::Silent;
use crate::part::Patch;
use crate::toolpath::{Check, Joining, Obstacle, Step, Strategy, ToolAxis, plan_tilted};

fn plate() -> Part {
    let surface =
        AnalyticSurface::new(AnalyticShape::Plane { height: 0.0 }, [[0.0, 20.0], [0.0, 20.0]]).unwrap();
    Part::from_patches(vec![Patch::Analytic(surface)], 0.002).unwrap()
}

/// A wall 40 mm high, 6 mm beside the plate: a ball of 6 mm that keeps 0.5 mm away reaches all of it.
fn wall() -> TriangleMesh {
    let vertices = [[-20.0, 0.0], [40.0, 0.0], [40.0, 40.0], [-20.0, 40.0]];
    let vertices = vertices.map(|[y, z]| Point3::new(26.0, y, z)).to_vec();
    TriangleMesh::new(vertices, vec![[0, 1, 2], [0, 2, 3]]).unwrap().0
}

#[test]
fn beside_a_wall_the_axis_leans_away_and_every_cut_is_clear() {
    let (part, cutter, wall) = (plate(), Cutter::ball(6.0).unwrap(), wall());
    let section = |diameter, length| HolderSection { diameter, top_diameter: diameter, length };
    let holder = Holder::new(10.0, vec![section(6.0, 15.0), section(20.0, 40.0)]).unwrap();
    let (edges, held) = (Solid::of_cutter(&cutter, Some(&holder)), Solid::of_holder(&holder));
    let tree = Bvh::new(&wall);
    let [near, beside] = [Obstacle::new(part.mesh(), part.bvh()), Obstacle::new(&wall, &tree)];
    let check = |solid, obstacle, needed| Check { solid, obstacle, needed };
    let checks = vec![
        check(&edges, near, -0.01),
        check(&held, near, 0.5),
        check(&edges, beside, 0.5),
        check(&held, beside, 0.5),
    ];
    let keep = Interference { checks, greatest_tilt: 1.0, greatest_lift: 1.0 };
    let settings = PlanSettings {
        step: Step::Stepover(4.0),
        chord_tolerance: 0.01,
        clearance: 2.0,
        stock_top: 3.0,
        feed_rate: 1000.0,
        plunge_rate: 300.0,
        rapid_rate: 15_000.0,
        joining: Joining::default(),
    };
    let strategy = Strategy::Zigzag { angle: 0.0, one_way: false };
    let planned = |interference| {
        let upright = ToolAxis::Fixed(Vector3::z());
        let tilting = Tilting { axis: &upright, most_turning: None, interference };
        plan_tilted(&part, &cutter, &strategy, &tilting, &settings, &Silent).unwrap()
    };
    let cuts = |to: &Move| to.kind.is_on_surface();
    let upright = planned(None);
    assert!(!keep.on_path(&upright.path, cuts).is_empty(), "upright, the holder is in the wall");
    let plan = planned(Some(&keep));
    assert!(keep.on_path(&plan.path, cuts).is_empty());
    let tilted = |note: &String| note.contains("contacts the axis is tilted by up to");
    assert!(plan.notes.iter().any(tilted), "{:?}", plan.notes);
    // The ball stays where it was: over the plate, all along it.
    let centres = |plan: &crate::toolpath::Plan| {
        let middle = plan.path.moves.iter().filter(|m| cuts(m)).map(|m| m.to.tip + m.to.axis * 3.0);
        middle.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], c| {
            assert!((c.z - 3.0).abs() < 1e-9, "{c}");
            [a.min(c.x), b.max(c.x)]
        })
    };
    let [a, b] = [centres(&plan), centres(&upright)];
    assert!((a[0] - b[0]).abs() < 1e-9 && (a[1] - b[1]).abs() < 1e-9, "{a:?} {b:?}");
    let cut = plan.path.moves.iter().filter(|m| cuts(m)).count();
    assert!(cut < 1000, "{cut} moves");
}
