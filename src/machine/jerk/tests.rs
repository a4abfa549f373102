//! Closed forms of straight lines, and the limits by differences.

use super::super::fixture::{machine, path};
use super::super::{Machine, machining_time};
use super::*;
use approx::assert_relative_eq;
use proptest::prelude::*;

const FREE: Machine = machine(1e12);

/// Along x.
fn line(length: f64, machine: &Machine) -> f64 {
    machining_time(&path([[0.0; 3], [length, 0.0, 0.0]]), machine)
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
