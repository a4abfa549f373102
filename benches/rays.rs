//! What normal rays cost: 200,000 of them from a wave of 100 x 100 mm against 100,000 moves, with a ball
//! and a bull nose of radius 3 mm, upright and leading by 15 degrees against the surface's normal.
//! `DIVAN_…` and `RAYON_NUM_THREADS` apply; divan prints the rates (items are rays, or moves).

use divan::Bencher;
use divan::counter::ItemsCount;
use millstream::cutter::{Cutter, Solid};
use millstream::geometry::{Point3, Vector3};
use millstream::monitor::Silent;
use millstream::motion::{ClPoint, Move, MoveKind, Toolpath};
use millstream::parallel;
use millstream::sim::Rays;

/// Side of the part, mm.
const SIDE: f64 = 100.0;
const STEPOVER: f64 = 0.5;
const CHORD: f64 = 0.2;
const RAYS: usize = 447;
const LEAD: f64 = 15.0;

fn main() {
    divan::main();
}

/// A place of `z = 2 sin(x/8) cos(y/10)`, its normal and the way along x; of the level for a flat end,
/// where hundreds of moves are equally low.
fn surface(cutter: &Cutter, x: f64, y: f64) -> (Point3, Vector3, Vector3) {
    if cutter.is_flat() {
        return (Point3::new(x, y, 0.0), Vector3::z(), Vector3::x());
    }
    let slope = [0.25 * (x / 8.0).cos() * (y / 10.0).cos(), -0.2 * (x / 8.0).sin() * (y / 10.0).sin()];
    let p = Point3::new(x, y, 2.0 * (x / 8.0).sin() * (y / 10.0).cos());
    let normal = Vector3::new(-slope[0], -slope[1], 1.0).normalize();
    (p, normal, Vector3::new(1.0, 0.0, slope[0]).normalize())
}

/// Where the tool stands that touches the wave at `(x, y)`.
fn location(cutter: &Cutter, x: f64, y: f64, lead: Option<f64>) -> ClPoint {
    let (p, n, along) = surface(cutter, x, y);
    let axis = lead.map_or(Vector3::z(), |lead| n * lead.cos() + along * lead.sin());
    let (corner, flat) = (cutter.corner_radius(), cutter.flat_radius());
    let outward = -(n - axis * n.dot(&axis)).try_normalize(1e-9).unwrap_or_else(Vector3::zeros);
    ClPoint { tip: p + n * corner - outward * flat - axis * corner, axis }
}

fn path(cutter: &Cutter, lead: Option<f64>) -> Toolpath {
    let (rows, steps) = ((SIDE / STEPOVER) as usize + 1, (SIDE / CHORD) as usize);
    let at = |j: usize, i: usize| location(cutter, i as f64 * CHORD, j as f64 * STEPOVER, lead);
    let row = |j: usize| (0..=steps).map(move |k| at(j, if j.is_multiple_of(2) { k } else { steps - k }));
    let mut moves =
        (0..rows).flat_map(row).map(|to| Move { to, kind: MoveKind::Cut, feed_rate: 1000.0, pass: 0 });
    let start = moves.next().expect("a pass has places").to;
    Toolpath::new(start, moves.collect())
}

fn tool(name: &str) -> (Cutter, Option<f64>) {
    let cutter = match &name[..4] {
        "ball" => Cutter::ball(6.0),
        "bull" => Cutter::bull(6.0, 1.0),
        _ => Cutter::flat(6.0),
    };
    (cutter.expect("valid dimensions"), name.ends_with("leading").then_some(LEAD.to_radians()))
}

#[divan::bench(sample_count = 3, args = ["ball", "bull", "ball leading", "bull leading", "flat"])]
fn deviations(bencher: Bencher, name: &str) {
    let (cutter, lead) = tool(name);
    let solid = Solid::of_cutter(&cutter, None);
    let rays = Rays::new(&path(&cutter, lead), &solid, &Silent).expect("no opposite axes");
    let at = |k: usize| {
        let place = |i: usize| SIDE * (i as f64 + 0.5) / RAYS as f64;
        surface(&cutter, place(k % RAYS), place(k / RAYS))
    };
    let points: Vec<Point3> = (0..RAYS * RAYS).map(|k| at(k).0).collect();
    let normals: Vec<Vector3> = (0..RAYS * RAYS).map(|k| at(k).1).collect();
    // Each ray begins with the move that was found by the one before.
    let of_row = |row: usize| {
        let mut seed = None;
        let hit = |k: usize| {
            let found = rays.deviation_near(&points[k], &normals[k], [1.0, 1.0], seed);
            seed = found.map(|(_, slot)| slot).or(seed);
            found.map(|(hit, _)| hit)
        };
        (row * RAYS..(row + 1) * RAYS).map(hit).collect::<Vec<_>>()
    };
    bencher.counter(ItemsCount::new(points.len())).bench(|| parallel::map(RAYS, of_row));
}

#[divan::bench(sample_count = 3, args = ["ball", "ball leading"])]
fn tree(bencher: Bencher, name: &str) {
    let (cutter, lead) = tool(name);
    let (solid, path) = (Solid::of_cutter(&cutter, None), path(&cutter, lead));
    bencher
        .counter(ItemsCount::new(path.len()))
        .bench(|| Rays::new(&path, &solid, &Silent).expect("no opposite axes"));
}
