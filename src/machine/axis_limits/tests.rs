//! Closed forms, accelerations by differences, and the quickest speeds of all by trying them.

use super::super::fixture::{machine, path};
use super::*;
use crate::kinematics::{Following, PRESETS, follow, preset};
use approx::assert_relative_eq;
use geometry::{Point3, Vector3};
use motion::{ClPoint, Move, MoveKind};

const MACHINE: Machine = machine(1e12);

fn kinematics(name: &str, accelerations: [f64; 3], rotary: f64) -> Kinematics {
    let [mut first, mut second] = preset(name).unwrap();
    for axis in [&mut first, &mut second] {
        (axis.point, axis.acceleration) = (Point3::new(20.0, -30.0, -60.0), rotary);
    }
    let made = Kinematics::new(first, second, 100.0, Point3::new(5.0, 6.0, 7.0), [None; 3]).unwrap();
    made.with_rates([150.0, 200.0, 250.0]).with_accelerations(accelerations)
}

fn time(path: &Toolpath, machine: &Machine, kinematics: &Kinematics, following: &Following) -> f64 {
    let joints = follow(kinematics, path, following).unwrap();
    machining_time_of_axes(path, machine, kinematics, &joints)
}

const EVENLY: Following = Following { tip: 0.01, axis: 1e-3 };

/// Along y by the slow axis, at the feed of 100 mm/s.
#[test]
fn the_axis_that_moves_sets_the_acceleration() {
    let machine_of = |y: f64| kinematics("ac-head", [1e4, y, 1e4], 50.0);
    let line = path([[0.0; 3], [0.0, 100.0, 0.0]]);
    let quick = time(&line, &MACHINE, &machine_of(1e4), &EVENLY);
    assert_relative_eq!(quick, super::super::machining_time(&line, &MACHINE), max_relative = 1e-3);
    // 0.4 s up and down, 60 mm level.
    let slow = time(&line, &MACHINE, &machine_of(250.0), &EVENLY);
    assert_relative_eq!(slow, 0.8 + 0.6, max_relative = 2e-3);
    // Half of 10 mm speeding up.
    let short = path([[0.0; 3], [0.0, 10.0, 0.0]]);
    assert_relative_eq!(time(&short, &MACHINE, &machine_of(250.0), &EVENLY), 0.4, max_relative = 2e-3);
}

#[test]
fn a_turn_about_the_tip_takes_the_time_of_its_axes() {
    let kinematics = kinematics("bc-table", [1e9; 3], 4.0);
    let start = ClPoint { tip: Point3::origin(), axis: Vector3::new(0.3f64.sin(), 0.0, 0.3f64.cos()) };
    let turned = ClPoint { axis: Vector3::new(0.8f64.sin(), 0.0, 0.8f64.cos()), ..start };
    let step = Move { to: turned, kind: MoveKind::Cut, feed_rate: 6000.0, pass: 0 };
    let turn = Toolpath::new(start, vec![step]);
    let following = Following::with_tip_kept(0.01, 50.0);
    let joints = follow(&kinematics, &turn, &following).unwrap();
    let got = machining_time_of_axes(&turn, &MACHINE, &kinematics, &joints);
    // Location by location from rest to rest: no quicker than the whole turn at once.
    assert!(got >= 2.0 * (0.5f64 / 4.0).sqrt() * (1.0 - 1e-9), "{got}");
    assert!(got <= axes_at_most(&kinematics, &joints) * (1.0 + 1e-9));
}

/// Passes over a hill with the tool along the normal.
fn hill() -> Toolpath {
    let at = |k: i32| {
        let x = 0.5 * f64::from(k);
        let lean = 0.6 * (x / 4.0).sin();
        ClPoint {
            tip: Point3::new(x, 0.3 * x, 3.0 * (x / 4.0).cos()),
            axis: Vector3::new(lean.sin(), 0.2, lean.cos()).normalize(),
        }
    };
    let step = |k| Move { to: at(k), kind: MoveKind::Cut, feed_rate: 6000.0, pass: 0 };
    Toolpath::new(at(0), (1..60).map(step).collect())
}

fn hill_stages(name: &str) -> (Kinematics, Vec<Stage>) {
    let kinematics = kinematics(name, [800.0, 900.0, 700.0], 8.0);
    let path = hill();
    let joints = follow(&kinematics, &path, &EVENLY).unwrap();
    let (pieces, _) = pieces(&path, &kinematics, &joints);
    let axes = AxisLimits { rates: kinematics.rates(), accelerations: kinematics.accelerations() };
    let stages = stages(&pieces, &profile(&path, &MACHINE).unwrap(), &MACHINE, &axes);
    (kinematics, stages)
}

#[test]
fn no_axis_exceeds_its_rate_or_acceleration() {
    for name in PRESETS {
        let (kinematics, stages) = hill_stages(name);
        let (rates, most) = (kinematics.rates(), kinematics.accelerations());
        let speeds = speeds(&stages, &most, MACHINE.acceleration);
        assert!(speeds.iter().all(|x| *x >= 0.0) && speeds[0] == 0.0 && speeds[stages.len()] == 0.0);
        let mut reached = 0.0f64;
        for (k, stage) in stages.iter().enumerate() {
            let (x, y) = (speeds[k], speeds[k + 1]);
            let along = (y - x) / (2.0 * stage.length);
            assert!(along.abs() <= MACHINE.acceleration * (1.0 + 1e-6) && x <= stage.most * (1.0 + 1e-9));
            for axis in 0..5 {
                let [a, b] = [(x, stage.bends[0][axis]), (y, stage.bends[1][axis])]
                    .map(|(x, bend)| (bend * x + stage.slope[axis] * along).abs());
                reached = reached.max(a.max(b) / most[axis]);
                assert!(a.max(b) <= most[axis] * (1.0 + 1e-6), "{name} {axis}: {a} {b}");
                assert!(stage.slope[axis].abs() * y.max(x).sqrt() <= rates[axis] * (1.0 + 1e-9));
            }
        }
        assert!(reached > 0.99, "{name}: {reached}");
    }
}

/// The quickest of all speeds on a grid, stage by stage from the end.
#[test]
fn the_time_is_that_of_the_quickest_speeds_by_trying_all() {
    const GRID: usize = 12_000;
    for name in ["ac-table", "bc-head"] {
        let (kinematics, stages) = hill_stages(name);
        let accelerations = kinematics.accelerations();
        let limits = Limits { stages: &stages, accelerations: &accelerations, along: MACHINE.acceleration };
        let top = stages.iter().map(|stage| stage.most).fold(0.0, f64::max).sqrt();
        // Even in speed.
        let speed = |n: usize| (top * n as f64 / GRID as f64).powi(2);
        let mut left = vec![f64::INFINITY; GRID + 1];
        left[0] = 0.0;
        for (k, stage) in stages.iter().enumerate().rev() {
            let best = |n: usize| {
                let x = speed(n);
                if x > stage.most {
                    return f64::INFINITY;
                }
                let [least, greatest] = limits.window(k, x, f64::INFINITY);
                let end = |along: f64| (x + 2.0 * stage.length * along).max(0.0).sqrt() / top * GRID as f64;
                let reached = end(least).ceil() as usize..=(end(greatest).floor() as usize).min(GRID);
                let through = reached.map(|m| 2.0 * stage.length / (x.sqrt() + speed(m).sqrt()) + left[m]);
                through.fold(f64::INFINITY, f64::min)
            };
            left = (0..=GRID).map(best).collect();
        }
        let speeds = speeds(&stages, &accelerations, MACHINE.acceleration);
        let one = |(stage, ends): (&Stage, &[f64])| 2.0 * stage.length / (ends[0].sqrt() + ends[1].sqrt());
        let got: f64 = stages.iter().zip(speeds.windows(2)).map(one).sum();
        // Speeds of the grid are some of those that can be had.
        assert!(got <= left[0] * (1.0 + 1e-9) && got > 0.985 * left[0], "{name}: {got} {}", left[0]);
    }
}

/// The greatest speeds along an ellipse by small steps, from its derivatives: s, for X and Y of these rates and accelerations.
fn ellipse_by_small_steps([a, b]: [f64; 2], feed: f64, rates: [f64; 2], most: [f64; 2]) -> f64 {
    const STEPS: usize = 100_000;
    let around = |k: usize| 2.0 * std::f64::consts::PI * k as f64 / STEPS as f64;
    // Of both axes: first and second derivative by the length, and the length of a step.
    let at = |k: usize| {
        let (sin, cos) = around(k).sin_cos();
        let (first, second) = ([-a * sin, b * cos], [-a * cos, -b * sin]);
        let pace = first[0].hypot(first[1]);
        let along = (first[0] * second[0] + first[1] * second[1]) / pace.powi(4);
        let bend = [0, 1].map(|i| second[i] / (pace * pace) - first[i] * along);
        (first.map(|x| x / pace), bend, pace * around(1))
    };
    let window = |k: usize, x: f64| {
        let (slope, bend, _) = at(k);
        let axis = |i: usize| {
            let ends = [-1.0, 1.0].map(|side| (side * most[i] - bend[i] * x) / slope[i]);
            [ends[0].min(ends[1]), ends[0].max(ends[1])]
        };
        let (p, q) = (axis(0), axis(1));
        [p[0].max(q[0]), p[1].min(q[1])]
    };
    // From the greatest squared speed that it gives the next step can be reached.
    let greatest = |k: usize, next: f64| {
        let (slope, _, step) = at(k);
        let limit = [0, 1].iter().fold(feed, |now, &i| now.min(rates[i] / slope[i].abs())).powi(2);
        let (mut low, mut high) = (0.0, limit);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            let [least, greatest] = window(k, middle);
            *(if least <= greatest.min(0.5 * (next - middle) / step) { &mut low } else { &mut high }) =
                middle;
        }
        low
    };
    let mut x = vec![0.0; STEPS + 1];
    for k in (1..STEPS).rev() {
        x[k] = greatest(k, x[k + 1]);
    }
    for k in 0..STEPS {
        let rising = window(k, x[k])[1];
        x[k + 1] = x[k + 1].min(x[k] + 2.0 * at(k).2 * rising).max(0.0);
    }
    (0..STEPS).map(|k| 2.0 * at(k).2 / (x[k].sqrt() + x[k + 1].sqrt())).sum()
}

#[test]
fn three_axes_keep_their_own_limits_in_the_time_of_small_steps() {
    let free = Machine { acceleration: 1e6, jerk: 1e12, ..MACHINE };
    let infinite = f64::INFINITY;
    for (rates, most) in
        [([infinite; 2], [900.0, 300.0]), ([90.0, 40.0], [1500.0, 400.0]), ([70.0, 95.0], [250.0, 2000.0])]
    {
        let machine = Machine {
            rates: [60.0 * rates[0], 60.0 * rates[1], infinite],
            accelerations: [most[0], most[1], infinite],
            ..free
        };
        for chords in [2000, 600] {
            let point = |k: i32| {
                let angle = 2.0 * std::f64::consts::PI * f64::from(k) / f64::from(chords);
                [30.0 * angle.cos(), 12.0 * angle.sin(), 0.0]
            };
            let got = super::super::machining_time(&path((0..=chords).map(point)), &machine);
            let exact = ellipse_by_small_steps([30.0, 12.0], 100.0, rates, most);
            assert!((got / exact - 1.0).abs() < 3e-3, "{rates:?} {most:?} {chords}: {got} {exact}");
        }
    }
}
