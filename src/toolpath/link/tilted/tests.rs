//! A plate beside a wall that the holder must not touch, and ways between passes.

use super::*;
use crate::vocabulary::{Joining, Step};
use crate::{Zigzag, plan_tilted};
use collision::{Check, Obstacle};
use cutter::{Holder, HolderSection, Solid};
use geometry::{AnalyticShape, AnalyticSurface, Bvh, NurbsSurface, TriangleMesh, Vector3};
use motion::ToolAxis;
use part::{Part, Patch};
use work::monitor::Silent;

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
        joining: Joining::default(),
        ..PlanSettings::default()
    };
    let strategy = Zigzag::at(0.0);
    let planned = |interference| {
        let upright = ToolAxis::Fixed(Vector3::z());
        let tilting = Tilting { axis: &upright, most_turning: None, most_turning_across: None, interference };
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
    let centres = |plan: &crate::Plan| {
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

fn settings(links: Links) -> PlanSettings {
    PlanSettings {
        step: Step::Stepover(1.0),
        chord_tolerance: 0.005,
        clearance: 2.0,
        stock_top: 1.0,
        feed_rate: 1000.0,
        plunge_rate: 300.0,
        joining: Joining { links, ..Joining::default() },
        ..PlanSettings::default()
    }
}

/// A hollow of radius 30.
fn hollow() -> Part {
    let azimuth = std::f64::consts::FRAC_PI_2;
    let shape = AnalyticShape::Cylinder { height: 0.0, radius: 30.0, azimuth, concave: true };
    let surface = AnalyticSurface::new(shape, [[-8.0, 8.0], [0.0, 12.0]]).unwrap();
    Part::from_patches(vec![Patch::Analytic(surface)], 0.002).unwrap()
}

fn air(path: &Toolpath) -> f64 {
    path.segments().filter(|(.., m)| !m.kind.is_on_surface()).map(|(a, b, _)| (b - a).norm()).sum()
}

#[test]
fn neighbouring_passes_are_joined_nearby_and_clear() {
    for (part, cutter) in
        [(plate(), Cutter::bull(6.0, 1.0)), (hollow(), Cutter::ball(6.0)), (hollow(), Cutter::bull(6.0, 1.0))]
    {
        let cutter = cutter.unwrap();
        let solid = Solid::of_cutter(&cutter, None);
        let obstacle = Obstacle::new(part.mesh(), part.bvh());
        let keep = Interference {
            checks: vec![Check { solid: &solid, obstacle, needed: -0.005 - part.mesh_deviation() }],
            greatest_tilt: 0.5,
            greatest_lift: 0.0,
        };
        let axis = ToolAxis::LeadTilt { lead: 0.2, tilt: 0.0 };
        let tilting =
            Tilting { axis: &axis, most_turning: None, most_turning_across: None, interference: Some(&keep) };
        let strategy = Zigzag::at(0.0);
        let planned =
            |links| plan_tilted(&part, &cutter, &strategy, &tilting, &settings(links), &Silent).unwrap();
        let [bent, aloft] = [Links::Surface, Links::Retract].map(planned);
        for plan in [&bent, &aloft] {
            assert_eq!(plan.notes, Vec::<String>::new());
            assert!(keep.on_path(&plan.path, |_| true).is_empty());
            // In at the first pass; nothing else is as quick as staying near.
            assert_eq!(plan.path.moves.iter().filter(|m| m.kind == MoveKind::Rapid).count(), 1);
        }
        let passes = aloft.path.passes();
        assert!(passes > 5 && air(&aloft.path) < 40.0 + 6.0 * passes as f64, "{}", air(&aloft.path));
        // A bull that leans the other way afterwards is turned around sooner aloft.
        if cutter.is_ball() {
            let count = |kind| bent.path.moves.iter().filter(|m| m.kind == kind).count();
            assert_eq!((count(MoveKind::Plunge), count(MoveKind::Retract)), (1, 1), "all by links");
        }
        // Aloft the cutter stays off the part.
        let off = aloft.path.moves.windows(2).filter(|w| w.iter().all(|m| m.kind == MoveKind::Retract));
        for (w, t) in off.flat_map(|w| [0.0, 0.5, 1.0].map(|t| (w, t))) {
            assert!(obstacle.clearance(&solid, &w[0].to.towards(&w[1].to, t), 0.2 - 2e-5).is_none());
        }
    }
}

#[test]
fn the_lead_of_a_bull_goes_with_the_feed_around_a_link() {
    let (part, cutter) = (plate(), Cutter::bull(6.0, 1.0).unwrap());
    let solid = Solid::of_cutter(&cutter, None);
    let obstacle = Obstacle::new(part.mesh(), part.bvh());
    let keep = Interference {
        checks: vec![Check { solid: &solid, obstacle, needed: -0.01 }],
        ..Interference::default()
    };
    let axis = ToolAxis::LeadTilt { lead: 0.2, tilt: 0.1 };
    let tilting =
        Tilting { axis: &axis, most_turning: None, most_turning_across: None, interference: Some(&keep) };
    let bent = Bent {
        part: &part,
        cutter: &cutter,
        tilting: &tilting,
        touching: &keep,
        interval: 1.0,
        longest: 10.0,
        chord_tolerance: 0.005,
        thinning: 0.003,
    };
    let touch = |y: f64, feed: f64| {
        let contact = motion::CcPoint { point: Point3::new(20.0, y, 0.0), normal: Vector3::z() };
        Touch::by(&axis, &cutter, contact, Vector3::x() * feed).unwrap()
    };
    let (from, to) = (touch(10.0, 1.0), touch(11.0, -1.0));
    let link = bent.link(&from, &to, &Silent).unwrap().unwrap();
    assert_eq!(link.last(), Some(&to.at));
    for at in &link {
        assert!((at.axis.z - from.at.axis.z).abs() < 1e-9, "{}", at.axis.z);
        let nearest = obstacle.clearance(&solid, at, 1.0).map(|near| near.distance);
        assert!(nearest.is_none_or(|d| d > -1e-9), "{nearest:?}");
    }
    // Faster than is asked for, it is none.
    let slow = Tilting { most_turning: Some(0.1), ..tilting };
    assert_eq!(Bent { tilting: &slow, ..bent }.link(&from, &to, &Silent).unwrap(), None);
}

#[test]
fn a_wall_between_two_passes_is_gone_over() {
    let (part, cutter) = (plate(), Cutter::ball(6.0).unwrap());
    let vertices = [[0.0, 0.0], [20.0, 0.0], [20.0, 8.0], [0.0, 8.0]];
    let vertices = vertices.map(|[y, z]| Point3::new(10.0, y, z)).to_vec();
    let wall = TriangleMesh::new(vertices, vec![[0, 1, 2], [0, 2, 3]]).unwrap().0;
    let (tree, solid) = (Bvh::new(&wall), Solid::of_cutter(&cutter, None));
    let check = |obstacle, needed| Check { solid: &solid, obstacle, needed };
    let keep = Interference {
        checks: vec![
            check(Obstacle::new(part.mesh(), part.bvh()), -0.01),
            check(Obstacle::new(&wall, &tree), 0.5),
        ],
        ..Interference::default()
    };
    let settings = PlanSettings { stock_top: 10.0, ..settings(Links::Surface) };
    let axis = ToolAxis::Fixed(Vector3::new(0.1, 0.0, 1.0).normalize());
    let tilting =
        Tilting { axis: &axis, most_turning: None, most_turning_across: None, interference: Some(&keep) };
    let bent = Bent {
        part: &part,
        cutter: &cutter,
        tilting: &tilting,
        touching: &keep,
        interval: 1.0,
        longest: 100.0,
        chord_tolerance: 0.005,
        thinning: 0.003,
    };
    let block = Block::of(&part, &settings);
    let ways = Ways::new(&part, &cutter, &settings, Speeds::of(&settings), &block, &keep, Some(bent));
    let touch = |x: f64, feed: f64| {
        let contact = motion::CcPoint { point: Point3::new(x, 10.0, 0.0), normal: Vector3::z() };
        Touch::by(&axis, &cutter, contact, Vector3::x() * feed).unwrap()
    };
    let (from, to) = (touch(4.0, 1.0), touch(16.0, 1.0));
    let moves = ways.between(&from, &to, &Silent).unwrap();
    let mut at = from.at;
    for (to, kind) in &moves {
        assert!(keep.on_move(&at, to).is_none() && *kind != MoveKind::Link, "{kind:?}");
        at = *to;
    }
    assert_eq!(at, to.at);
    assert!(moves.iter().any(|(to, _)| to.tip.z > 8.5));
    // On one side of the wall the surface is quickest.
    let beside = ways.between(&from, &touch(5.0, -1.0), &Silent).unwrap();
    assert!(beside.iter().all(|(_, kind)| *kind == MoveKind::Link));
}

/// Passes farther apart than the cutter is wide nearly, below a stock of 12 mm: it stands where the tool
/// comes down.
#[test]
fn through_standing_stock_the_tool_goes_down_at_the_plunge_rate() {
    let (part, cutter) = (plate(), Cutter::ball(6.0).unwrap());
    for (lean, links) in [(0.2, Links::Retract), (0.2, Links::Surface), (1.0, Links::Retract)] {
        let settings = PlanSettings { step: Step::Stepover(5.5), stock_top: 12.0, ..settings(links) };
        let axis = ToolAxis::Fixed(Vector3::new(lean, 0.1, 1.0).normalize());
        let tilting =
            Tilting { axis: &axis, most_turning: None, most_turning_across: None, interference: None };
        let strategy = Zigzag { one_way: true, ..Zigzag::at(0.0) };
        let path =
            plan_tilted(&part, &cutter, &strategy, &tilting, &settings, &Silent).unwrap().path.as_written();
        let fed = path.segments().filter(|(.., m)| matches!(m.kind, MoveKind::Plunge | MoveKind::Retract));
        let down = fed.map(|(a, b, m)| (a - b).dot(&m.to.axis) / (b - a).norm() * m.feed_rate);
        let fastest = down.fold(0.0, f64::max);
        assert!(fastest > 299.0 && fastest <= 300.0 * (1.0 + 1e-9), "{lean} {links:?}: {fastest}");
    }
}

/// A second face of the part 0.05 mm beside the way out along the axis: no rapid move runs so near to it.
#[test]
fn past_another_face_the_tool_goes_out_at_the_feed() {
    let (axis, aside) = (Vector3::new(0.5, 0.0, 0.75f64.sqrt()), Vector3::new(-(0.75f64.sqrt()), 0.0, 0.5));
    let centre = Point3::new(10.0, 10.0, 3.0);
    let face = |from: f64, to: f64| {
        let corner = |along: f64, y: f64| centre + aside * 3.05 + axis * along + Vector3::y() * y;
        let net = [from, to].map(|along| [-8.0, 8.0].map(|y| corner(along, y)).to_vec()).to_vec();
        let ends = || vec![0.0, 0.0, 1.0, 1.0];
        Patch::Nurbs(NurbsSurface::new(1, 1, ends(), ends(), &net, None).unwrap())
    };
    let plane =
        AnalyticSurface::new(AnalyticShape::Plane { height: 0.0 }, [[0.0, 20.0], [0.0, 20.0]]).unwrap();
    let cutter = Cutter::ball(6.0).unwrap();
    let solid = Solid::of_cutter(&cutter, None);
    let settings = settings(Links::Retract);
    let rule = ToolAxis::Fixed(axis);
    let touch = |x: f64| {
        let contact = motion::CcPoint { point: Point3::new(x, 10.0, 0.0), normal: Vector3::z() };
        Touch::by(&rule, &cutter, contact, Vector3::x()).unwrap()
    };
    // Where the face ends, and where there is none, the tool is as quick as ever.
    for (far, fed) in [(0.0, 2.0), (7.0, 8.0), (14.0, 16.0)] {
        let mut patches = vec![Patch::Analytic(plane)];
        patches.extend((far > 0.0).then(|| face(6.0, far)));
        let part = Part::from_patches(patches, 0.002).unwrap();
        let near = Obstacle::new(part.mesh(), part.bvh());
        let checks = vec![Check { solid: &solid, obstacle: near, needed: -0.01 }];
        let keep = Interference { checks, ..Interference::default() };
        let block = Block::of(&part, &settings);
        let ways = Ways::new(&part, &cutter, &settings, Speeds::of(&settings), &block, &keep, None);
        let moves = ways.between(&touch(10.0), &touch(170.0), &Silent).unwrap();
        let mut at = touch(10.0).at;
        assert_eq!(moves[0].1, MoveKind::Retract);
        let off = (moves[0].0.tip - at.tip).norm();
        assert!((off - fed).abs() < 1e-9, "{far}: {off}");
        for (to, kind) in &moves {
            let from = std::mem::replace(&mut at, *to);
            let hit = near.swept_clearance(&solid, &from, to, 0.2 - 2e-5);
            assert!(*kind != MoveKind::Rapid || hit.is_none(), "{far}: {hit:?} {moves:?}");
        }
    }
}
