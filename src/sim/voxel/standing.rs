//! How near shank and holder of a tool with any axes come to the stock that stands when they pass.
//!
//! A place stands until the cutter covers it. Cubes around the stock are divided, those first in which the
//! holder may come nearest. A cube knows the moves on which the holder comes near to it and those on which
//! the cutter does; what a move covers whole is in nobody's way afterwards. Large cubes know them in groups
//! ([`super::groups`]). A place in its middle that stands when the holder comes gives a distance that is
//! reached. Supporting planes bound it from below. Of two convex bodies one may shield the other: where the
//! distance from what is cut, less that from the section, is at most m at all corners of a cube, no place
//! that stands is nearer than -m. So cubes stay large where a shank follows its cutter along a wall, and are
//! small only beside the nearest places.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::engine::VoxelEngine;
use super::error::VoxelError;
use super::groups::{Group, Groups};
use super::moves::LOOSE;
use crate::standing::{FAR, LEAST_CELL, NearStanding, StandingClearance, enough};
use crate::stock::{Stock, corner};
use cutter::{Cutter, Holder, Solid};
use geometry::{Point3, Vector3};
use motion::Toolpath;
use work::monitor::{Monitor, check};
use work::parallel;

/// What a section no wider than the cutter shares with stock less deep than this, mm, is a cusp that it rubs
/// along. Less finds those; more misses true collisions.
const SHALLOWEST: f64 = 0.01;

/// Times of a touch are found to this, mm.
const TOUCH: f64 = 1e-4;

/// Looks at one place for the time of a touch at most.
const MOST_TOUCHES: usize = 1000;

/// Looks at a move from a cube at most, and after a collision was found. What is left open by then stays in
/// the bound.
const MOST_LOOKS: u64 = 20_000_000;
const MOST_LOOKS_COLLIDING: u64 = 2_000_000;

/// Cubes that are divided at a time. Those of one batch do not know what the others find.
const BATCH: usize = 32;

/// A collision is followed to where it is deeper by this share: the program is refused anyway.
const DEEPER_SHARE: f64 = 0.1;

/// A cube with what comes near it.
struct Node {
    middle: Point3,
    half: f64,
    /// No place of it that stands comes nearer than this.
    bound: f64,
    /// Of the sections.
    held: Vec<Group>,
    /// Of the cutters, in the order of the program.
    cuts: Vec<Group>,
    /// Whether it reaches out of the stock.
    edge: bool,
}

/// What one division tells.
struct Divided {
    /// The nearest so far, and what is near enough to it, mm.
    limit: f64,
    enough: f64,
    children: Vec<Node>,
    /// Nothing that was let go is nearer than this.
    done: f64,
    nearest: Option<NearStanding>,
    collisions: Vec<u32>,
    looks: u64,
}

/// What the cutters take of a cube. Moves of this tool count from 1, those of others before are 0.
struct Gone {
    /// The first move that is known to cover all of it.
    whole: u32,
    /// The first that covers its middle, where that was asked for.
    middle: Option<u32>,
    /// Moves, each with bounds on the distance from what it takes at the corners. Between them their greatest
    /// is one, also of their sum with a linear function.
    shields: Vec<(u32, [f64; 8])>,
}

struct Search<'a> {
    engine: &'a VoxelEngine<'a>,
    /// Those before, and the tool's own.
    cutters: Vec<Groups>,
    sections: Vec<Groups>,
    /// Distances from a section count as greater by so much.
    rubs: Vec<f64>,
}

impl VoxelEngine<'_> {
    /// How near the sections of `holder` on the way of `path`, that of this engine, come to what its cutter
    /// has not yet taken, nor others `before`.
    ///
    /// # Errors
    /// [`VoxelError::Axes`]; [`VoxelError::Cancelled`].
    ///
    /// # Tolerance
    /// See [`StandingClearance::error_bound`]: a twentieth of the clearance and a hundredth of a millimetre
    /// at most, unless too many cubes leave it open. A section no wider than the cutter counts as 0.01 mm
    /// farther away: it rubs along cusps. The result does not depend on the number of threads.
    pub fn holder_clearance(
        &self,
        before: &[(Cutter, Toolpath)],
        cutter: &Cutter,
        holder: &Holder,
        path: &Toolpath,
        monitor: &dyn Monitor,
    ) -> Result<StandingClearance, VoxelError> {
        let solids = Solid::of_sections(holder);
        let rub = |solid: &Solid| if solid.radius() > cutter.radius() { 0.0 } else { SHALLOWEST };
        let sections = solids.iter().map(|solid| Groups::new(solid, path, false));
        let of_before =
            |(cutter, path): &(Cutter, Toolpath)| Groups::new(&Solid::of_cutter(cutter, None), path, true);
        let own = Groups::new(&self.parts.solid, path, false);
        let search = Search {
            engine: self,
            cutters: before.iter().map(of_before).chain([own]).collect::<Result<_, _>>()?,
            sections: sections.collect::<Result<_, _>>()?,
            rubs: solids.iter().map(rub).collect(),
        };
        search.run(monitor)
    }
}

impl Search<'_> {
    fn run(&self, monitor: &dyn Monitor) -> Result<StandingClearance, VoxelError> {
        monitor.start("checking the holder", 0);
        let mut heap = BinaryHeap::from([self.whole()]);
        let mut found = StandingClearance::default();
        let (mut done, mut looks, mut most) = (f64::INFINITY, 0, MOST_LOOKS);
        loop {
            check(monitor)?;
            let limit = found.nearest.map_or(FAR, |near| near.distance);
            let enough = if limit < 0.0 { (1.0 + DEEPER_SHARE) * limit - LEAST_CELL } else { enough(limit) };
            if limit < 0.0 {
                most = most.min(looks + MOST_LOOKS_COLLIDING);
            }
            let mut batch = Vec::new();
            while batch.len() < BATCH && looks < most && heap.peek().is_some_and(|node| node.bound < enough) {
                match heap.pop() {
                    Some(node) if node.half > LEAST_CELL => batch.push(node),
                    Some(node) => done = done.min(node.bound),
                    None => break,
                }
            }
            if batch.is_empty() {
                done = heap.peek().map_or(done, |node| done.min(node.bound));
                let error_bound = if limit < 0.0 { 0.0 } else { (limit - done).max(0.0) };
                found.collisions.sort_unstable();
                found.collisions.dedup();
                return Ok(StandingClearance { error_bound, ..found });
            }
            for divided in parallel::map(batch.len(), |k| self.divide(&batch[k], limit, enough)) {
                heap.extend(divided.children);
                done = done.min(divided.done);
                looks += divided.looks;
                found.collisions.extend(divided.collisions);
                let nearer =
                    |near: &NearStanding| found.nearest.is_none_or(|best| near.distance < best.distance);
                found.nearest = divided.nearest.filter(nearer).or(found.nearest);
            }
        }
    }

    /// A cube around the stock.
    fn whole(&self) -> Node {
        let block = self.engine.stock.bounds();
        let all = |tools: &[Groups]| (0..).zip(tools).filter_map(|(k, groups)| groups.all(k)).collect();
        Node {
            middle: block.min + block.size() * 0.5,
            half: 0.5 * block.size().max(),
            bound: f64::NEG_INFINITY,
            held: all(&self.sections),
            cuts: all(&self.cutters),
            edge: true,
        }
    }

    fn divide(&self, node: &Node, limit: f64, enough: f64) -> Divided {
        let (children, collisions) = (Vec::new(), Vec::new());
        let mut divided =
            Divided { limit, enough, children, done: f64::INFINITY, nearest: None, collisions, looks: 0 };
        let half = 0.5 * node.half;
        for k in 0..8 {
            self.look(node, node.middle + corner(k) * half, half, &mut divided);
        }
        divided
    }

    /// Looks at one of the eight cubes of a node.
    fn look(&self, node: &Node, middle: Point3, half: f64, divided: &mut Divided) {
        let reach = 3f64.sqrt() * half;
        let (out, outward) =
            if node.edge { self.engine.stock.foot(&middle) } else { (f64::NEG_INFINITY, Vector3::zeros()) };
        if out > reach {
            return;
        }
        let edge = out > -reach;
        let mut child = Node { middle, half, bound: f64::INFINITY, held: Vec::new(), cuts: Vec::new(), edge };
        let last = node.held.iter().map(|held| self.sections[held.of as usize].orders(*held)[1]).max();
        let Some(mut gone) = self.cut(node, &mut child, last.unwrap_or_default(), divided) else { return };
        if out > 0.0 {
            gone.middle = Some(0);
        }
        if edge && matches!(self.engine.stock, Stock::Box(_) | Stock::Cylinder { .. }) {
            // The stock is convex: it ends before the plane at its nearest place.
            let beyond = |k: usize| -out - half * outward.dot(&corner(k));
            gone.shields.push((0, std::array::from_fn(beyond)));
        }
        let mut open: Vec<Group> = node.held.clone();
        while let Some(held) = open.pop() {
            self.hold(held, &mut gone, &mut child, &mut open, divided);
        }
        if !child.held.is_empty() {
            divided.children.push(child);
        }
    }

    /// Puts down the cutters' moves that come into a cube, up to move `last`, and tells what they take;
    /// `None` where another tool took all of it before.
    fn cut(&self, node: &Node, child: &mut Node, last: u32, divided: &mut Divided) -> Option<Gone> {
        let (middle, half) = (child.middle, child.half);
        let reach = 3f64.sqrt() * half;
        let mut gone = Gone { whole: u32::MAX, middle: None, shields: Vec::new() };
        let mut deepest = f64::INFINITY;
        let mut open: Vec<Group> = node.cuts.iter().rev().copied().collect();
        while let Some(cut) = open.pop() {
            let groups = &self.cutters[cut.of as usize];
            if groups.orders(cut)[0] > last {
                break;
            }
            divided.looks += 1;
            let Some((t, spread)) = groups.tangent(cut, &middle, reach, reach) else { continue };
            if t.lower - half * t.gradient.map(f64::abs).sum() >= 0.0 {
                continue;
            }
            if spread > half {
                open.extend(groups.within(cut).rev());
                continue;
            }
            child.cuts.push(cut);
            if t.distance < deepest {
                let (parts, part) = (&groups.parts, groups.middle(cut));
                divided.looks += 9;
                let Some(t) = parts.tangent(part, &middle, reach, reach, LOOSE) else { continue };
                deepest = t.distance;
                let corners = parts.corners(part, &t, &middle, half, LOOSE);
                let order = groups.order(part);
                if t.distance + t.slack <= -reach || corners.iter().all(|&distance| distance <= 0.0) {
                    gone.whole = order;
                    break;
                }
                gone.shields.push((order, corners));
            }
        }
        (gone.whole > 0).then_some(gone)
    }

    /// Puts down a section's moves that may come near what stands of a cube, and how near they come to its
    /// middle.
    fn hold(
        &self,
        held: Group,
        gone: &mut Gone,
        child: &mut Node,
        open: &mut Vec<Group>,
        divided: &mut Divided,
    ) {
        let (middle, half) = (child.middle, child.half);
        let reach = 3f64.sqrt() * half;
        let (groups, rub) = (&self.sections[held.of as usize], self.rubs[held.of as usize]);
        let [first, last] = groups.orders(held);
        if first > gone.whole {
            return;
        }
        divided.looks += 1;
        let limit = divided.limit - rub + reach;
        let Some((t, spread)) = groups.tangent(held, &middle, reach, limit) else { return };
        if t.lower + rub < divided.limit {
            self.reach(held, gone, child, divided);
        }
        // What stands lies beyond each shield, and the section above its supporting plane.
        let behind = |shield: &[f64; 8]| {
            let over = |k: usize| shield[k] - half * t.gradient.dot(&corner(k));
            t.lower + rub - (0..8).map(over).fold(f64::NEG_INFINITY, f64::max)
        };
        let mut lower = t.lower - half * t.gradient.map(f64::abs).sum() + rub;
        for (before, shield) in &gone.shields {
            if *before < first {
                lower = lower.max(behind(shield));
            }
        }
        if lower < divided.enough && held.level > 0 && (spread > half || last >= gone.whole) {
            return open.extend(groups.within(held));
        }
        let same_move = |order: u32| held.level == 0 && order == first;
        if lower < divided.enough
            && (same_move(gone.whole) || gone.shields.iter().any(|shield| same_move(shield.0)))
        {
            let shield = self.cut_first(held, first - 1, child, divided);
            let gone = shield.is_some_and(|shield| shield.iter().all(|&distance| distance <= 0.0));
            lower =
                if gone { divided.enough } else { shield.map_or(lower, |shield| lower.max(behind(&shield))) };
        }
        if lower >= divided.enough {
            divided.done = divided.done.min(lower);
            return;
        }
        child.bound = child.bound.min(lower);
        child.held.push(held);
    }

    /// Takes the distance from the middle of a cube on the move in the middle of a group, where it stands
    /// then.
    fn reach(&self, held: Group, gone: &mut Gone, child: &Node, divided: &mut Divided) {
        let (groups, rub) = (&self.sections[held.of as usize], self.rubs[held.of as usize]);
        let (parts, part) = (&groups.parts, groups.middle(held));
        let middle_gone = *gone.middle.get_or_insert_with(|| {
            let over = |cut: &Group| {
                self.cutters[cut.of as usize].first_over(*cut, &child.middle, &mut divided.looks)
            };
            child.cuts.iter().find_map(over).unwrap_or(u32::MAX)
        });
        let limit = divided.limit - rub;
        let found = match groups.order(part).cmp(&middle_gone.min(gone.whole)) {
            Ordering::Less => parts.distance(part, &child.middle, limit),
            Ordering::Greater => None,
            Ordering::Equal => {
                // Until the cutter comes to it on the same move.
                let cutter = &self.engine.parts;
                let until = cutter.first_within(part.index, &child.middle, TOUCH, TOUCH, MOST_TOUCHES);
                parts.until(part.index, &child.middle, until, limit)
            }
        };
        if let Some(distance) = found {
            divided.take(part.index, held.of, child.middle, distance + rub);
        }
    }

    /// Upper bounds at the corners of a cube on the distance of what the cutter takes on a move before a
    /// section comes near the cube.
    fn cut_first(&self, held: Group, index: u32, child: &Node, divided: &mut Divided) -> Option<[f64; 8]> {
        divided.looks += 16;
        let (cutter, section) = (&self.engine.parts, &self.sections[held.of as usize].parts);
        let reach = 3f64.sqrt() * child.half;
        let near = divided.enough - self.rubs[held.of as usize] + reach + TOUCH;
        let until = section.first_within(index, &child.middle, near, TOUCH, MOST_TOUCHES);
        let at = |q: &Point3| cutter.until(index, q, until, f64::INFINITY);
        if cutter.is_convex_on(index) {
            let distances: Vec<f64> =
                (0..8).filter_map(|k| at(&(child.middle + corner(k) * child.half))).collect();
            return distances.try_into().ok();
        }
        at(&child.middle).map(|distance| [distance + reach; 8])
    }
}

impl Divided {
    fn take(&mut self, move_index: u32, section: u32, at: Point3, distance: f64) {
        if distance < 0.0 {
            self.collisions.push(move_index);
        }
        if distance < self.limit {
            self.limit = distance;
            self.nearest = Some(NearStanding { move_index, section: section as usize, at, distance });
        }
    }
}

// Those first in which the holder may come nearest; of two alike the larger, then by place.
impl Ord for Node {
    fn cmp(&self, other: &Self) -> Ordering {
        let places = || {
            let axis = |k: usize| other.middle[k].total_cmp(&self.middle[k]);
            axis(0).then_with(|| axis(1)).then_with(|| axis(2))
        };
        other.bound.total_cmp(&self.bound).then(self.half.total_cmp(&other.half)).then_with(places)
    }
}

impl PartialOrd for Node {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Node {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Node {}
