//! What of a tool must stay how far away from what.

use super::{Clearance, Obstacle};
use cutter::Solid;
use motion::{ClPoint, Move, Toolpath};
use std::cell::Cell;
use work::parallel;

/// A solid that keeps its distance from an obstacle: a cutter from the part and from fixtures, a holder from
/// both.
#[derive(Debug, Clone, Copy)]
pub struct Check<'a> {
    /// Part of the tool.
    pub solid: &'a Solid,
    /// What it must not touch.
    pub obstacle: Obstacle<'a>,
    /// Least signed distance, mm: below zero for a cutter that may cut in by so much.
    pub needed: f64,
}

/// What a tool must keep away from, and how far it may be moved for that.
#[derive(Debug, Clone, Default)]
pub struct Interference<'a> {
    /// Each must hold.
    pub checks: Vec<Check<'a>>,
    /// The axis is tilted by no more than this from its rule, rad.
    pub greatest_tilt: f64,
    /// Contacts are lifted along the normal by no more than this, mm.
    pub greatest_lift: f64,
}

/// The check that fails by most.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shortfall {
    /// How much is missing, mm.
    pub depth: f64,
    /// Which check.
    pub check: usize,
    /// When on the move, from 0 to 1; 0 for a single location.
    pub t: f64,
    /// What is nearest.
    pub nearest: Clearance,
}

/// What refused a location last: a check, a piece of its solid and a triangle. It is asked first at the next
/// one, which is mostly near and refused by the same; no answer depends on it.
#[derive(Debug, Clone, Default)]
pub struct LastRefusal(Cell<Option<(usize, (usize, usize))>>);

/// Distance kept beyond what is needed by locations that are repaired, mm, and the share of the allowed depth
/// for those that may cut in: moves between such locations are then clear too. More tilts more than
/// necessary, less takes more points.
const SPARE: f64 = 0.02;
const SPARE_SHARE: f64 = 0.5;

impl Check<'_> {
    /// With something to spare, or exactly what is needed.
    fn limit(&self, spare: bool) -> f64 {
        let more = if self.needed < 0.0 { -SPARE_SHARE * self.needed } else { SPARE };
        if spare { self.needed + more } else { self.needed }
    }
}

impl Interference<'_> {
    /// Whether all checks hold where a tool stands.
    pub fn is_clear(&self, at: &ClPoint) -> bool {
        self.holds(at, false)
    }

    /// As [`Interference::is_clear`], with something to spare if asked for.
    pub fn holds(&self, at: &ClPoint, spare: bool) -> bool {
        self.holds_after(&LastRefusal::default(), at, spare)
    }

    /// The same for one of many locations near each other.
    pub fn holds_after(&self, last: &LastRefusal, at: &ClPoint, spare: bool) -> bool {
        let refuses = |(k, pair): (usize, (usize, usize))| {
            let check = self.checks.get(k);
            check.is_some_and(|check| check.obstacle.are_nearer(check.solid, at, pair, check.limit(spare)))
        };
        if last.0.get().is_some_and(refuses) {
            return false;
        }
        let refused = self.checks.iter().enumerate().find_map(|(k, check)| {
            Some((k, check.obstacle.some_nearer(check.solid, at, check.limit(spare))?))
        });
        last.0.set(refused.or(last.0.get()));
        refused.is_none()
    }

    /// The check that fails by most where a tool stands.
    pub fn shortfall(&self, at: &ClPoint) -> Option<Shortfall> {
        self.missing(at, false)
    }

    /// As [`Interference::shortfall`], with something to spare if asked for.
    pub fn missing(&self, at: &ClPoint, spare: bool) -> Option<Shortfall> {
        let one = |(k, check): (usize, &Check)| {
            let limit = check.limit(spare);
            let nearest = check.obstacle.clearance(check.solid, at, limit)?;
            Some(Shortfall { depth: limit - nearest.distance, check: k, t: 0.0, nearest })
        };
        worst(self.checks.iter().enumerate().filter_map(one))
    }

    /// The check that fails by most on a move; within the tolerance of [`Obstacle::swept_clearance`].
    pub fn on_move(&self, from: &ClPoint, to: &ClPoint) -> Option<Shortfall> {
        let one = |(k, check): (usize, &Check)| {
            let hit = check.obstacle.swept_clearance(check.solid, from, to, check.needed)?;
            let depth = check.needed - hit.nearest.distance;
            Some(Shortfall { depth, check: k, t: hit.t, nearest: hit.nearest })
        };
        worst(self.checks.iter().enumerate().filter_map(one))
    }

    /// The moves of a path, of those that `chosen` picks, on which a check fails, with the one that fails by
    /// most.
    pub fn on_path(
        &self,
        path: &Toolpath,
        chosen: impl Fn(&Move) -> bool + Sync + Send,
    ) -> Vec<(usize, Shortfall)> {
        let failed = parallel::map(path.len(), |k| {
            let to = &path.moves[k];
            let missing = chosen(to).then(|| self.on_move(&path.location_before(k), &to.to)).flatten()?;
            Some((k, missing))
        });
        failed.into_iter().flatten().collect()
    }
}

fn worst(all: impl Iterator<Item = Shortfall>) -> Option<Shortfall> {
    all.reduce(|a, b| if b.depth > a.depth { b } else { a })
}
