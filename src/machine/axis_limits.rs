//! Speeds along a path at which every axis of a machine keeps its acceleration, and the time that they take.
//!
//! Enters: stages of a path, from rest to rest, each with its length and the way of every axis in it. Leaves:
//! the squared speed of the tip at the ends of the stages. With the squared speed x and the acceleration u of
//! the tip along the path, an axis accelerates by `q′ u + q″ x`, primes for derivatives by the length: limits
//! are linear in both. The greatest speeds follow in one sweep backward, for what can still be braked, and
//! one forward, for what can have been reached (H. Pham and Q.-C. Pham, "A new approach to time-optimal path
//! parameterization based on reachability analysis", 2018).
//!
//! u is constant within a stage. At a corner q′ changes over half of the pieces beside it, as in
//! [`super::time`]. Where axes have a limit of jerk, [`super::jerk`] lowers the speeds further. [`slow_axes`]
//! writes the speeds into the feeds of a path. Lengths in mm, speeds in mm/s; axes in mm or rad.

use super::blending::{Arcs, Straight};
use super::feeds::{ANY_RATE, in_series};
use super::jerk;
use super::kinematics::{JointPath, Joints, Kinematics, Turn};
use super::time::{Block, NO_MOVE, SECONDS_PER_MINUTE, profile};
use super::{Blending, Machine};
use geometry::Vector3;
use motion::Toolpath;
use work::monitor::{Cancelled, Monitor};

/// Halvings of the greatest squared speed from which a stage can be run.
const HALVINGS: usize = 40;

/// Stages of a ramp from rest to the feed. Speed rises by steps of a sixteenth of its square.
const RAMP: f64 = 16.0;

/// Pieces between which axes change their pace by less than this share of it belong to a bend.
const SMOOTH: f64 = 0.5;

/// Rounding of accelerations over their limits.
const ROUNDING: f64 = 1e-9;

/// Rotary axes turn by no more than this between two places at which the linear axes are told, rad, where the
/// control keeps the tip on its line.
const TURN: f64 = 0.02;

/// Places on one move at most.
const MOST_PLACES: f64 = 64.0;

/// A stretch on which all axes move evenly.
#[derive(Debug, Clone, Copy)]
pub(super) struct EvenStretch {
    /// The move.
    pub step: usize,
    pub length: f64,
    /// Axes over the tip: dq/ds.
    pub slope: [f64; 5],
    /// The tip stands before it, while rotary axes turn.
    pub after_stop: bool,
    /// Length of the program's line that it belongs to.
    pub line: f64,
    /// Feed, mm/s.
    pub feed: f64,
    /// Square of the speed at which the corner before it can be run at most; of no account after a stop.
    pub corner: f64,
    /// Greatest acceleration along it.
    pub along: f64,
}

impl EvenStretch {
    /// The least of limits of the axes, as one along the tip's way.
    pub fn least(&self, limits: &[f64; 5]) -> f64 {
        limits.iter().zip(&self.slope).map(|(limit, slope)| limit / slope.abs()).fold(f64::INFINITY, f64::min)
    }
}

/// What single axes allow: X, Y, Z and two rotary ones. Rates in mm/s or rad/s, accelerations in mm/s² or
/// rad/s², jerks in mm/s³ or rad/s³; what is infinite limits nothing.
#[derive(Debug, Clone, Copy)]
pub(super) struct AxisLimits {
    pub rates: [f64; 5],
    pub accelerations: [f64; 5],
    pub jerks: [f64; 5],
}

/// A part of a piece in which the tip accelerates evenly.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stage {
    /// The move that it belongs to.
    pub step: usize,
    pub length: f64,
    pub slope: [f64; 5],
    /// At its beginning and at its end: d²q/ds².
    pub bends: [[f64; 5]; 2],
    /// Greatest squared speed at its beginning.
    pub most: f64,
    /// Greatest acceleration along the path.
    pub along: f64,
    /// An axis in it has a limit of jerk.
    pub jerk: bool,
}

impl Stage {
    /// Its time, s, between squared speeds. From and to rest an acceleration that rises evenly takes half as
    /// long again as an even one.
    pub fn time(&self, [begin, end]: [f64; 2]) -> f64 {
        let even = 2.0 * self.length / (begin.sqrt() + end.sqrt());
        if self.jerk && (begin == 0.0 || end == 0.0) { 1.5 * even } else { even }
    }
}

/// How a path is run.
pub(super) struct Run {
    stages: Vec<Stage>,
    /// Squared speeds at the ends of all stages.
    speeds: Vec<f64>,
}

impl Run {
    pub fn new(
        pieces: &[EvenStretch],
        machine: &Machine,
        axes: &AxisLimits,
        monitor: &dyn Monitor,
    ) -> Result<Self, Cancelled> {
        let stages = stages(pieces, machine, axes);
        let speeds = speeds(&stages, axes);
        let speeds = jerk::within(&stages, speeds, axes, monitor)?;
        Ok(Self { stages, speeds })
    }

    /// s.
    pub fn time(&self) -> f64 {
        self.stages
            .iter()
            .zip(self.speeds.windows(2))
            .map(|(stage, ends)| stage.time([ends[0], ends[1]]))
            .sum()
    }

    /// The greatest speed within each of so many moves; 0 for moves of no length.
    fn peaks(&self, moves: usize) -> Vec<f64> {
        let mut peaks = vec![0.0f64; moves];
        for (stage, ends) in self.stages.iter().zip(self.speeds.windows(2)) {
            if let Some(peak) = peaks.get_mut(stage.step) {
                *peak = peak.max(ends[0].max(ends[1]).sqrt());
            }
        }
        peaks
    }
}

/// Time for the whole path, s, on a machine whose axes keep their rates, accelerations and jerks, besides all
/// that [`super::machining_time`] looks at. The machine stops where rotary axes turn about a tip that stands;
/// rises for rewinds are not counted. Infinite where [`super::machining_time`] is.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
///
/// # Tolerance
/// A model: stages that accelerate evenly take up to a few percent of a ramp longer than the quickest motion.
pub fn machining_time_of_axes(
    path: &Toolpath,
    machine: &Machine,
    kinematics: &Kinematics,
    joints: &JointPath,
    monitor: &dyn Monitor,
) -> Result<f64, Cancelled> {
    let Some(blocks) = profile(path, machine) else { return Ok(f64::INFINITY) };
    let (pieces, standing) = pieces(path, &blocks, machine, kinematics, joints);
    let run = Run::new(&pieces, machine, &kinematics.axis_limits(), monitor)?;
    Ok(standing + run.time())
}

/// Time, s, of the moves of an upright tool whose X, Y and Z keep the limits of a machine.
pub(super) fn time_of_linear(
    blocks: &[Block],
    machine: &Machine,
    monitor: &dyn Monitor,
) -> Result<f64, Cancelled> {
    Ok(linear(blocks, machine, monitor)?.time())
}

fn linear(blocks: &[Block], machine: &Machine, monitor: &dyn Monitor) -> Result<Run, Cancelled> {
    let piece = |block: &Block| {
        let Block { step, length, direction, line, rests, feed, corner, .. } = *block;
        let slope = [direction.x, direction.y, direction.z, 0.0, 0.0];
        EvenStretch {
            step,
            length,
            slope,
            after_stop: rests,
            line,
            feed,
            corner,
            along: machine.acceleration,
        }
    };
    let pieces: Vec<EvenStretch> = blocks.iter().map(piece).collect();
    let with_rotary = |[x, y, z]: [f64; 3]| [x, y, z, f64::INFINITY, f64::INFINITY];
    let axes = AxisLimits {
        rates: with_rotary(machine.rates.map(|rate| rate / SECONDS_PER_MINUTE)),
        accelerations: with_rotary(machine.accelerations),
        jerks: with_rotary(machine.jerks),
    };
    Run::new(&pieces, machine, &axes, monitor)
}

/// The path with feeds of its cuts and links at which all axes can be run, on the series of
/// [`super::slow_corners`]. No time grows by them: a move keeps the greatest speed that the machine reaches
/// in it. Rapids, plunges and lifts stay as they are, and so does a path for which no time can be told.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub fn slow_axes(
    path: &Toolpath,
    machine: &Machine,
    on_axes: Option<(&Kinematics, &JointPath)>,
    monitor: &dyn Monitor,
) -> Result<Toolpath, Cancelled> {
    let mut path = path.clone();
    // Words that slow down what is short anyway would only be more lines to run.
    let machine = &Machine { block_rate: ANY_RATE, ..*machine };
    let Some(blocks) = profile(&path, machine) else { return Ok(path) };
    let run = match on_axes {
        Some((kinematics, joints)) => {
            let (pieces, _) = pieces(&path, &blocks, machine, kinematics, joints);
            Run::new(&pieces, machine, &kinematics.axis_limits(), monitor)?
        }
        None if machine.limits_axes() && path.is_upright() => linear(&blocks, machine, monitor)?,
        None => return Ok(path),
    };
    let peaks = run.peaks(path.len());
    for (step, peak) in path.moves.iter_mut().zip(peaks) {
        if peak > 0.0 && step.kind.is_on_surface() {
            // No lower than a control creeps: what it still brakes is its own.
            let speed = (SECONDS_PER_MINUTE * peak).max(machine.creep_feed().min(step.feed_rate));
            step.feed_rate = in_series(speed, step.feed_rate);
        }
    }
    Ok(path)
}

/// Time, s, that no motion of the axes from location to location takes longer than, each from rest to rest.
pub fn axes_at_most(kinematics: &Kinematics, joints: &JointPath) -> f64 {
    let ends = std::iter::once(&joints.start).chain(joints.locations.iter().map(|to| &to.joints));
    let ways =
        ends.zip(&joints.locations).map(|(from, to)| from_rest_to_rest(&way(from, &to.joints), kinematics));
    ways.sum()
}

/// The pieces of a path, and the time that the tip stands while rotary axes turn, s.
fn pieces(
    path: &Toolpath,
    blocks: &[Block],
    machine: &Machine,
    kinematics: &Kinematics,
    joints: &JointPath,
) -> (Vec<EvenStretch>, f64) {
    let mut blocks = blocks.iter().peekable();
    let rapid = machine.rapid_rate / SECONDS_PER_MINUTE;
    let (mut last, mut tip) = (joints.start, path.start.tip);
    let (mut pieces, mut standing, mut after_stop) = (Vec::new(), 0.0, true);
    for location in &joints.locations {
        let (to, length) = (location.joints, (location.at.tip - tip).norm());
        if length > NO_MOVE {
            let evenly = joints.following.tip.is_finite();
            let turn = [0, 1].map(|k| (to.rotary[k] - last.rotary[k]).abs()).into_iter().fold(0.0, f64::max);
            let parts = if evenly { 1.0 } else { (turn / TURN).ceil().clamp(1.0, MOST_PLACES) };
            let mut before = last;
            let (step, line) = (location.step, length);
            while blocks.next_if(|block| block.step < step).is_some() {}
            let (feed, corner) = match blocks.peek().filter(|block| block.step == step) {
                Some(block) if pieces.last().is_some_and(|last: &EvenStretch| last.step != step) => {
                    (block.feed, block.corner)
                }
                Some(block) => (block.feed, f64::INFINITY),
                None => (rapid, f64::INFINITY),
            };
            for part in 1..=parts as u32 {
                let share = f64::from(part) / parts;
                let rotary = [0, 1].map(|k| last.rotary[k] + (to.rotary[k] - last.rotary[k]) * share);
                let there = tip + (location.at.tip - tip) * share;
                let now = if share == 1.0 { to } else { kinematics.place(there, rotary) };
                let length = length / parts;
                let slope = way(&before, &now).map(|way| way / length);
                let corner = if part == 1 { corner } else { f64::INFINITY };
                let along = machine.acceleration;
                pieces.push(EvenStretch { step, length, slope, after_stop, line, feed, corner, along });
                (before, after_stop) = (now, false);
            }
        } else if location.turn != Turn::Rewind && to != last {
            standing += from_rest_to_rest(&way(&last, &to), kinematics).max(1.0 / machine.block_rate);
            after_stop = true;
        }
        (last, tip) = (to, location.at.tip);
    }
    (pieces, standing)
}

pub(super) fn way(from: &Joints, to: &Joints) -> [f64; 5] {
    let (from, to) = (from.values(), to.values());
    std::array::from_fn(|k| to[k] - from[k])
}

/// The least time of a motion of all axes, s.
fn from_rest_to_rest(way: &[f64; 5], kinematics: &Kinematics) -> f64 {
    let limits = kinematics.rates().into_iter().zip(kinematics.accelerations()).zip(kinematics.jerks());
    let one = |(way, ((rate, most), jerk)): (&f64, ((f64, f64), f64))| {
        jerk::from_rest_to_rest(way.abs(), rate, most, jerk)
    };
    way.iter().zip(limits).map(one).fold(0.0, f64::max)
}

fn stages(pieces: &[EvenStretch], machine: &Machine, axes: &AxisLimits) -> Vec<Stage> {
    let limited = axes.jerks.iter().any(|most| most.is_finite());
    // Of each piece its feed, and the greatest squared speed at the corner before it.
    let of = |piece: &EvenStretch| {
        let feed = piece.feed.min(piece.least(&axes.rates)).min(piece.line * machine.block_rate);
        (feed, if piece.after_stop { 0.0 } else { piece.corner })
    };
    let limits: Vec<(f64, f64)> = pieces.iter().map(of).collect();
    let straight = |k: usize| {
        let piece = pieces.get(k)?;
        let corner = |k: usize| limits.get(k).map_or(0.0, |next| next.1);
        let direction = Vector3::from_column_slice(&piece.slope[..3]);
        Some(Straight { direction, length: piece.length, corners: [corner(k), corner(k + 1)] })
    };
    let arcs = machine.blending == Blending::Arcs;
    let mut stages = Vec::new();
    for (k, piece) in pieces.iter().enumerate() {
        let (feed, corner) = limits[k];
        let arcs = straight(k).filter(|_| arcs).map(|here| {
            let before = k.checked_sub(1).and_then(straight);
            Arcs::new(before.as_ref(), &here, straight(k + 1).as_ref(), machine)
        });
        let ends =
            [k.checked_sub(1).map(|k| &pieces[k]).zip(Some(piece)), Some(piece).zip(pieces.get(k + 1))];
        let bends = ends.map(|ends| ends.map(|(last, next)| bend(last, next)).unwrap_or_default());
        let smooth = ends.map(|ends| ends.is_some_and(|(last, next)| limited && is_smooth(last, next)));
        let slower = if k > 0 { feed.min(limits[k - 1].0) } else { feed };
        let most = piece.along.min(piece.least(&axes.accelerations));
        let jerk = piece.least(&axes.jerks);
        let slow = [corner, limits.get(k + 1).map_or(0.0, |next| next.1)];
        let division = match () {
            () if !limited => Division::Evenly { ramp: RAMP },
            () if slow.iter().any(|x| *x < 0.25 * feed * feed) => Division::ShorterAtEnds { each: 24 },
            () => Division::Evenly { ramp: 2.0 * RAMP },
        };
        let lengths = division.lengths(piece.length, 0.5 * feed * jerk::ramp(feed, most, jerk));
        let lengths = match &arcs {
            Some(arcs) => arcs.divided(lengths),
            None => lengths,
        };
        let (last, halves) = (lengths.len() - 1, lengths.len() == 2);
        let mut begin = 0.0;
        for (k, length) in lengths.into_iter().enumerate() {
            // The bend at a corner reaches half-way into the pieces beside, but behind a sharp one not along
            // those that the machine needs to speed up.
            let half = usize::from(2 * k > last);
            let bends = match k {
                _ if halves || smooth[half] => [bends[half]; 2],
                0 => [bends[0], [0.0; 5]],
                _ if k == last => [[0.0; 5], bends[1]],
                _ => [[0.0; 5]; 2],
            };
            let most = if k == 0 { corner.min(slower * slower) } else { feed * feed };
            let free = [f64::INFINITY; 2];
            let [along, within] =
                arcs.as_ref().map_or(free, |arcs| arcs.limits(piece.length, [begin, begin + length]));
            let (along, most) = (along.min(piece.along), most.min(within));
            let slope = piece.slope;
            stages.push(Stage { step: piece.step, length, slope, bends, most, along, jerk: limited });
            begin += length;
        }
    }
    stages
}

/// Whether axes hardly change their pace from one stretch to the next.
fn is_smooth(last: &EvenStretch, next: &EvenStretch) -> bool {
    let changes = |k: usize| (next.slope[k] - last.slope[k]).abs();
    let size = |k: usize| last.slope[k].abs().max(next.slope[k].abs());
    let norm = |of: &dyn Fn(usize) -> f64| (0..3).map(|k| of(k).powi(2)).sum::<f64>().sqrt();
    !next.after_stop && norm(&changes) < SMOOTH * norm(&size)
}

/// How axes bend at the corner between two pieces: their slopes change over half of both. Where the tip
/// stands, nothing bends.
fn bend(last: &EvenStretch, next: &EvenStretch) -> [f64; 5] {
    if next.after_stop {
        return [0.0; 5];
    }
    std::array::from_fn(|k| 2.0 * (next.slope[k] - last.slope[k]) / (next.length + last.length))
}

/// Into how many stages a piece is divided.
#[derive(Clone, Copy)]
enum Division {
    /// Of even length along ramps from rest to the feed.
    Evenly {
        /// Stages of a ramp.
        ramp: f64,
    },
    /// Beside corners that are run slowly: ever shorter towards both ends. The feed may be out of reach.
    ShorterAtEnds {
        /// Stages at each end.
        each: u32,
    },
}

impl Division {
    /// Lengths of the stages of a piece whose ramps from rest are as long as `ramp`.
    fn lengths(self, length: f64, ramp: f64) -> Vec<f64> {
        let long = length > 2.0 * ramp;
        let level = if long { vec![0.5 * (length - 2.0 * ramp); 2] } else { Vec::new() };
        match self {
            Self::Evenly { ramp: count } if long => {
                let ends = std::iter::repeat_n(ramp / count, count as usize);
                ends.clone().chain(level).chain(ends).collect()
            }
            Self::Evenly { ramp: count } => {
                let count = (count * length / ramp).ceil().max(2.0);
                vec![length / count; count as usize]
            }
            Self::ShorterAtEnds { each } => {
                let end = ramp.min(0.5 * length);
                let place = |k: u32| end * (f64::from(k) / f64::from(each)).powi(3);
                let ends = (0..each).map(|k| place(k + 1) - place(k));
                ends.clone().chain(level).chain(ends.rev()).collect()
            }
        }
    }
}

/// Squared speeds at the ends of all stages, without regard to jerk.
fn speeds(stages: &[Stage], axes: &AxisLimits) -> Vec<f64> {
    let limits = Limits { stages, axes };
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
    axes: &'a AxisLimits,
}

impl Limits<'_> {
    /// Least and greatest acceleration of the tip in a stage that begins with the squared speed `x` and ends
    /// with no more than `end`; the least is above the greatest where there is none.
    fn window(&self, k: usize, x: f64, end: f64) -> [f64; 2] {
        let stage = &self.stages[k];
        let twice = 2.0 * stage.length;
        let mut window = [(-x / twice).max(-stage.along), ((end - x) / twice).min(stage.along)];
        for (axis, most) in self.axes.accelerations.iter().enumerate() {
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
