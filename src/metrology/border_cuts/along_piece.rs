//! The deepest place of one move along a piece of a border, by halving between places of known depth. mm.

use super::{BorderCut, BorderPiece, concave_most, depth, least_way};
use crate::cut_surface::Deviation;
use crate::facing::LEAST_FACING;
use crate::figures::NUMERICAL_FLOOR;
use crate::inspection::Inspection;
use geometry::{Point3, Vector3};

/// Halvings of a piece at most: to a millionth of it.
const MOST_HALVINGS: u32 = 20;

/// How deep a move cuts at a place of a border, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
struct PlaceDepth {
    /// Along the normal or the wall.
    along: f64,
    /// Whether the move cuts nothing as far inside of all borders as counts as near.
    is_left: bool,
}

/// A share of a piece, and how deep the move cuts there; `None` where it does not pass.
type At = (f64, Option<PlaceDepth>);

/// A move along a piece.
struct AlongPiece<'a> {
    of: &'a Inspection<'a>,
    piece: &'a BorderPiece,
    by: u32,
    /// Of the piece, mm.
    length: f64,
    /// The depth below which nothing is looked for.
    known: f64,
    /// The deepest place that was looked at and its share.
    best: Option<(f64, f64)>,
}

impl Inspection<'_> {
    /// The deepest place of a move along a piece, where it may be deeper than `known`; it comes nearest at a
    /// share.
    pub(super) fn deepest_on(
        &self,
        piece: &BorderPiece,
        by: u32,
        nearest: f64,
        known: f64,
    ) -> Option<BorderCut> {
        let length = (piece.ends[1] - piece.ends[0]).norm();
        let mut along = AlongPiece { of: self, piece, by, length, known, best: None };
        let left = along.search(nearest);
        let (found, share) = along.best?;
        let possible = left.max(found);
        if possible <= known {
            return None;
        }
        let (point, normal) = piece.design(self.part, share);
        // What lies under something else is not seen from above.
        let seen = point + piece.inward_by(share, self.limits.gouge);
        let top = self.part.highest_at(seen.x, seen.y)?;
        if (top.point - point).dot(&normal) > self.limits.gouge / normal.z.max(LEAST_FACING) {
            return None;
        }
        let of_walls = |depth: f64| self.walls.map_or(depth, |walls| -walls.beside(&point, -depth.max(0.0)));
        Some(BorderCut { depth: of_walls(found), possible: of_walls(possible), at: point, by })
    }
}

impl AlongPiece<'_> {
    fn design(&self, share: f64) -> (Point3, Vector3) {
        self.piece.design(self.of.part, share)
    }

    /// The place so far within all borders from a share.
    fn within(&self, share: f64, far: f64) -> Point3 {
        self.design(share).0 + self.piece.inward_by(share, far)
    }

    fn at(&self, share: f64) -> At {
        let depth_there = || {
            let (place, normal) = self.design(share);
            let is_left = self.of.is_left(self.by, &self.within(share, self.of.limits.gouge));
            let mut along = depth(self.of.surface, self.by, &place, &normal)?;
            if along.is_infinite() || self.piece.leads_out(&normal) {
                along = along.min(place.z - self.of.surface.envelope.height(self.by, place.x, place.y)?);
            }
            Some(PlaceDepth { along, is_left })
        };
        (share, depth_there())
    }

    /// How far what the move leaves is from a share, where that is near.
    fn near(&self, share: f64) -> Option<f64> {
        self.of.near_left(self.piece, self.by, share, &self.design(share).0)
    }

    /// Halves the piece until no part of it may be deeper than the deepest place that was looked at. The
    /// depth that no place exceeds besides that.
    fn search(&mut self, nearest: f64) -> f64 {
        let ends = [0.0, nearest, 1.0].map(|share| self.at(share));
        for at in ends {
            self.keep(at);
        }
        let mut left = f64::NEG_INFINITY;
        let mut open: Vec<_> = ends.windows(2).map(|pair| (pair[0], pair[1], MOST_HALVINGS)).collect();
        while let Some((a, b, halvings)) = open.pop() {
            if a.1.is_none() && b.1.is_none() || b.0 <= a.0 {
                continue;
            }
            let m = self.at(0.5 * (a.0 + b.0));
            let (most, ridge) = self.keep(m);
            let possible = self.possible([a, m, b], most, halvings == 0);
            let possible = ridge.map_or(possible, |cut| {
                let within = 0.5 * (b.0 - a.0) * self.length + self.piece.bend;
                possible.min(cut.slope * within - cut.distance)
            });
            if possible <= most + NUMERICAL_FLOOR {
                left = left.max(possible);
            } else if halvings == 0 {
                left = left.max(most + NUMERICAL_FLOOR);
            } else {
                open.push((a, m, halvings - 1));
                open.push((m, b, halvings - 1));
            }
        }
        left
    }

    /// Looks whether a place is the deepest. The depth of the deepest then, and the cut of this one where it
    /// lies on a ridge.
    fn keep(&mut self, (share, found): At) -> (f64, Option<Deviation>) {
        let most = self.best.map_or(self.known, |(most, _)| most.max(self.known));
        let Some(PlaceDepth { mut along, is_left }) = found else { return (most, None) };
        if is_left && along > most {
            along = self.near(share).map_or(along, |near| near.min(along));
        }
        let (place, normal) = self.design(share);
        if along > most && along.is_finite() {
            // Within the part, which ends there.
            let place = place + self.piece.inward_by(share, NUMERICAL_FLOOR);
            let counted = self.of.counted(&place, &normal, along, self.by);
            along = counted.map_or(along, |counted| counted.min(along));
        }
        // On a ridge the cut may be less deep than along the normal. The cells may end with the part.
        let within = place + self.piece.inward * NUMERICAL_FLOOR;
        let may_count = along > most.max(self.of.limits.shallow());
        let ridge = if may_count { self.of.on_ridge(&within, &normal, along) } else { None };
        let depth = ridge.map_or(along, |cut| -cut.distance);
        if self.best.is_none_or(|(most, _)| depth > most) {
            self.best = Some((depth, share));
        }
        (most.max(depth), ridge)
    }

    /// No place between two ends with another in the middle is deeper than this: depths are concave.
    fn possible(&self, [a, m, b]: [At; 3], most: f64, is_last: bool) -> f64 {
        let (Some(at_a), Some(at_m), Some(at_b)) = (a.1, m.1, b.1) else {
            let is_passed = m.1.is_some() || a.1.is_some() && b.1.is_some();
            return if is_passed || !is_last { f64::INFINITY } else { f64::NEG_INFINITY };
        };
        let part = b.0 - a.0;
        // What a border bends by between two places spoils concavity by as much; it falls with the square of
        // their distance.
        let bend = 3.0 * self.piece.bend * part * part;
        let along = concave_most([at_a.along, at_m.along, at_b.along]) + bend;
        // Near an end the inside is that of another place.
        let is_kinked = |far: f64| {
            let end = self.piece.end(far);
            [end, 1.0 - end].iter().any(|place| a.0 < *place && *place < b.0)
        };
        let is_left = |far: f64| {
            let places = || [a.0, m.0, b.0].map(|share| self.within(share, far));
            !is_kinked(far) && self.of.stays_left(self.by, places(), bend)
        };
        let far = self.of.limits.gouge;
        if along <= most || !is_left(far) {
            return along;
        }
        let far = least_way(far, is_left);
        let ways = [a.0, b.0].map(|share| self.piece.inward_by(share, far).norm());
        // What is near one place is no farther from another than they are from each other.
        let aside = 0.5 * part * self.length + bend;
        let nearby = self.near(m.0).map_or(f64::INFINITY, |near| near + aside);
        along.min(ways.into_iter().fold(0.0, f64::max)).min(nearby)
    }
}
