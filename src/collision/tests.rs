//! Distances against closed forms and brute force.

use super::samples::*;
use super::*;
use cutter::Cutter;
use geometry::Vector3;

/// The least over a solid's pieces.
fn distance(solid: &Solid, at: &ClPoint, q: &Point3) -> f64 {
    (0..solid.pieces())
        .map(|index| ToolPiece { solid, index, at: *at }.sample(q).distance)
        .fold(f64::INFINITY, f64::min)
}

#[test]
fn planes_spheres_and_corners_have_closed_forms() {
    let (floor, tree) = sheet(200.0, 3, |_, _| 0.0);
    let floor = Obstacle::new(&floor, &tree);
    let (sin, cos) = 0.4f64.sin_cos();
    let axis = Vector3::new(0.8 * sin, -0.6 * sin, cos);
    let at = ClPoint { tip: Point3::new(3.0, 1.0, 7.0), axis };
    let near = |solid: &Solid| floor.clearance(solid, &at, 100.0).unwrap();
    close(near(&Solid::of_cutter(&Cutter::ball(6.0).unwrap(), None)).distance, 7.0 + 3.0 * cos - 3.0);
    let flat = near(&Solid::of_cutter(&Cutter::flat(6.0).unwrap(), None));
    close(flat.distance, 7.0 - 3.0 * sin);
    let toe = at.tip + Vector3::new(0.8 * cos, -0.6 * cos, -sin) * 3.0;
    assert!((flat.place - Point3::new(toe.x, toe.y, 0.0)).norm() < 1e-6);
    close(
        near(&Solid::of_cutter(&Cutter::bull(6.0, 1.0).unwrap(), None)).distance,
        7.0 + cos - 2.0 * sin - 1.0,
    );
    // A shank as wide as 6 mm begins 10 mm above the tip, a wider section 30 mm above it.
    let held = near(&Solid::of_holder(&holder(10.0))).distance;
    let low = |height: f64, radius: f64| 7.0 + height * cos - radius * sin;
    close(held, low(10.0, 3.0).min(low(30.0, 8.0)).min(low(45.0, 20.0)));
    // Upright flat on a level floor, any place is the nearest.
    let flat = Solid::of_cutter(&Cutter::flat(6.0).unwrap(), None);
    close(
        floor.clearance(&flat, &ClPoint::upright(Point3::new(1.0, 2.0, 0.25)), 1.0).unwrap().distance,
        0.25,
    );
    // Pressed 0.1 mm into the floor, also away from all vertices.
    for solid in [flat, Solid::of_cutter(&Cutter::ball(6.0).unwrap(), None)] {
        let pressed = ClPoint::upright(Point3::new(1.0, 2.0, -0.1));
        close(floor.clearance(&solid, &pressed, 1.0).unwrap().distance, -0.1);
    }

    let (cube, tree) = block([-5.0; 3], [5.0; 3]);
    let cube = Obstacle::new(&cube, &tree);
    // The corner of a box and a ball; its edge and the side of the cylinder above the ball.
    let ball = Solid::of_cutter(&Cutter::ball(6.0).unwrap(), None);
    let away = Vector3::new(1.0, 2.0, 2.0) / 3.0;
    let centre = Point3::new(5.0, 5.0, 5.0) + away * 4.0;
    let hit = cube.clearance(&ball, &ClPoint::upright(centre - Vector3::z() * 3.0), 10.0).unwrap();
    close(hit.distance, 1.0);
    assert!((hit.place - Point3::new(5.0, 5.0, 5.0)).norm() < 1e-6);
    let beside = cube.clearance(&ball, &ClPoint::upright(Point3::new(8.0, 9.0, -8.0)), 10.0).unwrap();
    close(beside.distance, 2.0);
    assert!(cube.clearance(&ball, &ClPoint::upright(Point3::new(8.0, 9.0, -8.0)), 2.0).is_none());
    assert!(cube.some_nearer(&ball, &ClPoint::upright(Point3::new(8.0, 9.0, -8.0)), 2.000_001).is_some());
}

#[test]
fn brute_force_by_division_finds_the_same() {
    let (solids, mut numbers) = (solids(), Numbers(77));
    let mut inside = 0;
    for round in 0..2000 {
        let solid = &solids[round % solids.len()];
        let [_, top] = solid.heights();
        let at = ClPoint { tip: numbers.point(4.0), axis: numbers.direction() };
        // From tiny triangles to some that the tool fits into.
        let size = 10f64.powf(numbers.within(-1.5, 1.5));
        let near = at.tip
            + at.axis * numbers.within(-2.0, top.min(40.0))
            + numbers.direction() * numbers.within(0.0, 15.0);
        let corners = [0; 3].map(|_| near + numbers.point(size).coords);
        let area = (corners[1] - corners[0]).cross(&(corners[2] - corners[0])).norm();
        if area < 1e-3 * size * size {
            continue;
        }
        let (mesh, tree) = mesh(corners.to_vec(), vec![[0, 1, 2]]);
        let hit = Obstacle::new(&mesh, &tree).clearance(solid, &at, f64::INFINITY).unwrap();
        inside += usize::from(hit.distance < 0.0);
        close(distance(solid, &at, &hit.place), hit.distance);
        let least = brute(&|q| distance(solid, &at, q), &corners);
        assert!(
            (hit.distance - least).abs() < 1e-6 && hit.distance < least + 1e-9,
            "{round}: {} {least}",
            hit.distance
        );
        assert!(Obstacle::new(&mesh, &tree).some_nearer(solid, &at, hit.distance + 1e-8).is_some());
        assert!(Obstacle::new(&mesh, &tree).some_nearer(solid, &at, hit.distance - 1e-8).is_none());
    }
    assert!((300..1700).contains(&inside), "{inside} of 2000 inside");
}

/// Least over a triangle by dividing it: what lies above the least found, by the distance growing no faster
/// than the way, is left out.
fn brute(d: &dyn Fn(&Point3) -> f64, corners: &[Point3; 3]) -> f64 {
    let mut waiting = vec![*corners];
    let mut least = f64::INFINITY;
    while !waiting.is_empty() {
        let mut next: Vec<(f64, [Point3; 3])> = Vec::new();
        for t in &waiting {
            let c = middle(t);
            let value = d(&c);
            least = t.iter().map(d).fold(least.min(value), f64::min);
            let reach = t.iter().map(|p| (p - c).norm()).fold(0.0, f64::max);
            next.push((value - reach, *t));
        }
        next.retain(|(bound, t)| *bound < least && (t[1] - t[0]).norm() + (t[2] - t[0]).norm() > 1e-8);
        // On flat ground all parts are as good: the lowest few carry on.
        next.sort_by(|a, b| a.0.total_cmp(&b.0));
        next.truncate(300);
        waiting = next.iter().flat_map(|(_, t)| halves(t)).collect();
    }
    least
}

fn halves([a, b, c]: &[Point3; 3]) -> [[Point3; 3]; 4] {
    let half = |p: &Point3, q: &Point3| nalgebra::center(p, q);
    let (ab, bc, ca) = (half(a, b), half(b, c), half(c, a));
    [[*a, ab, ca], [ab, *b, bc], [ca, bc, *c], [ab, bc, ca]]
}

#[test]
fn a_mesh_is_the_least_of_its_triangles() {
    let (field, tree) = sheet(40.0, 30, |x, y| 3.0 * (0.3 * x).sin() * (0.2 * y).cos());
    let wave = Obstacle::new(&field, &tree);
    let (solids, mut numbers) = (solids(), Numbers(5));
    for round in 0..300 {
        let solid = &solids[round % solids.len()];
        let at = ClPoint { tip: numbers.point(12.0), axis: numbers.direction() };
        let one = |t: usize, index: usize| {
            ToolPiece { solid, index, at }.nearest_on(&field.corners(t), f64::INFINITY).unwrap().distance
        };
        let all = (0..field.triangles().len()).flat_map(|t| (0..solid.pieces()).map(move |k| (t, k)));
        let least = all.map(|(t, k)| one(t, k)).fold(f64::INFINITY, f64::min);
        close(wave.clearance(solid, &at, f64::INFINITY).unwrap().distance, least);
        assert!(wave.clearance(solid, &at, least - 1e-9).is_none());
    }
}
