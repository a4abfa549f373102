//! Measured figures against closed forms, and how they converge with the cell.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use millstream::cutter::Cutter;
use millstream::field::{DIRECTION_WEIGHT, KnotRule, Solver};
use millstream::geometry::AnalyticShape;
use millstream::scallop::ball_scallop_height;
use millstream::toolpath::{
    Along, FeedDirection, IsoParametric, Lines, Step, Strategy, StreamMethod, Streamline, Zigzag,
};

use crate::support::{LIMITS, formula, off, plan_and_measure};

const ZIGZAG: Zigzag = Zigzag::at(0.0);

fn plane_scallop(r: f64, s: f64) -> f64 {
    r - (r * r - 0.25 * s * s).sqrt()
}

#[test]
fn the_scallop_of_a_plane_does_not_depend_on_the_cell() {
    let part = formula(AnalyticShape::Plane { height: 0.0 }, [0.0, 20.0], [0.0, 15.0]);
    for (diameter, s, printed) in [(6.0, 0.5, 0.0104348), (10.0, 1.0, 0.0250628)] {
        let cutter = Cutter::ball(diameter).unwrap();
        let exact = plane_scallop(0.5 * diameter, s);
        assert!(off(exact, printed) < 1e-5);
        for cell in [0.05, 0.1, 0.2] {
            let m = plan_and_measure(&part, &cutter, &ZIGZAG, Step::Stepover(s), cell);
            let [max, p50] = [m.scallop.max_mm.unwrap(), m.scallop.p50_mm.unwrap()];
            println!(
                "plane r={} s={s} cell={cell}: max {max:.7} p50 {p50:.7} exact {exact:.7}",
                0.5 * diameter
            );
            assert!(off(max, exact) < 1e-3 && off(p50, exact) < 1e-3, "cell {cell}: {max} {p50} {exact}");
            assert!(m.scallop.error_bound_mm.unwrap() < 1e-3 * exact);
            // Passes roll over the border, and their chords cut its edge.
            assert!(m.gouge.max_depth_mm <= LIMITS.chord && m.uncut.region_count == 0, "{:?}", m.gouge);
        }
    }
}

#[test]
fn the_ridge_length_of_a_plane_is_that_of_its_ridges_at_any_angle() {
    let part = formula(AnalyticShape::Plane { height: 0.0 }, [0.0, 20.0], [0.0, 20.0]);
    let cutter = Cutter::ball(6.0).unwrap();
    for angle in [0.0, 0.4, FRAC_PI_2] {
        let strategy = Zigzag::at(angle);
        let m = plan_and_measure(&part, &cutter, &strategy, Step::Stepover(0.5), 0.1);
        // Parallel ridges 0.5 apart cover an area of 400 mm² with 800 mm; half a pitch is open at
        // each side.
        assert!(off(m.scallop.ridge_length_mm, 800.0) < 0.04, "{angle}: {}", m.scallop.ridge_length_mm);
    }
}

#[test]
fn cylinders_follow_the_exact_row() {
    let (rho, r, s) = (50.0, 5.0, 0.6);
    let cutter = Cutter::ball(2.0 * r).unwrap();
    for concave in [false, true] {
        let shape = AnalyticShape::Cylinder { height: 0.0, radius: rho, azimuth: FRAC_PI_2, concave };
        let part = formula(shape, [-10.0, 10.0], [0.0, 10.0]);
        // Passes along the axis, which is y: isoparametric with v growing, spaced on the surface.
        let strategy = IsoParametric::along(Along::V);
        let m = plan_and_measure(&part, &cutter, &strategy, Step::Stepover(s), 0.05);
        // Levels share the width evenly, so the true arc between passes is a little less than s.
        let arc = 2.0 * rho * (10.0 / rho).asin();
        let interval = arc / (arc / s).ceil();
        let kappa = if concave { 1.0 / rho } else { -1.0 / rho };
        let exact = ball_scallop_height(r, kappa, interval).unwrap();
        let p50 = m.scallop.p50_mm.unwrap();
        println!(
            "cylinder concave={concave}: p50 {p50:.7} max {:.7} exact {exact:.7}",
            m.scallop.max_mm.unwrap()
        );
        assert!(off(p50, exact) < 5e-3, "{p50} {exact}");
        assert!(off(m.scallop.max_mm.unwrap(), exact) < 5e-3);
    }
}

/// Ridges up a slope lean out over its upper border; they are no higher there than elsewhere.
#[test]
fn ridges_up_a_slope_are_as_high_at_its_border_as_inside() {
    let (r, s) = (3.0, 1.0);
    let shape = AnalyticShape::Inclined { height: 0.0, angle: FRAC_PI_4, azimuth: 0.0 };
    let part = formula(shape, [0.0, 4.0], [0.0, 4.0]);
    let m = plan_and_measure(&part, &Cutter::ball(2.0 * r).unwrap(), &ZIGZAG, Step::Stepover(s), 0.05);
    let exact = ball_scallop_height(r, 0.0, s).unwrap();
    let max = m.scallop.max_mm.unwrap();
    assert!(off(max, exact) < 2e-3, "{max} {exact}");
}

#[test]
fn a_scallop_target_holds_on_every_smooth_test_surface() {
    let cutter = Cutter::ball(6.0).unwrap();
    let (x, y) = ([-8.0, 8.0], [-8.0, 8.0]);
    let shapes = [
        ("inclined", AnalyticShape::Inclined { height: 0.0, angle: 0.5, azimuth: 0.3 }),
        ("dome", AnalyticShape::Sphere { height: 0.0, radius: 25.0, concave: false }),
        ("bowl", AnalyticShape::Sphere { height: 0.0, radius: 25.0, concave: true }),
        ("saddle", AnalyticShape::Saddle { radius_concave: 20.0, radius_convex: 15.0 }),
        ("wave", AnalyticShape::Wave { amplitude: 1.0, wavelength_x: 20.0, wavelength_y: None }),
    ];
    let strategies: [(&str, &dyn Strategy); 3] = [
        ("zigzag", &ZIGZAG),
        ("iso-parametric", &IsoParametric::along(Along::U)),
        (
            "streamline",
            &Streamline {
                direction: FeedDirection::Angle(0.5),
                control_points: 16,
                method: StreamMethod::BSpline { degree: 3, knots: KnotRule::Uniform },
                solver: Solver::Cholesky,
                direction_weight: DIRECTION_WEIGHT,
                lines: Lines::Levels,
            },
        ),
    ];
    for (shape_name, shape) in shapes {
        let part = formula(shape, x, y);
        for (name, strategy) in strategies {
            let m = plan_and_measure(&part, &cutter, strategy, Step::Scallop(0.010), 0.1);
            let [max, over] = [m.scallop.max_mm.unwrap(), m.scallop.over_target_fraction.unwrap()];
            println!(
                "{shape_name}, {name}: scallop max {:.2} p50 {:.2} um, over {:.2} %, gouge {:.3} um, uncut {}",
                1e3 * max,
                1e3 * m.scallop.p50_mm.unwrap(),
                100.0 * over,
                1e3 * m.gouge.max_depth_mm,
                m.uncut.region_count
            );
            assert!(max < 0.0125, "{shape_name}, {name}: {max}");
            assert!(over < 0.05, "{shape_name}, {name}: {over}");
            assert!(m.gouge.max_depth_mm < 0.0011, "{shape_name}, {name}: {}", m.gouge.max_depth_mm);
            assert_eq!(m.uncut.region_count, 0, "{shape_name}, {name}: {:?}", m.uncut.regions);
        }
    }
}

#[test]
fn figures_of_a_curved_part_stay_within_their_bounds_as_the_cell_shrinks() {
    let shape = AnalyticShape::Wave { amplitude: 1.0, wavelength_x: 20.0, wavelength_y: Some(25.0) };
    let part = formula(shape, [0.0, 15.0], [0.0, 15.0]);
    let cutter = Cutter::ball(6.0).unwrap();
    let strategy = Zigzag::at(0.3);
    let figures = [0.2, 0.1, 0.05, 0.025].map(|cell| {
        let m = plan_and_measure(&part, &cutter, &strategy, Step::Stepover(0.5), cell);
        let s = &m.scallop;
        (
            s.max_mm.unwrap(),
            s.error_bound_mm.unwrap(),
            s.p50_mm.unwrap(),
            m.gouge.max_depth_mm,
            m.gouge.error_bound_mm,
        )
    });
    let finest = figures[3];
    for (cell, f) in [0.2, 0.1, 0.05].into_iter().zip(figures) {
        println!(
            "cell {cell}: max {:.4} ± {:.4} um (finest {:.4}), p50 {:.4}, gouge {:.4} ± {:.4}",
            1e3 * f.0,
            1e3 * f.1,
            1e3 * finest.0,
            1e3 * f.2,
            1e3 * f.3,
            1e3 * f.4
        );
        assert!(
            finest.0 - f.0 <= f.1 && f.0 - finest.0 <= finest.1,
            "scallop at cell {cell}: {f:?} {finest:?}"
        );
        assert!(
            finest.3 - f.3 <= f.4 && f.3 - finest.3 <= finest.4,
            "gouge at cell {cell}: {f:?} {finest:?}"
        );
        assert!(off(f.2, finest.2) < 0.01, "median at cell {cell}: {f:?} {finest:?}");
    }
    assert!(
        figures[2].1 <= figures[0].1 && figures[0].1 < 1e-4,
        "bounds are small on all cells: {figures:?}"
    );
}
