//! What each move removes, in the order of the program: a voxel belongs to the first move that covers it.
//!
//! A voxel at signed distance d from a move, in voxels, is left by it to the share `½ + d`, within 0 and 1.
//! Of a voxel each move takes what it leaves less than all before it, so that the volumes add up to all that
//! is removed. Where a move leaves less of a voxel than the moves before and the stock did, it does cut
//! there, within half a voxel: the nearest place of its surface lies beyond theirs.

use super::bricks::Lattice;
use super::capsule::{Kernel, LANES, Lanes};
use super::cube::Cube;
use super::engine::VoxelEngine;
use super::error::VoxelError;
use super::moves::{LOOSE, MotionPart, Tangent};
use super::octree::{Descent, SIDE, descend};
use crate::solid::Motion;
use crate::stock::corner;
use crate::{ENGAGED, MoveRemoval, RapidContact};
use geometry::{Point3, Vector3};
use std::collections::BTreeMap;
use work::monitor::{Monitor, check};
use work::{lanes, parallel};

/// By how much a voxel's share may be off where a plane crosses it, in voxels: 0.0478 for one square to the
/// diagonal at a quarter of a voxel from the middle, 0.0429 square to that of a face, none along the faces.
/// Edges, a tenth of voxel² for each mm, are paid for by the planes beside them, which cross voxels in many
/// ways.
pub(super) const PLANE: f64 = 0.048;

/// A touch is told to this share of a voxel.
const TOUCH: f64 = 0.05;

/// Looks at one place for the time of a touch at most.
const MOST_LOOKS: usize = 1000;

/// Places at which the depth of a rapid move is worked out.
const MOST_PLACES: usize = 16;

/// What a path removes, move by move, by voxels.
#[derive(Debug, Clone, PartialEq)]
pub struct VoxelRemoval {
    /// One entry a move of the path. `depth` is that of the deepest voxel it lowered, a voxel at most;
    /// `axial` is measured along the tool axis, `radial` square to the move and to the axis, 0 of moves along
    /// the axis.
    pub moves: Vec<MoveRemoval>,
    /// Rapid moves that cut, in the order of the program; `depth` is at least how far a place that was cut
    /// lay from the surface that stood.
    pub rapid_contacts: Vec<RapidContact>,
    /// Bound of the error of the sum of all volumes, mm³.
    pub volume_bound: f64,
}

impl VoxelRemoval {
    /// Volume removed by all moves, mm³.
    pub fn volume(&self) -> f64 {
        self.moves.iter().map(|m| m.volume).sum()
    }
}

/// What one move takes.
#[derive(Debug, Clone)]
struct Tally {
    /// Voxels.
    sum: f64,
    /// Voxels of which something was gone before or is left.
    partial: f64,
    /// Greatest share that it takes of a voxel.
    share: f64,
    axial: f64,
    across: [f64; 2],
    /// Of a rapid move: how far the tip had come at the first touch, and where that was.
    first: Option<(f64, Point3)>,
    /// Of a rapid move: the place that seems to lie deepest in what stood, one a block.
    deep: Vec<(f64, Point3)>,
}

/// Volumes by move, and voxels that were or are left in part.
#[derive(Default)]
struct Taken {
    moves: BTreeMap<u32, Tally>,
    partial: f64,
}

/// A cube with the parts that take something in it, in order.
struct RemovalCube {
    cube: Cube,
    parts: Vec<u32>,
    /// How they look from the middle of a least cube.
    tangents: Vec<Tangent>,
    /// Whether voxels at the stock's surface may be among them.
    stock: bool,
}

struct Remover<'a> {
    engine: &'a VoxelEngine<'a>,
    lattice: Lattice,
}

/// The directions in which engagement is measured.
struct Frame<'a> {
    motion: &'a Motion,
    start: Point3,
    way: Vector3,
    per_way: f64,
    /// Square to way and axis; zero where they run along each other.
    side: Vector3,
}

impl<'a> Frame<'a> {
    fn of(motion: &'a Motion) -> Self {
        let (start, middle) = (motion.at(0.0).tip, motion.at(0.5));
        let way = motion.at(1.0).tip - start;
        let square = way.norm_squared();
        let side = way.cross(&middle.axis);
        // Below this only rounding tells the direction.
        let side = side.try_normalize(1e-9 * square.sqrt()).unwrap_or_else(Vector3::zeros);
        Self { motion, start, way, per_way: if square > 0.0 { 1.0 / square } else { 0.0 }, side }
    }

    /// Height along the axis above the tip abeam of `q`.
    fn height(&self, q: &Point3) -> f64 {
        let t = if self.per_way > 0.0 { (q - self.start).dot(&self.way) * self.per_way } else { 0.5 };
        let pose = self.motion.at(t.clamp(0.0, 1.0));
        (q - pose.tip).dot(&pose.axis)
    }
}

impl Default for Tally {
    fn default() -> Self {
        let across = [f64::INFINITY, f64::NEG_INFINITY];
        Self { sum: 0.0, partial: 0.0, share: 0.0, axial: 0.0, across, first: None, deep: Vec::new() }
    }
}

impl Tally {
    fn add(&mut self, other: Self) {
        self.sum += other.sum;
        self.partial += other.partial;
        self.share = self.share.max(other.share);
        self.axial = self.axial.max(other.axial);
        self.across = [self.across[0].min(other.across[0]), self.across[1].max(other.across[1])];
        let earlier = |a: &(f64, Point3)| self.first.is_none_or(|b| a.0 < b.0);
        if let Some(first) = other.first.filter(earlier) {
            self.first = Some(first);
        }
        self.deep.extend(other.deep);
    }

    /// Adds a place of which something was taken.
    fn engage(&mut self, frame: &Frame<'_>, q: &Point3) {
        self.axial = self.axial.max(frame.height(q));
        let across = q.coords.dot(&frame.side);
        self.across = [self.across[0].min(across), self.across[1].max(across)];
    }

    fn removal(&self, voxel: f64) -> MoveRemoval {
        let engaged = self.across[1] >= self.across[0];
        // What is taken lies within half a voxel of the places, whose cubes reach as far as their diagonal.
        let [radial, radial_bound] =
            if engaged { [self.across[1] - self.across[0], 3f64.sqrt() * voxel] } else { [0.0; 2] };
        MoveRemoval {
            volume: self.sum * voxel.powi(3),
            volume_bound: PLANE * self.partial * voxel.powi(3),
            depth: self.share * voxel,
            axial: self.axial,
            along: f64::INFINITY,
            radial,
            radial_bound,
        }
    }
}

impl VoxelEngine<'_> {
    /// What each move removes from what the moves before it left, by voxels of `voxel` mm; rapid moves cut
    /// like all others and are told. It takes no more memory than the moves and their figures do.
    ///
    /// # Errors
    /// [`VoxelError::Voxel`], also where there are more voxels than can be counted;
    /// [`VoxelError::Cancelled`].
    ///
    /// # Tolerance
    /// Volumes hold within their bounds where faces bend by no more than their radius within a voxel and
    /// nothing thinner than a voxel is left standing free. Layers however thin are seen where they are
    /// lowered by more than [`ENGAGED`]. The bits do not depend on the number of threads.
    pub fn removal(&self, voxel: f64, monitor: &dyn Monitor) -> Result<VoxelRemoval, VoxelError> {
        check(monitor)?;
        let Some(lattice) = self.lattice(voxel)? else {
            return Err(VoxelError::Voxel(voxel));
        };
        let whole = RemovalCube {
            cube: Cube { low: [0; 3], n: lattice.side() },
            parts: (0..self.parts.all.len() as u32).collect(),
            tangents: Vec::new(),
            stock: true,
        };
        let Taken { moves: taken, partial } =
            descend(&Remover { engine: self, lattice }, whole, "removal by voxels", monitor)?;
        let mut moves = vec![MoveRemoval::default(); self.parts.moves()];
        let mut rapids = Vec::new();
        for (index, tally) in taken {
            moves[index as usize] = tally.removal(voxel);
            if let Some((travel, at)) = tally.first {
                rapids.push((RapidContact { move_index: index, at, travel, depth: 0.0 }, tally.deep));
            }
        }
        let deepest = |mut places: Vec<(f64, Point3)>, index: u32| {
            places.sort_by(|a, b| b.0.total_cmp(&a.0));
            // Where the place itself is not reached, the nearest one that is lies that much less deep.
            let short = |q: &Point3| {
                self.parts.of_move(index, q, f64::INFINITY).map_or(0.0, |at| at.distance.max(0.0))
            };
            let of = |(_, q): &(f64, Point3)| self.standing(q, index) - short(q);
            places.iter().take(MOST_PLACES).map(of).fold(moves[index as usize].depth, f64::max)
        };
        let rapid_contacts = parallel::map(rapids.len(), |k| {
            let (contact, deep) = &rapids[k];
            RapidContact { depth: deepest(deep.clone(), contact.move_index), ..*contact }
        });
        let volume_bound = PLANE * partial * voxel.powi(3);
        Ok(VoxelRemoval { moves, rapid_contacts, volume_bound })
    }

    /// How far inside of what stands before a move `q` lies, mm; below zero where nothing stands.
    pub(super) fn standing(&self, q: &Point3, before: u32) -> f64 {
        let in_stock = -self.stock.foot(q).0;
        (0..before).fold(in_stock, |now, index| {
            self.parts.of_move(index, q, now).map_or(now, |found| found.distance)
        })
    }
}

impl Descent for Remover<'_> {
    type Node = RemovalCube;
    type Tally = Taken;

    fn cube(piece: &RemovalCube) -> Cube {
        piece.cube
    }

    /// The parts of a cube in which more than one move, or the stock's surface, has a say; what a single one
    /// takes whole is put down.
    fn children(&self, parent: &RemovalCube, taken: &mut Taken) -> Vec<RemovalCube> {
        let engine = self.engine;
        let half_voxel = 0.5 * self.lattice.pitch;
        let mut children = Vec::new();
        for cube in parent.cube.children() {
            let centre = self.lattice.centre(&cube);
            let half = 0.5 * f64::from(cube.n - 1) * self.lattice.pitch;
            let reach = half * 3f64.sqrt();
            let from_stock = if parent.stock { engine.stock.foot(&centre).0 } else { f64::NEG_INFINITY };
            if from_stock - reach > half_voxel {
                continue;
            }
            let stock = from_stock + reach > -half_voxel;
            let (mut parts, mut tangents, mut covered) = (Vec::new(), Vec::new(), false);
            for &k in &parent.parts {
                let part = &engine.parts.all[k as usize];
                let Some(t) = engine.parts.tangent(part, &centre, reach, reach + half_voxel, LOOSE) else {
                    continue;
                };
                if t.lower - half * t.gradient.map(f64::abs).sum() >= half_voxel {
                    continue;
                }
                parts.push(k);
                if cube.n == SIDE {
                    tangents.push(t);
                }
                covered = t.distance + t.slack + reach <= -half_voxel;
                if covered {
                    break;
                }
            }
            if parts.len() == 1 && covered && !stock {
                self.take_whole(&cube, &centre, half, parts[0], taken);
            } else if !parts.is_empty() {
                children.push(RemovalCube { cube, parts, tangents, stock });
            }
        }
        children
    }

    fn leaf(&self, piece: &RemovalCube, taken: &mut Taken) {
        let (engine, pitch) = (self.engine, self.lattice.pitch);
        let centre = self.lattice.centre(&piece.cube);
        let half = 0.5 * f64::from(SIDE - 1) * pitch;
        let way = |lane: usize| Vector3::from_fn(|i, _| (lane >> (2 * i) & 3) as f64 * pitch - half);
        let mut left = [1.0f32; LANES];
        if piece.stock {
            left = std::array::from_fn(|lane| {
                (0.5 - engine.stock.foot(&(centre + way(lane))).0 / pitch).clamp(0.0, 1.0) as f32
            });
        }
        let begun = left;
        let engaged = (ENGAGED / pitch) as f32;
        for (earlier, (&k, tangent)) in piece.parts.iter().zip(&piece.tangents).enumerate() {
            let part = &engine.parts.all[k as usize];
            let shares = self.shares(part, k, tangent, &centre, half * 3f64.sqrt(), &left, way);
            let (mut sum, mut partial, mut most) = (0.0, 0.0, 0f32);
            let before = left;
            for lane in 0..LANES {
                let share = if shares[lane] < left[lane] { shares[lane] } else { left[lane] };
                let taken = left[lane] - share;
                sum += f64::from(taken);
                partial += if taken > 0.0 && taken < 1.0 { 1.0 } else { 0.0 };
                most = if taken > most { taken } else { most };
                left[lane] = share;
            }
            if sum > 0.0 {
                let tally = taken.moves.entry(part.index).or_default();
                (tally.sum, tally.partial) = (tally.sum + sum, tally.partial + partial);
                tally.share = tally.share.max(f64::from(most));
                let frame = Frame::of(engine.parts.motion(part.index));
                let lowered = |lane: &usize| before[*lane] - left[*lane] > engaged;
                for lane in (0..LANES).filter(lowered) {
                    let q = centre + way(lane);
                    tally.engage(&frame, &q);
                    if engine.rapids[part.index as usize] {
                        let near = (f64::from(before[lane]) - 0.5) * pitch - ENGAGED;
                        let before =
                            piece.tangents[..earlier].iter().map(|t| t.lower + t.gradient.dot(&way(lane)));
                        let depth = before.fold(-engine.stock.foot(&q).0, f64::min);
                        self.touch(tally, part.index, &q, near, depth);
                    }
                }
                if left == [0.0; LANES] {
                    break;
                }
            }
        }
        let in_part = |lane: &usize| {
            let (begun, left) = (begun[*lane], left[*lane]);
            left < begun && (begun < 1.0 || left > 0.0)
        };
        taken.partial += (0..LANES).filter(in_part).count() as f64;
    }

    fn add(total: &mut Taken, taken: Taken) {
        for (index, tally) in taken.moves {
            total.moves.entry(index).or_default().add(tally);
        }
        total.partial += taken.partial;
    }
}

impl Remover<'_> {
    /// Puts down a cube that one part takes whole.
    fn take_whole(&self, cube: &Cube, centre: &Point3, half: f64, part: u32, taken: &mut Taken) {
        let index = self.engine.parts.all[part as usize].index;
        let tally = taken.moves.entry(index).or_default();
        tally.sum += f64::from(cube.n).powi(3);
        tally.share = 1.0;
        let frame = Frame::of(self.engine.parts.motion(index));
        for k in 0..8 {
            let q = centre + corner(k) * half;
            tally.engage(&frame, &q);
            if self.engine.rapids[index as usize] {
                let depth = -self.engine.stock.foot(&q).0;
                self.touch(tally, index, &q, 0.5 * self.lattice.pitch, depth);
            }
        }
    }

    /// Puts down a place that a rapid move takes. As long as it is no nearer than `near`, mm, it takes
    /// nothing there, which lies about `depth` deep in what stands.
    fn touch(&self, tally: &mut Tally, index: u32, q: &Point3, near: f64, depth: f64) {
        let motion = self.engine.parts.motion(index);
        let tolerance = TOUCH * self.lattice.pitch;
        let t = self.engine.parts.first_within(index, q, near, tolerance, MOST_LOOKS);
        let travel = (motion.at(t).tip - motion.at(0.0).tip).norm();
        if tally.first.is_none_or(|first| travel < first.0) {
            tally.first = Some((travel, *q));
        }
        if tally.deep.first().is_none_or(|deepest| depth > deepest.0) {
            tally.deep = vec![(depth, *q)];
        }
    }

    /// The share of each voxel that a part leaves, where something is left.
    fn shares(
        &self,
        part: &MotionPart,
        index: u32,
        tangent: &Tangent,
        centre: &Point3,
        reach: f64,
        left: &[f32; LANES],
        way: impl Fn(usize) -> Vector3,
    ) -> [f32; LANES] {
        let (parts, pitch) = (&self.engine.parts, self.lattice.pitch);
        if let (Some(kernel), Some(radius)) =
            (Kernel::new(parts, part, index, centre, reach), parts.solid.ball())
        {
            let (scale, radius) = ((1.0 / pitch) as f32, radius as f32);
            return lanes::dispatch(
                #[inline(always)]
                || {
                    let squared = Lanes::of(std::slice::from_ref(&kernel), pitch as f32).squared;
                    let share = |lane: usize| (0.5 + (squared[lane].sqrt() - radius) * scale).max(0.0);
                    std::array::from_fn(share)
                },
            );
        }
        let half_voxel = 0.5 * pitch;
        std::array::from_fn(|lane| {
            if left[lane] == 0.0 {
                return 0.0;
            }
            let way = way(lane);
            // What leaves all that is left takes nothing.
            let limit = (f64::from(left[lane]) - 0.5) * pitch;
            if tangent.lower + tangent.gradient.dot(&way) >= limit {
                return 1.0;
            }
            if tangent.distance + tangent.slack + way.norm() <= -half_voxel {
                return 0.0;
            }
            let found = parts.distance(part, &(centre + way), limit);
            found.map_or(1.0, |d| (0.5 + d / pitch).max(0.0) as f32)
        })
    }
}
