//! The cut as the volume that the tool swept, whatever engine tells where a line meets it.
//!
//! A normal through a thin trailing edge comes out on the far side, where the passes of that side have cut
//! everything. So cuts are looked for close to the design first, and count only as far as a ball fits inside
//! the part.

use super::{AlongNormal, NormalHit, Way};
use crate::beneath::{Bounding, corner_at, face_before, leads_out, thinner};
use crate::figures::NUMERICAL_FLOOR;
use cutter::Solid;
use geometry::{Aabb, Point3, Vector3};
use motion::Toolpath;
use part::Part;
use sim::{RayHit, Rays, VoxelEngine, Voxels};

/// Cuts are first looked for so far below the design, mm. What reaches deeper is asked whether it comes from
/// the far side of a thin part: chords cut less deep, and where the part is as thin as that it ends. Looking
/// deep at once would find all the moves along the far side, and tell which of them is the first in the
/// program.
const NEAR: f64 = 0.1;

/// Right on a sharp edge passes of its other face may cut as well. What stands on a place is looked for from so
/// far above it, mm: chords stray less, and what cuts deeper is found on that face.
const GRAZED: [f64; 5] = [0.0, 1e-5, 1e-4, 1e-3, 5e-3];

/// How many times deeper is looked on a ridge that is cut as deep as was looked.
const DEEPER: f64 = 4.0;

/// So many moves before or after one of a track are asked with it, where it cuts within this share of its
/// end.
const BESIDE: usize = 4;
const AT_END: f64 = 1e-6;

/// Steps along a line in search of what was cut beside it, and the least one as a share of how far aside is
/// looked.
const MOST_STEPS: usize = 64;
const LEAST_STEP: f64 = 0.05;

/// An engine that tells where a line first meets what was cut.
pub trait FirstCut: Sync {
    /// The lowest place of the line through `point` along the unit `normal`, within a range, that was cut;
    /// the begin of the range where all is cut away there. A place that was cut nearby may make it faster.
    fn first_cut(
        &self,
        point: &Point3,
        normal: &Vector3,
        range: [f64; 2],
        near: Option<&NormalHit>,
    ) -> Option<NormalHit>;

    /// The same of a move alone, and of those of its pass that go on where it ends; `None` also where the
    /// engine cannot tell moves apart.
    fn cut_by(&self, _point: &Point3, _normal: &Vector3, _range: [f64; 2], _by: u32) -> Option<RayHit> {
        None
    }

    /// The unit normal of the cut surface at what [`FirstCut::cut_by`] found.
    fn normal_of(&self, _point: &Point3, _normal: &Vector3, _hit: &RayHit) -> Option<Vector3> {
        None
    }

    /// Up to where, from the begin of a range on, nothing within `aside` mm of the line was cut; the begin
    /// where that is not known.
    fn free_up_to(&self, _point: &Point3, _normal: &Vector3, [low, _]: [f64; 2], _aside: f64) -> f64 {
        low
    }
}

/// The moves themselves; rapids do not cut.
pub struct RaysCut<'a> {
    /// The moves that cut.
    pub rays: &'a Rays,
    /// The path that they are of.
    pub path: &'a Toolpath,
    /// The tool.
    pub solid: &'a Solid,
}

impl FirstCut for RaysCut<'_> {
    fn first_cut(
        &self,
        point: &Point3,
        normal: &Vector3,
        range: [f64; 2],
        near: Option<&NormalHit>,
    ) -> Option<NormalHit> {
        let [low, high] = range;
        let seed = near.map(|hit| hit.seed);
        let (hit, seed) = self.rays.deviation_near(point, normal, [-low, high], seed)?;
        Some(NormalHit {
            deviation: hit.s,
            by: hit.index,
            normal: self.normal_of(point, normal, &hit)?,
            way: Way::Normal,
            seed,
            uncertain: 0.0,
        })
    }

    fn cut_by(&self, point: &Point3, normal: &Vector3, [low, high]: [f64; 2], by: u32) -> Option<RayHit> {
        let of = |k: u32, high: f64| self.rays.deviation_by(point, normal, [-low, high], k);
        let pass = |k: u32| self.path.moves.get(k as usize).map(|step| step.pass);
        let mut lowest = of(by, high)?;
        for _ in 0..BESIDE {
            // What a move cuts at its end the next one may cut deeper.
            let next = match lowest {
                RayHit { t, index, .. } if t > 1.0 - AT_END => Some(index + 1),
                RayHit { t, index, .. } if t < AT_END => index.checked_sub(1),
                _ => None,
            };
            let next = next.filter(|k| pass(*k) == pass(by));
            let Some(deeper) = next.and_then(|k| of(k, lowest.s)).filter(|hit| hit.s < lowest.s) else {
                break;
            };
            lowest = deeper;
        }
        Some(lowest)
    }

    fn normal_of(&self, point: &Point3, normal: &Vector3, hit: &RayHit) -> Option<Vector3> {
        if self.solid.ball().is_none() {
            // Where an edge cuts, the tool by itself has no normal.
            return self.rays.cut_normal(point, normal, hit);
        }
        let to = &self.path.moves[hit.index as usize].to;
        let at = self.path.location_before(hit.index as usize).towards(to, hit.t);
        Some(-self.solid.foot(&at.tip, &at.axis, &(point + normal * hit.s)).gradient)
    }

    fn free_up_to(&self, point: &Point3, normal: &Vector3, [low, high]: [f64; 2], aside: f64) -> f64 {
        let mut free = low;
        for _ in 0..MOST_STEPS {
            if free >= high {
                return high;
            }
            // A ball about a place of the line, as far as the nearest tool, holds the surroundings of a piece
            // of it.
            let far = high - low + aside;
            let distance =
                self.rays.moves().nearest(&(point + normal * free), far).map_or(far, |hit| hit.distance);
            let step = (distance * distance - aside * aside).max(0.0).sqrt();
            if distance <= aside || step < LEAST_STEP * aside {
                break;
            }
            free += step;
        }
        free
    }
}

/// The moves of several tools, each with the index of its first one in the whole path.
pub struct RaysCutInTurn<'a> {
    /// In the order in which they come.
    pub tools: Vec<(u32, RaysCut<'a>)>,
}

impl RaysCutInTurn<'_> {
    /// The tool that makes a move.
    fn tool_of(&self, by: u32) -> Option<&(u32, RaysCut<'_>)> {
        self.tools.iter().rev().find(|(first, _)| *first <= by)
    }
}

impl FirstCut for RaysCutInTurn<'_> {
    fn first_cut(
        &self,
        point: &Point3,
        normal: &Vector3,
        range: [f64; 2],
        near: Option<&NormalHit>,
    ) -> Option<NormalHit> {
        // A place that was cut nearby tells something of its own tool only.
        let near = near.filter(|_| self.tools.len() == 1);
        let of_tool = |(first, cut): &(u32, RaysCut<'_>)| {
            let hit = cut.first_cut(point, normal, range, near)?;
            Some(NormalHit { by: hit.by + first, ..hit })
        };
        self.tools.iter().filter_map(of_tool).min_by(|a, b| a.deviation.total_cmp(&b.deviation))
    }

    fn cut_by(&self, point: &Point3, normal: &Vector3, range: [f64; 2], by: u32) -> Option<RayHit> {
        let (first, cut) = self.tool_of(by)?;
        let hit = cut.cut_by(point, normal, range, by - first)?;
        Some(RayHit { index: hit.index + first, ..hit })
    }

    fn normal_of(&self, point: &Point3, normal: &Vector3, hit: &RayHit) -> Option<Vector3> {
        let (first, cut) = self.tool_of(hit.index)?;
        cut.normal_of(point, normal, &RayHit { index: hit.index - first, ..*hit })
    }

    fn free_up_to(&self, point: &Point3, normal: &Vector3, range: [f64; 2], aside: f64) -> f64 {
        let of_tool = |(_, cut): &(u32, RaysCut<'_>)| cut.free_up_to(point, normal, range, aside);
        self.tools.iter().map(of_tool).fold(range[1], f64::min)
    }
}

/// What the moves left of stock that is larger than the part all around; rapids cut, too.
pub struct VoxelCut<'a> {
    /// The moves and the stock.
    pub engine: &'a VoxelEngine<'a>,
    /// What is left.
    pub voxels: &'a Voxels,
}

impl FirstCut for VoxelCut<'_> {
    fn first_cut(
        &self,
        point: &Point3,
        normal: &Vector3,
        range: [f64; 2],
        _: Option<&NormalHit>,
    ) -> Option<NormalHit> {
        let exit = self.engine.first_exit(self.voxels, point, normal, range)?;
        let (deviation, by, uncertain) = (exit.s, exit.index, exit.uncertain);
        Some(NormalHit { deviation, by, normal: exit.normal, way: Way::Normal, seed: 0, uncertain })
    }
}

/// What a path cuts, along normals of the design.
pub struct SweptVolume<'a> {
    /// The part that is cut.
    pub part: &'a Part,
    /// What tells where the cut is.
    pub cut: &'a dyn FirstCut,
    /// How far below the design is looked, mm: deeper cuts count as so deep.
    pub inward: f64,
    /// How far above it, mm.
    pub outward: f64,
    /// Of cuts that are no deeper than this it is not asked how thick the part is, mm: they hold every limit.
    /// Infinite where the profile of the cut is wanted; then no more is left out than what the far side of a
    /// thin part has lost.
    pub shallow: f64,
    /// The block that is cut, mm.
    pub block: Aabb,
}

impl SweptVolume<'_> {
    /// How far a line from a place in the block runs before it leaves, mm.
    pub(crate) fn way_out(&self, point: &Point3, normal: &Vector3) -> f64 {
        self.ways_out(point, normal).into_iter().fold(f64::INFINITY, f64::min)
    }

    /// How far lines as far as `within` mm aside run to the block's faces at most, mm: the way out rises by
    /// the slope of the design against the face.
    pub(crate) fn way_out_within(&self, point: &Point3, normal: &Vector3, within: f64) -> f64 {
        let rising = |(way, n): (f64, &f64)| way + within * (1.0 - n * n).max(0.0).sqrt() / n.abs();
        let ways = self.ways_out(point, normal).into_iter().zip(normal.iter());
        ways.filter(|(way, _)| way.is_finite()).map(rising).fold(f64::INFINITY, f64::min)
    }

    /// How far it runs to the faces across x, y and z, mm.
    fn ways_out(&self, point: &Point3, normal: &Vector3) -> [f64; 3] {
        [0, 1, 2].map(|c| {
            let side = if normal[c] > 0.0 { self.block.max[c] } else { self.block.min[c] };
            if normal[c] == 0.0 { f64::INFINITY } else { ((side - point[c]) / normal[c]).max(0.0) }
        })
    }

    /// The cut of a ridge whose faces have this sum of unit normals, no deeper than the second of two depths,
    /// mm: first no deeper than the first is looked, since deep in the part others may have cut.
    fn on_ridge(
        &self,
        point: &Point3,
        mut normals: Vector3,
        [first, most]: [f64; 2],
        found: NormalHit,
    ) -> NormalHit {
        let (mut depth, mut is_corner) = (first, false);
        loop {
            depth = depth.min(most);
            let out = normals.normalize();
            let hit = self.cut.first_cut(point, &out, [-depth, self.outward], Some(&found));
            // Where nothing was cut, or only above the place, it stands.
            let hit = hit.unwrap_or(NormalHit { deviation: 0.0, normal: out, ..found });
            let deviation = hit.deviation.min(0.0);
            let met = NormalHit { deviation, way: Way::OutOfRidge(out), ..hit };
            // What is left beyond the part is no part of the ridge. Where the way leads out through a third
            // face, it is a corner.
            let face = face_before(self.part, point, &out, deviation);
            if face.is_none() && deviation > -depth {
                return met;
            }
            if let Some(corner) = face.map(|face| normals + face).filter(|sum| !is_corner && leads_out(sum)) {
                (normals, depth, is_corner) = (corner, first, true);
                continue;
            }
            if depth >= most {
                return NormalHit { deviation: -most, ..met };
            }
            depth *= DEEPER;
        }
    }

    /// The same where the block had no sides. What leans out over a border is part of what stands there.
    fn way_up(&self, point: &Point3, normal: &Vector3) -> f64 {
        if normal.z > 0.0 { ((self.block.max.z - point.z) / normal.z).max(0.0) } else { f64::INFINITY }
    }
}

impl AlongNormal for SweptVolume<'_> {
    fn hit(&self, point: &Point3, normal: &Vector3, near: Option<&NormalHit>) -> Option<NormalHit> {
        let look = |inward: f64| self.cut.first_cut(point, normal, [-inward, self.outward], near);
        let close = NEAR.min(self.inward);
        // What was cut beyond the stock took nothing away.
        let in_stock = |hit: &NormalHit| hit.deviation <= self.way_up(point, normal);
        let found = look(close).filter(in_stock)?;
        let is_near = found.deviation > -close;
        if is_near && -found.deviation <= self.shallow {
            return Some(found);
        }
        let depth = if is_near { -found.deviation } else { self.inward };
        let bounding = Bounding { counts: &|_| true, walls: Some(0.0).filter(|_| self.shallow.is_finite()) };
        let Some(thin) = thinner(self.part, point, normal, depth, bounding) else {
            return if is_near { Some(found) } else { look(self.inward) };
        };
        if thin.other.is_some() && !is_near {
            // What the far side of a sharp edge has lost is beneath what stands on the place.
            for begin in GRAZED {
                let (from, range) = (point + normal * begin, [0.0, self.outward]);
                let above = self.cut.first_cut(&from, normal, range, near)?;
                if above.deviation > NUMERICAL_FLOOR {
                    let above = NormalHit { deviation: begin + above.deviation, ..above };
                    return Some(above).filter(in_stock);
                }
            }
        }
        if self.shallow.is_infinite() {
            return look(thin.radius);
        }
        let ridge = thin.ridges(self.part, point, normal, depth, bounding).next();
        if ridge.is_none() && is_near && thin.is_blunt(normal) {
            return Some(found);
        }
        match ridge {
            Some(normals) => {
                // What ends within half the thickness is no matter of the far side.
                let within = || look(thin.radius).filter(|hit| hit.deviation > -thin.radius);
                let own = if is_near { Some(found) } else { within().or_else(|| look(self.inward)) };
                let looked = [2.0 * thin.radius, own.map_or(depth, |own| -own.deviation)];
                let cut = self.on_ridge(point, normals, looked, found);
                let corner = corner_at(self.part, point, &normals, normal, -cut.deviation);
                let of_corner = corner.map(|normals| self.on_ridge(point, normals, looked, found));
                // The lesser way counts; of equals the normal, along which slopes are told.
                let ways = of_corner.into_iter().chain([cut]).chain(own);
                ways.max_by(|a, b| a.deviation.total_cmp(&b.deviation))
            }
            // What the far side of a thin part has lost is no loss of this one.
            None => {
                let hit = look(thin.radius)?;
                let is_all = hit.deviation <= -thin.radius && !thin.is_blunt(normal);
                Some(NormalHit { way: if is_all { Way::Thickness } else { hit.way }, ..hit })
            }
        }
    }

    fn cut_by(&self, point: &Point3, normal: &Vector3, by: u32) -> Option<RayHit> {
        let close = NEAR.min(self.inward);
        let hit = self.cut.cut_by(point, normal, [-close, self.outward], by)?;
        // It may be cut deeper than it was looked.
        (hit.s > -close).then_some(hit)
    }

    fn normal_of(&self, point: &Point3, normal: &Vector3, hit: &RayHit) -> Option<Vector3> {
        self.cut.normal_of(point, normal, hit)
    }

    fn reach(&self) -> f64 {
        self.outward
    }

    fn standing(&self, point: &Point3, normal: &Vector3) -> f64 {
        // Nothing leans out over a wall.
        let way = if normal.z > 0.0 { self.way_up(point, normal) } else { self.way_out(point, normal) };
        self.outward.min(way)
    }

    fn standing_at_most(&self, point: &Point3, normal: &Vector3, within: f64) -> f64 {
        self.way_out_within(point, normal, within).max(self.standing(point, normal))
    }

    fn depth(&self) -> f64 {
        self.inward
    }

    fn beyond_depth(&self) -> f64 {
        (self.block.diagonal() - self.inward).max(0.0)
    }

    fn depth_at_most(&self, point: &Point3, normal: &Vector3, aside: f64) -> f64 {
        -self.cut.free_up_to(point, normal, [-self.inward, 0.0], aside)
    }
}
