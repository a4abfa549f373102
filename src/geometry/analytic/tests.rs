use super::*;
use approx::assert_relative_eq;
use proptest::prelude::*;
use std::f64::consts::FRAC_PI_2;

const SQUARE: [[f64; 2]; 2] = [[-20.0, 20.0], [-15.0, 25.0]];

fn shapes() -> Vec<AnalyticShape> {
    use AnalyticShape::*;
    vec![
        Plane { height: 3.0 },
        Inclined { height: -1.0, angle: 0.5, azimuth: 2.0 },
        Cylinder { height: 1.0, radius: 40.0, azimuth: FRAC_PI_2, concave: false },
        Cylinder { height: 1.0, radius: 40.0, azimuth: 0.7, concave: true },
        Sphere { height: 1.0, radius: 50.0, concave: false },
        Sphere { height: 1.0, radius: 50.0, concave: true },
        Saddle { radius_concave: 30.0, radius_convex: 20.0 },
        Wave { amplitude: 2.0, wavelength_x: 25.0, wavelength_y: Some(31.0) },
        Wave { amplitude: 2.0, wavelength_x: 25.0, wavelength_y: None },
        PitAndCrest { scale: 0.7 },
    ]
}

proptest! {
    #[test]
    fn derivatives_are_those_of_central_differences(which in 0usize..10, s in 0.01f64..0.99, t in 0.01f64..0.99) {
        let surface = AnalyticSurface::new(shapes()[which], SQUARE).unwrap();
        let (x, y, h) = (-20.0 + 40.0 * s, -15.0 + 40.0 * t, 1e-4);
        let at = |dx: f64, dy: f64| surface.height_jet(x + dx, y + dy);
        let j = at(0.0, 0.0);
        let across = |f: fn(&HeightJet) -> f64| {
            [(f(&at(h, 0.0)) - f(&at(-h, 0.0))) / (2.0 * h), (f(&at(0.0, h)) - f(&at(0.0, -h))) / (2.0 * h)]
        };
        let close = |a: f64, b: f64| (a - b).abs() < 1e-7 * (1.0 + a.abs());
        let [zx, zy] = across(|j| j.z);
        prop_assert!(close(j.zx, zx) && close(j.zy, zy));
        let [zxx, zxy] = across(|j| j.zx);
        prop_assert!(close(j.zxx, zxx) && close(j.zxy, zxy));
        let [zyx, zyy] = across(|j| j.zy);
        prop_assert!(close(j.zxy, zyx) && close(j.zyy, zyy));
        prop_assert!(j.z.abs() <= greatest_height(surface.shape(), SQUARE));
    }
}

#[test]
fn curvature_of_sphere_and_cylinder() {
    for (concave, sign) in [(false, -1.0), (true, 1.0)] {
        let sphere = AnalyticShape::Sphere { height: 0.0, radius: 50.0, concave };
        let k = AnalyticSurface::new(sphere, SQUARE).unwrap().jet(11.0, -9.0).principal_curvatures().unwrap();
        assert_relative_eq!(k.min, sign / 50.0, epsilon = 1e-14);
        assert_relative_eq!(k.max, sign / 50.0, epsilon = 1e-14);
        let cylinder = AnalyticShape::Cylinder { height: 0.0, radius: 40.0, azimuth: 0.3, concave };
        let k =
            AnalyticSurface::new(cylinder, SQUARE).unwrap().jet(11.0, -9.0).principal_curvatures().unwrap();
        let (bent, straight) = if concave { (k.max, k.min) } else { (k.min, k.max) };
        assert_relative_eq!(bent, sign / 40.0, epsilon = 1e-14);
        assert_relative_eq!(straight, 0.0, epsilon = 1e-14);
        let axis = if concave { k.min_direction } else { k.max_direction };
        assert_relative_eq!(axis.x.abs(), 0.3f64.cos(), epsilon = 1e-12);
        assert_relative_eq!(axis.z, 0.0, epsilon = 1e-12);
    }
}

#[test]
fn points_lie_on_the_solids_they_are_named_after() {
    let p = AnalyticSurface::new(AnalyticShape::Sphere { height: 7.0, radius: 50.0, concave: false }, SQUARE)
        .unwrap();
    assert_relative_eq!((p.jet(13.0, 21.0).p - Point3::new(0.0, 0.0, -43.0)).norm(), 50.0, epsilon = 1e-12);
    // The pit and the crest of the published formula, by hand: u = v = 1/2 gives
    // 20·(1.775 − 3.7 + 2.64375 − 0.61875) − 28 = −26.
    let full = [[-50.0, 50.0], [-50.0, 50.0]];
    let p = AnalyticSurface::new(AnalyticShape::PitAndCrest { scale: 1.0 }, full).unwrap();
    assert_relative_eq!(p.height(0.0, 0.0), -26.0, epsilon = 1e-12);
    assert_relative_eq!(p.height(50.0, 3.0), -28.0, epsilon = 1e-12);
    let p = AnalyticSurface::new(AnalyticShape::Inclined { height: 0.0, angle: 0.4, azimuth: 0.0 }, full)
        .unwrap();
    assert_relative_eq!(p.height(10.0, -3.0), 10.0 * 0.4f64.tan(), epsilon = 1e-14);
    assert_relative_eq!(p.height_jet(1.0, 2.0).normal().z, 0.4f64.cos(), epsilon = 1e-14);
}

#[test]
fn parameters_are_clamped() {
    let p = AnalyticSurface::new(shapes()[4], SQUARE).unwrap();
    assert_eq!(p.jet(1e9, f64::NEG_INFINITY), p.jet(20.0, -15.0));
    assert!(p.jet(f64::NAN, f64::NAN).p.iter().all(|c| c.is_finite()));
    assert!(p.covers(20.0, 25.0) && !p.covers(20.0, 25.1) && !p.covers(f64::NAN, 0.0));
}

#[test]
fn refuses_what_has_no_shape() {
    use AnalyticShape::*;
    let refused = |shape| AnalyticSurface::new(shape, SQUARE).unwrap_err();
    let name = |shape| match refused(shape) {
        AnalyticError::Parameter { name, .. } => name,
        other => panic!("{other:?}"),
    };
    assert_eq!(name(Plane { height: f64::NAN }), "height");
    assert_eq!(name(Inclined { height: 0.0, angle: 1.5, azimuth: 0.0 }), "angle");
    assert_eq!(name(Inclined { height: 0.0, angle: 1.0, azimuth: f64::INFINITY }), "azimuth");
    assert_eq!(name(Sphere { height: 0.0, radius: -1.0, concave: true }), "radius");
    assert_eq!(name(Saddle { radius_concave: 1.0, radius_convex: f64::NAN }), "radius_convex");
    assert_eq!(name(Wave { amplitude: 1.0, wavelength_x: 1.0, wavelength_y: Some(0.0) }), "wavelength_y");
    assert_eq!(name(PitAndCrest { scale: 0.0 }), "scale");
    assert!(matches!(
        refused(Sphere { height: 0.0, radius: 25.0, concave: true }),
        AnalyticError::TooSteep { .. }
    ));
    let y_axis = Cylinder { height: 0.0, radius: 20.0, azimuth: FRAC_PI_2, concave: true };
    assert!(matches!(refused(y_axis), AnalyticError::TooSteep { reach, .. } if (reach - 20.0).abs() < 1e-9));
    let sharp = Saddle { radius_concave: 1e-3, radius_convex: 1e-3 };
    assert!(matches!(AnalyticSurface::new(sharp, [[-50.0, 50.0]; 2]), Err(AnalyticError::TooHigh(_))));
    for domain in [
        [[0.0, 0.0], [0.0, 1.0]],
        [[0.0, 1.0], [1.0, 0.0]],
        [[0.0, f64::NAN], [0.0, 1.0]],
        [[0.0, 2e6], [0.0, 1.0]],
    ] {
        assert!(matches!(AnalyticSurface::new(shapes()[0], domain), Err(AnalyticError::Range { .. })));
    }
}
