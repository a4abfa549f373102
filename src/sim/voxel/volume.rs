//! What a path leaves of a stock and takes from it: volumes between proven bounds. mm, mm³.
//!
//! # The bound
//! The signed distance d from what a move sweeps is a convex function. Over a cube it lies above its tangent
//! plane at the middle, and below the parallel plane that is as high as d at all corners. So what moves leave
//! of a cube lies within the upper sides of all upper planes and holds what lies in those of all lower ones:
//! two convex solids, whose volumes have closed forms. A block's faces are planes; a bar's side lies between
//! two. A cube is divided until both volumes are near each other. On flat faces and on ridges between them
//! they are equal at once; along bent ones they differ by the second order of the cube. The distance of any
//! other stock is only known to change by no more than the place moves.

use super::bricks::Lattice;
use super::cube::Cube;
use super::engine::VoxelEngine;
use super::error::VoxelError;
use super::moves::Tangent;
use super::octree::{Descent, SIDE, descend};
use crate::stock::{StockSides, corner};
use geometry::{HalfSpace, Point3, Polytope, Vector3};
use work::monitor::{Monitor, check};

/// Least cubes along the side of a voxel. More tighten the bound at the tool's sharp edges and take twice as
/// long there.
const FINEST: f64 = 4.0;

/// A cube is not divided where its bounds differ by a layer of so many voxels or less on one of its sides.
/// Less takes longer, more widens the bounds.
const THIN: f64 = 0.015;

/// Of larger cubes than so many voxels the layer counts on so much only: no single cube may have most of the
/// width.
const WIDE: f64 = 4.0;

/// More moves than this in one cube: parts of it see fewer, and cost less.
const MANY: usize = 12;

/// How loose tangent planes may be, as a share of the cube. What they are loose by is lost to the bound.
const LOOSE: f64 = 1e-4;

/// Rounding of distances, mm: those of sliding tools are least to 1e-9.
const SURE: f64 = 1e-8;

/// Rounding of the sums, as a share of the box around the stock.
const ROUNDING: f64 = 1e-12;

/// What all of a cube is taken from.
const NOTHING: HalfSpace = HalfSpace { gradient: Vector3::new(0.0, 0.0, 0.0), offset: -1.0 };

/// Volumes, mm³, each between two bounds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VoxelVolumes {
    /// What is left of the stock.
    pub left: [f64; 2],
    /// What the moves take from it.
    pub removed: [f64; 2],
}

/// The sum of volumes between bounds.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Sums {
    left: [f64; 2],
    removed: [f64; 2],
}

/// A cube, the parts that may take something of it, and its volumes.
struct VolumeCube {
    cube: Cube,
    parts: Vec<u32>,
    stock: bool,
    sums: Sums,
}

struct Measure<'a> {
    engine: &'a VoxelEngine<'a>,
    lattice: Lattice,
    /// A layer between bounds that no cube is divided for, and how wide it is at most, mm.
    thin: f64,
    wide: f64,
}

/// The planes below and above the distance from a part.
struct Sandwich {
    lower: HalfSpace,
    upper: HalfSpace,
}

impl Sums {
    fn add(&mut self, other: &Self) {
        for k in 0..2 {
            self.left[k] += other.left[k];
            self.removed[k] += other.removed[k];
        }
    }

    fn widest(&self) -> f64 {
        (self.left[1] - self.left[0]).max(self.removed[1] - self.removed[0])
    }
}

impl VoxelEngine<'_> {
    /// Volumes of what the path leaves and takes. Cubes are divided down to a quarter of `voxel` mm, where
    /// they need be.
    ///
    /// # Errors
    /// [`VoxelError::Voxel`], also where there are more voxels than can be counted;
    /// [`VoxelError::Cancelled`].
    ///
    /// # Tolerance
    /// The true volumes lie within the bounds, also those of a [`roughed`](crate::Stock::roughed) block whose
    /// surface is closed. The bits do not depend on the number of threads.
    pub fn volumes(&self, voxel: f64, monitor: &dyn Monitor) -> Result<VoxelVolumes, VoxelError> {
        check(monitor)?;
        self.lattice(voxel)?;
        let Some(lattice) = self.lattice(voxel / (FINEST * f64::from(SIDE)))? else {
            return Err(VoxelError::Voxel(voxel));
        };
        let whole = VolumeCube {
            cube: Cube { low: [0; 3], n: lattice.side() },
            parts: (0..self.parts.all.len() as u32).collect(),
            stock: true,
            sums: Sums::default(),
        };
        let measure = Measure { engine: self, lattice, thin: THIN * voxel, wide: WIDE * voxel };
        let Sums { mut left, mut removed } = descend(&measure, whole, "volumes", monitor)?;
        let rounding = ROUNDING * self.stock.bounds().size().product();
        removed = [removed[0] - rounding, removed[1] + rounding].map(|x| x.max(0.0));
        left = match self.stock.volume() {
            Some(exact) => [exact - removed[1], exact - removed[0]],
            None => [left[0] - rounding, left[1] + rounding],
        }
        .map(|x| x.max(0.0));
        Ok(VoxelVolumes { left, removed })
    }
}

impl Measure<'_> {
    /// Middle of a cube and half its side.
    fn place(&self, cube: &Cube) -> (Point3, f64) {
        let half = 0.5 * f64::from(cube.n) * self.lattice.pitch;
        (self.lattice.place(cube.low) + Vector3::from_element(half), half)
    }

    /// Those of the listed parts that take something of a cube, and their planes; a single one where it takes
    /// all. No planes where they are too many for a cube that can be divided.
    fn cut(
        &self,
        listed: &[u32],
        centre: &Point3,
        half: f64,
        divided: bool,
    ) -> (Vec<u32>, Option<Vec<Sandwich>>) {
        let moves = &self.engine.parts;
        let reach = half * 3f64.sqrt();
        let lower = |t: &Tangent| HalfSpace { gradient: t.gradient, offset: t.lower - SURE };
        let takes = |&k: &u32| {
            let t = moves.tangent(&moves.all[k as usize], centre, reach, reach + SURE, LOOSE)?;
            (lower(&t).least(half) < 0.0).then_some((k, t))
        };
        let mut near: Vec<(u32, Tangent)> = listed.iter().filter_map(takes).collect();
        let nearest = |a: &(u32, Tangent), b: &(u32, Tangent)| a.1.distance.total_cmp(&b.1.distance);
        let Some(best) = near.iter().copied().min_by(nearest) else { return (Vec::new(), Some(Vec::new())) };
        let upper = |(k, t): &(u32, Tangent)| {
            let above = moves.corners(&moves.all[*k as usize], t, centre, half, LOOSE).map(|d| d + SURE);
            let over = |c: usize| above[c] - half * t.gradient.dot(&corner(c));
            let offset = (0..8).map(over).fold(f64::NEG_INFINITY, f64::max);
            (HalfSpace { gradient: t.gradient, offset }, above.iter().all(|d| *d < 0.0))
        };
        let (most, all) = upper(&best);
        if all {
            return (vec![best.0], Some(vec![Sandwich { lower: NOTHING, upper: NOTHING }]));
        }
        // What the nearest one takes in any case nobody else needs to take.
        near.retain(|(k, t)| *k == best.0 || !most.is_below(&lower(t), half));
        let kept = near.iter().map(|(k, _)| *k).collect();
        if divided && near.len() > MANY {
            return (kept, None);
        }
        let planes = near.iter().map(|one| {
            let upper = if one.0 == best.0 { most } else { upper(one).0 };
            Sandwich { lower: lower(&one.1), upper }
        });
        (kept, Some(planes.collect()))
    }

    /// Volumes of a cube of half side `half`, of the stock's sides there and of what its moves leave.
    fn sums(&self, stock: &StockSides, planes: &[Sandwich], half: f64) -> Sums {
        let within = |sides: &[HalfSpace]| {
            let mut solid = Polytope::default();
            solid.set_cube(half);
            sides.iter().for_each(|side| solid.clip(side));
            solid
        };
        let mut cut = Polytope::default();
        let mut left = |stock: &Polytope, side: fn(&Sandwich) -> &HalfSpace| {
            cut.set(stock);
            planes.iter().for_each(|plane| cut.clip(side(plane)));
            cut.volume()
        };
        let outer = within(&stock.outer);
        let whole = outer.volume();
        let most = left(&outer, |plane| &plane.upper);
        if stock.is_exact() {
            let least = left(&outer, |plane| &plane.lower);
            return Sums { left: [least, most], removed: [whole - most, whole - least] };
        }
        let (mut least, mut surely) = (0.0, 0.0);
        if let Some(sides) = &stock.inner {
            let inner = within(sides);
            least = left(&inner, |plane| &plane.lower);
            surely = inner.volume() - left(&inner, |plane| &plane.upper);
        }
        Sums { left: [least, most], removed: [surely, whole - left(&outer, |plane| &plane.lower)] }
    }
}

impl Descent for Measure<'_> {
    type Node = VolumeCube;
    type Tally = Sums;

    fn cube(piece: &VolumeCube) -> Cube {
        piece.cube
    }

    fn children(&self, parent: &VolumeCube, found: &mut Sums) -> Vec<VolumeCube> {
        let mut children = Vec::new();
        for cube in parent.cube.children() {
            let (centre, half) = self.place(&cube);
            let reach = half * 3f64.sqrt();
            let from_stock = if parent.stock { self.engine.stock.foot(&centre).0 } else { f64::NEG_INFINITY };
            if from_stock > reach + SURE {
                continue;
            }
            let stock = from_stock > -reach - SURE;
            let sides = if stock { self.engine.stock.sides(&centre, half) } else { StockSides::default() };
            let (parts, planes) = self.cut(&parent.parts, &centre, half, cube.n > SIDE);
            let sums = planes.map(|planes| self.sums(&sides, &planes, half));
            match sums {
                Some(sums) if sums.widest() <= self.thin * (2.0 * half).min(self.wide).powi(2) => {
                    found.add(&sums)
                }
                _ => children.push(VolumeCube { cube, parts, stock, sums: sums.unwrap_or_default() }),
            }
        }
        children
    }

    fn leaf(&self, piece: &VolumeCube, found: &mut Sums) {
        found.add(&piece.sums);
    }

    fn add(total: &mut Sums, found: Sums) {
        total.add(&found);
    }
}
