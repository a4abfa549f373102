//! The links of a machine, and how one moves as seen from another along a program.
//!
//! Enters: a machine, the joints that a program goes through, mm and rad. Leaves: where a link stands in
//! machine coordinates, and for each stretch of the program where it begins and ends as seen from another
//! link. Stretches on which links turn are divided so that between the ends a body runs nearly straight and
//! turns nearly evenly.
//!
//! Links are named by the joint that moves them last, seen from the frame: the frame itself, `Z` that all
//! linear axes move, and each rotary axis. The linear axes count as if they moved the head. Bodies on the
//! frame and in the table are in machine coordinates, those in the head have their origin at the spindle
//! nose; all rotary axes at zero.

use super::{Joints, Kinematics, RotaryAxis, Side};
use geometry::{Isometry3, Point3, Vector3};
use nalgebra::{Translation3, UnitQuaternion};

/// How far a place of a body may be off its way between two ends of a stretch, mm. Less makes more stretches,
/// as the root of it.
pub const STRAY: f64 = 0.005;

/// The most that links turn in a stretch, rad.
const MOST_TURN: f64 = 1.0;

/// What bodies of a machine are fixed to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Link {
    /// What no rotary axis turns on the side of the workpiece.
    Frame,
    /// What X, Y and Z move, and no rotary axis.
    Linear,
    /// What the first (0) or the second (1) rotary axis turns.
    Rotary(usize),
}

/// A machine as a chain of links, with or without rotary axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chain {
    kinematics: Option<Kinematics>,
    gauge_length: f64,
    workpiece_zero: Point3,
}

/// Joints that a program goes through.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Waypoint {
    /// The joints.
    pub joints: Joints,
    /// The move of the path that leads there, or that the approach belongs to.
    pub step: usize,
    /// How the machine comes there.
    pub way: Way,
    /// How fast the program asks for that; of no account where a path has the feeds.
    pub pace: Pace,
}

/// How fast a program asks for the way to a place.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Pace {
    /// Time that the feed asks for, s; 0 at rapid.
    pub asked_s: f64,
    /// It is a further piece of one line, as the chords of an arc are.
    pub goes_on: bool,
    /// The machine comes to rest before it.
    pub rests: bool,
    /// The program does not tell where it begins.
    pub from_unknown: bool,
}

/// How a machine goes from one place of a program to the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// All joints run straight, off the path.
    Approach,
    /// All joints run straight, along the path.
    Axes,
    /// Rotary joints run straight, and so does the tip, along the path.
    Tip,
}

/// A stretch of a program as one link sees another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinkMove {
    /// The link's frame in that of the one that it is seen from, at both ends.
    pub ends: [Isometry3; 2],
    /// The move of the path, or that the approach belongs to.
    pub step: usize,
    /// Whether it is off the path.
    pub approach: bool,
}

impl Chain {
    /// A machine with rotary axes.
    pub fn of(kinematics: &Kinematics) -> Self {
        Self {
            kinematics: Some(*kinematics),
            gauge_length: kinematics.gauge_length,
            workpiece_zero: kinematics.workpiece_zero,
        }
    }

    /// A machine of three axes: the length from the spindle nose to the tip, and the workpiece's zero in
    /// machine coordinates, mm.
    pub fn three_axes(gauge_length: f64, workpiece_zero: Point3) -> Self {
        Self { kinematics: None, gauge_length, workpiece_zero }
    }

    /// The rotary axes of a side between the frame and a link, from the frame on.
    fn axes_to(&self, link: Link) -> impl Iterator<Item = (usize, &RotaryAxis)> {
        let axes = self.kinematics.as_ref().map_or(&[][..], |kinematics| &kinematics.axes);
        let of_link = |k: usize| axes.get(k).map(|axis| axis.side);
        let last = match link {
            Link::Rotary(k) => Some((k, of_link(k))),
            Link::Frame | Link::Linear => None,
        };
        // In the table the second axis carries the first, in the head the first carries the second.
        let order = if last.is_some_and(|(_, side)| side == Some(Side::Table)) { [1, 0] } else { [0, 1] };
        let end = order.iter().position(|k| last.is_some_and(|(last, _)| last == *k)).map_or(0, |at| at + 1);
        let within = order.into_iter().take(end);
        within
            .filter_map(move |k| Some((k, axes.get(k)?)))
            .filter(move |(_, axis)| last.is_some_and(|(_, side)| side == Some(axis.side)))
    }

    /// Head or table. The frame counts with the table.
    pub fn side(&self, link: Link) -> Side {
        match (link, &self.kinematics) {
            (Link::Linear, _) => Side::Head,
            (Link::Rotary(k), Some(kinematics)) => kinematics.axes[k].side,
            (Link::Frame | Link::Rotary(_), _) => Side::Table,
        }
    }

    /// The link that carries the workpiece.
    pub fn of_workpiece(&self) -> Link {
        self.last(Side::Table).unwrap_or(Link::Frame)
    }

    /// The link that carries the tool.
    pub fn of_tool(&self) -> Link {
        self.last(Side::Head).unwrap_or(Link::Linear)
    }

    fn last(&self, side: Side) -> Option<Link> {
        let axes = &self.kinematics.as_ref()?.axes;
        let order = if side == Side::Table { [0, 1] } else { [1, 0] };
        order.into_iter().find(|&k| axes[k].side == side).map(Link::Rotary)
    }

    /// The tip in the frame of the link that carries it.
    pub fn tip(&self) -> Point3 {
        Point3::new(0.0, 0.0, -self.gauge_length)
    }

    /// The workpiece's zero in the frame of the link that carries it.
    pub fn workpiece_zero(&self) -> Point3 {
        self.workpiece_zero
    }

    /// The frame of a link in machine coordinates.
    pub fn pose(&self, link: Link, joints: &Joints) -> Isometry3 {
        let side = self.side(link);
        let shift = if side == Side::Head { joints.linear } else { Vector3::zeros() };
        self.axes_to(link).fold(Isometry3::from(shift), |pose, (k, axis)| {
            // A table turns against the count.
            let angle = if side == Side::Head { joints.rotary[k] } else { -joints.rotary[k] };
            let turn = UnitQuaternion::from_scaled_axis(axis.direction * angle);
            let about = Translation3::from(axis.point.coords);
            pose * (about * turn * about.inverse())
        })
    }

    /// The joints at a share of the way between two places of a program.
    fn between(&self, from: &Waypoint, to: &Waypoint, share: f64) -> Joints {
        let at = |a: f64, b: f64| a + (b - a) * share;
        let rotary = [0, 1].map(|k| at(from.joints.rotary[k], to.joints.rotary[k]));
        match &self.kinematics {
            Some(kinematics) if to.way == Way::Tip => {
                let [a, b] = [from, to].map(|end| kinematics.forward(&end.joints).tip);
                kinematics.place(a + (b - a) * share, rotary)
            }
            _ => {
                let linear = from.joints.linear + (to.joints.linear - from.joints.linear) * share;
                Joints { linear, rotary }
            }
        }
    }

    /// How `link` moves as seen from `other`, along a program: so that no place of a body on it, within
    /// `reach` of `middle`, is off by more than [`STRAY`] if its middle runs straight from end to end and it
    /// turns evenly.
    pub fn motion(
        &self,
        program: &[Waypoint],
        [link, other]: [Link; 2],
        middle: &Point3,
        reach: f64,
    ) -> Vec<LinkMove> {
        let mut moves = Vec::with_capacity(program.len());
        let seen = |joints: &Joints| self.pose(other, joints).inverse() * self.pose(link, joints);
        for ends in program.windows(2) {
            let [from, to] = [&ends[0], &ends[1]];
            let parts = self.parts([from, to], [link, other], middle, reach);
            let mut begin = seen(&from.joints);
            for part in 1..=parts {
                let joints = match part {
                    _ if part == parts => to.joints,
                    _ => self.between(from, to, f64::from(part) / f64::from(parts)),
                };
                let end = seen(&joints);
                moves.push(LinkMove { ends: [begin, end], step: to.step, approach: to.way == Way::Approach });
                begin = end;
            }
        }
        moves
    }

    /// Into how many parts of even time a stretch is to be divided: straying is an eighth of a bound of
    /// second derivatives.
    fn parts(
        &self,
        [from, to]: [&Waypoint; 2],
        [link, other]: [Link; 2],
        middle: &Point3,
        reach: f64,
    ) -> u32 {
        let turn = |k: usize| (to.joints.rotary[k] - from.joints.rotary[k]).abs();
        let turns = |link: Link| self.axes_to(link).map(|(k, _)| turn(k)).sum::<f64>();
        let (own, its) = (turns(link), turns(other));
        if own + its == 0.0 && !(to.way == Way::Tip && turn(0) + turn(1) > 0.0) {
            return 1;
        }
        // Of the linear axes by the share of the stretch.
        let (mut speed, mut second) = ((to.joints.linear - from.joints.linear).norm(), 0.0);
        if let (Way::Tip, Some(kinematics)) = (to.way, &self.kinematics) {
            let [a, b] = [from, to].map(|end| kinematics.forward(&end.joints).tip);
            let [table, head] = [self.of_workpiece(), self.of_tool()];
            let [of_table, of_head] = [turns(table), turns(head)];
            let way = (b - a).norm();
            let arm = self.arm(table, &(a + self.workpiece_zero.coords)) + way;
            let swing = self.arm(head, &self.tip());
            speed = way + of_table * arm + of_head * swing;
            second = of_table * of_table * arm + 2.0 * of_table * way + of_head * of_head * swing;
        }
        if self.side(link) == Side::Table {
            (speed, second) = (0.0, 0.0);
        }
        // In machine coordinates, then as the other link sees it.
        let arm = self.arm(link, middle);
        let (speed, second) = (speed + own * arm, second + own * own * arm);
        let place = self.pose(link, &from.joints) * middle;
        let far = self.outer_arm(other, &place) + speed;
        let second = its * its * far + 2.0 * its * speed + second;
        let both = own + its;
        let straying = (second + 2.0 * both * both * reach) / 8.0;
        ((straying / STRAY).sqrt().max(both / MOST_TURN).ceil() as u32).max(1)
    }

    /// How far a place in the frame of a link can be from the rotary axes that move it, mm.
    fn arm(&self, link: Link, place: &Point3) -> f64 {
        let axes: Vec<Point3> = self.axes_to(link).map(|(_, axis)| axis.point).collect();
        let last = axes.last().map_or(0.0, |through| (place - through).norm());
        last + axes.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum::<f64>()
    }

    /// The same of a place in machine coordinates.
    fn outer_arm(&self, link: Link, place: &Point3) -> f64 {
        let axes: Vec<Point3> = self.axes_to(link).map(|(_, axis)| axis.point).collect();
        let first = axes.first().map_or(0.0, |through| (place - through).norm());
        first + axes.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum::<f64>()
    }
}

#[cfg(test)]
mod tests;
