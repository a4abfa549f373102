//! Speeds along a path at which every axis of a machine keeps its acceleration, and the time that they take.
//!
//! Enters: stages of a path, from rest to rest, each with its length and the way of every axis in it. Leaves: the squared speed
//! of the tip at the ends of the stages. With the squared speed x and the acceleration u of the tip along the path, an axis
//! accelerates by `q′ u + q″ x`, primes for derivatives by the length: limits are linear in both. The greatest speeds follow in
//! one sweep backward, for what can still be braked, and one forward, for what can have been reached (H. Pham and Q.-C. Pham,
//! "A new approach to time-optimal path parameterization based on reachability analysis", 2018).
//!
//! u is constant within a stage. At a corner q′ changes over half of the pieces beside it, as in [`super::time`].
//! Lengths in mm, speeds in mm/s; axes in mm or rad.

use super::Machine;
use super::kinematics::{JointPath, Joints, Kinematics, Turn};
use super::time::{Block, NO_MOVE, SECONDS_PER_MINUTE, profile};
use motion::Toolpath;

/// Halvings of the greatest squared speed from which a stage can be run.
const HALVINGS: usize = 40;

/// Stages of a ramp from rest to the feed. Speed rises by steps of a sixteenth of its square.
const RAMP: f64 = 16.0;

/// Rounding of accelerations over their limits.
const ROUNDING: f64 = 1e-9;

/// Rotary axes turn by no more than this between two places at which the linear axes are told, rad, where the control keeps the
/// tip on its line.
const TURN: f64 = 0.02;

/// Places on one move at most.
const MOST_PLACES: f64 = 64.0;

/// A stretch on which all axes move evenly.
#[derive(Debug, Clone, Copy)]
struct EvenStretch {
    /// The move.
    step: usize,
    length: f64,
    /// Axes over the tip: dq/ds.
    slope: [f64; 5],
    /// The tip stands before it, while rotary axes turn.
    after_stop: bool,
}

/// What single axes allow: X, Y, Z and two rotary ones. Rates in mm/s or rad/s, accelerations in mm/s² or rad/s².
#[derive(Debug, Clone, Copy)]
struct AxisLimits {
    rates: [f64; 5],
    accelerations: [f64; 5],
}

/// A part of a piece in which the tip accelerates evenly.
#[derive(Debug, Clone, Copy)]
struct Stage {
    length: f64,
    slope: [f64; 5],
    /// At its beginning and at its end: d²q/ds².
    bends: [[f64; 5]; 2],
    /// Greatest squared speed at its beginning.
    most: f64,
}

/// Time for the whole path, s, on a machine whose axes keep their rates and accelerations, besides all that
/// [`super::machining_time`] looks at. The machine stops where rotary axes turn about a tip that stands; rises for rewinds are
/// not counted. Infinite where [`super::machining_time`] is.
///
/// # Tolerance
/// A model: stages that accelerate evenly take up to a few percent of a ramp longer than the quickest motion. Jerk is limited at
/// bends only.
pub fn machining_time_of_axes(
    path: &Toolpath,
    machine: &Machine,
    kinematics: &Kinematics,
    joints: &JointPath,
) -> f64 {
    let Some(blocks) = profile(path, machine) else { return f64::INFINITY };
    let (pieces, standing) = pieces(path, kinematics, joints);
    let axes = AxisLimits { rates: kinematics.rates(), accelerations: kinematics.accelerations() };
    standing + time_of_pieces(&pieces, &blocks, machine, &axes)
}

/// Time, s, of the moves of an upright tool whose X, Y and Z keep the rates and accelerations of a machine.
pub(super) fn time_of_linear(blocks: &[Block], machine: &Machine) -> f64 {
    let piece = |(k, block): (usize, &Block)| {
        let Block { step, length, direction, .. } = *block;
        let slope = [direction.x, direction.y, direction.z, 0.0, 0.0];
        EvenStretch { step, length, slope, after_stop: k == 0 }
    };
    let pieces: Vec<EvenStretch> = blocks.iter().enumerate().map(piece).collect();
    let with_rotary = |[x, y, z]: [f64; 3]| [x, y, z, f64::INFINITY, f64::INFINITY];
    let rates = with_rotary(machine.rates.map(|rate| rate / SECONDS_PER_MINUTE));
    let axes = AxisLimits { rates, accelerations: with_rotary(machine.accelerations) };
    time_of_pieces(&pieces, blocks, machine, &axes)
}

fn time_of_pieces(pieces: &[EvenStretch], blocks: &[Block], machine: &Machine, axes: &AxisLimits) -> f64 {
    let stages = stages(pieces, blocks, machine, axes);
    let speeds = speeds(&stages, &axes.accelerations, machine.acceleration);
    let time = |(stage, ends): (&Stage, &[f64])| 2.0 * stage.length / (ends[0].sqrt() + ends[1].sqrt());
    stages.iter().zip(speeds.windows(2)).map(time).sum()
}

/// Time, s, that no motion of the axes from location to location takes longer than, each from rest to rest.
pub fn axes_at_most(kinematics: &Kinematics, joints: &JointPath) -> f64 {
    let ends = std::iter::once(&joints.start).chain(joints.locations.iter().map(|to| &to.joints));
    let ways =
        ends.zip(&joints.locations).map(|(from, to)| from_rest_to_rest(&way(from, &to.joints), kinematics));
    ways.sum()
}

/// The pieces of a path, and the time that the tip stands while rotary axes turn, s.
fn pieces(path: &Toolpath, kinematics: &Kinematics, joints: &JointPath) -> (Vec<EvenStretch>, f64) {
    let (mut last, mut tip) = (joints.start, path.start.tip);
    let (mut pieces, mut standing, mut after_stop) = (Vec::new(), 0.0, true);
    for location in &joints.locations {
        let (to, length) = (location.joints, (location.at.tip - tip).norm());
        if length > NO_MOVE {
            let evenly = joints.following.tip.is_finite();
            let turn = [0, 1].map(|k| (to.rotary[k] - last.rotary[k]).abs()).into_iter().fold(0.0, f64::max);
            let parts = if evenly { 1.0 } else { (turn / TURN).ceil().clamp(1.0, MOST_PLACES) };
            let mut before = last;
            for part in 1..=parts as u32 {
                let share = f64::from(part) / parts;
                let rotary = [0, 1].map(|k| last.rotary[k] + (to.rotary[k] - last.rotary[k]) * share);
                let there = tip + (location.at.tip - tip) * share;
                let now = if share == 1.0 { to } else { kinematics.place(there, rotary) };
                let length = length / parts;
                let slope = way(&before, &now).map(|way| way / length);
                pieces.push(EvenStretch { step: location.step, length, slope, after_stop });
                (before, after_stop) = (now, false);
            }
        } else if location.turn != Turn::Rewind && to != last {
            standing += from_rest_to_rest(&way(&last, &to), kinematics);
            after_stop = true;
        }
        (last, tip) = (to, location.at.tip);
    }
    (pieces, standing)
}

fn way(from: &Joints, to: &Joints) -> [f64; 5] {
    let (from, to) = (from.values(), to.values());
    std::array::from_fn(|k| to[k] - from[k])
}

/// The least time of a motion of all axes, s.
fn from_rest_to_rest(way: &[f64; 5], kinematics: &Kinematics) -> f64 {
    let limits = kinematics.rates().into_iter().zip(kinematics.accelerations());
    let one = |(way, (rate, most)): (&f64, (f64, f64))| {
        let way = way.abs();
        // Without a level stretch where the rate is not reached.
        if way * most < rate * rate { 2.0 * (way / most).sqrt() } else { way / rate + rate / most }
    };
    way.iter().zip(limits).map(one).fold(0.0, f64::max)
}

fn stages(pieces: &[EvenStretch], blocks: &[Block], machine: &Machine, axes: &AxisLimits) -> Vec<Stage> {
    let mut stages = Vec::new();
    let mut before: Option<(&EvenStretch, f64)> = None;
    let mut blocks = blocks.iter().peekable();
    for (k, piece) in pieces.iter().enumerate() {
        while blocks.next_if(|block| block.step < piece.step).is_some() {}
        let block = blocks.peek().filter(|block| block.step == piece.step);
        let least = |limits: &[f64; 5]| {
            let each = limits.iter().zip(&piece.slope).map(|(limit, slope)| limit / slope.abs());
            each.fold(f64::INFINITY, f64::min)
        };
        let feed = block.map_or(machine.rapid_rate / SECONDS_PER_MINUTE, |block| block.feed);
        let feed = feed.min(least(&axes.rates));
        let corner = match (&before, block) {
            _ if piece.after_stop => 0.0,
            (Some((last, _)), Some(block)) if last.step != piece.step => block.corner,
            _ => f64::INFINITY,
        };
        let bends = [
            k.checked_sub(1).map(|k| bend(&pieces[k], piece)),
            pieces.get(k + 1).map(|next| bend(piece, next)),
        ];
        let bends = bends.map(Option::unwrap_or_default);
        let slower = before.map_or(feed, |(_, last)| feed.min(last));
        let lengths =
            divided(piece.length, 0.5 * feed * feed / machine.acceleration.min(least(&axes.accelerations)));
        let (last, halves) = (lengths.len() - 1, lengths.len() == 2);
        for (k, length) in lengths.into_iter().enumerate() {
            // The bend at a corner reaches half-way into the pieces beside, but not along those that the machine needs to speed up.
            let bends = match k {
                _ if halves => [bends[k]; 2],
                0 => [bends[0], [0.0; 5]],
                _ if k == last => [[0.0; 5], bends[1]],
                _ => [[0.0; 5]; 2],
            };
            let most = if k == 0 { corner.min(slower * slower) } else { feed * feed };
            stages.push(Stage { length, slope: piece.slope, bends, most });
        }
        before = Some((piece, feed));
    }
    stages
}

/// How axes bend at the corner between two pieces: their slopes change over half of both. Where the tip stands, nothing bends.
fn bend(last: &EvenStretch, next: &EvenStretch) -> [f64; 5] {
    if next.after_stop {
        return [0.0; 5];
    }
    std::array::from_fn(|k| 2.0 * (next.slope[k] - last.slope[k]) / (next.length + last.length))
}

/// Lengths of the stages of a piece whose ramps from rest are as long as `ramp`.
fn divided(length: f64, ramp: f64) -> Vec<f64> {
    if length > 2.0 * ramp {
        let ends = std::iter::repeat_n(ramp / RAMP, RAMP as usize);
        let level = 0.5 * (length - 2.0 * ramp);
        return ends.clone().chain([level; 2]).chain(ends).collect();
    }
    let count = (RAMP * length / ramp).ceil().max(2.0);
    vec![length / count; count as usize]
}

/// Squared speeds at the ends of all stages.
fn speeds(stages: &[Stage], accelerations: &[f64; 5], along: f64) -> Vec<f64> {
    let limits = Limits { stages, accelerations, along };
    let mut highest = vec![0.0; stages.len() + 1];
    for k in (0..stages.len()).rev() {
        highest[k] = if k == 0 { 0.0 } else { limits.highest(k, highest[k + 1]) };
    }
    let mut speeds = vec![0.0; stages.len() + 1];
    for (k, stage) in stages.iter().enumerate() {
        let [_, most] = limits.window(k, speeds[k], highest[k + 1]);
        speeds[k + 1] = (speeds[k] + 2.0 * stage.length * most).clamp(0.0, highest[k + 1]);
    }
    speeds
}

struct Limits<'a> {
    stages: &'a [Stage],
    accelerations: &'a [f64; 5],
    along: f64,
}

impl Limits<'_> {
    /// Least and greatest acceleration of the tip in a stage that begins with the squared speed `x` and ends with no more than
    /// `end`; the least is above the greatest where there is none.
    fn window(&self, k: usize, x: f64, end: f64) -> [f64; 2] {
        let stage = &self.stages[k];
        let twice = 2.0 * stage.length;
        let mut window = [(-x / twice).max(-self.along), ((end - x) / twice).min(self.along)];
        for (axis, most) in self.accelerations.iter().enumerate() {
            let most = most * (1.0 + ROUNDING);
            let slope = stage.slope[axis];
            let [begin, end] = stage.bends.map(|bend| bend[axis]);
            for (bend, factor) in [(begin, slope), (end, slope + twice * end)] {
                // |bend·x + factor·u| ≤ most
                let fixed = bend * x;
                if factor.abs() > f64::MIN_POSITIVE {
                    let ends = [(-most - fixed) / factor, (most - fixed) / factor];
                    window[0] = window[0].max(ends[0].min(ends[1]));
                    window[1] = window[1].min(ends[0].max(ends[1]));
                } else if fixed.abs() > most {
                    window[1] = f64::NEG_INFINITY;
                }
            }
        }
        window
    }

    /// The greatest squared speed from which a stage can be run so that it ends with no more than `end`.
    fn highest(&self, k: usize, end: f64) -> f64 {
        let can = |x: f64| {
            let [least, greatest] = self.window(k, x, end);
            least <= greatest
        };
        let (mut low, mut high) = (0.0, self.stages[k].most);
        if can(high) {
            return high;
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            *(if can(middle) { &mut low } else { &mut high }) = middle;
        }
        low
    }
}

#[cfg(test)]
mod tests;
