//! What a machine has to do for a path: ranges, turning, singular poses, rewinds, limits, time.

use super::choice::LIMIT_SLACK;
use super::follow::{JointPath, Turn, passes};
use super::{Joints, Kinematics};
use geometry::{Point3, Vector3, angle_between};
use motion::{MoveKind, Toolpath};
use std::f64::consts::PI;

/// Within this angle of a singular pose the first rotary axis turns by nearly half a turn while the tool
/// hardly tilts: such places are told, rad (1°).
pub const SINGULAR_ANGLE: f64 = PI / 180.0;

/// Rotary joints turn by no more than this between two looks at the pace of linear ones, rad. What it may be
/// greater by in between is added: a twenty thousandth where one axis turns.
const PACE_TURN: f64 = 0.02;

/// Linear joints come no farther than is told by this, mm.
const FARTHEST: f64 = 1e-7;

/// A place where the tool axis comes close to the first rotary axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SingularPose {
    /// Move in which it comes closest.
    pub step: usize,
    /// How close, rad.
    pub angle: f64,
}

/// A turn for which the tool has to leave the part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rewind {
    /// The move that follows it.
    pub step: usize,
    /// By how much the rotary joints turn, rad.
    pub turn: [f64; 2],
    /// True between two rapid moves, where programs can rise for it.
    pub clear: bool,
}

/// A joint out of its limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LimitViolation {
    /// Move in which it is farthest out.
    pub step: usize,
    /// The joint's letter.
    pub joint: char,
    /// Its value there, mm or rad.
    pub value: f64,
    /// The limit that it is beyond.
    pub limit: f64,
}

/// What a machine has to do for a path.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct JointReport {
    /// Least and greatest value of each joint, mm and rad.
    pub ranges: [[f64; 2]; 5],
    /// How far both rotary joints turn in all, rad.
    pub rotary_travel: [f64; 2],
    /// Points put in on moves.
    pub inserted: usize,
    /// Places within [`SINGULAR_ANGLE`] of a singular pose; moves in a row are one.
    pub singular: Vec<SingularPose>,
    /// Turns that leave the path.
    pub rewinds: Vec<Rewind>,
    /// Joints out of their limits, each row of locations once.
    pub violations: Vec<LimitViolation>,
}

/// What forbids a program.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Obstacle {
    /// A joint would have to leave its limits.
    #[error("move {} needs {} at {value:.3}, beyond its limit {limit:.3} (mm or degrees): set the part up otherwise, or widen the limits if the machine allows it", violation.step, violation.joint,
        value = violation.shown(violation.value), limit = violation.shown(violation.limit))]
    Limit {
        /// The first of them.
        violation: LimitViolation,
    },
    /// The joints would have to unwind while the tool is at the part.
    #[error("before move {} the rotary joints have to unwind while the tool is at the part: widen their limits if the machine allows it, or divide the toolpath there", rewind.step)]
    Rewind {
        /// The first of them.
        rewind: Rewind,
    },
}

impl LimitViolation {
    /// A value of the joint in mm or degrees.
    pub fn shown(&self, value: f64) -> f64 {
        if "XYZ".contains(self.joint) { value } else { value.to_degrees() }
    }
}

/// Places where the tool axis comes within [`SINGULAR_ANGLE`] of the first rotary axis.
pub(super) fn singular(kinematics: &Kinematics, path: &Toolpath) -> Vec<SingularPose> {
    let pole = kinematics.triangle.pole;
    let from_pole = |axis: &Vector3| {
        let angle = angle_between(axis, &pole);
        angle.min(PI - angle)
    };
    let mut places: Vec<SingularPose> = Vec::new();
    let mut last = None;
    for (step, next) in path.moves.iter().enumerate() {
        let (from, to) = (path.location_before(step).axis, next.to.axis);
        let between = passes(&from, &to, &pole).map_or(PI, |(_, _, off)| off);
        let angle = from_pole(&from).min(from_pole(&to)).min(between);
        if angle > SINGULAR_ANGLE {
            continue;
        }
        match places.last_mut() {
            Some(place) if last == step.checked_sub(1) && last.is_some() => {
                if angle < place.angle {
                    *place = SingularPose { step, angle };
                }
            }
            _ => places.push(SingularPose { step, angle }),
        }
        last = Some(step);
    }
    places
}

impl JointPath {
    /// Ranges, travel and limits.
    pub(super) fn measure(&mut self, kinematics: &Kinematics) {
        let (limits, letters) = (kinematics.limits(), kinematics.letters());
        let tip_kept = !self.following.tip.is_finite();
        let report = &mut self.report;
        report.ranges = self.start.values().map(|value| [value; 2]);
        let mut last = (self.start, kinematics.forward(&self.start).tip);
        // Of each joint the violation that the row of locations before has made.
        let mut open: [Option<usize>; 5] = [None; 5];
        let start = (self.start, last.1, 0, false);
        let locations = self.locations.iter();
        let locations = locations.map(|at| (at.joints, at.at.tip, at.step, at.turn != Turn::Rewind));
        for (joints, tip, step, along) in std::iter::once(start).chain(locations) {
            let mut reached = joints.values().map(|value| [value; 2]);
            if tip_kept && along && joints.rotary != last.0.rotary {
                let known = std::array::from_fn(|k| {
                    let [low, high] = report.ranges[k];
                    limits[k].map_or([low, high], |[least, greatest]| [low.max(least), high.min(greatest)])
                });
                let between = kinematics.farthest(&last, &(joints, tip), known);
                (0..3).for_each(|k| reached[k] = join(reached[k], between[k]));
            }
            for k in [0, 1] {
                report.rotary_travel[k] += (joints.rotary[k] - last.0.rotary[k]).abs();
            }
            last = (joints, tip);
            for (k, [low, high]) in reached.into_iter().enumerate() {
                report.ranges[k] = join(report.ranges[k], [low, high]);
                let beyond = limits[k].and_then(|[least, greatest]| {
                    let (value, limit) =
                        if least - low > high - greatest { (low, least) } else { (high, greatest) };
                    ((value - value.clamp(least, greatest)).abs() > LIMIT_SLACK).then_some((value, limit))
                });
                let Some((value, limit)) = beyond else {
                    open[k] = None;
                    continue;
                };
                let found = LimitViolation { step, joint: letters[k], value, limit };
                match open[k] {
                    None => {
                        open[k] = Some(report.violations.len());
                        report.violations.push(found);
                    }
                    Some(at) => {
                        let worst = &mut report.violations[at];
                        if (value - limit).abs() > (worst.value - worst.limit).abs() {
                            *worst = found;
                        }
                    }
                }
            }
        }
    }

    /// The least time of each of the path's `moves` moves by the rates of the joints, s.
    pub fn least_times(&self, kinematics: &Kinematics, moves: usize) -> Vec<f64> {
        let mut times = vec![0.0; moves];
        let (mut last, mut tip) = (self.start, kinematics.forward(&self.start).tip);
        for location in &self.locations {
            if let Some(time) = times.get_mut(location.step) {
                *time += self.least_time(kinematics, &(last, tip), &(location.joints, location.at.tip));
            }
            (last, tip) = (location.joints, location.at.tip);
        }
        times
    }

    /// The least time of a line between joints with their tips by the rates of the joints, s.
    pub fn least_time(&self, kinematics: &Kinematics, from: &(Joints, Point3), to: &(Joints, Point3)) -> f64 {
        let paces = self.paces(kinematics, from, to);
        paces.into_iter().zip(kinematics.rates()).map(|(pace, rate)| pace / rate).fold(0.0, f64::max)
    }

    /// A bound of the greatest pace of each joint on a line, over the time of the whole, mm or rad.
    fn paces(
        &self,
        kinematics: &Kinematics,
        (from, tip): &(Joints, Point3),
        (to, end): &(Joints, Point3),
    ) -> [f64; 5] {
        let (a, b) = (from.values(), to.values());
        let mut paces = std::array::from_fn(|k| (b[k] - a[k]).abs());
        if self.following.tip.is_finite() {
            return paces;
        }
        // Where the control keeps the tip on its line, linear joints run along curves.
        let (way, turns) = (end - tip, [b[3] - a[3], b[4] - a[4]]);
        let parts = (paces[3].max(paces[4]) / PACE_TURN).ceil().max(1.0);
        // Off the chord between two looks a function is by an eighth of its second derivative times their
        // distance squared.
        let between = kinematics.pace_bends(*tip, way, turns) / (8.0 * parts * parts);
        for part in 0..=parts as u32 {
            let share = f64::from(part) / parts;
            let rotary = [0, 1].map(|k| a[3 + k] + turns[k] * share);
            let pace = kinematics.pace(tip + way * share, way, rotary, turns);
            (0..3).for_each(|k| paces[k] = (pace[k].abs() + between).max(paces[k]));
        }
        paces
    }
}

impl JointPath {
    /// The fastest motion of each joint, mm/s and rad/s, where every move runs at its feed, or as fast as its
    /// slowest joint lets it. `rapid_rate` in mm/min.
    pub fn fastest(&self, kinematics: &Kinematics, path: &Toolpath, rapid_rate: f64) -> [f64; 5] {
        let mut fastest = [0.0f64; 5];
        let (mut last, mut tip) = (self.start, path.start.tip);
        for location in &self.locations {
            let step = path.moves.get(location.step);
            let rate =
                step.map_or(rapid_rate, |s| if s.kind == MoveKind::Rapid { rapid_rate } else { s.feed_rate });
            let length = (location.at.tip - tip).norm();
            let time = (60.0 * length / rate).max(self.least_time(
                kinematics,
                &(last, tip),
                &(location.joints, location.at.tip),
            ));
            // What rounding leaves of a move has no rate.
            if time > 1e-9 {
                let paces = self.paces(kinematics, &(last, tip), &(location.joints, location.at.tip));
                fastest.iter_mut().zip(paces).for_each(|(fastest, pace)| *fastest = fastest.max(pace / time));
            }
            (last, tip) = (location.joints, location.at.tip);
        }
        fastest
    }

    /// The highest nose, machine coordinates, mm, at which programs come down to the path or leave it: over
    /// all its tips along the machine's z.
    pub fn highest_nose(&self, kinematics: &Kinematics, path: &Toolpath) -> f64 {
        let rewinds = self.locations.iter().filter(|at| at.turn == Turn::Rewind);
        let poses = rewinds.chain(self.locations.last()).map(|at| (at.joints, at.at.tip));
        let poses = poses.chain([(self.start, path.start.tip)]);
        let nose = |(joints, tip): (Joints, Point3)| {
            let over = kinematics.over(path, joints.rotary, tip);
            kinematics.place(over, joints.rotary).linear.z
        };
        poses.map(nose).fold(f64::NEG_INFINITY, f64::max)
    }
}

/// The range that holds two.
fn join(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

impl Kinematics {
    /// Least and greatest values of the linear joints, mm, where the tip runs straight from one place to
    /// another while the rotary joints turn evenly. Those that are no farther out than `known` need not be
    /// the extremes.
    ///
    /// # Tolerance
    /// [`FARTHEST`]
    fn farthest(
        &self,
        (from, tip): &(Joints, Point3),
        (to, end): &(Joints, Point3),
        known: [[f64; 2]; 3],
    ) -> [[f64; 2]; 3] {
        let (way, turns) = (end - tip, [0, 1].map(|k| to.rotary[k] - from.rotary[k]));
        let bend = self.pace_bends(*tip, way, turns);
        let at = |share: f64| {
            let rotary = [0, 1].map(|k| from.rotary[k] + turns[k] * share);
            self.place(tip + way * share, rotary).linear
        };
        let [a, b] = [from.linear, to.linear];
        let mut reached: [[f64; 2]; 3] = std::array::from_fn(|k| join([a[k]; 2], [b[k]; 2]));
        let mut ahead = vec![([0.0, 1.0], [a, b])];
        while let Some(([low, high], [a, b])) = ahead.pop() {
            let share = 0.5 * (low + high);
            let middle = at(share);
            // Off its chord a function is by an eighth of its second derivative in the middle, which is four
            // second differences, and a 48th of a bound of the third each for either.
            let third = bend * (high - low).powi(3) / 24.0;
            let mut is_open = false;
            for k in 0..3 {
                let off = 0.5 * (a[k] + b[k] - 2.0 * middle[k]).abs() + third;
                reached[k] = join(reached[k], [middle[k]; 2]);
                let [least, greatest] = join(reached[k], known[k]);
                is_open |=
                    a[k].max(b[k]) + off > greatest + FARTHEST || a[k].min(b[k]) - off < least - FARTHEST;
            }
            if is_open {
                ahead.extend([([low, share], [a, middle]), ([share, high], [middle, b])]);
            }
        }
        reached
    }

    /// The place over a tip along the machine's z that is as high as the highest tip of the path while the
    /// table stands so.
    pub fn over(&self, path: &Toolpath, rotary: [f64; 2], tip: Point3) -> Point3 {
        let up = self.upward(rotary);
        let height = |tip: &Point3| up.dot(&tip.coords);
        let tips =
            std::iter::once(&path.start).chain(path.moves.iter().map(|m| &m.to)).map(|at| height(&at.tip));
        tip + up * (tips.fold(height(&tip), f64::max) - height(&tip))
    }
}

impl JointReport {
    /// What forbids to make a program: the first joint out of its limits or the first rewind at the part.
    pub fn obstacle(&self) -> Option<Obstacle> {
        let limit = self.violations.first().map(|violation| Obstacle::Limit { violation: *violation });
        let rewind = self.rewinds.iter().find(|rewind| !rewind.clear);
        limit.or(rewind.map(|rewind| Obstacle::Rewind { rewind: *rewind }))
    }
}
