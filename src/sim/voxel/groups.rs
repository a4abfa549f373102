//! Moves in groups of those that follow each other, so that a large cube need not look at each.
//!
//! A group has the pose in its middle. No place of the tool on any of its moves is farther than its spread
//! from the same place of the tool there, so that its distance differs from that of the pose by no more.

use cutter::Solid;
use geometry::Point3;
use motion::Toolpath;

use super::moves::{LOOSE, MotionPart, MotionParts, Tangent};
use crate::solid::OppositeAxes;

/// Groups of one level in a group of the next.
const BRANCHES: u32 = 4;

/// A part of a move, at level 0, or a group of such.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Group {
    /// Of which tool.
    pub(super) of: u32,
    pub(super) level: u32,
    at: u32,
}

/// What is known of a group of a higher level.
#[derive(Debug)]
struct Pose {
    /// The tool standing there.
    part: MotionPart,
    spread: f64,
}

/// The moves of one tool.
#[derive(Debug)]
pub(super) struct Groups {
    pub(super) parts: MotionParts,
    /// From level 1 on.
    levels: Vec<Vec<Pose>>,
    /// Before all moves of the tool that is looked at.
    is_before: bool,
}

impl Groups {
    pub(super) fn new(solid: &Solid, path: &Toolpath, is_before: bool) -> Result<Self, OppositeAxes> {
        let parts = MotionParts::new(solid, path)?;
        let mut groups = Self { parts, levels: Vec::new(), is_before };
        let count = groups.parts.all.len() as u32;
        let mut size = 1;
        while size < count {
            size *= BRANCHES;
            let level = (0..count.div_ceil(size)).map(|k| groups.pose(k * size, ((k + 1) * size).min(count)));
            let level = level.collect();
            groups.levels.push(level);
        }
        Ok(groups)
    }

    /// Of the parts of a range.
    fn pose(&self, first: u32, end: u32) -> Pose {
        let middle = &self.parts.all[(first + (end - first) / 2) as usize];
        let part = self.parts.standing(middle);
        let spread = (first..end).map(|k| self.parts.spread(&part, &self.parts.all[k as usize]));
        Pose { part, spread: spread.fold(0.0, f64::max) }
    }

    /// All moves of tool number `of`; none without moves.
    pub(super) fn all(&self, of: u32) -> Option<Group> {
        (!self.parts.all.is_empty()).then_some(Group { of, level: self.levels.len() as u32, at: 0 })
    }

    fn range(&self, group: Group) -> [u32; 2] {
        let size = BRANCHES.pow(group.level);
        [group.at * size, ((group.at + 1) * size).min(self.parts.all.len() as u32)]
    }

    /// The groups of a group, in order.
    pub(super) fn within(&self, group: Group) -> impl DoubleEndedIterator<Item = Group> + use<> {
        let end = self.range(group)[1].div_ceil(BRANCHES.pow(group.level - 1));
        let of = group.of;
        (group.at * BRANCHES..end).map(move |at| Group { of, level: group.level - 1, at })
    }

    /// The moves of the first and the last part, counted from 1; all are 0 where they come before others.
    pub(super) fn orders(&self, group: Group) -> [u32; 2] {
        let [first, end] = self.range(group);
        [first, end - 1].map(|k| self.order(&self.parts.all[k as usize]))
    }

    pub(super) fn order(&self, part: &MotionPart) -> u32 {
        if self.is_before { 0 } else { part.index + 1 }
    }

    /// The part in the middle.
    pub(super) fn middle(&self, group: Group) -> &MotionPart {
        let [first, end] = self.range(group);
        &self.parts.all[(first + (end - first) / 2) as usize]
    }

    /// How far all its moves are from `q` at least where that may be below `limit`, with a plane below that
    /// within `reach`, and how far they spread.
    pub(super) fn tangent(&self, group: Group, q: &Point3, reach: f64, limit: f64) -> Option<(Tangent, f64)> {
        let pose = group.level.checked_sub(1).map(|above| &self.levels[above as usize][group.at as usize]);
        let (part, spread) = match pose {
            Some(pose) => (&pose.part, pose.spread),
            None => (&self.parts.all[group.at as usize], 0.0),
        };
        let t = self.parts.tangent(part, q, reach, limit + spread, LOOSE)?;
        Some((Tangent { lower: t.lower - spread, slack: t.slack + spread, ..t }, spread))
    }

    /// The first move that covers a place, of those in a group.
    pub(super) fn first_over(&self, group: Group, q: &Point3, looks: &mut u64) -> Option<u32> {
        *looks += 1;
        let (t, _) = self.tangent(group, q, 0.0, 0.0)?;
        if t.lower > 0.0 {
            return None;
        }
        if group.level > 0 {
            return self.within(group).find_map(|group| self.first_over(group, q, looks));
        }
        let part = &self.parts.all[group.at as usize];
        self.parts.distance(part, q, 0.0).map(|_| self.order(part))
    }
}
