//! The moves of a path, made ready for distances and for bounds on them over a cube.
//!
//! # The bound
//! A move whose axis stands fixed sweeps a convex solid, and the signed distance from a convex solid is a
//! convex function of the place: it lies above each of its tangent planes, and inside a cube below the
//! greatest of its values at the corners. Where the axis turns, a tool that keeps the mean axis stands in for
//! the move: it slides along the chord of the curve along which the tool sees the cube's centre run. From
//! both tools that centre is seen at spots no farther apart than that curve leaves its chord, a place e
//! beside it by up to half the turn times e more, and a distance differs by no more than that. A solid of
//! several pieces is not convex: there a distance changes by no more than the place moves.
//!
//! The tool that keeps the mean axis slides along a chord, so that the slack is of second order in the turn.
//! With the mean axis alone it would be of first order. Distances at corners must not be capped: a capped
//! distance is not convex.

use super::slide::{StandIn, slide};
use crate::solid::{Motion, Nearest, OppositeAxes, below};
use crate::stock::corner;
use cutter::Solid;
use geometry::{Point3, Vector3, angle_between};
use motion::Toolpath;
use work::parallel;

/// How far the middle of a turning ball may run beside the chord that stands for it, mm. More shows in
/// distances; less makes more parts.
const CHORD: f64 = 1e-5;

/// A part turns by at most this angle, rad. More loosens the bounds, less makes more parts.
const WIDEST_TURN: f64 = 0.02;

/// How exact distances from sliding tools are, mm.
const EXACT: f64 = 1e-9;

/// How loose bounds over a cube may be, as a share of it, where they only choose moves. Less costs looks at
/// each move, more keeps moves.
pub(super) const LOOSE: f64 = 0.02;

/// Parts of one move at most.
const MAX_PARTS: f64 = 1000.0;

/// A move, or a part of one that turns.
#[derive(Debug, Clone, Copy)]
pub(super) struct MotionPart {
    /// Index of the move in the path.
    pub(super) index: u32,
    /// From when to when on that move.
    range: [f64; 2],
    /// The tip at the begin, and its way.
    tip: Point3,
    tip_way: Vector3,
    /// The tool with the mean axis, the middle of its ball or corner on the chord: exact where the axis
    /// stands fixed.
    plain: StandIn,
    /// Half the angle by which the axis turns, rad, and about what.
    half_turn: f64,
    about: Vector3,
    /// How far the middle of the corner runs beside its chord.
    bulge: f64,
}

/// A distance with a plane below it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tangent {
    /// Distance, mm, give or take `slack`.
    pub(super) distance: f64,
    pub(super) slack: f64,
    /// A lower bound at the place itself, and its gradient.
    pub(super) lower: f64,
    pub(super) gradient: Vector3,
}

/// All moves of a path.
#[derive(Debug)]
pub(super) struct MotionParts {
    pub(super) solid: Solid,
    pub(super) all: Vec<MotionPart>,
    /// Of the moves of the path.
    motions: Vec<Motion>,
}

/// The strip that a ball with an upright shank sweeps, seen from one place.
struct Strip {
    /// From the strip to the place.
    away: Vector3,
}

impl MotionPart {
    /// A tool with the mean axis that sees `q` run along the chord of the curve along which the tool does,
    /// and by how much distances differ within `reach` of `q`.
    fn seen_from(&self, q: &Point3, reach: f64) -> (StandIn, f64) {
        let (sin, cos) = self.half_turn.sin_cos();
        let turned = |v: Vector3, sin: f64| {
            v * cos + self.about.cross(&v) * sin + self.about * (self.about.dot(&v) * (1.0 - cos))
        };
        let (from_begin, from_end) = (q - self.tip, q - self.tip - self.tip_way);
        let [begin, end] = [turned(from_begin, sin), turned(from_end, -sin)];
        let turn = 2.0 * self.half_turn;
        let arm = from_begin.norm().max(from_end.norm());
        let leaves_chord = 0.125 * turn * (turn * arm + 2.0 * self.tip_way.norm());
        let StandIn { axis, pivot, .. } = self.plain;
        let stand_in = StandIn::new(q - begin + axis * pivot, begin - end, axis, pivot);
        (stand_in, leaves_chord + self.half_turn * reach)
    }
}

impl MotionParts {
    pub(super) fn new(solid: &Solid, path: &Toolpath) -> Result<Self, OppositeAxes> {
        let motions = parallel::try_map(path.len(), |index| {
            Motion::new(&path.location_before(index), &path.moves[index].to).ok_or(OppositeAxes { index })
        })?;
        let pivot = solid.ball().unwrap_or(solid.pivot());
        let of_move = |(index, motion): (usize, &Motion)| {
            let turn = turn(motion);
            let chords = if solid.ball().is_some() { (0.125 * pivot / CHORD).sqrt() * turn } else { 1.0 };
            let count = chords.max(turn / WIDEST_TURN).ceil().clamp(1.0, MAX_PARTS) as u32;
            let motion = *motion;
            let at = move |i: u32| f64::from(i) / f64::from(count);
            (0..count).map(move |i| {
                let range = [at(i), at(i + 1)];
                let [a, b] = range.map(|t| motion.at(t));
                let half_turn = 0.5 * turn / f64::from(count);
                // With a fixed axis the very same vector: it may not be off by rounding.
                let middle = if turn == 0.0 { a.axis } else { motion.at(0.5 * (range[0] + range[1])).axis };
                let [start, end] = [a, b].map(|at| at.tip + at.axis * pivot);
                let bulge = 0.5 * pivot * half_turn * half_turn;
                let about = a.axis.cross(&b.axis).try_normalize(0.0).unwrap_or_else(Vector3::zeros);
                MotionPart {
                    index: index as u32,
                    range,
                    tip: a.tip,
                    tip_way: b.tip - a.tip,
                    plain: StandIn::new(start, end - start, middle, pivot),
                    half_turn,
                    about,
                    bulge,
                }
            })
        };
        let all = motions.iter().enumerate().flat_map(of_move).collect();
        Ok(Self { solid: solid.clone(), all, motions })
    }

    /// Number of moves of the path.
    pub(super) fn moves(&self) -> usize {
        self.motions.len()
    }

    /// Bytes that they take.
    pub(super) fn bytes(&self) -> u64 {
        (size_of_val(&self.all[..]) + size_of_val(&self.motions[..])) as u64
    }

    /// Signed distance from a whole move where it is below `limit`.
    pub(super) fn of_move(&self, index: u32, q: &Point3, limit: f64) -> Option<Nearest> {
        below(&self.solid, &self.motions[index as usize], q, [0.0, 1.0], limit)
    }

    /// The tool as it stands in the middle of a part.
    pub(super) fn standing(&self, part: &MotionPart) -> MotionPart {
        let middle = 0.5 * (part.range[0] + part.range[1]);
        let at = self.motions[part.index as usize].at(middle);
        let pivot = part.plain.pivot;
        let plain = StandIn::new(at.tip + at.axis * pivot, Vector3::zeros(), at.axis, pivot);
        let (tip, tip_way) = (at.tip, Vector3::zeros());
        MotionPart { range: [middle; 2], tip, tip_way, plain, half_turn: 0.0, bulge: 0.0, ..*part }
    }

    /// How far any place of the tool on a part is at most from the same place of one that stands.
    pub(super) fn spread(&self, standing: &MotionPart, part: &MotionPart) -> f64 {
        let solid = &self.solid;
        let arm = solid.heights().map(f64::abs).into_iter().fold(0.0, f64::max).hypot(solid.radius());
        let motion = &self.motions[part.index as usize];
        // On the way from end to end neither is farther than at the ends.
        let [a, b] = part.range.map(|t| {
            let at = motion.at(t);
            let axis = standing.plain.axis;
            let angle = angle_between(&axis, &at.axis);
            ((at.tip - standing.tip).norm(), angle)
        });
        a.0.max(b.0) + a.1.max(b.1) * arm
    }

    /// Signed distance from what a move sweeps until a time, where it is below `limit`.
    pub(super) fn until(&self, index: u32, q: &Point3, until: f64, limit: f64) -> Option<f64> {
        below(&self.solid, &self.motions[index as usize], q, [0.0, until], limit).map(|found| found.distance)
    }

    /// Whether what a move sweeps is convex, also until some time.
    pub(super) fn is_convex_on(&self, index: u32) -> bool {
        self.solid.is_convex() && turn(&self.motions[index as usize]) == 0.0
    }

    /// One move of the path.
    pub(super) fn motion(&self, index: u32) -> &Motion {
        &self.motions[index as usize]
    }

    /// When on a move, from 0 to 1, the tool first comes within `near` of `q`, found to `tolerance` mm by
    /// stepping over times in which it cannot; 1 where it never does.
    pub(super) fn first_within(&self, index: u32, q: &Point3, near: f64, tolerance: f64, most: usize) -> f64 {
        let motion = &self.motions[index as usize];
        let (begin, end) = (motion.at(0.0), motion.at(1.0));
        // No place of the tool nearer to q than now is moves faster than that.
        let arm = (q - begin.tip).norm().max((q - end.tip).norm());
        let pace = (end.tip - begin.tip).norm() + turn(motion) * arm;
        let mut t = 0.0;
        for _ in 0..most {
            let pose = motion.at(t);
            let away = self.solid.distance(&pose.tip, &pose.axis, q) - near;
            if away <= 0.0 || t >= 1.0 || pace == 0.0 {
                break;
            }
            t = (t + away.max(tolerance) / pace).min(1.0);
        }
        t
    }

    /// Whether the tool is one convex piece that is nowhere wider than at its top: drawn out along its axis
    /// it comes to no new place below where its top was.
    pub(super) fn is_widest_on_top(&self) -> bool {
        let (radius, [_, top]) = (self.solid.radius(), self.solid.heights());
        self.solid.is_convex() && self.solid.outline_foot(radius, top).distance.abs() < EXACT
    }

    /// Whether a tool that is nowhere wider than at its top comes on `later`, on which it does not turn, to
    /// no new place within `reach` of `q`: where it goes, it has been on `earlier`, no higher along its axis,
    /// give or take `near` mm. Of a part that turns its ends count.
    pub(super) fn has_been(
        &self,
        earlier: &MotionPart,
        later: &MotionPart,
        near: f64,
        q: &Point3,
        reach: f64,
    ) -> bool {
        let (top, goes) = (self.solid.heights()[1], &later.plain);
        let covers = |was: &StandIn| {
            // What the axes differ by shows most at the top.
            let lean = (was.axis - goes.axis).norm() * (top + goes.pivot);
            [goes.start, goes.start + goes.way].iter().all(|place| {
                let away = place - was.start;
                let abeam = (away.dot(&was.across) * was.per_across).clamp(0.0, 1.0);
                // Straight along the axis the lowest place counts, and only rounding tells which is abeam.
                let lowest = if was.rise < 0.0 { 1.0 } else { 0.0 };
                [abeam, lowest].iter().any(|t| {
                    let beside = away - was.way * *t;
                    let higher = beside.dot(&was.axis);
                    let height = (q - was.start - was.way * *t).dot(&was.axis) + was.pivot;
                    higher >= -near
                        && (beside - was.axis * higher).norm() + lean <= near
                        && height + reach <= top
                })
            })
        };
        let standing = |t: f64| {
            let at = self.motions[earlier.index as usize].at(t);
            StandIn::new(at.tip + at.axis * goes.pivot, Vector3::zeros(), at.axis, goes.pivot)
        };
        later.half_turn == 0.0
            && if earlier.half_turn == 0.0 {
                covers(&earlier.plain)
            } else {
                earlier.range.iter().any(|&t| covers(&standing(t)))
            }
    }

    /// Outward normal of the tool on a move at time `t`, at the place nearest to `q`.
    pub(super) fn normal(&self, index: u32, q: &Point3, t: f64) -> Vector3 {
        let pose = self.motions[index as usize].at(t);
        self.solid.foot(&pose.tip, &pose.axis, q).gradient
    }

    /// Signed distance from a part where it is below `limit`; ball ends as exact as their chords.
    pub(super) fn distance(&self, part: &MotionPart, q: &Point3, limit: f64) -> Option<f64> {
        if part.half_turn == 0.0
            && let Some((strip, radius)) = self.strip(&part.plain, q)
        {
            let distance = strip.away.norm() - radius;
            return (distance < limit).then_some(distance);
        }
        if part.half_turn == 0.0 && self.solid.is_convex() {
            return slide(&self.solid, &part.plain, q, limit, EXACT).map(|s| s.distance);
        }
        let motion = &self.motions[part.index as usize];
        below(&self.solid, motion, q, part.range, limit).map(|found| found.distance)
    }

    /// By how much distances from [`MotionPart::plain`] differ within `reach` of `q`, where it is good enough
    /// to stand in for the part.
    #[inline]
    fn plain_slack(&self, part: &MotionPart, q: &Point3, reach: f64) -> Option<f64> {
        if part.half_turn == 0.0 {
            return Some(0.0);
        }
        (self.solid.ball().is_some() && self.is_below(part, q, reach)).then_some(part.bulge)
    }

    /// Whether all places within `reach` of `q` lie below the middle of the ball, so that the part sweeps a
    /// capsule for them.
    pub(super) fn is_below(&self, part: &MotionPart, q: &Point3, reach: f64) -> bool {
        let away = q - part.plain.start;
        let (a, b) = (away.dot(&part.plain.axis), (away - part.plain.way).dot(&part.plain.axis));
        let higher = if a > b { a } else { b };
        let leaned = if part.half_turn == 0.0 {
            0.0
        } else {
            part.half_turn * (away.norm().max((away - part.plain.way).norm()) + reach)
        };
        higher + reach + leaned < 0.0
    }

    /// The same for the flat top, whether the shank's end is farther than its side.
    pub(super) fn is_strip(&self, part: &MotionPart, q: &Point3, reach: f64) -> bool {
        let Some(radius) = self.solid.ball() else { return false };
        if part.half_turn > 0.0 || !self.solid.is_convex() {
            return false;
        }
        let away = q - part.plain.start;
        let (a, b) = (away.dot(&part.plain.axis), (away - part.plain.way).dot(&part.plain.axis));
        (if a > b { a } else { b }) + reach < self.solid.heights()[1] - 2.0 * radius
    }

    /// The nearest place of the strip above the track of a ball's middle, for a tool that keeps its axis.
    #[inline(always)]
    fn strip(&self, tool: &StandIn, q: &Point3) -> Option<(Strip, f64)> {
        let radius = self.solid.ball()?;
        let away = q - tool.start;
        let y = away.dot(&tool.axis);
        let highest = if tool.rise < 0.0 { y - tool.rise } else { y };
        if highest > self.solid.heights()[1] - 2.0 * radius || !self.solid.is_convex() {
            return None;
        }
        let share = |x: f64| {
            let x = if x > 0.0 { x } else { 0.0 };
            if x < 1.0 { x } else { 1.0 }
        };
        // Above the track the way along the axis is free.
        let level = share(away.dot(&tool.across) * tool.per_across);
        let low = if tool.per_across > 0.0 { tool.rise * level } else { tool.rise.min(0.0) };
        let away = if y > low {
            away - tool.way * level - tool.axis * (y - tool.rise * level)
        } else {
            away - tool.way * share(away.dot(&tool.way) * tool.per_way)
        };
        Some((Strip { away }, radius))
    }

    /// The distance of the stand-in from `q`, and what bounds it, where it may be below `limit` for the part;
    /// loose by the share `loose` of `reach`.
    #[inline]
    pub(super) fn tangent(
        &self,
        part: &MotionPart,
        q: &Point3,
        reach: f64,
        limit: f64,
        loose: f64,
    ) -> Option<Tangent> {
        match self.plain_slack(part, q, reach) {
            Some(slack) => self.tangent_of(part, &part.plain, slack, q, reach, limit, loose),
            None => {
                let (tool, slack) = part.seen_from(q, reach);
                self.tangent_of(part, &tool, slack, q, reach, limit, loose)
            }
        }
    }

    #[inline(always)]
    fn tangent_of(
        &self,
        part: &MotionPart,
        tool: &StandIn,
        slack: f64,
        q: &Point3,
        reach: f64,
        limit: f64,
        loose: f64,
    ) -> Option<Tangent> {
        if let Some((strip, radius)) = self.strip(tool, q) {
            let size = strip.away.norm();
            let distance = size - radius;
            if distance - slack >= limit {
                return None;
            }
            // At the middle itself zero supports the distance.
            let gradient = if size > 0.0 { strip.away / size } else { Vector3::zeros() };
            return Some(Tangent { distance, slack, lower: distance - slack, gradient });
        }
        if !self.solid.is_convex() {
            let distance = self.distance(part, q, limit)?;
            // Inside nothing is known but the sign.
            let lower = if distance > 0.0 { distance - reach } else { f64::NEG_INFINITY };
            return Some(Tangent { distance, slack: reach, lower, gradient: Vector3::zeros() });
        }
        let found = slide(&self.solid, tool, q, limit + slack, loose * reach)?;
        Some(Tangent { slack, lower: found.lower - slack, ..found })
    }

    /// Upper bounds on the distance at the eight corners of a cube around `centre`, such that in between
    /// their greatest is one, loose by the share `loose` of `half`.
    pub(super) fn corners(
        &self,
        part: &MotionPart,
        t: &Tangent,
        centre: &Point3,
        half: f64,
        loose: f64,
    ) -> [f64; 8] {
        if !self.solid.is_convex() {
            return [t.distance + t.slack; 8];
        }
        let reach = half * 3f64.sqrt();
        let (tool, slack) = match self.plain_slack(part, centre, reach) {
            Some(slack) => (part.plain, slack),
            None => part.seen_from(centre, reach),
        };
        std::array::from_fn(|k| {
            let q = centre + corner(k) * half;
            let distance = self.strip(&tool, &q).map_or_else(
                || slide(&self.solid, &tool, &q, f64::INFINITY, loose * half).map(|f| f.distance),
                |(strip, radius)| Some(strip.away.norm() - radius),
            );
            distance.unwrap_or(f64::INFINITY) + slack
        })
    }

    /// Start and way of the ball's middle, its axis and its radius.
    pub(super) fn track(&self, part: &MotionPart) -> (Point3, Vector3, Vector3) {
        (part.plain.start, part.plain.way, part.plain.axis)
    }
}

/// The angle by which the axis turns on a move, rad.
fn turn(motion: &Motion) -> f64 {
    let (a, b) = (motion.at(0.0).axis, motion.at(1.0).axis);
    angle_between(&a, &b)
}
