//! Closed forms, accelerations by differences, and the quickest speeds of all by trying them.

use super::super::fixture::{machine, path, seconds};
use super::*;
use crate::kinematics::{Following, PRESETS, follow, preset};
use approx::assert_relative_eq;
use geometry::{Point3, Vector3};
use motion::{ClPoint, Move, MoveKind};
use work::monitor::Silent;

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
    machining_time_of_axes(path, machine, kinematics, &joints, &Silent).unwrap()
}

const EVENLY: Following = Following { tip: 0.01, axis: 1e-3 };

/// Along y by the slow axis, at the feed of 100 mm/s.
#[test]
fn the_axis_that_moves_sets_the_acceleration() {
    let machine_of = |y: f64| kinematics("ac-head", [1e4, y, 1e4], 50.0);
    let line = path([[0.0; 3], [0.0, 100.0, 0.0]]);
    let quick = time(&line, &MACHINE, &machine_of(1e4), &EVENLY);
    assert_relative_eq!(quick, seconds(&line, &MACHINE), max_relative = 1e-3);
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
    let got = machining_time_of_axes(&turn, &MACHINE, &kinematics, &joints, &Silent).unwrap();
    // Location by location from rest to rest: no quicker than the whole turn at once.
    assert!(got >= 2.0 * (0.5f64 / 4.0).sqrt() * (1.0 - 1e-9), "{got}");
    assert!(got <= axes_at_most(&kinematics, &joints) * (1.0 + 1e-9));
}

/// Passes over a hill with the tool along the normal.
fn hill() -> Toolpath {
    hill_in(0.5)
}

/// In steps along x.
fn hill_in(chord: f64) -> Toolpath {
    let at = |k: i32| {
        let x = chord * f64::from(k);
        let lean = 0.6 * (x / 4.0).sin();
        ClPoint {
            tip: Point3::new(x, 0.3 * x, 3.0 * (x / 4.0).cos()),
            axis: Vector3::new(lean.sin(), 0.2, lean.cos()).normalize(),
        }
    };
    let step = |k| Move { to: at(k), kind: MoveKind::Cut, feed_rate: 6000.0, pass: 0 };
    Toolpath::new(at(0), (1..=(29.5 / chord).round() as i32).map(step).collect())
}

fn on_hill(name: &str) -> Kinematics {
    kinematics(name, [800.0, 900.0, 700.0], 8.0)
}

fn hill_stages(name: &str) -> (AxisLimits, Vec<Stage>) {
    let (kinematics, path) = (on_hill(name), hill());
    let joints = follow(&kinematics, &path, &EVENLY).unwrap();
    let (pieces, _) = pieces(&path, &profile(&path, &MACHINE).unwrap(), &MACHINE, &kinematics, &joints);
    let axes = kinematics.axis_limits();
    let stages = stages(&pieces, &MACHINE, &axes);
    (axes, stages)
}

#[test]
fn no_axis_exceeds_its_rate_or_acceleration() {
    for name in PRESETS {
        let (axes, stages) = hill_stages(name);
        let (rates, most) = (axes.rates, axes.accelerations);
        let speeds = speeds(&stages, &axes);
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
        let (axes, stages) = hill_stages(name);
        let limits = Limits { stages: &stages, axes: &axes };
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
        let speeds = speeds(&stages, &axes);
        let one = |(stage, ends): (&Stage, &[f64])| 2.0 * stage.length / (ends[0].sqrt() + ends[1].sqrt());
        let got: f64 = stages.iter().zip(speeds.windows(2)).map(one).sum();
        // Speeds of the grid are some of those that can be had.
        assert!(got <= left[0] * (1.0 + 1e-9) && got > 0.985 * left[0], "{name}: {got} {}", left[0]);
    }
}

/// The greatest speeds along an ellipse by small steps, from its derivatives: s, for X and Y of these rates
/// and accelerations.
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
            let got = seconds(&path((0..=chords).map(point)), &machine);
            let exact = ellipse_by_small_steps([30.0, 12.0], 100.0, rates, most);
            assert!((got / exact - 1.0).abs() < 3e-3, "{rates:?} {most:?} {chords}: {got} {exact}");
        }
    }
}

/// Joints at evenly spaced places along x of the hill, and what they are at in length.
fn hill_by_joints(kinematics: &Kinematics, chord: f64) -> Vec<([f64; 5], f64)> {
    let path = hill_in(chord);
    let joints = follow(kinematics, &path, &EVENLY).unwrap();
    let ends = joints.locations.iter().filter(|at| at.at.tip == path.moves[at.step].to.tip);
    let mut length = 0.0;
    let mut last = path.start.tip;
    let mut rows = vec![(joints.start.values(), 0.0)];
    for at in ends {
        length += (at.at.tip - last).norm();
        last = at.at.tip;
        rows.push((at.joints.values(), length));
    }
    assert_eq!(rows.len(), path.len() + 1);
    rows
}

/// The quickest motion over the smooth hill by small steps, from derivatives of the joints by differences, s.
fn hill_by_small_steps(kinematics: &Kinematics, feed: f64) -> f64 {
    let rows = hill_by_joints(kinematics, 0.005);
    let (rates, most) = (kinematics.rates(), kinematics.accelerations());
    let n = rows.len() - 1;
    // Slope and bend of each axis by the length, at inner places.
    let at = |k: usize| {
        let k = k.clamp(1, n - 1);
        let [before, here, after] = [k - 1, k, k + 1].map(|k| rows[k]);
        let (h, g) = (here.1 - before.1, after.1 - here.1);
        let slope: [f64; 5] = std::array::from_fn(|i| {
            (h * (after.0[i] - here.0[i]) / g + g * (here.0[i] - before.0[i]) / h) / (h + g)
        });
        let bend: [f64; 5] = std::array::from_fn(|i| {
            2.0 * ((after.0[i] - here.0[i]) / g - (here.0[i] - before.0[i]) / h) / (h + g)
        });
        (slope, bend)
    };
    let places: Vec<([f64; 5], [f64; 5])> = (0..=n).map(at).collect();
    let window = |k: usize, x: f64| {
        let (slope, bend) = &places[k];
        let mut window = [-MACHINE.acceleration, MACHINE.acceleration];
        for i in 0..5 {
            let ends = [-1.0, 1.0].map(|side| (side * most[i] - bend[i] * x) / slope[i]);
            window = [window[0].max(ends[0].min(ends[1])), window[1].min(ends[0].max(ends[1]))];
        }
        window
    };
    let step = |k: usize| rows[k + 1].1 - rows[k].1;
    let mut x = vec![0.0; n + 1];
    for k in (1..n).rev() {
        let fastest = (0..5).map(|i| rates[i] / places[k].0[i].abs()).fold(feed, f64::min);
        let (mut low, mut high) = (0.0, fastest * fastest);
        for _ in 0..50 {
            let middle = 0.5 * (low + high);
            let [least, greatest] = window(k, middle);
            let can = least <= greatest.min(0.5 * (x[k + 1] - middle) / step(k));
            *(if can { &mut low } else { &mut high }) = middle;
        }
        x[k] = low;
    }
    for k in 0..n {
        let rising = window(k, x[k])[1];
        x[k + 1] = x[k + 1].min(x[k] + 2.0 * step(k) * rising).max(0.0);
    }
    (0..n).map(|k| 2.0 * step(k) / (x[k].sqrt() + x[k + 1].sqrt())).sum()
}

#[test]
fn every_machine_takes_the_time_of_small_steps() {
    // Only single axes limit: corners are rounded by the path's own rule, which the smooth hill knows nothing
    // of.
    let free = Machine { acceleration: MACHINE.acceleration, junction_deviation: 1.0, ..MACHINE };
    for name in PRESETS {
        let kinematics = on_hill(name);
        let exact = hill_by_small_steps(&kinematics, 100.0);
        for chord in [0.25, 0.1] {
            let got = time(&hill_in(chord), &free, &kinematics, &EVENLY);
            assert!((got / exact - 1.0).abs() < 0.02, "{name} {chord}: {got} {exact}");
        }
    }
}

/// The joints of the smooth hill at even times, by the speeds found on its chords; differences are
/// accelerations and jerks.
#[test]
fn no_axis_exceeds_its_jerk() {
    const STEP: f64 = 0.012;
    for name in PRESETS {
        let free = on_hill(name);
        let jerks = [6e3, 5e3, 7e3];
        let [mut first, mut second] = *free.axes();
        (first.jerk, second.jerk) = (60.0, 60.0);
        let made = Kinematics::new(first, second, 100.0, free.workpiece_zero(), [None; 3]).unwrap();
        let linear = |kinematics: Kinematics| {
            kinematics.with_rates([150.0, 200.0, 250.0]).with_accelerations([800.0, 900.0, 700.0])
        };
        let kinematics = linear(made).with_jerks(jerks);
        let path = hill_in(0.05);
        let joints = follow(&kinematics, &path, &EVENLY).unwrap();
        let (pieces, standing) =
            pieces(&path, &profile(&path, &MACHINE).unwrap(), &MACHINE, &kinematics, &joints);
        let axes = kinematics.axis_limits();
        let run = Run::new(&pieces, &MACHINE, &axes, &Silent).unwrap();
        assert_eq!(standing, 0.0);
        let (slower, before) = (run.time(), time(&path, &MACHINE, &free, &EVENLY));
        assert!(slower > 1.05 * before, "{name}: {slower} {before}");
        let rows = hill_by_joints(&kinematics, 0.01);
        let at = |s: f64| -> [f64; 5] {
            let k = rows.partition_point(|row| row.1 < s).clamp(2, rows.len() - 2);
            // Through four places.
            std::array::from_fn(|i| {
                let four = &rows[k - 2..k + 2];
                let share = |a: usize| {
                    let of = |b: usize| (s - four[b].1) / (four[a].1 - four[b].1);
                    (0..4).filter(|b| *b != a).map(of).product::<f64>() * four[a].0[i]
                };
                (0..4).map(share).sum()
            })
        };
        // Way by time.
        let (mut ways, mut begun, mut way, mut next) = (Vec::new(), 0.0, 0.0, 0.0);
        for (stage, ends) in run.stages.iter().zip(run.speeds.windows(2)) {
            let [from, to] = [ends[0].sqrt(), ends[1].sqrt()];
            let time = stage.time([ends[0], ends[1]]);
            while next <= begun + time {
                let t = next - begun;
                ways.push(match () {
                    () if from == 0.0 => way + stage.length * (t / time).powi(3),
                    () if to == 0.0 => way + stage.length * (1.0 - (1.0 - t / time).powi(3)),
                    () => way + from * t + 0.5 * (to - from) / time * t * t,
                });
                next += STEP;
            }
            (begun, way) = (begun + time, way + stage.length);
        }
        let rows: Vec<[f64; 5]> = ways.iter().map(|s| at(*s)).collect();
        let mut reached = [0.0f64; 2];
        for four in rows.windows(4) {
            for axis in 0..5 {
                let [a, b, c, d] = [0, 1, 2, 3].map(|k| four[k][axis]);
                let acceleration = (c - 2.0 * b + a) / STEP.powi(2);
                let jerk = (d - 3.0 * c + 3.0 * b - a) / STEP.powi(3);
                assert!((b - a).abs() / STEP <= axes.rates[axis] * 1.001);
                reached[0] = reached[0].max(acceleration.abs() / axes.accelerations[axis]);
                reached[1] = reached[1].max(jerk.abs() / axes.jerks[axis]);
            }
        }
        assert!(reached[0] < 1.02 && reached[1] < 1.06 && reached[1] > 0.9, "{name}: {reached:?}");
    }
}

/// Feeds follow what axes reach, and no time changes by them.
#[test]
fn words_follow_the_limits_of_all_axes() {
    for name in PRESETS {
        let kinematics = on_hill(name);
        let path = hill_in(0.05);
        let joints = follow(&kinematics, &path, &EVENLY).unwrap();
        let slow = slow_axes(&path, &MACHINE, Some((&kinematics, &joints)), &Silent).unwrap();
        let [before, after] = [&path, &slow]
            .map(|path| machining_time_of_axes(path, &MACHINE, &kinematics, &joints, &Silent).unwrap());
        // Slower moves are divided into shorter stages, which lose less.
        assert!(after < 1.001 * before && after > 0.99 * before, "{name}: {before} {after}");
        let lower = slow.moves.iter().filter(|step| step.feed_rate < 0.9 * 6000.0).count();
        assert!(lower > 10, "{name}: {lower}");
    }
    let own = Machine { accelerations: [1000.0, 100.0, 1000.0], jerks: [1e5; 3], ..MACHINE };
    let arc =
        (0..=600).map(|k| [30.0 * (0.01 * f64::from(k)).cos(), 30.0 * (0.01 * f64::from(k)).sin(), 0.0]);
    let path = path(arc);
    let slow = slow_axes(&path, &own, None, &Silent).unwrap();
    let [before, after] = [&path, &slow].map(|path| seconds(path, &own));
    assert!((before / after - 1.0).abs() < 2e-3, "{before} {after}");
    assert!(slow.moves.iter().any(|step| step.feed_rate < 0.7 * 6000.0));
    assert_eq!(slow_axes(&path, &MACHINE, None, &Silent).unwrap(), path);
}

/// The moves of one of the plain programs in `tests/planner`, and the limits in its head: mm/s, mm/s².
fn plain_program(text: &str) -> (Toolpath, f64, [f64; 3]) {
    let numbers = |line: &str| -> Vec<f64> {
        line.split(|c: char| !c.is_ascii_digit() && c != '.').filter_map(|word| word.parse().ok()).collect()
    };
    let head = numbers(text.lines().next().unwrap());
    let (mut tip, mut feed) = ([0.0; 3], 0.0);
    let mut moves = Vec::new();
    for line in text.lines().skip(2).filter(|line| !line.starts_with('M')) {
        let before = tip;
        for word in line.split_whitespace() {
            let value = word[1..].parse().unwrap();
            match word.as_bytes()[0] {
                letter @ b'X'..=b'Z' => tip[usize::from(letter - b'X')] = value,
                b'F' => feed = value,
                _ => {}
            }
        }
        if tip != before {
            let to = ClPoint::upright(Point3::from(tip));
            moves.push(Move { to, kind: MoveKind::Cut, feed_rate: feed, pass: 0 });
        }
    }
    (Toolpath::new(ClPoint::upright(Point3::origin()), moves), head[0], [head[1], head[2], head[3]])
}

/// Against LinuxCNC's trajectory planner (`tests/planner/make_times.py`).
#[test]
fn an_independent_planner_takes_the_same_time() {
    let times = include_str!("../../../tests/planner/times.txt");
    let ratio = |name: &str, text: &str, blending: Blending, deviation: f64| {
        let line = times.lines().find_map(|line| line.strip_prefix(name)).unwrap();
        let expected: f64 = line.trim().parse().unwrap();
        let (path, rate, accelerations) = plain_program(text);
        let machine = Machine {
            rapid_rate: 60.0 * rate,
            rates: [60.0 * rate; 3],
            acceleration: accelerations.into_iter().fold(0.0, f64::max),
            accelerations,
            junction_deviation: deviation,
            blending,
            ..MACHINE
        };
        seconds(&path, &machine) / expected
    };
    // With exact stop (G61) no corner is rounded.
    let stopping = [
        ("stop_zigzag.ngc", include_str!("../../../tests/planner/stop_zigzag.ngc")),
        ("stop_axes.ngc", include_str!("../../../tests/planner/stop_axes.ngc")),
    ];
    for (name, text) in stopping {
        let got = ratio(name, text, Blending::Full, 1e-9);
        assert!((got - 1.0).abs() < 0.05, "{name}: {got}");
    }
    let blended = [
        ("blend_zigzag.ngc", include_str!("../../../tests/planner/blend_zigzag.ngc")),
        ("circle.ngc", include_str!("../../../tests/planner/circle.ngc")),
        ("wave.ngc", include_str!("../../../tests/planner/wave.ngc")),
        ("knot.ngc", include_str!("../../../tests/planner/knot.ngc")),
        ("spiral.ngc", include_str!("../../../tests/planner/spiral.ngc")),
        ("raster.ngc", include_str!("../../../tests/planner/raster.ngc")),
        ("polygon.ngc", include_str!("../../../tests/planner/polygon.ngc")),
    ];
    let got = blended.map(|(name, text)| ratio(name, text, Blending::Arcs, 0.01));
    assert!(got.iter().all(|got| (got - 1.0).abs() < 0.05), "{got:?}");
    // That is the control's share of the acceleration, and not what axes can.
    let full = blended.map(|(name, text)| ratio(name, text, Blending::Full, 0.01));
    assert!(full[2] < 0.9, "{full:?}");
}
