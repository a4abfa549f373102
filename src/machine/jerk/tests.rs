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

/// Slow speeds on a path of a random walk, and its limits.
fn slow_section(moves: u32) -> (Limits, Vec<f64>) {
    let mut rng = sim::scenes::Rng::new(3);
    let mut stage = |k: u32| Stage {
        step: k as usize,
        length: rng.within(0.1, 0.3),
        slope: [rng.within(-1.0, 1.0), rng.within(-1.0, 1.0), 0.0, 0.0, 0.0],
        bends: std::array::from_fn(|_| [rng.within(-0.2, 0.2), 0.0, 0.0, 0.0, 0.0]),
        most: 500.0,
        along: 1000.0,
        jerk: true,
    };
    let stages: Vec<Stage> = (0..moves).map(&mut stage).collect();
    let free = [f64::INFINITY; 5];
    let axes = AxisLimits {
        rates: free,
        accelerations: std::array::from_fn(|k| if k < 2 { 900.0 } else { free[0] }),
        jerks: std::array::from_fn(|k| if k < 2 { 3e4 } else { free[0] }),
    };
    let mut speeds: Vec<f64> = (0..=moves).map(|_| rng.within(0.9, 1.1)).collect();
    (speeds[0], speeds[moves as usize]) = (0.0, 0.0);
    let limits = Limits::new(&stages, &axes, &speeds);
    let speeds = limits.section(false).inside(&speeds);
    (limits, speeds)
}

/// Whether the times by which jerk is told are fixed or their own.
#[test]
fn derivatives_of_the_barrier_are_those_of_its_values() {
    let (limits, x) = slow_section(12);
    for section in [true, false].map(|fixed| limits.section(fixed)) {
        let weight = 1e-3;
        let here = section.barrier(&x, weight).unwrap();
        assert_relative_eq!(here.value, section.value(&x, weight).unwrap(), max_relative = 1e-12);
        for k in 1..12 {
            let step = 1e-4 * x[k];
            let [ahead, behind] = [step, -step].map(|step| {
                let mut there = x.clone();
                there[k] += step;
                section.barrier(&there, weight).unwrap()
            });
            let slope = (ahead.value - behind.value) / (2.0 * step);
            assert_relative_eq!(here.gradient[k], slope, max_relative = 1e-4, epsilon = 1e-6);
        }
    }
}

/// The Hessian is that of the convex problem, in which times do not hang on speeds.
#[test]
fn the_hessian_of_the_convex_barrier_is_that_of_its_gradients() {
    let (limits, x) = slow_section(12);
    let (section, weight) = (limits.section(true), 1e-3);
    let here = section.barrier(&x, weight).unwrap();
    for k in 1..12 {
        let step = 1e-4 * x[k];
        let [ahead, behind] = [step, -step].map(|step| {
            let mut there = x.clone();
            there[k] += step;
            section.barrier(&there, weight).unwrap().gradient
        });
        for row in k..12 {
            let slope = (ahead[row] - behind[row]) / (2.0 * step);
            let got = if row - k < 3 { here.hessian[row][row - k] } else { 0.0 };
            assert_relative_eq!(got, slope, max_relative = 1e-4, epsilon = 1e-6 * here.hessian[k][0]);
        }
    }
}

/// A part has all limits that hang on its free speeds: its barrier changes with them as that of the whole.
#[test]
fn the_barrier_of_a_part_changes_as_that_of_the_whole() {
    let (limits, x) = slow_section(20);
    for whole in [true, false].map(|fixed| limits.section(fixed)) {
        for range in [0..20, 0..7, 5..11, 13..20] {
            let (part, weight) = (whole.part(range.clone()), 1e-2);
            assert!(!part.free().is_empty());
            for k in part.free() {
                let mut other = x.clone();
                other[range.start + k] *= 1.01;
                let change = |section: &Section<'_>, of: Range<usize>| {
                    let [before, after] =
                        [&x, &other].map(|x| section.value(&x[of.clone()], weight).unwrap());
                    after - before
                };
                let [one, all] = [change(&part, range.start..range.end + 1), change(&whole, 0..21)];
                assert_relative_eq!(one, all, max_relative = 1e-6, epsilon = 1e-12);
            }
        }
    }
}
