//! The machining time of a spiral over a dish, 2 m in chords of 0.3 mm: with accelerations of the axes alone,
//! and with their jerks.

use millstream::geometry::Point3;
use millstream::machine::{Machine, machining_time};
use millstream::monitor::Silent;
use millstream::motion::{ClPoint, Move, MoveKind, Toolpath};

const CHORDS: u32 = 6700;

fn main() {
    divan::main();
}

/// Turns lie 1 mm apart.
fn spiral() -> Toolpath {
    let at = |k: u32| {
        let angle = (4.0 * std::f64::consts::PI * 0.3 * f64::from(k)).sqrt();
        let radius = angle / (2.0 * std::f64::consts::PI);
        let height = 0.01 * radius * radius + 0.2 * (3.0 * angle).sin();
        ClPoint::upright(Point3::new(radius * angle.cos(), radius * angle.sin(), height))
    };
    let one = |k: u32| Move { to: at(k), kind: MoveKind::Cut, feed_rate: 2000.0, pass: 0 };
    Toolpath::new(at(0), (1..=CHORDS).map(one).collect())
}

#[divan::bench(args = [f64::INFINITY, 50_000.0], sample_count = 5)]
fn two_metres_of_a_spiral(bencher: divan::Bencher, jerk: f64) {
    let machine = Machine { accelerations: [4000.0, 4000.0, 2500.0], jerks: [jerk; 3], ..Machine::default() };
    let path = spiral();
    bencher.bench(|| machining_time(&path, &machine, &Silent).unwrap());
}
