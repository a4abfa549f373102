//! Closed forms of boxes and cylinders, and random motion against dense samples.

use super::*;
use crate::samples::*;
use cutter::{Cutter, Holder, HolderSection};
use work::monitor::Silent;

fn shifted(x: f64, y: f64, z: f64) -> Isometry3 {
    Isometry3::translation(x, y, z)
}

fn least(body: &Body, obstacle: &Obstacle<'_>, ends: &[Ends]) -> LeastClearance {
    obstacle.least_clearance_of_body(body, ends.len(), &|k| ends[k], &Silent).unwrap().unwrap()
}

fn near(found: &LeastClearance, expected: f64) {
    assert!((found.nearest.distance - expected).abs() <= found.error_bound + 1e-9, "{found:?} {expected}");
}

#[test]
fn planted_distances_of_boxes_and_cylinders_are_found() {
    let (post, tree) = block([12.0, -1.0, -50.0], [14.0, 1.0, 5.0]);
    let post = Obstacle::new(&post, &tree);
    // A box that runs along y beside the post, 0.05 mm away and 0.05 mm in.
    let head = Body::block(Point3::new(-4.0, -3.0, 0.0), Point3::new(4.0, 3.0, 8.0)).unwrap();
    for gap in [0.05, -0.05] {
        let ends = [shifted(8.0 - gap, -30.0, 0.0), shifted(8.0 - gap, 30.0, 0.0)];
        let found = least(&head, &post, &[ends]);
        near(&found, gap);
        assert!(found.error_bound < 0.01 && (found.nearest.place.x - 12.0).abs() < 0.06, "{found:?}");
    }
    // It turns about z beside the post, so that an edge comes by: the half diagonal is 5.
    let turned = |angle: f64, x: f64| shifted(x, 0.0, 0.0) * Isometry3::rotation(Vector3::z() * angle);
    let swing = |x: f64| [turned(0.0, x), turned(1.3, x)];
    near(&least(&head, &post, &[swing(6.95)]), 0.05);
    // Into the post by 0.05, and 1/(0.8 + 0.6) of it from both of the box' sides that meet there.
    near(&least(&head, &post, &[swing(7.05)]), -0.05 / 1.4);
    // A cylinder that lies along x over the post's top.
    let lying = Body::cylinder(Point3::new(-20.0, 0.0, 0.0), Point3::new(20.0, 0.0, 0.0), 6.0).unwrap();
    near(&least(&lying, &post, &[[shifted(0.0, -9.0, 8.05), shifted(0.0, 9.0, 8.05)]]), 0.05);
    near(&least(&lying, &post, &[[shifted(0.0, -9.0, 7.95), shifted(0.0, 9.0, 7.95)]]), -0.05);
    // From above, and pointing down.
    let down = Body::cylinder(Point3::new(0.0, 0.0, 9.0), Point3::new(0.0, 0.0, 2.0), 6.0).unwrap();
    near(&least(&down, &post, &[[shifted(13.0, 0.0, 9.0), shifted(13.0, 0.0, 4.0)]]), 1.0);
}

#[test]
fn bodies_as_meshes_hold_the_bodies() {
    let (from, to) = (Point3::new(1.0, 2.0, 3.0), Point3::new(4.0, -2.0, 9.0));
    let cylinder = Body::cylinder(from, to, 30.0).unwrap();
    let (mesh, off) = cylinder.mesh().unwrap();
    assert!(mesh.is_closed() && off < 2e-4, "{off}");
    let along = (to - from).normalize();
    for vertex in mesh.vertices() {
        let out = (vertex - from).cross(&along).norm();
        assert!(out < 1e-9 || (out - 15.0 - off).abs() < 1e-9, "{out}");
    }
    let block = Body::block(from, to).unwrap();
    let (mesh, off) = block.mesh().unwrap();
    let bounds = mesh.bounds();
    assert!(mesh.is_closed() && off == 0.0);
    assert!((bounds.min - Point3::new(1.0, -2.0, 3.0)).norm() < 1e-12, "{bounds:?}");
    assert!((block.reach() - 0.5 * (to - from).norm()).abs() < 1e-12);
    assert!((block.middle() - nalgebra::center(&from, &to)).norm() < 1e-12);
    assert!(Body::block(from, Point3::new(1.0, 5.0, 9.0)).is_none());
    assert!(Body::cylinder(from, from, 30.0).is_none());
}

fn bodies() -> Vec<Body> {
    let holder = Holder::new(
        8.0,
        vec![
            HolderSection { diameter: 6.0, top_diameter: 9.0, length: 4.0 },
            HolderSection { diameter: 14.0, top_diameter: 14.0, length: 6.0 },
        ],
    );
    let tool = Solid::of_tool(&Cutter::bull(6.0, 1.0).unwrap(), &holder.unwrap());
    vec![
        Body::block(Point3::new(-3.0, -2.0, -1.0), Point3::new(3.0, 2.0, 6.0)).unwrap(),
        Body::block(Point3::new(0.0, 1.0, 2.0), Point3::new(9.0, 1.5, 2.2)).unwrap(),
        Body::cylinder(Point3::new(2.0, 0.0, 1.0), Point3::new(-3.0, 4.0, 1.0), 5.0).unwrap(),
        Body::tool(tool, Point3::new(0.0, 0.0, -3.0)),
    ]
}

/// A triangle of a sheet against many of its places.
#[test]
fn boxes_are_as_far_from_triangles_as_samples_say() {
    let mut numbers = Numbers(5);
    let mut inside = 0;
    for round in 0..600 {
        let half = [0, 1, 2].map(|_| numbers.within(0.1, 4.0));
        let piece = BodyPiece::Block {
            middle: numbers.point(2.0),
            turn: Rotation3::from_scaled_axis(numbers.direction() * numbers.within(0.0, 3.0)),
            half: Vector3::from(half),
        };
        let corners = [0, 1, 2].map(|_| numbers.point(if round % 2 == 0 { 6.0 } else { 3.0 }));
        let found = piece.nearest_on(&corners, 1e3).unwrap();
        assert!((piece.sample(&found.point).distance - found.distance).abs() < 1e-9);
        let sides = [corners[1] - corners[0], corners[2] - corners[0]];
        let mut least = f64::INFINITY;
        for i in 0..=80u32 {
            for j in 0..=80 - i {
                let q = corners[0] + sides[0] * (f64::from(i) / 80.0) + sides[1] * (f64::from(j) / 80.0);
                least = least.min(piece.sample(&q).distance);
            }
        }
        let spacing = sides[0].norm().max(sides[1].norm()) / 80.0;
        assert!(found.distance <= least + 1e-9, "{round}: {} {least}", found.distance);
        assert!(found.distance >= least - spacing, "{round}: {} {least}", found.distance);
        inside += usize::from(found.distance < 0.0);
        let (normal, off) = piece.off_plane(&corners);
        assert!(off <= found.distance + 1e-9 && (normal.norm() - 1.0).abs() < 1e-12);
    }
    assert!(inside > 100, "{inside}");
}

#[test]
fn sampled_times_find_nothing_nearer() {
    let (field, tree) = sheet(40.0, 24, |x, y| 3.0 * (0.3 * x).sin() * (0.2 * y).cos());
    let wave = Obstacle::new(&field, &tree);
    let (bodies, mut numbers) = (bodies(), Numbers(31));
    let mut clear = 0;
    for round in 0..80 {
        let body = &bodies[round % bodies.len()];
        let mut at = || {
            let turn = numbers.direction() * numbers.within(0.0, 1.4);
            Isometry3::new((numbers.point(7.0) + Vector3::z() * 9.0).coords, turn)
        };
        let moves: Vec<Ends> = (0..4).map(|_| [at(), at()]).collect();
        let found = least(body, &wave, &moves);
        let mut sampled = f64::INFINITY;
        for ends in &moves {
            let moving = BodyMove::new(body, ends);
            for k in 0..=200 {
                for index in 0..moving.pieces() {
                    let mut best = None;
                    wave.nearest(&moving.piece(index, f64::from(k) / 200.0), 1e3, &mut best);
                    sampled = sampled.min(best.unwrap().distance);
                }
            }
        }
        assert!(found.nearest.distance <= sampled + found.error_bound, "{round}: {found:?} {sampled}");
        // Half a sample farther on nothing is much nearer.
        assert!(found.nearest.distance >= sampled - 0.3, "{round}: {found:?} {sampled}");
        clear += usize::from(found.nearest.distance > 0.0);
    }
    assert!((10..70).contains(&clear), "{clear}");
}
