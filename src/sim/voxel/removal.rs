//! What each move removes, in the order of the program: a voxel belongs to the first move that covers it.
//!
//! A voxel at signed distance d from a move, in voxels, is left by it to the share `½ + d`, within 0 and 1. Of
//! a voxel each move takes what it leaves less than all before it, so that the volumes add up to all that is
//! removed.

use super::bricks::{BLOCK, Lattice};
use super::capsule::{Kernel, LANES, Lanes};
use super::divide::Cube;
use super::moves::Part;
use super::{VoxelEngine, VoxelError};
use crate::geometry::{Point3, Vector3};
use crate::lanes;
use crate::monitor::{Cancelled, Monitor, check};
use crate::parallel;
use std::collections::BTreeMap;

/// Samples along the side of the least cube.
const SIDE: u32 = 4;

/// Volumes by move.
type Taken = BTreeMap<u32, f64>;

/// A cube with the parts that take something in it, in order.
struct Piece {
    cube: Cube,
    parts: Vec<u32>,
    /// Whether voxels at the stock's surface may be among them.
    stock: bool,
}

struct Remover<'a> {
    engine: &'a VoxelEngine<'a>,
    lattice: Lattice,
}

impl VoxelEngine<'_> {
    /// Volume that each move removes from what the moves before it left, mm³, by voxels of `voxel` mm. It
    /// takes no more memory than the moves and their volumes do.
    ///
    /// # Errors
    /// [`VoxelError::Voxel`], also where there are more voxels than can be counted; [`VoxelError::Cancelled`].
    ///
    /// # Tolerance
    /// The sum differs from what is missing of [`Voxels`](super::Voxels) by what edges and curvature do within a
    /// voxel: about a tenth of voxel² for each mm of an edge. Layers thinner than a voxel count in full.
    pub fn removed_by_move(&self, voxel: f64, monitor: &dyn Monitor) -> Result<Vec<f64>, VoxelError> {
        check(monitor)?;
        let Some(lattice) = self.lattice(voxel)? else {
            return Err(VoxelError::Voxel(voxel));
        };
        let remover = Remover { engine: self, lattice };
        let mut volumes = vec![0.0; self.parts.moves()];
        for (index, share) in remover.run(monitor)? {
            volumes[index as usize] += share * voxel.powi(3);
        }
        Ok(volumes)
    }
}

impl Remover<'_> {
    fn run(&self, monitor: &dyn Monitor) -> Result<Taken, Cancelled> {
        let whole = Cube { low: [0; 3], n: self.lattice.side() };
        let parts = (0..self.engine.parts.all.len() as u32).collect();
        let mut level = vec![Piece { cube: whole, parts, stock: true }];
        let mut total = Taken::new();
        while level.first().is_some_and(|piece| piece.cube.n > BLOCK) {
            check(monitor)?;
            let divided = parallel::map(level.len(), |k| {
                let mut taken = Taken::new();
                (self.children(&level[k], &mut taken), taken)
            });
            level.clear();
            for (children, taken) in divided {
                level.extend(children);
                add(&mut total, taken);
            }
        }
        monitor.start("removal by voxels", level.len() as u64);
        let blocks = parallel::try_map(level.len(), |k| {
            check(monitor)?;
            let mut taken = Taken::new();
            self.divide(&level[k], &mut taken);
            monitor.advance(1);
            Ok(taken)
        })?;
        blocks.into_iter().for_each(|taken| add(&mut total, taken));
        Ok(total)
    }

    fn divide(&self, piece: &Piece, taken: &mut Taken) {
        for child in self.children(piece, taken) {
            if child.cube.n == SIDE { self.leaf(&child, taken) } else { self.divide(&child, taken) }
        }
    }

    /// The parts of a cube in which more than one move, or the stock's surface, has a say; what a single one
    /// takes whole is put down.
    fn children(&self, parent: &Piece, taken: &mut Taken) -> Vec<Piece> {
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
            let (mut parts, mut covered) = (Vec::new(), false);
            for &k in &parent.parts {
                let part = &engine.parts.all[k as usize];
                let Some(t) = engine.parts.tangent(part, &centre, reach, reach + half_voxel) else {
                    continue;
                };
                if t.lower - half * t.gradient.map(f64::abs).sum() >= half_voxel {
                    continue;
                }
                parts.push(k);
                covered = t.distance + t.slack + reach <= -half_voxel;
                if covered {
                    break;
                }
            }
            if parts.len() == 1 && covered && !stock {
                let index = engine.parts.all[parts[0] as usize].index;
                *taken.entry(index).or_default() += f64::from(cube.n).powi(3);
            } else if !parts.is_empty() {
                children.push(Piece { cube, parts, stock });
            }
        }
        children
    }

    fn leaf(&self, piece: &Piece, taken: &mut Taken) {
        let (engine, pitch) = (self.engine, self.lattice.pitch);
        let centre = self.lattice.centre(&piece.cube);
        let half = 0.5 * f64::from(SIDE - 1) * pitch;
        let place =
            |lane: usize| centre + Vector3::from_fn(|i, _| (lane >> (2 * i) & 3) as f64 * pitch - half);
        let mut left = [1.0f32; LANES];
        if piece.stock {
            left = std::array::from_fn(|lane| {
                (0.5 - engine.stock.foot(&place(lane)).0 / pitch).clamp(0.0, 1.0) as f32
            });
        }
        for &k in &piece.parts {
            let part = &engine.parts.all[k as usize];
            let shares = self.shares(part, k, &centre, half * 3f64.sqrt(), &left, place);
            let mut sum = 0.0;
            for lane in 0..LANES {
                let share = if shares[lane] < left[lane] { shares[lane] } else { left[lane] };
                sum += f64::from(left[lane] - share);
                left[lane] = share;
            }
            if sum > 0.0 {
                *taken.entry(part.index).or_default() += sum;
            }
        }
    }

    /// The share of each voxel that a part leaves, where something is left.
    fn shares(
        &self,
        part: &Part,
        index: u32,
        centre: &Point3,
        reach: f64,
        left: &[f32; LANES],
        place: impl Fn(usize) -> Point3,
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
        std::array::from_fn(|lane| {
            if left[lane] == 0.0 {
                return 0.0;
            }
            let found = parts.distance(part, &place(lane), 0.5 * pitch);
            found.map_or(1.0, |d| (0.5 + d / pitch).max(0.0) as f32)
        })
    }
}

fn add(total: &mut Taken, taken: Taken) {
    for (index, share) in taken {
        *total.entry(index).or_default() += share;
    }
}
