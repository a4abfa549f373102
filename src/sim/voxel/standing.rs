//! Whether shank and holder run into stock that still stands when they come: places that a section of the holder
//! covers on an earlier move than the cutter does, or that the cutter never does.
//!
//! At the samples of the lattice that is exact: a place that is reported does lie in the stock, in the holder and outside
//! of all that the cutter swept before. Every place is within half a voxel's diagonal of a sample. So where no sample comes so
//! near to all three, nothing collides between the samples either.

use super::bricks::Lattice;
use super::cube::Cube;
use super::engine::VoxelEngine;
use super::error::VoxelError;
use super::moves::{LOOSE, MotionParts};
use super::octree::{Descent, SIDE, descend};
use cutter::{Holder, Solid};
use geometry::{Point3, Vector3};
use motion::Toolpath;
use std::collections::BTreeMap;
use work::monitor::{Monitor, check};
use work::parallel;

/// What is shallower than this, mm, is no collision. Less finds the cusps that a shank as wide as its cutter rubs along;
/// more misses true ones.
const SHALLOWEST: f64 = 0.01;

/// Times of a touch are found to this, mm.
const TOUCH: f64 = 1e-3;

/// Looks at one place for the time of a touch at most.
const MOST_LOOKS: usize = 10_000;

/// Places, those that seem deepest, at which the depth is worked out.
const MOST_PLACES: usize = 64;

/// Where shank or holder run into standing stock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HolderHit {
    /// Index of the move.
    pub move_index: u32,
    /// Section of the holder, counted from 0 at the bottom.
    pub section: usize,
    /// A place that both share.
    pub at: Point3,
    /// Diameter of the ball around it that lies in both, mm: they run into each other at least so deep.
    pub depth: f64,
}

/// All moves on which shank or holder run into standing stock.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StandingHits {
    /// The moves that are the first at some place, in the order of the program.
    pub moves: Vec<u32>,
    /// The deepest hit that was found.
    pub worst: Option<HolderHit>,
    /// The first move on which they may meet between the samples, where no sample tells that they do.
    pub open: Option<u32>,
}

/// The place that each move hits deepest, by what is known of that on the way.
type Hits = BTreeMap<u32, Vec<(f64, Point3)>>;

/// A cube with the parts of holder and cutter that come near, in order.
struct StandingCube {
    cube: Cube,
    holder: Vec<u32>,
    cutter: Vec<u32>,
    stock: bool,
}

struct Search<'a> {
    engine: &'a VoxelEngine<'a>,
    holder: MotionParts,
    lattice: Lattice,
    /// How deep a place must lie in holder and stock to count, mm; below zero it counts so far outside of them.
    depth: f64,
}

/// How parts lie to a cube.
struct Near {
    parts: Vec<u32>,
    /// Whether the last of them covers all of it.
    covered: bool,
}

impl VoxelEngine<'_> {
    /// Where the sections of `holder` on the way of `path`, that of this engine, run into what its cutter has not yet
    /// taken; samples `voxel` mm apart.
    ///
    /// # Errors
    /// [`VoxelError::Voxel`], also where there are more voxels than can be counted; [`VoxelError::Axes`];
    /// [`VoxelError::Cancelled`].
    ///
    /// # Tolerance
    /// What is reported is true to 1e-5 mm, and deeper than 0.01 mm. Where neither a hit nor an open move is reported, shank
    /// and holder meet nothing that still stands.
    pub fn holder_in_stock(
        &self,
        holder: &Holder,
        path: &Toolpath,
        voxel: f64,
        monitor: &dyn Monitor,
    ) -> Result<StandingHits, VoxelError> {
        let Some(lattice) = self.lattice(voxel)? else {
            return Err(VoxelError::Voxel(voxel));
        };
        let sections = Solid::of_sections(holder);
        let mut all = self.hits_deeper_than(SHALLOWEST, &sections, path, lattice, monitor)?;
        if all.is_empty() {
            let between = -(0.5 * 3f64.sqrt() * voxel + TOUCH);
            let near = self.hits_deeper_than(between, &sections, path, lattice, monitor)?;
            let open = near.iter().map(|(_, hit)| hit.move_index).min();
            return Ok(StandingHits { open, ..StandingHits::default() });
        }
        let mut moves: Vec<u32> = all.iter().map(|(_, hit)| hit.move_index).collect();
        moves.sort_unstable();
        moves.dedup();
        all.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.move_index.cmp(&b.1.move_index)));
        all.truncate(MOST_PLACES);
        let depths = parallel::try_map(all.len(), |k| {
            check(monitor)?;
            let HolderHit { move_index, section, at, .. } = all[k].1;
            let to = &path.moves[move_index as usize].to;
            let swept =
                crate::SweptSolid::new(&sections[section], &path.location_before(move_index as usize), to);
            let inside = swept.map_or(0.0, |swept| -swept.distance(&at).distance);
            Ok::<_, VoxelError>(2.0 * inside.min(self.standing(&at, move_index)))
        })?;
        let deeper = |a: HolderHit, b: HolderHit| if b.depth > a.depth { b } else { a };
        let with_depth = all.iter().zip(depths).map(|((_, hit), depth)| HolderHit { depth, ..*hit });
        Ok(StandingHits { moves, worst: with_depth.reduce(deeper), open: None })
    }

    /// The samples at which sections and standing stock share more than `depth`, each with the depth known on the way.
    fn hits_deeper_than(
        &self,
        depth: f64,
        sections: &[Solid],
        path: &Toolpath,
        lattice: Lattice,
        monitor: &dyn Monitor,
    ) -> Result<Vec<(f64, HolderHit)>, VoxelError> {
        let mut all = Vec::new();
        for (section, solid) in sections.iter().enumerate() {
            check(monitor)?;
            let search = Search { engine: self, holder: MotionParts::new(solid, path)?, lattice, depth };
            let hits = descend(&search, search.whole(), "looking for the holder in the stock", monitor)?;
            all.extend(hits.into_iter().flat_map(|(move_index, places)| {
                let hit = move |at| HolderHit { move_index, section, at, depth: 0.0 };
                places.into_iter().map(move |(depth, at)| (depth, hit(at)))
            }));
        }
        Ok(all)
    }
}

impl Search<'_> {
    fn whole(&self) -> StandingCube {
        let all = |parts: &MotionParts| (0..parts.all.len() as u32).collect();
        let cube = Cube { low: [0; 3], n: self.lattice.side() };
        StandingCube { cube, holder: all(&self.holder), cutter: all(&self.engine.parts), stock: true }
    }

    /// Those of the listed parts, up to move `last`, that come closer than `limit` to a place of a cube, up to the first
    /// that does so everywhere.
    fn near(parts: &MotionParts, listed: &[u32], centre: &Point3, half: f64, limit: f64, last: u32) -> Near {
        let reach = half * 3f64.sqrt();
        let mut near = Near { parts: Vec::new(), covered: false };
        for &k in listed {
            let part = &parts.all[k as usize];
            if part.index > last {
                break;
            }
            let Some(t) = parts.tangent(part, centre, reach, reach + limit, LOOSE) else { continue };
            if t.lower - half * t.gradient.map(f64::abs).sum() >= limit {
                continue;
            }
            near.parts.push(k);
            near.covered = t.distance + t.slack + reach <= limit;
            if near.covered {
                break;
            }
        }
        near
    }

    /// How deep, `depth` at most, a place that the holder covers on a move lies in what stands then, as far as the listed
    /// parts tell; `None` where nothing stands.
    fn stands(&self, q: &Point3, index: u32, cutter: &[u32], mut depth: f64) -> Option<f64> {
        let (mine, theirs) = (&self.holder, &self.engine.parts);
        for &k in cutter {
            let part = &theirs.all[k as usize];
            if part.index > index {
                break;
            }
            let Some(distance) = theirs.distance(part, q, depth) else { continue };
            if distance >= self.depth {
                depth = if part.index < index { distance } else { depth };
                continue;
            }
            // On the same move the earlier one has it.
            let when = |parts: &MotionParts, near: f64| parts.first_within(index, q, near, TOUCH, MOST_LOOKS);
            if part.index < index || when(theirs, self.depth) <= when(mine, -self.depth) {
                return None;
            }
        }
        Some(depth)
    }

    fn put(hits: &mut Hits, index: u32, depth: f64, q: Point3) {
        let places = hits.entry(index).or_default();
        if places.first().is_none_or(|deepest| depth > deepest.0) {
            *places = vec![(depth, q)];
        }
    }
}

impl Descent for Search<'_> {
    type Node = StandingCube;
    type Tally = Hits;

    fn cube(piece: &StandingCube) -> Cube {
        piece.cube
    }

    fn children(&self, parent: &StandingCube, hits: &mut Hits) -> Vec<StandingCube> {
        let mut children = Vec::new();
        for cube in parent.cube.children() {
            let centre = self.lattice.centre(&cube);
            let half = 0.5 * f64::from(cube.n - 1) * self.lattice.pitch;
            let reach = half * 3f64.sqrt();
            let from_stock = if parent.stock { self.engine.stock.foot(&centre).0 } else { f64::NEG_INFINITY };
            if from_stock - reach > -self.depth {
                continue;
            }
            let stock = from_stock + reach > -self.depth;
            let holder = Self::near(&self.holder, &parent.holder, &centre, half, -self.depth, u32::MAX);
            let index_of = |k: &u32| self.holder.all[*k as usize].index;
            let Some(last) = holder.parts.last().map(index_of) else { continue };
            let theirs = &self.engine.parts;
            let cutter = Self::near(theirs, &parent.cutter, &centre, half, self.depth, last);
            let mut mine = holder.parts;
            if let (true, Some(&gone)) = (cutter.covered, cutter.parts.last()) {
                // Nothing stands any more for what comes later.
                mine.retain(|k| index_of(k) <= theirs.all[gone as usize].index);
            }
            if mine.is_empty() {
                continue;
            }
            if mine.len() == 1 && holder.covered && cutter.parts.is_empty() && !stock {
                Self::put(hits, last, reach.min(-self.engine.stock.foot(&centre).0), centre);
            } else {
                children.push(StandingCube { cube, holder: mine, cutter: cutter.parts, stock });
            }
        }
        children
    }

    fn leaf(&self, piece: &StandingCube, hits: &mut Hits) {
        let pitch = self.lattice.pitch;
        let low = self.lattice.place(piece.cube.low);
        for k in 0..SIDE.pow(3) {
            let at = [k % SIDE, k / SIDE % SIDE, k / SIDE / SIDE];
            let q = low + Vector3::from(at.map(f64::from)) * pitch;
            let in_stock = -self.engine.stock.foot(&q).0;
            if in_stock < self.depth {
                continue;
            }
            let inside = |k: &u32| {
                let part = &self.holder.all[*k as usize];
                Some((part.index, -self.holder.distance(part, &q, -self.depth)?))
            };
            let Some((index, inside)) = piece.holder.iter().find_map(inside) else { continue };
            if let Some(depth) = self.stands(&q, index, &piece.cutter, inside.min(in_stock)) {
                Self::put(hits, index, depth, q);
            }
        }
    }

    fn add(total: &mut Hits, hits: Hits) {
        for (index, places) in hits {
            total.entry(index).or_default().extend(places);
        }
    }
}
