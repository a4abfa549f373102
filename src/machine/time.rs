//! How long a machine takes for a path: trapezoids of velocity with look-ahead over the whole path.
//!
//! Every move is run at its feed (rapids at the rapid rate) as far as acceleration allows. At a corner that
//! turns by β the speed v is the least of
//! - the feeds of both moves;
//! - v² = a·δ·cos(β/2)/(1 − cos(β/2)): the corner is taken as if rounded by an arc that leaves it by the
//!   junction deviation δ, with centripetal acceleration a (S. K. Jeon, "Improving grbl: cornering
//!   algorithm", 2011);
//! - v² = a·(l/2)·cot(β/2), l the shorter of both moves: the arc must fit between the moves' middles. Without
//!   this second rule curves of short chords would be as fast as straight lines; with it an arc of radius ρ
//!   is run at √(a·ρ) whatever its chords (the rule of K. O'Connor's Klipper, "Kinematics");
//! - v² = ∛(24 δ j²)/|Δκ|: where the curvature changes suddenly by Δκ, the acceleration across the path would
//!   jump by v²Δκ. With the jerk j it rises over the time v²Δκ/j, and the tool strays from the path by a 24th
//!   of jump times the square of that time, which must stay within the junction deviation. Curvature at a
//!   corner is β over half of both moves' lengths.
//!
//! Where the control rounds corners by arcs, a at a corner is a share of the acceleration
//! ([`super::blending`]).
//!
//! A line of the program lasts at least as long as the control takes for it, be it one move or the chords of
//! an arc. No move is fed faster than at the rapid rate. Where a program dwells or stops the machine comes to
//! rest, and approaches, whose beginning nobody knows, do not count.
//!
//! What single axes need besides is in [`super::axis_limits`]: those of upright tools where the machine has
//! accelerations or jerks of their own, and those of machines with rotary axes. Rates of X, Y and Z are feeds
//! that no move of an upright tool exceeds.
//!
//! A backward pass then limits speeds to what can still be braked, a forward pass to what can have been
//! reached: both in one sweep, O(n). The path starts and ends at rest. Jerk along the path is that of single
//! axes, where they have limits of it; without, real machines take somewhat longer.

use std::ops::Range;

use super::Machine;
use super::axis_limits::time_of_linear;
use super::jerk;
use geometry::{Vector3, angle_between};
use motion::{Move, MoveKind, Toolpath};
use work::monitor::{Cancelled, Monitor};

pub(super) const SECONDS_PER_MINUTE: f64 = 60.0;

/// Moves no longer than this, mm, are what rounding leaves of none: programs are written to a ten-thousandth,
/// so that no control sees them, and the way before them goes on behind them. A greater length would hide
/// bends.
pub(super) const NO_MOVE: f64 = 1e-9;

/// A move with a length, in mm and s.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Block {
    /// Its index in the path.
    pub step: usize,
    pub length: f64,
    pub direction: Vector3,
    /// Length of the program's line that it belongs to.
    pub line: f64,
    /// The machine rests before it.
    pub rests: bool,
    /// Feed, mm/s.
    pub feed: f64,
    /// Square of the speed at which the corner before it can be run at most.
    pub corner: f64,
    /// Angle that the corner before it turns by, and its curvature, 1/mm.
    pub turn: f64,
    pub curvature: f64,
    /// Square of the speed at its start and at its end.
    pub entry: f64,
    pub exit: f64,
}

impl Block {
    /// Turns from the move before it by an angle, rad.
    pub fn bend_from(&mut self, last: &Self, turn: f64, machine: &Machine) {
        self.turn = turn;
        self.curvature = 2.0 * turn / (last.length + self.length);
        self.corner = corner_speed_squared(last, self, machine);
    }

    /// Square of the greatest speed within the move when its ends are run at the squared speeds `ends`.
    pub fn peak(&self, ends: [f64; 2], acceleration: f64) -> f64 {
        (0.5 * (ends[0] + ends[1]) + acceleration * self.length).min(self.feed * self.feed)
    }
}

/// Time for the whole path, s, dwells aside. Moves of no length, or of no more than a millionth of a
/// micrometre, take none. Infinite when a move has no positive feed or `machine` fails its
/// [`Machine::check`].
///
/// # Errors
/// [`Cancelled`] when the monitor says so, which only limits of jerk make necessary.
///
/// # Tolerance
/// A model of the machine (see the module), computed to f64 rounding.
pub fn machining_time(path: &Toolpath, machine: &Machine, monitor: &dyn Monitor) -> Result<f64, Cancelled> {
    let Some(blocks) = profile(path, machine) else { return Ok(f64::INFINITY) };
    if machine.limits_axes() && path.is_upright() {
        return time_of_linear(&blocks, machine, monitor);
    }
    Ok(blocks.iter().map(|block| block_time(block, machine.acceleration)).sum())
}

/// Time, s, that no path takes longer than, whose feeds lie between `slowest` and `fastest`, mm/min: from
/// rest to rest each move takes `l/v + v/a` or less. Rapids go at the rapid rate.
pub fn at_most(path: &Toolpath, machine: &Machine, [slowest, fastest]: [f64; 2]) -> f64 {
    let least = |limits: &[f64; 3], most: f64| limits.iter().copied().fold(most, f64::min);
    let most = least(&machine.accelerations, machine.acceleration);
    let ramps = jerk::ramp(fastest / SECONDS_PER_MINUTE, most, least(&machine.jerks, f64::INFINITY));
    let one = |(from, to, step): (geometry::Point3, geometry::Point3, &Move)| {
        let rapid = step.kind == MoveKind::Rapid;
        let slowest = if rapid { machine.rapid_rate } else { slowest.min(machine.rapid_rate) };
        let slowest = least(&machine.rates, slowest);
        (to - from).norm() * SECONDS_PER_MINUTE / slowest + ramps
    };
    path.segments().map(one).sum()
}

/// The moves that have a length, with their speeds; `None` when no time can be told.
pub(super) fn profile(path: &Toolpath, machine: &Machine) -> Option<Vec<Block>> {
    let acceleration = machine.acceleration;
    let mut blocks: Vec<Block> = Vec::with_capacity(path.len());
    let rates = if path.is_upright() { machine.rates } else { [f64::INFINITY; 3] };
    let mut stops = path.origin.stops.iter().peekable();
    let mut lines = lengths_of_lines(path).into_iter().peekable();
    let mut rests = true;
    for (k, ((from, to, step), counts)) in path.segments().zip(path.counts()).enumerate() {
        let length = (to - from).norm();
        rests |= stops.next_if(|stop| **stop as usize <= k).is_some() || !counts;
        if length <= NO_MOVE || !counts {
            continue;
        }
        while lines.next_if(|(moves, _)| moves.end as usize <= k).is_some() {}
        let line = lines.peek().filter(|(moves, _)| moves.start as usize <= k);
        let line = line.map_or(length, |(_, line)| *line);
        let (feed, direction) = (feed(step, machine), (to - from) / length);
        let of_axis = |k: usize| rates[k] / (SECONDS_PER_MINUTE * direction[k].abs());
        let fastest = (0..3).map(of_axis).fold(line * machine.block_rate, f64::min);
        // What is no number stays none.
        let feed = if feed > fastest { fastest } else { feed };
        if !(feed > 0.0 && length.is_finite() && machine.check().is_ok()) {
            return None;
        }
        let mut block = Block { step: k, length, direction, line, rests, feed, ..Block::default() };
        rests = false;
        if let Some(last) = blocks.last().filter(|_| !block.rests) {
            let turn = angle_between(&last.direction, &direction);
            block.bend_from(last, turn, machine);
        }
        blocks.push(block);
    }
    slow_sudden_bends(&mut blocks, machine);
    let mut exit = 0.0;
    for block in blocks.iter_mut().rev() {
        block.entry = block.corner.min(exit + 2.0 * acceleration * block.length);
        exit = block.entry;
    }
    let mut entry = 0.0;
    for k in 0..blocks.len() {
        let wanted = blocks.get(k + 1).map_or(0.0, |next| next.entry);
        let block = &mut blocks[k];
        block.entry = entry;
        block.exit = wanted.min(entry + 2.0 * acceleration * block.length);
        entry = block.exit;
    }
    Some(blocks)
}

/// Lowers the speeds at corners around which the curvature changes suddenly.
pub(super) fn slow_sudden_bends(blocks: &mut [Block], machine: &Machine) {
    // A bend begins with a corner of half its turn, so that a change shows over one corner or two. All of
    // them are run at its speed.
    let sudden = (24.0 * machine.junction_deviation * machine.jerk * machine.jerk).cbrt();
    for (k, apart) in (1..blocks.len()).flat_map(|k| [(k, 1), (k, 2)]) {
        let Some(around) = blocks.get_mut(k..=k + apart) else { continue };
        if around.iter().any(|block| block.rests) {
            continue;
        }
        let limit = sudden / (around[apart].curvature - around[0].curvature).abs();
        for block in around {
            block.corner = block.corner.min(limit);
        }
    }
}

/// The lines of a path of which several moves are pieces, with their lengths.
fn lengths_of_lines(path: &Toolpath) -> Vec<(Range<u32>, f64)> {
    let length = |k: u32| (path.moves[k as usize].to.tip - path.start_of(k as usize)).norm();
    path.origin.pieces.iter().map(|moves| (moves.clone(), moves.clone().map(length).sum())).collect()
}

/// mm/s.
fn feed(step: &Move, machine: &Machine) -> f64 {
    // What is no number stays none.
    let rapid = step.kind == MoveKind::Rapid || step.feed_rate > machine.rapid_rate;
    (if rapid { machine.rapid_rate } else { step.feed_rate }) / SECONDS_PER_MINUTE
}

/// Square of the greatest speed from one move into the next.
fn corner_speed_squared(last: &Block, next: &Block, machine: &Machine) -> f64 {
    let turn = next.turn;
    let (sin_quarter, (sin_half, cos_half)) = ((0.25 * turn).sin(), (0.5 * turn).sin_cos());
    // 1 − cos(β/2) = 2 sin²(β/4), which keeps its digits for small angles. Division by zero, for
    // moves in one line, gives infinity: no limit.
    let rounded = machine.junction_deviation * cos_half / (2.0 * sin_quarter * sin_quarter);
    let fitting = 0.5 * last.length.min(next.length) * cos_half / sin_half;
    let feed = last.feed.min(next.feed);
    (machine.across(&last.direction, &next.direction) * rounded.min(fitting).max(0.0)).min(feed * feed)
}

/// Time for one move from its entry to its exit speed: up to the feed or to where braking must begin,
/// along at the feed, down.
fn block_time(block: &Block, acceleration: f64) -> f64 {
    let (entry, exit) = (block.entry, block.exit);
    let peak = block.peak([entry, exit], acceleration);
    let (v_in, v_out, v) = (entry.sqrt(), exit.sqrt(), peak.sqrt());
    let ramps = (2.0 * peak - entry - exit) / (2.0 * acceleration);
    let level = (block.length - ramps).max(0.0);
    ((v - v_in) + (v - v_out)).max(0.0) / acceleration + level / v
}

#[cfg(test)]
mod tests {
    use super::super::fixture::{machine, path, seconds};
    use super::*;
    use approx::assert_relative_eq;

    const MACHINE: Machine = machine(1e12);

    fn time(tips: impl IntoIterator<Item = [f64; 3]>) -> f64 {
        seconds(&path(tips), &MACHINE)
    }

    #[test]
    fn a_trapezoid_a_triangle_and_a_rapid() {
        // 0.1 s up, 90 mm at 100 mm/s, 0.1 s down.
        assert_relative_eq!(time([[0.0; 3], [100.0, 0.0, 0.0]]), 1.1, epsilon = 1e-12);
        // 1.6 mm: half of it speeding up, t = 2·√(s/a).
        assert_relative_eq!(time([[0.0; 3], [0.0, 0.0, 1.6]]), 2.0 * (1.6e-3f64).sqrt(), epsilon = 1e-12);
        let mut rapid = path([[0.0; 3], [100.0, 0.0, 0.0]]);
        rapid.moves[0].kind = MoveKind::Rapid;
        // 200 mm/s: 0.2 s and 20 mm each for up and down, 60 mm level.
        assert_relative_eq!(seconds(&rapid, &MACHINE), 0.7, epsilon = 1e-12);
    }

    #[test]
    fn nothing_takes_no_time_and_no_feed_takes_for_ever() {
        assert_eq!(time([[1.0; 3]]), 0.0);
        assert_eq!(time([[1.0; 3], [1.0; 3]]), 0.0);
        // What rounding leaves across a way does not stop the machine.
        let speck = [[0.0; 3], [50.0, 0.0, 0.0], [50.0, 3.6e-15, 0.0], [100.0, 0.0, 0.0]];
        assert_relative_eq!(time(speck), 1.1, epsilon = 1e-12);
        let mut standing = path([[0.0; 3], [1.0, 0.0, 0.0]]);
        standing.moves[0].feed_rate = 0.0;
        assert_eq!(seconds(&standing, &MACHINE), f64::INFINITY);
        standing.moves[0].feed_rate = f64::NAN;
        assert_eq!(seconds(&standing, &MACHINE), f64::INFINITY);
        let still = Machine { acceleration: 0.0, ..MACHINE };
        assert_eq!(seconds(&path([[0.0; 3], [1.0; 3]]), &still), f64::INFINITY);
    }

    #[test]
    fn collinear_pieces_take_the_time_of_one_move() {
        let end = [81.3, -47.1, 12.9];
        let whole = time([[0.0; 3], end]);
        let pieces = (0..=1000).map(|k| end.map(|c| 0.001 * f64::from(k) * c));
        assert_relative_eq!(time(pieces), whole, max_relative = 1e-9);
        // Moves of no length in between change nothing.
        let doubled = (0..=1000).flat_map(|k| [end.map(|c| 0.001 * f64::from(k) * c); 2]);
        assert_relative_eq!(time(doubled), whole, max_relative = 1e-9);
    }

    #[test]
    fn a_right_angle_follows_the_junction_deviation() {
        // cos 45° = c: v² = 1000·0.01·c/(1 − c).
        let c = 0.5f64.sqrt();
        let corner: f64 = 10.0 * c / (1.0 - c);
        // From rest to 100 mm/s, level, down to the corner; the same backwards.
        let half = 0.1 + (100.0 - corner.sqrt()) / 1000.0 + (50.0 - 5.0 - (1e4 - corner) / 2000.0) / 100.0;
        let got = time([[0.0; 3], [50.0, 0.0, 0.0], [50.0, 50.0, 0.0]]);
        assert_relative_eq!(got, 2.0 * half, epsilon = 1e-12);
    }

    /// A machine has no axis that goes faster.
    #[test]
    fn no_feed_is_faster_than_the_rapid_rate() {
        let slow = Machine { rapid_rate: 1500.0, ..MACHINE };
        let line = path([[0.0; 3], [100.0, 0.0, 0.0]]);
        assert_relative_eq!(seconds(&line, &slow), 100.0 / 25.0 + 0.025, max_relative = 1e-9);
        assert!(seconds(&line, &slow) <= at_most(&line, &slow, [6000.0, 6000.0]) * (1.0 + 1e-9));
    }

    /// A dwell after each of ten moves in one line: all of them from rest to rest.
    #[test]
    fn the_machine_rests_where_the_program_stops() {
        let line = path((0..=10).map(|k| [f64::from(k), 0.0, 0.0]));
        let mut stopping = line.clone();
        stopping.origin.stops = (1..10).collect();
        let one = seconds(&path([[0.0; 3], [1.0, 0.0, 0.0]]), &MACHINE);
        assert_relative_eq!(seconds(&stopping, &MACHINE), 10.0 * one, max_relative = 1e-9);
        let own = Machine { accelerations: [1000.0; 3], ..MACHINE };
        assert_relative_eq!(seconds(&stopping, &own), 10.0 * one, max_relative = 2e-3);
        // A stop before a move of no length is one before the next.
        let mut doubled = path((0..=10).flat_map(|k| [[f64::from(k), 0.0, 0.0]; 2]));
        doubled.origin.stops = vec![10];
        let mut once = line;
        once.origin.stops = vec![5];
        assert_relative_eq!(seconds(&doubled, &MACHINE), seconds(&once, &MACHINE), max_relative = 1e-9);
    }

    #[test]
    fn approaches_take_no_time() {
        let mut line = path([[0.0, 0.0, 200.0], [0.0; 3], [100.0, 0.0, 0.0], [0.0; 3], [100.0, 0.0, 0.0]]);
        line.origin.approaches = vec![0..1, 2..3];
        let one = seconds(&path([[0.0; 3], [100.0, 0.0, 0.0]]), &MACHINE);
        assert_relative_eq!(seconds(&line, &MACHINE), 2.0 * one, max_relative = 1e-9);
    }

    #[test]
    fn chords_of_an_arc_are_one_line() {
        let line = path((0..=2000).map(|k| [0.05 * f64::from(k), 0.0, 0.0]));
        let mut arcs = line.clone();
        arcs.origin.pieces = vec![0..1000, 1000..2000];
        let slow = Machine { block_rate: 1000.0, ..MACHINE };
        assert_relative_eq!(seconds(&arcs, &slow), 1.1, max_relative = 1e-9);
        let own = Machine { accelerations: [1000.0; 3], ..slow };
        assert_relative_eq!(seconds(&arcs, &own), 1.1, max_relative = 2e-3);
        assert!(seconds(&line, &slow) > 2.0);
    }

    #[test]
    fn moves_shorter_than_a_line_takes_last_as_long_as_one() {
        // 100 mm in pieces of 0.05 mm: at 1000 lines a second no faster than 50 mm/s.
        let pieces = (0..=2000).map(|k| [0.05 * f64::from(k), 0.0, 0.0]);
        let slow = Machine { block_rate: 1000.0, ..MACHINE };
        let got = seconds(&path(pieces), &slow);
        assert_relative_eq!(got, 100.0 / 50.0 + 50.0 / 1000.0, max_relative = 1e-9);
        assert_relative_eq!(seconds(&path([[0.0; 3], [100.0, 0.0, 0.0]]), &slow), 1.1, epsilon = 1e-12);
    }

    #[test]
    fn no_axis_of_an_upright_tool_exceeds_its_rate() {
        let line = path([[0.0; 3], [60.0, 80.0, 0.0]]);
        // Y at 50 mm/s: 62.5 mm/s along the line.
        let slow = Machine { rates: [f64::INFINITY, 3000.0, 1.0], ..MACHINE };
        assert_relative_eq!(seconds(&line, &slow), 100.0 / 62.5 + 0.0625, max_relative = 1e-9);
        let words = super::super::slow_corners(&line, &slow);
        assert!(words.moves.iter().all(|step| 0.8 * step.feed_rate <= 3000.0 * (1.0 + 1e-9)));
        assert!(seconds(&line, &slow) <= at_most(&line, &slow, [6000.0, 6000.0]));
    }

    #[test]
    fn a_reversal_stops() {
        let there_and_back = time([[0.0; 3], [30.0, 0.0, 0.0], [0.0; 3]]);
        assert_relative_eq!(there_and_back, 2.0 * time([[0.0; 3], [30.0, 0.0, 0.0]]), epsilon = 1e-9);
    }

    #[test]
    fn an_arc_runs_at_its_centripetal_limit_whatever_its_chords() {
        // ρ = 4 mm: √(1000·4) = 63.25 mm/s, ten rounds.
        let speed = 4000f64.sqrt();
        let length = 20.0 * std::f64::consts::PI * 4.0;
        let expected = length / speed + speed / 1000.0;
        for chords in [1000u32, 2000, 5000] {
            let point = |k: u32| {
                let angle = 20.0 * std::f64::consts::PI * f64::from(k) / f64::from(10 * chords);
                [4.0 * angle.cos(), 4.0 * angle.sin(), 0.0]
            };
            let got = time((0..=10 * chords).map(point));
            // Between two corners the machine gains a·l/2 of v² and brakes again.
            assert_relative_eq!(got, expected, max_relative = 1.6 / f64::from(chords));
        }
    }

    #[test]
    fn no_path_takes_longer_than_from_rest_to_rest_at_the_lowest_feed() {
        let mut zigzag = path((0..50).map(|k| [f64::from(k % 7), f64::from(k * k % 11), f64::from(k % 3)]));
        for (k, step) in zigzag.moves.iter_mut().enumerate() {
            step.feed_rate = 100.0 + 100.0 * k as f64;
            step.kind = if k % 10 == 0 { MoveKind::Rapid } else { MoveKind::Cut };
        }
        let most = at_most(&zigzag, &MACHINE, [100.0, 12_000.0]);
        assert!(seconds(&zigzag, &MACHINE) < most);
        // One long move at the lowest feed takes nearly that.
        let long = path([[0.0; 3], [1000.0, 0.0, 0.0]]);
        assert_relative_eq!(at_most(&long, &MACHINE, [6000.0, 6000.0]), seconds(&long, &MACHINE));
    }

    #[test]
    fn braking_begins_moves_ahead() {
        // Short moves before a reversal: the whole takes the time of one move there, one back.
        let there = (0..=100).map(|k| [0.1 * f64::from(k), 0.0, 0.0]);
        let back = (0..100).rev().map(|k| [0.1 * f64::from(k), 0.0, 0.0]);
        let expected = 2.0 * time([[0.0; 3], [10.0, 0.0, 0.0]]);
        assert_relative_eq!(time(there.chain(back)), expected, max_relative = 1e-9);
    }

    /// A line into an arc of 4 mm and out again: Δκ = 1/4 mm limits v² to ∛(24·0.01·j²)·4.
    #[test]
    fn a_sudden_curvature_is_entered_at_what_the_jerk_allows() {
        for (jerk, limit) in [(5000.0, 4.0 * (0.24 * 25e6f64).cbrt()), (1e9, 4000.0)] {
            let machine = Machine { jerk, ..MACHINE };
            let angle = |k: u32| f64::from(k) * 1e-3;
            let arc = (0..=2000).map(|k| [4.0 * angle(k).sin(), 4.0 - 4.0 * angle(k).cos(), 0.0]);
            let line = (0..=10_000).map(|k| [-40.0 + 0.004 * f64::from(k), 0.0, 0.0]);
            let path = path(line.chain(arc));
            let blocks = profile(&path, &machine).unwrap();
            let joint = blocks.iter().find(|b| b.curvature > 0.2).unwrap();
            assert_relative_eq!(joint.entry, limit, max_relative = 2e-3);
            // Well inside the arc only its own radius counts.
            assert_relative_eq!(blocks[11_000].corner, 4000.0, max_relative = 1e-3);
        }
    }
}
