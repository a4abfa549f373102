//! Planted defects are found where they are, with the size that they have.

use millstream::cutter::Cutter;
use millstream::geometry::{AnalyticShape, Point3};
use millstream::metrology::Limits;
use millstream::motion::{ClPoint, Move, MoveKind, Toolpath};
use millstream::toolpath::{Step, Zigzag};

use crate::support::{ASKED, LIMITS, cut_and_measure, formula, mesh, off, plan_and_measure, settings};

/// A symmetric groove along y with walls that rise at `angle` from the line x = 0.
fn groove(angle: f64, half_width: f64, length: f64) -> millstream::part::Part {
    let z = half_width * angle.tan();
    let row = |y: f64| {
        [[-half_width, y, z], [0.0, y, 0.0], [half_width, y, z]].map(|p| Point3::new(p[0], p[1], p[2]))
    };
    let vertices = [row(0.0), row(length)].concat();
    mesh(vertices, vec![[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]])
}

#[test]
fn a_ball_leaves_the_corner_of_a_groove_uncut_as_geometry_says() {
    let (angle, r, length) = (30f64.to_radians(), 3.0, 12.0);
    let part = groove(angle, 6.0, length);
    let cutter = Cutter::ball(2.0 * r).unwrap();
    let along = Zigzag::at(std::f64::consts::FRAC_PI_2);
    let cell = 0.05;
    // 75 passes over the 9 mm between the walls' ends, so that one runs in the corner itself.
    let m = plan_and_measure(&part, &cutter, &along, Step::Stepover(0.12), cell);
    // The ball touches each wall at r·tan(angle) from the corner; a wall point at distance d from
    // the corner sees the cut at r − √(r² − (contact − d)²) along its normal.
    let contact = r * angle.tan();
    let height = |d: f64| r - (r * r - (contact - d).powi(2)).sqrt();
    println!(
        "groove: uncut {:.5} ± {:.5}, closed form {:.5}",
        m.uncut.max_height_mm,
        m.uncut.error_bound_mm,
        height(0.0)
    );
    assert_eq!(m.uncut.region_count, 1, "{:?}", m.uncut.regions);
    let tallest = m.uncut.max_height_mm;
    assert!(tallest <= height(0.0) + 1e-6 && tallest + m.uncut.error_bound_mm >= height(0.0), "{tallest}");
    assert!(m.uncut.error_bound_mm <= ASKED, "{}", m.uncut.error_bound_mm);
    let wide = contact - (r * r - (r - LIMITS.uncut).powi(2)).sqrt();
    let area = 2.0 * wide * length;
    assert!(off(m.uncut.area_mm2, area) < 0.06, "{} {area}", m.uncut.area_mm2);
    assert!(m.uncut.regions[0].at_mm[0].abs() < 2.0 * cell);
    assert!(m.gouge.max_depth_mm < 1e-3);
}

#[test]
fn a_missing_pass_is_uncut_and_a_tall_scallop_is_not() {
    let part = formula(AnalyticShape::Plane { height: 0.0 }, [0.0, 20.0], [0.0, 20.0]);
    let cutter = Cutter::ball(6.0).unwrap();
    let zigzag = Zigzag::at(0.0);
    // A stepover of 2 mm leaves scallops of 0.17 mm: high, yet each is a scallop.
    let m = plan_and_measure(&part, &cutter, &zigzag, Step::Stepover(2.0), 0.1);
    assert!(off(m.scallop.max_mm.unwrap(), 3.0 - 8f64.sqrt()) < 1e-6);
    assert_eq!(m.uncut.region_count, 0, "{:?}", m.uncut.regions);
    // Without every pass that reaches y > 12 the rest is uncut.
    let settings = settings(&part, Step::Stepover(0.5));
    let plan =
        millstream::toolpath::plan(&part, &cutter, &zigzag, &settings, &millstream::monitor::Silent).unwrap();
    let mut path = plan.path;
    path.moves.retain(|m| m.to.tip.y < 12.0);
    let m = cut_and_measure(&part, &cutter, &path, 0.1, &LIMITS);
    assert_eq!(m.uncut.region_count, 1);
    assert!((m.uncut.max_height_mm - 1.0).abs() < 1e-6, "stock stands 1 mm over the part");
    let last = path.moves.iter().map(|m| m.to.tip.y).fold(0.0, f64::max);
    let bare = 20.0 - last - (9.0f64 - 2.95 * 2.95).sqrt();
    assert!(off(m.uncut.area_mm2, 20.0 * bare) < 0.02, "{} {}", m.uncut.area_mm2, 20.0 * bare);
    assert!(
        off(m.scallop.max_mm.unwrap(), 3.0 - (9.0f64 - 0.0625).sqrt()) < 1e-6,
        "scallops elsewhere as before"
    );
}

#[test]
fn a_planted_gouge_is_found_with_its_depth_place_and_move() {
    let part = formula(AnalyticShape::Plane { height: 0.0 }, [0.0, 20.0], [0.0, 20.0]);
    let cutter = Cutter::ball(6.0).unwrap();
    let at = |x: f64, y: f64, z: f64, kind| Move {
        to: ClPoint::upright(Point3::new(x, y, z)),
        kind,
        feed_rate: 1000.0,
        pass: 0,
    };
    let path = Toolpath::new(
        ClPoint::upright(Point3::new(4.03, 7.01, 5.0)),
        vec![
            at(4.03, 7.01, 0.0, MoveKind::Plunge),
            at(9.0, 7.01, 0.0, MoveKind::Cut),
            at(11.013, 9.537, -0.032, MoveKind::Cut),
            at(13.0, 12.0, 0.0, MoveKind::Cut),
        ],
    );
    for cell in [0.05, 0.2] {
        let m = cut_and_measure(&part, &cutter, &path, cell, &Limits { uncut: 10.0, ..LIMITS });
        assert_eq!(m.gouge.region_count, 1);
        let gouge = &m.gouge.regions[0];
        println!("gouge at cell {cell}: {:.6} ± {:.6}", gouge.depth_mm, m.gouge.error_bound_mm);
        assert!((gouge.depth_mm - 0.032).abs() < 2e-6, "cell {cell}: {}", gouge.depth_mm);
        assert!((gouge.at_mm[0] - 11.013).abs() < 0.01 && (gouge.at_mm[1] - 9.537).abs() < 0.01);
        assert!(gouge.move_index == 2 || gouge.move_index == 3);
    }
}

#[test]
fn a_rapid_through_the_part_is_a_gouge() {
    let part = formula(AnalyticShape::Plane { height: 0.0 }, [0.0, 20.0], [0.0, 20.0]);
    let cutter = Cutter::ball(6.0).unwrap();
    let to = Point3::new(25.0, 10.0, -0.1);
    let rapid = Move { to: ClPoint::upright(to), kind: MoveKind::Rapid, feed_rate: 0.0, pass: 0 };
    let path = Toolpath::new(ClPoint::upright(Point3::new(-5.0, 10.0, -0.1)), vec![rapid]);
    let m = cut_and_measure(&part, &cutter, &path, 0.1, &LIMITS);
    assert!((m.gouge.max_depth_mm - 0.1).abs() < 1e-6);
    assert_eq!(m.gouge.regions[0].move_index, 0);
}

#[test]
fn flat_and_bull_ends_cover_a_hill() {
    let shape = AnalyticShape::Cylinder { height: 0.0, radius: 60.0, azimuth: 0.0, concave: false };
    let part = formula(shape, [0.0, 10.0], [-5.0, 5.0]);
    for cutter in [Cutter::flat(6.0).unwrap(), Cutter::bull(6.0, 1.0).unwrap()] {
        for angle in [0.0, std::f64::consts::FRAC_PI_2] {
            let zigzag = Zigzag::at(angle);
            let m = plan_and_measure(&part, &cutter, &zigzag, Step::Stepover(0.5), 0.1);
            assert_eq!(m.uncut.region_count, 0, "{cutter:?} at {angle}: {:?}", m.uncut.regions);
            assert!(m.gouge.max_depth_mm < 0.0011, "{cutter:?} at {angle}: {}", m.gouge.max_depth_mm);
        }
    }
}

#[test]
fn ridges_in_a_corner_that_no_pass_reached_are_no_scallops() {
    let part = groove(30f64.to_radians(), 6.0, 12.0);
    let cutter = Cutter::ball(6.0).unwrap();
    let along = Zigzag::at(std::f64::consts::FRAC_PI_2);
    // An even number of passes, so that two of them leave a ridge right over the corner.
    for stepover in [0.1, 0.3, 0.5] {
        let m = plan_and_measure(&part, &cutter, &along, Step::Stepover(stepover), 0.05);
        let interval = stepover / 30f64.to_radians().cos();
        let exact = 3.0 - (9.0 - 0.25 * interval * interval).sqrt();
        assert!(off(m.scallop.max_mm.unwrap(), exact) < 1e-3, "{stepover}: {:?} {exact}", m.scallop);
        assert!(m.uncut.max_height_mm > 0.5);
    }
}
