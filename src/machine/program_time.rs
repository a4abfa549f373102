//! How long a machine with rotary axes takes for a program that names all its axes.
//!
//! Enters: the joints at the ends of all lines, with the time that the feed asks for. Leaves: the time, by
//! the limits of all axes ([`super::axis_limits`]). A line is as long as the tip goes in the part, and one in
//! which the tip stands as long as the arcs that its rotary axes turn by, [`ARM`] away. Between the one kind
//! and the other the machine rests. Other corners are run as [`super::time`] has it, by the angle between the
//! ways; within a line its axes alone set the speed.

use super::Machine;
use super::axis_limits::{AxisLimits, EvenStretch, Run, way};
use super::kinematics::{Joints, Kinematics, Way, Waypoint};
use super::time::{Block, NO_MOVE, SECONDS_PER_MINUTE, slow_sudden_bends};
use geometry::Vector3;
use work::monitor::{Cancelled, Monitor};

/// Arm by which a turn about a tip that stands counts as a way, mm. Only corners between such turns hang on
/// it.
const ARM: f64 = 100.0;

/// A line is divided so that its rotary axes turn by no more than this in a piece, rad: a circle that linear
/// axes follow is run too fast by less than a ten-thousandth.
const TURN: f64 = 0.02;

/// Beside a line of several pieces the machine rests at a corner that turns by more than this, rad. It would
/// all but rest there anyway.
const SHARP: f64 = std::f64::consts::FRAC_PI_6;

/// Pieces of a line at most.
const MOST_PIECES: f64 = 4096.0;

/// Lines that are looked at in one go, from rest to rest: more would take memory and hardly other times.
const AT_ONCE: usize = 1 << 16;

/// Time, s, for what `program` goes through after its first place, on a machine whose axes keep their rates,
/// accelerations and jerks. A line takes the time of its feed, or as long as the axes need; a rapid goes as
/// fast as they can and no faster than the rapid rate. Places that the machine comes to from where nobody
/// knows take none. Infinite where `machine` fails its [`Machine::check`].
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
///
/// # Tolerance
/// A model as [`super::machining_time_of_axes`].
pub fn machining_time_of_program(
    program: &[Waypoint],
    machine: &Machine,
    kinematics: &Kinematics,
    monitor: &dyn Monitor,
) -> Result<f64, Cancelled> {
    if machine.check().is_err() {
        return Ok(f64::INFINITY);
    }
    let axes = kinematics.axis_limits();
    let mut time = 0.0;
    let mut begin = 0;
    while begin + 1 < program.len() {
        let end = (begin + 1 + AT_ONCE).min(program.len());
        let lines = Lines::of(&program[begin..end], machine, kinematics, &axes);
        time += Run::new(&lines.stretches, machine, &axes, monitor)?.time();
        begin = end - 1;
    }
    Ok(time)
}

/// A line as a way of all axes.
struct Line {
    /// The joints at the ends of its pieces, which take the same time each.
    joints: Vec<Joints>,
    /// Its ways at its beginning and at its end, unit vectors.
    directions: [[f64; 5]; 2],
    length: f64,
    /// The tip moves in the part.
    moves_tip: bool,
}

impl Line {
    /// `None` where nothing moves.
    fn new([from, to]: [&Waypoint; 2], kinematics: &Kinematics) -> Option<Self> {
        let turn = [0, 1].map(|k| (to.joints.rotary[k] - from.joints.rotary[k]).abs());
        let pieces = (turn[0].max(turn[1]) / TURN).ceil().clamp(1.0, MOST_PIECES);
        let [begin, end] = [from, to].map(|at| kinematics.forward(&at.joints).tip);
        let at = |piece: u32| {
            let share = f64::from(piece) / pieces;
            let between = |a: f64, b: f64| a + (b - a) * share;
            let rotary = [0, 1].map(|k| between(from.joints.rotary[k], to.joints.rotary[k]));
            match to.way {
                _ if share == 1.0 => to.joints,
                Way::Tip => kinematics.place(begin + (end - begin) * share, rotary),
                Way::Axes | Way::Approach => {
                    let linear = from.joints.linear.lerp(&to.joints.linear, share);
                    Joints { linear, rotary }
                }
            }
        };
        let joints: Vec<Joints> = std::iter::once(from.joints).chain((1..=pieces as u32).map(at)).collect();
        let tip = |ends: &[Joints]| kinematics.forward(&ends[1]).tip - kinematics.forward(&ends[0]).tip;
        let moves_tip = joints.windows(2).any(|ends| tip(ends).norm() > NO_MOVE);
        let by = |ends: &[Joints]| {
            if moves_tip {
                let tip = tip(ends);
                return [tip.x, tip.y, tip.z, 0.0, 0.0];
            }
            let [first, second] = [0, 1].map(|k| ARM * (ends[1].rotary[k] - ends[0].rotary[k]));
            [0.0, 0.0, 0.0, first, second]
        };
        let length = joints.windows(2).map(|ends| norm(&by(ends))).sum();
        let unit = |ends: &[Joints]| {
            let by = by(ends);
            let length = norm(&by).max(f64::MIN_POSITIVE);
            by.map(|way| way / length)
        };
        let directions = [unit(&joints[..2]), unit(&joints[joints.len() - 2..])];
        (length > NO_MOVE).then_some(Self { joints, directions, length, moves_tip })
    }
}

fn norm(way: &[f64; 5]) -> f64 {
    way.iter().map(|one| one * one).sum::<f64>().sqrt()
}

/// Angle between two unit vectors, rad.
fn angle(a: &[f64; 5], b: &[f64; 5]) -> f64 {
    let [less, more] = [-1.0, 1.0].map(|sign| norm(&std::array::from_fn(|k| a[k] + sign * b[k])));
    2.0 * less.atan2(more)
}

/// The lines of a program, in pieces on which all axes move evenly.
#[derive(Default)]
struct Lines {
    stretches: Vec<EvenStretch>,
}

impl Lines {
    fn of(program: &[Waypoint], machine: &Machine, kinematics: &Kinematics, axes: &AxisLimits) -> Self {
        let mut lines = Self::default();
        let rapid = machine.rapid_rate / SECONDS_PER_MINUTE;
        let (mut blocks, mut ending): (Vec<Block>, [f64; 5]) = (Vec::new(), [0.0; 5]);
        // The first pieces of the blocks, and the lines of the program that each is part of, with their
        // lengths.
        let (mut firsts, mut whole): (Vec<usize>, Vec<f64>) = (Vec::new(), Vec::new());
        let mut of_whole = Vec::new();
        let (mut rests, mut last_pieces, mut tip_moved) = (true, 1, true);
        for ends in program.windows(2) {
            let pace = ends[1].pace;
            rests |= pace.rests || pace.from_unknown;
            if pace.from_unknown {
                continue;
            }
            let Some(line) = Line::new([&ends[0], &ends[1]], kinematics) else { continue };
            rests |= line.moves_tip != tip_moved;
            let pieces = line.joints.len() - 1;
            let length = line.length / pieces as f64;
            let asked = if pace.asked_s > 0.0 { line.length / pace.asked_s } else { f64::INFINITY };
            firsts.push(lines.stretches.len());
            match whole.last_mut().filter(|_| pace.goes_on) {
                Some(all) => *all += line.length,
                None => whole.push(line.length),
            }
            let mut slowest = f64::INFINITY;
            for (piece, joints) in line.joints.windows(2).enumerate() {
                let slope = way(&joints[0], &joints[1]).map(|by| by / length);
                // What the linear axes go together.
                let linear = slope[..3].iter().map(|one| one * one).sum::<f64>().sqrt();
                let feed = asked.min(rapid / linear);
                let stretch = EvenStretch {
                    step: ends[1].step,
                    length,
                    slope,
                    after_stop: rests && piece == 0,
                    line: line.length,
                    feed,
                    corner: f64::INFINITY,
                    along: machine.acceleration / linear,
                };
                slowest = slowest.min(feed.min(stretch.least(&axes.rates)));
                lines.stretches.push(stretch);
                of_whole.push(whole.len() - 1);
            }
            let [x, y, z, ..] = line.directions[1];
            let mut block = Block {
                length: line.length,
                direction: Vector3::new(x, y, z),
                rests,
                feed: slowest,
                ..Block::default()
            };
            if let Some(last) = blocks.last().filter(|_| !rests) {
                block.bend_from(last, angle(&ending, &line.directions[0]), machine);
                let stretch = &mut lines.stretches[firsts[firsts.len() - 1]];
                stretch.after_stop = block.turn > SHARP && (pieces > 1 || last_pieces > 1);
            }
            blocks.push(block);
            (ending, last_pieces, tip_moved, rests) = (line.directions[1], pieces, line.moves_tip, false);
        }
        slow_sudden_bends(&mut blocks, machine);
        for (first, block) in firsts.into_iter().zip(&blocks) {
            lines.stretches[first].corner = block.corner;
        }
        for (stretch, whole_line) in lines.stretches.iter_mut().zip(of_whole) {
            stretch.line = whole[whole_line];
        }
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixture::{machine, seconds};
    use super::*;
    use crate::kinematics::Pace;
    use approx::assert_relative_eq;
    use geometry::Point3;
    use motion::{ClPoint, Move, MoveKind, Toolpath};
    use work::monitor::Silent;

    const MACHINE: Machine = machine(1e12);

    /// A table that turns about the part's zero, 180 degrees/s and 10 rad/s²; linear axes go 200 mm/s.
    fn table() -> Kinematics {
        let [mut first, mut second] = crate::kinematics::preset("ac-table").unwrap();
        for axis in [&mut first, &mut second] {
            (axis.rate, axis.acceleration) = (std::f64::consts::PI, 10.0);
        }
        let made = Kinematics::new(first, second, 100.0, Point3::origin(), [None; 3]).unwrap();
        made.with_rates([200.0; 3]).with_accelerations([1000.0; 3])
    }

    fn place(x: f64, c: f64, asked_s: f64, way: Way) -> Waypoint {
        let kinematics = table();
        let turned = if kinematics.axes()[0].letter == 'C' { [c, 0.0] } else { [0.0, c] };
        let joints = match way {
            Way::Tip => kinematics.place(Point3::new(x, 0.0, 0.0), turned),
            _ => Joints { rotary: turned, ..kinematics.place(Point3::new(x, 0.0, 0.0), [0.0; 2]) },
        };
        Waypoint { joints, step: 0, way, pace: Pace { asked_s, ..Pace::default() } }
    }

    fn time(program: &[Waypoint], machine: &Machine) -> f64 {
        machining_time_of_program(program, machine, &table(), &Silent).unwrap()
    }

    const ROUND: f64 = 2.0 * std::f64::consts::PI;

    /// 2 s at full rate, and the time to reach it: wherever the tip stands, at rapid and at any feed that
    /// asks for less.
    #[test]
    fn a_turn_takes_the_time_of_its_axis() {
        let expected = 2.0 + std::f64::consts::PI / 10.0;
        for x in [0.0, 1e-7, 1.0, 200.0] {
            for asked_s in [0.0, 0.1] {
                let turn = [place(x, 0.0, 0.0, Way::Axes), place(x, ROUND, asked_s, Way::Axes)];
                assert_relative_eq!(time(&turn, &MACHINE), expected, max_relative = 5e-3);
                let back = [turn[0], turn[1], place(x, 0.0, asked_s, Way::Axes)];
                assert_relative_eq!(time(&back, &MACHINE), 2.0 * expected, max_relative = 5e-3);
            }
        }
        let slow = [place(5.0, 0.0, 0.0, Way::Axes), place(5.0, ROUND, 20.0, Way::Axes)];
        assert_relative_eq!(time(&slow, &MACHINE), 20.0, max_relative = 5e-3);
    }

    /// X and Y follow a circle of 200 mm about the table's axis; its time does not hang on how the program
    /// divides it.
    #[test]
    fn linear_axes_follow_a_turn_about_a_kept_tip() {
        let around = |lines: u32| {
            let at = |k: u32| place(200.0, ROUND * f64::from(k) / f64::from(lines), 0.01, Way::Tip);
            time(&(0..=lines).map(at).collect::<Vec<_>>(), &MACHINE)
        };
        let whole = around(1);
        // 1257 mm: X and Y go 200 mm/s each, and no more together than the rapid rate of 200.
        assert!((ROUND..1.1 * ROUND).contains(&whole), "{whole}");
        for lines in [2, 7, 100] {
            assert_relative_eq!(around(lines), whole, max_relative = 0.01);
        }
    }

    /// Without turns the path alone sets the time, chords of arcs and stops included.
    #[test]
    fn lines_without_turns_take_the_time_of_their_moves() {
        let tips = [[0.0; 3], [50.0, 0.0, 0.0], [50.0, 30.0, 0.0], [50.0, 30.0, 20.0], [0.0; 3]];
        let at = |tip: &[f64; 3]| ClPoint::upright(Point3::from(*tip));
        let step = |tip| Move { to: at(tip), kind: MoveKind::Cut, feed_rate: 6000.0, pass: 0 };
        let mut path = Toolpath::new(at(&tips[0]), tips[1..].iter().map(step).collect());
        let lengths: Vec<f64> = path.segments().map(|(a, b, _)| (b - a).norm()).collect();
        let of = |k: usize, pace: Pace| {
            let joints = table().place(Point3::from(tips[k]), [0.0; 2]);
            let asked_s = if k > 0 { lengths[k - 1] / 100.0 } else { 0.0 };
            Waypoint { joints, step: k, way: Way::Axes, pace: Pace { asked_s, ..pace } }
        };
        let mut program: Vec<Waypoint> = (0..5).map(|k| of(k, Pace::default())).collect();
        assert_relative_eq!(time(&program, &MACHINE), seconds(&path, &MACHINE), max_relative = 2e-3);
        program[2].pace.rests = true;
        path.origin.stops = vec![1];
        assert_relative_eq!(time(&program, &MACHINE), seconds(&path, &MACHINE), max_relative = 2e-3);
        program[1].pace.from_unknown = true;
        path.origin.approaches.push(0..1);
        assert_relative_eq!(time(&program, &MACHINE), seconds(&path, &MACHINE), max_relative = 2e-3);
        // One line of four pieces lasts no less than the control takes for one.
        let slow = Machine { block_rate: 0.1, ..MACHINE };
        let whole = |goes_on: bool| {
            let piece = |k: usize| of(k, Pace { goes_on: goes_on && k > 1, ..Pace::default() });
            time(&(0..5).map(piece).collect::<Vec<_>>(), &slow)
        };
        assert!((10.0..12.0).contains(&whole(true)), "{}", whole(true));
        assert!((40.0..45.0).contains(&whole(false)), "{}", whole(false));
    }
}
