//! A wave milled in passes, for the benchmarks of engines. mm.

use millstream::cutter::Cutter;
use millstream::geometry::{Point2, Point3};
use millstream::motion::{ClPoint, Move, MoveKind, Toolpath};
use millstream::sim::{Grid, ZMap};

/// Radius of every cutter here.
pub const RADIUS: f64 = 3.0;

/// Passes along x, forth and back over a square, of a ball that touches z = 2 sin(x/8) cos(y/10).
pub fn wave([low, high]: [f64; 2], stepover: f64, chord: f64) -> Toolpath {
    let (rows, steps) =
        (((high - low) / stepover) as usize + 1, ((high - low) / chord).round().max(1.0) as usize);
    let tip = |i: usize, j: usize| {
        let (x, y) = (low + i as f64 * chord, low + j as f64 * stepover);
        let slope_x = 0.25 * (x / 8.0).cos() * (y / 10.0).cos();
        let slope_y = -0.2 * (x / 8.0).sin() * (y / 10.0).sin();
        let shift = RADIUS / (1.0 + slope_x * slope_x + slope_y * slope_y).sqrt();
        let z = 2.0 * (x / 8.0).sin() * (y / 10.0).cos() + shift - RADIUS;
        ClPoint::upright(Point3::new(x - shift * slope_x, y - shift * slope_y, z))
    };
    let pass = |j: usize| (0..=steps).map(move |k| tip(if j.is_multiple_of(2) { k } else { steps - k }, j));
    let mut moves =
        (0..rows).flat_map(pass).map(|to| Move { to, kind: MoveKind::Cut, feed_rate: 1000.0, pass: 0 });
    let start = moves.next().expect("a pass has places").to;
    Toolpath::new(start, moves.collect())
}

/// A block over a square, higher than the wave.
pub fn block([low, high]: [f64; 2], cell: f64) -> ZMap {
    let n = ((high - low) / cell).round() as usize;
    let origin = Point2::new(low + 0.5 * cell, low + 0.5 * cell);
    ZMap::block(Grid { origin, cell, nx: n, ny: n }, 5.0)
}

/// One cutter of each family.
pub fn cutter(name: &str) -> Cutter {
    let made = match name {
        "ball" => Cutter::ball(2.0 * RADIUS),
        "flat" => Cutter::flat(2.0 * RADIUS),
        "bull" => Cutter::bull(2.0 * RADIUS, 1.0),
        _ => Cutter::taper(2.0, 1.0, 10f64.to_radians(), 2.0 * RADIUS),
    };
    made.expect("valid dimensions")
}
