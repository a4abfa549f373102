//! Heights against the closed forms and engines for upright tools.

use super::*;
use crate::{Envelope, cut_reference};

/// Distances of heights from the envelope at places inside of a square, in rising order.
fn errors(cutter: &Cutter, path: &Toolpath, size: f64, voxel: f64) -> Vec<f64> {
    let stock = block([0.0, 0.0, -6.0], [size, size, 4.0]);
    let solid = Solid::of_cutter(cutter, None);
    let engine = VoxelEngine::new(&stock, &solid, path).unwrap();
    let voxels = engine.cut(voxel, MEMORY, &Silent).unwrap();
    let (envelope, all) = (Envelope::new(cutter, path), (0..path.len() as u32).collect::<Vec<_>>());
    let mut rng = Rng::new(17);
    let mut error = |_| {
        let (x, y) = (rng.within(0.5, size - 0.5), rng.within(0.5, size - 0.5));
        let exact = envelope.lowest(x, y, &all).map_or(4.0, |f| f.0.min(4.0));
        (voxels.height(x, y).unwrap() - exact).abs()
    };
    let mut errors: Vec<f64> = (0..3000).map(&mut error).collect();
    errors.sort_by(f64::total_cmp);
    errors
}

#[test]
fn heights_are_those_of_the_z_map() {
    let (size, voxel) = (12.0, 0.2);
    for cutter in [Cutter::ball(6.0).unwrap(), Cutter::bull(6.0, 1.0).unwrap()] {
        let errors = errors(&cutter, &wave_path(size, 0.6, 0.8), size, voxel);
        let (worst, mean) = (errors[errors.len() - 1], errors.iter().sum::<f64>() / errors.len() as f64);
        // Curvature within a voxel, and ridges of at most 0.25 rad.
        let bound = voxel * voxel / 8.0 + 0.5 * voxel * 0.13;
        assert!(worst < bound && mean < 0.2 * bound, "{cutter:?}: {worst} {mean}");
    }
}

#[test]
fn a_finished_wave_is_resolved_to_a_micrometre() {
    let path = wave_path(12.0, 0.3, 1.0);
    let fine = errors(&Cutter::ball(6.0).unwrap(), &path, 12.0, 0.1);
    let mean = fine.iter().sum::<f64>() / fine.len() as f64;
    let most = fine[fine.len() * 99 / 100];
    assert!(mean < 1e-3 && most < 6e-3, "{mean} {most}");
    // Of second order in the voxel but for the ridges.
    let coarse = errors(&Cutter::ball(6.0).unwrap(), &path, 12.0, 0.2);
    let ratio = coarse.iter().sum::<f64>() / coarse.len() as f64 / mean;
    assert!(ratio > 2.5 && ratio < 5.0, "{ratio}");
}

#[test]
fn flat_floors_and_faces_are_exact() {
    let stock = block([0.0, 0.0, 0.0], [10.0, 8.0, 5.0]);
    let flat = Solid::of_cutter(&Cutter::flat(6.0).unwrap(), None);
    let path = path_through([Point3::new(-5.0, 2.0, 3.123), Point3::new(15.0, 2.0, 3.123)]);
    let voxels = VoxelEngine::new(&stock, &flat, &path).unwrap().cut(0.3, MEMORY, &Silent).unwrap();
    for (x, y, z) in [(3.3, 3.3, 3.123), (5.0, 1.0, 3.123), (5.0, 7.0, 5.0), (1.234, 6.1, 5.0)] {
        let got = voxels.height(x, y).unwrap();
        assert!((got - z).abs() < 2e-5, "{got} at {x} {y}");
    }
    assert_eq!(voxels.height(11.0, 1.0), None);
    let ground = ZMap::block(crate::scenes::square_grid(8.0, 0.5), 5.0);
    let cut = cut_reference(&ground, &Cutter::flat(6.0).unwrap(), &path, &Silent).unwrap();
    let grid = &cut.grid;
    for (k, h) in cut.height.iter().enumerate() {
        let at = grid.centre(k % grid.nx, k / grid.nx);
        // Not within a voxel of the wall at y = 5 and of the border.
        if (at.y - 5.0).abs() > 0.4 && at.x.min(at.y) > 0.4 && at.y < 7.6 {
            assert!((voxels.height(at.x, at.y).unwrap() - f64::from(*h)).abs() < 2e-5, "{at} {h}");
        }
    }
}

#[test]
fn a_hole_from_the_side_is_an_undercut() {
    let stock = block([-10.0, -8.0, -6.0], [10.0, 8.0, 6.0]);
    let flat = Solid::of_cutter(&Cutter::flat(6.0).unwrap(), None);
    let at = |x: f64| ClPoint { tip: Point3::new(x, 0.3, 0.2), axis: -Vector3::x() };
    let path = through(&[at(-20.0), at(-6.03)]);
    let exact = PI * 9.0 * 3.97;
    let got = removed(&flat, &stock, &path, 0.1);
    assert!((got - exact).abs() < 2e-3 * exact, "{got} {exact}");
    let voxels = VoxelEngine::new(&stock, &flat, &path).unwrap().cut(0.1, MEMORY, &Silent).unwrap();
    assert!((voxels.height(-8.0, 0.3).unwrap() - 6.0).abs() < 1e-5);
}
