//! Closed forms of straight lines, and the limits by differences.

use super::super::fixture::{machine, path};
use super::super::{Machine, machining_time};
use super::*;
use approx::assert_relative_eq;
use proptest::prelude::*;
use work::monitor::Silent;

const FREE: Machine = machine(1e12);

/// Along x.
fn line(length: f64, machine: &Machine) -> f64 {
    machining_time(&path([[0.0; 3], [length, 0.0, 0.0]]), machine, &Silent).unwrap()
}

#[test]
fn a_way_from_rest_to_rest_has_seven_pieces_or_fewer() {
    // 100 mm/s, 1000 mm/s², 10⁴ mm/s³: 0.1 s of jerk each, 0.2 s and 10 mm to the rate.
    assert_relative_eq!(from_rest_to_rest(100.0, 100.0, 1000.0, 1e4), 1.2);
    // Without reaching the acceleration: s = 2·j·(t/4)³.
    assert_relative_eq!(from_rest_to_rest(2.0, 100.0, 1000.0, 1e3), 4.0 * 1e-3f64.cbrt());
    // Without reaching the rate: both halves v²/(2a) + v·a/(2j) of 9 mm.
    let peak = 0.5 * (1e4 + 4.0 * 1000.0 * 18.0f64).sqrt() - 50.0;
    let way = peak * (peak / 1000.0 + 0.05);
    assert_relative_eq!(
        from_rest_to_rest(way, 1e3, 1000.0, 2e4),
        2.0 * (peak / 1000.0 + 0.05),
        max_relative = 1e-12
    );
    assert_relative_eq!(from_rest_to_rest(10.0, 100.0, 1000.0, f64::INFINITY), 0.2);
    assert_relative_eq!(ramp(100.0, 1000.0, 1e4), 0.2);
    assert_relative_eq!(ramp(10.0, 1000.0, 1e3), 0.2);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    /// Along a line all limits act along it.
    #[test]
    fn a_line_takes_the_time_of_its_closed_form(
        length in 0.5..300.0f64, acceleration in 200.0..5000.0f64, jerk in 1e3..2e5f64, feed in 500.0..12_000.0f64,
    ) {
        let infinite = f64::INFINITY;
        let own = Machine {
            acceleration: 1e6,
            accelerations: [acceleration, infinite, infinite],
            jerks: [jerk, infinite, infinite],
            rates: [feed, infinite, infinite],
            ..FREE
        };
        let feed = feed.min(6000.0) / 60.0;
        let exact = from_rest_to_rest(length, feed, acceleration, jerk);
        let got = line(length, &own);
        prop_assert!((got / exact - 1.0).abs() < 0.02, "{got} {exact}");
    }
}

/// A long way at a low feed: ramps are a thousandth of it, and slowing down in them would win time for jerk.
#[test]
fn ramps_of_a_long_line_are_not_slowed_down_to_gain_time_for_jerk() {
    let infinite = f64::INFINITY;
    let own = Machine {
        acceleration: 1e6,
        accelerations: [2892.3, infinite, infinite],
        jerks: [137_253.5, infinite, infinite],
        rates: [500.0, infinite, infinite],
        ..FREE
    };
    let exact = from_rest_to_rest(293.74, 500.0 / 60.0, 2892.3, 137_253.5);
    assert!((line(293.74, &own) / exact - 1.0).abs() < 0.02);
}

/// Chords of a random walk, with corners.
fn walk(length: f64, moves: u32) -> Vec<[f64; 3]> {
    let mut rng = sim::scenes::Rng::new(9);
    let (mut at, mut heading) = ([0.0f64; 3], 0.0f64);
    let mut tips = vec![at];
    for _ in 0..moves {
        heading += rng.within(-0.8, 0.8);
        let way = length * rng.within(0.5, 1.5);
        at = [at[0] + way * heading.cos(), at[1] + way * heading.sin(), at[2] + way * rng.within(-0.1, 0.1)];
        tips.push(at);
    }
    tips
}

/// Four times the way takes about four times the time: a search that is stuck in one place stays slow
/// everywhere.
#[test]
fn the_search_does_not_get_stuck_on_long_paths() {
    let own =
        Machine { acceleration: 1e6, accelerations: [1500.0, 1200.0, 900.0], jerks: [5e4, 4e4, 3e4], ..FREE };
    let seconds = |moves: u32| {
        let path = path(walk(0.3, moves));
        let length: f64 = path.segments().map(|(a, b, _)| (b - a).norm()).sum();
        machining_time(&path, &own, &Silent).unwrap() / length
    };
    let [short, long] = [1500, 6000].map(seconds);
    assert!((long / short - 1.0).abs() < 0.05, "{short} {long}");
}

#[test]
fn a_search_can_be_stopped() {
    struct Stop;
    impl Monitor for Stop {
        fn cancelled(&self) -> bool {
            true
        }
    }
    let own = Machine { jerks: [5e4, 4e4, 3e4], ..FREE };
    assert_eq!(machining_time(&path(walk(1.0, 20)), &own, &Stop), Err(Cancelled));
}
