//! Programs followed word by word, and the words by forward kinematics.

use super::*;
use machine::kinematics::{DEFAULT_ROTARY_RATE, PRESETS, RotaryAxis, follow, preset};
use motion::{ClPoint, Move};

const HEADER: ProgramHeader = ProgramHeader { name: String::new(), spindle_speed: None, rise_to: None };

/// What is in force after a line: the words X Y Z and of both rotary axes, rapid or not, F.
#[derive(Debug, Clone, Copy)]
struct State {
    words: [f64; 5],
    rapid: bool,
    inverse: bool,
    tip_kept: bool,
    feed: f64,
}

/// Follows the modal words, as a control would.
fn states(text: &str, letters: [char; 5]) -> Vec<State> {
    let mut state =
        State { words: [f64::NAN; 5], rapid: false, inverse: false, tip_kept: false, feed: f64::NAN };
    let mut states = Vec::new();
    for line in text.lines() {
        let machine = line.contains("G53");
        let mut feed = false;
        for word in line.split_whitespace().filter(|_| !line.starts_with(['(', '%'])) {
            let letter = word.chars().next().unwrap();
            let value: f64 = word[1..].parse().unwrap();
            match (letter, word) {
                (_, "G93") => state.inverse = true,
                (_, "G94") => state.inverse = false,
                (_, "G43.4") => {
                    state.tip_kept = true;
                    state.words[..3].fill(f64::NAN);
                }
                (_, "G49") => state.tip_kept = false,
                ('G', _) if value < 2.0 => state.rapid = value == 0.0,
                ('F', _) => (state.feed, feed) = (value, true),
                _ => {
                    if let Some(k) = letters.iter().position(|l| *l == letter) {
                        state.words[k] = if machine { f64::NAN } else { value };
                    }
                }
            }
        }
        let moves = !line.starts_with(['(', '%', 'M', 'S']) && line.contains(letters) && !machine;
        assert!(!(moves && !state.rapid && state.inverse) || feed, "an inverse time on each line: {line}");
        states.push(state);
    }
    states
}

pub(crate) fn machine(name: &str) -> Kinematics {
    let [mut first, mut second] = preset(name).unwrap();
    let place = |axis: &mut RotaryAxis, table: [f64; 3], head: [f64; 3]| {
        axis.point = Point3::from(if axis.side == Side::Table { table } else { head });
    };
    place(&mut first, [250.0, 200.0, -400.0], [0.0, 3.0, 120.0]);
    place(&mut second, [250.0, 203.0, -350.0], [0.0, 0.0, 110.0]);
    Kinematics::new(first, second, 140.0, Point3::new(230.0, 215.0, -300.0), [None; 3]).unwrap()
}

/// Rapids over, cuts that tilt, a turn on the spot, rapids back; within a cone that all machines reach.
pub(crate) fn tilting_path() -> Toolpath {
    let mut rng = sim::scenes::Rng::new(11);
    let mut at = |z: f64| {
        let tip = Point3::new(rng.within(-40.0, 40.0), rng.within(-40.0, 40.0), z);
        let axis = Vector3::new(rng.within(-0.5, 0.5), rng.within(-0.5, 0.5), 1.0).normalize();
        ClPoint { tip, axis }
    };
    let start = at(60.0);
    let step = |to, kind, feed_rate| Move { to, kind, feed_rate, pass: 0 };
    let mut moves = vec![step(at(61.0), MoveKind::Rapid, 0.0)];
    for _ in 0..6 {
        let over = at(60.0);
        let down = ClPoint { tip: over.tip - over.axis * 40.0, ..over };
        moves.extend([step(over, MoveKind::Rapid, 0.0), step(down, MoveKind::Plunge, 300.0)]);
        let mut end = down;
        for _ in 0..4 {
            end = ClPoint { axis: at(0.0).axis, tip: at(20.0).tip };
            moves.push(step(end, MoveKind::Cut, 1500.0));
        }
        end.axis = at(0.0).axis;
        moves.push(step(end, MoveKind::Cut, 1500.0));
        moves.push(step(ClPoint { tip: end.tip + end.axis * 50.0, ..end }, MoveKind::Retract, 1500.0));
        moves.push(step(ClPoint::upright(end.tip + end.axis * 50.0), MoveKind::Rapid, 0.0));
    }
    Toolpath::new(start, moves)
}

fn program(path: &Toolpath, kinematics: &Kinematics, style: Style) -> (String, MoveLines, JointPath) {
    program_following(path, kinematics, style, &style.following(0.002, 50.0))
}

fn program_following(
    path: &Toolpath,
    kinematics: &Kinematics,
    style: Style,
    following: &Following,
) -> (String, MoveLines, JointPath) {
    let joints = follow(kinematics, path, following).unwrap();
    let (text, lines) = written(path, kinematics, style, &joints, TCP_WORDS);
    (text, lines, joints)
}

fn written(
    path: &Toolpath,
    kinematics: &Kinematics,
    style: Style,
    joints: &JointPath,
    tcp_words: [&str; 2],
) -> (String, MoveLines) {
    let post = FiveAxisPost { kinematics, joints, style, tcp_words, rapid_rate: 15_000.0 };
    let mut bytes = Vec::new();
    let lines = write_five_axis(&mut bytes, path, &post, &Cutter::ball(6.0).unwrap(), &HEADER).unwrap();
    (String::from_utf8(bytes).unwrap(), lines)
}

/// The joints of a line of words.
fn joints_of(kinematics: &Kinematics, words: &[f64; 5]) -> Joints {
    let nose = Vector3::new(0.0, 0.0, kinematics.gauge_length());
    let linear = Vector3::from_column_slice(&words[..3]) + kinematics.workpiece_zero().coords + nose;
    Joints { linear, rotary: [words[3].to_radians(), words[4].to_radians()] }
}

#[test]
fn reading_back_gives_the_locations() {
    let path = tilting_path();
    for name in PRESETS {
        let kinematics = machine(name);
        for style in [Style::Tcp, Style::Full] {
            let (text, lines, joints) = program(&path, &kinematics, style);
            assert!(joints.report.obstacle().is_none(), "{name}");
            let states = states(&text, kinematics.letters());
            assert_eq!(lines.len(), path.len());
            for (k, step) in path.moves.iter().enumerate() {
                let state = states[lines[k] as usize - 1];
                assert_eq!((state.tip_kept, state.inverse), (style == Style::Tcp, style == Style::Full));
                let at = kinematics.forward(&joints_of(&kinematics, &state.words));
                let tip = match style {
                    Style::Tcp => Point3::from(Vector3::from_column_slice(&state.words[..3])),
                    Style::Full => at.tip,
                };
                // Half of the last decimal on three axes; angles turn the lengths of the machine, 600 mm,
                // besides.
                assert!(
                    (tip - step.to.tip).norm() < 0.9e-4 + 1.3e-4,
                    "{name} move {k}: {tip} {}",
                    step.to.tip
                );
                assert!((at.axis - step.to.axis).norm() < 3e-7, "{name} move {k}");
            }
        }
    }
}

/// Between lines of a full program the joints move evenly: the tip stays on its line, the feed is kept.
#[test]
fn full_programs_keep_tip_and_feed() {
    let path = tilting_path();
    for name in ["ac-table", "bc-head", "nutating-head-c-table", "nutating-table"] {
        let kinematics = machine(name);
        let (text, lines, joints) = program(&path, &kinematics, Style::Full);
        let states = states(&text, kinematics.letters());
        let first = states.iter().rposition(|s| s.words.iter().any(|w| w.is_nan())).unwrap();
        assert!(first > text.lines().count() - 5, "only the end is unknown");
        // From the end of the first move on: its begin is the approach.
        let (mut k, mut from) = (1, path.moves[0].to);
        let mut times = vec![0.0; path.len()];
        for at in lines[0] as usize - 1..lines[path.len() - 1] as usize - 1 {
            let ends = [at, at + 1].map(|line| joints_of(&kinematics, &states[line].words));
            for s in [0.25, 0.5, 0.75] {
                let linear = ends[0].linear.lerp(&ends[1].linear, s);
                let rotary = [0, 1].map(|k| ends[0].rotary[k] + s * (ends[1].rotary[k] - ends[0].rotary[k]));
                let tip = kinematics.forward(&Joints { linear, rotary }).tip;
                let (a, b) = (from.tip, path.moves[k].to.tip);
                let along = ((tip - a).dot(&(b - a)) / (b - a).norm_squared().max(1e-30)).clamp(0.0, 1.0);
                assert!((tip - (a + (b - a) * along)).norm() < 0.002 + 3e-4, "{name} line {at}");
            }
            if !states[at + 1].rapid {
                times[k] += 60.0 / states[at + 1].feed;
            }
            if lines[k] as usize == at + 2 {
                (from, k) = (path.moves[k].to, k + 1);
            }
        }
        let least_times = joints.least_times(&kinematics, path.len());
        for (k, step) in path.moves.iter().enumerate().skip(1) {
            let length = (step.to.tip - path.start_of(k)).norm();
            let rate = if step.kind == MoveKind::Rapid { 15_000.0 } else { step.feed_rate };
            let least = (60.0 * length / rate).max(least_times[k]);
            if times[k] > 0.0 {
                assert!(times[k] > least * (1.0 - 2e-3) - 1e-3, "{name} move {k} {} {least}", times[k]);
                assert!(
                    times[k] < (60.0 * length / rate + least_times[k]) * (1.0 + 2e-3) + 1e-2,
                    "{name} {k}"
                );
            }
        }
    }
}

/// By differences of the words: a head with a long gauge and a table far from its axes at a high feed.
#[test]
fn no_joint_is_faster_than_its_rate() {
    let mut path = tilting_path();
    path.moves.iter_mut().for_each(|m| m.feed_rate = 12_000.0);
    for name in PRESETS {
        let rates = [15_000.0, 12_000.0, 9_000.0];
        let kinematics = machine(name).with_rates(rates.map(|rate| rate / 60.0));
        let (text, lines, joints) = program(&path, &kinematics, Style::Full);
        let states = states(&text, kinematics.letters());
        let mut limited = 0;
        for at in lines[0] as usize..lines[path.len() - 1] as usize {
            let [before, after] =
                [at - 1, at].map(|line| joints_of(&kinematics, &states[line].words).values());
            if states[at].rapid {
                continue;
            }
            for (k, limit) in kinematics.rates().into_iter().enumerate() {
                let rate = (after[k] - before[k]).abs() * states[at].feed / 60.0;
                assert!(rate <= limit * (1.0 + 1e-9), "{name} joint {k} line {at}: {rate} {limit}");
                limited += usize::from(k < 3 && rate > 0.9 * limit);
            }
        }
        assert!(limited > 10, "{name} {limited}");
        let fastest = joints.fastest(&kinematics, &path, 15_000.0);
        assert!(fastest.iter().zip(kinematics.rates()).all(|(rate, limit)| *rate <= limit * (1.0 + 1e-12)));
    }
}

/// By differences of the joints that a control passes while it keeps the tip on its line, at the feed of the
/// word.
#[test]
fn no_joint_is_faster_than_its_rate_where_the_control_keeps_the_tip() {
    let mut path = tilting_path();
    path.moves.iter_mut().for_each(|m| m.feed_rate = 12_000.0);
    const PARTS: u32 = 400;
    for name in PRESETS {
        let kinematics = machine(name).with_rates([15_000.0, 12_000.0, 9_000.0].map(|rate| rate / 60.0));
        let (text, lines, _) = program(&path, &kinematics, Style::Tcp);
        let states = states(&text, kinematics.letters());
        let mut limited = 0;
        for at in lines[0] as usize..lines[path.len() - 1] as usize {
            let [from, to] = [at - 1, at].map(|line| states[line].words);
            let way = std::array::from_fn::<f64, 5, _>(|k| to[k] - from[k]);
            let length = Vector3::from_column_slice(&way[..3]).norm();
            if states[at].rapid || way.iter().any(|x| x.is_nan()) || way == [0.0; 5] {
                continue;
            }
            // Of rotary axes alone the word is that of the one that turns farther, degrees/min.
            let time =
                if length > 0.0 { length } else { way[3].abs().max(way[4].abs()) } * 60.0 / states[at].feed;
            let joints = |part: u32| {
                let [x, y, z, a, b] =
                    std::array::from_fn(|k| from[k] + way[k] * f64::from(part) / f64::from(PARTS));
                kinematics.place(Point3::new(x, y, z), [a.to_radians(), b.to_radians()]).values()
            };
            for part in 0..PARTS {
                let [before, after] = [part, part + 1].map(joints);
                for (k, limit) in kinematics.rates().into_iter().enumerate() {
                    let rate = (after[k] - before[k]).abs() * f64::from(PARTS) / time;
                    assert!(rate <= limit * (1.0 + 1e-9), "{name} joint {k} line {}: {rate} {limit}", at + 1);
                    limited += usize::from(k < 3 && rate > 0.98 * limit);
                }
            }
        }
        assert!(limited > 10, "{name} {limited}");
    }
}

/// Up along the machine's z alone, then the rotary axes alone, then X and Y, then Z down from above the whole
/// path, and up again before the end, for both styles.
#[test]
fn programs_begin_and_end_above_the_work() {
    let path = tilting_path();
    for name in PRESETS {
        let free = machine(name);
        let [first, second] = *free.axes();
        let travel = [None, None, Some([-900.0, 650.0])];
        let kinematics = Kinematics::new(first, second, 140.0, free.workpiece_zero(), travel).unwrap();
        for style in [Style::Tcp, Style::Full] {
            let (text, _, joints) = program(&path, &kinematics, style);
            let moves: Vec<String> = text
                .lines()
                .filter(|line| !line.starts_with(['(', '%', 'M', 'S']) && line.contains(kinematics.letters()))
                .map(|line| line.chars().filter(|c| kinematics.letters().contains(c)).collect())
                .collect();
            let rotary: String = {
                let mut letters = kinematics.letters()[3..].to_vec();
                letters.sort_unstable();
                letters.into_iter().collect()
            };
            assert_eq!(moves[..3], ["Z".to_owned(), rotary, "XY".to_owned()], "{name}");
            assert_eq!(moves.last().unwrap(), "Z");
            let lines: Vec<&str> = text.lines().collect();
            let rises: Vec<usize> = (0..lines.len()).filter(|&k| lines[k].starts_with("G53")).collect();
            assert!(rises.iter().all(|&k| lines[k] == "G53 G0 Z650.0"));
            // Behind the last rise nothing moves.
            let end = rises.last().unwrap();
            assert!(
                lines[end + 1..]
                    .iter()
                    .all(|line| !line.contains(kinematics.letters()) || line.starts_with('M'))
            );
            let states = states(&text, kinematics.letters());
            let nose = joints.highest_nose(&kinematics, &path);
            assert!(nose <= kinematics.retracted_z(), "{name}: {nose}");
            if style == Style::Full {
                // Straight down after X and Y, from no lower than the highest tip.
                let over = rises[0] + 3;
                let [high, low] = [over, over + 1].map(|k| joints_of(&kinematics, &states[k].words));
                assert!((high.linear.xy() - low.linear.xy()).norm() < 1e-9 && high.linear.z >= low.linear.z);
                let [up, tip] = [kinematics.upward(high.rotary), kinematics.forward(&high).tip.coords];
                let highest = path.moves.iter().map(|m| up.dot(&m.to.tip.coords)).fold(f64::MIN, f64::max);
                assert!(up.dot(&tip) >= highest - 1e-3, "{name}: {} {highest}", up.dot(&tip));
            }
        }
    }
}

/// Up, turn, over, down: before the control keeps the tip the linear axes stand over the start, and then go
/// straight down.
#[test]
fn a_program_that_keeps_the_tip_comes_down_along_the_machines_z() {
    let path = tilting_path();
    for name in PRESETS {
        let kinematics = machine(name);
        let (text, ..) = program(&path, &kinematics, Style::Tcp);
        let lines: Vec<&str> = text.lines().collect();
        let states = states(&text, kinematics.letters());
        let mut seen = 0;
        for keeps in (0..lines.len()).filter(|&k| lines[k].starts_with("G43.4")) {
            assert!(
                lines[keeps - 1].starts_with(['X', 'Y']) && !lines[keeps - 1].contains('Z'),
                "{}",
                lines[keeps - 1]
            );
            let stood = joints_of(&kinematics, &states[keeps - 1].words).linear;
            let [over, down] = [keeps + 1, keeps + 2].map(|line| {
                let words = states[line].words;
                let tip = Point3::from(Vector3::from_column_slice(&words[..3]));
                kinematics.place(tip, [words[3].to_radians(), words[4].to_radians()]).linear
            });
            assert!((over.xy() - stood.xy()).norm() < 1e-3, "{name}: {stood} {over}");
            assert!((down.xy() - over.xy()).norm() < 1e-3 && down.z < over.z + 1e-3, "{name}: {over} {down}");
            seen += 1;
        }
        assert!(seen > 0, "{name}");
    }
}

#[test]
fn a_short_program_in_both_styles() {
    let [first, second] = preset("bc-table").unwrap();
    let kinematics = Kinematics::new(first, second, 100.0, Point3::origin(), [None; 3]).unwrap();
    let level = Vector3::new(0.6, 0.0, 0.8);
    let at = |x: f64, z: f64| ClPoint { tip: Point3::new(x, 0.0, z), axis: level };
    let step = |to, kind| Move { to, kind, feed_rate: 500.0, pass: 0 };
    let mut moves = vec![step(at(0.0, 0.0), MoveKind::Plunge), step(at(8.0, 0.0), MoveKind::Cut)];
    moves.push(step(ClPoint { axis: Vector3::z(), ..at(8.0, 0.0) }, MoveKind::Cut));
    moves.push(step(ClPoint::upright(Point3::new(8.0, 0.0, 20.0)), MoveKind::Rapid));
    let path = Toolpath::new(at(6.0, 8.0), moves);
    // So coarse that no points are put in.
    let coarse = Following { tip: 1.0, axis: 1.0 };
    let (text, lines, _) = program_following(&path, &kinematics, Style::Tcp, &coarse);
    // The table's z, (0.6, 0, 0.8) in the workpiece, reaches (8, 0, 20) at 20.8; the start lies at 10.
    let expected = "\
%
()
(BALL END D=6.0)
(MM, DEGREES, C IN THE TABLE, B IN THE TABLE)
(TIP OF THE CUTTER IN THE WORKPIECE)
G17 G21 G40 G49 G80 G90 G94
G53 G0 Z0.0
B36.8699 C0.0
X0.0 Y0.0
G43.4 H1
X12.48 Y0.0 Z16.64
X6.0 Z8.0
G1 X0.0 Z0.0 F500.0
X8.0
B0.0 F10800.0
G0 Z20.0
G49
G53 G0 Z0.0
M30
%
";
    assert_eq!(text, expected);
    assert_eq!(lines, [13, 14, 15, 16]);
    let (text, ..) = program_following(&path, &kinematics, Style::Full, &coarse);
    // Along the turned table: x' = 0.8 x − 0.6 z, z' = 0.6 x + 0.8 z.
    // 36.8699° at 10800 a minute: 292.92187 times a minute, and no more.
    let expected = "\
(LINEAR AXES FROM THE WORKPIECE ZERO WITH ROTARY AXES AT ZERO)
(WORKPIECE ZERO IN MACHINE COORDINATES X0.0 Y0.0 Z0.0)
G17 G21 G40 G49 G80 G90 G93
G53 G0 Z0.0
B36.8699 C0.0
X0.0 Y0.0
Z20.8
Z10.0
G1 Z0.0 F50.0
X6.4 Z4.8 F62.5
X8.0 Z0.0 B0.0 F292.9218
G0 Z20.0
G53 G0 Z0.0
G94
M30
%
";
    assert!(text.ends_with(expected), "{text}");
    assert_eq!(DEFAULT_ROTARY_RATE, std::f64::consts::PI);
}

#[test]
fn no_program_is_made_of_joints_that_must_not_be() {
    let [first, second] = preset("ac-table").unwrap();
    let upward = RotaryAxis { limits: Some([-0.1, 0.1]), ..second };
    let kinematics = Kinematics::new(first, upward, 100.0, Point3::origin(), [None; 3]).unwrap();
    let path = tilting_path();
    let write = |style: Style, kinematics: &Kinematics, following: &Following| {
        let joints = follow(kinematics, &path, following).unwrap();
        let post =
            FiveAxisPost { kinematics, joints: &joints, style, tcp_words: TCP_WORDS, rapid_rate: 15_000.0 };
        write_five_axis(&mut Vec::new(), &path, &post, &Cutter::ball(6.0).unwrap(), &HEADER)
    };
    let kept = Style::Tcp.following(0.001, 50.0);
    let error = write(Style::Tcp, &kinematics, &kept).unwrap_err();
    assert!(error.to_string().contains("beyond its limit"), "{error}");
    let free = Kinematics::by_name("ac-table").unwrap();
    assert!(write(Style::Tcp, &free, &kept).is_ok());
    assert!(write(Style::Full, &free, &kept).is_err());
    let mut bytes = Vec::new();
    assert!(
        super::super::write(&mut bytes, &path, &Cutter::ball(6.0).unwrap(), &HEADER, None).is_err()
            && bytes.is_empty()
    );
}

/// Rounds that turn further than a limited axis can.
fn rewinding_path() -> Toolpath {
    let at = |azimuth: f64| ClPoint {
        tip: Point3::new(10.0, 20.0, 30.0 + azimuth),
        axis: Vector3::new(azimuth.cos(), azimuth.sin(), 1.0).normalize(),
    };
    let moves = (1..=90).map(|k| {
        let kind = if k % 10 < 2 { MoveKind::Rapid } else { MoveKind::Cut };
        Move { to: at(0.2 * f64::from(k)), kind, feed_rate: 900.0, pass: 0 }
    });
    Toolpath::new(at(0.0), moves.collect())
}

/// What is checked for collisions is what the program does, from line to line.
#[test]
fn full_programs_go_through_the_joints_that_are_checked() {
    let cases = PRESETS.iter().map(|name| (*name, tilting_path())).chain([("bc-head", rewinding_path())]);
    for (name, path) in cases {
        let free = machine(name);
        let [first, second] = *free.axes();
        let travel = [None, None, Some([-900.0, 650.0])];
        let kinematics = Kinematics::new(first, second, 140.0, free.workpiece_zero(), travel).unwrap();
        let (text, _, joints) = program(&path, &kinematics, Style::Full);
        let apart = |a: &Joints, b: &Joints| {
            let ways = a.values().into_iter().zip(b.values());
            ways.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        let mut expected = joints.program(&kinematics, &path);
        expected.dedup_by(|b, a| apart(&a.joints, &b.joints) < 1e-3);
        let states = states(&text, kinematics.letters());
        let mut found: Vec<Joints> = Vec::new();
        let mut z = f64::NAN;
        for (line, state) in text.lines().zip(&states) {
            let words = state.words;
            let mut at = joints_of(&kinematics, &words);
            z = if line.starts_with("G53") {
                650.0
            } else if words[2].is_nan() {
                z
            } else {
                at.linear.z
            };
            at.linear.z = z;
            if at.values().iter().all(|value| value.is_finite()) {
                found.push(at);
            }
        }
        found.dedup_by(|b, a| apart(a, b) < 1e-3);
        assert_eq!(found.len(), expected.len(), "{name}");
        for (k, (found, expected)) in found.iter().zip(&expected).enumerate() {
            assert!(apart(found, &expected.joints) < 2e-3, "{name} {k}: {found:?} {expected:?}");
        }
    }
}

/// A rewind in clear air rises, turns and comes down to where it left.
#[test]
fn a_rewind_is_made_at_the_top() {
    let kinematics = Kinematics::by_name("bc-head").unwrap();
    let path = rewinding_path();
    for style in [Style::Tcp, Style::Full] {
        let (text, lines, joints) = program(&path, &kinematics, style);
        assert!(!joints.report.rewinds.is_empty());
        let rises = text.lines().filter(|line| *line == "G53 G0 Z0.0").count();
        assert_eq!(rises, 2 + joints.report.rewinds.len());
        let states = states(&text, kinematics.letters());
        for (k, step) in path.moves.iter().enumerate() {
            let words = states[lines[k] as usize - 1].words;
            let axis = kinematics.tool_axis([words[3].to_radians(), words[4].to_radians()]);
            assert!((axis - step.to.axis).norm() < 3e-7, "move {k}");
        }
    }
}

/// LinuxCNC's `xyzac-trt` and `xyzbc-trt`, whose tables count as they turn themselves. `trunnion_*.ngc` of
/// tests/programs are our programs for them, and rs274 goes through our locations (`trunnion_*.motion`; the
/// README there says how they are made). `MILLSTREAM_BLESS=1` writes the programs anew.
#[test]
fn linuxcnc_goes_through_the_locations_of_programs_that_keep_the_tip() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/programs");
    for (name, table) in [("trunnion_xyzac", "ac-table"), ("trunnion_xyzbc", "bc-table")] {
        let [mut first, mut second] = preset(table).unwrap();
        (first.direction, second.direction) = (-first.direction, -second.direction);
        (first.point, second.point) = (Point3::new(12.0, -7.0, 0.0), Point3::new(12.0, 13.0, -30.0));
        let travel = [None, None, Some([-400.0, 0.0])];
        let kinematics = Kinematics::new(first, second, 50.8, Point3::new(0.0, 0.0, -300.0), travel).unwrap();
        let path = tilting_path();
        let joints = follow(&kinematics, &path, &Style::Tcp.following(0.2, 50.0)).unwrap();
        let words = ["G43 H1 M428", "M429 G49"];
        let (text, _) = written(&path, &kinematics, Style::Tcp, &joints, words);
        let file = folder.join(name).with_extension("ngc");
        if std::env::var_os("MILLSTREAM_BLESS").is_some() {
            std::fs::write(&file, &text).unwrap();
        }
        assert_eq!(std::fs::read_to_string(&file).unwrap(), text, "{name}");

        // X Y Z and both rotary axes from where the control begins to keep the tip, and up again before it
        // ends.
        let start = JointLocation { joints: joints.start, at: path.start, ..joints.locations[0] };
        let ends = [&start, joints.locations.last().unwrap()];
        let [over, up] = ends.map(|end| {
            let high = kinematics.over(&path, end.joints.rotary, end.at.tip);
            JointLocation { at: ClPoint { tip: high, ..end.at }, ..*end }
        });
        let through = [over, start].into_iter().chain(joints.locations.iter().copied()).chain([up]);
        let place = |at: JointLocation| {
            let rotary = kinematics.axes().iter().zip(at.joints.rotary);
            let mut place = [at.at.tip.x, at.at.tip.y, at.at.tip.z, 0.0, 0.0, 0.0];
            rotary.for_each(|(axis, angle)| place[3 + (axis.letter as usize - 65)] = angle.to_degrees());
            place
        };
        let mut ours: Vec<[f64; 6]> = through.map(place).collect();
        ours.dedup();
        let motion = std::fs::read_to_string(file.with_extension("motion")).unwrap();
        let theirs: Vec<Vec<f64>> = motion
            .lines()
            .map(|line| line.split(' ').skip(1).take(6).map(|word| word.parse().unwrap()).collect())
            .collect();
        assert!(ours.len() > 20 && theirs.len() > ours.len(), "{name}: {} {}", ours.len(), theirs.len());
        // The last motion is the rise.
        let theirs = &theirs[theirs.len() - 1 - ours.len()..];
        for (ours, theirs) in ours.iter().zip(theirs) {
            // Words and rs274 round to four decimals each, angles to five and four.
            let off = ours.iter().zip(theirs).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(off < 1.1e-4, "{name}: {ours:?}, rs274 has {theirs:?}");
        }
    }
}
